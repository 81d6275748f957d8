# SPDX-License-Identifier: MIT
"""The results of bergtow route, as tables and sentences. found: as in route.json."""
import math

from bergtow.stats.mean import LEVEL
from bergtow.table import change, number, quantity, span, table

UNITS = {"work": "J", "time": "s", "peak": "N", "length": "m"}
WORDS = {"work": "work of the tow", "time": "time to the goal", "peak": "peak force", "length": "length of the way"}
FAULTS = {"missed": "misses the goal", "no_go_contact": "touches a no-go area",
          "limit_exceeded": "exceeds the force limit", "parted": "parts its line", "slack": "has a slack line",
          "no_load": "has a load without bound in some steps"}
CHANCE = (1 - LEVEL) / 2
PLANNED = {"no_go": "crosses a no-go area", "force_limit": "exceeds the force limit by prediction",
           "turns": "begins with a turn that is too sharp"}


def amount(x, unit):
    if unit == "s" and x is not None:
        return f"{number(x)} s" if x < 7200 else f"{number(x / 3600)} h"
    return quantity(x, unit)


def plan(found):
    head = ["route", "length", "time", "ice in the swath", "mean force", "work", "remarks"]
    rows = []
    for r in found["routes"]:
        p = r["predicted"]
        rows.append([r["label"], amount(p["length"], "m"), amount(p["time"], "s"), f"{number(p['ice_area'])} m2",
                     amount(p["mean_force"], "N"), amount(p["work"], "J"),
                     "; ".join([PLANNED[f] for f in r["faults"]] + off_map(r)) or "–"])
    return "\n\n".join([table(head, rows, False), *unreached(found)])


def off_map(r):
    """[remark] of a route that leaves the map. A route.json of an earlier version does not say."""
    beyond = r.get("predicted", {}).get("off_map")
    return [f"{amount(beyond, 'm')} of it off the map"] if beyond else []


def unreached(found):
    """[sentence] of the routes that some speeds do not bring to the goal; once if that is so of all routes at a speed
    for the same reason."""
    left, same = found["unreached"], {}
    for r in left:
        same.setdefault(r["speed"], set()).add(r["reason"])
    whole = {r["speed"] for r in left if r["kind"] == "straight" and r["speed"] and len(same[r["speed"]]) == 1
             and not any(x["speed"] == r["speed"] for x in found["routes"])}
    return [f"Left out: {number(v)} m/s: {min(same[v])}." for v in sorted(whole)] + [
        f"Left out: {r['label']}: {r['reason']}." for r in left if r["speed"] not in whole]


def no_go(some):
    return f"{some['file']}: {some['polygons']} no-go areas, {some['in_domain']} of them in the domain"


def warnings(found):
    return [f"warning: {w['text']}" for w in found["warnings"]]


def verified(found):
    verdict, unit, limited = found["verdict"], UNITS[found["objective"]], found["force_limit"] is not None
    head = ["route", WORDS[found["objective"]], "against the straight line (95 %)", "mean force", "peak",
            *["largest force"] * limited, "time", "remarks"]
    rows = []
    by_name = {r["name"]: r for r in found["routes"]}
    for name in verdict["order"]:
        r, c = by_name[name], verdict["compared"].get(name)
        s = r["simulated"]
        against = "–"
        if name == verdict["straight"]:
            against = "is it"
        elif c and c["relative"] is not None:
            low, high = c["relative_95"]
            against = change(c["relative"]) + ("" if low is None else f" ({change(low)} to {change(high)})")
        said = [f"{FAULTS[f]} in {n} of {verdict['members']}" for f, n in r["counts"].items() if n] + off_map(r)
        rows.append([r["label"], amount(s[found["objective"]], unit), against, amount(s["mean_force"], "N"),
                     amount(s["peak"], "N"), *[amount(largest(r), "N")] * limited, amount(s["time"], "s"),
                     "; ".join(said) or "–"])
    return table(head, rows, False)


def largest(r):
    """Largest force of any step in any member, N, which the limit is for; None without one."""
    return max((t["largest"] for t in r["members"] if t["largest"] is not None), default=None)


def answer(found):
    """The verdict, and what it does not know."""
    chosen = (found.get("verdict") or {}).get("recommended")
    of = [f"{r['label']} {amount(r['predicted']['off_map'], 'm')} of {amount(r['predicted']['length'], 'm')}"
          for r in found["routes"] if off_map(r) and chosen in (None, r["name"])]
    return decision(found) + (" Off the map, where nothing is known of the ice and open water is assumed: "
                              f"{', '.join(of)}." if of else "")


