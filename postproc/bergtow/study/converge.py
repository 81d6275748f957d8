# SPDX-License-Identifier: MIT
"""Does a result depend on numerical settings: the width and length of the domain, the time step, the tolerance, the
window, the start, the number of fields?

    bergtow converge CASE.yml -o DIR --budget 10        DIR/converge.json, the ensembles DIR/converge/NAME,
                                                        one verdict per line

One value is changed at a time, and the case is run with and without the change on the same seeds, so that both are
compared on the same ice. For a width or length the field of the smaller domain is that of the larger one, cut to size
(ice.extent): they share all floes except those of a strip. The table shows the gain: the error of the effect / the
error with separate fields, from the scatter of each. The effect is the relative change of a mean over fields; its
interval is the jackknife over pairs (stats/load.py). Two checks need no extra runs: the second half of the window
against the whole, and the largest tow force of the start-up against the largest in the window, which it should not
exceed; if it does, the ramp is lengthened. Fields are added, in LOOKS looks, until

    the interval lies within +- margin             resolved: no effect that matters
    it lies entirely outside                       resolved: it matters, and the next value is compared with this one
    neither, and the budget is spent               not resolved

Repeated looks find an effect sooner or later [Armitage, McPherson & Rowe 1969, J. R. Stat. Soc. A 132]: each look is
therefore made at a level of 1 - 0.05/LOOKS, so that all together have 95 %. Rejected: a fixed number of fields, which
is too small where floes jam and too large where nothing happens; a last look at 64, which left a paired effect of 6 %
with an error of 2 % open while most of the budget was still there.

The intervals do not hold for an effect that few fields feel, such as a jam: n nearly equal pairs have a narrow interval
wherever the mean of all fields is. "No effect" therefore comes with the least share of fields without one that n such
fields show at 95 % (stats/largest.py): 47 % from 4 fields, 91 % from 32. Rejected: no verdict from fewer than
29 fields, which would show an effect in a tenth of them, because few budgets allow that many.

A tow that starts at full speed (tow.ramp of 0) is compared with a ramp during which the body moves by its size.
"""
import argparse
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from bergtow._program import program_path
from bergtow.arguments import above_zero, whole_from
from bergtow.errors import SIGNAL, USAGE, RunError
from bergtow.result.origins import BESIDE, annotated, source_of_ice
from bergtow.result.run import Run, within
from bergtow.stats import largest as stat_largest
from bergtow.stats import load as stat_load
from bergtow.stats import mean as stat_mean
from bergtow.study import analysis
from bergtow.study.runs import SPENT, CaseRuns, checked, locked

import numpy as np

FIELDS = (4, 8, 16, 32, 64, 128, 256)  # number at each look
LOOKS = len(FIELDS)
TRIES = 3                   # successive values of a quantity, at most
MARGIN = 0.1
UNSOLVED = 0.01             # share of unconverged steps above which a comparison is not judged
BUDGET = 10.0               # min
WINDOW_TOO_EARLY = "no longer ramp ends before the window: tow for longer, with a later window"
EFFORT = 0.05               # relative error of the mean that the number of fields has to reach
WINDOW = "window", "output.window_start"  # name and key of its row
RAMP = 4.0                  # factor by which the ramp is lengthened
LATEST = 0.8                # relative to the start of the window: where a ramp must end at the latest


# ---- varied quantities


def times(key, factor):
    """Function that returns the k-th next value of a key as {key: value}."""
    return lambda run, k: {key: run.value(key) * factor ** k}


def slower_start(run, k):
    """Lengthen the ramp by RAMP each time; without a ramp, start with the time that the body takes to move by its size.
    It ends well before the window."""
    first = run.value("tow.ramp")
    own = np.ptp(run.bodies[run.towed].vertices, axis=0).max() / run.value("tow.speed")
    ramp = first * RAMP ** k if first > 0 else own * RAMP ** (k - 1)
    return {"tow.ramp": max(first, min(ramp, LATEST * run.window[0])) if run.window else ramp}


