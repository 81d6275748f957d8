# SPDX-License-Identifier: MIT
"""Does the mean over several fields change during the window? A line is fitted to the series of each field. A single
run may not distinguish its slope from noise: the mean of the changes is tested with Student's t over the fields.

Does not use scipy, which `make demo` does not install.
"""
from bergtow import _library

import numpy as np

LEAST = 5  # fields


def student(freedom, level=0.95):
    """Quantile t of Student's distribution such that |t| is below it with this probability: t = sqrt(n) tan a turns its
    density into cos^(n-1) a."""
    angle = np.linspace(0, np.pi / 2, 200_001)
    density = np.cos(angle) ** (freedom - 1)
    share = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
    return np.sqrt(freedom) * np.tan(np.interp(level, share / share[-1], angle))


def interval(values):
    """(low, high) of the mean of independent values, 95 %; NaN for fewer than two."""
    values = np.asarray(values, dtype=float)
    n = len(values)
    if n < 2:
        return np.nan, np.nan
    half = student(n - 1) * values.std(ddof=1) / np.sqrt(n)
    return values.mean() - half, values.mean() + half


def of(changes, mean):
    """(the mean change, its interval, is it significant?) from changes over the window, N; None for too few fields."""
    changes = np.asarray(changes, dtype=float)
    changes = changes[np.isfinite(changes)]
    if len(changes) < LEAST:
        return None
    (low, high), matters = interval(changes), _library.limit("window_drift") * abs(mean)
    return changes.mean(), (low, high), bool((low > 0 or high < 0) and abs(changes.mean()) > matters)
