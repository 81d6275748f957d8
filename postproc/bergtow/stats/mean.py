# SPDX-License-Identifier: MIT
"""Means with intervals: of one correlated series, and of the means of several fields.

Within a run: computed by the library (bergtow/stats.h, src/base/stats.c), as in the program.

Between fields. Fields are independent: mean of the n means, se = sd / sqrt(n), the t quantile with n - 1 degrees of
freedom. Means of dense ice are skewed; the studentised bootstrap accounts for skewness (second-order correct), whereas
the percentile and BCa bootstrap intervals are too short for few fields.
"""
from ctypes import POINTER, c_double

from bergtow import _library

import numpy as np
import scipy

LEVEL = 0.95
RESAMPLES = 1999
LEAST_BOOTSTRAP = 5  # fields: fewer give too few distinct resamples
TRIM = 0.125         # share of the fields cut off at each end: one in eight, two in twenty
SEED = 20171         # of every resampling: the same files give the same table


def series_mean(x):
    """Mean of an evenly spaced series, computed by the library: mean, sd, se, low and high, the ends of its 95 %
    interval, tau, n_eff, n; NaNs if there are fewer than two samples or one is not finite."""
    x = np.ascontiguousarray(x, dtype=float)
    return _library.library().bt_stats_mean(x.ctypes.data_as(POINTER(c_double)), len(x))


def t_interval(x, level=LEVEL):
    """(low, high) of the mean of independent x [n] or [n, ...], along the first axis; NaN for fewer than two."""
    n = len(x)
    if n < 2:
        return np.nan, np.nan
    half = scipy.stats.t.ppf(0.5 + level / 2, n - 1) * np.std(x, ddof=1, axis=0) / np.sqrt(n)
    return np.mean(x, axis=0) - half, np.mean(x, axis=0) + half


def welch_freedom(variances, counts):
    """Degrees of freedom of a sum of means, by Welch and Satterthwaite. variances: of the means; not all zero."""
    u = np.asarray(variances)
    return u.sum() ** 2 / np.sum(u ** 2 / (np.asarray(counts) - 1))


def sum_over_conditions(conditions, term, level=LEVEL):
    """(value, low, high) of the sum of term(k, mean of condition k); the bounds are NaN if a condition has fewer than
    two fields, or a term is not finite without one of them. conditions: [{field: value}].

    The jackknife over fields: values of one field are correlated, whichever conditions they belong to, so without it
    the sum changes by d, the sum of the changes of its terms, and the variance is the sum of d^2 (n - 1) / n. For one
    mean this is t_interval. Freedom where no field is shared: by Welch and Satterthwaite, since one condition may have
    nearly all of the variance, as the fastest of several tows."""
    counts, moved, variances = [len(c) for c in conditions], {}, []
    value = sum(term(k, np.mean(list(c.values()))) for k, c in enumerate(conditions))
    if min(counts) < 2:
        return value, np.nan, np.nan
    for k, (c, n) in enumerate(zip(conditions, counts)):
        x = np.array(list(c.values()))
        without = term(k, (x.sum() - x) / (n - 1))
        d = (without - without.mean()) * np.sqrt((n - 1) / n)
        variances.append(np.sum(d * d))
        for field, by in zip(c, d):
            moved[field] = moved.get(field, 0.0) + by
    apart = len(moved) == sum(counts) and any(variances)  # no two conditions share a field
    free = welch_freedom(variances, counts) if apart else min(counts) - 1
    half = scipy.stats.t.ppf(0.5 + level / 2, free) * np.sqrt(sum(d * d for d in moved.values()))
    return value, value - half, value + half


def mean_of_conditions(conditions, level=LEVEL):
    """(mean, low, high) of the mean of the means of several conditions, as sum_over_conditions()."""
    return sum_over_conditions(conditions, lambda _, mean: mean / len(conditions), level)


