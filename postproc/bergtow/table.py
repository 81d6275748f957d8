# SPDX-License-Identifier: MIT
"""Tables as text or Markdown, and the format of numbers in them.

Output for a terminal or a page is a list of parts: each is a Table, or a list of lines, some of which may be Warned.
"""
from typing import NamedTuple

import numpy as np

from bergtow.result.at_least import AtLeast


def counted(n, noun="member"):
    """"1 member", "2 members"."""
    return f"{n} {noun}{'' if n == 1 else 's'}"


def hours_text(hours):
    return f"{hours:.3g} h" if hours >= 1 else f"{60 * hours:.3g} min"


def times_text(*times):
    """Times of a run as bergtow prints them: "13560 to 14445 s". Three digits would name other samples."""
    return " to ".join(f"{t:g}" for t in times) + " s"


def percent(x):
    """A share, "–" if it is not known."""
    return "–" if x is None or not np.isfinite(x) else f"{round(100 * x) + 0} %"


def change(x):
    """A relative change, with its sign."""
    return "–" if x is None else f"{100 * x:+.1f} %"


def span(values, text="{:.3g}".format, key=None):
    """"5 to 17": the least and the largest of some values; one of them if they are equal."""
    low, high = min(values, key=key), max(values, key=key)
    return text(low) if low == high else f"{text(low)} to {text(high)}"


class Table(NamedTuple):
    """A head and rows of texts; by: the column whose equal cells are merged on a page."""
    head: list
    rows: list
    by: int = 0


class Warned(str):
    """A line with a warning."""


def marked(line):
    return f"WARNING: {line}" if isinstance(line, Warned) else line


def written(parts, markdown=False):
    """Parts as text or Markdown, separated by empty lines."""
    return "\n\n".join(table(part.head, part.rows, markdown) if isinstance(part, Table) else
                       "\n".join(map(marked, part)) for part in parts)


PROSE = 40  # characters: a column with a longer cell contains words, not numbers


def table(head, rows, markdown):
    """Columns of a head and rows of texts: the first, and those of words, are left-aligned, others right-aligned."""
    width = [max(len(row[k]) for row in (head, *rows)) for k in range(len(head))]
    left = [k == 0 or max((len(row[k]) for row in rows), default=0) > PROSE for k in range(len(head))]
    if markdown:
        return "\n".join("| " + " | ".join(cells) + " |"
                         for cells in (head, ["---" if words else "---:" for words in left], *rows))
    def line(cells):
        return "  ".join(c.ljust(w) if words else c.rjust(w) for c, w, words in zip(cells, width, left)).rstrip()
    return "\n".join([line(head), "  ".join("-" * w for w in width), *map(line, rows)])


def scale(values, unit):
    """(factor, unit): values / factor are easy to read in the unit, with its k, M or G for large values."""
    values = np.asarray(values, dtype=float)
    values = np.abs(values[np.isfinite(values)])
    top = values.max(initial=0.0)
    for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if top >= 2 * factor:
            return factor, prefix + unit
    return 1.0, unit


def short(value, digits=3):
    """A number to this many significant digits, without an exponent if possible."""
    if value == 0 or not np.isfinite(value):
        return f"{value + 0.0:g}"  # avoid minus zero
    if isinstance(value, AtLeast):
        return f"at least {short(float(value), digits)}"
    value = float(f"{value:.{digits - 1}e}")  # 99.96 has as many digits as 100
    decimals = max(0, digits - 1 - int(np.floor(np.log10(abs(value)))))
    return f"{value:.{decimals}f}" if decimals < 7 else f"{value:.{digits}g}"


def quantity(value, unit):
    """A number with unit, in thousands if it is large: 12345, "N" gives 12.3 kN; "–" if undefined."""
    if value is None or not np.isfinite(value):
        return "–"
    factor, name = scale([value], unit)
    return f"{short(value / factor)} {name}"


def number(value, digits=3):
    """A number to this many digits, "–" if undefined."""
    if value is None or not np.isfinite(value):
        return "–"
    return short(value, digits) if abs(value) < 1e5 else f"{value:.{digits}g}"


def _first(value):
    """Decimal place of the first digit."""
    return int(np.floor(np.log10(abs(value))))


def designed(value, least=-np.inf):
    """A design load to three digits, which is within 0.5 %: with two, 1049 would be 1000. It is rounded up if rounding
    to nearest would bring it below `least`, the largest simulated load, and the value itself is not below it."""
    if value == 0 or not np.isfinite(value):
        return value
    place = _first(value) - 2
    nearest = round(value, -place)
    return nearest if nearest >= least or value < least else round(nearest + 10.0 ** place, -place)


def last_place(value, low, high):
    """Decimal place of the last digit that the ends of an interval justify: two digits of its wider side, and two to
    three of the value; three if an end would otherwise be rounded to the other side of the value. None if neither side
    has a width."""
    wide = max((abs(end - value) for end in (low, high) if np.isfinite(end)), default=0.0)
    if not wide > 0:
        return None
    first = _first(value if value else wide)
    place, there = min(max(_first(wide) - 1, first - 2), first - 1), designed(value)
    below, above = (round(end, -place) if np.isfinite(end) else there for end in (low, high))
    return place if below <= there <= above else first - 2


def to_place(value, place):
    """A number rounded to this decimal place, "no bound" if it is not finite."""
    return f"{round(value, -place) + 0.0:.{max(0, -place)}f}" if np.isfinite(value) else "no bound"


def stated(value, low, high, unit, least=None):
    """(value, interval) in words with their unit, the ends rounded to the place that the interval justifies
    (last_place), "–" for unknown values. A mean has the digits of its interval; a design load (least: the largest
    simulated load) has three."""
    if not np.isfinite(value):
        return "–", "–"
    factor, name = scale([value], unit)
    place = None if np.isnan([low, high]).any() else last_place(value / factor, low / factor, high / factor)
    if least is not None:
        said = quantity(designed(value, least), unit)
    elif place is None or isinstance(value, AtLeast):
        said = quantity(value, unit)
    else:
        said = f"{to_place(value / factor, place)} {name}"
    return said, "–" if place is None else f"{' to '.join(to_place(x / factor, place) for x in (low, high))} {name}"


def level(value, ends, factor=1.0):
    """A level, to three digits, and its interval, to the digits that it justifies; a lower end above zero that would
    be left without any, to two of its own."""
    low, high = ends
    place = last_place(value / factor, low / factor, high / factor)
    if place is None or np.isnan([low, high]).any():
        return number(value / factor), pair((low, high), factor)
    below, above = (to_place(v / factor, place) for v in (low, high))
    if low > 0 and float(below) == 0:
        below = number(low / factor, 2)
    return number(value / factor), f"{below} to {above}"


def pair(values, factor=1.0):
    low, high = values
    if np.isnan([low, high]).any():
        return "–"
    return " to ".join("no bound" if np.isinf(v) else number(v / factor) for v in (low, high))
