# SPDX-License-Identifier: MIT
"""What must balance in every run: forces on the body, momentum, energy, floes; and where free bodies drift."""
import h5py
import numpy as np
import pytest

from harness import CASE, TOW, changed, placed, quick, run, warned, worst_overlap

# Forces differ in kind: a prescribed speed leaves the tow force to the balance; on a line it is the line's own.
BALANCES = {
    "speed": TOW,
    "speed askew, e = 0.5": changed(TOW, tow__direction=15, ice__restitution=0.5, body__shape="square"),
    "line": changed(TOW, tow__mode="line"),
    "slack line, e = 0.5": changed(TOW,
                                   tow={
                                       "mode": "line", "speed": 0.2, "direction": 10, "ramp": 1, "hull_y": 0.4,
                                       "hull_x": 0.8, "line_length": 1.5, "line_stiffness": 300, "line_damping": 0
                                   },
                                   ice__restitution=0.5),
    "line, current, wind, Coriolis": changed(TOW,
                                             tow__mode="line",
                                             water={"latitude": 75, "current_y": 0.05},
                                             air={"wind_x": -3}),
    "speed, current, slope, Coriolis": changed(
        TOW, water={"latitude": 75, "current_y": 0.05, "tilt": "slope", "slope_x": 1e-5}),
    # Everything that changes: the tide turns within the run.
    "line, tide, dynamic tilt, wind, Coriolis, geographic": changed(
        TOW,
        domain__frame="geographic",
        domain__ends="wall",
        domain__sides="wall",
        domain__x0=0,
        tow__mode="line",
        tow__line_length=5,
        tow__line_stiffness=10e3,
        tow__line_damping=100,
        tow__direction=10,
        air={"wind_x": 2, "wind_y": 4},
        water={
            "latitude": 75, "current_x": 0.02, "tilt": "dynamic",
            "tide": {"major": 0.1, "minor": 0.05, "period": 40, "inclination": 70}
        }),
    "speed, tide, geostrophic, wind, Coriolis, geographic": changed(
        TOW,
        domain__frame="geographic",
        domain__ends="wall",
        domain__sides="wall",
        domain__x0=0,
        air={"wind_x": -2, "wind_y": 4},
        water={
            "latitude": -75, "tilt": "geostrophic", "tide": {"major": 0.1, "minor": -0.05, "period": 40, "phase": 100}
        }),
    "none, tide, dynamic tilt, wind, Coriolis": changed(
        TOW,
        tow={"mode": "none"},
        body__vx=0.2,
        air={"wind_x": 5},
        solver={"reference_speed": 0.13},
        water={"latitude": 75, "tilt": "dynamic", "tide": {"major": 0.1, "minor": 0.05, "period": 40}}),
}


@pytest.fixture(scope="module",
                params=quick(BALANCES, "line, tide, dynamic tilt, wind, Coriolis, geographic",
                             "speed, tide, geostrophic, wind, Coriolis, geographic"))
def balanced(request, tmp_path_factory):
    case = changed(BALANCES[request.param], output__window_start=4)  # many steps, also on a line that is jerked
    return case, run(tmp_path_factory.mktemp("balance"), case)


def resistance_is(case, summary, mean, rel):
    """The ice resistance is against the tow: without one it is none."""
    found = summary["mean_ice_resistance_n"]
    assert found is None if case["tow"].get("mode") == "none" else found == pytest.approx(mean, rel=rel)


def test_forces_on_the_body(balanced):
    """tow = ice + drag + Coriolis + tilt + inertia in every sample, and in the means of the summary to 1e-6.

    On a line this holds the spring's tension, the contact rows, the drag formulas and the velocities against each
    other.
    """
    case, r = balanced
    tow, *others = r.series("tow_force", "ice_resistance", "drag_force", "coriolis_force", "tilt_force",
                            "inertia_force")
    scale = np.abs([tow, *others]).max(axis=0) # the largest term of that sample
    assert np.abs(others[0]).max() > 1 and np.abs(others[1]).max() > 0.1
    assert np.all(np.abs(tow - sum(others)) <= 1e-9 * scale)
    s = r.summary
    mean = s["mean_tow_force_n"] - sum(s[f"mean_{name}_force_n"] for name in ("drag", "coriolis", "tilt", "inertia"))
    resistance_is(case, s, mean, 1e-6)
    assert s["budget"]["tow_minus_other_forces_n"] == pytest.approx(mean, rel=1e-9)
    assert not warned(r, "balance")


