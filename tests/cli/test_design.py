# SPDX-License-Identifier: MIT
"""From a case to the report to sign: the command, its page in a browser, and the PDF as it would be printed."""
import re
import shutil
import subprocess
import zlib
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
import yaml

import made_up_ensemble as made_up
from browser import browser, complaints, opened
from harness import BERGTOW, TOW, call, changed, environment, script, write_case
from script_copy import undrawn

from bergtow import cli
from bergtow import table as text_table
from bergtow.errors import RunError
from bergtow.plot import style
from bergtow.reporting import design, pdf
from bergtow.reporting import ensemble as report_ensemble
from bergtow.reporting import run as report_run
from bergtow.result import origins as report_case
from bergtow.result.members import Members
from bergtow.result.run import Run
from bergtow.stats import profile as stat_profile
from bergtow.study import domain_width
from bergtow.text import loads as loads_text

TITLE = 'Tiny "berg" <i>A</i> & 50 %'
CASE = changed(TOW, run={"dt": 0.1, "duration": 40, "title": TITLE}, output__window_start=8, domain__length=14,
               ice__concentration=0.3, ice__size=0.9, estimate__length_scale=400,
               report={"client": "Owners & Sons <x>", "project": "/home/secret/P-1", "author": "A. Author",
                       "revision": "B3"})
