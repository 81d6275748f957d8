# SPDX-License-Identifier: MIT
"""The ice field of a run before, during and after the tow, with the channel that the body leaves."""
from bergtow import arguments, writing
from bergtow.plot import style
from bergtow.plot.scene import Colouring, Scene, add_options, framed
from bergtow.result.run import Run

import numpy as np
from matplotlib.ticker import MaxNLocator

LETTER, TICK = 0.083, 0.48  # space for a letter of a panel's title and for a number on its axis, inches


def frames_to_show(run, times):
    """[(label, frame)]: the frames nearest to the times given; by default first, half of the tow, last."""
    run.need_frames()
    if times:
        return [("", run.frame_at(t)) for t in times]
    last = run.n_frames - 1
    shown = [("before", 0), ("during", last // 2), ("after", last)]
    return [shown[i] for i in range(3) if i == 0 or shown[i][1] > shown[i - 1][1]]


def body_place(run, frame):
    """(x, y) of the towed body, m, from the series: frames are wrapped into a periodic domain."""
    if {"body_x", "body_y"} <= set(run.series_names) and len(run["time"]):
        at = run.frame_times[frame]
        sample = int(np.searchsorted(run["time"], at * (1 - 1e-9)))
        if at > 0 and sample < len(run["time"]):
            return run["body_x"][sample], run["body_y"][sample]
    return run.body_pose(frame)[run.towed, :2]


def panel_words(run, label, frame, follow):
    """The title of a panel: label, time, and the position of the body if the view follows it."""
    lines = [", ".join([label] * bool(label) + [f"t = {style.times_text(run.frame_times[frame])}"])]
    if follow:
        x0, x1, y0, y1 = run.box
        x, y = (style.fixed(v, max(x1 - x0, y1 - y0)) for v in body_place(run, frame))
        lines.append(f"body at ({x}, {y}) m")
    return lines


def layout(n, view, turned, lines):
    """(figure size in inches, [axes rectangle, in inches], colour bar rectangle, orientation). lines: of a title
    between narrow panels. Wide views are stacked, others stand side by side; sizes follow from the view, so no space is
    left blank."""
    wide, high = view[1] - view[0], view[3] - view[2]
    if turned:
        wide, high = high, wide
    head, foot, left, gap = 0.98, 0.62, 0.78, 0.42
    if wide > 1.5 * high:
        width = 12.0
        w = width - left - 1.15
        h = w * high / wide
        size = (width, head + n * h + (n - 1) * gap + foot)
        rects = [(left, foot + (n - 1 - i) * (h + gap), w, h) for i in range(n)]
        length = size[1] - head - foot
        tall = min(length, 4.5)
        return size, rects, (left + w + 0.22, foot + (length - tall) / 2, 0.16, tall), "vertical"
    h = min(6.6, 3.9 * high / wide)
    w = h * wide / high
    width = max(left + n * w + (n - 1) * 0.45 + 0.3, 7.0)
    foot += 0.78
    head += 0.2 * (lines - 1)
    size = (width, head + h + foot)
    spare = (width - left - 0.3 - n * w) / max(n - 1, 1)
    rects = [(left + i * (w + min(spare, 1.0)), foot, w, h) for i in range(n)]
    right = rects[-1][0] + w
    long = min(right - left, 5.0)
    return size, rects, (left + (right - left - long) / 2, 0.58, long, 0.15), "horizontal"


def draw(run, kind="speed", times=(), window="auto"):
    """The figure. kind: one of COLOURS; times: s; window: whole, body, or auto."""
    shown = frames_to_show(run, times)
    follow, view = framed(run, window)
    titles = [panel_words(run, label, frame, follow) for label, frame in shown]
    size, rects, cax, orientation = layout(len(shown), view, run.geographic, max(map(len, titles)))
    figure = style.Figure(figsize=size)
    colouring = Colouring(run, kind, [frame for _, frame in shown])

    def inches(rect):
        return rect[0] / size[0], rect[1] / size[1], rect[2] / size[0], rect[3] / size[1]

    stacked, notes = orientation == "vertical", {}
    for i, ((_, frame), rect) in enumerate(zip(shown, rects)):
        axes = figure.add_axes(inches(rect))
        scene = Scene(axes, run, colouring, view, follow)
        scene.show(frame)
        if scene.rafted:
            notes["■ floes over each other"] = style.RAFTED
        if scene.cracked:
            notes["— cracks since the frame before"] = style.CRACK
        one_line = ", ".join(titles[i])
        axes.set_title(one_line if LETTER * len(one_line) < rect[2] else "\n".join(titles[i]))
        if not stacked:
            axes.xaxis.set_major_locator(MaxNLocator(max(2, min(5, int(rect[2] / TICK))), steps=(1, 2, 5, 10)))
        if stacked and i < len(shown) - 1:
            axes.set_xlabel("")
            axes.tick_params(labelbottom=False)
        if not stacked and i > 0:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)
    if run.n_floes:
        colouring.bar(figure, scene.mappable, figure.add_axes(inches(cax)), orientation)
    for i, (words, colour) in enumerate(notes.items()):
        figure.text(1 - 0.2 / size[0], 1 - (0.42 + 0.2 * i) / size[1], words, va="top", ha="right", fontsize=10.5,
                    color=colour)
    style.headline(figure, run, "ice field", 0.2 / size[0], kept=2 if notes else 0)
    return figure


def options(p):
    arguments.add_run(p, "field.png")
    add_options(p)
    p.add_argument("--times", metavar="T", type=arguments.finite, nargs="+", default=(),
                   help="draw the frames nearest to these times, s, in place of first, middle and last")


@style.look()
def perform(a):
    path = arguments.output(a, "field.png", writing.PICTURES)
    with Run(a.run) as run:
        writing.save(draw(run, a.colour, a.times, a.window), path, a.force)
