# SPDX-License-Identifier: MIT
"""An ensemble's folder with numbers of the test's own, of the layout that src/run/ensemble_file.c writes."""
import contextlib
import ctypes
import json
import re
from pathlib import Path

import h5py
import numpy as np


FINISHED, FAILED, WAITING = 1, 2, 0
UNITS = {"ice.concentration": "1", "tow.speed": "m/s", "ice.thickness": "m", "ice.friction": "1"}
ESTIMATES = {
    "lichey_hellmer": 80.0, "marchenko_compaction": 5.0, "marchenko_rafting": 40.0, "marchenko_momentum": 160.0,
    "dilute_limit": 20.0, "open_water_drag": 300.0
}
LABELS = {"lichey_hellmer": "Lichey-Hellmer", "marchenko_compaction": "compaction", "dilute_limit": "dilute limit"}
TEXT = h5py.string_dtype()
VERDICTS = ("steady", "not steady", "too short")
#: (code, meaning) of every warning, as the table of the program has them
CODES = re.findall(r'ROW\(\w+,\s*"(\w+)",\s*"[^"]*",\s*"([^"]*)"\)', (
    Path(__file__).resolve().parents[1] / "src/case/warning.h").read_text(encoding="utf-8").replace("\\\n", ""))


class _Hash(ctypes.Structure):
    _fields_ = [("low", ctypes.c_uint64), ("high", ctypes.c_uint64)]


def digest(raw):
    """XXH3, 128 bits, in hexadecimal digits."""
    function = ctypes.CDLL("libxxhash.so.0").XXH3_128bits
    function.restype, function.argtypes = _Hash, [ctypes.c_char_p, ctypes.c_size_t]
    found = function(raw, len(raw))
    return f"{found.high:016x}{found.low:016x}"


def note(code, text="", **values):
    """A warning, or a reason of a verdict."""
    assert code in dict(CODES), code
    return {"code": code, "text": text or f"the text of {code}", "values": values}


def described(name):
    """What the program says of an estimate beside its numbers."""
    return {"label": LABELS.get(name, name.replace("_", " ")),
            "kind": "on top" if name == "open_water_drag" else "ice resistance"}


def member(series, parameters, condition, **changes):
    """One member: series [n] N at 1 s from 1 s on, steady from `start` s; peaks: (times s, forces N); more: further
    series of result.h5, attributes: {name: attributes} of them; case: its text; state: hash
    of its end, None for one of its own; warnings, reasons: of note()."""
    return {
        "series": np.asarray(series, dtype=float), "parameters": parameters, "condition": condition, "start": 0.5,
        "status": FINISHED, "reason": "", "hole": None, "warnings": [], "peaks": None, "hours": len(series) / 3600,
        "conversion": "half-sine of 0.1 s", "estimates": ESTIMATES, "reasons": [], "more": {},
        "attributes": {}, "case": None, "state": None
    } | changes


def numbers(m):
    """Nested numbers of summary.json."""
    x, start = m["series"], m["start"]
    steady = x[np.arange(1, len(x) + 1) >= start]
    estimates = {name: {"force_n": f, "low_n": f, "high_n": f, "valid": name != "marchenko_compaction"} for name,
                 f in m["estimates"].items()}
    return {
        "mean_ice_resistance_n": steady.mean(), "mean_ice_resistance_se_n": 0.0, "unconverged_steps": 0, "events": [],
        "stalled_windows": 0, "concentration": 0.5, "window": {
            "start_s": max(start, 1.0), "end_s": float(len(x)), "n_samples": len(steady), "n_independent": 100.0,
            "correlation_time_s": 1.0
        } | m.get("window", {}), "impacts": {"from_s": 0.0, "hours": m["hours"]}, "estimates": estimates
    } | m.get("summary", {})


def flat(nested, prefix=""):
    for key, value in nested.items():
        name = f"{prefix}_{key}" if prefix else key
        if isinstance(value, dict):
            yield from flat(value, name)
        elif isinstance(value, (int, float, np.number)):
            yield name, float(value)


