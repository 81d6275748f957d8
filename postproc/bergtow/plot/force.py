# SPDX-License-Identifier: MIT
"""Forces of a run against time, with the mean over its window; on request, the solver's diagnostics."""
import textwrap

from bergtow import arguments, writing
from bergtow import table as text_table
from bergtow.errors import RunError
from bergtow.plot import style
from bergtow.result.run import Run

import numpy as np
from matplotlib.ticker import MaxNLocator


def running_mean(x, width):
    """Mean of x [n] over the width samples around each one; NaN near the ends, where the window does not fit."""
    n, reach = len(x), max(width, 1) // 2
    total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(x))])
    count = np.concatenate([[0], np.cumsum(np.isfinite(x))])
    out = np.full(n, np.nan)
    if n > 2 * reach:
        with np.errstate(invalid="ignore", divide="ignore"):
            out[reach:n - reach] = ((total[2 * reach + 1:] - total[:n - 2 * reach])
                                    / (count[2 * reach + 1:] - count[:n - 2 * reach]))
    return out


def smoothing(run):
    """(samples, s) of the running mean: the time to tow one body length, at least 10 samples, at most 1/20 of the
    run."""
    time = run["time"]
    if len(time) < 3:
        return 1, 0.0
    step = (time[-1] - time[0]) / (len(time) - 1)
    speed = run.value("tow.speed", 0.0)
    length = 0.0 if run.towed is None else np.ptp(run.bodies[run.towed].vertices[:, 0])
    wish = length / speed if speed > 0 and length > 0 else (time[-1] - time[0]) / 50
    samples = int(np.clip(wish / step, min(10, len(time) // 4), max(len(time) // 20, 1)))
    return samples, (2 * (max(samples, 1) // 2) + 1) * step  # as many samples as running_mean uses


def _clip_peaks(axes, raw, smooth, marks, factor, top):
    """Limit the axis to the running mean and the marks; larger samples are noted in text, not drawn."""
    finite = raw[np.isfinite(raw)]
    if not len(finite):
        return
    low = min([0.0, float(np.percentile(finite, 0.5)), *([] if top else marks)])
    high = max([2.5 * np.max(smooth, where=np.isfinite(smooth), initial=0.0), *(1.5 * m for m in marks)])
    high = top or min(high, max([finite.max(), *(1.1 * m for m in marks)])) or finite.max()
    if high <= low:
        high = low + 1.0
    axes.set_ylim(low / factor, (high if top else 1.04 * high) / factor)
    for end, beyond, at, va in ((finite.max(), finite.max() > 1.04 * high, 0.97, "top"),
                                (finite.min(), finite.min() < low, 0.03, "bottom")):
        if beyond:
            axes.annotate(f"single samples {'up' if va == 'top' else 'down'} to {style.quantity(end, 'N')}",
                          (0.995, at), xycoords="axes fraction", ha="right", va=va, fontsize=9, color=style.FAINT,
                          bbox=dict(facecolor=style.PAPER, edgecolor="none", alpha=0.8, pad=1.5))


def draw_ice(axes, run, factor, unit, top=None):
    """Plot the ice resistance: samples, running mean, mean with its band, reference."""
    time, ice = run["time"], run["ice_resistance"]
    samples, seconds = smoothing(run)
    smooth = running_mean(ice, samples)
    reference = run.number("reference.mean_force_n")
    mean, bottom, ceiling = run.interval("ice_resistance")
    mark_window(axes, run)
    many = len(time) > 2000
    axes.plot(time, ice / factor, color=style.ICE, alpha=0.22 if many else 0.45, linewidth=0.6 if many else 0.8,
              label="each sample", rasterized=len(time) > style.MANY)
    axes.plot(time, smooth / factor, color=style.ICE, gid="running mean",
              label=f"running mean over {style.short(seconds, 2)} s")
    if np.isfinite(mean) and run.window:
        start, end = run.window
        steady = run.verdict[0] == "steady"
        if np.isfinite(bottom):
            axes.fill_between([start, end], bottom / factor, ceiling / factor, color=style.TOW, alpha=0.28, linewidth=0,
                              zorder=1.5)
        axes.plot([start, end], [mean / factor] * 2, color=style.TOW, linewidth=1.8, linestyle="-" if steady else ":",
                  zorder=4, label=run.mean_name + (", 95 % interval" if np.isfinite(bottom) else ""))
    if np.isfinite(reference):
        axes.axhline(reference / factor, color=style.REFERENCE, linewidth=1.3, dashes=(5, 3), zorder=4,
                     label="reference")
    marks = [m for m in (reference, bottom, ceiling) if np.isfinite(m)]
    _clip_peaks(axes, ice, smooth, marks, factor, top)
    axes.set_ylabel(f"ice resistance ({unit})")
    axes.grid(axis="y")
    axes.set_xlim(min(0.0, run["time"][0]), run["time"][-1])
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncol=4, borderaxespad=0.2, handlelength=1.8,
                columnspacing=1.6)


def mark_window(axes, run):
    """Shade the averaging window; hatched if the tow is not steady in it."""
    if run.window:
        steady = run.verdict[0] in ("steady", "not judged")
        axes.axvspan(*run.window, facecolor=style.WINDOW, edgecolor=style.PAPER if steady else style.FAINT,
                     hatch=None if steady else "///", alpha=1 if steady else 0.35, linewidth=0, zorder=0)


def draw_balance(axes, run, factor, unit):
    """Running means of the forces on the towed body along the tow: tow = ice + drag + Coriolis + tilt + ... + inertia.

    The file gives the forces and their order. The first two, tow and ice, are always drawn. Another force is drawn if
    its running mean reaches a hundredth of that of the tow: in single steps, a jam would hide all other forces.
    """
    samples, _ = smoothing(run)
    mark_window(axes, run)
    # The tow force is the widest line: where drag and inertia are small, the ice resistance lies on it.
    means = {name: running_mean(run[name], samples) for name in run.by_role("balance", "force")}
    largest = [np.nanmax(np.abs(mean), initial=0) for mean in means.values()]
    for k, (name, mean) in enumerate(means.items()):
        if k > 1 and largest[k] < 0.01 * largest[0]:
            continue
        colour, width, dashes = style.BALANCE[k] if k < len(style.BALANCE) else style.BALANCE[-1 - k % 3]
        line, = axes.plot(run["time"], mean / factor, color=colour, linewidth=width, label=run.label(name))
        if dashes:
            line.set_dashes(dashes)
    axes.set_ylabel(f"running mean ({unit})")
    axes.grid(axis="y")
    axes.set_xlim(min(0.0, run["time"][0]), run["time"][-1])
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncol=6, borderaxespad=0.2, handlelength=2.2,
                columnspacing=1.6)


def findings(run):
    """One line with the means over the window."""
    mean, low, high = run.interval("ice_resistance")
    words = []
    if np.isfinite(mean):
        said, ends = text_table.stated(mean, low, high, "N")
        words.append(f"{run.mean_name}: ice resistance {said}" + (f" (95 %: {ends})" if high > low else ""))
    tow, low, high = run.interval("tow_force")
    if np.isfinite(tow):
        words.append(f"tow force {style.quantity(tow, 'N')}")
    reference = run.number("reference.mean_force_n")
    if np.isfinite(reference):
        source = style.plain(textwrap.shorten(run.summary["reference"].get("source") or "", 60, placeholder=" ..."))
        words.append(f"reference {style.quantity(reference, 'N')}" + (f" ({source})" if source else "")
                     + (f", ratio {mean / reference:.2f}" if reference and np.isfinite(mean) else ""))
    return "; ".join(words)


def doubts(run):
    """The first two warnings of the summary, each on one line."""
    warnings = [warning["text"] for warning in run.warnings]
    lines = [style.plain(textwrap.shorten(f"warning: {w}", 145, placeholder=" ...")) for w in warnings[:2]]
    if len(warnings) > 2:
        lines[1] = (lines[1][:110].rsplit(" ", 1)[0] + " ..." if len(lines[1]) > 115 else lines[1]) \
            + f" ({len(warnings) - 2} more in summary.json)"
    return lines


def draw(run, top=None):
    """The figure of the forces. top: upper end of the axes, N (default: from the data)."""
    if run.towed is None:
        raise RunError(run.result, "has no towed body, so there is no force to draw", "look at the field instead")
    if not len(run["time"]):
        raise RunError(run.result, "holds no samples", "the run ended before its first sample: run the case for longer")
    figure = style.Figure(figsize=(11, 7.2))
    grid = figure.add_gridspec(2, 1, height_ratios=(1.55, 1), hspace=0.30, left=0.085, right=0.975,
                               top=0.79 if doubts(run) else 0.825, bottom=0.115)
    upper = figure.add_subplot(grid[0])
    lower = figure.add_subplot(grid[1], sharex=upper)
    smooth = running_mean(run["ice_resistance"], smoothing(run)[0])
    factor, unit = style.scale([top] if top else np.append(smooth, run.number("reference.mean_force_n")), "N")
    draw_ice(upper, run, factor, unit, top)
    draw_balance(lower, run, factor, unit)
    if top:
        low, high = lower.get_ylim()
        lower.set_ylim(max(low, -0.1 * top / factor), min(high, top / factor))
    upper.tick_params(labelbottom=False)
    lower.set_xlabel("time (s)")
    style.headline(figure, run, "force on the towed body")
    height = figure.get_size_inches()[1]
    figure.text(0.02, 1 - 0.68 / height, findings(run), va="top", fontsize=10.5)
    figure.text(0.02, 1 - 0.92 / height, "\n".join(doubts(run)), va="top", fontsize=9, color=style.TOW)
    notes = "assumed parameters: see case.resolved.yml"
    if run.window:
        notes = f"shaded: {run.window_name} {style.times_text(*run.window)}; " + notes
    figure.text(0.975, 0.02, notes, ha="right", va="bottom", fontsize=8.5, color=style.FAINT)
    return figure


def draw_diagnostics(run):
    """Plot the solver's diagnostics in every sample: contacts, sweeps, residual, overlap, other registered series."""
    rows = [(name, run.label(name), style.PANELS[k % len(style.PANELS)])
            for k, name in enumerate(run.by_role("diagnostic"))]
    if not rows:
        raise RunError(run.result, "holds no series of the solver", "run the case again with this version")
    figure, all_axes = style.subplots(len(rows), 1, sharex=True, squeeze=False, figsize=(11, 1.1 + 1.75 * len(rows)))
    height = figure.get_size_inches()[1]
    figure.subplots_adjust(left=0.1, right=0.975, top=1 - 0.95 / height, bottom=0.62 / height, hspace=0.18)
    for axes, (name, label, colour) in zip(all_axes[:, 0], rows):
        values, unit = run[name], run.units(name)
        axes.plot(run["time"], values, color=colour, linewidth=0.6, rasterized=len(values) > style.MANY)
        axes.set_ylabel(label + (f" ({unit})" if unit not in ("", "1") else ""))
        axes.yaxis.set_major_locator(MaxNLocator(4))
        positive = values[values > 0]
        # for residual and overlap, decades matter
        if run.attribute(name, "merge") == "largest of the steps" and len(positive):
            style.logarithmic(axes.yaxis)
            axes.set_ylim(bottom=max(positive.min(), 1e-6 * positive.max()) / 1.5)
        elif not np.any(values < 0):
            axes.set_ylim(bottom=0)
        tolerance = run.number("tolerance_m_s")
        if name == "residual" and np.isfinite(tolerance):
            axes.axhline(tolerance, color=style.REFERENCE, linewidth=1.1, dashes=(5, 3))
            axes.annotate("tolerance", (1, tolerance), xycoords=("axes fraction", "data"), ha="right", va="bottom",
                          fontsize=9, bbox=dict(facecolor=style.PAPER, edgecolor="none", alpha=0.85, pad=1))
        axes.grid(axis="y")
        axes.set_xlim(min(0.0, run["time"][0]), run["time"][-1])
    figure.align_ylabels(all_axes[:, 0])
    all_axes[-1, 0].set_xlabel("time (s)")
    style.headline(figure, run, "contact solver")
    missed = run.number("unconverged_steps", None)
    if missed is not None:
        figure.text(0.975, 1 - 0.42 / height, f"{missed:.0f} of {run.number('n_steps'):.0f} steps not converged",
                    ha="right", va="top", color=style.FAINT)
    return figure


def options(p):
    arguments.add_run(p, "force.png")
    p.add_argument("--diagnostics", action="store_true",
                   help="also draw contacts, sweeps, residual and overlap, in a second file (NAME-diagnostics)")
    p.add_argument("--max", metavar="N", type=arguments.above_zero, help="upper end of the force axes, N")


@style.look()
def perform(a):
    path = arguments.output(a, "force.png", writing.PICTURES)
    second = path.with_name(f"{path.stem}-diagnostics{path.suffix}")
    if a.diagnostics:
        writing.may_write(second, a.force)
    with Run(a.run) as run:
        writing.save(draw(run, a.max), path, a.force)
        if a.diagnostics:
            writing.save(draw_diagnostics(run), second, a.force)
