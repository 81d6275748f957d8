# SPDX-License-Identifier: MIT
"""postproc/ensemble.py, plot_ensemble.py and plot_chains.py: made-up ensembles with known answers, and a small one that
the program runs."""
import csv
import json
import os
import shutil
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import shapely.geometry as shapely
from scipy import stats

import made_up_ensemble as made_up
from harness import DONE, TOW, call, changed, run, script, write_case
from test_postproc import done, pixels

from bergtow import _library, cli
from bergtow.errors import BergtowError, RunError
from bergtow.plot import chains as plot_chains
from bergtow.plot import ensemble as plot_ensemble
from bergtow.plot import sweep as plot_sweep
from bergtow.result import integrity as soundness
from bergtow.result.members import Members
from bergtow.result.run import Run
from bergtow.stats import conditions as ensemble
from bergtow.stats import mean as stat_mean

pytestmark = pytest.mark.usefixtures("look")
FIELDS, LENGTH = 8, 400


def grid(folder, concentrations=(0.2, 0.5), speeds=(0.1, 0.2, 0.4), change=lambda c, r: {}):
    """Fields of known means, F = 1000 A V^2 (1 + field's part), with a correlated series and collisions of exponential
    peaks."""
    rng, members = np.random.default_rng(1), []
    for i, a in enumerate(concentrations):
        for j, v in enumerate(speeds):
            for r in range(FIELDS):
                mean = 1000 * a * v * v * (1 + 0.1 * (r - 3.5))
                x = np.abs(made_up.ar1(0.5, LENGTH, rng, mean, 0.1 * mean))
                x *= mean / x.mean()
                n = rng.poisson(100)
                members.append(made_up.member(x, {"ice.concentration": a, "tow.speed": v}, i * len(speeds) + j,
                                              peaks=(np.sort(rng.uniform(0, LENGTH, n)), rng.exponential(50 * v, n)),
                                              **change(i * len(speeds) + j, r)))
    return made_up.write(folder, members)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A grid with doubts: in condition 0 one field jammed, two did not converge; in condition 1 one failed and one
    waits."""
    def change(c, r):
        if c == 0:
            return {"summary": {"stalled_windows": 2}, "warnings": [made_up.note("stalled")]
                    } if r == 7 else {"summary": {"unconverged_steps": 5}, "warnings": [made_up.note("unconverged")]
                                      } if r < 2 else {}
        if c == 1:
            return {"status": made_up.FAILED, "reason": "base.yml: too short"
                    } if r == 0 else {"status": made_up.WAITING} if r == 1 else {}
        return {"window": {"verdict": "too short"}, "warnings": [made_up.note("too_short"), made_up.note("floes_left")]
                } if (c, r) == (2, 0) else {}
    folder = grid(tmp_path_factory.mktemp("plain") / "all", change=change)
    result = script("statistics", folder, "--resamples", 5, "--hours", 1, 10, "--partial")
    assert result.returncode == 0, result.stderr
    return folder, result, json.loads((folder / "statistics.json").read_text())


@pytest.mark.slow
def test_a_drift_that_no_single_run_can_see_shows_between_the_fields(tmp_path):
    """Each member's own change is within its noise; over eight fields it is not."""
    def change(c, r):
        drift = {0: 20.0, 1: 0.0}.get(c, 0.5)  # of means of 100 N times the number of the condition
        window = {"verdict": "not steady" if (c, r) == (1, 3) else "too short" if (c, r) == (1, 4) else "steady",
                  "series": {"ice_resistance": {"change_n": drift + 10 * (r - 3.5)}}}
        code = window["verdict"].replace(" ", "_")
        return {"window": window, "warnings": [made_up.note(code)] if code != "steady" else []}
    result = script("statistics", grid(tmp_path / "all", change=change), "--resamples", 5)
    assert result.returncode == 0, result.stderr
    s = json.loads((tmp_path / "all/statistics.json").read_text())
    drifts = [c["drift"] for c in s["conditions"]]
    assert drifts[0]["change"] == pytest.approx(20) and drifts[1]["change"] == pytest.approx(0)
    assert drifts[0]["change_95"] == pytest.approx(
        list(stats.t.interval(0.95, 7, 20, stats.sem(10 * (np.arange(8) - 3.5)))))
    assert [d["verdict"] for d in drifts[:2]] == ["steady", "steady"]  # 20 ± 20: not yet
    assert s["conditions"][1]["members"]["doubts"] == dict.fromkeys(s["doubts"], 0) | {"unsteady": 1, "short": 1}
    assert "1 N, 1 S" in result.stdout and "NOT STEADY" not in result.stdout

    def more(c, r):
        found = change(c, r)
        found["window"]["series"]["ice_resistance"]["change_n"] += 20 if c == 0 else 0
        return found
    result = script("statistics", grid(tmp_path / "more", change=more), "--resamples", 5)
    s = json.loads((tmp_path / "more/statistics.json").read_text())
    assert s["conditions"][0]["drift"]["verdict"] == "not steady" and s["conditions"][1]["drift"]["verdict"] == "steady"
    assert "NOT STEADY over all fields" in result.stdout and "rises by 40.0 N" in result.stdout


def test_each_field_counts_by_its_time():
    """Seven fields with slow correlation and one that met no ice. Red when each is thinned by its own: what is left is
    then nearly all of the field without ice."""
    rng, n = np.random.default_rng(1), 4000
    fields = [np.zeros(n)]
    for _ in range(7):
        x = np.convolve(rng.normal(size=n + 79), np.ones(80) / 80, "valid")
        fields.append(1000 + 3000 * x)
    members = [{"tau_samples": stat_mean.series_mean(x).tau} for x in fields]
    every, independent, above = ensemble.samples(SimpleNamespace(steady=lambda m: fields[m]), range(8), members)
    pooled = np.concatenate(every)
    assert len(pooled) == 8 * n and np.mean(pooled <= 0) == pytest.approx(1 / 8, abs=0.01)
    assert np.percentile(pooled, 50) > 800
    assert 8 * n / 400 < independent < 8 * n / 20 and 0.7 < len(above) / independent < 0.95


