# SPDX-License-Identifier: MIT
"""The answer of `bergtow design` in words: the sentence, and its tables. answer: that of study/answer.py, as read back
from answer.json, where numbers that are not finite are None."""
import math

from bergtow.table import Table, designed, level, number, percent, short, written
from bergtow.text import loads as loads_text
from bergtow.towing.library import KNOT
from bergtow.towing.vessel import tonnes

HEADINGS = {"load_cases": "Load cases", "parts": "What the tow force is made of", "assumed": "What is assumed",
            "speeds": "Speeds", "plan": "What it took"}
CASES = {"case.steady": "steady tow", "case.start": "start", "case.own_start": "start as the case orders it",
         "case.course_change": "course change",
         "case.stop": "stop", "case.loss_of_thrust": "loss of thrust", "case.line_parted": "a line parts",
         "case.head_sea": "head current and wind"}
STARTS = "case.start", "case.own_start"
PARTS = {"ice": "ice", "water": "water drag", "wind": "wind", "coriolis": "Coriolis", "slope": "slope of the sea",
         "inertia": "inertia", "fluctuation": "above the mean"}
KINDS = {"return_level": "fitted tail", "largest_of_n": "largest simulated", "at_least": "at least",
         "closed_form": "closed form", "bound": "upper bound", "changed": "changed from the steady tow",
         "constant": "does not vary", "none": "–"}
#: words for the code of a reason
REASONS = {
    "no_tail": "too few peaks for a tail", "unbounded_tail": "nothing bounds the tail from above",
    "below_zero": "the tow holds the body back",
    "no_window": "no window that is long enough", "no_member": "no run",
    "speed_not_reached": "the vessel of the case did not reach the speed",
    "line_parted": "the line parted", "no_solution": "nothing bounds the load in some steps",
    "budget": "the budget is not enough for it", "run_failed": "the run failed",
    "domain_too_short": "the domain is too short",
    "tow_too_short": "the tow of the case is too short: lengthen run.duration",
    "case_has_path": "the case has its own path: it is in the steady tow",
    "case_has_programme": "the case has its own programme",
    "environment_from_table": "the case has current or wind from a table",
    "line_not_known": "stiffness and length of the line are not known: give --line and --line-length",
    "line_length_not_known": "the length of the line is not known: give --line-length",
    "line_stiffness_not_known": "the stiffness of the line is not known: name one of the library with --line",
    "single_line_tow_is_lost": "the tow is lost",
    "value_not_above_mean": "the value is not above the mean", "no_ramp_held": "no ramp that was tried holds",
    "left_out": "left out"
}
#: why there is no combined figure for fields and ranges
NOT_COMBINED = {"range_without_distribution": "some ranges have no distribution",
                "range_without_effect": "the effect of some ranges is not known",
                "no_interval_of_fields": "the value has no interval", "no_range": "no range was examined"}


def known(x):
    return x is not None and math.isfinite(x)


def kn(n):
    """N as kN, to three digits, without a unit."""
    return number(n / 1e3) if known(n) else "–"


def force(n):
    """A design load."""
    return f"{number(designed(n) / 1e3)} kN" if known(n) else "no value"


def ends(n, interval):
    """"620 to 700", the interval of a load n in kN, with the digits that it justifies, as in the report; "" without
    one."""
    if interval is None or interval[0] is None:
        return ""
    return level(n, [math.inf if x is None else x for x in interval], 1e3)[1]


def speed(v):
    return f"{short(v / KNOT)} kn"


def plain(x):
    """A given or assumed number, without the trailing zeros that would make it look measured."""
    return f"{float(short(x)):g}"


def minutes(s):
    return f"{short(s / 60, 2)} min"


# ---- the sentence


def _of(a):
    """The id of the condition of the value."""
    return next((c["of"] for c in a["load_cases"] if c.get("of")), None)


def _own(a, key):
    """A time of the condition that gives the value, or else of the first condition that has one. Times of a condition
    are at the scale of its case, those asked for at full scale. An earlier answer.json has no hours of conditions; its
    time scales, in whole samples, show whether the case is a model."""
    some = sorted(a["conditions"], key=lambda c: c["id"] != _of(a))
    scale = next((c["time_scale_s"] for c in some if known(c.get("time_scale_s"))), math.inf)
    faster = scale / a["asked"]["time_scale_s"]
    return next((c[key] for c in some if known(c.get(key))), a["asked"][key] * (faster if faster < 0.7 else 1))


