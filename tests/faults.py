# SPDX-License-Identifier: MIT
"""Faults at the n-th call of the system on the files of a result, and what must be true after each.

A scenario is a command on a folder in a known state. `calls_of` counts its calls; `strike` makes it again with one of
them failing, and holds what is left against the contract: an exit code of the program's, a message with path and
remedy, and then one call without a fault that ends with the state of the run that nothing disturbed."""
import collections
import errno
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess

import h5py

from harness import BERGTOW, DONE, FAULT, IO, NUMERIC, RANK, SIGNAL, changed, environment, launcher, write_case

CALLS = FAULT.with_name("calls.so")  # tests/fault/calls.c
MEMORY = FAULT.with_name("memory.so")  # tests/fault/memory.c
HANGS = 60  # seconds after which a run of a tenth of one hangs

# Two checkpoints on the way, collisions, panels; as few floes and frames as show that.
CASE = {
    "run": {"dt": 0.1, "duration": 3},
    "domain": {"length": 8, "width": 6},
    "ice": {"concentration": 0.5, "size": 0.7, "thickness": 0.04, "friction": 0.3},
    "body": {"x": 3, "length": 2, "draft": 0.5},
    "tow": {"speed": 0.3, "ramp": 1},
    "output": {"frame_interval": 3, "checkpoint_steps": 10, "panels": True},
}
OTHER = changed(CASE, ice__friction=0.1)

WRITES = ("write", "pwrite64", "writev")
NAMES = ("openat", "open", "mkdir", "mkdirat", "rename", "renameat", "unlink", "unlinkat", "rmdir")
SYNCS = ("fsync", "fdatasync")
LOCKS = ("flock", "fcntl")
# fault -> what the shim is told, and the calls it can befall
FAULTS = {
    "full disk": ({"BT_CALLS_WITH": errno.ENOSPC, "BT_CALLS_ON": 1},
                  WRITES + SYNCS + ("ftruncate", "mkdir", "mkdirat")),
    "ENOSPC": ({"BT_CALLS_WITH": errno.ENOSPC}, WRITES + SYNCS + NAMES + ("ftruncate", "close")),
    "EIO": ({"BT_CALLS_WITH": errno.EIO}, WRITES + SYNCS + NAMES + ("ftruncate", "close", "read", "pread64")),
    "EINTR": ({"BT_CALLS_WITH": errno.EINTR},
              WRITES + SYNCS + ("openat", "open", "ftruncate", "close", "read", "pread64")),
    "short": ({"BT_CALLS_WITH": "short"}, WRITES),
    "kill": ({"BT_CALLS_SIGNAL": signal.SIGKILL.value}, WRITES + SYNCS + NAMES + ("ftruncate", "close")),
    # before the handlers of a run are set SIGTERM ends the program as a kill does; SIGUSR1 never does
    "SIGTERM": ({"BT_CALLS_SIGNAL": signal.SIGTERM.value}, WRITES + SYNCS + NAMES + ("ftruncate", "close")),
    "SIGUSR1": ({"BT_CALLS_SIGNAL": signal.SIGUSR1.value}, WRITES + SYNCS + NAMES + ("ftruncate", "close")),
    "EAGAIN": ({"BT_CALLS_WITH": errno.EAGAIN}, ("posix_spawn", )),
}

Call = collections.namedtuple("Call", "name path second result")


def shim(under, **more):
    return environment(OMP_NUM_THREADS=1, BERGTOW_STARTED=1, LD_PRELOAD=CALLS, BT_CALLS_UNDER=under, **more)


def started(words, env, cwd=None):
    """Killed with all below it when it hangs: that is a failure of its own."""
    p = subprocess.Popen([str(w) for w in words], env=env, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                         text=True, start_new_session=True)
    try:
        out, err = p.communicate(timeout=HANGS)
    except subprocess.TimeoutExpired:
        os.killpg(p.pid, signal.SIGKILL)
        out, err = p.communicate()
        return subprocess.CompletedProcess(words, "hangs", out, err)
    return subprocess.CompletedProcess(words, p.returncode, out, err)


def plain(*words):
    return started([BERGTOW, *words], environment(OMP_NUM_THREADS=1))


