# SPDX-License-Identifier: MIT
"""One gate for ice, whatever way it comes in, and inputs that would lead the program elsewhere: links, other files,
pipes."""
import json
import os
import re
import shutil
import socket
import subprocess

import h5py
import numpy as np
import pytest

from harness import BERGTOW, CASE, DONE, IO, TOW, call, changed, environment, launcher, run, write_case

FLOE = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
TANK = {"run": {"dt": 0.1, "duration": 1}, "domain": {"length": 20, "width": 10}, "ice": {"concentration": 0},
        "body": {"shape": "none"}}
READ = changed(TANK, ice={"field": "field.h5"})


def write_field(path, thickness=0.5, at=(5.0, 0.0), scale=1.0, area=None, ice_area=200.0, v=None):
    """Two squares as another program would write them: without a seal."""
    path.parent.mkdir(parents=True, exist_ok=True)
    v = np.array(FLOE) * scale if v is None else np.array(v)
    with h5py.File(path, "w") as f:
        g = f.create_group("floes")
        g["offsets"] = [0, 4, 8]
        g["vertices"] = np.vstack([v, FLOE])
        g["pose"] = [[*at, 0], [12.0, 2, 0]]
        g["thickness"] = [thickness, 0.5]
        if area is not None:
            g["area"] = [area, 1.0]
        g.attrs["ice_area"] = ice_area
    return path


def by_hand(**floe):
    # Of the list: the floe on trial, and a sound one.
    tried = {"shape": "polygon", "vertices": floe.pop("v", FLOE), "x": 5, "y": 0, "thickness": 0.5} | floe
    return changed(TANK, floes=[tried, {"shape": "square", "length": 1, "x": 12, "y": 2}])


def as_hand(folder, k):
    keys = {"thickness": k["thickness"]} if "thickness" in k else {}
    if "at" in k:
        keys |= {"x": k["at"][0], "y": k["at"][1]}
    if "scale" in k:
        keys["v"] = (np.array(FLOE) * k["scale"]).tolist()
    return write_case(folder, by_hand(**keys))


