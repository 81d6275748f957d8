# SPDX-License-Identifier: MIT
"""Intervals of a quantity from its profile likelihood, widened for dependence between values within a field.

With l_p(q) the largest log-likelihood of all parameters that give the quantity q, the interval contains the q with
    2 (l(q^) - l_p(q)) <= max(k, K c),      c = g V_s g / g V_m g,
K the square of Student's t quantile with F - 1 degrees of freedom, k of that with F - 1 + WORTH.
g is the gradient of the quantity, V_m the inverse of the observed information, V_s = V_m J V_m with J the sum of the
squared scores of the F fields: c is about 1 if the values in a field are independent of each other and of the field,
and larger if they are not [Chandler & Bate 2007, Biometrika 94]. c is known only as well as F fields allow. The
likelihood itself is known better, from all their values, but tail models cover slightly less than they claim: WORTH was
chosen on series whose extremes are known (README.md). With K for both, up to 99 to 100 % of the intervals of 5 to 8
fields contained the level; with the normal quantile for k, as few as 87 % of those of 8.
The interval follows the skewness of return levels. Rejected: percentiles of a bootstrap over fields. Of 95 % intervals
of exponential tails from 8 and 20 fields they covered 65 to 82 % and 75 to 80 %, since the shape from a short sample is
low and from its resamples lower still.

J is the scatter of the sampled fields. If fields differ in level, those that determine the level of a longer time are
worse than any sampled one, and the interval covers less often than it claims (stats/alike.py; numbers in README.md).
"""
import numpy as np
import scipy

LEAST_FIELDS = 5  # with fewer fields their scatter is unknown: the likelihood alone, with the normal quantile
WORTH = 3         # degrees of freedom that the likelihood adds to those of the fields
GROWTH = 1.6      # of the step outwards after a success
OPEN = 1e12       # times the first step: an interval that goes further counts as open
FINE = 1e-4       # of the distance to the end: its error
SIMPLEX = 0.1     # size of the first simplex: logarithms of scales and shapes are of order one


def gradient(f, theta, step=1e-4):
    """d f / d theta, f scalar or [F]: [k] or [k, F]."""
    return np.array([(np.asarray(f(theta + d)) - np.asarray(f(theta - d))) / (2 * step)
                     for d in step * np.eye(len(theta))])


def dispersion(minus_log_likelihoods, quantity, theta):
    """c for a quantity of theta; minus_log_likelihoods(theta) gives one number per field. 1 if it cannot be found."""
    theta = np.asarray(theta, dtype=float)
    # at the limit of the admissible parameters the gradient is not finite; this is detected below
    with np.errstate(invalid="ignore"):
        scores = gradient(minus_log_likelihoods, theta)
        information = gradient(lambda t: gradient(lambda s: np.sum(minus_log_likelihoods(s)), t), theta)
        g = gradient(quantity, theta)
    fields = scores.shape[1]
    if fields < LEAST_FIELDS or not np.isfinite(information).all():
        return 1.0
    try:
        a = np.linalg.solve(0.5 * (information + information.T), g)
    except np.linalg.LinAlgError:
        return 1.0
    model, robust = g @ a, np.sum((a @ scores) ** 2) * fields / (fields - 1)
    return float(robust / model) if np.isfinite([model, robust]).all() and model > 0 else 1.0


def drop(fields, c, share=1.0, level=0.95):
    """Drop of the log-likelihood at the ends of the interval. c: from `dispersion`; share: variance including the error
    of parameters that the profile holds fixed / variance without it."""
    def squared(quantile):
        return quantile(0.5 + level / 2) ** 2
    if fields < LEAST_FIELDS:
        return 0.5 * share * squared(scipy.stats.norm.ppf)
    return 0.5 * share * max(squared(scipy.stats.t(fields - 1 + WORTH).ppf), c * squared(scipy.stats.t(fields - 1).ppf))


def interval(minus_log_likelihood, best, rest, fall, first):
    """(low, high) of a quantity: where min over rest of minus_log_likelihood(q, rest) has risen by `fall` above its
    value at q = best. first: first step away from best. An end that is not found is infinite."""
    least = minus_log_likelihood(best, rest)
    def rise(q, start):
        # The simplex is set explicitly: SciPy's is 0.00025 wide near zero, so that the search ends where it began.
        # Impossible values count as very unlikely ones, because the search takes differences. It may start where
        # nothing is possible, or stop early. A rise that is too large is therefore never final: it shortens the step.
        simplex = start + SIMPLEX * np.vstack([np.zeros(len(start)), np.eye(len(start))])
        found = scipy.optimize.minimize(lambda r: min(minus_log_likelihood(q, r), 1e12), start, method="Nelder-Mead",
                                        options={"xatol": 1e-4, "fatol": 1e-4, "maxiter": 400,
                                                 "initial_simplex": simplex})
        return found.fun - least - fall, found.x
    ends = []
    for sign in (-1, 1):
        end, start, step, grow = best, np.asarray(rest, dtype=float), first, GROWTH
        while FINE * max(abs(end - best), first) < step < OPEN * first:
            value, found = rise(end + sign * step, start)
            if value <= 0:
                end, start, step, grow = end + sign * step, found, grow * step, GROWTH
            else:
                step, grow = 0.5 * step, 1.0  # no growth after the next success: the steps bisect
        ends.append(end if step < OPEN * first else sign * np.inf)
    return ends[0], ends[1]
