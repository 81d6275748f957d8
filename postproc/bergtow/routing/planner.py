# SPDX-License-Identifier: MIT
"""Routes through known floes: the planner of the library (bergtow/route.h) with NumPy arrays.

Everything is in SI units and radians, in the frame that drifts with the ice and coincides with the frame of the case at
t = 0: a position x of the berg at time t is x + drift t over the ground.
"""
from __future__ import annotations

import contextlib
import ctypes
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from ctypes import POINTER, c_double, c_int64
from dataclasses import dataclass
from typing import Any, NamedTuple, Union

import numpy as np
import scipy.optimize
import scipy.stats

from .. import _library
from ..errors import BergtowError
from . import apart

OBJECTIVES = ("work", "time", "peak", "length")  # bt_route_objective
STATUS = ("ok", "fewer_routes", "no_route", "start_outside", "goal_outside", "start_no_go", "goal_no_go",
          "start_too_thick", "goal_too_thick", "goal_drifts_away", "at_goal")  # bt_route_status
UNREACHED = {"goal_drifts_away": "the goal drifts away from the ice faster than the body is towed; raise the speed",
             "no_route": "the turns do not fit where the goal then is; give a smaller radius",
             "outside": "the way leaves the domain, which moves with the ice; raise the speed"}
FAULTS = {1: "no_go", 2: "outside", 4: "force_limit", 8: "turns"}
MAX_STATES, MAX_CELLS = 20e6, 20e6  # about 1 GB
MAX_SLICES = 80e6  # of all speeds, about 7 GB
Points = Union[np.ndarray, Sequence[Sequence[float]]]


class Weights(NamedTuple):
    """Factor on each term of the force. 1 is the value that bergtow/route.h derives, assumed; rafting is for fits."""
    water: float = 1
    plough: float = 1
    compaction: float = 1
    large: float = 1
    rafting: float = 0


@dataclass(frozen=True)
class Ice:
    """Floes: outlines [n, 2], m, any simple polygons in either direction, closed or not, and the thickness of each, m;
    density, kg/m3; added mass / mass of floes; concentration at which packed ice jams, assumed; rafting: 1/2 kappa
    rho_i (1 - rho_i/rho_w) g, N/m3, infinite if floes do not raft."""
    outlines: Sequence[Points]
    thickness: Union[np.ndarray, Sequence[float]]
    density: float = 910
    added_mass: float = 0
    jam_cover: float = 0.84
    rafting: float = math.inf


@dataclass(frozen=True)
class Hull:
    """Width across the path and largest distance of the waterline from its centre, m; drag: 1/2 rho_w C_d A, kg/m."""
    width: float
    radius: float
    drag: float


@dataclass(frozen=True)
class Route:
    """A path of the berg's centre. kind: "straight" or "planned". waypoints [n, 2], m: corners, then the end, with the
    arc radius at each, m. x, y, m, heading, rad, time, s, speed, m/s [m] along it, at most a cell apart. legs: distance
    to the start, m, length, m, speed, m/s, predicted mean force, N. force: the mean, peak: the largest over a stretch
    of two widths, N. cost: value of the objective. features: mean of each term of the force, unweighted, N. ice_area,
    m2, ice_mass, kg: of floes in the swath, clipped exactly. clearance: from a circle around the hull to the nearest
    no-go polygon, m. faults: of "no_go", "outside", "force_limit", "turns" (but not turns to the requested heading).
    swath [k, 2]: outline of the swept width, m."""
    kind: str
    waypoints: np.ndarray
    radii: np.ndarray
    x: np.ndarray
    y: np.ndarray
    heading: np.ndarray
    time: np.ndarray
    speed: np.ndarray
    legs: np.ndarray
    length: float
    duration: float
    work: float
    force: float
    peak: float
    cost: float
    features: dict[str, float]
    ice_area: float
    ice_mass: float
    clearance: float
    faults: tuple[str, ...]
    swath: np.ndarray


