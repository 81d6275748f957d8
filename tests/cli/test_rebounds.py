# SPDX-License-Identifier: MIT
"""Rebounds with friction, many at once, give no energy: Newton's law alone would, and the coefficient is lowered where
it does (solve/solver.h)."""
import numpy as np
import pytest

from harness import changed, run
from scenes import NO_ROOM, REBOUNDS


@pytest.mark.parametrize("friction", [1.5, 0.8])
def test_no_energy_from_rebounds(tmp_path, friction):
    r = run(tmp_path, changed(REBOUNDS, ice__friction=friction))
    energy, work = r.series("kinetic_energy", "contact_work")
    assert friction < 1 or r.summary["restitution_cut_steps"] >= 1  # where it has to be lowered
    assert work.max() <= 1e-9 * energy[0], (work.max(), energy[0])
    assert (np.diff(energy) <= 1e-9 * energy[0]).all()
    assert energy[-1] > 0.2 * energy[0]  # and floes do rebound


#: a floe that flies from the middle between two others that stand fast
BETWEEN = {
    "run": {"dt": 1, "duration": 1},
    "domain": {"length": 40, "width": 40, "x0": -20, "ends": "open", "sides": "open"},
    "ice": {"concentration": 0, "thickness": 0.1, "drag": {"water_form": 0, "water_skin": 0,
                                                           "air_form": 0, "air_skin": 0}},
    "floes": [{"shape": "square", "length": 1, "x": -2, "y": 0, "fixed": True},
              {"shape": "square", "length": 1, "x": 2, "y": 0, "fixed": True},
              {"shape": "square", "length": 1, "x": 0, "y": 0, "vx": 4}],
    "body": {"shape": "none"},
}


@pytest.mark.parametrize("restitution, speed", [(0.3, 0.6), (0.5, 1), (0.9, 0.9)])
def test_a_rebound_goes_no_farther_than_there_is_room(tmp_path, restitution, speed):
    """1 m behind the floe there is another, so that in 1 s it comes back at 1 m/s at most: by as many halves."""
    r = run(tmp_path, changed(BETWEEN, ice__restitution=restitution))
    unconverged, locked, cut, energy = r.series("unconverged", "locked", "restitution_cut", "kinetic_energy")
    mass = 0.1 * 910
    assert (unconverged[0], locked[0], cut[0]) == (0, 0, 1)
    assert energy[0] == pytest.approx(0.5 * mass * speed**2, rel=1e-9)
    assert r.series("sweeps")[0] < 1500  # the proof ends what would go on for 8,000


def test_a_floe_that_a_towed_body_hits_is_not_locked_by_a_quay_behind_it(tmp_path):
    """It comes back from the quay while the body follows: in the third step there is room for both, but less than the
    rebound would take."""
    quay = {
        "run": {"dt": 5, "duration": 15},
        "domain": {"length": 400, "width": 400, "x0": -200, "ends": "open", "sides": "open"},
        "ice": {"concentration": 0, "size": 30, "restitution": 0.3, "drag": {"water_form": 0, "water_skin": 0}},
        "body": {"shape": "square", "length": 80, "x": -60, "draft": 50},
        "tow": {"mode": "speed", "speed": 0.5, "ramp": 0},
        "floes": [{"shape": "square", "length": 30, "x": 0, "y": 0},
                  {"shape": "square", "length": 30, "x": 34, "y": 0, "fixed": True}],
    }
    r = run(tmp_path, quay)
    assert r.summary["locked_steps"] == r.summary["unconverged_steps"] == 0
    assert r.summary["restitution_cut_steps"] == 1


def test_rebounds_that_friction_locks_are_let_be(tmp_path):
    """Without a proof by normal impulses the limit of work ends the sweeps, and the step goes on without rebounds."""
    r = run(tmp_path, NO_ROOM)
    unconverged, locked, cut, energy = r.series("unconverged", "locked", "restitution_cut", "kinetic_energy")
    assert not unconverged.any() and not locked.any() and cut[0] == 1
    assert (np.diff(energy) <= 1e-9 * energy[0]).all()
