# SPDX-License-Identifier: MIT
"""Resistance against a number that an ensemble varies: every field, its mean with 95 %, median and doubts; estimates
against concentration, the law V^2 against speed. For a Latin hypercube, every member.
"""
import textwrap

from bergtow.plot import style
from bergtow.plot.axes import axis_label, headline, wants_log
from bergtow.result.members import reading, short_key, worded
from bergtow.stats import mean as stat_mean
from bergtow.stats.conditions import sample

import numpy as np
from matplotlib.lines import Line2D
import scipy

MAX_PANELS = 6


def groups(e, key):
    """Conditions with members, in groups that differ only in `key`: [(words for the others, [Condition])]."""
    found = {}
    for c in e.conditions():
        if len(c.finished):
            found.setdefault(tuple((k, v) for k, v in c.values.items() if k != key), []).append(c)
    def words(others):
        varied = [(k, v) for k, v in others if len(set(e.parameters[k].tolist())) > 1]
        return ", ".join(worded(k, v, e.units[k], 3) for k, v in varied)
    return [(words(others), sorted(some, key=lambda c: c.values[key])) for others, some in found.items()]


def width_of(x, log):
    """Half the width, in x, over which the dots of a condition are spread."""
    x = np.unique(x)
    if len(x) < 2:
        return 0.02
    return 0.012 * (np.log(x[-1] / x[0]) if log else x[-1] - x[0])


def spread(x, n, half, log):
    """n positions around x, side by side, so that the dots of one condition do not overlap."""
    at = np.linspace(-half, half, n) if n > 1 else np.zeros(1)
    return x * np.exp(at) if log else x + at


#: how a member is drawn: its marker, and the meaning
MARKS = {
    "sound": ({"marker": "o", "markersize": 3.6, "markeredgewidth": 0, "color": style.ICE, "alpha": 0.35}, "{}"),
    "doubtful": ({"marker": "o", "markersize": 4.2, "markeredgewidth": 0.9, "color": style.ICE, "alpha": 0.6,
                  "markerfacecolor": "none"}, "{} in doubt (bergtow statistics: doubts)"),
    "jammed": ({"marker": "x", "markersize": 5, "markeredgewidth": 1.2, "color": style.JAM},
               "{} where the body stood still"),
}


def mark_of(e, m):
    """Key of MARKS. Warnings of other kinds do not cast doubt on a mean."""
    doubts = e.doubts(m)
    return "jammed" if "jammed" in doubts else "doubtful" if doubts - {"other"} else "sound"


def draw_members(axes, e, rows, x, y):
    marks = np.array([mark_of(e, m) for m in rows])
    for kind, (mark, _) in MARKS.items():
        some = marks == kind
        if some.any():
            axes.plot(x[some], y[some], linestyle="none", zorder=3.5 if kind == "jammed" else 3, **mark)


def members_legend(e, word):
    there = {"sound"} | {mark_of(e, m) for m in e.used}
    return [(Line2D([], [], linestyle="none", **mark), words.format(word))
            for kind, (mark, words) in MARKS.items() if kind in there]


def draw_fields(axes, e, some, key, factor, log_x):
    """Draw the members, the mean with its 95 % interval and band, and the median."""
    x = np.array([c.values[key] for c in some])
    half = width_of(x, log_x)
    means = [e.mean[c.finished] for c in some]
    least = np.array([bool(e.without_bound(c.members)) for c in some])
    band = np.where(least[:, None], np.nan, [stat_mean.t_interval(y) for y in means])
    for c, y in zip(some, means):
        at, order = spread(c.values[key], len(y), half, log_x), np.argsort(y)
        draw_members(axes, e, c.finished[order], at, y[order] / factor)
    centre = np.array([y.mean() for y in means])
    if np.isfinite(band).all() and len(x) > 1:
        # a lower end that a logarithmic axis cannot show would draw those of its neighbours down with it
        floor = axes.get_ylim()[0] if axes.get_yscale() == "log" else -np.inf
        axes.fill_between(x, np.maximum(band[:, 0] / factor, floor), band[:, 1] / factor, color=style.ICE, alpha=0.13,
                          linewidth=0, zorder=2)
    axes.plot(x, centre / factor, color=style.ICE, linewidth=1.4, zorder=4)
    half_bar = np.nan_to_num(np.abs(band - centre[:, None])).T / factor
    axes.errorbar(x, centre / factor, yerr=half_bar, fmt="s", color=style.ICE, markersize=5, capsize=3, linewidth=1.3,
                  zorder=5)
    axes.plot(x, [np.median(y) / factor for y in means], marker="_", markersize=13, markeredgewidth=2, color=style.INK,
              linestyle="none", zorder=6)
    axes.plot(x[least], centre[least] / factor, "^", color=style.JAM, markersize=8, zorder=7)


