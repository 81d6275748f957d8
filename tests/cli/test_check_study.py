# SPDX-License-Identifier: MIT
"""bergtow check of a study: every condition as `check` has its case, and what all of it costs."""
import json
import re
import subprocess

import pytest

from harness import BERGTOW, CASE, DONE, IO, TOW, USAGE, call, changed, environment, launcher, write_case

BASE = changed(TOW, run__duration=20, output__window_start=5)
STUDY = {
    "title": "three ices", "base": "base.yml", "repeats": 7, "set": {"ice.friction": 0.2},
    "parameters": {"ice.concentration": [0.2, 0.5, 0.7], "tow.speed": {"from": "0.1 m/s", "to": "0.2 m/s", "n": 2}},
    "with": {"ice.concentration=0.7": {"run.duration": "40 s"}}
}
SECONDS = {"s": 1, "min": 60, "h": 3600, "days": 86400}


def checked(folder, study, code=DONE, *more):
    write_case(folder, BASE, "base.yml")
    (folder / "study.yml").write_text(study if isinstance(study, str) else json.dumps(study, indent=1))
    result = call("check", "study.yml", *more, cwd=folder)
    assert result.returncode == code, result.stderr
    return result.stdout if code == DONE else result.stderr.splitlines()


def line(text, label):
    return re.search(rf"^{re.escape(label)} +(.*)$", text, re.M)[1]


def rows(text):
    """The table of conditions: cells parted by two blanks."""
    lines = text.splitlines()
    start = next(k for k, found in enumerate(lines) if found.startswith("condition"))
    table = [re.split(r"  +", found.strip()) for found in lines[start:] if re.match(r" *\d+ |condition", found)]
    return table[0], table[1:]


def seconds(text):
    number, unit = re.match(r"([\d.]+) (\w+)", text).groups()
    return float(number) * SECONDS[unit]


def test_the_study_in_numbers(tmp_path):
    text = checked(tmp_path, STUDY)
    # at 50 and 70 % the width shows
    assert text.startswith("study.yml: valid, with warnings in 4 of 6 conditions\n")
    assert line(text, "title") == "three ices" and line(text, "base") == "base.yml" and line(
        text, "set") == "output.frame_interval=-1 s, ice.friction=0.2"
    assert line(text, "ice.concentration") == "0.2, 0.5, 0.7" and line(text, "tow.speed") == "0.1, 0.2" and line(
        text, "members") == "6 conditions x 7 fields = 42"
    head, table = rows(text)
    assert head == ["condition", "ice.concentration", "tow.speed", "floes", "steps", "one run", "time step"]
    assert [row[:3] for row in table] == [[str(k + 1), c, v] for k, (c, v) in enumerate((c, v)
                                                                                        for c in ("0.2", "0.5", "0.7")
                                                                                        for v in ("0.1", "0.2"))]
    total = 0
    for row in table:
        more = ["--set", f"ice.concentration={row[1]}", "--set", f"tow.speed={row[2]}", "--set",
                "output.frame_interval=-1"] + (["--set", "run.duration=40"] if row[1] == "0.7" else [])
        alone = call("check", "base.yml", *more, cwd=tmp_path).stdout
        assert line(alone, "floes") == f"about {row[3]}" and line(alone, "steps").startswith(f"{row[4]} of ")
        assert f"rough estimate {row[5]} on one core" in alone
        total += 7 * seconds(row[5])
    assert seconds(line(text, "wall time").removeprefix("rough estimate ")) == pytest.approx(total, rel=0.1)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["base.yml", "study.yml"]


def test_time_steps_that_are_too_large_are_reported(tmp_path):
    head, table = rows(checked(tmp_path, {"base": "base.yml", "set": {"run.duration": 10},
                                          "parameters": {"run.dt": [0.1, 0.2], "tow.speed": [0.1, 0.9]}}))
    # 0.9 m/s: an eighth of a floe in 0.1 s; 0.2 s: longer than a collision
    assert [row[-1] for row in table] == ["ok", "TOO LARGE", "TOO LARGE", "TOO LARGE"]
    assert [row[-3] for row in table] == ["100", "100", "50", "50"]


