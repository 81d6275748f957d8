# SPDX-License-Identifier: MIT
"""Loads of which only the least is known: every page says "at least", and by what share of the steps.

Red when a page prints such a load as a number like any other, gives it an interval, or when a condition leaves out the
tows that ended for it without a word.
"""
import argparse
import csv
import json
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from harness import call, run, script, write_case
from test_locked import jam

from bergtow.result import at_least  # noqa: E402
from bergtow.study import budget  # noqa: E402
from bergtow.study import capability  # noqa: E402
from bergtow import writing  # noqa: E402
from bergtow.stats import conditions as ensemble, loads
from bergtow.text import ensemble as ensemble_text  # noqa: E402
import made_up_ensemble as made_up  # noqa: E402
from bergtow.plot import resistance as plot_resistance  # noqa: E402
from bergtow.reporting import run as report_run  # noqa: E402
from bergtow import table as text_table  # noqa: E402
from bergtow.result.at_least import AtLeast  # noqa: E402
from bergtow.errors import Message, RunError  # noqa: E402
from bergtow.result.run import Run  # noqa: E402
from bergtow.result.members import Members  # noqa: E402
from bergtow.reporting.ensemble import OPTIONS  # noqa: E402

ENDED = Message("step 13: nothing gives way", "no_solution")


# ---- the number

def test_such_a_number_says_so_wherever_it_is_formatted():
    x = AtLeast(12345.0, 0.25)
    assert text_table.quantity(x, "N") == "at least 12.3 kN" and text_table.number(x / 1e3) == "at least 12.3"
    assert f"{x:.3g}" == "at least 1.23e+04" and text_table.number(x * 1e5) == "at least 1.23e+09"
    assert (2 * x).share == (x / 2).share == 0.25 and float(x) == 12345.0
    assert writing.plain({"a": [x]}) == {"a": [12345.0]} and json.dumps(x) == "12345.0"


def test_a_mean_of_some_is_at_least_that():
    assert not isinstance(at_least.of(1.0, [1.0, 1.0]), AtLeast)
    mixed = at_least.of(2.0, [1.0, AtLeast(3.0, 0.5)])
    assert isinstance(mixed, AtLeast) and mixed.share == 0.25


@pytest.mark.parametrize("line", [None, 5.0])
def test_loads_of_a_summary(line):
    """On a line the tow force has a bound. Drag always has."""
    found = at_least.summary({
        "window": {"no_load_share": 0.1, "series": {"ice_resistance": {"quarters_n": [1.0, None], "change_n": 1.0},
                                                    "line_tension_1": {"peak_n": 2.0}}},
        "mean_ice_resistance_n": 1.0, "mean_tow_force_n": 1.0, "mean_drag_force_n": 1.0, "sd_ice_resistance_n": 1.0,
        "peak_line_tension_n": line, "impacts": {"exceedance": [{"rank": 1.0, "peak_n": 1.0}]},
        "estimates": {"a": {"force_n": 1.0, "simulated_over_estimate": 2.0}}})
    least = [found["mean_ice_resistance_n"], found["window"]["series"]["ice_resistance"]["quarters_n"][0],
             found["impacts"]["exceedance"][0]["peak_n"], found["estimates"]["a"]["simulated_over_estimate"]]
    assert all(isinstance(x, AtLeast) and x.share == 0.1 for x in least)
    assert isinstance(found["mean_tow_force_n"], AtLeast) == (line is None)
    others = [found["mean_drag_force_n"], found["window"]["series"]["line_tension_1"]["peak_n"],
              found["impacts"]["exceedance"][0]["rank"], found["estimates"]["a"]["force_n"]]
    assert not any(isinstance(x, AtLeast) for x in others)
    assert found["sd_ice_resistance_n"] is found["window"]["series"]["ice_resistance"]["change_n"] is None


def test_a_summary_without_such_steps_stays_as_it_is():
    found = {"window": {"no_load_share": 0.0}, "mean_ice_resistance_n": 1.0, "sd_ice_resistance_n": 1.0}
    assert at_least.summary(dict(found)) == found and not isinstance(found["mean_ice_resistance_n"], AtLeast)


# ---- a run

@pytest.fixture(scope="module")
def locked(tmp_path_factory):
    """A jam with frames at every step."""
    return run(tmp_path_factory.mktemp("locked"), jam(1, 0.9, run__duration=3, output={
        "window_start": 0, "frame_interval": 0.1, "panels": True}))


def test_the_console_says_at_least(locked):
    said = locked.result.stdout
    for words in ("ice resistance    at least ", "quarters          at least: ", "the quasi-static rest has no bound",
                  "peaks, at least (", "largest quasi-static load at least ", "contact work is undefined"):
        assert words in said, words
    assert "from balances" not in said
    (reason,) = [r for r in locked.summary["window"]["reasons"] if r["code"] == "no_load"]
    assert "have no solution, so the loads on the body are at least those given" in reason["text"]
    assert "." not in reason["text"].replace("ice.", "").replace("rafting.", "").replace("crushing.", "").replace(
        f"{reason['values']['share_percent']:.3g}", "")  # one sentence


