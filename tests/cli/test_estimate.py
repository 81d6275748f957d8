# SPDX-License-Identifier: MIT
"""bergtow estimate, the estimates in the summary of a run, and the Froude-scaled twin that bergtow check --scale
prints."""
import json
import math

import numpy as np
import pytest

from harness import CASE, DONE, TOW, USAGE, call, changed, differing, run, write_case

G = 9.81
KINDS = ("lichey_hellmer", "marchenko_compaction", "marchenko_rafting", "marchenko_momentum", "dilute_limit",
         "ships_in_pack_ice", "open_water_drag")
BERG = {
    "run": {"dt": 5, "duration": 1000},
    "domain": {"frame": "geographic", "length": 5000, "width": 2000, "ends": "wall", "sides": "wall"},
    "ice": {"concentration": 0.8, "size": 30, "size_spread": 0, "thickness": 1.0, "restitution": 0.3},
    "body": {"shape": "rectangle", "length": 80, "width": 60, "draft": 50},
    "tow": {"speed": 0.5},
}


def estimate(folder, case, *arguments):
    result = call("estimate", write_case(folder, case), "--json", *arguments)
    assert result.returncode == DONE, result.stderr
    return json.loads(result.stdout)["estimates"]


def by_formula(a, h, w, v, r, e, rho=910.0, rho_w=1027.0, p_star=20e3, p_s=13e3, kappa=11.0, phi=0.9):
    """The formulas of include/bergtow/estimate.h, written down a second time."""
    p = p_star * h * math.exp(-20 * (1 - a))
    captured = a >= 0.9 and p >= p_s
    return {
        "lichey_hellmer": 0.0 if a <= 0.15 else p * w if captured else 0.5 * rho * h * w * v * v,
        "marchenko_compaction": p * w if a else 0.0,
        "marchenko_rafting": kappa * 0.5 * rho * (1 - rho / rho_w) * G * h * h * a * w,
        "marchenko_momentum": rho * h * w * v * v * a * phi / (phi - a) if a < phi else None,
        "dilute_limit": 4 / 3 * (1 + e) * a * rho * h * (w / 2 + r) * v * v,
        "ships_in_pack_ice": 0.5 * 16.1 * (v / math.sqrt(G * h * a))**-1.7937 * rho * w * h * v * v *
        a**3 if a else 0.0,
    }


@pytest.mark.parametrize("a, h", [(0.1, 1.0), (0.5, 0.4), (0.8, 1.0), (0.92, 1.0), (0.94, 4.0)])
def test_the_command_has_the_numbers_of_the_formulas(tmp_path, a, h):
    found = estimate(tmp_path, changed(BERG, ice__concentration=a, ice__thickness=h))
    for name, force in by_formula(a, h, 60, 0.5, 15, 0.3).items():
        assert found[name]["force_n"] == (None if force is None else pytest.approx(force, rel=1e-12)), name
        assert found[name]["formula"] and found[name]["source"] and found[name]["note"]
    assert found["marchenko_rafting"]["high_n"] == pytest.approx(17 / 11 * found["marchenko_rafting"]["force_n"])
    assert found["open_water_drag"]["force_n"] == pytest.approx(
        (0.5 * 1027 * 0.85 * 50 * 60 + 1027 * 5e-4 * 4800) * 0.25)


def test_curves_are_the_estimates_over_the_concentration(tmp_path):
    curves = estimate(tmp_path, changed(BERG, ice__thickness=6.0))["curves"]
    grid = np.array(curves["concentration"])
    assert grid[0] == 0 and grid[-1] == 0.98 and np.all(np.diff(grid) > 0)
    for name in KINDS[:-1]:
        want = [by_formula(a, 6.0, 60, 0.5, 15, 0.3)[name] for a in grid]
        for a, x, y in zip(grid, curves[name], want):
            if y is None:
                assert x is None, (name, a)
            elif min(abs(a - 0.15), abs(a - 0.9)) > 1e-9:  # the grid is printed with 7 digits
                assert x == pytest.approx(y, rel=2e-6, abs=1e-12), (name, a)
    assert curves["valid_range"] == {
        "lichey_hellmer": [0.01, 0.98], "marchenko_compaction": [0.65, 0.98], "marchenko_rafting": [0.65, 0.98],
        "marchenko_momentum": [0.01, 0.899999], "dilute_limit": [0.01, 0.25], "ships_in_pack_ice": [None, None],
        "open_water_drag": [0.01, 0.98]
    }
    jump = grid.tolist().index(0.9)
    assert curves["lichey_hellmer"][jump] > 10 * curves["lichey_hellmer"][jump - 1] > 0


