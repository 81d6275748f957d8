# SPDX-License-Identifier: MIT
"""Statistics of an ensemble: the design tow force, loads with return levels, means with intervals, comparison with
estimates, distributions, peaks of collisions, sensitivity."""

from bergtow import progress
from bergtow.errors import RunError
from bergtow.result import answers, at_least
from bergtow.result.members import DOUBTS, FAILED, FINISHED, WAITING
from bergtow.stats import loads
from bergtow.stats import design_value
from bergtow.stats import drift as stat_drift
from bergtow.stats import extreme as stat_extreme
from bergtow.stats import fit as stat_fit
from bergtow.stats import load as stat_load
from bergtow.stats import mean as stat_mean
from bergtow.stats import sensitivity as stat_sensitivity
from bergtow.table import scale, short

import numpy as np

MAX_SAMPLES = 300  # of a condition's series, to which distributions are fitted


#: the options of statistics(): the defaults of bergtow statistics
DEFAULTS = {"error": 0.05, "exclude": [], "hours": [1.0, 10.0, 100.0], "threshold": None, "gap": None, "blocks": None,
            "resamples": stat_fit.RESAMPLES, "time_scale": None, "tow_hours": None, "probability": loads.PROBABILITY}


def member(e, m):
    """Mean of one member with its standard error within the run."""
    within = stat_mean.series_mean(e.steady(m))
    mean, independent = e.mean[m], e.number("window_n_independent", m)
    low, high, se, share = within.low, within.high, within.se, e.number("window_no_load_share", m)
    if share > 0:
        mean, se, low, high = at_least.AtLeast(mean, share), np.nan, np.nan, np.nan
    return {"name": e.name[m], "condition": int(e.condition[m]), "seed": int(e.seed[m]), "mean": mean,
            "se_within": se, "within_95": (mean + low - within.mean, mean + high - within.mean),
            "independent": independent if np.isfinite(independent) else within.n_eff,
            "tau_samples": within.tau, "doubts": sorted(e.doubts(m))}


def samples(e, rows, members):
    """Samples of the steady windows of a condition: (those of each field; number of independent ones; every 2 tau-th
    above zero, at most MAX_SAMPLES). All fields are thinned equally, by the median of their tau. Thinning each field by
    its own tau would give it the weight 1/tau, and almost all weight to a field without contact, whose tau is that of a
    constant."""
    found = [(e.steady(m), members[m]["tau_samples"]) for m in rows]
    every = [x for x, _ in found if len(x)]
    taus = [tau for x, tau in found if len(x) and np.ptp(x) > 0 and np.isfinite(tau)]
    stride = max(1, int(np.ceil(2 * np.median(taus)))) if taus else 1
    thinned = np.concatenate([x[::stride] for x in every]) if every else np.zeros(0)
    above = thinned[thinned > 0]
    step = max(1, int(np.ceil(len(above) / MAX_SAMPLES)))
    return every, len(thinned), above[::step]


def estimates(e, rows, mean):
    """Force of each estimate, averaged over the condition's fields, and simulated / estimate if all of them can be
    compared with it (bergtow/estimate.h)."""
    out = {}
    for name, estimate in e.estimates.items():
        def column(what, default=np.full(len(rows), np.nan)):
            values = e.summary.get(f"estimates_{name}_{what}")
            return default if values is None else values[rows]
        valid = column("valid")
        force, compares = float(np.mean(column("force_n"))) if len(rows) else np.nan, column("compares", valid)
        held = len(rows) and not estimate["on_top"] and np.all(compares == 1) and force > 0
        out[name] = {"label": estimate["label"], "on_top": estimate["on_top"], "force": force,
                     "valid": bool(len(rows) and np.all(valid == 1)), "compares": bool(held),
                     "ratio": mean / force if held else np.nan}
    return out