@pytest.mark.parametrize("word", ["--gap=-5", "--gap=nan", "--threshold=nan"])
def test_what_no_peaks_are_counted_by_is_refused(plain, word):
    result = script("statistics", plain[0], word)
    assert result.returncode == 2 and word.partition("=")[0] in result.stderr and not result.stdout


def test_means_and_intervals_of_known_fields(plain):
    _, _, s = plain
    for c in s["conditions"][2:]:
        mean = 1000 * c["values"]["ice.concentration"] * c["values"]["tow.speed"] ** 2
        fields = mean * (1 + 0.1 * (np.arange(8) - 3.5))
        r = c["resistance"]
        assert r["mean"] == pytest.approx(mean) and r["median"] == pytest.approx(
            mean) and r["trimmed_mean"] == pytest.approx(mean)
        assert r["sd_between"] == pytest.approx(np.std(fields, ddof=1)) and r["n"] == 8
        assert r["t_95"] == pytest.approx(list(stats.t.interval(0.95, 7, mean, stats.sem(fields))))
        assert r["bootstrap_95"][0] < mean < r["bootstrap_95"][1]
        assert r["fields_needed"] == stat_mean.fields_needed(mean, np.std(fields, ddof=1),
                                                             0.05) and r["largest_share"] == pytest.approx(1.35 / 8)
        # AR(1) of 0.5: standard deviation 0.1 of a field's mean, tau 1.5 samples
        assert r["se_within"] == pytest.approx(0.1 * mean * np.sqrt(3 / LENGTH), rel=0.3)
        assert FIELDS * LENGTH / 5 < c["samples"]["independent"] < FIELDS * LENGTH / 2  # every third or fourth
        assert c["estimates"]["lichey_hellmer"] == {"label": "Lichey-Hellmer", "on_top": False, "force": 80,
                                                    "valid": True, "compares": True, "ratio": pytest.approx(mean / 80)}
        assert np.isnan(c["estimates"]["open_water_drag"]["ratio"]
                        or np.nan) and not c["estimates"]["marchenko_compaction"]["valid"]
        assert c["estimates"]["open_water_drag"]["ratio"] is None


def test_doubts_failures_and_gaps_are_counted(plain):
    folder, result, s = plain
    first, second, third = (c["members"] for c in s["conditions"][:3])
    assert first["doubts"] == {"unconverged": 2, "unbounded": 0, "jammed": 1, "unsteady": 0, "short": 0, "few": 0,
                               "stopped": 0, "other": 0} and first["doubtful"] == 3 and first["used"] == 8
    assert second["failed"] == 1 and second["waiting"] == 1 and second["used"] == 6 and not s["complete"]
    assert third["doubts"]["short"] == 1 and third["doubts"]["other"] == 1 and third["doubtful"] == 1
    assert s["failed"] == {"c002-r001": "base.yml: too short"}
    assert ("base.yml: too short" in result.stdout and "4 of 46 members carry warnings" in result.stdout
            and "conditions may have different numbers of fields" in result.stdout
            and "6 (1 failed, 1 waiting)" in result.stdout)
    rows = list(csv.DictReader(open(folder / "statistics.csv")))
    assert len(rows) == 6 and rows[0]["doubt_jammed"] == "1" and float(
        rows[0]["mean"]) == s["conditions"][0]["resistance"]["mean"] and rows[1]["failed"] == "1"


@pytest.mark.slow
def test_exclude_names_what_it_drops(plain, tmp_path):
    folder, _, before = plain
    result = script("statistics", folder, "-o", tmp_path, "--resamples", 1, "--exclude", "jammed", "--exclude",
                    "short", "--partial")
    s = json.loads((tmp_path / "statistics.json").read_text())
    assert s["excluded"] == {"c001-r008": ["jammed"], "c003-r001": ["short"]
                             } and "c001-r008 (jammed)" in result.stdout and "7 (1 excluded)" in result.stdout
    assert s["conditions"][0]["resistance"]["mean"] == pytest.approx(before["conditions"][0]["resistance"]["mean"] *
                                                                     np.mean(1 + 0.1 * (np.arange(7) - 3.5)))
    assert before == json.loads((folder / "statistics.json").read_text())  # -o leaves the other alone


def test_peaks_of_the_fields_together(plain):
    _, _, s = plain
    for c in s["conditions"][2:]:
        x, scale = c["extremes"], 50 * c["values"]["tow.speed"]
        assert x["conversion"] == "half-sine of 0.1 s" and x["hours"] == pytest.approx(
            FIELDS * LENGTH / 3600) and x["collisions_per_hour"] == pytest.approx(900, rel=0.15)
        tail = x["over_threshold"]
        assert tail["clusters"] >= 30 and tail["gap_s"] == 2.0
        rate = {e["peak"]: e["per_hour"] for e in x["exceedance"]}
        assert min(rate.values()) == pytest.approx(1 / x["hours"])
        # clusters of 2 s hide few of the peaks above the threshold: once in an hour exponential peaks reach scale
        # ln(900)
        assert tail["levels"][0]["level"] == pytest.approx(
            scale * np.log(900), rel=0.5) and tail["levels"][0]["beyond_data"] and "level_95" in tail["levels"][0]