def test_a_ship_is_what_the_regression_of_ships_is_for(tmp_path):
    """Blunt and slender hull by their constants; a berg is an extrapolation, and a run is not held against it."""
    berg, ship = (estimate(tmp_path, changed(BERG, body__shape=shape))["ships_in_pack_ice"]
                  for shape in ("rectangle", "ship"))
    froude = 0.5 / math.sqrt(G * 0.8)
    slender = 0.5 * 4.4 * froude**-0.8267 * 910 * 60 * 0.25 * 0.8**2
    assert berg["low_n"] == pytest.approx(slender) and berg["high_n"] == berg["force_n"] == pytest.approx(
        0.5 * 16.1 * froude**-1.7937 * 910 * 60 * 0.25 * 0.8**3)
    assert not berg["valid"] and berg["note"].startswith(
        "extrapolated") and ship["valid"] and ship["compares"] and not berg["compares"]
    assert "PolarRoute" in ship["source"] and ship["force_n"] == pytest.approx(berg["force_n"])


def test_a_table_for_readers(tmp_path):
    result = call("estimate", write_case(tmp_path, BERG))
    assert result.returncode == DONE
    for word in ("Lichey-Hellmer", "6.825 kN", "Marchenko, compaction", "rafting", "momentum", "dilute limit",
                 "not valid", "open-water drag", "P_s"):
        assert word in result.stdout, word


def test_what_has_no_estimate_is_refused(tmp_path):
    for change in ({"tow__mode": "none", "tow__speed": None}, {"body": {"shape": "none"}, "tow": {}}):
        result = call("estimate", write_case(tmp_path, changed(BERG, **change)))
        assert result.returncode == CASE and "case.yml: " in result.stderr and ";" in result.stderr
    assert call("estimate", write_case(tmp_path, changed(BERG, estimate__kappa=4))).returncode == CASE
    assert call("estimate").returncode == USAGE


def test_a_field_that_is_read_counts_as_it_is(tmp_path):
    path = write_case(tmp_path, changed(TOW, ice__thickness_law="lognormal", ice__thickness_spread=0.5))
    assert call("field", path, "-o", tmp_path / "f.h5").returncode == DONE
    asked = estimate(tmp_path, TOW)
    read = estimate(tmp_path, changed(TOW, ice={"field": "f.h5"}))
    assert read["concentration"] == pytest.approx(0.5, abs=0.005) and read["concentration"] != 0.1
    assert asked["thickness_m"] == 0.04 and read["thickness_m"] != 0.04 and read["thickness_m"] == pytest.approx(
        0.04, rel=0.2)


