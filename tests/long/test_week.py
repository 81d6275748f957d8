# SPDX-License-Identifier: MIT
"""A week of towing through 10,000 floes that raft, in a window that goes along, killed in every hour of it and taken up
again, beside a twin that nobody touches: the same bits at the end, and memory, time a step, balances and the ice about
the body stay what they were.

STEPS in the environment divides the week into more steps: 120,960 of 5 s by default (make test-long), 1,000,000 of
0.6 s for the soak. week.csv in the folder that SOAK names keeps the curves.
"""
import os
import random
import signal
import time
from pathlib import Path

import h5py
import numpy as np

from harness import Run, differing, machine_keys, write_case
from resuming import started

WEEK = 7 * 24 * 3600
STEPS = int(os.environ.get("STEPS", WEEK // 5))
DT, HOUR = WEEK / STEPS, STEPS // (7 * 24)
CASE = {
    "run": {"dt": DT, "duration": WEEK},
    "domain": {"frame": "geographic", "length": 5000, "width": 2500, "ends": "moving", "sides": "periodic"},
    "ice": {"concentration": 0.6, "size": 30, "thickness": 1, "friction": 0.35, "rafting": {"kappa": 5}},
    "body": {"length": 80, "draft": 60},
    "tow": {"mode": "speed", "speed": 0.5, "ramp": 1200},
    "water": {"latitude": 75},
    "solver": {"tolerance": 1e-2},
    "output": {
        "sample_every": 20, "frame_interval": 24 * 3600, "checkpoint_steps": HOUR // 2, "checkpoint_wall": 0,
        "progress": "1 s", "window_start": 3600
    },
}
# The summary keeps some 100 bytes of each step, and a resident set is a matter of the C library too.
BYTES_A_STEP = 200
ROUNDING = 1e-11   # of the momentum that a step exchanges: sums of some ten thousand contacts
MAX_DRIFT = 1.6   # of the time a step: as tests/long/test_soak.py has it


def at_step(log):
    """Steps that the last line of progress tells, and whether there is one."""
    lines = [line for line in log.read_text().splitlines() if "t = " in line]
    return float(lines[-1].split("t = ")[1].split()[0]) / DT if lines else 0.0


def status(pid):
    with open(f"/proc/{pid}/statm") as f:
        memory = int(f.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    with open(f"/proc/{pid}/stat") as f:
        fields = f.read().rsplit(")", 1)[1].split()
    return memory, (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Soak:
    """A run that is watched and, where it has hours to be killed in, killed."""

    def __init__(self, folder, name, kills):
        self.folder, self.name, self.kills = folder, name, kills
        self.log, self.rows, self.killed, self.spent = folder / f"{name}.log", [], 0, 0.0
        self.dice = random.Random(name)
        self.start("run", "case.yml", "-o", name)

    def start(self, *call):
        self.out = self.log.open("w")
        self.process = started(1, *call, "--threads", 1, cwd=self.folder, stderr=self.out)
        self.next = None

    def look(self):
        """False once it has ended well."""
        code = self.process.poll()
        if code == 0:
            return False
        if code == -signal.SIGKILL:
            self.killed += 1
            self.start("resume", self.name)
            return True
        assert code is None, f"{self.name} ended with {code}:\n{self.log.read_text()[-2000:]}"
        try:
            step, (memory, spent) = at_step(self.log), status(self.process.pid)
        except OSError:  # it has just ended
            return True
        if step and not self.kills and (not self.rows or step > self.rows[-1][0]):
            self.rows.append((step, spent, memory))
        if self.kills and step:
            self.next = self.next or step + HOUR * self.dice.uniform(0.6, 1.4)
            if self.next < step:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait()
        return True


def quarters(x):
    return np.array([np.median(q) for q in np.array_split(x[len(x) // 10:], 4)])


def test_a_week(tmp_path):
    folder = Path(os.environ.get("SOAK", tmp_path))
    folder.mkdir(parents=True, exist_ok=True)
    write_case(folder, CASE)
    began = time.monotonic()
    soaks = [Soak(folder, "alone", False), Soak(folder, "killed", True)]
    running = list(soaks)
    while running:
        time.sleep(0.5)
        running = [s for s in running if s.look()]
    step, spent, memory = np.array(soaks[0].rows).T
    np.savetxt(folder / "week.csv", soaks[0].rows, delimiter=",", header="step,processor_time_s,resident_bytes")
    alone, killed = (Run(folder / s.name, None) for s in soaks)
    a, b = alone.summary, killed.summary
    print(f"{a['n_floes']} floes, {STEPS} steps, {soaks[1].killed} kills, {time.monotonic() - began:.0f} s")
    assert soaks[1].killed > 0.5 * STEPS / HOUR
    assert a["n_steps"] == b["n_steps"] == STEPS and a["n_floes"] > 8000

    assert a["state_hash"] == b["state_hash"]
    assert not differing(folder / "alone/result.h5", folder / "killed/result.h5")
    assert {k for k in a if a[k] != b[k]} <= machine_keys() | {"title"}

    late = step > 0.3 * STEPS
    growth = np.polyfit(step[late], memory[late], 1)[0]
    seconds = quarters(np.diff(spent) / np.diff(step))
    with h5py.File(folder / "alone/result.h5") as f:
        s = {n: f["series"][n][:] for n in ("time", "momentum_residual", "kinetic_energy", "rafted_area", "overlap",
                                            "contacts", "sweeps", "ice_resistance", "window_waiting", "unconverged")}
    by_quarter = {n: quarters(s[n]) for n in s if n != "time"}
    print(f"memory {memory[late].mean() / 1e6:.1f} MB, {growth:.1f} bytes a step; processor time a step by quarters "
          f"{1e3 * seconds} ms")
    for name, values in by_quarter.items():
        print(f"  {name:18s} {values}, largest {s[name].max():.3g}")
    print(f"window {a['moving_window']['laps']:.1f} laps, {a['moving_window']['renewed']} renewed, "
          f"{a['moving_window']['missed']} missed; unconverged {a['unconverged_steps']}; floes outside "
          f"{a['floes_outside']}; rafted {a['rafted_share_of_ice']}")
    assert growth < BYTES_A_STEP
    assert seconds.max() < MAX_DRIFT * seconds.min()
    assert s["momentum_residual"].max() < ROUNDING
    assert np.allclose(np.diff(s["time"]), 20 * DT, rtol=1e-9) and len(s["time"]) == STEPS // 20
    for name in ("kinetic_energy", "contacts", "sweeps"):
        assert by_quarter[name].max() < 1.5 * by_quarter[name].min(), name
    assert a["floes_outside"] == 0 and a["moving_window"]["laps"] > 0.9 * 0.5 * WEEK / 5000
    assert a["positive_work_steps"] == 0
