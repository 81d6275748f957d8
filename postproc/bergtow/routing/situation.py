# SPDX-License-Identifier: MIT
"""The input to a route plan, as the program has it: the floes, the hull, the water and the no-go areas.

The floes are those of the run: the field that `bergtow field` writes, and the bodies of a Simulation of the case that
reads it, including fixed floes and floes given by hand. Python generates no ice.
"""
import json
import os
import subprocess
from ctypes import c_double
from dataclasses import dataclass
from pathlib import Path

from bergtow import _library, writing
from bergtow._calls import called
from bergtow.arguments import read
from bergtow.case import Case
from bergtow.errors import CASE, USAGE, BergtowError, Refused, RunError
from bergtow.result.frames import lonlat_of, place as turned
from bergtow.routing import apart, planner
from bergtow.simulation import Simulation
from bergtow.study.case_file import files
from bergtow.study.runs import MESSAGES, messages

import h5py
import numpy as np

FIXED = 2  # bt_simulation: a body permanently at rest
ORIGIN = "set ice.origin_lon and ice.origin_lat to where x = y = 0 lies, unless the ice is outlines in metres"
BENT, HALVINGS = 1.0, 12  # m, of the edges of a no-go area; how often one is halved at most
AROUND = 3  # reaches of a map: no-go areas are cut off so far from the origin of the case
#: keys of the tow that each route sets itself
OWN = ("waypoints", "turn_radius", "programme", "direction", "ramp")


# ---- positions


@dataclass(frozen=True)
class Place:
    """Position of x = y = 0 of a case on the earth, and the directions of its axes. origin: longitude and latitude,
    rad, or with a crs east and north there, m; None if unknown."""

    north_first: bool    #: the geographic frame: x north, y east
    origin: tuple = None
    crs: str = ""        #: of the projection of outlines in metres

    def map(self, xy):
        """[n, 2] metres east and north from metres of the case; its own inverse."""
        xy = np.asarray(xy, dtype=float).reshape(-1, 2)
        return xy[:, ::-1] if self.north_first else xy

    def degrees(self, xy):
        """[n, 2] longitude and latitude from metres of the case."""
        if self.crs:
            return np.column_stack(self._projection.transform(*(self.map(xy) + self.origin).T, direction="INVERSE"))
        return lonlat_of(self.map(xy), self.origin)

    @property
    def _projection(self):
        import pyproj
        return pyproj.Transformer.from_crs("OGC:CRS84", self.crs, always_xy=True)

    def metres(self, degrees):
        """Metres of the case, [n, 2], from longitude and latitude."""
        if self.crs:
            there = self._projection.transform(*np.asarray(degrees, dtype=float).reshape(-1, 2).T)
            return self.map(np.column_stack(there) - self.origin)
        lib, north, east, out = _library.library(), c_double(), c_double(), []
        for lon, lat in np.radians(np.asarray(degrees, dtype=float).reshape(-1, 2)):
            lib.bt_outline_project(lon, lat, *self.origin, north, east)
            out.append((east.value, north.value))
        return self.map(out)


def number(text, unit, option):
    """A number with a unit, as the program reads it. Raises RunError."""
    if not text.strip():
        raise RunError(option.strip(), "a number is missing", "write one on each side of a comma; see bergtow route "
                       "--help", USAGE)
    try:
        return read(text, unit)
    except BergtowError as error:
        raise RunError(option, str(error), "see bergtow route --help", USAGE) from None


