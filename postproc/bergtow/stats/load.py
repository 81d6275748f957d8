# SPDX-License-Identifier: MIT
"""Statistics of a load as it acts on a structure: of its whole signal, with quasi-static loads and collisions alike,
filtered to a time scale.

A time step gives an impulse, and impulse / dt is a mean over the step: with half the step the largest of them is up to
twice as large, and no structure ever carries it. So the signal is first averaged over a time scale S, by a moving mean
of the impulses,
    x_S(t) = (1/S) integral of x from t - S to t,
which no longer depends on the step once S is several steps, and which needs no assumption about the duration of a
collision while S is longer than that. The mean does not wait for the filter: its first value is at S after the start of
the window, so it contains nothing of the start-up. All earlier moving means count as the start-up, including those that
extend from before the window into it: a peak across the start of the window is in one of the two.

Fields are independent, samples within a field are not. Means: Student's t over the means of fields. Standard deviation,
quantiles and shares of time of all samples, and rates: the jackknife over fields, value +- t se with
    se^2 = (n - 1)/n sum (v_i - v)^2,      v_i the number without field i      [Efron & Tibshirani 1993, ch. 11]
applied to the logarithm of standard deviations and rates and to the logit of shares, because with few fields symmetric
intervals extend to impossible values. If a load is never negative, the intervals of its mean and quantiles end at 0.
All fields weigh alike, however long: a sample weighs 1 / the length of its field. Windows differ where lines part, and
a long one would outvote the others in a quantile but not in the mean. Rates and return levels are numbers of events in
all hours. Extremes: stats/extreme.py, from all samples, where clusters are separated by two correlation times of the
filtered signal, or at least S.
"""
import numpy as np
import scipy

from bergtow.result.run import within
from bergtow.stats import extreme as stat_extreme
from bergtow.stats import mean as stat_mean

QUANTILES = (5, 25, 50, 75, 95, 99)
LEAST_SCALES = 5      # time scales that a usable window must contain
RESAMPLES = 49        # for p-values, at most: there are many loads
LEVELS = 16           # of the exceedance table, from the median to the largest value
#: approximate number of clusters above the threshold, and of block maxima. In a correlated signal a tenth of the
#: samples is far too many for a GPD tail: intervals of the level for ten times the simulated hours then contained it in
#: two sets of three, with 60 clusters in 92 % or more (README.md)
CLUSTERS = 60
BLOCKS = 40
PLAIN, LOG = (np.asarray, np.asarray), (np.log, np.exp)
LOGIT = lambda p: np.log(p / (1 - p)), lambda x: 1 / (1 + np.exp(-x))
LEAST_GAPS = 4        # a block is at least this many cluster gaps long, otherwise its maxima are not independent


def moving_mean(x, n):
    """Means of n consecutive samples along the first axis, [len(x) - n + 1, ...]."""
    total = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)])
    return (total[n:] - total[:-n]) / n


def samples_of(scale, dt):
    """Samples dt apart in a time scale."""
    return max(1, int(round(scale / dt)))


def field_of(time, x, start, end, scale):
    """The filtered signal of one field between two times in the format of stats/extreme.py, with its sampling interval
    dt and the effective time scale, s; None if the window is shorter than LEAST_SCALES of these, or the load is not
    defined throughout.

    Samples x [n] are means up to their time. For x [n, k] each column is filtered separately, and the largest is taken.
    """
    there = within(time, start, end)
    time, x = time[there], x[there]
    if len(time) < 2 or not np.isfinite(x).all():
        return None
    dt = float(np.median(np.diff(time)))
    n = samples_of(scale, dt)
    if len(x) < LEAST_SCALES * n:
        return None
    y = moving_mean(x, n) if n > 1 else x
    return {"time": time[n - 1:], "peak": y if y.ndim == 1 else y.max(axis=1), "start": float(time[n - 1]) - dt,
            "hours": len(y) * dt / 3600, "dt": dt, "scale": n * dt}


