# SPDX-License-Identifier: MIT
"""Puts tests/ on the path, so that the tests of every folder find harness.py, and says early that the program is
missing."""
import os

import harness
import pytest


def pytest_configure(config):
    if not os.access(harness.BERGTOW, os.X_OK):
        raise pytest.UsageError(f"{harness.BERGTOW}: no such program; build it with make, or name it in BERGTOW")
