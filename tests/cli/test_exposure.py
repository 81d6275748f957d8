# SPDX-License-Identifier: MIT
"""A pack in which floes stand in each other's lee begins with the drift that it keeps, and the key switches it off.

What turns these tests red: a start, or undisturbed ice, with the drag of lone floes; another weight of the floes' mean.
"""
import h5py
import numpy as np
import pytest

from harness import changed, run

PACK = {
    "run": {"dt": 2, "duration": 600},
    "domain": {"frame": "geographic", "length": 1000, "width": 800, "ends": "periodic", "sides": "periodic"},
    "ice": {"concentration": 0.9, "size": 30, "thickness": 1, "friction": 0.2},
    "body": {"shape": "none"},
    "air": {"wind_x": 12, "wind_y": 4},
    "output": {"frame_interval": 60},
}
CASES = {"wind": PACK,
         "current": changed(PACK, water={"current_x": 0.2, "current_y": -0.1, "latitude": 75, "tilt": "geostrophic"})}


def drift(r):
    """Mean velocity of the ice in each frame, by area."""
    with h5py.File(r.dir / "result.h5") as f:
        v = f["frames/velocity"][:]
    return v.mean(axis=1)


@pytest.mark.parametrize("name", CASES)
def test_a_pack_keeps_its_drift(tmp_path, name):
    r = run(tmp_path, CASES[name], "--threads", 1, "--quiet")
    v = drift(r)
    away = np.linalg.norm(v - v[0], axis=1) / np.linalg.norm(v[0])
    assert away[1] < 0.005 and away.max() < 0.02


def test_without_lee_it_is_slower(tmp_path):
    lee, lone = (drift(run(tmp_path, changed(PACK, run__duration=2, ice__drag={"sheltering": s}), "--quiet", name=n))[0]
                 for n, s in (("lee", 5.556), ("lone", 0)))
    assert 1.2 < np.linalg.norm(lee) / np.linalg.norm(lone) < 1.5


def test_undisturbed_ice_goes_with_the_pack(tmp_path):
    """Speed through the ice of a body that next to nothing moves is the drift of the pack, and stays so."""
    case = changed(PACK, run__duration=120, body={"length": 40, "draft": 20}, tow={"mode": "speed", "speed": 0.001})
    r = run(tmp_path, case, "--quiet")
    through, ice = r.series("speed_through_ice"), drift(r)[0][0]
    assert abs(through + ice).max() < 0.02 * ice
