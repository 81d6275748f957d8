# SPDX-License-Identifier: MIT
"""What `run` refuses, `check` refuses: the same message, the same exit code. What `run` goes through with a doubt,
`check` calls valid with a warning."""
import json
import os
import random
import re

import numpy as np
import pytest
import yaml

import random_cases
from harness import CASE, DONE, IO, PRESS, TOW, call, changed, reading, run, texts, write_case

GB = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9
PIER = {"shape": "square", "length": 1, "x": 6, "y": 0, "fixed": True}
WATER = changed(TOW, ice__concentration=0)

REFUSED = {
    "no room for the images": (changed(WATER,
                                       domain__width=2.9,
                                       domain__sides="periodic",
                                       body__length=1.6,
                                       floes=[PIER | {"x": 10, "length": 1.3, "fixed": False}]), CASE,
                               "no room for the two largest bodies"),
    "a pier on the path": (changed(WATER, tow__speed=0.3,
                                   floes=[PIER]), CASE, "which cannot give way; shorten the run"),
    "floes in each other": (changed(WATER, floes=[PIER | {"x": 9, "y": 2, "fixed": False},
                                                  PIER | {"x": 9.5, "y": 2}]), CASE, "overlap by"),
    "a floe on the body": (changed(WATER, floes=[PIER | {"x": 3, "y": 1, "fixed": False}]), CASE, "overlap by"),
    "a field that is not there": (reading(TOW, "none.h5"), IO, "none.h5"),
    "no field": (reading(TOW, "case.yml"), CASE, "case.yml"),
    "a table that is not there": (changed(TOW, water__current_table="none.csv"), IO, "none.csv"),
    "too many floes": (changed(TOW, domain__length=1e5, domain__width=1e4), CASE, "more than the limit of 20000000"),
}


IDLE = "ice.concentration, ice.size: no effect on ice that is read from a file"


def test_keys_that_the_ice_leaves_unused(tmp_path):
    """Beside the file that is read they are refused, each with its line; of a base, or where the file is set, the run
    says so, and what it leaves runs again."""
    call("field", write_case(tmp_path, TOW), "-o", tmp_path / "f.h5")
    r = call("check", write_case(tmp_path, changed(TOW, ice__field="f.h5", ice__thickness=1)))
    assert r.returncode == CASE and [line.split(": ")[2] for line in r.stderr.splitlines()] == [
        "ice.concentration", "ice.size", "ice.thickness"]
    base = write_case(tmp_path, TOW, "base.yml")
    write_case(tmp_path, {"base": "base.yml", "ice": {"field": "f.h5"}}, "over.yml")
    for words in (["over.yml"], [base, "--set", "ice.field=f.h5"]):
        r = call("check", *words, cwd=tmp_path)
        assert r.returncode == DONE and IDLE in r.stdout
        r = call("run", *words, "-o", tmp_path / "out", "--force", "--quiet", "--set", "run.duration=2",
                 cwd=tmp_path)
        assert IDLE in texts(json.loads((tmp_path / "out/summary.json").read_text())["warnings"])
    again = call("check", tmp_path / "out/case.resolved.yml")
    assert again.returncode == DONE and IDLE in again.stdout


def test_keys_that_only_make_the_ice_are_named_in_open_water(tmp_path):
    """They may stay beside ice.concentration: 0, each named once. Red: silence."""
    case = changed(TOW, ice__concentration=0, ice__shape="rectangles", ice__aspect=1.2, ice__thickness_spread=0.3)
    r = call("check", write_case(tmp_path, case))
    assert r.returncode == DONE, r.stderr
    assert [line.split(None, 1)[1] for line in r.stdout.splitlines() if "no effect" in line] == [
        "ice.shape, ice.aspect, ice.thickness_spread: no effect without ice (ice.concentration: 0)"]


