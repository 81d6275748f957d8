# SPDX-License-Identifier: MIT
"""Pictures of an ensemble, those that its study supports.

    sweep-KEY.png     mean ice resistance against a number that was varied, a panel for each combination of the
                      others: every field, mean with 95 %, median, jams; the estimates beside concentration, the
                      law V^2 beside speed. A Latin hypercube: one panel, every member
    returns-LOAD.png  level of each load that is exceeded once in a time, a line a condition, with the fitted tail and
                      the design value
    exceedance.png    how often a peak of a collision is exceeded, a line a condition, with the fitted tail
    map.png           mean and its relative uncertainty over two numbers of a grid
    variants.png      what each variant does to the mean, against the first one (plot_variants.py)
    sensitivity.png   Sobol indices and partial rank correlations
"""
import argparse
import sys
import textwrap
from pathlib import Path

import command
import loads
import plot_variants
import stat_extreme
import stat_mean
import style
from bergtow_read import RunError
from ensemble import add_load_options, extremes, member, nothing_to_count, sample, sensitivity
from ensemble_read import EXCLUDABLE, Ensemble, reading, short_key, worded

import matplotlib.pyplot as plt
import numpy as np
import scipy
from matplotlib.colors import LogNorm

MOST_PANELS = 6
MOST_LINES = 8
CYCLE = ("#0072b2", "#d55e00", "#009e73", "#8c6bb1", "#b8860b", "#56b4e9", "#4d4d4d", "#cc79a7")


def numeric(e):
    """Keys of numbers that were varied among the members that are used."""
    return [k for k, v in e.parameters.items() if v.dtype != object and len(set(v[e.used].tolist())) > 1]


def axis_label(e, key):
    unit = reading(key, e.units[key])[1]
    return short_key(key) + (f" ({unit})" if unit else "")


def groups(e, key):
    """Conditions with members, in groups that differ in `key` alone: [(words for the others, [Condition])]."""
    found = {}
    for c in e.conditions():
        if len(c.finished):
            found.setdefault(tuple((k, v) for k, v in c.values.items() if k != key), []).append(c)
    def words(others):
        varied = [(k, v) for k, v in others if len(set(e.parameters[k].tolist())) > 1]
        return ", ".join(worded(k, v, e.units[k], 3) for k, v in varied)
    return [(words(others), sorted(some, key=lambda c: c.values[key])) for others, some in found.items()]


def headline(figure, e, subject):
    doubtful = sum(bool(e.doubts(m)) for m in e.used)
    words = [f"{len(e.used)} members"]
    if doubtful:
        words.append(f"{doubtful} with warnings")
    missing = e.n - len(e.used)
    if missing:
        words.append(f"{missing} failed, waiting or left out")
    style.head(figure, f"{style.plain(e.title)}: {subject}", ", ".join(words))


def of(e, rows):
    return e.mean[rows]


def width_of(x, log):
    """Half a width, in x, in which the dots of a condition are spread."""
    x = np.unique(x)
    if len(x) < 2:
        return 0.02
    return 0.012 * (np.log(x[-1] / x[0]) if log else x[-1] - x[0])


def spread(x, n, half, log):
    """n places about x, side by side, so that dots of one condition can be told apart."""
    at = np.linspace(-half, half, n) if n > 1 else np.zeros(1)
    return x * np.exp(at) if log else x + at


#: how a member is drawn: its mark, and what it means
MARKS = {
    "sound": ({"marker": "o", "markersize": 3.6, "markeredgewidth": 0, "color": style.ICE, "alpha": 0.35}, "{}"),
    "doubtful": ({"marker": "o", "markersize": 4.2, "markeredgewidth": 0.9, "color": style.ICE, "alpha": 0.6,
                  "markerfacecolor": "none"}, "{} in doubt: not steady, too short, unconverged or stopped"),
    "jammed": ({"marker": "x", "markersize": 5, "markeredgewidth": 1.2, "color": style.JAM},
               "{} where the body stood still"),
}


def mark_of(e, m):
    """Key of MARKS. A warning of another kind is no doubt about a mean."""
    doubts = e.doubts(m)
    return "jammed" if "jammed" in doubts else "doubtful" if doubts - {"other"} else "sound"


def draw_members(axes, e, rows, x, y):
    marks = np.array([mark_of(e, m) for m in rows])
    for kind, (mark, _) in MARKS.items():
        some = marks == kind
        if some.any():
            axes.plot(x[some], y[some], linestyle="none", zorder=3.5 if kind == "jammed" else 3, **mark)


