# SPDX-License-Identifier: MIT
"""Current and wind in time, and free drift against the balance of forces solved independently of the program.

The balance of a body that drifts steadily, k = skin + form (times the width across the flow):
    k_w |U_w - U| (U_w - U) + k_a |U_a - U| (U_a - U) + m f x (U - U_b) = 0,   m without added mass
"""
import h5py
import numpy as np
import pytest
from scipy.optimize import fsolve

from harness import CASE, DONE, IO, call, changed, quick, run, write_case

RHO_W, RHO_A, OMEGA = 1027, 1.29, 7.292115e-5
BERG = {"water_form": 0.85, "water_skin": 5e-4, "air_form": 0.4, "air_skin": 2.5e-4}
FLOE = {"water_form": 0.85, "water_skin": 5.5e-3, "air_form": 0.4, "air_skin": 2e-3}

# Far apart, so that they never meet. Neither outline is round: the width across the flow counts.
DRIFT = {
    "run": {"dt": 5, "duration": 60000},
    "domain": {"frame": "geographic", "length": 2e5, "width": 2e5, "ends": "open", "sides": "open"},
    "ice": {"concentration": 0, "thickness": 0.8},
    "tow": {"mode": "none"},
    "output": {"frame_interval": 10000},
    "body": {"shape": "rectangle", "length": 60, "width": 30, "yaw": 25, "draft": 20, "sail": 5},
    "floes": [{"shape": "rectangle", "length": 50, "width": 20, "yaw": -40, "x": 3000, "y": 3000}],
}
WIND, CURRENT = np.array([9.0, -4.0]), np.array([0.15, 0.25])
WEATHER = {"water__current_x": CURRENT[0], "water__current_y": CURRENT[1], "water__latitude": 75,
           "air__wind_x": WIND[0], "air__wind_y": WIND[1]}


def steady_drift(outline, mass, draft, sail, c, f, balance=(0, 0), wind=WIND, current=CURRENT):
    """outline [n, 2] in the world's axes, mass without added mass; f: dU/dt = f (-U_y, U_x)."""
    x, y = outline.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)

    def drag(r, skin, form):
        speed = np.hypot(*r)
        return (skin * area + form * np.ptp(outline @ [-r[1], r[0]]) / speed) * speed * r

    def force(u):
        r = u - np.array(balance)
        return (drag(current - u, RHO_W * c["water_skin"], 0.5 * RHO_W * c["water_form"] * draft)
                + drag(wind - u, RHO_A * c["air_skin"], 0.5 * RHO_A * c["air_form"] * sail)
                + mass * f * np.array([-r[1], r[0]]))

    u, _, good, text = fsolve(force, current + 0.02 * wind, xtol=1e-13, full_output=True)
    assert good == 1 and np.abs(force(u)).max() < 1e-6 * mass * 1e-4, text
    return u


def turned(v, yaw):
    c, s = np.cos(yaw), np.sin(yaw)
    return v @ np.array([[c, s], [-s, c]])


@pytest.mark.parametrize("frame, tilt, latitude", quick(
    [("geographic", "none", 75), ("geographic", "geostrophic", 75), ("geographic", "none", -60),
     ("basin", "geostrophic", 75), ("geographic", "none", 0)],
    ("geographic", "none", -60), ("basin", "geostrophic", 75)))
def test_free_drift_is_the_balance_of_forces(tmp_path, frame, tilt, latitude):
    """Berg and floe. Coriolis is a rotation by f dt in the step: its force is off by f dt / 2 of itself, 4e-4 at 5
    s."""
    for dt, close in ((5, 1e-3), (1, 2e-4)):
        case = changed(DRIFT,
                       domain__frame=frame,
                       domain__x0=-1e5,
                       body__x=0,
                       **(WEATHER | {"water__tilt": tilt, "water__latitude": latitude}),
                       run={"dt": dt, "duration": 60000 if dt == 5 else 30000})
        r = run(tmp_path, case, name=f"dt{dt}")
        f = 2 * OMEGA * np.sin(np.radians(latitude)) * (1 if frame == "geographic" else -1)
        balance = CURRENT if tilt == "geostrophic" else (0, 0)
        with h5py.File(r.dir / "result.h5") as h:
            berg, floe = h["bodies/vertices"][:4], h["floes/vertices"][:]
            pose, time, speed = h["frames/pose"][:, 0], h["frames/time"][:], h["frames/speed"][:]
        got = np.array([s[-1] for s in r.series("body_vx", "body_vy")])
        yaw = r.series("body_yaw")[-1]
        assert yaw == pytest.approx(np.radians(25), abs=1e-9), "nothing turns it"
        want = steady_drift(turned(berg, yaw), 900 * 1800 * 25, 20, 5, BERG, f, balance)
        scale = np.hypot(*(want - CURRENT))
        assert np.abs(got - want).max() < close * scale, (got, want)
        draft = 0.8 * 910 / RHO_W
        want = steady_drift(turned(floe, pose[0, 2]), 910 * 0.8 * 1000, draft, 0.8 - draft, FLOE, f, balance)
        got = (pose[-1] - pose[-2])[:2] / (time[-1] - time[-2])
        assert np.abs(got - want).max() < close * np.hypot(*(want - CURRENT)), (got, want)
        assert speed[-1, 0] == pytest.approx(np.hypot(*want), rel=close)


