# SPDX-License-Identifier: MIT
"""Checkpoints as a user meets them: stops and limits, damage, full disks, two processes in one folder, failures that
can be met again."""
import errno
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import time

import h5py
import pytest

import faults
from harness import (BERGTOW, CASE as REFUSED, DONE, FAULT, IO, NUMERIC, SIGNAL, TOW, USAGE, Run, call, changed,
                     environment, heard, quick, run, write_case)
from made_up_ensemble import edited, seal
from resuming import assert_same_result, check_readable

# Long enough to strike at, with steps that cost next to nothing.
STEPS = 40000
LONG = changed(TOW, run__dt=0.0005, run__duration=0.0005 * STEPS, output__frame_interval=1.5, output__sample_every=7)
BROKEN = "checkpoint.h5: is damaged"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    return folder, run(folder, LONG, "--quiet", name="whole")


def begun(folder, name, *arguments, **more):
    p = subprocess.Popen([BERGTOW, "run", "case.yml", "-o", name, "--quiet", *map(str, arguments)],
                         cwd=folder,
                         stdout=subprocess.PIPE,
                         stderr=subprocess.PIPE,
                         text=True,
                         **{"preexec_fn": heard, "env": environment(OMP_NUM_THREADS=1), **more})
    end = time.time() + 30
    while not (folder / name / "result.part.h5").exists() and time.time() < end:
        time.sleep(0.005)
    time.sleep(0.1)
    return p


def ended(p, code):
    out, err = p.communicate(timeout=60)
    assert p.returncode == code, (p.returncode, out, err)
    return err


def resumed(folder, name, *arguments, code=DONE, **more):
    result = call("resume", name, "--quiet", *arguments, cwd=folder, **more)
    assert result.returncode == code, (result.returncode, result.stdout, result.stderr)
    return result.stderr


# ---- stops ----

@pytest.mark.parametrize("number", quick([signal.SIGTERM, signal.SIGINT, signal.SIGUSR2, signal.SIGHUP], signal.SIGINT))
def test_stopped_by_a_signal(whole, number):
    folder, one = whole
    name = f"signal{int(number)}"
    p = begun(folder, name)
    p.send_signal(number)
    err = ended(p, SIGNAL)
    assert f"stopped by signal {int(number)} after step" in err and f"bergtow resume {name}" in err
    n = Run(folder / name, None).summary["n_steps"]
    assert 0 < n < STEPS
    assert resumed(folder, name) == ""
    assert_same_result(one.dir, folder / name)


