# SPDX-License-Identifier: MIT
"""frames.xdmf and summary.json of the made-up run of tests/made_up_run.h, read with the standard parsers."""
import json
import os
import re
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import h5py
import numpy as np
import pytest
from harness import BERGTOW, ROOT, TOW, changed, differing, environment, launcher, make, write_case

PROGRAM = Path("build") / os.environ.get("CONFIG", "release") / "tests/unit/test_record"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    make(PROGRAM)
    folder = tmp_path_factory.mktemp("run")
    done = subprocess.run([ROOT / PROGRAM, "write", folder], check=True, stdout=subprocess.PIPE, text=True,
                          errors="replace")
    (folder / "table.txt").write_text(done.stdout, encoding="utf-8")
    return folder


def dimensions(item):
    return tuple(int(n) for n in item.get("Dimensions").split())


def load(item, folder):
    """The array a DataItem stands for, its size and type checked against what it says."""
    if item.get("Format") == "XML":
        kind = {"Float": float, "Int": int}[item.get("NumberType")]
        return np.array([kind(word) for word in item.text.split()]).reshape(dimensions(item))
    assert item.get("Format") == "HDF"
    path, name = item.text.strip().split(":")
    with h5py.File(folder / path, "r") as file:
        data = file[name]
        assert data.shape == dimensions(item)
        kind = {"Float": "f", "Int": "i"}[item.get("NumberType")]
        assert (data.dtype.kind, data.dtype.itemsize) == (kind, int(item.get("Precision")))
        return data[()]


def polygons(topology, points, folder):
    """The polygons of a mixed topology: type 3, number of vertices, vertices."""
    numbers, found, at = load(topology.find("DataItem"), folder), [], 0
    while at < len(numbers):
        assert numbers[at] == 3
        n = numbers[at + 1]
        found.append(points[numbers[at + 2:at + 2 + n]])
        at += 2 + n
    assert len(found) == int(topology.get("NumberOfElements"))
    return found


def placed(group, poses):
    vertices, offsets = group["vertices"][()], group["offsets"][()]
    for i, (x, y, yaw) in enumerate(poses):
        c, s = np.cos(yaw), np.sin(yaw)
        yield vertices[offsets[i]:offsets[i + 1]] @ np.array([[c, s], [-s, c]]) + (x, y)


def test_xdmf_describes_the_frames(run):
    with h5py.File(run / "result.h5", "r") as file:
        frames = {name: data[()] for name, data in file["frames"].items()}
        thickness, height, towed = (file[n][()] for n in ("floes/thickness", "bodies/height", "bodies/towed"))
        floes = [list(placed(file["floes"], poses)) for poses in frames["pose"]]
        bodies = [list(placed(file["bodies"], poses)) for poses in frames["body_pose"]]
    collection = ElementTree.parse(run / "frames.xdmf").getroot().find("Domain/Grid")
    assert collection.get("CollectionType") == "Temporal"
    steps = collection.findall("Grid")
    assert [float(g.find("Time").get("Value")) for g in steps] == list(frames["time"]) == [0, 0.5, 1]
    for k, step in enumerate(steps):
        blocks = {g.get("Name"): g for g in step.findall("Grid")}
        assert sorted(blocks) == ["bodies", "floes", "line"]
        for name, expected in ("floes", floes[k]), ("bodies", bodies[k]):
            points = load(blocks[name].find("Geometry/DataItem"), run)
            got = polygons(blocks[name].find("Topology"), points, run)
            assert len(got) == len(expected)
            for a, b in zip(got, expected):
                np.testing.assert_allclose(a, b, atol=1e-5)
        values = {(name, a.get("Name")): load(a.find("DataItem"), run)
                  for name, g in blocks.items() for a in g.findall("Attribute")}
        n = len(floes[k])
        np.testing.assert_array_equal(values["floes", "contact_force"], frames["contact_force"][k].astype("f4"))
        np.testing.assert_array_equal(values["floes", "speed"], frames["speed"][k, :n].astype("f4"))
        np.testing.assert_array_equal(values["bodies", "speed"], frames["speed"][k, n:].astype("f4"))
        for name, part in ("floes", slice(0, n)), ("bodies", slice(n, None)):
            velocity = values[name, "velocity"]
            np.testing.assert_array_equal(velocity[:, :2], frames["velocity"][k, part])
            assert velocity.shape[1] == 3 and not velocity[:, 2].any() and velocity[-1, :2].all()
            force = values[name, "net_force"]
            np.testing.assert_array_equal(force[:, :2], frames["net_force"][k, part])
            assert force.shape[1] == 3 and not force[:, 2].any() and force[:, :2].all()
            total = len(frames["speed"][k])
            np.testing.assert_array_equal(values[name, "id"], np.arange(total)[part])
        np.testing.assert_array_equal(values["floes", "thickness"], thickness)
        np.testing.assert_array_equal(values["bodies", "height"], height)
        np.testing.assert_array_equal(np.flatnonzero(values["bodies", "towed"]), towed)
        line = blocks["line"]
        points = load(line.find("Geometry/DataItem"), run)
        np.testing.assert_allclose(points, frames["line_points"][k], rtol=1e-8)
        np.testing.assert_array_equal(points, [(1, 2), (3 + k, 4), (5, 6), (7, 8 + k)])
        assert load(line.find("Topology/DataItem"), run).tolist() == [[0, 1], [2, 3]]
        np.testing.assert_array_equal(values["line", "tension"], [100 + k, 200])