def test_a_file_that_has_every_key_may_have_those_without_effect(tmp_path):
    """A resolved case as a base, also without its first line, says what is, not what is wanted. In a scaled twin what
    has no effect and was not given keeps its default."""
    case = changed(TOW, ice__size=None, ice__size_law="power", ice__size_min=0.4, ice__size_max=2)
    twin = call("check", write_case(tmp_path, case), "--scale", "30")
    (tmp_path / "twin.yml").write_text(twin.stdout)
    call("run", "case.yml", "-o", "out", "--quiet", "--set", "ice.size_spread=0.3", "--set", "run.duration=1",
         cwd=tmp_path)
    text = (tmp_path / "out/case.resolved.yml").read_text()
    (tmp_path / "copy.yml").write_text(text[text.index("\n") + 1:])
    write_case(tmp_path, {"base": "out/case.resolved.yml", "run": {"title": "another"}}, "child.yml")
    for name in "twin.yml", "copy.yml", "child.yml":
        r = call("check", name, cwd=tmp_path)
        assert r.returncode == DONE, r.stderr
        assert ("no effect" in r.stdout) == (name != "twin.yml"), r.stdout
    write_case(tmp_path, changed(case, ice__size_spread=0.3), "by_hand.yml")
    assert "ice.size_spread: has no effect" in call("check", "by_hand.yml", cwd=tmp_path).stderr


def test_the_twin_of_a_case_without_a_body_is_a_case(tmp_path):
    """Numbers that follow from the place of the body, which has none, are not scaled either."""
    (tmp_path / "twin.yml").write_text(call("check", write_case(tmp_path, PRESS), "--scale", "30").stdout)
    r = call("check", "twin.yml", cwd=tmp_path)
    assert r.returncode == DONE and "no effect" not in r.stdout, r.stderr


@pytest.mark.parametrize("ratio, names", [(1, True), (4, False)])
def test_a_named_line_and_its_twin(tmp_path, ratio, names):
    """A rope of L times the diameter is no twin; the case itself in SI units, L = 1, keeps name and diameter."""
    case = changed(TOW, tow__mode="line", tow__line_length=4, tow__line={"type": "polypropylene", "diameter": "1 mm"})
    line = yaml.safe_load(call("check", write_case(tmp_path, case), "--scale", ratio).stdout)["tow"]["line"]
    assert (line["type"], line["diameter"]) == (("polypropylene", "0.001 m") if names else ("numbers", "0 m"))


def numbers_of(folder, case):
    return json.loads(call("check", write_case(folder, case), "--json").stdout)


QUAY = {"shape": "rectangle", "length": 400, "width": 80, "x": 0, "y": 340, "fixed": True}


def test_a_quay_is_no_floe(tmp_path):
    """The mean floe, by which overlaps are judged and which drifts with the wind, is one of those that can move."""
    case = {"run": {"dt": 0.5, "duration": 5}, "domain": {"length": 800, "width": 800, "x0": -400, "ends": "open",
                                                           "sides": "open"},
            "ice": {"concentration": 0, "thickness": 1, "size": 5},
            "body": {"shape": "square", "length": 4, "x": 0, "y": 0, "draft": 2},
            "tow": {"mode": "speed", "speed": 0.05, "ramp": 0}, "air": {"wind_x": 5},
            "floes": [{"shape": "square", "length": 3, "x": x, "y": 0} for x in (8, 11.1)]}
    quay = changed(case, floes=[*case["floes"], QUAY])
    alone, beside = (numbers_of(tmp_path, one) for one in (case, quay))
    assert beside["ice"]["floes"] == 3
    for key in "mean_size_m", "mean_thickness_m", "mean_mass_kg":
        assert beside["ice"][key] == alone["ice"][key]
    assert alone["ice"]["mean_size_m"] == pytest.approx(np.sqrt(4 / np.pi) * 3)
    one, two = (run(tmp_path, c, name=n).summary["mean_size_m"] for c, n in ((case, "one"), (quay, "two")))
    assert one == two
    quay["floes"][1]["x"] = 10.94  # 0.06 m: 2 % of a floe
    r = call("run", write_case(tmp_path, quay), "-o", tmp_path / "refused", "--quiet")
    assert r.returncode == CASE and "overlap by up to 0.06 m" in r.stderr


def test_the_mean_mass_is_that_of_the_floes(tmp_path):
    """E[d²] of a lognormal law is (1 + spread²) times the square of the mean."""
    case = changed(TOW, ice__size=1.5, ice__size_law="lognormal", ice__size_spread=0.9)
    ice = numbers_of(tmp_path, case)["ice"]
    assert ice["mean_mass_kg"] == pytest.approx(np.pi / 4 * 1.5 ** 2 * 1.81 * 910 * ice["mean_thickness_m"], rel=0.01)