def test_panels_have_no_load_where_the_body_has_none(locked):
    """Red: a load of zero in the series, and nothing says that means and maxima count it."""
    with h5py.File(locked.dir / "result.h5") as f:
        lost, force = f["series/no_load"][:] == 1, f["series/ice_resistance"][:]
        panels = {name: d[:] for name, d in f["panels"].items()}
        given = dict(f["panels"].attrs)
        texts = {name: f["panels"][name].attrs["description"] for name in ("mean_load", "mean_force", "max_load")}
    assert lost.sum() > 3 and np.array_equal(np.isnan(force), lost)
    for name in ("load", "force"):
        empty = np.isnan(panels[name]).reshape(len(lost), -1)
        assert np.array_equal(empty.all(axis=1), lost) and np.array_equal(empty.any(axis=1), lost), name
    assert given["no_load_steps"] == lost.sum() == locked.summary["no_load_steps"] and given["steps"] == len(lost)
    assert all("count as zero" in text for text in texts.values())
    np.testing.assert_allclose(panels["mean_load"], np.nan_to_num(panels["load"]).mean(axis=0), rtol=1e-12)
    with Run(locked.dir) as run:
        (values,) = (x for load, x in loads.of_run(run)[0] if load.name == "panel_load")
    first, last = np.flatnonzero(lost)[0], np.flatnonzero(~lost)[-1]
    assert np.isfinite(values).all() and np.array_equal(values[first], values[first - 1]) and np.array_equal(
        values[last], panels["load"][last])


def test_what_contacts_do_in_a_step_without_a_solution_is_no_number(locked):
    lost, work = locked.series("locked", "contact_work")
    assert lost.sum() > 3 and np.array_equal(np.isnan(work), lost == 1) and locked.summary["contact_work_j"] is None
    with Run(locked.dir) as r, h5py.File(locked.dir / "result.h5") as f:
        step = np.rint(r.frame_times / 0.1).astype(int)
        there = np.isin(step, np.flatnonzero(lost) + 1)
        for name in ("contact_force", "net_force"):
            x = f[f"frames/{name}"][()].reshape(len(step), -1)
            assert np.isnan(x[there]).all() and np.isfinite(x[~there]).all(), name
        k = np.flatnonzero(there)[0]
        assert not there[k - 1] and np.array_equal(r.least_contact_force(k), r.contact_force(k - 1))


def test_pages_of_a_run_say_at_least(locked, tmp_path):
    with Run(locked.dir) as r:
        share = f"in {100 * r.number('window.no_load_share'):.2g} % of the steps the load has no bound"
        assert share in r.mean_name and isinstance(r.interval("ice_resistance")[0], AtLeast)
        head = {name.split(",")[0]: value for name, value, _ in report_run.figures(r)}
        assert all(head[name].startswith("at least ") for name in (
            "ice resistance", "tow force", "largest ice resistance in a step", "largest peak of a collision"))
        rows = {name.split(",")[0]: value for name, value, *_ in report_run.forces(r)}
        assert rows["95 % of the step means are below"].startswith("at least ") and "at least" not in rows["drag"]
        assert rows["standard deviation of the ice resistance"] == "–"
        assert all(row["ratio"] == "–" or row["ratio"].startswith("at least ") for row in report_run.estimates(r))
        hits = report_run.impacts(r)
        assert all(peak.startswith("at least ") for *_, peak in hits["exceedance"]) and hits["exceedance"]
        assert dict((what, value) for what, value, _ in report_run.quality(r))["contact work"] == "–"
    points = [plot_resistance.read(locked.dir)]
    assert "90 % ice adds at least " in plot_resistance.words(points) and share in plot_resistance.words(points)
    assert "| at least " in plot_resistance.table(points) and share in plot_resistance.table(points)
    for name in ("plot-resistance", "plot-force", "plot-impacts", "report"):
        where = tmp_path / ("x.html" if name == "report" else f"{name}.svg")
        drawn = script(name, locked.dir, "-o", where)
        assert drawn.returncode == 0, drawn.stderr
        assert "at least" in where.read_text(encoding="utf-8"), name


def test_a_mean_of_runs_of_which_one_is_a_lower_bound_is_one():
    some = [SimpleNamespace(asked=0.9, mean=x, steady=True, change=np.nan, se=1.0, low=0.0, high=9.0, estimates={},
                            unconverged=0.0, warnings=0) for x in (1.0, AtLeast(3.0, 0.5), 5.0)]
    (row,) = plot_resistance.rows(some)
    assert f"{row['mean']:.3g}" == "at least 3" and np.isnan([row["se"], row["low"], row["high"]]).all()


# ---- an ensemble

def made(folder, some, sampling="grid"):
    return Members(made_up.write(folder, some, sampling=sampling))


def statistics(e, **options):
    return ensemble.statistics(e, argparse.Namespace(**OPTIONS | {"resamples": 1} | options))


