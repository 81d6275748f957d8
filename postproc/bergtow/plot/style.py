# SPDX-License-Identifier: MIT
"""One style for all pictures: fonts, sizes, colours, and the wording of titles.

Line colours are those of Okabe & Ito (2008), distinguishable with any colour vision. The colour maps of floes increase
in lightness contrast against the water, so that they can also be read in greyscale.
"""
import textwrap
import threading
from contextlib import contextmanager

from bergtow import table as text_table
from bergtow.result.run import SLOWER

import matplotlib
import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, Locator, MaxNLocator, NullFormatter

RAFTED = "#5a1846"  # floes over each other
WATER = "#0c2a43"
PAPER = "#ffffff"
INK = "#1d2733"
FAINT = "#66727f"
GRID = "#dfe5ea"
CRACK = "#ff2f4e"
WALL = "#8a949e"
FIXED = "#5f6871"
BODY = "#12b3a6"
BODY_EDGE = "#03302d"
TRACK = "#8fe3da"

ICE = "#0072b2"       # ice resistance
TOW = "#d55e00"       # tow force
DRAG = "#009e73"      # drag
INERTIA = "#8c6bb1"   # inertia
CORIOLIS = "#b8860b"  # Coriolis force
TILT = "#4d4d4d"      # force of the sea-surface tilt
#: lines of a force balance in the order of the file: colour, width, dashes; registered forces follow
BALANCE = ((TOW, 2.8, None), (ICE, 1.3, None), (DRAG, 1.6, (6, 2)), (CORIOLIS, 1.6, (5, 1.5, 1, 1.5)),
           (TILT, 1.6, (1, 1)), (INERTIA, 1.6, (2, 1.5)), ("#c2417c", 1.6, (4, 1)), ("#1b4f9c", 1.6, (3, 1, 1, 1)),
           ("#7a5b00", 1.6, (7, 1)))
#: stacked panels, and curves of estimates, in the order of the file
PANELS = (ICE, TOW, DRAG, INERTIA)
ESTIMATES = (TOW, DRAG, INERTIA, "#56b4e9", "#e69f00", "#cc79a7", "#1b4f9c", "#7a5b00", "#4d4d4d")
WINDOW = "#f0f3f6"    # steady window
REFERENCE = "#000000"

#: marks on ice and water, which look the same on a dark page
HALO = "#fefefe"
ON_DARK, ON_LIGHT = "#fefefe", "#1d2732"
JAM = "#c1121f"
#: {colour: its replacement on a dark page}; all other colours stay the same there
DARK = {PAPER: "#12181f", INK: "#e6ebf0", REFERENCE: "#ffffff", FAINT: "#9fabb7", GRID: "#2d3843", WINDOW: "#1c252e",
        ICE: "#4aa8e0", TOW: "#ff8a3d", DRAG: "#2cc79a", INERTIA: "#b79ade", CORIOLIS: "#e0b040", TILT: "#b8b8b8",
        JAM: "#ff6b6b", "#c2417c": "#f078ac", "#1b4f9c": "#6f9fe8", "#7a5b00": "#cfa63a", RAFTED: "#d45fb4"}

#: floes by speed: ice at rest is white, moving ice turns vermilion
SPEED_MAP = LinearSegmentedColormap.from_list("speed", ["#eaf3f8", "#f6dfae", "#f2a541", "#dd5f1b", "#a62a0c"])
#: floes by contact force: unloaded ice is white, loaded ice turns purple
FORCE_MAP = LinearSegmentedColormap.from_list("force", ["#eaf3f8", "#e8bfd9", "#d877b3", "#ab2f86", "#6a0f5b"])
#: floes by thickness: thin ice is grey-blue, thick ice is white, as seen from an aircraft
THICKNESS_MAP = LinearSegmentedColormap.from_list("thickness", ["#5d8fb5", "#9cc3dc", "#d3e6f1", "#fbfdfe"])

#: words for the tow by its mode
TOWED_BY = {"line": " on a line", "thrust": " by a vessel"}

DPI = 150
MANY = 20000  #: samples, or floe vertices, above which a vector drawing embeds them as an image

