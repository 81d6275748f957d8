# SPDX-License-Identifier: MIT
"""A floe that is lost or doubled between ranks, or is not the same on both, ends the run with its id: never a wrong
result."""
import os

import pytest

from harness import BERGTOW, DONE, NUMERIC
from test_ranks_output import mpirun, ours

PROGRAM = os.path.join(os.path.dirname(BERGTOW), "tests/parallel/broken_division")


def spoil(how):
    result = mpirun(2, how, program=(PROGRAM,))
    lines = result.stdout.split()
    return result, lines[0], lines[1:]


def test_a_sound_division():
    result, gid, more = spoil("sound")
    assert result.returncode == DONE and ours(result) == [], result.stderr
    assert int(gid) >= 0 and more == ["sound"]


@pytest.mark.parametrize("again", range(3))
@pytest.mark.parametrize("how, reported, count", [("lost", "held by no rank: id {};", 599),
                                              ("doubled", "held by several ranks: id {};", 601)])
def test_lost_and_doubled(how, reported, count, again):
    """More than once: a rank that leaves before the message is out takes the other one down with it."""
    result, gid, more = spoil(how)
    assert result.returncode == NUMERIC, result.stderr
    assert more == []
    assert reported.format(gid) in ours(result)[0], result.stderr
    assert f"after a migration {count} of 600 bodies are owned" in ours(result)[-1]


@pytest.mark.parametrize("how", ["changed", "missing"])
def test_copies_that_differ(how):
    result, gid, more = spoil(how)
    assert result.returncode == NUMERIC and more == [], result.stderr
    assert len(ours(result)) == 1 and f"body {gid} is not the same on all ranks that need it" in ours(result)[0]
