# SPDX-License-Identifier: MIT
"""How much of the scatter of a number comes from the fields, from the parameters, and from each parameter.

Members of a Latin hypercube, r separate fields in each of n conditions:

    y = m + p(condition) + f(field),    E MS_within = s_f²,    E MS_between = s_f² + r s_p²

This is the one-way analysis of variance with random effects; with unequal numbers of fields r is Cochran's mean.
Intervals are those of the jackknife over conditions, for variances on a logarithmic scale; a hypercube is stratified,
so they tend to be too wide. Sobol indices of the condition means (stats/sensitivity.py) divide the parameters' part, on
the scale, linear or logarithmic, on which the expansion predicts better. Rejected: shares from correlations alone,
which miss interactions; a surrogate of all members, whose cross-validation would see the same condition twice.
"""
from collections import namedtuple

import numpy as np

from bergtow.result import compared
from bergtow.stats import load as stat_load
from bergtow.stats import sensitivity as stat_sensitivity

LEAST = 8            # conditions
QUANTITIES = ("width", "length", "dt", "tolerance", "window")  # of bergtow converge, those that affect the mean


#: the mean and the variances of the two parts; with one field in each condition that of `fields` is NaN, and that of
#: `parameters` the variance of both
Parts = namedtuple("Parts", "mean fields parameters")


def parts(groups):
    """Parts from values [[y, ...], ...], one list per condition."""
    n = np.array([len(g) for g in groups], dtype=float)
    means = np.array([np.mean(g) for g in groups])
    grand = means.mean()
    freedom = n.sum() - len(groups)
    between = np.sum((means - grand) ** 2) / (len(groups) - 1)
    if freedom < 1:
        return Parts(float(grand), np.nan, float(between))
    within = sum(np.sum((np.asarray(g) - m) ** 2) for g, m in zip(groups, means)) / freedom
    # for means: E between = s_p² + s_f² mean(1 / n)
    return Parts(float(grand), float(within), float(between - within * np.mean(1 / n)))


def _sd(variance):
    return float(np.sqrt(max(variance, 0.0))) if np.isfinite(variance) else np.nan


def shares(parameters, means):
    """Sobol indices of the condition means, on the scale on which they are predicted better; a dict like that of
    stat_sensitivity.sobol, with "scale"."""
    plain = stat_sensitivity.sobol(parameters, means) | {"scale": "the number itself"}
    if np.min(means) <= 0:
        return plain
    logs = stat_sensitivity.sobol(parameters, np.log(means)) | {"scale": "its logarithm"}
    def rank(s):
        return "refused" not in s, s.get("q2", -np.inf)
    return max(plain, logs, key=rank)


def _of_a_chain(chain):
    """(bias, standard deviation, why they are incomplete) for a quantity, relative to the mean of the study; chain:
    rows of converge.json that begin at its value.

    An effect that matters is known: all such effects together make a bias. Its error is half the half-width of its
    interval. For the last comparison, which may have no effect, it is half the larger end of the interval; as that
    includes the scatter of the comparison, it is an upper bound rather than an estimate.
    """
    factor, squares = 1.0, 0.0
    for row in chain:
        low, high = np.array(row.get("interval_95") or (None, None), dtype=float)
        if not np.isfinite([low, high]).all():
            return factor - 1, np.sqrt(squares), "not resolved"
        matters = row.get("judged") == "matters"
        squares += (factor * ((high - low) / 4 if matters else max(abs(low), abs(high)) / 2)) ** 2
        factor *= 1 + row["effect"] if matters else 1.0
    why = {"matters": "matters up to the last value compared", "open": row.get("why") or "not resolved"}
    return factor - 1, np.sqrt(squares), why.get(row.get("judged"), "")


def relative_numerics(rows, own):
    """The numerical error, relative to the mean, from the rows of converge.json and the values that the study runs
    with, {quantity: value}: {"sd", NaN if nothing is known; "biases": {quantity: relative effect}; "unknown":
    {quantity: why sd does not bound it}; "within": those of them that sd includes as far as they are known}; None
    without rows."""
    squares, biases, unknown, within = [], {}, {}, []
    for name in QUANTITIES:
        chain = compared.chain(rows, name, own.get(name))
        if not chain:
            unknown[name] = "not compared at the value of this study" if any(r["name"] == name for r in rows) else \
                "not varied"
            continue
        bias, sd, why = _of_a_chain(chain)
        squares += [sd * sd] if sd > 0 or not why else []
        biases |= {name: float(bias)} if bias else {}
        unknown |= {name: why} if why else {}
        within += [name] if why and sd > 0 else []
    return {"sd": float(np.sqrt(sum(squares))) if squares else np.nan, "biases": biases, "unknown": unknown,
            "within": within} if len(rows) else None


def _numerics(relative, mean):
    """The same for a mean, with "bias": all biases combined, in the unit of the mean."""
    if relative is None or "refused" in relative:
        return relative
    bias = np.prod([1 + b for b in relative["biases"].values()]) - 1
    return relative | {"sd": relative["sd"] * abs(mean), "bias": float(bias * mean)}


def budget(parameters, condition, y, numerics=None):
    """Everything as nested dicts. parameters: {name: [M]}, condition [M], y [M]; numerics: relative_numerics(), or
    {"refused": why}. {"refused": why} if there are too few conditions. The shares refer to the mean square deviation
    from the result of a converged computation, which is the variance plus the square of the bias."""
    y, condition = np.asarray(y, dtype=float), np.asarray(condition)
    ids = np.unique(condition)
    if len(ids) < LEAST:
        return {"refused": f"{len(ids)} conditions, needs {LEAST}"}
    groups = [y[condition == c] for c in ids]
    whole = parts(groups)
    without = [parts(groups[:i] + groups[i + 1:]) for i in range(len(groups))]
    out = {"members": len(y), "conditions": len(ids), "mean": whole.mean,
           "mean_95": stat_load.jackknife(whole.mean, [p.mean for p in without])}
    for name in ("fields", "parameters"):
        v = getattr(whole, name)
        ends = stat_load.jackknife(v, [getattr(p, name) for p in without], scale=stat_load.LOG)
        out[name] = {"sd": _sd(v), "sd_95": tuple(map(_sd, ends))}
    n = out["numerics"] = _numerics(numerics, whole.mean)
    squares = {"fields": np.nan_to_num(whole.fields), "parameters": max(whole.parameters, 0.0),
               "numerics": np.nan_to_num(n["sd"]) ** 2 if n and "sd" in n else 0.0}
    bias = n.get("bias", 0.0) ** 2 if n else 0.0
    total = sum(squares.values()) + bias
    out["together"] = {"sd": float(np.sqrt(total))}
    for name, v in squares.items():
        if out[name] is not None and "sd" in out[name]:
            known = total > 0 and (name != "numerics" or np.isfinite(n["sd"]))
            out[name]["share"] = float(v / total) if known else np.nan
    if bias:
        n["bias_share"] = float(bias / total)
    first = [np.flatnonzero(condition == c)[0] for c in ids]
    out["shares"] = shares({k: np.asarray(v)[first] for k, v in parameters.items()},
                           np.array([np.mean(g) for g in groups]))
    return out