def moment(v):
    """Polar moment of area about the centroid, which is the origin."""
    x, y = v.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    nx, ny = np.roll(x, -1), np.roll(y, -1)
    return np.sum(cross * (x * x + x * nx + nx * nx + y * y + y * ny + ny * ny)) / 12


def cubic(v):
    """Integral of r³ over the area, by triangles to the origin: a fifth of the cube of the distance along the edge,
    times its distance."""
    t, weight = np.polynomial.legendre.leggauss(20)
    total = 0
    for p, q in zip(v, np.roll(v, -1, axis=0)):
        r = np.hypot(*(p[:, None] + (q - p)[:, None] * (t + 1) / 2))
        total += (p[0] * q[1] - p[1] * q[0]) * np.sum(weight / 2 * r**3) / 5
    return total


def outline_drag(outline, yaw, at, ref, skin, form):
    """Drag of one fluid as load - matrix @ (u, v, w): skin |v| v, and form max(0, -v.n) v along the outline, with the
    arm along each side, by quadrature over the sides that water meets."""
    c, s = np.cos(yaw), np.sin(yaw)
    corners = outline @ np.array([[c, s], [-s, c]])
    nodes, weights = np.polynomial.legendre.leggauss(5)

    def local(r):
        return ref - at[:2] - at[2] * np.array([-r[1], r[0]])

    points = [(skin * np.hypot(*(ref - at[:2])), np.zeros(2))]
    for p, q in zip(corners, np.roll(corners, -1, axis=0)):
        normal = np.array([q[1] - p[1], p[0] - q[0]])
        low, high = -local(p) @ normal, -local(q) @ normal
        cut = [0, low / (low - high), 1] if low * high < 0 else [0, 1]
        for a, b in zip(cut, cut[1:]):
            for x, weight in zip(nodes, weights):
                r = p + (q - p) * (a + (b - a) * (x + 1) / 2)
                arm = (q - p) * ((q - p) @ r) / ((q - p) @ (q - p))
                points.append((form * weight * (b - a) / 2 * max(0, -local(r) @ normal), arm))
    matrix, load = np.zeros((3, 3)), np.zeros(3)
    for g, r in points:
        j = np.array([[1, 0, -r[1]], [0, 1, r[0]]])
        matrix += g * j.T @ j
        load += g * j.T @ ref
    return matrix, load


