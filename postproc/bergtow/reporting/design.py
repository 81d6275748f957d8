# SPDX-License-Identifier: MIT
"""From a case or a study to the requirements of a tow, and to their report as a web page and as PDF.

    bergtow design CASE.yml -o DIR --vessel "110 t"   DIR/design.yml, the ensemble, answer.json, report.html, report.pdf
    bergtow design STUDY.yml -o DIR                   the same for a study, with its own number of fields

For a case a study is written: of its concentration, or of several, and of several speeds if requested, with as many
fields of each as the budget allows. A tow at another speed covers the same distance as that of the case. First two
fields of each condition are run. The time they take decides how many more fit into the rest of the budget. Members run
field by field, so that all conditions have equally many; if time runs out nevertheless, the fields that are complete in
every condition are used. Members are independent: one single-threaded process per core. Repeating the same call
continues where an earlier one ended. No round of fields, run of a load case or replay is started if, at the pace
measured so far, it would not finish within the budget. At most CASES_SHARE of the budget is reserved for the runs of
load cases and ranges (study/load_cases.py, assumed.py), which use the hardest condition at the requested speed. A row
that the budget does not reach has no load, and the table states this.

If the domain of the case is too narrow for a concentration by the rule of `bergtow check`, that condition gets the
width that the rule requires: a load that the periodic images of the body help to carry must not be used for design.
Walls are part of the question, and are left where they are.
"""
import argparse
import itertools
import math
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from bergtow import writing
from bergtow._program import program_path
from bergtow.arguments import above_zero, at_least_one, from_zero, measure, minutes, read, several
from bergtow.errors import CASE, SIGNAL, RunError
from bergtow.reporting import pdf
from bergtow.reporting import page as report
from bergtow.result.members import FINISHED, WAITING, Members
from bergtow.result.origins import TITLE_BLOCK, source_of_ice
from bergtow.result.run import Run
from bergtow.study import analysis, answer, assumed, domain_width, gear, load_cases
from bergtow.study.case_file import contents, files, is_study, says, section
from bergtow.study.domain_width import reads_ice
from bergtow.study.runs import CaseRuns, locked, run_members
from bergtow.table import written
from bergtow.text import answer as answer_text

import numpy as np
import yaml

BUDGET = 14.0                # min
MAX_FIELDS = 40
RESERVE = 30.0, 10.0         # s of the budget for writing the report, and for the statistics of each condition
MARGIN = 0.95                # share of the remaining time that is given to fields
FIRST = 2                    # fields that measure the time per field: they keep two cores busy
REPLAY_FRAMES = 120
SECTIONS = "run", "domain", "ice", "tow", "output"
UNITS = {"ice.thickness": "m", "air.wind_x": "m/s", "air.wind_y": "m/s"}
BENDS = math.radians(1), math.radians(150)  # of the course change: the bend that a body on a line can follow, assumed
FEW = 5                      # with fewer fields the scatter between them is unknown
CASES_SHARE, CASE_RUNS = 0.4, 34  # largest share of the budget for load cases and ranges, and their number of runs
SLOWER = 1.6                 # time of a run / the program's estimate, before the first fields have been measured
PAIRED, OF_A_CASE = 4, 2     # fields: paired with those of the unchanged case, and of other load cases


@dataclass
class Work:
    """One call: program, folder, options, and the end of its budget as time.monotonic()."""

    program: Path
    folder: Path
    given: list              #: --set options of the user
    jobs: int
    end: float               #: inf without a budget
    quiet: bool
    began: float             #: start of the call
    core: float = 0.0        #: core seconds per run by the program's estimate
    last: float = math.inf   #: end of all runs, including load cases and replay
    member: float = 0.0      #: measured time of a run of the ensemble, s
    replay: float = 0.0      #: time reserved for the replay, s

    def left(self):
        return self.end - time.monotonic()

    def ensemble(self, study):
        """Run the members that have not been run. True when all have settled. Raises RunError."""
        settled, said = run_members(self.program, study, self.folder, self.given, self.jobs, self.left(), self.quiet)
        # at the limit the fields stop but the call continues; failed members are named again when all are gathered
        sys.stderr.writelines(f"bergtow: {message}\n" for message in said if settled or message.warning)
        return settled


