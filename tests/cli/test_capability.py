# SPDX-License-Identifier: MIT
"""postproc/capability.py: the search of a limit on trials of known chance, and the curve against brute-force runs."""
import argparse
import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy import stats

from harness import BERGTOW, TOW, changed, environment, run, script, write_case

from bergtow.errors import RunError
from bergtow.result import answers
from bergtow.result.run import Run
from bergtow.study import analysis, bracket, capability
from bergtow.study import runs as case_runs
from bergtow.table import written
from bergtow.text import capability as capability_text

THRUST = changed(TOW, run__duration=30, run__dt=0.1, output__window_start=10, domain__length=16, domain__width=6,
                 ice__concentration=0.5, ice__size=0.6, ice__friction=0.2, body__length=1, tow__mode="thrust",
                 tow__speed=0.15, tow__ramp=5, tow__line_length=2, tow__line_stiffness=5000, tow__line_damping=200,
                 tow__vessel__mass=300, tow__vessel__bollard_pull=10, tow__vessel__free_speed=0.5)


def searched(b, chance, rng):
    while (value := b.next()) is not None:
        good = int(rng.random() < chance(value))
        point = b.point(value)
        point.good, point.bad = point.good + good, point.bad + 1 - good
    return b


# ---- the search


def test_how_many_trials_decide():
    assert [bracket.verdict(n, 0) for n in (5, 6)] == ["open", "yes"]
    assert [bracket.verdict(0, n) for n in (5, 6)] == ["open", "no"]
    assert bracket.verdict(11, 1) == "yes" and bracket.verdict(10, 1) == "open" == bracket.verdict(30, 30)
    assert [bracket.least_trials(q) for q in (0.05, 0.3, 0.5, 0.7, 0.8, 0.95)] == [82, 12, 6, 12, 19, 82]
    assert bracket.verdict(40, 12) == "yes" and bracket.verdict(12, 40) == "no"


@pytest.mark.parametrize("share", [0.5, 0.8])
def test_the_evidence_is_a_fair_bet(share):
    """At p = share its mean over all outcomes is 1, and over a thousand looks it is sure in at most LEVEL of tries."""
    for n in (1, 4, 9):
        mean = sum(stats.binom.pmf(k, n, share) * np.exp(bracket.log_evidence(k, n - k, share)) for k in range(n + 1))
        assert mean == pytest.approx(1, abs=1e-12)
    rng, crossed = np.random.default_rng(2), 0
    for _ in range(200):
        good = np.cumsum(rng.random(150) < share)
        crossed += any(bracket.verdict(int(g), k + 1 - int(g), share) == "yes" for k, g in enumerate(good))
    assert crossed / 200 <= bracket.LEVEL + 2 * np.sqrt(bracket.LEVEL / 200)


@pytest.mark.slow
@pytest.mark.parametrize("falls", [True, False])
@pytest.mark.parametrize("scale", [0.001, 0.03])
def test_the_bracket_holds_the_limit(scale, falls):
    """Logistic chances with the limit anywhere; a steep one needs few trials and is found to the resolution."""
    rng, missed, trials, errors = np.random.default_rng(3), 0, [], []
    for _ in range(60):
        limit = rng.uniform(0.5, 0.85)
        sign = 1 if falls else -1
        b = searched(bracket.Bracket(0.3, 0.95, 0.04, most=12),
                     lambda v: 1 / (1 + np.exp(np.clip(sign * (v - limit) / scale, -50, 50))), rng)
        yes, no = b.ends()
        # an end of the range may stay undecided
        right = [v is None or (v - limit) * sign * side <= 0 for v, side in ((yes, 1), (no, -1))]
        missed += not all(right)
        trials.append(sum(p.n for p in b.points.values()))
        errors.append(b.estimate() - limit)
        if scale < 0.01:
            assert abs(no - yes) <= 0.0401 or any(b.point(v).n == 12 for v in b.points)
    assert missed <= 3
    assert np.mean(trials) < (45 if scale < 0.01 else 90)
    assert abs(np.mean(errors)) < 0.01 and np.std(errors) < 0.025


