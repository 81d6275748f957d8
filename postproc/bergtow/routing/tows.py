# SPDX-License-Identifier: MIT
"""Routes as cases, their tows through the members of the map, and the outcome of each tow.

A route becomes a separate case: the path of the body (tow.mode speed) or of the towing end, tow.speed or tow.programme,
and run.duration. Speeds of a route are through the ice, those of a case over the ground: where the ice drifts, a
programme brings the tow to each point of its path at the planned time.

In a steady turn the line carries the drag F along the path and the centripetal force across it, so it points inwards of
the tangent by delta, tan(delta) = m kappa V² / F, with the mass m including added mass and the curvature kappa; then
R_end² = R² - 2 R L sin(delta) + L². The end is placed accordingly at body + L (cos(delta) t + sin(delta) n): for a
light body this is the inverse of the tractrix. kappa is smoothed over the length of the line, because a body cannot
follow a jump in it; the simulation shows how the tow responds. Rejected: the tractrix alone, with which an iceberg of
3e8 kg on 600 m of line swings out of a turn of 800 m by 150 m.

The goal is reached where the body comes within ARRIVED of its width, at the moment when it is nearest. All numbers of a
tow are for the time up to then, or to its end if the goal is missed.
"""
from dataclasses import dataclass, field

from bergtow.errors import CASE, BergtowError, RunError
from bergtow.result.run import least
from bergtow.routing import apart, planner
from bergtow.study.runs import CaseRuns

import numpy as np

ARRIVED = 1.0        # body widths from the goal
LONGER = {"speed": 1.05, "line": 1.15, "thrust": 1.6}  # run.duration / the predicted time; a vessel may be slowed down
PEAK = 99            # percentile of the step means after the ramp that counts as peak
STRAIGHT = 5e-3      # body widths: how far a polyline may deviate from a path
FINE = 1e-4          # the same of the path of a body whose speed is prescribed
FRAMES = 150         # of the one tow per route that a page replays
TOUCH = 1e-3         # body widths: counts as contact with a no-go area


@dataclass
class Candidate:
    """A route at one speed, or at the speeds of its legs."""

    name: str
    label: str
    route: object        #: planner.Route
    speed: float         #: m/s, NaN: set by the legs
    keys: dict = field(default_factory=dict)  #: keys of its case, as texts
    track: np.ndarray = None                  #: [m, 2] planned track of the body over the ground, m
    tug: np.ndarray = None                    #: [m, 2] of the towing end, or None
    swath: np.ndarray = None                  #: [k, 2] outline of what the body sweeps over the ground, m
    points: np.ndarray = None                 #: [k, 2] waypoints of the case, m

    @property
    def seconds(self):
        """run.duration"""
        return float(self.keys["run.duration"].split()[0])

    @property
    def straight(self):
        return self.route.kind == "straight"


def simplified(xy, off):
    """The fewest points of a polyline [n, 2] that stay within `off` of it (Douglas & Peucker 1973)."""
    keep, stack = {0, len(xy) - 1}, [(0, len(xy) - 1)]
    while stack:
        i, j = stack.pop()
        if j - i < 2:
            continue
        a, edge = xy[i], xy[j] - xy[i]
        rel = xy[i + 1:j] - a
        t = np.clip(rel @ edge / max(edge @ edge, 1e-300), 0, 1)
        far = np.hypot(*(rel - t[:, None] * edge).T)
        if far.max() > off:
            k = i + 1 + int(far.argmax())
            keep.add(k)
            stack += [(i, k), (k, j)]
    return xy[sorted(keep)]


def polyline(track, situation):
    """Points [k, 2] of the path that a case gives for a track [n, 2], m."""
    return simplified(track, (FINE if situation.mode == "speed" else STRAIGHT) * situation.hull.width)


def pairs(points, text="{:.10g}".format):
    return "[" + ", ".join(f"[{text(a)}, {text(b)}]" for a, b in points) + "]"


def legs_of(route, track, time, situation):
    """[(length m, speed m/s)] over the ground: of a route, or, where the ice drifts, of its track [n, 2], m, at the
    times [n], s, to within STRAIGHT."""
    if not any(situation.drift):
        return [(float(length), float(v)) for length, v in zip(route.legs["length"], route.legs["speed"])]
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(track, axis=0).T)))
    mean = way[-1] / time[-1]
    at, way = simplified(np.column_stack([mean * time, way]), STRAIGHT * situation.hull.width).T
    return [(float(length), float(mean * length / step)) for length, step in zip(np.diff(way), np.diff(at)) if length]