def unlike(a, b, at=""):
    """Places at which two nested lists of numbers differ."""
    if isinstance(a, (dict, list)):
        keys = a if isinstance(a, dict) else range(len(a))
        if len(a) != len(b):
            yield at, len(a), len(b)
        for k in keys:
            yield from unlike(a[k], b[k], f"{at}/{k}")
    elif a != b:
        yield at, a, b


@pytest.mark.slow
def test_markdown_and_stable_numbers(plain, tmp_path):
    folder, result, s = plain
    again = script("statistics", folder, "-o", tmp_path, "--resamples", 5, "--hours", 1, 10, "--markdown", "--partial")
    assert list(unlike(s, json.loads((tmp_path / "statistics.json").read_text()))) == []
    lines = again.stdout.splitlines()
    tables = [line for line in lines if line.startswith("|")]
    assert "## made up" in lines and "### Mean ice resistance" in lines and tables[0].count("|") == tables[2].count(
        "|") and "NaN" not in again.stdout and "nan" not in again.stdout


def test_which_parameter_matters(plain):
    _, _, s = plain
    ranks, logs = s["sensitivity"]["ranks"], s["sensitivity"]["sobol_of_logarithm"]
    assert ranks["tow.speed"]["prcc"] > ranks["ice.concentration"]["prcc"] > 0.8
    # ln F = ln A + 2 ln V + const: variances of the three and two levels
    a, v = np.var(np.log([0.2, 0.5])), 4 * np.var(np.log([0.1, 0.2, 0.4]))
    assert logs["indices"]["tow.speed"]["first"] == pytest.approx(
        v / (a + v), abs=0.05) and logs["indices"]["ice.concentration"]["total"] == pytest.approx(a / (a + v), abs=0.05)


class Hypercube:
    """Conditions whose means no parameter explains, with fields that scatter little."""

    sampled, n = True, 0

    def __init__(self, n, fields, rng):
        self.used = np.arange(n * fields)
        self.parameters = {k: np.repeat(rng.random(n), fields) for k in ("ice.friction", "ice.thickness")}
        self.means = np.repeat(rng.normal(100, 10, n), fields) + rng.normal(0, 1, n * fields)
        self.rows = np.split(self.used, n)

    def conditions(self):
        return [SimpleNamespace(finished=rows) for rows in self.rows]

    def without_bound(self, rows):
        return None


@pytest.mark.parametrize("n, fields", [(10, 8), (32, 2)])
def test_fields_of_a_condition_are_no_sample_of_its_parameters(n, fields):
    """Of parameters without effect at most 5 % of the intervals exclude 0, and no expansion predicts the conditions."""
    rng, found, tries = np.random.default_rng(7), 0, 150
    for k in range(tries):
        e = Hypercube(n, fields, rng)
        s = ensemble.sensitivity(e, {m: {"mean": e.means[m]} for m in e.used}) if k < 5 else {
            "ranks": ensemble.stat_sensitivity.rank_correlations(*ensemble.sample(e, e.means)[:2])}
        low, high = s["ranks"]["ice.friction"]["prcc_95"]
        found += low > 0 or high < 0
        assert k >= 5 or s["samples"] == n and "refused" in s["sobol"]
    assert found / tries <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / tries)


def test_a_run_that_is_there_twice_counts_once(tmp_path):
    """Ice that is read is the same for each seed."""
    some = [made_up.member(np.full(50, 100.0 + 10 * (r % 2) + c), {"ice.friction": 0.1 * (c + 1)}, c,
                           state="ab"[r % 2] if c == 0 else None) for c in range(2) for r in range(4)]
    result = script("statistics", made_up.write(tmp_path / "all", some), "--resamples", 1)
    assert result.returncode == 0, result.stderr
    s = json.loads((tmp_path / "all/statistics.json").read_text())
    assert [c["resistance"]["n"] for c in s["conditions"]] == [2, 4]
    assert s["copies"] == {"c001-r003": "c001-r001", "c001-r004": "c001-r002"}
    assert "2 members ended in the same state as another one" in result.stdout and "6 of 8 members" in result.stdout


def test_a_member_that_met_little_ice_is_known_without_its_folder(tmp_path):
    """Red when it is told by the words of its verdict: without these it is short, and its small mean can be left out.
    """
    made = [made_up.member(np.ones(50) + k, {}, 0, window={"n_independent": 3.0} | more)
            for k, more in enumerate(({"n_contact_stretches": 2.5}, {"n_contact_stretches": 12.0}, {}))]
    folder = made_up.write(tmp_path / "all", made)
    for there in (True, False):
        assert [Members(folder).doubts(m) for m in range(3)] == [{"few"}, {"short"}, {"short"}], there
        shutil.rmtree(folder / "members", ignore_errors=True)


def test_doubts_are_known_without_the_folders_and_by_codes_alone(tmp_path):
    """Red when verdicts and warnings were in the folders, and another warning was one more than there are doubts: a
    run with little ice has a number for that and need not have a warning, and hid one of overlap."""
    made = [made_up.member(np.ones(50) + k, {}, 0, **more) for k, more in enumerate((
        {"window": {"verdict": "not steady"}, "warnings": [made_up.note("not_steady")]},
        {"window": {"verdict": "too short"}, "warnings": [made_up.note("too_short"), made_up.note("overlap")]},
        {"window": {"verdict": "steady", "n_contact_stretches": 2.0}, "warnings": [made_up.note("overlap")]},
        {"window": {"verdict": "steady"}}))]
    folder = made_up.write(tmp_path / "all", made)
    for _ in range(2):
        e = Members(folder)
        assert [e.doubts(m) for m in range(4)] == [{"unsteady"}, {"short", "other"}, {"few", "other"}, set()]
        assert [w["code"] for w in e.warnings(1)] == ["too_short", "overlap"]
        shutil.rmtree(folder / "members", ignore_errors=True)


