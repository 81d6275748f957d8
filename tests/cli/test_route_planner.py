# SPDX-License-Identifier: MIT
"""The planner of routes against closed forms, breadth-first searches, and areas by clipping."""
import itertools
import math
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.ndimage
import scipy.sparse.csgraph

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "postproc"))
from bergtow.errors import BergtowError  # noqa: E402
from bergtow.routing import planner  # noqa: E402
from bergtow.routing.planner import Hull, Ice, plan, route_through  # noqa: E402

pytestmark = pytest.mark.usefixtures("library")
NONE = Ice([], [])
BERG = Hull(20, 12, 1e4)
PLOUGH = planner.Weights(compaction=0, large=0)  # force of an area of ice alone, whatever is about it


def box(x0, y0, x1, y1):
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=float)


def disc(x, y, r, n=256):
    a = 2 * np.pi * np.arange(n) / n
    r /= math.cos(math.pi / n)  # about the circle
    return np.column_stack([x + r * np.cos(a), y + r * np.sin(a)])


def floes(n, width, height, seed, d=(10, 40)):
    """Convex floes anywhere, also on each other, and their thickness."""
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(n):
        a = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(5, 10)))
        out.append(rng.uniform([0, 0], [width, height])
                   + 0.5 * rng.uniform(*d) * np.column_stack([np.cos(a), np.sin(a)]))
    return out, rng.uniform(0.5, 1.5, n)


def best(found):
    """The cheapest route that has no fault."""
    return min((r for r in found.routes if not r.faults), key=lambda r: r.cost)


# --- open water, obstacles -------------------------------------------------------------------------------------------

@pytest.mark.parametrize("objective", planner.OBJECTIVES)
def test_open_water_is_crossed_straight(objective):
    """Red: water drag of another power of the speed; a search that starts elsewhere."""
    found = plan(NONE, BERG, (50, 80), (950, 500), extent=(0, 0, 1000, 600), objective=objective, speeds=(0.5, 1.5),
                 routes=1)
    r, d = found.routes[0], math.hypot(900, 420)
    v = {"work": 0.5, "peak": 0.5, "time": 1.5, "length": 1.5}[objective]
    assert math.isclose(r.length, d, rel_tol=1e-12) and math.isclose(r.duration, d / v, rel_tol=1e-12)
    assert math.isclose(r.work, 1e4 * v * v * d, rel_tol=1e-12) and math.isclose(r.peak, 1e4 * v * v, rel_tol=1e-12)
    assert r.cost == {"work": r.work, "time": r.duration, "peak": r.peak, "length": r.length}[objective]
    assert r.faults == () and r.kind == "straight" and best(found) is r
    np.testing.assert_allclose([r.x[-1], r.y[-1], r.time[-1]], [950, 500, d / v], rtol=1e-12)


@pytest.mark.parametrize("a, clearance, d", [(100, 8, 400), (60, 0, 200), (150, 20, 210)])
def test_a_disc_is_passed_on_its_tangents(a, clearance, d):
    """Red: cell centres tested, not the hull; a clearance that counts twice."""
    found = plan(NONE, BERG, (300 - d, 300), (300 + d, 300), extent=(-200, 0, 800, 600), no_go=[disc(300, 300, a)],
                 clearance=clearance, routes=1)
    r, radius = best(found), a + clearance + BERG.radius
    exact = 2 * math.sqrt(d * d - radius ** 2) + 2 * radius * math.asin(radius / d)
    assert exact * (1 - 1e-9) <= r.length <= 1.01 * exact
    assert r.clearance >= clearance - 0.05 and found.routes[0].faults == ("no_go",)


@pytest.mark.parametrize("over, under", [((200, 260), (400, 140)), ((180, 220), (330, 120)), ((250, 300), (400, 160))])
def test_a_slalom_is_a_taut_string(over, under):
    """Round the tips of two wedges, whose circles of the hull's radius the path can follow: tangents and arcs. Red
    at 0.33 to 0.76 % too long where corners stay as they were found."""
    a, b, radius = (40, 90), (560, 310), BERG.radius
    wedges = [np.array([(over[0] - 20, -30), (over[0] + 20, -30), over], float),
              np.array([(under[0] - 20, 430), under, (under[0] + 20, 430)], float)]
    r = best(plan(NONE, BERG, a, b, extent=(0, 0, 600, 400), no_go=wedges, radius=radius, routes=1))

    def course(p, q):
        return math.atan2(q[1] - p[1], q[0] - p[0]), math.dist(p, q)
    (to, first), (across, middle), (away, last) = course(a, over), course(over, under), course(under, b)
    between = across - math.asin(2 * radius / middle)
    exact = (math.sqrt(first ** 2 - radius ** 2) + math.sqrt(middle ** 2 - 4 * radius ** 2)
             + math.sqrt(last ** 2 - radius ** 2)
             + radius * (to + math.asin(radius / first) + away + math.asin(radius / last) - 2 * between))
    assert exact * (1 - 1e-9) <= r.length <= 1.003 * exact


def test_the_gap_that_the_hull_fits_through():
    """A wall with a gap of the hull's diameter, and clearance on both sides, less or more 1 %. Red: a tolerance."""
    for by, status in (0.99, "no_route"), (1.01, "ok"):
        half = by * (BERG.radius + 3)
        walls = [box(300, -50, 320, 200 - half), box(300, 200 + half, 320, 450)]
        found = plan(NONE, BERG, (50, 200), (550, 200), extent=(0, 0, 600, 400), no_go=walls, clearance=3, routes=1)
        assert found.status in ((status, "fewer_routes") if status == "ok" else (status,))
        assert (found.routes[0].faults == ()) == (status == "ok")


