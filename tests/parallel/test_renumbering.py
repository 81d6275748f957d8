# SPDX-License-Identifier: MIT
"""The numbers of the floes order the contacts of a tile, and so decide which of many solutions within the tolerance is found. That
must not show in the mean force: it may differ by no more than its standard error."""
import h5py
import numpy as np
import pytest

from harness import BERGTOW, call, changed, run

# Loose enough that no jam decides on the force: in one, a single contact more or less is another history.
CASE = {
    "run": {"dt": 0.1, "duration": 120},
    "domain": {"length": 34, "width": 16},
    "ice": {"concentration": 0.55, "size": 0.8, "friction": 0.3, "size_law": "lognormal", "size_spread": 0.3},
    "body": {"x": 3, "length": 2},
    "tow": {"speed": 0.2, "ramp": 2},
    "output": {"window_start": 20, "frame_interval": 20},
}


def permute(source, target, order):
    """The same floes in another order."""
    with h5py.File(source) as f, h5py.File(target, "w") as g:
        offsets, vertices = f["floes/offsets"][:], f["floes/vertices"][:]
        g["floes/offsets"] = np.concatenate([[0], np.cumsum(np.diff(offsets)[order])]).astype(offsets.dtype)
        g["floes/vertices"] = np.concatenate([vertices[offsets[k]:offsets[k + 1]] for k in order])
        for name in "pose", "thickness":
            g[f"floes/{name}"] = f[f"floes/{name}"][:][order]
        for name, value in f["floes"].attrs.items():
            g["floes"].attrs[name] = value


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("renumbering")
    first = run(folder, CASE, "--threads", 1, "--quiet", name="made")
    result = call("field", folder / "case.yml", "-o", folder / "0.h5")
    assert result.returncode == 0, result.stderr
    n = first.summary["n_floes"]
    found = []
    for k in range(5):
        order = np.arange(n) if k == 0 else np.random.default_rng(k).permutation(n)
        if k:
            permute(folder / "0.h5", folder / f"{k}.h5", order)
        found.append((order, run(folder, changed(CASE, ice__field=f"{k}.h5"), "--threads", 1, "--quiet", name=f"out{k}")))
    assert found[0][1].hash == first.hash
    return found


def test_it_is_the_same_field(runs):
    """The first frame has the same floes, each under its new number."""
    pose = runs[0][1].dataset("/frames/pose")[0]
    for order, r in runs[1:]:
        assert not np.array_equal(order, runs[0][0])
        np.testing.assert_array_equal(r.dataset("/frames/pose")[0], pose[order])
        np.testing.assert_array_equal(r.dataset("/floes/area")[:], runs[0][1].dataset("/floes/area")[:][order])
        assert r.hash != runs[0][1].hash


def test_the_mean_force_does_not_depend_on_the_numbers(runs):
    mean = np.array([r.summary["mean_ice_resistance_n"] for _, r in runs])
    error = np.array([r.summary["mean_ice_resistance_se_n"] for _, r in runs])
    print(mean, error)
    assert all(r.summary["unconverged_steps"] == 0 for _, r in runs)
    assert np.all(error < 0.3 * mean) # or the comparison would say nothing
    assert np.all(np.abs(mean - mean[0]) < np.minimum(error, error[0])), (mean, error)


def test_a_change_that_matters_is_seen(runs):
    """The same comparison tells another friction apart."""
    folder = runs[0][1].dir.parent
    mean, error = (runs[0][1].summary[f"mean_ice_resistance_{k}"] for k in ("n", "se_n"))
    other = run(folder, changed(CASE, ice__field="0.h5", ice__friction=0.9), "--threads", 1, "--quiet", name="rough")
    assert abs(other.summary["mean_ice_resistance_n"] - mean) > error
