# SPDX-License-Identifier: MIT
"""Map data: where floes of a GeoJSON file lie in the frame of the case and on the map again, what the file's crs says,
and what is taken for a slip.

The reader of the files here is Python's own json, and the places on the ellipsoid are computed without the program's
formulas.
"""
import json
import math
import re

import h5py
import numpy as np
import pytest

from harness import CASE, DONE, area, call, changed, run, warned, write_case
from test_outlines import field, same_ring, vincenty

# An arrow that points north, its western barb the longer one: any mirror or quarter turn shows. Metres east, north.
ARROW = [[0, -6], [3, 2], [0, 8], [-5, 2]]
BOX = [[30, 20], [40, 20], [40, 26], [30, 26]]
SHEET = {"run": {"dt": 0.5, "duration": 2}, "ice": {"outlines": "map.geojson", "thickness": 1},
         "body": {"shape": "none"}}
FRAMES = {
    "geographic": changed(SHEET, domain={"frame": "geographic", "length": 400, "width": 300, "ends": "open",
                                         "sides": "open"}),
    "basin": changed(SHEET, domain={"frame": "basin", "x0": -200, "length": 400, "width": 300, "ends": "open",
                                    "sides": "open"}),
}
LON, LAT = 20.0, 76.5
ORIGIN = {"ice__origin_lon": LON, "ice__origin_lat": LAT}
LOCAL = "urn:x-bergtow:crs:local-metres-east-north"


def named(crs):
    return {"crs": {"type": "name", "properties": {"name": crs}}}


def feature(ring, **properties):
    geometry = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def write(folder, *rings, name="map.geojson", **more):
    folder.mkdir(parents=True, exist_ok=True)
    features = [r if isinstance(r, dict) else feature(r) for r in rings]
    (folder / name).write_text(json.dumps({"type": "FeatureCollection", "features": features} | more))


def rings_of(path):
    """What another program reads: rings without their last vertex, and the crs."""
    root = json.loads(path.read_text())
    assert root["type"] == "FeatureCollection"
    rings = []
    for f in root["features"]:
        assert f["type"] == "Feature" and f["geometry"]["type"] == "Polygon"
        ring, = f["geometry"]["coordinates"]
        assert ring[0] == ring[-1]
        rings.append(ring[:-1])
    return rings, root.get("crs", {}).get("properties", {}).get("name")


def shift(ring, east, north):
    return [[x + east, y + north] for x, y in ring]


def seen(frame, ring):
    """Metres east, north as x, y of the frame, anticlockwise there."""
    return ring if frame == "basin" else [[n, e] for e, n in ring][::-1]


def lonlat(ring, lon0=LON, lat0=LAT):
    """Degrees of metres east and north near a place, by the radii of curvature there: good to a millimetre at 50 m."""
    s = math.sin(math.radians(lat0))
    w = 1 - 6.69437999014e-3 * s * s
    meridian, normal = 6378137 * (1 - 6.69437999014e-3) / w ** 1.5, 6378137 / math.sqrt(w)
    parallel = normal * math.cos(math.radians(lat0))
    return [[lon0 + math.degrees(e / parallel), lat0 + math.degrees(n / meridian)] for e, n in ring]


# ---- no mirror, both ways ----

