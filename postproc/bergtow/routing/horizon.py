# SPDX-License-Identifier: MIT
"""A receding horizon: plan, tow for a while, look at the ice again, plan the rest.

Each look is a tow from the start up to that time, along the route decided so far. A new plan keeps that part of the
route, so that the tow up to the look is the same, to the bit, and the final tow is a single case from start to goal.
Rejected: restarting with the ice as it lies, because the floes would come to rest at every look.

The ice of the tow is that of the case. A look sees its floes as they lay `age` before, moved on with the mean drift,
and with the errors of the map. Without age and errors the look is perfect, which no real look is: the gain is an upper
bound.
"""
import dataclasses

from bergtow import writing
from bergtow.errors import CASE, SIGNAL, RunError
from bergtow.result.run import Run
from bergtow.routing import members, output, situation, tows, verdict
from bergtow.study.runs import SPENT
from bergtow.text import route as words

import numpy as np

MOST = 100       # looks
AHEAD = 2        # steps by which the decided part extends beyond a look


def seen(ice, errors, k):
    """The floes as look k sees them."""
    rng, n, half = np.random.default_rng([members.SEED, 2, k]), len(ice.outlines), np.sqrt(0.5)
    common, shift, thick, each = (rng.standard_normal(shape) for shape in (2, (n, 2), (), n))
    moved = errors.position * half * (common + shift)
    sigma = np.sqrt(np.log1p(errors.thickness ** 2))
    return dataclasses.replace(ice, outlines=[o + m for o, m in zip(ice.outlines, moved)], thickness=np.asarray(
        ice.thickness) * np.exp(sigma * half * (thick + each) - sigma ** 2 / 2))


@dataclasses.dataclass
class Way:
    """Path over the ground [n, 2], m, of the body, or of the end that pulls it, and the pace along it: [(time s, speed
    m/s)], linear between."""

    points: np.ndarray
    pace: list

    def split(self, look, time):
        """(The same way with points of its pace at the two times, s, and one of its path at the later; the part up to
        there)."""
        early, late = ([p for p in self.pace if p[0] < look], [p for p in self.pace if p[0] > time])
        pace = early + [(t, float(np.interp(t, *np.transpose(self.pace)))) for t in (look, time)]
        times, speeds = np.transpose(pace)
        points, last = with_point(self.points, np.sum(np.diff(times) * (speeds[1:] + speeds[:-1]) / 2))
        return Way(points, pace + late), Way(points[:last + 1], pace)


def way_of(route, s, decided=None):
    """The Way of a plan, from the start or after a decided one."""
    track, time = tows.led(route, s)
    old = decided or Way(track[:1], [(0.0, 0.0)])
    # A new plan may start beside the end of the decided way: the line of a tow that turns leads inwards. It is joined
    # where it is so much farther that the way there is hardly longer, and so no faster, than that of the plan.
    away = np.hypot(*(track - old.points[-1]).T)
    far = np.append(np.flatnonzero(away > 2 * away[0] + 0.1 * s.hull.width), len(track) - 1)[0]
    track, time = np.vstack([old.points[-1:], track[far:]]), np.append(0.0, time[far:])
    pace = tows.programme(tows.legs_of(route, track, time, s), max(s.ramp, s.values["run.dt"]), old.pace[-1])
    return Way(np.vstack([old.points, tows.polyline(track, s)[1:]]), old.pace + pace[1:])


def with_point(points, way):
    """Insert a point at `way` m along a polyline [n, 2]: (points, its index). A tow up to there is the same, to the
    bit, on every route that begins with these points; a leg that ended elsewhere would differ in the last digit."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    passed = np.append(0.0, np.cumsum(lengths))
    k = min(int(np.searchsorted(passed, way, side="right")) - 1, len(lengths) - 1)
    at = points[k] + (points[k + 1] - points[k]) * (way - passed[k]) / lengths[k]
    if min(np.hypot(*(at - points[k])), np.hypot(*(at - points[k + 1]))) < 1e-6 * lengths[k]:
        return points, k if way - passed[k] < lengths[k] / 2 else k + 1
    return np.insert(points, k + 1, at, axis=0), k + 1


def best(plan, heading=None, headings=32):
    """The cheapest allowed route of a plan; None if there is none. heading: of the tow at a look, rad. The straight
    line may differ from it by half a step of the lattice's headings, as even the nearest heading of the lattice may."""
    def allowed(r):
        if set(r.faults) <= {"turns"} and heading is not None:
            off = (r.heading[0] - heading + np.pi) % (2 * np.pi) - np.pi
            return not r.faults or abs(off) <= np.pi / headings
        return not r.faults
    some = [r for r in plan.routes if allowed(r)]
    return min(some, key=lambda r: r.cost) if some else None


