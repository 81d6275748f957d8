# SPDX-License-Identifier: MIT
"""Bodies that cannot give way: told apart from jams that only want more work.

Each scene has so little work that its steps do not converge; the answer is known from the geometry alone. Red when
bodies that have a way out are called locked, a lock is not found (also across ranks), what rafts counts as hard, the
summary advises more sweeps against a lock, or prints its loads as numbers.
"""
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import scipy.optimize
import scipy.sparse

from harness import NUMERIC, Run, area, changed, differing, quick, run, warned, write_case
from resuming import done

from bergtow.result import run as bergtow_read
from bergtow.result.members import Members
from bergtow.stats import loads

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
                   tow={"mode": "none"}, output=None, floes=column(), solver={"reference_speed": 0.5})
    r = run(tmp_path, case, name="a")
    said = warned(r, "domain.sides_closing: 0.0004 m/s, divided among the contacts of about 16 floes")
    assert said and warned(r, "the position projection reached its work limit") and r.summary["unprojected_steps"] > 0
    assert r.summary["locked_steps"] == 0
    case["solver"]["tolerance"] = float(said[0].rsplit(" ", 1)[1])
    locked = run(tmp_path, changed(case, run__duration=1), name="b")
    assert locked.summary["locked_steps"] > 5 and not warned(locked, "treats speeds .* as rest")


def column():
    """A row of squares from wall to wall of a domain 18 m wide."""
    return [{"shape": "rectangle", "length": A, "width": A, "x": 6, "y": k - 8.5, "thickness": 0.3} for k in range(18)]


@pytest.mark.parametrize("sweeps, short", [(1, True), (5, False)])
def test_a_lock_below_the_tolerance_is_none_beside_a_jam_either(tmp_path, sweeps, short):
    """A heavy floe runs into others far from such a row. Red when the proof is held against what passes for rest once
    anything else wants more work."""
    others = [{"shape": "rectangle", "length": A, "width": A, "x": 9 + k, "y": 0.3 * (k % 2),
               "thickness": 3 if k else 9, "vx": 0 if k else 0.3} for k in range(8)]
    r = run(tmp_path, changed(TOWED, domain__length=24, domain__width=18, domain__sides_closing=4e-4,
                              body={"shape": "none"}, tow={"mode": "none"}, output=None, floes=column() + others,
                              solver={"reference_speed": 0.5, "max_sweeps": sweeps}))
    assert (r.summary["unconverged_steps"] > 0) == short and r.summary["locked_steps"] == 0


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
    found, again = some.series("locked"), more.series("locked")
    assert found.sum() > 7 and np.all(again >= found), "a lock that little work has proved is there with more"


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


def test_a_share_of_steps_without_a_solution_ends_the_run(tmp_path):
    case = changed(SCENES["a row at the wall"][0], guard__no_solution=0.3)
    r = run(tmp_path, case, code=NUMERIC)
    assert "steps have no solution" in r.result.stderr and "guard.no_solution allows 3" in r.result.stderr
    assert " [no_solution]\n" in r.result.stderr
    lost = r.series("no_load")  # up to the step before the fourth
    assert lost.sum() == 3 and lost[-1] == 1


# ---- wedges

MU = 0.35
ANGLE_OF_FRICTION = np.arctan(MU)
GAP = 1e-4


def centred(vertices):
    v = np.array(vertices, float)
    x, y = v.T
    c = x * np.roll(y, -1) - np.roll(x, -1) * y
    middle = np.array([((x + np.roll(x, -1)) * c).sum(), ((y + np.roll(y, -1)) * c).sum()]) / (6 * area(v))
    return (v - middle).tolist(), middle