def test_floes_given_by_hand_take_their_room(tmp_path):
    """The concentration refers to the region without them, and so does the number of floes that is expected."""
    slab = {"shape": "rectangle", "length": 6, "width": 7.5, "x": 11, "y": 0}
    path = write_case(tmp_path, changed(TOW, floes=[slab], ice__size=0.3, ice__size_spread=0.05))
    made = int(call("field", path, "-o", tmp_path / "f.h5").stdout.split(": ")[1].split()[0])
    said = json.loads(call("check", path, "--json").stdout)["ice"]
    about = next(said[k] for k in said if "floes" in k)
    assert abs(about - 1 - made) < 0.06 * made


def test_floes_given_by_hand_are_in_the_means(tmp_path):
    """Red with the default size of a basin, which none of them has. A field of made floes counts beside them."""
    floes = [{"shape": "square", "length": 1, "x": 9, "y": 0, "thickness": 0.02},
             {"shape": "square", "length": 2, "x": 12, "y": 0, "thickness": 0.06}]
    path = write_case(tmp_path, changed(TOW, ice__concentration=0, floes=floes))
    ice = json.loads(call("check", path, "--json").stdout)["ice"]
    size = np.sqrt(4 / np.pi) * 1.5
    assert ice["mean_size_m"] == pytest.approx(size) and ice["mean_thickness_m"] == pytest.approx(0.04)
    assert run(tmp_path, path, "--quiet", "--steps", 1).summary["mean_size_m"] == pytest.approx(size)
    assert json.loads(call("check", write_case(tmp_path, changed(TOW, floes=floes)),
                           "--json").stdout)["ice"]["mean_size_m"] < 0.72


def test_whole_steps_take_longer(tmp_path):
    path = write_case(tmp_path, changed(TOW, run__dt=0.7, run__duration=10, tow__ramp=0))
    assert "15 of 0.7 s = 10.5 s, run.duration rounded up to whole steps" in call("check", path).stdout
    assert json.loads(call("check", path, "--json").stdout)["run"]["duration_s"] == 10.5
    r = run(tmp_path, path, "--quiet")
    assert r.summary["sim_time_s"] == 10.5
    assert "300 of 0.1 s = 30 s\n" in call("check", write_case(tmp_path, TOW)).stdout


def test_lines_and_json_have_the_same_numbers(tmp_path):
    """One row gives both (src/app/check_numbers.c). A printed number that is not in the JSON, or has another value
    there, was written apart."""
    path = write_case(tmp_path, changed(TOW, tow__mode="line", tow__line={"weight": 0.5}, tow__speed=0.05,
                                        water__current_x=0.01))
    found, text = json.loads(call("check", path, "--json").stdout), call("check", path).stdout
    values = {x for group in found.values() if isinstance(group, dict)
              for x in group.values() if isinstance(x, (int, float))}
    known = {f"{x / unit:{form}}" for x in values for unit in (1, 1e6, 1e9)
             for form in (".2g", ".3g", ".4g", ".6g", ".0f", ".3f")}
    lines = {line[:21].strip(): line[21:] for line in text.splitlines()}
    for label in ("domain", "ice region", "concentration", "floes", "mean floe", "body", "body mass", "tow",
                  "line, weight", "line, start", "domain width", "current", "steps", "reference speed", "memory",
                  "frames", "disk", "wall time"):
        numbers = re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e[+-]\d+)?(?![\w.])", lines[label])
        assert numbers and not [x for x in numbers if x not in known], (label, lines[label])


def both(folder, case):
    path = write_case(folder, case)
    return call("check", path), call("run", path, "-o", folder / "out", "--quiet")


@pytest.mark.parametrize("name", REFUSED)
def test_check_refuses_what_run_refuses(tmp_path, name):
    case, code, words = REFUSED[name]
    checked, ran = both(tmp_path, case)
    assert ran.returncode == code and words in ran.stderr, ran.stderr
    assert (checked.returncode, checked.stderr, checked.stdout) == (ran.returncode, ran.stderr, "")


