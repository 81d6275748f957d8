# SPDX-License-Identifier: MIT
"""Read the output folder of a bergtow run: summary, series, frames, bodies and the case.

    run = Run("out/basin-80")
    run.summary["mean_ice_resistance_n"]       # numbers of summary.json
    t, f = run["time"], run["ice_resistance"]  # series as float64 arrays [S]
    run.units("ice_resistance")                # "N"
    for outline in run.polygons(0):            # floes of frame 0, each [n, 2] m in the world frame
        ...

Lengths are in m, times in s, forces in N, angles in rad. Everything is read on first use and cached, except frames,
which are read one at a time. A folder that cannot be used raises RunError, whose text names the path, the reason and
the remedy.
"""
import json
import re
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import yaml

from bergtow.errors import RunError
from bergtow.result import at_least, integrity
from bergtow.result.frames import Frames
from bergtow.result.hdf5 import first_line, opened, plain

#: share of the ordered speed by which the speed made good may differ from it and still count as reached, assumed
SLOWER = 0.05


def within(time, start, end):
    """[n] of bool: samples that end between two times, inclusive. A last sample with fewer steps than the others, left
    by a run that ended within it, is excluded."""
    slack = 1e-9 * max(1.0, abs(time[-1])) if len(time) else 0.0
    there = (time >= start - slack) & (time <= end + slack)
    if len(time) > 2 and time[-1] - time[-2] < (1 - 1e-6) * (time[-2] - time[-3]):
        there[-1] = False
    return there


def least(x):
    """Fill a load that is NaN in some steps (no_load) with the last number before each, 0 at the start. The load has no
    bound there, so means and peaks of the result are lower bounds. A load without any numbers is returned unchanged.
    x: [n], or [n, panels]."""
    there = np.isfinite(x).reshape(len(x), -1).all(axis=1)
    if there.all() or not there.any():
        return x
    last = np.maximum.accumulate(np.where(there, np.arange(len(x)), -1))
    filled = x[np.maximum(last, 0)]
    filled[last < 0] = 0.0
    return filled


def notes(found):
    """Warnings or reasons of a summary, [{"code", "text", "values"}]; entries of other forms are dropped."""
    return [{"code": str(note.get("code")), "text": str(note.get("text", "")), "values": note.get("values") or {}}
            for note in (found if isinstance(found, list) else ()) if isinstance(note, dict)]


class Numbers(dict):
    """An object in summary.json. Raises RunError for a missing key."""

    def __init__(self, path, found):
        super().__init__(found)
        self.file = path

    def __missing__(self, key):
        raise RunError(self.file, f"has no {key}", "the file is damaged, or of another version: run the case again")


def parse_case(text):
    """The values of a case file as {"section.key": text}, lists on one line; floes given by hand are left out."""
    out = {}

    def walk(node, path):
        if isinstance(node, dict):
            for key, below in node.items():
                walk(below, [*path, key])
        elif path[0] != "floes":
            out[".".join(path)] = _in_one_line(node)

    walk(yaml.load(text, Loader=getattr(yaml, "CBaseLoader", yaml.BaseLoader)) or {}, [])
    return {key: value for key, value in out.items() if value}


def _in_one_line(node):
    return f"[{', '.join(map(_in_one_line, node))}]" if isinstance(node, list) else node


def case_value(case, key, default=np.nan):
    """Number of a key from parse_case, in SI units and radians as bergtow writes it; default if it is missing or not a
    number."""
    match = re.fullmatch(r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)(?: [^\d].*)?", case.get(key, ""))
    try:
        return float(match[1]) if match else default
    except ValueError:
        return default


def _pairs(text):
    """[(number, number)] from a sequence of pairs in the resolved case."""
    return re.findall(r"\[([-+.\deE]+)[^,\[\]]*,\s*([-+.\deE]+)", text)


