# SPDX-License-Identifier: MIT
"""A run that is stopped or killed on some ranks ends, on others, as the run that was never stopped.

What turns these tests red (tried): contact memory gathered from one rank alone, open collisions
ended by the last step of every call, the entry of the series under way left out, the frame that the end of --steps adds
kept, the panel loads or the stall left out, a checkpoint without the result that it counts on.
"""
import random
import signal
import time

import h5py
import pytest

from harness import SIGNAL, Run, changed, quick
from made_up_ensemble import edited
from resuming import assert_same_result, check_readable, done, killed_after, started, uninterrupted
from test_window import LINE as WINDOW


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    path, seconds = uninterrupted(folder)
    events = [e["kind"] for e in Run(path, None).summary["events"]]
    assert "line_broken" in events and "waypoint" in events
    return folder, path, seconds


@pytest.mark.parametrize("before, after, steps", quick([(1, 2, 83), (2, 1, 85), (2, 4, 88)], (2, 4, 88)))
def test_on_other_ranks(whole, before, after, steps):
    """Stopped in the middle of a sample of three steps, between two frames, with a collision under way."""
    folder, path, _ = whole
    name = f"r{before}to{after}"
    done(before, "run", "case.yml", "-o", name, "--quiet", "--threads", 1, "--steps", steps, cwd=folder)
    with h5py.File(folder / name / "checkpoint.h5") as f:
        assert f["record/merged_steps"][0] > 0 and len(f["impacts/open"]) > 0
    done(after, "resume", name, "--quiet", "--threads", 1, cwd=folder)
    assert_same_result(path, folder / name)
    assert Run(folder / name, None).summary["ranks"] == after


def test_a_checkpoint_of_version_0_1_0(whole):
    """A collision under way had no limit by contact laws, the last number of its row."""
    folder, path, _ = whole
    done(1, "run", "case.yml", "-o", "earlier", "--quiet", "--threads", 1, "--steps", 88, cwd=folder)
    with edited(folder / "earlier/checkpoint.h5") as f:
        rows = f["impacts/open"][:, :-1]
        assert len(rows) > 0
        del f["impacts/open"]
        f["impacts/open"] = rows
    done(1, "resume", "earlier", "--quiet", "--threads", 1, cwd=folder)
    assert_same_result(path, folder / "earlier")


def test_the_window(tmp_path):
    """Floes that have changed their place, and laps that are counted."""
    case = changed(WINDOW, run__duration=25, output__checkpoint_steps=37)
    path, _ = uninterrupted(tmp_path, case)
    assert Run(path, None).summary["moving_window"]["renewed"] > 50
    done(2, "run", "case.yml", "-o", "cut", "--quiet", "--threads", 1, "--steps", 110, cwd=tmp_path)
    done(3, "resume", "cut", "--quiet", "--threads", 1, "--steps", 50, cwd=tmp_path)
    done(1, "resume", "cut", "--quiet", "--threads", 1, cwd=tmp_path)
    assert_same_result(path, tmp_path / "cut")


def kill_and_resume(folder, name, path, share):
    """Kill a run again and again, on ranks that change each time, after a random part of `share` seconds; True when
    three kills and more have struck, after the launcher had started it."""
    moments = random.Random(20)
    kills = 0
    command = ["run", "case.yml", "-o", name]
    for k in range(40):
        ranks = [2, 1, 2, 3][k % 4]
        if killed_after((0.2 + moments.random()) * share * (0.5 + 0.5 * ranks), ranks, *command, "--quiet", "--threads",
                        1, cwd=folder):
            kills += (folder / name).exists()
            check_readable(folder / name)
        elif (folder / name / "summary.json").exists():
            break
        if (folder / name / "case.resolved.yml").exists():
            command = ["resume", name]
        if kills == 5:
            break
    done(2, *command, "--quiet", "--threads", 1, cwd=folder)
    assert_same_result(path, folder / name)
    return kills >= 3


def test_killed_again_and_again(whole):
    """Five kills at random moments of one run; most fall into the writing of a checkpoint. How long a run takes
    depends on what else the machine does, and so does its start: where too few struck, another is killed sooner or
    later."""
    folder, path, seconds = whole
    assert any(kill_and_resume(folder, f"killed{share}", path, share * seconds)
               for share in (0.5, 0.25, 1, 0.125, 2)), "the runs were over too soon, or killed before they began"


def test_a_signal_to_all_ranks(whole):
    """mpirun hands on SIGUSR2: all stop after the same step, with a checkpoint."""
    folder, path, _ = whole
    p = started(2, "run", "case.yml", "-o", "signalled", "--quiet", "--threads", 1, cwd=folder)
    while not (folder / "signalled/checkpoint.h5").exists() and p.poll() is None:
        time.sleep(0.01)
    p.send_signal(signal.SIGUSR2)
    _, err = p.communicate(timeout=60)
    assert p.returncode == SIGNAL and "bergtow resume signalled" in err, err
    done(1, "resume", "signalled", "--quiet", "--threads", 1, cwd=folder)
    assert_same_result(path, folder / "signalled")
