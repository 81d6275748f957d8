# SPDX-License-Identifier: MIT
"""The contents of an ensemble's report: the tables of bergtow statistics, the pictures of bergtow plot-ensemble, and
every member with its doubts.

The tables come from text/ensemble.py, so that the page, the terminal and the README of a study agree.
"""
import argparse
import os
import sys
from dataclasses import replace

from bergtow import table as text_table
from bergtow.errors import RunError
from bergtow.plot import design_value as plot_design
from bergtow.plot import ensemble as plot_ensemble
from bergtow.reporting import document
from bergtow.reporting import method as report_method
from bergtow.reporting import run as report_run
from bergtow.reporting.document import lines, table
from bergtow.result import answers, compared
from bergtow.result import origins as report_case
from bergtow.result.members import DOUBTS, FAILED, FINISHED, Members, reading, short_key
from bergtow.result.origins import scrubbed
from bergtow.stats import conditions as ensemble
from bergtow.stats import design_value
from bergtow.stats.conditions import DEFAULTS as OPTIONS
from bergtow.stats.loads import CONSTANT
from bergtow.study import analysis
from bergtow.text import ensemble as ensemble_text
from bergtow.text import loads as loads_text
from bergtow.towing import tonnes

import numpy as np

#: keys that do not affect any result
PERSONAL = ("run.title", "run.threads", "report.", "output.", "guard.", "reference.")
#: keys of the numerical method, not of the tow: the appendix gives their origin, and convergence their effect
NUMERICAL = ("solver.", "run.", "impact.", "estimate.", "ice.seed", "ice.shake", "body.x", "body.y")
#: keys that govern the force; they are listed among the assumptions wherever their values come from
DECIDE = ("ice.size", "tow.speed", "body.drag.water_form", "water.current_x", "water.current_y", "air.wind_x",
          "air.wind_y")
STATUS = {FINISHED: "finished", FAILED: "failed"}


def unbroken(text):
    """The text with percent signs kept on the line of their numbers."""
    return text.replace(" %", "\u00a0%")


def blocks(parts):
    """Convert parts of bergtow/table.py to blocks of a page: {"kind": "table", "head", "rows"}, with the left column
    whose equal cells are merged, and {"kind": "text", "lines", "warnings"} for consecutive lines."""
    out = []
    for part in parts:
        if isinstance(part, text_table.Table):
            head, *rows = ([unbroken(scrubbed(text)) for text in (row[part.by], *row[:part.by], *row[part.by + 1:])]
                           for row in (part.head, *part.rows))
            out.append(table(head, rows))
            continue
        if not out or out[-1]["kind"] != "text":
            out.append(lines(faint=True))
        for line in part:
            out[-1]["warnings" if isinstance(line, text_table.Warned) else "lines"].append(scrubbed(line))
    return out


MARGIN = 1.05  # times the height of the largest simulated value above the mean: less leaves little room for more
#: marks after a design value, and their footnotes
FOOTNOTES = {
    "*": "beyond the hours simulated: extrapolated with the tail of the distribution.",
    "†": "from block maxima (GEV), since clusters over a threshold (GPD), the usual way, are too few, or farther apart "
         "than the return time.",
    "‡": "less than 5 % farther above the mean than the largest simulated: little margin for so long a return time."
}


def marks(d):
    """The marks of FOOTNOTES that apply to a design value."""
    carried = {"*": d["beyond_data"], "†": d["model"] == "GEV",
               "‡": d["model"] != CONSTANT and d["value"] - d["mean"] < MARGIN * (d["largest"] - d["mean"])}
    return "".join(mark for mark, there in carried.items() if there)


def design_row(c):
    tow, tension = c["design"]["tow"], c["design"]["tension"]
    if tow is None:
        return [unbroken(c["label"]), "–", "no tow force" if c["resistance"]["n"] else "no field finished", *["–"] * 8]
    def cells(d):
        if d is None or "value" not in d:
            return ["–", "no value" if d else "–"]
        value, interval = text_table.stated(d["value"], *d["interval_95"], "N", d["largest"])
        return [value + marks(d), CONSTANT if d["model"] == CONSTANT else interval]
    return [unbroken(c["label"]), *cells(tow), *cells(tension), text_table.stated(tow["mean"], *tow["mean_95"], "N")[0],
            report_run.force(tow["largest"]), report_run.force(tow.get("smallest")),
            report_run.force((tow["start_up"] or {}).get("largest")),
            str(tow["fields"]), text_table.number(tow["hours"])]


