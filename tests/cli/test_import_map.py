# SPDX-License-Identifier: MIT
"""bergtow outlines: maps in any system and format as floes.

Places are known by geodesics (pyproj.Geod), which the command does not use; maps are put into other systems and formats
by GDAL's own ogr2ogr; what comes out is read by the program's C reader, which has a projection of its own.
"""
import json
import subprocess

import h5py
import netCDF4
import numpy as np
import pytest
import yaml
from osgeo import gdal, ogr, osr
from pyproj import CRS, Geod, Transformer
from shapely.geometry import Point, Polygon
from shapely.ops import unary_union

import tutorial
from harness import DONE, IO, USAGE, call, changed, environment, run
from test_map import FRAMES
from test_outlines import LONLAT, field, same_ring

from bergtow import cli  # noqa: E402
from bergtow.maps import plane as map_plane  # noqa: E402
from bergtow.maps import read as map_read  # noqa: E402
from bergtow.maps import stairs as map_stairs  # noqa: E402
from bergtow.errors import BergtowError, RunError  # noqa: E402

gdal.UseExceptions()
GEOD = Geod(ellps="WGS84")
LON, LAT = 14.0, 80.0
SHIFTED = "+proj=utm +zone=33 +ellps=krass +towgs84=23.92,-141.27,-80.9,0,0.35,0.82,-0.12 +units=m"


def regular(x, y, radius, corners=6, turn=0.0):
    angle = turn + 2 * np.pi * np.arange(corners) / corners
    return np.c_[x + radius * np.cos(angle), y + radius * np.sin(angle)]


def places(xy, lon=LON, lat=LAT):
    """Longitude and latitude of metres east and north of a place: along geodesics from it."""
    xy = np.asarray(xy, float)
    n = len(xy)
    a, b, _ = GEOD.fwd([lon] * n, [lat] * n, np.degrees(np.arctan2(xy[:, 0], xy[:, 1])), np.hypot(*xy.T))
    return np.c_[a, b]


#: metres east and north; no two of a kind, none near another
RINGS = [regular(700 * i, 600 * j, 60 + 7 * i + 3 * j, 5 + (i + j) % 3, 0.3 * i) for i in (-2, -1, 0, 1, 2)
         for j in (-2, -1, 0, 1, 2)]


def write(path, rings, crs=None, **more):
    """GeoJSON of rings, or of whole geometries."""
    def geometry(r):
        if isinstance(r, dict):
            return r
        ring = np.asarray(r).tolist()
        return {"type": "Polygon", "coordinates": [ring + ring[:1]]}
    features = [{"type": "Feature", "properties": {}, "geometry": geometry(r)} for r in rings]
    named = {"crs": {"type": "name", "properties": {"name": crs}}} if crs else {}
    path.write_text(json.dumps({"type": "FeatureCollection", **named, "features": features} | more))
    return path


def ogr2ogr(*words):
    subprocess.run(["ogr2ogr", *map(str, words)], check=True, capture_output=True)


def outlines(map_, *words, code=DONE, name="out.geojson"):
    """The rings that were written (open, as arrays) and the record; or what is said where it fails. Within this
    process, which saves a second a call; test_the_program_reads_it starts the program."""
    out = map_.parent / name
    words = [str(w) for w in (map_, "-o", out, "--record", out.with_suffix(".json"), "--force", *words)]
    if code != DONE:
        with pytest.raises(RunError) as error:
            cli.perform("outlines", *words)
        assert not out.exists()
        return str(error.value)
    cli.perform("outlines", *words)
    root = json.loads(out.read_text())
    rings = [np.array(f["geometry"]["coordinates"][0][:-1]) for f in root["features"]]
    return rings, json.loads(out.with_suffix(".json").read_text())


def counted(record):
    return {kind: c["count"] for kind, c in record["changes"].items()}


def geodesic_area(lonlat):
    return abs(GEOD.polygon_area_perimeter(*np.asarray(lonlat).T)[0])


def plane_area(ring):
    return Polygon(ring).area


# ---- systems


@pytest.mark.parametrize("crs, lon, lat", [
    ("EPSG:4326", LON, LAT), ("EPSG:32633", LON, LAT), ("EPSG:3413", LON, LAT), ("EPSG:3413", -45.0, 89.999),
    ("EPSG:4326", 180.0, 71.0), ("EPSG:3413", -179.999, 71.0), ("EPSG:3976", -30.0, -69.5), ("EPSG:32733", 15.3, -70.0),
    ("EPSG:6931", 100.0, 77.0), (SHIFTED, LON, LAT)])
def test_places_on_the_ellipsoid(tmp_path, capsys, crs, lon, lat):
    """Degrees, UTM, polar stereographic north and south, at the pole and over the 180th meridian, and a crs with a
    datum shift of its own: every vertex comes to lie at its geodesic distance and azimuth from the centre, and every
    floe has its area on the ellipsoid. Red for the shift: 137 m off, and "by no known relation"."""
    map_ = write(tmp_path / "degrees.geojson", [places(r, lon, lat) for r in RINGS])
    if crs != "EPSG:4326":
        ogr2ogr("-f", "GPKG", "-t_srs", crs, tmp_path / "map.gpkg", map_)
        map_ = tmp_path / "map.gpkg"
    rings, record = outlines(map_, "--centre", f"{lon},{lat}", "--heading", 90)  # x to the east, y to the north
    assert counted(record) == {}
    # PROJ's own round trip over authalic latitudes is off by 7e-5 m, its shift of a datum by 4e-4 m
    near = {"EPSG:6931": 2e-4, SHIFTED: 1e-3}.get(crs, 1e-5)
    said = capsys.readouterr().out
    assert "no known relation" not in said and ("by the shift in its crs" in said) == (crs == SHIFTED)
    for ring, drawn in zip(rings, RINGS):
        assert same_ring(ring, drawn, near)
    for ring, drawn in zip(rings, RINGS):
        np.testing.assert_allclose(plane_area(ring), geodesic_area(places(drawn, lon, lat)), rtol=3e-7,
                                   atol=0.1)  # as good as geodesic areas are
    reported = record["plane"]
    farthest = max(np.hypot(*r.T).max() for r in RINGS)
    np.testing.assert_allclose(reported["farthest_m"], farthest, atol=near)
    assert reported["length_error"] < 5e-8 and reported["area_error"] < 5e-8  # PROJ differentiates numerically
    degrees, _ = outlines(map_, "--centre", f"{lon},{lat}", name="degrees-out.geojson")
    for ring, drawn in zip(degrees, RINGS):
        azimuth, _, d = GEOD.inv(*np.array([[lon, lat]] * len(ring)).T, *ring.T)
        azimuth = np.radians(azimuth)
        assert same_ring(np.c_[d * np.sin(azimuth), d * np.cos(azimuth)], drawn, near)


def test_distortion_of_a_wide_map(tmp_path):
    """At the distance d lengths across the line of sight are too great by (d/R)²/6, and so are areas."""
    map_ = write(tmp_path / "map.geojson", [places(regular(x, 0, 200, 8)) for x in (-60e3, 0, 60e3)])
    rings, record = outlines(map_, "--centre", f"{LON},{LAT}", "--heading", 90)
    wanted = (60.2e3 / 6.39e6) ** 2 / 6
    for kind in ("length_error", "area_error"):
        assert record["plane"][kind] == pytest.approx(wanted, rel=0.02), kind
    far = geodesic_area(places(regular(60e3, 0, 200, 8)))
    assert max(map(plane_area, rings)) / far - 1 == pytest.approx((60e3 / 6.39e6) ** 2 / 6, rel=0.05)
    assert record["plane"]["north_turns_deg"] == pytest.approx(np.degrees(60.2e3 / 6.39e6 * np.tan(np.radians(LAT))),
                                                               rel=0.06)


def test_metres_of_a_projection_are_corrected(tmp_path):
    """UTM at the middle of its zone is short by 0.9996, polar stereographic at 80° N by what its scale there is:
    against areas on the ellipsoid."""
    write(tmp_path / "map.geojson", [places(r, 15.0) for r in RINGS])
    for crs, scale in (("EPSG:32633", 0.9996), ("EPSG:3413", (1 + np.sin(np.radians(70))) / (1 + np.sin(
            np.radians(80))))):
        ogr2ogr("-f", "GeoJSON", "-t_srs", crs, "-lco", "RFC7946=NO", tmp_path / f"{scale:.4f}.geojson",
            tmp_path / "map.geojson")
        rings, record = outlines(tmp_path / f"{scale:.4f}.geojson", "--centre", "15,80", "--heading", 0)
        drawn = json.loads((tmp_path / f"{scale:.4f}.geojson").read_text())["features"]
        flat = sum(plane_area(f["geometry"]["coordinates"][0]) for f in drawn)
        round_ = sum(geodesic_area(places(r, 15.0)) for r in RINGS)
        assert abs(flat / round_ - scale ** 2) < 1e-3 and abs(flat / round_ - 1) > 7e-4
        assert abs(sum(map(plane_area, rings)) / round_ - 1) < 1e-6
        least, most = record["plane"]["map_scale"]
        assert least - 2e-4 < np.sqrt(flat / round_) < most + 2e-4


