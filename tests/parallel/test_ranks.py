# SPDX-License-Identifier: MIT
"""The same bits on any number of ranks and threads: state hash, every series and every frame, over 300 steps and more
in which cells are assigned anew, floes go from rank to rank, and contacts act across ranks.

What turns these tests red: a sum over ranks in double precision, a shared floe that is not brought up to date after a
phase, contacts in the order of a rank's memory instead of that of the ids, labels that depend on the division, what a
contact knew of the last step left behind when it goes to another rank. Each was tried.
"""
import random

import h5py
import numpy as np
import pytest

from harness import BERGTOW, DONE, PRESS, TOW, VALIDATE, Run, changed, differing, environment, quick, run, write_case
from resuming import assert_same_result, done
from test_ranks_output import mpirun

# A heavy berg on a line: one rank does its contacts, and the cells under it go with it. Tiles are small, so that there
# are many.
LINE = {
    "run": {"dt": 0.05, "duration": 16},
    "domain": {"length": 40, "width": 14},
    "ice": {"concentration": 0.8, "size": 1, "restitution": 0.1, "x_min": 6},
    "body": {"x": 4, "length": 2},
    "tow": {"mode": "line", "speed": 0.3, "ramp": 1, "line_length": 2},
    "solver": {"cell_size": 2.5, "max_sweeps": 40},
    "output": {"frame_interval": 2.5},
}
# The same berg at a set speed: every rank does its contacts with the floes of its own cells.
SPEED = changed(LINE, tow={"speed": 0.3, "ramp": 1, "direction": 8}, ice__restitution=0)
# Until it jams, and on: floes shoot apart, farther in a step than the margin. At restitution 1 rebounds are lowered
# island by island, and islands reach over ranks.
JAM = {
    "run": {"dt": 0.05, "duration": 20},
    "domain": {"length": 18, "width": 14, "ends_closing": 0.06, "sides_closing": 0.048},
    "ice": {"concentration": 0.75, "size": 0.9, "restitution": 1, "friction": 0.5},
    "body": {"shape": "none"},
    "solver": {"cell_size": 2.5, "max_sweeps": 15},
    "output": {"frame_interval": 2.5},
    # a jam that no one would run on: overlap beyond a floe, floes through the walls, no solution in the end
    "guard": {"overlap": 0, "escape": False, "no_solution": 0, "energy": 0},
}
# No walls, every force, and floes of very different size; the current, which the tide turns, carries them through cells
# and seams.
SEAMS = {
    "run": {"dt": 0.2, "duration": 64},
    "domain": {"length": 30, "width": 24, "ends": "periodic", "sides": "periodic"},
    "ice": {
        "concentration": 0.6, "size_law": "power", "size_min": 0.6, "size_max": 3, "size_exponent": 2,
        "thickness_law": "lognormal"
    },
    "body": {"shape": "none"},
    "water": {
        "latitude": 75, "current_x": 0.2, "current_y": -0.15, "tilt": "dynamic",
        "tide": {"major": 0.2, "minor": 0.1, "period": 80, "inclination": 30}
    },
    "air": {"wind_x": -6, "wind_y": 8},
    "solver": {"cell_size": 2},
    "output": {"frame_interval": 10},
}
# A berg that goes round a channel without ends.
ROUND = changed(LINE, domain={"length": 24, "width": 16, "ends": "periodic"}, ice={"concentration": 0.5, "size": 1},
                run__duration=34, run__dt=0.1, body__x=3, tow__speed=0.8)
# The same where the tide turns, in a managed lead: nothing rests, and between the walls the cells go with the water.
TIDE = changed(ROUND, run__dt=0.05, run__duration=16, water={"tide": {"major": 0.15, "minor": 0.1, "period": 20,
                                                                      "inclination": 60}}, tow__mode="line",
               lead={"mode": "managed", "width": 2, "floe_size": 0.6, "length": 8})
# Ice that crushes: what a pair has crushed stays with it when its cell is assigned to another rank, and when cells are
# labelled anew.
CRUSH = changed(LINE, ice__crushing={"pressure": "2 kPa", "least_length": 0.5}, ice__thickness_law="lognormal",
                domain__ends_closing=0.1)
# A ring of cells in packed ice: many lists, and rounds over a part of them. From rest: what drifts as a whole gives no
# rank more to do than another.
RING = changed(SEAMS, domain__length=16, domain__width=90, ice={"concentration": 0.85, "size": 1,
                                                                "thickness_law": "lognormal", "start": "rest"})
