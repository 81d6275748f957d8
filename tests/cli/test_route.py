# SPDX-License-Identifier: MIT
"""bergtow route around its planner: positions, members of a map, routes as cases, the towed circle, an honest choice,
what is kept through a kill, and the receding horizon."""
import contextlib
import dataclasses
import functools
import json
import re
import resource
import signal
import subprocess
import sys
import time
from types import SimpleNamespace
from xml.etree import ElementTree

import h5py
import numpy as np
import pyproj
import pytest

from harness import (BERGTOW, CASE, DONE, ROOT, SIGNAL, TOW, USAGE, call, changed, environment, heard, run, script,
                     write_case)

import bergtow
from bergtow import Case, _library
from bergtow.errors import BergtowError, RunError
from bergtow.result.run import Run
from bergtow.routing import apart, horizon, members, output, planner, route, situation, tows, verdict
from bergtow.text import route as text_route

BASIN = changed(TOW, run__duration=20, domain__length=12, domain__width=6, domain__ends="open", body__x=2.5,
                body__length=0.8, ice__size=0.5, ice__concentration=0.4, output=None)
QUICK = "--to", "8.5,0.3", "--routes", "2", "--members", "4", "--jobs", "2"


@pytest.fixture(scope="module")
def routed(tmp_path_factory):
    """A call, and its folder."""
    folder = tmp_path_factory.mktemp("route")
    done = script("route", write_case(folder, BASIN), *QUICK, "-o", folder / "out")
    assert done.returncode == DONE, done.stderr
    return SimpleNamespace(folder=folder, out=folder / "out", said=done.stdout,
                           found=json.loads((folder / "out/route.json").read_text()))


called = functools.partial(script, drawn=False)  # pages are those of `routed`


def read_situation(folder, case, **more):
    return situation.of(BERGTOW, write_case(folder, case), folder / "work", **more)


# ---- positions


def test_degrees_are_those_of_the_program(tmp_path):
    """Against the floes that `bergtow field` writes in degrees. Red: axes swapped; another radius of the earth."""
    case = ROOT / "cases/outlines/outlines.yml"
    call("field", case, "-o", tmp_path / "f.geojson")
    call("field", case, "-o", tmp_path / "f.h5")
    floes, place = members.Floes.read(tmp_path / "f.h5").outlines(), situation.place_of(Case(case), None)
    for feature, floe in zip(json.loads((tmp_path / "f.geojson").read_text())["features"], floes):
        ring = np.array(feature["geometry"]["coordinates"][0][:-1])
        own = place.degrees(floe)
        far = np.abs(own[:, None] - ring).max(axis=2).min(axis=1)
        assert far.max() < 1e-8  # a millimetre
        assert np.allclose(place.metres(own), floe, atol=1e-6)


@pytest.mark.parametrize("crs", ["", "EPSG:32633", _library.limit("map_local_crs")])
def test_the_place_is_that_of_the_outlines(tmp_path, crs):
    """Of a case without keys for it. Red: only keys tell; a projection is none; the remedy for metres is refused."""
    there = pyproj.Transformer.from_crs("OGC:CRS84", "EPSG:32633", always_xy=True)
    ring = np.array([20.0, 76.5]) + [[0.004, 0.001], [0.006, 0.001], [0.005, 0.0015], [0.004, 0.001]]
    at = ring if not crs else np.column_stack(there.transform(*ring.T))
    map_ = {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry": {
        "type": "Polygon", "coordinates": [(at if "EPSG" in crs or not crs else at - at[0] + [50, 100]).tolist()]}}]}
    if crs:
        map_["crs"] = {"type": "name", "properties": {"name": crs}}
    (tmp_path / "map.geojson").write_text(json.dumps(map_))
    case = {"run": {"dt": 0.5, "duration": 30}, "ice": {"outlines": "map.geojson", "thickness": 1},
            "domain": {"frame": "geographic", "length": 600, "width": 400, "ends": "open", "sides": "open"},
            "body": {"shape": "disc", "length": 10, "draft": 5, "x": -150}, "tow": {"mode": "speed", "speed": 0.5}}
    s = read_situation(tmp_path, case)
    if crs.startswith("urn"):
        with pytest.raises(RunError, match="unless the ice is outlines in metres"):
            situation.position("20E,76.5N", s.place, "--to")
        return
    (floe,) = s.ice.outlines
    found = s.place.degrees(floe)
    assert np.abs(found[:, None] - ring[:-1]).max(axis=2).min(axis=1).max() < 1e-7
    assert np.allclose(s.place.metres(found), floe, atol=1e-3)
    again = map_of(write_case(tmp_path, case | {"ice": {"field": str(s.field)}}))
    assert again["crs"] == s.place.crs and again["origin"] == pytest.approx(
        s.place.origin if crs else np.degrees(s.place.origin))


def test_a_field_keeps_its_place_unless_the_case_gives_one(tmp_path):
    """In the program, whose runs are exported, and for routes. Red: one has the place of the file, the other that of
    the case, or none."""
    first, own = ({"origin_lon": lon, "origin_lat": lat} for lon, lat in ((20, 76.5), (30, 70)))
    call("field", write_case(tmp_path, changed(BASIN, ice=BASIN["ice"] | first)), "-o", tmp_path / "f.h5")
    for ice, wanted in ({}, (20, 76.5)), (own, (30, 70)):
        case = write_case(tmp_path, changed(BASIN, ice={"field": "f.h5"} | ice))
        assert map_of(case)["origin"] == pytest.approx(wanted)
        assert np.degrees(situation.place_of(Case(case), lambda: tmp_path / "f.h5").origin) == pytest.approx(wanted)
        with Run(run(tmp_path, case, "--steps", 1, "--force").dir) as r:
            assert r.number("outlines.origin_lon_deg") == pytest.approx(wanted[0])


@pytest.mark.parametrize("crs, found", [(np.bytes_(b"EPSG:32633"), True), ("EPSG:32633", False),
                                        (np.bytes_(_library.limit("map_local_crs")), False)])
def test_routes_read_the_place_of_a_field_as_the_program_does(tmp_path, crs, found):
    """A string of variable length is none. Red: a place for routes that the program does not know."""
    call("field", write_case(tmp_path, BASIN), "-o", tmp_path / "f.h5")
    floes = members.Floes.read(tmp_path / "f.h5")
    floes.attributes |= {"crs": crs, "origin_east": 5e5, "origin_north": 8e6}
    floes.write(tmp_path / "g.h5")
    case = write_case(tmp_path, changed(BASIN, ice={"field": "g.h5"}))
    assert (situation.place_of(Case(case), lambda: tmp_path / "g.h5").origin is not None) == found
    assert ("EPSG" in map_of(case)["crs"]) == found


def map_of(case):
    """{"origin", "crs"} of the floes of a case as GeoJSON."""
    call("field", case, "-o", case.parent / "floes.geojson", "--force")
    found = json.loads((case.parent / "floes.geojson").read_text())
    return {"origin": found["bergtow"]["origin"], "crs": found.get("crs", {}).get("properties", {}).get("name", "")}


def test_a_position_is_metres_or_degrees(tmp_path):
    nowhere = situation.Place(False)
    there = situation.Place(True, tuple(np.radians([20, 76.5])))
    assert situation.position("1.5 km, -20", nowhere, "--to") == (1500, -20)
    assert situation.position("20E,76.5N", there, "--to") == pytest.approx((0, 0), abs=1e-6)
    assert situation.position("76.51N,20E", there, "--to") == pytest.approx((1116, 0), abs=1)
    assert situation.goal("1,2:3,4", nowhere) == ((1, 2), (3, 4))
    for text, place in (("20E,76N", nowhere), ("20E,21E", there), ("1", there), ("1,x", there), ("20E,97N", there)):
        with pytest.raises(RunError) as caught:
            situation.position(text, place, "--to")
        assert caught.value.status == USAGE


# ---- distances


def test_distances_of_polygons():
    """Against the least distance of points sampled on both outlines, and squares with a known gap."""
    rng = np.random.default_rng(1)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    assert apart.of(square, square + [3, 0]) == pytest.approx(2)
    assert apart.of(square, square + [2, 2]) == pytest.approx(np.sqrt(2))
    assert apart.of(square, square * 0.2 + 0.4) == 0 == apart.of(square, square + 0.5)
    cross = np.array([[-1, 0.4], [2, 0.4], [2, 0.6], [-1, 0.6]])  # no corner of either in the other
    assert apart.of(square, cross) == 0
    for _ in range(20):
        p, q = (rng.normal(size=2) * 2 + np.c_[np.cos(a := np.sort(rng.uniform(0, 6.28, 6))), np.sin(a)]
                for _ in range(2))
        found = apart.of(p, q)
        if found > 0:
            a, b = (np.concatenate([e + (f - e) * np.linspace(0, 1, 200)[:, None] for e, f in zip(
                s, np.roll(s, -1, 0))]) for s in (p, q))
            brute = np.hypot(*(a[:, None] - b).transpose(2, 0, 1)).min()
            assert found <= brute + 1e-12 and brute - found < 0.02


