# SPDX-License-Identifier: MIT
"""A body shape, keys and a force from outside, in runs of the program they were added to: tests/examples/extended.c.

By themselves: tests/unit/test_added.c, tests/physics/test_force_law.c. Here: the list of keys, the resolved case, a
tow, a resumed one, the balance on the console, the pages.
"""
import json
import re
import subprocess

import h5py
import numpy as np
import pytest
import yaml

from harness import CASE, ROOT, TOW, call, changed, write_case
from test_contact_law import EXTENDED, of_run, started

from bergtow.result import run as bergtow_read

CAPSULE = changed(TOW, run__duration=4, body__shape="capsule", body__length=3, body__width=1,
                  pilot={"depth": "0.04 km"})


def test_the_list_of_keys_has_them():
    said = subprocess.run([EXTENDED, "--list-keys"], capture_output=True, text=True, check=True).stdout
    assert re.search(r"^ *pilot\.depth", said, re.M) and re.search(r"^ *pilot\.clearance", said, re.M)
    assert "capsule" in said and "capsule" not in call("--list-keys").stdout


@pytest.mark.ranks
def test_a_tow_of_it_and_the_same_again(tmp_path):
    whole, summary, _ = of_run(tmp_path / "whole", CAPSULE)
    resolved = yaml.safe_load((whole / "case.resolved.yml").read_text())
    assert resolved["body"]["shape"] == "capsule" and resolved["pilot"] == {"depth": "40 m", "clearance": "2 m"}
    with h5py.File(whole / "result.h5") as f:
        assert np.isfinite(f["series/ice_resistance"][()]).all()
    started("run", whole / "case.resolved.yml", "-o", tmp_path / "again")
    assert json.loads((tmp_path / "again/summary.json").read_text())["state_hash"] == summary["state_hash"]
    stopped, _, _ = of_run(tmp_path / "stopped", CAPSULE, "--steps", 12)
    started("resume", "out", ranks=2, cwd=tmp_path / "stopped")
    assert json.loads((stopped / "summary.json").read_text())["state_hash"] == summary["state_hash"]
    _, box, _ = of_run(tmp_path / "box", changed(CAPSULE, body__shape="rectangle"))
    assert box["state_hash"] != summary["state_hash"]


def test_an_added_force_stands_in_the_balance(tmp_path):
    """The console names what the mean resistance is the rest of, an added law by its own name, and so does the page."""
    waves = changed(TOW, run__duration=8, output__window_start=2, wave_drift={"amplitude": "0.02 m"})
    folder, summary, said = of_run(tmp_path, waves)
    force, balance = re.search(r"from balances +(\S+) N by (tow - .* - inertia), ", said).groups()
    words = "tow - drag - Coriolis - tilt - wave_drift - inertia"
    assert balance == words
    parts = [summary[f"mean_{name}_force_n"] for name in ("tow", "drag", "coriolis", "tilt", "wave_drift", "inertia")]
    assert abs(parts[4]) > 0.1
    assert float(force) == pytest.approx(parts[0] - sum(parts[1:]), rel=1e-2)
    run = bergtow_read.Run(folder)
    assert run.balance == words.replace("-", "−")


def test_the_program_without_them_refuses(tmp_path):
    refused = call("check", write_case(tmp_path, CAPSULE))
    assert refused.returncode == CASE and "pilot" in refused.stderr and "capsule" in refused.stderr


@pytest.mark.parametrize("page, source", [("body-shape", "body_shape"), ("key", "key")])
def test_the_pages_show_the_code_that_is_tested(page, source):
    text = (ROOT / f"docs/how-to-add-a-{page}.md").read_text()
    assert re.findall(r"^```c\n(.*?)^```", text, re.S | re.M)[0] == (ROOT / f"tests/examples/{source}.c").read_text()