@pytest.mark.parametrize("share, most", [(0.5, 12), (0.2, 38), (0.8, 38)])
def test_the_fields_of_a_value_suffice_for_the_share(share, most):
    """Red: twelve, which cannot decide a share of 80 % if all of them succeed."""
    a = argparse.Namespace(search="ice.concentration", start=None, end=None, set=[], conditions=None, share=share,
                           fields=None)
    capability.check_options(a)
    b = searched(bracket.Bracket(0.2, 0.95, 0.4, share, a.fields), lambda v: 1.0, np.random.default_rng(1))
    assert a.fields == most and b.ends() == (0.95, None) and b.judged(0.2) == bracket.YES


def test_ranges_without_a_limit_and_ends_that_are_open():
    rng = np.random.default_rng(4)
    all_make = searched(bracket.Bracket(0, 1, 0.1), lambda v: 1.0, rng)
    assert all_make.ends() == (1, None) and set(all_make.points) == {0, 1} and np.isnan(all_make.estimate())
    open_end = searched(bracket.Bracket(0, 1, 0.1, most=12), lambda v: 1.0 if v < 0.7 else 0.5,
                        np.random.default_rng(1))
    yes, no = open_end.ends()
    assert 0.6 <= yes < 0.8 and no is None and open_end.point(1.0).n == 12


def tried(counts, **more):
    """A search with these counts: {value: (good, trials)}."""
    b = bracket.Bracket(0.2, 0.95, 0.05, most=12, **more)
    for value, (good, n) in counts.items():
        p = b.point(value)
        p.good, p.bad = good, n - good
    return b


@pytest.mark.parametrize("counts, limit", [({0.2: (6, 6), 0.95: (0, 3)}, 0.575), ({0.2: (4, 6), 0.95: (1, 6)}, 0.45),
                                           ({0.2: (1, 6), 0.95: (4, 6)}, 0.7), ({0.2: (0, 3), 0.95: (6, 6)}, 0.575)])
def test_the_direction_is_that_of_the_trials(counts, limit):
    """Also where an end is undecided, so that there is nothing on one of the sides."""
    assert tried(counts).estimate() == pytest.approx(limit)


def test_what_contradicts_the_bracket_is_reported():
    def found(counts):
        return capability.found_of(capability.Condition("case", "the case", np.nan, {}, tried(counts)))
    hole = {0.2: (6, 6), 0.3875: (2, 4), 0.575: (0, 4), 0.7625: (0, 4), 0.95: (6, 6)}
    one = found(hole)
    assert not one["resolved"] and one["why"] == "perhaps not monotonic: at 0.575 0 of 4 succeed"
    assert np.isnan(one["estimate"])
    assert found(hole | {0.575: (0, 6)})["why"] == "not monotonic: at 0.95 6 of 6 succeed"
    assert found({0.2: (6, 6), 0.575: (3, 4), 0.95: (6, 6)})["why"] == "every value of the range passes"
    fine = found({0.2: (6, 6), 0.5: (6, 6), 0.54: (0, 6), 0.75: (0, 4), 0.95: (0, 6)})
    assert fine["resolved"] and fine["why"] == ""


def test_what_contradicts_the_bracket_is_run_until_it_is_decided(monkeypatch):
    c = capability.Condition("case", "the case", np.nan, {}, tried({0.2: (6, 6), 0.95: (6, 6)}))
    search = capability.Search(type("Runs", (), {"jobs": 2}), "ice.concentration", "", 0.1, None)
    def add(c, value, n):
        c.search.point(value).bad += n
        return True
    monkeypatch.setattr(search, "add", add)
    search.fill(c, 3, 4)
    assert c.search.point(0.575).bad == 6 and capability.contradiction(c.search).startswith("not monotonic")


# ---- trials and runs


class Told(Run):
    """A run by its series."""

    case = path = events = summary = None

    def __init__(self, x, y=None, case=None, passed=()):
        self.case, self.path = {"tow.speed": "1 m/s"} | (case or {}), "told"
        self.events = [{"kind": "waypoint", "subject": k + 1, "time_s": t} for k, t in enumerate(passed)]
        self.series = {"time": np.arange(float(len(x))), "body_x": np.asarray(x, dtype=float),
                       "body_y": np.zeros(len(x)) if y is None else np.asarray(y, dtype=float)}
        self.summary = {"window": {"start_s": 0.0, "end_s": len(x) - 1.0}, "stalled_windows": 0}

    def __getitem__(self, name):
        return self.series[name]

    def __contains__(self, name):
        return name in self.series