def title_of(case, name, values):
    title = says(case, "run", "title")
    if values:  # the concentration in the title of the case is not that of the study
        title = re.sub(r"\b\d+(\.\d+)?\s*% (?=(\w+ ){0,2}ice\b)", "", str(title or ""))
    words = f"ice concentration {100 * min(values):g} to {100 * max(values):g} %" if len(values) > 1 else \
        f"ice concentration {100 * values[0]:g} %" if values else ""
    return ": ".join(part for part in (str(title or name), words) if part)


def widths(work, a, case):
    """{concentration: domain.width as text} where a wider domain than that of the case is needed. Raises RunError."""
    if a.keep_width or domain_width.stays(case, [text.split("=")[0].strip() for text in a.set]):
        return {}
    found = {c: domain_width.needed(work.program, a.file, [*a.set, f"ice.concentration={c!r}"])
             for c in a.concentrations or []}
    return {c: width for c, width in found.items() if width}


def at_speeds(a, found):
    """{text of a speed: keys set with it} for the study, empty for one speed. found: answer.case_numbers(). A tow at
    another speed goes the same distance as in the case, and its window begins at the same distance. Raises RunError."""
    own = found["speed"]
    some = sorted({own, *a.speeds})
    if len(some) == 1 or not a.speeds:
        return {}
    if found["case"].get("tow.programme", "none") != "none":
        raise RunError(a.file, "has a tow.programme, which no speed changes", "leave --speeds or tow.programme out",
                       CASE)
    out = {}
    for v in some:
        keys = {"run.duration": f"{found['duration'] * own / v:.9g} s"}
        if found["window_start"] >= 0:
            keys["output.window_start"] = f"{found['window_start'] * own / v:.9g} s"
        out[f"{v:.9g} m/s"] = keys
    return out


def varied(a, found):
    """{key: {text of a value: keys set with it}} for thicknesses and winds in addition to those of the case. Winds blow
    from ahead; if the tow is not along an axis, both of their components change. found: answer.case_numbers()."""
    out, case = {}, found["case"]
    if a.thicknesses:
        some = {answer.case_value(case, "ice.thickness"), *a.thicknesses}
        out["ice.thickness"] = {f"{v:.9g} m": {} for v in sorted(some)}
    if a.winds:
        course = answer.case_value(case, "tow.direction", 0.0)
        ahead = np.array([math.cos(course), math.sin(course)])
        own = [answer.case_value(case, f"air.wind_{k}", 0.0) for k in "xy"]
        some = [own, *(-v * ahead + 0.0 for v in a.winds)]
        first, second = ("x", "y") if abs(ahead[0]) >= abs(ahead[1]) else ("y", "x")
        texts = [{k: f"{v:.6g} m/s" for k, v in zip("xy", wind)} for wind in some]
        out[f"air.wind_{first}"] = {t[first]: {f"air.wind_{second}": t[second]} for t in texts}
    return out


def write_study(a, case, repeats, wider):
    """Write the study of a case, DIR/design.yml. wider: domain.width by concentration, see widths. Raises RunError."""
    values = [] if reads_ice(case) else a.concentrations or []
    study = {"title": a.title or title_of(case, a.file.stem, values),
             "base": os.path.relpath(a.file.resolve(), a.output.resolve()), "repeats": repeats, "seed": a.seed}
    parameters = {"ice.concentration": values} if values else {}
    fitting = {f"ice.concentration={c!r}": {"domain.width": width} for c, width in wider.items()}
    for key, some in (({"tow.speed": a.by_speed} if a.by_speed else {}) | a.varied).items():
        parameters[key] = list(some)
        fitting |= {f"{key}={text}": keys for text, keys in some.items() if keys}
    study |= {name: some for name, some in (("parameters", parameters), ("with", fitting)) if some}
    if says(case, "output", "panels") is None and says(case, "tow", "mode") != "none":
        study["set"] = {"output.panels": True}
    path = a.output / "design.yml"
    text = yaml.safe_dump(study, sort_keys=False, allow_unicode=True)
    writing.write_text(f"# {writing.MARK}\n{text}", path, a.force)
    return path


