# SPDX-License-Identifier: MIT
"""Members of a map: possible states of the ice, given the errors of the map. All routes use the same members.

    position    m, standard deviation of a floe's position along each axis: half of the variance belongs to the whole
                map (georeferencing), half to the floe. A floe's own part is limited to half the distance to the
                nearest other floe, so that none overlap; across walls the map is not shifted.
    thickness   standard deviation / thickness, lognormal: half of the variance for the whole map, half for the floe
    drift       m/s, standard deviation of each component of the drift: added as a current, with which ice and body
                drift

The halves are assumed. Floes that end up on the towed body or outside the domain are left out, and counted.
"""
import math
from dataclasses import dataclass

from bergtow import writing
from bergtow.errors import CASE, RunError
from bergtow.result.frames import place
from bergtow.routing import apart
from bergtow.routing.situation import named, reading

import h5py
import numpy as np
from scipy.spatial import cKDTree

SEED = 53


@dataclass(frozen=True)
class Errors:
    """Standard deviations of a map."""

    position: float   #: m
    thickness: float  #: relative to the thickness
    drift: float      #: m/s

    @property
    def none(self):
        return not (self.position or self.thickness or self.drift)


@dataclass
class Member:
    """One possible state of the ice."""

    keys: dict           #: keys of the case, as texts
    left_out: int = 0    #: number of floes on the towed body or outside the domain
    drift: tuple = (0.0, 0.0)  #: added to the drift of the map, m/s


@dataclass
class Floes:
    """A field file."""

    vertices: np.ndarray
    offsets: np.ndarray
    pose: np.ndarray
    thickness: np.ndarray
    area: np.ndarray
    attributes: dict

    @classmethod
    def read(cls, file):
        with h5py.File(file) as f:
            g = f["floes"]
            return cls(*(g[name][...] for name in ("vertices", "offsets", "pose", "thickness", "area")),
                       {k: g.attrs[k] for k in ("ice_area", "frame", "x_min", "x_max", "y_min", "y_max", "crs",
                                                "origin_lon", "origin_lat", "origin_east", "origin_north")
                        if k in g.attrs})

    def write(self, file):
        with writing.written(file, True) as new, h5py.File(new, "w") as f:
            g = f.create_group("floes")
            for name in ("vertices", "offsets", "pose", "thickness", "area"):
                g[name] = getattr(self, name)
            for name, value in self.attributes.items():
                g.attrs[name] = value
            g.attrs["concentration"] = self.area.sum() / g.attrs["ice_area"]
            g.attrs["n_floes"] = len(self.area)

    def outlines(self):
        """[n, 2] each, m. Computed number by number: the last digit of NumPy's matrix products, sines and cosines
        depends on memory alignment, and the members of a map must be identical to the bit in every call."""
        turn = [(math.cos(yaw), math.sin(yaw)) for yaw in self.pose[:, 2]]
        at = np.hstack([self.pose[:, :2], np.reshape(turn, (-1, 2))])
        x, y, c, s = np.repeat(at, np.diff(self.offsets), axis=0).T
        u, v = self.vertices.T
        return np.split(np.stack([c * u - s * v + x, s * u + c * v + y], axis=1), self.offsets[1:])[:-1]

    def take(self, kept):
        """Only the floes in `kept`."""
        counts = np.diff(self.offsets)
        owner = np.repeat(kept, counts)
        return Floes(self.vertices[owner], np.append(0, np.cumsum(counts[kept])), self.pose[kept],
                     self.thickness[kept], self.area[kept], self.attributes)


def period_of(situation):
    """[2] m, of the domain along each axis; 0 along one that does not repeat itself."""
    repeats = [situation.values[f"domain.{side}"] == "periodic" for side in ("ends", "sides")]
    return np.where(repeats, np.subtract(situation.extent[2:], situation.extent[:2]), 0.0)


def images(period):
    """Shifts to a floe and its neighbouring images; of each two that are opposite only one, since i moved by a period
    beside j is j moved back beside i."""
    return sorted({(a * period[0], b * period[1]) for a, b in ((0, 0), (1, 0), (0, 1), (1, 1), (1, -1))})