@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("crs", [None, "degrees", "EPSG:32633", "local"])
def test_it_lies_as_on_the_map(tmp_path, frame, crs):
    """North of the map is x of the geographic frame and y of the basin's, east the other, whatever the coordinates
    are."""
    case = FRAMES[frame]
    if crs == "EPSG:32633":
        case = changed(case, ice__origin_east=560123.5, ice__origin_north=8490321.25)
        write(tmp_path, *(shift(r, 560123.5, 8490321.25) for r in (ARROW, BOX)), **named(crs))
    elif crs == "local":
        write(tmp_path, ARROW, BOX, **named(LOCAL))
    elif crs == "degrees":
        case = changed(case, **ORIGIN)
        write(tmp_path, lonlat(ARROW), lonlat(BOX))
    else:
        case = changed(case, ice__outlines_crs="plane")
        write(tmp_path, ARROW, BOX)
    rings, *_ = field(tmp_path, case)
    for ring, drawn in zip(rings, (ARROW, BOX)):
        assert area(ring) > 0
        assert same_ring(ring, seen(frame, drawn), 1e-3 if crs == "degrees" else 1e-9)
    r = run(tmp_path, case)
    o = r.summary["outlines"]
    assert o["turned"] == 0, "anticlockwise on the map"
    assert o["crs"] == {None: "local", "degrees": "OGC:CRS84", "EPSG:32633": "EPSG:32633", "local": "local"}[crs]
    if crs == "EPSG:32633":
        assert (o["origin_east_m"], o["origin_north_m"]) == (560123.5, 8490321.25)


@pytest.mark.parametrize("frame", FRAMES)
def test_round_trip_in_degrees(tmp_path, frame):
    """A field that is made goes out as longitude and latitude, lies where geodesics say, and comes back to where it
    was."""
    made = changed(FRAMES[frame],
                   ice={"concentration": 0.3, "size": 20, "thickness": 0.04, "thickness_law": "lognormal"},
                   **ORIGIN)
    rings, thickness, *_ = field(tmp_path, made)
    field(tmp_path, made, name="out.geojson")
    out, crs = rings_of(tmp_path / "out.geojson")
    assert crs is None and len(out) == len(rings) > 50
    corners = np.vstack(rings)
    farthest = 0
    for ring, drawn in zip(rings, out):
        assert area(np.array(drawn)) > 0, "anticlockwise on the map, as RFC 7946 has it"
        want = []
        for lon, lat in drawn:
            distance, azimuth = vincenty(LON, LAT, lon, lat)
            want.append([distance * math.sin(azimuth), distance * math.cos(azimuth)])
            farthest = max(farthest, distance)
        assert same_ring(ring, seen(frame, want), 1e-4)
    assert farthest > 150 and np.ptp(corners[:, 0]) > 300
    again = changed(FRAMES[frame], ice={"outlines": "out.geojson", **{k[5:]: v for k, v in ORIGIN.items()}})
    rings2, thickness2, *_ = field(tmp_path, again, name="again.h5")
    for p, q in zip(rings, rings2):
        assert same_ring(p, q, 2e-8)
    assert thickness.tolist() == thickness2.tolist()
    # The file keeps its origin: without keys it comes back to the same place, too, and goes out again in degrees.
    rings3, *_ = field(tmp_path, changed(again, ice__origin_lon=None, ice__origin_lat=None), name="third.h5")
    for p, q in zip(rings, rings3):
        assert same_ring(p, q, 2e-8)
    field(tmp_path, again, name="second.geojson")
    for p, q in zip(out, rings_of(tmp_path / "second.geojson")[0]):
        np.testing.assert_allclose(p, q, atol=1e-12)


@pytest.mark.parametrize("frame", FRAMES)
def test_round_trip_in_metres(tmp_path, frame):
    """Without a place on the earth: metres east and north, and a crs that says so, which the reader honours."""
    made = changed(FRAMES[frame], ice={"concentration": 0.3, "size": 20, "thickness": 0.04})
    rings, *_ = field(tmp_path, made)
    field(tmp_path, made, name="out.geojson")
    out, crs = rings_of(tmp_path / "out.geojson")
    assert crs == LOCAL
    for ring, drawn in zip(rings, out):
        assert area(np.array(drawn)) > 0
        assert same_ring(ring, seen(frame, drawn), 1e-9)
    again = changed(FRAMES[frame], ice={"outlines": "out.geojson"})
    rings2, *_ = field(tmp_path, again, name="again.h5")
    for p, q in zip(rings, rings2):
        assert same_ring(p, q, 1e-9)
    other = changed(FRAMES["basin" if frame == "geographic" else "geographic"], ice={"outlines": "out.geojson"})
    assert f"metres of the frame {frame}" in field(tmp_path, other, code=CASE)


