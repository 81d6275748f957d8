# SPDX-License-Identifier: MIT
"""Sources of the manual in one folder: the pages of docs/, what they link to, and the references, which are written
from the program's own tables and from the comments of its headers.

Files keep their places relative to each other, so that a link leads to the same file on paper, in the repository and in
the manual. A page that is linked becomes part of the manual, any other file can be downloaded from it. Rejected:
Doxygen with Breathe for the headers, ten times as large as Sphinx itself for two dozen files whose comments already
are sentences.
"""
import re
import shutil
from pathlib import Path

import headers
import tables

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"!?\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s#]+)(?:#[^)\s]*)?\)")
FOLDERS = ("basin", "field", "fullscale", "outlines", "route", "studies", "validation", "scaling")


def links(page):
    """Files inside the repository that a page links to, or that its table of contents names."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.S | re.M)
    yield from ((page.parent / f"{name}.md").resolve() for name in re.findall(r"^(\.\./[\w/.-]+)$", text, re.M))
    for match in LINK.finditer(text):
        if not re.match(r"[a-z]+:", match[2]):
            yield (page.parent / match[2]).resolve()


def stage(out):
    """Copy the pages and, from link to link, what they name."""
    open_, seen = sorted((ROOT / "docs").rglob("*.md")), set()
    while open_:
        path = open_.pop()
        if path in seen or not path.is_relative_to(ROOT):
            continue
        seen.add(path)
        if path.is_dir():
            open_.append(path / "README.md")
            continue
        place = out / path.relative_to(ROOT)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, place)
        if path.suffix == ".md":
            open_ += links(path)


def gallery(out):
    """Every picture of the cases with what is said of it, and the page that tells how it was made."""
    page = ["# Gallery", "", "Pictures of the example cases. The page behind each says which commands make it.", ""]
    for folder in FOLDERS:
        readme = ROOT / "cases" / folder / "README.md"
        text = readme.read_text(encoding="utf-8")
        pictures = [m for m in re.finditer(r"!\[([^\]]*)\]\(([^)]+\.png)\)", text)
                    if (readme.parent / m[2]).exists()]
        if pictures:
            page += [f"## {re.search(r'^# (.*)', text, re.M)[1]}", "", f"[Commands, numbers and limits]"
                     f"(../../cases/{folder}/README.md)", ""]
        for match in pictures:
            page += [f"![{match[1]}](../../cases/{folder}/{match[2]})", "", f"*{' '.join(match[1].split())}*", ""]
    tables.write(out / "gallery.md", "\n".join(page))


def pages(program, out):
    """Everything, into an empty folder."""
    shutil.rmtree(out, ignore_errors=True)
    stage(out)
    reference = out / "docs/reference"
    tables.keys(program, reference)
    tables.quantities(program, reference)
    tables.commands(program, reference)
    headers.pages(ROOT / "include/bergtow", reference / "c")
    tables.write(reference / "python.md", """\
# Python API

The package `bergtow` of postproc/. How to install it, and examples: [the library](../library.md).

```{eval-rst}
.. automodule:: bergtow
   :members:
   :undoc-members:
   :imported-members:

.. autodata:: bergtow.Force
   :no-value:

.. automodule:: bergtow.towing
   :members:
   :undoc-members:
   :imported-members:
```
""")
    gallery(reference)
