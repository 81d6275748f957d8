# SPDX-License-Identifier: MIT
"""The frames of a run as data for the replay in its report: selected, rounded, packed.

Positions, yaw, speed and contact force of the floes are stored as 16-bit numbers:
    x = low + step q          step: 1/65535 of the range (1/65536 of the period along a periodic direction)
    yaw = 2π q / 65536
    value = top (q / 65535)²  relative step 2 / q: fine where small, for speed and force
Each is stored as the difference from the previous frame, modulo 65536, low bytes first, then high bytes, deflated, in
base64: ice at rest takes almost no space. postproc/page/replay.js decodes this.

Rejected: 32-bit floats (twice the size, and five digits more than a screen shows); a film (no zoom, no values); images
of floes as SVG (a hundred times the size).
"""
import base64
import zlib

import numpy as np

from bergtow.errors import RunError
from bergtow.plot import style
from bergtow.plot.force import running_mean, smoothing
from bergtow.plot.scene import Colouring, body_size, needs_window, tow_heading, tow_line, view_body

#: default size of the replay within the page, bytes: with outlines and pictures of much ice, 6 MB, the page has 15 MB
#: and can be mailed
LIMIT = 8e6
RAW_LIMIT = 120e6       #: unpacked bytes that a browser must hold; this program needs four times as much
LEAST_FRAMES = 40      #: fewer frames do not make a replay; floes are left out instead
BUCKETS = 1500         #: points of a force curve
TRACK = 1000           #: points of the body's track


def pack(array, compress=True):
    """Base64 text of an array's little-endian bytes, optionally deflated."""
    raw = np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<"), copy=False).tobytes()
    return base64.b64encode(zlib.compress(raw, 6) if compress else raw).decode("ascii")


def pack_frames(q, compress=True):
    """Base64 text of uint16 numbers [T, N]: differences in time, low bytes, then high bytes."""
    change = np.concatenate([q[:1], q[1:] - q[:-1]]).astype(np.uint16)
    return pack(np.stack([(change & 255).astype(np.uint8), (change >> 8).astype(np.uint8)]), compress)


def thinned(n, most):
    """Indices of at most `most` of n frames, evenly spaced, including the first and the last."""
    if n <= most:
        return np.arange(n)
    return np.unique(np.rint(np.linspace(0, n - 1, max(int(most), 2))).astype(int))


def read_frames(run, frames, floes):
    """(x, y, yaw, speed, force), each [T, N], of some floes in some frames, with positions wrapped into the domain.
    Also lives [N, 2]: as indices into frames, the first frame that contains the floe, and the first one after it that
    does not. In frames without it a floe has the numbers of the nearest frame that contains it."""
    out = np.empty((5, len(frames), len(floes)))
    lives = np.tile([0, len(frames)], (len(floes), 1))
    for k, frame in enumerate(frames):
        pose = run.pose(frame)[floes]
        pose[:, :2] = run.wrap(pose[:, :2])
        out[0, k], out[1, k], out[2, k] = pose.T
        out[3, k], out[4, k] = run.speed(frame)[floes], run.least_contact_force(frame)[floes]
    if run.n_pieces:
        there = np.isfinite(out[0])
        count = there.sum(axis=0)
        lives[:, 0] = np.where(count > 0, there.argmax(axis=0), 0)
        lives[:, 1] = lives[:, 0] + count
        nearest = np.clip(np.arange(len(frames))[:, None], lives[:, 0], np.maximum(lives[:, 1] - 1, lives[:, 0]))
        out = np.where(count > 0, np.take_along_axis(out, nearest[None], axis=1), 0)
    if not np.isfinite(out).all():
        raise RunError(run.result, "/frames holds values that are not finite",
                       "the file is damaged: run the case again")
    return out, lives


def quantise(x, low, high, period):
    """(q uint16, low, step): x = low + step q. With a period, the number after the last is the first."""
    levels = 65536 if period else 65535
    step = (high - low) / levels or 1.0
    return (np.rint((x - low) / step).astype(np.int64) % 65536).astype(np.uint16), low, step


def quantise_root(x):
    """(q uint16, top): x = top (q / 65535)²."""
    top = float(x.max(initial=0.0)) or 1.0
    return np.rint(65535 * np.sqrt(np.maximum(x, 0) / top)).astype(np.uint16), top


def nearest_floes(run, frames, n):
    """Ids, in order, of the n floes that come nearest to the towed body in some frames (without a towed body: of the n
    largest)."""
    if run.towed is None:
        return np.sort(np.argsort(-run.area, kind="stable")[:n])
    least = np.full(run.n_floes, np.inf)
    for frame in frames:
        body = run.body_pose(frame)[run.towed, :2]
        least = np.fmin(least, np.hypot(*(run.wrap(run.pose(frame)[:, :2], body) - body).T))
    return np.sort(np.argsort(least, kind="stable")[:n])


