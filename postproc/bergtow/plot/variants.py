# SPDX-License-Identifier: MIT
"""The effect of each assumption on the mean: variants of a study compared with the first one, as a tornado chart.

    variants.png      one panel for each combination of the other varied values; one bar per variant shows the
                      change of the mean in per cent of that of the first variant, or as a force if that is zero, with
                      its 95 % interval (t). Fields that two variants share (fields: common) are compared in pairs,
                      other means by Welch's t. At the right: the means themselves
"""
import numpy as np
import scipy

from bergtow.plot import style
from bergtow.result.members import worded
from bergtow.stats import mean as stat_mean

KEY = "variant"


def change_of(means, base, paired, relative):
    """Difference of the mean from that of `base`, and the half width of its 95 % interval, which is NaN if either has
    fewer than two fields. relative: in per cent of the magnitude of the mean of `base`. means, base: {repeat: mean of
    that field}."""
    both = sorted(set(means) & set(base))
    paired = paired and len(both) > 1
    of, to = (np.array([x[k] for k in (both if paired else x)]) for x in (means, base))
    # d(a/b) to first order: each field's contribution to the ratio of the means.
    ratio, unit = (of.mean() / to.mean(), abs(to.mean()) / 100) if relative else (1.0, 1.0)
    change = (of.mean() - to.mean()) / unit
    if min(len(of), len(to)) < 2:
        return change, np.nan
    if paired:
        low, high = stat_mean.t_interval((of - ratio * to) / unit)
        return change, (high - low) / 2
    a, b = (k ** 2 * x.var(ddof=1) / len(x) / unit ** 2 for k, x in ((1.0, of), (ratio, to)))
    freedom = stat_mean.welch_freedom([a, b], [len(of), len(to)]) if a + b > 0 else 1
    return change, scipy.stats.t.ppf(0.5 + stat_mean.LEVEL / 2, freedom) * np.sqrt(a + b)


def in_per_cent(some):
    """Are changes relative to the first variant? Not if its mean is zero in a panel of panels()."""
    return all(base != 0 for _, _, base, _ in some)


def panels(e):
    """[(words for the other values, name of the first variant, its mean, [(variant, mean, change, half width)])]."""
    order = list(dict.fromkeys(e.parameters[KEY].tolist()))
    found = {}
    for c in e.conditions():
        others = tuple((k, v) for k, v in c.values.items() if k != KEY)
        found.setdefault(others, {})[c.values[KEY]] = c.finished
    out, first = [], order[0]
    for others, some in found.items():
        of = {name: dict(zip(e.repeat[rows].tolist(), e.mean[rows])) for name, rows in some.items() if len(rows)}
        if first not in of or len(of) < 2:
            continue
        seeds = {name: set(e.seed[some[name]].tolist()) for name in of}
        pairs = [(name, of[name], of[first], bool(seeds[name] & seeds[first])) for name in order[1:] if name in of]
        words = ", ".join(worded(k, v, e.units[k], 3) for k, v in others)
        out.append((words, first, np.mean(list(of[first].values())), pairs))
    relative = in_per_cent(out)
    return [(words, first, base, [(name, np.mean(list(means.values())), *change_of(means, to, paired, relative))
                                  for name, means, to, paired in pairs]) for words, first, base, pairs in out]


def draw(e, headline):
    """The figure, or None if the study has no variants with a first one to compare with."""
    some = panels(e) if KEY in e.parameters else []
    if not some:
        return None
    names = list(dict.fromkeys(name for *_, changes in some for name, *_ in changes))
    # Longest bar on top, by the largest change in any panel.
    reach = {n: max((abs(c) for *_, changes in some for m, _, c, _ in changes if m == n and np.isfinite(c)), default=0)
             for n in names}
    names.sort(key=lambda n: reach[n])
    figure, grid = style.subplots(1, len(some), figsize=(2.0 + 3.6 * len(some), 2.3 + 0.36 * len(names)), sharey=True,
                                squeeze=False)
    width, height = figure.get_size_inches()
    figure.subplots_adjust(left=1.8 / width, right=0.98, top=1 - 1.25 / height, bottom=0.75 / height, wspace=0.08)
    factor, unit = style.scale([m for *_, changes in some for _, m, *_ in changes], "N")
    per, of = (1.0, "%") if in_per_cent(some) else (factor, unit)
    for axes, (words, first, base, changes) in zip(grid[0], some):
        changes = [(name, mean, change / per, half / per) for name, mean, change, half in changes]
        widest = max((abs(c) + (h if np.isfinite(h) else 0) for *_, c, h in changes if np.isfinite(c)), default=1) or 1
        for name, mean, change, half in changes:
            y = names.index(name)
            axes.barh(y, change, height=0.6, color=style.DRAG if change < 0 else style.TOW)
            if np.isfinite(half):
                axes.plot([change - half, change + half], [y, y], color=style.INK, linewidth=1.2)
            axes.annotate(style.short(mean / factor), (1.0, y), xycoords=("axes fraction", "data"), xytext=(-4, 0),
                          textcoords="offset points", ha="right", va="center", fontsize=8.5, color=style.FAINT)
        axes.axvline(0, color=style.INK, linewidth=0.8)
        axes.set_xlim(-1.15 * widest, 1.5 * widest)
        axes.set_title(f"{words or 'the case'}\n{first}: {style.short(base / factor)} {unit}", fontsize=10)
        axes.grid(True, axis="x")
    grid[0, 0].set_yticks(np.arange(len(names)), names)
    figure.supxlabel(f"change of the mean ice resistance, {of}", fontsize=10, y=0.26 / height)
    figure.text(0.3 / width, 0.08 / height, f"black: 95 %, from two fields on; at the right: the mean, {unit}",
                fontsize=9, color=style.FAINT)
    headline(figure, e, f"what each assumption does to the mean, against \"{some[0][1]}\"")
    return figure
