# SPDX-License-Identifier: MIT
"""Where a run could go wrong without a word: bodies faster than the search for contacts, seams of periods, windows on
another leg than the first, ranges of angles."""
import json
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest

from harness import (CASE, DONE, ROOT, TOW, call, changed, environment, launcher, placed, run, script, warned,
                     write_case)

FREE = {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0}
PAIR = {
    "run": {"dt": 10, "duration": 60},
    "domain": {"frame": "basin", "length": 400, "width": 100, "ends": "open", "sides": "open"},
    "ice": {"concentration": 0, "start": "rest", "drag": FREE},
    "body": {"shape": "none"}, "tow": {"mode": "none"},
}


@pytest.mark.parametrize("apart,speed", [(22, 1.3), (19.5, 1.0), (25, 1.45)])
def test_bodies_that_may_have_passed_through_each_other_are_reported(tmp_path, apart, speed):
    """Two floes of 1 m that come nearer by more than 16 sizes in a step, up to which contacts are looked for. Red with
    any slack beyond that: they change places without a contact, an overlap or a word."""
    r = run(tmp_path, changed(PAIR, floes=[
        {"shape": "square", "length": 1, "x": 100, "y": 0, "thickness": 1, "vx": speed, "vy": 0},
        {"shape": "square", "length": 1, "x": 100 + apart, "y": 0, "thickness": 1, "vx": -speed, "vy": 0}]))
    assert warned(r, "farther than the contact detection looks ahead.*or missed")


def test_a_wall_goes_on_around_the_period_as_far_as_a_long_body_reaches(tmp_path):
    """The bow of a body at the seam comes to the wall as it does elsewhere. Red with walls that end a tenth of the
    domain beyond the seam: it goes 20 m into the wall before anything is seen."""
    found = []
    for name, x in (("seam", 1), ("middle", 200)):
        case = changed(PAIR, run={"dt": 0.5, "duration": 45}, domain={"length": 400, "width": 200, "ends": "periodic",
                                                                     "sides": "wall"},
                       body={"shape": "rectangle", "length": 180, "width": 10, "draft": 5, "sail": 0.5,
                             "x": x, "y": -30, "yaw": 45, "vx": 0, "vy": -1},
                       floes=[{"shape": "square", "length": 5, "x": 200 - x + 1, "y": 60, "thickness": 1}])
        r = run(tmp_path, case, name=name)
        found.append(r.series("body_y", "body_yaw"))
        assert r.summary["max_overlap_m"] < 0.05
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("turn", [False, True])
def test_a_pier_is_met_on_any_lap(tmp_path, turn):
    """Red when only the nearest image is held against the path: the body goes through the pier once a lap."""
    tow = {"mode": "speed", "speed": 1, "ramp": 1} | ({"waypoints": [[140, 0], [140, 400]], "turn_radius": 0}
                                                      if turn else {})
    case = changed(PAIR, run={"dt": 0.5, "duration": 390},
                   domain={"length": 200, "width": 200, "ends": "periodic", "sides": "periodic"},
                   body={"shape": "disc", "length": 10, "draft": 5, "sail": 0.5, "x": 100, "y": 0}, tow=tow,
                   floes=[{"shape": "square", "length": 5, "x": 140 if turn else 50, "y": -60 if turn else 0,
                           "thickness": 1, "fixed": True}])
    assert "on its prescribed path" in run(tmp_path, case, code=CASE).result.stderr
    run(tmp_path, changed(case, run__duration=130), "--quiet", name="short")


def test_floes_stay_in_the_domain_however_far_they_go_in_a_step(tmp_path):
    """Red when one period at most is taken off: floes that drift by 2.7 of them leave the domain."""
    case = changed(PAIR, run={"dt": 600, "duration": 36000}, domain={"length": 200, "ends": "periodic"},
                   water={"current_x": 0.9}, ice={"concentration": 0},
                   floes=[{"shape": "square", "length": 5, "x": x, "y": 0, "thickness": 1} for x in (50, 100, 150)])
    with h5py.File(run(tmp_path, case).dir / "result.h5") as f:
        x = f["frames/pose"][:, :, 0]
    assert len(x) > 10 and (x >= 0).all() and (x < 200).all()
    np.testing.assert_allclose(np.diff(np.sort((x - x[:, :1]) % 200)), 50, atol=1e-6)


