# SPDX-License-Identifier: MIT
"""Form drag along the outline, added mass and free drift at the start, on the program itself, against SciPy and closed
forms."""
import h5py
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from harness import DONE, call, changed, environment, run, write_case
from test_environment import BERG, CURRENT, DRIFT, FLOE, OMEGA, RHO_A, RHO_W, WEATHER, steady_drift, turned

# The berg of the open literature's usual size, in still water, with nothing near it.
TURNING = {
    "run": {"dt": 5, "duration": 1800},
    "domain": {"frame": "geographic", "length": 5000, "width": 5000, "ends": "open", "sides": "open"},
    "ice": {"concentration": 0},
    "body": {"shape": "rectangle", "length": 80, "width": 56, "draft": 58, "yaw_rate": 0.3},
    "tow": {"mode": "none"},
    "output": {"frame_interval": 600},
}
RECTANGLE = np.array([[-40, -28], [40, -28], [40, 28], [-40, 28]], float)


def outline(corners, n=100):
    """Middle, normal and length of n pieces of each side: a plain sum, not the program's quadrature."""
    for p, q in zip(corners, np.roll(corners, -1, axis=0)):
        t = (np.arange(n) + 0.5) / n
        yield p + t[:, None] * (q - p), np.array([q[1] - p[1], p[0] - q[0]
                                                  ]) / np.hypot(*(q - p)), np.hypot(*(q - p)) / n


def form_drag(corners, v, w, factor, tangential=0):
    """Force and moment of dampers factor max(0, -v.n) dl, v the local velocity of the fluid past the body, at arms r
    that have lost what lies along the normal, but for a share of it."""
    total = np.zeros(3)
    for r, normal, length in outline(corners):
        local = v - w * np.column_stack([-r[:, 1], r[:, 0]])
        arm = r - (1 - tangential) * (r @ normal)[:, None] * normal
        df = factor * (np.maximum(0, -local @ normal) * length)[:, None] * (
            v - w * np.column_stack([-arm[:, 1], arm[:, 0]]))
        total += [df[:, 0].sum(), df[:, 1].sum(), np.sum(arm[:, 0] * df[:, 1] - arm[:, 1] * df[:, 0])]
    return total


def moments(corners, n=400):
    """Area and the means of r² and r³, by triangles to the origin: along a ray r^k has a mean of 2/(k + 2) of its end,
    along the side a plain sum."""
    sums = np.zeros(3)
    for p, q in zip(corners, np.roll(corners, -1, axis=0)):
        r = np.hypot(*(p[:, None] + (q - p)[:, None] * (np.arange(n) + 0.5) / n))
        sums += 0.5 * (p[0] * q[1] - p[1] * q[0]) * np.array([1, np.mean(r**2) / 2, np.mean(r**3) * 2 / 5])
    return sums


def integrate(state, time, corners=RECTANGLE, drag=BERG, draft=58, tangential=0):
    """Velocity and rate of turn in body axes over time; sail as the program's rule has it, air at rest."""
    area, second, third = moments(corners)
    sail = draft * (RHO_W / 900 - 1)
    mass = 900 * area * (draft + sail)
    inertia = 1.5 * mass * second / area
    skin = RHO_W * drag["water_skin"] + RHO_A * drag["air_skin"]
    factor = 0.5 * (RHO_W * drag["water_form"] * draft + RHO_A * drag["air_form"] * sail)

    def rate(_, s):
        u, w = s[:2], s[2]
        f = form_drag(corners, -u, w, factor, tangential)
        f[:2] -= skin * area * np.hypot(*u) * u
        f[2] -= skin * third * abs(w) * w
        # In axes that turn with the body, du/dt = F/M - w x u.
        return [f[0] / (1.5 * mass) + w * u[1], f[1] / (1.5 * mass) - w * u[0], f[2] / inertia]

    return solve_ivp(rate, (0, time[-1]), state, t_eval=time, rtol=1e-8, atol=1e-10).y


@pytest.mark.parametrize("dt", [5, 1])
@pytest.mark.parametrize("shape, tangential, left", [("rectangle", 0, 0.456), ("rectangle", 1, 0.245),
                                                     ("disc", 0, 0.906), ("disc", 1, 0.445)])