class Horizon:
    """Its tows."""

    def __init__(self, a, w, s, goal, runs, files, found):
        self.a, self.w, self.s, self.goal, self.runs, self.files, self.found = a, w, s, goal, runs, files, found
        self.speed, self.dt = w["speeds"][0], s.values["run.dt"]

    def steps(self, duration):
        """A duration in whole steps, as a case gives it, s."""
        return float(f"{self.dt * np.ceil(duration / self.dt - 1e-9):.10g}")

    def keys(self, way, duration):
        end = self.steps(duration)
        return {"tow.waypoints": tows.pairs(way.points[1:]), **tows.paced(way.pace, end),
                "output.window_start": "-1 s", "run.duration": f"{end:.10g} s"}

    def tow(self, name, way, duration):
        """Make a tow and return its folder. Raises RunError."""
        keys = self.keys(way, duration)
        why = self.runs.make(name, range(1), keys)
        if SPENT in why:
            raise RunError(self.files.folder,
                           f"the budget of {self.a.budget:g} min is spent, but some tows are still to be made",
                           "call again: finished work is kept", SIGNAL)
        if why[0]:
            self.runs.tell_failed()
        return self.runs.path(name, 0)

    def whole(self, name, way, c):
        """The outcome of a tow along a whole way, and its folder."""
        path = self.tow(name, way, self.duration(way))
        with Run(path) as run:
            out = tows.outcome(run, c, self.goal, self.s, self.w["limit"])
        return out | {"faults": [f for f in (*verdict.FAULTS, "no_load") if verdict.fault(out, f)]}, path

    def duration(self, way):
        return tows.LONGER[self.s.mode] * way.pace[-1][0]

    def look(self, k, time, way):
        """(ice, start, heading, decided part, whole way) at a look; None once the goal is reached or the line has
        parted. The whole way is that of the current tow, which continues if no new plan is allowed."""
        s = self.s
        way, decided = way.split(self.steps(time), self.steps(time) + AHEAD * self.dt)
        end, tangent = decided.points[-1], decided.points[-1] - decided.points[-2]
        path = self.tow(f"look-{k}", way, time)
        with Run(path) as run:
            frame = run.frame_at(time - self.w["age"])
            moved = np.array(s.drift) * (time - run.frame_times[frame])
            outlines = run.polygons(frame)
            some = np.append(s.moving, np.arange(run.n_start, run.n_floes))
            some = some[np.isfinite(run.pose(frame)[some, 0])]  # pieces replace the floes that split
            ice = dataclasses.replace(s.ice, outlines=[outlines[i] + moved for i in some],
                                      thickness=run.thickness[some])
            body = np.array([run["body_x"][-1], run["body_y"][-1]])
            broken = sum(e["kind"] == "line_broken" for e in run.events)
            if (tows.to_goal(body[None], self.goal)[0] <= tows.ARRIVED * s.hull.width
                    or 0 < s.values["tow.line.branches"] <= broken):
                return None
            if s.mode == "speed":
                through = tangent * decided.pace[-1][1] / np.hypot(*tangent) - s.drift  # the ice
                start, heading = end, np.arctan2(*through[::-1])
            else:
                line = end - body
                heading = np.arctan2(*line[::-1])
                start = end - s.line * line / np.hypot(*line)
        return seen(ice, self.w["errors"], k), tuple(start), float(heading), decided, way


def estimate(c, every, told, planning):
    """(looks, total seconds): for the successive tows up to each look, the three complete tows, and the plans. c: a
    Candidate; told: route.estimate(); planning: s per plan."""
    replay, plain, _ = told
    looks = max(0, min(MOST - 1, int(np.ceil(c.route.duration / every)) - 1))
    up_to = plain * every / c.seconds * looks * (looks + 1) / 2
    return looks, up_to + looks * (replay - plain + planning) + 3 * replay


def follow(a, w, s, goal, weights, factor, runs, files, found, plan):
    """Tow with new looks, with the first plan only, and straight, through the ice of the case; report the results."""
    from bergtow.routing import route as command
    runs.members = [members.Member(situation.reading(s.values, s.field))]
    h = Horizon(a, w, s, goal, runs, files, found)
    perfect = w["errors"].none and not w["age"]
    first = plan if w["errors"].none else command.planned(a, w, s, goal, weights, factor,
                                                          ice=seen(s.ice, w["errors"], 0))
    route = best(first)
    if route is None:
        raise RunError("bergtow route", "no route is allowed at the first look", "give a higher --force-limit, or a "
                       "smaller --radius or --clearance", CASE)
    way = once = way_of(route, s)
    found["horizon"] = {"every": w["replan"], "age": w["age"], "perfect": perfect, "tows": {}}

    def noted(k, time, status, r):
        found["rounds"].append({"time": time, "status": status, "length": r.length if r else np.nan,
                                "work": r.work if r else np.nan, "waypoints": way.points[1:]})
        writing.write_json({"keys": h.keys(way, time)} | found["rounds"][-1], files.folder / f"round-{k}.json",
                           a.force)
        files.write(found)

    noted(0, 0.0, first.status, route)
    left = route.duration
    for k in range(1, MOST):
        time = k * w["replan"]
        if left <= w["replan"]:
            break
        there = h.look(k, time, way)
        if there is None:
            break
        ice, start, heading, decided, way = there
        new = command.planned(a, w, s, goal, weights, factor, ice=ice, start=start, start_heading=heading)
        route = best(new, heading, a.headings)
        if route:
            way = way_of(route, s, decided)
            left = route.duration
        else:
            left -= w["replan"]
        noted(k, time, new.status, route)
    by_name = {r["name"]: r for r in found["routes"]}
    ways, some = {"horizon": (way, way.points), "once": (once, once.points)}, {}
    ways |= {"straight": (way_of(c.route, s), c.track) for c in files.some if c.straight}
    for name, (towed, track) in ways.items():
        c = tows.Candidate(name, name, first.routes[0], h.speed, {}, track)
        found["horizon"]["tows"][name], some[name] = h.whole(f"tow-{name}", towed, c)
        files.write(found)
    if "straight" in by_name:
        by_name["straight"]["simulated"] = command.means([found["horizon"]["tows"]["straight"]])
    c = tows.Candidate("horizon", "with new looks", route or first.routes[0], h.speed, h.keys(
        way, h.duration(way)), way.points, points=way.points[1:])
    output.case(c, files.folder / "route-base.yml", files.folder / "horizon.yml", a.force)
    files.write(found, picture=True)
    told = writing.plain(found)
    print(words.rounds(told))
    command.page(a, found, [(heading, some[name]) for name, heading in (
        ("horizon", "with new looks"), ("straight", "straight line")) if name in some], files.folder)
