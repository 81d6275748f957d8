# SPDX-License-Identifier: MIT
"""Does a berg stay upright under tow?

A floating body is stable in roll while its metacentre lies above its centre of gravity [Bass 1980, Annals of
Glaciology, "Stability of icebergs"]: GM = BM − BG > 0, BM = I/V with I the second moment of the waterline about the
weak axis and V the displaced volume. For a column of uniform density with vertical sides, draft D and sail s, BG = s/2
and BM = (I/A)/D. For a block of width W and height H = D + s that floats freely, D/H = ρ_i/ρ_w, this is

    W/H > √(6 ρ_i/ρ_w (1 − ρ_i/ρ_w)),   0.80 for 900 and 1025 kg/m³

the hydrostatic criterion that Burton et al. 2012 (doi 10.1029/2011JF002055) found to agree with blocks in a tank. A
berg that tapers, or has a foot, is a different body: for it the number is a first estimate.
"""
from __future__ import annotations

import math
from dataclasses import dataclass

from .._library import limit
from ..case import preset
from ..errors import BergtowError
from ._given import above_zero, not_below_zero


def metacentric_height(width: float, draft: float, sail: float, gyration: float | None = None) -> float:
    """GM of a column, m. gyration: √(I/A) of its waterline about the weak axis, m; by default that of a block,
    width/√12 (a disc: width/4)."""
    above_zero(width=width, draft=draft)
    not_below_zero(sail=sail)
    square = width * width / 12 if gyration is None else gyration * gyration
    return square / draft - 0.5 * sail


def critical_ratio(density: float, water_density: float | None = None) -> float:
    """W/H of a free block below which it rolls over; density of the water: by default that of a case."""
    water_density = preset("water.density") if water_density is None else water_density
    above_zero(density=density, water_density=water_density)
    if density >= water_density:
        raise BergtowError(f"density: {density:g} kg/m3 does not float in {water_density:g} kg/m3; give a lower one")
    r = density / water_density
    return math.sqrt(6 * r * (1 - r))


@dataclass(frozen=True)
class RollStability:
    """Stability of a block: GM m, width/height, and the ratio below which it rolls over."""
    gm: float
    ratio: float
    critical: float
    stable: bool


def roll_stability(width: float, draft: float, density: float | None = None,
                   water_density: float | None = None) -> RollStability:
    """Stability of a free block of this width (its least) and draft; densities: by default those of a case."""
    density = preset("body.density") if density is None else density
    water_density = preset("water.density") if water_density is None else water_density
    critical = critical_ratio(density, water_density)
    height = draft * water_density / density
    gm = metacentric_height(width, draft, height - draft)
    return RollStability(gm, width / height, critical, gm > 0)


def overturning_moment(pull: float, line_height: float, draft: float, resistance_depth: float | None = None) -> float:
    """Moment, N m, of the pull of a line at this height above the waterline (below: negative) and the water drag on the
    hull, which acts at resistance_depth below it; by default half the draft, as for a column in uniform flow."""
    not_below_zero(pull=pull)
    above_zero(draft=draft)
    return pull * (line_height + (0.5 * draft if resistance_depth is None else resistance_depth))


def heel_angle(moment: float, mass: float, gm: float) -> float:
    """Heel angle at which the righting moment balances a moment, rad: sin φ = M/(m g GM); inf if none does. Small
    angles only: beyond 10° the shape of the hull matters."""
    above_zero(mass=mass)
    if not gm > 0:
        return math.inf
    sine = abs(moment) / (mass * limit("gravity_m_s2") * gm)
    return math.asin(sine) if sine <= 1 else math.inf
