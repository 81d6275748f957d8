# SPDX-License-Identifier: MIT
"""Floes that split, on whole runs: answers of statics and of scaling, symmetries, and what a split leaves as it was.

Three drives. The wind on a floe that leans on another is a load that lasts, and with its skin drag alone the force on
each contact follows from the areas. A wedge at a speed is a collision, whose peak follows from the speed. And floes
between others that come from two sides, or from one towards what cannot move, bear for a step what stops those."""
import math

import h5py
import numpy as np
import pytest

from harness import TOW, call, changed, run

SIDE, MU, DENSITY = 30.0, 0.1, 910.0
TOUGHNESS, STRENGTH = 150e3, 300e3


def area(p):
    x, y = p.T
    return 0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum()


def centroid(p):
    x, y = p.T
    c = x * np.roll(y, -1) - np.roll(x, -1) * y
    return np.array([((x + np.roll(x, -1)) * c).sum(), ((y + np.roll(y, -1)) * c).sum()]) / (6 * area(p))


def polar(p):
    """Polar moment of area of an outline about its centroid, m⁴."""
    x, y = (p - centroid(p)).T
    u, v = np.roll(x, -1), np.roll(y, -1)
    return ((x * v - u * y) * (x * x + x * u + u * u + y * y + y * v + v * v)).sum() / 12


def floe(corners, turn=lambda p: p, speed=None, **more):
    """By its corners in the frame of the domain, anticlockwise; turn: where the scene has a point; without a speed it
    drifts."""
    p = turn(np.array(corners, float))
    p = p if area(p) > 0 else p[::-1]
    c, moving = centroid(p), {}
    if speed is not None:
        v = turn(np.array([speed, (0.0, 0.0)]))
        moving = {"vx": v[0, 0] - v[1, 0], "vy": v[0, 1] - v[1, 1]}
    return {"shape": "polygon", "vertices": (p - c).tolist(), "x": c[0], "y": c[1], **moving, **more}


def block(x0, x1, y0, y1, **more):
    return floe([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], **more)


def made(r):
    with h5py.File(r.dir / "result.h5") as f:
        return {name: data[()] for group in ("splits", "pieces") for name, data in f[group].items()}


# --- loads that last -------------------------------------------------------------------------------------------------


def pressed(strength, pusher, posts):
    """A square from x = 600 m on that the wind and a pusher hold against posts. Without a size effect."""
    return {
        "run": {"dt": 1.0, "duration": 30.0},
        "domain": {"length": 1200, "width": 900},
        "ice": {"concentration": 0, "thickness": 1.0, "friction": 0.0, "restitution": 0.0,
                "drag": {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 2e-3, "sheltering": 0},
                "splitting": {"toughness": 1e9, "strength": strength, "generations": 1}},
        "air": {"wind_x": 20.0},
        "body": {"shape": "none"},
        "output": {"frame_interval": 1.0},
        "floes": [block(600, 600 + SIDE, -SIDE / 2, SIDE / 2), pusher, *posts]}


def three_points(arm):
    """A point at the middle of a side, and two at this arm on the other: scene, and stress at the far edge by the
    forces [T] of pusher and posts. The wind on the square is even, and unloads the middle."""
    pusher = floe([[560, -20], [592, -20], [600, 0], [592, 20], [560, 20]])
    end = 600 + SIDE
    posts = [floe([[end, y], [end + 2, y - 6], [end + 2, y + 6]], fixed=True) for y in (-arm, arm)]
    return pusher, posts, lambda push, hold: 6 * (hold / 2 * arm - (hold - push) / 2 * SIDE / 4) / SIDE**2


def squeeze(width):
    """Between two faces of this width: scene, and bursting stress."""
    pusher = floe([[540, -20], [590, -20], [600, -width / 2], [600, width / 2], [590, 20], [540, 20]])
    post = block(600 + SIDE, 610 + SIDE, -width / 2, width / 2, fixed=True)
    w = width / SIDE
    return pusher, [post], lambda push, hold: (0.637 * (1 - w**1.5) * push + 0.43 * (1 - w) * (hold - push)) / SIDE


@pytest.mark.parametrize("scene, size, mode", [(three_points, 12.0, 2), (three_points, 9.0, 2), (squeeze, 3.0, 3),
                                               (squeeze, 9.0, 3)])
