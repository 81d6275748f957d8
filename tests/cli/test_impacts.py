# SPDX-License-Identifier: MIT
"""Collisions and panel loads that a run leaves: against its series, against each other, and against formulas written down again here."""
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest

from harness import CASE, IO, ROOT, TOW, call, changed, differing, run, write_case

sys.path.insert(0, str(ROOT / "postproc"))

import plot_impacts  # noqa: E402
from bergtow_read import Run as Folder  # noqa: E402

# On a line, off the middle, so that the body yaws; a window of the statistics that begins within the run.
LINE = changed(TOW, tow={"mode": "line", "speed": 0.13, "ramp": 2, "line_length": 3, "hull_y": 0.4}, body__shape="square", body__length=1.6,
               body__y=0.5, ice__restitution=0.2, output={"panels": True, "window_start": 10}, impact={"panels": 24, "duration": 0.04})


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    return run(tmp_path_factory.mktemp("line"), LINE)


def rows(r):
    with h5py.File(r.dir / "result.h5") as f:
        return {name: d[:] for name, d in f["impacts"].items()}


@pytest.fixture(scope="module")
def prescribed(tmp_path_factory):
    """Infinite mass: its contacts lie elsewhere than those of a body on a line."""
    return run(tmp_path_factory.mktemp("speed"), changed(LINE, tow={"speed": 0.13, "ramp": 2}, body__yaw=20))


def test_panels_carry_the_ice_force_at_every_sample(line, prescribed):
    total, fx, fy = prescribed.dataset("/panels/force").sum(axis=1), *prescribed.series("ice_force_x", "ice_force_y")
    c, s = np.cos(np.pi / 9), np.sin(np.pi / 9)
    scale = np.abs(fx).max()
    assert scale > 1 and np.abs(c * total[:, 0] - s * total[:, 1] - fx).max() < 1e-11 * scale and np.abs(s * total[:, 0] + c * total[:, 1] - fy).max() < 1e-11 * scale
    force, load = line.dataset("/panels/force"), line.dataset("/panels/load")
    fx, fy, yaw = line.series("ice_force_x", "ice_force_y", "body_yaw")
    assert force.shape == (300, 24, 2) and load.shape == (300, 24) and np.ptp(yaw) > 0.02
    before = np.concatenate([[0.0], yaw[:-1]])  # a step's contacts are those at its start
    total = force.sum(axis=1)
    scale = np.abs(load).sum(axis=1).max()
    assert scale > 1
    assert np.abs(np.cos(before) * total[:, 0] - np.sin(before) * total[:, 1] - fx).max() < 1e-12 * scale
    assert np.abs(np.sin(before) * total[:, 0] + np.cos(before) * total[:, 1] - fy).max() < 1e-12 * scale


def test_panel_statistics_are_those_of_their_series(line):
    with h5py.File(line.dir / "result.h5") as f:
        time, force, load = f["series/time"][:], f["panels/force"][:], f["panels/load"][:]
        late = time >= 10
        assert f["panels"].attrs["steps"] == late.sum() and f["panels"].attrs["from"] == 10
        np.testing.assert_allclose(f["panels/mean_load"][:], load[late].mean(axis=0), rtol=1e-12)
        np.testing.assert_allclose(f["panels/mean_force"][:], force[late].mean(axis=0), rtol=1e-9, atol=1e-12)
        assert np.array_equal(f["panels/max_load"][:], load[late].max(axis=0))
        ends, middle, normal = f["panels/ends"][:], f["panels/middle"][:], f["panels/normal"][:]
    np.testing.assert_allclose(ends[0], ends[-1], atol=1e-12)
    np.testing.assert_allclose(middle[0], [0.8, 0], atol=1e-12)
    # Ice presses, along the normal, wherever a panel is all on one side of the square; the sixths are on its corners.
    flat = np.arange(24) % 6 != 3
    inward = -np.einsum("tkc,kc->tk", force, normal)[:, flat]
    np.testing.assert_allclose(inward, load[:, flat], rtol=0.02, atol=1e-9)  # a floe that lies nearly flush may lend its own normal
    assert (load[:, flat] > 0).sum() > 300
    r = rows(line)
    late = r["time"] >= 10
    hits = np.bincount(r["panel"][late], minlength=24)
    assert np.array_equal(hits, line.dataset("/panels/collisions"))
    peaks = [r["peak"][late][r["panel"][late] == k].max(initial=0) for k in range(24)]
    assert np.array_equal(peaks, line.dataset("/panels/max_peak"))
    # Each collision lies on its panel.
    near = np.hypot(r["x"][:, None] - middle[None, :, 0], r["y"][:, None] - middle[None, :, 1]).argmin(axis=1)
    assert np.mean(near == r["panel"]) > 0.9 and np.abs(np.hypot(r["x"], r["y"])).max() < 1.2