@pytest.mark.parametrize("heading", [0, 30, 211.5])
def test_heading(tmp_path, heading):
    """x along the heading, y to its left; the basin's frame takes it, the geographic one refuses it."""
    map_ = write(tmp_path / "map.geojson", [places(r) for r in RINGS])
    rings, _ = outlines(map_, "--centre", f"{LON},{LAT}", "--heading", heading, name="map2.geojson")
    h = np.radians(heading)
    along, left = np.array([np.sin(h), np.cos(h)]), np.array([-np.cos(h), np.sin(h)])
    for ring, drawn in zip(rings, RINGS):
        assert same_ring(ring, np.c_[drawn @ along, drawn @ left], 1e-5)
    case = changed(FRAMES["basin"], domain={"frame": "basin", "x0": -2500, "y0": -2500, "length": 5000, "width": 5000},
                   ice__outlines="map2.geojson")
    got, *_ = field(tmp_path, case)
    for ring, drawn in zip(got, RINGS):
        assert same_ring(ring, np.c_[drawn @ along, drawn @ left], 1e-5)
    assert "frame" in field(tmp_path, changed(case, domain__frame="geographic", domain__ends="wall",
                                              domain__sides="wall"), code=3)


def test_the_program_reads_it(tmp_path):
    """Its own projection puts the degrees where PROJ had them, without a warning; and the numbers reported are
    those of the case whose lines were printed."""
    write(tmp_path / "map.geojson", [places(r, -135.0, 74.0) for r in RINGS])
    r = call("outlines", "map.geojson", "-o", "floes.geojson", "--record", "floes.json", "--box", "1km,3.6km",
             "--centre", "-135,74", cwd=tmp_path)
    assert r.returncode == DONE, r.stderr
    reported = json.loads((tmp_path / "floes.json").read_text())["floes"]
    _, domain, ice, water = r.stdout[r.stdout.index("in a case beside it:"):].splitlines()[:4]
    (tmp_path / "case.yml").write_text(f"run: {{dt: 1 s, duration: 3 s}}\n{domain.strip()}\n{ice.strip()}\n"
                                       f"{water.strip()}\n"
                                       "body: {shape: none}\n")
    asked = call("check", tmp_path / "case.yml")
    assert asked.returncode == 3 and "5 of 5 outlines have no property `thickness`" in asked.stderr
    done = run(tmp_path, tmp_path / "case.yml", "--set", "ice.thickness=1")
    assert done.warnings == [] and done.summary["outlines"]["read"] == 5 == reported["floes"]
    np.testing.assert_allclose(done.summary["concentration"], reported["concentration"], rtol=1e-6)
    np.testing.assert_allclose(done.summary["mean_size_m"], reported["mean_size_m"], rtol=1e-6)
    got, *_ = field(tmp_path, changed(yaml.safe_load((tmp_path / "case.yml").read_text()), ice__thickness=1))
    for ring, drawn in zip(got, RINGS[2::5], strict=True):  # the row in the middle, from west to east
        assert same_ring(ring, drawn[::-1, ::-1], 1e-3)


def test_what_the_program_wrote_comes_back(tmp_path):
    """A field in degrees, and one in metres of no place."""
    made = changed(FRAMES["geographic"], ice={"concentration": 0.3, "size": 20, "thickness": 0.5})
    for more in ({"ice__origin_lon": LON, "ice__origin_lat": LAT}, {}):
        rings, thickness, *_ = field(tmp_path, changed(made, **more))
        field(tmp_path, changed(made, **more), name="field.geojson")
        centre = f"{LON},{LAT}" if more else "0,0"
        back, record = outlines(tmp_path / "field.geojson", "--centre", centre, "--heading", 90)
        assert set(counted(record)) <= {"simplified", "touching", "cut kept"} and len(back) == len(rings) > 50
        for a, b in zip(rings, back):
            assert abs(plane_area(a) - plane_area(b)) < 1e-3 * plane_area(a)
            assert np.abs(a.mean(axis=0) - b.mean(axis=0)[::-1]).max() < 2
        reported = record["floes"]
        assert reported["with_thickness"] == len(rings) and reported["mean_thickness_m"] == thickness.mean()


@pytest.mark.parametrize("width", [0.01, 0.0262, 0.0138])
def test_halves_at_the_180th_meridian_are_joined(tmp_path, width):
    """RFC 7946 cuts outlines there. Wherever the middle is: rounding of the places on the cut must not part them."""
    end = -180 + width
    east, west = [[179.99, 70], [180, 70], [180, 70.01], [179.99, 70.01]], [[-180, 70], [end, 70], [end, 70.01],
                                                                            [-180, 70.01]]
    both = {"type": "MultiPolygon", "coordinates": [[r + r[:1]] for r in (east, west)]}
    rings, record = outlines(write(tmp_path / "map.geojson", [both]), "--heading", 90)
    assert counted(record) == {"joined": 1, "simplified": 1} and len(rings) == 1 and len(rings[0]) == 4
    whole = geodesic_area([[179.99, 70], [180 + width, 70], [180 + width, 70.01], [179.99, 70.01]])
    np.testing.assert_allclose(plane_area(rings[0]), whole, rtol=1e-6)
    # the middle in the plane; that of the degrees lies 0.05 m beside it, for the plane bends
    assert abs((record["plane"]["centre"][0] - 180 - (width - 0.01) / 2 + 180) % 360 - 180) < 2e-6


@pytest.mark.parametrize("lat", [70.0, 89.97, -66.0])
def test_the_program_has_the_same_middle_over_the_180th_meridian(tmp_path, lat):
    """Of a map with more floes on one side, as bergtow outlines has it, and as the program has it of the map itself:
    in the middle of the box, of which the geodesics to its corners are of one length."""
    map_ = write(tmp_path / "floes.geojson", [places(r, 180.0, lat) for r in (*RINGS[:2], RINGS[6], RINGS[-1])])
    (lon0, lat0), = [outlines(map_)[1]["plane"]["centre"]]
    case = changed(LONLAT, domain__length=6e3, domain__width=6e3, ice__origin_lon=None, ice__origin_lat=None,
                   run__dt=1)
    o = run(tmp_path, case).summary["outlines"]
    apart = GEOD.inv(lon0, lat0, o["origin_lon_deg"], o["origin_lat_deg"])[2]
    assert apart < 1e-3, apart
    xy = np.concatenate([np.asarray(r) for r in (*RINGS[:2], RINGS[6], RINGS[-1])])
    azimuth, _, far = GEOD.inv(180.0, lat, lon0, lat0)
    want = (xy.min(axis=0) + xy.max(axis=0)) / 2
    # the plane about (180, lat) has the axes of that meridian, which is another one beside the pole
    got = far * np.array([np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))])
    assert np.hypot(*(got - want)) < (5 if abs(lat) < 89 else 800)


def test_the_180th_meridian_ends_no_map(tmp_path):
    """Two floes that a file parts there are whole, also where the other halves are in another file; two on the edge of
    a map elsewhere are cut by it."""
    def square(x, y, length=0.01):
        return [[x, y], [x + length, y], [x + length, y + 0.002], [x, y + 0.002], [x, y]]
    def dropped_and_kept(at, halves=1):
        whole = [[[square(at - 0.01, y)]] + [[square(-180, y, y - 69.99)]] * (halves == 2) for y in (70, 70.01)]
        places = [{"type": "MultiPolygon", "coordinates": parts} for parts in [*whole, [[square(at - 0.04, 70.005)]]]]
        record = outlines(write(tmp_path / "map.geojson", places), "--cut", "drop")[1]
        return counted(record).get("cut", 0), record["floes"]["floes"]
    assert dropped_and_kept(at=180) == dropped_and_kept(at=180, halves=2) == (0, 3)
    assert dropped_and_kept(at=170) == (2, 1)


@pytest.mark.parametrize("middle", [100, 180, -179.999, 360])
@pytest.mark.parametrize("low", [0, -180])
def test_the_edge_of_an_image_over_the_180th_meridian(tmp_path, middle, low):
    """Wherever longitudes begin, also if a floe crosses that place. Red: floes inside, on the longitude where the
    numbers begin, or none of those on the edge."""
    def square(i, j):
        x, y = middle + 0.003 * (i - 2.6), 70 + 0.001 * (j - 2)
        ring = np.round([[x, y], [x + 0.002, y], [x + 0.002, y + 0.0006], [x, y + 0.0006]], 6)
        return np.c_[(ring[:, 0] - low) % 360 + low, ring[:, 1]]
    map_ = write(tmp_path / "map.geojson", [square(i, j) for i in range(6) for j in range(6)])
    assert {k: n for k, n in counted(outlines(map_, "--cut", "drop")[1]).items() if "cut" in k} == {"cut": 20}


def test_a_ring_of_latitude_about_a_pole_is_no_edge(tmp_path):
    """Red: all floes cut by it."""
    floes = [[[x, 89.997], [x, 89.996], [x + 10, 89.996], [x + 10, 89.997]] for x in range(-180, 180, 30)]
    record = outlines(write(tmp_path / "map.geojson", floes), "--cut", "drop")[1]
    assert record["floes"]["floes"] == len(floes) and "cut" not in counted(record)


def test_a_part_of_a_large_map(tmp_path):
    """What lies beyond the plane's reach is no hindrance when the box leaves it out."""
    map_ = write(tmp_path / "map.geojson", [places(r) for r in RINGS] + [places(regular(0, 0, 30e3), 60.0, 74.0)])
    rings, record = outlines(map_, "--centre", f"{LON},{LAT}", "--box", "3km,4km", "--heading", 90)
    assert counted(record) == {"outside": 1} and len(rings) == len(RINGS)
    assert record["plane"]["farthest_m"] < 2e3 and record["plane"]["edges_bend_m"] < 0.01


# ---- formats


