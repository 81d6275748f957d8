# SPDX-License-Identifier: MIT
"""What the run-level tests share: writing a case, running it, reading what it leaves, and plain polygon geometry."""
import copy
import fcntl
import functools
import json
import os
import pathlib
import re
import shlex
import signal
import subprocess

import h5py
import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[1]
BERGTOW = os.path.abspath(os.environ.get("BERGTOW", ROOT / "build/release/bergtow"))
# Assertions, checks of the division among ranks, threads in every parallel loop, and sanitizers: make CONFIG=asan.
VALIDATE = os.path.abspath(os.environ.get("BERGTOW_VALIDATE", ROOT / "build/asan/bergtow"))
FAULT = pathlib.Path(BERGTOW).parent / "tests/fault/fault.so"  # tests/fault/fault.c
# How ranks are started; for a build with MPICH: MPIRUN=mpirun.mpich. Open MPI looks for the networks of clusters for
# 0.2 s of every start unless it is told which component passes the messages.
os.environ.setdefault("OMPI_MCA_pml", "ob1")
MPIRUN = shlex.split(os.environ.get("MPIRUN", "mpirun --oversubscribe"))
RANK = "${OMPI_COMM_WORLD_RANK:-$PMI_RANK}"  # in a shell that the launcher starts
DONE, USAGE, CASE, IO, NUMERIC, SIGNAL = 0, 2, 3, 4, 5, 6

# A tow through loose ice, some 140 floes, done in a fraction of a second; the 200 frames that a run has unless it says
# otherwise would take most of it.
TOW = {
    "run": {"dt": 0.1, "duration": 30},
    "domain": {"length": 15, "width": 8},
    "ice": {"concentration": 0.5, "size": 0.7, "thickness": 0.04, "friction": 0.3},
    "body": {"x": 3, "length": 2, "draft": 0.5},
    "tow": {"speed": 0.13, "ramp": 2},
    "output": {"frame_interval": 3},
}
# A square block drifts against a quay, flush with it.
QUAY = {
    "run": {"dt": 0.1, "duration": 3},
    "domain": {"length": 80, "width": 40, "ends": "open", "sides": "open"},
    "ice": {"concentration": 0, "thickness": 1, "size": 4, "start": "rest", "friction": 0},
    "body": {"shape": "square", "length": 4, "draft": 1, "x": 27, "y": 0, "vx": 0.5},
    "tow": {"mode": "none"},
    "output": {"window_start": 0.5},
}
QUAY_CUTS = [(9, -5.5), (2, 0), (9, 5.5)], [(9, -5.5), (0.8, -0.6), (0.4, 0), (0.8, 0.6), (9, 5.5)]
# Walls that close on dense ice: thousands of contacts at once, so that every loop that may run in parallel does.
PRESS = {
    "run": {"dt": 0.1, "duration": 2},
    "domain": {"length": 66, "width": 40, "ends_closing": 0.1, "sides_closing": 0.1},
    "ice": {"concentration": 0.85, "size": 0.9},
    "body": {"shape": "none"},
    "solver": {"max_sweeps": 60},
    "output": {"frame_interval": 0.5},
}
# Walls that close faster than the solver, cut short, can push the floes along.
CLOSING = {
    "run": {"dt": 0.1, "duration": 4},
    "domain": {"length": 8, "width": 6, "ends_closing": 0.9, "sides_closing": 0.6},
    "ice": {"concentration": 0.7, "size": 0.9},
    "body": {"shape": "none"},
    "solver": {"max_sweeps": 2, "position_sweeps": 0},
    "guard": {"overlap": 0, "no_solution": 0},
}


def without_make():
    """The environment for a make that is no part of the one that may have started the tests."""
    return {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}


def make(*arguments):
    """Builds targets, and returns what make says; one at a time, for tests run side by side in one tree."""
    (ROOT / "build").mkdir(exist_ok=True)
    with open(ROOT / "build/make.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = subprocess.run(["make", "--no-print-directory", *map(str, arguments)], cwd=ROOT, capture_output=True,
                              text=True, timeout=600, env=without_make())
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@functools.cache
def machine_keys():
    """Keys of summary.json, the outer ones, that are of the machine and the moment and not of the result: wall times,
    what they make, and what the division among ranks has cost."""
    listed = json.loads(subprocess.run([BERGTOW, "--list-quantities", "--json"], capture_output=True, text=True,
                                       check=True).stdout)
    return frozenset(k["name"].split(".")[0] for k in listed["summary"] if k["machine"])


