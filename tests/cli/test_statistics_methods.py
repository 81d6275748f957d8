# SPDX-License-Identifier: MIT
"""The methods behind postproc/ensemble.py against known answers: coverage of intervals, SciPy's fits, closed forms of
extremes and of sensitivities."""

import numpy as np
import pytest
from scipy import signal, stats

from bergtow.stats import extreme as stat_extreme
from bergtow.stats import fit as stat_fit
from bergtow.stats import mean as stat_mean
from bergtow.stats import profile as stat_profile
from bergtow.stats import sensitivity as stat_sensitivity

TRIALS = 2000


def series(phi, n, trials, seed):
    """[trials, n] stationary AR(1) series of mean 0 and variance 1."""
    rng = np.random.default_rng(seed)
    first, noise = rng.standard_normal((trials, 1)), rng.normal(0, np.sqrt(1 - phi * phi), (trials, n))
    return signal.lfilter([1], [1, -phi], noise, axis=1, zi=phi * first)[0]


@pytest.mark.parametrize("phi, n", [(0.0, 200), (0.5, 100), (0.5, 400), (0.9, 400), (0.9, 1000), (0.98, 5000)])
def test_95_percent_of_the_intervals_within_a_run_hold_the_mean(phi, n):
    x = series(phi, n, TRIALS, 5)
    found = [stat_mean.series_mean(row) for row in x]
    low, high = np.array([(f.low, f.high) for f in found]).T
    assert 0.95 <= np.mean((low <= 0) & (high >= 0)) <= 0.985  # on the safe side: the larger of two estimates
    # the standard error is right on the average, but for that: var(m) = (1 + phi)/(1 - phi)/n, less what the ends of
    # the series lack
    true = ((1 + phi) / (1 - phi) - 2 * phi * (1 - phi ** n) / (n * (1 - phi) ** 2)) / n
    assert 1 <= np.sqrt(np.mean([f.se ** 2 for f in found])) / np.sqrt(true) <= 1.2
    if phi > 0:  # what the degrees of freedom are for
        assert np.mean(np.abs([f.mean / f.se for f in found]) < 1.96) < np.mean((low <= 0) & (high >= 0))


def test_the_mean_of_series_that_are_none():
    steady = stat_mean.series_mean([3.0] * 50)
    assert (steady.low, steady.high) == (3.0, 3.0)
    assert np.isnan(stat_mean.series_mean([1.0]).se) and np.isnan(stat_mean.series_mean([1.0, np.nan]).se) and np.isnan(
        stat_mean.series_mean([]).mean)
    # anticorrelated: the mean is better known than of white noise, but not without error
    swinging = stat_mean.series_mean((-1.0) ** np.arange(200))
    assert 1 / 200 <= swinging.se * np.sqrt(200) < 1


@pytest.mark.parametrize("n", [8, 20])
def test_95_percent_of_the_intervals_between_fields_hold_the_mean(n):
    x = np.random.default_rng(7).normal(3, 1, (TRIALS, n))
    t = np.array([stat_mean.t_interval(row) for row in x])
    rng = np.random.default_rng(8)
    b = np.array([stat_mean.studentised_interval(row, resamples=499, rng=rng) for row in x])
    for low, high in (t.T, b.T):
        assert 0.93 <= np.mean((low <= 3) & (high >= 3)) <= 0.97
    median = np.array([stat_mean.median_interval(row) for row in x])
    assert 0.95 - 0.012 <= np.mean((median[:, 0] <= 3) & (median[:, 1] >= 3)) <= 1


@pytest.mark.parametrize("shared", [True, False])
def test_95_percent_of_the_intervals_over_conditions_hold_the_mean(shared):
    """Conditions of means far apart, on the same fields or on fields of their own; of one condition it is t_interval.
    Red when all members are taken for one sample: that holds the mean always, by intervals too long, or too seldom."""
    rng, levels, n, hit = np.random.default_rng(11), (0.0, 10.0, 20.0), 6, []
    for _ in range(TRIALS):
        field = rng.normal(0, 1, (1 if shared else len(levels), n))
        x = np.array(levels)[:, None] + field + rng.normal(0, 0.3, (len(levels), n))
        cells = [{(0 if shared else k, r): v for r, v in enumerate(row)} for k, row in enumerate(x)]
        mean, low, high = stat_mean.mean_of_conditions(cells)
        hit.append(low <= 10 <= high)
    assert mean == pytest.approx(x.mean()) and 0.93 <= np.mean(hit) <= 0.97
    one = stat_mean.mean_of_conditions(cells[:1])
    assert one[1:] == pytest.approx(stat_mean.t_interval(x[0]), rel=1e-12) and one[0] == pytest.approx(x[0].mean())
    assert np.isnan(stat_mean.mean_of_conditions([{1: 2.0}, {1: 3.0, 2: 4.0}])[1:]).all()


