# SPDX-License-Identifier: MIT
"""Statistics of every load that something is designed for, of tows by a vessel on a line of two branches with panel
loads, against the series of the members by plain NumPy."""
import argparse
import json

import h5py
import numpy as np
import pytest
from scipy import stats

from harness import TOW, call, changed, write_case

from bergtow.plot import ensemble as plot_ensemble
from bergtow.reporting import ensemble as report_ensemble
from bergtow.reporting import method as report_method
from bergtow.result.members import Members
from bergtow.stats import conditions as ensemble
from bergtow.stats import design_value as statement
from bergtow.table import written
from bergtow.text import loads as loads_text

N = 4
VESSEL = changed(TOW, run={"dt": 0.05, "duration": 40}, domain={"length": 30, "width": 10},
                 ice={"concentration": 0.6, "size": 1, "x_max": 25.9, "restitution": 0.2},
                 body={"x": 27, "length": 2, "y": 0.3},
                 tow={"mode": "thrust", "speed": 0.3, "ramp": 5, "direction": 180, "line_length": 3,
                      "line_stiffness": 2000, "line": {"branches": 2}, "vessel": {
                          "mass": 800, "bollard_pull": 600, "free_speed": 3}},
                 output={"panels": True, "window_start": 12}, estimate__length_scale=225)
SCALE = 2.0  # s: 30 s at full scale by Froude's law


@pytest.fixture(scope="module")
def towed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("vessel")
    write_case(folder, VESSEL, "base.yml")
    (folder / "study.yml").write_text(json.dumps({"base": "base.yml", "repeats": N}))
    done = call("ensemble", "study.yml", "-o", "out", "--quiet", cwd=folder)
    assert done.returncode == 0, done.stderr
    e = Members(folder / "out")
    options = report_ensemble.OPTIONS | {"resamples": 1, "hours": [0.005, 0.02]}
    return e, ensemble.statistics(e, argparse.Namespace(**options))


def window_of(folder, name):
    """[samples (, panels)] of a series of result.h5 from the window's first time scale on, as moving means."""
    with h5py.File(folder / "result.h5") as f:
        t, x = f["series/time"][:], f[name][:]
    x = x.reshape(len(t), -1)
    start, end = (json.loads((folder / "summary.json").read_text())["window"][k] for k in ("start_s", "end_s"))
    n = round(SCALE / (t[1] - t[0]))
    some = [np.convolve(column[(t >= start - 1e-9) & (t <= end + 1e-9)], np.full(n, 1 / n), "valid") for column in x.T]
    return np.max(some, axis=0)


SERIES = {"tow_force": "series/tow_force", "line_tension_1": "series/line_tension_1",
          "line_tension_2": "series/line_tension_2", "vessel_thrust": "series/vessel_thrust",
          "ice_resistance": "series/ice_resistance", "panel_load": "panels/load"}


@pytest.mark.parametrize("name", SERIES)
def test_a_load_is_that_of_the_series(towed, name):
    e, s = towed
    x = s["conditions"][0]["loads"][name]
    fields = [window_of(e.folder(m), SERIES[name]) for m in range(N)]
    assert x["fields"] == N and x["units"] == "N" and x["time_scale_s"] == pytest.approx(SCALE)
    means, together = np.array([f.mean() for f in fields]), np.concatenate(fields)
    assert x["mean"]["value"] == pytest.approx(means.mean(), rel=1e-9)
    interval = means.mean() + np.array([-1, 1]) * stats.t.ppf(0.975, N - 1) * means.std(ddof=1) / np.sqrt(N)
    least = 0 if together.min() >= 0 else -np.inf  # a load that is never negative has no negative mean
    assert x["mean"]["interval_95"] == pytest.approx(np.maximum(interval, least), rel=1e-6)
    assert x["sd"]["value"] == pytest.approx(together.std(ddof=1), rel=1e-9)
    assert x["largest"] == pytest.approx(together.max(), rel=1e-9)
    for q in ("5", "50", "95", "99"):
        assert x["quantiles"][q]["value"] == pytest.approx(np.percentile(together, int(q)), rel=1e-9)
        low, high = x["quantiles"][q]["interval_95"]
        assert low < x["quantiles"][q]["value"] < high
    for row in x["exceedance"][::5]:
        assert row["share_of_time"]["value"] == pytest.approx(np.mean(together > row["level"]), rel=1e-9)
    levels = [level for kind in ("over_threshold", "block_maxima") for level in x[kind].get("levels", [])]
    assert all(np.isfinite(level["level"]) and level["hours"] > 0 for level in levels)


def test_what_inertia_takes_of_the_start(towed):
    e, s = towed
    start, found = s["conditions"][0]["loads"]["tow_force"]["start_up"], {}
    for m in range(N):
        with h5py.File(e.folder(m) / "result.h5") as f:
            t, tow, inertia = (f[f"series/{n}"][:] for n in ("time", "tow_force", "inertia_force"))
        some = (t > start["time_s"] - SCALE + 1e-9) & (t <= start["time_s"] + 1e-9)
        found[tow[some].mean()] = inertia[some].mean()
    assert start["time_s"] < 12 and start["largest"] == pytest.approx(max(found), rel=1e-9)
    assert start["inertia"] == pytest.approx(found[max(found)], rel=1e-9)
    assert len({round(v, 6) for v in found.values()}) > 1  # or any member's would do