def test_the_summary_puts_the_run_beside_the_estimates(tmp_path):
    r = run(tmp_path, changed(TOW, ice__restitution=0.2, output__window_start=5))
    found, mean = r.summary["estimates"], r.summary["mean_ice_resistance_n"]
    assert found["concentration"] == r.summary["concentration"]
    area, h = r.dataset("floes/area"), r.dataset("floes/thickness")
    assert found["thickness_m"] == pytest.approx(np.average(h, weights=area))
    assert found["floe_radius_m"] == pytest.approx(np.average(np.sqrt(area / np.pi), weights=area))
    want = by_formula(found["concentration"], found["thickness_m"], found["width_m"], 0.13, found["floe_radius_m"], 0.2)
    for name, force in want.items():
        assert found[name]["force_n"] == pytest.approx(force, rel=1e-12)
        assert found[name]["simulated_over_estimate"] == pytest.approx(mean / force)
    assert found["open_water_drag"]["simulated_over_estimate"] is None
    for word in ("Lichey-Hellmer", "Marchenko, momentum", "open-water drag"):
        assert word in r.result.stdout
    # The printed ratio is one to estimates that know the concentration, within their range.
    assert {name for name in KINDS if found[name]["compares"]} == {"marchenko_momentum"}
    lines = {name: next(line for line in r.result.stdout.splitlines() if line.strip().startswith(name)) for name in
             ("Lichey-Hellmer", "Marchenko, momentum", "dilute limit", "ships in pack ice")}
    assert f" {mean / want['marchenko_momentum']:.3g} " in lines["Marchenko, momentum"] and "extrapolated" in lines[
        "ships in pack ice"]
    for name in ("Lichey-Hellmer", "dilute limit", "ships in pack ice"):
        assert " - " in lines[name], lines[name]
    drift = run(tmp_path, changed(TOW, tow={"mode": "none"}, water__current_x=0.1), name="drift")
    assert drift.summary["estimates"]["lichey_hellmer"]["force_n"] is None and "Lichey" not in drift.result.stdout
    nobody = run(tmp_path, changed(TOW, body={"shape": "none"}, tow={}), name="nobody")
    assert nobody.summary["estimates"] is None


def test_open_water_drag_is_what_a_tow_in_open_water_meets(tmp_path):
    """The same law in src/force/forces.c and in the estimate, with a current at an angle, a body that is no disc, and
    the air taken away."""
    case = changed(TOW, ice__concentration=0, body={"x": 5, "shape": "rectangle", "length": 2, "width": 0.7, "yaw": 20},
                   air__density=0, water={"current_x": -0.05, "current_y": 0.04}, output__window_start=10)
    r = run(tmp_path, case)
    assert r.summary["estimates"]["open_water_drag"]["force_n"] == pytest.approx(r.summary["mean_drag_force_n"],
                                                                                 rel=1e-12)


# ---- the twin ----

def twin(folder, path, scale, name):
    result = call("check", path, "--scale", scale)
    assert result.returncode == DONE, result.stderr
    (folder / name).write_text(result.stdout)
    return folder / name


LOOSE = changed(TOW, run__duration=60, tow={"mode": "line", "speed": 0.13, "line_stiffness": 2e4},
                water__current_y=0.01, air__wind_x=1.0, output__window_start=10)


def dimensionless(a, b, L, tolerance):
    """Every series and pose of b is that of a, scaled by the dimension of its units."""
    exponents = {"m": 1, "rad": 0, "m/s": 0.5, "rad/s": -0.5, "s": 0.5, "N": 3, "N m": 4, "J": 4, "m2": 2, "1": 0}
    import h5py
    with h5py.File(a.dir / "result.h5") as f, h5py.File(b.dir / "result.h5") as g:
        for name in f["series"]:
            if name == "momentum_residual":  # rounding of rounding
                continue
            x, y = f["series"][name][:], g["series"][name][:]
            units = f["series"][name].attrs["units"]
            units = units.decode() if isinstance(units, bytes) else units
            scale = L ** exponents[units]
            bound = tolerance * max(np.nanmax(np.abs(x), initial=0), 1e-30)
            assert np.allclose(x * scale, y, rtol=0, atol=bound * scale,
                               equal_nan=True), (name, np.nanmax(np.abs(y / scale - x)))
        x, y = f["frames/pose"][:], g["frames/pose"][:]
        assert np.allclose(x[:, :, :2] * L, y[:, :, :2], rtol=0, atol=tolerance * 15 * L)
        assert np.allclose(x[:, :, 2], y[:, :, 2], rtol=0, atol=tolerance * 10)


def test_a_twin_of_scale_4_is_the_case_to_rounding_of_the_units(tmp_path):
    """Factors of 4, 2, 8, ... only change exponents of numbers: whatever differs has a length, time or mass of its own
    in the program."""
    path = write_case(tmp_path, changed(LOOSE, ice__concentration=0.7))
    a = run(tmp_path, path, name="a")
    b = run(tmp_path, twin(tmp_path, path, "4", "twin.yml"), name="b")
    assert a.summary["contacts_mean"] > 20
    dimensionless(a, b, 4, 1e-15)
    for name in KINDS:
        if a.summary["estimates"][name]["valid"] and name != "open_water_drag":
            assert b.summary["estimates"][name]["simulated_over_estimate"] == a.summary["estimates"][name][
                "simulated_over_estimate"]


