# SPDX-License-Identifier: MIT
"""bergtow converge: verdicts of known effects, and small cases whose width, ramp and step matter or do not."""
import errno
import json
import os
import re
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import made_up_ensemble as made_up
from harness import BERGTOW, TOW, changed, environment, run, script, write_case

from bergtow import cli
from bergtow.errors import RunError
from bergtow.result.run import Run
from bergtow.study import converge
from bergtow.study import runs as case_runs
from bergtow.table import written
from bergtow.text import converge as converge_text


@pytest.mark.parametrize("n", [4, 8, 32])
@pytest.mark.parametrize("ratio", [0.3, 1.0, 1.5])
def test_intervals_of_an_effect_hold_it(n, ratio):
    """Pairs with a common part, at the level of a single look."""
    rng, inside = np.random.default_rng(n), 0
    for _ in range(600):
        common = 1 + 0.2 * rng.standard_normal(n)
        base, other = common + 0.1 * rng.standard_normal(n), ratio * (common + 0.1 * rng.standard_normal(n))
        value, (low, high) = converge.effect(base, other, looks=1)
        assert low <= value <= high
        inside += low <= ratio - 1 <= high
    assert 0.92 <= inside / 600 <= 0.98


def test_looking_again_and_again_keeps_the_level():
    """Of cases without an effect at most 5 % are said to have one, whenever the looking ends."""
    rng, found = np.random.default_rng(5), 0
    for _ in range(500):
        x, y = (1 + 0.3 * rng.standard_normal((2, converge.FIELDS[-1])))
        for n in converge.FIELDS:
            verdict = converge.judged(converge.effect(x[:n], y[:n])[1], 1e-9)
            assert verdict != "none"
            if verdict == "matters":
                found += 1
                break
    assert found <= 0.05 * 500 + 2 * np.sqrt(500 * 0.05 * 0.95)


def test_verdicts():
    assert [converge.judged(ends, 0.1) for ends in ((-0.05, 0.09), (0.11, 0.3), (-0.4, -0.11), (-0.2, 0.0),
                                                    (0.05, 0.2))] == ["none", "matters", "matters", "open", "open"]
    assert [converge.judged(ends, 0.1, one_sided=True) for ends in ((-0.9, 0.1), (0.2, 9), (-0.5, 3))
            ] == ["none", "matters", "open"]
    assert converge.names_of("width, dt") == ["width", "dt"]


def test_windows_that_are_not_steady_are_counted():
    said = written(converge_text.doubtful({"verdicts": {"steady": 5, "too short": 2, "not steady": 1}}))
    assert said.startswith("WARNING: of the 8 tows of the case as it is, 1 not steady and 2 too short: ")
    assert converge_text.doubtful({"verdicts": {"steady": 5}}) == converge_text.doubtful({}) == []


def test_a_tow_that_ends_in_the_window_has_no_mean_to_compare():
    """What comes after the line parted is no resistance to a tow."""
    def run(adrift):
        return SimpleNamespace(window=(10.0, 40.0), adrift=adrift, at_least=None, number=lambda key: 7.0)
    assert converge.mean_resistance(run(np.inf)) == 7.0 and np.isnan(converge.mean_resistance(run(39.0)))
    row, = converge.fields_row(SimpleNamespace(kept=lambda *a: True, measured=lambda *a: np.array([7.0, np.nan])))
    assert converge_text.cells(row)[-1] == "a run has no mean ice resistance"


@pytest.mark.parametrize("missed", [{}, {"case": 2}, {"tolerance-1": 2}])
def test_steps_that_either_value_does_not_solve_leave_the_comparison_open(missed):
    """Of 100 steps of each run; also where only the tighter tolerance is out of reach."""
    def measured(name, fields, measure):
        return np.array([measure(SimpleNamespace(
            window=(10.0, 40.0), adrift=np.inf, at_least=None,
            number=lambda key, i=i: {"n_steps": 100, "unconverged_steps": missed.get(name, 0)}.get(key, 50.0 + i)))
            for i in fields])
    kind = next(k for k in converge.KINDS if k.name == "tolerance")
    row = converge.compare(SimpleNamespace(there=lambda *a: True, measured=measured), kind, "case", {}, "tolerance-1",
                           {}, 0.1)
    assert row["judged"] == ("open" if missed else "none") and row["fields"] == 4
    assert row.get("why", "").startswith("2 % of the steps ended at solver.max_sweeps") == bool(missed)


