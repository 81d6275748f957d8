# SPDX-License-Identifier: MIT
"""The answer to a client's question, answer.json: tow force with interval or a named fall-back, its parts, load cases,
the band over the assumed values, ramp, vessel, line, speeds, and the sentence made from them.

It holds codes and numbers in SI units; text/answer.py turns them into words. Every number in the sentence names the id
of the row that it comes from. A value is, in this order,

    return_level     the level of the stated probability, if a tail can be fitted
    constant         a load that does not vary
    at_least         the largest simulated, if a line parted or a step had no solution: it has no upper bound
    largest_of_n     the largest of the n tows, distribution-free (stats/largest.py)
    none             if no tow has a window

Where current and wind carry the body faster than the tow there is no design value, vessel or line: see held_back.
"""
import json
import math
from types import SimpleNamespace

from bergtow import table, towing
from bergtow.result.members import FINISHED
from bergtow.result.run import SLOWER, Run, case_value, parse_case
from bergtow.stats import conditions as stat_conditions
from bergtow.stats import extreme as stat_extreme
from bergtow.stats import largest as stat_largest
from bergtow.stats import load as stat_load
from bergtow.stats import loads as stat_loads
from bergtow.stats import mean as stat_mean
from bergtow.stats import profile as stat_profile
from bergtow.study import assumed, gear, load_cases
from bergtow.study.runs import checked

import numpy as np

FORMAT = 1
LOWER = "largest_of_n", "at_least", "changed"  # kinds of loads that have no upper bound if they have no interval
HALF = 0.5               # share of a run that is its window, if the case does not set the start of the window: assumed
#: parts of a mean tow force: name, summary key; None: parts of the drag
PARTS = (("ice", "mean_ice_resistance_n"), ("water", None), ("wind", None),
         ("coriolis", "mean_coriolis_force_n"), ("slope", "mean_tilt_force_n"), ("inertia", "mean_inertia_force_n"))
BEND = 30.0                            # degrees, of the course change, assumed


# ---- before the first run


def plan(program, path, given, conditions, jobs, minutes, most):
    """What a design value requires, and what a budget allows. conditions: their number; minutes: for the fields, inf
    without a budget; most: fields per condition. Raises RunError.

    A fitted tail requires blocks, each stat_load.LEAST_GAPS times as long as the gap between clusters, two correlation
    times. Before any run the gap is taken as the time in which the body moves by its own length plus that of a floe,
    after which it touches different ice: assumed, and reported as such. A load is known only from a window of
    stat_load.LEAST_SCALES time scales, however many fields there are."""
    found = json.loads(checked(program, path, given, "--json"))
    values = case_numbers(program, path, given)
    speed, slower = values["speed"], values["slower"]
    window, least, enough = window_of(values)
    size = (found.get("ice") or {}).get("mean_size_m") or 0.0
    gap = max((values["length"] + size) / speed if speed > 0 else 0.0, stat_loads.TIME_SCALE / slower)
    hours = stat_extreme.LEAST_BLOCKS * stat_load.LEAST_GAPS * gap / 3600
    needs = max(stat_profile.LEAST_FIELDS, math.ceil(3600 * hours / window)) if window > 0 else most + 1
    core = found["cost"]["core_time_s"]
    gives = min(most, fields_in(60 * minutes, core, conditions, jobs))
    return {"needs_fields": needs, "needs_hours": hours, "needs_min": math.ceil(needs * conditions / jobs) * core / 60,
            "budget_fields": gives, "budget_hours": gives * window / 3600, "window_hours": window / 3600,
            "least_window_hours": least / 3600, "core_s": core, "gap_s": gap, "conditions": conditions,
            "most_fields": most, "gives": "no_window" if not enough else "return_level" if gives >= needs else
            "largest_of_n" if gives >= 1 else "nothing"}


