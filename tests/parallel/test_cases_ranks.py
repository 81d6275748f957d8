# SPDX-License-Identifier: MIT
"""The cases of cases/field start with the same bits on one rank and on two."""
import pytest

from harness import DONE, ROOT, Run, quick, run
from test_ranks_output import mpirun

CASES = sorted(path.stem for path in (ROOT / "cases/field").glob("*.yml"))


@pytest.mark.parametrize("name", quick(CASES, "bohai-2013", "kara-2017"))  # a managed lead; a moving window
def test_the_first_steps_are_the_same_on_two_ranks(tmp_path, name):
    path = ROOT / f"cases/field/{name}.yml"
    steps = ("--steps", 8, "--quiet", "--threads", 1, "--set", "output.frame_interval=1h", "--set", "ice.shake=2")
    one = run(tmp_path, path, *steps)
    result = mpirun(2, "run", path, "-o", tmp_path / "two", *steps, timeout=200)
    assert result.returncode == DONE, result.stderr
    two = Run(tmp_path / "two", result)
    assert two.hash == one.hash and two.summary["ranks"] == 2 and one.summary["n_steps"] == 8
    assert one.summary["n_floes"] > 1000