def test_a_twin_of_any_scale_is_the_case_to_rounding(tmp_path):
    """Loose ice, and no shake: nothing that makes rounding grow by much."""
    path = write_case(tmp_path, changed(LOOSE, ice__concentration=0.15, ice__shake=0, solver__tolerance=1e-8))
    a = run(tmp_path, path, name="a")
    b = run(tmp_path, twin(tmp_path, path, "30", "twin.yml"), name="b")
    assert a.summary["mean_ice_resistance_n"] > 0
    x, y = a.series("ice_resistance"), b.series("ice_resistance")
    assert np.allclose(y / 27000, x, rtol=0, atol=1e-6 * x.max())
    assert np.allclose(b.dataset("frames/pose")[-1][:, :2] / 30, a.dataset("frames/pose")[-1][:, :2], rtol=0, atol=1e-6)
    assert b.summary["mean_ice_resistance_n"] / 27000 == pytest.approx(a.summary["mean_ice_resistance_n"], rel=1e-6)


def test_there_and_back_is_the_resolved_case(tmp_path):
    path = write_case(tmp_path, changed(LOOSE, floes=[{"x": 13, "y": 3, "length": 0.3}], water__latitude=70))
    once = twin(tmp_path, path, "16", "once.yml")
    back = twin(tmp_path, once, "1/16", "back.yml").read_text()
    same = twin(tmp_path, path, "1", "same.yml").read_text()
    lines = [[line for line in text.splitlines() if not line.startswith("#")] for text in (same, back)]
    assert lines[0] == lines[1] and len(lines[0]) > 100
    assert "Coriolis" in once.read_text() and "Reynolds" in once.read_text()


@pytest.mark.parametrize("scale", ["0", "-3", "x", "3x", "1/0", "1/", "nan", "inf", "1e9"])
def test_scales_that_are_none_are_refused(tmp_path, scale):
    result = call("check", write_case(tmp_path, LOOSE), f"--scale={scale}")
    assert result.returncode == USAGE and "length ratio" in result.stderr and not result.stdout


def test_a_file_cannot_be_scaled_and_need_not_be_at_scale_1(tmp_path):
    (tmp_path / "current.csv").write_text("t,u,v\n0,0,0\n99,0.1,0\n")
    path = write_case(tmp_path, changed(TOW, water__current_table="current.csv"))
    assert "current.csv" in twin(tmp_path, path, "1", "same.yml").read_text()
    result = call("check", path, "--scale", "2")
    assert result.returncode == CASE and "cannot be scaled with the case" in result.stderr


def test_a_twin_out_of_range_is_refused(tmp_path):
    result = call("check", write_case(tmp_path, BERG), "--scale", "10000")
    assert result.returncode == CASE and "domain.length: becomes" in result.stderr and not result.stdout


WEAK = changed(TOW, tow={"mode": "thrust", "speed": 0.13, "ramp": 2, "line_length": 3, "line_stiffness": "1 kN",
                         "vessel": {"mass": 100, "bollard_pull": 2, "free_speed": 1}}, output__window_start=10)
DRIVEN = {
    "run": {"dt": 1, "duration": 400},
    "domain": {"frame": "geographic", "length": 600, "width": 200, "ends": "moving", "sides": "periodic"},
    "ice": {"concentration": 0.3, "size": 20, "thickness": 1},
    "body": {"shape": "disc", "length": 40, "draft": 30},
    "tow": {"speed": 0.4, "ramp": 20},
    "air": {"wind_x": 12},
    "output": {"window_start": 100, "frame_interval": 100},
}


def through(r, first, name="speed_through_ice"):
    time, speed = r.series("time", name)
    return speed[time >= first - 1e-9].mean()


