# SPDX-License-Identifier: MIT
"""A checkpoint from before contact laws had a table, and arrays their axes, goes on to the same bits: its contacts,
history and series are laid out as they were then.

Red when depths are taken for impulses, or friction is lost.
"""
import h5py
import numpy as np
import pytest

from harness import DONE, CASE, Run, call, changed, differing, run
from made_up_ensemble import seal

CRUSHING = {
    "run": {"dt": 0.1, "duration": 12},
    "domain": {"length": 12, "width": 6, "ends_closing": 0.1},
    "ice": {"concentration": 0.8, "size": 0.8, "friction": 0.3, "crushing": {"pressure": "2 kPa"}},
    "body": {"length": 1.5, "x": 3},
    "tow": {"speed": 0.3, "ramp": 0.5},
}
NEW = ("rafting", "rafted_area", "rafted_largest", "rafted_energy", "raft_edge_work", "raft_friction_work")
UNCOUNTED = {"locked": "locked_steps", "residual_checks": "mean_residual_checks",
             "position_updates": "mean_position_updates"}


def as_it_was(folder, damage=None):
    """Checkpoint and result without what came with the table of laws, and without dimensions."""
    with h5py.File(folder / "checkpoint.h5", "r+") as f:
        dimensions = [n for n in f if isinstance(f[n], h5py.Dataset)]
        assert "body" in dimensions
        for name in dimensions:
            del f[name]
        value, law = f["contacts/value"][:], f["contacts/law"][:]
        assert set(law.ravel()) == {0, 1}
        f["contacts/impulse"], f["contacts/friction"], f["contacts/crushed"] = value[:, :2], value[:, 2], law.astype(
            np.uint8)
        for name in [n for n in f["history"] if "raft" in n]:
            del f["history"][name]
        del f["contacts/value"], f["contacts/law"]
        if damage:
            del f[damage]
    with h5py.File(folder / "result.h5", "r+") as f:
        for name in NEW:
            del f["series"][name]
    seal(folder / "checkpoint.h5")
    seal(folder / "result.h5")


def test_it_goes_on_to_the_same_bits(tmp_path):
    case = changed(CRUSHING, ice__drag__sheltering=0)
    whole = run(tmp_path, case, name="whole")
    assert whole.summary["crushing_steps"] > 10
    run(tmp_path, case, "--steps", 70, name="cut")
    as_it_was(tmp_path / "cut")
    result = call("resume", "cut", "--quiet", cwd=tmp_path)
    assert result.returncode == DONE, result.stderr
    assert Run(tmp_path / "cut", result).hash == whole.hash
    assert differing(whole.dir / "result.h5", tmp_path / "cut/result.h5") == []


def test_what_was_not_counted_is_not_known(tmp_path):
    """Red when steps of before the numbers were taken count as 0: a mean over all steps would be too small."""
    run(tmp_path, CRUSHING, "--steps", 70, name="cut")
    with h5py.File(tmp_path / "cut/checkpoint.h5", "r+") as f, h5py.File(tmp_path / "cut/result.h5", "r+") as old:
        for total in ("sum_checks", "sum_projected", "locked_steps"):
            del f["history"][total]
        for name in UNCOUNTED:
            del old["series"][name]
    seal(tmp_path / "cut/checkpoint.h5")
    seal(tmp_path / "cut/result.h5")
    result = call("resume", "cut", "--quiet", cwd=tmp_path)
    assert result.returncode == DONE, result.stderr
    summary = Run(tmp_path / "cut", result).summary
    assert all(summary[number] is None for number in UNCOUNTED.values()), summary
    with h5py.File(tmp_path / "cut/result.h5") as f:
        for name in UNCOUNTED:
            x = f["series"][name][:]
            assert np.all(np.isnan(x[:70])) and np.all(np.isfinite(x[70:])), name


