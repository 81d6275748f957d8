# SPDX-License-Identifier: MIT
"""Floes that raft on any number of ranks and threads, and across stops: the same bits. With a moving window, crushing
and rebounds in use, and in a jam.

What turns these tests red: a record left behind in a migration, friction of sheets that starts anew on another rank, an
area that was looked at before the poses of the step, sheets in the order of memory.
"""
import pytest

from harness import changed, run
from test_everything import ALL
from test_ranks import LINE, assert_legs_end_as, assert_same, many

WINDOW = changed(ALL,
                 ice__concentration=0.75,
                 ice__rafting={"kappa": 6},
                 ice__crushing={"pressure": "100 Pa", "least_length": 0.5},
                 run__duration=24)
JAM = changed(LINE, ice__rafting={"kappa": 8}, ice__thickness_law="lognormal", domain__ends_closing=0.15,
              run__duration=20)
CASES = {"window": WINDOW, "jam": JAM}


@pytest.fixture(scope="module", params=CASES)
def alone(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    return request.param, folder, run(folder, CASES[request.param], "--threads", 1, "--quiet")


def test_the_case_is_worth_it(alone):
    name, _, r = alone
    s = r.summary
    assert r.series("rafting").max() > 50 and s["raft_edge_work_j"] > 1 and s["raft_friction_work_j"] > 1
    assert s["momentum_residual"] < 1e-9 and s["positive_work_steps"] == 0
    area, energy, work = r.series("rafted_area", "rafted_energy", "raft_edge_work")
    assert area.max() > 1 and energy[-1] < work.sum()  # what is in the height of the sheets, edges have taken
    if name == "window":
        assert s["moving_window"]["renewed"] > 100 and s["crushed_work_j"] > 1
    else:
        assert s["rafted_share_of_ice"] > 0.01
        assert s["max_overlap_relative"] < 0.01  # rafted overlap is none


@pytest.mark.slow
@pytest.mark.parametrize("ranks, threads", [(1, 2), (2, 2), (3, 1)])
def test_ranks_and_threads(alone, ranks, threads):
    _, folder, one = alone
    assert_same(one, many(folder, ranks, threads))


def test_stopped_and_taken_up(alone):
    name, folder, one = alone
    laws = set(assert_legs_end_as(one, folder, 131, 60)["contacts/law"])
    assert 2 in laws and (name != "window" or 1 in laws)
