# SPDX-License-Identifier: MIT
"""Commands that are scripts and start runs of their own, under mpirun: on one rank as without it, on more refused."""
import subprocess

import pytest

from harness import BERGTOW, DONE, TOW, USAGE, changed, differing, environment, quick, write_case
from test_ranks_output import mpirun, ours

CASE = changed(TOW, run__duration=40, output__window_start=8, domain__length=14, ice__concentration=0.3, ice__size=0.9,
               estimate__length_scale=30)


@pytest.mark.parametrize("command", quick(["budget", "capability", "converge", "design", "outlines"], "design",
                                          "outlines"))
def test_two_ranks_are_refused(tmp_path, command):
    """Each would make the same study, in the same folder."""
    write_case(tmp_path, CASE)
    result = mpirun(2, command, "case.yml", "-o", "out", cwd=tmp_path)
    assert result.returncode == USAGE and not result.stdout
    assert ours(result) == [f"bergtow: {command}: does not run under MPI; call it without mpirun or srun: it "
                            "starts the runs that it needs, --jobs at a time"]
    assert [p.name for p in tmp_path.iterdir()] == ["case.yml"]


@pytest.mark.slow
def test_a_study_on_one_rank_is_that_without_mpirun(tmp_path):
    """What the script starts does not take itself for the rank that it was started by."""
    write_case(tmp_path, CASE)
    result = mpirun(1, "design", "case.yml", "-o", "out", "--concentrations", "0.2,0.3", "--fields", 5, cwd=tmp_path,
                    timeout=150)
    complaints = [line for line in ours(result) if line.startswith("bergtow: ")]  # the rest tells of progress
    assert result.returncode == DONE and not complaints, result.stderr
    assert {"report.html", "report.pdf", "replay.html"} <= {p.name for p in (tmp_path / "out").iterdir()}
    again = subprocess.run([BERGTOW, "ensemble", "out/design.yml", "-o", "again"], cwd=tmp_path, capture_output=True,
                           text=True, timeout=150, env=environment())
    assert again.returncode == DONE, again.stderr
    assert differing(tmp_path / "out/ensemble.h5", tmp_path / "again/ensemble.h5") == []
