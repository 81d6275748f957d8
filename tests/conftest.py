# SPDX-License-Identifier: MIT
"""Puts tests/ and the Python package on the path, for the tests of every folder, and says early that the program is
missing."""
import os
import sys

import harness
import pytest

sys.path.insert(0, str(harness.ROOT / "postproc"))


def pytest_configure(config):
    config.addinivalue_line("markers", "slow: not in make test, but in make test-long")
    config.addinivalue_line("markers", "one_rank: in parallel/, and of a single process")
    config.addinivalue_line("markers", "ranks: of several processes, run with nothing beside them in make test: all "
                                       "others of parallel/")
    if not os.access(harness.BERGTOW, os.X_OK):
        raise pytest.UsageError(f"{harness.BERGTOW}: no such program; build it with make, or name it in BERGTOW")


def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.parent.name == "parallel" and not item.get_closest_marker("one_rank"):
            item.add_marker("ranks")


@pytest.fixture(scope="session")
def library():
    """The shared library, which the Python package loads."""
    harness.make("lib")


@pytest.fixture
def look():
    """Settings of matplotlib as a command has them, for figures that a test draws itself."""
    from bergtow.plot import style  # not before: most tests draw nothing
    with style.look():
        yield
