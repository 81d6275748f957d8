# SPDX-License-Identifier: MIT
"""What the design report says beside its numbers: limits of operation, the check by hand, evidence, sources."""
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
from harness import ROOT, TOW, call, changed, run, write_case

from bergtow.plot import style
from bergtow.reporting import document
from bergtow.reporting import ensemble as report_ensemble
from bergtow.reporting import run as report_run
from bergtow.result import origins
from bergtow.result.members import Members
from bergtow.result.run import Run
from bergtow.stats import design_value

UNKNOWN = SimpleNamespace(bollard_pull=np.nan)


def condition(label, **tow):
    tow.setdefault("mean", tow["largest"] / 2)
    return {"label": label, "design": {"tow": tow}, "values": {"ice.concentration": int(label.split()[0]) / 100}
            if "%" in label else {}}


def value(key, text, kind="given", origin=""):
    return origins.Value(key, text, "", kind, origin)


CONDITIONS = {"conditions": [condition("50 %", value=4e5, interval_95=(3e5, 5e5), largest=3.9e5),
                             condition("70 %", value=7e5, interval_95=(6e5, 9e5), largest=6e5),
                             condition("90 %", largest=2e6)]}
MET = {"concentration of the ice": "varied, 50 to 90 %", "wind": "air wind x -10 m/s"}


def rows(cases, answer=None):
    text, table = document.operation(CONDITIONS, cases, MET, answer)
    return " ".join(text["lines"]), {row[0]: row[1:] for row in table["rows"]}


@pytest.mark.parametrize("load, expected", [
    ({"value": 4e5, "interval_95": (3e5, 5e5), "largest": 3e5}, 5e5),
    ({"value": 4e5, "interval_95": (3e5, np.inf), "largest": 3e5}, 4e5), ({"largest": 3e5}, 3e5)])
def test_the_load_that_a_limit_is_held_against(load, expected):
    """The upper end, where there is one."""
    assert document.load(condition("a", **load)) == expected


def test_without_a_vessel_no_limit_is_made_up():
    rule, found = rows([(None, UNKNOWN)])
    assert "No vessel is named" in rule and found["concentration of the ice"][0] == "varied, 50 to 90 %"
    assert found.pop("concentration of the ice")[1] == "no vessel to hold it against"
    assert {limit for _, limit in found.values()} == {"not looked for"}
    assert found["wind"][0] == "air wind x -10 m/s"
    assert found["thickness of the ice"][0] == "–"


def test_the_vessel_draws_the_limit_by_the_upper_ends():
    """70 % has a value below the pull and an upper end above it."""
    said = "within 800 kN, {0}: 50 %; above 800 kN, {0}: 70 %; 90 %"
    assert rows([(None, SimpleNamespace(bollard_pull=8e5))])[1]["concentration of the ice"][1] == said.format(
        "the bollard pull; at speed less of it is left")
    answer = {"speeds": [{"has_n": 9.5e5}, {"has_n": 8e5}, {"has_n": None}], "feasible": {"not_above_m_s": 0.6},
              "load_cases": [{"id": "case.head_sea", "n": 7.5e5, "values": {"wind_m_s": 15.0, "current_m_s": 0.25}}]}
    rule, found = rows([(None, UNKNOWN)], answer)
    assert found["concentration of the ice"][1] == said.format("pull of the vessel at the requested speed")
    assert "No vessel is named" not in rule
    assert found["speed of the tow"][1].startswith("not above 0.600 m/s")
    assert re.search(r"15\.0 m/s with 0\.250 m/s of current.* 750 kN", found["wind"][1])
    answer["load_cases"][0]["n"] = None
    assert rows([], answer)[1]["wind"][1] == "not looked for"


def test_the_pull_of_a_vessel_is_not_compared_with_a_force_that_holds_back():
    """Red: -260 kN "within" the pull of the vessel."""
    some = {"conditions": [condition("a", value=-2.6e5, largest=-2.5e5), condition("b", value=1e5, largest=1e5)]}
    assert document.held(some, 2e5, "pull") == "within 200 kN, pull: b; held back, not towed: a"


def test_limits_of_what_was_varied():
    """Thickness and wind that differ between conditions are held against the vessel; one that does not is not. Red:
    the concentration alone."""
    some = {"conditions": [condition(name, largest=n) | {"values": {"ice.thickness": h, "air.wind_x": w}}
                           for name, n, h, w in (("thin", 3e5, 0.8, -10.0), ("thick", 9e5, 1.6, -10.0))]}
    _, table = document.operation(some, [(None, SimpleNamespace(bollard_pull=8e5))], MET, None)
    found = {row[0]: row[2] for row in table["rows"]}
    said = found["thickness of the ice"]
    assert said.startswith("the largest simulated, a lower bound, within 800 kN") and said.endswith(": thick")
    assert found["wind"] == "not looked for"