def fields_legend(e):
    field, *others = members_legend(e, "a field")
    if e.without_bound(np.arange(e.n)):
        others.append((Line2D([], [], marker="^", color=style.JAM, linestyle="none", markersize=8), "mean, at least"))
    return [(Line2D([], [], marker="s", color=style.ICE, markersize=5), "mean of the fields, 95 % (t)"), field,
            (Line2D([], [], marker="_", color=style.INK, linestyle="none", markersize=12, markeredgewidth=2),
             "median of the fields"), *others]


def force_limits(e, some_groups, log):
    """Ends of the force axis, N: every field, the intervals, and the estimates meant for the conditions."""
    means = [e.mean[c.finished] for _, some in some_groups for c in some]
    around = [end for fields in means for end in stat_mean.t_interval(fields)]
    high = np.nanmax(np.abs([*np.concatenate(means), *around]))
    for name in (name for name, estimate in e.estimates.items() if not estimate["on_top"]):
        force, valid = (e.summary.get(f"estimates_{name}_{what}", np.zeros(e.n))[e.used]
                        for what in ("force_n", "valid"))
        around += force[(valid == 1) & (np.abs(force) < 30 * high)].tolist()
    return style.force_limits(np.concatenate(means), around, log)


def draw_speed(axes, e, some, key, factor):
    """Draw the law V² through the middle of the means, and note the exponent that they follow."""
    x = np.array([c.values[key] for c in some])
    means = [dict(zip(e.seed[c.finished].tolist(), e.mean[c.finished])) for c in some]
    law = stat_mean.power_of_conditions(x, means)
    if law is None:
        return
    exponent, low, high = law
    v, middle = np.geomspace(x.min(), x.max(), 50), scipy.stats.gmean([np.mean(list(c.values())) for c in means])
    axes.plot(v, middle * (v / scipy.stats.gmean(x))**2 / factor, color=style.TOW, linewidth=1.2, dashes=(5, 2),
              zorder=2.5, label="∝ V², through the middle of the means")
    interval = f" ({low:.2g} to {high:.2g})" if np.isfinite([low, high]).all() else ""
    axes.annotate(f"exponent of the means {exponent:.2g}{interval}", (0.98, 0.03), xycoords="axes fraction",
                  ha="right", fontsize=9, color=style.FAINT)


def draw_estimates(axes, e, some, key, factor):
    """Draw the estimates of each condition, averaged over its fields at the speed that each made good; dotted where
    they are not meant for the condition. A curve for a single speed would be wrong if tows are slower in more ice."""
    x, k = np.array([c.values[key] for c in some]), 0
    for name, estimate in e.estimates.items():
        force, valid = (np.array([e.summary.get(f"estimates_{name}_{what}", np.full(e.n, np.nan))[c.finished].mean()
                                  for c in some]) for what in ("force_n", "valid"))
        force = force / factor
        if estimate["on_top"]:
            axes.plot(x, force, color=style.FAINT, linewidth=1, dashes=(6, 3),
                      label=f"{estimate['label']} (comes on top)")
            continue
        colour, k = style.ESTIMATES[k % len(style.ESTIMATES)], k + 1
        axes.plot(x, np.where(valid == 1, force, np.nan), "d-", color=colour, linewidth=1.6, markersize=4,
                  label=estimate["label"])
        axes.plot(x, force, color=colour, linewidth=1, dashes=(1, 1.6), zorder=1.5, label=estimate["label"])