def test_a_window_without_resistance_has_nothing_to_compare(monkeypatch):
    """Red when it is 0 / 0: field after field is made until the budget is spent."""
    class Empty:
        window, adrift, steps_per_sample, at_least = (10.0, 40.0), np.inf, 1, None
        def __init__(self, path): pass
        def __enter__(self): return self
        def __exit__(self, *error): pass
        def __getitem__(self, name): return np.arange(100.0) if name == "time" else np.zeros(100)
        def value(self, key): return 1.0
    monkeypatch.setattr(converge, "Run", Empty)
    asked = []
    study = SimpleNamespace(there=lambda name, n, values: asked.append(n) or True, path=lambda name, i: None)
    row, = converge.window(study, 0.1)
    assert row["judged"] == "open" and row["why"].startswith("nothing to hold") and asked == [4]


def test_a_window_whose_runs_fail_leaves_the_other_rows(monkeypatch):
    def failed(name, n, values):
        if n > 4:
            raise RunError(Path("out/case/f021"), "a run of case failed: no sound state", "mend the case", 5)
        return True
    study = SimpleNamespace(there=failed, folder=Path("out"), end=np.inf, made=0)
    monkeypatch.setattr(converge, "varied", lambda *a: {"dt": [{"name": "dt", "judged": "none", "fields": 4}]})
    monkeypatch.setattr(converge, "window", lambda study, margin: study.there("case", 8, {}))
    rows = converge.converge(study, ["dt", "window"], 0.1)
    assert [(row["name"], row["judged"]) for row in rows] == [("dt", "none"), ("window", "open")]
    assert "no sound state" in rows[1]["why"]


CASE = changed(TOW, run__duration=40, output__window_start=15, domain__length=20, ice__concentration=0.5)


def converged(folder, case, *more):
    write_case(folder, case)
    result = script("converge", "case.yml", "-o", "out", *more, cwd=folder)
    assert result.returncode == 0, result.stderr
    return json.loads((folder / "out/converge.json").read_text()), result.stdout


LINE = changed(CASE, tow__mode="line", tow__line_length=2, tow__line_stiffness=5e4, tow__line_damping=2000,
               ice__concentration=0.2, run__duration=60, output__window_start=30)


def test_a_start_that_jerks_the_line_is_found(tmp_path):
    """A line that is pulled at once pulls as hard as speed times the root of stiffness and mass, and a start over half
    a minute with m V / t alone."""
    found, text = converged(tmp_path, changed(LINE, tow__ramp=0.1), "--vary", "start", "--budget", 3, "--tries", 1)
    row = found["rows"][0]
    assert row["judged"] == "matters" and row["effect"] > 1 and row["recommended"] == pytest.approx(0.4)
    assert "resolved: it matters" in text and "take 0.4 s, or longer" in text
    slow, text = converged(tmp_path, changed(LINE, tow__ramp=25), "--vary", "start", "--budget", 3, "--margin", 2)
    assert [row["judged"] for row in slow["rows"]] == ["none"] and "25 s will do" in text


def test_a_start_without_a_ramp_is_held_against_one_of_the_own_size(tmp_path):
    found, text = converged(tmp_path, changed(LINE, tow__ramp=0), "--vary", "start", "--budget", 3, "--tries", 1)
    row = found["rows"][0]
    assert row["judged"] == "matters" and row["recommended"] == pytest.approx(2 / 0.13, rel=0.2)


def test_a_programme_has_a_start_of_its_own(tmp_path):
    """Red: the ramp was varied, the program refused it beside a programme, and the call ended as one that failed."""
    case = changed(LINE, tow__speed=None, tow__ramp=None, tow__programme=[[0, 0], [20, 0.13]])
    found, text = converged(tmp_path, case, "--vary", "start", "--budget", 3)
    assert [row["judged"] for row in found["rows"]] == ["open"] and "that of tow.programme" in text


