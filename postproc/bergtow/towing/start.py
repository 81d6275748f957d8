# SPDX-License-Identifier: MIT
"""What a start and a slack line do to the tension, and the ramp that keeps a start below a load.

Two masses on an elastic line move as one, m = a b/(a + b), on a spring, m x'' + k x = S, with x the stretch and S the
tension that the outer forces hold in the end; a line whose far end is led has the mass of the berg. Without damping, and
with forces that do not change while the line swings: upper bounds of what a line with damping bears. k = EA/L; of a line
with weight this is its stiffest. Added mass counts as mass.
"""
from __future__ import annotations

import math

from ..errors import BergtowError
from ._given import above_zero, not_below_zero
from .catenary import Catenary


def effective_mass(one: float, other: float = math.inf) -> float:
    """Of two bodies at the ends of a line, kg; other = inf: an end that is led."""
    above_zero(one=one)
    if not other > 0:
        raise BergtowError(f"other: {other:g} kg is no mass; give a number above 0, or inf for an end that is led")
    return one if math.isinf(other) else one * other / (one + other)


def snap_load(speed: float, stiffness: float, mass: float, static: float = 0.0, initial: float = 0.0) -> float:
    """Largest tension, N, of a line whose ends part at this speed (m/s) while it bears `initial`, 0 for one that has
    been slack; `static` is the tension that the outer forces hold in the end, initial = static that of a taut line at
    rest. From the energy of the swing about static:

        F = S + √((F0 − S)² + v² k m)
    """
    not_below_zero(speed=speed, static=static, initial=initial)
    above_zero(stiffness=stiffness, mass=mass)
    return static + math.sqrt((initial - static) ** 2 + speed * speed * stiffness * mass)


def snap_load_catenary(line: Catenary, speed: float, mass: float, pull: float, static: float = 0.0) -> float:
    """The same for a line with weight that bears `pull` (> 0) when its ends part at this speed: the pull, N, at which
    the work of the line beyond that of the static force has used up the motion, E(F) − E(F0) − S (l − l0) = m v²/2."""
    not_below_zero(speed=speed, static=static)
    above_zero(mass=mass, pull=pull)
    before, at_rest = line.energy(pull), line.span(pull)

    def left(force: float) -> float:
        return line.energy(force) - before - static * (line.span(force) - at_rest) - 0.5 * mass * speed * speed

    low = max(pull, static)  # beyond it `left` rises; by there at least the swing goes
    high = low + snap_load(speed, line.stiffness / line.length, mass, static, 0.0)
    while left(high) < 0:
        high *= 2
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if left(middle) < 0 else (low, middle)
    return high


def _frequency(stiffness: float, mass: float) -> float:
    above_zero(stiffness=stiffness, mass=mass)
    return math.sqrt(stiffness / mass)


def swing_after(ramp: float, speed: float, stiffness: float, mass: float) -> float:
    """Amplitude of the tension, N, that a linear ramp of the led end from 0 to this speed leaves behind:
    m v ω |sin(ωT/2)/(ωT/2)|, which is 0 after whole periods. Where the swing begins downwards the line goes slack, and
    bears none of it until something has slowed the berg."""
    not_below_zero(ramp=ramp, speed=speed)
    omega = _frequency(stiffness, mass)
    half = 0.5 * omega * ramp
    return mass * speed * omega * (abs(math.sin(half) / half) if half > 0 else 1.0)


def start_load(ramp: float, speed: float, stiffness: float, mass: float, resistance: float = 0.0) -> float:
    """Largest tension of a start from a taut line without tension, N. During the ramp the tension swings between 0 and
    2 m v/T, which it reaches when the ramp lasts half a period; a shorter one leaves swing_after. The resistance of the
    body (N, that of the full speed) comes on top of it: no less, since it grows with the speed."""
    not_below_zero(ramp=ramp, speed=speed, resistance=resistance)
    omega = _frequency(stiffness, mass)
    short = omega * ramp < math.pi
    return resistance + (swing_after(ramp, speed, stiffness, mass) if short else 2 * mass * speed / ramp)


def ramp_for(load: float, speed: float, stiffness: float, mass: float, resistance: float = 0.0) -> float:
    """Shortest ramp, s, of a start with at most this load, the inverse of start_load, which falls as the ramp grows;
    inf where the resistance alone is as large."""
    above_zero(load=load)
    not_below_zero(speed=speed, resistance=resistance)
    omega = _frequency(stiffness, mass)
    room, jerk = load - resistance, mass * speed * omega
    if room <= 0:
        return math.inf if resistance > load or speed > 0 else 0.0
    if room >= jerk:
        return 0.0
    if room <= jerk * 2 / math.pi:
        return 2 * mass * speed / room
    low, high = 0.0, 0.5 * math.pi  # sin x / x = room / jerk
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if math.sin(middle) / middle > room / jerk else (low, middle)
    return 2 * high / omega
