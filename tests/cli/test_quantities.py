# SPDX-License-Identifier: MIT
"""Every registered quantity is where the registry says, in each file, picture and table, and survives a stop; so does
one from outside.

The program of the second half is bergtow with tests/examples/quantity.c and estimate.c linked to it. No name of a
quantity stands in what is tested: the program's list (--list-quantities --json) is held against what it leaves, and the
other way round.

Red with (tried): columns of registered quantities not in the checkpoint; a running total lost there; the sums of a
sample under way not restored; the sum over floes without the reduction over ranks; ghosts counted in it; a number of
the machine not marked as one; a role not written; units of ensemble.h5 forgotten; plot_resistance leaving one
estimate out; the ratio taken where an estimate is valid alone, in a run and in an ensemble; `knows` of an estimate
not asked; a registered quantity that does not apply left at 0 (the guard stops the run).
"""
import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

import resuming
from harness import (BERGTOW, DONE, ROOT, TOW, call, changed, differing, environment, launcher, machine_keys, quick,
                     script, write_case)

from bergtow.plot import ensemble as plot_ensemble
from bergtow.plot import force as plot_force
from bergtow.plot import resistance as plot_resistance
from bergtow.reporting import ensemble as report_ensemble
from bergtow.reporting import run as report_run
from bergtow.result.members import Members
from bergtow.result.run import Run

pytestmark = pytest.mark.usefixtures("look")
EXTENDED = os.path.join(os.path.dirname(BERGTOW), "tests/examples/extended")
SPEED = changed(TOW, run__duration=12, output__window_start=4, tow__ramp=8)
#: cases, and what each has of "with a ..." and "where ..."
LINE = {"with a towed body", "with a tow line", "with a tow line of two branches", "with a vessel",
        "where collisions are identified"}
WINDOW = {
    "run": {"dt": 0.1, "duration": 8},
    "domain": {"frame": "geographic", "length": 24, "width": 18, "ends": "moving", "sides": "periodic",
               "ahead": 14}, "ice": {"concentration": 0.5, "size": 1.2, "thickness": 0.04},
    "body": {"length": 2, "draft": 0.5}, "tow": {"speed": 1.6, "ramp": 1}, "water": {"latitude": 75}
}
CASES = {
    "line": (resuming.CASE, LINE),
    "window": (changed(WINDOW,
                       lead={"mode": "channel", "width": 3},
                       reference={"mean_force": "3 N", "source": "a test"}),
               {"with a towed body", "where collisions are identified", "with a moving window"}),
    "managed": (changed(SPEED, lead={"mode": "managed", "width": 3, "floe_size": 0.4},
                        impact__conversion="none"), {"with a towed body"}),
    "bare": (changed(SPEED, body={"shape": "none"}, tow=None, output__window_start=None), set()),
}


def started(program, *arguments, ranks=1, cwd=None, timeout=200):
    line = [*(launcher(ranks) if ranks > 1 else []), program, *map(str, arguments)]
    done = subprocess.run(line, cwd=cwd, env=environment(OMP_NUM_THREADS=1), capture_output=True, text=True,
                          timeout=timeout)
    assert done.returncode == DONE, done.stderr
    return done.stdout


def stamp(folder):
    """Of the last checkpoint."""
    try:
        return os.stat(folder / "checkpoint.h5").st_mtime_ns
    except FileNotFoundError:
        return None


def listed(program=BERGTOW):
    return json.loads(started(program, "--list-quantities", "--json"))


def of_run(folder, program, case):
    write_case(folder, case)
    said = started(program, "run", "case.yml", "-o", "out", cwd=folder)
    return folder / "out", said


@pytest.fixture(scope="module", params=[(name, program) for name in CASES for program in ("own", "extended")],
                ids="-".join)
def left(request, tmp_path_factory):
    """(list of the program, folder that a run of it left, what it said, what the case has)."""
    name, program = request.param
    program = BERGTOW if program == "own" else EXTENDED
    case, has = CASES[name]
    return listed(program), *of_run(tmp_path_factory.mktemp(name), program, case), has


