# SPDX-License-Identifier: MIT
"""The Python package on libbergtow: the same bits as the command, forces as functions, results as datasets."""
import inspect
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
from harness import (BERGTOW, CASE, CLOSING, IO, NUMERIC, ROOT, TOW, call, changed, differing, environment, run,
                     write_case)

LIBRARY = ROOT / "build/release/libbergtow.so"
sys.path.insert(0, str(ROOT / "postproc"))
import bergtow  # noqa: E402

SHORT = changed(TOW, run__duration=6)
LINE = changed(SHORT, tow__mode="line", tow__line_length=3, tow__line_stiffness=2000, tow__speed=0.6, body__x=4)
WINDOW = {
    "run": {"dt": 0.1, "duration": 5},
    "domain": {"frame": "geographic", "length": 24, "width": 18, "ends": "moving", "sides": "periodic", "ahead": 14},
    "ice": {"concentration": 0.5, "size": 1.2, "thickness": 0.04, "friction": 0.3},
    "body": {"length": 2, "draft": 0.5}, "tow": {"speed": 0.8, "ramp": 1},
    "water": {"latitude": 75, "tide": {"major": 0.2, "minor": 0.05, "period": 12}}, "air": {"wind_x": 5},
}


@pytest.fixture(scope="module", autouse=True)
def library():
    own = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    made = subprocess.run(["make", "--no-print-directory", "lib"], cwd=ROOT, capture_output=True, text=True, env=own)
    assert made.returncode == 0, made.stdout + made.stderr


def stepped(case, n=7, **more):
    """State hash after the whole case, n steps a call."""
    with bergtow.Simulation(case, threads=1, **more) as sim:
        while sim.steps_left:
            sim.step(n)
        return sim.state_hash


def datasets_of(path):
    with h5py.File(path) as f:
        return {name: values[()] for name, values in f["series"].items()}


# --- the same bits ---------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("case", [SHORT, LINE, WINDOW], ids=["speed", "line", "window"])
def test_the_state_is_that_of_the_command(case, tmp_path):
    there = run(tmp_path, case)
    result = bergtow.run(case, tmp_path / "python", threads=2)
    assert result.summary["state_hash"] == there.hash == stepped(case)
    ours, theirs = datasets_of(tmp_path / "python/result.h5"), datasets_of(there.dir / "result.h5")
    assert ours.keys() == theirs.keys()
    for name, values in theirs.items():
        np.testing.assert_array_equal(ours[name], values, name)


def test_simulations_that_are_stepped_in_turn_keep_apart(tmp_path):
    pushed = []

    def push(bodies):
        pushed.append(bodies.time)
        bodies.force[:, 1] = 0.3

    with bergtow.Simulation(SHORT, threads=1) as a, bergtow.Simulation(SHORT, threads=1, forces={"push": push}) as b:
        while a.steps_left:
            a.step(5)
            b.step(3)
        assert len(pushed) == b.steps == 36
        assert a.state_hash == run(tmp_path, SHORT).hash != b.state_hash


def test_an_early_end_is_that_of_the_option_steps(tmp_path):
    case = changed(SHORT, output__frame_interval=2)  # the last of the frames is that of the end
    there = run(tmp_path, case, "--steps", 33)
    with bergtow.Simulation(case, tmp_path / "python", threads=1) as sim:
        sim.step(33)
    here = bergtow.Result(tmp_path / "python")
    assert here.summary["n_steps"] == 33 and here.summary["state_hash"] == there.hash
    with h5py.File(here.folder / "result.h5") as ours, h5py.File(there.dir / "result.h5") as theirs:
        np.testing.assert_array_equal(ours["frames/pose"], theirs["frames/pose"])


def test_resume_goes_on_from_a_checkpoint_of_the_library(tmp_path):
    with pytest.raises(ZeroDivisionError):
        with bergtow.Simulation(SHORT, tmp_path / "python", threads=1) as sim:
            sim.step(20)
            sim.checkpoint()
            sim.step(5)
            1 / 0
    assert not (tmp_path / "python/summary.json").exists()
    assert call("resume", tmp_path / "python").returncode == 0
    assert bergtow.Result(tmp_path / "python").summary["state_hash"] == run(tmp_path, SHORT).hash


