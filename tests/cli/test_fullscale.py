# SPDX-License-Identifier: MIT
"""cases/fullscale/study.py on a small piece of ice: the table, what is kept and what is run again, and its exit
codes."""

import pytest

from harness import CASE, DONE, ROOT, USAGE, call, script

STUDY = ROOT / "cases/fullscale/study.py"
SMALL = ("--set", "domain.length=900 m", "--set", "domain.width=500 m", "--set", "body.x=-300 m", "--set",
         "run.duration=500", "--set", "output.window_start=100", "--set", "tow.ramp=50 s", "--set", "ice.shake=2",
         "--threads", "1")


def study(*arguments):
    return script(STUDY, *arguments)


def test_the_base_case_is_what_the_readme_says():
    result = call("check", ROOT / "cases/fullscale/berg.yml")
    assert result.returncode == DONE
    for words in ("5000 x 2500 m", "1440 of 5 s", "0.5 m/s", "80.06 m across", "time step, contact   5 s", ": ok"):
        assert words in result.stdout.replace("body                 ", ""), words
    floes = next(line for line in result.stdout.splitlines() if line.startswith("floes"))
    assert int(floes.split()[-1]) > 10_000


@pytest.mark.slow
def test_a_study_makes_a_table_and_keeps_what_is_done(tmp_path):
    first = study("concentration", "--concentrations", 0.1, 0.4, "--out", tmp_path, *SMALL)
    assert first.returncode == DONE, first.stderr
    table = (tmp_path / "resistance.md").read_text()
    assert [line.split("|")[1].strip() for line in table.splitlines()[2:]] == ["10", "40"]
    assert table in first.stdout and (tmp_path / "resistance.png").stat().st_size > 10_000
    assert "kept" not in first.stdout

    # another value of a key is another run; the tree of a build that differs from its revision keeps nothing
    dirty = "-dirty" in call("--version").stdout or "(unknown" in call("--version").stdout
    again = study("concentration", "--concentrations", 0.1, 0.4, "--out", tmp_path, *SMALL)
    assert again.returncode == DONE and again.stdout.count(": kept") == (0 if dirty else 2)
    assert (tmp_path / "resistance.md").read_text() == table
    other = study("concentration", "--concentrations", 0.4, "--out", tmp_path, *SMALL, "--set", "ice.thickness=0.5 m")
    assert other.returncode == DONE and ": kept" not in other.stdout


def test_time_steps_on_one_field(tmp_path):
    result = study("dt", "--steps", 2.5, 5, "--concentration", 0.3, "--out", tmp_path, *SMALL)
    assert result.returncode == DONE, result.stderr
    lines = (tmp_path / "dt.md").read_text().splitlines()
    assert [line.split("|")[1].strip() for line in lines[2:]] == ["2.5", "5"]


def test_a_run_that_fails_ends_the_study_with_its_code(tmp_path):
    result = study("dt", "--out", tmp_path, "--set", "ice.thicknes=1")
    assert (result.returncode == CASE and "did you mean ice.thickness" in result.stderr
            and "exit code 3" in result.stderr)


@pytest.mark.parametrize("words", [("nothing", ), (), ("concentration", "--concentrations", "1.2"),
                                   ("dt", "--steps", "0"), ("dt", "--bergtow", "/none")])
def test_usage(words):
    result = study(*words)
    assert result.returncode == USAGE and "Traceback" not in result.stderr