@pytest.mark.parametrize("taken", [False, True])
@pytest.mark.parametrize("again", quick([True, False], True))
def test_nohup(whole, again, taken):
    """The end of the session is ignored before the run begins, and stays so, also where a library takes the signal, and
    when the program starts itself again with settings for libgomp."""
    folder, _ = whole
    env = environment(OMP_NUM_THREADS=1, **{"LD_PRELOAD": FAULT, "BT_FAULT_HANGUP": 1} if taken else {})
    if again: del env["BERGTOW_STARTED"]
    name = f"nohup{again}{taken}"
    p = begun(folder, name, env=env, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    p.send_signal(signal.SIGHUP)
    time.sleep(0.1)
    p.send_signal(signal.SIGTERM)
    assert f"stopped by signal {int(signal.SIGTERM)} after step" in ended(p, SIGNAL)


def test_a_checkpoint_by_a_signal(whole):
    """SIGUSR1: a checkpoint and a result to look at, and the run goes on to its end."""
    folder, one = whole
    p = begun(folder, "usr1")
    p.send_signal(signal.SIGUSR1)
    end = time.time() + 20
    while not (folder / "usr1/checkpoint.h5").exists() and time.time() < end:
        time.sleep(0.005)
    assert p.poll() is None, "the run had ended before it was looked at"
    check_readable(folder / "usr1")
    with h5py.File(folder / "usr1/result.h5") as f:
        assert f.attrs["complete"] == 0
    ended(p, DONE)
    assert (folder / "usr1/checkpoint.previous.h5").exists()
    assert_same_result(one.dir, folder / "usr1")


def test_the_stop_file(whole):
    folder, one = whole
    p = begun(folder, "stopped")
    (folder / "stopped/stop").touch()
    assert "stopped by the file stop after step" in ended(p, SIGNAL)
    assert not (folder / "stopped/stop").exists()
    assert resumed(folder, "stopped") == ""
    assert_same_result(one.dir, folder / "stopped")


@pytest.mark.slow
def test_the_wall_time(whole):
    folder, one = whole
    result = call("run", "case.yml", "-o", "walled", "--quiet", "--max-wall", "0.2", cwd=folder)
    assert (
        result.returncode == SIGNAL and "stopped by the limit of 0.2 s of wall time after step" in result.stderr
    ), result.stderr
    pieces = 1
    while call("resume", "walled", "--quiet", "--max-wall", "1s", cwd=folder).returncode == SIGNAL:
        pieces += 1
        assert pieces < 200
    assert_same_result(one.dir, folder / "walled")


def test_by_wall_time(tmp_path):
    """output.checkpoint_wall: many on the way, and the last two are kept."""
    steps = STEPS // 8
    r = run(tmp_path, changed(LONG, output__checkpoint_wall=0.02, run__duration=0.0005 * steps), "--quiet")
    assert (r.dir / "checkpoint.previous.h5").exists() and not list(r.dir.glob("*.tmp"))
    with h5py.File(r.dir / "checkpoint.h5") as a, h5py.File(r.dir / "checkpoint.previous.h5") as b:
        assert a["world/step"][0] == steps > b["world/step"][0] > 0


def test_a_finished_run_says_so(whole):
    folder, one = whole
    before = (one.dir / "result.h5").read_bytes()
    result = call("resume", one.dir)
    assert result.returncode == DONE and f"is finished: all {STEPS} steps are done" in result.stdout
    assert (one.dir / "result.h5").read_bytes() == before


@pytest.mark.parametrize("name, damage, code, text", [
    ("result.h5", lambda path: path.unlink(), IO, "result.h5: cannot read the file: No such file"),
    ("result.h5", lambda path: path.write_bytes(b""), REFUSED, "result.h5: is not this program's result file"),
    ("result.h5", lambda path: flip(path, 70000), REFUSED, "result.h5: is damaged"),
    ("summary.json", lambda path: path.write_text("{"), DONE, ""),
])
def test_a_finished_run_with_a_damaged_file_is_not_called_finished(tmp_path, name, damage, code, text):
    r = run(tmp_path, TOW, "--quiet")
    damage(r.dir / name)
    result = call("resume", r.dir)
    assert result.returncode == code and text in result.stderr, result.stderr
    assert "is finished" not in result.stdout
    assert code or Run(r.dir, None).hash == r.hash


def test_a_resumed_result_tells_how_the_run_began_and_every_revision(tmp_path):
    path = run(tmp_path, TOW, "--quiet", "--steps", 20).dir / "result.h5"
    with edited(path) as f:
        command, revision = f.attrs["command_line"], f.attrs["revision"]
        f.attrs["start_time"], f.attrs["revision"] = "2026-01-02T03:04:05Z", f"fork of {revision}"
    for words in ("--steps", 20), ():
        resumed(tmp_path, "out", *words)
        with h5py.File(path) as f:
            assert f.attrs["start_time"] == "2026-01-02T03:04:05Z" and f.attrs["command_line"] == command
            assert f.attrs["revision"] == f"fork of {revision}, {revision}"


# ---- the folder ----

def test_an_unfinished_run_is_not_replaced_by_a_slip(tmp_path):
    path = write_case(tmp_path, LONG)
    p = begun(tmp_path, "out")
    p.send_signal(signal.SIGSTOP) # it holds the folder, and does not end meanwhile
    again = call("resume", "out", cwd=tmp_path)
    assert again.returncode == IO and f"another run is using this folder (process {p.pid} on" in again.stderr
    again = call("run", path, "-o", "out", "--force", cwd=tmp_path)
    assert again.returncode == IO and "another run is using" in again.stderr
    p.kill()
    p.communicate()
    again = call("run", path, "-o", "out", cwd=tmp_path)
    assert again.returncode == IO and "holds an unfinished run; continue it with `bergtow resume out`" in again.stderr
    # Killed before its first checkpoint: from its case, at time zero.
    result = call("resume", "out", cwd=tmp_path)
    assert (
        result.returncode == DONE and "holds no checkpoint: the run starts at time zero" in result.stdout
    ), result.stderr
    assert Run(tmp_path / "out", None).summary["n_steps"] == STEPS
    with h5py.File(tmp_path / "out/result.h5") as f:
        assert f["case_as_given"][()].decode() == path.read_text()


def test_a_file_that_changes_before_the_first_checkpoint(tmp_path):
    """The run starts again by it, and would be another one."""
    table, resolved = tmp_path / "wind.csv", tmp_path / "out/case.resolved.yml"
    table.write_text("t,u,v\n0,1,0\n40,-2,3\n")
    write_case(tmp_path, changed(LONG, air__wind_table="wind.csv"))
    p = begun(tmp_path, "out")
    p.kill()
    p.communicate()
    table.write_text("t,u,v\n0,1,0\n40,-2,4\n")
    assert f"{table}: has changed since the run in out began; restore it" in resumed(tmp_path, "out", code=REFUSED)
    table.write_text("t,u,v\n0,1,0\n40,-2,3\n")
    kept = shutil.copytree(tmp_path / "out", tmp_path / "kept")
    assert resumed(tmp_path, "kept", "--steps", 2) == "" and (kept / "checkpoint.h5").exists()
    resolved.write_text(re.sub("# air.wind_table: .*", "", resolved.read_text()))
    assert f"{table}: has changed since the run in out began" in resumed(tmp_path, "out", code=REFUSED)


def changes(told):
    return [w["values"] for w in told["warnings"] if w["code"] == "file_changed"]


def test_a_resolved_case_warns_of_files_that_have_changed(tmp_path):
    """By `check` and `run`, also once resumed; not of a file that replaces the one named. Red: another result, and not
    a word."""
    table = tmp_path / "wind.csv"
    table.write_text("t,u,v\n0,1,0\n40,-2,3\n")
    case = write_case(tmp_path, changed(TOW, air__wind_table="wind.csv"))
    assert call("run", case, "-o", "a", cwd=tmp_path).returncode == DONE
    again, other = tmp_path / "a/case.resolved.yml", tmp_path / "other.csv"

    def checked(*words):
        return changes(json.loads(call("check", *words, "--json", cwd=tmp_path).stdout))
    assert checked(case) == checked(again) == []
    table.write_text("t,u,v\n0,1,0\n40,-2,4\n")
    other.write_text("t,u,v\n0,1,0\n40,0,0\n")
    (found,) = checked(again)
    assert (found["key"], found["file"]) == ("air.wind_table", str(table)) and found["now"] != found["recorded"]
    assert all(re.fullmatch(r"20 bytes, xxh128 [0-9a-f]{32}", found[name]) for name in ("now", "recorded"))
    assert checked(case) == checked(again, "--set", f"air.wind_table={other}") == []
    (tmp_path / "based.yml").write_text(f"base: {again}\nair: {{wind_table: other.csv}}\n")
    (tmp_path / "longer.yml").write_text(f"base: {again}\nrun: {{title: longer}}\n")
    (tmp_path / "quoted.yml").write_text(f"base: {again}\nair: {{'wind_table' : other.csv}}\n")
    (tmp_path / "titled.yml").write_text(f"base: {again}\nrun: {{title: 'wind_table: as it was'}}\n")
    assert checked("based.yml") == checked("quoted.yml") == []
    assert checked("longer.yml") == checked("titled.yml") == [found]
    assert call("run", again, "-o", "b", "--steps", 5, cwd=tmp_path).returncode == DONE
    assert changes(Run(tmp_path / "b", None).summary) == [found]
    table.unlink()
    assert call("resume", "b", "--steps", 5, cwd=tmp_path).returncode == DONE
    assert changes(Run(tmp_path / "b", None).summary) == [found]


@pytest.mark.parametrize("arguments, code, text", [
    ([], USAGE, "no folder given"),
    (["nowhere"], IO, "nowhere: there is no such folder"),
    (["empty"], IO, "empty: holds no checkpoint"),
    (["empty", "--max-wall", "2 parsecs"], USAGE, "--max-wall 2 parsecs"),
    (["empty", "--max-wall", "0"], USAGE, "give a time above 0"),
    (["empty", "--stops"], USAGE, "did you mean --steps?"),
    (["empty/notes.txt"], REFUSED, "empty/notes.txt: is not this program's checkpoint file"),
    (["empty/field.h5"], REFUSED, "empty/field.h5: is a field file, but a checkpoint file is needed here"),
])
def test_what_cannot_be_resumed(tmp_path, arguments, code, text):
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty/notes.txt").write_text("no checkpoint")
    if "field" in text:
        call("field", write_case(tmp_path, TOW), "-o", tmp_path / "empty/field.h5")
    result = call("resume", *arguments, cwd=tmp_path)
    assert result.returncode == code and text in result.stderr, result.stderr


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP])
def test_without_locks_it_is_said_once(tmp_path, number):
    write_case(tmp_path, TOW)
    env = faults.shim(tmp_path, BT_CALLS=",".join(faults.LOCKS), BT_CALLS_AT=1, BT_CALLS_ON=1, BT_CALLS_WITH=number)
    for words in ["run", "case.yml", "-o", "out", "--steps", 20], ["resume", "out"]:
        result = call(*words, "--quiet", cwd=tmp_path, env=env)
        assert result.returncode == DONE, result.stderr
        assert [os.strerror(number) in line for line in result.stderr.splitlines()] == [True], result.stderr
    assert Run(tmp_path / "out", result).hash == run(tmp_path, TOW, "--quiet", name="locked").hash