def ice_to(run, moved):
    """Move ends of the ice region that the case places at the ends of the domain: {key: value}. If they stayed, a
    larger domain would add open water beside the same pack, not wider or longer ice. A region that ends inside the
    domain has its own extent and is not moved. moved: {key of such an end: (current end of the domain, its new end)}.
    """
    said = annotated(run.case_text)
    return {key: to for key, (end, to) in moved.items() if {key, f"{BESIDE}{key}"} & set(said)
            and np.isclose(run.value(key), end, rtol=0, atol=1e-9 * run.value("domain.length"))}


def longer(run, k):
    """Add half the length ahead of the body for each try; the end behind it stays in place. Raises RunError for a tow
    that is not along the domain."""
    length, ahead, along = run.value("domain.length"), run.value("domain.ahead"), run.headings[:, 0]
    if np.abs(along).min() < np.sqrt(0.5) or np.ptp(np.sign(along)):
        raise RunError(run.path, "the tow does not run along the domain, so its length is not ahead of the body",
                       "take the width, or leave the length out of --vary", USAGE)
    more, x0 = length * (1.5 ** k - 1), run.value("domain.x0")
    out = {"domain.length": length + more, "domain.x0": x0 - (more if along[0] < 0 else 0.0),
           "body.x": run.value("body.x")}
    if run.case.get("domain.ends") == "moving" and np.isfinite(ahead):
        out["domain.ahead"] = ahead + more
    return out | ice_to(run, {"ice.x_min": (x0, x0 - more)} if along[0] < 0 else
                        {"ice.x_max": (x0 + length, x0 + length + more)})


def wider(run, k):
    before, y0 = run.value("domain.width"), run.value("domain.y0")
    width, centre = before * 2.0 ** k, y0 + before / 2
    return {"domain.width": width, "domain.y0": centre - width / 2} | ice_to(
        run, {"ice.y_min": (y0, centre - width / 2), "ice.y_max": (y0 + before, centre + width / 2)})


def cut_from(run, larger):
    """Keys that cut the field of a domain from that of a larger domain with these values: the ends of the ice region
    that move. {} if the ice is not generated.

    The smaller domain must be run again for this, because its own field is different, as would be one cut from a still
    larger domain. Rejected: the largest domain of all tries as the extent of each, eight times the ice of the case to
    be generated for a comparison that mostly ends with the first try."""
    if source_of_ice(run.case) or not run.value("ice.concentration") > 0:
        return {}
    out = {}
    for axis, size in (("x", "length"), ("y", "width")):
        x0, extent = run.value(f"domain.{axis}0"), run.value(f"domain.{size}")
        low = larger.get(f"domain.{axis}0", x0)
        high = low + larger.get(f"domain.{size}", extent)
        for end, now, then in (("min", x0, low), ("max", x0 + extent, high)):
            key = f"ice.{axis}_{end}"
            if now != then and np.isclose(run.value(key), now, rtol=0, atol=1e-9 * extent):
                out[f"ice.extent.{axis}_{end}"] = larger.get(key, then)
    return out


def mean_resistance(run):
    """Mean ice resistance, N. NaN if the tow ends within the window, since the rest of the window is not a tow, or if
    steps in it have no solution: two lower bounds cannot be compared."""
    towed = run.window and run.adrift >= run.window[1] and not run.at_least
    return run.number("mean_ice_resistance_n") if towed else np.nan


@dataclass(frozen=True)
class Kind:
    """A varied quantity: its key, its values at try k, and the measure that compares runs."""

    name: str
    key: str
    values: object        #: (run of the case, k) -> {key: value}
    measure: object
    what: str
    same_ice: bool
    finer: str            #: comparative describing the next value, such as "wider"
    own: object = None    #: measure of the same runs to compare with, instead of runs with the next value


