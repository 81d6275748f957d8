# SPDX-License-Identifier: MIT
"""The result does not depend on threads, on the moment, or on the way by which the same case was given.

A data race may hide in a single run. So the cases are large enough for every loop that may run in parallel (3,000 rows
in the solver, 2,000 bodies elsewhere), go on for many sweeps, and are compared in all series and frames, not in the
hash alone.
"""
import re

import h5py
import numpy as np
import pytest

from harness import PRESS, TOW, call, changed, differing, environment, reading, run

pytestmark = pytest.mark.one_rank

ROWS_FOR_THREADS, BODIES_FOR_THREADS = 3000, 2000

# A heavy body on a line among the same floes: rows of the large body, the line's own row, and restitution.
LINE = changed(PRESS, domain__ends_closing=0, domain__sides_closing=0, body={"shape": "disc", "length": 6, "x": 8},
               tow={"mode": "line", "speed": 0.5, "ramp": 0, "line_length": 2, "line_damping": 0, "hull_y": 1,
                    "hull_x": 2}, ice__restitution=0.3, run__duration=3)
# Periodic both ways, restless and under every force, in a tide that turns: floes cross the seams.
SEAMS = changed(
    PRESS,
    domain={"length": 66, "width": 40, "ends": "periodic", "sides": "periodic"},
    body={"shape": "none"},
    water={
        "latitude": 75, "current_x": 0.4, "current_y": -0.3, "tilt": "dynamic",
        "tide": {"major": 0.2, "minor": -0.1, "period": 5}
    },
    air={"wind_x": -8, "wind_y": 11},
    run__duration=3,
    ice={"concentration": 0.7, "size": 0.8, "thickness_law": "lognormal", "size_law": "lognormal", "size_spread": 0.4})
CASES = {"press": PRESS, "line": LINE, "seams": SEAMS}