def numbers(nested, prefix=""):
    """(dotted key, value or None) of all that is no text, list or object in a summary."""
    for key, value in nested.items():
        if isinstance(value, dict):
            yield from numbers(value, f"{prefix}{key}.")
        elif not isinstance(value, (str, list)):
            yield prefix + key, value


def generic(key, estimates):
    """A key of the summary as the list has it: NAME for that of a series or an estimate."""
    key = re.sub(r"^window\.series\.\w+\.", "window.series.NAME.", key)
    return re.sub(rf"^estimates\.({'|'.join(estimates)})\.", "estimates.NAME.", key)


def test_every_series_is_in_the_file_as_it_is_listed(left):
    quantities, folder, _, has = left
    with h5py.File(folder / "result.h5") as f:
        assert sorted(f["series"]) == sorted(q["name"] for q in quantities["series"])
        for order, q in enumerate(quantities["series"]):
            data = f["series"][q["name"]]
            attributes = {k: v.decode() if isinstance(v, bytes) else v for k, v in data.attrs.items()}
            assert attributes["order"] == order and [attributes[k] for k in ("units", "description", "applies")
                                                     ] == [q[k] for k in ("units", "description", "applies")]
            assert [attributes.get(k)
                    for k in ("role", "label", "summary")] == [q[k] for k in ("role", "label", "summary")], q["name"]
            there = q["applies"] == "always" or q["applies"] in has
            assert np.all(np.isfinite(data[()]) if there else np.isnan(data[()])), q["name"]
    assert {q["applies"] for q in quantities["series"]} - {"always"} >= has


def test_every_number_of_the_summary_is_listed(left):
    quantities, folder, said, has = left
    summary = json.loads((folder / "summary.json").read_text())
    names = [e["name"] for e in quantities["estimates"]]
    known = {k["name"]: k for k in quantities["summary"]}
    assert len(known) == len(quantities["summary"])
    for key, value in numbers({k: v for k, v in summary.items() if k != "estimate_labels"}):
        assert generic(key, names) in known, key
        assert known[generic(key, names)]["number"] or value is None, key
    if has:
        assert {k
                for k, v in summary["estimates"].items()
                if isinstance(v, dict)} - {"curves"} == set(names) == set(summary["estimate_labels"])
        assert set(summary["estimates"]["curves"]) - {"concentration", "valid_range"} == set(names)
        for e in quantities["estimates"]:
            assert summary["estimate_labels"][e["name"]].items() >= {"label": e["label"], "kind": e["kind"]
                                                                     }.items() and e["label"] in said
    assert all(k["description"] and (k["units"] or not k["number"]) for k in quantities["summary"])
    assert {k["name"].split(".")[0] for k in quantities["summary"] if k["machine"]} == {
        "wall_time_s", "ns_per_floe_step", "phases_s", "ranks", "threads", "divisions", "undivided_steps",
        "moved_floes", "imbalance",
        "worst_imbalance", "repartition_imbalance", "worst_repartition_imbalance", "edge_cut", "halo_share",
        "memory_per_floe_b", "sweep_bytes_per_contact", "call_s", "shared_s"
    }


def test_every_number_that_is_listed_is_in_some_summary(tmp_path):
    """Cases that have lead, window, collisions, reference, a bridle and crushing between them."""
    found, names = set(), [e["name"] for e in listed()["estimates"]]
    for name, (case, _) in CASES.items():
        folder, _ = of_run(tmp_path / name, BERGTOW,
                           changed(case, output__window_start="1 s") if case.get("tow") else case)
        found |= {generic(key, names) for key, _ in numbers(json.loads((folder / "summary.json").read_text()))}
    splitting = changed(TOW, ice__splitting={"toughness": 100, "least_size": 0.1})
    split = call("run", write_case(tmp_path / "split", splitting), "--steps", 2, "-o", tmp_path / "split/out")
    assert split.returncode == DONE, split.stderr
    found |= {key for key, _ in numbers(json.loads((tmp_path / "split/out/summary.json").read_text()))}
    missing = {k["name"] for k in listed()["summary"] if k["number"]} - found
    assert missing == set()