def test_many_conditions_are_a_range(tmp_path):
    parameters = {"ice.concentration": [0.2, 0.5], "tow.speed": {"from": 0.1, "to": 0.9, "n": 20}}
    text = checked(tmp_path, {"base": "base.yml", "set": {"run.duration": 10}, "parameters": parameters})
    few = checked(tmp_path,
                  {"base": "base.yml", "set": {"run.duration": 10}, "parameters": {"ice.concentration": [0.2, 0.5]}})
    floes, one = ([row[k] for row in rows(few)[1]] for k in (2, 4))
    assert "\ncondition" not in text and line(text, "floes") == " to ".join(floes) and line(
        text, "one run") == f"rough estimate {one[0]} to {one[1]} on one core"
    assert re.match(r"TOO LARGE in \d+ conditions", line(text, "time step")) and line(
        text, "members") == "40 conditions x 1 field = 40"
    assert line(text, "tow.speed").endswith("... 0.9 (20 values)")


def test_a_hypercube_and_variants(tmp_path):
    text = checked(
        tmp_path, {
            "base": "base.yml", "sampling": "latin-hypercube", "samples": 30, "ranks": 2, "fields": "common",
            "parameters": {"ice.friction": {"from": 0.1, "to": 0.4, "scale": "log"}
                           }, "variants": {"squares": {"ice.shape": "rectangles", "ice.aspect": 1}, "cells": {}}
        })
    assert line(text, "ice.friction") == "log-uniform from 0.1 to 0.4" and line(
        text, "variant") == "squares, cells" and line(text, "  squares") == "ice.shape=rectangles, ice.aspect=1"
    assert line(text, "members"
                ) == "30 conditions x 1 field = 30, a Latin hypercube, the same fields in all conditions, 2 ranks each"


def test_ends_of_a_distribution_stand_with_their_unit(tmp_path):
    """They are SI numbers. Red when they stand alone: a bare number of an angle is one of degrees."""
    text = checked(tmp_path, {
        "base": "base.yml", "sampling": "latin-hypercube", "samples": 2,
        "parameters": {"body.yaw": {"from": "-30 deg", "to": "60 deg", "distribution": "triangular"},
                       "tow.speed": {"from": "0.1 kn", "to": "0.2 kn", "source": "a log"}}
    })
    assert line(text, "body.yaw") == "triangular from -0.523599 to 1.0472 rad"
    assert line(text, "tow.speed") == "uniform from 0.0514444 to 0.102889 m/s; source: a log"


def test_faults_name_place_and_conditions(tmp_path):
    found = checked(tmp_path, """base: base.yml
parameters:
  run.duration: [8, 3]
  tow.speed: [0.1, 0.2, 0.3]
with:
  tow.speed=0.3:
    domain.width: 1
""", CASE)
    assert len(found) == 2, found  # each fault once, though it is of several conditions
    assert re.search(
        r"base\.yml:\d+: output\.window_start: 5 s is not below run\.duration, .*; give an earlier time \(condition 4: "
        r"run\.duration 3, tow\.speed 0\.1; and 2 more\)$",
        found[1]), found
    assert re.search(r"base\.yml:\d+: body\.length: .* \(condition 3: run\.duration 8, tow\.speed 0\.3; and 1 more\)$",
                     found[0]), found