def decision(found):
    v, by_name = found.get("verdict"), {r["name"]: r for r in found["routes"]}
    if v is None:
        return "Planned, not towed: no number here is of a simulation."
    code, objective = v["code"], WORDS[found["objective"]]
    chosen = by_name.get(v["chosen"], {}).get("label")
    c = v["compared"].get(v["chosen"])
    if code == "better":
        low, high = c["relative_95"]
        if c["fails_less"] == len(v["judged"]):
            few = "" if c["chance_of_fails"] <= CHANCE else "; with so few members this may be chance"
            return (f"Take {chosen}: the straight line fails in all {len(v['judged'])} evaluation members, and "
                    f"{chosen} in none{few}.")
        if c["fails_less"]:
            return (f"Take {chosen}: the straight line fails in {c['fails_less']} of {len(v['judged'])} members in "
                    f"which {chosen} does not.")
        return (f"Take {chosen}: {objective} {change(c['relative'])} against the straight line, "
                f"{change(low)} to {change(high)} at 95 %.")
    if code == "straight_not_passable":
        return (f"The straight line cannot be towed; {chosen} " +
                ("reaches the goal without a fault in every evaluation member." if v["recommended"] else
                 "fails in some members, too, and is not recommended."))
    if code == "no_route":
        return "No route other than the straight line was found."
    if code == "one_member":
        much = f"{chosen} has {change(c['relative'])} of {objective}" if c and c["relative"] is not None else \
            f"{chosen} cannot be compared with it"
        return (f"No route shown better than the straight line: there is one member, and no interval ({much} in it). "
                "If the map is perfect, that is the answer; give --members and errors of the map for an interval.")
    return f"No route shown better than the straight line: {objective} of {chosen} {interval(c)}."


def interval(c):
    if c is None or c["relative"] is None:
        return "cannot be compared, since one of the two fails"
    low, high = c["relative_95"]
    if low is None or math.isnan(low):
        return f"is {change(c['relative'])}; one pair has no interval"
    return f"is {change(c['relative'])}, {change(low)} to {change(high)} at 95 %"


def meaning(found):
    v, e = found["verdict"], found["map_errors"]
    if v["members"] < 2:
        members = "One member: the map as it is, without errors. "
    else:
        members = (f"{v['members']} members of the map, with errors (standard deviations) of {number(e['position'])} m "
                   f"in position, {number(100 * e['thickness'])} % in thickness and {number(e['drift'])} m/s in drift"
                   f"{' (assumed)' if e['assumed'] else ''}, the same for every route. "
                   f"Members {span(v['chose'], str)} chose, members {span(v['judged'], str)} judged: the intervals are "
                   "theirs. ")
    best = v.get("planner_best")
    lost = "" if not best else "By prediction the straight line is the best. " if best["straight"] else \
        f"The best route by prediction lost to the straight line in {best['lost']} of {best['members']}. "
    c = found.get("calibration")
    fit = "" if not c else calibration(c) + " "
    peak = "The peak is the 99th percentile of the force after the ramp, the mean of the members. "
    if found["force_limit"] is not None:
        peak += ("The force limit holds in every step, the ramp included; the largest force is that of any step in any "
                 "member. ")
    return members + peak + lost + fit + "Every number is of the model: floes are rigid plates in a plane."


def calibration(c):
    poor = "; the cost ranks this ice poorly, and the tows alone decide" if c["poor"] else ""
    return (f"Cost fitted to {c['swaths']} straight swaths: R² {number(c['r2'])}, rank correlation "
            f"{number(c['rank_correlation'])}{poor}.")


def text(found):
    parts = ["\n".join(warnings(found))] * bool(found["warnings"]) + [plan(found)]
    if found.get("verdict"):
        parts += [verified(found), meaning(found)]
    if found.get("rounds"):
        parts.append(rounds(found))
    return "\n\n".join([*parts, answer(found)])


def rounds(found):
    h = found["horizon"]
    head = ["mapped at", "age of the map", "way to go", "predicted work", "plan"]
    rows = [[amount(r["time"], "s"), amount(h["age"] if r["time"] else 0.0, "s"),
             amount(r["length"], "m"), amount(r["work"], "J"),
             "new" if r["length"] is not None else "as before, since none is allowed"] for r in found["rounds"]]
    names = {"horizon": "with new maps", "once": "planned once", "straight": "straight line"}
    told = "; ".join(", ".join([f"{names[k]}: {amount(t[found['objective']], UNITS[found['objective']])}",
                                *(FAULTS[f] for f in t["faults"])]) for k, t in h["tows"].items())
    bound = ("The new maps have no errors, so the gain is an upper bound. " if h["perfect"] else "")
    return f"{table(head, rows, False)}\n\nOne tow through the ice of the case, {WORDS[found['objective']]}: " \
           f"{told}. {bound}One tow is one sample, and has no interval."