def answer(e, s, cases, results, told=None):
    """Blocks of the first chapter: the statement, the table, the figure if there is more than one condition, line and
    vessel, the scope. cases: from design_value.cases(); results: of other commands, from results_beside(); told:
    answer.json of bergtow design, which has vessel, line and ranges."""
    rows = [design_row(c) for c in s["conditions"]]
    head = ["condition", "design tow force", "95 % interval", "design line tension", "95 % interval", "mean tow force",
            "largest simulated", "smallest", "in the start", "fields", "hours"]
    notes = ["Largest simulated: of the same moving mean."]
    left_out = [3, 4] if all(row[3] == "–" for row in rows) else []  # no line
    tows = [c["design"]["tow"] for c in s["conditions"] if c["design"]["tow"]]
    for column, there, words in (
            ("smallest", any(d.get("below_zero") for d in tows),
             "Smallest: of the same, the least force. Where the mean is below zero it is the load to bear."),
            ("in the start", any(map(design_value.start_exceeds, tows)), "In the start: of the same moving mean, the "
             "largest that begins before the window, which no other column includes.")):
        notes += [words] * there
        left_out += [head.index(column)] * (not there)
    head, *rows = ([cell for k, cell in enumerate(row) if k not in left_out] for row in (head, *rows))
    asked, held = loads_text.asked(s), loads_text.holds_for(s)
    figure = None if len(s["conditions"]) < 2 else report_run.picture(
        "design", "Design tow force of each condition", lambda: plot_design.draw(
            s["conditions"], plot_ensemble.numeric(e), lambda key: plot_ensemble.axis_label(e, key),
            lambda key: reading(key, e.units[key])[0]))
    out = [lines(f"{asked}.")] if asked else []
    out += [lines(governing(s))] if len(s["conditions"]) > 1 else []
    carried = "".join(cell for row in rows for cell in row[1:])
    notes = [f"{mark} {words}" for mark, words in FOOTNOTES.items() if mark in carried] + notes
    out += [table(head, rows), lines(" ".join(filter(None, [*notes, loads_text.steps(s)])), faint=True)]
    out += [figure] if figure else []
    beyond = report_method.beyond(results, e)
    out += [{"kind": "pairs", "label": "line, vessel, and limits of the intervals",
             "rows": beyond[1:] if told else report_method.holds(cases) + beyond}] if cases else []
    return out + [lines(held)] * bool(held)


def governing(s):
    """A sentence with the condition of the largest design value, also in tonnes-force, the unit of vessel ratings."""
    some = [c for c in s["conditions"] if c["design"]["tow"] and "value" in c["design"]["tow"]]
    if not some:
        return "No condition has a design tow force."
    c = max(some, key=lambda c: c["design"]["tow"]["value"])
    d = c["design"]["tow"]
    def both(x, least=-np.inf):
        """A force, followed by its value in tonnes-force."""
        x = text_table.designed(x, least)
        return f"{report_run.force(x)} ({text_table.number(tonnes(x))} tonne-force)" if np.isfinite(x) else \
            "without bound"
    said, high = without_value(s, d["value"]), d["interval_95"][1]
    said += (f"Largest of {'the others' if said else 'these'}: {unbroken(c['label'])}, "
             f"{both(d['value'], d['largest'])}; upper end of its interval {both(high)}")
    if np.isinf(high):
        said += ": these fields do not determine the length of the tail, so do not use the value for a design"
    return said + (f"; its start, which that value leaves out, {both(d['start_up']['largest'])}."
                   if design_value.start_exceeds(d) else ".")


def without_value(s, value):
    """A sentence on the conditions that have no design tow force; "" if all have one."""
    rest = [c for c in s["conditions"] if not (c["design"]["tow"] and "value" in c["design"]["tow"])]
    if not rest:
        return ""
    names = ", ".join(unbroken(c["label"]) for c in rest)
    most = max((c["design"]["tow"]["largest"] for c in rest if c["design"]["tow"]), default=np.nan)
    reached = f", but {report_run.force(most)} in the simulation: the largest value of this study is not known" \
        if most > value else ""
    return f"No value for {names}{reached}. "