def room(no_go, extent, step):
    """Radius of the largest disc about each point of a grid that is free: distances to all edges, and the even-odd
    rule."""
    x0, y0, x1, y1 = extent
    x, y = np.meshgrid(np.arange(x0, x1 + step / 2, step), np.arange(y0, y1 + step / 2, step))
    p = np.column_stack([x.ravel(), y.ravel()])
    free = np.minimum(np.minimum(p[:, 0] - x0, x1 - p[:, 0]), np.minimum(p[:, 1] - y0, y1 - p[:, 1]))
    for ring in no_go:
        inside = np.zeros(len(p), bool)
        for a, b in zip(ring, np.roll(ring, -1, axis=0)):
            e = b - a
            f = np.clip((p - a) @ e / (e @ e), 0, 1)
            free = np.minimum(free, np.hypot(*(p - a - f[:, None] * e).T))
            with np.errstate(divide="ignore", invalid="ignore"):
                inside ^= ((a[1] > p[:, 1]) != (b[1] > p[:, 1])) & (
                    p[:, 0] < a[0] + (p[:, 1] - a[1]) * e[0] / e[1])
        free[inside] = -1
    return free.reshape(x.shape)


def grid_length(free, start, end):
    """Length of the shortest way over the eight neighbours of free points, in steps."""
    ny, nx = free.shape
    index = np.arange(nx * ny).reshape(ny, nx)
    rows, cols, cost = [], [], []
    for dy, dx in (0, 1), (1, 0), (1, 1), (1, -1):
        a = index[:ny - dy, max(0, -dx):nx - max(0, dx)]
        b = index[dy:, max(0, dx):nx + min(0, dx)]
        ok = free.ravel()[a] & free.ravel()[b]
        rows.append(a[ok])
        cols.append(b[ok])
        cost.append(np.full(ok.sum(), math.hypot(dx, dy)))
    graph = scipy.sparse.coo_matrix((np.concatenate(cost), (np.concatenate(rows), np.concatenate(cols))),
                                    shape=(nx * ny, nx * ny))
    far = scipy.sparse.csgraph.dijkstra(graph, directed=False, indices=index[start[::-1]])
    return far[index[end[::-1]]]


def test_a_maze_is_crossed_by_its_openings():
    """Walls with one opening each, the sequence known; length against a search over the eroded free space, whose eight
    directions make ways up to 8 % too long. Red: corners cut; a wall that is stepped over."""
    openings = [(100, 60), (200, 330), (300, 90), (400, 300), (500, 200)]
    walls = [w for x, y in openings for w in (box(x, -20, x + 8, y - 18), box(x, y + 18, x + 8, 420))]
    extent = (0, 0, 600, 400)
    found = plan(NONE, BERG, (30, 200), (570, 200), extent=extent, no_go=walls, routes=1)
    r = best(found)
    for x, y in openings:
        crossed = np.flatnonzero(np.diff(np.sign(r.x - x - 4)))
        assert len(crossed) == 1 and abs(r.y[crossed[0]] - y) <= 6.1
    other = 2 * grid_length(room(walls, extent, 2) >= BERG.radius - 1e-9, (15, 100), (285, 100))
    assert other / 1.09 <= r.length <= 1.005 * other


def test_what_keeps_out_elsewhere_changes_no_plan():
    """A box in a corner, of no consequence but that steps round what is kept out of are counted: the same routes, and
    no more states. Red: a bound that is not below the cost, or that falls along a move by more than the move costs."""
    for seed, radius in (5, 0), (6, 25):
        outlines, thickness = floes(200, 600, 400, seed)
        options = {"extent": (0, 0, 600, 400), "radius": radius, "routes": 3, "weights": PLOUGH}
        free, beside = (plan(Ice(outlines, thickness), BERG, (40, 60), (560, 340), no_go=no_go, **options)
                        for no_go in ([], [box(590, 10, 592, 12)]))
        assert [r.cost for r in beside.routes] == [r.cost for r in free.routes] and free.states >= beside.states > 0


def test_a_goal_behind_a_wall_costs_no_search():
    """Red: every place before the wall is looked at."""
    found = plan(NONE, BERG, (50, 200), (550, 200), extent=(0, 0, 600, 400), no_go=[box(300, -50, 320, 450)])
    assert found.status == "no_route" and found.states == 0


def test_a_way_is_found_where_there_is_one():
    """100 fields of obstacles: a flood fill with a slightly larger hull finds a way => the planner does => one with a
    slightly smaller hull does. Both outcomes are frequent."""
    extent, step, count = (0, 0, 300, 200), 4, {True: 0, False: 0}
    for seed in range(100):
        rng = np.random.default_rng(seed)
        no_go = [disc(*rng.uniform([40, 0], [260, 200]), rng.uniform(6, 22), 7) for _ in range(16)]
        found = plan(NONE, BERG, (20, 100), (280, 100), extent=extent, no_go=no_go, routes=1, spacing=5, cell=5,
                     headings=16)
        if found.status in ("start_no_go", "goal_no_go"):
            continue
        there = found.status in ("ok", "fewer_routes")
        free = room(no_go, extent, step)
        with_more, with_less = (regions[25, 5] == regions[25, 70] > 0 for regions in (
            scipy.ndimage.label(free >= BERG.radius + by, np.ones((3, 3)))[0] for by in (4, -step)))
        assert with_more <= there <= with_less, seed
        count[there] += 1
        if there:
            r = best(found)
            assert r.clearance >= -0.05 and r.x.min() >= 12 - 1e-6 and r.y.max() <= 188 + 1e-6
    assert min(count.values()) >= 15, count