def extremes(e, rows, options):
    """Exceedance, block maxima and peaks over a threshold of a condition's collisions."""
    hits = {m: found for m in rows if (found := e.impacts(m))}
    conversions = {conversion for *_, conversion in hits.values()}
    fields = [{"time": time, "peak": peak, "start": start, "hours": hours}
              for time, peak, start, hours, _ in hits.values()]
    if not fields:
        return {"refused": "no collisions: the members' folders are not there, or impact.conversion was none"}
    if len(conversions) > 1:
        return {"refused": f"peaks of different conversions: {'; '.join(sorted(conversions))}"}
    taus = [tau for m in hits if np.isfinite(tau := e.number("window_correlation_time_s", m))]
    gap = options.gap if options.gap is not None else float(np.median(2 * np.array(taus))) if taus else 0.0
    peaks, rate = stat_extreme.exceedance(fields)
    hours = sum(f["hours"] for f in fields)
    ranks = [k for k in (1, 3, 10, 30, 100, 300, 1000) if k <= len(peaks)]
    return {
        "conversion": conversions.pop(), "fields": len(fields), "hours": hours, "collisions": len(peaks),
        "collisions_per_hour": len(peaks) / hours, "exceedance": [{"per_hour": rate[k - 1], "peak": peaks[k - 1]}
                                                                  for k in ranks],
        "block_maxima": stat_extreme.by_blocks(fields, options.hours, options.blocks, options.resamples),
        "over_threshold": stat_extreme.over_threshold(fields, options.hours, gap, options.threshold, options.resamples)}


def drift(e, rows, mean):
    """Does the mean over all fields drift during the window (stats/drift.py)?"""
    found = stat_drift.of([e.number("window_series_ice_resistance_change_n", m) for m in rows if not e.cut(m)], mean)
    if found is None:
        return {"verdict": "not judged", "words": "too few fields"}
    change, (low, high), moved = found
    factor, unit = scale([abs(change)], "N")
    ends = " to ".join(short(end / factor) for end in sorted((abs(low), abs(high))))
    words = f"{'rises' if change > 0 else 'falls'} by {short(abs(change) / factor)} {unit} (95 %: {ends})" if moved \
        else "no drift"
    return {"verdict": "not steady" if moved else "steady", "change": change, "change_95": (low, high), "words": words}


def condition(e, c, members, options):
    rows = c.finished
    means, errors = (np.array([members[m][key] for m in rows]) for key in ("mean", "se_within"))
    fields = stat_mean.between_fields(means, errors, options.error)
    every, independent, values = samples(e, rows, members)
    none = np.mean([np.mean(x <= 0) for x in every]) if every else np.nan
    quantiles = {str(p): stat_load.percentile(every, p) for p in stat_load.QUANTILES} if every else {}
    gathered, left_out = loads.gather(e, rows, options)
    out = {
        "index": c.index, "label": c.label, "values": c.values, "units": c.units, "members": {
            "all": len(c.members), "used": len(rows), "failed": c.failed, "waiting": c.waiting, "excluded": c.excluded,
            "doubts": {kind: sum(kind in e.doubts(m) for m in rows)
                       for kind in DOUBTS}, "doubtful": sum(bool(e.doubts(m)) for m in rows)
        }, "resistance": fields, "drift": drift(e, rows, fields.get("mean", np.nan)),
        "estimates": estimates(e, rows, fields.get("mean", np.nan)),
        "fits_of_means": stat_fit.fit_all(means, options.resamples), "samples": {
            "independent": independent, "not_above_zero": none, "percentiles": quantiles, "fitted": len(values),
            "fits": stat_fit.fit_all(values, options.resamples)
        }, "extremes": extremes(e, rows, options), "loads": loads.statistics(e, rows, options, gathered),
        "loads_left_out": left_out, "panels": loads.panels(e, rows)}
    without = e.without_bound(c.members)
    if without and len(rows):
        out = at_least.condition(out, str(without), without.share, loads.bounded(out["loads"], without))
    out["without_bound"] = {"share": without.share, "some": without.some, "ended": without.ended, "tows": without.tows,
                            "words": without.words(named=True)}  # "" if there are none
    return out | {"design": design_value.statement(e, rows, out)}