def members_legend(e, word):
    """Handles and labels of draw_members."""
    there = {"sound"} | {mark_of(e, m) for m in e.used}
    return [(plt.Line2D([], [], linestyle="none", **mark), words.format(word))
            for kind, (mark, words) in MARKS.items() if kind in there]


def draw_fields(axes, e, some, key, factor, log_x):
    """Members, the mean with its 95 % interval and band, and the median."""
    x = np.array([c.values[key] for c in some])
    half = width_of(x, log_x)
    means = [of(e, c.finished) for c in some]
    band = np.array([stat_mean.t_interval(y) for y in means])
    for c, y in zip(some, means):
        at, order = spread(c.values[key], len(y), half, log_x), np.argsort(y)
        draw_members(axes, e, c.finished[order], at, y[order] / factor)
    centre = np.array([y.mean() for y in means])
    if np.isfinite(band).all() and len(x) > 1:
        axes.fill_between(x,
                          band[:, 0] / factor,
                          band[:, 1] / factor,
                          color=style.ICE,
                          alpha=0.13,
                          linewidth=0,
                          zorder=2)
    axes.plot(x, centre / factor, color=style.ICE, linewidth=1.4, zorder=4)
    half_bar = np.nan_to_num(np.abs(band - centre[:, None])).T / factor
    axes.errorbar(x,
                  centre / factor,
                  yerr=half_bar,
                  fmt="s",
                  color=style.ICE,
                  markersize=5,
                  capsize=3,
                  linewidth=1.3,
                  zorder=5)
    axes.plot(x, [np.median(y) / factor for y in means],
              marker="_",
              markersize=13,
              markeredgewidth=2,
              color=style.INK,
              linestyle="none",
              zorder=6)


def fields_legend(e):
    """Handles and labels of draw_fields."""
    line = plt.Line2D
    field, *others = members_legend(e, "a field")
    return [(line([], [], marker="s", color=style.ICE, markersize=5), "mean of the fields, 95 % (t)"), field,
            (line([], [], marker="_", color=style.INK, linestyle="none", markersize=12,
                  markeredgewidth=2), "median of the fields"), *others]


def force_limits(e, some_groups, log):
    """Ends of the force axis, N: every field, the intervals, and the estimates that are meant for the conditions."""
    seen = [v for _, some in some_groups for c in some for v in of(e, c.finished)]
    tops = [stat_mean.t_interval(of(e, c.finished))[1] for _, some in some_groups for c in some]
    seen += [v for v in tops if np.isfinite(v)]
    low = min((v for v in seen if v > 0), default=1.0)
    high = max(seen, default=1.0)
    for name in (name for name, estimate in e.estimates.items() if not estimate["on_top"]):
        force, valid = (e.summary.get(f"estimates_{name}_{what}", np.zeros(e.n))[e.used]
                        for what in ("force_n", "valid"))
        seen += [v for v in force[(valid == 1) & (force > low / 30) & (force < 30 * high)]]
    seen = np.array([v for v in seen if np.isfinite(v)])
    if log:
        return seen[seen > 0].min() / 2, 2 * seen.max()
    return min(0.0, seen.min()), 1.08 * max(seen.max(), 1e-12)


def wants_log(values):
    """True where values are positive and span more than a decade and a half."""
    values = np.asarray(values, dtype=float)
    values = values[np.isfinite(values)]
    return bool(len(values) and values.min() > 0 and values.max() > 30 * values.min())


def power_law(x, means):
    """(exponent, low, high, factor) of mean = factor x^exponent over fields: regression of ln mean on ln x, 95 %; None
    where it makes no sense."""
    lx = np.concatenate([np.full(len(y), np.log(v)) for v, y in zip(x, means)])
    y = np.concatenate(means)
    if len(set(lx)) < 2 or len(y) < 4 or y.min() <= 0:
        return None
    a = np.column_stack([np.ones(len(y)), lx])
    c, *_ = np.linalg.lstsq(a, np.log(y), rcond=None)
    rest = np.log(y) - a @ c
    se = np.sqrt(np.dot(rest, rest) / (len(y) - 2) * np.linalg.inv(a.T @ a)[1, 1])
    half = scipy.stats.t.ppf(0.975, len(y) - 2) * se
    return c[1], c[1] - half, c[1] + half, np.exp(c[0])


