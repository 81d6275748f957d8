# SPDX-License-Identifier: MIT
"""Options that several commands share, and the types of numbers that options take."""
import argparse
import ctypes
import functools
import math
from pathlib import Path

from bergtow import _library
from bergtow.errors import USAGE, BergtowError
from bergtow.writing import may_write


def read(text, unit):
    """Read a number with a unit as in a case, and convert it to the SI unit given ("" for a plain number, "%" for a
    ratio). Raises BergtowError."""
    value = ctypes.c_double()
    _library.library().bt_number_read(text.strip().encode(), unit.encode(), ctypes.byref(value))
    return value.value


def measure(unit, fits=lambda x: x > 0, words="not above zero"):
    """Argparse type for a number with a unit, as in read(); by default it must be above zero."""
    def number(text):
        try:
            return read(text, unit)
        except BergtowError as error:
            words = str(error) if text.strip() else f"a number is missing;{str(error).partition(';')[2]}"
            raise argparse.ArgumentTypeError(words) from None
    return lambda text: _within(text, number, fits, words)


def from_zero(unit):
    """The same for a number with a unit that may be zero."""
    return measure(unit, lambda x: x >= 0, "below zero")


def several(kind):
    """Argparse type for an option with several values of a type, sorted."""
    return lambda text: sorted({kind(part) for part in text.split(",")})


def minutes(text):
    """A duration above zero, in minutes: "90", "90 min", "1.5 h"."""
    try:
        float(text)
    except ValueError:
        return measure("s")(text) / 60
    return above_zero(text)


def _within(text, number, fits, words):
    try:
        value = number(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text or 'nothing'} is not a {'whole ' * (number is int)}number") from None
    if not fits(value):
        raise argparse.ArgumentTypeError(f"{text} is {words}")
    return value


def between(least, most, kind=float):
    """Argparse type for a number of a kind in a closed interval."""
    words = f"not a {'whole ' * (kind is int)}number from {least:g} to {most:g}"
    return lambda text: _within(text, kind, lambda x: least <= x <= most, words)


#: the same for a whole number
whole_from = functools.partial(between, kind=int)

finite = functools.partial(_within, number=float, fits=math.isfinite, words="not a finite number")
above_zero = functools.partial(_within, number=float, fits=lambda x: 0 < x < math.inf,
                               words="not above zero and finite")
at_least_one = functools.partial(_within, number=int, fits=lambda x: x >= 1, words="below 1")


def not_below_zero(text):
    return _within(finite(text), float, lambda x: x >= 0, "below zero")


share = measure("%", lambda x: 0 < x < 1, "not between 0 and 1")


def add_run(p, output):
    """Add RUN, -o/--output (default: RUN/output) and --force."""
    p.add_argument("run", metavar="RUN", help="output folder of a run")
    p.add_argument("-o", "--output", metavar="FILE", type=Path, help=f"file to write (default: RUN/{output})")
    add_force(p)


def add_force(p):
    p.add_argument("--force", action="store_true", help="replace an existing file, even one that bergtow did not write")


def output(a, default, allowed):
    """Path to write to. Raises BergtowError, before any work is done, if its suffix is not allowed or if the file
    exists and bergtow did not write it."""
    path = a.output or Path(a.run) / default
    ends_in(path, allowed)
    may_write(path, a.force)
    return path


def ends_in(path, allowed):
    """Check the suffix of a path. Raises BergtowError."""
    if path.suffix.lower() not in allowed:
        raise BergtowError(f"{path}: unknown kind of file; end the name in {', '.join(allowed)}", USAGE)
