# SPDX-License-Identifier: MIT
"""Calls of the system that fail at the n-th time, some n of each kind; tests/long/test_faults.py has them all. And the
order in which bytes and names are brought to the disk."""
import os

import pytest

import faults
from faults import SCENARIOS, chosen, not_durable
from harness import quick

# runs of each scenario; with ranks, and with three members, each takes seconds
MOST = {"run": 12, "resume": 10, "run --force": 12, "field": 6, "field to GeoJSON": 6, "run --dump-contacts": 6,
        "ensemble": 3, "ensemble, 2 jobs": 3, "ensemble, 2 jobs, the second": 3, "2 ranks": 2,
        "2 ranks, the second": 2, "run --force, 2 ranks": 2}


@pytest.fixture(scope="module")
def scenarios(tmp_path_factory):
    made = {}

    def get(name):
        if name not in made:
            scenario = SCENARIOS[name](tmp_path_factory.mktemp("faults"))
            made[name] = scenario, scenario.calls_of()
        return made[name]

    return get


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.ranks) if n == "2 ranks" else n for n in quick(
    SCENARIOS, "run", "resume", "run --force", "field", "ensemble", "2 ranks")])
def test_nothing_is_lost(scenarios, name):
    scenario, calls = scenarios(name)
    wrong = []
    for fault, call, n in chosen(calls, MOST[name]):
        try:
            scenario.strike(fault, (call, ), n)
        except (AssertionError, OSError, KeyError) as e:
            wrong.append(f"{fault} at {call} {n}: {e}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("name", ["run", "run --force", "field"])
def test_no_memory(scenarios, name):
    """Refused at some requests of the program's own code."""
    scenario, _ = scenarios(name)
    wrong = []
    for n in faults.numbers(scenario.requests(), 6):
        try:
            scenario.starve(n)
        except (AssertionError, OSError, KeyError) as e:
            wrong.append(f"request {n}: {e}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("name", quick(SCENARIOS, *(n for n in SCENARIOS if "job" not in n)))
def test_bytes_before_names_and_names_before_removals(scenarios, name):
    """As the calls come: a file is synced before it gets its name, the folder after it and before others go."""
    _, calls = scenarios(name)
    assert not_durable(calls) == []


def test_an_attempt_is_on_the_disk_before_it_begins(scenarios):
    """A member that takes the machine down with it is counted all the same, and not tried for ever."""
    _, calls = scenarios("ensemble")
    noted = [k for k, c in enumerate(calls) if c.path.endswith("/attempts") and c.name in faults.WRITES]
    assert len(noted) == 3
    for k in noted:
        after = next(c for c in calls[k + 1:] if c.path.startswith(os.path.dirname(calls[k].path)))
        assert after.name in faults.SYNCS and after.path == calls[k].path and after.result == 0


@pytest.mark.slow
def test_a_job_that_cannot_be_started_is_done_without(scenarios):
    assert scenarios("ensemble, 2 jobs")[0].strike("EAGAIN", ("posix_spawn", ), 1) == "done"


def test_a_job_that_is_killed_is_reported_and_its_member_done(scenarios):
    scenario, _ = scenarios("ensemble, 2 jobs, the second")
    assert scenario.strike("kill", ("fsync", ), 5) == "done"
    assert any(c.name == "killed" for c in faults.logged(scenario.base / "log"))


def test_a_signal_brings_one_checkpoint(scenarios):
    """SIGUSR1 while the first checkpoint is written: another after the next step, and none more."""
    scenario, calls = scenarios("run")
    def checkpoints(log):
        return sum(c.name.startswith("rename") and c.path.endswith("/checkpoint.h5.tmp") for c in log)
    assert scenario.strike("SIGUSR1", ("rename", "renameat"), 3) == "done"
    assert checkpoints(faults.logged(scenario.base / "log")) == checkpoints(calls) + 1


def test_the_old_result_goes_last(scenarios):
    """None of it is removed before the checkpoint of the new one has its name for good."""
    _, calls = scenarios("run --force")
    gone = [k for k, c in enumerate(calls) if c.name.startswith("unlink") and "/replaced/" in c.path]
    stands = [k for k, c in enumerate(calls) if c.name.startswith("rename") and c.path.endswith("checkpoint.h5.tmp")]
    synced = [k for k, c in enumerate(calls) if c.name in faults.SYNCS and c.path.endswith("/out") and k > stands[0]]
    assert gone and synced[0] < min(gone)


def test_what_is_made_stands_in_this_order(scenarios):
    """Result, pictures, checkpoint, summary: each counts on those before it."""
    _, calls = scenarios("run")
    names = [c.second.rsplit("/", 1)[1] for c in calls if c.name.startswith("rename")]
    checkpoint = ["result.h5", "frames.xdmf", "checkpoint.h5"]
    later = ["result.h5", "frames.xdmf", "checkpoint.previous.h5", "checkpoint.h5"]
    assert names == ["case.resolved.yml.new", "case.resolved.yml", *checkpoint, *later, *later, "summary.json"]


@pytest.mark.ranks
def test_the_other_rank_syncs_its_frames_at_each_checkpoint(scenarios):
    """Two checkpoints and the end: what rank 0 syncs is not what another machine still holds."""
    _, calls = scenarios("2 ranks, the second")
    assert sum(c.name in faults.SYNCS and c.path.endswith("/result.part.h5") and c.result == 0 for c in calls) == 3
