# SPDX-License-Identifier: MIT
"""Bodies that cannot give way: told apart from jams that only want more work.

Each scene has so little work that its steps do not converge; the answer is known from the geometry alone. Red when
bodies that have a way out are called locked, a lock is not found (also across ranks), what rafts counts as hard, or the
summary advises more sweeps against a lock.
"""
import numpy as np
import pytest

from harness import NUMERIC, Run, changed, run, warned
from resuming import done

A = 1.0
TOWED = {
    "run": {"dt": 0.1, "duration": 1},
    "domain": {"length": 12, "width": 8, "wall_friction": 0},
    "ice": {"concentration": 0, "friction": 0, "thickness": 0.3},
    "body": {"shape": "rectangle", "length": 1, "width": 3, "x": 2, "draft": 0.5, "friction": 0},
    "tow": {"speed": 0.1, "ramp": 0},
    "output": {"window_start": 0},
    "guard": {"no_solution": 0},
    "solver": {"tolerance": 1e-6, "max_sweeps": 2},  # too little for any of these
}


def row(n, end=12.0, turn=0.0, y=0.0):
    """n squares in a row that ends at x = end."""
    return [{"shape": "rectangle", "length": A, "width": A, "x": end - (n - k - 0.5) * A, "y": y, "yaw": turn,
             "thickness": 0.3} for k in range(n)]


def towards(n, end=12.0, **more):
    """The body, just before a row of squares."""
    return changed(TOWED, floes=row(n, end, **more), body__x=end - n * A - 0.51)


SCENES = {
    "one floe at the wall": (towards(1), True),
    "a row at the wall": (towards(8), True),
    "a row that is pushed into open water": (towards(8, 11.0), False),
    "a wedge that parts two floes": (changed(
        TOWED, floes=row(1, 12.0, y=0.55) + row(1, 12.0, y=-0.55),
        body={"shape": "polygon", "x": 9.9, "draft": 0.5, "friction": 0,
              "vertices": [[1.0, 0.0], [-0.6, 0.8], [-0.6, -0.8]]}), False),
    "floes that raft": (changed(towards(10), ice__rafting={"kappa": 5}, solver__max_sweeps=1, solver__tolerance=1e-12,
                               run__duration=4), False),
    "heavy floes that have room": (changed(towards(6, 11.9), ice__thickness=3.0), False),
}


def test_a_lock_below_the_tolerance_is_not_silent(tmp_path):
    """Walls close by 0.4 mm/s on a full row of 18 squares: a contact by 0.04 mm/s, which passes for rest. Red without a
    word. With the tolerance that is asked for the steps are locked."""
    case = changed(TOWED, run__duration=120, domain__width=18, domain__sides_closing=4e-4, body={"shape": "none"},
                   tow={"mode": "none"}, output=None, ice__concentration=0, floes=[
                       {"shape": "rectangle", "length": A, "width": A, "x": 6, "y": k - 8.5, "thickness": 0.3}
                       for k in range(18)], solver={"reference_speed": 0.5})
    r = run(tmp_path, case, name="a")
    said = warned(r, "domain.sides_closing: 0.0004 m/s, shared out among the contacts of some 16 floes")
    assert said and warned(r, "the position projection met its limit of work") and r.summary["unprojected_steps"] > 0
    assert r.summary["locked_steps"] == 0
    case["solver"]["tolerance"] = float(said[0].rsplit(" ", 1)[1])
    locked = run(tmp_path, changed(case, run__duration=1), name="b")
    assert locked.summary["locked_steps"] > 5 and not warned(locked, "takes .* for rest")


@pytest.mark.parametrize("name", SCENES)
def test_bodies_that_cannot_give_way(tmp_path, name):
    case, locks = SCENES[name]
    r = run(tmp_path, case)
    unconverged, locked = r.series("unconverged", "locked")
    assert np.all(locked <= unconverged) and r.summary["locked_steps"] == locked.sum()
    assert (locked.sum() > 0) == locks, (unconverged.sum(), locked.sum())
    assert bool(warned(r, "locked between others.*no bounded load")) == locks
    if locks:
        assert locked.sum() >= 5
        assert bool(warned(r, "more work would not help")) == (locked.sum() == unconverged.sum())
    else:
        assert name != "floes that raft" or unconverged.sum() > 5
    if unconverged.sum() > locked.sum():
        assert warned(r, "raise solver.max_sweeps")


def test_more_work_does_not_unlock(tmp_path):
    case, _ = SCENES["a row at the wall"]
    some, more = (run(tmp_path, changed(case, solver__max_sweeps=n), name=f"n{n}") for n in (3, 50))
    assert some.summary["locked_steps"] == more.summary["locked_steps"] > 7


def test_the_same_on_ranks(tmp_path):
    case, _ = SCENES["a row at the wall"]
    alone = run(tmp_path, case, name="alone")
    result = done(2, "run", tmp_path / "case.yml", "-o", tmp_path / "many", "--quiet")
    many = Run(tmp_path / "many", result)
    assert alone.hash == many.hash and np.array_equal(alone.series("locked"), many.series("locked"))


def test_a_guard_says_that_it_is_a_lock(tmp_path):
    case = changed(SCENES["a row at the wall"][0], guard__unconverged=5)
    r = run(tmp_path, case, code=NUMERIC)
    assert "locked between others" in r.result.stderr
