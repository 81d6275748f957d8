# SPDX-License-Identifier: MIT
"""Fixed floes that lie against each other act as one outline: what lies along them, or goes past, meets no seam."""
import json
import math

import h5py
import numpy as np
import pytest

from harness import CASE, area, call, changed, quick, run, write_case

TOW = {
    "run": {"dt": 0.5, "duration": 400},
    "domain": {"length": 600, "width": 400},
    "ice": {"concentration": 0, "size": 10, "thickness": 1, "friction": 0.1},
    "body": {"shape": "square", "length": 20, "draft": 5},
    "tow": {"mode": "line", "speed": 1, "line_length": 100, "line_stiffness": 20e6, "line_damping": 1e5},
    "output": {"window_start": 150, "frame_interval": 400},
}


def shore(first, last, n, length=440):
    """A line of n stretches from (20, -10.2), with courses from `first` to `last`, deg."""
    course = np.radians(np.linspace(first, last, n))
    steps = length / n * np.column_stack([np.cos(course), np.sin(course)])
    return np.vstack([[0, 0], np.cumsum(steps, axis=0)]) + [20, -10.2]


#: the line of the shore, and the direction of the tow, deg
SHORES = {"straight": (shore(0, 0, 1), -2), "sloped": (shore(-20, -20, 1), -22), "bulging": (shore(0, -24, 12), -14),
          "bay": (shore(-12, 14, 14), -1)}


def pieces(line, n, depth=20):
    """The land `depth` below a line, cut into n pieces of equal length along it."""
    arc = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])

    def at(s):
        return np.column_stack([np.interp(s, arc, line[:, k]) for k in (0, 1)])

    cuts = np.linspace(0, arc[-1], n + 1)
    for s, t in zip(cuts, cuts[1:]):
        top = at(np.concatenate([[s], arc[(arc > s + 1e-6) & (arc < t - 1e-6)], [t]]))
        yield np.vstack([top - [0, depth], top[::-1]])


def floe(ring, **more):
    """A fixed floe by hand where the ring is."""
    p, q = ring, np.roll(ring, -1, axis=0)
    c = p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]
    x, y = (((p[:, k] + q[:, k]) * c).sum() / (3 * c.sum()) for k in (0, 1))
    return {"shape": "polygon", "fixed": True, "x": x, "y": y, "vertices": ring.tolist()} | more


def towed(folder, coast, floes, friction=0.0, **changes):
    """A body that is towed along a coast, slightly towards it: mean and largest load, N."""
    line, direction = SHORES[coast]
    course = math.atan2(*(line[1] - line[0])[::-1])
    u = np.array([math.cos(course), math.sin(course)])
    x, y = line[0] + 15 * u + 10.5 * np.array([-u[1], u[0]])
    r = run(folder, changed(TOW, body__x=x, body__y=y, body__yaw=math.degrees(course), body__friction=friction,
                            tow__direction=direction, floes=floes, **changes))
    assert r.summary["unconverged_steps"] == 0
    return r.summary["mean_ice_resistance_n"], r.series("ice_resistance").max()


@pytest.mark.parametrize("coast, friction", quick([(c, f) for c in SHORES for f in (0.0, 0.3)], ("straight", 0.0),
                                                  ("bulging", 0.3), ("bay", 0.3)))
def test_a_coast_in_pieces_is_a_coast(tmp_path, coast, friction):
    """The loads on a body are those of the coast in one piece, however many there are."""
    line = SHORES[coast][0]
    whole = towed(tmp_path / "whole", coast, [floe(p) for p in pieces(line, 1)], friction)
    assert whole[1] > 1000
    for n in (3, 22, 64):
        parts = towed(tmp_path / str(n), coast, [floe(p) for p in pieces(line, n)], friction)
        assert np.allclose(parts, whole, rtol=0.02, atol=1), n


@pytest.mark.parametrize("off", [0.004, -0.004])
def test_seams_need_not_be_exact(tmp_path, off):
    """Pieces that overlap, or leave a gap, and stand out from each other by less than the slop: the same loads."""
    line = SHORES["straight"][0]
    rng = np.random.default_rng(2)
    whole = towed(tmp_path / "whole", "straight", [floe(p) for p in pieces(line, 1)])
    loose = []
    for k, ring in enumerate(pieces(line, 22)):
        middle = ring.mean(axis=0)
        ring = middle + (ring - middle) * (1 + off / 20) + rng.uniform(-0.002, 0.002, 2)
        loose.append(floe(ring))
    mean, largest = towed(tmp_path / "loose", "straight", loose)
    assert mean == pytest.approx(whole[0], rel=0.02)
    assert largest == pytest.approx(whole[1], rel=0.1)  # the first hit, where a piece stands 4 mm in or out


