# SPDX-License-Identifier: MIT
"""Extreme peaks: how often a level is exceeded, block maxima (GEV), peaks over a threshold (GPD), return levels with intervals.

A level z of return time T hours of tow is exceeded once in T hours on the average.
    empirical        rate(z) = number of peaks above z / hours
    block maxima     blocks of b hours, GEV G fitted to their largest peaks: z = G^-1(exp(-b/T))
    over threshold   clusters of peaks above u come at the rate L a hour, and the excess of a cluster's largest peak is GPD of scale s and
                     shape k: z = u + s ((L T)^k - 1)/k, L T > 1            [Coles 2001, An introduction to statistical modeling of extreme values, ch. 3-5]
Peaks above u closer to each other than the gap are one cluster: a floe that is pushed along hits again and again.

Intervals: whole fields are drawn anew with their peaks (dependence within a field stays as it is), fitted again, and the 2.5 and 97.5 %
quantiles taken. The threshold stays. With fewer than LEAST_FIELDS fields clusters are drawn from the fit instead, which leaves the scatter
between fields out. Either is a lower bound of what is not known: the model of the tail itself is assumed.
"""
import numpy as np
from scipy import optimize, stats

import stat_fit

LEAST_EXCESSES = 30
LEAST_BLOCKS = 20
LEAST_FIELDS = 5
SHARE = 0.1          # of the peaks above the threshold, or more, until there are LEAST_EXCESSES clusters
EMPTY = 0.05         # share of blocks without a peak above which there is no GEV
RESAMPLES = 199
SEED = 20173


def gpd(excess):
    """(scale, shape) of maximum likelihood, shape > stat_fit.LEAST_SHAPE.

    With t = shape/scale the likelihood's best shape is mean ln(1 + t y), which leaves one unknown [Grimshaw 1993, Technometrics 35]; it is
    searched on a grid, since there can be several maxima, and then refined.
    """
    y = np.asarray(excess, dtype=float)
    unit = y.mean()
    y = y / unit
    def shape_of(t):
        return np.mean(np.log1p(np.multiply.outer(t, y)), axis=-1)
    def minus_likelihood(t):
        t = np.asarray(t, dtype=float)
        small = np.abs(t) < 1e-8
        shape = np.where(small, 1.0, shape_of(np.where(small, 1.0, t)))
        value = np.where(small, 1.0, np.log(shape / np.where(small, 1.0, t)) + shape + 1)  # t = 0: exponential of mean 1
        return np.where(~small & (shape <= stat_fit.LEAST_SHAPE), np.inf, value)
    low = -1 / y.max()
    t = np.concatenate([low * (1 - np.geomspace(1e-6, 1, 120)), np.geomspace(1e-6, 50, 120)])
    t.sort()
    values = minus_likelihood(t)
    k = int(np.argmin(values))
    ends = t[max(k - 1, 0)], t[min(k + 1, len(t) - 1)]
    best = optimize.minimize_scalar(minus_likelihood, bounds=ends, method="bounded", options={"xatol": 1e-9}).x
    if minus_likelihood(best) > values[k]:
        best = t[k]
    shape = float(shape_of(best))
    scale = shape / best if abs(best) > 1e-8 else 1.0
    return unit * float(scale), shape


def clusters(time, peak, threshold, gap):
    """Largest peak of each cluster above the threshold; a cluster ends where none follows within the gap."""
    above = peak > threshold
    t, p = time[above], peak[above]
    if not len(t):
        return p
    order = np.argsort(t, kind="stable")
    t, p = t[order], p[order]
    starts = np.flatnonzero(np.concatenate([[True], np.diff(t) > gap]))
    return np.maximum.reduceat(p, starts)


def block_maxima(time, peak, start, hours, blocks):
    """Largest peak of each of so many equal blocks of a field, NaN where a block has none."""
    k = np.clip(((time - start) / (3600 * hours) * blocks).astype(int), 0, blocks - 1)
    out = np.full(blocks, np.nan)
    for i in range(blocks):
        if (k == i).any():
            out[i] = peak[k == i].max()
    return out


def level_of_gev(location, scale, shape, block_hours, return_hours):
    return float(stats.genextreme(-shape, loc=location, scale=scale).ppf(np.exp(-block_hours / return_hours)))


def level_of_gpd(threshold, scale, shape, rate, return_hours):
    """NaN where the threshold itself is exceeded less often than once in the return time."""
    times = rate * return_hours
    if times <= 1:
        return np.nan
    return threshold + (scale * np.log(times) if abs(shape) < 1e-8 else scale * np.expm1(shape * np.log(times)) / shape)


def _range(values):
    values = np.asarray(values, dtype=float)
    return [tuple(np.quantile(column[np.isfinite(column)], [0.025, 0.975])) if np.isfinite(column).sum() > 20 else (np.nan, np.nan) for column in values.T]


def _excesses(fields, threshold, gap):
    return [clusters(f["time"], f["peak"], threshold, gap) - threshold for f in fields]


def choose_threshold(fields, pooled, gap):
    """The level that the share SHARE of the peaks exceeds, or lower, up to half of them, until there are LEAST_EXCESSES clusters; None if there never are."""
    ordered, count = np.sort(pooled)[::-1], max(int(SHARE * len(pooled)), LEAST_EXCESSES)
    while count <= len(pooled) // 2:
        threshold = float(ordered[count])
        if sum(len(y) for y in _excesses(fields, threshold, gap)) >= LEAST_EXCESSES:
            return threshold
        count = int(1.1 * count) + 1
    return None


