# SPDX-License-Identifier: MIT
"""Guards as a user meets them: what ends a run, what no longer does, and what the last state is held against."""
import json
import re

import h5py
import numpy as np
import pytest

from harness import (CASE, CLOSING, DONE, NUMERIC, SIGNAL, TOW, Run, call, changed, placed, quick, run, worst_overlap,
                     write_case)

# A floe of 10¹⁶ kg at 100 m/s: more energy than sums hold.
HEAVY = {
    "run": {"dt": 1, "duration": 20},
    "domain": {"length": 1e6, "width": 1e6, "ends": "open", "sides": "open"},
    "ice": {"concentration": 0, "density": 1100, "added_mass": 10, "size": 1e5},
    "water": {"density": 1100},
    "body": {"shape": "none"},
    "floes": [{"shape": "disc", "length": 1e5, "x": 3e5, "y": 0, "thickness": 100, "vx": 100}],
}


def beyond(folder, frame=-1):
    """Floes whose centroid is beyond a wall of CLOSING in a frame."""
    with h5py.File(folder / "result.h5") as f:
        pose, time = f["frames/pose"][frame], f["frames/time"][frame]
    x, y = 0.9 * time, 0.6 * time
    return np.sum((pose[:, 0] < x) | (pose[:, 0] > 8 - x) | (np.abs(pose[:, 1]) > 3 - y))


def test_floes_beyond_walls_end_the_run_at_the_step_they_pass(tmp_path):
    """A run of fewer than 50 steps, and one that ends between two multiples of 50; walls are where they have closed
    to."""
    free = run(tmp_path, changed(CLOSING, guard__escape=False), "--quiet", name="free")
    assert beyond(free.dir) > 10
    r = run(tmp_path, CLOSING, "--quiet", code=NUMERIC)
    said = re.search(r"step (\d+): floe \d+ is beyond a wall \(guard.escape\)", r.result.stderr)
    assert said and not (r.dir / "summary.json").exists(), r.result.stderr
    step = int(said[1])
    before = run(tmp_path, changed(CLOSING, guard__escape=False), "--quiet", "--steps", step - 1, name="before")
    at = run(tmp_path, changed(CLOSING, guard__escape=False), "--quiet", "--steps", step, name="at")
    assert (beyond(before.dir), beyond(at.dir) > 0) == (0, True)
    assert said[0] in call("resume", r.dir / "failure.h5", "--quiet").stderr


#: floes each of whose energies fits into a sum, but not the four together
FOUR = {"run": {"dt": 1, "duration": 5},
        "domain": {"length": 2e6, "width": 2e6, "x0": -1e6, "y0": -1e6},
        "ice": {"concentration": 0, "thickness": 100, "start": "rest"}, "body": {"shape": "none"},
        "tow": {"mode": "none"},
        "floes": [{"shape": "square", "length": 9e4, "x": x, "y": 0, "vx": 95} for x in (-4e5, -2e5, 2e5, 4e5)]}


@pytest.mark.parametrize("case", [HEAVY, FOUR])
def test_energy_that_overflows_ends_the_run(tmp_path, case):
    r = run(tmp_path, case, "--quiet", code=NUMERIC)
    said = (r"step 1: kinetic_energy \(kinetic energy of all dynamic bodies.*\) is not a number, "
            r"or a sum of numbers too large")
    assert re.search(said, r.result.stderr), r.result.stderr
    assert (r.dir / "failure.h5").exists() and not (r.dir / "summary.json").exists()
    assert np.isfinite(r.series("kinetic_energy")).all() and not len(r.series("time"))


DRIVEN = [{"air__wind_x": 15}, {"air__wind_x": 15, "ice__thickness": 0.002},
          {"water__current_y": 1, "domain__sides": "periodic"},
          {"water__tide__major": 1, "water__tide__period": 40, "domain__sides": "periodic"},
          {"water__tilt": "slope", "water__slope_x": 0.01}]


@pytest.mark.parametrize("more", quick(DRIVEN, DRIVEN[0], DRIVEN[-1]))
def test_what_drives_the_ice_is_no_failure_on_a_slow_tow(tmp_path, more):
    """Wind, current, tide or slope that move the ice a hundred times faster than the tow, over as many steps as they
    take to."""
    r = run(tmp_path, changed(TOW, tow__speed=0.0005, solver__reference_speed=0.0005, solver__max_sweeps=40, **more),
            "--quiet")
    assert r.series("kinetic_energy").max() > 0