def test_summary_is_json_with_every_promised_number(run):
    def no_constant(name):
        raise ValueError(f"{name} is not JSON")

    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"), parse_constant=no_constant)
    numbers = """n_floes n_steps dt_s sim_time_s wall_time_s ranks threads mean_ice_resistance_n
        mean_ice_resistance_se_n mean_tow_force_n max_overlap_m unconverged_steps mean_sweeps
        contacts_mean ns_per_floe_step momentum_residual concentration mean_drag_force_n
        mean_ice_resistance_budget_n contact_work_j positive_work_steps floes_outside
        p95_ice_resistance_n p99_ice_resistance_n peak_ice_resistance_n sd_ice_resistance_n""".split()
    for name in numbers:
        assert isinstance(summary[name], (int, float)), name
    assert list(summary["phases_s"]) == "detect colour forces solve advance exchange output project split".split()
    assert summary["state_hash"] == "0123456789abcdef"
    assert summary["title"] == 'quote " backslash \\ newline \n and byte \ufffd end'
    assert summary["reference"]["source"] == "made up é"
    with h5py.File(run / "result.h5", "r") as file:
        series = {name: data[()] for name, data in file["series"].items()}
        assert {len(x) for x in series.values()} == {600}
        assert file.attrs["version"] == summary["version"]
        assert file["series/tow_force"].attrs["units"] == "N"
        text = (run / "case.resolved.yml").read_bytes().partition(b"#> ")[0]  # without the case as given
        assert file["case"][()] == re.sub(b"\n# case: .*", b"", text)
    window = series["ice_resistance"][series["time"] >= summary["window"]["start_s"]]
    assert len(window) == summary["window"]["n_samples"]
    assert summary["mean_ice_resistance_n"] == pytest.approx(window.mean(), rel=1e-14)
    assert summary["sd_ice_resistance_n"] == pytest.approx(window.std(ddof=1), rel=1e-12)
    assert summary["p95_ice_resistance_n"] == pytest.approx(np.percentile(window, 95), rel=1e-14)
    assert summary["p99_ice_resistance_n"] == pytest.approx(np.percentile(window, 99), rel=1e-14)
    assert summary["peak_ice_resistance_n"] == window.max()


def test_the_printed_table_says_the_same(run):
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    table = (run / "table.txt").read_text(encoding="utf-8")
    force = summary["mean_ice_resistance_n"]
    low, high = (summary[f"mean_ice_resistance_{end}_n"] for end in ("low", "high"))
    said = re.search(r"ice resistance +([\d.]+) (k?)N, 95 % interval ([\d.]+) (k?)N to ([\d.]+) (k?)N", table).groups()
    reported = [float(said[i]) * (1000 if said[i + 1] else 1) for i in (0, 2, 4)]
    assert reported == pytest.approx([force, low, high], rel=1e-3)
    assert f"{summary['window']['start_s']:g} to 60 s (found by MSER-5)" in table
    assert "computed / measured = 2" in table
    shares = "detect 3.6 %, colour 7.1 %, forces 10.7 %, solve 14.3 %, advance 17.9 %, exchange 21.4 %, output 25.0 %"
    assert shares in table
    assert summary["state_hash"] in table
    assert "warning" not in table