@pytest.mark.slow
def test_a_ramp_ends_before_the_window(tmp_path):
    """Four times 10 s would end behind the beginning of the window at 30 s; and from 24 s on nothing is left to try."""
    found, text = converged(tmp_path, changed(LINE, tow__ramp=10), "--vary", "start", "--budget", 3, "--margin", 1e-3)
    rows = found["rows"]
    assert [(row["from"], row["to"], row["recommended"]) for row in rows] == [(10, 24, 24), (24, 24, None)]
    assert [row["judged"] for row in rows] == ["matters"] * 2 and converge.WINDOW_TOO_EARLY in text


@pytest.mark.slow
def test_a_channel_that_is_too_narrow_is_found(tmp_path):
    """Dense ice that is pushed along between walls two body widths apart is another thing than a field."""
    dense = changed(CASE, ice__concentration=0.7, domain__width=4, run__duration=18, output__window_start=6)
    found, text = converged(tmp_path, dense, "--vary", "width", "--budget", 3, "--tries", 1)
    row = found["rows"][0]
    assert row["judged"] == "matters" and row["effect"] < -0.3 and row["fields"] <= 16 and row["same_ice"]
    assert 0 < row["pairing"] < 2 and ", the same ice, error x " in text
    study = (tmp_path / "out/converge/width-0-cut.yml").read_text()
    assert "\n  ice.extent.y_min: '-4'\n  ice.extent.y_max: '4'\n" in study
    assert "the walls are felt; without them, take 8 m or wider" in text


def test_a_tolerance_that_does_not_matter_and_the_fields_that_the_mean_needs(tmp_path):
    loose = changed(CASE, ice__concentration=0.2, run__duration=20, output__window_start=5)
    found, text = converged(tmp_path, loose, "--vary", "tolerance,fields", "--budget", 3)
    first, second = found["rows"]
    steady, tows = found["verdicts"].get("steady", 0), sum(found["verdicts"].values())
    assert tows >= 4 and (f"WARNING: of the {tows} tows of the case as it is" in text) == (steady < tows)
    assert first["judged"] == "none" and first["same_ice"] and "0.001 will do" in text
    # a tenth of the fields could feel an effect, and 4 fields without one still be the usual finding
    assert first["share_without"] == pytest.approx(0.05 ** (1 / first["fields"])) and "share_without" not in second
    assert f"no effect that matters in at least {100 * first['share_without']:.0f} % of fields" in text
    assert found["values"]["ice.concentration"] == "0.2"  # of which case it speaks, for other studies
    assert second["name"] == "fields" and second["recommended"] > 4 and f"{second['recommended']:g} fields" in text


def test_runs_that_do_not_reach_their_tolerance_tell_nothing_of_it(tmp_path):
    """Red: both values end at the limit of work, make nearly the same, and "will do"."""
    dense = changed(CASE, ice__concentration=0.7, run__duration=10, output__window_start=4, solver={
        "tolerance": 1e-6, "max_sweeps": 1})
    found, text = converged(tmp_path, dense, "--vary", "tolerance", "--budget", 3, "--margin", 0.5)
    row, = found["rows"]
    assert row["judged"] == "open" and "% of the steps ended at solver.max_sweeps" in row["why"]
    assert row["recommended"] is None and "will do" not in text


@pytest.mark.slow
def test_runs_are_kept_and_a_spent_budget_is_reported(tmp_path):
    found, _ = converged(tmp_path, CASE, "--vary", "dt", "--budget", 0.2, "--margin", 1e-6)
    made = {p: p.stat().st_mtime_ns for p in tmp_path.glob("out/converge/*/members/*/summary.json")}
    assert found["rows"][0]["judged"] == "open" and found["rows"][0]["why"] in (
        "the budget is spent", f"{converge.FIELDS[-1]} fields scatter too much") and len(made) >= 5
    kept = [p for p in made if (p.parent / "finished").exists()]
    converged(tmp_path, CASE, "--vary", "dt", "--budget", 0.02, "--margin", 1e-6)
    assert len(kept) >= 4 and all(p.stat().st_mtime_ns == made[p] for p in kept)


