# SPDX-License-Identifier: MIT
"""Runs of one case with some keys replaced, as studies that `bergtow ensemble` runs. bergtow converge, capability,
design and route base their decisions on them. Their requirements are under "Many runs" in docs/architecture.md.

    DIR/SUBJECT/NAME.yml        the study with the values that NAME stands for
    DIR/SUBJECT/NAME/           its ensemble; field NNN in members/c001-rNNN

The program keeps runs, resumes those that were stopped, and repeats damaged ones. A folder of another study, or of
another version of the program, is renamed to NAME.old: its runs may have taken hours, and it may hold files of others.
So only one call at a time works in DIR/SUBJECT: it and its runs hold the lock of the folder.
"""
import ctypes
import itertools
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from bergtow import _library, writing
from bergtow._calls import called
from bergtow.errors import CASE, SIGNAL, USAGE, Message, Refused, RunError
from bergtow.result import integrity
from bergtow.result.run import Run

import numpy as np
import yaml

DONE, STOPPED = 0, 6  # exit codes of the program
SPENT = Message("the budget is spent", "budget")  # for a run that met its limit
WAITING, FINISHED, FAILED = range(3)  # bt_member_state
MESSAGES = {"BERGTOW_MESSAGES": "json"}  # so that messages() can read them
ONE_THREAD = {"OMP_NUM_THREADS": "1"}
FIRST_SEED = 1000  # of the fields


def _message(line):
    try:
        return Message(**json.loads(line))
    except (TypeError, ValueError):  # of another program
        return Message(line)


def messages(said):
    """The messages of the program; output of others on that stream, such as MPI, is an error without a code."""
    return [_message(line) for line in said.splitlines() if line]


def stopped_by_limit(code, took, limit):
    """Did a call of the program, which took this long, end at its limit of wall time, s? Raises KeyboardInterrupt if a
    signal or a `stop` file ended it earlier: whoever stops one run wants no others to start."""
    if code == STOPPED and took < limit:
        raise KeyboardInterrupt
    return code == STOPPED


@contextmanager
def locked(folder):
    """Allow one call at a time in a folder. Yields the descriptor of its lock, which runs inherit, so that it holds
    until the last of them has ended. Raises BergtowError."""
    folder.mkdir(parents=True, exist_ok=True)
    lock = ctypes.c_int()
    _library.library().bt_folder_lock(os.fsencode(folder), ctypes.byref(lock))
    try:
        yield lock.value
    finally:
        os.close(lock.value)


def state_of(folder):
    """(state, exit code, Message with the reason) of a member, from the program (bergtow/ensemble.h)."""
    code, texts = ctypes.c_int(), [ctypes.c_void_p(), ctypes.c_void_p()]
    state = _library.library().bt_ensemble_state(os.fsencode(folder), ctypes.byref(code), *map(ctypes.byref, texts))
    failure, why = (_library.take_text(text.value) if text.value else "" for text in texts)
    return state, code.value, Message((why.splitlines() or [f"exit code {code.value}"])[0], failure or None)