def test_a_floe_bears_what_statics_say_and_no_more(tmp_path, scene, size, mode):
    """It holds at 1 % below its strength and splits along its middle at 1 % above. Until then no load is told that it
    would not have borne."""
    pusher, posts, stress_of = scene(size)

    def made_with(name, strength):
        (tmp_path / name).mkdir()  # the wind rises, so that the floe is seen to bear less than its strength first
        (tmp_path / name / "wind.csv").write_text("t,u,v\n0,0,0\n20,20,0\n30,20,0\n")
        r = run(tmp_path / name, changed(pressed(strength, pusher, posts), air={"wind_table": "wind.csv"}))
        force = r.dataset("frames/contact_force")
        return r, stress_of(force[:, 1], force[:, 2:2 + len(posts)].sum(axis=1))

    whole, stress = made_with("whole", 1e9)  # contacts are a little soft: it swings about a steady value, slowly
    assert whole.summary["splitting"]["splits"] == 0
    assert whole.dataset("frames/contact_force")[-1, 1] > 1000 and stress[-1] > 0.93 * stress.max()
    held, _ = made_with("held", stress.max() / 0.99)
    assert held.summary["splitting"]["splits"] == 0
    split, told = made_with("split", stress.max() / 1.01)
    one = made(split)
    assert one["mode"].tolist() == [mode] and one["parent"].tolist() == [0] and 1 < one["ratio"][0] < 1.0101
    np.testing.assert_allclose(one["area"], SIDE**2 / 2, rtol=1e-6)
    np.testing.assert_allclose(np.sort(one["crack"][0].reshape(2, 2), axis=0), [[600, 0], [600 + SIDE, 0]], atol=0.01)
    whole_until = np.isfinite(split.dataset("frames/pose")[:, 0, 0])
    assert 1 < whole_until.sum() < len(told) and told[whole_until].max() <= stress.max() / 1.01 * (1 + 1e-6)


def bent_at_its_neck(width):
    """Blocks of 10 and 30 m with a neck of 1 m between them, held at two posts and pressed by a body on a line, 8 m
    from the end of the neck near the posts."""
    w = width / 2
    outline = [[0, -5], [10, -5], [10, -w], [11, -w], [11, -5], [41, -5], [41, 5], [11, 5], [11, w], [10, w], [10, 5],
               [0, 5]]
    at = lambda corners: [[x + 40, y] for x, y in corners]
    posts = [floe(at([[12.5, 5 + 1e-6], [13.5, 7], [11.5, 7]]), fixed=True),
             floe(at([[38, -5 - 1e-6], [37, -7], [39, -7]]), fixed=True)]
    return {
        "run": {"dt": 0.05, "duration": 60.0},
        "domain": {"length": 120, "width": 200, "ends": "open", "sides": "open"},
        "ice": {"concentration": 0, "thickness": 1.0, "friction": 0.0, "size": 10.0, "start": "rest",
                "splitting": {"toughness": TOUGHNESS, "strength": STRENGTH, "generations": 1}},
        "body": {"shape": "square", "length": 2.0, "draft": 1.0, "x": 43.0, "y": -6 - 1e-6,
                 "drag": {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0}},
        "tow": {"mode": "line", "speed": 0.2, "direction": 90.0, "line_length": 20, "line_stiffness": 2e4,
                "line_damping": 1e3, "hull_x": 0, "hull_y": 0, "ramp": 5},
        "impact": {"conversion": "none"},
        "output": {"frame_interval": 0.1},
        "floes": [floe(at(outline)), *posts]}


@pytest.mark.parametrize("width", [0.8, 1.5])
def test_a_floe_breaks_at_its_neck(tmp_path, width):
    """And bears until then what the neck does; no load that is told is larger."""
    r = run(tmp_path, bent_at_its_neck(width))
    one, s = made(r), r.summary["splitting"]
    force = STRENGTH / math.sqrt(1 + width / (1.4 * TOUGHNESS / STRENGTH)**2) * width**2 / 6 / 8
    assert s["splits"] == 1 and one["mode"].tolist() == [2] and one["parent"].tolist() == [0]
    np.testing.assert_allclose(np.sort(one["crack"].reshape(2, 2), axis=0), [[51, -width / 2], [51, width / 2]],
                               atol=0.02)
    assert one["area"].sum() == pytest.approx(400 + width, rel=1e-12)
    whole = np.isfinite(r.dataset("frames/pose")[:, 0, 0])
    told = r.dataset("frames/contact_force")[whole, 1].max() * (38 - 12.5) / (38 - 3)  # by the post beside the neck
    assert 1 < whole.sum() < len(whole) and 0.98 * force < told < 1.001 * force


# --- collisions ------------------------------------------------------------------------------------------------------


def collision(half, speed, offset=0.0, scale=1.0, turn=lambda p: p, h=1.0, impact=None):
    """A wedge of half angle `half` and the weight of the square hits it `offset` off the middle of its side. scale: of
    lengths, a Froude twin."""
    s, length = scale, SIDE / np.sqrt(np.tan(half))
    at = lambda corners: [[600 * s + x * s, y * s] for x, y in corners]
    y = length * np.tan(half)
    square = at([[0, -SIDE / 2], [SIDE, -SIDE / 2], [SIDE, SIDE / 2], [0, SIDE / 2]])
    wedge = at([[-1e-9, offset], [-length, offset + y], [-length, offset - y]])
    return {
        "run": {"dt": s**0.5, "duration": 2 * s**0.5},
        "domain": {"length": 1200 * s, "width": 1200 * s},
        "ice": {"concentration": 0, "thickness": h * s, "friction": MU, "restitution": 0.0,
                "drag": {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0},
                "crushing": {"pressure": 1e9 * s},
                "splitting": {"toughness": TOUGHNESS * s**1.5, "strength": STRENGTH * s, "generations": 1}},
        "body": {"shape": "none"},
        "impact": impact or {"conversion": "duration", "duration": s**0.5},
        "output": {"frame_interval": s**0.5},
        "floes": [floe(square, turn, (0.0, 0.0)), floe(wedge, turn, (speed * s**0.5, 0.0))]}


