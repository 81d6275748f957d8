# SPDX-License-Identifier: MIT
"""Distributions fitted by maximum likelihood, and their goodness of fit.

Normal, lognormal, Weibull and gamma (the last two with origin zero), and the generalised extreme value distribution
(GEV, shape > 0: heavy upper tail). Goodness of fit: Anderson-Darling A², with a p-value from a parametric bootstrap.
Samples are drawn from the fit and fitted again, because tables apply to given parameters only and are far too generous
for fitted ones [Stephens 1974, J. Am. Stat. Assoc. 69]. AIC = 2k - 2 ln L, and AICc with its small-sample correction,
compare the fits with each other; neither shows that the best of them is good.
"""
import numpy as np
import scipy

LEAST = 8            # with fewer values a fit is meaningless
RESAMPLES = 199
SEED = 20172
LEAST_SHAPE = -0.95  # of GEV and GPD: the likelihood has no maximum at -1 and below


class Frozen:
    """A SciPy distribution with fixed parameters. SciPy's own version regenerates its documentation each time, which
    took a sixth of the time of a report."""

    def __init__(self, family, *shapes, **scales):
        self._family, self._shapes, self._scales = family, shapes, scales

    def cdf(self, x):
        return self._family.cdf(x, *self._shapes, **self._scales)

    def logpdf(self, x):
        return self._family.logpdf(x, *self._shapes, **self._scales)

    def rvs(self, size, random_state):
        return self._family.rvs(*self._shapes, **self._scales, size=size, random_state=random_state)


def _normal(x):
    sd = np.std(x)
    return {"mean": np.mean(x), "sd": sd}, Frozen(scipy.stats.norm, np.mean(x), sd)


def _lognormal(x):
    median, sd = np.exp(np.log(x).mean()), np.log(x).std()
    return {"median": median, "sd_log": sd}, Frozen(scipy.stats.lognorm, sd, scale=median)


def _weibull(x):
    """Shape c from sum x^c ln x / sum x^c - 1/c = mean ln x, whose left side increases with c."""
    logs = np.log(x)
    top = logs.max()
    def equation(c):
        w = np.exp(c * (logs - top))
        return np.sum(w * logs) / w.sum() - 1 / c - logs.mean()
    high = 1.0
    while equation(high) < 0:
        high *= 2
    low = high / 2
    while equation(low) > 0:
        low /= 2
    c = scipy.optimize.brentq(equation, low, high, rtol=1e-10)
    scale = np.exp(top + np.log(np.mean(np.exp(c * (logs - top)))) / c)
    return {"shape": c, "scale": scale}, Frozen(scipy.stats.weibull_min, c, scale=scale)


def _gamma(x):
    """Shape a from ln a - digamma(a) = ln mean x - mean ln x."""
    s = np.log(np.mean(x)) - np.mean(np.log(x))
    start = (3 - s + np.sqrt((s - 3) ** 2 + 24 * s)) / (12 * s)
    a = scipy.optimize.brentq(lambda a: np.log(a) - scipy.special.digamma(a) - s, start / 3, 3 * start, rtol=1e-10)
    return {"shape": a, "scale": np.mean(x) / a}, Frozen(scipy.stats.gamma, a, scale=np.mean(x) / a)


def gev_moments(x):
    """(location, scale, shape) by L-moments [Hosking, Wallis & Wood 1985, Technometrics 27]: the starting point of the
    likelihood search."""
    x = np.sort(x)
    n, i = len(x), np.arange(len(x))
    b0, b1, b2 = x.mean(), np.sum(i * x) / (n * (n - 1)), np.sum(i * (i - 1) * x) / (n * (n - 1) * (n - 2))
    c = (2 * b1 - b0) / (3 * b2 - b0) - np.log(2) / np.log(3)
    k = np.clip(7.8590 * c + 2.9554 * c * c, -0.6, 0.9)  # k = -shape
    k = k if abs(k) > 1e-6 else 1e-6
    scale = (2 * b1 - b0) * k / (scipy.special.gamma(1 + k) * (1 - 2 ** -k))
    return b0 + scale * (scipy.special.gamma(1 + k) - 1) / k, scale, -k


def gev_minus_log_likelihood(theta, x):
    location, log_scale, shape = theta
    if shape <= LEAST_SHAPE:
        return np.inf
    z = (x - location) * np.exp(-log_scale)
    if abs(shape) < 1e-7:
        return len(x) * log_scale + np.sum(z + np.exp(-z))
    y = 1 + shape * z
    if y.min() <= 0:
        return np.inf
    logs = np.log(y)
    return len(x) * log_scale + np.sum((1 + 1 / shape) * logs + np.exp(-logs / shape))