def test_contact_with_an_area_is_that_of_the_hull():
    """A hull that is longer than wide passes a shoal or touches it by its yaw alone."""
    hull = np.array([[-2, -0.5], [2, -0.5], [2, 0.5], [-2, 0.5]])
    shoal = [np.array([[-1, 1], [1, 1], [0, 3.0]])]
    way = np.column_stack([np.linspace(-5, 5, 101), np.zeros(101), np.zeros(101)])
    assert apart.least(way, hull, shoal, 1.0) == pytest.approx(0.5)
    assert apart.least(way + [0, 0, np.pi / 2], hull, shoal, 1.0) == 0
    assert apart.least(way, hull, []) == np.inf


# ---- members of a map


def test_members_are_the_map_within_its_errors(tmp_path):
    """Red: floes overlap; the spread is another than said; a member depends on the others."""
    s = read_situation(tmp_path, changed(BASIN, ice__concentration=0.3))
    errors = members.Errors(0.05, 0.2, 0.004)
    some = members.drawn(30, s, errors, tmp_path / "m")
    base = members.Floes.read(s.field)
    shifts, factors = [], []
    for m in some:
        floes = members.Floes.read(s.case.parent / m.keys["ice.field"])
        assert len(floes.area) == len(base.area) - m.left_out
        if not m.left_out:
            shifts.append(floes.pose[:, :2] - base.pose[:, :2])
            factors.append(floes.thickness / base.thickness)
    assert len(shifts) > 5
    common = np.array([d.mean(axis=0) for d in shifts])
    assert np.abs(common[:, 1]).max() < 0.02                     # walls at the sides: the map keeps its place there
    assert common[:, 0].std() == pytest.approx(0.05 * np.sqrt(0.5), rel=0.5)
    assert np.log(np.concatenate(factors)).std() == pytest.approx(0.2, rel=0.25)
    drift = np.array([m.drift for m in some])
    assert drift.std() == pytest.approx(0.004, rel=0.3) and abs(drift.mean()) < 0.002
    outlines = members.Floes.read(s.case.parent / some[0].keys["ice.field"]).outlines()
    reach = [apart.radius(o, o.mean(axis=0)) for o in outlines]
    for i, p in enumerate(outlines):
        for j in range(i):
            if np.hypot(*(p.mean(axis=0) - outlines[j].mean(axis=0))) < reach[i] + reach[j]:
                assert apart.of(p, outlines[j]) > 0
    again = members.drawn(3, s, errors, tmp_path / "again")[2]
    first, second = (s.case.parent / m.keys["ice.field"] for m in (again, some[2]))
    with h5py.File(first) as a, h5py.File(second) as b:
        assert np.array_equal(a["floes/pose"], b["floes/pose"])
    for m in some[:2]:  # the program takes them
        sets = [w for k, v in m.keys.items() for w in ("--set", f"{k}={v}")]
        assert call("check", s.case, *sets).returncode == DONE


def test_floes_have_room_across_a_periodic_seam():
    """Red: as much as most, so that members move floes into each other's images."""
    square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    floes = [square + at for at in ([0.7, 5], [9.1, 5], [5, 0.4], [5, 9.2])]  # 0.6 m apart in x, 0.2 m in y
    for period, room in (((0, 0), (2, 2, 2, 2)), ((10, 0), (0.3, 0.3, 2, 2)), ((0, 10), (2, 2, 0.1, 0.1)),
                         ((10, 10), (0.3, 0.3, 0.1, 0.1))):
        assert members.room(floes, 2, period) == pytest.approx(room)
    corners = [square + at for at in ([0.6, 0.6], [9.1, 9.1], [9.0, 0.0])]
    assert members.room(corners[:2], 2, (10, 10)) == pytest.approx([0.5 * np.hypot(0.5, 0.5)] * 2)
    assert members.room([square + [0.6, 9.1], square + [9.1, 0.6]], 2, (10, 10)) == pytest.approx(
        [0.5 * np.hypot(0.5, 0.5)] * 2)


def test_the_image_of_a_floe_keeps_clear_of_the_hull():
    """Red: the floe whose image lies under the hull stays."""
    square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    for sides, clear in ("periodic", [False, True, True]), ("wall", [True, True, True]):
        s = SimpleNamespace(start=(5, 0.6), outline=square, hull=SimpleNamespace(radius=0.8), extent=(0, 0, 10, 10),
                            values={"body.yaw": 0, "domain.ends": "open", "domain.sides": sides})
        assert members.clear_of_hull([square + at for at in ([5, 9.9], [5, 5], [9.9, 0.6])], s).tolist() == clear


def test_a_field_file_gives_way_only_to_a_whole_one(tmp_path):
    """Red: it is cut, and the error is a paragraph of HDF5 without a remedy."""
    floes = members.Floes(np.zeros((4, 2)), np.arange(5), np.zeros((4, 3)), np.ones(4), np.ones(4), {"ice_area": 10.0})
    file, many = tmp_path / "m001.h5", dataclasses.replace(floes, vertices=np.zeros((10000, 2)))
    floes.write(file)
    before, limits = file.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    try:
        with pytest.raises(RunError) as refused:
            many.write(file)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert refused.value.path == file and refused.value.remedy and "\n" not in str(refused.value)
    assert file.read_bytes() == before and list(tmp_path.iterdir()) == [file]


def test_a_map_without_floes_has_members_without_floes():
    nothing = members.Floes(np.zeros((0, 2)), np.zeros(1, dtype=int), np.zeros((0, 3)), np.zeros(0), np.zeros(0), {})
    assert nothing.outlines() == []


def test_a_map_without_errors_is_one_member(tmp_path):
    s = read_situation(tmp_path, BASIN)
    (one,) = members.drawn(10, s, members.Errors(0, 0, 0), tmp_path)
    assert list(one.keys) == ["ice.field"] and (tmp_path / one.keys["ice.field"]).samefile(s.field)
    assert one.keys["ice.field"][0] != "/" and one.drift == (0, 0)  # the folder may be moved


def test_the_floes_are_those_of_the_run(tmp_path):
    """By hand, fixed and made: where the run has them."""
    case = changed(BASIN, ice__concentration=0.3, ice__x_min=5)
    case["floes"] = [{"shape": "square", "length": 0.5, "x": 3.7, "y": 1}, {"shape": "disc", "length": 0.6, "x": 3.7,
                                                                            "y": -1, "fixed": True}]
    s = read_situation(tmp_path, case)
    done = run(tmp_path / "run", changed(case, run__duration=0.1, output__frame_interval=0.1))
    with Run(done.dir) as r:
        theirs = r.polygons(0)
        assert len(s.ice.outlines) == r.n_floes - 1 == len(s.moving)
        for mine, i in zip(s.ice.outlines, s.moving):
            assert np.allclose(mine, theirs[i], atol=1e-12)
    (fixed,) = s.no_go
    assert fixed.mean(axis=0) == pytest.approx((3.7, -1))


# ---- routes as cases


def circle(radius, length, turns, speed):
    """A straight way, and circles: what a planner's route has."""
    angle = np.linspace(0, 2 * np.pi * turns, int(400 * turns))[1:]
    straight = np.linspace(0, length, 200)
    x = np.append(straight, length + radius * np.sin(angle))
    y = np.append(0 * straight, radius * (1 - np.cos(angle)))
    way = np.append(0, np.cumsum(np.hypot(np.diff(x), np.diff(y))))
    return SimpleNamespace(kind="planned", x=x, y=y, heading=np.append(0 * straight, angle), time=way / speed,
                           speed=np.full_like(way, speed), length=way[-1], duration=way[-1] / speed, force=0.0,
                           legs=np.array([(speed,)], [("speed", float)]))


