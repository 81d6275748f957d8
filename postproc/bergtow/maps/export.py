# SPDX-License-Identifier: MIT
"""From the folder of a run back to the map: floes at a time, tracks of iceberg, towing end and vessel, loads.

    bergtow export RUN -o after.gpkg                     floes, bodies, tracks and loads, one layer each
    bergtow export RUN -o after.geojson --time 600       one layer; the floes are outlines for ice.outlines
    bergtow export RUN -o drift.nc                       trajectories of everything in the frames, CF-1.8

Coordinates are those of the map that the ice came from: degrees on WGS 84, or metres of its projection. If the case
names no map, they are metres without a geographic position. The library converts between metres in the plane of the
case and degrees in both directions (bergtow/outline.h), so an exported file lies where the map lay. Formats: GeoJSON is
written here, as RFC 7946 requires, except that it may have a crs in metres, which the RFC leaves to agreement; an
outline across the 180th meridian is not cut there. GDAL writes GeoPackage and shapefile, as it reads maps.
Trajectories: discrete sampling geometry of CF-1.8, in the classic NetCDF format, at the times of the frames.
"""
import argparse
import csv
import datetime
import re
import shutil
import tempfile
from collections import namedtuple
from dataclasses import dataclass
from pathlib import Path

from bergtow import arguments, writing
from bergtow.errors import IO, USAGE, BergtowError, RunError
from bergtow.maps import plane as map_plane
from bergtow.maps import read as map_read
from bergtow.result.frames import lonlat_of
from bergtow.result.hdf5 import first_line
from bergtow.result.run import Run
from bergtow.said import say
from bergtow.table import times_text

import numpy as np

LAYERS = ("floes", "bodies", "tracks", "loads")
FRAMED = {"floes", "bodies"}  #: layers of frames; the others hold the series, which members of ensembles have, too
#: layers written if --layer is not given
DEFAULT = {".gpkg": LAYERS, ".geojson": ("floes",), ".json": ("floes",), ".shp": ("floes",), ".csv": (), ".nc": ()}
TRAJECTORIES = (".csv", ".nc")
WGS84 = {"grid_mapping_name": "latitude_longitude", "semi_major_axis": 6378137.0, "inverse_flattening": 298.257223563,
         "longitude_of_prime_meridian": 0.0}
#: positions in the series: (name of the track, its x, its y)
TRACKS = (("iceberg", "body_x", "body_y"), ("towing end", "carriage_x", "carriage_y"),
          ("vessel", "vessel_x", "vessel_y"))


# ---- position of the case


@dataclass(frozen=True)
class Place:
    """Position and orientation of the frame of a run."""

    geographic: bool     #: x is north and y east; else x is the first axis and y the second
    crs: str             #: for PROJ: OGC:CRS84 for degrees, "EPSG:32633"; "" without a geographic position
    zero: tuple          #: coordinates of x = y = 0 in the crs: longitude and latitude, or m

    @staticmethod
    def of(run):
        """The place of a run. Raises RunError."""
        a = run.map_axes
        swapped = run.geographic
        if "crs" not in a:
            return Place(swapped, "", tuple(run.number(f"outlines.origin_{a}_m", 0.0) for a in ("east", "north")))
        degrees = dict(re.findall(r"\+(lon_0|lat_0)=(\S+)", a["crs"]))
        if degrees:
            return Place(swapped, map_plane.WGS84, (float(degrees["lon_0"]), float(degrees["lat_0"])))
        origin = (a["origin_y"], a["origin_x"]) if swapped else (a["origin_x"], a["origin_y"])
        return Place(swapped, a["crs"], (a["origin_east"] - origin[0], a["origin_north"] - origin[1]))

    @property
    def degrees(self):
        return self.crs == map_plane.WGS84

    def metres(self, xy):
        """East and north [..., 2], from x = y = 0, of positions in the frame of the case."""
        return xy[..., ::-1] if self.geographic else xy

    def coordinates(self, xy):
        """Coordinates [..., 2] on the map: longitude and latitude, or east and north."""
        east_north = self.metres(np.asarray(xy, float))
        return lonlat_of(east_north, np.radians(self.zero)) if self.degrees else east_north + self.zero

    def ring(self, outline):
        """A closed ring, anticlockwise on the map, from an outline that is anticlockwise in x and y."""
        ring = self.coordinates(outline)[::-1 if self.geographic else 1]
        return np.concatenate([ring, ring[:1]])

    def lonlat(self, xy):
        """Longitude and latitude [..., 2], or None without a geographic position. Raises ModuleNotFoundError."""
        at = self.coordinates(xy)
        if self.degrees or not self.crs:
            return at if self.degrees else None
        import pyproj
        to = pyproj.Transformer.from_crs(self.crs, map_plane.WGS84, always_xy=True)
        lon, lat = to.transform(at[..., 0], at[..., 1])
        return np.where(np.isfinite(at), np.stack([lon, lat], axis=-1), np.nan)

    @property
    def words(self):
        if self.degrees:
            return "longitude and latitude, degrees on WGS 84"
        if self.crs:
            return f"{self.crs}, metres east and north"
        return f"metres without a place on the earth, {'east and north' if self.geographic else 'x and y of the basin'}"


