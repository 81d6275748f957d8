# SPDX-License-Identifier: MIT
"""What a report needs besides its numbers to answer the questions of a marine warranty surveyor: operational limits, a
hand calculation, the validation evidence, sources, symbols, standards. Blocks are those of reporting/ensemble.py."""
import numpy as np

from bergtow.result.run import within
from bergtow.stats.design_value import STILL, in_words, moves, named
from bergtow.table import number, quantity
from bergtow.text import loads as loads_text

#: comparisons with observations: case, observation, verdict; cases/validation/README.md gives them in full
EVIDENCE = (
    ("arching of blocks at a gap", "no arch below block/gap 0.10, as observed; at 0.10 some, contrary to the "
     "observations; above, a critical concentration that falls as a power, as observed; two sizes: not shown"),
    ("cover on a barrier", "the form and 1/friction hold; the length scale grows more slowly than the width in "
     "channels of 5 to 15 floes"),
    ("ship model in floes", "none: a prediction"))
NO_FORCE = ("No measured mean force of a tow with complete conditions is public. No force of this report has been "
            "compared with a measured one; the cases compare where and how ice jams with reports from laboratories.")
SYMBOLS = (("A", "concentration: area of ice / area of water"), ("C", "drag coefficient"),
           ("d", "draft of the body, m"),
           ("h", "thickness of the ice, m"),
           ("V, V_a", "speed of the body through water and ice, and its part along the tow, m/s"),
           ("W", "width of the body across the tow, m"),
           ("κ", "2 × work of rafting / potential energy that the ice gains"),
           ("p, T", "probability that the design value is exceeded, in a tow of T hours"),
           ("s", "height of the body above the water, m"),
           ("U, U_a", "wind relative to the body, and its part from ahead, m/s"),
           ("ρ", "density, kg/m³; of ice with i, of water with w, of air with a"),
           ("kN, t", "1 t of force is 9.80665 kN"))
STANDARDS = ("No rule of a standard or of a class society is applied, and none was available: not ISO 19906, not ISO "
             "35106, not DNV-ST-N001. Every number is a load without a safety factor, unless the answer names one; "
             "the user named that factor and any efficiencies of the vessel. Whoever approves the tow chooses the "
             "standard, factors and weather window.")
#: keys that limit an operation, with their names
LIMITING = (("concentration of the ice", ("ice.concentration", )), ("thickness of the ice", ("ice.thickness", )),
            ("size of the floes", ("ice.size", )), ("speed of the tow", ("tow.speed", )),
            ("wind", STILL["no wind"]), ("current", STILL["no current"]),
            ("draft of the berg", ("body.draft", )))


def lines(*some, faint=False):
    return {"kind": "text", "lines": list(some), "warnings": [], "faint": faint}


def table(head, rows):
    return {"kind": "table", "head": head, "rows": rows}


def load(c):
    """The load of a condition that is compared with a limit: the upper end of its interval, its design value, or the
    largest simulated value; None if there is none."""
    d = c["design"]["tow"]
    if d is None:
        return None
    high = d.get("interval_95", (np.nan, np.nan))[1]
    return next((x for x in (high, d.get("value"), d["largest"]) if x is not None and np.isfinite(x)), None)


def pull_of(cases, answer):
    """(N, description) of the pull that limits are compared with: the vessel's least pull at the requested speeds, from
    the answer, or else the bollard pull of the case, part of which is lost at speed; NaN if no vessel is named."""
    at_speed = [x["has_n"] for x in (answer or {}).get("speeds", []) if x.get("has_n")]
    if at_speed:
        return float(min(at_speed)), "pull of the vessel at the requested speed"
    return (max((case.bollard_pull for _, case in cases), default=np.nan),
            "the bollard pull; at speed less of it is left")


def held(s, pull, what):
    """In words, which of the conditions a vessel can hold with its pull."""
    than = f"{quantity(pull, 'N')}, {what}"
    places = {f"within {than}": [], f"the largest simulated, a lower bound, within {than}": [], f"above {than}": [],
              "held back, not towed": []}
    for c in s["conditions"]:
        if (n := load(c)) is not None:
            tow = c["design"]["tow"]
            list(places.values())[3 if tow["mean"] <= 0 else 2 if n > pull else "value" not in tow].append(c["label"])
    return "; ".join(f"{where}: {loads_text.several(names)}" for where, names in places.items() if names)


