# SPDX-License-Identifier: MIT
"""Pictures, statistics and reports as functions of the Python package, and their commands."""
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import h5py
import matplotlib
import numpy as np
import pytest
from bergtow import functions
from bergtow.plot import style
from harness import ROOT, TOW, call, changed, environment, make, run, script, write_case
from python_package import bergtow, installed_by_pip

pytestmark = pytest.mark.usefixtures("library")
LIBRARY = ROOT / "build/release/libbergtow.so"
TOWED = changed(TOW, run__duration=6, output={"panels": True, "window_start": 2})


@pytest.fixture(scope="module")
def towed(tmp_path_factory):
    return run(tmp_path_factory.mktemp("towed"), TOWED).dir


@pytest.fixture(scope="module")
def speeds(tmp_path_factory):
    folder = tmp_path_factory.mktemp("speeds")
    write_case(folder, TOWED, "base.yml")
    study = {"base": "base.yml", "repeats": 3, "parameters": {"tow.speed": [0.1, 0.2]}}
    (folder / "study.yml").write_text(json.dumps(study))
    assert call("ensemble", "study.yml", "-o", "out", cwd=folder).returncode == 0
    return folder / "out"


def drawn_by(name, *arguments):
    done = script(name, *arguments)
    assert done.returncode == 0, done.stderr


# --- of a run ---------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("name, words, options", [
    pytest.param("force", [], {}, marks=pytest.mark.slow),
    ("force", ["--max", "50"], {"max": 50}),
    ("field", ["--colour", "force", "--times", "1", "3"], {"colour": "force", "times": [1, 3]}),
    pytest.param("impacts", [], {}, marks=pytest.mark.slow),
    pytest.param("resistance", ["--linear"], {"linear": True}, marks=pytest.mark.slow),
])
def test_a_picture_is_that_of_the_command(towed, tmp_path, name, words, options):
    picture = getattr(bergtow, f"plot_{name}")(bergtow.Result(towed), **options)
    drawn_by(f"plot-{name}", towed, "-o", tmp_path / "theirs.png", *words)
    assert picture._repr_png_() == (tmp_path / "theirs.png").read_bytes()
    assert picture.save(tmp_path / "ours.svg").read_text().startswith("<?xml")


def test_a_picture_is_saved_as_it_is_shown(towed, tmp_path, monkeypatch):
    """Whatever has become of the folder since."""
    shutil.copytree(towed, tmp_path / "out")
    monkeypatch.chdir(tmp_path)
    picture = bergtow.plot_force("out", max=50)
    monkeypatch.chdir("/")
    assert picture.save(tmp_path / "kept.svg").exists()
    shutil.rmtree(tmp_path / "out")
    for path in tmp_path / "kept.png", tmp_path / "new/kept.png":
        assert picture.save(path).read_bytes() == picture._repr_png_()
    (tmp_path / "theirs.png").write_text("not ours")
    with pytest.raises(bergtow.BergtowError, match="theirs.png: already exists and was not made by bergtow"):
        picture.save(tmp_path / "theirs.png")
    assert (tmp_path / "theirs.png").read_text() == "not ours"
    for name, remedy in ("theirs.png", "replace=True"), ("a.jpg", ".png, .pdf, .svg"), ("a", ".png, .pdf, .svg"):
        with pytest.raises(bergtow.BergtowError) as error:  # red: -o and --force, and a temporary file
            picture.save(tmp_path / name)
        assert str(error.value).startswith(f"{tmp_path / name}: ") and remedy in str(error.value)
        assert "--" not in str(error.value)
    assert picture.save(tmp_path / "theirs.png", replace=True).read_bytes() == picture._repr_png_()
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(bergtow.BergtowError, match="pipe.png: already exists and is not a file"):
        picture.save(tmp_path / "pipe.png")
    with pytest.raises(bergtow.BergtowError, match="out: no such"):
        picture.save(tmp_path / "kept.pdf")


def test_outlines_keep_their_files_when_the_folder_changes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = functions.Outlines("map.gpkg", Path("floes.geojson"), {}, "", [])
    monkeypatch.chdir("/")
    assert (made.map, made.file) == (tmp_path / "map.gpkg", tmp_path / "floes.geojson")