# ---- exported quantities


#: geometry: "Polygon", "LineString" or "Point"; columns: {name: (unit or "", values [n])}; places: [n] of [k, 2] m, in
#: the frame of the case
Layer = namedtuple("Layer", "name geometry columns places")


def _iceberg(run, frame):
    """Position of the iceberg [2] m, not wrapped: frames hold it wrapped into the domain, the series do not."""
    time = run.frame_times[frame]
    way = [np.interp(time, run["time"], run[name]) for name in ("body_x", "body_y")]
    return run.wrap(run.body_pose(frame)[run.towed:run.towed + 1, :2], way)[0]


def _led(run, frame, names):
    """Position [2] m of the towing end, where a vessel is, too; not wrapped. While a line holds it is that of the
    frame, else that of the sample at the same time, NaN if there is none: frames lie between samples, and an
    interpolated position may be metres off. names: of the series."""
    end = run.towing_end(frame)
    if np.isfinite(end).all():
        return end + (_iceberg(run, frame) - run.body_pose(frame)[run.towed, :2])
    at = np.flatnonzero(run["time"] == run.frame_times[frame])
    return np.array([run[name][at[0]] if len(at) else np.nan for name in names])


def _about(run, frame):
    """Centre of the ice exported from a periodic domain: along a moving window its middle, otherwise the iceberg. None
    without an iceberg."""
    if run.towed is None:
        return None
    at, low = _iceberg(run, frame), run.window_low(frame)
    return at if low is None else np.array([low + run.period[0] / 2, at[1]])


def floes_layer(run, frames):
    places, index = [], []
    for frame in frames:
        index.append(np.flatnonzero(np.isfinite(run.pose(frame)).all(axis=1)))
        rings = run.polygons(frame, _about(run, frame))
        places += [rings[i] for i in index[-1]]
    at, index = np.repeat(frames, list(map(len, index))), np.concatenate(index)

    def of(values):
        return np.concatenate([values(f)[index[at == f]] for f in frames])

    fixed = {} if run.fixed is None else {"fixed": ("", run.fixed[index])}
    return Layer("floes", "Polygon", {
        "id": ("", run.ids[index]), "time_s": ("s", run.frame_times[at]), "thickness": ("m", run.thickness[index]),
        "area_m2": ("m2", run.area[index]), "speed_m_s": ("m/s", of(run.speed)),
        "force_n": ("N, largest normal contact force in the step", of(run.contact_force))} | fixed, places)


def bodies_layer(run, frames):
    """The iceberg and fixed bodies. Walls are boundaries of the computation and do not appear on the map."""
    rows = [(body, frame, ring) for frame in frames
            for body, ring in zip(run.bodies, run.body_polygons(frame, None if run.towed is None else
                                                                _iceberg(run, frame))) if not body.wall]
    return Layer("bodies", "Polygon", {
        "name": ("", ["iceberg" if body.towed else body.name for body, _, _ in rows]),
        "time_s": ("s", np.array([run.frame_times[frame] for _, frame, _ in rows]))}, [ring for _, _, ring in rows])