def write_member(folder, m):
    """summary.json and a result.h5 with the collisions."""
    folder.mkdir(parents=True, exist_ok=True)
    nested = numbers(m)
    nested["window"]["reasons"] = m["reasons"]
    nested["estimates"] |= {
        "curves": {
            "concentration": [0.0, 0.5, 1.0], "valid_range": {k: [0.0, 1.0]
                                                              for k in m["estimates"]},
            **{k: [0.0, f, 2 * f]
               for k, f in m["estimates"].items()}
        }, "thickness_m": 1.0, "width_m": 2.0, "speed_along_m_s": 0.1, "length_scale": 1.0
    }
    (folder / "case.resolved.yml").write_text("ice: {}\n")
    (folder / "summary.json").write_text(
        json.dumps(
            nested | {
                "estimate_labels": {n: described(n)
                                    for n in m["estimates"]}, "title": "made up", "warnings": m["warnings"],
                "stopped": None
            }))
    with h5py.File(folder / "result.h5", "w") as f:
        f["case"] = m["case"] or f"ice:\n  concentration: {m['parameters'].get('ice.concentration', 0.5)}\n"
        for name, x in ({"time": np.arange(1.0, len(m["series"]) + 1)} | m["more"] if m["more"] else {}).items():
            f[f"series/{name}"] = x
            f[f"series/{name}"].attrs.update(m["attributes"].get(name, {"units": "s"}))
        times, peaks = m["peaks"] if m["peaks"] is not None else ([], [])
        f["impacts/time"], f["impacts/peak"] = np.asarray(times, dtype=float), np.asarray(peaks, dtype=float)
        f["impacts"].attrs["conversion"] = m["conversion"]
    seal(folder / "result.h5")


def verdict(m):
    """The number of a verdict."""
    name = m.get("window", {}).get("verdict")
    return float(VERDICTS.index(name)) if name else np.nan


def table(f, group, columns, rows):
    """A group with a column of each name; none without rows."""
    for name, column in zip(columns.split(), zip(*rows)):
        f.create_dataset(f"{group}/{name}", data=list(column), dtype=TEXT if isinstance(column[0], str) else None)


def notes_of(f, members, done):
    """Warnings, reasons and events of the members that finished."""
    some = [(i + 1, m) for i, (m, ok) in enumerate(zip(members, done)) if ok]
    for group in ("warnings", "reasons"):
        table(f, group, "member code text values",
              [(i, w["code"], w["text"], json.dumps(w["values"])) for i, m in some for w in m[group]])
    table(f, "events", "member time kind subject value",
          [(i, e["time_s"], e["kind"], e["subject"], e["value"]) for i, m in some for e in numbers(m)["events"]])
    table(f, "codes", "code meaning", CODES)


def seal(path, name=None):
    """The seal of a file without one, as src/base/checksum.h has it. name: "checkpoint", "result", "ensemble"."""
    raw, header = path.read_bytes(), (Path(__file__).resolve().parents[1] / "src/base/checksum.h").read_text()
    kind = re.search(rf'"({name or path.stem} \d+)"', header)[1]
    text = f"bergtow sealed file\nkind: {kind}\nbytes: {len(raw)}\nxxh128: {digest(raw)}\n".encode()
    path.write_bytes(raw + text.ljust(128, b"\0"))


@contextlib.contextmanager
def edited(path):
    """A sealed HDF5 file, open to change it, and sealed again."""
    with h5py.File(path, "r+") as f:
        yield f
    seal(path)


def record(folder, study, name=None):
    """The record of a finished member, as src/run/ensemble_record.h has it."""
    lines = ["bergtow finished member 1", f"name: {name or folder.name}",
             f"study: {digest(study.encode())}"]
    for file in ("summary.json", "result.h5", "case.resolved.yml"):
        raw = (folder / file).read_bytes()
        lines.append(f"{file}: {len(raw)} bytes, xxh128 {digest(raw)}")
    (folder / "finished").write_text("\n".join(lines) + "\n")


