# SPDX-License-Identifier: MIT
"""Towing capability: the speed that a tow reaches, and the value of a key (concentration, thickness, bollard pull) at
which half of the tows no longer succeed.

    bergtow capability CASE.yml --for "ice.thickness=0.5 m,1 m" -o DIR       concentration 20 to 95 %, two thicknesses
    bergtow capability CASE.yml --search tow.vessel.bollard_pull --from "0.5 MN" --to "4 MN"   a sufficient vessel

A tow in one field succeeds if it keeps `--speed` (by default a tenth of its tow.speed) along the ordered tow, on
average over the window and over its last quarter, and no branch of its line parts. The last quarter counts because the
mean of a tow that has come to rest in the ice only shows how long it has rested: without it the limit would depend on
run.duration. Only those parts of the window count where tow.programme orders that speed, because no tow keeps it
through an ordered stop. Rejected: windows with a body that stood still (stalled_windows), since a tow that stops and
continues succeeds; they are counted separately. The case tows with a vessel (tow.mode thrust), which slows down and
stops, or on a line that may part; a prescribed speed is kept at any force. The search is that of study/bracket.py. The
values that it has tried are part of the curve; the rest of the curve is run with CURVE fields per value if the budget
allows. If periodic sides are too close for the ice at a value, its runs use the width that `bergtow check` requires.
"""
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from bergtow._program import program_path
from bergtow.arguments import measure, read, whole_from
from bergtow.errors import CASE, SIGNAL, USAGE, BergtowError, RunError
from bergtow.result import at_least, compared
from bergtow.result.origins import source_of_ice
from bergtow.result.run import Run, case_value, parse_case, within
from bergtow.stats import mean as stat_mean
from bergtow.study import analysis, bracket, domain_width
from bergtow.study.case_file import files, section
from bergtow.study.runs import SPENT, CaseRuns, checked, locked

import numpy as np

BUDGET = 15.0            # min
FIELDS = 2               # trials per value at most / fewest that can decide
POINTS, CURVE = 5, 4     # of the curve: values, and fields at each
PARTS = 16               # range / resolution
STOPPED = 0.1            # share of tow.speed: a slower tow has stopped
RANGES = {"ice.concentration": ("0.2", "0.95")}
LATE = 0.25              # last part of that time, in which a tow must still keep the speed
FAILING = 3              # failed runs at a value after which the search gives it up


@dataclass(frozen=True)
class Trial:
    field: int
    least: float      #: m/s, to be kept
    speed: float      #: m/s, mean over the parts of the window where the speed is ordered; NaN: adrift
    late: float       #: the same over the last quarter of these
    stood: bool       #: it stood still for some time, held by the ice
    parted: bool
    tow_force: float  #: N, mean; NaN: adrift
    tension: float    #: N, largest step mean of the run, its start included
    breaking_load: float = 0.0  #: N, of a branch of its line; 0: it never parts
    widths: float = np.nan  #: of the domain in body widths
    needed: float = np.nan  #: required by the ice, NaN if it requires none

    @property
    def made(self):
        return min(self.speed, self.late) >= self.least and not self.parted


def kept(run, least):
    """Speeds made good, m/s, over the part of the window in which at least this speed is ordered, and over the last
    quarter of that part. Raises RunError if there is none."""
    time, (start, end) = run["time"], run.window
    fast = run.ordered_speed >= least * (1 - 1e-9)
    counts = fast[1:] & fast[:-1]
    if not np.any(counts & (time[1:] > start) & (time[:-1] < end)):
        raise RunError(run.path, f"the tow is never ordered to keep {least:.3g} m/s in its window",
                       "ask for a lower --speed, or move output.window_start", USAGE)
    clock, way = (np.append(0.0, np.cumsum(np.diff(x) * counts)) for x in (time, run.way))
    first, last = np.interp([start, end], time, clock)
    since = np.array([first, last - LATE * (last - first)])
    return (np.interp(last, clock, way) - np.interp(since, clock, way)) / (last - since)