def test_rows_series_and_summary_agree(line):
    r, s = rows(line), line.summary["impacts"]
    count, peak, share, ice, time = line.series("collisions", "impact_peak", "collision_resistance", "ice_resistance", "time")
    assert len(r["time"]) == s["collisions_whole_run"] and 0 <= len(r["time"]) - count.sum() <= 3  # the last may be open when the run ends
    assert len(r["time"]) > 20
    np.testing.assert_allclose(r["mean"], r["impulse"] / 0.04)
    np.testing.assert_allclose(r["peak"], np.pi / 2 * r["impulse"] / 0.04)
    assert np.all(r["approach"] >= 0.05 * 0.13) and np.all(r["impulse"] > 0) and np.all(r["impulse"] <= 1.2001 * r["effective_mass"] * (r["approach"] + 1e-3) * 1.3)
    assert np.all((r["floe"] >= 0) & (r["floe"] < line.summary["n_floes"] + 5))
    assert peak.max() == r["peak"][:int(count.sum())].max()
    late = r["time"] >= 10
    steps = (time >= 10).sum()
    assert (s["from_s"], s["collisions"]) == (10, late.sum()) and s["hours"] == pytest.approx(steps * 0.1 / 3600)
    assert s["collisions_per_hour"] == pytest.approx(late.sum() / s["hours"])
    assert s["largest"]["peak_n"] == r["peak"][late].max()
    assert s["largest"]["floe"] == r["floe"][late][r["peak"][late].argmax()]
    ordered = np.sort(r["peak"][late])[::-1]
    assert [e["rank"] for e in s["exceedance"]] == [k for k in (1, 2, 5, 10, 20, 50, 100, 200) if k <= late.sum()]
    for e in s["exceedance"]:
        assert e["peak_n"] == ordered[e["rank"] - 1] and e["per_hour"] == pytest.approx(e["rank"] / s["hours"])
    late = time >= 10
    assert s["mean_collision_resistance_n"] == pytest.approx(share[late].mean(), rel=1e-9)
    assert s["mean_push_resistance_n"] + s["mean_collision_resistance_n"] == pytest.approx(ice[late].mean(), rel=1e-9)
    assert 0 < s["mean_collision_resistance_n"] < ice[late].mean() * 1.5
    assert s["conversion"] == "half-sine of 0.04 s" and "half-sine of 0.04 s" in line.result.stdout


