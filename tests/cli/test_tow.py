# SPDX-License-Identifier: MIT
"""The towing operation from the case file on: what it leaves in series and events, and that its numbers balance."""
import h5py
import numpy as np
import pytest

from harness import CASE, call, changed, reasons, run, texts, warned, write_case

# A vessel on a bridle round two corners through loose ice with current and Coriolis force.
VESSEL = {
    "run": {"dt": 2, "duration": 1500},
    "domain": {"frame": "geographic", "length": 1500, "width": 900, "ends": "open", "sides": "open"},
    "ice": {"concentration": 0.4, "size": 40, "thickness": 1, "x_min": -400},
    "body": {"length": 80, "draft": 30, "x": -600, "y": -200},
    "tow": {
        "mode": "thrust",
        "programme": [[0, 0], [120, 1.2], [1200, 1.2], [1320, 0]],
        "waypoints": [[-100, -200], [150, 100], [2000, 100]],
        "turn_radius": 60,
        "line_length": 250,
        "line_damping": "200 kN s/m",
        "line": {"type": "dyneema", "diameter": "60 mm", "branches": 2, "breaking_load": 0},
        "vessel": {"mass": "3000 t", "bollard_pull": "1.2 MN", "free_speed": "14 kn", "lookahead": 100},
    },
    "water": {"latitude": 75, "current_y": 0.1},
}


@pytest.fixture(scope="module")
def towed(tmp_path_factory):
    return run(tmp_path_factory.mktemp("tow"), VESSEL, "--quiet")


def events(r):
    with h5py.File(r.dir / "result.h5") as f:
        e = f["events"]
        names = [n.decode() for n in e["kind_names"][:]]
        return [(t, names[k], int(s), v)
                for t, k, s, v in zip(e["time"][:], e["kind"][:], e["subject"][:], e["value"][:])]


def test_the_vessel_balances(towed):
    """thrust = drag + inertia + line at every sample, to 1e-9 of the largest; and the inertia is that of the recorded
    track."""
    thrust, drag, inertia, line = towed.series("vessel_thrust", "vessel_drag", "vessel_inertia", "vessel_line")
    scale = np.abs([thrust, drag, inertia, line]).max()
    assert scale > 1e5 and np.abs(inertia).max() > 1e4 and np.abs(drag).max() > 1e3
    assert np.abs(thrust - drag - inertia - line).max() <= 1e-9 * scale
    x, y = towed.series("vessel_x", "vessel_y")
    vx, vy = np.diff(x) / 2, np.diff(y) / 2
    acceleration = np.hypot(np.diff(vx), np.diff(vy)) / 2
    assert (np.abs(inertia[2:]) <= 1.05 * 3e6 * acceleration + 1e-3 * scale).all()


def test_the_body_balances(towed):
    tow, ice, drag, inertia = towed.series("tow_force", "ice_resistance", "drag_force", "inertia_force")
    assert np.abs(ice).max() > 1e4
    # Coriolis and tilt have series of their own in some versions: take what is there.
    with h5py.File(towed.dir / "result.h5") as f:
        more = sum(f["series"][n][:] for n in ("coriolis_force", "tilt_force") if n in f["series"])
    assert np.abs(tow - ice - drag - inertia - more).max() <= 1e-9 * np.abs([tow, ice, drag, inertia]).max()
    assert towed.summary["momentum_residual"] < 1e-9


def test_the_governor_and_the_power(towed):
    """Never faster over ground than the programme but by what it coasts, never more thrust than the bollard pull, and
    none astern."""
    time, speed, thrust = towed.series("time", "vessel_speed", "vessel_thrust")
    programme = np.interp(time, [0, 120, 1200, 1320], [0, 1.2, 1.2, 0])
    faster = speed > programme * (1 + 1e-12)
    assert (thrust[faster] == 0).all() and not faster[time < 1000].any()
    # Its fall with speed is linearised: in a step in which the line draws the vessel back it may be a little more than
    # at rest.
    assert thrust.min() >= 0 and thrust.max() <= 1.2e6 * (1 + 1e-4)
    # Slower than the programme only at full power, of which 2 % are lost at 1.2 m/s; less power only at the programme's
    # speed.
    slower, partial = speed < programme * (1 - 1e-9), (thrust > 0) & (thrust < 0.97 * 1.2e6)
    assert (thrust[slower] > 0.97 * 1.2e6).all() and slower.sum() > 20
    assert np.abs(speed - programme)[partial].max() < 1e-9 and partial.sum() > 10