def field(k, share=0.0, **more):
    return made_up.member(np.full(40, 100.0 + k) + np.sin(np.arange(40)), {"ice.concentration": 0.9}, 0,
                          window={"no_load_share": share, "verdict": "steady"}, **more)


def failed(reason, hole=None):
    return field(0, status=made_up.FAILED, reason=reason, hole=hole)


def test_tows_that_ended_for_want_of_a_solution_bound_nothing(tmp_path):
    """Those that are left are the ones which the ice let pass. Red when such members are failures like any other, or
    others like them, or when they are known by the words of their reason."""
    e = made(tmp_path / "a", [field(k) for k in range(6)] + [failed("in other words", "no_solution")])
    s = statistics(e)
    (c,) = s["conditions"]
    assert c["without_bound"]["ended"] == ["c001-r007"] and c["without_bound"]["some"] == []
    assert "1 of 7 tows ended for lack of a solution" in c["without_bound"]["words"]
    assert isinstance(c["resistance"]["mean"], AtLeast) and np.isnan(c["resistance"]["t_95"]).all()
    text = ensemble_text.report(s)
    assert f"at least {text_table.number(float(c['resistance']['mean']))}" in text and "c001-r007" in text
    other = statistics(made(tmp_path / "b", [field(k) for k in range(6)]
                            + [failed("step 3: it is none of guard.no_solution")]))
    assert other["conditions"][0]["without_bound"]["words"] == ""
    assert not isinstance(other["conditions"][0]["resistance"]["mean"], AtLeast)


def test_to_leave_such_tows_out_makes_no_number_of_the_others(tmp_path):
    e = made(tmp_path / "a", [field(k, 0.2 * (k > 4)) for k in range(6)])
    (c,) = statistics(e, exclude=["unbounded"])["conditions"]
    assert c["members"]["excluded"] == 1 and c["without_bound"]["some"] == ["c001-r006"]
    assert c["without_bound"]["share"] == pytest.approx(0.2 / 6) and isinstance(c["resistance"]["mean"], AtLeast)


def test_no_budget_and_no_capability_of_lower_bounds(tmp_path):
    members = [made_up.member(np.full(3, 1.0 + c), {"ice.friction": c / 9}, c, window={"no_load_share": 0.1 * (c == 8)})
               for c in range(9) for _ in range(2)]
    e = made(tmp_path / "a", members, "latin-hypercube")
    with pytest.raises(RunError, match="no bound in some steps of 2 of 18 tows"):
        budget.of_ensemble(e)
    runs = SimpleNamespace(given=[], make=lambda *_: [ENDED], seconds={}, end=np.inf, jobs=1, path=lambda *_: tmp_path,
                           alike=lambda *_: False)
    search = capability.Search(runs, "ice.concentration", "", 0.1, None, False)
    c = capability.Condition("case", "the case", np.nan, {}, capability.bracket.Bracket(0.2, 0.9, 0.1, 0.5, 6))
    with pytest.raises(RunError, match="that of the other tows"):
        search.add(c, 0.2, 1)


def test_a_study_in_which_ice_locks(tmp_path):
    """From the program to the pages: a condition of tows with such steps, and one of tows that they end."""
    write_case(tmp_path, jam(1, 0.9, run__duration=3))
    (tmp_path / "study.yml").write_text(json.dumps({
        "base": "case.yml", "repeats": 2, "parameters": {"ice.concentration": [0.5, 0.9],
                                                         "guard.no_solution": [0, 0.02]}}))
    call("ensemble", "study.yml", "-o", "out", "--threads", 1, cwd=tmp_path)
    done = script("statistics", tmp_path / "out", "--partial", "--time-scale", 0.2, "--tow-hours", 0.001,
                  "--resamples", 1)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "out/statistics.json").read_text())["conditions"]
    with open(tmp_path / "out/statistics.csv", newline="") as f:
        rows = list(csv.DictReader(f))
    least = [bool(c["without_bound"]["words"]) for c in found]
    assert least[2:] == [True, True] and [row["at_least"] == "1" for row in rows] == least
    some, ended = found[2:]
    assert some["without_bound"]["share"] > 0.05 and float(rows[2]["no_load_share"]) > 0.05
    assert len(ended["without_bound"]["ended"]) == int(rows[3]["ended_without_solution"]) == 2
    tow = some["loads"]["tow_force"]
    assert tow["mean"]["interval_95"] == [None, None] and "no bound" in tow["design"]["refused"]
    assert "refused" in some["extremes"]["over_threshold"]
    table, = [part for part in done.stdout.split("\n\n") if part.startswith("condition") and "bootstrap" in part]
    lines = {line.split("  ")[0]: line for line in table.splitlines()[2:]}
    assert "at least " in lines["guard no solution 0, concentration 90 %"]
    assert ["at least " in line for line in lines.values()].count(True) == 1 + sum(least[:2])
    assert f"{100 * some['without_bound']['share']:.2g} % of the steps of all that finished" in done.stdout
    page = script("report", tmp_path / "out", "-o", tmp_path / "page.html")
    assert page.returncode == 0 and "at least these in" in (tmp_path / "page.html").read_text(encoding="utf-8")
