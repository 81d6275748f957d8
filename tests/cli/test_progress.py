# SPDX-License-Identifier: MIT
"""What a command says while it works."""
import os
import re
import subprocess
import sys
import time

import pytest
from harness import BERGTOW, ROOT, TOW, changed, run
import made_up_ensemble as made_up

from bergtow import progress


def lines(capsys):
    return [re.sub(r"\d+ s", "T s", line) for line in capsys.readouterr().err.splitlines()]


def test_a_line_names_what_takes_long_and_nothing_else(capsys, monkeypatch):
    monkeypatch.setattr(progress, "EVERY", 0.05)
    with progress.told("bergtow x"):
        time.sleep(0.12)
        assert lines(capsys) == []  # nothing said what it is at
        with progress.doing("report of a"):
            for k in progress.each("condition", "xyz"):
                if k == "y":
                    time.sleep(0.12)
            said = lines(capsys)
            assert said and set(said) == {"bergtow x: T s: report of a, condition 2 of 3"}
        with pytest.raises(ValueError), progress.doing("what fails"):
            raise ValueError
        time.sleep(0.12)
    time.sleep(0.12)
    assert lines(capsys) == []


SHORT = changed(TOW, output=None, run__duration=8, output__window_start=4)


@pytest.mark.parametrize("command, named", [("report", "report.html, picture: "), ("statistics", "2 members, ")])
def test_commands_that_can_take_long_say_what_they_are_at(tmp_path, command, named):
    """Each of them, with hardly any patience."""
    folder = run(tmp_path, SHORT).dir if command == "report" else made_up.write(
        tmp_path / "all", [made_up.member(range(100, 200), {"tow.speed": 0.1}, 0) for _ in range(2)])
    code = ("import sys; from bergtow import cli, progress; progress.EVERY = 1e-4; "
            f"sys.argv[1:] = [{command!r}, {str(folder)!r}]; cli.main()")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ | {
        "PYTHONPATH": str(ROOT / "postproc"), "BERGTOW": str(BERGTOW)})
    assert done.returncode == 0, done.stderr
    assert re.search(rf"^bergtow {command}: \d+ s: {named}", done.stderr, re.M), done.stderr