# ---- damage ----

def flip(path, at):
    raw = bytearray(path.read_bytes())
    raw[at % len(raw)] ^= 16
    path.write_bytes(raw)


@pytest.fixture
def stopped(tmp_path):
    """A run stopped in its middle, with two checkpoints."""
    write_case(tmp_path, changed(TOW, output__checkpoint_steps=60))
    whole = run(tmp_path, tmp_path / "case.yml", "--quiet", name="whole")
    run(tmp_path, tmp_path / "case.yml", "--quiet", "--steps", 160)
    return tmp_path, whole.dir


def test_a_damaged_checkpoint_is_not_taken(stopped):
    """The one before it is, with a warning that says why; when that is damaged too, nothing runs."""
    folder, whole = stopped
    flip(folder / "out/checkpoint.h5", 70000)
    assert re.search(f"warning: out/{BROKEN}.*; out/checkpoint.previous.h5 is taken, step 120", resumed(folder, "out"))
    assert_same_result(whole, folder / "out")
    for name in "checkpoint.h5", "checkpoint.previous.h5":
        flip(folder / "out" / name, 12345)
    err = resumed(folder, "out", code=REFUSED)
    assert f"out/{BROKEN}: its bytes do not match their digest; use another copy" in err and "HDF5-DIAG" not in err


