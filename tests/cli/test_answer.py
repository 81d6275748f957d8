# SPDX-License-Identifier: MIT
"""The answer of `bergtow design`: coverage of its intervals, closed forms of its load cases, ranges, remedies, and one
call on a small case."""
import html
import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy

import made_up_ensemble as made_up
from harness import BERGTOW, ROOT, TOW, call, changed, write_case
from harness import run as simulated

import bergtow
from bergtow import cli
from bergtow.errors import BergtowError
from bergtow.reporting import design
from bergtow.reporting import ensemble as report_ensemble
from bergtow.result.members import Members
from bergtow.result.run import Run
from bergtow.stats import conditions as stat_conditions
from bergtow.stats import extreme, largest
from bergtow.stats import load as stat_load
from bergtow.stats import loads as stat_loads
from bergtow.stats import mean as stat_mean
from bergtow.stats import profile as stat_profile
from bergtow.study import answer, assumed, gear, load_cases
from bergtow.text import answer as words
from bergtow.text import loads as loads_text


# ---- coverage

def test_the_largest_of_n_covers_whatever_the_distribution():
    """1,000 draws of eight tows: the share of tows below the largest is what it says with 95 % confidence. Red: n + 1
    in place of n, or the confidence in place of one minus it."""
    rng = np.random.default_rng(1)
    for drawn in (rng.gumbel(size=(1000, 8)), rng.pareto(2.0, (1000, 8)), rng.normal(size=(1000, 8))):
        ranks = np.sort(drawn.ravel())
        below = np.searchsorted(ranks, drawn.max(axis=1)) / ranks.size
        assert 0.93 <= np.mean(below >= largest.share_below(8)) <= 0.97
    found = largest.largest_of([3.0, 9.0, 5.0], [1, 1, 1])
    assert found["n"] == 9 and found["share_below"] == pytest.approx(0.05 ** (1 / 3)) and found["n_tows"] == 3
    for share, n in ((0.5, 5), (0.9, 29), (0.95, 59)):  # the fewest tows
        assert largest.share_below(n) >= share > largest.share_below(n - 1)


def known_load(rng, n, shape, rate):
    """Excesses of n fields of an hour of a load whose tail is known: clusters come like a Poisson process."""
    return [((1 - rng.uniform(size=k)) ** -shape - 1) / shape for k in rng.poisson(rate, n)]


def coverage(draws, shape, n=8, rate=8, hours=468.0):
    rng, true, held = np.random.default_rng(2), extreme.growth(shape, rate * hours), 0
    for _ in range(draws):
        each = known_load(rng, n, shape, rate)
        fit = extreme.gpd(np.concatenate(each))
        [(_, (low, high))], _ = extreme.gpd_intervals(each, np.ones(n), 0.0, *fit, [hours])
        held += low <= true <= high
    return held / draws


@pytest.mark.slow
def test_intervals_of_return_levels_hold_the_known_one():
    """1,000 draws of made-up loads with a known level of 468 h, 64 clusters in eight fields."""
    assert 0.93 <= coverage(1000, -0.1) <= 0.97


def test_intervals_of_the_mean_hold_the_known_one():
    """1,000 draws of eight fields of a skewed load, and of a normal one. Red: the normal quantile in place of t's."""
    rng = np.random.default_rng(3)
    for drawn in (rng.normal(size=(8, 1000)), rng.gamma(9.0, size=(8, 1000)) - 9.0):
        low, high = stat_mean.t_interval(drawn)
        assert 0.93 <= np.mean((low <= 0) & (high >= 0)) <= 0.97


# ---- ranges

def test_the_ratio_of_paired_fields():
    """Against all resamples of pairs by hand; fields that differ alike leave no interval. Red: unpaired fields."""
    base = np.array([80.0, 120.0, 100.0, 95.0])
    r, ends = assumed.ratio(base, 1.3 * base)
    assert r == pytest.approx(1.3) and ends == pytest.approx((1.3, 1.3))
    other = 1.3 * base + np.array([2.0, -2.0, 1.0, -1.0])
    r, (low, high) = assumed.ratio(base, other)
    half = scipy.stats.t.ppf(0.975, 3) * np.std(other - r * base, ddof=1) / 2 / base.mean()
    assert (low, high) == pytest.approx((r - half, r + half)) and high - low < 0.2
    assert np.isnan(assumed.ratio([1.0], [2.0])[1]).all() and assumed.ratio([0.0, 0.0], [1.0, 2.0])[0] == 1


def effect(low, high, distribution=None):
    return {"n_low": low, "n_high": high, "distribution": distribution}


def test_band_and_single_figure():
    """The worst corner takes every sign; one figure only where every range has a distribution, by a Monte Carlo of the
    same. Red: variances of the ends in place of those of the distributions."""
    rows = [effect(-30.0, 50.0), effect(20.0, -10.0)]
    assert assumed.band(100.0, rows) == (60.0, 170.0)
    assert assumed.band(100.0, [effect(5.0, 9.0)]) == (100.0, 109.0) and assumed.band(7.0, []) == (7.0, 7.0)
    assert assumed.combined(100.0, (90.0, 110.0), rows) == (None, "range_without_distribution")
    rows = [effect(-30.0, 50.0, "uniform"), effect(-60.0, 60.0, "normal"), effect(-40.0, 40.0, "triangular")]
    assert assumed.combined(100.0, None, rows)[1] == "no_interval_of_fields"
    rng, n = np.random.default_rng(4), 400000
    drawn = 100 + rng.normal(0, 10 / 1.96, n) + rng.uniform(-30, 50, n) + rng.normal(0, 60 / 1.96, n) + rng.triangular(
        -40, 0, 40, n)
    (low, high), why = assumed.combined(100.0, (90.0, 110.0), rows)
    assert why is None and ((low + high) / 2, (high - low) / 2) == pytest.approx(
        (drawn.mean(), 1.96 * drawn.std()), rel=0.01)


def test_ranges_of_a_study(tmp_path):
    (tmp_path / "s.yml").write_text("parameters:\n  ice.friction: {from: 0.1, to: 0.4, distribution: uniform}\n")
    [r] = assumed.read(tmp_path / "s.yml")
    assert (r.key, r.low, r.high, r.distribution, r.source) == ("ice.friction", "0.1", "0.4", "uniform", "assumed")
    (tmp_path / "s.yml").write_text("parameters:\n  ice.friction: [0.1, 0.4]\n")
    with pytest.raises(bergtow.BergtowError, match="ice.friction is not a range; write it as {from"):
        assumed.read(tmp_path / "s.yml")
    assert [r.key for r in assumed.applies(assumed.RANGES, lambda key, default: default, False)] == [
        "body.drag.water_form", "ice.friction"]  # no wind, and floes that do not raft


# ---- closed forms

