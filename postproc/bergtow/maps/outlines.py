# SPDX-License-Identifier: MIT
"""From a map of the ice to floe outlines that bergtow reads: any vector format that GDAL reads, or an image of labels.

    bergtow outlines MAP -o FILE.geojson --centre LON,LAT        FILE.geojson, and one line for each kind of change

The outlines are projected onto a plane centred at the towed body (maps/plane.py) and repaired into valid floes, with
every change counted (maps/repair.py). They are written in degrees, or in metres if the map has no geographic position
or if a heading is given. A case reads the file through ice.outlines.
"""
import argparse
import functools
import math
from pathlib import Path

from bergtow import _library, arguments, writing
from bergtow.errors import USAGE, BergtowError, RunError
from bergtow.maps import doubts as map_doubts
from bergtow.maps import plane as map_plane
from bergtow.maps import read as map_read
from bergtow.maps import repair as map_repair
from bergtow.maps import text as map_text
from bergtow.said import say

import numpy as np

PIXEL = 0.55            # tolerance, in pixels: with half a pixel, the steps along a straight shore would be a tie
MARGIN = 1.0            # m, between the floes and the edge of the domain
LEAST_SIZE = 0.01       # m, mean; if smaller, the metres are probably degrees
EDGE = 64               # pieces per edge of the image, which is curved in the plane


def listed(text, kind, fits, words):
    """Read finite numbers of a kind that commas separate. words: what is wrong if they do not fit, and the remedy."""
    try:
        some = tuple(kind(part) for part in text.split(","))
    except ValueError:
        some = ()
    if not (some and fits(len(some)) and all(abs(x) < math.inf for x in some)):
        raise argparse.ArgumentTypeError(f"{text}: {words}")
    return some


place = functools.partial(listed, kind=float, fits=lambda n: n == 2,
                          words="is not a place; write two numbers, LON,LAT")
integers = functools.partial(listed, kind=int, fits=lambda n: True, words="are not labels; write whole numbers, 0,3")
metres = arguments.measure("m")


def extent(text):
    parts = text.split(",")
    if len(parts) != 2:
        raise argparse.ArgumentTypeError(f"{text}: is not an extent; write for example 2km,800m")
    return tuple(map(metres, parts))


def corners(text):
    """Read X,Y,X,Y,..."""
    some = listed(text, float, lambda n: n >= 6 and n % 2 == 0,
                  "are not corners; write at least three, column,row,column,row,...")
    return tuple(zip(some[::2], some[1::2]))


def options(p):
    p.add_argument("map", metavar="MAP", type=Path)
    p.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="GeoJSON to write")
    p.add_argument("--centre", metavar="LON,LAT", type=place, help="position of the towed body, x = y = 0: "
                   "degrees on WGS 84; east and north of a local map (default: the middle of the map)")
    p.add_argument("--heading", metavar="DEG", type=arguments.between(-360, 360), help="direction of x, clockwise from "
                   "north: metres for the basin's frame are written (default: degrees for the geographic frame, or "
                   "metres of a local map)")
    p.add_argument("--crs", help="coordinate reference system, if the file does not name it: EPSG:..., any other "
                   "name that PROJ knows, or local: metres east and north without a place on the earth")
    p.add_argument("--layer", metavar="NAME",
                   help="layer to read, if there are several; the grid of a NetCDF or HDF5 file")
    p.add_argument("--where", metavar="SQL", help="read only features that meet this condition, e.g. \"kind = 'ice'\"")
    p.add_argument("--thickness", metavar="COLUMN", help="column with the thickness, m (default: thickness); for an "
                   "image, the thickness of each label: 1=0.5,2=1.2")
    p.add_argument("--water", metavar="N,...", type=integers, default=(0,), help="labels of an image that mark water "
                   "(default 0); each connected region of another label is a floe")
    p.add_argument("--nodata", choices=("water", "unseen"), help="meaning of an image's nodata (default: unseen; "
                   "required where --water has the same value)")
    p.add_argument("--unseen", metavar="N,...", type=integers, default=(), help="labels of an image that mark "
                   "areas not seen")
    p.add_argument("--footprint", metavar="X,Y,X,Y,...", type=corners, help="corners of the imaged area, as columns "
                   "and rows of the image from its upper left; the area around it was not seen")
    p.add_argument("--band", metavar="N", type=int, help="band of the image that has the labels, from 1")
    p.add_argument("--pixel", metavar="LENGTH", type=metres,
                   help="size of a pixel, for an image without a georeference")
    p.add_argument("--box", metavar="LENGTH,WIDTH", type=extent, help="keep only floes whose middle lies in this "
                   "rectangle about the centre, along x and y of the case")
    p.add_argument("--clear", metavar="RADIUS", type=metres, default=0.0, help="leave out floes that reach into this "
                   "circle about the centre, to make room for the towed body; the map may show the body itself")
    p.add_argument("--cut", choices=("keep", "drop"), default="keep", help="keep or drop floes cut by "
                   "the edge of the image (default: keep)")
    p.add_argument("--stairs", choices=("undo", "keep"), default="undo", help="undo staircases along "
                   "pixels, within half a pixel (each floe keeps its area), or keep them, apart from the tolerance")
    p.add_argument("--tolerance", metavar="LENGTH", type=metres, help="how far an outline may move when it is "
                   "simplified, and the width of a sliver (default: 0.55 pixels; a thousandth of the mean floe size)")
    p.add_argument("--least", metavar="AREA", type=arguments.not_below_zero,
                   help="smallest floe, m² (default: four pixels; 0)")
    p.add_argument("--record", metavar="FILE", type=Path, help="also write the printed report as JSON")
    p.add_argument("--picture", metavar="FILE", type=Path,
                   help="draw the map and the resulting floes (.png, .pdf, .svg)")
    arguments.add_force(p)

