# SPDX-License-Identifier: MIT
"""What a tow makes of its orders: way over ground, the course of the body behind its line, an end that is overtaken.
Most of it in open water, where the answer is known."""
import json
import re

import numpy as np
import pytest

from harness import CASE, DONE, call, changed, reasons, run, warned, write_case

LINE = {"mode": "line", "speed": 0.5, "ramp": 60, "line_length": 100, "line_stiffness": 1e8, "line_damping": 5e5}
BERG = {
    "run": {"dt": 2, "duration": 2400},
    "domain": {"frame": "geographic", "length": 3000, "width": 2000, "ends": "periodic", "sides": "periodic"},
    "ice": {"concentration": 0, "size": 30, "thickness": 1},
    "body": {"shape": "disc", "length": 60, "draft": 40},
    "tow": LINE, "solver": {"reference_speed": 0.5}, "output": {"frame_interval": -1},
}
VESSEL = {"mass": 2e6, "bollard_pull": 5e4, "free_speed": 5}


@pytest.mark.parametrize("current, said", [(-0.6, "gone astern by"), (-0.1, None)])
def test_a_tow_that_goes_astern_is_not_steady(tmp_path, current, said):
    """The way through the water says nothing of it: that counted as coming on."""
    pull = 5e4 if said else 2e6
    case = changed(BERG, water={"current_x": current}, run={"dt": 4, "duration": 4000},
                   tow=LINE | {"mode": "thrust", "vessel": VESSEL | {"bollard_pull": pull}}, output__window_start=2000)
    r = run(tmp_path, case)
    x = r.series("body_x")
    assert (x[-1] < x[0]) == bool(said)
    assert (said in r.reason) if said else "makes no headway" not in r.reason, r.summary["window"]


def test_a_body_that_overtakes_its_towing_end_is_reported(tmp_path):
    """Along a current faster than the tow the end goes through the hull, and the line pulls from behind."""
    case = changed(BERG, water={"current_x": 0.9}, tow=LINE | {"speed": 0.2}, run={"dt": 2, "duration": 1600})
    assert "past its towing end" in call("check", write_case(tmp_path, case)).stdout
    whole = run(tmp_path, case)
    time = whole.series("time")[np.abs(whole.series("carriage_x") - whole.series("body_x")) < 29.9]
    assert len(time) > 50
    assert warned(whole, "inside the hull for") and "the body has overtaken it" in whole.reason
    found = re.search(r"inside the hull for ([\d.e+]+) s, from ([\d.e+]+) s on", whole.reason)
    assert abs(float(found[1]) - 2 * len(time)) < 10 and abs(float(found[2]) - time[0]) < 6
    part = run(tmp_path, case, "--steps", str(int(time[10] / 2)), name="part")
    assert call("resume", part.dir).returncode == DONE
    assert reasons(json.loads((part.dir / "summary.json").read_text())) == whole.reason
    held = run(tmp_path, changed(case, water__current_x=0), name="held")
    assert not warned(held, "inside the hull") and "overtaken" not in held.reason


def test_a_body_adrift_overtakes_nothing(tmp_path):
    """Its line has parted before the current carries it past the end, which pulls at it no more."""
    tow = {k: v for k, v in LINE.items() if k not in ("speed", "ramp")}
    case = changed(BERG, water={"current_x": 0.9}, run={"dt": 2, "duration": 1000},
                   tow=tow | {"programme": [[0, 2], [60, 2], [70, 0.2]], "line": {"breaking_load": 1}})
    r = run(tmp_path, case)
    assert any(e["kind"] == "adrift" for e in r.summary["events"]), r.summary["events"]
    assert not warned(r, "inside the hull") and "overtaken" not in r.reason
    assert (np.abs(r.series("carriage_x") - r.series("body_x")) < 25).any()


def test_an_end_that_begins_within_the_hull_is_no_overtaking(tmp_path):
    """A short line to the middle of a model, as from a carriage above it."""
    r = run(tmp_path, changed(BERG, tow=LINE | {"line_length": 5, "hull_x": 0, "hull_y": 0}, run__duration=200))
    assert not warned(r, "inside the hull")


@pytest.mark.parametrize("start, end, turns", [(1400, 2000, True), (300, 1300, True), (2100, 2800, False),
                                              (100, 650, False)])
def test_a_turn_takes_its_whole_arc(tmp_path, start, end, turns):
    """1,000 m of radius about way-point 1: from 500 to 2,071 m of the way; its middle is passed at 1,285 m."""
    tow = {"mode": "speed", "speed": 1, "ramp": 0, "waypoints": [[1500, 0], [1500, 3000]], "turn_radius": 1000}
    case = changed(BERG, domain={"frame": "geographic", "length": 5000, "width": 5000, "x0": -500, "y0": -1000,
                                 "ends": "open", "sides": "open"}, tow=tow, output__window_start=start,
                   run__duration=end if end > 700 else 480)
    r = run(tmp_path, case)
    assert ("the course changes by 90 deg at way-point 1" in r.reason) == turns, r.summary["window"]