def test_a_missing_and_a_cut_checkpoint(stopped):
    folder, whole = stopped
    path = folder / "out/checkpoint.h5"
    path.write_bytes(path.read_bytes()[:-100])
    assert "checkpoint.h5: is truncated" in resumed(folder, "out", "--steps", 3)
    assert (folder / "out/checkpoint.damaged.h5").exists() # set aside: it must not push out the sound one
    path.unlink()
    assert "the last checkpoint is missing; out/checkpoint.previous.h5 is taken" in resumed(folder, "out")
    assert_same_result(whole, folder / "out")


def opened_to_change_it(path):
    with h5py.File(path, "r+"):
        pass


def of_an_earlier_format(path):
    path.write_bytes(re.sub(rb"kind: checkpoint \d+", b"kind: checkpoint 4", path.read_bytes()))


ENDS = {
    "cut": (lambda path: os.truncate(path, 5000), r"is truncated: only 5000 of \d+ bytes"),
    "cut in the seal": (lambda path: os.truncate(path, path.stat().st_size - 1),
                        r"is truncated: only \d+ of \d+ bytes"),
    "cut before the seal": (lambda path: os.truncate(path, path.stat().st_size - 128), "has no seal at its end"),
    "opened to change it": (opened_to_change_it, "has no seal at its end: .*another program has changed"),
    "seal": (lambda path: flip(path, -60), "is damaged"),
    "first word of the seal": (lambda path: flip(path, -128), "is damaged"),
    "longer": (lambda path: path.write_bytes(path.read_bytes() + bytes(200)), "is damaged"),
    "no HDF5": (lambda path: path.write_bytes(bytes(2000)), "is not this program's checkpoint file"),
    "empty": (lambda path: path.write_bytes(b""), "is not this program's checkpoint file"),
    "earlier": (of_an_earlier_format, r'has the format "checkpoint 4", but this program reads "checkpoint \d+"'),
}


