# SPDX-License-Identifier: MIT
"""The band of a tow force over the ranges of assumed values: one value at a time, on common fields.

The tow force is F = W + w, where W is the part that follows from the drag law alone (water, wind) and w the part due to
ice: its mean R plus the excess of the design value over the mean. An end of a range changes W by its closed form, and R
according to runs in the same fields as those of the unchanged case. The design value is assumed to change with them:

    F' = W' + w R'/R                                                                                      (assumed)

since a fitted tail for every value would cost a study each. The interval of R'/R is that of the paired fields.

Effects of the ranges are added with the signs that make the load largest, and least: the band is that of the worst
corner, not a probability. If, and only if, every range has a distribution, the variances of fields and ranges are also
added, each effect being taken as linear over its range, to give one 95 % interval.
"""
from dataclasses import dataclass

from bergtow.errors import CASE, RunError
from bergtow.study.case_file import contents

import numpy as np
import scipy

#: keys whose effect on the load follows from the drag law, {key: the part}
ANALYTIC = {"body.drag.water_form": "water", "body.drag.air_form": "wind"}
TENTH = 0.1
NORMAL_ENDS = 1.96   # standard deviations from the middle to an end of a normal range
DRAG = ("0.25: OpenBerg of OpenDrift (revision 130bc999, after Keghouche et al. 2010); 0.85: Hunke & Comeau 2011; "
        "1.25: IceDEF (iceberg.py). Models of drift, whose coefficients also stand for the unknown part of the "
        "current")
AIR = "0.4: Hunke & Comeau 2011; 0.8: OpenBerg of OpenDrift (revision 130bc999); 1.25: IceDEF (iceberg.py)"


@dataclass(frozen=True)
class Range:
    """Values that may be assumed for a key instead of its value."""

    key: str
    low: str
    high: str
    source: str
    distribution: str = ""   #: "" if none is stated


#: for keys that no client can measure beforehand; the subject of the question (ice, berg, speed) is not among them
RANGES = (Range("body.drag.water_form", "0.25", "1.25", DRAG),
          Range("body.drag.air_form", "0.4", "1.25", AIR),
          Range("ice.friction", "0.05", "0.48", "polished to natural surfaces: Sukhorukov & Løset 2013"),
          Range("ice.rafting.kappa", "5", "34", "assumed; published ratios of work to energy, 5 to 17, are 10 to 34"))


def read(path):
    """Read ranges from the `parameters` of a study file, in the format of bergtow budget. Raises RunError."""
    found, out = contents(path).get("parameters"), []
    for key, at in (found if isinstance(found, dict) else {}).items():
        if not (isinstance(at, dict) and {"from", "to"} <= set(at)):
            raise RunError(path, f"parameters: {key} is not a range", "write it as {from: 0.25, to: 1.25, source: ...}",
                           CASE)
        out.append(Range(str(key), str(at["from"]), str(at["to"]), str(at.get("source") or "assumed"),
                         str(at.get("distribution") or "")))
    if not out:
        raise RunError(path, "holds no `parameters`", "name a study file with ranges, as cases/studies/budget.yml",
                       CASE)
    return out


def applies(some, value, wind):
    """The ranges that apply to the case: no law that is switched off, no wind if there is none. value: function that
    returns the value of a key."""
    def on(r):
        if r.key == "body.drag.air_form":
            return wind
        return not (r.key.startswith(("ice.rafting.", "ice.crushing.")) and not value(r.key, 0.0) > 0)
    return [r for r in some if on(r)]


def ratio(base, other):
    """(R'/R, (low, high) of 95 %) from paired means of fields; without an interval for fewer than two."""
    base, other = np.asarray(base, dtype=float), np.asarray(other, dtype=float)
    mean = base.mean()
    if not abs(mean) > 0:
        return 1.0, (np.nan, np.nan)
    r, n = other.mean() / mean, len(base)
    if n < 2:
        return r, (np.nan, np.nan)
    # for a ratio of means, to first order: the paired deviations other - r base
    half = scipy.stats.t.ppf(0.975, n - 1) * np.std(other - r * base, ddof=1) / np.sqrt(n) / abs(mean)
    return r, (r - half, r + half)


def band(n, rows):
    """(least, largest) value of a load n, when every effect takes the sign that makes it so."""
    effects = np.array([[row["n_low"], row["n_high"]] for row in rows
                        if None not in (row["n_low"], row["n_high"])], dtype=float).reshape(-1, 2)
    return n + effects.min(axis=1, initial=0.0).sum(), n + effects.max(axis=1, initial=0.0).sum()


def _moments(row):
    """(mean, variance) of the effect of a row, linear from its low end to its high end. The distributions are those of
    a study: triangular about the middle, normal with 95 % between the ends."""
    a, b = row["n_low"], row["n_high"]
    share = {"triangular": 1 / 24, "normal": (1 / (2 * NORMAL_ENDS)) ** 2}.get(row["distribution"], 1 / 12)
    return (a + b) / 2, share * (b - a) ** 2


def combined(n, interval, rows):
    """((low, high) of 95 % for fields and ranges combined, None), or (None, why not)."""
    if any(not row["distribution"] for row in rows):
        return None, "range_without_distribution"
    if any(row["n_low"] is None or row["n_high"] is None for row in rows):
        return None, "range_without_effect"
    if interval is None or not np.isfinite(interval).all():
        return None, "no_interval_of_fields"
    moments = np.array([_moments(row) for row in rows]).reshape(-1, 2).sum(axis=0)
    sd = np.sqrt(((interval[1] - interval[0]) / (2 * NORMAL_ENDS)) ** 2 + moments[1])
    return (n + moments[0] - NORMAL_ENDS * sd, n + moments[0] + NORMAL_ENDS * sd), None
