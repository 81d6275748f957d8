#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Short scenes that use every mode and option, and digests of all that a run of each leaves: what holds a refactoring.

    tests/scenes.py --compare OTHER [NAME...]   run the scenes with $BERGTOW and with another binary; print the first
                                                difference of each item; exit code 1 if there is any
    tests/scenes.py --record                    renew tests/parallel/scenes.json, after a change meant to move results

Every scene has a layout of its own (ranks, threads, resumed or not), so that the set holds the layouts against each
other, too. Digests depend on the elementary functions of libm and on the compiler: scenes.json names both, see
fingerprint().
"""
import argparse
import hashlib
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

import h5py
import numpy as np

from harness import BERGTOW, PRESS, ROOT, TOW, changed, environment, write_case

STORED = ROOT / "tests/parallel/scenes.json"

#: ranks, threads, step after which the run is stopped and resumed (0: not)
LAYOUTS = [(1, 1, 0), (1, 2, 0), (2, 1, 0), (1, 1, 13), (3, 1, 0), (2, 2, 9)]

#: seconds that a scene may take, mpirun on a busy machine included
PATIENCE = 180

#: summary keys that depend on the machine, the clock or the layout
VOLATILE = {
    "version", "revision", "compiler", "flags", "ranks", "threads", "wall_time_s", "time_by_phase", "command_line",
    "folder", "memory_bytes", "hostname", "date", "ns_per_floe_step", "phases_s", "dealt_imbalance", "divisions",
    "edge_cut", "halo_share", "imbalance", "moved_floes", "worst_imbalance", "worst_dealt_imbalance"
}

SHORT = changed(TOW, run__duration=4)
DENSE = changed(TOW, run__duration=4, ice__concentration=0.75, ice__size=0.9)
LINE = changed(SHORT, tow__mode="line", tow__line_length=3, tow__line_stiffness=2000, body__x=4)
SHIP = {"mass": 800, "bollard_pull": 600, "free_speed": 3, "lookahead": 3}
GEO = {
    "run": {"dt": 0.1, "duration": 5},
    "domain": {"frame": "geographic", "length": 24, "width": 18, "ends": "moving", "sides": "periodic", "ahead": 14},
    "ice": {"concentration": 0.5, "size": 1.2, "thickness": 0.04, "friction": 0.3},
    "body": {"length": 2, "draft": 0.5},
    "tow": {"speed": 0.8, "ramp": 1},
    "water": {"latitude": 75},
}
SQUARES = [{"shape": "square", "length": 0.8, "x": 6 + 0.95 * (k % 6), "y": -2 + 0.95 * (k // 6), "yaw": k % 5,
            "thickness": 0.03 + 0.001 * k} for k in range(24)]

SCENES = {
    "speed": SHORT,
    "speed_dense": DENSE,
    "speed_direction": changed(SHORT,
                               tow__direction=25,
                               body__shape="ship",
                               body__length=2,
                               body__width=0.8,
                               body__yaw=10),
    "speed_programme": changed(SHORT,
                               tow__ramp=None,
                               tow__speed=None,
                               tow__programme=[[0, 0], [1, 0.4], [3, 0.1], [4, 0.3]]),
    "speed_waypoints": changed(SHORT,
                               tow__speed=0.8,
                               tow__waypoints=[[4, 1], [7, -1]],
                               tow__turn_radius=0.8,
                               tow__ramp=0.2),
    "free_drift": changed(SHORT, tow={"mode": "none"}, body__vx=0.2, body__vy=-0.1, body__yaw_rate=20),
    "free_drift_start": changed(GEO,
                                tow={"mode": "none"},
                                domain__ends="periodic",
                                domain__ahead=None,
                                air__wind_x=5,
                                water__current_y=0.1,
                                ice__start="drift"),
    "rest_start": changed(GEO, ice__start="rest", air__wind_x=5, water__current_y=0.1),
    "line": changed(LINE, tow__speed=0.6, tow__ramp=0.5),
    "line_bridle_breaks": changed(LINE,
                                  tow__speed=0.9,
                                  tow__ramp=0.2,
                                  tow__line={"branches": 2, "breaking_load": 0},
                                  tow__branch2={"breaking_load": 20}),
    "line_named": changed(LINE, tow__line_stiffness=None, tow__line={"type": "polypropylene", "diameter": "8 mm"}),
    "thrust": changed(LINE, tow__mode="thrust", tow__speed=0.5, tow__vessel=SHIP),
    "thrust_waypoints": changed(GEO,
                                tow={
                                    "mode": "thrust", "speed": 0.8, "ramp": 1, "line_length": 3, "line_stiffness": 2000,
                                    "waypoints": [[12, 0], [30, 4], [90, 4]], "turn_radius": 3, "vessel": SHIP
                                }),
    "window": changed(GEO, run__duration=8, tow__speed=1.6),
    "window_along_y": changed(GEO, tow__direction=0, ice__size_law="lognormal", ice__thickness_law="lognormal"),
    "current_and_wind": changed(SHORT, water__current_x=0.1, water__current_y=-0.05, air__wind_x=-6, air__wind_y=3),
    "tide": changed(GEO, water__tide={"major": 0.2, "minor": 0.05, "period": 12, "inclination": 30, "phase": 40}),
    "tables": changed(GEO, water__current_table="current.csv", air__wind_table="wind.csv"),
    "tilt": changed(GEO, water__tilt="geostrophic", water__current_x=0.1),
    "tilt_dynamic": changed(GEO, water__tilt="dynamic", water__tide={"major": 0.2, "minor": 0.0, "period": 10}),
    "slope": changed(GEO, water__tilt="slope", water__slope_x=1e-5, water__slope_y=-2e-5),
    "walls_closing": changed(PRESS, run__duration=1.5, domain__length=20, domain__width=16),
    "periodic_dense": changed(PRESS,
                              run__duration=1.5,
                              domain={"length": 20, "width": 16, "ends": "open", "sides": "periodic"},
                              water__current_x=0.1),
    "open_sides": changed(DENSE, domain__sides="open", domain__ends="open", water__current_y=0.1),
    "plain_sweeps": changed(DENSE, solver__plain=True, solver__max_sweeps=60),
    "cold_start": changed(DENSE, solver__warm_start=False, solver__inner_sweeps=1, solver__tile=3),
    "few_sweeps": changed(PRESS, run__duration=1.5, domain__length=20, domain__width=16, solver__max_sweeps=3),
    "restitution": changed(DENSE,
                           ice__restitution=0.4,
                           body__restitution=0.2,
                           domain__wall_restitution=0.3,
                           tow__speed=0.5),
    "crushing": changed(DENSE, ice__crushing={"pressure": "2 kPa", "least_length": 0.5}, tow__speed=0.5),
    "crushing_press": changed(PRESS,
                              run__duration=1.5,
                              domain__length=20,
                              domain__width=16,
                              ice__crushing__pressure="20 kPa"),
    "rafting": changed(DENSE, ice__rafting__kappa=6, ice__concentration=0.85, tow__speed=0.5),
    "rafting_press": changed(PRESS,
                             run__duration=1.5,
                             domain__length=20,
                             domain__width=16,
                             ice__rafting__kappa=5,
                             ice__thickness_law="lognormal",
                             ice__crushing__pressure="200 Pa"),
    "impacts_sine": changed(SHORT,
                            tow__speed=0.6,
                            impact__conversion="duration",
                            output__panels=True,
                            impact__panels=12),
    "impacts_crushing": changed(SHORT, tow__speed=0.6, impact={"conversion": "crushing", "pressure": "20 kPa"}),
    "lead_channel": changed(SHORT, lead={"mode": "channel", "width": 2.5}, tow__speed=0.4),
    "lead_managed": changed(SHORT, lead={"mode": "managed", "width": 3, "floe_size": 0.4}, run__dt=0.05,
                            tow__speed=0.4),
    "rectangles": changed(SHORT, ice__shape="rectangles", ice__aspect=1.6, ice__concentration=0.7),
    "hexagons_power_law": changed(SHORT,
                                  ice__shape="polygons",
                                  ice__sides=6,
                                  ice__size_law="power",
                                  ice__size_min=0.4,
                                  ice__size_max=1.6,
                                  ice__concentration=0.4),
    "floes_by_hand": changed(SHORT, ice__concentration=0, floes=SQUARES, tow__speed=0.5),
    "one_fixed_floe": changed(SHORT,
                              ice__concentration=0.3,
                              floes=[{"shape": "disc", "length": 2, "x": 10, "y": 1, "fixed": True, "thickness": 0.1}],
                              tow__speed=1),
    "heavy_body_against_wall": changed(LINE,
                                       body__x=10,
                                       body__mass=2e4,
                                       tow__speed=0.5,
                                       tow__ramp=0.2,
                                       ice__concentration=0.6),
    "body_in_parts_outlines": changed(SHORT, ice={"friction": 0.3, "outlines": "bays.geojson", "nonconvex": "split"}),
    "outlines_hull": changed(SHORT,
                             ice={"friction": 0.2, "outlines": "bays.geojson", "nonconvex": "hull"},
                             tow__speed=0.4),
    "field_file": changed(SHORT, ice={"friction": 0.3, "restitution": 0.1, "field": "field.h5"}, tow__speed=0.4),
    "square_body": changed(SHORT,
                           body__shape="square",
                           body__yaw=20,
                           impact={"conversion": "crushing", "corner": "real"}),
    "rectangle_body": changed(SHORT, body__shape="rectangle", body__width=1.2, impact__conversion="none"),
    "polygon_body": changed(SHORT,
                            body__shape="polygon",
                            body__length=None,
                            tow__speed=0.3,
                            body__vertices=[[1, -0.6], [1.2, 0.2], [0, 0.9], [-1, 0.4], [-0.8, -0.7]]),
    "steel_wire": changed(LINE, tow__line_stiffness=None, tow__line={"type": "steel-wire", "diameter": "4 mm"}),
    "dyneema": changed(LINE, tow__line_stiffness=None, tow__line={"type": "dyneema", "diameter": "4 mm"}),
    "no_body": changed(PRESS, run__duration=1, domain__length=18, domain__width=14, ice__concentration=0.8),
}


def layout_of(name):
    return LAYOUTS[list(SCENES).index(name) % len(LAYOUTS)]


def command(binary, ranks, *arguments):
    start = ["mpirun", "--oversubscribe", "-n", str(ranks)] if ranks > 1 else []
    return [*start, str(binary), *map(str, arguments)]


def started(line, folder):
    env = environment(OMPI_ALLOW_RUN_AS_ROOT=1, OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1)
    done = subprocess.run(line, cwd=folder, env=env, capture_output=True, text=True, timeout=PATIENCE)
    return done.returncode, done.stdout + done.stderr


def prepare(folder, case, binary):
    """The case and the files that it names."""
    write_case(folder, case)
    (folder / "current.csv").write_text("t,u,v\n0,0.05,0\n2,0.1,-0.05\n20,0,0.1\n")
    (folder / "wind.csv").write_text("t,u,v\n0,-3,1\n20,4,2\n")
    ice = case.get("ice", {})
    if "field" in ice or "outlines" in ice:
        write_case(folder, changed(SHORT, ice__concentration=0.45), "grounds.yml")
        for out in ("field.h5", "convex.geojson"):
            code, said = started(command(binary, 1, "field", "grounds.yml", "-o", out), folder)
            assert code == 0, said
        drawn = json.loads((folder / "convex.geojson").read_text())
        for k, feature in enumerate(drawn["features"]):
            ring = np.array(feature["geometry"]["coordinates"][0][:-1])
            middle, out = ring.mean(axis=0), []
            for i, (p, q) in enumerate(zip(ring, np.roll(ring, -1, axis=0))):
                out += [p, middle + ((p + q) / 2 - middle) * (1 - 0.03 * ((3 * k + 5 * i) % 8))]
            feature["geometry"]["coordinates"] = [[list(p) for p in out + out[:1]]]
        (folder / "bays.geojson").write_text(json.dumps(drawn))


def run_scene(folder, name, layout, binary=BERGTOW):
    """Run a scene in a layout; returns {item: bytes} of everything that it leaves."""
    ranks, threads, stop = layout
    folder.mkdir(parents=True, exist_ok=True)
    prepare(folder, SCENES[name], binary)
    extra = ["--steps", stop] if stop else []
    code, said = started(
        command(binary, ranks, "run", "case.yml", "-o", "out", "--threads", threads, "--quiet", *extra), folder)
    assert code == 0, f"{name}: exit code {code}\n{said}"
    if stop:
        code, said = started(command(binary, ranks, "resume", "out", "--threads", threads, "--quiet"), folder)
        assert code == 0, f"{name}: exit code {code} of resume\n{said}"
    return items_of(folder / "out")


def items_of(folder):
    """Everything that a run has left as {item: bytes}; wall times, versions and the layout are left out."""
    items = {}

    def take(name, item):
        if isinstance(item, h5py.Dataset) and not name.startswith(("case", "provenance")):
            value = item[()]
            items["/" + name] = value.tobytes() if item.dtype.kind != "O" else repr(value).encode()

    with h5py.File(folder / "result.h5") as f:
        f.visititems(take)
    for key, value in json.loads((folder / "summary.json").read_text()).items():
        if key not in VOLATILE and "wall" not in key and "memory" not in key:
            items["summary." + key] = json.dumps(value).encode()
    return items


def fingerprint(binary=BERGTOW):
    """What the bits depend on beside the program: elementary functions of libm on this processor, and the compiler."""
    h = hashlib.sha256()
    for k in range(1, 2000):
        x = k * 0.7310585786300049
        for v in (math.sin(x), math.cos(x), math.exp(-x / 99), math.log(x), math.pow(x, 0.37), math.atan2(x, 3.3),
                  math.hypot(x, 1.7)):
            h.update(np.float64(v).tobytes())
    said = subprocess.run([binary, "--version"], capture_output=True, text=True, check=True).stdout
    h.update(said.partition(", ")[2].encode())  # bergtow 0.1.0 (REVISION, COMPILER)
    return h.hexdigest()[:16]


def groups(names):
    """Items by what they belong to: each series and each number of the summary by itself, all frames as one, and so
    on."""
    found = {}
    for name in sorted(names):
        first = name.strip("/").split("/")[0]
        found.setdefault(name if first == "series" or name.startswith("summary.") else "/" + first, []).append(name)
    return found


def digest(items, names):
    h = hashlib.sha256()
    for name in names:
        h.update(name.encode() + b"\0" + items[name])
    return h.hexdigest()[:8]


def digests(items):
    return {group: digest(items, names) for group, names in groups(items).items()}


def first_difference(a, b):
    x, y = (np.frombuffer(v, np.uint8) for v in (a, b))
    if len(x) != len(y):
        return f"{len(x)} and {len(y)} bytes"
    at = int(np.flatnonzero(x != y)[0])
    if len(x) % 8 == 0 and len(x) > 8:
        p, q = np.frombuffer(a), np.frombuffer(b)
        return f"number {at // 8}: {p[at // 8]!r} and {q[at // 8]!r}"
    return f"{a[:120]!r} and {b[:120]!r}"


def compare(other, names):
    different = 0
    for name in names or SCENES:
        with tempfile.TemporaryDirectory() as folder:
            mine = run_scene(pathlib.Path(folder) / "a", name, layout_of(name))
            theirs = run_scene(pathlib.Path(folder) / "b", name, (1, 1, 0), other)
        found = []
        for item in sorted(mine.keys() | theirs.keys()):
            if item not in theirs:
                print(f"{name}: {item} is new")
            elif item not in mine:
                found.append(f"{item} is gone")
            elif mine[item] != theirs[item]:
                found.append(f"{item}: {first_difference(mine[item], theirs[item])}")
        print(f"{name} {layout_of(name)}: {'same' if not found else '; '.join(found[:6])}", flush=True)
        different += bool(found)
    return different


def record():
    scenes = {}
    for name in SCENES:
        with tempfile.TemporaryDirectory() as folder:
            scenes[name] = digests(run_scene(pathlib.Path(folder), name, layout_of(name)))
    common = sorted({g for s in scenes.values() for g in s})
    # One line a scene: the digests in the order of `items`, "-" for those that it has not.
    lines = [f'  "{n}": "{" ".join(s.get(g, "-") for g in common)}"' for n, s in scenes.items()]
    STORED.write_text("{\n" +
                      f'"fingerprint": "{fingerprint()}",\n"items": {json.dumps(common, indent=0)},\n"scenes": {{\n' +
                      ",\n".join(lines) + "\n}\n}\n")


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--record", action="store_true")
    p.add_argument("--compare", metavar="OTHER", type=os.path.abspath)
    p.add_argument("names", nargs="*", choices=[*SCENES, []])
    o = p.parse_args()
    if o.record:
        record()
    elif o.compare:
        return 1 if compare(o.compare, o.names) else 0
    else:
        p.error("--record or --compare OTHER")
    return 0


if __name__ == "__main__":
    sys.exit(main())
