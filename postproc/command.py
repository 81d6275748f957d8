# SPDX-License-Identifier: MIT
"""What the scripts share at the command line: arguments, exit codes, messages in place of tracebacks, and files that
are written.

Exit codes: 0 done, 2 usage, 4 a file cannot be read or written, 6 stopped by the user or a signal; and those of the
program where it refuses a case or a run of it fails.

A file that is there is replaced only if a script of this folder made it, or with --force. Each file that they write
carries MARK: a PNG and an MP4 in their texts, a PDF, an SVG and a page in their metadata, JSON and CSV as `made_by`,
Markdown in a comment. Rejected: a list of the files in the folder, which knows nothing of a file that was moved there.
"""
import argparse
import csv
import io
import json
import math
import mmap
import os
import signal
import sys
from contextlib import contextmanager, suppress
from pathlib import Path

import lacking

sys.excepthook = lacking.hook  # before what follows, which needs more than Python itself

from bergtow_read import RunError  # noqa: E402

import numpy as np

PICTURES = (".png", ".pdf", ".svg")
MARK = "made by bergtow postproc, which may replace it"
#: where matplotlib puts the mark, by the end of a picture's name
PLACES = {".png": "Software", ".pdf": "Producer", ".svg": "Source"}


def parser(description, output):
    """An argument parser with RUN, -o/--output (default: RUN/output) and --force."""
    p = argparse.ArgumentParser(description=description)
    p.add_argument("run", metavar="RUN", help="output folder of a run")
    p.add_argument("-o", "--output", metavar="FILE", type=Path, help=f"file to write (default: RUN/{output})")
    add_force(p)
    return p


def add_force(p):
    p.add_argument("--force", action="store_true", help="replace a file that is there, whoever made it")


def output(p, arguments, default, allowed):
    """Path to write to. Ends with a usage error when its name does not end in one of the allowed suffixes, and with a
    RunError when another's file is there: before any work is done."""
    path = arguments.output or Path(arguments.run) / default
    if path.suffix.lower() not in allowed:
        p.error(f"{path}: unknown kind of file; end the name in {', '.join(allowed)}")
    may_write(path, arguments.force)
    return path


def made_here(path):
    """Does a file carry the mark, or nothing at all, as one that a crash or mktemp has left?"""
    with open(path, "rb") as f:
        if not f.seek(0, os.SEEK_END):
            return True
        with mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return data.find(MARK.encode()) >= 0


def may_write(path, force):
    """Errors: RunError for a file that is not one of these scripts', and for what is no file at all."""
    try:
        if not path.exists():
            return
        if not path.is_file():
            raise RunError(path, "is there already, and is no file", "choose another place with -o")
        if force or made_here(path):
            return
    except OSError as error:
        raise RunError(path, f"cannot be read ({error.strerror or error})", "choose another place with -o") from None
    raise RunError(path, "is there already, and was not made by these scripts",
                   "choose another place with -o, or --force to replace it")


@contextmanager
def written(path, force):
    """with written(path, force) as new: write the file `new`, which takes its place when it is whole. Errors:
    RunError."""
    may_write(path, force)
    new = path.with_name(f".{path.stem}.{os.getpid()}.new{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield new
        with open(new, "rb") as whole:
            os.fsync(whole.fileno())  # a crash leaves the old file or the new one
        os.replace(new, path)
    except OSError as error:
        raise RunError(path, f"cannot be written ({error.strerror or error})", "choose another place with -o") from None
    finally:
        with suppress(OSError):
            new.unlink()


def write_text(text, path, force):
    """Write a text that carries the mark already. Errors: RunError."""
    assert MARK in text
    with written(path, force) as new:
        new.write_text(text, encoding="utf-8")


def plain(value):
    """As it comes back from JSON: numbers of numpy as those of Python, what is not finite as None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_json(value, path, force):
    """Write a dict, and the mark with it. Errors: RunError."""
    write_text(json.dumps({"made_by": MARK, **plain(value)}, indent=1, allow_nan=False) + "\n", path, force)


def write_csv(rows, path, force):
    """Write dicts of the same keys as a table, with the mark as the last column. Errors: RunError."""
    text = io.StringIO()
    table = csv.DictWriter(text, [*rows[0], "made_by"])
    table.writeheader()
    table.writerows(row | {"made_by": MARK} for row in rows)
    write_text(text.getvalue(), path, force)


def write_markdown(text, path, force):
    write_text(f"{text}\n\n<!-- {MARK} -->\n", path, force)


def save(figure, path, force=False):
    """Write a figure; its folder is made if missing. Errors: RunError."""
    with written(path, force) as new:
        figure.savefig(new, metadata={PLACES[path.suffix.lower()]: MARK})
    print(path)


class _Stream:
    """A stream of text that may be lost, as to a reader that leaves (`| head`) or a full disk: what it is given goes
    nowhere from then on, and the work goes on."""

    def __init__(self, stream):
        self._stream, self.lost = stream, False

    def __getattr__(self, name):
        return getattr(self._stream, name)

    def _try(self, call, *arguments):
        try:
            call(*arguments)
        except OSError:
            self.lost = True
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())  # for what waits in buffers, and for programs that are started
            os.close(nowhere)

    def write(self, text):
        self._try(self._stream.write, text)
        return len(text)

    def flush(self):
        self._try(self._stream.flush)


def guarded(main):
    """Run main() and leave the program with the exit code of what happened. What asks it to stop does so as Ctrl-C, for
    the runs that it has started to end with checkpoints; nohup holds."""
    name = lacking.program()
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)
    for stream in (sys.stdout, sys.stderr):  # a terminal without a dash still gets its table
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    sys.stdout, sys.stderr = _Stream(sys.stdout), _Stream(sys.stderr)
    code = 0
    try:
        main()
    except RunError as error:
        code = _say(name, error, error.code)
    except OSError as error:
        code = _say(name, error, 4)
    except KeyboardInterrupt:
        code = _say(name, "stopped", 6)
    except SystemExit as end:
        code = end.code
    sys.stdout.flush()
    if sys.stdout.lost and not code:
        code = _say(name, "standard output: cannot be written; give it a place with space, or a reader that stays to "
                    "the end; every file is written", 4)
    if code:
        sys.exit(code)


def _say(name, message, code):
    print("\n".join(f"{name}: {line}" for line in str(message).splitlines()), file=sys.stderr)
    return code
