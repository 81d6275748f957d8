# SPDX-License-Identifier: MIT
"""`make bench`: a small benchmark runs to its end, and its tables hold what the README of cases/scaling says."""
import csv
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from harness import BERGTOW

SCALING = Path(__file__).resolve().parents[2] / "cases" / "scaling"
TRIAD = Path(BERGTOW).resolve().parent / "triad"
sys.path.insert(0, str(SCALING))
import bench  # noqa: E402


def start(*args):
    return subprocess.run(["/usr/bin/python3", str(SCALING / "bench.py"), "--bergtow", str(BERGTOW), "--triad",
                           str(TRIAD), *map(str, args)], capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    out = tmp_path_factory.mktemp("bench")
    done = start("--sizes", "300", "--steps", 3, "--repeats", 1, "--triad-mib", 4, "--out", out)
    assert done.returncode == 0, done.stderr
    with open(out / "bench.csv", newline="") as f:
        rows = list(csv.DictReader(f))
    return out, rows


@pytest.mark.slow
def test_every_scene_size_and_configuration_has_a_row(small):
    out, rows = small
    machine = (out / "machine.txt").read_text()
    cores = len(os.sched_getaffinity(0))
    ranks = "\nranks: measured\n" in machine
    # ranks may be missing for these reasons only
    assert ranks or cores < 2 or "this version runs on one" in machine, machine
    configs = bench.configurations(cores, ranks)
    found = [(r["scene"], int(r["asked"]), int(r["ranks"]), int(r["threads"])) for r in rows]
    assert found == [(s, n, *c) for n in (300, ) for s in bench.STEPS for c in configs]
    assert set(bench.COLUMNS) - set(rows[0]) == {bench.PHASE_SHARE} and "detect_share" in rows[0]


@pytest.mark.slow
def test_rows_are_the_runs(small):
    out, rows = small
    for r in rows:
        asked, floes, wall = int(r["asked"]), int(r["floes"]), float(r["wall_s"])
        assert abs(floes - asked) < 0.1 * asked and int(r["steps"]) == 3 and int(r["runs"]) == 1
        assert float(r["ns_per_floe_step"]) == pytest.approx(1e9 * wall / 3 / floes, rel=1e-4)
        shares = [float(r[name]) for name in r if name.endswith("_share") and name != "halo_share"]
        assert 0 < sum(shares) <= 1.001 and float(r["solve_share"]) > 0
        assert float(r["triad_gb_s"]) > 0.1
        assert (float(r["round_trip_ns"]) > 10) if int(r["ranks"]) * int(r["threads"]) > 1 else r["round_trip_ns"] == ""
        if int(r["ranks"]) == 1:
            assert 300 < float(r["bytes_per_floe"]) < 1e6
    hashes = {(r["scene"], r["asked"]): r["state_hash"] for r in rows}
    assert len(set(hashes.values())) == len(hashes) == 4
    assert all(r["state_hash"] == hashes[r["scene"], r["asked"]] for r in rows)


@pytest.mark.slow
def test_picture_and_machine(small):
    out, _ = small
    assert (out / "bench.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" and (out / "bench.png").stat().st_size > 40000
    machine = (out / "machine.txt").read_text()
    # of a virtual machine lscpu may know no caches
    caches = ["L3 cache: .+"] if "L3 cache" in subprocess.run(["lscpu"], capture_output=True, text=True).stdout else []
    for line in (*caches, "Model name: .+", "bergtow compiler: .+", "bergtow flags: -O", "bergtow revision: .+",
                 r"load average before: \d", r"triad, 1 thread: median \d"):
        assert re.search("^" + line.replace(": ", r":\s*"), machine, re.M), (line, machine)


@pytest.mark.slow
def test_fields_are_made_once_and_keys_reach_the_run(small):
    out, rows = small
    before = {p: p.stat().st_mtime_ns for p in (out / "fields").iterdir()}
    assert len(before) == 4
    done = start("--sizes", 300, "--scenes", "tow-95", "--steps", 2, "--repeats", 1, "--cores", 1, "--triad-mib", 4,
                 "--out", out, "--set", "solver.plain=true", "--set", "solver.max_sweeps=5", "--set",
                 "solver.tolerance=1e-9")
    assert done.returncode == 0, done.stderr
    with open(out / "bench.csv", newline="") as f:
        (row,) = csv.DictReader(f)
    assert row["mean_sweeps"] == "5" and row["unconverged"] == "2"  # a key set for the runs leaves the field alone
    assert {p: p.stat().st_mtime_ns for p in (out / "fields").iterdir()} == before


def made_up(n, ranks, threads, wall, sweep_bytes=None, **other):
    """A record of 10 steps with 1000 contacts in 4 sweeps each, half of the time in the phase solve."""
    phases = {"detect": 0.0, "solve": wall / 2, "output": 0.1}
    s = {
        "n_floes": n, "ranks": ranks, "threads": threads, "n_steps": 10, "dt_s": 1, "wall_time_s": wall,
        "ns_per_floe_step": 1e9 * wall / n / 10, "phases_s": phases, "mean_sweeps": 4, "contacts_mean": 1000,
        "unconverged_steps": 0, "state_hash": "0", **other
    }
    if sweep_bytes:
        s["sweep_bytes_per_contact"] = sweep_bytes
    return bench.record("tow-80", n, s, 10 * 1000 * 4, None)


def test_figures_of_known_runs():
    records = [made_up(1000, 1, 1, w)
               for w in (2.0, 1.0, 9.0)] + [made_up(1000, 1, 2, 1.25)] + [made_up(2000, 1, 1, 5.0)]
    records += [made_up(2000, 2, 1, 2.5, sweep_bytes=100, edge_cut=7, memory_per_floe_b=900)]
    one, two, large, ranks = bench.tables(records, {1: [10.0], 2: [30.0, 10.0, 16.0]})
    assert (one["runs"], one["wall_s"], one["wall_min_s"], one["wall_max_s"]) == (3, 2.0, 1.0, 9.0)
    assert (one["speedup"], one["efficiency"], one["weak_efficiency"]) == (1, 1, None)
    assert (two["speedup"], two["efficiency"], two["weak_efficiency"]) == (1.6, 0.8, None)
    assert (one["step_speedup"], two["step_speedup"], ranks["step_speedup"]) == (1, 1.6, 2)  # without output
    assert (large["speedup"], large["weak_efficiency"]) == (1, None)
    # 2,000 floes on two cores in 2.5 s against 1,000 on one in 2 s
    assert (ranks["speedup"], ranks["efficiency"], ranks["weak_efficiency"]) == (2, 1, pytest.approx(0.8))
    assert one["contact_sweeps_per_s"] == pytest.approx(4e4) and ranks["weak_solve_efficiency"] == pytest.approx(
        3.2e4 / (2 * 4e4))
    assert (ranks["edge_cut"], ranks["bytes_per_floe"], one["edge_cut"], one["sweep_gb_s"]) == (7, 900, None, None)
    assert ranks["sweep_gb_s"] == pytest.approx(3.2e-3) and ranks["sweep_of_triad"] == pytest.approx(3.2e-3 / 16)
    assert one["solve_share"] == 0.5 and one["state_hash"] == "0"


def test_states_that_differ_are_found():
    records = [made_up(1000, 1, 1, 1.0), made_up(1000, 1, 2, 1.0), made_up(2000, 1, 1, 1.0, state_hash="1")]
    assert bench.differing(records) == []
    records.append(made_up(1000, 1, 2, 1.0, state_hash="1"))
    assert bench.differing(records) == [("tow-80", 1000)]


def test_every_column_is_explained():
    text = (SCALING / "README.md").read_text()
    assert [name for name in bench.COLUMNS if f"`{name}`" not in text] == []


@pytest.mark.parametrize("args, words", [(["--scenes", "tow-81"], "no such scene; there are tow-80"),
                                         (["--sizes", "300;600"], "whole numbers"), (["--sizes", "20"], "at least 300"),
                                         (["--set", "run.dt"], "KEY=VALUE"),
                                         (["--triad", "/nowhere"], "is missing; run `make bench`")])
def test_wrong_use(args, words, tmp_path):
    done = start("--out", tmp_path, *args)
    assert done.returncode == 2 and words in done.stderr