def test_a_fault_of_a_value_names_its_line_of_the_study(tmp_path):
    """An end of the ice region that no base has: the fault is of the override, not of the base."""
    found = checked(tmp_path, "base: base.yml\nset:\n  ice.friction: 0.1\nparameters:\n  ice.x_max:\n    [10, 99]\n",
                    CASE)
    assert len(found) == 1 and re.match(r"bergtow: study\.yml:5: ice\.x_max=99: .* \(condition 2: ice\.x_max 99\)$",
                                        found[0]), found
    variants = "base: base.yml\nvariants:\n  near: {ice.x_max: 10}\n  far:\n    ice.friction: 0.1\n    ice.x_max: 99\n"
    assert checked(tmp_path, variants, CASE)[0].startswith("bergtow: study.yml:6: ice.x_max=99: ")
    assert checked(tmp_path, "base: base.yml\nset:\n\n  ice.x_max: 99\n",
                   CASE)[0].startswith("bergtow: study.yml:4: ice.x_max=99: ")
    result = call("ensemble", "study.yml", cwd=tmp_path)
    assert result.returncode == CASE and "study.yml:4: ice.x_max=99: " in result.stderr


def test_faults_of_the_study_and_of_the_base_are_reported_once(tmp_path):
    found = checked(tmp_path, changed(STUDY, set={"ice.sise": 1}, repeats="many"), CASE)
    assert len(found) == 2 and all(f.startswith("bergtow: study.yml:") for f in found)
    found = checked(tmp_path, STUDY | {"base": "none.yml"}, IO)
    assert len(found) == 2 and "none.yml: cannot be read" in found[0] and "study.yml: base: none.yml" in found[1]
    (tmp_path / "bad.yml").write_text(json.dumps(changed(BASE, ice__sise=1)))
    found = checked(tmp_path, STUDY | {"base": "bad.yml"}, CASE)
    assert len(found) == 2 and "ice.sise: unknown key" in found[0]


def test_what_a_condition_reads_is_looked_at(tmp_path):
    (tmp_path / "there.csv").write_text("t,u,v\n0,0,0\n99,0.1,0\n")
    study = {"base": "base.yml", "variants": {"still": {}, "table": {"water.current_table": "there.csv"},
                                              "lost": {"water.current_table": "none.csv"}}}
    found = checked(tmp_path, study, IO)
    assert len(found) == 1 and "none.csv" in found[0] and found[0].endswith("(condition 3: variant lost)")
    call("field", "base.yml", "-o", "field.h5", cwd=tmp_path)
    study = {"base": "base.yml", "set": {"ice.field": "field.h5"}, "parameters": {"tow.speed": [0.1, 0.2]}}
    floes = [row[2] for row in rows(checked(tmp_path, study))[1]]
    assert floes[0] == floes[1] and f"floes                {floes[0]} (read" in call(
        "check", "base.yml", "--set", "ice.field=field.h5", cwd=tmp_path).stdout
    (tmp_path / "field.h5").write_bytes(b"no field")
    assert "(condition 1: tow.speed 0.1; and 1 more)" in checked(tmp_path, study, CASE)[0]


def test_options_of_a_case_are_refused(tmp_path):
    assert "is a study, but --scale is for a case" in checked(tmp_path, STUDY, USAGE, "--scale", "30")[0]
    assert "is a study, but --json is for a case" in checked(tmp_path, STUDY, USAGE, "--json")[0]


@pytest.mark.parametrize("command", ["run", "field", "estimate"])
def test_what_is_for_cases_says_that_this_is_a_study(tmp_path, command):
    write_case(tmp_path, BASE, "base.yml")
    (tmp_path / "study.yml").write_text(json.dumps(STUDY))
    result = call(command, "study.yml", "-o", "out", cwd=tmp_path) if command != "estimate" else call(
        command, "study.yml", cwd=tmp_path)
    assert result.returncode == CASE, result.stderr
    assert "study.yml: is a study" in result.stderr and "bergtow ensemble" in result.stderr and len(
        result.stderr.splitlines()) == 1


def test_a_case_in_a_pipe_is_still_read(tmp_path):
    path = write_case(tmp_path, BASE)
    result = call("check", "/dev/stdin", input=path.read_text())
    assert result.returncode == DONE and "/dev/stdin: valid" in result.stdout