@pytest.mark.parametrize("mass", ["20 kt", "0.31 Mt"])
def test_a_towed_body_keeps_its_circle(tmp_path, mass):
    """A turn of 800 m on 600 m of line: R_end² = R² - 2 R L sin(delta) + L², of a light body R_end² = R² + L². Red: the
    end goes where the tractrix has it (150 m for the heavy body); the body's own circle is given to the end."""
    case = {"run": {"dt": 4, "duration": 100}, "domain": {"frame": "geographic", "length": 9000, "width": 9000,
                                                          "ends": "open", "sides": "open"},
            "ice": {"concentration": 0, "size": 30, "thickness": 1},
            "body": {"length": 80, "draft": 60, "x": 0, "y": 0, "mass": mass},
            "tow": {"mode": "line", "speed": 0.5, "line_length": "560 m", "line_stiffness": "40 MN", "ramp": 300,
                    "line_damping": "500 kN s/m"}}
    s, radius = read_situation(tmp_path, case), 800
    c = tows.candidate("c", "c", circle(radius, 1000, 1.5, 0.5), s)
    sets = [w for k, v in c.keys.items() for w in ("--set", f"{k}={v}")]
    assert call("run", s.case, "-o", tmp_path / "run", "--quiet", *sets).returncode == DONE
    with Run(tmp_path / "run") as r:
        late = (r["time"] > 8000) & (r["time"] < 14000)
        body = np.hypot(r["body_x"][late] - 1000, r["body_y"][late] - radius)
        end = np.hypot(r["carriage_x"][late] - 1000, r["carriage_y"][late] - radius)
        off = apart.to_edges(np.column_stack([r["body_x"], r["body_y"]])[r["time"] < 14000],
                             np.vstack([c.track, c.track[::-1]]))
    assert body.mean() == pytest.approx(radius, rel=5e-3) and off.max() < 0.02 * radius
    sine = np.sin(np.arctan(s.mass / (body.mean() * s.hull.drag)))
    wanted = np.sqrt(body.mean() ** 2 - 2 * body.mean() * s.line * sine + s.line ** 2)
    assert end.mean() == pytest.approx(wanted, rel=5e-3)
    if mass == "20 kt":
        assert end.mean() == pytest.approx(np.sqrt(radius ** 2 + s.line ** 2), rel=0.02)


@pytest.mark.parametrize("mode", ["speed", "line"])
@pytest.mark.parametrize("drift", [(0.05, 0.02), (-0.05, 0.0)])
def test_drifting_ice_is_passed_at_the_planned_times(tmp_path, mode, drift):
    """Over the ground where the plan has the body, a ramp's lag later, and to a goal there that is fixed. Red: the
    speed through the ice is that over the ground; a corner over the ground is that through the ice; a swath beside the
    track; at another speed of --speeds the goal is where it was at the first."""
    tow = {"mode": mode, "speed": 0.2, "ramp": 4} | ({} if mode == "speed" else {
        "line_length": 2, "line_stiffness": "20 kN", "line_damping": "200 N s/m"})
    case = changed(BASIN, ice__concentration=0, domain__length=60, domain__width=30, tow=tow)
    s = read_situation(tmp_path, case)
    del tow["ramp"]  # as in route-base.yml
    write_case(tmp_path, case | {"tow": tow})
    s = dataclasses.replace(s, drift=drift, water=drift)
    options = {"drift": drift, "water": drift, "extent": s.extent, "radius": 4.0}
    goal, corners = (30.0, 2.0), [(14.0, 6.0)]
    fast = planner.route_through(s.ice, s.hull, s.start, goal, corners, speed=0.2, **options)
    slow = route.at_speed(fast, 0.15, s, None, options)
    assert route.at_speed(fast, 0.2, s, None, options) is fast and slow.force < fast.force
    for r in (fast, slow):
        c = tows.candidate("c", "c", r, s)
        assert c.track[-1] == pytest.approx(goal, abs=1e-3)
        assert (c.swath[:len(c.track)] + c.swath[:len(c.track) - 1:-1]) / 2 == pytest.approx(c.track)
        current = {f"water.current_{k}": v for k, v in zip("xy", drift)} if mode == "speed" else {}
        sets = [w for k, v in (c.keys | current).items() for w in ("--set", f"{k}={v}")]
        assert call("run", s.case, "-o", tmp_path / c.name, "--quiet", "--force", *sets).returncode == DONE
        with Run(tmp_path / c.name) as run_:
            lag = s.ramp / 2 if mode == "speed" else 0.75 * s.ramp
            body = [np.interp(r.time[20:] + lag, run_["time"], run_[name]) for name in ("body_x", "body_y")]
            if mode == "speed":
                assert tows.outcome(run_, c, goal, s)["length"] == pytest.approx(r.length, rel=0.03)  # through the ice
        off = np.hypot(*(np.transpose(body) - c.track[20:]).T)
        assert off.max() < (0.05 if mode == "speed" else 1.0)


def test_a_ramp_that_is_left_out_is_no_short_one(tmp_path):
    """Red: in a case of a route the derived ramp is rounded, and then too short for the line."""
    tow = {k: v for k, v in LINE["tow"].items() if k != "ramp"}
    s = read_situation(tmp_path, changed(LINE, tow=tow, ice__concentration=0))
    for drift in ((0.0, 0.0), (0.03, 0.02)):
        r = planner.route_through(s.ice, s.hull, s.start, (400, 0), speed=0.5, extent=s.extent, drift=drift)
        c = tows.candidate("c", "c", r, dataclasses.replace(s, drift=drift))
        done = call("check", s.case, *(w for k, v in c.keys.items() for w in ("--set", f"{k}={v}")))
        assert done.returncode == DONE and "jerks the line" not in done.stdout + done.stderr


def test_each_speed_has_its_own_prediction(tmp_path):
    """That of a plan at that speed alone. Red: every speed has the force, work and faults of the best one."""
    case = write_case(tmp_path, BASIN)
    def told(speeds, **more):
        found = bergtow.route(case, tmp_path / "out", to=(8.5, 0), plan_only=True, routes=1, speeds=speeds,
                              replace=True, **more)
        return {r["speed"]: r for r in found["routes"] if r["kind"] == "straight"}
    both, slow, fast = told([0.1, 0.2]), told([0.1])[0.1], told([0.2])[0.2]
    for one in (slow, fast):
        for key in ("work", "mean_force", "time", "cost", "peak_of_legs"):
            assert both[one["speed"]]["predicted"][key] == pytest.approx(one["predicted"][key], rel=0.01)
    limit = 1.2 * slow["predicted"]["peak_of_legs"]
    assert limit < fast["predicted"]["mean_force"]
    limited = told([0.1, 0.2], force_limit=limit)
    assert [limited[v]["faults"] for v in (0.1, 0.2)] == [[], ["force_limit"]]


def test_every_route_has_every_speed_that_reaches_the_goal(tmp_path):
    """And those that do not are named. Red: a speed below that of the ice refuses all; one hardly above it is towed
    through water beyond the map; a route whose turns do not fit where the goal is without drift is left out without a
    word."""
    write_case(tmp_path, changed(LINE, domain__length=900, water={"current_x": -0.35}))
    done = called("route", "case.yml", "--to", "330,0", "--speeds", "0.3,0.4,0.6,1.2", "--routes", "1", "--plan-only",
                  "-o", "out", cwd=tmp_path)
    assert done.returncode == DONE, done.stderr
    found = json.loads((tmp_path / "out/route.json").read_text())
    assert [(r["kind"], r["speed"]) for r in found["routes"]] == [
        (kind, v) for kind in ("straight", "planned") for v in (0.6, 1.2)]
    assert re.findall("Left out: .*", done.stdout) == [
        "Left out: 0.300 m/s: the goal drifts away from the ice faster than the body is towed; raise the speed.",
        "Left out: 0.400 m/s: the way leaves the domain, which moves with the ice; raise the speed."]
    left = [{"label": "route 1, 1.2 m/s", "kind": "planned", "speed": 1.2, "reason": "the turns do not fit"},
            {"label": "straight line", "kind": "straight", "speed": 0.3, "reason": "another"}]
    assert text_route.unreached({"routes": [{"speed": 1.2}], "unreached": left}) == [
        "Left out: 0.300 m/s: another.", "Left out: route 1, 1.2 m/s: the turns do not fit."]
    s = read_situation(tmp_path, changed(LINE, ice__concentration=0))
    with pytest.raises(BergtowError, match="^the turns do not fit"):
        planner.route_through(s.ice, s.hull, s.start, (330, 0), [(200, 0), (210, 90)], speed=0.5, radius=200,
                              extent=s.extent)


def test_a_faster_tow_does_not_overshoot_a_goal_that_drifts(tmp_path):
    """At twice the speed the goal is met where, in the ice, a corner was before. Red: the tow turns back there."""
    s = read_situation(tmp_path, changed(BASIN, ice__concentration=0, domain__length=200, domain__width=30))
    s = dataclasses.replace(s, drift=(-0.15, 0.0), water=(-0.15, 0.0))
    options = {"drift": s.drift, "water": s.water, "extent": s.extent, "radius": 1.0}
    slow = planner.route_through(s.ice, s.hull, s.start, (30, 0), [(90, 6)], speed=0.2, **options)
    fast = route.at_speed(slow, 0.4, s, None, options)
    ground, wanted = (np.array(r.waypoints[0]) + r.time[np.argmin(np.hypot(r.x - r.waypoints[0][0],
                      r.y - r.waypoints[0][1]))] * np.array(s.drift) for r in (fast, slow))
    assert ground == pytest.approx(wanted, abs=0.1) and np.all(np.abs(fast.heading) < 1)


