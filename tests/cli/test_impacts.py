# SPDX-License-Identifier: MIT
"""Collisions and panel loads that a run leaves: against its series, against each other, and against formulas written
down again here."""
import json
import re
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from counted import assert_counted_over_the_window
from harness import CASE, DONE, IO, QUAY, QUAY_CUTS, TOW, call, changed, differing, quay, run, script, write_case
from resuming import assert_same_result, done, killed_after

from bergtow.plot import impacts as plot_impacts
from bergtow.reporting import run as report_run
from bergtow.result.run import Run as Folder
from bergtow.stats.loads import of_run as loads_of

pytestmark = pytest.mark.usefixtures("look")
# On a line, off the middle, so that the body yaws; a window of the statistics that begins within the run.
LINE = changed(TOW,
               tow={"mode": "line", "speed": 0.13, "ramp": 2, "line_length": 3, "hull_y": 0.4},
               body__shape="square",
               body__length=1.6,
               body__y=0.5,
               ice__restitution=0.2,
               output={"panels": True, "window_start": 10},
               impact={"panels": 24, "duration": 0.04})


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    return run(tmp_path_factory.mktemp("line"), LINE)


# The same without a given window, long enough for one to be found well after the ramp and before the middle.
FOUND = changed(LINE, run__duration=60, ice__seed=4, output={"panels": True})


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return run(tmp_path_factory.mktemp("found"), FOUND)


def rows(r):
    with h5py.File(r.dir / "result.h5") as f:
        return {name: d[:] for name, d in f["impacts"].items()}


@pytest.fixture(scope="module")
def prescribed(tmp_path_factory):
    """Infinite mass: its contacts lie elsewhere than those of a body on a line."""
    return run(tmp_path_factory.mktemp("speed"), changed(LINE, tow={"speed": 0.13, "ramp": 2}, body__yaw=20))


@pytest.mark.slow
def test_panels_carry_the_ice_force_at_every_sample(line, prescribed):
    total, fx, fy = prescribed.dataset("/panels/force").sum(axis=1), *prescribed.series("ice_force_x", "ice_force_y")
    c, s = np.cos(np.pi / 9), np.sin(np.pi / 9)
    scale = np.abs(fx).max()
    assert scale > 1 and np.abs(c * total[:, 0] - s * total[:, 1] - fx).max() < 1e-11 * scale and np.abs(
        s * total[:, 0] + c * total[:, 1] - fy).max() < 1e-11 * scale
    force, load = line.dataset("/panels/force"), line.dataset("/panels/load")
    fx, fy, yaw = line.series("ice_force_x", "ice_force_y", "body_yaw")
    assert force.shape == (300, 24, 2) and load.shape == (300, 24) and np.ptp(yaw) > 0.02
    before = np.concatenate([[0.0], yaw[:-1]])  # a step's contacts are those at its start
    total = force.sum(axis=1)
    scale = np.abs(load).sum(axis=1).max()
    assert scale > 1
    assert np.abs(np.cos(before) * total[:, 0] - np.sin(before) * total[:, 1] - fx).max() < 1e-12 * scale
    assert np.abs(np.sin(before) * total[:, 0] + np.cos(before) * total[:, 1] - fy).max() < 1e-12 * scale


def test_panels_lie_on_the_hull_and_collisions_on_them(line):
    with h5py.File(line.dir / "result.h5") as f:
        force, load = f["panels/force"][:], f["panels/load"][:]
        ends, middle, normal = f["panels/ends"][:], f["panels/middle"][:], f["panels/normal"][:]
    np.testing.assert_allclose(ends[0], ends[-1], atol=1e-12)
    np.testing.assert_allclose(middle[0], [0.8, 0], atol=1e-12)
    # Ice presses, along the normal, wherever a panel is all on one side of the square; the sixths are on its corners.
    flat = np.arange(24) % 6 != 3
    inward = -np.einsum("tkc,kc->tk", force, normal)[:, flat]
    # a floe that lies nearly flush may lend its own normal
    np.testing.assert_allclose(inward, load[:, flat], rtol=0.02, atol=1e-9)
    assert (load[:, flat] > 0).sum() > 100
    r = rows(line)
    # Each collision lies on its panel.
    near = np.hypot(r["x"][:, None] - middle[None, :, 0], r["y"][:, None] - middle[None, :, 1]).argmin(axis=1)
    assert np.mean(near == r["panel"]) > 0.9 and np.abs(np.hypot(r["x"], r["y"])).max() < 1.2