@pytest.mark.slow
def test_what_cannot_be_drawn_is_said(towed, tmp_path):
    with pytest.raises(bergtow.BergtowError, match="holds neither summary.json nor result.h5"):
        bergtow.plot_field(tmp_path)
    with pytest.raises(bergtow.BergtowError, match="invalid choice: 'red'"):
        bergtow.plot_field(towed, colour="red")
    with pytest.raises(bergtow.BergtowError, match="unknown kind of file"):
        bergtow.plot_force(towed).save(tmp_path / "x.gif")


@pytest.mark.parametrize("function, place", [
    ("plot_force", []), ("plot_ensemble", []), ("statistics", []), ("report", []), ("outlines", ["x.geojson"]),
    ("export", ["x.gpkg"]), ("converge", ["place"])])
def test_no_option_says_where_a_result_goes(function, place, tmp_path, monkeypatch):
    """Refused as wrong usage before the input is looked at. Red: another's file replaced without leave, the answer of
    an earlier call returned, or a FileNotFoundError."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.png").write_text("my own picture")
    for name in {"output", "output_", "o", "out", "force", "help", "h", "record", "format"} - {
            "out" if function == "converge" else ""}:
        with pytest.raises(bergtow.BergtowError) as refused:
            getattr(bergtow, function)("none", *place, **{name: "mine.png"})
        assert refused.value.status == 2 and os.listdir(tmp_path) == ["mine.png"], name
    assert (tmp_path / "mine.png").read_text() == "my own picture"


def test_an_earlier_answer_is_kept_unless_it_is_to_be_replaced(tmp_path):
    (tmp_path / "case.yml").write_text("ice: {}\n")
    (tmp_path / "out").mkdir()
    (tmp_path / "out/converge.json").write_text("{}")
    with pytest.raises(bergtow.BergtowError, match="already exists"):
        bergtow.converge(tmp_path / "case.yml", tmp_path / "out")
    with pytest.raises(bergtow.BergtowError) as error:  # the case is looked at then
        bergtow.converge(tmp_path / "case.yml", tmp_path / "out", replace=True)
    assert error.value.status == 3


def test_the_callers_matplotlib_is_left_alone(towed):
    """Neither its backend and settings nor a module of the caller with the name of one of ours is touched, and what it
    has set is not in the picture."""
    plain = bergtow.plot_force(towed)._repr_png_()
    script = (f"import sys; sys.path.insert(0, {str(ROOT / 'postproc')!r}); sys.modules['style'] = None\n"
              "import bergtow, hashlib, matplotlib\nmatplotlib.use('svg'); matplotlib.rcParams['font.size'] = 20\n"
              "before = dict(matplotlib.rcParams)\n"
              f"drawn = bergtow.plot_force({str(towed)!r})._repr_png_()\n"
              "print(before == dict(matplotlib.rcParams), 'matplotlib.pyplot' in sys.modules, sys.modules['style'], "
              "hashlib.sha256(drawn).hexdigest())")
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment())
    assert said.stdout.split() == ["True", "False", "None", hashlib.sha256(plain).hexdigest()], said.stderr


def test_threads_draw_one_after_another():
    """Red: the second restores the settings of the first, which has ended, instead of the caller's."""
    before, inside, over = dict(matplotlib.rcParams), threading.Event(), threading.Event()

    def draw():
        with style.look():
            inside.set()
            over.wait(9)
    second = threading.Thread(target=draw)
    with style.look():
        second.start()
        inside.wait(0.2)
    over.set()
    second.join()
    assert before == dict(matplotlib.rcParams)


def test_a_package_that_is_missing_is_named(towed, tmp_path):
    (tmp_path / "jinja2.py").write_text("raise ModuleNotFoundError(\"No module named 'jinja2'\", name='jinja2')")
    script = (f"import sys; sys.path.insert(0, {str(ROOT / 'postproc')!r})\n"
              f"import bergtow; bergtow.report({str(towed)!r}, 'x.html')")
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path,
                          env=environment(PYTHONPATH=str(tmp_path)))
    assert "jinja2 is missing" in said.stderr and "install python3-jinja2" in said.stderr
    assert not (tmp_path / "x.html").exists()


