# SPDX-License-Identifier: MIT
"""How the numbers of a report were computed, and their limits: method, model and limits in words. The simulated cases
determine each sentence."""
import numpy as np

from bergtow.result import compared
from bergtow.result.origins import short as in_short
from bergtow.result.origins import source_of_ice
from bergtow.result.run import case_value
from bergtow.stats import alike as stat_alike
from bergtow.stats import extreme as stat_extreme
from bergtow.stats import profile as stat_profile
from bergtow.table import counted, number, quantity, span
from bergtow.text import budget as budget_text
from bergtow.text import capability as capability_text
from bergtow.text import converge as converge_text
from bergtow.text import loads as loads_text

KEYS = "ice.splitting.toughness", "ice.rafting.kappa", "ice.crushing.pressure"


def _fields(s, cases):
    """The ice fields of the tows, in words; "" if some read theirs from a file."""
    if any(source_of_ice(case.texts) for _, case in cases):
        return ""
    seeds = {m["seed"] for m in s["members"]}
    return ", each through its own ice field" if len(seeds) == len(s["members"]) else \
        f", whose ice is made from {len(seeds)} seeds, the same in all conditions"


def _amount(s, cases):
    tows = [c["design"]["tow"] for c in s["conditions"] if c["design"]["tow"]]
    n = sum(c["members"]["used"] for c in s["conditions"])
    said = f"{n} tows in {counted(len(s['conditions']), 'condition')}{_fields(s, cases)}"
    if tows:
        fields, hours = span([d["fields"] for d in tows]), span([d["hours"] for d in tows], number)
        said += f"; {fields} fields and {hours} hours of tow a condition, the start-up left out"
    return said + "."


def method(s, cases):
    """Paragraphs. cases: those of design_value.cases()."""
    out = [
        "Every floe is a rigid polygon that moves in the plane of the sea surface. Floes, the towed body and walls "
        "push each other by non-negative impulses with Coulomb friction, solved together in every time step (planar "
        "non-smooth discrete element method, after Yulmetov & Løset 2017, Cold Reg. Sci. Technol. 138). Drag of water "
        "and air, added mass and the Coriolis force act on floes and body. The force of the ice on the body is the "
        "sum of these impulses over the time step. The tow force is the force along the tow: ice resistance, drag of "
        "water and air, Coriolis force, slope of the sea and inertia. Forces across the tow are not included.",
        _amount(s, cases)]
    tows = [c["design"]["tow"] for c in s["conditions"] if c["design"]["tow"]]
    if not tows:
        return out
    out.append(
        f"{loads_text.asked(s)}. This is the level of the return time −T / ln(1 − p), "
        f"{span([d['return_hours'] for d in tows])} h: the level that is exceeded once in that time on average, if "
        "all of it is towed in that condition. The load is first averaged by a moving mean over "
        f"{span([d['time_scale_s'] for d in tows])} s, so that pushes and collisions count by their impulse. "
        "Excursions above a threshold are gathered into clusters, to whose maxima a generalised Pareto distribution "
        "is fitted (block maxima and a generalised extreme value distribution where there are too few clusters). The "
        "95 % intervals come from the profile "
        f"likelihood, widened by the scatter between fields from {stat_profile.LEAST_FIELDS} fields on; each condition "
        "is fitted by itself, so their ends need not rise with the concentration. They hold for fields that are alike: "
        f"a test at {100 * stat_alike.LEVEL:g} % of the maxima of blocks, by their ranks, warns of conditions whose "
        "fields differ by more than chance. At least "
        f"{stat_extreme.LEAST_EXCESSES} clusters or {stat_extreme.LEAST_BLOCKS} blocks are required; otherwise there "
        "is no value.")
    if any(c["design"]["tension"] for c in s["conditions"]):
        out.append("Line tensions are treated in the same way, branch by branch; the largest of the branches is "
                   "stated.")
    return out


