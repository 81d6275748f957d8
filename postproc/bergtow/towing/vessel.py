# SPDX-License-Identifier: MIT
"""From a tow force to bollard pull and breaking load.

Efficiencies and the safety factor have no default that claims a standard: those of ISO 19906, ISO 35106 and DNV-ST-N001
have not been read here. The caller gives them, and names the source.
"""
from __future__ import annotations

import csv
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Union

import numpy as np

from .. import _library
from ..case import preset
from ..errors import CASE, IO, BergtowError
from ._given import above_zero, not_below_zero

STANDARD_GRAVITY = 9.80665  #: m/s2, by definition: a tonne of bollard pull is 9.80665 kN

#: a name, or points (speed m/s, share) with increasing speeds; linear between, constant outside
Curve = Union[str, Sequence[tuple[float, float]]]


def tonnes(force: float) -> float:
    """A force in tonnes, as bollard pulls are given."""
    return force / (1000 * STANDARD_GRAVITY)


def utilisation(load: float, breaking: float, safety_factor: float) -> float:
    """load × safety factor / breaking load; above 1 the line is too weak. The factor is the caller's."""
    not_below_zero(load=load)
    above_zero(breaking=breaking, safety_factor=safety_factor)
    return load * safety_factor / breaking


def needed_breaking(load: float, safety_factor: float) -> float:
    """Breaking load, N, of a line that is fully utilised. The factor is the caller's."""
    not_below_zero(load=load)
    above_zero(safety_factor=safety_factor)
    return load * safety_factor


def read_curve(path: str | os.PathLike[str]) -> list[tuple[float, float]]:
    """Points of a CSV file with the head speed_m_s,share. Raises BergtowError with file, line and column."""
    try:
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise BergtowError(f"{path}: cannot be read ({error}); name a CSV file", IO) from None
    if not rows or [c.strip() for c in rows[0]] != ["speed_m_s", "share"]:
        raise BergtowError(f"{path}:1: the header is not speed_m_s,share; give these two columns", CASE)
    points: list[tuple[float, float]] = []
    for number, row in enumerate(rows[1:], 2):
        if not any(c.strip() for c in row):
            continue
        values = []
        for name, text in zip(("speed_m_s", "share"), [*row, "", ""]):
            try:
                value = float(text)
            except ValueError:
                value = math.nan
            if not 0 <= value < math.inf:
                raise BergtowError(f"{path}:{number}: {name}: {text!r} is not a number from 0; correct it", CASE)
            values.append(value)
        if points and values[0] <= points[-1][0]:
            raise BergtowError(f"{path}:{number}: speed_m_s: {values[0]:g} is not above {points[-1][0]:g} of the "
                               "previous row; put the speeds in order", CASE)
        points.append((values[0], values[1]))
    if not points:
        raise BergtowError(f"{path}:1: there is no row below the header; give at least one", CASE)
    return points


def pull_share(speed: float, free_speed: float | None = None, curve: Curve = "quadratic") -> float:
    """Share of the bollard pull that is left at a speed through the water (m/s), after the vessel's own resistance in
    open water. "quadratic", 1 − (v/v_f)², as for the simulated vessel, and "linear", 1 − v/v_f, are both 0 at the
    free-running speed v_f and assumed; or points of a user's curve."""
    not_below_zero(speed=speed)
    if not isinstance(curve, str):
        return float(np.interp(speed, *zip(*curve)))
    if curve not in ("quadratic", "linear"):
        raise BergtowError(f"curve: {curve!r} is not a curve; give quadratic, linear, or points (read_curve)")
    if free_speed is None or not 0 < free_speed < math.inf:
        raise BergtowError(f"free_speed: {free_speed} is not a speed, and a {curve} curve needs it; give the "
                           "free-running speed in m/s, or points of a curve")
    ratio = min(speed / free_speed, 1.0)
    return 1 - ratio * ratio if curve == "quadratic" else 1 - ratio


def needed_bollard_pull(tow_force: float, speed: float, *, free_speed: float | None = None,
                        curve: Curve = "quadratic", weather: float = 1.0, tow: float = 1.0,
                        own_resistance: float = 0.0) -> float:
    """Bollard pull, N, of a vessel that exerts this force on the line at this speed through the water:

        (force + own resistance in ice) / (share left at the speed × efficiencies)

    weather and tow are efficiencies in (0, 1] for the effects of waves, wind and a line that is not aligned with the
    thrust; 1 = not taken into account. inf if the vessel has no pull left at this speed.
    """
    not_below_zero(tow_force=tow_force, own_resistance=own_resistance)
    for name, value in (("weather", weather), ("tow", tow)):
        if not 0 < value <= 1:
            raise BergtowError(f"{name}: {value:g} is not an efficiency; give a number above 0 and at most 1")
    left = pull_share(speed, free_speed, curve) * weather * tow
    return (tow_force + own_resistance) / left if left > 0 else math.inf


@dataclass(frozen=True)
class IceResistance:
    """An estimate of a vessel's own resistance in ice, N: from a slender to a blunt bow, with its source."""
    low: float
    high: float
    source: str


def ice_resistance(beam: float, thickness: float, concentration: float, speed: float,
                   ice_density: float | None = None) -> IceResistance:
    """A ship in pack ice, by the regression for ships that is also among the estimates. The source gives no range of
    ice and speed, and the hulls differ by a factor of more than ten at one knot: an order of magnitude. ice_density: by
    default that of a case."""
    ice_density = preset("ice.density") if ice_density is None else ice_density
    above_zero(beam=beam, ice_density=ice_density)
    not_below_zero(thickness=thickness, speed=speed)
    if not 0 <= concentration <= 1:
        raise BergtowError(f"concentration: {concentration:g} is not a share of the area; give a number from 0 to 1")
    e = _library.library().bt_estimate_ship(beam, thickness, concentration, speed, ice_density)
    return IceResistance(e.low, e.high, "form of Colbourne 2000 (not at hand), coefficients of PolarRoute (British "
                                        "Antarctic Survey): slender to blunt hull")
