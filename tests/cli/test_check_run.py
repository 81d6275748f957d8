# SPDX-License-Identifier: MIT
"""What `run` refuses, `check` refuses: the same message, the same exit code. What `run` goes through with a doubt,
`check` calls valid with a warning."""
import json
import os

import pytest

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
                                   floes=[PIER]), CASE, "which cannot give way, on its prescribed path"),
    "floes in each other": (changed(WATER, floes=[PIER | {"x": 9, "y": 2, "fixed": False},
                                                  PIER | {"x": 9.5, "y": 2}]), CASE, "overlap by"),
    "a floe on the body": (changed(WATER, floes=[PIER | {"x": 3, "y": 1, "fixed": False}]), CASE, "overlap by"),
    "a field that is not there": (reading(TOW, "none.h5"), IO, "none.h5"),
    "no field": (reading(TOW, "case.yml"), CASE, "case.yml"),
    "a table that is not there": (changed(TOW, water__current_table="none.csv"), IO, "none.csv"),
    "too many floes": (changed(TOW, domain__length=1e5, domain__width=1e4), CASE, "at most 20000000 are simulated"),
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


def test_floes_given_by_hand_take_their_room(tmp_path):
    """The concentration refers to the region without them, and so does the number of floes that is expected."""
    slab = {"shape": "rectangle", "length": 6, "width": 7.5, "x": 11, "y": 0}
    path = write_case(tmp_path, changed(TOW, floes=[slab], ice__size=0.3, ice__size_spread=0.05))
    made = int(call("field", path, "-o", tmp_path / "f.h5").stdout.split(": ")[1].split()[0])
    said = json.loads(call("check", path, "--json").stdout)["ice"]
    about = next(said[k] for k in said if "floes" in k)
    assert abs(about - 1 - made) < 0.06 * made


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
    assert ran.returncode == CASE and "GB of memory, and this machine has" in ran.stderr
    assert (checked.returncode, checked.stderr) == (ran.returncode, ran.stderr)
    (tmp_path / "study.yml").write_text('{"base": "case.yml", "parameters": {"tow.speed": [0.1, 0.2]}}')
    studied = call("check", tmp_path / "study.yml")
    assert studied.returncode == CASE and "GB of memory, and this machine has" in studied.stderr


def test_a_field_of_another_domain(tmp_path):
    assert call("field", write_case(tmp_path, TOW), "-o", tmp_path / "field.h5").returncode == DONE
    checked, ran = both(tmp_path, changed(reading(TOW, "field.h5"), domain__x0=4, body__x=7))
    assert ran.returncode == CASE and "field.h5: floe 0" in ran.stderr
    assert (checked.returncode, checked.stderr) == (ran.returncode, ran.stderr)


LOOSE = changed(TOW, ice__concentration=0.4)  # nothing depends on the width


def test_a_time_step_that_is_too_large_is_a_warning(tmp_path):
    """The run takes it, so it is no fault; but nothing calls it valid without a word."""
    case = changed(LOOSE, run__dt=0.6, run__duration=3, tow__ramp=1)
    checked = call("check", write_case(tmp_path, case))
    lines = checked.stdout.splitlines()
    assert checked.returncode == DONE and lines[0].endswith(
        "case.yml: valid, with 2 warnings") and lines[-1] == lines[0]
    assert lines[
        -3] == "warning              run.dt: 0.6 s is longer than a collision lasts in a basin; take at most 0.1 s"
    assert lines[-2].startswith("warning              run.dt: in 0.6 s floes move 0.111 of their size")
    run(tmp_path, case)
    good = call("check", write_case(tmp_path, LOOSE)).stdout
    assert good.splitlines()[0].endswith("case.yml: valid") and "warning" not in good