def test_the_limit_holds_in_every_step(tmp_path):
    """A tow whose force is largest while the body is accelerated. Red: its mean is larger than its peak; the force
    of the ramp passes for one within the limit."""
    s = read_situation(tmp_path, changed(BASIN, ice__concentration=0, tow__speed=0.4))
    r = planner.route_through(s.ice, s.hull, s.start, (8.5, 0), speed=0.4, extent=s.extent)
    c = tows.candidate("c", "c", r, s)
    sets = [w for k, v in c.keys.items() for w in ("--set", f"{k}={v}")]
    assert call("run", s.case, "-o", tmp_path / "run", "--quiet", *sets).returncode == DONE
    with Run(tmp_path / "run") as run_:
        start = s.mass * 0.4 / s.ramp
        out = tows.outcome(run_, c, (8.5, 0), s, 0.9 * start)
        assert out["mean_force"] <= out["peak"] < 0.9 * start < out["largest"] and out["limit_exceeded"]
        assert not tows.outcome(run_, c, (8.5, 0), s, 1.01 * out["largest"])["limit_exceeded"]


def test_positions_do_not_jump_at_the_180th_meridian():
    place = situation.Place(True, tuple(np.radians([180, 70])))
    lon = np.array(output.positions([(0, -300), (0, 0), (0, 300)], place))[:, 0]
    assert np.ptp(lon) < 0.1


def test_a_programme_of_legs_goes_their_way():
    t, v = np.array(tows.programme([(100, 0.5), (80, 0.2), (60, 0.4)], 30)).T
    assert np.sum(np.diff(t) * (v[1:] + v[:-1]) / 2) == pytest.approx(240) and np.all(np.diff(t) > 0)
    assert list(np.unique(v)) == [0, 0.2, 0.4, 0.5]
    t, v = np.transpose(tows.programme([(100, np.nextafter(0.6, 1))], 300, (1208.0, 0.6)))
    assert np.all(np.diff(t) > 0) and set(v) == {0.6}


def test_a_polyline_keeps_within_its_distance():
    a = np.linspace(0, 3, 500)
    xy = np.column_stack([a, np.sin(2 * a)])
    few = tows.simplified(xy, 0.01)
    line = np.vstack([few, few[::-1]])
    assert apart.to_edges(xy, line).max() <= 0.01 and 8 < len(few) < 40
    assert np.array_equal(few[[0, -1]], xy[[0, -1]])


def test_the_goal_is_reached_where_the_body_is_nearest():
    xy = np.column_stack([np.linspace(0, 10, 101), np.full(101, 0.3)])
    assert tows.arrival(xy, (8, 0), 1) == 80
    assert tows.arrival(xy, ((8, -1), (8, 1)), 1) == 80
    assert tows.arrival(xy, (8, 3), 1) is None
    back = np.vstack([xy, xy[::-1]])
    assert tows.arrival(back, (8, 0), 1) == 80  # not on the way back


def test_work_in_open_water_is_known(tmp_path):
    """Drag times the way and the kinetic energy. Red: force and way of different directions or times."""
    case = changed(BASIN, ice__concentration=0, domain__length=40, tow__speed=0.4)
    write_case(tmp_path, case)
    done = called("route", tmp_path / "case.yml", "--to", "22.5,0", "-o", tmp_path / "out", "--members", "1")
    assert done.returncode == DONE, done.stderr
    found = json.loads((tmp_path / "out/route.json").read_text())
    (tow,) = next(r for r in found["routes"] if r["kind"] == "straight")["members"]
    s = read_situation(tmp_path, case)
    assert tow["work"] == pytest.approx(s.hull.drag * 0.4 ** 2 * 20 + s.mass * 0.4 ** 2 / 2, rel=0.02)
    assert tow["time"] == pytest.approx(20 / 0.4 + s.ramp / 2, abs=0.2) and tow["arrived"]
    assert tow["peak"] == pytest.approx(s.hull.drag * 0.4 ** 2, rel=0.02)
    assert found["verdict"]["code"] in ("one_member", "no_route") and found["verdict"]["recommended"] is None


# ---- an honest choice


def made_up(name, values, straight=False, cost=1.0, **more):
    c = SimpleNamespace(name=name, straight=straight, route=SimpleNamespace(faults=(), cost=cost))
    rows = [{"arrived": True, "work": v, "no_go_contact": False, "limit_exceeded": False, "parted": False,
             "slack": False} | more for v in values]
    return c, rows


def judged(*some):
    return verdict.of([c for c, _ in some], {c.name: rows for c, rows in some}, "work")


def test_one_half_chooses_and_the_other_judges():
    straight = made_up("straight", [10] * 4 + [10.0, 11, 12, 13], True)
    good_first = made_up("a", [5] * 4 + [12.0, 12, 12, 15])
    good_last = made_up("b", [9] * 4 + [1.0, 1, 1, 2])
    v = judged(straight, good_first, good_last)
    assert v["chosen"] == "a" and v["code"] == "not_shown" and v["recommended"] is None
    assert v["compared"]["a"]["difference"] == pytest.approx(1.25) and v["judged"] == [5, 6, 7, 8]
    v = judged(straight, made_up("b", [4] * 4 + [1.0, 1, 1, 2]), good_first)
    assert v["chosen"] == v["recommended"] == "b" and v["code"] == "better"
    assert v["compared"]["b"]["difference_95"][1] < 0
    best = judged(straight, made_up("a", [5] * 4 + [12.0, 12, 12, 15], cost=0.9))["planner_best"]
    assert best["lost"] == 3 and not best["straight"]  # 12 > 10, 12 > 11, 15 > 13
    assert judged(straight, made_up("a", [50] * 8, cost=2.0))["planner_best"] == {
        "name": "straight", "members": 8, "straight": True, "lost": 0}


def test_the_best_of_many_that_are_alike_is_seldom_recommended():
    """Red: the members that choose judge, too: then it is a third."""
    rng, n, found, naive = np.random.default_rng(8), 400, 0, 0
    for _ in range(n):
        some = [made_up(f"r{k}", rng.normal(10, 1, 12), k == 0) for k in range(8)]
        found += judged(*some)["recommended"] is not None
        straight = some[0][1]
        naive += any(verdict.shown(verdict.compared(rows, straight, range(12), "work")) for _, rows in some[1:])
    assert found / n < 0.025 + 3 * np.sqrt(0.025 / n) and naive / n > 0.08


@pytest.mark.parametrize("low", [None, float("nan")])
def test_one_pair_gives_no_interval(low):
    """Two members, of which one judges. Red: "– to – at 95 %"."""
    assert text_route.interval({"relative": -0.1, "relative_95": [low, low]}) == "is -10.0 %; one pair has no interval"
    assert text_route.interval({"relative": -0.1, "relative_95": [-0.2, 0.1]}).endswith("-20.0 % to +10.0 % at 95 %")


def test_failures_come_before_the_objective():
    straight = made_up("straight", [10.0, 11, 12, 13] * 4, True)
    lost = made_up("lost", [1.0, 1, 1, 2] * 4, arrived=False)
    v = judged(straight, lost)
    assert v["order"][0] == "straight" and v["code"] == "not_shown"
    limited = made_up("straight", [10.0, 11, 12, 13] * 4, True, limit_exceeded=True)
    v = judged(limited, made_up("a", [20.0, 21, 22, 23] * 4))
    assert v["recommended"] == "a" and v["compared"]["a"]["fails_less"] == 8
    half = [dict(t, limit_exceeded=k % 2 == 0) for k, t in enumerate(made_up("s", [10.0] * 4)[1])]
    few = judged((made_up("straight", [], True)[0], half), made_up("a", [10.0] * 4))
    assert few["recommended"] is None  # one of two may be chance


def test_a_line_that_always_fails_is_none_to_compare_with():
    """Red: "no route shown better" than a line that fails in every member, since few of them show nothing."""
    failing = made_up("straight", [10.0, 11] * 2, True, limit_exceeded=True)
    v = judged(failing, made_up("a", [20.0, 20] * 2))
    assert v["code"] == "better" and v["recommended"] == "a"
    said = text_route.answer({"verdict": v, "objective": "work", "routes": [{"name": "a", "label": "route 1"}]})
    assert said == ("Take route 1: the straight line fails in all 2 evaluation members, and route 1 in none; with "
                    "so few members this may be chance.")
    assert judged(failing, made_up("a", [20.0, 20] * 2, missed=True, arrived=False))["recommended"] is None


def test_the_default_members_can_show_fewer_failures():
    """Red: ten, of which five judge: five of five are 0.031."""
    c = verdict.compared(*(made_up("a", [1.0] * route.MEMBERS, limit_exceeded=over)[1] for over in (False, True)),
                         verdict.halves(route.MEMBERS)[1], "work")
    assert verdict.shown(c)


# ---- the command


