# SPDX-License-Identifier: MIT
"""Extremes of peaks or of a signal: rate of exceedance, block maxima (GEV), peaks over a threshold (GPD), return levels
with intervals.

A field is a dict: time s [n] and peak [n], in order, start s, hours. The peaks are those of collisions, or all samples
of a signal (stats/load.py). Both are treated the same way, since clusters are counted, not samples.

A level z with a return time of T hours of tow is exceeded once in T hours on average.
    empirical        rate(z) = number of peaks above z / hours
    block maxima     blocks of b hours, GEV G fitted to their largest peaks: z = G^-1(exp(-b/T))
    over threshold   clusters of peaks above u occur at a rate of L per hour, and the excess of a cluster's largest peak
                     is GPD with scale s and shape k: z = u + s ((L T)^k - 1)/k, L T > 1
[Coles 2001, An introduction to statistical modeling of extreme values, ch. 3-5]
Peaks above u that are closer to each other than the gap form one cluster: a floe that is pushed along hits repeatedly.
A level that is exceeded with probability p in a tow of T hours has the return time T / -ln(1 - p), since clusters at
high levels form a Poisson process.

Intervals are found by profile likelihood, widened for dependence within a field and scatter between fields
(stats/profile.py); with too few fields for that, by the likelihood alone. Either is a lower bound of the uncertainty,
because the model of the tail, the threshold, and that fields are alike (stats/alike.py) are assumed. Below a shape of
-1/2 maximum likelihood is irregular [Smith 1985, Biometrika 72]: the fitted end of the tail, and so the levels, are
only slightly above the largest peak; this is reported.

A load that something limits, such as a thrust at the bollard pull, stays at its largest value. Such a sample has no
tail, and is rejected with a message. Values that differ only by rounding count as equal (TIE): in a moving mean of such
a signal they differ by some 1e-14 of it, and a tail would be fitted to that.
"""
import numpy as np
import scipy

from bergtow.stats import fit as stat_fit
from bergtow.stats import profile as stat_profile

LEAST_EXCESSES = 30
LEAST_BLOCKS = 20
SHARE = 0.1          # of the peaks above the threshold; or more, until there are LEAST_EXCESSES clusters
IRREGULAR = -0.5     # shape: below this value the likelihood is irregular
EMPTY = 0.05         # share of blocks without a peak: above this value no GEV is fitted
RESAMPLES = 199       # of the p-values
FAR = 10.0           # times the size of a level: an upper end beyond it is no bound
TIE = 1e-9           # of the largest value: values that differ by less are the same
SATURATED = 0.1      # share of the clusters at the largest value: above, it is a limit, and excesses are not GPD


def tie(peak):
    """Largest difference between peaks that count as equal."""
    return TIE * float(np.abs(peak).max(initial=0.0))


def exceeds(peak, level):
    """[n] of bool: is a peak above the level by more than rounding?"""
    return peak > level + tie(peak)


def beyond(end, times, level, mean):
    """Is the upper end of a level's interval more than some times the size of the level? The size is the level itself:
    a load that is mostly drag is known well even if its varying part is not. Of a load that crosses zero, whose level
    may happen to be close to it, it is the height above the mean."""
    return end - level > (times - 1) * max(abs(level), level - mean)


def bounded(fields, level, ends):
    """The interval of a level of fields. An upper end beyond FAR is no bound, but shows that the sample does not
    determine the tail, and becomes infinite."""
    mean = np.mean(np.concatenate([f["peak"] for f in fields]))
    return ends[0], np.inf if beyond(ends[1], FAR, level, mean) else ends[1]


def commonest(values):
    """(the most frequent of these values, apart from rounding, and its count)."""
    x = np.sort(values)
    starts = np.flatnonzero(np.concatenate([[True], np.diff(x) > tie(x)]))
    counts = np.diff([*starts, len(x)])
    k = int(np.argmax(counts))
    return float(x[starts[k]]), int(counts[k])


def saturated(values, what):
    """Why values are not a sample of a tail: more than the share SATURATED of them equal the largest; "" if they are.
    what: the values, in words."""
    top = values.max(initial=-np.inf)
    there = int(np.sum(values >= top - tie(values)))
    return f"saturated at {top:.4g} N, which {there} of {len(values)} {what} reach and none exceeds" \
        if there > max(1, SATURATED * len(values)) else ""


