# SPDX-License-Identifier: MIT
"""The Python package on libbergtow: cases, results and ensembles as datasets, its page, its installation."""
import ast
import ctypes
import copy
import inspect
import json
import math
import multiprocessing
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

import h5py
import numpy as np
import pytest
from harness import BERGTOW, IO, ROOT, call, changed, differing, heard, run, write_case
from bergtow import cli, errors
from bergtow.said import say
from python_package import LINE, SHORT, WINDOW, bergtow, installed_by_pip, python

pytestmark = pytest.mark.usefixtures("library")
LIBRARY = ROOT / "build/release/libbergtow.so"


# --- cases -----------------------------------------------------------------------------------------------------------

def test_a_case_is_read_checked_and_changed(tmp_path):
    case = bergtow.Case(write_case(tmp_path, SHORT))
    assert (case["tow.speed"], case.unit("tow.speed")) == (0.13, "m/s")
    case["tow.speed"] = "0.5 kn"
    assert case["tow.speed"] == 0.5 * 1852 / 3600
    with pytest.raises(bergtow.CaseError, match=r"^tow.sped=1: unknown key; did you mean tow.speed\?$"):
        case["tow.sped"] = 1
    with pytest.raises(bergtow.CaseError, match="body.draft"):
        case["body.draft"] = -1
    assert case.overrides == {"tow.speed": "0.5 kn"}
    del case["tow.speed"]
    assert case["tow.speed"] == 0.13
    case.update({"domain.length": 30, "body.x": 20})
    with pytest.raises(bergtow.CaseError, match="body.x"):
        case["domain.length"] = 15
    assert (case["domain.length"], case["body.x"]) == (30, 20)
    assert case.pop("tow.speed", None) is None and case["tow.speed"] == 0.13
    with pytest.raises(KeyError, match="tow.speed: has not been set"):
        case.pop("tow.speed")
    case["tow.speed"] = 0.2
    assert case.pop("tow.speed", None) == 0.2 and "tow.speed" not in case.overrides
    case["tow.speed"] = 0.2
    assert case.popitem() == ("tow.speed", 0.2) and list(case.overrides) == ["domain.length", "body.x"]
    case.clear()
    assert dict(case) == dict(bergtow.Case(case.path))
    with pytest.raises(KeyError, match="no value has been set"):
        case.popitem()
    speeds = bergtow.Case(changed(SHORT, tow={"programme": [[0, 0], [2, 0.4]]}))
    assert speeds["tow.programme"] == [[0, 0], [2, 0.4]]
    speeds["tow.programme"] = np.array([[0, 0.1], [3, 0.25]])
    assert speeds["tow.programme"] == [[0, 0.1], [3, 0.25]]
    with pytest.raises(bergtow.CaseError) as caught:
        bergtow.Case({"run": {"dt": -1, "duration": "x"}})
    assert len(str(caught.value).splitlines()) >= 2 and caught.value.status == 3


def test_a_text_that_would_end_at_a_nul_is_refused(tmp_path):
    text = json.dumps(SHORT, indent=1)
    with pytest.raises(bergtow.CaseError, match=r"^run.title: the value contains the character NUL; remove it$"):
        bergtow.Case(SHORT, {"run.title": "a\0b"})
    with pytest.raises(bergtow.CaseError,
                       match=rf"^case:{text.count(chr(10)) + 2}: the line contains the character NUL"):
        bergtow.Case.from_text(text + "\n\0\nbogus: 1")
    with pytest.raises(bergtow.BergtowError, match="^the name of the result folder contains the character NUL"):
        bergtow.Simulation(SHORT, str(tmp_path / "a\0b"))
    with pytest.raises(bergtow.BergtowError, match="^force 'a.*b': its name or docstring contains the character NUL"):
        bergtow.Simulation(SHORT, forces={"a\0b": lambda bodies: None})
    with bergtow.Simulation(SHORT, threads=1) as sim, pytest.raises(KeyError, match="contains the character NUL"):
        sim["time\0"]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("threads", [-1, 1025, 10_000_000, 2 ** 32 + 1])
def test_threads_are_as_many_as_the_command_takes(threads):
    with pytest.raises(bergtow.BergtowError, match=f"^threads: {threads} are not available; give 1 to 1024"):
        bergtow.Simulation(SHORT, threads=threads)


