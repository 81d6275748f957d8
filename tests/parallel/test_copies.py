# SPDX-License-Identifier: MIT
"""What ranks hold of each other after every step (copies.c): no more than they need, the same bits and marks."""
import os
import re

import pytest

from harness import BERGTOW, DONE, quick
from test_ranks_output import mpirun

PROGRAM = os.path.join(os.path.dirname(BERGTOW), "tests/parallel/copies")


@pytest.mark.parametrize("ranks", quick([2, 3, 4], 3))
def test_ranks_hold_what_they_need(ranks):
    result = mpirun(ranks, program=(PROGRAM, ))
    assert result.returncode == DONE, result.stderr
    labellings, divisions, moved, beside = (int(n) for n in re.findall(r"\d+", result.stdout))
    assert labellings > 5 and divisions > 5 and moved > 100  # otherwise nothing went over
    assert beside > 3  # the body has met floes that another rank holds