def fields_settled(folder):
    """Number of fields, counted from the first, that have finished or failed in every condition; 0 if there are none. A
    failed field is not skipped: a field that jams must not be left out."""
    try:
        e = Members(folder)
    except RunError:
        return 0
    settled = [int(np.argmin(np.append(e.status[c.members] != WAITING, False))) for c in e.conditions()]
    return min(settled, default=0)


def seconds_a_field(e):
    """Wall time of one field of all conditions, from the finished members."""
    took = {}
    for m in np.flatnonzero(e.status == FINISHED):
        with Run(e.folder(m)) as run:
            took.setdefault(int(e.condition[m]), []).append(run.number("wall_time_s"))
    return sum(np.mean(some) for some in took.values())


def more_fields(left, member, n, most, conditions, jobs):
    """How many fields to add to n in `left` s, and the seconds reserved for a replay, which takes no longer than a
    member; nothing is reserved until there are FEW fields."""
    def fit(seconds):
        return answer.fields_in(MARGIN * seconds, member, conditions, jobs)
    beside, few = min(fit(left - member), most - n), min(fit(left), min(FEW, most) - n)
    return (beside, member) if beside >= few else (few, 0.0)


def run_case(work, a, case):
    """Run as many fields of a case as the budget allows. Raises RunError."""
    settled = fields_settled(a.output)
    n = min(max(FIRST, settled), a.fields)
    wider = a.wider = widths(work, a, case)
    for c, width in wider.items():
        print(f"at {100 * c:g} % the domain is made {width} wide: narrower, its periodic images would carry part "
              "of the load (--keep-width: leave it as it is)")
    start = time.monotonic()
    whole_round = work.ensemble(write_study(a, case, n, wider))
    if not whole_round and fields_settled(a.output) < 1:
        raise RunError(a.file, f"{a.budget:g} min are not enough for one field of each condition",
                       f"raise --budget to {math.ceil(2 * a.budget)} and repeat the command; finished work "
                       "is kept", SIGNAL)
    e = Members(a.output)
    conditions = len(e.conditions())
    def took(fields):  # s per member, including overheads
        return (time.monotonic() - start) / math.ceil(fields * conditions / work.jobs) if fields > 0 else 0.0
    member = max(seconds_a_field(e) / conditions, took(n - settled) if whole_round else 0.0)
    print(f"a field of all conditions takes {member * conditions:.0f} s of a core")
    end = set_ends(work, a, conditions, member)
    while whole_round and member > 0 and n < a.fields:  # 0 means that all have failed
        more, kept = more_fields(end - time.monotonic(), member, n, a.fields, conditions, work.jobs)
        work.replay = 0.0 if a.no_replay or reads_ice(case) else kept
        if more < 1:
            break
        work.end = end - kept
        start = time.monotonic()
        whole_round = work.ensemble(write_study(a, case, n + more, wider))
        member = took(more) if whole_round else member
        n += more
    work.member = member
    if not whole_round:
        n = max(1, fields_settled(a.output))
        print(f"no time is left for further fields: the answer uses the {n} that are complete in every condition")
        work.end, work.quiet = np.inf, True  # nothing is left to run; the members are gathered once more
        work.ensemble(write_study(a, case, n, wider))
    if n < min(FEW, a.fields):
        share = 1 if a.no_load_cases else 1 - CASES_SHARE
        lacks = math.ceil((FEW - n) * conditions / work.jobs) * member - max(0.0, end - time.monotonic())
        need = a.budget + max(0.0, lacks) / share / 60
        print(f"bergtow design: warning: {n} fields tell nothing about the scatter between them; {FEW} need some "
              f"{math.floor(need) + 1} min: --budget {math.floor(need) + 1}", file=sys.stderr)


def hardest(e):
    """The first field of the condition with the largest mean tow force; None if there is none."""
    force = e.summary.get("mean_tow_force_n", np.full(e.n, np.nan))
    there = [m for m in np.flatnonzero((e.status == FINISHED) & np.isfinite(force)) if e.folder(m).is_dir()]
    if not there:
        return None
    condition = max({int(e.condition[m]) for m in there},
                    key=lambda c: np.mean([force[m] for m in there if e.condition[m] == c]))
    return next(m for m in there if e.condition[m] == condition)