def test_what_a_call_leaves(routed):
    found, out = routed.found, routed.out
    assert found["status"] in ("ok", "fewer_routes") and found["verdict"]["members"] == 4
    assert found["routes"][0]["name"] == "straight" and len(found["routes"]) >= 2
    for r in found["routes"]:
        assert len(r["members"]) == 4 and all(t["arrived"] for t in r["members"])
        assert r["simulated"]["length"] == pytest.approx(r["predicted"]["length"], rel=0.05)
    map_ = json.loads((out / "routes.geojson").read_text())
    assert map_["crs"]["properties"]["name"] == _library.limit("map_local_crs")
    kinds = [(f["properties"]["route"], f["properties"]["track"]) for f in map_["features"]]
    assert kinds[:2] == [("straight", "berg"), ("straight", "swath")]
    line = map_["features"][0]["geometry"]["coordinates"]
    assert line[0] == pytest.approx([2.5, 0]) and line[-1] == pytest.approx([8.5, 0.3])
    assert not (out / "routes.gpx").exists() and "<iframe" in (out / "route.html").read_text()
    assert "No route shown better" in routed.said or "Take route" in routed.said


def test_a_force_limit_is_compared_with_the_force_that_is_shown(routed):
    """Red: the table shows a percentile below the limit, and that the limit is exceeded."""
    told = text_route.verified(routed.found | {"force_limit": 1.0})
    for r in routed.found["routes"]:
        decides = text_route.amount(max(t["largest"] for t in r["members"]), "N")
        assert decides in next(row for row in told.splitlines() if row.startswith(r["label"]))
    assert "largest force" in told and "largest force" not in routed.said and "99th percentile" in routed.said


def test_every_route_is_towed_through_the_same_ice(routed):
    fields = {}
    for path in (routed.out / "route").glob("*/members/*/case.resolved.yml"):
        text = path.read_text()
        fields.setdefault(path.parent.name, set()).add((re.search(r"field: (.*?)(?:  #|\n)", text)[1],
                                                        *re.findall(r"current_[xy]: (\S+)", text)))
    assert len(fields) == 4 and all(len(f) == 1 for f in fields.values())
    assert len({tuple(f)[0][1:] for f in fields.values()}) == 4  # drifts of their own


def test_a_route_is_a_case(routed, tmp_path):
    """The file of a route leads to the very tow, in the ice of the map."""
    done = called("route", routed.folder / "case.yml", *QUICK[:3], "1", "--members", "1", "-o", tmp_path / "out")
    assert done.returncode == DONE, done.stderr
    for r in json.loads((tmp_path / "out/route.json").read_text())["routes"]:
        assert call("run", tmp_path / "out" / r["case"], "-o", tmp_path / r["name"], "--quiet").returncode == DONE
        assert json.loads((tmp_path / r["name"] / "summary.json").read_text())["state_hash"] == r["members"][0]["hash"]


def without_clocks(found):
    found = {k: v for k, v in found.items() if k != "estimate_by_tow_s"}
    return json.loads(re.sub(r'"(plan_s|tows_s|estimate_s|wall_s)": [\d.e+-]+', r'"\1": 0', json.dumps(found)))


def test_what_is_killed_goes_on(routed, tmp_path):
    """Red: nothing is written before the end; the tows are made again; the verdict is another one."""
    write_case(tmp_path, BASIN)
    out = tmp_path / "out"
    words = [sys.executable, "-m", "bergtow", "route", str(tmp_path / "case.yml"), *QUICK, "-o", str(out)]
    env = environment(BERGTOW=BERGTOW, PYTHONPATH=ROOT / "postproc")
    process = subprocess.Popen(words, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               preexec_fn=heard)
    while process.poll() is None and len(list(out.glob("route/*/members/*/finished"))) < 3:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    process.communicate()
    assert process.returncode == SIGNAL
    for name in ("route.json", "routes.geojson", "straight.yml", "route.png"):
        assert (out / name).exists(), name
    kept = {p: p.stat().st_mtime_ns for p in out.glob("route/*/members/*/finished")}
    assert 3 <= len(kept) < 4 * len(routed.found["routes"])
    assert json.loads((out / "route.json").read_text())["verdict"] is None
    again = called("route", tmp_path / "case.yml", *QUICK, "-o", out)
    assert again.returncode == DONE, again.stderr
    assert all(p.stat().st_mtime_ns == t for p, t in kept.items())
    assert without_clocks(json.loads((out / "route.json").read_text())) == without_clocks(routed.found)


def test_a_folder_that_has_moved_keeps_its_tows(tmp_path):
    """Red: the members' ice has absolute paths, so that the tows are other ones, and are made again."""
    write_case(tmp_path, BASIN)
    call = ["route", tmp_path / "case.yml", "--to", "8.5,0.3", "--routes", "1", "--members", "2", "--no-page", "-o"]
    assert called(*call, tmp_path / "a").returncode == DONE
    (tmp_path / "a").rename(tmp_path / "b")
    kept = {p: p.stat().st_mtime_ns for p in (tmp_path / "b").glob("route/*/members/*/finished")}
    again = called(*call, tmp_path / "b")
    assert again.returncode == DONE and "renamed" not in again.stderr and "study.files" not in again.stderr
    assert "records what it held" not in again.stderr
    assert len(kept) == 4 and all(p.stat().st_mtime_ns == t for p, t in kept.items())
    study = (tmp_path / "b/route/straight/study.resolved.yml").read_text()
    assert "ice.field=route/members/m001.h5" in study


def test_a_place_gives_degrees_and_a_gpx(tmp_path):
    """Red: latitude first; the points of the body in place of the vessel's."""
    case = {"run": {"dt": 5, "duration": 100}, "domain": {"frame": "geographic", "length": 4000, "width": 1500,
                                                          "ends": "open", "sides": "open"},
            "ice": {"concentration": 0.1, "size": 60, "thickness": 1, "origin_lon": 20, "origin_lat": 76.5},
            "body": {"length": 80, "draft": 60, "x": -1500, "y": 0},
            "tow": {"mode": "line", "speed": 0.5, "line_length": 300, "line_stiffness": "40 MN"}}
    place = situation.Place(True, tuple(np.radians([20, 76.5])))
    (lon, lat), = place.degrees([(500, 100)])
    done = called("route", write_case(tmp_path, case), "--to", f"{lon:.8f}E,{lat:.8f}N", "--plan-only", "--routes", "1",
                  "-o", tmp_path / "out")
    assert done.returncode == DONE, done.stderr
    found = json.loads((tmp_path / "out/route.json").read_text())
    assert found["goal"] == pytest.approx([500, 100], abs=0.01) and found["verdict"] is None
    points = [(float(p.get("lon")), float(p.get("lat"))) for p in ElementTree.parse(
        tmp_path / "out/routes.gpx").getroot().find("{*}rte").findall("{*}rtept")]
    assert np.hypot(*(place.metres(points[:1])[0] - (-1500, 0))) == pytest.approx(340, rel=0.01)  # and at the start
    end = place.metres(points[-1:])[0]
    assert np.hypot(*(end - (500, 100))) == pytest.approx(340, rel=0.01)  # a line ahead of the goal
    map_ = json.loads((tmp_path / "out/routes.geojson").read_text())
    assert "crs" not in map_ and {f["properties"]["track"] for f in map_["features"]} == {"berg", "tug", "swath"}
    assert map_["features"][0]["geometry"]["coordinates"][-1] == pytest.approx([lon, lat], abs=1e-6)
    assert not list((tmp_path / "out/route").glob("*/members"))


def test_a_new_look_leaves_the_way_so_far(tmp_path):
    """The tow up to a look is that of the looks before, to the bit; a look sees the pieces of floes that have split.
    Red: the way that is decided moves; floes that are no longer there."""
    write_case(tmp_path, changed(BASIN, ice__crushing={"pressure": 1e5}, ice__splitting={
        "toughness": 100.0, "strength": 200.0, "least_size": 0.1}))
    done = called("route", tmp_path / "case.yml", "--to", "8.5,0.3", "--routes", "1", "--members", "1", "--replan",
                  "12 s", "-o", tmp_path / "out")
    assert done.returncode == DONE, done.stderr
    found = json.loads((tmp_path / "out/route.json").read_text())
    assert found["horizon"]["perfect"] and "upper bound" in done.stdout and len(found["rounds"]) >= 3
    assert (tmp_path / "out/round-1.json").exists()
    series = []
    for name in ("look-1", "look-2", "tow-horizon"):
        with Run(tmp_path / "out/route" / name / "members/c001-r001") as r:
            series.append(np.column_stack([r["body_x"], r["body_y"], r["ice_resistance"], r["kinetic_energy"]]))
            assert r.n_pieces > 0
    for early, late in zip(series, series[1:]):
        assert np.array_equal(early, late[:len(early)])
    assert all(t["arrived"] for t in found["horizon"]["tows"].values())


