# SPDX-License-Identifier: MIT
"""No number hangs on a sentence: with every text of the program reworded, statistics, exit codes and pictures are the
same but for the words."""
import argparse
import json
import re
import shutil
import sys

import numpy as np
import pytest

import made_up_ensemble as made_up
import script_copy
from harness import BERGTOW, ROOT, TOW, call, changed, environment, write_case

from bergtow.plot import ensemble as plot_ensemble
from bergtow.plot import force as plot_force
from bergtow.reporting import ensemble as report_ensemble
from bergtow.result.members import DOUBTS, Members
from bergtow.result.run import Run
from bergtow.stats import loads
from bergtow.stats import conditions as ensemble
from bergtow.writing import plain as plain_data

pytestmark = pytest.mark.usefixtures("look")
# Bridles that part in dense ice, short windows, and loose ice that a body hardly meets.
CASE = changed(TOW, run__duration=40, output__window_start=8, domain__length=16, domain__width=6, ice__size=0.6,
               body__length=1, tow={"mode": "line", "speed": 0.15, "ramp": 5, "line_length": 2, "line_stiffness": 5000,
                                    "line_damping": 200, "line": {"branches": 2, "breaking_load": 25}})
STUDY = {"base": "base.yml", "title": "words", "repeats": 3, "parameters": {"ice.concentration": [0.05, 0.5, 0.7]}}
OPTIONS = argparse.Namespace(**report_ensemble.OPTIONS | {"resamples": 1, "hours": [0.005, 0.02]})
#: attributes of HDF5 files that are sentences; names, labels and units are not
SENTENCES = ("applies", "description", "long_name", "meaning")


class Words:
    """Other words for each text, always the same; numbers and signs too, for what is told apart by them."""

    def __init__(self):
        self.of = {}

    def other(self, text):
        return self.of.setdefault(text, f"{len(self.of)} % other words: {len(self.of) + 7} s, at {len(self.of)}"
                                  ) if text else text

    def told(self, notes):
        for note in notes:
            note["text"] = self.other(note["text"])

    def in_summary(self, path):
        s = json.loads(path.read_text())
        self.told(s["warnings"])
        self.told((s["window"] or {}).get("reasons", []))
        path.write_text(json.dumps(s | {"stopped": self.other(s["stopped"])}))

    def in_file(self, path, columns=()):
        with made_up.edited(path) as f:
            def reword(_, item):
                for name in set(SENTENCES) & set(item.attrs):
                    if isinstance(item.attrs[name], str):
                        item.attrs[name] = self.other(item.attrs[name])
            f.visititems(reword)
            for name in (name for name in columns if name in f):
                f[name][...] = [self.other(text) for text in f[name].asstr()[()]]

    def translated(self, data):
        """Data in which the old words stand, with the other ones: texts, or sentences within them."""
        if isinstance(data, dict):
            return {key: self.translated(value) for key, value in data.items()}
        if isinstance(data, list):
            return [self.translated(value) for value in data]
        if not isinstance(data, str) or data in self.of:
            return self.of.get(data, data) if isinstance(data, str) else data
        for old in sorted((old for old in self.of if len(old) > 20), key=len, reverse=True):
            data = data.replace(old, self.of[old])
        return data


def reworded(folder, copy):
    """A copy of an ensemble's folder in other words."""
    shutil.copytree(folder, copy)
    words, study = Words(), Members(folder).study
    for member in (copy / "members").iterdir():
        if (member / "finished").exists():
            words.in_summary(member / "summary.json")
            words.in_file(member / "result.h5")
            made_up.record(member, study)
    words.in_file(copy / "ensemble.h5", ("warnings/text", "reasons/text", "codes/meaning", "members/reason"))
    return words


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """An ensemble, the same in other words, and these."""
    folder = tmp_path_factory.mktemp("words")
    write_case(folder, CASE, "base.yml")
    (folder / "study.yml").write_text(json.dumps(STUDY))
    done = call("ensemble", "study.yml", "-o", "plain", "--quiet", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "plain", folder / "other", reworded(folder / "plain", folder / "other")


def drawn(figure):
    """Numbers and words of a picture."""
    numbers, said = [], []
    for axes in figure.axes:
        numbers += [np.ravel(line.get_xydata()) for line in axes.lines]
        numbers += [np.ravel(np.ma.filled(c.get_offsets(), np.nan)) for c in axes.collections]
        numbers += [np.ravel(path.vertices) for c in axes.collections for path in c.get_paths()]
        legend = axes.get_legend()
        said += [axes.get_xlabel(), axes.get_ylabel(), *(t.get_text() for t in (legend.get_texts() if legend else ()))]
    said += [t.get_text() for t in figure.texts]
    return numbers, said


def compare(one, other, words):
    assert len(one[0]) == len(other[0]) and all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one[0], other[0]))
    assert [words.translated(text) for text in one[1]] == other[1]