def test_the_track_is_the_planned_one(towed):
    """Way-points are passed in order, the vessel stays within some tens of metres of the polyline, and the body comes
    after."""
    e = [v for v in events(towed) if v[1] == "waypoint"]
    assert [v[2] for v in e] == [1, 2] and 0 < e[0][0] < e[1][0]
    x, y = towed.series("vessel_x", "vessel_y")
    points = np.array([[x[0], y[0]], [-100, -200], [150, 100], [2000, 100]])
    away = np.full(len(x), np.inf)
    for p, q in zip(points[:-1], points[1:]):
        d = (q - p) / np.hypot(*(q - p))
        s = np.clip((x - p[0]) * d[0] + (y - p[1]) * d[1], 0, np.hypot(*(q - p)))
        away = np.minimum(away, np.hypot(x - p[0] - s * d[0], y - p[1] - s * d[1]))
    assert away.max() < 60
    assert towed.series("body_y")[-1] > 0


def test_tensions_of_the_branches(towed):
    one, two, both = towed.series("line_tension_1", "line_tension_2", "line_tension")
    assert (both == np.maximum(one, two)).all() and one.max() > 1e5 and two.max() > 1e5
    assert (one >= 0).all() and (two >= 0).all()


def test_a_stop_within_the_window_is_reported(towed, tmp_path):
    assert warned(towed, "speed programme goes from 1.2 to 0 m/s within the window")
    steady = changed(VESSEL, run__duration=600, output={"window_start": 130})
    assert not warned(run(tmp_path, steady, "--quiet"), "speed programme")


def test_the_resolved_case_gives_the_same_run(towed, tmp_path):
    again = run(tmp_path, towed.dir / "case.resolved.yml", "--quiet")
    assert again.hash == towed.hash


def test_branches_break_and_the_body_drifts(tmp_path):
    case = changed(VESSEL, run__duration=400, tow__line__breaking_load="150 kN",
                   tow__branch2={"breaking_load": "120 kN"})
    r = run(tmp_path, case)
    e = [v for v in events(r) if v[1] != "waypoint"]
    assert [v[1] for v in e] == ["line_broken", "line_broken", "adrift"]
    assert [(j["time_s"], j["kind"], j["subject"],
             j["value"]) for j in r.summary["events"] if j["kind"] != "waypoint"] == e
    time, one, two = r.series("time", "line_tension_1", "line_tension_2")
    for when, _, branch, value in e[:2]:
        tension, load = (one, 150e3) if branch == 1 else (two, 120e3)
        at = np.searchsorted(time, when - 1e-9)
        assert tension[at] == value > load and (tension[:at] <= load).all() and (tension[at + 1:] == 0).all()
    assert len(warned(r, "broke under")) == 2 and warned(r, "the body drifts")
    assert "event" in r.result.stdout and "branch 1 of the tow line broke" in r.result.stdout
    assert r.series("vessel_speed")[-1] == pytest.approx(1.2, rel=1e-6) # the vessel goes on alone


def test_a_prescribed_body_follows_its_waypoints(tmp_path):
    """Mode speed through ice on a path with a corner: velocity along the course, yaw kept, forces along the course of
    the time."""
    case = changed(VESSEL, run__duration=500, water=None, tow={"mode": "speed", "speed": 1, "ramp": 0,
                                                               "waypoints": [[-400, -200], [-400, 300]]})
    r = run(tmp_path, case, "--quiet")
    time, x, y, yaw, tow, ice, drag, inertia = r.series("time", "body_x", "body_y", "body_yaw", "tow_force",
                                                        "ice_resistance", "drag_force", "inertia_force")
    assert np.abs(np.where(time <= 200, x + 600 - time, x + 400)).max() < 1e-9
    assert np.abs(np.where(time <= 200, y + 200, y + 200 - (time - 200))).max() < 1e-9
    assert np.ptp(yaw) == 0
    steady = (time > 20) & (np.abs(time - 200) > 20)
    assert (drag[steady] > 0).all() and np.ptp(drag[steady]) < 1e-9 * drag.max() # as much after the turn as before


