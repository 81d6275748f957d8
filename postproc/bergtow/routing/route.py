# SPDX-License-Identifier: MIT
"""Route and speed of a tow through known ice.

    bergtow route CASE.yml --to "3 km,0.4 km" -o DIR           four candidates, twelve members of the map
    bergtow route CASE.yml --to 20.3E,76.6N --plan-only        in seconds, without tows
    bergtow route CASE.yml --to "3 km,0" --replan "30 min"     with a new look at the ice every half hour

routing/planner.py plans routes with an estimated cost. Then every candidate is towed through the same ice, and the tows
decide (routing/verdict.py). Each file is written as soon as its contents exist. Repeating a call that was stopped
continues it: its tows are those of study/runs.py.
"""
import base64
import json
import time
from pathlib import Path

from bergtow import writing
from bergtow._program import program_path
from bergtow.arguments import from_zero, measure, not_below_zero, several, whole_from
from bergtow.case import Case
from bergtow.errors import CASE, IO, SIGNAL, USAGE, BergtowError, RunError
from bergtow.result.run import Run
from bergtow.routing import apart, horizon, members, output, planner, situation, tows, verdict
from bergtow.study import analysis
from bergtow.study.runs import FINISHED, SPENT, checked, locked, state_of
from bergtow.text import route as words

import numpy as np

BUDGET = 60.0            # min
ROUTES, MEMBERS = 3, 12  # six judge: as many as a sign test needs to show fewer failures
#: default errors of a map, assumed: relative to the hull's width, to the thickness, to the speed of the tow
POSITION, THICKNESS, DRIFT = 0.1, 0.1, 0.02
#: least radius of a path. For a body with prescribed speed: hull widths. For a body on a line: the larger of the line
#: and this many lengths m / C, over which the drag C V² of water alone takes its momentum; the line then leads inwards
#: by 27°
RADIUS, LENGTHS = 2.0, 2.0
RANKS_POORLY = 0.5       # rank correlation of the cost, below which a warning is printed
SWATH = 15.0             # hull widths: least length of a swath for --calibrate
FILES = ("route-base.yml", "straight.yml", "routes.geojson", "routes.gpx", "route.json", "route.png", "route.html")

#: status of a plan without routes: (name of the option or key, reason, remedy)
STATUS = {
    "start_no_go": ("--from", "the body would lie in a no-go area", "start elsewhere, or give less "
                    "--clearance"),
    "goal_no_go": ("--to", "the goal lies in a no-go area, or too close to one for the body",
                   "choose a goal in free water, or give less --clearance"),
    "start_outside": ("--from", "the body would reach outside the domain", "start elsewhere, or enlarge the domain"),
    "goal_outside": ("--to", "the goal lies outside the domain, or too close to its edge for the body",
                     "choose a goal inside it, or enlarge the domain; where ice drifts, the domain moves with it until "
                     "the tow arrives, and a higher speed helps"),
    "start_too_thick": ("--from", "the ice about the start takes more than --force-limit at every speed",
                        "start elsewhere, or give a lower speed or a higher limit"),
    "goal_too_thick": ("--to", "the ice about the goal takes more than --force-limit at every speed",
                       "choose another goal, or give a lower speed or a higher limit"),
    "no_route": ("--to", "no way leads from the start to the goal",
                 "give a smaller --radius, --clearance or --width, or a higher --force-limit"),
    "at_goal": ("--to", "the tow starts at its goal", "choose a goal elsewhere"),
    "goal_drifts_away": ("--to", "the goal drifts away from the ice faster than the body is towed",
                         "take a higher speed"),
}


