# SPDX-License-Identifier: MIT
"""Loads around the hull by panel, and the exceedance of collision peaks."""
from bergtow import arguments, writing
from bergtow.errors import RunError
from bergtow.plot import style
from bergtow.result import at_least
from bergtow.result.run import Run

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.patches import Polygon

MEAN, LARGEST, PEAK = style.ICE, style.TOW, style.INERTIA


def along_hull(run):
    """The outline of each panel on the hull [k, 2] m: its two ends and the corners of the waterline between them."""
    panels, hull = run.panels, run.bodies[run.towed].vertices
    corners = np.vstack([hull, hull[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    around, ends = arc[-1], panels["ends"]
    def place_of(point):
        edge = corners[1:] - corners[:-1]
        t = np.clip(np.einsum("ij,ij->i", point - corners[:-1], edge) / np.einsum("ij,ij->i", edge, edge), 0, 1)
        k = np.argmin(np.hypot(*(corners[:-1] + t[:, None] * edge - point).T))
        return arc[k] + t[k] * (arc[k + 1] - arc[k])
    start = [place_of(p) for p in ends[:-1]]
    out = []
    for k, s in enumerate(start):
        length = around / len(start)
        between = [(a - s) % around for a in arc[:-1]]
        inner = sorted((d, i) for i, d in enumerate(between) if 1e-9 * around < d < length - 1e-9 * around)
        out.append(np.vstack([ends[k], *(hull[i] for _, i in inner), ends[k + 1]]))
    return out


def bars(outlines, values, scale):
    """Polygons on the panels, with the height values * scale, m. At corners of the hull they are mitred along the
    direction from the centroid."""
    shapes = []
    for line, value in zip(outlines, values):
        outward = line / np.hypot(*line.T)[:, None]
        shapes.append(np.vstack([line, (line + value * scale * outward)[::-1]]))
    return shapes


def draw_hull(axes, run, values, colour, label):
    """Draw bars of the values around the hull, and rings as a scale."""
    hull = run.bodies[run.towed].vertices
    size = np.hypot(*hull.T).max()
    values = np.nan_to_num(np.asarray(values, dtype=float))
    top = values.max(initial=0.0)
    factor, unit = style.scale([top], "N")
    scale = 0.75 * size / top if top > 0 else 0.0
    outlines = along_hull(run)
    shapes = [run.on_page(s) for s in bars(outlines, values, scale)]
    axes.add_collection(PolyCollection(shapes, facecolor=colour, edgecolor=style.PAPER, linewidth=0.6))
    axes.add_patch(Polygon(run.on_page(hull), closed=True, facecolor=style.WINDOW, edgecolor=style.INK, linewidth=1.0))
    step = _round(top / factor)
    for level in np.arange(step, 1.001 * top / factor, step) if top > 0 else []:
        ring = np.vstack([line + level * factor * scale * line / np.hypot(*line.T)[:, None] for line in outlines])
        axes.plot(*run.on_page(np.vstack([ring, ring[:1]])).T, color=style.GRID, linewidth=0.7, zorder=0)
        axes.update_datalim(run.on_page(ring))
    ahead = np.array([[0.0, 0.0], [0.55 * size, 0.0]])
    axes.annotate("", run.on_page(ahead)[1], run.on_page(ahead)[0],
                  arrowprops=dict(arrowstyle="->", color=style.FAINT, linewidth=1))
    axes.annotate("body's own x", run.on_page(0.5 * ahead[1] - [0, 0.1 * size]), fontsize=8.5, color=style.FAINT,
                  ha="center", va="center")
    for shape in shapes:
        axes.update_datalim(shape)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_axis_off()
    rings = f"a ring every {step:g} {unit}, largest {style.quantity(top, 'N')}" if top > 0 else "none"
    axes.set_title(f"{label}\n{rings}", loc="center", fontsize=10.5)


def _round(top):
    """A step that gives two to four rings up to top."""
    if top <= 0:
        return 1.0
    base = 10 ** np.floor(np.log10(top))
    return next(s * base for s in (0.25, 0.5, 1.0, 2.0, 2.5) if top / (s * base) < 4.5)


def exceedance(peaks, hours):
    """(peaks N, rate per hour): F_k, in descending order, is reached or exceeded k times in the run."""
    ordered = np.sort(peaks)[::-1]
    return ordered, np.arange(1, len(ordered) + 1) / hours


def draw_exceedance(axes, run):
    """Rate against peak, both logarithmic, of the collisions in the window."""
    hits = run.impacts
    late = hits["time"] >= run.number("impacts.from_s")  # none without a window
    peaks, rate = exceedance(hits["peak"][late], run.number("impacts.hours"))
    axes.set(xlabel=f"peak of a collision (N)\n{hits['conversion']}", ylabel="exceeded (per hour)")
    axes.set_title("How often a peak is exceeded" + ", at least" * run.at_least, loc="left", fontsize=10.5)
    if not len(peaks) or peaks[0] <= 0:
        axes.annotate("no collisions in the window", (0.5, 0.5), xycoords="axes fraction", ha="center",
                      color=style.FAINT)
        return
    style.logarithmic(axes.xaxis, axes.yaxis)
    axes.plot(peaks, rate, color=PEAK, drawstyle="steps-post", linewidth=1.2)
    axes.plot(peaks[:20], rate[:20], ".", color=PEAK, markersize=5)
    push = run.number("impacts.largest_quasi_static_load_n")
    if np.isfinite(push) and push > 0:
        axes.axvline(push, color=LARGEST, linestyle="--", linewidth=1.2)
        axes.annotate(f"largest quasi-static load of a floe {style.quantity(push, 'N')}", (push, 0.97),
                      xycoords=("data", "axes fraction"), rotation=90, ha="right", va="top", fontsize=9, color=LARGEST)
    axes.set_xlim(max(peaks[-1], 1e-4 * peaks[0]), 1.5 * max(peaks[0], push if np.isfinite(push) else 0))
    axes.grid(True)
    axes.annotate(f"{len(peaks)} collisions in {style.short(60 * run.number('impacts.hours'))} min", (0.02, 0.03),
                  xycoords="axes fraction", fontsize=9, color=style.FAINT)


def _start(panels, name):
    """The largest value before the window, in words, if the file has one."""
    before = np.max(panels.get(f"start_{name}", 0.0))
    return f"\nin the start before the window {style.quantity(before, 'N')}" if before > 0 else ""


def draw(run):
    """The figure: mean load, largest load and largest peak by panel, and exceedance."""
    if run.towed is None:
        raise RunError(run.path, "has no towed body", "run a case with a body")
    panels = run.panels
    for name in ("mean_load", "max_load", "max_peak"):
        if name not in panels:
            raise RunError(run.result, f"has no /panels/{name}: the run has not ended",
                           f"wait for it, or continue it with `bergtow resume {run.path}`")
    figure = style.Figure(figsize=(11, 8.6))
    grid = figure.add_gridspec(2, 2, left=0.07, right=0.975, top=0.855, bottom=0.09, hspace=0.26, wspace=0.16)
    start = panels["from"]
    window = f"over the window from {style.times_text(start)} on" if np.isfinite(start) else "no window"
    least = "at least the " if run.at_least else ""  # panels count nothing in steps without a converged solution
    draw_hull(figure.add_subplot(grid[0, 0]), run, panels["mean_load"], MEAN, f"{least}mean load by panel, {window}")
    draw_hull(figure.add_subplot(grid[0, 1]), run, panels["max_load"], LARGEST,
              f"{least}largest load in a step (impulse / time step)" + _start(panels, "max_load"))
    draw_hull(figure.add_subplot(grid[1, 0]), run, panels["max_peak"], PEAK,
              f"{least}largest peak of a collision, {run.impacts['conversion']}" + _start(panels, "max_peak"))
    draw_exceedance(figure.add_subplot(grid[1, 1]), run)
    words = f"ice loads on the hull ({at_least.words(run.number('window.no_load_share'))})"
    style.headline(figure, run, words if run.at_least else "ice loads on the hull")
    return figure


def options(p):
    arguments.add_run(p, "impacts.png")


@style.look()
def perform(a):
    path = arguments.output(a, "impacts.png", writing.PICTURES)
    with Run(a.run) as run:
        writing.save(draw(run), path, a.force)
