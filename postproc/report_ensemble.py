# SPDX-License-Identifier: MIT
"""What the report of an ensemble says: the tables of ensemble.py, the pictures of plot_ensemble.py, and every member
with its doubts.

The tables come from ensemble_text.py as Markdown, so that the page, the terminal and the README of a study say the
same.
"""
import argparse
import sys
from dataclasses import replace
from itertools import groupby

import ensemble
import ensemble_text
import loads
import loads_text
import plot_ensemble
import report_case
import report_run
import stat_fit
from bergtow_read import Run, RunError
from ensemble_read import DOUBTS, FAILED, FINISHED, Ensemble

import numpy as np

STATUS = {FINISHED: "finished", FAILED: "failed"}
WARNED = "WARNING: "
MOST_FIGURES = 8  #: conditions whose means stand at the head of the page
#: as ensemble.py has them
OPTIONS = {
    "error": 0.05, "exclude": [], "hours": [1.0, 10.0, 100.0], "threshold": None, "gap": None, "blocks": None,
    "resamples": stat_fit.RESAMPLES, "time_scale": None, "tow_hours": None, "probability": loads.PROBABILITY
}


def cells(line):
    return [cell.strip() for cell in line.strip().strip("|").split(" | ")]


def blocks(markdown):
    """The Markdown that ensemble_text writes as [{"kind": "heading", "text"}, {"kind": "table", "head", "rows"},
    {"kind": "text", "lines", "warnings"}]."""
    out = []
    lines = [line for line in markdown.splitlines() if line.strip()]
    for kind, some in groupby(lines,
                              key=lambda line: "heading" if line.startswith("#") else "table"
                              if line.startswith("|") else "text"):
        some = list(some)
        if kind == "heading":
            out += [{"kind": kind, "text": line.lstrip("# ")} for line in some]
        elif kind == "table":
            out.append({"kind": kind, "head": cells(some[0]), "rows": [cells(line) for line in some[2:]]})
        else:
            warned = [line[len(WARNED):] for line in some if line.startswith(WARNED)]
            out.append({"kind": kind, "lines": [line for line in some if not line.startswith(WARNED)],
                        "warnings": warned})
    return out


def sections(markdown):
    """(lines of the section on the members, [(heading, blocks)] of all others)."""
    found = blocks(markdown)
    starts = [k for k, b in enumerate(found) if b["kind"] == "heading"]
    parts = [(found[a]["text"], found[a + 1:b]) for a, b in zip(starts[1:], [*starts[2:], len(found)])]
    intro = [line for title, some in parts if title == "Members" for b in some for line in b["lines"]]
    return intro, [part for part in parts if part[0] != "Members"]


def figures(s):
    """Design tow forces of the conditions for the head of the page: (label, number, what stands below it)."""
    out = []
    for c in s["conditions"]:
        d = c["design"]["tow"]
        if d is None:
            out.append((c["label"], "–", "no field finished" if not c["resistance"]["n"] else "no tow force"))
            continue
        fields = f"{d['fields']} field{'s' if d['fields'] > 1 else ''}, mean {report_run.force(d['mean'])}"
        if "refused" in d:
            out.append((c["label"], "–", f"no value; largest simulated {report_run.force(d['largest'])}, {fields}"))
            continue
        low, high = (report_run.force(x) if np.isfinite(x) else "no bound" for x in d["interval_95"])
        out.append((c["label"], report_run.force(d["value"]),
                    f"95 % interval {low} to {high}{', extrapolated' if d['beyond_data'] else ''}; {fields}"))
    return out if len(out) <= MOST_FIGURES else []


def told(e, m):
    """Warnings of a member in its own words, or why they are not known."""
    try:
        with Run(e.folder(m)) as run:
            return [str(w) for w in run.summary.get("warnings") or []]
    except RunError as error:
        return [f"its folder cannot be read: {error.reason}"]