def options(p):
    p.add_argument("case", metavar="CASE.yml", type=Path)
    p.add_argument("--to", required=True, metavar="X,Y", help="goal, in metres of the case or with units, or in "
                   "degrees as 20.1E,76.5N if the map has a place; X,Y:X,Y is a line, and the tow may end at any of "
                   "its points")
    p.add_argument("--from", dest="start", metavar="X,Y", help="start (default: where the case has the body)")
    p.add_argument("--map", type=Path, metavar="FILE", help="the ice: outlines (.geojson) or a field (.h5) in place of "
                   "that of the case")
    p.add_argument("--no-go", action="append", default=[], type=Path, metavar="FILE", help="polygons of no-go areas "
                   "(GeoJSON, ...): land, shoals, zones; may be repeated. Fixed floes of the case are no-go areas, too")
    p.add_argument("--clearance", type=from_zero("m"), metavar="M", default=0.0,
                   help="distance to keep from no-go areas (default 0 m)")
    p.add_argument("--objective", choices=tuple(words.UNITS), default="work",
                   help="quantity to minimise (default work)")
    p.add_argument("--speeds", type=several(measure("m/s")), metavar="V,V",
                   help="speeds to choose among (default: tow.speed)")
    p.add_argument("--force-limit", type=measure("N"), default=np.inf, metavar="F",
                   help="largest tow force or tension allowed")
    p.add_argument("--routes", type=whole_from(1, 16), default=ROUTES, metavar="K", help="routes besides the straight "
                   f"line, at least a width apart (default {ROUTES})")
    p.add_argument("--members", type=whole_from(1, 1000), default=MEMBERS, metavar="N", help="members of the map that "
                   f"every route is towed through (default {MEMBERS}; a map without errors has one)")
    p.add_argument("--map-error", type=from_zero("m"), metavar="M",
                   help=f"standard deviation of floe positions (default {POSITION:g} widths of the body, assumed)")
    p.add_argument("--thickness-error", type=not_below_zero, default=THICKNESS, metavar="S",
                   help="standard deviation / mean of the floe thickness (default %(default)g, assumed)")
    p.add_argument("--drift-error", type=from_zero("m/s"), metavar="V",
                   help=f"standard deviation of each component of the drift (default {DRIFT:g} of the speed, assumed)")
    p.add_argument("--calibrate", type=whole_from(0, 1000), default=0, metavar="N", help="fit the cost to N straight "
                   "swaths towed through the map first, at least 6 (default 0: none)")
    p.add_argument("--replan", type=measure("s"), metavar="S",
                   help="map the ice again after every S of the tow, and plan the rest anew")
    p.add_argument("--map-age", type=from_zero("s"), metavar="S", default=0.0,
                   help="age of each new map of --replan (default 0 s)")
    p.add_argument("--width", type=measure("m"), metavar="M",
                   help="width of the body across its path (default: the mean over its headings)")
    p.add_argument("--radius", type=from_zero("m"), metavar="M",
                   help=f"least radius of the body's path (default: the length of the line, or {LENGTHS:g} times the "
                   f"body's mass over its water drag at 1 m/s; without a line {RADIUS:g} widths)")
    p.add_argument("--headings", type=int, choices=(16, 32), default=32, 
                   help="number of headings of the search lattice (default 32)")
    p.add_argument("--cell", type=measure("m"), metavar="M",
                   help="cell size of the cost raster (default: an eighth of the width, or more)")
    p.add_argument("--turn-cost", type=not_below_zero, default=0.0, metavar="C", help="cost of one radian of "
                   "turning, in the unit of the objective (default 0)")
    p.add_argument("--plan-only", action="store_true", help="plan without simulating tows")
    p.add_argument("--no-page", action="store_true", help="leave out route.html, the page with the replays")
    p.add_argument("-o", "--output", metavar="DIR", type=Path, help="result folder (default: out/route-CASE); tows are "
                   "kept there, and repeating the command continues")
    analysis.add_options(p, BUDGET)


def refuse_looks(w, s):
    """Reject options and cases that --replan does not support. Raises RunError."""
    if s.mode == "thrust":
        raise RunError("--replan", "the vessel of tow.mode thrust steers for a point ahead on its path, so that a new "
                       "path would change its tow before the new map", "set tow.mode to speed or line", USAGE)
    if len(w["speeds"]) > 1:
        raise RunError("--replan", "plans the path at one speed", "give --speeds one speed", USAGE)
    if w["age"] > w["replan"]:
        raise RunError("--map-age", "is longer than --replan", "give a map that is younger than the time between looks",
                       USAGE)


