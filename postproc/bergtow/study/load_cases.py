# SPDX-License-Identifier: MIT
"""The load cases of a tow in addition to the steady one: start, course change, stop, loss of thrust, a line that parts,
head current and wind. Each is a row with its load, from short separate runs or a closed form; the row names the method.

With M the mass of the body including added mass, V the speed, D the drag of water and wind at V, R the mean ice
resistance, F the design value of the steady tow, k = EA/L of the line:

    start            at the end of a linear ramp of T seconds  F_s = D + R + M V/T; the ramp that requires no more
                     than F is T = M V/(F - D - R), on a line no less than that of towing.ramp_for, for the
                     ice alone under F - D. Runs with that ramp, and with shorter ones as long as these hold,
                     show the effect of the ice
    course change    on a line its tension in runs through a bend of radius r; otherwise the force along the course in
                     such runs, across it M V^2/r: the root of the sum of squares
    stop             the line stays taut if the ordered stop, linear in time, takes at least M V/R: the drag vanishes
                     with the speed, and in the end the ice alone slows the body
    loss of thrust   in still water the body coasts for  M V^2/(2 D) ln(1 + D/R), in  M V/sqrt(D R) atan(sqrt(D/R)), if
                     the resistance of the ice stays R; it falls with the speed, so these are lower bounds. If the line
                     is taken up again at a relative speed of V, an upper bound, the load is towing.snap_load
    a line parts     of a bridle with two equal branches, at constant pull: the other is loaded from F/2, and swings,
                     without damping, to 3/2 F. A single line: the tow is lost, and the body coasts as above
    head sea         paired runs with current and wind against the tow, as for a changed value in study/assumed.py; no
                     less than the largest load of these runs

Angle and radius of the bend are assumed unless the call gives them, and so are current and wind. These determine the
load: a head current of half the speed doubles the drag. So if they are assumed, the row is shown beside the design
value, but is not included in it.
"""
import functools
import math
import time
from dataclasses import dataclass, field

from bergtow import towing
from bergtow.case import quantities
from bergtow.result.run import case_value, within
from bergtow.stats import largest as stat_largest
from bergtow.stats import load as stat_load
from bergtow.stats import loads as stat_loads
from bergtow.study import assumed
from bergtow.study.runs import SPENT
from bergtow.table import quantity

import numpy as np

SHORTER = 0.6            # factor from a ramp that holds to the next one tried
LONGER = 1.5             # factor from one that does not
RAMPS = 3                # tried at most
HEAD_CURRENT, HEAD_WIND = 0.25, 15.0  # m/s at full scale, assumed
SETTLE = 300.0           # s at full scale, before and after a bend
BEND_WIDTHS = 10.0       # radius of the bend / width of the body across the flow, assumed
PARTED = 1.5             # load of the remaining branch / pull
NO_WIND = 1e-3           # of the load: smaller air drag is due to the body's own motion


@dataclass
class Tow:
    """The steady tow to which the load cases refer, in SI units."""

    case: dict             #: {key: text}, as the program reads it
    speed: float
    direction: float       #: rad
    mass: float            #: including added mass
    water: float           #: drag
    wind: float
    ice: float             #: mean resistance
    value: float           #: F; all forces in N
    kind: str              #: of F, as in the answer
    interval: tuple | None
    width: float           #: across the flow, m
    area: float            #: of the waterline, m2
    case_ramp: float       #: s, of the unchanged case
    case_start: float      #: largest mean over `scale` before the window with that ramp; NaN if unknown
    scale: float           #: s, over which loads are averaged
    slower: float          #: time at full scale / time of the case
    distance: float        #: of the tow, m
    line: object           #: gear.Line
    vessel_mass: float     #: kg, NaN if unknown

    @property
    def mean(self):
        return self.water + self.wind + self.ice

    @property
    def spring(self):
        """EA/L, N/m; NaN without a known line."""
        return self.line.stiffness / self.line.length if self.line.length > 0 else np.nan


