# SPDX-License-Identifier: MIT
"""Numbers that a caller gives: refused where no formula has a value."""
from __future__ import annotations

import math

from ..errors import BergtowError


def above_zero(**given: float) -> None:
    """Errors: BergtowError, with name and value of the first that is not a finite number above 0."""
    for name, value in given.items():
        if not 0 < value < math.inf:
            raise BergtowError(f"{name}: {value:g} is not above zero; give a finite number above 0")


def not_below_zero(**given: float) -> None:
    """Errors: BergtowError, with name and value of the first that is not a finite number from 0."""
    for name, value in given.items():
        if not 0 <= value < math.inf:
            raise BergtowError(f"{name}: {value:g} is below zero or not finite; give a number from 0")
