# SPDX-License-Identifier: MIT
"""What a member can die of: a bad value, a full disk, a dead rank. It is named, up to the report, and the rest
complete."""
import errno
import fcntl
import json
import os
import re
import signal
import subprocess
import time
from html import unescape

import h5py
import numpy as np
import pytest

import faults
from harness import (BERGTOW, CASE, DONE, IO, NUMERIC, RANK, SIGNAL, TOW, call, changed, differing, environment,
                     launcher, write_case)
from resuming import children, started

from bergtow import cli
from bergtow.reporting import ensemble as report_ensemble
from bergtow.stats import profile as stat_profile

BASE = changed(TOW, run__duration=20, output__window_start=5)
CONDITIONS = {"base": "base.yml", "parameters": {"tow.speed": [0.1, 0.15, 0.2]}}


def prepare(folder, study=CONDITIONS):
    write_case(folder, BASE, "base.yml")
    (folder / "study.yml").write_text(json.dumps(study, indent=1))
    return folder


def ensemble(folder, *more):
    return call("ensemble", "study.yml", "-o", "all", "--threads", 1, *more, cwd=folder)


def journal(folder):
    path = folder / "all/journal.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


@pytest.fixture
def page(monkeypatch):
    """The report of an ensemble as texts: its warnings, and the rows and remarks of its members."""
    monkeypatch.setattr(report_ensemble, "OPTIONS", report_ensemble.OPTIONS | {"resamples": 2})
    monkeypatch.setattr(report_ensemble, "pictures", lambda *_: {})
    monkeypatch.setattr(stat_profile, "FINE", 0.3)  # of intervals, most of the time; no test looks at one

    def made(folder):
        cli.perform("report", folder / "all")
        text = unescape((folder / "all/report.html").read_text())
        rows = {name: re.sub(r"<[^>]*>", " ", rest) for name,
                rest in re.findall(r'<tr[^>]*><th scope="row"><code>(c\d+-r\d+)</code></th>(.*?)</tr>', text, re.S)}
        reported = {
            name: re.sub(r"<[^>]*>", "", rest).strip()
            for name, rest in re.findall(r"<details><summary><code>(c\d+-r\d+)</code>: (.*?)</details>", text, re.S)
        }
        return text.split('<section id="method"')[0], rows, reported
    return made


def statuses(folder):
    with h5py.File(folder / "all/ensemble.h5") as f:
        return dict(zip(f["members/name"].asstr()[()], f["members/status"][()].tolist()))


def test_a_bad_value(tmp_path, page):
    """What only the whole case shows, and what only the setting up does."""
    prepare(tmp_path, {"base": "base.yml", "variants": {"good": {}, "short": {"run.duration": 3},
                                                        "lost": {"ice.field": "none.h5"}, "slow": {"tow.speed": 0.05}}})
    result = ensemble(tmp_path)
    assert result.returncode in (CASE, IO) and "2 members finished, 2 failed, 0 left" in result.stdout
    warnings, rows, reported = page(tmp_path)
    assert "2 members failed" in warnings and "c002-r001: " in warnings and "not complete" not in warnings
    assert [re.search("finished|failed|waiting", rows[f"c00{k}-r001"])[0]
            for k in (1, 2, 3, 4)] == ["finished", "failed", "failed", "finished"]
    assert reported["c002-r001"].startswith(
        "failed") and "output.window_start" in reported["c002-r001"] and "none.h5" in reported["c003-r001"]


@pytest.fixture
def tmpfs():
    """Mounts small file systems, and takes them away."""
    places = []

    def mount(place, size):
        place.mkdir(parents=True, exist_ok=True)
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", place], capture_output=True,
                              text=True)
        if done.returncode != 0:
            pytest.skip(f"no small file system can be mounted here: {done.stderr.strip() or 'not root'}")
        places.append(place)
    yield mount
    for place in reversed(places):
        subprocess.run(["umount", place], check=True)


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    folder = prepare(tmp_path_factory.mktemp("quiet"))
    assert ensemble(folder).returncode == DONE
    return folder


