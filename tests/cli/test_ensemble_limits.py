# SPDX-License-Identifier: MIT
"""Ensembles under the options of `run`: limits of steps and wall time, values in place of the study's; and members
without frames."""
import json
import subprocess

import h5py
import numpy as np
import pytest

from harness import (BERGTOW, CASE, DONE, SIGNAL, TOW, USAGE, call, changed, differing, environment, launcher, quick,
                     write_case)
from test_ensemble import BASE, STUDY, ensemble, journal, prepare

LONG = changed(TOW, run__duration=3000, output__window_start=5, domain__length=500)


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    folder = prepare(tmp_path_factory.mktemp("quiet"))
    result = ensemble(folder)
    assert result.returncode == DONE, result.stderr
    return folder


def frames(path):
    with h5py.File(path) as f:
        return len(f["frames/time"])


@pytest.mark.slow
def test_members_write_no_frames_unless_the_study_asks(quiet, tmp_path):
    member = quiet / "all/members/c001-r001"
    assert frames(member / "result.h5") == 0 and "frame_interval: -1 s" in (member / "case.resolved.yml").read_text()
    assert 'CollectionType="Temporal"' in (member / "frames.xdmf").read_text()
    base = changed(BASE, output__frame_interval=5)  # what one run is to show
    for name, study, count in (("base", STUDY, [0, 0]), ("set", STUDY | {"set": {"output.frame_interval": 10}}, [3, 3]),
                               ("with", STUDY | {"with": {"ice.concentration=0.5": {"output.frame_interval": 4}}},
                                [0, 6]), ("zero", STUDY | {"set": {"output.frame_interval": 0}}, [201, 201])):
        (tmp_path / name).mkdir()
        prepare(tmp_path / name, study | {"repeats": 1}, base)
        assert ensemble(tmp_path / name).returncode == DONE
        assert [frames(tmp_path / name / f"all/members/{m}-r001/result.h5") for m in ("c001", "c004")] == count, name
        # frames change nothing else
        for m in ("c001-r001", "c004-r001"):
            hashes = [json.loads((f / "all/members" / m / "summary.json").read_text())["state_hash"]
                      for f in (quiet, tmp_path / name)]
            assert hashes[0] == hashes[1]


def test_a_run_without_frames_is_kept_and_resumed(tmp_path):
    case = changed(BASE, output__frame_interval=-1, output__checkpoint_steps=40)
    write_case(tmp_path, case)
    assert call("run", "case.yml", "-o", "whole", "--quiet", cwd=tmp_path).returncode == DONE
    assert call("run", "case.yml", "-o", "parts", "--quiet", "--steps", 90, cwd=tmp_path).returncode == DONE
    assert call("resume", "parts", "--quiet", cwd=tmp_path).returncode == DONE
    assert frames(tmp_path / "parts/result.h5") == 0
    assert differing(tmp_path / "whole/result.h5", tmp_path / "parts/result.h5") == []
    twin = call("check", "case.yml", "--scale", 30, cwd=tmp_path)  # a word for none scales with nothing
    assert twin.returncode == DONE and "frame_interval: -1 s" in twin.stdout


def test_the_disk_of_members_without_frames(tmp_path):
    def disk(study):
        prepare(tmp_path, study, BASE)
        text = call("check", "study.yml", cwd=tmp_path).stdout
        number, unit = next(line.split()[2:4] for line in text.splitlines() if line.startswith("disk"))
        return float(number) * {"MB": 1.0, "GB": 1e3}[unit]
    assert disk(STUDY) < 0.8 * disk(STUDY | {"set": {"output.frame_interval": 0.1}})


@pytest.mark.slow
@pytest.mark.parametrize("ranks", quick([1, 2], 1))
def test_so_many_steps_of_each_member_in_a_call(quiet, tmp_path, ranks):
    """200 steps a member, in calls of 80: two leave all of them, the third ends them, with the same file."""
    prepare(tmp_path)
    command = launcher(2) if ranks > 1 else []
    for k in range(3):
        result = subprocess.run([*command, BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1", "--steps",
                                 "80"], cwd=tmp_path, env=environment(OMP_NUM_THREADS=1), capture_output=True,
                                text=True, timeout=120)
        if k < 2:
            assert result.returncode == SIGNAL and "12 members left; repeat the command to" in result.stderr
            done = [json.loads(p.read_text())["n_steps"] for p in tmp_path.glob("all/members/*/summary.json")]
            assert done == [80 * (k + 1)] * 12
            assert not list(tmp_path.glob("all/members/*/finished"))
    assert result.returncode == DONE, result.stderr
    assert differing(quiet / "all/ensemble.h5", tmp_path / "all/ensemble.h5") == []
    assert [j["event"] for j in journal(tmp_path)].count("stopped") == 24