def logged(path):
    if not path.exists():
        return []
    lines = (line.split("\t") for line in path.read_text().splitlines())
    return [Call(w[0], w[1], w[2], int(w[3])) for w in lines]


def state_hash(folder):
    """Of a result that is whole; what the summary says is held against the files."""
    summary = json.loads((folder / "summary.json").read_text())
    with h5py.File(folder / "result.h5") as f:
        assert f.attrs["complete"] == 1 and len(f["series/time"]) == summary["n_steps"]
        assert len(f["frames/time"]) == (folder / "frames.xdmf").read_text().count('CollectionType="Spatial"')
    return summary["state_hash"]


def checkpoint_step(folder):
    """Of the newest checkpoint that is whole, −1 without one."""
    result = plain("diff", folder / "checkpoint.h5") if (folder / "checkpoint.h5").exists() else None
    if result is None or result.returncode != DONE:
        if not (folder / "checkpoint.previous.h5").exists():
            return -1
        result = plain("diff", folder / "checkpoint.previous.h5")
        assert result.returncode == DONE, result.stderr
    return int(re.search(r"world/step +int64 +(\d+)", result.stdout).group(1))


def not_durable(log):
    """What of a log could be lost with the power: bytes, names and removals that are not in the order of durability."""
    faults, dirty, names = [], {}, {}  # file -> call that has changed it; folder -> name that has come into it
    for c in log:
        folder = os.path.dirname(c.second or c.path)
        if c.result < 0:
            continue
        if c.name in WRITES or c.name == "ftruncate":
            dirty[c.path] = c
        elif c.name in SYNCS:
            dirty.pop(c.path, None)
            names.pop(c.path, None)
        elif c.name.startswith("rename") or c.name.startswith("unlink"):
            faults += [f"{n} is not in {f} for good when {c.path} goes" for f, n in names.items()]
        if c.name.startswith("rename"):
            if c.path in dirty:
                faults.append(f"{c.path} becomes {c.second} before its bytes are on the disk")
            names[folder] = c.second
        elif c.name.startswith("mkdir"):
            names[folder] = c.path
        elif c.name.startswith("unlink"):
            dirty.pop(c.path, None)
    faults += [f"{f} is not on the disk in the end" for f in dirty if not f.endswith("run.lock")]
    faults += [f"{n} is not in {f} for good in the end" for f, n in names.items()]
    return faults


def says_what_to_do(result, folder):
    """A message names a file of the folder, the reason, and what to do about it."""
    assert re.search(rf"bergtow: [^\n]*{re.escape(str(folder))}[^\n]*: [^\n]*; [^\n]+", result.stderr), result.stderr


