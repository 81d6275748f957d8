# SPDX-License-Identifier: MIT
"""Simulations stepped from Python: the same bits as the command, what is saved and taken up, bodies and contacts."""
import copy
import math
import os
import pickle
import re
import shutil
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
from harness import CASE, CLOSING, NUMERIC, ROOT, call, changed, differing, environment, launcher, quay, run, write_case
from python_package import LINE, SHORT, WINDOW, bergtow, datasets_of, stepped

pytestmark = pytest.mark.usefixtures("library")


# --- the same bits ---------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("case", [SHORT, LINE, WINDOW], ids=["speed", "line", "window"])
def test_the_state_is_that_of_the_command(case, tmp_path):
    there = run(tmp_path, case)
    result = bergtow.run(case, tmp_path / "python", threads=2)
    assert result.summary["state_hash"] == there.hash == stepped(case)
    ours, theirs = datasets_of(tmp_path / "python/result.h5"), datasets_of(there.dir / "result.h5")
    # forces that other tests have added to this process, and taken back, are 0, or NaN where nothing is towed
    ours = {n: v for n, v in ours.items() if not n.endswith("_force") or n in theirs or np.nan_to_num(v).any()}
    assert ours.keys() == theirs.keys()
    for name, values in theirs.items():
        np.testing.assert_array_equal(ours[name], values, name)


def test_the_collision_under_way_at_the_end(tmp_path):
    """In the last sample, however the steps are divided, and at a simulation's own end only if that is the case's."""
    case = quay((20, 0), run__duration=2.1)
    there = run(tmp_path, case)
    with bergtow.Simulation(case, tmp_path / "whole") as sim:
        for n in 20, 5:
            sim.step(n)
    with bergtow.Simulation(quay((20, 0)), tmp_path / "early") as sim:
        sim.step(21)
    whole, early = (datasets_of(tmp_path / name / "result.h5") for name in ("whole", "early"))
    for name in "collisions", "impact_peak":
        np.testing.assert_array_equal(whole[name], there.series(name), name)
        assert whole[name][-1] > 0 and not early[name].any()


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


def test_the_working_folder_may_become_another(tmp_path, monkeypatch):
    """Red when a relative name goes by the folder that is the working one later."""
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    monkeypatch.chdir(tmp_path / "a")
    with bergtow.Simulation(SHORT, "out", threads=1) as sim:
        sim.step(10)
        os.chdir(tmp_path / "b")
        sim.checkpoint()
        sim.step(10)
    assert bergtow.Result(tmp_path / "a/out").summary["n_steps"] == 20 and not list((tmp_path / "b").iterdir())
    os.chdir(tmp_path / "a")
    with bergtow.Simulation.resume("out", threads=1) as sim:
        os.chdir(tmp_path / "b")
        sim.step(1000)
    assert bergtow.Result(tmp_path / "a/out").summary["state_hash"] == run(tmp_path, SHORT).hash


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


def test_the_entry_under_way_goes_on_by_name(tmp_path):
    """Red: by place, so that half of it was that of another series where a process had other forces before."""
    case = changed(SHORT, output__sample_every=7)
    code = f"""
import bergtow
def eddy(bodies):
    "one newton against the tow"
    bodies.force[bodies.towed] += -1, 0
def nothing(bodies): "does nothing at all"
def once(name, force):
    with bergtow.Simulation({case!r}, threads=1, forces={{name: force}}) as sim: sim.step(1)
FIRST
"""
    first = """once("before", nothing)
with bergtow.Simulation(%r, "out", threads=1, forces={"eddy": eddy}) as sim: sim.step(24)""" % case
    then = """once("eddy", eddy); once("another", nothing)
with bergtow.Simulation.resume("out", threads=1, forces={"eddy": eddy}) as sim: sim.step(1000)"""
    for part in (first, then):
        done = subprocess.run([sys.executable, "-c", code.replace("FIRST", part)], cwd=tmp_path, capture_output=True,
                              text=True, env=os.environ | {"PYTHONPATH": str(ROOT / "postproc")})
        assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "out/result.h5") as f:
        np.testing.assert_allclose(f["series/eddy_force"][:], 1, rtol=1e-12)
        assert not f["series/another_force"][:].any()


def test_any_number_of_frames_between_edits_can_go_on(tmp_path):
    """Red: more frames than steps, which no checkpoint could be taken up with."""
    with bergtow.Simulation(SHORT, tmp_path / "out", threads=1) as sim:
        for k in range(4):
            sim.set_velocity(0, 0.01 * k, 0)
            sim.frame()
        sim.checkpoint()
        state = sim.state_hash
        sim.drop()
    with bergtow.Simulation.resume(tmp_path / "out", threads=1) as sim:
        assert sim.state_hash == state
        with pytest.raises(IndexError, match="does not exist"):
            sim.set_velocity(2**70, 0, 0)


