# SPDX-License-Identifier: MIT
"""Exceedance of loads, or of collision peaks, in the conditions of an ensemble: one line per condition."""
from bergtow.plot import style
from bergtow.plot.axes import headline, wants_log
from bergtow.stats import extreme as stat_extreme
from bergtow.stats.conditions import extremes
from bergtow.table import counted

import numpy as np
import scipy

MAX_LINES = 8
CYCLE = ("#0072b2", "#d55e00", "#009e73", "#8c6bb1", "#b8860b", "#56b4e9", "#4d4d4d", "#cc79a7")


def every(some):
    """One in how many of these conditions is shown."""
    return max(1, -(-len(some) // MAX_LINES))


def finished(e, axes, notes, some, subject):
    """The figure, with legend and notes to the right of the axes. some: the conditions, see every()."""
    axes.grid(True)
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8.8, labelspacing=0.9)
    notes = notes + [f"one in {every(some)} of {len(some)} conditions is shown"] * (every(some) > 1)
    axes.figure.text(0.675, 0.13, "\n".join(notes), fontsize=9, color=style.FAINT, va="bottom")
    headline(axes.figure, e, subject)
    return axes.figure


def draw_exceedance(e, options, tails=None):
    """Figure of the exceedance of peaks, one line per condition, overlaid with the GPD tail; None if there are no
    peaks. tails: the known fitted tails, by the index of their condition."""
    some = [c for c in e.conditions() if len(c.finished)]
    figure, axes = style.subplots(figsize=(9.2, 5.4))
    figure.subplots_adjust(left=0.08, right=0.66, top=0.86, bottom=0.14)
    conversions, top, least, notes = set(), 0.0, np.inf, []
    for colour, c in zip(CYCLE, some[::every(some)]):
        hits = [h for h in map(e.impacts, c.finished) if h]
        hours = sum(h[3] for h in hits)
        peaks, rate = stat_extreme.exceedance([{"peak": h[1], "hours": h[3]} for h in hits])
        above = peaks > 0
        if not above.any():
            continue
        conversions.update(h[4] for h in hits)
        top, least = max(top, peaks[0]), min(least, peaks[above][-1])
        axes.plot(peaks[above], rate[above], color=colour, drawstyle="steps-post", linewidth=1.4,
                  label=f"{c.label}\n{len(peaks)} collisions, {hours:.3g} h")
        tail = tails[c.index] if tails else extremes(e, c.finished, options)["over_threshold"]
        if "refused" not in tail:
            z = np.geomspace(tail["threshold"] * 1.0001, 3 * peaks[0], 200)
            fitted = tail["rate_per_hour"] * scipy.stats.genpareto.sf(z, tail["shape"], tail["threshold"],
                                                                      tail["scale"])
            axes.plot(z, np.where(fitted > 0.1 / hours, fitted, np.nan), color=colour, linewidth=1, dashes=(4, 2))
            notes = ["dashed: tail fitted to clusters of peaks,", "down to once in ten times the hours simulated"]
    if not conversions:
        return None
    style.logarithmic(axes.xaxis, axes.yaxis)
    axes.set(xlim=(max(1e-4 * top, 0.7 * least), 3 * top), xlabel=f"peak of a collision (N), {by(conversions)}",
             ylabel="exceeded (per hour of tow)")
    return finished(e, axes, notes, some, "how often a peak is exceeded")


def tail(f, hours):
    """Levels at return times, from the tail fitted to peaks over a threshold."""
    return f["threshold"] + f["scale"] * stat_extreme.growth(f["shape"], np.maximum(f["rate_per_hour"] * hours, 1.0))


def ends_of(x):
    """(value, [further ends]) of a load at its longest return times: the design value and its interval; without one, as
    in a tow shorter than the separation of clusters, the largest cluster and the end of the fitted tail."""
    f, d = x["over_threshold"], x["design"]
    if "refused" in d:
        return max(f["maxima"]), [tail(f, max(level["hours"] for level in f["levels"]))]
    return d["value"], [v for v in d["interval_95"] if np.isfinite(v)]


def draw_return_line(axes, x, label, colour, factor, beside):
    """Draw maxima of clusters at their empirical return times, the fitted tail, and the design value `beside` its
    return time."""
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
    """How collision peaks are defined, in words, for the conditions of one picture."""
    return next(iter(conversions)) if len(conversions) == 1 else "each condition by its own impact.conversion"


def meaning(some):
    """The definition of a load's value in words: its collisions and time scale, for the conditions of one picture."""
    conversions = {x["conversion"] for x in some if x["conversion"]}
    scales = sorted(x["time_scale_s"] for x in some)
    over = f"{scales[0]:.3g}" if scales[-1] < 1.001 * scales[0] else f"{scales[0]:.3g} to {scales[-1]:.3g}"
    return f"collisions as {by(conversions)}" if conversions else f"mean over {over} s"


def draw_returns(e, conditions, name):
    """Figure of the return levels of a load; None if no condition has a tail."""
    some = [c for c in conditions if name in c["loads"] and "refused" not in c["loads"][name]["over_threshold"]]
    if not some:
        return None
    shown, first = some[::every(some)], some[0]["loads"][name]
    designs = [d for d in (c["loads"][name]["design"] for c in shown) if "refused" not in d]
    values, ends = zip(*(ends_of(c["loads"][name]) for c in shown))
    factor, unit = style.scale([np.median(values)], first["units"])
    figure, axes = style.subplots(figsize=(9.2, 5.4))
    figure.subplots_adjust(left=0.09, right=0.66, top=0.86, bottom=0.14)
    for k, (colour, c) in enumerate(zip(CYCLE, shown)):
        x = c["loads"][name]
        draw_return_line(axes, x, f"{c['label']}\n{counted(x['fields'], 'field')}, {x['hours']:.3g} h", colour, factor,
                         1.1 ** (k - (len(shown) - 1) / 2))
    style.logarithmic(axes.xaxis)
    floor = min(c["loads"][name]["over_threshold"]["threshold"] for c in shown) / factor
    if wants_log(np.array(values) / factor) and floor > 0:
        style.logarithmic(axes.yaxis)
        axes.set_ylim(0.8 * floor, 4 * max(values) / factor)
    else:
        top = min(2.5 * max(values), 1.05 * max([*values, *sum(ends, [])])) / factor
        axes.set_ylim(floor - 0.1 * (top - floor), top)
    axes.set_xlabel("return time (hours of tow)")
    axes.set_ylabel(f"{first['label']} ({unit}), {meaning([c['loads'][name] for c in shown])}")
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
    return finished(e, axes, notes, some, f"return levels of {first['label']}")


def draw_above(e, conditions, name):
    """Figure of the share of time that a load exceeds a level, with its 95 % interval over fields; None if it varies in
    no condition."""
    some = [c for c in conditions if c["loads"].get(name, {}).get("exceedance")]
    if not some:
        return None
    shown, first = some[::every(some)], some[0]["loads"][name]
    levels = [[row["level"] for row in c["loads"][name]["exceedance"]] for c in shown]
    factor, unit = style.scale([np.median([row[-1] for row in levels])], first["units"])
    figure, axes = style.subplots(figsize=(9.2, 4.6))
    figure.subplots_adjust(left=0.09, right=0.66, top=0.84, bottom=0.15)
    least = 1.0
    for colour, c, level in zip(CYCLE, shown, levels):
        x, level = c["loads"][name], np.array(level) / factor
        share = np.array([row["share_of_time"]["value"] for row in x["exceedance"]])
        low, high = np.array([row["share_of_time"]["interval_95"] for row in x["exceedance"]], dtype=float).T
        least = min(least, share[share > 0].min(initial=1.0))
        axes.plot(level, 100 * share, color=colour, linewidth=1.6,
                  label=f"{c['label']}\n{counted(x['fields'], 'field')}, {x['hours']:.3g} h")
        axes.fill_between(level, 100 * np.fmax(low, 1e-9), 100 * np.fmax(high, 1e-9), where=np.isfinite(low),
                          color=colour, alpha=0.15, linewidth=0)
    style.logarithmic(axes.yaxis)
    axes.set(ylim=(50 * least, 100), xlabel=f"{first['label']} ({unit}), {meaning([c['loads'][name] for c in shown])}",
             ylabel="share of the time above (%)")
    notes = ["from the median of a condition to the", "largest value simulated; band: 95 % over fields"]
    return finished(e, axes, notes, some, f"share of the time above a level of {first['label']}")