def test_pictures_and_report_follow_the_roles(left):
    quantities, folder, *_, has = left
    if not has:
        return
    by_role = {
        role: [q for q in quantities["series"] if q["role"] == role]
        for role in ("balance", "force", "load", "diagnostic")
    }
    with Run(folder) as run:
        drawn = [t.get_text() for t in plot_force.draw(run).axes[1].get_legend().get_texts()]
        forces = by_role["balance"] + by_role["force"]
        most = np.nanmax(np.abs(plot_force.running_mean(run["tow_force"], plot_force.smoothing(run)[0])), initial=0)
        for q in forces[:2]:
            assert q["label"] in drawn
        for q in forces:
            if np.nanmax(np.abs(plot_force.running_mean(run[q["name"]],
                                                        plot_force.smoothing(run)[0])), initial=0) > 0.05 * most:
                assert q["label"] in drawn, q["name"]
        panels = [axes.get_ylabel() for axes in plot_force.draw_diagnostics(run).axes]
        assert [p.split(" (")[0] for p in panels] == [q["label"] for q in by_role["diagnostic"]]
        rows = [row[0].split(",")[0] for row in report_run.forces(run) if "it parted" not in row[3]]
        for q in forces + by_role["load"]:
            assert (run.label(q["name"]) in rows) == (np.isfinite(run.number(q["summary"]))
                                                      or q["name"] in ("ice_resistance", "tow_force")), q["name"]
        for q in (q for q in by_role["diagnostic"] if q["name"] == "moving_ice"):
            assert np.isfinite(run.number(q["summary"]))
        rows = {row["label"]: row for row in report_run.estimates(run)}
        assert list(rows) == [e["label"] for e in quantities["estimates"]]
        for e in run.estimates.values():
            ratio = e.numbers["simulated_over_estimate"]
            assert (rows[e.label]["ratio"] != "–") == (e.numbers["compares"] and ratio is not None)
        if np.isfinite(run.number("mean_ice_resistance_n")):
            figure = plot_resistance.draw([plot_resistance.read(folder)])
            legend = {t.get_text() for t in figure.axes[0].get_legend().get_texts()}
            away = {line for t in figure.texts for line in t.get_text().splitlines()}  # out of the picture, and said so
            assert {e["label"] for e in quantities["estimates"] if e["kind"] == "ice resistance"} <= legend | away