def tracks_layer(run, _):
    """Tracks of the iceberg, the towing end and the vessel over the whole run."""
    some = {name: np.column_stack([run["time"], run[x], run[y]]) for name, x, y in TRACKS if x in run}
    some = {name: rows[np.isfinite(rows[:, 1:]).all(axis=1)] for name, rows in some.items()}
    some = {name: rows for name, rows in some.items() if len(rows) > 1}
    lengths = [np.hypot(*np.diff(rows[:, 1:], axis=0).T).sum() for rows in some.values()]
    start, end = (np.array([rows[k, 0] for rows in some.values()]) for k in (0, -1))
    return Layer("tracks", "LineString", {
        "name": ("", list(some)), "start_s": ("s", start), "end_s": ("s", end), "length_m": ("m", np.array(lengths))},
        [rows[:, 1:] for rows in some.values()])


def loads_layer(run, _):
    """Forces and loads of each sample, at the position of the iceberg. Without one the series are there, but NaN."""
    if "body_x" not in run or not np.isfinite(run["body_x"]).any():
        return Layer("loads", "Point", {}, [])
    xy = np.column_stack([run["body_x"], run["body_y"]])
    names = [name for name in run.by_role("balance", "force", "load") if np.isfinite(run[name]).any()]
    return Layer("loads", "Point", {"time_s": ("s", run["time"])} |
                 {name: (run.units(name), run[name]) for name in names}, list(xy[:, None, :]))


MAKE = {"floes": floes_layer, "bodies": bodies_layer, "tracks": tracks_layer, "loads": loads_layer}


#: of everything in the frames, NaN where an object does not exist. name [n]: "floe 17", "iceberg", "towing end",
#: "vessel"; time [T] s; xy [n, T, 2] m, in the frame of the case; speed [n, T] m/s; thickness [n] m, NaN except for
#: floes
Trajectories = namedtuple("Trajectories", "name time xy speed thickness")


def trajectories(run, frames):
    """Raises RunError."""
    xy = np.stack([run.wrap(run.pose(f)[:, :2], _about(run, f)) for f in frames], axis=1)
    speed = np.stack([run.speed(f) for f in frames], axis=1)
    piece = _pieces(xy, np.array(run.period), _reach(run, frames, speed))
    ids, rows = run.ids, []
    for i in range(run.n_floes):
        for k in range(piece[i].max() + 1):
            at = (piece[i] == k) & np.isfinite(xy[i]).all(axis=1)
            if at.any():
                rows.append((f"floe {ids[i]}" + f".{k}" * (k > 0), np.where(at[:, None], xy[i], np.nan),
                             np.where(at, speed[i], np.nan), run.thickness[i]))
    for name, x, y in TRACKS:
        if x in run and np.isfinite(run[x]).any():
            berg = name == "iceberg"
            way = [_iceberg(run, f) if berg else _led(run, f, (x, y)) for f in frames]
            speeds = [run.body_speed(f)[run.towed] if berg else np.nan for f in frames]
            rows.append((name, np.array(way), np.array(speeds), np.nan))
    if not rows:
        raise RunError(run.result, "holds nothing that moves", "export a run with floes or a towed body")
    names, *columns = zip(*rows)
    return Trajectories(list(names), run.frame_times[frames], *map(np.array, columns))


def _reach(run, frames, speed):
    """[n, T - 1] m, how far a floe can be from one frame to the next without being put elsewhere by the moving window.
    A floe that waits for its place lies, by periodicity, among the ice at the front, from where it is put there: a
    step of less than half a period, and of more than twice its speed allows. The twentieth of a floe is for a start
    and a stop between two frames."""
    if run.window_low(frames) is None:
        return np.inf
    return 2 * np.fmax(speed[:, 1:], speed[:, :-1]) * np.diff(run.frame_times[frames]) + np.sqrt(run.area)[:, None] / 20


def _pieces(xy, period, reach=np.inf):
    """[n, T] index of the piece of ice that a floe represents at each time: in a periodic domain a floe left behind
    reappears one period ahead as other ice. reach: of _reach()."""
    step = np.diff(xy, axis=1)
    jumps = (np.abs(step) > np.where(period > 0, period / 2, np.inf)).any(axis=2) | (np.hypot(*step.T).T > reach)
    return np.concatenate([np.zeros((len(xy), 1), int), np.cumsum(jumps, axis=1)], axis=1)


# ---- files


def _rows(layer):
    """(properties, place) of each feature."""
    names, values = list(layer.columns), [v for _, v in layer.columns.values()]
    for k, place in enumerate(layer.places):
        yield {name: writing.plain(v[k]) for name, v in zip(names, values)}, place


