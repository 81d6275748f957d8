# SPDX-License-Identifier: MIT
"""From a case or a study to the report of the design tow force, as a page and as PDF.

    bergtow design CASE.yml -o DIR --budget 14      DIR/design.yml, the ensemble, report.html, report.pdf, replay.html
    bergtow design STUDY.yml -o DIR                 the same of a study, with the fields that it asks for

Of a case a study is made: over concentrations, with as many fields of each as the budget allows. Two fields of each
condition are run, then as many as fit into what is left, by the time which these took; members go field by field, so
conditions have equally many, and should the time run out all the same, the fields that are complete in every condition
are taken. Members are independent: one process of one thread a core. The same call goes on where an earlier one ended.

Where the domain of the case is too narrow for a concentration by the rule of `bergtow check`, that condition gets the
width that the rule asks for: a load that rests on the periodic images of the body is none to design for. Walls are part
of the question, and are left where they are.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from bergtow import arguments, writing
from bergtow._program import program_path
from bergtow.arguments import above_zero, at_least_one
from bergtow.errors import SIGNAL, RunError
from bergtow.reporting import pdf
from bergtow.reporting import page as report
from bergtow.result.members import FINISHED, WAITING, Members
from bergtow.result.origins import TITLE_BLOCK
from bergtow.result.run import Run
from bergtow.study import analysis, domain_width
from bergtow.study.case_file import contents, files, is_study, says, section
from bergtow.study.domain_width import read_ice_of, reads_ice
from bergtow.study.runs import checked, run_members

import numpy as np
import yaml

BUDGET = 14.0                # min
CONCENTRATIONS = "0.6,0.7,0.8,0.9"
MOST_FIELDS = 40
RESERVE = 30.0, 10.0         # s of the budget for pages, and for the statistics of each condition
MARGIN = 0.95                # of what is left is given to fields
FIRST = 2                    # fields by which it is measured how long one takes: they keep two cores busy
REPLAY_FRAMES = 120
SECTIONS = "run", "domain", "ice", "tow", "output"
FEW = 5                      # fields below which nothing is known of the scatter between them


@dataclass
class Work:
    """One call: program, folder, options, and the end of the budget by time.monotonic()."""

    program: Path
    folder: Path
    given: list              #: --set of the user's
    jobs: int
    end: float               #: inf without a budget
    quiet: bool

    def left(self):
        return self.end - time.monotonic()

    def ensemble(self, study):
        """Run the members that are not there yet. True when all have settled. Errors: RunError."""
        return run_members(self.program, study, self.folder, self.given, self.jobs, self.left(), self.quiet)


def title_of(case, name, values):
    title = says(case, "run", "title")
    if values:  # that of the case alone is not that of the study
        title = re.sub(r"\b\d+(\.\d+)?\s*% (?=(\w+ ){0,2}ice\b)", "", str(title or ""))
    words = f"ice concentration {100 * min(values):g} to {100 * max(values):g} %" if len(values) > 1 else \
        f"ice concentration {100 * values[0]:g} %" if values else ""
    return ": ".join(part for part in (str(title or name), words) if part)


def widths(work, a, case):
    """{concentration: domain.width as text} for those that need a wider domain than the case has. Errors: RunError."""
    if a.keep_width or domain_width.stays(case, [text.split("=")[0].strip() for text in a.set]):
        return {}
    found = {c: domain_width.needed(work.program, a.file, [*a.set, f"ice.concentration={c!r}"])
             for c in a.concentrations}
    return {c: width for c, width in found.items() if width}


def write_study(a, case, repeats, wider):
    """The study of a case: DIR/design.yml. wider: domain.width by concentration, as of widths. Errors: RunError."""
    values = [] if reads_ice(case) else a.concentrations
    study = {
        "title": a.title or title_of(case, a.file.stem, values),
        "base": os.path.relpath(a.file.resolve(), a.output.resolve()), "repeats": repeats, "seed": a.seed
    }
    if values:
        study["parameters"] = {"ice.concentration": values}
    if wider:
        study["with"] = {f"ice.concentration={c!r}": {"domain.width": width} for c, width in wider.items()}
    if says(case, "output", "panels") is None and says(case, "tow", "mode") != "none":
        study["set"] = {"output.panels": True}
    path = a.output / "design.yml"
    text = yaml.safe_dump(study, sort_keys=False, allow_unicode=True)
    writing.write_text(f"# {writing.MARK}\n{text}", path, a.force)
    return path


def fields_settled(folder):
    """Fields that have finished or failed in every condition, from the first on; 0 where nothing is there. One that
    failed is not left out: a field that jams is none that can be done without."""
    try:
        e = Members(folder)
    except RunError:
        return 0
    settled = [int(np.argmin(np.append(e.status[c.members] != WAITING, False))) for c in e.conditions()]
    return min(settled, default=0)


def seconds_a_field(e):
    """Wall time of one field of all conditions, by the members that are there."""
    took = {}
    for m in np.flatnonzero(e.status == FINISHED):
        with Run(e.folder(m)) as run:
            took.setdefault(int(e.condition[m]), []).append(run.number("wall_time_s"))
    return sum(np.mean(some) for some in took.values())


def seconds_of_the_longest(e):
    """Wall time of the member that took longest: a replay takes no more."""
    out = 0.0
    for m in np.flatnonzero(e.status == FINISHED):
        with Run(e.folder(m)) as run:
            out = max(out, run.number("wall_time_s"))
    return out


def more_fields(left, rate, replay, n, most):
    """Fields that n are followed by in `left` s, and the seconds that are kept for a replay: none, until there are
    FEW."""
    beside = min(int(MARGIN * (left - replay) / rate), most - n)
    few = min(int(MARGIN * left / rate), min(FEW, most) - n)
    return (beside, replay) if beside >= few else (few, 0.0)


def run_case(work, a, case):
    """Fields of a case as the budget allows. Errors: RunError."""
    if reads_ice(case) and a.fields > 1:
        print("the ice is read, and no seed changes it: one field is run, which says nothing of the scatter between "
              "fields")
        a.fields = 1
    n = min(max(FIRST, fields_settled(a.output)), a.fields)
    wider = widths(work, a, case)
    for c, width in wider.items():
        print(f"at {100 * c:g} % the domain is made {width} wide: narrower, its periodic images would carry part "
              "of the load (--keep-width: leave it as it is)")
    whole_round = work.ensemble(write_study(a, case, n, wider))
    if not whole_round and fields_settled(a.output) < 1:
        raise RunError(a.file, f"{a.budget:g} min do not reach for one field of each condition",
                       "raise --budget; what was begun is kept, and the same call goes on", SIGNAL)
    rate = seconds_a_field(Members(a.output)) / work.jobs
    replay = 0 if a.no_replay or reads_ice(case) else seconds_of_the_longest(Members(a.output))
    print(f"a field of all conditions takes {rate * work.jobs:.0f} s of a core")
    end = work.end
    while whole_round and rate > 0 and n < a.fields:  # at 0 all have failed
        more, kept = more_fields(end - time.monotonic(), rate, replay, n, a.fields)
        if more < 1:
            break
        work.end = end - kept
        start = time.monotonic()
        whole_round = work.ensemble(write_study(a, case, n + more, wider))
        rate = (time.monotonic() - start) / more
        n += more
    if not whole_round:
        n = max(1, fields_settled(a.output))
        work.end = np.inf  # nothing is left to run; the members are gathered once more
        work.ensemble(write_study(a, case, n, wider))
    if n < min(FEW, a.fields):
        need = a.budget + max(0.0, (FEW - n) * rate - max(0.0, end - time.monotonic())) / 60
        print(f"bergtow design: warning: {n} fields say nothing of the scatter between them; {FEW} need some "
              f"{need:.0f} min "
              "(--budget), or a shorter run (--set run.duration=1h)", file=sys.stderr)


def hardest(e):
    """The first field of the condition with the largest mean tow force, None without one."""
    force = e.summary.get("mean_tow_force_n", np.full(e.n, np.nan))
    there = [m for m in np.flatnonzero((e.status == FINISHED) & np.isfinite(force)) if e.folder(m).is_dir()]
    if not there:
        return None
    condition = max({int(e.condition[m]) for m in there},
                    key=lambda c: np.mean([force[m] for m in there if e.condition[m] == c]))
    return next(m for m in there if e.condition[m] == condition)


def make_replay(work, a, left):
    """One tow once more, with frames: DIR/replay.html. It has the same state to the last bit."""
    e = Members(a.output)
    m = hardest(e)
    if m is None:
        return
    with Run(e.folder(m)) as run:
        if read_ice_of(run.case):
            return
        takes = run.number("wall_time_s")
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


def concentrations(text):
    try:
        values = sorted({float(part) for part in text.split(",")})
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text}: give numbers with commas, as in {CONCENTRATIONS}") from None
    if not all(0 <= v <= 0.95 for v in values):
        raise argparse.ArgumentTypeError(f"{text}: concentrations are 0 to 0.95")
    return values


def options(p):
    p.add_argument("file", metavar="CASE-or-STUDY.yml", type=Path)
    p.add_argument("-o", "--output", metavar="DIR", type=Path, help="default: out/design-NAME; the same call goes on "
                   "where an earlier one ended")
    p.add_argument("--budget", type=above_zero, metavar="MIN",
                   help=f"wall time for all of it, min (default: {BUDGET:g} for a case, none for a study)")
    p.add_argument("--concentrations", type=concentrations, metavar="A,...", default=concentrations(CONCENTRATIONS),
                   help=f"of a case (default: {CONCENTRATIONS})")
    domain_width.add_option(p)
    p.add_argument("--fields", type=at_least_one, default=MOST_FIELDS, metavar="N",
                   help="of a case: at most so many of each condition (default: %(default)s)")
    p.add_argument("--seed", type=at_least_one, default=1, metavar="N", help="of a case: of its fields (default: 1)")
    p.add_argument("--title", metavar="TEXT", help="of a case: title of the report")
    p.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="replace a value of the case")
    p.add_argument("--jobs", type=at_least_one, default=len(os.sched_getaffinity(0)), metavar="N",
                   help="runs at a time (default: the cores)")
    p.add_argument("--no-pdf", action="store_true", help="the page alone")
    p.add_argument("--no-replay", action="store_true", help="no replay of a tow")
    p.add_argument("--also", metavar="DIR", action="append", type=Path, default=[],
                   help="take results of converge, budget and capability from this folder into the report; may be "
                   "repeated")
    p.add_argument("--quiet", action="store_true", help="no line for each member")
    for name in TITLE_BLOCK:
        p.add_argument(f"--{name}", metavar="TEXT", help=f"{name} in the title block")
    arguments.add_force(p)


def perform(a):
    a.output, began = a.output or Path("out") / f"design-{a.file.stem}", time.monotonic()
    contents(a.file)  # there, and what can be read
    study = is_study(a.file)
    if a.budget is None and not study:
        a.budget = BUDGET
    if not a.no_pdf:
        pdf.browser()
    made = ["report.html"] + ["report.pdf"] * (not a.no_pdf)
    analysis.also(a.also)
    for name in made + ["replay.html"] * (not a.no_replay) + ["design.yml"] * (not study):
        writing.may_write(a.output / name, a.force)
    if not study:
        checked(program_path(), a.file, a.set)
    a.output.mkdir(parents=True, exist_ok=True)
    reserve = RESERVE[0] + RESERVE[1] * len(a.concentrations)
    end = began + max(60 * a.budget - reserve, 30 * a.budget) if a.budget else np.inf
    work = Work(program_path(), a.output, a.set, a.jobs, end, a.quiet)
    if study:
        work.ensemble(a.file)
    else:
        layers = files(a.file)
        run_case(work, a, {name: section(layers, name) for name in SECTIONS})
    if not a.no_replay:
        make_replay(work, a, began + 60 * a.budget - time.monotonic() if a.budget else np.inf)
    report.write(a.output, [a.output / name for name in made], {name: getattr(a, name) for name in TITLE_BLOCK}, a.also,
                 force=a.force)
    print(f"{(time.monotonic() - began) / 60:.1f} min")
    holes = Members(a.output).holes()
    if holes:
        raise RunError(a.output, holes, "call again: it goes on; bergtow ensemble --retry-failed tries failed ones")