def test_forces_of_a_frame_balance(tmp_path):
    """Red: an impulse that is counted for one of two bodies, or of a line for one of a contact; a fixed floe that has
    no force since it gains no momentum."""
    pier = {"x": 7.2, "y": 0, "shape": "square", "length": 0.8, "thickness": 1, "fixed": True}
    write_case(tmp_path, changed(TWO_LINES, domain__length=10, ice__concentration=0.75, floes=[pier]))
    done = subprocess.run([BERGTOW, "run", "case.yml", "-o", "out", "--quiet", "--threads", "1"], cwd=tmp_path,
                          env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "out/result.h5") as f:
        force, towed = f["frames/net_force"][1:].astype(float), len(f["floes/area"]) + f["bodies/towed"][0]
        at = np.searchsorted(f["series/time"][()], f["frames/time"][1:] * (1 - 1e-9))
        resistance = f["series/ice_resistance"][()][at]
        np.testing.assert_array_equal(force[f["frames/contact_force"][1:].sum(axis=1) == 0], 0)
    scale = np.abs(force).sum(axis=(1, 2))
    assert (resistance > 0).sum() > 5 and (force[:, towed + 1:] != 0).any()
    assert (force[:, towed - 1] != 0).any()  # the pier, the last of the floes
    np.testing.assert_allclose(-force[:, towed, 0], resistance, atol=1e-6 * scale.max())
    np.testing.assert_array_less(np.abs(force.sum(axis=1)).max(axis=1), 1e-5 * scale + 1e-9)


def signed_area(ring):
    x, y = (ring - ring[0]).T
    return 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)


FAR = {"run": {"dt": 0.1, "duration": 1}, "domain": {"frame": "basin", "x0": 500e3, "y0": 8676e3, "length": 20,
       "width": 10}, "ice": {"concentration": 0.5, "size": 0.4, "thickness": 0.04, "shape": "rectangles"},
       "body": {"shape": "none"}, "tow": {"mode": "none"}, "water": {"current_x": 0.2, "current_y": 0.1}}
NORTH = changed(FAR, domain={"frame": "geographic", "x0": -100, "y0": -100, "length": 200, "width": 200,
                             "ends": "open", "sides": "open"}, ice={"outlines": "map.geojson", "thickness": 1,
                                                                    "nonconvex": "split"})
SEVEN = np.array([[0, 0], [0, -10], [50, -10], [50, -40], [60, -40], [60, 0]]) / 4  # east, north: like the digit


@pytest.mark.parametrize("case, crs, place", [
    (FAR, None, None),
    (changed(FAR, domain__frame="geographic", domain__ends="wall", domain__sides="wall"), None, None),
    (NORTH, "EPSG:32633", (560e3, 8490e3)), (NORTH, "EPSG:4326", (17.25, 76.5)),
    (NORTH, "urn:x-bergtow:crs:local-metres-east-north", (0, 0)),
    (changed(NORTH, domain={**NORTH["domain"], "x0": 4900, "y0": -2100}), "EPSG:32633", (560e3 + 2e3, 8490e3 - 5e3))])