class Replay:
    """The replay of a run. head: everything except the large arrays, for JSON; blobs: {name: base64 text}; notes:
    sentences on omissions and rounding. Raises RunError."""

    def __init__(self, run, limit=LIMIT, compress=True):
        run.need_frames()
        self.run, self.compress, self.notes = run, compress, []
        frames, floes = self._fit(limit)
        self.frames, self.floes = frames, floes
        self._say_what_is_left_out(frames, floes)
        self._add_outlines(floes)
        self.head = {
            "deflate": compress, "times": run.frame_times[frames].tolist(), "stored_frames": run.n_frames,
            "n": len(floes), "n_floes": run.n_floes, "geographic": run.geographic, "box": list(run.box),
            "period": list(run.period), "moving": run.case.get("domain.ends") == "moving", "quanta": self.quanta,
            "colouring": self._colourings(frames),
            "ids": run.ids[floes].tolist() if len(floes) < run.n_floes or run.n_pieces else None,
            "edges": [run.case.get("domain.ends", ""), run.case.get("domain.sides", "")],
            "style": {k.lower(): getattr(style, k) for k in ("INK", "WATER", "WALL", "FIXED", "BODY", "BODY_EDGE",
                                                             "TRACK", "RAFTED")},
            "rafts": run.value("ice.rafting.kappa", 0) > 0, **self._bodies(frames), "curve": curve(run)}

    @property
    def size(self):
        """Bytes of the large arrays."""
        return sum(len(text) for text in self.blobs.values())

    def _fit(self, limit):
        """Choose frames and floes that fit within the limits, and pack them."""
        run = self.run
        floes = np.arange(run.n_floes)
        room = RAW_LIMIT if self.compress else 0.75 * limit
        most = min(run.n_frames, max(int(room / (10 * max(run.n_floes, 1))), min(LEAST_FRAMES, run.n_frames)))
        for _ in range(12):
            frames = thinned(run.n_frames, most)
            raw = 10 * len(frames) * len(floes)
            if raw <= 1.01 * room:
                self._pack(frames, floes)
                raw = self.size * (room / limit)
            if raw <= 1.01 * room:
                break
            share = 0.95 * room / raw
            if most > LEAST_FRAMES:
                most = max(int(share * most), LEAST_FRAMES)
            else:
                floes = nearest_floes(run, frames, max(int(share * len(floes)), 1))
        return frames, floes

    def _pack(self, frames, floes):
        run = self.run
        (x, y, yaw, speed, force), self.lives = read_frames(run, frames, floes)
        self.quanta, numbers = {}, {}
        for axis, name, values in ((0, "x", x), (1, "y", y)):
            period, low = run.period[axis], run.box[2 * axis]
            low, high = (low, low + period) if period else map(float, (values.min(), values.max())) if values.size \
                else (0.0, 1.0)
            numbers[name], *self.quanta[name] = quantise(values, low, high, period)
        numbers["yaw"], *self.quanta["yaw"] = quantise(np.mod(yaw, 2 * np.pi), 0.0, 2 * np.pi, True)
        for name, values in (("speed", speed), ("force", force)):
            numbers[name], self.quanta[name] = quantise_root(values)
        self.blobs = {name: pack_frames(q, self.compress) for name, q in numbers.items()}

    def _say_what_is_left_out(self, frames, floes):
        run, notes = self.run, self.notes
        if len(frames) < run.n_frames:
            notes.append(f"{len(frames)} of the {run.n_frames} stored frames are in this page, to keep it small; all "
                         "are in result.h5.")
        if len(floes) < run.n_floes:
            which = "those that come closest to the towed body" if run.towed is not None else "the largest ones"
            notes.append(f"{len(floes)} of the {run.n_floes} floes are in this page, {which}, to keep it small. The "
                         "rest of the water is not free of ice: all floes are in result.h5.")
        worst = max(self.quanta[axis][1] / 2 for axis in "xy")
        notes.append(f"Positions are rounded to {style.short(1000 * worst, 2)} mm, angles to 0.003°, speed and contact "
                     "force to 16 bits; result.h5 holds them in full.")

    def _add_outlines(self, floes):
        run = self.run
        counts = np.diff(run.offsets)[floes]
        owner = np.repeat(np.isin(np.arange(run.n_floes), floes), np.diff(run.offsets))
        for name, values, kind in (("vertices", run.vertices[owner], np.float32), ("counts", counts, np.uint16),
                                   ("thickness", run.thickness[floes], np.float32),
                                   ("area", run.area[floes], np.float32), ("lives", self.lives, np.uint32)):
            self.blobs[name] = pack(values.astype(kind), self.compress)

    def _colourings(self, frames):
        """Quantities that can colour the floes: label, upper and lower limit in SI units, power of the scale, 64
        colours; the same as in the pictures."""
        run, out = self.run, []
        kinds = [("speed", "speed"), ("force", "contact force")]
        if run.n_floes and np.ptp(run.thickness) > 1e-9 * run.thickness.max():
            kinds.append(("thickness", "thickness"))
        for kind, name in kinds:
            c = Colouring(run, kind, frames[thinned(len(frames), 60)])
            table = (255 * c.cmap(np.linspace(0, 1, 64))[:, :3]).round().astype(int)
            out.append({"kind": kind, "name": name, "label": c.label, "factor": c.factor, "low": float(c.norm.vmin),
                        "high": float(c.norm.vmax), "power": float(getattr(c.norm, "gamma", 1.0)),
                        "above": c.extend == "max", "table": table.tolist()})
        return out

    def _unwrap(self, pose, frames):
        """Unwrap, in place, poses [T, 3] of the towed body to agree with the series body_x and body_y."""
        run, sample = self.run, self.run.samples(frames)
        for axis, name in enumerate(("body_x", "body_y")):
            if run.period[axis] and name in run:
                at = np.where(sample < 0, pose[:, axis], run[name][np.maximum(sample, 0)])
                pose[:, axis] += run.period[axis] * np.round((at - pose[:, axis]) / run.period[axis])

    def _bodies(self, frames):
        """Bodies other than floes, their poses, and data of the towed body."""
        run = self.run
        poses = np.array([run.body_pose(f) for f in frames])
        if run.towed is not None:
            self._unwrap(poses[:, run.towed], frames)
        self.blobs["body_pose"] = pack(poses, self.compress)
        out = {"bodies": [{"name": b.name, "wall": b.wall, "towed": b.towed, "vertices": b.vertices.round(6).tolist()}
                          for b in run.bodies], "towed": run.towed, "follow": False, "view": None, "heading": None,
               "line": None, "vessel": run.case.get("tow.mode") == "thrust", "track": None, "window_low": None}
        if run.towed is None:
            return out
        heading = tow_heading(run)
        led = heading is not None and run.case.get("tow.mode") not in ("line", "thrust")
        out["heading"] = [tow_heading(run, run.frame_times[f]).round(6).tolist() for f in frames] if led else None
        out["follow"] = bool(needs_window(run) or out["heading"] is None and run.case.get("domain.ends") == "moving")
        out["view"], out["size"] = list(view_body(run)), body_size(run)
        lines = [tow_line(run, f, np.zeros(2)) for f in frames]
        if lines[0] is not None and np.isfinite(np.concatenate(lines)).all():
            out["line"] = [line.round(5).tolist() for line in lines]
        if "body_x" in run and len(run["time"]):
            kept = thinned(len(run["time"]), TRACK)
            out["track"] = {name: run[series][kept].round(digits).tolist() for name, series, digits in (
                ("time", "time", 6), ("x", "body_x", 5), ("y", "body_y", 5))}
        if (low := run.window_low(frames)) is not None:
            out["window_low"] = low.tolist()
            out["follow"] = True
        return out