def make_replay(work, a, left):
    """Run one tow again, with frames: DIR/replay.html. Its final state is the same to the last bit."""
    e = Members(a.output)
    m = hardest(e)
    if m is None:
        return
    with Run(e.folder(m)) as run:
        if source_of_ice(run.case):
            return
        takes = max(run.number("wall_time_s"), work.member)
        if takes > left:
            print(f"no replay: the tow takes {takes:.0f} s, and {max(0, left):.0f} s of the budget are left; the same "
                  "call with a larger --budget adds it")
            return
        step = run.value("run.duration") / REPLAY_FRAMES
    with tempfile.TemporaryDirectory(dir=a.output, prefix="replay-") as folder:
        call = [str(work.program), "run", str(e.folder(m) / "case.resolved.yml"), "-o", folder, "--quiet", "--threads",
                str(work.jobs), "--set", f"output.frame_interval={step:g}s"]
        done = subprocess.run(call, capture_output=True, text=True)
        if done.returncode:
            print(f"bergtow design: warning: no replay: {(done.stderr.strip().splitlines() or ['no reason given'])[0]}",
                  file=sys.stderr)
        else:
            report.write(Path(folder), [a.output / "replay.html"], force=a.force)


# ---- load cases and ranges


def beside(work, a, row, t):
    """(load cases except the steady one, ramp, ranges, number of runs) for a condition. Raises RunError."""
    ice = row["values"].get("ice.concentration")
    given = list(a.set)
    if ice is not None:
        given.append(f"ice.concentration={ice!r}")
        given += [f"domain.width={width}" for c, width in a.wider.items() if c == ice]
    for key, of in a.varied.items():
        text = min(of, key=lambda text: abs(read(text, UNITS[key]) - row["values"][key]))
        given += [f"{name}={value}" for name, value in ({key: text} | of[text]).items()]
    some = assumed.applies(a.assumed, lambda key, default: answer.case_value(t.case, key, default),
                           abs(t.wind) > load_cases.NO_WIND * abs(t.value))
    end = work.last - work.replay
    with locked(a.output / "load-cases") as lock:
        random = not source_of_ice(t.case) and answer.case_value(t.case, "ice.concentration", 0.0) > 0
        n = (PAIRED, OF_A_CASE) if random else (1, 1)
        duration = answer.case_value(t.case, "run.duration")
        runs = load_cases.Runs(CaseRuns(a.file, a.output, "load-cases", work.program, given, work.jobs, end, end,
                                        lock=lock), *map(range, n), duration, work.member / duration, a.no_load_cases)
        def say(words):
            if not a.quiet:
                print(words, flush=True)
        cases, ramp = [], None
        towed = t.speed > 0 and not answer.held_back(row)  # otherwise held in place, or back
        # first the cases in the design value, cheapest first; the head sea, far more expensive, last if assumed
        given = a.head_current is not None or a.head_wind is not None
        if towed:
            cases.append(load_cases.course_change(t, runs, math.degrees(a.bend), a.bend_radius))
            start, ramp = load_cases.start(t, runs, say)
        head = given and load_cases.head_sea(t, runs, a.head_current, a.head_wind)
        ranges = [load_cases.effect(t, r, runs) for r in sorted(some, key=lambda r: r.key != "body.drag.water_form")]
        cases.insert(0, head or load_cases.head_sea(t, runs))
        if towed:
            cases = [start, *cases, load_cases.stop(t), load_cases.loss_of_thrust(t), load_cases.line_parted(t)]
    return cases, ramp, ranges, len(runs.done)


def named(a, case):
    """(vessel, line) from the call or the case. Raises BergtowError."""
    return gear.vessel(a.vessel, case, a.vessels), gear.line(a.line, case, a.lines, a.line_length)


