# SPDX-License-Identifier: MIT
"""Mean ice resistance of one or several runs against the concentration, with the estimates; also as a table and in
words.

Runs at the same concentration (with different seeds) are drawn individually, with their mean and its 95 % interval; the
table gives their mean. Estimates are curves for the speed and the width across the tow. Where a vessel or a line lets
these differ between the tows of one case, the estimates are those of each tow. Rejected: curves at the ordered speed,
which no such tow made good.
"""
import sys
from pathlib import Path
from types import SimpleNamespace

from bergtow import arguments, writing
from bergtow.errors import RunError
from bergtow.plot import style
from bergtow.result import at_least, compared
from bergtow.result.origins import source_of_ice
from bergtow.result.run import Run
from bergtow.said import say
from bergtow.stats import drift as stat_drift
from bergtow.table import quantity, scale, short

import numpy as np

SAME = 0.02  # relative difference allowed between the thickness or the curves of runs in one picture


def read(path):
    """A run as a point: forces in N, NaN where the run gives none, "mean" AtLeast if steps of its window have no
    solution; "asked": ice.concentration, or the actual one if the case does not give it; "change": of the ice
    resistance over the window; "reference": the measured value; "unconverged": share of the steps; "of_ice": the
    estimates of the ice resistance; "state": hash of the final state, "" if the run does not give it; "conditions":
    inputs of the estimates, thickness_m, width_m, ..., and "curves". Raises RunError."""
    with Run(path) as run:
        file, estimates = run.path / "summary.json", run.summary.get("estimates")
        if not isinstance(estimates, dict) or "curves" not in estimates:
            raise RunError(file, "holds no estimates", "run a case with a towed body, with this version")
        if estimates.get("speed_along_m_s") is None:
            if np.isfinite(run.adrift):
                raise RunError(file, f"shows a tow whose last line parted at {run.adrift:g} s",
                               "run it with a stronger line, or end it before")
            raise RunError(file, "is of a body that is not towed", "run a case with a tow")
        made, (mean, low, high) = run.number("concentration"), run.interval("ice_resistance")
        if not np.isfinite(mean):
            raise RunError(file, "has no mean ice resistance", "run longer: there was no window")
        return SimpleNamespace(
            path=run.path, title=style.title(run), concentration=made, mean=mean, low=low, high=high,
            asked=made if source_of_ice(run.case) else run.value("ice.concentration", made),
            se=run.number("mean_ice_resistance_se_n"), steady=run.verdict[0] == "steady",
            change=run.number("window.series.ice_resistance.change_n"), reference=run.number("reference.mean_force_n"),
            unconverged=run.number("unconverged_steps", 0.0) / max(run.number("n_steps", 1.0), 1.0),
            warnings=len(run.warnings), estimates=run.estimates, case=dict(run.case),
            of_ice={name: e for name, e in run.estimates.items() if not e.on_top},
            state=str(run.summary.get("state_hash") or ""), conditions=estimates)


def curve(point, name):
    """(concentration [n], force [n] N, NaN where undefined) of an estimate, for the conditions of a run."""
    curves = point.conditions["curves"]
    return np.array(curves["concentration"], dtype=float), np.array(curves[name], dtype=float)


def one_set_of_curves(points):
    """Do the curves of the first run suit all of them?"""
    first = points[0]
    # the actual floe size varies
    return all(np.allclose(curve(first, name)[1], curve(other, name)[1], rtol=SAME, atol=0, equal_nan=True)
               for other in points[1:] for name, e in first.of_ice.items()
               if not e.uses_floe_size and name in other.of_ice)


def check_alike(points):
    """The runs must be of one case. Raises RunError naming the first two that differ."""
    first = points[0]
    for other in points[1:]:
        here, there = (p.conditions["thickness_m"] for p in (first, other))
        if not np.isclose(here, there, rtol=SAME, atol=0):
            raise RunError(other.path, f"has other ice than {first.path}: {there:.4g} m thick, and {here:.4g} m there",
                           "draw them in separate pictures")
        for key, here, there in compared.unlike(first.case, other.case, ("ice.concentration", )):
            raise RunError(other.path,
                           f"has a different case from {first.path}: {key} is {here} there and {there} here",
                           "draw them in separate pictures")


def once(points):
    """The points without runs that end in the same state as an earlier one: the run was repeated, or the seed does not
    change the ice."""
    seen, out = set(), []
    for p in points:
        if p.state and p.state in seen:
            print(f"bergtow plot-resistance: left out: {p.path}: ends in the same state as an earlier run",
                  file=sys.stderr)
        else:
            out.append(p)
        seen.add(p.state)
    return out


