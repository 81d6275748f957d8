# SPDX-License-Identifier: MIT
"""The design tow force of each condition with its interval, beside the mean and the largest simulated value; and the
line tension if there is a line."""
from bergtow.plot import style
from bergtow.result.at_least import AtLeast
from bergtow.stats import design_value

import numpy as np

EDGE = 0.01  #: of the picture, left free beside labels
FEW = 7      #: more labels of several lines are too close at a small slant
LETTERS, LINES = 30, 4  #: of a label, whose full text is in the tables
LEAST = 0.3  #: share of the picture, in width and height, that labels leave to the axes at least
LIMIT = 4.0  #: upper ends of intervals are cut off at this multiple of the largest value


def _one_number(conditions, numeric):
    """The only key that differs between conditions, if it is numeric; otherwise None."""
    varied = [k for k in conditions[0]["values"] if len({c["values"][k] for c in conditions}) > 1]
    return varied[0] if len(varied) == 1 and varied[0] in numeric else None


def _places(conditions, key):
    """Positions of the conditions on the axis, and half the distance between marks that stand side by side."""
    x = np.array([c["values"][key] for c in conditions]) if key else np.arange(len(conditions), dtype=float)
    least = np.diff(np.unique(x)).min() if len(x) > 1 else 1.0
    return x, 0.08 * least


def _draw(axes, x, some, factor, top, colour, label):
    """Draw diamonds with intervals; an arrow marks an interval that extends beyond the picture."""
    at = [k for k, d in enumerate(some) if d and "value" in d]
    if not at:
        return
    values = np.array([some[k]["value"] for k in at])
    low, high = np.array([some[k]["interval_95"] for k in at], dtype=float).T
    low, cut = np.fmax(np.nan_to_num(low, nan=0.0), 0.0), np.fmin(np.nan_to_num(high, nan=np.inf, posinf=np.inf), top)
    axes.errorbar(x[at], values / factor, yerr=np.array([values - np.fmin(low, values), np.fmax(cut, values) - values])
                  / factor, fmt="D", color=colour, markersize=6, capsize=3, linewidth=1.5, zorder=4, label=label)
    beyond = np.array(high) > top
    if beyond.any():
        axes.plot(x[at][beyond], np.full(beyond.sum(), top) / factor, "^", color=colour, markersize=7, zorder=5)


def _label(text):
    """A label in lines, with its long parts and long lists of parts cut short."""
    lines = [part if len(part) <= LETTERS else f"{part[:LETTERS // 2]}…{part[-LETTERS // 2 + 1:]}"
             for part in text.split(", ")]
    return ",\n".join(lines if len(lines) <= LINES else [*lines[:LINES - 1], "…"])


def _make_room(figure, axes):
    """Move the axes up, and to the right, until the slanted labels below them are within the picture."""
    figure.draw_without_rendering()
    width, height = figure.bbox.size
    boxes, here = [t.get_window_extent() for t in axes.get_xticklabels()], axes.get_position()
    ticks = [axes.transData.transform((x, 0))[0] / width for x in axes.get_xticks()]
    left = [here.x0]
    for box, tick in zip(boxes, ticks):  # a label follows its tick, which moves less than the left side
        share = (tick - here.x0) / here.width
        if box.x0 < EDGE * width and share < 1:
            left.append((tick - box.x0 / width + EDGE - share * here.x1) / (1 - share))
    bottom = here.y0 + max(0, EDGE - min(box.y0 for box in boxes) / height)
    figure.subplots_adjust(left=min(max(left), here.x1 - LEAST), bottom=min(bottom, here.y1 - LEAST))


def draw(conditions, numeric, axis_label, times):
    """The figure; None if nothing is towed. numeric: keys whose values are numbers; axis_label: key -> words; times:
    key -> factor for the numbers on the axis."""
    tows = [c["design"]["tow"] for c in conditions]
    if not any(tows):
        return None
    key = _one_number(conditions, numeric)
    x, aside = _places(conditions, key)
    tensions = [c["design"]["tension"] for c in conditions]
    largest = max(d.get("value", d["largest"]) for d in tows if d)
    held = [k for k, d in enumerate(tows) if d and d.get("below_zero")]  # their largest load is the smallest force
    least = min([0.0, *(tows[k]["smallest"] for k in held)])
    factor, unit = style.scale([largest, least], next(d for d in tows if d)["units"])
    figure, axes = style.subplots(figsize=(8.4, 3.9))
    figure.subplots_adjust(left=0.1, right=0.98, top=0.83, bottom=0.15 if key else 0.3)
    lines = any(t and "value" in t for t in tensions)
    top = LIMIT * max(largest, -least)
    _draw(axes, x - lines * aside, tows, factor, top, style.TOW, "design tow force, 95 % interval")
    if lines:
        _draw(axes, x + aside, tensions, factor, top, style.INERTIA, "design line tension, 95 % interval")
    there = [k for k, d in enumerate(tows) if d]
    axes.plot(x[there], [tows[k]["largest"] / factor for k in there], "_", color=style.INK, markersize=22,
              markeredgewidth=2, zorder=3, label="largest simulated")
    axes.plot(x[there], [tows[k]["mean"] / factor for k in there], "o", color=style.ICE, markersize=5, zorder=3,
              label="mean tow force")
    if held:
        axes.plot(x[held], [tows[k]["smallest"] / factor for k in held], "_", color=style.JAM, markersize=22,
                  markeredgewidth=2, zorder=3, label="smallest simulated, held back")
    bounds = [k for k in there if isinstance(tows[k]["mean"], AtLeast)]
    if bounds:
        axes.plot(x[bounds], [tows[k]["largest"] / factor for k in bounds], "^", color=style.JAM, markersize=7,
                  zorder=5, label="largest, at least")
    starts = [(k, tows[k]["start_up"]["largest"]) for k in there if design_value.start_exceeds(tows[k])]
    if starts:
        axes.plot(x[[k for k, _ in starts]], [v / factor for _, v in starts], "^", color=style.INK, markersize=6,
                  markerfacecolor="none", zorder=3, label="in the start, in no other number")
    ends = [v for _, v in starts] + [v for d in [*tows, *tensions] if d for v in d.get("interval_95", ())
                                     if np.isfinite(v)]
    high = min(top, max([largest, -0.05 * least, *(d["largest"] for d in tows if d), *ends]))
    axes.set_ylim(1.08 * least / factor, 1.08 * high / factor)
    axes.set_ylabel(f"force ({unit})")
    axes.set_xticks(x, [f"{times(key) * v:.4g}" for v in x] if key else [_label(c["label"]) for c in conditions],
                    **({} if key else {"rotation": 20 if len(x) <= FEW else 45, "ha": "right"}))
    axes.set_xlabel(axis_label(key) if key else "")
    axes.grid(True, axis="y")
    if not key:
        _make_room(figure, axes)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncol=3, fontsize=9, borderaxespad=0.2, handletextpad=0.4)
    return figure