# --- ice -------------------------------------------------------------------------------------------------------------

def clipped(ring, x0, y0, x1, y1):
    """Area of a polygon within a rectangle, by cutting it at four lines."""
    for axis, at, sign in (0, x0, 1), (0, x1, -1), (1, y0, 1), (1, y1, -1):
        out = []
        for a, b in zip(ring, np.roll(ring, -1, axis=0)):
            da, db = sign * (a[axis] - at), sign * (b[axis] - at)
            if da >= 0:
                out.append(a)
            if (da >= 0) != (db >= 0):
                out.append(a + da / (da - db) * (b - a))
        if len(out) < 3:
            return 0.0
        ring = np.array(out)
    x, y = (ring - ring[0]).T
    return 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def test_the_ice_of_a_straight_swath_is_that_of_a_rectangle():
    """Area and mass to rounding; the force that the raster makes of it to 1 %. Red: slices that overlap."""
    outlines, h = floes(150, 800, 200, 3)
    start, end = np.array([60.0, 40.0]), np.array([720.0, 150.0])
    d = end - start
    t = d / np.hypot(*d)
    r = route_through(Ice(outlines, h, added_mass=0.5), BERG, start, end, speed=2, extent=(0, 0, 800, 200), cell=2,
                       weights=PLOUGH)
    areas = np.array([clipped((o - start) @ np.array([t, [-t[1], t[0]]]).T, 0, -10, np.hypot(*d), 10)
                      for o in outlines])
    assert math.isclose(r.ice_area, areas.sum(), rel_tol=1e-12)
    assert math.isclose(r.ice_mass, 910 * (areas * h).sum(), rel_tol=1e-12)
    assert math.isclose(r.features["plough"], 1.5 * 910 * 4 * (areas * h).sum() / np.hypot(*d), rel_tol=0.01)
    assert math.isclose(r.force, r.features["water"] + r.features["plough"], rel_tol=1e-6)


def test_the_ice_of_a_bend_is_that_of_a_ring():
    """An arc through ice everywhere: W times its length, and no more; and along the rim of ice. Red: outer and inner
    side not told apart, which makes 3 % of the force."""
    found = plan(Ice([box(0, 0, 600, 600)], [1.0]), BERG, (100, 100), (400, 300), extent=(0, 0, 600, 600), radius=150,
                 start_heading=0, goal_heading=1.2, routes=1)
    r = found.routes[1]
    assert math.isclose(r.ice_area, 20 * r.length, rel_tol=1e-12) and len(r.waypoints) > 1
    # a quarter of a circle that is full of ice: of the inner side alone
    found = plan(Ice([disc(100, 250, 150, 4096)], [1.0]), BERG, (100, 100), (250, 250), extent=(0, 0, 600, 600),
                 radius=150, start_heading=0, goal_heading=math.pi / 2, routes=1, weights=PLOUGH, cell=1)
    r = found.routes[1]
    inner = math.pi / 4 * (150 ** 2 - 140 ** 2)
    assert math.isclose(r.length, 75 * math.pi, rel_tol=1e-6)
    assert math.isclose(r.features["plough"] * r.length, 910 * inner, rel_tol=0.01)


def test_terms_of_the_force():
    """One large floe, wider than the berg, of which every term has a closed form. Red: a cap that is none."""
    ice = dict(outlines=[box(-2000, -2000, 3000, 3000)], thickness=[1.0], added_mass=0.5)
    extent, a = (0, 0, 1000, 1000), 5000 / math.sqrt(3)  # the circle of the same second moments
    r = route_through(Ice(**ice), BERG, (100, 500), (900, 500), speed=1, extent=extent)
    f1, u = 1.5 * 910 * 20, 400 / (a + 10)
    middle = 1.5 * 910 * 25e6 * a / (a + 10) * 2 / math.pi / (a + 10)
    large = middle * (math.asin(u) + u * math.sqrt(1 - u * u)) / (2 * u)
    np.testing.assert_allclose([r.features[k] for k in ("water", "plough", "large")], [1e4, f1, large], rtol=1e-5)
    x = (np.arange(1000) - 499.5) / (a + 10)  # the average is that of the whole extent
    about = middle * np.sqrt(1 - x ** 2 - x[:, None] ** 2).mean()
    assert math.isclose(r.features["compaction"], 9 * (f1 + about), rel_tol=1e-5)
    q = 5 * 910 * (1 - 910 / 1027) * 9.81  # kappa 10
    r = route_through(Ice(**ice, rafting=q), BERG, (100, 500), (900, 500), speed=1, extent=extent)
    f = r.features
    assert math.isclose(f["plough"] + f["compaction"] + f["large"], 20 * q, rel_tol=1e-5)
    assert math.isclose(f["rafting"], 20 * q, rel_tol=1e-5) and math.isclose(r.force, 1e4 + 20 * q, rel_tol=1e-5)
    # half the cover in small squares: compaction as packed ice of one dimension, of what is about a lane too
    squares = [box(x, y, x + 4, y + 2) for x in range(0, 400, 8) for y in range(0, 200, 2) if abs(y - 99) > 12]
    r = route_through(Ice(squares, np.ones(len(squares))), BERG, (100, 100), (300, 100), speed=1,
                       extent=(0, 0, 400, 200), cell=1)
    f, cover = r.features, 0.5 * (47 - 24) / 47  # of a square of 47 m, 24 m of which are the lane
    near = 910 * cover * (20 + 4 / 3 * math.sqrt(4 * 2 / 3))  # whole floes: 4/3 of the mean half axis
    assert f["plough"] == 0 and math.isclose(f["compaction"] / near, 1 / (1 - cover / 0.84) - 1, rel_tol=0.05)


