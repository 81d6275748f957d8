# SPDX-License-Identifier: MIT
"""Ensembles: whatever happens to the processes, every member is there once, and the file is that of a quiet run."""
import json
import os
import random
import shutil
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest

from harness import (BERGTOW, CASE, DONE, IO, SIGNAL, TOW, call, changed, differing, environment, heard, launcher,
                     quick, write_case)

BASE = changed(TOW, run__duration=20, output__window_start=5)
STUDY = {"title": "small", "base": "base.yml", "repeats": 3, "seed": 4,
         "parameters": {"ice.concentration": [0.2, 0.5], "tow.speed": {"from": "0.1 m/s", "to": "0.2 m/s", "n": 2}}}


def prepare(folder, study=STUDY, base=BASE):
    write_case(folder, base, "base.yml")
    (folder / "study.yml").write_text(json.dumps(study))
    return folder


def ensemble(folder, out="all", *more, **how):
    return call("ensemble", "study.yml", "-o", out, "--threads", 1, *more, cwd=folder, **how)


def journal(folder, out="all"):
    return [json.loads(line) for line in (folder / out / "journal.jsonl").read_text().splitlines()]


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    folder = prepare(tmp_path_factory.mktemp("quiet"))
    result = ensemble(folder)
    assert result.returncode == DONE, result.stderr
    return folder, result


def test_conditions_with_common_fields_make_them_once(tmp_path):
    """Members that another condition shares its ice with take it from there, stopped or not, and have the results they
    have alone; the fields are gone once all is done."""
    study = {"title": "s", "base": "base.yml", "repeats": 2, "seed": 4, "fields": "common",
             "parameters": {"tow.speed": ["0.1 m/s", "0.2 m/s"], "ice.friction": [0.2, 0.3]}}
    prepare(tmp_path, study)
    assert ensemble(tmp_path, "all", "--steps", 1).returncode == SIGNAL
    kept = sorted(p.name for p in (tmp_path / "all/fields").iterdir())
    assert len(kept) == 2
    assert ensemble(tmp_path).returncode == DONE and not (tmp_path / "all/fields").exists()
    for member in "c001-r002", "c004-r002":
        folder = tmp_path / "all/members" / member
        alone = call("run", folder / "case.resolved.yml", "-o", tmp_path / member)
        assert alone.returncode == DONE, alone.stderr
        hashes = [json.loads((at / "summary.json").read_text())["state_hash"] for at in (folder, tmp_path / member)]
        assert hashes[0] == hashes[1]
    del study["fields"] # each condition has its own: nothing is kept
    (tmp_path / "study.yml").write_text(json.dumps(study))
    assert ensemble(tmp_path, "own", "--steps", 1).returncode == SIGNAL and not (tmp_path / "own/fields").exists()


def test_a_member_of_numbered_fields_is_the_run_of_its_seed(tmp_path):
    """Also where a way is set for some members: a list of points, as a text."""
    way = "[[14, 0.5], [17, 1]]"
    prepare(tmp_path, {"base": "base.yml", "repeats": 2, "seed": 70, "fields": "numbered",
                       "variants": {"straight": {}, "led": {"tow.waypoints": way}}}, changed(BASE, run__duration=6))
    assert ensemble(tmp_path).returncode == DONE
    for name, seed, more in (("c001-r001", 70, []), ("c001-r002", 71, []),
                             ("c002-r002", 71, ["--set", f"tow.waypoints={way}"])):
        alone = call("run", "base.yml", "-o", name, "--set", f"ice.seed={seed}", *more, cwd=tmp_path)
        assert alone.returncode == DONE, alone.stderr
        hashes = [json.loads((at / "summary.json").read_text())["state_hash"] for at in
                  (tmp_path / "all/members" / name, tmp_path / name)]
        assert hashes[0] == hashes[1]
    prepare(tmp_path, {"base": "base.yml", "repeats": 2, "seed": 71, "fields": "numbered"})
    assert "another study" in ensemble(tmp_path).stderr


def test_a_study_names_its_members(quiet, tmp_path):
    """The base's title is that of one condition. What the study sets is kept, and a study without a title says no more
    than the base."""
    def title(folder, name="c004-r002"):
        return json.loads((folder / "all/members" / name / "summary.json").read_text())["title"]
    assert title(quiet[0]) == "small, ice.concentration 0.5, tow.speed 0.2, field 2"
    base = changed(TOW, run={"dt": 0.1, "duration": 1, "title": "of the base"})
    one = {"base": "base.yml", "parameters": {"ice.concentration": [0.2, 0.5]}}
    wanted = {"of the base": {}, "set": {"title": "s", "set": {"run.title": "set"}},
              "s: #1, ice.concentration 0.5, field 1": {"title": "s: #1"}}
    for k, (text, more) in enumerate(wanted.items()):
        (tmp_path / str(k)).mkdir()
        assert ensemble(prepare(tmp_path / str(k), one | more, base)).returncode == DONE
        assert title(tmp_path / str(k), "c002-r001") == text


