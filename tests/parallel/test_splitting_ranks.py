# SPDX-License-Identifier: MIT
"""Floes that split: the same splits, pieces and bits on any ranks and threads, and after a kill between two splits."""
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest

from harness import BERGTOW, ROOT, TOW, call, changed, differing, environment, launcher, quick, run, write_case

CASE = changed(TOW, run__duration=6, ice__concentration=0.8, ice__size=0.9, ice__crushing={"pressure": 1e5},
               ice__splitting={"toughness": 100.0, "strength": 200.0, "least_size": 0.1},
               output__checkpoint_steps=20,
               floes=[{"shape": "rectangle", "length": 0.9, "width": 0.5, "x": 14, "y": -3.5, "thickness": 0.04}])


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    r = run(tmp_path_factory.mktemp("one"), CASE, "--threads", 1)
    assert r.summary["splitting"]["splits"] > 5 and r.summary["splitting"]["steps"] > 2
    return r


@pytest.mark.parametrize("ranks, threads", quick([(1, 4), (2, 1), (2, 4), (4, 1), (4, 4)], (2, 1)))
def test_ranks_and_threads_split_alike(one, tmp_path, ranks, threads):
    path = write_case(tmp_path, CASE)
    words = "run", str(path), "-o", str(tmp_path / "out"), "--threads", str(threads)
    subprocess.run([*launcher(ranks), BERGTOW, *words],
                   env=environment(OMP_NUM_THREADS=threads), capture_output=True, check=True, timeout=240)
    assert differing(one.dir / "result.h5", tmp_path / "out" / "result.h5") == []
    assert (tmp_path / "out" / "summary.json").read_text().count(one.summary["state_hash"]) == 1


def test_ranks_break_floes_at_the_same_necks(tmp_path):
    """Of two lobes each, pressed by walls."""
    at = np.arange(24) * np.pi / 12
    floes = []
    for k in range(36):
        out = 12 * (0.62 + 0.33 * np.cos(2 * at + k))
        floes.append({"shape": "polygon", "vertices": np.transpose([out * np.cos(at), out * np.sin(at)]).tolist(),
                      "x": 13.0 + 25 * (k // 6), "y": -62.5 + 25 * (k % 6)})
    path = write_case(tmp_path, {
        "run": {"dt": 0.2, "duration": 50}, "body": {"shape": "none"}, "output": {"frame_interval": 10}, "floes": floes,
        "domain": {"length": 151, "width": 151, "ends": "wall", "sides": "wall", "ends_closing": 0.3,
                   "sides_closing": 0.3},
        "ice": {"concentration": 0, "thickness": 1, "size": 20, "splitting": {"toughness": 150e3}}})
    for ranks in (1, 3):
        words = "run", str(path), "-o", str(tmp_path / str(ranks)), "--threads", "1"
        subprocess.run([*launcher(ranks), BERGTOW, *words], env=environment(OMP_NUM_THREADS=1), capture_output=True,
                       check=True, timeout=240)
    assert differing(tmp_path / "1" / "result.h5", tmp_path / "3" / "result.h5") == []
    with h5py.File(tmp_path / "1" / "result.h5") as f:
        crack = f["splits/crack"][()]
    length = np.hypot(crack[:, 2] - crack[:, 0], crack[:, 3] - crack[:, 1])
    assert (length < 7.5).sum() > 3  # a neck is 7.0 m wide, half of one 3.5 m


def test_a_run_that_stopped_between_splits_goes_on(one, tmp_path):
    with h5py.File(one.dir / "result.h5") as f:
        times = np.unique(f["splits/time"][()])
    middle = int(round(times[len(times) // 2] / CASE["run"]["dt"]))  # the step of a split; the next ones are to come
    r = run(tmp_path, CASE, "--steps", middle, "--threads", 1)
    done = call("resume", r.dir)
    assert done.returncode == 0, done.stderr
    assert differing(one.dir / "result.h5", r.dir / "result.h5") == []


def test_pieces_of_floes_in_parts_take_over_one_record_a_pair(tmp_path):
    """Both parts of a floe have crushed the same neighbour when it splits: no checkpoint of such a run was read."""
    words = "--set", "ice.crushing.pressure=100kPa", "--set", "ice.splitting.toughness=50e3", "--threads", "1", "-q"
    case, out = ROOT / "cases/outlines/outlines.yml", tmp_path / "out"
    assert call("run", case, "-o", out, *words, "--steps", 200).returncode == 0
    with h5py.File(out / "checkpoint.h5") as f:
        contacts = f["contacts"]
        names = list(zip(contacts["a"], contacts["b"], map(tuple, contacts["part"][()]), contacts["law"]))
    assert names == sorted(set(names))
    done = call("resume", out, "--steps", 1)
    assert done.returncode == 0, done.stderr


def test_a_kill_within_a_cascade_loses_nothing(one, tmp_path):
    """Of a run on four threads, which goes on, on four ranks, from a checkpoint that some splits are in."""
    with h5py.File(one.dir / "result.h5") as f:
        times = f["splits/time"][()]
        middle = int(round(np.median(times) / CASE["run"]["dt"]))
    path, out = write_case(tmp_path, changed(CASE, output__checkpoint_steps=middle)), tmp_path / "out"
    process = subprocess.Popen([BERGTOW, "run", str(path), "-o", str(out), "--threads", "4"],
                               env=environment(OMP_NUM_THREADS=4), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    end = time.monotonic() + 60
    while not (out / "checkpoint.h5").exists() and process.poll() is None and time.monotonic() < end:
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    with h5py.File(out / "checkpoint.h5") as f:
        assert len(times) / 4 < len(f["splits/parent"]) < len(times)
    subprocess.run([*launcher(4), BERGTOW, "resume", str(out), "--threads", "1"],
                   env=environment(OMP_NUM_THREADS=1), capture_output=True, check=True, timeout=240)
    assert differing(one.dir / "result.h5", out / "result.h5", but=("/case", "/case_as_given")) == []