@pytest.mark.ranks
def test_a_place_is_taken_on_all_ranks_or_on_none(tmp_path):
    """Red when only ranks that hold the body look for what stands there: on two ranks it is put into another one."""
    path = write_case(tmp_path, changed(PAIR, run={"dt": 1, "duration": 60}, domain={"length": 2000}, floes=[
        {"shape": "square", "length": 4, "x": 20 + 19 * k, "y": 0, "thickness": 1} for k in range(100)]))
    program = tmp_path / "place.py"
    program.write_text(f"""
import sys; sys.path.insert(0, {str(ROOT / "postproc")!r})
import bergtow, os, pathlib
ranks = sys.argv[1]
if ranks == "2": bergtow.start_mpi()
said = []
with bergtow.Simulation({str(path)!r}, threads=1) as sim:
    sim.step(2)
    for x, yaw in ((20 + 95 * 19 + 1, 0), (20 + 95 * 19 + 4.6, 0.785), (20.5, 0), (20 + 95 * 19 + 4.6, 0)):
        try:
            sim.set_position(0, x, 0, yaw)
            said.append("put")
        except bergtow.BergtowError as error:
            said.append(str(error))
    sim.step(2)
    said.append(sim.state_hash)
rank = os.environ.get("OMPI_COMM_WORLD_RANK", os.environ.get("PMI_RANK", "0"))
(pathlib.Path(__file__).parent / (ranks + "-" + rank)).write_text("\\n".join(said))
""")
    for ranks in (1, 2):
        done = subprocess.run([*(launcher(2) if ranks == 2 else []), sys.executable, program, str(ranks)],
                              capture_output=True, text=True, timeout=120, env=environment(OMP_NUM_THREADS=1))
        assert done.returncode == 0, done.stderr
    one, *two = [(tmp_path / name).read_text().splitlines() for name in ("1-0", "2-0", "2-1")]
    assert "would lie over body 95" in one[0] and one[0] == one[1] and one[2:4] == ["put", "put"]
    assert two[0] == one and "put" not in two[1][:2] and two[1][2:] == one[2:]


@pytest.mark.parametrize("sampling", ["grid", "latin-hypercube"])
def test_a_range_of_angles_is_run_in_its_unit(tmp_path, sampling):
    """Red when its values in radians are written without their unit, which is then degrees."""
    write_case(tmp_path, changed(TOW, run__duration=2, output__window_start=0.5), "base.yml")
    write_case(tmp_path, {"base": "base.yml", "sampling": sampling,
                          **({"samples": 4} if sampling != "grid" else {}),
                          "parameters": {"tow.direction": {"from": "-20 deg", "to": "20 deg",
                                                           **({"n": 3} if sampling == "grid" else {})},
                                         "body.yaw": {"from": 10, "to": "90 deg",
                                                      **({"n": 2} if sampling == "grid" else {})}}}, "study.yml")
    assert call("ensemble", "study.yml", "-o", "out", "--quiet", cwd=tmp_path).returncode == DONE
    with h5py.File(tmp_path / "out/ensemble.h5") as f:
        names = [n.decode() for n in f["members/name"][:]]
        for key, low, high in (("tow.direction", -20, 20), ("body.yaw", 10, 90)):
            x = np.degrees(f[f"parameters/{key}"][:])
            if sampling == "grid":
                assert sorted(set(np.round(x, 9))) == ([-20, 0, 20] if key == "tow.direction" else [10, 90])
            else:  # one in each quarter
                assert sorted(np.floor(4 * (x - low) / (high - low)).astype(int)) == [0, 1, 2, 3]
            section, name = key.split(".")
            for member, value in zip(names, np.radians(x)):
                text = (tmp_path / "out/members" / member / "case.resolved.yml").read_text()
                there = text[text.index(f"\n{section}:"):]
                said = there[there.index(f"\n  {name}: ") + len(name) + 5:].split()
                assert float(said[0]) == pytest.approx(value, abs=1e-12) and said[1] == "rad"