def wedge_force(half, h):
    """Thrust that splits the square, N: the pair opens its near end, the thrust closes it."""
    r = 2 * (np.tan(half) + MU) / (1 - MU * np.tan(half))
    strength = STRENGTH / np.sqrt(1 + SIDE / (0.75 * TOUGHNESS / STRENGTH)**2)
    return strength * h * SIDE / (4 / r - 0.75)


BY_CRUSHING = {"conversion": "crushing", "pressure": 1.5e6, "corner_angle": "60 deg"}


@pytest.mark.parametrize("h, thicker", [(0.5, 1), (2.0, 1), (1.0, 3)])
def test_the_speed_at_which_a_crushed_corner_splits_a_floe(tmp_path, h, thicker):
    """Peak force of a corner that is crushed at pressure p: v √(2 p h tan φ m), m that of both floes together. The
    thickness cancels, but for a wedge of thicker ice, which weighs more. So does the step."""
    half, pressure = np.radians(30), 1.5e6
    speed = wedge_force(half, 1.0) / np.sqrt(2 * pressure * np.tan(half) * DENSITY * SIDE**2 * thicker / (1 + thicker))
    for share, splits in ((0.99, 0), (1.01, 1)):
        case = collision(half, share * speed, h=h, impact=BY_CRUSHING)
        case["floes"][1]["thickness"] = thicker * h
        case["run"] = {"dt": 200.0, "duration": 200.0}  # what lasts so long would split nothing
        r = run(tmp_path / str(share), case)
        assert r.summary["splitting"]["near"] == splits