def at_speeds(answer):
    """In words, at which speed the vessel of an answer holds the tow; "" if none was looked at."""
    if most := (answer.get("feasible") or {}).get("not_above_m_s"):
        return f"not above {number(most)} m/s with the vessel named"
    some = ", ".join(f"{number(s['speed_m_s'])} m/s: {s['feasible'].replace('_', ' ')}" for s in answer["speeds"])
    return f"can the vessel named hold the steady tow? {some}" if some else ""


def simulated(cases, varied):
    """{limit: what was simulated, in words}, from the cases that also say where a design value holds. varied: {key:
    range} of what a study varies."""
    still = {keys: words for words, keys in STILL.items()}
    def said(case, keys):
        there = [(k, varied.get(k) or in_words(case, k)) for k in keys if k in case.texts]
        if keys in still:
            return " and ".join(named(k, text) for k, text in there if k in varied or moves(case, k)) or still[keys]
        return " and ".join(text for _, text in there)
    return {name: "; ".join(loads_text.qualified(loads_text.shared([(c, said(case, keys)) for c, case in cases])))
            for name, keys in LIMITING}


def operation(s, cases, met, answer):
    """Blocks of the operational limits. met: of simulated()."""
    (pull, what), rows = pull_of(cases, answer), []
    head_sea = next((c for c in (answer or {}).get("load_cases", []) if c["id"] == "case.head_sea"), None)
    for name, keys in LIMITING:
        looked_at = keys[0] == "ice.concentration" or any(
            len({c["values"].get(k) for c in s["conditions"]}) > 1 for k in keys)
        limit = "no vessel to hold it against" if looked_at and not np.isfinite(pull) else "not looked for"
        if keys[0] == "tow.speed" and answer and np.isfinite(pull):
            limit = at_speeds(answer) or limit
        elif looked_at and np.isfinite(pull):
            limit = held(s, pull, what) or limit
        elif keys[0] == "air.wind_x" and head_sea and head_sea["n"]:
            air, water = (number(head_sea["values"][k]) for k in ("wind_m_s", "current_m_s"))
            limit = (f"at {air} m/s with {water} m/s of current from ahead the tow needs "
                     f"{quantity(head_sea['n'], 'N')}")
        rows.append([name, met.get(name) or "–", limit])
    rule = ("Nothing is known outside the simulated conditions. Where ice is denser, thicker or of larger floes, wind "
            "or current stronger, or the tow faster than in this table, the tow stops, or the load is computed anew.")
    if not np.isfinite(pull):
        rule += " No vessel is named, so no limit follows from one: its net pull at the speed of the tow has to " \
            "exceed the load of the condition."
    return [lines(rule), table(["limit", "simulated", "what was found"], rows)]


def _row(what, by_hand, n, simulated):
    return [what, by_hand, quantity(n, "N"), quantity(simulated, "N"),
            number(simulated / n, 2) if n and np.isfinite(simulated) else "–"]


def wind_met(run):
    """(speed, part from ahead) of the mean wind that the body meets in the window, m/s; 0 in still air. Ahead is the
    mean course of the body there: on a tow with way-points no leg stands for the window."""
    wind, body = (window_mean(run, *(f"{name}{k}" for k in "xy")) for name in ("wind_", "body_v"))
    if not wind.any():
        return 0.0, 0.0
    relative, speed = body - wind, float(np.hypot(*body))
    return float(np.hypot(*relative)), float(body @ relative) / speed if speed else np.nan


def window_mean(run, *names):
    there = within(run["time"], *run.window)
    return np.array([run[name][there].mean() for name in names])