def position(text, place, option):
    """(x, y) in m of the case, from "X,Y" with any unit of length or from degrees, "20.1E,76.5N". Raises RunError."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 2:
        raise RunError(f"{option} {text}", "is not a position", "write it as X,Y in metres of the case, or as degrees, "
                       "20.1E,76.5N", USAGE)
    sides = [part[-1:].upper() if part[-2:-1] in "0123456789. " else "" for part in parts]  # not the n of nan
    if {*sides} & {*"NESW"}:
        if not ({*sides} & {*"EW"} and {*sides} & {*"NS"}):
            raise RunError(f"{option} {text}", "is not a place on the earth", "write a longitude and a latitude, as in "
                           "20.1E,76.5N", USAGE)
        if place.origin is None:
            raise RunError(f"{option} {text}", "is in degrees, but the map of this case has no place",
                           f"{ORIGIN}, or write metres of the case", USAGE)
        values = dict(zip(sides, (number(part[:-1], "", option) for part in parts)))
        degrees = [values.get("E", -values.get("W", 0.0)), values.get("N", -values.get("S", 0.0))]
        if abs(degrees[0]) > 360 or abs(degrees[1]) > 90:
            raise RunError(f"{option} {text}", "is not a place on the earth", "longitudes go to 360, latitudes to 90",
                           USAGE)
        return tuple(map(float, place.metres([degrees])[0]))
    return tuple(number(part, "m", option) for part in parts)


def goal(text, place):
    """A point, or the two ends "X,Y:X,Y" of a line at any point of which the tow may end. Raises RunError."""
    ends = [position(part, place, "--to") for part in text.split(":")]
    if len(ends) > 2 or len(ends) == 2 and ends[0] == ends[1]:
        raise RunError(f"--to {text}", "is neither a point nor a line", "write X,Y or X,Y:X,Y", USAGE)
    return ends[0] if len(ends) == 1 else tuple(ends)


def no_go_file(path, place):
    """For each polygon of a file its pieces [n, 2] around the case, m. Raises RunError, with CASE for what the file
    holds."""
    if not path.exists():
        raise RunError(path, "no such file", "name a file of polygons")
    try:
        return no_go_areas(path, place)
    except RunError as error:
        if error.path == path and path.is_file():
            error.status = CASE
        raise


def no_go_areas(path, place):
    """Read and checked as `bergtow outlines` reads a map. Holes count as land. Raises RunError."""
    from bergtow.maps import plane as map_plane
    from bergtow.maps import read as map_read
    from shapely.geometry import Polygon
    from shapely.validation import make_valid
    found = map_read.read(path, map_read.Reading(stairs="keep", bare=True,
                                                 choose="write one of them to a file of its own (ogr2ogr)"))
    if found.seen is not None or found.skipped:
        odd = [name for names in found.skipped.values() for name in names]
        raise RunError(path, "is an image" if not odd else f"{odd[0]} is not a polygon", "give polygons alone")
    if found.crs is None:
        raise RunError(path, "names no coordinate reference system", "give it one (ogr2ogr -a_srs)")
    crs = map_plane.system(path, found.crs, None, found.implied)
    local = isinstance(crs, str)
    if not local and place.origin is None:
        raise RunError(path, "has places on the earth, but the map of this case has none",
                       f"{ORIGIN}, or give the file metres and the crs {map_read.local_crs()}")
    found.implied = False  # there is no --crs here to say otherwise
    plane = map_plane.Plane.of(found, crs, None if local else tuple(place.degrees([(0, 0)])[0]), None)
    around = None if local else around_case(crs, place)

    def metres(xy):
        return place.map(xy) if local else place.metres(plane.lonlat(xy))

    polygons = []
    for k, polygon in enumerate(p for s in found.shapes for p in getattr(s.geometry, "geoms", [s.geometry])):
        ring = np.array(polygon.exterior.coords)
        whole = Polygon(ring if local or not crs.is_geographic else unwrapped(ring))
        if not whole.area > 0:
            raise RunError(path, f"polygon {k + 1} has no area", "correct it or remove it")
        parts = make_valid(whole).intersection(around) if around else whole
        polygons.append([unbent(np.array(part.exterior.coords), metres)[:-1] for part in
                         getattr(parts, "geoms", [parts]) if part.geom_type == "Polygon" and part.area > 0])
    if not local and crs.is_geographic and not any(polygons):
        swapped = np.concatenate([map_plane.vertices(s.geometry)[:, ::-1] for s in found.shapes])
        reach = _library.limit("map_farthest_m")
        if np.all(np.abs(swapped[:, 1]) <= 90) and np.all(np.hypot(*place.metres(swapped).T) < reach):
            raise RunError(path, "is far from the map of this case, and on it with latitude and longitude swapped",
                           "write longitude first")
    return polygons


def around_case(crs, place):
    """The surroundings of a case in the coordinates of a map, as a polygon. Projected as a whole, a continent may lie
    around the case: it holds the antipode."""
    import pyproj
    from shapely.geometry import Polygon, box
    from shapely.ops import unary_union
    (lon, lat), = place.degrees([(0, 0)])
    reach = AROUND * _library.limit("map_farthest_m")
    if not crs.is_geographic:
        x, y = pyproj.Transformer.from_crs("OGC:CRS84", crs, always_xy=True).transform(lon, lat)
        half = 10 * reach  # Mercator's metres are that long at 84 degrees
        return box(x - half, y - half, x + half, y + half) if np.isfinite(x + y) else Polygon()
    high = np.degrees(reach / 6.37e6)
    farthest = abs(lat) + high
    wide = high / np.cos(np.radians(farthest)) if farthest < 90 else 180
    if wide >= 180:
        return box(-1e3, max(lat - high, -90), 1e3, min(lat + high, 90))
    return unary_union([box(lon + turn - wide, lat - high, lon + turn + wide, lat + high)
                        for turn in range(-720, 721, 360)])


def unwrapped(ring):
    """A closed ring [n, 2] in degrees whose longitudes do not jump; one around a pole is closed along its longitude."""
    way = np.diff(ring[:, 0])
    way -= np.where(np.abs(way) < 359.9, 360 * np.round(way / 360), 0)
    ring = np.column_stack([ring[0, 0] + np.r_[0, np.cumsum(way)], ring[:, 1]])
    if abs(ring[-1, 0] - ring[0, 0]) < 180:
        return ring
    pole = np.copysign(90, ring[:, 1].mean())
    return np.r_[ring, [[ring[-1, 0], pole], [ring[0, 0], pole], ring[0]]]


def unbent(ring, metres):
    """A closed ring [n, 2] of a map, whose edges are straight there, in m of the case, with vertices added until each
    edge keeps within BENT of a chord. metres(xy): the projection."""
    xy = metres(ring)
    for _ in range(HALVINGS):
        middle = (ring[:-1] + ring[1:]) / 2
        there = metres(middle)
        bent = np.hypot(*(there - (xy[:-1] + xy[1:]) / 2).T) > BENT
        if not bent.any():
            break
        at = np.flatnonzero(bent) + 1
        ring, xy = np.insert(ring, at, middle[bent], axis=0), np.insert(xy, at, there[bent], axis=0)
    return xy


# ---- the case


def own_case(path, sets, values, folder, map_file=None, force=False):
    """Write FOLDER/route-base.yml: the case merged with the files that it is based on, and without the keys that a
    route sets. sets: ["key=value"] of the user; values: {key: text} of this command. Returns its path, and the user's
    tow.ramp or None, because a speed programme cannot include a ramp. Raises RunError."""
    merged = {}
    for file, some in reversed(files(path)):
        some = {k: v for k, v in some.items() if k != "base"}
        for name, section in _rebased(some, file.parent).items():
            old = merged.get(name)
            merged[name] = _merged(old, section) if isinstance(old, dict) and isinstance(section, dict) else section
    given = [text.partition("=")[::2] for text in sets]
    if map_file is not None:
        for key in ("field", "outlines"):
            merged.get("ice", {}).pop(key, None)
        kind = {".h5": "field", ".geojson": "outlines", ".json": "outlines"}.get(map_file.suffix.lower())
        if kind is None:
            raise RunError(map_file, "is neither a field nor outlines",
                           "make outlines of it with `bergtow outlines`, and name the .geojson", USAGE)
        if not map_file.is_file():
            raise RunError(map_file, "no such file", "name a field (.h5) or outlines (.geojson) with --map")
        merged["ice"] = {**merged.get("ice", {}), kind: str(map_file.resolve())}
        for key in ("ice.seed", *_library.unused(json.dumps(merged))):
            if key.startswith("ice."):
                _drop(merged, key.split("."))
    for key, value in [*given, *values.items()]:
        node, (*parents, last) = merged, key.strip().split(".")
        for name in parents:
            node = node.setdefault(name, {})
        value = value.strip()
        node[last] = str((path.parent / value).resolve()) if is_file(path.parent, value) else value
    ramp = merged.get("tow", {}).get("ramp")
    for key in OWN:
        merged.get("tow", {}).pop(key, None)
    out = folder / "route-base.yml"
    text = f"# {path.name} without the path of the tow, which each route gives; {writing.MARK}\n"
    writing.write_text(text + json.dumps(merged, indent=1, ensure_ascii=False) + "\n", out, force)
    return out, ramp


def is_file(folder, text):
    """Does this text of a case name an existing file, such as a table, outlines or a field? The key does not matter, so
    that none is forgotten; a title that happens to be a file name does no harm."""
    try:
        return (folder / text).is_file()
    except (OSError, ValueError):
        return False


def _drop(section, names):
    """Remove a key from a case. names: the path to it."""
    for name in names[:-1]:
        section = section.get(name, {})
    if isinstance(section, dict):
        section.pop(names[-1], None)


def _merged(old, new):
    out = dict(old)
    for key, value in new.items():
        out[key] = _merged(out[key], value) if isinstance(value, dict) and isinstance(out.get(key), dict) else value
    return out


def _rebased(node, folder):
    """Make file names absolute."""
    if isinstance(node, dict):
        return {key: _rebased(below, folder) for key, below in node.items()}
    if isinstance(node, list):
        return [_rebased(below, folder) for below in node]
    if isinstance(node, str) and is_file(folder, node):
        return str((folder / node).resolve())
    return node


@dataclass(frozen=True)
class Situation:
    """A case before its tow."""

    case: Path            #: route-base.yml, without the path of the tow
    field: Path           #: the floes as written by `bergtow field`
    values: Case          #: every key
    place: Place
    ice: planner.Ice
    hull: planner.Hull
    mass: float           #: of the body including added mass, kg
    outline: np.ndarray   #: [n, 2] of the hull, m from its centroid, at yaw 0
    start: tuple          #: (x, y), m
    extent: tuple         #: (x0, y0, x1, y1), m
    no_go: list           #: polygons [n, 2], m: from --no-go, and fixed floes
    no_go_files: list     #: [{"file", "polygons", "in_domain"}]: how many polygons it has, and how many meet the domain
    drift: tuple          #: mean velocity of the floes, m/s
    water: tuple          #: of the water, m/s
    ramp: float           #: tow.ramp, s
    moving: np.ndarray    #: indices of the floes that are not fixed
    known: tuple = None   #: (x0, y0, x1, y1) where the map of the ice ends, m; None: it has no end

    @property
    def mode(self):
        return self.values["tow.mode"]

    @property
    def line(self):
        """Distance from the centroid of the body to the towing end, m: the line plus the arm to its attachment point; 0
        if the speed of the body itself is prescribed."""
        v = self.values
        return 0.0 if self.mode == "speed" else v["tow.line_length"] + np.hypot(v["tow.hull_x"], v["tow.hull_y"])


def field(program, case, folder):
    """Write FOLDER/ice.h5, the floes of a case. Raises RunError with the program's message."""
    folder.mkdir(parents=True, exist_ok=True)
    out = folder / "ice.h5"
    code, said = called([str(program), "field", str(case), "-o", str(out), "--force"], stdout=subprocess.DEVNULL,
                        env=os.environ | MESSAGES)
    if code:
        raise Refused(case, messages(said), code, "the field is refused")
    return out


