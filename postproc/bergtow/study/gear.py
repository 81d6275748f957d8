# SPDX-License-Identifier: MIT
"""Vessel and line of a tow: the client's choice, the requirements of the tow force, and the largest speed at which the
vessel holds it.

A vessel is a class of the library (bergtow/towing) or a bollard pull, "110 t" or "1.1 MN"; a line comes from the
library or is given by a breaking load. The free-running speed is assumed, and marked as such, if neither the call nor
the case gives it. The efficiency of the vessel and the safety factor of the line are the user's: no clause of a
standard could be read, so none is applied unless it is given.
"""
import re
from dataclasses import dataclass

from bergtow import towing
from bergtow.arguments import read
from bergtow.errors import USAGE, BergtowError
from bergtow.result.run import case_value
from bergtow.towing.start import bisected

import numpy as np

FREE_SPEED = 14 * 1852 / 3600   # m/s, assumed if neither the vessel nor the case gives it, as in cases/fullscale


@dataclass(frozen=True)
class Vessel:
    name: str
    pull: float          #: N, bollard pull; NaN if no vessel is named
    free_speed: float    #: m/s
    free_from: str       #: "library", "case" or "assumed"
    beam: float          #: m, NaN if unknown
    mass: float          #: kg


@dataclass(frozen=True)
class Line:
    name: str
    breaking: float      #: N, NaN if unknown
    stiffness: float     #: EA, N
    length: float        #: m


def force(text, option):
    """N from "110 t" (tonnes-force) or "1.1 MN"; None if the text is not a number with such a unit. Raises BergtowError
    if it is not above zero, or has no unit: 110 may be meant as tonnes."""
    tonnes = re.sub(r"(?<=[\d.\s])(t|tonnes?)\s*$", "tf", text)
    try:
        value = read(tonnes, "N")
    except BergtowError:
        return None
    why = "is not above zero" if not value > 0 else "" if re.search(r"[a-zA-Z]\s*$", text) else "has no unit"
    if why:
        raise BergtowError(f"{option} {text}: {why}; give it as \"110 t\" or \"1.1 MN\"", USAGE)
    return value


def known(table, text, option, what):
    """Look up a row of the library. Raises BergtowError."""
    if text not in table:
        raise BergtowError(f"{option} {text}: is not a {what}, as \"110 t\" or \"1.1 MN\", and none of "
                           f"{', '.join(table)}; name one of these, or add a table of your own with {option}s", USAGE)
    return table[text]


def vessel(text, case, library=None):
    """The vessel of the call (text or None), or that of the case. Raises BergtowError, also for a faulty library that
    is not needed."""
    table = towing.vessels(library)
    own = {k: case_value(case, f"tow.vessel.{k}", 0.0) for k in ("bollard_pull", "free_speed", "mass")}
    thrust = case.get("tow.mode") == "thrust"
    free, free_from = (own["free_speed"], "case") if thrust and own["free_speed"] > 0 else (FREE_SPEED, "assumed")
    mass = own["mass"] if thrust and own["mass"] > 0 else np.nan
    if text is None:
        pull = own["bollard_pull"] if thrust else np.nan
        return Vessel("case" if thrust else "", pull, free, free_from, np.nan, mass)
    pull = force(text, "--vessel")
    if pull is not None:
        return Vessel(text, pull, free, free_from, np.nan, mass)
    found = known(table, text, "--vessel", "bollard pull")
    own_speed = np.isfinite(found.free_speed)
    return Vessel(found.name, found.bollard_pull, found.free_speed if own_speed else free,
                  "library" if own_speed else free_from, found.beam, found.mass if np.isfinite(found.mass) else mass)


def line(text, case, library=None, own_length=None):
    """The line of the call (text or None), or that of the case; own_length, m, replaces the length in the case. Raises
    BergtowError, as above."""
    table = towing.lines(library)
    there = case.get("tow.mode") in ("line", "thrust")
    number = lambda key: case_value(case, key, np.nan) if there else np.nan
    length, stiffness = own_length or number("tow.line_length"), number("tow.line_stiffness")
    if text is None:
        load = number("tow.line.breaking_load")
        return Line("case" if there else "", load if load > 0 else np.nan, stiffness, length)
    load = force(text, "--line")
    if load is not None:
        return Line(text, load, stiffness, length)
    found = known(table, text, "--line", "breaking load")
    return Line(found.name, found.breaking, found.stiffness, length)


def needed_pull(v, load, speed, efficiency, own=0.0):
    """Bollard pull, N, for a tow force at a speed; inf at and above the free-running speed. A load that is not finite
    is returned unchanged."""
    if not np.isfinite(load):
        return load
    return towing.needed_bollard_pull(load, speed, free_speed=v.free_speed, weather=efficiency, own_resistance=own)


def pull_at(v, speed, efficiency):
    """The pull of the vessel at a speed, N; NaN without a vessel."""
    return efficiency * v.pull * towing.pull_share(speed, v.free_speed)


def verdict(load, interval, has):
    """Does a pull hold a load? "yes", "no", "open" if it lies within the interval, "not_asked" without a vessel. A load
    without an interval is taken as exact; an end that is None or infinite means no bound."""
    if not np.isfinite([load, has]).all():
        return "not_asked" if not np.isfinite(has) else "open"
    low, high = interval or (load, load)
    high = np.inf if high is None or np.isnan(high) else high
    low = load if low is None or np.isnan(low) else low
    return "yes" if high <= has else "no" if low > has else "open"


def limit_speed(speeds, needs, has):
    """Speed, m/s, at which the required pull first exceeds the vessel's, linear between speeds; None if it never does,
    or already does at the first speed."""
    gap = np.asarray(has) - np.asarray(needs)
    k = int(np.argmax(gap < 0))
    if k == 0:  # the first, or none
        return None
    return float(speeds[k - 1] + (speeds[k] - speeds[k - 1]) * gap[k - 1] / (gap[k - 1] - gap[k]))


def limit_by_drag(v, efficiency, speed, load, drag):
    """The same from a single speed: the drag scales with the square of the speed, and the rest of the load is assumed
    to stay constant. None if the vessel cannot hold the load at that speed, or holds it at any speed."""
    def gap(u):
        return pull_at(v, u, efficiency) - (load + drag * ((u / speed) ** 2 - 1))
    if not np.isfinite(v.pull) or gap(speed) < 0:
        return None
    return bisected(speed, v.free_speed, lambda u: gap(u) >= 0)[0]