def sample(e, means):
    """({varied parameter: [n]}, mean ice resistance [n], "conditions" or "members": the sampling unit). means: by
    member.

    For a Latin hypercube the condition means are the sample. Fields of a condition share the part of it that the
    parameters do not explain; counted individually, 58 % of the 95 % intervals (10 conditions of 8 fields) for a
    parameter without effect excluded 0. In a grid all levels meet all others, and the effect of one parameter cancels
    in that of another: there it was 0 to 6 %, so the members are the sample.
    """
    groups = [c.finished for c in e.conditions() if len(c.finished)] if e.sampled else [[m] for m in e.used]
    first = np.array([g[0] for g in groups], dtype=int)
    varied = {k: v[first] for k, v in e.parameters.items() if len(set(v[first].tolist())) > 1}
    return varied, np.array([np.mean([means[m] for m in g]) for g in groups]), "conditions" if e.sampled else "members"


def sensitivity(e, members):
    """Rank correlations and Sobol indices of the members' means, and Sobol indices of their logarithms, with respect to
    the varied parameters. If a few jams dominate the variance of the mean, no smooth function predicts it; its
    logarithm may still be predictable."""
    if without := e.without_bound(np.arange(e.n)):
        return {"refused": f"means are lower bounds, {without}"}
    varied, y, of = sample(e, {m: members[m]["mean"] for m in e.used})
    if not varied or len(y) < 8:
        return {"refused": "nothing is varied" if not varied else f"{len(y)} {of}, needs 8"}
    logs = stat_sensitivity.sobol(varied, np.log(y)) if y.min() > 0 else {
        "refused": f"{np.sum(y <= 0)} means are not positive"}
    return {"members": len(e.used), "samples": len(y), "of": of, "ranks": stat_sensitivity.rank_correlations(varied, y),
            "sobol": stat_sensitivity.sobol(varied, y), "sobol_of_logarithm": logs}


def nothing_to_count(e, dropped):
    """RunError that says why there are no statistics, and what to do."""
    if dropped:
        return RunError(e.file, "has no member with a mean ice resistance left", "exclude less")
    if e.behind:
        return RunError(e.file, f"knows none of the {len(e.behind)} members that have finished",
                        "run `bergtow ensemble` again: it takes them in")
    failed = e.reasons(FAILED)
    name, why = next(iter(failed.items()), (None, None))
    failures = f"; {len(failed)} failed, the first: {name}: {why}" if failed else ""
    if e.unsound:
        return RunError(e.file, f"has no sound member{failures}; {e.holes()}",
                        "run `bergtow ensemble` again: it runs them again")
    if np.any(e.status == FINISHED):
        return RunError(e.file, f"has no member with a mean ice resistance{failures}",
                        "tow a body, on a line that holds, for longer than output.window_start")
    return RunError(e.file, f"has no member that has finished{failures}",
                    "run the ensemble further" if not e.complete else "correct the study, and give it another folder")


def statistics(e, options):
    """The statistics of an ensemble as nested dicts; statistics.json."""
    dropped = e.exclude(options.exclude) if options.exclude else {}
    if not len(e.used):
        raise nothing_to_count(e, dropped)
    members = {int(m): member(e, m) for m in progress.each("mean of member", e.used)}
    conditions = [condition(e, c, members, options) for c in progress.each("statistics of condition", e.conditions())]
    return {"title": e.title, "folder": str(e.path), "complete": e.complete, "wanted_error": options.error,
            "excluded": dropped, "exclude": sorted(options.exclude), "failed": e.reasons(FAILED),
            "died": e.reasons(WAITING), "behind": e.behind, "members_without_folder": e.without_folder,
            "unsound": e.unsound, "without_mean": e.without_mean, "waiting": e.waiting, "holes": e.holes(),
            "copies": e.copies, "builds": e.builds, "doubts": DOUBTS,
            "conditions": conditions, "sensitivity": sensitivity(e, members), "members": list(members.values()),
            "convergence": answers.read("converge", e.path)}