def test_a_start_that_jerks_the_line_is_a_warning(tmp_path):
    line = {"mode": "line", "speed": 0.13, "line_length": 3, "line_stiffness": 1000}
    lines = call("check", write_case(tmp_path, changed(LOOSE, tow=line | {"ramp": 1}))).stdout.splitlines()
    assert lines[0].endswith("valid, with 1 warning") and lines[-1] == lines[0] and lines[-2].startswith(
        "warning              tow.ramp: 1 s is short for a body that swings on its line")
    assert "warning" not in call("check", write_case(tmp_path, changed(LOOSE, tow=line | {"ramp": 100}))).stdout


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

MAP = {"run": {"dt": 5, "duration": 600}, "domain": {"frame": "geographic", "length": 2000, "width": 1000},
       "ice": {"concentration": 0.2, "size": 40, "thickness": 1}, "body": {"length": 80, "draft": 40}}


def missing(folder, case, *options):
    result = call("check", write_case(folder, case), *options)
    return result.returncode, [line.split(": ")[2] for line in result.stderr.splitlines()]


def test_sizes_have_no_default_in_the_geographic_frame(tmp_path):
    assert missing(tmp_path, MAP) == (DONE, [])
    keys = ["ice.concentration", "ice.size", "ice.thickness", "body.length", "body.draft"]
    for key in keys:
        case = changed(MAP, **{key.replace(".", "__"): None})
        assert missing(tmp_path, case) == (CASE, [key])
        text = call("check", tmp_path / "case.yml").stderr
        assert "missing, and in domain.frame: geographic it has no default" in text and "add it (" in text
        assert missing(tmp_path, case, "--set", f"{key}={MAP[key.split('.')[0]][key.split('.')[1]]}") == (DONE, [])
    assert missing(tmp_path, changed(MAP, ice=None, body=None)) == (CASE, keys)
    assert missing(tmp_path, changed(MAP, ice=None, body=None, domain__frame="basin")) == (DONE, [])


def test_what_needs_no_size_is_not_asked_for_one(tmp_path):
    assert missing(tmp_path, changed(MAP, ice={"concentration": 0})) == (DONE, [])
    assert missing(tmp_path, changed(MAP, body={"shape": "none"}, tow={"mode": "none"})) == (DONE, [])
    assert missing(tmp_path,
                   changed(MAP, body={"shape": "polygon", "vertices": [[-40, -20], [40, -20], [0, 30]],
                                      "draft": 20})) == (DONE, [])
    assert missing(
        tmp_path,
        changed(MAP, ice={"concentration": 0.2, "thickness": 1, "size_law": "power", "size_min": 20,
                          "size_max": 60})) == (DONE, [])
    floe = {"shape": "disc", "length": 40, "x": 300, "y": 0}
    assert missing(tmp_path, changed(MAP, ice={"concentration": 0}, floes=[floe])) == (CASE, ["ice.thickness"])
    assert missing(tmp_path, changed(MAP, ice={"concentration": 0}, floes=[floe | {"thickness": 1}])) == (DONE, [])
    assert call("field", write_case(tmp_path, MAP), "-o", tmp_path / "field.h5").returncode == DONE
    assert missing(tmp_path, changed(MAP, ice={"field": "field.h5"})) == (DONE, [])


def test_rows_of_a_table_that_no_step_sees(tmp_path):
    rows = "t,u,v\n0,0,0\n5,0.01,0\n5.04,0.02,0\n5.08,0,0\n5.12,0,0\n5.22,0.01,0\n40,0.01,0\n40.01,0,0\n"
    (tmp_path / "current.csv").write_text(rows)
    case = write_case(tmp_path, changed(TOW, water__current_table="current.csv"))
    said = ("water.current_table: rows that change the velocity within less than a time step of 0.1 s: 2, the first at "
            "5.04 s")
    assert said in call("check", case).stdout
    assert [w for w in run(tmp_path, case, "--steps", 5).warnings if w.startswith(said)]
    assert "rows that change" not in call("check", case, "--set", "run.dt=0.04").stdout
