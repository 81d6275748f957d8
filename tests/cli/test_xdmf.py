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

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path("build") / os.environ.get("CONFIG", "release") / "tests/unit/test_record"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    subprocess.run(["make", "-s", str(PROGRAM)], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    folder = tmp_path_factory.mktemp("run")
    done = subprocess.run([ROOT / PROGRAM, "write", folder],
                          check=True,
                          stdout=subprocess.PIPE,
                          text=True,
                          errors="replace")
    (folder / "table.txt").write_text(done.stdout, encoding="utf-8")
    return folder


def dimensions(item):
    return tuple(int(n) for n in item.get("Dimensions").split())


def load(item, folder):
    """The array a DataItem stands for, its size and type checked against what it says."""
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
        floes = [list(placed(file["floes"], poses)) for poses in frames["pose"]]
        bodies = [list(placed(file["bodies"], poses)) for poses in frames["body_pose"]]
    collection = ElementTree.parse(run / "frames.xdmf").getroot().find("Domain/Grid")
    assert collection.get("CollectionType") == "Temporal"
    steps = collection.findall("Grid")
    assert [float(g.find("Time").get("Value")) for g in steps] == list(frames["time"]) == [0, 0.5, 1]
    for k, step in enumerate(steps):
        blocks = {g.get("Name"): g for g in step.findall("Grid")}
        assert sorted(blocks) == ["bodies", "floes"]
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
    assert list(summary["phases_s"]) == "detect colour forces solve advance exchange output".split()
    assert summary["state_hash"] == "0123456789abcdef"
    assert summary["title"] == 'quote " backslash \\ newline \n and byte \ufffd end'
    assert summary["reference"]["source"] == "made up é"
    with h5py.File(run / "result.h5", "r") as file:
        series = {name: data[()] for name, data in file["series"].items()}
        assert {len(x) for x in series.values()} == {600}
        assert file.attrs["version"] == summary["version"]
        assert file["series/tow_force"].attrs["units"] == "N"
        assert file["case"][()] == (run / "case.resolved.yml").read_bytes()
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
    told = [float(said[i]) * (1000 if said[i + 1] else 1) for i in (0, 2, 4)]
    assert told == pytest.approx([force, low, high], rel=1e-3)
    assert f"{summary['window']['start_s']:g} to 60 s (found by MSER-5)" in table
    assert "computed / measured = 2" in table
    shares = "detect 3.6 %, colour 7.1 %, forces 10.7 %, solve 14.3 %, advance 17.9 %, exchange 21.4 %, output 25.0 %"
    assert shares in table
    assert summary["state_hash"] in table
    assert "warning" not in table