@dataclass
class CaseRuns:
    case: Path
    folder: Path
    subject: str           #: name of the folder that contains them
    program: Path
    given: list            #: --set options of the user
    jobs: int
    end: float             #: end of the time for a quantity, as time.monotonic()
    last: float            #: end of the budget
    seconds: dict = field(default_factory=dict)  #: per run, by setting
    made: int = 0          #: runs made now, not found in the folder
    failed: dict = field(default_factory=dict)   #: {folder: (why, exit code)} of runs that failed in this call
    lock: int = -1         #: of the folder, as locked() gives it
    _ends: dict = field(default_factory=dict)    #: {name: for each requested run, None or why it failed}
    _alike: set = field(default_factory=set)     #: names whose ice the seed does not change: all fields are one run
    _sound: set = field(default_factory=set)     #: folders of runs that match their record
    _told: set = field(default_factory=set)      #: warnings already printed

    def __post_init__(self):
        if any(text.partition("=")[0].strip() == "ice.seed" for text in self.given):
            raise RunError("--set ice.seed", "changes nothing, because each field has its own seed", "leave it out",
                           USAGE)

    @cached_property
    def version(self):
        return subprocess.run([self.program, "--version"], capture_output=True, text=True).stdout.partition("\n")[0]

    def home(self, name):
        return self.folder / self.subject / name

    def path(self, name, i):
        return self.home(name) / "members" / self.member(0 if name in self._alike else i)

    def alike(self, name):
        """Does the seed leave the ice of these runs unchanged? All fields are then one run."""
        return name in self._alike

    def member(self, i):
        return f"c001-r{i + 1:03d}"

    def study(self, n, values):
        """The study of n fields, without its base."""
        texts = (text.partition("=") for text in self.given)
        return {"set": {key.strip(): text.strip() for key, _, text in texts} | {"output.frame_interval": "-1 s"} |
                {k: v if isinstance(v, str) else f"{v:.12g}" for k, v in values.items()},
                "fields": "numbered", "seed": FIRST_SEED, "repeats": n}

    def set_aside(self, name, why):
        """Rename the folder of runs that are no longer those of NAME, and tell why."""
        home = self.home(name)
        if not home.exists():
            return
        old = next(path for k in itertools.count(1) if not (path := Path(f"{home}.old{k if k > 1 else ''}")).exists())
        home.rename(old)
        self.tell((name, why), f"{home}: renamed to {old.name}, and its runs are made again: {why}")

    def write(self, name, n, values):
        """Write NAME.yml; runs of another version of the program are set aside."""
        path = Path(f"{self.home(name)}.yml")
        path.parent.mkdir(parents=True, exist_ok=True)
        study = {"base": os.path.relpath(self.case.resolve(), path.parent.resolve()), **self.study(n, values)}
        for some in (study.get("set", {}), *study.get("variants", {}).values()):
            some |= {key: None for key, text in some.items() if text in ("", "~", "null")}
        first = f"# {self.version}"
        text = first + "\n" + yaml.safe_dump(study, sort_keys=False, allow_unicode=True)
        there = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
        made_by, whole, _ = there.partition("\n")
        if whole and made_by != first:  # a first line without an end is damage and tells no version
            self.set_aside(name, f"they are of {made_by[2:]}, and this is {self.version}")
        if there != text:
            with writing.written(path, True) as new:
                new.write_text(text, encoding="utf-8")
        return path

    def kept(self, name, i):
        """Does this run exist, with its files unchanged?"""
        ends, path = self._ends.get(name, ()), self.path(name, i)
        if i < len(ends):
            return ends[i] is None
        if path not in self._sound and name not in self._alike and state_of(path)[0] == FINISHED:
            made_by = (self.home(name) / "study.resolved.yml").read_bytes()
            if not integrity.fault_of_member(path, path.name, made_by):
                self._sound.add(path)
        return path in self._sound

    def tell(self, what, words):
        """Print a warning, but only once."""
        if what not in self._told:
            print(f"bergtow {self.subject}: warning: {words}", file=sys.stderr)
        self._told.add(what)

    def call(self, name, n, values, line):
        """Let the program make the missing ones of n runs, until the budget is spent."""
        study, began = self.write(name, 1 if name in self._alike else n, values), time.monotonic()
        before = [state_of(self.path(name, i))[0] for i in range(n)]
        # each call retries failed ones once
        more = ["--retry-failed"] if FAILED in before[len(self._ends.get(name, ())):] else []
        try:
            _, said = run_members(self.program, study, self.home(name), [], self.jobs, self.last - began, not line,
                                  more, line, pass_fds=[self.lock] if self.lock >= 0 else [])
        except Refused as error:
            codes = {message.code: message.text for message in error.errors}
            if "other_study" in codes:
                self.set_aside(name, codes["other_study"])
            elif "one_field" in codes:
                self._alike.add(name)
            else:
                self.fail(name, n, error)
                return
            self.call(name, n, values, line)
            return
        for message in said:
            if message.warning:
                self.tell((name, message), f"{self.home(name)}: {message.text}")
        self._ends[name] = [self.outcome(name, i) for i in range(n)]
        there = [i for i, why in enumerate(self._ends[name]) if why is None]
        if new := len({self.path(name, i) for i in there if before[i] != FINISHED}):
            self.made += new
            self.seconds[name] = (time.monotonic() - began) / -(-new // self.jobs)

    def fail(self, name, n, error):
        """The program rejects a case with these values: count each of its runs as failed."""
        why = error.errors[0]
        self._ends[name] = [why] * n
        self.failed |= {self.path(name, i): (why, error.status) for i in range(n)}

    def outcome(self, name, i):
        path = self.path(name, i)
        state, code, why = state_of(path)
        self.failed.pop(path, None)
        if state == FAILED:
            self.failed[path] = why, code
        return {WAITING: SPENT, FAILED: why, FINISHED: None}[state]

    def make(self, name, fields, values, line=None):
        """Make the runs of these fields, and of those before them; returns for each of these fields None, or why it
        failed. line: called with each line that the program prints."""
        n = max(fields, default=-1) + 1
        if len(self._ends.get(name, ())) < n or SPENT in self._ends[name][:n]:
            self.call(name, n, values, line)
        if name in self._alike and n > 1 and self.kept(name, 0):
            self.refuse_ice(name)
        return [self._ends[name][i] for i in fields]

    def refuse_ice(self, name):
        """Raises RunError if there is ice that the seed does not change: it has no scatter, and decides nothing. Fields
        without floes are equal, and pass."""
        if json.loads((self.path(name, 0) / "summary.json").read_text())["n_floes"]:
            raise RunError(self.case, "the ice is read or given floe by floe, and no seed changes it", "let the "
                           "program make the ice, by removing ice.outlines, ice.field or floes", CASE)

    def code_of_failure(self):
        """Exit code of the first run that failed."""
        return next((code for _, (_, code) in sorted(self.failed.items())), 4)

    def tell_failed(self):
        """Raises RunError if a run of this call has failed."""
        for path, (why, code) in sorted(self.failed.items())[:1]:
            more = f", and {len(self.failed) - 1} more" if len(self.failed) > 1 else ""
            raise RunError(path, f"this run failed{more}: {why}",
                           "the result is without it; remove the cause of the failure", code)

    def there(self, name, n, values):
        """Do n runs exist, or could they be made? False if the budget is insufficient."""
        missing = sum(not self.kept(name, i) for i in range(n))
        expected = self.seconds.get(name, self.seconds.get("case", 0.0)) * -(-missing // self.jobs)
        if missing and time.monotonic() + expected > self.end:
            return False
        why = {i: w for i, w in enumerate(self.make(name, range(n), values)) if w}
        if SPENT in why.values():
            return False
        for i, reason in why.items():
            raise RunError(self.path(name, i), f"a run of {name} failed: {reason}",
                           "mend the case" if name == "case" else "leave it out of --vary", self.code_of_failure())
        return True

    def each(self, name, fields, measure):
        """[measure(run)] of existing runs."""
        out = []
        for i in fields:
            with Run(self.path(name, i)) as run:
                out.append(measure(run))
        return out

    def measured(self, name, fields, measure):
        """The same as an array of numbers; a single one for all fields if the seed does not change the ice."""
        return np.array(self.each(name, fields[:1] if self.alike(name) else fields, measure), dtype=float)


def ensemble_made(folder):
    """Time at which ensemble.h5 of a folder was written, None if it does not exist."""
    try:
        return (folder / "ensemble.h5").stat().st_mtime_ns
    except FileNotFoundError:
        return None


def run_members(binary, study, folder, sets, jobs, seconds, quiet=True, more=(), line=None, **options):
    """Run the members of a study that have not been run, one single-threaded process per core, for this many seconds
    (inf: no limit). Returns whether all have settled, i.e. finished or failed, and the Messages of the program. more:
    words added to the call; line and options: as for called(). Raises RunError if the program rejects the study, but
    not if a member fails: the others are gathered as usual."""
    call = [str(binary), "ensemble", str(study), "-o", str(folder), "--threads", "1", "--jobs", str(jobs), *more]
    call += [part for text in sets for part in ("--set", text)]
    limit = round(max(1.0, seconds), 3) if np.isfinite(seconds) else np.inf
    if np.isfinite(limit):
        call += ["--max-wall", str(limit)]
    before, began = ensemble_made(folder), time.monotonic()
    code, said = called(call + ["--quiet"] * quiet, line, env=os.environ | MESSAGES | ONE_THREAD, **options)
    if code < 0:
        raise RunError(folder, f"signal {-code} ({signal.strsignal(-code)}) has ended bergtow ensemble",
                       "call again: finished work is kept; if the memory ran out (SIGKILL), give fewer --jobs", SIGNAL)
    if code not in (DONE, STOPPED) and ensemble_made(folder) == before:
        raise Refused(study, messages(said), code, f"bergtow ensemble ended with exit code {code}")
    return not stopped_by_limit(code, time.monotonic() - began, limit), messages(said)


def checked(binary, case, sets, *words):
    """Output of `bergtow check` for a case with keys replaced. Raises RunError with the program's message."""
    done = subprocess.run([str(binary), "check", str(case), *words, *(w for t in sets for w in ("--set", t))],
                          capture_output=True, text=True, env=os.environ | MESSAGES)
    if done.returncode:
        raise Refused(case, messages(done.stderr), done.returncode, "the case is refused")
    return done.stdout
