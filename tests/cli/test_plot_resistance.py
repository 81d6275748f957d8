# SPDX-License-Identifier: MIT
"""postproc/plot_resistance.py: points, curves, table and words of made-up runs, and what it refuses."""
import copy
import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from harness import DONE, call, changed, script, write_case
from test_postproc import done, make_run, pixels, where

from bergtow.errors import RunError
from bergtow.plot import style
from bergtow.plot import resistance as plot_resistance
from bergtow.stats import drift as stat_drift

pytestmark = pytest.mark.usefixtures("look")
BERG = {
    "run": {"dt": 5, "duration": 1000},
    "domain": {"frame": "geographic", "length": 5000, "width": 2000, "ends": "wall", "sides": "wall"},
    "ice": {"concentration": 0.8, "size": 30, "size_spread": 0,
            "thickness": 1.0}, "body": {"length": 80, "draft": 50}, "tow": {"speed": 0.5}
}


def made_up(folder, concentration, mean, se=1e3, case=BERG, **summary):
    """A run with the estimates of the program and a mean of the test's own."""
    run = make_run(folder)
    result = call("estimate", "--json", write_case(folder, changed(case, ice__concentration=concentration)))
    assert result.returncode == DONE, result.stderr
    numbers = json.loads((run / "summary.json").read_text())
    reported = json.loads(result.stdout)
    numbers |= {
        "estimates": reported["estimates"], "estimate_labels": reported["estimate_labels"],
        "mean_ice_resistance_n": mean, "mean_ice_resistance_se_n": se, "concentration": concentration, "warnings": [],
        "mean_ice_resistance_low_n": None if se is None else mean - 1.96 * se,
        "mean_ice_resistance_high_n": None if se is None else mean + 1.96 * se,
        "reference": None
    } | summary
    (run / "summary.json").write_text(json.dumps(numbers))
    return run


@pytest.fixture
def runs(tmp_path):
    return [
        made_up(tmp_path / "a", 0.1, 2e3),
        made_up(tmp_path / "b", 0.5, 4e4),
        made_up(tmp_path / "c", 0.5, 6e4, warnings=[{"code": "overlap", "text": "a doubt", "values": {}}]),
        made_up(tmp_path / "d", 0.95, 8e5, unconverged_steps=3)
    ]


def test_the_picture_has_points_bars_and_curves(runs):
    points = [plot_resistance.read(run) for run in runs]
    axes = plot_resistance.draw(points).axes[0]
    lines = {line.get_label(): line for line in reversed(axes.lines)}  # the first: an estimate goes on dotted
    scale = 1e3  # kN
    listed = json.loads(call("--list-quantities", "--json").stdout)["estimates"]
    assert [e["name"] for e in listed if e["kind"] == "ice resistance"] == list(
        points[0].of_ice) and len(points[0].of_ice) > 5
    for name, label in ((e["name"], e["label"]) for e in listed if e["kind"] == "ice resistance"):
        a, force = plot_resistance.curve(points[0], name)
        low, high = (np.nan if v is None else v for v in points[0].conditions["curves"]["valid_range"][name])
        y = np.asarray(lines[label].get_ydata(), dtype=float)
        drawn = np.isfinite(y)
        assert np.array_equal(drawn, (a >= low) & (a <= high) & np.isfinite(force)), name
        assert np.allclose(y[drawn] * scale, force[drawn], rtol=1e-12), name
    alone, averaged = axes.containers
    assert list(alone[0].get_xdata()) == [0.1, 0.95] and np.allclose(alone[0].get_ydata(), [2, 800])
    top = [segment[1][1] for segment in alone[2][0].get_segments()]
    assert np.allclose(top, [2 + 1.96, 800 + 1.96])
    assert list(averaged[0].get_xdata()) == [0.5] and np.allclose(averaged[0].get_ydata(), [50])
    [[(_, low), (_, high)]] = averaged[2][0].get_segments()
    assert np.isclose(high, 50 + 12.706 * 10, rtol=1e-4), "t of one degree of freedom, standard error 10"
    assert np.isclose(low, 50 - 12.706 * 10, rtol=1e-4), "below the picture"
    tows = lines["simulated, a tow"]
    assert list(tows.get_xdata()) == [0.5, 0.5] and np.allclose(tows.get_ydata(), [40, 60])
    low, high = axes.get_ylim()
    assert axes.get_yscale() == "log" and 0.04 - 1e-9 < low < 2 and 800 < high < 8000
    least = points[1].estimates["lichey_hellmer"].force  # the smallest of what is meant for 50 %
    assert np.isclose(plot_resistance.limits(points[1:3], True)[0], least / 2.5)
    assert plot_resistance.draw(points, log=False).axes[0].get_yscale() == "linear"