def test_formats_and_layers(tmp_path):
    """Shapefile and GeoPackage give what GeoJSON gives; a file of several layers is asked which."""
    map_ = write(tmp_path / "map.geojson", [places(r) for r in RINGS])
    wanted, _ = outlines(map_)
    ogr2ogr("-t_srs", "EPSG:32633", tmp_path / "map.shp", map_)
    ogr2ogr("-f", "GPKG", "-nln", "floes", tmp_path / "map.gpkg", map_)
    write(tmp_path / "other.geojson", [places(r) for r in RINGS[:2]])
    ogr2ogr("-f", "GPKG", "-update", "-nln", "other", "-sql", "SELECT *, 2.5 AS hi, 'ice' AS kind FROM other",
        tmp_path / "map.gpkg", tmp_path / "other.geojson")
    for file, words in (("map.shp", ()), ("map.gpkg", ("--layer", "floes"))):
        got, _ = outlines(tmp_path / file, *words)
        for a, b in zip(got, wanted):
            np.testing.assert_allclose(a, b, atol=1e-9)
    said = outlines(tmp_path / "map.gpkg", code=IO, name="no.geojson")
    assert "floes, other" in said and "--layer" in said
    _, record = outlines(tmp_path / "map.gpkg", "--layer", "other", "--thickness", "hi", "--where", "kind = 'ice'")
    assert record["floes"]["with_thickness"] == 2 and record["floes"]["mean_thickness_m"] == 2.5
    (tmp_path / "map.prj").unlink()
    said = outlines(tmp_path / "map.shp", code=IO, name="no.geojson")
    assert "no coordinate reference system" in said and "--crs" in said
    got, _ = outlines(tmp_path / "map.shp", "--crs", "EPSG:32633")
    for a, b in zip(got, wanted):
        np.testing.assert_allclose(a, b, atol=1e-9)


@pytest.mark.parametrize("values, read", [([1.2, 0.5], True), ([1.2, None], True), (["1.2 m", "0.5 m"], False),
                                          ([1.2, 0], False)])
def test_a_column_of_another_spelling_is_the_thickness_if_it_can_be(tmp_path, values, read):
    """And no reason to refuse a map if it cannot, unless it is named."""
    map_ = write(tmp_path / "map.geojson", [places(r) for r in RINGS[:2]])
    text = json.loads(map_.read_text())
    for feature, value in zip(text["features"], values):
        feature["properties"]["THICKNESS"] = value
    map_.write_text(json.dumps(text))
    found = map_read.read(map_, map_read.Reading())
    assert ([s.thickness for s in found.shapes] == values) == read and found.near == ([] if read else ["THICKNESS"])
    if not read:
        with pytest.raises(RunError, match="is not a thickness in metres"):
            map_read.read(map_, map_read.Reading(thickness="THICKNESS"))


def image(path, labels, crs=None, corner=(0.0, 0.0), pixel=2.0, nodata=None, driver="GTiff"):
    file = gdal.GetDriverByName("MEM").Create("", labels.shape[1], labels.shape[0], 1, gdal.GDT_Byte)
    file.SetGeoTransform((corner[0], pixel, 0, corner[1], 0, -pixel))
    if crs:
        system = osr.SpatialReference()
        system.ImportFromEPSG(crs)
        file.SetProjection(system.ExportToWkt())
    if nodata is not None:
        file.GetRasterBand(1).SetNoDataValue(nodata)
    file.GetRasterBand(1).WriteArray(labels)
    gdal.GetDriverByName(driver).CreateCopy(str(path), file, options=["WORLDFILE=YES"] if driver == "PNG" else [])
    return path


def discs(labels, *floes):
    """Discs of pixels: (row, column, radius, label)."""
    rows, columns = np.indices(labels.shape)
    for row, column, radius, label in floes:
        labels[np.hypot(rows - row, columns - column) < radius] = label
    return labels


def test_label_images(tmp_path):
    """GeoTIFF, PNG with a world file, numpy: the same floes, whose areas are those of their pixels; one at the image's
    edge, one beside what was not seen, a pond, two labels that touch."""
    labels = discs(np.zeros((200, 240), np.uint8), (50, 60, 25, 1), (50, 140, 20, 2), (140, 120, 30, 3),
                   (150, 4, 12, 1), (120, 195, 14, 7))
    labels[50:53, 60:63] = 0
    labels[:, 160:180][140:160] = 5    # touches none
    labels[140:160, 180:200] = 6       # touches 5 along an edge
    labels[:, 205:] = 255
    tif = image(tmp_path / "map.tif", labels, 32633, (500000.0, 8900000.0), nodata=255)
    rings, record = outlines(tif, "--heading", 90)
    sizes = {k: np.count_nonzero(labels == k) for k in (2, 3, 5, 6, 7)}
    counts = counted(record)
    assert counts["holes"] == 1 and counts["cut kept"] == 2 and len(rings) == 7
    got = sorted(plane_area(r) / (4 / 0.9996 ** 2) for r in rings)
    # Of discs the tolerance, about half a pixel, takes as much as it adds, to a quarter of the 7 % that a shore half a
    # pixel off is worth (which vertices stay differs between releases of GEOS); of a square it may tilt every side by
    # that.
    for label, n in sizes.items():
        assert min(abs(g - n) for g in got) < (20 if label in (5, 6) else 0.018 * n)
    discs_ = np.count_nonzero((labels > 0) & (labels < 255)) + 9 - 2 * 400
    assert abs(sum(g for g in got if abs(g - 400) > 20) / discs_ - 1) < 5e-3
    _, record = outlines(tif, "--cut", "drop", "--water", "0,7")
    assert counted(record)["cut"] == 1 and record["floes"]["floes"] == 5
    np.testing.assert_allclose(record["floes"]["imaged_share"], 1, atol=0.2)
    png = image(tmp_path / "map.png", labels, None, (500000.0, 8900000.0), driver="PNG")
    assert "--crs" in outlines(png, code=IO, name="no.geojson")
    again, _ = outlines(png, "--crs", "EPSG:32633", "--water", "0,255", "--heading", 90)
    assert sorted(plane_area(r) for r in again) == pytest.approx(sorted(plane_area(r) for r in rings), rel=1e-6)
    np.save(tmp_path / "map.npy", labels)
    assert "--pixel" in outlines(tmp_path / "map.npy", code=IO, name="no.geojson")
    plain, record = outlines(tmp_path / "map.npy", "--pixel", "2 m", "--water", "0,255", "--thickness", "1=0.5,2=1.5")
    # where two vertices are equally far from a line, rounding decides which stays
    assert len(plain) == 7 and sum(plane_area(r) for r in plain) == pytest.approx(4 * sum(got), rel=3e-3)
    assert record["floes"]["with_thickness"] == 3 and record["map"]["crs"] == "local metres"


def on_pixels(polygon, shape):
    """Which pixels have their middle in a convex polygon."""
    y, x = np.indices(shape) + 0.5
    ring = np.asarray(polygon.exterior.coords)
    side = [(b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) for a, b in zip(ring, ring[1:])]
    return (np.array(side) > 0).all(axis=0)


def convex_polygons(rng, n, middle, radius):
    for _ in range(n):
        points = middle + rng.uniform(0.3, 1) * radius * regular(0, 0, 1, 9)[rng.permutation(9)[:6]] * [
            1, rng.uniform(.4, 1)]
        a = rng.uniform(0, 7)
        turned = (points - middle) @ [[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]] + middle + rng.uniform(0, 1, 2)
        yield Polygon(turned).convex_hull.buffer(0)


def test_staircases_of_convex_shapes_become_convex():
    """As few bays as the pixels allow: none. Every unit step lies within half a pixel of the shore, and so does the
    polygon that was drawn. Red: Douglas & Peucker, with which 139 of 144 were not convex."""
    rng = np.random.default_rng(3)
    for drawn in convex_polygons(rng, 40, 45, 40):
        drawn = drawn if drawn.exterior.is_ccw else Polygon(list(drawn.exterior.coords)[::-1])
        labels = on_pixels(drawn, (92, 92)).astype(np.int32)
        region = max((p for p, _ in map_read.regions(labels, labels > 0)), key=lambda p: p.area)
        shore = map_stairs.straight(region)
        assert shore.convex_hull.area < shore.area * (1 + 1e-9)
        assert shore.area == pytest.approx(region.area, rel=5e-3)
        steps = map_stairs.unit_steps(np.asarray(region.exterior.coords))
        inner, outer = map_stairs.gates(*steps, 0.5)
        corners, at = map_stairs.tight(inner, outer)
        within = map_stairs.filled(corners, map_stairs.edge_room(corners, at, inner, outer), region.area, 1.0)
        # before and after it takes the rest of the area
        for ring, most in ((within, 0.5 + 1e-9), (shore.exterior.coords, 0.9)):
            assert max(Polygon(ring).exterior.distance(Point(m)) for m in steps[0]) < most
        assert shore.symmetric_difference(drawn).area < 0.45 * drawn.length


def test_bays_that_pixels_prove_stay():
    labels = discs(np.zeros((80, 80), np.int32), (40, 40, 30, 1), (40, 66, 12, 0))
    (region, _), = map_read.regions(labels, labels > 0)
    shore = map_stairs.straight(region)
    bay = shore.convex_hull.difference(shore)
    assert shore.area == pytest.approx(region.area, rel=1e-3) and bay.area > 150 and bay.geom_type == "Polygon"
    square, = (p for p, _ in map_read.regions(np.ones((7, 9), np.int32), np.ones((7, 9), bool)))
    assert map_stairs.straight(square).symmetric_difference(square).area < 0.02 * square.area