class Scenario:
    """prepare leaves the folder as the command finds it, once; `whole` is the state it must end with."""
    codes, stopped = (IO, ), False
    outlives = False  # others do what a process that is killed leaves

    def __init__(self, base):
        self.base = pathlib.Path(base) / self.name.replace(" ", "-")
        self.base.mkdir(parents=True)
        self.start, self.folder = self.base / "start", self.base / "work"
        self.start.mkdir()
        self.prepare(self.start)

    def fresh(self):
        shutil.rmtree(self.folder, ignore_errors=True)
        shutil.copytree(self.start, self.folder)
        for name in "log", "log.other":
            (self.base / name).unlink(missing_ok=True)

    def launch(self, env):
        return started([BERGTOW, *self.command()], env)

    def calls_of(self):
        """The calls of the undisturbed command."""
        self.fresh()
        result = self.launch(shim(self.folder, BT_CALLS_LOG=self.base / "log"))
        assert result.returncode == DONE, result.stderr
        self.check_done()
        return logged(self.base / "log")

    def strike(self, fault, calls, n):
        """The n-th of these calls meets the fault; the outcome in a word."""
        self.fresh()
        what = FAULTS[fault][0]
        result = self.launch(shim(self.folder, BT_CALLS_LOG=self.base / "log", BT_CALLS=",".join(calls), BT_CALLS_AT=n,
                                  **what))
        number, self.stopped = what.get("BT_CALLS_SIGNAL", 0), result.returncode == SIGNAL
        if result.returncode == DONE and (fault != "kill" or self.outlives):
            self.check_done()
            self.check_words(fault, result)
            return "done"
        assert fault not in ("EINTR", "short", "SIGUSR1", "EAGAIN"), f"{fault} is not made good: {result.stderr}"
        if result.returncode == SIGNAL and fault == "SIGTERM":
            assert re.search(r"stopped.* continues", result.stderr), result.stderr
        elif fault in ("kill", "SIGTERM"):
            assert result.returncode in (-number, 128 + number), (result.returncode, result.stderr)
        else:
            assert result.returncode in self.codes, (result.returncode, result.stderr)
            says_what_to_do(result, self.folder)
        self.check_kept(logged(self.base / "log"))
        return self.recover()

    def check_words(self, fault, result):
        """What is said of a fault that is made good."""

    def requests(self):
        """How often the undisturbed command asks for memory."""
        self.fresh()
        log = self.base / "memory"
        env = shim(self.folder, BT_MEMORY_LOG=log) | {"LD_PRELOAD": f"{CALLS} {MEMORY}"}
        assert self.launch(env).returncode == DONE
        return int(log.read_text())

    def starve(self, n):
        """The n-th request for memory is refused; the outcome in a word."""
        self.fresh()
        preload = f"{CALLS} {MEMORY}"
        env = shim(self.folder, BT_CALLS_LOG=self.base / "log", BT_MEMORY_AT=n) | {"LD_PRELOAD": preload}
        result = self.launch(env)
        if result.returncode == DONE:
            self.check_done()
            return "done"
        assert result.returncode in (IO, NUMERIC), (result.returncode, result.stderr)
        assert re.search(r"bergtow: .*: (out of|Cannot allocate) memory|bergtow: out of memory: .*; ", result.stderr), \
            result.stderr
        self.check_kept(logged(self.base / "log"))
        return self.recover()


class FreshRun(Scenario):
    name = "run"

    def prepare(self, start):
        self.case = write_case(self.base, CASE)
        result = plain("run", self.case, "-o", self.base / "whole", "--quiet")
        assert result.returncode == DONE, result.stderr
        self.whole = state_hash(self.base / "whole")

    def command(self):
        return "run", self.case, "-o", self.folder / "out", "--quiet"

    def check_done(self):
        assert state_hash(self.folder / "out") == self.whole

    def check_kept(self, log):
        """A checkpoint that got its name is still there; the one at a stop is of any step."""
        renamed = [c for c in log if c.name.startswith("rename") and c.result == 0]
        stood = sum(c.path.endswith("/checkpoint.h5.tmp") for c in renamed) - self.stopped
        assert stood <= 0 or checkpoint_step(self.folder / "out") >= 10 * min(stood, 3), "a checkpoint is lost"

    def recover(self):
        begun = (self.folder / "out/case.resolved.yml").exists()
        result = plain(*(("resume", self.folder / "out", "--quiet") if begun else self.command()))
        assert result.returncode == DONE, result.stderr
        self.check_done()
        return "resumed" if begun else "again"


class Resume(FreshRun):
    name = "resume"

    def prepare(self, start):
        super().prepare(start)
        result = plain("run", self.case, "-o", start / "out", "--quiet", "--steps", 15)
        assert result.returncode == DONE, result.stderr

    def command(self):
        return "resume", self.folder / "out", "--quiet"

    def check_kept(self, log):
        assert checkpoint_step(self.folder / "out") >= 15, "a checkpoint is lost"