def over_threshold(fields, return_hours, gap, threshold=None, resamples=RESAMPLES):
    """Peaks over a threshold as a dict; {"refused": why} where there are too few. fields: dicts of time, peak, start, hours."""
    pooled, hours = np.concatenate([f["peak"] for f in fields]), sum(f["hours"] for f in fields)
    if threshold is None:
        threshold = choose_threshold(fields, pooled, gap)
        if threshold is None:
            return {"refused": f"{len(pooled)} collisions do not make {LEAST_EXCESSES} clusters {gap:.3g} s apart above any threshold that half of them exceed at most; run longer, more fields, or a shorter --gap"}
    each = _excesses(fields, threshold, gap)
    excess, raw = np.concatenate(each), int(np.sum(pooled > threshold))
    if len(excess) < LEAST_EXCESSES:
        return {"refused": f"{len(excess)} clusters above {threshold:.4g} N, needs {LEAST_EXCESSES}; run longer, more fields, or choose a lower --threshold"}
    rng, n = np.random.default_rng(SEED), len(fields)
    scale, shape = gpd(excess)
    rate = len(excess) / hours
    def levels(y, hours):
        s, k = gpd(y)
        return [k] + [level_of_gpd(threshold, s, k, len(y) / hours, T) for T in return_hours]
    drawn = []
    for _ in range(resamples):
        if n >= LEAST_FIELDS:
            pick = rng.integers(0, n, n)
            y, h = np.concatenate([each[i] for i in pick]), sum(fields[i]["hours"] for i in pick)
        else:
            y, h = stats.genpareto(shape, scale=scale).rvs(max(rng.poisson(len(excess)), 1), random_state=rng), hours
        if len(y) >= 5 and np.ptp(y) > 0:
            drawn.append(levels(y, h))
    ranges = _range(drawn) if drawn else [(np.nan, np.nan)] * (1 + len(return_hours))
    statistic = stat_fit.anderson_darling(excess, stats.genpareto(shape, scale=scale).cdf)
    def refit(y):
        s, k = gpd(y)
        return stats.genpareto(k, scale=s)
    return {"threshold": threshold, "excesses": raw, "clusters": len(excess), "gap_s": gap, "extremal_index": len(excess) / raw, "rate_per_hour": rate,
            "scale": scale, "shape": shape, "shape_95": ranges[0], "anderson_darling": statistic,
            "p_value": stat_fit.p_value(statistic, stats.genpareto(shape, scale=scale), len(excess), refit, resamples),
            "interval": "fields drawn anew" if n >= LEAST_FIELDS else "drawn from the fit: scatter between fields left out",
            "levels": [{"hours": T, "level": levels(excess, hours)[1 + i], "level_95": ranges[1 + i], "beyond_data": bool(T > hours)} for i, T in enumerate(return_hours)]}


def by_blocks(fields, return_hours, blocks=None, resamples=RESAMPLES):
    """Block maxima as a dict; {"refused": why} where there are too few, or blocks without a collision."""
    n = len(fields)
    blocks = blocks or int(np.ceil(LEAST_BLOCKS / n))
    lengths = np.array([f["hours"] for f in fields]) / blocks
    if np.ptp(lengths) > 0.01 * lengths.mean():
        return {"refused": "the runs are of different lengths: blocks would be, too"}
    each = [block_maxima(f["time"], f["peak"], f["start"], f["hours"], blocks) for f in fields]
    maxima = np.concatenate(each)
    empty = np.isnan(maxima)
    if len(maxima) < LEAST_BLOCKS:
        return {"refused": f"{len(maxima)} blocks, needs {LEAST_BLOCKS}; raise --blocks"}
    if empty.mean() > EMPTY:
        return {"refused": f"{empty.sum()} of {len(maxima)} blocks are without a collision; lower --blocks, or run longer"}
    rng, length = np.random.default_rng(SEED), float(lengths.mean())
    location, scale, shape = stat_fit.gev(maxima[~empty])
    def levels(x):
        fitted = stat_fit.gev(x)
        return [fitted[2]] + [level_of_gev(*fitted, length, T) for T in return_hours]
    drawn = []
    for _ in range(resamples):
        x = np.concatenate([each[i] for i in rng.integers(0, n, n)]) if n >= LEAST_FIELDS else stats.genextreme(-shape, loc=location, scale=scale).rvs(len(maxima), random_state=rng)
        x = x[np.isfinite(x)]
        if len(np.unique(x)) >= 5:
            drawn.append(levels(x))
    ranges, best = _range(drawn) if drawn else [(np.nan, np.nan)] * (1 + len(return_hours)), levels(maxima[~empty])
    fitted = stat_fit.fit("GEV", maxima[~empty], resamples)
    total = sum(f["hours"] for f in fields)
    return {"blocks": len(maxima), "block_hours": length, "empty": int(empty.sum()), "location": location, "scale": scale, "shape": shape, "shape_95": ranges[0],
            "anderson_darling": fitted.anderson_darling, "p_value": fitted.p_value,
            "interval": "fields drawn anew" if n >= LEAST_FIELDS else "drawn from the fit: scatter between fields left out",
            "levels": [{"hours": T, "level": best[1 + i], "level_95": ranges[1 + i], "beyond_data": bool(T > total)} for i, T in enumerate(return_hours)]}


def exceedance(fields):
    """(peaks N, largest first, times a hour that each is reached) of all fields together."""
    peaks = np.sort(np.concatenate([f["peak"] for f in fields]))[::-1] if fields else np.zeros(0)
    return peaks, np.arange(1, len(peaks) + 1) / max(sum(f["hours"] for f in fields), 1e-300)
