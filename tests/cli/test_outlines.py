# SPDX-License-Identifier: MIT
"""Floe outlines in GeoJSON: what gets in, what is refused and by which name, where it lies, and that a round trip loses
nothing."""
import json
import math

import h5py
import numpy as np
import pytest

from harness import CASE, DONE, IO, TOW, area, call, changed, placed, run, texts, write_case

BASE = {
    "run": {"dt": 0.1, "duration": 2},
    "domain": {"length": 20, "width": 10},
    "ice": {"outlines": "floes.geojson", "outlines_crs": "plane", "thickness": 0.25},
    "body": {"x": 2, "length": 2},
}
SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
C_SHAPE = [[0, 0], [2, 0], [2, 0.5], [0.5, 0.5], [0.5, 1.5], [2, 1.5], [2, 2], [0, 2]]  # area 2.5, of its hull 4
BOW = [[0, 0], [2, 2], [2, 0], [0, 1.5]]


def at(ring, x, y):
    return [[p[0] + x, p[1] + y] for p in ring]


def feature(ring, close=True, **more):
    ring = ring + ring[:1] if close else ring
    return {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}} | more


def write(folder, *features, **more):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "floes.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": list(features)} | more))


def read(path):
    with h5py.File(path) as f:
        g = f["floes"]
        o, v, pose, h, a = (g[n][:] for n in ("offsets", "vertices", "pose", "thickness", "area"))
    return [placed(v[o[i]:o[i + 1]], p) for i, p in enumerate(pose)], h, a, pose


def field(folder, case, *arguments, code=DONE, name="out.h5"):
    r = call("field", write_case(folder, case), "-o", folder / name, *arguments)
    assert r.returncode == code, r.stderr
    return read(folder / name) if code == DONE and name.endswith("h5") else r.stderr


def same_ring(p, q, tolerance):
    """Equal up to the vertex that a ring begins with."""
    p, q = np.array(p), np.array(q)
    return len(p) == len(q) and any(np.abs(np.roll(q, k, axis=0) - p).max() <= tolerance for k in range(len(p)))


def test_outlines_as_they_come(tmp_path):
    """Closed or not, clockwise, with double and needless vertices and heights; ids and thicknesses; all where they were
    drawn."""
    untidy = [[5, 3], [6, 3], [6, 3], [6, 3.4], [6, 4], [5, 4]]
    write(
        tmp_path, feature(at(SQUARE, 5, 0), properties={"thickness": 0.7}), feature(at(SQUARE, 8, 0)[::-1]),
        feature(untidy, close=False), feature([p + [12.5] for p in at(SQUARE, 8, 3)], properties=None),
        feature([at(SQUARE, 11, 0) + at(SQUARE, 11, 0)[:1]],
                close=False,
                geometry={"type": "MultiPolygon", "coordinates": [[at(SQUARE, 11, 0)]]}))
    rings, thickness, areas, _ = field(tmp_path, BASE)
    for ring, (x, y) in zip(rings, [(5, 0), (8, 0), (5, 3), (8, 3), (11, 0)]):
        assert same_ring(ring, at(SQUARE, x, y), 1e-12)
        assert area(ring) > 0
    assert thickness.tolist() == [0.7, 0.25, 0.25, 0.25, 0.25]
    np.testing.assert_allclose(areas, 1, rtol=1e-13)
    r = run(tmp_path, BASE)
    o = r.summary["outlines"]
    assert (o["read"], o["turned"], o["dropped_vertices"], o["hulled"], o["split"]) == (5, 1, 2, 0, 0)
    assert r.summary["n_floes"] == 5
    np.testing.assert_allclose(r.summary["concentration"], 5 / (200 - math.pi), rtol=1e-3)


