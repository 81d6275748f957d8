# SPDX-License-Identifier: MIT
"""Fifty runs on two ranks, each killed at a random moment and taken up on 1, 2 or 4 ranks: all end as the run that was
never stopped."""
import random
import time

import pytest

from resuming import assert_same_result, check_readable, done, killed_after, uninterrupted

KILLS = 50


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    path, _ = uninterrupted(folder)
    # How long it takes on two ranks, with its checkpoints.
    began = time.monotonic()
    done(2, "run", "case.yml", "-o", "two", "--quiet", "--threads", 1, cwd=folder)
    return folder, path, time.monotonic() - began


def test_fifty_kills(whole):
    folder, path, seconds = whole
    moments, kills, within = random.Random(50), 0, 0
    for k in range(2 * KILLS):
        name = f"k{k}"
        if not killed_after(
                seconds * moments.uniform(0.15, 1), 2, "run", "case.yml", "-o", name, "--quiet", "--threads", 1,
                cwd=folder):
            continue # over before the kill
        kills += 1
        check_readable(folder / name)
        within += any((folder / name / n).exists() for n in ("checkpoint.h5.tmp", "result.h5.tmp"))
        if not (folder / name / "case.resolved.yml").exists():
            continue # killed before it had begun: nothing to take up
        done([1, 2, 4][k % 3], "resume", name, "--quiet", "--threads", 1, cwd=folder)
        assert_same_result(path, folder / name)
        if kills == KILLS:
            break
    print(f"{kills} kills, {within} of them within the writing of a checkpoint")
    assert kills == KILLS and within > 0