class Force(FreshRun):
    """An old result in the folder, and another case: after a fault one of the two is whole."""
    name = "run --force"

    def prepare(self, start):
        super().prepare(start)
        shutil.copytree(self.base / "whole", start / "out")
        self.old = self.whole
        self.case = write_case(self.base, OTHER, "other.yml")
        result = plain("run", self.case, "-o", self.base / "other", "--quiet")
        assert result.returncode == DONE, result.stderr
        self.whole = state_hash(self.base / "other")

    def command(self):
        return "run", self.case, "-o", self.folder / "out", "--quiet", "--force"

    def check_done(self):
        super().check_done()
        assert not (self.folder / "out/replaced").exists() or state_hash(self.folder / "out/replaced") == self.old

    def check_kept(self, log):
        out = self.folder / "out"
        stood = any(c.name.startswith("rename") and c.result == 0 and c.path.endswith("checkpoint.h5.tmp") for c in log)
        if stood:
            return super().check_kept(log)
        parts = {}  # in one place or the other, while it is moved
        for name in "case.resolved.yml", "summary.json", "result.h5", "frames.xdmf", "checkpoint.h5":
            places = [p for p in (out / "replaced" / name, out / name) if p.exists()]
            assert places, f"{name} of the old result is lost"
            parts[name] = places[0].read_bytes()
        for name, text in parts.items():
            assert text == (self.start / "out" / name).read_bytes(), f"{name} of the old result is changed"

    def recover(self):
        result = plain("resume", self.folder / "out", "--quiet")
        assert result.returncode == DONE, result.stderr
        now = state_hash(self.folder / "out")
        assert now in (self.old, self.whole)
        assert not (self.folder / "out/replaced").exists()
        return "old stays" if now == self.old else "resumed"


class Field(Scenario):
    """A field in place of an older one."""
    name, output = "field", "field.h5"

    def prepare(self, start):
        self.case = write_case(self.base, CASE)
        path = write_case(self.base, changed(CASE, ice__seed=7), "old.yml")
        for case, to in (self.case, self.base), (path, start):
            result = plain("field", case, "-o", to / self.output)
            assert result.returncode == DONE, result.stderr
        self.made, self.old = ((f / self.output).read_bytes() for f in (self.base, start))

    def command(self):
        return "field", self.case, "-o", self.folder / self.output

    def check_done(self):
        assert (self.folder / self.output).read_bytes() == self.made

    def check_kept(self, log):
        assert (self.folder / self.output).read_bytes() in (self.old, self.made)

    def recover(self):
        result = plain(*self.command())
        assert result.returncode == DONE, result.stderr
        self.check_done()
        return "old stays"


class FieldText(Field):
    name, output = "field to GeoJSON", "field.geojson"


class Contacts(FreshRun):
    name = "run --dump-contacts"

    def prepare(self, start):
        super().prepare(start)
        self.case = write_case(self.base, changed(CASE, output__checkpoint_steps=0, output__panels=False))

    def command(self):
        return ("run", self.case, "-o", self.folder / "out", "--quiet", "--dump-contacts",
                f"20:{self.folder / 'contacts.h5'}")

    def check_done(self):
        super().check_done()
        with h5py.File(self.folder / "contacts.h5") as f:
            assert "fclib_local" in f

    def check_kept(self, log):
        if (self.folder / "contacts.h5").exists():
            with h5py.File(self.folder / "contacts.h5") as f:
                assert "fclib_local" in f

    def recover(self):
        result = plain(*self.command(), "--force")
        assert result.returncode == DONE, result.stderr
        self.check_done()
        return "again"


class Ensemble(Scenario):
    name, members, dt = "ensemble", 3, 0.1

    def prepare(self, start):
        case = changed(CASE, run__dt=self.dt, output__checkpoint_steps=20, output__panels=False)
        write_case(self.base, case, "base.yml")
        self.study = self.base / "study.yml"
        self.study.write_text(json.dumps({"base": "base.yml", "repeats": self.members}))
        result = plain("ensemble", self.study, "-o", self.base / "whole", "--threads", 1)
        assert result.returncode == DONE, result.stderr
        self.whole = self.hashes(self.base / "whole")
        assert len(set(self.whole)) == self.members

    def command(self):
        return "ensemble", self.study, "-o", self.folder / "out", "--threads", 1, "--quiet"

    def hashes(self, folder):
        with h5py.File(folder / "ensemble.h5") as f:
            assert f.attrs["complete"] == 1 and f.attrs["n_finished"] == self.members
            return [h.decode() for h in f["members/state_hash"][:]]

    def check_done(self):
        assert self.hashes(self.folder / "out") == self.whole

    def check_kept(self, log):
        """A member that was finished is so still, with the bytes it had."""
        for c in log:
            if c.name.startswith("rename") and c.result == 0 and c.second.endswith("/finished"):
                assert state_hash(pathlib.Path(c.second).parent) in self.whole

    def recover(self):
        result = plain(*self.command())
        assert result.returncode == DONE, result.stderr
        self.check_done()
        return "again"