@pytest.mark.parametrize("size", ["4k", pytest.param("64k", marks=pytest.mark.slow)])
def test_a_full_disk_of_one_member(quiet, tmp_path, tmpfs, page, size):
    """4 kB are full before the run begins, and take no record of the failure either; 64 kB become full within it."""
    prepare(tmp_path)
    bad = tmp_path / "all/members/c002-r001"
    tmpfs(bad, size)
    (bad / "there").write_bytes(b"x" * (4096 if size == "4k" else 100))
    result = ensemble(tmp_path)
    assert (result.returncode == IO and "member c002-r001 failed (4)" in result.stderr
            and "No space left" in result.stderr and "2 members finished, 1 failed" in result.stdout)
    assert statuses(tmp_path) == {"c001-r001": 1, "c002-r001": 2, "c003-r001": 1}
    warnings, rows, reported = page(tmp_path)
    assert "1 member failed" in warnings and "c002-r001: " in warnings and "No space left" in reported[
        "c002-r001"] and "failed" in rows["c002-r001"] and "finished" in rows["c003-r001"]
    subprocess.run(["mount", "-o", "remount,size=64m", bad], check=True)
    assert ensemble(tmp_path).returncode == DONE
    assert differing(quiet / "all/ensemble.h5",
                     tmp_path / "all/ensemble.h5") == [] and not list(tmp_path.glob("all/members/*.txt"))


def test_a_full_disk_of_all_members(quiet, tmp_path, tmpfs):
    """Not even the failure can be recorded: it is reported, and the next call, with room, needs no word."""
    prepare(tmp_path)
    tmpfs(tmp_path / "all/members", "16k")
    (tmp_path / "all/members/there").write_bytes(b"x" * 16384)
    result = ensemble(tmp_path)
    assert result.returncode == IO and re.search(
        r"member c003-r001 failed \(4\): .*No space left.*; this could not be recorded",
        result.stderr) and "worked on by other" not in result.stdout
    assert {j["member"]
            for j in journal(tmp_path)
            if j["event"] == "failed"} == {"c001-r001", "c002-r001", "c003-r001"
                                           } and statuses(tmp_path)["c003-r001"] == 0
    subprocess.run(["mount", "-o", "remount,size=64m", tmp_path / "all/members"], check=True)
    assert ensemble(tmp_path).returncode == DONE
    assert differing(quiet / "all/ensemble.h5", tmp_path / "all/ensemble.h5") == []


@pytest.mark.parametrize("size", ["16k", "900k"])
@pytest.mark.slow
def test_four_jobs_on_a_full_disk(quiet, tmp_path, tmpfs, size):
    """All of them end by themselves and say why, in whatever file they find it full; with room, one more call ends as
    the ensemble that always had it."""
    folder = prepare(tmp_path)
    tmpfs(folder / "all", size) # not enough for the study's own files; for one member of three
    jobs = [started(1, "ensemble", "study.yml", "-o", "all", "--threads", 1, cwd=folder) for _ in range(4)]
    for out, err, code in [(*p.communicate(timeout=60), p.returncode) for p in jobs]:
        assert code == IO and "No space left" in err, (code, out, err)
    subprocess.run(["mount", "-o", "remount,size=64m", folder / "all"], check=True)
    assert ensemble(folder).returncode == DONE
    assert differing(quiet / "all/ensemble.h5", folder / "all/ensemble.h5") == [] and statuses(folder) == dict.fromkeys(
        ("c001-r001", "c002-r001", "c003-r001"), 1)


def test_a_folder_that_cannot_be_made(quiet, tmp_path):
    prepare(tmp_path)
    (tmp_path / "all/members").mkdir(parents=True)
    (tmp_path / "all/members/c002-r001").write_text("in the way")
    result = ensemble(tmp_path)
    assert result.returncode == IO and "member c002-r001 failed (4)" in result.stderr and statuses(tmp_path) == {
        "c001-r001": 1, "c002-r001": 2, "c003-r001": 1
    }
    (tmp_path / "all/members/c002-r001").unlink()
    assert ensemble(tmp_path).returncode == DONE
    assert differing(quiet / "all/ensemble.h5", tmp_path / "all/ensemble.h5") == []


def test_a_stopped_member_without_its_result(quiet, tmp_path):
    """Its checkpoint alone cannot be continued: it begins again."""
    assert ensemble(prepare(tmp_path), "--steps", 30).returncode == SIGNAL
    (tmp_path / "all/members/c002-r001/result.h5").unlink()
    assert ensemble(tmp_path).returncode == DONE
    assert differing(quiet / "all/ensemble.h5", tmp_path / "all/ensemble.h5") == []


LONG = {
    "base": "base.yml", "variants": {
        "short": {"run.duration": 6}, "long": {"run.duration": "200 s", "tow.speed": 0.04},
        "slow": {"run.duration": 6, "tow.speed": 0.05}
    }
}