def _digits(values):
    """Numbers for JSON to six digits, None if not finite."""
    return [float(f"{v:.6g}") if np.isfinite(v) else None for v in values]


def curve(run):
    """Force against time for the replay: least, largest and running mean of the samples in each of at most BUCKETS
    pieces. Without a towed body: kinetic energy. None without samples."""
    time = run["time"]
    kinds = [("kinetic_energy", "kinetic energy", style.ICE)]
    if run.towed is not None:
        kinds = [(name, run.label(name) if name in run else name, colour)
                 for name, colour in (("ice_resistance", style.ICE), ("tow_force", style.TOW))]
    kinds = [k for k in kinds if k[0] in run and np.isfinite(run[k[0]]).any()]
    if len(time) < 2 or not kinds:
        return None
    samples, seconds = smoothing(run)
    edges = np.unique(np.linspace(0, len(time), min(BUCKETS, len(time)) + 1).astype(int))
    middle = (edges[:-1] + edges[1:] - 1) // 2
    lines = []
    for name, label, colour in kinds:
        values = run[name]
        with np.errstate(invalid="ignore"):
            smooth = running_mean(values, samples)
            low, high = np.fmin.reduceat(values, edges[:-1]), np.fmax.reduceat(values, edges[:-1])
        lines.append({"name": name, "label": label, "unit": run.units(name), "colour": colour, "low": _digits(low),
                      "high": _digits(high), "smooth": _digits(smooth[middle])})
    mean, low, high = run.interval("ice_resistance")
    return {"time": _digits(time[middle]), "start": float(min(0.0, time[0])), "end": float(time[-1]),
            "smooth_s": seconds, "lines": lines, "window": list(run.window) if run.window else None,
            "window_name": run.window_name, "at_least": run.at_least,
            "mean": float(mean) if np.isfinite(mean) else None,
            "band": float((high - low) / 2) if np.isfinite(high - low) else None,
            "events": [{"time": e["time_s"], "kind": e["kind"].replace("_", " ")} for e in run.events]}