def test_statistics_and_pictures_of_an_ensemble(both):
    """Red at a regular expression for "the last line parted at", digits stripped from a reason, warnings counted
    beyond the known checks, and words for what a series needs."""
    plain, other, words = both
    first, second = Members(plain), Members(other)
    doubts = [first.doubts(m) for m in range(first.n)]
    assert doubts == [second.doubts(m) for m in range(second.n)]
    assert set().union(*doubts) >= {"unsteady", "short", "few"}
    assert np.isfinite([first.adrift(m) for m in range(first.n)]).any() and first.without_mean
    assert {w["text"] for m in range(first.n) for w in first.warnings(m)}.isdisjoint(
        w["text"] for m in range(first.n) for w in second.warnings(m))
    needs = [{load.name: load.needs for load, _ in loads.of_member(e, 3)[0]} for e in (first, second)]
    assert needs[0] == needs[1] and needs[0]["line_tension_1"] == "line" and needs[0]["line_tension_2"] == "bridle"
    found = [ensemble.statistics(e, OPTIONS) for e in (first, second)]
    assert "the line parted in" in str(found[0]["conditions"][2]["design"]["warnings"])
    one, two = (json.loads(json.dumps(plain_data(s | {"folder": "", "doubts": {}}))) for s in found)
    assert words.translated(one) == two
    for (name, draw), (same, again) in zip(plot_ensemble.pictures(first, None, found[0]["conditions"]),
                                           plot_ensemble.pictures(second, None, found[1]["conditions"])):
        assert name == same
        compare(drawn(draw()), drawn(again()), words)


def test_statistics_without_the_folders_of_the_members(both, tmp_path):
    """What of them is in ensemble.h5 is the same, and known by codes."""
    plain, other, _ = both
    e = Members(plain)
    for folder in (plain, other):
        (alone := tmp_path / folder.name).mkdir()
        shutil.copy(folder / "ensemble.h5", alone)
        there = Members(alone)
        assert np.array_equal(there.mean, e.mean, equal_nan=True) and there.without_mean == e.without_mean
        for m in range(e.n):
            assert there.doubts(m) == e.doubts(m) and there.adrift(m) == e.adrift(m)
            assert [w["code"] for w in there.warnings(m)] == [w["code"] for w in e.warnings(m)]
            assert [w["values"] for w in there.warnings(m)] == [w["values"] for w in e.warnings(m)]
            with Run(e.folder(m)) as run:
                assert run.events == there.events(m)
                assert [w["code"] for w in run.warnings] == [w["code"] for w in e.warnings(m)]


def test_the_picture_of_a_run(both):
    plain, other, words = both
    for m in (0, 8):
        with Run(Members(plain).folder(m)) as one, Run(Members(other).folder(m)) as two:
            assert one.verdict[0] == two.verdict[0]
            (numbers, _), (again, _) = drawn(plot_force.draw(one)), drawn(plot_force.draw(two))
            assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(numbers, again))
            assert len(plot_force.doubts(one)) == len(plot_force.doubts(two))


def test_every_doubt_follows_from_numbers_and_codes(tmp_path):
    """Of made-up members, so that each kind is there."""
    some = [({"window": {"verdict": "not steady"}}, "not_steady", {"unsteady"}),
            ({"window": {"verdict": "too short"}}, "too_short", {"short"}),
            ({"window": {"verdict": "steady", "n_contact_stretches": 3.0}}, None, {"few"}),
            ({"window": {"verdict": "steady"}, "summary": {"unconverged_steps": 4}}, "unconverged", {"unconverged"}),
            ({"window": {"verdict": "steady", "no_load_share": 0.1}}, "locked", {"unbounded"}),
            ({"window": {"verdict": "steady"}, "summary": {"stalled_windows": 4}}, "stalled", {"jammed"}),
            ({"window": {"verdict": "steady"}}, "stopped", {"stopped"}),
            ({"window": {"verdict": "steady"}}, "overlap", {"other"})]
    assert set().union(*(wanted for _, _, wanted in some)) == set(DOUBTS)
    members = [made_up.member(np.arange(50.0) + k, {}, 0, warnings=[made_up.note(code)] if code else [], **what)
               for k, (what, code, _) in enumerate(some)]
    plain = made_up.write(tmp_path / "plain", members)
    reworded(plain, tmp_path / "other")
    for folder in (plain, tmp_path / "other"):
        assert [Members(folder).doubts(m) for m in range(len(some))] == [wanted for _, _, wanted in some]