def test_what_is_refused(tmp_path):
    write_case(tmp_path, CASE)
    def said(*arguments):
        return script("converge", *arguments, cwd=tmp_path)
    assert said("none.yml").returncode == 4 and "no such file" in said("none.yml").stderr
    assert said("case.yml", "--vary", "colour").returncode == 2 and said("case.yml", "--budget", "0").returncode == 2
    bad = said("case.yml", "--set", "ice.sise=1")
    lost = subprocess.run([BERGTOW, "converge", "case.yml"], env=environment(BERGTOW_HOME=tmp_path), cwd=tmp_path,
                          capture_output=True, text=True)
    assert lost.returncode == 4 and "name the folder that holds postproc/ in BERGTOW_HOME" in lost.stderr
    assert bad.returncode == 3 and "unknown key" in bad.stderr and "Traceback" not in bad.stderr
    short = said("case.yml", "--budget", 1e-4, "-o", "short")
    assert short.returncode == 6 and "raise --budget" in short.stderr
    assert not (tmp_path / "out").exists()
    device = said("/dev/null", "-o", "out")
    assert device.returncode == 4 and "is a device" in device.stderr and "no such file" not in device.stderr


def test_its_block_stands_in_the_report_of_an_ensemble(tmp_path):
    folder = made_up.write(tmp_path / "all", [made_up.member(np.arange(40.0) + k, {}, 0) for k in range(3)])
    row = {"name": "width", "key": "domain.width", "unit": "m", "from": 10.0, "to": 20.0, "finer": "wider",
           "quantity": "mean ice resistance", "effect": -0.4, "interval_95": [-0.5, -0.3], "fields": 8,
           "judged": "matters", "recommended": 20.0, "same_ice": False}
    found = {"rows": [row], "looks": 5, "margin": 0.1, "spent_min": 2.0, "budget_min": 10}
    (folder / "converge.json").write_text(json.dumps(found))
    text = script("statistics", folder, "--resamples", 1).stdout
    assert "\nConvergence\n" in text and "10 m -> 20 m" in text and "-40 % (-50 % to -30 %)" in text
    assert "take 20 m, or wider" in text and written(converge_text.content(found)) in text


def test_what_one_quantity_leaves_of_the_budget_goes_to_those_that_are_open(monkeypatch):
    """The first is cheap. The second asks for half of the time, more than its equal share of it was."""
    class Study:
        made, end = 0, 0.0

    asked = []

    def vary(study, kind, margin, most):
        asked.append((kind.name, study.end - time.monotonic()))
        study.made += kind.name == "dt" and len(asked) < 8
        enough = kind.name != "dt" or study.end - time.monotonic() > 50
        return [{"name": kind.name, "judged": "none"} if enough else {"name": kind.name, "code": converge.SPENT.code}]

    monkeypatch.setattr(converge, "vary", vary)
    kinds = [k for k in converge.KINDS if k.name in ("start", "dt", "tolerance")]
    found = converge.varied(Study(), kinds, 0.1, 3, time.monotonic() + 90)
    assert [name for name, _ in asked] == ["start", "dt", "tolerance", "dt"]
    assert [rows[0].get("code") for rows in found.values()] == [None] * 3
    assert [round(left) for _, left in asked] == [30, 45, 90, 90]
    never, asked[:] = converge.varied(Study(), kinds, 0.1, 3, time.monotonic() + 30), []
    assert never["dt"][0]["code"] == "budget"


SHORT = changed(CASE, run__duration=2, output__window_start=1)


def runs_of(folder, case, given=()):
    path = write_case(folder, case)
    return case_runs.CaseRuns(path, folder / "out", "converge", Path(BERGTOW), list(given), 1, np.inf, np.inf)


