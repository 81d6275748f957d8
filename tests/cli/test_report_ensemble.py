# SPDX-License-Identifier: MIT
"""The report of an ensemble: the numbers of ensemble.py, every member with its doubts, nothing that a browser would
complain of."""
import argparse
import json
import re
import shutil

import numpy as np
import pytest

import made_up_ensemble as made_up
from browser import browser, complaints, opened
from harness import TOW, call, changed, write_case
from made_up_ensemble import FAILED, WAITING, member

from bergtow import cli
from bergtow.errors import RunError
from bergtow.plot import design_value as plot_design
from bergtow.reporting import ensemble as report_ensemble
from bergtow.reporting import method as report_method
from bergtow.result.members import Members
from bergtow.stats import conditions as ensemble
from bergtow.stats import profile as stat_profile
from bergtow.stats import variance as stat_budget
from bergtow.text import loads as loads_text
from bergtow.writing import plain

TITLE = "<script>window.hacked = 1</script> study & 50 %"
JAM = "the towed body stood still for 40 s of 600 s <i>: a jam"
OPTIONS = report_ensemble.OPTIONS | {"resamples": 20}


@pytest.fixture(scope="module", autouse=True)
def coarse():
    """Ends of intervals to a third: they take most of the time, and no test knows where they lie."""
    patch = pytest.MonkeyPatch()
    patch.setattr(stat_profile, "FINE", 0.3)
    yield
    patch.undo()


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Two concentrations of five fields, one of which failed, one is jammed; one more waits."""
    rng = np.random.default_rng(5)
    some = []
    for c, (concentration, mean) in enumerate([(0.2, 100.0), (0.5, 3000.0)]):
        for k in range(5):
            times = np.sort(rng.uniform(1, 599, 60))
            some.append(
                member(made_up.ar1(0.6, 600, rng, mean + 4 * k, 10.0), {"ice.concentration": concentration},
                       c, case=f"ice:\n  concentration: {concentration}\ndomain:\n  width: 10 m\n",
                       peaks=(times, rng.exponential(50.0, 60))))
    some[3] |= {"status": FAILED, "reason": "exit code 5: not <finite>"}
    some[6] |= {"warnings": [made_up.note("stalled", JAM)], "summary": {"stalled_windows": 2}}
    some[9] |= {"status": WAITING}
    return made_up.write(tmp_path_factory.mktemp("study") / "out", some, title=TITLE)


@pytest.fixture(scope="module")
def page(study, tmp_path_factory):
    """A browser at the page, which is made in this process with few resamples."""
    patch = pytest.MonkeyPatch()
    patch.setattr(report_ensemble, "OPTIONS", OPTIONS)
    path = tmp_path_factory.mktemp("elsewhere") / "page.html"
    cli.perform("report", study, "-o", path)
    patch.undo()
    with browser(tmp_path_factory.mktemp("profile")) as driver:
        driver.requests = [r for r in opened(driver, path) if not r.startswith("data:")]
        driver.path = path
        yield driver


def tables(page):
    """{heading: rows of texts} of the first table behind each heading."""
    return page.execute_script(
        """const rows = (s) => [...s.querySelectorAll('tr')].map((r) => [...r.cells].map((c) => c.textContent.trim()));
           const found = {}; let heading = null;
           for (const e of document.querySelectorAll('h2, h3, table')) {
             if (e.tagName !== 'TABLE') heading = e.textContent;
             else if (heading && !(heading in found)) found[heading] = rows(e);
           }
           return found"""
    )


def newtons(text):
    value, unit = re.match(r"([\d.]+)\*? (k?N)", text).groups()
    return float(value) * {"N": 1, "kN": 1000}[unit]


@pytest.mark.slow
def test_numbers_are_those_of_the_statistics(page, study):
    s = ensemble.statistics(Members(study), argparse.Namespace(**OPTIONS))
    found = tables(page)
    head, *rows = found["Mean ice resistance"]
    factor = 1000.0 if "kN" in head[2] else 1.0
    assert [row[0] for row in rows] == ["concentration 20\u00a0%", "concentration 50\u00a0%"
                                        ] and [row[1] for row in rows] == ["4 (1 failed)", "4 (1 waiting)"]
    for row, c in zip(rows, s["conditions"]):
        assert float(row[2]) * factor == pytest.approx(c["resistance"]["mean"], rel=0.006)
        assert [float(v) * factor for v in row[3].split(" to ")] == pytest.approx(c["resistance"]["t_95"], rel=0.006)
    assert rows[1][-1] == "1 J" and rows[0][-1] == "none"
    estimates = dict(zip(*found["Comparison with published estimates"][:2]))
    assert estimates["Lichey-Hellmer"].startswith("80") and "*" in estimates["compaction"]
    assert {"Distributions", "Peaks of collisions", "Members"} <= set(found)
    answer = found["Answer"]
    assert [row[0] for row in answer[1:]] == ["concentration 20\u00a0%", "concentration 50\u00a0%"]
    assert answer[1][-2] == "4"


def test_the_answer_is_the_design_statement(tmp_path):
    """Rounded to what the interval leaves; of fields that are long enough for a tail."""
    rng = np.random.default_rng(8)
    e = Members(made_up.write(tmp_path / "out", [
        member(made_up.ar1(0.6, 4000, rng, 137.0, 10.0), {"ice.concentration": 0.5 + 0.1 * c}, c)
        for c in range(2) for _ in range(8)]))
    s = ensemble.statistics(e, argparse.Namespace(**OPTIONS | {"resamples": 1}))
    d, blocks = s["conditions"][0]["design"]["tow"], report_ensemble.answer(e, s, [], {})
    row = next(b for b in blocks if b["kind"] == "table")["rows"][0]
    wide = max(abs(x - d["value"]) for x in d["interval_95"] if np.isfinite(x))
    assert abs(newtons(row[1]) - d["value"]) <= max(0.06 * wide, 0.006 * d["value"])
    assert ("*" in row[1]) == d["beyond_data"] and newtons(row[3]) == pytest.approx(d["mean"], rel=0.006)
    ends = row[2].removesuffix(" N").split(" to ")
    assert [float(v) for v in ends if v != "no bound"] == pytest.approx(
        [v for v in d["interval_95"] if np.isfinite(v)], abs=max(0.06 * wide, 0.006 * d["value"]))
    assert row[-1] == "8.82" and "8.82 hours of tow" in report_method.method(s, [])[1]  # in one way everywhere
    notes = " ".join(line for b in blocks if b["kind"] == "text" for line in b["lines"])
    assert [mark in notes for mark in report_ensemble.FOOTNOTES] == [mark in row[1] for mark in
                                                                     report_ensemble.FOOTNOTES]
    head = next(b for b in blocks if b["kind"] == "table")["head"]
    assert len(head) == len(row) and "in the start" not in head
    s["conditions"][0]["design"]["tow"]["start_up"] = {"largest": 1.01 * d["value"], "time_s": 30.0}
    with_start = next(b for b in report_ensemble.answer(e, s, [], {}) if b["kind"] == "table")
    started = dict(zip(with_start["head"], with_start["rows"][0]))
    assert newtons(started["in the start"]) == pytest.approx(1.01 * d["value"], rel=0.006)
    assert [started[name] for name in head] == row
    figure = next(b for b in blocks if b["kind"] == "figure")
    assert "design tow force, 95 %" in figure["svg"] and "largest simulated" in figure["svg"]
    one = s | {"conditions": s["conditions"][:1]}  # no chart of one point
    assert "figure" not in [b["kind"] for b in report_ensemble.answer(e, one, [], {})]


def labelled(label, n):
    """The picture of n conditions, its labels and its axes. label: k -> text."""
    tow = {"value": 9e5, "interval_95": [8e5, 1e6], "largest": 8e5, "mean": 5e5, "units": "N", "start_up": None}
    figure = plot_design.draw([{"label": label(k), "values": {"a": k, "b": -k}, "design": {
        "tension": None, "tow": tow}} for k in range(n)], {"a", "b"}, str, lambda key: 1)
    figure.draw_without_rendering()
    return figure, figure.axes[0].get_xticklabels(), figure.axes[0].get_position()


@pytest.mark.parametrize("words", [
    "concentration {0}0 %, tow speed 0.{0} m/s, thickness {0} m", "outlines data/flight/segmented/" + "x" * 120 + "{0}",
    ", ".join(["some key {0} m"] * 20)])
@pytest.mark.parametrize("n", [2, 6, 12])
def test_labels_of_conditions_are_within_the_picture(n, words):
    """Those of two parameters are long and slanted. Red: the concentration of the first was outside; of a longer label,
    or of twenty parameters, "bottom cannot be >= top"."""
    figure, labels, axes = labelled(words.format, n)
    for k, label in enumerate(labels):
        box = label.get_window_extent()
        assert len(label.get_text()) >= 30 and str(k) in label.get_text()
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.width
    assert axes.width > 0.6 and axes.height > 0.3


def test_labels_leave_room_for_the_picture():
    """Whatever their letters."""
    for n in (2, 12):
        _, _, axes = labelled(lambda k: ", ".join(["M" * 60] * 9), n)
        assert axes.width >= 0.299 and axes.height >= 0.299


def test_conditions_without_a_value_are_named_beside_the_largest():
    """Also where one of them has borne more: then the largest value is not the largest load."""
    def condition(label, largest, **value):
        return {"label": label, "design": {"tow": value | {"largest": largest, "start_up": None}}}
    known = condition("80 %", 8e5, value=9e5, interval_95=[8.5e5, 1e6])
    def said(*more):
        return report_ensemble.governing({"conditions": [known, *more]})
    assert said().startswith("Largest of these: 80\u00a0%, 900 kN (")
    assert said(condition("70 %", 7e5)).startswith("No value for 70\u00a0%. Largest of the others: 80\u00a0%, 900 kN")
    assert said(condition("70 %", 7e5), condition("90 %", 9.5e5)).startswith(
        "No value for 70\u00a0%, 90\u00a0%, but 950 kN in the simulation: the largest value of this study is not "
        "known. ")
    assert said({"label": "95 %", "design": {"tow": None}}).startswith("No value for 95\u00a0%. Largest")


@pytest.mark.parametrize("mode", [pytest.param("speed", marks=pytest.mark.slow), "line"])
def test_the_tension_is_named_where_there_is_a_line(tmp_path, monkeypatch, mode):
    """In title, method and answer; the direction varied between conditions stands in degrees."""
    monkeypatch.setattr(report_ensemble, "OPTIONS", OPTIONS | {"resamples": 1})
    monkeypatch.setitem(made_up.UNITS, "tow.direction", "rad")
    rng, line = np.random.default_rng(8), {"units": "N", "description": "first branch", "label": "line tension",
                                           "role": "load", "needs": "line", "order": 3}
    def one(c):
        x = made_up.ar1(0.6, 4000, rng, 137.0, 10.0)
        return member(x, {"tow.direction": c * np.pi / 4}, c, case=f"tow:\n  mode: {mode}\n  direction: 0 rad\n",
                      more={"tow_force": x} | ({"line_tension_1": x + 1} if mode == "line" else {}),
                      attributes={"tow_force": line | {"role": "balance", "needs": "body"},
                                  "line_tension_1": line})
    folder = made_up.write(tmp_path / "out", [one(c) for c in (0, 1) for _ in range(4)])
    cli.perform("report", folder, "-o", tmp_path / "page.html")
    text, there = (tmp_path / "page.html").read_text(), mode == "line"
    assert ("Design tow force and line tension in broken ice" in text) == there == ("Line tensions are" in text)
    assert ("Design tow force in broken ice" in text) != there and "statistics.json" not in text
    assert ("the tow force above is without dynamics of a line" in text) != there
    assert "varied, 0 to 45 deg" in text


def test_every_member_stands_there_with_its_doubts(page, study):
    rows = {row[0]: row for row in tables(page)["Members"][1:]}
    assert len(rows) == 10
    assert rows["c001-r004"][3] == "failed" and rows["c002-r005"][3] == "waiting" and rows["c002-r002"][
        6] == "jammed" and rows["c001-r001"][6] == "none"
    details = {
        d.find_element("tag name", "summary").get_attribute("textContent"): d.get_attribute("textContent")
        for d in page.find_elements("css selector", "#members details")
    }
    assert set(details) == {
        "c001-r004: failed", "c002-r002: 1 warning"
    } and JAM in details["c002-r002: 1 warning"] and "not <finite>" in details["c001-r004: failed"]
    warning = page.find_element("css selector", ".warning").text
    assert "1 member failed" in warning and "not complete: 1 member to come" in warning
    assert "1 of 8 members carries warnings" in warning
    assert "8 finished, 1 failed, 1 waiting" in page.find_element("id", "answer").text


def test_page_stands_alone_and_text_stays_text(page):
    assert page.requests == [page.path.resolve().as_uri()] and complaints(page) == []
    assert page.execute_script("return window.hacked") is None and page.find_element("tag name", "h1").text == TITLE
    assert page.find_elements("css selector", "script, #members i, img") == []
    assert page.execute_script("return [...document.querySelectorAll('figure svg')].every((s) => s.getBBox().width > "
                               "300)") and len(page.find_elements("css selector", "figure svg")) >= 2
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                         {"width": 380, "height": 800, "deviceScaleFactor": 1, "mobile": True})
    assert page.execute_script("return document.documentElement.scrollWidth") <= 380


def test_the_labels_of_the_keys_fit_into_the_columns_of_a_printed_page(page):
    """Red: "assumed" was wider than its cell, and the edge of the paper cut it in the last column."""
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                         {"width": 665, "height": 990, "deviceScaleFactor": 1, "mobile": False})  # A4 less its margins
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        left = page.execute_script("""return [...document.querySelectorAll("table.keys .kind")].map((s) => {
            s.textContent = s.className = "assumed"; s.classList.add("kind")
            return s.parentElement.getBoundingClientRect().width - s.getBoundingClientRect().width})""")
        assert left and min(left) >= 0
        assert page.execute_script("return getComputedStyle(document.querySelector('table.keys td:last-child')"
                                   ").display") == "none"
    finally:
        page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


@pytest.mark.slow
def test_members_of_other_builds_and_lost_folders_are_reported(study):
    with made_up.edited(study / "members/c001-r001/result.h5") as f:
        f.attrs["revision"] = "other"
    made_up.record(study / "members/c001-r001", Members(study).study)
    e = Members(study)
    assert "2 builds" in e.builds
    assert "2 builds" in " ".join(report_ensemble.context(study)["warnings"])
    (study / "members/c001-r002").rename(study / "members/lost")
    assert Members(study).without_folder == ["c001-r002"]
    (study / "members/lost").rename(study / "members/c001-r002")
    with made_up.edited(study / "members/c001-r001/result.h5") as f:
        del f.attrs["revision"]
    assert not Members(study).builds


@pytest.mark.slow
def test_convergence_budget_and_capability_are_chapters(study, tmp_path, monkeypatch):
    """What the other commands left beside the ensemble stands in its report, in the order of a reader's questions."""
    folder = shutil.copytree(study, tmp_path / "out")
    row = {"name": "width", "key": "domain.width", "unit": "m", "from": 10.0, "to": 20.0, "finer": "wider",
           "quantity": "mean ice resistance", "effect": -0.4, "interval_95": [-0.5, -0.3], "fields": 8,
           "judged": "matters", "recommended": 20.0, "same_ice": False}
    point = {"value": 0.5, "fields": 2, "made": 2, "parted": 0, "failed": 0, "speed": [0.4, 0.5], "mean_speed": 0.45,
             "mean_speed_95": [0.2, 0.7], "tow_force": [1e5, 2e5], "mean_tow_force": 1.5e5,
             "mean_tow_force_95": [None, None], "tension": [2e5, 3e5], "mean_tension": 2.5e5,
             "mean_tension_95": [None, None]}
    limit = {"label": "the case", "for": None, "makes_it": 0.5, "does_not": None, "estimate": None, "resolved": True,
             "why": "every value of the range passes", "runs": 5, "points": [point, point | {"value": 0.9}]}
    rng = np.random.default_rng(1)
    budget = stat_budget.budget({"ice.friction": np.repeat(rng.random(30), 2)}, np.repeat(np.arange(30), 2),
                                100 + rng.normal(size=60))
    found = {
        "converge": {"rows": [row], "looks": 5, "margin": 0.1, "spent_min": 2.0, "budget_min": 10},
        "budget": budget | {"title": "t", "of": "mean_ice_resistance_n", "units": "N", "meaning": "mean", "wanted": 60,
                            "assumed": {"ice.friction": {"distribution": "uniform from 0 to 1", "source": "a book"}}},
        "capability": {"case": "case.yml", "title": "t", "set": [], "search": "ice.concentration", "unit": "",
                       "range": [0.2, 0.95], "resolution": 0.05, "for": "", "for_unit": "", "speed": 0.3, "share": 0.5,
                       "most_fields": 12, "breaking_load": None, "budget_min": 5, "spent_min": 1, "grid_runs": 300,
                       "conditions": [limit]}
    }
    for name, content in found.items():
        (folder / f"{name}.json").write_text(json.dumps(plain(content)))
    monkeypatch.setattr(report_ensemble, "OPTIONS", OPTIONS)
    cli.perform("report", folder, "-o", tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    at = [text.rindex(words) for words in ("take 20 m, or wider", "uniform from 0 to 1; a book",
                                          "every value of the range passes")]
    assert at == sorted(at) and text.index("Assumptions") < at[0]
    assert text.count("<svg") >= 3 and str(tmp_path) not in text and "Not studied" not in text
    answered = text[:text.index("<h2>Limits of operation")]
    sd = f"{100 * budget['parameters']['sd'] / budget['mean']:.0f} % of the mean"
    told = {"assumed": [{"key": key, "low": "0.1", "high": "0.5", "source": "a paper"}
                        for key in ("ice.friction", "body.drag.water_form")]}
    assert report_ensemble.ranges({"budget": found["budget"]}, told) == {
        "ice.friction": ("uniform from 0 to 1", "a book"), "body.drag.water_form": ("0.1 to 0.5", "")}
    for words in ("every value of the range passes", "half of the tows no longer keep 0.300 m/s", "it depends on "
                  "width", sd):
        assert words in answered, words


def test_a_quantity_has_one_verdict(tmp_path):
    """That of the value which the tows have, and not of a finer one that was tried as well."""
    rows = [{"name": "dt", "judged": "matters", "from": 2.0, "to": 1.0},
            {"name": "dt", "judged": "none", "from": 1.0, "to": 0.5},
            {"name": "width", "judged": "none", "from": 10.0, "to": 20.0},
            {"name": "window", "judged": "none", "from": 10.0, "to": 30.0},
            {"name": "length", "judged": "open", "why": "the case has no domain.length"}]
    def said(name, **keys):
        case = "run:\n  dt: {dt}\ndomain:\n  width: {width}\n".format(**{"dt": "2 s", "width": "10 m"} | keys)
        some = [member(np.ones(50), {}, 0, case=case, start=10.0) for _ in range(2)]
        e = Members(made_up.write(tmp_path / name, some))
        return dict(report_method.beyond({"converge": {"rows": rows}}, e))["width, length, time step, tolerance, start"]
    assert said("a") == "it depends on dt; open is length; no effect that matters of width, window"
    assert said("b", dt="1 s") == "open is length; no effect that matters of dt, width, window"
    assert said("c", dt="0.5 s", width="40 m") == \
        "open is length; no effect that matters of window; not compared at the value of these tows: dt, width"
    for k, share in ((1, 0.47), (2, 0.83), (3, 0.69)):  # the first is not of the value that the tows have
        rows[k]["share_without"] = share
    assert said("d").endswith("; no effect that matters of width, window in at least 69 % of fields")


def test_results_of_another_case_or_of_before_are_doubted(tmp_path):
    case = "ice:\n  size: {} m\n"
    folder = made_up.write(tmp_path / "e", [member(np.ones(50), {}, 0, case=case.format(30)) for _ in range(2)])
    e = Members(folder)
    def said(name, place=folder, **found):
        place.mkdir(exist_ok=True)
        (place / f"{name}.json").write_text(json.dumps(found))
        return report_ensemble.results_beside(e, [place])[name]["doubt"]
    for name in ("budget", "capability", "converge"):
        assert said(name, values={"ice.size": "30 m"}) == said(name) == ""
        assert said(name, values={"ice.size": "20 m"}) == \
            "studied for another case: ice.size is 20 m there and 30 m here"
    now = report_ensemble.compared.state(e)
    assert said("budget", **now) == ""
    assert said("budget", **now | {"finished": 1}) == \
        "out of date, of 1 members, while 2 have finished: call bergtow budget again"
    (folder / "budget.json").unlink()
    assert said("budget", tmp_path / "alone", **now | {"finished": 1}) == ""  # no ensemble lies there


def test_a_limit_that_is_not_resolved_is_not_stated_as_one():
    base = {"makes_it": None, "does_not": None, "estimate": None, "resolved": False, "why": "", "label": "the case"}
    def said(doubt="", **found):
        c = base | found
        return [at for _, at in report_method._capability(
            {"search": "ice.concentration", "unit": "", "for": "", "speed": 0.3, "share": 0.5, "conditions": [c],
             "doubt": doubt})]
    assert said(makes_it=0.5, does_not=0.6, estimate=0.55, resolved=True) == ["about 55.0 %"]
    assert said(makes_it=0.95, estimate=0.78, resolved=True, why="every value of the range passes") == \
        ["every value of the range passes"]
    assert said(makes_it=0.39, estimate=0.227, why="12 fields do not decide an end of the range") == \
        ["about 22.7 %; not resolved: 12 fields do not decide an end of the range"]
    assert said(makes_it=0.2, does_not=0.9, why="not monotonic: at 0.5 0 of 6 succeed", doubt="of another case") == \
        ["between 20.0 % and 90.0 %; not resolved: not monotonic: at 0.5 0 of 6 succeed (of another case)"]


@pytest.mark.slow
def test_what_differs_between_conditions_stands_with_them(tmp_path):
    """Model, limits, line and keys of variants; and whose fields are the same. The first condition spoke for all."""
    base = changed(TOW, run__duration=4, ice__concentration=0.3, output__window_start=2,
                   domain={"length": 15, "width": 8, "ends": "open", "sides": "wall"},
                   tow={"mode": "line", "speed": 0.13, "ramp": 1, "line_stiffness": 5e4, "line_damping": 1000})
    write_case(tmp_path, base, "base.yml")
    (tmp_path / "study.yml").write_text("""\
base: base.yml
fields: common
repeats: 2
variants:
  rafting:
    ice.rafting.kappa: 10  # Flato
  more:
    ice.rafting.kappa: 17
  parts:
    tow.line.breaking_load: 90 kN
    tow.speed: 0.2 m/s
""")
    assert call("ensemble", "study.yml", "-o", "out", "--quiet", cwd=tmp_path).returncode == 0
    e = Members(tmp_path / "out")
    s = ensemble.statistics(e, argparse.Namespace(**OPTIONS | {"resamples": 1}))
    cases = report_ensemble.design_value.cases(e, s)
    limits = report_method.limits(cases)
    for said in ("For variant rafting; variant more: floes are rigid except that they slide over each other (raft) "
                 "above a load that grows with the square of their thickness, κ = 10 to 17. They do not break, bend or "
                 "crush.",
                 "For variant parts: floes are rigid: they neither break, bend, crush nor raft, so nothing limits the "
                 "force of a jam.", "For variant rafting; variant more: no line parts: the case sets no breaking load.",
                 "The towing end of the line moves as prescribed: the vessel neither slows down nor stops."):
        assert said in limits, said
    assert not any("The ice is not confined" in text for text in limits)  # its sides are walls
    rows = dict(report_method.holds(cases))
    assert rows["tow speed asked for"] == "0.13 m/s (variant rafting; variant more); 0.2 m/s (variant parts)"
    assert rows["breaking load of the line"] == \
        "none in the case: the tension above has no safety factor (variant rafting; variant more); 90.0 kN (variant " \
        "parts)"
    assert "6 tows in 3 conditions, whose ice is made from 2 seeds, the same in all conditions" in \
        report_method.method(s, cases)[1]
    values = {v.key: v for v in report_ensemble.varied(e, report_ensemble.first_runs(e, s))}
    assert values["ice.rafting.kappa"].value == "10 (variant rafting); 17 (variant more); 0 (variant parts)"
    assert values["ice.rafting.kappa"].origin == ("set by the study: Flato (variant rafting); set by the study; no "
                                                  "source stated (variant more); default, assumed (variant parts)")
    assert values["tow.branch2.breaking_load"].value == "0 N (variant rafting; variant more); 90000 N (variant parts)"
    assert values["ice.size"].value == "0.7 m" and values["ice.seed"].value == "varied"


@pytest.mark.parametrize("values, jams, said", [
    ({}, True, "Floes are rigid: they neither break, bend, crush nor raft, so nothing limits the force of a jam, and "
     "here they are dense enough to jam."),
    ({"splitting.toughness": "150000 Pa m^0.5"}, False,
     "Floes are rigid except that they split along straight lines at a toughness of 150000 Pa m^0.5. They do not bend, "
     "crush or raft. Nothing limits the force of a jam of pieces that are too small to split."),
    ({"splitting.toughness": "150000 Pa m^0.5", "crushing.pressure": "2000000 Pa", "rafting.kappa": "10"}, False,
     "Floes are rigid except that they split along straight lines at a toughness of 150000 Pa m^0.5, and they slide "
     "over each other (raft) above a load that grows with the square of their thickness, κ = 10, and their edges crush "
     "at 2000000 Pa. They do not bend.")])
def test_limits_tell_how_floes_give_way(values, jams, said):
    texts = {f"ice.{key}": value for key, value in values.items()}
    rigid = not {"crushing.pressure", "rafting.kappa"} & set(values)
    case = report_ensemble.design_value.Case(rigid, jams, "speed", {}, np.nan, 0.0, texts)
    assert said in report_method.limits([({"label": "the case", "values": {}, "units": {}}, case)])


def test_the_value_that_tells_texts_apart_names_the_conditions():
    def condition(a, b):
        return {"label": f"{a}, {b}", "values": {"ice.concentration": a, "variant": b},
                "units": {"ice.concentration": "1", "variant": ""}}
    grid = [condition(a, b) for a in (0.2, 0.5) for b in "xyz"]
    def said(*texts):
        return loads_text.qualified(loads_text.shared(list(zip(grid, texts))))
    assert said(*"pppppp") == ["p"] and said(*[""] * 6) == []
    assert said(*"ppqppq") == ["p (variant x; variant y)", "q (variant z)"]
    assert said("p", "p", "p", "", "", "") == ["p (concentration 20 %)"]
    assert said(*"pqqqqq")[0] == "p (0.2, x)"


def test_a_half_finished_ensemble(tmp_path, monkeypatch):
    """Conditions without a field, a member whose process died, one finished since the file was made: all reported,
    none a fault of the page."""
    monkeypatch.setattr(report_ensemble, "OPTIONS", OPTIONS)
    rng = np.random.default_rng(6)
    some = [
        member(made_up.ar1(0.6, 600, rng, 100.0, 10.0), {"ice.concentration": c}, k)
        | {"status": made_up.FINISHED if k == 0 else WAITING} for k, c in enumerate((0.2, 0.5, 0.8)) for _ in range(3)
    ]
    some[4] |= {"reason": "its process died in 1 attempt"}
    folder = made_up.write(tmp_path / "half", some)
    (folder / "members/c002-r001").mkdir(exist_ok=True)
    (folder / "members/c002-r001/finished").write_text("")
    cli.perform("report", folder)
    text = (folder / "report.html").read_text()
    for part in ("3 of 9 members in 3 conditions.", "not complete: 6 members to come",
                 "1 member of these finished after ensemble.h5 was made",
                 "1 member whose process died; the first: c002-r002: its process died in 1 attempt", "0 (3 waiting)",
                 "<code>c002-r002</code>: waiting", "3 finished, 0 failed, 6 waiting"):
        assert part in text, part
    assert text.count("no field finished") == 2


@pytest.mark.parametrize(
    "status, behind, reported",
    [(WAITING, False, "has no member that has finished; run the ensemble further"),
     (WAITING, True, "knows none of the 1 members that have finished; run `bergtow ensemble`"),
     (FAILED, False, "no member that has finished; 2 failed, the first: c001-r001: it is wrong; correct the study")])
def test_nothing_has_finished(tmp_path, status, behind, reported):
    folder = made_up.write(tmp_path / "out", [
        member(np.ones(600), {"ice.concentration": 0.5}, 0)
        | {"status": status, "reason": "it is wrong\n" if status == FAILED else ""} for _ in range(2)
    ])
    (folder / "members/c001-r001").mkdir(parents=True)
    if behind:
        (folder / "members/c001-r001/finished").write_text("")
    with pytest.raises(RunError) as error:
        cli.perform("report", folder)
    assert reported in str(error.value)
    (folder / "ensemble.h5").unlink()
    (folder / "study.resolved.yml").write_text("seed: 1\n")
    with pytest.raises(RunError, match="holds no ensemble.h5; .*run it again"):
        cli.perform("report", folder)


def test_an_unusable_ensemble_is_reported(tmp_path, capsys, monkeypatch):
    (tmp_path / "ensemble.h5").write_bytes(b"no")
    with pytest.raises(RunError, match="is not this program.s ensemble file"):
        cli.perform("report", tmp_path)
    assert not (tmp_path / "report.html").exists()
