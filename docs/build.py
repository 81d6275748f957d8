#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""The manual as HTML and as PDF, by Sphinx.

    docs/build.py BERGTOW FOLDER [--no-pdf]

writes FOLDER/html/index.html and FOLDER/bergtow.pdf. Any warning of Sphinx, as of a link that leads nowhere, is an
error. The PDF is the manual on one page, printed by the Chromium that also makes the reports (postproc/pdf.py).
Rejected: LaTeX, more than a gigabyte for the same pages; rst2pdf, which does not know Markdown's tables of this width.
"""
import re
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "postproc"))

import stage  # noqa: E402

HOME = """<!DOCTYPE html>
<meta charset="utf-8"><title>bergtow</title><meta http-equiv="refresh" content="0; url=docs/index.html">
<a href="docs/index.html">The manual of bergtow</a>
"""


def sphinx(kind, out, *more):
    call = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", kind, "-d", out / f"doctrees-{kind}",
            "-c", HERE, *more, out / "source", out / kind]
    if subprocess.run([str(word) for word in call]).returncode:
        sys.exit(f"docs/build.py: Sphinx ({kind}) complains; see above")


def printed(html, folder):
    """The page with its pictures and styles by their full names; links within it stay there, others to files go."""
    html = re.sub(r'(<(?:img|link)\b[^>]*?\b(?:src|href)=")(?![a-z]+:)([^"?]+)',
                  lambda m: m[1] + (folder / m[2]).resolve().as_uri(), html)
    html = re.sub(r'\bhref="[^":#]*#', 'href="#', html)
    html = re.sub(r'<a class="reference download[^>]*>(.*?)</a>', r"\1", html, flags=re.S)
    return re.sub(r"<script\b.*?</script>", "", html, flags=re.S)


def main(program, out, with_pdf=True):
    out = Path(out).resolve()
    stage.pages(program, out / "source")
    sphinx("html", out)
    (out / "html/index.html").write_text(HOME)
    print(f"manual: {out / 'html/index.html'}")
    if with_pdf:
        from bergtow.reporting import pdf
        sphinx("singlehtml", out, "-D", "html_theme=alabaster", "-D", "html_theme_options.nosidebar=1")
        page = out / "singlehtml/docs/index.html"
        pdf.write(printed(page.read_text(encoding="utf-8"), page.parent), out / "bergtow.pdf", True)
        print(f"manual: {out / 'bergtow.pdf'}")


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4) or sys.argv[3:] not in ([], ["--no-pdf"]):
        sys.exit("usage: docs/build.py BERGTOW FOLDER [--no-pdf]")
    main(*sys.argv[1:3], with_pdf=len(sys.argv) == 3)