def geojson(layer, place):
    """The text, with the head that `bergtow outlines` and `bergtow field` write: frame and origin for ice.outlines."""
    head = {"bergtow": {"origin": list(place.zero)} | ({} if place.crs else {
        "frame": "geographic" if place.geographic else "basin"})}
    if not place.degrees:
        head["crs"] = {"type": "name", "properties": {"name": place.crs or map_read.local_crs()}}
    lines = []
    for properties, at in _rows(layer):
        where = (place.coordinates(at[0]).tolist() if layer.geometry == "Point" else
                 [place.ring(at).tolist()] if layer.geometry == "Polygon" else place.coordinates(at).tolist())
        lines.append({"type": "Feature", "properties": properties,
                      "geometry": {"type": layer.geometry, "coordinates": where}})
    return writing.collection(head, lines)


def write_ogr(layers, place, path, driver):
    """Write layers with GDAL to a new file. Returns the names that GDAL changed, {ours: its own}."""
    from osgeo import ogr, osr
    ogr.UseExceptions()
    osr.UseExceptions()
    reference = osr.SpatialReference()
    if place.crs:
        reference.SetFromUserInput("EPSG:4326" if place.degrees else place.crs)
        reference.SetAxisMappingStrategy(osr.OAMS_TRADITIONAL_GIS_ORDER)
    else:
        reference.SetLocalCS("Undefined Cartesian SRS")
    file = ogr.GetDriverByName(driver).CreateDataSource(str(path))
    renamed = {}
    for layer in layers:
        kind = {"Polygon": ogr.wkbPolygon, "LineString": ogr.wkbLineString, "Point": ogr.wkbPoint}[layer.geometry]
        there = file.CreateLayer(layer.name, reference, kind, [f"DESCRIPTION={layer.name} of a run; {writing.MARK}"]
                                 if driver == "GPKG" else ["ENCODING=UTF-8"])
        columns = layer.columns if driver == "GPKG" else layer.columns | {"made_by": ("", [])}
        for name, (unit, values) in columns.items():
            number = np.asarray(values).dtype.kind
            kinds = {"i": ogr.OFTInteger64, "f": ogr.OFTReal, "b": ogr.OFTInteger}
            field = ogr.FieldDefn(name, kinds.get(number if unit or len(values) else "U", ogr.OFTString))
            if driver == "GPKG" and number == "b":
                field.SetSubType(ogr.OFSTBoolean)
            if driver == "GPKG" and unit:
                field.SetAlternativeName(f"{name} ({unit})")
            map_read.quietly(there.CreateField, field)
        schema = there.GetLayerDefn()
        given = [schema.GetFieldDefn(k).GetName() for k in range(schema.GetFieldCount())]
        renamed |= {ours: theirs for ours, theirs in zip(columns, given) if ours != theirs}
        there.StartTransaction()
        for properties, at in _rows(layer):
            feature = ogr.Feature(schema)
            if driver != "GPKG":
                properties["made_by"] = writing.MARK
            for k, value in enumerate(properties.values()):
                if value is not None:
                    feature.SetField(k, value)
            feature.SetGeometryDirectly(_geometry(ogr, layer.geometry, kind, place, at))
            there.CreateFeature(feature)
        there.CommitTransaction()
    there = file = None  # this closes it
    return renamed


def _geometry(ogr, name, kind, place, at):
    points = place.ring(at) if name == "Polygon" else place.coordinates(at)
    if place.degrees:  # keep it in one piece across the 180th meridian
        points = np.column_stack([np.unwrap(points[:, 0], period=360), points[:, 1]])
    if name == "Polygon":  # unwrapped, the last longitude may differ from the first by rounding
        points[-1] = points[0]
    line = ogr.Geometry(ogr.wkbLinearRing if name == "Polygon" else kind)
    for x, y in points:
        line.AddPoint_2D(x, y)
    if name != "Polygon":
        return line
    polygon = ogr.Geometry(kind)
    polygon.AddGeometry(line)
    return polygon


def write_shapefile(layer, place, path):
    """Write the files of a shapefile, the .shp last. The mark is in its table."""
    with tempfile.TemporaryDirectory() as there:
        new = Path(there) / path.name
        renamed = write_ogr([layer], place, new, "ESRI Shapefile")
        for part in sorted(Path(there).iterdir(), key=lambda p: p.suffix == path.suffix):
            with writing.written(path.with_suffix(part.suffix), True) as whole:
                shutil.copyfile(part, whole)
    return renamed