def test_a_tow_that_has_come_to_rest_does_not_make_it():
    """However long it went before: the mean over the window alone tells when the window ends."""
    rests = Told(np.minimum(np.arange(101.0), 70))
    rests.summary["stalled_windows"] = 3
    one = capability.trial(rests, 1, 0.1)
    assert one.speed == pytest.approx(0.7) and one.late == 0 and one.stood and not one.made
    paused = capability.trial(Told(np.concatenate([np.arange(50), np.full(20, 50), np.arange(50, 81)])), 1, 0.1)
    assert paused.made and paused.late == pytest.approx(1)


def test_a_body_that_is_driven_back_makes_no_way(tmp_path):
    t = np.arange(11.0)
    assert Told(300 - 0.6 * t).speed_made_good == pytest.approx(-0.6)
    assert Told(300 - 0.6 * t, case={"tow.direction": "3.14159265358979 rad"}).speed_made_good == pytest.approx(0.6)
    assert Told(0.3 * t, y=np.sin(t)).speed_made_good == pytest.approx(0.3)  # sway
    # round two corners, across its own path, and back along it
    case = {"tow.waypoints": "[[4 m, 0 m], [4 m, 4 m], [2 m, 4 m], [2 m, -9 m]]", "body.x": "0 m", "body.y": "0 m"}
    x, y = [0, 2, 4, 4, 4, 2, 2, 2, 2], [0, 0, 0, 2, 4, 4, 2, 0, -2]
    assert Told(x, y, case, (2, 4, 5)).speed_made_good == pytest.approx(2)
    assert Told(x + x[::-1][1:2], y + y[::-1][1:2], case, (2, 4, 5)).speed_made_good == pytest.approx(14 / 9)
    drifts = changed(THRUST, water__current_x=-0.2, tow__vessel__bollard_pull=1, ice__concentration=0.05, body__x=8,
                     domain__ends="open")
    with Run(run(tmp_path, drifts).dir) as r:
        one = capability.trial(r, 1, 0.01)
        assert one.speed < -0.05 and not one.made


def test_a_tow_that_goes_back_makes_way_on_both_legs():
    """On its own line, and along a leg 10 m beside; when the body comes a line length after what passes the way-point,
    and swings by 6 m; and without the event it is driven back."""
    s = np.arange(0.0, 101.0)
    case = {"tow.waypoints": "[[70 m, 0 m], [20 m, 0 m]]", "body.x": "20 m", "body.y": "0 m"}
    there_and_back = 20 + np.minimum(s, 100 - s)
    assert Told(there_and_back, case=case, passed=[50.0]).speed_made_good == pytest.approx(1)
    assert Told(there_and_back, case=case).speed_made_good == pytest.approx(0)
    # what tows it passes 20 m ahead of it; the body goes on to x = 60 and is towed back from there, 1 m beside
    late = Told(20 + np.minimum(np.minimum(s, 40), 80 - np.minimum(s, 80)), np.full(101, -1.0), case, [30.0])
    assert late.way[-1] == pytest.approx(80) and (np.diff(late.way) >= -1e-9).all()
    beside = {"tow.waypoints": "[[100 m, 0 m], [100 m, 10 m], [0 m, 10 m]]", "body.x": "0 m", "body.y": "0 m"}
    x = np.concatenate([s, np.full(10, 100.0), s[::-1][1:]])
    y = np.concatenate([6 * np.sin(s / 8) ** 2 * (s < 95), np.arange(1.0, 11.0), np.full(100, 10.0)])
    assert Told(x, y, beside, [100.0, 110.0]).way == pytest.approx(np.arange(0.0, 211.0), abs=1e-9)