def test_a_case_has_the_values_of_the_resolved_one(tmp_path):
    listed = {key["name"]: key for key in json.loads(call("--list-keys", "--json").stdout)["keys"]}
    case = bergtow.Case(WINDOW, {"run.title": 'an "odd" one: # 1'})
    assert set(case) == set(listed) and case["run.title"] == 'an "odd" one: # 1'
    assert case["domain.ends"] == "moving" and case["guard.escape"] is True
    assert isinstance(case["solver.max_sweeps"], int) and isinstance(case["air.wind_x"], float)
    units = {"deg": "rad", "deg/s": "rad/s", "-": ""}
    assert all(case.unit(key) == units.get(u := listed[key].get("unit", ""), u) for key in case)
    case["tow.direction"] = "30 deg"
    assert math.isclose(case["tow.direction"], math.pi / 6)
    for key in ("tow.direction", "body.yaw_rate", "water.latitude", "tow.speed"):  # what is read can be set
        before = case[key]
        case[key] = before
        assert case[key] == before
    assert case["ice.field"] is None and case["water.tilt"] == "none"
    again = bergtow.Case.from_text(case.resolved)
    assert dict(again) == dict(bergtow.Case(WINDOW, {"run.title": 'an "odd" one: # 1', "tow.direction": math.pi / 6}))
    assert "tow.speed" in case._repr_html_()


@pytest.mark.parametrize("title", ["a\nb\tc", "floe \U0001f9ca, 50 \xb0", "\x85 \u2028 \ufeff \x7f \\ud83e\\udd8a"])
def test_a_title_is_any_text(title, tmp_path):
    case = bergtow.Case(changed(SHORT, run__title=title))
    assert case["run.title"] == title
    assert bergtow.Case.from_text(case.resolved)["run.title"] == title
    path = tmp_path / "case.yml"
    path.write_text(case.resolved)
    assert bergtow.Case(path)["run.title"] == title


def test_values_of_other_types(tmp_path):
    assert bergtow.Case(changed(SHORT, ice__seed=np.int64(4), tow__speed=np.float32(0.25)))["ice.seed"] == 4
    case = bergtow.Case(SHORT)
    case.update({"guard.escape": np.bool_(False), "tow.speed": np.float64(0.1), "ice.field": None})
    assert (case["guard.escape"], case["tow.speed"], case["ice.field"]) == (False, 0.1, None)
    case["ice.origin_lon"] = None  # of a key in degrees
    assert case.overrides["ice.origin_lon"] == "none"
    with pytest.raises(bergtow.BergtowError, match="none.h5"):
        bergtow.Simulation(SHORT | {"ice": {"field": tmp_path / "none.h5"}})
    with pytest.raises(TypeError, match="is nothing that a case can hold"):
        bergtow.Case(changed(SHORT, tow__speed=object()))
    with bergtow.Simulation(SHORT) as sim, pytest.raises(IndexError, match="body -1: does not exist"):
        sim.outline(-1)


def test_a_case_is_what_it_was_when_it_was_read(tmp_path, monkeypatch):
    """Whatever has become of its file, of the working folder, and of the Case once a simulation has begun."""
    monkeypatch.chdir(tmp_path)
    write_case(tmp_path, SHORT, "base.yml")
    (tmp_path / "case.yml").write_text("base: base.yml\ntow: {speed: 0.1}\n")
    case = bergtow.Case("case.yml")
    (tmp_path / "case.yml").write_text("base: base.yml\ntow: {speed: 0.2}\n")
    monkeypatch.chdir("/")
    with bergtow.Simulation(case) as sim:
        case["tow.speed"] = 0.3
        assert sim.case["tow.speed"] == 0.1
        sim.step(40)
        assert sim.velocities[sim.towed, 0] == 0.1
    write_case(tmp_path, changed(SHORT, ice__seed=77), "base.yml")
    with pytest.raises(bergtow.CaseError, match="case.yml: a file that it builds on .* has changed"):
        bergtow.Simulation(case)


# --- results ---------------------------------------------------------------------------------------------------------