def test_a_result_that_matches_its_record_is_not_read_whole_again(tmp_path, monkeypatch):
    e = Members(made_up.write(tmp_path / "all", [made_up.member(np.ones(50), {}, 0)]))
    monkeypatch.delattr(_library.library(), "bt_seal_check")
    with Run(e.folder(0)) as run:
        assert run.result.exists()


def test_members_of_two_builds_are_reported(tmp_path):
    folder = made_up.write(tmp_path / "all", [made_up.member(np.ones(50) + k, {}, 0) for k in range(3)])
    with made_up.edited(folder / "members/c001-r001/result.h5") as f:
        f.attrs["revision"] = "other"
    made_up.record(folder / "members/c001-r001", Members(folder).study)
    result = script("statistics", folder, "--resamples", 1)
    assert "The members come from 2 builds of the program" in result.stdout
    assert "2 builds" in json.loads((folder / "statistics.json").read_text())["builds"]


def test_what_is_refused(tmp_path, plain, capsys):
    result = script("statistics", tmp_path / "none")
    assert result.returncode == 4 and "no such folder" in result.stderr and "Traceback" not in result.stderr
    mixed = made_up.write(tmp_path / "m", [made_up.member(np.arange(30.0), {}, 0, peaks=([1.0], [2.0]),
                                                          conversion=c) for c in ("half-sine of 0.1 s", "crushing")])
    for arguments, words in (((tmp_path, ), "holds no ensemble.h5"),
                             ((mixed, "-o", mixed / "ensemble.h5", "--resamples", "1"), "cannot be written")):
        with pytest.raises(RunError, match=words):
            cli.perform("statistics", *arguments)
    for arguments, words in ((("--error", "0"), "not above zero"), (("--exclude", "unlike"), "invalid choice"),
                             (("--exclude", "few"), "invalid choice"),  # the small means would go
                             (("--blocks", "0"), "below 1")):
        with pytest.raises(BergtowError, match=words) as stop:
            cli.perform("statistics", str(plain[0]), *arguments)
        assert stop.value.status == 2
    (tmp_path / "ensemble.h5").write_bytes(b"no HDF5")
    with pytest.raises(RunError, match="is not this program.s ensemble file"):
        Members(tmp_path)
    waiting = made_up.write(tmp_path / "w", [made_up.member([1.0] * 30, {}, 0, status=made_up.WAITING)])
    for command in ("statistics", "plot-ensemble"):
        with pytest.raises(RunError, match="no member that has finished; run the ensemble further"):
            cli.perform(command, waiting)
    cli.perform("statistics", mixed, "--resamples", "1")
    assert "peaks of different conversions" in capsys.readouterr().out


@pytest.mark.slow
def test_no_part_is_taken_for_the_whole(plain, tmp_path):
    """Members that fail or wait are named, and a script sees it by the exit code."""
    folder, complete, _ = plain
    assert complete.stderr == ""
    result = script("statistics", folder, "-o", tmp_path, "--resamples", 1)
    assert (result.returncode == 4
            and "2 of 48 members enter no statistics: 1 waiting (c002-r002), 1 failed (c002-r001)" in result.stderr
            and "--partial" in result.stderr)
    assert json.loads((tmp_path / "statistics.json").read_text())["waiting"] == ["c002-r002"]
    assert "1 member to come, and left out (c002-r002)" in result.stdout


DAMAGES = {
    "a flipped bit": lambda m: flip(m / "result.h5", 700),
    "a changed digit": lambda m: (m / "summary.json").write_text(
        (m / "summary.json").read_text().replace("100.0", "200.0", 1)),
    "a summary cut short": lambda m: os.truncate(m / "summary.json", 100),
    "an empty result": lambda m: os.truncate(m / "result.h5", 0),
    "no summary": lambda m: (m / "summary.json").unlink(),
    "another member's files": lambda m:
    [shutil.copy(m.parent / "c001-r002" / name, m) for name in ("summary.json", "result.h5")],
    "another member": lambda m:
    [shutil.copy(m.parent / "c001-r002" / name, m) for name in ("summary.json", "result.h5", "finished")],
    "no record": lambda m: (m / "finished").unlink(),
    "a pipe": lambda m: ((m / "result.h5").unlink(), os.mkfifo(m / "result.h5")),
}


def flip(path, at):
    raw = bytearray(path.read_bytes())
    raw[at] ^= 1
    path.write_bytes(raw)


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_member_is_in_no_number(tmp_path, damage):
    folder = made_up.write(
        tmp_path / "a", [made_up.member(np.arange(30.0) + 10 * r, {}, 0, peaks=([2.0 + r], [5.0])) for r in range(3)])
    DAMAGES[damage](folder / "members" / "c001-r001")
    result = script("statistics", folder, "--resamples", 1)
    s = json.loads((folder / "statistics.json").read_text())
    assert (result.returncode == 4 and "1 of 3 members enter no statistics: 1 not sound (c001-r001)" in result.stderr
            and "Traceback" not in result.stderr)
    assert [m["name"] for m in s["members"]] == ["c001-r002", "c001-r003"] and list(s["unsound"]) == ["c001-r001"
                                                                                                      ]
    assert s["behind"] == []  # its record of an end is no news
    assert "1 member not sound, and left out (c001-r001)" in result.stdout and s["conditions"][0]["extremes"][
        "fields"] == 2