def test_a_body_on_a_line_follows_for_some_lengths_of_it(tmp_path):
    """After one length of line 40 of 90 degrees are left, by a tractrix; then the heavy body swings out. Red when it
    counts as being on its course after one."""
    tow = LINE | {"waypoints": [[300, 0], [300, 4000]], "speed": 1}
    for start, turns in ((400, True), (600, True), (1300, False)):
        case = changed(BERG, domain__width=9000, domain__y0=-500, run={"dt": 2, "duration": 2000}, tow=tow,
                       body__drag__tangential=1, output__window_start=start)
        r = run(tmp_path, case, name=f"from-{start}")
        k = int(start / 2)
        course = np.degrees(np.arctan2(r.series("body_vy"), r.series("body_vx")))[k:k + 100].mean()
        assert abs(course - 90) > 8 if turns else abs(course - 90) < 6
        assert bool(re.search("the course (of the body, behind its line, still )?changes by", r.reason)) == turns


def test_the_ordered_speed_is_that_over_the_current_of_the_window(tmp_path):
    """At the turn of the tide a tow that keeps its order does so through the ice of that hour."""
    for phase in (0, 180):
        case = changed(BERG, ice={"concentration": 0.05, "size": 40, "thickness": 0.8}, domain__width=300,
                       water={"tide": {"major": 0.4, "period": "12.42 h", "phase": f"{phase} deg"}},
                       tow=LINE | {"speed": 0.7}, run={"dt": 5, "duration": "6.2 h"}, output__window_start="5.2 h")
        r = run(tmp_path, case, name=f"at-{phase}")
        estimates = r.summary["estimates"]
        late = r.series("time") >= 5.2 * 3600 - 1e-6
        through = r.series("speed_through_ice")[late].mean()
        assert estimates["ordered_speed_m_s"] == pytest.approx(through, rel=0.02)
        assert abs(through - 0.7) > 0.2


def test_a_programme_ends_with_the_run(tmp_path):
    """Points after it are none of the tow: they gave a speed that it never has, and no window."""
    tow = {"mode": "speed", "programme": [[0, 0], [100, 0.5], [3600, 0.5], [7200, 1]]}
    case = changed(BERG, tow=tow, run={"dt": 2, "duration": 600})
    del case["solver"]
    assert "speed, 0.5 m/s" in call("check", write_case(tmp_path, case)).stdout
    r = run(tmp_path, case)
    assert r.summary["window"]["start_s"] < 200 and r.summary["estimates"]["ordered_speed_m_s"] == pytest.approx(0.5)
    again = run(tmp_path, r.dir / "case.resolved.yml", name="again")
    assert again.summary["state_hash"] == r.summary["state_hash"]


def test_a_body_on_a_line_is_held_against_walls_where_it_goes(tmp_path):
    """Behind a corner it does not go as its end does."""
    case = changed(BERG, domain={"frame": "basin", "length": 1000, "width": 400, "ends": "wall", "sides": "wall"},
                   body={"shape": "disc", "length": 40, "draft": 20, "x": 100, "y": 0},
                   tow=LINE | {"speed": 0.8, "ramp": 100, "line_length": 200, "waypoints": [[450, 0], [450, 190]]},
                   run={"dt": 0.5, "duration": 440})
    assert call("check", write_case(tmp_path, case)).returncode == DONE
    led = changed(case, tow__mode="speed", tow__line_length=None, tow__line_stiffness=None, tow__line_damping=None,
                  run__duration=760)
    refused = call("check", write_case(tmp_path, led))
    assert refused.returncode == CASE and "lead the body into a wall" in refused.stderr


def test_a_lead_is_left_where_the_body_cuts_its_corner(tmp_path):
    """By half the length of the line at a right angle: of the tractrix, where it is as far from both legs."""
    case = changed(BERG, ice={"concentration": 0.4, "size": 30, "thickness": 1}, run__duration=3000,
                   lead={"mode": "channel", "width": 120, "length": 1500},
                   tow=LINE | {"line_length": 400, "waypoints": [[600, 0], [600, 800]]})
    text = call("check", write_case(tmp_path, case)).stdout
    said = re.search(r"cuts the corners of its path by up to ([\d.]+) m", text)
    assert float(said[1]) == pytest.approx(0.4806 * 430, rel=0.02)
    assert "cuts the corners" not in call("check", write_case(tmp_path, changed(case, tow__line_length=60))).stdout


def test_what_check_says_of_line_and_vessel(tmp_path):
    tow = LINE | {"mode": "thrust", "speed": 1, "vessel": VESSEL | {"free_speed": 2, "bollard_pull": 2e6},
                  "line": {"branches": 2}, "branch2": {"length": 130, "stiffness": 5e7, "breaking_load": 1e5}}
    text = call("check", write_case(tmp_path, changed(BERG, tow=tow, water__current_x=-1))).stdout
    assert "net pull left for the line at 2 m/s through the water: 0 N" in text
    assert "line, second branch  130 m, EA 5e+07 N, breaking load 1e+05 N" in text


def test_a_body_that_moves_as_its_programme_begins_is_not_jerked(tmp_path):
    programme = [[0, 0.5], [3600, 0.5]]
    tow = {k: v for k, v in LINE.items() if k not in ("speed", "ramp")} | {"programme": programme}
    moving = changed(BERG, tow=tow, body={"shape": "disc", "length": 60, "draft": 40, "vx": 0.5, "vy": 0})
    assert "jerks the line" not in call("check", write_case(tmp_path, moving)).stdout
    assert "jerks the line" in call("check", write_case(tmp_path, changed(moving, body__vx=0))).stdout