@pytest.mark.ranks
def test_under_mpirun_it_is_said_once(tmp_path):
    alone = checked(tmp_path, STUDY)
    env = environment(OMP_NUM_THREADS=1)
    for study, code in (STUDY, DONE), (STUDY | {"base": "none.yml"}, IO):
        checked(tmp_path, study, code)
        result = subprocess.run([*launcher(2), BERGTOW, "check", "study.yml"], cwd=tmp_path, env=env,
                                capture_output=True, text=True, timeout=60)
        assert result.returncode == code
        said = alone.splitlines() if code == DONE else []
        # what is said of the ranks comes on top
        assert [x for x in said if x not in result.stdout.splitlines()] == [x for x in said if x.startswith("memory")]
        assert result.stderr.count("bergtow: study.yml: base: ") == (code != DONE)


def under(ranks, *arguments, cwd):
    env = environment(OMP_NUM_THREADS=1)
    return subprocess.run([*launcher(ranks), BERGTOW, *arguments],
                          cwd=cwd, env=env, capture_output=True, text=True, timeout=60)


@pytest.mark.slow
def test_its_ranks_are_counted(tmp_path):
    """How many members at a time, what they take then, and whether there are enough."""
    study = {"base": "base.yml", "ranks": 2, "set": {"run.duration": 10}}
    alone = checked(tmp_path, study)
    assert line(alone, "ranks") == "2 a member: start with mpirun -n 2 or more"
    text = under(5, "check", "study.yml", cwd=tmp_path).stdout
    assert line(text, "ranks") == "5: 2 members at a time, 2 ranks each; some ranks are left over"
    one, two = map(float, re.match(r"about ([\d.]+) MB for one member, ([\d.]+) MB for 2 at a time",
                                   line(text, "memory")).groups())
    assert two == pytest.approx(2 * one, rel=0.01) and line(text, "memory").startswith(line(alone, "memory"))
    hours = re.search(r"^ {21}(.*) on 4 ranks", text, re.M)[1]
    assert seconds(hours) == pytest.approx(seconds(line(text, "wall time").removeprefix("rough estimate ")) / 4, rel=.1)
    (tmp_path / "study.yml").write_text(json.dumps(study | {"ranks": 3}))
    result = under(2, "check", "study.yml", cwd=tmp_path)
    assert result.returncode == CASE and "a member asks for 3 ranks and there are 2" in result.stderr


def test_values_in_place_of_those_of_the_study(tmp_path):
    """--set holds for all members; what the study varies stays as it is."""
    text = checked(tmp_path, STUDY, DONE, "--set", "ice.friction=0.3", "--set", "run.dt = 0.05")
    assert line(text, "set") == "output.frame_interval=-1 s, ice.friction=0.3, run.dt=0.05"
    assert rows(text)[1][0][4] == "400"
    for given, words in (("tow.speed=0.2", "--set tow.speed=0.2: tow.speed: is set under `parameters` of study.yml"),
                         ("run.duration=9", "run.duration: is set under `with` of study.yml"),
                         ("ice.sise=1", "--set ice.sise=1: ice.sise: unknown key; did you mean ice.size?"),
                         ("run.dt=fast", "--set run.dt=fast: run.dt: "), ("run.dt", "--set run.dt: is not key=value"),
                         ("ice.seed=4", "take their seeds from `seed`")):
        found = checked(tmp_path, STUDY, CASE, "--set", given)
        assert len(found) == 1 and words in found[0], found


def test_none_is_a_value_of_a_list(tmp_path):
    study = "base: base.yml\nparameters: {body.sail: [none, 0.1 m%s]}\n"
    assert [row[1] for row in rows(checked(tmp_path, study % ""))[1]] == ["none", "0.1 m"]
    twice = checked(tmp_path, study % ", none", CASE)
    assert "none is twice in the list" in twice[0]


def test_a_key_that_another_value_of_an_axis_needs(tmp_path):
    """The base alone has no use for the limits of the sizes; each condition has."""
    write_case(tmp_path, changed(BASE, ice__size_min=0.4, ice__size_max=2), "limits.yml")
    study = {"base": "limits.yml", "parameters": {"ice.size_law": ["lognormal", "power"]}}
    assert "2 conditions x 1 field" in checked(tmp_path, study)