OPEN = {"domain__sides": "open"}
REFUSED = {
    # the second feature's ring, or the whole feature -> what the message must say; changes of the case
    "not convex": (at(C_SHAPE, 8, 0), "not convex.*ice.nonconvex", {}),
    "edges cross": (at(BOW, 8, 0), "cross", {}),
    "edges cross, as hull": (at(BOW, 8, 0), "cross", {"ice__nonconvex": "hull"}),
    "edges touch": ([[8, 0], [10, 0], [10, 2], [9, 0], [8, 2]], "touch", {"ice__nonconvex": "split"}),
    "two vertices": ([[8, 0], [9, 0]], "fewer than 3", {}),
    "on one line": ([[8, 0], [9, 0], [10, 0]], "fewer than 3|area is zero|cross", {}),
    "too many": ([[9 + math.cos(2 * math.pi * k / 129),
                   math.sin(2 * math.pi * k / 129)] for k in range(129)], "more than 128 vertices", {}),
    "no numbers": ([[8, 0], [9, "x"], [9, 1]], "pair of numbers", {}),
    "hole": ({"geometry": {"type": "Polygon", "coordinates": [at(SQUARE, 8, 0), at(SQUARE, 8.2, 0.2)]}}, "holes", {}),
    "line": ({"geometry": {"type": "LineString", "coordinates": SQUARE}}, "not a Polygon", {}),
    "nothing": ({"geometry": None}, "not a Polygon", {}),
    "several": ({"geometry": {"type": "MultiPolygon", "coordinates": [[at(SQUARE, 8, 0)],
                                                                      [at(SQUARE, 8, 2)]]}}, "several polygons", {}),
    "thickness": (feature(at(SQUARE, 8, 0), properties={"thickness": -1}), "thickness", {}),
    "thickness with unit": (feature(at(SQUARE, 8, 0), properties={"thickness": "1 m"}),
                            "thickness is a text, .1 m.; write", {}),
    "through a wall": (at(SQUARE, 8, 4.5), "outside the domain", {}),
    "beyond an open side": (at(SQUARE, 8, 5.1), "outside the domain", OPEN),
    "in the body": (at(SQUARE, 2, 0), "towed body", {}),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_by_its_number(tmp_path, name):
    """Feature 1 of three is at fault, and is named; nothing is written."""
    ring, says, changes = REFUSED[name]
    second = feature(ring, id="floe B") if isinstance(ring, list) else feature(SQUARE) | {"id": "floe B"} | ring
    write(tmp_path, feature(at(SQUARE, 5, 0)), second, feature(at(SQUARE, 14, 0)))
    said = field(tmp_path, changed(BASE, **changes), code=CASE)
    assert len(said.splitlines()) == 1, said
    assert "floes.geojson: feature 1" in said
    assert __import__("re").search(says, said), said
    if says not in ("towed body", "outside the domain"):
        assert "(id floe B)" in said
    assert not (tmp_path / "out.h5").exists()
    assert call("check", tmp_path / "case.yml").returncode == CASE


def test_beyond_an_open_side_by_less_than_half_gets_in(tmp_path):
    write(tmp_path, feature(at(SQUARE, 8, 4.4)))
    assert "outside" in field(tmp_path, BASE, code=CASE)
    field(tmp_path, changed(BASE, **OPEN))


@pytest.mark.parametrize("shift, found", [(0.9, True), (1.0, False), (0.9999, False)])
def test_overlap_names_both(tmp_path, shift, found):
    """The slop of the solver (a thousandth of the floe size) is left to the position projection; touching is no
    overlap."""
    write(tmp_path, feature(at(SQUARE, 5, 3)), feature(at(SQUARE, 8, 0)), feature(at(SQUARE, 8 + shift, 0)))
    if found:
        assert "feature 1 and feature 2 overlap by 0.1 m" in field(tmp_path, BASE, code=CASE)
    else:
        field(tmp_path, BASE)


def test_overlap_of_shores_not_of_hulls(tmp_path):
    """A floe in the bay of another: no overlap of the outlines, but of the hull."""
    write(tmp_path, feature(at(C_SHAPE, 5, 0)), feature(at(SQUARE, 5.8, 0.5)))
    assert "feature 0 and feature 1 overlap" in field(tmp_path, changed(BASE, ice__nonconvex="hull"), code=CASE)
    rings, *_ = field(tmp_path, changed(BASE, ice__nonconvex="split"))
    assert same_ring(rings[0], at(C_SHAPE, 5, 0), 1e-12)
    write(tmp_path, feature(at(C_SHAPE, 5, 0)), feature(at(SQUARE, 5.3, 0.5)))
    assert "feature 0 and feature 1 overlap by 0.2 m" in field(tmp_path, changed(BASE, ice__nonconvex="split"),
                                                               code=CASE)
    write(tmp_path, feature(at(SQUARE, 5, 0)), feature([[5.4, 0.4], [5.6, 0.4], [5.6, 0.6], [5.4, 0.6]]))
    assert "feature 0 and feature 1 overlap" in field(tmp_path, BASE, code=CASE), "one inside the other"


@pytest.mark.parametrize("x, y", [(6.5, 0.35), (6.5, 1.25), (5.35, 0.8)])
@pytest.mark.parametrize("last", [True, False])
def test_overlap_with_every_part(tmp_path, x, y, last):
    """A small floe a little in each arm of the C, and in its back; whichever of them comes first."""
    small = feature([[x, y], [x + 0.4, y], [x + 0.4, y + 0.4], [x, y + 0.4]])
    c = feature(at(C_SHAPE, 5, 0))
    write(tmp_path, *([c, small] if last else [small, c]))
    assert "feature 0 and feature 1 overlap by 0.15 m" in field(tmp_path, changed(BASE, ice__nonconvex="split"),
                                                                code=CASE)


def test_hull_and_split_are_counted(tmp_path):
    write(tmp_path, feature(at(C_SHAPE, 5, 0)), feature(at(SQUARE, 10, 0)))
    rings, _, areas, _ = field(tmp_path, changed(BASE, ice__nonconvex="hull"))
    np.testing.assert_allclose(areas, [4, 1], rtol=1e-12)
    assert same_ring(rings[0], [[5, 0], [7, 0], [7, 2], [5, 2]], 1e-12)
    r = run(tmp_path, changed(BASE, ice__nonconvex="hull"), name="hull")
    assert (r.summary["outlines"]["hulled"], r.summary["outlines"]["split"]) == (1, 0)
    np.testing.assert_allclose(r.summary["outlines"]["hull_area_added_m2"], 1.5, rtol=1e-12)
    assert "1 not convex and replaced by their hulls" in r.result.stdout
    r = run(tmp_path, changed(BASE, ice__nonconvex="split"), name="split")
    o = r.summary["outlines"]
    assert (o["hulled"], o["split"], o["parts"], o["hull_area_added_m2"]) == (0, 1, 3, 0)
    # The result shows the floe, not its parts.
    assert r.summary["n_floes"] == 2
    np.testing.assert_allclose(r.dataset("/floes/area"), [2.5, 1], rtol=1e-12)
    assert r.dataset("/floes/offsets").tolist() == [0, 8, 12]
    assert same_ring(placed(r.dataset("/floes/vertices")[:8],
                            r.dataset("/frames/pose")[0, 0]), at(C_SHAPE, 5, 0), 1e-12)
    said = call("check", write_case(tmp_path, changed(BASE, ice__nonconvex="split"))).stdout
    assert "1 floes in 3 convex parts" in said and "stay rigid" not in said
    said = call("check", write_case(tmp_path, changed(BASE, ice__nonconvex="split", ice__rafting={"kappa": 10}))).stdout
    assert "ice.rafting: 1 floes are not convex" in said


def test_floes_by_hand_that_do_not_raft(tmp_path):
    """As those of a file: check and a run count floes in convex parts that can move, and no others."""
    code = '"stays_rigid"'
    hand = {"shape": "polygon", "vertices": C_SHAPE, "y": 0}
    case = changed(TOW, ice__concentration=0, ice__rafting={"kappa": 10}, run__duration=0.2)
    for name, floes, said in (("free", [hand | {"x": 8}], True), ("fixed", [hand | {"x": 8, "fixed": True}], False),
                              ("convex", [{"length": 1, "x": 8, "y": 0}], False)):
        r = run(tmp_path / name, changed(case, floes=floes))
        assert (code in json.dumps(r.summary)) == said
        check = call("check", write_case(tmp_path / name, changed(case, floes=floes)), "--json")
        assert (code in check.stdout) == said


def test_many_vertices_become_a_hull(tmp_path):
    """A finely traced shore: too long for a floe as it is, but not for its hull."""
    circle = [[9 + (1 - 0.1 * (k % 4 > 0)) * math.cos(2 * math.pi * k / 400),
               math.sin(2 * math.pi * k / 400) * (1 - 0.1 * (k % 4 > 0))] for k in range(400)]
    write(tmp_path, feature(circle))
    assert "128" in field(tmp_path, changed(BASE, ice__nonconvex="split"), code=CASE)
    rings, *_ = field(tmp_path, changed(BASE, ice__nonconvex="hull"))
    assert len(rings[0]) == 100


@pytest.mark.parametrize("text, says",
                         [("", "JSON"),
                          ("{\"type\": \"FeatureCollection\",\n\"features\": [}", "floes.geojson:2: is not JSON"),
                          ("[1, 2]", "FeatureCollection"),
                          ('{"type": "Polygon", "coordinates": []}', "FeatureCollection"),
                          ('{"type": "FeatureCollection", "features": []}', "0 features"),
                          ("\x89HDF\r\n\x1a\n", "JSON"),
                          ('{"type": "FeatureCollection", "features": [3, null, {}]}', "feature 2")])
def test_files_that_are_no_outlines(tmp_path, text, says):
    (tmp_path / "floes.geojson").write_text(text)
    assert says in field(tmp_path, BASE, code=CASE)


def test_missing_file(tmp_path):
    said = field(tmp_path, BASE, code=IO)
    assert "floes.geojson" in said and "No such file" in said


@pytest.mark.parametrize("changes, key", [({"ice__field": "a.h5"}, "ice.outlines"),
                                          ({"ice__origin_lon": 10}, "ice.origin_lon"),
                                          ({"ice__origin_lon": 10, "ice__origin_lat": 70}, "ice.origin_lon"),
                                          ({"ice__outlines": None, "ice__outlines_crs": "lonlat"}, "ice.outlines_crs"),
                                          ({"ice__outlines": None, "ice__nonconvex": "split"}, "ice.nonconvex")])
def test_keys_without_effect(tmp_path, changes, key):
    write(tmp_path, feature(at(SQUARE, 8, 0)))
    assert f": {key}: " in field(tmp_path, changed(BASE, **changes), code=CASE)


def test_round_trip(tmp_path):
    """A field made, written as outlines, and read again is the same field; so is one that is periodic and turned at the
    seams."""
    made = changed(BASE, ice={"concentration": 0.7, "size": 0.8, "thickness_law": "lognormal"}, domain__ends="periodic")
    rings, thickness, areas, pose = field(tmp_path / "made", made)
    field(tmp_path / "made", made, name="made.geojson")
    again = changed(BASE, ice={"outlines": "made/made.geojson"}, domain__ends="periodic")
    rings2, thickness2, areas2, pose2 = field(tmp_path, again)
    assert len(rings) == len(rings2) > 100
    for p, q in zip(rings, rings2):
        assert same_ring(p, q, 1e-12)
    assert thickness.tolist() == thickness2.tolist()
    np.testing.assert_allclose(areas2, areas, rtol=1e-12)
    np.testing.assert_allclose(pose2[:, :2], pose[:, :2], atol=1e-12)
    # A second round is the same to the bit, but for the last digits of centring; the file is plain GeoJSON.
    field(tmp_path, again, name="second.geojson")
    first = json.loads((tmp_path / "made/made.geojson").read_text())["features"]
    second = json.loads((tmp_path / "second.geojson").read_text())["features"]
    for a, b in zip(first, second):
        np.testing.assert_allclose(a["geometry"]["coordinates"], b["geometry"]["coordinates"], atol=1e-13)
    other = changed(again, domain__frame="geographic", domain__ends="wall", domain__sides="wall", body__draft=1,
                    tow__speed=0.1)
    assert "domain.frame" in field(tmp_path, other, code=CASE), "metres of another frame"
    assert "lonlat" in field(tmp_path, changed(again, ice__outlines_crs="lonlat"), code=CASE)


def test_field_files_with_bays(tmp_path):
    """HDF5 holds the outline, and the case that reads it says what becomes of it; the run is that of the outlines
    themselves."""
    write(tmp_path, feature(at(C_SHAPE, 5, 0)), feature(at(SQUARE, 10, 0)))
    split = changed(BASE, ice__nonconvex="split")
    field(tmp_path, split)
    stored = changed(BASE, ice={"field": "out.h5"})
    r = call("check", write_case(tmp_path, stored))
    assert r.returncode == CASE and "floe 0" in r.stderr and "not convex" in r.stderr and "ice.nonconvex" in r.stderr
    a = run(tmp_path, split, name="a")
    b = run(tmp_path, changed(stored, ice__nonconvex="split"), name="b")
    assert (b.summary["outlines"]["split"], b.summary["outlines"]["parts"]) == (1, 3)
    assert a.hash == b.hash
    c = run(tmp_path, changed(stored, ice__nonconvex="hull"), name="c")
    np.testing.assert_allclose(sorted(c.dataset("/floes/area")), [1, 4], rtol=1e-12)
    np.testing.assert_allclose(c.summary["concentration"] * (200 - math.pi), 5, rtol=1e-3)
    again = call("field", write_case(tmp_path, changed(stored, ice__nonconvex="split")), "-o",
                 tmp_path / "back.geojson")
    assert again.returncode == DONE, again.stderr
    ring = json.loads((tmp_path / "back.geojson").read_text())["features"][0]["geometry"]["coordinates"][0]
    assert same_ring(ring[:-1], at(C_SHAPE, 5, 0), 1e-12)


def test_outlines_that_are_convex_but_for_rounding_are_not_split(tmp_path):
    """Red as a floe in convex parts, which never rafts; in a file of HDF5 beside one that is split the same."""
    write(tmp_path, feature(at(C_SHAPE, 5, 0)), feature(at([[0, 0], [0.5, 2e-4], [1, 0], [1, 1], [0, 1]], 10, 0)))
    for mode in ("split", "hull"):
        o = run(tmp_path, changed(BASE, ice__nonconvex=mode), name=mode).summary["outlines"]
        assert (o["rounded"], o["split"], o["hulled"]) == (1, mode == "split", mode == "hull")


def test_the_resolved_case_reads_the_same_outlines(tmp_path):
    write(tmp_path, feature(at(C_SHAPE, 5, 0)))
    a = run(tmp_path, changed(BASE, ice__nonconvex="split"), name="deep/down/a")
    b = run(tmp_path, a.dir / "case.resolved.yml", name="b")
    assert a.hash == b.hash


# ---- longitude and latitude ----

def vincenty(lon1, lat1, lon2, lat2):
    """Geodesic on WGS84, degrees: distance m and azimuth rad from north to east [Vincenty 1975, Survey Review 23]."""
    a, f = 6378137.0, 1 / 298.257223563
    b = a * (1 - f)
    u1, u2 = (math.atan((1 - f) * math.tan(math.radians(x))) for x in (lat1, lat2))
    d = lam = math.radians(lon2 - lon1)
    for _ in range(50):
        ss = math.hypot(
            math.cos(u2) * math.sin(lam),
            math.cos(u1) * math.sin(u2) - math.sin(u1) * math.cos(u2) * math.cos(lam))
        cs = math.sin(u1) * math.sin(u2) + math.cos(u1) * math.cos(u2) * math.cos(lam)
        sigma = math.atan2(ss, cs)
        sa = math.cos(u1) * math.cos(u2) * math.sin(lam) / ss
        c2 = 1 - sa * sa
        cm = cs - 2 * math.sin(u1) * math.sin(u2) / c2 if c2 else 0
        c = f / 16 * c2 * (4 + f * (4 - 3 * c2))
        lam = d + (1 - c) * f * sa * (sigma + c * ss * (cm + c * cs * (2 * cm * cm - 1)))
    k = c2 * (a * a - b * b) / (b * b)
    big_a = 1 + k / 16384 * (4096 + k * (k * (320 - 175 * k) - 768))
    big_b = k / 1024 * (256 + k * (k * (74 - 47 * k) - 128))
    ds = big_b * ss * (cm + big_b / 4 * (cs * (2 * cm * cm - 1) - big_b / 6 * cm * (4 * ss * ss - 3) *
                                         (4 * cm * cm - 3)))
    return b * big_a * (sigma - ds), math.atan2(
        math.cos(u2) * math.sin(lam),
        math.cos(u1) * math.sin(u2) - math.sin(u1) * math.cos(u2) * math.cos(lam))


LON, LAT = 19.3, 75.0
LONLAT = changed(BASE, domain={"frame": "geographic", "length": 210e3, "width": 210e3, "ends": "open", "sides": "open"},
                 body={"shape": "none"}, ice__outlines_crs="lonlat", ice__origin_lon=LON, ice__origin_lat=LAT)


def triangle(lon, lat, metres):
    dy, dx = metres / 111e3, metres / (111e3 * math.cos(math.radians(lat)))
    return [[lon, lat], [lon + dx, lat], [lon, lat + dy]]


@pytest.mark.parametrize("distance, error", [(1e3, 1e-4), (10e3, 1e-3), (90e3, 0.02)])
@pytest.mark.parametrize("lat0", [60, 75, 89])
@pytest.mark.parametrize("frame", ["geographic", "basin"])
def test_projected_distances_and_azimuths(tmp_path, frame, lat0, distance, error):
    """Against geodesics; error: how far from their ends (m) corners may lie at a distance (m) from the origin.
    Azimuthal equidistant means that both are true from the origin."""
    places = [(math.radians(azimuth), distance) for azimuth in range(10, 360, 40)]
    rings = []
    for azimuth, d in places:
        lat = lat0 + d * math.cos(azimuth) / 111.6e3 * (0.9 if lat0 < 89 else 0.5)
        rings.append(triangle(LON + d * math.sin(azimuth) / (111.3e3 * math.cos(math.radians(lat))), lat,
                              distance / 20))
    write(tmp_path, *(feature(r) for r in rings))
    size = 2.3 * distance
    case = changed(LONLAT, domain__frame=frame, domain__length=size, domain__width=size, ice__origin_lat=lat0)
    if frame == "basin":
        case["domain"] |= {"x0": -size / 2}
    got, *_ = field(tmp_path, case)
    for ring, drawn in zip(got, rings):
        assert area(ring) > 0
        want = []
        for lon, lat in drawn:
            d, azimuth = vincenty(LON, lat0, lon, lat)
            north, east = d * math.cos(azimuth), d * math.sin(azimuth)
            want.append([east, north] if frame == "basin" else [north, east])
        want = want if area(np.array(want)) > 0 else want[::-1]
        assert same_ring(ring, want, error), (np.abs(np.array(want) - ring), want)


def test_origin_in_the_middle(tmp_path):
    """Also across the 180th meridian."""
    for lon in (20.0, 179.999):
        write(tmp_path, feature(triangle(lon - 0.004, 70, 50)),
              feature([[x if x <= 180 else x - 360, y] for x, y in triangle(lon + 0.004, 70.002, 50)]))
        case = changed(LONLAT, domain__length=2e3, domain__width=2e3, ice__origin_lon=None, ice__origin_lat=None)
        got, *_ = field(tmp_path, case)
        corners = np.vstack(got)
        assert np.abs(corners.min(axis=0) + corners.max(axis=0)).max() < 0.1
        assert np.ptp(corners[:, 1]) < 500
        o = run(tmp_path, changed(case, run__dt=1), name=f"run{lon}").summary["outlines"]
        assert abs(o["origin_lat_deg"] - 70.001) < 1e-3 and abs(abs(o["origin_lon_deg"]) - lon) < 2e-3


@pytest.mark.parametrize("ring, says", [([[75, 1900], [75, 1910], [80, 1910]], "longitude and latitude"),
                                        (triangle(LON + 5, LAT, 50), "100 km")])
def test_what_is_no_place_near_by(tmp_path, ring, says):
    write(tmp_path, feature(triangle(LON, LAT, 50)), feature(ring))
    said = field(tmp_path, LONLAT, code=CASE)
    assert "feature 1" in said and says in said


def test_the_shipped_example(tmp_path):
    """Made-up outlines: they say so, lie where they can, and a short tow meets them."""
    from harness import ROOT
    folder = ROOT / "cases/outlines"
    drawn = json.loads((folder / "made_up.geojson").read_text())
    assert "MADE UP" in drawn["description"]
    r = run(tmp_path, folder / "outlines.yml", "--steps", 150)
    o = r.summary["outlines"]
    assert o["read"] == o["split"] == len(drawn["features"]) and o["parts"] > 3 * o["split"]
    assert r.summary["unconverged_steps"] == 0 and r.summary["momentum_residual"] < 1e-9
    assert r.series("ice_resistance").max() > 0
    assert r.summary["max_overlap_relative"] < 0.01


# ---- what the ice is for the case that reads it ----


def warnings_of(folder, case, *words):
    r = call("check", write_case(folder, case), "--json", *words)
    assert r.returncode == DONE, r.stderr
    return texts(json.loads(r.stdout)["warnings"]), json.loads(r.stdout)["ice"]["concentration"]


def test_the_concentration_is_that_of_the_ice_region(tmp_path):
    """A floe outside is left out, of one on the edge the part inside counts, with bays or without; a field file that
    is made of them keeps it."""
    write(tmp_path, feature(at(SQUARE, 5, 3)), feature(at(SQUARE, 9.25, 0)), feature(at(SQUARE, 14, 0)),
          feature(at(C_SHAPE, 9, 2)))
    case = changed(BASE, ice__x_max=10, ice__nonconvex="split")
    warned, concentration = warnings_of(tmp_path, case)
    ground = 10 * 10 - math.pi
    assert concentration == pytest.approx((1 + 0.75 + 1.5) / ground, rel=2e-3)
    assert any("1 of 4 floes lie outside the ice region" in w and "omits 2.25 m2" in w for w in warned)
    assert not any("outside" in w for w in warnings_of(tmp_path, changed(case, ice__x_max=None))[0])
    field(tmp_path, case)
    again = changed(BASE, ice={"field": "out.h5", "nonconvex": "split"})
    warned, read_again = warnings_of(tmp_path, again)
    assert read_again == pytest.approx(concentration, rel=1e-12)
    assert any("refers to an ice region of 96.8" in w and "the domain without the body has 196.8" in w for w in warned)


#: 36 floes over 7 m in a domain of 30 m whose sides are open; a planned tow leaves them after half a minute
SMALL_MAP = changed(BASE, domain={"length": 30, "width": 20, "ends": "open", "sides": "open"},
                    run={"dt": 0.1, "duration": 60}, tow={"speed": 0.3, "ramp": 1})
BOX = [5, -3.5, 12, 3.5]


def small_map(folder):
    write(folder, *(feature(at(SQUARE, 5 + 1.2 * i, -3.5 + 1.2 * j)) for i in range(6) for j in range(6)))


def coded(warnings):
    return {w["code"]: w["values"] for w in warnings}


def checked(folder, case):
    r = call("check", write_case(folder, case), "--json")
    assert r.returncode == DONE, r.stderr
    return coded(json.loads(r.stdout)["warnings"])


def test_a_map_that_ends_within_the_ice_region(tmp_path):
    """It is told with the box; the verdict is the same with keys that cut the region to it, with the default typed out,
    and without keys; so is the ice. Red: nothing was told, and the tow was steady off the map."""
    small_map(tmp_path)
    cut = dict(zip(("ice__x_min", "ice__y_min", "ice__x_max", "ice__y_max"), BOX))
    typed = dict(zip(cut, (0, -10, 30, 10)))
    left, hashes = [], set()
    for keys in {}, typed, cut:
        case = changed(SMALL_MAP, **keys)
        told = checked(tmp_path, case)
        assert ("map_ends" in told) == (keys is not cut)
        if keys is not cut:
            assert [told["map_ends"][k] for k in ("x_min_m", "y_min_m", "x_max_m", "y_max_m")] == pytest.approx(BOX)
        left.append(told["leaves_ice"]["time_s"])
        r = run(tmp_path, case, "--quiet", name=f"out-{len(left)}")
        hashes.add(r.hash)
        assert ("map_ends" in coded(r.summary["warnings"])) == (keys is not cut)
        assert "leaves_ice" in coded(r.summary["window"]["reasons"])
    assert left == [left[0]] * 3 and left[0] == pytest.approx((BOX[2] - 2) / 0.3 + 0.5, abs=1) and len(hashes) == 1
    field(tmp_path, SMALL_MAP)  # which tells as much
    told = checked(tmp_path, changed(SMALL_MAP, ice={"field": "out.h5"}))
    assert told["map_ends"]["x_max_m"] == pytest.approx(12) and told["leaves_ice"]["time_s"] == left[0]
    field(tmp_path, changed(SMALL_MAP, **cut))
    assert "map_ends" not in checked(tmp_path, changed(SMALL_MAP, ice={"field": "out.h5"}))


def test_a_map_that_ends_less_than_two_floes_from_the_side(tmp_path):
    """That is told of no one; nor is water between the ice and a wall, which is known."""
    small_map(tmp_path)
    near = changed(SMALL_MAP, domain={"x0": 3, "y0": -5.5, "length": 11, "width": 11, "ends": "open", "sides": "open"},
                   body={"x": 3.92, "length": 1.8})
    walls = changed(SMALL_MAP, domain__ends="wall", domain__sides="wall")
    assert not {"map_ends", "leaves_ice"} & checked(tmp_path, changed(near, run__duration=10)).keys()
    assert "map_ends" not in checked(tmp_path, walls)


def test_a_lead_in_ice_of_a_map_that_ends(tmp_path):
    """The concentration stays that of the ice region in a field of it, too."""
    small_map(tmp_path)
    write_case(tmp_path, SMALL_MAP)
    lead = {"mode": "channel", "width": 2.4}
    told = [json.loads(call("check", write_case(tmp_path, changed(SMALL_MAP, lead=lead)), "--json").stdout)]
    field(tmp_path, SMALL_MAP)
    told.append(json.loads(call("check", write_case(tmp_path, changed(SMALL_MAP, lead=lead, ice={"field": "out.h5"})),
                                "--json").stdout))
    assert told[0]["ice"]["concentration"] == pytest.approx(told[1]["ice"]["concentration"], rel=1e-9)


def test_an_ice_chart_is_not_a_map_of_floes(tmp_path):
    """Its columns are told of, in a resumed run, too. Red: regions of the chart were towed through without a word."""
    names = {"poly_TYPE": "I", "CT": "91", "note": "x", "thickness": 0.2}
    write(tmp_path, feature(at(SQUARE, 5, 3), properties=names), feature(at(SQUARE, 9, 0), properties=names))
    assert checked(tmp_path, BASE)["ice_chart"] == {"columns": "`poly_TYPE`, `CT`"}
    done = call("run", write_case(tmp_path, BASE), "-o", tmp_path / "out", "--steps", 3, "--quiet")
    assert done.returncode == DONE, done.stderr
    done = call("resume", tmp_path / "out", "--quiet")
    assert done.returncode == DONE, done.stderr
    assert "ice_chart" in coded(json.loads((tmp_path / "out/summary.json").read_text())["warnings"])
    write(tmp_path, feature(at(SQUARE, 5, 3), properties={"note": "x"}))
    assert "ice_chart" not in checked(tmp_path, BASE)


def test_more_ice_outside_the_region_than_would_fit_into_it(tmp_path):
    """The run is resumed, and a field file of it is read, with bays or their hulls."""
    write(tmp_path, feature(at(C_SHAPE, 5, 2)), *(feature(at(SQUARE, 8 + 1.5 * (k % 7), -4.8 + 1.2 * (k // 7)))
                                                  for k in range(35)))
    case = changed(BASE, ice__x_min=4, ice__x_max=7.5, ice__nonconvex="split")
    concentration = warnings_of(tmp_path, case)[1]
    assert concentration == pytest.approx(2.5 / 35, rel=1e-9)
    done = call("run", write_case(tmp_path, case), "-o", tmp_path / "out", "--steps", 3, "--quiet")
    assert done.returncode == DONE, done.stderr
    done = call("resume", tmp_path / "out", "--quiet")
    assert done.returncode == DONE, done.stderr
    field(tmp_path, case)
    for way, share in ("split", 1), ("hull", 39 / 37.5):
        again = changed(BASE, ice={"field": "out.h5", "nonconvex": way})
        assert warnings_of(tmp_path, again)[1] == pytest.approx(concentration * share, rel=1e-9)


def test_over_a_periodic_edge_a_floe_counts_whole(tmp_path):
    write(tmp_path, feature(at(SQUARE, 19.25, 0)), feature(at(SQUARE, 8, 0)))
    case = changed(BASE, domain__ends="periodic")
    assert warnings_of(tmp_path, case)[1] == pytest.approx(2 / (200 - math.pi), rel=2e-3)
    part = changed(case, ice__x_max=10)
    assert warnings_of(tmp_path, part)[1] == pytest.approx(1.25 / (100 - math.pi), rel=2e-3)


def test_a_field_of_the_other_frame(tmp_path):
    """Its x and y would lie mirrored. A file that does not say its frame is read."""
    write(tmp_path, feature(at(SQUARE, 8, 0)))
    field(tmp_path, BASE)
    other = changed(BASE, ice={"field": "out.h5"}, domain__frame="geographic", domain__x0=0, domain__y0=-5,
                    domain__ends="wall", domain__sides="wall", body__draft=1, tow__speed=0.1)
    r = call("check", write_case(tmp_path, other))
    assert r.returncode == CASE and "out.h5: was made for domain.frame: basin" in r.stderr
    with h5py.File(tmp_path / "out.h5", "r+") as f:
        assert f["floes"].attrs["frame"] == b"basin"
        del f["floes"].attrs["frame"]
        floes = {k: v[:] for k, v in f["floes"].items()}
        area_of_ice = f["floes"].attrs["ice_area"]
    with h5py.File(tmp_path / "out.h5", "w") as f:  # without the checksum
        g = f.create_group("floes")
        for name, values in floes.items():
            g[name] = values
        g.attrs["ice_area"] = area_of_ice
    warnings_of(tmp_path, other)


@pytest.mark.parametrize("changes, says", [({"thickness": 10.5}, "more than 10 m"),
                                           ({"thickness": 0.25}, "more than a fifth of the floe size"),
                                           ({"thickness": 0.2}, "more than the draft"), ({"thickness": 0.1}, None)])
def test_a_thickness_that_may_be_in_centimetres(tmp_path, changes, says):
    write(tmp_path, feature(at(SQUARE, 8, 0), properties=changes))
    case = changed(BASE, ice__thickness=None, body__draft=0.15)
    warned = [w for w in warnings_of(tmp_path, case)[0] if "check that it is in metres" in w]
    assert len(warned) == (says is not None) and all(says in w for w in warned)


def test_a_thickness_of_the_case_that_no_floe_has(tmp_path):
    write(tmp_path, feature(at(SQUARE, 8, 0), properties={"thickness": 0.1}))
    says = "ice.thickness: no effect, because all outlines have their own thickness"
    assert says in warnings_of(tmp_path, BASE)[0]
    write(tmp_path, feature(at(SQUARE, 8, 0), properties={"thickness": 0.1}), feature(at(SQUARE, 12, 0)))
    assert says not in warnings_of(tmp_path, BASE)[0]