def _span_of(cases, key):
    """"10", or "5 to 17": the range of positive values of a key in these cases."""
    values = {case_value(case.texts, key, 0.0): case.texts.get(key, "") for _, case in cases}
    return span([v for v in values if v > 0] or [0.0], lambda v: values.get(v, "0"))


def _ice(case, toughness, kappa, pressure):
    """How floes behave. toughness, kappa, pressure: spans over all cases, so that one sentence covers them."""
    splits, rafts, crushes = (case_value(case.texts, key, 0.0) > 0 for key in KEYS)
    here = ", and here they are dense enough to jam." if case.jams else "."
    if case.rigid and not splits:
        return f"Floes are rigid: they neither break, bend, crush nor raft, so nothing limits the force of a jam{here}"
    ways = [*[f"they split along straight lines at a toughness of {toughness}"] * splits,
            *["they slide over each other (raft) above a load that grows with the square of their thickness, κ = "
              f"{kappa}"] * rafts, *[f"their edges crush at {pressure}"] * crushes]
    *never, last = *["break"] * (not splits), "bend", *["crush"] * (not crushes), *["raft"] * (not rafts)
    said = (f"Floes are rigid except that {', and '.join(ways)}. They do not {', '.join(never)}"
            f"{' or ' * bool(never)}{last}.")
    return said if not case.rigid else \
        f"{said} Nothing limits the force of a jam of pieces that are too small to split{here}"


def _pack(case):
    return "" if case.texts.get("domain.ends") != "open" or case.texts.get("domain.sides") == "wall" else \
        "The ice is not confined along the tow: the force does not include pressure in the pack by wind, current or " \
        "a shore."


def _end(case):
    return {
        "speed": "The tow holds its speed whatever force this takes: no line or vessel slows down, so "
                 "the tow force does not include the dynamics of the line.",
        "line": "The towing end of the line moves as prescribed: the vessel neither slows down nor stops.",
        "thrust": "The vessel is a point with thrust and resistance curves; it does not manoeuvre by itself.",
    }.get(case.mode, "Nothing is towed.")


def _line(case):
    return "" if case.mode == "speed" or np.isfinite(case.breaking_load) else \
        "No line parts: the case sets no breaking load."


def _vessel(case):
    return "" if np.isfinite(case.bollard_pull) else "No vessel is judged: the case names no bollard pull."


def limits(cases, vessel=False):
    """Sentences on the limits of the model, most serious first; a limit that does not apply to all cases names its
    conditions. cases: from design_value.cases(); vessel: is a vessel assessed?"""
    out = ["No force of this model has been compared with a measured tow: behaviour seen in basins was reproduced, "
           "forces were not validated."]
    if not cases:
        return out
    def of_each(say):
        for text, where in loads_text.shared([(c, say(case)) for c, case in cases]):
            yield f"For {where}: {text[0].lower()}{text[1:]}" if where else text
    values = [_span_of(cases, key) for key in KEYS]
    out += of_each(lambda case: _ice(case, *values))
    out.append("The motion is planar: the body neither heaves, rolls nor pitches, ice does not pass below it, and "
               "there are no waves.")
    for say in (_pack, _end, _line, *[_vessel] * (not vessel)):
        out += of_each(say)
    out.append("Loads of collisions come from impulses by the conversion that the case names; mean forces and the "
               "design tow force do not depend on it.")
    out.append("The intervals cover the scatter of fields that are alike and the error of the fit. Where fields differ "
               "in level, fields worse than any simulated determine the return levels and the design value, which lie "
               "above the interval more often than it says. The intervals cover neither the assumed values nor the "
               "choice of the model, and there is no safety factor in any number.")
    return out


def _breaking(case):
    if np.isfinite(case.breaking_load):
        return case.breaking_words
    return "none in the case: the tension above has no safety factor" if case.mode != "speed" else \
        "no line in the case: the tow force above is without dynamics of a line and without a safety factor"


def _pull(case):
    return quantity(case.bollard_pull, "N") if np.isfinite(case.bollard_pull) else \
        "no vessel in the case: its net pull at the speed of the tow, after its own resistance in ice, must exceed " \
        "the tow force"