def test_a_normal_range_of_angles_is_held_against_the_key_in_its_unit(tmp_path):
    """95 % from 60 to 89.9 degrees reaches beyond the pole."""
    write_case(tmp_path, changed(TOW, domain__frame="geographic", domain__ends="wall", domain__sides="wall", body__x=2,
                                 body__y=0), "base.yml")
    write_case(tmp_path, {"base": "base.yml", "sampling": "latin-hypercube", "samples": 4,
                          "parameters": {"water.latitude": {"from": "60 deg", "to": "89.9 deg",
                                                            "distribution": "normal"}}}, "study.yml")
    done = call("check", "study.yml", cwd=tmp_path)
    assert done.returncode == CASE and "water.latitude: a normal distribution" in done.stderr, done.stderr


def test_estimates_are_those_of_the_leg_in_the_window(tmp_path):
    """A body that lies across the second leg of its course. Red when width and drag are those of the first: the drag of
    open water is then a quarter of what the run has itself."""
    case = changed(TOW, run__duration=80, output__window_start=60, domain__length=30, domain__width=30, ice__size=1,
                   ice__concentration=0.05, body={"shape": "rectangle", "length": 4, "width": 1, "x": 5, "y": -10},
                   tow={"mode": "speed", "speed": 0.2, "ramp": 2, "waypoints": [[8, -10], [8, 12]], "turn_radius": 1})
    e, straight = (run(tmp_path, c, name=n).summary["estimates"] for n, c in (
        ("turned", case), ("straight", case | {"tow": {"mode": "speed", "speed": 0.2, "ramp": 2, "direction": 90}})))
    assert e["width_m"] == pytest.approx(4) and straight["width_m"] == pytest.approx(4)
    assert e["open_water_drag"]["force_n"] == pytest.approx(straight["open_water_drag"]["force_n"], rel=1e-6)
    on_a_line = run(tmp_path, changed(case, tow={"mode": "line", "line_length": 3, "line_stiffness": "5 kN"}),
                    name="line").summary["estimates"]
    assert on_a_line["width_m"] == pytest.approx(1, rel=2e-3)  # it follows its course, to within a degree
    across = run(tmp_path, changed(case, output__window_start=10), name="across").summary
    assert not any(v["compares"] for v in across["estimates"].values() if isinstance(v, dict) and "compares" in v)
    assert across["window"]["verdict"] == "not steady"


def test_the_ordered_speed_is_that_of_the_window(tmp_path):
    """Red when it is the largest of the programme: a tow that keeps its order looks like one at a fifth of it."""
    tow = {"mode": "speed", "programme": [[0, 0], [2, 0.5], [10, 0.5], [12, 0.1], [60, 0.1]]}
    e = run(tmp_path, changed(TOW, run__duration=60, output__window_start=25) | {"tow": tow}).summary["estimates"]
    assert e["ordered_speed_m_s"] == pytest.approx(0.1) == pytest.approx(e["speed_along_m_s"])


def test_what_no_body_has_is_asked_about(tmp_path):
    plain = run(tmp_path, TOW, "--steps", 5, name="plain")
    for text, word in (("body.mass=1e9 kg", "body.mass: the body has .* times the mass"),
                       ("body.mass=1 kg", "body.mass: the body has .* times the mass"),
                       ("impact.duration=500 s", "impact.duration: 500 s is")):
        r = run(tmp_path, TOW, "--set", text, "--steps", 5, name=text[:11] + text[-4])
        assert warned(r, word) and not warned(plain, word)


def test_a_measured_force_is_above_zero(tmp_path):
    for text in ("0 N", "-5 N"):
        done = call("check", write_case(tmp_path, changed(TOW, reference={"mean_force": text, "source": "a book"})))
        assert done.returncode == CASE and "reference.mean_force" in done.stderr