def test_a_table_of_wind_drives_the_ice(tmp_path):
    (tmp_path / "wind.csv").write_text("t,u,v\n0,0,0\n10,15,0\n40,15,0\n")
    run(tmp_path, changed(TOW, tow__speed=0.0005, solver__reference_speed=0.0005, solver__max_sweeps=40,
                          air={"wind_table": "wind.csv"}), "--quiet")


def test_energy_beyond_what_drives_the_ice_is_one(tmp_path):
    r = run(tmp_path, changed(TOW, air__wind_x=15, guard__energy=1e-3), "--quiet", code=NUMERIC)
    assert re.search(r"step \d+: the bodies have \S+ J of kinetic energy, more than the \S+ J that guard.energy allows",
                     r.result.stderr)


CLOSED = {"run": {"dt": 0.1, "duration": 100}, "domain": {"length": 10, "width": 8, "ends_closing": 0.02},
          "ice": {"concentration": 0.9, "size": 0.8}, "body": {"length": 2.8, "x": 5, "draft": 0.4},
          "tow": {"mode": "none"}}


@pytest.mark.parametrize("more, said", [
    ({}, "which would be a concentration of 1.59"),
    ({"domain__ends_closing": 0.04, "domain__sides_closing": 0.03, "body__shape": "rectangle", "body__length": 6,
      "body__width": 1}, "none beside the body")])
def test_walls_that_leave_rigid_floes_no_room_are_refused(tmp_path, more, said):
    """Also where the body alone is larger than what they leave: there is no concentration then."""
    path = write_case(tmp_path, changed(CLOSED, **more))
    r = call("check", path)
    assert r.returncode == CASE and f"less room than rigid floes take, {said}" in r.stderr, r.stderr
    assert call("check", path, "--set", "guard.overlap=0").returncode == DONE
    assert call("check", path, "--set", "ice.crushing.pressure=1000").returncode == DONE


def test_walls_that_leave_the_body_no_room_are_refused_whatever_the_ice(tmp_path):
    path = write_case(tmp_path, changed(CLOSED, domain__ends_closing=0.048, ice__crushing__pressure=1000))
    r = call("check", path)
    assert r.returncode == CASE and "0.4 m between the walls at the end of the run, and the body is 2.79" in r.stderr
    assert call("check", path, "--set", "run.duration=75").returncode == DONE
    assert call("check", path, "--set", "guard.overlap=0").returncode == DONE


# ---- the last state ----

LAST = changed(CLOSING, domain__ends_closing=0.3, domain__sides_closing=0.2, ice__concentration=0.6,
               guard={"overlap": 0, "escape": False}, run__duration=3, output__frame_interval=1,
               output__checkpoint_steps=7)


def measured(r):
    """Deepest overlap in the last frame, by its polygons: of the floes, and of floes with walls."""
    with h5py.File(r.dir / "result.h5") as f:
        vertices, offsets, pose = f["floes/vertices"][()], f["floes/offsets"][()], f["frames/pose"][-1]
        time = f["frames/time"][-1]
    polygons = [placed(vertices[a:b], p) for a, b, p in zip(offsets, offsets[1:], pose)]
    all_points = np.vstack(polygons)
    x, y = 0.3 * time, 0.2 * time
    return max(worst_overlap(polygons),
               x - all_points[:, 0].min(), all_points[:, 0].max() - 8 + x,
               y - 3 - all_points[:, 1].min(), all_points[:, 1].max() - 3 + y)


def test_the_largest_overlap_includes_the_last_state(tmp_path):
    r = run(tmp_path, LAST, "--quiet")
    deep = measured(r)
    assert deep > 1.01 * r.series("overlap").max(), "the last state is no deeper than those before: nothing is tested"
    assert r.summary["max_overlap_m"] == pytest.approx(deep, rel=1e-6)
    assert any(re.match(rf"bodies overlap by up to {deep:.2g} m", w) for w in r.warnings)