def members(e, s):
    """Rows of all members: what was varied, status, mean, doubts, state hash, warnings in words."""
    labels = {c.index: c.label for c in e.conditions()}
    by_name, out = {row["name"]: row for row in s["members"]}, []
    for m in range(e.n):
        row = by_name.get(e.name[m])
        mean, interval = report_run.with_interval(row["mean"], *row["within_95"]) if row else ("–", "–")
        out.append({
            "name": e.name[m], "condition": labels[e.condition[m]], "seed": int(e.seed[m]),
            "status": STATUS.get(int(e.status[m]), "waiting"), "mean": mean, "interval": interval,
            "doubts": ", ".join(sorted(e.doubts(m))),
            "told": told(e, m) if e.status[m] == FINISHED else [e.reason[m]] if e.reason[m] else []
        })
    return out


def key_values(e):
    """{heading: values} of the first member that can be read, with their origin; what differs between members is called
    varied."""
    for m in np.flatnonzero(e.status == FINISHED):
        try:
            with Run(e.folder(m)) as run:
                found = report_run.key_values(run, report_case.values(run))
        except RunError:
            continue
        varied = {key for key, values in e.parameters.items() if len(set(values.tolist())) > 1} | {"ice.seed"}
        return {
            heading: [replace(v, value="varied") if v.key in varied else v for v in some]
            for heading, some in found.items()
        }
    return {}


def provenance(e):
    """(rows of the first member, sentence on members of other builds or None)."""
    rows, builds = [], set()
    for m in np.flatnonzero(e.status == FINISHED):
        try:
            with Run(e.folder(m)) as run:
                builds.add(tuple(run.attributes.get(k) for k in ("version", "revision", "compiler", "flags")))
                rows = rows or [(name, value)
                                for name, value in report_run.provenance(run)
                                if name not in ("state hash", "wall time", "folder", "started")]
        except RunError:
            continue
    return rows + [("folder", str(e.path.resolve()))], (
        f"The members come from {len(builds)} builds of the program, which need not give the same bits."
        if len(builds) > 1 else None)


def caption(name):
    """Words for a picture of plot_ensemble.py by its name, "sweep-ice-concentration"."""
    if name.startswith("sweep-"):
        return "Mean ice resistance against " + name[6:].replace("-", ".", 1)
    if name.startswith("returns-"):
        return f"How often the {name[8:].replace('-', ' ')} is exceeded"
    return {
        "map": "Mean ice resistance over two parameters, and its interval",
        "sensitivity": "What the mean ice resistance depends on", "exceedance": "How often a peak is exceeded"
    }.get(name, name)


def pictures(e, options, s):
    """The pictures of plot_ensemble.py that the study supports."""
    drawn = plot_ensemble.pictures(e, options, s["conditions"])
    return [p for p in (report_run.picture(name, caption(name), draw) for name, draw in drawn) if p]


def context(folder):
    """Everything that page/ensemble.html sets. Errors: RunError."""
    e, options = Ensemble(folder), argparse.Namespace(**OPTIONS)
    s = ensemble.statistics(e, options)
    if s["holes"]:
        print(f"report.py: warning: {s['holes']}", file=sys.stderr)
    intro, found = sections(ensemble_text.report(s, markdown=True))
    rows, other_builds = provenance(e)
    title = report_run.breakable(e.title)
    counts = {name: int(np.sum(e.status == kind)) for kind, name in STATUS.items()}
    return {
        "title": title, "lead": intro[0], "warnings": intro[1:] + ([other_builds] if other_builds else []),
        "figures": figures(s), "asked": loads_text.asked(s), "sections": found, "pictures": pictures(e, options, s),
        "members": members(e, s),
        "counts": counts, "waiting": e.n - sum(counts.values()), "doubts": DOUBTS, "key_values": key_values(e),
        "kinds": report_case.KINDS, "study": e.study, "provenance": rows
    }
