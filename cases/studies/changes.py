# SPDX-License-Identifier: MIT
"""What a change of its base case does to each condition of a study, field by field.

    changes.py BASE OTHER [OTHER ...] [-o changes.png]

Each is the folder of an ensemble, as "NAME=FOLDER" or a folder that lends its name; the others are the same study with
keys replaced (`bergtow ensemble STUDY -s KEY=VALUE -o FOLDER`), so that their fields are those of the first. Printed as
tables: mean ± standard error over the fields; change of the mean with its 95 % interval, of the ratio of the means
field by field; the largest mean over a step in any field; and how sound the runs were. Members that have not finished,
or have no mean, are left out, and counted.
"""
import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "postproc"))

from bergtow import arguments, writing  # noqa: E402
from bergtow.cli import command  # noqa: E402
from bergtow.plot import style  # noqa: E402
from bergtow import table as text_table  # noqa: E402
from bergtow.errors import RunError  # noqa: E402
from bergtow.result.members import Members, reading, short_key, worded  # noqa: E402
from bergtow.plot.variants import change_of  # noqa: E402
from bergtow.stats.mean import t_interval  # noqa: E402
from bergtow.table import number  # noqa: E402


LINES = ((style.INK, "-"), (style.ICE, "-"), (style.ICE, "--"), (style.TOW, "-"), (style.TOW, "--"), (style.DRAG, "-"),
         (style.INERTIA, "-"), (style.CORIOLIS, "-"))


def named(text):
    """(name, ensemble) of NAME=FOLDER or FOLDER."""
    name, given, folder = text.rpartition("=")
    return (name if given else Path(folder).name), Members(folder)


def fields(e, c):
    """{repeat: mean of that field, N}."""
    return dict(zip(e.repeat[c.finished].tolist(), e.mean[c.finished]))


def must_match(base, e):
    """Refuse another study, or the same with other fields."""
    if [c.values for c in base.conditions()] != [c.values for c in e.conditions()]:
        raise RunError(e.path, "has other conditions than the first", "give the same study with keys replaced")
    pairs = zip(base.conditions(), e.conditions())
    seeds = [[dict(zip(x.repeat[c.members].tolist(), x.seed[c.members].tolist())) for x, c in zip((base, e), pair)]
             for pair in pairs]
    if any(a.get(r, s) != s for a, b in seeds for r, s in b.items()):
        raise RunError(e.path, "has other fields than the first", "make it of the same study file, with the same seed")


def mean_and_errors(means):
    """Mean, its standard error, half width of its 95 % interval."""
    x = np.array(list(means.values()))
    if len(x) < 2:
        return (x.mean() if len(x) else np.nan), np.nan, np.nan
    low, high = t_interval(x)
    return x.mean(), x.std(ddof=1) / np.sqrt(len(x)), (high - low) / 2


def rows(base, e):
    """Of each condition: mean and its standard error, N; change of the mean and half width of its interval, %; half
    width of the interval of the mean, N."""
    out = []
    for b, c in zip(base.conditions(), e.conditions()):
        means, to = fields(e, c), fields(base, b)
        mean, error, half = mean_and_errors(means)
        change = change_of(means, to, True, True) if len(means.keys() & to.keys()) > 1 else (np.nan, np.nan)
        out.append((mean, error, *change, half))
    return np.array(out)


def varied(e):
    """Keys with more than one value, in the order of the study."""
    values = [c.values for c in e.conditions()]
    return [key for key in values[0] if len({v[key] for v in values}) > 1] or list(values[0])


def label(e, c):
    return ", ".join(worded(key, c.values[key], c.units[key]) for key in varied(e)) or c.label


def report(studies, of):
    """of: rows() of each study."""
    base = studies[0][1]
    factor, unit = text_table.scale([m for r in of for m in r[:, 0]], "N")
    names, labels = [name for name, _ in studies], [label(base, c) for c in base.conditions()]

    def show(heading, names, cells):
        """cells: of each study those of its conditions."""
        lines = [[words, *(some[k] for some in cells)] for k, words in enumerate(labels)]
        print(f"{heading}\n\n{text_table.table(['condition', *names], lines, True)}\n")

    show(f"mean ± standard error over the fields, {unit}", names,
         [[f"{number(m / factor)} ± {number(error / factor, 2)}" for m, error in r[:, :2]] for r in of])
    show("change of the mean, % (95 %)", names[1:],
         [[f"{c:+.0f} ({c - h:+.0f} to {c + h:+.0f})" if np.isfinite(c) else "–" for c, h in r[:, 2:4]]
          for r in of[1:]])
    show(f"largest mean over a step in any field, {unit}", names,
         [[number(max(e.summary["peak_ice_resistance_n"][c.finished], default=np.nan) / factor) for c in e.conditions()]
          for _, e in studies])
    for name, e in studies:
        print(f"{name}: {soundness_of(e)}")