KINDS = (
    Kind("start", "tow.ramp", slower_start, lambda run: run.number("start_peak_tow_force_n"),
         "start-up's largest tow force over the window's", True, "longer",
         lambda run: run.number("peak_tow_force_n")),
    Kind("width", "domain.width", wider, mean_resistance, "mean ice resistance", False, "wider"),
    Kind("length", "domain.length", longer, mean_resistance, "mean ice resistance", False, "longer"),
    Kind("dt", "run.dt", times("run.dt", 0.5), mean_resistance, "mean ice resistance", True, "shorter"),
    Kind("tolerance", "solver.tolerance", times("solver.tolerance", 0.1), mean_resistance, "mean ice resistance", True,
         "tighter"),
)
NAMES = tuple(k.name for k in KINDS) + ("window", "fields")


# ---- effects


def effect(base, other, looks=LOOKS):
    """(mean(other)/mean(base) - 1, (low, high)) from pairs, at the level of one of this many looks; on the logarithm of
    the ratio if that is defined."""
    value, without = other.mean() / base.mean(), (other.sum() - other) / (base.sum() - base)
    low, high = stat_load.jackknife(value, without, scale=stat_load.LOG, level=1 - 0.05 / looks)
    return float(value) - 1, (low - 1, high - 1)


def pairing(base, other):
    """Error of the effect / its error from two independent samples with this scatter; None if that is 0 or NaN."""
    a, b = base / base.mean(), other / other.mean()
    alone = np.var(a, ddof=1) + np.var(b, ddof=1)
    return float(np.sqrt(np.var(b - a, ddof=1) / alone)) if np.isfinite(alone) and alone > 0 else None


def judged(interval, margin, one_sided=False):
    """"none", "matters" or "open". one_sided: only effects above zero matter."""
    low, high = interval
    least = -np.inf if one_sided else -margin
    if least <= low and high <= margin:
        return "none"
    return "matters" if low > margin or high < least else "open"


def unsolved(study, name, n):
    """Share of the steps of n runs that did not reach the tolerance, so that results do not depend on it."""
    missed, steps = (study.measured(name, range(n), lambda run, key=key: run.number(key)).sum()
                     for key in ("unconverged_steps", "n_steps"))
    return missed / steps if steps > 0 else 0.0


def compare(study, kind, base_name, base_values, name, values, margin):
    """The row that compares one value with the next, with as many fields as needed."""
    row = {"quantity": kind.what, "effect": np.nan, "interval_95": (np.nan, np.nan), "fields": 0, "judged": "open",
           "same_ice": kind.same_ice or any(key.startswith("ice.extent.") for key in base_values)}
    for n in FIELDS:
        if not (study.there(base_name, n, base_values) and (kind.own or study.there(name, n, values))):
            return row | {"why": SPENT.text, "code": SPENT.code}
        base = study.measured(base_name, range(n), kind.own or kind.measure)
        other = study.measured(base_name if kind.own else name, range(n), kind.measure)
        if not (np.isfinite(base).all() and np.isfinite(other).all()):
            return row | {"why": f"a run has no {kind.what}"}
        if n > len(base):
            return row | {"fields": len(base), "why": "there is one run, for no seed changes it"}
        if (missed := max(unsolved(study, m, n) for m in {base_name, base_name if kind.own else name})) > UNSOLVED:
            return row | {"fields": n, "why": f"{100 * missed:.2g} % of the steps ended at solver.max_sweeps, short of "
                          "the tolerance; raise it"}
        if base.mean() == 0 or base.max() == base.sum():  # no mean to compare with, or none without one of the fields
            return row | {"fields": n, "why": f"nothing to hold the {kind.what} against",
                          "judged": "matters" if kind.own and other.min() > 0 else "open"}
        row["effect"], row["interval_95"] = effect(base, other)
        row["pairing"] = None if kind.own else pairing(base, other)
        row["fields"], row["judged"] = n, judged(row["interval_95"], margin, bool(kind.own))
        if row["judged"] != "open":
            return row
    return row | {"why": f"{FIELDS[-1]} fields scatter too much"}


def not_judged(name, key, why, **more):
    """The rows of a quantity that could not be compared."""
    return [{"name": name, "key": key, "judged": "open", **more, "why": why}]