def window_of(values, faster=1.0):
    """Of a tow that covers the distance of a case, case_numbers(), so many times as fast: the length of its window, s,
    that of the least window with a load, s, and whether it has one. Samples are counted as in stat_load.field_of,
    from the first one without a step before the window (Members.window)."""
    dt, every = values["dt"], values["sample_every"]
    duration, start = values["duration"] / faster, values["window_start"] / faster
    length = max(0.0, duration - start) if start >= 0 else HALF * duration
    first, last = (math.ceil(t / dt - 1e-6) for t in ((start, duration) if start >= 0 else (0.0, length)))  # steps
    there = last // every - math.ceil(max(0, first - 1) / every)
    least = stat_load.LEAST_SCALES * stat_load.samples_of(stat_loads.TIME_SCALE / values["slower"], every * dt)
    return length, least * every * dt, there >= least


def fields_in(seconds, member, conditions, jobs):
    """Number of fields of all conditions that fit into this many s, at `member` s each; inf without a limit."""
    if not np.isfinite(seconds):
        return np.inf
    return int(max(0.0, seconds) / max(member, 1e-9)) * jobs // conditions


def case_numbers(program, path, given):
    """Numbers of a case that can be found without a run."""
    case = parse_case(checked(program, path, given, "--scale", "1"))
    scale = case_value(case, "estimate.length_scale", 1.0)
    return {"case": case, "speed": case_value(case, "tow.speed", 0.0), "slower": math.sqrt(scale) if scale > 0 else 1.0,
            "window_start": case_value(case, "output.window_start", -1.0),
            "length": case_value(case, "body.length", 0.0), "duration": case_value(case, "run.duration"),
            "dt": case_value(case, "run.dt"), "sample_every": int(case_value(case, "output.sample_every", 1))}


# ---- from the ensemble


def options(**more):
    """Options of the statistics, as in bergtow statistics, without p-values."""
    return SimpleNamespace(**stat_conditions.DEFAULTS | {"hours": [], "resamples": 1} | more)


def too_slow(case, made):
    """Does the vessel of a case, {key: text}, not reach the ordered speed? The load is then that of a slower tow. made:
    speed made good, None if unknown."""
    return case.get("tow.mode") == "thrust" and case.get("tow.programme", "none") == "none" and made is not None and \
        made["value"] < (1 - SLOWER) * case_value(case, "tow.speed", 0.0)


def value_of(e, c, found, fields, slow=False):
    """The value of a condition: see the top of this file. found: statistics of the tow force, None without one; fields:
    from gather(); slow: see too_slow()."""
    if found is None:
        return {"kind": "none", "n": np.nan, "reason": "no_window" if len(c.finished) else "no_member"}
    rows = e.tows(c.members)
    reason = "no_solution" if e.without_bound(c.members) else "line_parted" if stat_loads.tows_with(
        e, rows, stat_loads.PARTED, stat_loads.ADRIFT) else "speed_not_reached" if slow else None
    if reason:
        return {"kind": "at_least", "n": found["largest"], "reason": reason, "n_tows": len(rows)}
    if found["constant"]:
        return {"kind": "constant", "n": found["mean"]["value"]}
    d = found["design"]
    if "value" in d:
        # rounded here, so that every sentence and table of it states the same load
        return {"kind": "return_level", "n": table.designed(d["value"], found["largest"]),
                "interval_95": list(d["interval_95"]), "model": d["model"],
                "irregular": d["irregular"], "times_the_hours": d["times_the_hours_simulated"]}
    largest = stat_largest.largest_of([f["peak"].max() for f in fields], [f["hours"] for f in fields])
    return {"kind": "largest_of_n", **largest, "reason": "below_zero" if d.get("below_zero") else
            "unbounded_tail" if d.get("unbounded") else "no_tail"}


def windy(case):
    """Is there wind in a case, {key: text}?"""
    return case.get("air.wind_table", "none") != "none" or any(case_value(case, f"air.wind_{k}", 0.0) for k in "xy")