def with_a_dead_rank(folder, member, all_of_them=False):
    """A call on two ranks. Whichever begins the member is killed, and the launcher ends the other; all_of_them: as some
    launchers do it, at once, without a word."""
    known, p = len(journal(folder)), started(2, "ensemble", "study.yml", "-o", "all", "--threads", 1, cwd=folder)
    while p.poll() is None:
        for line in journal(folder)[known:]:
            known += 1
            if line["event"] == "start" and line["member"] == member:
                if all_of_them:  # the other has time to begin something, however short the member is
                    os.kill(line["pid"], signal.SIGSTOP)
                    time.sleep(0.3)
                for process in children(p.pid) if all_of_them else [line["pid"]]:
                    os.kill(process, signal.SIGKILL)
        time.sleep(0.005)
    p.communicate(timeout=60)
    return p.returncode


def died(folder, member):
    return len((folder / "all/members" / member / "attempts").read_text())


@pytest.mark.slow
def test_a_dead_rank(tmp_path, page):
    prepare(tmp_path, LONG | {"ranks": 2})
    assert with_a_dead_rank(tmp_path, "c002-r001") not in (DONE, IO) and died(tmp_path, "c002-r001") == 1
    assert with_a_dead_rank(tmp_path, "c002-r001") not in (DONE, IO) and died(tmp_path, "c002-r001") == 2
    # the rest came first; and what the file says of the one that ended the program is as new as the file
    assert statuses(tmp_path) == {"c001-r001": 1, "c002-r001": 0, "c003-r001": 1}
    warnings, rows, reported = page(tmp_path)
    assert "1 member whose process died; the first: c002-r001: its process died in 1 attempt" in warnings
    assert "waiting" in rows["c002-r001"] and "its process died" in reported["c002-r001"]
    # those between the third and the eighteenth would be alike
    (tmp_path / "all/members/c002-r001/attempts").write_text("." * 18)
    for attempts in 19, 20:
        assert with_a_dead_rank(tmp_path, "c002-r001") not in (DONE, IO) and died(tmp_path, "c002-r001") == attempts
    assert with_a_dead_rank(tmp_path, "none") == NUMERIC
    assert statuses(tmp_path) == {"c001-r001": 1, "c002-r001": 2, "c003-r001": 1}
    warnings, rows, reported = page(tmp_path)
    assert "1 member failed" in warnings and "c002-r001: " in warnings and "died in each of 20 attempts" in reported[
        "c002-r001"] and "failed" in rows["c002-r001"]


@pytest.mark.slow
def test_a_member_beside_one_that_ends_the_program_is_not_given_up_with_it(tmp_path):
    """Two members that each had their process die nineteen times: one of them does nothing wrong."""
    prepare(tmp_path, LONG | {"repeats": 2})
    assert ensemble(tmp_path, "-q").returncode == DONE
    with h5py.File(tmp_path / "all/ensemble.h5") as f:
        whole = f["summary/mean_ice_resistance_n"][()]
    bad, good = (tmp_path / "all/members" / name for name in ("c002-r001", "c002-r002"))
    for member in bad, good:
        (member / "finished").unlink()
        (member / "attempts").write_text("." * 19)
    assert with_a_dead_rank(tmp_path, bad.name, all_of_them=True) not in (DONE, IO)
    assert died(tmp_path, bad.name) == 20 and died(tmp_path, good.name) == 19
    assert with_a_dead_rank(tmp_path, "none") == NUMERIC
    assert statuses(tmp_path) == {f"c00{c}-r00{r}": 2 if (c, r) == (2, 1) else 1 for c in (1, 2, 3) for r in (1, 2)}
    with h5py.File(tmp_path / "all/ensemble.h5") as f:
        assert np.array_equal(f["summary/mean_ice_resistance_n"][()], np.where(np.arange(6) == 2, np.nan, whole),
                              equal_nan=True)


def test_members_that_cannot_be_read(tmp_path):
    """Reads of a file of a finished member fail, each in turn: what the call does not read again it says, and
    ensemble.h5 does not pass for whole without it. The next call finds all."""
    assert ensemble(prepare(tmp_path)).returncode == DONE
    folder = tmp_path / "all"
    whole = (folder / "ensemble.h5").read_bytes()
    assert len(list(folder.rglob("result.h5"))) == 3
    for path in sorted(folder.rglob("summary.json"))[:1] + sorted(folder.rglob("result.h5"))[1:2]:
        words = [BERGTOW, "ensemble", tmp_path / "study.yml", "-o", folder, "--threads", "1"]
        log = tmp_path / "log"
        log.unlink(missing_ok=True)
        assert faults.started(words, faults.shim(path, BT_CALLS_LOG=log)).returncode == DONE
        reads = [c for c in faults.logged(log) if c.name in ("read", "pread64")]
        outcomes = set()
        for n in faults.numbers(len(reads), 12):
            result = faults.started(words, faults.shim(path, BT_CALLS="read,pread64", BT_CALLS_AT=n, BT_CALLS_WITH=5))
            outcomes.add(result.returncode)
            if result.returncode == DONE:  # read again, and found
                assert (folder / "ensemble.h5").read_bytes() == whole
            else:
                assert re.search("Input/output error|could not be read", result.stderr), (n, result.stderr)
        assert outcomes == {DONE, IO}
        assert ensemble(tmp_path).returncode == DONE and (folder / "ensemble.h5").read_bytes() == whole