CASES = {
    "line": LINE, "speed": SPEED, "jam": JAM, "seams": SEAMS, "round": ROUND, "tide": TIDE, "crush": CRUSH, "ring": RING
}
# Each number of ranks and of threads, and few pairs twice: seven ranks on two cores take four times the processor time
# of three, so one case has them, and the small ones below.
PAIRS = {
    "line": [(1, 2), (2, 1), (2, 4), (3, 2), (4, 1)],
    "speed": [(2, 2), (3, 1)],
    "jam": [(2, 1), (3, 4)],
    "seams": [(4, 2), (7, 1)],
    "round": [(2, 1), (3, 2)],
    "tide": [(2, 2), (3, 1)],
    "crush": [(1, 4), (2, 2), (3, 1)],
    "ring": [(1, 2), (4, 1)],
}
LAYOUTS = quick([(n, *p) for n, pairs in PAIRS.items() for p in pairs], ("line", 3, 2), ("speed", 2, 2),
                ("jam", 2, 1), ("round", 3, 2), ("tide", 2, 2), ("crush", 3, 1), ("ring", 4, 1))


def many(folder, ranks, threads, *arguments, name=None, program=BERGTOW, env=None):
    name = name or f"out{ranks}x{threads}"
    result = mpirun(ranks,
                    "run",
                    "case.yml",
                    "-o",
                    name,
                    "--threads",
                    threads,
                    "--quiet",
                    *arguments,
                    program=(program, ),
                    cwd=folder,
                    env=env,
                    timeout=300)
    assert result.returncode == DONE, result.stderr
    r = Run(folder / name, result)
    assert (r.summary["ranks"], r.summary["threads"]) == (ranks, threads)
    return r


def assert_same(a, b):
    assert a.hash == b.hash
    assert differing(a.dir / "result.h5", b.dir / "result.h5") == []


def assert_legs_end_as(one, folder, first, second):
    """The case of a folder, stopped after `first` steps on two ranks of two threads and `second` more on three, ends on
    two threads as the run that was never stopped: one run holds both numbers of ranks, teams and stops. Returns the
    first checkpoint."""
    many(folder, 2, 2, "--steps", first, name="cut")
    with h5py.File(folder / "cut/checkpoint.h5") as f:
        checkpoint = {f"{group}/{name}": f[group][name][()] for group in ("bodies", "contacts") for name in f[group]}
    done(3, "resume", "cut", "--quiet", "--threads", 1, "--steps", second, cwd=folder)
    done(1, "resume", "cut", "--quiet", "--threads", 2, cwd=folder)
    assert_same_result(one.dir, folder / "cut")
    return checkpoint


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """name -> folder and result of the case on one rank with one thread, made once."""
    made = {}

    def make(name, *arguments):
        if (name, arguments) not in made:
            folder = tmp_path_factory.mktemp(name)
            made[name, arguments] = folder, run(folder, CASES[name], "--threads", 1, "--quiet", *arguments)
        return made[name, arguments]

    return make


@pytest.mark.parametrize("name", CASES)
@pytest.mark.slow
def test_the_cases_show_what_they_are_for(alone, name):
    r = alone(name)[1]
    assert r.summary["n_steps"] >= 320 and 150 <= r.summary["n_floes"] <= 1500
    assert r.summary["divisions"] == r.summary["moved_floes"] == r.summary["halo_share"] == 0
    contacts, sweeps, active = r.series("contacts", "sweeps", "active")
    assert sweeps.max() > 10
    if name in ("line", "speed", "round"):
        assert r.series("ice_resistance").max() > 0 and np.ptp(r.series("body_x")) > 2
        assert active.min() < 0.7 * r.summary["n_floes"] # floes at rest, and they wake up
    if name == "jam":
        assert contacts.max() > 3 * r.summary["n_floes"] and r.summary["restitution_cut_steps"] > 20
    if name == "seams":
        pose = r.dataset("/frames/pose")
        assert (np.abs(np.diff(pose[:, :, 0], axis=0)) > 15).any() and (np.abs(np.diff(pose[:, :, 1], axis=0)) >
                                                                        12).any()
        area = r.dataset("/floes/area")
        assert area.max() > 15 * area.min()
    if name == "crush":
        assert r.summary["crushing_steps"] > 100 and r.summary["max_crushing_contacts"] > 20 and 0.02 < r.summary[
            "max_crushed_depth_m"] < 0.6, r.summary
    if name == "round":
        assert np.ptp(r.series("body_x")) > 24 # the body came by the seam


@pytest.mark.parametrize("name, ranks, threads", LAYOUTS)
def test_the_same_bits(alone, name, ranks, threads):
    folder, one = alone(name)
    r = many(folder, ranks, threads)
    assert_same(one, r)
    if ranks == 1:
        return
    # Otherwise nothing was assigned, or nothing went over.
    assert r.summary["divisions"] >= 1 and r.summary["moved_floes"] > 50, r.summary
    assert 0 < r.summary["edge_cut"] <= 1 and 0 < r.summary["halo_share"] < 3
    assert 0 <= r.summary["imbalance"] <= r.summary["worst_imbalance"]
    assert 0 <= r.summary["repartition_imbalance"] <= r.summary["worst_repartition_imbalance"]


