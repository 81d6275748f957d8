# SPDX-License-Identifier: MIT
"""Guards among ranks: the same step, body and words as on one rank, reported once; and the same largest
overlap of the last state."""
import json

from harness import CLOSING, DONE, NUMERIC, changed, run, write_case
from test_ranks_output import mpirun, ours

# Longer, so that there are cells for all.
WIDE = {"domain__length": 16, "domain__width": 9}


def reported(text):
    return sorted(line for line in text.splitlines() if "failure.h5" not in line)


def test_a_floe_beyond_a_wall_is_named_once(tmp_path):
    case = changed(CLOSING, **WIDE)
    one = run(tmp_path, case, "--quiet", code=NUMERIC)
    several = mpirun(3, "run", write_case(tmp_path, case), "-o", tmp_path / "several", "--quiet")
    assert several.returncode == NUMERIC
    assert reported(one.result.stderr) == sorted(line for line in ours(several) if "failure.h5" not in line)
    assert (tmp_path / "several/failure.h5").exists()


def test_the_overlap_of_the_last_state(tmp_path):
    case = changed(CLOSING, run__duration=2.5, guard={"overlap": 0, "no_solution": 0, "escape": False}, **WIDE)
    one = run(tmp_path, case, "--quiet")
    assert one.summary["max_overlap_m"] > one.series("overlap").max()
    assert mpirun(3, "run", write_case(tmp_path, case), "-o", tmp_path / "several", "--quiet").returncode == DONE
    several = json.loads((tmp_path / "several/summary.json").read_text())
    assert [several[k]
            for k in ("max_overlap_m", "state_hash")] == [one.summary[k] for k in ("max_overlap_m", "state_hash")]
