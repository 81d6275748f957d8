# SPDX-License-Identifier: MIT
"""Started by the launcher of another MPI, as its environment tells; and BERGTOW_MPI."""
import pytest

from harness import TOW, USAGE, call, environment, write_case

MPICH = {"PMI_SIZE": 2}


@pytest.fixture
def case(tmp_path):
    return write_case(tmp_path, TOW)


@pytest.mark.parametrize("rank", [0, 1])
def test_processes_that_would_all_do_the_same_are_refused(case, tmp_path, rank):
    result = call("run", case, "-o", tmp_path / "out", env=environment(**MPICH, PMI_RANK=rank))
    assert result.returncode == USAGE
    assert ("2 processes were started, but each runs alone" in result.stderr) == (rank == 0)
    assert "BERGTOW_MPI=no" in result.stderr or rank
    assert not (tmp_path / "out").exists()


def test_they_may_be_meant_to_work_apart(case, tmp_path):
    result = call("run", case, "-o", tmp_path / "out", "--steps", 1, "--quiet",
                  env=environment(**MPICH, PMI_RANK=1, BERGTOW_MPI="no"))
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "out/summary.json").exists()


def test_mpi_is_yes_or_no(case, tmp_path):
    result = call("check", case, env=environment(BERGTOW_MPI="maybe"))
    assert (result.returncode, result.stderr) == (USAGE, "bergtow: BERGTOW_MPI=maybe: give yes or no, or unset it\n")
    assert call("check", case, env=environment(BERGTOW_MPI="yes")).returncode == 0
