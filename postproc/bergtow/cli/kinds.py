# SPDX-License-Identifier: MIT
"""Kinds of numbers that options take."""
import argparse
import math


def _within(text, number, fits, words):
    value = number(text)
    if not fits(value):
        raise argparse.ArgumentTypeError(f"{text} is {words}")
    return value


def finite(text):
    return _within(text, float, math.isfinite, "not a finite number")


def above_zero(text):
    return _within(text, float, lambda x: 0 < x < math.inf, "not above zero")


def not_below_zero(text):
    return _within(finite(text), float, lambda x: x >= 0, "below zero")


def at_least_one(text):
    return _within(text, int, lambda x: x >= 1, "below 1")


def share(text):
    return _within(text, float, lambda x: 0 < x < 1, "not between 0 and 1")


def whole_from(least, most):
    """Type of a whole number of an option."""
    def number(text):
        if not (text.isdecimal() and least <= int(text) <= most):
            raise argparse.ArgumentTypeError(f"{text} is no whole number from {least} to {most}")
        return int(text)
    return number
