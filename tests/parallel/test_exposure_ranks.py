# SPDX-License-Identifier: MIT
"""What floes leave of each other's drag on any number of ranks and threads, and across stops: the same bits.

Thick small floes, whose lee reaches over more than a cell, in wind and current, on each other, a large floe among them.

What turns these tests red: a floe in whose lee another stands and that its rank does not hold, factors that stay behind
in a migration or are not in a checkpoint, a look at another step after a stop, sheets in the order of memory.
"""
import h5py
import numpy as np
import pytest

from harness import run
from test_ranks import assert_legs_end_as, assert_same, many

COMPANY = {
    "run": {"dt": 0.1, "duration": 12},
    "domain": {"length": 40, "width": 30, "ends": "wall", "sides": "periodic", "ends_closing": 0.2},
    "ice": {"concentration": 0.7, "size": 1, "thickness": 0.3, "thickness_law": "lognormal", "friction": 0.2,
            "rafting": {"kappa": 2}, "x_max": 26},
    "floes": [{"shape": "square", "length": 9, "x": 33, "y": 0, "yaw": 20, "thickness": 0.4}],
    "body": {"shape": "none"},
    "air": {"wind_x": 6, "wind_y": 4},
    "water": {"current_x": -0.1, "current_y": 0.05},
    "solver": {"reference_speed": 4},  # looks every 10 steps
}


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    folder = tmp_path_factory.mktemp("company")
    return folder, run(folder, COMPANY, "--threads", 1, "--quiet")


def test_the_case_is_worth_it(alone):
    folder, r = alone
    assert r.summary["momentum_residual"] < 1e-9 and r.series("rafted_area").max() > 1
    many(folder, 1, 1, "--steps", 110, name="late")
    with h5py.File(folder / "late/checkpoint.h5") as f:
        skin, water, air = f["bodies/exposure"][:].T
    n = len(water) - 3  # the large floe and two walls
    for share in (skin, water, air):
        assert share.min() >= 0 and share.max() <= 1 and (share[n + 1:] == 1).all()
    assert (skin < 0.99).sum() > 20 and (water[:n] < 0.9).sum() > n / 2 and (air[:n] < 0.9).sum() > n / 4
    assert water[n] < 1 or air[n] < 1  # the large floe has neighbours, too
    assert not np.array_equal(water, air)


@pytest.mark.slow
@pytest.mark.parametrize("ranks, threads", [(1, 2), (2, 1), (2, 2), (3, 1)])
def test_ranks_and_threads(alone, ranks, threads):
    folder, one = alone
    assert_same(one, many(folder, ranks, threads))


def test_stopped_and_taken_up(alone):
    folder, one = alone
    assert_legs_end_as(one, folder, 47, 31)
