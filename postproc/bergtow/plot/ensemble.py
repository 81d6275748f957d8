# SPDX-License-Identifier: MIT
"""The pictures of an ensemble that its study allows.

    sweep-KEY.png     mean ice resistance against a varied number, one panel for each combination of the
                      others: every field, mean with 95 %, median, doubts; the estimates against concentration, the
                      law V^2 against speed. A Latin hypercube: one panel, every member (plot/sweep.py)
    returns-LOAD.png  return level of each load against return time, one line per condition, with the fitted tail and
                      the design value
    exceedance.png    rate at which collision peaks are exceeded, one line per condition, with the fitted tail
    map.png           mean and its relative uncertainty over two numbers of a grid
    variants.png      change in the mean from the first variant to each of the others (plot/variants.py)
    sensitivity.png   Sobol indices and partial rank correlations
"""
import argparse
import sys
import textwrap
from pathlib import Path

from bergtow import arguments, writing
from bergtow.errors import RunError
from bergtow.plot import style
from bergtow.plot import variants as plot_variants
from bergtow.plot.axes import axis_label, headline, numeric, wants_log
from bergtow.plot.loads import MAX_LINES, draw_above, draw_exceedance, draw_returns
from bergtow.plot.sweep import draw_scatter, draw_sweep
from bergtow.result.members import Members, reading, short_key
from bergtow.said import say
from bergtow.stats import loads
from bergtow.stats import mean as stat_mean
from bergtow.stats.conditions import DEFAULTS, member, nothing_to_count, sensitivity

import numpy as np
from matplotlib.colors import LogNorm


def draw_map(e, first, second):
    """Figure of two heat maps over two parameters of a grid: the mean in each cell, averaged over the conditions that
    differ in the other parameters, and half the 95 % interval divided by it."""
    conditions = [c for c in e.conditions() if len(c.finished)]
    xs, ys = (sorted({c.values[k] for c in conditions}) for k in (first, second))
    mean, width, least = (np.full((len(ys), len(xs)), np.nan) for _ in range(3))
    most = 1
    for i, v in enumerate(ys):
        for j, u in enumerate(xs):
            cell = [c for c in conditions if c.values[first] == u and c.values[second] == v]
            least[i, j] = any(e.without_bound(c.members) for c in cell)
            if cell:
                mean[i, j], low, high = stat_mean.mean_of_conditions(
                    [dict(zip(e.seed[c.finished].tolist(), e.mean[c.finished])) for c in cell])
                width[i, j] = (high - low) / 2 / abs(mean[i, j]) if mean[i, j] and not least[i, j] else np.nan
                most = max(most, len(cell))
    factor, unit = style.scale([np.nanmedian(mean)], "N")
    figure, axes = style.subplots(1, 2, figsize=(12, 2.6 + 0.62 * len(ys)))
    height = figure.get_size_inches()[1]
    figure.subplots_adjust(left=0.08, right=0.98, top=1 - 1.15 / height, bottom=0.75 / height, wspace=0.2)
    log = wants_log(mean / factor)
    for ax, values, label, texts, colours in (
            (axes[0], mean / factor, f"mean ice resistance ({unit})", style.short, style.SPEED_MAP),
            (axes[1], 100 * width, "half the 95 % interval of the mean (%)", "{:.0f} %".format, style.FORCE_MAP)):
        norm = LogNorm() if log and ax is axes[0] else None
        image = ax.pcolormesh(values, cmap=colours, norm=norm, edgecolor=style.PAPER, linewidth=0.6)
        for (i, j), v in np.ndenumerate(values):
            shade = image.norm(v) if np.isfinite(v) else 0
            ax.text(j + 0.5, i + 0.5,
                    ("at least\n" if ax is axes[0] and least[i, j] else "") + texts(v) if np.isfinite(v) else "–",
                    ha="center", va="center", fontsize=9.5, color=style.ON_DARK if shade > 0.5 else style.ON_LIGHT)
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
    for k, name in enumerate(names):
        for what, shift, colour, label in (("first", 0.17, style.ICE, "first order"),
                                           ("total", -0.17, style.TOW, "total")) if name in indices else ():
            axes.barh(k + shift, indices[name][what], height=0.3, color=colour, label=label if k == 0 else None)
            axes.plot(indices[name][f"{what}_95"], [k + shift] * 2, color=style.INK, linewidth=1.2)
    axes.set(xlabel="share of the explained variance", xlim=(0, 1.02))
    axes.legend(loc="lower right")