@pytest.mark.parametrize("where", ["case", "base", "set", "value"])
def test_a_file_that_the_case_names_is_a_part_of_it(tmp_path, where):
    """A run of another table is another run, whoever names the table."""
    (tmp_path / "current.csv").write_text("t,u,v\n0,0,0\n9,0,0\n")
    named = changed(SHORT, water__current_table="current.csv")
    case = named if where == "case" else {"base": "base.yml", "run": {"title": "a"}} if where == "base" else SHORT
    write_case(tmp_path, named, "base.yml")
    given = ["water.current_table=current.csv"] if where == "set" else []
    values = {"water.current_table": "current.csv"} if where == "value" else {}
    def made():
        runs = runs_of(tmp_path, case, given)
        assert runs.make("case", [0], values) == [None] and runs.kept("case", 0)
        return runs.made
    assert [made(), made()] == [1, 0]
    (tmp_path / "current.csv").write_text("t,u,v\n0,0.01,0\n9,0,0\n")
    assert [made(), made()] == [1, 0]


@pytest.mark.parametrize("change", ["values", "given", "case", "version"])
def test_runs_of_other_values_or_another_program_are_made_anew(tmp_path, change, capsys):
    first = runs_of(tmp_path, SHORT)
    assert first.make("case", [0, 1], {"ice.friction": 0.1}) == [None, None] and first.made == 2
    runs = runs_of(tmp_path, changed(SHORT, ice__thickness=0.05) if change == "case" else SHORT,
                   ["body.draft=0.4"] if change == "given" else [])
    if change == "version":
        study = tmp_path / "out/converge/case.yml"
        study.write_text(study.read_text().replace("# bergtow", "# bergtow 0", 1))
    assert runs.make("case", [0], {"ice.friction": 0.3 if change == "values" else 0.1}) == [None] and runs.made == 1
    told = capsys.readouterr().err
    assert "renamed to case.old" in told and all(words in told for words in {
        "version": ("bergtow 0 0.1.0", runs.version), "case": ("ice: `thickness: ", "`thickness: 0.05 m` now"),
        "given": ("body: `draft: ", "`draft: 0.4 m` now"), "values": ("`friction: 0.1` there, `friction: 0.3` now",)}[
            change])
    assert not runs.kept("case", 1)


def test_a_full_disk_and_a_cut_study_leave_finished_runs(tmp_path, monkeypatch):
    """Red: the file is empty after the full disk, which is then the name of another program."""
    runs_of(tmp_path, SHORT).make("case", [0], {})
    file = tmp_path / "out/converge/case.yml"
    text, runs = file.read_text(), runs_of(tmp_path, SHORT)

    def full(path, *_, **__):
        path.open("w").close()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as m:
        m.setattr(Path, "write_text", full)
        runs.write("case", 1, {})
        with pytest.raises(RunError) as refused:
            runs.write("case", 2, {})
    assert refused.value.path == file and refused.value.remedy and refused.value.status == 4
    assert file.read_text() == text and not list(file.parent.glob(".*.new*"))
    for left in ("", text[:12]):
        file.write_text(left)
        runs = runs_of(tmp_path, SHORT)
        assert runs.make("case", [0], {}) == [None] and runs.made == 0 and file.read_text() == text
    assert not list(file.parent.glob("*.old*"))


def test_finished_runs_and_the_files_of_others_are_set_aside(tmp_path):
    """Red: they are removed, those of another version without a word."""
    runs_of(tmp_path, SHORT).make("case", [0, 1], {})
    home = tmp_path / "out/converge/case"
    (home / "members/c001-r001/notes.txt").write_text("of the user")
    before = {p.relative_to(home): p.read_bytes() for p in home.rglob("*") if p.is_file()}
    (tmp_path / "out/converge/case.old").mkdir()
    runs_of(tmp_path, SHORT).make("case", [0], {"ice.friction": 0.1})
    old = tmp_path / "out/converge/case.old2"
    assert before == {p.relative_to(old): p.read_bytes() for p in old.rglob("*") if p.is_file()}
    assert (home / "members/c001-r001/finished").exists()


def test_a_value_of_the_call_wins_over_one_of_the_user(tmp_path):
    """And what YAML takes for nothing or for a number is the text that the program reads."""
    runs = runs_of(tmp_path, changed(SHORT, run__title="a"),
                   ["tow.ramp = 0.5 s", "run.title=none", "ice.shape=rectangles"])
    assert runs.make("case", [0], {"tow.ramp": 0.25}) == [None]
    with Run(runs.path("case", 0)) as there:
        assert there.value("tow.ramp") == 0.25 and there.case["ice.shape"] == "rectangles"
        assert there.case["run.title"] == "none" and there.case["ice.seed"] == "1000"