def test_an_estimate_without_a_value_has_no_place_on_the_axis(runs):
    point = copy.deepcopy(plot_resistance.read(runs[1]))
    known = plot_resistance.limits([point], False)
    numbers = next(iter(point.of_ice.values())).numbers
    numbers.update(valid=True, force_n=None, low_n=None, high_n=None)
    plot_resistance.limits([point], False)
    numbers.update(force_n=0.1 * known[1], low_n=None)
    assert plot_resistance.limits([point], False)[1] <= known[1]


def test_the_table_has_means_errors_and_ratios(runs, tmp_path):
    done(script("plot-resistance", *runs, "-o", tmp_path / "r.png", "--table", tmp_path / "new/r.md"),
         tmp_path / "r.png", tmp_path / "new/r.md")
    head, _, *lines = (tmp_path / "new/r.md").read_text().split("\n\n<!--")[0].splitlines()
    cells = [[c.strip() for c in line.strip("|").split("|")] for line in lines]
    assert [c.strip() for c in head.strip("|").split("|")
            ][:5] == ["ice, %", "runs", "simulated, N", "standard error, N", "Lichey-Hellmer"]
    assert [c[0] for c in cells] == ["10", "50", "95"] and [c[1] for c in cells] == ["1", "2", "1"]
    assert cells[0][2:5] == ["2000", "1e+03", "0"]
    assert cells[1][2:4] == ["5e+04", "1e+04"]  # scatter of 40 and 60 kN: 14.1 / sqrt 2
    width = plot_resistance.read(runs[0]).conditions["width_m"]
    drag = 0.5 * 910 * width * 0.25
    assert cells[1][4] == f"{drag:.3g}"  # the same from 15 to 90 %: no ratio
    rafting = plot_resistance.read(runs[3]).estimates["marchenko_rafting"].force
    assert cells[2][6] == f"{rafting:.3g} ({8e5 / rafting:.3g})"
    # compaction of loose and of dense ice
    assert cells[1][5].split()[0].endswith("*") and not cells[2][5].split()[0].endswith("*")
    assert cells[2][7] == "–"  # momentum beyond phi
    assert cells[2][-2] == "3 %" and cells[1][-1] == "1"
    picture = pixels(tmp_path / "r.png")
    for colour in (style.ICE, style.TOW, style.INERTIA, style.DRAG):
        assert len(where(picture, colour)[0]) > 100


def test_the_factor_of_an_interval_is_students():
    for freedom in (1, 2, 3, 4, 9, 19, 99, 2000):
        assert stat_drift.student(freedom) == pytest.approx(stats.t.ppf(0.975, freedom), rel=1e-6)
    assert stat_drift.student(4, 0.5) == pytest.approx(stats.t.ppf(0.75, 4), rel=1e-6)