def draw_sensitivity(e, x):
    """Figure of Sobol indices, of the mean and also of its logarithm if given, beside partial rank correlations; None
    if there are neither."""
    ranks = x.get("ranks", {})
    kinds = [(words, x.get(key, {})) for words, key in (("mean", "sobol"), ("logarithm", "sobol_of_logarithm"))]
    given = [(words, s) for words, s in kinds if "indices" in s]
    names = sorted(set(ranks).union(*(s["indices"] for _, s in given)), key=lambda k: (
        max([s["indices"][k]["total"] for _, s in given if k in s["indices"]], default=0),
        abs(ranks.get(k, {}).get("prcc", 0))))
    if not names:
        return None
    n = len(given) + 1
    figure, grid = style.subplots(1, n, figsize=(3.2 + 4.2 * n, 2.2 + 0.6 * len(names)), sharey=True, squeeze=False)
    notes = ["black: 95 %", *(f"no Sobol indices of the {words}: {s['refused']}" for words, s in kinds
                              if "refused" in s)]
    width, height = figure.get_size_inches()
    lines = [line for note in notes for line in textwrap.wrap(note, int(13.5 * width))]  # letters of 9 points
    height += 0.17 * (len(lines) - 1)
    figure.set_size_inches(width, height)
    figure.subplots_adjust(left=1.7 / width, right=1 - 0.25 / width, top=1 - 1.15 / height,
                           bottom=(0.68 + 0.17 * len(lines)) / height, wspace=0.1)
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
    figure.text(0.3 / width, 0.08 / height, "\n".join(lines), fontsize=9, color=style.FAINT)
    headline(figure, e, "what the resistance depends on")
    return figure


def pictures(e, options, conditions):
    """(name, function that draws it) of the pictures that the study allows. conditions: with "label" and "loads", and
    "extremes" if known, in the layout of bergtow statistics."""
    keys = numeric(e)
    names = dict.fromkeys(name for c in conditions for name, x in c["loads"].items()
                          if "refused" not in x["over_threshold"])
    out = [(f"returns-{name.replace('_', '-')}", lambda name=name: draw_returns(e, conditions, name)) for name in names]
    out += [(f"above-{name.replace('_', '-')}", lambda name=name: draw_above(e, conditions, name))
            for name in dict.fromkeys(name for c in conditions for name, x in c["loads"].items() if x["exceedance"])
            if name != "ice_resistance" and name not in loads.LOCAL]
    out += [(f"sweep-{key.replace('.', '-')}", lambda key=key: (draw_scatter if e.sampled else draw_sweep)(e, key))
           for key in keys]
    if not e.sampled and len(keys) >= 2:
        out.append(("map", lambda: draw_map(e, keys[0], keys[1])))
    if len(keys) >= 2:
        out.append(("sensitivity", lambda: draw_sensitivity(e, sensitivity(e, {int(m): member(e, m) for m in e.used}))))
    if plot_variants.KEY in e.parameters and not e.sampled:
        out.append(("variants", lambda: plot_variants.draw(e, headline)))
    if not e.sampled or len(e.conditions()) <= MAX_LINES:
        tails = {c["index"]: c["extremes"].get("over_threshold") for c in conditions if "extremes" in c}
        out.append(("exceedance", lambda: draw_exceedance(e, options, tails)))
    return out


def options(p):
    p.add_argument("folder", metavar="DIR", help="folder of `bergtow ensemble`")
    p.add_argument("-o", "--output", metavar="FOLDER", type=Path, help="folder for the pictures (default: DIR)")
    p.add_argument("--format", choices=[s[1:] for s in writing.PICTURES], default="png",
                   help="file format (default png)")
    loads.add_options(p)
    arguments.add_force(p)


@style.look()
def perform(a):
    a = argparse.Namespace(**DEFAULTS | vars(a) | {"resamples": 1})
    e = Members(a.folder)
    dropped = e.exclude(a.exclude) if a.exclude else {}
    for name, kinds in dropped.items():
        say(f"left out: {name} ({', '.join(kinds)})")
    if not len(e.used):
        raise nothing_to_count(e, dropped)
    if e.holes():
        print(f"bergtow plot-ensemble: warning: {e.holes()}", file=sys.stderr)
    drawn = pictures(e, a, [{"label": c.label, "loads": loads.statistics(e, c.finished, a)} for c in e.conditions()])
    if not drawn:
        raise RunError(e.file, "varies no parameter that can be drawn", "read the tables of bergtow statistics")
    places = {name: (a.output or e.path) / f"{name}.{a.format}" for name, _ in drawn}
    for path in places.values():
        writing.may_write(path, a.force)
    for name, draw in drawn:
        figure = draw()
        if figure is not None:
            writing.save(figure, places[name], a.force)