def start_up(time, x, start, end, scale):
    """The largest of the means, as in field_of, that begin before the window, even if that window is too short; with
    its time and the effective time scale: {"largest", "time_s", "scale"}; None if there is none."""
    there = within(time, -np.inf, end)
    time, x = time[there], x[there]
    if len(time) < 2:
        return None
    dt = float(np.median(np.diff(time)))
    n = samples_of(scale, dt)
    last = int(np.sum(~within(time, start, np.inf))) + n - 1
    time, x = time[:last], x[:last]
    if len(x) < n:
        return None
    there = np.isfinite(x)
    y = moving_mean(np.where(there, x, 0.0), n)
    y = np.where(moving_mean(1.0 * ~there, n) > 0.5 / n, -np.inf, y)
    y = y if y.ndim == 1 else y.max(axis=1)
    k = int(np.argmax(y))
    return {"largest": float(y[k]), "time_s": float(time[n - 1 + k]), "scale": n * dt} if np.isfinite(y[k]) else None


def jackknife(value, without, low=-np.inf, high=np.inf, scale=None, level=stat_mean.LEVEL):
    """Interval at this level of a value, within [low, high], from its values without each of the fields; NaN ends for
    one field. scale: (function, its inverse); the interval is symmetric in the function if that is finite throughout.
    """
    n, without = len(without), np.asarray(without)
    if n < 2 or not np.isfinite([value, *without]).all():
        return np.nan, np.nan
    there, back = scale or PLAIN
    with np.errstate(divide="ignore", invalid="ignore"):
        if not np.isfinite(there(np.array([value, *without]))).all():
            there, back = PLAIN
    x = there(without)
    half = scipy.stats.t.ppf(0.5 + level / 2, n - 1) * np.sqrt((n - 1) / n * np.sum((x - x.mean()) ** 2))
    return tuple(float(np.clip(back(there(value) + k * half), low, high)) for k in (-1, 1))


def weights(samples):
    """The weight of each sample of all fields together, 1 in all; None if fields are equally long. samples: [fields] of
    arrays, as below."""
    lengths = np.array([len(x) for x in samples])
    return None if np.ptp(lengths) == 0 else np.repeat(1 / (len(samples) * lengths), lengths)


def percentile(samples, q):
    """The quantile q, %, of all fields together. Linear between samples, each in the middle of its weight, from the
    first to the last: with equal weights numpy's percentile, which is faster."""
    x, w = np.concatenate(samples), weights(samples)
    if w is None:
        return float(np.percentile(x, q))
    order = np.argsort(x)
    x, w = x[order], w[order]
    middle = np.cumsum(w) - w / 2
    return float(np.interp(q / 100, (middle - middle[0]) / (middle[-1] - middle[0]), x))


def deviation(samples):
    """Standard deviation of all fields together, unbiased for independent samples."""
    x, w = np.concatenate(samples), weights(samples)
    if np.ptp(x) <= stat_extreme.tie(x):  # rounding is no scatter
        return 0.0
    if w is None:
        return float(np.std(x, ddof=1))
    return float(np.sqrt(w @ (x - w @ x) ** 2 / (1 - w @ w)))


def over_fields(statistic, samples, low=-np.inf, scale=None):
    """A statistic of the samples of all fields together, with its interval."""
    without = [statistic(samples[:i] + samples[i + 1:]) for i in range(len(samples))] if len(samples) > 1 else [np.nan]
    value = statistic(samples)
    return {"value": value, "interval_95": jackknife(value, without, low, np.inf, scale)}


def ratio_over_fields(counts, sizes, high=np.inf, scale=LOG, events=None):
    """Sum of counts / sum of sizes, one of each per field, with its interval. Equal counts leave the jackknife no
    scatter: the interval then covers at least that of a Poisson number of events [Garwood 1936]. events: their number
    in each field, if the counts are of something else."""
    counts, sizes = np.asarray(counts, dtype=float), np.asarray(sizes, dtype=float)
    without, value = (counts.sum() - counts) / np.maximum(sizes.sum() - sizes, 1e-300), counts.sum() / sizes.sum()
    ends = jackknife(value, without, 0.0, high, scale)
    if 0 < counts.min() == counts.max():
        n, level = counts.sum() if events is None else events, stat_mean.LEVEL
        low, top = scipy.stats.chi2.ppf([0.5 - level / 2, 0.5 + level / 2], [2 * n, 2 * n + 2]) / (2 * n) * value
        ends = float(np.minimum(ends[0], low)), float(np.minimum(np.maximum(ends[1], top), high))  # NaN stays
    return {"value": value, "interval_95": ends}