def cut(path):
    path.write_bytes(path.read_bytes()[:-20])


def test_a_changed_run_is_made_again(tmp_path):
    """Red at an effect of -0.016 in place of 0.00013, exit code 0; and at a traceback where the summary was cut."""
    write_case(tmp_path, changed(CASE, run__duration=5, output__window_start=2))
    call = ["converge", "case.yml", "-o", "out", "--vary", "tolerance", "--jobs", "2"]
    assert script(*call, cwd=tmp_path).returncode == 0
    sound = json.loads((tmp_path / "out/converge.json").read_text())["rows"]
    one, other = (tmp_path / f"out/converge/{name}/summary.json" for name in
                  ("case/members/c001-r001", "tolerance-1/members/c001-r002"))
    one.write_text(re.sub(r'("mean_ice_resistance_n": )\S+', r"\g<1>1e6,", one.read_text()))
    cut(other)
    again = script(*call, "--force", cwd=tmp_path)
    assert again.returncode == 0
    for name in ("case: member c001-r001", "tolerance-1: member c001-r002"):
        assert f"bergtow converge: warning: out/converge/{name} is not sound and is run again: " in again.stderr
    assert json.loads((tmp_path / "out/converge.json").read_text())["rows"] == sound


def test_a_run_that_is_changed_meanwhile_is_not_kept(tmp_path):
    """Of fields that an earlier call has made, and that this one did not ask for."""
    assert runs_of(tmp_path, SHORT).make("case", [0, 1], {}) == [None, None]
    runs = runs_of(tmp_path, SHORT)
    runs.make("case", [0], {})
    cut(runs.path("case", 1) / "summary.json")
    assert runs.kept("case", 0) and not runs.kept("case", 1) and not runs.kept("case", 2)


def test_runs_are_kept_however_the_folder_is_spelt(tmp_path, monkeypatch):
    runs = runs_of(tmp_path, SHORT)
    runs.make("case", [0], {})
    monkeypatch.chdir(tmp_path)
    link = tmp_path / "bergtow"
    link.symlink_to(BERGTOW)
    again = case_runs.CaseRuns(runs.case, Path("out"), "converge", link, [], 1, np.inf, np.inf)
    assert again.make("case", [0, 1], {}) == [None, None] and again.made == 1


def test_a_run_that_met_the_budget_goes_on(tmp_path):
    """Red when it is made anew: one that is longer than the budget would never end."""
    long = changed(CASE, run__dt=0.02, run__duration=150, domain__length=60)
    runs = runs_of(tmp_path, long)
    runs.last = time.monotonic()  # a second, the shortest limit
    assert runs.make("case", [0], {}) == [case_runs.SPENT] and not runs.kept("case", 0)
    stopped = json.loads((runs.path("case", 0) / "summary.json").read_text())
    assert stopped["stopped"] and 0 < stopped["n_steps"] < 7500 and (runs.path("case", 0) / "checkpoint.h5").exists()
    begun = (runs.path("case", 0) / "case.resolved.yml").stat().st_mtime_ns
    assert runs_of(tmp_path, long).make("case", [0], {}) == [None]
    there = json.loads((runs.path("case", 0) / "summary.json").read_text())
    assert there["n_steps"] == 7500 and (runs.path("case", 0) / "case.resolved.yml").stat().st_mtime_ns == begun


def test_one_call_at_a_time_works_in_a_folder(tmp_path):
    """Red when the second removes the runs of the first; and the lock is that of the runs, too, which a call that is
    killed leaves behind."""
    write_case(tmp_path, CASE)
    with case_runs.locked(tmp_path / "out/converge") as lock:
        left = subprocess.Popen(["sleep", "60"], pass_fds=[lock])
    try:
        second = script("converge", "case.yml", "-o", "out", cwd=tmp_path)
        assert second.returncode == 4, second.stderr
        assert re.search(r"out/converge: another run is using this folder \(process \d+ on ", second.stderr)
        assert [p.name for p in tmp_path.glob("out/*/*")] == ["lock"] and not (tmp_path / "out/converge.json").exists()
    finally:
        left.kill()
        left.wait()
    with case_runs.locked(tmp_path / "out/converge"):
        pass