def wedge(half, thickness=1.0, **more):
    """A floe of half angle `half`, wide ahead, between a body that comes down on it and a fixed floe."""
    t = np.tan(half)
    body, at_body = centred([[-2, -2 * t], [2, 2 * t], [2, 3], [-2, 3]])
    below, at_below = centred([[-2, 2 * t], [-2, -3], [2, -3], [2, -2 * t]])
    floe, at_floe = centred([[-1, t - 1], [1, -1 - t], [1, 1 + t], [-1, 1 - t]])
    up = 1 + GAP
    return changed({
        "run": {"dt": 0.1, "duration": 1},
        "domain": {"length": 20, "width": 20, "sides": "open", "ends": "open"},
        "ice": {"concentration": 0, "friction": MU},
        "body": {"shape": "polygon", "vertices": body, "x": 10 + at_body[0], "y": at_body[1] + up, "draft": 0.5,
                 "friction": MU},
        "tow": {"speed": 0.1, "ramp": 0, "direction": -90},
        "floes": [{"shape": "polygon", "vertices": floe, "x": 10 + at_floe[0], "y": at_floe[1],
                   "thickness": thickness},
                  {"shape": "polygon", "vertices": below, "x": 10 + at_below[0], "y": at_below[1] - up,
                   "thickness": 1, "fixed": True}],
        "output": {"window_start": 0}, "guard": {"overlap": 0, "no_solution": 0}}, **more)


def first_load(half, speed=0.1, dt=0.1):
    """On the body in the first step over the mass of the wedge, both faces sliding: ux, uy the velocity of the wedge,
    p and q the impulses at the body and at the fixed floe."""
    gap, c, s = GAP * np.cos(half), np.cos(half), np.sin(half)
    ux = (speed * c - 2 * gap / dt) / (2 * s)
    total, difference = ux / (s - MU * c), speed / (2 * (c + MU * s))
    return 0.5 * (total + difference) * (c + MU * s) / dt


@pytest.mark.parametrize("half", [0.05, 0.17, 0.3])
def test_a_wedge_below_its_angle_of_friction_has_no_load(tmp_path, half):
    """Velocities that part it exist, and friction forbids them. Red when the proof is without friction, or the sweeps'
    load is printed."""
    r = run(tmp_path, wedge(half))
    lost, ice, tow, drag = r.series("no_load", "ice_resistance", "tow_force", "drag_force")
    assert lost.sum() == r.summary["no_load_steps"] >= 9 and np.array_equal(np.isnan(ice), lost == 1)
    assert np.array_equal(np.isnan(tow), lost == 1) and np.isfinite(drag).all()
    window = r.summary["window"]
    assert window["at_least"] and window["no_load_share"] == pytest.approx(lost.mean())
    assert window["verdict"] == "not steady" and "no_load" in [reason["code"] for reason in window["reasons"]]
    assert "ice resistance    at least " in r.result.stdout and r.summary["peak_ice_resistance_n"] < 1e5
    assert len(warned(r, "locked between others")) == 1


@pytest.mark.parametrize("above, thickness, least", [(1e-2, 1, 1e5), (1e-3, 1, 1e6), (1e-4, 40, 1e9)])
def test_a_wedge_above_it_has_a_load_however_large(tmp_path, above, thickness, least):
    """Against its closed form, whose mass comes from a wedge far above. Red when loads that are large pass for none."""
    r, easy = (run(tmp_path, wedge(ANGLE_OF_FRICTION + a, thickness=thickness, run__duration=0.1), name=name)
               for a, name in ((above, "out"), (0.02, "easy")))
    assert r.summary["unconverged_steps"] == easy.summary["unconverged_steps"] == 0
    load, base = r.series("ice_resistance")[0], easy.series("ice_resistance")[0]
    wanted = base * first_load(ANGLE_OF_FRICTION + above) / first_load(ANGLE_OF_FRICTION + 0.02)
    assert load > least and load == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("above, sweeps", [(0.1, 1), (1e-3, 1), (1e-3, 20), (1e-4, 5), (1e-5, 3), (1e-5, 100),
                                           (1e-6, 500)])
def test_a_wedge_above_it_is_not_locked_when_work_is_short(tmp_path, above, sweeps):
    r = run(tmp_path, wedge(ANGLE_OF_FRICTION + above, thickness=3, solver={"max_sweeps": sweeps}, run__duration=0.5))
    assert r.summary["locked_steps"] == 0
    assert above > 1e-2 or r.summary["unconverged_steps"] > 0