def test_a_checkpoint_tells_how_it_ends(stopped):
    folder, _ = stopped
    path = folder / "out/checkpoint.h5"
    sound = path.read_bytes()
    (folder / "out/checkpoint.previous.h5").unlink()
    for name, (damage, says) in ENDS.items():
        path.write_bytes(sound)
        damage(path)
        error = resumed(folder, "out", code=REFUSED)
        assert re.search(rf"checkpoint.h5: ({says})", error), (name, error)


@pytest.mark.parametrize("damage, says", [
    (lambda f: f.create_dataset("numbers", data=[1.0, 2.0]), "holds data that this program does not write"),
    (lambda f: f.pop("contacts/value"), "/contacts/value is missing"),
    (lambda f: f.pop("history/body_yaw"), "/history/body_yaw is missing"),
    (lambda f: f.pop("history/locked_steps"), "/history/locked_steps is missing"),
    (lambda f: f.pop("undisturbed/vel"), "/undisturbed/vel is missing"),
    (lambda f: f.pop("field/bare"), "/field/bare is missing"),
    (lambda f: f.pop("run/energy_limit"), "/run/energy_limit is missing"),
    (lambda f: f["stall/asked"].__setitem__((), float("nan")), "/stall/asked is not finite"),
    (lambda f: f["stall/windows"].__setitem__((), -1), "/stall/windows is not a count")])
def test_what_is_missing_or_too_much_in_a_checkpoint_is_named(stopped, damage, says):
    """Red where a member that is not there is taken for one that a run had not."""
    folder, _ = stopped
    (folder / "out/checkpoint.previous.h5").unlink()
    with h5py.File(folder / "out/checkpoint.h5", "r+") as f:
        damage(f)
    seal(folder / "out/checkpoint.h5")
    assert says in resumed(folder, "out", code=REFUSED)


@pytest.mark.parametrize("name", ["series/body_yaw", "series/rafted_area", "frames/velocity"])
def test_what_is_missing_in_a_result_is_named(stopped, name):
    folder, _ = stopped
    with h5py.File(folder / "out/result.h5", "r+") as f:
        del f[name]
    seal(folder / "out/result.h5")
    assert f"/{name}" in resumed(folder, "out", code=REFUSED)