def test_a_result_in_a_notebook(towed):
    shown = bergtow.Result(towed)._repr_html_()
    summary = json.loads((towed / "summary.json").read_text())
    assert summary["state_hash"] in shown and f"{summary['mean_ice_resistance_n']:.4g} ± " in shown


def test_a_result_that_is_printed(towed, tmp_path):
    """Red: the name of a class. Its number with its error and verdict; without a summary that it is missing."""
    summary, lines = json.loads((towed / "summary.json").read_text()), str(bergtow.Result(towed)).splitlines()
    assert lines[:2] == [str(towed), f"  verdict: {summary['window']['verdict']}"]
    mean, error = summary["mean_ice_resistance_n"], summary["mean_ice_resistance_se_n"]
    assert f"  mean_ice_resistance_n: {mean:.4g} ± {error:.2g}" in lines
    assert str(bergtow.Result(tmp_path)) == f"{tmp_path}: has no summary: the run has not ended"


def test_all_of_the_file_is_in_the_dataset(towed):
    with bergtow.open_result(towed) as d, h5py.File(towed / "result.h5") as f:
        n = len(f["floes/area"])
        np.testing.assert_array_equal(d.floe_speed, f["frames/speed"][:, :n])
        np.testing.assert_array_equal(d.other_body_speed, f["frames/speed"][:, n:])
        np.testing.assert_array_equal(d.other_body_speed[3, -2:], f["frames/speed"][3, -2:])
        np.testing.assert_array_equal(d.floe_velocity, f["frames/velocity"][:, :n])
        np.testing.assert_array_equal(d.other_body_velocity.sel(xy="y"), f["frames/velocity"][:, n:, 1])
        np.testing.assert_allclose(np.hypot(*d.floe_velocity.values.T), d.floe_speed.values.T, rtol=1e-6)
        np.testing.assert_array_equal(d.floe_speed[[1, 4], 2:9:3], f["frames/speed"][[1, 4], 2:9:3])
        for group, prefix in (("impacts", "collision"), ("panels", "panel"), ("events", "event"), ("floes", "floe"),
                              ("bodies", "other_body")):
            for name, values in f[group].items():
                if values.dtype.kind != "O":
                    np.testing.assert_array_equal(d[f"{prefix}_{name}"], values)
        assert d.panel_load.dims == ("time", "panel") and d.collision_peak.dims == ("collision",)
        assert d.panel_force.sel(xy="y").dims == ("time", "panel")
        assert len(f["impacts/peak"]) > 0 and d.event_kind_names.values[0] == "line_broken"


def test_progress(tmp_path, capsys):
    seen = []
    bergtow.run(TOWED, tmp_path / "one", progress=True)
    line = capsys.readouterr().out.split("\r")[-1]
    assert re.fullmatch(r"100\.0 %  t = 6 s  \S+ steps/s  0 s left  mean ice resistance so far \S+ N *\n", line), line
    bergtow.run(TOWED, tmp_path / "two", progress=lambda sim: seen.append(sim.steps_left))
    assert seen[-1] == 0 and capsys.readouterr().out == ""


# --- of an ensemble ---------------------------------------------------------------------------------------------------

@pytest.mark.slow
def test_statistics_of_an_ensemble(speeds, tmp_path):
    found = bergtow.Ensemble(speeds).statistics(resamples=99, time_scale=1)
    drawn_by("statistics", speeds, "-o", tmp_path, "--resamples", "99", "--time-scale", "1")
    assert found == json.loads((tmp_path / "statistics.json").read_text())
    table = bergtow.Ensemble(speeds).dataframe
    means = table.groupby("tow.speed")["mean_ice_resistance_n"].mean()
    np.testing.assert_allclose([c["resistance"]["mean"] for c in found["conditions"]], means, rtol=1e-12)


@pytest.mark.slow
def test_pictures_of_an_ensemble(speeds, tmp_path):
    pictures = bergtow.plot_ensemble(speeds)
    drawn_by("plot-ensemble", speeds, "-o", tmp_path)
    theirs = {p.stem: p.read_bytes() for p in tmp_path.glob("*.png")}
    assert {name: p._repr_png_() for name, p in pictures.items()} == theirs and "sweep-tow-speed" in theirs
    assert pictures["sweep-tow-speed"].save(tmp_path / "new/x.svg").read_text().startswith("<?xml")
    with pytest.raises(bergtow.BergtowError, match="x.png: cannot be written"):
        pictures["sweep-tow-speed"].save(tmp_path / "new/x.svg/x.png")