def answer_of(work, a, plan, began):
    """answer.json for the contents of the folder, and the answer. Raises RunError."""
    spent = time.monotonic()
    e = Members(a.output)
    rows = answer.conditions(e)
    first = next((r for r in rows if np.isfinite(r["speed_m_s"])), rows[0])
    asked_speed = plan and plan["speed_m_s"] or first["speed_m_s"]
    row = answer.hardest(rows, asked_speed)
    case = answer.case_of(e, row or first)
    vessel, line = named(a, case)
    t = answer.tow_of(e, row, line, vessel) if row else None
    cases, ramp, ranges, count = ([], None, [], 0)
    before = time.monotonic()
    if t is not None and plan is not None:
        cases, ramp, ranges, count = beside(work, a, row, t)
    now = time.monotonic()
    asked = {"concentrations": sorted({round(r["concentration"], 6) for r in rows}), "speed_m_s": asked_speed,
             "speeds_m_s": sorted({r["speed_m_s"] for r in rows}), "thicknesses_m": a.thicknesses,
             "winds_m_s": a.winds, "vessel": a.vessel, "line": a.line,
             "line_factor": a.line_factor, "efficiency": a.efficiency, "budget_min": a.budget,
             "time_scale_s": answer.stat_loads.TIME_SCALE, "probability": answer.stat_loads.PROBABILITY,
             "tow_hours": answer.stat_loads.TOW_HOURS, "line_found": line}
    cost = {"wall_s": now - began, "fields_s": spent - began, "statistics_s": before - spent, "cases_s": now - before,
            "case_runs": count}
    found = writing.plain(answer.of(asked, plan, rows, cases, ramp, ranges, vessel, t, cost, title=e.title,
                                    case=str(a.file), report="report.html"))
    writing.write_json(found, a.output / "answer.json", a.force)
    print(f"\n{answer_text.text(found)}\n")
    print(written([[*(f"note: {remark}" for remark in answer_text.remarks(found)), *answer_text.warnings(found)]]))
    print(a.output / "answer.json")


concentration = measure("%", lambda x: 0 <= x <= 0.95, "not from 0 to 95 %; give concentrations as in 0.6,0.8")
speed = measure("m/s", words="not above zero; give speeds as in \"0.8 kn,1 kn\" or 0.8kn:1.4kn:4")


def factor(text):
    """A safety factor, which must not lower a load."""
    if 0 < (value := above_zero(text)) < 1:
        raise argparse.ArgumentTypeError(f"{text} is below 1; give breaking load / tension, as 2 or 3")
    return value


def speeds(text):
    """"0.8 kn,1 kn", or "0.8 kn:1.4 kn:4" for four speeds from the first to the second: [m/s]"""
    if text.count(":") == 2:
        first, last, n = text.split(":")
        if not n.strip().isdecimal() or int(n) < 2:
            raise argparse.ArgumentTypeError(f"{text}: {n} is not a number of speeds; give 2 or more")
        return np.linspace(speed(first), speed(last), int(n)).tolist()
    return [speed(part) for part in text.split(",")]


