# SPDX-License-Identifier: MIT
"""Checks of numbers that a caller gives: rejected where a formula is undefined."""
from __future__ import annotations

import math

from ..errors import BergtowError


def above_zero(**given: float) -> None:
    """Raises BergtowError, with name and value of the first that is not a finite number above 0."""
    for name, value in given.items():
        if not 0 < value < math.inf:
            raise BergtowError(f"{name}: {value:g} is not above zero; give a finite number above 0")


def not_below_zero(**given: float) -> None:
    """Raises BergtowError, with name and value of the first that is not a finite number of at least 0."""
    for name, value in given.items():
        if not 0 <= value < math.inf:
            raise BergtowError(f"{name}: {value:g} is below zero or not finite; give a number from 0")
