# SPDX-License-Identifier: MIT
"""The report of a run or an ensemble as one self-contained HTML page: numbers, pictures, replay of the ice field,
provenance.

The page loads nothing: styles, script, pictures and data are embedded, and its content security policy forbids all
else. So it can be mailed, archived and opened offline. The template engine escapes text from case files.
"""
import base64
import hashlib
from datetime import datetime, timezone
from pathlib import Path

from bergtow import arguments, progress, writing
from bergtow.errors import USAGE, BergtowError, RunError
from bergtow.plot import style, vector
from bergtow.reporting import pdf
from bergtow.reporting import run as report_run
from bergtow.reporting.replay import LIMIT
from bergtow.result.origins import TITLE_BLOCK
from bergtow.result.run import Run
from bergtow.said import say
from bergtow.study import analysis

import jinja2

PAGE = Path(__file__).resolve().parent / "page"
#: columns of members.csv
MEMBER = "name", "condition", "seed", "status", "mean_ice_resistance_n", "low_95_n", "high_95_n", "doubts"
MAX_TITLE = 80  #: characters in the running head


def templates():
    """The template engine. A name that is missing from the context is an error, not an empty text."""
    engine = jinja2.Environment(loader=jinja2.FileSystemLoader(PAGE), autoescape=True,
                                undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    engine.filters["by_name"] = by_name
    return engine


def by_name(rows):
    """[(first cell, rows)] of a table; a row whose first cell is empty or repeated belongs to the row above."""
    out = []
    for row in rows:
        if not out or row[0] not in ("", out[-1][0]):
            out.append((row[0], []))
        out[-1][1].append(row)
    return out


def script():
    """The replay's script, wrapped in one function."""
    parts = [(PAGE / name).read_text(encoding="utf-8") for name in ("replay.js", "raster.js", "replay_controls.js")]
    return "(() => {\n" + "\n".join(parts) + "})();\n"


def policy(code):
    """Content security policy: no network access, and only the one script, identified by its hash."""
    digest = base64.b64encode(hashlib.sha256(code.encode("utf-8")).digest()).decode("ascii")
    return (f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; "
            "base-uri 'none'; form-action 'none'")


def quoted(text):
    """A CSS string. All but plain letters and digits are escaped, so that they end neither string nor style."""
    return '"' + "".join(c if c.isalnum() and c.isascii() or c == " " else f"\\{ord(c):x} " for c in text) + '"'


def head_of_pages(title, right):
    """The running head and foot of the printed page."""
    left = title if len(title) <= MAX_TITLE else title[:MAX_TITLE - 1].rstrip() + "…"
    box = 'font: 7.6pt "DejaVu Sans", Verdana, sans-serif; color: #5a6672; vertical-align: bottom; padding-bottom: 4mm;'
    foot = box.replace("bottom; padding-bottom", "top; padding-top")
    return (f"@page {{ @top-left {{ content: {quoted(left)}; width: 75%; text-align: left; {box} }}\n"
            f"@top-right {{ content: {quoted(right)}; text-align: right; {box} }}\n"
            f'@bottom-left {{ content: "bergtow"; text-align: left; {foot} }}\n'
            f'@bottom-right {{ content: counter(page) " of " counter(pages); text-align: right; {foot} }} }}\n')


def css(title, marked):
    light, dark = vector.styles()
    return "\n".join([(PAGE / "report.css").read_text(encoding="utf-8"), f":root {{ {light} }}",
                      f"@media (prefers-color-scheme: dark) {{ @media not print {{ :root {{ {dark} }} }} }}",
                      (PAGE / "paper.css").read_text(encoding="utf-8"), head_of_pages(title, marked)])


def render(template, context, paper=False):
    """The page as text; paper: for a PDF."""
    code = script() if "replay" in context and not paper else ""
    return templates().get_template(template).render(**context, code=code, paper=paper, mark=writing.MARK,
                                                     policy=policy(code), css=css(context["title"], context["marked"]),
                                                     made=datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC"))


def options(p):
    arguments.add_run(p, "report.html")
    p.add_argument("--size", metavar="MB", type=float, default=LIMIT / 1e6, help="limit of the replay's data in the "
                   "page; frames, then floes, are left out to meet it, and the page reports this (default: "
                   "%(default)g)")
    p.add_argument("--no-compression", action="store_true",
                   help="store the replay's data as they are, for browsers that cannot unpack them")
    for name in TITLE_BLOCK:
        p.add_argument(f"--{name}", metavar="TEXT", help=f"{name} in the title block, in place of report.{name} of the "
                       "case")
    p.add_argument("--also", metavar="DIR", action="append", type=Path, default=[],
                   help="take results of converge and other commands from this folder into the report of an "
                   "ensemble; may be repeated")


def perform(a):
    if not 0.1 <= a.size <= 1000:
        raise BergtowError("--size: choose 0.1 to 1000 MB", USAGE)
    path = arguments.output(a, "report.html", (".html", ".htm", ".pdf"))
    write(Path(a.run), [path], {name: getattr(a, name) for name in TITLE_BLOCK}, a.also, a.size, not a.no_compression,
          a.force)


@style.look()
def pages(folder, paths, given, also, size, compressed):
    """({path: text}, members) for the report of a folder, as HTML or, for a PDF, in print layout. Raises RunError."""
    # study.resolved.yml alone: the ensemble has only just begun
    if any((folder / name).exists() for name in ("ensemble.h5", "study.resolved.yml")):
        from bergtow.reporting import ensemble as report_ensemble  # not needed for a run: it loads the statistics
        analysis.also(also)
        template, context = "ensemble.html", report_ensemble.context(folder, paths[0], given, also)
    else:
        if also:
            raise RunError(folder, "is a run, but --also is for an ensemble", "leave --also out")
        with Run(folder) as run:
            if not len(run["time"]):
                raise RunError(folder, "has no step to report on", "continue it with bergtow resume")
            template, context = "run.html", report_run.context(run, 1e6 * size, compressed, given)
    return {path: render(template, context, is_pdf(path)) for path in paths}, context.get("members", [])


def is_pdf(path):
    return path.suffix.lower() == ".pdf"


def write(folder, paths, given=None, also=(), size=LIMIT / 1e6, compressed=True, force=False):
    """Write the report of a folder to one or more files. given: {name: text or None} for the title block; also: folders
    with analyses; size: MB of the replay's data. Raises RunError."""
    given = dict.fromkeys(TITLE_BLOCK) | (given or {})
    with progress.doing(paths[0].name):
        made, members = pages(folder, paths, given, also, size, compressed)
    for path, text in made.items():
        if is_pdf(path):
            with progress.doing(path.name):
                pdf.write(text, path, force)
            if members:  # on paper a condition has only one row
                writing.write_csv([{k: m[k] for k in MEMBER} for m in members], path.with_name("members.csv"), force)
        else:
            writing.write_text(text, path, force)
        say(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")