def test_a_turning_berg_is_damped(tmp_path, shape, tangential, left, dt):
    """0.3 deg/s of a berg of 80 x 56 x 58 m, by an independent integration within 1 %; skin drag alone leaves 99.8 % of
    it after 30 min."""
    r = run(tmp_path, changed(TURNING, run__dt=dt, body__shape=shape, body__drag={"tangential": tangential}))
    t, spin, vx, vy = r.series("time", "body_yaw_rate", "body_vx", "body_vy")
    with h5py.File(r.dir / "result.h5") as f:
        corners = f["bodies/vertices"][:f["bodies/offsets"][1]]
    want = integrate([0, 0, np.radians(0.3)], t, corners, tangential=tangential)[2]
    np.testing.assert_allclose(spin, want, rtol=0.01 if dt == 5 else 0.002)
    assert spin[-1] / np.radians(0.3) == pytest.approx(left, abs=0.005)
    assert np.hypot(vx, vy).max() < 1e-12, "a body with two axes of symmetry stays where it turns"


def test_a_berg_that_turns_and_drifts(tmp_path):
    """Turning and drift together: the side that meets the water bears the drag, and the path bends. Within 1 % of an
    independent integration."""
    r = run(tmp_path, changed(TURNING, body__vx=0.3, body__vy=0.1, run__dt=1))
    t, spin, vx, vy, yaw = r.series("time", "body_yaw_rate", "body_vx", "body_vy", "body_yaw")
    u, v, w = integrate([0.3, 0.1, np.radians(0.3)], t)
    c, s = np.cos(yaw), np.sin(yaw)
    assert np.abs(spin - w).max() < 0.01 * np.radians(0.3)
    assert np.hypot(c * vx + s * vy - u, c * vy - s * vx - v).max() < 0.01 * np.hypot(0.3, 0.1)
    alone = integrate([0, 0, np.radians(0.3)], t)[2]
    assert spin[-1] < 0.9 * alone[-1], "drift damps the turning"