def test_drag_coriolis_and_tilt_by_their_formulas(balanced):
    """Each from the recorded velocities and the case's own numbers: the budget closes term by term, not in the sum
    alone."""
    case, r = balanced
    names = ("time body_vx body_vy body_yaw_rate body_yaw drag_force coriolis_force tilt_force "
             "current_x current_y wind_x wind_y").split()
    t, vx, vy, spin, yaw, drag, coriolis, tilt, *fluids = r.series(*names)
    water, air = case.get("water", {}), case.get("air", {})
    flow = np.array(fluids).reshape(2, 2, -1)
    tide = water.get("tide", {})
    mean = np.array([[water.get("current_x", 0), water.get("current_y", 0)],
                     [air.get("wind_x", 0), air.get("wind_y", 0)]])
    i, turn = np.radians(tide.get("inclination", 0)), 2 * np.pi / tide.get("period", 1)
    axes = np.array([[np.cos(i), -np.sin(i)], [np.sin(i), np.cos(i)]]) * [tide.get("major", 0), tide.get("minor", 0)]

    def current(time):
        a = turn * np.asarray(time) - np.radians(tide.get("phase", 0))
        return mean[0][:, None] + axes @ np.array([np.cos(a), np.sin(a)])

    np.testing.assert_allclose(flow[0], current(t - 0.05), atol=1e-12)
    np.testing.assert_allclose(flow[1], np.repeat(mean[1][:, None], len(t), axis=1), atol=1e-12)
    angle = np.radians(case["tow"].get("direction", 0))
    along = np.array([np.cos(angle), np.sin(angle)])
    with h5py.File(r.dir / "result.h5") as f:
        area, height, outline = f["bodies/area"][0], f["bodies/height"][0], f[
            "bodies/vertices"][:f["bodies/offsets"][1]]
    mass, draft = 1.5 * 900 * area * height, 0.5
    prescribed = case["tow"].get("mode", "speed") == "speed"
    u = np.array([vx, vy, spin])
    start = np.column_stack([[case["body"].get("vx", 0), 0, 0], u[:, :-1]])
    before = np.concatenate([[0], yaw[:-1]])

    right = 1 if case["domain"].get("frame") == "geographic" else -1
    f = right * 2 * 7.292115e-5 * np.sin(np.radians(water.get("latitude", 0)))
    gyre = np.array([[0, -f], [f, 0]])
    moving = (u if prescribed else start)[:2]
    slope = water.get("tilt", "none")
    here, last = current(t - 0.05), current(np.maximum(t - 0.15, 0))
    # Added mass takes no part in Coriolis and slope (a third of the whole here), but goes along with water that is
    # accelerated.
    push = {
        "none": np.zeros_like(moving),
        "slope": np.zeros_like(moving) + np.array([[-9.81 * water.get("slope_x", 0)], [0]]) / 1.5,
        "geostrophic": -gyre @ here / 1.5, "dynamic": -gyre @ last / 1.5 + (here - last) / 0.1
    }[slope]
    want = np.zeros_like(moving)
    inertia = np.diag([mass, mass, mass * moment(outline) / area])
    # The coefficient is that of the speed at the start of the step (of the prescribed speed itself), the velocity that
    # at its end; what couples turning and drift, that of the body without contacts and line.
    some = slice(None, None, 4)
    for k in np.arange(len(t))[some]:
        at = (u if prescribed else start)[:, k]
        matrix, load = outline_drag(outline, before[k], at, flow[0, :, k], 1027 * 5e-4 * area,
                                    0.5 * 1027 * 0.85 * draft)
        of_air = outline_drag(outline, before[k], at, flow[1, :, k], 1.29 * 2.5e-4 * area,
                              0.5 * 1.29 * 0.4 * (height - draft))
        matrix, load = matrix + of_air[0], load + of_air[1]
        matrix[2, 2] += (1027 * 5e-4 + 1.29 * 2.5e-4) * cubic(outline) * abs(at[2])
        force = load - matrix @ u[:, k]
        if not prescribed:
            turned = at + 0.1 * np.append(push[:, k] + gyre @ at[:2] / 1.5, 0)
            free = np.linalg.solve(inertia + 0.1 * matrix, inertia @ turned + 0.1 * load)
            force += (matrix - np.diag(np.diag(matrix))) @ (u[:, k] - free)
        want[:, k] = force[:2]
    scale = np.abs(want).max()
    np.testing.assert_allclose(drag[some], -(along @ want)[some], atol=1e-9 * scale)

    # The rotation by f dt is that force but for f dt / 2 = 7e-6 of it.
    np.testing.assert_allclose(coriolis, -mass / 1.5 * (along @ gyre @ moving), atol=1e-5 * mass * abs(f) * 0.5)
    np.testing.assert_allclose(tilt, -mass * (along @ push), atol=1e-5 * mass * abs(f) * 0.5 + 1e-12 * mass)
    # A body that is led along a straight line has its Coriolis force across.
    assert (np.abs(coriolis).max() > 0) == (f != 0 and not prescribed) and (np.abs(tilt).max() > 0) == (slope != "none")


def test_inertia_is_mass_times_acceleration(balanced):
    """From the recorded velocities alone; the mass, added mass included, from the case's own numbers."""
    case, r = balanced
    vx, vy, inertia = r.series("body_vx", "body_vy", "inertia_force")
    angle = np.radians(case["tow"].get("direction", 0))
    v = np.concatenate([[case["body"].get("vx", 0) * np.cos(angle)], vx * np.cos(angle) + vy * np.sin(angle)])
    with h5py.File(r.dir / "result.h5") as f:
        area, height = f["bodies/area"][0], f["bodies/height"][0]
    mass = 1.5 * 900 * area * height
    assert np.allclose(inertia, mass * np.diff(v) / 0.1, rtol=1e-7, atol=1e-6)


