# SPDX-License-Identifier: MIT
"""Floes and bodies of a run, and their positions in its frames: the part of Run (result/run.py) with outlines."""
import ctypes
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bergtow import _library
from bergtow.errors import RunError
from bergtow.result.hdf5 import plain


@dataclass(frozen=True)
class Body:
    """A body that is not a floe: the towed body, a wall, or a fixed body given by hand."""

    name: str
    vertices: np.ndarray  #: [n, 2] m, body frame, anticlockwise in (x, y)
    towed: bool

    @property
    def wall(self):
        return self.name.startswith("wall")


def place(vertices, pose):
    """World coordinates [n, 2] m of vertices [n, 2] m (body frame) at pose (x m, y m, yaw rad)."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(vertices) @ np.array([[c, s], [-s, c]]) + np.asarray(pose[:2])


def lonlat_of(east_north, origin):
    """Longitude and latitude [..., 2] of metres about an origin (longitude, latitude in rad); NaN stays NaN."""
    unproject = _library.library().bt_outline_unproject
    lon, lat = ctypes.c_double(), ctypes.c_double()
    out = np.full(east_north.shape, np.nan)
    flat, to = east_north.reshape(-1, 2), out.reshape(-1, 2)
    for k in np.flatnonzero(np.isfinite(flat).all(axis=1)):
        unproject(flat[k, 1], flat[k, 0], *origin, lon, lat)
        to[k] = lon.value, lat.value
    return np.degrees(out)


class Frames:
    """Frames of result.h5, using what Run reads from it: the file, its data, the case, the domain and its period."""

    # ---- floes and bodies

    def _outlines(self, group):
        vertices = self._read(f"{group}/vertices", ndim=2)
        offsets = self._read(f"{group}/offsets", ndim=1).astype(np.int64)
        sound = (vertices.shape[1] == 2 and len(offsets) > 0 and offsets[0] == 0
                 and offsets[-1] == len(vertices) and (np.diff(offsets) > 0).all())
        if not sound:
            raise RunError(self.result, f"/{group}/offsets does not fit /{group}/vertices",
                           "the file is damaged: run the case again")
        return vertices, offsets

    @cached_property
    def _floes(self):
        """Outlines of the floes, followed by those of the pieces of split floes, which are treated like any floe."""
        vertices, offsets = self._outlines("floes")
        if not self.n_pieces:
            return vertices, offsets
        more, ends = self._outlines("pieces")
        return np.concatenate([vertices, more]), np.concatenate([offsets, offsets[-1] + ends[1:]])

    @cached_property
    def n_pieces(self):
        """Number of pieces of split floes, which are the last of the floes. Poses and forces of a floe are NaN in
        frames where it does not exist: before it split off, or after it has split."""
        return len(self._file["pieces/area"]) if "pieces" in self._file else 0

    @property
    def n_start(self):
        """Number of floes at the start, which are the first of the floes."""
        return self.n_floes - self.n_pieces

    @cached_property
    def splits(self):
        """Floes that split: dict of columns [S], "time" s, "parent", "generation", "mode", "ratio", "thickness" m, and
        "crack" [S, 4] m, x and y of its ends; empty if floes cannot split. Split k made the floes n_start + 2 k and the
        one after it."""
        return {name: self._read(f"splits/{name}") for name in self._file.get("splits", ())}

    @property
    def ids(self):
        """[N] ids of the floes, as in /impacts/floe and frames.xdmf: rows of /floes, /bodies and /pieces, one after the
        other. A piece is listed here before the bodies, so its index is less than its id."""
        index = np.arange(self.n_floes)
        return index + (index >= self.n_start) * len(self.bodies)

    @property
    def generation(self):
        """[N] number of successive splits that made each floe: 0 for those that existed at the start."""
        made = np.zeros(self.n_floes, int)
        if self.n_pieces:
            made[-self.n_pieces:] = np.repeat(self.splits["generation"], 2)
        return made

    @property
    def vertices(self):
        """[V, 2] m, concatenated outlines of all floes, body frame."""
        return self._floes[0]

    @property
    def offsets(self):
        """[N+1], floe i owns vertices[offsets[i]:offsets[i+1]]."""
        return self._floes[1]

    @property
    def n_floes(self):
        return len(self.offsets) - 1

    @cached_property
    def thickness(self):
        """[N] m."""
        own = self._read("floes/thickness", ndim=1)
        return np.concatenate([own, np.repeat(self.splits["thickness"], 2)]) if self.n_pieces else own

    @cached_property
    def ice(self):
        """[N] of bool: the floes at the start that a run counts as its ice in concentration, mean size and thickness of
        summary.json (bt_setup_mean_floe): those generated or read; without any, those by hand that move. Quays, piers
        and coasts are no ice."""
        index = np.arange(self.n_floes)
        made = index < self.n_start - self.n_by_hand
        by_hand = (index < self.n_start) & ~made
        return made if made.any() else by_hand if self.fixed is None else by_hand & ~self.fixed

    @property
    def mean_thickness(self):
        """Mean thickness of the ice, m, weighted with area like that of the estimates; NaN without ice."""
        return float(np.average(self.thickness[self.ice], weights=self.area[self.ice])) if self.ice.any() else np.nan

    @property
    def sizes(self):
        """Diameters of circles with the areas of the floes that are the ice, m; their mean is mean_size_m."""
        return np.sqrt(4 * self.area[self.ice] / np.pi)

    @cached_property
    def area(self):
        """[N] m²."""
        own = self._read("floes/area", ndim=1)
        return np.concatenate([own, self._read("pieces/area", ndim=1)]) if self.n_pieces else own

    @cached_property
    def fixed(self):
        """[N] of bool: floes that nothing moves; None in results of version 0.1.0, which do not tell."""
        if "fixed" not in self._file["floes"]:
            return None
        return np.append(self._read("floes/fixed", ndim=1) != 0, np.zeros(self.n_pieces, bool))

    @cached_property
    def bodies(self):
        """List of Body: all bodies that are not floes, in the order of body_pose; may be empty."""
        if "bodies" not in self._file:
            return []
        vertices, offsets = self._outlines("bodies")
        n = len(offsets) - 1
        names = [str(plain(name)) for name in np.atleast_1d(self._read("bodies/names"))]
        towed = int(np.ravel(self._read("bodies/towed"))[0])
        if len(names) != n or not -1 <= towed < n:
            raise RunError(self.result, "/bodies/names and /bodies/towed do not fit /bodies/offsets",
                           "the file is damaged: run the case again")
        return [Body(names[i], vertices[offsets[i]:offsets[i + 1]], i == towed) for i in range(n)]

    @property
    def towed(self):
        """Index of the towed body in bodies, or None."""
        return next((i for i, body in enumerate(self.bodies) if body.towed), None)

    # ---- frames

    @cached_property
    def frame_times(self):
        """[T] s."""
        return self._read("frames/time", ndim=1)

    @property
    def n_frames(self):
        return len(self.frame_times)

    def samples(self, frames):
        """Index of the last sample of the series at or before each of some frames; -1 before the first."""
        return np.searchsorted(self["time"], self.frame_times[frames] * (1 + 1e-9), side="right") - 1

    def window_low(self, frames):
        """Low end of the moving window along x at some frames, m; None without one. It follows the body in strides, so
        its distance from the body holds only at the start, before the first sample."""
        if "window_x" not in self or not np.isfinite(self["window_x"]).any():
            return None
        sample, half = self.samples(frames), self.period[0] / 2
        ahead = (np.sign(self.headings[0, 0]) or 1.0) * (self.number("moving_window.ahead_m", half) - half)
        return np.where(sample < 0, self.value("body.x", 0.0) + ahead - half, self["window_x"][np.maximum(sample, 0)])

    def need_frames(self):
        """Raises RunError if there are none."""
        if not self.n_frames:
            raise RunError(self.result, "holds no frames", "set output.frame_interval and run the case again")

    def frame_at(self, time):
        """Index of the frame nearest to a time, s."""
        self.need_frames()
        return int(np.argmin(np.abs(self.frame_times - time)))

    def _frame(self, name, frame, width):
        if not -self.n_frames <= frame < self.n_frames:
            raise RunError(self.result, f"has no frame {frame} (there are {self.n_frames})", "choose another frame")
        data = self._read(f"frames/{name}", frame % self.n_frames)
        if data.shape[:1] != (width,):
            raise RunError(self.result, f"/frames/{name} has {data.shape[:1]} entries a frame, not {width}",
                           "the file is damaged: run the case again")
        return data

    @cached_property
    def _piece_end(self):
        return self._read("frames/piece_end", ndim=1)

    def _of_floes(self, name, frame, others=0):
        """[N, ...] for the floes in a frame; others: number of bodies that follow the floes in the file."""
        own = self.n_start
        data = self._frame(name, frame, own + others)[:own]
        if not self.n_pieces:
            return data
        ends = self._piece_end
        k = frame % self.n_frames
        rows = slice(int(ends[k - 1]) if k else 0, int(ends[k]))
        out = np.full((self.n_floes, *data.shape[1:]), np.nan)
        out[:own] = data
        out[own + self._file["frames/piece"][rows]] = self._file[f"frames/piece_{name}"][rows]
        return out

    def pose(self, frame):
        """[N, 3] x m, y m, yaw rad of the floes, as written (not wrapped); NaN for a floe that does not exist."""
        return self._of_floes("pose", frame)

    def body_pose(self, frame):
        """[B, 3] x m, y m, yaw rad of the bodies, as written."""
        return self._frame("body_pose", frame, len(self.bodies)) if self.bodies else np.zeros((0, 3))

    def contact_force(self, frame):
        """[N] N, largest normal contact force on each floe in the frame's step; NaN if the step has no solution."""
        return self._of_floes("contact_force", frame)

    def least_contact_force(self, frame):
        """The same for pictures: NaN is replaced by the force in the last earlier frame whose step has a solution, or
        by 0 at the start, as in series."""
        for k in range(frame % max(1, self.n_frames), -1, -1):
            force = self.contact_force(k)
            there = np.isfinite(self.pose(k)[:, 0]) if self.n_pieces else np.ones(len(force), bool)
            if not np.isnan(force[there]).any():
                return np.where(there, force, 0)
        return np.zeros(self.n_floes)

    def speed(self, frame):
        """[N] m/s, speed of each floe."""
        return self._of_floes("speed", frame, len(self.bodies))

    def body_speed(self, frame):
        """[B] m/s, speed of each body."""
        own = self.n_start  # this dataset does not contain pieces
        return self._frame("speed", frame, own + len(self.bodies))[own:]

    def on_page(self, xy):
        """Positions [..., 2] as (horizontal, vertical) of a picture: in the geographic frame as on a map."""
        return np.asarray(xy, dtype=float)[..., ::-1 if self.geographic else 1]

    def towing_end(self, frame):
        """Position [2] m of the towing end beside the towed body of the frame; NaN without a line that holds."""
        if "line_points" in self._file.get("frames", ()):
            for hull, end in self._read("frames/line_points", frame % self.n_frames, ndim=3).reshape(-1, 2, 2):
                if not np.array_equal(hull, end):  # of a broken branch both are at the hull
                    return end
        return np.full(2, np.nan)

    @property
    def images(self):
        """Shifts [2], m, from a body in the domain to its periodic images around it, with no shift among them."""
        x, y = (np.array([-period, 0.0, period] if period else [0.0]) for period in self.period)
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)

    def wrap(self, xy, centre=None):
        """Shift positions [n, 2] m by whole periods to within half a period of centre (default: of the domain).
        Components in non-periodic directions are returned unchanged, to the bit."""
        x0, x1, y0, y1 = self.box
        centre = ((x0 + x1) / 2, (y0 + y1) / 2) if centre is None else centre
        xy = np.array(xy, dtype=float)
        for axis, period in enumerate(self.period):
            if period > 0:
                xy[:, axis] -= period * np.floor((xy[:, axis] - centre[axis]) / period + 0.5)
        return xy

    def _world(self, pose):
        """[V, 2] m, all vertices of the floes in the world frame."""
        counts = np.diff(self.offsets)
        c, s = np.repeat(np.cos(pose[:, 2]), counts), np.repeat(np.sin(pose[:, 2]), counts)
        v = self.vertices
        return np.stack([np.repeat(pose[:, 0], counts) + c * v[:, 0] - s * v[:, 1],
                         np.repeat(pose[:, 1], counts) + s * v[:, 0] + c * v[:, 1]], axis=1)

    @cached_property
    def _padding(self):
        """[N, M] index into vertices; shorter outlines repeat their last vertex up to the length of the longest."""
        counts = np.diff(self.offsets)
        return self.offsets[:-1, None] + np.minimum(np.arange(counts.max(initial=1)), counts[:, None] - 1)

    def polygons(self, frame, centre=None):
        """Floes of a frame in the world frame: list of N arrays [n_i, 2] m, wrapped as in wrap()."""
        pose = self.pose(frame)
        pose[:, :2] = self.wrap(pose[:, :2], centre)
        return np.split(self._world(pose), self.offsets[1:-1]) if self.n_floes else []

    def polygon_array(self, frame, centre=None):
        """Floes of a frame for a PolyCollection: (outlines [K, M, 2] m, index [K]). Outlines with fewer than M vertices
        repeat their last one. Row k is floe index[k]. Existing floes come first, in order; in a periodic domain, images
        follow for floes that extend over the edge of the wrapped domain."""
        pose = self.pose(frame)
        pose[:, :2] = self.wrap(pose[:, :2], centre)
        outlines = self._world(pose)[self._padding] if self.n_floes else np.zeros((0, 1, 2))
        index = np.flatnonzero(np.isfinite(pose[:, 0]))
        if len(index) < self.n_floes:
            outlines = outlines[index]
        x0, x1, y0, y1 = self.box
        middle = ((x0 + x1) / 2, (y0 + y1) / 2) if centre is None else centre
        for axis, period in enumerate(self.period):
            if period <= 0 or not len(outlines):
                continue
            shift = np.zeros(2)
            shift[axis] = period
            low = outlines[:, :, axis].min(axis=1) < middle[axis] - period / 2
            high = outlines[:, :, axis].max(axis=1) > middle[axis] + period / 2
            outlines = np.concatenate([outlines, outlines[low] + shift, outlines[high] - shift])
            index = np.concatenate([index, index[low], index[high]])
        return outlines, index

    def body_polygons(self, frame, centre=None):
        """Bodies of a frame in the world frame: list of arrays [n, 2] m in the order of bodies. The towed body is
        wrapped as in wrap(); walls and fixed bodies keep their positions in the file."""
        pose = self.body_pose(frame)
        if self.towed is not None:
            pose[self.towed, :2] = self.wrap(pose[self.towed:self.towed + 1, :2], centre)[0]
        return [place(body.vertices, p) for body, p in zip(self.bodies, pose)]