@pytest.mark.parametrize("frame", FRAMES)
def test_what_came_in_a_projection_goes_out_in_it(tmp_path, frame):
    drawn = [shift(r, 560000, 8490000) for r in (ARROW, BOX)]
    write(tmp_path, *drawn, **named("urn:ogc:def:crs:EPSG::32633"))
    field(tmp_path, FRAMES[frame], name="out.geojson")
    out, crs = rings_of(tmp_path / "out.geojson")
    assert crs == "EPSG:32633"
    for p, q in zip(drawn, out):
        assert same_ring(p, q, 1e-8)
    # ... about the origin that it stated: the same field.
    a, *_ = field(tmp_path, FRAMES[frame])
    b, *_ = field(tmp_path, changed(FRAMES[frame], ice__outlines="out.geojson"), name="again.h5")
    for p, q in zip(a, b):
        assert same_ring(p, q, 1e-8)


def test_metres_of_the_frame(tmp_path):
    write(tmp_path, seen("geographic", ARROW))
    rings, *_ = field(tmp_path, changed(FRAMES["geographic"], ice__outlines_crs="frame"))
    assert same_ring(rings[0], seen("geographic", ARROW), 1e-12)


# ---- the file's crs ----

DEGREES = ["urn:ogc:def:crs:OGC:1.3:CRS84", "urn:ogc:def:crs:OGC::CRS84", "OGC:CRS84",
           "http://www.opengis.net/def/crs/OGC/1.3/CRS84", "EPSG:4326", "urn:ogc:def:crs:EPSG::4326",
           "urn:ogc:def:crs:EPSG:6.9:4326", "epsg:4258", "EPSG:4269"]
METRES = ["EPSG:32633", "urn:ogc:def:crs:EPSG::32633", "urn:ogc:def:crs:EPSG:8.5:32733",
          "http://www.opengis.net/def/crs/EPSG/0/25833", "EPSG:3413", "EPSG:3976", "EPSG:3995", "EPSG:5041",
          "EPSG:6931", "EPSG:26910", "EPSG:5938"]


@pytest.mark.parametrize("crs", DEGREES)
def test_degrees_by_crs(tmp_path, crs):
    write(tmp_path, lonlat(ARROW), **named(crs))
    rings, *_ = field(tmp_path, changed(FRAMES["geographic"], **ORIGIN))
    assert same_ring(rings[0], seen("geographic", ARROW), 1e-3)
    assert "outlines_crs says otherwise" in field(tmp_path, changed(FRAMES["geographic"], ice__outlines_crs="plane"),
                                                 code=CASE)
    assert "give ice.origin_lon" in field(tmp_path, changed(FRAMES["geographic"], ice__origin_east=0,
                                                            ice__origin_north=0), code=CASE)


@pytest.mark.parametrize("crs", METRES)
def test_metres_by_crs(tmp_path, crs):
    """Used as they are, about their middle, which is reported; so is what is not corrected."""
    drawn = [shift(r, -1234567.5, 2345678.25) for r in (ARROW, BOX)]
    write(tmp_path, *drawn, **named(crs))
    rings, *_ = field(tmp_path, FRAMES["geographic"])
    east, north = -1234567.5 + 17.5, 2345678.25 + 10
    for ring, ring_drawn in zip(rings, drawn):
        assert same_ring(ring, seen("geographic", shift(ring_drawn, -east, -north)), 1e-8)
    r = run(tmp_path, FRAMES["geographic"])
    assert (r.summary["outlines"]["origin_east_m"], r.summary["outlines"]["origin_north_m"]) == (east, north)
    code = "EPSG:" + re.split("[:/]", crs)[-1]
    assert r.summary["outlines"]["crs"] == code
    text, = warned(r, "plane coordinates")
    assert code in text and "scale factor" in text and "convergence" in text
    said = call("check", tmp_path / "case.yml").stdout
    assert f"{east:.10g} m east, {north:.10g} m north at x = y = 0" in said and "plane coordinates" in said
    assert "outlines_crs says otherwise" in field(tmp_path, changed(FRAMES["geographic"], ice__outlines_crs="lonlat"),
                                                 code=CASE)
    assert "give ice.origin_east" in field(tmp_path, changed(FRAMES["geographic"], **ORIGIN), code=CASE)
    # The same numbers as degrees: the crs is wrong.
    write(tmp_path, lonlat(ARROW), **named(crs))
    assert code in (said := field(tmp_path, FRAMES["geographic"], code=CASE)) and "as degrees do" in said