def test_rows_series_and_summary_agree(line):
    r, s = rows(line), line.summary["impacts"]
    count, peak, share, ice, time = line.series("collisions", "impact_peak", "collision_resistance", "ice_resistance",
                                                "time")
    assert 20 < len(r["time"]) == s["collisions_whole_run"] == count.sum()
    np.testing.assert_allclose(r["mean"], r["impulse"] / 0.04)
    np.testing.assert_allclose(r["peak"], np.pi / 2 * r["impulse"] / 0.04)
    assert np.all(r["approach"] >= 0.05 * 0.13) and np.all(r["impulse"] > 0) and np.all(
        r["impulse"] <= 1.2001 * r["effective_mass"] * (r["approach"] + 1e-3) * 1.3)
    assert np.all((r["floe"] >= 0) & (r["floe"] < line.summary["n_floes"] + 5))
    assert peak.max() == r["peak"].max()
    late = time >= 10
    assert 0 < s["mean_collision_resistance_n"] < ice[late].mean() * 1.5
    assert s["conversion"] == "half-sine of 0.04 s" and "half-sine of 0.04 s" in line.result.stdout


#: steps of the quay after which its collision is under way
UNDER_WAY = 21


@pytest.mark.parametrize("every", [1, 4, 7])  # in the remainder of a sample, or at the end of one
def test_a_collision_under_way_at_the_end_is_in_the_last_sample(tmp_path, every):
    """Red: it was in the rows and the summary alone."""
    case = quay((20, 0), run__duration=0.1 * UNDER_WAY, output__sample_every=every)
    r = run(tmp_path, case, "--quiet")
    count, peak = r.series("collisions", "impact_peak")
    assert count.sum() == count[-1] == len(rows(r)["time"]) == r.summary["impacts"]["collisions_whole_run"] == 1
    assert peak[-1] == peak.max() == rows(r)["peak"][0] == r.summary["impacts"]["largest"]["peak_n"] > 1e4
    with Folder(r.dir) as folder:
        largest = {load.name: values.max() for load, values in loads_of(folder)[0]}
    assert largest["floe_force"] == peak[-1]
    # One that is stopped just before ends as this one.
    call("run", "case.yml", "-o", "cut", "--quiet", "--steps", UNDER_WAY - 1, cwd=tmp_path)
    assert call("resume", "cut", "--quiet", cwd=tmp_path).returncode == DONE
    assert_same_result(r.dir, tmp_path / "cut")


def test_a_collision_under_way_at_a_stop_is_left_to_the_run_that_resumes(tmp_path):
    r = run(tmp_path, quay((20, 0)), "--quiet")
    cut = run(tmp_path, quay((20, 0)), "--quiet", "--steps", UNDER_WAY, name="cut")
    with h5py.File(cut.dir / "checkpoint.h5") as f:
        assert len(f["impacts/open"]) == 1
    assert not cut.series("collisions").any() and not len(rows(cut)["time"])
    assert cut.summary["impacts"]["collisions_whole_run"] == 0
    assert call("resume", "cut", "--quiet", cwd=tmp_path).returncode == DONE
    assert_same_result(r.dir, cut.dir)


def test_everything_is_counted_over_the_given_window(line):
    assert assert_counted_over_the_window(line) == 10