def test_the_frames_lie_as_on_the_map(tmp_path, case, crs, place):
    """East to the right and north up, near the origin that is named, and with it in the crs of the map. Red: x and y as
    they are, in single precision: a floe of 0.4 m at a northing of 8,676 km has no area, or four times its own."""
    if crs:
        scale = (2 / 111e3 / np.cos(np.radians(76.5)), 2 / 111e3) if crs == "EPSG:4326" else (1, 1)
        ring = [list(p) for p in SEVEN * scale + place]
        origin = {} if case["domain"]["x0"] != 4900 else {"ice__origin_east": 560e3, "ice__origin_north": 8490e3}
        if origin:
            ring = [[x - 4e3, y + 10e3] for x, y in ring]
        case = changed(case, **origin)
        (tmp_path / "map.geojson").write_text(json.dumps({
            "type": "FeatureCollection", "crs": {"type": "name", "properties": {"name": crs}}, "features": [
                {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring + ring[:1]]}}
            ]}))
    write_case(tmp_path, case)
    done = subprocess.run([BERGTOW, "run", "case.yml", "-o", "out", "--quiet", "--threads", "1"], cwd=tmp_path,
                          env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    folder, geographic = tmp_path / "out", case["domain"]["frame"] == "geographic"
    with h5py.File(folder / "result.h5") as f:
        about = dict(f["xdmf"].attrs)
        area, offsets, outline = (f[f"floes/{n}"][()] for n in ("area", "offsets", "vertices"))
        poses, velocity = f["frames/pose"][()], f["frames/velocity"][()]
    origin = np.array([about["origin_x"], about["origin_y"]])
    middle = [case["domain"][k] + case["domain"][n] / 2 for k, n in (("x0", "length"), ("y0", "width"))]
    assert np.abs(origin - middle).max() < 10 * max(case["domain"]["length"], case["domain"]["width"])
    root = ElementTree.parse(folder / "frames.xdmf").getroot().find("Domain/Grid")
    said = {i.get("Name"): i.get("Value") for i in root.findall("Information")}
    assert said["axes"] == about["axes"] == ("east (y), north (x)" if geographic else "x, y")
    assert said["origin"] == f"x = {origin[0]:.17g} m, y = {origin[1]:.17g} m"
    steps = root.findall("Grid")
    for step, pose, moving in zip(steps, poses, velocity, strict=True):
        block = next(g for g in step.findall("Grid") if g.get("Name") == "floes")
        drawn = polygons(block.find("Topology"), load(block.find("Geometry/DataItem"), folder), folder)
        np.testing.assert_allclose([signed_area(p.astype(float)) for p in drawn], area, rtol=1e-4)  # and anticlockwise
        world = list(placed({"vertices": outline, "offsets": offsets}, pose))
        for a, b in zip(drawn, world, strict=True):
            seen = (b - origin)[::-1, ::-1] if geographic else b - origin
            np.testing.assert_allclose(a, seen, atol=1e-4 * np.sqrt(area.min()))
        arrows = {a.get("Name"): a for a in block.findall("Attribute")}["velocity"]
        shown = load(arrows.find("DataItem"), folder)[:, :2]
        np.testing.assert_array_equal(shown[:, ::-1] if geographic else shown, moving[:len(shown)])
    if crs in (None, "urn:x-bergtow:crs:local-metres-east-north"):
        assert "crs" not in about and "crs" not in said
        return
    assert said["crs"] == about["crs"] and (about["crs"] == crs or crs == "EPSG:4326")
    pyproj = pytest.importorskip("pyproj")
    first = np.array(polygons((b := steps[0].findall("Grid")[0]).find("Topology"), load(
        b.find("Geometry/DataItem"), folder), folder)[0], float) + (about["origin_east"], about["origin_north"])
    to_map = pyproj.Transformer.from_crs(about["crs"], crs, always_xy=True)
    places = np.array(to_map.transform(*first.T)).T
    near = 1e-7 if crs == "EPSG:4326" else 1e-3
    assert all(np.abs(places - p).max(axis=1).min() < near for p in ring)


TWO_LINES = changed(TOW, run__duration=8, tow__mode="line", tow__line_length=3, tow__line_stiffness=2000,
                    tow__speed=0.6, body__x=4, tow__line={"branches": 2}, output__frame_interval=0.5)


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=pytest.mark.ranks)])
def test_the_line_of_a_run_that_goes_on(tmp_path, ranks):
    write_case(tmp_path, TWO_LINES)
    mpi = launcher(ranks) if ranks > 1 else []
    env = environment()
    for words in (["run", "case.yml", "-o", "parts", "--steps", "33"], ["resume", "parts"],
                  ["run", "case.yml", "-o", "whole"]):
        done = subprocess.run([*(mpi if "parts" in words else []), BERGTOW, *words, "--quiet", "--threads", "1"],
                              cwd=tmp_path, env=env, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert differing(tmp_path / "whole/result.h5", tmp_path / "parts/result.h5") == []
    assert (tmp_path / "whole/frames.xdmf").read_bytes() == (tmp_path / "parts/frames.xdmf").read_bytes()
    with h5py.File(tmp_path / "whole/result.h5") as f:
        points, tension = f["frames/line_points"][()], f["frames/line_tension"][()]
        at = np.searchsorted(f["series/time"][()], f["frames/time"][1:] * (1 - 1e-9))
        np.testing.assert_allclose(points[1:, 1, 0], f["series/carriage_x"][()][at], rtol=1e-12)
        np.testing.assert_array_equal(tension[1:, 0], f["series/line_tension_1"][()][at])
        np.testing.assert_array_equal(tension[1:, 1], f["series/line_tension_2"][()][at])
        body = f["frames/body_pose"][:, 0]
        assert tension.max() > 0 and np.ptp(np.hypot(*(points[:, 0] - body[:, :2]).T)) < 1e-9  # a point of the hull
