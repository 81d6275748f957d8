# SPDX-License-Identifier: MIT
"""The design statement and the statistics of loads, as parts of bergtow/table.py."""
from itertools import zip_longest

import numpy as np

from bergtow import table as text_table
from bergtow.result.members import worded
from bergtow.stats import load as stat_load
from bergtow.stats.extreme import FAR
from bergtow.table import Table, Warned, hours_text, marked, number, pair, quantity, scale

NAMES = {"over_threshold": "GPD", "block_maxima": "GEV"}
SHOWN = 5, 50, 95, 99  # quantiles in a table, %
MAX_NAMED = 5  # conditions of a warning


def _towed(s):
    return [c for c in s["conditions"] if c["design"]["tow"]]


def asked(s):
    """"Design tow force: exceeded with a probability of 5 % in a tow of 24 h, as the moving mean over 30 s"; a range if
    conditions differ. "" if nothing is towed."""
    some = [c["design"]["tow"] for c in _towed(s)]
    if not some:
        return ""
    def span(key, text):
        low, high = min(d[key] for d in some), max(d[key] for d in some)
        return text(low) if high - low < 1e-6 * high else f"{text(low)} to {text(high)}"
    return (f"Design tow force: exceeded with a probability of {100 * some[0]['probability']:g} % in a tow of "
            f"{span('tow_hours', hours_text)}, as the moving mean over {span('time_scale_s', lambda v: f'{v:.3g} s')}")


def value(d, factor):
    """Cells with a design value and its interval."""
    if d is None or "refused" in d:
        return ["–", "–"]
    return [number(text_table.designed(d["value"], d["largest"]) / factor) + "*" * d["beyond_data"],
            pair(d["interval_95"], factor)]


def design(s):
    """The design statement: one row per condition, the conditions for which it holds, and the warnings."""
    some = _towed(s)
    if not some:
        first, *more = map(marked, warnings(s) or [""])
        return [[f"No design tow force. {first}", *more]]
    found = [c["design"]["tow"] for c in some]
    factor, unit = scale([np.median([d.get("value", d["largest"]) for d in found])], found[0]["units"])
    lines, held = any(c["design"]["tension"] for c in some), any(d.get("below_zero") for d in found)
    head = ["condition", f"design tow force, {unit}", "95 %", *([f"line tension, {unit}", "95 %"] if lines else []),
            f"mean, {unit}", f"largest simulated, {unit}", *[f"smallest, {unit}"] * held,
            "hours simulated", "return time, h", "fields", "tail"]
    rows = []
    for c in s["conditions"]:
        d, t = c["design"]["tow"], c["design"]["tension"]
        if d is None:
            rows.append([c["label"], *["–"] * (len(head) - 1)])
            continue
        rows.append([c["label"], *value(d, factor), *(value(t, factor) if lines else ()), number(d["mean"] / factor),
                     number(d["largest"] / factor), *[number(d["smallest"] / factor)] * held, number(d["hours"]),
                     number(d["return_hours"]), str(d["fields"]), d.get("model", "–")])
    notes = [f"{asked(s)}. 95 %: interval over fields, which holds for fields that are alike, without the effects "
             f"that the warnings name. * beyond the hours simulated: extrapolated with the tail."]
    notes += [text for text in (steps(s), holds_for(s)) if text]
    return [Table(head, rows), notes + warnings(s)]


def steps(s):
    """The largest tensions of single steps, which no design tension includes; "" without a line."""
    found = {}
    for c in sorted(s["conditions"], key=_governs):
        for x in c["design"]["branches"]:
            load = f", breaking load {quantity(x['breaking_load'], 'N')}" if np.isfinite(x["breaking_load"]) else ""
            found.setdefault(x["label"], []).append(f"{c['label']} {quantity(x['largest_step'], 'N')}{load}")
    said = [f"{label}: {several(some)}" for label, some in found.items()]
    return ("A design tension is the same moving mean: snap loads, which are shorter, are not in it. Largest mean over "
            f"one step, the start included; {'. '.join(said)}.") if said else ""


def holds_for(s):
    """"Holds for: ...": facts common to all conditions once, others with their conditions; "" if there are none."""
    some = [c for c in s["conditions"] if c["design"]["holds_for"]]
    if not some:
        return ""
    said = zip_longest(*(c["design"]["holds_for"].split(", ") for c in some), fillvalue="")
    return f"Holds for: {', '.join(part for texts in said for part in qualified(shared(list(zip(some, texts)))))}."


def shared(found):
    """Each distinct text of [(condition, text)] once: [(text, its conditions)], with "" as the conditions if all have
    it; empty texts are dropped. If the texts differ only with the value of one key, that value names the conditions."""
    names, where = [c["label"] for c, _ in found], {}
    for key in found[0][0]["values"] if found else ():
        of = {}
        for c, text in found:
            of.setdefault(c["values"][key], set()).add(text)
        if len(of) > 1 and all(len(texts) == 1 for texts in of.values()):
            names = [worded(key, c["values"][key], c["units"][key]) for c, _ in found]
            break
    for name, (_, text) in zip(names, found):
        where.setdefault(text, {})[name] = None
    return [(text, several(list(some)) if len(where) > 1 else "") for text, some in where.items() if text]