def test_a_speed_that_was_varied_was_looked_at():
    """Red: "not looked for"."""
    answer = {"speeds": [{"speed_m_s": v, "has_n": 8e5, "feasible": f} for v, f in ((0.4, "yes"), (0.6, "held_back"))]}
    assert rows([], answer)[1]["speed of the tow"][1] == \
        "can the vessel named hold the steady tow? 0.400 m/s: yes, 0.600 m/s: held back"
    some = {"conditions": [condition(name, largest=n) | {"values": {"tow.speed": v}}
                           for name, n, v in (("slow", 3e5, 0.4), ("fast", 9e5, 0.6))]}
    for pull, said in ((8e5, ": slow; above"), (np.nan, "no vessel to hold it against")):
        _, table = document.operation(some, [(None, SimpleNamespace(bollard_pull=pull))], MET, None)
        assert said in next(row[2] for row in table["rows"] if row[0] == "speed of the tow")


def test_the_check_by_hand_is_that_of_the_numbers_it_names(tmp_path):
    """Each formula, with its numbers as they stand there, gives the force beside it; open water is the simulation's."""
    case = changed(TOW, output=None, run__duration=20, output__window_start=10, ice__concentration=0.3)
    with Run(run(tmp_path, case).dir) as opened:
        found, estimates = document.by_hand(opened), report_run.estimates(opened)
        drag, ice, both = found
        blocks = document.check(opened, estimates, "60 %")
    assert "first field (60 %)" in blocks[0]["lines"][0]
    for what, words, force, simulated, ratio in (drag, ice):
        product = eval(re.sub(r" (kg/m³|m/s|m)", "", words.partition(" = ")[2]).replace("½", "0.5").replace(
            "×", "*").replace("²", "**2"))
        n, unit = force.split()
        assert product == pytest.approx(float(n) * {"N": 1, "kN": 1e3}[unit], rel=0.01), words
        assert float(ratio) == pytest.approx(float(simulated.split()[0]) / float(n), rel=0.06)
    assert 0.97 < float(drag[4]) < 1.03  # skin and air beside it
    n = [float(row[2].split()[0]) for row in found]
    assert n[0] + n[1] == pytest.approx(n[2], rel=0.01)
    assert [row[0] for row in blocks[-1]["rows"]] == [e["label"] for e in estimates]


def test_what_was_simulated_differs_between_conditions_and_is_varied():
    some = [{"label": k, "values": {}, "units": {}} for k in "ab"]
    cases = [SimpleNamespace(texts={"ice.concentration": "0.5", "ice.thickness": h, "air.wind_x": "0 m/s",
                                    "air.wind_y": w, "water.tide.major": "0.5 m/s", "water.current_x": "0 m/s"})
             for h, w in (("0.80000000001 m", "0 m/s"), ("1 m", "-3 m/s"))]
    said = document.simulated(list(zip(some, cases)), {"ice.concentration": "varied, 50 to 90 %", "ice.size": "varied"})
    assert said == {"concentration of the ice": "varied, 50 to 90 %", "thickness of the ice": "0.8 m (a); 1 m (b)",
                    "size of the floes": "", "speed of the tow": "", "wind": "no wind (a); air wind y -3 m/s (b)",
                    "current": "water tide major 0.5 m/s", "draft of the berg": ""}
    assert set(document.simulated([], {}).values()) == {""}


def test_limits_are_those_of_what_was_simulated(tmp_path):
    """Of ice from a map, a wind from a table and a tide, beside a quay: as "Holds for" has them, and not the keys that
    had no effect. Red: 80 % ice of 3 m, no wind and no current, and a thickness with the quay in it."""
    assert call("field", write_case(tmp_path, changed(TOW, ice__concentration=0.3)), "-o",
                tmp_path / "made.geojson").returncode == 0
    (tmp_path / "wind.csv").write_text("t,u,v\n0,-12,0\n4,-16,0\n")
    quay = {"shape": "rectangle", "length": 12, "width": 0.5, "x": 8, "y": 3.7, "thickness": 2, "fixed": True}
    case = changed(TOW, output=None, run__duration=4, output__window_start=1, ice={"outlines": "made.geojson"},
                   air__wind_table="wind.csv", water__tide__major=0.05, domain__sides="open", floes=[quay])
    drawn = json.loads((tmp_path / "made.geojson").read_text())
    for feature in drawn["features"]:
        feature["properties"] = {"thickness": 0.05}
    drawn["features"] = [f for f in drawn["features"] if max(p[1] for p in f["geometry"]["coordinates"][0]) < 3]
    (tmp_path / "made.geojson").write_text(json.dumps(drawn))
    write_case(tmp_path, case, "base.yml")
    left = {"ice.concentration": 0.8, "ice.size": 40, "ice.thickness": 3}  # no effect
    study = {"base": "base.yml", "set": left, "parameters": {"body.draft": [0.4]}, "repeats": 1}
    done = call("ensemble", write_case(tmp_path, study, "study.yml"), "-o", tmp_path / "out", "--jobs", 1)
    assert done.returncode == 0, done.stderr
    found = report_ensemble.context(tmp_path / "out")
    table = {row[0]: row[1] for row in found["operation"][1]["rows"]}
    member = next((tmp_path / "out/members").iterdir())
    with Run(member) as r:
        n, share, size = r.summary["n_floes"] - 1, r.summary["concentration"], r.summary["mean_size_m"]
        assert r.summary["estimates"]["thickness_m"] == pytest.approx(0.05) and n > 50
        assert style.conditions(r).startswith(f"{100 * share:.0f} % ice, {n} floes, 0.05 m thick")
        rows = {v.key: v.value for v in origins.of_field(r)}
    assert (rows["floes"], rows["floe thickness"]) == (str(n), "0.05 m")
    assert rows["floe size"].startswith(f"{size:.3g} m") and "12" not in rows["floe size"]
    assert table == {"concentration of the ice": f"{share:.3g}", "thickness of the ice": "0.05 m",
                     "size of the floes": f"{size:.3g} m", "speed of the tow": "0.13 m/s",
                     "wind": "air wind table wind.csv (12.1 to 15.9 m/s)", "current": "water tide major 0.05 m/s",
                     "draft of the berg": "0.4 m"}
    members = Members(tmp_path / "out")
    holds = design_value._holds_for(members, design_value.case_of(members, np.array([0])))
    for words in (f"floes of {size:.3g} m", "0.05 m thick", table["wind"], table["current"]):
        assert words in holds