def test_a_run_that_failed_is_told_by_the_exit_code(tmp_path, monkeypatch):
    of = case_runs.state_of
    monkeypatch.setattr(case_runs, "state_of", lambda path: of(path) if "dt-1" not in str(path) else (
        case_runs.FAILED, 5, case_runs.Message("step 3: no sound state; see theory")))
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    path = write_case(tmp_path, changed(CASE, run__duration=5, output__window_start=2))
    with pytest.raises(RunError, match=r"dt-1/members/c001-r001: this run failed, and 3 more: step 3: no sound state"
                       ) as failed:
        cli.perform("converge", path, "-o", tmp_path / "out", "--vary", "dt", "--jobs", "1")
    assert failed.value.status == 5
    row, = json.loads((tmp_path / "out/converge.json").read_text())["rows"]
    assert row["judged"] == "open" and "no sound state" in row["why"]


def test_an_engine_that_a_signal_kills_is_no_spent_budget(tmp_path):
    """Such as for want of memory, and after it has written ensemble.h5 anew."""
    engine = tmp_path / "engine"
    engine.write_text('#!/bin/sh\nmkdir -p "$4"; date +%N > "$4/ensemble.h5"; kill -9 $$\n')
    engine.chmod(0o755)
    with pytest.raises(RunError, match=r"signal 9 \(Killed\) has ended bergtow ensemble; call again") as killed:
        case_runs.run_members(engine, tmp_path / "study.yml", tmp_path / "out", [], 1, 60.0)
    assert killed.value.status == 6 and (tmp_path / "out/ensemble.h5").exists()


def test_runs_that_no_seed_changes_are_one(tmp_path):
    path = write_case(tmp_path, changed(CASE, ice__concentration=0, run__duration=5, output__window_start=2))
    study = case_runs.CaseRuns(path, tmp_path / "out", "converge", Path(BERGTOW), [], 1, np.inf, np.inf)
    row = converge.compare(study, next(k for k in converge.KINDS if k.name == "dt"), "case", {}, "dt-1",
                           {"run.dt": 0.25}, 0.05)
    assert row["fields"] == 1 and row["judged"] == "open" and "one run" in row["why"]
    assert study.made == 2


def test_a_run_that_fails_is_tried_once_in_a_call(tmp_path):
    """With its code, by which other commands know why; the others are made."""
    failing = changed(SHORT, air__wind_x=15, guard__energy=1e-3)
    runs = runs_of(tmp_path, failing)
    why = runs.make("case", [0], {})[0]
    assert "guard.energy" in why.text and runs.failed[runs.path("case", 0)] == (why, 5)
    starts = lambda: (runs.home("case") / "journal.jsonl").read_text().count('"start"')
    assert len(runs.make("case", [0, 1], {})) == 2 and starts() == 2 and len(runs.failed) == 2
    again = runs_of(tmp_path, failing)
    assert again.make("case", [0], {}) == [why] and starts() == 3
    with pytest.raises(RunError, match="a run of case failed.*mend the case") as failed:
        again.there("case", 1, {})
    assert failed.value.status == 5 and starts() == 3


def test_values_that_the_program_refuses_are_runs_that_failed(tmp_path):
    """The others are made; and what an earlier call has left in the folder is none of theirs."""
    runs = runs_of(tmp_path, SHORT)
    assert runs.make("dt-1", [0], {}) == [None]
    runs = runs_of(tmp_path, SHORT)
    why = runs.make("dt-1", [0, 1], {"domain.width": -1})
    assert why[0] == why[1] and "domain.width" in why[0].text and not runs.kept("dt-1", 0) and runs.made == 0
    assert set(runs.failed.values()) == {(why[0], 3)} and runs.make("case", [0], {}) == [None]


def test_fields_are_those_that_are_there(tmp_path, monkeypatch):
    """A run in between may have met the budget: its folder is no field."""
    runs, asked = runs_of(tmp_path, CASE), []
    monkeypatch.setattr(runs, "kept", lambda name, i: i in (0, 1, 3, 4))
    monkeypatch.setattr(runs, "measured", lambda name, fields, measure: asked.extend(fields) or np.arange(4.0))
    assert converge.fields_row(runs)[0]["fields"] == 4 and asked == [0, 1, 3, 4]


