# SPDX-License-Identifier: MIT
"""Runs of one case with some keys replaced, made on demand and kept in folders. bergtow converge and bergtow capability
base their decisions on them.

    DIR/SUBJECT/NAME/fNNN       field NNN with the values that NAME stands for, and call.json: its inputs;
                                begun.json in place of it while the run is under way or stopped; finished: the record
                                of its files, as that of an ensemble's member (result/integrity.py)

A run is kept, and a stopped run continues, as long as the case file, the files that it names, the program and the
values are unchanged. A run whose files do not fit the record is reported and made anew. One call at a time works in
DIR/SUBJECT: it and its runs hold the lock of the folder.
"""
import ctypes
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from bergtow import _library
from bergtow._calls import Calls
from bergtow._interrupts import held
from bergtow.errors import CASE, IO, USAGE, BergtowError, Refused, RunError
from bergtow.result import integrity
from bergtow.result.run import Run
from bergtow.study.case_file import files

import numpy as np

DONE, STOPPED, SPENT = 0, 6, "the budget is spent"  # exit codes of the program; a run that met its limit
FRESH = 2, 3, 4  # exit codes of a resume that cannot use the files of the run
WARNING = "bergtow: warning:"  # in front of a message of the program
ONE_THREAD = {"OMP_NUM_THREADS": "1"}


