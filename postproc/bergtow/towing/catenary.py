# SPDX-License-Identifier: MIT
"""The elastic catenary of a tow line, the law that tow.line.weight gives the simulated line; equations in
include/bergtow/catenary.h and docs/theory.md."""
from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass

from .. import _library
from ..errors import BergtowError
from ._given import above_zero


@dataclass(frozen=True)
class Catenary:
    """A uniform line between two ends at the same height, in water that is deep enough for its sag."""
    length: float  #: unstretched, m
    stiffness: float  #: EA, N
    weight: float  #: in water, N/m

    def __post_init__(self) -> None:
        above_zero(length=self.length, stiffness=self.stiffness, weight=self.weight)

    def span(self, pull: float) -> float:
        """Distance between the ends, m."""
        above_zero(pull=pull)
        return float(_library.library().bt_catenary_span(self.length, self.stiffness, self.weight, pull))

    def _at(self, span: float) -> tuple[float, float]:
        if not 0 <= span < math.inf:
            raise BergtowError(f"span: {span:g} m is not a distance of two ends; give a number from 0")
        tangent = ctypes.c_double()
        pull = _library.library().bt_catenary_pull(self.length, self.stiffness, self.weight, span,
                                                   ctypes.byref(tangent))
        return float(pull), tangent.value

    def pull(self, span: float) -> float:
        """Horizontal tension, N."""
        return self._at(span)[0]

    def stiffness_at(self, pull: float) -> float:
        """Derivative of the pull with respect to the span, N/m; for an almost straight line EA / length."""
        return self._at(self.span(pull))[1]

    def tension(self, pull: float) -> float:
        """Tension at the ends, where it is largest, N."""
        return math.hypot(pull, 0.5 * self.weight * self.length)

    def sag(self, pull: float) -> float:
        """Depth of the middle below the ends, m."""
        above_zero(pull=pull)
        u = 0.5 * self.weight * self.length / pull
        return self.length * (0.5 * u / (math.sqrt(1 + u * u) + 1) + 0.125 * self.weight * self.length / self.stiffness)

    def energy(self, pull: float) -> float:
        """Work stored in the line, stretch and lifted weight, starting from ends that meet, J: the integral of the pull
        over the span."""
        above_zero(pull=pull)
        half = 0.5 * self.weight * self.length
        # ∫ H dl = H l − ∫ l dH; H² asinh(half/H) − half √(H² + half²) + half², without differences of large numbers
        u = half / pull
        taken = pull * pull * (math.asinh(u) - u) - half * half * (half / (math.hypot(pull, half) + pull) - 1)
        return taken / self.weight + 0.5 * pull * pull * self.length / self.stiffness
