# SPDX-License-Identifier: MIT
"""Floes in convex parts on any number of ranks and threads: the same bits. Parts and what their contacts knew travel
with the floe.

What turns these tests red: contact memory that forgets its parts, marks of parts left behind in a migration,
parts in the order of memory.
"""
import json

import numpy as np
import pytest

from harness import VALIDATE, call, changed, quick, run, write_case
from test_ranks import assert_same, many

GROUNDS = {
    "run": {"dt": 0.1, "duration": 10},
    "domain": {"length": 20, "width": 12},
    "ice": {
        "concentration": 0.8, "size": 1.2, "size_law": "lognormal", "size_spread": 0.4, "friction": 0.3,
        "restitution": 0.1
    },
    "body": {"x": 4, "length": 2},
    "tow": {"mode": "line", "speed": 0.5, "ramp": 1, "line_length": 2},
    "solver": {"cell_size": 2, "max_sweeps": 30},
    "output": {"frame_interval": 2.5},
}
PERIODIC = changed(GROUNDS,
                   domain={"length": 20, "width": 12, "ends": "periodic", "sides": "periodic"},
                   body={"shape": "none"},
                   tow=None,
                   ice__concentration=0.8,
                   water={"latitude": 75, "current_x": 0.3, "current_y": -0.2},
                   air={"wind_x": -6, "wind_y": 8})
CASES = {"line": GROUNDS, "periodic": PERIODIC}


def with_bays(folder, case):
    """The case's own field with shores drawn in towards the middle, as outlines that it reads."""
    path = write_case(folder, case, "grounds.yml")
    assert call("field", path, "-o", folder / "convex.geojson").returncode == 0
    drawn = json.loads((folder / "convex.geojson").read_text())
    rng = np.random.default_rng(4)
    for feature in drawn["features"]:
        ring = np.array(feature["geometry"]["coordinates"][0][:-1])
        middle, out = ring.mean(axis=0), []
        for p, q in zip(ring, np.roll(ring, -1, axis=0)):
            out += [p, middle + ((p + q) / 2 - middle) * (1 - 0.25 * rng.random())]
        feature["geometry"]["coordinates"] = [[list(p) for p in out + out[:1]]]
    (folder / "bays.geojson").write_text(json.dumps(drawn))
    ice = {k: case["ice"][k] for k in ("friction", "restitution")}
    write_case(folder, changed(case, ice=ice | {"outlines": "bays.geojson", "nonconvex": "split"}))
    return folder / "case.yml"


@pytest.fixture(scope="module", params=CASES)
def alone(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    return folder, run(folder, with_bays(folder, CASES[request.param]), "--threads", 1, "--quiet")


def test_the_case_is_worth_it(alone):
    """Parts touch in every step, floes go to other ranks, bays are entered."""
    _, r = alone
    assert r.summary["outlines"]["split"] > 80 and r.summary["outlines"]["parts"] > 2 * r.summary["outlines"]["split"]
    assert r.series("contacts").mean() > 100
    assert r.summary["momentum_residual"] < 1e-9


@pytest.mark.parametrize("ranks, threads", quick([(2, 2), (3, 1)], (3, 1)))
def test_ranks_and_threads(alone, ranks, threads):
    folder, one = alone
    r = many(folder, ranks, threads)
    assert r.summary["moved_floes"] > 0
    assert_same(one, r)


def test_threads_and_checks_of_the_division(alone):
    """The build with assertions and with teams of threads for every loop."""
    folder, _ = alone
    short = run(folder, folder / "case.yml", "--threads", 1, "--steps", 60, "--quiet", name="short")
    assert_same(short, many(folder, 2, 2, "--steps", 60, name="checked", program=VALIDATE))