@pytest.mark.parametrize("crs, says", [
    ("EPSG:2154", "EPSG:2154, is not known here"), ("urn:ogc:def:crs:EPSG::27700", "EPSG::27700, is not known"),
    ("EPSG:3857", "EPSG:3857, Mercator"), ("EPSG:3395", "Mercator"),
    ("EPSG:4978", "not known"), ("EPSG:432600000", "not known"), ("EPSG:", "not known"), ("", "not known"),
    ("ESRI:102018", "ESRI:102018, is not known")])
def test_other_crs_are_refused_by_name(tmp_path, crs, says):
    write(tmp_path, shift(ARROW, 500000, 100000), **named(crs))
    said = field(tmp_path, FRAMES["geographic"], code=CASE)
    assert says in said and "bergtow outlines" in said and len(said.splitlines()) == 1
    if "not known" in says: # the user knows it
        rings, *_ = field(tmp_path, changed(FRAMES["geographic"], ice__outlines_crs="plane", ice__origin_east=500000,
                                            ice__origin_north=100000))
        assert same_ring(rings[0], seen("geographic", ARROW), 1e-9)


@pytest.mark.parametrize("crs", [None, {"type": "link", "properties": {"href": "http://example.com/crs/42"}},
                                 {"type": "name", "properties": {}}, "EPSG:4326", 7])
def test_a_crs_without_a_name_is_refused(tmp_path, crs):
    write(tmp_path, lonlat(ARROW), crs=crs)
    assert "its crs is not given by a name" in field(tmp_path, FRAMES["geographic"], code=CASE)
    field(tmp_path, changed(FRAMES["geographic"], ice__outlines_crs="lonlat"))


def test_a_crs_of_one_feature(tmp_path):
    write(tmp_path, lonlat(ARROW), feature(lonlat(BOX)) | named("EPSG:4326"))
    assert "feature 1 is refused: it has a crs of its own" in field(tmp_path, FRAMES["geographic"], code=CASE)


# ---- degrees and metres taken for each other ----

def test_metres_read_as_degrees(tmp_path):
    """A file without a crs is in degrees."""
    for ring, says in ((shift(ARROW, 560000, 8490000), r"feature 0 has a vertex \[560000, .*within 180 and 90"),
                       (ARROW, "100 km from the origin")):
        write(tmp_path, ring)
        said = field(tmp_path, FRAMES["geographic"], code=CASE)
        assert re.search(says, said), said
        assert "ice.outlines_crs: plane" in said


def test_longitudes_from_0_to_360(tmp_path):
    write(tmp_path, lonlat(ARROW, 200.0))
    assert "set ice.outlines_crs: lonlat" in field(tmp_path, FRAMES["geographic"], code=CASE)
    for more in ({"ice__outlines_crs": "lonlat"}, {"ice__outlines_crs": "lonlat", "ice__origin_lon": -160,
                                                   "ice__origin_lat": LAT}):
        rings, *_ = field(tmp_path, changed(FRAMES["geographic"], **more))
        assert abs(area(rings[0]) - area(np.array(ARROW))) < 0.01


