# SPDX-License-Identifier: MIT
"""No command of the Python package replaces a file that none of them made, unless it is told to, or what is not a
regular file, and none loses a file where its reader leaves: every command, every kind of file."""
import os
import re
import shutil
import stat
import subprocess

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import made_up_ensemble as made_up
from harness import BERGTOW, ROOT, TOW, call, changed, script, write_case

from bergtow import cli, writing
from bergtow.errors import RunError
from bergtow.reporting import ensemble as report_ensemble
from bergtow.reporting import run as report_run
from bergtow.study import analysis, converge

DEAR = b"dear to somebody"
REFUSED = ": already exists and was not made by bergtow; .*--force"


def long(*call):
    """One that make test-long alone makes."""
    return pytest.param(*call, marks=pytest.mark.slow)


#: (command, arguments; RUN and ALL stand for the folders of a run and of an ensemble, and files it writes into
#: the working folder), in each line another kind of file
CALLS = [
    long("plot-force", ["RUN", "-o", "a.png", "--diagnostics"], ["a.png", "a-diagnostics.png"]),
    ("plot-field", ["RUN", "-o", "a.svg"], ["a.svg"]),
    long("plot-impacts", ["RUN", "-o", "a.pdf"], ["a.pdf"]),
    ("film", ["RUN", "-o", "a.mp4", "--frames", "2", "--width", "320"], ["a.mp4"]),
    ("film", ["RUN", "-o", "a.gif", "--frames", "2", "--width", "320"], ["a.gif"]),
    ("plot-chains", ["RUN", "contacts.h5", "-o", "a.png"], ["a.png"]),
    ("plot-resistance", ["RUN", "-o", "a.png", "--table", "a.md"], ["a.png", "a.md"]),
    long("plot-ensemble", ["ALL", "-o", "."], ["sweep-ice-concentration.png", "exceedance.png"]),
    ("statistics", ["ALL", "-o", ".", "--resamples", "1"], ["statistics.json", "statistics.csv"]),
    ("report", ["RUN", "-o", "a.html"], ["a.html"]),
    long("report", ["ALL", "-o", "a.pdf"], ["a.pdf"]),
    ("converge", ["case.yml", "-o", "."], ["converge.json"]),
    ("budget", ["study.yml", "-o", "."], ["budget.json", "budget.png"]),
    ("capability", ["line.yml", "-o", "."], ["capability.json", "capability.png"]),
    ("route", ["case.yml", "--to", "12,0", "--plan-only", "--routes", "1", "-o", "."],
     ["routes.geojson", "route.json", "route.png", "straight.yml"]),
    ("export", ["RUN", "-o", "a.geojson"], ["a.geojson"]),
    ("outlines", ["map.geojson", "-o", "a.geojson", "--record", "a.json", "--picture", "a.png"],
     ["a.geojson", "a.json", "a.png"]),
    ("design", ["case.yml", "-o", "."], ["answer.json", "design.yml", "report.html", "report.pdf", "replay.html"]),
]
WRITE_NOTHING = {"contents"}
SLOW = ("budget", "capability", "design")  # refused before any work; that they replace their own their tests show


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """A run with the contacts of a step, and an ensemble."""
    folder, rng = tmp_path_factory.mktemp("places"), np.random.default_rng(3)
    case = changed(TOW, ice__concentration=0.7, run__duration=12, output__window_start=3)
    made = call("run", write_case(folder, case), "-o", folder / "run", "--quiet", "--dump-contacts",
                f"100:{folder / 'contacts.h5'}")
    assert made.returncode == 0, made.stderr
    times = np.sort(rng.uniform(1, 599, 60))
    made_up.write(folder / "all", [
        made_up.member(made_up.ar1(0.6, 600, rng, 100.0 * c, 10.0), {"ice.concentration": c / 10}, c - 1,
                       peaks=(times, rng.exponential(50.0, 60))) for c in (1, 2) for _ in range(3)])
    return folder