def tow(**more):
    """A berg of 4.65e8 kg at a knot."""
    line = gear.Line("", np.nan, np.nan, np.nan)
    return load_cases.Tow(**({
        "case": {"tow.mode": "speed"}, "speed": 0.5144, "direction": 0.0, "mass": 4.65e8, "water": 5.5e5, "wind": 0.0,
        "ice": 1e5, "value": 8e5, "kind": "return_level", "interval": (7.5e5, 9e5), "width": 80.0, "area": 5000.0,
        "case_ramp": 155.0, "case_start": np.nan, "scale": 30.0, "slower": 1.0, "distance": 1800.0, "line": line,
        "vessel_mass": np.nan} | more))


def test_coasting_against_the_equation_of_motion():
    """M dv/dt = -D (v/V)^2 - R, by SciPy. Red: 2 left out of the distance."""
    t = tow(wind=2e4)
    def slow(_, x):
        return [x[1], -((t.water + t.wind) * (x[1] / t.speed) ** 2 + t.ice) / t.mass]
    def stopped(_, x):
        return x[1]
    stopped.terminal = True
    found = scipy.integrate.solve_ivp(slow, (0, 1e5), [0.0, t.speed], events=stopped, rtol=1e-10, atol=1e-9)
    assert load_cases.coasting(t) == pytest.approx((found.y[0, -1], found.t[-1]), rel=1e-6)
    assert np.isnan(load_cases.coasting(tow(ice=0.0))).all()


def test_ramp_and_stop():
    t = tow()
    ramp = load_cases.start_ramp(t)
    assert t.mean + t.mass * t.speed / ramp == pytest.approx(t.value)
    assert t.mass * t.speed / load_cases.taut_stop(t) == pytest.approx(t.ice)  # which alone slows the body in the end
    assert load_cases.start_ramp(tow(value=6e5)) == np.inf
    line = gear.Line("", 4e6, 2.6e8, 600.0)
    assert load_cases.start_ramp(tow(line=line)) > ramp  # the line swings


def test_the_load_of_a_tow_that_is_too_slow_is_a_lower_bound():
    """Red: a vessel of 22 t for 1.2 kn, from tows that a weak vessel brought to 0.5 kn."""
    case = {"tow.mode": "thrust", "tow.speed": "0.6 m/s"}
    assert answer.too_slow(case, {"value": 0.26}) and not answer.too_slow(case, {"value": 0.59})
    assert not answer.too_slow(case, None) and not answer.too_slow(case | {"tow.mode": "speed"}, {"value": 0.26})
    members = SimpleNamespace(tows=lambda rows: rows, without_bound=lambda rows: False, _series={}, summary={})
    value = answer.value_of(members, SimpleNamespace(members=[], finished=[0]), {"largest": 2e5}, [], slow=True)
    assert (value["kind"], value["reason"], value["n"]) == ("at_least", "speed_not_reached", 2e5)


def test_a_head_current_takes_the_place_of_that_of_the_case():
    """Along the tow; across it, and where none is given, that of the case stays. Red: their difference, still a current
    from astern."""
    t = tow(direction=0.0, case={"tow.mode": "speed", "water.current_x": "0.2 m/s", "water.current_y": "0.1 m/s",
                                 "air.wind_x": "-5 m/s"})
    row = load_cases.head_sea(t, SimpleNamespace(make=lambda some: "budget"), 0.15)
    assert row["set"] == {"water.current_x": "-0.15 m/s", "water.current_y": "0.1 m/s"}
    assert (row["values"]["current_m_s"], row["values"]["wind_m_s"]) == (0.15, 5.0)


def test_the_ramp_of_a_berg_that_drag_holds_on_a_line():
    """Most of the load is drag, which a berg at rest does not have: the equation of motion stays below the load, and
    reaches nine tenths of it. Red: drag as a force that holds the berg at rest, and a ramp of 14 h."""
    line = gear.Line("", 4e6, 1e8, 300.0)
    t = tow(water=2.62e5, wind=0.0, ice=1.44e4, mass=1.74e8, speed=0.5, value=3.1e5, line=line)
    ramp, dt, k = load_cases.start_ramp(t), 0.5, line.stiffness / line.length
    assert ramp < 3 * 3600
    end = body = v = pull = top = 0.0
    for step in range(int(1.2 * ramp / dt)):
        end += dt * t.speed * min(1.0, step * dt / ramp)
        pull = max(0.0, k * (end - body))
        top = max(top, pull)
        held = t.ice if v > 0 else min(t.ice, pull)
        v = max(0.0, v + dt / t.mass * (pull - held - t.water * (v / t.speed) ** 2))
        body += dt * v
    assert 0.9 * t.value < top < t.value


def test_a_line_that_parts_and_one_that_snaps():
    """Of two springs of which one parts, by the energy of the swing."""
    two = tow(case={"tow.mode": "line", "tow.line.branches": "2"}, line=gear.Line("", 4e6, 2.6e8, 600.0))
    pull, k = two.value, 1.0
    before = pull / (2 * k)
    stretch = scipy.optimize.brentq(lambda x: k * (x * x - before * before) / 2 - pull * (x - before), 1.2 * pull / k,
                                    3 * pull / k)
    assert load_cases.line_parted(two)["n"] == pytest.approx(k * stretch)
    one = load_cases.line_parted(tow())
    assert one["kind"] == "none" and one["reason"] == "single_line_tow_is_lost" and one["values"]["coasts_m"] > 100
    snap = load_cases.loss_of_thrust(two)
    assert snap["n"] > two.speed * math.sqrt(2.6e8 / 600 * 4.65e8) and snap["acts_on"] == "line"
    assert load_cases.loss_of_thrust(tow())["reason"] == "line_not_known"


def test_the_speed_up_to_which_a_vessel_holds():
    """Red: the drag at the speed taken with the first power."""
    v = gear.Vessel("", 1.2e6, 7.2, "assumed", np.nan, np.nan)
    limit = gear.limit_by_drag(v, 0.9, 0.5, 8e5, 5e5)
    assert gear.pull_at(v, limit, 0.9) == pytest.approx(8e5 + 5e5 * ((limit / 0.5) ** 2 - 1), rel=1e-9)
    assert gear.limit_by_drag(v, 0.9, 0.5, 2e6, 5e5) is None
    assert gear.limit_speed([1, 2, 3], [5, 9, 20], [10, 10, 10]) == pytest.approx(2 + 1 / 11)
    assert gear.limit_speed([1, 2], [5, 9], [10, 10]) is None
    assert gear.needed_pull(v, 9e5, 0.5, 0.9) * 0.9 * (1 - (0.5 / 7.2) ** 2) == pytest.approx(9e5)
    assert np.isnan(gear.pull_at(gear.vessel(None, {}), 0.5, 1.0)) and gear.pull_at(v, 9.0, 1.0) == 0  # none is named
    assert gear.verdict(5, (4, 6), 7) == "yes" and gear.verdict(5, (4, 8), 7) == "open"
    assert gear.verdict(9, (8, 10), 7) == "no" and gear.verdict(5, None, np.nan) == "not_asked"
    assert gear.verdict(5, (4, None), 7) == gear.verdict(5, (4, np.inf), 7) == "open"  # no bound above


@pytest.mark.parametrize("text, newtons", [("110 t", 110 * 9806.65), ("1.1 MN", 1.1e6), ("900 kN", 9e5), ("tug", None)])
def test_forces_of_options(text, newtons):
    assert gear.force(text, "--vessel") == newtons