def test_the_last_look_leaves_no_trace_in_a_run_that_goes_on(tmp_path):
    """Stopped at steps where the last look would be deeper or not, and gone on with: summary, series and state of a run
    never stopped."""
    whole = run(tmp_path, LAST, "--quiet", name="whole")
    case = write_case(tmp_path, LAST)
    overlap = whole.series("overlap")
    steps = next(k for k in range(4, 20) if overlap[k] > overlap[:k].max())
    assert call("run", case, "-o", tmp_path / "bits", "--quiet", "--steps", steps).returncode == DONE
    stopped = json.loads((tmp_path / "bits/summary.json").read_text())["max_overlap_m"]
    assert stopped == overlap[steps] # what the next step has found
    for _ in range(3):
        assert call("resume", tmp_path / "bits", "--quiet", "--steps", 8).returncode in (DONE, SIGNAL)
    assert call("resume", tmp_path / "bits", "--quiet").returncode == DONE
    parts = Run(tmp_path / "bits", None)
    clocks = {"wall_time_s", "phases_s", "shared_s", "call_s", "ns_per_floe_step", "memory_per_floe_b"}
    assert {k: v
            for k, v in parts.summary.items()
            if k not in clocks} == {k: v
                                    for k, v in whole.summary.items()
                                    if k not in clocks}
    with h5py.File(whole.dir / "result.h5") as a, h5py.File(parts.dir / "result.h5") as b:
        assert all(np.array_equal(a["series"][n][:], b["series"][n][:], equal_nan=True) for n in a["series"])


def test_a_floe_that_slides_along_a_hull_that_turns_stays_outside(tmp_path):
    """Both turn alike, so their relative rotation is none; but the hull turns under the floe by its way along it."""
    still = {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0}
    r = run(tmp_path, {
        "run": {"dt": 5, "duration": 60},
        "domain": {"length": 600, "width": 600, "x0": -300, "ends": "open", "sides": "open"},
        "ice": {"concentration": 0, "size": 10, "thickness": 1, "friction": 0, "drag": still},
        "body": {"shape": "rectangle", "length": 80, "width": 16, "x": 0, "y": 0, "draft": 8, "yaw_rate": 1,
                 "drag": still},
        "tow": {"mode": "none"}, "floes": [{"shape": "square", "length": 10, "x": 12, "y": 13}]})
    slop = 0.001 * 10 * np.pi**-0.5 * 2  # of the floe's circle of equal area
    assert 0 < r.summary["max_overlap_m"] < 5 * slop


def test_an_overlap_of_the_last_state_is_held_against_its_guard(tmp_path):
    """The limit lies between what the steps have found and what the last one has left."""
    free = run(tmp_path, LAST, "--quiet", name="free")
    size = free.summary["mean_size_m"]
    limit = 0.5 * (free.series("overlap").max() + free.summary["max_overlap_m"]) / size
    r = run(tmp_path, changed(LAST, guard__overlap=limit), "--quiet", code=NUMERIC)
    assert re.search(r"step 30: two bodies overlap by \S+ m",
                     r.result.stderr) and not (r.dir / "summary.json").exists(), r.result.stderr
    again = call("resume", r.dir / "failure.h5", "--quiet")
    assert again.returncode == NUMERIC and "step 30: two bodies overlap" in again.stderr


# ---- what applies ----

@pytest.mark.parametrize("case, has", [
    (changed(TOW, run__duration=2), {"always", "with a towed body", "where collisions are identified"}),
    (changed(TOW, run__duration=2, tow__mode="line", tow__line_length=2,
             impact={"conversion": "none"}), {"always", "with a towed body", "with a tow line"}),
    (changed(TOW, run__duration=2, tow__mode="line", tow__line_length=3, tow__line={"branches": 2}), {
        "always", "with a towed body", "with a tow line", "with a tow line of two branches",
        "where collisions are identified"
    }),
    (changed(CLOSING, run__duration=0.6), {"always"}),
])
def test_each_series_says_when_it_applies(tmp_path, case, has):
    """Numbers where it does and NaN where it does not, as the attribute has it."""
    r = run(tmp_path, case, "--quiet")
    said = set()
    with h5py.File(r.dir / "result.h5") as f:
        for name, series in f["series"].items():
            applies = series.attrs["applies"]
            assert (np.isfinite if applies in has else np.isnan)(series[:]).all(), (name, applies)
            said.add(applies)
    assert has <= said and len(said) == 7
