# SPDX-License-Identifier: MIT
"""Are the fields of a condition alike, so that what differs between them is no more than chance within a field?

It matters since the level of more hours than were simulated is borne by fields worse than any that was drawn: an
interval that takes the fields as alike does not know them.

The window of each field is cut into blocks, each so long that their maxima are independent of each other, and the ranks
of these maxima are compared between the fields by the one-way analysis of variance,
    F = mean square between fields / within fields,      F of (n - 1, n (k - 1)) degrees of freedom
[Conover & Iman 1981, Am. Stat. 35: the test of Kruskal & Wallis by its ranks]. Return levels are made of maxima, and
ranks need no distribution of them. Of signals whose fields are alike it said otherwise in 0.2 to 2 % of 500 sets each,
and of fields of exp(0.5 g) times AR(1), g normal, in 96 % and more of them.

Rejected: the means of the fields against their standard errors, since of a field that varies more the mean need not;
the counts of clusters against a Poisson distribution, which have too few clusters to tell: of 5 such fields of 1,000
samples they found 3 %.
"""
import numpy as np
import scipy

from bergtow.stats import extreme as stat_extreme

LEVEL = 0.01  # of a hundred conditions whose fields are alike, one is warned of
BLOCKS = 80   # of all fields together, about: with 160 up to 3 % false alarms, with 40 less power
LEAST = 2     # blocks of a field, and fields


def p_value(fields, block):
    """Probability that fields which are alike differ as much. Fields as stats/extreme.py has them; block: s, the least
    length over which maxima are independent. NaN where a field holds fewer than LEAST of these, or there is but one."""
    hours = min(f["hours"] for f in fields)  # of each field, or longer ones had larger maxima
    k = min(max(LEAST, int(np.ceil(BLOCKS / len(fields)))), int(3600 * hours / block))
    if len(fields) < LEAST or k < LEAST:
        return np.nan
    maxima = np.array([_maxima(f, hours, k) for f in fields])
    if not np.isfinite(maxima).all():
        return np.nan
    ranks = scipy.stats.rankdata(maxima).reshape(maxima.shape)
    within = np.mean(np.var(ranks, axis=1, ddof=1))
    between = k * np.var(ranks.mean(axis=1), ddof=1)
    if within == 0:
        return 0.0 if between > 0 else 1.0
    return float(scipy.stats.f.sf(between / within, len(fields) - 1, len(fields) * (k - 1)))


def _maxima(field, hours, blocks):
    """Maxima of so many blocks of the first hours of a field."""
    first = field["time"] <= field["start"] + 3600 * hours * (1 + 1e-9)
    return stat_extreme.block_maxima(field["time"][first], field["peak"][first], field["start"], hours, blocks)