@pytest.mark.parametrize("text", ["110", "3.5e6", " 7 "])
def test_a_force_without_a_unit_is_refused(text):
    """Red: --vessel 110 was a vessel of 110 N, and no tow was feasible."""
    with pytest.raises(BergtowError, match="has no unit; give it as"):
        gear.force(text, "--vessel")


@pytest.mark.parametrize("option, text, value", [
    ("budget", "90", 90), ("budget", "1.5 h", 90), ("concentrations", "70 %,0.5", [0.5, 0.7]),
    ("efficiency", "80 %", 0.8), ("efficiency", "1", 1), ("line-length", "0.5 km", 500),
    ("head-current", "1 kn", 1852 / 3600),
    ("bend", "90", math.pi / 2), ("bend", "-30 deg", -math.pi / 6), ("speeds", "1 m/s,0.5", [1.0, 0.5]),
    ("budget", "3 kn", "a time"), ("concentrations", "97 %", "95 %"), ("efficiency", "1.2", "100 %"),
    ("line-length", "3 kg", "length"), ("head-wind", "-1", "below zero"), ("bend", "400", "150 degrees"),
    ("fields", "x", "whole number"), ("line-factor", "x", "is not a number"),
    ("line-factor", "0.5", "below 1"), ("budget", "inf", "and finite"), ("speeds", "1 kn,", "a speed")])
def test_options_take_units_and_say_what_is_wrong(option, text, value):
    """Red: a bare float() as the type, whose message names a function of the program."""
    words_of = ["design", "case.yml", f"--{option}={text}"]
    if isinstance(value, str):
        with pytest.raises(BergtowError, match=value) as error:
            cli.tree("design").parse_args(words_of)
        assert "invalid" not in str(error.value)
    else:
        assert getattr(cli.tree("design").parse_args(words_of), option.replace("-", "_")) == pytest.approx(value)


def test_tables_that_are_not_there_are_refused_whatever_is_asked():
    """Red: a table is read only where a name is looked up in it."""
    for find in (gear.vessel, gear.line):
        for text in (None, "60 t"):
            with pytest.raises(BergtowError, match="nothere.csv"):
                find(text, {}, "nothere.csv")
    with pytest.raises(BergtowError, match="60 kg: is not a bollard pull.*tug-60.*--vessels"):
        gear.vessel("60 kg", {})


