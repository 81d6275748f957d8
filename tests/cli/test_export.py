# SPDX-License-Identifier: MIT
"""bergtow export: floes, tracks, loads and trajectories of a run on the map.

Places are held against geodesics (pyproj.Geod), which the command does not use; files are read by json, by GDAL, by
xarray and by the program's own reader of outlines.
"""
import csv
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
import xarray
from osgeo import ogr
from pyproj import CRS, Geod

from harness import CASE as REFUSED, DONE, IO, TOW as BASIN, USAGE, area, call, changed, run
from made_up_ensemble import edited
from test_map import ARROW, BOX, LOCAL, ORIGIN, write
from test_outlines import field, same_ring

import bergtow  # noqa: E402
from bergtow.maps import export  # noqa: E402
from bergtow.reporting import replay  # noqa: E402
from bergtow.result.run import Run  # noqa: E402

ogr.UseExceptions()
GEOD = Geod(ellps="WGS84")
LON, LAT = 20.0, 76.5
#: a disc that is towed north into an arrow and turns it; another floe to the east, which stays
TOW = {"run": {"dt": 0.5, "duration": 30}, "ice": {"outlines": "map.geojson", "thickness": 1, "nonconvex": "split"},
       "domain": {"frame": "geographic", "length": 200, "width": 160, "ends": "open", "sides": "open"},
       "body": {"shape": "disc", "length": 10, "draft": 5, "y": -2},
       "tow": {"mode": "line", "speed": 1, "direction": 0, "ramp": 1, "line_length": 30, "line_stiffness": 1e6,
               "line_damping": 1e4}, "output": {"frame_interval": 5}}


def rings(north, east=0.0):
    return [[[x + e + east, y + n + north] for x, y in ring] for ring, e, n in ((ARROW, 0, 14), (BOX, 0, 0))]


def towed(folder, crs=LOCAL, zero=(0, 0), case=TOW, **more):
    """A run from a map in metres; its folder."""
    frame = changed(case, **more)["domain"]["frame"]
    write(folder, *[ring if frame == "geographic" else [p[::-1] for p in ring[::-1]]
                    for ring in rings(zero[1], zero[0])], crs={"type": "name", "properties": {"name": crs}})
    return run(folder, changed(case, **more)).dir


def degrees(folder):
    """A run from a map in degrees: metres along geodesics."""
    def at(x, y):
        return GEOD.fwd(LON, LAT, math.degrees(math.atan2(x, y)), math.hypot(x, y))[:2]
    write(folder, *[[at(*p) for p in ring] for ring in rings(0)])
    return run(folder, changed(TOW, **ORIGIN)).dir


def outlines_of(path):
    with Run(path) as r:
        return [np.array(p) for p in r.polygons(-1)], r.pose(0), r.pose(-1)


PLACES = {"degrees": degrees, "local": towed,
          "utm": lambda f: towed(f, "EPSG:32633", (560e3, 8490e3), ice__origin_east=560e3, ice__origin_north=8490e3),
          "basin": lambda f: towed(f, domain__frame="basin", domain__x0=-100, body__y=-2, body__x=0)}


@pytest.mark.parametrize("place", PLACES)
def test_exported_floes_come_back_as_ice_outlines(tmp_path, place):
    """After a tow that has turned a floe. Red: x and y swapped, rings clockwise, a frame or an origin that is lost."""
    there = PLACES[place](tmp_path)
    after, first, last = outlines_of(there)
    assert abs(last - first)[0, 2] > 0.01 and abs(last - first)[0, :2].max() > 1  # it is another field than the first
    done = call("export", there, "-o", tmp_path / "map.geojson", "--force")
    assert done.returncode == DONE, done.stderr
    case = json.loads((tmp_path / "case.yml").read_text())
    back, thickness, areas, _ = field(tmp_path, changed(case, body={"shape": "none"}, tow={"mode": "none"},
                                                        ice__thickness=2))
    assert thickness.tolist() == [1, 1]
    for ours, theirs, size in zip(after, back, areas):
        assert same_ring(ours, theirs, 2e-8 if place == "utm" else 1e-8)  # of 8,490 km in double precision
        assert area(theirs) == pytest.approx(area(ours), rel=1e-9)
        assert size == pytest.approx(area(ours), rel=1e-9)