LOOK = {"font.family": "DejaVu Sans", "font.size": 10.5, "text.color": INK,
        "axes.labelsize": 10.5, "axes.titlesize": 11, "axes.titlelocation": "left", "axes.titlepad": 6,
        "axes.edgecolor": FAINT, "axes.labelcolor": INK, "axes.linewidth": 0.8, "axes.axisbelow": True,
        "axes.spines.top": False, "axes.spines.right": False,
        "axes.grid": False, "grid.color": GRID, "grid.linewidth": 0.7,
        "xtick.color": FAINT, "ytick.color": FAINT, "xtick.labelcolor": INK, "ytick.labelcolor": INK,
        "xtick.labelsize": 9.5, "ytick.labelsize": 9.5, "xtick.major.width": 0.8, "ytick.major.width": 0.8,
        "legend.frameon": False, "legend.fontsize": 9.5, "lines.linewidth": 1.6, "lines.solid_capstyle": "round",
        "figure.dpi": DPI, "savefig.dpi": DPI, "figure.facecolor": PAPER, "svg.fonttype": "none", "pdf.fonttype": 42}

_TURN = threading.RLock()


@contextmanager
def look():
    """Apply our matplotlib settings while a figure is made and saved, then restore those of the calling program.
    Threads take turns, since matplotlib has one set of settings for all of them."""
    with _TURN, matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(LOOK)
        yield


def subplots(rows=1, columns=1, *, figsize, **more):
    """(Figure, axes), like pyplot.subplots, which would keep the figure and choose a backend for the whole program."""
    figure = Figure(figsize=figsize)
    return figure, figure.subplots(rows, columns, **more)


# used in pictures; tables use them without matplotlib
scale, short = text_table.scale, text_table.short
quantity, times_text = text_table.quantity, text_table.times_text


def conditions(run):
    """The run in a few words: concentration, thickness, number of floes, tow."""
    words = []
    concentration = run.number("concentration", run.value("ice.concentration"))
    if run.n_floes and np.isfinite(concentration):
        words.append(f"{100 * concentration:.0f} % ice")
    if n := int(run.ice.sum()):
        words += [f"{n} floe{'s' if n > 1 else ''}", f"{run.mean_thickness:.3g} m thick"]
    mode, speed, made = run.case.get("tow.mode", ""), run.value("tow.speed"), run.speed_made_good
    if run.towed is not None and mode != "none" and np.isfinite(speed):
        words.append(f"towed{TOWED_BY.get(mode, '')}, {speed:.3g} m/s ordered" +
                     (f" and {made:.3g} m/s made good" if abs(made - speed) > SLOWER * abs(speed) else ""))
    if run.summary.get("stopped"):
        words.append("stopped early")
    return ", ".join(words)


def fixed(value, span):
    """A value out of a range, with decimals for a hundredth of that range or less."""
    decimals = max(0, 2 - int(np.floor(np.log10(span or 1))))
    return f"{round(value, decimals) + 0.0:.{decimals}f}"  # avoid minus zero


def plain(text):
    """Text from a case as one line that matplotlib draws literally."""
    return " ".join(str(text).split()).replace("$", r"\$")


def title(run):
    """Title of the case, or the name of the run's folder; at most 80 characters."""
    return plain(textwrap.shorten(run.summary.get("title") or run.path.resolve().name, 80, placeholder=" ..."))