def parts_of(e, rows, value, wind):
    """Mean forces along the tow that make up its value, {part: N}; the excess of the value over their sum is the
    fluctuation. wind: is there any? Its drag is the total drag minus that of the water."""
    def mean(key):
        x = e.summary.get(key, np.full(e.n, np.nan))[rows]
        return float(np.nanmean(x)) if np.isfinite(x).any() else 0.0
    drag = mean("mean_drag_force_n")
    water = mean(f"estimates_{load_cases.drag_estimate()}_force_n") if wind else drag
    out = {name: {"water": water, "wind": drag - water}[name] if key is None else mean(key) for name, key in PARTS}
    out["fluctuation"] = value - sum(out.values()) if np.isfinite(value) else np.nan
    return out


def condition(e, c, k, o):
    gathered = stat_loads.gather(e, c.finished, o)[0] if len(c.finished) else {}
    tow = gathered.get("tow_force")
    s = stat_conditions.condition(e, c, {m: stat_conditions.member(e, m) for m in c.finished}, o)
    found = s["loads"].get("tow_force")
    means = e.summary.get("mean_tow_force_n", np.full(e.n, np.nan))[c.finished]
    means = means[np.isfinite(means)]
    name, fields = f"steady.{k + 1}", tow[1] if tow else []
    case = case_of(e, {"id": name})
    value = value_of(e, c, found, fields, too_slow(case, s["design"]["speed"]))
    parts = parts_of(e, c.finished, value["n"], windy(case))
    start, hours = found and found["start_up"], sum((f["hours"] for f in fields), 0.0)
    return {
        "id": name, "label": c.label, "values": c.values, "fields": len(c.finished), "hours": hours, "value": value,
        "gap_s": found and found["gap_s"], "time_scale_s": found and found["time_scale_s"],
        "tow_hours": found and found["design"]["tow_hours"],
        "mean": {"id": f"{name}.mean", "n": float(means.mean()) if len(means) else np.nan,
                 "interval_95": stat_mean.t_interval(means)},
        "parts": [{"id": f"{name}.{part}", "part": part, "n": n, "share": n / value["n"] if value["n"] else np.nan}
                  for part, n in parts.items()],
        "start_up": start and start["largest"], "doubts": sorted({d for m in c.finished for d in e.doubts(m)}),
        "warnings": s["design"]["warnings"]}


def with_speed(row, e, c):
    """The row with its speed and concentration added, from a member."""
    found = e.each(c.members[e.status[c.members] == FINISHED], lambda run: {
        "speed_m_s": run.value("tow.speed"), "concentration": float(run.number("concentration"))})
    return row | next(found, {"speed_m_s": c.values.get("tow.speed", np.nan),
                              "concentration": c.values.get("ice.concentration", np.nan)})


def conditions(e, **more):
    """Rows of the steady tows of an ensemble."""
    o = options(**more)
    return [with_speed(condition(e, c, k, o), e, c) for k, c in enumerate(e.conditions())]


def hardest(rows, speed=None):
    """The row with the largest value, at the requested speed if given; None without a value."""
    some = [r for r in rows if np.isfinite(r["value"]["n"])
            and (speed is None or not np.isfinite(r["speed_m_s"]) or math.isclose(r["speed_m_s"], speed, rel_tol=1e-6))]
    return max(some, key=lambda r: r["value"]["n"], default=None)


def case_of(e, row):
    """{key: text} of a condition's case, as the program reads it; {} if none of its members has a folder."""
    rows = e.conditions()[int(row["id"].partition(".")[2]) - 1].members
    return next(e.each(rows[e.status[rows] == FINISHED], lambda run: run.case), {})