def draw_speed(axes, e, some, key, factor):
    """The law V² through the geometric mean of the fields, and the exponent that fits."""
    x = np.array([c.values[key] for c in some])
    means = [of(e, c.finished) for c in some]
    law = power_law(x, means)
    if law is None:
        return
    v = np.geomspace(x.min(), x.max(), 50)
    exponent, low, high, scale = law
    weights = np.array([len(y) for y in means], dtype=float)
    centre = np.exp(np.dot(weights, np.log(x)) / weights.sum())
    axes.plot(v,
                      scale * centre**exponent * (v / centre)**2 / factor,
                      color=style.TOW,
                      linewidth=1.2,
                      dashes=(5, 2),
                      zorder=2.5,
                      label="∝ V², through the middle of the fields")
    axes.annotate(f"exponent {exponent:.2g} ({low:.2g} to {high:.2g})", (0.98, 0.03),
                  xycoords="axes fraction",
                  ha="right",
                  fontsize=9,
                  color=style.FAINT)


def draw_estimates(axes, e, some, key, factor):
    """The estimates of each condition, at the speed that its fields made good, as the mean of its fields; dotted where
    they are not meant for it. A curve for one speed would be wrong of tows that are slower in more ice."""
    x, k = np.array([c.values[key] for c in some]), 0
    for name, estimate in e.estimates.items():
        force, valid = (np.array([e.summary.get(f"estimates_{name}_{what}", np.full(e.n, np.nan))[c.finished].mean()
                                  for c in some]) for what in ("force_n", "valid"))
        force = np.where(force > 0, force, np.nan) / factor
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
    shown = panels[:MOST_PANELS]
    columns = 2 if len(shown) == 4 else min(3, len(shown))
    rows = -(-len(shown) // columns)
    values = np.array([c.values[key] for _, some in shown for c in some])
    log_x = key == "tow.speed" and values.min() > 0
    forces = [v for _, some in shown for c in some for v in of(e, c.finished)]
    log_y = wants_log(forces) or log_x and min(forces, default=0.0) > 0  # zero has no place on a logarithmic axis
    low, high = force_limits(e, shown, log_y)
    factor, unit = style.scale([np.sqrt(low * high) if log_y and low > 0 else high], "N")
    figure, grid = plt.subplots(rows,
                                columns,
                                figsize=(max(9.5, 4.4 * columns + 1), 3.9 * rows + 2.2),
                                squeeze=False,
                                sharex=True,
                                sharey=True)
    extra, lost = {}, {}
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
        if log_y:
            style.logarithmic(axes.yaxis)
    grid.flat[0].set_ylim(low / factor, high / factor)
    if not log_x:
        style.times(grid.flat[0].xaxis, reading(key, e.units[key])[0])
        margin = 0.06 * (values.max() - values.min())
        grid.flat[0].set_xlim(max(0.0 if values.min() >= 0 else -np.inf,
                                  values.min() - margin),
                              min(1.0,
                                  values.max() + margin) if key == "ice.concentration" else values.max() + margin)
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
    note = " ".join(
        ([f"{len(panels) - MOST_PANELS} more combinations are not shown."] if len(panels) > MOST_PANELS else []) +
        (["Estimates at the speed made good, dotted outside the range they are meant for."]
         if key == "ice.concentration" else []) +
        ([f"Out of the picture: {', '.join(lost)}."] if lost else []) +
        (["A bar down to the lower edge includes zero."] if log_y and any(
            stat_mean.t_interval(of(e, c.finished))[0] <= 0 for _, some in shown for c in some) else []))
    wide, height = figure.get_size_inches()
    note = textwrap.wrap(note, int(13.5 * wide))  # letters of 9 points in an inch
    lines, below = -(-len(pairs) // 3), 0.15 * max(0, len(note) - 1)
    figure.subplots_adjust(left=0.85 / figure.get_size_inches()[0],
                           right=0.98,
                           top=1 - 0.95 / height,
                           bottom=(0.95 + below + 0.24 * lines) / height,
                           wspace=0.08,
                           hspace=0.28)
    figure.legend([h for h, _ in pairs], [t for _, t in pairs],
                  loc="lower left",
                  bbox_to_anchor=(0.02, (0.22 + below) / height),
                  ncol=3,
                  fontsize=9)
    figure.text(0.025, 0.08 / height, "\n".join(note), fontsize=9, color=style.FAINT)
    headline(figure, e, f"resistance against {short_key(key)}")
    return figure


def draw_scatter(e, key):
    """Figure of a Latin hypercube: every member against one parameter, and the mean in bins of an equal number of
    conditions with 95 %; of the means of conditions, whose fields are not independent (ensemble.sample)."""
    rows = e.used
    x, y = e.parameters[key][rows], of(e, rows)
    log_y = wants_log(y)
    factor, unit = style.scale([np.median(y)], "N")
    figure, axes = plt.subplots(figsize=(9.5, 5.8))
    figure.subplots_adjust(left=0.09, right=0.98, top=0.85, bottom=0.12)
    draw_members(axes, e, rows, x, y / factor)
    drawn, means, _ = sample(e, dict(zip(rows.tolist(), y)))
    at = drawn[key]
    bins = np.array_split(np.argsort(at), min(8, len(at) // 8)) if len(at) >= 24 else []
    if bins:
        centre = np.array([means[b].mean() for b in bins])
        bars = np.abs(np.array([stat_mean.t_interval(means[b]) for b in bins]) - centre[:, None]).T
        axes.errorbar([at[b].mean() for b in bins],
                      centre / factor,
                      yerr=bars / factor,
                      fmt="s-",
                      color=style.INK,
                      markersize=5,
                      capsize=3,
                      linewidth=1.2,
                      label="mean of a bin of conditions, 95 % (t)")
        axes.plot([at[b].mean() for b in bins], [np.median(means[b]) / factor for b in bins],
                  "_",
                  color=style.TOW,
                  markersize=14,
                  markeredgewidth=2,
                  label="median of a bin")
    if log_y:
        style.logarithmic(axes.yaxis)
        axes.set_ylim(0.5 * y.min() / factor, 2 * y.max() / factor)
    style.times(axes.xaxis, reading(key, e.units[key])[0])
    axes.set_xlabel(axis_label(e, key))
    axes.set_ylabel(f"mean ice resistance ({unit})")
    axes.grid(True)
    pairs = members_legend(e, "a member") + list(zip(*axes.get_legend_handles_labels()))
    axes.legend([handle for handle, _ in pairs], [label for _, label in pairs], loc="best")
    headline(figure, e, f"resistance against {short_key(key)}")
    return figure


def key_beside(figure, axes, notes, step, some):
    """Legend and notes at the right of the axes; step: one in so many of some conditions is shown."""
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8.8, labelspacing=0.9)
    notes = notes + [f"one in {step} of {len(some)} conditions is shown"] * (step > 1)
    figure.text(0.675, 0.13, "\n".join(notes), fontsize=9, color=style.FAINT, va="bottom")


def draw_exceedance(e, options, tails=None):
    """Figure of the exceedance of peaks, a line a condition, the GPD tail over it; None where there are no peaks.
    tails: fitted tails by the index of their condition, where they are known."""
    some = [c for c in e.conditions() if len(c.finished)]
    step = max(1, -(-len(some) // MOST_LINES))
    figure, axes = plt.subplots(figsize=(9.2, 5.4))
    figure.subplots_adjust(left=0.08, right=0.66, top=0.86, bottom=0.14)
    conversions, top, least = set(), 0.0, np.inf
    for colour, c in zip(CYCLE, some[::step]):
        hits = [h for h in map(e.impacts, c.finished) if h]
        fields = [{"time": h[0], "peak": h[1], "start": h[2], "hours": h[3]} for h in hits]
        peaks, rate = stat_extreme.exceedance(fields)
        some_above = peaks > 0
        if not some_above.any():
            continue
        conversions.update(h[4] for h in hits)
        top, least = max(top, peaks[0]), min(least, peaks[some_above][-1])
        axes.plot(peaks[some_above],
                  rate[some_above],
                  color=colour,
                  drawstyle="steps-post",
                  linewidth=1.4,
                  label=f"{c.label}\n{len(peaks)} collisions, {sum(h[3] for h in hits):.3g} h")
        tail = tails[c.index] if tails else extremes(e, c.finished, options)["over_threshold"]
        if "refused" not in tail:
            z = np.geomspace(tail["threshold"] * 1.0001, 3 * peaks[0], 200)
            beyond = np.maximum(1 + tail["shape"] * (z - tail["threshold"]) / tail["scale"], 0)
            fitted = tail["rate_per_hour"] * (np.exp(-(z - tail["threshold"]) / tail["scale"])
                                              if abs(tail["shape"]) < 1e-8 else beyond**(-1 / tail["shape"]))
            axes.plot(z,
                      np.where(fitted > 0.1 / sum(h[3] for h in hits), fitted, np.nan),
                      color=colour,
                      linewidth=1,
                      dashes=(4, 2))
    if not conversions:
        plt.close(figure)
        return None
    style.logarithmic(axes.xaxis, axes.yaxis)
    axes.set_xlim(max(1e-4 * top, 0.7 * least), 3 * top)
    axes.set_xlabel(f"peak of a collision (N), {by(conversions)}")
    axes.set_ylabel("exceeded (per hour of tow)")
    axes.grid(True)
    notes = ["dashed: tail fitted to clusters of peaks,", "down to once in ten times the hours simulated"]
    key_beside(figure, axes, notes, step, some)
    headline(figure, e, "how often a peak is exceeded")
    return figure


def tail(f, hours):
    """Levels of return times by the fitted tail of peaks over a threshold."""
    return f["threshold"] + f["scale"] * stat_extreme.growth(f["shape"], np.maximum(f["rate_per_hour"] * hours, 1.0))


def draw_return_line(axes, x, label, colour, factor, beside):
    """Maxima of clusters at their empirical return times, the fitted tail, the design value `beside` its return
    time."""
    f = x["over_threshold"]
    axes.plot(x["hours"] / np.arange(1, len(f["maxima"]) + 1), f["maxima"] / factor, ".", color=colour, markersize=4,
              alpha=0.6)
    ends = np.array([1 / f["rate_per_hour"], x["hours"], max(level["hours"] for level in f["levels"])])
    for low, high, dashes in ((ends[0], min(ends[1:]), (None, None)), (ends[1], ends[2], (4, 2))):
        if high > low:
            t = np.geomspace(low, high, 100)
            axes.plot(t, tail(f, t) / factor, color=colour, linewidth=1.4, dashes=dashes,
                      label=label if dashes == (None, None) else None)
    d = x["design"]
    if "refused" in d:
        return
    low, high = np.minimum(d["interval_95"], 1e3 * abs(d["value"])) / factor
    axes.plot([d["return_hours"] * beside] * 2, [low, high], color=colour, linewidth=1.4)
    axes.plot(d["return_hours"] * beside, d["value"] / factor, "D", color=colour, markersize=6)


def by(conversions):
    """Words for what a peak of a collision means, of the conditions of one picture."""
    return next(iter(conversions)) if len(conversions) == 1 else "each condition by its own impact.conversion"


def meaning(some):
    """Words for what a value of a load is: its collisions and time scale, of the conditions of one picture."""
    conversions = {x["conversion"] for x in some if x["conversion"]}
    scales = sorted(x["time_scale_s"] for x in some)
    over = f"{scales[0]:.3g}" if scales[-1] < 1.001 * scales[0] else f"{scales[0]:.3g} to {scales[-1]:.3g}"
    return f"collisions as {by(conversions)}" if conversions else f"mean over {over} s"


def draw_returns(e, conditions, name):
    """Figure of the return levels of a load; None where no condition has a tail."""
    some = [c for c in conditions if name in c["loads"] and "refused" not in c["loads"][name]["over_threshold"]]
    if not some:
        return None
    step = max(1, -(-len(some) // MOST_LINES))
    shown, first = some[::step], some[0]["loads"][name]
    designs = [d for d in (c["loads"][name]["design"] for c in shown) if "refused" not in d]
    # where a tow is shorter than clusters are apart there is no design value
    values = [d["value"] for d in designs] or [max(c["loads"][name]["over_threshold"]["maxima"]) for c in shown]
    factor, unit = style.scale([np.median(values)], first["units"])
    figure, axes = plt.subplots(figsize=(9.2, 5.4))
    figure.subplots_adjust(left=0.09, right=0.66, top=0.86, bottom=0.14)
    for k, (colour, c) in enumerate(zip(CYCLE, shown)):
        x = c["loads"][name]
        draw_return_line(axes, x, f"{c['label']}\n{x['fields']} fields, {x['hours']:.3g} h", colour, factor,
                         1.1 ** (k - (len(shown) - 1) / 2))
    style.logarithmic(axes.xaxis)
    floor = min(c["loads"][name]["over_threshold"]["threshold"] for c in shown) / factor
    if wants_log(np.array(values) / factor) and floor > 0:
        style.logarithmic(axes.yaxis)
        axes.set_ylim(0.8 * floor, 4 * max(values) / factor)
    else:
        ends = [v / factor for d in designs for v in d["interval_95"] if np.isfinite(v)]
        top = min(2.5 * max(values) / factor, 1.05 * max([*ends, max(values) / factor]))
        axes.set_ylim(floor - 0.1 * (top - floor), top)
    axes.set_xlabel("return time (hours of tow)")
    axes.set_ylabel(f"{first['label']} ({unit}), {meaning([c['loads'][name] for c in shown])}")
    axes.grid(True)
    tows = sorted({c["loads"][name]["design"]["tow_hours"] for c in shown})
    hours = f"{tows[0]:.3g} h" if tows[-1] < 1.001 * tows[0] else f"{tows[0]:.3g} to {tows[-1]:.3g} h (Froude)"
    notes = ["dots: clusters of the fields together", "lines: tail fitted to them (GPD), dashed",
             "beyond the hours simulated"]
    notes += [f"diamond, side by side: exceeded with {100 * first['design']['probability']:g} %",
              f"in a tow of {hours}; bars: 95 %"] if designs else ["no design value: see the tables"]
    if any(d["model"] == "GEV" for d in designs):
        notes += ["beside a line: of block maxima (GEV)"]
    drawn = {c["label"] for c in some}
    lacking = [c["label"] for c in conditions if c["label"] not in drawn]
    if lacking:
        more = [f"and {len(lacking) - 2} more"] * (len(lacking) > 2)
        notes += ["without such a tail, not drawn:", *lacking[:2], *more]
    key_beside(figure, axes, notes, step, some)
    headline(figure, e, f"return levels of {first['label']}")
    return figure


def draw_above(e, conditions, name):
    """Figure of the share of the time that a load is above a level, with its 95 % over fields; None where no condition
    has the load."""
    some = [c for c in conditions if name in c["loads"]]
    if not some:
        return None
    step = max(1, -(-len(some) // MOST_LINES))
    shown, first = some[::step], some[0]["loads"][name]
    levels = [[row["level"] for row in c["loads"][name]["exceedance"]] for c in shown]
    factor, unit = style.scale([np.median([row[-1] for row in levels])], first["units"])
    figure, axes = plt.subplots(figsize=(9.2, 4.6))
    figure.subplots_adjust(left=0.09, right=0.66, top=0.84, bottom=0.15)
    least = 1.0
    for colour, c, level in zip(CYCLE, shown, levels):
        x, level = c["loads"][name], np.array(level) / factor
        share = np.array([row["share_of_time"]["value"] for row in x["exceedance"]])
        low, high = np.array([row["share_of_time"]["interval_95"] for row in x["exceedance"]], dtype=float).T
        least = min(least, share[share > 0].min(initial=1.0))
        axes.plot(level, 100 * share, color=colour, linewidth=1.6,
                  label=f"{c['label']}\n{x['fields']} fields, {x['hours']:.3g} h")
        axes.fill_between(level, 100 * np.fmax(low, 1e-9), 100 * np.fmax(high, 1e-9), where=np.isfinite(low),
                          color=colour, alpha=0.15, linewidth=0)
    style.logarithmic(axes.yaxis)
    axes.set_ylim(50 * least, 100)
    axes.set_xlabel(f"{first['label']} ({unit}), {meaning([c['loads'][name] for c in shown])}")
    axes.set_ylabel("share of the time above (%)")
    axes.grid(True)
    notes = ["from the median of a condition to the", "largest value simulated; band: 95 % over fields"]
    key_beside(figure, axes, notes, step, some)
    headline(figure, e, f"share of the time above a level of {first['label']}")
    return figure


def draw_map(e, first, second):
    """Figure of two heat maps over two parameters of a grid: mean of the means of the conditions of a cell, which
    differ in the other parameters, and half the 95 % interval over it."""
    conditions = [c for c in e.conditions() if len(c.finished)]
    xs, ys = (sorted({c.values[k] for c in conditions}) for k in (first, second))
    mean, width = (np.full((len(ys), len(xs)), np.nan) for _ in range(2))
    most = 1
    for i, v in enumerate(ys):
        for j, u in enumerate(xs):
            cell = [dict(zip(e.seed[c.finished].tolist(), of(e, c.finished))) for c in conditions
                    if c.values[first] == u and c.values[second] == v]
            if cell:
                mean[i, j], low, high = stat_mean.mean_of_conditions(cell)
                width[i, j] = (high - low) / 2 / abs(mean[i, j]) if mean[i, j] else np.nan
                most = max(most, len(cell))
    factor, unit = style.scale([np.nanmedian(mean)], "N")
    figure, axes = plt.subplots(1, 2, figsize=(12, 2.6 + 0.62 * len(ys)))
    height = figure.get_size_inches()[1]
    figure.subplots_adjust(left=0.08, right=0.98, top=1 - 1.15 / height, bottom=0.75 / height, wspace=0.2)
    log = wants_log(mean / factor)
    for ax, values, label, texts, colours in ((axes[0], mean / factor, f"mean ice resistance ({unit})",
                                               lambda v: style.short(v), style.SPEED_MAP),
                                              (axes[1], 100 * width, "half the 95 % interval of the mean (%)",
                                               lambda v: f"{v:.0f} %", style.FORCE_MAP)):
        norm = LogNorm() if log and ax is axes[0] else None
        image = ax.pcolormesh(values, cmap=colours, norm=norm, edgecolor=style.PAPER, linewidth=0.6)
        for (i, j), v in np.ndenumerate(values):
            shade = image.norm(v) if np.isfinite(v) else 0
            ax.text(j + 0.5,
                    i + 0.5,
                    texts(v) if np.isfinite(v) else "–",
                    ha="center",
                    va="center",
                    fontsize=9.5,
                    color=style.ON_DARK if shade > 0.5 else style.ON_LIGHT)
        for set_ticks, key, some in ((ax.set_xticks, first, xs), (ax.set_yticks, second, ys)):
            times = reading(key, e.units[key])[0]
            set_ticks(np.arange(len(some)) + 0.5, [f"{times * v:.3g}" for v in some])
        ax.tick_params(length=0)
        for side in ax.spines.values():
            side.set_visible(False)
        ax.set_xlabel(axis_label(e, first))
        ax.set_title(label, fontsize=10.5)
    axes[0].set_ylabel(axis_label(e, second))
    others = [short_key(k) for k in e.parameters if k not in (first, second)]
    headline(figure, e, f"over {short_key(first)} and {short_key(second)}" +
             (f", mean of {most} conditions of {' and '.join(others)}" if most > 1 else ""))
    return figure


def draw_indices(axes, names, indices):
    """Bars of first-order and total Sobol indices."""
    for k, name in enumerate(names):
        for what, shift, colour, label in (("first", 0.17, style.ICE, "first order"),
                                           ("total", -0.17, style.TOW, "total")) if name in indices else ():
            axes.barh(k + shift, indices[name][what], height=0.3, color=colour, label=label if k == 0 else None)
            axes.plot(indices[name][f"{what}_95"], [k + shift] * 2, color=style.INK, linewidth=1.2)
    axes.set_xlabel("share of the explained variance")
    axes.set_xlim(0, 1.02)
    axes.legend(loc="lower right")


def draw_sensitivity(e, x):
    """Figure of Sobol indices, of the mean and of its logarithm where they are given, beside partial rank correlations;
    None where there is neither."""
    ranks = x.get("ranks", {})
    given = [(words, x[key])
             for words, key in (("mean", "sobol"), ("logarithm", "sobol_of_logarithm"))
             if "indices" in x.get(key, {})]
    names = sorted(set(ranks).union(*(s["indices"] for _, s in given)),
                   key=lambda k: (max([s["indices"][k]["total"]
                                       for _, s in given
                                       if k in s["indices"]], default=0), abs(ranks.get(k, {}).get("prcc", 0))))
    if not names:
        return None
    n = len(given) + 1
    figure, grid = plt.subplots(1, n, figsize=(3.2 + 4.2 * n, 2.2 + 0.6 * len(names)), sharey=True, squeeze=False)
    width, height = figure.get_size_inches()
    figure.subplots_adjust(left=1.7 / width, right=0.98, top=1 - 1.15 / height, bottom=0.85 / height, wspace=0.1)
    for axes, (words, s) in zip(grid[0], given):
        draw_indices(axes, names, s["indices"])
        axes.set_title(f"Sobol, of the {words}: R² {s['r2']:.2f}, Q² {s['q2']:.2f}", fontsize=10.5)
    axes = grid[0, -1]
    for k, name in enumerate(names):
        if name in ranks:
            axes.barh(k, ranks[name]["prcc"], height=0.5, color=style.DRAG)
            axes.plot(ranks[name]["prcc_95"], [k] * 2, color=style.INK, linewidth=1.2)
    axes.axvline(0, color=style.FAINT, linewidth=0.8)
    axes.set_xlim(-1, 1)
    axes.set_title("partial rank correlation (PRCC)", fontsize=10.5)
    grid[0, 0].set_yticks(np.arange(len(names)), [short_key(k) for k in names])
    for ax in grid[0]:
        ax.grid(True, axis="x")
    missing = [
        f"no Sobol indices of the {words}: {x[key]['refused']}" for words, key in (("mean", "sobol"),
                                                                                   ("logarithm", "sobol_of_logarithm"))
        if "refused" in x.get(key, {})
    ]
    figure.text(0.3 / width, 0.08 / height, "; ".join(["black: 95 %", *missing]), fontsize=9, color=style.FAINT)
    headline(figure, e, "what the resistance depends on")
    return figure


def conditions_with_loads(e, options):
    """What draw_returns needs of the conditions."""
    return [{"label": c.label, "loads": loads.statistics(e, c.finished, options)} for c in e.conditions()]


def pictures(e, options, conditions):
    """(name, function that draws it) of the pictures that the study supports. conditions: with "label" and "loads", and
    "extremes" if it is known, as ensemble.py has them."""
    keys = numeric(e)
    names = dict.fromkeys(name for c in conditions for name, x in c["loads"].items()
                          if "refused" not in x["over_threshold"])
    out = [(f"returns-{name.replace('_', '-')}", lambda name=name: draw_returns(e, conditions, name)) for name in names]
    out += [(f"above-{name.replace('_', '-')}", lambda name=name: draw_above(e, conditions, name))
            for name in dict.fromkeys(name for c in conditions for name in c["loads"])
            if name != "ice_resistance" and name not in loads.LOCAL]
    out += [(f"sweep-{key.replace('.', '-')}", lambda key=key: (draw_scatter if e.sampled else draw_sweep)(e, key))
           for key in keys]
    if not e.sampled and len(keys) >= 2:
        out.append(("map", lambda: draw_map(e, keys[0], keys[1])))
    if len(keys) >= 2:
        out.append(("sensitivity", lambda: draw_sensitivity(e, sensitivity(e, {int(m): member(e, m) for m in e.used}))))
    if plot_variants.KEY in e.parameters and not e.sampled:
        out.append(("variants", lambda: plot_variants.draw(e, headline)))
    if not e.sampled or len(e.conditions()) <= MOST_LINES:
        tails = {c["index"]: c["extremes"].get("over_threshold") for c in conditions if "extremes" in c}
        out.append(("exceedance", lambda: draw_exceedance(e, options, tails)))
    return out


def main(argv=None):
    p = argparse.ArgumentParser(description="Draw the pictures of an ensemble that its study supports.")
    p.add_argument("folder", metavar="DIR", help="folder of `bergtow ensemble`")
    p.add_argument("-o", "--output", metavar="FOLDER", type=Path, help="where to put the pictures (default: DIR)")
    p.add_argument("--format",
                   choices=[s[1:] for s in command.PICTURES],
                   default="png",
                   help="kind of the files (default png)")
    p.add_argument("--exclude",
                   action="append",
                   choices=EXCLUDABLE,
                   default=[],
                   help="leave out members with this doubt; may be repeated")
    add_load_options(p)
    command.add_force(p)
    a = p.parse_args(argv)
    a.hours, a.gap, a.threshold, a.blocks, a.resamples = [1.0, 10.0, 100.0], None, None, None, 1
    e = Ensemble(a.folder)
    dropped = e.exclude(a.exclude) if a.exclude else {}
    for name, kinds in dropped.items():
        print(f"left out: {name} ({', '.join(kinds)})")
    if not len(e.used):
        raise nothing_to_count(e, dropped)
    if e.holes():
        print(f"plot_ensemble.py: warning: {e.holes()}", file=sys.stderr)
    drawn = pictures(e, a, conditions_with_loads(e, a))
    if not drawn:
        raise RunError(e.file, "varies nothing that can be drawn", "read the tables of ensemble.py")
    places = {name: (a.output or e.path) / f"{name}.{a.format}" for name, _ in drawn}
    for path in places.values():
        command.may_write(path, a.force)
    for name, draw in drawn:
        figure = draw()
        if figure is not None:
            command.save(figure, places[name], a.force)
            plt.close(figure)


if __name__ == "__main__":
    command.guarded(main)