class Run(Frames):
    """The output folder of one run.

    path: folder; summary: the numbers of summary.json; attributes: provenance, the root attributes of result.h5. Raises
    RunError, from the constructor for missing or damaged files, later for missing or damaged entries."""

    def __init__(self, path):
        self.path = Path(path)
        if not self.path.exists():
            raise RunError(self.path, "no such folder", "give the folder that `bergtow run -o` wrote")
        if not self.path.is_dir():
            raise RunError(self.path, "not a folder", "give the folder of the run, not a file in it")
        self.result = self.path / "result.h5"
        self.summary = self._read_summary(self.path / "summary.json")
        self._file = self._open()
        self._series = {}
        self.attributes = {k: plain(v) for k, v in self._file.attrs.items()}

    def close(self):
        """Close result.h5. Values already read stay usable."""
        self._file.close()

    def __enter__(self):
        return self

    def __exit__(self, *exc):
        self.close()

    # ---- files

    def _read_summary(self, path):
        try:
            summary = json.loads(path.read_text(encoding="utf-8"), object_hook=lambda found: Numbers(path, found))
        except FileNotFoundError:
            if not any((self.path / name).exists() for name in ("result.h5", "result.part.h5")):
                raise RunError(self.path, "holds neither summary.json nor result.h5",
                               "give the folder that `bergtow run -o` wrote") from None
            raise integrity.without_summary(self.path) from None
        except (OSError, UnicodeDecodeError) as error:
            raise RunError(path, f"cannot be read ({error})", "check the file and its permissions") from None
        except ValueError as error:
            raise self._damaged(path, error) from None
        if not isinstance(summary, dict):
            raise self._damaged(path, "no JSON object")
        return at_least.summary(summary)

    def _damaged(self, path, why):
        return RunError(path, f"damaged ({why})", f"make it again with `bergtow resume {self.path}`, or run the case "
                        "again")

    def _open(self):
        if not self.result.exists():
            raise RunError(self.result, "missing", "restore it, or run the case again: this file holds series and "
                           "frames")
        remedy = "use another copy of it, or run the case again"
        integrity.check_seal(self.result, "result", remedy)
        return opened(self.result, remedy)

    def _dataset(self, name):
        try:
            node = self._file[name]
        except (KeyError, ValueError, OSError, RuntimeError):
            raise RunError(self.result, f"has no /{name}", "the file is incomplete: run the case again") from None
        if not isinstance(node, h5py.Dataset):
            raise RunError(self.result, f"/{name} is not a data set", "the file is damaged: run the case again")
        return node

    def _read(self, name, index=(), ndim=None):
        """Dataset (or one entry of it) as an array; float data as float64."""
        node = self._dataset(name)
        if ndim is not None and node.ndim != ndim:
            raise RunError(self.result, f"/{name} has {node.ndim} dimensions, not {ndim}",
                           "the file is damaged: run the case again")
        try:
            data = node[index]
        except (OSError, RuntimeError) as error:
            raise RunError(self.result, f"/{name} cannot be read ({first_line(error)})",
                           "the file is damaged: run the case again") from None
        data = np.asarray(data)
        return data.astype(float) if data.dtype.kind == "f" else data

    # ---- series

    @property
    def series_names(self):
        """Names of the series, sorted."""
        group = self._file.get("series")
        return sorted(group) if isinstance(group, h5py.Group) else []

    def __contains__(self, name):
        return f"series/{name}" in self._file

    def __getitem__(self, name):
        """Series [S], float64, in units(name)."""
        if name not in self._series:
            data = self._read(f"series/{name}", ndim=1).astype(float)
            if len(data) != self._dataset("series/time").shape[0]:
                raise RunError(self.result, f"/series/{name} is not as long as /series/time",
                               "the file is damaged: run the case again")
            self._series[name] = data
        return self._series[name]

    def units(self, name):
        """Units of a series, "" when the file gives none."""
        return str(plain(self._dataset(f"series/{name}").attrs.get("units", "")))

    def description(self, name):
        """One sentence that describes a series."""
        return self.attribute(name, "description")

    def attribute(self, name, what):
        """An attribute of a series: role, label, summary, merge, ...; "" if the file has none."""
        return str(plain(self._dataset(f"series/{name}").attrs.get(what, "")))

    def label(self, name):
        """The name of a series in pictures and tables. On a bridle, line_tension_1 is named after its branch."""
        if name == "line_tension_1" and "line_tension_2" in self and np.isfinite(self["line_tension_2"]).any():
            return "tension of the first branch"
        return self.attribute(name, "label") or name.replace("_", " ")

    def by_role(self, *roles):
        """Names of the series with one of these roles ("balance", "force", "load", "diagnostic"), in the order of the
        program's registry."""
        attributes = {name: self._dataset(f"series/{name}").attrs for name in self.series_names}
        return sorted((n for n in attributes if plain(attributes[n].get("role", "")) in roles),
                      key=lambda n: int(attributes[n]["order"]))

    @property
    def balance(self):
        """The towed body's force balance in the labels of its series, solved for the ice resistance: "tow − drag − ...
        − inertia"."""
        ends = "tow_force", "ice_resistance", "inertia_force"
        terms = [self.label(name) for name in self.by_role("balance") if name not in ends]
        return " − ".join(["tow", *terms, "inertia"])

    @property
    def estimates(self):
        """{name: estimate of the resistance}, in the order of the program's registry; {} if there are none."""
        found, labels, out = self.summary.get("estimates"), self.summary.get("estimate_labels"), {}
        for name, numbers in (found if isinstance(found, dict) else {}).items():
            if not (isinstance(numbers, dict) and "force_n" in numbers):
                continue  # one of the conditions, or the curves
            about, force = labels[name], np.nan if numbers["force_n"] is None else numbers["force_n"]
            out[name] = SimpleNamespace(
                label=about["label"], on_top=about["kind"] == "on top",  # added to the others, not compared with a run
                uses_floe_size=bool(about.get("uses_floe_size")),  # its curve differs between fields of a case
                numbers=numbers,  # the entries in summary.json: force_n, low_n, high_n, valid, compares, note, ...
                force=force,  # N, NaN where the formula has no value
                valid=bool(numbers.get("valid")),  # is it meant for the conditions?
                compares=bool(numbers.get("compares")) and force > 0)  # valid, and it depends on the concentration
        return out

    @property
    def window(self):
        """(start s, end s) of the window over which the summary's means are taken, or None."""
        window = self.number("window.start_s"), self.number("window.end_s")
        return window if np.isfinite(window).all() else None

    @property
    def ordered_speed(self):
        """The ordered speed at each sample [S], m/s; NaN if the case does not order one."""
        programme, time = np.array(_pairs(self.case.get("tow.programme", "")), dtype=float), self["time"]
        if len(programme):
            return np.interp(time, *programme.T)
        ramp = self.value("tow.ramp", 0.0)
        return self.value("tow.speed") * (np.clip(time / ramp, 0.0, 1.0) if ramp > 0 else np.ones_like(time))

    @property
    def headings(self):
        """[K, 2], unit vectors along the legs of the ordered tow."""
        pairs = _pairs(self.case.get("tow.waypoints", ""))
        if not pairs:
            heading = self.value("tow.direction", 0.0)
            return np.array([[np.cos(heading), np.sin(heading)]])
        ways = np.diff(np.array([(self.value("body.x", 0.0), self.value("body.y", 0.0)), *pairs], dtype=float), axis=0)
        return ways / np.hypot(*ways.T)[:, None]

    @cached_property
    def way(self):
        """Distance that the body has covered along the ordered tow [S], m, from the first sample: sway does not count,
        and drifting back is subtracted.

        The position alone does not tell which leg the body is on, since legs may meet or run side by side. Nor does the
        event, because the body may follow the towing end at a line's length. So, after the waypoint has been passed,
        the change of leg is placed where it makes the distance longest: a body that cuts the corner has then turned by
        half the angle, and a body that is towed back is about to return.
        """
        x = np.column_stack([self["body_x"], self["body_y"]])
        along = (x - x[0]) @ self.headings.T
        way, time = along[:, 0].copy(), self["time"]
        for event in self.events:
            if event["kind"] != "waypoint" or event["subject"] >= along.shape[1]:
                continue
            leg = along[:, event["subject"]]
            k = max(int(np.searchsorted(time, event["time_s"])) - 1, 0)  # the sample before the event
            way[k:] = leg[k:] + np.maximum.accumulate(way[k:] - leg[k:])
        return way

    def made_good(self, start, end):
        """Mean speed of the body over ground along the ordered tow between two times, m/s; negative if the body is
        driven back. NaN without a body."""
        if "body_x" not in self or not end > start:
            return np.nan
        first, last = np.interp([start, end], self["time"], self.way)
        return float((last - first) / (end - start))

    @property
    def speed_made_good(self):
        """Speed made good over the part of the window in which the body is towed; NaN with fewer than two samples."""
        if self.window is None:
            return np.nan
        start, end = self.window[0], min(self.window[1], self.adrift)
        return self.made_good(start, end) if np.sum(within(self["time"], start, end)) > 1 else np.nan

    @property
    def verdict(self):
        """("steady", "not steady" or "too short", the reasons as one text); "not judged" for a result without a
        verdict, i.e. without a towed body."""
        window = self.summary.get("window")
        window = window if isinstance(window, dict) else {}
        return str(window.get("verdict") or "not judged"), "; ".join(r["text"] for r in notes(window.get("reasons")))

    @property
    def warnings(self):
        """[{"code", "text", "values"}]: codes and values for programs, texts for readers."""
        return notes(self.summary.get("warnings"))

    @property
    def window_name(self):
        """Name of the window in texts: "steady window" only for a steady tow."""
        return "steady window" if self.verdict[0] == "steady" else "window"

    @property
    def mean_name(self):
        """Name of a mean over the window in texts."""
        found = "mean" if self.verdict[0] == "steady" else "mean over the window"
        return f"{found} ({at_least.words(self.number('window.no_load_share'))})" if self.at_least else found

    def interval(self, key):
        """(mean, low, high) in N of "ice_resistance", "tow_force", ...: the mean over the window and its 95 % interval;
        NaN if unknown."""
        return tuple(self.number(f"mean_{key}_{which}n") for which in ("", "low_", "high_"))

    def number(self, key, default=np.nan):
        """A number from summary.json, "window.start_s" for a number in a group; default if it is missing or null."""
        value = self.summary
        for part in key.split("."):
            value = value.get(part) if isinstance(value, dict) else None
        if isinstance(value, at_least.AtLeast):
            return value
        return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else default

    @property
    def at_least(self):
        """Are means and peaks of the loads over the window lower bounds, because some of its steps have no solution?"""
        return self.number("window.no_load_share", 0.0) > 0

    @cached_property
    def events(self):
        """Events in the run, in order: [{"time_s", "kind", "subject", "value"}], with the kinds and numbers of /events
        in result.h5. summary.json has the first 40, which are used if the file has none."""
        if "events/kind_names" not in self._file:
            return list(self.summary.get("events") or [])
        names = [plain(name) for name in self._read("events/kind_names")]
        rows = zip(*(self._read(f"events/{column}") for column in ("time", "kind", "subject", "value")))
        return [{"time_s": float(t), "kind": names[k], "subject": int(s), "value": float(v)} for t, k, s, v in rows]

    @property
    def adrift(self):
        """The time from which nothing tows the body, s; inf if it is towed to the end."""
        return min((e["time_s"] for e in self.events if e["kind"] == "adrift"), default=np.inf)

    @property
    def steps_per_sample(self):
        """Steps per sample of the series, output.sample_every."""
        return int(self._file["series"].attrs.get("steps_per_sample", 1)) if "series" in self._file else 1

    # ---- case

    @cached_property
    def case_text(self):
        """Text of the case file as given by the user."""
        return str(plain(self._read("case_as_given" if "case_as_given" in self._file else "case")[()]))

    @cached_property
    def resolved_text(self):
        """Text of the resolved case, as in case.resolved.yml: every key with its unit, meaning and source."""
        return str(plain(self._read("case")[()]))

    @cached_property
    def case(self):
        """{"section.key": text} of the resolved case: every key, numbers with their units."""
        return parse_case(self.resolved_text)

    @cached_property
    def n_by_hand(self):
        """Number of floes given by hand, which are the last of those at the start."""
        found = yaml.load(self.resolved_text, Loader=getattr(yaml, "CBaseLoader", yaml.BaseLoader)) or {}
        return len(found.get("floes") or ())

    def value(self, key, default=np.nan):
        """Number of a case key in SI units and radians; default if it is missing or not a number."""
        return case_value(self.case, key, default)

    @property
    def geographic(self):
        """True in the frame with x north and y east; False in the basin's frame."""
        return self.case.get("domain.frame") == "geographic"

    @property
    def map_axes(self):
        """Position of the frame on the map, from the attributes of /xdmf: "origin_x", "origin_y" m, and, if
        georeferenced, "crs" for PROJ and the coordinates there, "origin_east", "origin_north" m."""
        node = self._file.get("xdmf")
        if node is None:
            raise RunError(self.result, "has no /xdmf", "the file is incomplete: run the case again")
        return {name: plain(value) for name, value in node.attrs.items()}

    @cached_property
    def box(self):
        """(x0, x1, y0, y1) m of the domain; from the floes of the first frame if the case does not give it."""
        length, width = self.value("domain.length"), self.value("domain.width")
        x0 = self.value("domain.x0", -length / 2 if self.geographic else 0.0)
        y0 = self.value("domain.y0", -width / 2)
        box = np.array([x0, x0 + length, y0, y0 + width])
        if np.isfinite(box).all():
            return tuple(box)
        points = self._world(self.pose(0)) if self.n_floes else self.body_polygons(0)[0]
        return tuple(np.stack([points.min(axis=0), points.max(axis=0)], axis=1).ravel().tolist())

    @property
    def period(self):
        """(P_x, P_y) m; 0 along a direction that is not periodic."""
        x0, x1, y0, y1 = self.box
        return (x1 - x0 if self.case.get("domain.ends") in ("periodic", "moving") else 0.0,
                y1 - y0 if self.case.get("domain.sides") == "periodic" else 0.0)

    # ---- loads on the towed body

    def _group(self, name, meaning):
        """Attributes and datasets of a group as one dict."""
        node = self._file.get(name)
        if not isinstance(node, h5py.Group):
            raise RunError(self.result, f"has no /{name}",
                           f"{meaning}: run a case with a towed body and impact.conversion other than none")
        return {**{k: plain(v) for k, v in node.attrs.items()}, **{k: self._read(f"{name}/{k}") for k in node}}

    @cached_property
    def impacts(self):
        """Collisions with the towed body: dict of columns [n] ("time", "floe", "peak", ...) and "conversion", the
        definition of a peak."""
        return self._group("impacts", "collisions were not identified")

    @cached_property
    def panels(self):
        """Panels of the hull: dict of "ends" [P+1, 2], "middle" and "normal" [P, 2], body frame, m; loads "mean_load",
        "max_load", ... [P] N."""
        return self._group("panels", "loads by panel were not kept")

    @property
    def panel_series(self):
        """{"units": of the loads on panels, "load": [S, P] their series if the run stored them (output.panels)}."""
        group = self._file.get("panels")
        if not isinstance(group, h5py.Group) or "mean_load" not in group:
            return {}
        out = {"units": str(plain(group["mean_load"].attrs.get("units", "")))}
        if "load" in group:
            out["load"] = self._read("panels/load", ndim=2)
        return out