def test_forces_are_taken_up_in_their_order(tmp_path):
    """Another order adds up with other rounding."""
    script = tmp_path / "forces.py"
    script.write_text(f"""
import sys; sys.path.insert(0, {str(ROOT / "postproc")!r})
import bergtow
def left(bodies): bodies.force[3, 1] += 1e-3
def right(bodies): bodies.force[4, 1] -= 1e-3
forces = {{name: globals()[name] for name in sys.argv[2:]}}
begin = bergtow.Simulation.resume if sys.argv[1] == "resume" else lambda *a, **k: bergtow.Simulation({SHORT!r}, *a, **k)
try:
    with begin("out", forces=forces, threads=1) as sim:
        sim.step(10)
        sim.checkpoint()
        sim.drop()
except bergtow.BergtowError as error:
    sys.exit(str(error))
""")

    def go(*words):
        return subprocess.run([sys.executable, script, *words], capture_output=True, text=True, cwd=tmp_path)

    assert go("run", "left", "right").returncode == 0
    assert "the run had left, right, which a program had added" in go("resume", "right", "left").stderr
    assert go("resume", "left", "right").returncode == 0


@pytest.mark.ranks
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
    rank = os.environ.get("OMPI_COMM_WORLD_RANK", os.environ.get("PMI_RANK"))
    (pathlib.Path(__file__).parent / ("rank" + rank)).write_text("%d %d %s" % said)
""")
    result = subprocess.run([*launcher(2), sys.executable, script], capture_output=True, text=True, timeout=120,
                            env=environment())
    assert result.returncode == 0, result.stdout + result.stderr
    said = [(tmp_path / f"rank{k}").read_text().split() for k in range(2)]
    assert {h for *_, h in said} == {run(tmp_path, case).hash}
    assert any(int(held) < int(n) for held, n, _ in said)


@pytest.mark.ranks
def test_the_end_after_a_failed_step_has_its_texts_one_a_line(tmp_path):
    """On rank 0, which has those of all. Red when they are one line with question marks."""
    script = tmp_path / "ranks.py"
    script.write_text(f"""
import sys; sys.path.insert(0, {str(ROOT / "postproc")!r})
import bergtow, os, pathlib
bergtow.start_mpi()
rank = os.environ.get("OMPI_COMM_WORLD_RANK", os.environ.get("PMI_RANK"))
def broken_on(one):
    def force(bodies): bodies.force[:] = float("nan") if rank == one else 0
    return force
sim, said = bergtow.Simulation({SHORT!r}, threads=1, forces={{f"on_{{k}}": broken_on(k) for k in "01"}}), []
for call in (lambda: sim.step(3), sim.end):
    try: call()
    except bergtow.BergtowError as error: said.append(str(error))