def test_a_row_for_each_member(quiet):
    folder, result = quiet
    with h5py.File(folder / "all/ensemble.h5") as f:
        assert f.attrs["complete"] == 1 and f.attrs["n_members"] == 12 and f.attrs["n_finished"] == 12 and f.attrs[
            "n_failed"] == 0
        assert np.all(f["members/status"][()] == 1) and len(set(f["members/seed"][()])) == 12
        for number in (f["member"], f["members/id"]):
            assert number[()].tolist() == list(range(1, 13)) and number.attrs["long_name"].endswith("from 1")
        assert np.array_equal(f["members/condition"][()], np.repeat([0, 1, 2, 3], 3))
        assert np.array_equal(f["parameters/ice.concentration"][()], np.repeat([0.2, 0.5], 6))
        assert np.allclose(f["parameters/tow.speed"][()], np.tile(np.repeat([0.1, 0.2], 3), 2),
                           rtol=1e-15) and f["parameters/tow.speed"].attrs["units"] == "m/s"
        for i, name in enumerate(f["members/name"].asstr()[()]):
            member = folder / "all/members" / name
            summary = json.loads((member / "summary.json").read_text())
            assert f["members/state_hash"].asstr()[i] == summary["state_hash"]
            assert f["summary/mean_ice_resistance_n"][i] == summary["mean_ice_resistance_n"]
            with h5py.File(member / "result.h5") as r:
                assert np.array_equal(f["series/ice_resistance"][i], r["series/ice_resistance"][()])
            # A member is an ordinary run: its case alone gives the same.
            if i in (0, 11):
                assert call("run", member / "case.resolved.yml", "-o", f"again{i}", "--quiet",
                            cwd=folder).returncode == DONE
                assert json.loads(
                    (folder / f"again{i}/summary.json").read_text())["state_hash"] == summary["state_hash"]
        assert not {"wall_time_s", "threads", "phases_s_solve"} & set(f["summary"])
    assert "12 members: 4 conditions x 3 fields" in result.stdout and "12 finished, 0 failed" in result.stdout.replace(
        "members ", "")


def test_warnings_of_the_members_are_printed(quiet):
    """Once for each code, in the words of the first member that has it; also by a call that finds all finished."""
    folder, result = quiet
    wanted = {}
    for path in sorted((folder / "all/members").glob("*/summary.json")):
        for code, text in {w["code"]: w["text"] for w in reversed(json.loads(path.read_text())["warnings"])}.items():
            wanted.setdefault(code, [text, path.parent.name, 0])[2] += 1
    lines = [f"  warning: {text} ({name}{f'; and {n - 1} more' if n > 1 else ''})" for text, name, n in wanted.values()]
    for said in (result.stdout, ensemble(folder).stdout):
        assert sorted(line for line in said.splitlines() if line.startswith("  warning: ")) == sorted(lines) != []
    assert "warning" not in ensemble(folder, "all", "--quiet").stdout


def test_finished_members_are_not_run_again(quiet):
    folder, _ = quiet
    before = len(journal(folder))
    result = ensemble(folder)
    assert result.returncode == DONE and len(journal(folder)) == before