@pytest.mark.parametrize("name, ranks", quick([(n, r) for n in CASES for r in (2, 3)], ("round", 3), ("crush", 2)))
def test_one_rank_may_do_it_all(alone, name, ranks):
    """Small fields are not divided: rank 0 solves them as if alone. Red where the others miss what it found, or it
    waits for them."""
    folder, one = alone(name)
    env = environment(OMP_NUM_THREADS=1, BERGTOW_DIVIDE="")
    r = many(folder, ranks, 1, name=f"undivided{ranks}", env=env)
    assert_same(one, r)
    assert r.summary["undivided_steps"] > 0


def test_a_field_is_divided_while_that_pays(tmp_path):
    """Walls close on 9,000 floes: at first next to none touch, and one rank has all; then sharing pays, as the first
    look after 20 steps tells."""
    case = changed(PRESS, domain__length=200, domain__width=40, ice__concentration=0.8, run__duration=2.6,
                   solver__max_sweeps=None, domain__ends_closing=2, domain__sides_closing=0)
    one = run(tmp_path, case, "--threads", 1, "--quiet")
    r = many(tmp_path, 2, 1, name="two", env=environment(OMP_NUM_THREADS=1, BERGTOW_DIVIDE=""))
    assert_same(one, r)
    assert 0 < r.summary["undivided_steps"] < r.summary["n_steps"] and r.summary["halo_share"] > 0


def test_one_rank_takes_a_field_that_the_towed_body_has_left(tmp_path):
    """Two rows are pressed against a wedge, which the ranks share until it has come to rest; meanwhile the body on its
    line has left the ice. Red where a rank that no longer solves has the large bodies: the line stands still."""
    yc, draw = -20.0, random.Random(3)
    floes = [{"x": 0.5 + 0.65 * i, "y": -27.7 + 0.65 * j, "vx": draw.uniform(-0.05, 0.05),
              "vy": draw.uniform(-0.05, 0.05)}
             for j in range(90) for i in range(90) if abs(-27.7 + 0.65 * j - yc) >= 2.2]
    floes += [{"x": 2 + 0.503 * k, "y": -33 + 0.503 * r, "vx": 0.5, "vy": 0} for k in range(100) for r in range(2)]
    floes = [{"shape": "square", "length": 0.5, "thickness": 0.04, **floe} for floe in floes]
    floes += [{"shape": "square", "length": 0.8, "x": 53.6, "y": y, "thickness": 0.04, "fixed": True}
              for y in (-33.2, -32.35)]
    case = {"run": {"dt": 0.02, "duration": 3.2},
            "domain": {"length": 70, "width": 80, "ends": "open", "sides": "open"},
            "ice": {"concentration": 0, "friction": 0.5, "drag": {"water_skin": 0, "water_form": 0}},
            "solver": {"tolerance": 1e-9}, "floes": floes,
            "body": {"shape": "disc", "length": 3, "draft": 3, "x": 54, "y": yc, "vx": 12, "drag": {"water_form": 0.5}},
            "tow": {"mode": "line", "speed": 12, "ramp": 0.1, "line_length": 5, "line_stiffness": 20000},
            "guard": {"escape": False, "unconverged": 0, "no_solution": 0}, "output": {"frame_interval": 100}}
    one = run(tmp_path, case, "--threads", 1, "--quiet")
    r = many(tmp_path, 2, 1, name="two", env=environment(OMP_NUM_THREADS=1, BERGTOW_DIVIDE=""))
    assert_same(one, r)
    assert 0 < r.summary["undivided_steps"] < r.summary["n_steps"]


def test_one_large_body_runs_on_after_another_has_stopped(tmp_path):
    """The body has stopped at a wall after a long way when a large floe reaches ice that other ranks own. Red where the
    longest way of all tells when the floes around large bodies are looked up anew: the large floe went through them."""
    still = {"water_form": 0, "water_skin": 0}
    case = {"run": {"dt": 0.05, "duration": 16}, "tow": {"mode": "none"}, "output": {"frame_interval": 100},
            "domain": {"length": 135, "width": 50, "ends": "wall", "sides": "wall"},
            "ice": {"concentration": 0.5, "size": 0.6, "thickness": 0.04, "friction": 0.3, "drag": still,
                    "x_min": 60, "x_max": 130, "y_min": -12, "y_max": 8},
            "floes": [{"shape": "disc", "length": 9, "x": 10, "y": -16.1, "vx": 4, "vy": 0, "thickness": 0.5}],
            "body": {"shape": "disc", "x": 5, "y": 18, "length": 2, "draft": 0.5, "vx": 20, "vy": 0, "drag": still}}
    assert_same(run(tmp_path, case, "--threads", 1, "--quiet"), many(tmp_path, 3, 1))