@pytest.mark.parametrize("size", [30, 300, 3000])
@pytest.mark.parametrize("frame", FRAMES)
def test_degrees_read_as_metres(tmp_path, frame, size):
    """Floes of 30 m are 0.3 mm, those of 300 m less than thick, in a domain that they would fill: nothing but a
    refusal."""
    corners = ((0, 0), (8, 0), (8, 8), (0, 8))
    write(tmp_path, *(lonlat([[size * (x + k) / 10, size * y / 10] for x, y in corners]) for k in (0, 10)))
    for key in ("plane", "frame"):
        x0, y0 = (LAT, LON) if frame == "geographic" else (LON, LAT)
        case = changed(FRAMES[frame], ice__outlines_crs=key, domain__length=10, domain__width=10,
                       domain__x0=(LON if key == "frame" else x0) - 5, domain__y0=(LAT if key == "frame" else y0) - 5)
        said = field(tmp_path, case, code=CASE)
        assert re.search("mean size of the floes|concentration.*below 1e-06|as if degrees were read", said)


def test_latitude_before_longitude(tmp_path):
    swapped = [[lat, lon] for lon, lat in lonlat(ARROW, 120.0)]
    write(tmp_path, swapped)
    assert "latitude seems to come first; swap" in field(tmp_path, FRAMES["geographic"], code=CASE)
    swapped = [[lat, lon] for lon, lat in lonlat(ARROW)] # 76.5, 20: a place in India
    write(tmp_path, swapped)
    said = field(tmp_path, FRAMES["geographic"], code=CASE)
    assert "no sea ice" in said and "write [longitude, latitude]" in said
    assert "near it with latitude and longitude swapped" in field(tmp_path, changed(FRAMES["geographic"], **ORIGIN),
                                                                  code=CASE)
    # The registry has latitude first in this one, GeoJSON has not.
    for crs in ("EPSG:4326", "urn:ogc:def:crs:EPSG::4326"):
        write(tmp_path, swapped, **named(crs))
        assert "write [longitude, latitude]" in field(tmp_path, FRAMES["geographic"], code=CASE)


# ---- large coordinates ----

def test_an_offset_for_large_coordinates(tmp_path):
    write(tmp_path, shift(ARROW, 560000, 8490000), shift(BOX, 560000, 8490000))
    plane = changed(FRAMES["geographic"], ice__outlines_crs="plane")
    said = field(tmp_path, plane, code=CASE)
    assert len(said.splitlines()) == 1 and "ice.origin_east and ice.origin_north" in said and "559995 to 560040" in said
    rings, *_ = field(tmp_path, changed(plane, ice__origin_east=560000, ice__origin_north="8490 km"))
    assert same_ring(rings[0], seen("geographic", ARROW), 1e-8)


EAST = {"ice__origin_east": 1, "ice__origin_north": 1}


@pytest.mark.parametrize("more, key", [
    ({"ice__origin_east": 1}, "ice.origin_east"), ({"ice__origin_north": 1}, "ice.origin_north"),
    (EAST | ORIGIN, "ice.origin_east"), (EAST | {"ice__outlines_crs": "lonlat"}, "ice.origin_east"),
    (EAST | {"ice__outlines": None}, "ice.origin_east"),
    (ORIGIN | {"ice__outlines_crs": "plane"}, "ice.origin_lon"),
    ({"ice__outlines_crs": "plane", "ice__outlines": None}, "ice.outlines_crs")])
def test_origins_without_effect(tmp_path, more, key):
    write(tmp_path, ARROW)
    assert f": {key}: " in field(tmp_path, changed(FRAMES["geographic"], **more), code=CASE)


# ---- corners that rounding bends inwards ----