def test_killed_and_called_again(quiet, tmp_path):
    folder, _ = quiet
    prepare(tmp_path)
    rng = random.Random(3)
    for _ in range(4):
        child = subprocess.Popen([BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1"], cwd=tmp_path,
                                 env=environment(OMP_NUM_THREADS=1), stdout=subprocess.DEVNULL)
        time.sleep(0.15 + 0.4 * rng.random())
        child.kill()
        child.wait()
    stopped = len([j for j in journal(tmp_path) if j["event"] == "start"]) - len(
        [j for j in journal(tmp_path) if j["event"] == "finished"])
    assert stopped >= 1 # some member was struck in its middle
    assert ensemble(tmp_path).returncode == DONE
    assert differing(folder / "all/ensemble.h5", tmp_path / "all/ensemble.h5") == []
    assert sorted(j["member"]
                  for j in journal(tmp_path)
                  if j["event"] == "finished") == sorted(p.name for p in (tmp_path / "all/members").iterdir())


@pytest.mark.slow
def test_a_line_that_a_kill_kept_out_of_the_journal_is_added(quiet, tmp_path):
    folder, _ = quiet
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    path = tmp_path / "all/journal.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    lost = [k for k, line in enumerate(lines) if '"finished", "member": "c003-r002"' in line]
    assert len(lost) == 1
    path.write_text("".join(lines[:lost[0]] + lines[lost[0] + 1:]))
    assert ensemble(tmp_path).returncode == DONE
    assert path.read_text().splitlines(keepends=True)[:-1] == lines[:lost[0]] + lines[lost[0] + 1:]
    added = journal(tmp_path)[-1]
    assert (added["event"], added["member"], added["wall_time_s"]) == ("finished", "c003-r002", None)
    assert ensemble(tmp_path).returncode == DONE and len(journal(tmp_path)) == len(lines)


@pytest.mark.slow
def test_a_reader_that_has_gone(quiet, tmp_path):
    """Red when SIGPIPE ends the ensemble after its first line."""
    folder, _ = quiet
    prepare(tmp_path)
    reader, writer = os.pipe()
    os.close(reader)
    result = subprocess.run([BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1"], cwd=tmp_path,
                            env=environment(OMP_NUM_THREADS=1), stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert result.returncode == IO and "standard output: cannot be written" in result.stderr
    assert differing(folder / "all/ensemble.h5", tmp_path / "all/ensemble.h5") == []


@pytest.mark.parametrize("number", quick([signal.SIGINT, signal.SIGHUP], signal.SIGINT))
def test_interrupted(quiet, tmp_path, number):
    folder, _ = quiet
    prepare(tmp_path)
    child = subprocess.Popen([BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1"], cwd=tmp_path,
                             env=environment(OMP_NUM_THREADS=1), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                             text=True, preexec_fn=heard)
    while not list(tmp_path.glob("all/members/*/result*.h5")):
        time.sleep(0.01)
    child.send_signal(number)
    out, err = child.communicate(timeout=60)
    assert child.returncode == SIGNAL and "to continue with the" in err
    with h5py.File(tmp_path / "all/ensemble.h5") as f:
        assert f.attrs["complete"] == 0
    kept = list(tmp_path.glob("all/members/*/checkpoint.h5"))
    assert len(kept) == 1  # of the member at hand, which goes on from there: its steps up to then are not made again
    with h5py.File(kept[0]) as f:
        assert f["world/step"][0] > 0
    assert ensemble(tmp_path).returncode == DONE
    with h5py.File(kept[0].parent / "result.h5") as f:
        assert f.attrs["complete"] == 1
    assert not list(tmp_path.glob("all/members/*/checkpoint*.h5"))
    assert differing(folder / "all/ensemble.h5", tmp_path / "all/ensemble.h5") == []


@pytest.mark.slow
def test_several_processes_and_ranks_share_the_members(quiet, tmp_path):
    folder, _ = quiet
    prepare(tmp_path)
    jobs = [subprocess.Popen([BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1", "--quiet"], cwd=tmp_path,
                             env=environment(OMP_NUM_THREADS=1)) for _ in range(3)]
    assert [j.wait(timeout=120) for j in jobs] == [DONE] * 3
    starts = [j["member"] for j in journal(tmp_path) if j["event"] == "start"]
    assert len(starts) == len(set(starts)) == 12 and len({j["pid"] for j in journal(tmp_path)}) > 1
    # the one that ended last may have gathered before another's last member
    assert ensemble(tmp_path).returncode == DONE
    assert differing(folder / "all/ensemble.h5", tmp_path / "all/ensemble.h5") == []

    groups = changed(STUDY, ranks=2, repeats=2)
    prepare(tmp_path / "mpi", groups)
    result = subprocess.run([*launcher(3), BERGTOW, "ensemble", "study.yml", "-o", "all", "--threads", "1"],
                            cwd=tmp_path / "mpi", env=environment(OMP_NUM_THREADS=1), capture_output=True, text=True,
                            timeout=180)
    assert result.returncode == DONE, result.stderr
    with h5py.File(folder / "all/ensemble.h5") as a, h5py.File(tmp_path / "mpi/all/ensemble.h5") as b:
        kept = a["members/repeat"][()] < 2
        assert np.array_equal(a["members/state_hash"][kept], b["members/state_hash"][()])


def test_one_member_fails_and_the_rest_complete(tmp_path):
    # The second condition ends before its window begins, which only the whole case shows.
    prepare(tmp_path, {"base": "base.yml", "parameters": {"run.duration": [8, 3, 6]}})
    result = ensemble(tmp_path)
    assert result.returncode == CASE
    assert "member c002-r001 failed (3)" in result.stderr and "output.window_start" in result.stderr
    # reported beforehand, too
    assert call("check", "study.yml",
                cwd=tmp_path).stderr.replace(" (condition 2: run.duration 3)",
                                             "").strip().removeprefix("bergtow: ") in result.stderr
    with h5py.File(tmp_path / "all/ensemble.h5") as f:
        assert list(f["members/status"][()]) == [1, 2, 1] and f.attrs["complete"] == 1
        assert "output.window_start" in f["members/reason"].asstr()[1]
        assert np.isnan(f["summary/mean_ice_resistance_n"][1]) and np.isfinite(
            f["series/time"][0]).sum() == 80 and np.isfinite(f["series/time"][2]).sum() == 60
    before = len(journal(tmp_path))
    assert ensemble(tmp_path).returncode == CASE and len(journal(tmp_path)) == before
    assert ensemble(tmp_path, "all", "--retry-failed").returncode == CASE and len(journal(tmp_path)) == before + 2


def test_a_full_disk_is_named_and_made_good(quiet, tmp_path):
    folder, _ = quiet
    prepare(tmp_path, changed(STUDY, repeats=1))
    # The members' files hit the limit on file sizes; the small texts do not.
    limited = subprocess.run(["bash", "-c", f"ulimit -f 40; exec {BERGTOW} ensemble study.yml -o all --threads 1"],
                             cwd=tmp_path, env=environment(OMP_NUM_THREADS=1), capture_output=True, text=True,
                             timeout=120)
    assert limited.returncode == IO and "failed (4)" in limited.stderr and "ulimit -f" in limited.stderr
    assert ensemble(tmp_path, "all").returncode == DONE
    with h5py.File(folder / "all/ensemble.h5") as a, h5py.File(tmp_path / "all/ensemble.h5") as b:
        assert np.array_equal(a["members/state_hash"][()][::3],
                              b["members/state_hash"][()]) and b.attrs["n_failed"] == 0


def test_a_process_that_dies_each_time_does_not_stop_the_rest(tmp_path):
    prepare(tmp_path, changed(STUDY, repeats=1))
    bad = tmp_path / "all/members/c004-r001"
    bad.mkdir(parents=True)
    (bad / "attempts").write_text("." * 20)
    result = ensemble(tmp_path)
    assert ("its process died in each of 20 attempts" in result.stderr
            and "3 members finished, 1 failed" in result.stdout)
    assert [j["member"] for j in journal(tmp_path)][-1] == "c004-r001"  # it came last


def test_another_study_is_refused(quiet, tmp_path):
    folder, _ = quiet
    for name, study, base in ("values", changed(STUDY, parameters={"ice.concentration": [0.2, 0.6]}),
                              BASE), ("base", STUDY, changed(BASE, ice__friction=0.1)), ("seed", changed(STUDY,
                                                                                                         seed=5), BASE):
        here = prepare(tmp_path / name, study, base)
        os.symlink(folder / "all", here / "all")
        result = ensemble(here)
        assert result.returncode == CASE and "another study" in result.stderr, name
    more = prepare(tmp_path / "more", changed(STUDY, repeats=4))
    subprocess.run(["cp", "-r", folder / "all", more / "all"], check=True)
    assert ensemble(more).returncode == DONE
    with h5py.File(folder / "all/ensemble.h5") as a, h5py.File(more / "all/ensemble.h5") as b:
        old = b["members/repeat"][()] < 3
        assert b.attrs["n_finished"] == 16 and np.array_equal(a["members/state_hash"][()], b["members/state_hash"][old])


BAD = {
    "repeat": 3, "set": {"run.duration": "20 x", "ice.sed": 4}, "sampling": "lhs", "parameters": {
        "ice.concentration": [0.2, 1.5, 0.2], "tow.speed": {"from": 0.3, "too": 0.2, "n": 1}, "ice.seed": [1, 2],
        "tow": 4, "run.duration": [1], "body.draft": []
    }
}


def test_every_fault_of_a_study_at_once(tmp_path):
    prepare(tmp_path, BAD)
    result = ensemble(tmp_path)
    assert result.returncode == CASE and not (tmp_path / "all").exists()
    for part in ("repeat: unknown key of a study; did you mean repeats", "base: missing", "\"x\" is not a unit of time",
                 "ice.sed: unknown key; did you mean ice.seed", "1.5 is out of range", "did you mean to",
                 "ice.seed: the fields of a study", "tow: is a section", "give grid or latin-hypercube",
                 "body.draft: the list is empty"):
        assert part in result.stderr, part
    assert "Traceback" not in result.stderr and all(
        line.startswith("bergtow: study.yml") for line in result.stderr.splitlines())
