# SPDX-License-Identifier: MIT
"""Loads with only a lower bound, because some of their steps have no solution: numbers that print as "at least".

In such a step the load has no bound (docs/theory.md, locked bodies). The last load before it takes its place, so a
mean, a peak, a quantile or a share of time above a level is a lower bound. It has no interval, because it has no upper
bound, and measures of scatter are undefined.

Every page takes its numbers from the summary of a run or from the statistics of a condition. The loads become AtLeast
there, in one place, and any function that formats one prints the two words. Rejected: a mark that each page sets
itself, and that the next page forgets.
"""
import re

import numpy as np

#: numbers of summary.json by path: the ice loads, the numbers compared with them, and the measures of their scatter
LOADS = re.compile(r"(mean|p95|p99|peak)_ice_resistance_n|window\.series\.ice_resistance\.(mean|peak|start_peak)_n|"
                   r"window\.series\.ice_resistance\.quarters_n\.|"
                   r"impacts\..*_n|reference\.ratio|estimates\..*\.simulated_over_estimate")
TOW = re.compile(r"(mean|peak|p95|p99)_tow_force_n|window\.series\.tow_force\.(mean|peak|start_peak)_n|"
                 r"window\.series\.tow_force\.quarters_n\.")
SCATTER = re.compile(r"sd_(ice_resistance|tow_force)_n|window\.series\.(ice_resistance|tow_force)\.change_n")
ON_A_LINE = "peak_line_tension_n", "start_peak_line_tension_n"
NONE = (np.nan, np.nan)  # no interval


class AtLeast(float):
    """A number that is a lower bound; share: of its steps whose load has no bound, NaN if unknown."""

    def __new__(cls, value, share=np.nan):
        number = super().__new__(cls, value)
        number.share = share
        return number

    def __truediv__(self, by):
        return AtLeast(float(self) / float(by), self.share)

    def __mul__(self, by):
        return AtLeast(float(self) * float(by), self.share)

    __rmul__ = __mul__

    def __format__(self, spec):
        return f"at least {float(self):{spec}}"


def of(value, some):
    """The mean or the largest of some numbers: a lower bound if one of them is."""
    shares = [x.share for x in some if isinstance(x, AtLeast)]
    return AtLeast(value, sum(shares) / len(some)) if shares else value


#: failure code of a run that guard.no_solution ended
ENDED = "no_solution"


def words(share):
    """The note on such numbers, once per page."""
    return f"in {100 * share:.2g} % of the steps the load has no bound"


def summary(found):
    """Mark a summary.json: if the window has steps whose load has no bound, its loads become AtLeast and scatter None.
    The tow force counts as an ice load if the speed is prescribed; in a tow on a line, the line bounds it."""
    window = found.get("window")
    share = (window if isinstance(window, dict) else {}).get("no_load_share")
    if not isinstance(share, float) or not share > 0:
        return found
    tow = all(found.get(key) is None for key in ON_A_LINE)
    def marked(value, path):
        if isinstance(value, dict):
            for key, one in value.items():
                value[key] = marked(one, f"{path}.{key}" if path else key)
        elif isinstance(value, list):
            value[:] = [marked(one, f"{path}.") for one in value]
        elif isinstance(value, float):
            if SCATTER.fullmatch(path):
                return None
            if LOADS.fullmatch(path) or tow and TOW.fullmatch(path):
                return AtLeast(value, share)
        return value
    return marked(found, "")


def _number(x, share):
    return AtLeast(x, share) if x is not None and np.isfinite(x) else x


def _load(x, share):
    """Statistics of a load (stats/load.py) as lower bounds."""
    def known(found):
        return {"value": _number(found["value"], share), "interval_95": NONE}
    start = x["start_up"] and x["start_up"] | {"largest": _number(x["start_up"]["largest"], share)}
    return x | {"mean": known(x["mean"]), "sd": {"value": np.nan, "interval_95": NONE},
                "quantiles": {q: known(v) for q, v in x["quantiles"].items()},
                "largest": _number(x["largest"], share), "smallest": _number(x["smallest"], share), "start_up": start,
                "exceedance": [row | {k: known(row[k]) for k in ("share_of_time", "per_hour")}
                               for row in x["exceedance"]]}


def _fields(r, share):
    """Statistics of the means of fields (stat_mean.between_fields) as lower bounds."""
    out = {key: NONE if key.endswith("_95") else np.nan if isinstance(x, float) else x for key, x in r.items()}
    out |= {key: _number(r[key], share) for key in ("mean", "median", "trimmed_mean", "min", "max") if key in r}
    if "percentiles" in r:
        out["percentiles"] = {p: _number(x, share) for p, x in r["percentiles"].items()}
    return out


def _panels(p, share):
    return p and p | {key: [_number(x, share) for x in p[key]] for key in ("mean", "largest", "mean_of_largest")} | {
        key: [NONE] * len(p["mean"]) for key in ("mean_95", "mean_of_largest_95")}


def condition(c, why, share, bounded):
    """The statistics of a condition as lower bounds, except those of `bounded`, the loads that a line bounds. why: the
    reason given instead of a tail."""
    refused = {"refused": why}
    extremes = c["extremes"] if "refused" in c["extremes"] else c["extremes"] | {
        "collisions_per_hour": _number(c["extremes"]["collisions_per_hour"], share),
        "exceedance": [row | {"peak": _number(row["peak"], share)} for row in c["extremes"]["exceedance"]],
        "block_maxima": refused, "over_threshold": refused}
    samples = c["samples"] | {
        "percentiles": {p: _number(x, share) for p, x in c["samples"]["percentiles"].items()}, "fits": [refused] * 2}
    return c | {"resistance": _fields(c["resistance"], share), "fits_of_means": [refused] * 2, "samples": samples,
                "drift": {"verdict": "not judged", "words": "its means are lower bounds"},
                "estimates": {name: e | {"ratio": _number(e["ratio"], share)} for name, e in c["estimates"].items()},
                "extremes": extremes, "panels": _panels(c["panels"], share),
                "loads": {name: x if name in bounded else _load(x, share) for name, x in c["loads"].items()}}