def test_a_run_is_taken_up_here(tmp_path):
    """One of the command, and its end; with a force, which has to be there as it was; at another checkpoint. In a
    process of its own, for forces belong to the process."""
    whole = run(tmp_path, LINE)
    run(tmp_path, LINE, "--steps", 20, name="part")
    script = tmp_path / "resume.py"
    script.write_text(f"""
import sys; sys.path.insert(0, {str(ROOT / "postproc")!r})
import bergtow, shutil
def push(bodies): bodies.force[bodies.towed] += 5, 5
def refused(*words, **more):
    try:
        bergtow.Simulation.resume(*words, **more)
    except bergtow.BergtowError as error:
        print(error)
shutil.copytree("part", "later")
with bergtow.Simulation.resume("part", threads=1) as sim:
    assert sim.steps == 20 and sim.case["tow.speed"] == bergtow.Case("case.yml")["tow.speed"]
    while sim.steps_left: sim.step(7)
refused("part")
refused("none")
with bergtow.Simulation("case.yml", "pushed", forces=dict(push=push), threads=1) as sim:
    sim.step(15)
    sim.checkpoint()
    shutil.copy("pushed/checkpoint.h5", "early.h5")
    sim.step(15)
    sim.checkpoint()
    shutil.copytree("pushed", "copy")
    sim.step(10**6)
    pushed = sim.state_hash
for checkpoint in None, "early.h5":
    with bergtow.Simulation.resume("copy", checkpoint=checkpoint, forces=dict(push=push), threads=1) as sim:
        assert sim.steps == (15 if checkpoint else 30)
        sim.step(10**6)
        assert sim.state_hash == pushed
        if not checkpoint: sim.drop()
with bergtow.Simulation.resume("later", forces=dict(push=push), threads=1) as sim:
    sim.step(10**6)
""")
    result = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    finished, missing = result.stdout.strip().splitlines()
    assert "is finished" in finished and "no such folder" in missing
    hashes = [bergtow.Result(tmp_path / name).summary["state_hash"] for name in ("part", "copy", "later")]
    assert hashes[0] == whole.hash and len(set(hashes)) == 3
    with h5py.File(tmp_path / "later/result.h5") as f:  # a force that has come later was 0 before
        assert [(x == 0).all() for x in np.split(f["series/push_force"][:], [20])] == [True, False]
    shutil.rmtree(tmp_path / "copy")
    shutil.copytree(tmp_path / "part", tmp_path / "copy")
    shutil.copy(tmp_path / "early.h5", tmp_path / "copy")
    result = call("resume", tmp_path / "copy/early.h5")
    assert result.returncode == CASE and "the run had push, which a program had added" in result.stderr


def test_a_force_that_has_acted_is_named_and_wanted(tmp_path):
    """One on a floe alone, where every series of forces is 0 or NaN; none where a force of the process was silent."""
    script = tmp_path / "save.py"
    script.write_text(f"""
import sys; sys.path.insert(0, {str(ROOT / "postproc")!r})
import bergtow
def nudge(bodies): bodies.force[bodies.id == 3, 1] += 1e-3
def still(bodies): pass
for name, forces in dict(nudged=dict(still=still, nudge=nudge), silent=dict(still=still)).items():
    with bergtow.Simulation({SHORT!r}, name, forces=forces, threads=1) as sim:
        sim.step(10)
        sim.checkpoint()
        sim.drop()
with bergtow.Simulation.resume("nudged", forces=dict(still=still, nudge=nudge), threads=1) as sim:
    sim.step(1)
    sim.drop()
try:
    bergtow.Simulation.resume("nudged", threads=1)
except bergtow.BergtowError as error:
    print(error)
""")
    result = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "the run had nudge, which a program had added" in result.stdout
    refused = call("resume", tmp_path / "nudged", "--quiet")
    assert refused.returncode == CASE and "the run had nudge, which a program had added" in refused.stderr
    assert call("resume", tmp_path / "silent", "--quiet").returncode == 0


def test_two_ranks_have_the_state_of_one(tmp_path):
    case = write_case(tmp_path, changed(SHORT, ice__concentration=0.7))
    script = tmp_path / "ranks.py"
    script.write_text(f"""
import sys; sys.path.insert(0, {str(ROOT / "postproc")!r})
import bergtow, numpy as np, os, pathlib
bergtow.start_mpi()
def nothing(bodies): bodies.force[:] = 0 * bodies.place[:, :2]
with bergtow.Simulation({str(case)!r}, forces={{"nothing": nothing}}, threads=1) as sim:
    while sim.steps_left: sim.step(10)
    said = np.isfinite(sim.positions[:, 0]).sum(), sim.n_bodies, sim.state_hash
    (pathlib.Path(__file__).parent / ("rank" + os.environ["OMPI_COMM_WORLD_RANK"])).write_text("%d %d %s" % said)
""")
    result = subprocess.run(["mpirun", "--oversubscribe", "-n", "2", sys.executable, script], capture_output=True,
                            text=True, timeout=120,
                            env=environment(OMPI_ALLOW_RUN_AS_ROOT=1, OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1))
    assert result.returncode == 0, result.stdout + result.stderr
    said = [(tmp_path / f"rank{k}").read_text().split() for k in range(2)]
    assert {h for *_, h in said} == {run(tmp_path, case).hash}
    assert any(int(held) < int(n) for held, n, _ in said)