@dataclass(frozen=True)
class Plan:
    """status: one of STATUS, with the numbers behind it in data. routes: the straight line first, then the planned
    ones, best first. spacing and cell, m, of lattice and raster; states: how many the search visited. cover [ny, nx]:
    ice concentration over cover_extent x0, x1, y0, y1, for pictures."""
    status: str
    data: dict[str, Any]
    routes: list[Route]
    spacing: float
    cell: float
    states: int
    cover: np.ndarray
    cover_extent: tuple[float, float, float, float]


class Fit(NamedTuple):
    """Weights fitted to forces, share of the variance that they explain, and rank correlation between fit and force."""
    weights: Weights
    r2: float
    rank_correlation: float


def _refuse(what: str, value: object, remedy: str) -> BergtowError:
    return BergtowError(f"{what}: {value} cannot be used; {remedy}")


def _number(what: str, value: float, low: float, high: float = math.inf, above: bool = False,
            endless: bool = False) -> float:
    """Check that a number lies in an interval. Raises BergtowError."""
    x = float(value)
    if (endless and x == math.inf) or (math.isfinite(x) and (low < x if above else low <= x) and x <= high):
        return x
    kind = "above" if above else "of at least"
    raise _refuse(what, value, f"give a number {kind} {low:g}" + (f", at most {high:g}" if high < math.inf else ""))


def _place(what: str, value: Iterable[float], n: int = 2) -> list[float]:
    out = [float(v) for v in np.ravel(np.asarray(value, dtype=float))]
    if len(out) != n or not all(map(math.isfinite, out)):
        raise _refuse(what, value, f"give {n} finite numbers")
    return out


def _rings(what: str, polygons: Sequence[Points]) -> tuple[Any, np.ndarray]:
    """Points of all polygons, concatenated, and the offset of each polygon. A point that the next one repeats is left
    out, as the last one of a closed ring."""
    rings = [np.asarray(p, dtype=float) for p in polygons]
    for k, ring in enumerate(rings):
        if ring.ndim == 2:
            rings[k] = ring[(ring != np.roll(ring, -1, axis=0)).any(axis=1)]
        if ring.ndim != 2 or ring.shape[1] != 2 or len(rings[k]) < 3 or not np.isfinite(ring).all():
            raise _refuse(f"{what} {k}", f"an outline of shape {ring.shape}", "give three different points or more, "
                          "all finite")
    first = np.cumsum([0, *map(len, rings)], dtype=np.int64)
    return np.ascontiguousarray(np.concatenate(rings) if rings else np.zeros((0, 2))), first


def _pointer(array: np.ndarray, kind: Any = c_double) -> Any:
    return array.ctypes.data_as(POINTER(kind))