def test_tension_is_the_spring_and_pulls_only(balanced):
    case, r = balanced
    tension, length, x, y = r.series("line_tension", "line_length", "carriage_x", "carriage_y")
    if case["tow"].get("mode") != "line":
        assert np.isnan([tension, length, x, y]).all(), "there is no line"
        return
    tow = case["tow"]
    assert tension.min() >= 0
    if tow.get("line_stiffness") == 300:
        # Soft for the step: T = k (l − L0) at the start of the step, and the line goes slack now and then.
        k = 300 / 1.5
        np.testing.assert_allclose(tension, np.maximum(0, k * (length - 1.5)), atol=1e-9 * tension.max())
    # The carriage keeps to its ramp and its heading.
    v = np.hypot(np.diff(x), np.diff(y)) / 0.1
    assert v[-1] == pytest.approx(tow["speed"], rel=1e-9)
    assert np.arctan2(y[-1] - y[0], x[-1] - x[0]) == pytest.approx(np.radians(tow.get("direction", 0)), abs=1e-9)


def test_resistance_by_the_momentum_of_everything_else(balanced):
    case, r = balanced
    ice, budget = r.series("ice_resistance", "ice_resistance_budget")
    assert np.abs(ice - budget).max() <= 1e-9 * np.abs(ice).max()
    resistance_is(case, r.summary, r.summary["mean_ice_resistance_budget_n"], 1e-6)


def test_means_are_those_of_the_series(balanced):
    case, r = balanced
    time, ice, tow = r.series("time", "ice_resistance", "tow_force")
    w = r.summary["window"]
    inside = (time >= w["start_s"] - 1e-9) & (time <= w["end_s"] + 1e-9)
    assert inside.sum() == w["n_samples"] > 100
    resistance_is(case, r.summary, ice[inside].mean(), 1e-12)
    assert r.summary["mean_tow_force_n"] == pytest.approx(tow[inside].mean(), rel=1e-12)
    assert r.summary["peak_ice_resistance_n"] == ice[inside].max()
    # Its standard error: the slowest two or three waves of at most 96 batches (docs/statistics.md).
    n, x = inside.sum(), ice[inside] - ice[inside].mean()
    ends = n * np.arange(97) // 96
    batches, middles = np.add.reduceat(x, ends[:-1]), (ends[1:] + ends[:-1]) / 2
    waves = [2 / n * (batches @ np.cos(np.pi * j * middles / n))**2 for j in (1, 2, 3)]
    se = (max(np.mean(waves[:2]), np.mean(waves)) / n)**0.5
    assert r.summary["mean_ice_resistance_se_n"] in (None, pytest.approx(se, rel=1e-9))


def test_momentum_every_step(balanced):
    _, r = balanced
    assert r.series("momentum_residual").max() <= 1e-10
    assert r.summary["momentum_residual"] == r.series("momentum_residual").max()


@pytest.mark.parametrize("mode", ["speed", "line"])
@pytest.mark.parametrize("restitution, friction", quick([(0, 0), (0, 0.3), (0.5, 0), (0.5, 0.3), (1, 0), (1, 0.3)],
                                                        (0, 0), (0.5, 0.3), (1, 0.3)))
def test_contacts_never_add_energy(tmp_path, mode, restitution, friction):
    """With an exact solution λᵀ(w* + w2)/2 <= 0; a residual ε leaves up to Σλ ε.

    Newton's law of restitution alone gains energy where several contacts, or friction, act at once (Kane's paradox).
    """
    r = run(tmp_path, changed(TOW, tow__mode=mode, ice__restitution=restitution, ice__friction=friction,
                              solver__tolerance=1e-7, ice__concentration=0.4, solver__max_sweeps=3000))
    work = r.series("contact_work")
    assert work.min() < -1e-3, "nothing collided"
    assert not r.series("added_energy").any()
    assert r.summary["contact_work_j"] == pytest.approx(work.sum(), rel=1e-12)


HELD = {"run": {"dt": 5, "duration": 600},
        "domain": {"frame": "geographic", "length": 1000, "width": 1000, "ends": "open", "sides": "open"},
        "ice": {"concentration": 0, "thickness": 0.3, "size": 30}, "air": {"wind_x": 20}, "body": {"shape": "none"},
        "floes": [{"shape": "rectangle", "length": 100, "width": 300, "x": 65, "y": 0, "fixed": True},
                  {"shape": "square", "length": 30, "x": 0, "y": 0, "vx": 0, "vy": 0}],
        "solver": {"reference_speed": 0.3}}