def test_pieces_may_lie_in_each_other(tmp_path):
    """Rectangles along a bay, each some metres longer than its side of it: only what the others leave of it counts."""
    line = SHORES["bay"][0]
    over = []
    for p, q in zip(line, line[1:]):
        u = (q - p) / np.hypot(*(q - p))
        n = np.array([-u[1], u[0]])
        p, q = p - 3 * u, q + 3 * u
        over.append(floe(np.array([p - 20 * n, q - 20 * n, q, p])))
    whole = towed(tmp_path / "whole", "bay", [floe(p) for p in pieces(line, 1)], 0.3)
    assert np.allclose(towed(tmp_path / "laid", "bay", over, 0.3), whole, rtol=0.02, atol=1)


def test_the_backs_of_pieces_need_not_be_even(tmp_path):
    """The side of a piece that is deeper than its neighbour is covered at the front and shows at the back. The body
    lies a little in the pieces, within the slop."""
    line = SHORES["straight"][0]
    whole = towed(tmp_path / "whole", "straight", [floe(p) for p in pieces(line, 1)], body__shape="disc")
    uneven = []
    for k, ring in enumerate(pieces(line, 64)):
        ring[:2, 1] -= 7 * (k % 2)
        uneven.append(floe(ring))
    assert np.allclose(towed(tmp_path / "uneven", "straight", uneven, body__shape="disc"), whole, rtol=0.02, atol=1)