def test_the_record_of_a_member_is_that_of_its_study(tmp_path):
    """A member of another study, whatever its files, is none of this one."""
    folder = made_up.write(tmp_path / "a", [made_up.member(np.arange(30.0), {}, 0)])
    member, study = folder / "members/c001-r001", Members(folder).study.encode()
    assert soundness.fault_of_member(member, "c001-r001", study) is None
    assert soundness.fault_of_member(member, "c001-r001", study + b"\n") == "finished: is of another study"


def test_a_damaged_ensemble_file_is_refused(tmp_path):
    folder = made_up.write(tmp_path / "a", [made_up.member(np.arange(30.0), {}, 0) for _ in range(2)])
    assert Members(folder).n == 2
    flip(folder / "ensemble.h5", (folder / "ensemble.h5").stat().st_size - 9)
    with pytest.raises(RunError, match="do not match their digest; run `bergtow ensemble` again"):
        Members(folder)


def test_members_without_a_folder_are_reported(tmp_path, capsys):
    folder = made_up.write(
        tmp_path / "a",
        [made_up.member(np.arange(30.0) + r, {}, 0, summary={"unconverged_steps": 1}) for r in range(3)])
    (folder / "members").rename(folder / "elsewhere")
    cli.perform("statistics", folder)
    out = capsys.readouterr().out
    assert "3 members have no folder here" in out and "3 U" in out and "No peaks" in out


# ---- pictures

def test_the_law_of_the_speed_is_found(plain):
    e = Members(plain[0])
    for words, some in plot_sweep.groups(e, "tow.speed"):
        exponent, low, high = stat_mean.power_of_conditions([c.values["tow.speed"] for c in some], [
            dict(zip(e.seed[c.finished].tolist(), e.mean[c.finished])) for c in some])
        assert exponent == pytest.approx(2, abs=0.1) and low < 2 < high and words.startswith("concentration")
    figure = plot_ensemble.draw_sweep(e, "tow.speed")
    [note] = [t.get_text() for t in figure.axes[0].texts if "exponent" in t.get_text()]
    [drawn] = [line for line in figure.axes[0].lines if line.get_linestyle() == "-" and len(line.get_xdata()) > 1]
    by_hand = np.polyfit(np.log(drawn.get_xdata()), np.log(drawn.get_ydata()), 1)[0]
    assert f" {by_hand:.2g} (" in note
    law = next(line for line in figure.axes[0].lines if line.get_color() == plot_ensemble.style.TOW)
    x, y = law.get_data()
    assert np.polyfit(np.log(x), np.log(y), 1)[0] == pytest.approx(2)


def test_the_sweep_shows_fields_means_and_jams(plain):
    e = Members(plain[0])
    figure = plot_ensemble.draw_sweep(e, "ice.concentration")
    panel = next(a for a in figure.axes if a.get_title(loc="left") == "tow speed 0.1 m/s")
    shown = np.concatenate([line.get_ydata() for line in panel.lines if line.get_marker() in ("o", "x")])
    jams = np.concatenate([line.get_ydata() for line in panel.lines if line.get_marker() == "x"])
    expected = np.concatenate([1000 * a * 0.01 * (1 + 0.1 * (np.arange(8) - 3.5)) for a in (0.2, 0.5)])
    assert sorted(shown) == pytest.approx(sorted(expected)) and list(jams) == pytest.approx([2 * 1.35])
    rings = np.concatenate([line.get_ydata() for line in panel.lines if line.get_markerfacecolor() == "none"])
    assert sorted(rings) == pytest.approx([2 * 0.65, 2 * 0.75])  # those that did not converge
    labels = [t.get_text() for t in figure.legends[0].get_texts()]
    assert "Lichey-Hellmer" in labels and "dilute limit" in labels and "a field where the body stood still" in labels
    assert any(label.startswith("a field in doubt") for label in labels)


def test_estimates_are_those_of_each_condition(tmp_path):
    """At the speed that it made good; a curve of one tow was 1.3 times the table's value where tows are slower."""
    speeds = {0.3: 1.0, 0.6: 0.8, 0.85: 0.4}
    some = [made_up.member(np.full(30, 100.0) + r, {"ice.concentration": a}, c,
                           estimates={n: f * v * v for n, f in made_up.ESTIMATES.items()})
            for c, (a, v) in enumerate(speeds.items()) for r in range(2)]
    axes = plot_ensemble.draw_sweep(Members(made_up.write(tmp_path / "a", some)), "ice.concentration").axes[0]
    factor = 1 if "(N)" in axes.get_ylabel() else 1000
    drawn = {line.get_label(): line.get_data() for line in axes.lines if line.get_marker() == "d"}
    x, force = drawn["Lichey-Hellmer"]
    assert list(x) == list(speeds)
    assert factor * force == pytest.approx([80 * v * v for v in speeds.values()])
    assert np.isnan(drawn["compaction"][1]).all()  # not meant for these
    dotted = next(line for line in axes.lines if line.get_label() == "compaction" and line.get_marker() != "d")
    assert factor * dotted.get_ydata() == pytest.approx([5 * v * v for v in speeds.values()])


def test_fields_beside_a_value_of_zero_are_in_the_picture(tmp_path):
    """Red when the axis begins at the least value: half of its fields stand left of it."""
    some = [made_up.member(np.full(30, 100.0 + w + r), {"tow.direction": w}, c)
            for c, w in enumerate((0.0, 0.5)) for r in range(4)]
    e = Members(made_up.write(tmp_path / "a", some))
    axes = plot_ensemble.draw_sweep(e, "tow.direction").axes[0]
    dots = np.concatenate([line.get_xdata() for line in axes.lines if line.get_marker() == "o"])
    low, high = axes.get_xlim()
    assert len(dots) == 8 and low < dots.min() < 0 and dots.max() < high