@pytest.mark.parametrize("pixel", [(1.0, 1.0), (0.0133, 0.0133), (3.0, 2.0)])
@pytest.mark.parametrize("middles", [False, True])
def test_outlines_traced_along_pixels_are_made_straight(tmp_path, pixel, middles):
    """Along the edges of pixels, as GDAL polygonizes, or from middle to middle, as contours of images run, rounded:
    convex, each with its area and the names of those that an image's edge cut. Red: 517 floes of a public map in 5,760
    convex parts, by this 613."""
    rng = np.random.default_rng(8)
    rings = []
    for k, drawn in enumerate(convex_polygons(rng, 12, 30, 27)):
        drawn = drawn if drawn.exterior.is_ccw else Polygon(list(drawn.exterior.coords)[::-1])
        labels = on_pixels(drawn, (64, 64)).astype(np.int32)
        region = max((p for p, _ in map_read.regions(labels, labels > 0)), key=lambda p: p.area)
        ring = np.asarray(region.exterior.coords)[:-1]
        if middles:
            inner, _ = map_stairs.gates(*map_stairs.unit_steps(np.asarray(region.exterior.coords)), 0.5)
            ring = inner[np.r_[True, np.abs(np.diff(inner, axis=0)).sum(axis=1) > 0]]
            ring = ring if np.abs(ring[0] - ring[-1]).sum() else ring[:-1]
        rings.append(np.round((ring + (70 * (k % 4), 70 * (k // 4))) * pixel, 5))
    map_ = write(tmp_path / "map.geojson", rings, map_read.local_crs())
    got, record = outlines(map_, "--heading", 90)
    assert counted(record)["stairs"] == 12 and record["floes"]["convex"] >= 11
    assert sum(map(plane_area, got)) == pytest.approx(sum(map(plane_area, rings)), rel=1e-4)
    for a, b in zip(got, rings):
        assert plane_area(a) == pytest.approx(plane_area(b), rel=1e-3)
    kept, record = outlines(map_, "--heading", 90, "--stairs", "keep")
    assert "stairs" not in counted(record) and record["floes"]["convex"] == 0
    assert sum(map(len, kept)) > 2 * sum(map(len, got))


def test_the_edge_of_an_image_is_seen_before_staircases_go(tmp_path):
    labels = discs(np.zeros((90, 90), np.int32), (20, 0, 12, 1), (60, 1, 15, 2), (40, 60, 20, 3))
    rings = [np.asarray(p.exterior.coords)[:-1] * (1, -1) for p, _ in map_read.regions(labels, labels > 0)]
    map_ = write(tmp_path / "map.geojson", rings, map_read.local_crs())
    counts = counted(outlines(map_)[1])
    assert counts["stairs"] == 3 and counts["cut kept"] == 2


def test_outlines_drawn_by_hand_are_no_staircases(tmp_path):
    """Boxes on a grid, crosses of long edges, polygons of any kind: as they are."""
    cross = np.array([[3, 0], [6, 0], [6, 3], [9, 3], [9, 6], [6, 6], [6, 9], [3, 9], [3, 6], [0, 6], [0, 3], [3, 3]])
    crosses = [10 * cross + (200 * k, 30 * k) for k in range(3)] + [np.array([[0, 0], [10, 0], [10, 10], [0, 10]]) - 50]
    boxes = [np.array([[0, 0], [20, 0], [20, 30], [10, 30], [10, 20], [0, 20]]) + (50 * k, 10 * k) for k in range(6)]
    for rings in (boxes, crosses, RINGS):
        got, record = outlines(write(tmp_path / "map.geojson", rings, map_read.local_crs()), "--centre", "0,0")
        assert "stairs" not in counted(record)
        assert sum(map(plane_area, got)) == pytest.approx(sum(map(plane_area, rings)), rel=1e-9)


def test_middles_of_steps_keep_the_area():
    """Of a region of pixels all but half of one, however long its shore is, and another half for each pond."""
    labels = discs(np.zeros((90, 90), np.int32), (45, 45, 40, 1), (45, 45, 12, 0), (20, 45, 5, 0))
    (region, value), = map_read.regions(labels, labels > 0)
    assert value == 1 and region.area == np.count_nonzero(labels)
    assert map_read.bevelled(region).area == np.count_nonzero(labels) - 0.5 + 2 * 0.5
    assert map_read.bevelled(region).is_valid


def test_an_image_is_not_mirrored(tmp_path):
    """A floe in the upper left corner lies in the north-west; and a shore is where the pixels say, to half a pixel."""
    labels = np.zeros((60, 80), np.uint8)
    labels[5:15, 4:30] = 1
    labels[40:50, 60:70] = 1
    np.save(tmp_path / "map.npy", labels)
    rings, _ = outlines(tmp_path / "map.npy", "--pixel", "1", "--centre", "0,0")
    boxes = sorted((*r.min(axis=0), *r.max(axis=0)) for r in rings)
    np.testing.assert_allclose(boxes, [(-36, 15, -10, 25), (20, -20, 30, -10)], atol=0.51)


@pytest.mark.parametrize("side", [6, 10, 20, 40])
def test_squares_keep_the_area_of_their_pixels(tmp_path, side):
    """Simplifying takes the bevelled corners, and the shore moves out by as much."""
    labels = np.zeros((side + 20, side + 20), np.uint8)
    labels[10:10 + side, 10:10 + side] = 1
    np.save(tmp_path / "map.npy", labels)
    ring, = outlines(tmp_path / "map.npy", "--pixel", "1")[0]
    assert plane_area(ring) == pytest.approx(side ** 2, rel=2e-6)


def test_small_floes_count_by_their_pixels(tmp_path):
    """Of four pixels and more they stay, whatever their shape; what is left out is counted with all its pixels."""
    labels = np.zeros((40, 60), np.uint8)
    for k, (rows, columns) in enumerate([(2, 2), (2, 3), (3, 2), (1, 3), (3, 1)]):
        labels[5 * k + 5:5 * k + 5 + rows, 8 * k + 5:8 * k + 5 + columns] = 1
    np.save(tmp_path / "map.npy", labels)
    rings, record = outlines(tmp_path / "map.npy", "--pixel", "1")
    assert sorted(plane_area(r) for r in rings) == pytest.approx([4, 6, 6], rel=2e-6)
    assert record["changes"]["small"]["count"] == 2 and record["changes"]["small"]["area_before_m2"] == pytest.approx(6)


def test_nodata_that_is_water(tmp_path):
    """It is one or the other, and the user says which; a mask band is what was seen."""
    labels = discs(np.zeros((60, 60), np.uint8), (30, 30, 15, 1))
    tif = image(tmp_path / "map.tif", labels, 32633, (500000.0, 8900000.0), nodata=0)
    assert "both for nodata and for water" in outlines(tif, code=IO, name="no.geojson")
    _, record = outlines(tif, "--nodata", "water")
    assert record["floes"]["floes"] == 1 and "cut kept" not in counted(record)
    _, record = outlines(tif, "--nodata", "unseen")
    assert counted(record)["cut kept"] == 1
    plain = image(tmp_path / "masked.tif", labels, 32633, (500000.0, 8900000.0))
    dataset = gdal.Open(str(plain), gdal.GA_Update)
    dataset.CreateMaskBand(gdal.GMF_PER_DATASET)
    seen = np.full(labels.shape, 255, np.uint8)
    seen[:, 30:] = 0
    dataset.GetRasterBand(1).GetMaskBand().WriteArray(seen)
    dataset = None
    rings, record = outlines(plain)
    assert counted(record)["cut kept"] == 1 and plane_area(np.array(rings[0])) > 0
    assert record["floes"]["area_m2"] == pytest.approx(4 * np.count_nonzero(labels[:, :30]), rel=5e-3)


@pytest.mark.parametrize("value, kind", [(255, gdal.GDT_Byte), (np.nan, gdal.GDT_Float32), (-3e38, gdal.GDT_Float32)])
def test_nodata_that_is_water_need_not_be_a_label(tmp_path, value, kind):
    """It made a floe around the others. Where the image names none, there is nothing to say of it."""
    def tif(name, nodata):
        file = gdal.GetDriverByName("GTiff").Create(str(tmp_path / name), 60, 60, 1, kind)
        file.SetGeoTransform((0.0, 2.0, 0, 0.0, 0, -2.0))
        if nodata:
            file.GetRasterBand(1).SetNoDataValue(nodata)
        labels = np.full((60, 60), value, np.uint8 if kind == gdal.GDT_Byte else np.float32)
        file.GetRasterBand(1).WriteArray(discs(labels, (20, 20, 9, 1), (40, 40, 9, 2)))
        return tmp_path / name
    rings, record = outlines(tif("map.tif", value), "--crs", "local", "--nodata", "water")
    assert len(rings) == 2 and "cut kept" not in counted(record)
    assert "has no nodata value" in outlines(tif("unnamed.tif", None), "--crs", "local", "--nodata", "water", code=IO,
                                             name="no.geojson")


def test_a_map_that_is_turned_is_no_rectangle(tmp_path):
    """Floes that fill a square turned by 45 degrees: the concentration is that of their hull, and it is said that the
    rectangle is not full."""
    turned = np.array([[1, -1], [1, 1]]) / np.sqrt(2)
    rings = [(turned @ regular(x, y, 45, 4, np.pi / 4).T).T for x in range(-450, 500, 80) for y in range(-450, 500, 80)]
    path = write(tmp_path / "map.geojson", rings, map_read.local_crs())
    _, record = outlines(path)
    numbers = record["floes"]
    hull = (np.ptp(range(-450, 500, 80)) + 2 * 45 / np.sqrt(2)) ** 2
    assert numbers["concentration"] == pytest.approx(numbers["area_m2"] / hull, rel=0.01)
    assert numbers["imaged_share"] == pytest.approx(0.5, abs=0.02)


def test_the_concentration_of_a_box_is_of_what_lies_in_it(tmp_path):
    """As of the case that reads it. Red: whole floes over the box, 2.5 of it."""
    path = write(tmp_path / "map.geojson", [regular(x, 0, 50 * np.sqrt(2), 4, np.pi / 4) for x in (-55, 55)],
                 map_read.local_crs())
    _, record = outlines(path, "--centre", "0,0", "--box", "120m,60m", "--clear", "2m", "--heading", 90)
    clear = np.pi * 2 ** 2
    assert record["floes"]["concentration"] == pytest.approx(110 * 60 / (120 * 60 - clear), rel=1e-4)


@pytest.mark.parametrize("name, read", [("THICKNESS", True), ("Thickness", True), ("thick_m", False)])
def test_a_thickness_by_another_name(tmp_path, capsys, name, read):
    path = write(tmp_path / "map.geojson", [places(r) for r in RINGS])
    root = json.loads(path.read_text())
    for feature in root["features"]:
        feature["properties"] = {name: 1.5}
    path.write_text(json.dumps(root))
    _, record = outlines(path)
    said = capsys.readouterr().out
    assert record["floes"]["with_thickness"] == (len(root["features"]) if read else 0)
    assert (f"not read as the thickness: {name}" in said) == ("thickness: no floe has one" in said) == (not read)


@pytest.mark.parametrize("value", [150, 1e-7, -1, 0])
def test_a_thickness_that_no_case_accepts(tmp_path, value):
    """As in the case that reads the floes. Red: written, and refused there."""
    path = write(tmp_path / "map.geojson", [places(r) for r in RINGS[:2]])
    root = json.loads(path.read_text())
    root["features"][1]["properties"] = {"thickness": value}
    path.write_text(json.dumps(root))
    said = outlines(path, code=IO)
    assert f"map.geojson: feature 1: thickness = {value} is not a thickness in metres, from 1e-06 to 100" in said
    np.save(tmp_path / "map.npy", np.pad(np.ones((5, 5)), 2))
    said = outlines(tmp_path / "map.npy", "--pixel", "1", "--thickness", f"1={value}", code=IO)
    assert "in metres, from 1e-06 to 100; write for example 1=0.5" in said


@pytest.mark.parametrize("value", [100, 1e-6])
def test_a_thickness_at_an_end_of_its_range(tmp_path, value):
    np.save(tmp_path / "map.npy", np.pad(np.ones((5, 5)), 2))
    _, record = outlines(tmp_path / "map.npy", "--pixel", "30", "--thickness", f"1={value}", "--heading", "0")
    assert record["floes"]["mean_thickness_m"] == value
    case = changed(FRAMES["basin"], ice={"outlines": "out.geojson"})
    assert field(tmp_path, case)[1].tolist() == [value]


@pytest.mark.parametrize("values", [{"Thickness": None, "thickness": 2.0}, {"thickness": 2.0, "Thickness": None},
                                    {"THICKNESS": None, "Thickness": 2.0}, {"Thickness": "thick", "thickness": 2.0}])
def test_columns_that_differ_in_case(tmp_path, capsys, values):
    """One is read, and the other is named. Red: looked for in one column and read from the other."""
    path = write(tmp_path / "map.geojson", [places(r) for r in RINGS[:4]])
    root = json.loads(path.read_text())
    alone = {name: value for name, value in values.items() if value == 2.0}
    other, = values.keys() - alone.keys()
    for k, feature in enumerate(root["features"]):
        feature["properties"] = values if k % 2 == 0 else alone
    path.write_text(json.dumps(root))
    words = ("--thickness", *alone) if "thickness" not in alone else ()
    record = outlines(path, *words)[1]["floes"]
    assert (record["with_thickness"], record["mean_thickness_m"]) == (4, 2.0)
    assert (f"not read as the thickness: {other};" in capsys.readouterr().out) == (words == ())


# ---- maps as the world has them


def coded(record):
    return {w["code"]: w for w in record["warnings"]}


def geopackage(path, rings, srs_id):
    """One whose system is undefined, as programs write it that do not know theirs."""
    file = gdal.GetDriverByName("GPKG").Create(str(path), 0, 0, 0, gdal.GDT_Unknown)
    layer = file.CreateLayer("floes", None, ogr.wkbPolygon)
    for ring in rings:
        feature = ogr.Feature(layer.GetLayerDefn())
        feature.SetGeometry(ogr.CreateGeometryFromWkb(Polygon(ring).wkb))
        layer.CreateFeature(feature)
    for table in "gpkg_contents", "gpkg_geometry_columns":
        file.ExecuteSQL(f"UPDATE {table} SET srs_id = {srs_id}")
    return path


UNSAID = {
    "GeoJSON": lambda p, rings: write(p / "map.geojson", rings),
    "GeoJSON of a program that names the default": lambda p, rings: write(
        p / "map.geojson", rings, "urn:ogc:def:crs:OGC:1.3:CRS84"),
    "GeoJSON in EPSG:4326": lambda p, rings: write(p / "map.geojson", rings, "EPSG:4326"),
    "lines of GeoJSON": lambda p, rings: text(p / "map.geojsonl", "".join(json.dumps({
        "type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [
            [*r.tolist(), r[0].tolist()]]}}) + "\n" for r in rings)),
    "GeoPackage, undefined geographic": lambda p, rings: geopackage(p / "map.gpkg", rings, 0),
    "GeoPackage, undefined Cartesian": lambda p, rings: geopackage(p / "map.gpkg", rings, -1),
}


@pytest.mark.parametrize("kind", UNSAID)
@pytest.mark.parametrize("crs", ["EPSG:32633", "local"])
def test_the_system_is_said_where_the_file_does_not(tmp_path, capsys, kind, crs):
    """Red: "is in EPSG:4326", which no file of these says of itself, "but --crs says ...": no way on."""
    rings = [r + (500e3, 8.9e6) for r in RINGS]
    map_ = UNSAID[kind](tmp_path, rings)
    said = outlines(map_, code=IO, name="no.geojson")
    assert "--crs" in said
    capsys.readouterr()
    got, record = outlines(map_, "--crs", crs, "--heading", 90)
    assert record["map"]["crs"].startswith("local" if crs == "local" else crs)
    assert "crs: as --crs says; the file" in capsys.readouterr().out
    assert sum(map(plane_area, got)) == pytest.approx(sum(map(plane_area, rings)), rel=0 if crs == "local" else 2e-3,
                                                      abs=1e-3)


def test_what_contradicts_crs_is_refused_all_the_same(tmp_path):
    degrees = write(tmp_path / "map.geojson", [places(r) for r in RINGS])
    assert "as degrees do" in outlines(degrees, "--crs", "EPSG:32633", code=IO, name="no.geojson")
    assert "degrees look in metres" in outlines(degrees, "--crs", "local", code=IO, name="no.geojson")
    shape = tmp_path / "map.gpkg"
    ogr2ogr("-f", "GPKG", shape, degrees)
    assert "but --crs says" in outlines(shape, "--crs", "EPSG:3413", code=IO, name="no.geojson")


def test_a_field_in_metres_comes_back_through_another_program(tmp_path):
    """Of the name of local metres GDAL makes EPSG:4326, and programs on it write that."""
    case = changed(FRAMES["basin"], ice={"concentration": 0.3, "size": 20, "thickness": 0.5})
    rings, *_ = field(tmp_path, case)
    field(tmp_path, case, name="field.geojson")
    ogr2ogr("-f", "GeoJSON", "-lco", "RFC7946=NO", tmp_path / "through.geojson", tmp_path / "field.geojson")
    assert "CRS84" in json.loads((tmp_path / "through.geojson").read_text())["crs"]["properties"]["name"]
    back, _ = outlines(tmp_path / "through.geojson", "--crs", "local", "--centre", "0,0", "--heading", 90)
    assert sum(map(plane_area, back)) == pytest.approx(sum(map(plane_area, rings)), rel=1e-3)


GRID = discs(np.zeros((60, 80), np.int16), (15, 12, 9, 1), (40, 60, 14, 2))  # small in the north-west


def hdf5(path, **grids):
    with h5py.File(path, "w") as f:
        for name, values in grids.items():
            f[name.replace("__", "/")] = values
    return path


def netcdf(path, step, at=None, **grids):
    """With coordinates x and y, from the first row on by `step`; None: without any."""
    with netCDF4.Dataset(path, "w") as f:
        for name, n in ("y", 60), ("x", 80):
            f.createDimension(name, n)
            if step is not None:
                f.createVariable(name, "f8", (name,))[:] = np.arange(n) * (step if name == "y" else abs(step))
        for name, values in grids.items():
            f.createVariable(name, values.dtype, ("y", "x"))[:] = values
    return path


def lie_as_in_the_image(rings):
    small, large = sorted(rings, key=plane_area)
    (x, y), (x2, y2) = small.mean(axis=0), large.mean(axis=0)
    return x < x2 - 60 and y > y2 + 20


@pytest.mark.parametrize("make, words", [
    (lambda p: hdf5(p / "map.h5", labels=GRID), ("--pixel", "2")),
    (lambda p: hdf5(p / "map.h5", seg__labels=GRID, odds=GRID / 3), ("--pixel", "2", "--layer", "seg/labels")),
    (lambda p: netcdf(p / "map.nc", None, labels=GRID), ("--pixel", "2")),
    (lambda p: netcdf(p / "map.nc", None, labels=GRID, odds=GRID / 3), ("--pixel", "2", "--layer", "labels")),
    (lambda p: netcdf(p / "map.nc", -2.0, labels=GRID), ("--crs", "local")),
    (lambda p: netcdf(p / "map.nc", 2.0, labels=GRID[::-1], odds=GRID / 3), ("--crs", "local", "--layer", "labels"))])
def test_grids_are_chosen_by_name_and_not_mirrored(tmp_path, make, words):
    """Red: "has 0 bands, as pictures do"; and GDAL's netCDF driver reads rows without a place from the south."""
    map_ = make(tmp_path)
    if "--layer" in words:
        assert "holds the grids" in (said := outlines(map_, code=IO, name="no.geojson"))
        assert words[-1] + " [60x80]" in said and "odds" in said and "--layer" in said
        assert "holds the grids" in outlines(map_, "--layer", "none", code=IO, name="no.geojson")
    rings, record = outlines(map_, *words, "--heading", 90)
    assert len(rings) == 2 and lie_as_in_the_image(rings) and record["warnings"] == []
    assert sum(map(plane_area, rings)) == pytest.approx(4 * np.count_nonzero(GRID), rel=1e-3)


def test_rows_along_y_are_refused(tmp_path):
    """A variable as (x, y), which CF allows. Red: the map is mirrored and elsewhere."""
    with netCDF4.Dataset(tmp_path / "map.nc", "w") as f:
        for name, n in ("x", 80), ("y", 60):
            f.createDimension(name, n)
            f.createVariable(name, "f8", (name,))[:] = 2.0 * np.arange(n)
            f[name].setncatts({"standard_name": f"projection_{name}_coordinate", "units": "m"})
        f.createVariable("labels", GRID.dtype, ("x", "y"))[:] = GRID.T
    assert "holds labels as (x, y)" in outlines(tmp_path / "map.nc", "--crs", "EPSG:3413", code=IO)


def test_an_ice_chart_is_not_a_map_of_floes(tmp_path):
    """Red: regions of 50 km ran as three floes of 100 %, the island in one of them as ice, and nothing was said."""
    def ring(r):
        return places(r).tolist() + places(r[:1]).tolist()
    region = {"type": "Polygon", "coordinates": [ring(regular(0, 0, 9e3)), ring(regular(0, 0, 2e3))]}
    map_ = write(tmp_path / "chart.geojson", [region, places(regular(30e3, 0, 8e3))])
    root = json.loads(map_.read_text())
    for feature in root["features"]:
        feature["properties"] = {"POLY_TYPE": "I", "ct": "91"}
    map_.write_text(json.dumps(root))
    _, record = outlines(map_, "--where", "POLY_TYPE = 'I'")
    warning = coded(record)["ice_chart"]
    assert "100 %" in warning["text"] and len(warning["text"]) <= 160
    assert warning["values"]["holes_m2"] == pytest.approx(plane_area(regular(0, 0, 2e3)), rel=1e-3)
    assert warning["values"]["columns"] == ["POLY_TYPE", "ct"]


def with_attributes(path, values, **more):
    netcdf(path, -2.0, labels=values)
    with netCDF4.Dataset(path, "a") as f:
        f["labels"].setncatts(more)
    return path


@pytest.mark.parametrize("more", [{"units": "%"}, {"standard_name": "sea_ice_area_fraction", "units": "1"},
                                  {"long_name": "Ice Concentration"}, {"long_name": "floe number", "units": "1"}])
def test_a_grid_of_concentration_is_an_ice_chart(tmp_path, more):
    """Red: regions of 30 % became floes of 100 %, and nothing was said."""
    map_ = with_attributes(tmp_path / "map.nc", GRID * 30, **more)
    _, record = outlines(map_, "--crs", "local")
    assert ("ice_chart" in coded(record)) == (more.get("long_name") != "floe number")


def test_packed_numbers_are_no_labels(tmp_path):
    """Red: 0.01 to 1 in steps of a hundredth is taken for a hundred labels."""
    map_ = with_attributes(tmp_path / "map.nc", GRID * 30, scale_factor=0.01)
    assert "not labels" in outlines(map_, "--crs", "local", code=IO)


@pytest.mark.parametrize("key", ["crs_wkt", "spatial_ref", None])
@pytest.mark.parametrize("unit, scale", [("km", 1e-3), ("kilometre", 1e-3), ("m", 1.0)])
def test_a_grid_in_kilometres(tmp_path, key, unit, scale):
    """Its coordinates have a unit of their own beside that of the system. Red: with crs_wkt or spatial_ref a grid in km
    was a thousand times too small, and at the pole."""
    with netCDF4.Dataset(tmp_path / "map.nc", "w") as f:
        for name, n, first, step in ("y", 60, -800e3, -500.0), ("x", 80, 400e3, 500.0):
            f.createDimension(name, n)
            f.createVariable(name, "f8", (name,))[:] = (first + np.arange(n) * step) * scale
            f[name].setncatts({"standard_name": f"projection_{name}_coordinate", "units": unit})
        about = CRS(3413).to_cf()
        wkt = about.pop("crs_wkt")
        f.createVariable("crs", "i4").setncatts(about | ({key: wkt} if key else {}))
        f.createVariable("labels", GRID.dtype, ("y", "x"))[:] = GRID
        f["labels"].grid_mapping = "crs"
        f.Conventions = "CF-1.8"
    _, record = outlines(tmp_path / "map.nc")
    lon, lat = Transformer.from_crs(3413, "OGC:CRS84", always_xy=True).transform(420e3, -815e3)
    assert record["plane"]["centre"] == pytest.approx([lon, lat], abs=0.3)
    grid = np.count_nonzero(GRID) * 500.0 ** 2
    assert record["floes"]["area_m2"] == pytest.approx(grid * 1.026 ** 2, rel=0.01)


@pytest.mark.parametrize("name, authority", [
    ("WGS84", "EPSG:4326"), ("wgs 84", "EPSG:4326"), ("CRS84", "OGC:CRS84"), ("epsg:3413", "EPSG:3413"),
    ("urn:ogc:def:crs:EPSG::3413", "EPSG:3413"), ("ETRS89 / UTM zone 33N", "EPSG:25833"), ("3413", "EPSG:3413"),
    ("WGS_84_/_UTM_zone_33N", "EPSG:32633"),
    # those of ArcGIS
    ("WGS_1984_UTM_Zone_33N", "EPSG:32633"), ("GCS_WGS_1984", "EPSG:4326"),
    ("WGS_1984_NSIDC_Sea_Ice_Polar_Stereographic_North", "EPSG:3413")])
def test_names_of_systems(name, authority):
    assert ":".join(map_plane.known("map", name, "its crs").to_authority()) == authority


@pytest.mark.parametrize("name", ["foo", "Arctic", "WGS", "UTM zone 33N"])
def test_names_of_systems_are_not_guessed(name):
    """Red: foo is Amersfoort, and Arctic lies in Australia."""
    with pytest.raises(RunError):
        map_plane.known("map", name, "its crs")


@pytest.mark.parametrize("first, second, kept, unequal", [
    (0.3, 3.0, 3.0, 1), (3.0, 0.3, 3.0, 1), (None, 2.0, 2.0, 0), (2.0, None, 2.0, 0), (2.0, 2.0, 2.0, 0),
    (None, None, None, 0)])
def test_the_same_floe_traced_twice(tmp_path, first, second, kept, unequal):
    """Red: the first in the file decided its thickness, also where it had none."""
    map_ = write(tmp_path / "map.geojson", [places(RINGS[0])] * 2 + [places(RINGS[1])])
    root = json.loads(map_.read_text())
    for feature, thickness in zip(root["features"], (first, second, 1.0)):
        feature["properties"]["thickness"] = thickness
    map_.write_text(json.dumps(root))
    _, record = outlines(map_)
    assert counted(record)["twice"] == 1 and counted(record).get("unequal", 0) == unequal
    out = json.loads((tmp_path / "out.geojson").read_text())["features"]
    assert sorted(str(f["properties"].get("thickness")) for f in out) == sorted(map(str, (kept, 1.0)))


def test_a_grid_with_a_time(tmp_path):
    """Red: the time is taken for the map, and with --layer and --band the messages lead in a circle."""
    with netCDF4.Dataset(tmp_path / "map.nc", "w") as f:
        for name, n in ("time", 1), ("y", 60), ("x", 80):
            f.createDimension(name, n)
            f.createVariable(name, "f8", (name,))[:] = np.arange(n) * (-2.0 if name == "y" else 2.0)
        f["time"].units = "days since 2020-01-01"
        for name in "x", "y":
            f[name].setncatts({"standard_name": f"projection_{name}_coordinate", "units": "m"})
        f.createVariable("labels", GRID.dtype, ("time", "y", "x"))[:] = GRID[None]
    rings, _ = outlines(tmp_path / "map.nc", "--crs", "local", "--heading", 90)
    assert len(rings) == 2 and lie_as_in_the_image(rings)


def labelled(path, labels):
    np.save(path, labels)
    return path


def test_negative_labels(tmp_path):
    """-1 is what is in no group. Red: one floe of the whole image, the others "within another, left out"."""
    labels = GRID.astype(np.int16) - 1
    map_ = labelled(tmp_path / "map.npy", labels)
    said = outlines(map_, "--pixel", "2", "--water", "0", code=IO, name="no.geojson")
    assert "label -1" in said and "--water 0,-1" in said
    for water in ("-1", "-1,7"):
        rings, _ = outlines(map_, "--pixel", "2", "--water", water)
        assert len(rings) == 2


@pytest.mark.parametrize("kind, first", [(np.uint32, 2 ** 31 + 5), (np.int64, 2 ** 40), (np.uint64, 2 ** 63 + 1),
                                         (np.float64, 2.0 ** 50)])
def test_labels_of_any_size(tmp_path, kind, first):
    """Red: "has values that are not labels (whole numbers)", which they are."""
    labels = np.where(GRID > 0, GRID.astype(kind) + kind(first), kind(0))
    map_ = labelled(tmp_path / "map.npy", labels)
    rings, record = outlines(map_, "--pixel", "2", "--thickness", f"{int(kind(first) + kind(1))}=0.5")
    assert len(rings) == 2 and record["floes"]["with_thickness"] == 1
    assert outlines(labelled(tmp_path / "map.npy", GRID), "--pixel", "2")[1]["floes"]["area_m2"] == record["floes"][
        "area_m2"]
    source = json.loads((tmp_path / "out.geojson").read_text())["features"][0]["properties"]["source"]
    assert str(GRID.max()) in source or str(GRID[GRID > 0].min()) in source
    assert "not labels" in outlines(labelled(tmp_path / "half.npy", GRID / 2.0), "--pixel", "2", code=IO,
                                   name="no.geojson")


def test_what_of_an_image_was_seen(tmp_path):
    """A trapezium in a black rectangle: the concentration is of what was imaged. By a label of its own, by corners, and
    by nodata. Red: 0.25 for 0.40."""
    rows, columns = np.indices((100, 120))
    seen = np.abs(columns + 0.5 - 60) < 20 + 0.4 * (rows + 0.5)
    labels = discs(np.zeros((100, 120), np.uint8), (20, 60, 12, 1), (60, 40, 14, 2), (70, 80, 18, 3))
    share = np.count_nonzero(labels) / np.count_nonzero(seen)
    black = np.where(seen, labels, 9)
    for map_, words in ((labelled(tmp_path / "a.npy", black), ("--unseen", "9")),
                        (labelled(tmp_path / "a.npy", black), ("--unseen", "9,-3")),
                        (labelled(tmp_path / "b.npy", labels), ("--footprint", "40,0,80,0,120,100,0,100"))):
        _, record = outlines(map_, "--pixel", "2", *words)
        # of the rectangle around the floes, as ever
        x0, x1, y0, y1 = (v / 2 for v in record["floes"]["rectangle_m"])
        middle = np.array(record["plane"]["centre"]) / 2
        x, y = columns + 0.5 - 60 - middle[0], 50 - rows - 0.5 - middle[1]
        part = seen & (x > x0) & (x < x1) & (y > y0) & (y < y1)
        assert record["floes"]["concentration"] == pytest.approx(np.count_nonzero(labels) / np.count_nonzero(part),
                                                                 rel=0.025)
        assert record["floes"]["imaged_share"] == pytest.approx(np.count_nonzero(part) / (x1 - x0) / (y1 - y0),
                                                                rel=0.02)
    assert share < 0.5
    tif = image(tmp_path / "c.tif", black, nodata=9)
    assert outlines(tif, "--crs", "local", "--unseen", "9")[1]["floes"]["floes"] == 3
    assert "no pixel that was seen" in outlines(tmp_path / "b.npy", "--pixel", "2", "--unseen", "0,1,2,3", code=IO,
                                                name="no.geojson")


def test_floes_that_have_grown_together(tmp_path):
    """Red: nothing is said where a mask has bridges between floes, or where a label of water is taken for ice."""
    mask = (GRID > 0).astype(np.uint8)
    apart, record = outlines(labelled(tmp_path / "map.npy", mask), "--pixel", "2")
    assert record["warnings"] == []
    mask[15:18, 15:55] = mask[15:35, 54:57] = 1
    _, record = outlines(labelled(tmp_path / "map.npy", mask), "--pixel", "2")
    assert coded(record)["necks"]["values"]["floes"] == 1
    background, record = outlines(labelled(tmp_path / "map.npy", GRID + 1), "--pixel", "2")
    assert len(background) == 1 and coded(record)["merged_floes"]["values"]["share"] == 1
    # a large floe, or one alone, is none of it
    alone = discs(np.zeros((60, 80), np.uint8), (30, 40, 20, 1))
    assert outlines(labelled(tmp_path / "map.npy", alone), "--pixel", "2")[1]["warnings"] == []
    beside = discs(alone, (8, 8, 5, 2), (50, 70, 6, 3))
    _, record = outlines(labelled(tmp_path / "map.npy", beside), "--pixel", "2")
    assert set(coded(record)) == {"merged_floes"} and len(coded(record)["merged_floes"]["text"]) <= 160


# ---- repairs


def test_every_change_is_counted(tmp_path):
    """Each fault once, with what it does to the area; and read plus changes is what was written."""
    def box(x, y, a, b):
        y += x / 1000  # edges on one line, at the side of all, are the edge of an image
        return [[x, y], [x + a, y], [x + a, y + b], [x, y + b]]

    def closed(*rings):
        return [[*map(list, r), list(r[0])] for r in rings]
    shapes = {
        "crossing": [[0, 0], [20, 20], [20, 0], [0, 20]],
        "holes": {"type": "Polygon", "coordinates": closed(box(50, 0, 20, 20), box(55, 5, 5, 4))},
        "several": {"type": "MultiPolygon", "coordinates": [closed(box(100, 0, 10, 10)), closed(box(120, 0, 10, 12))]},
        "twice": box(150, 0, 20, 20), "twin": box(150, 0, 20, 20.2),
        "within": box(200, 0, 30, 30), "inner": box(205, 5, 8, 8),
        "large": box(250, 0, 20, 30), "small": box(265, 10, 10, 10),
        "sliver": box(300, 0, 30, 0.05), "crumb": box(350, 0, 1, 1),
        "far": box(900, 0, 20, 20), "berg": box(190, 95, 20, 20),
        "many": regular(50, 100, 20, 400), "detail": [[100, 100], [110, 100.05], [120, 100], [120, 120], [100, 120]],
        "neighbour": box(130, 100, 10, 10), "touches": box(140, 100, 10, 12),
    }
    map_ = write(tmp_path / "map.geojson", shapes.values(), "urn:x-bergtow:crs:local-metres-east-north")
    rings, record = outlines(map_, "--centre", "200,105", "--box", "600,600", "--clear", "15", "--tolerance", "0.1",
                             "--least", "4", "--heading", "90")
    found = record["changes"]
    counts = counted(record)
    # the vertex at which a ring begins stays in GEOS before 3.12; later it may go, and the sliver is a triangle
    assert (corner := counts.pop("simplified") - 2) in (0, 1)
    assert counts == {"crossing": 1, "several": 2, "holes": 1, "outside": 1, "clear": 1, "slivers": 1, "small": 1,
                      "twice": 1, "within": 1, "overlaps": 1, "touching": 2}
    change = {k: c["area_after_m2"] - c["area_before_m2"] for k, c in found.items()}
    for kind, want in (("holes", 20), ("outside", -400), ("clear", -400), ("slivers", -0.75 * (2 - corner)),
                       ("small", -1), ("twice", -404), ("within", -64), ("overlaps", -50), ("several", 0),
                       ("touching", 0)):
        assert change[kind] == pytest.approx(want, abs=0.02), kind
    # what was read, crossing rings as they are when mended, less what changed
    area = {k: plane_area(s) for k, s in shapes.items() if isinstance(s, list) or isinstance(s, np.ndarray)}
    read = sum(v for k, v in area.items() if k != "crossing") + 200 + (400 - 20) + (100 + 120)
    assert sum(map(plane_area, rings)) == pytest.approx(read + sum(v for k, v in change.items() if k != "crossing"),
                                                        abs=1e-6)
    assert record["floes"]["area_m2"] == pytest.approx(sum(map(plane_area, rings)), rel=1e-12)
    polygons = [Polygon(r) for r in rings]
    assert all(p.is_valid and len(p.exterior.coords) <= 129 for p in polygons)
    assert max(a.intersection(b).area for k, a in enumerate(polygons) for b in polygons[:k]) == 0
    # by name, also of the other of two
    assert found["overlaps"]["first"] == ["feature 7 (feature 8)"] and found["clear"]["first"] == [
        "feature 12"]


@pytest.mark.parametrize("n", [1, 2])
def test_parts_that_are_no_polygons(tmp_path, capsys, n):
    """The polygon beside them is a floe. Red: the whole feature was said to be left out, and "1 features"."""
    ring = places(RINGS[0]).tolist()
    mixed = {"type": "GeometryCollection", "geometries": [
        {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}, {"type": "Point", "coordinates": [LON, LAT]}]}
    map_ = write(tmp_path / "map.geojson", [mixed, *[places(r) for r in RINGS[1:4]], *[POINT] * n, *[mixed] * (n - 1)])
    rings, record = outlines(map_)
    assert len(rings) == 4 and {k: c for k, c in counted(record).items() if k != "twice"} == {
        "other parts": n, "no polygon": n}
    plural = "s" * (n - 1)
    said = capsys.readouterr().out
    assert f" {n}  feature{plural} with parts that are not polygons, these left out\n" in said
    assert f" {n}  feature{plural} without a polygon, left out\n" in said


def test_too_many_vertices(tmp_path):
    """A shore of 700 vertices, each of which matters at the tolerance, is made simpler still, and that is reported."""
    angle = 2 * np.pi * np.arange(700) / 700
    star = np.c_[np.cos(angle), np.sin(angle)] * (100 + 8 * (np.arange(700) % 2))[:, None]
    rings, record = outlines(write(tmp_path / "map.geojson", [star], "urn:x-bergtow:crs:local-metres-east-north"),
                             "--tolerance", "0.1")
    assert counted(record) == {"vertices": 1} and len(rings[0]) <= 128
    assert abs(plane_area(rings[0]) / plane_area(star) - 1) < 0.1


def test_a_crowd_of_overlapping_floes(tmp_path):
    """200 polygons thrown over each other: the program takes what is left, in a case of its own, and it is their union
    but for the gaps."""
    rng = np.random.default_rng(5)
    rings = [regular(*rng.uniform(-200, 200, 2), rng.uniform(10, 30), rng.integers(3, 9), rng.uniform(0, 6))
             for _ in range(200)]
    write(tmp_path / "map.geojson", rings, "urn:x-bergtow:crs:local-metres-east-north")
    got, record = outlines(tmp_path / "map.geojson", "--centre", "0,0", name="floes.geojson")
    union = unary_union([Polygon(r) for r in rings])
    lost = sum(c["area_before_m2"] for k, c in record["changes"].items() if k == "slivers")
    written = sum(map(plane_area, got))
    assert written == pytest.approx(union.area - lost, rel=0.01)
    changes = sum(c["area_after_m2"] - c["area_before_m2"] for c in record["changes"].values())
    assert written == pytest.approx(sum(map(plane_area, rings)) + changes, rel=1e-9)
    case = changed(FRAMES["geographic"], domain={"frame": "geographic", "length": 480, "width": 480, "ends": "wall",
                                                 "sides": "wall"},
                   ice={"outlines": "floes.geojson", "nonconvex": "split", "thickness": 1})
    done = run(tmp_path, case)
    assert done.summary["outlines"]["read"] == len(got) and done.warnings == []


# ---- what is refused

UTM = [r + [500000, 8900000] for r in RINGS]
POINT = {"type": "Point", "coordinates": [10, 80]}
BAD = {
    "no such file": (lambda p: p / "none.shp", (), "no such file"),
    "nothing in it": (lambda p: write(p / "map.geojson", []), (), "holds no features"),
    "points": (lambda p: write(p / "map.geojson", [POINT, POINT]), (), "holds no polygons (2 of its features"),
    "no map": (lambda p: text(p / "map.gpkg", "hello"), (), "not a map that GDAL can read"),
    "a word for a number": (lambda p: text(p / "map.geojson", json.dumps({"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [
            [[-50, 60], ["a", 60], [-50, 61], [-50, 60]]]}}]})), (), "; correct the file"),
    "degrees as metres": (lambda p: write(p / "map.geojson", [places(r) for r in RINGS], "EPSG:32633"), (),
                          "as degrees do"),
    "degrees as local": (lambda p: write(p / "map.geojson", [places(r) for r in RINGS],
                                         "urn:x-bergtow:crs:local-metres-east-north"), (), "degrees look in metres"),
    "metres as degrees": (lambda p: write(p / "map.geojson", UTM), (), "look like metres"),
    "latitude first": (lambda p: write(p / "map.geojson", [places(r, 140.0)[:, ::-1] for r in RINGS]), (),
                       "latitude seems to come first"),
    "the equator": (lambda p: write(p / "map.geojson", [places(r, 80.0, 14.0) for r in RINGS]), (), "no sea ice"),
    "guessed crs": (lambda p: write(p / "map.geojson", UTM, "foo"), (), "is not the name of a system"),
    "said badly": (lambda p: write(p / "map.geojson", UTM), ("--crs", "WGS"), "is not the name of a system"),
    "unknown crs": (lambda p: write(p / "map.geojson", UTM, "EPSG:99999"), (), "unknown to PROJ"),
    "two crs": (lambda p: write(p / "map.geojson", UTM, "EPSG:32633"), ("--crs", "EPSG:3413"), "but --crs says"),
    "far": (lambda p: write(p / "map.geojson", [places(r) for r in RINGS]), ("--centre", "20,80"), "100 km"),
    "nothing left": (lambda p: write(p / "map.geojson", [places(r) for r in RINGS]), ("--least", "1e9"),
                     "leaves no floe"),
    "column": (lambda p: write(p / "map.geojson", [places(r) for r in RINGS]), ("--thickness", "hi"), "no column hi"),
    "where": (lambda p: write(p / "map.geojson", [places(r) for r in RINGS]), ("--where", "none = 2"), "--where"),
    "not finite": (lambda p: not_finite(p / "map.gpkg"), ("--crs", "local"), "not a finite number"),
    "a grid by GDAL's name": (lambda p: p / "NETCDF:map.nc:labels", (), "no such file"),
    "float labels": (lambda p: array(p / "map.npy", np.full((3, 3), 0.5)), ("--pixel", "1"), "not labels"),
    "only water": (lambda p: array(p / "map.npy", np.zeros((3, 3))), ("--pixel", "1"), "no label of ice"),
    "cube": (lambda p: array(p / "map.npy", np.ones((3, 3, 3))), ("--pixel", "1"), "one label a pixel"),
    "not for it": (lambda p: array(p / "map.npy", np.ones((3, 3))), ("--layer", "a"), "there is no --layer"),
}


