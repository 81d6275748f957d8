# SPDX-License-Identifier: MIT
"""Routes on the map: the ice as the planner saw it, no-go areas, the tracks of the body and of the vessel."""
from bergtow.plot import style

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap

#: line colours of routes, distinguishable with any colour vision
LINES = (style.TOW, style.DRAG, "#e69f00", style.INERTIA, "#56b4e9", "#cc79a7")
COVER = LinearSegmentedColormap.from_list("cover", [style.WATER, "#5d8fb5", "#d3e6f1", "#fbfdfe"])


def figure(title, words, place, extent, cover, cover_extent, outlines, no_go, routes, bold, goal):
    """Draw the map. routes: candidates (label, track [m, 2] of the body, tug [k, 2] or None, straight, name); bold: the
    name of one of them or None; cover [ny, nx] within cover_extent (x0, x1, y0, y1)."""
    flat = place.map
    (left, low), (right, high) = flat([extent[:2], extent[2:]])
    width = 9.0
    scale = (width - 2.0) / (right - left)
    height = np.clip(scale * (high - low), 2.5, 9.0)
    fig = style.Figure(figsize=(width, height + 1.75))
    axes = fig.add_axes((0.85 / width, 0.95 / (height + 1.75), (width - 2.0) / width, height / (height + 1.75)))
    box = flat([(cover_extent[0], cover_extent[2]), (cover_extent[1], cover_extent[3])]).T.ravel()
    image = axes.imshow(cover.T if place.north_first else cover, origin="lower", extent=box, cmap=COVER, vmin=0,
                        vmax=1, interpolation="nearest", aspect="equal", rasterized=True)
    if len(outlines) <= style.MANY // 4:
        axes.add_collection(PolyCollection([flat(o) for o in outlines], facecolors="none", edgecolors=style.FAINT,
                                           linewidths=0.3))
    if no_go:
        axes.add_collection(PolyCollection([flat(o) for o in no_go], facecolors=style.FIXED, edgecolors=style.INK,
                                           hatch="///", linewidths=0.6))
    colours = iter(LINES * len(routes))
    for c in routes:
        colour = style.JAM if c.straight else next(colours)
        axes.plot(*flat(c.track).T, color=style.HALO, linewidth=4.2 if c.name == bold else 3.0)
        axes.plot(*flat(c.track).T, color=colour, linewidth=2.6 if c.name == bold else 1.5, label=c.label)
        if c.tug is not None:
            axes.plot(*flat(c.tug).T, color=colour, linewidth=0.8, linestyle=(0, (3, 2)))
    start = flat(routes[0].track[:1])[0]
    axes.plot(*start, "o", color=style.BODY, markeredgecolor=style.BODY_EDGE, markersize=8)
    aim = flat(np.atleast_2d(goal))
    axes.plot(*aim.T, "X-" if len(aim) > 1 else "X", color=style.JAM, markeredgecolor=style.HALO, markersize=10)
    axes.set(xlim=(left, right), ylim=(low, high), xlabel="y, east (m)" if place.north_first else "x (m)",
             ylabel="x, north (m)" if place.north_first else "y (m)")
    bar = fig.add_axes(((width - 0.95) / width, axes.get_position().y0, 0.16 / width, axes.get_position().height))
    fig.colorbar(image, cax=bar, label="ice concentration (%)")
    style.times(bar.yaxis, 100)
    fig.legend(*axes.get_legend_handles_labels(), loc="lower center", ncol=4, bbox_to_anchor=(0.5, 0.0))
    style.head(fig, title, words, left=0.15 / width)
    return fig