def test_a_wall_or_a_pier_on_the_way_is_refused(tmp_path):
    walled = changed(VESSEL, domain__ends="wall", domain__sides="wall", tow={"mode": "speed", "speed": 1,
                                                                             "waypoints": [[-400, -200], [-400, 500]]})
    r = run(tmp_path, walled, code=CASE, name="a")
    assert "into a wall" in r.result.stderr
    pier = changed(VESSEL,
                   ice__concentration=0,
                   floes=[{"shape": "disc", "length": 20, "x": -400, "y": 100, "fixed": True}],
                   tow={"mode": "speed", "speed": 1, "waypoints": [[-400, -200], [-400, 500]]})
    r = run(tmp_path, pier, code=CASE, name="b")
    assert "on its prescribed path" in r.result.stderr
    run(tmp_path, changed(pier, tow__waypoints=[[-200, -200], [-200, 500]]), "--quiet", name="c")


@pytest.mark.slow
def test_the_froude_twin_is_towed_alike(tmp_path):
    """L = 4: lengths times 4, times times 2, forces times 64, also of programme, way-points, named line and vessel."""
    case = changed(VESSEL, run__duration=400, water=None)
    one = run(tmp_path, case, "--quiet")
    text = call("check", tmp_path / "case.yml", "--scale", 4)
    assert text.returncode == 0, text.stderr
    twin = tmp_path / "twin.yml"
    twin.write_text(text.stdout)
    four = run(tmp_path, twin, "--quiet", name="four")
    for name, factor in (("time", 2), ("vessel_x", 4), ("vessel_y", 4), ("vessel_speed", 2), ("vessel_thrust", 64),
                         ("line_tension_2", 64), ("ice_resistance", 64)):
        a, b = one.series(name) * factor, four.series(name)
        assert np.abs(a - b).max() <= 1e-9 * np.abs(b).max(), name
    assert one.series("ice_resistance").max() > 0


def test_a_lead_goes_round_the_corners(tmp_path):
    """A channel along the way-points: no floe is left near either leg, and there were some without it."""
    case = changed(VESSEL, run__duration=2, lead={"mode": "channel", "width": 60, "length": 800})
    near = []
    for name, c in (("with", case), ("without", changed(case, lead=None))):
        centre = run(tmp_path, c, "--quiet", name=name).dataset("/frames/pose")[0][:, :2]
        distance = np.full(len(centre), np.inf)
        # 500 m from (-600, -200) to the first way-point, and 300 of the 390 m to the second.
        for p, q in (((-600, -200), (-100, -200)), ((-100, -200), (-100 + 300 * 250 / np.hypot(250, 300),
                                                                   -200 + 300 * 300 / np.hypot(250, 300)))):
            p, d = np.array(p), np.subtract(q, p)
            s = np.clip((centre - p) @ d / (d @ d), 0, 1)
            distance = np.minimum(distance, np.hypot(*(centre - p - s[:, None] * d).T))
        near.append((distance < 29).sum())
    assert near[0] == 0 and near[1] > 5


def test_a_lead_has_the_corners_of_the_tow(tmp_path):
    """A body of prescribed course on an arc of 200 m radius meets nothing in a channel of its width and a floe more."""
    case = changed(VESSEL,
                   run__duration=700,
                   water=None,
                   ice__start="rest",
                   tow={"mode": "speed", "speed": 1, "ramp": 0, "waypoints": [[-200, -200], [-200, 400]],
                        "turn_radius": 200},
                   lead={"mode": "channel", "width": 110})
    r = run(tmp_path, case, "--quiet")
    assert r.summary["lead"]["floes_removed"] > 5 and np.ptp(r.series("body_y")) > 200
    assert r.series("ice_resistance").max() == 0