@pytest.mark.parametrize("radius, offset", [(40, 0), (40, 45), (40, 52), (10, 12)])
def test_a_floe_takes_the_momentum_of_an_oblique_collision(radius, offset):
    """A round floe of the mass m beside the way: m V2 (1 - b2/(r + W/2)2), of which the share r/(r + W/2) is not in the
    swath; the same from every side. Red: a profile over the floe alone; a law along the axes of the raster."""
    reach = radius + 10
    exact = 910 * math.pi * radius ** 2 * radius / reach * 4 * max(0, 1 - (offset / reach) ** 2)
    for angle in 0, 0.4, 2.1:
        t = np.array([math.cos(angle), math.sin(angle)])
        ice = Ice([disc(*(np.array([300, 300]) + offset * np.array([-t[1], t[0]])), radius)], [1.0])
        r = route_through(ice, BERG, 300 - 200 * t, 300 + 200 * t, speed=2, extent=(0, 0, 600, 600),
                           cell=1)
        assert math.isclose(r.features["large"] * 400, exact, rel_tol=0.01)


def test_a_long_floe_reaches_as_far_as_it_is_long():
    """A floe of 400 by 20 m, aslant: none of it where the way passes beside it, all of it across. Red: a disc."""
    t = np.array([math.cos(0.5), math.sin(0.5)])
    n, middle = np.array([-t[1], t[0]]), np.array([400.0, 300.0])
    long = np.array([middle + a * 200 * t + b * 10 * n for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    beside, across = (route_through(Ice([long], [1.0]), BERG, middle + o - 150 * d, middle + o + 150 * d, speed=1,
                                     extent=(0, 0, 800, 600)).features["large"] for o, d in ((30 * n, t), (0 * n, n)))
    assert beside == 0 < across


@pytest.mark.parametrize("headings", [16, 32])
def test_uniform_ice_is_crossed_straight(headings):
    """Excess of the path over the straight line: none, and along an axis that the goal is not on at most what is left
    by the shortening."""
    ice, far = Ice([box(-100, -100, 700, 500)], [0.5]), math.hypot(400, 170)
    options = dict(extent=(0, 0, 600, 400), routes=1, weights=PLOUGH, headings=headings)
    assert best(plan(ice, BERG, (100, 100), (500, 270), **options)).length == pytest.approx(far, rel=1e-9)
    off = plan(ice, BERG, (100, 100), (500, 270), start_heading=0.2, radius=1e-3, **options)
    assert off.routes[0].faults == ("turns",) and best(off).length <= far * 1.001


def test_ice_refracts_a_route_as_light():
    """Two half planes, water and ice: sin of the angles to the normal as the inverse of the cost per metre."""
    rho = 1.0  # thickness so that f = 3 times the water's
    h = 2 * 1e4 / (910 * 20) * rho
    # the interface at y = 500
    ice = Ice([box(-500, 500, 1500, 1500)], [h])
    found = plan(ice, BERG, (100, 100), (900, 900), extent=(0, 0, 1000, 1000), routes=1, weights=PLOUGH)
    r = best(found)
    k = np.argmin(abs(r.y - 500))
    below, above = r.heading[k // 2], r.heading[(k + len(r.x)) // 2]
    # angles from the normal, y
    one, two = math.pi / 2 - below, math.pi / 2 - above
    assert abs(one - math.asin(min(1, 3 * math.sin(two)))) < math.radians(2), (one, two)
    # the place where a ray crosses, of all places the cheapest
    x = np.linspace(100, 900, 80001)
    cost = np.hypot(x - 100, 400) + 3 * np.hypot(900 - x, 400)
    assert math.isclose(r.cost, 1e4 * cost.min(), rel_tol=0.003)
    assert abs(r.x[k] - x[cost.argmin()]) < 10


@pytest.mark.parametrize("by, used", [(0.8, False), (1.25, True)])
def test_a_lead_is_used_where_it_pays(by, used):
    """A lead beside the way, costs f1 of ice and f2 of water: it pays from a length of 2 D sqrt((f1 + f2)/(f1 - f2))
    on, D to the middle of the berg when its swath is within the lead."""
    h, half, aside = 2 * 1e4 / (910 * 20), 12, 150
    length = by * 2 * (aside - half + 10) * math.sqrt(4 / 2)
    x1 = length + 400
    ice = Ice([box(-200, -200, x1 + 200, 200 + aside - half), box(-200, 200 + aside + half, x1 + 200, 800)], [h, h])
    found = plan(ice, BERG, (200, 200), (200 + length, 200), extent=(0, 0, x1, 500), routes=1, weights=PLOUGH)
    r = best(found)
    assert (r.y.max() > 200 + aside - half) == used, r.waypoints
    if used:
        exact = length * 1e4 + 2 * (aside - half + 10) * math.sqrt(9 - 1) * 1e4
        assert math.isclose(r.cost, exact, rel_tol=0.05)
    else:
        assert math.isclose(r.cost, 3e4 * length, rel_tol=1e-3)


# --- frames, mirrors, order ------------------------------------------------------------------------------------------

def scene(seed=2):
    outlines, h = floes(120, 700, 400, seed)
    return Ice(outlines, h, added_mass=0.3), dict(extent=(0, 0, 700, 400), routes=2, radius=40)


def test_drift_of_everything_changes_nothing():
    """Ice and water drift, and the goal is fixed to the ground: the routes are those to where it is in the ice when the
    berg arrives, without drift. Red: water over the ground; a goal that stays, or is met too early."""
    ice, options = scene()
    moved = plan(ice, BERG, (40, 200), (660, 210), water=(0.2, -0.1), drift=(0.2, -0.1), **options)
    assert moved.routes[0].features["water"] == pytest.approx(1e4, rel=1e-9)
    for r in moved.routes:
        np.testing.assert_allclose(r.waypoints[-1], [660, 210] - r.duration * np.array([0.2, -0.1]), atol=1e-4)
    still = plan(ice, BERG, (40, 200), moved.routes[0].waypoints[-1], **options)
    assert math.isclose(still.routes[0].work, moved.routes[0].work, rel_tol=1e-6)
    a, b = still.routes[1], plan(ice, BERG, (40, 200), moved.routes[1].waypoints[-1], **options).routes[1]
    for other in a, b:  # with the goal a little aside, and on another raster
        assert math.isclose(other.work, moved.routes[1].work, rel_tol=0.02)


def test_land_goes_by_where_the_ice_drifts():
    """An island on the straight way in the ice alone, and one on that over the ground. Red: islands where they are at
    the time 0; a goal that drifts with the ice."""
    drift = np.array([-0.08, 0.16])
    options = dict(extent=(0, 0, 1000, 600), routes=1, drift=drift, water=drift)
    free = plan(NONE, BERG, (50, 300), (900, 300), **options).routes[0]
    m = np.argmin(abs(free.x - 700))
    in_ice = np.array([free.x[m], free.y[m]])
    on_ground = in_ice + drift * free.time[m]
    past = plan(NONE, BERG, (50, 300), (900, 300), no_go=[disc(*in_ice, 30)], **options).routes[0]
    assert past.faults == () and 60 < past.clearance < 100
    found = plan(NONE, BERG, (50, 300), (900, 300), no_go=[disc(*on_ground, 30)], **options)
    assert found.routes[0].faults == ("no_go",)
    r = best(found)
    ground = np.column_stack([r.x, r.y]) + r.time[:, None] * drift
    assert 42 - 0.1 < np.hypot(*(ground - on_ground).T).min() < 43
    np.testing.assert_allclose(ground[-1], [900, 300], atol=1e-3)


def test_a_goal_that_drifts_away():
    found = plan(NONE, BERG, (50, 300), (950, 300), extent=(0, 0, 1000, 600), drift=(-1.2, 0), water=(-1.2, 0))
    assert found.status == "goal_drifts_away" and found.routes == []
    found = plan(NONE, BERG, (50, 300), (950, 300), extent=(0, 0, 1000, 600), drift=(-0.2, 0), water=(-0.2, 0),
                 speeds=(0.1, 0.5), routes=1)  # the cheaper one is too slow
    assert found.routes[0].duration == pytest.approx(900 / 0.3)


@pytest.mark.parametrize("speed", [0.36, 0.38])
def test_a_goal_that_drifts_hardly_slower_than_the_tow(speed):
    """It is met where it is on arrival, which is known. Red: it drifts away, or the planned way ends elsewhere."""
    drift = 0.345
    options = dict(extent=(0, -200, 6400, 200), drift=(-drift, 0), water=(-drift, 0), radius=20)
    straight = route_through(NONE, BERG, (50, 0), (290, 0), speed=speed, **options)
    assert straight.duration == pytest.approx(240 / (speed - drift), rel=1e-6)
    floe = Ice([disc(200, 0, 20)], [2])
    found = plan(floe, BERG, (50, 0), (290, 0), speeds=(speed,), routes=1, **options)
    assert len(found.routes) == 2
    for r in found.routes:
        np.testing.assert_allclose(r.waypoints[-1], [290 + drift * r.duration, 0], atol=1e-4)
    assert plan(NONE, BERG, (50, 0), (290, 0), speeds=(0.344,), **options).status == "goal_drifts_away"


@pytest.mark.parametrize("drift, aside", [(0.6, 0), (1.5, 0), (0.8, 0.1)])
def test_a_goal_that_comes_to_meet_the_tow_faster_than_that_moves(drift, aside):
    """The straight line meets it at |way - drift t| = speed t. Red: it drifts away."""
    options = dict(extent=(-900, -400, 1400, 400), drift=(drift, aside), water=(drift, aside), radius=20, routes=1)
    found = plan(Ice([disc(150, 0, 20)], [2]), BERG, (0, 0), (900, 0), speeds=(0.5,), **options)
    straight, around = found.routes
    first = min(np.roots([drift ** 2 + aside ** 2 - 0.25, -2 * 900 * drift, 900 ** 2]).real)
    assert straight.duration == pytest.approx(first, rel=1e-6)
    for r in straight, around:
        np.testing.assert_allclose(r.waypoints[-1], [900 - drift * r.duration, -aside * r.duration], atol=1e-4)
    assert around.duration < 1.1 * first


def test_a_slow_speed_that_arrives_where_the_goal_has_left_the_domain():
    """The faster one finds what it finds alone. Red: the goal lies outside the domain, for both."""
    options = dict(extent=(0, 0, 1000, 600), drift=(-0.5, 0), water=(-0.5, 0), routes=1)
    found = plan(NONE, BERG, (50, 300), (400, 300), speeds=(0.6, 1.5), **options)
    assert found.status == "ok" or found.status == "fewer_routes"
    assert [r.duration for r in found.routes] == [
        r.duration for r in plan(NONE, BERG, (50, 300), (400, 300), speeds=(1.5,), **options).routes]
    assert plan(NONE, BERG, (50, 300), (400, 300), speeds=(0.6, 0.55), **options).status == "goal_outside"


def test_current_across_and_against():
    """Water drag is of the velocity through the water: closed forms. Red: the sign of the current."""
    for water, force in ((0.5, 0), 1e4 * 0.25), ((-0.5, 0), 1e4 * 2.25), ((0, 0.75), 1e4 * 1.25), ((2, 0), 10):
        r = route_through(NONE, BERG, (50, 300), (950, 300), speed=1, extent=(0, 0, 1000, 600), water=water)
        assert math.isclose(r.force, force, rel_tol=1e-9)


def test_a_mirror_image_has_the_mirrored_route():
    ice, options = scene()
    flipped = Ice([o * [1, -1] + [0, 400] for o in ice.outlines], ice.thickness, added_mass=0.3)
    one = plan(ice, BERG, (40, 200), (660, 200), **options)
    two = plan(flipped, BERG, (40, 200), (660, 200), **options)
    a, b = best(one), best(two)
    assert math.isclose(a.cost, b.cost, rel_tol=0.01)
    assert np.mean(abs(np.interp(np.linspace(40, 660, 50), a.x, a.y)
                       - 400 + np.interp(np.linspace(40, 660, 50), b.x, b.y))) < BERG.width / 2


def test_the_same_call_has_the_same_bits_and_a_tie_one_winner():
    """A symmetric obstacle: both sides are equal, the one of the lower index is taken, each time."""
    calls = [plan(NONE, BERG, (100, 300), (900, 300), extent=(0, 0, 1000, 600), no_go=[disc(500, 300, 100)], routes=2)
             for _ in range(2)]
    for a, b in zip(calls[0].routes, calls[1].routes):
        assert a.waypoints.tobytes() == b.waypoints.tobytes() and a.cost == b.cost
    low, high = sorted(calls[0].routes[1:], key=lambda r: r.y.mean())
    assert low.y.mean() < 300 < high.y.mean() and math.isclose(low.length, high.length, rel_tol=0.01)


def test_routes_are_a_width_apart():
    ice, options = scene(5)
    found = plan(ice, BERG, (40, 200), (660, 200), **(options | {"routes": 4}))
    assert found.status == "ok" and len(found.routes) == 5
    assert [r.cost for r in found.routes[1:]] == sorted(r.cost for r in found.routes[1:])
    for a, b in itertools.combinations(found.routes[1:], 2):
        far = np.hypot(a.x[:, None] - b.x, a.y[:, None] - b.y).min(axis=1).mean()
        assert far > 0.9 * BERG.width


def test_routes_that_cannot_be_a_width_apart_are_not_given():
    """In a channel one and a half widths wider than the hull. Red: routes that are counted, not compared."""
    found = plan(NONE, BERG, (50, 70), (750, 70), extent=(0, 0, 800, 140), routes=3, turn_cost=1e3,
                 no_go=[box(100, -10, 700, 48), box(100, 92, 700, 150)])
    assert found.status == "fewer_routes" and found.data == {"wanted": 3, "found": 0} and len(found.routes) == 1


# --- turns -----------------------------------------------------------------------------------------------------------

def arrived(legs, pose, n=2000):
    """The pose after legs of length and curvature, by the midpoint rule."""
    x, y, a = pose
    for length, turn in legs:
        heading = a + turn * length * (np.arange(n) + 0.5) / n
        x, y, a = x + length * np.cos(heading).mean(), y + length * np.sin(heading).mean(), a + turn * length
    return x, y, a


def words(start, end, radius):
    from bergtow import _library
    import ctypes
    library = _library.library()
    kind = ctypes.POINTER(ctypes.c_double)
    library._lib.bt_route_word.restype = ctypes.c_double
    library._lib.bt_route_word.argtypes = [kind, kind, ctypes.c_double, ctypes.c_int, kind]
    for word in range(6):
        legs = np.zeros((3, 2))
        p, q = np.array(start, float), np.array(end, float)
        length = library._lib.bt_route_word(p.ctypes.data_as(kind), q.ctypes.data_as(kind), radius, word,
                                            legs.ctypes.data_as(kind))
        yield length, legs


def test_each_word_of_dubins_ends_where_it_should():
    """All six, by integration; and the shortest of three-arc words has a middle arc of more than half a circle. Red: a
    sign of any word."""
    rng = np.random.default_rng(7)
    seen = np.zeros(6, int)
    for _ in range(40):
        end = (*rng.uniform(-3, 3, 2), rng.uniform(-3, 3))
        start = (*rng.uniform(-1, 1, 2), rng.uniform(-3, 3))
        for word, (length, legs) in enumerate(words(start, end, 0.8)):
            if not math.isfinite(length):
                continue
            seen[word] += 1
            x, y, a = arrived(legs, start)
            assert math.hypot(x - end[0], y - end[1]) < 1e-5 and abs(math.remainder(a - end[2], 2 * math.pi)) < 1e-9
            assert math.isclose(length, legs[:, 0].sum())
            if word >= 4:
                assert legs[1, 0] >= 0.8 * math.pi - 1e-9
    assert (seen > 10).all(), seen


@pytest.mark.parametrize("start, end, exact", [
    ((200, 200, 0), (400, 200, 0), 200),                                              # straight
    ((200, 200, 0), (400, 400, math.pi / 2), math.sqrt(2) * 140 + 60 * math.pi / 2),  # LSL
    ((200, 200, 0), (300, 320, math.pi), 100 + 60 * math.pi),                         # half a turn after a leg
    ((200, 200, 0), (200, 320, math.pi), 60 * math.pi),
    ((200, 200, 0), (200, 200 + 80, 0), None), ((200, 200, 1), (260, 260, -2), None),  # three arcs or four turns
])
def test_paths_between_poses_are_those_of_dubins(start, end, exact):
    shortest = min(length for length, _ in words(start, end, 60))
    if exact is not None:
        assert math.isclose(shortest, exact, rel_tol=1e-12)
    found = plan(NONE, BERG, start[:2], end[:2], extent=(0, 0, 600, 600), radius=60, start_heading=start[2],
                 goal_heading=end[2], routes=1)
    r = best(found)
    assert shortest - 1e-9 <= r.length <= shortest + found.cell
    assert abs(math.remainder(r.heading[-1] - end[2], 2 * math.pi)) < 1e-6
    np.testing.assert_allclose([r.x[-1], r.y[-1]], end[:2], atol=1e-6)


def test_no_turn_is_sharper_than_the_radius():
    """Red: a corner with no room for its arc; a path of corners that is not that of the arrays."""
    ice, options = scene(8)
    for r in plan(ice, BERG, (40, 200), (660, 260), **options).routes:
        ds = np.hypot(np.diff(r.x), np.diff(r.y))
        assert abs(np.diff(r.heading) / ds).max() <= 1 / 40 * 1.01 and ds.max() <= BERG.width / 8 * 1.01
        assert math.isclose(ds.sum(), r.length, rel_tol=1e-3)
        way = np.vstack([[r.x[0], r.y[0]], r.waypoints])
        legs = np.hypot(*np.diff(way, axis=0).T)
        turn = np.diff(np.unwrap(np.arctan2(*np.diff(way, axis=0).T[::-1])))
        cut = np.concatenate([[0], 40 * np.tan(abs(turn) / 2), [0]])
        assert (cut[:-1] + cut[1:] <= legs * (1 + 1e-9)).all()
        assert math.isclose(r.length, legs.sum() - 2 * cut.sum() + 40 * abs(turn).sum(), rel_tol=1e-9)


# --- speeds, limits, what is refused ---------------------------------------------------------------------------------

def test_speed_of_each_leg_under_a_force_limit():
    """Water 10 kN V2, then ice of twice as much: the fastest speed whose force is allowed, in each. Red: a limit
    without its factor; one speed for all."""
    h = 2 * 1e4 / (910 * 20)
    ice = Ice([box(500, -100, 1100, 700)], [h])
    found = plan(ice, BERG, (100, 300), (900, 300), extent=(0, 0, 1000, 600), speeds=(0.5, 1, 1.5, 2), routes=1,
                 objective="time", force_limit=4.1e4 * 1.1, force_factor=1.1, weights=PLOUGH)
    r = best(found)
    assert r.legs["speed"][0] == 2 and r.legs["speed"][-1] == 1 and r.peak <= 4.1e4
    assert math.isclose(r.duration, (r.legs["length"] / r.legs["speed"]).sum())
    assert math.isclose(r.work, (r.legs["length"] * r.legs["force"]).sum())
    stopped = plan(ice, BERG, (100, 300), (900, 300), extent=(0, 0, 1000, 600), speeds=(1, 2), routes=1,
                   objective="time", force_limit=2e4, weights=PLOUGH)
    assert stopped.status == "goal_too_thick" and stopped.data["limit"] == 2e4
    assert math.isclose(stopped.data["force"], 3e4, rel_tol=0.02) and "force_limit" in stopped.routes[0].faults
    turned = plan(ice, BERG, (900, 300), (100, 300), extent=(0, 0, 1000, 600), routes=1, force_limit=2e4,
                  weights=PLOUGH)
    assert turned.status == "start_too_thick"


def test_the_search_keeps_the_force_limit():
    """The shortest way under a limit: through the gap of a barrier, for ice costs nothing else here. Red: a limit that
    only the pricing of what is found knows."""
    ice = Ice([box(300, -50, 340, 500), box(300, 540, 340, 650)], [3.0, 3.0])
    r = best(plan(ice, BERG, (50, 100), (600, 100), extent=(0, 0, 650, 600), objective="length", routes=1,
                  force_limit=1.5e4, weights=PLOUGH))
    exact = 2 * math.hypot(250, 410) + 40  # to the edge of the gap, a berg's half width from it
    assert abs(r.y[np.argmin(abs(r.x - 320))] - 520) < 20 and math.isclose(r.length, exact, rel_tol=0.03)


def test_the_least_peak():
    """A thin barrier of thick ice, thinner in one place: the route goes there, and no route has a lower peak."""
    ice = Ice([box(300, -50, 340, 380), box(300, 420, 340, 650), box(300, 380, 340, 420)], [3.0, 3.0, 0.5])
    found = plan(ice, Hull(20, 12, 500), (50, 150), (600, 150), extent=(0, 0, 650, 600), objective="peak", routes=1,
                 weights=PLOUGH)
    r = best(found)
    k = np.argmin(abs(r.x - 320))
    assert abs(r.y[k] - 400) < 12 and r.cost == r.peak < 0.35 * found.routes[0].peak


def test_a_line_is_a_goal():
    """Open water: to its nearest point; behind an island: where it is nearest on the way."""
    r = best(plan(NONE, BERG, (100, 300), ((800, 50), (800, 550)), extent=(0, 0, 1000, 600), routes=1))
    np.testing.assert_allclose(r.waypoints[-1], [800, 300], atol=1e-9)
    r = best(plan(NONE, BERG, (100, 300), ((800, 50), (800, 550)), extent=(0, 0, 1000, 600), routes=1,
                  no_go=[disc(450, 290, 100)]))
    rise = 10 + 112
    tangent = math.sqrt(350 ** 2 + 10 ** 2 - 112 ** 2)
    angle = math.asin(112 / math.hypot(350, 10)) - math.atan2(10, 350)
    exact = tangent + 112 * angle + 350  # along the tangent, round the disc until level, and straight on
    assert math.isclose(r.length, exact, rel_tol=0.01) and abs(r.waypoints[-1][1] - (300 + rise - 10 - 10)) < 15


@pytest.mark.parametrize("start, goal, more, status", [
    ((5, 300), (900, 300), {}, "start_outside"), ((50, 300), (995, 300), {}, "goal_outside"),
    ((500, 310), (900, 300), {}, "start_no_go"), ((50, 300), (560, 300), {}, "goal_no_go"),
    ((50, 300), (450, 300), {"clearance": 10}, "goal_no_go"),
    ((50, 300), (900, 300), {"no_go": [box(500, -50, 520, 650)]}, "no_route")])
def test_why_there_is_no_route(start, goal, more, status):
    found = plan(NONE, BERG, start, goal, **({"extent": (0, 0, 1000, 600), "no_go": [disc(510, 300, 45, 9)]} | more))
    assert found.status == status and len(found.routes) == 1 and found.routes[0].faults
    if "no_go" in status:
        assert found.data["polygon"] == 0 and found.data["needed"] == 12 + more.get("clearance", 0)


@pytest.mark.parametrize("more, said", [
    ({"speeds": (0,)}, "speed"), ({"speeds": ()}, "speeds"), ({"objective": "fuel"}, "work, time, peak, length"),
    ({"extent": (0, 0, 0, 9)}, "extent"), ({"no_go": [[[0, 0], [1, 1]]]}, "no-go polygon 0"), ({"headings": 8}, "16"),
    ({"spacing": 1e-3}, "spacing"), ({"weights": (1, -1, 1, 1, 0)}, "plough"), ({"clearance": math.nan}, "clearance"),
    ({"force_limit": 0}, "force limit"), ({"drift": (0, math.inf)}, "drift")])
def test_numbers_that_are_refused(more, said):
    with pytest.raises(BergtowError, match=said):
        plan(NONE, BERG, (50, 300), (900, 300), **({"extent": (0, 0, 1000, 600)} | more))
    bow_tie = [(400, 400), (600, 600), (600, 400), (400, 600)]
    with pytest.raises(BergtowError, match="floe 1: an outline whose edges cross"):
        plan(Ice([box(0, 0, 1, 1), bow_tie], [1.0, 1.0]), BERG, (50, 300), (900, 300), extent=(0, 0, 1000, 600))
    with pytest.raises(BergtowError, match="thickness"):
        plan(Ice([box(0, 0, 1, 1)], [0.0]), BERG, (50, 300), (900, 300), extent=(0, 0, 1000, 600))


def test_closed_rings_are_those_without_their_last_point():
    """As of GeoJSON and shapely. Red: edges that cross or touch."""
    corners = [box(300, 250, 340, 320), disc(600, 300, 45, 9)]
    closed = [np.concatenate([p, p[:1]]) for p in corners]
    closed[0] = np.repeat(closed[0], 2, axis=0)
    ways = [plan(Ice(rings, [1.0, 1.0]), BERG, (50, 300), (900, 300), extent=(0, 0, 1000, 600), no_go=rings[:1]).routes
            for rings in (corners, closed)]
    assert len(ways[0]) > 1 and [way.cost for way in ways[0]] == [way.cost for way in ways[1]]
    for other in [[(0, 0), (1, 1), (0, 0)], [(5, 5)] * 4, [1, 2, 3], np.zeros((0, 2))]:
        with pytest.raises(BergtowError, match="floe 0: an outline of shape"):
            plan(Ice([other], [1.0]), BERG, (50, 300), (900, 300), extent=(0, 0, 1000, 600))


def test_a_goal_at_the_start_or_next_to_it():
    """Less than a spacing of the lattice away, the search ends where it begins. Red: memory before the way-points is
    written to."""
    found = plan(NONE, BERG, (100, 200), (100, 200), extent=(0, 0, 600, 400))
    assert found.status == "at_goal" and not found.routes and found.states == 0
    found = plan(NONE, BERG, (100, 200), (101, 200), extent=(0, 0, 600, 400))
    assert found.routes[0].length == 1 and best(found).length == 1


# --- weights ---------------------------------------------------------------------------------------------------------

def test_weights_are_those_that_made_the_forces():
    rng = np.random.default_rng(3)
    rows = rng.uniform(0, [1e4, 3e4, 2e4, 1e4, 5e4], (40, 5))
    made = np.array([1, 0.4, 1.7, 0, 0.2])
    fit = planner.fit_weights(rows, rows @ made)
    np.testing.assert_allclose(fit.weights, made, atol=1e-9)
    assert fit.r2 == pytest.approx(1) and fit.rank_correlation == pytest.approx(1)
    fit = planner.fit_weights([dict(zip(planner.Weights._fields, row)) for row in rows],
                              rows @ [1, -0.5, 1, 0, 0] + 2e4)
    assert min(fit.weights) == 0 and fit.r2 < 1
    noise = planner.fit_weights(rows, rng.uniform(1, 2, 40))
    assert abs(noise.rank_correlation) < 0.5
    assert math.isnan(planner.fit_weights(np.zeros((3, 5)), [1, 2, 3]).rank_correlation)
    with pytest.raises(BergtowError, match="1 tows"):
        planner.fit_weights(rows[:1], [1.0])