def text(path, words):
    path.write_text(words)
    return path


def not_finite(path):
    file = gdal.GetDriverByName("GPKG").Create(str(path), 0, 0, 0, gdal.GDT_Unknown)
    layer = file.CreateLayer("floes", None, ogr.wkbPolygon)
    feature, ring, polygon = (ogr.Feature(layer.GetLayerDefn()), ogr.Geometry(ogr.wkbLinearRing),
                              ogr.Geometry(ogr.wkbPolygon))
    for x, y in ((0, 0), (10, 0), (np.nan, 10), (0, 0)):
        ring.AddPoint_2D(x, y)
    polygon.AddGeometry(ring)
    feature.SetGeometryDirectly(polygon)
    layer.CreateFeature(feature)
    return path


def array(path, values):
    np.save(path, values)
    return path


@pytest.mark.parametrize("name", BAD)
def test_bad_maps(tmp_path, name):
    """One line that names the file, the reason and the remedy; nothing written."""
    make, words, reason = BAD[name]
    map_ = make(tmp_path)
    said = outlines(map_, *words, code=IO, name="no.geojson")
    assert "\n" not in said and str(map_.name) in said and reason in said and "; " in said, said


@pytest.mark.parametrize("words, says", [
    (("--centre", "80"), "LON,LAT"), (("--box", "3"), "2km,800m"), (("--tolerance", "-1"), "above zero"),
    (("--crs",), "expected"), (("--water", "a"), "whole numbers"), (("--unseen", "x"), "whole numbers"),
    (("--footprint", "1,2,3,4"), "at least three"), (("--record", "a.txt"), ".json"),
    (("--picture", "a.gif"), ".png"), (("-o", "a.shp"), ".geojson"), (("-o", "map.geojson"), "different names")])