def test_a_contact_at_rest_does_no_work(tmp_path):
    """Red: work from the velocity after the loads, ½ λᵀWλ in each step of a floe that wind presses on fixed ice."""
    r = run(tmp_path, HELD)
    assert r.series("contacts").min() > 0 and abs(r.summary["contact_work_j"]) < 1e-6


def test_the_work_of_crushing_is_load_times_depth(tmp_path):
    """A berg that a line draws slowly into fixed ice: its load hardly changes. Red as above: 17 % too much."""
    r = run(tmp_path, changed(HELD, run__duration=1500, air=None, ice={"concentration": 0, "thickness": 1, "size": 30,
                                                                      "crushing": {"pressure": 10e3}},
                              floes=[{"shape": "rectangle", "length": 100, "width": 300, "x": 90.1, "y": 0,
                                      "fixed": True}],
                              body={"shape": "square", "length": 80, "draft": 60, "x": 0, "y": 0},
                              tow={"mode": "line", "speed": 0.02, "line_length": 400, "line_stiffness": 20e6,
                                   "line_damping": 1e6, "ramp": 100}))
    load = r.series("ice_resistance")[-1]
    assert r.summary["crushed_work_j"] == pytest.approx(load * r.summary["max_crushed_depth_m"], rel=0.01)


def test_work_that_is_positive_is_reported(tmp_path):
    r = run(tmp_path, changed(TOW, ice__restitution=1, solver__tolerance=1e-6))
    gained = int(np.sum(r.series("added_energy")))
    assert r.summary["positive_work_steps"] == gained
    assert bool(warned(r, f"in {gained} of 300 steps the contacts added energy")) == (gained > 0)


def test_unconverged_steps_are_reported(tmp_path):
    r = run(tmp_path, changed(TOW, solver__max_sweeps=2))
    unconverged, residual, sweeps, updates = r.series("unconverged", "residual", "sweeps", "contact_updates")
    n = r.summary["unconverged_steps"]
    assert n == unconverged.sum() > 5
    assert n == np.sum(residual > 0.13 * 1e-3)
    # The limit is one of work: six updates of every contact (of a point or two) for each of two sweeps, and a tenth
    # more, which the last sweep may pass by two turns; a step that outruns its margin is solved again, at most four
    # times. No step here takes more than three for each sweep and solution.
    assert np.all(updates <= 5 * (3 * 2 + 2) * r.series("contacts"))
    assert r.summary["mean_contact_updates"] == pytest.approx(
        updates.mean()) and r.summary["mean_sweeps"] == pytest.approx(sweeps.mean())
    plain = run(tmp_path, changed(TOW, solver__max_sweeps=2, solver__plain=True), name="plain")
    swept, moved = plain.series("sweeps", "momentum_moves")
    assert np.median(swept) == 2 and swept.max() <= 2 * 5 and not moved.any()
    assert r.summary["max_residual_m_s"] == residual.max()
    assert warned(r, rf"{n} of 300 steps reached the work limit .*raise solver.max_sweeps")
    assert "warning: " in r.result.stdout and f"{n} steps unconverged" in r.result.stdout
    # Momentum holds all the same: every impulse acts on both bodies.
    assert r.summary["momentum_residual"] <= 1e-10
    good = run(tmp_path, changed(TOW, solver__max_sweeps=5000, solver__tolerance=1e-2), name="good")
    assert good.summary["unconverged_steps"] == 0 and not warned(good, "work limit")


@pytest.mark.slow
def test_the_mean_does_not_hang_on_the_tolerance(tmp_path):
    """Tenfold tighter: the mean over four fields moves by less than its standard error, each single one by less than
    two."""
    change, error = [], []
    for seed in (1, 2, 3, 4):
        case = changed(TOW, ice__concentration=0.3, ice__seed=seed, run__duration=60, domain__length=16,
                       solver__max_sweeps=2000)
        a = run(tmp_path, case, name=f"a{seed}").summary
        b = run(tmp_path, changed(case, solver__tolerance=1e-4), name=f"b{seed}").summary
        change.append(b["mean_ice_resistance_n"] - a["mean_ice_resistance_n"])
        error.append(a["mean_ice_resistance_se_n"])
    assert np.all(np.abs(change) < 2 * np.array(error)), (change, error)
    assert abs(np.mean(change)) < np.linalg.norm(error) / len(error), (change, error)