def test_a_result_is_a_dataset(tmp_path):
    there = run(tmp_path, LINE)
    with bergtow.open_result(there.dir) as d:
        listed = {q["name"]: q for q in bergtow.quantities()["series"]}
        with h5py.File(there.dir / "result.h5") as f:
            for name, series in f["series"].items():
                assert d[name].dims == ("time",)
                np.testing.assert_array_equal(d[name], series)
                if name in listed:
                    assert d[name].attrs["units"] == listed[name]["units"]
            for k, axis in enumerate(("x", "y", "yaw")):
                assert d[f"floe_{axis}"].dims == ("frame", "floe")
                np.testing.assert_array_equal(d[f"floe_{axis}"], f["frames/pose"][:, :, k])
                np.testing.assert_array_equal(d[f"other_body_{axis}"], f["frames/body_pose"][:, :, k])
                np.testing.assert_array_equal(d[f"floe_{axis}"][1:, ::7], f["frames/pose"][1:, ::7, k])
        assert all("long_name" in v.attrs for v in d.variables.values())
        assert [name for name, v in d.variables.items() if v.dtype.kind not in "OU" and "units" not in v.attrs
                ] == ["event_value"]
        assert math.isclose(float(d.ice_resistance.sel(time=slice(1, 3)).mean()), d.ice_resistance.values[9:30].mean())
        assert json.loads(d.attrs["summary"])["state_hash"] == there.hash
        assert d.other_body_name.values[0] == "towed body"


def test_a_dataset_is_copied_pickled_and_cut_to_nothing(tmp_path):
    """Red: TypeError, h5py objects cannot be pickled; ValueError of a selection without a hit."""
    there = run(tmp_path, SHORT)
    with bergtow.open_result(there.dir) as d:
        ice = d.ice_resistance.values
        for copied in (d.copy(deep=True).ice_resistance, copy.deepcopy(d.ice_resistance), d.ice_resistance.copy(),
                       pickle.loads(pickle.dumps(d.ice_resistance)), pickle.loads(pickle.dumps(d)).ice_resistance):
            np.testing.assert_array_equal(copied.values, ice)
        np.testing.assert_array_equal(d.sortby("time", ascending=False).ice_resistance.values, ice[::-1])
        assert math.isfinite(float(d.tow_force.interp(time=1.05)))
        none = np.flatnonzero(d.floe_area.values > 1e9)
        assert d.floe_x.isel(floe=none).values.shape == (d.sizes["frame"], 0)
        assert d.floe_x.where(d.floe_area > 1e9, drop=True).shape[1] == 0
    with h5py.File(tmp_path / "other.h5", "w") as f:
        f["x"] = 1
    with pytest.raises(bergtow.BergtowError, match="holds no series of a run"):
        bergtow.open_result(tmp_path / "other.h5")


def test_a_large_result_opens_without_being_read(tmp_path):
    """Sizes of a million floes; nothing of them is in memory, or on the disk, until it is asked for."""
    there = run(tmp_path, SHORT)
    n = 1_000_000
    with h5py.File(there.dir / "result.h5", "r+") as f:
        t = len(f["frames/time"])
        for name, shape in (("floes/thickness", (n,)), ("floes/area", (n,)), ("floes/fixed", (n,)),
                            ("frames/pose", (t, n, 3)), ("frames/contact_force", (t, n)),
                            ("frames/speed", (t, n + len(f["bodies/area"]))),
                            ("frames/velocity", (t, n + len(f["bodies/area"]), 2)),
                            ("frames/net_force", (t, n + len(f["bodies/area"]), 2))):
            del f[name]
            f.create_dataset(name, shape, "f8", chunks=True)
    __import__("xarray")  # which is not timed
    start = time.process_time()  # of this process alone, on a busy machine, too
    with bergtow.open_result(there.dir) as d:
        assert d.floe_x.shape == (t, n) and float(d.floe_x[2, 5]) == 0
        assert time.process_time() - start < 1


# --- the page, and the contract ---------------------------------------------------------------------------------------

STUDY = {"base": "base.yml", "repeats": 2, "parameters": {"tow.speed": [0.1, 0.2]}}


def study(folder, **more):
    write_case(folder, changed(SHORT, run__duration=3), "base.yml")
    (folder / "study.yml").write_text(json.dumps(STUDY | more))
    return folder / "study.yml"


