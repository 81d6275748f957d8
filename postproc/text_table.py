# SPDX-License-Identifier: MIT
"""Tables of text or Markdown, and how numbers stand in them."""
import numpy as np

import style

FAR = 100.0  # times a level


def table(head, rows, markdown):
    """Columns of a head and rows of texts; the first is left-aligned, the others right."""
    if markdown:
        return "\n".join("| " + " | ".join(cells) + " |"
                         for cells in (head, ["---"] + ["---:"] * (len(head) - 1), *rows))
    width = [max(len(row[k]) for row in (head, *rows)) for k in range(len(head))]
    def line(cells):
        return "  ".join([cells[0].ljust(width[0])] + [c.rjust(w) for c, w in zip(cells[1:], width[1:])]).rstrip()
    return "\n".join([line(head), "  ".join("-" * w for w in width), *map(line, rows)])


def number(value, digits=3):
    """A number to so many digits, "–" where there is none."""
    if value is None or not np.isfinite(value):
        return "–"
    return style.short(value, digits) if abs(value) < 1e5 else f"{value:.{digits}g}"


def level(value, ends, factor=1.0):
    """A level and its interval, to the digits that they are worth. An upper end FAR times the level away bounds
    nothing: it says that the sample does not know the tail."""
    low, high = ends
    if np.isfinite([value, high]).all() and value > 0 and high > FAR * value:
        high = np.inf
    return number(value / factor), pair((low, high), factor)


def pair(values, factor=1.0):
    low, high = values
    if np.isnan([low, high]).any():
        return "–"
    return " to ".join("no bound" if np.isinf(v) else number(v / factor) for v in (low, high))
