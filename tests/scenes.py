#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Short scenes that use every mode and option, and digests of all that a run of each leaves: what holds a refactoring.

    tests/scenes.py --compare OTHER [NAME...]   run the scenes with $BERGTOW, each in its layout, and with another
                                                binary on one thread; prints the earliest differences; exit code 1
                                                if there are any
    tests/scenes.py --record [NAME...]          renew the scenes named, or all, in tests/parallel/scenes.json, after
                                                a change that is meant to move results, or for a new scene

Digests depend on the elementary functions of libm and on the compiler: scenes.json holds a fingerprint() of both.
"""
import argparse
import functools
import hashlib
import json
import math
import operator
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import h5py
import numpy as np

from harness import BERGTOW, CLOSING, PRESS, ROOT, TOW, changed, environment, launcher, machine_keys, write_case

STORED = ROOT / "tests/parallel/scenes.json"

#: (ranks, threads) of each leg of a run: after a leg it is stopped, and the next resumes it
LAYOUTS = [((1, 1),), ((1, 2),), ((2, 1),), ((1, 1), (1, 2)), ((3, 1),), ((2, 2), (3, 1))]

#: seconds that a leg may take, mpirun on a busy machine included
PATIENCE = 180

#: attributes of result.h5 that depend on program, machine, clock or layout: they must be there, as machine_keys of the
#: summary
PROVENANCE = {"version", "ranks", "threads", "command_line", "compiler", "flags", "host", "libraries", "revision",
              "start_time", "wall_time", "run"}  # the last: digest of a case that has the paths of its files

SHORT = changed(TOW, run__duration=4, output=None)
DENSE = changed(TOW, run__duration=4, output=None, ice__concentration=0.75, ice__size=0.9)
LINE = changed(SHORT, tow__mode="line", tow__line_length=3, tow__line_stiffness=2000, body__x=4)
SHIP = {"mass": 800, "bollard_pull": 600, "free_speed": 3, "lookahead": 2}
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
#: three flush pieces fill a period, one of them not convex, and a pier stands in the last
COAST = [{"shape": "polygon", "x": 6, "y": -4, "fixed": True,
          "vertices": [[-6, -0.9], [6, -0.9], [6, 0.4], [1, 1.1], [0, 0.5], [-1, 1], [-6, 0.4]]},
         {"shape": "polygon", "x": 15, "y": -4.2, "fixed": True,
          "vertices": [[-3, -0.9], [3, -0.9], [3, 0.9], [-3, 0.6]]},
         {"shape": "rectangle", "length": 6, "width": 1.5, "x": 21, "y": -4.25, "fixed": True},
         {"shape": "square", "length": 1, "x": 21, "y": -3.2, "yaw": 20, "fixed": True}]
SHAPES = [{"shape": "disc", "length": 1.1, "x": 5.5, "y": 0.1, "yaw": 50, "vx": -0.37, "vy": -0.11, "yaw_rate": 7},
          {"shape": "polygon", "vertices": [[0, 0], [1.7, 0], [1, 1.3]], "x": 7, "y": 0.3, "yaw": 31},
          {"shape": "rectangle", "length": 1.9, "width": 0.6, "x": 8.6, "y": 0, "yaw": 80, "vx": -0.5, "vy": 0},
          {"shape": "ship", "length": 2, "width": 0.7, "x": 5.5, "y": 1.8, "yaw": -50, "vx": 0.1, "vy": -0.5},
          {"shape": "square", "length": 0.9, "x": 6, "y": -1.6, "yaw": 10, "vx": 0, "vy": 0.3, "yaw_rate": -40}]
# Floes that fit with a clearance between the piers of four gates, which they pass in one step or more.
GATES = {
    "run": {"dt": 2, "duration": 40},
    "domain": {"length": 24, "width": 16, "ends": "periodic", "sides": "periodic"},
    "ice": {"concentration": 0, "friction": 0.3, "drag": {"water_form": 0, "water_skin": 0}},
    "floes": [{"shape": "square", "length": 1.5, "x": 3 + 6 * (k // 8), "y": -7 + 2 * (k % 8), "fixed": k // 8 % 2 == 0,
               "vx": 0, "vy": 0.03 * (k // 8 % 2)} for k in range(32)] +
             [{"shape": "square", "length": 0.3 + 0.02 * (k % 8), "x": 0.7 + 6 * (k // 8), "y": -6 + 2 * (k % 8),
               "yaw": 45 * (k % 2), "vx": 0.5 + 0.05 * (k % 5)} for k in range(32)],
    "body": {"shape": "none"},
}
# Two blocks of squares that turn and drive into each other: Newton's law of restitution would give them energy.
REBOUNDS = {
    "run": {"dt": 0.05, "duration": 2},
    "domain": {"length": 12, "width": 8, "ends": "periodic", "sides": "periodic"},
    "ice": {"concentration": 0, "friction": 1.5, "restitution": 0.9, "drag": {"water_form": 0, "water_skin": 0}},
    "floes": [{"shape": "square", "length": 0.8, "x": 3 + 0.85 * (k % 6), "y": -2 + 0.85 * (k // 6),
               "yaw": k * 6 % 7 - 3, "vx": (2 + k * 6 % 5 / 2) * (1 if k % 6 < 3 else -1), "vy": k * 6 % 9 / 2 - 2,
               "yaw_rate": k * 6 % 11 * 10 - 50} for k in range(24)],
    "body": {"shape": "none"},
    "guard": {"energy": 0},
}
#: between floes that stand fast, many of the same rebound farther within a step than there is room
NO_ROOM = changed(REBOUNDS, run__dt=0.5, run__duration=4, ice__friction=0.3, guard__unconverged=1000,
                  floes=[dict(floe, fixed=True, vx=0, vy=0, yaw_rate=0) if k % 5 == 0 else floe
                         for k, floe in enumerate(REBOUNDS["floes"])])
GEO_THRUST = {"mode": "thrust", "speed": 0.8, "ramp": 1, "line_length": 3, "line_stiffness": 2000, "line_damping": 100}
ORIGIN = {"origin_lon": 18.3, "origin_lat": 76.2}
PLANE = {"origin_east": 560123.5, "origin_north": 8490321.25}
DRAG = {"water_form": 0.7, "water_skin": 0.004, "air_form": 0.5, "air_skin": 0.003}

SCENES = {
    "speed": SHORT,
    "speed_dense": DENSE,
    "speed_direction": changed(SHORT, tow__direction=25, body__shape="ship", body__length=2, body__width=0.8,
                               body__yaw=10),
    "speed_programme": changed(SHORT, tow__ramp=None, tow__speed=None,
                               tow__programme=[[0, 0], [1, 0.4], [3, 0.1], [4, 0.3]]),
    "speed_waypoints": changed(SHORT, tow__speed=0.8, tow__waypoints=[[4, 1], [7, -1]], tow__turn_radius=0.8,
                               tow__ramp=0.2),
    "free_drift": changed(SHORT, tow={"mode": "none"}, body__vx=0.2, body__vy=-0.1, body__yaw_rate=20),
    "free_drift_start": changed(GEO, tow={"mode": "none"}, domain__ends="periodic", domain__ahead=None,
                                air__wind_x=5, water__current_y=0.1, ice__start="drift"),
    "rest_start": changed(GEO, ice__start="rest", air__wind_x=5, water__current_y=0.1),
    "line": changed(LINE, tow__speed=0.6, tow__ramp=0.5),
    "line_bridle_breaks": changed(LINE, tow__speed=0.9, tow__ramp=0.2, tow__line={"branches": 2, "breaking_load": 0},
                                  tow__branch2={"breaking_load": 20}),
    "line_fastened": changed(LINE, tow__speed=0.6, tow__ramp=0.5, tow__line_damping=300, tow__hull_x=0.6,
                             tow__hull_y=0.5),
    "bridle_unequal": changed(LINE, tow__speed=0.6, tow__ramp=0.5, tow__line={"branches": 2},
                              tow__branch2={"hull_x": 0.5, "hull_y": -0.8, "length": 2.8, "stiffness": 1500,
                                            "damping": 50}),
    "line_named": changed(LINE, tow__line_stiffness=None, tow__line={"type": "polypropylene", "diameter": "8 mm"}),
    "line_weight": changed(LINE, tow__line={"weight": 20, "branches": 2}),
    "thrust": changed(LINE, tow__mode="thrust", tow__speed=0.5, tow__vessel=SHIP),
    "thrust_waypoints": changed(GEO, tow=GEO_THRUST | {"waypoints": [[12, 0], [30, 4], [90, 4]], "turn_radius": 3,
                                                       "vessel": SHIP}),
    "vessel_details": changed(GEO, tow=GEO_THRUST | {
        "waypoints": [[5, 1], [8, 6], [40, 6]],
        "vessel": SHIP | {"added_mass": 0.2, "free_resistance": 300, "lateral_drag": 8}}),
    "window": changed(GEO, run__duration=8, tow__speed=1.6),
    "window_backwards": changed(GEO, tow__direction=180, ice__size_law="lognormal", ice__thickness_law="lognormal"),
    "current_and_wind": changed(SHORT, water__current_x=0.1, water__current_y=-0.05, air__wind_x=-6, air__wind_y=3),
    "tide": changed(GEO, water__tide={"major": 0.2, "minor": 0.05, "period": 12, "inclination": 30, "phase": 40}),
    "tables": changed(GEO, water__current_table="current.csv", air__wind_table="wind.csv"),
    "tilt": changed(GEO, water__tilt="geostrophic", water__current_x=0.1),
    "tilt_dynamic": changed(GEO, water__tilt="dynamic", water__tide={"major": 0.2, "minor": 0.0, "period": 10}),
    "slope": changed(GEO, water__tilt="slope", water__slope_x=1e-5, water__slope_y=-2e-5),
    "walls_closing": changed(PRESS, run__duration=1.5, domain__length=20, domain__width=16),
    "periodic_dense": changed(PRESS, run__duration=1.5, water__current_x=0.1, domain={
        "length": 20, "width": 16, "ends": "open", "sides": "periodic"}),
    "open_sides": changed(DENSE, domain__sides="open", domain__ends="open", water__current_y=0.1),
    "plain_sweeps": changed(DENSE, solver__plain=True, solver__max_sweeps=60),
    "plain_schedule": changed(DENSE, solver__plain_schedule=True, ice__restitution=0.2),
    "cold_start": changed(DENSE, solver__warm_start=False, solver__inner_sweeps=1, solver__cell_size=3),
    "few_sweeps": changed(CLOSING, run__duration=1.5),
    "solver_settings": changed(DENSE, solver={"tolerance": 1e-4, "reference_speed": 0.3, "slop": 5e-3,
                                              "position_sweeps": 1, "rest_speed": 0.05},
                               ice__restitution=0.4, tow__speed=0.5),
    "guards_wide": changed(CLOSING, run__duration=0.7,
                           guard={"overlap": 2, "energy": 0, "unconverged": 0, "no_solution": 0, "escape": False}),
    "restitution": changed(DENSE, ice__restitution=0.4, body__restitution=0.2, domain__wall_restitution=0.3,
                           tow__speed=0.5),
    "crushing": changed(DENSE, ice__crushing={"pressure": "2 kPa", "least_length": 0.5}, tow__speed=0.5),
    "crushing_press": changed(PRESS, run__duration=1.5, domain__length=20, domain__width=16,
                              domain__wall_friction=0.4, ice__crushing__pressure="20 kPa"),
    "rafting": changed(DENSE, ice__rafting__kappa=6, ice__concentration=0.85, tow__speed=0.5),
    "splitting": changed(DENSE, tow__speed=0.5, ice__crushing__pressure="100 kPa", ice__splitting={
        "toughness": 100, "strength": 200, "least_size": 0.1, "generations": 3, "aspect": 4, "reserve": 500,
        "scatter": 10}),
    "rafting_press": changed(PRESS, run__duration=1.5, domain__length=20, domain__width=16, ice__rafting__kappa=5,
                             ice__thickness_law="lognormal", ice__crushing__pressure="200 Pa"),
    "impacts_sine": changed(SHORT, tow__speed=0.6, impact__conversion="duration", output__panels=True,
                            impact__panels=12),
    "impacts_crushing": changed(SHORT, tow__speed=0.6, impact={"conversion": "crushing", "pressure": "20 kPa"}),
    "impact_duration": changed(SHORT, tow__speed=0.6, impact={"duration": 0.02, "least_speed": 0.1}),
    "impact_corner": changed(SHORT, tow__speed=0.6, impact={"conversion": "crushing", "corner_angle": 60}),
    "lead_channel": changed(SHORT, lead={"mode": "channel", "width": 2.5, "length": 4}, tow__speed=0.4),
    "lead_managed": changed(SHORT, lead={"mode": "managed", "width": 3, "floe_size": 0.4}, run__dt=0.05,
                            tow__speed=0.4),
    "rectangles": changed(SHORT, ice__shape="rectangles", ice__aspect=1.6, ice__concentration=0.7),
    "pentagons_power_law": changed(SHORT, ice__shape="polygons", ice__sides=5, ice__size=None, ice__size_law="power",
                                   ice__size_min=0.4, ice__size_max=1.6, ice__concentration=0.4,
                                   ice__size_exponent=1.6),
    "ice_region": changed(SHORT, domain__x0=-2, domain__y0=-3, ice=SHORT["ice"] | {
        "x_min": 1, "x_max": 12, "y_min": -2.5, "y_max": 4, "seed": 77, "shake": 5, "size_spread": 0.4,
        "thickness_law": "lognormal", "thickness_spread": 0.35}, body__y=0.5),
    "cut_from_a_larger_extent": changed(SHORT, domain__sides="periodic", ice__thickness_law="lognormal",
                                        ice__extent={"x_min": -2, "x_max": 27, "y_min": -9, "y_max": 8}),
    "drag_and_mass": changed(SHORT, ice__density=880, ice__added_mass=0.3, ice__added_inertia=0.2,
                             ice__drag=DRAG | {"tangential": 0.4, "sheltering": 3},
                             body=SHORT["body"] | {"sail": 0.2, "density": 850, "added_mass": 0.7, "added_inertia": 0.3,
                                                   "friction": 0.1, "drag": DRAG | {"tangential": 0.7}},
                             tow={"mode": "none"}, water={"density": 1015, "current_x": 0.1},
                             air={"density": 1.4, "wind_x": 6, "wind_y": -4}, ice__start="rest", body__vx=0.4,
                             body__yaw_rate=30),
    "floes_by_hand": changed(SHORT, ice__concentration=0, floes=SQUARES, tow__speed=0.5),
    "floes_of_each_shape": changed(SHORT, ice__concentration=0, floes=SHAPES, tow__speed=0.6),
    "one_fixed_floe": changed(SHORT, ice__concentration=0.3, floes=[{"shape": "disc", "length": 2, "x": 10, "y": 1,
                                                                   "fixed": True, "thickness": 0.1}], tow__speed=1),
    "coast": changed(LINE, domain={"length": 24, "width": 10, "ends": "periodic"}, floes=COAST, body__y=0.5,
                     run__duration=8, water={"current_x": 0.1, "current_y": -0.25}, ice__crushing={"pressure": 2e3},
                     ice__rafting={"kappa": 11}),
    "heavy_body_against_wall": changed(LINE, body__x=10, body__mass=2e4, tow__speed=0.5, tow__ramp=0.2,
                                       ice__concentration=0.6),
    "body_in_parts_outlines": changed(SHORT, ice={"friction": 0.3, "outlines": "bays.geojson", "nonconvex": "split"}),
    "outlines_hull": changed(SHORT, ice={"friction": 0.2, "outlines": "bays.geojson", "nonconvex": "hull"},
                             tow__speed=0.4),
    "outlines_degrees": changed(SHORT, ice={"outlines": "degrees.geojson", "outlines_crs": "lonlat",
                                            "nonconvex": "split", **ORIGIN}, tow__speed=0.4),
    "outlines_plane": changed(SHORT, ice={"outlines": "plane.geojson", "outlines_crs": "plane", "nonconvex": "split",
                                          **PLANE}, tow__speed=0.4),
    "outlines_frame": changed(SHORT, domain={"length": 15, "width": 8, "x0": 0, "y0": -4, "frame": "geographic",
                                                 "ends": "wall", "sides": "wall"}, ice={
        "outlines": "frame.geojson", "outlines_crs": "frame", "nonconvex": "hull"}, tow__speed=0.4),
    "field_file": changed(SHORT, ice={"friction": 0.3, "restitution": 0.1, "field": "field.h5"}, tow__speed=0.4),
    "output_settings": changed(SHORT, run__title="samples of three steps", report={
        "client": "a", "project": "b", "author": "c", "revision": "d", "document": "D-1", "distribution": "owner"},
                               output={
        "sample_every": 3, "window_start": 1, "frame_interval": 0.7, "checkpoint_steps": 7, "checkpoint_wall": 1}),
    "estimates": changed(SHORT, tow__speed=0.4, reference={"mean_force": 30, "source": "assumed"}, estimate={
        "p_star": 3e4, "p_s": 1e4, "c_si": 0.8, "kappa": 9, "kappa_low": 4, "kappa_high": 15, "phi_j": 0.85,
        "length_scale": 20}),
    "square_body": changed(SHORT, body__shape="square", body__yaw=20,
                           impact={"conversion": "crushing", "corner": "real"}),
    "rectangle_body": changed(SHORT, body__shape="rectangle", body__width=1.2, impact__conversion="none"),
    "polygon_body": changed(SHORT, body__shape="polygon", body__length=None, tow__speed=0.3,
                            body__vertices=[[1, -0.6], [1.2, 0.2], [0, 0.9], [-1, 0.4], [-0.8, -0.7]]),
    "steel_wire": changed(LINE, tow__line_stiffness=None, tow__line={"type": "steel-wire", "diameter": "4 mm"}),
    "dyneema": changed(LINE, tow__line_stiffness=None, tow__line={"type": "dyneema", "diameter": "4 mm"}),
    "no_body": changed(PRESS, run__duration=1, domain__length=18, domain__width=14, ice__concentration=0.8),
    "rebounds": REBOUNDS,
    "gates": GATES,
    "no_room": NO_ROOM,
}


def layouts_of(name):
    """The layout that is recorded, and another one; over the scenes each meets each."""
    k, n = list(SCENES).index(name), len(LAYOUTS)
    return LAYOUTS[k % n], LAYOUTS[(k + 1 + k // n % (n - 1)) % n]


class Failed(Exception):
    """A program did not end with exit code 0."""


def started(binary, ranks, folder, *arguments):
    mpi = launcher(ranks) if ranks > 1 else []
    env = environment()
    done = subprocess.run([*mpi, str(binary), *map(str, arguments)], cwd=folder, env=env, capture_output=True,
                          text=True, timeout=PATIENCE)
    if done.returncode != 0:
        raise Failed(f"{' '.join(done.args)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")


def draw_outlines(folder, name, binary):
    """The field of a small case as GeoJSON whose shores are drawn in towards the middle."""
    ice = {"concentration": 0.45, **(ORIGIN if name == "degrees.geojson" else {})}
    write_case(folder, changed(SHORT, ice=SHORT["ice"] | ice), "grounds.yml")
    started(binary, 1, folder, "field", "grounds.yml", "-o", name)
    drawn = json.loads((folder / name).read_text())
    east, north = (PLANE["origin_east"], PLANE["origin_north"]) if name == "plane.geojson" else (0, 0)
    if name != "bays.geojson":
        drawn.pop("crs", None)
    for k, feature in enumerate(drawn["features"]):
        ring = [(x + east, y + north) for x, y in feature["geometry"]["coordinates"][0][:-1]]
        # sum() compensates from Python 3.12 on, and the last bit would depend on the release
        middle, out = [functools.reduce(operator.add, c) / len(ring) for c in zip(*ring)], []
        for i, (p, q) in enumerate(zip(ring, ring[1:] + ring[:1])):
            bay = 1 - 0.03 * ((3 * k + 5 * i) % 8)
            out += [list(p), [m + ((a + b) / 2 - m) * bay for a, b, m in zip(p, q, middle)]]
        feature["geometry"]["coordinates"] = [out + out[:1]]
    (folder / name).write_text(json.dumps(drawn))


def prepare(folder, case, binary):
    """The case and the files that it names."""
    write_case(folder, case)
    (folder / "current.csv").write_text("t,u,v\n0,0.05,0\n2,0.1,-0.05\n20,0,0.1\n")
    (folder / "wind.csv").write_text("t,u,v\n0,-3,1\n20,4,2\n")
    if "field" in case["ice"]:
        write_case(folder, changed(SHORT, ice__concentration=0.45), "grounds.yml")
        started(binary, 1, folder, "field", "grounds.yml", "-o", case["ice"]["field"])
    if "outlines" in case["ice"]:
        draw_outlines(folder, case["ice"]["outlines"], binary)


def run_scene(folder, name, layout, binary=BERGTOW):
    """Run a scene in a layout; returns {item: value} of everything that it leaves."""
    folder.mkdir(parents=True, exist_ok=True)
    case = SCENES[name]
    prepare(folder, case, binary)
    steps = round(case["run"]["duration"] / case["run"]["dt"])
    for leg, (ranks, threads) in enumerate(layout):
        what = ["resume", "out"] if leg else ["run", "case.yml", "-o", "out"]
        stop = ["--steps", steps * (leg + 1) // len(layout)] if leg + 1 < len(layout) else []
        started(binary, ranks, folder, *what, "--threads", threads, "--quiet", *stop)
    return items_of(folder / "out")


def leaves(path, value):
    """(path, text) of all that a value of the summary holds: each key by itself, in a list of maps, too. Texts of
    warnings may change: their codes and values stand for them."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(f"{path}.{key}", inner)
    elif isinstance(value, list) and value and all(isinstance(v, dict) for v in value):
        yield path, f"{len(value)} entries"
        for key in dict.fromkeys(k for v in value for k in v if k != "text"):
            yield f"{path}[].{key}", json.dumps([v.get(key) for v in value])
    else:
        yield path, json.dumps(value) if value != [] else "0 entries"