def test_an_ensemble_is_a_dataset_and_a_table(tmp_path, monkeypatch, capfd):
    """What the program has written, number by number, and the same folder as the command's."""
    path = study(tmp_path)
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    monkeypatch.chdir(tmp_path)
    e = bergtow.Ensemble.run(path, "ours", overrides={"ice.friction": 0.1, "tow.direction": math.pi / 2,
                                                      "guard.escape": True})
    assert "4 members finished" in capfd.readouterr().out
    assert call("ensemble", path, "-o", tmp_path / "theirs", "--set", "ice.friction=0.1", "--set",
                "tow.direction=90 deg").returncode == 0
    assert differing(tmp_path / "ours/ensemble.h5", tmp_path / "theirs/ensemble.h5") == []
    one = bergtow.Result("ours/members/c001-r001")
    monkeypatch.chdir("/")  # which no relative folder goes by
    assert e.counts == {"finished": 4, "failed": 0, "waiting": 0} and "4 finished" in repr(e)
    table = e.dataframe
    assert one.summary["n_steps"] == table["n_steps"]["c001-r001"]
    assert list(table.index) == ["c001-r001", "c001-r002", "c002-r001", "c002-r002"]
    assert list(table["tow.speed"]) == [0.1, 0.1, 0.2, 0.2]
    with e.dataset as d:
        assert dict(d.sizes)["member"] == 4 and d["tow.speed"].units == "m/s"
        for k, name in enumerate(table.index):
            r = e.result(name)
            for key in "mean_ice_resistance_n", "mean_tow_force_n", "n_steps":
                assert d[key].sel(member=k).item() == table[key][name] == r.summary[key]
            assert d.state_hash[k].item() == r.summary["state_hash"]
            with r.open() as one:
                np.testing.assert_array_equal(d.ice_resistance[k], one.ice_resistance)
        assert all(v.attrs["long_name"] for n, v in d.variables.items())
        with pickle.loads(pickle.dumps(d)) as again:
            assert d.identical(again)
    assert "<table" in e._repr_html_() and "&lt;bergtow.Ensemble" in e._repr_html_()


def test_an_ensemble_with_a_hole(tmp_path, monkeypatch, capfd):
    """A member that fails is reported, its numbers are NaN, and the others are there."""
    path = study(tmp_path, parameters={"output.window_start": [0.5, 9]})
    with pytest.raises(bergtow.BergtowError, match="c002-r001.*output.window_start"):
        bergtow.Ensemble.run(path, tmp_path / "out", progress=False)
    e = bergtow.Ensemble(tmp_path / "out")
    assert e.counts == {"finished": 2, "failed": 2, "waiting": 0}
    table = e.dataframe
    assert list(table["mean_ice_resistance_n"].isna()) == [False, False, True, True]
    assert "output.window_start" in table["reason"]["c002-r001"]
    for retry in (False, True):
        capfd.readouterr()
        with pytest.raises(bergtow.BergtowError, match="c002-r001"):
            bergtow.Ensemble.run(path, tmp_path / "out", retry_failed=retry)
        assert ("c002-r001 FAILED" in capfd.readouterr().out) == retry
    with pytest.raises(bergtow.BergtowError, match="holds no ensemble.h5"):
        bergtow.Ensemble(tmp_path)
    with pytest.raises(bergtow.BergtowError, match="no member"):
        e.result("c009-r001")
    monkeypatch.setenv("BERGTOW", "build/none/bergtow")
    with pytest.raises(bergtow.BergtowError, match="build/none/bergtow: is not a program"):
        bergtow.Ensemble.run(path, tmp_path / "other")
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    with pytest.raises(bergtow.BergtowError, match="none.yml"):
        bergtow.Ensemble.run(tmp_path / "none.yml", tmp_path / "none", progress=False)


def test_ctrl_c_stops_an_ensemble_that_goes_on(tmp_path):
    path = study(tmp_path, set={"run.duration": 50, "output.window_start": 20})
    script = (f"import sys; sys.path.insert(0, {str(ROOT / 'postproc')!r}); import bergtow; "
              f"bergtow.Ensemble.run({str(path)!r}, {str(tmp_path / 'out')!r})")
    p = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                         preexec_fn=heard)
    end = time.monotonic() + 60
    while not list(tmp_path.glob("out/members/*/result.part.h5")) and time.monotonic() < end:
        time.sleep(0.02)
    p.send_signal(signal.SIGINT)
    _, err = p.communicate(timeout=60)
    assert "KeyboardInterrupt" in err and list(tmp_path.glob("out/members/*/checkpoint.h5"))
    assert bergtow.Ensemble(tmp_path / "out").counts["finished"] < 4