@pytest.mark.skipif(not GB < 55, reason="this machine has room for the largest field")
def test_memory_beyond_the_machine(tmp_path):
    # 18 million floes
    case = changed(TOW, domain__length=6000, domain__width=2000, ice__concentration=0.6, run__duration=0.1)
    checked, ran = both(tmp_path, case)
    assert ran.returncode == CASE and "GB of memory, but this machine has" in ran.stderr
    assert (checked.returncode, checked.stderr) == (ran.returncode, ran.stderr)
    (tmp_path / "study.yml").write_text('{"base": "case.yml", "parameters": {"tow.speed": [0.1, 0.2]}}')
    studied = call("check", tmp_path / "study.yml")
    assert studied.returncode == CASE and "GB of memory, but this machine has" in studied.stderr


def test_the_memory_of_a_run_is_its_own(tmp_path):
    """Not that of the process which started it: getrusage keeps that over exec."""
    mine = bytearray(b"x" * (200 << 20))
    r = run(tmp_path, changed(TOW, run__duration=2))
    assert 10e6 < r.summary["memory_per_floe_b"] * r.summary["n_floes"] < 0.6 * len(mine)


def test_a_field_of_another_domain(tmp_path):
    assert call("field", write_case(tmp_path, TOW), "-o", tmp_path / "field.h5").returncode == DONE
    checked, ran = both(tmp_path, changed(reading(TOW, "field.h5"), domain__x0=4, body__x=7))
    assert ran.returncode == CASE and "field.h5: floe 0" in ran.stderr
    assert (checked.returncode, checked.stderr) == (ran.returncode, ran.stderr)


LOOSE = changed(TOW, ice__concentration=0.4)  # nothing depends on the width


def test_a_time_step_that_is_too_large_is_a_warning(tmp_path):
    """The run takes it, so it is no fault; but nothing calls it valid without a word, the run itself included."""
    case = changed(LOOSE, run__dt=0.6, run__duration=3, tow__ramp=1)
    checked = call("check", write_case(tmp_path, case))
    lines = checked.stdout.splitlines()
    assert checked.returncode == DONE and lines[0].endswith(
        "case.yml: valid, with 2 warnings") and lines[-1] == lines[0]
    assert lines[
        -3] == "warning              run.dt: 0.6 s is longer than a collision lasts in a basin; use at most 0.1 s"
    assert lines[-2].startswith("warning              run.dt: in 0.6 s floes move 0.111 of their size")
    assert {"long_step", "fast_floes"} <= {w["code"] for w in run(tmp_path, case).summary["warnings"]}
    good = call("check", write_case(tmp_path, LOOSE)).stdout
    assert good.splitlines()[0].endswith("case.yml: valid") and "warning" not in good


def test_a_start_that_jerks_the_line_is_a_warning(tmp_path):
    line = {"mode": "line", "speed": 0.13, "line_length": 3, "line_stiffness": 1000}
    lines = call("check", write_case(tmp_path, changed(LOOSE, tow=line | {"ramp": 1}))).stdout.splitlines()
    assert lines[0].endswith("valid, with 1 warning") and lines[-1] == lines[0] and lines[-2].startswith(
        "warning              tow.ramp: 1 s is short for a body that swings on its line")
    slow = changed(LOOSE, tow=line | {"ramp": 100}, run__duration=120, domain__ends="open")
    assert "warning" not in call("check", write_case(tmp_path, slow)).stdout


def test_a_run_that_ends_within_its_ramp_is_a_warning(tmp_path):
    said = "tow.ramp: the speed rises for 40 s, but the run ends after 30 s"
    case = changed(LOOSE, tow__ramp=40)
    assert said in call("check", write_case(tmp_path, case)).stdout
    assert any(w.startswith(said) for w in run(tmp_path, case, "--steps", 3).warnings)
    assert "tow.ramp" not in call("check", write_case(tmp_path, changed(LOOSE, tow__ramp=29))).stdout


def test_a_body_that_would_capsize_is_a_warning(tmp_path):
    body = {"x": 3, "length": 2}
    for shape, width in ({"shape": "disc"}, 2), ({"shape": "ship", "width": 0.5}, 0.5):
        for draft, odd in (2.2 * width, True), (1.8 * width, False):
            case = changed(LOOSE, body=body | shape | {"draft": draft})
            said = call("check", write_case(tmp_path, case)).stdout
            assert (f"body.draft: {draft:g} m is 2.2 times the least width of the body" in said) == odd, said