def tow_of(e, row, line, vessel):
    """The steady tow of a row, for load_cases; None if none of its members has a folder, or if it has no ice
    resistance."""
    c = e.conditions()[int(row["id"].partition(".")[2]) - 1]
    part = {p["part"]: p["n"] for p in row["parts"]}
    for m in c.finished:
        if not e.folder(m).is_dir():
            continue
        with Run(e.folder(m)) as run:
            direction, value = run.value("tow.direction", 0.0), row["value"]
            x, y = run.bodies[run.towed].vertices.T
            return load_cases.Tow(
                case=run.case, speed=row["speed_m_s"], direction=direction,
                mass=load_cases.mass_of(run, direction), water=part["water"], wind=part["wind"], ice=part["ice"],
                value=value["n"], kind=value["kind"], interval=value.get("interval_95"),
                width=run.number("estimates.width_m"), area=0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)),
                case_ramp=run.value("tow.ramp", 0.0),
                case_start=np.nan if row["start_up"] is None else row["start_up"], scale=row["time_scale_s"] or
                stat_loads.TIME_SCALE / e.scaling(m), slower=e.scaling(m), distance=run.value("run.duration")
                * row["speed_m_s"], line=line, vessel_mass=vessel.mass)
    return None


# ---- conclusions


def held_back(row):
    """Do current and wind carry the body faster than the tow, or as fast? A line cannot push, so nothing follows for
    vessel and line. A body at rest that nothing moves also has a mean of zero. The mean of the statistics, which is
    without the window's first time scale, may be below zero alone."""
    mean, speed = row["mean"]["n"], row["speed_m_s"]
    return stat_loads.held_back(mean) or row["value"].get("reason") == "below_zero" or mean == 0 and speed > 0


def own_start(row, ramp):
    """The start as the case orders it, from the steady tows: a load case as long as no run confirms the ramp that is
    to take its place."""
    n = row["fields"]
    such = {} if row["value"]["kind"] == "constant" else {"n_tows": n, "share_below": stat_largest.share_below(n)}
    return load_cases.row("own_start", row["start_up"], "largest_of_n" if such else "constant", "ensemble", runs=n,
                          values=such | {"ramp_s": ramp["case_s"]})


def bounds(row):
    """Ends of a load for a verdict. The largest of a few runs is only a lower bound, so no pull is known to hold it."""
    return row.get("interval_95") or ((row["n"], None) if row["kind"] in LOWER else None)


def speeds(rows, v, efficiency):
    """The pull needed in the hardest ice at each speed, compared with the vessel's."""
    out = []
    for speed in sorted({r["speed_m_s"] for r in rows if np.isfinite(r["speed_m_s"])}):
        r = hardest(rows, speed)
        if r is None:
            continue
        has = gear.pull_at(v, speed, efficiency)
        value = r["value"]
        out.append({"id": f"speed.{len(out) + 1}", "of": r["id"], "speed_m_s": speed, "needs_n": value["n"],
                    "kind": value["kind"], "interval_95": value.get("interval_95"), "has_n": has,
                    "feasible": "held_back" if held_back(r) else gear.verdict(value["n"], bounds(value), has)})
    return out