@pytest.mark.slow
def test_the_examples_of_the_page_run(tmp_path, monkeypatch):
    shutil.copy(ROOT / "cases/basin/basin-80.yml", tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    examples = re.findall(r"```python\n(.*?)```", (ROOT / "docs/library.md").read_text(), re.DOTALL)
    assert len(examples) == 4
    for example in examples:
        exec(compile(example, "docs/library.md", "exec"), {})


def test_no_signal_handler_is_installed():
    def caught():
        with open("/proc/self/status") as f:
            return next(line for line in f if line.startswith("SigCgt"))

    before = caught()
    with bergtow.Simulation(SHORT) as sim:
        assert caught() == before
        sim.step(3)
        assert caught() == before


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", "SIGHUP"])
@pytest.mark.parametrize("end, code", [("pass", 0), ("raise BergtowError('no', 3)", 3)])
def test_a_signal_while_python_ends_leaves_the_exit_code(number, end, code):
    """Python gives up its handlers before the objects of modules."""
    done = python(f"""
import os, signal
from bergtow.cli import command
from bergtow.errors import BergtowError
class Late:
    def __del__(self, kill=os.kill, me=os.getpid(), number=signal.{number}):
        kill(me, number)
late = Late()
def main():
    {end}
command.guarded("late", main)
""")
    assert done.returncode == code and "Traceback" not in done.stderr


def test_a_program_is_told_that_memory_has_run_out():
    said = python("""
import bergtow, ctypes, os
lib = bergtow._library.library()
report = ctypes.CFUNCTYPE(None, ctypes.c_char_p, ctypes.c_void_p)(lambda text, user: os.write(1, b"reported: " + text))
lib.bt_on_out_of_memory(report, None)
lib.bt_alloc.argtypes = [ctypes.c_size_t, ctypes.c_size_t]
lib.bt_alloc(2**60, 8)
""")
    assert said.stdout.startswith("reported: out of memory") and not said.stderr and said.returncode == 5


# --- installation ----------------------------------------------------------------------------------------------------

def _fail(kind):
    raise {"run": lambda: errors.RunError("a folder", "is empty", "fill it", 4),
           "refused": lambda: errors.Refused("a.yml", [errors.Message("ice.size: is -1 m", "range")], 3, ""),
           "case": lambda: bergtow.CaseError("ice.size: is -1 m", 3),
           "plain": lambda: bergtow.BergtowError("a text", 6)}[kind]()


@pytest.mark.parametrize("kind", ["run", "refused", "case", "plain"])
def test_an_exception_arrives_from_another_process(kind):
    """Red: a Pool that waits for ever, since RunError and Refused could not be loaded."""
    with pytest.raises(bergtow.BergtowError) as here:
        _fail(kind)
    with multiprocessing.get_context("fork").Pool(1) as pool, pytest.raises(bergtow.BergtowError) as there:
        pool.apply_async(_fail, [kind]).get(timeout=20)
    a, b = here.value, there.value
    assert type(a) is type(b) and (str(a), vars(a)) == (str(b), vars(b))
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        again = pickle.loads(pickle.dumps(a, protocol))
        assert type(again) is type(a) and (again.args, vars(again)) == (a.args, vars(a))
    assert str(copy.copy(a)) == str(a)


def test_a_folder_that_cannot_be_made_is_a_message_with_a_remedy(tmp_path):
    """The same as of the command. Red: "[Errno 20] Not a directory: ..."."""
    (tmp_path / "file").write_text("")
    case = write_case(tmp_path, SHORT)
    out = tmp_path / "file/out"
    said = call("converge", case, "-o", out, "--budget", "0.1")
    with pytest.raises(bergtow.BergtowError) as refused:
        bergtow.converge(case, out, budget=0.1)
    assert refused.value.status == said.returncode == IO and f"bergtow converge: {refused.value}\n" in said.stderr


def test_a_missing_library_is_a_message():
    said = python("import bergtow; bergtow.Case('x.yml')", BERGTOW_LIB="/nowhere/lib.so").stderr
    assert "libbergtow cannot be loaded" in said and "make lib" in said and "BERGTOW_LIB" in said


def test_a_missing_module_is_a_message(tmp_path):
    for name in ("xarray", "h5py"):
        said = python(f"import sys; sys.modules[{name!r}] = None; import bergtow; bergtow.open_result('x')").stderr
        assert f"{name} is missing" in said and f"python3-{name}" in said


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_a_python_without_packages_is_a_message(command):
    """-S: no site-packages, as in a Python of another origin."""
    said = subprocess.run([sys.executable, "-S", "-m", "bergtow", command, "x"], capture_output=True, text=True,
                          env=os.environ | {"PYTHONPATH": str(ROOT / "postproc")})
    assert said.returncode == IO and said.stderr.startswith("bergtow: bergtow needs numpy, which ")
    assert said.stderr.count("\n") == 1 and "python3-numpy (Debian)" in said.stderr


def test_what_the_library_says_of_units_files_and_limits(tmp_path):
    """Red: the unit of a bare angle is lost; a study with a base is a case; a limit is another than the program's."""
    lib, value = bergtow._library.library(), ctypes.c_double()
    for text, unit, wanted in (("1.5 kn", "m/s", 1.5 * 1852 / 3600), ("180", "rad", np.pi), ("2", "", 2.0)):
        lib.bt_number_read(text.encode(), unit.encode(), ctypes.byref(value))
        assert value.value == pytest.approx(wanted, rel=1e-15)
    for text, unit in ("1 m", "m/s"), ("x", ""), ("1", "furlong"):
        with pytest.raises(bergtow.BergtowError):
            lib.bt_number_read(text.encode(), unit.encode(), ctypes.byref(value))
    for text, kind in ("base: a.yml\nrepeats: 2\n", b"study"), ("run: {dt: 1}\n", b"case"), ("[1]\n", b""):
        (tmp_path / "file.yml").write_text(text)
        assert lib.bt_file_holds(os.fsencode(tmp_path / "file.yml")) == kind
    header = (ROOT / "src/output/steady.h").read_text()
    limits = bergtow._library.listed("limits")
    for name, macro in (("window_independent", "INDEPENDENT"), ("window_contact_stretches", "STRETCHES"),
                        ("window_drift", "MATERIAL")):
        assert limits[name] == float(re.search(rf"#define BT_STEADY_{macro} (\S+)", header)[1])
    near = [name for name in (b"Thickness_m", b"thicknes", b"Tykkelse", b"id", b"hi") if
            lib.bt_outline_near_thickness(name)]
    assert near == [b"Thickness_m", b"thicknes", b"Tykkelse"]
    assert [name for name in (b"CT", b"poly_type", b"CTX", b"") if lib.bt_outline_chart_column(name)] == [
        b"CT", b"poly_type"]


def test_modules_use_those_below_them():
    """In the order of the table in docs/architecture.md. Red: result/ imports plot/; the table lacks a module."""
    table = re.search(r"^## The Python package\n(.*?)^## ", (ROOT / "docs/architecture.md").read_text(), re.S | re.M)[1]
    rows = re.findall(r"^\| ([\\\w, ]+) \| \S+ ", table, re.M)[1:]
    rows = [re.findall(r"\w+", row.replace("\\", "")) for row in rows]
    place = {name: -k for k, row in enumerate(rows) for name in row}
    package = ROOT / "postproc/bergtow"
    for file in sorted(package.rglob("*.py")):
        own = file.relative_to(package).parts[0].removesuffix(".py")
        if own in ("__init__", "__main__"):
            continue
        for module, names in re.findall(r"^from (?:bergtow)?\.?([\w.]*) import ([\w, ]+)", file.read_text(), re.M):
            for used in [module.split(".")[0]] if module else [name.split()[0] for name in names.split(", ")]:
                assert used not in place or place[used] <= place[own], (file, used)
        assert own in place, file


def test_a_function_in_a_thread_takes_nothing_from_standard_output(monkeypatch, capsys):
    """What another thread prints meanwhile is there, what the command says is not. Red: sys.stdout is replaced."""
    begun, over = threading.Event(), threading.Event()
    monkeypatch.setattr(cli, "perform", lambda *words: (say("x.csv"), begun.set(), over.wait(9)))
    thread = threading.Thread(target=bergtow.export, args=("run", "x.csv"))
    thread.start()
    begun.wait(9)
    print("of the caller")
    over.set()
    thread.join()
    assert capsys.readouterr().out == "of the caller\n"


def test_commands_of_functions_print_through_say():
    """Red: a command that a function calls prints on standard output."""
    names = re.findall(r'_(?:call|picture)\("([\w-]+)"', inspect.getsource(bergtow.functions))
    for module in {"writing"} | {cli.COMMANDS[name][0] for name in names}:
        path = ROOT / "postproc/bergtow" / f"{module.replace('.', '/')}.py"
        assert not [node.lineno for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call) and
                    ast.unparse(node.func) == "print" and "file" not in [k.arg for k in node.keywords]], path