def test_a_vessel_in_a_moving_window(tmp_path):
    """Towards -x, round two corners, with ice that enters ahead: the window goes along, and all balances hold."""
    case = changed(VESSEL,
                   run__duration=1000,
                   body={"length": 80, "draft": 30},
                   domain={"frame": "geographic", "length": 900, "width": 700, "ends": "moving", "sides": "periodic"},
                   ice={"concentration": 0.4, "size": 40, "thickness": 1},
                   tow__waypoints=[[-350, 0], [-500, 80], [-2000, 80]],
                   water=None)
    r = run(tmp_path, case, "--quiet")
    tow, ice, drag, inertia, thrust, vdrag, vinertia, vline = r.series("tow_force", "ice_resistance", "drag_force",
                                                                       "inertia_force", "vessel_thrust", "vessel_drag",
                                                                       "vessel_inertia", "vessel_line")
    assert np.abs(tow - ice - drag -
                  inertia).max() <= 1e-9 * np.abs([tow, ice, drag, inertia]).max() and np.abs(ice).max() > 1e3
    assert np.abs(thrust - vdrag - vinertia - vline).max() <= 1e-9 * np.abs([thrust, vdrag, vinertia, vline]).max()
    assert r.series("body_x")[-1] < -300 and np.nansum(r.series("window_renewed")) > 0
    assert run(tmp_path, r.dir / "case.resolved.yml", "--quiet", name="again").hash == r.hash


@pytest.mark.slow
def test_a_turn_within_the_window_is_no_steady_tow(tmp_path):
    """A corner that a body at a set speed takes within one step has a force as large as the step is short: both are
    said, and a course that is straight, or bends before the window or beyond the end, is not."""
    def told(**tow):
        case = changed(BASE_TURN, tow={**BASE_TURN["tow"], **tow})
        text = call("check", write_case(tmp_path, case)).stdout
        return "turn at way-point 1 within one step" in text, run(tmp_path, case, "--quiet", "--force").summary

    sharp, s = told(waypoints=[[100, 0], [150, 50]])
    assert sharp and s["window"]["verdict"] == "not steady"
    assert "the course changes by 45 deg at way-point 1, passed at 200 s" in reasons(s)
    assert any("turn at way-point 1" in w for w in texts(s["warnings"]))
    sharp, s = told(waypoints=[[100, 0], [150, 50]], turn_radius=40)
    assert not sharp and "the course changes by 45 deg" in reasons(s)
    for points in ([[100, 0], [150, 0]], [[500, 0], [550, 50]], [[10, 0], [300, 100]]):
        sharp, s = told(waypoints=points)
        assert sharp == (points[0][0] == 10) and "the course changes" not in reasons(s)
    # a carriage that passes the corner before the window, and the body behind it within
    line = {"mode": "line", "line_length": 100, "line_stiffness": 10e3, "line_damping": 100,
            "waypoints": [[200, 0], [400, 200]]}
    for start, said in ((200, True), (385, True), (620, False)):
        case = changed(BASE_TURN, output__window_start=start, run__duration=800, tow={**BASE_TURN["tow"], **line})
        said_so = run(tmp_path, case, "--quiet", "--force").reason
        assert ("the course changes by 45 deg at way-point 1, passed at 170 s" in said_so) == said, said_so
    assert "tow.programme: from 0 to 0.5 m/s in less than a step" in call("check", write_case(
        tmp_path, changed(BASE_TURN, tow={"programme": [[10, 0], [10.5, 0.5]]}))).stdout


BASE_TURN = {
    "run": {"dt": 1, "duration": 400}, "domain": {"frame": "geographic", "length": 1000, "width": 1000, "ends": "open",
                                                  "sides": "open"},
    "ice": {"concentration": 0}, "body": {"length": 30, "draft": 20}, "tow": {"speed": 0.5, "ramp": 0},
    "output": {"window_start": 50},
}
