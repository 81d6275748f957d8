# SPDX-License-Identifier: MIT
"""The verdicts of `bergtow converge` that the READMEs of the cases report: the basin at 50 % is resolved throughout but
for its walls, rigid ice at 90 % at full scale is found to be made by the width of the domain, and the jerk of a short
start is found where the ice leaves it the largest load, without being told (make test-long; 27 min on two cores)."""
import json
import subprocess

from harness import BERGTOW, ROOT, environment


def converged(folder, case, *more):
    done = subprocess.run([BERGTOW, "converge", ROOT / case, "-o", folder, *map(str, more)], cwd=folder,
                          env=environment(BERGTOW_HOME=ROOT), capture_output=True, text=True, timeout=6000)
    assert done.returncode == 0, done.stderr
    print(done.stdout)
    return json.loads((folder / "converge.json").read_text())["rows"]


def test_the_basin_at_half_concentration_is_resolved(tmp_path):
    rows = converged(tmp_path, "cases/basin/basin-50.yml", "--budget", 30)
    judged = {}
    for row in rows:
        judged.setdefault(row["name"], []).append(row["judged"])
    assert set(judged) == {"start", "width", "length", "dt", "tolerance", "window", "fields"}
    assert "open" not in [verdict for some in judged.values() for verdict in some], judged
    for name in "length", "dt", "tolerance":
        assert judged[name] == ["none"], (name, judged[name])
    assert judged["width"][0] == "matters" and judged["width"][-1] == "none"  # the walls are felt, in 10 m
    first = next(row for row in rows if row["name"] == "width")
    assert -0.6 < first["effect"] < -0.2


FULLSCALE = ["--set", "domain.width=1.2 km", "--set", "run.duration=1 h", "--set", "tow.ramp=1 min", "--tries", 1]


def test_rigid_ice_at_ninety_percent_is_made_by_the_width(tmp_path):
    """It jams, and bears more in the tow than in the start."""
    rows = converged(tmp_path, "cases/fullscale/berg.yml", "--vary", "start,width", "--budget", 45,
                     "--set", "ice.concentration=0.9", "--set", "ice.rafting.kappa=0", *FULLSCALE)
    start, width = (next(row for row in rows if row["name"] == name) for name in ("start", "width"))
    assert width["judged"] == "matters" and width["effect"] < -0.2 and width["to"] == 2400
    assert start["judged"] == "none" and start["effect"] < 0.1


def test_the_jerk_of_a_short_start_is_found(tmp_path):
    """80 m of iceberg to 0.5 m/s in a minute takes some 3.9 MN, six times the largest tow force in ice of 60 %."""
    start, = converged(tmp_path, "cases/fullscale/berg.yml", "--vary", "start", "--budget", 10, "--set",
                       "ice.concentration=0.6", *FULLSCALE)
    assert start["judged"] == "matters" and start["effect"] > 4 and start["to"] >= 240