def as_geojson(folder, k):
    v = np.array(FLOE) * k.get("scale", 1) + k.get("at", (5.0, 0.0))
    features = [{"type": "Feature", "properties": {"thickness": t},
                 "geometry": {"type": "Polygon", "coordinates": [ring.tolist() + [ring[0].tolist()]]}}
                for ring, t in ((v, k.get("thickness", 0.5)), (np.array(FLOE) + [12, 2], 0.5))]
    path = write_case(folder, changed(TANK, ice={"outlines": "floes.geojson", "outlines_crs": "plane"}))
    (folder / "floes.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def as_hdf5(folder, k):
    write_field(folder / "field.h5", **k)
    return write_case(folder, READ)


WAYS = {"by hand": as_hand, "GeoJSON": as_geojson, "HDF5": as_hdf5}
FAULTS = {
    "thick as an ice sheet": {"thickness": 800.0}, "thickness overflows": {"thickness": 1e102},
    "thickness overflows more": {"thickness": 1e277}, "no thickness": {"thickness": 0.0},
    "thickness underflows": {"thickness": 1e-300}, "negative": {"thickness": -1.0}, "outside": {"at": (25.0, 0.0)},
    "far outside": {"at": (1e9, 0.0)}, "overflowing place": {"at": (1e300, 0.0)},
    "a micron": {"scale": 1e-9}, "a million km": {"scale": 1e9},
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("fault", FAULTS)
def test_the_same_bounds(tmp_path, way, fault):
    """What is no ice in one form is none in another."""
    path = WAYS[way](tmp_path, FAULTS[fault])
    for command in (["check", path], ["run", path, "-o", tmp_path / "out"]):
        result = call(*command)
        # Alone a micron is a piece among floes; by hand it was asked for.
        if fault == "a micron" and way != "by hand":
            assert result.returncode in (DONE, CASE)
        else:
            assert result.returncode == CASE and result.stderr.strip(), result.stdout


def row_by_hand(folder, xs):
    return write_case(
        folder, changed(TANK, floes=[{"shape": "square", "length": 1, "x": x, "y": 0, "thickness": 0.5} for x in xs]))


def row_as_geojson(folder, xs):
    path = as_geojson(folder, {})
    ring = np.array(FLOE + FLOE[:1])
    features = [{
        "type": "Feature", "properties": {"thickness": 0.5},
        "geometry": {"type": "Polygon", "coordinates": [(ring + [x, 0]).tolist()]}
    } for x in xs]
    (folder / "floes.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def row_as_hdf5(folder, xs):
    with h5py.File(folder / "field.h5", "w") as f:
        g = f.create_group("floes")
        g["offsets"], g["vertices"] = 4 * np.arange(len(xs) + 1), np.vstack([FLOE] * len(xs))
        g["pose"], g["thickness"] = [[x, 0, 0] for x in xs], np.full(len(xs), 0.5)
        g.attrs["ice_area"] = 200.0
    return write_case(folder, READ)


ROWS = {"by hand": row_by_hand, "GeoJSON": row_as_geojson, "HDF5": row_as_hdf5}


@pytest.mark.parametrize("way", ROWS)
@pytest.mark.parametrize("xs, pairs, deepest", [((5, 5.6, 12), 1, "0.4"), ((5, 5.6, 6.1, 12), 2, "0.5"),
                                                (tuple(np.arange(2, 16, 0.9)), 15, "0.1"), ((5, 5.9995, 12), 0, "")])
def test_floes_in_each_other(tmp_path, way, xs, pairs, deepest):
    """Refused beyond the solver's slop, with the number of pairs, the deepest and names, in check as in run; less is
    taken out by the projection."""
    path = ROWS[way](tmp_path, xs)
    checked, ran = call("check", path), call("run", path, "-o", tmp_path / "out")
    assert checked.returncode == ran.returncode == (CASE if pairs else DONE), ran.stderr
    if not pairs:
        return
    assert checked.stderr == ran.stderr and not (tmp_path / "out").exists()
    assert "allowed: 0.00113 m" in ran.stderr
    name = {
        "by hand": "floes[%d] and floes[%d]", "GeoJSON": "feature %d and feature %d", "HDF5": "floe %d and floe %d"
    }[way]
    named = {1: (0, 1), 2: (1, 2)}  # the deepest; of 15 alike it may be any
    assert pairs not in named or name % named[pairs] in ran.stderr, ran.stderr
    assert ("bergtow outlines" in ran.stderr) == (way == "GeoJSON")
    if pairs > 1 or way == "by hand":
        assert re.search(rf"{pairs} pairs? of \S+ .*overlap,? by (up to )?{deepest} m", ran.stderr), ran.stderr


def test_a_floe_of_a_field_in_the_body(tmp_path):
    """A field can be made without the body; the body is then in it, unless a lead has been opened there."""
    row_as_hdf5(tmp_path, (4.0, 5.2, 8.0))
    case = changed(READ, body={"shape": "square", "length": 2, "draft": 0.5, "x": 4, "y": 0}, tow={"mode": "none"})
    result = call("check", write_case(tmp_path, case))
    assert (result.returncode == CASE and "2 pairs" in result.stderr and "by up to 1.5 m" in result.stderr
            and "deepest floe 0 of the ice and towed body" in result.stderr)
    towed = changed(case, tow={"mode": "speed", "speed": 0.1}, lead={"mode": "channel", "width": 4, "length": 10})
    assert call("check", write_case(tmp_path, towed)).returncode == DONE


@pytest.mark.parametrize("way", WAYS)
def test_the_sound_ones_get_in(tmp_path, way):
    r = run(tmp_path, WAYS[way](tmp_path, {"thickness": 10.0}))
    assert r.summary["n_floes"] == 2 and np.isfinite(r.summary["max_overlap_m"])


@pytest.mark.parametrize("fault, says", [
    ({"ice_area": 1e-300}, "above 1"), ({"ice_area": 1e-3}, "above 1"), ({"ice_area": 1.9}, "above 1"),
    ({"ice_area": 1e12}, "below 1e-06"), ({"ice_area": 1e30}, "not between 0 and"),
    ({"ice_area": -1.0}, "not between 0 and"),
    ({"ice_area": np.nan}, "ice_area"), ({"ice_area": np.inf}, "not between 0 and"),
    ({"ice_area": 201.0}, "above that of the domain"), ({"area": 2.0}, "area 2 m2 is not that of its outline"),
    ({"at": (np.nan, 0)}, "pose is not finite"),
    ({"at": (25.0, 0.0)}, "floe 0, x 24.5 to 25.5 m, is outside the domain")])
def test_what_only_a_field_file_can_say(tmp_path, fault, says):
    write_field(tmp_path / "field.h5", **fault)
    result = call("check", write_case(tmp_path, READ))
    assert result.returncode == CASE and says in result.stderr and "field.h5" in result.stderr, result.stderr


def test_an_area_of_a_field_of_another_domain(tmp_path):
    """A field of the tank in one half as long: floes outside are named, one after the other."""
    made = changed(TANK, ice={"concentration": 0.5, "size": 1})
    assert call("field", write_case(tmp_path, made), "-o", tmp_path / "field.h5").returncode == DONE
    assert run(tmp_path, READ).summary["n_floes"] > 50
    result = call("check", write_case(tmp_path, changed(READ, domain__length=10)))
    assert result.returncode == CASE and "above that of the domain" in result.stderr


# ---- files that lead elsewhere ----

def external_link(path):
    os.rename(write_field(path), path.parent / "other.h5")
    with h5py.File(path, "w") as f:
        f["floes"] = h5py.ExternalLink("other.h5", "/floes")
    return "/floes is an external link"


def external_link_below(path):
    shutil.copy(write_field(path), path.parent / "other.h5")
    with h5py.File(path, "a") as f:
        del f["floes/thickness"]
        f["floes/thickness"] = h5py.ExternalLink("other.h5", "/floes/thickness")
    return "/floes/thickness is an external link"


def link_to_a_pipe(path):
    os.mkfifo(path.parent / "pipe")
    with h5py.File(write_field(path), "a") as f:
        del f["floes/thickness"]
        f["floes/thickness"] = h5py.ExternalLink(str(path.parent / "pipe"), "/floes/thickness")
    return "/floes/thickness is an external link"


def soft_link(path):
    with h5py.File(write_field(path), "a") as f:
        f["elsewhere"] = h5py.ExternalLink("other.h5", "/")
        del f["floes/thickness"]
        f["floes/thickness"] = h5py.SoftLink("/elsewhere/floes/thickness")
    return "link"


def soft_link_alone(path):
    with h5py.File(write_field(path), "a") as f:
        f["thickness"] = f["floes/thickness"][:]
        del f["floes/thickness"]
        f["floes/thickness"] = h5py.SoftLink("/thickness")
    return "/floes/thickness is a soft link"


def external_storage(path):
    """The text of another file as thicknesses."""
    (path.parent / "secret.txt").write_text("0123456789abcdef")
    return stored_in(path, path.parent / "secret.txt")


def external_pipe(path):
    os.mkfifo(path.parent / "pipe")
    return stored_in(path, path.parent / "pipe")


def stored_in(path, other):
    with h5py.File(write_field(path), "a") as f:
        del f["floes/thickness"]
        plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plan.set_external(os.fsencode(other), 0, 16)
        h5py.h5d.create(f["floes"].id, b"thickness", h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((2,)), plan)
    return "/floes/thickness is a dataset with external storage"


def virtual(path):
    shutil.copy(write_field(path), path.parent / "other.h5")
    return made_virtual(path, path.parent / "other.h5")


def virtual_pipe(path):
    os.mkfifo(path.parent / "pipe")
    return made_virtual(write_field(path), path.parent / "pipe", maxshape=(None,))


def made_virtual(path, other, maxshape=None):
    with h5py.File(path, "a") as f:
        del f["floes/thickness"]
        layout = h5py.VirtualLayout(shape=(2,), dtype="f8", maxshape=maxshape)
        layout[:] = h5py.VirtualSource(str(other), "/floes/thickness", shape=(2,))
        f.create_virtual_dataset("floes/thickness", layout)
    return "/floes/thickness is a virtual dataset"


TRICKS = [external_link, external_link_below, link_to_a_pipe, soft_link, soft_link_alone, external_storage,
          external_pipe, virtual, virtual_pipe]


@pytest.mark.parametrize("trick", TRICKS)
def test_a_field_is_what_lies_in_its_file(tmp_path, trick):
    says = trick(tmp_path / "field.h5")
    result = call("check", write_case(tmp_path, READ), timeout=20)
    assert result.returncode == CASE, result.stdout
    assert "field.h5: holds data that this program does not write" in result.stderr and says in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_what_else_lies_in_it_is_left_alone(tmp_path):
    """Hard links, compressed and chunked datasets, notes of its own."""
    with h5py.File(write_field(tmp_path / "field.h5"), "a") as f:
        f["notes/why"] = "by hand"
        f["notes/again"] = f["floes/pose"]
        f["notes/all"] = f["floes"]
        del f["floes/thickness"]
        f.create_dataset("floes/thickness", data=[0.5, 0.5], chunks=(1,), compression="gzip")
    assert run(tmp_path, READ).summary["n_floes"] == 2


# ---- inputs that are no files ----

def pipe(path):
    os.mkfifo(path)
    return "a pipe"


def device(path):
    path.symlink_to("/dev/zero")
    return "a device"


def listening(path):
    server = socket.socket(socket.AF_UNIX)
    old = os.getcwd()
    os.chdir(path.parent) # names of sockets are short
    server.bind(path.name)
    os.chdir(old)
    return "a socket"


def folder(path):
    path.mkdir()
    return "is a folder"


NAMES = {
    "field": ("field.h5", {"ice": {"field": "field.h5"}}),
    "outlines": ("o.geojson", {"ice": {"outlines": "o.geojson"}}),
    "current": ("t.csv", {"water": {"current_table": "t.csv"}}), "wind": ("t.csv", {"air": {"wind_table": "t.csv"}}),
}


@pytest.mark.parametrize("kind", [pipe, device, listening, folder])
@pytest.mark.parametrize("what", [*NAMES, "case", "study", "base", "checkpoint", "result"])
def test_no_regular_file_is_opened(tmp_path, what, kind):
    """Nobody writes into the pipe: whoever opens it waits for ever."""
    if what in NAMES:
        name, more = NAMES[what]
        command = ["check", write_case(tmp_path, changed(TANK, **more))]
    elif what in ("case", "study"):
        name, command = "in.yml", ["check" if what == "case" else "ensemble", "in.yml"]
    elif what == "base":
        name, command = "base.yml", ["check", "study.yml"]
        (tmp_path / "study.yml").write_text(json.dumps({"base": "base.yml", "parameters": {"tow.speed": [0.1, 0.2]}}))
    else:
        r = run(tmp_path, changed(TOW, run__duration=1), "--steps", 5)
        name = f"out/{what}.h5"
        for path in r.dir.glob(f"{what}*.h5"):
            path.unlink()
        command = ["resume", "out"]
    says = kind(tmp_path / name)
    result = call(*command, cwd=tmp_path, timeout=20)
    wanted = (IO, CASE) if what == "checkpoint" else (IO,)
    assert result.returncode in wanted, (result.returncode, result.stderr)
    assert name.split("/")[-1] in result.stderr and says in result.stderr, result.stderr


@pytest.mark.ranks
def test_nobody_hangs_under_mpirun(tmp_path):
    os.mkfifo(tmp_path / "field.h5")
    path = write_case(tmp_path, READ)
    env = environment(OMP_NUM_THREADS=1)
    result = subprocess.run([*launcher(2), BERGTOW, "run", path, "-o", tmp_path / "out"],
                            env=env, capture_output=True, text=True, timeout=60)
    assert result.returncode == IO and result.stderr.count("is a pipe (FIFO)") == 1


def test_a_case_from_the_shells_pipe(tmp_path):
    """Standard input, and what bash gives as <(...), are open before the program is: it waits for nobody. A case can be
    read from them, and nothing else."""
    text = json.dumps(changed(TANK, ice={"concentration": 0.2, "size": 1}))
    (tmp_path / "case.json").write_text(text)
    for command in (f"{BERGTOW} check /dev/stdin < case.json", f"cat case.json | {BERGTOW} check /dev/stdin",
                    f"{BERGTOW} check <(cat case.json)"):
        result = subprocess.run(["bash", "-c", command], cwd=tmp_path, env=environment(), capture_output=True,
                                text=True, timeout=20)
        assert result.returncode == DONE and ": valid" in result.stdout, result.stderr
    path = write_case(tmp_path, changed(TANK, water={"current_table": "/dev/stdin"}))
    result = subprocess.run(["bash", "-c", f"printf 't,u,v\\n0,0,0\\n' | {BERGTOW} check {path}"], env=environment(),
                            capture_output=True, text=True, timeout=20)
    assert result.returncode == IO and "/dev/stdin: is a pipe (FIFO), not a regular file" in result.stderr
