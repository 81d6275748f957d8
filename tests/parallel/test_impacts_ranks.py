# SPDX-License-Identifier: MIT
"""Collisions and panel loads: the same rows in the same order, to the bit, on any ranks and threads."""
import subprocess

import h5py
import pytest

from counted import assert_counted_over_the_window
from harness import DONE, QUAY_CUTS, TOW, VALIDATE, Run, changed, differing, environment, launcher, quay, quick, run
from made_up_ensemble import edited
from resuming import assert_same_result, done

KEPT = {"output": {"panels": True, "frame_interval": 5}, "run": {"dt": 0.1, "duration": 10}}
# A body of infinite mass, whose contacts lie in the cells of the floes, and a free one, whose contacts are one rank's.
# The first is broad and in many cells: it hits several floes in a step, found by several threads and ranks.
CASES = {
    "speed": changed(TOW,
                     **KEPT,
                     domain={"length": 24, "width": 16},
                     ice__size=0.5,
                     body={"length": 1.5, "width": 10, "shape": "rectangle", "x": 3}),
    "line": changed(TOW, **KEPT, tow={"mode": "line", "speed": 0.13, "ramp": 5, "line_length": 3}, body__shape="ship")
}


@pytest.fixture(scope="module", params=CASES)
def one(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    return folder, run(folder, CASES[request.param], "--threads", 1)


@pytest.mark.parametrize("ranks, threads", quick([(1, 3), (2, 1), (2, 2), (3, 2)], (2, 2)))
def test_rows_do_not_depend_on_ranks_and_threads(one, ranks, threads):
    folder, alone = one
    result = subprocess.run([*launcher(ranks), VALIDATE, "run", "case.yml", "-o", f"out{ranks}x{threads}", "--threads",
                             str(threads)], cwd=folder, env=environment(), capture_output=True, text=True, timeout=100)
    assert result.returncode == DONE, result.stderr
    many = Run(folder / f"out{ranks}x{threads}", result)
    assert differing(alone.dir / "result.h5", many.dir / "result.h5") == []
    with h5py.File(many.dir / "result.h5") as f:
        assert len(f["impacts/time"]) > 5 and f["panels/force"].shape[0] == 100
    assert many.summary["impacts"] == alone.summary["impacts"]


@pytest.mark.slow
def test_counted_over_the_window_that_is_found(tmp_path):
    """On two ranks, and after stops before the window begins and within it, on other ranks each time."""
    case = changed(TOW, tow={"mode": "line", "speed": 0.13, "ramp": 2, "line_length": 3, "hull_y": 0.4},
                   body={"shape": "square", "length": 1.6, "y": 0.5, "x": 3}, run__duration=60, output={"panels": True},
                   impact__panels=24)
    alone = run(tmp_path, case, "--threads", 1)
    start = assert_counted_over_the_window(alone)
    assert 5 < start < 31
    done(2, "run", "case.yml", "-o", "two", "--quiet", "--threads", 1, cwd=tmp_path)
    assert_same_result(alone.dir, tmp_path / "two")
    done(2, "run", "case.yml", "-o", "cut", "--quiet", "--threads", 1, "--steps", int(10 * start) - 20, cwd=tmp_path)
    done(1, "resume", "cut", "--quiet", "--threads", 1, "--steps", 120, cwd=tmp_path)
    done(2, "resume", "cut", "--quiet", "--threads", 1, cwd=tmp_path)
    assert_counted_over_the_window(Run(tmp_path / "cut", None))
    assert_same_result(alone.dir, tmp_path / "cut")


def test_the_collision_under_way_at_the_end(tmp_path):
    """In the last sample of any ranks, also after a stop just before, and after one that ended all steps but not the
    run."""
    alone = run(tmp_path, quay(*QUAY_CUTS[1], run__duration=2.1), "--threads", 1)
    assert alone.series("collisions")[-1] == 1
    done(2, "run", "case.yml", "-o", "two", "--quiet", "--threads", 1, cwd=tmp_path)
    assert_same_result(alone.dir, tmp_path / "two")
    done(1, "run", "case.yml", "-o", "cut", "--quiet", "--threads", 1, "--steps", 20, cwd=tmp_path)
    done(2, "resume", "cut", "--quiet", "--threads", 1, cwd=tmp_path)
    assert_same_result(alone.dir, tmp_path / "cut")
    (tmp_path / "cut/summary.json").unlink()
    done(2, "resume", "cut", "--quiet", "--threads", 1, cwd=tmp_path)
    assert_same_result(alone.dir, tmp_path / "cut")


def test_a_quay_in_pieces(tmp_path):
    """One collision on any ranks, also when it is resumed; an earlier program had one under way for each piece."""
    case = quay(*QUAY_CUTS[1], run__duration=2.6)
    alone = run(tmp_path, case, "--threads", 1)
    done(2, "run", "case.yml", "-o", "two", "--quiet", "--threads", 1, cwd=tmp_path)
    assert_same_result(alone.dir, tmp_path / "two")
    for name in "cut", "earlier":
        done(1, "run", "case.yml", "-o", name, "--quiet", "--threads", 1, "--steps", 21, cwd=tmp_path)
    done(2, "resume", "cut", "--quiet", "--threads", 1, cwd=tmp_path)
    assert_same_result(alone.dir, tmp_path / "cut")
    with edited(tmp_path / "earlier/checkpoint.h5") as f:
        one = f["impacts/open"][:]
        assert len(one) == 1
        rows = one.repeat(len(QUAY_CUTS[1]), axis=0)
        column = {"floe": 1, "impulse": 5, "largest": 14}  # as bt_impact and bt_impact_open in loads/impact.h
        share = [0.35, 0.24, 0.13, 0.18, 0.1]
        rows[:, column["floe"]] = range(len(QUAY_CUTS[1]))
        rows[:, column["impulse"]] *= share
        rows[:, column["largest"]] = rows[:, column["impulse"]]
        del f["impacts/open"]
        f["impacts/open"] = rows
    done(2, "resume", "earlier", "--quiet", "--threads", 1, cwd=tmp_path)
    with h5py.File(tmp_path / "earlier/result.h5") as f, h5py.File(alone.dir / "result.h5") as g:
        assert len(f["impacts/time"]) == 1
        for key in "time", "impulse", "approach", "peak":
            assert f["impacts"][key][0] == pytest.approx(g["impacts"][key][0], rel=1e-12), key