#: a small berg on a line; a shoal on the straight way
LINE = {"run": {"dt": 4, "duration": 800}, "domain": {"frame": "geographic", "length": 560, "width": 480, "x0": 0,
                                                      "ends": "open", "sides": "open"},
        "ice": {"concentration": 0.35, "size": 25, "thickness": 0.6, "seed": 3},
        "body": {"length": 40, "draft": 25, "x": 90, "y": 0},
        "tow": {"mode": "line", "speed": 0.5, "line_length": 60, "line_stiffness": "20 MN", "ramp": 100}}
LOOKS = ("--to", "400,0", "--clearance", "12 m", "--routes", "1", "--replan", "150 s", "--map-age", "50 s",
         "--map-error", "4 m", "--members", "2", "--no-go", "shoal.geojson")


def towed_on_a_line(folder):
    folder.mkdir()
    write_case(folder, LINE)
    shoal = {"type": "Polygon", "coordinates": [[[-60, 250], [-5, 250], [-5, 270], [-60, 270], [-60, 250]]]}
    (folder / "shoal.geojson").write_text(json.dumps(local(shoal)))
    return folder


def test_a_look_at_drifting_ice(tmp_path):
    """Red: at the look, rounding is a change of speed that takes no time."""
    write_case(tmp_path, changed(LINE, water={"current_x": 0.1}, tow={"mode": "speed", "speed": 0.5}))
    done = called("route", "case.yml", "--to", "430,0", "--routes", "1", "--replan", "300 s", "--members", "1", "-o",
                  "out", cwd=tmp_path)
    assert done.returncode == DONE, done.stderr
    found = json.loads((tmp_path / "out/route.json").read_text())
    assert found["drift"][0] > 0.05 and len(found["rounds"]) == 2
    assert all(t["arrived"] for t in found["horizon"]["tows"].values())


@pytest.mark.parametrize("aside", [0.0, 12.0, 60.0])
def test_a_new_plan_that_starts_beside_the_end_of_the_old(aside):
    """As that of a line which leads inwards: the way to it has no jump in speed. Red: from a tenth of a width on, two
    points of the programme at one time, and a speed that is no number."""
    x = np.linspace(0, 600, 61)
    plan = SimpleNamespace(x=x, y=np.full(61, aside), time=x / 0.5)
    s = SimpleNamespace(mode="speed", drift=(0.0, 0.02), hull=SimpleNamespace(width=100.0), ramp=60.0,
                        values={"run.dt": 4.0})
    old = horizon.Way(np.array([[-300.0, 0], [0, 0]]), [(0.0, 0.0), (600.0, 0.5)])
    way = horizon.way_of(plan, s, old)
    times, speeds = np.transpose(way.pace)
    assert np.isfinite(way.points).all() and np.all(np.diff(times) > 0) and speeds[2:].max() < 0.6
    short = SimpleNamespace(x=x[[0, 1]], y=plan.y[[0, 1]], time=plan.time[[0, 1]])
    assert np.isfinite(horizon.way_of(short, s, old).pace).all()


def test_looks_across_a_current(tmp_path):
    """Red: a traceback, or a way-point that is no number."""
    write_case(tmp_path, changed(LINE, water={"current_x": 0.02, "current_y": -0.1}, tow=LINE["tow"] | {
        "line_length": 120}))
    done = called("route", "case.yml", "--to", "400,0", "--routes", "1", "--replan", "150 s", "--members", "1", "-o",
                  "out", cwd=tmp_path)
    assert done.returncode == DONE, done.stderr
    found = json.loads((tmp_path / "out/route.json").read_text())
    assert len(found["rounds"]) >= 3 and {*found["horizon"]["tows"]} == {"horizon", "once", "straight"}