def test_the_state_before_a_step_that_failed_is_kept(tmp_path):
    """As by the command, from the start and from a checkpoint; not where it cannot be made again."""
    theirs = run(tmp_path, CLOSING, "--quiet", code=NUMERIC, name="theirs")
    with bergtow.Simulation(SHORT, threads=1, forces={"over": lambda bodies: bodies.force.__iadd__(1)}) as sim:
        sim.step(1)  # what has acted elsewhere in this process, and is over, does not make a state one of its own

    def fails(name, between=lambda sim: None, **more):
        with pytest.raises(bergtow.BergtowError) as raised:
            with bergtow.Simulation(CLOSING, tmp_path / name, **more) as sim:
                sim.step(9)
                between(sim)
                sim.step(sim.steps_left)
        file = tmp_path / name / "failure.h5"
        assert raised.value.status == NUMERIC and (str(file) in str(raised.value)) == file.exists()
        return file, re.search(r"step \d+: floe", str(raised.value))[0]

    def push(sim):
        sim.set_velocity(0, 0.5, 0)

    for name, between in {"begun": lambda sim: None, "kept": bergtow.Simulation.checkpoint,
                          "pushed": lambda sim: (push(sim), sim.checkpoint())}.items():
        file, step = fails(name, between)
        assert step in call("resume", file, "--quiet").stderr
        there = [n for n in differing(theirs.dir / "failure.h5", file)
                 if not n.startswith(("/about", "/case", "/clock"))]
        assert (there == []) == (name != "pushed")
    assert not fails("changed", push)[0].exists()
    assert not fails("forced", forces={"nothing": lambda bodies: None})[0].exists()


# --- forces ----------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("case", [SHORT, LINE, WINDOW], ids=["speed", "line", "window"])
def test_a_force_that_returns_zero_keeps_the_bits(case, tmp_path):
    def nothing(bodies):
        return np.zeros((len(bodies.id), 3))

    there = run(tmp_path, case)
    bergtow.run(case, tmp_path / "python", forces={"nothing": nothing}, threads=1)
    assert bergtow.Result(tmp_path / "python").summary["state_hash"] == there.hash
    ours, theirs = datasets_of(tmp_path / "python/result.h5"), datasets_of(there.dir / "result.h5")
    assert not ours.pop("nothing_force").any()
    for name, values in theirs.items():
        np.testing.assert_array_equal(ours[name], values, name)


class WaterDrag:
    """Skin and form drag of water at rest, of all bodies, by the equations of bergtow/forces.h."""

    def __init__(self, case):
        with bergtow.Simulation(case) as sim:
            self.skin, self.form, *_, self.yaw = sim.drags.T
            moved = sim.motions != 2
            place, outlines = sim.positions, [sim.outline(i) for i in range(sim.n_bodies)]
        self.skin, self.form, self.yaw = (np.where(moved, x, 0) for x in (self.skin, self.form, self.yaw))
        self.body = np.repeat(np.arange(len(place)), [len(o) for o in outlines])
        own = np.concatenate(outlines) - place[self.body, :2]
        c, s = np.cos(place[self.body, 2]), np.sin(place[self.body, 2])
        self.corner = np.stack([c * own[:, 0] + s * own[:, 1], c * own[:, 1] - s * own[:, 0]], 1)
        self.next = np.concatenate([np.roll(np.arange(len(o)), -1) + at for o, at in
                                    zip(outlines, np.cumsum([0, *map(len, outlines)]))])

    def __call__(self, bodies):
        """drag of the water, in Python"""
        u, load = bodies.velocity, bodies.load
        bodies.drag(self.skin * np.sqrt(u[:, 0] ** 2 + u[:, 1] ** 2), (0, 0))
        load[:, 6] += self.yaw * np.abs(u[:, 2])
        turn = bodies.place[self.body, 2]
        c, s = np.cos(turn), np.sin(turn)
        p = np.stack([c * self.corner[:, 0] - s * self.corner[:, 1], s * self.corner[:, 0] + c * self.corner[:, 1]], 1)
        e = p[self.next] - p
        v = -u[self.body]

        def inflow(at):  # -v.n times the length of the edge, where the local velocity of the water is v - ω × r
            return -((v[:, 0] - v[:, 2] * at[:, 1]) * e[:, 1] - (v[:, 1] + v[:, 2] * at[:, 0]) * e[:, 0])

        start, end = inflow(p), inflow(p[self.next])
        wet = (start > 0) | (end > 0)
        zero = start / np.where(start == end, 1, start - end)
        low, high = np.where(start < 0, zero, 0), np.where(end < 0, zero, 1)
        for side in (-1, 1):
            t = 0.5 * (low + high + side / math.sqrt(3) * (high - low))
            g = 0.5 * (high - low) * self.form[self.body] * np.maximum(0, start + t * (end - start))
            g = np.where(wet, g, 0)
            r = p + np.where(wet, t, 0)[:, None] * e
            for column, value in ((3, g), (4, g * r[:, 0]), (5, g * r[:, 1]), (6, g * (r ** 2).sum(1))):
                np.add.at(load[:, column], self.body, value)