def check_files(a):
    """Check, before any work, the file names and whether the files may be written."""
    kinds = (a.output, (".geojson", ".json")), (a.record, (".json",)), (a.picture, writing.PICTURES)
    for file, allowed in kinds:
        if file:
            arguments.ends_in(file, allowed)
    written = [file for file, _ in kinds if file]
    if len({f.resolve() for f in [a.map, *written]}) <= len(written):
        raise BergtowError("the map and the files to write need different names", USAGE)
    for file in written:
        writing.may_write(file, a.force)


def in_plane(found, plane):
    """Shapes in metres in the plane, and the largest bend there of edges that are straight on the map, m."""
    bend = 0.0
    for shape in found.shapes:
        there = map_read.moved(shape.geometry, plane.onto)
        if there.distance(map_repair.Point(0, 0)) < _library.limit("map_farthest_m"):  # others: too far away
            bend = max(bend, bent(shape.geometry, plane))
        shape.geometry = there
        if shape.pixels is not None:
            shape.pixels = map_read.moved(shape.pixels, plane.onto)
    if found.seen is not None:
        found.seen = map_read.moved(found.seen, lambda xy: plane.onto(divided(xy, EDGE)))
    return bend


def divided(ring, n):
    """A closed ring with each edge divided into n pieces."""
    t = np.arange(n)[:, None, None] / n
    between = ring[:-1] + t * np.diff(ring, axis=0)
    return np.r_[between.swapaxes(0, 1).reshape(-1, 2), ring[:1]]


def bent(geometry, plane):
    worst = 0.0
    for p in getattr(geometry, "geoms", [geometry]):
        ring = np.asarray(p.exterior.coords)
        if not isinstance(plane.crs, str) and plane.crs.is_geographic:  # an edge across the 180th meridian is short
            ring = ring.copy()
            ring[:, 0] = np.unwrap(ring[:, 0], period=360)
        xy, between = plane.onto(ring), plane.onto((ring[:-1] + ring[1:]) / 2)
        worst = max(worst, float(np.hypot(*(between - (xy[:-1] + xy[1:]) / 2).T).max()))
    return worst


def rules_of(a, found):
    """Lengths for the repair; for an image they follow from its pixels."""
    pixel = math.sqrt(found.seen.area / found.pixels) if found.pixels else None
    along = a.box if a.heading is not None or not a.box else a.box[::-1]  # x of the geographic frame points north
    return map_repair.Rules(detail=a.tolerance or 0.0, tolerance=a.tolerance or (PIXEL * pixel if pixel else None),
                            least=a.least if a.least is not None else 4 * pixel ** 2 if pixel else 0.0,
                            keep_cut=a.cut == "keep", box=along, clear=a.clear)


