# SPDX-License-Identifier: MIT
"""Writing files, and the single rule for replacing files.

An existing file is replaced only if bergtow made it, or with --force. Each file carries MARK: a PNG and an MP4 in their
text fields, a PDF, an SVG and a page in their metadata, JSON and CSV as `made_by`, Markdown in a comment. Rejected: a
list of the files in the folder, which does not cover a file that was moved there.
"""
import csv
import errno
import io
import json
import math
import mmap
import os
from contextlib import contextmanager, suppress

from bergtow.errors import RunError
from bergtow.said import say

import numpy as np

PICTURES = (".png", ".pdf", ".svg")
MARK = "made by bergtow postproc, which may replace it"
#: matplotlib's metadata field for the mark, by the suffix of a picture
PLACES = {".png": "Software", ".pdf": "Producer", ".svg": "Source"}


def made_here(path):
    """Does a file carry the mark, or is it empty, as after a crash or mktemp?"""
    with open(path, "rb") as f:
        if not f.seek(0, os.SEEK_END):
            return True
        with mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return data.find(MARK.encode()) >= 0


#: remedies of a path that cannot be used, of a file that is not replaced: those of the commands
REMEDIES = "choose another place with -o", "--force"


def may_write(path, force, remedies=REMEDIES):
    """Raises RunError for a file that bergtow did not make, and for a path that is not a file."""
    other, by = remedies
    try:
        if not path.exists():
            return
        if not path.is_file():
            raise RunError(path, "already exists and is not a file", other)
        if force or made_here(path):
            return
    except OSError as error:
        raise RunError(path, f"cannot be read ({error.strerror or error})", other) from None
    raise RunError(path, "already exists and was not made by bergtow", f"{other}, or {by} to replace it")


@contextmanager
def written(path, force, remedies=REMEDIES):
    """with written(path, force) as new: write the file `new`, which replaces `path` once it is complete. Raises
    RunError. Also for a file that a later call reads: a full disk or a kill leaves what was there."""
    may_write(path, force, remedies)
    new = path.with_name(f".{path.stem}.{os.getpid()}.new{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield new
        with open(new, "rb") as whole:
            os.fsync(whole.fileno())  # so that a crash leaves either the old file or the new one
        os.replace(new, path)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else error  # strerror is a paragraph if the error is of HDF5
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)  # another place would be one without the finished runs
        raise RunError(path, f"cannot be written ({why})", "free some disk space" if full else remedies[0]) from None
    finally:
        with suppress(OSError):
            new.unlink()


def write_text(text, path, force):
    """Write a text that already contains the mark. Raises RunError."""
    assert MARK in text
    with written(path, force) as new:
        new.write_text(text, encoding="utf-8")


def plain(value):
    """The value as read back from JSON: NumPy numbers as Python numbers, numbers that are not finite as None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_json(value, path, force):
    """Write a dict together with the mark. Raises RunError."""
    write_text(json.dumps({"made_by": MARK, **plain(value)}, indent=1, allow_nan=False) + "\n", path, force)


def collection(head, features):
    """The text of a GeoJSON FeatureCollection with further members at its head, a line for each feature."""
    head = json.dumps({"type": "FeatureCollection", "made_by": MARK} | head)
    return head[:-1] + ', "features": [\n' + ",\n".join(json.dumps(f, allow_nan=False) for f in features) + "\n]}\n"


def write_csv(rows, path, force):
    """Write dicts with the same keys as a table, with the mark as the last column. Raises RunError."""
    text = io.StringIO()
    table = csv.DictWriter(text, [*rows[0], "made_by"])
    table.writeheader()
    table.writerows(row | {"made_by": MARK} for row in rows)
    write_text(text.getvalue(), path, force)


def write_markdown(text, path, force):
    write_text(f"{text}\n\n<!-- {MARK} -->\n", path, force)


def save(figure, path, force=False):
    """Write a figure; its folder is created if missing. Raises RunError."""
    with written(path, force) as new:
        figure.savefig(new, metadata={PLACES[path.suffix.lower()]: MARK})
    say(path)
