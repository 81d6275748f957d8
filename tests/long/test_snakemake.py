# SPDX-License-Identifier: MIT
"""A study by the Snakefile of cases/studies: the same ensemble.h5, killed and gone on with, too. Snakemake of Debian
takes 700 MB with its libraries of cloud storage, so it is not among the packages of `make test`."""
import json
import os
import shutil
import signal
import subprocess
import time

import pytest
from harness import BERGTOW, ROOT, TOW, call, changed, differing, environment, write_case

SNAKEFILE = ROOT / "cases/studies/Snakefile"


@pytest.fixture(scope="module", autouse=True)
def snakemake():
    assert shutil.which("snakemake"), "snakemake is missing: make deps-long"


def study(folder, duration):
    write_case(folder, changed(TOW, run__duration=duration, output={"checkpoint_steps": 20}), "base.yml")
    said = {"base": "base.yml", "repeats": 3, "parameters": {"tow.speed": [0.1, 0.15]}}
    (folder / "study.yml").write_text(json.dumps(said))
    assert call("ensemble", "study.yml", "-o", "alone", cwd=folder).returncode == 0


def workflow(folder, *more):
    return ["snakemake", "-s", SNAKEFILE, "--cores", "2", "--nolock", *more, "--config", "study=study.yml",
            "out=a folder/out", "tasks=2", f"bergtow={BERGTOW}"]


def test_the_workflow_makes_the_same_file(tmp_path):
    study(tmp_path, 4)
    done = subprocess.run(workflow(tmp_path), cwd=tmp_path, capture_output=True, text=True, env=environment())
    assert done.returncode == 0, done.stderr
    assert differing(tmp_path / "alone/ensemble.h5", tmp_path / "a folder/out/ensemble.h5") == []
    again = subprocess.run(workflow(tmp_path), cwd=tmp_path, capture_output=True, text=True, env=environment())
    assert again.returncode == 0 and "Nothing to be done" in again.stderr


def test_a_killed_workflow_goes_on(tmp_path):
    study(tmp_path, 40)
    out = tmp_path / "a folder/out"
    p = subprocess.Popen(workflow(tmp_path), cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                         env=environment(), start_new_session=True)
    end = time.monotonic() + 120
    while not list(out.glob("members/*/checkpoint.h5")):
        assert time.monotonic() < end and p.poll() is None
        time.sleep(0.02)
    os.killpg(p.pid, signal.SIGKILL)
    p.wait()
    done = subprocess.run(workflow(tmp_path, "--rerun-incomplete"), cwd=tmp_path, capture_output=True, text=True,
                          env=environment())
    assert done.returncode == 0, done.stderr
    assert differing(tmp_path / "alone/ensemble.h5", out / "ensemble.h5") == []


def test_a_bad_study_ends_the_workflow(tmp_path):
    study(tmp_path, 4)
    (tmp_path / "study.yml").write_text(json.dumps({"base": "base.yml", "parameters": {"tow.sped": [1]}}))
    done = subprocess.run(workflow(tmp_path), cwd=tmp_path, capture_output=True, text=True, env=environment())
    assert done.returncode != 0 and "tow.sped: unknown key" in done.stderr
