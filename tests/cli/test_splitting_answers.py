# SPDX-License-Identifier: MIT
"""Floes that split, on whole runs: answers of statics and of scaling, symmetries, and what a split leaves as it was.

Two drives. The wind on a floe that leans on another is a load that lasts, and with its skin drag alone the force on
each contact follows from the areas. A wedge at a speed is a collision, whose peak follows from the speed."""
import h5py
import numpy as np
import pytest

from harness import TOW, changed, run

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
        r = run(tmp_path / name, pressed(strength, pusher, posts))
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


@pytest.mark.parametrize("h", [0.5, 2.0])
def test_the_speed_at_which_a_crushed_corner_splits_a_floe(tmp_path, h):
    """Peak force of a corner that is crushed at pressure p: v √(2 p h tan φ m), m that of both floes together. The
    thickness cancels."""
    half, pressure = np.radians(30), 1.5e6
    impact = {"conversion": "crushing", "pressure": pressure, "corner_angle": "60 deg"}
    speed = wedge_force(half, 1.0) / np.sqrt(2 * pressure * np.tan(half) * DENSITY * SIDE**2 / 2)
    for share, splits in ((0.99, 0), (1.01, 1)):
        r = run(tmp_path / str(share), collision(half, share * speed, h=h, impact=impact))
        assert r.summary["splitting"]["near"] == splits


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