def test_a_vessel_that_cannot_hold_its_speed_is_held_against_what_it_makes_good(tmp_path):
    """Half the speed is a fourth of the momentum estimate: at the speed ordered a run would seem a fourth as hard."""
    r = run(tmp_path, WEAK)
    e = r.summary["estimates"]
    x, time = r.series("body_x", "time")
    made_good = (x[-1] - x[time >= 10 - 1e-9][0]) / (time[-1] - 10)
    assert 0 < e["speed_along_m_s"] < 0.8 * 0.13 and e["ordered_speed_m_s"] == pytest.approx(0.13)
    assert e["speed_along_m_s"] == pytest.approx(made_good, rel=0.01)
    assert e["speed_along_m_s"] == pytest.approx(through(r, 10), rel=1e-9)
    assert f"at {e['speed_along_m_s']:.4g} m/s through the ice (0.13 ordered)" in r.result.stdout
    ice = r.summary["estimates"]
    a, h, w = ice["concentration"], ice["thickness_m"], ice["width_m"]
    momentum = 910 * h * w * e["speed_along_m_s"]**2 * a * 0.9 / (0.9 - a)
    assert e["marchenko_momentum"]["force_n"] == pytest.approx(momentum, rel=1e-9)


def test_ice_that_the_wind_drives_along_is_not_met_at_the_speed_of_the_tow(tmp_path):
    r = run(tmp_path, DRIVEN)
    e, drift = r.summary["estimates"], r.summary["moving_window"]["ice_drift_x_m"] / 400
    assert drift > 0.1
    assert e["speed_along_m_s"] == pytest.approx(0.4 - drift, rel=0.02)
    assert e["speed_along_m_s"] == pytest.approx(through(r, 100), rel=1e-9)
    assert e["water_speed_m_s"] == pytest.approx(0.4, rel=1e-6)
    assert through(r, 100, "speed_through_water") == pytest.approx(0.4, rel=1e-9)
    # the same without a window: the ice is followed all the same; and before the run, by its free drift at the start.
    # The field is another one, with another mean lee
    still = run(tmp_path, changed(DRIVEN, domain__ends="periodic"), name="still")
    assert still.summary["estimates"]["speed_along_m_s"] == pytest.approx(e["speed_along_m_s"], rel=3e-3)
    before = estimate(tmp_path, DRIVEN)
    assert before["speed_along_m_s"] == pytest.approx(e["speed_along_m_s"], rel=0.03)  # the lee is estimated
    # the tow keeps the speed that it asks for, whatever the ice does
    assert e["ordered_speed_m_s"] == pytest.approx(e["speed_along_m_s"], rel=1e-9)
    assert before["ordered_speed_m_s"] == before["speed_along_m_s"]


def test_undisturbed_ice_drifts_as_the_mean_floe(tmp_path):
    """Not as one of the mean size weighted by area, which is twice as large and more slowly driven."""
    alike, mixed = (estimate(tmp_path, changed(DRIVEN, ice__size_law="lognormal", ice__size_spread=spread))
                    for spread in (0.01, 0.9))
    assert mixed["speed_along_m_s"] == pytest.approx(alike["speed_along_m_s"], rel=1e-6)


def test_floes_by_hand_alone_drift_as_they_are(tmp_path):
    case = changed(DRIVEN, ice__concentration=0, domain__ends="open", floes=[
        {"shape": "square", "length": 5, "x": 60 + 20 * k, "y": 5, "thickness": 0.3} for k in range(2)])
    drift = json.loads(call("check", write_case(tmp_path, case), "--json").stdout)["ice"]["drift_x_m_s"]
    assert estimate(tmp_path, case)["speed_along_m_s"] == pytest.approx(0.4 - drift, rel=1e-6)


def test_a_run_goes_on_with_the_drift_that_it_had(tmp_path):
    """Red when the way of undisturbed ice, or its velocity, is not in the checkpoint."""
    case = changed(DRIVEN, domain__ends="periodic", ice__start="rest", run__duration=200)
    whole = run(tmp_path, case, name="whole")
    run(tmp_path, case, "--steps", 70, name="cut")
    assert call("resume", "cut", "--quiet", cwd=tmp_path).returncode == DONE
    assert differing(whole.dir / "result.h5", tmp_path / "cut/result.h5") == []
    assert json.loads((tmp_path / "cut/summary.json").read_text())["estimates"] == whole.summary["estimates"]


