# SPDX-License-Identifier: MIT
"""Files beyond 4 GB, and a field so large that the writing of its checkpoint takes long enough to strike at."""
import os
import signal
import time

import h5py
import numpy as np
import pytest

from harness import changed, reading, write_case
from resuming import assert_same_result, check_readable, children, done, started

FOUR = 1 << 32
# Loose ice that a current sets in motion: what takes the time is the output.
TILE, SIDE = 3600, 6 * 3600
LOOSE = {
    "run": {"dt": 1, "duration": 300},
    "domain": {"frame": "geographic", "x0": 0, "y0": 0, "length": SIDE, "width": SIDE, "ends": "wall",
               "sides": "periodic"},
    "ice": {"concentration": 0.5, "size": 30, "thickness": 1, "start": "rest"},
    "body": {"shape": "none"},
    "tow": {"mode": "none"},
    "water": {"current_x": 0.1, "current_y": 0.05},
    "output": {"frame_interval": 1, "checkpoint_steps": 0, "checkpoint_wall": 0, "window_start": 1},
}


@pytest.fixture(scope="module")
def field(tmp_path_factory):
    """Some 330,000 floes: those of one tile side by side, for a field so large takes minutes to make."""
    folder = tmp_path_factory.mktemp("field")
    write_case(folder, changed(LOOSE, domain__length=TILE, domain__width=TILE))
    done(1, "field", "case.yml", "-o", "tile.h5", cwd=folder)
    with h5py.File(folder / "tile.h5") as f, h5py.File(folder / "field.h5", "w") as out:
        tile = {k: f["floes"][k][:] for k in ("offsets", "vertices", "pose", "thickness")}
        places = [(TILE * i, TILE * j, 0) for i in range(SIDE // TILE) for j in range(SIDE // TILE)]
        floes = out.create_group("floes")
        floes["offsets"] = np.append(np.concatenate([tile["offsets"][:-1] + k * tile["offsets"][-1]
                                                     for k in range(len(places))]), len(places) * tile["offsets"][-1])
        floes["vertices"] = np.tile(tile["vertices"], (len(places), 1))
        floes["pose"] = np.concatenate([tile["pose"] + place for place in places])
        floes["thickness"] = np.tile(tile["thickness"], len(places))
        floes.attrs["ice_area"], floes.attrs["n_floes"] = SIDE**2, len(floes["pose"])
        floes.attrs["concentration"] = f["floes"].attrs["concentration"]
        assert len(floes["pose"]) > 300_000
    return folder / "field.h5"


def test_a_result_beyond_four_gigabytes(tmp_path, field):
    """Killed when more than that is written, taken up: as the run that was never stopped, which one rank
    has written and packed."""
    write_case(tmp_path, changed(reading(LOOSE, field), run__duration=200, output__checkpoint_steps=40))
    p = started(2, "run", "case.yml", "-o", "killed", "--quiet", "--threads", 1, cwd=tmp_path)
    part = tmp_path / "killed/result.h5.tmp"
    while p.poll() is None and not (part.exists() and part.stat().st_size > 1.02 * FOUR):
        time.sleep(0.05)
    assert p.poll() is None, p.communicate()
    for process in children(p.pid):
        os.kill(process, signal.SIGKILL)
    p.communicate()
    check_readable(tmp_path / "killed")
    done(2, "resume", "killed", "--quiet", "--threads", 1, cwd=tmp_path, timeout=3000)
    print(f"result.h5: {(tmp_path / 'killed/result.h5').stat().st_size / FOUR:.2f} of 4 GiB")
    assert (tmp_path / "killed/result.h5").stat().st_size > FOUR
    done(1, "run", "case.yml", "-o", "whole", "--quiet", "--threads", 2, cwd=tmp_path, timeout=3000)
    assert_same_result(tmp_path / "whole", tmp_path / "killed")


def ranks_of(launcher):
    """Its processes that are ours, in the order they were started."""
    found = []
    for pid in sorted(children(launcher)):
        try:
            with open(f"/proc/{pid}/comm") as f:
                if f.read().strip() == "bergtow":
                    found.append(pid)
        except OSError:
            continue
    return found


@pytest.mark.parametrize("rank", [0, 1])
def test_a_rank_dies_in_a_checkpoint_of_300000_floes(tmp_path, field, rank):
    """kill -9 to one of two ranks while the file is being written: the launcher ends the other, the checkpoint before
    it still stands, and the run that goes on from it ends as the one that was never stopped."""
    write_case(tmp_path, changed(reading(LOOSE, field), run__duration=12, output__frame_interval=12,
                                 output__checkpoint_steps=2))
    done(2, "run", "case.yml", "-o", "whole", "--quiet", "--threads", 1, cwd=tmp_path, timeout=600)
    within = 0
    for delay in (0, 0.05, 0.2):
        name = f"delay-{delay}"
        p = started(2, "run", "case.yml", "-o", name, "--quiet", "--threads", 1, cwd=tmp_path)
        folder = tmp_path / name
        # Not the first: there must be one to go back to.
        while p.poll() is None and not all((folder / n).exists() for n in ("checkpoint.h5", "checkpoint.h5.tmp")):
            time.sleep(0.001)
        time.sleep(delay)
        within += (folder / "checkpoint.h5.tmp").exists()
        assert p.poll() is None
        os.kill(ranks_of(p.pid)[rank], signal.SIGKILL)
        _, err = p.communicate(timeout=60) # no hang
        assert p.returncode != 0, err
        check_readable(folder)
        done(2 - rank, "resume", name, "--quiet", "--threads", 1, cwd=tmp_path, timeout=600)
        assert_same_result(tmp_path / "whole", folder)
    assert within
