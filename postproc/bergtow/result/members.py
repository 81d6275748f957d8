# SPDX-License-Identifier: MIT
"""Read the folder of an ensemble: its members, the varied keys, summaries, series, collisions and doubts.

    e = Members("out/concentration")
    for c in e.conditions():                       # members of one combination of values
        print(c.label, e.mean[c.finished])
    time, ice = e.series(m)                        # of member m, over its whole run
    e.doubts(m)                                    # {"unconverged", "jammed", ...}

ensemble.h5 holds everything except collisions and most series, which are in the members' folders. It is only read if
its seal is intact. A member whose files do not match the record of its end (result/integrity.py) counts as waiting: it
enters no number until `bergtow ensemble` has run it again. Raises RunError.
"""
import json
import re
from collections import Counter, defaultdict
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import h5py
import numpy as np

from bergtow import _library
from bergtow.errors import RunError
from bergtow.result import at_least, integrity
from bergtow.result.hdf5 import opened, plain
from bergtow.result.run import Run, case_value, least, parse_case, within

WAITING, FINISHED, FAILED = 0, 1, 2
#: s at full scale, five time scales of stats/loads.py: a tow whose line parts earlier in the window has no mean,
#: because its loads shortly before that are the largest of all
LEAST_TOW = 150.0

#: kinds of doubt about a member, with their meanings
DOUBTS = {
    "unconverged": "steps reached the work limit before the tolerance",
    "unbounded": "the load on the body has no bound in some steps of its window: its means and peaks are lower bounds",
    "jammed": "the towed body stood still although the tow demanded motion",
    "unsteady": "its window is not that of a steady tow: a trend, a jam, a change of speed, or unsolved "
                "steps",
    "short": "no window, or one shorter than 40 correlation times of a load or than two swings on the line",
    "few": "the body met no ice in its window, or little: contact worth fewer than 10 equal stretches",
    "stopped": "the run stopped early",
    "other": "a warning of another kind",
}

#: codes of warnings already covered by these, or that say nothing against the numbers (keys without effect, which other
#: conditions of a study need; and a body held back: without such tows the mean of the others is too large); the grounds
#: of a verdict are reasons, not separate warnings
TOLD = {"unconverged", "locked", "stalled", "not_steady", "too_short", "stopped", "idle", "held_back"}

#: doubts that may be used to exclude members: not "met little ice", which would exclude the small means
EXCLUDABLE = sorted(set(DOUBTS) - {"few"})


@dataclass(frozen=True)
class Condition:
    """One combination of the varied values."""

    index: int            #: from 0
    values: dict          #: {key: number or text}
    varied: list          #: keys that differ between conditions; all keys if none differs
    units: dict           #: {key: unit}
    members: np.ndarray   #: rows of all its members
    finished: np.ndarray  #: rows of those that finished with a mean and were not excluded
    failed: int
    waiting: int
    excluded: int

    @property
    def label(self):
        return ", ".join(worded(key, self.values[key], self.units[key]) for key in self.varied) or "the case"


def reading(key, unit):
    """(factor, unit) for printing a key: concentration in %, angles in degrees; unit "" for a plain number."""
    if key == "ice.concentration":
        return 100.0, "%"
    if unit in ("rad", "rad/s"):
        return 180.0 / np.pi, unit.replace("rad", "deg")
    return 1.0, "" if unit == "1" else unit


def worded(key, value, unit, digits=4):
    """"concentration 60 %", "ice size 30 m": a varied value in words; unit: that of the value, "1" or "" for none."""
    if isinstance(value, str):
        return f"{short_key(key)} {value}"
    factor, unit = reading(key, unit)
    return f"{short_key(key)} {factor * value:.{digits}g} {unit}".rstrip()


def short_key(key):
    """Last part of a case key, in words: ice.friction becomes "ice friction", ice.concentration "concentration"."""
    section, _, name = key.rpartition(".")
    plain = name.replace("_", " ")
    return plain if name in ("concentration", "thickness") or section in ("", "run") else \
        f"{section.replace('.', ' ')} {plain}"


