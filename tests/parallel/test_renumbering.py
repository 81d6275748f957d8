# SPDX-License-Identifier: MIT
"""The numbers of the floes order the contacts of a cell, and so decide which of many solutions within the tolerance is
found. That must not show in the mean force: it may differ by no more than its standard error."""
import h5py
import numpy as np
import pytest

from harness import call, changed, reading, run

pytestmark = [pytest.mark.one_rank, pytest.mark.slow]

# Loose enough that no jam decides on the force: in one, a single contact more or less is another history.
CASE = {
    "run": {"dt": 0.1, "duration": 90},
    "domain": {"length": 34, "width": 16},
    "ice": {"concentration": 0.5, "size": 0.8, "friction": 0.3, "size_law": "lognormal", "size_spread": 0.3},
    "body": {"x": 3, "length": 2},
    "tow": {"speed": 0.2, "ramp": 2},
    "output": {"window_start": 20, "frame_interval": 20},
}
FIELDS = 8


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
    """For each of the fields: as made, with the floes in another order, and (a change that does matter) without
    friction."""
    found = []
    for seed in range(1, FIELDS + 1):
        folder = tmp_path_factory.mktemp(f"field{seed}")
        case = changed(CASE, ice__seed=seed)
        made = run(folder, case, "--threads", 1, "--quiet", name="made")
        result = call("field", folder / "case.yml", "-o", folder / "made.h5")
        assert result.returncode == 0, result.stderr
        order = np.random.default_rng(seed).permutation(made.summary["n_floes"])
        permute(folder / "made.h5", folder / "other.h5", order)
        other = run(folder, reading(case, "other.h5"), "--threads", 1, "--quiet", name="other")
        smooth = run(folder, changed(case, ice__friction=0), "--threads", 1, "--quiet", name="smooth")
        found.append((order, made, other, smooth))
    return found


def numbers(r):
    return r.summary["mean_ice_resistance_n"], r.summary["mean_ice_resistance_se_n"]


def test_it_is_the_same_field(runs):
    """The first frame has the same floes, each under its new number."""
    for order, made, other, _ in runs:
        assert not np.array_equal(order, np.arange(len(order))) and made.hash != other.hash
        np.testing.assert_array_equal(other.dataset("/frames/pose")[0], made.dataset("/frames/pose")[0][order])
        np.testing.assert_array_equal(other.dataset("/floes/area")[:], made.dataset("/floes/area")[:][order])


def test_the_mean_force_does_not_depend_on_the_numbers(runs):
    """Two histories of one field part by rounding after some seconds, whatever is done: single runs differ as
    independent ones do. So each pair is held against the standard error of a difference, and the mean over the fields,
    where that evens out, against the standard error of one run."""
    made, other, smooth = (np.array([numbers(r[k]) for r in runs]).T for k in (1, 2, 3))
    assert all(r.summary["unconverged_steps"] == 0 for row in runs for r in row[1:3])
    assert np.all(made[1] < 0.3 * made[0]) # or the comparison would say nothing
    difference, error = other[0] - made[0], np.hypot(other[1], made[1])
    assert np.all(np.abs(difference) < 4 * error)
    assert abs(difference.mean()) < made[1].mean()
    assert (made[0] - smooth[0]).mean() > made[1].mean() # a change that matters is seen