def test_everything_is_counted_over_the_window_that_is_found(found):
    """Not from the end of the ramp on: the start has collisions of its own."""
    s = found.summary["impacts"]
    start = assert_counted_over_the_window(found)
    assert 2 < start < 30 and 10 < s["collisions"] < s["collisions_whole_run"] - 10
    r = rows(found)
    assert ((r["time"] >= 2) & (r["time"] < start)).sum() > 10  # between the ramp and the window
    np.testing.assert_allclose(s["start_largest_peak_n"], r["peak"][r["time"] < start].max())
    assert re.search(rf"collisions +{s['collisions']} in the window from {start:g} s on", found.result.stdout)
    assert f"{s['collisions_whole_run'] - s['collisions']} before the window" in found.result.stdout


@pytest.mark.slow
def test_a_long_run_that_was_killed_counts_the_same(tmp_path):
    """More steps than blocks of five hold: killed before the window, and within it."""
    case = changed(FOUND, run__dt=0.0025, ice__concentration=0.2, output={"panels": True, "checkpoint_steps": 1500,
                                                                          "frame_interval": 60})
    r = run(tmp_path, case, "--quiet", "--threads", 1)
    start = assert_counted_over_the_window(r)
    assert r.summary["n_steps"] == 24000 and 2 < start < 30
    steps = []
    for seconds in (0.7, 1.0, 1.3, 1.6, 3, 6, 12, 24):
        # Killed before its first checkpoint, it is begun again and given longer.
        killed_after(seconds if not steps else 0.4,
                     1,
                     *(("resume", "cut") if steps else ("run", "case.yml", "-o", "cut", "--force")),
                     "--quiet",
                     "--threads",
                     1,
                     cwd=tmp_path)
        if (tmp_path / "cut/checkpoint.h5").exists():
            with h5py.File(tmp_path / "cut/checkpoint.h5") as f:
                steps.append(f["world/step"][0])
        if (tmp_path / "cut/summary.json").exists() or len(steps) == 4:
            break
    assert 0 < steps[0] < 24000, steps
    done(1, "resume", "cut", "--quiet", "--threads", 1, cwd=tmp_path)
    assert_same_result(r.dir, tmp_path / "cut")


def test_without_a_window_all_is_the_starts(tmp_path):
    r = run(tmp_path, changed(LINE, run__duration=15, tow__ramp=20, output={"panels": True}))
    s = r.summary["impacts"]
    assert r.summary["window"]["verdict"] == "too short" and s["collisions"] == 0 < s["collisions_whole_run"]
    assert [s[k] for k in ("from_s", "largest", "largest_quasi_static_load_n", "mean_quasi_static_resistance_n",
                           "collisions_per_hour")] == [None] * 5
    with h5py.File(r.dir / "result.h5") as f:
        p = f["panels"]
        assert np.isnan(p.attrs["from"]) and p.attrs["steps"] == 0 and np.isnan(
            p["mean_load"][:]).all() and not p["max_load"][:].any()
        assert np.array_equal(p["start_max_load"][:],
                              p["load"][:].max(axis=0)) and s["start_largest_peak_n"] == f["impacts/peak"][:].max()
    assert "collisions  " not in r.result.stdout