def soundness_of(e):
    used = np.concatenate([c.finished for c in e.conditions()])
    if not len(used):
        return "no field has finished"
    missed, steps = (np.nansum(e.summary[key][used]) for key in ("unconverged_steps", "n_steps"))
    return (f"{len(used)} of {e.n} fields, {missed:.0f} of {steps:.0f} steps not converged, overlap at most "
            f"{100 * np.nanmax(e.summary['max_overlap_relative'][used]):.1f} % of a floe, but for rafting")


def places(base):
    """(x [conditions], order along it, name of the axis, texts or None): the number that was varied, or a place for
    each condition where it is no number, or several were."""
    keys, conditions = varied(base), base.conditions()
    if len(keys) == 1 and not isinstance(conditions[0].values[keys[0]], str):
        scale, unit = reading(keys[0], base.units[keys[0]])
        x = scale * np.array([c.values[keys[0]] for c in conditions])
        return x, np.argsort(x), f"{short_key(keys[0])}, {unit}".rstrip(", "), None
    x = np.arange(len(conditions), dtype=float)
    return x, np.arange(len(x)), "", [label(base, c) for c in conditions]


def draw(studies, of):
    """Means and their changes over what was varied; of: rows() of each study."""
    base = studies[0][1]
    x, order, axis, texts = places(base)
    figure, (above, below) = style.subplots(2, 1, figsize=(8.4, 8.2), sharex=True, height_ratios=(3, 2))
    figure.subplots_adjust(left=0.11, right=0.97, top=0.9, bottom=0.08, hspace=0.08)
    factor, unit = text_table.scale(np.concatenate([r[:, 0] for r in of]), "N")
    shift = 0.004 * max(np.ptp(x), 1.0) * (np.arange(len(studies)) - (len(studies) - 1) / 2)
    for (name, _), r, (colour, dashes), dx in zip(studies, of, LINES, shift):
        look = {"color": colour, "linestyle": "" if texts else dashes, "marker": "o", "markersize": 3.5,
                "linewidth": 1.4, "capsize": 2}
        r = np.where(np.isfinite(r[order, 1:2]), r[order], np.nan)  # one field has no interval
        above.errorbar(x[order] + dx, r[:, 0] / factor, r[:, 4] / factor, label=name, **look)
        if name != studies[0][0]:
            below.errorbar(x[order] + dx, r[:, 2], r[:, 3], **look)
    above.set_yscale("log")
    style.logarithmic(above.yaxis)
    above.set_ylabel(f"mean ice resistance, {unit}")
    above.legend(frameon=False, fontsize=9)
    below.axhline(0, color=style.INK, linewidth=0.8)
    below.set(ylabel="change of the mean, %", xlabel=axis)
    if texts:
        below.set_xticks(x, texts, rotation=30, ha="right", fontsize=8)
        figure.subplots_adjust(bottom=0.22)
    style.head(figure, base.title, f"the same fields; changes against \"{studies[0][0]}\"; bars: 95 %")
    return figure


@style.look()
def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("base", metavar="BASE")
    p.add_argument("others", metavar="OTHER", nargs="+")
    p.add_argument("-o", "--output", metavar="FILE", type=Path, default=Path("changes.png"))
    arguments.add_force(p)
    a = p.parse_args()
    arguments.ends_in(a.output, writing.PICTURES)
    writing.may_write(a.output, a.force)
    studies = [named(text) for text in (a.base, *a.others)]
    if len(studies) > len(LINES):
        p.error(f"at most {len(LINES)} studies")
    for _, e in studies[1:]:
        must_match(studies[0][1], e)
    of = [rows(studies[0][1], e) for _, e in studies]
    report(studies, of)
    writing.save(draw(studies, of), a.output, a.force)


if __name__ == "__main__":
    command.guarded(Path(__file__).name, main)