OPTIONS = report_ensemble.OPTIONS | {"resamples": 2}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder that the command leaves."""
    folder = tmp_path_factory.mktemp("design")
    write_case(folder, CASE)
    patch = pytest.MonkeyPatch()
    patch.setattr(report_ensemble, "OPTIONS", OPTIONS)
    patch.setattr(stat_profile, "FINE", 0.3)  # of intervals, most of the time; no test looks at one
    patch.setenv("BERGTOW", str(BERGTOW))
    cli.perform("design", folder / "case.yml", "-o", folder / "out", "--concentrations", "0.2,0.4", "--fields", "5",
                "--quiet", "--seed", "3")
    patch.undo()
    return folder / "out"


@pytest.fixture(scope="module")
def page(made, tmp_path_factory):
    with browser(tmp_path_factory.mktemp("profile")) as driver:
        driver.requests = [r for r in opened(driver, made / "report.html") if not r.startswith("data:")]
        yield driver


def printed(program, *arguments):
    result = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr
    return result.stdout


def pages_of(path):
    return printed("pdftotext", "-layout", path, "-").split("\f")[:-1]


# ---- the command

@pytest.mark.slow
def test_the_study_that_it_makes(made):
    study = yaml.safe_load((made / "design.yml").read_text())
    assert study["parameters"] == {"ice.concentration": [0.2, 0.4]} and study["repeats"] == 5 and study["seed"] == 3
    assert study["set"] == {"output.panels": True}
    assert study["base"] == "../case.yml" and study["title"] == f"{TITLE}: ice concentration 20 to 40 %"
    e = Members(made)
    assert e.complete and e.n == 10 and not list(made.glob("replay-*"))
    assert {"report.html", "report.pdf", "replay.html", "ensemble.h5"} <= {p.name for p in made.iterdir()}


@pytest.mark.parametrize("across, sides, extent, there, needed, width", [
    ("domain.width", "periodic images", 2500, 31.2249, 77, 6170),
    ("domain.width", "periodic images", 2500, 31.2249, 31, None),
    ("domain.width", "periodic images", 2500, 31.2249, None, None),
    ("domain.width", "walls", 2500, 31.2249, 77, None),
    ("domain.width", "periodic images", 10, 4.996, 30, 60.1),
    ("domain.length", "periodic images", 10, 4.996, 30, None), # of a tow along y: what widens it is another question
])
def test_the_width_that_the_ice_needs(across, sides, extent, there, needed, width):
    assert domain_width.wide_enough({"across": across, "sides": sides, "width_m": extent, "body_widths": there,
                                     "body_widths_needed": needed}) == width


PERIODIC = changed(CASE, domain={"width": 5, "sides": "periodic"}, run__duration=10, output__window_start=2)


@pytest.mark.parametrize("case, more, wider", [
    (PERIODIC, (), {"ice.concentration=0.45": {"domain.width": "20.1 m"}}),
    pytest.param(PERIODIC, ("--keep-width",), None, marks=pytest.mark.slow),
    pytest.param(PERIODIC, ("--set", "domain.width=6 m"), None, marks=pytest.mark.slow),
    pytest.param(changed(PERIODIC, domain__y0=-2.5), (), None, marks=pytest.mark.slow),
    pytest.param(PERIODIC, ("--set", "domain.sides=wall"), None, marks=pytest.mark.slow)
])
def test_dense_ice_gets_the_width_that_it_needs(tmp_path, monkeypatch, capsys, case, more, wider):
    write_case(tmp_path, case)
    monkeypatch.setattr(report_ensemble, "OPTIONS", OPTIONS)
    monkeypatch.setattr(report_run, "picture", undrawn)
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    out = tmp_path / "out"
    cli.perform("design", tmp_path / "case.yml", "-o", out, "--concentrations", "0.2,0.45", "--fields", "1",
                "--quiet", "--no-pdf", "--no-replay", "--no-load-cases", *more)
    assert yaml.safe_load((out / "design.yml").read_text()).get("with") == wider
    narrow = 3 if "domain.width=6 m" in more else 2.5
    widths = list(Members(out).summary["domain_body_widths"])
    assert widths == pytest.approx([narrow, 10 if wider else narrow], rel=0.01)
    assert ("at 45 % the domain is made 20.1 m wide" in capsys.readouterr().out) == bool(wider)
    page = (out / "report.html").read_text()
    assert ("domain is narrow for this ice" in page) == (not wider)
    if wider:  # what it holds for is said of each condition, and the keys show both
        assert "domain 5 m wide (concentration 20 %), domain 20.1 m wide (concentration 45 %), time step" in page
        assert "5 m (concentration 20 %); 20.1 m (concentration 45 %)" in page


def test_values_set_beside_the_case_are_those_of_the_study(tmp_path, monkeypatch):
    """Red: what the study of several speeds or winds has under `with`, no --set could change."""
    write_case(tmp_path, CASE)
    monkeypatch.setattr(report_ensemble, "OPTIONS", OPTIONS)
    monkeypatch.setattr(report_run, "picture", undrawn)
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    cli.perform("design", tmp_path / "case.yml", "-o", tmp_path / "out", "--fields", "1", "--quiet", "--no-pdf",
                "--no-replay", "--no-load-cases", "--speeds", "0.26 m/s", "--set", "run.duration=20 s", "--set",
                "output.window_start=4 s", "--set", "ice.concentration=0.2", "--winds", "2 m/s",
                "--set", "air.wind_y=1 m/s", "--set", "ice.friction=0.1")
    e, found = Members(tmp_path / "out"), set()
    for m in range(e.n):
        with Run(e.folder(m)) as run:
            found.add(tuple(run.value(key) for key in ("tow.speed", "run.duration", "air.wind_x", "air.wind_y")))
            assert (run.value("ice.concentration"), run.value("ice.friction")) == (0.2, 0.1)
    assert e.complete and found == {(0.13, 20, 0, 1), (0.13, 20, -2, 0), (0.26, 10, 0, 1), (0.26, 10, -2, 0)}


@pytest.mark.parametrize("command", ["design", "converge", "budget"])
@pytest.mark.parametrize("place", ["taken", "taken/deeper"])
def test_a_file_in_place_of_the_folder(tmp_path, command, place):
    write_case(tmp_path, CASE)
    (tmp_path / "study.yml").write_text(yaml.safe_dump({
        "base": "case.yml", "sampling": "latin-hypercube", "samples": 8, "parameters": {"ice.friction": {
            "from": 0.1, "to": 0.3, "distribution": "uniform", "source": "assumed"}}}))
    (tmp_path / "taken").touch()
    result = script(command, "study.yml" if command == "budget" else "case.yml", "-o", place, cwd=tmp_path)
    assert result.returncode == 4 and result.stderr.endswith(
        "taken: is a file where a folder is needed; give another folder with -o DIR\n"), result.stderr


def test_a_replay_for_which_no_time_is_left_is_named(made, capsys):
    before = {p.name: p.stat().st_mtime_ns for p in made.iterdir()}
    a = cli.arguments("design", str(made.parent / "case.yml"), "-o", made)
    design.make_replay(design.Work(BERGTOW, made, [], 2, np.inf, True, 0.0), a, -3.0)
    assert "no replay" in (said := capsys.readouterr().out) and "and 0 s of the budget are left" in said
    assert {p.name: p.stat().st_mtime_ns for p in made.iterdir()} == before


@pytest.mark.parametrize("value, low, high, words", [
    (123456.0, 100000.0, 150000.0, ("123 kN", "100 to 150 kN")),
    (123456.0, 20000.0, 1.2e6, ("123 kN", "20 to 1200 kN")),
    (947e3, 924e3, 2200e3, ("947 kN", "920 to 2200 kN")),
    (5.2e6, 4.13e6, np.inf, ("5.20 MN", "4.1 to no bound MN")),
    (595.2e3, 593e3, 597e3, ("595 kN", "593 to 597 kN")),
    (12.0, np.nan, np.nan, ("12.0 N", "–")), (0.0, 0.0, 0.0, ("0 N", "–")),
    (17.0, 0.0, np.inf, ("17.0 N", "0 to no bound N")), (1049e3, 900e3, 3200e3, ("1050 kN", "900 to 3200 kN")),
    (1051e3, 1050.5e3, 9000e3, ("1050 kN", "1050 to 9000 kN"))
])
def test_numbers_have_the_digits_that_they_are_worth(value, low, high, words):
    assert text_table.stated(value, low, high, "N", -np.inf) == words


@pytest.mark.parametrize("value, largest, words", [
    (1049e3, 1040e3, "1050 kN"), (1044e3, 1043e3, "1050 kN"), (1043e3, 1044e3, "1040 kN"), (1e6, 1e6, "1000 kN"),
    (999.4e3, 999.2e3, "1000 kN"), (2.004e6, 2.003e6, "2.01 MN"), (1400e3, 2e5, "1400 kN")
])
def test_a_value_is_not_rounded_below_the_largest_simulated(value, largest, words):
    """In the answer, the sentence on the largest with its tonnes-force, which are those of the number that stands
    there, and the table of the terminal."""
    d = {"value": value, "interval_95": (0.9 * value, 3 * value), "largest": largest, "beyond_data": False,
         "start_up": None}
    assert text_table.stated(value, *d["interval_95"], "N", largest)[0] == words
    said = report_ensemble.governing({"conditions": [{"label": "c", "design": {"tow": d}}]})
    newtons = float(words.split()[0]) * {"kN": 1e3, "MN": 1e6}[words.split()[1]]
    assert f"c, {words} ({text_table.number(newtons / 9806.65)} tonne-force)" in said
    assert abs(newtons / value - 1) < 0.006 and (value < largest or newtons > 0.999999 * largest)
    assert float(loads_text.value(d, 1e3)[0]) == pytest.approx(newtons / 1e3)


@pytest.mark.parametrize("value, largest, model, beyond, marks", [
    (890e3, 842e3, "GPD", True, "*"), (1192e3, 1184e3, "GEV", True, "*†‡"), (1180e3, 1190e3, "GPD", False, "‡"),
    (850e3, 700e3, "GEV", False, "†"), (854e3, 842e3, "GPD", True, "*‡")
])
def test_a_value_is_marked_by_its_tail(value, largest, model, beyond, marks):
    d = {"value": value, "interval_95": (value - 17e3, value + 166e3), "largest": largest, "model": model,
         "beyond_data": beyond, "mean": 0.0}
    assert report_ensemble.marks(d) == marks and all(mark in report_ensemble.FOOTNOTES for mark in marks)


def test_angles_are_in_degrees():
    some = ("1.3089969389957472 rad", "0 rad", "-1.5707963267948966 rad/s", "0 s 0.5235987755982988 rad", "3 m")
    assert [report_case.short(v) for v in some] == ["75 deg", "0 deg", "-90 deg/s", "0 s 30 deg", "3 m"]


@pytest.mark.parametrize("title, left", [
    ("Berg in 80 % broken ice", "Berg in broken ice: ice concentration 60 to 90 %"),
    ("Tow at 80 % of its speed", "Tow at 80 % of its speed: ice concentration 60 to 90 %"),
    (None, "berg: ice concentration 60 to 90 %")
])
def test_the_title_names_no_other_concentration(title, left):
    assert design.title_of({"run": {"title": title}}, "berg", [0.6, 0.9]) == left
    assert design.title_of({"run": {"title": title}}, "berg", []) == (title or "berg")


def test_levels_have_the_digits_that_they_are_worth():
    some = (99.96, 1642.0, 0.09996, 1.5e7, None)
    assert [text_table.number(v) for v in some] == ["100", "1640", "0.100", "1.5e+07", "–"]
    assert text_table.level(1642.0, (87.44, 1e4), 1.0) == ("1640", "100 to 10000")
    assert text_table.level(616.0, (467.0, 8770.0), 1.0) == ("616", "470 to 8770")
    assert text_table.level(681.4e3, (667.2e3, 709.4e3), 1e3) == ("681", "667 to 709")
    assert text_table.level(1642.0, (87.44, np.inf), 1e3) == ("1.64", "0.1 to no bound")
    assert text_table.level(1642.0, (np.nan, np.nan), 1e3) == ("1.64", "–")
    assert text_table.level(3.0, (-0.04, 5.0), 1.0) == ("3.00", "0.0 to 5.0")  # no minus zero
    assert text_table.level(203e3, (3929.0, np.inf)) == ("2.03e+05", "3900 to no bound")  # red: from 0
    assert text_table.level(203e6, (3.929e6, 3e8), 1e6) == ("203", "3.9 to 300")
    assert text_table.level(203e3, (0.0, np.inf)) == ("2.03e+05", "0 to no bound")
    assert report_case.short("2.60245e-16 m") == "0 m" and report_case.short("-3.24837e-17 m") == "0 m"


def test_what_is_refused(made, tmp_path, monkeypatch):
    def said(*arguments, **more):
        return script("design", *arguments, cwd=tmp_path, env=environment(**more))
    write_case(tmp_path, CASE)
    assert said("none.yml").returncode == 4 and said("case.yml", "--concentrations", "0.99").returncode == 2
    other = said("case.yml", "--also", ".", "-o", "none")
    assert other.returncode == 4 and "holds none of converge.json, budget.json" in other.stderr
    assert not (tmp_path / "none").exists()
    wrong = said("case.yml", "--set", "ice.sise=1")
    assert wrong.returncode == 3 and "did you mean ice.size" in wrong.stderr and "Traceback" not in wrong.stderr
    # another study than that of the folder: nothing of the old one is taken for it
    old = shutil.copytree(made, tmp_path / "old")
    before = (old / "report.html").read_bytes()
    other = said("case.yml", "-o", "old", "--concentrations", "0.2,0.4", "--seed", "3", "--set", "ice.friction=0.1")
    assert other.returncode == 3 and "another study" in other.stderr and (old / "report.html").read_bytes() == before
    monkeypatch.setattr(pdf, "NAMES", ("no-such-browser",))
    with pytest.raises(RunError, match="not installed.*apt-get install chromium"):
        cli.perform("design", tmp_path / "case.yml", "-o", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_budget_that_does_not_reach(tmp_path, monkeypatch):
    long = changed(CASE, run__duration=2000, domain__length=280)
    write_case(tmp_path, long)
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    with pytest.raises(RunError, match="are not enough for one field.*raise --budget"):
        cli.perform("design", tmp_path / "case.yml", "-o", tmp_path / "out", "--budget", "0.05", "--concentrations",
                    "0.5", "--quiet")


def test_a_field_that_failed_is_no_end_of_the_budget(tmp_path, monkeypatch):
    """Red: one failure ended the call, the study was cut to the fields before it, and nobody heard of it."""
    path = write_case(tmp_path, CASE)
    asked = []

    def ensemble(study, failing=("c001", 1)):
        repeats = yaml.safe_load(study.read_text())["repeats"]
        asked.append(repeats)
        made_up.write(tmp_path / "out", [
            made_up.member(np.full(3, 10.0 + r), {"ice.concentration": 0.2 + 0.2 * c}, c, reason="it jammed",
                           status=made_up.FAILED if (c, r) == (0, 1) else made_up.FINISHED)
            for c in range(2) for r in range(repeats)])
        return True
    (tmp_path / "out").mkdir()
    for name, value in (("seconds_a_field", 1.0), ("widths", {})):
        monkeypatch.setattr(design, name, lambda *a, value=value: value)
    a = cli.arguments("design", path, "-o", tmp_path / "out", "--fields", "8", "--no-replay", "--concentrations",
                      "0.2,0.4")
    work = SimpleNamespace(ensemble=ensemble, jobs=2, began=design.time.monotonic(), core=0.0, program=BERGTOW)
    design.run_case(work, a, {name: {} for name in design.SECTIONS})
    assert asked == [2, 8] and design.fields_settled(tmp_path / "out") == 8
    assert "c001-r002" in Members(tmp_path / "out").holes()
    asked.clear()  # a later call begins with what is there
    design.run_case(work, a, {name: {} for name in design.SECTIONS})
    assert asked == [8] and design.fields_settled(tmp_path / "nowhere") == 0


@pytest.mark.parametrize("ice, asked, fields", [
    ({"outlines": "floes.geojson"}, None, 1), ({}, None, 1), ({}, [0.0], 1), ({}, [0.0, 0.3], 9)])
def test_ice_that_no_seed_changes_gets_one_field(ice, asked, fields, tmp_path, monkeypatch, capsys):
    """Every other one would be the same run. Red: open water was refused for its study's repeats, which the user has
    not written."""
    monkeypatch.setattr(design.answer, "plan", lambda *a: {"core_s": 1.0, "gives": "return_level"})
    monkeypatch.setattr(design.answer_text, "plan", lambda plan: "the plan")
    a = cli.arguments("design", tmp_path / "case.yml", "-o", tmp_path, "--fields", "9")
    a.concentrations = asked
    case = {name: {} for name in design.SECTIONS} | {"ice": ice}
    design.planned(a, case, {"case": {"ice.concentration": "0"}, "speed": 1.0, "window_start": -1.0}, 0.0)
    assert a.fields == fields and ("one field is run" in capsys.readouterr().out) == (fields == 1)
    study = yaml.safe_load(design.write_study(a, case, a.fields, {}).read_text())
    assert study["repeats"] == fields and ("parameters" in study) == (not ice)


def test_the_title_block_of_a_study(tmp_path):
    write_case(tmp_path, changed(CASE, run__duration=1, output__window_start=0.2), "case.yml")
    study = {"base": "case.yml", "report": {"client": "Another", "revision": "Z"}}
    (tmp_path / "study.yml").write_text(yaml.safe_dump(study))
    assert call("ensemble", "study.yml", "-o", "out", "--quiet", cwd=tmp_path).returncode == 0
    with Run(tmp_path / "out/members/c001-r001") as run:
        block = dict(report_case.title_block(run.case, run.attributes, {"author": "Somebody"}))
    assert block["client"] == "Another" and block["revision"] == "Z" and block["author"] == "Somebody"
    assert block["project"] == "P-1"
    for wrong, words in (({"clent": "x"}, "study.yml:.*report.clent: unknown key; did you mean report.client"),
                         ("x", "report: needs keys with values"), ({"client": ["x"]}, "single values")):
        (tmp_path / "study.yml").write_text(yaml.safe_dump(study | {"report": wrong}))
        result = call("ensemble", "study.yml", "-o", "bad", "--quiet", cwd=tmp_path)
        assert result.returncode == 3 and re.search(words, result.stderr), result.stderr
    both = study | {"set": {"report.client": "Third"}}
    (tmp_path / "study.yml").write_text(yaml.safe_dump(both))
    assert "is also in `set`" in call("ensemble", "study.yml", "-o", "bad", cwd=tmp_path).stderr


# ---- the page

APPENDICES = ["Loads", "Mean ice resistance", "Members", "Every key", "Study", "Provenance"]
HEADINGS = ["Answer", "Limits of operation", "Method", "Model and its limits", "Assumptions", "Convergence",
            "Uncertainty budget", "Independent check", "Validation evidence", "References, symbols and standards",
            *APPENDICES]


@pytest.mark.slow
def test_the_answer_comes_first_and_all_else_in_order(page, made):
    chapters = [h.text for h in page.find_elements("tag name", "h2")]
    tables = ["Load cases", "What the tow force is made of", "What is assumed", "Speeds"]
    assert chapters == HEADINGS[:1] + tables + [h for h in HEADINGS[1:] if h != "Uncertainty budget"]
    assert page.requests == [(made / "report.html").resolve().as_uri()] and complaints(page) == []
    assert page.find_element("tag name", "h1").text == f"{TITLE}: ice concentration 20 to 40 %"
    block = page.find_element("css selector", "table.block").text
    assert "Owners & Sons <x>" in block and "revision B3" in block and "secret" not in block
    assert page.find_element("link text", "replay of one tow").get_attribute("href") == (
        made / "replay.html").resolve().as_uri()


def test_it_holds_every_key_and_labels_what_is_assumed(page, made):
    with Run(made / "members/c001-r001") as run:
        keys = list(run.case)
        kinds = {v.key: v.kind for v in report_case.values(run)}
    def column(selector):
        return page.execute_script("return [...document.querySelectorAll(arguments[0])].map((e) => e.textContent)",
                                   f"{selector} tbody th")
    assert column("#keys") == keys
    assumed = column("#assumed")
    labelled = {k for k, kind in kinds.items() if kind in ("assumed", "memory", "reported") and not k.startswith(
        report_ensemble.PERSONAL)}
    computed = {k for k in labelled if k.startswith(report_ensemble.NUMERICAL)}
    assert labelled - computed <= set(assumed) and computed and not computed & set(assumed)
    label = "//section[@id='keys']//tr[th='solver.tolerance']"  # in the appendix, with its label
    assert "assumed" in page.find_element("xpath", label).text
    row = page.find_element("xpath", "//section[@id='assumed']//tr[th='ice.friction']").text
    assert "0.3" in row and "given" in row


def test_figures_follow_the_dark(page):
    """Every text and line of a figure stands off its ground in either mode, and no figure is a picture."""
    assert page.find_elements("css selector", "img, figure image") == []
    look = """
        const rgb = (c) => (c.match(/[\\d.]+/g) || []).map(Number);
        const light = ([r, g, b]) => [r, g, b].map((v) => v / 255).map((v) => v <= 0.04045 ? v / 12.92 :
            ((v + 0.055) / 1.055) ** 2.4).reduce((s, v, k) => s + v * [0.2126, 0.7152, 0.0722][k], 0);
        const paper = light(rgb(getComputedStyle(document.body).backgroundColor)), out = [];
        for (const e of document.querySelectorAll('figure text')) {
            const ink = light(rgb(getComputedStyle(e).fill));
            out.push((Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05));
        }
        return [paper, Math.min(...out), out.length]"""
    papers = []
    for mode in ("light", "dark"):
        page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme",
                                                                          "value": mode}]})
        paper, least, count = page.execute_script(look)
        assert least > 4 and count > 50, (mode, least)
        papers.append(paper)
    assert papers[0] > 0.9 and papers[1] < 0.05
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_it_fits_a_phone(page):
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                         {"width": 390, "height": 800, "deviceScaleFactor": 1, "mobile": True})
    assert page.execute_script("return document.documentElement.scrollWidth") <= 390
    page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


# ---- the PDF

def streams(path):
    """All that stands in a PDF, unpacked."""
    raw = path.read_bytes()
    out = [raw]
    for found in re.finditer(rb"stream\r?\n(.*?)\r?\nendstream", raw, re.S):
        try:
            out.append(zlib.decompress(found[1]))
        except zlib.error:
            pass
    return b"\n".join(out)


def test_pages_of_the_pdf(made):
    """Numbered "n of N", headed by title and revision; none is half empty but the last."""
    pages = pages_of(made / "report.pdf")
    n = len(pages)
    assert 8 <= n <= 25
    for k, text in enumerate(pages):
        lines = [line for line in text.splitlines() if line.strip()]
        assert lines[-1].split() == ["bergtow", str(k + 1), "of", str(n)]
        assert lines[0].strip().startswith(f"{TITLE}: ice concentration 20 to 40 %")
        assert lines[0].endswith("revision B3")


def test_the_ink_on_the_pages(made, tmp_path):
    from PIL import Image
    printed("pdftoppm", "-r", "20", "-gray", made / "report.pdf", tmp_path / "p")
    filled = []
    for path in sorted(tmp_path.glob("p-*.pgm")):
        ink = np.asarray(Image.open(path)) < 200
        body = ink[int(0.08 * len(ink)):int(0.92 * len(ink))]
        filled.append(np.flatnonzero(body.any(axis=1)).max() / len(body))
    assert min(filled[:-1]) > 0.55, filled


def test_the_pdf_reads_in_order_and_is_searchable(made):
    text = " ".join("\n".join(pages_of(made / "report.pdf")).split())
    # what is assumed stands in the answer, in place of the budget
    chapters = [re.search(rf" (\d+) {re.escape(h)} ", text) for h in HEADINGS[:-len(APPENDICES)]
                if h != "Uncertainty budget"]
    numbers = [int(found[1]) for found in chapters]  # the tables of the answer are chapters, too
    assert numbers[0] == 1 and numbers == sorted(set(numbers)), numbers
    places = [found.start() for found in chapters] + [
        text.index(f" Appendix {letter} {h} ") for letter, h in zip("ABCDEF", APPENDICES)]
    assert places == sorted(places) and text.index("Owners & Sons <x>") < places[0]
    raw = re.sub(r"\s+", "", printed("pdftotext", "-raw", made / "report.pdf", "-"))
    with Run(made / "members/c001-r001") as run:
        assert [k for k in run.case if k not in raw] == []
    assert "signature" in text and "prepared" in text


def test_fonts_are_embedded_and_figures_are_vectors(made):
    fonts = printed("pdffonts", made / "report.pdf").splitlines()[2:]
    assert fonts and all(re.search(r" yes (yes|no ) yes ", line) for line in fonts), fonts
    assert printed("pdfimages", "-list", made / "report.pdf").splitlines()[2:] == []


def test_no_path_of_the_machine_is_reported(made):
    """Neither in the page nor anywhere in the PDF; the replay is a run's report."""
    for name in ("report.html", "report.pdf"):
        content = streams(made / name)
        for word in (b"/tmp", b"/work", b"/home", b"secret", str(made.parent).encode(), b"file:"):
            assert word not in content, (name, word)