@pytest.mark.parametrize("base", [SHORT, LINE], ids=["speed", "line"])
def test_water_drag_in_python_is_that_of_the_program(base, tmp_path):
    own = {"air_form": 0, "air_skin": 0}
    with_drag = changed(base, run__duration=10, ice__drag=own, body__drag=own)
    none = own | {"water_form": 0, "water_skin": 0}
    without = changed(with_drag, ice__drag=none, body__drag=none)
    program = bergtow.run(with_drag, tmp_path / "program", threads=1)
    python = bergtow.run(without, tmp_path / "python", forces={"python_drag": WaterDrag(with_drag)}, threads=1)
    with program.open() as a, python.open() as b:
        for name, same in (("ice_resistance",) * 2, ("tow_force",) * 2, ("drag_force", "python_drag_force")):
            mean = float(a[name].mean())
            assert mean != 0 and abs(float(b[same].mean()) - mean) < 1e-9 * abs(mean), name
        assert not b["drag_force"].any()
        assert float(a["drag_force"].mean()) > 0.01 * float(a["tow_force"].mean())


def test_a_force_may_be_returned_and_is_part_of_the_balance():
    def current(bodies):
        force = np.zeros((len(bodies.id), 2))
        force[bodies.towed] = -7, 0
        return force

    with bergtow.Simulation(SHORT, threads=1, forces={"hold_back": current}) as sim:
        sim.step(40)
        assert math.isclose(sim["hold_back_force"], 7, rel_tol=1e-12)
        rest = sim["ice_resistance"] + sim["drag_force"] + sim["inertia_force"]
        assert math.isclose(sim["tow_force"], rest + 7, rel_tol=1e-9)


def test_a_drag_pulls_towards_its_velocity():
    """So strong that a step takes every floe there; of each its own velocity."""
    def drag(bodies):
        bodies.drag(1e9, np.stack([np.full(len(bodies.id), 0.03), -0.01 * (1 + bodies.id % 3)], 1))

    with bergtow.Simulation(changed(SHORT, ice__concentration=0.2), threads=1, forces={"strong": drag}) as sim:
        sim.step()
        free = np.flatnonzero(sim.motions == 0)
        wanted = np.stack([np.full(len(free), 0.03), -0.01 * (1 + free % 3)], 1)
        near = np.abs(sim.velocities[free, :2] - wanted).max(axis=1) < 1e-4
        assert len(free) > 10 and near.mean() > 0.8  # the others are in contact


def test_a_moment_may_be_returned():
    def returned(bodies):
        answer = np.zeros((len(bodies.id), 3))
        answer[:, 2] = 0.5 * bodies.inertia
        return answer

    def added(bodies):
        bodies.moment[:] += 0.5 * bodies.inertia

    hashes = []
    for function in (returned, added):
        with bergtow.Simulation(changed(SHORT, ice__concentration=0.2), threads=1, forces={"turn": function}) as sim:
            before = sim.velocities[:, 2]
            sim.step()
            free = sim.motions == 0
            gained = (sim.velocities[:, 2] - before)[free] / sim.dt
            assert np.median(gained) == pytest.approx(0.5, rel=0.05)
            hashes.append(sim.state_hash)
    assert hashes[0] == hashes[1]


def test_what_goes_wrong_in_a_force_is_reported():
    class Own(Exception):
        pass

    def raises(bodies):
        if bodies.time > 1:
            raise Own("a reason")

    def no_number(bodies):
        bodies.force[3, 0] = math.nan

    def drives(bodies):
        bodies.drag(-1, (0, 0))

    with pytest.raises(Own, match="a reason"):
        stepped(SHORT, forces={"wrong": raises})
    with pytest.raises(bergtow.BergtowError, match="force wrong: a number that it has filled in is not finite"):
        stepped(SHORT, forces={"wrong": no_number})
    with pytest.raises(bergtow.BergtowError, match="force wrong: its linear part drives a body"):
        stepped(SHORT, forces={"wrong": drives})
    with pytest.raises(bergtow.BergtowError, match="lower-case letters"):
        stepped(SHORT, forces={"Not a name": raises})
    with pytest.raises(bergtow.BergtowError, match="there is a force of this name"):
        stepped(SHORT, forces={"drag": raises})
    with bergtow.Simulation(SHORT, forces={"mine": drives}):
        with pytest.raises(bergtow.BergtowError, match="belongs to a simulation that has not ended"):
            bergtow.Simulation(SHORT, forces={"mine": drives})