def test_looks_from_a_line(tmp_path):
    """Round a shoal, with a map of some age and errors; killed between looks, the same call ends as if it had not been.
    Red: what is decided is the way of the body; looks are drawn anew; the tow through the shoal counts as one."""
    whole, killed = towed_on_a_line(tmp_path / "whole"), towed_on_a_line(tmp_path / "killed")
    done = called("route", "case.yml", *LOOKS, "-o", "out", cwd=whole)
    assert done.returncode == DONE, done.stderr
    found = json.loads((whole / "out/route.json").read_text())
    towed = found["horizon"]["tows"]
    assert len(found["rounds"]) >= 4 and not found["horizon"]["perfect"] and "upper bound" not in done.stdout
    assert towed["horizon"]["arrived"] and "no_go_contact" not in towed["horizon"]["faults"]
    assert "no_go_contact" in towed["straight"]["faults"]
    assert re.search("straight line: [^;]*touches a no-go area", done.stdout)
    series = []
    for name in ("look-1", "look-2", "look-3", "tow-horizon"):
        with Run(whole / "out/route" / name / "members/c001-r001") as r:
            series.append(np.column_stack([r["body_x"], r["body_y"], r["line_tension"]]))
    for early, late in zip(series, series[1:]):
        assert np.array_equal(early, late[:len(early)])
    env = environment(BERGTOW=BERGTOW, PYTHONPATH=ROOT / "postproc")
    process = subprocess.Popen([sys.executable, "-m", "bergtow", "route", "case.yml", *LOOKS, "-o", "out"], env=env,
                               cwd=killed, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while process.poll() is None and not (killed / "out/route/look-2/members/c001-r001/finished").exists():
        time.sleep(0.02)
    process.kill()
    process.wait()
    assert not (killed / "out/horizon.yml").exists()
    while "another run is using" in (again := called("route", "case.yml", *LOOKS, "-o", "out", cwd=killed)).stderr:
        time.sleep(0.1)  # the program still writes the ensemble of the last look
    assert again.returncode == DONE, again.stderr
    other = json.loads((killed / "out/route.json").read_text())
    assert other["rounds"] == found["rounds"]
    assert [t["hash"] for t in other["horizon"]["tows"].values()] == [t["hash"] for t in towed.values()]


def test_a_line_that_parts_ends_the_looks(tmp_path):
    """Red: the rest is planned from where no body is."""
    write_case(tmp_path, changed(LINE, tow=LINE["tow"] | {"line": {"breaking_load": "20 kN"}}))
    done = called("route", "case.yml", "--to", "400,0", "--routes", "1", "--replan", "150 s", "--members", "1", "-o",
                  "out", cwd=tmp_path)
    assert done.returncode == DONE, done.stderr
    found = json.loads((tmp_path / "out/route.json").read_text())
    assert len(found["rounds"]) == 1 and {"missed", "parted"} <= {*found["horizon"]["tows"]["horizon"]["faults"]}


def test_a_spent_budget_of_looks_is_that_of_tows():
    """Red: exit code 4, as if a file could not be written."""
    runs = SimpleNamespace(make=lambda name, some, keys: [horizon.SPENT])
    h = horizon.Horizon(SimpleNamespace(budget=1), {"speeds": [0.5]}, SimpleNamespace(values={"run.dt": 1.0}), None,
                        runs, SimpleNamespace(folder="out"), {})
    with pytest.raises(RunError, match="the budget of 1 min is spent") as caught:
        h.tow("look-1", horizon.Way(np.zeros((2, 2)), [(0.0, 0.5)]), 10.0)
    assert caught.value.status == SIGNAL


def test_the_estimate_of_looks():
    """Against a sum: tows of a second for each second of theirs, up to 300 and 600 of 700 s, a second more for frames,
    and plans of 0.5 s. Red: looks that are as long as the tow; the last look at its end."""
    c = SimpleNamespace(route=SimpleNamespace(duration=700.0), seconds=800.0)
    assert horizon.estimate(c, 300.0, (801.0, 800.0, None), 0.5) == (2, 300 + 600 + 2 * 1.5 + 3 * 801)
    assert horizon.estimate(c, 700.0, (801.0, 800.0, None), 0.5) == (0, 3 * 801)


def test_the_estimate_of_the_tows(monkeypatch):
    """Of `bergtow check`: 3 s of the tow that keeps frames, 2 s of another; by a clock that goes twice as slow, twice
    as much. Red: the tow with frames stands for the others; one at a time stands for several."""
    def candidate(seconds):
        return SimpleNamespace(name="straight", seconds=seconds, keys={})
    some = [candidate(100.0), candidate(150.0)]
    class Values(dict):
        path = "case.yml"
    s = SimpleNamespace(values=Values({"ice.outlines": "", "ice.field": "ice.h5"}), field="ice.h5", case="case.yml")
    runs = SimpleNamespace(program="bergtow", jobs=2, sets=lambda i, keys: [i])
    monkeypatch.setattr(route, "checked", lambda program, case, sets, words: json.dumps(
        {"cost": {"core_time_s": 3 - sets[0]}, "warnings": [sets[0]]}))
    warned, told = route.estimate(runs, s, some, 5)
    assert warned == [0] and told == (3, 2, 2.5 * (3 * 2 + 0.5))

    def by_tows(*lines):
        """lines: wall times of the tows that are finished at each line of the program, {tow: s}."""
        found, here = {}, {}
        monkeypatch.setattr(route, "state_of", lambda i: (route.FINISHED if i in here else 0, 0, None))
        monkeypatch.setattr(route, "Run", lambda i: contextlib.nullcontext(
            SimpleNamespace(number={"wall_time_s": here[i]}.get)))
        line = route.first_tow(found, told, range(5))
        for now in lines:
            here |= now
            line("in any words")
        return found.get("estimate_by_tow_s")
    assert by_tows({}, {}) is None and by_tows({0: 7, 1: 3}, {}) is None  # those were there before
    assert by_tows({1: 1}, {2: 4}, {0: 9}) == by_tows({}, {0: 6}) == pytest.approx(2 * told[-1])


def test_the_function_is_the_command(routed, tmp_path):
    found = bergtow.route(routed.folder / "case.yml", tmp_path / "out", to=(8.5, 0.3), from_=(2.5, 0), routes=2,
                          plan_only=True, speeds=[0.13])
    for mine, theirs in zip(found["routes"], routed.found["routes"]):
        assert mine["waypoints"] == theirs["waypoints"] and mine["predicted"] == theirs["predicted"]
    line = bergtow.route(routed.folder / "case.yml", tmp_path / "line", to=((8.5, -0.5), (8.5, 0.5)), plan_only=True)
    assert line["goal"] == [[8.5, -0.5], [8.5, 0.5]] and line["routes"][0]["predicted"]["length"] <= 6.0001


def test_at_a_look_the_straight_line_may_turn_a_little():
    """By half a step of the headings. Red: a plan of which the straight line is all is none, or any corner will do."""
    def straight(heading, *faults):
        return SimpleNamespace(faults=faults, cost=1.0, heading=np.array([heading]))
    def found(r, *at):
        return horizon.best(SimpleNamespace(routes=[r]), *at)
    little, far, land = straight(0.05, "turns"), straight(0.2, "turns"), straight(0.0, "turns", "no_go")
    assert found(little, 2 * np.pi, 32) is little and found(far, 0.0, 32) is None and found(land, 0.0, 32) is None
    assert found(far, 0.15, 32) is far and found(little) is None


# ---- wrong use


LAND = {"type": "Polygon", "coordinates": [[[7, -1], [9.5, -1], [9.5, 1], [7, 1], [7, -1]]]}


def local(geometry):
    return {"type": "FeatureCollection",
            "crs": {"type": "name", "properties": {"name": _library.limit("map_local_crs")}},
            "features": [{"type": "Feature", "properties": {}, "geometry": geometry}]}


@pytest.mark.parametrize("changes, words, code, said", [
    ({}, ["--to", "8.5,0", "--no-go", "land.geojson"], CASE,
     r"--to: the goal lies in a no-go area.* \(x 8.5 m, y 0 m, polygon 1, needed .* m\)"),
    ({}, ["--to", "3,0", "--no-go", "near.geojson", "--from", "8.5,0"], CASE, "--from: .* no-go area"),
    ({}, ["--to", "20E,76N"], USAGE, "in degrees, but the map of this case has no place; set ice.origin_lon"),
    ({}, ["--to", "8.5,0", "--no-go", "degrees.geojson"], CASE, "the map of this case has none"),
    ({}, ["--to", "8.5,0", "--no-go", "text.geojson"], CASE, "is not a map that GDAL can read"),
    ({}, ["--to", "8.5,0", "--no-go", "barrier.geojson"], CASE, "--to: no way leads from the start to the goal"),
    ({}, ["--to", "8.5,0", "--no-go", "list.geojson"], CASE, "is not a map that GDAL can read"),
    ({}, ["--to", "50,0"], CASE, "--to: the goal lies outside the domain"),
    ({}, ["--to", "2.5,0"], CASE, "--to 2.5,0: is reached at the start of the tow"),
    ({}, ["--to", "3,0.1"], CASE, "--to 3,0.1: is reached at the start of the tow"),
    ({}, ["--to", "nan,0"], USAGE, "--to: nan: "),
    ({}, ["--to", "8.5,0", "--no-go", "empty.geojson"], CASE, "holds no features"),
    ({}, ["--to", "8.5,0", "--no-go", "flat.geojson"], CASE, "polygon 2 has no area"),
    ({}, ["--to", "8.5,0", "--no-go", "nan.geojson"], CASE, "feature 0 has a vertex that is not a finite number"),
    ({}, ["--to", "8.5,0", "--no-go", "nowhere.geojson"], CASE, "holds no polygons"),
    ({}, ["--to", "8.5,0", "--routes", "17"], USAGE, "not a whole number from 1 to 16"),
    ({}, ["--to", "8.5,0", "--replan", "10 s", "--speeds", "0.1,0.2"], USAGE, "one speed"),
    ({}, ["--to", "8.5,0", "--replan", "10 s", "--map-age", "11 s"], USAGE, "--map-age"),
    ({}, ["--to", "8.5,0", "--width", "1e-3"], USAGE, r"\(--width\)"),
    ({}, ["--to", "8.5,0", "--force-limit", "1e-3"], CASE, "takes more than --force-limit"),
    ({}, ["--to", "8.5,0", "--map", "map.shp"], USAGE, "bergtow outlines"),
    ({}, ["--to", "8.5,0", "--speeds", "0"], USAGE, "is not above zero"),
    ({}, ["--to", "8.5,0", "--speeds", "0.1,,0.2"], USAGE, "--speeds: a number is missing"),
    ({}, ["--to", "8.5,"], USAGE, "--to: a number is missing"),
    ({"tow": {"mode": "none", "speed": 0}}, ["--to", "8.5,0"], CASE, "nothing is towed"),
    ({"domain__ends": "moving"}, ["--to", "8.5,0"], CASE, "domain.ends"),
    ({}, ["--to", "8.5,0", "--calibrate", "2"], USAGE, "too few swaths"),
])
def test_wrong_use_is_said(tmp_path, changes, words, code, said):
    write_case(tmp_path, changed(BASIN, **changes))
    near = np.array(LAND["coordinates"]) - [0.5, 0]
    barrier = [[[5, -9], [5.5, -9], [5.5, 9], [5, 9], [5, -9]]]
    files = {"land": local(LAND), "degrees": LAND, "near": local(LAND | {"coordinates": near.tolist()}),
             "barrier": local(LAND | {"coordinates": barrier}), "empty": local(LAND) | {"features": []},
             "nan": local(LAND | {"coordinates": [[[0, 0], [1, np.nan], [1, 1], [0, 0]]]}),
             "flat": local(LAND | {"type": "MultiPolygon", "coordinates": [
                 LAND["coordinates"], [[[0, 1], [1, 2], [2, 3], [0, 1]]]]}), "nowhere": local(None), "list": [1]}
    for name, what in files.items():
        (tmp_path / f"{name}.geojson").write_text(json.dumps(what))
    (tmp_path / "text.geojson").write_text("x")
    (tmp_path / "map.shp").write_text("x")
    done = called("route", "case.yml", *words, "--members", "1", "-o", "out", cwd=tmp_path)
    assert done.returncode == code, (done.stdout, done.stderr)
    assert re.search(said, done.stderr), done.stderr
    assert "Traceback" not in done.stderr


HERE = situation.Place(True, tuple(np.radians([20, 76.5])))
ZONE = [[19.9995, 76.5012], [20.0035, 76.5012], [20.0035, 76.502], [19.9995, 76.502], [19.9995, 76.5012]]


def no_go(folder, ring, crs=None, place=HERE):
    """Polygons of a no-go file of one ring."""
    (folder / "zone.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [np.array(ring).tolist()]}}
    ]} | ({"crs": {"type": "name", "properties": {"name": crs}}} if crs else {})))
    return [piece for pieces in situation.no_go_file(folder / "zone.geojson", place) for piece in pieces]


def polar(ring):
    return np.column_stack(pyproj.Transformer.from_crs("OGC:CRS84", "EPSG:3413", always_xy=True).transform(
        *np.array(ring).T))


def test_no_go_areas_are_read_as_outlines_are(tmp_path):
    """Red: metres and latitude first are taken for places far away, without a word."""
    wanted = HERE.metres(ZONE[:-1])
    for ring, crs in (ZONE, None), (polar(ZONE), "EPSG:3413"):
        found, = no_go(tmp_path, ring, crs)
        assert len(found) == len(wanted) and apart.to_edges(found, wanted).max() < 1e-2
    west = situation.Place(True, tuple(np.radians([-20, 76.5])))
    found, = no_go(tmp_path, np.array(ZONE) + [320, 0], None, west)  # longitudes from 0 to 360
    assert len(found) == len(wanted) and apart.to_edges(found, wanted).max() < 1e-3
    for ring in np.array(ZONE)[:, ::-1], polar(ZONE):
        with pytest.raises(RunError):
            no_go(tmp_path, ring)