def trial(run, number, least):
    """The trial of a finished run. least: m/s, None for a tenth of its tow.speed. Raises RunError."""
    if run.window is None:
        raise RunError(run.path, "the run has no window", "make run.duration longer", CASE)
    if np.sum(within(run["time"], *run.window)) < 2:
        raise RunError(run.path, "the window holds one sample", "make it longer, or output.sample_every less", CASE)
    if run.at_least:
        raise RunError(run.path, "the load on the body has no bound in some steps of the window",
                       "let ice give way (ice.rafting.kappa, ice.crushing.pressure)", CASE)
    domain = run.summary.get("domain") or {}
    widths, needed = np.array([domain.get(k) for k in ("body_widths", "body_widths_needed")], dtype=float).tolist()
    # a body that is adrift before the end of the window has no speed and no tow force, but it has the tension that
    # parted its line
    least = least or STOPPED * run.value("tow.speed")
    towed = run.adrift >= run.window[1]
    speed, late, force = (*map(float, kept(run, least)), run.number("mean_tow_force_n")) if towed else (np.nan,) * 3
    return Trial(number, least, speed, late, run.number("stalled_windows") > 0,
                 any(e["kind"] == "line_broken" for e in run.events), force,
                 float(np.fmax(*(run.number(f"{when}peak_line_tension_n") for when in ("", "start_")))),
                 run.value("tow.line.breaking_load", 0.0), widths, needed)


@dataclass
class Condition:
    """The search for one value of --for."""

    name: str         #: name for the folders
    label: str
    number: float     #: the value of --for, NaN without it
    sets: dict
    search: bracket.Bracket
    trials: dict = field(default_factory=dict)   #: [Trial] by value
    failed: dict = field(default_factory=dict)   #: [reason] by value
    wider: dict = field(default_factory=dict)    #: domain.width by value, as text, None if that of the case will do
    alike: set = field(default_factory=set)      #: values whose ice the seed does not change: their fields are one run
    why: str = ""     #: why the search ended early
    cases: list = field(default_factory=list)    #: {key: text} of the cases at the ends of the range