def by_hand(run):
    """Rows of a hand calculation with the numbers of one run: drag of water and wind, momentum of the ice that the
    body meets, and their sums."""
    e = run.summary.get("estimates") or {}
    width, speed = (e.get(k) if e.get(k) is not None else np.nan for k in ("width_m", "water_speed_m_s"))
    draft, form, water = (run.value(k) for k in ("body.draft", "body.drag.water_form", "water.density"))
    thick, concentration, ice = e.get("thickness_m", np.nan), e.get("concentration", np.nan), run.value("ice.density")
    if not np.isfinite([width, speed, draft, form, water]).all():
        return []
    along, (wind, ahead) = float(window_mean(run, "speed_through_water")[0]), wind_met(run)
    drag, simulated = 0.5 * water * form * width * draft * speed * along, run.number("mean_drag_force_n")
    out = [_row("drag of the water", f"½ ρw C W d V V_a = ½ × {number(water, 4)} kg/m³ × {number(form)} × "
                f"{number(width)} m × {number(draft)} m × {number(speed)} m/s × {number(along)} m/s", drag,
                np.nan if wind else simulated)]
    if wind:
        air, form, sail = (run.value(k) for k in ("air.density", "body.drag.air_form", "body.sail"))
        blown = 0.5 * air * form * width * sail * wind * ahead
        out += [_row("drag of the wind", f"½ ρa C W s U U_a = ½ × {number(air)} kg/m³ × {number(form)} × "
                     f"{number(width)} m × {number(sail)} m × {number(wind)} m/s × {number(ahead)} m/s", blown, np.nan),
                _row("drag of water and wind", "sum", drag + blown, simulated)]
        drag += blown
    if np.isfinite([thick, concentration, ice]).all():
        push = ice * thick * concentration * width * speed ** 2
        out += [_row("ice brought to the speed of the body", f"ρi h A W V² = {number(ice, 4)} kg/m³ × "
                     f"{number(thick)} m × {number(concentration)} × {number(width)} m × ({number(speed)} m/s)²", push,
                     run.number("mean_ice_resistance_n")),
                _row("drag and ice", "sum", drag + push, run.number("mean_tow_force_n"))]
    return out


def check(run, estimates, label=""):
    """Blocks of the independent check. run: first field of the governing condition, or None; estimates: rows of
    reporting/run.py; label: of the condition."""
    if run is None:
        return [lines("No member can be read.")]
    out = [lines(f"By hand, with the numbers of the first field ({label}). All ice in the way of the body is "
                 "accelerated to its speed once: ice pushed aside needs less force; ice that passes the push on, rubs "
                 "or rafts needs more.")]
    rows = by_hand(run)
    out += [table(["what", "by hand", "force", "mean of the simulation", "simulated / by hand"], rows)] if rows else \
        [lines("Nothing is towed at a known speed.")]
    if estimates:
        out += [{"kind": "heading", "text": "Published estimates"},
                table(["estimate", "formula", "force", "simulated / estimate", "meant for these conditions"],
                      [[r["label"], r["formula"], r["force"], r["ratio"],
                        f"{'yes' if r['valid'] else 'no'}: {r['note']}"] for r in estimates])]
    return out


def evidence():
    return [lines(NO_FORCE), table(["case", "verdict"], [list(row) for row in EVIDENCE]),
            lines("Set-up, sources and numbers: cases/validation/README.md of the program.", faint=True)]


def sources(values, estimates):
    """Blocks of references, symbols and standards. values: those of the case with their origin."""
    found = {}
    for v in values:
        if v.kind == "source":
            found.setdefault(v.origin.removeprefix("default: "), []).append(v.key)
    for row in estimates:
        found.setdefault(row["source"], []).append(f"estimate: {row['label']}")
    def some(keys):
        return ", ".join(keys[:4]) + (f" and {len(keys) - 4} more" if len(keys) > 4 else "")
    return [{"kind": "heading", "text": "References"},
            lines("As the case and the program name them.", faint=True),
            {"kind": "pairs", "label": "references", "rows": [
                ("Yulmetov & Løset 2017, Cold Reg. Sci. Technol. 138", "method"),
                *((source, some(keys)) for source, keys in sorted(found.items()))]},
            {"kind": "heading", "text": "Symbols"}, {"kind": "pairs", "label": "symbols", "rows": SYMBOLS},
            {"kind": "heading", "text": "Standards"}, lines(STANDARDS)]
