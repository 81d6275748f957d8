# SPDX-License-Identifier: MIT
"""Which parameter matters: rank correlations and Sobol indices, from the sample of the study.

Spearman's rho of a parameter with the response, and the partial rank correlation (PRCC), after the ranks of the other
parameters have been regressed out of both; intervals by Fisher's z with the variance 1.06/(n - k - 3) for ranks
[Fieller, Hartley & Pearson 1957, Biometrika 44].

Sobol indices come from a polynomial chaos expansion fitted by least squares [Sudret 2008, Reliab. Eng. Syst. Saf. 93].
Indices do not change under a monotonic transformation of a parameter, so each is replaced by its rank: uniform on (0,
1) in a Latin hypercube, whether sampled on a linear or a logarithmic scale. The basis functions are orthonormal under
the parameter's own distribution in the sample: Legendre-like polynomials if it has many values, one function fewer than
there are values if it has few (then a full factorial design gives the analysis of variance), including names. With y =
sum c_a psi_a,  S_i = sum of c_a² over terms in i alone / sum of all,  T_i = the same over all terms containing i. The
estimate c² is biased high by the variance of c, which is subtracted. The degree is the one with the best Q²
(cross-validated R², leaving out each value in turn). The part that the expansion does not explain, including the
scatter of the fields, is reported as 1 - R²; the indices divide the part that it explains.
"""
import itertools

import numpy as np
import scipy

FEW = 6              # a parameter with at most this many distinct values is a choice among levels
MAX_DEGREE = 10
LEAST_SAMPLES = 20
PER_TERM = 2         # samples per term of the expansion
LEAST_Q2 = 0.3
RESAMPLES = 100
SEED = 20174


def scores(column):
    """Mid-ranks in (0, 1) of a column; names are ordered by first appearance."""
    column = np.asarray(column)
    if column.dtype == object:
        names = list(dict.fromkeys(column))
        column = np.array([names.index(v) for v in column], dtype=float)
    return (scipy.stats.rankdata(column) - 0.5) / len(column)


def _residual(y, others):
    a = np.column_stack([np.ones(len(y)), others])
    return y - a @ np.linalg.lstsq(a, y, rcond=None)[0]


def _interval(r, n, others):
    """95 % interval of a rank correlation; NaN if the sample is too small."""
    freedom = n - others - 3
    if freedom < 1 or not np.isfinite(r) or abs(r) >= 1:
        return (r, r) if abs(r) >= 1 else (np.nan, np.nan)
    half = scipy.stats.norm.ppf(0.975) * np.sqrt(1.06 / freedom)
    return float(np.tanh(np.arctanh(r) - half)), float(np.tanh(np.arctanh(r) + half))


def rank_correlations(parameters, y):
    """{name: spearman, prcc with (low, high), p} of numeric parameters {name: [n]}; names of choices are left out."""
    names = [k for k, v in parameters.items()
             if np.asarray(v).dtype != object and np.ptp(np.asarray(v, dtype=float)) > 0]
    n, ranks, target = len(y), {k: scipy.stats.rankdata(parameters[k]) for k in names}, scipy.stats.rankdata(y)
    out = {}
    for name in names:
        rho = float(np.corrcoef(ranks[name], target)[0, 1])
        others = [ranks[k] for k in names if k != name]
        partial = rho
        if others:
            others = np.column_stack(others)
            a, b = _residual(ranks[name], others), _residual(target, others)
            partial = float(np.corrcoef(a, b)[0, 1]) if np.std(a) > 1e-9 * n and np.std(b) > 1e-9 * n else np.nan
        out[name] = {"spearman": rho, "spearman_95": _interval(rho, n, 0), "prcc": partial,
                     "prcc_95": _interval(partial, n, len(names) - 1)}
    return out


def _functions(u, levels, degree):
    """[n, d] functions of one parameter, orthonormal to each other and to 1 over the sample."""
    most = min(degree, levels - 1) if levels > FEW else levels - 1
    vandermonde = np.polynomial.legendre.legvander(2 * u - 1, most)
    q, r = np.linalg.qr(vandermonde)
    return (q * np.sign(np.diag(r)))[:, 1:] * np.sqrt(len(u))


def _terms(depth, degree):
    """Exponents [terms][k], without the constant, of total degree up to `degree`; depth: number of functions of each
    parameter, and whether it is a choice.

    Each function of a choice counts as degree one, so that all of them enter together.
    """
    def cost(a):
        return sum((1 if choice else e) for e, (_, choice) in zip(a, depth) if e)

    return [a for a in itertools.product(*(range(min(d, d if choice else degree) + 1) for d, choice in depth))
            if 0 < cost(a) <= degree]