@pytest.mark.parametrize("wind_y, current", [(0, 0), (15, 0), (0, 0.3)])
def test_the_drag_of_the_wind_is_not_compared_with_that_of_the_water(tmp_path, wind_y, current):
    """Red: drag of the water by hand, with the wind in the simulated one; the square of the part of an oblique wind
    from ahead; the drag of a current from astern with the wrong sign."""
    case = changed(TOW, output=None, run__duration=20, output__window_start=10, ice__concentration=0.3, air__wind_x=-9,
                   air__wind_y=wind_y, water__current_x=current)
    with Run(run(tmp_path, case).dir) as opened:
        water, wind, drag, _, both = document.by_hand(opened)
    assert (water[3], water[4], wind[4]) == ("–", "–", "–") and 0.97 < float(drag[4]) < 1.03
    n = [float(row[2].split()[0]) for row in (water, wind, drag)]
    assert n[0] + n[1] == pytest.approx(n[2], rel=0.02) and n[1] > 0.2 * abs(n[0])


def test_the_check_is_of_the_condition_that_was_asked_for():
    """Red: the largest load of all, at a speed beside that of the case."""
    s = {"conditions": [condition("a", largest=1e5), condition("b", largest=2e5), condition("c", largest=9e5)]}
    told = {"conditions": [{"id": f"steady.{k + 1}"} for k in range(3)],
            "load_cases": [{"id": "case.start"}, {"id": "case.steady", "of": "steady.2"}]}
    assert report_ensemble.governs(s, told)["label"] == "b" and report_ensemble.governs(s, None)["label"] == "c"


def test_the_evidence_is_what_the_validation_says():
    """One wording: a verdict that changes there changes here."""
    text = (ROOT / "cases/validation/README.md").read_text(encoding="utf-8")
    table = dict(re.findall(r"^\| \[([^\]]+)\]\([^)]*\) \| (.+) \|$", text, re.M))
    assert {name.split(" in plastic")[0].replace(" in floes", ""): verdict for name, verdict in table.items()} == {
        name.replace(" in floes", ""): verdict for name, verdict in document.EVIDENCE}


def test_each_source_stands_once_with_what_is_from_it():
    some = [value(f"a.k{k}", "1", "source", "default: Smith 1999") for k in range(6)] + [
        value("a.x", "1", "assumed", "assumed"), value("a.y", "1", "source", "Jones 2001")]
    blocks = document.sources(some, [{"source": "Jones 2001", "label": "ramming"}])
    table = dict(next(b for b in blocks if b["kind"] == "pairs")["rows"][1:])
    assert table == {"Smith 1999": "a.k0, a.k1, a.k2, a.k3 and 2 more", "Jones 2001": "a.y, estimate: ramming"}


@pytest.mark.parametrize("wind", [0, -9])
def test_the_check_by_hand_follows_a_bent_tow(tmp_path, wind):
    """Red: water and wind along the first leg, which the body has left before the window."""
    case = changed(TOW, run__duration=45, output__window_start=30, domain__sides="periodic", ice__concentration=0.1,
                   tow__waypoints=[[4, 0], [4, 20]], tow__turn_radius=0.5, water__current_y=-0.05, air__wind_y=wind)
    with Run(run(tmp_path, case).dir) as opened:
        found = {row[0]: row for row in document.by_hand(opened)}
    speed, along = re.findall(r"× (\S+) m/s", found["drag of the water"][1])
    assert speed == along == "0.180"
    assert 0.97 < float(found["drag of water and wind" if wind else "drag of the water"][4]) < 1.03


def test_the_symbol_of_rafting_is_that_of_the_program():
    """q0 = κ/2 · energy, as in tests/cli/test_rafting_known.py. Red: half of it."""
    assert dict(document.SYMBOLS)["κ"].startswith("2 × work of rafting")