def test_samples_of_several_steps_hold_means(line, tmp_path):
    r = run(tmp_path, changed(LINE, output__sample_every=7))
    one, seven = line.dataset("/panels/force"), r.dataset("/panels/force")
    assert seven.shape[0] == len(r.series("time")) == 43
    np.testing.assert_allclose(seven[:42], one[:294].reshape(42, 7, 24, 2).mean(axis=1), atol=1e-12)
    np.testing.assert_allclose(seven[42], one[294:].mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(r.dataset("/panels/load")[:42], line.dataset("/panels/load")[:294].reshape(42, 7, 24).mean(axis=1), atol=1e-12)
    # Rows do not go by samples, nor do counts.
    assert all(np.array_equal(a, b) for a, b in zip(rows(line).values(), rows(r).values()))
    assert r.series("collisions").sum() == line.series("collisions").sum() and r.summary["impacts"] == line.summary["impacts"]


def test_crushing_and_its_keys(line, tmp_path):
    r = run(tmp_path, changed(LINE, impact={"conversion": "crushing", "pressure": "50 kPa", "corner_angle": 60}))
    assert r.hash == line.hash
    c = rows(r)
    k = 2 * 50e3 * c["thickness"] * np.tan(np.pi / 6)
    v = np.minimum(c["approach"], c["impulse"] / c["effective_mass"])
    np.testing.assert_allclose(c["corner"], np.pi / 3)
    np.testing.assert_allclose(c["thickness"], 0.04, rtol=1e-12)
    np.testing.assert_allclose(c["peak"], v * np.sqrt(k * c["effective_mass"]), rtol=1e-12)
    np.testing.assert_allclose(c["duration"], np.pi / 2 * np.sqrt(c["effective_mass"] / k), rtol=1e-12)
    np.testing.assert_allclose(c["mean"], 2 / np.pi * c["peak"], rtol=1e-12)
    assert np.array_equal(c["impulse"], rows(line)["impulse"])
    real = rows(run(tmp_path, changed(LINE, impact={"conversion": "crushing", "corner": "real"}), name="real"))["corner"]
    assert len(np.unique(real.round(6))) > 5 and np.all((real > 0.3) & (real < np.pi))


def test_none_tells_nothing_and_changes_nothing(line, tmp_path):
    r = run(tmp_path, changed(LINE, impact={"conversion": "none"}))
    assert r.hash == line.hash and r.summary["impacts"] is None and "collisions " not in r.result.stdout
    with h5py.File(r.dir / "result.h5") as f:
        assert "impacts" not in f and "panels" not in f
        assert np.all(np.isnan(f["series/collisions"][:])) and np.all(np.isnan(f["series/collision_resistance"][:]))
    told = {f"/series/{n}" for n in ("collisions", "collision_resistance", "impact_peak")}
    assert {n for n in differing(line.dir / "result.h5", r.dir / "result.h5", but=("/case", "/case_as_given")) if not n.startswith(("/impacts", "/panels"))} == told


def test_the_resolved_file_holds_what_follows_from_other_keys(line, tmp_path):
    text = (line.dir / "case.resolved.yml").read_text()
    assert float(re.search(r"least_speed: (\S+) m/s", text)[1]) == pytest.approx(0.0065) and "duration: 0.04 s" in text
    plain = run(tmp_path, changed(TOW, run__duration=0.2))
    assert "  duration: 0.1 s" in (plain.dir / "case.resolved.yml").read_text() and plain.summary["impacts"]["largest"] is None


@pytest.mark.parametrize("key, value", [("duration", 0), ("panels", 0), ("pressure", "1 kN"), ("corner_angle", 180), ("conversion", "impulse"), ("least_speed", -1)])
def test_bad_values_are_refused(tmp_path, key, value):
    r = call("check", write_case(tmp_path, changed(TOW, **{f"impact__{key}": value})))
    assert r.returncode == CASE and f"impact.{key}" in r.stderr


def test_the_picture_shows_what_the_file_holds(line, tmp_path):
    with Folder(line.dir) as folder:
        outlines = plot_impacts.along_hull(folder)
        # The pieces are the whole hull, each as long as the others, corners included.
        lengths = [np.hypot(*np.diff(o, axis=0).T).sum() for o in outlines]
        np.testing.assert_allclose(lengths, 4 * 1.6 / 24, rtol=1e-9)
        assert [len(o) for o in outlines] == [3 if k % 6 == 3 else 2 for k in range(24)]
        figure = plot_impacts.draw(folder)
        mean, curve = figure.axes[0].collections[0].get_paths(), figure.axes[3].lines[0]
        reach = [np.hypot(*p.vertices.T).max() - np.hypot(*o.T).max() for p, o in zip(mean, outlines)]
        load = folder.panels["mean_load"]
        np.testing.assert_allclose(reach, 0.75 * 0.8 * np.sqrt(2) * load / load.max(), atol=1e-9)
        hits = folder.impacts
        late = np.sort(hits["peak"][hits["time"] >= 10])[::-1]
        assert np.array_equal(curve.get_xdata(), late)
        np.testing.assert_allclose(curve.get_ydata(), np.arange(1, len(late) + 1) / line.summary["impacts"]["hours"])
    script = [sys.executable, ROOT / "postproc/plot_impacts.py"]
    assert subprocess.run([*script, line.dir, "-o", tmp_path / "a.png"]).returncode == 0 and (tmp_path / "a.png").stat().st_size > 20000
    none = run(tmp_path, changed(TOW, run__duration=0.2, impact={"conversion": "none"}))
    refused = subprocess.run([*script, none.dir], capture_output=True, text=True)
    assert refused.returncode == IO and "impact.conversion" in refused.stderr and "Traceback" not in refused.stderr
    quiet = run(tmp_path, changed(TOW, ice__concentration=0, run__duration=0.2), name="quiet")
    assert subprocess.run([*script, quiet.dir]).returncode == 0  # nothing met: still a picture