class LogTicks(Locator):
    """Labelled ticks of a logarithmic axis: decades; if fewer than three are visible, also 3, or 2 and 5, or most
    digits; over a shorter range evenly spaced ticks."""

    CHOICES = ((1, ), (1, 3), (1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7))
    MOST = 8

    def __call__(self):
        return self.tick_values(*self.axis.get_view_interval())

    def tick_values(self, vmin, vmax):
        low, high = sorted((vmin, vmax))
        decades = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
        for some in self.CHOICES:
            ticks = np.array([k * 10.0 ** n for n in decades for k in some])
            ticks = ticks[(ticks >= low * (1 - 1e-9)) & (ticks <= high * (1 + 1e-9))]
            if len(ticks) >= 3:
                return ticks[::-(-len(ticks) // self.MOST)]
        ticks = MaxNLocator(4).tick_values(low, high)
        return ticks[(ticks >= low) & (ticks <= high)]


class TimesTicks(MaxNLocator):
    """Ticks at round numbers of `factor` times the values of an axis."""

    def __init__(self, factor):
        super().__init__(nbins="auto", steps=[1, 2, 2.5, 5, 10])
        self.factor = factor

    def tick_values(self, vmin, vmax):
        return super().tick_values(self.factor * vmin, self.factor * vmax) / self.factor


def times(axis, factor):
    """Label an axis with `factor` times its values: 0.6 as 60 for %."""
    axis.set_major_locator(TimesTicks(factor))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{factor * value:.6g}"))


def logarithmic(*axis):
    """Set scale, ticks and labels of a logarithmic axis (axes.xaxis or axes.yaxis)."""
    for one in axis:
        getattr(one.axes, f"set_{one.axis_name}scale")("log")
        one.set_major_locator(LogTicks())
        one.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.6g}" if value < 1e6 else f"{value:.0e}"))
        one.set_minor_formatter(NullFormatter())


def force_limits(means, around, log):
    """Ends of a force axis that shows the means and, around them, intervals and estimates. log: the means are positive.
    None and NaN do not count."""
    seen = np.array([v for v in (*means, *around) if v is not None and np.isfinite(v)])
    if log:
        # an interval that nearly reaches zero must not stretch the axis
        return max(seen[seen > 0].min(), 0.05 * min(means)) / 2.5, 2.5 * seen.max()
    low, high = min(0.0, seen.min()), max(0.0, seen.max())
    margin = 0.08 * (high - low) or 1.0
    return low - margin * (low < 0), high + margin


def level_of(axes):
    """The transform of a horizontal level across the picture (axhline), where only y is in data coordinates."""
    return axes.get_yaxis_transform(which="grid")


def in_sight(axes, line):
    """Is any part of a line, given in data coordinates, within the limits of the axes? For a level only y counts."""
    x, y = (np.asarray(v, dtype=float) for v in line.get_data())
    (left, right), (low, high) = sorted(axes.get_xlim()), sorted(axes.get_ylim())
    if line.get_transform() == level_of(axes):
        left, right = 0.0, 1.0
    known = np.isfinite(x) & np.isfinite(y) & ((y > 0) | (axes.get_yscale() != "log"))
    x, y = np.where(known, x, np.nan), np.where(known, y, np.nan)
    inside = (x >= left) & (x <= right) & (y >= low) & (y <= high)
    def meets(v, least, most):
        return (np.minimum(v[:-1], v[1:]) <= most) & (np.maximum(v[:-1], v[1:]) >= least)
    marked = line.get_marker() != "None" and inside.any()
    return bool(marked or line.get_linestyle() != "None" and np.any(meets(x, left, right) & meets(y, low, high)))


def legend_of(axes):
    """(handles, labels) of the visible artists, and the labels without any visible artist. Limits must be set. The
    first visible line represents all lines with its label."""
    shown, all_labels = {}, {}
    for handle, label in zip(*axes.get_legend_handles_labels()):
        all_labels[label] = None
        of_data = isinstance(handle, Line2D) and handle.get_transform() in (axes.transData, level_of(axes))
        if label not in shown and (not of_data or in_sight(axes, handle)):
            shown[label] = handle
    return list(shown.values()), list(shown), [label for label in all_labels if label not in shown]


def head(figure, words, below, left=0.02, kept=0):
    """Two lines at the top of a figure, at fixed distances from its edge; kept: inches that the second leaves free."""
    width, height = figure.get_size_inches()
    # letters are on average narrower than 0.6 of the font size, so the title is not cut off
    size = min(13.5, 72 * (width - 0.4) / (0.6 * len(words)))
    figure.text(left, 1 - 0.14 / height, words, va="top", fontsize=size, fontweight="bold")
    small = min(10.5, 72 * (width - 0.4 - kept) / (0.52 * max(1, len(below))))
    figure.text(left, 1 - 0.42 / height, below, va="top", fontsize=small, color=FAINT)


def headline(figure, run, subject, left=0.02, kept=0):
    head(figure, f"{title(run)}: {subject}", conditions(run), left, kept)