def test_the_drag_of_another_coefficient_is_that_of_the_program(tmp_path):
    """Open water on the real binary with 0.85 and 1.25. Red: the friction under the body counted as form drag."""
    case = changed(TOW, ice__concentration=0.0, run__duration=6, output__window_start=3)
    drag = {}
    for c in (0.85, 1.25):
        (tmp_path / str(c)).mkdir()
        made = simulated(tmp_path / str(c), changed(case, body__drag__water_form=c, body__drag__water_skin=0.05))
        with Run(made.dir) as run:
            drag[c] = run.number("mean_drag_force_n")
            if c == 0.85:
                x, y = run.bodies[run.towed].vertices.T
                t = tow(case=run.case, water=run.number("estimates.open_water_drag.force_n"), width=run.number(
                    "estimates.width_m"), area=0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    row = load_cases.effect(t, assumed.Range("body.drag.water_form", "0.25", "1.25", ""), None)
    assert row["n_high"] == pytest.approx(drag[1.25] - drag[0.85], rel=1e-6)
    assert row["n_per_tenth"] == pytest.approx(row["n_high"] / 4 * 0.85, rel=1e-6)  # 0.4 of the coefficient


# ---- the answer

def ensemble(tmp_path, value=lambda rng: 60 + 10 * rng.gumbel(size=600), n=4):
    rng = np.random.default_rng(5)
    made_up.write(tmp_path / "all", [made_up.member(value(rng), {}, 0) for _ in range(n)])
    return Members(tmp_path / "all")


def test_remedies_name_options_that_exist():
    """Whatever the commands' own texts name is an option of the command that they name, or of design."""
    folder = ROOT / "postproc/bergtow"
    choices = cli.tree("design")._subparsers._group_actions[0].choices
    own = set(re.findall(r"--[a-z][a-z-]+", choices["design"].format_help() + call("ensemble", "--help").stdout))
    for file in ("reporting/design.py", "study/answer.py", "study/gear.py", "study/load_cases.py", "text/answer.py"):
        text = (folder / file).read_text()
        for found in set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", text)):
            assert found in own or f'"{found}"' in text, (file, found)  # in quotes: a word of a call, or of an option
    few = [{"time": np.arange(9.0), "peak": np.arange(9.0), "start": 0.0, "hours": 0.1, "scale": 1.0, "dt": 1.0}]
    found = stat_load.extremes(few, 5.0, [1.0], 1)
    said = " ".join(x["refused"] for x in found.values())
    assert "refused" in found["over_threshold"] and "--" not in said  # a signal has no option that would help


@pytest.mark.parametrize("budget", [3.0, 14.0, 0.4])
def test_a_remedy_does_not_repeat_what_was_given(budget, tmp_path, monkeypatch, capsys):
    """The budget that it names is larger than that which was given. Red: the old words, "raise --budget"."""
    (tmp_path / "out").mkdir()
    made_up.write(tmp_path / "out", [made_up.member(np.ones(3), {}, 0)] * 1)
    for name, value in (("seconds_a_field", 900.0), ("widths", {}), ("fields_settled", 1)):
        monkeypatch.setattr(design, name, lambda *a, value=value: value)
    path = write_case(tmp_path, TOW)
    a = cli.arguments("design", path, "-o", tmp_path / "out", "--budget", str(budget), "--no-replay")
    a.concentrations, a.by_speed = [], {}
    work = SimpleNamespace(ensemble=lambda study: True, jobs=1, began=design.time.monotonic(), core=900.0)
    design.run_case(work, a, {name: {} for name in design.SECTIONS})
    said = capsys.readouterr().err
    assert float(re.search(r"--budget (\d+)", said)[1]) > budget and "run.duration" not in said


@pytest.mark.parametrize("left, n, found", [
    (100, 2, (6, 20.0)),   # three rounds of two, and the replay
    (50, 2, (3, 0.0)),     # two rounds: the fifth field is worth more than a replay
    (20, 2, (0, 20.0)), (-5, 2, (0, 20.0)), (np.inf, 2, (38, 20.0))
])
def test_fields_come_in_whole_rounds(left, n, found):
    """Red: 1.5 rounds for three fields on two cores, of which the last one was stopped at the limit."""
    assert design.more_fields(left, 20.0, n, 40, 1, 2) == found
    assert answer.fields_in(100.0, 20.0, 3, 2) == 3 and answer.fields_in(39.0, 20.0, 3, 2) == 0


def test_no_load_case_begins_that_would_not_end():
    """By the pace of the runs before, with all runs of a pair at once; a shorter one may still fit. Red: the base was
    run, and no time was left for the head sea; runs were begun until the limit stopped them."""
    made, kept = [], set()
    here = SimpleNamespace(jobs=2, end=design.time.monotonic() + 100, kept=lambda name, i: name in kept,
                           make=lambda name, fields, sets: made.append(name) or [None] * len(fields))
    runs = load_cases.Runs(here, range(4), range(2), 600.0, 0.05)  # 30 s a run, 60 s four of them
    assert runs.make({"base": {}, "head-sea": {}}) == "budget" and made == []
    assert runs.make({"course-change": {"run.duration": "2400 s"}}, runs.few) == "budget" and made == []
    assert runs.make({"course-change": {"run.duration": "1200 s"}}, runs.few) is None and made == ["course-change"]
    kept.add("base")
    assert runs.make({"base": {}, "head-sea": {}}) is None and made[1:] == 2 * ["base"] + 2 * ["head-sea"]
    kept.add("head-sea")
    assert runs.make({"base": {}, "head-sea": {}}) is None and len(runs.done) == 2 + 4 + 4  # not again


@pytest.mark.parametrize("first, holds, ramps", [
    (55.0, 0.0, [60, 40, 30]),
    (15.0, 0.0, [20, 10]),         # none is shorter than the time over which loads are averaged
    (15.0, 25.0, [20, 30]),        # that of 20 s is known not to hold
    (15.0, 35.0, [20, 30, 50])])
def test_no_ramp_is_tried_twice(monkeypatch, first, holds, ramps):
    """Ramps are whole time scales. Red: 20, 20 and 20 s, counted as three runs."""
    monkeypatch.setattr(load_cases, "start_ramp", lambda t: first)
    t = tow(scale=10.0, distance=1e6)
    made = []
    runs = SimpleNamespace(make=lambda some, fields: made.extend(some), few=range(2), measured=lambda name, *_: [
        t.value + holds - float(name.removeprefix("start-").removesuffix("s")) * (holds > 0)])
    found, ramp = load_cases.start(t, runs, lambda words: None)
    assert [x["ramp_s"] for x in found["values"]["tried"]] == ramps
    assert made == [f"start-{s}s" for s in ramps] and found["runs"] == 2 * len(ramps)
    assert ramp["verified"] and ramp["s"] == min(s for s in ramps if s > holds)


def test_the_pace_is_that_of_the_runs_themselves(monkeypatch):
    """Red: a head sea takes six times as long, its second round was stopped at the limit, and the start after it was
    held to be as slow."""
    now, made = [0.0], []
    monkeypatch.setattr(load_cases.time, "monotonic", lambda: now[0])
    def make(name, fields, sets):
        made.append(name)
        now[0] += 180.0 if name == "head-sea" else 30.0
        return [None] * len(fields)
    here = SimpleNamespace(jobs=2, end=250.0, kept=lambda name, i: False, make=make)
    runs = load_cases.Runs(here, range(4), range(2), 600.0, 0.05)
    assert runs.make({"head-sea": {}}) == "budget" and made == ["head-sea"]
    assert runs.make({"start": {}}, runs.few) is None and now[0] == 210


CASE = changed(TOW, run={"dt": 0.2, "duration": 40}, output__window_start=10, domain__length=14, domain__width=7,
               ice__concentration=0.3, ice__size=0.9, estimate__length_scale=400)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("answer")
    write_case(folder, CASE)
    patch = pytest.MonkeyPatch()
    patch.setenv("BERGTOW", str(BERGTOW))
    patch.setattr(report_ensemble, "OPTIONS", report_ensemble.OPTIONS | {"resamples": 1})
    patch.setattr(stat_profile, "FINE", 0.3)  # of intervals, most of the time; no test looks at one
    found = bergtow.design(folder / "case.yml", folder / "out", fields=3, vessel="0.001 t", line="150 N", line_factor=2,
                           line_length=3, no_pdf=True, no_replay=True, quiet=True, speeds="0.13 m/s,0.2 m/s",
                           bend_radius=1, head_wind=1)
    patch.undo()
    return found


def said_of(x):
    """Every number below x as the sentence may write it: N, m/s, s, h and shares in the units of the words."""
    if isinstance(x, dict):
        return set().union(*map(said_of, x.values()))
    if isinstance(x, (list, tuple)):
        return set().union(*map(said_of, x))
    if not isinstance(x, (int, float)) or not math.isfinite(x):
        return set(re.findall(r"\d+(?:\.\d+)?", x)) if isinstance(x, str) else set()
    return {words.short(abs(x) * factor, digits) for factor in (1, 1e-3, 1 / words.KNOT, 1 / 60, 60) for digits in (
        2, 3)} | {str(math.ceil(words.tonnes(x))), str(round(100 * x)), words.plain(x)}


def test_every_number_of_the_sentence_is_in_the_rows_that_it_names(made):
    """Red: a number of another row, or a row that is not named; 95 is the confidence, 10 the tenth of the drag."""
    ids = {row["id"]: row for name in ("conditions", "load_cases", "assumed", "speeds") for row in made[name]}
    ids |= {made[name]["id"]: made[name] for name in ("design", "ramp", "band", "vessel", "line", "feasible")}
    for part in made["sentence"]:
        known = said_of([ids[row] for row in part["rows"]] + [made["asked"]]) | {"95", "10"}
        found = re.findall(r"(?<![\w.])\d+(?:\.\d+)?", words.WORDS[part["code"]](part["values"], made))
        assert set(found) <= known, (part, set(found) - known)
    said = words.sentence(made)
    assert all(part["rows"] for part in made["sentence"])
    rows = {row["id"]: row for row in made["load_cases"]}
    assert made["design"]["n"] == rows[made["design"]["row"]]["n"]
    assert f"{words.number(words.designed(made['design']['n']) / 1e3)} kN" in said


def test_the_design_value_is_the_largest_load_case(made):
    cases = made["load_cases"]
    assert [c["id"] for c in cases] == ["case.steady", "case.start", "case.head_sea", "case.course_change", "case.stop",
                                        "case.loss_of_thrust", "case.line_parted"]
    assert made["design"]["n"] == max(c["n"] for c in cases if c["acts_on"] == "tow" and c["n"] is not None)
    assert next(c for c in cases if c["id"] == "case.head_sea")["in_design"]  # given; assumed ones are not
    t = tow(case={"water.current_table": "x"})
    assert load_cases.head_sea(t, None)["reason"] == "environment_from_table"
    assert all(c["n"] is not None or c["reason"] for c in cases)
    assert made["line"]["utilisation"] == pytest.approx(2 * made["line"]["design_tension_n"] / 150)


def test_the_parts_make_up_the_value(made):
    """Ice, water and the rest are the mean tow force; what is above it makes up the value."""
    assert len(made["conditions"]) == 2
    for row in made["conditions"]:
        part = {p["part"]: p["n"] for p in row["parts"]}
        assert sum(part.values()) == pytest.approx(row["value"]["n"])
        assert sum(part.values()) - part["fluctuation"] == pytest.approx(row["mean"]["n"], rel=1e-6)
        assert part["water"] > 0 and part["wind"] == 0


def test_ranges_and_head_sea_are_of_the_same_fields(made):
    first = made["assumed"][0]
    assert first["key"] == "body.drag.water_form" and first["by"] == "analytic"
    low, high = made["band"]["low_n"], made["band"]["high_n"]
    steady = made["load_cases"][0]["n"]
    assert low <= steady + first["n_low"] < steady < steady + first["n_high"] <= high
    assert made["band"]["why_not_combined"] == "range_without_distribution"
    assert [r["key"] for r in made["assumed"]] == ["body.drag.water_form", "ice.friction"]
    assert [r["fields"] for r in made["assumed"]] == [0, 4]
    head = next(c for c in made["load_cases"] if c["id"] == "case.head_sea")
    assert head["n"] > steady and head["values"]["wind_m_s"] == 1 and head["values"]["current_m_s"] == 0


def test_values_that_are_assumed_stay_beside_the_design_value(made):
    """Without --head-current and --head-wind the same row is not in the design value. Red: it decides the vessel."""
    a = json.loads(json.dumps(made))
    row = next(c for c in a["load_cases"] if c["id"] == "case.head_sea")
    row["in_design"] = False
    assert "†" in words.written(words.load_cases(a)) and "assumed" in words.WORDS["beside"](row | row["values"], a)


def test_a_load_case_above_the_steady_tow_does_not_hide_it(made):
    """Red: the largest of two course changes in the sentence, and nothing of the fitted value and its interval."""
    a = json.loads(json.dumps(made))
    steady = next(c for c in a["conditions"] if c["id"] == a["load_cases"][0]["of"])
    steady["value"] |= {"kind": "return_level", "n": 310e3, "interval_95": [308e3, 332e3]}
    for row, codes in (("case.course_change", ["steady"]), ("case.steady", [])):
        a["design"]["row"] = row
        found = [part for part in answer.sentence(a) if part["code"] == "steady"]
        assert [part["code"] for part in found] == codes
        for part in found:
            said = words.WORDS["steady"](part["values"], a)
            assert said.startswith("The steady tow needs 310 kN (95 % interval over fields: 308 to 332 kN)")


def test_the_band_names_the_ranges_that_it_lacks(made):
    """Red: "over the ranges of what is assumed", of which the budget had reached one of three."""
    said = words.WORDS["band"](made["band"] | {"without": ["ice.friction", "ice.rafting.kappa"]}, made)
    assert "without ice.friction and ice.rafting.kappa, whose effect is not known" in said
    assert "without" not in words.WORDS["band"](made["band"], made)


def test_what_the_terminal_remarks_is_on_the_page(made):
    """Red: the assumed free-running speed in the terminal alone, and the tug's own resistance nowhere."""
    page = (Path(made["case"]).parent / "out/report.html").read_text(encoding="utf-8")
    said = words.remarks(made)
    assert any("free-running speed of the vessel is assumed" in text for text in said)
    assert all(html.escape(text) in page for text in said)
    own = {"own_resistance": {"low_n": 2e4, "high_n": 9e4, "source": "S"}, "needed_with_ice_n": [2e5, 9e5]}
    sentence, remarks, _ = report_ensemble.of_answer(made | {"vessel": made["vessel"] | own})
    assert any("20.0 to 90.0 kN, an order of magnitude (S); with it 21 t to 92 t" in text for text in remarks)


def test_the_time_of_a_call_is_in_the_rows_of_its_table(made):
    """Red: the statistics in the total alone."""
    cost = made["cost"]
    assert cost["fields_s"] + cost["statistics_s"] + cost["cases_s"] == pytest.approx(cost["wall_s"])
    assert {"fields", "statistics", "load cases and ranges"} < {
        row[0] for row in words.took(made)[0].rows}


def test_speeds_of_one_call(made):
    """A tow at another speed goes as far; the vessel of the call holds none of them."""
    slow, fast = made["speeds"]
    assert (slow["speed_m_s"], fast["speed_m_s"]) == (0.13, 0.2) and fast["needs_n"] > slow["needs_n"]
    assert {s["feasible"] for s in made["speeds"]} == {"no"} and made["feasible"]["verdict"] == "no"
    assert made["feasible"]["reason"] == "no_speed_is_feasible"
    # the design value is that of the case's speed, also where a faster tow has borne more: the sentence says so
    at = f" at {words.speed(made['asked']['speed_m_s'])} as a mean over "
    assert at in words.sentence(made)
    alone = made | {"conditions": [c for c in made["conditions"] if c["speed_m_s"] == made["asked"]["speed_m_s"]]}
    assert at not in words.sentence(alone) and " as a mean over " in words.sentence(alone)


def test_a_tow_of_a_model_is_shorter_than_the_one_asked_for(made):
    """24 h at full scale, over the square root of the length scale, as in the statistics. Red: 24 h of the model."""
    assert {c["tow_hours"] for c in made["conditions"]} == {24 / 20} and made["asked"]["tow_hours"] == 24
    level = {"kind": "return_level", "n": 8.0, "interval_95": [7.0, 9.0], "case": "case.steady"}
    assert "of tows of 1.2 h exceed" in words.WORDS["needs"](level, made)
    fall_back = {"reason": "no_tail", "n_tows": 3, "hours_each": 0.01, "n": 8.0, "share_below": 0.3}
    assert "a tow of 1.2 h bears more" in words.WORDS["covers"](fall_back, made)
    earlier = [{k: x for k, x in c.items() if k != "tow_hours"} | {"time_scale_s": 1.5} for c in made["conditions"]]
    assert "of tows of 1.2 h exceed" in words.WORDS["needs"](level, made | {"conditions": earlier})
    full = [c | {"time_scale_s": 28.0} for c in earlier]  # four samples of 7 s
    assert "of tows of 24 h exceed" in words.WORDS["needs"](level, made | {"conditions": full})


def test_hours_and_time_scale_are_those_of_the_condition_of_the_value(made):
    """Red: those of the first, which has another length scale."""
    two = [c | {"tow_hours": hours, "time_scale_s": scale}
           for c, hours, scale in zip(made["conditions"], (8, 4), (10, 5))]
    level = {"kind": "return_level", "n": 8.0, "interval_95": [7.0, 9.0], "case": "case.steady"}
    for k, times in enumerate(((8, 10), (4, 5))):
        said = words.WORDS["needs"](level, made | {"conditions": two, "load_cases": [
            {"id": "case.steady", "of": two[k]["id"]}]})
        assert f"over {words.short(times[1], 2)} s" in said and f"tows of {times[0]}.0 h" in said


def test_the_fall_back_is_named(made):
    value = made["conditions"][0]["value"]
    assert value["kind"] in ("largest_of_n", "return_level")
    if value["kind"] == "largest_of_n":
        assert value["n_tows"] == 3 and value["share_below"] == pytest.approx(0.05 ** (1 / 3))
        said = [part for part in made["sentence"] if part["code"] == "covers"]
        assert len(said) == 1 and said[0]["rows"] == ["steady.1"] and "37 % of such tows" in words.sentence(made)


def test_a_load_without_a_bound_is_at_least(tmp_path):
    """Where the line parted the largest stands as a lower bound, with the reason."""
    rng = np.random.default_rng(6)
    made_up.write(tmp_path / "all", [made_up.member(60 + rng.normal(size=600), {}, 0) for _ in range(3)])
    e = Members(tmp_path / "all")
    [c] = e.conditions()
    found = {"design": {"refused": "x"}, "largest": 70.0}
    assert answer.value_of(e, c, None, [])["reason"] == "no_window"
    e._events[1].append({"time_s": 100.0, "kind": "line_broken", "subject": 1, "value": 1.0})
    value = answer.value_of(e, c, found, [])
    assert (value["kind"], value["reason"], value["n"]) == ("at_least", "line_parted", 70.0)


def test_the_answer_and_the_tables_state_the_same_load(tmp_path):
    """A value that is rounded up, for it would be below the largest simulated. Red: 121 kN in the sentence; a number
    that the statistics do not give."""
    e = ensemble(tmp_path)
    [c] = e.conditions()
    found = stat_loads.statistics(e, c.members, answer.options(time_scale=1.0))["tow_force"]
    found["largest"] = 121.185e3
    found["design"] |= {"value": 121.3e3, "interval_95": (118e3, 130e3)}
    value = answer.value_of(e, c, found, [])
    said = loads_text.value({**found["design"], "largest": found["largest"]}, 1e3)[0].rstrip("*")
    assert value["kind"] == "return_level" and f"{said} kN" == words.force(value["n"]) == "122 kN"
    assert words.kn(value["n"]) == "122"


def test_a_tail_that_nothing_bounds_is_no_value(tmp_path):
    """A load with a tail of shape 1: the answer names the largest, the statistics refuse the level with the same
    words, and the answer carries their warnings. Red: the level of such a tail as the load to design for."""
    e = ensemble(tmp_path, lambda rng: 60 + rng.pareto(1.0, size=600), n=6)
    [row] = answer.conditions(e, time_scale=1.0)
    assert row["value"]["kind"] == "largest_of_n" and row["value"]["reason"] == "unbounded_tail"
    fields = stat_loads.gather(e, e.used, answer.options(time_scale=1.0))[0]["tow_force"][1]
    assert row["value"]["n"] == max(f["peak"].max() for f in fields)
    said = words.warnings({"conditions": [row]})
    assert any("the sample does not determine the tail" in text for text in said)


@pytest.mark.parametrize("kind, add, mean", [("normal", -33.0, 0.0), ("exponential", -80.0, 10.0)])
def test_a_level_close_to_zero_has_the_bounds_of_the_same_load_without_mean(tmp_path, kind, add, mean):
    """Red: no bound, since the interval reaches to many times a level that happens to be close to zero."""
    def found(add):
        e = ensemble(tmp_path / f"{add}", lambda rng: add + 10 * getattr(rng, kind)(size=600), n=6)
        [c] = e.conditions()
        o = answer.options(time_scale=1.0)
        s = stat_conditions.condition(e, c, {m: stat_conditions.member(e, m) for m in c.finished}, o)
        # no design value, with marks and warnings, is that of a mean below zero
        return [np.isfinite(level["level_95"]).tolist() for kind in stat_loads.TAILS
                for level in s["loads"]["tow_force"][kind]["levels"]]
    assert found(add) == found(-mean)


def test_thicknesses_and_winds_beside_those_of_the_case():
    """Winds are from ahead, whatever the course. Red: along x on any course."""
    a = SimpleNamespace(thicknesses=[2.0], winds=[10.0])
    case = {"ice.thickness": "1.2 m", "tow.direction": "0 rad", "air.wind_x": "0 m/s", "air.wind_y": "3 m/s"}
    assert design.varied(a, {"case": case}) == {
        "ice.thickness": {"1.2 m": {}, "2 m": {}},
        "air.wind_x": {"0 m/s": {"air.wind_y": "3 m/s"}, "-10 m/s": {"air.wind_y": "0 m/s"}}}
    east = design.varied(a, {"case": case | {"tow.direction": f"{math.radians(120)} rad"}})["air.wind_y"]
    assert east == {"3 m/s": {"air.wind_x": "0 m/s"}, "-8.66025 m/s": {"air.wind_x": "5 m/s"}}
    none = SimpleNamespace(thicknesses=[], winds=[])
    assert design.varied(none, {"case": case}) == {}


def test_the_vessel_has_to_hold_the_largest_load_case():
    """Red: "can tow" by the steady tow, beside a bollard pull that the design value does not leave."""
    v = gear.Vessel("tug", 5e5, 7.0, "assumed", np.nan, np.nan)
    some = [{"speed_m_s": 0.5, "needs_n": 2e5, "interval_95": (1e5, 3e5), "has_n": 4.9e5, "feasible": "yes",
             "kind": "return_level"}]
    def case(name, n, interval=None, kind="changed"):
        return {"id": name, "n": n, "interval_95": interval, "kind": kind}
    t = tow(water=1e5, wind=0.0)
    assert answer.feasible(some, 0.5, v, 1.0, t, [case("case.steady", 2e5, (1e5, 3e5))])["not_above_m_s"] > 0.5
    for n, interval, verdict in ((6e5, None, "no"), (3e5, (2e5, 4e5), "yes"), (4e5, (3e5, 6e5), "open")):
        found = answer.feasible(some, 0.5, v, 1.0, t, [case("case.steady", 2e5, (1e5, 3e5)),
                                                       case("case.head_sea", n, interval)])
        assert (found["verdict"], found["not_above_m_s"]) == (verdict, None)
    # not the largest of them, but the least certain
    found = answer.feasible(some, 0.5, v, 1.0, t, [case("case.steady", 2e5, (1e5, 3e5)),
                                                   case("case.head_sea", 1.9e5, (1e5, 6e5))])
    assert (found["verdict"], found["row"]) == ("open", "case.head_sea")


def test_the_highest_speed_is_by_the_upper_end_of_the_load():
    """Red: by the load itself, up to a speed at which the verdict is "open"."""
    v = gear.Vessel("tug", 5e5, 7.0, "assumed", np.nan, np.nan)
    some = [{"speed_m_s": u, "needs_n": n, "interval_95": (0.9 * n, 1.2 * n), "has_n": 4.9e5, "feasible": "yes",
             "kind": "return_level"} for u, n in ((0.5, 3e5), (1.0, 6e5))]
    limit = answer.feasible(some, 0.5, v, 1.0, None)["not_above_m_s"]
    assert limit == pytest.approx(0.5 + 0.5 * (4.9 - 3.6) / (7.2 - 3.6))


def test_a_lower_bound_is_no_proof_that_a_vessel_can_tow(made):
    """The largest of two course changes outranks the fitted value of the steady tow: a larger one can come, and the
    upper end of the steady tow's interval counts all the same. Red: "can tow", by two runs."""
    v = gear.Vessel("tug", 5e5, 7.0, "assumed", np.nan, np.nan)
    def row(n, kind, interval=None):
        return {"id": "case.course_change", "speed_m_s": 0.5, "concentration": 0.7, "mean": {"n": n}, "value": {
            "n": n, "kind": kind, "interval_95": interval}, "n": n, "kind": kind, "interval_95": interval}
    def verdict(steady, top):
        cases = [steady | {"id": "case.steady"}, top]
        return answer.feasible(answer.speeds([steady], v, 1.0), 0.5, v, 1.0, tow(), cases)["verdict"]
    sure, bound = row(3e5, "return_level", (2e5, 4e5)), row(3.5e5, "largest_of_n")
    assert verdict(sure, bound) == "open" and verdict(sure, row(6e5, "largest_of_n")) == "no"
    assert verdict(row(3e5, "return_level", (2e5, 6e5)), row(3.5e5, "changed", (3e5, 4e5))) == "open"
    for kind, feasible in (("largest_of_n", "open"), ("at_least", "open"), ("constant", "yes")):
        assert answer.speeds([row(3e5, kind)], v, 1.0)[0]["feasible"] == feasible
    a = json.loads(json.dumps(made))
    found = next(c for c in a["load_cases"] if c["id"] == "case.course_change")
    assert found["values"]["share_below"] == pytest.approx(0.05 ** 0.5)
    assert "largest simulated of 2 ‡" in words.written(words.load_cases(a))
    assert "of 2 runs: a lower bound, below which at least 22 % of such runs" in words.WORDS["needs_largest"](
        {"n": found["n"], "case": found["id"]}, a)


def held_back_answer(mean, value, interval, ramp=None):
    """The answer about a steady tow with this mean force, value and interval, N, and a vessel of 500 kN."""
    v = gear.Vessel("tug", 5e5, 7.0, "assumed", np.nan, np.nan)
    row = {"id": "steady.1", "label": "c", "speed_m_s": 0.5, "concentration": 0.3, "fields": 5, "mean": {"n": mean},
           "value": {"kind": "return_level", "n": value, "interval_95": interval}, "time_scale_s": 30.0,
           "start_up": 4e5}
    asked = {"speed_m_s": 0.5, "efficiency": 1.0, "line_factor": None, "line_found": tow().line, "time_scale_s": 30.0,
             "probability": 0.05, "tow_hours": 24.0}
    bend = load_cases.row("course_change", 2.4e5, "largest_of_n", "runs")
    return answer.of(asked, None, [row], [bend], ramp, [], v, tow(water=mean, ice=0.0, value=value), {})


def test_a_start_with_the_ramp_of_the_case_is_a_load_case_until_another_ramp_holds():
    """Red: 300 kN as the design value, beside starts that took 400 kN."""
    ramp = {"s": 600.0, "n": 3e5, "by": "closed_form", "verified": False, "case_s": 60.0, "case_n": 4e5}
    found = held_back_answer(2.8e5, 3e5, [2.9e5, 3.1e5], ramp)
    [row] = [c for c in found["load_cases"] if c["id"] == "case.own_start"]
    assert (found["design"]["row"], found["design"]["n"], row["runs"], row["values"]["ramp_s"]) == (
        row["id"], 4e5, 5, 60.0)
    assert found["feasible"]["verdict"] == "open" and "start as the case orders it" in words.written(
        words.load_cases(found))
    assert "The largest load simulated is 400 kN" in words.sentence(found)
    confirmed = held_back_answer(2.8e5, 3e5, [2.9e5, 3.1e5], ramp | {"by": "runs", "verified": True})
    assert confirmed["design"]["n"] == 3e5


def test_a_body_that_the_current_carries_faster_is_not_towed():
    """Also where the upper tail of its force is above zero. Red: "feasible yes", beside a vessel and a line for the
    magnitude of the force in a bend, and a line that is slack after -3 min."""
    for mean, value in ((-2.8e5, -2.6e5), (-1e4, 2e4)):
        found = held_back_answer(mean, value, [value - 1e4, value + 1e4])
        assert found["design"] is None and [s["feasible"] for s in found["speeds"]] == ["held_back"]
        assert found["feasible"]["verdict"] == "held_back" and found["load_cases"][0]["n"] == value
        assert np.isnan([found["vessel"]["needed_bollard_pull_n"], found["line"]["needed_breaking_load_n"]]).all()
        [part] = found["sentence"]
        assert "must be held back" in words.sentence(found) and part["rows"] == ["steady.1"]
        assert "held back" in words.written(words.speeds(found))
    assert held_back_answer(2.8e5, 3e5, [2.9e5, 3.1e5])["feasible"]["verdict"] == "yes"
    row = {"mean": {"n": 0.0}, "speed_m_s": 0.0, "value": {}}
    assert not answer.held_back(row) and answer.held_back(row | {"speed_m_s": 0.5})  # at rest; on a slack line
    assert np.isnan(load_cases.taut_stop(tow(water=-5e5)))


def bend(**case):
    """The course change of a tow of 3 km at 0.5 m/s that begins at (-1, 0) km of a domain of 3 by 1 km."""
    made = {}
    def make(some, fields):
        made.update(*some.values())
        return "run_failed"
    at = {"body.x": "-1000 m", "body.y": "0 m", "domain.x0": "-1500 m", "domain.y0": "-500 m",
          "domain.length": "3000 m",
          "domain.width": "1000 m", "domain.ends": "open", "domain.sides": "wall", "tow.mode": "speed"} | case
    t = tow(case=at, speed=0.5, distance=3000.0, width=40.0, slower=1.0, case_ramp=100.0, direction=0.0)
    row = load_cases.course_change(t, SimpleNamespace(make=make, few=range(2)), 30.0, 400.0)
    return row, json.loads(made["tow.waypoints"])[0][0] if made else None


def test_a_load_case_without_ice_does_not_vary():
    """Red: the only run as a lower bound of such runs, and no vessel was known to hold it."""
    alone, two = (SimpleNamespace(few=range(n)) for n in (1, 2))
    assert load_cases.few(tow(kind="constant"), alone) == ("constant", {})
    for t, runs in ((tow(), alone), (tow(kind="constant"), two)):  # read ice; ice that the steady tows did not meet
        assert load_cases.few(t, runs)[0] == "largest_of_n"


@pytest.mark.parametrize("along", [2e5, -2e5])
def test_the_force_in_a_bend_keeps_its_sign(along):
    """Red: a body held back in the bend as a pull on the line."""
    runs = SimpleNamespace(make=lambda some, fields: None, few=range(2), measured=lambda name, measure, fields: [along])
    t = tow(case={"body.x": "0 m", "body.y": "0 m", "domain.ends": "periodic", "domain.sides": "periodic",
                  "domain.x0": "0 m", "domain.y0": "0 m", "domain.length": "1 km", "domain.width": "1 km",
                  "tow.mode": "speed"})
    row = load_cases.course_change(t, runs, 30.0, 400.0)
    assert row["n"] == pytest.approx(math.copysign(math.hypot(along, t.mass * t.speed ** 2 / 400), along))


def test_where_a_bend_lies():
    """The corner of a prescribed body is a tangent beyond ramp and settling; on a line it is that of the towing end,
    and a vessel turns as far before as it looks. A bend that leads into a wall is refused. Red: no line; no walls."""
    tangent = 400 * math.tan(math.radians(15))
    row, x = bend()
    assert row["reason"] == "run_failed" and x == pytest.approx(-1000 + 0.5 * (50 + 300) + tangent)
    line = {"tow.mode": "line", "tow.line_length": "300 m", "tow.hull_x": "20 m"}
    assert bend(**line)[1] == pytest.approx(x + 320)
    assert bend(**line | {"tow.mode": "thrust", "tow.vessel.lookahead": "300 m"})[1] == pytest.approx(x + 620)
    assert bend(**{"domain.width": "200 m", "domain.y0": "-100 m"})[0]["reason"] == "domain_too_short"
    assert bend(**{"domain.width": "200 m", "domain.y0": "-100 m", "domain.sides": "periodic"})[1] == pytest.approx(x)


def test_a_body_that_is_held_and_not_towed(tmp_path, monkeypatch, capsys):
    """At a speed of zero there is no start, stop or bend. Red: a division by the speed."""
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    path = write_case(tmp_path, changed(CASE, tow={"mode": "speed", "speed": 0}))
    cli.perform("design", path, "-o", tmp_path / "out", "--fields", "2", "--no-load-cases", "--no-pdf", "--no-replay",
                "--quiet", "--vessel", "60 t")
    found = json.loads((tmp_path / "out/answer.json").read_text())
    assert [c["id"] for c in found["load_cases"]] == ["case.steady", "case.head_sea"] and found["ramp"] is None
    assert "The tow needs" in capsys.readouterr().out


def test_the_plan_is_said_before_the_first_run(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    path = write_case(tmp_path, CASE)
    p = answer.plan(BERGTOW, path, [], 1, 2, 0.001, 40)
    gap = max((2 + 0.9) / 0.13, 30 / 20)
    assert p["needs_hours"] == pytest.approx(20 * 4 * gap / 3600) and p["window_hours"] == pytest.approx(30 / 3600)
    assert p["needs_fields"] == math.ceil(3600 * p["needs_hours"] / 30)
    assert answer.plan(BERGTOW, path, [], 1, 2, np.inf, 9)["budget_fields"] == 9
    assert json.dumps(p) and "A design value needs about" in words.plan(p)


def test_windows_that_are_too_short_for_a_number_are_told_before_the_first_run(tmp_path, monkeypatch):
    """The window is 30 s, and five time scales are 7.5 s of this model, 150 s at full scale. Red: "enough for it", and
    after all runs that no tow force can be named."""
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    path = write_case(tmp_path, changed(CASE, estimate__length_scale=1))
    gives = {scale: answer.plan(BERGTOW, path, [f"estimate.length_scale={scale}"], 1, 2, np.inf, 10 ** 6)["gives"]
             for scale in (1, 24, 26)}
    assert gives == {1: "no_window", 24: "no_window", 26: "return_level"}
    with pytest.raises(BergtowError, match="lengthen run.duration to 160 s, or give the length scale") as error:
        cli.perform("design", path, "-o", tmp_path / "out", "--no-pdf", "--no-replay")
    assert error.value.status == 3 and not (tmp_path / "out/design.yml").exists()
    p = answer.plan(BERGTOW, path, ["output.window_start=-1"], 1, 2, np.inf, 9)  # it may be longer than half of the run
    assert p["gives"] == "no_window" and "as short as that" in words.plan(p)
    def begins(*_):
        raise BergtowError("it runs")
    monkeypatch.setattr(design, "run_case", begins)
    def needs(*options):
        """The run.duration that is asked for; None if the runs begin."""
        with pytest.raises(BergtowError) as error:
            cli.perform("design", path, "-o", tmp_path / "out", "--no-pdf", "--no-replay", *options)
        found = re.search(r"lengthen run.duration to (\d+) s", str(error.value))
        return int(found[1]) if found else None
    own = "--set", "run.duration=161 s", "--set", "output.window_start=10 s", "--set", "tow.speed=0.02"
    assert needs(*own) is None
    longer = needs(*own, "--speeds", "0.04 m/s")  # red: that speed was left out after all runs
    assert longer > 300 and needs(*own, "--speeds", "0.04 m/s", "--set", f"run.duration={longer} s") is None


@pytest.mark.parametrize("dt, every, start, some", [
    (4, 1, 100, {252: False, 255: True, 258: True}), (7, 1, 98, {230: True, 224: False, 238: True}),
    (2, 3, 101, {246: False, 252: True}), (2, 5, 33, {181: False, 201: True}), (1, 1, 0, {149: False, 150: True})])
def test_a_window_holds_whole_samples_as_in_the_statistics(tmp_path, dt, every, start, some):
    """30 s are 8 samples of 4 s, and 4 of 7 s. Red: 152 s of 4 s said to be enough, and 132 s of 7 s too short."""
    path = write_case(tmp_path, changed(CASE, estimate__length_scale=1, tow__speed=0.01))
    for duration, enough in some.items():
        steps = math.ceil(duration / dt)
        time = every * dt * np.arange(1, steps // every + 1)
        first = max(1, math.ceil(start / dt)) * dt + (every - 1) * dt  # Members.window
        assert (stat_load.field_of(time, 0.0 * time, first, steps * dt, 30.0) is not None) == enough
        given = {"run.dt": dt, "run.duration": duration, "output.window_start": start, "output.sample_every": every}
        p = answer.plan(BERGTOW, path, [f"{key}={value}" for key, value in given.items()], 1, 2, np.inf, 9)
        assert (p["gives"] != "no_window") == enough


@pytest.mark.slow
def test_intervals_from_eight_fields_hold_the_mean_of_two_hundred(tmp_path):
    """200 fields of a cheap case stand for the truth; eight of them are drawn 500 times. The interval of their mean
    holds that of all, and the largest of the eight is above the share of tows that it claims."""
    write_case(tmp_path, changed(TOW, run={"dt": 0.2, "duration": 20}, domain={"length": 12, "width": 7},
                                 ice__concentration=0.5, output__window_start=6))
    (tmp_path / "study.yml").write_text("base: case.yml\nrepeats: 200\nseed: 7\n")
    made = call("ensemble", tmp_path / "study.yml", "-o", tmp_path / "all", "--threads", 1, "--jobs", 2, "--quiet",
                timeout=1200)
    assert made.returncode == 0, made.stderr
    e, rng = Members(tmp_path / "all"), np.random.default_rng(8)
    means = e.summary["mean_tow_force_n"]
    assert len(means) == 200 and np.isfinite(means).all()
    drawn = np.array([rng.choice(200, 8, replace=False) for _ in range(500)]).T
    low, high = stat_mean.t_interval(means[drawn])
    assert 0.90 <= np.mean((low <= means.mean()) & (means.mean() <= high)) <= 0.98
    peak = e.summary["peak_tow_force_n"]
    below = np.searchsorted(np.sort(peak), peak[drawn].max(axis=0), side="right") / 200
    assert 0.90 <= np.mean(below >= largest.share_below(8)) <= 0.98
