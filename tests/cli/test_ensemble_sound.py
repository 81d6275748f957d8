# SPDX-License-Identifier: MIT
"""Members whose files are not what they left are reported, run again, and never in ensemble.h5; a call ends with 0 only
without a hole."""
import json
import os
import shutil
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest

from harness import BERGTOW, CASE, DONE, IO, SIGNAL, TOW, call, changed, differing, environment, launcher, write_case

BASE = changed(TOW, run__duration=20, output__window_start=5)
STUDY = {"base": "base.yml", "repeats": 2, "parameters": {"tow.speed": [0.1, 0.15]}}


def ensemble(folder, *more, **how):
    return call("ensemble", "study.yml", "-o", "all", "--threads", 1, *more, cwd=folder, **how)


def on_two_ranks(folder):
    return subprocess.run([*launcher(2), BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1"], cwd=folder,
                          env=environment(OMP_NUM_THREADS=1), capture_output=True, text=True, timeout=180)


def started(folder):
    return [j["member"] for j in map(json.loads,
                                     (folder / "all/journal.jsonl").read_text().splitlines()) if j["event"] == "start"]


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("quiet")
    write_case(folder, BASE, "base.yml")
    (folder / "study.yml").write_text(json.dumps(STUDY))
    assert ensemble(folder).returncode == DONE
    return folder


@pytest.fixture
def copy(quiet, tmp_path):
    shutil.copytree(quiet, tmp_path / "copy")
    return tmp_path / "copy"


def flip(path, at):
    raw = bytearray(path.read_bytes())
    raw[at] ^= 1
    path.write_bytes(raw)


def changed_digit(path):
    text = path.read_text()
    at = text.index("mean_ice_resistance_n") + len('mean_ice_resistance_n": ')
    at = next(k for k in range(at, len(text)) if text[k] in "123456789")
    path.write_text(text[:at] + ("2" if text[at] == "1" else "1") + text[at + 1:])


def other(m, *names):
    for name in names or sorted(p.name for p in (m.parent / "c002-r002").iterdir()):
        shutil.copy(m.parent / "c002-r002" / name, m)


DAMAGES = {
    "seal": lambda m: flip(m / "result.h5", -100),
    "first bytes": lambda m: flip(m / "result.h5", 30),
    "last byte": lambda m: flip(m / "result.h5", -1),
    "result cut": lambda m: os.truncate(m / "result.h5", 5000),
    "result empty": lambda m: os.truncate(m / "result.h5", 0),
    "result gone": lambda m: (m / "result.h5").unlink(),
    "summary cut": lambda m: os.truncate(m / "summary.json", 100),
    "summary empty": lambda m: os.truncate(m / "summary.json", 0),
    "summary gone": lambda m: (m / "summary.json").unlink(),
    "summary of no numbers": lambda m: (m / "summary.json").write_text("{}"),
    "a changed digit": lambda m: changed_digit(m / "summary.json"),
    "a changed case": lambda m: flip(m / "case.resolved.yml", 200),
    "record": lambda m: flip(m / "finished", 60),
    "record empty": lambda m: os.truncate(m / "finished", 0),
    "another's result": lambda m: other(m, "result.h5"),
    "another's result and summary": lambda m: other(m, "result.h5", "summary.json"),
    "another's folder": other,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_member_is_run_again(quiet, copy, damage):
    before = len(started(copy))
    DAMAGES[damage](copy / "all/members/c001-r002")
    result = ensemble(copy, "--quiet")
    assert result.returncode == DONE and result.stderr.count(
        "member c001-r002 is not sound and is run again: all/members/c001-r002/") == 1 and result.stderr.count(
            "\n") == 1
    assert started(copy)[before:] == ["c001-r002"]
    assert differing(quiet / "all/ensemble.h5", copy / "all/ensemble.h5") == []
    assert ensemble(copy).stderr == "" and len(started(copy)) == before + 1


@pytest.mark.ranks
def test_on_two_ranks_damage_is_reported_once(quiet, copy):
    for k, damage in enumerate(("last byte", "summary cut", "record empty")):
        DAMAGES[damage](copy / f"all/members/c00{1 + k // 2}-r00{1 + k % 2}")
    before = len(started(copy))
    result = on_two_ranks(copy)
    assert result.returncode == DONE and result.stderr.count("is not sound and is run again") == 3, result.stderr
    assert sorted(started(copy)[before:]) == ["c001-r001", "c001-r002", "c002-r001"]
    assert differing(quiet / "all/ensemble.h5", copy / "all/ensemble.h5") == []


def test_what_cannot_be_read_stays_and_is_a_hole(quiet, copy):
    """Nothing is known of a file that the system does not give: no computed hour is thrown away for that."""
    member = copy / "all/members/c001-r001"
    (member / "finished").rename(member / "kept")
    (member / "finished").mkdir()  # reads as a folder does, also for root
    (member / "finished/x").write_text("")
    before = len(started(copy))
    result = ensemble(copy)
    assert (result.returncode == IO and "member c001-r001 is not sound" in result.stderr
            and "3 members finished, 0 failed, 0 left, 1 not sound" in result.stdout)
    assert len(started(copy)) == before and (member / "result.h5").exists()
    with h5py.File(copy / "all/ensemble.h5") as f:
        assert list(f["members/status"][()]) == [
            0, 1, 1, 1
        ] and f.attrs["complete"] == 0 and "its result" in f["members/reason"].asstr()[0] and np.isnan(
            f["summary/mean_ice_resistance_n"][0])
    shutil.rmtree(member / "finished")
    (member / "kept").rename(member / "finished")
    assert ensemble(copy).returncode == DONE and len(started(copy)) == before
    assert differing(quiet / "all/ensemble.h5", copy / "all/ensemble.h5") == []


def test_a_pipe_in_the_place_of_a_result_stays(copy):
    """It is no file that the program could replace: a failure, and the member is made again when it is gone."""
    pipe = copy / "all/members/c001-r002/result.h5"
    pipe.unlink()
    os.mkfifo(pipe)
    result = ensemble(copy)
    assert result.returncode == IO and "c001-r002/result.h5: is a pipe (FIFO), not a regular file" in result.stderr
    assert pipe.is_fifo()
    pipe.unlink()
    assert ensemble(copy).returncode == DONE and pipe.is_file()


def test_a_damaged_member_that_a_run_is_at_is_left_to_it(copy):
    """Red: what `bergtow resume` was writing in a folder was taken away."""
    import fcntl
    member = copy / "all/members/c002-r002"
    changed_digit(member / "summary.json")
    there = sorted(p.name for p in member.iterdir())
    with open(member / "run.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        result = ensemble(copy, "--no-wait")
        assert result.returncode != DONE and "is run again" not in result.stderr, result.stderr
        assert sorted(p.name for p in member.iterdir()) == sorted([*there, "run.lock"])
    assert ensemble(copy).returncode == DONE


@pytest.mark.skipif(os.geteuid() != 0 or not shutil.which("setpriv"), reason="needs root, to run as another user")
def test_without_permission(quiet, copy):
    member = copy / "all/members/c002-r001"
    for path in (copy, *copy.rglob("*")):
        os.chown(path, 65534, 65534)
    for folder in copy.parents:
        if os.stat(folder).st_uid == 0 and folder != folder.parent and "pytest" in str(folder):
            folder.chmod(0o755)
    (member / "result.h5").chmod(0)
    command = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", BERGTOW, "ensemble", "study.yml", "-o",
               "all", "--threads", "1"]
    result = subprocess.run(command, cwd=copy, env=environment(OMP_NUM_THREADS=1), capture_output=True, text=True,
                            timeout=60)
    if "command not found" in result.stderr or "Permission denied" in result.stderr and BERGTOW in result.stderr:
        pytest.skip("another user cannot reach the program here")
    assert result.returncode == IO and "c002-r001/result.h5: cannot read the file: Permission denied" in result.stderr
    (member / "result.h5").chmod(0o644)
    result = subprocess.run(command, cwd=copy, env=environment(OMP_NUM_THREADS=1), capture_output=True, text=True,
                            timeout=60)
    assert result.returncode == DONE and differing(quiet / "all/ensemble.h5", copy / "all/ensemble.h5") == []


@pytest.mark.slow
def test_a_call_waits_for_members_that_others_are_at_work_on(copy):
    """By a lock of the test's own: the call ends when the member is free and done; --no-wait says what is left, with
    another code."""
    import fcntl
    member = copy / "all/members/c002-r002"
    (member / "finished").unlink()
    with open(member / "lock", "r+b") as lock:
        # Linux: an open file description lock, F_OFD_SETLK; struct flock of 64 bits
        import struct
        fcntl.fcntl(lock, 37, struct.pack("hhqqi4x", fcntl.F_WRLCK, 0, 0, 0, 0))
        result = ensemble(copy, "--no-wait")
        assert (result.returncode == SIGNAL and "1 member still running in other processes" in result.stderr
                and "3 members finished, 0 failed, 1 left" in result.stdout)
        waiting = subprocess.Popen([BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1"], cwd=copy,
                                   env=environment(OMP_NUM_THREADS=1), stdout=subprocess.PIPE, text=True)
        time.sleep(1)
        assert waiting.poll() is None
        interrupted = subprocess.Popen([BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1"], cwd=copy,
                                       env=environment(OMP_NUM_THREADS=1), stderr=subprocess.PIPE, text=True)
        time.sleep(0.5)
        interrupted.send_signal(signal.SIGINT)
        said = interrupted.communicate(timeout=30)[1]
        assert "repeat the command to continue" in said and interrupted.returncode == SIGNAL
    out = waiting.communicate(timeout=60)[0]
    assert (waiting.returncode == DONE and "waiting for 1 member in other processes" in out
            and "4 members finished, 0 failed, 0 left" in out)


def test_threads_as_for_a_run(quiet, tmp_path):
    """--threads, else run.threads of the base case, else OMP_NUM_THREADS."""
    def said(base, *options):
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        write_case(folder, base, "base.yml")
        (folder / "study.yml").write_text(json.dumps({"base": "base.yml"}))
        result = call("ensemble", "study.yml", "-o", "all", *options, cwd=folder, env=environment(OMP_NUM_THREADS=3))
        assert result.returncode == DONE
        threads = json.loads((folder / "all/members/c001-r001/summary.json").read_text())["threads"]
        assert f"1 ranks x {threads} threads each" in result.stdout
        return threads
    short = changed(TOW, run__duration=3, output__window_start=1)
    assert said(short) == 3
    assert said(changed(short, run__threads=2)) == 2
    assert said(changed(short, run__threads=2), "--threads", 4) == 4


def test_a_failed_member_stays_a_hole(tmp_path):
    write_case(tmp_path, BASE, "base.yml")
    (tmp_path / "study.yml").write_text(json.dumps({"base": "base.yml", "parameters": {"run.duration": [8, 3]}}))
    assert [ensemble(tmp_path).returncode for _ in range(2)] == [CASE, CASE]


@pytest.mark.slow
def test_damage_while_a_call_is_at_work(tmp_path):
    """A member that was sound when the call began is looked at again when it is taken in."""
    write_case(tmp_path, BASE, "base.yml")
    (tmp_path / "study.yml").write_text(
        json.dumps({
            "base": "base.yml",
            "variants": {"long": {"run.duration": "150 s", "tow.speed": 0.04}, "short": {"run.duration": 6}}
        }))
    short, long_one = (tmp_path / "all/members" / name for name in ("c002-r001", "c001-r001"))
    child = subprocess.Popen([BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1"], cwd=tmp_path,
                             env=environment(OMP_NUM_THREADS=1), stderr=subprocess.PIPE, text=True)
    assert child.wait(timeout=60) == DONE
    (long_one / "finished").unlink()
    child = subprocess.Popen([BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1"], cwd=tmp_path,
                             env=environment(OMP_NUM_THREADS=1), stderr=subprocess.PIPE, text=True)
    while started(tmp_path).count(long_one.name) < 2:
        time.sleep(0.01)
    flip(short / "result.h5", -1)
    reported = child.communicate(timeout=60)[1]
    assert (child.returncode == IO
            and "member c002-r001 is not sound: all/members/c002-r001/result.h5: has changed since the member "
            "finished; repeat the command to run it again" in reported)
    with h5py.File(tmp_path / "all/ensemble.h5") as f:
        assert list(f["members/status"][()]) == [
            1, 0
        ] and f.attrs["complete"] == 0 and "is not sound and is run again" in f["members/reason"].asstr()[1]
    assert ensemble(tmp_path).returncode == DONE


def test_ensemble_file_is_made_anew_whatever_it_was(quiet, copy):
    flip(copy / "all/ensemble.h5", -1)
    assert ensemble(copy).returncode == DONE
    assert differing(quiet / "all/ensemble.h5", copy / "all/ensemble.h5") == [] and (
        copy / "all/ensemble.h5").read_bytes()[-128:].startswith(b"bergtow sealed file\nkind: ensemble ")