def test_fields_that_are_the_same_run_are_refused(tmp_path):
    """Without floes there is no scatter, and one run is all fields."""
    runs = runs_of(tmp_path, changed(SHORT, ice__concentration=0))
    assert runs.make("case", [0, 1], {}) == [None, None] and runs.made == 1
    assert [runs.kept("case", i) for i in range(3)] == [True, True, False]
    assert len(runs.measured("case", range(2), lambda run: run.number("n_floes"))) == 1
    given = runs_of(tmp_path, changed(SHORT, ice__concentration=0, floes=[{"x": 10, "y": 1, "length": 1}]))
    assert given.make("case", [0], {}) == [None]
    with pytest.raises(RunError, match="the ice is read.*no seed changes it"):
        given.make("case", [0, 1], {})


class Towed:
    """The case of a tow of this heading from 240 m in a domain of 300 m."""

    path, case, case_text = "towed", {"domain.ends": "walls"}, ""
    value = {"domain.length": 300.0, "domain.ahead": np.nan, "domain.x0": 0.0, "body.x": 240.0}.get

    def __init__(self, *headings):
        self.headings = np.array([[np.cos(h), np.sin(h)] for h in np.radians(headings)])


def test_the_length_grows_ahead_of_the_body():
    ahead = {"domain.length": 450.0, "domain.x0": 0.0, "body.x": 240.0}
    assert converge.longer(Towed(0, 20), 1) == ahead
    assert converge.longer(Towed(180), 1) == ahead | {"domain.x0": -150.0}
    for headings in ((90,), (0, 90), (0, 180)):
        with pytest.raises(RunError, match="does not run along the domain"):
            converge.longer(Towed(*headings), 1)


def test_an_ice_region_that_reaches_the_ends_of_the_domain_goes_with_them(tmp_path):
    """Red when it stays: the pack is the same with open water beside it, "no effect" of a length that no ice fills and
    a large one of a width."""
    case = changed(CASE, ice__x_min=1, ice__x_max=20, ice__y_min=-3, run__duration=4, output__window_start=2)
    width = case["domain"]["width"]
    run(tmp_path, case, "--set", f"ice.y_max={width / 2}", name="given")
    with Run(tmp_path / "given") as there:
        assert converge.longer(there, 1) == {"domain.length": 30, "domain.x0": 0, "body.x": 3, "ice.x_max": 30}
        assert converge.cut_from(there, converge.longer(there, 1)) == {"ice.extent.x_max": 30}
        assert converge.cut_from(there, converge.wider(there, 1)) == {"ice.extent.y_max": width}
        # of two sides the one that the ice reaches; the other has open water of its own
        assert converge.wider(there, 1) == {"domain.width": 2 * width, "domain.y0": -width, "ice.y_max": width}
    run(tmp_path, changed(CASE, run__duration=4, output__window_start=2), name="own")
    with Run(tmp_path / "own") as there:  # what the case does not give follows the domain by itself
        assert set(converge.wider(there, 1)) == {"domain.width", "domain.y0"}
        assert converge.cut_from(there, converge.wider(there, 1)) == {"ice.extent.y_min": -width,
                                                                      "ice.extent.y_max": width}
    run(tmp_path, changed(CASE, ice__concentration=0, run__duration=4, output__window_start=2), name="open")
    with Run(tmp_path / "open") as there:
        assert converge.cut_from(there, converge.wider(there, 1)) == {}  # no ice is made


def test_the_worth_of_common_fields():
    """Of correlation r the error of a difference is √(1 − r) of that of two samples."""
    rng = np.random.default_rng(1)
    common, own, third = rng.standard_normal((3, 20000))
    base, other = 10 + 0.6 * common + 0.8 * own, 10 + 0.6 * common + 0.8 * third
    assert converge.pairing(base, other) == pytest.approx(0.8, abs=0.01)
    assert converge.pairing(np.ones(4), np.ones(4)) is None