def trajectory_columns(place):
    """Names of the two coordinate columns in a table."""
    return ("longitude", "latitude") if place.degrees else ("east_m", "north_m") if place.crs or place.geographic else (
        "x_m", "y_m")


def write_table(t, place, path, force):
    at = place.coordinates(t.xy)
    with writing.written(path, force) as new, open(new, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["name", "time_s", *trajectory_columns(place), "speed_m_s", "thickness_m", "made_by"])
        mark = writing.MARK  # written once: a table of all floes has millions of rows
        for i, name in enumerate(t.name):
            for k in np.flatnonzero(np.isfinite(at[i]).all(axis=1)):
                row = writing.plain([t.time[k], *at[i, k], t.speed[i, k], t.thickness[i]])
                table.writerow([name, *("" if v is None else repr(v) for v in row), mark])
                mark = ""


def dataset(t, place, start, title):
    """Trajectories as an xarray.Dataset: multidimensional arrays as in CF-1.8, section 9 and appendix H.4. All
    trajectories share the times, which are therefore an axis, as in OpenDrift."""
    import xarray
    both = ("trajectory", "time")
    named = start or datetime.datetime(1970, 1, 1)
    time = {"standard_name": "time", "long_name": "time", "axis": "T", "calendar": "standard",
            "units": f"seconds since {named:%Y-%m-%d %H:%M:%S}"}
    if start is None:
        time["comment"] = "assumed: the case gives no date, and time zero is the start of the run"
    lonlat, at = place.lonlat(t.xy), place.coordinates(t.xy)
    coordinates = {}
    if lonlat is not None:
        coordinates = {name: (both, lonlat[..., k], {"standard_name": words, "long_name": words, "units": units})
                       for k, (name, words, units) in enumerate((("lon", "longitude", "degrees_east"),
                                                                 ("lat", "latitude", "degrees_north")))}
    variables = {
        "speed": (both, t.speed, {"long_name": "speed of the centroid", "units": "m s-1"}),
        "thickness": ("trajectory", t.thickness, {"long_name": "thickness of the floe", "units": "m",
                                                  "standard_name": "sea_ice_thickness"})}
    if not place.degrees:
        projected = [{"standard_name": f"projection_{a}_coordinate"} if place.crs else {} for a in "xy"]
        coordinates |= {a: (both, at[..., k], {"long_name": words, "units": "m"} | projected[k])
                        for k, (a, words) in enumerate(zip("xy", ("easting", "northing") if place.crs
                                                           or place.geographic else ("x of the basin",
                                                                                     "y of the basin")))}
    if place.degrees:
        variables["crs"] = ((), 0, WGS84)
    elif place.crs:
        import pyproj
        variables["crs"] = ((), 0, pyproj.CRS(place.crs).to_cf())
    if "crs" in variables:
        variables["speed"][2]["grid_mapping"] = "crs"
    names = np.array(t.name, dtype="S")
    return xarray.Dataset(
        variables | {"trajectory_name": ("trajectory", names, {"cf_role": "trajectory_id",
                                                               "long_name": "name of the body or floe"})},
        coordinates | {"time": ("time", t.time, time)},
        {"Conventions": "CF-1.8", "featureType": "trajectory", "title": title,
         "source": "bergtow, discrete element model", "made_by": writing.MARK, "comment": place.words})


def moment(text):
    """Read --time: "all", "last" or a time in s."""
    if text in ("all", "last"):
        return text
    return arguments.finite(text.removesuffix("s").strip())


def date(text):
    try:
        at = datetime.datetime.fromisoformat(text.removesuffix("Z"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text}: is not a date; write for example 2027-03-01T06:00") from None
    if at.tzinfo is not None:
        at = at.astimezone(datetime.timezone.utc).replace(tzinfo=None)
    return at


def options(p):
    p.add_argument("run", metavar="RUN", help="output folder of a run")
    p.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="file to write: .gpkg, .geojson, "
                   ".shp, or trajectories of everything as .csv or .nc (CF-1.8)")
    p.add_argument("--time", metavar="T", type=moment, help="write floes and bodies at the frame nearest to T "
                   "seconds, at the last frame, or at all (default: last; all for trajectories)")
    p.add_argument("--layer", choices=LAYERS, help="layer to write (default: all in a .gpkg, floes in a .geojson or "
                   ".shp)")
    p.add_argument("--start", metavar="DATE", type=date, help="UTC date at time zero, for a .nc: 2027-03-01T06:00 "
                   "(default: 1970, marked as assumed)")
    arguments.add_force(p)