def test_a_stop_that_is_ordered_is_no_stop_in_the_ice(tmp_path):
    """Without ice a tow makes it up to the end of its programme, whatever part of the window lies behind that."""
    t = np.arange(0.0, 301.0)
    case = {"tow.programme": "[[0 s, 0 m/s], [20 s, 0.5 m/s], [220 s, 0.5 m/s], [240 s, 0 m/s]]"}
    def told(speed):
        run = Told(np.cumsum(speed), case=case)
        run.summary["window"] |= {"start_s": 100.0}
        return capability.trial(run, 1, 0.4)
    ordered = np.interp(t, [0, 20, 220, 240], [0, 0.5, 0.5, 0])
    free, held = told(ordered), told(np.where(t > 180, 0, ordered))
    assert free.speed == pytest.approx(0.5, rel=0.01) and free.late == pytest.approx(0.49, abs=0.01) and free.made
    assert held.late == 0 and not held.made
    stops = changed(THRUST, ice__concentration=0.01, domain__length=30, tow__ramp=None, run__duration=60,
                    output__window_start=20, tow__speed=None,
                    tow__programme=[[0, 0], [5, 0.15], [40, 0.15], [42, 0]])
    with Run(run(tmp_path, stops).dir) as r:
        one = capability.trial(r, 1, 0.1)
        assert one.late > 0.1 and one.made
        assert r.made_good(50, 60) < 0.1
        assert r.ordered_speed == pytest.approx(np.interp(r["time"], [0, 5, 40, 42], [0, 0.15, 0.15, 0]))


def test_a_tow_is_judged_by_a_speed_that_it_is_ordered_to_keep(tmp_path):
    """Red when it is judged by a higher one, over the whole window; and by a tenth of the speed of another tow."""
    stops = {"tow.programme": "[[0 s, 0.5 m/s], [20 s, 0.5 m/s], [30 s, 0 m/s]]"}
    with pytest.raises(RunError):
        capability.trial(Told(np.arange(101.0), case=stops), 1, 0.6)
    for ordered in (0.04, 2.0):
        told = Told(0.03 * np.arange(101.0), case={"tow.speed": f"{ordered} m/s"})
        one = capability.trial(told, 1, None)
        assert one.least == pytest.approx(ordered / 10) and one.made == (ordered < 0.3)
    assert "tow.speed" in found_in(tmp_path, THRUST, "--speed", 0.2, code=2)
    assert "tow.speed" in found_in(tmp_path, THRUST, "--speed", 0.1, "--for", "tow.speed=0.05,0.15", code=2)
    assert "tow.speed" in found_in(tmp_path, THRUST, "--speed", 0.1, "--search", "tow.speed", "--from", 0.05, "--to",
                                   0.15, code=2)
    assert not (tmp_path / "out").exists()  # no run was made


def found_in(folder, case, *more, code=0):
    write_case(folder, case)
    done = script("capability", "case.yml", "-o", "out", *more, cwd=folder)
    assert done.returncode == code, done.stderr
    if code:
        return done.stderr
    return json.loads((folder / "out/capability.json").read_text()), done.stdout