def test_a_damaged_result_is_not_continued(stopped):
    folder, whole = stopped
    kept = (folder / "out/result.h5").read_bytes()
    flip(folder / "out/result.h5", 99999)
    assert "out/result.h5: is damaged" in resumed(folder, "out", code=REFUSED)
    # later, and of the same run: what is too much is left out
    shutil.copy(whole / "result.h5", folder / "out/result.h5")
    assert resumed(folder, "out", "--steps", 2) == ""
    (folder / "out/result.h5").unlink()
    assert "out/result.h5: cannot read the file: No such file" in resumed(folder, "out", code=IO)
    (folder / "out/result.h5").write_bytes(kept)
    assert "holds" in resumed(folder, "out", code=REFUSED) # older than the checkpoint by now
    shutil.copy(whole / "result.h5", folder / "out/result.h5")
    assert resumed(folder, "out") == ""
    assert_same_result(whole, folder / "out")


def test_a_resume_that_cannot_begin_leaves_the_folder(stopped):
    """Red when it takes the summary away first, or leaves a result that it has begun: at a limit on the size of files,
    and at a result that is refused."""
    folder, _ = stopped
    def held():
        return {p.name: p.read_bytes() for p in (folder / "out").iterdir()}
    before = held()
    for kilobytes in 10, 60:
        limit = (1024 * kilobytes, ) * 2
        resumed(folder, "out", code=IO, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit))
        assert held() == before
    flip(folder / "out/result.h5", 99999)
    resumed(folder, "out", code=REFUSED)
    assert held().keys() == before.keys()


def test_without_a_body_in_a_domain_far_from_the_origin(tmp_path):
    """Red when the file of all keys gives a distance ahead of a body that is not there, which no case may have."""
    case = {"run": {"dt": 0.2, "duration": 4}, "domain": {"frame": "geographic", "x0": -17, "length": 5, "width": 4,
                                                          "ends": "wall", "sides": "wall"},
            "body": {"shape": "none"}, "tow": {"mode": "none"},
            "ice": {"concentration": 0.4, "size": 0.8, "thickness": 0.1}}
    whole = run(tmp_path, case, "--quiet", name="whole")
    run(tmp_path, case, "--quiet", "--steps", 10)
    assert resumed(tmp_path, "out") == ""
    assert_same_result(whole.dir, tmp_path / "out")


def test_tables_and_fields_may_be_gone(tmp_path):
    """The checkpoint holds them: a run that goes on reads no file that the case names."""
    (tmp_path / "wind.csv").write_text("t,u,v\n0,1,0\n40,-2,3\n")
    call("field", write_case(tmp_path, TOW, "field.yml"), "-o", tmp_path / "ice.h5")
    case = changed(TOW, ice={"field": "ice.h5", "friction": 0.3}, air={"wind_table": "wind.csv"})
    whole = run(tmp_path, case, "--quiet", name="whole")
    run(tmp_path, case, "--quiet", "--steps", 100)
    (tmp_path / "wind.csv").unlink()
    (tmp_path / "ice.h5").unlink()
    (tmp_path / "case.yml").unlink()
    assert resumed(tmp_path, "out") == ""
    assert_same_result(whole.dir, tmp_path / "out")


def test_diff_names_the_first_difference(stopped):
    folder, whole = stopped
    out, old = folder / "out/checkpoint.h5", folder / "out/checkpoint.previous.h5"
    same = call("diff", out, out)
    assert same.returncode == DONE and same.stdout == "the states are the same\n"
    other = call("diff", out, old)
    assert other.returncode == 1 and re.match(
        r"/bodies/\w+: row \d+, column \d+: \S+ and \S+ \(\d+ of \d+ numbers differ\)\n", other.stdout), other.stdout
    shown = call("diff", "out", cwd=folder)
    assert shown.returncode == DONE and re.search(r"world/step +int64 +160\n",
                                                  shown.stdout) and "tow/travel_x" in shown.stdout
    flip(old, 5000)
    assert call("diff", out, old).returncode == REFUSED