PERIOD = {
    "run": {"dt": 0.5, "duration": 600},
    "domain": {"length": 100, "width": 100, "ends": "periodic", "sides": "periodic"},
    "ice": {"concentration": 0, "size": 5, "thickness": 0.5, "friction": 0, "start": "rest", "drag": {
        "water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0}},
    "body": {"shape": "none"},
    "tow": {"mode": "none"},
}


def test_fixed_floes_fill_a_period(tmp_path):
    """A floe goes round the period along two of them, without friction and without drag: it keeps its speed."""
    shore_ = [{"shape": "rectangle", "length": 60, "width": 4, "x": 30, "y": 0, "fixed": True},
              {"shape": "rectangle", "length": 40, "width": 4, "x": 80, "y": 0, "fixed": True}]
    slider = {"shape": "rectangle", "length": 6, "width": 3, "x": 30, "y": 3.51, "vx": 1, "vy": -0.01}
    r = run(tmp_path, changed(PERIOD, floes=[*shore_, slider]))
    with h5py.File(r.dir / "result.h5") as f:
        pose, time = f["frames/pose"][:, 2], f["frames/time"][:]
    assert abs(pose[-1, 1] - 3.5) < 0.02 and abs(pose[-1, 2]) < 0.01
    gone = np.unwrap(pose[:, 0], period=100)
    assert np.allclose(np.diff(gone) / np.diff(time), 1, atol=1e-3)


def test_a_piece_has_room_beside_its_image(tmp_path):
    """One piece that fills the period would meet a floe twice: cut in two it is accepted."""
    def checked(length):
        pair = [{"shape": "rectangle", "length": length, "width": 4, "x": x, "y": 0, "fixed": True}
                for x in np.arange(length / 2, 99.9, length)]
        return call("check", write_case(tmp_path, changed(PERIOD, floes=[*pair, {"length": 4, "x": 50, "y": 20}])))

    refused = checked(99.5)
    assert refused.returncode == CASE and "beside floes[0], which is fixed" in refused.stderr
    assert "cut that floe in two" in refused.stderr
    assert checked(50).returncode == 0


BARRIER = {
    "run": {"dt": 0.5, "duration": 700},
    "domain": {"length": 600, "width": 200, "ends": "open", "sides": "periodic"},
    "ice": {"concentration": 0.6, "size": 12, "thickness": 1, "friction": 0, "x_min": 10, "x_max": 190},
    "body": {"shape": "none"},
    "tow": {"mode": "none"},
    "output": {"frame_interval": 700},
    "water": {"current_x": 0.5},
}


def past(folder, n, seed):
    """Part of the ice that a current brings past a sloped barrier of n pieces."""
    a, b = np.array([200, -80]), np.array([400, 60])
    slope, length = math.degrees(math.atan2(*(b - a)[::-1])), np.hypot(*(b - a))
    floes = [{"shape": "rectangle", "length": length / n, "width": 20, "yaw": slope, "fixed": True,
              "x": x, "y": y} for x, y in (a + (b - a) * (k + 0.5) / n for k in range(n))]
    r = run(folder, changed(BARRIER, ice__seed=seed, floes=floes), "--quiet")
    with h5py.File(r.dir / "result.h5") as f:
        x, size = f["frames/pose"][-1, :-n, 0], f["floes/area"][:-n]
    return size[x > 400].sum() / size.sum()


@pytest.mark.parametrize("seeds", quick([3, 20], 3))
def test_ice_goes_past_a_barrier_in_pieces_as_past_one(tmp_path, seeds):
    lost = np.array([past(tmp_path / f"one{s}", 1, s) - past(tmp_path / f"many{s}", 32, s) for s in range(seeds)])
    assert abs(lost.mean()) < 3 * lost.std(ddof=1) / np.sqrt(seeds) + 0.01


def test_floes_by_hand_need_not_be_convex(tmp_path):
    """A basin like a C, fixed and free: ice stays in the fixed one, and its area is that of its outline."""
    ring = np.array([[0, 0], [20, 0], [20, 4], [4, 4], [4, 16], [20, 16], [20, 20], [0, 20]])
    case = changed(PERIOD, ice__size=None, domain__ends="open", domain__sides="open",
                   floes=[floe(ring + 40), {"shape": "square", "length": 5, "x": 52, "y": 50, "vx": -0.5, "vy": 0}])
    case["domain"] |= {"y0": 0}
    r = run(tmp_path, case, "--set", "run.duration=100")
    with h5py.File(r.dir / "result.h5") as f:
        assert f["floes/area"][0] == pytest.approx(area(ring))
        assert f["frames/pose"][-1, 1, 0] == pytest.approx(46.5, abs=0.02)  # against the back of the C


def test_a_map_makes_a_coast(tmp_path):
    """Features with a common border become fixed floes where they lie on the map, and ice stays off them."""
    south = [[200, -400], [600, -400], [600, 0], [430, 0], [380, -60], [340, -150], [260, -220]]
    north = [[430, 0], [600, 0], [600, 400], [200, 400], [230, 300], [330, 200], [400, 90]]
    (tmp_path / "coast.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [[*r, r[0]]]}}
        for r in (south, north)]}))
    box = {"frame": "geographic", "length": 900, "width": 1200, "x0": -450, "y0": -600, "ends": "periodic",
           "sides": "open"}
    no_body = {"body": {"shape": "none"}, "tow": {"mode": "none"}}
    of_map = {"run": {"dt": 0.5, "duration": 60}, "domain": box, **no_body, "ice": {
        "outlines": "coast.geojson", "outlines_crs": "plane", "nonconvex": "split", "thickness": 5}}
    made = call("field", write_case(tmp_path, of_map, "map.yml"), "-o", tmp_path / "coast.yml")
    assert made.returncode == 0, made.stderr
    again = call("field", tmp_path / "map.yml", "-o", tmp_path / "coast.yml")
    assert again.returncode == 0, "its own file is replaced"
    case = {"base": "coast.yml", "run": {"dt": 0.5, "duration": 100}, "domain": box, **no_body, "ice": {
        "concentration": 0.4, "size": 25, "thickness": 1, "x_min": -400, "x_max": 400, "y_min": -500, "y_max": 180},
        "water": {"current_y": 0.5}}
    r = run(tmp_path, case)
    with h5py.File(r.dir / "result.h5") as f:
        offset, vertex, pose = f["floes/offsets"][:], f["floes/vertices"][:], f["frames/pose"][-1]
    for k, ring in enumerate((south, north), start=len(pose) - 2):
        there = vertex[offset[k]:offset[k + 1]] + pose[k, :2]
        assert {(round(e, 6), round(n, 6)) for n, e in there} == set(map(tuple, ring)) - {(600, 0)} | (
            {(600, 0)} & {(round(e, 6), round(n, 6)) for n, e in there})
    assert r.summary["max_overlap_m"] < 0.05