class _Task:
    """bt_route_task, checked, with the arrays that it points to."""

    def __init__(self, ice: Ice, hull: Hull, start: Iterable[float], goal: Points, *, extent: Iterable[float],
                 speeds: Iterable[float] = (1.0,), objective: str = "work", force_limit: float = math.inf,
                 force_factor: float = 1.0, no_go: Sequence[Points] = (), clearance: float = 0.0, radius: float = 0.0,
                 headings: int = 32, spacing: Union[float, None] = None, cell: Union[float, None] = None,
                 turn_cost: float = 0.0, routes: int = 3, weights: Iterable[float] = Weights(),
                 drift: Iterable[float] = (0, 0), water: Iterable[float] = (0, 0),
                 start_heading: Union[float, None] = None, goal_heading: Union[float, None] = None) -> None:
        t = self.task = _library.RouteTask()
        self.floes, self.first = _rings("floe", ice.outlines)
        for k, ring in enumerate(np.split(self.floes, self.first[1:-1]) if len(ice.outlines) else ()):
            if _library.library().bt_outline_crosses(len(ring), _pointer(ring)):
                raise _refuse(f"floe {k}", "an outline whose edges cross or touch", "give a simple polygon")
        self.thickness = np.ascontiguousarray(np.broadcast_to(np.asarray(ice.thickness, float), len(ice.outlines)))
        if not ((self.thickness > 0) & np.isfinite(self.thickness)).all():
            raise _refuse("thickness", "a floe of none", "give every floe one above 0 m")
        self.no_go, self.no_go_first = _rings("no-go polygon", no_go)
        t.n_floes, t.floe, t.floe_first = len(ice.outlines), _pointer(self.floes), _pointer(self.first, c_int64)
        t.n_no_go, t.no_go, t.no_go_first = len(no_go), _pointer(self.no_go), _pointer(self.no_go_first, c_int64)
        t.thickness = _pointer(self.thickness)
        t.density = _number("density", ice.density, 0, above=True)
        t.added_mass = _number("added mass", ice.added_mass, 0)
        t.jam_cover = _number("jam cover", ice.jam_cover, 0, 1, above=True)
        t.rafting = _number("rafting", ice.rafting, 0, above=True, endless=True)
        t.width = _number("width of the hull", hull.width, 0, above=True)
        t.reach = _number("radius of the hull", hull.radius, 0, above=True)
        t.drag = _number("drag of the hull", hull.drag, 0, above=True)
        t.start[:] = _place("start", start)
        line = np.asarray(goal, dtype=float)
        t.goal_is_line = line.size == 4
        t.goal[:] = _place("goal", line, 4) if t.goal_is_line else 2 * _place("goal", line)
        x0, y0, x1, y1 = t.extent[:] = _place("extent", extent, 4)
        if not (x0 < x1 and y0 < y1):
            raise _refuse("extent", (x0, y0, x1, y1), "give x0, y0, x1, y1 with x0 < x1 and y0 < y1")
        v = [_number("speed", s, 0, above=True) for s in speeds]
        if not 1 <= len(v) <= 16:
            raise _refuse("speeds", v, "give 1 to 16 of them")
        t.n_speeds, t.speed[:len(v)] = len(v), v
        if objective not in OBJECTIVES:
            raise _refuse("objective", objective, "take " + ", ".join(OBJECTIVES))
        t.objective = OBJECTIVES.index(objective)
        t.force_limit = _number("force limit", force_limit, 0, above=True, endless=True)
        t.force_factor = _number("force factor", force_factor, 0, above=True)
        t.clearance, t.radius = _number("clearance", clearance, 0), _number("radius", radius, 0)
        if headings not in (16, 32):
            raise _refuse("headings", headings, "take 16 or 32")
        t.headings = headings
        t.routes = int(_number("routes", routes, 1, 16))
        t.turn_cost = _number("cost of a turn", turn_cost, 0)
        w = Weights(*map(float, weights))
        t.weight[:] = [_number(f"weight of {name}", x, 0) for name, x in w._asdict().items()]
        t.drift[:], t.water[:] = _place("drift", drift), _place("water", water)
        t.start_heading = math.nan if start_heading is None else _number("start heading", start_heading, -math.inf)
        t.goal_heading = math.nan if goal_heading is None else _number("goal heading", goal_heading, -math.inf)
        # the lattice keeps sums of slices, four to a width, for each speed (src/route/lattice.c)
        _number("width of the hull (--width) for this domain and number of speeds", t.width,
                4 * math.sqrt((x1 - x0) * (y1 - y0) * len(v) / MAX_SLICES))
        for name, value, most in ("spacing", spacing, MAX_STATES / headings), ("cell", cell, MAX_CELLS):
            least = math.sqrt((x1 - x0) * (y1 - y0) / most)
            setattr(t, name, 0 if value is None else _number(name, value, least))

    @contextlib.contextmanager
    def call(self, what: str, *more: Any) -> Iterator[_library.RoutePlan]:
        """The plan, whose arrays are freed at the end of the block."""
        plan, library = _library.RoutePlan(), _library.library()
        getattr(library, what)(ctypes.byref(self.task), *more, ctypes.byref(plan))
        try:
            yield plan
        finally:
            library.bt_route_free(ctypes.byref(plan))

    def cover(self) -> tuple[np.ndarray, tuple[float, float, float, float]]:
        x0, y0, x1, y1 = self.task.extent
        cell = max(x1 - x0, y1 - y0) / 1000
        nx, ny = (max(1, math.ceil(side / cell)) for side in (x1 - x0, y1 - y0))
        out = np.zeros((ny, nx))
        _library.library().bt_route_cover(ctypes.byref(self.task), nx, ny, _pointer(out))
        return np.clip(out, 0, 1), (x0, x1, y0, y1)