def least_of(samples):
    """Lower limit for an interval of a load: 0, unless some samples are below."""
    return 0.0 if all(np.min(x) >= 0 for x in samples) else -np.inf


def mean_over_fields(means, low):
    """Interval of the mean of fields, cut off at low."""
    return tuple(np.maximum(stat_mean.t_interval(means), low))


def constant(fields):
    """Is a signal constant over all fields, apart from rounding? Such differences do not count."""
    peaks = np.concatenate([f["peak"] for f in fields])
    return bool(np.ptp(peaks) <= stat_extreme.tie(peaks))


def gap_of(fields):
    """Time without exceedance that ends a cluster, s: two correlation times, over the fields in which the signal
    changes, but at least a time scale."""
    taus = [stat_mean.series_mean(f["peak"]).tau * f["dt"] for f in fields if not constant([f])]
    return float(max(2 * np.nanmedian(taus) if taus else 0.0, max(f["scale"] for f in fields)))


def exceedance(fields, gap):
    """Rows of level, share of the time above it, and rate per hour of exceedance, counting a cluster once; none of a
    constant signal."""
    if constant(fields):
        return []
    samples, out = [f["peak"] for f in fields], []
    for level in np.linspace(percentile(samples, 50), max(x.max() for x in samples), LEVELS + 1)[:-1]:
        above = [np.mean(stat_extreme.exceeds(x, level)) for x in samples]
        clusters = [len(stat_extreme.clusters(f["time"], f["peak"], level, gap)) for f in fields]
        out.append({
            "level": level,
            "share_of_time": ratio_over_fields(above, np.ones(len(fields)), 1.0, LOGIT, sum(clusters)),
            "per_hour": ratio_over_fields(clusters, [f["hours"] for f in fields])})
    return out


def summary(fields):
    """Mean, standard deviation, quantiles, largest and smallest value, with intervals over fields."""
    samples = [f["peak"] for f in fields]
    means, least = np.array([x.mean() for x in samples]), least_of(samples)
    return {
        "mean": {"value": means.mean(), "interval_95": mean_over_fields(means, least)},
        "sd": over_fields(deviation, samples, 0.0, LOG),
        "quantiles": {str(q): over_fields(lambda some, q=q: percentile(some, q), samples, least) for q in QUANTILES},
        "largest": max(x.max() for x in samples),
        "smallest": min(x.min() for x in samples)}


def extremes(fields, gap, hours_of_levels, resamples):
    """Peaks over a threshold, with the maxima of the clusters, and block maxima of the signal."""
    resamples = min(resamples, RESAMPLES)
    over = stat_extreme.over_threshold(fields, hours_of_levels, gap, None, resamples, "samples", CLUSTERS)
    if "refused" not in over:
        found = [stat_extreme.clusters(f["time"], f["peak"], over["threshold"], gap) for f in fields]
        over["maxima"] = np.sort(np.concatenate(found))[::-1]
    return {"over_threshold": over, "block_maxima": _block_maxima(fields, gap, hours_of_levels, resamples)}


def _block_maxima(fields, gap, hours_of_levels, resamples):
    longest = int(3600 * np.median([f["hours"] for f in fields]) / (LEAST_GAPS * gap))
    blocks = min(int(np.ceil(BLOCKS / len(fields))), longest)
    if blocks * len(fields) < stat_extreme.LEAST_BLOCKS:
        return {"refused": f"blocks of {LEAST_GAPS * gap:.3g} s, {LEAST_GAPS} times what separates clusters, are fewer "
                           f"than {stat_extreme.LEAST_BLOCKS}; run longer, or more fields"}
    return stat_extreme.by_blocks(fields, hours_of_levels, blocks, resamples, "a sample")