@pytest.fixture(scope="module")
def ensemble(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ensemble")
    write_case(folder, changed(SPEED, run__duration=20, output__window_start=9, ice__concentration=0.2), "base.yml")
    study = {
        "title": "small", "base": "base.yml", "repeats": 3, "seed": 4, "parameters": {"ice.concentration": [0.2, 0.3]}
    }
    (folder / "study.yml").write_text(json.dumps(study))
    started(EXTENDED, "ensemble", "study.yml", "-o", "all", "--threads", 1, cwd=folder)
    return folder / "all"


@pytest.mark.slow
def test_every_number_of_a_member_is_in_the_ensemble(ensemble):
    quantities = listed(EXTENDED)
    names = [e["name"] for e in quantities["estimates"]]
    known = {k["name"]: k for k in quantities["summary"]}
    with h5py.File(ensemble / "ensemble.h5") as f:
        for m, name in enumerate(f["members/name"].asstr()[()]):
            summary = json.loads((ensemble / "members" / name / "summary.json").read_text())
            for key, value in numbers({k: v for k, v in summary.items() if k != "estimate_labels"}):
                meaning, column = known[generic(key, names)], "summary/" + key.replace(".", "_")
                if meaning["machine"]:
                    assert column not in f, key
                elif value is not None:
                    attributes = f[column].attrs
                    assert f[column][m] == value and attributes["key"] == key, key
                    assert all(attributes[k] == meaning[k] for k in ("description", "units")), key


@pytest.mark.slow
def test_a_quantity_and_an_estimate_from_outside_are_in_ensembles(ensemble, tmp_path):
    done = script("statistics", ensemble, "--resamples", 50)
    assert done.returncode == 0, done.stderr
    assert "energy of the strip" in done.stdout
    e = Members(ensemble)
    assert e.estimates["strip_energy"] == {"label": "energy of the strip", "on_top": False
                                           } and e.estimates["open_water_drag"]["on_top"]
    assert np.all(e.summary["max_moving_ice_kg"] > 0) and np.all(np.isfinite(e.summary["mean_carried_water_force_n"]))
    assert e.meaning["max_moving_ice_kg"]["units"] == "kg"
    statistics = json.loads((ensemble / "statistics.json").read_text())
    held = statistics["conditions"][0]["estimates"]
    assert held["strip_energy"]["ratio"] == pytest.approx(statistics["conditions"][0]["resistance"]["mean"] /
                                                          held["strip_energy"]["force"])
    assert held["lichey_hellmer"]["valid"] and held["lichey_hellmer"]["ratio"] is None  # the same from 15 to 90 %
    figure = plot_ensemble.draw_sweep(e, "ice.concentration")
    assert "energy of the strip" in [t.get_text() for t in figure.legends[0].get_texts()]
    assert "energy of the strip" in json.dumps(str(report_ensemble.context(ensemble)))


# ---- what the examples compute

def test_the_examples_are_what_they_say(tmp_path):
    folder, said = of_run(tmp_path, EXTENDED, changed(SPEED, output__frame_interval=0.1))
    summary = json.loads((folder / "summary.json").read_text())
    with h5py.File(folder / "result.h5") as f:
        carried, inertia, time = (f[f"series/{n}"][()] for n in ("carried_water_force", "inertia_force", "time"))
        # body.added_mass is 0.5 of the mass
        assert np.allclose(carried, inertia / 3, rtol=1e-9, atol=1e-9) and np.abs(carried).max() > 1
        mass = 910 * f["floes/area"][()] * f["floes/thickness"][()]
        moving = [mass[speed[:len(mass)] > 0.01].sum() for speed in f["frames/speed"][()][1:]]
        assert np.allclose(f["series/moving_ice"][()], moving, rtol=1e-12) and max(moving) > 10
        window = time >= summary["window"]["start_s"]
        assert summary["mean_carried_water_force_n"] == pytest.approx(carried[window].mean(), rel=1e-12)
        assert summary["max_moving_ice_kg"] == f["series/moving_ice"][()][window].max()
    e = summary["estimates"]["strip_energy"]
    c = summary["estimates"]
    assert 0.1 < c["speed_along_m_s"] < 0.13  # the window begins in the ramp
    assert e["force_n"] == pytest.approx(
        0.5 * 910 * c["thickness_m"] * c["width_m"] * c["speed_along_m_s"]**2 * c["concentration"], rel=1e-12)
    assert e["valid"] and not e["compares"] and e["simulated_over_estimate"] == pytest.approx(
        summary["mean_ice_resistance_n"] / e["force_n"])
    assert re.search(r"carried water +\S+ N \(mean\)", said) and re.search(r"moving ice +\S+ kg \(max\)",
                                                                           said) and "energy of the strip" in said


@pytest.mark.parametrize("name", quick(CASES, "window"))
@pytest.mark.ranks
def test_everything_survives_stop_and_resume(tmp_path, name):
    """Samples of three steps, stopped within one; resumed on other ranks than the whole run has."""
    case = changed(CASES[name][0], output__sample_every=3)
    write_case(tmp_path, case)
    started(EXTENDED, "run", "case.yml", "-o", "whole", cwd=tmp_path)
    started(EXTENDED, "run", "case.yml", "-o", "out", "--steps", 46, ranks=2, cwd=tmp_path)
    started(EXTENDED, "resume", "out", ranks=2, cwd=tmp_path)
    assert differing(tmp_path / "whole/result.h5", tmp_path / "out/result.h5") == []
    one, other = (json.loads((tmp_path / d / "summary.json").read_text()) for d in ("whole", "out"))
    assert {k for k in one if one[k] != other.get(k)} <= machine_keys() and one.keys() == other.keys()


@pytest.mark.slow
def test_everything_survives_a_kill(tmp_path):
    """kill -9 as soon as there is a checkpoint, and again after each resume, until the run has come to its end."""
    case = changed(resuming.CASE, output__checkpoint_steps=8)
    write_case(tmp_path, case)
    started(EXTENDED, "run", "case.yml", "-o", "whole", cwd=tmp_path)
    folder, kills = tmp_path / "out", 0
    arguments, last = ["run", "case.yml", "-o", "out"], None
    for _ in range(40):
        p = subprocess.Popen([EXTENDED, *arguments], cwd=tmp_path, env=environment(OMP_NUM_THREADS=1),
                             stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        while p.poll() is None and (not (folder / "checkpoint.h5").exists() or stamp(folder) == last):
            time.sleep(0.002)
        time.sleep(0.03)
        p.kill()
        assert p.wait() in (DONE, -signal.SIGKILL), p.stderr.read()
        if p.returncode == DONE:
            break
        kills += 1
        arguments, last = ["resume", "out"], stamp(folder)
    assert p.returncode == DONE and kills > 0
    assert differing(tmp_path / "whole/result.h5", folder / "result.h5") == []
    one, other = (json.loads((tmp_path / d / "summary.json").read_text()) for d in ("whole", "out"))
    assert {k for k in one if one[k] != other.get(k)} <= machine_keys() and one.keys() == other.keys()


def test_a_state_of_another_set_of_quantities_is_refused(tmp_path):
    write_case(tmp_path, SPEED)
    started(BERGTOW, "run", "case.yml", "-o", "out", "--steps", 20, cwd=tmp_path)
    done = subprocess.run([EXTENDED, "resume", "out"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 3 and "the run had no carried_water_force, which this program has added" in done.stderr


def test_the_report_gives_a_quantity_its_unit_and_its_rule():
    """Of a program, under the roles of forces: not as means in N."""
    of = {"winch_power": ("W", "max_winch_power_w", 11.0), "load": ("N", "sum_load_n", 248.0)}
    run = SimpleNamespace(
        towed=0, at_least=False, mean_name="mean over the window", summary={}, by_role=lambda *_: list(of),
        number=lambda key, *_: next((value for _, own, value in of.values() if own == key), np.nan),
        attribute=lambda name, what: of[name][0] if what == "units" else of[name][1],
        label=lambda name: name, description=lambda name: "")
    assert [row[:2] for row in report_run.forces(run)[:2]] == [
        ("winch_power, largest over the window", "11.0 W"), ("load, sum over the window", "248 N")]


@pytest.mark.parametrize("what", ["quantity", "estimate"])
def test_the_page_shows_the_code_that_is_tested(what):
    page = (ROOT / f"docs/how-to-add-{'a' if what == 'quantity' else 'an'}-{what}.md").read_text()
    code = re.findall(r"^```c\n(.*?)^```", page, re.S | re.M)[0]
    assert code == (ROOT / f"tests/examples/{what}.c").read_text()


def test_the_list_for_people_has_all_names():
    said = call("--list-quantities").stdout
    quantities = listed()
    words = {line.split()[0] for line in said.splitlines() if line.strip()}
    assert {q["name"] for kind in quantities.values() for q in kind} <= words
    refused = call("--list-quantities", "--jsn")
    assert refused.returncode == 2 and "--json" in refused.stderr


def test_python_names_no_estimate():
    """A list of names in postproc/ would miss the one that is added."""
    names = [e["name"] for e in listed()["estimates"]]
    found = [
        f"{path.name}: {name}" for path in Path(ROOT / "postproc").glob("bergtow/**/*.py") for name in names
        if name in path.read_text()
    ]
    assert found == []