def programme(legs, ramp, start=(0.0, 0.0)):
    """[(time s, speed m/s)] of a tow at the speeds of its legs [(length m, speed m/s)], from a time and a speed on. A
    change of speed takes the share of the ramp, s, that it is of the largest speed; one by rounding is none."""
    top, out, (time, at) = max(v for _, v in legs), [start], start
    for length, v in legs:
        v = at if abs(v - at) < 1e-9 * top else v
        change = ramp * abs(v - at) / top * (1 + 1e-9)  # rounded, it is no steeper than the ramp
        way = change * (v + at) / 2
        if change > 0:
            time += change
            out.append((time, v))
        time += max(length - way, 0.01 * length) / v
        out.append((time, v))
        at = v
    return out


def paced(programme, end=np.inf):
    """Keys of a programme: tow.speed must be its largest speed up to the end of the run, s."""
    return {"tow.programme": pairs(programme, repr), "tow.speed": f"{max(v for t, v in programme if t <= end)!r} m/s"}


def tug_track(route, situation):
    """[m, 2] track of the towing end in the frame of the ice, and [n] of bool: the points of the route it is of."""
    s = situation
    way = np.append(0.0, np.cumsum(np.hypot(np.diff(route.x), np.diff(route.y))))
    new = np.append(True, np.diff(way) > 1e-9 * way[-1])
    way, x, y, heading = way[new], route.x[new], route.y[new], np.unwrap(route.heading)[new]
    # curvature averaged over two line lengths with triangular weights, from means of the heading
    area = np.append(0.0, np.cumsum(np.diff(way) * (heading[1:] + heading[:-1]) / 2))

    def whole(at):  # integral of the heading, which is constant before the start and after the end
        inside = np.clip(at, 0, way[-1])
        return (np.interp(inside, way, area) + np.minimum(at, 0) * heading[0] +
                np.maximum(at - way[-1], 0) * heading[-1])
    turn = (whole(way + s.line) - 2 * whole(way) + whole(way - s.line)) / s.line
    force = max(route.force, s.hull.drag * route.length ** 2 / route.duration ** 2)
    speed = route.length / route.duration
    delta = np.arctan(s.mass * (turn / s.line) * speed ** 2 / force) if s.line > 0 else 0.0 * way
    return np.column_stack([x + s.line * np.cos(heading + delta), y + s.line * np.sin(heading + delta)]), new


def led(route, situation):
    """([m, 2], [m]): track over the ground, m, of the body, or of the end that pulls it, and its times, s."""
    s = situation
    if s.mode == "speed":
        track, time = np.column_stack([route.x, route.y]), route.time
    else:
        track, new = tug_track(route, s)
        time = route.time[new]
    return track + np.outer(time, s.drift), time


def candidate(name, label, route, situation):
    """The case of a route, at the speeds of its legs."""
    s = situation
    speed = float(route.legs["speed"][0]) if len(set(route.legs["speed"].tolist())) == 1 else np.nan
    body = np.column_stack([route.x, route.y]) + np.outer(route.time, s.drift)
    course = np.arctan2(route.speed * np.sin(route.heading) + s.drift[1],
                        route.speed * np.cos(route.heading) + s.drift[0])
    c = Candidate(name, label, route, speed, {}, body, swath=planner.swath(body, course, s.hull.width))
    track, time = led(route, s)
    if s.mode == "speed" and not any(s.drift):
        turns = route.radii[:-1][route.radii[:-1] > 0]
        c.points = route.waypoints
        c.keys = {"tow.turn_radius": f"{0.999 * turns.min():.10g} m"} if len(turns) else {}
    else:  # where the ice drifts, an arc through it is none over the ground
        c.points = polyline(track, s)[1:]
    c.tug = None if s.mode == "speed" else track
    c.keys["tow.waypoints"] = pairs(c.points)
    dt = s.values["run.dt"]
    if any(s.drift) or not np.isfinite(speed):
        points = programme(legs_of(route, track, time, s), max(s.ramp, dt))
        total = points[-1][0]
        c.keys |= paced(points)
    else:
        total = route.length / speed + s.ramp / 2
        c.keys |= {"tow.speed": f"{speed!r} m/s", "tow.ramp": f"{s.ramp!r} s"}
    c.keys["run.duration"] = f"{dt * np.ceil(LONGER[s.mode] * total / dt):.10g} s"
    c.keys["output.window_start"] = "-1 s"
    return c


def candidates(routes, speeds, situation, at_speed):
    """(Every route at every speed that brings it to its goal, and also at the speeds of its legs if these differ;
    [{"label", "kind", "speed", "reason"}] of those that do not). at_speed(route, m/s): the route at that speed; raises
    BergtowError with the reason if there is none. Hardly faster than the drift, a tow has a long way through the ice.
    Where that leaves the domain, the map knows no ice, and a tow would not be comparable."""
    out, unreached, k = [], [], 0
    for route in routes:
        k += route.kind != "straight"
        name, label = ("straight", "straight line") if route.kind == "straight" else (f"route-{k}", f"route {k}")
        for speed in (*speeds, *[np.nan] * (len(set(route.legs["speed"].tolist())) > 1)):
            more = ("-legs", ", speed by legs") if np.isnan(speed) else \
                (f"-{speed:.4g}", f", {speed:.4g} m/s") if len(speeds) > 1 else ("", "")
            try:
                towed = route if np.isnan(speed) else at_speed(route, speed)
                if "outside" in towed.faults:
                    raise BergtowError(planner.UNREACHED["outside"])
                out.append(candidate(name + more[0], label + more[1], towed, situation))
            except BergtowError as e:
                unreached.append({"label": label + more[1], "kind": route.kind, "speed": speed, "reason": str(e)})
    return out, unreached


