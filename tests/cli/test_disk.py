# SPDX-License-Identifier: MIT
"""What `check` says a run leaves on the disk, against what it leaves: within 20 %, on one rank and on two, with
checkpoints, panels and read fields."""
import json
import re
import subprocess
import sys

import pytest

from harness import BERGTOW, DONE, ROOT, TOW, call, changed, environment, launcher, quick, write_case

WITHIN = 0.2
SHORT = changed(TOW, run__duration=10)
UNIT = {"kB": 1e3, "MB": 1e6, "GB": 1e9}

CASES = {
    "a basin": TOW,
    "many frames": changed(SHORT, output__frame_interval=0.1),
    "few frames, many steps": changed(TOW, run__duration=60, output__frame_interval=60),
    "rectangles": changed(SHORT, ice__shape="rectangles", domain__length=40),
    "twelve corners": changed(SHORT, ice__shape="polygons", ice__sides=12, domain__length=40),
    "2,300 floes": changed(TOW, run__duration=3, domain__length=80, domain__width=25),
    "next to no floes": changed(SHORT, domain__length=8, ice__concentration=0.05),
    "panels": changed(TOW, run__duration=60, output__panels=True, output__frame_interval=10),
    "two checkpoints": changed(TOW, output__checkpoint_steps=100, output__frame_interval=5),
    "sampled": changed(TOW, output__sample_every=20),
    "moving": changed(TOW, domain__ends="moving", domain__length=20, body__x=8),
    "dense": changed(SHORT, ice__concentration=0.8),
}


def left(folder):
    return sum(p.stat().st_size for p in folder.iterdir())


def said(text, words):
    number, unit = re.search(words + r" ([\d.e+]+) (kB|MB|GB)", text).groups()
    return float(number) * UNIT[unit]


def run(folder, path, ranks, *more):
    command = launcher(ranks) if ranks > 1 else []
    result = subprocess.run([*command, BERGTOW, "run", path, "-o", folder, "--threads", "1", "--quiet", *more],
                            env=environment(OMP_NUM_THREADS=1), capture_output=True, text=True, timeout=120)
    assert result.returncode == DONE, result.stderr
    return left(folder)


@pytest.mark.parametrize("name, ranks", quick([(name, ranks) for name in CASES for ranks in (1, 2)],
                                              *((name, 1) for name in list(CASES)[1::2]), ("dense", 2)))
def test_what_is_left(tmp_path, name, ranks):
    path = write_case(tmp_path, CASES[name])
    text = call("check", path).stdout
    estimate = said(text, "disk +about" if ranks == 1 else "while it runs;")
    bytes_left = run(tmp_path / "out", path, ranks)
    assert estimate == pytest.approx(bytes_left, rel=WITHIN), f"{estimate / bytes_left:.2f} of what was left"
    if ranks == 1:  # what is said of several ranks is what is left
        assert said(text, "up to") >= 0.8 * bytes_left


@pytest.mark.parametrize("ranks", [1, 2])
def test_of_a_field_that_is_read(tmp_path, ranks):
    """Corners and floes are counted; in the outlines' case they are 17 a floe."""
    path = ROOT / "cases/outlines/outlines.yml"
    sets = ["--set", "run.duration=30 s", "--set", "output.window_start=-1"]
    text = call("check", path, *sets).stdout
    assert said(text, "disk +about" if ranks == 1 else "while it runs;") == pytest.approx(run(
        tmp_path / "out", path, ranks, *sets),
                                                                                          rel=WITHIN)


def test_under_mpirun_the_estimate_is_of_these_ranks(tmp_path):
    path = write_case(tmp_path, CASES["dense"])
    several = subprocess.run([*launcher(2), BERGTOW, "check", path], env=environment(OMP_NUM_THREADS=1),
                             capture_output=True, text=True, timeout=60)
    alone = call("check", path).stdout
    assert several.returncode == DONE and said(several.stdout, "disk +about") == said(alone, "while it runs;") > said(
        alone, "disk +about")
    assert several.stdout.count("\ndomain  ") == 1  # printed once


def test_of_a_study(tmp_path):
    write_case(tmp_path, SHORT, "base.yml")
    (tmp_path / "study.yml").write_text(
        json.dumps({"base": "base.yml", "repeats": 2, "parameters": {"ice.concentration": [0.2, 0.5]}}))
    estimate = said(call("check", "study.yml", cwd=tmp_path).stdout, "disk +about")
    assert call("ensemble", "study.yml", "-o", "all", "--threads", 1, cwd=tmp_path).returncode == DONE
    assert estimate == pytest.approx(sum(p.stat().st_size for p in (tmp_path / "all").rglob("*") if p.is_file()),
                                     rel=WITHIN)


# ---- memory ----

BERG = {
    "run": {"dt": 1, "duration": 600},
    "domain": {"frame": "geographic", "length": 1000, "width": 500, "ends": "moving", "sides": "periodic"},
    "ice": {"concentration": 0.05, "size": 25, "thickness": 0.8},
    "body": {"shape": "disc", "length": 60, "draft": 40},
    "tow": {"mode": "speed", "speed": 0.5, "ramp": 60},
    "output": {"frame_interval": -1},
}
MEMORY = {
    "a day of few floes": changed(BERG, run__duration=86400),
    "a day of few floes, sampled": changed(BERG, run__duration=86400, output__sample_every=100),
    "frames": changed(BERG, output={"frame_interval": 3}),
    "3,500 floes": changed(BERG, run__duration=10, tow__ramp=1, domain__length=2500, domain__width=1200,
                           ice__concentration=0.6),
}


LEAST = """
import os, sys
pid = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ)
_, status, usage = os.wait4(pid, 0)
print(usage.ru_maxrss)
sys.exit(status != 0)
"""


@pytest.mark.parametrize("name", MEMORY)
def test_the_memory_of_a_run_is_that_of_check(tmp_path, name):
    """The largest that a run has at a time, within a factor of 1.5. Red at 3.4 for a day of few floes, whose series
    HDF5 keeps an index of, and at 2 for frames."""
    path = write_case(tmp_path, MEMORY[name])
    estimate = json.loads(call("check", path, "--json").stdout)["cost"]["memory_b"]
    # a small Python in between, for a process begins with the memory of the one that starts it
    words = [sys.executable, "-S", "-c", LEAST, BERGTOW, "run", path, "-o", tmp_path / "out", "--threads", "1",
             "--quiet"]
    done = subprocess.run(list(map(str, words)), env=environment(OMP_NUM_THREADS=1), capture_output=True, text=True,
                          check=True)
    most = 1024 * int(done.stdout)
    assert 2 / 3 < most / estimate < 1.5, f"{most / 1e6:.0f} and {estimate / 1e6:.0f} MB"


def test_check_says_what_the_making_of_ice_takes(tmp_path):
    """Red when nothing is said of minutes, of which none are steps."""
    large = changed(BERG, run__duration=10, tow__ramp=1, domain__length=20e3, domain__width=20e3,
                    ice__concentration=0.5)
    path = write_case(tmp_path, large)
    cost = json.loads(call("check", path, "--json").stdout)["cost"]
    assert 120 < cost["making_of_ice_s"] < cost["core_time_s"]
    assert f"making the ice takes {cost['making_of_ice_s']:.2g} s of it" in call("check", path).stdout
    made = changed(large, ice={"concentration": 0, "thickness": 1}, floes=[{"length": 30, "x": 500, "y": 0}])
    assert "making the ice" not in call("check", write_case(tmp_path, made)).stdout