@pytest.mark.slow
def test_a_pack_drifts_as_its_floes_do(tmp_path):
    """Without form drag every floe of one thickness has the same free drift, whatever its size and place: a dense pack
    moves as one and its floes do not press on each other."""
    bare = FLOE | {"water_form": 0, "air_form": 0}
    case = changed(DRIFT, domain={"frame": "geographic", "length": 600, "width": 400, "ends": "periodic",
                                  "sides": "periodic"}, ice={"concentration": 0.85, "size": 30, "size_law": "lognormal",
                                                             "size_spread": 0.4, "thickness": 0.5, "drag": bare},
                   body={"shape": "none"}, floes=None, run={"dt": 5, "duration": 20000}, **WEATHER)
    r = run(tmp_path, case)
    f = 2 * OMEGA * np.sin(np.radians(75))
    draft = 0.5 * 910 / RHO_W
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    want = np.hypot(*steady_drift(square, 910 * 0.5, draft, 0.5 - draft, bare, f))
    speed = r.dataset("/frames/speed")[-1]
    assert len(speed) > 200 and r.summary["concentration"] == pytest.approx(0.85, abs=0.005)
    assert speed == pytest.approx(np.full(len(speed), want), rel=1e-3)
    assert r.dataset("/frames/contact_force")[-1].max() < 1e-3 * RHO_A * 2e-3 * 700 * 97, "floes press"
    # With form drag small floes sail ahead of large ones: they do press.
    pressed = run(tmp_path, changed(case, ice__drag=FLOE), name="form")
    assert pressed.dataset("/frames/contact_force")[-1].max() > 1


@pytest.mark.parametrize("frame, latitude", [("geographic", 75), ("geographic", -75), ("basin", 75)])
def test_inertial_circle(tmp_path, frame, latitude):
    """Radius U/f, period 2π/f, f times the share of the body without its added mass, to the right of the motion in the
    north: towards the east (+y) of a start to the north (+x)."""
    none = dict.fromkeys(BERG, 0)
    f, speed = 2 * OMEGA * np.sin(np.radians(latitude)) / 1.5, 0.3
    period = 2 * np.pi / abs(f)
    case = changed(DRIFT, domain__frame=frame, domain__x0=-1e5, body__x=0, body__vx=speed, body__drag=none,
                   ice__drag=none, water={"latitude": latitude}, run={"dt": period / 9000, "duration": period})
    r = run(tmp_path, case)
    t, x, y = r.series("time", "body_x", "body_y")
    right = (1 if frame == "geographic" else -1) * np.sign(latitude)
    radius = speed / abs(f)
    # Positions are sums of the velocities at the ends of the steps: half a step's way off, 4e-4 of the radius.
    np.testing.assert_allclose(np.hypot(x, y - right * radius), radius, rtol=1e-3)
    assert y[len(y) // 4] == pytest.approx(right * radius, rel=2e-3) and x[len(x) // 4] == pytest.approx(radius,
                                                                                                         rel=2e-3)
    assert np.hypot(x[-1], y[-1]) < 1e-9 * radius
    assert r.series("coriolis_force").max() > 0 and np.abs(
        r.series("drag_force")).max() < 1e-12 * r.series("coriolis_force").max()


TIDE = {"major": 0.4, "minor": -0.15, "inclination": 35, "period": 12000, "phase": 50}