def test_the_program_and_the_package_have_the_same_commands():
    """Each command of the package in `bergtow --help`, in its words; the program's others reach it from Python."""
    listed = dict(re.findall(r"^  ([a-z-]+) +(\S.*)$", call("--help").stdout, re.M))
    assert {name: listed.get(name) for name in cli.COMMANDS} == {name: about for name, (_, about) in
                                                                 cli.COMMANDS.items()}
    others = [name for name in listed if name not in cli.COMMANDS]
    assert len(others) >= 7
    for name in others:
        said = subprocess.run([sys.executable, "-m", "bergtow", name, "--help"], capture_output=True, text=True,
                              env=os.environ | {"PYTHONPATH": str(ROOT / "postproc"), "BERGTOW": str(BERGTOW)})
        assert said.stdout == call(name, "--help").stdout


def test_the_package_in_a_python_without_numpy():
    said = subprocess.run([sys.executable, "-S", "-c", "import bergtow"], capture_output=True, text=True,
                          env=os.environ | {"PYTHONPATH": str(ROOT / "postproc")}).stderr
    assert "ImportError: bergtow needs numpy" in said and sys.executable in said and "python3-numpy" in said


def test_the_library_of_the_wheel_is_found_and_one_of_another_version_passed_over(tmp_path):
    """A tree like that of an installed wheel; before its own library comes one of another version."""
    package = tmp_path / "postproc/bergtow"
    shutil.copytree(ROOT / "postproc/bergtow", package, ignore=shutil.ignore_patterns("__pycache__"))
    other = tmp_path / "build/release/libbergtow.so.0"
    other.parent.mkdir(parents=True)
    subprocess.run(["gcc", "-shared", "-x", "c", "-", "-o", other], check=True, text=True,
                   input='const char *bt_version(void) { return "9.9.9"; }')
    env = {"BERGTOW_LIB": "", "LD_LIBRARY_PATH": ""}
    code = "from bergtow import _library; print(_library.library_path())"
    said = python(code, path=package.parent, **env)
    assert said.returncode == 1 and "is libbergtow 9.9.9, and this package is for" in said.stderr, said.stderr
    (package / "_lib").mkdir()
    (package / "_lib/libbergtow.so.0").symlink_to(LIBRARY)
    said = python(code, path=package.parent, **env)
    assert said.stdout.strip() == str(package / "_lib/libbergtow.so.0"), said.stderr