@pytest.mark.parametrize("impact", [{"conversion": "duration", "duration": 1.0}, BY_CRUSHING])
def test_the_gap_at_the_start_of_the_step_makes_no_difference(tmp_path, impact):
    """It divides the impulse of a collision between two steps."""
    half, mass = np.radians(30), DENSITY * SIDE**2 / 2
    per_speed = np.pi / 2 * mass if impact["conversion"] == "duration" else np.sqrt(2 * 1.5e6 * np.tan(half) * mass)
    speed = 1.5 * wedge_force(half, 1.0) / per_speed
    for share in (0, 0.25, 0.5, 0.75):
        case = collision(half, speed, impact=impact)
        case["floes"][1]["x"] -= share * speed  # the step is 1 s
        assert made(run(tmp_path / str(share), case))["ratio"] == pytest.approx([1.5], rel=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_peak_that_is_told_is_the_load_by_which_a_floe_is_judged(tmp_path, share):
    """Of a towed wedge, on a floe that its size keeps whole."""
    half, speed = np.radians(30), 0.3
    case = collision(half, speed, impact={"conversion": "duration", "duration": 1.0})
    p = np.array(case["floes"].pop()["vertices"])
    x = 600 - p[:, 0].max() - share * speed
    case = changed(case, run={"dt": 1.0, "duration": 4.0},
                   ice__splitting__least_size=20.0, tow={"mode": "speed", "speed": speed, "ramp": 0.0},
                   body={"shape": "polygon", "vertices": p.tolist(), "x": x, "y": 0.0, "draft": 30.0})
    r = run(tmp_path, case)
    peak, mass = r.dataset("impacts/peak"), DENSITY * SIDE**2
    assert peak == pytest.approx([speed * np.pi / 2 * mass], rel=0.03)
    assert r.summary["splitting"]["largest_refused_ratio"] == pytest.approx(peak[0] / wedge_force(half, 1.0), rel=5e-3)


def test_flush_fixed_floes_open_a_floe_as_their_outline_does(tmp_path):
    """A corner of 130° does not; as two triangles it has 65° on either side. One of 60° does, in two as in one."""
    for half, ratio in ((np.radians(65), []), (np.radians(30), [1.5])):
        tip, back, y = [600, 0], 580, 20 * np.tan(half)
        low, high = [back, -y], [back, y]
        case = collision(half, 0.0)
        square = case["floes"][0]
        square["vx"] = -1.5 * wedge_force(half, 1.0) / (np.pi / 2 * DENSITY * SIDE**2) if ratio else -1.0
        for name, shore in ("one", [[tip, high, low]]), ("two", [[tip, high, [back, 0]], [tip, [back, 0], low]]):
            floes = [square, *(floe(p, fixed=True) for p in shore)]
            one = made(run(tmp_path / f"{name}{len(ratio)}", changed(case, floes=floes)))
            assert one["ratio"] == pytest.approx(ratio, rel=1e-3)


@pytest.fixture(scope="module")
def struck(tmp_path_factory):
    """Off the middle, so that nothing is symmetric."""
    r = run(tmp_path_factory.mktemp("struck"), collision(np.radians(30), 1.0, offset=3.0))
    assert r.summary["splitting"]["splits"] == 1
    return r, made(r)


@pytest.mark.parametrize("name, turn", [("mirrored", lambda p: p * [1, -1]),
                                        ("turned", lambda p: np.stack([600 - p[:, 1], p[:, 0] - 600], axis=1))])
def test_a_scene_that_is_mirrored_or_turned_splits_so(tmp_path, struck, name, turn):
    r, one = struck
    other = made(run(tmp_path, collision(np.radians(30), 1.0, offset=3.0, turn=turn)))
    np.testing.assert_allclose(other["area"], one["area"], rtol=1e-9)  # the larger piece stays the first
    assert other["mode"].tolist() == one["mode"].tolist() and other["time"].tolist() == one["time"].tolist()
    np.testing.assert_allclose(other["crack"].reshape(2, 2), turn(one["crack"].reshape(2, 2)), atol=1e-6)
    assert other["ratio"][0] == pytest.approx(one["ratio"][0], rel=1e-9)


def test_a_froude_twin_splits_alike(tmp_path, struck):
    """Toughness by the scale to 1.5, strength and pressure by the scale; with the toughness of the full scale the twin
    holds."""
    r, one = struck
    case = collision(np.radians(30), 1.0, offset=3.0, scale=0.04)
    twin = made(run(tmp_path / "twin", case))
    np.testing.assert_allclose(twin["area"], one["area"] * 0.04**2, rtol=1e-9)
    assert twin["ratio"][0] == pytest.approx(one["ratio"][0], rel=1e-9)
    real = changed(case, ice__splitting={"toughness": TOUGHNESS, "strength": STRENGTH})
    assert run(tmp_path / "real", real).summary["splitting"]["splits"] == 0


def test_a_split_keeps_momentum_and_angular_momentum(tmp_path):
    """Of a floe that turns and one that hits it off its centre, from the frames: in the second step nothing touches,
    and turns are differences of yaw. Velocities are in single precision."""
    case, turn = collision(np.radians(30), 1.0, offset=3.0), 0.01
    case["floes"][0]["yaw_rate"] = f"{np.degrees(turn)} deg/s"
    r = run(tmp_path, case)
    one = made(r)
    assert r.summary["splitting"]["splits"] == 1
    with h5py.File(r.dir / "result.h5") as f:
        pose, velocity = f["frames/pose"][()], f["frames/velocity"][()].astype(float)
        at, piece_v = f["frames/piece_pose"][()], f["frames/piece_velocity"][()].astype(float)
        offsets, v = f["floes/offsets"][()], f["floes/vertices"][()]
    outline = [v[a:b] for a, b in zip(offsets[:-1], offsets[1:])]
    pieces = [one["vertices"][a:b] for a, b in zip(one["offsets"][:-1], one["offsets"][1:])]
    middle = pose[0, 0, :2]

    def momenta(bodies):
        total = np.zeros(3)
        for p, x, u, w in bodies:
            m, arm = DENSITY * area(p), x[:2] - middle
            total += [m * u[0], m * u[1], m * (arm[0] * u[1] - arm[1] * u[0]) + DENSITY * polar(p) * w]
        return total

    before = momenta((outline[i], pose[0, i], velocity[0, i], turn * (i == 0)) for i in (0, 1))
    after = momenta([(outline[1], pose[2, 1], velocity[2, 1], pose[2, 1, 2] - pose[1, 1, 2]),
                     *((pieces[k], at[2 + k], piece_v[2 + k], at[2 + k, 2] - at[k, 2]) for k in (0, 1))])
    scale = before[0] * np.array([1, 1, SIDE])
    np.testing.assert_allclose(after / scale, before / scale, atol=1e-6)
    assert abs(before[2]) > 0.04 * scale[2] and r.summary["momentum_residual"] < 1e-12


def test_floes_that_bear_the_same_split_in_the_same_step(tmp_path):
    """In whichever order they stand in the case; ids go by those of the parents."""
    case = collision(np.radians(30), 1.0, offset=3.0)
    floes = [{**f, "y": f["y"] + shift} for shift in (0, 200, -200) for f in case["floes"]]
    one = made(run(tmp_path / "one", changed(case, floes=floes)))
    assert one["parent"].tolist() == [0, 2, 4] and len(set(one["time"].tolist())) == 1
    np.testing.assert_allclose(one["area"].reshape(3, 2), one["area"][None, :2].repeat(3, axis=0), rtol=1e-9)
    two = made(run(tmp_path / "two", changed(case, floes=floes[::-1])))
    assert two["parent"].tolist() == [1, 3, 5]
    np.testing.assert_allclose(two["crack"][::-1], one["crack"], atol=1e-6)
    few = run(tmp_path / "few", changed(case, floes=floes, ice__splitting__reserve=1, run__duration=1.0))
    s = few.summary["splitting"]
    assert s["splits"] == 1 and s["refused_reserve"] == 2
    assert s["largest_refused_ratio"] == pytest.approx(made(few)["ratio"][0], rel=1e-6)


# --- loads of one step -----------------------------------------------------------------------------------------------

HALF = math.radians(45)  # angle of the wedges
RISE = DENSITY * (1 - DENSITY / 1027) * 9.81  # of floes that lie over each other, N/m³


def strength_of(length, c):
    return STRENGTH / math.sqrt(1 + length / (c * TOUGHNESS / STRENGTH)**2)


LASTS = {"conversion": "none"}
COLLIDES = {"conversion": "duration", "duration": math.pi / 2}  # with the peak of a load that stops it in the step


def one_step(floes, impact=LASTS, **splitting):
    """Floes that move without drag until they meet, in the first step."""
    return {
        "run": {"dt": 1.0, "duration": 2.0},
        "domain": {"length": 1200, "width": 900},
        "ice": {"concentration": 0, "thickness": 1.0, "friction": 0.0, "restitution": 0.0,
                "drag": {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0},
                "splitting": {"toughness": TOUGHNESS, "strength": STRENGTH, **splitting}},
        "body": {"shape": "none"},
        "impact": impact,
        "solver": {"tolerance": 1e-6, "max_sweeps": 5000},
        "output": {"frame_interval": 1.0},
        "floes": floes}


def moved(corners, vx, vy, **more):
    return floe(corners, **more) | {"vx": vx, "vy": vy}


def held(x0, x1, y0, y1, **more):
    return block(x0, x1, y0, y1, **more) | {"vx": 0.0, "vy": 0.0}


def pusher(y, face, impulse, thickness=20.0):
    """It comes from the left to x = 600 m, with a tip or a face of this width at y, and is too thick to split."""
    tip = [[600, y]] if face == 0 else [[600, y - face / 2], [600, y + face / 2]]
    p = np.array([*tip, [580, y + 20], [560, y + 20], [560, y - 20], [580, y - 20]]) - [1e-9, 0]
    mass = abs(area(p)) * thickness * DENSITY
    return moved(p, impulse / mass, 0.0, thickness=thickness), mass


@pytest.mark.parametrize("width, face, stress, mode", [
    (30, 0, 0.43, 3), (30, 6, 0.43 * (1 - 6 / 30), 3), (45, 0, 0.75 * 1.5 - 0.45, 2), (150, 0, 0.75 * 5 - 0.45, 2)])
def test_a_floe_that_its_own_inertia_holds_against_a_thrust(tmp_path, width, face, stress, mode):
    """A square bursts: its far edge has 0.30 F/(h L) where beams have 0.75. What is wider, up to a strip that is struck
    in its middle, breaks from that edge."""
    mass = DENSITY * SIDE * width
    for share, splits in (0.99, []), (1.01, [mode]):
        force, other = share * strength_of(SIDE, 1.4) * SIDE / stress, pusher(0, face, 1.0)[1]
        striker, _ = pusher(0, face, force * (1 + other / mass))  # it is not stopped, and pushes on
        one = made(run(tmp_path / str(share), one_step([held(600, 600 + SIDE, -width / 2, width / 2), striker],
                                                       COLLIDES, generations=1)))
        assert one["mode"].tolist() == splits
    assert one["ratio"][0] == pytest.approx(share, rel=1e-5)
    np.testing.assert_allclose(one["area"], SIDE * width / 2, rtol=1e-9)
    np.testing.assert_allclose(one["crack"], [[600, 0, 600 + SIDE, 0]], atol=1e-6)


def test_a_strip_that_is_struck_at_its_end_breaks_at_a_third(tmp_path):
    """4/27 F l there: beyond a load at the end, the moment of a slender strip is F x (1 - x/l)². The load is half a
    thousandth of l off the end."""
    width, length, off = 30.0, 600.0, 5e-4
    mass, polar_moment, y = DENSITY * width * length, (width**2 + length**2) / 12, length * (0.5 - off)
    for share, splits in (0.99, []), (1.01, [2]):
        force = share * strength_of(width, 1.4) * 27 * width**2 / (24 * length)
        other = pusher(y, 0, 1.0)[1]
        striker, _ = pusher(y, 0, force * other * (1 / other + (1 + y**2 / polar_moment) / mass))
        one = made(run(tmp_path / str(share), one_step([held(600, 600 + width, -length / 2, length / 2), striker],
                                                       COLLIDES, generations=1)))
        assert one["mode"].tolist() == splits
    assert one["ratio"][0] == pytest.approx(share, rel=5e-3)
    np.testing.assert_allclose(one["area"], mass / DENSITY * np.array([2 / 3, 1 / 3]), rtol=1e-9)
    np.testing.assert_allclose(np.sort(one["crack"].reshape(2, 2), axis=0),
                               [[600, length / 6], [600 + width, length / 6]], atol=1e-6)


def told_loads(r):
    """Largest contact force of each frame but the first, N."""
    with h5py.File(r.dir / "result.h5") as f:
        end, own, pieces = (f[f"frames/{k}"][()] for k in ("piece_end", "contact_force", "piece_contact_force"))
    return [max(np.nanmax(own[k]), pieces[end[k - 1]:end[k]].max(initial=0)) for k in range(1, len(end))]


def squeezed_row(n, share, face=3.0, **splitting):
    """Squares in a row with thick narrow blocks between them, squeezed from both ends: scene, and the force."""
    force = share * strength_of(SIDE, 1.4) * SIDE / (0.637 * (1 - (face / SIDE)**1.5))
    start, end = 200, 200 + n * (SIDE + 20) - 20
    block_at = lambda x0, x1, vx: moved([[x0, -face / 2], [x1, -face / 2], [x1, face / 2], [x0, face / 2]], vx, 0.0,
                                        thickness=20.0)
    v = force / (100 * face * 20 * DENSITY)
    floes = [held(x, x + SIDE, -SIDE / 2, SIDE / 2) for x in np.arange(start, end, SIDE + 20)]
    floes += [block_at(x + SIDE, x + SIDE + 20, 0.0) for x in np.arange(start, end, SIDE + 20)[:-1]]
    floes += [block_at(start - 100, start - 1e-9, v), block_at(end + 1e-9, end + 100, -v)]
    return one_step(floes, **splitting), force


def test_a_row_that_is_squeezed_splits_all_at_once(tmp_path):
    """At the same load, that of the step's first solution. Each half then bears its half of the load beside its edge,
    and breaks across; at the least size it ends."""
    n = 5
    below = run(tmp_path / "below", squeezed_row(n, 0.99)[0])
    assert below.summary["splitting"]["splits"] == 0 and below.summary["splitting"]["largest_refused_ratio"] == 0
    case, force = squeezed_row(n, 1.01, least_size=14.9)
    r = run(tmp_path / "above", case)
    one, s = made(r), r.summary["splitting"]
    assert one["parent"][:n].tolist() == list(range(n)) and one["mode"][:n].tolist() == [3] * n
    np.testing.assert_allclose(one["ratio"][:n], 1.01, rtol=1e-5)
    np.testing.assert_allclose(one["crack"][:n, [1, 3]], 0, atol=1e-9)
    assert s["steps"] == 1 and s["splits"] == 3 * n and s["deferred"] == 0 and one["mode"][n:].tolist() == [2] * 2 * n
    np.testing.assert_allclose(one["area"][2 * n:], (SIDE / 2)**2, rtol=1e-6)
    assert max(told_loads(r)) < 0.6 * force  # half of it in either half of the row; blocks bear a little on both


def three_point_row(n, share, arm=12.0, **splitting):
    """Squares in a row, each struck in the middle of a side and held at two points of the other: scene, and force."""
    force, pitch = share * strength_of(SIDE, 1.4) * SIDE**2 / (3 * arm), SIDE + 24
    floes = [held(x, x + SIDE, -SIDE / 2, SIDE / 2) for x in 600 + pitch * np.arange(n)]
    for x in 600 + SIDE + pitch * np.arange(n):
        floes += [moved([[x, y], [x + 4, y - 2], [x + 4, y + 2]], 0.0, 0.0, thickness=10.0) for y in (-arm, arm)]
        next_one = [[x + 4, -20], [x + 14, -20], [x + 24, 0], [x + 14, 20], [x + 4, 20]]
        floes.append(moved(next_one, 0.0, 0.0, thickness=10.0))
    floes[-1] = block(x + 4, x + 24, -20, 20, fixed=True)
    return one_step([*floes, pusher(0, 0, force, thickness=100.0)[0]], **splitting), force


def test_a_row_in_which_each_floe_is_bent_bears_its_load_and_no_more(tmp_path):
    """Halves fold between their supports: what the row would have borne is not told."""
    n = 3
    case, force = three_point_row(n, 0.99)
    below = run(tmp_path / "below", case)
    assert below.summary["splitting"]["splits"] == 0
    assert told_loads(below)[0] == pytest.approx(force, rel=1e-4)
    r = run(tmp_path / "above", three_point_row(n, 1.01)[0])
    one = made(r)
    assert one["parent"].tolist() == list(range(n)) and one["mode"].tolist() == [2] * n
    np.testing.assert_allclose(one["ratio"], 1.01, rtol=1e-4)
    np.testing.assert_allclose(one["area"], SIDE**2 / 2, rtol=1e-9)
    assert len(set(one["time"].tolist())) == 1 and r.summary["splitting"]["deferred"] == 0
    assert max(told_loads(r)) < 0.01 * force


def combs(strips, cells, ratio, cell=32.0, **splitting):
    """Strips between pairs of teeth that squeeze them with the same force at the ends of their cells. Wherever a strip
    is cut, its pieces bear at their own teeth what it did; the force in the middle is a thousandth more, so that each
    cut is a halving."""
    force = ratio * strength_of(SIDE, 1.4) * SIDE / 0.637
    pitch, shift = SIDE + 60, (strips - 1) * (SIDE + 60) / 2 + SIDE / 2
    floes, teeth = [], []
    for low in pitch * np.arange(strips) - shift:
        floes.append(held(100, 100 + cells * cell, low, low + SIDE))
        for j in range(1, cells):
            x, part = 100 + j * cell, 0.3 * cell
            halving = (j & -j).bit_length() - 1
            for y, up in (low - 1e-9, -1), (low + SIDE + 1e-9, 1):
                p = np.array([[x, y], [x + part, y + up * 10], [x + part, y + up * 25], [x - part, y + up * 25],
                              [x - part, y + up * 10]])
                v = -up * force * (1 + 1e-3 * halving) / (abs(area(p)) * DENSITY * 5)
                teeth.append(moved(p, 0.0, v, thickness=5.0))
    case = one_step([*floes, *teeth], **splitting)
    return changed(case, domain__length=200 + cells * cell, domain__width=strips * pitch + 100,
                   solver__tolerance=1e-4)


def ends(r, n):
    """Areas of the pieces that have not split, m²; n: floes at the start."""
    one = made(r)
    return np.array([a for k, a in enumerate(one["area"]) if n + k not in set(one["parent"].tolist())])


def test_a_cascade_ends_at_the_least_size(tmp_path):
    """Every piece splits while it can: the last ones are all of one size, below twice the least."""
    case = combs(1, 16, 1.01, cell=20.0, least_size=SIDE)
    r = run(tmp_path, case)
    np.testing.assert_allclose(ends(r, len(case["floes"])), 2 * 20 * SIDE, rtol=1e-9)
    s = r.summary["splitting"]
    assert s["splits"] == 7 and s["refused_size"] == 8 and 1 < s["largest_refused_ratio"] < 1.02


def test_a_cascade_of_pieces_that_may_hold(tmp_path):
    """Pieces whose own strength is below the load with the chance f: (1 - f)(2 f)^k of 2^-k of the area are left of
    generation k, so that the number above an area goes as its -(1 + log2 f)th power."""
    strips, f, modulus = 60, 0.7, 10.0
    case = combs(strips, 16, (-math.log2(1 - f))**(1 / modulus), generations=4, scatter=modulus)
    r = run(tmp_path, case)
    left = ends(r, len(case["floes"])) / (32 * SIDE)
    s = r.summary["splitting"]
    assert s["steps"] == 1 and s["deferred"] == 0 and s["refused_reserve"] == 0 and s["burst"] == s["splits"]
    counts = [strips - np.isin(np.arange(strips), made(r)["parent"]).sum(), *((left.round(6) == 16 / 2**k).sum()
                                                                             for k in range(1, 5))]
    assert sum(c * 16 / 2**k for k, c in enumerate(counts)) == 16 * strips  # all of them are halves of halves
    born = strips
    for k in range(4):  # of the pieces of generation k
        split = born - counts[k]
        assert split / born == pytest.approx(f, abs=3 * math.sqrt(f * (1 - f) / born))
        born = 2 * split
    assert born == counts[4]
    assert math.log2(counts[3] / counts[2]) == pytest.approx(1 + math.log2(f), abs=0.5)


def towards_a_wall(side, kappa, h, speed):
    """A square between a wedge that is led and a heavy floe of the same ice, against which it may raft: scene, and
    forces [N] by which its whole side rafts, that move it, and that split it."""
    wedge = np.array([[0, 0], [-side, side * math.tan(HALF)], [-side, -side * math.tan(HALF)]])
    case = one_step([held(600, 600 + side, -side / 2, side / 2),
                     held(600 + side, 1000 + side, -side / 2, side / 2, thickness=8 * h)], generations=1)
    case = changed(case, run__duration=4.0, ice__thickness=h, ice__friction=MU, ice__rafting={"kappa": kappa},
                   ice__crushing={"pressure": 1e9}, tow={"mode": "speed", "speed": speed, "ramp": 0.0},
                   solver__tolerance=1e-4,
                   body={"shape": "polygon", "vertices": (wedge - centroid(wedge)).tolist(), "draft": 100.0,
                         "x": 600 - 1e-7 + centroid(wedge)[0], "y": 0.0})
    r = 2 * (math.tan(HALF) + MU) / (1 - MU * math.tan(HALF))
    return (case, 0.5 * kappa * RISE * h**2 * side, DENSITY * h * side**2 * speed,
            strength_of(side, 0.75) * h * side / (4 / r - 0.75))


def test_a_small_floe_rafts_where_a_large_one_splits(tmp_path):
    """A side rafts at a load that goes with L, a wedge splits at one that goes with its root. By that alone they cross
    at L = (0.85 K/(q0/h))²; here the floe's own inertia, 2 % of the load, and the strength of short sections move the
    crossing by 4 %."""
    kappa, h, speed = 34, 2.0, 0.05

    def excess(side):
        _, raft, move, split = towards_a_wall(side, kappa, h, speed)
        return raft + move - split

    low, high = 5.0, 50.0
    while high - low > 1e-9:
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) < 0 else (low, middle)
    assert low == pytest.approx((0.85 * TOUGHNESS / (0.5 * kappa * RISE * h))**2, rel=0.06)
    case, raft, _, _ = towards_a_wall(0.97 * low, kappa, h, speed)
    r = run(tmp_path / "below", case)
    s = r.summary
    assert s["splitting"]["splits"] == 0 and s["rafting_pairs"] == 1
    assert r.dataset("frames/contact_force")[2:, 1] == pytest.approx(raft, rel=1e-3)  # the wall's
    assert s["splitting"]["refused_rafted"] == 0 and s["splitting"]["largest_refused_ratio"] == 0
    case, raft, move, split = towards_a_wall(1.03 * low, kappa, h, speed)
    one = made(run(tmp_path / "above", case))
    assert one["mode"].tolist() == [1] and one["time"].tolist() == [1]
    assert one["ratio"][0] == pytest.approx((raft + move) / split, rel=1e-4)