@pytest.fixture(scope="module", params=CASES)
def one_thread(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    case = CASES[request.param]
    return case, run(folder, case, "--threads", 1), folder


def assert_same(a, b):
    assert a.hash == b.hash
    assert differing(a.dir / "result.h5", b.dir / "result.h5") == []


def test_the_cases_reach_the_parallel_loops(one_thread):
    """Otherwise the tests below would compare one thread with one thread."""
    case, r, _ = one_thread
    assert r.summary["n_floes"] > BODIES_FOR_THREADS
    contacts, sweeps = r.series("contacts", "sweeps")
    assert np.sum(sweeps[contacts > ROWS_FOR_THREADS]) > 100, (contacts, sweeps)
    if "tow" in case:
        assert r.series("ice_resistance").max() > 0 and r.series("line_tension").max() > 0
    if case["domain"].get("ends") == "periodic":
        pose = r.dataset("/frames/pose")
        jumps = np.abs(np.diff(pose[:, :, 0], axis=0)) > 33
        assert jumps.any(), "no floe crossed the seam"


@pytest.mark.parametrize("threads", [2, 4])
def test_threads(one_thread, threads):
    case, one, folder = one_thread
    many = run(folder, case, "--threads", threads, name=f"out{threads}", env=environment())
    assert many.summary["threads"] == threads
    assert_same(one, many)


def test_run_again(one_thread):
    case, one, folder = one_thread
    assert_same(one, run(folder, case, "--threads", 1, name="again"))


def test_threads_of_the_environment(tmp_path):
    one = run(tmp_path, TOW, name="one")
    three = run(tmp_path, TOW, name="three", env=environment(OMP_NUM_THREADS=3, OMP_DYNAMIC="false"))
    assert (one.summary["threads"], three.summary["threads"]) == (1, 3)
    assert_same(one, three)


def test_threads_of_the_case_file(tmp_path):
    one = run(tmp_path, TOW, name="one")
    two = run(tmp_path, changed(TOW, run__threads=2), name="two", env=environment())
    assert (one.summary["threads"], two.summary["threads"]) == (1, 2)
    assert one.hash == two.hash
    assert differing(one.dir / "result.h5", two.dir / "result.h5", but=("/case", "/case_as_given")) == []


# A case that sets keys of every type and unit, away from their defaults and from round binary numbers.
ODD = changed(TOW,
              run__title="odd: \"quoted\" # not a comment",
              run__duration="0.1 min",
              domain__x0="-1.3 m",
              body__x="2.1 m",
              body__yaw="17 deg",
              body__shape="polygon",
              body__length=None,
              body__vertices=[[-1.1, -0.7], [1.3, -0.6], [0.4, 0.9], [-0.8, 0.7]],
              ice={
                  "concentration": "47 %", "size": "63 cm", "thickness": "4.1 cm", "friction": 0.17,
                  "restitution": 0.21, "seed": 987654321, "shape": "polygons", "sides": 5, "drag": {"water_form": 0.7}
              },
              tow={
                  "mode": "line", "speed": "0.31 kn", "direction": "7 deg", "ramp": 0.3, "line_stiffness": "3.3 kN",
                  "line_length": 1.7
              },
              water={"latitude": "71.3 deg", "current_y": "3 cm/s"},
              air={"wind_x": "7 kn"})
# By hand: outline, pose, velocity, thickness and a fixed one must all come back.
HAND = {
    "run": {"dt": 0.1, "duration": 8},
    "domain": {"length": 9, "width": 5.3, "sides": "periodic"},
    "ice": {"concentration": 0},
    "body": {"shape": "none"},
    "floes": [{"shape": "disc", "length": 1.1, "x": 2, "y": 0.1, "yaw": 50, "vx": 0.37, "vy": -0.11, "yaw_rate": 7}, {
        "shape": "polygon", "vertices": [[0, 0], [1.7, 0], [1, 1.3]], "x": 5, "y": -0.1, "yaw": 31, "thickness": "7 cm"
    }, {"shape": "rectangle", "length": 1.9, "width": 0.6, "x": 7.7, "y": 0, "yaw": 80, "fixed": True}],
}


@pytest.mark.parametrize("case", [ODD, HAND], ids=["odd", "hand"])
def test_the_resolved_case_is_the_same_case(tmp_path, case):
    first = run(tmp_path, case, name="first")
    again = run(tmp_path, first.dir / "case.resolved.yml", name="again")
    assert first.hash == again.hash
    assert differing(first.dir / "result.h5", again.dir / "result.h5", but=("/case_as_given",)) == []
    # And the numbers are not the defaults.
    plain = run(tmp_path, changed(HAND if case is HAND else TOW, run__duration=6), name="plain")
    assert plain.hash != first.hash


def test_overrides_stand_in_the_resolved_case(tmp_path):
    given = run(tmp_path, TOW, "--set", "ice.seed=7", "--set", "tow.speed=0.2", "--set", "run.duration=10",
                name="given")
    again = run(tmp_path, given.dir / "case.resolved.yml", name="again")
    written = run(tmp_path, changed(TOW, ice__seed=7, tow__speed=0.2, run__duration=10), name="written")
    assert given.hash == again.hash == written.hash
    assert run(tmp_path, changed(TOW, run__duration=10), name="other").hash != given.hash


@pytest.mark.parametrize("case", [changed(TOW, run__duration=10, ice__thickness_law="lognormal"),
                                  changed(SEAMS, domain__length=14, domain__width=9)], ids=["walls", "seams"])
def test_a_field_read_back_is_the_field_made(tmp_path, case):
    made = run(tmp_path, case, name="made")
    result = call("field", tmp_path / "case.yml", "-o", tmp_path / "field.h5")
    assert result.returncode == 0, result.stderr
    read = run(tmp_path, reading(case, "field.h5"), name="read")
    assert made.hash == read.hash
    # The second run had the field from the file: another seed makes no difference to it, but does to a field that is
    # made.
    seed = run(tmp_path, changed(reading(case, "field.h5"), ice__seed=99), name="seed")
    other = run(tmp_path, changed(case, ice__seed=99), name="other")
    assert seed.hash == made.hash != other.hash
    assert differing(made.dir / "result.h5", read.dir / "result.h5", but=("/case", "/case_as_given")) == []


def test_sampling_and_frames_do_not_touch_the_state(tmp_path):
    plain = run(tmp_path, TOW, name="plain")
    watched = run(tmp_path, TOW, "--set", "output.sample_every=7", "--set", "output.frame_interval=0.1", "--quiet",
                  "--dump-contacts", f"50:{tmp_path / 'dump.h5'}", name="watched")
    assert plain.hash == watched.hash
    every, seventh = plain.series("ice_resistance"), watched.series("ice_resistance")
    assert len(seventh) == -(-len(every) // 7)
    np.testing.assert_allclose(seventh[:42], every[:294].reshape(42, 7).mean(axis=1), rtol=1e-12, atol=1e-12)
    with h5py.File(tmp_path / "dump.h5") as f:
        assert f["fclib_local/W/m"][()][0] > 0
    assert re.fullmatch("[0-9a-f]{16}", plain.hash)


def test_the_hash_sees_the_last_bit(tmp_path):
    """A hash that ignored something would make every test above pass."""
    base = run(tmp_path, changed(HAND, run__duration=0.1), name="base").hash
    # A few bits more of a velocity are too little to change the pose in one step: the hash must see both. One bit more
    # of x = 2 is, too: x + 0.036 lies half-way between two numbers, and both are rounded to the same even one.
    nudged = []
    for key, value in (("x", 2 * (1 - 2e-16)), ("y", 0.1 * (1 + 2e-16)), ("yaw", 50 * (1 + 2e-16)),
                       ("vx", 0.37 * (1 + 1e-15)), ("yaw_rate", 7 * (1 + 1e-15))):
        case = changed(HAND, run__duration=0.1)
        case["floes"][0][key] = value
        assert value != HAND["floes"][0][key]
        nudged.append((key, run(tmp_path, case, name=key).hash != base))
    assert all(seen for _, seen in nudged), nudged
    still = {"run": {"dt": 0.1, "duration": 9}, "ice": {"concentration": 0.3}, "body": {"shape": "none"}}
    assert run(tmp_path, still, "--steps", 1, name="one").hash != run(tmp_path, still, "--steps", 2, name="two").hash


def test_the_plain_schedule_is_the_reference(one_thread):
    """Cells one after the other, without shares of threads: the same result as shared by two threads."""
    case, one, folder = one_thread
    plain = run(folder, changed(case, solver__plain_schedule=True), "--threads", 2, name="plain", env=environment())
    assert plain.hash == one.hash
    assert differing(one.dir / "result.h5", plain.dir / "result.h5", but=("/case", "/case_as_given")) == []