@dataclass
class Runs:
    """The runs of load cases and ranges: study/runs.py, with those done, and without aborting if one fails."""

    runs: object
    fields: range           #: for paired runs, whose interval is that over these fields
    few: range              #: for runs whose largest value is taken
    duration: float         #: s, of the case
    pace: float             #: core s / s of simulated time, measured in the fields of the case
    left_out: bool = False  #: make no runs
    done: set = field(default_factory=set)  #: (name, field) of the runs; several load cases take the same base
    own: dict = field(default_factory=dict)  #: {name: pace of these runs}: a head sea takes several times as long

    def make(self, some, fields=None):
        """Make the runs of {name: sets}. They start only if, at the pace measured so far, all would end in time. None
        if they are done, or the code of the reason why not: "budget", "run_failed"."""
        if self.left_out:
            return "left_out"
        fields = fields or self.fields
        jobs = self.runs.jobs
        rounds = [(name, fields[k:k + jobs]) for name in some for k in range(0, len(fields), jobs)]
        for k, (name, here) in enumerate(rounds):
            takes = sum(self.takes(other, some[other], these) for other, these in rounds[k:])
            began = time.monotonic()
            if takes > max(0.0, self.runs.end - began):
                return "budget"
            expected = self.takes(name, some[name], here)
            why = self.runs.make(name, here, some[name])
            if SPENT in why:
                return "budget"
            if any(why):
                return "run_failed"
            self.done |= {(name, i) for i in here}
            if expected > 0:
                self.own[name] = self.own.get(name, self.pace) * (time.monotonic() - began) / expected
        return None

    def takes(self, name, sets, fields):
        """Time for the runs that are missing, s."""
        missing = sum(not self.runs.kept(name, i) for i in fields)
        seconds = float(sets["run.duration"].split()[0]) if "run.duration" in sets else self.duration
        return -(-missing // self.runs.jobs) * self.own.get(name, self.pace) * seconds

    def measured(self, name, measure, fields=None):
        return self.runs.each(name, fields or self.fields, measure)


@functools.cache
def drag_estimate():
    """The name of the estimate of the open-water drag, which is added to the ice resistance."""
    return next(e["name"] for e in quantities()["estimates"] if e["kind"] == "on top")


def mean_parts(run):
    """Mean ice resistance in the window of a run, the drag of the water, and the total drag."""
    water = run.number(f"estimates.{drag_estimate()}.force_n")
    return {"ice": float(run.number("mean_ice_resistance_n")), "water": water, "drag": run.number("mean_drag_force_n")}


def largest_mean(run, scale, start, end, name="tow_force"):
    """Largest mean over `scale` of the tow force, or of another load, between two times, N; NaN if there is none."""
    some, time = stat_loads.of_run(run)
    x = next((x for load, x in some if load.name == name), None)
    if x is None:
        return np.nan
    there = within(time, start, end)
    dt = float(np.median(np.diff(time)))
    n = max(1, int(round(scale / dt)))
    return float(stat_load.moving_mean(x[there], n).max()) if np.sum(there) >= n else np.nan


def mass_of(run, direction):
    """Mass of the body including added mass, kg: inertia force over acceleration along the tow; NaN if it is never
    accelerated."""
    v = np.cos(direction) * run["body_vx"] + np.sin(direction) * run["body_vy"]
    a, f = np.diff(v) / np.diff(run["time"]), run["inertia_force"][1:]
    some = np.isfinite(a) & np.isfinite(f) & (np.abs(a) > 0.05 * np.nanmax(np.abs(a), initial=0.0))
    return float(np.sum(f[some] * a[some]) / np.sum(a[some] ** 2)) if some.any() else np.nan


def row(name, n, kind, by, acts_on="tow", **more):
    return {"id": f"case.{name}", "n": n, "kind": kind, "by": by, "acts_on": acts_on, "in_design": True,
            "interval_95": None, "runs": 0, "set": {}, "formula": None, "values": {}, "reason": None} | more


def none(name, reason, **more):
    """A row without a load."""
    return row(name, np.nan, "none", more.pop("by", "runs"), reason=reason, **more)


# ---- closed forms


def start_ramp(t):
    """Ramp in seconds that requires no more than the steady tow does; inf if its value is not above the mean."""
    above = t.value - t.mean
    by_inertia = t.mass * t.speed / above if above > 0 else np.inf
    if np.isfinite(t.spring):
        # The ice holds a body at rest; drag grows as it gathers way, over many periods of the line, and excites no
        # swing. Rejected: counting drag as part of the holding force, which takes hours where drag is most of the load
        return max(by_inertia, towing.ramp_for(t.value - (t.water + t.wind), t.speed, t.spring, t.mass, t.ice))
    return by_inertia


def taut_stop(t):
    return t.mass * t.speed / t.ice if t.ice > 0 and t.mean > 0 else np.nan


def coasting(t):
    """(m, s) that the body at least coasts without thrust; (nan, nan) if no ice stops it, or there is a current."""
    drag, ice = t.water + t.wind, t.ice
    current = any(t.case.get(key, "none").split()[0] not in ("none", "0") for key in (
        "water.current_x", "water.current_y", "water.current_table", "water.tide.major"))
    if not (drag > 0 and ice > 0) or current:
        return np.nan, np.nan
    return (t.mass * t.speed ** 2 / (2 * drag) * math.log1p(drag / ice),
            t.mass * t.speed / math.sqrt(drag * ice) * math.atan(math.sqrt(drag / ice)))


def stop(t):
    return row("stop", t.mean, "closed_form", "closed_form", formula="taut_stop",
               values={"slack_below_s": taut_stop(t), "mass_kg": t.mass, "mean_n": t.mean})


def loss_of_thrust(t):
    distance, time = coasting(t)
    values = {"coasts_m": distance, "coasts_s": time, "line_m": t.line.length}
    if not np.isfinite(t.spring):
        stiff, long = np.isfinite(t.line.stiffness), t.line.length > 0
        reason = "line_not_known" if stiff == long else "line_length_not_known" if stiff else "line_stiffness_not_known"
        return none("loss_of_thrust", reason, by="closed_form", acts_on="line", formula="coasting", values=values)
    heavy = towing.effective_mass(t.mass, t.vessel_mass if np.isfinite(t.vessel_mass) else np.inf)
    snap = towing.snap_load(t.speed, t.spring, heavy, static=t.mean)
    return row("loss_of_thrust", snap, "bound", "closed_form", "line", formula="snap_load",
               values=values | {"relative_speed_m_s": t.speed, "stiffness_n_m": t.spring, "effective_mass_kg": heavy})


def line_parted(t):
    if t.case.get("tow.line.branches") == "2" and t.case.get("tow.mode") in ("line", "thrust"):
        return row("line_parted", PARTED * t.value, "closed_form", "closed_form", "line", formula="one_of_two_branches",
                   values={"pull_n": t.value, "factor": PARTED})
    distance, time = coasting(t)
    return none("line_parted", "single_line_tow_is_lost", by="closed_form", acts_on="line", formula="coasting",
                values={"coasts_m": distance, "coasts_s": time})


# ---- runs


def few(t, runs):
    """(kind, values) of the largest of the runs of a load case, and what it shows about such tows: a lower bound, as
    for the steady tows. Without ice the only run is all such tows."""
    if t.kind == "constant" and len(runs.few) == 1:
        return "constant", {}
    return "largest_of_n", {"n_tows": len(runs.few), "share_below": stat_largest.share_below(len(runs.few))}


def start(t, runs, say):
    """(row, ramp): the shortest tried ramp whose start requires no more than the steady tow."""
    first, (kind, such) = start_ramp(t), few(t, runs)
    own = {"case_s": t.case_ramp, "case_n": t.case_start}
    ramp = {"id": "ramp", "s": first, "n": t.value, "limit_n": t.value, "by": "closed_form", "closed_form_s": first,
            "verified": False, **own}
    def closed(reason):
        return row("start", t.value if np.isfinite(first) else np.nan,
                   "closed_form" if np.isfinite(first) else "none", "closed_form", formula="start_ramp", reason=reason,
                   values=own | {"ramp_s": first, "mass_kg": t.mass}), ramp
    if not np.isfinite(first):
        return closed("value_not_above_mean")
    if t.case.get("tow.programme", "none") != "none":
        return closed("case_has_programme")
    steps, held, tried, reason = math.ceil(first / t.scale), None, [], None
    for _ in range(RAMPS):
        seconds = steps * t.scale
        if t.speed * seconds / 2 > t.distance:
            reason = reason or "tow_too_short"
            break
        name = f"start-{seconds:.6g}s"
        sets = {"tow.ramp": f"{seconds:.9g} s", "run.duration": f"{seconds + 4 * t.scale:.9g} s",
                "output.window_start": f"{seconds:.9g} s"}
        reason = runs.make({name: sets}, runs.few)
        if reason:
            break
        n = max(runs.measured(name, lambda run: largest_mean(run, t.scale, 0.0, seconds + t.scale), runs.few))
        tried.append({"ramp_s": seconds, "n": n})
        say(f"a start with a ramp of {seconds / 60:.3g} min takes {quantity(n, 'N')}")
        if n <= t.value:
            held = tried[-1] | {"set": sets}
            steps = min(math.ceil(SHORTER * steps), steps - 1)
        elif held:
            break
        else:
            steps = math.ceil(LONGER * steps)
        if steps < 1 or any(x["ramp_s"] == steps * t.scale for x in tried):
            break
    if held is None:
        found, ramp = closed(reason or "no_ramp_held")
        if tried:
            best = min(tried, key=lambda x: x["n"])
            found |= {"n": best["n"], "kind": kind, "by": "runs", "runs": len(tried) * len(runs.few)}
            ramp |= {"s": best["ramp_s"], "n": best["n"], "by": "runs"}
        return found | {"values": found["values"] | (such if tried else {}) | {"tried": tried}}, ramp
    ramp |= {"s": held["ramp_s"], "n": held["n"], "by": "runs", "verified": True}
    return row("start", held["n"], kind, "runs", runs=len(tried) * len(runs.few), set=held["set"],
               values=own | such | {"ramp_s": held["ramp_s"], "closed_form_s": first, "mass_kg": t.mass,
                                    "tried": tried}), ramp


def inside(case, place, margin):
    """Is a position, [x, y], at least this distance, m, from the ends and sides of the domain?"""
    first, size = ([case_value(case, f"domain.{key}") for key in keys] for keys in (("x0", "y0"), ("length", "width")))
    return all(case.get(f"domain.{kind}") in ("periodic", "moving") or a + margin <= at <= a + b - margin
               for kind, at, a, b in zip(("ends", "sides"), place, first, size))


def course_change(t, runs, degrees, radius):
    """Through a bend. On a line the towing end leads by its length, and a vessel looks ahead, so the bend begins that
    far ahead, and the tension also holds the body in the bend; for a body whose speed is prescribed, no series contains
    the force across the course."""
    if t.case.get("tow.waypoints", "none") != "none" or t.case.get("tow.programme", "none") != "none":
        return none("course_change", "case_has_path")
    r = radius or BEND_WIDTHS * t.width
    on_line = t.case.get("tow.mode") != "speed"
    ahead = case_value(t.case, "tow.hull_x", 0.0) + case_value(t.case, "tow.line_length", 0.0) if on_line else 0.0
    if t.case.get("tow.mode") == "thrust":
        ahead += case_value(t.case, "tow.vessel.lookahead", 0.0)
    tension = on_line and t.case.get("tow.line.branches", "1") == "1"
    angle, settle = math.radians(degrees), SETTLE / t.slower
    x, y = (float(t.case[f"body.{k}"].split()[0]) for k in "xy")
    tangent = r * math.tan(abs(angle) / 2)
    first = t.speed * (t.case_ramp / 2 + settle) + tangent
    last = t.speed * settle + tangent
    d = [np.array([math.cos(t.direction + a), math.sin(t.direction + a)]) for a in (0.0, angle)]
    corner = np.array([x, y]) + (ahead + first) * d[0]
    end = corner + last * d[1]
    way = first + last - 2 * tangent + r * abs(angle) + ahead
    too_short = "tow_too_short" if way > t.distance else "domain_too_short"
    if way > t.distance or not inside(t.case, end, t.width / 2):
        return none("course_change", too_short, values={"way_m": way, "radius_m": r, "angle_deg": degrees})
    duration = t.case_ramp / 2 + way / t.speed
    sets = {"tow.waypoints": f"[[{corner[0]:.9g}, {corner[1]:.9g}], [{end[0]:.9g}, {end[1]:.9g}]]",
            "tow.turn_radius": f"{r:.9g} m", "run.duration": f"{duration:.9g} s",
            "output.window_start": f"{t.case_ramp + settle / 2:.9g} s"}
    values = {"angle_deg": degrees, "radius_m": r, "radius_given": bool(radius),
              "across_n": 0.0 if tension else t.mass * t.speed ** 2 / r}
    if reason := runs.make({"course-change": sets}, runs.few):
        return none("course_change", reason, set=sets, values=values)
    begin = t.case_ramp + settle
    load = f"{stat_loads.TENSION}1" if tension else "tow_force"
    along = max(runs.measured("course-change", lambda run: largest_mean(run, t.scale, begin, duration - settle / 2,
                                                                        load), runs.few))
    kind, such = few(t, runs)
    n = math.copysign(math.hypot(along, values["across_n"]), along)  # below zero the body is held back in the bend
    return row("course_change", n, kind, "runs", runs=len(runs.few), set=sets,
               formula="tension" if tension else "hypot", values=values | such | {"along_n": along})


def combined_interval(t, n, ends, r):
    """The interval of a changed load, combined with that of the steady tow, whose sides scale by R'/R: the root of the
    sum of squares of the two; None if one of the two is unknown."""
    if not np.isfinite(ends).all() or t.interval is None or np.isnan(t.interval).any():
        return None
    return tuple(n + sign * math.hypot(end - n, r * (own - t.value))
                 for sign, end, own in zip((-1, 1), ends, t.interval))


def changed(t, base, other):
    """(load, (low, high) of the paired fields, parts) of the steady tow under other conditions: F' = W' + w R'/R. base,
    other: mean_parts of the fields."""
    r, ends = assumed.ratio([b["ice"] for b in base], [o["ice"] for o in other])
    fixed, rest = np.mean([o["drag"] for o in other]), t.value - t.water - t.wind
    return fixed + rest * r, tuple(fixed + rest * x for x in ends), {"ice_ratio": r, "drag_n": fixed, "rest_n": rest}


def head_sea(t, runs, current=None, wind=None):
    """Current and wind against the tow, m/s, on the fields of the base runs. Each takes the place of the component that
    the case has along the tow, unless it is None. If both are None they are assumed, at model scale by Froude's law."""
    given = current is not None or wind is not None
    if not given:
        current, wind = HEAD_CURRENT / t.slower, HEAD_WIND / t.slower
    if any(t.case.get(key, "none") != "none" for key in ("water.current_table", "air.wind_table")):
        return none("head_sea", "environment_from_table")
    d = np.array([math.cos(t.direction), math.sin(t.direction)])
    own = {key: float(t.case.get(key, "0").split()[0]) for key in ("water.current_x", "water.current_y", "air.wind_x",
                                                                   "air.wind_y")}
    sets, values = {}, {"given": given}
    for name, key, against in (("water.current", "current_m_s", current), ("air.wind", "wind_m_s", wind)):
        of_case = np.array([own[f"{name}_x"], own[f"{name}_y"]])
        values[key] = float(0.0 - of_case @ d) if against is None else against
        if against is not None:
            there = of_case - (of_case @ d + against) * d
            sets |= {f"{name}_{k}": f"{x:.9g} m/s" for k, x in zip("xy", there)}
    if reason := runs.make({"base": {}, "head-sea": sets}):
        return none("head_sea", reason, set=sets, values=values)
    base, other = (runs.measured(name, mean_parts) for name in ("base", "head-sea"))
    if not np.isfinite([x for some in (base, other) for part in some for x in part.values()]).all():
        return none("head_sea", "no_window", set=sets, values=values)
    n, ends, parts = changed(t, base, other)
    largest = max(runs.measured("head-sea", lambda run: largest_mean(run, t.scale, *run.window)))
    interval, values = combined_interval(t, n, ends, parts["ice_ratio"]), values | parts | {"largest_n": largest}
    if largest > n:
        n, kind, interval = largest, "largest_of_n", None
        values |= {"n_tows": len(runs.fields), "share_below": stat_largest.share_below(len(runs.fields))}
    else:
        kind = "changed"
    return row("head_sea", n, kind, "runs", in_design=given, runs=len(runs.fields), set=sets, formula="changed",
               interval_95=interval, values=values)


# ---- ranges


def effect(t, r, runs):
    """The row of one range: a drag coefficient by its closed form, anything else by paired runs."""
    key, at = r.key, t.case.get(r.key, "")
    out = {"id": f"range.{key}", "key": key, "at": at, "low": r.low, "high": r.high, "source": r.source,
           "distribution": r.distribution or None, "n_low": None, "n_high": None, "n_low_95": None, "n_high_95": None,
           "n_per_tenth": None, "fields": 0, "runs": 0, "reason": None}
    part = assumed.ANALYTIC.get(key)
    if part:
        form = form_drag(t) if part == "water" else t.wind
        return out | {"by": "analytic", "n_per_tenth": assumed.TENTH * form,
                      "n_low": form * (float(r.low) / float(at) - 1), "n_high": form * (float(r.high) / float(at) - 1)}
    ends = {f"{key}-{end}": {key: getattr(r, end)} for end in ("low", "high")}
    if reason := runs.make({"base": {}} | ends):
        return out | {"by": "runs", "reason": reason}
    for end in ("low", "high"):
        base, other = (runs.measured(n, mean_parts) for n in ("base", f"{key}-{end}"))
        n, ends, _ = changed(t, base, other)
        out |= {f"n_{end}": n - t.value, f"n_{end}_95": tuple(e - t.value for e in ends) if np.isfinite(ends).all()
                else None}
    low, high, here = in_one_unit(r.low, r.high, at)
    slope = (out["n_high"] - out["n_low"]) / (high - low) if high != low else np.nan
    return out | {"by": "runs", "fields": len(runs.fields), "runs": 2 * len(runs.fields),
                  "n_per_tenth": assumed.TENTH * here * slope}


def in_one_unit(*texts):
    """Numbers from texts with the same unit, such as "5 m" or "0.3"; NaN for all if their units differ."""
    parts = [str(text).split(None, 1) for text in texts]
    try:
        return [float(p[0]) for p in parts] if len({tuple(p[1:]) for p in parts}) == 1 else [np.nan] * len(parts)
    except (ValueError, IndexError):
        return [np.nan] * len(parts)


def form_drag(t):
    """The part of the water drag due to its form coefficient, N: the rest is friction under the body."""
    form = 0.5 * float(t.case["body.drag.water_form"]) * case_value(t.case, "body.draft") * t.width
    return t.water * form / (form + float(t.case["body.drag.water_skin"]) * t.area)
