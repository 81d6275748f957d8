# SPDX-License-Identifier: MIT
"""Files that the cases of a study name are part of it: members made with another content are of another study."""
import json
import os
import subprocess
import time

import pytest

from harness import BERGTOW, CASE, DONE, TOW, changed, environment
from test_ensemble import ensemble, journal, prepare

CURRENT = "t,u,v\n0,{0},0\n1000,{0},0\n"
BASE = changed(TOW, run__duration=4, water__current_table="current.csv")
STUDY = {"base": "base.yml", "repeats": 2}
SQUARE = {"type": "FeatureCollection", "features": [
    {"type": "Feature", "properties": {"thickness": 0.04},
     "geometry": {"type": "Polygon", "coordinates": [[[8, 0], [9, 0], [9, 1], [8, 1], [8, 0]]]}}]}


def write(folder, **speed):
    for name, u in speed.items():
        (folder / f"{name}.csv").write_text(CURRENT.format(u))


def refused(folder, name):
    result = ensemble(folder)
    return result.returncode == CASE and f"{folder}/{name}: has changed since members in all were made" in result.stderr


@pytest.mark.slow
def test_a_table_that_has_changed_is_another_study(tmp_path):
    write(tmp_path, current=0.01)
    prepare(tmp_path, STUDY, BASE)
    assert ensemble(tmp_path).returncode == DONE
    prepare(tmp_path, STUDY | {"repeats": 4}, BASE)
    write(tmp_path, current=0.02)
    before = len(journal(tmp_path))
    assert refused(tmp_path, "current.csv") and len(journal(tmp_path)) == before
    write(tmp_path, current=0.01)  # the same bytes, however new the file is
    os.utime(tmp_path / "current.csv")
    result = ensemble(tmp_path)
    assert result.returncode == DONE and result.stderr == "", result.stderr
    write(tmp_path, current=0.02)
    assert ensemble(tmp_path, "other").returncode == DONE


@pytest.mark.parametrize("axis", [
    {"parameters": {"water.current_table": ["slow.csv", "fast.csv"]}},
    {"variants": {"slow": {"water.current_table": "slow.csv"}, "fast": {"water.current_table": "fast.csv"}}},
    {"parameters": {"tow.speed": [0.1, 0.15]}, "with": {"tow.speed=0.1": {"water.current_table": "fast.csv"}}},
], ids=lambda axis: list(axis)[-1])
def test_a_file_that_some_members_name(tmp_path, axis):
    """Relative to the base case, as in the members."""
    (tmp_path / "study").mkdir()
    write(tmp_path, current=0.01, slow=0.01, fast=0.02)
    prepare(tmp_path, STUDY, BASE)
    prepare(tmp_path / "study", STUDY | axis | {"base": "../base.yml"})
    assert ensemble(tmp_path / "study").returncode == DONE
    write(tmp_path, fast=0.03)
    result = ensemble(tmp_path / "study")
    assert result.returncode == CASE and f"{tmp_path}/fast.csv: has changed since" in result.stderr


def test_outlines_and_bases_that_have_changed(tmp_path):
    outlines = tmp_path / "floes.json"
    outlines.write_text(json.dumps(SQUARE))
    base = changed(TOW, run__duration=4, ice__outlines="floes.json", ice__outlines_crs="frame", ice__concentration=None,
                   ice__size=None)
    prepare(tmp_path, STUDY | {"base": "near.yml", "repeats": 1}, base)
    (tmp_path / "near.yml").write_text("base: base.yml\ntow: {speed: 0.12}\n")
    assert ensemble(tmp_path).returncode == DONE
    outlines.write_text(json.dumps(SQUARE).replace("9", "9.5"))
    assert refused(tmp_path, "floes.json")
    outlines.write_text(json.dumps(SQUARE))
    assert ensemble(tmp_path).returncode == DONE
    prepare(tmp_path, STUDY | {"base": "near.yml", "repeats": 1}, changed(base, ice__friction=0.1))
    result = ensemble(tmp_path)
    assert result.returncode == CASE and "holds the members of another study" in result.stderr


def test_files_below_the_base_case_can_be_moved_with_it(tmp_path):
    """Version 0.1.0 recorded whole paths, which hold where they still lead. Red: nothing records what the file held."""
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    write(here, current=0.01)
    prepare(here, STUDY | {"variants": {"slow": {"water.current_table": "current.csv"}}},
            changed(BASE, water__current_table=None))
    assert ensemble(here).returncode == DONE
    names = here / "all/study.files"
    relative = names.read_text()
    names.write_text(f"{here}/{relative}")
    assert relative.startswith("current.csv: ") and ensemble(here).stderr == ""
    write(here, current=0.02)
    assert refused(here, "current.csv")
    names.write_text(relative)
    here.rename(there)
    assert refused(there, "current.csv")


def test_a_folder_of_an_earlier_version_is_taken_and_it_is_said(tmp_path):
    write(tmp_path, current=0.01)
    prepare(tmp_path, STUDY, BASE)
    assert ensemble(tmp_path).returncode == DONE
    (tmp_path / "all/study.files").unlink()
    before = len(journal(tmp_path))
    result = ensemble(tmp_path)
    assert result.returncode == DONE and len(journal(tmp_path)) == before
    assert f"{tmp_path}/current.csv: all has no digest of this file from when its members were run" in result.stderr
    assert ensemble(tmp_path).stderr == ""
    write(tmp_path, current=0.02)
    assert refused(tmp_path, "current.csv")


def test_a_table_that_changes_while_members_are_run(tmp_path):
    """The members at hand end, as they have read it; no other begins."""
    write(tmp_path, current=0.01)
    prepare(tmp_path, STUDY | {"repeats": 3}, changed(BASE, run__duration=40))
    with subprocess.Popen([BERGTOW, "ensemble", "study.yml", "-o", "all", "--jobs", "1"], cwd=tmp_path, text=True,
                          env=environment(OMP_NUM_THREADS=1), stderr=subprocess.PIPE,
                          stdout=subprocess.DEVNULL) as process:
        for _ in range(3000):
            if (tmp_path / "all/members/c001-r001/case.resolved.yml").exists():
                break
            time.sleep(0.01)
        write(tmp_path, current=0.02)
        _, said = process.communicate(timeout=120)
    assert process.returncode == CASE and "current.csv: has changed while the members of a study were made" in said
    assert [e["event"] for e in journal(tmp_path)] == ["start", "finished"]
    assert refused(tmp_path, "current.csv")
    write(tmp_path, current=0.01)
    assert ensemble(tmp_path).returncode == DONE


def test_other_words_for_the_meaning_of_a_key_are_no_other_study(tmp_path):
    """The comments of study.resolved.yml are the program's own, and another version may say them otherwise: then the
    folder goes on, and what finished in it stays sound."""
    prepare(tmp_path, STUDY, changed(TOW, run__duration=4))
    assert ensemble(tmp_path, "all", "--steps", 5).returncode != CASE
    kept = tmp_path / "all/study.resolved.yml"
    text = kept.read_text()
    assert text.count("  # mean floe thickness") == 1
    kept.write_text(text.replace("  # mean floe thickness", "  # said otherwise"))
    assert ensemble(tmp_path).returncode == DONE
    before = len(journal(tmp_path))
    result = ensemble(tmp_path)
    assert result.returncode == DONE and len(journal(tmp_path)) == before, result.stderr
    kept.write_text(text.replace("concentration: ", "concentration: 0.0", 1))
    assert "another study" in ensemble(tmp_path).stderr
