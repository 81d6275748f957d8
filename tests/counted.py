# SPDX-License-Identifier: MIT
"""What a run says of collisions and panel loads, counted anew from the rows and series of its result.h5 over the window
of its summary.json."""
import h5py
import numpy as np
import pytest


def _most(values, none=0.0):
    return max(values, default=none)


def assert_counted_over_the_window(run):
    """Every number of "impacts" in summary.json and every array of /panels; a case with output.panels and samples of
    one step. Returns the window's start."""
    summary, window = run.summary["impacts"], run.summary["window"]
    start, end = window["start_s"], window["end_s"]
    with h5py.File(run.dir / "result.h5") as f:
        rows = {name: d[:] for name, d in f["impacts"].items()}
        series = {name: f["series"][name][:] for name in ("time", "ice_resistance", "collision_resistance",
                                                          "largest_quasi_static_load")}
        panels, attributes = {name: d[:] for name, d in f["panels"].items()}, dict(f["panels"].attrs)
    late, steps = (rows["time"] >= start) & (rows["time"] <= end), (series["time"] >= start) & (series["time"] <= end)
    dt = run.summary["dt_s"]
    hours = steps.sum() * dt / 3600
    assert summary["from_s"] == start == attributes["from"] and attributes["steps"] == steps.sum(
    ) == window["n_samples"]
    assert summary["collisions_whole_run"] == len(rows["time"]) and summary["collisions"] == late.sum()
    assert summary["hours"] == pytest.approx(hours, rel=1e-12) and summary["collisions_per_hour"] == pytest.approx(
        late.sum() / hours, rel=1e-12)
    # The largest, in the window and before it.
    peaks = rows["peak"][late]
    if len(peaks):
        at = np.flatnonzero(late)[peaks.argmax()]
        big = summary["largest"]
        for key, name in (("peak_n", "peak"), ("mean_n", "mean"), ("impulse_ns", "impulse"),
                          ("approach_m_s", "approach"), ("effective_mass_kg", "effective_mass"), ("time_s", "time"),
                          ("floe", "floe"), ("panel", "panel"), ("x_m", "x"), ("y_m", "y"), ("duration_s", "duration")):
            assert big[key] == rows[name][at], key
    else:
        assert summary["largest"] is None
    before = rows["peak"][~late]
    assert summary["start_largest_peak_n"] == (before.max() if len(before) else None)
    ordered = np.sort(peaks)[::-1]
    ranks = [r for r in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000) if r <= len(ordered)]
    assert [(e["rank"], e["peak_n"]) for e in summary["exceedance"]] == [(r, ordered[r - 1]) for r in ranks]
    assert [e["per_hour"] for e in summary["exceedance"]] == pytest.approx([r / hours for r in ranks])
    # Of steps.
    load = series["largest_quasi_static_load"]
    assert summary["largest_quasi_static_load_n"] == load[steps].max()
    before = load[~steps].max() if (~steps).any() else None
    assert summary["start_largest_quasi_static_load_n"] == before
    collision, ice = series["collision_resistance"][steps].mean(), series["ice_resistance"][steps].mean()
    assert summary["mean_collision_resistance_n"] == pytest.approx(collision, rel=1e-9, abs=1e-9)
    assert summary["mean_quasi_static_resistance_n"] == pytest.approx(ice - collision, rel=1e-9, abs=1e-9)
    # By panel.
    load, force, n = panels["load"], panels["force"], panels["load"].shape[1]
    np.testing.assert_allclose(panels["mean_load"], load[steps].mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(panels["mean_force"], force[steps].mean(axis=0), rtol=1e-9, atol=1e-9)
    assert np.array_equal(panels["max_load"], load[steps].max(axis=0))
    assert np.array_equal(panels["start_max_load"], load[~steps].max(axis=0, initial=0))
    assert np.array_equal(panels["collisions"], np.bincount(rows["panel"][late], minlength=n))
    for name, some in (("max_peak", late), ("start_max_peak", ~late)):
        assert np.array_equal(panels[name], [_most(rows["peak"][some & (rows["panel"] == k)]) for k in range(n)]), name
    return start