def write(folder, members, title="made up", sampling="grid"):
    """DIR/ensemble.h5 and DIR/members/NAME of the members, in the order of their conditions."""
    folder.mkdir(parents=True, exist_ok=True)
    repeat, rows = {}, []
    for m in members:
        repeat[m["condition"]] = repeat.get(m["condition"], 0) + 1
        rows.append((m, repeat[m["condition"]], f"c{m['condition'] + 1:03d}-r{repeat[m['condition']]:03d}"))
    n, longest = len(rows), max(len(m["series"]) for m in members)
    done = [m["status"] == FINISHED for m in members]
    study = f"# bergtow study\nseed: 1\nsampling: {sampling}\n# base case with `set`\n"
    with h5py.File(folder / "ensemble.h5", "w") as f:
        f["members/id"], f["members/condition"] = np.arange(1, n + 1), np.array([m["condition"] for m in members])
        f["members/repeat"], f["members/seed"] = np.array([r - 1 for _, r, _ in rows]), np.arange(n) + 100
        f["members/status"] = np.array([m["status"] for m in members])
        states = [m["state"] or f"{i}" for i, (m, *_) in enumerate(rows)]
        holes = {FAILED: "failed", WAITING: "died", FINISHED: ""}
        for key, texts in (("name", [name for *_, name in rows]), ("state_hash", states),
                           ("reason", [m["reason"] for m in members]),
                           ("hole", [m["hole"] or holes[m["status"]] * bool(m["reason"]) for m in members])):
            f.create_dataset(f"members/{key}", data=texts, dtype=TEXT)
        for group in ("parameters", "summary"):
            f.create_group(group)
        for key in members[0]["parameters"]:
            values = [m["parameters"][key] for m in members]
            data = f.create_dataset(f"parameters/{key}",
                                    data=values,
                                    dtype=TEXT if isinstance(values[0], str) else float)
            data.attrs["units"], data.attrs["key"] = UNITS.get(key, "1"), key
        notes_of(f, members, done)
        summaries = [dict(flat(numbers(m))) | {"window_verdict": verdict(m)} if ok else {}
                     for m, ok in zip(members, done)]
        for key in dict.fromkeys(k for s in summaries for k in s):
            f[f"summary/{key}"] = np.array([s.get(key, np.nan) for s in summaries])
            for name in (n for n in members[0]["estimates"] if key.startswith(f"estimates_{n}_")):
                order = list(ESTIMATES).index(name)
                f[f"summary/{key}"].attrs.update({"estimate": name, "order": order, **described(name)})
        time, ice, tow = (np.full((n, longest), np.nan) for _ in range(3))
        for i, (m, ok) in enumerate(zip(members, done)):
            if ok:
                time[i, :len(m["series"])], ice[i, :len(m["series"])] = np.arange(1, len(m["series"]) + 1), m["series"]
                tow[i, :len(m["series"])] = m["more"].get("tow_force", m["series"])
        for key, values in (("time", time), ("ice_resistance", ice), ("tow_force", tow)):
            f.create_dataset(f"series/{key}", data=values).attrs["units"] = "s" if key == "time" else "N"
        f["study"], f["study_resolved"] = np.bytes_("{}"), np.bytes_(study)
        f.attrs["title"], f.attrs["program"], f.attrs["n_members"], f.attrs["complete"] = title, "bergtow", n, int(
            all(m["status"] != WAITING for m in members))
        f.attrs["n_finished"], f.attrs["n_failed"] = sum(done), sum(m["status"] == FAILED for m in members)
    for (m, _, name), ok in zip(rows, done):
        if ok:
            write_member(folder / "members" / name, m)
            record(folder / "members" / name, study)
    seal(folder / "ensemble.h5")
    return folder


def ar1(phi, n, rng, mean=0.0, sd=1.0):
    """A stationary series x_i - mean = phi (x_{i-1} - mean) + noise, of standard deviation sd."""
    noise = rng.normal(0, np.sqrt(1 - phi * phi), n)
    x = np.empty(n)
    last = rng.normal()
    for i in range(n):
        last = phi * last + noise[i]
        x[i] = last
    return mean + sd * x
