# SPDX-License-Identifier: MIT
"""The moving window: the same bits on any ranks and threads, and what a user sees of it.

What turns the first tests red: a place tested only against the floes of one rank, a floe renewed by its owner alone while others hold copies,
sums in the order of the ranks, contacts that go on with the impulses of the place a floe has left. The first two were tried.
"""
import numpy as np
import pytest

from harness import CASE, DONE, TOW, VALIDATE, call, changed, differing, run, warned
from test_ranks import assert_same, many

# Two laps and a half through loose ice with small tiles, with and without a line, towards either end.
SPEED = {
    "run": {"dt": 0.125, "duration": 70},
    "domain": {"length": 26, "width": 18, "ends": "moving", "sides": "periodic"},
    "ice": {"concentration": 0.45, "size": 1, "size_law": "lognormal", "thickness": 0.04, "thickness_law": "lognormal", "restitution": 0.1},
    "body": {"length": 2, "draft": 0.5},
    "tow": {"speed": 0.8, "ramp": 1},
    "solver": {"tile": 2.5, "max_sweeps": 40},
    "output": {"frame_interval": 8},
}
# On a line, the other way, in the geographic frame, under every force: the field drifts.
LINE = changed(SPEED, domain__frame="geographic", domain__sides="wall", domain__ahead=14, domain__width=14, ice__concentration=0.35, ice__restitution=0, ice__seed=3,
               tow={"mode": "line", "speed": 0.8, "ramp": 1, "line_length": 3, "direction": 180}, water={"latitude": 75, "current_x": 0.1},
               air={"wind_x": 5, "wind_y": 3})
CASES = {"speed": SPEED, "line": LINE}


@pytest.fixture(scope="module", params=CASES)
def alone(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    return folder, run(folder, CASES[request.param], "--threads", 1, "--quiet"), request.param


def test_the_cases_show_what_they_are_for(alone):
    _, r, name = alone
    w = r.summary["moving_window"]
    assert w["laps"] > 1.9 and w["renewed"] > r.summary["n_floes"]
    assert name == "line" or w["kept"] + w["missed"] > 0 # places that are not free, floes carried along
    assert r.series("ice_resistance").max() > 0
    if name == "line":
        assert w["ice_drift_x_m"] > 5 and w["ice_drift_y_m"] == 0
        assert r.series("window_x")[-1] < r.series("window_x")[0] - 45


@pytest.mark.parametrize("division", range(2))
def test_the_same_bits(alone, division):
    folder, one, name = alone
    ranks, threads = {"speed": [(1, 2), (3, 2)], "line": [(2, 1), (4, 1)]}[name][division]
    r = many(folder, ranks, threads)
    assert_same(one, r)
    assert r.summary["moving_window"] == one.summary["moving_window"]
    if ranks > 1:
        assert r.summary["moved_floes"] > 50


def test_the_division_is_sound(alone):
    """Copies of a floe on several ranks stay copies, checked every 20 steps and after each migration."""
    folder, one, _ = alone
    assert_same(one, many(folder, 3, 1, name="valid", program=VALIDATE))


def test_overlap_falls_faster_than_the_step(tmp_path):
    """The deepest overlap is the step's and nothing that the window leaves: over four fields 0.0099 and 0.0040 of a floe at whole and half steps."""
    deepest = []
    for dt in (0.125, 0.0625):
        runs = [run(tmp_path, changed(LINE, ice__seed=seed, run__dt=dt, run__duration=40), "--quiet", name=f"{dt}-{seed}") for seed in range(1, 5)]
        assert all(r.summary["unconverged_steps"] == 0 for r in runs)
        deepest.append(np.mean([r.summary["max_overlap_relative"] for r in runs]))
    assert deepest[0] > 0.007 and deepest[1] < 0.5 * deepest[0]