def perform(a):
    path, kind = a.output, a.output.suffix.lower()
    arguments.ends_in(path, tuple(DEFAULT))
    of_all = kind in TRAJECTORIES
    if a.layer and of_all:
        raise BergtowError(f"--layer: {kind} holds trajectories; leave it out, or write a .gpkg, .geojson or .shp",
                           USAGE)
    if a.start and kind != ".nc":
        raise BergtowError(f"--start: {kind} holds no dates; leave it out, or write a .nc", USAGE)
    for file in (path, *([path.with_suffix(".dbf")] if kind == ".shp" else ())):
        if not (kind == ".shp" and file == path and path.with_suffix(".dbf").exists()):
            writing.may_write(file, a.force)
    if kind in (".gpkg", ".shp"):
        map_read.need()
    with Run(a.run) as run:
        place = Place.of(run)
        names = (a.layer,) if a.layer else DEFAULT[kind]
        framed = of_all or a.time is not None or not FRAMED.isdisjoint(names)
        time = ("all" if of_all else "last") if a.time is None else a.time
        frames = frames_of(run, time) if framed else []
        if of_all:
            t = trajectories(run, frames)
            if kind == ".csv":
                write_table(t, place, path, a.force)
            else:
                data = dataset(t, place, a.start, run.attributes.get("title", "") or "tow through ice")
                with writing.written(path, a.force) as new:
                    data.to_netcdf(new, engine="scipy", format="NETCDF3_64BIT", encoding={"time": {"_FillValue": None}})
            say(f"{path}: {len(t.name)} trajectories, {len(t.time)} times")
            if kind == ".nc" and not a.start:
                say("time: seconds since 1970, assumed: the case gives no date; give it with --start")
        else:
            layers = [MAKE[name](run, frames) for name in names]
            layers = [layer for layer in layers if layer.places]
            if not layers:
                raise RunError(run.result, f"has no {a.layer or 'floes'}", "choose another --layer")
            _write(layers, place, path, kind, a.force)
            say(f"{path}: {', '.join(f'{layer.name} {len(layer.places)}' for layer in layers)}")
            rafted = layers[0].name == "floes" and run.number("max_rafted_area_m2", 0.0) > 0
            if rafted and kind in (".geojson", ".json"):
                say("floes: where ice rafted they lie over each other; ice.outlines refuses such floes, and bergtow "
                    "outlines cuts them")
            if any(layer.name in FRAMED for layer in layers):
                at = run.frame_times[frames]
                say(f"frame: t = {times_text(at[0])}" if len(at) == 1 else
                    f"frames: {len(at)}, t = {times_text(at[0], at[-1])}")
        say(f"coordinates: {place.words}")


def frames_of(run, time):
    """Indices of the frames. Raises RunError; BergtowError for a time beyond the last frame."""
    run.need_frames()
    if time == "all":
        return list(range(run.n_frames))
    if time == "last":
        return [run.n_frames - 1]
    if not run.frame_times[0] <= time <= run.frame_times[-1]:
        raise BergtowError(f"--time: {times_text(time)} is outside the frames, "
                           f"{times_text(run.frame_times[0], run.frame_times[-1])}", USAGE)
    return [run.frame_at(time)]


def _write(layers, place, path, kind, force):
    renamed = {}
    try:
        if kind == ".shp":
            renamed = write_shapefile(layers[0], place, path)
        elif kind == ".gpkg":
            with writing.written(path, force) as new:
                renamed = write_ogr(layers, place, new, "GPKG")
        else:
            writing.write_text(geojson(layers[0], place), path, force)
    except RuntimeError as error:
        raise RunError(path, f"cannot be written ({first_line(error)})", "choose another place with -o",
                       IO) from None
    if renamed:
        say("columns: names in a shapefile have only ten characters: "
            + ", ".join(f"{ours} is {theirs}" for ours, theirs in renamed.items()))