def test_samples_of_several_steps_hold_means(line, tmp_path):
    r = run(tmp_path, changed(LINE, output__sample_every=7))
    one, seven = line.dataset("/panels/force"), r.dataset("/panels/force")
    assert seven.shape[0] == len(r.series("time")) == 43
    np.testing.assert_allclose(seven[:42], one[:294].reshape(42, 7, 24, 2).mean(axis=1), atol=1e-12)
    np.testing.assert_allclose(seven[42], one[294:].mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(r.dataset("/panels/load")[:42],
                               line.dataset("/panels/load")[:294].reshape(42, 7, 24).mean(axis=1),
                               atol=1e-12)
    # Rows do not go by samples, nor do counts.
    assert all(np.array_equal(a, b) for a, b in zip(rows(line).values(), rows(r).values()))
    assert r.series("collisions").sum() == line.series(
        "collisions").sum() and r.summary["impacts"] == line.summary["impacts"]


@pytest.mark.slow
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
    # Smaller floes, so that enough of them are met: 19 to 22 different corners in fields of three seeds.
    real = rows(
        run(tmp_path, changed(LINE, ice__size=0.4, impact={"conversion": "crushing", "corner": "real"}),
            name="real"))["corner"]
    assert len(np.unique(real.round(6))) > 10 and np.all((real > 0.3) & (real < np.pi))


@pytest.mark.slow
def test_the_real_corner_of_a_floe_in_parts(tmp_path):
    """A spike, 8 m long on a base of 4 m: its angle is that of the outline, whatever the parts are."""
    outline = [[30, -10], [40, -10], [40, 10], [30, 10], [30, 2], [22, 0.05], [30, -2], [30, -10]]
    (tmp_path / "spike.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [{
        "type": "Feature", "properties": {"thickness": 1},
        "geometry": {"type": "Polygon", "coordinates": [outline]}}]}))
    r = run(tmp_path, {
        "run": {"dt": 0.1, "duration": 30},
        "domain": {"frame": "basin", "length": 120, "width": 80, "x0": -20, "ends": "open", "sides": "open"},
        "ice": {"outlines": "spike.geojson", "outlines_crs": "frame", "nonconvex": "split"},
        "body": {"shape": "square", "length": 20, "draft": 5, "x": 0},
        "tow": {"mode": "speed", "speed": 0.5, "ramp": 0},
        "impact": {"conversion": "crushing", "corner": "real"}})
    angle = np.arctan2(1.95, 8) + np.arctan2(2.05, 8)
    np.testing.assert_allclose(rows(r)["corner"][0], angle, rtol=1e-6)


HIT = {"run": {"dt": 0.1, "duration": 1}, "domain": {"length": 60, "width": 40, "x0": -20},
       "body": {"shape": "square", "length": 10, "x": -5, "draft": 5, "mass": 1e9},
       "tow": {"mode": "speed", "speed": 0.5, "ramp": 0}, "impact": {"duration": 0.1},
       "ice": {"concentration": 0, "size": 1, "thickness": 0.5, "density": 900, "added_mass": 0, "friction": 0}}
SQUARE = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
TRIANGLE = [[0.5, -1], [0.5, 1], [-0.5, 0]]


@pytest.mark.parametrize("outline, more, x", [
    (SQUARE, [*SQUARE, [-0.5, 0.2], [-0.5, -0.2]], 0.515),
    (TRIANGLE, [[0.5, -1], [0.5, 1], [0, 0.5], [-0.5, 0]], 0.6816667)])
def test_a_corner_in_a_straight_edge_changes_no_hit(tmp_path, outline, more, x):
    """Of a floe, and of the body. Red: the hit came a step late, or turned the floe."""
    def told(name, vertices, **keys):
        case = changed(HIT, floes=[{"shape": "polygon", "vertices": vertices, "x": x, "y": 0}], **keys)
        return run(tmp_path, case, "--quiet", name=name)
    one, two = told("one", outline), told("two", more)
    assert one.hash == two.hash and rows(one)["impulse"] == pytest.approx([450 * 0.5])
    hull = [[-5, -5], [5, -5], [5, 5], [-5, 5]]
    hull[2:2] = [5, -0.2], [5, 0.3]
    assert told("barge", outline, body__shape="polygon", body__length=None, body__vertices=hull).hash == one.hash


@pytest.mark.parametrize("slop", [1e-3, 0])
def test_the_first_touch_of_a_corner_is_met(tmp_path, slop):
    """Red at 0 where a pair at rounding's distance counts as one that passes."""
    r = run(tmp_path, changed(HIT, solver__slop=slop, floes=[{"shape": "square", "length": 1, "yaw": 45, "x": 0.7221,
                                                              "y": 0}]), "--quiet")
    assert rows(r)["time"] == pytest.approx([0.1]) and r.summary["max_overlap_m"] < 1e-9