def test_negative_values_are_in_the_picture(tmp_path):
    some = [made_up.member(np.full(30, 100.0 + w + r), {"air.wind_x": w}, c)
            for c, w in enumerate((-10.0, 0.0, 10.0)) for r in range(2)]
    low, high = plot_ensemble.draw_sweep(Members(made_up.write(tmp_path / "a", some)), "air.wind_x").axes[0].get_xlim()
    assert low < -10 and high > 10


def test_negative_forces_are_in_the_picture(tmp_path):
    """Red: intervals below the lowest field cut off, and no estimate below zero."""
    some = [made_up.member(np.full(30, -100.0 - 10 * r), {"ice.concentration": a}, c,
                           estimates={n: -f for n, f in made_up.ESTIMATES.items()})
            for c, a in enumerate((0.3, 0.6)) for r in range(3)]
    figure = plot_ensemble.draw_sweep(Members(made_up.write(tmp_path / "a", some)), "ice.concentration")
    axes = figure.axes[0]
    low, high = axes.get_ylim()
    bars = np.array([s[:, 1] for s in axes.containers[0][2][0].get_segments()])
    assert low < bars.min() < -120 and high > 0
    assert "Lichey-Hellmer" in [t.get_text() for t in figure.legends[0].get_texts()]


def test_the_band_on_a_logarithmic_axis_ends_at_the_bars(tmp_path):
    """Red: an interval that includes zero at one value drew the band of its neighbour down below the picture."""
    some = [made_up.member(np.full(30, x), {"ice.concentration": a}, c)
            for c, (a, fields) in enumerate(((0.6, (50.0, 60.0, 70.0)), (0.85, (100.0, 3000.0, 5000.0))))
            for x in fields]
    axes = plot_ensemble.draw_sweep(Members(made_up.write(tmp_path / "a", some)), "ice.concentration").axes[0]
    bars = [s[:, 1] for s in axes.containers[0][2][0].get_segments()]
    band = axes.collections[0].get_paths()[0].vertices
    at = [band[band[:, 0] == x, 1].min() for x in (0.6, 0.85)]
    assert axes.get_yscale() == "log" and bars[1].min() < 0
    assert at == pytest.approx([bars[0].min(), axes.get_ylim()[0]])


def test_the_heading_counts_copies_apart(tmp_path):
    """Red: members that are the same run as another were said to have failed or to wait."""
    some = [made_up.member(np.full(30, 100.0 + a), {"ice.concentration": a}, c, state="water" if a == 0 else None,
                           **({"status": made_up.FAILED} if a and r == 2 else {}))
            for c, a in enumerate((0.0, 0.3)) for r in range(3)]
    figure = plot_ensemble.draw_sweep(Members(made_up.write(tmp_path / "a", some)), "ice.concentration")
    [words] = [t.get_text() for t in figure.texts if "members" in t.get_text()]
    assert [part for part in words.split(", ") if "another" in part] == ["2 the same run as another"]
    assert "1 failed" in words


@pytest.mark.slow
def test_every_picture_of_a_grid(plain, tmp_path):
    names = ("above-tow-force", "sweep-ice-concentration", "sweep-tow-speed", "map", "sensitivity", "exceedance")
    result = script("plot-ensemble", plain[0], "-o", tmp_path)
    done(result, *(tmp_path / f"{name}.png" for name in names))
    assert len({pixels(tmp_path / f"{name}.png").tobytes() for name in names}) == 6


def test_a_latin_hypercube_is_drawn_by_member(tmp_path):
    rng = np.random.default_rng(2)
    members = [
        made_up.member(np.full(30, 5 * a + t), {"ice.concentration": a, "ice.thickness": t, "variant": "x"}, i)
        for i, (a, t) in enumerate(rng.random((40, 2)))
    ]
    folder = made_up.write(tmp_path / "a", members, sampling="latin-hypercube")
    e = Members(folder)
    assert e.sampled and plot_ensemble.numeric(e) == ["ice.concentration", "ice.thickness"] and [
        n for n, _ in plot_ensemble.pictures(e, None, [])
    ][-1] == "sensitivity"
    dots = plot_ensemble.draw_scatter(e, "ice.thickness").axes[0].lines[0]
    assert list(dots.get_xdata()) == [m["parameters"]["ice.thickness"] for m in members]


def test_the_bins_of_a_hypercube_are_of_conditions(tmp_path):
    """The fields of a condition share what its values do: counted one by one they made the interval too short."""
    rng = np.random.default_rng(3)
    some = [made_up.member(np.full(30, level + 0.01 * r), {"ice.thickness": float(t)}, c)
            for c, (t, level) in enumerate(zip(rng.random(24), rng.normal(100, 10, 24))) for r in range(6)]
    e = Members(made_up.write(tmp_path / "a", some, sampling="latin-hypercube"))
    bars = plot_ensemble.draw_scatter(e, "ice.thickness").axes[0].containers[0]
    at, centre = bars[0].get_data()
    half = [(s[1, 1] - s[0, 1]) / 2 for s in bars[2][0].get_segments()]
    conditions = sorted((c.values["ice.thickness"], e.mean[c.finished].mean()) for c in e.conditions())
    assert len(at) == 3
    for k, one in enumerate(np.array_split(np.array(conditions), 3)):
        low, high = stat_mean.t_interval(one[:, 1])
        assert (at[k], centre[k], half[k]) == pytest.approx((*one.mean(axis=0), (high - low) / 2))