def test_words_of_capability_that_are_no_value_of_a_key(tmp_path):
    """--resolution and --speed are read by their unit alone, and refused before any run."""
    path = write_case(tmp_path, changed(TOW, tow__mode="thrust", tow__line_length=2, tow__line_stiffness=5000,
                                        tow__vessel={"mass": 300, "bollard_pull": 10, "free_speed": 0.5}))
    def said(*words):
        return script("capability", path, "-o", tmp_path / "out", "--budget", "0.0001", *words, cwd=tmp_path)
    for words, wrong in ((("--resolution", "0"), "--resolution 0: is not above 0 and at most the range"),
                         (("--resolution", "1 m"), "--resolution 1 m: m is the unit of a length, but this is a ratio"),
                         (("--speed", "0 m/s"), "--speed: 0 m/s is not above zero"),
                         (("--speed", "3 m"), "--speed: 3 m: m is the unit of")):
        done = said(*words)
        assert done.returncode == 2 and wrong in done.stderr, done.stderr
    done = said("--search", "ice.size", "--from", "1.4 m", "--to", "1.5 m", "--resolution", "5 cm", "--speed", "0.1 kn",
                "--budget", "0.2")
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "out/capability.json").read_text())
    assert found["resolution"] == pytest.approx(0.05) and found["speed"] == pytest.approx(0.1 * 1852 / 3600)


def outlines(floes):
    """A map of squares in metres, (east, north, side)."""
    crs = {"type": "name", "properties": {"name": "bergtow:plane"}}
    return {"type": "FeatureCollection", "crs": crs, "features": [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [
            [[x, y], [x + a, y], [x + a, y + a], [x, y + a], [x, y]]]}} for x, y, a in floes]}


def test_a_lead_leaves_the_concentration_of_the_region_as_it_is(tmp_path):
    """Ice that was read, two thirds of it outside the region, and a managed lead, which takes none away. Red when all
    floes count afterwards: a concentration above 1, which no checkpoint goes on from."""
    (tmp_path / "map.json").write_text(json.dumps(outlines(
        [(60 * i - 570, 60 * j - 570, 50) for i in range(20) for j in range(20) if abs(60 * i - 570) > 60 or j > 8])))
    case = {"run": {"dt": 1, "duration": 60}, "domain": {"frame": "geographic", "x0": -600, "y0": -600, "length": 1200,
                                                         "width": 1200, "ends": "open", "sides": "open"},
            "ice": {"outlines": "map.json", "outlines_crs": "plane", "thickness": 1, "x_min": -300, "x_max": 300,
                    "y_min": -300, "y_max": 300},
            "body": {"shape": "disc", "length": 40, "draft": 20, "x": -150, "y": 0},
            "tow": {"mode": "speed", "speed": 0.5},
            "water": {"latitude": 75},
            "lead": {"mode": "managed", "floe_size": 20, "width": 60, "length": 300}}
    lead = run(tmp_path, case, "--steps", 20).summary["lead"]
    assert lead["pieces"] > 5 and 0 < lead["concentration_before"] < 1
    assert lead["concentration_after"] == pytest.approx(lead["concentration_before"], rel=2e-3)
    assert call("resume", tmp_path / "out", "--quiet").returncode == DONE
    # The same ice in a field file, which names its region. Red when that is the whole domain: less than half.
    assert call("field", write_case(tmp_path, case | {"lead": {"mode": "none"}}), "-o", "map.h5",
                cwd=tmp_path).returncode == DONE
    stored = run(tmp_path, case | {"ice": {"field": "map.h5"}}, "--steps", 2, name="stored").summary["lead"]
    assert stored["concentration_after"] == pytest.approx(lead["concentration_after"], rel=1e-9)


def test_a_lead_up_to_the_front_of_a_window_takes_floes_on_the_seam(tmp_path):
    """Red when those stay whose centres lie at the back: their other half is in the channel."""
    case = {"run": {"dt": 1, "duration": 20},
            "domain": {"frame": "geographic", "length": 1000, "width": 600, "ends": "moving", "sides": "periodic"},
            "ice": {"concentration": 0.8, "size": 40, "thickness": 1},
            "body": {"shape": "disc", "length": 60, "draft": 30},
            "tow": {"mode": "speed", "speed": 0.5}, "lead": {"mode": "channel", "width": 80, "length": 600}}
    r = run(tmp_path, case, "--steps", 1)
    offsets, vertices, pose = (r.dataset(n) for n in ("/floes/offsets", "/floes/vertices", "/frames/pose"))
    pose = pose[0]
    for i in range(len(pose)):
        xy = placed(vertices[offsets[i]:offsets[i + 1]], pose[i])
        for shift in (0, 1000):
            x, y = xy[:, 0] + shift, xy[:, 1]
            assert not ((x > 40) & (x < 599) & (np.abs(y) < 39)).any(), (i, xy)