def test_a_wall_that_is_struck_is_no_floe():
    """Rows from the number of floes on are those of bodies, then of pieces, which are floes with these ids."""
    def said(struck):
        largest = dict.fromkeys(("peak_n", "mean_n", "duration_s", "impulse_ns", "approach_m_s", "time_s"), 1.0)
        impacts = {"collisions": 3, "collisions_whole_run": 3, "conversion": "", "largest": largest | {"floe": struck}}
        run = SimpleNamespace(summary={"impacts": impacts}, number=lambda key: 1.0, n_start=7,
                              bodies=[SimpleNamespace(name="berg"), SimpleNamespace(name="wall_y1")])
        return dict(report_run.impacts(run)["rows"])["largest peak"]
    assert ", floe 6 at" in said(6) and ", wall_y1 at" in said(8) and ", floe 12 at" in said(12)


def test_none_tells_nothing_and_changes_nothing(line, tmp_path):
    r = run(tmp_path, changed(LINE, impact={"conversion": "none"}))
    assert r.hash == line.hash and r.summary["impacts"] is None and "collisions " not in r.result.stdout
    with h5py.File(r.dir / "result.h5") as f:
        assert "impacts" not in f and "panels" not in f
        assert np.all(np.isnan(f["series/collisions"][:])) and np.all(np.isnan(f["series/collision_resistance"][:]))
    reported = {f"/series/{n}" for n in ("collisions", "collision_resistance", "impact_peak",
                                           "largest_quasi_static_load")}
    assert {
        n
        for n in differing(line.dir / "result.h5", r.dir / "result.h5", but=("/case", "/case_as_given"))
        if not n.startswith(("/impacts", "/panel", "/sample"))  # the last two: their axes
    } == reported


def test_the_resolved_file_holds_what_follows_from_other_keys(line, tmp_path):
    text = (line.dir / "case.resolved.yml").read_text()
    assert float(re.search(r"least_speed: (\S+) m/s", text)[1]) == pytest.approx(0.0065) and "duration: 0.04 s" in text
    plain = run(tmp_path, changed(TOW, run__duration=0.2))
    assert "  duration: 0.1 s" in (plain.dir /
                                   "case.resolved.yml").read_text() and plain.summary["impacts"]["largest"] is None


@pytest.mark.parametrize("key, value", [("duration", 0), ("panels", 0), ("pressure", "1 kN"), ("corner_angle", 180),
                                        ("conversion", "impulse"), ("least_speed", -1)])
def test_bad_values_are_refused(tmp_path, key, value):
    r = call("check", write_case(tmp_path, changed(TOW, **{f"impact__{key}": value})))
    assert r.returncode == CASE and f"impact.{key}" in r.stderr


@pytest.mark.parametrize("changes", [{"impact": {"conversion": "duration"}}, {"impact": {"conversion": "crushing"}}])
def test_a_quay_is_hit_once_however_it_is_cut(tmp_path, changes):
    whole = run(tmp_path / "whole", quay((20, 0), **changes))
    once = rows(whole)
    assert len(once["time"]) == 1 and once["peak"][0] > 1e5
    for pieces in QUAY_CUTS:
        cut = run(tmp_path / str(len(pieces)), quay(*pieces, **changes))
        hit = rows(cut)
        assert len(hit["time"]) == 1 and 0 <= hit["floe"][0] < len(pieces)
        for key in "time", "impulse", "approach", "effective_mass", "mean", "peak", "duration":
            assert hit[key] == pytest.approx(once[key], rel=1e-9), (pieces, key)
        assert cut.dataset("/panels/max_peak").max() == pytest.approx(once["peak"][0], rel=1e-9)
        assert cut.summary["impacts"]["largest"]["peak_n"] == pytest.approx(once["peak"][0], rel=1e-9)