def options(p):
    p.set_defaults(by_speed={}, varied={})
    p.add_argument("file", metavar="CASE-or-STUDY.yml", type=Path)
    p.add_argument("-o", "--output", metavar="DIR", type=Path, help="result folder (default: out/design-NAME); "
                   "repeating the command continues where an earlier call ended")
    p.add_argument("--budget", type=minutes, metavar="MIN",
                   help=f"total wall time, min (default: {BUDGET:g} for a case, none for a study)")
    p.add_argument("--concentrations", type=several(concentration), metavar="A,...",
                   help="ice concentrations, given a case (default: its own)")
    p.add_argument("--speeds", type=speeds, metavar="V,...", default=[], help="tow speeds beside that of a given case, "
                   "\"0.8 kn,1.3 kn\", or FROM:TO:N")
    p.add_argument("--thicknesses", type=several(measure("m")), metavar="H,...", default=[], help="thicknesses of "
                   "the ice beside that of a given case, \"0.8 m,1.6 m\"")
    p.add_argument("--winds", type=several(from_zero("m/s")), metavar="V,...", default=[],
                   help="winds from ahead beside that of a given case, \"10 m/s,20 m/s\"")
    p.add_argument("--vessel", metavar="NAME", help="vessel to check: class of the library, or bollard pull, \"110 t\"")
    p.add_argument("--line", metavar="NAME", help="line of the library, or breaking load, \"3.5 MN\"")
    p.add_argument("--line-length", type=measure("m"), metavar="M", help="line length, for snap loads (default: "
                   "that of the case)")
    p.add_argument("--line-factor", type=factor, metavar="X", help="safety factor of the line (default: none is "
                   "applied)")
    p.add_argument("--efficiency", type=measure("%", lambda x: 0 < x <= 1, "not above 0 and up to 100 %"),
                   default=1.0, metavar="X", help="share of the bollard pull available to the vessel in the "
                   "weather (default: 1)")
    for kind in ("vessels", "lines"):
        p.add_argument(f"--{kind}", metavar="FILE", type=Path, help=f"CSV of your own {kind}, beside the library")
    p.add_argument("--ranges", metavar="STUDY.yml", type=Path, help="ranges of the assumed values, given a case, as "
                   "the parameters of a study (default: a few with their sources)")
    p.add_argument("--head-current", type=from_zero("m/s"), metavar="V",
                   help="current against the tow in the load case with head current and wind (default: "
                   f"{load_cases.HEAD_CURRENT:g} m/s, assumed, and then not in the design value)")
    p.add_argument("--head-wind", type=from_zero("m/s"), metavar="V", help="wind against the tow in that load "
                   f"case (default: {load_cases.HEAD_WIND:g} m/s)")
    p.add_argument("--bend", type=measure("rad", lambda x: BENDS[0] <= abs(x) <= BENDS[1], "not from 1 to "
                                          "150 degrees, to either side"),
                   default=math.radians(answer.BEND), metavar="DEG", help="angle of the course change, degrees "
                   f"(default: {answer.BEND:g}, assumed)")
    p.add_argument("--bend-radius", type=measure("m"), metavar="M", help="radius of the course change (default: "
                   "ten body widths, assumed)")
    p.add_argument("--no-load-cases", action="store_true", help="make no runs of load cases and ranges: use closed "
                   "forms only")
    domain_width.add_option(p)
    p.add_argument("--fields", type=at_least_one, default=MAX_FIELDS, metavar="N",
                   help="most ice fields per condition, given a case (default: %(default)s)")
    p.add_argument("--seed", type=at_least_one, default=1, metavar="N",
                   help="seed of the fields, given a case (default: 1)")
    p.add_argument("--title", metavar="TEXT", help="title of the report, given a case")
    p.add_argument("--no-pdf", action="store_true", help="write the page only")
    p.add_argument("--no-replay", action="store_true", help="leave out the replay of a tow")
    p.add_argument("--also", metavar="DIR", action="append", type=Path, default=[],
                   help="take results of converge, budget and capability from this folder into the report; may be "
                   "repeated")
    p.add_argument("--quiet", action="store_true", help="do not print a line for each member")
    for name in TITLE_BLOCK:
        p.add_argument(f"--{name}", metavar="TEXT", help=f"{name} in the title block")
    analysis.add_runs(p)


def set_ends(work, a, conditions, member=None):
    """Set when fields must end (work.end) and when all runs must end (work.last), as time.monotonic(). member: measured
    time of a run, s; if the program is slower than its estimate, more time is reserved for the pages."""
    estimated = SLOWER * work.core
    slower = max(1.0, member / estimated) if member and estimated > 0 else 1.0
    reserve = slower * (RESERVE[0] + RESERVE[1] * conditions)
    work.end = work.last = work.began + max(60 * a.budget - reserve, 30 * a.budget) if a.budget else np.inf
    if a.budget and work.core and not a.no_load_cases:
        work.end -= min(CASES_SHARE * (work.end - time.monotonic()), CASE_RUNS / a.jobs * (member or estimated))
    return work.end


def sets_of_study(a, asked):
    """The user's --set options for the study, except keys that at_speeds() or varied() set and, unless concentrations
    are given, ice.concentration: in these cases the study already contains the values of --set."""
    some = [*a.by_speed.values(), *(keys for of in a.varied.values() for keys in of.values())]
    there = {*a.varied, *(key for keys in some for key in keys)}
    there |= {"tow.speed"} if a.by_speed else set()
    there |= set() if asked else {"ice.concentration"}
    return [text for text in a.set if text.partition("=")[0].strip() not in there]