def test_usage(tmp_path, words, says, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "map.geojson", [places(RINGS[0])])
    with pytest.raises(BergtowError) as end:
        cli.perform("outlines", "map.geojson", *([] if "-o" in words else ["-o", "out.geojson"]), *words, "--force")
    assert end.value.status == USAGE and says in str(end.value)
    assert [p.name for p in tmp_path.iterdir()] == ["map.geojson"]


def test_exit_code_of_a_bad_map(tmp_path):
    write(tmp_path / "map.geojson", UTM)
    r = call("outlines", "map.geojson", "-o", "out.geojson", cwd=tmp_path)
    assert r.returncode == IO and r.stderr.count("\n") == 1 and "look like metres" in r.stderr


def test_a_missing_library_is_named(tmp_path):
    """In place of a traceback, with the packages to install."""
    (tmp_path / "shapely").mkdir()
    (tmp_path / "shapely/__init__.py").write_text("raise ImportError('No module named shapely')")
    write(tmp_path / "map.geojson", [places(RINGS[0])])
    r = call("outlines", "map.geojson", "-o", "out.geojson", cwd=tmp_path, env=environment(PYTHONPATH=tmp_path))
    assert r.returncode == IO and "apt-get install python3-gdal" in r.stderr and "Traceback" not in r.stderr