def texts_of(value):
    """Texts in the contents of a YAML file."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, (dict, list)):
        for part in value.values() if isinstance(value, dict) else value:
            yield from texts_of(part)


def is_file(folder, text):
    """Is this text of a case the name of a file: of a table, of outlines, of a field? Whatever the key, so that none is
    forgotten; a title that is one by chance does no harm."""
    try:
        return (folder / text).is_file()
    except (OSError, ValueError):
        return False


def digest(path):
    return hashlib.sha256(path.read_bytes()).digest()


def errors_in(said):
    """The errors among the messages of the program, without its name."""
    return [line.removeprefix("bergtow: ") for line in said.strip().splitlines()
            if not line.startswith(WARNING)]


def code_of(why):
    """The code in brackets behind an error of the program, None where it has none."""
    found = re.search(r" \[(\w+)\]$", why or "")
    return found and found[1]


def stopped_by_limit(code, took, limit):
    """Has a call of the program met its limit of wall time, s, which it took? Errors: KeyboardInterrupt where a signal
    or a file `stop` has ended it before: whoever wants that one ended wants no others."""
    if code == STOPPED and took < limit:
        raise KeyboardInterrupt
    return code == STOPPED


@contextmanager
def locked(folder):
    """One call at a time in a folder; yields the descriptor of its lock, which runs inherit: it holds for as long as
    one of them is left. Errors: BergtowError."""
    folder.mkdir(parents=True, exist_ok=True)
    lock = ctypes.c_int()
    _library.library().bt_folder_lock(os.fsencode(folder), ctypes.byref(lock))
    try:
        yield lock.value
    finally:
        os.close(lock.value)


@dataclass
class CaseRuns:
    """The runs of a study of one case."""

    case: Path
    folder: Path
    subject: str           #: name of the folder that holds them
    program: Path
    given: list            #: --set of the user's
    jobs: int
    end: float             #: of the time for a quantity, by time.monotonic()
    last: float            #: of the budget
    seconds: dict = field(default_factory=dict)  #: of a run, by setting
    made: int = 0          #: runs that were made, and not there before
    failed: dict = field(default_factory=dict)   #: {folder: (why, exit code)} of runs that failed in this call
    lock: int = -1         #: of the folder, as locked() gives it
    calls: Calls = field(default_factory=Calls)
    _sound: dict = field(default_factory=dict)   #: {folder: stamp of its files} of runs that fit their record
    _told: set = field(default_factory=set)      #: folders of runs that are reported

    def __post_init__(self):
        if any(text.partition("=")[0].strip() == "ice.seed" for text in self.given):
            raise RunError("--set ice.seed", "changes nothing, for each field has a seed of its own", "leave it out",
                           USAGE)
        version = subprocess.run([str(self.program), "--version"], capture_output=True).stdout
        try:
            layers = files(self.case)
        except RunError:
            layers = [(self.case, {})]  # the program will report what is wrong with it
        read = [(path.parent, text) for path, some in layers for text in texts_of(some)]
        read += [(self.case.parent, text.partition("=")[2].strip()) for text in self.given]
        parts = [path for path, _ in layers] + [folder / text for folder, text in read if is_file(folder, text)]
        #: of the files of the case and of the program
        self.identity = hashlib.sha256(b"".join(map(digest, parts)) + version).hexdigest()

    def path(self, name, i):
        return self.folder / self.subject / name / f"f{i + 1:03d}"

    def sets(self, i, values):
        texts = (f"{k}={v if isinstance(v, str) else f'{v:.12g}'}" for k, v in values.items())
        return [*self.given, "output.frame_interval=-1 s", *texts, f"ice.seed={1000 + i}"]

    def stamp(self, i, values):
        """The inputs of a run, without its place."""
        named = [digest(self.case.parent / text).hex() for text in values.values()
                 if isinstance(text, str) and is_file(self.case.parent, text)]
        return [self.identity, *named, *self.sets(i, values)]

    def stamped(self, name, i, values, file):
        try:
            return json.loads((self.path(name, i) / file).read_text()) == self.stamp(i, values)
        except (OSError, ValueError):
            return False

    def record(self, name, i, values):
        """(name, inputs) of a run, in the form of its record."""
        return f"{self.subject}/{name}/{self.path(name, i).name}", json.dumps(self.stamp(i, values)).encode()

    def kept(self, name, i, values):
        """Does a run with these inputs exist, with its files unchanged? A warning says why a run is damaged."""
        path = self.path(name, i)
        if not self.stamped(name, i, values, "call.json"):
            return False
        stamp = integrity.stamp(path)
        if stamp and self._sound.get(path) == stamp:
            return True
        fault = integrity.fault_of_member(path, *self.record(name, i, values))
        if fault:
            self.tell(path, f"{path}: {fault}; the run is made again")
        else:
            self._sound[path] = stamp
        return not fault

    def tell(self, what, words):
        """A warning, once."""
        if what not in self._told:
            print(f"bergtow {self.subject}: warning: {words}", file=sys.stderr)
        self._told.add(what)

    def call(self, *words):
        """Run the program within the time left; its exit code and messages, and whether it met that limit."""
        began = time.monotonic()
        left = round(max(1.0, self.last - began), 3)
        code, said = self.calls.run([str(self.program), *map(str, words), "--quiet", "--threads", "1", "--max-wall",
                               str(left)], stdout=subprocess.DEVNULL, env=os.environ | ONE_THREAD,
                              pass_fds=[self.lock] if self.lock >= 0 else [])
        return code, said, stopped_by_limit(code, time.monotonic() - began, left)

    def go_on(self, name, i, values):
        """Continue a run that an earlier call began; as call(), None where there is none to continue."""
        path = self.path(name, i)
        if not (self.stamped(name, i, values, "begun.json") and (path / "checkpoint.h5").exists()):
            return None
        done = self.call("resume", path)
        return None if done[0] in FRESH else done

    def begin(self, name, i, values):
        path = self.path(name, i)
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir(parents=True)
        (path / "begun.json").write_text(json.dumps(self.stamp(i, values)))
        t0 = time.monotonic()
        done = self.call("run", self.case, "-o", path, *(w for text in self.sets(i, values) for w in ("--set", text)))
        if done[0] == DONE:
            self.seconds[name] = time.monotonic() - t0
        return done

    def one(self, name, i, values):
        """One run, unless it is there already; None, or why it failed."""
        if self.kept(name, i, values):
            return None
        path = self.path(name, i)
        code, said, spent = self.go_on(name, i, values) or self.begin(name, i, values)
        if spent:
            return SPENT
        if code != DONE:
            why = (errors_in(said) or [f"exit code {code}"])[0]
            self.failed[path] = why, code
            return why
        try:
            integrity.keep(path, *self.record(name, i, values))
        except BergtowError as error:
            self.failed[path] = str(error), IO
            return str(error)
        os.replace(path / "begun.json", path / "call.json")
        self.made += 1
        return None

    def make(self, name, fields, values):
        """Runs of these fields, as many at a time as there are jobs: None, or why it failed, of each."""
        with ThreadPoolExecutor(self.jobs) as pool:
            try:
                why = list(pool.map(lambda i: self.one(name, i, values), fields))
            except BaseException:
                with held():
                    self.calls.stop()
                    pool.shutdown()
                raise
        self.refuse_copies(name, [i for i in range(max(fields, default=-1) + 1) if self.kept(name, i, values)])
        return why

    def code_of_failure(self):
        """Exit code of the first run that failed."""
        return next((code for _, (_, code) in sorted(self.failed.items())), 4)

    def tell_failed(self):
        """Errors: RunError where a run of this call has failed."""
        for path, (why, code) in sorted(self.failed.items())[:1]:
            more = f", and {len(self.failed) - 1} more" if len(self.failed) > 1 else ""
            raise RunError(path, f"this run failed{more}: {why}",
                           "the result is without it; remove the cause of the failure", code)

    def refuse_copies(self, name, fields):
        """Errors: RunError where two of these fields are the same run, whose scatter is none and decides nothing.
        Fields without floes are alike, and pass."""
        try:
            ends = [json.loads((self.path(name, i) / "summary.json").read_text()) for i in fields[:2]]
        except (OSError, ValueError) as error:  # where no record tells
            raise RunError(self.path(name, fields[0]), f"a summary cannot be read ({error})",
                           "remove the folder, and call again") from None
        first, second = (e.get("state_hash") if e.get("n_floes") else None for e in (ends + [{}, {}])[:2])
        if first is not None and first == second:
            raise RunError(self.case, "two fields with seeds of their own end in the same state: the ice is read or "
                           "given floe by floe, and no seed changes it", "let the program make the ice, by removing "
                           "ice.outlines, ice.field or floes", CASE)

    def there(self, name, n, values):
        """Are n runs there now, or could they be made? False where the budget does not reach so far."""
        missing = [i for i in range(n) if not self.kept(name, i, values)]
        expected = self.seconds.get(name, self.seconds.get("case", 0.0)) * -(-len(missing) // self.jobs)
        if missing and time.monotonic() + expected > self.end:
            return False
        why = {i: w for i, w in enumerate(self.make(name, range(n), values)) if w}
        if SPENT in why.values():
            return False
        for i, reason in why.items():
            raise RunError(self.path(name, i), f"a run of {name} failed: {reason}",
                           "mend the case" if name == "case" else "leave it out of --vary", self.code_of_failure())
        return True

    def measured(self, name, fields, measure):
        """Of runs that are there."""
        out = []
        for i in fields:
            with Run(self.path(name, i)) as run:
                out.append(measure(run))
        return np.array(out, dtype=float)


def ensemble_made(folder):
    """When ensemble.h5 of a folder was made, None where it is not there."""
    try:
        return (folder / "ensemble.h5").stat().st_mtime_ns
    except FileNotFoundError:
        return None


def run_members(binary, study, folder, sets, jobs, seconds, quiet=True):
    """Run the members of a study that are not there yet, a process of one thread a core, for so many seconds (inf: as
    long as it takes): whether all have settled, finished or failed, and the messages of the program. Errors: RunError
    where the program refuses the study; a member that fails is none, and the others are gathered as ever."""
    call = [str(binary), "ensemble", str(study), "-o", str(folder), "--threads", "1", "--jobs", str(jobs)]
    call += [part for text in sets for part in ("--set", text)]
    limit = round(max(1.0, seconds)) if np.isfinite(seconds) else np.inf
    if np.isfinite(limit):
        call += ["--max-wall", str(limit)]
    before, began = ensemble_made(folder), time.monotonic()
    code, said = Calls().run(call + ["--quiet"] * quiet, env=os.environ | ONE_THREAD)
    if code not in (DONE, STOPPED) and ensemble_made(folder) == before:
        raise Refused(study, "\n".join(errors_in(said)) or f"bergtow ensemble ended with exit code {code}", code)
    return not stopped_by_limit(code, time.monotonic() - began, limit), said


def checked(binary, case, sets, *words):
    """What `bergtow check` prints of a case with keys replaced. Errors: RunError in the program's words."""
    done = subprocess.run([str(binary), "check", str(case), *words, *(w for t in sets for w in ("--set", t))],
                          capture_output=True, text=True)
    if done.returncode:
        raise Refused(case, "\n".join(errors_in(done.stderr)) or "the case is refused", done.returncode)
    return done.stdout