def wanted(a, s):
    """Values of the options, in SI units: {"speeds", "errors", "radius", ...}. s: Situation."""
    speeds = a.speeds or [s.values["tow.speed"]]
    if not speeds[0] > 0:
        raise RunError("tow.speed", "is 0: nothing reaches a goal", "give --speeds", CASE)
    if a.members == 1 and a.map_error is None and a.drift_error is None and a.thickness_error == THICKNESS:
        errors = members.Errors(0.0, 0.0, 0.0)
    else:
        drift = 0.0 if s.values["water.current_table"] else DRIFT * speeds[-1]
        errors = members.Errors(POSITION * s.hull.width if a.map_error is None else a.map_error, a.thickness_error,
                                drift if a.drift_error is None else a.drift_error)
    return {"speeds": tuple(speeds), "errors": errors,
            "assumed": a.map_error is None or a.drift_error is None or a.thickness_error == THICKNESS,
            "limit": a.force_limit, "radius": a.radius if a.radius is not None else
            max(s.line, LENGTHS * s.mass / s.hull.drag) if s.line else RADIUS * s.hull.width,
            "clearance": a.clearance, "cell": a.cell, "replan": a.replan, "age": a.map_age}


def planned(a, w, s, goal, weights, factor, **more):
    """Call planner.plan() with the options. more: further options of planner.plan()."""
    given = {"speeds": w["speeds"], "routes": a.routes, "headings": a.headings, "cell": w["cell"],
             **priced(a, w, s, weights, factor), **more}
    ice, start = given.pop("ice", s.ice), given.pop("start", s.start)
    return planner.plan(ice, s.hull, start, goal, **given)


def priced(a, w, s, weights, factor):
    """Options of planner.plan() that the cost and the faults of a path depend on."""
    return {"objective": a.objective, "force_limit": w["limit"], "force_factor": factor, "no_go": s.no_go,
            "clearance": w["clearance"], "radius": w["radius"], "turn_cost": a.turn_cost, "weights": weights,
            "drift": s.drift, "water": s.water, "extent": s.extent}


def at_speed(route, speed, s, cell, options):
    """A planned route at one speed, m/s. Its corners keep their places in the ice or, as the goal does, over the
    ground, whichever is cheaper. cell: m; options: priced(). Raises BergtowError if it does not reach the goal."""
    if set(route.legs["speed"].tolist()) == {speed}:
        return route
    corners = route.waypoints[:-1]
    times = [route.time[np.argmin(np.hypot(*(np.column_stack([route.x, route.y]) - at).T))] for at in corners]
    *over_ground, goal = route.waypoints + np.outer([*times, route.duration], s.drift)
    moved = passed(over_ground, s.start, s.drift, speed) if any(s.drift) and over_ground else None
    found, why = [], None
    for some in (corners, *[moved] * (moved is not None)):
        try:  # a hair less of a radius: arcs that touch fit in spite of rounding
            found.append(planner.route_through(s.ice, s.hull, s.start, goal, some, speed=speed, cell=cell,
                                               **options | {"radius": 0.999 * options["radius"]}))
        except BergtowError as e:
            why = why or e
    if not found:
        raise why
    return min(found, key=lambda r: (len(r.faults), r.cost))


def passed(points, start, drift, speed):
    """[n, 2] places in the ice, m, of points over the ground as a body passes them one after the other at a speed
    through the ice, m/s; None if one drifts away."""
    out, time = [], 0.0
    for at, way in zip(points, np.diff([start, *points], axis=0)):
        along = way @ drift  # |way - drift t| = speed t
        root = along ** 2 + (speed ** 2 - np.dot(drift, drift)) * (way @ way)
        if root < 0 or along + np.sqrt(root) <= 0:
            return None
        time += way @ way / (along + np.sqrt(root))
        out.append(at - np.multiply(drift, time))
    return out