@dataclass(frozen=True)
class WithoutBound:
    """Tows of a condition with steps that have no solution, where the load has no bound, and tows that ended because of
    such steps."""

    share: float    #: share of such steps in the windows, averaged over the finished tows
    some: list      #: names of tows with such steps
    ended: list     #: names of tows that guard.no_solution ended, which enter no number
    tows: int       #: number of tows of both kinds and of all others

    def __bool__(self):
        return bool(self.some or self.ended)

    def __str__(self):
        return self.words()

    def words(self, named=False):
        """The number of such tows and the share of such steps; named: with their names."""
        some, ended = (f" ({listed(names)})" if named else "" for names in (self.some, self.ended))
        parts = [f"the load on the body has no bound in some steps of {len(self.some)} of {self.tows} tows{some}, "
                 f"{100 * self.share:.2g} % of the steps of all that finished"] * bool(self.some)
        parts += [f"{len(self.ended)} of {self.tows} tows ended for lack of a solution (guard.no_solution) and enter "
                  f"no statistics{ended}"] * bool(self.ended)
        return "; ".join(parts)


def _rows(f, group, columns):
    """Rows of a table of ensemble.h5. A table without rows does not exist in the file."""
    if group not in f:
        return zip()
    return zip(*(d.asstr()[()] if h5py.check_string_dtype(d.dtype) else d[()]
                 for d in (f[f"{group}/{column}"] for column in columns.split())))


