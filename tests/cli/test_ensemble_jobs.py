# SPDX-License-Identifier: MIT
"""Processes that one call of `ensemble` starts on this machine: the same file, one end, nothing left behind."""
import json
import os
import pathlib
import re
import signal
import subprocess
import time

import pytest

from harness import BERGTOW, CASE, DONE, SIGNAL, TOW, changed, differing, environment, write_case

BASE = changed(TOW, run__duration=20, output__window_start=5)
STUDY = {"title": "small", "base": "base.yml", "repeats": 3, "seed": 4,
         "parameters": {"ice.concentration": [0.2, 0.5]}}


@pytest.fixture
def folder(tmp_path):
    write_case(tmp_path, BASE, "base.yml")
    (tmp_path / "study.yml").write_text(json.dumps(STUDY))
    return tmp_path


def words(out, *more):
    return [BERGTOW, "ensemble", "study.yml", "-o", out, *map(str, more)]


def open_environment(**more):
    """No number of threads asked for."""
    return {k: v for k, v in environment(**more).items() if k != "OMP_NUM_THREADS"}


def ensemble(folder, out, *more, env=None):
    return subprocess.run(words(out, *more), cwd=folder, env=env or open_environment(), capture_output=True, text=True,
                          timeout=300)


def processes(folder, out):
    lines = (folder / out / "journal.jsonl").read_text().splitlines()
    return {json.loads(line)["pid"] for line in lines}


def stat(pid):
    """State and parent of a process; None where there is none."""
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[:2]
    except (FileNotFoundError, ProcessLookupError):
        return None


def children(pid):
    known = [int(p.name) for p in pathlib.Path("/proc").iterdir() if p.name.isdigit()]
    return [p for p in known if (stat(p) or [0, 0])[1] == str(pid)]


def at_work(pid):
    return (stat(pid) or "Z")[0] != "Z"


def shares(result):
    """Members at a time, threads of each."""
    return tuple(map(int, re.search(r"(\d+) at a time, 1 ranks x (\d+) threads", result.stdout).groups()))


def test_jobs_make_the_file_of_one(folder):
    one, three = ensemble(folder, "one", "--jobs", 1), ensemble(folder, "three", "--jobs", 3)
    assert one.returncode == three.returncode == DONE and not one.stderr and not three.stderr
    assert differing(folder / "one/ensemble.h5", folder / "three/ensemble.h5") == []
    assert len(processes(folder, "one")) == 1 and len(processes(folder, "three")) in (2, 3)
    assert len(re.findall(r"finished, .* s", three.stdout)) == 6 and three.stdout.count("0 left") == 1
    assert shares(one)[0] == 1 and shares(three)[0] == 3


@pytest.mark.slow
def test_the_cores_are_shared_by_what_members_keep_busy(folder):
    """Small fields have a thread each; where somebody has asked for threads there is one process, as ever."""
    cores = len(os.sched_getaffinity(0))
    every = ensemble(folder, "all")
    assert shares(every) == (min(cores, 6), max(1, cores // 6))
    assert ensemble(folder, "all").stdout.startswith("6 members") and shares(ensemble(folder, "all"))[0] == 1
    assert shares(ensemble(folder, "asked", "--threads", 2)) == (1, 2)
    assert shares(ensemble(folder, "env", env=environment(OMP_NUM_THREADS=2))) == (1, 2)
    large = dict(domain__length=150, domain__width=100, ice__size=0.7, body__x=20, run__duration=0.2)
    write_case(folder, changed(BASE, **large, output__window_start=0, tow__ramp=0), "base.yml")
    found = ensemble(folder, "large", "--max-wall", 1e-3)  # before the first member begins
    assert found.returncode == SIGNAL, found.stderr
    assert shares(found) == (max(1, cores // 2), cores // max(1, cores // 2))


def test_jobs_leave_the_failures_of_the_call(folder):
    """Failed members are tried again once, not once by each process; and -- may end the options."""
    study = STUDY | {"parameters": {"run.duration": [3, 8, 4]}}  # 3 and 4 are too short for the window
    (folder / "study.yml").write_text(json.dumps(study))
    assert ensemble(folder, "out", "--jobs", 1).returncode == CASE
    path = folder / "out/journal.jsonl"
    before = len(path.read_text().splitlines())
    call = subprocess.run([BERGTOW, "ensemble", "-o", "out", "--jobs", "3", "--retry-failed", "--", "study.yml"],
                          cwd=folder, env=open_environment(), capture_output=True, text=True, timeout=300)
    assert call.returncode == CASE and "usage" not in call.stderr.lower() and "3 at a time" in call.stdout
    events = [json.loads(line) for line in path.read_text().splitlines()[before:]]
    assert sorted(e["member"] for e in events if e["event"] == "failed") == [
        f"c{c:03}-r{r:03}" for c in (1, 3) for r in (1, 2, 3)]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL], ids=["TERM", "KILL"])
def test_no_job_outlives_the_call(folder, number):
    """Asked to stop, all stop with checkpoints; and where the first process is killed the others stop, too."""
    long = ["--set", "run.dt=0.0005"]
    call = subprocess.Popen(words("out", "--jobs", 3, *long), cwd=folder, env=open_environment(), text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    end = time.monotonic() + 60
    while len(list((folder / "out").glob("members/*/result.part.h5"))) < 3:
        assert time.monotonic() < end and call.poll() is None
        time.sleep(0.02)
    jobs = children(call.pid)
    assert len(jobs) == 2
    call.send_signal(number)
    _, errors = call.communicate(timeout=60)
    if number == signal.SIGTERM:
        assert call.returncode == SIGNAL and errors.count("repeat the command to continue") == 1
    while any(map(at_work, jobs)):
        assert time.monotonic() < end + 60
        time.sleep(0.05)
    assert len(list((folder / "out").glob("members/*/checkpoint.h5"))) == (3 if number == signal.SIGTERM else 2)
