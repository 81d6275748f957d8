# SPDX-License-Identifier: MIT
"""The report of a run, or of an ensemble, as one HTML page that needs nothing else: numbers, pictures, replay of the
ice field, provenance.

The page loads nothing: styles, script, pictures and data stand in it, and its content security policy forbids all else,
so that it can be mailed, archived and opened offline. Text from case files is escaped by the template engine.
"""
import base64
import hashlib
from datetime import datetime, timezone
from pathlib import Path

import command
import report_run
from bergtow_read import Run, RunError
from replay import LIMIT

import jinja2

PAGE = Path(__file__).resolve().parent / "page"


def templates():
    """The template engine; a name that is missing in the context is an error, not an empty text."""
    return jinja2.Environment(loader=jinja2.FileSystemLoader(PAGE),
                              autoescape=True,
                              undefined=jinja2.StrictUndefined,
                              trim_blocks=True,
                              lstrip_blocks=True)


def script():
    """The replay's script, as one function."""
    parts = [(PAGE / name).read_text(encoding="utf-8") for name in ("replay.js", "replay_controls.js")]
    return "(() => {\n" + "\n".join(parts) + "})();\n"


def policy(code):
    """Content security policy: no network at all, the one script by its hash."""
    digest = base64.b64encode(hashlib.sha256(code.encode("utf-8")).digest()).decode("ascii")
    return (f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; "
            "base-uri 'none'; form-action 'none'")


def render(template, context):
    """The page as text."""
    code = script() if "replay" in context else ""
    return templates().get_template(template).render(**context,
                                                     code=code,
                                                     policy=policy(code),
                                                     css=(PAGE / "report.css").read_text(encoding="utf-8"),
                                                     made=datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC"))


def write(text, path):
    """Write the page; under another name first, so that an old page stays whole. Errors: RunError."""
    new = path.with_name(path.name + ".new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        new.write_text(text, encoding="utf-8")
        new.replace(path)
    except OSError as error:
        raise RunError(path, f"cannot be written ({error.strerror or error})", "choose another place with -o") from None
    print(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")


def main(argv=None):
    p = command.parser(
        "Write the report of a run, with a replay of the ice field, or of an ensemble, as one HTML page.",
        "report.html")
    p.add_argument(
        "--size",
        metavar="MB",
        type=float,
        default=LIMIT / 1e6,
        help=
        "limit of the replay's data in the page; frames, then floes, are left out to meet it, and the page says so "
        "(default: %(default)g)"
    )
    p.add_argument("--no-compression",
                   action="store_true",
                   help="store the replay's data as they are, for browsers that cannot unpack them")
    a = p.parse_args(argv)
    if not 0.1 <= a.size <= 1000:
        p.error("--size: choose 0.1 to 1000 MB")
    path = command.output(p, a, "report.html", (".html", ".htm"))
    # the second alone: it has only just begun
    if any((Path(a.run) / name).exists() for name in ("ensemble.h5", "study.resolved.yml")):
        import report_ensemble  # and with it the statistics, which a run has no need of
        write(render("ensemble.html", report_ensemble.context(a.run)), path)
        return
    with Run(a.run) as run:
        write(render("run.html", report_run.context(run, 1e6 * a.size, not a.no_compression)), path)


if __name__ == "__main__":
    command.guarded(main)