@pytest.fixture
def quick(places, tmp_path, monkeypatch):
    """In a folder with the files that the calls read; what takes long and writes nothing is left out."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(places / "case.yml", tmp_path)
    shutil.copy(places / "contacts.h5", tmp_path)
    shutil.copy(ROOT / "cases/outlines/made_up.geojson", tmp_path / "map.geojson")
    (tmp_path / "study.yml").write_text("base: case.yml\n")
    write_case(tmp_path, changed(TOW, tow__mode="line", tow__line_length=3, tow__line_stiffness=2000, body__x=4,
                                 tow__line__breaking_load=1e5), "line.yml")
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    monkeypatch.setattr(converge, "converge", work_of(tmp_path / "converge.json"))
    monkeypatch.setattr(analysis.converge_text, "content", lambda _: [])
    monkeypatch.setattr(report_run, "pictures", lambda _: [])
    monkeypatch.setattr(report_ensemble, "OPTIONS", report_ensemble.OPTIONS | {"resamples": 1})
    return {"RUN": str(places / "run"), "ALL": str(places / "all")}


def work_of(file):
    """In place of hours of work, which must not begin where its result cannot be written."""
    def work(*_):
        assert not file.exists() or file.read_bytes() != DEAR
        return []
    return work


def test_every_command_that_writes_is_here():
    assert set(cli.COMMANDS) == {getattr(c, "values", c)[0] for c in CALLS} | WRITE_NOTHING


@pytest.mark.parametrize("command, words, files", CALLS, ids=str)
def test_files_of_others_are_kept(quick, tmp_path, command, words, files, monkeypatch):
    words = [quick.get(word, word) for word in words]
    if command in SLOW:
        for name in files:
            (tmp_path / name).write_bytes(DEAR)
            with pytest.raises(RunError, match=name + REFUSED):
                cli.perform(command, *words)
            assert (tmp_path / name).read_bytes() == DEAR
            (tmp_path / name).unlink()
        return
    for name in files:
        (tmp_path / name).write_bytes(DEAR)
        with pytest.raises(RunError, match=name + REFUSED):
            cli.perform(command, *words)
        assert (tmp_path / name).read_bytes() == DEAR
        assert not [other for other in files if other != name and (tmp_path / other).exists()]
        if name != files[-1]:
            (tmp_path / name).unlink()
    monkeypatch.setattr(converge, "converge", lambda *_: [])
    cli.perform(command, *words, "--force")
    made = {name: (tmp_path / name).read_bytes() for name in files}
    assert all(content != DEAR for content in made.values())
    stamps = {name: (tmp_path / name).stat().st_mtime_ns for name in files}
    cli.perform(command, *words)  # its own are replaced
    assert all((tmp_path / name).stat().st_mtime_ns > stamps[name] for name in files)
    assert not [p for p in tmp_path.iterdir() if ".new" in p.name]


@pytest.mark.parametrize("command, words, files", CALLS, ids=str)
def test_what_is_no_regular_file_is_kept(quick, tmp_path, command, words, files):
    """Before any work, with --force or without; red where a pipe becomes a file."""
    words = [quick.get(word, word) for word in words]
    for name in files:
        os.mkfifo(tmp_path / name)
        for force in ([], ["--force"]):
            with pytest.raises(RunError, match=f"{name}: already exists and is not a file"):
                cli.perform(command, *words, *force)
        assert stat.S_ISFIFO((tmp_path / name).stat().st_mode)
        (tmp_path / name).unlink()


@pytest.mark.parametrize("command, words, files",
                         [c for c in CALLS if getattr(c, "values", c)[0] not in (*SLOW, "converge")],
                         ids=str)
def test_a_reader_that_leaves(quick, tmp_path, command, words, files):
    """`| head -1`: the text is lost, each file is there, and the code tells. Red where a script ends at the first line
    that nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    called = [BERGTOW, command, *(quick.get(word, word) for word in words)]
    done = subprocess.run(called, stdout=writer, stderr=subprocess.PIPE, text=True, timeout=300,
                          env=os.environ | {"PYTHONUNBUFFERED": "1"})
    os.close(writer)
    assert all((tmp_path / name).stat().st_size > 0 for name in files), done.stderr
    # on a busy machine it says what it is at
    told = [line for line in done.stderr.splitlines() if not re.match(r"bergtow \w+: \d+ s: ", line)]
    assert done.returncode == 4 and len(told) == 1, done.stderr
    assert "standard output: cannot be written" in done.stderr


def test_pictures_carry_the_mark_where_it_can_be_read(tmp_path):
    figure = Figure()
    for name in ("a.png", "a.pdf", "a.svg"):
        writing.save(figure, tmp_path / name)
    assert Image.open(tmp_path / "a.png").text["Software"] == writing.MARK
    assert re.search(rb"/Producer \(" + writing.MARK.encode(), (tmp_path / "a.pdf").read_bytes())
    assert writing.MARK in (tmp_path / "a.svg").read_text().split("</metadata>")[0]


def test_what_is_no_file(tmp_path):
    """A folder in its place, a place that cannot be; the exit code of the program. An empty file, as a crash leaves
    one, is nobody's loss."""
    with pytest.raises(RunError, match="already exists and is not a file"):
        writing.may_write(tmp_path, True)
    (tmp_path / "empty.md").write_bytes(b"")
    writing.write_markdown("x", tmp_path / "empty.md", False)
    assert (tmp_path / "empty.md").read_text().startswith("x")
    with pytest.raises(RunError, match="cannot be written"):
        writing.write_markdown("x", tmp_path / "empty.md" / "below.md", False)
    (tmp_path / "case.html").write_bytes(DEAR)
    result = script("report", tmp_path, "-o", tmp_path / "case.html")
    assert result.returncode == 4 and "Traceback" not in result.stderr and "--force" in result.stderr
    assert (tmp_path / "case.html").read_bytes() == DEAR


def test_a_page_that_fails_leaves_the_old_one(tmp_path):
    path = tmp_path / "a.md"
    writing.write_markdown("old", path, False)
    before = path.read_bytes()
    with pytest.raises(KeyboardInterrupt):
        with writing.written(path, False) as new:
            new.write_text("half")
            raise KeyboardInterrupt
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["a.md"]