def test_rounded_corners(tmp_path):
    """Straight shores of many points, rounded to seven digits of a degree (a centimetre): convex but for that, and
    counted."""
    shore = [[x, -10.0] for x in np.arange(-10, 10, 0.9)]
    turns = [(math.cos(a), math.sin(a)) for a in np.arange(4) * math.pi / 2 + 0.3]
    square = [[c * x - s * y, s * x + c * y] for c, s in turns for x, y in shore]
    rough = [[round(x, 7), round(y, 7)] for x, y in lonlat(square)]
    write(tmp_path, rough, lonlat(BOX))
    case = changed(FRAMES["geographic"], **ORIGIN)
    rings, *_ = field(tmp_path, case)
    assert 3 < len(rings[0]) < 70 and abs(area(rings[0]) - 400) < 1
    r = run(tmp_path, case)
    o = r.summary["outlines"]
    assert (o["rounded"], o["hulled"], o["split"]) == (1, 0, 0)
    assert o["rounded_corners"] + o["dropped_vertices"] == 92 - len(rings[0]) and 0 < o["rounded_area_added_m2"] < 0.5
    assert "1 not convex by rounding alone" in r.result.stdout
    assert "by rounding alone" in call("check", write_case(tmp_path, case)).stdout


@pytest.mark.parametrize("depth, admitted", [(0.005, True), (0.02, True), (0.04, False), (1, False)])
@pytest.mark.parametrize("geojson", [True, False])
def test_how_deep_a_corner_is_rounding(tmp_path, depth, admitted, geojson):
    """A thousandth of the extent, 28 m here; in an HDF5 file the same, which another program has made."""
    bay = [[0, 0], [10, depth], [20, 0], [20, 20], [0, 20]]
    write(tmp_path, bay)
    case = changed(FRAMES["basin"], ice__outlines_crs="plane")
    if not geojson:
        with h5py.File(tmp_path / "out.h5", "w") as f:
            x = np.array(bay)
            y = np.roll(x, -1, axis=0)
            cross = x[:, 0] * y[:, 1] - y[:, 0] * x[:, 1]
            centre = ((x + y) * cross[:, None]).sum(0) / (3 * cross.sum())
            for name, values in (("offsets", [0, 5]), ("vertices", x - centre), ("pose", [[*centre, 0]]),
                                 ("thickness", [1.0])):
                f[f"floes/{name}"] = np.array(values)
            f["floes"].attrs["ice_area"] = 400.0 * 300
        case = changed(FRAMES["basin"], ice={"field": "out.h5"})
    path = write_case(tmp_path, case)
    said = call("check", path)
    assert said.returncode == (DONE if admitted else CASE), said.stderr
    assert ("1 floes by rounding alone: 1 corners left out" in said.stdout) == admitted
    if admitted:
        r = run(tmp_path, case)
        np.testing.assert_allclose(r.dataset("/floes/area"), [400], rtol=1e-12)
        assert abs(r.summary["outlines"]["rounded_area_added_m2"] - 10 * depth) < 1e-9
    else:
        assert "not convex" in said.stderr


# ---- thickness by another name ----

@pytest.mark.parametrize("name", ["Thickness", "thicknes", "THICKNESS", "thick", "ice_thickness", "thickness_m",
                                  "ticknes", "height", "h"])
def test_a_thickness_by_another_name_is_reported(tmp_path, name):
    write(tmp_path, feature(ARROW, **{name: 0.4}), feature(BOX, thickness=0.6), **named(LOCAL))
    r = run(tmp_path, FRAMES["geographic"])
    text, = warned(r, "property `thickness`")
    assert f"`{name}`" in text and "1 of 2 outlines" in text and "1 m" in text
    assert r.summary["outlines"]["nearly_thickness"] == 1
    np.testing.assert_array_equal(r.dataset("/floes/thickness"), [1, 0.6])
    assert f"`{name}`" in call("check", tmp_path / "case.yml").stdout
    assert f"`{name}`" in call("field", tmp_path / "case.yml", "-o", tmp_path / "f.h5").stdout