def refuse(plan, found, path, force):
    """Raises RunError if a plan has no routes, after writing what was found."""
    if plan.status not in STATUS:
        return
    writing.write_json(found | {"status": plan.status, "status_data": plan.data, "routes": []}, path, force)
    what, why, remedy = STATUS[plan.status]
    units = {"x": " m", "y": " m", "needed": " m", "force": " N", "limit": " N"}
    numbers = ", ".join(f"{k} {v + (k == 'polygon'):.4g}{units.get(k, '')}" for k, v in plan.data.items()
                        if isinstance(v, (int, float)))
    raise RunError(what, why + (f" ({numbers})" if numbers else ""), remedy, CASE)


# ---- calibration


def swaths(n, s, length):
    """n straight swaths within the domain and clear of no-go areas: [(start, end)]. Raises RunError."""
    rng, out = np.random.default_rng([members.SEED, 1]), []
    low, high = np.array(s.extent[:2]) + s.hull.radius, np.array(s.extent[2:]) - s.hull.radius
    for _ in range(1000 * n):
        a, turn = rng.uniform(low, high), rng.uniform(0, 2 * np.pi)
        b = a + length * np.array([np.cos(turn), np.sin(turn)])
        if np.all((b > low) & (b < high)):
            way = np.column_stack([np.linspace(a, b, 50), np.zeros(50)])
            if apart.least(way, s.outline, s.no_go, 0.0) > 0:
                out.append((a, b))
        if len(out) == n:
            return out
    raise RunError("--calibrate", f"there is no room for {n} straight swaths of {length:.4g} m", "take fewer, or leave "
                   "it out", CASE)


def calibrated(a, w, s, runs):
    """(weights, ratio of peak to mean force, results) from straight tows through the map."""
    if a.calibrate < 6:
        raise RunError(f"--calibrate {a.calibrate}", "are too few swaths for five weights", "take 6 or more", USAGE)
    speed = w["speeds"][-1]
    length = min(max(SWATH * s.hull.width, 1.5 * speed * s.ramp), 0.6 * min(s.extent[2] - s.extent[0],
                                                                            s.extent[3] - s.extent[1]))
    floes, folder = members.Floes.read(s.field), s.field.parent / "swaths"
    outlines = floes.outlines()
    folder.mkdir(parents=True, exist_ok=True)
    features, forces, ratios, spent = [], [], [], False
    for k, (start, end) in enumerate(swaths(a.calibrate, s, length)):
        yaw = float(np.arctan2(*(end - start)[::-1]))
        file = folder / f"s{k + 1:03d}.h5"
        floes.take(members.clear_of_hull(outlines, s, start, yaw)).write(file)
        route = planner.route_through(s.ice, s.hull, start, end, speed=speed, extent=s.extent, cell=w["cell"],
                                      drift=s.drift, water=s.water)
        c = tows.candidate(f"swath-{k + 1}", f"swath {k + 1}", route, s)
        keys = c.keys | situation.reading(s.values, file) | {
            f"body.{name}": f"{value:.12g} {unit}" for name, value, unit in
            (("x", start[0], "m"), ("y", start[1], "m"), ("yaw", yaw, "rad"))}
        made = tow(runs, c.name, range(1), keys)
        spent = spent or SPENT in made
        if made[0]:
            continue
        with Run(runs.path(c.name, 0)) as run:
            t = run["time"]
            late = (t > s.ramp) & np.isfinite(run["ice_resistance"])
            force = run["tow_force"][late]
            if len(force) < 2:
                continue
            forces.append(force.mean())
            ratios.append(np.percentile(force, tows.PEAK) / force.mean())
        features.append(route.features)
    if len(forces) < 6:
        raise RunError("--calibrate", f"only {len(forces)} swaths were towed to their ends", "give --budget more time, "
                       "or leave --calibrate out", SIGNAL if spent else IO)
    fit = planner.fit_weights(features, np.array(forces))
    rank = float(fit.rank_correlation)
    told = {"swaths": len(forces), "r2": float(fit.r2), "rank_correlation": rank,
            "weights": dict(zip(planner.Weights._fields, map(float, fit.weights))), "force_factor":
            float(np.median(ratios)), "poor": not rank >= RANKS_POORLY}
    print(words.calibration(told))
    return planner.Weights(*fit.weights), told["force_factor"], told


