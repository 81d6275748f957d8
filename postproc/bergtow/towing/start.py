# SPDX-License-Identifier: MIT
"""The effect of a start and of a slack line on the tension, and the ramp that keeps a start below a load.

Two masses on an elastic line move as one, m = a b/(a + b), on a spring, m x'' + k x = S, with x the stretch and S the
tension that the outer forces hold in the end; a line whose far end has a prescribed motion has the mass of the berg.
There is no damping, and forces do not change while the line swings, so results are upper bounds for a line with
damping. k = EA/L, which a line with weight approaches as it is pulled straight. Added mass counts as mass.
"""
from __future__ import annotations

import math
from collections.abc import Callable

from ..errors import BergtowError
from ._given import above_zero, not_below_zero
from .catenary import Catenary


def effective_mass(one: float, other: float = math.inf) -> float:
    """Effective mass of two bodies at the ends of a line, kg; other = inf: an end with prescribed motion."""
    above_zero(one=one)
    if not other > 0:
        raise BergtowError(f"other: {other:g} kg is not a mass; give a number above 0, or inf for an end on a "
                           "prescribed path")
    return one if math.isinf(other) else one * other / (one + other)


def bisected(low: float, high: float, is_low: Callable[[float], bool]) -> tuple[float, float]:
    """Neighbours between a low number and a high one: the last that is low, and the first that is not."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if is_low(middle) else (low, middle)
    return low, high


def snap_load(speed: float, stiffness: float, mass: float, static: float = 0.0, initial: float = 0.0) -> float:
    """Largest tension, N, of a line whose ends separate at this speed (m/s) while it carries `initial`, 0 for a line
    that has been slack. `static` is the tension that the outer forces hold in the end; initial = static for a taut line
    at rest. From the energy of the swing about static:

        F = S + √((F0 − S)² + v² k m)
    """
    not_below_zero(speed=speed, static=static, initial=initial)
    above_zero(stiffness=stiffness, mass=mass)
    return static + math.sqrt((initial - static) ** 2 + speed * speed * stiffness * mass)


def snap_load_catenary(line: Catenary, speed: float, mass: float, pull: float, static: float = 0.0) -> float:
    """The same for a line with weight that carries `pull` (> 0) when its ends separate at this speed: the pull, N,
    where the work of the line beyond that of the static force equals the motion, E(F) − E(F0) − S (l − l0) = m v²/2."""
    not_below_zero(speed=speed, static=static)
    above_zero(mass=mass, pull=pull)
    before, at_rest = line.energy(pull), line.span(pull)

    def left(force: float) -> float:
        return line.energy(force) - before - static * (line.span(force) - at_rest) - 0.5 * mass * speed * speed

    low = max(pull, static)  # beyond it `left` increases; the swing reaches at least this far
    high = low + snap_load(speed, line.stiffness / line.length, mass, static, 0.0)
    while left(high) < 0:
        high *= 2
    return bisected(low, high, lambda force: left(force) < 0)[1]


def _frequency(stiffness: float, mass: float) -> float:
    above_zero(stiffness=stiffness, mass=mass)
    return math.sqrt(stiffness / mass)


def swing_after(ramp: float, speed: float, stiffness: float, mass: float) -> float:
    """Amplitude of the tension, N, that remains after a linear ramp of the prescribed end from 0 to this speed: m v ω
    |sin(ωT/2)/(ωT/2)|, which is 0 after whole periods. If the swing begins downwards the line goes slack, and carries
    none of it until something has slowed the berg."""
    not_below_zero(ramp=ramp, speed=speed)
    omega = _frequency(stiffness, mass)
    half = 0.5 * omega * ramp
    return mass * speed * omega * (abs(math.sin(half) / half) if half > 0 else 1.0)


def start_load(ramp: float, speed: float, stiffness: float, mass: float, resistance: float = 0.0) -> float:
    """Largest tension, N, in a start with a taut line at zero tension, for a body that a constant resistance R (N)
    holds until the line pulls as hard. If the resistance grows with speed, to R at full speed, it loads the line no
    more: as the berg gathers way it is below both R and the pull. With a = v/T the acceleration of the prescribed end:

        v0 = √(2 a R/k)                       its speed when the berg begins to move
        F = R + m a + √((m a)² + k m v0²)     if the swing reaches this within the ramp
        F = R + √(k² x² + k m v1²)            from the stretch x beyond R/k and its rate v1 at the end of a shorter one

    Without R: 2 m a for ramps of at least half a period, swing_after for shorter ones; without a ramp: R + m v ω.
    """
    not_below_zero(ramp=ramp, speed=speed, resistance=resistance)
    omega = _frequency(stiffness, mass)
    begins = math.sqrt(2 * resistance * ramp / (stiffness * speed)) if speed > 0 else 0.0
    if ramp <= begins or speed == 0:
        return resistance + mass * speed * omega
    acceleration = speed / ramp
    offset, rate = acceleration / omega ** 2, acceleration * begins / omega  # x = offset (1 − cos ωt) + rate sin ωt
    phase = omega * (ramp - begins)
    if phase >= math.pi - math.atan2(rate, offset):
        return resistance + stiffness * (offset + math.hypot(offset, rate))
    stretch = offset * (1 - math.cos(phase)) + rate * math.sin(phase)
    return resistance + stiffness * math.hypot(stretch, offset * math.sin(phase) + rate * math.cos(phase))


def ramp_for(load: float, speed: float, stiffness: float, mass: float, resistance: float = 0.0) -> float:
    """Shortest ramp, s, of a start with at most this load, the inverse of start_load, which decreases as the ramp
    grows; 0 if a start without a ramp carries no more, inf if the resistance alone is as large."""
    above_zero(load=load)
    not_below_zero(speed=speed, resistance=resistance)
    room = load - resistance
    if start_load(0, speed, stiffness, mass, resistance) <= load:
        return 0.0
    if room <= 0:
        return math.inf
    longest = 2 * mass * speed * load / room ** 2  # where R + m a + √((m a)² + 2 m a R) is the load
    return bisected(0.0, longest, lambda ramp: start_load(ramp, speed, stiffness, mass, resistance) > load)[1]