def items_of(folder):
    """Everything that a run has left as {item: array or text}; of what is volatile, only that it is there."""
    items = {}

    def attributes(at, holder):
        for key, value in holder.attrs.items():
            if key != "description":
                plain = value.item() if isinstance(value, np.generic) else value  # NumPy 2 has another repr of its own
                items[f"{at}@{key}"] = "there" if key in PROVENANCE else repr(plain)

    def take(name, item):
        if isinstance(item, h5py.Group):
            attributes("/" + name, item)
        elif name.startswith("case"):
            items["/" + name] = "there"
        else:
            items["/" + name] = repr(item[()].tolist()) if item.dtype.kind == "O" else np.asarray(item[()])

    with h5py.File(folder / "result.h5") as f:
        attributes("/", f)
        f.visititems(take)
    for key, value in json.loads((folder / "summary.json").read_text()).items():
        items.update(leaves("summary." + key, "there" if key in machine_keys() | PROVENANCE else value))
    return items


def raw(value):
    return value.encode() if isinstance(value, str) else f"{value.dtype} {value.shape} ".encode() + value.tobytes()


def differing(a, b):
    """Items that are not in both, or not the same to the bit."""
    return sorted(n for n in a.keys() | b.keys() if n not in a or n not in b or raw(a[n]) != raw(b[n]))