def test_the_words_have_means_intervals_verdicts_and_estimates(runs, tmp_path):
    """Red: the interval of several tows by 1.96; an estimate outside its range; of a tow alone that of all."""
    result = script("plot-resistance", *runs, "-o", tmp_path / "r.png", "--words")
    path, empty, *said = result.stdout.splitlines()
    assert result.returncode == 0 and path == str(tmp_path / "r.png") and not empty
    assert said[0] == "10 % ice adds 2.00 kN (95 %: 0.0400 to 3.96), the mean of 1 tow."
    assert said[1] == "    Verdict: 1 of 1 tow steady."
    assert said[3] == "50 % ice adds 50.0 kN (95 %: -77.1 to 177), the mean of 2 tows."
    estimates = plot_resistance.read(runs[3]).of_ice
    meant = [e.label for e in estimates.values() if e.valid]
    assert 0 < len(meant) < len(estimates)
    assert [e.label for e in estimates.values() if e.label in said[8]] == meant and "Estimates: " in said[8]
    drag = next(e for e in plot_resistance.read(runs[0]).estimates.values() if e.on_top)
    assert said[9] == f"Without ice: {drag.label} {drag.force / 1e3:.0f} kN." and len(said) == 10


def test_the_verdict_of_five_tows_is_that_of_all(runs):
    """Red: of single tows alone, some of which change by chance."""
    point = plot_resistance.read(runs[1])
    for changes, expected in (((-9e3, 8e3, -5e3, 6e3, 1e3), "steady over all tows, and 4 of 5 by themselves"),
                              ((9e3, 8e3, 5e3, 6e3, 7e3), "over all tows the load rises by 7.00 kN in the window; "
                                                          "4 of 5 steady by themselves"),
                              ((-9e3, 8e3, -5e3, 6e3), "3 of 4 tows steady")):
        tows = [SimpleNamespace(**vars(point) | {"change": change, "steady": k > 0})
                for k, change in enumerate(changes)]
        assert plot_resistance.words(tows).splitlines()[1] == f"    Verdict: {expected}."


def test_tows_of_other_length_are_no_other_case(runs):
    """Red: refused, as the extent of a lead that is not there follows from the tow."""
    points = [plot_resistance.read(run) for run in runs]
    for p, mode, length in zip(points, ("none", "none", "channel", "channel"), (3605, 1805, 1805, 905)):
        p.case = p.case | {"lead.mode": mode, "lead.length": f"{length} m"}
    plot_resistance.check_alike(points[:2])
    for pair, key in ((points[1:3], "lead.mode is none there"), (points[2:], "lead.length is 1805 m there")):
        with pytest.raises(RunError, match=key):
            plot_resistance.check_alike(pair)


def test_the_default_place_is_beside_the_first_run(runs, tmp_path):
    done(script("plot-resistance", *runs), tmp_path / "resistance.png")


def test_a_run_without_resistance_or_error_is_shown_as_such(tmp_path):
    points = [plot_resistance.read(made_up(tmp_path / "a", 0.1, 0.0, se=None)),
              plot_resistance.read(made_up(tmp_path / "b", 0.5, 4e4, se=None))]
    axes = plot_resistance.draw(points).axes[0]
    assert axes.get_yscale() == "linear" and axes.get_ylim()[0] == 0
    assert list(axes.containers[0][0].get_ydata()) == [0, 40]
    assert "–" in plot_resistance.table(points).splitlines()[2]


def test_ice_that_pushes_the_body_ahead_is_shown(runs):
    """Red: no point on the default axis; estimates and drag below zero left out of any."""
    points = [plot_resistance.read(run) for run in runs]
    for p in points:
        p.mean, p.low, p.high = -p.mean, -p.high, -p.low
        for of in (p.conditions["curves"], *(e.numbers for e in p.estimates.values())):
            of.update({k: -np.array(of[k], dtype=float) for k in {*p.estimates, "force_n", "low_n", "high_n"} & {*of}})
        for e in p.estimates.values():
            e.force = -e.force
    axes = plot_resistance.draw(points).axes[0]
    low, high = axes.get_ylim()
    bars = [end for bar in axes.containers for s in bar[2][0].get_segments() for end in s[:, 1]]
    assert axes.get_yscale() == "linear" and low < min(bars) and max(bars) <= high
    drawn = {t.get_text() for t in axes.get_legend().get_texts()}
    assert {"simulated, a tow", "Lichey-Hellmer", "open-water drag (comes on top)"} <= drawn