def listed(names, most=8):
    """A list of names, cut off after the first few."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


class Members:
    """An ensemble's folder. parameters, summary: {name: array [M]}; name, condition, repeat, seed, status, reason,
    hole: [M]; unsound: {name: why}."""

    def __init__(self, path):
        self.path = Path(path)
        self.file = self.path / "ensemble.h5"
        if not self.path.is_dir():
            raise RunError(self.path, "no such folder", "give the folder that `bergtow ensemble -o` wrote")
        if not self.file.exists():
            raise RunError(self.path, "holds no ensemble.h5",
                           "give the folder that `bergtow ensemble -o` wrote, or run it again")
        try:
            self._read()
            self.unsound = self._unsound()
        except (OSError, KeyError, ValueError, RuntimeError) as error:
            raise RunError(self.file, f"is not an ensemble ({str(error).splitlines()[0]})",
                           "run `bergtow ensemble` again: it makes the file again") from None
        self._dropped = {}

    def _read(self):
        remedy = "run `bergtow ensemble` again: it makes the file again"
        integrity.check_seal(self.file, "ensemble", remedy)
        with opened(self.file, remedy) as f:
            self.attributes = dict(f.attrs)
            for key in ("id", "condition", "repeat", "seed", "status"):
                setattr(self, key, f[f"members/{key}"][()])
            self.name, self.reason, self.hole = (list(f[f"members/{key}"].asstr()[()])
                                                 for key in ("name", "reason", "hole"))
            self._warnings, self._reasons = (self._notes(f, group) for group in ("warnings", "reasons"))
            self._meanings = dict(zip(*(f[f"codes/{key}"].asstr()[()] for key in ("code", "meaning"))))
            self._events = defaultdict(list)
            for member, time, kind, subject, value in _rows(f, "events", "member time kind subject value"):
                self._events[int(member) - 1].append(
                    {"time_s": float(time), "kind": str(kind), "subject": int(subject), "value": float(value)})
            self.parameters, self.units, self.assumed = {}, {}, {}
            for key, data in f["parameters"].items():
                self.assumed[key] = {word: plain(data.attrs.get(word, b"")) for word in ("distribution", "source")}
                self.parameters[key] = data[()] if data.dtype.kind == "f" else np.array(data.asstr()[()], dtype=object)
                self.units[key] = plain(data.attrs.get("units", "1"))
            self.state = list(f["members/state_hash"].asstr()[()])
            self.summary = {key: data[()] for key, data in f["summary"].items()}
            self.meaning = {key: {k: plain(v) for k, v in data.attrs.items()} for key, data in f["summary"].items()}
            self._series = {key: data[()] for key, data in f["series"].items()}
            #: {series: (label, units, description)}
            self.described = {key: (plain(data.attrs.get("label", "")) or key.replace("_", " "), *(
                plain(data.attrs.get(what, "")) for what in ("units", "description")))
                              for key, data in f["series"].items()}
            self.study = f["study_resolved" if "study_resolved" in f else "study"][()]
        self.study = plain(self.study)
        self.n = len(self.name)
        self.title = plain(self.attributes.get("title", b"")) or self.path.resolve().name

    @staticmethod
    def _notes(f, group):
        """{row of the member: its warnings or reasons, in the format of Run.warnings}"""
        out = defaultdict(list)
        for member, code, text, values in _rows(f, group, "member code text values"):
            out[int(member) - 1].append({"code": code, "text": text, "values": json.loads(values) or {}})
        return out

    def _unsound(self):
        """{name: why} of members whose results are incomplete or damaged; from here on they count as waiting."""
        out = {self.name[m]: self.reason[m].strip() for m in np.flatnonzero(self.status == WAITING)
               if self.hole[m] in ("unsound", "unreadable")}
        for m in np.flatnonzero(self.status == FINISHED):
            folder = self.folder(m)
            if folder.is_dir() and (why := integrity.fault_of_member(folder, self.name[m], self.study.encode())):
                out[self.name[m]] = why
                self.status[m], self.reason[m], self.hole[m] = WAITING, f"its result is not sound: {why}", "unsound"
        return out

    def number(self, key, m):
        """A number from a member's summary, NaN if there is none."""
        return float(self.summary[key][m]) if key in self.summary else np.nan

    @cached_property
    def estimates(self):
        """{name: {"label", "on_top"}} of the estimates in the members' summaries, in the order of the program's
        registry."""
        some = [self.meaning[key] for key in self.summary if key.startswith("estimates_") and key.endswith("_force_n")]
        return {m["estimate"]: {"label": m["label"], "on_top": m["kind"] == "on top"}
                for m in sorted(some, key=lambda m: int(m.get("order", 0)))}

    @property
    def complete(self):
        return bool(np.all(self.status != WAITING))

    @cached_property
    def sampled(self):
        """True for a Latin hypercube, False for a grid."""
        return "sampling: latin-hypercube" in self.study.split("# base case")[0]

    @cached_property
    def base(self):
        """{key: text} of the base case of a Latin hypercube, without varied keys whose value there is outside their
        range; {} of a grid, which has the values that it names."""
        study, _, case = self.study.partition("# base case")
        base = parse_case(case.partition("\n")[2]) if self.sampled else {}
        def inside(key):
            some = self.parameters[key]
            if some.dtype.kind != "f":
                return base[key] in some
            ends = re.search(rf"^{re.escape(key)}: .*from (\S+) to (\S+),", study, re.MULTILINE)
            ends = [*some, *(map(float, ends.groups()) if ends else ())]
            slack = 1e-9 * np.abs(ends).max()
            return min(ends) - slack <= case_value(base, key) <= max(ends) + slack
        return {key: text for key, text in base.items() if key not in self.parameters or inside(key)}

    # ---- members

    def folder(self, m):
        return self.path / "members" / self.name[m]

    def each(self, rows, measure):
        """Yield measure(run) for these members, one after the other; those that cannot be read are left out."""
        for m in rows:
            try:
                with Run(self.folder(m)) as run:
                    found = measure(run)
            except RunError:
                continue
            yield found

    def series(self, m, name="ice_resistance"):
        """(time s, values) of a series over a member's whole run; steps without a load by least() of result/run.py."""
        time, x = (self._series[key][m] for key in ("time", name))
        there = np.isfinite(time)
        x = x[there]
        return time[there], least(x) if self.number("no_load_steps", m) > 0 else x

    def steady(self, m):
        """Ice resistance over the window of a member's tow, N; empty without a window."""
        time, ice = self.series(m)
        start, end = self.window(m, time)
        return ice[within(time, start, end)] if np.isfinite([start, end]).all() else np.zeros(0)

    # ---- the tow

    def adrift(self, m):
        """The time from which nothing tows the body of a member, s; inf if it is towed to the end."""
        return min((v["time_s"] for v in self.events(m) if v["kind"] == "adrift"), default=np.inf)

    def cut(self, m):
        """Does a member's tow end before the end of the window in its summary? If so, the summary's numbers over the
        window do not describe a tow."""
        return self.adrift(m) < self.number("window_end_s", m)

    def window(self, m, time):
        """(start, end) of the part of that window in which the body is towed, s, for samples that end at `time`: the
        end of the first sample without any step before it, and of the last sample; NaN if the summary has no window."""
        start, end, dt = (self.number(key, m) for key in ("window_start_s", "window_end_s", "dt_s"))
        late = np.median(np.diff(time)) - dt if len(time) > 1 and np.isfinite(dt) else 0.0
        return start + late, min(end, self.adrift(m))

    def scaling(self, m):
        """Time at full scale / time of a member: the square root of the member's length scale."""
        scale = self.number("estimates_length_scale", m)
        return float(np.sqrt(scale)) if scale > 0 else 1.0

    @cached_property
    def mean(self):
        """Mean ice resistance of each member's tow in its window [M], N; NaN if it has none."""
        out = np.array(self.summary.get("mean_ice_resistance_n", np.full(self.n, np.nan)), dtype=float)
        for m in np.flatnonzero((self.status == FINISHED) & np.isfinite(out)):
            if self.cut(m):
                long = self.adrift(m) - self.number("window_start_s", m) >= LEAST_TOW / self.scaling(m)
                x = self.steady(m) if long else []
                out[m] = np.mean(x) if len(x) else np.nan
        return out

    def warnings(self, m):
        """[{"code", "text", "values"}] of a member: codes and values for programs, texts for readers."""
        return self._warnings[int(m)]

    def why_unsteady(self, m):
        """The meaning of the first reason for a member's verdict: a code always gives the same words."""
        codes = [reason["code"] for reason in self._reasons[int(m)]]
        return self._meanings.get(codes[0], codes[0]) if codes else "its result does not say why"

    def events(self, m):
        """Events in a member's run, in the format of Run.events."""
        return self._events[int(m)]

    @cached_property
    def _doubts(self):
        verdicts, independent_least, stretches_least = (_library.limit(name) for name in (
            "verdicts", "window_independent", "window_contact_stretches"))
        out = {}
        for m in np.flatnonzero(self.status == FINISHED):
            codes = {warning["code"] for warning in self.warnings(m)}
            verdict, independent = (self.number(key, m) for key in ("window_verdict", "window_n_independent"))
            short = verdict == verdicts.index("too short") or np.isnan(verdict) and not independent >= independent_least
            few = self.number("window_n_contact_stretches", m) < stretches_least
            checks = {
                "unconverged": self.number("unconverged_steps", m) > 0,
                "unbounded": self.number("window_no_load_share", m) > 0,
                "jammed": self.number("stalled_windows", m) > 0,
                "unsteady": verdict == verdicts.index("not steady"), "short": short and not few, "few": few,
                "stopped": "stopped" in codes, "other": bool(codes - TOLD)}
            out[int(m)] = {kind for kind, there in checks.items() if there}
        return out

    def doubts(self, m):
        """Kinds of doubt (keys of DOUBTS) about a finished member."""
        return self._doubts.get(int(m), set())

    @cached_property
    def behind(self):
        """Members that have finished since ensemble.h5 was written."""
        return [name for name in self.waiting if (self.path / "members" / name / "finished").exists()]

    def reasons(self, status):
        """{name: why} of the failed members, or of waiting members whose process died."""
        return {self.name[m]: self.reason[m].strip() or "no reason recorded"
                for m in np.flatnonzero(self.status == status)
                if (self.reason[m] or status == FAILED) and self.name[m] not in self.unsound}

    @cached_property
    def without_folder(self):
        """Finished members whose folder is missing, so that their collisions are unknown."""
        return [name for name in self._named(self.status == FINISHED) if not (self.path / "members" / name).is_dir()]

    @property
    def without_mean(self):
        """Finished members without a mean ice resistance."""
        return self._named((self.status == FINISHED) & ~np.isfinite(self.mean))

    @property
    def waiting(self):
        """Members that have not been run yet."""
        return [name for name in self._named(self.status == WAITING) if name not in self.unsound]

    def _named(self, there):
        return [self.name[m] for m in np.flatnonzero(there)]

    def holes(self):
        """A sentence on members of the study that are missing from the numbers although nobody excluded them; "" if
        there are none."""
        kinds = (("not sound", list(self.unsound)), ("waiting", self.waiting),
                 ("failed", self._named(self.status == FAILED)), ("without a mean", self.without_mean))
        parts = [f"{len(names)} {kind} ({listed(names)})" for kind, names in kinds if names]
        return (f"{sum(len(names) for _, names in kinds)} of {self.n} members enter no statistics: {', '.join(parts)}"
                if parts else "")

    def exclude(self, kinds):
        """Leave out members with these doubts from here on; returns {name: kinds} of those dropped."""
        self._dropped |= {m: doubts & set(kinds) for m, doubts in self._doubts.items() if doubts & set(kinds)}
        return {self.name[m]: sorted(hit) for m, hit in self._dropped.items()}

    @cached_property
    def copies(self):
        """{name: name of the other} of finished members that ended in exactly the same state as an earlier one of their
        condition: they are not separate fields, whatever their seeds."""
        first, out = {}, {}
        for m in np.flatnonzero(self.status == FINISHED):
            other = first.setdefault((int(self.condition[m]), self.state[m] or self.name[m]), self.name[m])
            if other != self.name[m]:
                out[self.name[m]] = other
        return out

    @property
    def used(self):
        """Rows of members that finished with a mean, are not excluded, and are not copies."""
        return np.array([m for m in np.flatnonzero((self.status == FINISHED) & np.isfinite(self.mean))
                         if int(m) not in self._dropped and self.name[m] not in self.copies], dtype=int)

    @cached_property
    def builds(self):
        """A sentence on members of different builds, or of one that cannot be reproduced; "" if there are none."""
        builds, said = Counter(self.each(np.flatnonzero(self.status == FINISHED), lambda run: tuple(
            run.attributes.get(k) for k in ("version", "revision", "compiler", "flags")))), []
        if len(builds) > 1:
            of = "; ".join(f"revision {build[1] or 'unknown'}: {n}" for build, n in builds.items())
            said.append(f"The members come from {len(builds)} builds of the program, which may differ in the last bits "
                        f"({of}).")
        if any("-dirty" in str(build[1]) for build in builds):
            said.append("The program was built from sources with uncommitted changes: its results cannot be reproduced "
                        "from the revision alone.")
        return " ".join(said)

    def conditions(self):
        """Every Condition, in the order of the study."""
        used, out = set(self.used.tolist()), []
        varied = [key for key, column in self.parameters.items() if len(set(column.tolist())) > 1]
        for index in np.unique(self.condition):
            rows = np.flatnonzero(self.condition == index)
            first = rows[0]
            values = {key: (str(column[first]) if column.dtype == object else float(column[first]))
                      for key, column in self.parameters.items()}
            out.append(Condition(int(index), values, varied or list(values), self.units, rows,
                                 np.array([m for m in rows if m in used], dtype=int),
                                 *(int(np.sum(self.status[rows] == kind)) for kind in (FAILED, WAITING)),
                                 sum(int(m) in self._dropped for m in rows)))
        return out

    def tows(self, rows, excluded=True):
        """Rows, each once, of all finished members of the conditions of `rows`, with a mean or not; excluded: include
        excluded members."""
        there = np.isin(self.condition, self.condition[rows]) & (self.status == FINISHED)
        return np.array([m for m in np.flatnonzero(there) if self.name[m] not in self.copies
                         and (excluded or int(m) not in self._dropped)], dtype=int)

    def without_bound(self, rows):
        """WithoutBound for the conditions of these rows. Excluded tows, and tows that ended because of such steps,
        count: without them the mean would be that of the tows that the ice let pass."""
        tows = self.tows(rows)
        shares = np.nan_to_num([self.number("window_no_load_share", m) for m in tows])
        ended = [self.name[m] for m in np.flatnonzero(np.isin(self.condition, self.condition[rows]))
                 if self.hole[m] == at_least.ENDED]
        return WithoutBound(float(shares.mean()) if len(tows) else np.nan,
                            [self.name[m] for m, x in zip(tows, shares) if x > 0], ended, len(tows) + len(ended))

    def impacts(self, m):
        """Collisions of a member's tow in its window: (time s, peak N, its start s, hours, conversion), or None without
        a window or if collisions were not recorded separately."""
        hours, start, end = (self.number(key, m) for key in ("impacts_hours", "impacts_from_s", "window_end_s"))
        if self.cut(m):
            hours, end = hours - (end - self.adrift(m)) / 3600, self.adrift(m)
        if not hours > 0 or not self.folder(m).is_dir():
            return None
        with Run(self.folder(m)) as run:
            hits = run.impacts
        late = (hits["time"] >= start) & ~(hits["time"] > end)
        return hits["time"][late], hits["peak"][late], start, hours, hits["conversion"]