def version(binary):
    return subprocess.run([binary, "--version"], capture_output=True, text=True, check=True).stdout.strip()


def digests(items):
    """{item: digest}; the frames of /xdmf are one item for each quantity."""
    hashes = {}
    for name in sorted(items):
        h = hashes.setdefault(re.sub(r"/\d+(?=/)", "/*", name), hashlib.sha256())
        h.update(name.encode() + b"\0" + raw(items[name]))
    return {name: h.hexdigest()[:6] for name, h in hashes.items()}


def stored():
    """scenes.json as (binary of the last record of all scenes, {scene: {item: digest}})."""
    j = json.loads(STORED.read_text())
    return j["recorded_with"], {
        n: {i: d for i, d in zip(j["items"], s.split()) if d != "-"} for n, s in j["scenes"].items()}


def store(binary, scenes):
    # One line for each scene: the digests in the order of `items`, "-" for those that it has not.
    items = sorted({i for s in scenes.values() for i in s})
    lines = [f'  "{n}": "{" ".join(scenes[n].get(i, "-") for i in items)}"' for n in SCENES if n in scenes]
    STORED.write_text(f'{{\n"recorded_with": "{binary}",\n'
                      f'"items": {json.dumps(items, indent=0)},\n"scenes": {{\n' + ",\n".join(lines) + "\n}\n}\n")