def rows(points):
    """One row per concentration: (asked, number of runs, how many steady, mean, combined drift (stat_drift.of),
    standard error, 95 % interval, ratio and force of each estimate, largest share of steps that did not converge). For
    several runs: mean of the means, error and interval from their scatter. For one run: its own values."""
    out = []
    for asked in sorted({p.asked for p in points}):
        some = [p for p in points if p.asked == asked]
        means = np.array([p.mean for p in some])
        se, low, high = some[0].se, some[0].low, some[0].high
        if len(some) > 1:
            se = means.std(ddof=1) / np.sqrt(len(some))
            low, high = stat_drift.interval(means)
        names = [name for name in some[0].estimates if all(name in p.estimates for p in some)]
        forces = {name: float(np.mean([p.estimates[name].force for p in some])) for name in names}
        valid, compares = ({name: all(getattr(p.estimates[name], what) for p in some) for name in names}
                           for what in ("valid", "compares"))
        mean = at_least.of(means.mean(), [p.mean for p in some])
        if isinstance(mean, at_least.AtLeast):
            se = low = high = np.nan
        out.append({"concentration": asked, "runs": len(some), "steady": sum(p.steady for p in some), "mean": mean,
                    "drift": stat_drift.of([p.change for p in some], means.mean()),
                    "se": se, "low": low, "high": high, "forces": forces, "valid": valid, "compares": compares,
                    "unconverged": max(p.unconverged for p in some), "warnings": sum(p.warnings for p in some)})
    return out


def table(points):
    """The rows as a Markdown table, forces in N. Brackets give simulated / estimate for an estimate that is meant for
    these conditions and depends on the concentration; * marks an estimate that is not meant for the conditions."""
    names = points[0].of_ice
    head = ["ice, %", "runs", "simulated, N", "standard error, N", *(e.label for e in names.values()),
            "steps not converged", "warnings"]
    lines = ["| " + " | ".join(head) + " |", "|" + " ---: |" * len(head)]
    for row in rows(points):
        cells = [f"{100 * row['concentration']:.3g}", str(row["runs"]), f"{row['mean']:.4g}",
                 f"{row['se']:.2g}" if np.isfinite(row["se"]) else "–"]
        for name in names:
            force = row["forces"].get(name, np.nan)
            text = "–" if np.isnan(force) else f"{force:.3g}" + ("" if row["valid"][name] else "*")
            cells.append(text + (f" ({row['mean'] / force:.3g})" if row["compares"].get(name) else ""))
        cells += [f"{100 * row['unconverged']:.2g} %", str(row["warnings"])]
        lines.append("| " + " | ".join(cells) + " |")
    shares = [f"{100 * row['concentration']:.3g} % ice: {at_least.words(row['mean'].share)}." for row in rows(points)
              if isinstance(row["mean"], at_least.AtLeast)]
    return "\n".join([*lines, "", *shares] if shares else lines)


def words(points):
    """The rows as sentences: the added force from ice at each concentration, with the estimates valid for it; finally
    the open-water drag."""
    def of(estimates, row):
        return "; ".join(f"{e.label} {quantity(row['forces'][name], 'N')}" for name, e in estimates.items()
                         if row["valid"].get(name) and np.isfinite(row["forces"][name]))

    def verdict(row):
        n, steady = row["runs"], f"{row['steady']} of {row['runs']}"
        if row["drift"] is None:
            return f"{steady} tow{'s' if n > 1 else ''} steady"
        change, _, moved = row["drift"]
        if moved:
            return (f"over all tows the load {'rises' if change > 0 else 'falls'} by {quantity(abs(change), 'N')} in "
                    f"the window; {steady} steady by themselves")
        return f"steady over all tows, and {steady} by themselves"

    lines = []
    for row in rows(points):
        factor, unit = scale([row["mean"]], "N")
        mean, low, high = (short(row[key] / factor) for key in ("mean", "low", "high"))
        held = f" (95 %: {low} to {high})" if np.isfinite(row["low"]) else \
            f" ({at_least.words(row['mean'].share)})" if isinstance(row["mean"], at_least.AtLeast) else ""
        lines += [f"{100 * row['concentration']:.3g} % ice adds {mean} {unit}{held}, the mean of {row['runs']} "
                  f"tow{'s' if row['runs'] > 1 else ''}.", f"    Verdict: {verdict(row)}.",
                  f"    Estimates: {of(points[0].of_ice, row) or 'none is meant for this ice'}."]
    on_top = of({name: e for name, e in points[0].estimates.items() if e.on_top}, row)
    at = "" if one_set_of_curves(points) else f", as towed in {100 * row['concentration']:.3g} % ice"
    return "\n".join(lines + ([f"Without ice{at}: {on_top}."] if on_top else []))