@pytest.mark.slow
def test_from_python(tmp_path):
    """The same file and numbers as the command's; what is not understood is its message."""
    import bergtow
    write(tmp_path / "map.geojson", [places(RINGS[0])])
    r = call("outlines", "map.geojson", "-o", "theirs.geojson", f"--centre={LON},{LAT}", "--record", "theirs.json",
             cwd=tmp_path)
    assert r.returncode == 0, r.stderr
    made = bergtow.outlines(tmp_path / "map.geojson", tmp_path / "ours.geojson", centre=(LON, LAT))
    assert made.file.read_text() == (tmp_path / "theirs.geojson").read_text()
    theirs = json.loads((tmp_path / "theirs.json").read_text())
    theirs["map"]["file"] = str(tmp_path / "map.geojson")
    assert made.record == theirs
    assert "in a case beside it" in made.text and "changes:" in made._repr_html_()
    assert made.picture()._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(bergtow.BergtowError, match="crs"):
        bergtow.outlines(tmp_path / "map.geojson", tmp_path / "ours.geojson", crs="EPSG:0", replace=True)


# ---- the page


@pytest.mark.slow
def test_the_how_to(tmp_path):
    """From a labelled mosaic to a run, word for word; what is synthetic says so to the end."""
    reader = tutorial.follow("../ice-from-an-image.md", tmp_path)
    out = reader.folder / "out"
    assert "SYNTHETIC" in json.loads((out / "floes.geojson").read_text())["description"]
    summary = json.loads((out / "mosaic-tow/summary.json").read_text())
    # which vertices stay differs between releases of GEOS, and with them the largest overlap and the last digit of a
    # concentration of some 70 %, from which on the width shows; ten minutes hold few stretches of contact
    assert {w["code"] for w in summary["warnings"]} <= {"overlap", "narrow_domain", "too_short"}, summary["warnings"]
    assert summary["max_overlap_relative"] < 0.02 and 0.65 < summary["concentration"] < 0.72  # of parts in the region
    assert "SYNTHETIC" in summary["title"] and summary["n_floes"] > 200
    assert (out / "floes.png").exists() and (out / "mosaic-tow/field.png").exists()
