# SPDX-License-Identifier: MIT
"""Runs of one case with some keys replaced, made when they are asked for, as many as it takes, and kept in folders.
What converge.py and capability.py decide from.

    DIR/SUBJECT/NAME/fNNN       field NNN with the values that NAME stands for, and call.json: what it was made by

A run is kept while the case file, the files that it names, the program and the values are what they were.
"""
import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from bergtow_read import Run, RunError
from case_file import files

import numpy as np

STOPPED, SPENT = 6, "the budget is spent"  # exit code of a run that met its limit


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


@dataclass
class CaseRuns:
    """The runs of a study of one case."""

    case: Path
    folder: Path
    subject: str           #: name of the folder that holds them
    program: Path
    given: list            #: --set of the user's
    jobs: int
    end: float             #: of what is left to a quantity, by time.monotonic()
    last: float            #: of the budget
    seconds: dict = field(default_factory=dict)  #: of a run, by setting
    made: int = 0          #: runs that were made, and not there before

    def __post_init__(self):
        if any(text.partition("=")[0].strip() == "ice.seed" for text in self.given):
            raise RunError("--set ice.seed", "changes nothing, for each field has a seed of its own", "leave it out")
        version = subprocess.run([str(self.program), "--version"], capture_output=True).stdout
        try:
            layers = files(self.case)
        except RunError:
            layers = [(self.case, {})]  # the program says what is wrong with it
        read = [(path.parent, text) for path, some in layers for text in texts_of(some)]
        read += [(self.case.parent, text.partition("=")[2].strip()) for text in self.given]
        parts = [path for path, _ in layers] + [folder / text for folder, text in read if is_file(folder, text)]
        #: of the files of the case and of the program
        self.identity = hashlib.sha256(b"".join(map(digest, parts)) + version).hexdigest()

    def path(self, name, i):
        return self.folder / self.subject / name / f"f{i + 1:03d}"

    def arguments(self, name, i, values):
        texts = (f"{k}={v if isinstance(v, str) else f'{v:.12g}'}" for k, v in values.items())
        sets = [*self.given, "output.frame_interval=-1 s", *texts, f"ice.seed={1000 + i}"]
        out = [str(self.program), "run", str(self.case), "-o", str(self.path(name, i)), "--quiet", "--threads", "1"]
        return out + [part for text in sets for part in ("--set", text)]

    def stamp(self, name, i, values):
        """What a run is made by."""
        named = [digest(self.case.parent / text).hex() for text in values.values()
                 if isinstance(text, str) and is_file(self.case.parent, text)]
        return [self.identity, *named, *self.arguments(name, i, values)]

    def kept(self, name, i, values):
        path = self.path(name, i)
        try:
            return (path / "summary.json").exists() and json.loads(
                (path / "call.json").read_text()) == self.stamp(name, i, values)
        except (OSError, ValueError):
            return False

    def one(self, name, i, values):
        """One run, unless it is there already; None, or why it failed."""
        path, call = self.path(name, i), self.arguments(name, i, values)
        if self.kept(name, i, values):
            return None
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir(parents=True)
        t0 = time.monotonic()
        left = max(1.0, self.last - time.monotonic())
        done = subprocess.run([*call, "--max-wall", f"{left:.3f}"],
                              capture_output=True,
                              text=True,
                              env=os.environ | {"OMP_NUM_THREADS": "1"})
        if done.returncode == STOPPED:
            return SPENT
        if done.returncode:
            lines = done.stderr.strip().splitlines()
            return lines[0] if lines else f"exit code {done.returncode}"
        (path / "call.json").write_text(json.dumps(self.stamp(name, i, values)))
        self.seconds[name] = time.monotonic() - t0
        self.made += 1
        return None

    def make(self, name, fields, values):
        """Runs of these fields, as many at a time as there are jobs: None, or why it failed, of each."""
        with ThreadPoolExecutor(self.jobs) as pool:
            why = list(pool.map(lambda i: self.one(name, i, values), fields))
        self.refuse_copies(name)
        return why

    def refuse_copies(self, name):
        """Errors: RunError where two fields are the same run: what is decided by their scatter would be decided by
        none. Without floes there is none, and that is true of every field."""
        ends = [json.loads(path.read_text()) for path in
                sorted((self.folder / self.subject / name).glob("f*/summary.json"))[:2]]
        first, second = (e.get("state_hash") if e.get("n_floes") else None for e in (ends + [{}, {}])[:2])
        if first is not None and first == second:
            raise RunError(self.case, "two fields with seeds of their own end in the same state: the ice is read, and "
                           "no seed changes it", "let the program make the ice, by removing ice.outlines or ice.field")

    def there(self, name, n, values):
        """Are n runs there now, or could they be made? False where the budget does not reach so far."""
        missing = [i for i in range(n) if not self.kept(name, i, values)]
        expected = self.seconds.get(name, self.seconds.get("case", 0.0)) * -(-len(missing) // self.jobs)
        if missing and time.monotonic() + expected > self.end:
            return False
        why = [w for w in self.make(name, range(n), values) if w]
        if SPENT in why:
            return False
        if why:
            raise RunError(self.path(name, 0), f"a run of {name} failed: {why[0]}",
                           "mend the case" if name == "case" else "leave it out of --vary")
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
    long as it takes). True when all have settled. Errors: RunError where the program refuses the study; a member that
    fails is none, and the others are gathered as ever."""
    call = [str(binary), "ensemble", str(study), "-o", str(folder), "--threads", "1", "--jobs", str(jobs)]
    call += [part for text in sets for part in ("--set", text)]
    if np.isfinite(seconds):
        call += ["--max-wall", f"{max(1.0, seconds):.0f}"]
    before = ensemble_made(folder)
    done = subprocess.run(call + ["--quiet"] * quiet, stderr=subprocess.PIPE, text=True,
                          env=os.environ | {"OMP_NUM_THREADS": "1"})
    if done.returncode not in (0, STOPPED) and ensemble_made(folder) == before:
        said = (done.stderr.strip().splitlines() or [f"bergtow ensemble ended with exit code {done.returncode}"])[0]
        raise RunError(study, said.removeprefix("bergtow: "), "mend the case or the study")
    sys.stderr.write(done.stderr)
    return done.returncode == 0


def whole_from(least, most):
    """Type of a whole number of an option."""
    def number(text):
        if not (text.isdecimal() and least <= int(text) <= most):
            raise argparse.ArgumentTypeError(f"{text} is no whole number from {least} to {most}")
        return int(text)
    return number


def above_zero(text):
    value = float(text)
    if not (np.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text} is not above zero")
    return value


def program():
    """The binary: BERGTOW, or the one built beside this script."""
    path = Path(os.environ.get("BERGTOW") or Path(__file__).resolve().parents[1] / "build/release/bergtow")
    if not os.access(path, os.X_OK):
        raise RunError(path, "no such program", "build it with make, or name it in BERGTOW")
    return path.resolve()


def checked(binary, case, sets, *words):
    """What `bergtow check` prints of a case with keys replaced. Errors: RunError in the program's words."""
    done = subprocess.run([str(binary), "check", str(case), *words, *(w for t in sets for w in ("--set", t))],
                          capture_output=True, text=True)
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ["the case is refused"])[0].removeprefix("bergtow: ")
        raise RunError(case, said, "mend it")
    return done.stdout