# ---- runs


@dataclass
class Tows(CaseRuns):
    """Tows of candidates through members. Each member is a condition of a study, and reads its own ice."""

    members: list = field(default_factory=list)

    def member(self, i):
        return f"c{i + 1:03d}-r001"

    def own(self, i, values):
        """The keys of a member. Only the first member writes frames."""
        member = self.members[i].keys if self.members else {}
        frames = -1.0 if i else float(values["run.duration"].split()[0]) / FRAMES
        return {k: v for k, v in (member | {"output.frame_interval": f"{frames:.10g} s"}).items() if k not in values}

    def sets(self, i, values):
        """Values that replace those of the case in the tow of a member, as texts for --set."""
        return [f"{k}={v}" for k, v in (values | self.own(i, values)).items()]

    def study(self, n, values):
        return {"set": values, "variants": {f"m{i + 1:03d}": self.own(i, values) for i in range(n)}}


# ---- the outcome of a tow


def to_goal(xy, goal):
    """[n] distance of points to the goal, a point or a line."""
    a = np.atleast_2d(np.asarray(goal, dtype=float))
    if len(a) == 1:
        return np.hypot(*(xy - a[0]).T)
    edge = a[1] - a[0]
    t = np.clip((xy - a[0]) @ edge / (edge @ edge), 0, 1)
    return np.hypot(*(xy - a[0] - t[:, None] * edge).T)


def arrival(xy, goal, within):
    """Index of the sample at which the goal is reached, None if it is missed."""
    distance = to_goal(xy, goal)
    near = np.flatnonzero(distance <= within)
    if not len(near):
        return None
    first = near[0]
    away = np.flatnonzero(distance[first:] > within)
    stay = distance[first:first + away[0]] if len(away) else distance[first:]
    return int(first + np.argmin(stay))


def outcome(run, c, goal, situation, force_limit=np.inf):
    """{name: number} for a tow. Raises RunError."""
    s, time = situation, run["time"]
    if len(time) < 2:
        raise RunError(run.path, "holds no series", "make run.dt shorter", CASE)
    xy = np.column_stack([run["body_x"], run["body_y"]])
    end = arrival(xy, goal, ARRIVED * s.hull.width)
    n = len(time) if end is None else end + 1
    # length and work are those of the way through the ice, as in the plan
    step = np.diff(np.vstack([s.start, np.column_stack([run["body_in_ice_x"], run["body_in_ice_y"]])[:n]]), axis=0)
    dt = np.diff(np.append(0.0, time[:n]))
    force = least(run["tow_force" if s.mode == "speed" else "line_tension"])[:n]
    along = np.hypot(*step.T)
    if s.mode != "speed":
        line = np.column_stack([run["carriage_x"], run["carriage_y"]])[:n] - xy[:n]
        along = np.sum(step * line, axis=1) / np.hypot(*line.T)
    there = np.isfinite(force) & np.isfinite(along)  # excludes the time after the line has parted
    work = float(np.sum((force * along)[there]))
    largest = float(np.max(force[there])) if there.any() else np.nan
    late = there & (time[:n] > s.ramp)  # without the force that accelerates the body
    late = late if late.any() else there
    force, dt = force[late], dt[late]
    body = np.column_stack([xy, run["body_yaw"]])[:n]
    off = apart.to_edges(xy[:n], np.vstack([c.track, c.track[::-1]]))
    touch = apart.least(body, s.outline, s.no_go, TOUCH * s.hull.width)
    return {"arrived": end is not None, "time": float(time[n - 1]) if end is not None else np.nan,
            "work": work, "length": float(np.sum(np.hypot(*step.T))), "largest": largest,
            "peak": float(np.percentile(force, PEAK)) if len(force) else np.nan,
            "mean_force": float(np.sum(force * dt) / np.sum(dt)) if len(force) else np.nan,
            "limit_exceeded": largest > force_limit, "slack": bool(s.mode != "speed" and np.any(force <= 0)),
            "parted": any(e["kind"] == "line_broken" for e in run.events),
            "no_go_contact": bool(touch <= TOUCH * s.hull.width), "off_track": float(off.max()),
            "missed_by": float(to_goal(xy, goal).min()), "no_load": bool(np.isnan(run["ice_resistance"][:n]).any()),
            "hash": str(run.summary.get("state_hash")), "wall_s": run.number("wall_time_s")}