def members(e, s):
    """Rows of all members: varied keys, status, mean, doubts, state hash, warnings in words."""
    labels = {c.index: c.label for c in e.conditions()}
    by_name, out = {row["name"]: row for row in s["members"]}, []
    def kind_of(warning):  # names (of keys, series) among its values distinguish kinds, numbers do not
        return " ".join([warning["code"], *(v for v in warning["values"].values() if isinstance(v, str))])
    for m in range(e.n):
        row = by_name.get(e.name[m])
        n, (low, high) = (row["mean"], row["within_95"]) if row else (np.nan, (np.nan, np.nan))
        mean, interval = report_run.with_interval(n, low, high)
        warned = e.warnings(m) if e.status[m] == FINISHED else []
        out.append({
            "name": e.name[m], "condition": unbroken(labels[e.condition[m]]), "seed": int(e.seed[m]),
            "status": STATUS.get(int(e.status[m]), "waiting"), "mean": mean, "interval": interval,
            "mean_ice_resistance_n": n, "low_95_n": low, "high_95_n": high, "doubts": ", ".join(sorted(e.doubts(m))),
            "kinds": {kind_of(w): scrubbed(w["text"]) for w in reversed(warned)},
            "reported": [scrubbed(w) for w in [e.reason[m], *(w["text"] for w in warned)] if w]})
    return out


def by_condition(s):
    """Blocks of a table with one row per condition, instead of one per member."""
    rows = []
    for c in s["conditions"]:
        r, m = c["resistance"], c["members"]
        mean, interval = report_run.with_interval(r["mean"], *r["t_95"]) if r["n"] else ("–", "–")
        doubts = [f"{n} {kind}" for kind, n in (m["doubts"] | {k: m[k] for k in ("failed", "waiting")}).items() if n]
        rows.append([unbroken(c["label"]), str(r["n"]), mean, interval, report_run.force(r.get("max")),
                     ", ".join(doubts) or "none"])
    return [table(["condition", "n", "mean ice resistance", "95 % interval", "largest of a member", "doubts"], rows)]


def kinds_of_warnings(some):
    """Merge warnings of one kind, with the words of the first and the number of members: from the rows of members()."""
    found = {}
    for row in some:
        for kind, text in reversed(row["kinds"].items()):
            found.setdefault(kind, [text, 0])[1] += 1
    return [f"{text} ({text_table.counted(n)})" for text, n in found.values()]


def study_text(e):
    """The study as the user wrote it, or else as ensemble.h5 holds it."""
    try:
        return (e.path / "study.yml").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return e.study.split("# base case")[0]


def provenance(e):
    """Rows for the first member that can be read."""
    found = next(e.each(np.flatnonzero(e.status == FINISHED), report_run.provenance), [])
    return [row for row in found if row[0] not in ("state hash", "wall time", "folder", "started", "host")]


def caption(name):
    """Caption for a picture of bergtow plot-ensemble by its name, "sweep-ice-concentration"."""
    kind, _, of = name.partition("-")
    words = of.replace("-", " ")
    return {
        "sweep": f"Mean ice resistance against {short_key(of.replace('-', '.', 1))}",
        "above": f"How much of the time the {words} is above a level", "returns": f"How often the {words} is exceeded",
        "map": "Mean ice resistance over two parameters, and its interval",
        "sensitivity": "What the mean ice resistance depends on", "exceedance": "How often a peak is exceeded"
    }.get(kind, name)


def pictures(e, options, s):
    """{name: picture} for the pictures of bergtow plot-ensemble that the study allows."""
    drawn = plot_ensemble.pictures(e, options, s["conditions"])
    return {name: p for name, p in ((name, report_run.picture(name, caption(name), draw)) for name, draw in drawn) if p}


#: chapters for the tables of text/ensemble.py: heading, tables, name prefixes of the pictures after each
CHAPTERS = (("Loads", (("Loads", ()), ("Quantiles of loads", ("above", )), ("Return levels of loads", ("returns", )),
                       ("Peaks of collisions", ("exceedance", )))),
            ("Mean ice resistance",
             (("Mean ice resistance", ("sweep", "map", "variants")), ("Comparison with published estimates", ()),
              ("Distributions", ()), ("Sensitivity of the mean ice resistance", ("sensitivity", )))))


def parts(found, drawn):
    """The chapters of CHAPTERS: [(heading, blocks)]."""
    out = []
    for heading, some in CHAPTERS:
        blocks_of = []
        for title, begins in some:
            blocks_of += [{"kind": "heading", "text": title}] if title != heading else []
            blocks_of += blocks(found[title])
            blocks_of += [p for name, p in drawn.items() if name.startswith(begins)] if begins else []
        out.append((heading, blocks_of))
    return out


