# SPDX-License-Identifier: MIT
"""How much of the scatter of a number is of the fields, how much of the parameters, and how much of each of them.

Members of a Latin hypercube, r fields of their own in each of n conditions:

    y = m + p(condition) + f(field),    E MS_within = s_f²,    E MS_between = s_f² + r s_p²

the one-way analysis of variance with random effects; with unequal numbers of fields r is Cochran's mean. Intervals
are those of the jackknife over conditions, of variances on the logarithm; a hypercube is stratified, so they are
rather too wide. The parameters' part is shared out by Sobol indices of the means of the conditions
(stat_sensitivity.py), on the scale, plain or logarithmic, on which the expansion predicts better. Rejected: shares
from correlations alone, which miss what acts in pairs; a surrogate of all members, whose cross-validation would see
the same condition twice.
"""
from dataclasses import dataclass

import numpy as np
from scipy import stats

import stat_sensitivity

LEAST = 8            # conditions


@dataclass(frozen=True)
class Parts:
    """Mean and variances of the two parts."""

    mean: float
    fields: float      #: variance, NaN with one field in each condition
    parameters: float  #: variance, that of both parts then


def parts(groups):
    """Of values [[y, ...], ...], a list a condition."""
    n = np.array([len(g) for g in groups], dtype=float)
    means = np.array([np.mean(g) for g in groups])
    grand = means.mean()
    freedom = n.sum() - len(groups)
    between = np.sum((means - grand) ** 2) / (len(groups) - 1)
    if freedom < 1:
        return Parts(float(grand), np.nan, float(between))
    within = sum(np.sum((np.asarray(g) - m) ** 2) for g, m in zip(groups, means)) / freedom
    # of means: E between = s_p² + s_f² mean(1 / n)
    return Parts(float(grand), float(within), float(between - within * np.mean(1 / n)))


def _interval(whole, without, log):
    """95 % by the jackknife: of the number itself, or of its logarithm where it has one."""
    n, without = len(without), np.asarray(without)
    log = log and whole > 0 and np.all(without > 0)
    if not np.isfinite(whole) or not np.isfinite(without).all():
        return np.nan, np.nan
    x = np.log(without) if log else without
    half = stats.t.ppf(0.975, n - 1) * np.sqrt((n - 1) / n * np.sum((x - x.mean()) ** 2))
    if log:
        return float(whole * np.exp(-half)), float(whole * np.exp(half))
    return float(whole - half), float(whole + half)


def _sd(variance, ends):
    low, high = (float(np.sqrt(max(v, 0.0))) if np.isfinite(v) else np.nan for v in ends)
    return {"sd": float(np.sqrt(max(variance, 0.0))) if np.isfinite(variance) else np.nan, "sd_95": (low, high)}


def shares(parameters, means):
    """Sobol indices of the means of the conditions, on the scale that is predicted better; a dict as that of
    stat_sensitivity.sobol, with "scale"."""
    plain = stat_sensitivity.sobol(parameters, means) | {"scale": "the number itself"}
    if np.min(means) <= 0:
        return plain
    logs = stat_sensitivity.sobol(parameters, np.log(means)) | {"scale": "its logarithm"}
    def rank(s):
        return "refused" not in s, s.get("q2", -np.inf)
    return max(plain, logs, key=rank)


def relative_numerics(rows):
    """Standard deviation that the computation may add, relative to the mean, from the rows of converge.json; None where
    there are none.

    Of each quantity the last comparison counts, made from the value that is recommended on: half the larger end of its
    interval, added as squares. It holds the scatter of that study, so it is an upper bound rather than an estimate.
    """
    last = {}
    for row in rows:
        ends = row.get("interval_95")
        if row["name"] in ("width", "length", "dt", "tolerance", "window") and ends and None not in ends:
            last[row["name"]] = max(abs(ends[0]), abs(ends[1])) / 2
    return float(np.sqrt(sum(u * u for u in last.values()))) if last else None


def budget(parameters, condition, y, converge=()):
    """Everything as nested dicts. parameters: {name: [M]}, condition [M], y [M]; converge: rows of converge.json.
    {"refused": why} where there are too few conditions."""
    y, condition = np.asarray(y, dtype=float), np.asarray(condition)
    ids = np.unique(condition)
    if len(ids) < LEAST:
        return {"refused": f"{len(ids)} conditions, needs {LEAST}"}
    groups = [y[condition == c] for c in ids]
    whole = parts(groups)
    without = [parts(groups[:i] + groups[i + 1:]) for i in range(len(groups))]
    out = {"members": len(y), "conditions": len(ids), "mean": whole.mean,
           "mean_95": _interval(whole.mean, [p.mean for p in without], False)}
    for name in ("fields", "parameters"):
        v = getattr(whole, name)
        out[name] = _sd(v, _interval(v, [getattr(p, name) for p in without], True))
    numerics = relative_numerics(converge)
    out["numerics"] = None if numerics is None else {"sd": numerics * abs(whole.mean)}
    variances = {"fields": np.nan_to_num(whole.fields), "parameters": max(whole.parameters, 0.0),
                 "numerics": (numerics or 0.0) ** 2 * whole.mean ** 2}
    total = sum(variances.values())
    out["together"] = {"sd": float(np.sqrt(total))}
    for name, v in variances.items():
        if out[name] is not None:
            out[name]["share"] = float(v / total) if total > 0 else np.nan
    first = [np.flatnonzero(condition == c)[0] for c in ids]
    out["shares"] = shares({k: np.asarray(v)[first] for k, v in parameters.items()},
                           np.array([np.mean(g) for g in groups]))
    return out