def test_no_jam_is_reported_where_no_ice_holds_the_body(tmp_path):
    """Red when standing still is enough: a weak vessel that sets a berg going in open water, a line that has parted."""
    weak = changed(WEAK, ice__concentration=0, tow__vessel__bollard_pull=0.2, run__duration=60)
    parted = changed(TOW, tow={"mode": "line", "speed": 0.13, "ramp": 0.5, "line_length": 3, "line_stiffness": "10 kN",
                               "line": {"breaking_load": 10}}, run__duration=60)
    for name, case in (("weak", weak), ("parted", parted)):
        r = run(tmp_path, case, name=name)
        assert r.summary["stalled_s"] == 0, name
        assert not any("jam" in w for w in r.warnings), r.warnings
    assert any(e["kind"] == "adrift" for e in r.summary["events"])
    assert r.summary["estimates"]["speed_along_m_s"] is None


def test_loose_ice_between_end_walls_drifts_and_dense_ice_does_not(tmp_path):
    """Red when walls hold all ice: a current along the tow would count as speed through floes that go with it."""
    walls = {"frame": "geographic", "length": 600, "width": 200, "ends": "wall", "sides": "periodic"}
    case = changed(DRIVEN, domain=walls, air__wind_x=0, water__current_x=0.2, ice__concentration=0.1, body__x=100)
    e = run(tmp_path, case, name="loose").summary["estimates"]
    assert 0.2 < e["speed_along_m_s"] < 0.36 and e["speed_along_m_s"] == pytest.approx(e["ordered_speed_m_s"])
    dense = changed(case, ice__concentration=0.8, run__duration=120)
    e = run(tmp_path, dense, name="dense").summary["estimates"]
    assert e["speed_along_m_s"] == pytest.approx(0.4, rel=1e-9) and e["water_speed_m_s"] == pytest.approx(0.2, rel=1e-9)


def test_a_floe_by_hand_is_no_undisturbed_ice_beside_a_field(tmp_path):
    case = changed(DRIVEN, domain__ends="periodic", air__wind_x=0, run__duration=60, tow__ramp=0,
                   output__window_start=0)
    case["floes"] = [{"shape": "rectangle", "length": 10, "width": 10, "x": 250, "y": 0, "vx": 2}]
    case["ice"]["x_max"] = 200
    r = run(tmp_path, case, name="thrown")
    assert r.series("speed_through_ice") == pytest.approx(0.4, rel=1e-12)
    case["ice"] = {k: v for k, v in case["ice"].items() if k in ("thickness", "friction")} | {"concentration": 0}
    alone = run(tmp_path, case, name="alone")  # is all the ice that there is
    assert alone.series("speed_through_ice")[0] < -1


def test_ice_that_a_tide_carries_past_a_moving_window_is_reported(tmp_path):
    """Red when the ends of the ways are compared: a tide brings the ice back."""
    tide = changed(DRIVEN, air__wind_x=0, water={"tide": {"major": 0.8, "period": 800}}, run__duration=800)
    assert any("ice overtook the body" in w for w in run(tmp_path, tide, name="tide").warnings)
    slow = changed(DRIVEN, air__wind_x=0, water={"current_x": 0.1}, run__duration=30, output__window_start=25)
    assert not any("ice overtook" in w for w in run(tmp_path, slow, name="slow").warnings)


def test_a_body_that_stands_still_is_held_against_no_estimate_of_a_moving_one(tmp_path):
    """Red when the ratio is formed all the same: it was 1e10 in a jam."""
    jam = changed(WEAK, ice__concentration=0.8, tow__vessel__bollard_pull=0.3, run__duration=60,
                  output__window_start=30)
    e = run(tmp_path, jam).summary["estimates"]
    assert abs(e["speed_along_m_s"]) < 0.05 * 0.13
    assert not any(e[k]["compares"] for k in ("lichey_hellmer", "marchenko_momentum", "dilute_limit"))
    assert e["marchenko_compaction"]["compares"]
