# SPDX-License-Identifier: MIT
"""The window of a run as a user meets it: a start that jerks the line, one that does not, and what the verdict says of
each."""
import json
import math
import re

import pytest
from harness import CASE, DONE, ROOT, TOW, USAGE, call, changed, reasons, run, texts, write_case

# A disc of 80 m on a line of 400 m, almost in open water: 3 million kg per metre of draft and a period of a minute and
# a half.
BERG = {
    "run": {"dt": 1, "duration": 1500},
    "domain": {"frame": "geographic", "length": 1500, "width": 400, "ends": "open", "sides": "periodic"},
    "ice": {
        "concentration": 0.2, "shape": "polygons", "sides": 6, "size": 30, "thickness": 1, "friction": 0.35,
        "restitution": 0, "shake": 2
    },
    "body": {"shape": "disc", "length": 80, "draft": 60, "x": -500, "y": 0},
    "tow": {
        "mode": "line", "speed": 0.5, "direction": 0, "line_length": 400, "line_damping": 100,
        "line": {"type": "dyneema", "diameter": "150 mm", "breaking_load": 0}
    },
    "output": {"frame_interval": 1500},
}


def period(case):
    """Of the berg on its line: mass with added mass over EA / L0."""
    text = case["result"].stdout
    mass = float(re.search(r"([\d.e+]+) kg with added mass", text)[1])
    stiffness = float(re.search(r"EA ([\d.e+]+) N", text)[1]) / 400
    return 2 * math.pi * math.sqrt(mass / stiffness)


@pytest.fixture(scope="module")
def slow(tmp_path_factory):
    return run(tmp_path_factory.mktemp("slow"), BERG)


@pytest.fixture(scope="module")
def jerked(tmp_path_factory):
    return run(tmp_path_factory.mktemp("jerked"), changed(BERG, tow={**BERG["tow"], "ramp": 5}))


def ramp_of(r):
    return float(re.search(r"^  ramp: ([\d.e+]+) s", (r.dir / "case.resolved.yml").read_text(), re.M)[1])


def test_a_ramp_that_is_not_given_follows_from_the_line(slow, tmp_path):
    checked = call("check", write_case(tmp_path, BERG))
    assert (checked.returncode == DONE and "at least 2 periods: ok" in checked.stdout
            and "swings on its line" not in checked.stdout)
    expected = 2 * period({"result": checked})
    assert ramp_of(slow) == pytest.approx(expected, rel=1e-3) and expected > 80 / 0.5
    vx = slow.series("body_vx")
    assert vx.max() < 0.75  # a jerked body swings to twice the speed


def test_a_short_ramp_is_reported_by_check_and_by_the_run(jerked, tmp_path):
    checked = call("check", write_case(tmp_path, changed(BERG, tow={**BERG["tow"], "ramp": 5})))
    assert checked.returncode == DONE and "TOO SHORT: the start jerks the line" in checked.stdout
    assert "tow.ramp: 5 s is short for a body that swings on its line in" in checked.stdout
    assert any("tow.ramp: 5 s is short" in w for w in jerked.warnings)