@pytest.mark.parametrize("crs", [LOCAL, "EPSG:32633"])
def test_a_field_file_keeps_the_place_of_its_map(tmp_path, crs):
    """In the summary and on the map. Red: local metres count from x = y = 0, a summary that has no place."""
    first = towed(tmp_path, crs, (560e3, 8490e3), ice__origin_east=560e3, ice__origin_north=8490e3)
    assert call("field", tmp_path / "case.yml", "-o", tmp_path / "f.h5").returncode == DONE
    again = run(tmp_path, changed(TOW, ice={"field": "f.h5", "nonconvex": "split"}), name="again").dir
    places = []
    for there in first, again:
        assert call("export", there, "-o", there / "map.geojson").returncode == DONE
        said = json.loads((there / "summary.json").read_text())["outlines"]
        places.append([{k: v for k, v in said.items() if k == "crs" or "origin" in k},
                       json.loads((there / "map.geojson").read_text())])
    assert places[0] == places[1] and places[0][0]["origin_north_m"] == 8490e3


def test_degrees_are_those_of_geodesics(tmp_path):
    """Distance and direction of each vertex from the origin, as its x and y say them; anticlockwise [RFC 7946], and no
    crs. Red: longitude of north, a sphere."""
    there = degrees(tmp_path)
    bergtow.export(there, tmp_path / "after.geojson", time=30)
    root = json.loads((tmp_path / "after.geojson").read_text())
    assert "crs" not in root
    for feature, outline in zip(root["features"], outlines_of(there)[0]):
        ring = np.array(feature["geometry"]["coordinates"][0])
        assert (ring[0] == ring[-1]).all() and area(ring) > 0
        azimuth, _, distance = GEOD.inv(*np.broadcast_to([[LON], [LAT]], (2, len(ring))), *ring.T)
        found = np.column_stack([distance * np.cos(np.radians(azimuth)), distance * np.sin(np.radians(azimuth))])
        assert same_ring(found[:-1][::-1], outline, 1e-6)
    assert [f["properties"]["id"] for f in root["features"]] == [0, 1]
    assert root["features"][0]["properties"]["time_s"] == 30
    assert root["features"][0]["properties"]["speed_m_s"] > 0.1 > root["features"][1]["properties"]["speed_m_s"] == 0


def test_a_geopackage_has_layers_in_the_crs_of_the_map(tmp_path):
    """Floes, the iceberg where the tow left it, tracks from start to end, loads of every sample. Red: a crs that is
    lost, tracks of wrapped or swapped positions."""
    there = PLACES["utm"](tmp_path)
    bergtow.export(there, tmp_path / "after.gpkg")
    file = ogr.Open(str(tmp_path / "after.gpkg"))
    layers = {file.GetLayer(k).GetName(): file.GetLayer(k) for k in range(file.GetLayerCount())}
    assert list(layers) == ["floes", "bodies", "tracks", "loads"]
    assert {layer.GetSpatialRef().GetAuthorityCode(None) for layer in layers.values()} == {"32633"}
    with Run(there) as r:
        x, y, time, force = r["body_x"], r["body_y"], r["time"], r["tow_force"]
        carriage = np.array([r["carriage_y"][-1], r["carriage_x"][-1]])
        assert [f.GetField("area_m2") for f in layers["floes"]] == pytest.approx(r.area)
        assert [f.GetGeometryRef().Area() for f in layers["floes"]] == pytest.approx(r.area, rel=1e-6)
        hull = sum(area(p) for p in r.body_polygons(-1))
    body, = layers["bodies"]
    assert body.GetGeometryRef().Area() == pytest.approx(hull, rel=1e-6)
    middle = body.GetGeometryRef().Centroid()
    assert (middle.GetX(), middle.GetY()) == pytest.approx((560e3 + y[-1], 8490e3 + x[-1]), abs=1e-6)
    tracks = {f.GetField("name"): f for f in layers["tracks"]}
    assert list(tracks) == ["iceberg", "towing end"]
    way = np.array(tracks["iceberg"].GetGeometryRef().GetPoints())[:, :2] - (560e3, 8490e3)
    np.testing.assert_allclose(way, np.column_stack([y, x]), atol=1e-6)
    end = np.array(tracks["towing end"].GetGeometryRef().GetPoints())[-1, :2] - (560e3, 8490e3)
    np.testing.assert_allclose(end, carriage, atol=1e-6)
    assert tracks["iceberg"].GetField("length_m") == pytest.approx(np.hypot(np.diff(x), np.diff(y)).sum())
    loads = list(layers["loads"])
    assert [f.GetField("time_s") for f in loads] == pytest.approx(time)
    assert [f.GetField("tow_force") for f in loads] == pytest.approx(force)
    assert loads[-1].GetGeometryRef().GetY() == pytest.approx(8490e3 + x[-1], abs=1e-6)
    again = call("outlines", tmp_path / "after.gpkg", "--layer", "floes", "-o", tmp_path / "again.geojson")
    assert again.returncode == DONE, again.stderr