def test_floes_at_rest_wake_when_a_force_begins():
    """Open water around a floe far from the tow: it rests until it is pushed."""
    def later(bodies):
        if bodies.time > 2:
            bodies.force[0] = 0, 0.02

    with bergtow.Simulation(changed(SHORT, tow__speed=0.01), threads=1, forces={"later": later}) as sim:
        before = sim.positions[0]
        sim.step(20)
        assert (sim.positions[0] == before).all()
        sim.step(1)
        m = sim.masses[0, 0]
        assert math.isclose(sim.velocities[0, 1], 0.1 * 0.02 / m, rel_tol=1e-12)


# --- bodies, contacts, numbers ---------------------------------------------------------------------------------------

def test_contacts_add_up_to_the_force_on_the_body():
    with bergtow.Simulation(changed(LINE, ice__concentration=0.8), threads=1) as sim:
        sim.step(40)
        outline, place = sim.outline(sim.towed), sim.positions[sim.towed]
        force, touching = np.zeros(2), 0
        for c in sim.contacts[sim.contacts["normal_impulse"].max(1) > 0]:
            if sim.towed not in (c["a"], c["b"]):
                continue
            n, sign = c["normal"], 1 if c["b"] == sim.towed else -1
            t = np.array([-n[1], n[0]])
            force += sign * (n * c["normal_impulse"].sum() + t * c["tangential_impulse"]) / sim.dt
            for point in c["point"][:c["n_points"]]:
                edges = np.roll(outline, -1, 0) - outline
                along = np.clip(((point - outline) * edges).sum(1) / (edges ** 2).sum(1), 0, 1)
                assert np.hypot(*(outline + along[:, None] * edges - point).T).min() < 0.02
                assert np.hypot(*(point - place[:2])) < sim.radii[sim.towed] + 0.02
                touching += 1
        assert touching > 2
        np.testing.assert_allclose(force, [sim["ice_force_x"], sim["ice_force_y"]], rtol=1e-9)


def test_bodies_are_changed_by_hand_within_limits():
    with bergtow.Simulation(changed(SHORT, ice__concentration=0.1, tow__speed=0.01), threads=1) as sim:
        place = sim.positions
        sim.set_velocity(0, 0.2, -0.1, 0.3)
        assert (sim.velocities[0] == (0.2, -0.1, 0.3)).all()
        sim.step(1)
        assert np.allclose(sim.positions[0] - place[0], 0.1 * np.array([0.2, -0.1, 0.3]), rtol=0.1)
        free = next((x, y) for x in np.arange(6, 14, 0.5) for y in np.arange(-3, 3, 0.5)
                    if np.hypot(*(sim.positions[:, :2] - (x, y)).T)[:sim.towed].min() > 1.5
                    and abs(x - sim.positions[sim.towed, 0]) > 3)
        sim.set_position(1, *free, 0.5)
        assert np.allclose(sim.positions[1], (*free, 0.5))
        sim.step(5)
        assert np.allclose(sim.positions[1], (*free, 0.5), atol=1e-3)
        for refused, match in (((2, *free, 0), "would lie over body 1"), ((2, 99, 0, 0), "outside of the domain"),
                               ((2, math.nan, 0, 0), "finite"), ((sim.towed, 5, 0, 0), "prescribed"),
                               ((99999, 5, 0, 0), "there is none")):
            before = sim.state_hash
            with pytest.raises(bergtow.BergtowError, match=match):
                sim.set_position(*refused)
            assert sim.state_hash == before
        with pytest.raises(bergtow.BergtowError, match="prescribed"):
            sim.set_velocity(sim.towed, 1, 0)
    with bergtow.Simulation(LINE) as sim, pytest.raises(bergtow.BergtowError, match="is towed"):
        sim.set_position(sim.towed, 6, 0, 0)


def test_a_floe_that_is_pushed_by_hand_hits_another():
    floes = [{"shape": "square", "length": 0.8, "x": x, "y": 0} for x in (8, 10)]
    case = changed(SHORT, ice__concentration=0, tow__speed=0.01, floes=floes)
    with bergtow.Simulation(case, threads=1) as sim:
        sim.step(3)  # both rest, and cells with them
        sim.set_velocity(0, 1, 0)
        sim.step(30)
        assert sim.velocities[1, 0] > 0.1 and sim.positions[0, 0] < sim.positions[1, 0] - 0.79


def test_errors_of_numbers_and_of_what_has_ended():
    with bergtow.Simulation(SHORT) as sim:
        assert math.isnan(sim["ice_resistance"])
        with pytest.raises(KeyError, match="no series of this name"):
            sim["resistance_of_ice"]
        with pytest.raises(bergtow.BergtowError, match="no folder for a checkpoint"):
            sim.checkpoint()
    with pytest.raises(bergtow.BergtowError, match="has ended"):
        sim.step()


def test_a_result_is_not_replaced_unless_asked(tmp_path):
    bergtow.run(SHORT, tmp_path / "out")
    with pytest.raises(bergtow.BergtowError, match="holds a result"):
        bergtow.run(SHORT, tmp_path / "out")
    bergtow.run(SHORT, tmp_path / "out", replace=True)