def feasible(some, asked, v, efficiency, t, cases=()):
    """Can the vessel hold the tow at the requested speed, and up to which speed? It must also hold the largest of these
    load cases, and every one that has an interval; where one of them requires more than the steady tow, or is less
    certain, up to which speed it can has not been examined. A smaller one without an interval is the largest of few
    runs, which the interval of the steady tow is taken to cover. The speeds are those at which the upper ends of the
    loads, where they have one, reach the pull."""
    here = next((s for s in some if math.isclose(s["speed_m_s"], asked, rel_tol=1e-6)), None)
    out = {"id": "feasible", "speed_m_s": asked, "verdict": here["feasible"] if here else "not_asked",
           "not_above_m_s": None, "by": None, "reason": None, "row": None}
    if not np.isfinite(v.pull):
        return out | {"verdict": "not_asked", "reason": "no_vessel"}
    if out["verdict"] == "held_back":
        return out
    if here and here["feasible"] != "no" and cases:
        def rank(c):
            return "no open yes".split().index(gear.verdict(c["n"], bounds(c), here["has_n"])), -c["n"]
        top = max(cases, key=lambda c: c["n"])
        worst = min((c for c in cases if c["interval_95"] or c is top), key=rank)
        if worst["id"] != "case.steady":
            return out | {"verdict": gear.verdict(worst["n"], bounds(worst), here["has_n"]), "row": worst["id"],
                          "reason": "other_load_case"}
    if any(s["kind"] == "at_least" for s in some):
        return out
    ends = [max([s["needs_n"], *(x for x in s["interval_95"] or () if x is not None and np.isfinite(x))]) for s in some]
    if len(some) > 1:
        limit = gear.limit_speed([s["speed_m_s"] for s in some], ends, [s["has_n"] for s in some])
        if limit is not None:
            return out | {"not_above_m_s": limit, "by": "speeds"}
    if not some or some[0]["has_n"] < some[0]["needs_n"]:
        return out | {"reason": "no_speed_is_feasible"}
    last = some[-1]
    limit = gear.limit_by_drag(v, efficiency, last["speed_m_s"], ends[-1],
                               (t.water + t.wind) * (last["speed_m_s"] / t.speed) ** 2) if t and t.speed > 0 else None
    return out | {"not_above_m_s": limit, "by": limit and "drag_alone"}


def sentence(a):
    """The content of the answer: codes, each with values and the rows that they come from."""
    out, d, v, line = [], a["design"], a["vessel"], a["line"]
    rows = {row["id"]: row for row in a["load_cases"] + a["conditions"]}
    if d is None and "case.steady" in rows:
        steady = rows[rows["case.steady"]["of"]]
        return [{"code": "held_back", "values": {"n": steady["mean"]["n"], "speed_m_s": steady["speed_m_s"]},
                 "rows": [steady["id"]]}]
    if d is None:
        return [{"code": "no_value", "values": {}, "rows": []}]
    case, steady = rows[d["row"]], rows[rows["case.steady"]["of"]]  # the time scale is that of the condition
    out.append({"code": {"at_least": "needs_at_least", "largest_of_n": "needs_largest"}.get(d["kind"], "needs"),
                "values": {k: d[k] for k in ("n", "interval_95", "kind", "reason")} | {"case": d["row"]},
                "rows": ["design", d["row"], steady["id"]]})
    if d["row"] != "case.steady" and steady["value"]["kind"] == "return_level":
        out.append({"code": "steady", "values": steady["value"] | {"case": "case.steady"}, "rows": [steady["id"]]})
    if steady["value"]["kind"] == "largest_of_n":
        out.append({"code": "covers", "values": steady["value"], "rows": [steady["id"]]})
    if case.get("of"):
        out.append({"code": "band", "values": a["band"], "rows": ["band"] + [r["id"] for r in a["assumed"]]})
    out.append({"code": "vessel", "values": {k: v[k] for k in (
        "needed_bollard_pull_n", "needed_interval_95", "speed_m_s", "efficiency", "given_n")}, "rows": ["vessel"]})
    out.append({"code": "line", "values": line, "rows": ["line", line["row"]]})
    if a["feasible"]["verdict"] != "not_asked":
        out.append({"code": "feasible", "values": a["feasible"], "rows": ["feasible"] + [s["id"] for s in a["speeds"]]})
    out += [{"code": "beside", "values": {"n": c["n"], "case": c["id"]} | c["values"], "rows": [c["id"]]}
            for c in a["load_cases"] if not c["in_design"] and np.isfinite(c["n"])]
    if a["ramp"]:
        keys = "s", "n", "by", "verified", "case_s", "case_n"
        out.append({"code": "start", "values": {k: a["ramp"][k] for k in keys}, "rows": ["ramp", "case.start"]})
    return out