def _points(stretch: np.ndarray, cell: float) -> tuple[np.ndarray, ...]:
    """x, y, heading, time, speed along stretches [n, 8] (bt_route_stretch), at most a cell apart."""
    out, time = [], 0.0
    for k, (x, y, tx, ty, length, turn, speed, _) in enumerate(stretch):
        n = max(1, math.ceil(length / cell))
        s = length * np.arange(n + (k + 1 == len(stretch))) / n
        a = turn * s
        along, aside = (np.sin(a) / turn, (1 - np.cos(a)) / turn) if turn else (s, np.zeros_like(s))
        out.append(np.array([x + along * tx - aside * ty, y + along * ty + aside * tx,
                             a + math.atan2(ty, tx), time + s / speed, np.full_like(s, speed)]))
        time += length / speed
    x, y, heading, when, speed = np.concatenate(out, axis=1) if out else np.zeros((5, 0))
    return x, y, np.unwrap(heading), when, speed


def _legs(stretch: np.ndarray) -> np.ndarray:
    """Merge consecutive stretches with the same speed."""
    kind = [("way", float), ("length", float), ("speed", float), ("force", float)]
    rows: list[list[float]] = []
    way = 0.0
    for length, speed, force in stretch[:, [4, 6, 7]]:
        if rows and rows[-1][2] == speed:
            row = rows[-1]
            row[3] = (row[3] * row[1] + force * length) / (row[1] + length)
            row[1] += length
        else:
            rows.append([way, length, speed, force])
        way += length
    return np.array([tuple(row) for row in rows], dtype=kind)


def _route(found: _library.RouteFound, kind: str, width: float, cell: float) -> Route:
    corners = np.ctypeslib.as_array(found.corner, (found.n_corners, 2)).copy()
    stretch = np.ctypeslib.as_array(found.stretch, (found.n_stretches, 8)).copy()
    x, y, heading, time, speed = _points(stretch, cell)
    radii = np.full(len(corners), found.radius)
    radii[-1] = 0
    return Route(kind, corners, radii, x, y, heading, time, speed, _legs(stretch), found.length, found.duration,
                 found.work, found.force, found.peak, found.cost,
                 {name: found.term[k] for k, name in enumerate(Weights._fields)}, found.ice_area, found.ice_mass,
                 found.clearance, tuple(name for bit, name in FAULTS.items() if found.faults & bit),
                 swath(np.column_stack([x, y]), heading, width))


def swath(centre: np.ndarray, heading: np.ndarray, width: float) -> np.ndarray:
    """Outline [2 n, 2], m, of what a berg sweeps whose centre goes through points [n, 2], m, at headings [n], rad."""
    normal = 0.5 * width * np.column_stack([-np.sin(heading), np.cos(heading)])
    return np.concatenate([centre - normal, (centre + normal)[::-1]])