@pytest.mark.parametrize("levels, n", [((1, 4, 16), 2), ((1, 4, 16), 4), ((1, 1, 1), 6)])
def test_the_interval_over_conditions_knows_which_of_them_scatters(levels, n):
    """Fields scatter in proportion to their mean, so that the fastest tow has nearly all of the variance. Red: freedom
    of all fields together, with which two fields each held the mean in 86 % of the draws."""
    rng, hit = np.random.default_rng(14), []
    for _ in range(TRIALS):
        x = np.array(levels)[:, None] * (1 + 0.3 * rng.normal(size=(len(levels), n)))
        _, low, high = stat_mean.mean_of_conditions([{(k, r): v for r, v in enumerate(row)} for k, row in enumerate(x)])
        hit.append(low <= np.mean(levels) <= high)
    assert 0.93 <= np.mean(hit) <= 0.97
    assert stat_mean.mean_of_conditions([{1: 2.0, 2: 2.0}, {3: 4.0, 4: 4.0}]) == (3.0, 3.0, 3.0)


@pytest.mark.parametrize("scatter, n, shared", [((0.9, 0.3), 8, False), ((0.3, 0.3), 4, False), ((0.9, 0.3), 8, True)])
def test_the_exponent_is_that_of_the_means(scatter, n, shared):
    """Fields whose mean is the square of the speed, and which scatter more at one speed. Red: the slope of the
    logarithms of the fields, on average 2.6, whose interval holds 2 in 87 % of the draws."""
    rng, hit, found = np.random.default_rng(15), [], []
    for _ in range(TRIALS // 2):
        level = rng.uniform(size=n)  # of a field that both speeds share
        x = [v ** 2 * stats.gamma.ppf(level if shared else rng.uniform(size=n), s ** -2) * s ** 2
             for v, s in zip((1, 2), scatter)]
        exponent, low, high = stat_mean.power_of_conditions([1, 2], [
            {(0 if shared else k, r): v for r, v in enumerate(y)} for k, y in enumerate(x)])
        assert exponent == pytest.approx(np.log2(x[1].mean() / x[0].mean()))
        hit.append(low <= 2 <= high)
        found.append(exponent)
    assert 0.93 <= np.mean(hit) <= 0.97 and np.mean(found) == pytest.approx(2, abs=0.12)
    alone = stat_mean.power_of_conditions([1, 2], [{1: 1.0}, {1: 4.0}])
    assert alone[0] == pytest.approx(2) and np.isnan(alone[1:]).all()
    one_hit = stat_mean.power_of_conditions([1, 2], [{1: 1.0, 2: 0.0}, {1: 4.0, 2: 4.0}])
    assert one_hit[0] == pytest.approx(3) and np.isnan(one_hit[1:]).all()  # no exponent without the first field
    assert stat_mean.power_of_conditions([1, 2], [{1: 0.0, 2: 0.0}, {1: 4.0, 2: 4.0}]) is None
    assert stat_mean.power_of_conditions([2, 2], [{1: 1.0}, {2: 4.0}]) is None
    assert stat_mean.power_of_conditions([0, 2], [{1: 1.0}, {2: 4.0}]) is None  # red: NaN, a body that is held


def test_the_studentised_bootstrap_follows_skewness():
    x = np.random.default_rng(9).lognormal(0, 1, (600, 20))
    truth, rng = np.exp(0.5), np.random.default_rng(10)
    def miss(intervals):
        return np.mean([high < truth for _, high in intervals])  # dense ice: a mean too low, since no field jammed

    assert miss([stat_mean.studentised_interval(row, resamples=499, rng=rng)
                 for row in x]) < 0.6 * miss([stat_mean.t_interval(row) for row in x])


def test_fields_needed_is_the_least_that_does():
    for ratio in (0.02, 0.1, 0.5, 2.0):
        n = stat_mean.fields_needed(10.0, 10 * ratio, 0.05)
        def width(k):
            return stats.t.ppf(0.975, k - 1) * ratio / np.sqrt(k)
        assert width(n) <= 0.05 and (n == 2 or width(n - 1) > 0.05)
    assert np.isnan(stat_mean.fields_needed(0.0, 1.0, 0.05)) and np.isnan(stat_mean.fields_needed(1.0, np.nan, 0.05))


def test_numbers_of_fields():
    x = [1.0, 2, 3, 4, 5, 6, 7, 100]
    r = stat_mean.between_fields(x, [0.5] * 8)
    assert r["mean"] == 16 and r["median"] == 4.5 and r["trimmed_mean"] == 4.5 and r[
        "largest_share"] == 100 / 128 and r["trimmed_each_end"] == 1
    assert r["sd_of_fields"] == pytest.approx(np.sqrt(np.var(x, ddof=1) - 0.25)) and r["se_between"] == pytest.approx(
        np.std(x, ddof=1) / np.sqrt(8))
    assert r["median_95"] == (1, 100)  # of eight: the inner pair would cover 93 %
    one = stat_mean.between_fields([2.0], [0.1])
    assert one["mean"] == 2 and np.isnan(one["t_95"]).all() and np.isnan(one["fields_needed"])
    assert stat_mean.between_fields([], []) == {"n": 0}


# ---- distributions

SAMPLE = {
    "normal": stats.norm(5, 1), "lognormal": stats.lognorm(0.5, scale=3), "Weibull": stats.weibull_min(1.7, scale=2),
    "gamma": stats.gamma(3, scale=2), "GEV": stats.genextreme(-0.15, loc=3, scale=1)
}
SCIPY = {
    "normal": lambda x: stats.norm(*stats.norm.fit(x)),
    "lognormal": lambda x: stats.lognorm(*stats.lognorm.fit(x, floc=0)),
    "Weibull": lambda x: stats.weibull_min(*stats.weibull_min.fit(x, floc=0)),
    "gamma": lambda x: stats.gamma(*stats.gamma.fit(x, floc=0)),
    "GEV": lambda x: stats.genextreme(*stats.genextreme.fit(x))
}


@pytest.mark.parametrize("name", stat_fit.DISTRIBUTIONS)
def test_fits_have_scipys_likelihood(name):
    for scale in (1.0, 1e6):  # N of a model, N of a berg
        x = scale * SAMPLE[name].rvs(300, random_state=4)
        f = stat_fit.fit(name, x, resamples=0)
        theirs = SCIPY[name](x if scale == 1 else x / scale)
        assert f["log_likelihood"] >= np.sum(theirs.logpdf(x / scale)) - 300 * np.log(scale) - 1e-4
        k = 3 if name == "GEV" else 2
        assert f["aic"] == pytest.approx(2 * k - 2 * f["log_likelihood"])
        assert f["kolmogorov_smirnov"] == stats.kstest(x, stat_fit.DISTRIBUTIONS[name][0](x)[1].cdf).statistic
        few = stat_fit.fit(name, x[:12], resamples=0)  # of twelve values a third parameter costs 1.7 more than AIC says
        assert few["aicc"] - few["aic"] == pytest.approx(3 if k == 3 else 4 / 3)
    assert stat_fit.gev_minus_log_likelihood(
        [3, np.log(2), 0.15], x / scale) == pytest.approx(-np.sum(stats.genextreme(-0.15, 3, 2).logpdf(x / scale)))


def test_fits_see_no_strides(monkeypatch):
    """numpy's last bits of log and exp depend on what lies behind a view with strides; see fit()."""
    for name, (make, k, positive) in stat_fit.DISTRIBUTIONS.items():
        seen = []
        monkeypatch.setitem(stat_fit.DISTRIBUTIONS, name,
                            (lambda x, make=make, seen=seen: seen.append(x.flags.c_contiguous) or make(x), k, positive))
        found = stat_fit.fit(name, stats.weibull_min(4).rvs(100, random_state=2)[::4], 2)
        assert "refused" not in found and seen == [True] * 3


def test_anderson_darling_is_scipys():
    x = stats.norm(0, 1).rvs(80, random_state=1)
    assert stat_fit.anderson_darling(x, stats.norm(x.mean(),
                                                   x.std(ddof=1)).cdf) == pytest.approx(stats.anderson(x).statistic)


def test_p_values_are_uniform_where_the_model_is_true_and_small_where_it_is_not():
    rng = np.random.default_rng(12)
    make, p = stat_fit.DISTRIBUTIONS["lognormal"][0], []
    for _ in range(100):
        x = rng.lognormal(0, 0.5, 30)
        fitted = make(x)[1]
        p.append(stat_fit.p_value(stat_fit.anderson_darling(x, fitted.cdf), fitted, 30, lambda y: make(y)[1], 39, rng))
    assert stats.kstest(p, "uniform").pvalue > 0.01  # with tables for known parameters nearly all would be near 1
    x = rng.lognormal(0, 1, 100)
    assert stat_fit.fit("normal", x, 99)["p_value"] == 0.01 and stat_fit.fit_all(x, 0)[0]["name"] == "lognormal"


def test_what_no_distribution_is_fitted_to():
    assert "needs 8" in stat_fit.fit("normal", [1, 2, 3])["refused"]
    assert "same" in stat_fit.fit("gamma", [2.0] * 20)["refused"]
    x = np.arange(-2.0, 18)
    assert "3 values are not positive" in stat_fit.fit("Weibull", x)["refused"]
    assert "refused" not in stat_fit.fit("normal", x, 0)
    assert ["refused" in f for f in stat_fit.fit_all(x, 0)] == [False, False, True, True, True]


# ---- extremes

@pytest.mark.parametrize("shape", [-0.3, 0.0, 0.25])
def test_gpd_has_scipys_likelihood(shape):
    y = stats.genpareto(shape, scale=2e5).rvs(400, random_state=2)
    scale, found = stat_extreme.gpd(y)
    theirs = stats.genpareto.fit(y, floc=0)
    assert np.sum(stats.genpareto(found, scale=scale).logpdf(y)) >= np.sum(stats.genpareto(*theirs).logpdf(y)) - 1e-3
    assert found == pytest.approx(shape, abs=0.15)


def test_clusters_and_blocks_by_hand():
    time, peak = np.array([1.0, 2, 3, 10, 11, 30, 31]), np.array([5.0, 9, 1, 7, 8, 6, 2])
    assert list(stat_extreme.clusters(time, peak, 4, 2)) == [9, 8, 6]
    assert list(stat_extreme.clusters(time, peak, 4, 0.5)) == [5, 9, 7, 8, 6]
    # 2 to 10 s is within the gap
    assert list(stat_extreme.clusters(time, peak, 4, 6.9)) == [9, 8, 6] and list(stat_extreme.clusters(
        time, peak, 4, 8)) == [9, 6]
    assert len(stat_extreme.clusters(time, peak, 9, 2)) == 0        # above, not at
    found = stat_extreme.block_maxima(time, peak, 0, 40 / 3600, 4)
    assert list(found[[0, 1, 3]]) == [9, 8, 6] and np.isnan(found[2])
    peaks, rate = stat_extreme.exceedance([{"peak": peak[:3], "hours": 2}, {"peak": peak[3:], "hours": 2}])
    assert list(peaks[:2]) == [9, 8] and list(rate[:2]) == [0.25, 0.5]


def poisson_fields(rng, n, hours=1.0, rate=400.0, scale=50.0, shape=0.0, factor=None):
    """Fields of collisions at random times, their peaks exponential or GPD."""
    out = []
    for i in range(n):
        k = rng.poisson(rate * hours)
        t = np.sort(rng.uniform(0, 3600 * hours, k))
        out.append({
            "time": t, "peak": stats.genpareto(shape, scale=scale).rvs(k, random_state=rng) *
            (factor[i] if factor is not None else 1), "start": 0.0, "hours": hours
        })
    return out


def test_return_levels_of_exponential_peaks():
    fields = poisson_fields(np.random.default_rng(3), 12)
    T = [1.0, 10.0, 100.0]
    over, blocks = stat_extreme.over_threshold(fields, T, gap=0.0, resamples=39), stat_extreme.by_blocks(fields,
                                                                                                         T,
                                                                                                         blocks=4,
                                                                                                         resamples=39)
    for found in (over, blocks):
        for level, hours in zip(found["levels"], T):
            true = 50 * np.log(400 * hours)  # exceeded 400 exp(-z/50) times a hour
            assert level["level_95"][0] < true < level["level_95"][1] and level["level"] == pytest.approx(
                true, rel=0.15), (found, hours)
            assert level["beyond_data"] == (hours > 12)
        assert found["shape_95"][0] < 0 < found["shape_95"][1] and found["p_value"] > 0.05
    assert over["extremal_index"] == 1 and over["rate_per_hour"] == pytest.approx(over["clusters"] / 12)
    assert blocks["block_hours"] == 0.25 and blocks["blocks"] == 48


def test_a_field_that_is_unlike_the_others_widens_the_interval():
    rng = np.random.default_rng(4)
    alike, unlike = poisson_fields(rng, 10, rate=100), poisson_fields(rng, 10, rate=100, factor=[1] * 8 + [4, 4])
    a, b = (stat_extreme.over_threshold(f, [10.0], 0.0, threshold=100.0, resamples=1)["levels"][0]
            for f in (alike, unlike))
    assert (b["level_95"][1] - b["level_95"][0]) / b["level"] > 1.5 * (a["level_95"][1] - a["level_95"][0]) / a["level"]


def test_intervals_of_return_levels_hold_the_level():
    rng, true, hits = np.random.default_rng(13), 50 * np.log(100 * 10.0), []
    for _ in range(40):
        [(_, (low, high))], _ = stat_extreme.gpd_intervals(*tail(poisson_fields(rng, 12, rate=100), 100.0), [10.0])
        hits.append(low <= true <= high)
    # percentiles of a bootstrap over fields hold it in three quarters (stat_profile.py)
    assert sum(hits) >= stats.binom.ppf(1e-3, 40, 0.95)


def tail(fields, threshold):
    """Arguments of gpd_intervals for peaks over a threshold."""
    each = [f["peak"][f["peak"] > threshold] - threshold for f in fields]
    return each, [f["hours"] for f in fields], threshold, *stat_extreme.gpd(np.concatenate(each))


@pytest.mark.parametrize("T", [3.0, 100.0])
def test_profile_intervals_are_those_of_the_likelihood_region(T, monkeypatch):
    monkeypatch.setattr(stat_extreme, "rate_share", lambda *_: 1.0)
    # four fields: the likelihood alone
    each, hours, threshold, scale, shape = tail(poisson_fields(np.random.default_rng(15), 4, rate=100), 100.0)
    y, rate = np.concatenate(each), sum(map(len, each)) / 4
    [(level, ends)], shape_ends = stat_extreme.gpd_intervals(each, hours, threshold, scale, shape, [T])
    a, k = np.meshgrid(scale * np.linspace(0.4, 2.2, 500), np.linspace(-0.6, 1.2, 501))
    with np.errstate(all="ignore"):
        minus = sum(np.log(a) + (1 + 1 / k) * np.log(1 + k * v / a) for v in y)
        z = threshold + a * ((rate * T) ** k - 1) / k
    inside = minus <= np.sum(-stats.genpareto(shape, scale=scale).logpdf(y)) + stats.chi2.ppf(0.95, 1) / 2
    assert level == pytest.approx(threshold + scale * ((rate * T) ** shape - 1) / shape)
    assert ends == pytest.approx((z[inside].min(), z[inside].max()), rel=0.02) and shape_ends == pytest.approx(
        (k[inside].min(), k[inside].max()), abs=0.02)


def test_profile_intervals_of_block_maxima_are_those_of_the_likelihood_region():
    x, shares = 200 + 30 * stats.genextreme(-0.2).rvs(40, random_state=16), (0.05, 0.002)
    location, scale, shape = stat_fit.gev(x)
    levels, shape_ends = stat_extreme.gev_intervals([x[i::4] for i in range(4)], location, scale, shape, shares)
    a, b, k = np.meshgrid(location + scale * np.linspace(-0.8, 0.8, 70), scale * np.linspace(0.5, 2.0, 70),
                          shape + np.linspace(-0.5, 0.7, 80), indexing="ij")
    with np.errstate(all="ignore"):
        minus = sum(np.log(b) + (1 + 1 / k) * np.log(1 + k * (v - a) / b) + (1 + k * (v - a) / b)**(-1 / k) for v in x)
    frozen = stats.genextreme(-shape, loc=location, scale=scale)
    inside = minus <= -np.sum(frozen.logpdf(x)) + stats.chi2.ppf(0.95, 1) / 2
    for (level, ends), share in zip(levels, shares):
        z = a[inside] + b[inside] * (share ** -k[inside] - 1) / k[inside]
        assert level == pytest.approx(frozen.ppf(np.exp(-share))) and ends == pytest.approx(
            (z.min(), z.max()), rel=0.05)
    assert shape_ends == pytest.approx((k[inside].min(), k[inside].max()), abs=0.03)


@pytest.mark.parametrize("shape", [-0.8, -0.4, 0.7])
def test_the_likelihood_has_fallen_at_the_ends_of_every_profile_interval(shape, monkeypatch):
    """Tails whose ends are near the data, where a search that began too far away found nothing possible, and the edge
    of what it found was called the end of the interval."""
    monkeypatch.setattr(stat_extreme, "rate_share", lambda *_: 1.0)
    rng, fall = np.random.default_rng(4), stats.chi2.ppf(0.95, 1) / 2  # four fields: the likelihood alone
    k = np.linspace(stat_fit.LEAST_SHAPE + 1e-6, 6, 3000)[:, None]
    with np.errstate(all="ignore"):
        y = stats.genpareto(shape).rvs(60, random_state=rng)
        scale, found = stat_extreme.gpd(y)
        [(_, ends)], _ = stat_extreme.gpd_intervals(y.reshape(4, 15), [1.0] * 4, 0.0, scale, found, [2.0])
        for q in ends:
            a = q * k / (30 ** k - 1)
            rise = np.nanmin(np.sum(np.log(a) + (1 + 1 / k) * np.log(1 + k * y / a), axis=1)) - np.sum(
                -stats.genpareto(found, scale=scale).logpdf(y))
            assert rise == pytest.approx(fall, rel=0.03)
        x = stats.genextreme(-shape).rvs(40, random_state=rng)
        *where, found = stat_fit.gev(x)
        [(_, ends)], _ = stat_extreme.gev_intervals(x.reshape(4, 10), *where, found, [0.1])
        k, more = k[::10, None], np.exp(np.linspace(-5, 5, 400))[:, None]
        for q in ends:
            # the scales with which all maxima are possible
            b = (np.maximum(0, np.maximum(k * (q - x.min()), k * (q - x.max()))) + more) * 0.1 ** k
            t = 0.1 ** -k + k * (x - q) / b
            rise = np.nanmin(np.sum(np.log(b) + (1 + 1 / k) * np.log(t) + t ** (-1 / k), axis=2)) - np.sum(
                -stats.genextreme(-found, *where).logpdf(x))
            assert rise == pytest.approx(fall, rel=0.03)


def test_profile_likelihood_of_a_normal_mean():
    # with known variance: mean +- sqrt(2 drop / n), and copies of each value in a field widen by the root of their
    # number
    x = np.random.default_rng(14).normal(7, 1, 40)
    low, high = stat_profile.interval(lambda q, _: 0.5 * np.sum((x - q) ** 2), x.mean(), [0.0], 2.0, 0.1)
    assert (low, high) == pytest.approx((x.mean() - np.sqrt(4 / 40), x.mean() + np.sqrt(4 / 40)), abs=1e-3)
    fields = np.repeat(x, 9).reshape(40, 9)
    c = stat_profile.dispersion(lambda t: 0.5 * np.sum((fields - t[0]) ** 2, axis=1), lambda t: t[0], [x.mean()])
    assert c == pytest.approx(9 * np.var(x, ddof=1), rel=1e-3)
    assert stat_profile.drop(3, 5.0) == pytest.approx(1.96**2 / 2, rel=1e-4)
    assert stat_profile.drop(8, 0.5, 1.1) == pytest.approx(1.1 * stats.t.ppf(0.975, 10)**2 / 2)
    assert stat_profile.drop(8, 3.0) == pytest.approx(3 * stats.t.ppf(0.975, 7)**2 / 2)
    assert stat_profile.interval(lambda q, _: 1 - np.exp(-q * q), 0.0, [0.0], 2.0, 0.1) == (-np.inf, np.inf)


def test_the_error_of_the_rate_is_in_the_interval_of_a_level():
    """A level that is exceeded little less often than the threshold hangs on how often that is: from n clusters its
    logarithm is known to 1/sqrt(n), and so is the level in units of the scale, whatever is known of the scale."""
    fields = poisson_fields(np.random.default_rng(4), 3)  # too few for the scatter between fields
    found = stat_extreme.over_threshold(fields, [0.0041], 0.0, threshold=20.0, resamples=1)
    assert 1.0 < found["rate_per_hour"] * found["levels"][0]["hours"] < 1.2
    low, high = found["levels"][0]["level_95"]
    assert (high - low) / 2 > 0.8 * 1.96 * found["scale"] / np.sqrt(found["clusters"])


def test_clustered_peaks_count_once():
    rng = np.random.default_rng(5)
    fields = poisson_fields(rng, 6, rate=100)
    doubled = [
        {**f, "time": np.repeat(f["time"], 2) + np.tile([0, 0.01], len(f["time"])), "peak": np.repeat(f["peak"], 2)}
        for f in fields
    ]
    a, b = stat_extreme.over_threshold(fields, [10.0], 0.0, 60.0,
                                       19), stat_extreme.over_threshold(doubled, [10.0], 0.05, 60.0, 19)
    assert b["levels"][0]["level"] == pytest.approx(a["levels"][0]["level"],
                                                    rel=0.01) and b["extremal_index"] == pytest.approx(0.5, abs=0.01)


def test_what_no_tail_is_fitted_to():
    rng = np.random.default_rng(6)
    few = poisson_fields(rng, 2, rate=10)
    assert "fewer than 30 independent peaks" in stat_extreme.over_threshold(few, [1.0], 0.0)["refused"]
    assert "needs 30" in stat_extreme.over_threshold(few, [1.0], 0.0, threshold=1e9)["refused"]
    fewer = [f | {"time": f["time"][:3], "peak": f["peak"][:3]} for f in few]  # one largest of six is no limit
    assert "fewer than 30 independent peaks" in stat_extreme.over_threshold(fewer, [1.0], 0.0)["refused"]
    assert "without a collision" in stat_extreme.by_blocks(few, [1.0], blocks=30)["refused"]
    assert "raise --blocks" in stat_extreme.by_blocks(few, [1.0], blocks=2)["refused"]
    seldom = stat_extreme.over_threshold(poisson_fields(rng, 6, rate=100), [0.001], 0.0, threshold=100.0, resamples=1)
    assert np.isnan(seldom["levels"][0]["level"])  # the threshold itself is exceeded less often than that


# ---- sensitivity

def latin(n, k, seed):
    rng = np.random.default_rng(seed)
    return (np.array([rng.permutation(n) for _ in range(k)]).T + rng.random((n, k))) / n


@pytest.mark.slow
def test_ishigami():
    # Ishigami & Homma 1990: f = sin x1 + a sin² x2 + b x3^4 sin x1 on (-pi, pi)
    a, b, pi = 7.0, 0.1, np.pi
    x = pi * (2 * latin(800, 3, 1) - 1)
    y = np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])
    v1, v2, v13 = 0.5 * (1 + b * pi ** 4 / 5) ** 2, a * a / 8, b * b * pi ** 8 * (1 / 18 - 1 / 50)
    first, total = np.array([v1, v2, 0]) / (v1 + v2 + v13), np.array([v1 + v13, v2, v13]) / (v1 + v2 + v13)
    s = stat_sensitivity.sobol(dict(zip("abc", x.T)), y, resamples=20)
    assert np.allclose([i["first"] for i in s["indices"].values()], first, atol=0.01) and np.allclose(
        [i["total"] for i in s["indices"].values()], total, atol=0.01)
    assert s["q2"] > 0.99
    # a monotone change of scale leaves them
    again = stat_sensitivity.sobol({"a": np.exp(x[:, 0]), "b": x[:, 1], "c": x[:, 2]}, y, resamples=1)
    assert [i["first"] for i in again["indices"].values()] == [i["first"] for i in s["indices"].values()]