def ellipse(t, mean, major, minor, inclination, period, phase):
    """Velocity and displacement since t = 0 of the water."""
    i, w, lag = np.radians(inclination), 2 * np.pi / period, np.radians(phase)
    e = np.array([[np.cos(i), -np.sin(i)], [np.sin(i), np.cos(i)]]) * [major, minor]
    a = w * t - lag
    return (np.array(mean)[:, None] + e @ [np.cos(a), np.sin(a)],
            np.outer(mean, t) + e @ [(np.sin(a) + np.sin(lag)) / w, (np.cos(lag) - np.cos(a)) / w])


def tidal(folder, name, **changes):
    case = changed(DRIFT, run={"dt": 20, "duration": 15000}, output={"frame_interval": 200}, ice__thickness=0.02,
                   ice__drag={"water_skin": 10}, water={"current_x": 0.05, "current_y": -0.02, "tide": TIDE}, **changes)
    return run(folder, case, name=name)


def test_a_light_floe_follows_the_tidal_ellipse(tmp_path):
    r = tidal(tmp_path, "tide")
    time, pose = r.dataset("/frames/time"), r.dataset("/frames/pose")[:, 0]
    _, way = ellipse(time, (0.05, -0.02), **TIDE)
    # It starts at rest and lags a little: some metres on an ellipse of 1.5 km.
    assert np.abs(pose[:, :2].T - pose[0, :2, None] - way).max() < 3
    assert np.ptp(way[0]) > 1000
    t, u, v = r.series("time", "current_x", "current_y")
    want, _ = ellipse(t - 10, (0.05, -0.02), **TIDE)
    np.testing.assert_allclose([u, v], want, atol=1e-12)


def test_a_table_of_the_same_tide(tmp_path):
    """Rows of one minute: a chord of the ellipse; and the run of the resolved file, elsewhere, finds the table
    again."""
    t = np.arange(0, 15061, 60)
    u, _ = ellipse(t, (0.05, -0.02), **TIDE)
    folder = tmp_path / "case"
    folder.mkdir()
    rows = [f"{a:.0f}, {b:.17g} ,{c:.17g}" for a, b, c in zip(t, *u)]
    (folder / "tide.csv").write_text("# a tide\n\nt,u,v\n" + "\n".join(rows) + "\n")
    case = changed(DRIFT, run={"dt": 20, "duration": 15000}, output={"frame_interval": 200}, ice__thickness=0.02,
                   ice__drag={"water_skin": 10}, water={"current_table": "tide.csv"})
    r, of_keys = run(folder, case), tidal(tmp_path, "tide")
    assert np.abs(r.dataset("/frames/pose") - of_keys.dataset("/frames/pose")).max() < 0.5
    again = run(tmp_path, r.dir / "case.resolved.yml", name="again")
    assert again.hash == r.hash != of_keys.hash


def test_wind_table_drives_the_berg(tmp_path):
    """A gust sets it in motion at its time and not before, and along its direction."""
    (tmp_path / "gust.csv").write_text("t,u,v\n0 s,0,0\n10 min,0,0\n11 min,10 kn,-10 kn\n1 h,10 kn,-10 kn\n")
    r = run(tmp_path, changed(DRIFT, run={"dt": 5, "duration": 3600}, air={"wind_table": "gust.csv"}))
    t, vx, vy, wind = r.series("time", "body_vx", "body_vy", "wind_x")
    assert np.all(vx[t <= 600] == 0) and np.all(np.diff(vx[t >= 605]) > 0) and np.allclose(vy, -vx, rtol=1e-9)
    assert wind[-1] == pytest.approx(10 * 1852 / 3600) and np.interp(630, t - 2.5, wind) == pytest.approx(
        5 * 1852 / 3600)