def tow(runs, name, some, keys, line=None):
    """Make the tows of some members, and print why any of them failed. line: as in runs.make()."""
    why = runs.make(name, some, keys, line)
    for i, reason in zip(some, why):
        if reason and reason != SPENT:
            runs.tell((name, i), f"{runs.path(name, i)}: {reason}")
    return why


# ---- results


def off_map(route, known):
    """Length of a route through the ice, m, that lies beyond the map of it. known: of the Situation."""
    if known is None:
        return 0.0
    xy = np.column_stack([route.x, route.y])
    middle, length = (xy[1:] + xy[:-1]) / 2, np.hypot(*np.diff(xy, axis=0).T)
    return float(length[np.any((middle < known[:2]) | (middle > known[2:]), axis=1)].sum())


def described(c, known):
    """A candidate as a dict for JSON. known: of the Situation."""
    r = c.route
    return {"name": c.name, "label": c.label, "kind": r.kind, "speed": c.speed, "case": f"{c.name}.yml",
            "faults": list(r.faults), "waypoints": c.points, "predicted": {
                "length": r.length, "time": r.duration, "work": r.work, "mean_force": r.force, "peak_of_legs": r.peak,
                "ice_area": r.ice_area, "ice_mass": r.ice_mass, "clearance": r.clearance, "cost": r.cost,
                "off_map": off_map(r, known), "features": r.features}}


def means(some):
    """Means over the members of a route; for times and work, over those that arrive."""
    out = {}
    for name in ("work", "time", "peak", "length", "mean_force", "largest", "off_track"):
        x = [t[name] for t in some if t["arrived"] or name in ("mean_force", "peak", "largest", "off_track")]
        x = [v for v in x if np.isfinite(v)]
        out[name] = float(np.mean(x)) if x else np.nan
    return out


def numbers(found):
    """{name: properties} for GeoJSON."""
    out, v = {}, found.get("verdict") or {}
    for r in found["routes"]:
        p = {f"predicted_{k}": x for k, x in r["predicted"].items() if k != "features"}
        p |= {"label": r["label"], "kind": r["kind"], "speed_m_s": r["speed"]}
        if r.get("simulated"):
            p |= {f"simulated_{k}": x for k, x in r["simulated"].items()}
        if r["name"] in v.get("order", ()):
            c = v["compared"].get(r["name"], {})
            p |= {"rank": v["order"].index(r["name"]) + 1, "relative": c.get("relative"),
                  "relative_95": c.get("relative_95"), "recommended": r["name"] == v["recommended"]}
        out[r["name"]] = p
    return out


def draw(found, plan, some, s, goal, bold, path, force):
    from bergtow.plot import route as picture
    from bergtow.plot import style
    shown = [c for c in some
             if not np.isfinite(c.speed) or c.speed == max(x.speed for x in some if np.isfinite(x.speed))]
    e = plan.cover_extent
    with style.look():
        writing.save(picture.figure(f"{found['title']}: routes", words.answer(found), s.place, s.extent, plan.cover,
                                    e, s.ice.outlines, s.no_go, shown, bold, goal), path, force)


class Files:
    """Output files, written again whenever there are new results."""

    def __init__(self, folder, plan, some, s, goal, force):
        self.folder, self.plan, self.some, self.s, self.goal, self.force = folder, plan, some, s, goal, force

    def write(self, found, picture=False):
        folder, place = self.folder, self.s.place
        writing.write_json(found, folder / "route.json", self.force)
        output.geojson(self.some, place, numbers(found), folder / "routes.geojson", self.force)
        if picture:
            bold = (found.get("verdict") or {}).get("recommended") or (found.get("verdict") or {}).get("straight")
            draw(writing.plain(found), self.plan, self.some, self.s, self.goal, bold, folder / "route.png", self.force)

    def write_plan(self):
        for c in self.some:
            output.case(c, self.folder / "route-base.yml", self.folder / f"{c.name}.yml", self.force)
        if self.s.place.origin is not None:
            output.gpx(self.some, self.s.place, self.folder / "routes.gpx", self.force)


