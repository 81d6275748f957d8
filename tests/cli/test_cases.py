# SPDX-License-Identifier: MIT
"""The case files that are shipped: all are valid, the bridle of 2005 parts, and every number of cases/field says where
it is from.
"""
import re

import h5py
import numpy as np
import pytest
import yaml

from harness import DONE, ROOT, call, run

from bergtow.study.case_file import is_study

FIELD = ROOT / "cases/field"
NAMES = ["barents-2004", "barents-2005", "bohai-2013", "kara-2017", "kulluk-1983"]
FILES = sorted((ROOT / "cases").glob("**/*.yml"))
CASES = [p for p in FILES if not is_study(p)]
STUDIES = [p for p in FILES if p not in CASES]
README = (FIELD / "README.md").read_text()


def test_there_are_the_five_and_their_pictures():
    assert sorted(p.stem for p in FIELD.glob("*.yml")) == NAMES
    for name in NAMES:
        for kind in ("force", "field"):
            picture = FIELD / f"{name}-{kind}.png"
            assert f"({picture.name})" in README and 10_000 < picture.stat().st_size < 150_000, picture
    assert not re.search(r"!\[[^]]*\]\((?!" + "|".join(NAMES) + ")", README)


def test_a_study_stands_where_studies_are():
    assert {p.parent for p in STUDIES} == {ROOT / "cases/studies"} and len(STUDIES) >= 5 and len(CASES) >= 10


@pytest.mark.parametrize("path", STUDIES, ids=lambda p: p.name)
def test_every_condition_of_a_shipped_study_is_valid(path):
    result = call("check", path)
    assert result.returncode == DONE, result.stderr
    assert ": valid" in result.stdout and not result.stderr and "TOO LARGE" not in result.stdout


@pytest.mark.parametrize("path", CASES, ids=lambda p: str(p.relative_to(ROOT / "cases")))
def test_a_shipped_case_is_valid(path):
    result = call("check", path)
    assert result.returncode == DONE, result.stderr
    assert ": valid" in result.stdout and not result.stderr and "TOO LARGE" not in result.stdout
    if path.parent == FIELD:
        advice = [line for line in result.stdout.splitlines() if line.startswith("time step,")]
        assert len(advice) == 2 and all(line.endswith(": ok") for line in advice), advice
        assert "geographic" in path.read_text()


@pytest.mark.parametrize("name", NAMES)
def test_every_number_of_a_case_says_where_it_is_from(name):
    """Every key has a mark [P], [R] or [A], but for the seed, the body's place, and words that choose a form."""
    plain = {"x", "y", "seed", "title", "frame", "shape", "ends", "mode", "size_law", "thickness_law", "tilt", "type",
             "conversion"}
    marked = 0
    lists_on_one_line = re.sub(r"\],\n\s+\[", "], [", (FIELD / f"{name}.yml").read_text())
    for line in lists_on_one_line.splitlines():
        match = re.match(r"\s*(?:- )?(\w+): ", line)
        if not match or match[1] in plain or line.startswith("#"):
            continue
        assert re.search(r"\[[PRA]\]", line), line
        marked += 1
    assert marked > 20
    assert "SCENARIO" in (FIELD / f"{name}.yml").read_text()


@pytest.mark.parametrize("name", NAMES)
def test_the_readme_has_the_numbers_of_the_case(name):
    """Every row of a section's table is marked published, reported or assumed with a source or a reason, and the
    section speaks of this case."""
    section = re.search(rf"^## {name}\n(.*?)(?=^## |\Z)", README, re.S | re.M)[1]
    rows = [line for line in section.splitlines() if re.match(r"\| .*\|$", line) and not line.startswith("| ---")]
    marks = [re.search(r"\b(published|reported|assumed)\b \(", row) for row in rows[1:] if "±" not in row]
    assert len(marks) >= 5 and all(marks), [r for r, m in zip(rows[1:], marks) if not m]
    case = yaml.safe_load((FIELD / f"{name}.yml").read_text())
    percent = case["ice"]["concentration"] * 100
    assert f"{percent:g} %" in section or f"{percent / 10:g}/10" in section
    assert str(case["run"]["duration"]) in section and str(case["run"]["dt"]) in section
    for word in ("mean ice resistance", "warnings", "in the pictures"):
        assert word in section.lower(), word


def test_the_bridle_of_2005_parts_as_the_vessel_speeds_up_again(tmp_path):
    """Slowed at the large floe the line hangs slack; then the worn branch parts, and the tow goes on with the other."""
    r = run(tmp_path, FIELD / "barents-2005.yml", "--threads", 1, "--quiet", "--steps", 690, "--set",
            "output.frame_interval=1h")
    with h5py.File(r.dir / "result.h5") as f:
        kinds, subjects, when, value = (f[f"events/{k}"][:] for k in ("kind", "subject", "time", "value"))
    assert list(kinds) == [0] and list(subjects) == [1] and 1200 < when[0] < 1380 and value[0] > 500e3
    time, speed, one, two, yaw, thrust = r.series("time", "vessel_speed", "line_tension_1", "line_tension_2",
                                                  "body_yaw", "vessel_thrust")
    slack = (time > 1000) & (time < 1200)
    assert (one[slack] == 0).all() and (two[slack] == 0).all() and speed[slack].max() < 0.3, "hindered, the line hangs"
    after = time > when[0] + 1
    assert (one[after] == 0).all() and two[after].min() > 0 and speed[-1] > 0.5, "the tow goes on"
    before = (time > 600) & (time < 900)
    assert one[time <= when[0]].max() > 1.3 * one[before].max(), "under more than the steady tow put on it"
    assert abs(yaw[-1] - yaw[np.searchsorted(time, when[0])]) > 0.1, "the berg turns to the branch that is left"


@pytest.mark.parametrize("path",
                         sorted([*(ROOT / "cases").glob("*/README.md"), ROOT / "postproc/README.md"]),
                         ids=lambda p: p.parent.name)
def test_an_error_says_what_it_is(path):
    """± is one standard error, and the page says so."""
    text = path.read_text()
    assert "±" not in text or "standard error" in text
    assert not re.search(r"± [\d.,]+[^|\n]{0,6}(%|\(95)", text), "an interval of 95 % is written from a to b"