def test_runs_of_other_conditions_are_refused(runs, tmp_path):
    thick = made_up(tmp_path / "thick", 0.7, 1e5, case=changed(BERG, ice__thickness=1.2))
    result = script("plot-resistance", *runs, thick, "-o", tmp_path / "r.png")
    assert result.returncode == 4 and "thick: " in result.stderr and "1.2 m" in result.stderr and ";" in result.stderr
    assert not (tmp_path / "r.png").exists()
    points = [plot_resistance.read(run) for run in runs[:2]]
    for p, scaled in zip(points, (1, 2)):
        p.case = p.case | {"estimate.length_scale": f"{scaled}"}
    with pytest.raises(RunError, match="estimate.length_scale is 1 there and 2 here"):
        plot_resistance.check_alike(points)


def test_tows_that_the_ice_slows_down_have_estimates_of_their_own(tmp_path):
    """Red: refused, as one set of curves does not suit them."""
    points = [plot_resistance.read(made_up(tmp_path / f"{k}", a, 1e5, case=changed(BERG, tow__speed=v)))
              for k, (a, v) in enumerate(((0.1, 0.5), (0.5, 0.5), (0.5, 0.4), (0.95, 0.3)))]
    assert plot_resistance.one_set_of_curves(points[:2]) and not plot_resistance.one_set_of_curves(points)
    figure = plot_resistance.draw(points)
    lines = {line.get_label(): line for line in reversed(figure.axes[0].lines)}
    for name, e in points[0].estimates.items():
        expected = [np.mean([p.estimates[name].force for p in some])
                    for some in (points[:1], points[1:3], points[3:])]
        line = lines[e.label + " (comes on top)" * e.on_top]
        y = np.array(line.get_ydata(), dtype=float) * 1e3
        drawn = np.isfinite(y)
        assert list(line.get_xdata()) == [0.1, 0.5, 0.95] and np.allclose(y[drawn], np.array(expected)[drawn]), name
    assert drawn.all()
    assert any("0.3 to 0.5 m/s" in t.get_text() for t in figure.texts)
    assert "as towed in 95 % ice" in plot_resistance.words(points).splitlines()[-1]


def test_another_case_is_no_other_seed(runs, tmp_path, capsys):
    """Red: runs of two frictions had one mean, and a run given twice a standard error of 0."""
    points = [plot_resistance.read(run) for run in runs]
    for p, friction in zip(points, (0.35, 0.05, 0.35, 0.35)):
        p.case = p.case | {"ice.friction": f"{friction}"}
    with pytest.raises(RunError, match="b: has a different case from .*a: ice.friction is 0.35 there and 0.05 here"):
        plot_resistance.check_alike(points)
    twice = [plot_resistance.read(run) for run in runs[:3]]
    for p, state in zip(twice, ("x", "y", "y")):
        p.state = state
    assert plot_resistance.once(twice) == twice[:2] and "ends in the same state" in capsys.readouterr().err


@pytest.mark.parametrize("spoil, words", [
    (lambda s: s.pop("estimates"), "holds no estimates"),
    (lambda s: s["estimates"].update(speed_along_m_s=None), "not towed"),
    (lambda s: s.update(mean_ice_resistance_n=None), "no mean ice resistance"),
])
def test_runs_without_the_numbers_are_refused(tmp_path, spoil, words):
    run = made_up(tmp_path / "a", 0.5, 4e4)
    summary = json.loads((run / "summary.json").read_text())
    spoil(summary)
    (run / "summary.json").write_text(json.dumps(summary))
    result = script("plot-resistance", run)
    assert result.returncode == 4 and words in result.stderr and "Traceback" not in result.stderr


def test_usage(tmp_path):
    assert script("plot-resistance").returncode == 2
    result = script("plot-resistance", tmp_path, "-o", "r.txt")
    assert result.returncode == 2 and "unknown kind of file" in result.stderr


def test_contents_lists_the_estimates_without_their_curves(runs):
    result = script("contents", runs[0])
    assert result.returncode == 0
    assert "estimates.lichey_hellmer.force_n" in result.stdout and "curves" not in result.stdout