def power_of_conditions(x, conditions, level=LEVEL):
    """(exponent, low, high) of the law x^exponent through the means of conditions at these x, as sum_over_conditions();
    None if undefined.

    The slope of ln mean on ln x, each mean alike, is a sum over conditions. Rejected: the slope of the logarithms of
    single fields, which is that of geometric means: another exponent where fields scatter more at one x (coverage of
    both: docs/statistics.md)."""
    if not all(v > 0 for v in [*x, *(np.mean(list(c.values())) for c in conditions)]):
        return None
    away = np.log(x) - np.mean(np.log(x))
    if not away.any():
        return None
    def term(k, mean):
        return away[k] / np.dot(away, away) * np.log(np.where(mean > 0, mean, np.nan))
    return tuple(float(v) for v in sum_over_conditions(conditions, term, level))


def studentised_interval(x, level=LEVEL, resamples=RESAMPLES, rng=None):
    """(low, high) of the mean by the studentised bootstrap: m - q_high se, m - q_low se with q of (m* - m) / se*. NaN
    for fewer than LEAST_BOOTSTRAP."""
    x = np.asarray(x, dtype=float)
    n, m = len(x), np.mean(x)
    if n < LEAST_BOOTSTRAP:
        return np.nan, np.nan
    if np.ptp(x) == 0:
        return m, m
    rng = rng or np.random.default_rng(SEED)
    drawn = x[rng.integers(0, n, (resamples, n))]
    spread = drawn.std(axis=1, ddof=1)
    some = spread > 0
    t = (drawn[some].mean(axis=1) - m) / (spread[some] / np.sqrt(n))
    low, high = np.quantile(t, [(1 - level) / 2, (1 + level) / 2])
    se = np.std(x, ddof=1) / np.sqrt(n)
    return m - high * se, m - low * se


def median_interval(x, level=LEVEL):
    """(low, high) of the median by order statistics, without assuming a distribution; NaN if n is too small for the
    level."""
    x = np.sort(x)
    n = len(x)
    k = int(scipy.stats.binom.ppf((1 - level) / 2, n, 0.5))
    while k > 0 and scipy.stats.binom.cdf(k - 1, n, 0.5) > (1 - level) / 2:
        k -= 1
    return (x[k - 1], x[n - k]) if k > 0 else (np.nan, np.nan)


def fields_needed(mean, sd, error, level=LEVEL):
    """Least n for which the t interval is within error * |mean|, from the mean and the standard deviation between
    fields; NaN if either is missing."""
    if not (np.isfinite([mean, sd]).all() and mean != 0):
        return np.nan
    ratio, n = sd / (error * abs(mean)), 2
    while scipy.stats.t.ppf(0.5 + level / 2, n - 1) * ratio > np.sqrt(n):
        n = max(n + 1, int((scipy.stats.norm.ppf(0.5 + level / 2) * ratio) ** 2))
    return float(n)


def between_fields(means, errors, wanted=0.05):
    """Statistics of the means of fields, with the standard errors within each field, as a dict of numbers and (low,
    high) pairs."""
    means, errors = np.asarray(means, dtype=float), np.asarray(errors, dtype=float)
    n = len(means)
    if n == 0:
        return {"n": 0}
    sd = np.std(means, ddof=1) if n > 1 else np.nan
    within = np.sqrt(np.nanmean(errors ** 2)) if np.isfinite(errors).any() else np.nan
    spread = scipy.stats.chi2.ppf([0.975, 0.025], n - 1) if n > 1 else [np.nan] * 2
    sd_range = sd * np.sqrt((n - 1) / np.asarray(spread))
    total = np.sum(np.abs(means))
    trimmed = scipy.stats.trim_mean(means, TRIM)
    return {
        "n": n, "mean": means.mean(), "sd_between": sd, "sd_between_95": tuple(sd_range), "se_between": sd / np.sqrt(n),
        "se_within": within,
        "sd_of_fields": np.sqrt(max(sd**2 - within**2, 0.0)) if np.isfinite([sd, within]).all() else np.nan,
        "t_95": t_interval(means), "bootstrap_95": studentised_interval(means), "median": np.median(means),
        "median_95": median_interval(means), "trimmed_mean": trimmed, "trimmed_each_end": int(TRIM * n),
        "largest_share": np.max(np.abs(means)) / total if total > 0 else np.nan,
        "percentiles": {str(p): np.percentile(means, p) for p in (5, 25, 75, 95)},
        "min": means.min(), "max": means.max(), "fields_needed": fields_needed(means.mean(), sd, wanted),
        "fields_needed_95": tuple(fields_needed(means.mean(), s, wanted) for s in sd_range)}