def test_a_limit_of_wall_time(tmp_path):
    """The member at hand stops with a checkpoint, and goes on from there."""
    prepare(tmp_path, STUDY | {"repeats": 1}, LONG)
    result = ensemble(tmp_path, "all", "--max-wall", "1")
    assert result.returncode == SIGNAL and "repeat the command to continue with the 4" in result.stderr
    steps = {p.parent.name: json.loads(p.read_text())["n_steps"] for p in tmp_path.glob("all/members/*/summary.json")}
    assert len(steps) == 1 and 0 < min(steps.values()) < 30000
    assert (tmp_path / "all/members" / next(iter(steps)) / "checkpoint.h5").exists()
    ensemble(tmp_path, "all", "--max-wall", "0.5 s")
    again = json.loads((tmp_path / "all/members" / next(iter(steps)) / "summary.json").read_text())["n_steps"]
    assert again > steps[next(iter(steps))]
    for bad in ("--max-wall=0", "--max-wall=soon", "--steps=0"):
        assert ensemble(tmp_path, "all", bad).returncode == USAGE


def test_a_stop_of_an_ensemble(tmp_path):
    """Whatever stops it, no signal is named that was none; and nothing is stopped once all members are finished."""
    prepare(tmp_path, STUDY | {"repeats": 1})
    assert ensemble(tmp_path, "all", "--steps", 3).returncode == SIGNAL
    next(tmp_path.glob("all/members/*/")).joinpath("stop").touch()
    stopped = ensemble(tmp_path, "all")
    assert stopped.returncode == SIGNAL and "repeat the command to continue" in stopped.stderr
    assert "signal" not in stopped.stderr
    assert ensemble(tmp_path, "all").returncode == DONE
    late = ensemble(tmp_path, "all", "--max-wall", 0.001)
    assert late.returncode == DONE and late.stderr == ""


@pytest.mark.slow
def test_a_limit_of_wall_time_leaves_whole_fields(quiet, tmp_path):
    """Without one the longest members come first, so that the last do not wait for a long one."""
    prepare(tmp_path)
    assert ensemble(tmp_path, "all", "--max-wall", 1000).returncode == DONE
    fields, costly = ([e["member"].split("-") for e in journal(f) if e["event"] == "start"] for f in (tmp_path, quiet))
    assert [r for _, r in fields] == sorted(r for _, r in fields)
    assert [c for c, _ in costly] != [c for c, _ in fields] and costly[0][0] == costly[1][0] == costly[2][0]


@pytest.mark.slow
def test_a_limit_of_wall_time_leaves_a_fair_sample_of_a_hypercube(tmp_path):
    """Whatever its conditions cost: where the time ends, the costly ones alone would have another mean. Without a limit
    nothing is left out, and the costly ones come first."""
    hypercube = {"base": "base.yml", "sampling": "latin-hypercube", "samples": 12, "repeats": 2,
                 "parameters": {"ice.concentration": {"from": 0.1, "to": 0.7}}}
    started = []
    for folder, limit in (("free", []), ("limited", ["--max-wall", 1000])):
        (tmp_path / folder).mkdir()
        prepare(tmp_path / folder, hypercube)
        assert ensemble(tmp_path / folder, "all", *limit).returncode == DONE
        started.append([e["member"] for e in journal(tmp_path / folder) if e["event"] == "start"])
    free, limited = started
    assert limited == [f"c{c:03d}-r{r:03d}" for r in (1, 2) for c in range(1, 13)]
    with h5py.File(tmp_path / "free/all/ensemble.h5") as f:
        ice = dict(zip(f["members/name"].asstr()[:], f["parameters/ice.concentration"][:]))
    assert [ice[m] for m in free] == sorted(ice.values(), reverse=True) and sorted(limited) == sorted(free)


def test_values_in_place_of_those_of_the_study(tmp_path):
    prepare(tmp_path, STUDY | {"repeats": 1})
    given = ("--set", "run.duration=10", "--set", "output.frame_interval=5")
    assert ensemble(tmp_path, "all", *given).returncode == DONE
    member = tmp_path / "all/members/c001-r001"
    assert json.loads((member / "summary.json").read_text())["sim_time_s"] == 10 and frames(member / "result.h5") == 3
    again = ensemble(tmp_path)  # without them it is another study
    assert again.returncode == CASE and "holds the members of another study" in again.stderr
    assert ensemble(tmp_path, "all", *given).returncode == DONE
    refused = ensemble(tmp_path, "other", "--set", "tow.speed=0.3")
    assert refused.returncode == CASE and "takes precedence; change it there" in refused.stderr


def test_the_keys_of_a_study_are_listed():
    text, listed = call("--list-keys").stdout, json.loads(call("--list-keys", "--json").stdout)["study_keys"]
    assert [k["name"] for k in listed] == ["title", "report", "base", "set", "parameters", "variants", "with",
                                           "sampling", "samples", "repeats", "seed", "fields", "ranks"]
    assert {k["name"]: k["type"] for k in listed}["with"] == "map" and [k["name"] for k in listed if k["required"]
                                                                        ] == ["base"]
    part = text.split("A study file")[1]
    assert all(np.any([line.startswith(k["name"] + " ") for line in part.splitlines()]) for k in listed)