def test_everything_public_has_types_and_a_text():
    for name in bergtow.__all__:
        thing = getattr(bergtow, name)
        if not isinstance(thing, type) and not inspect.isfunction(thing):
            continue
        assert thing.__doc__, name
        members = vars(thing).items() if isinstance(thing, type) else [(name, thing)]
        for own, member in members:
            function = getattr(member, "fget", None) or getattr(member, "__func__", member)
            if inspect.isfunction(function):
                parameters = [p for p in inspect.signature(function).parameters if p not in ("self", "cls")]
                assert {*parameters, "return"} <= set(function.__annotations__), (name, own)


@pytest.mark.slow
def test_pip_installs_the_package_as_the_page_says(tmp_path):
    there = installed_by_pip(tmp_path)
    code = "import bergtow as b; print(b.__file__, b.Case({'run': {'dt': 0.1, 'duration': 1}})['run.dt'])"
    env = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"BERGTOW_LIB": str(LIBRARY)}
    said = subprocess.run([there / "python", "-c", code], capture_output=True, text=True, cwd=tmp_path, env=env)
    assert said.returncode == 0, said.stderr
    file, dt = said.stdout.split()
    assert file.startswith(str(there.parent)) and dt == "0.1"
    assert os.path.exists(file.replace("__init__.py", "py.typed"))