def test_a_map_says_what_it_is_the_mean_of(tmp_path):
    """A third parameter: every cell is a mean over its conditions, of as many tows as they have, on common fields."""
    some = [made_up.member(np.full(30, 100 * a + 10 * v + t + r), {
        "ice.concentration": a, "tow.speed": v, "ice.thickness": t}, c)
        for c, (a, v, t) in enumerate((a, v, t) for a in (0.2, 0.5) for v in (0.1, 0.2) for t in (1.0, 2.0, 3.0))
        for r in range(4)]
    e = Members(made_up.write(tmp_path / "a", some))
    e.seed[:] = np.arange(len(some)) % 4
    figure = plot_ensemble.draw_map(e, "ice.concentration", "tow.speed")
    assert any("mean of 3 conditions of thickness" in t.get_text() for t in figure.texts)
    shown = [t.get_text() for ax in figure.axes[:2] for t in ax.texts]
    half = stats.t.ppf(0.975, 3) * np.std(range(4), ddof=1) / 2
    means = [100 * a + 10 * v + 2 + 1.5 for v in (0.1, 0.2) for a in (0.2, 0.5)]
    assert shown[:4] == [f"{m:.3g}" for m in means] and shown[4:] == [f"{100 * half / m:.0f} %" for m in means]


def test_pictures_name_every_conversion(tmp_path):
    """The axis has one where conditions have one, and none of them where they differ."""
    peaks = np.linspace(0.5, 29, 40), np.linspace(1, 5, 40)
    def label(second):
        some = [made_up.member(np.ones(30), {"ice.concentration": a}, c, peaks=peaks, conversion=how)
                for c, (a, how) in enumerate([(0.2, "half-sine of 0.1 s"), (0.5, second)]) for _ in range(2)]
        e = Members(made_up.write(tmp_path / second, some))
        tails = [{"refused": "few"}] * 2
        return plot_ensemble.draw_exceedance(e, None, tails).axes[0].get_xlabel()
    assert label("half-sine of 0.1 s") == "peak of a collision (N), half-sine of 0.1 s"
    assert label("crushing") == "peak of a collision (N), each condition by its own impact.conversion"


@pytest.mark.parametrize("tail, noted", [({"refused": "few"}, False), (
    {"threshold": 3.0, "scale": 1.0, "shape": 0.0, "rate_per_hour": 100.0}, True)])
def test_a_tail_is_explained_where_one_is_drawn(tmp_path, tail, noted):
    some = [made_up.member(np.ones(30), {"ice.concentration": 0.2}, 0, peaks=(np.linspace(1, 29, 40),
                                                                            np.linspace(1, 5, 40)))]
    figure = plot_ensemble.draw_exceedance(Members(made_up.write(tmp_path / "a", some)), None, [tail])
    assert any("dashed" in t.get_text() for t in figure.texts) == noted


def test_the_notes_of_a_narrow_picture_are_within_it(tmp_path):
    """Red: two refusals in one line, which left the picture on the right."""
    some = [made_up.member(np.full(30, 100 * a + 10 * v + r), {"ice.concentration": a, "tow.speed": v}, 2 * i + j)
            for i, a in enumerate((0.2, 0.5)) for j, v in enumerate((0.1, 0.2)) for r in range(4)]
    e = Members(made_up.write(tmp_path / "a", some))
    refused = {"refused": "16 values, needs 20 " + 4 * "and then some "}
    ranks = {"ranks": {k: {"prcc": 0.5, "prcc_95": (0.3, 0.7)} for k in e.parameters}}
    figure = plot_ensemble.draw_sensitivity(e, ranks | {"sobol": refused, "sobol_of_logarithm": refused})
    figure.canvas.draw()
    [note] = [t.get_window_extent() for t in figure.texts if "no Sobol" in t.get_text()]
    label = figure.axes[0].xaxis.get_tightbbox()
    assert 0 < note.x0 and max(note.x1, label.x1) < figure.bbox.width and 0 < note.y0 and note.y1 < label.y0


# ---- with the program

def flat_names(path):
    with h5py.File(path) as f:
        names = {}
        f.visititems(lambda name, node: names.update({name: (node.dtype.kind, node.ndim)})
                     if isinstance(node, h5py.Dataset) else None)
    return names


@pytest.mark.slow
def test_a_small_ensemble_of_the_program(tmp_path):
    write_case(tmp_path, changed(TOW, run__duration=60, output__window_start=5, domain__length=20), "base.yml")
    (tmp_path / "study.yml").write_text(json.dumps({"title": "tiny", "base": "base.yml", "repeats": 5, "seed": 4,
                                                    "parameters": {"ice.concentration": [0.2, 0.5]}}))
    assert call("ensemble", "study.yml", "-o", "all", "--threads", 1, cwd=tmp_path).returncode == DONE
    result = script("statistics", tmp_path / "all", "--resamples", 9)
    assert result.returncode == 0, result.stderr
    e, s = Members(tmp_path / "all"), json.loads((tmp_path / "all/statistics.json").read_text())
    assert [c["members"]["used"] for c in s["conditions"]] == [5, 5]
    for m in range(e.n):  # the program and the script estimate the same mean, error and correlation time
        with Run(e.folder(m)) as r:
            found = stat_mean.series_mean(e.steady(m))
            assert found.n == r.number("window.n_samples")
            assert (found.mean, found.se, found.tau * TOW["run"]["dt"]) == pytest.approx(
                (r.number("mean_ice_resistance_n"), r.number("mean_ice_resistance_se_n"),
                 r.number("window.correlation_time_s")),
                rel=1e-9)
            assert found.n_eff * (1 + 1e-9) >= r.number("window.n_independent")  # that knows of pauses
            reported = len(r.warnings)
            assert bool(reported) == bool(e.doubts(m))
            assert len(e.impacts(m)[0]) == r.number("impacts.collisions")
    for c in s["conditions"]:
        assert c["resistance"]["mean"] == pytest.approx(
            np.mean([e.summary["mean_ice_resistance_n"][m] for m in e.conditions()[c["index"]].finished]))
        assert c["extremes"]["collisions"] > 0 and c["estimates"]["dilute_limit"]["force"] > 0
    done(script("plot-ensemble", tmp_path / "all"), tmp_path / "all/returns-floe-force.png",
         tmp_path / "all/sweep-ice-concentration.png", tmp_path / "all/exceedance.png")
    # what the made-up files claim to look like
    ours, theirs = flat_names(
        made_up.write(tmp_path / "made", [made_up.member(np.ones(30), {"ice.concentration": 0.2}, 0)]) /
        "ensemble.h5"), flat_names(tmp_path / "all/ensemble.h5")
    assert {k: v
            for k, v in ours.items()
            if k in theirs} == {k: theirs[k]
                                for k in ours
                                if k in theirs} and set(ours) <= set(theirs), sorted(set(ours) - set(theirs))