def qualified(some):
    """Texts, each followed in brackets by the other text of its pair, if that is not empty."""
    return [f"{text} ({more})" if more else text for text, more in some]


def _governs(c):
    """Sort key that puts the largest design value first, so that a shortened list keeps the governing conditions."""
    tow = c["design"]["tow"] or {}
    return -tow.get("value", tow.get("largest", 0.0))


def warnings(s):
    """"Problem: condition (amount); condition", each problem once; that a tow holds the body back, the first problem of
    its condition, before those of conditions with larger loads."""
    every = len(s["conditions"])
    found = {c["design"]["warnings"][0]["what"]: [] for c in s["conditions"]
             if (c["design"]["tow"] or {}).get("below_zero")}
    for c in sorted(s["conditions"], key=_governs):
        for w in c["design"]["warnings"]:
            found.setdefault(w["what"], []).append((c["label"], w["detail"]))
    out = []
    for what, where in found.items():
        details = {detail for _, detail in where}
        if len(where) == every and len(details) == 1:
            out.append(Warned(f"{sentence(qualified([(what, *details)])[0])}."))
        else:
            out.append(Warned(f"{sentence(what)}: {several(qualified(where))}."))
    return out


def sentence(text):
    return text[:1].upper() + text[1:]


def several(some):
    """Join a list of texts; of a long list only the first ones, since nobody reads a page of conditions. The most
    important come first."""
    return "; ".join(some if len(some) <= MAX_NAMED else
                     [*some[:MAX_NAMED - 1], f"and {len(some) - MAX_NAMED + 1} more conditions"])


def each_load(s):
    """(label, factor, unit, [(condition, statistics of the load)]) of the loads, in the order of the files."""
    for name in dict.fromkeys(name for c in s["conditions"] for name in c["loads"]):
        some = [(c, c["loads"][name]) for c in s["conditions"] if name in c["loads"]]
        first = some[0][1]
        yield (first["label"], *scale([np.median([abs(x["quantiles"]["95"]["value"]) for _, x in some])],
                                      first["units"]), some)


def signals(s):
    head = ["condition", "load", "mean", "95 %", "sd", "95 %", "largest", "smallest", "in the start",
            "unit", "over", "hours"]
    rows = [[c["label"], label, *estimate(x["mean"], factor), *estimate(x["sd"], factor),
             number(x["largest"] / factor), number(x["smallest"] / factor),
             number(x["start_up"] and x["start_up"]["largest"] / factor), unit, f"{x['time_scale_s']:.3g} s",
             number(x["hours"])] for label, factor, unit, some in each_load(s) for c, x in some]
    if not rows:
        return [[nothing(s), *left_out(s)]]
    note = ("Moving mean, over the time given, of the signal in the window from its first time scale on; means "
            "therefore differ a little from those of the whole window. In the start: the largest of the means that "
            "begin before the window, which no other column includes. 95 %: interval over fields.")
    return [Table(head, rows, 1), [note, *left_out(s), *conversions(s), *panel_lines(s)]]


def nothing(s):
    """Why no load has a row."""
    if any(c["loads_left_out"] for c in s["conditions"]):
        return "No statistics of a load."
    return "No loads: no member has a window with a towed body."


def left_out(s):
    """Sentences on members without a load, and on loads without statistics."""
    few, why = {}, {}
    for c in s["conditions"]:
        lacking = {}
        for x in c["loads"].values():
            lacking.setdefault((x["members"] - x["fields"], x["members"]), []).append(x["label"])
        for (n, all_of_them), labels in lacking.items():
            if n:
                few.setdefault(tuple(labels), []).append(f"{c['label']} ({n} of {all_of_them})")
        for x in c["loads_left_out"].values():
            why.setdefault((x["label"], x["why"]), []).append(c["label"])
    return [f"Members without {' and '.join(labels)}, or without a window of {stat_load.LEAST_SCALES} time scales in "
            f"which they are known throughout, enter none of these numbers: {several(where)}."
            for labels, where in few.items()] + [
                f"{sentence(label)} is left out: {reason}: {several(where)}." for (label, reason), where in why.items()]


def estimate(found, factor):
    """Cells with a number and its interval."""
    return number(found["value"] / factor), pair(found["interval_95"], factor)