DEEP, ABREAST, SIDE, SPEED = 35, 26, 30.0, 0.5  # floes, floes, m, m/s


def pushed(width, **changes):
    """910 floes at rest in bond, edge to edge, and behind them a body of this width that has the speed from the first
    step on. Nothing else acts, so that what the body bears is momentum of the floes."""
    nothing = dict.fromkeys(("water_form", "water_skin", "air_form", "air_skin"), 0)
    floes = [{"shape": "rectangle", "length": SIDE, "width": SIDE, "x": SIDE * (i + 0.5),
              "y": SIDE * (j - (ABREAST - 1) / 2 + 0.5 * (i % 2)), "thickness": 1} for i in range(DEEP)
             for j in range(ABREAST)]
    return changed({
        "run": {"dt": 5, "duration": 40},
        "domain": {"frame": "geographic", "x0": -200, "y0": -600, "length": 3000, "width": 1200, "ends": "open",
                   "sides": "open"},
        "ice": {"concentration": 0, "friction": 0.35, "density": 910, "thickness": 1, "drag": nothing},
        "body": {"shape": "rectangle", "length": 100, "width": width, "x": -50, "y": 0, "draft": 40, "drag": nothing},
        "tow": {"mode": "speed", "speed": SPEED, "ramp": 0}, "floes": floes,
        "output": {"window_start": 0, "frame_interval": 40},
    }, **changes)


def borne(tmp_path, case, name):
    """Impulse on the body up to each step, N s."""
    r = run(tmp_path, case, name=name)
    assert r.summary["unconverged_steps"] == 0 and r.summary["momentum_residual"] < 1e-10
    return 5 * np.cumsum(r.series("ice_resistance"))


def test_a_jam_that_moves_as_one_takes_its_momentum_at_the_default_tolerance(tmp_path):
    """A body as wide as the floes gives all of them its speed in one step: the impulse is their mass times it. What the
    default leaves is within 0.3 %, in that step and in all together, and a hundredth of the tolerance leaves a
    fiftieth of that."""
    momentum = DEEP * ABREAST * SIDE**2 * 910 * SPEED
    for tolerance, within in ((None, 3e-3), (1e-5, 6e-5)):
        found = borne(tmp_path, pushed(SIDE * (ABREAST + 1), solver__tolerance=tolerance), str(tolerance)) / momentum
        assert np.abs(found - 1).max() < within, found - 1


def test_a_jammed_step_is_short_of_its_impulse_at_the_default_tolerance(tmp_path):
    """The load of a narrow body spreads through 35 rows of floes with friction. The step that begins to push is short
    by 0.8 % of the impulse at a tenth of the tolerance; the next steps bring a part of what it lacks, and half a per
    cent stays with floes that are slower by a few tolerances."""
    case = pushed(200, solver__max_sweeps=10000)
    loose, tight = (borne(tmp_path, changed(case, solver__tolerance=t), str(t)) for t in (None, 1e-4))
    short = 1 - loose / tight[-1]
    assert 0.003 < short[0] < 0.015, short
    assert np.all(np.diff(short) <= 0) and 0 < short[-1] < 0.007, short


# ---- boundaries ----

def test_periodic_both_ways_keeps_every_floe(tmp_path):
    case = changed(TOW, domain={"length": 12, "width": 7, "ends": "periodic", "sides": "periodic"}, run__duration=60,
                   tow={"speed": 0.3, "direction": 30, "ramp": 1}, output={"frame_interval": 1})
    r = run(tmp_path, case)
    assert r.summary["floes_outside"] == 0
    pose = r.dataset("/frames/pose")
    assert pose.shape == (61, r.summary["n_floes"], 3) and np.isfinite(pose).all()
    assert np.all((pose[:, :, 0] >= 0) & (pose[:, :, 0] < 12)) and np.all((pose[:, :, 1] >= -3.5)
                                                                          & (pose[:, :, 1] < 3.5))
    # The body has been round: its series go on, its frames wrap.
    x, y = r.series("body_x", "body_y")
    way = 0.3 * (60 - 0.5) * np.array([np.cos(np.radians(30)), np.sin(np.radians(30))])
    assert [x[-1] - 3, y[-1]] == pytest.approx(way, rel=2e-3)
    body = r.dataset("/frames/body_pose")[:, 0]
    assert body[:, 0].max() < 12 and np.any(np.diff(body[:, 0]) < -6)
    # Contacts act across the seams: floes and their images stay apart.
    with h5py.File(r.dir / "result.h5") as f:
        v, o = f["floes/vertices"][:], f["floes/offsets"][:]
    last = [placed(v[o[i]:o[i + 1]], p) for i, p in enumerate(pose[-1])]
    images = [p + np.array([i * 12, j * 7]) for i in (0, 1) for j in (-1, 0, 1) if (i, j) > (0, 0) for p in last]
    assert worst_overlap(last + images) < 0.01