# --- cases -----------------------------------------------------------------------------------------------------------

def test_a_case_is_read_checked_and_changed(tmp_path):
    case = bergtow.Case(write_case(tmp_path, SHORT))
    assert (case["tow.speed"], case.unit("tow.speed")) == (0.13, "m/s")
    case["tow.speed"] = "0.5 kn"
    assert case["tow.speed"] == 0.5 * 1852 / 3600
    with pytest.raises(bergtow.CaseError, match=r"^tow.sped=1: unknown key; did you mean tow.speed\?$"):
        case["tow.sped"] = 1
    with pytest.raises(bergtow.CaseError, match="body.draft"):
        case["body.draft"] = -1
    assert case.overrides == {"tow.speed": "0.5 kn"}
    del case["tow.speed"]
    assert case["tow.speed"] == 0.13
    case.update({"domain.length": 30, "body.x": 20})
    with pytest.raises(bergtow.CaseError, match="body.x"):
        case["domain.length"] = 15
    assert (case["domain.length"], case["body.x"]) == (30, 20)
    speeds = bergtow.Case(changed(SHORT, tow={"programme": [[0, 0], [2, 0.4]]}))
    assert speeds["tow.programme"] == [[0, 0], [2, 0.4]]
    speeds["tow.programme"] = np.array([[0, 0.1], [3, 0.25]])
    assert speeds["tow.programme"] == [[0, 0.1], [3, 0.25]]
    with pytest.raises(bergtow.CaseError) as caught:
        bergtow.Case({"run": {"dt": -1, "duration": "x"}})
    assert len(str(caught.value).splitlines()) >= 2 and caught.value.status == 3


def test_a_case_has_the_values_of_the_resolved_one(tmp_path):
    listed = {key["name"]: key for key in json.loads(call("--list-keys", "--json").stdout)["keys"]}
    case = bergtow.Case(WINDOW, {"run.title": 'an "odd" one: # 1'})
    assert set(case) == set(listed) and case["run.title"] == 'an "odd" one: # 1'
    assert case["domain.ends"] == "moving" and case["guard.escape"] is True
    assert isinstance(case["solver.max_sweeps"], int) and isinstance(case["air.wind_x"], float)
    units = {"deg": "rad", "deg/s": "rad/s", "-": ""}
    assert all(case.unit(key) == units.get(u := listed[key].get("unit", ""), u) for key in case)
    case["tow.direction"] = "30 deg"
    assert math.isclose(case["tow.direction"], math.pi / 6)
    for key in ("tow.direction", "body.yaw_rate", "water.latitude", "tow.speed"):  # what is read can be set
        before = case[key]
        case[key] = before
        assert case[key] == before
    assert case["ice.field"] is None and case["water.tilt"] == "none"
    again = bergtow.Case.from_text(case.resolved)
    assert dict(again) == dict(bergtow.Case(WINDOW, {"run.title": 'an "odd" one: # 1', "tow.direction": math.pi / 6}))
    assert "tow.speed" in case._repr_html_()


# --- results ---------------------------------------------------------------------------------------------------------

def test_a_result_is_a_dataset(tmp_path):
    there = run(tmp_path, LINE)
    with bergtow.open_result(there.dir) as d:
        listed = {q["name"]: q for q in bergtow.quantities()["series"]}
        with h5py.File(there.dir / "result.h5") as f:
            for name, series in f["series"].items():
                assert d[name].dims == ("time",)
                np.testing.assert_array_equal(d[name], series)
                if name in listed:
                    assert d[name].attrs["units"] == listed[name]["units"]
            for k, axis in enumerate(("x", "y", "yaw")):
                assert d[f"floe_{axis}"].dims == ("frame", "floe")
                np.testing.assert_array_equal(d[f"floe_{axis}"], f["frames/pose"][:, :, k])
                np.testing.assert_array_equal(d[f"other_body_{axis}"], f["frames/body_pose"][:, :, k])
                np.testing.assert_array_equal(d[f"floe_{axis}"][1:, ::7], f["frames/pose"][1:, ::7, k])
        assert all({"units", "long_name"} <= v.attrs.keys() for v in d.variables.values() if v.dtype.kind not in "OU")
        assert math.isclose(float(d.ice_resistance.sel(time=slice(1, 3)).mean()), d.ice_resistance.values[9:30].mean())
        assert json.loads(d.attrs["summary"])["state_hash"] == there.hash
        assert d.other_body_name.values[0] == "towed body"