def gev(x):
    """(location, scale, shape) by maximum likelihood, shape > LEAST_SHAPE."""
    centre, width = np.mean(x), np.std(x)
    y = (x - centre) / width
    location, scale, shape = gev_moments(y)
    start = np.array([location, np.log(scale), shape])
    if not np.isfinite(gev_minus_log_likelihood(start, y)):  # a value lies outside the support of the first guess
        start = np.array([-0.45, np.log(0.78), 1e-3])        # Gumbel with mean 0 and standard deviation 1
    found = scipy.optimize.minimize(gev_minus_log_likelihood, start, args=(y, ), method="Nelder-Mead",
                                    options={"xatol": 1e-5, "fatol": 1e-7, "maxiter": 2000})
    location, log_scale, shape = found.x
    return centre + width * location, width * np.exp(log_scale), shape


def _gev(x):
    location, scale, shape = gev(x)
    return {"location": location, "scale": scale, "shape": shape}, Frozen(scipy.stats.genextreme, -shape,
                                                                          loc=location, scale=scale)


#: name: (fit, parameters, positive values only?)
DISTRIBUTIONS = {"normal": (_normal, 2, False), "lognormal": (_lognormal, 2, True), "Weibull": (_weibull, 2, True),
                 "gamma": (_gamma, 2, True), "GEV": (_gev, 3, False)}


def anderson_darling(x, cdf):
    """A² = -n - sum (2i - 1)/n (ln u_i + ln(1 - u_{n+1-i})) of sorted u = F(x)."""
    u = np.clip(np.sort(cdf(x)), 1e-300, 1 - 1e-16)
    n = len(u)
    return -n - np.sum((2 * np.arange(1, n + 1) - 1) * (np.log(u) + np.log1p(-u)[::-1])) / n


def p_value(statistic, frozen, n, refit, resamples=RESAMPLES, rng=None):
    """Share of samples from the fit whose A² reaches the statistic."""
    rng = rng or np.random.default_rng(SEED)
    above = tried = 0
    for _ in range(resamples):
        y = frozen.rvs(size=n, random_state=rng)
        try:
            above += anderson_darling(y, refit(y).cdf) >= statistic
            tried += 1
        except (ValueError, RuntimeError, FloatingPointError):  # no maximum in this sample
            continue
    return (above + 1) / (tried + 1)


def fit(name, x, resamples=RESAMPLES):
    """Fit one distribution to independent values x, as a dict; {"name", "refused": why} if a fit makes no sense."""
    make, k, positive = DISTRIBUTIONS[name]
    # Contiguous: for a strided view NumPy takes the range to end one stride after the last number. If the result
    # happens to lie there, NumPy assumes an overlap and calls the scalar log instead of the vector one, whose last bits
    # differ: one run in forty then differed.
    x, n = np.ascontiguousarray(x, dtype=float), len(x)
    why = (f"{n} values, needs {LEAST}" if n < LEAST else "all values are the same" if np.ptp(x) == 0
           else f"{np.sum(x <= 0)} values are not positive" if positive and x.min() <= 0 else "")
    if why:
        return {"name": name, "refused": why}
    with np.errstate(all="ignore"):
        parameters, frozen = make(x)
        likelihood = float(np.sum(frozen.logpdf(x)))
        statistic = anderson_darling(x, frozen.cdf)
        p = p_value(statistic, frozen, n, lambda y: make(y)[1], resamples) if resamples else np.nan
    aic = 2 * k - 2 * likelihood
    return {"name": name, "parameters": {key: float(v) for key, v in parameters.items()}, "log_likelihood": likelihood,
            "aic": aic, "aicc": aic + 2 * k * (k + 1) / (n - k - 1), "anderson_darling": float(statistic),
            "kolmogorov_smirnov": float(scipy.stats.kstest(x, frozen.cdf).statistic), "p_value": p}


def fit_all(x, resamples=RESAMPLES):
    """All fits, best AICc first, refused ones last."""
    fits = [fit(name, x, resamples) for name in DISTRIBUTIONS]
    return sorted(fits, key=lambda f: ("refused" in f, f["aicc"] if np.isfinite(f.get("aicc", np.nan)) else np.inf))