def test_what_a_seed_or_a_frame_decided(tmp_path):
    wide = {"run": {"dt": 1, "duration": 60},
            "domain": {"frame": "geographic", "length": 400, "width": 300, "ends": "periodic", "sides": "periodic"},
            "ice": {"concentration": 0.6, "size_law": "power", "size_min": 20, "size_max": 290, "thickness": 1},
            "body": {"shape": "disc", "length": 60, "draft": 30}, "tow": {"mode": "speed", "speed": 0.5}}
    done = call("check", write_case(tmp_path, wide))
    assert done.returncode == CASE and "two such floes have no room" in done.stderr
    assert call("check", write_case(tmp_path, changed(wide, ice__size_max=140))).returncode == DONE
    thin = {"run": {"dt": 1, "duration": 20}, "domain": {"frame": "geographic", "length": 200, "width": 200,
                                                         "ends": "wall", "sides": "wall"},
            "ice": {"concentration": 0}, "body": {"shape": "none"},
            "floes": [{"length": 3, "x": 3, "y": 0, "thickness": "4 cm"}]}
    assert call("check", write_case(tmp_path, thin)).returncode == DONE
    del thin["floes"][0]["thickness"]
    assert "ice.thickness: missing" in call("check", write_case(tmp_path, thin)).stderr


def test_a_window_of_the_basin_faces_its_way_points(tmp_path):
    """Red with 20 m ahead of the body, and 30 behind, as if it were towed towards x."""
    case = {"run": {"dt": 0.1, "duration": 20}, "domain": {"length": 50, "ends": "moving"},
            "ice": {"concentration": 0.5}, "tow": {"mode": "line", "speed": 0.1, "waypoints": [[-60, 0]]}}
    for at, x in ((-60, 30), (60, 20)):
        r = run(tmp_path, changed(case, tow__waypoints=[[at, 0]]), "--steps", 1, name=str(x))
        text = (r.dir / "case.resolved.yml").read_text()
        assert f"  x: {x} m" in text and "  ahead: 30 m" in text


def test_keys_of_the_tow_without_a_body(tmp_path):
    case = {"run": {"dt": 1, "duration": 20}, "domain": {"frame": "geographic", "length": 400, "width": 300,
                                                         "ends": "wall", "sides": "wall"},
            "ice": {"concentration": 0.3, "size": 30, "thickness": 1}, "body": {"shape": "none"},
            "tow": {"mode": "none", "direction": 40}, "impact": {"panels": 12}, "output": {"panels": True}}
    said = call("check", write_case(tmp_path, case))
    assert said.returncode == CASE
    for key in ("tow.direction", "impact.panels", "output.panels"):
        assert f"{key}: has no effect without a " in said.stderr


def test_rounding_of_the_concentration_decides_nothing(tmp_path):
    """75 and 65 %, in fields that miss them by a bit. Red when the bit decides: ice is held by the walls or drifts,
    estimates hold and do not, from seed to seed."""
    case = changed(TOW, run__duration=1, run__dt=0.1, output__window_start=0.3, ice__concentration=0.75,
                   water={"current_x": 0.05})
    found = [run(tmp_path, case, "--set", f"ice.seed={k}", name=f"s{k}").summary["estimates"] for k in range(1, 7)]
    assert {e["concentration"] for e in found} != {0.75}
    assert np.ptp([e["speed_along_m_s"] for e in found]) < 1e-9
    found = [run(tmp_path, changed(case, ice__concentration=0.65), "--set", f"ice.seed={k}", name=f"t{k}").summary[
        "estimates"] for k in range(1, 7)]
    assert {e["marchenko_rafting"]["valid"] for e in found} == {True}


def test_ice_at_greenwich_with_longitudes_to_360(tmp_path):
    features = outlines([])
    for i in range(6):
        x = (359.99 + 0.005 * i) % 360
        ring = [[x, 80], [x + 0.002, 80], [x + 0.002, 80.0004], [x, 80.0004], [x, 80]]
        features["features"].append({"type": "Feature", "properties": {},
                                     "geometry": {"type": "Polygon", "coordinates": [ring]}})
    del features["crs"]
    (tmp_path / "map.json").write_text(json.dumps(features))
    case = {"run": {"dt": 1, "duration": 60}, "domain": {"frame": "geographic", "x0": -600, "y0": -600, "length": 1200,
                                                         "width": 1200, "ends": "open", "sides": "open"},
            "ice": {"outlines": "map.json", "outlines_crs": "lonlat", "thickness": 1}, "body": {"shape": "none"},
            "tow": {"mode": "none"}, "water": {"latitude": 80}}
    done = call("check", write_case(tmp_path, case))
    assert done.returncode == DONE and "0 E" not in done.stderr, done.stderr