def named(case, file):
    """How a Case names a file: relative to its own folder for one below that, so that the folder can be moved."""
    file, folder = Path(file).resolve(), Path(case.path).resolve().parent
    return str(file.relative_to(folder) if file.is_relative_to(folder) else file)


def reading(case, file):
    """{key: value} that make a case read its floes from a field file."""
    of_outlines = {"ice.outlines": "none", "ice.outlines_crs": "file", "ice.origin_east": "none",
                   "ice.origin_north": "none"}
    return {"ice.field": named(case, file)} | (of_outlines if case["ice.outlines"] else {})


def checked(values):
    """Check that a route can be planned through the ice of a case. Raises RunError."""
    mode = values["tow.mode"]
    if mode == "none" or values["body.shape"] == "none":
        raise RunError("tow.mode", "nothing is towed in this case", "set body.shape, and tow.mode to speed, line or "
                       "thrust", CASE)
    if values["domain.ends"] in ("moving", "periodic"):
        raise RunError("domain.ends", f"{values['domain.ends']} ends bring the same ice again and again, so there is "
                       "no map of it", "set domain.ends to open or wall", CASE)


def floes_of(program, case, values, folder):
    """The file that holds the floes of a case. Raises RunError."""
    return Path(case.parent, values["ice.field"]) if values["ice.field"] else field(program, case, folder)