def test_layers_of_the_series_need_no_frames(tmp_path):
    """Members of ensembles have none. The same features as with frames. Red: "holds no frames"."""
    whole, bare = (towed(tmp_path / str(interval), output__frame_interval=interval) for interval in (5, -1))
    for layer, features in ("tracks", 2), ("loads", 60):
        texts = []
        for there in whole, bare:
            bergtow.export(there, tmp_path / "map.geojson", layer=layer, replace=True)
            texts.append((tmp_path / "map.geojson").read_text())
        assert texts[0] == texts[1] and len(json.loads(texts[1])["features"]) == features
    for words in ("--layer", "floes"), ("--layer", "loads", "--time", "10"):
        done = call("export", bare, "-o", tmp_path / "none.geojson", *words)
        assert done.returncode == IO and "holds no frames" in done.stderr


def test_a_run_without_a_body_has_no_loads(tmp_path):
    """Its position is in the file, but not a number. Red: a traceback from JSON; points without coordinates."""
    there = run(tmp_path, changed(BASIN, body={"shape": "none"}, tow=None, run__duration=2)).dir
    with Run(there) as r:
        assert "body_x" in r and not np.isfinite(r["body_x"]).any()
    for name in "none.geojson", "none.gpkg":
        done = call("export", there, "-o", tmp_path / name, "--layer", "loads")
        assert done.returncode == IO and "has no loads" in done.stderr and not (tmp_path / name).exists()


def test_time_zero_is_the_first_frame(tmp_path):
    """Red: the last one."""
    there, placed = towed(tmp_path), []
    for time in (0, 30):
        bergtow.export(there, tmp_path / "map.geojson", layer="bodies", time=time, replace=True)
        placed.append(json.loads((tmp_path / "map.geojson").read_text())["features"][0]["geometry"])
    assert placed[0] != placed[1]


def test_a_shapefile_says_what_it_renamed_and_spares_files_of_others(tmp_path):
    there = towed(tmp_path)
    done = call("export", there, "-o", tmp_path / "loads.shp", "--layer", "loads")
    assert done.returncode == DONE and "ice_resistance is ice_resist" in done.stdout, done.stderr
    assert ogr.Open(str(tmp_path / "loads.shp")).GetLayer(0).GetFeatureCount() == 60
    assert call("export", there, "-o", tmp_path / "loads.shp").returncode == DONE  # our own is replaced
    assert ogr.Open(str(tmp_path / "loads.shp")).GetLayer(0).GetFeatureCount() == 2
    for name in ("loads.dbf", "other.dbf", "lone.shp"):
        (tmp_path / name).write_bytes(b"theirs")
        done = call("export", there, "-o", (tmp_path / name).with_suffix(".shp"))
        assert done.returncode == IO and (tmp_path / name).read_bytes() == b"theirs"
    assert not (tmp_path / "other.shp").exists()
    assert call("export", there, "-o", tmp_path / "other.shp", "--force").returncode == DONE


def absent(there, floe, frame):
    """A floe that a frame does not have: it has been broken, or is not born yet."""
    with edited(there / "result.h5") as f:
        f["frames/pose"][frame, floe] = np.nan