def room(outlines, most, period=(0.0, 0.0)):
    """[n] half the distance from each floe to its nearest neighbour, m, at most `most`. period: as of period_of()."""
    out = np.full(len(outlines), float(most))
    if len(outlines) < 2 or not most > 0:
        return out
    centre = np.array([o.mean(axis=0) for o in outlines])
    reach = np.array([apart.radius(o, c) for o, c in zip(outlines, centre)])
    tree = cKDTree(centre)
    for image in images(period):
        for i, near in enumerate(tree.query_ball_point(centre + image, reach + reach.max() + 2 * most)):
            for j in near:
                if (j > i or j != i and any(image)) and np.hypot(*(centre[i] + image - centre[j])) - reach[i] - \
                        reach[j] < 2 * max(out[i], out[j]):
                    half = apart.of(outlines[i] + image, outlines[j]) / 2
                    out[i], out[j] = min(out[i], half), min(out[j], half)
    return out


def clear_of_hull(outlines, situation, start=None, yaw=None):
    """[n] of bool: floes that do not lie on the towed body at its start, nor does any image of them."""
    start = np.array(situation.start if start is None else start)
    yaw = situation.values["body.yaw"] if yaw is None else yaw
    hull = place(situation.outline, (*start, yaw))
    reach = situation.hull.radius
    centres = [o.mean(axis=0) for o in outlines]
    shifts = {(sign * x, sign * y) for x, y in images(period_of(situation)) for sign in (1, -1)}
    return np.array([all(np.hypot(*(centre + shift - start)) > reach + apart.radius(o, centre) or
                         apart.of(o + shift, hull) > 0 for shift in shifts)
                     for o, centre in zip(outlines, centres)], dtype=bool)


def drawn(n, situation, errors, folder):
    """n Members, or a single one for a map without errors. Raises RunError."""
    as_read = reading(situation.values, situation.field)
    if errors.none:
        return [Member(as_read)]
    if errors.drift and situation.values["water.current_table"]:
        raise RunError("water.current_table", "leaves no room for an error of the drift", "set --drift-error 0, or "
                       "give a constant current in water.current_x and current_y", CASE)
    floes = Floes.read(situation.field)
    own = room(floes.outlines(), 4 * errors.position, period_of(situation)) if errors.position else None
    folder.mkdir(parents=True, exist_ok=True)
    return [one(k, floes, own, situation, errors, folder, as_read) for k in range(n)]


def one(k, floes, own, situation, errors, folder, as_read):
    """Member k, whose ice is FOLDER/mNNN.h5."""
    rng, n, values = np.random.default_rng([SEED, k]), len(floes.area), situation.values
    walled = np.array([values[f"domain.{side}"] == "wall" for side in ("ends", "sides")])
    # all random numbers are drawn whatever the errors, so that larger errors scale the same member
    common, shift, thick, each, current = (rng.standard_normal(shape) for shape in (2, (n, 2), (), n, 2))
    pose, half = floes.pose.copy(), np.sqrt(0.5)
    low, high = np.array(situation.extent[:2]), np.array(situation.extent[2:])
    if errors.position and n:
        step = errors.position * half * shift
        length = np.hypot(*step.T)
        limit = own.copy()
        for axis in np.flatnonzero(walled):
            ends = np.array([(o[:, axis].min(), o[:, axis].max()) for o in floes.outlines()])
            limit = np.minimum(limit, np.maximum(0, np.minimum(ends[:, 0] - low[axis], high[axis] - ends[:, 1])))
        pose[:, :2] += step * np.minimum(1, limit / np.maximum(length, 1e-300))[:, None]
        pose[:, :2] += np.where(walled, 0.0, errors.position * half * common)
    sigma = np.sqrt(np.log1p(errors.thickness ** 2))
    factor = np.exp(sigma * half * (thick + each) - sigma ** 2 / 2)
    moved = Floes(floes.vertices, floes.offsets, pose, np.clip(floes.thickness * factor, 1e-6, 100), floes.area,
                  floes.attributes)
    at = moved.pose[:, :2]
    moved.pose[:, :2] = np.where(period_of(situation) > 0, low + (at - low) % (high - low), at)
    kept = np.all((moved.pose[:, :2] >= low) & (moved.pose[:, :2] <= high), axis=1)
    kept &= clear_of_hull(moved.outlines(), situation)
    file = folder / f"m{k + 1:03d}.h5"
    moved.take(kept).write(file)
    drift = errors.drift * current
    keys = as_read | {"ice.field": named(values, file)}
    if errors.drift:
        keys |= {f"water.current_{axis}": f"{values[f'water.current_{axis}'] + d:.12g} m/s"
                 for axis, d in zip("xy", drift)}
    return Member(keys, int(np.sum(~kept)), tuple(map(float, drift)))