def gpd(excess):
    """(scale, shape) by maximum likelihood, shape > stat_fit.LEAST_SHAPE.

    With t = shape/scale the most likely shape is mean ln(1 + t y), which leaves one unknown [Grimshaw 1993,
    Technometrics 35]. It is searched for on a grid, since there can be several maxima, and then refined.
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
        # t = 0: exponential with mean 1
        value = np.where(small, 1.0, np.log(shape / np.where(small, 1.0, t)) + shape + 1)
        return np.where(~small & (shape <= stat_fit.LEAST_SHAPE), 1e6, value)  # finite for differences
    low = -1 / y.max()
    t = np.concatenate([low * (1 - np.geomspace(1e-6, 1, 120)), np.geomspace(1e-6, 50, 120)])
    t.sort()
    values = minus_likelihood(t)
    k = int(np.argmin(values))
    ends = t[max(k - 1, 0)], t[min(k + 1, len(t) - 1)]
    best = scipy.optimize.minimize_scalar(minus_likelihood, bounds=ends, method="bounded", options={"xatol": 1e-9}).x
    if minus_likelihood(best) > values[k]:
        best = t[k]
    shape = float(shape_of(best))
    scale = shape / best if abs(best) > 1e-8 else 1.0
    return unit * float(scale), shape


def clusters(time, peak, threshold, gap):
    """Largest peak of each cluster above the threshold; a cluster ends if no other peak follows within the gap."""
    above = exceeds(peak, threshold)
    t, p = time[above], peak[above]
    if not len(t):
        return p
    order = np.argsort(t, kind="stable")
    t, p = t[order], p[order]
    starts = np.flatnonzero(np.concatenate([[True], np.diff(t) > gap]))
    return np.maximum.reduceat(p, starts)


def block_maxima(time, peak, start, hours, blocks):
    """Largest peak in each of the equal blocks of a field, NaN in a block without peaks."""
    k = np.clip(((time - start) / (3600 * hours) * blocks).astype(int), 0, blocks - 1)
    out = np.full(blocks, np.nan)
    np.fmax.at(out, k, peak)
    return out


def return_hours(probability, hours):
    """Return time of the level that is exceeded with this probability in a tow of this many hours."""
    return hours / -np.log1p(-probability)


def _excesses(fields, threshold, gap):
    return [clusters(f["time"], f["peak"], threshold, gap) - threshold for f in fields]


def choose_threshold(fields, pooled, gap, clusters_wanted=None):
    """The level that the share SHARE of the peaks exceeds; or a lower one, exceeded by at most half of them, that gives
    LEAST_EXCESSES clusters; None if none does. clusters_wanted, for a signal: the highest level with this many
    clusters, or the level with most of them."""
    ordered, wanted = np.sort(pooled)[::-1], clusters_wanted or LEAST_EXCESSES
    count, best = max(0 if clusters_wanted else int(SHARE * len(pooled)), wanted), (0, -np.inf)
    while count <= len(pooled) // 2:
        threshold = float(ordered[count])
        found = sum(len(y) for y in _excesses(fields, threshold, gap))
        if found >= wanted:
            return threshold
        best = max(best, (found, threshold))
        count = int((1.05 if clusters_wanted else 1.1) * count) + 1
    return best[1] if best[0] >= LEAST_EXCESSES else None


def over_threshold(fields, hours_of_levels, gap, threshold=None, resamples=RESAMPLES, what="collisions",
                   clusters_wanted=None):
    """Peaks over a threshold as a dict; {"refused": why} if there are too few. what: the peaks, in words."""
    pooled, hours = np.concatenate([f["peak"] for f in fields]), sum(f["hours"] for f in fields)
    if threshold is None:
        threshold = choose_threshold(fields, pooled, gap, clusters_wanted)
        if threshold is None:
            return {"refused": saturated(pooled, what) or f"too little data: fewer than {LEAST_EXCESSES} independent "
                    f"peaks ({gap:.3g} s apart) above any usable threshold; simulate longer or add fields"
                    + ("" if clusters_wanted else ", or `bergtow statistics` with a shorter --gap")}
    each = _excesses(fields, threshold, gap)
    excess, raw = np.concatenate(each), sum(int(np.sum(exceeds(f["peak"], threshold))) for f in fields)
    if len(excess) < LEAST_EXCESSES:
        return {"refused": f"{len(excess)} clusters above {threshold:.4g} N, needs {LEAST_EXCESSES}; run longer, more "
                           f"fields, or `bergtow statistics` with a lower --threshold"}
    if why := saturated(threshold + excess, "clusters"):
        return {"refused": why}
    scale, shape = gpd(excess)
    levels, shape_range = gpd_intervals(each, [f["hours"] for f in fields], threshold, scale, shape, hours_of_levels)
    def refit(y):
        s, k = gpd(y)
        return stat_fit.Frozen(scipy.stats.genpareto, k, scale=s)
    frozen = stat_fit.Frozen(scipy.stats.genpareto, shape, scale=scale)
    statistic = stat_fit.anderson_darling(excess, frozen.cdf)
    return {"threshold": threshold, "excesses": raw, "clusters": len(excess), "gap_s": gap,
            "extremal_index": len(excess) / raw, "rate_per_hour": len(excess) / hours, "scale": scale, "shape": shape,
            "shape_95": shape_range, "irregular": bool(shape < IRREGULAR), "anderson_darling": statistic,
            "p_value": stat_fit.p_value(statistic, frozen, len(excess), refit, resamples),
            "interval": interval_note(len(fields)),
            "levels": [{"hours": T, "level": z, "level_95": bounded(fields, z, ends), "beyond_data": bool(T > hours)}
                       for T, (z, ends) in zip(hours_of_levels, levels)]}


def interval_note(fields):
    if fields < stat_profile.LEAST_FIELDS:
        return "profile likelihood; scatter between fields left out: too few of them"
    return "profile likelihood, widened by the scatter between fields that are alike"


def gpd_minus_log_likelihood(log_scale, shape, y):
    """For excesses y [n]; log_scale and shape are numbers."""
    if not stat_fit.LEAST_SHAPE < shape < 10:
        return np.inf
    z = y * np.exp(-log_scale)
    if abs(shape) < 1e-7:
        return len(y) * log_scale + z.sum()
    inside = 1 + shape * z
    if len(y) and inside.min() <= 0:
        return np.inf
    return len(y) * log_scale + (1 + 1 / shape) * np.log(inside).sum()


def gpd_intervals(each, hours, threshold, scale, shape, hours_of_levels):
    """([(level, (low, high)) for each return time], (low, high) of the shape). each: excesses by field. In the profile
    the rate of clusters stays at its estimate; its error, from the counts of the fields, is included in the
    dispersion."""
    y, unit, hours, n = [x / scale for x in each], scale, np.asarray(hours, dtype=float), len(each)
    total = np.concatenate(y)
    rate = len(total) / hours.sum()
    best = np.array([0.0, shape, np.log(rate)])  # ln scale (in units of the fitted scale), shape, ln rate
    def by_field(theta):
        return np.array([gpd_minus_log_likelihood(theta[0], theta[1], x) - len(x) * theta[2] + np.exp(theta[2]) * h
                         for x, h in zip(y, hours)])
    def level(theta, T):
        return np.exp(theta[0]) * growth(theta[1], np.exp(theta[2]) * T)
    def alone(theta):
        return np.sum(by_field(np.append(theta, best[2])))
    levels = []
    for T in hours_of_levels:
        if rate * T <= 1:
            levels.append((np.nan, (np.nan, np.nan)))
            continue
        c = stat_profile.dispersion(by_field, lambda theta: level(theta, T), best)
        share = rate_share(alone, by_field, lambda theta: level(theta, T), best)
        z = level(best, T)
        def profile(q, rest):
            g = growth(rest[0], rate * T)
            return gpd_minus_log_likelihood(np.log(q / g), rest[0], total) if q > 0 and g > 0 else np.inf
        low, high = stat_profile.interval(profile, z, [shape], stat_profile.drop(n, c, share), 0.1 * z)
        levels.append((threshold + unit * z, (threshold + unit * max(low, 0.0), threshold + unit * high)))
    c = stat_profile.dispersion(lambda theta: by_field(np.append(theta, best[2])), lambda theta: theta[1], best[:2])
    ends = stat_profile.interval(lambda q, rest: gpd_minus_log_likelihood(rest[0], q, total), shape, [0.0],
                                 stat_profile.drop(n, c), 0.05)
    return levels, (max(ends[0], stat_fit.LEAST_SHAPE), ends[1])


def growth(shape, times):
    """((L T)^k - 1)/k."""
    return np.log(times) if abs(shape) < 1e-8 else np.expm1(shape * np.log(times)) / shape


def rate_share(alone, by_field, level, best):
    """Variance of the level with the error of the rate divided by that without it, from the likelihood."""
    def variance(f, g, theta):
        with np.errstate(invalid="ignore"):
            information = stat_profile.gradient(lambda t: stat_profile.gradient(f, t), theta)
        if not np.isfinite(information).all():
            return np.nan
        try:
            return float(g @ np.linalg.solve(0.5 * (information + information.T), g))
        except np.linalg.LinAlgError:
            return np.nan
    g = stat_profile.gradient(level, best)
    share = variance(lambda t: np.sum(by_field(t)), g, best) / variance(alone, g[:2], best[:2])
    return share if np.isfinite(share) and share >= 1 else 1.0


SHORT = 0.5  # relative to the median length of the fields: shorter ones do not determine the length of the blocks


def long_enough(fields):
    """The fields that are at least SHORT times as long as their median."""
    least = SHORT * np.median([f["hours"] for f in fields])
    return [f for f in fields if f["hours"] >= least]


def _blocks(fields, blocks):
    """(maxima of the blocks of each field, hours of a block). All blocks have the same length: a whole number of them
    fits into the shortest of the fields that are long enough. The rest of a field after its last whole block is left
    out, and so are fields without a whole block."""
    length, out = min(f["hours"] for f in long_enough(fields)) / blocks, []
    for f in fields:
        count = int(f["hours"] / length + 0.01)
        within = f["time"] <= f["start"] + 3600 * count * length * (1 + 1e-9)
        out.append(block_maxima(f["time"][within], f["peak"][within], f["start"], count * length, count))
    return out, length


def by_blocks(fields, hours_of_levels, blocks=None, resamples=RESAMPLES, what="a collision"):
    """Block maxima as a dict; {"refused": why} if there are too few, or blocks without a peak. blocks: per field; by
    default enough for LEAST_BLOCKS in all. what: a peak, in words."""
    n = len(fields)
    each, length = _blocks(fields, blocks or int(np.ceil(LEAST_BLOCKS / n)))
    maxima = np.concatenate(each)
    empty = np.isnan(maxima)
    if len(maxima) < LEAST_BLOCKS:
        return {"refused": f"{len(maxima)} blocks, needs {LEAST_BLOCKS}; raise --blocks (bergtow statistics)"}
    if empty.mean() > EMPTY:
        return {"refused": f"{empty.sum()} of {len(maxima)} blocks are without {what}; lower --blocks (bergtow "
                           "statistics), or run longer"}
    if why := saturated(maxima[~empty], "blocks"):
        return {"refused": why}
    value, same = commonest(maxima[~empty])
    if same > max(1, EMPTY * len(maxima)):
        return {"refused": f"the largest of {same} of {len(maxima)} blocks is the same, {value:.4g} N: no GEV"}
    total = len(maxima) * length
    there = [x[np.isfinite(x)] for x in each]
    fitted = stat_fit.fit("GEV", np.concatenate(there), resamples)
    if "refused" in fitted:
        return {"refused": f"block maxima: {fitted['refused']}"}
    location, scale, shape = (fitted["parameters"][k] for k in ("location", "scale", "shape"))
    levels, shape_range = gev_intervals(there, location, scale, shape, [length / T for T in hours_of_levels])
    return {
        "blocks": len(maxima), "block_hours": length, "hours": total, "without_block": sum(len(x) == 0 for x in each),
        "empty": int(empty.sum()), "location": location, "scale": scale,
        "shape": shape, "shape_95": shape_range, "irregular": bool(shape < IRREGULAR),
        "anderson_darling": fitted["anderson_darling"], "p_value": fitted["p_value"], "interval": interval_note(n),
        "levels": [{"hours": T, "level": z, "level_95": bounded(fields, z, ends), "beyond_data": bool(T > total)}
                   for T, (z, ends) in zip(hours_of_levels, levels)]}


def gev_intervals(each, location, scale, shape, shares):
    """([(level, (low, high)) exceeded once in 1/share blocks], (low, high) of the shape). each: block maxima by
    field."""
    y, n = [(x - location) / scale for x in each], len(each)
    total, best = np.concatenate(y), np.array([0.0, 0.0, shape])
    def by_field(theta):
        return np.array([stat_fit.gev_minus_log_likelihood(theta, x) if len(x) else 0.0 for x in y])
    def height(k, share):
        """(level - location)/scale: (share^-k - 1)/k, since -ln exp(-share) = share."""
        return -np.log(share) if abs(k) < 1e-8 else np.expm1(-k * np.log(share)) / k
    levels = []
    for share in shares:
        z = height(shape, share)
        def profile(q, rest):
            return stat_fit.gev_minus_log_likelihood(
                (q - np.exp(rest[0]) * height(rest[1], share), rest[0], rest[1]), total) if rest[1] < 10 else np.inf
        c = stat_profile.dispersion(by_field, lambda t: t[0] + np.exp(t[1]) * height(t[2], share), best)
        low, high = stat_profile.interval(profile, z, [0.0, shape], stat_profile.drop(n, c), 0.2 * (1 + abs(z)))
        levels.append((location + scale * z, (location + scale * low, location + scale * high)))
    c = stat_profile.dispersion(by_field, lambda t: t[2], best)
    ends = stat_profile.interval(lambda q, rest: stat_fit.gev_minus_log_likelihood((rest[0], rest[1], q), total), shape,
                                 [0.0, 0.0], stat_profile.drop(n, c), 0.05)
    return levels, (max(ends[0], stat_fit.LEAST_SHAPE), ends[1])


def exceedance(fields):
    """(peaks N, in descending order, rate per hour at which each is reached) over all fields."""
    peaks = np.sort(np.concatenate([f["peak"] for f in fields]))[::-1] if fields else np.zeros(0)
    return peaks, np.arange(1, len(peaks) + 1) / max(sum(f["hours"] for f in fields), 1e-300)
