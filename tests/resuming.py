# SPDX-License-Identifier: MIT
"""What the tests of checkpoints share: killing a run at a moment, taking it up, and holding two results against each
other."""
import os
import signal
import subprocess
import time

import h5py
import numpy as np

from harness import BERGTOW, DONE, Run, changed, differing, environment, launcher, machine_keys, write_case

# A bridle whose second branch breaks, way-points, collisions, panel loads, samples of three steps, floes that go from
# rank to rank. Checkpoints so often that most kills fall into the writing of one.
CASE = {
    "run": {"dt": 0.1, "duration": 22},
    "domain": {"length": 30, "width": 12},
    "ice": {"concentration": 0.7, "size": 1, "x_max": 25},
    "body": {"x": 27, "length": 2},
    "tow": {
        "mode": "thrust", "programme": [[0, 0], [2, 0.5], [22, 0.5]], "waypoints": [[20, 0], [14, 2],
                                                                                    [-60, 2]], "turn_radius": 2,
        "line_length": 3, "line_stiffness": 2000, "line": {"branches": 2,
                                                           "breaking_load": 0}, "branch2": {"breaking_load": 120},
        "vessel": {"mass": 800, "bollard_pull": 600, "free_speed": 3, "lookahead": 3}
    },
    "solver": {"cell_size": 2.5, "max_sweeps": 40},
    "output": {"sample_every": 3, "frame_interval": 0.7, "panels": True, "checkpoint_steps": 8},
}


def command(ranks, *arguments):
    return [*(launcher(ranks) if ranks > 1 else []), BERGTOW, *map(str, arguments)]


def started(ranks, *arguments, cwd=None, stderr=subprocess.PIPE):
    """In a process group of its own, so that all of it can be killed at once."""
    return subprocess.Popen(command(ranks, *arguments), cwd=cwd, env=environment(OMP_NUM_THREADS=1),
                            stdout=subprocess.PIPE, stderr=stderr, text=True, start_new_session=True)


def done(ranks, *arguments, cwd=None, code=DONE, timeout=300):
    p = started(ranks, *arguments, cwd=cwd)
    out, err = p.communicate(timeout=timeout)
    assert p.returncode == code, f"exit code {p.returncode}, wanted {code}:\n{out}\n{err}"
    return out, err


def children(pid):
    """All processes below one: mpirun gives each rank a group of its own."""
    parent = {}
    for name in os.listdir("/proc"):
        if name.isdigit():
            try:
                with open(f"/proc/{name}/stat") as f:
                    parent[int(name)] = int(f.read().rsplit(")", 1)[1].split()[1])
            except OSError:
                continue
    below, found = {pid}, {pid}
    while below:
        below = {p for p, q in parent.items() if q in below} - found
        found |= below
    return found


def killed_after(seconds, ranks, *arguments, cwd=None):
    """Kill -9 to launcher and ranks after some time; True when there was still something to kill."""
    p = started(ranks, *arguments, cwd=cwd)
    end = time.monotonic() + seconds
    while p.poll() is None and time.monotonic() < end:
        time.sleep(0.002)
    alive = p.poll() is None
    if alive:
        os.kill(p.pid, signal.SIGSTOP) # no rank must be started after the look for them
        for process in children(p.pid):
            try:
                os.kill(process, signal.SIGKILL)
            except ProcessLookupError:
                pass
    out, err = p.communicate(timeout=60)
    assert alive or p.returncode == DONE, (p.returncode, out, err)
    return alive


def check_readable(folder):
    """Whatever stands under its final name is whole: series of one length, no frame cut."""
    if (folder / "result.h5").exists():
        with h5py.File(folder / "result.h5") as f:
            n = len(f["frames/time"])
            assert len({len(v) for v in f["series"].values()}) == 1
            assert f["frames/pose"].shape[0] == n == sum(name.isdigit() for name in f["xdmf"])
            assert np.isfinite(f["frames/pose"][:]).all()


def assert_same_result(one, other):
    """State, series, frames, events, collisions, panels, descriptions and summary; not the wall times."""
    a, b = Run(one, None), Run(other, None)
    assert b.summary is not None and a.hash == b.hash
    different = differing(one / "result.h5", other / "result.h5")
    assert different == [], different
    assert a.summary.keys() == b.summary.keys()
    for key in a.summary.keys() - machine_keys():
        assert a.summary[key] == b.summary[key], key
    for name in "case.resolved.yml", "frames.xdmf":
        assert (one / name).read_text() == (other / name).read_text(), name
    out, _ = done(1, "diff", one, other)
    assert "the same" in out


def uninterrupted(folder, case=CASE, name="whole"):
    """The run that is never stopped, without a checkpoint on the way, and the seconds it takes."""
    write_case(folder, changed(case, output__checkpoint_steps=0, output__checkpoint_wall=0), "whole.yml")
    began = time.monotonic()
    done(1, "run", "whole.yml", "-o", name, "--quiet", "--threads", 1, cwd=folder)
    seconds = time.monotonic() - began
    # The two keys stand in the resolved case; the comparison is of everything else.
    write_case(folder, case)
    done(1, "run", "case.yml", "-o", f"{name}-often", "--quiet", "--threads", 1, cwd=folder)
    assert Run(folder / name, None).hash == Run(folder / f"{name}-often", None).hash
    assert set(differing(folder / name / "result.h5",
                         folder / f"{name}-often" / "result.h5")) <= {"/case", "/case_as_given"}
    return folder / f"{name}-often", seconds