@dataclass
class Search:
    """The key to search, and the runs of the search."""

    runs: CaseRuns
    key: str
    unit: str         #: of its values, SI
    least: float      #: m/s, as in trial()
    say: object       #: stream for the progress, None for no output
    widen: bool = True

    def sets(self, c, value):
        """The keys that a value replaces in the case, {key: value}."""
        sets = c.sets | {self.key: f"{value:.12g} {self.unit}".strip()}
        if value not in c.wider:
            r = self.runs
            texts = [*r.given, *(f"{k}={v}" for k, v in sets.items())]
            c.wider[value] = domain_width.needed(r.program, r.case, texts) if self.widen else None
        return sets | ({"domain.width": c.wider[value]} if c.wider[value] else {})

    def add(self, c, value, n):
        """Make n more trials; False if the budget is spent. A run that fails has no outcome: another field is run
        instead, and the value is decided once no outcome of the failed run could change the decision."""
        point = c.search.point(value)
        value = point.value
        name, some = f"{c.name}/{value:.8g}", c.trials.setdefault(value, [])
        failed = c.failed.setdefault(value, [])
        first = len(some) + len(failed)
        if time.monotonic() + self.runs.seconds.get(name, 0.0) * -(-n // self.runs.jobs) > self.runs.end:
            return False
        numbers = range(first, first + n)
        why = self.runs.make(name, numbers, self.sets(c, value))
        if self.runs.alike(name):
            c.alike.add(value)
        for i, w in zip(numbers, why):
            if w == SPENT:
                return False
            if w and w.code == at_least.ENDED:  # which tows it ends depends on their loads
                raise RunError(self.runs.path(name, i), str(w), "without it the limit would be that of the other tows",
                               CASE)
            if w:
                failed.append(w)
                point.failed += 1
                continue
            with Run(self.runs.path(name, i)) as run:
                some.append(trial(run, i + 1, self.least))
            good = int(some[-1].made)
            point.good, point.bad = point.good + good, point.bad + 1 - good
        if self.say:
            print(f"\r{c.label}, {self.key} {value:.4g}: {point.good} of {point.n} succeed\x1b[K", end="",
                  file=self.say, flush=True)
        if len(failed) >= FAILING:
            point.spent = True
            if not some:
                raise RunError(self.runs.path(name, 0), f"every run failed: {failed[0]}", "mend the case",
                               self.runs.code_of_failure())
        return True

    def find(self, c):
        """Narrow the bracket until it is narrow enough or the budget is spent."""
        s = c.search
        while (value := s.next()) is not None:
            p = s.point(value)
            ends = {k: {s.verdict(p.good + k, p.bad, p.failed), s.verdict(p.good, p.bad + k, p.failed)}
                    for k in range(1, s.most)}
            least = next((k for k in ends if ends[k] != {bracket.OPEN}), 1)  # fewer cannot decide
            sure = next((k for k in ends if bracket.OPEN not in ends[k]), s.most)
            if not self.add(c, value, max(1, min(max(least, min(self.runs.jobs, sure)), s.most - p.n))):
                c.why = SPENT.text
                return

    def fill(self, c, points, fields):
        """Run the curve between the values of the search."""
        for value in np.linspace(c.search.start, c.search.end, points) if points > 1 else ():
            value = float(value)
            while c.search.point(value).n < fields and not c.search.point(value).spent:
                if not self.add(c, value, fields - c.search.point(value).n):
                    return
        # values that contradict the bracket are decided, or left as they are if the budget is insufficient
        while p := next((p for p in c.search.against() if c.search.more(p.value)), None):
            if not self.add(c, p.value, min(self.runs.jobs, c.search.most - p.n)):
                return


# ---- results


def row_of(c, value):
    some = c.trials[value][:1] if value in c.alike else c.trials[value]
    out = {"value": value, "fields": len(some), "made": sum(int(t.made) for t in some),
           "parted": sum(t.parted for t in some), "failed": len(c.failed[value]),
           "stood_still": sum(t.stood for t in some), "late_speed": [t.late for t in some],
           "body_widths": some[0].widths, "body_widths_needed": some[0].needed, "wider": c.wider.get(value),
           "breaking_load": some[0].breaking_load or None}
    for name in ("speed", "tow_force", "tension"):
        x = np.array([getattr(t, name) for t in some])
        out[name] = x.tolist()
        there = x[np.isfinite(x)]
        out[f"mean_{name}"] = there.mean() if len(there) else np.nan
        out[f"mean_{name}_95"] = stat_mean.t_interval(there) if len(there) > 1 else (np.nan, np.nan)
    return out


def contradiction(s):
    """Evidence against the bracket of a search, "" if there is none."""
    if not (against := s.against()):
        return ""
    p = max(against, key=lambda p: s.judged(p.value) != bracket.OPEN)
    words = "not monotonic" if s.judged(p.value) != bracket.OPEN else "perhaps not monotonic"
    return f"{words}: at {p.value:.4g} {p.good} of {p.n} succeed"


def failures(s):
    """A value at the limit that is undecided only because of failed runs, "" if there is none."""
    return next((f"at {p.value:.4g} {p.failed} of {p.n + p.failed} runs failed, which leaves it undecided"
                 for p in s.points.values() if p.failed and s.judged(p.value) == s.expected(p.value) == bracket.OPEN
                 and not s.more(p.value) and s.decidable(p, 0)), "")


def found_of(c):
    s = c.search
    yes, no = s.ends()
    why, sure = c.why or contradiction(s), False
    if not why and yes is not None and no is not None and abs(no - yes) > s.resolution * (1 + 1e-6):
        why = failures(s) or f"between them near {100 * s.share:g} % succeed, and {s.most} fields do not decide"
    elif not why and (yes is None or no is None):
        sure = all(s.judged(v) != bracket.OPEN for v in (s.start, s.end))
        why = (failures(s) or f"{s.most} fields do not decide an end of the range" if not sure else
               "every value of the range passes" if no is None else "no value of the range passes")
    return {"label": c.label, "for": c.number, "makes_it": yes, "does_not": no,
            "estimate": np.nan if s.against() else s.estimate(), "resolved": sure or not why, "why": why,
            "runs": sum(len(t) for t in c.trials.values()) + sum(len(f) for f in c.failed.values()),
            "points": [row_of(c, v) for v in sorted(c.trials) if c.trials[v]]}


def resolved(binary, case, sets):
    """{key: text} of the case with keys replaced, as the program reads it. Raises RunError in the program's words."""
    return parse_case(checked(binary, case, sets, "--scale", "1"))


def with_number(binary, case, sets, key, text):
    """(the case with a value of a key, that value in SI units)."""
    found = resolved(binary, case, [*sets, f"{key}={text}"])
    value = case_value(found, key)
    if not np.isfinite(value):
        raise RunError(case, f"{key}={text} is not a number", "search a key that is a number", USAGE)
    return found, value


def conditions(a, binary, start, end, resolution):
    """The conditions of --for, or only the case."""
    def condition(name, label, key="", text=""):
        cases = [with_number(binary, a.case, [*a.set, *([f"{key}={text}"] if key else [])], a.search, end)[0]
                 for end in (a.start, a.end)]
        return Condition(name, label, case_value(cases[0], key), {key: text} if key else {},
                         bracket.Bracket(start, end, resolution, a.share, a.fields), cases=cases)
    if not a.conditions:
        return [condition("case", "the case")]
    key, _, texts = a.conditions.partition("=")
    texts = [t.strip() for t in texts.split(",") if t.strip()]
    if not texts:
        raise RunError(a.case, f"--for {a.conditions}: no values", 'write it as "ice.thickness=0.5 m,1 m"', USAGE)
    out = [condition(f"c{k + 1}", f"{key} {text}", key, text) for k, text in enumerate(texts)]
    for k, c in enumerate(out):
        if same := next((other for other in out[:k] if other.cases == c.cases), None):
            raise RunError(a.case, f"--for: {same.label} and {c.label} are the same case", "leave one out", USAGE)
    return out


def check(case, key):
    """Check that the tow of a case can stop. Raises RunError."""
    mode, load = case.get("tow.mode"), case_value(case, "tow.line.breaking_load", 0.0)
    if mode != "thrust" and not (mode == "line" and load > 0):
        raise RunError("tow.mode", f"the tow of this case is of mode {mode}, which no ice stops",
                       "set tow.mode to thrust, with mass, bollard_pull and free_speed of tow.vessel, or to line with "
                       "tow.line.breaking_load", CASE)
    if source_of_ice(case):
        raise RunError("ice",
                       "the ice of this case is read, so that every field is the same, and one tow tells everything",
                       "let the program make the ice, by removing ice.outlines or ice.field, or run the case once at "
                       "each value", CASE)
    if key == "ice.seed":
        raise RunError(key, "the fields are its values already", "search another key", USAGE)


share = measure("%", lambda x: 0.05 <= x <= 0.95, "not from 0.05 to 0.95")


def options(p):
    p.add_argument("case", metavar="CASE.yml", type=Path)
    p.add_argument("-o", "--output", metavar="DIR", type=Path, help="result folder (default: out/capability-CASE); "
                   "runs are kept there and reused for the same case file and program")
    p.add_argument("--search", default="ice.concentration", metavar="KEY", help="key along which the limit is searched "
                   "(default ice.concentration)")
    p.add_argument("--from", dest="start", metavar="V", help="one end of the range of --search (default for "
                   "ice.concentration: 0.2)")
    p.add_argument("--to", dest="end", metavar="V", help="the other end of that range (default for "
                   "ice.concentration: 0.95)")
    p.add_argument("--resolution", metavar="V", help="width of the bracket at which the search ends (default: "
                   f"1/{PARTS} of the range)")
    p.add_argument("--for", dest="conditions", metavar="KEY=V,V", help="search under each of these values")
    p.add_argument("--speed", type=measure("m/s"), metavar="V",
                   help=f"speed that a tow must keep (default: {STOPPED:g} of its tow.speed)")
    p.add_argument("--share", type=share, default=0.5, metavar="Q", help="share of the tows that succeed at the limit "
                   "(default 0.5)")
    p.add_argument("--fields", type=whole_from(1, 1000), metavar="N", help="most ice fields per value (default: "
                   f"{FIELDS * bracket.least_trials()}; more if a decision at --share needs more)")
    p.add_argument("--points", type=whole_from(0, 100), default=POINTS, metavar="N",
                   help=f"values of the curve, with at least {CURVE} fields each (default {POINTS}; 0: only those of "
                   "the search)")
    domain_width.add_option(p)
    analysis.add_options(p, BUDGET)


def check_options(a):
    if None in (a.start, a.end) and a.search not in RANGES:
        raise BergtowError(f"--search {a.search}: say its range with --from and --to", USAGE)
    a.start, a.end = (own if given is None else given
                      for given, own in zip((a.start, a.end), RANGES.get(a.search, ("", ""))))
    least = bracket.least_trials(a.share)
    a.fields = a.fields or FIELDS * least
    if a.fields < least:
        raise BergtowError(f"--fields {a.fields}: a share of {100 * a.share:g} % takes {least} fields at least to be "
                           f"decided; give --fields {least} or more", USAGE)
    said = [text.partition("=")[0].strip() for text in (*a.set, a.conditions or "", a.search) if text]
    for key in said:
        if said.count(key) > 1:
            raise BergtowError(f"{key} is given by more than one of --search, --for and --set: leave it in one", USAGE)


def perform(a):
    check_options(a)
    folder = a.output or Path("out") / f"capability-{a.case.stem}"
    analysis.begin("capability", a.case, "case", folder, a.force)
    began, binary = time.monotonic(), program_path()
    case = resolved(binary, a.case, a.set)
    check(case, a.search)
    start, end = (with_number(binary, a.case, a.set, a.search, text)[1] for text in (a.start, a.end))
    if start == end:
        raise RunError(a.search, "the range has no extent", "give --from and --to two values", USAGE)
    unit = case.get(a.search, "").partition(" ")[2]
    resolution = abs(end - start) / PARTS
    if a.resolution:
        try:
            resolution = read(a.resolution, unit or "%")
        except BergtowError as error:
            raise BergtowError(f"--resolution {error}", USAGE) from None
        if not 0 < resolution <= (1 + 1e-9) * abs(end - start):  # 0.7 - 0.3 is less than 0.4
            raise RunError(f"--resolution {a.resolution}", "is not above 0 and at most the range",
                           f"give a part of {abs(end - start):.4g} {unit}".rstrip(), USAGE)
    some = conditions(a, binary, start, end, resolution)
    cases = [end for c in some for end in c.cases]
    ordered = min(case_value(end, "tow.speed") for end in cases)
    if a.speed and a.speed > ordered * (1 + 1e-9):
        raise RunError(f"--speed {a.speed:g} m/s", f"no tow can keep it that is ordered {ordered:.4g} m/s (tow.speed)",
                       "ask for that speed or less", USAGE)
    last = began + 60 * a.budget
    runs = CaseRuns(a.case.resolve(), folder, "capability", binary, a.set, a.jobs, last, last)
    replaced = [text.split("=")[0].strip() for text in (*a.set, a.conditions or "", a.search)]
    layers = files(a.case)
    keep = a.keep_width or domain_width.stays({name: section(layers, name) for name in ("domain", "ice")}, replaced)
    search = Search(runs, a.search, unit, a.speed, sys.stderr if sys.stderr.isatty() else None, not keep)
    with locked(folder / "capability") as runs.lock:
        for k, c in enumerate(some):
            runs.end = time.monotonic() + (last - time.monotonic()) / (len(some) - k)
            search.find(c)
        runs.end = last
        for c in some:
            search.fill(c, a.points, CURVE)
    if search.say:
        print(file=search.say)
    grid = (round(abs(end - start) / resolution) + 1) * a.fields * len(some)
    across = (a.conditions or "").partition("=")[0].strip()
    # a key whose default follows from a varied key varies with it
    alike = compared.common(cases)
    title = case.get("run.title", "none")
    found = {"case": a.case.name, "values": {k: v for k, v in alike.items() if k not in (a.search, across)},
             "title": "" if title == "none" else title, "set": a.set, "search": a.search, "unit": unit,
             "range": [start, end], "resolution": resolution, "for": across,
             "for_unit": case.get(across, "").partition(" ")[2],
             "speed": a.speed or STOPPED * case_value(alike, "tow.speed"), "share": a.share,
             "most_fields": a.fields, "breaking_load": case_value(alike, "tow.line.breaking_load", 0.0) or None,
             "budget_min": a.budget,
             "spent_min": (time.monotonic() - began) / 60, "grid_runs": grid, "conditions": [found_of(c) for c in some]}
    if not any(any(c.trials.values()) for c in some):
        runs.tell_failed()
        raise RunError(folder, "the budget is not enough for a run", "raise --budget and repeat the command to "
                                                                     "continue", SIGNAL)
    analysis.keep("capability", found, folder, a.force)
    runs.tell_failed()