def test_floes_that_leave_are_counted(tmp_path):
    case = changed(TOW, domain__ends="open", domain__sides="open", water={"current_x": 0.3, "current_y": -0.1})
    r = run(tmp_path, case)
    last = r.dataset("/frames/pose")[-1]
    out = np.sum((last[:, 0] < 0) | (last[:, 0] > 15) | (last[:, 1] < -4) | (last[:, 1] > 4))
    assert r.summary["floes_outside"] == out > 20
    assert warned(r, f"{out} floes left the open domain")


def test_walls_keep_floes_in(tmp_path):
    case = changed(TOW, water={"current_x": 0.3, "current_y": -0.1})
    r = run(tmp_path, case)
    pose = r.dataset("/frames/pose")
    with h5py.File(r.dir / "result.h5") as f:
        v, o = f["floes/vertices"][:], f["floes/offsets"][:]
    world = np.concatenate([placed(v[o[i]:o[i + 1]], p) for i, p in enumerate(pose[-1])])
    assert r.summary["floes_outside"] == 0
    assert world[:, 0].min() > -0.02 and world[:, 0].max() < 15.02 and np.abs(world[:, 1]).max() < 4.02


# ---- floes by hand ----

def test_floes_by_hand(tmp_path):
    """A large floe is pushed by the body into small ones, and all against a fixed one."""
    small = [{"shape": "square", "length": 0.5, "x": 7 + 0.7 * (i % 3), "y": -1.5 + 0.7 * (i // 3), "yaw": 11 * i}
             for i in range(15)]
    case = {
        "run": {"dt": 0.1, "duration": 11},
        "domain": {"length": 14, "width": 8},
        "ice": {"concentration": 0},
        "body": {"shape": "disc", "length": 2, "x": 2},
        "tow": {"speed": 0.3, "ramp": 0},
        "output": {"frame_interval": 0.5},
        "floes": [{"shape": "rectangle", "length": 2.4, "width": 5, "x": 5, "y": 0.2}] + small +
        [{"shape": "square", "length": 1, "x": 11, "y": 0, "yaw": 45, "fixed": True, "thickness": 1}],
    }
    r = run(tmp_path, case)
    pose = r.dataset("/frames/pose")
    assert pose.shape[1] == 17
    assert np.ptp(pose[:, 16], axis=0).max() == 0, "the fixed one has moved"
    assert pose[-1, 0, 0] > 5.5 and np.sum(pose[-1, 1:16, 0] > pose[0, 1:16, 0] + 0.3) > 5
    with h5py.File(r.dir / "result.h5") as f:
        v, o = f["floes/vertices"][:], f["floes/offsets"][:]
        b, q = f["bodies/vertices"][:], f["bodies/offsets"][:]
    for t in range(0, len(pose), 4):
        every = [placed(v[o[i]:o[i + 1]], p) for i, p in enumerate(pose[t])]
        assert worst_overlap(every + [placed(b[q[0]:q[1]], r.dataset("/frames/body_pose")[t, 0])]) < 0.01, t
    assert r.dataset("/floes/thickness")[16] == 1
    ice, budget = r.series("ice_resistance", "ice_resistance_budget")
    assert ice.max() > 0 and np.abs(ice - budget).max() < 1e-9 * ice.max()


def test_floes_by_hand_beside_a_field(tmp_path):
    """Made floes give way to those by hand, or the case is refused; it is never run with overlap."""
    case = changed(TOW, floes=[{"shape": "disc", "length": 3, "x": 9, "y": 0.5}], run__duration=1)
    r = run(tmp_path, case)
    with h5py.File(r.dir / "result.h5") as f:
        v, o, pose = f["floes/vertices"][:], f["floes/offsets"][:], f["frames/pose"][0]
    assert worst_overlap([placed(v[o[i]:o[i + 1]], p) for i, p in enumerate(pose)]) < 1e-3
    assert pose[-1, 0] == 9
    clash = changed(TOW,
                    floes=[{"shape": "disc", "length": 3, "x": 9, "y": 0.5},
                           {"shape": "disc", "length": 1, "x": 10, "y": 0.5}],
                    ice__concentration=0)
    refused = run(tmp_path, clash, name="clash", code=CASE)
    assert "overlap by" in refused.result.stderr


# ---- free drift ----

DRIFT = {
    "run": {"dt": 5, "duration": 10000},
    "domain": {"frame": "geographic", "length": 20000, "width": 20000, "ends": "open", "sides": "open"},
    "ice": {"concentration": 0, "thickness": 1},
    "body": {"shape": "disc", "length": 100, "draft": 50, "sail": 7},
    "tow": {"mode": "none"},
    "floes": [{"shape": "disc", "length": 40, "x": 300, "y": 300}],
    "output": {"frame_interval": 10000},
}


def drift(folder, name, **changes):
    r = run(folder, changed(DRIFT, **changes), name=name)
    body = np.array(r.series("body_x", "body_y"))[:, -1]
    pose = r.dataset("/frames/pose")
    return body, (pose[-1, 0] - pose[0, 0])[:2], r


@pytest.mark.parametrize("angle", [0, 60, 200])
def test_bodies_drift_with_the_wind(tmp_path, angle):
    """Without Coriolis exactly along the wind, at the speed at which air and water drag are equal: the square-root
    law."""
    wind = 10 * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    body, floe, r = drift(tmp_path, "out", air={"wind_x": wind[0], "wind_y": wind[1]})
    along = wind / 10
    for way in (body, floe):
        assert way @ along > 100 and abs(way[0] * along[1] - way[1] * along[0]) < 1e-6 * (way @ along)
    vx, vy = r.series("body_vx", "body_vy")
    with h5py.File(r.dir / "result.h5") as f:
        area, v = f["bodies/area"][0], f["bodies/vertices"][:]
    width = np.ptp(v @ np.array([-along[1], along[0]]))
    air = 0.5 * 1.29 * 0.4 * 7 * width + 1.29 * 2.5e-4 * area
    water = 0.5 * 1027 * 0.85 * 50 * width + 1027 * 5e-4 * area
    ratio = np.sqrt(air / water)
    assert vx[-1] * along[0] + vy[-1] * along[1] == pytest.approx(10 * ratio / (1 + ratio), rel=1e-2)
    assert r.series("tow_force").max() == 0


def test_coriolis_turns_right_in_the_north_and_left_in_the_south(tmp_path):
    """x is north, y is east: a wind to the north must drive the ice off to the east (right) at 75 deg N."""
    north, floe_north, _ = drift(tmp_path, "north", air={"wind_x": 10}, water={"latitude": 75})
    south, floe_south, _ = drift(tmp_path, "south", air={"wind_x": 10}, water={"latitude": -75})
    for n, s in ((north, south), (floe_north, floe_south)):
        assert n[0] > 0 and n[1] > 0.02 * n[0]
        assert s == pytest.approx([n[0], -n[1]], rel=1e-9)


def test_coriolis_in_the_basin_frame(tmp_path):
    """There y is to the left of x, seen from above: right is −y."""
    case = changed(DRIFT, domain__frame="basin", domain__x0=-10000, body__x=0, air={"wind_x": 10},
                   water={"latitude": 75})
    r = run(tmp_path, case)
    x, y = r.series("body_x", "body_y")
    assert x[-1] > 0 and y[-1] < -0.02 * x[-1]


def test_drift_with_the_current(tmp_path):
    body, floe, r = drift(tmp_path, "out", water={"current_x": 0.2, "current_y": -0.4})
    vx, vy = r.series("body_vx", "body_vy")
    assert vy[-1] / vx[-1] == pytest.approx(-2, rel=1e-6)
    assert 0.15 < vx[-1] < 0.2
    assert floe[1] / floe[0] == pytest.approx(-2, rel=1e-6)
