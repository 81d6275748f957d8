# SPDX-License-Identifier: MIT
"""An ensemble on two ranks, killed ten times at random moments, some of them within the writing of ensemble.h5, some of
one rank alone: ensemble.h5 ends as the quiet one."""
import json
import os
import pathlib
import random
import signal
import time

import h5py
import pytest

from harness import DONE, TOW, changed, differing, write_case
from resuming import done, started

KILLS, EVERY, STEPS = 10, 20, 400
BASE = changed(TOW, run__duration=STEPS / 10, domain__length=40, domain__width=16, ice__concentration=0.6,
               output__window_start=10, output__checkpoint_steps=EVERY)
STUDY = {"title": "killed", "base": "base.yml", "seed": 3, "parameters": {"ice.concentration": [0.5, 0.7],
                                                                          "tow.speed": [0.1, 0.2]}}
CALL = ("ensemble", "study.yml", "-o", "all", "--threads", 1)


def prepare(folder, ranks):
    write_case(folder, BASE, "base.yml")
    (folder / "study.yml").write_text(json.dumps(STUDY | {"ranks": ranks, "repeats": 7 if ranks == 1 else 2}))
    return folder


def journal(folder):
    """Its lines but for one that a kill has cut."""
    path = folder / "journal.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines() if line.endswith("}")] if path.exists() else []


def attributes(path):
    found = {}
    with h5py.File(path) as f:
        f.visititems(lambda name, item: found.update({(name, key): str(value) for key, value in item.attrs.items()}))
        found.update({("/", key): str(value) for key, value in f.attrs.items()})
    return found


def ranks_of(pid):
    """Process ids of the ranks that the launcher has started; quick, since a writing is over in milliseconds."""
    try:
        return sorted(
            int(word)
            for task in os.listdir(f"/proc/{pid}/task")
            for word in pathlib.Path(f"/proc/{pid}/task/{task}/children").read_text().split())
    except OSError:
        return []


class Killed:
    """The folder of an ensemble, its calls, and what they left at each kill."""

    def __init__(self, folder):
        self.folder, self.all, self.part = folder, folder / "all", folder / "all/ensemble.h5.tmp"
        self.stopped = {}  # member: step of the checkpoint at which it was struck
        self.between = set()  # members struck between two checkpoints
        self.within = self.kills = 0

    def checkpoint(self, name):
        return any(
            (self.all / "members" / name / file).exists() for file in ("checkpoint.h5", "checkpoint.previous.h5"))

    def call(self, until):
        """Start a call and look until it is time or the call ends; a checkpoint of a member that was struck must stay
        until a later one, or the end, takes its place."""
        p, ranks = started(2, *CALL, cwd=self.folder), []
        while p.poll() is None and not (len(ranks) == 2 and until()):
            for name in self.stopped:
                assert self.checkpoint(name) or (self.all / "members" / name /
                                                 "finished").exists(), f"{name} was begun anew"
            if len(ranks) < 2:
                ranks = ranks_of(p.pid)
            time.sleep(0.0002)
        return p, ranks

    def computing(self, starts, seconds):
        """Has this call begun so many members, and then so much time passed?"""
        before, due = self.starts(), []

        def now():
            if not due and self.starts() >= before + starts:
                due.append(time.monotonic() + seconds)
            return bool(due) and time.monotonic() > due[0]
        return now

    def starts(self):
        return len([j for j in journal(self.all) if j["event"] == "start"])

    def writing(self, times):
        """Is ensemble.h5 being written, so many times in this call? What an earlier kill has left is taken away: it
        would look like a writing."""
        self.part.unlink(missing_ok=True)
        seen = [False]

        def now():
            there = self.part.exists()
            if there != seen[-1]:
                seen.append(there)
            return there and len(seen) >= 2 * times
        return now

    def kill(self, until, victim):
        """Kill -9 when it is time: the launcher and all ranks, or one rank, after which the launcher ends the other.
        False when the call was over before."""
        p, ranks = self.call(until)
        alive = p.poll() is None
        if alive:
            for process in (ranks + [p.pid] if victim is None else [ranks[victim]]):
                os.kill(process, signal.SIGKILL)
        p.communicate(timeout=60)
        for process in ranks:  # those of a killed launcher are nobody's children
            while os.path.exists(f"/proc/{process}"):
                time.sleep(0.002)
        assert p.returncode != DONE if alive else p.returncode == DONE
        self.kills += alive
        self.within += alive and self.part.exists()
        return alive

    def look(self, whole):
        """After a kill: ensemble.h5 is whole, and every member in it is that of the quiet one; members with a
        checkpoint go on from there."""
        if (self.all / "ensemble.h5").exists():
            with h5py.File(self.all / "ensemble.h5") as f, h5py.File(whole) as w:
                status, mean = f["members/status"][()], f["summary/mean_ice_resistance_n"][(
                )] if "mean_ice_resistance_n" in f["summary"] else []
                assert set(status) <= {0, 1} and all(
                    mean[k] == w["summary/mean_ice_resistance_n"][k] for k in range(len(mean)) if status[k] == 1)
        for member in (self.all / "members").iterdir():
            if (member / "checkpoint.h5").exists() and not (member / "finished").exists():
                with h5py.File(member / "checkpoint.h5") as f:
                    step = int(f["world/step"][0])
                assert step >= self.stopped.get(member.name, 0)
                if step < STEPS:
                    self.stopped[member.name] = step
                    # else it was reported by the launcher, whose other rank was killed, and had time for a checkpoint
                    self.between |= {member.name} if step % EVERY == 0 else set()


@pytest.mark.parametrize("ranks", [1, 2])
def test_ten_kills(tmp_path, ranks):
    quiet, struck = prepare(tmp_path / "quiet", ranks), Killed(prepare(tmp_path / "struck", ranks))
    done(2, *CALL, cwd=quiet)
    whole = quiet / "all/ensemble.h5"
    one = min(j["wall_time_s"] for j in journal(quiet / "all") if j["event"] == "finished")
    moments = random.Random(10 + ranks)
    plan = [("time", None)] * 3 + [("time", 0), ("time", 1), ("time", moments.randrange(2))
                                   ] + [("first writing", None)] * 2 + [("first writing", 0)]
    moments.shuffle(plan)
    for kind, victim in plan + [("later writing", None)]:
        if kind.endswith("writing"):
            struck.kill(struck.writing(1 if kind == "first writing" else 2), victim)
        else:
            struck.kill(struck.computing(moments.choice([1, 2]) if ranks == 1 else 1, one * moments.uniform(0.2, 1)),
                        victim)
        struck.look(whole)
    p, _ = struck.call(lambda: False)
    p.communicate(timeout=300)
    starts = [j["member"] for j in journal(struck.all) if j["event"] == "start"]
    print(
        f"{ranks} ranks a member: {struck.kills} kills, {struck.within} of them within the writing of ensemble.h5; "
        f"{len(starts)} starts of {len(set(starts))} members, "
        f"{len(struck.stopped)} of which went on from a checkpoint, {len(struck.between)} struck between two")
    assert p.returncode == DONE and struck.kills == KILLS and struck.within >= 2 and len(struck.between) >= 2
    assert differing(whole, struck.all / "ensemble.h5") == [] and attributes(whole) == attributes(
        struck.all / "ensemble.h5")
    assert not list(struck.all.glob("*.tmp")) and not list(struck.all.glob("members/*/checkpoint*.h5"))
