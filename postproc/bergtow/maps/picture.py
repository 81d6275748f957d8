# SPDX-License-Identifier: MIT
"""A picture of a map and of the result: the outlines as read, and the floes as written."""
from bergtow import writing
from bergtow.maps.repair import parts_of
from bergtow.plot import style

import numpy as np
from matplotlib.collections import PolyCollection

@style.look()
def draw(found, floes, rules, plane, path, force):
    """Left: the map in the plane. Right: the floes on the map, with the parts left out or cut away in red."""
    bounds = np.array([s.geometry.bounds for s in found.shapes])
    (x0, y0), (x1, y1) = bounds[:, :2].min(axis=0), bounds[:, 2:].max(axis=0)
    scale, unit = style.scale([x1 - x0, y1 - y0], "m")
    ratio = min(1.6, max(0.4, (y1 - y0) / (x1 - x0)))
    figure, panels = style.subplots(1, 2, figsize=(12, 5.2 * ratio + 1.6), sharex=True, sharey=True)
    before, after = ([np.asarray(p.exterior.coords)[:, :2] / scale for g in some for p in parts_of(g)]
                     for some in ([s.geometry for s in found.shapes], [f.polygon for f in floes]))
    edge = {"edgecolor": style.WATER, "linewidth": 0.4}
    for axes, shapes, look in ((panels[0], before, {"facecolor": "#bcd7e8"} | edge),
                               (panels[1], before, {"facecolor": style.JAM, "edgecolor": "none"}),
                               (panels[1], after, {"facecolor": "#eaf3f8"} | edge)):
        axes.add_collection(PolyCollection(shapes, **look))
    frame(panels[1], rules, scale)
    for axes, words in zip(panels, (f"as read: {len(found.shapes)} shapes", f"as written: {len(floes)} floes; red was "
                                    "left out")):
        axes.set(title=words, aspect="equal", facecolor=style.WATER, xlabel=names(plane)[0] + f", {unit}")
        axes.plot(0, 0, "+", color=style.BODY, markersize=9, markeredgewidth=1.6)
        axes.autoscale_view()
    panels[0].set_ylabel(names(plane)[1] + f", {unit}")
    style.head(figure, style.plain(found.path.name), style.plain(found.about[:150] or "the cross is the centre"))
    figure.subplots_adjust(left=0.07, right=0.985, bottom=0.6 / figure.get_figheight(), wspace=0.06,
                           top=1 - 1.0 / figure.get_figheight())
    writing.save(figure, path, force)


def names(plane):
    return ("east of the centre", "north of the centre") if plane.heading is None else ("x", "y")


def frame(axes, rules, scale):
    """Draw the box and the clear circle."""
    if rules.box:
        half = np.array(rules.box) / 2 / scale
        axes.plot(*np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]).T * half[:, None], color=style.BODY)
    if rules.clear:
        angle = np.linspace(0, 2 * np.pi, 90)
        axes.plot(rules.clear / scale * np.cos(angle), rules.clear / scale * np.sin(angle), color=style.BODY)