def test_a_large_result_opens_without_being_read(tmp_path):
    """Sizes of a million floes; nothing of them is in memory, or on the disk, until it is asked for."""
    there = run(tmp_path, SHORT)
    n = 1_000_000
    with h5py.File(there.dir / "result.h5", "r+") as f:
        t = len(f["frames/time"])
        for name, shape in (("floes/thickness", (n,)), ("floes/area", (n,)), ("frames/pose", (t, n, 3)),
                            ("frames/contact_force", (t, n)),
                            ("frames/speed", (t, n + len(f["bodies/area"]))),
                            ("frames/velocity", (t, n + len(f["bodies/area"]), 2))):
            del f[name]
            f.create_dataset(name, shape, "f8", chunks=True)
    __import__("xarray")  # which is not timed
    start = time.process_time()  # of this process alone, on a busy machine, too
    with bergtow.open_result(there.dir) as d:
        assert d.floe_x.shape == (t, n) and float(d.floe_x[7, 5]) == 0
        assert time.process_time() - start < 1


# --- the page, and the contract ---------------------------------------------------------------------------------------

STUDY = {"base": "base.yml", "repeats": 2, "parameters": {"tow.speed": [0.1, 0.2]}}


def study(folder, **more):
    write_case(folder, changed(SHORT, run__duration=2), "base.yml")
    (folder / "study.yml").write_text(json.dumps(STUDY | more))
    return folder / "study.yml"


def test_an_ensemble_is_a_dataset_and_a_table(tmp_path, capfd):
    """What the program has written, number by number, and the same folder as the command's."""
    path = study(tmp_path)
    e = bergtow.Ensemble.run(path, tmp_path / "ours", overrides={"ice.friction": 0.1})
    assert "4 members finished" in capfd.readouterr().out
    assert call("ensemble", path, "-o", tmp_path / "theirs", "--set", "ice.friction=0.1").returncode == 0
    assert differing(tmp_path / "ours/ensemble.h5", tmp_path / "theirs/ensemble.h5") == []
    assert e.counts == {"finished": 4, "failed": 0, "waiting": 0} and "4 finished" in repr(e)
    table = e.dataframe
    assert list(table.index) == ["c001-r001", "c001-r002", "c002-r001", "c002-r002"]
    assert list(table["tow.speed"]) == [0.1, 0.1, 0.2, 0.2]
    with e.dataset as d:
        assert dict(d.sizes)["member"] == 4 and d["tow.speed"].units == "m/s"
        for k, name in enumerate(table.index):
            r = e.result(name)
            for key in "mean_ice_resistance_n", "mean_tow_force_n", "n_steps":
                assert d[key].sel(member=k).item() == table[key][name] == r.summary[key]
            assert d.state_hash[k].item() == r.summary["state_hash"]
            with r.open() as one:
                np.testing.assert_array_equal(d.ice_resistance[k], one.ice_resistance)
        assert all(v.attrs["long_name"] for n, v in d.variables.items())
    assert "<table" in e._repr_html_() and "&lt;bergtow.Ensemble" in e._repr_html_()


def test_an_ensemble_with_a_hole(tmp_path, monkeypatch, capfd):
    """A member that fails is reported, its numbers are NaN, and the others are there."""
    path = study(tmp_path, parameters={"output.window_start": [0.5, 9]})
    with pytest.raises(bergtow.BergtowError, match="c002-r001.*output.window_start"):
        bergtow.Ensemble.run(path, tmp_path / "out", progress=False)
    e = bergtow.Ensemble(tmp_path / "out")
    assert e.counts == {"finished": 2, "failed": 2, "waiting": 0}
    table = e.dataframe
    assert list(table["mean_ice_resistance_n"].isna()) == [False, False, True, True]
    assert "output.window_start" in table["reason"]["c002-r001"]
    for retry in (False, True):
        capfd.readouterr()
        with pytest.raises(bergtow.BergtowError, match="c002-r001"):
            bergtow.Ensemble.run(path, tmp_path / "out", retry_failed=retry)
        assert ("c002-r001 FAILED" in capfd.readouterr().out) == retry
    with pytest.raises(bergtow.BergtowError, match="holds no ensemble.h5"):
        bergtow.Ensemble(tmp_path)
    with pytest.raises(bergtow.BergtowError, match="no member"):
        e.result("c009-r001")
    monkeypatch.setenv("BERGTOW", "build/none/bergtow")
    with pytest.raises(bergtow.BergtowError, match="build/none/bergtow: is no program"):
        bergtow.Ensemble.run(path, tmp_path / "other")
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    with pytest.raises(bergtow.BergtowError, match="none.yml"):
        bergtow.Ensemble.run(tmp_path / "none.yml", tmp_path / "none", progress=False)


def test_ctrl_c_stops_an_ensemble_that_goes_on(tmp_path):
    path = study(tmp_path, set={"run.duration": 50, "output.window_start": 20})
    script = (f"import sys; sys.path.insert(0, {str(ROOT / 'postproc')!r}); import bergtow; "
              f"bergtow.Ensemble.run({str(path)!r}, {str(tmp_path / 'out')!r})")
    p = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                         preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))  # a shell's & ignores it
    end = time.monotonic() + 60
    while not list(tmp_path.glob("out/members/*/result.part.h5")) and time.monotonic() < end:
        time.sleep(0.02)
    p.send_signal(signal.SIGINT)
    _, err = p.communicate(timeout=60)
    assert "KeyboardInterrupt" in err and list(tmp_path.glob("out/members/*/checkpoint.h5"))
    assert bergtow.Ensemble(tmp_path / "out").counts["finished"] < 4