@pytest.mark.parametrize("text, left", [
    ("bergtow run /tmp/a/b.yml -o ../x/y/out", "bergtow run b.yml -o out"),
    ("1/2 rho_i kg/m3 N/m", "1/2 rho_i kg/m3 N/m"),
    ("base: /home/me/cases/berg.yml # x", "base: berg.yml # x"), ("~/work/a.h5: no", "a.h5: no"),
    ("m/s or km/h", "m/s or km/h"), ("/events of result.h5", "/events of result.h5")
])
def test_paths_are_cut(text, left):
    assert report_case.scrubbed(text) == left


@pytest.mark.slow
def test_the_report_of_a_run_as_pdf(made, tmp_path):
    path = tmp_path / "run.pdf"
    cli.perform("report", made / "members/c001-r001", "-o", path, "--revision", "Q")
    pages = pages_of(path)
    assert "Published and derived estimates" in "".join(pages) and "revision Q" in pages[0] and "Replay" not in pages[0]


# ---- figures

def test_logarithmic_axes_are_labelled():
    locator = style.LogTicks()
    for low in (1e-3, 0.7, 40.0):
        for span in (1.2, 1.7, 3, 8, 40, 1e4, 1e9):
            ticks = locator.tick_values(low, low * span)
            assert 2 <= len(ticks) <= 9, (low, span)
            assert ticks.min() >= low * 0.999 and ticks.max() <= low * span * 1.001, (low, span)


def test_only_what_is_in_sight_is_in_the_legend():
    axes = Figure().subplots()
    x = np.linspace(0, 1, 11)
    axes.plot(x, x, label="through it")
    axes.plot(x, x + 20, label="above")
    axes.plot([-5, 6], [0.4, 0.6], label="across")
    axes.plot([3], [0.5], "o", label="beside")
    axes.plot([0.5, np.nan, 0.6], [-9, np.nan, 9], label="never joined")
    axes.plot([0.5, 2], [0.5, np.nan], label="no line")
    axes.axhline(0.5, label="level")
    axes.plot(x, x + 30, label="in part")  # an estimate: beyond its range it is dotted, under the same name
    axes.plot(x, x / 2, ":", label="in part")
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)
    handles, labels, lost = style.legend_of(axes)
    assert labels == ["through it", "across", "level", "in part"]
    assert lost == ["above", "beside", "never joined", "no line"]
    assert handles[-1].get_linestyle() == ":"