def _over(a):
    """The time scale of a value, and its speed if other speeds were simulated, too: the design value is not theirs."""
    asked = a["asked"]["speed_m_s"]
    at = any(known(c["speed_m_s"]) and abs(c["speed_m_s"] - asked) > 1e-6 * asked for c in a["conditions"])
    return f"{f'at {speed(asked)} ' if at else ''}as a mean over {short(_own(a, 'time_scale_s'), 2)} s"


def _in_case(v, a):
    """The load case of a value, and its condition if there are several at that speed."""
    case = "" if v["case"] == "case.steady" else f" in the load case \"{CASES[v['case']]}\""
    here = [c for c in a["conditions"] if c["speed_m_s"] == a["asked"]["speed_m_s"] or c["id"] == _of(a)]
    return case + "".join(f" ({c['label']})" for c in here if c["id"] == _of(a) and len(here) > 1)


def _needs(v, a, tow="The tow"):
    interval = ends(v["n"], v["interval_95"])
    exceeded = f", which {percent(a['asked']['probability'])} of tows of {short(_own(a, 'tow_hours'), 2)} h exceed" \
        if v["kind"] == "return_level" else ""
    return (f"{tow} needs {force(v['n'])}{f' (95 % interval over fields: {interval} kN)' if interval else ''} "
            f"{_over(a)}{_in_case(v, a)}{exceeded}")


def _largest(v, a):
    few = next(c["values"] for c in a["load_cases"] if c["id"] == v["case"])
    of = (f", of {few['n_tows']} runs: a lower bound, below which at least {percent(few['share_below'])} of such runs "
          "stay with 95 % confidence") if "share_below" in few else ""
    where = "" if v["case"] in STARTS else " outside the start"
    return f"The largest load simulated{where} is {force(v['n'])} {_over(a)}{_in_case(v, a)}{of}"


def _covers(v, a):
    why = {"no_tail": "There are too few peaks for a tail",
           "unbounded_tail": "These fields do not determine the tail: its interval has no upper bound"}[v["reason"]]
    return (f"{why}: the largest of {v['n_tows']} steady tows of "
            f"{short(60 * v['hours_each'], 2)} min is {force(v['n'])}; with 95 % confidence at least "
            f"{percent(v['share_below'])} of such tows stay below it, whatever the distribution, and a tow of "
            f"{short(_own(a, 'tow_hours'), 2)} h bears more")


def _at_least(v, a):
    return f"The tow needs at least {force(v['n'])} {_over(a)}{_in_case(v, a)}, since {REASONS[v['reason']]}"


def _band(v, a):
    if v["low_n"] is None:
        return "The assumed values were not examined"
    out = f"Over the ranges of the assumed values the steady tow needs {kn(v['low_n'])} to {kn(v['high_n'])} kN"
    if v["without"]:
        out += f", without {' and '.join(v['without'])}, whose effect is not known"
    drag = next((r for r in a["assumed"] if r["key"] == "body.drag.water_form" and known(r["n_per_tenth"])), None)
    if drag:
        out += f"; each 10 % of the water's drag coefficient is worth {kn(drag['n_per_tenth'])} kN"
    if v["combined_95"]:
        out += f"; fields and ranges together: {ends(a['load_cases'][0]['n'], v['combined_95'])} kN (95 %)"
    return out


def _vessel(v, a):
    eta = f" at an efficiency of {short(v['efficiency'])}" if v["efficiency"] != 1 else ""
    if not known(v["needed_bollard_pull_n"]):
        return "No bollard pull can be named"
    of = v["needed_interval_95"] or (None, None)
    low, high = (math.ceil(tonnes(x)) if known(x) else None for x in of)
    interval = f" (95 % interval {low} to {'no bound' if high is None else f'{high} t'})" if low is not None else ""
    least = "more than" if (a["design"] or {}).get("kind") == "at_least" else "at least"
    pull = math.ceil(tonnes(v["needed_bollard_pull_n"]))
    return f"It takes a vessel of {least} {pull} t bollard pull{interval}{eta} at {speed(v['speed_m_s'])}"


def _line(v, a):
    factor = f" with the safety factor {short(v['factor'])}" if v["factor"] else " before any safety factor"
    out = f"a line of at least {force(v['needed_breaking_load_n'])} breaking load{factor}"
    if v["row"] and v["row"] != a["design"]["row"]:
        out += f", by the load case \"{CASES[v['row']]}\""
    if known(v["utilisation"]):
        out += f"; that is {percent(v['utilisation'])} of the breaking load of the line named"
    return out