def holds(cases):
    """Rows (what, value) on the line and the vessel, for the answer; cases: from design_value.cases()."""
    if not cases:
        return []
    def row(what, say):
        return what, "; ".join(loads_text.qualified(loads_text.shared([(c, say(case)) for c, case in cases])))
    made = [(c["label"], c["design"]["speed"]) for c, case in cases
            if c["design"]["speed"] and case.mode in ("line", "thrust")]
    said = [f"{label}: {number(v['value'])} m/s" + (
        f" ({number(v['interval_95'][0])} to {number(v['interval_95'][1])})" if np.isfinite(v["interval_95"]).all()
        else "") for label, v in made]
    return [row("tow speed asked for", lambda case: in_short(case.texts.get("tow.speed", "–"))),
            *[("speed made good", "; ".join(said))] * bool(said),
            row("breaking load of the line", _breaking), row("bollard pull of the vessel", _pull)]


def _limit(found, c):
    """The limit of a condition, and what keeps it from being resolved."""
    ends = [capability_text.value(found, c[k]) for k in ("makes_it", "does_not") if c[k] is not None]
    if c["resolved"] and len(ends) < 2:
        return c["why"]
    at = f"about {capability_text.value(found, c['estimate'])}" if c["estimate"] is not None else \
        f"between {' and '.join(ends)}" if len(ends) == 2 else "not found"
    return at if c["resolved"] else f"{at}; not resolved: {c['why']}"


def _capability(found):
    """(what, value) from a capability.json, one row per condition."""
    key = found["search"].rpartition(".")[2].replace("_", " ")
    for c in found["conditions"]:
        at = _limit(found, c) + (f" ({found['doubt']})" if found.get("doubt") else "")
        name = "" if not found["for"] else f", {capability_text.condition(found, c)}"
        part = "half" if found["share"] == 0.5 else f"{100 * (1 - found['share']):g} %"
        yield f"{key} at which {part} of the tows no longer keep {capability_text.kept(found)}{name}", at


def _convergence(found, e):
    """One line on converge.json for the values of the case: quantities that matter, that do not matter, that remained
    open, and that were only compared at other values. A quantity has one verdict: if the time step of the case is 2 s,
    it is that of 2 s against 1 s, and not also that of 1 s against 0.5 s."""
    texts = compared.cases(e)
    if why := compared.misfit(found, texts, e.base):
        return f"studied for another case: {why}"
    own = compared.values(e, texts)
    verdicts = compared.verdicts(found["rows"], own)
    shares = [compared.chain(found["rows"], name, own.get(name))[0].get("share_without")
              for name, verdict in verdicts.items() if verdict == "none"]
    least = converge_text.without(min(filter(None, shares), default=None))
    words = (("matters", "it depends on", ""), ("open", "open is", ""), ("none", "no effect that matters of", least),
             ("elsewhere", "not compared at the value of these tows:", ""))
    some = [f"{said} {', '.join(name for name in verdicts if verdicts[name] == kind)}{end}" for kind, said, end in words
            if kind in verdicts.values()]
    at = compared.alone(found, texts)
    return "; ".join(some + [f"studied at {at} alone"] * bool(at)) or "nothing compared"


def beyond(results, e):
    """Rows (what, value) from the results of other commands, for the answer; results: {name: found}. e: Ensemble."""
    budget, converge = results.get("budget"), results.get("converge")
    found = "not studied: friction, thickness, size, κ, drag and draft were not varied beyond the conditions above" \
        if budget is None else "; ".join(
            f"{budget_text.of_mean(b, b['parameters']['sd'])} of the {b['meaning'].split(':')[-1].strip()}"
            for b in (budget, *budget.get("more", [])) if b["parameters"]["sd"] is not None) or "not found"
    doubt = f" ({budget['doubt']})" if budget and budget.get("doubt") else ""
    return [("assumed values, standard deviation", found + doubt),
            ("width, length, time step, tolerance, start", _convergence(converge, e) if converge else "not studied"),
            *(_capability(results["capability"]) if "capability" in results else ())]