def draw_sweep(e, key):
    """Figure of the resistance against one parameter of a grid."""
    panels = groups(e, key)
    panels = [(words, some) for words, some in panels if len(some) > 1] or panels
    shown = panels[:MAX_PANELS]
    columns = 2 if len(shown) == 4 else min(3, len(shown))
    rows = -(-len(shown) // columns)
    values = np.array([c.values[key] for _, some in shown for c in some])
    log_x = key == "tow.speed" and values.min() > 0
    forces = [v for _, some in shown for c in some for v in e.mean[c.finished]]
    log_y = wants_log(forces) or log_x and min(forces, default=0.0) > 0  # zero cannot be shown on a logarithmic axis
    low, high = force_limits(e, shown, log_y)
    factor, unit = style.scale([np.sqrt(low * high)] if log_y else [low, high], "N")
    figure, grid = style.subplots(rows, columns, figsize=(max(9.5, 4.4 * columns + 1), 3.9 * rows + 2.2), squeeze=False,
                                  sharex=True, sharey=True)
    extra, lost = {}, {}
    if log_y:
        style.logarithmic(*(axes.yaxis for axes in grid.flat))
    grid.flat[0].set_ylim(low / factor, high / factor)
    for axes, (words, some) in zip(grid.flat, shown):
        draw_fields(axes, e, some, key, factor, log_x)
        if key == "ice.concentration":
            draw_estimates(axes, e, some, key, factor)
        elif key == "tow.speed":
            draw_speed(axes, e, some, key, factor)
        axes.set_title(words, fontsize=10)
        axes.grid(True)
        if log_x:
            style.logarithmic(axes.xaxis)
            axes.set_xticks(np.unique(values), [f"{v:g}" for v in np.unique(values)])
    if not log_x:
        style.times(grid.flat[0].xaxis, reading(key, e.units[key])[0])
        margin = 0.06 * (values.max() - values.min())
        grid.flat[0].set_xlim(values.min() - margin, values.max() + margin)  # fields are spread about their value
    for axes in grid.flat[:len(shown)]:
        handles, labels, away = style.legend_of(axes)
        extra |= {label: handle for handle, label in zip(handles, labels) if label not in extra}
        lost |= dict.fromkeys(away)
    lost = [label for label in lost if label not in extra]
    for axes in grid.flat[len(shown):]:
        axes.set_visible(False)
    for k, axes in enumerate(grid.flat[:len(shown)]):
        if k % columns == 0:
            axes.set_ylabel(f"mean ice resistance ({unit})")
        if k + columns >= len(shown):
            axes.set_xlabel(axis_label(e, key))
            axes.tick_params(labelbottom=True)
    pairs = fields_legend(e) + [(handle, label) for label, handle in extra.items()]
    to_zero = log_y and any(stat_mean.t_interval(e.mean[c.finished])[0] <= 0 and not e.without_bound(c.members)
                            for _, some in shown for c in some)
    note = " ".join(words for words, there in (
        (f"{len(panels) - MAX_PANELS} further combinations are not shown.", len(panels) > MAX_PANELS),
        ("Estimates at the speed made good, dotted outside the range they are meant for.", key == "ice.concentration"),
        (f"Out of the picture: {', '.join(lost)}.", lost), ("A bar down to the lower edge includes zero.", to_zero))
        if there)
    wide, height = figure.get_size_inches()
    note = textwrap.wrap(note, int(13.5 * wide))  # letters of 9 points in an inch
    lines, below = -(-len(pairs) // 3), 0.15 * max(0, len(note) - 1)
    figure.subplots_adjust(left=0.85 / figure.get_size_inches()[0], right=0.98, top=1 - 0.95 / height,
                           bottom=(0.95 + below + 0.24 * lines) / height, wspace=0.08, hspace=0.28)
    figure.legend([h for h, _ in pairs], [t for _, t in pairs], loc="lower left",
                  bbox_to_anchor=(0.02, (0.22 + below) / height), ncol=3, fontsize=9)
    figure.text(0.025, 0.08 / height, "\n".join(note), fontsize=9, color=style.FAINT)
    headline(figure, e, f"resistance against {short_key(key)}")
    return figure


def draw_scatter(e, key):
    """Figure of a Latin hypercube: every member against one parameter, and the mean with 95 % in bins of equally many
    conditions. The bins use means of conditions, whose fields are not independent (ensemble.sample)."""
    rows = e.used
    x, y = e.parameters[key][rows], e.mean[rows]
    log_y = wants_log(y)
    factor, unit = style.scale([np.median(y)], "N")
    figure, axes = style.subplots(figsize=(9.5, 5.8))
    figure.subplots_adjust(left=0.09, right=0.98, top=0.85, bottom=0.12)
    draw_members(axes, e, rows, x, y / factor)
    drawn, means, _ = sample(e, dict(zip(rows.tolist(), y)))
    at = drawn[key]
    bins = np.array_split(np.argsort(at), min(8, len(at) // 8)) if len(at) >= 24 else []
    if bins:
        centre = np.array([means[b].mean() for b in bins])
        bars = np.abs(np.array([stat_mean.t_interval(means[b]) for b in bins]) - centre[:, None]).T
        axes.errorbar([at[b].mean() for b in bins], centre / factor, yerr=bars / factor, fmt="s-", color=style.INK,
                      markersize=5, capsize=3, linewidth=1.2, label="mean of a bin of conditions, 95 % (t)")
        axes.plot([at[b].mean() for b in bins], [np.median(means[b]) / factor for b in bins], "_", color=style.TOW,
                  markersize=14, markeredgewidth=2, label="median of a bin")
    if log_y:
        style.logarithmic(axes.yaxis)
        axes.set_ylim(0.5 * y.min() / factor, 2 * y.max() / factor)
    style.times(axes.xaxis, reading(key, e.units[key])[0])
    axes.set(xlabel=axis_label(e, key), ylabel=f"mean ice resistance ({unit})")
    axes.grid(True)
    pairs = members_legend(e, "a member") + list(zip(*axes.get_legend_handles_labels()))
    axes.legend([handle for handle, _ in pairs], [label for _, label in pairs], loc="best")
    headline(figure, e, f"resistance against {short_key(key)}")
    return figure