def estimate(runs, s, some, n):
    """By `bergtow check`: its warnings, and seconds for the first candidate's tow with frames, for one without, and the
    wall time of the n tows of all candidates."""
    keys = some[0].keys if s.values["ice.outlines"] else situation.reading(s.values, s.field) | some[0].keys
    found = [json.loads(checked(runs.program, s.case, runs.sets(i, keys), "--json")) for i in (0, 1)]
    replay, plain = (one["cost"]["core_time_s"] for one in found)
    ways = sum(c.seconds for c in some) / some[0].seconds
    whole = ways * (plain * -(-n // runs.jobs) + (replay - plain) / min(n, runs.jobs))
    if not s.values["ice.outlines"] and not s.values["ice.field"]:  # it was made for the plan: its keys have an effect
        found = [json.loads(checked(runs.program, s.case, runs.sets(0, some[0].keys), "--json"))]
    return found[0]["warnings"], (replay, plain, whole)


def elsewhere(s):
    """Warnings of no-go files with no area in the domain."""
    return [{"code": "no_go_elsewhere", "text": f"{some['file']}: none of its no-go areas lies in the domain", "values":
             some} for some in s.no_go_files if not some["in_domain"]]


def first_tow(found, told, folders):
    """Make a function that prints how long all tows will take, based on the first one to finish. It is called at each
    line of the program's output, the first of them before any tow ends. told: estimate(); folders: of the tows."""
    replay, plain, total = told
    before = None

    def line(_):
        nonlocal before
        ended = {i for i, folder in enumerate(folders) if state_of(folder)[0] == FINISHED}
        before = ended if before is None else before
        for i in sorted(ended - before if "estimate_by_tow_s" not in found else ())[:1]:
            with Run(folders[i]) as run:
                found["estimate_by_tow_s"] = total * run.number("wall_time_s") / (plain if i else replay)
            print(f"by the first tow: {words.amount(found['estimate_by_tow_s'], 's')} in all\n", flush=True)
    return line


def perform(a):
    folder = a.output or Path("out") / f"route-{a.case.stem}"
    if not a.case.exists():
        raise RunError(a.case, "no such file", "name a case file")
    for name in FILES:
        writing.may_write(folder / name, a.force)
    began, program = time.monotonic(), program_path()
    work, body = (folder / "route").resolve(), {}
    case, ramp = situation.own_case(a.case, a.set, body, folder, a.map, a.force)
    if a.start:
        values = Case(case)
        place = situation.place_of(values, lambda: situation.floes_of(program, case, values, work))
        x, y = situation.position(a.start, place, "--from")
        body = {"body.x": f"{x:.12g} m", "body.y": f"{y:.12g} m"}
        case, ramp = situation.own_case(a.case, a.set, body, folder, a.map, a.force)
    s = situation.of(program, case, work, ramp, a.no_go, a.width)
    goal = situation.goal(a.to, s.place)
    w = wanted(a, s)
    if tows.to_goal(np.array([s.start]), goal)[0] <= tows.ARRIVED * s.hull.width:
        raise RunError(f"--to {a.to}", f"is reached at the start of the tow: within a width of the body, "
                       f"{s.hull.width:.4g} m", "choose a goal farther away", CASE)
    if w["replan"]:
        refuse_looks(w, s)
    for some in s.no_go_files:
        print(words.no_go(some))
    last = began + 60 * a.budget
    runs = tows.Tows(case.resolve(), folder, "route", program, [], a.jobs, last, last)
    found = {"case": a.case.name, "title": s.values["run.title"] or a.case.stem, "status": "ok", "set": a.set,
             "objective": a.objective, "start": s.start, "goal": goal, "speeds": w["speeds"],
             "force_limit": w["limit"], "radius": w["radius"], "clearance": w["clearance"],
             "hull_width": s.hull.width,
             "floes": len(s.ice.outlines), "drift": s.drift, "no_go": s.no_go_files, "warnings": elsewhere(s),
             "map_errors": vars(w["errors"]) | {"assumed": w["assumed"]},
             "calibration": None, "verdict": None, "rounds": []}
    with locked(folder / "route") as runs.lock:
        weights, factor = planner.Weights(), 1.0
        if a.calibrate and not a.plan_only:
            weights, factor, found["calibration"] = calibrated(a, w, s, runs)
        clock = time.monotonic()
        plan = planned(a, w, s, goal, weights, factor)
        found |= {"plan_s": time.monotonic() - clock, "states": plan.states, "cell": plan.cell, "spacing": plan.spacing}
        refuse(plan, found, folder / "route.json", a.force)
        options = priced(a, w, s, weights, factor)
        some, unreached = tows.candidates(plan.routes, w["speeds"], s,
                                          lambda route, speed: at_speed(route, speed, s, plan.cell, options))
        found |= {"status": plan.status, "status_data": plan.data, "routes": [described(c, s.known) for c in some],
                  "unreached": unreached}
        files = Files(folder, plan, some, s, goal, a.force)
        files.write_plan()
        n = 1 if w["errors"].none else a.members
        warnings, told = estimate(runs, s, some, n)
        found["warnings"] += warnings
        files.write(found, picture=True)
        print("\n".join(words.warnings(found) + [words.plan(writing.plain(found))]))
        if plan.status == "fewer_routes":
            print("\nNo further alternative found: every other path runs within one width of these.")
        how = f"{len(some)} candidates, {n} member{'s' * (n > 1)} each: {len(some) * n} tows, {a.jobs} at a time"
        found["estimate_s"] = told[-1]
        if w["replan"]:
            looks, found["estimate_s"] = horizon.estimate(some[0], w["replan"], told, found["plan_s"])
            how = f"{looks} looks, each at the end of a tow from the start, and three whole tows, one at a time"
        print(f"\n{how}: rough estimate {words.amount(found['estimate_s'], 's')}\n", flush=True)
        if a.plan_only:
            print(words.answer(writing.plain(found)))
            print(folder / "route.json")
            return
        if w["replan"]:
            horizon.follow(a, w, s, goal, weights, factor, runs, files, found, plan)
        else:
            verify(a, w, s, goal, some, n, runs, files, found, told)


def verify(a, w, s, goal, some, n, runs, files, found, told):
    """Tow every candidate through the members, and decide between them."""
    folder, began = files.folder, time.monotonic()
    runs.members = members.drawn(n, s, w["errors"], s.field.parent / "members")
    found["left_out"] = [m.left_out for m in runs.members]
    outcomes, by_name = {}, {r["name"]: r for r in found["routes"]}
    for c in some:
        why = tow(runs, c.name, range(n), c.keys, first_tow(found, told, [runs.path(c.name, i) for i in range(n)])
                  if c is some[0] else None)
        if SPENT in why:
            files.write(found)
            raise RunError(folder, f"the budget of {a.budget:g} min is spent, but some tows are still to be made",
                           "call again: finished work is kept", SIGNAL)
        if any(why):
            runs.tell_failed()
        rows = []
        for i in range(n):
            with Run(runs.path(c.name, i)) as run:
                rows.append(tows.outcome(run, c, goal, s, w["limit"]))
        outcomes[c.name] = rows
        by_name[c.name] |= {"members": rows, "simulated": means(rows), "counts": {
            name: sum(verdict.fault(t, name) for t in rows) for name in (*verdict.FAULTS, "no_load")}}
        files.write(found)
    found["verdict"] = verdict.of(some, outcomes, a.objective)
    found["tows_s"] = time.monotonic() - began
    files.write(found, picture=True)
    told = writing.plain(found)
    print(f"\n{words.verified(told)}\n\n{words.meaning(told)}\n\n{words.answer(told)}\n")
    v = found["verdict"]
    shown = [(by_name[name]["label"], runs.path(name, 0)) for name in
             dict.fromkeys(x for x in (v["recommended"] or v["chosen"], v["straight"]) if x)]
    page(a, found, shown, folder)


def page(a, found, shown, folder):
    """Write the page with two tows side by side: [(heading, folder of the tow)]."""
    print(folder / "route.json")
    if a.no_page:
        return
    from bergtow.reporting import side_by_side
    picture = base64.b64encode((folder / "route.png").read_bytes()).decode("ascii")
    told = writing.plain(found)
    side_by_side.write(f"{told['title']}: routes", words.text(told), picture, shown, folder / "route.html", a.force)