def test_other_properties_are_nobodys_business(tmp_path):
    write(tmp_path, feature(ARROW, area=3, class_="floe", date="2026-04-01", id=7, thickness=0.5, thick=2),
          feature(BOX, name="B", thickness=0.6), **named(LOCAL))
    r = run(tmp_path, FRAMES["geographic"])
    assert not warned(r, "property `thickness`")
    assert r.summary["outlines"]["nearly_thickness"] == 0


@pytest.mark.parametrize("without", [0, 1, 3])
def test_floes_that_lack_a_thickness_are_counted(tmp_path, without):
    """If others have one; else that of the case is meant. Red: no word of those that have that of the case."""
    write(tmp_path, *(feature(shift(BOX, 0, 10 * k - 40), **{} if k < without else {"thickness": 0.6})
                      for k in range(3)), **named(LOCAL))
    found = warnings_of(tmp_path, FRAMES["geographic"])
    assert found.get("no_thickness") == (None if without in (0, 3) else {
        "outlines": 1, "of_outlines": 3, "property": "", "thickness_m": 1})
    counted = re.search(r"^without a thickness +(\d+)", call("check", tmp_path / "case.yml").stdout, re.M)
    assert (counted and int(counted[1])) == (1 if without == 1 else None)


def test_names_do_not_steer_the_terminal(tmp_path):
    write(tmp_path, *(feature(shift(BOX, 12 * k - 60, 0), **{f"thick\x1b[3{k}m" + "x" * 300: 1}) for k in range(8)),
          **named(LOCAL))
    said = call("check", write_case(tmp_path, FRAMES["geographic"])).stdout
    assert "thick?[30m" in said and "\x1b" not in said and "8 of 8" in said


# ---- what is absurd ----

@pytest.mark.parametrize("scale, says", [
    (1e-5, "mean size of the floes"), (60, "mean size of the floes, 5\\d\\d m, is above that of the domain"),
    (2e-3, "concentration.*below 1e-06")])
def test_absurd_sizes(tmp_path, scale, says):
    write(tmp_path, [[scale * x, scale * y] for x, y in ARROW], **named(LOCAL))
    assert re.search(says, field(tmp_path, changed(FRAMES["geographic"], ice__thickness=0.001), code=CASE))


@pytest.mark.parametrize("key, value", [("size", 1e-4), ("concentration", 1e-7), ("thickness", 1e-9)])
def test_absurd_values_of_a_case(tmp_path, key, value):
    case = changed(FRAMES["basin"], ice={"concentration": 0.1, "size": 20, key: value})
    result = call("check", write_case(tmp_path, case))
    assert result.returncode == CASE and f"ice.{key}: " in result.stderr and "less than" in result.stderr


# ---- what the place on the earth says ----


def warnings_of(folder, case):
    """{code: values} of check."""
    r = call("check", write_case(folder, case), "--json")
    assert r.returncode == DONE, r.stderr
    return {w["code"]: w["values"] for w in json.loads(r.stdout)["warnings"]}


@pytest.mark.parametrize("latitude, says", [(0, "without water.latitude there is no Coriolis force; set it to 7"),
                                            (-60, "but water.latitude is -60 deg; correct one"), (LAT, None)])
def test_the_latitude_of_the_map_and_of_the_case(tmp_path, latitude, says):
    write(tmp_path, lonlat(ARROW))
    r = call("check", write_case(tmp_path, changed(FRAMES["geographic"], water__latitude=latitude)))
    assert r.returncode == DONE, r.stderr
    assert ("the ice lies at latitude" in r.stdout) == (says is not None) and (says or "") in r.stdout


# x = y = 0 and its latitude [PROJ]
@pytest.mark.parametrize("crs, origin, latitude", [
    ("EPSG:3413", (1331319.73, -620804.59), 76.5), ("EPSG:3412", (1331319.73, -620804.59), -76.5),
    ("EPSG:32661", (2.1e6, 3.2e6), 79.185), ("EPSG:6932", (1e6, 1e6), -77.31),
    ("EPSG:32633", (627977.18, 8493840.14), 76.478), ("EPSG:32733", (6e5, 2.5e6), -67.599)])