@pytest.mark.parametrize("half, share, sweeps", [(0.1, 0.9, 2), (0.1, 0.6, 2), (0.1, 0.3, 3), (0.17, 0.9, 1)])
def test_a_wedge_that_is_dragged_out_is_not_locked(tmp_path, half, share, sweeps):
    """Below its angle of friction, under a body that goes aside faster than it comes down: its friction drags the wedge
    out, and 50 sweeps find the load. Red when friction of contacts that slide is taken for one that holds."""
    case = wedge(half, tow__direction=-np.degrees(share * half), run__duration=0.5)
    short, enough = (run(tmp_path, changed(case, solver={"max_sweeps": n}), name=f"n{n}") for n in (sweeps, 50))
    assert enough.summary["unconverged_steps"] == 0 and short.summary["unconverged_steps"] > 0
    assert short.summary["locked_steps"] == 0


def test_friction_proves_nothing_of_loads_that_the_sweeps_have_not_come_to(tmp_path):
    """One sweep is far from the loads that balance each other, and another solution may be as near. Red when such a
    step counts as locked all the same."""
    case = wedge(0.15, tow__direction=0, tow__speed=0.05, ice__friction=2, body__friction=2, run__duration=0.1)
    one, many = (run(tmp_path, changed(case, solver={"max_sweeps": n, "inner_sweeps": 1}), name=f"n{n}")
                 for n in (1, 500))
    assert one.summary["unconverged_steps"] == many.summary["unconverged_steps"] == 1
    assert one.summary["locked_steps"] == 0 and many.summary["locked_steps"] == 1


def test_a_line_pulls_as_hard_as_it_does(tmp_path):
    """A body on a stiff line presses a floe against fixed ice with up to 1e9 N: EA/L times what the end has gone on
    since."""
    block = changed(row(1, 13.0)[0], width=6, fixed=True)
    case = changed(towards(1), tow={"mode": "line", "speed": 0.1, "ramp": 0, "line_length": 5, "line_stiffness": 2e9},
                   body__length=3, body__draft=20, body__x=12 - A - 1.501, floes=[changed(row(1)[0], width=4), block],
                   solver=None, run__duration=30, guard={"energy": 0}, domain__length=40,
                   ice__friction=MU, body__friction=MU)  # without it the line pulls the body aside in the end
    r = run(tmp_path, case)
    time, ice, tension, lost = r.series("time", "ice_resistance", "line_tension", "no_load")
    assert tension[-1] > 1e9 and lost.sum() == 0 and np.isfinite(ice).all()
    assert ice[-1] == pytest.approx(tension[-1], rel=1e-3)
    assert tension[-1] - tension[-11] == pytest.approx(2e9 / 5 * 0.1 * (time[-1] - time[-11]), rel=0.01)


# ---- jams

def jam(seed, concentration, friction=MU, **more):
    return changed({
        "run": {"dt": 0.1, "duration": 2.4}, "domain": {"length": 12, "width": 6},
        "ice": {"concentration": concentration, "size": 1, "friction": friction, "seed": seed, "thickness": 0.3},
        "body": {"shape": "rectangle", "length": 3, "width": 3, "x": 3, "draft": 1, "friction": friction},
        "tow": {"speed": 0.3, "ramp": 0}, "output": {"window_start": 0}, "solver": {"max_sweeps": 30},
        "guard": {"overlap": 0, "no_solution": 0, "escape": False}}, **more)


@pytest.mark.parametrize("seed", quick(range(200), 0, 1, 2, 3, 4, 5))
def test_a_jam_with_room_is_never_locked(tmp_path, seed):
    """Where nothing but the body is led, all bodies may go along with it: there is a solution. The work is too little
    for most steps."""
    r = run(tmp_path, jam(seed, 0.9, [0.1, 0.35, 0.8][seed % 3], domain__ends="open", domain__sides="open",
                          domain__wall_friction=None, solver__max_sweeps=[1, 2, 3][seed % 3]))
    assert r.summary["locked_steps"] == 0 and r.summary["unconverged_steps"] > 0