def brute(folder, value, n):
    """Speeds over the window in n other fields, by plain runs."""
    speeds = []
    for i in range(n):
        out = folder / f"brute-{value:g}-{i}"
        done = subprocess.run([BERGTOW, "run", "case.yml", "-o", out, "--quiet", "--threads", "1", "--set",
                               f"ice.concentration={value}", "--set", f"ice.seed={70 + i}"], cwd=folder,
                              env=environment(), capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        with Run(out) as run:
            start, end = run.window
            x = np.interp([start, end], run["time"], run["body_x"])
        speeds.append((x[1] - x[0]) / (end - start))
    return np.array(speeds)


@pytest.mark.slow
def test_the_limit_of_concentration_against_brute_force(tmp_path):
    found, text = found_in(tmp_path, THRUST, "--from", 0.3, "--to", 0.9, "--speed", 0.1, "--points", 2, "--budget", 3,
                           "--resolution", 0.15)
    one = found["conditions"][0]
    assert 0.5 <= one["makes_it"] < one["does_not"] <= 0.9 and one["makes_it"] <= one["estimate"] <= one["does_not"]
    for p in one["points"]:
        speeds = brute(tmp_path, p["value"], 6)
        # the curve: one mean of other fields within the scatter of both, at 99.9 %
        t = stats.ttest_ind(p["speed"], speeds, equal_var=False)
        assert t.pvalue > 1e-3 or abs(p["mean_speed"] - speeds.mean()) < 0.002, (p["value"], p["speed"], speeds)
        if p["value"] == one["makes_it"]:
            assert np.mean(speeds >= 0.1) >= 3 / 6
        if p["value"] == one["does_not"]:
            assert np.mean(speeds >= 0.1) <= 3 / 6
    assert one["runs"] < 0.6 * found["grid_runs"] and f"{one['runs']} runs in" in text
    speeds = [p["mean_speed"] for p in one["points"]]
    assert all(p["body_widths"] == pytest.approx(6, rel=0.01) for p in one["points"])
    assert all(p["body_widths_needed"] == (30 if p["value"] >= 0.7 else 10 if p["value"] >= 0.45 else None)
               for p in one["points"] if abs(p["value"] - 0.85) > 0.05 and p["value"] < 0.85)
    assert "WARNING: at" in text
    assert 0.12 < speeds[0] < 0.16 and speeds[-1] < 0.09 and len(one["points"]) >= 3
    assert (tmp_path / "out/capability.png").stat().st_size > 20_000
    # the same call makes no run again
    before = {p: p.stat().st_mtime_ns for p in tmp_path.glob("out/capability/**/summary.json")}
    again, _ = found_in(tmp_path, THRUST, "--from", 0.3, "--to", 0.9, "--speed", 0.1, "--points", 2, "--budget", 3,
                        "--resolution", 0.15)
    assert again["conditions"] == found["conditions"]
    assert before == {p: p.stat().st_mtime_ns for p in tmp_path.glob("out/capability/**/summary.json")}


@pytest.mark.slow
@pytest.mark.parametrize("more", [(), ("--keep-width",)])
def test_dense_ice_gets_the_width_that_it_needs(tmp_path, more):
    """Red when a tow stops in dense ice because its periodic images are near."""
    case = changed(THRUST, domain__sides="periodic", run__duration=10, output__window_start=5)
    found, text = found_in(tmp_path, case, "--from", 0.3, "--to", 0.5, "--points", 0, "--budget", 3, "--fields", 6,
                           "--resolution", 0.2, *more)
    loose, dense = found["conditions"][0]["points"]
    assert loose["body_widths"] == pytest.approx(6, rel=0.01) and loose["wider"] is None
    assert dense["body_widths"] == pytest.approx(6 if more else 10, rel=0.01)
    assert ("At 50.0 % the domain was made 10.1 m wide" in text) == (not more)
    assert ("WARNING: at 50.0 % the domain is narrow" in text) == bool(more)


OPEN_WATER = changed(THRUST, ice__concentration=0.01, domain__length=30, run__duration=60, output__window_start=45,
                     tow__ramp=1, tow__speed=0.4)


@pytest.mark.slow
def test_the_bollard_pull_that_open_water_asks_for(tmp_path):
    """Hardly any ice: the vessel is enough where its net pull at the speed meets the drag of the body."""
    found, text = found_in(tmp_path, OPEN_WATER, "--search", "tow.vessel.bollard_pull", "--from", "1 N", "--to", "60 N",
                           "--speed", 0.2, "--points", 0, "--budget", 3, "--resolution", "4 N")
    one = found["conditions"][0]
    assert one["resolved"] and one["makes_it"] > one["does_not"]
    # net pull B (1 - (v / v_free)^2) = drag at 0.2 m/s, by a run that holds it
    held = changed(OPEN_WATER, tow__mode="speed", tow__speed=0.2)
    for key in [k for k in held["tow"] if k not in ("mode", "speed", "ramp")]:
        del held["tow"][key]
    write_case(tmp_path, held, "held.yml")
    subprocess.run([BERGTOW, "run", "held.yml", "-o", "held", "--quiet"], cwd=tmp_path, env=environment(), check=True,
                   capture_output=True)
    needed = json.loads((tmp_path / "held/summary.json").read_text())["mean_drag_force_n"] / (1 - 0.4 ** 2)
    assert one["does_not"] - 1 <= needed <= one["makes_it"] + 1
    assert "N" in text.splitlines()[2]


@pytest.mark.parametrize("key, unit, words", [("tow.direction", "rad", "30.0 deg"), ("ice.concentration", "", "52.4 %"),
                                              ("ice.size", "m", "0.524 m"), ("tow.line.breaking_load", "N", "0.524 N")])
def test_a_value_reads_as_users_write_it(key, unit, words):
    assert capability_text.value({"search": key, "unit": unit}, 0.5236) == words


@pytest.mark.slow
def test_a_line_that_parts_is_no_tow(tmp_path):
    case = changed(THRUST, tow__mode="line", tow__line__breaking_load=9, run__duration=20)
    del case["tow"]["vessel"]
    found, text = found_in(tmp_path, case, "--from", 0.3, "--to", 0.9, "--points", 0, "--budget", 0.5, "--fields", 6,
                           "--resolution", 0.6)
    points = found["conditions"][0]["points"]
    assert points[-1]["parted"] == points[-1]["fields"] and points[-1]["made"] == 0
    # whenever it parts: no speed nor force of a body that drifts, and the tension by which it parted
    for p in points:
        assert sum(x is None for x in p["tow_force"]) == p["parted"] == sum(x is None for x in p["speed"])
        assert sum(x > 9 for x in p["tension"]) == p["parted"]
    assert points[-1]["mean_tow_force"] is points[-1]["mean_speed"] is None and points[-1]["mean_tension"] > 9
    assert "a field has no speed and no tow force" in text
    axes = capability_text.figure(found).axes[1]
    assert sum(len(line.get_xdata()) for line in axes.lines if line.get_marker() == "x") == sum(
        p["parted"] for p in points)
    assert "no branch of its line parts" in text and found["breaking_load"] == 9


def test_what_is_refused(tmp_path):
    assert "mode speed, which no ice stops; set tow.mode to thrust" in found_in(tmp_path, TOW, code=3)
    assert "say its range with --from and --to" in found_in(tmp_path, THRUST, "--search", "ice.friction", code=2)
    assert "unknown key" in found_in(tmp_path, THRUST, "--set", "ice.sise=1", code=3)
    assert "no extent" in found_in(tmp_path, THRUST, "--from", 0.5, "--to", 0.5, code=2)
    for words in ("ice.thickness=1m,1m", "ice.thickness=1 m,100 cm", "ice.shape=voronoi,voronoi"):
        assert "the same case" in found_in(tmp_path, THRUST, "--for", words, code=2)
    assert "no values" in found_in(tmp_path, THRUST, "--for", "ice.thickness", code=2)
    for more in (("--for", "ice.concentration=0.5,0.6"), ("--set", "ice.concentration = 0.5"),
                 ("--for", "ice.thickness=1,2", "--set", "ice.thickness=1")):
        assert "is given by more than one of --search, --for and --set" in found_in(tmp_path, THRUST, *more, code=2)
    square = {"type": "Polygon", "coordinates": [[[8, 0], [9, 0], [9, 1], [8, 1], [8, 0]]]}
    (tmp_path / "floes.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {}, "geometry": square}]}))
    case = changed(THRUST, ice__outlines="floes.geojson", ice__outlines_crs="frame", ice__concentration=None,
                   ice__size=None)
    assert "the ice of this case is read, so that every field is the same" in found_in(tmp_path, case, code=3)
    assert "80 %: is not above 0 and at most" in found_in(tmp_path, THRUST, "--resolution", "80 %", code=2)  # read
    assert "0.05 to 0.95" in found_in(tmp_path, THRUST, "--share", 1, code=2)
    assert "6 fields" in found_in(tmp_path, THRUST, "--fields", 4, code=2)
    assert "19 fields" in found_in(tmp_path, THRUST, "--fields", 12, "--share", 0.8, code=2)
    assert "each field has its own seed" in found_in(tmp_path, THRUST, "--set", "ice.seed=3", code=2)


def test_runs_that_fail_are_replaced_and_a_spent_budget_is_reported(tmp_path, monkeypatch):
    """Of twelve fields one fails: that one could not change what eleven say. Two could, and no more are run; and a
    search without time says so."""
    case = write_case(tmp_path, THRUST)
    runs = case_runs.CaseRuns(case, tmp_path, "capability", Path(BERGTOW), [], 1, np.inf, np.inf)
    monkeypatch.setattr(capability, "Run", made_up_run)
    search = capability.Search(runs, "ice.concentration", "", 0.1, None)
    def found_with(failing):
        monkeypatch.setattr(runs, "make", lambda name, fields, sets: [failing(i) for i in fields])
        c = capability.Condition("case", "the case", np.nan, {}, bracket.Bracket(0.2, 0.8, 0.2, most=12))
        search.find(c)
        return c, capability.found_of(c)
    c, found = found_with(lambda i: case_runs.Message("diverged") if i == 2 else None)
    assert found["resolved"] and found["points"][0]["failed"] == 1 and found["points"][0]["fields"] == 11
    assert [t.field for t in c.trials[0.2]] == [1, 2, *range(4, 13)]
    _, found = found_with(lambda i: case_runs.Message("diverged") if i % 3 == 2 else None)
    assert not found["resolved"] and found["makes_it"] is None
    # after the second no outcome of twelve fields decides
    assert found["why"] == "at 0.2 2 of 6 runs failed, which leaves it undecided"
    assert not bracket.Bracket(0, 1, 0.1, most=12).decidable(bracket.Point(0.0), 2)
    monkeypatch.setattr(runs, "end", 0.0)
    late = capability.Condition("late", "late", np.nan, {}, bracket.Bracket(0.2, 0.8, 0.2))
    search.find(late)
    assert late.why == case_runs.SPENT.text and not capability.found_of(late)["resolved"]


def test_a_budget_that_reaches_for_no_run_is_an_error(tmp_path):
    said = found_in(tmp_path, THRUST, "--from", 0.3, "--to", 0.5, "--budget", 1e-6, code=6)
    assert "the budget is not enough for a run" in said and not list(tmp_path.glob("**/capability.json"))


def test_without_ice_there_is_one_run_and_no_interval(tmp_path):
    """All fields are that run: red when it counts once for each of them."""
    found, _ = found_in(tmp_path, THRUST, "--from", 0, "--to", 0.3, "--speed", 0.1, "--points", 2, "--budget", 3,
                        "--fields", 6, "--keep-width")
    open_water = found["conditions"][0]["points"][0]
    assert open_water["value"] == 0 and open_water["fields"] == len(open_water["speed"]) == 1
    assert open_water["mean_speed_95"] == [None, None] and open_water["mean_speed"] > 0


class made_up_run(Told):
    """A run whose body keeps 0.15 m/s below a concentration of 0.5, and stops above."""

    def __init__(self, path):
        super().__init__((0.15 if float(path.parents[1].name) < 0.5 else 0.0) * np.arange(11.0))

    def __enter__(self):
        return self

    def __exit__(self, *exc):
        return False


def test_its_block_for_a_report(tmp_path):
    assert answers.read("capability", tmp_path) is None
    point = {"value": 0.5, "fields": 2, "made": 2, "parted": 0, "failed": 1, "speed": [0.4, 0.5], "mean_speed": 0.45,
             "mean_speed_95": [0.2, 0.7], "tow_force": [1e5, 2e5], "mean_tow_force": 1.5e5,
             "mean_tow_force_95": [None, None], "tension": [2e5, None], "mean_tension": None,
             "mean_tension_95": [None, None]}
    hard = point | {"value": 0.9, "made": 0, "mean_speed_95": [None, None]}
    rows = [{"label": f"ice.thickness {h} m", "for": h, "makes_it": 0.5, "does_not": None, "estimate": 0.8,
             "resolved": False, "why": case_runs.SPENT.text, "runs": 5, "points": [point, hard]} for h in (0.5, 1.0)]
    found = {"case": "case.yml", "title": "a $ in the title", "set": [], "search": "ice.concentration", "unit": "",
             "range": [0.2, 0.95], "resolution": 0.05, "for": "ice.thickness", "for_unit": "m", "speed": 0.3,
             "share": 0.5, "most_fields": 12, "breaking_load": 1e6, "budget_min": 5, "spent_min": 1, "grid_runs": 300,
             "conditions": rows}
    (tmp_path / "capability.json").write_text(json.dumps(found))
    block = analysis.chapter("capability", answers.read("capability", tmp_path))
    said = written(block["parts"], True)
    assert "| 0.5 m | 50.0 % | – | 80.0 % | 5 | not resolved: the budget is spent |" in said
    assert "| stood still | failed runs |" in said and "| 2 of 2 | – | 1 |" in said
    assert "150 kN" in said and "4 runs failed" in said
    assert "WARNING" not in said  # of an earlier program: nothing tells
    hard |= {"body_widths": 31.2, "body_widths_needed": 77.0}
    (tmp_path / "capability.json").write_text(json.dumps(found))
    said = written(analysis.chapter("capability", answers.read("capability", tmp_path))["parts"])
    assert "WARNING: at 90.0 % the domain is narrow for its ice (31.2 body widths; up to 77 are asked for)" in said
    axes = block["figure"]().axes
    assert [a.get_xlabel() for a in axes] == ["concentration, %", "concentration, %", "ice.thickness, m"]
    for row in rows:
        row["estimate"] = None
    (tmp_path / "capability.json").write_text(json.dumps(found))
    block = analysis.chapter("capability", answers.read("capability", tmp_path))
    assert len(block["figure"]().axes) == 2  # no limit, no panel of it
    assert "breaking load" not in [line.get_label() for line in axes[1].lines]  # far above
    assert axes[1].get_ylabel() == "largest line tension, kN" and axes[0].lines[-1].get_ydata()[0] == 0.3


@pytest.mark.parametrize("search, unit, ends", [("tow.line.breaking_load", "N", (5e5, 3e6)),
                                                ("ice.concentration", "", (0.3, 0.7))])
def test_a_breaking_load_that_varies_is_drawn_as_the_tows_had_it(search, unit, ends):
    """Red: one line for all, at the load of the case file; a panel over the values that have a speed alone, in N."""
    def point(value, load):
        there = load < 2e6
        return {"value": value, "fields": 2, "made": 0, "parted": 0, "failed": 0, "stood_still": 0,
                "breaking_load": load, "speed": [None if there else 0.5] * 2, "mean_speed": None if there else 0.5,
                "mean_speed_95": [None, None], "tension": [min(load, 2e6)] * 2, "mean_tension": min(load, 2e6),
                "mean_tension_95": [None, None], "tow_force": [None] * 2, "mean_tow_force": None}
    loads = [ends] if unit else [(1.5e6, 1.5e6), (3e6, 3e6)]
    found = {"case": "case.yml", "title": "", "search": search, "unit": unit, "range": list(ends), "for": "",
             "for_unit": "", "speed": 0.3, "share": 0.5, "most_fields": 6, "breaking_load": None, "budget_min": 1,
             "spent_min": 1, "grid_runs": 12, "conditions": [
                 {"label": f"line {k}", "for": None, "makes_it": None, "does_not": None, "estimate": None, "runs": 4,
                  "resolved": True, "why": "", "points": [point(v, load) for v, load in zip(ends, some)]}
                 for k, some in enumerate(loads)]}
    left, right = capability_text.figure(found).axes
    drawn = [line for line in right.lines if line.get_label() == "breaking load"]
    assert [tuple(line.get_ydata()) for line in drawn] == [tuple(x / 1e6 for x in some) for some in loads]
    assert left.get_xlim() == right.get_xlim()
    assert left.get_xlim()[0] < min(drawn[0].get_xdata()) < max(drawn[0].get_xdata()) < left.get_xlim()[1]
    assert left.get_xlabel() == ("tow.line.breaking_load, MN" if unit else "concentration, %")
    assert "parts" in capability_text.meaning(found)
    found["conditions"][0]["points"][0]["breaking_load"] = None
    capability_text.figure(found)


def test_the_band_of_a_tow_that_is_driven_back_lies_about_its_curve():
    axes = Figure().add_subplot()
    c = {"label": "the case", "points": [
        {"value": v, "fields": 2, "speed": [mean - 0.1, mean + 0.1], "mean_speed": mean,
         "mean_speed_95": [mean - 0.3, mean + 0.3]} for v, mean in ((0.5, 0.2), (0.9, -0.4))]}
    capability_text._curve(axes, c, "speed", "k", 1.0, 1.0)
    band = axes.collections[0].get_paths()[0].vertices
    assert [band[band[:, 0] == v, 1].min() for v in (0.5, 0.9)] == pytest.approx([0.0, -0.5])


def test_the_case_that_it_is_of_is_what_all_its_runs_have_alike(tmp_path):
    """Not what follows from the searched key, so that another study of that vessel is not one of another case."""
    case = changed(THRUST, tow__line__branches=2, run__duration=2, output__window_start=1)
    found, _ = found_in(tmp_path, case, "--search", "tow.vessel.bollard_pull", "--from", 5, "--to", 10, "--for",
                        "tow.line_length=2,3", "--points", 0, "--budget", 0.1)
    assert found["values"]["tow.vessel.free_speed"] == "0.5 m/s"
    assert not {"tow.vessel.bollard_pull", "tow.vessel.free_resistance", "tow.line_length", "tow.branch2.length"
                } & set(found["values"])