def test_the_latitude_of_a_projection(tmp_path, crs, origin, latitude):
    """Of outlines, and of a field file of them. Red: only degrees have a latitude, and only outlines warn."""
    write(tmp_path, shift(ARROW, *origin), **named(crs))
    first = changed(FRAMES["geographic"], ice__origin_east=origin[0], ice__origin_north=origin[1])
    field(tmp_path, first)
    second = changed(FRAMES["geographic"], ice={"field": "out.h5"})
    for case in first, second:
        for given in latitude, -latitude:
            found = warnings_of(tmp_path, changed(case, water__latitude=given))
            assert "grid_plane" in found
            assert found.get("other_latitude", {"latitude_deg": None})["latitude_deg"] == (
                pytest.approx(latitude, abs=0.01) if given != latitude else None)


def test_degrees_are_no_place_of_a_field_in_metres(tmp_path):
    """As they are none of outlines in metres. Red: taken, which turns the field by the convergence."""
    write(tmp_path, shift(ARROW, 1331319.73, -620804.59), **named("EPSG:3413"))
    field(tmp_path, FRAMES["geographic"])
    case = changed(FRAMES["geographic"], ice={"field": "out.h5"} | {"origin_lon": LON, "origin_lat": LAT})
    r = call("check", write_case(tmp_path, case))
    assert r.returncode == CASE and "ice.origin_lon" in r.stderr
    write(tmp_path, ARROW, **named(LOCAL))  # their north is whatever the case says
    field(tmp_path, FRAMES["geographic"], name="local.h5")
    assert "other_latitude" not in warnings_of(tmp_path, changed(case, ice__field="local.h5", water__latitude=LAT))


def test_latitude_first_of_western_places(tmp_path):
    """Off Newfoundland the swapped place has no ice; off Baffin Island it has, in the south, and that is said."""
    def swapped(lon, lat):
        return [p[::-1] for p in lonlat(ARROW, lon, lat)]

    write(tmp_path, swapped(-50, 47))
    assert "latitude seems to come first" in field(tmp_path, FRAMES["geographic"], code=CASE)
    write(tmp_path, swapped(-65, 70))
    said = call("check", write_case(tmp_path, FRAMES["geographic"])).stdout
    assert "in the south; if it should lie in the north, latitude comes first" in said
    for lon, lat in ((120, 40), (-65, 70), (50, 75), (0, -70), (-40, -54)):  # in order
        write(tmp_path, lonlat(ARROW, lon, lat))
        r = call("check", write_case(tmp_path, FRAMES["geographic"]))
        assert r.returncode == DONE and "latitude comes first" not in r.stdout


# x = y = 0 on the meridian of a polar map, and the scale there [Snyder 1987, tables 23 and 29, spheres]
@pytest.mark.parametrize("crs, north, along, across", [("EPSG:3413", -3323680, 1.0395, 1.0395),
                                                       ("EPSG:3413", -1.5e6, 0.9842, 0.9842),
                                                       ("EPSG:6931", -3298000, 0.9659, 1.0353),
                                                       ("EPSG:32661", 2e6, 0.994, 0.994),
                                                       ("EPSG:32633", 8.5e6, 0.9996, 0.9996)])
def test_the_scale_of_a_projection_is_said(tmp_path, crs, north, along, across):
    east = 500e3 if crs == "EPSG:32633" else 2e6 if crs == "EPSG:32661" else 0
    write(tmp_path, shift(ARROW, east, north), **named(crs))
    case = changed(FRAMES["geographic"], ice__origin_east=east, ice__origin_north=north)
    r = call("check", write_case(tmp_path, case))
    assert r.returncode == DONE, r.stderr
    said = re.search(r"scale factor \(at x = y = 0 ([\d.]+) along the meridian and ([\d.]+) across", r.stdout)
    assert (float(said[1]), float(said[2])) == pytest.approx((along, across), abs=1e-3)