def test_a_body_larger_than_an_open_domain_is_refused(tmp_path):
    """Red when it is valid, with no floe beside the body."""
    case = changed(MAP, domain__length=50, domain__width=50, ice__size=3, body__length=60)
    said = call("check", write_case(tmp_path, case))
    assert said.returncode == CASE and "the body spans 60.0482 m along x in a domain of 50 m" in said.stderr
    assert "the body spans 60.0482 m along y" in said.stderr


def test_thirty_lengths_of_a_disc_are_thirty_widths(tmp_path):
    """Red when they are 29.98, by the polygon that has its area."""
    case = changed(MAP, domain={"frame": "geographic", "length": 3000, "width": 2400, "ends": "open",
                                "sides": "periodic"}, ice__concentration=0.75, body__x=-1000)
    found = json.loads(call("check", write_case(tmp_path, case), "--json").stdout)["domain"]
    assert found["body_widths"] == found["body_widths_needed"] == 30
    assert "arches of rigid floes not expected" in call("check", tmp_path / "case.yml").stdout
    assert "use at least 30 body widths" in call("check", tmp_path / "case.yml", "--set", "domain.width=2390").stdout


def test_warnings_of_a_study(tmp_path):
    write_case(tmp_path, LOOSE, "base.yml")
    (tmp_path / "study.yml").write_text('{"base": "base.yml", "parameters": {"run.dt": [0.1, 0.2]}}')
    lines = call("check", "study.yml", cwd=tmp_path).stdout.splitlines()
    assert lines[0] == lines[-1] == "study.yml: valid, with warnings in 1 of 2 conditions"
    said, = call("check", "base.yml", "--set", "run.dt=0.2", cwd=tmp_path).stdout.splitlines()[-2:-1]
    assert said.startswith("warning              run.dt: 0.2 s") and lines[-2] == said + " (condition 2: run.dt 0.2)"
    # of one code the first stands for all
    (tmp_path / "study.yml").write_text('{"base": "base.yml", "parameters": {"run.dt": [0.1, 0.2, 0.3]}}')
    lines = call("check", "study.yml", cwd=tmp_path).stdout.splitlines()
    assert lines[-2] == said + " (condition 2: run.dt 0.2; and 1 more)" and "warning" not in lines[-3]


# ---- no sizes of a basin at full scale ----

MAP = {"run": {"dt": 5, "duration": 600},
       "domain": {"frame": "geographic", "length": 2000, "width": 1000, "ends": "open", "sides": "open"},
       "ice": {"concentration": 0.2, "size": 40, "thickness": 1}, "body": {"length": 80, "draft": 40},
       "tow": {"mode": "line", "speed": 0.5, "line_length": 300, "line_stiffness": "100 MN"}}


def missing(folder, case, *options):
    result = call("check", write_case(folder, case), *options)
    return result.returncode, [line.split(": ")[2] for line in result.stderr.splitlines()]


def test_sizes_have_no_default_in_the_geographic_frame(tmp_path):
    assert missing(tmp_path, MAP) == (DONE, [])
    keys = ["domain.length", "domain.width", "domain.ends", "domain.sides", "ice.concentration", "ice.size",
            "ice.thickness", "body.length", "body.draft", "tow.speed", "tow.line_length", "tow.line_stiffness"]
    for key in keys:
        case = changed(MAP, **{key.replace(".", "__"): None})
        assert missing(tmp_path, case) == (CASE, [key])
        text = call("check", tmp_path / "case.yml").stderr
        assert "missing, and in domain.frame: geographic it has no default" in text and "add it (" in text
        assert missing(tmp_path, case, "--set", f"{key}={MAP[key.split('.')[0]][key.split('.')[1]]}") == (DONE, [])
    bare = changed(MAP, domain={"frame": "geographic"}, ice=None, body=None, tow={"mode": "line"})
    assert missing(tmp_path, bare) == (CASE, keys)
    assert missing(tmp_path, changed(bare, domain__frame="basin", run__dt=0.1, run__duration=10)) == (DONE, [])
    listed = json.loads(call("--list-keys", "--json").stdout)["keys"]
    assert [k["name"] for k in listed if not k["required"] and not k["default_at_sea"]] == keys