def test_linear_with_noise():
    u, rng, c = latin(150, 3, 2), np.random.default_rng(3), np.array([1.0, 2.0, 3.0])
    noise = 1.0
    y = u @ c + rng.normal(0, noise, 150)
    s = stat_sensitivity.sobol({"a": u[:, 0], "b": np.exp(3 * u[:, 1]), "c": u[:, 2]}, y)
    true = c ** 2 / np.sum(c ** 2)  # of what the parameters explain, without the noise
    for i, t in zip(s["indices"].values(), true):
        assert i["first_95"][0] <= t <= i["first_95"][1] and i["first"] == pytest.approx(t, abs=0.08)
    explained = np.sum(c ** 2) / 12
    assert 1 - s["r2"] == pytest.approx(noise / (noise + explained), abs=0.1)
    ranks = stat_sensitivity.rank_correlations({"a": u[:, 0], "b": np.exp(3 * u[:, 1]), "c": -u[:, 2]}, y)
    # partial correlation of a linear model, near that of the ranks: c sd(u) / sqrt(c² var(u) + noise²)
    for (name, r), k in zip(ranks.items(), c * np.array([1, 1, -1])):
        partial = k / np.sqrt(k * k + 12 * noise ** 2)
        assert r["prcc_95"][0] <= partial <= r["prcc_95"][1], name
    assert ranks["a"]["spearman"] == pytest.approx(stats.spearmanr(u[:, 0], y).statistic) and ranks["c"]["spearman"] < 0