def _feasible(v, a):
    at = speed(v["speed_m_s"])
    of = next((c for c in a["load_cases"] if c["id"] == v["row"]), a["design"])
    why = "its pull lies within the interval" if of["interval_95"] else "a load larger than the largest " \
        "simulated is possible"
    out = {"yes": f"The vessel named can tow at {at}", "no": f"The vessel named cannot tow at {at}",
           "open": f"Whether the vessel named can tow at {at} is open, since {why}"}[v["verdict"]]
    if known(v["not_above_m_s"]):
        by = ", if the drag alone grows with the speed (assumed)" if v["by"] == "drag_alone" else ""
        out += f", at most at {speed(v['not_above_m_s'])}{by}"
    if v["verdict"] == "yes" and known(a["band"]["high_n"]) and a["band"]["high_n"] > a["vessel"]["has_n"]:
        out += f"; at the upper end of the assumed ranges its pull of {kn(a['vessel']['has_n'])} kN is not enough"
    return out


def _start(v, a):
    if not known(v["s"]):
        return "No ramp makes the start harmless: the value is not above the mean"
    out = f"With a ramp of {minutes(v['s'])} the start takes {force(v['n'])}"
    out += {"runs": "" if v["verified"] else ", the least of those tried",
            "closed_form": ", by the closed form: no run has confirmed it"}[v["by"]]
    if known(v["case_n"]) and known(a["design"]["n"]) and v["case_n"] > a["design"]["n"]:
        out += f"; with that of the case, {minutes(v['case_s'])}, it takes {force(v['case_n'])}"
    return out


def _against_weather(v, a):
    return (f"Against a current of {plain(v['current_m_s'])} m/s and a wind of {plain(v['wind_m_s'])} m/s, which are "
            f"assumed, the same speed over ground would take {force(v['n'])}: that is not in the design value")


def _held_back(v, a):
    return (f"At {speed(v['speed_m_s'])} the body must be held back, since current and wind carry it faster than the "
            f"tow, whose mean force is {kn(v['n'])} kN: a line cannot push, so no vessel, bollard pull or line is "
            "named")


WORDS = {"beside": _against_weather, "covers": _covers, "needs": _needs, "needs_largest": _largest,
         "steady": lambda v, a: _needs(v, a, "The steady tow"),
         "needs_at_least": _at_least, "band": _band, "vessel": _vessel, "line": _line, "feasible": _feasible,
         "start": _start, "held_back": _held_back,
         "no_value": lambda v, a: "No tow force can be named: no tow has a window that is long enough"}


def sentence(answer):
    out = []
    for part in answer["sentence"]:
        text = WORDS[part["code"]](part["values"], answer)
        if part["code"] == "line":  # continues the sentence about the vessel
            out[-1] = f"{out[-1][:-1]} and {text}."
        else:
            out.append(f"{text}.")
    return " ".join(out)


# ---- tables


def _behind(row):
    v, said = row["values"], []
    for key, words in (("ramp_s", "ramp {1}"), ("slack_below_s", "line slack if stopped in less than {1}"),
                       ("coasts_m", "the body drifts on for at least {0} m"), ("coasts_s", "in at least {1}"),
                       ("relative_speed_m_s", "taken up at {0} m/s"), ("angle_deg", "{0} deg"),
                       ("radius_m", "radius {0} m"), ("current_m_s", "current {0} m/s"), ("wind_m_s", "wind {0} m/s"),
                       ("factor", "{0} times the pull")):
        if known(v.get(key)):
            said.append(words.format(plain(v[key]), minutes(v[key])))
    if row["reason"]:
        said.append(REASONS.get(row["reason"], row["reason"]))
    return ", ".join(said) or "–"


def load_cases(a):
    top = (a["design"] or {}).get("row")
    lower = any("share_below" in c["values"] for c in a["load_cases"])
    rows = [[CASES[c["id"]] + (" *" if c["id"] == top else "" if c["in_design"] else " †"), kn(c["n"]),
             ends(c["n"], c["interval_95"]) or "–", KINDS[c["kind"]] + (
                 f" of {c['values']['n_tows']} ‡" if "share_below" in c["values"] else ""),
             {"runs": f"{c['runs']} runs", "ensemble": f"{c['runs']} fields",
              "closed_form": "closed form"}[c["by"]], _behind(c)] for c in a["load_cases"]]
    marks = ["* design value"] * bool(top)
    marks += ["† with assumed values, not in it"] * any(not c["in_design"] for c in a["load_cases"])
    marks += ["‡ of so few runs it is a lower bound, not a design value"] * lower
    return [Table(["load case", "kN", "95 % interval", "kind", "by", "with"], rows),
            *[["; ".join(marks)]] * bool(marks)]