def _design(columns, degree):
    """(matrix [n, 1 + terms], exponents) of the expansion."""
    levels = [len(np.unique(u)) for u in columns]
    functions = [_functions(u, m, degree) for u, m in zip(columns, levels)]
    terms = _terms([(f.shape[1], m <= FEW) for f, m in zip(functions, levels)], degree)
    a = np.ones((len(columns[0]), 1 + len(terms)))
    for j, term in enumerate(terms, 1):
        for i, e in enumerate(term):
            if e:
                a[:, j] *= functions[i][:, e - 1]
    return a, terms


def _fit(a, y):
    """(coefficients, their variances, R², Q²) from least squares."""
    q, r = np.linalg.qr(a)
    if np.min(np.abs(np.diag(r))) < 1e-8 * np.max(np.abs(np.diag(r))):
        return None  # some terms cannot be distinguished in the sample
    c = np.linalg.solve(r, q.T @ y)
    rest, hat = y - a @ c, np.sum(q * q, axis=1)
    freedom, total = len(y) - a.shape[1], np.sum((y - y.mean()) ** 2)
    if freedom < 1 or hat.max() > 1 - 1e-9:
        return None
    variance = np.sum(np.linalg.inv(r) ** 2, axis=1) * np.dot(rest, rest) / freedom
    return c, variance, 1 - np.dot(rest, rest) / total, 1 - np.sum((rest / (1 - hat)) ** 2) / total


def _indices(c, variance, terms, k):
    """(first-order, total) [k] from coefficients without the constant."""
    power = np.maximum(c[1:] ** 2 - variance[1:], 0.0)
    inside = np.array(terms) > 0
    whole = power.sum()
    if not whole > 0:
        return np.full(k, np.nan), np.full(k, np.nan)
    alone = inside.sum(axis=1) == 1
    return tuple(np.array([power[inside[:, i] & some].sum() for i in range(k)]) / whole for some in (alone, True))


def sobol(parameters, y, resamples=RESAMPLES):
    """First-order and total Sobol indices with intervals as a dict; {"refused": why} if the sample is insufficient."""
    y = np.asarray(y, dtype=float)
    n, names = len(y), [k for k, v in parameters.items() if len(set(np.asarray(v).tolist())) > 1]
    if not names:
        return {"refused": "nothing is varied"}
    if n < LEAST_SAMPLES:
        return {"refused": f"{n} values, needs {LEAST_SAMPLES}"}
    if np.ptp(y) == 0:
        return {"refused": "the response does not vary"}
    columns, best = [scores(parameters[k]) for k in names], None
    for degree in range(1, MAX_DEGREE + 1):
        a, terms = _design(columns, degree)
        if n < PER_TERM * a.shape[1]:
            break
        found = _fit(a, y)
        if found and (best is None or found[3] > best[0][3] + 1e-12):
            best = found, a, terms, degree
    if best is None:
        return {"refused": f"{n} values do not suffice for {len(names)} parameters: a linear expansion needs "
                           f"{PER_TERM * (len(names) + 1)} that differ in all of them"}
    (c, variance, r2, q2), a, terms, degree = best
    if q2 < LEAST_Q2:
        return {"refused": f"the best expansion (degree {degree}, {len(terms)} terms) predicts too little of {n} "
                           f"values: Q² = {q2:.2f}, needs {LEAST_Q2}", "q2": q2, "r2": r2}
    first, total = _indices(c, variance, terms, len(names))
    rng, drawn = np.random.default_rng(SEED), []
    for _ in range(resamples):
        pick = rng.integers(0, n, n)
        drawn_a = a[pick]
        # the columns are nearly orthonormal, so the normal equations suffice
        again = np.linalg.lstsq(drawn_a.T @ drawn_a, drawn_a.T @ y[pick], rcond=None)[0]
        # its own variance and that of the resampling
        drawn.append(_indices(again, 2 * variance, terms, len(names)))
    ends = np.nanquantile(drawn, [0.025, 0.975], axis=0) if drawn else np.full((2, 2, len(names)), np.nan)
    return {"samples": n, "degree": degree, "terms": len(terms), "r2": r2, "q2": q2, "indices": {
        name: {"first": first[i], "first_95": tuple(ends[:, 0, i]), "total": total[i], "total_95": tuple(ends[:, 1, i])}
        for i, name in enumerate(names)}}
