# SPDX-License-Identifier: MIT
"""What the tests of the Python package share: cases, and runs by the library."""
import os
import re
import shutil
import subprocess
import sys

import h5py
from harness import ROOT, TOW, changed

import bergtow

SHORT = changed(TOW, run__duration=6)
LINE = changed(SHORT, tow__mode="line", tow__line_length=3, tow__line_stiffness=2000, tow__speed=0.6, body__x=4)
WINDOW = {
    "run": {"dt": 0.1, "duration": 5},
    "domain": {"frame": "geographic", "length": 24, "width": 18, "ends": "moving", "sides": "periodic", "ahead": 14},
    "ice": {"concentration": 0.5, "size": 1.2, "thickness": 0.04, "friction": 0.3},
    "body": {"length": 2, "draft": 0.5}, "tow": {"speed": 0.8, "ramp": 1},
    "water": {"latitude": 75, "tide": {"major": 0.2, "minor": 0.05, "period": 12}}, "air": {"wind_x": 5},
    "output": {"frame_interval": 1},
}


def stepped(case, n=7, **more):
    """State hash after the whole case, n steps a call."""
    with bergtow.Simulation(case, threads=1, **more) as sim:
        while sim.steps_left:
            sim.step(n)
        return sim.state_hash


def datasets_of(path):
    with h5py.File(path) as f:
        return {name: values[()] for name, values in f["series"].items()}


def installed_by_pip(folder):
    """The bin folder of an environment with the package, made by the words of docs/library.md on a copy of the sources
    that is gone again; only the network is left out."""
    shutil.copytree(ROOT / "postproc", folder / "postproc", ignore=shutil.ignore_patterns("__pycache__"))
    words = re.search(r"```sh\n(/usr/bin/python3 -m venv .*?)```", (ROOT / "docs/library.md").read_text(), re.DOTALL)[1]
    env = os.environ | {"HOME": str(folder), "PIP_NO_BUILD_ISOLATION": "0", "PIP_NO_INDEX": "1", "PIP_QUIET": "1",
                        "PATH": f"{os.path.dirname(sys.executable)}:{os.environ['PATH']}"}
    done = subprocess.run(["sh", "-ec", words], cwd=folder, env=env, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    shutil.rmtree(folder / "postproc")
    return folder / "bergtow-python/bin"


def python(code, *, path=ROOT / "postproc", **env):
    """A Python of its own on a text."""
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                          env=os.environ | {"PYTHONPATH": str(path)} | env)