def test_a_split_takes_no_momentum_and_no_energy(tmp_path):
    """From the doubles of two checkpoints, before and after the step in which a floe that turns is hit off its middle.
    What energy is gone, contacts took by their work."""
    case = changed(collision(math.radians(30), 1.0, offset=3.0), ice__friction=0.0, run__duration=3.0)
    case["floes"][0]["yaw_rate"] = "1.2 deg/s"
    case["floes"][1]["x"] -= 1.5  # so far in the first step
    outlines = [np.array(f["vertices"]) for f in case["floes"]]
    r = run(tmp_path, case, "--steps", 1)

    def totals(step):
        """Mass, momentum, angular momentum about a place between the floes, and energy. Pieces stand before the floes
        by hand in a checkpoint, and their ids are kept for eight."""
        with h5py.File(r.dir / "checkpoint.h5") as f:
            assert f["world/step"][()] == step
            pose, v = f["bodies/pose"][()], f["bodies/velocity"][()]
            parts = zip(range(2), f["splits/area"][()].reshape(-1), f["splits/polar"][()].reshape(-1))
        bodies = [*parts, *((8 + i, area(p), polar(p)) for i, p in enumerate(outlines) if pose[8 + i, 0] != 0)]
        total = np.zeros(5)
        for i, a, j in bodies:
            (x, y), (vx, vy, w) = pose[i, :2] - [600, 0], v[i]
            total += [a, a * vx, a * vy, a * (x * vy - y * vx) + j * w, (a * (vx**2 + vy**2) + j * w**2) / 2]
        return total * DENSITY, len(bodies)

    before, n = totals(1)
    assert n == 2 and call("resume", r.dir, "--steps", 1).returncode == 0
    after, n = totals(2)
    assert n == 3 and len(made(r)["parent"]) == 1
    work = r.dataset("series/contact_work")[1]
    assert work < -0.1 * before[4]
    scale = [before[0], before[1], before[1], SIDE * before[1], before[4]]
    np.testing.assert_allclose((after + [0, 0, 0, 0, -work]) / scale, before / scale, atol=1e-13)