# ---- no space, no permission ----

@pytest.fixture
def small_disk(tmp_path):
    """A file system of 7 MB, or, where none can be mounted, None: then a limit on the size of files stands in for
    it."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = os.geteuid() == 0 and subprocess.run(["mount", "-t", "tmpfs", "-o", "size=7m", "tmpfs", disk],
                                                   capture_output=True).returncode == 0
    yield disk, mounted
    if mounted:
        subprocess.run(["umount", "-l", disk], check=False)


@pytest.mark.slow
def test_a_disk_that_fills_up(tmp_path, small_disk):
    """Whatever write meets it, the earlier checkpoint stays, and the run goes on to the same end when there is
    space."""
    disk, mounted = small_disk
    case = changed(TOW, output__checkpoint_steps=20, output__frame_interval=0.5)
    whole = run(tmp_path, case, "--quiet", name="whole")
    write_case(disk, case)
    assert call("run", "case.yml", "-o", "out", "--quiet", "--steps", 100, cwd=disk).returncode == DONE
    before = (disk / "out/checkpoint.h5").read_bytes()
    faults = set()
    for left in 0, 30, 200, 500, 900, 1500:
        ballast = disk / "ballast"
        if mounted:
            free = os.statvfs(disk).f_bavail * os.statvfs(disk).f_frsize
            ballast.write_bytes(bytes(max(0, free - 1024 * left)))
            result = call("resume", "out", "--quiet", cwd=disk)
            ballast.unlink()
        else:
            result = call("resume", "out", "--quiet", cwd=disk,
                          preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1024 * left, 1024 * left)))
        if result.returncode == DONE:
            break
        assert result.returncode == IO and len(result.stderr.splitlines()) == 1, (left, result.returncode,
                                                                                  result.stderr)
        fault = re.search(
            r"out/(\S+): cannot (?:write the|make the|create the) file: (?:No space left on device|File too large); "
            r"(free|raise)",
            result.stderr)
        assert fault, result.stderr
        faults.add(fault[1])
        check_readable(disk / "out")
        if "checkpoint.h5" not in faults: # none has been completed since
            checkpoints = [(disk / "out" / n).read_bytes()
                           for n in ("checkpoint.h5", "checkpoint.previous.h5")
                           if (disk / "out" / n).exists()]
            assert len(checkpoints) == 2 and (before in checkpoints or left > 200)
    assert len(faults) >= 2, faults
    if result.returncode != DONE:
        resumed(disk, "out")
    assert_same_result(whole.dir, disk / "out")


@pytest.fixture
def somebody(tmp_path):
    """Words before a command that make it run without the rights of the superuser, who may write anywhere."""
    if os.geteuid() != 0:
        return []
    if not shutil.which("setpriv"):
        pytest.skip("the superuser may write anywhere, and there is no setpriv to be someone else with")
    for path in [tmp_path, *tmp_path.parents][:3]:
        path.chmod(path.stat().st_mode | 0o55)
    return ["setpriv", "--reuid", "65534", "--clear-groups"]


def test_a_folder_that_must_not_be_written(stopped, somebody):
    folder, whole = stopped
    out = folder / "out"
    before = (out / "checkpoint.h5").read_bytes()
    out.chmod(0o555)
    result = subprocess.run([*somebody, BERGTOW, "resume", "out", "--quiet"], cwd=folder,
                            env=environment(OMP_NUM_THREADS=1), capture_output=True, text=True, timeout=60)
    out.chmod(0o755)
    assert result.returncode == IO and re.search(
        r"out/run.lock: cannot make the file: Permission denied; change the permissions", result.stderr), result.stderr
    assert (out / "checkpoint.h5").read_bytes() == before
    resumed(folder, "out")
    assert_same_result(whole, out)


@pytest.mark.slow
def test_a_folder_that_may_no_longer_be_written(tmp_path, somebody):
    """In the middle of the run: it ends at the next checkpoint, the last one stays, and it goes on when it may."""
    case = changed(LONG, run__duration=6, output__checkpoint_steps=1500)
    whole = run(tmp_path, case, "--quiet", name="whole")
    out = tmp_path / "out"
    out.mkdir()
    out.chmod(0o777)
    p = subprocess.Popen([*somebody, BERGTOW, "run", "case.yml", "-o", "out", "--quiet"], cwd=tmp_path,
                         env=environment(OMP_NUM_THREADS=1), stderr=subprocess.PIPE, text=True)
    end = time.time() + 30
    while not (out / "checkpoint.h5").exists() and time.time() < end:
        time.sleep(0.005)
    p.send_signal(signal.SIGSTOP)
    out.chmod(0o555)
    before = (out / "checkpoint.h5").read_bytes()
    p.send_signal(signal.SIGCONT)
    _, err = p.communicate(timeout=60)
    out.chmod(0o777)
    assert p.returncode == IO and re.fullmatch(
        r"(bergtow: out/\S+: cannot \w+ the file: Permission denied; change the permissions.*\n){1,2}", err), err
    assert before in [(out / n).read_bytes() for n in ("checkpoint.h5", "checkpoint.previous.h5") if (out / n).exists()]
    check_readable(out)
    resumed(tmp_path, "out")
    assert_same_result(whole.dir, out)


# ---- guards ----

JAM = changed(TOW, run__duration=25, ice__concentration=0.8, solver={"max_sweeps": 3, "tolerance": 1e-6},
              output__checkpoint_steps=30)


@pytest.mark.parametrize("guard, value, text", [
    ("overlap", 0.002, r"two bodies overlap by \S+ m, \S+ of the mean floe size \(guard.overlap 0.002\)"),
    ("energy", 0.002, r"the bodies have \S+ J of kinetic energy"),
    ("unconverged", 7, r"7 steps in a row did not converge"),
])
def test_a_guard_leaves_the_state_before(tmp_path, guard, value, text):
    """Exit code 5; failure.h5 is the state one step before, and to take it up meets the same failure."""
    r = run(tmp_path, changed(JAM, **{f"guard__{guard}": value}), "--quiet", code=NUMERIC)
    said = re.search(rf"step (\d+): {text}.*", r.result.stderr)
    assert said and f"{r.dir}/failure.h5 holds the state before that step" in r.result.stderr, r.result.stderr
    step = int(said[1])
    with h5py.File(r.dir / "failure.h5") as f:
        assert f["world/step"][0] == step - 1 > 0
    assert not (r.dir / "summary.json").exists() and not (r.dir / "result.part.h5").exists()
    check_readable(r.dir)
    for what in "out/failure.h5", "out":
        assert said[0] in resumed(tmp_path, what, code=NUMERIC)
    free = run(tmp_path, JAM, "--quiet", "--steps", step - 1, name="free")
    text = call("diff", free.dir, r.dir / "failure.h5").stdout
    assert text.startswith("/case/resolved: the texts differ"), text # and nothing before it: bodies


def test_a_failure_is_told_before_the_state_is_made_again(tmp_path):
    """That takes as long as the run has, and is given up where --max-wall, counted from the first start, is over.
    The run is held from its first line until then."""
    write_case(tmp_path, changed(LONG, guard__energy=1e-3))
    start = time.time()
    p = begun(tmp_path, "out", "--max-wall", 4)
    line = p.stderr.readline()
    p.send_signal(signal.SIGSTOP)
    assert re.search(r"step \d+: the bodies have", line), line
    time.sleep(max(0, start + 4.1 - time.time()))
    p.send_signal(signal.SIGCONT)
    rest = p.stderr.read() # communicate would lose what has been read ahead
    assert re.search(r"the \d+ steps up to the state before .*\n.*computed again: stopped meanwhile; .*resume out",
                     rest)
    ended(p, NUMERIC)
    assert not (tmp_path / "out/failure.h5").exists()