def self_stress(path):
    """Least work of the led bodies on loads that balance each other within the friction cones and sum to 1, an
    independent linear programme over the dumped problem: below 0, no velocities part every contact by friction times
    its slip."""
    with h5py.File(path) as h:
        g = h["fclib_local"]
        m = int(g["W/m"][0])
        w = scipy.sparse.csr_matrix((g["W/x"][:], g["W/i"][:], g["W/p"][:]), (m, m))
        q, mu = g["vectors/q"][:], g["vectors/mu"][:]
    scale = scipy.sparse.diags(1 / np.sqrt(w.diagonal()))
    size, n = scale.diagonal(), m // 2
    normal, tangent = np.arange(0, m, 2), np.arange(1, m, 2)
    rows = np.tile(np.arange(n), 2)
    cone = scipy.sparse.vstack([
        scipy.sparse.csr_matrix((np.r_[sign * size[tangent], -mu * size[normal]], (rows, np.r_[tangent, normal])),
                                (n, m)) for sign in (1, -1)])
    total = scipy.sparse.csr_matrix((size[normal] / size[normal].mean(), (np.zeros(n, int), normal)), (1, m))
    found = scipy.optimize.linprog(size * q / np.abs(size * q).max(), A_ub=cone, b_ub=np.zeros(2 * n),
                                   A_eq=scipy.sparse.vstack([scale @ w @ scale, total]), b_eq=np.r_[np.zeros(m), 1.0],
                                   bounds=[(0, None), (None, None)] * n, method="highs")
    return found.fun if found.status == 0 else np.inf


@pytest.mark.parametrize("friction", [0, MU])
def test_a_closed_box_locks(tmp_path, friction):
    """A body that is led through a full box with walls. Each step that is called locked has a self-stress against which
    the led body works."""
    case = jam(1, 0.9, friction)
    r = run(tmp_path, case)
    lost = np.flatnonzero(r.series("no_load"))
    assert len(lost) >= 3 and lost[0] > 5
    dump = tmp_path / "problem.h5"
    run(tmp_path, changed(case, run__duration=round(0.1 * (lost[0] + 1), 3)), "--dump-contacts",
        f"{lost[0] + 1}:{dump}", name="short")
    assert self_stress(dump) < -1e-5


def test_locks_are_the_same_on_ranks_and_after_a_resume(tmp_path):
    """Red when loads without a number are refused in a checkpoint, or ranks prove different things."""
    write_case(tmp_path, jam(1, 0.9, run__duration=3.2, output={"window_start": 0, "panels": True,
                                                                  "sample_every": 2, "frame_interval": 0.1}))
    done(1, "run", tmp_path / "case.yml", "-o", tmp_path / "whole", "--quiet")
    whole = Run(tmp_path / "whole", None)
    assert whole.summary["no_load_steps"] > 3
    done(2, "run", tmp_path / "case.yml", "-o", tmp_path / "many", "--quiet")
    done(1, "run", tmp_path / "case.yml", "-o", tmp_path / "part", "--steps", 15, "--quiet")
    done(2, "resume", tmp_path / "part", "--quiet")
    for name in ("many", "part"):
        other = Run(tmp_path / name, None)
        assert other.hash == whole.hash and other.summary["no_load_steps"] == whole.summary["no_load_steps"]
        assert other.summary["window"] == whole.summary["window"]
        assert not [n for n in differing(tmp_path / "whole/result.h5", tmp_path / name / "result.h5")
                    if "series" in n or "frames" in n]


# ---- readers

def test_a_load_that_is_no_number_counts_as_the_last_one():
    x = np.array([np.nan, 1, np.nan, np.nan, 3])
    assert np.array_equal(bergtow_read.least(x), [0, 1, 1, 1, 3])
    assert np.isnan(bergtow_read.least(np.full(3, np.nan))).all()


def test_a_tow_without_a_load_has_no_tail():
    share, none = [0.0, 0.2, np.nan], np.zeros(3, int)
    e = SimpleNamespace(tows=lambda rows: rows, number=lambda key, m: share[m], events=lambda m: [], condition=none,
                        status=none, hole=[""] * 3, name=list("abc"))
    e.without_bound = lambda rows: Members.without_bound(e, rows)
    load = SimpleNamespace(name="ice_resistance", needs="")
    assert "no bound in some steps of 1 of 3 tows" in loads.cut_off(e, [0, 1, 2], load)
    assert loads.cut_off(e, [0, 2], load) == ""