def vary(study, kind, margin, most=TRIES):
    """Rows of a quantity, from the case's value on until the next one has no effect."""
    with Run(study.path("case", 0)) as run:
        tries = [{}] + [kind.values(run, k + 1) for k in range(most)]
        first, unit = run.value(kind.key), run.case.get(kind.key, "").partition(" ")[2]
        walls = kind.name == "width" and run.case.get("domain.sides") == "wall"
        programme = run.case.get("tow.programme", "none") != "none"
        extents = [{} if kind.same_ice else cut_from(run, larger) for larger in tries[1:]]
    if kind.name == "start" and programme:  # the programme replaces the ramp
        return not_judged(kind.name, kind.key, "the start is that of tow.programme; make its first rows slower by hand")
    if not np.isfinite(first) or (first <= 0 and kind.name != "start"):
        return not_judged(kind.name, kind.key, f"the case has no {kind.key}")
    names, rows = ["case"] + [f"{kind.name}-{k + 1}" for k in range(most)], []
    for k in range(most):
        a, b = (tries[j].get(kind.key, first) for j in (k, k + 1))
        row = {"name": kind.name, "key": kind.key, "unit": unit, "from": a, "to": b, "finer": kind.finer,
               "walls": walls}
        base = f"{kind.name}-{k}-cut" if extents[k] else names[k]
        rows.append(row | compare(study, kind, base, tries[k] | extents[k], names[k + 1], tries[k + 1] | extents[k],
                                  margin))
        found = rows[-1]["judged"]
        rows[-1]["recommended"] = a if found == "none" else b if found == "matters" else None
        if found == "matters" and b == a:
            rows[-1] |= {"recommended": None, "why": WINDOW_TOO_EARLY}
        if found != "matters" or b == a:
            break
    return rows


def window(study, margin):
    """Compare the mean over the second half of the window with that over the whole, using the runs of the case."""
    for n in FIELDS:
        if not study.there("case", n, {}):
            break
        rows = []
        for i in range(n):
            with Run(study.path("case", i)) as run:
                why = "a run has no window" if run.window is None else \
                    "the line of a run parts before the end of its window" if run.adrift < run.window[1] else \
                    "the load of a run has no bound in some steps of its window" if run.at_least else ""
                if why:
                    return not_judged(*WINDOW, why)
                (start, end), t, x = run.window, run["time"], run["ice_resistance"]
                first = start + (run.steps_per_sample - 1) * run.value("run.dt")
            middle = 0.5 * (start + end)
            inside = within(t, first, end)
            rows.append((x[inside].mean(), x[inside & (t > middle)].mean(), start, middle))
        base, late, starts, middles = np.array(rows).T
        if base.mean() == 0 or base.max() == base.sum():
            return not_judged(*WINDOW, "nothing to hold the mean ice resistance against", fields=n)
        value, interval = effect(base, late)
        row = {"name": "window", "key": "output.window_start", "unit": "s", "from": starts.mean(), "to": middles.mean(),
               "finer": "later", "quantity": "mean ice resistance", "effect": value, "interval_95": interval,
               "fields": n, "judged": judged(interval, margin), "same_ice": True}
        if row["judged"] != "open":
            break
    else:
        row["why"] = f"{FIELDS[-1]} fields scatter too much"
    if row["judged"] == "open":
        row.setdefault("why", SPENT.text)
    row["recommended"] = {"none": row["from"], "matters": row["to"], "open": None}[row["judged"]]
    return [row]


def fields_row(study):
    """How many fields the mean requires, from those that have been run."""
    kept = [i for i in range(FIELDS[-1]) if study.kept("case", i)]  # the budget may have ended one in between
    x = study.measured("case", kept, mean_resistance)
    n = len(x)
    if not np.isfinite(x).all():
        return not_judged("fields", "repeats", "a run has no mean ice resistance")
    low, high = stat_mean.t_interval(x)
    needed = stat_mean.fields_needed(x.mean(), np.std(x, ddof=1), EFFORT)
    return [{"name": "fields", "key": "repeats", "fields": n, "quantity": "mean ice resistance", "mean": x.mean(),
             "mean_95": (low, high), "wanted_error": EFFORT, "recommended": needed,
             "judged": "none" if n >= needed else "open"}]