def test_one_rank_that_is_told_to_divide_tells_all(tmp_path):
    """Launchers pass no variables on to other machines. Red: the ranks wait for each other."""
    case = changed(TOW, run__duration=1)
    one = run(tmp_path, case, "--threads", 1, "--quiet")
    forget = '[ "${OMPI_COMM_WORLD_RANK:-$PMI_RANK}" = 0 ] || unset BERGTOW_DIVIDE; exec "$0" "$@"'
    result = mpirun(2, "run", "case.yml", "-o", "two", "--threads", 1, "--quiet", program=("sh", "-c", forget, BERGTOW),
                    cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    two = Run(tmp_path / "two", result)
    assert_same(one, two)
    assert two.summary["undivided_steps"] == 0


def test_a_wrong_division_is_refused(tmp_path):
    result = mpirun(2, "run", "case.yml", cwd=tmp_path, env=environment(BERGTOW_DIVIDE="never"))
    assert result.returncode == 2 and "BERGTOW_DIVIDE=never: give always, or unset it" in result.stderr


def test_floes_at_a_free_body_that_other_ranks_hold(tmp_path):
    """Cells so large that a berg which is towed towards low x and y reaches floes that another rank holds, too; what it
    does to them must come there before the next phase. Nothing is assigned anew in between, as that mends it."""
    case = {
        "run": {"dt": 0.1, "duration": 26},
        "domain": {"length": 40, "width": 24},
        "ice": {"concentration": 0.5, "size": 0.5},
        "body": {"shape": "square", "length": 1.6, "x": 26, "y": 3},
        "tow": {"mode": "line", "speed": 0.5, "ramp": 5, "direction": 225, "line_length": 3},
        "solver": {"cell_size": 12},
        "output": {"window_start": 10, "frame_interval": 5},
    }
    assert_same(run(tmp_path, case, "--threads", 1, "--quiet"), many(tmp_path, 3, 1))


@pytest.mark.parametrize("name, ranks, threads", quick([("line", 3, 2), ("jam", 3, 1), ("seams", 2, 4), ("round", 4, 2),
                                                        ("ring", 2, 2), ("ring", 4, 1)], ("jam", 3, 1)))
def test_the_division_is_sound(alone, name, ranks, threads):
    """In the validation build: every body that several ranks hold is the same there, bit for bit, after each migration
    and every 20 steps; threads share every loop, however few the contacts. And another optimisation gives the same
    numbers."""
    folder, one = alone(name, "--steps", 200)
    write_case(folder, CASES[name])
    assert_same(one, many(folder, ranks, threads, "--steps", 200, name=f"validated{ranks}x{threads}", program=VALIDATE))


def test_threads_within_ranks(tmp_path):
    """So large that each rank has work for a team of threads (1,500 units of two points), with the exchange under
    way."""
    case = changed(PRESS, domain__length=100, domain__width=60, run__duration=1.8, solver__max_sweeps=30)
    one = run(tmp_path, case, "--threads", 1, "--quiet")
    assert one.series("contacts").min() > 2 * 1500 and one.series("contacts").max() > 2 * 3000
    assert_same(one, many(tmp_path, 2, 2))


HAND = {
    "run": {"dt": 0.1, "duration": 60},
    "domain": {"length": 12, "width": 9, "ends": "periodic"},
    "ice": {"concentration": 0},
    "body": {"shape": "none"},
    "floes": [{"shape": "disc", "length": 1, "x": 3, "y": 1, "yaw": 20, "vx": 0.3, "vy": 0.2, "yaw_rate": 5}],
}
SMALL = {
    "fewer cells than ranks": changed(SEAMS,
                                      domain__length=7,
                                      domain__width=6,
                                      ice__size_max=1.5,
                                      solver__cell_size=5,
                                      water__current_x=0.5),
    "berg in few cells": changed(LINE, domain__length=14, domain__width=9, solver__cell_size=5, run__duration=30),
    "one floe": HAND,
    "none": changed(HAND, floes=None),
    "a berg alone": changed(LINE, ice={"concentration": 0}, domain__length=20),
}


@pytest.mark.parametrize("name", quick(SMALL, "fewer cells than ranks", "one floe", "none", "a berg alone"))
def test_ranks_that_own_nothing(tmp_path, name):
    """Two of three ranks where there is a floe or none; of seven, where there are four or six cells."""
    one = run(tmp_path, SMALL[name], "--threads", 1, "--quiet")
    assert one.summary["n_steps"] >= 320
    assert one.summary["n_floes"] < 160
    ranks = 7 if "cells" in name else 3
    r = many(tmp_path, ranks, 1)
    assert_same(one, r)
    assert r.summary["worst_imbalance"] <= ranks - 1 + 1e-9
    if "cells" not in name:
        assert r.summary["halo_share"] == 0