def place_of(values, file):
    """The Place of a case, from its own keys, or from the file of its floes if they give none.
    file(): its path; called only if it may tell, since the ice is made for it."""
    north_first, keys = values["domain.frame"] == "geographic", (values["ice.origin_lon"], values["ice.origin_lat"])
    if None not in keys:
        return Place(north_first, keys)
    if not (values["ice.outlines"] or values["ice.field"]):
        return Place(north_first)
    with h5py.File(file()) as f:
        found = dict(f["floes"].attrs)
    # as src/field/field_io.c reads it: h5py gives a string of fixed length as bytes
    crs = found["crs"].decode() if isinstance(found.get("crs"), bytes) else ""
    if crs not in ("", _library.limit("map_local_crs")):
        return Place(north_first, (float(found["origin_east"]), float(found["origin_north"])), crs)
    return Place(north_first, tuple(map(float, np.radians([found["origin_lon"], found["origin_lat"]])))
                 if "origin_lon" in found else None)


def of(program, case, folder, ramp=None, no_go=(), width=None):
    """The Situation of a case. no_go: files; width: of the hull across its path, m; None: the mean over all headings.
    Raises RunError, CaseError."""
    values = Case(case)
    checked(values)
    field_file = floes_of(program, case, values, folder)
    place = place_of(values, lambda: field_file)
    x0, y0 = values["domain.x0"], values["domain.y0"]
    x1, y1 = x0 + values["domain.length"], y0 + values["domain.width"]
    domain = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    areas = {file: no_go_file(file, place) for file in no_go}
    with Simulation(Case(case, reading(values, field_file)), threads=1) as sim:
        body, motion, ice = sim.towed, sim.motions, sim.thicknesses > 0
        outlines = [sim.outline(i) for i in range(sim.n_bodies)]
        floes = np.flatnonzero(ice & (motion != FIXED))
        fixed = [outlines[i] for i in np.flatnonzero((motion == FIXED) & ice)]
        (skin, form), mass = sim.drags[body, :2], sim.masses[body, 0]
        start, radius = sim.positions[body], sim.radii[body]
        drift = sim.velocities[floes, :2].mean(axis=0) if len(floes) else np.zeros(2)
        thickness = sim.thicknesses[floes]
        water = _water(values, sim)
    hull = outlines[body] - start[:2]
    # the mean width of a convex outline over all headings is its perimeter over pi (Cauchy)
    across = width or np.sum(np.hypot(*(np.roll(hull, -1, 0) - hull).T)) / np.pi
    density, kappa = values["ice.density"], values["ice.rafting.kappa"]
    rise = _library.library().bt_case_rise(density, values["water.density"])
    rafting = 0.5 * kappa * rise if kappa > 0 else np.inf
    return Situation(
        case=case, field=field_file, values=values, place=place,
        ice=planner.Ice(outlines=[outlines[i] for i in floes], thickness=thickness, density=density,
                        added_mass=values["ice.added_mass"], rafting=rafting),
        hull=planner.Hull(width=across, radius=radius, drag=skin + form * across), mass=mass,
        outline=turned(hull, (0, 0, -start[2])),
        start=tuple(map(float, start[:2])),
        extent=(x0, y0, x1, y1),
        no_go=[piece for some in areas.values() for pieces in some for piece in pieces] + fixed,
        no_go_files=[{"file": str(file), "polygons": len(some),
                      "in_domain": sum(any(apart.of(piece, domain) == 0 for piece in pieces) for pieces in some)}
                     for file, some in areas.items()],
        drift=tuple(map(float, drift)), water=water,
        ramp=Case(case, {"tow.ramp": ramp})["tow.ramp"] if ramp is not None else values["tow.ramp"],
        moving=floes, known=end_of_map(values, field_file))


def end_of_map(values, file):
    """Where the ice that a case reads ends, (x0, y0, x1, y1), m, as its field file says; None if the ice is made."""
    if not (values["ice.outlines"] or values["ice.field"]):
        return None
    with h5py.File(file) as f:
        found = [f["floes"].attrs.get(name, 0.0) for name in ("x_min", "y_min", "x_max", "y_max")]
    return tuple(map(float, found)) if found[0] < found[2] and found[1] < found[3] else None


def _water(values, sim):
    """Velocity of the water at the start, m/s."""
    if not (values["water.current_table"] or values["water.tide.major"]):
        return values["water.current_x"], values["water.current_y"]
    sim.step(1)
    return sim["current_x"], sim["current_y"]