#: text that replaces a chapter without results
NOT_STUDIED = {
    "converge": "Not studied: it is not known whether the result depends on the width and length of the domain, time "
                "step, tolerance or start. bergtow converge CASE.yml examines it.",
    "budget": "Not studied: it is not known how much the assumed values change the result, and no interval of this "
              "report covers it. bergtow budget STUDY.yml examines it.",
}


def doubt(name, found, folder, texts, base):
    """Why the result of a command does not belong to these members (texts: compared.cases of them, base: Members.base),
    or no longer belongs to the ensemble in its folder; "" if it does."""
    if why := compared.misfit(found, texts, base):
        return f"studied for another case: {why}"
    if name == "converge" and (at := compared.alone(found, texts)):
        return f"studied only at {at}: it tells nothing about the other tows of this report"
    try:
        why = compared.stale(found, Members(folder)) if name == "budget" else ""
    except RunError:  # the folder holds only the result
        return ""
    return f"out of date, {why}: call bergtow budget again" if why else ""


def results_beside(e, also):
    """{name: result of a command of study/analysis.py, with "doubt"}, from the first folder that contains it: that of
    the ensemble, then those of `also`."""
    texts, out = compared.cases(e), {}
    for name in analysis.KINDS:
        for folder in (e.path, *also):
            found = answers.read(name, folder)
            if found is not None:
                out[name] = found | {"doubt": doubt(name, found, folder, texts, e.base)}
                break
    return out


def beside(results, told=None):
    """Chapters for the results of other commands; convergence and budget are mentioned even if neither was studied."""
    out = []
    for name, (heading, _) in analysis.KINDS.items():
        if name in results:
            part = analysis.chapter(name, results[name])
            drawn = part["figure"] and report_run.picture(name, heading, part["figure"])
            out.append((heading, blocks(part["parts"]) + ([drawn] if drawn else [])))
        elif name in NOT_STUDIED and not (name == "budget" and told and told.get("assumed")):
            out.append((heading, [lines(NOT_STUDIED[name])]))
    return out


def first_runs(e, s):
    """[(condition of the statistics, its values with their origin, the case as {key: text}, attributes)] for the first
    member of each condition that can be read."""
    found = ((c, next(e.each(of.members[e.status[of.members] == FINISHED],
                             lambda run: (report_case.values(run), run.case, run.attributes)), None))
             for c, of in zip(s["conditions"], e.conditions()))
    return [(c, *first) for c, first in found if first]


def parameters(e):
    """{key: "varied, 50 to 90 %"} of what a study varies."""
    out = {}
    for key, some in e.parameters.items():
        if len(set(some.tolist())) > 1:
            factor, unit = reading(key, e.units[key])
            out[key] = "varied" if some.dtype == object else \
                f"varied, {factor * np.nanmin(some):.4g} to {factor * np.nanmax(some):.4g} {unit}".strip()
    return out


def varied(e, runs):
    """Values of all conditions, from first_runs(): for a parameter its range; for anything else that differs between
    conditions, each value and each origin with its conditions."""
    words = {"ice.seed": "varied", "run.title": "that of the study, with condition and field"} | parameters(e)
    def together(some, text):
        return "; ".join(loads_text.qualified(loads_text.shared([(c, text(v)) for (c, *_), v in zip(runs, some)])))
    def of_all(some):
        kinds = {v.kind for v in some}
        return replace(some[0], value=words.get(some[0].key) or together(some, lambda v: report_case.short(v.value, 6)),
                       kind=some[0].kind if len(kinds) == 1 else "study",
                       origin=together(some, lambda v: scrubbed(v.origin)))
    return [of_all(some) for some in zip(*(values for _, values, *_ in runs))]


def ranges(results, told):
    """{key: (range, its source)} for the values that the uncertainty budget varied, or for the ranges of bergtow
    design, whose sources are in a separate table."""
    return {r["key"]: (f"{r['low']} to {r['high']}", "") for r in (told or {}).get("assumed", [])} | {
        key: (given["distribution"], given["source"] or "assumed")
        for key, given in results.get("budget", {"assumed": {}})["assumed"].items()}


def of_answer(found):
    """(sentence, remarks, [(heading, blocks)]) from the answer of bergtow design; ("", [], []) without one."""
    if found is None:
        return "", [], []
    from bergtow.text import answer as answer_text
    return (answer_text.sentence(found), answer_text.remarks(found),
            [(heading, blocks(some)) for heading, some in answer_text.tables(found)])