def test_defaults_that_follow_from_the_scene_at_sea(tmp_path):
    """Damping of the line and the speed of rest: in the basin they are numbers."""
    tow = MAP["tow"]

    def resolved(case, name):
        text = (run(tmp_path, case, "--steps", 1, name=name).dir / "case.resolved.yml").read_text()
        return yaml.safe_load(text)

    def si(text):
        return float(str(text).split()[0])

    one = resolved(MAP, "one")
    mass = 900 * np.pi / 4 * 80**2 * 40 * 1027 / 900 * 1.5
    critical = 2 * np.sqrt(100e6 / 300 * mass)
    assert si(one["tow"]["line_damping"]) == pytest.approx(0.03 * critical, rel=1e-3)
    assert si(one["solver"]["rest_speed"]) == pytest.approx(0.005)
    chosen = json.loads(call("check", write_case(tmp_path, MAP), "--json").stdout)["by_default"]
    assert chosen["tow.line_damping"] == pytest.approx(si(one["tow"]["line_damping"]))
    assert chosen["tow.ramp"] == pytest.approx(si(one["tow"]["ramp"])) and "tow.line_length" not in chosen
    said = " ".join(call("check", tmp_path / "case.yml").stdout.split())
    assert f"tow.line_damping {chosen['tow.line_damping']:.4g} N s/m, " in said
    given = json.loads(call("check", tmp_path / "case.yml", "--json", "--set", "tow.line_damping=1").stdout)
    assert "tow.line_damping" not in given["by_default"]
    two = resolved(changed(MAP, tow=tow | {"line": {"branches": 2}}), "two")
    assert si(two["tow"]["line_damping"]) == si(two["tow"]["branch2"]["damping"]) == pytest.approx(
        0.5 * 0.03 * np.sqrt(2) * critical, rel=1e-3)
    basin = changed(MAP, domain={"length": 2000, "width": 1000}, tow={"mode": "line"})
    basin = resolved(basin, "basin")
    assert si(basin["tow"]["line_damping"]) == 100 and si(basin["solver"]["rest_speed"]) == 1e-3
    assert si(basin["tow"]["line_stiffness"]) == 10e3 and si(basin["tow"]["line_length"]) == 5