SHAPES = {
    "disc": {"shape": "disc", "length": 80},
    "askew": {
        "shape": "polygon", "vertices": [[40, 4], [28, 24], [0, 29], [-28, 22], [-40, 0], [-30, -22], [-2, -27],
                                         [27, -20]]
    },
    "triangle": {"shape": "polygon", "vertices": [[40, 0], [-20, 30], [-20, -10]]},
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("yaw", [0, 37])
def test_translation_has_the_drag_of_the_width(tmp_path, name, yaw):
    """A body that is led straight on: (half rho C d b + rho C A) v² of water and air, to rounding, whatever its
    outline."""
    case = changed(TURNING,
                   body={**SHAPES[name], "draft": 58, "sail": 8, "yaw": yaw},
                   tow={"mode": "speed", "speed": 0.5, "direction": 20, "ramp": 0},
                   run__duration=50)
    r = run(tmp_path, case)
    with h5py.File(r.dir / "result.h5") as f:
        area, v = f["bodies/area"][0], f["bodies/vertices"][:f["bodies/offsets"][1]]
    a = np.radians(20 - yaw)
    width = np.ptp(v @ [-np.sin(a), np.cos(a)])
    want = (0.5 * (RHO_W * 0.85 * 58 + RHO_A * 0.4 * 8) * width + (RHO_W * 5e-4 + RHO_A * 2.5e-4) * area) * 0.25
    np.testing.assert_allclose(r.series("drag_force"), want, rtol=1e-13)


@pytest.mark.parametrize("frame, start", [("geographic", "drift"), ("basin", "rest"), ("basin", "drift")])
def test_a_geostrophic_current_carries_berg_and_ice(tmp_path, frame, start):
    """Whatever the added mass: Coriolis and slope act on the mass itself and balance at the velocity of the water."""
    case = changed(DRIFT,
                   domain__frame=frame,
                   domain__x0=-1e5,
                   body__x=0,
                   ice__added_mass=0.3,
                   ice__start=start,
                   air={"wind_x": 0.15, "wind_y": 0.25},
                   water={"current_x": 0.15, "current_y": 0.25, "latitude": 75, "tilt": "geostrophic"},
                   run={"dt": 5, "duration": 20000})
    if start == "rest":  # the velocity of the water by hand: kept
        case = changed(case, body__vx=0.15, body__vy=0.25, floes=[{**DRIFT["floes"][0], "vx": 0.15, "vy": 0.25}])
    r = run(tmp_path, case)
    vx, vy, spin = r.series("body_vx", "body_vy", "body_yaw_rate")
    assert np.abs(vx - 0.15).max() < 1e-9 and np.abs(vy - 0.25).max() < 1e-9 and np.abs(spin).max() < 1e-12
    pose, t = r.dataset("/frames/pose")[:, 0], r.dataset("/frames/time")
    np.testing.assert_allclose(pose[:, :2] - pose[0, :2], np.outer(t, CURRENT), atol=1e-9 * 20000 * 0.3)


def test_a_changing_current_carries_the_added_mass_too(tmp_path):
    """tilt: dynamic, wind that goes with the water: berg and floe move with a tide to rounding, added mass and Coriolis
    or not."""
    t = np.arange(0, 20001, 20)
    u = np.array([0.3 * np.cos(2 * np.pi * t / 20000), 0.2 * np.sin(2 * np.pi * t / 20000)])
    (tmp_path / "tide.csv").write_text("t,u,v\n" + "\n".join(f"{a},{b:.17g},{c:.17g}" for a, b, c in zip(t, *u)) + "\n")
    case = changed(DRIFT,
                   body__vx=0.3,
                   body__vy=0,
                   floes=[{**DRIFT["floes"][0], "vx": 0.3, "vy": 0}],
                   ice__added_mass=0.3,
                   run={"dt": 20, "duration": 20000},
                   water={"current_table": "tide.csv", "latitude": 75, "tilt": "dynamic"},
                   air={"wind_table": "tide.csv"})
    r = run(tmp_path, case)
    vx, vy, cx, cy = r.series("body_vx", "body_vy", "current_x", "current_y")
    assert np.hypot(vx - cx, vy - cy).max() < 1e-9 and np.ptp(cx) > 0.5
    slow = run(tmp_path, changed(case, water__tilt="geostrophic"), name="geostrophic")
    vx, vy = slow.series("body_vx", "body_vy")
    assert np.hypot(vx - cx, vy - cy).max() > 0.01, "nothing but drag accelerates it there"


@pytest.mark.parametrize("latitude, tilt", [(75, "none"), (75, "geostrophic"), (-60, "none"), (0, "none")])
def test_ice_and_free_bodies_begin_adrift(tmp_path, latitude, tilt):
    """The balance of forces, by SciPy, from the first step on, each body its own; and the velocity stays to
    rounding."""
    case = changed(
        DRIFT,
        **(WEATHER | {"water__latitude": latitude, "water__tilt": tilt}),
        run={"dt": 2, "duration": 2000},
        output={"frame_interval": 100},
        floes=[DRIFT["floes"][0], {"shape": "square", "length": 30, "x": -3000, "y": 3000, "thickness": 2.5}])
    r = run(tmp_path, case)
    f = 2 * OMEGA * np.sin(np.radians(latitude))
    balance = CURRENT if tilt == "geostrophic" else (0, 0)
    with h5py.File(r.dir / "result.h5") as h:
        v, o, berg = h["floes/vertices"][:], h["floes/offsets"][:], h["bodies/vertices"][:4]
        pose, time = h["frames/pose"][:], h["frames/time"][:]
    got = np.array(r.series("body_vx", "body_vy"))
    want = steady_drift(turned(berg, np.radians(25)), 900 * 1800 * 25, 20, 5, BERG, f, balance)
    close = 2 * abs(f) + 1e-9  # Coriolis is a rotation in the scheme: its force is off by f dt / 2
    assert np.abs(got[:, 0] - want).max() < close * np.hypot(*(want - CURRENT))
    assert np.abs(got - got[:, :1]).max() < 1e-11
    drifts = []
    for i, h in enumerate((0.8, 2.5)):
        corners = turned(v[o[i]:o[i + 1]], pose[0, i, 2])
        area = 0.5 * np.sum(corners[:, 0] * np.roll(corners[:, 1], -1) - np.roll(corners[:, 0], -1) * corners[:, 1])
        draft = h * 910 / RHO_W
        drifts.append(steady_drift(corners, 910 * h * area, draft, h - draft, FLOE, f, balance))
        ways = (pose[1:, i, :2] - pose[0, i, :2]) / time[1:, None]
        assert np.abs(ways - drifts[i]).max() < close * np.hypot(*(drifts[i] - CURRENT)), i
        assert np.abs(ways - ways[0]).max() < 1e-10
    assert np.hypot(*(drifts[0] - drifts[1])) > 1e-3, "thickness counts"


FIELD = {
    "run": {"dt": 2, "duration": 60},
    "domain": {"frame": "geographic", "length": 400, "width": 300, "ends": "periodic", "sides": "periodic"},
    "ice": {"concentration": 0.5, "size": 20, "thickness": 0.5, "thickness_law": "lognormal"},
    "body": {"shape": "disc", "length": 40, "draft": 20},
    "tow": {"mode": "none"},
}
WINDY = changed(FIELD, water={"latitude": 75, "current_x": 0.1}, air={"wind_x": 8, "wind_y": -5})


def test_rest_is_rest_and_without_water_or_wind_nothing_changes(tmp_path):
    still = {start: run(tmp_path, changed(FIELD, ice__start=start, water={"latitude": 75}),
                        name=start) for start in ("drift", "rest")}
    assert still["drift"].hash == still["rest"].hash
    ways = []
    for start in ("rest", "drift"):
        r = run(tmp_path,
                changed(WINDY, ice__start=start, run={"dt": 0.1, "duration": 1}, output={"frame_interval": 0.1}),
                name=f"windy {start}")
        pose = r.dataset("/frames/pose")
        ways.append([np.hypot(*[v[0] for v in r.series("body_vx", "body_vy")]),
                     np.median(np.hypot(*(pose[1] - pose[0])[:, :2].T)) / 0.1])
    assert max(ways[0]) < 0.02 < 0.1 < min(ways[1]), ways


@pytest.mark.parametrize("ends, sides, still", [("wall", "wall", "xy"), ("open", "wall", "y"),
                                                ("wall", "periodic", "x"), ("moving", "wall", "y")])
def test_ice_does_not_drift_across_walls(tmp_path, ends, sides, still):
    case = changed(WINDY,
                   domain__ends=ends,
                   domain__sides=sides,
                   run__dt=0.1,
                   run__duration=1,
                   output={"frame_interval": 0.1},
                   ice__concentration=0.2,
                   tow={"mode": "speed", "speed": 0.8, "ramp": 0.2},
                   body__x=-80)
    r = run(tmp_path, case)
    step = np.diff(r.dataset("/frames/pose")[:2], axis=0)[0, :, :2] / 0.1
    for k, axis in enumerate("xy"):
        typical = np.median(np.abs(step[:, k]))
        assert typical < 2e-3 if axis in still else typical > 0.03, (axis, typical)


@pytest.mark.parametrize("mode, drifts", [("none", True), ("line", False), ("thrust", False), ("speed", False)])
def test_a_body_on_a_line_or_led_does_not_begin_adrift(tmp_path, mode, drifts):
    tow = {
        "none": {}, "speed": {"speed": 0.5, "ramp": 60},
        "line": {"speed": 0.5, "line_length": 100, "line_stiffness": 1e6, "ramp": 1000}, "thrust": {
            "speed": 0.5, "line_length": 100, "line_stiffness": 1e6, "ramp": 1000,
            "vessel": {"mass": 3e6, "bollard_pull": 1e6, "free_speed": 7}
        }
    }[mode]
    r = run(tmp_path, changed(WINDY, domain__length=1000, tow={"mode": mode, **tow}, body__x=-300), "--steps", 1)
    vx, vy = r.series("body_vx", "body_vy")
    assert (np.hypot(vx[0], vy[0]) > 0.1) == drifts


def test_a_given_velocity_prevails(tmp_path):
    case = changed(WINDY, body__vy=-0.5, floes=[{"shape": "disc", "length": 10, "x": 150, "y": 100, "vx": 0.7}],
                   ice__concentration=0, run__dt=0.01, run__duration=0.02)
    r = run(tmp_path, case)
    assert r.series("body_vx")[0] == pytest.approx(0, abs=1e-3) and r.series("body_vy")[0] == pytest.approx(-0.5,
                                                                                                            abs=1e-3)
    way = np.diff(r.dataset("/frames/pose")[:, 0, :2], axis=0)[0] / 0.01
    assert way == pytest.approx([0.7, 0], abs=1e-2)


def test_the_resolved_file_and_resume_begin_alike(tmp_path):
    whole = run(tmp_path, WINDY)
    assert run(tmp_path, whole.dir / "case.resolved.yml", name="again").hash == whole.hash
    for threads in (1, 2):
        part = tmp_path / f"part{threads}"
        assert call("run", write_case(tmp_path, WINDY), "-o", part, "--quiet", "--steps", 7, "--threads", threads,
                    env=environment()).returncode == DONE
        assert call("resume", part, "--quiet").returncode == DONE
        assert f'"state_hash": "{whole.hash}"' in (part / "summary.json").read_text()
    listing = call("--list-keys").stdout
    assert "ice.start" in listing and "drift | rest" in listing
    said = call("check", write_case(tmp_path, WINDY)).stdout
    assert "free drift, body" in said and "free drift, mean floe" in said
    assert "free drift, mean floe" not in call("check", write_case(tmp_path, changed(WINDY, ice__start="rest"))).stdout