def test_a_full_factorial_gives_the_analysis_of_variance():
    # levels by name and by number, an interaction, three fields each
    effect = {("s", 1.0): 0.0, ("s", 2.0): 2.0, ("h", 1.0): 4.0, ("h", 2.0): 12.0, ("v", 1.0): 1.0, ("v", 2.0): 5.0}
    names = [k for k in effect for _ in range(4)]
    y = np.array([effect[k] for k in names]) + np.tile([-1e-3, 1e-3, -1e-3, 1e-3], 6)
    s = stat_sensitivity.sobol(
        {"variant": np.array([k for k, _ in names], dtype=object), "x": np.array([v for _, v in names])},
        y,
        resamples=5)
    table = np.array(list(effect.values())).reshape(3, 2)
    whole, a, b = table.var(), table.mean(axis=1).var(), table.mean(axis=0).var()
    i = s["indices"]
    assert [i["variant"]["first"], i["x"]["first"]] == pytest.approx([a / whole, b / whole], abs=1e-4)
    assert [i["variant"]["total"], i["x"]["total"]] == pytest.approx([1 - b / whole, 1 - a / whole], abs=1e-4)
    assert "variant" not in stat_sensitivity.rank_correlations(
        {"variant": np.array(["s", "h"] * 10, dtype=object), "x": np.arange(20.0)}, np.arange(20.0))