# --- what is told ----------------------------------------------------------------------------------------------------


def weak(**keys):
    """Dense ice whose floes split again and again."""
    split = {"toughness": 100.0, "strength": 200.0, "least_size": 0.1, "reserve": 5000}
    return changed(changed(TOW, run__duration=6, ice__concentration=0.8, ice__size=0.9,
                           ice__crushing={"pressure": 1e5}, ice__splitting=split), **keys)


def test_floes_that_had_to_wait_and_steps_without_a_solution_are_told(tmp_path):
    r = run(tmp_path / "deferred", weak())
    assert r.summary["splitting"]["deferred"] > 0 and r.summary["splitting"]["unconverged_steps"] == 0
    codes = [w["code"] for w in r.summary["warnings"]]
    assert "split_deferred" in codes and "split_unconverged" not in codes and "split_reserve" not in codes
    short = run(tmp_path / "short", weak(solver__max_sweeps=2, guard={"overlap": 0, "no_solution": 0}, run__duration=3))
    s = short.summary
    assert 0 < s["splitting"]["unconverged_steps"] <= s["unconverged_steps"]  # of which some had split floes before
    assert "split_unconverged" in [w["code"] for w in s["warnings"]]
    assert s["splitting"]["steps"] == len(set(made(short)["time"].tolist())) > 0  # with or without a solution