class Jobs(Ensemble):
    """Two processes share the members, long enough that each has some; the one that was called meets the fault. What
    the other does then is over, too, when the pipes that both write to are closed."""
    name, members, dt, struck, outlives = "ensemble, 2 jobs", 4, 0.02, "first", True

    def command(self):
        return *super().command(), "--jobs", 2

    def launch(self, env):
        return super().launch(env | {"BT_CALLS_IN": self.struck})

    def calls_of(self):
        made = super().calls_of()
        for log in made, logged(self.base / "log.other"):
            assert any(c.name.startswith("rename") and c.second.endswith("/finished") for c in log)
        return made

    def check_kept(self, log):
        super().check_kept(log + logged(self.base / "log.other"))

    def check_words(self, fault, result):
        if fault == "EAGAIN":
            assert re.search("warning: job 2 of 2 could not be started: [^;]*; .*--jobs", result.stderr), result.stderr


class OtherJob(Jobs):
    """The process that it has started meets it: the call itself does all that one leaves, and says so."""
    name, struck = "ensemble, 2 jobs, the second", "job"

    def check_words(self, fault, result):
        if any(c.name == "killed" for c in logged(self.base / "log")):
            assert re.search(r"warning: job 2 of 2 was ended by signal 9[^;]*; .*members", result.stderr), result.stderr


class Ranks(FreshRun):
    """Two ranks, one of which meets the fault."""
    name, struck = "2 ranks", 0

    def launch(self, env):
        rank = f'[ "{RANK}" = {self.struck} ] || unset LD_PRELOAD; exec "$0" "$@"'
        preload = f"export LD_PRELOAD={CALLS}; "
        env = {k: v for k, v in env.items() if k != "LD_PRELOAD"}
        words = [*launcher(2), "sh", "-c", preload + rank, BERGTOW, *self.command()]
        return started(words, env)


class OtherRank(Ranks):
    name, struck = "2 ranks, the second", 1


class ForceOnRanks(Ranks, Force):
    """The other rank holds no name of the old result, so that the first alone is struck."""
    name = "run --force, 2 ranks"


SCENARIOS = {s.name: s for s in (FreshRun, Resume, Force, Field, FieldText, Contacts, Ensemble, Jobs, OtherJob, Ranks,
                                 OtherRank, ForceOnRanks)}


def numbers(n, most):
    """1 to n, or so many of them from the first to the last, evenly."""
    return range(1, n + 1) if n <= most else sorted({1 + round(i * (n - 1) / (most - 1)) for i in range(most)})


def campaign(scenario, faults, most):
    """Every fault at the calls of a scenario, at most so many n of each name: (fault, name) -> Counter of outcomes."""
    made = scenario.calls_of()
    table, failures = {}, []
    for fault in faults:
        for name in sorted({c.name for c in made} & set(FAULTS[fault][1])):
            counter = table.setdefault((fault, name), collections.Counter())
            for n in numbers(sum(c.name == name for c in made), most):
                try:
                    counter[scenario.strike(fault, (name, ), n)] += 1
                except (AssertionError, OSError, KeyError) as e:
                    counter["FAILED"] += 1
                    failures.append(f"{scenario.name}: {fault} at {name} {n}: {str(e)[:1500]}")
    return table, failures


def chosen(made, most):
    """So many (fault, call, n), evenly among all of them; a call that is made a thousand times counts as twenty."""
    count = collections.Counter(c.name for c in made)
    every = [(fault, name, n) for fault, (_, befalls) in FAULTS.items() for name in sorted(count) if name in befalls
             for n in numbers(count[name], 20)]
    return [every[k - 1] for k in numbers(len(every), most)]


def printed(name, table):
    """Fault × call × outcome as text."""
    outcomes = sorted({o for c in table.values() for o in c})
    lines = [f"{name:24}{'call':12}" + "".join(f"{o:>12}" for o in outcomes)]
    for (fault, call), counter in table.items():
        lines.append(f"{fault:24}{call:12}" + "".join(f"{counter[o] or '-':>12}" for o in outcomes))
    return "\n".join(lines)