def departed(name, items):
    """(gone, new, changed): items of a run of a scene beside what is stored of it."""
    want, found = stored()[1][name], digests(items)
    return (sorted(want.keys() - found.keys()), sorted(found.keys() - want.keys()),
            sorted(i for i in want if i in found and want[i] != found[i]))


def record(names):
    binary, scenes = stored() if names else (version(BERGTOW), {})
    for name in names or SCENES:
        with tempfile.TemporaryDirectory() as folder:
            scenes[name] = digests(run_scene(pathlib.Path(folder), name, layouts_of(name)[0]))
    store(binary, scenes)


def first_difference(a, b):
    """(row, words): where two values of an item first differ, and what they are there, mine before theirs."""
    if isinstance(a, str) or isinstance(b, str):
        return math.inf, f"{a!s:.200} and {b!s:.200}"
    if (a.dtype, a.shape) != (b.dtype, b.shape):
        return -1, f"{a.dtype} {list(a.shape)} and {b.dtype} {list(b.shape)}"
    p, q = (np.frombuffer(v.tobytes(), np.uint8).reshape(-1, v.itemsize) for v in (a, b))
    at = np.unravel_index(int(np.flatnonzero((p != q).any(axis=1))[0]), a.shape)
    return at[0] if at else 0, f"[{', '.join(map(str, at))}] {a[at].item()!r} and {b[at].item()!r}"


