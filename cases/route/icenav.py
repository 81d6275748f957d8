#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Routes by the published cost of AUTO-IceNav and by ours, both towed here: de Schaetzen et al. 2024, arXiv 2411.17155.

    /usr/bin/python3 cases/route/icenav.py [-o DIR] [--fields N] [--minutes M] [--concentrations 0.2,0.3,0.4,0.5]

Their cost of a cell that a floe of mass m and radius r covers at a distance d from its centre, for a ship of mass M at
the speed v, is

    v² m M (m + 2 M) / (2 (m + M)²) · ((r + ½)² − d²) / (r + ½)² · (ice concentration about it)^k,

lengths in cells, to which a path adds its length. The numbers are those of the configuration of their simulations:
cells of 2 m, weight 4.8e-7, floes swollen by 15 %, concentration over 51 × 51 cells, k = 1; the field, too: 1100 × 200
m, a vessel of 18 m beam, 6000 t and 2 m/s, floes of 4 to 100 m and 1.2 m. It is their cost on our lattice, not their
program: without their smoothing by optimisation and their new plan every 30 s. The vessel is a disc of its beam: a body
whose speed is prescribed keeps its yaw, and one of 76 m would go aslant through the ice. Goes on where it stopped.
"""
import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import scipy.ndimage
from matplotlib.path import Path as Outline

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "postproc"))
os.environ.setdefault("BERGTOW", str(HERE.parents[1] / "build/release/bergtow"))
from bergtow._program import program_path  # noqa: E402
from bergtow.result.run import Run  # noqa: E402
from bergtow.routing import planner, situation, tows  # noqa: E402
from bergtow.stats.mean import t_interval  # noqa: E402
from bergtow.table import table  # noqa: E402
from bergtow.writing import write_json  # noqa: E402

CELL, KERNEL, WEIGHT, SWOLLEN, POWER = 2.0, 51, 4.8e-7, 1.15, 1  # m, cells, per J, of the radius
LENGTH, WIDTH, SPEED, MASS, BEAM = 1100.0, 200.0, 2.0, 6e6, 18.0
CASE = {
    "run": {"title": "vessel in a channel of broken ice", "dt": "0.5 s", "duration": "10 min"},
    "domain": {"frame": "geographic", "length": "1100 m", "width": "200 m", "x0": "0 m", "ends": "open",
               "sides": "open"},
    "ice": {"size": "20 m", "size_law": "lognormal", "size_spread": 0.6, "size_min": "4 m", "size_max": "100 m",
            "thickness": "1.2 m", "friction": 0.35, "restitution": 0},
    "body": {"shape": "disc", "length": "18 m", "draft": "6 m", "mass": "6000 t", "drag": {"water_form": 0.1},
             "x": "60 m", "y": "0 m"},
    "tow": {"mode": "speed", "speed": "2 m/s", "ramp": "30 s"},
}
NAMES = "work", "largest"


def cost_of_cells(ice):
    """[ny, nx] of their cells, in cells of way."""
    nx, ny = round(LENGTH / CELL), round(WIDTH / CELL)
    x, y = np.meshgrid(np.arange(nx) + 0.5, np.arange(ny) + 0.5)
    middles, cost, there = np.column_stack([x.ravel(), y.ravel()]), np.zeros(nx * ny), np.zeros(nx * ny, bool)
    for outline, h in zip(ice.outlines, ice.thickness):
        v = (np.asarray(outline) - [0, -WIDTH / 2]) / CELL
        w = np.roll(v, -1, axis=0)
        cross = v[:, 0] * w[:, 1] - w[:, 0] * v[:, 1]
        area = cross.sum() / 2
        centre = ((v + w) * cross[:, None]).sum(axis=0) / (6 * area)
        swollen = centre + SWOLLEN * (v - centre)
        radius = np.hypot(*(swollen - centre).T).max()
        some = np.flatnonzero(np.hypot(*(middles - centre).T) <= radius)
        there[some[Outline(v).contains_points(middles[some])]] = True
        some = some[Outline(swollen).contains_points(middles[some])]
        m = ice.density * h * abs(area) * CELL ** 2
        lost = SPEED ** 2 * m * MASS * (m + 2 * MASS) / (2 * (m + MASS) ** 2)
        shape = 1 - ((middles[some] - centre) ** 2).sum(axis=1) / (radius + 0.5) ** 2
        cost[some] = np.maximum(cost[some], WEIGHT * lost * shape)
    cover = scipy.ndimage.uniform_filter(there.reshape(ny, nx).astype(float), KERNEL, mode="nearest")
    return cost.reshape(ny, nx) * cover ** POWER


def as_ice(cost):
    """Cells as floes whose ploughing costs what the cells do, of a hull whose drag is 1 N at 1 m/s: a way of one cell
    costs CELL, so does a cell of cost 1."""
    j, i = np.nonzero(cost > 0)
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    outlines = (np.column_stack([i, j])[:, None, :] + corner) * CELL + [0, -WIDTH / 2]
    return planner.Ice(list(outlines), cost[j, i] / CELL, density=1)


def field(out, concentration, number):
    """{name: outcome} of a field: straight, theirs, ours."""
    folder = out / f"c{round(100 * concentration):02d}" / f"f{number:03d}"
    file = folder / "towed.json"
    if file.exists():
        return json.loads(file.read_text())
    folder.mkdir(parents=True, exist_ok=True)
    case = json.loads(json.dumps(CASE))
    case["ice"] |= {"concentration": concentration, "seed": 200 + number}
    path = folder / "case.yml"
    path.write_text(json.dumps(case, indent=1))
    s = situation.of(program_path(), path, folder, None, (), BEAM)
    half = WIDTH / 2 - s.hull.radius
    goal, more = ((1040.0, -half), (1040.0, half)), {"extent": s.extent, "radius": 2 * BEAM, "routes": 1}
    ours = planner.plan(s.ice, s.hull, s.start, goal, speeds=(SPEED,), **more)
    unit = planner.Hull(s.hull.width, s.hull.radius, 1.0)
    theirs = planner.plan(as_ice(cost_of_cells(s.ice)), unit, s.start, goal, speeds=(1.0,), weights=planner.Weights(
        compaction=0, large=0), **more)
    found = {}
    for name, route in (("straight", ours.routes[0]), ("theirs", min(theirs.routes, key=lambda r: r.cost)),
                        ("ours", min(ours.routes, key=lambda r: r.cost))):
        c = tows.candidate(name, name, route, SPEED, s)
        sets = [w for k, v in (c.keys | situation.reading(s.values, s.field.resolve()) |
                               {"output.frame_interval": "-1 s"}).items() for w in ("--set", f"{k}={v}")]
        subprocess.run([program_path(), "run", path, "-o", folder / name, "--quiet", "--threads", "1", "--force",
                        *sets], check=True)
        with Run(folder / name) as run:
            found[name] = tows.outcome(run, c, goal, s) | {"kind": route.kind}
    write_json(found, file, True)
    return found


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("-o", "--output", type=Path, default=Path("out/route-icenav"))
    p.add_argument("--fields", type=int, default=20)
    p.add_argument("--concentrations", default="0.2,0.3,0.4,0.5")
    p.add_argument("--minutes", type=float, default=30, help="after which no field is begun")
    a = p.parse_args()
    end, done = time.monotonic() + 60 * a.minutes, {}
    for number in range(a.fields):
        for concentration in map(float, a.concentrations.split(",")):
            there = a.output / f"c{round(100 * concentration):02d}/f{number:03d}/towed.json"
            if time.monotonic() < end or there.exists():
                done.setdefault(concentration, []).append(field(a.output, concentration, number))
    rows = []
    for concentration, some in sorted(done.items()):
        row = [f"{100 * concentration:.0f}", str(len(some))]
        for name in NAMES:
            for one, other in (("theirs", "straight"), ("ours", "straight"), ("ours", "theirs")):
                change = np.array([f[one][name] / f[other][name] - 1 for f in some])
                low, high = t_interval(change)
                row.append(f"{100 * change.mean():+.1f} ({100 * low:+.1f} to {100 * high:+.1f})")
        rows.append(row)
    head = [f"{name}, %: {pair}" for name in ("work", "largest load") for pair in
            ("theirs / straight", "ours / straight", "ours / theirs")]
    print(table(["ice, %", "fields", *head], rows, True))


if __name__ == "__main__":
    main()