def estimated(points, name):
    """(concentration [n], force [n] N, whether the estimate is meant there [n]): a curve, or the values of the tows."""
    if one_set_of_curves(points):
        a, force = curve(points[0], name)
        low, high = np.array(points[0].conditions["curves"]["valid_range"][name], dtype=float)
        return a, force, (a >= low) & (a <= high)
    return (np.array(x) for x in zip(*((row["concentration"], row["forces"].get(name, np.nan),
                                        row["valid"].get(name, False)) for row in rows(points))))


def draw_estimates(axes, points, factor):
    """Draw curves: solid where an estimate is valid, thin and dotted elsewhere; a band for an estimate that gives a
    range."""
    first, mark = points[0], None if one_set_of_curves(points) else "d"
    for k, (name, estimate) in enumerate(first.of_ice.items()):
        label, colour = estimate.label, style.ESTIMATES[k % len(style.ESTIMATES)]
        a, force, inside = estimated(points, name)
        force = force / factor
        axes.plot(a, np.where(inside, force, np.nan), color=colour, linewidth=2, marker=mark, markersize=4, label=label)
        axes.plot(a, force, color=colour, linewidth=1, dashes=(1, 1.6), zorder=1.5, label=label)
        spans = [p.estimates[name].numbers for p in points if name in p.estimates and p.estimates[name].force]
        spans = [s for s in spans if None not in (s["force_n"], s["low_n"], s["high_n"])]
        if spans and spans[0]["high_n"] > spans[0]["low_n"]:
            down, up = (spans[0][k] / spans[0]["force_n"] for k in ("low_n", "high_n"))
            axes.fill_between(a, np.where(inside, force * down, np.nan), np.where(inside, force * up, np.nan),
                              color=colour, alpha=0.18, linewidth=0, zorder=1.2)
    for name, estimate in first.estimates.items():
        if estimate.on_top:
            look = {"color": style.FAINT, "linewidth": 1, "dashes": (6, 3), "label": f"{estimate.label} (comes on top)"}
            if mark:
                a, force, _ = estimated(points, name)
                axes.plot(a, force / factor, marker=mark, markersize=4, **look)
            else:
                axes.axhline(estimate.force / factor, **look)


def limits(points, log):
    """Lower and upper end of the force axis, N, from the runs and the estimates that are valid for them."""
    around = [p.reference for p in points] + [r[end] for r in rows(points) for end in ("low", "high")]
    around += [e.numbers[end] for p in points for e in p.of_ice.values() if e.valid for end in ("low_n", "high_n")]
    return style.force_limits([p.mean for p in points], around, log)


def draw_runs(axes, points, factor):
    """Draw the runs, each with its interval if it is the only one at its concentration, the means of several runs with
    theirs, and the measured values."""
    averaged = [r for r in rows(points) if r["runs"] > 1]
    alone = np.array([not any(p.asked == r["concentration"] for r in averaged) for p in points])
    a = np.array([p.concentration for p in points])
    mean = np.array([p.mean for p in points])
    bars = np.nan_to_num([[p.mean - p.low for p in points], [p.high - p.mean for p in points]]) / factor
    steady = np.array([p.steady for p in points])
    for which, face, label in ((steady & alone, style.ICE, "simulated, 95 % of the run's mean"),
                               (~steady & alone, style.PAPER, "window not steady or too short")):
        if which.any():
            axes.errorbar(a[which], mean[which] / factor, yerr=bars[:, which], fmt="o", color=style.ICE,
                          markerfacecolor=face, markersize=6, capsize=3, linewidth=1.4, zorder=5, label=label)
    for which, face, label in ((steady & ~alone, style.ICE, "simulated, a tow"),
                               (~steady & ~alone, style.PAPER, "a tow, not steady or too short")):
        if which.any():
            axes.plot(a[which], mean[which] / factor, "o", color=style.ICE, markerfacecolor=face, markersize=4,
                      alpha=0.6, zorder=4, label=label)
    least = [(p.concentration, p.mean / factor) for p in points if isinstance(p.mean, at_least.AtLeast)]
    if least:
        axes.plot(*zip(*least), linestyle="none", marker="^", color=style.JAM, markersize=7, zorder=7,
                  label="simulated, at least")
    if averaged:
        centre, low_end, high_end = (np.array([r[key] for r in averaged]) for key in ("mean", "low", "high"))
        axes.errorbar([r["concentration"] for r in averaged], centre / factor,
                      yerr=np.array([centre - low_end, high_end - centre]) / factor, fmt="s", color=style.INK,
                      markersize=5, capsize=5, linewidth=1.8, zorder=6, label="mean of the tows, 95 % (t)")
    measured = [p for p in points if np.isfinite(p.reference)]
    if measured:
        axes.plot([p.concentration for p in measured], [p.reference / factor for p in measured], "D",
                  color=style.REFERENCE, markersize=6, zorder=6, label="measured")