def quantiles(s):
    rows = [[c["label"], label, *(v if ends == "–" else f"{v} ({ends})" for v, ends in (
        estimate(x["quantiles"][str(q)], factor) for q in SHOWN)), unit]
            for label, factor, unit, some in each_load(s) for c, x in some]
    if not rows:
        return [[nothing(s)]]
    return [Table(["condition", "load", *(f"{q} % of the time below" for q in SHOWN), "unit"], rows, 1),
            ["Of the same moving mean. Brackets: 95 %, over fields."]]


def conversions(s):
    named = sorted({(x["label"], x["conversion"]) for c in s["conditions"] for x in c["loads"].values()
                   if x["conversion"]})
    return [f"{sentence(label)}: a quasi-static load is the mean over a step, the peak of a collision is by "
            f"{conversion}." for label, conversion in named]


def panel_lines(s):
    """The most heavily loaded hull panel, one sentence per condition."""
    out = []
    for c in s["conditions"]:
        p = c["panels"]
        if p is None:
            continue
        k, most = int(np.argmax(p["mean"])), int(np.argmax(p["largest"]))
        factor, unit = scale([p["largest"][most]], p["units"])
        def at(j, p=p):
            return f"panel {j} (at {p['bearing_deg'][j]:.0f}° from the body's x axis)"
        few = "" if p["fields"] == c["members"]["used"] else f" ({p['fields']} of {c['members']['used']} fields)"
        out.append(f"Hull panels, {c['label']}{few}: {at(k)} has the largest mean, "
                   f"{number(p['mean'][k] / factor)} {unit} ({pair(p['mean_95'][k], factor)}); the largest mean of a "
                   f"step is {number(p['largest'][most] / factor)} {unit}, on {at(most)}.")
    return out


CUT = 0.9  # of the hours: if the blocks cover less, a note is added


def cut(name, f, hours):
    """["NAME: 12 of 20 h, and none of 3 fields"] for a fit by blocks that leaves out more than a small part; otherwise
    []. name: subject of the fit; hours: of all fields."""
    used, none = f.get("hours", hours), f.get("without_block", 0)
    if used >= CUT * hours and not none:
        return []
    return [f"{name}: {number(used)} of {number(hours)} h{f', and none of {none} fields' if none else ''}"]


def cut_note(some):
    return [f"All blocks have one length; the rest is left out: {several(some)}."] if some else []


def returns(s, markdown):
    """Return levels of the whole signal from both models of the tail."""
    hours = sorted({level["hours"] for c in s["conditions"] for x in c["loads"].values()
                    for kind in NAMES for level in x[kind].get("levels", [])})
    if not hours:
        refused = sorted({x[kind]["refused"] for c in s["conditions"] for x in c["loads"].values() for kind in NAMES
                          if "refused" in x[kind]})
        more = f"; and {len(refused) - 1} more reasons" if len(refused) > 1 else ""
        return [["No return levels" + (f": {refused[0].partition(';')[0]}{more}." if refused else ".")]]
    head = ["condition", "load", "tail", "shape", "p", *(f"once in {T:.3g} h" for T in hours), "unit", "hours"]
    rows, refused, short = [], {}, []
    for load, factor, unit, some in each_load(s):
        for kind, tail in NAMES.items():
            for c, x in some:
                f = x[kind]
                if "refused" in f:
                    refused.setdefault((load, tail), []).append(f"{c['label']}: {f['refused']}")
                    continue
                short += cut(f"{c['label']}, {load}", f, x["hours"])
                rows.append([c["label"], load, tail, *fitted(f, hours, factor), unit, number(x["hours"])])
    note = ("Levels of the whole signal, quasi-static loads and collisions together, that are exceeded on average once "
            "in the given hours of tow. GPD: clusters over a threshold; GEV: block maxima. p (Anderson–Darling): "
            "below 0.05 the tail does not fit. A tail with a shape below 0 has an end. Brackets: 95 %, profile "
            "likelihood, widened by the scatter between fields that are alike. * beyond the hours simulated: "
            "extrapolated. ! shape below -0.5: the levels "
            "are little more than the largest value seen. No bound: the upper end is more than "
            f"{FAR:g} times the level (of loads that cross zero, its height above the mean).")
    # advice on the remedy is only for a terminal
    said = (f"No fit for {load}, {tail}, {several([x.split(';')[0] if markdown else x for x in some])}."
            for (load, tail), some in refused.items())
    return [Table(head, rows, 1), [note, *cut_note(short), *said]]


def fitted(f, hours, factor):
    """Cells with shape, p and return levels at these hours, "–" for a level that there is not."""
    at = {level["hours"]: level for level in f["levels"]}
    def level(found):
        if found is None or not np.isfinite(found["level"]):
            return "–"
        value, ends = text_table.level(found["level"], found["level_95"], factor)
        return f"{value}{'*' if found['beyond_data'] else ''} ({ends})"
    return [f"{number(f['shape'], 2)}{'!' if f['irregular'] else ''} ({pair(f['shape_95'])})",
            number(f["p_value"], 2), *(level(at.get(T)) for T in hours)]