def parts(a):
    rows = []
    for c in a["conditions"]:
        value = c["value"]["n"]
        if not known(value):
            continue
        own = [[PARTS[p["part"]], kn(p["n"]), percent(p["share"]) if known(p["share"]) else "–"]
               for p in c["parts"] if known(p["n"]) and value and abs(p["n"]) >= 0.0005 * abs(value)]
        own.append([KINDS[c["value"]["kind"]], kn(value), "100 %"])
        rows += [[c["label"] if k == 0 else "", *cells] for k, cells in enumerate(own)]
    return [Table(["condition", "part", "kN", "share"], rows)]


def assumed(a):
    rows = [[r["key"], f"{r['at']} ({r['low']} to {r['high']})", kn(r["n_low"]), kn(r["n_high"]),
             kn(r["n_per_tenth"]), "closed form" if r["by"] == "analytic" else f"{r['fields']} common fields",
             r["distribution"] or REASONS.get(r["reason"], "none stated"), r["source"]] for r in a["assumed"]]
    note = NOT_COMBINED.get(a["band"]["why_not_combined"])
    head = ["assumed", "value (range)", "change at the low end, kN", "at the high end, kN", "for a tenth, kN", "by",
            "distribution", "source"]
    return [Table(head, rows), *[[f"No single figure for fields and ranges: {note}."]] * bool(note)]


def speeds(a):
    rows = [[speed(s["speed_m_s"]), kn(s["needs_n"]), ends(s["needs_n"], s["interval_95"]) or "–", KINDS[s["kind"]],
             kn(s["has_n"]), s["feasible"].replace("_", " ")] for s in a["speeds"]]
    return [Table(["speed", "needs, kN", "95 % interval", "kind", "vessel has, kN", "feasible"], rows)]


def plan(p):
    """Before the first run: the cost of a value, and what the budget allows."""
    fields = f" ({p['needs_fields']} fields of {short(60 * p['window_hours'], 2)} min)" if p["window_hours"] else ""
    gives = {"return_level": "enough for it", "largest_of_n": "which gives the largest of them, and no tail",
             "nothing": "not one", "no_window": "but none gives a value if its window is as short as that"
             }[p["gives"]]
    return (f"A design value needs about {short(p['needs_hours'], 2)} h of simulated tow after the start{fields}, "
            f"about {short(p['needs_min'], 2)} min of computing here. The budget allows {p['budget_fields']} fields, "
            f"{gives}. (Both are estimates: of the program's speed, and of how soon new ice is in contact.)")


def took(a):
    c = a["cost"]
    rows = [["total wall time, without replay and report", minutes(c["wall_s"])], ["fields", minutes(c["fields_s"])],
            ["statistics", minutes(c["statistics_s"])],
            ["load cases and ranges", f"{minutes(c['cases_s'])}, {c['case_runs']} runs"]]
    return [Table(["what", "took"], rows)]


def tables(answer):
    """[(heading, parts)] of everything except the cost."""
    return [(HEADINGS[name], make(answer)) for name, key, make in (
        ("load_cases", "load_cases", load_cases), ("parts", "conditions", parts), ("assumed", "assumed", assumed),
        ("speeds", "speeds", speeds)) if answer[key]]


def text(answer):
    """The sentence and all tables."""
    return written([[sentence(answer)], *(part for heading, some in (*tables(answer), (HEADINGS["plan"], took(answer)))
                                          for part in ([heading], *some))])


def remarks(answer):
    out = [f"{CASES[c['id']]}: {REASONS.get(c['reason'], c['reason'])}" for c in answer["load_cases"]
           if c["kind"] == "none"]
    v = answer["vessel"]
    if v["free_speed_from"] == "assumed":
        out.append(f"the free-running speed of the vessel is assumed, {speed(v['free_speed_m_s'])}")
    if own := v["own_resistance"]:
        more = " to ".join(f"{math.ceil(tonnes(n))} t" for n in v["needed_with_ice_n"] if known(n))
        out.append("the bollard pull leaves out the resistance of the vessel itself in this ice, "
                   f"{kn(own['low_n'])} to {kn(own['high_n'])} kN, an order of magnitude ({own['source']})"
                   + (f"; with it {more}" if more else ""))
    if answer["line"]["factor"] is None:
        out.append("the line has no safety factor: name one with --line-factor")
    return out


def warnings(answer):
    """The warnings of the statistics, as in bergtow statistics."""
    return loads_text.warnings({"conditions": [
        {"label": c["label"], "design": {"tow": {"value": c["value"]["n"] or 0.0}, "warnings": c["warnings"]}}
        for c in answer["conditions"]]})