def test_fixed_floes_beside_floes_that_may_split(tmp_path):
    """The ids that are kept for pieces lie before those of floes by hand: their shore is where it is without them."""
    fixed = [block(12, 13, -4, -3, fixed=True), block(12, 13, -3, -2, fixed=True)]
    none = run(tmp_path / "none", changed(TOW, floes=fixed, run__duration=6))
    strong = changed(TOW, floes=fixed, run__duration=6,
                     ice__splitting={"toughness": 1e9, "strength": 1e9, "least_size": 0.1})
    strong = run(tmp_path / "strong", strong)
    assert strong.summary["mean_ice_resistance_n"] == none.summary["mean_ice_resistance_n"]
    assert (strong.dataset("frames/pose") == none.dataset("frames/pose")).all()


def test_pictures_leave_out_what_is_not_there(tmp_path):
    """Outlines of the last frame cover what those of the first do; cracks are those since the frame before."""
    from matplotlib.figure import Figure

    from bergtow.plot.scene import Colouring, Scene, view_whole
    from bergtow.reporting.replay import Replay
    from bergtow.result.run import Run
    with Run(run(tmp_path, weak()).dir) as r:
        cover = [sum(map(area, r.polygon_array(k)[0])) for k in (0, -1)]
        assert cover[1] == pytest.approx(cover[0], rel=1e-9) and r.n_pieces > 10
        drawn = 0
        for kind in ("speed", "force", "generation"):
            scene = Scene(Figure().add_subplot(), r, Colouring(r, kind, range(r.n_frames)), view_whole(r))
            for k in range(r.n_frames):
                scene.show(k)
                assert np.isfinite(scene.mappable.get_array()).all()
                drawn += scene.cracked and len(scene._cracks.get_segments())
        assert drawn == 3 * len(r.splits["time"])
        replay = Replay(r)
        frames = range(r.n_frames)
        there = np.array([np.isfinite(r.pose(k)[:, 0]) for k in frames]).T
        lives = np.array([[a <= k < b for k in frames] for a, b in replay.lives])
        assert (there == lives).all()
