# SPDX-License-Identifier: MIT
"""The same bits with everything in use at once, on ranks, on threads and across stops: a moving window over floes in
parts, crushing, a vessel on a bridle that breaks, way-points, tide, wind, dynamic tilt, loads on the hull. Each has a
test of its own; here one meets the other.

What turned this test red when it was written: an overlap of −0 on one rank and of 0 on two, where a cell had no other
contacts than one that just touched.
"""
import json

from harness import run
from test_outlines_ranks import with_bays
from test_ranks import assert_legs_end_as

ALL = {
    "run": {"dt": 0.1, "duration": 36},
    "domain": {"frame": "geographic", "length": 24, "width": 18, "ends": "moving", "sides": "periodic", "ahead": 14},
    "ice": {
        "concentration": 0.5, "size": 1.2, "size_law": "lognormal", "thickness": 0.04, "thickness_law": "lognormal",
        "friction": 0.3, "restitution": 0.1, "crushing": {"pressure": "2 kPa", "least_length": 0.5}
    },
    "body": {"length": 2, "draft": 0.5},
    "tow": {
        "mode": "thrust", "programme": [[0, 0], [2, 0.8], [30, 0.8],
                                        [36, 0.5]], "waypoints": [[12, 0], [30, 4], [90, 4]], "turn_radius": 3,
        "line_length": 3, "line_stiffness": 2000, "line_damping": 100, "line": {"branches": 2,
                                                           "breaking_load": 0}, "branch2": {"breaking_load": 150},
        "vessel": {"mass": 800, "bollard_pull": 600, "free_speed": 3, "lookahead": 3}
    },
    "water": {
        "latitude": 75, "current_x": 0.05, "tilt": "dynamic",
        "tide": {"major": 0.05, "minor": 0.02, "period": 30, "inclination": 40}
    },
    "air": {"wind_x": -3, "wind_y": 3},
    "impact": {"conversion": "crushing", "pressure": "20 kPa"},
    "solver": {"cell_size": 2.5, "max_sweeps": 40, "rest_speed": 1e-3},
    "output": {"frame_interval": 6, "panels": True},
}


def test_everything_at_once(tmp_path):
    case = with_bays(tmp_path, ALL)
    text = json.loads(case.read_text())
    text["ice"] |= {"size": 1, "crushing": ALL["ice"]["crushing"]}
    case.write_text(json.dumps(text))
    one = run(tmp_path, case, "--threads", 1, "--quiet")
    s = one.summary
    assert s["moving_window"]["laps"] > 0.4 and s["moving_window"]["renewed"] > 30 and s["outlines"]["split"] > 50
    assert one.series("crushed_work").sum() > 0 and len(one.series("tow_force")) == 360
    assert len(s["events"]) >= 2 and s["momentum_residual"] < 1e-9
    checkpoint = assert_legs_end_as(one, tmp_path, 131, 180)
    assert all(checkpoint[name].any() for name in ("contacts/law", "bodies/copy", "contacts/part"))