def moved(mine, theirs):
    """(what is new, what is gone or changed) in words; of the latter series come first, by row."""
    apart = differing(mine, theirs)
    found = [(False, -1, f"{n} is gone") for n in apart if n not in mine]
    for n in set(apart) & mine.keys() & theirs.keys():
        row, words = first_difference(mine[n], theirs[n])
        found.append((not n.startswith("/series/"), row, f"{n} {words}"))
    return [n for n in apart if n not in theirs], [words for *_, words in sorted(found)]


def compare(other, names):
    """How many scenes differ, or do not run with both binaries."""
    different = 0
    for name in names or SCENES:
        layout = layouts_of(name)[0]
        with tempfile.TemporaryDirectory() as folder:
            try:
                new, found = moved(run_scene(pathlib.Path(folder) / "mine", name, layout),
                                   run_scene(pathlib.Path(folder) / "other", name, LAYOUTS[0], other))
            except Failed as e:
                new, found = [], [str(e)]
        print(f"{name} {layout}: {f'{len(found)} items differ' if found else 'same'}"
              + (f"; new: {', '.join(new)}" if new else ""))
        print("".join(f"    {words}\n" for words in found[:6]), end="", flush=True)
        different += bool(found)
    return different


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--record", action="store_true")
    p.add_argument("--compare", metavar="OTHER", type=os.path.abspath)
    p.add_argument("names", metavar="NAME", nargs="*", choices=[*SCENES, []])
    o = p.parse_args()
    if o.record == bool(o.compare):
        p.error("--record or --compare OTHER")
    if o.record:
        record(o.names)
    return 1 if o.compare and compare(o.compare, o.names) else 0


if __name__ == "__main__":
    sys.exit(main())
