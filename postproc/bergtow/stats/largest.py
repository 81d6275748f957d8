# SPDX-License-Identifier: MIT
"""The largest of n tows and its confidence level, for use if no tail can be fitted: distribution-free.

The largest values of n tows in separate fields are independent and identically distributed. For any continuous
distribution F, the chance that all n stay below its quantile of the share p is p^n. So with confidence 1 - p^n at least
the share p of all tows of that length stay below the largest of the n, and the next tow does so with probability n / (n
+ 1). Rejected: a normal quantile of the n values, which gives a narrower interval but assumes a distribution that was
not checked.
"""
import numpy as np

CONFIDENCE = 0.95


def share_below(n):
    """The share of tows that stays below the largest of n with this confidence."""
    return (1 - CONFIDENCE) ** (1 / n)


def largest_of(values, hours):
    """The statement on the largest of the tows. values: the largest of each [n]; hours: of each window [n]. {"n",
    "n_tows", "hours_each", "confidence", "share_below", "chance_next_below"}."""
    n = len(values)
    return {"n": float(np.max(values)), "n_tows": n, "hours_each": float(np.median(hours)), "confidence": CONFIDENCE,
            "share_below": share_below(n), "chance_next_below": n / (n + 1)}