def test_what_noise_makes_of_a_coefficient_is_no_effect():
    """Of coefficients 2, 1 and 0.5, each with a variance of 1, 3 are left of the first one's square and nothing of the
    others'."""
    first, total = stat_sensitivity._indices(np.array([9.0, 2.0, 1.0, 0.5]), np.ones(4),
                                             [(1, 0), (0, 1), (1, 1)], 2)
    assert first.tolist() == [1, 0] and total.tolist() == [1, 0]


def test_samples_that_are_too_small():
    u, rng = latin(200, 4, 4), np.random.default_rng(5)
    keys = dict(zip("abcd", u.T))
    assert "needs 20" in stat_sensitivity.sobol({k: v[:19] for k, v in keys.items()}, u[:19, 0])["refused"]
    noise = stat_sensitivity.sobol(keys, rng.normal(0, 1, 200))
    assert "predicts too little" in noise["refused"]
    both = np.repeat(u[:10, 0], 3)  # two parameters that always go together
    assert "do not suffice" in stat_sensitivity.sobol({"a": both, "b": -both}, both)["refused"]
    assert "refused" in stat_sensitivity.sobol({"a": np.ones(30)},
                                               np.arange(30.0)) and "does not vary" in stat_sensitivity.sobol(
                                                   keys, np.ones(200))["refused"]