def test_a_quay_that_crushes_bears_as_one(tmp_path):
    """At most what the ice bears along the whole contact, 4 m. In the end nearly nothing moves, which is no loss of
    momentum."""
    case = {"ice__crushing": {"pressure": "20 kPa"}}
    for pieces in [(20, 0)], QUAY_CUTS[0]:
        still = run(tmp_path / str(len(pieces)), quay(*pieces, **case))
        assert still.summary["momentum_residual"] < 1e-9
    hit = rows(run(tmp_path, quay(*QUAY_CUTS[0], **case)))
    assert len(hit["time"]) == 1 and hit["peak"][0] == pytest.approx(20e3 * 1 * 4, rel=5e-3)


def test_two_quays_are_two_collisions_and_a_bay_is_one(tmp_path):
    """A gap keeps two quays apart. In a corner, at 45 degrees, both faces take m v each, together as a body of twice
    the mass that comes at the speed normal to each."""
    apart = rows(run(tmp_path / "apart", quay((9, -5), (9, 5))))
    assert sorted(apart["floe"]) == [0, 1]
    corner = [{"shape": "rectangle", "length": 4, "width": 14, "x": 32, "y": 3, "fixed": True},
              {"shape": "rectangle", "length": 20, "width": 4, "x": 20, "y": 8, "fixed": True}]
    bay = changed(QUAY, floes=corner, body__x=27.2, body__y=3.2, body__vy=0.5)
    both = rows(run(tmp_path / "bay", bay))
    assert len(both["time"]) == 1
    one = rows(run(tmp_path / "face", changed(bay, floes=corner[:1])))
    assert both["impulse"][0] == pytest.approx(2 * one["impulse"][0], rel=1e-2)
    assert both["effective_mass"][0] == pytest.approx(2 * one["effective_mass"][0], rel=1e-9)


def test_pushed_against_a_quay(tmp_path):
    """A quasi-static load, too, is that of the whole quay."""
    wind = {"air": {"wind_x": 15}, "run__duration": 8}
    last = [run(tmp_path / str(len(pieces)), quay(*pieces, **wind)).series("largest_quasi_static_load")[-1]
            for pieces in ([(20, 0)], QUAY_CUTS[1])]
    assert last[0] > 10 and last[1] == pytest.approx(last[0], rel=1e-6)


@pytest.mark.parametrize("impact, key", [({"pressure": "1 MPa", "corner_angle": 60}, "corner_angle"),
                                         ({"corner": "real"}, "corner"),
                                         ({"conversion": "crushing", "duration": "0.2 s"}, "duration"),
                                         ({"conversion": "none", "least_speed": 0.01}, "least_speed")])
def test_keys_of_another_conversion_are_refused(tmp_path, impact, key):
    r = call("check", write_case(tmp_path, changed(TOW, impact=impact)))
    assert r.returncode == CASE and f"impact.{key}: has no effect" in r.stderr and "impact.conversion" in r.stderr


@pytest.mark.parametrize("conversion", ["none", "duration", "crushing"])
def test_keys_that_nobody_has_given_are_not_warned_of(tmp_path, conversion):
    """Nor those that follow from others, as the duration does from the time step."""
    r = call("check", write_case(tmp_path, changed(TOW, impact__conversion=conversion)))
    assert r.returncode == DONE and "no effect" not in r.stdout


@pytest.mark.slow
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
    done = script("plot-impacts", line.dir, "-o", tmp_path / "a.png")
    assert done.returncode == DONE and (tmp_path / "a.png").stat().st_size > 20000
    none = run(tmp_path, changed(TOW, run__duration=0.2, impact={"conversion": "none"}))
    refused = script("plot-impacts", none.dir)
    assert refused.returncode == IO and "impact.conversion" in refused.stderr and "Traceback" not in refused.stderr
    quiet = run(tmp_path, changed(TOW, ice__concentration=0, run__duration=0.2), name="quiet")
    assert script("plot-impacts", quiet.dir).returncode == DONE  # nothing met: still a picture