TABLES = {
    "no header": ("0,1,2\n", "bad.csv:1: is not the header; begin the table with the line t,u,v"),
    "no rows": ("t,u,v\n# nothing\n", "bad.csv: has no rows"),
    "empty": ("", "bad.csv: has no rows"),
    "two columns": ("t,u,v\n0,1\n99,1,1\n", "bad.csv:2: needs three columns"),
    "four columns": ("t,u,v\n0,1,1,1\n99,1,1\n", "bad.csv:2:"),
    "junk": ("t,u,v\n0,1,1\n# two lines\n\n99,1x,1\n", "bad.csv:5: \"x\" is not a unit of speed"),
    "not a number": ("t,u,v\n0,nan,1\n99,1,1\n", "bad.csv:2: \"nan\" is not a number"),
    "wrong unit": ("t,u,v\n0 m,1,1\n99,1,1\n", "bad.csv:2: m is the unit of a length, but this is a time"),
    "out of range": ("t,u,v\n0,1,1\n99,1000,1\n", "bad.csv:3: a speed is out of range"),
    "not sorted": ("t,u,v\n0,1,1\n50,1,1\n50,2,1\n99,0,0\n", "bad.csv:4: its time is not later"),
    "late": ("t,u,v\n1,1,1\n99,1,1\n", "case.yml", "water.current_table: the table begins at 1 s"),
    "short": ("t,u,v\n0,1,1\n49,1,1\n", "case.yml",
              "water.current_table: the table ends at 49 s, but the run needs it until 50 s"),
    "long line": ("t,u,v\n" + "0" * 300 + ",1,1\n", "bad.csv:2: is too long"),
}


@pytest.mark.parametrize("kind", TABLES)
def test_tables_that_are_refused(tmp_path, kind):
    text, *fragments = TABLES[kind]
    (tmp_path / "bad.csv").write_text(text)
    path = write_case(tmp_path, changed(DRIFT, run__duration=50, water={"current_table": "bad.csv"}))
    result = call("check", path)
    assert result.returncode == CASE, result.stderr
    assert all(f in result.stderr for f in fragments), result.stderr
    assert "Traceback" not in result.stderr and result.stderr.count("\n") == 1


def test_keys_beside_a_table_and_a_table_that_is_missing(tmp_path):
    (tmp_path / "t.csv").write_text("t,u,v\n0,1,1\n50,1,1\n")
    base = changed(DRIFT, run__duration=50)
    path = write_case(tmp_path, changed(base, water={"current_table": "t.csv", "current_x": 0.1,
                                                     "tide": {"major": 0.2}}, air={"wind_table": "t.csv", "wind_y": 3}))
    result = call("check", path)
    assert result.returncode == CASE
    for key, table in (("water.current_x", "water.current_table"), ("water.tide.major", "water.current_table"),
                       ("air.wind_y", "air.wind_table")):
        assert f"{key}: has no effect with {table}" in result.stderr
    assert call("check", write_case(tmp_path, changed(base, water={"current_table": "t.csv"}))).returncode == DONE
    result = call("check", write_case(tmp_path, changed(base, water={"current_table": "none.csv"})))
    assert result.returncode == IO and "none.csv: cannot be read: No such file" in result.stderr
    result = call("check", write_case(tmp_path, changed(base, water={"tide": {"minor": 0.2, "major": 0.1}})))
    assert result.returncode == CASE and "water.tide.minor: 0.2 m/s is more than" in result.stderr


@pytest.mark.parametrize("direction", [0, 120, np.degrees(np.arctan2(0.2, 0.3))])
def test_tilt_of_the_sea_along_a_course(tmp_path, direction):
    """A led body in a current that its slope balances: along the course the slope holds it back with what balances the
    Coriolis force of the water, m f (U_x sin - U_y cos), with x to the north; nothing where the course is that of the
    current."""
    r = run(tmp_path, {
        "run": {"dt": 1, "duration": 30},
        "domain": {"frame": "geographic", "length": 2000, "width": 2000, "ends": "periodic", "sides": "periodic"},
        "ice": {"concentration": 0, "size": 30, "thickness": 1},
        "body": {"shape": "rectangle", "length": 60, "width": 30, "draft": 20, "sail": 5},
        "tow": {"speed": 0.36, "direction": direction, "ramp": 1},
        "water": {"latitude": 75, "current_x": 0.3, "current_y": 0.2, "tilt": "geostrophic"},
        "output": {"window_start": 10},
    })
    tilt, coriolis, tow, drag = (s[-1] for s in r.series("tilt_force", "coriolis_force", "tow_force", "drag_force"))
    a, mf = np.radians(direction), 900 * 60 * 30 * 25 * 2 * OMEGA * np.sin(np.radians(75))
    assert abs(tilt - mf * (0.3 * np.sin(a) - 0.2 * np.cos(a))) < 1e-9 * mf and abs(coriolis) < 1e-9 * mf
    assert tow == pytest.approx(drag + tilt, abs=1e-9 * mf)