def test_trajectories_are_those_of_the_frames(tmp_path):
    """Decoded by xarray, as OpenDrift's TrajAn and R's readers take them: one trajectory a row, marked by cf_role.
    Red: a trajectory of another floe, a time that is not decoded, a place where a floe is not."""
    there = degrees(tmp_path)
    absent(there, 1, 3)
    bergtow.export(there, tmp_path / "drift.nc", start="2027-03-01T06:00Z")
    bergtow.export(there, tmp_path / "drift.csv")
    with xarray.open_dataset(tmp_path / "drift.nc") as d:
        assert (d.attrs["Conventions"], d.attrs["featureType"]) == ("CF-1.8", "trajectory")
        role, = [v for v in d.variables.values() if v.attrs.get("cf_role") == "trajectory_id"]
        assert role.dims == ("trajectory",)
        names = [n.decode() for n in role.values]
        assert names == ["floe 0", "floe 1", "iceberg", "towing end"]
        assert d.lon.dims == d.lat.dims == d.speed.dims == ("trajectory", "time")
        assert [d[v].attrs["standard_name"] for v in ("lon", "lat", "time", "thickness")] == [
            "longitude", "latitude", "time", "sea_ice_thickness"]
        assert [d[v].attrs["units"] for v in ("lon", "lat", "speed", "thickness")] == [
            "degrees_east", "degrees_north", "m s-1", "m"]
        assert "comment" not in d.time.attrs
        datum = CRS.from_cf(d[d.speed.attrs["grid_mapping"]].attrs).ellipsoid
        assert (datum.semi_major_metre, datum.inverse_flattening) == (6378137.0, 298.257223563)
        assert str(d.time.values[-1]).startswith("2027-03-01T06:00:30")
        with Run(there) as r:
            x = np.stack([r.pose(k) for k in range(r.n_frames)])[:, :, :2]
            berg, speed = np.stack([r.body_pose(k)[r.towed, :2] for k in range(r.n_frames)]), r.speed(2)
            ends = r["carriage_x"][-1], r["carriage_y"][-1]
        assert np.isnan(d.lon.values[1, 3]) and np.isfinite(d.lon.values[0]).all()
        np.testing.assert_allclose(d.speed.values[:2, 2], speed)
        for row, way in ((0, x[:, 0]), (2, berg)):
            azimuth, _, distance = GEOD.inv(*np.broadcast_to([[LON], [LAT]], (2, len(way))), d.lon[row], d.lat[row])
            np.testing.assert_allclose(distance * np.cos(np.radians(azimuth)), way[:, 0], atol=1e-6)
            np.testing.assert_allclose(distance * np.sin(np.radians(azimuth)), way[:, 1], atol=1e-6)
        assert GEOD.inv(LON, LAT, d.lon[3, -1], d.lat[3, -1])[2] == pytest.approx(math.hypot(*ends), abs=1e-6)
        with open(tmp_path / "drift.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        assert len(rows) == np.isfinite(d.lon.values).sum()
        for row in rows:
            k, t = names.index(row["name"]), round(float(row["time_s"]) / 5)
            assert (float(row["longitude"]), float(row["latitude"])) == (d.lon.values[k, t], d.lat.values[k, t])
    floes = tmp_path / "floes.geojson"
    bergtow.export(there, floes, time="all")
    at = [(f["properties"]["id"], f["properties"]["time_s"]) for f in json.loads(floes.read_text())["features"]]
    assert len(at) == 2 * 7 - 1 and (1, 15) not in at and (0, 15) in at


def test_floes_that_split_have_trajectories(tmp_path):
    """A piece has one while it is there, and the iceberg its speed beside the pieces. Red: pieces counted among the
    floes before the bodies, and "the file is damaged"."""
    there = run(tmp_path, changed(BASIN, ice__splitting={"toughness": 100, "least_size": 0.1},
                                  output__frame_interval=2)).dir
    bergtow.export(there, tmp_path / "drift.csv")
    bergtow.export(there, tmp_path / "last.gpkg")
    with open(tmp_path / "drift.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    with Run(there) as r:
        assert r.n_pieces > 0
        pose = np.stack([r.pose(k) for k in range(r.n_frames)])
        body = r.body_speed(-1)[r.towed]
        assert body == pytest.approx(math.hypot(r["body_vx"][-1], r["body_vy"][-1]))
        assert ogr.Open(str(tmp_path / "last.gpkg")).GetLayer("floes").GetFeatureCount() == np.isfinite(
            pose[-1, :, 0]).sum()
        floes = [row for row in rows if row["name"].startswith("floe")]
        assert len(floes) == np.isfinite(pose[:, :, 0]).sum()
        for row in floes:
            k, i = r.frame_at(float(row["time_s"])), r.ids.tolist().index(int(row["name"].split()[1]))
            assert (float(row["x_m"]), float(row["y_m"])) == tuple(pose[k, i, :2])
    assert [float(row["speed_m_s"]) for row in rows if row["name"] == "iceberg"][-1] == body


def test_fixed_floes_are_told_and_do_not_come_back_adrift(tmp_path):
    """Red: nothing tells a pier from a floe, and ice.outlines lets it drift off."""
    pier = {"shape": "square", "length": 4, "x": 40, "y": 40, "thickness": 1}
    there = towed(tmp_path, floes=[pier | {"fixed": True}, pier | {"y": -40}])
    with Run(there) as r:
        still = [i for i in range(r.n_floes) if np.array_equal(r.pose(0)[i, :2], (40, 40))]
        assert np.flatnonzero(r.fixed).tolist() == still and len(still) == 1
    bergtow.export(there, tmp_path / "map.geojson", replace=True)
    bergtow.export(there, tmp_path / "after.gpkg")
    found = {f["properties"]["id"]: f["properties"]["fixed"] for f in
             json.loads((tmp_path / "map.geojson").read_text())["features"]}
    assert [i for i, fixed in found.items() if fixed is True] == still and set(found.values()) == {True, False}
    file = ogr.Open(str(tmp_path / "after.gpkg"))
    assert {f.GetField("id"): f.GetField("fixed") for f in file.GetLayer("floes")} == found
    done = call("check", tmp_path / "case.yml", cwd=tmp_path)
    assert done.returncode == REFUSED and "has the property `fixed`: true" in done.stderr
    with edited(there / "result.h5") as f:
        del f["floes/fixed"]  # as version 0.1.0 left it
    bergtow.export(there, tmp_path / "old.geojson")
    assert "fixed" not in json.loads((tmp_path / "old.geojson").read_text())["features"][0]["properties"]


def test_rafted_floes_do_not_come_back_before_they_are_cut(tmp_path):
    """The export and the refusal name the command that does it. Red: neither; "move or shrink one of them" of hundreds
    of pairs."""
    pressed = changed(BASIN, domain={"length": 15, "width": 8, "ends_closing": 0.15}, ice__concentration=0.75,
                      ice__rafting={"kappa": 5}, run__duration=15)
    for case, rafts in (pressed, True), (BASIN, False):
        there = run(tmp_path, changed(case, body={"shape": "none"}, tow={"mode": "none"}), name=str(rafts)).dir
        done = call("export", there, "-o", tmp_path / f"{rafts}.geojson")
        assert done.returncode == DONE and ("bergtow outlines" in done.stdout) == rafts
    cut = call("outlines", tmp_path / "True.geojson", "-o", tmp_path / "cut.geojson", "--centre", "0,0")
    assert cut.returncode == DONE
    codes = {}
    for name in "True", "cut":
        case = changed(BASIN, ice={"outlines": f"{name}.geojson", "nonconvex": "split"}, body={"shape": "none"},
                       domain={"length": 30, "width": 20, "ends": "open", "sides": "open"}, tow={"mode": "none"})
        (tmp_path / "case.yml").write_text(json.dumps(case))
        done = call("check", tmp_path / "case.yml")
        codes[name] = done.returncode
        assert ("bergtow outlines" in done.stderr) == (name == "True"), done.stderr
    assert codes == {"True": REFUSED, "cut": DONE}


@pytest.mark.parametrize("mode, name", [("line", "towing end"), ("thrust", "vessel")])
def test_the_towing_end_is_that_of_the_frames(tmp_path, mode, name):
    """However few samples there are, and none of it between them once the line has parted. Red: interpolated, metres
    off, and missing before the first sample."""
    more = {"tow__vessel": {"mass": 1e5, "bollard_pull": 1e5, "free_speed": 3}} if mode == "thrust" else {}
    there = towed(tmp_path, tow__mode=mode, tow__ramp=10, output__sample_every=21, output__frame_interval=2.5,
                  domain__sides="periodic", **more)
    bergtow.export(there, tmp_path / "drift.csv")

    def way():
        with open(tmp_path / "drift.csv", newline="") as file:
            return {float(r["time_s"]): (float(r["north_m"]), float(r["east_m"])) for r in csv.DictReader(file)
                    if r["name"] == name}
    with Run(there) as r:
        ends = [r._file["frames/line_points"][k, 1] for k in range(r.n_frames)]
        assert list(way()) == r.frame_times.tolist() and r["time"][0] > 10
        np.testing.assert_allclose(list(way().values()), ends, rtol=0, atol=1e-9)
    with edited(there / "result.h5") as f:
        f["frames/line_points"][:, 1] = f["frames/line_points"][:, 0]
        same = sorted(set(f["frames/time"][:]) & set(f["series/time"][:]))
        f["series/time"][0] = f["frames/time"][3]
    bergtow.export(there, tmp_path / "drift.csv", replace=True)
    assert same == [30] and list(way()) == [7.5, 30]


def test_metres_of_a_projection_have_degrees_beside_them(tmp_path):
    """PROJ's forward projection of the degrees in the file gives the metres in it. Red: a grid mapping without
    parameters, latitude first."""
    import pyproj
    there = PLACES["utm"](tmp_path)
    bergtow.export(there, tmp_path / "drift.nc")
    with xarray.open_dataset(tmp_path / "drift.nc", decode_coords="all") as d:
        assert pyproj.CRS.from_cf(d.crs.attrs).to_epsg() == 32633 and d.speed.encoding["grid_mapping"] == "crs"
        there = np.isfinite(d.lon.values)
        assert there.all()
        back = pyproj.Proj("EPSG:32633")(d.lon.values[there], d.lat.values[there])
        np.testing.assert_allclose(back, [d.x.values[there], d.y.values[there]], rtol=0, atol=1e-6)
        assert d.time.attrs["comment"].startswith("assumed") and d.time.values[0] == np.datetime64("1970-01-01")


def test_rings_over_the_180th_meridian_are_closed():
    """To the last bit, as GDAL asks: its longitudes are unwrapped in floating point."""
    rng = np.random.default_rng(3)
    for _ in range(200):
        lon = np.remainder(180 + 180 + rng.normal(0, 1e-3, 7), 360) - 180
        ring = np.column_stack([lon, -65 + rng.normal(0, 1e-3, 7)])
        place = SimpleNamespace(degrees=True, ring=lambda at: np.concatenate([at, at[:1]]))
        polygon = export._geometry(ogr, "Polygon", ogr.wkbPolygon, place, ring)
        line = polygon.GetGeometryRef(0)  # of the polygon, which must outlive it
        assert line.GetPoint(0) == line.GetPoint(7) and np.ptp([p[0] for p in line.GetPoints()]) < 0.1


def test_ice_that_a_moving_window_renews_is_another_trajectory():
    """A jump by more than half a period begins one; a slow floe and one that is absent do not. Red: a line across the
    whole window."""
    x = np.array([[0.0, 2, 4, 6], [0, 60, 62, 140], [0, np.nan, 3, 4]])
    piece = export._pieces(np.stack([x, 0 * x], axis=2), np.array([100.0, 0]))
    assert piece.tolist() == [[0, 0, 0, 0], [0, 1, 1, 2], [0, 0, 0, 0]]


def test_ice_that_a_moving_window_moves_within_the_front_is_another_trajectory():
    """A floe that waited for its place is put there over less than half a period; its speed tells. Red: a trajectory of
    1.3 m/s where the floe drifts with 0.2 m/s."""
    x, speed = np.array([[0.0, 4, 8, 34, 38], [0, 4, 13, 20, 20.5]]), np.array([[0.2] * 5, [0.2, 0.2, 0.5, 0.1, 0.0]])
    def pieces(low):
        scene = SimpleNamespace(window_low=lambda frames: low, frame_times=20.0 * np.arange(5),
                                area=np.array([400.0, 4]))
        reach = export._reach(scene, np.arange(5), speed)
        return export._pieces(np.stack([x, 0 * x], axis=2), np.array([100.0, 0]), reach).tolist()
    assert pieces(0.0) == [[0, 0, 0, 1, 1], [0] * 5] and pieces(None) == [[0] * 5] * 2


@pytest.mark.parametrize("direction", [0, 180])
def test_ice_lies_where_the_moving_window_is(tmp_path, direction):
    """Between its ends, which follow the iceberg in strides. Red: ends at a fixed distance from the iceberg, so floes
    of the wake ahead of it, and trajectories with steps that the floes' speeds do not allow."""
    case = {"run": {"dt": 0.5, "duration": 120}, "domain": {"frame": "geographic", "length": 60, "width": 30,
            "ends": "moving", "sides": "periodic", "ahead": 33}, "ice": {"concentration": 0.7, "size": 3,
            "thickness": 0.3}, "body": {"shape": "disc", "length": 6, "draft": 2}, "water": {"current_y": 0.2},
            "tow": {"mode": "speed", "speed": 1, "direction": f"{direction} deg"}, "output": {"frame_interval": 5}}
    with Run(run(tmp_path, case).dir) as r:
        frames = np.arange(r.n_frames)
        t, low = export.trajectories(r, frames), np.append(
            -33 if direction else -27, r["window_x"][np.searchsorted(r["time"], r.frame_times[1:] * (1 - 1e-9))])
        np.testing.assert_allclose(r.window_low(frames), low, atol=1e-9)
        np.testing.assert_allclose(replay.Replay(r).head["window_low"], low, atol=1e-9)
        floes = np.array([name.startswith("floe") for name in t.name])
        x, speed = t.xy[floes, :, 0], np.fmax(t.speed[floes, 1:], t.speed[floes, :-1])
        assert np.nanmin(x - low) >= 0 and np.nanmax(x - low) <= 60 and floes.sum() > 1.5 * r.n_floes
        step = np.hypot(*np.diff(t.xy[floes], axis=1).T).T
        assert np.nanmax(step - 2 * 5 * speed) < 0.3
        places = np.array([np.mean(ring, axis=0) for ring in export.floes_layer(r, [r.n_frames - 1]).places])
        assert (places[:, 0] > low[-1] - 0.5).all() and (places[:, 0] < low[-1] + 60.5).all()


def test_ice_around_the_iceberg_is_exported_from_a_periodic_domain(tmp_path):
    """Where it is, and the window as far ahead of it as it keeps, or a stride less. Red: wrapped into the domain of the
    first step."""
    case = {"run": {"dt": 0.5, "duration": 60}, "domain": {"frame": "geographic", "length": 60, "width": 30,
            "ends": "moving", "sides": "periodic"}, "ice": {"concentration": 0.3, "size": 3, "thickness": 0.3},
            "body": {"shape": "disc", "length": 4, "draft": 2}, "tow": {"mode": "speed", "speed": 1},
            "output": {"frame_interval": 10}}
    there = run(tmp_path, case).dir
    bergtow.export(there, tmp_path / "after.geojson")
    bergtow.export(there, tmp_path / "berg.geojson", layer="bodies")
    with Run(there) as r:
        berg, ahead = np.array([r["body_y"][-1], r["body_x"][-1]]), r.number("moving_window.ahead_m")
    body, = json.loads((tmp_path / "berg.geojson").read_text())["features"]
    hull = np.array(body["geometry"]["coordinates"][0][:-1])
    assert berg[1] > 50 and (hull.min(axis=0) + hull.max(axis=0)) / 2 == pytest.approx(berg, abs=0.05)
    east, north = np.array([np.mean(f["geometry"]["coordinates"][0][:-1], axis=0) - berg for f in json.loads(
        (tmp_path / "after.geojson").read_text())["features"]]).T
    assert abs(east).max() < 17
    assert ahead - 3 - 3.75 < north.max() < ahead + 1 and ahead - 61 - 3.75 < north.min() < ahead - 57


@pytest.mark.parametrize("words, code, said", [
    (("-o", "x.gpkg", "--time", "31"), USAGE, "outside the frames, 0 to 30 s"),
    (("-o", "x.kml"), USAGE, "unknown kind of file"), (("-o", "x.nc", "--layer", "floes"), USAGE, "trajectories"),
    (("-o", "x.csv", "--start", "2027-03-01"), USAGE, "no dates"),
    (("-o", "x.nc", "--start", "soon"), USAGE, "not a date"),
    (("-o", "theirs.geojson"), IO, "not made by bergtow"), (("-o", "x.geojson", "--time", "nan"), USAGE, "nan")])
def test_wrong_use(towed_once, words, code, said):
    done = call("export", "out", *words, cwd=towed_once)
    assert done.returncode == code and said in done.stderr
    assert not list(towed_once.glob("x.*")) and (towed_once / "theirs.geojson").read_text() == "theirs"


@pytest.fixture(scope="module")
def towed_once(tmp_path_factory):
    folder = tmp_path_factory.mktemp("once")
    towed(folder)
    (folder / "theirs.geojson").write_text("theirs")
    return folder