def verdicts(study):
    """{verdict on the window: number of tows of the unchanged case}."""
    kept = [i for i in range(FIELDS[-1]) if study.kept("case", i)]
    return dict(Counter(study.each("case", kept, lambda run: run.verdict[0])))


def varied(study, kinds, margin, tries, end):
    """{name: rows}. The remaining budget is divided equally among the open quantities, until all are resolved or no
    further run is possible."""
    found, waiting, before = {}, kinds, -1
    while waiting and study.made > before:
        before = study.made
        for k, kind in enumerate(waiting):
            study.end = time.monotonic() + (end - time.monotonic()) / (len(waiting) - k)
            try:
                found[kind.name] = vary(study, kind, margin, tries)
            except RunError as error:
                found[kind.name] = not_judged(kind.name, kind.key, error.reason)
        waiting = [kind for kind in waiting if found[kind.name][-1].get("code") == SPENT.code]
    study.end = end
    return found


def converge(study, names, margin, tries=TRIES):
    if not study.there("case", FIELDS[0], {}):
        raise RunError(study.folder, f"the budget is not enough for {FIELDS[0]} runs of the case",
                       "raise --budget and repeat the command; its runs are kept", SIGNAL)
    rows = sum(varied(study, [k for k in KINDS if k.name in names], margin, tries, study.end).values(), [])
    if "window" in names:
        try:
            rows += window(study, margin)
        except RunError as error:
            rows += not_judged(*WINDOW, error.reason)
    for row in rows:
        if row["judged"] == "none":
            row["share_without"] = stat_largest.share_below(row["fields"])
    if "fields" in names:
        rows += fields_row(study)
    return rows


def names_of(text):
    found = [part.strip() for part in text.split(",") if part.strip()]
    if wrong := [name for name in found if name not in NAMES]:
        raise argparse.ArgumentTypeError(f"{wrong[0]}: is none of {', '.join(NAMES)}")
    return found


def options(p):
    p.add_argument("case", metavar="CASE.yml", type=Path)
    p.add_argument("-o", "--output", metavar="DIR", type=Path, help="result folder (default: out/converge-CASE); runs "
                   "are kept there and reused for the same case file and program")
    p.add_argument("--vary", type=names_of, default=list(NAMES), metavar="NAME,...",
                   help=f"settings to vary, of {', '.join(NAMES)} (default: all)")
    p.add_argument("--margin", type=above_zero, default=MARGIN, metavar="M",
                   help="relative change of the mean that is negligible (default 0.1)")
    p.add_argument("--tries", type=whole_from(1, 5), default=TRIES, metavar="K",
                   help="successive values to try of a setting whose first change is not negligible (default 3)")
    analysis.add_options(p, BUDGET)


def perform(a):
    folder, began = a.output or Path("out") / f"converge-{a.case.stem}", time.monotonic()
    analysis.begin("converge", a.case, "case", folder, a.force)
    checked(program_path(), a.case, a.set)
    last = began + 60 * a.budget
    study = CaseRuns(a.case.resolve(), folder, "converge", program_path(), a.set, a.jobs, last, last)
    with locked(folder / "converge") as study.lock:
        rows = converge(study, a.vary, a.margin, a.tries)
        values = None  # the values of the case are unknown if the budget was spent before its first run ended
        if study.kept("case", 0):
            with Run(study.path("case", 0)) as run:
                values = run.case
    found = {"case": str(a.case), "set": a.set, "values": values, "margin": a.margin,
             "verdicts": verdicts(study), "budget_min": a.budget, "looks": LOOKS,
             "spent_min": (time.monotonic() - began) / 60, "rows": rows}
    analysis.keep("converge", found, folder, a.force)
    study.tell_failed()