# --- reports ----------------------------------------------------------------------------------------------------------

@pytest.mark.slow
def test_reports(towed, speeds, tmp_path):
    path = bergtow.Result(towed).report(tmp_path / "run.html", client="Nordic & Sons")
    assert "Nordic &amp; Sons" in path.read_text()
    path = bergtow.Ensemble(speeds).report(tmp_path / "ensemble.html")
    assert "design" in path.read_text().lower()
    (tmp_path / "mine.html").write_text("a page of my own")
    with pytest.raises(bergtow.BergtowError, match="already exists"):
        bergtow.report(towed, tmp_path / "mine.html")
    assert bergtow.report(towed, tmp_path / "mine.html", replace=True).stat().st_size > 1e5


@pytest.mark.slow
def test_the_wheel_has_the_command(towed, tmp_path):
    """Installed by pip, with nothing of the source tree in reach: those of the package, and of the program."""
    env = environment(BERGTOW_LIB=str(LIBRARY))
    env.pop("PYTHONPATH", None)
    command = installed_by_pip(tmp_path) / "bergtow"
    said = subprocess.run([command, "report", towed, "-o", tmp_path / "x.html"], capture_output=True, text=True,
                          env=env)
    assert said.returncode == 0 and (tmp_path / "x.html").stat().st_size > 1e5, said.stderr
    said = subprocess.run([command, "report", tmp_path / "none"], capture_output=True, text=True, env=env)
    assert said.returncode == 4 and said.stderr.startswith("bergtow report: ") and "Traceback" not in said.stderr
    said = subprocess.run([command, "--version"], capture_output=True, text=True, env=env)
    assert said.stdout == call("--version").stdout, said.stderr
    env |= {"BERGTOW_LIB": str(tmp_path), "PATH": str(command.parent)}  # where it does not call itself
    env.pop("BERGTOW", None)
    said = subprocess.run([command, "run", "x.yml"], capture_output=True, text=True, env=env)
    assert said.returncode == 4 and "install it with `make install`" in said.stderr


@pytest.mark.slow
def test_make_install_has_the_command(towed, tmp_path):
    make("install", f"PREFIX={tmp_path / 'usr'}")
    (tmp_path / "bin").mkdir()
    command = tmp_path / "bin/bergtow"
    command.symlink_to(tmp_path / "usr/bin/bergtow")
    said = subprocess.run([command, "report", towed, "-o", tmp_path / "x.html"], capture_output=True, text=True,
                          env=environment())
    assert said.returncode == 0 and "x.html" in said.stdout, said.stderr
    assert subprocess.run([command, "report", "--help"], capture_output=True, text=True, env=environment()
                          ).stdout.startswith("usage: bergtow report ")


def test_what_the_commands_of_python_need_is_said(towed):
    for extra, words in ({"BERGTOW_HOME": "/nowhere"}, "pip install ./postproc"), ({"PYTHON": "/nowhere"}, "PYTHON"):
        said = call("report", towed, env=environment(**extra))
        assert said.returncode == 4 and "/nowhere" in said.stderr and words in said.stderr


def test_findings_are_taken_from_folders_that_have_some(towed, speeds, tmp_path):
    for folder in towed, speeds:
        said = call("report", folder, "-o", tmp_path / "x.html", "--also", tmp_path)
        assert said.returncode == 4 and "--also" in said.stderr and not (tmp_path / "x.html").exists()


@pytest.mark.slow
def test_what_is_found_out_by_runs(tmp_path):
    """converge and capability as functions: what the file has, and a refusal as an exception."""
    write_case(tmp_path, changed(TOWED, run__duration=4), "case.yml")
    found = bergtow.converge(tmp_path / "case.yml", tmp_path / "out", vary="tolerance", set={"ice.friction": 0.2})
    assert found == json.loads((tmp_path / "out/converge.json").read_text()) and found["set"] == ["ice.friction=0.2"]
    with pytest.raises(bergtow.BergtowError, match="no such file") as refused:
        bergtow.capability(tmp_path / "none.yml", tmp_path / "out")
    assert refused.value.status == 4