def summed_up(floes, found, rules):
    """Statistics of the floes, over the box or over the rectangle around them."""
    bounds = np.array([f.polygon.bounds for f in floes])
    reach = (*bounds[:, :2].min(axis=0), *bounds[:, 2:].max(axis=0))
    half = [v / 2 for v in rules.box] if rules.box else None
    x0, y0, x1, y1 = (-half[0], -half[1], *half) if half else reach
    rectangle = map_read.Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    hull = found.seen is None  # outlines alone do not tell which area was observed
    seen = rectangle.intersection(map_repair.hull_of_shapes(found.shapes) if hull else found.seen.buffer(0))
    boxed = hull and rules.box  # the user gives the mapped area
    ground = rectangle if boxed else seen
    if rules.clear:
        ground = ground.difference(map_repair.Point(0, 0).buffer(rules.clear, 64))
    if not ground.area > 0:
        raise RunError(found.path, "has nothing of the box in its image", "set --centre, or --box")
    whole = map_read.prep(ground).contains
    ice = sum(f.polygon.area if whole(f.polygon) else f.polygon.intersection(ground).area for f in floes)
    refers_to = map_text.BOX if boxed else map_text.HULL if hull else map_text.IMAGED
    return map_text.numbers(floes, (x0, x1, y0, y1), ice / ground.area, refers_to,
                            seen.area / rectangle.area) | {"reach_m": list(reach)}


def geojson(floes, found, plane):
    """The GeoJSON text. A file in degrees carries its centre where the reader of the program looks for it."""
    local = isinstance(plane.crs, str) or plane.heading is not None
    mark = {"frame": "basin"} if plane.heading is not None else {} if local else {"origin": list(plane.centre)}
    head = {"bergtow": mark}
    if found.about:
        head["description"] = found.about
    if local:
        head["crs"] = {"type": "name", "properties": {"name": map_read.local_crs()}}
    lines = []
    for k, floe in enumerate(floes):
        ring = np.asarray(floe.polygon.exterior.coords)
        ring = ring if floe.polygon.exterior.is_ccw else ring[::-1]
        ring = ring if local else plane.degrees(ring)
        ring[-1] = ring[0]
        properties = {"source": floe.name}
        if floe.thickness is not None:
            properties["thickness"] = floe.thickness
        if floe.cut:
            properties["cut_by_edge"] = True
        lines.append({"type": "Feature", "id": k, "properties": properties,
                      "geometry": {"type": "Polygon", "coordinates": [ring.tolist()]}})
    return writing.collection(head, lines)


def perform(a):
    check_files(a)
    how = map_read.Reading(a.layer, a.where, a.thickness, a.water, a.band, a.pixel, a.nodata, a.unseen, a.footprint,
                           a.stairs)
    found = map_read.read(a.map, how)
    crs = map_plane.system(found.path, found.crs, a.crs, found.implied)
    plane = map_plane.Plane.of(found, crs, a.centre, a.heading)
    map_read.mark_cut(found, degrees=not isinstance(crs, str) and crs.is_geographic)
    book = map_repair.Ledger()
    for why, names in found.skipped.items():
        for name in names:
            book.note(why, name)
    bend = in_plane(found, plane)
    rules = rules_of(a, found)
    floes = map_repair.repaired(found.shapes, rules, book)
    say("\n".join(map_text.map_lines(found, crs, a.crs)))
    if not floes:
        say("\n".join(map_text.change_lines(book)))
        raise RunError(found.path, "leaves no floe", "see the changes: --box, --clear, --least, --tolerance, --cut")
    distortion, numbers = plane.distortion(map_repair.hull_of(floes)), summed_up(floes, found, rules)
    farthest = _library.limit("map_farthest_m")
    if distortion["farthest_m"] > farthest:
        raise RunError(found.path, f"has floes {distortion['farthest_m'] / 1e3:.4g} km from the centre; bergtow allows "
                       f"{farthest / 1e3:g} km", "choose part of it with --box or --where, or set --centre")
    if numbers["mean_size_m"] < LEAST_SIZE:
        raise RunError(found.path, f"has floes of {numbers['mean_size_m']:.2g} m on average, as degrees look in "
                       "metres", "say its crs: --crs EPSG:4326")
    say("\n".join(map_text.plane_lines(plane, distortion, bend)))
    say(f"tolerance: {map_text.length(rules.tolerance)}")
    say("\n".join(map_text.change_lines(book) + map_text.floe_lines(numbers)))
    writing.write_text(geojson(floes, found, plane), a.output, a.force)
    doubts = map_doubts.doubts(found, floes, book)
    for doubt in doubts:
        say(f"warning: {doubt['text']}")
    say("\n".join(map_text.case_lines(a.output, numbers, a.heading, MARGIN,
                                      None if isinstance(crs, str) else plane.centre[1])))
    say(a.output)
    if a.record:
        record = map_text.record(found, plane, crs, distortion, bend, book, rules, numbers) | {"warnings": doubts}
        writing.write_json(record, a.record, a.force)
        say(a.record)
    if a.picture:
        from bergtow.maps import picture as map_picture
        map_picture.draw(found, floes, rules, plane, a.picture, a.force)