@pytest.mark.ranks
def test_a_base_case_that_one_rank_cannot_read(tmp_path):
    """Red when the other goes on to share the cores with it: a message about MPI, or a call that hangs."""
    prepare(tmp_path)
    rank = f'[ "{RANK}" = 1 ] || unset LD_PRELOAD; exec "$0" "$@"'
    stale = f"export LD_PRELOAD={faults.CALLS} BT_CALLS=open,openat BT_CALLS_AT=1 BT_CALLS_WITH={errno.ESTALE}; "
    env = environment(OMP_NUM_THREADS=1, BERGTOW_STARTED=1, BT_CALLS_UNDER=tmp_path / "base.yml")
    words = [*launcher(2), "sh", "-c", stale + rank, BERGTOW, "ensemble", tmp_path / "study.yml", "-o", "all"]
    result = faults.started(words, env, tmp_path)
    assert result.returncode == IO and "base.yml: cannot" in result.stderr and "Stale file" in result.stderr, result


def watched(folder, **how):
    """A call whose locks are logged, or refused."""
    words = [BERGTOW, "ensemble", folder / "study.yml", "-o", folder / "all", "--threads", 1]
    return faults.started(words, faults.shim(folder, BT_CALLS=",".join(faults.LOCKS), **how), folder)


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOLCK])
def test_a_disk_without_locks_is_refused(tmp_path, number):
    """Every member seemed to be taken by another process, and was waited for."""
    prepare(tmp_path)
    result = watched(tmp_path, BT_CALLS_AT=1, BT_CALLS_ON=1, BT_CALLS_WITH=number)
    assert result.returncode == IO and os.strerror(number) in result.stderr, result
    assert not result.stdout and not journal(tmp_path)
    assert ensemble(tmp_path).returncode == DONE


def test_a_lock_that_is_refused_at_the_end(tmp_path):
    """ensemble.h5 is not made in its turn: the call says so, whatever stands there."""
    prepare(tmp_path)
    assert ensemble(tmp_path).returncode == DONE
    assert watched(tmp_path, BT_CALLS_LOG=tmp_path / "log").returncode == DONE
    locks = [c.path for c in faults.logged(tmp_path / "log") if c.name in faults.LOCKS]
    last = max(n for n, path in enumerate(locks, 1) if path == str(tmp_path / "all/lock"))
    result = watched(tmp_path, BT_CALLS_AT=last, BT_CALLS_WITH=errno.ENOLCK)
    assert result.returncode == IO and os.strerror(errno.ENOLCK) in result.stderr, result


def test_a_member_that_another_run_is_at_stays_open(tmp_path):
    """A `bergtow resume` of it: with --no-wait the call ends with 6 and records no failure, without it waits."""
    prepare(tmp_path)
    assert ensemble(tmp_path, "--steps", 3).returncode == SIGNAL
    member = tmp_path / "all/members/c002-r001"
    run_lock = open(member / "run.lock", "w")  # as src/base/fileio.c has it
    fcntl.flock(run_lock, fcntl.LOCK_EX)
    result = ensemble(tmp_path, "--no-wait")
    assert result.returncode == SIGNAL and "1 member still running in other processes" in result.stderr, result
    assert not (member / "failed.txt").exists() and statuses(tmp_path)["c002-r001"] == 0
    assert "2 members finished, 0 failed, 1 left" in result.stdout
    waiting = subprocess.Popen([BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1"], cwd=tmp_path,
                               env=environment(OMP_NUM_THREADS=1), stdout=subprocess.PIPE, text=True)
    assert any("waiting for 1 member in other processes" in line for line in waiting.stdout)
    run_lock.close()
    out = waiting.communicate(timeout=60)[0]
    assert waiting.returncode == DONE and "3 members finished, 0 failed, 0 left" in out
    assert "failed" not in {j["event"] for j in journal(tmp_path)}
