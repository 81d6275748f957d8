# SPDX-License-Identifier: MIT
"""20,000 steps through 30,000 floes on two ranks, with checkpoints and rebalancing: memory, residual and time a step
stay what they were.

A berg on a line in a moving window, so that it always meets fresh ice and the work of a step is stationary: what grows
is a fault.
"""
import ctypes
import os
import time
from contextlib import contextmanager

import numpy as np

from harness import Run, write_case
from resuming import children, started

FLOES, STEPS = 30000, 20000
CASE = {
    "run": {"dt": 1, "duration": STEPS},
    "domain": {"frame": "geographic", "length": 9000, "width": 4500, "ends": "moving", "sides": "periodic"},
    "ice": {"concentration": 0.6, "size": 31, "thickness": 0.5, "thickness_law": "lognormal"},
    "body": {"length": 80, "draft": 30},
    "tow": {
        "mode": "line", "speed": 0.8, "ramp": 600, "line_length": 200, "line_damping": 100,
        "line": {"type": "dyneema", "diameter": "150 mm"}
    },
    "output": {
        "sample_every": 10, "frame_interval": 2000, "checkpoint_steps": 1000, "checkpoint_wall": 0, "progress": "1 s"
    },
}
WARM_UP = 0.1  # of the steps: first checkpoints, room of lists
# Of the memory of a rank over the second half; the summary keeps 64 bytes of each step, 0.6 to 1 % here. Before that it
# grows with the largest of the messages that carry floes to their new ranks: the C library keeps what they free (last
# at step 7,654, 62 to 67 MB).
MAX_GROWTH = 0.03
# Of the time a step: other work on the machine changes it by half and comes and goes. What is sought grows with the
# steps: a list that is searched each step and gets longer each step would make the last quarter several times the
# first.
MAX_DRIFT = 1.6


@contextmanager
def small_pages():
    """Processes started here, and theirs, get no huge pages: one of them, 2 MB, is 3 % of the memory of a rank, and
    comes with the first byte of it."""
    disable_thp, libc = 41, ctypes.CDLL(None)
    assert libc.prctl(disable_thp, 1, 0, 0, 0) == 0
    try:
        yield
    finally:
        libc.prctl(disable_thp, 0, 0, 0, 0)


def ranks_of(launcher):
    """Process ids of the program below mpirun."""
    found = []
    for pid in children(launcher) - {launcher}:
        try:
            if os.path.basename(os.readlink(f"/proc/{pid}/exe")) == "bergtow":
                found.append(pid)
        except OSError:
            continue
    return sorted(found)


def resident(pid):
    with open(f"/proc/{pid}/statm") as f:
        return int(f.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def processor_time(pid):
    """Seconds of a processor: stands still when the process is stopped."""
    with open(f"/proc/{pid}/stat") as f:
        fields = f.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def watch(process, log):
    """Rows of step, processor time of all ranks and resident memory of each, at each line of progress."""
    rows, seen, pids = [], 0, []
    while process.poll() is None:
        time.sleep(0.5)
        lines = log.read_text().splitlines()
        if len(lines) == seen:
            continue
        seen = len(lines)
        pids = pids or ranks_of(process.pid)
        if "t = " not in lines[-1]:
            continue
        try:
            step = float(lines[-1].split("t = ")[1].split()[0]) / CASE["run"]["dt"]
            rows.append([step, sum(map(processor_time, pids)), *map(resident, pids)])
        except OSError: # it has just ended
            break
    return np.array(rows)


def quarters(x):
    """Medians of the quarters of what comes after the warm-up."""
    return np.array([np.median(q) for q in np.array_split(x[int(WARM_UP * len(x)):], 4)])


def test_memory_residual_and_time_stay(tmp_path):
    write_case(tmp_path, CASE)
    log = tmp_path / "progress"
    began = time.monotonic()
    with log.open("w") as out:
        with small_pages():
            process = started(2, "run", "case.yml", "-o", "soak", "--threads", 1, cwd=tmp_path, stderr=out)
        rows = watch(process, log)
        process.communicate(timeout=600)
    assert process.returncode == 0, log.read_text()[-2000:]
    r = Run(tmp_path / "soak", None)
    s = r.summary
    assert s["n_steps"] == STEPS and s["n_floes"] >= FLOES and s["ranks"] == 2
    assert s["divisions"] > 1 and s["moved_floes"] > 0, "cells were never assigned anew"
    assert s["moving_window"]["renewed"] > 0.2 * FLOES, "the berg met no fresh ice"

    step, spent, memory = rows[:, 0], rows[:, 1], rows[:, 2:]
    assert len(rows) > 40 and memory.shape[1] == 2
    warm = memory[step > 0.5 * STEPS]
    growth = warm[-len(warm) // 10:].mean(axis=0) / warm[:len(warm) // 10].mean(axis=0) - 1
    seconds = quarters(np.diff(spent) / np.diff(step))
    contacts, sweeps, residual = (quarters(x) for x in r.series("contacts", "sweeps", "momentum_residual"))
    worst = r.series("momentum_residual").max()
    print(
        f"{s['n_floes']} floes, {STEPS} steps, {time.monotonic() - began:.0f} s; memory of the ranks "
        f"{warm.mean(axis=0) / 1e6} MB, growth {100 * growth} %"
    )
    print(
        f"processor time a step by quarters {1e3 * seconds} ms; contacts {contacts}, sweeps {sweeps}; momentum "
        f"residual {residual}, at most {worst:.2g}"
    )
    print(
        f"divisions {s['divisions']}, floes moved between ranks {s['moved_floes']}, renewed "
        f"{s['moving_window']['renewed']}"
    )
    assert (growth < MAX_GROWTH).all()
    # Rounding alone: sums of a thousand contacts, each to 1e-16 of what it exchanges.
    assert worst < 1e-10 and residual[-1] < 3 * residual.min() + 1e-15
    assert contacts.max() < 1.5 * contacts.min(), "the work is not stationary: the case tests nothing"
    assert seconds[-1] < MAX_DRIFT * seconds[:-1].min()