def test_force_chains_go_over_the_seam(tmp_path):
    """Images fill a periodic domain: the area of all floes and of the body lies within it, after more than a lap."""
    case = changed(TOW, domain={"length": 15, "width": 8, "ends": "periodic", "sides": "periodic"}, run__duration=25,
                   ice__concentration=0.6, tow={"speed": 0.7, "ramp": 2}, body__draft=0.05)
    run(tmp_path, case, "--dump-contacts", f"220:{tmp_path / 'c.h5'}")
    c = plot_chains.read(tmp_path / "c.h5")
    with Run(tmp_path / "out") as picture:
        x0, x1, y0, y1 = picture.box
        floes, bodies = plot_chains.outlines(picture, c)
        domain = shapely.box(x0, y0, x1, y1)
        for shapes in (floes, bodies):
            images, which = plot_chains.with_images(picture, shapes)
            inside = np.bincount(which, [shapely.Polygon(p).intersection(domain).area for p in images])
            np.testing.assert_allclose(inside, [shapely.Polygon(p).area for p in shapes], rtol=1e-6)
        assert len(plot_chains.with_images(picture, floes)[0]) > len(floes) + 10


def test_force_chains_add_up_to_the_force_on_the_body(tmp_path):
    case = changed(TOW, ice__concentration=0.8, run__duration=20, output__window_start=5)
    r = run(tmp_path, case, "--dump-contacts", f"150:{tmp_path / 'c.h5'}")
    c = plot_chains.read(tmp_path / "c.h5")
    with h5py.File(tmp_path / "c.h5") as f:
        impulse = f["solution/r"][()].reshape(-1, 2)
    assert c.time == pytest.approx(15.0)
    towed = len(r.dataset("floes/offsets")) - 1 + int(np.ravel(r.dataset("bodies/towed"))[0])
    k = int(np.argmin(np.abs(r.series("time") - c.time)))
    tangent = np.column_stack([-c.normal[:, 1], c.normal[:, 0]])
    force = (impulse[:, :1] * c.normal + impulse[:, 1:] * tangent) / 0.1
    fx = fy = moment = 0.0
    for side, sign in ((0, -1), (1, 1)):
        on = c.body[:, side] == towed
        f, lever = sign * force[on], c.lever[on, side]
        fx, fy, moment = fx + f[:, 0].sum(), fy + f[:, 1].sum(), moment + np.sum(lever[:, 0] * f[:, 1] -
                                                                                 lever[:, 1] * f[:, 0])
    scale = np.abs(force[(c.body == towed).any(axis=1)]).sum()
    assert scale > 0 and (fx, fy) == pytest.approx([r.series(n)[k] for n in ("ice_force_x", "ice_force_y")],
                                                   abs=1e-9 * scale)
    assert moment == pytest.approx(r.series("ice_moment")[k], abs=1e-9 * scale)
    # both levers lead to one point, but for the motion within the step
    ends = [c.pose[c.body[:, side], :2] + c.lever[:, side] for side in (0, 1)]
    pressed = c.force > 0
    assert np.abs(ends[0] - ends[1])[pressed].max() < 0.05
    with Run(tmp_path / "out") as picture:
        lines, values = plot_chains.segments(picture, c)
        body, _, total = plot_chains.pairs(c)
        assert total.sum() == pytest.approx(c.force.sum()) and len(values) == np.sum(body < picture.n_floes) and len(
            set(map(tuple, body))) == len(body)
    # two points of one pair, 1 and 3 N, and one without force
    by_hand = plot_chains.Contacts(0.0, np.array([[0, 1], [0, 1], [1, 2]]), np.zeros((3, 2)),
                                   np.array([[[0, 0], [8, 0]], [[4, 0], [0, 8]], [[1, 1], [1, 1]]], dtype=float),
                                   np.array([1.0, 3.0, 0.0]), np.zeros((3, 3)))
    body, lever, total = plot_chains.pairs(by_hand)
    assert body.tolist() == [[0, 1]] and lever.tolist() == [[[3, 0], [2, 6]]] and total.tolist() == [4]
    done(script("plot-chains", tmp_path / "out", tmp_path / "c.h5"), tmp_path / "out/chains.png")
    with pytest.raises(RunError, match="no such file"):
        plot_chains.read(tmp_path / "none.h5")
    with h5py.File(tmp_path / "c.h5", "a") as f:
        del f["places"]
    assert "does not give the places" in script("plot-chains", tmp_path / "out", tmp_path / "c.h5").stderr