def test_edges_of_no_go_areas_are_straight_on_their_map(tmp_path):
    """A zone bounded by parallels. Red: chords, 1 km off over four degrees of longitude."""
    def zone(n, half):
        lon = np.linspace(20 - half, 20 + half, n)
        south, north = (np.column_stack([lon, np.full(n, lat)]) for lat in (76.5014, 76.5018))
        return [*south, *north[::-1], south[0]]
    for half in 2, 45:
        (coarse,), (fine,) = no_go(tmp_path, zone(2, half)), no_go(tmp_path, zone(20001, half))
        assert apart.to_edges(fine[::50], coarse).max() < 2 and len(coarse) < 3000
        assert np.abs(apart.to_edges(np.zeros((1, 2)), coarse) - 156.2) < 1


def test_land_about_the_antipode_is_not_about_the_case(tmp_path):
    """Red: Antarctica, in a file of all land, holds an Arctic case."""
    def cap(lat, pole):
        return [[-180, lat], [0, lat], [180, lat], [180, pole], [-180, pole], [-180, lat]]
    assert no_go(tmp_path, cap(-65, -90)) == []
    arctic, = no_go(tmp_path, cap(65, 90))
    assert apart.inside(np.zeros((1, 2)), arctic)[0]
    # a continent that holds the antipode and comes nearer than a quarter of the earth
    eurasia = [[-10, 36], [30, 70], [100, 78], [180, 68], [140, 40], [105, 0], [75, 10], [50, 15], [20, -35], [-10, 36]]
    weddell, prydz = (situation.Place(True, tuple(np.radians(at))) for at in ((-45, -65), (-60, -67)))
    assert no_go(tmp_path, eurasia, place=weddell) == [] and no_go(tmp_path, eurasia, place=prydz) == []


def test_no_go_areas_around_a_pole(tmp_path):
    """Red: a ring around the pole has no area on a map of degrees."""
    near = situation.Place(True, tuple(np.radians([0, 89.9])))
    ring = [[0, 88], [90, 88], [180, 88], [-90, 88], [0, 88]]
    found, = no_go(tmp_path, ring, place=near)
    at = near.metres([[lon, lat] for lon in (45, 200, -80) for lat in (89.9, 88.6, 86.9)])
    assert apart.inside(at, found).tolist() == [True, True, False] * 3


def test_a_no_go_file_of_all_land_is_not_taken_for_swapped(tmp_path):
    """Mumbai mirrors 19 E 72.8 N. Red: one vertex on the map with latitude first refuses the file."""
    case = situation.Place(True, tuple(np.radians([19, 72.8])))
    assert no_go(tmp_path, [[72.8, 19], [80, 10], [78, 30], [72.8, 19]], place=case) == []


def test_a_plan_tells_of_its_no_go_files_and_warnings(tmp_path):
    """Red: nobody sees that a file lies elsewhere, or what `bergtow check` says of the map."""
    case = ROOT / "cases/route/map.yml"
    for name, ring in ("here", ZONE), ("south", np.array(ZONE) * [1, -1]):
        no_go(tmp_path, ring)
        (tmp_path / "zone.geojson").rename(tmp_path / f"{name}.geojson")
    done = called("route", case, "--to", "20.003E,76.5032N", "--no-go", "here.geojson", "--no-go", "south.geojson",
                  "--set", "water.latitude=10", "--plan-only", "--routes", "1", "-o", "out", cwd=tmp_path)
    assert done.returncode == DONE, done.stderr
    found = json.loads((tmp_path / "out/route.json").read_text())
    assert found["no_go"] == [{"file": f"{name}.geojson", "polygons": 1, "in_domain": n}
                              for name, n in (("here", 1), ("south", 0))]
    assert {w["code"] for w in found["warnings"]} >= {"no_go_elsewhere", "other_latitude"}
    assert all(w["text"] in done.stdout and w["text"] in text_route.text(found) for w in found["warnings"])
    assert found["routes"][0]["faults"] == ["no_go"] and found["routes"][1]["faults"] == []


@pytest.mark.parametrize("crs, key", [("EPSG:3413", "file"), (None, "plane")])
def test_routes_through_outlines_in_metres(tmp_path, crs, key):
    """Red: the origin of the outlines is refused where a tow reads their field."""
    at = np.array([1331319.73, -620804.59]) if crs else np.array([5e3, 7e3])
    ring = at + [[50, 20], [60, 20], [55, 30], [50, 20]]
    (tmp_path / "map.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring.tolist()]}}]} | (
        {"crs": {"type": "name", "properties": {"name": crs}}} if crs else {})))
    case = {"run": {"dt": 0.5, "duration": 30}, "domain": {"frame": "basin", "x0": -200, "length": 600, "width": 400,
                                                           "ends": "open", "sides": "open"},
            "ice": {"outlines": "map.geojson", "outlines_crs": key, "thickness": 1, "origin_east": at[0],
                    "origin_north": at[1]},
            "body": {"shape": "disc", "length": 10, "draft": 5}, "tow": {"mode": "speed", "speed": 0.5}}
    s = read_situation(tmp_path, case)
    assert s.place.crs == (crs or "") and np.allclose(s.ice.outlines[0].mean(axis=0), [55, 70 / 3])
    case = Case(tmp_path / "case.yml", situation.reading(s.values, s.field))
    with bergtow.Simulation(case, threads=1) as sim:
        assert sim.n_bodies == 2


def test_a_route_off_the_map_is_told(tmp_path):
    """Around a map of three by three floes in the middle of the domain. Red: what lies beside the map was taken for
    open water, and the way through it was recommended without a word."""
    corners = np.array([[x, y] for x in (4, 5.2, 6.4) for y in (-1.7, -0.5, 0.7)])[:, None]
    rings = corners + [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]
    (tmp_path / "map.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [r.tolist()]}}
        for r in rings]}))
    case = changed(BASIN, domain__sides="open", domain__width=12, domain__length=20, ice={
        "outlines": "map.geojson", "outlines_crs": "plane", "thickness": 0.05})
    write_case(tmp_path, case)
    done = called("route", "case.yml", "--to", "13,0", "--routes", "1", "--members", "1", "-o", "out", cwd=tmp_path)
    assert done.returncode == DONE, done.stderr
    found = json.loads((tmp_path / "out/route.json").read_text())
    straight, around = found["routes"]
    assert straight["predicted"]["off_map"] == pytest.approx(10.5 - 3.4, abs=0.2)  # the map is 3.4 m long
    assert around["predicted"]["off_map"] > 0.9 * around["predicted"]["length"]
    assert "map_ends" in {w["code"] for w in found["warnings"]}
    for remark in (text_route.off_map(r)[0] for r in found["routes"]):
        assert remark in text_route.plan(found) and remark in text_route.verified(found)
    assert text_route.answer(found) != text_route.decision(found)
    assert read_situation(tmp_path, BASIN).known is None  # ice that is made has no end of which nothing is known


def test_land_beside_the_line_is_passed(tmp_path):
    """The straight line crosses a shoal: the route goes round it, in the tow, too."""
    write_case(tmp_path, changed(BASIN, ice__concentration=0.05))
    shoal = {"type": "Polygon", "coordinates": [[[5, -0.7], [6, -0.7], [6, 0.4], [5, 0.4], [5, -0.7]]]}
    (tmp_path / "shoal.geojson").write_text(json.dumps(local(shoal)))
    done = called("route", "case.yml", "--to", "9.5,0", "--no-go", "shoal.geojson", "--members", "1", "--routes", "1",
                  "--clearance", "0.1", "-o", "out", cwd=tmp_path)
    assert done.returncode == DONE, done.stderr
    found = json.loads((tmp_path / "out/route.json").read_text())
    straight, route = found["routes"]
    assert straight["faults"] == ["no_go"] and straight["counts"]["no_go_contact"] == 1
    assert route["counts"]["no_go_contact"] == 0 and found["verdict"]["code"] == "straight_not_passable"
    assert found["verdict"]["recommended"] == route["name"]


def test_the_fit_says_how_well_it_ranks(tmp_path):
    write_case(tmp_path, BASIN)
    done = called("route", "case.yml", "--to", "8.5,0", "--calibrate", "6", "--members", "1", "--routes", "1", "-o",
                  "out", cwd=tmp_path)
    assert done.returncode == DONE, done.stderr
    told = json.loads((tmp_path / "out/route.json").read_text())["calibration"]
    assert told["swaths"] == 6 and set(told["weights"]) == {"water", "plough", "compaction", "large", "rafting"}
    assert min(told["weights"].values()) >= 0 and told["poor"] == (not (told["rank_correlation"] or -1) >= 0.5)
    assert ("ranks this ice poorly" in done.stdout) == told["poor"]
