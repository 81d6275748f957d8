# SPDX-License-Identifier: MIT
"""The uncertainty budget of a study whose parameters are drawn from distributions: the mean, and the scatter due to the
fields, to the parameters, to each parameter, and to the computation.

    bergtow budget STUDY.yml -o DIR --budget 15        runs the remaining members, then DIR/budget.json, budget.png

The study is a Latin hypercube (`sampling`, `samples`) with separate fields for each condition, at least two of them
(`repeats`) to separate fields from parameters. Numerical settings are not varied here: their error is that of `bergtow
converge` on the base case (`--converge FILE`, or converge.json in DIR), starting from the value of the study.
"""
import re
import sys
from collections import Counter
from pathlib import Path

from bergtow._program import program_path
from bergtow.errors import CASE, SIGNAL, USAGE, RunError
from bergtow.result import answers, compared
from bergtow.result.members import FAILED, FINISHED, WAITING, Members, listed
from bergtow.stats import conditions, loads
from bergtow.stats import load as stat_load
from bergtow.stats import variance as stat_budget
from bergtow.study import analysis
from bergtow.study.case_file import contents, is_study
from bergtow.study.runs import run_members
from bergtow.table import hours_text

import numpy as np

BUDGET = 15.0  # min
BOUNDED = "mean_drag", "mean_line", "peak_line", "mean_vessel"  # numbers of the summary that a lock does not affect
OF = "mean_ice_resistance_n", "tow_force:99", "tow_force:100"


def assumed(e):
    """{parameter: distribution and source as the study gives them}."""
    def distribution(key, words):
        unit = "" if e.units[key] in ("", "1") else f" {e.units[key]}"
        return f"{words}{unit}" if words else ", ".join(dict.fromkeys(str(v) for v in e.parameters[key]))
    return {key: words | {"distribution": distribution(key, words["distribution"])}
            for key, words in e.assumed.items()}


def quantile(e, rows, name, share):
    """({"units", "description"}, values [rows]) of a quantile of a load in the window, as in stats/loads.py, the
    largest value at 100 %; NaN if a member's window is too short. Raises RunError if a parted line cuts the load off,
    or if the load has no statistics."""
    scale, out, known = loads.TIME_SCALE / loads.scaling(e, rows), np.full(len(rows), np.nan), None
    for k, m in enumerate(rows):
        for load, field, _ in loads.in_window(e, m, scale):
            if load.name == name and (why := load.refused or loads.cut_off(e, rows, load)):
                raise RunError(e.file, f"has no {load.label}: {why}", "name another with --of, or run it again")
            if load.name == name and field is not None:
                known, out[k] = load, np.percentile(field["peak"], share)
    if known is None:
        return None, out
    hours = np.nanmedian([e.number("window_end_s", m) - e.number("window_start_s", m) for m in rows]) / 3600
    words = f"largest {known.label} of a tow, within {hours_text(hours)}" if share == 100 else \
        f"{known.label} that {100 - share:g} % of the time exceeds"
    words += f"; a quasi-static load is the mean over a step, the peak of a collision is by {known.conversion}" \
        if known.conversion else f", as the moving mean over {scale:.3g} s"
    return {"units": known.units, "description": words}, out


def numbers(e, of):
    """(units and description, rows, values) of a number of the summary, or of LOAD:SHARE. Raises RunError."""
    if load := re.fullmatch(r"(\w+):(\d+(?:\.\d+)?)", of):
        share = float(load[2])
        if not 0 < share <= 100:
            raise RunError(of, "a quantile lies above 0 and at most at 100 %", "write it as tow_force:99", USAGE)
        meaning, values = quantile(e, e.used, load[1], share)
        if meaning is None:
            raise RunError(e.file, f"has no load {load[1]} with a window of {stat_load.LEAST_SCALES} time scales",
                           "name another with --of, or run longer")
    elif of in e.summary:
        whole = np.where([e.cut(m) for m in range(e.n)], np.nan, e.summary[of])  # it includes the time after a tow
        meaning, values = e.meaning.get(of, {}), (e.mean if of == OF[0] else whole)[e.used]
    elif not (e.status == FINISHED).any():
        raise conditions.nothing_to_count(e, False)
    else:
        raise RunError(e.file, f"has no number {of}", "see bergtow --list-quantities; a quantile is LOAD:SHARE", USAGE)
    there = np.isfinite(values)
    return meaning, e.used[there], values[there]


def those_there(e):
    """The numbers of OF that an ensemble has; if a quantile is left out, the reason is printed."""
    out = [OF[0]]
    for of in OF[1:]:
        try:
            numbers(e, of)
            out.append(of)
        except RunError as error:
            print(f"bergtow budget: left out: {of}: {error.reason}")
    return out


def numerics(e, converge, texts):
    """The numerical error of means of an ensemble, in the format of stats/variance.py; None if nothing is known.
    Refused if converge.json belongs to another case."""
    if converge is None:
        return None
    if why := compared.misfit(converge, texts, e.base):
        return {"refused": f"converge.json is of another case, {why}; run `bergtow converge` on the base case"}
    return stat_budget.relative_numerics(converge["rows"], compared.values(e, texts))


def fair(e):
    """Rows of a fair sample of a study that may have been cut short: for each repeat, the conditions before the first
    that has not been run. Conditions are in the order of the hypercube, which is random; which of the later ones are
    done depends on their run time, and so on their values."""
    rows = []
    for r in np.unique(e.repeat):
        some = np.flatnonzero(e.repeat == r)
        some = some[np.argsort(e.condition[some])]
        rows += list(some[:np.argmax(np.append(e.status[some] == WAITING, True))])
    return np.array(rows, dtype=int)