def test_the_start_is_not_in_the_means(slow, jerked):
    """What the jerk leaves in the mean of the tow force is less than its interval says, or the verdict is not
    steady."""
    s, w = jerked.summary, jerked.summary["window"]
    assert s["start_peak_line_tension_n"] > 5 * s["mean_line_tension_n"] > 0
    assert s["start_peak_line_tension_n"] > 2 * slow.summary["start_peak_line_tension_n"]
    assert s["peak_line_tension_n"] < s["start_peak_line_tension_n"]
    time, tension, tow = jerked.series("time", "line_tension", "tow_force")
    inside = time >= w["start_s"]
    assert s["peak_line_tension_n"] == tension[inside].max() and s["start_peak_line_tension_n"] == tension[~inside].max(
    )
    assert s["mean_tow_force_n"] == pytest.approx(tow[inside].mean(), rel=1e-12)
    x, n = tow[inside], inside.sum()
    quarters = [x[n * k // 4:n * (k + 1) // 4].mean() for k in range(4)]
    assert w["series"]["tow_force"]["quarters_n"] == pytest.approx(quarters, rel=1e-9)
    good = slow.summary
    assert w["verdict"] != "steady" or s["mean_tow_force_low_n"] <= good["mean_tow_force_n"] <= s[
        "mean_tow_force_high_n"]


def test_a_mean_that_is_not_steady_is_called_so(jerked, tmp_path):
    """The given window begins in the swing, and the verdict stands in the console, too."""
    r = run(tmp_path, changed(BERG, tow={**BERG["tow"], "ramp": 5}, run__duration=300, output={"window_start": 0}))
    assert r.summary["window"]["verdict"] == "not steady"
    assert "before the ramp of the tow ends at 5 s" in r.reason
    assert "NOT STEADY" in r.result.stdout and "means over the window, not of a steady tow" in r.result.stdout
    assert "means of the steady tow" not in r.result.stdout


def test_a_berg_adrift_is_no_steady_tow(tmp_path):
    tow = {**BERG["tow"], "ramp": 5, "line": {"type": "dyneema", "diameter": "150 mm"}}
    r = run(tmp_path, changed(BERG, tow=tow, run__duration=600))
    assert r.summary["window"]["verdict"] == "not steady" and "nothing has towed the body since" in r.reason


def test_a_run_within_its_ramp_has_no_window(tmp_path):
    r = run(tmp_path, changed(BERG, run__duration=100))
    assert r.summary["window"]["verdict"] == "too short" and "it would begin at" in r.reason
    assert r.summary["mean_tow_force_n"] is None and "window              none" in r.result.stdout


def test_the_length_of_a_window_is_that_of_its_steps(tmp_path):
    """Its start is the end of its first step."""
    short = run(tmp_path, changed(TOW, run__duration=5, run__dt=0.1, output__window_start=4.5))
    w = short.summary["window"]
    assert w["n_samples"] == 6 and w["start_s"] == pytest.approx(4.5) and w["end_s"] == pytest.approx(5)
    assert "the window of 0.6 s holds" in short.reason
    assert "end of the first step in the window" in call("--list-quantities").stdout


def test_without_a_tow_there_is_no_ice_resistance(tmp_path):
    """The direction of tow is one that nobody chose: a wind from behind would make the resistance negative."""
    free = changed(TOW, run__duration=10, output__window_start=2, tow={"mode": "none"}, body__vx=-0.3)
    r = run(tmp_path, free)
    s = r.summary
    assert [s[f"mean_ice_resistance{k}_n"] for k in ("", "_se", "_low", "_high")] == [None] * 4
    assert "ice resistance    none: nothing tows the body" in r.result.stdout
    said, = [w for w in texts(s["warnings"]) if w.startswith("nothing tows the body, so there is no mean")]
    assert "against tow.direction (0 deg)" in said
    force, resistance = r.series("ice_force_x", "ice_resistance")
    assert abs(force).max() > 0 and (force == -resistance).all()


def test_the_width_of_the_domain_is_reported(tmp_path):
    narrow = changed(BERG, ice__concentration=0.85)
    checked = call("check", write_case(tmp_path, narrow))
    assert re.search(r"domain width +5 body widths, 13\.\d floe sizes, periodic images: arches of rigid floes POSSIBLE",
                     checked.stdout)
    assert "domain.width: 5 body widths of 85 % ice, and periodic images can carry arches" in checked.stdout
    wide = call("check", write_case(tmp_path, changed(narrow, domain__width=5000)))
    assert "arches of rigid floes not expected" in wide.stdout and "can carry arches" not in wide.stdout
    assert call("check", write_case(tmp_path, changed(BERG, tow={**BERG["tow"], "ramp": -1}))).returncode == CASE


def test_check_says_the_same_to_scripts_and_so_does_the_run(tmp_path):
    below = 0
    for c, widths in ((0.3, None), (0.45, 10), (0.7, 30), (0.75, 30), (0.85, 60)):
        path = write_case(tmp_path, changed(BERG, ice__concentration=c, run__duration=5,
                                            tow={"mode": "speed", "speed": 0.5, "ramp": 0},
                                            output__window_start=1, ice__seed=int(100 * c)))
        done = call("check", path, "--json")
        assert done.returncode == DONE, done.stderr
        found = json.loads(done.stdout)
        assert found["domain"] == {"length_m": 1500, "width_m": 400, "across": "domain.width",
                                   "sides": "periodic images", "floe_sizes": pytest.approx(400 / 30),
                                   "body_widths": pytest.approx(5, rel=1e-3), "body_widths_needed": widths,
                                   "packed_s": None, "packed_way_m": None, "packed_concentration": None,
                                   "load_unbounded": c >= 0.75}
        dense = any(w["code"] == "dense_polygons" for w in found["warnings"])
        assert len(found["warnings"]) == (widths is not None) + (c >= 0.75) + dense
        assert found["ice"]["concentration"] == c
        assert found["run"]["n_steps"] == 5 and found["run"]["tow_distance_m"] == 2.5
        assert found["cost"]["core_time_s"] > 0 and found["cost"]["memory_b"] > 1e6
        assert call("run", path, "-o", "out", "--force", cwd=tmp_path).returncode == DONE
        s = json.loads((tmp_path / "out/summary.json").read_text())
        said = ("across", "body_widths", "body_widths_needed", "load_unbounded")
        assert s["domain"] == {k: found["domain"][k] for k in said}
        assert s["n_floes"] == pytest.approx(found["ice"]["floes"], rel=0.1)
        below += widths is not None and s["concentration"] < c
    assert below  # ice as made misses what was asked for in the last digit, and has its rule all the same
    wrong = call("check", path, "--json", "--scale", 2)
    assert wrong.returncode == USAGE and "give only one of them" in wrong.stderr


def test_dense_rigid_ice_says_that_its_load_has_no_upper_bound(tmp_path):
    dense = changed(BERG, ice__concentration=0.8, run__duration=5)
    words = "of rigid floes: above about 75 % (assumed) they lock, and their load has no upper bound"
    assert words in call("check", write_case(tmp_path, dense)).stdout
    assert any(words in text for text in run(tmp_path, dense).warnings)
    for looser in (changed(dense, ice__concentration=0.7), changed(dense, ice__rafting={"kappa": 10}),
                   changed(dense, ice__crushing={"pressure": 1e5})):
        assert "upper bound" not in call("check", write_case(tmp_path, looser)).stdout
    splits = call("check", write_case(tmp_path, changed(dense, ice__splitting={"toughness": 150e3}))).stdout
    assert words.replace("rigid floes", "floes that split into rigid pieces") in splits
    found = json.loads(call("check", write_case(tmp_path, dense), "--json").stdout)["warnings"]
    values, = [w["values"] for w in found if w["code"] == "load_unbounded"]
    assert values == {"concentration_percent": pytest.approx(80), "limit_percent": 75}
    yields = call("check", write_case(tmp_path, changed(dense, ice__rafting={"kappa": 10}))).stdout
    assert "arches of floes POSSIBLE" in yields and "can carry arches of floes" in yields


def test_packed_ice_that_reaches_the_end_wall_is_reported(tmp_path):
    """In basin-80 it was seen at 180 to 200 s: a run of 165 s ends before it, one of 360 s does not."""
    basin = ROOT / "cases/basin/basin-80.yml"
    for duration, wanted in ((165, False), (360, True)):
        checked = call("check", basin, "--set", f"run.duration={duration}")
        assert checked.returncode == DONE and re.search(
            r"wall ahead +reached by packed ice \(0\.9\) at about 206 s, after 25\.8 m of tow \(estimate\)",
            checked.stdout)
        assert ("reaches the wall at about 206 s, 179 s at the earliest" in checked.stdout) == wanted
        assert re.search(r"domain\.length: .* the run ends at 360 s",
                         checked.stdout) if wanted else "domain.length" not in checked.stdout
    # 80 % of ice, 8 m to the wall, a body of half the width: 8 m / (1 + 0.5 * 0.8/0.1) = 1.6 m, at 0.3 m/s from the
    # ramp of 1 s on.
    case = changed(TOW,
                   run__duration=8,
                   domain={"length": 12, "width": 4},
                   ice={"concentration": 0.8, "size": 0.5, "thickness": 0.04},
                   body={"length": 2, "x": 3, "draft": 0.5},
                   tow={"mode": "line", "speed": 0.3, "ramp": 1, "line_length": 2, "line_stiffness": 500})
    long = run(tmp_path, case, name="long")
    said = [w for w in long.warnings if "reaches the wall" in w]
    assert len(
        said) == 1 and "at about 5.8" in said[0] and "the run ends at 8 s" in said[0] and said[0] in long.result.stdout
    short = run(tmp_path, case, "--steps", 45, name="short")
    assert not any("reaches the wall" in w for w in short.warnings)


# 30 m disc at 0.5 m/s; 400 m of ice, or what the domain is set to.
ROUND = {
    "run": {"dt": 2, "duration": 1600},
    "domain": {"frame": "geographic", "length": 400, "width": 300, "ends": "periodic", "sides": "periodic"},
    "ice": {"concentration": 0.4, "size": 25, "thickness": 1},
    "body": {"length": 30, "draft": 20},
    "tow": {"speed": 0.5, "ramp": 0},
    "output": {"frame_interval": 1600},
}
OPENED = "the body meets ice that it has already opened"
# changes, and the time from which on the body meets its own wake: within its own length of the period
WAKES = {
    "along": ({}, 2 * (400 - 30)),
    "across": ({"tow__direction": 90}, 2 * (300 - 30)),
    "held in a current": ({"tow__speed": 0, "water": {"current_x": -0.5}}, 2 * (400 - 30)),
    "with the ice": ({"water": {"current_x": 0.4}}, None),
    "past it": ({"tow__direction": 26.6}, None),
    "beside it": ({"tow__direction": 4}, 2 * (401 - 13)),
    "to and fro": ({"tow__speed": 0, "water": {"tide": {"major": 0.5, "period": 800}}}, None),
    "renewed": ({"domain__ends": "moving"}, None),
    "round a moving window": ({"domain__ends": "moving", "tow__speed": 0.02, "water": {"current_y": -0.5}},
                              2 * (300 - 28)),
    "between walls": ({"domain": {**ROUND["domain"], "length": 900, "ends": "wall"}, "body__x": -440}, None),
    "open water": ({"ice__concentration": 0}, None),
}


@pytest.mark.parametrize("name", WAKES)
def test_a_body_that_comes_to_its_own_wake_is_no_steady_tow(tmp_path, name):
    changes, begins = WAKES[name]
    case = changed(ROUND, **changes)
    if name == "between walls":
        case["body"]["x"] = -400
    checked = call("check", write_case(tmp_path, case)).stdout
    assert (OPENED in checked) == (begins is not None), checked
    if begins is None:
        return
    r = run(tmp_path, case, "--quiet", "--force")
    reason = r.reason
    assert r.summary["window"]["verdict"] == "not steady"
    for text in (checked, reason):
        at = float(re.search(rf"from ([0-9.e+]+) s on {OPENED}", text)[1])
        assert at == pytest.approx(begins, rel=0.03), text


def test_a_resumed_run_knows_where_it_has_been(tmp_path):
    whole = run(tmp_path, ROUND, "--quiet", name="whole")
    run(tmp_path, ROUND, "--quiet", "--steps", 500, name="cut")
    assert call("resume", "cut", "--quiet", cwd=tmp_path).returncode == DONE
    cut = json.loads((tmp_path / "cut/summary.json").read_text())
    assert (cut["window"], cut["state_hash"]) == (whole.summary["window"], whole.summary["state_hash"])
    assert OPENED in reasons(cut)


LEFT = "the body leaves the ice at"


@pytest.mark.parametrize("changes, at", [
    ({}, 400), ({"domain__sides": "open", "tow__direction": 90}, 300),
    ({"tow__speed": 0, "water": {"current_x": -0.5}}, 400), ({"water": {"current_x": 0.25}}, 800),
    ({"domain__ends": "wall", "domain__x0": -200, "domain__length": 1200, "ice__x_max": 200}, 400),
    ({"ice__concentration": 0}, None), ({"run__duration": 300}, None), ({"domain__ends": "periodic"}, None),
    ({"domain__ends": "moving", "ice__x_max": 100}, 200), ({"domain__ends": "moving", "ice__x_max": 220}, None),
    ({"domain__ends": "moving", "ice__x_min": 60, "ice__x_max": 150}, 300),
    ({"domain__sides": "periodic", "domain__ends": "periodic", "ice__y_max": 80, "tow__direction": 90}, 160),
])
def test_a_body_that_leaves_the_ice_is_no_steady_tow(tmp_path, changes, at):
    """Red as "too short ... run longer", with a mean of open water, and without a word in check."""
    case = changed(ROUND, **{"domain__ends": "open", "run__duration": 1000, **changes})
    checked = call("check", write_case(tmp_path, case)).stdout
    assert (LEFT in checked) == (at is not None), checked
    if at is None:
        return
    r = run(tmp_path, case, "--quiet")
    assert r.summary["window"]["verdict"] == "not steady"
    for text in (checked, r.reason):
        assert float(re.search(rf"{LEFT} ([0-9.e+]+) s", text)[1]) == pytest.approx(at, rel=0.02), text


def test_the_region_of_a_field_file_is_its_own(tmp_path):
    """That of the base, without effect on ice that is read, is no end of it."""
    base = changed(ROUND, domain__ends="open", run__duration=800)
    assert call("field", write_case(tmp_path, base), "-o", "field.h5", cwd=tmp_path).returncode == DONE
    write_case(tmp_path, changed(base, ice__x_max=0), "base.yml")
    case = {"base": "base.yml", "ice": {"field": "field.h5"}}
    checked = call("check", write_case(tmp_path, case)).stdout
    reason = run(tmp_path, case, "--quiet").reason
    for text in (checked, reason):
        assert float(re.search(rf"{LEFT} ([0-9.e+]+) s", text)[1]) == pytest.approx(400, rel=0.02), text


def test_a_gap_of_a_field_file_is_seen(tmp_path):
    """Red as steady: the case of the file has no ice region of its own. A resumed run knows it as well."""
    base = changed(ROUND, domain__ends="moving", run__duration=600, ice__x_max=100)
    assert call("field", write_case(tmp_path, base), "-o", "field.h5", cwd=tmp_path).returncode == DONE
    case = changed(base, ice={"field": "field.h5", "size": 25})
    checked = call("check", write_case(tmp_path, case), cwd=tmp_path).stdout
    r = run(tmp_path, case, "--quiet", "--steps", 200)
    assert call("resume", "out", "--quiet", cwd=tmp_path).returncode == DONE
    said = reasons(json.loads((r.dir / "summary.json").read_text()))
    for text in (checked, said):
        assert float(re.search(rf"{LEFT} ([0-9.e+]+) s, and enters", text)[1]) == pytest.approx(200, rel=0.02)


def test_a_strip_of_ice_is_left_through_the_open_end(tmp_path):
    """Red with the remedy of a gap: the body stays in the strip, and leaves it where the domain ends."""
    case = changed(ROUND, domain__ends="open", domain__sides="periodic", ice__y_min=-75, ice__y_max=75)
    checked = call("check", write_case(tmp_path, case)).stdout
    assert f"{LEFT} 400" in checked.replace("399", "400") and "set domain.ends: moving, or end the run" in checked


def test_a_window_of_less_than_two_swings_is_too_short(tmp_path):
    """Red as steady with two steps: what does not vary within them."""
    r = run(tmp_path, changed(BERG, ice={"concentration": 0}, output__window_start=1490), "--quiet")
    assert r.summary["window"]["verdict"] == "too short"
    assert "is shorter than 2 swings of the body on its line" in r.reason


def test_a_body_that_does_not_come_on_is_no_steady_tow(tmp_path):
    """A vessel that pulls next to nothing, in open water, where nothing holds the body."""
    case = changed(BERG, ice={"concentration": 0}, run__duration=600, tow={
        "mode": "thrust", "speed": 0.5, "ramp": 10, "line_length": 400, "line_stiffness": "100 MN",
        "line_damping": "500 kN s/m", "vessel": {"mass": "5000 t", "bollard_pull": 100, "free_speed": 8}})
    r = run(tmp_path, case, "--quiet")
    assert r.summary["window"]["verdict"] == "not steady" and "it makes no headway" in r.reason, r.reason


@pytest.mark.parametrize("direction", [0, 180])
def test_where_the_tow_asks_for_no_way_there_is_none_to_miss(tmp_path, direction):
    """A free body has no direction: it may drift either way."""
    case = {"run": {"dt": 1, "duration": 600}, "domain": {
        "frame": "geographic", "length": 4000, "width": 2000, "ends": "open", "sides": "open"},
            "ice": {"concentration": 0, "thickness": 1}, "body": {"length": 100, "x": 2000, "draft": 50},
            "water": {"current_x": -0.3}, "tow": {"mode": "none", "direction": direction}}
    r = run(tmp_path, case, "--quiet")
    assert "headway" not in json.dumps(r.summary["window"]), r.summary["window"]


def test_the_step_is_held_against_the_speed_of_the_ice(tmp_path):
    """Red at the 0.02 m/s of the tow: the ice comes at 0.5."""
    case = changed(ROUND, domain__ends="moving", tow__speed=0.02, water={"current_x": -0.48}, run__dt=10,
                   ice__drag__sheltering=0)
    checked = call("check", write_case(tmp_path, case)).stdout
    assert "move 0.198 of their size" in checked and "TOO LARGE" in checked, checked
    assert "solver.reference_speed: 0.02 m/s, but the ice approaches at up to 0.494 m/s" in checked, checked
    still = call("check", write_case(tmp_path, ROUND)).stdout
    assert "move 0." not in still and "solver.reference_speed" not in still, still


@pytest.mark.parametrize("dt, sample_every", [(1, 1), (5, 1), (1, 7), (0.8, 1)])
def test_the_window_holds_no_step_of_the_ramp(tmp_path, dt, sample_every):
    """In open water at a prescribed speed the tow force is the drag, without scatter. Red: the step that ends with the
    ramp, whose force is the inertia of the body, was in the window."""
    case = changed(BERG, ice={"concentration": 0}, run={"dt": dt, "duration": 600},
                   tow={"mode": "speed", "speed": 0.5, "ramp": 30}, output__sample_every=sample_every)
    s = run(tmp_path, case, "--quiet").summary
    assert s["window"]["verdict"] == "steady" and 30 < s["window"]["start_s"] <= 30 + 2 * dt
    force = s["window"]["series"]["tow_force"]
    assert force["mean_low_n"] == pytest.approx(force["mean_n"]) and force["peak_n"] == pytest.approx(force["mean_n"])