@pytest.mark.slow
def test_a_bridle_that_loses_a_branch_before_the_window(tmp_path):
    """Its window may be steady, and no number but the list of events tells it."""
    case = changed(VESSEL, tow__line={"branches": 2, "breaking_load": 0}, tow__branch2={"breaking_load": 120})
    write_case(tmp_path, case, "base.yml")
    (tmp_path / "study.yml").write_text(json.dumps({"base": "base.yml", "repeats": N}))
    assert call("ensemble", "study.yml", "-o", "out", "--quiet", cwd=tmp_path).returncode == 0
    e = Members(tmp_path / "out")
    for m in range(N):
        broken, = e.events(m)
        assert broken["kind"] == "line_broken" and broken["subject"] == 2 and broken["value"] > 120
        assert broken["time_s"] < e.number("window_start_s", m)
        assert json.loads((e.folder(m) / "summary.json").read_text())["events"] == [broken]
    s = ensemble.statistics(e, argparse.Namespace(**report_ensemble.OPTIONS | {"resamples": 1, "hours": [0.005]}))
    c, = s["conditions"]
    assert f"the line parted in {N} of {N} tows, branch 2 in {N}, the first at" in c["design"]["warnings"][0]["detail"]
    assert c["design"]["tow"]["refused"] == f"the line parted in {N} of {N} tows"
    assert c["loads"]["tow_force"]["fields"] == N
    one, two = c["design"]["branches"]
    assert np.isnan(one["breaking_load"]) and two["breaking_load"] == 120 < two["largest_step"] < one["largest_step"]
    assert two["label"] == "tension of the second branch"
    rows = dict(report_method.holds(statement.cases(e, s)))
    assert rows["breaking load of the line"] == "120 N of branch 2"


def test_samples_of_several_steps(tmp_path):
    """Peaks of a step are those of the summary, a force of which the largest of the steps was kept is no signal, and
    the window begins with the first sample that lies in it and ends with the last whole one."""
    write_case(tmp_path, changed(VESSEL, output__sample_every=7, output__panels=False), "base.yml")
    (tmp_path / "study.yml").write_text(json.dumps({"base": "base.yml", "repeats": 2}))
    assert call("ensemble", "study.yml", "-o", "out", "--quiet", cwd=tmp_path).returncode == 0
    e = Members(tmp_path / "out")
    c, = ensemble.statistics(e, argparse.Namespace(**report_ensemble.OPTIONS | {"resamples": 1}))["conditions"]
    assert "of every 7 steps only the largest was kept" in c["loads_left_out"]["floe_force"]["why"]
    assert "floe_force" not in c["loads"] and "tow_force" in c["loads"]
    texts = [json.loads((e.folder(m) / "summary.json").read_text())["window"] for m in range(2)]
    for row, name in zip(c["design"]["branches"], ("line_tension_1", "line_tension_2")):
        assert row["largest_step"] == max(text["series"][name][k] for text in texts for k in ("peak_n", "start_peak_n"))
        with h5py.File(e.folder(0) / "result.h5") as f:
            assert f[f"series/{name}"][:].max() < row["largest_step"]
    for m, text in enumerate(texts):
        time = e.series(m)[0]
        some = time[np.isin(e.series(m)[1], e.steady(m))]
        assert 0 <= some[0] - 7 * 0.05 - (text["start_s"] - 0.05) + 1e-9 < 7 * 0.05
        assert len(time) == 115 and some[-1] == time[-2]  # the last one holds two steps
    x = c["loads"]["tow_force"]
    n = round(SCALE / 0.35)
    assert x["hours"] == pytest.approx(sum(len(e.steady(m)) - n + 1 for m in range(2)) * 0.35 / 3600)


def test_tables_pictures_and_answer_have_them(towed):
    e, s = towed
    labels = {x["label"] for x in s["conditions"][0]["loads"].values()}
    signals = written(loads_text.signals(s))
    for table in signals, written(loads_text.quantiles(s)):
        assert all(label in table for label in labels)
    with h5py.File(e.folder(0) / "result.h5") as f:
        x, y = f["panels/middle"][:].T
    p = s["conditions"][0]["panels"]
    most = int(np.argmax(p["mean"]))
    bearing = np.degrees(np.arctan2(y[most], x[most])) % 360
    assert f"Hull panels, the case: panel {most} (at {bearing:.0f}° from" in signals
    drawn = dict(plot_ensemble.pictures(e, argparse.Namespace(**report_ensemble.OPTIONS), s["conditions"]))
    assert {"above-tow-force", "above-vessel-thrust", "above-line-tension-1", "above-line-tension-2"} <= set(drawn)
    x = s["conditions"][0]["loads"]["vessel_thrust"]
    axes = drawn["above-vessel-thrust"]().axes[0]
    line = next(line for line in axes.lines if line.get_label().startswith("the case"))
    assert line.get_ydata()[0] == pytest.approx(100 * x["exceedance"][0]["share_of_time"]["value"])
    speeds = []
    for m in range(N):
        with h5py.File(e.folder(m) / "result.h5") as f:
            t, px = (f[f"series/{n}"][:] for n in ("time", "body_x"))
        some = t >= 12
        speeds.append((px[some][0] - px[some][-1]) / (t[some][-1] - t[some][0]))  # towed to -x
    made = s["conditions"][0]["design"]["speed"]
    assert made["value"] == pytest.approx(np.mean(speeds), rel=1e-9) and made["interval_95"][0] < made["value"]
    rows = dict(report_method.holds(statement.cases(e, s)))
    assert rows["speed made good"].startswith(f"the case: {np.mean(speeds):.3f} m/s (")