def test_the_examples_of_the_page_run(tmp_path, monkeypatch):
    shutil.copy(ROOT / "cases/basin/basin-80.yml", tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    examples = re.findall(r"```python\n(.*?)```", (ROOT / "docs/library.md").read_text(), re.DOTALL)
    assert len(examples) == 4
    for example in examples:
        exec(compile(example, "docs/library.md", "exec"), {})


def test_no_signal_handler_is_installed():
    def caught():
        with open("/proc/self/status") as f:
            return next(line for line in f if line.startswith("SigCgt"))

    before = caught()
    with bergtow.Simulation(SHORT) as sim:
        assert caught() == before
        sim.step(3)
        assert caught() == before


def test_a_program_is_told_that_memory_has_run_out():
    said = python("""
import bergtow, ctypes, os
lib = bergtow._library.library()
report = ctypes.CFUNCTYPE(None, ctypes.c_char_p, ctypes.c_void_p)(lambda text, user: os.write(1, b"reported: " + text))
lib.bt_on_out_of_memory(report, None)
lib.bt_alloc.argtypes = [ctypes.c_size_t, ctypes.c_size_t]
lib.bt_alloc(2**60, 8)
""")
    assert said.stdout.startswith("reported: out of memory") and not said.stderr and said.returncode == 5


# --- installation ----------------------------------------------------------------------------------------------------

def python(code, *, path=ROOT / "postproc", **env):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                          env=os.environ | {"PYTHONPATH": str(path)} | env)


def test_a_missing_library_is_a_message():
    said = python("import bergtow; bergtow.Case('x.yml')", BERGTOW_LIB="/nowhere/lib.so").stderr
    assert "libbergtow cannot be loaded" in said and "make lib" in said and "BERGTOW_LIB" in said


def test_a_missing_module_is_a_message(tmp_path):
    for name in ("xarray", "h5py"):
        said = python(f"import sys; sys.modules[{name!r}] = None; import bergtow; bergtow.open_result('x')").stderr
        assert f"{name} is missing" in said and f"python3-{name}" in said


SCRIPTS = sorted(p.name for p in (ROOT / "postproc").glob("*.py") if "__main__" in p.read_text())


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_python_without_packages_is_a_message(script):
    """-S: no site-packages, as in a Python of another origin."""
    assert len(SCRIPTS) >= 15
    said = subprocess.run([sys.executable, "-S", ROOT / "postproc" / script, "x"], capture_output=True, text=True)
    assert said.returncode == IO and said.stderr.startswith(f"{script}: ") and said.stderr.count("\n") == 1
    assert re.search(rf"\w+ is missing in {sys.executable} .*; install python3-\w+ \(Debian\)", said.stderr)


def test_the_package_in_a_python_without_numpy():
    said = subprocess.run([sys.executable, "-S", "-c", "import bergtow"], capture_output=True, text=True,
                          env=os.environ | {"PYTHONPATH": str(ROOT / "postproc")}).stderr
    assert "ImportError: bergtow needs numpy" in said and sys.executable in said and "python3-numpy" in said


def test_everything_public_has_types_and_a_text():
    for name in bergtow.__all__:
        thing = getattr(bergtow, name)
        if not isinstance(thing, type) and not inspect.isfunction(thing):
            continue
        assert thing.__doc__, name
        members = vars(thing).items() if isinstance(thing, type) else [(name, thing)]
        for own, member in members:
            function = getattr(member, "fget", None) or getattr(member, "__func__", member)
            if inspect.isfunction(function):
                parameters = [p for p in inspect.signature(function).parameters if p not in ("self", "cls")]
                assert {*parameters, "return"} <= set(function.__annotations__), (name, own)


def test_pip_installs_the_package(tmp_path):
    shutil.copytree(ROOT / "postproc", tmp_path / "postproc", ignore=shutil.ignore_patterns("__pycache__"))
    result = subprocess.run([sys.executable, "-m", "pip", "install", "--no-deps", "--no-build-isolation", "--quiet",
                             "--no-index", "--target", tmp_path / "site", tmp_path / "postproc"],
                            capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "site/bergtow/py.typed").exists()
    said = python("import bergtow as b; print(b.__file__, b.Case({'run': {'dt': 0.1, 'duration': 1}})['run.dt'])",
                  path=tmp_path / "site", BERGTOW_LIB=str(LIBRARY))
    assert said.stdout.split() == [str(tmp_path / "site/bergtow/__init__.py"), "0.1"], said.stderr
