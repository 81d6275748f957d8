# SPDX-License-Identifier: MIT
"""Files of a folder that are of another run than its checkpoint, or no longer what the run began with: none of them may
make two runs one."""
import re
import shutil
import subprocess
import sys
import time

import pytest

from harness import BERGTOW, CASE, DONE, ROOT, TOW, Run, call, changed, environment, run, write_case

SHORT = changed(TOW, run__duration=16, output__sample_every=3)
OTHERS = {"another speed": {"tow__speed": 0.05}, "another seed": {"ice__seed": 9},
          "another wind": {}}  # by its table, of which the case has the name alone
DRIFT = changed(SHORT, tow=None) | {"tow": {"mode": "none"}}


def resumed(folder, name, code=DONE):
    result = call("resume", name, "--quiet", "--steps", 4, cwd=folder)
    assert result.returncode == code, (result.returncode, result.stderr)
    return result.stderr


@pytest.fixture
def two(request, tmp_path):
    """A run in its folder, and there the checkpoint of another."""
    wind = tmp_path / "wind.csv"
    wind.write_text("t,u,v\n0,1,0\n40,-2,3\n")
    base = changed(SHORT, air__wind_table="wind.csv")
    case = write_case(tmp_path, base, "one.yml")
    run(tmp_path, case, "--quiet", "--steps", 80, name="one")
    wind.write_text("t,u,v\n0,1,0\n40,-2,2\n")
    run(tmp_path, write_case(tmp_path, changed(base, **OTHERS[request.param]), "other.yml"), "--quiet", "--steps", 50,
        name="other")
    shutil.copy(tmp_path / "other/checkpoint.h5", tmp_path / "one/kept.h5")
    return tmp_path


@pytest.mark.parametrize("two", OTHERS, indirect=True)
def test_a_checkpoint_of_another_run_is_refused(two):
    before = {p.name: p.read_bytes() for p in (two / "one").iterdir()}
    said = "one/result.h5: does not belong to the run of one/kept.h5: it began with another case or other ice"
    assert said in resumed(two, "one/kept.h5", CASE)
    assert {p.name: p.read_bytes() for p in (two / "one").iterdir()} == before
    assert resumed(two, "one") == ""


def test_runs_of_one_case_that_were_led_apart_are_told_apart(tmp_path):
    """By a program, which sets a velocity; their identity is the same."""
    script = tmp_path / "steer.py"
    script.write_text(f"""
import sys; sys.path.insert(0, {str(ROOT / "postproc")!r})
import bergtow
for name, speed in dict(one=0.2, other=0.3).items():
    with bergtow.Simulation({DRIFT!r}, name, threads=1) as sim:
        sim.step(10)
        sim.set_velocity(sim.towed, speed, 0)
        sim.step(60)
try:
    bergtow.Simulation.resume("one", checkpoint="other/checkpoint.h5")
except bergtow.CaseError as error:
    print(error)
""")
    result = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert re.search(r"one/result.h5: does not belong to the run of \S*other/checkpoint.h5: /series/", result.stdout)


@pytest.mark.parametrize("damage", ["edited", "cut", "emptied", "gone"])
def test_the_case_of_a_folder_is_that_of_its_checkpoint(tmp_path, damage):
    run(tmp_path, SHORT, "--quiet", "--steps", 80)
    path = tmp_path / "out/case.resolved.yml"
    text = path.read_text()
    if damage == "gone": path.unlink()
    else: path.write_text({"edited": text.replace("speed: 0.13 m/s", "speed: 0.2 m/s"), "cut": text[:3000],
                           "emptied": ""}[damage])
    assert "warning: out/case.resolved.yml: was not the case that the run began with" in resumed(tmp_path, "out")
    assert path.read_text() == text and "speed: 0.13 m/s" in text
    assert resumed(tmp_path, "out") == ""


def test_what_the_files_of_a_case_held_stays_known(two_tables):
    """The comments on them are kept, also where the case is written anew."""
    path = two_tables / "out/case.resolved.yml"
    text = path.read_text()
    assert re.search("^# air.wind_table: 20 bytes", text, re.M)
    path.write_text(text.replace("speed: 0.13 m/s", "speed: 0.2 m/s"))
    assert "was not the case" in resumed(two_tables, "out")
    assert path.read_text() == text


@pytest.fixture
def two_tables(tmp_path):
    (tmp_path / "wind.csv").write_text("t,u,v\n0,1,0\n40,-2,3\n")
    run(tmp_path, changed(SHORT, air__wind_table="wind.csv"), "--quiet", "--steps", 50)
    return tmp_path


def test_the_case_in_python_is_that_of_the_checkpoint(two_tables):
    """Also where the file says another, and a table is gone that the run no longer needs."""
    script = two_tables / "resume.py"
    script.write_text(f"""
import os, pathlib, sys; sys.path.insert(0, {str(ROOT / "postproc")!r})
import bergtow
file = pathlib.Path("out/case.resolved.yml")
for text in file.read_text().replace("speed: 0.13 m/s", "speed: 0.2 m/s"), "":
    file.write_text(text)
    with bergtow.Simulation.resume("out", threads=1) as sim:
        sim.step(2)
        assert sim.case["tow.speed"] == 0.13, sim.case["tow.speed"]
os.remove("wind.csv")
with bergtow.Simulation.resume("out", threads=1) as sim:
    sim.step(2)
""")
    result = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=two_tables)
    assert result.returncode == 0, result.stderr


def killed_at_once(folder):
    """A run without a checkpoint."""
    write_case(folder, changed(TOW, run__dt=0.0005, output__frame_interval=1.5, output__sample_every=7))
    p = subprocess.Popen([BERGTOW, "run", "case.yml", "-o", "out", "--quiet"], cwd=folder,
                         env=environment(OMP_NUM_THREADS=1))
    end = time.time() + 30
    while not (folder / "out/result.part.h5").exists() and time.time() < end:
        time.sleep(0.005)
    p.kill()
    p.wait()
    assert not (folder / "out/checkpoint.h5").exists()
    return folder / "out/case.resolved.yml"


def test_a_case_that_changes_before_the_first_checkpoint(tmp_path):
    """The run starts again by it, and would be another one."""
    path = killed_at_once(tmp_path)
    text = path.read_text()
    for other in (text.replace("speed: 0.13 m/s", "speed: 0.2 m/s"), text[:3000], text + "---\ntow: {speed: 0.5}\n",
                  re.sub("# case: .*\n", "", text)):
        assert other != text
        path.write_text(other)
        assert "out/case.resolved.yml: has changed since the run in out began; restore it" in resumed(
            tmp_path, "out", CASE)
        assert not (tmp_path / "out/checkpoint.h5").exists()
    path.write_text(text + "# a note of mine\n")
    assert resumed(tmp_path, "out") == "" and Run(tmp_path / "out", None).summary["n_steps"] == 4