def changed(base, /, **changes):
    """A copy of a case with changes "section.key" written as section__key; None removes the key."""
    case = copy.deepcopy(base)
    for name, value in changes.items():
        *path, key = name.split("__")
        section = case
        for part in path:
            section = section.setdefault(part, {})
        if value is None:
            section.pop(key, None)
        else:
            section[key] = value
    return case


def quick(parameters, *kept):
    """Parameters of a test, of which make test takes those that are kept; make test-long takes all."""
    parameters = list(parameters)
    assert all(k in parameters for k in kept), kept
    slow = [pytest.param(*(p if isinstance(p, tuple) else (p, )), marks=pytest.mark.slow) for p in parameters]
    return [p if p in kept else s for p, s in zip(parameters, slow)]


MADE = ("concentration", "shape", "sides", "aspect", "size", "size_law", "size_spread", "size_min", "size_max",
        "size_exponent", "thickness", "thickness_law", "thickness_spread", "shake", "x_min", "x_max", "y_min", "y_max",
        "extent")


def reading(base, field):
    """A copy of a case that reads its ice from a field file, without the keys that this leaves without effect."""
    return changed(base, ice__field=str(field), **{f"ice__{key}": None for key in MADE})


def quay(*pieces, **changes):
    """The quay in pieces (width, y)."""
    return changed(QUAY, **changes, floes=[{"shape": "rectangle", "length": 4, "width": width, "x": 32, "y": y,
                                            "fixed": True} for width, y in pieces])


def write_case(folder, case, name="case.yml"):
    """JSON is YAML, and its numbers read back to the same bits."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text(json.dumps(case, indent=1))
    return path


def environment(**extra):
    """The caller's, without what would tell the program how many threads or ranks to use.

    Threads wait passively: on a machine that is busy with something else, threads that spin at a barrier take the very
    core that the thread they wait for would need (20 times slower, seen with two threads on two cores). With its
    settings given the program needs no second start (main.c).
    """
    theirs = "OMPI_", "PMIX_", "PMI_", "SLURM_", "BERGTOW_MPI", "OMP_"
    kept = {k: v for k, v in os.environ.items() if not k.startswith(theirs)}
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}  # as which containers run tests
    # What Open MPI takes within one machine; to open UCX and others and leave them costs 0.2 s a start.
    settings = {"OMP_WAIT_POLICY": "passive", "BERGTOW_STARTED": "1", "OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "^tcp",
                "BERGTOW_DIVIDE": "always"}
    leaks = {"ASAN_OPTIONS": "detect_leaks=0"}  # those of Open MPI; judge.py and sanitize.sh look for ours
    return leaks | kept | settings | root | {k: str(v) for k, v in extra.items()}


def launcher(ranks, *options):
    """What stands before a program that is started on ranks."""
    return [*MPIRUN, "-n", str(ranks), *options]


def rank_of(variables):
    """The rank of a process by its environment, None without a launcher."""
    rank = variables.get("OMPI_COMM_WORLD_RANK", variables.get("PMI_RANK"))
    return None if rank is None else int(rank)


def heard():
    """In a child before its program: signals that a suite in the background or under nohup ignores end it as they do
    in a terminal."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def call(*arguments, cwd=None, env=None, timeout=120, **more):
    return subprocess.run([BERGTOW, *map(str, arguments)], cwd=cwd, env=env or environment(OMP_NUM_THREADS=1),
                          capture_output=True, text=True, timeout=timeout, **more)


def script(name, *words, cwd=None, env=None, timeout=300, drawn=True):
    """python3 -m bergtow NAME, or a script of Python by its path; it starts the program that is tested. Pages that are
    not drawn say why in place of each picture, and cost a third."""
    import script_copy  # not before: it loads what most tests need nothing of
    env = (env or environment()) | {"BERGTOW": BERGTOW}
    return script_copy.called([str(name), *map(str, words)], cwd, env, timeout, drawn)