def without_intervals(found):
    """The same with all intervals set to unknown."""
    if not isinstance(found, dict):
        return found
    return {k: (np.nan, np.nan) if k.endswith("_95") else without_intervals(v) for k, v in found.items()}


def refuse(file, latin, common):
    """Raises RunError if a study cannot have a budget, however many of its members are run."""
    if not latin:
        raise RunError(file, "is not a Latin hypercube", "set sampling: latin-hypercube and samples in the study", CASE)
    if common:
        raise RunError(file, "has common fields, whose scatter is in all conditions alike", "set fields: own", CASE)


def of_ensemble(e, of=OF[0], computed=None):
    """The budget of a number of an ensemble. The numerical error, numerics(), is known only for the mean ice
    resistance: as a percentage of it, it does not apply to numbers that include drag or inertia. If members of the
    sample failed, or lack the number, the missing values are unknown, and there are no intervals. Raises RunError."""
    refuse(e.file, "sampling: latin-hypercube" in e.study, "fields: common" in e.study or "fields: numbered" in e.study)
    meaning, done, values = numbers(e, of)
    if (without := e.without_bound(np.arange(e.n))) and not of.startswith(BOUNDED):
        raise RunError(e.file, f"has no budget of {of}: {without}", "let ice give way (ice.rafting.kappa, "
                       "ice.crushing.pressure), or name another number with --of", CASE)
    sample = fair(e)
    there = np.isin(done, sample)
    rows, values = done[there], values[there]
    lacking = [e.name[m] for m in sample if m not in rows and e.status[m] == FINISHED and e.name[m] not in e.copies]
    found = stat_budget.budget({k: v[rows] for k, v in e.parameters.items()}, e.condition[rows], values,
                               computed if of == OF[0] else None)
    if "refused" in found:
        raise RunError(e.file, f"has too few members for a budget: {found['refused']}", "run the study further", SIGNAL)
    units = meaning.get("units") or ("N" if of.endswith("_n") else "")
    if lacking or np.any(e.status[sample] == FAILED):
        found = without_intervals(found)
    return found | {"title": e.title, "of": of, "units": str(units),
                    "meaning": str(meaning.get("description") or of), "assumed": assumed(e), "wanted": e.n,
                    "waiting": int(np.sum(e.status == WAITING)), "left_out": len(done) - len(rows),
                    "failed": e.reasons(FAILED), "failed_beyond": [e.name[m] for m in np.flatnonzero(
                        e.status == FAILED) if m not in sample], "without_number": lacking, "copies": e.copies,
                    "doubts": dict(Counter(kind for m in rows for kind in e.doubts(m))),
                    "doubtful": sum(bool(e.doubts(m)) for m in rows)}


def of_all(e, some, converge):
    """The budget of the first number, with those of the others in "more"; the contents of budget.json."""
    texts = compared.cases(e)
    computed = numerics(e, converge, texts)
    first, *more = (of_ensemble(e, of, computed) for of in some)
    return first | {"more": more, "values": compared.common(texts), "builds": e.builds, **compared.state(e)}


def read_converge(path, folder):
    if path is None:
        return answers.read("converge", folder)
    found = answers.read("converge", path)
    if not isinstance(found, dict) or "rows" not in found:
        raise RunError(path, "is not a converge.json", "name the folder or the file of bergtow converge")
    return found


def options(p):
    p.add_argument("study", metavar="STUDY.yml", type=Path)
    p.add_argument("-o", "--output", metavar="DIR", type=Path, help="folder of the ensemble (default: out/STUDY)")
    p.add_argument("--of", action="append", metavar="NUMBER", help="quantity to study: a key of the summary, or "
                   "LOAD:SHARE for a quantile in %% of the moving mean of a load over its time scale, 100 for the "
                   f"largest value of a tow; may be repeated (default: {', '.join(OF)})")
    p.add_argument("--converge", metavar="FILE", type=Path, help="converge.json of the base case, for the part of "
                   "numerical error")
    analysis.add_options(p, BUDGET)


def perform(a):
    folder = a.output or Path("out") / a.study.stem
    analysis.begin("budget", a.study, "study", folder, a.force)
    if a.study.is_file() and is_study(a.study):  # the program rejects a case, and reads a pipe
        keys = contents(a.study)
        refuse(a.study, keys.get("sampling") == "latin-hypercube", keys.get("fields", "own") != "own")
        if isinstance(n := keys.get("samples"), int) and n < stat_budget.LEAST:
            raise RunError(a.study, f"has {n} samples, too few for a budget", f"take {stat_budget.LEAST} or more", CASE)
    converge = read_converge(a.converge, folder)
    said = run_members(program_path(), a.study, folder, a.set, a.jobs, 60 * a.budget)[1]
    sys.stderr.writelines(f"bergtow: {message}\n" for message in said)
    e = Members(folder)
    found = of_all(e, a.of or those_there(e), converge)
    analysis.keep("budget", found, folder, a.force)
    if found["failed"]:
        raise RunError(folder, f"{len(found['failed'])} of {e.n} members failed ({listed(list(found['failed']))}): the "
                       "budget lacks their values", "correct the cause of their failure, or narrow the ranges; "
                       "`bergtow ensemble --retry-failed` tries them again")