def test_what_leaves_no_sizes_is_refused(tmp_path):
    """Limits so narrow that nearly all sizes are drawn again. Red when check calls it cheap and it is never done."""
    ice = {"size_law": "lognormal", "size": 1, "size_spread": 1, "size_min": 0.9999999, "size_max": 1.0000001}
    done = call("field", write_case(tmp_path, changed(TOW, ice=ice)), "-o", tmp_path / "f.h5", timeout=30)
    assert done.returncode == CASE and "move the limits apart" in done.stderr


def test_limits_that_take_the_spread_of_sizes_away_are_told(tmp_path):
    """Red: sizes between 0.96 and 1.04 m, where a spread of a half was asked for, without a word."""
    def made(**ice):
        case = changed(TOW, ice={"concentration": 0.5, "size_law": "lognormal", "size": 1, "size_spread": 0.5} | ice)
        said = call("field", write_case(tmp_path, case), "-o", tmp_path / "field.h5", "--force").stdout
        with h5py.File(tmp_path / "field.h5") as f:
            size = np.sqrt(4 / np.pi * f["floes/area"][:])
        return size.std() / size.mean(), re.search(r"leave the sizes a spread of ([\d.]+), where .* asks for 0.5", said)
    spread, told = made(size_min=0.7, size_max=1.4)
    assert told and float(told[1]) == pytest.approx(0.19, abs=0.01) and spread == pytest.approx(float(told[1]), rel=0.2)
    spread, told = made(size_min=0.2, size_max=5)
    assert not told and spread == pytest.approx(0.5, rel=0.2)


def test_floes_below_the_least_size_are_counted(tmp_path):
    """Cells of a dense power law leave small floes less room than they ask for. Floes given by hand change nothing of
    it, and a resumed run says the same."""
    ice = {"concentration": 0.9, "shape": "voronoi", "size_law": "power", "size_min": 0.5, "size_max": 8,
           "size_exponent": 1.8}
    case = changed(changed(TOW, ice__size=None), run__duration=1, domain={"length": 60, "width": 20}, ice=ice)
    said = call("field", write_case(tmp_path, case), "-o", tmp_path / "field.h5").stdout
    with h5py.File(tmp_path / "field.h5") as f:
        size = np.sqrt(4 / np.pi * f["floes/area"][:])
    below = int((size < 0.99 * 0.5).sum())
    told = f"{below} of the {len(size)} floes, .* are smaller than ice.size_min, down to {size.min():.3g} m"
    assert below > 0.02 * len(size) and re.search(told, said)
    run(tmp_path, case, "--steps", "2")
    assert call("resume", tmp_path / "out").returncode == DONE
    assert re.search(told, str(json.loads((tmp_path / "out" / "summary.json").read_text())["warnings"]))
    hand = changed(case, floes=[{"shape": "square", "length": 1, "x": 3, "y": 9, "thickness": 0.02}])
    assert "smaller than ice.size_min" in call("field", write_case(tmp_path, hand), "-o", tmp_path / "hand.h5").stdout


def test_room_of_a_moving_window_is_in_floes_of_the_size_law(tmp_path):
    """With a power law ice.size, 1 m where it is not given, is the size of no floe."""
    case = changed(changed(TOW, ice__size=None), body__x=10, domain={"length": 26, "width": 20, "ends": "moving"},
                   ice={"concentration": 0.5, "size_law": "power", "size_min": 1, "size_max": 10,
                        "size_exponent": 1.01})
    assert call("check", write_case(tmp_path, changed(case, ice__size_max=1.5))).returncode == DONE
    refused = call("check", write_case(tmp_path, case))
    assert refused.returncode == CASE
    assert re.search(r"domain.ahead: .* 4 floe sizes, 10.*m, are needed ahead of the body", refused.stderr)