def test_each_code_has_a_row_and_each_warning_a_code():
    """No code stands for two things; each text has the values that its row names; and no warning goes without."""
    sources = {path: path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.[ch]")}
    table = re.findall(r'ROW\((\w+),\s*"(\w+)",\s*"([^"]*)",\s*"([^"]*)"\)', re.sub(
        r"\\\n", "", sources[ROOT / "src/case/warning.h"]))
    values = {name: some.split() for name, _, some, _ in table}
    assert len(values) == len({code for _, code, _, _ in table}) == len({text for *_, text in table}) > 70
    assert all(re.fullmatch(r"[a-z][a-z0-9_]*|-", word) for some in values.values() for word in some)
    assert all(len(set(some) - {"-"}) == len(some) - some.count("-") and some[-1:] != ["-"] for some in values.values())
    used = set()
    for path, text in sources.items():
        for names, format_ in re.findall(r'bt_warn\([^"]*?((?:BT_WARN_\w+[ ?:]*)+),\s*((?:"(?:[^"\\]|\\.)*"\s*)+)',
                                         text):
            found = re.findall(r"%[-+ #0-9.]*l*([a-zA-Z])", format_.replace("%%", ""))
            for name in re.findall(r"BT_WARN_(\w+)", names):
                assert len(values[name]) <= len(found), (path.name, name)
                used.add(name)
        without = re.findall(r'bt_errors_add\((?:w->|&s->)?warnings,\s*"(?!warning: )([^"]*)', text)
        assert not without, f"{path.name}: a warning without a code: {without}; use bt_warn"
    assert used == set(values)


OTHER = """#!{python}
import json, pathlib, subprocess, sys
done = subprocess.run([{program!r}, *sys.argv[1:]], stderr=subprocess.PIPE, text=True)
for k, line in enumerate(done.stderr.splitlines()):
    begin = "bergtow: warning: " if line.startswith("bergtow: warning: ") else "bergtow: "
    print(begin + f"other words {{k}}; {{k + 3}} others", file=sys.stderr)
path = pathlib.Path(sys.argv[sys.argv.index("-o") + 1] if "-o" in sys.argv else ".") / "summary.json"
if sys.argv[1] == "run" and path.exists():
    s = json.loads(path.read_text())
    for note in s["warnings"] + (s["window"] or {{}}).get("reasons", []):
        note["text"] = "other words"
    path.write_text(json.dumps(s))
sys.exit(done.returncode)
"""


@pytest.mark.slow
def test_commands_that_make_runs(tmp_path):
    """The same runs, found and exit code; also where the budget ends them, and where a run fails."""
    case = changed(TOW, run__duration=6, output__window_start=2, domain__length=16, domain__width=6)
    write_case(tmp_path, case)
    write_case(tmp_path, changed(case, guard={"overlap": 1e-9}, ice__concentration=0.7), "fails.yml")
    program = tmp_path / "bergtow"
    program.write_text(OTHER.format(python=sys.executable, program=BERGTOW))
    program.chmod(0o755)
    found = {}
    for name, binary in (("plain", BERGTOW), ("other", str(program))):
        def made(script, *words):
            return script_copy.called([script, *words], tmp_path, environment()
                                      | {"BERGTOW": binary, "OMP_NUM_THREADS": "1"}, 300, drawn=True)
        whole = made("converge", "case.yml", "-o", name, "--vary", "tolerance", "--jobs", "2")
        failed = made("converge", "fails.yml", "-o", f"{name}-fails", "--vary", "dt", "--jobs", "1")
        spent = made("converge", "case.yml", "-o", f"{name}-spent", "--vary", "dt", "--jobs", "1",
                     "--budget", "0.001", "--set", "run.dt=0.0002 s")
        rows = json.loads((tmp_path / name / "converge.json").read_text())
        found[name] = ([done.returncode for done in (whole, failed, spent)], rows["rows"], rows["verdicts"])
    assert found["plain"] == found["other"] and found["plain"][0] == [0, 5, 6]