def plan(ice: Ice, hull: Hull, start: Iterable[float], goal: Points, **options: Any) -> Plan:
    """Routes from start to goal, a point or both ends of a line, fixed to the ground.

    Options: extent x0, y0, x1, y1, m, which must contain the whole hull (required); speeds to choose from, m/s;
    objective, one of OBJECTIVES; force_limit, N, on force_factor times the predicted mean force of every stretch;
    no_go, polygons [n, 2], m, fixed to the ground, and clearance from the hull, m; radius, the smallest of the berg's
    path, m; headings 16 or 32; spacing and cell of lattice and raster, m; turn_cost, unit of the objective per rad;
    routes; weights; drift of the ice and velocity of the water over the ground, m/s; start_heading, goal_heading, rad.

    Raises BergtowError for invalid numbers. If there is no route, Plan.status gives the reason."""
    task = _Task(ice, hull, start, goal, **options)
    t = task.task
    with task.call("bt_route_make") as found:
        routes = [_route(found.route[k], "planned" if k else "straight", t.width, found.cell) for k in range(found.n)]
        status = STATUS[found.status]
        data: dict[str, Any] = {}
        for what, place in ("start", t.start), ("goal", t.goal):
            if status.startswith(what):
                data = {"x": place[0], "y": place[1]}
        if status.endswith("too_thick"):
            data |= {"force": found.force, "factor": t.force_factor, "limit": t.force_limit}
        if status.endswith("no_go"):
            far = [apart.to_edges(np.array([[data["x"], data["y"]]]), polygon)[0]
                   for polygon in np.split(task.no_go, task.no_go_first[1:-1])]
            data |= {"polygon": int(np.argmin(far)), "needed": t.reach + t.clearance}
        if status == "fewer_routes":
            data = {"wanted": t.routes, "found": found.n - 1}
        return Plan(status, data, routes, found.spacing, found.cell, found.states, *task.cover())


def route_through(ice: Ice, hull: Hull, start: Iterable[float], end: Iterable[float], corners: Points = (), *,
                  speed: float, **options: Any) -> Route:
    """The way through corners [n, 2], m, at one speed, without a search: its features, for fit_weights, its area, its
    force. Without corners it is the straight line. Options: those of plan()."""
    task = _Task(ice, hull, start, np.asarray(list(end), dtype=float), speeds=(speed,), **options)
    points = np.ascontiguousarray(corners, dtype=float).reshape(-1, 2)
    with task.call("bt_route_through", len(points), _pointer(points)) as found:
        if not found.n:
            raise BergtowError(UNREACHED[STATUS[found.status]])
        return _route(found.route[0], "planned" if len(points) else "straight", task.task.width, found.cell)


def fit_weights(features: Sequence[Union[Mapping[str, float], Sequence[float]]], forces: Sequence[float]) -> Fit:
    """Non-negative weights that fit mean forces of straight tows [n], N, by least squares, from their features, N, [n]
    dicts or [n, 5] in the order of Weights. Raises BergtowError for fewer than two tows."""
    rows = np.array([[f.get(name, 0.0) for name in Weights._fields] if isinstance(f, Mapping) else f
                     for f in features], dtype=float)
    y = np.asarray(forces, dtype=float)
    if len(y) < 2 or rows.shape != (len(y), len(Weights._fields)) or not (np.isfinite(rows).all()
                                                                          and np.isfinite(y).all()):
        raise BergtowError(f"weights cannot be fitted to {len(y)} tows with features of shape {rows.shape}; give two "
                           "or more, and five finite features of each")
    scale = np.abs(rows).max(axis=0)
    scale[scale == 0] = 1
    found = scipy.optimize.nnls(rows / scale, y)[0] / scale
    told = rows @ found
    spread = ((y - y.mean()) ** 2).sum()
    r2 = 1 - ((y - told) ** 2).sum() / spread if spread > 0 else math.nan
    flat = np.ptp(told) <= 1e-12 * np.abs(told).max(initial=0) or spread == 0
    return Fit(Weights(*map(float, found)), float(r2), math.nan if flat else float(scipy.stats.spearmanr(told, y)[0]))