def of(asked, plan, rows, cases, ramp, ranges, v, t, cost, **more):
    """The whole answer. asked: the request in the call; rows: conditions(); cases: load cases except the steady one; t:
    the load_cases.Tow of the hardest condition, None without a value."""
    worst = hardest(rows, asked["speed_m_s"])
    if worst:
        value = worst["value"]
        cases = [load_cases.row("steady", value["n"], value["kind"], "ensemble", runs=worst["fields"], of=worst["id"],
                                interval_95=value.get("interval_95"), reason=value.get("reason")), *cases]
    if ramp and ramp["by"] == "closed_form" and worst["start_up"] is not None:
        cases.append(own_start(worst, ramp))
    some = [c for c in cases if c["in_design"] and np.isfinite(c["n"]) and not held_back(worst)]
    of_tow = [c for c in some if c["acts_on"] == "tow"]
    top, hold = (max(these, key=lambda c: c["n"], default=None) for these in (of_tow, some))
    design = top and {"id": "design", "row": top["id"], **{k: top[k] for k in ("n", "kind", "interval_95", "reason")},
                      "value": worst["value"] if top["id"] == "case.steady" else None}
    found = [r for r in ranges if r["reason"] is None]
    band = {"id": "band", "low_n": None, "high_n": None, "combined_95": None, "why_not_combined": "no_range",
            "without": [r["key"] for r in ranges if r["reason"]]}
    if t is not None and found:
        low, high = assumed.band(t.value, found)
        both, why = assumed.combined(t.value, t.interval, ranges)
        band |= {"low_n": low, "high_n": high, "combined_95": both, "why_not_combined": why}
    efficiency, factor = asked["efficiency"], asked["line_factor"]
    n, interval = (top["n"], top["interval_95"]) if top else (np.nan, None)
    # in this order max() keeps NaN
    needed = [gear.needed_pull(v, max(x, 0.0), asked["speed_m_s"], efficiency) for x in (n, *(interval or ()))]
    by_speed = speeds(rows, v, efficiency)
    pull = gear.pull_at(v, asked["speed_m_s"], efficiency)
    vessel = {"id": "vessel", "name": v.name or None, "needed_bollard_pull_n": needed[0],
              "needed_interval_95": needed[1:] or None, "needed_t": towing.tonnes(needed[0]),
              "speed_m_s": asked["speed_m_s"], "free_speed_m_s": v.free_speed, "free_speed_from": v.free_from,
              "efficiency": efficiency, "given_n": v.pull, "has_n": pull,
              "holds": gear.verdict(n, top and bounds(top), pull), "own_resistance": None, "needed_with_ice_n": None}
    thickness = case_value(t.case, "ice.thickness", 0.0) if t else 0.0
    if np.isfinite(v.beam) and thickness > 0:  # of the vessel itself: an order of magnitude
        own = towing.ice_resistance(v.beam, thickness, worst["concentration"], asked["speed_m_s"])
        if own.high > 0 and np.isfinite(needed[0]):
            vessel |= {"own_resistance": {"low_n": own.low, "high_n": own.high, "source": own.source},
                       "needed_with_ice_n": [gear.needed_pull(v, n, asked["speed_m_s"], efficiency, x)
                                             for x in (own.low, own.high)]}
    l, load = asked["line_found"], hold["n"] if hold else np.nan
    line = {"id": "line", "name": l.name or None, "row": hold and hold["id"], "design_tension_n": load,
            "factor": factor, "needed_breaking_load_n": load * (factor or 1.0), "given_n": l.breaking,
            "utilisation": load * (factor or 1.0) / l.breaking,
            "holds": gear.verdict(load, hold and bounds(hold), l.breaking / (factor or 1.0))}
    out = {"format": FORMAT, "asked": {k: x for k, x in asked.items() if k != "line_found"}, "plan": plan,
           "conditions": rows, "load_cases": cases, "ramp": ramp, "design": design, "assumed": ranges, "band": band,
           "vessel": vessel, "line": line, "speeds": by_speed,
           "feasible": feasible(by_speed, asked["speed_m_s"], v, efficiency, t, of_tow), "cost": cost, **more}
    return out | {"sentence": sentence(out)}