def governs(s, told):
    """The condition of the statistics that the answer of bergtow design is about, the hardest at the requested speed;
    without an answer the one with the largest load, by document.load."""
    told = told or {"load_cases": [], "conditions": []}
    of = [c["of"] for c in told["load_cases"] if c["id"] == "case.steady"]
    asked = [c for row, c in zip(told["conditions"], s["conditions"]) if row["id"] in of]
    return max(asked or s["conditions"], key=lambda c: document.load(c) or -np.inf)


def independent_check(e, s, told):
    """(blocks of the check, rows of the estimates) for the first field of the governing condition."""
    c = governs(s, told)
    rows = next(of.members for of in e.conditions() if of.index == c["index"])
    def checked(run):
        estimates = report_run.estimates(run)
        return document.check(run, estimates, unbroken(c["label"])), estimates
    return next(e.each(rows[e.status[rows] == FINISHED], checked), None) or (document.check(None, []), [])


def replays(e, place):
    """[(words, path relative to the page)] for the replays that exist."""
    some = [e.path / "replay.html", *sorted(e.path.glob("members/*/report.html"))]
    return [(p.parent.name if p.name == "report.html" else "replay of one tow",
             os.path.relpath(p, place.parent)) for p in some if p.is_file()]


def context(folder, place=None, given=None, also=()):
    """The template variables of page/ensemble.html. place: where the page will be written; given: {client, ...},
    replaces the values of the case; also: further folders with results of other commands. Raises RunError."""
    e, options = Members(folder), argparse.Namespace(**OPTIONS)
    s = ensemble.statistics(e, options)
    if s["holes"]:
        print(f"bergtow report: warning: {s['holes']}", file=sys.stderr)
    found = ensemble_text.sections(s, markdown=True)
    lead, *intro = found["Members"][0]
    rows, rows_of = provenance(e), members(e, s)
    runs = first_runs(e, s)
    values = [replace(v, value=scrubbed(v.value)) for v in varied(e, runs)]
    cases, results = design_value.cases(e, s), results_beside(e, also)
    counts = {name: int(np.sum(e.status == kind)) for kind, name in STATUS.items()}
    waiting = e.n - sum(counts.values())
    block = report_case.title_block(*runs[0][2:] if runs else ({}, {}), given or {})
    warned = loads_text.warnings(s) + intro
    told = answers.read("answer", e.path)  # of bergtow design
    told = told if isinstance(told, dict) and "sentence" in told else None
    sentence, remarks, tables = of_answer(told)
    checked, estimates = independent_check(e, s, told)
    drawn = pictures(e, options, s)
    if len(s["conditions"]) < 2:  # the chart would have a single point
        drawn = {name: p for name, p in drawn.items() if not name.startswith(("sweep", "map", "variants"))}
    return {
        "title": scrubbed(report_run.breakable(e.title)), "block": block,
        "marked": report_case.marked(block),
        "sentence": scrubbed(sentence), "remarks": [scrubbed(text) for text in remarks],
        "answer": answer(e, s, cases, results, told), "tables": tables,
        "operation": document.operation(s, cases, document.simulated(cases, parameters(e)), told), "check": checked,
        "evidence": document.evidence(),
        "sources": document.sources(values, estimates),
        "tension": any(c["design"]["tension"] for c in s["conditions"]),
        "warnings": [scrubbed(w) for w in warned],
        "method": report_method.method(s, cases), "limits": report_method.limits(cases, bool(told and told["speeds"])),
        "assumed": [replace(v, value=report_case.short(v.value)) for v in values
                    if v.kind != "unused" and (v.kind not in ("source", "default", "field") or v.key in DECIDE)
                    and not v.key.startswith(PERSONAL + NUMERICAL)],
        "ranges": ranges(results, told), "values": values, "kinds": report_case.KINDS,
        "beside": beside(results, told), "chapters": parts(found, drawn),
        "members": rows_of, "members_by_condition": by_condition(s),
        "kinds_of_warnings": kinds_of_warnings(rows_of), "counts": counts,
        "waiting": waiting, "lead": lead, "doubts": DOUBTS,
        "replays": replays(e, place or e.path / "report.html"),
        "study": scrubbed(study_text(e)), "provenance": [(name, scrubbed(value)) for name, value in rows]}