def faulty(**what):
    """The environment of a program whose calls of the system fail as BT_FAULT says (tests/fault/fault.c)."""
    assert FAULT.exists(), "make tests builds it"
    return environment(OMP_NUM_THREADS=1, LD_PRELOAD=FAULT, **what)


def texts(notes):
    """The texts of warnings or reasons, [{"code", "text", "values"}]."""
    return [note["text"] for note in notes]


def reasons(summary):
    """All reasons of a verdict in one text."""
    return "; ".join(texts(summary["window"]["reasons"]))


class Run:
    """The folder a run has left, and what the call printed."""

    def __init__(self, folder, result):
        self.dir, self.result = folder, result
        summary = folder / "summary.json"
        self.summary = json.loads(summary.read_text()) if summary.exists() else None

    @property
    def hash(self):
        return self.summary["state_hash"]

    @property
    def warnings(self):
        return texts(self.summary["warnings"])

    @property
    def reason(self):
        return reasons(self.summary)

    def series(self, *names):
        with h5py.File(self.dir / "result.h5") as f:
            values = [f["series"][n][:] for n in names]
        return values[0] if len(values) == 1 else values

    def dataset(self, name):
        with h5py.File(self.dir / "result.h5") as f:
            return f[name][()]


def run(folder, case, *arguments, code=DONE, name="out", env=None, **more):
    """Run a case (a dictionary, or the path of a file) in a folder of its own; the exit code must be as said."""
    path = case if isinstance(case, pathlib.Path) else write_case(folder, case)
    result = call("run", path, "-o", folder / name, *arguments, env=env, **more)
    assert result.returncode == code, f"exit code {result.returncode}, wanted {code}:\n{result.stdout}\n{result.stderr}"
    return Run(folder / name, result)


def warned(r, pattern):
    return [w for w in r.warnings if re.search(pattern, w)]


def datasets(path):
    """Every dataset of an HDF5 file as name -> (type, shape, bytes)."""
    found = {}

    def take(name, item):
        if isinstance(item, h5py.Dataset):
            value = item[()]
            raw = value.tobytes() if isinstance(value,
                                                (np.ndarray,
                                                 np.generic)) and item.dtype.kind != "O" else repr(value).encode()
            found["/" + name] = (str(item.dtype), item.shape, raw)

    with h5py.File(path) as f:
        f.visititems(take)
    return found


def differing(a, b, but=()):
    """Names of the datasets, but for those named, that are not the same to the bit in both files."""
    x, y = datasets(a), datasets(b)
    assert len(x) > 1, f"{a} holds next to nothing: {sorted(x)}"
    return sorted(n for n in x.keys() | y.keys() if x.get(n) != y.get(n) and n not in but)


# ---- polygons, independent of the program ----

def area(polygon):
    x, y = polygon[:, 0], polygon[:, 1]
    return 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)


def placed(vertices, pose):
    """Vertices [n, 2] of the body frame at pose (x, y, yaw)."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return vertices @ np.array([[c, s], [-s, c]]) + pose[:2]


def overlap(p, q):
    """Depth to which two convex anticlockwise polygons overlap along the best separating axis; negative: a gap."""
    depth = np.inf
    for one, other in ((p, q), (q, p)):
        edge = np.roll(one, -1, axis=0) - one
        normal = np.column_stack([edge[:, 1], -edge[:, 0]]) / np.hypot(edge[:, 0], edge[:, 1])[:, None]
        gap = np.min(normal @ other.T, axis=1) - np.sum(normal * one, axis=1)
        depth = min(depth, -np.max(gap))
    return depth


def worst_overlap(polygons):
    """Deepest overlap of any two of the polygons; pairs whose boxes are apart are left out."""
    low = np.array([p.min(axis=0) for p in polygons])
    high = np.array([p.max(axis=0) for p in polygons])
    worst = -np.inf
    for i in range(len(polygons)):
        near = np.all((low[i + 1:] <= high[i]) & (high[i + 1:] >= low[i]), axis=1)
        for j in np.nonzero(near)[0] + i + 1:
            worst = max(worst, overlap(polygons[i], polygons[j]))
    return worst