def span(points, key):
    """A number of the conditions of all runs in words."""
    some = sorted(p.conditions[key] for p in points)
    return " to ".join(dict.fromkeys(f"{v:.3g}" for v in (some[0], some[-1])))


def write_around(figure, points, lost):
    """Write heading and notes. lost: legends of curves outside the axes."""
    e = points[0].conditions
    of = f"{points[0].title}: ice" if len(points) == 1 else "Ice"
    figure.text(0.02, 0.98, f"{of} resistance and estimates", va="top", fontsize=13.5, fontweight="bold")
    figure.text(0.02, 0.94,
                f"{span(points, 'thickness_m')} m of ice, body {span(points, 'width_m')} m across, "
                f"{span(points, 'speed_along_m_s')} m/s through the ice; {len(points)} "
                f"run{'s' if len(points) > 1 else ''}", va="top", color=style.FAINT)
    notes = ["dotted: outside the range", "the estimate is meant for", "band: its range, where it has one"]
    notes += [] if one_set_of_curves(points) else ["estimates: those of each tow"]
    notes += ["out of the picture:", *lost] if lost else []
    if e["length_scale"] != 1:
        notes.append(f"P*, P_s by length scale {e['length_scale']:.3g}")
    some = [p.mean.share for p in points if isinstance(p.mean, at_least.AtLeast)]
    if some:
        notes.append(f"{len(some)} run(s) at least this: in up to\n{100 * max(some):.2g} % of the steps the load\n"
                     "has no bound")
    doubtful = sum(p.warnings > 0 for p in points)
    if doubtful:
        notes.append(f"{doubtful} of {len(points)} runs carry warnings")
    figure.text(0.735, 0.1, "\n".join(notes), va="bottom", fontsize=9, color=style.FAINT)


def draw(points, log=True):
    """The figure of resistance against concentration. log: a logarithmic axis if all means are positive."""
    check_alike(points)
    log = log and min(p.mean for p in points) > 0
    low, high = limits(points, log)
    factor, unit = style.scale([high / 3] if log else [low, high], "N")
    figure = style.Figure(figsize=(11, 7))
    axes = figure.add_axes((0.085, 0.1, 0.63, 0.755))
    draw_estimates(axes, points, factor)
    of_estimates = axes.get_legend_handles_labels()[0]
    draw_runs(axes, points, factor)
    if log:
        style.logarithmic(axes.yaxis)
    axes.set(ylim=(low / factor, high / factor), xlim=(0, 1), xlabel="ice concentration",
             ylabel=f"mean ice resistance ({unit})")
    axes.grid(which="major")
    handles, labels, lost = style.legend_of(axes)
    order = sorted(range(len(labels)), key=lambda i: handles[i] in of_estimates)
    axes.legend([handles[i] for i in order], [labels[i] for i in order], loc="upper left", bbox_to_anchor=(1.02, 1.0),
                borderaxespad=0, handlelength=2.4, labelspacing=0.8)
    write_around(figure, points, lost)
    return figure


def options(p):
    p.add_argument("run", metavar="RUN", nargs="+",
                   help="output folders of runs that differ in concentration and seed only")
    p.add_argument("-o", "--output", metavar="FILE", type=Path,
                   help="file to write (default: resistance.png beside the first RUN)")
    p.add_argument("--linear", action="store_true",
                   help="linear force axis (default: logarithmic if all means are positive)")
    p.add_argument("--table", metavar="FILE", type=Path, help="also write the numbers as a Markdown table")
    p.add_argument("--words", action="store_true", help="also print the numbers as sentences")
    arguments.add_force(p)


@style.look()
def perform(a):
    path = a.output or Path(a.run[0]).resolve().parent / "resistance.png"
    arguments.ends_in(path, writing.PICTURES)
    for place in filter(None, (path, a.table)):
        writing.may_write(place, a.force)
    points = once([read(run) for run in a.run])
    writing.save(draw(points, not a.linear), path, a.force)
    if a.table:
        writing.write_markdown(table(points), a.table, a.force)
        say(a.table)
    if a.words:
        say(f"\n{words(points)}")