@pytest.mark.slow
def test_speeds_that_were_not_measured_are_those_ordered(tmp_path):
    """Red when a mean is taken over the steps that have them: it would be that of another window."""
    case = changed(CRUSHING, tow__mode="line", tow__line_length=2, tow__line_stiffness="10 kN")
    run(tmp_path, case, "--steps", 70, name="cut")
    with h5py.File(tmp_path / "cut/checkpoint.h5", "r+") as f, h5py.File(tmp_path / "cut/result.h5", "r+") as old:
        for medium in ("ice", "water"):
            for name in (f"speed_through_{medium}", f"leeway_through_{medium}"):
                del f["history"][name], old["series"][name]
        del f["undisturbed"], f["stall/ice"], f["stall/pull"]
    seal(tmp_path / "cut/checkpoint.h5")
    seal(tmp_path / "cut/result.h5")
    result = call("resume", "cut", "--quiet", cwd=tmp_path)
    assert result.returncode == DONE, result.stderr
    estimates = Run(tmp_path / "cut", result).summary["estimates"]
    assert estimates["speed_along_m_s"] == estimates["ordered_speed_m_s"] == 0.3


@pytest.mark.slow
def test_a_window_that_went_over_ground_goes_on_in_the_ice(tmp_path):
    """Red when its rear is missed, or is taken for one in the ice: that drifts, and no floe is renewed from then on."""
    case = {
        "run": {"dt": 0.1, "duration": 60}, "domain": {"length": 14, "width": 6, "ends": "moving", "sides": "periodic"},
        "ice": {"concentration": 0.4, "size": 0.8}, "body": {"length": 1, "draft": 0.3},
        "tow": {"speed": 0.4, "ramp": 0}, "water": {"current_x": -0.2}
    }
    whole = run(tmp_path, case, "--quiet", name="whole")
    run(tmp_path, case, "--quiet", "--steps", 300, name="cut")
    with h5py.File(tmp_path / "cut/checkpoint.h5", "r+") as f, h5py.File(tmp_path / "cut/result.h5", "r+") as old:
        f["window/rear"] = f["window/rear_in_ice"][()] + f["window/drift_x"][()]
        del f["window/rear_in_ice"]
        for name in ("body_in_ice_x", "body_in_ice_y"):
            del f["history"][name], old["series"][name]
    seal(tmp_path / "cut/checkpoint.h5")
    seal(tmp_path / "cut/result.h5")
    result = call("resume", "cut", "--quiet", cwd=tmp_path)
    assert result.returncode == DONE, result.stderr
    cut, all_ = (r.summary["moving_window"] for r in (Run(tmp_path / "cut", result), whole))
    assert cut["renewed"] == all_["renewed"] > 0 and abs(cut["laps"] - all_["laps"]) < 1e-9 and all_["laps"] > 2


def test_numbers_where_only_dimensions_are_written(tmp_path):
    run(tmp_path, changed(CRUSHING, run__duration=6), "--steps", 30, name="cut")
    (tmp_path / "cut/checkpoint.previous.h5").unlink(missing_ok=True)
    with h5py.File(tmp_path / "cut/checkpoint.h5", "r+") as f:
        f["numbers"] = [1.0, 2.0]
    seal(tmp_path / "cut/checkpoint.h5")
    result = call("resume", "cut", "--quiet", cwd=tmp_path)
    assert result.returncode == CASE and "holds what this program does not write" in result.stderr, result.stderr


def test_what_is_missing_in_it_is_reported(tmp_path):
    run(tmp_path, changed(CRUSHING, run__duration=6), "--steps", 30, name="cut")
    as_it_was(tmp_path / "cut", "contacts/friction")
    (tmp_path / "cut/checkpoint.previous.h5").unlink(missing_ok=True)
    result = call("resume", "cut", "--quiet", cwd=tmp_path)
    assert result.returncode == CASE and "/contacts/friction is missing" in result.stderr, result.stderr