def test_outlines_without_a_thickness(tmp_path):
    """Red when they have the basin's 4 cm."""
    ring = [[x, y] for x, y in ((0, 0), (30, 0), (30, 30), (0, 30), (0, 0))]

    def outlines(*properties):
        features = [{"type": "Feature", "properties": p, "geometry": {
            "type": "Polygon", "coordinates": [[[x + 60 * k, y] for x, y in ring]]}} for k, p in enumerate(properties)]
        (tmp_path / "floes.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))

    case = changed(MAP, body={"shape": "none"}, tow={"mode": "none"},
                   ice={"outlines": "floes.geojson", "outlines_crs": "plane"})
    outlines({"thickness": 1}, {"thickness": 2})
    assert missing(tmp_path, case) == (DONE, [])
    assert "  thickness: none" in (run(tmp_path, case).dir / "case.resolved.yml").read_text()
    again = run(tmp_path, tmp_path / "out/case.resolved.yml", name="again")
    assert list(again.dataset("/floes/thickness")) == [1, 2]
    outlines({"thickness": 1}, {"height": 2}, {"thick": 3})
    for command in ("check", "run"):
        said = call(command, write_case(tmp_path, case), *(["-o", tmp_path / "no"] if command == "run" else []))
        assert said.returncode == CASE and "2 of 3 outlines have no property `thickness` (but `" in said.stderr
    assert missing(tmp_path, case, "--set", "ice.thickness=1") == (DONE, [])
    assert missing(tmp_path, changed(case, domain__frame="basin", domain__x0=-1000)) == (DONE, [])
    text = "--set ice.thickness=none: is none, but a value is needed; give it (as in 1 m)"
    assert text in call("check", write_case(tmp_path, LOOSE), "--set", "ice.thickness=none").stderr


@pytest.mark.parametrize("cases", [100, pytest.param(300, marks=pytest.mark.slow)])
def test_no_case_runs_with_a_default_of_the_basin(tmp_path, cases):
    """Valid cases at sea, from each of which keys are taken away at random: what is left is refused, or none of
    the values that count is a basin's. Red when one of these rows has a default in both frames."""
    table = json.loads(call("--list-keys", "--json").stdout)
    basins = {k["name"]: k["default"] for k in table["keys"] if k["default_at_sea"] is False and not k["required"]}
    drawn, seed, refused, valid = random.Random(7), 0, 0, 0
    while valid + refused < cases:
        seed += 1
        case = random_cases.draw(seed, table)
        if case["domain"]["frame"] != "geographic":
            continue
        whole = write_case(tmp_path, case, "whole.yml")
        keys = [k for k in basins if random_cases.value_of(case, k) is not None]
        for key in drawn.sample(keys, drawn.randint(0, min(3, len(keys)))):
            *sections, last = key.split(".")
            at = case
            for section in sections:
                at = at[section]
            del at[last]
        done = call("check", write_case(tmp_path, case), "--scale", 1)
        if "it has no default (that would be a model basin's); add it" in done.stderr:
            refused += done.returncode == CASE
            continue
        if call("check", whole).returncode == CASE:
            continue
        valid += 1
        assert done.returncode == DONE, done.stderr
        assert not in_use(case, yaml.safe_load(done.stdout), basins), random_cases.text(case)
    assert min(refused, valid) > cases / 6


def in_use(case, resolved, basins):
    """Keys that nobody gave, that have the basin's value, and an effect."""
    tow, body = resolved["tow"], resolved["body"]["shape"]
    unused = set()
    if tow["mode"] not in ("line", "thrust"):
        unused |= {"tow.line_length", "tow.line_stiffness"}
    if body == "none":
        unused |= {"body.length", "body.draft", "tow.speed"}
    if body == "polygon":
        unused |= {"body.length"}
    if tow["mode"] == "none" or tow["programme"] != "none":
        unused |= {"tow.speed"}
    if random_cases.value_of(case, "tow.line.type", "numbers") != "numbers": # the twin has its numbers
        unused |= {"tow.line_stiffness"}
    if resolved["ice"]["size_law"] == "power":
        unused |= {"ice.size"}
    if float(resolved["ice"]["concentration"]) == 0:
        unused |= {"ice.thickness", "ice.size"}
    return [k for k in basins if k not in unused and random_cases.value_of(case, k) is None]


def test_what_needs_no_size_is_not_asked_for_one(tmp_path):
    assert missing(tmp_path, changed(MAP, ice={"concentration": 0})) == (DONE, [])
    assert missing(tmp_path, changed(MAP, body={"shape": "none"}, tow={"mode": "none"})) == (DONE, [])
    assert missing(tmp_path,
                   changed(MAP, body={"shape": "polygon", "vertices": [[-40, -20], [40, -20], [0, 30]],
                                      "draft": 20})) == (DONE, [])
    assert missing(tmp_path, changed(MAP, ice={"concentration": 0.2, "thickness": 1, "size_law": "power",
                                               "size_min": 20, "size_max": 60})) == (DONE, [])
    floe = {"shape": "disc", "length": 40, "x": 300, "y": 0}
    assert missing(tmp_path, changed(MAP, ice={"concentration": 0}, floes=[floe])) == (CASE, ["ice.thickness"])
    assert missing(tmp_path, changed(MAP, ice={"concentration": 0}, floes=[floe | {"thickness": 1}])) == (DONE, [])
    assert call("field", write_case(tmp_path, MAP), "-o", tmp_path / "field.h5").returncode == DONE
    assert missing(tmp_path, changed(MAP, ice={"field": "field.h5"})) == (DONE, [])


def test_rows_of_a_table_that_no_step_sees(tmp_path):
    rows = "t,u,v\n0,0,0\n5,0.01,0\n5.04,0.02,0\n5.08,0,0\n5.12,0,0\n5.22,0.01,0\n40,0.01,0\n40.01,0,0\n"
    (tmp_path / "current.csv").write_text(rows)
    case = write_case(tmp_path, changed(TOW, water__current_table="current.csv"))
    said = ("water.current_table: some rows change the velocity within less than a time step of 0.1 s (2 rows, the "
            "first at 5.04 s)")
    assert said in call("check", case).stdout
    assert [w for w in run(tmp_path, case, "--steps", 5).warnings if w.startswith(said)]
    assert "some rows change" not in call("check", case, "--set", "run.dt=0.04").stdout


# ---- splitting ----


def test_what_splits_the_mean_floe(tmp_path):
    """The loads of the closed forms, the least size that follows from the thickness, and a warning of thin ice."""

    def said(*settings, case=MAP):
        options = [part for key, value in settings for part in ("--set", f"ice.splitting.{key}={value}")]
        result = call("check", write_case(tmp_path, case), *options, "--json")
        assert result.returncode == DONE, result.stderr
        return json.loads(result.stdout)

    off, tough = said(), ("toughness", "150 kPa m^0.5")
    assert off["ice"]["split_opening_n"] is None and "ice.splitting.least_size" not in off["by_default"]
    on = said(tough)
    side = 40 * np.sqrt(np.pi / 4)
    for key, c, part in (("split_opening_n", 0.75, 4), ("split_three_point_n", 1.4, 1.5)):
        short = (c * 150e3 / 300e3)**2 # l0
        assert on["ice"][key] == pytest.approx(c * 150e3 / np.sqrt(side + short) * side / part, rel=1e-12)
    assert on["by_default"]["ice.splitting.least_size"] == 3
    thin = said(tough, case=changed(MAP, ice__thickness=0.05))
    assert thin["by_default"]["ice.splitting.least_size"] == 2
    codes = [[w["code"] for w in of["warnings"]] for of in (on, thin)]
    assert "thin_splits" not in codes[0] and "thin_splits" in codes[1]
    basin = said(tough, case=changed(MAP, domain={"length": 2000, "width": 1000}, ice__thickness=0.05))
    assert basin["by_default"]["ice.splitting.least_size"] == pytest.approx(0.15)
    assert "thin_splits" not in [w["code"] for w in basin["warnings"]]
    # numbers without a prefix, at full scale alone
    def odd(*settings, **more):
        return [w["values"] for w in said(*settings, **more)["warnings"] if w["code"] == "odd_strength"]
    assert odd(tough) == [] and odd(("toughness", "30 kPa m^0.5"), ("strength", "2 MPa")) == []
    assert odd(("toughness", "150"), ("strength", "300")) == [
        {"key": f"ice.splitting.{key}", "value": n, "least": low, "most": high}
        for key, n, low, high in (("toughness", 0.15, 50, 250), ("strength", 0.3, 200, 500))]
    assert odd(("toughness", "150"), case=changed(MAP, domain={"length": 2000, "width": 1000})) == []
    text = call("check", write_case(tmp_path, MAP), "--set", "ice.splitting.toughness=150 kPa√m").stdout
    assert "mean floe, as a square, splits under" in text and "without the time for splits" in text
    speed = float(re.search(r"reference speed +(\S+) m/s", text)[1])
    assert f"moves {MAP['run']['dt'] * speed / 3:.3g} of the least width of a piece per step" in text
    text = call("check", write_case(tmp_path, MAP)).stdout
    assert "least width of a piece" not in text and "without the time for splits" not in text


PERIODS = {"run": {"dt": 0.1, "duration": 1}, "body": {"shape": "none"}, "tow": {"mode": "none"},
           "domain": {"length": 100, "width": 100, "ends": "periodic", "sides": "periodic"},
           "ice": {"concentration": 0.6, "size": 2, "thickness": 0.5}}


def test_floes_too_large_to_turn_in_a_period(tmp_path):
    """Which size is refused depends on the floes made: `check` warns from 31 m on. Where nothing is fixed, nothing is
    said of a fixed floe."""
    for size, warns in (20, False), (40, True), (90, True):
        case = changed(PERIODS, ice__size=size)
        path = write_case(tmp_path, case)
        codes = {w["code"] for w in json.loads(call("check", path, "--json").stdout)["warnings"]}
        assert ("large_floes" in codes) == warns
        done = run(tmp_path, case, "--steps", 1, "--force", code=CASE if warns else DONE)
        assert ("two largest bodies" in done.result.stderr) == warns and "floes[" not in done.result.stderr


def test_dense_polygons_may_not_pack(tmp_path):
    def checked(concentration, shape):
        path = write_case(tmp_path, changed(PERIODS, ice__concentration=concentration, ice__shape=shape))
        found = json.loads(call("check", path, "--json").stdout)
        return "dense_polygons" in {w["code"] for w in found["warnings"]}, found["cost"]["making_of_ice_s"]

    assert not checked(0.8, "polygons")[0] and not checked(0.9, "voronoi")[0]
    warned, seconds = checked(0.9, "polygons")
    assert warned and seconds > 10