(pathlib.Path(__file__).parent / ("rank" + rank)).write_text("|".join(said))
""")
    result = subprocess.run([*launcher(2), sys.executable, script], capture_output=True, text=True, timeout=120,
                            env=environment())
    assert result.returncode == 0, result.stdout + result.stderr
    step, end = (tmp_path / "rank0").read_text().split("|")
    assert step == end and [line.split(":")[0] for line in end.splitlines()] == ["force on_0", "force on_1"]
    assert (tmp_path / "rank1").read_text() == "failed with status 5|failed with status 5"


@pytest.mark.slow
def test_the_state_before_a_step_that_failed_is_kept(tmp_path):
    """As by the command, from the start and from a checkpoint; not where it cannot be made again."""
    theirs = run(tmp_path, CLOSING, "--quiet", code=NUMERIC, name="theirs")
    with bergtow.Simulation(SHORT, threads=1, forces={"over": lambda bodies: np.ones((len(bodies.id), 2))}) as sim:
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


@pytest.mark.slow
def test_a_checkpoint_that_is_due_counts_and_no_body_is_changed_after_a_failure(tmp_path):
    """Red: no failure.h5 after a change by hand, though a checkpoint by the interval had come since; and a body that
    was changed after the failed step took failure.h5 away that was promised."""
    case = changed(CLOSING, output__checkpoint_steps=5)
    with pytest.raises(bergtow.BergtowError, match="writes the state before that step") as raised:
        with bergtow.Simulation(case, tmp_path / "out", threads=1) as sim:
            sim.set_velocity(0, 0.1, 0)
            try:
                sim.step(sim.steps_left)
            finally:
                with pytest.raises(bergtow.BergtowError, match="a step has failed"):
                    sim.set_velocity(0, 0, 0)
    assert raised.value.status == NUMERIC and (tmp_path / "out/failure.h5").exists()


def test_a_file_stop_keeps_what_was_done(tmp_path):
    """As by the command: a summary, a checkpoint, and how to go on."""
    case = write_case(tmp_path, SHORT)
    with pytest.raises(bergtow.BergtowError, match="bergtow resume") as stopped:
        with bergtow.Simulation(case, tmp_path / "block", threads=1) as sim:
            sim.step(20)
            (tmp_path / "block/stop").touch()
            for _ in range(39):
                time.sleep(0.1)  # it is looked for a few times a second
                sim.step()
    steps = bergtow.Result(tmp_path / "block").summary["n_steps"]
    assert stopped.value.status == 6 and 20 < steps < 60
    with bergtow.Simulation.resume(tmp_path / "block", threads=1) as sim:
        assert sim.steps == steps
        sim.step(100)
    assert bergtow.Result(tmp_path / "block").summary["state_hash"] == stepped(SHORT)


def test_ctrl_c_keeps_what_was_done(tmp_path):
    def interrupt(sim):
        if sim.steps >= 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bergtow.run(changed(SHORT, run__duration=8), tmp_path / "out", threads=1,
                    progress=lambda sim: (sim.step(25), interrupt(sim)))
    assert bergtow.Result(tmp_path / "out").summary["n_steps"] == 35
    with bergtow.Simulation.resume(tmp_path / "out", threads=1) as sim:
        assert sim.steps == 35
        sim.step(100)
        assert sim.state_hash == stepped(changed(SHORT, run__duration=8))


def test_a_run_without_a_step_has_no_report(tmp_path):
    with bergtow.Simulation(SHORT, tmp_path / "out", threads=1):
        pass
    with pytest.raises(bergtow.BergtowError, match="has no step to report on; continue it with bergtow resume"):
        bergtow.report(tmp_path / "out")


def test_the_end_after_a_step_that_failed_says_why():
    def fails(bodies):
        raise ValueError("a reason")

    with pytest.raises(bergtow.BergtowError, match="force fails: its function failed"):
        with bergtow.Simulation(SHORT, threads=1, forces={"fails": fails}) as sim:
            with pytest.raises(ValueError, match="a reason"):
                sim.step()


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


def test_arrays_are_what_they_were_when_they_were_asked_for():
    """Copies: steps, the end of the simulation and what is written into them leave array and simulation alone. The
    window sorts bodies anew as it moves on."""
    names = ("positions", "velocities", "masses", "contacts")
    with bergtow.Simulation(WINDOW, threads=1) as sim, bergtow.Simulation(WINDOW, threads=1) as other:
        for s in (sim, other):
            s.step(20)
        kept = {name: getattr(sim, name) for name in names}
        then = {name: values.copy() for name, values in kept.items()}
        assert all(values.size and values.base is None for values in kept.values())
        sim.positions[:] = sim.velocities[:] = math.nan
        while sim.steps_left:
            for s in (sim, other):
                s.step(10)
            assert sim.state_hash == other.state_hash
            assert not np.array_equal(sim.positions, kept["positions"])
    for name in names:
        assert kept[name].tobytes() == then[name].tobytes(), name


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
        for refused, match in (((2, *free, 0), "would lie over body 1"), ((2, 99, 0, 0), "outside the domain"),
                               ((2, math.nan, 0, 0), "finite"), ((sim.towed, 5, 0, 0), "prescribed"),
                               ((99999, 5, 0, 0), "does not exist")):
            before = sim.state_hash
            with pytest.raises(bergtow.BergtowError, match=match):
                sim.set_position(*refused)
            assert sim.state_hash == before
        with pytest.raises(bergtow.BergtowError, match="prescribed"):
            sim.set_velocity(sim.towed, 1, 0)
        sim.step(sim.steps_left)
        for change in lambda: sim.set_velocity(0, 0, 0, 0), lambda: sim.set_position(1, *free, 0):
            with pytest.raises(bergtow.BergtowError, match="was the last"):
                change()
    with bergtow.Simulation(LINE) as sim, pytest.raises(bergtow.BergtowError, match="is towed"):
        sim.set_position(sim.towed, 6, 0, 0)


def test_what_is_changed_by_hand_is_in_a_frame(tmp_path):
    with bergtow.Simulation(changed(SHORT, output__frame_interval=1), tmp_path / "out", threads=1) as sim:
        sim.step(20)
        sim.frame()  # there is one of this step
        sim.set_velocity(0, 0.2, 0)
        sim.frame()
    with h5py.File(tmp_path / "out/result.h5") as f:
        assert list(f["frames/time"]) == [0, 1, 2, 2]
        assert f["frames/velocity"][3, 0, 0] == np.float32(0.2) != f["frames/velocity"][2, 0, 0]


def test_a_body_that_drifts_is_recorded_where_it_was_put():
    case = {k: v for k, v in SHORT.items() if k != "tow"}
    case |= {"tow": {"mode": "none"}, "ice": {"concentration": 0}, "solver": {"reference_speed": 0.1}}
    with bergtow.Simulation(case, threads=1) as sim:
        sim.step(5)
        sim.set_position(sim.towed, 9, 1, 0)
        sim.step(5)
        np.testing.assert_allclose(sim.positions[sim.towed, :2], (9, 1), atol=1e-3)
        assert (sim["body_x"], sim["body_y"]) == tuple(sim.positions[sim.towed, :2])


def test_a_contact_is_over_when_a_body_is_put_elsewhere():
    floes = [{"shape": "square", "length": 0.8, "x": x, "y": 0} for x in (8, 8.81)]
    with bergtow.Simulation(changed(SHORT, ice__concentration=0, tow__speed=0.01, floes=floes), threads=1) as sim:
        sim.set_velocity(0, 0.3, 0)
        sim.step(2)
        assert any({c["a"], c["b"]} == {0, 1} and c["normal_impulse"].max() > 0 for c in sim.contacts)
        with pytest.raises(bergtow.BergtowError, match="would lie over"):
            sim.set_position(0, *sim.positions[1])
        assert len(sim.contacts)
        sim.set_position(0, 6, 2, 0)
        assert 0 not in sim.contacts["a"]
        assert np.isfinite(sim.positions).all()


def test_a_floe_stays_where_it_is_put_in_a_moving_window():
    """From the rear to the front, which is beyond the seam of the period: not taken for one left behind."""
    calm = {"air": {"wind_x": 0}, "water": {"latitude": 75}}
    case = changed(WINDOW, ice__concentration=0.1, run__duration=20) | calm
    with bergtow.Simulation(case, threads=1) as sim:
        sim.step(100)
        x, rear = sim.positions[:sim.towed, 0], sim["window_x"]
        floe, front = int(np.argmin(np.where(x > rear, x, np.inf))), sim.case["domain.x0"] + 5
        assert rear < x[floe] < rear + 2 and front < rear
        y = next(y for y in np.arange(-8, 8, 0.5) if put(sim, floe, front, y))
        sim.step(50)
        assert sim["window_x"] > x[floe] + 1
        np.testing.assert_allclose(sim.positions[floe, :2], (front, y), atol=0.1)


def put(sim, body, x, y):
    try:
        sim.set_position(body, x, y, 0)
    except bergtow.BergtowError:
        return False
    return True


def test_the_end_of_a_session_stays_ignored(tmp_path):
    """Under nohup, whatever a library of MPI would like to have of the signal: UCX, on Debian 13."""
    script = tmp_path / "nohup.py"
    script.write_text(f"""