def refuse_short_window(a, found):
    """Raises RunError if the window that a case names is too short for a load, at the fastest of its speeds."""
    faster = max(found["speed"], *a.speeds) / found["speed"] if a.by_speed else 1.0
    window, least, enough = answer.window_of(found, faster)
    if enough:
        return
    at = f" at {faster * found['speed']:g} m/s" if faster > 1 else ""
    longer = next(t for t in itertools.count(math.ceil(found["duration"]))
                  if answer.window_of(found | {"duration": t}, faster)[2])
    raise RunError(a.file, f"has a window of {window:g} s{at}, and a load needs {answer.stat_load.LEAST_SCALES} time "
                   f"scales, {least:.4g} s", f"lengthen run.duration to {longer} s, or "
                   f"{'leave that speed out, or ' if at else ''}give the length scale of a model "
                   "(estimate.length_scale)", CASE)


def planned(a, case, found, began):
    """(Work of the fields, plan): print, before the first run, the cost per value and what the budget allows. Raises
    RunError."""
    own, asked = answer.case_value(found["case"], "ice.concentration", 0.0), a.concentrations
    a.concentrations = [] if reads_ice(case) else a.concentrations or [own]
    if a.thicknesses and reads_ice(case):
        raise RunError(a.file, "reads its ice, which has the thickness of its floes", "leave --thicknesses out", CASE)
    a.by_speed, a.varied = at_speeds(a, found), varied(a, found)
    n = math.prod(max(1, len(some)) for some in (a.concentrations, a.by_speed, *a.varied.values()))
    work = Work(program_path(), a.output, sets_of_study(a, asked), a.jobs, np.inf, a.quiet, began)
    alike = "" if any(a.concentrations) else "there is no ice: one field is run" if not reads_ice(case) else (
        "the ice is read, and no seed changes it: one field is run, which tells nothing about the scatter between "
        "fields")
    a.fields = 1 if alike else a.fields
    work.core = answer.plan(work.program, a.file, a.set, n, a.jobs, np.inf, a.fields)["core_s"]
    left = set_ends(work, a, n) - time.monotonic()
    plan = answer.plan(work.program, a.file, a.set, n, a.jobs, left / 60, a.fields)
    if found["window_start"] >= 0:
        refuse_short_window(a, found)
    print(alike or answer_text.plan(plan), flush=True)
    return work, plan | {"speed_m_s": found["speed"]}


def perform(a):
    a.output, began = a.output or Path("out") / f"design-{a.file.stem}", time.monotonic()
    contents(a.file)  # fail now if it is missing or cannot be read
    study = is_study(a.file)
    if a.budget is None and not study:
        a.budget = BUDGET
    if not a.no_pdf:
        pdf.browser()
    made = ["report.html"] + ["report.pdf"] * (not a.no_pdf)
    analysis.also(a.also)
    for name in ["answer.json", *made] + ["replay.html"] * (not a.no_replay) + ["design.yml"] * (not study):
        writing.may_write(a.output / name, a.force)
    found = None if study else answer.case_numbers(program_path(), a.file, a.set)
    named(a, found["case"] if found else {})  # reject it now, not after the runs
    a.assumed = assumed.read(a.ranges) if a.ranges else assumed.RANGES
    a.output.mkdir(parents=True, exist_ok=True)
    if study:
        work = Work(program_path(), a.output, a.set, a.jobs, np.inf, a.quiet, began)
        set_ends(work, a, 1)
        work.ensemble(a.file)
        plan = None
    else:
        layers = files(a.file)
        case = {name: section(layers, name) for name in SECTIONS}
        work, plan = planned(a, case, found, began)
        run_case(work, a, case)
    answer_of(work, a, plan, began)
    if not a.no_replay:
        make_replay(work, a, work.last - time.monotonic())
    report.write(a.output, [a.output / name for name in made], {name: getattr(a, name) for name in TITLE_BLOCK}, a.also,
                 force=a.force)
    print(f"{(time.monotonic() - began) / 60:.1f} min")
    holes = Members(a.output).holes()
    if holes:
        raise RunError(a.output, holes, "call again: it continues; bergtow ensemble --retry-failed tries failed ones")