import os, signal, sys
sys.path.insert(0, {str(ROOT / "postproc")!r})
signal.signal(signal.SIGHUP, signal.SIG_IGN)
import bergtow
with bergtow.Simulation({str(write_case(tmp_path, SHORT))!r}, threads=1) as sim:
    sim.step(2)
    ignored = next(line.split()[1] for line in open("/proc/self/status") if line.startswith("SigIgn"))
    print(int(ignored, 16) >> (signal.SIGHUP - 1) & 1, os.environ["UCX_DEBUG_SIGNO"])
""")
    result = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path)
    assert result.stdout == "1 0\n", (result.stdout, result.stderr)


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
        with pytest.raises(TypeError, match="integer"):
            sim.step(2.0)
        assert sim.steps == 0
        with pytest.raises(KeyError, match="no series of this name"):
            sim["resistance_of_ice"]
        with pytest.raises(bergtow.BergtowError, match="no folder for a checkpoint"):
            sim.checkpoint()
    with pytest.raises(bergtow.BergtowError, match="has ended"):
        sim.step()


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_simulation_is_never_duplicated(duplicate):
    """Red: two objects with the same memory of the library, which the first to go frees."""
    with bergtow.Simulation(SHORT, threads=1) as sim, pytest.raises(TypeError, match="neither copied nor pickled"):
        duplicate(sim)


def test_a_result_is_not_replaced_unless_asked(tmp_path):
    bergtow.run(SHORT, tmp_path / "out")
    with pytest.raises(bergtow.BergtowError, match="holds a result; .* or set `replace`"):
        bergtow.run(SHORT, tmp_path / "out")
    bergtow.run(SHORT, tmp_path / "out", replace=True)
