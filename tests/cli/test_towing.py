# SPDX-License-Identifier: MIT
"""Line, vessel and berg in closed form (bergtow.towing), and the simulated line against it."""
import json
import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from bergtow import BergtowError, Case, towing
from harness import CASE, call, changed, run, texts, write_case

pytestmark = pytest.mark.usefixtures("library")

LENGTH, EA, WEIGHT = 400.0, 300e6, 200.0
# A berg in open water without drag: what moves it is the line.
BERG = {
    "run": {"dt": 0.1, "duration": 200},
    "domain": {"frame": "geographic", "length": 3000, "width": 900, "ends": "open", "sides": "open"},
    "ice": {"concentration": 0, "size": 40, "thickness": 1},
    "body": {"length": 80, "draft": 30, "x": -1200, "y": 0,
             "drag": {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0}},
    "tow": {"mode": "line", "speed": 0.5, "ramp": 0, "line_length": LENGTH, "line_stiffness": EA, "line_damping": 0},
    "output": {"sample_every": 1},
}
VESSEL = {"mass": 5e6, "added_mass": 0, "bollard_pull": 1e-3, "free_speed": 50, "free_resistance": 0}


@pytest.fixture(scope="module")
def mass():
    """Of the berg with its added mass, kg, by hand: a prism that floats."""
    listed = json.loads(call("--list-keys", "--json").stdout)["keys"]
    default = {k["name"]: float(k["default"].split()[0]) for k in listed
               if k["name"] in ("water.density", "body.added_mass")}
    return default["water.density"] * math.pi * 40 ** 2 * 30 * (1 + default["body.added_mass"])


# --- the catenary ----------------------------------------------------------------------------------------------------

def hung(pull, length=LENGTH, stiffness=EA, weight=WEIGHT):
    """Span and sag by integration of the line's own equations from the middle to an end."""
    def slopes(s, _):
        tension = math.hypot(pull, weight * s)
        stretch = 1 / tension + 1 / stiffness
        return [pull * stretch, weight * s * stretch]
    end = solve_ivp(slopes, (0, length / 2), [0, 0], rtol=1e-11, atol=1e-12).y[:, -1]
    return 2 * end[0], end[1]


@pytest.mark.parametrize("pull", [2e3, 4e4, 2e5, 3e6])
def test_the_catenary_is_the_line_that_hangs(pull):
    line = towing.Catenary(LENGTH, EA, WEIGHT)
    span, sag = hung(pull)
    assert line.span(pull) == pytest.approx(span, rel=1e-9) and line.sag(pull) == pytest.approx(sag, rel=1e-9)
    assert line.pull(line.span(pull)) == pytest.approx(pull, rel=1e-7)
    step = 1e-4 * pull
    assert line.stiffness_at(pull) == pytest.approx(
        2 * step / (hung(pull + step)[0] - hung(pull - step)[0]), rel=1e-4)
    assert line.tension(pull) == math.hypot(pull, WEIGHT * LENGTH / 2)
    assert line.energy(pull) == pytest.approx(quad(line.pull, 0, span, limit=400, epsrel=1e-8)[0], rel=1e-6)


def test_a_line_without_weight_is_the_limit():
    """A spring beyond its length, nothing within it."""
    line = towing.Catenary(LENGTH, EA, 1e-3)
    assert line.pull(LENGTH + 4) == pytest.approx(EA / LENGTH * 4, rel=1e-6)
    assert line.pull(LENGTH - 4) < 10 and line.pull(0) == 0
    assert line.stiffness_at(3e6) == pytest.approx(EA / LENGTH, rel=1e-6)


def test_numbers_without_a_line_are_refused():
    for numbers in ((0, EA, WEIGHT), (LENGTH, -1, WEIGHT), (LENGTH, EA, 0), (math.nan, EA, WEIGHT)):
        with pytest.raises(BergtowError, match="is not above zero; give"):
            towing.Catenary(*numbers)
    with pytest.raises(BergtowError, match="^pull: 0 is not above zero"):
        towing.Catenary(LENGTH, EA, WEIGHT).span(0)


def test_the_simulated_line_is_the_catenary(tmp_path):
    """At every step the pull is the root of the catenary's span, the tension that at the ends; it starts as documented,
    and its weight is in the resolved case, and in a run that is resumed."""
    r = run(tmp_path, changed(BERG, run__dt=0.5, run__duration=1200, tow__ramp=300, tow__line={"weight": WEIGHT},
                              body__drag=None), "--quiet")
    span, pull, tension = r.series("line_length", "tow_force", "line_tension")
    assert pull.min() < 2e5 and pull.max() > 6e5  # slack and taut

    def root(distance):
        return brentq(lambda h: 2 * h / WEIGHT * np.arcsinh(WEIGHT * LENGTH / 2 / h) + h * LENGTH / EA - distance,
                      1e2, 1e9, xtol=1e-9, rtol=1e-13)
    assert pull == pytest.approx([root(s) for s in span], rel=1e-7)
    assert tension == pytest.approx(np.hypot(pull, WEIGHT * LENGTH / 2), rel=1e-12)
    assert pull[0] == pytest.approx(2 * WEIGHT * LENGTH, rel=1e-3)
    again = run(tmp_path, r.dir / "case.resolved.yml", "--quiet", "--steps", 700, name="again")
    assert call("resume", again.dir, "--quiet").returncode == 0
    assert json.loads((again.dir / "summary.json").read_text())["state_hash"] == r.hash


def test_the_damping_of_a_line_that_sags_is_that_of_its_stretch(tmp_path):
    """What the pull has beyond the catenary's is c q² times the rate of the span, q the share of the stretch in it."""
    damping = 5e6
    r = run(tmp_path, changed(BERG, run__dt=0.5, run__duration=600, tow__ramp=300, body__drag=None,
                              tow__line={"weight": WEIGHT}, tow__line_damping=damping), "--quiet")
    span, pull = r.series("line_length", "tow_force")
    line = towing.Catenary(LENGTH, EA, WEIGHT)
    static = np.array([line.pull(s) for s in span[:-1]])
    share = np.array([line.stiffness_at(p) for p in static]) * LENGTH / EA
    damped = damping * share ** 2 * np.diff(span) / 0.5
    assert share.min() < 0.1 and share.max() > 0.5 and damped.max() > 5e4
    assert np.abs(pull[:-1] - static - damped).max() < 1e-3 * damped.max()


def test_a_line_with_weight_that_is_too_stiff_for_the_step_is_stable(tmp_path):
    """A hundred times as stiff and forty times the step: no swing, and in the end the same tow."""
    case = changed(BERG, body__drag=None, run__duration=4000, tow__ramp=1300, tow__line={"weight": WEIGHT},
                   tow__line_stiffness=100 * EA, tow__line_damping=None)
    fine = run(tmp_path, changed(case, run__dt=0.5), "--quiet", name="fine").series("tow_force")
    coarse = run(tmp_path, changed(case, run__dt=20), "--quiet", name="coarse").series("tow_force")
    assert coarse[-1] == pytest.approx(fine[-1], rel=0.01) and coarse.max() < 1.05 * fine.max()


def test_a_line_of_next_to_no_weight_is_the_straight_one_in_long_steps(tmp_path):
    """A jerk, at a step of two periods: the same scheme, slack or taut."""
    case = changed(BERG, run__dt=20, run__duration=400, body__drag=None, tow__line_stiffness=100 * EA)
    pulls = [run(tmp_path, changed(case, tow__line={"weight": w}), "--quiet", name=f"w{w}").series("tow_force").max()
             for w in (0, 1e-3)]
    assert pulls[0] > 1e6 and pulls[1] == pytest.approx(pulls[0], rel=0.02)


def test_a_branch_with_weight_breaks_by_the_tension_at_its_ends(tmp_path):
    """The pull at which it parts lies below the breaking load by what the weight adds."""
    heavy = changed(BERG, tow__line={"weight": "2 kN/m", "breaking_load": "2 MN"}, tow__ramp=60)
    r = run(tmp_path, heavy, "--quiet")
    (event, _) = r.summary["events"]
    assert event["kind"] == "line_broken" and 2e6 < event["value"] < 2.01e6
    tension, pull = r.series("line_tension", "tow_force")
    at = int(np.argmax(tension))
    assert tension[at] == event["value"] and pull[at] == pytest.approx(math.sqrt(event["value"] ** 2 - 4e5 ** 2))
    assert (tension[at + 1:] == 0).all()


def test_two_branches_with_weight_share_the_pull(tmp_path):
    """Alike on either side, they bear the same, and each is a catenary."""
    r = run(tmp_path, changed(BERG, run__dt=0.5, run__duration=400, tow__ramp=200, body__drag=None,
                              tow__line={"weight": WEIGHT, "branches": 2}), "--quiet")
    one, two, span, force = r.series("line_tension_1", "line_tension_2", "line_length", "tow_force")
    assert one == pytest.approx(two, rel=1e-6) and one.max() > 2e5
    line = towing.Catenary(LENGTH, EA, WEIGHT)
    pulls = np.array([line.pull(s) for s in span])
    assert one == pytest.approx([line.tension(p) for p in pulls], rel=1e-6)
    assert (force < 2 * pulls).all() and (force > 1.9 * pulls).all()


def test_a_weight_without_a_line_is_refused(tmp_path):
    r = call("check", write_case(tmp_path, changed(BERG, tow={"mode": "speed", "speed": 0.5,
                                                                "line": {"weight": "200 N/m"}})))
    assert r.returncode == CASE and "tow.line.weight" in r.stderr


# --- snap loads and starts -------------------------------------------------------------------------------------------

def test_snap_load_of_two_masses(tmp_path, mass):
    """A vessel that drifts off at 0.5 m/s takes up a line that is just slack: v √(k m), m = m1 m2/(m1 + m2); by the
    reduced mass, not by that of either body."""
    r = run(tmp_path, changed(BERG, run__dt=0.02, run__duration=60, tow__mode="thrust", tow__vessel=VESSEL), "--quiet")
    expected = towing.snap_load(0.5, EA / LENGTH, towing.effective_mass(mass, VESSEL["mass"]))
    assert expected == pytest.approx(0.5 * math.sqrt(EA / LENGTH * mass * 5e6 / (mass + 5e6)))
    assert r.series("line_tension").max() == pytest.approx(expected, rel=2e-3)


def test_snap_load_with_a_static_pull(tmp_path, mass):
    """The vessel pulls on: S + √(S² + v² k m), with S the thrust's share that accelerates the berg."""
    pull = 2e6
    vessel = VESSEL | {"bollard_pull": pull}
    r = run(tmp_path, changed(BERG, run__dt=0.02, run__duration=60, tow__mode="thrust", tow__vessel=vessel,
                              tow__programme=[[0, 0.5], [1, 20]], tow__speed=None, tow__ramp=None), "--quiet")
    static = pull * mass / (mass + 5e6)
    expected = towing.snap_load(0.5, EA / LENGTH, towing.effective_mass(mass, 5e6), static)
    assert r.series("line_tension").max() == pytest.approx(expected, rel=5e-3)
    assert expected > static + towing.snap_load(0.5, EA / LENGTH, towing.effective_mass(mass, 5e6))
    assert towing.snap_load(0, EA / LENGTH, mass, static) == 2 * static
    assert towing.snap_load(0.5, EA / LENGTH, mass, static, static) == static + towing.snap_load(0.5, EA / LENGTH, mass)


def test_snap_load_of_a_line_that_sags(tmp_path, mass):
    """The sag takes up some of the motion: by the energy of the catenary."""
    r = run(tmp_path, changed(BERG, run__dt=0.02, run__duration=120, tow__mode="thrust", tow__vessel=VESSEL,
                              tow__line={"weight": WEIGHT}), "--quiet")
    line, both = towing.Catenary(LENGTH, EA, WEIGHT), towing.effective_mass(mass, VESSEL["mass"])
    expected = towing.snap_load_catenary(line, 0.5, both, 2 * WEIGHT * LENGTH)
    assert r.series("tow_force").max() == pytest.approx(expected, rel=2e-3)
    assert expected < 0.9 * towing.snap_load(0.5, EA / LENGTH, both)
    # all but without weight, from all but no pull: that of a spring
    light = towing.Catenary(LENGTH, EA, 1e-3)
    assert towing.snap_load_catenary(light, 0.5, both, 1) == pytest.approx(
        towing.snap_load(0.5, EA / LENGTH, both), rel=1e-3)


@pytest.mark.parametrize("share", [0.2, 0.7, 1.0, 1.5])
def test_the_start_load_by_its_ramp(tmp_path, mass, share):
    """A ramp of a share of the period: the largest tension and the swing that is left."""
    k = EA / LENGTH
    period = 2 * math.pi * math.sqrt(mass / k)
    ramp = share * period
    r = run(tmp_path, changed(BERG, run__duration=round(ramp + 1.2 * period), tow__ramp=ramp), "--quiet")
    time, tension = r.series("time", "line_tension")
    assert tension.max() == pytest.approx(towing.start_load(ramp, 0.5, k, mass), rel=2e-3)
    if math.sin(2 * math.pi * share) > -1e-9:  # else the line goes slack, and the berg, undamped, overtakes its end
        jerk = towing.start_load(0, 0.5, k, mass)
        left = towing.swing_after(ramp, 0.5, k, mass)
        assert tension[time > ramp + 0.2].max() == pytest.approx(left, abs=5e-3 * jerk)


@pytest.mark.parametrize("held", [0, 5e4, 8e5, 5e6])
def test_a_start_against_a_resistance(held):
    """A constant one, by integration: the berg is held until the line pulls as hard. One that grows with the speed to
    the same value loads the line no more."""
    k, m, v = EA / LENGTH, 2e8, 0.5
    period = 2 * math.pi * math.sqrt(m / k)

    def peak(ramp, resistance):
        t, dt, way, y, u, most = 0.0, period / 4000, 0.0, 0.0, 0.0, 0.0
        while t < ramp + 2 * period:
            t += dt
            way += dt * v * min(1, t / ramp)
            pull = max(0, k * (way - y))
            most = max(most, pull)
            u = max(0, u + dt * (pull - resistance(u)) / m)
            y += dt * u
        return most

    for share in (0.02, 0.4, 0.8, 3):
        bound = towing.start_load(share * period, v, k, m, held)
        assert bound == pytest.approx(peak(share * period, lambda u: held), rel=3e-3)
        assert peak(share * period, lambda u: held * (u / v) ** 2) <= bound * 1.003


def test_a_start_with_drag_stays_below_that_with_a_constant_resistance(tmp_path, mass):
    """The simulated berg in water: its drag at the full speed as the resistance."""
    r = run(tmp_path, changed(BERG, body__drag=None, run__dt=0.5, run__duration=1500, tow__ramp=150), "--quiet")
    tension, drag, speed = r.series("line_tension", "drag_force", "speed_through_water")
    full = drag[-1] * (0.5 / speed[-1]) ** 2
    bound = towing.start_load(150, 0.5, EA / LENGTH, mass, full)
    assert full > 1e5 and 0.7 * bound < tension.max() < bound


def test_the_ramp_of_a_load_is_the_shortest():
    k, mass, speed = EA / LENGTH, 2e8, 0.5
    jerk = towing.start_load(0, speed, k, mass)
    assert jerk == pytest.approx(speed * math.sqrt(k * mass))
    for held in (0, 3e5, 6e6):
        loads = [towing.start_load(ramp, speed, k, mass, held) for ramp in np.geomspace(1, 1e5, 400)]
        assert (np.diff(loads) <= 1e-9 * jerk).all()
        for share in (0.05, 0.6, 2 / math.pi, 0.7, 0.99):
            ramp = towing.ramp_for(share * jerk + held, speed, k, mass, held)
            assert towing.start_load(ramp, speed, k, mass, held) == pytest.approx(share * jerk + held, rel=1e-9)
            assert towing.start_load(0.98 * ramp, speed, k, mass, held) > share * jerk + held
    assert towing.ramp_for(0.3 * jerk, speed, k, mass) == pytest.approx(2 * mass * speed / (0.3 * jerk))
    assert towing.ramp_for(1.01 * jerk, speed, k, mass) == 0
    assert towing.ramp_for(3e5, speed, k, mass, 3e5) == math.inf
    period = 2 * math.pi * math.sqrt(mass / k)
    assert towing.swing_after(2 * period, speed, k, mass) < 1e-9 * jerk


# --- bollard pull and breaking load ----------------------------------------------------------------------------------

def test_bollard_pull_for_a_force():
    assert towing.needed_bollard_pull(8e5, 1, free_speed=5) == pytest.approx(8e5 / (1 - 1 / 25))
    assert towing.needed_bollard_pull(8e5, 1, free_speed=5, curve="linear", weather=0.8, tow=0.9,
                                      own_resistance=1e5) == pytest.approx(9e5 / (0.8 * 0.8 * 0.9))
    points = [(0.5, 1.0), (2.5, 0.5)]
    assert [towing.pull_share(v, curve=points) for v in (0, 1, 2.5, 9)] == [1, 0.875, 0.5, 0.5]
    assert towing.needed_bollard_pull(8e5, 6, free_speed=5) == math.inf
    assert towing.tonnes(980665) == pytest.approx(100)
    assert towing.utilisation(5e5, 2e6, 3) == 0.75 and towing.needed_breaking(5e5, 3) == 1.5e6
    for words in ({"free_speed": 5, "weather": 1.1}, {"free_speed": 5, "tow": 0}, {}, {"curve": "cubic"}):
        with pytest.raises(BergtowError, match="; give"):
            towing.needed_bollard_pull(8e5, 1, **words)


def test_bollard_pull_is_that_of_the_simulated_vessel(tmp_path):
    """What `check` says is left for the line at a speed."""
    case = changed(BERG, tow__mode="thrust", tow__vessel=VESSEL | {"bollard_pull": 1e6, "free_speed": 2})
    said = [x for x in call("check", write_case(tmp_path, case)).stdout.splitlines() if x.startswith("vessel")]
    left = float(said[0].split(": ")[-1].split()[0])
    assert towing.needed_bollard_pull(left, 0.5, free_speed=2) == pytest.approx(1e6)


@pytest.mark.parametrize("text, said", [
    ("speed,share\n1,1\n", ":1: the header is not"), ("speed_m_s,share\n1,x\n", ":2: share: 'x'"),
    ("speed_m_s,share\n1,1\n1,0.5\n", ":3: speed_m_s: 1 is not above 1"), ("speed_m_s,share\n", ":1: there is no row")])
def test_a_curve_that_is_none(tmp_path, text, said):
    file = tmp_path / "curve.csv"
    file.write_text(text)
    with pytest.raises(BergtowError) as error:
        towing.read_curve(file)
    assert str(error.value).startswith(f"{file}{said}") and error.value.status == CASE
    file.write_text("speed_m_s,share\n0,1\n\n4,0\n")
    assert towing.read_curve(file) == [(0, 1), (4, 0)]


def test_own_resistance_in_ice_is_the_estimate_of_a_ship(tmp_path):
    """That of the program for a ship of this beam, to its last bit."""
    case = changed(BERG, ice={"concentration": 0.7, "size": 40, "thickness": 1.2}, tow={"mode": "speed", "speed": 0.5},
                   body={"shape": "ship", "length": 80, "width": 18, "draft": 6, "x": -1000, "density": 900})
    found = json.loads(call("estimate", "--json", write_case(tmp_path, case)).stdout)
    ships = found["estimates"]["ships_in_pack_ice"]
    own = towing.ice_resistance(18, 1.2, 0.7, 0.5)  # the density of ice by default, as in a case
    assert (own.low, own.high) == pytest.approx((ships["low_n"], ships["high_n"]), rel=1e-12)
    assert towing.ice_resistance(18, 0, 0.7, 0.5).high == 0 == towing.ice_resistance(18, 1, 0.7, 0).high


# --- lines and vessels -----------------------------------------------------------------------------------------------

def test_the_tables_of_lines_and_vessels():
    lines, vessels = towing.lines(), towing.vessels()
    assert {line.material for line in lines.values()} == {"steel wire", "HMPE", "polyester", "polypropylene", "chain"}
    for material in {line.material for line in lines.values()}:
        rows = [line for line in lines.values() if line.material == material]
        for a, b in zip(rows, rows[1:]):  # no slip of a digit: all rise with the diameter
            assert a.diameter < b.diameter and a.mass < b.mass and a.breaking < b.breaking and a.stiffness < b.stiffness
    wire = lines["wire-6x36-64"]
    assert wire.breaking == pytest.approx(0.356 * 64 ** 2 * 1960, rel=1e-3)
    assert wire.weight() == pytest.approx(9.81 * 16.75 * (1 - 1027 / 7850)) and lines["hmpe-64"].weight() == 0
    for name, kind, same in ("polypropylene-96", "polypropylene", 1e-12), ("wire-6x36-64", "steel-wire", 1e-3):
        case = Case({"run": {"dt": 1, "duration": 1}, "tow.mode": "line", "tow.line.type": kind,
                     "tow.line.diameter": lines[name].diameter})
        assert lines[name].stiffness == pytest.approx(case["tow.line_stiffness"], rel=same)
        if kind == "polypropylene":  # the wires differ in grade
            assert lines[name].breaking == pytest.approx(case["tow.line.breaking_load"], rel=same)
    assert vessels["ahts-200-ice"].bollard_pull == pytest.approx(200e3 * 9.80665)
    assert math.isnan(vessels["ahts-157"].free_speed)
    assert towing.lightest_line(2.5e6).name == "hmpe-64" and towing.lightest_line(1e9) is None
    assert towing.lightest_line(2.5e6, material="steel wire").name == "wire-6x36-60"
    for load in 0, -5, math.nan:
        with pytest.raises(BergtowError, match="is not above zero"):
            towing.lightest_line(load)
        with pytest.raises(BergtowError, match="is not above zero"):
            towing.smallest_vessel(load)
    with pytest.raises(BergtowError, match="no line is of 'steel wre'; give one of HMPE, chain"):
        towing.lightest_line(1e6, material="steel wre")
    assert towing.smallest_vessel(1.1e6).name == "ahts-157"
    assert towing.smallest_vessel(1.1e6, known=("free_speed", )).name == "ahts-180"


LINES_HEAD = "name,material,diameter_mm,mass_kg_m,density_kg_m3,stiffness_kn,breaking_kn,source\n"


def test_a_table_of_ones_own_adds_and_replaces(tmp_path):
    file = tmp_path / "mine.csv"
    file.write_text(LINES_HEAD + '# ours\nhmpe-64,HMPE,64,2,975,1e5,2000,"yard, 2026"\n'
                    "ours,wire,50,10,7850,9e4,1500,yard\n")
    lines = towing.lines(file)
    assert lines["hmpe-64"].breaking == 2e6 and towing.find_line("ours", file).source == "yard"
    assert len(lines) == len(towing.lines()) + 1
    with pytest.raises(BergtowError, match="^line: 'ours' is not known; give one of polypropylene-80, "):
        towing.find_line("ours")
    file.write_text("name,bollard_pull_t,length_m,beam_m,free_speed_kn,mass_t,source\nmine,70,,,12,900,yard\n")
    mine = towing.find_vessel("mine", file)
    assert (mine.mass, mine.free_speed) == (9e5, pytest.approx(12 * 1852 / 3600)) and math.isnan(mine.beam)


@pytest.mark.parametrize("text, said", [
    ("", ":1: the head is empty"), ("name,mass\n", ":1: the head is name,mass; give name,material"),
    (LINES_HEAD + "a,w,1,1,1,1,1\n", ":2: 7 cells"), (LINES_HEAD + "\na,w,1,1,1,1,1k,s\n", ":3: breaking_kn: '1k'"),
    (LINES_HEAD + "a,w,-1,1,1,1,1,s\n", ":2: diameter_mm: '-1'"),
    (LINES_HEAD + "a,w,1,1,1,1,1,\n", ":2: source is empty"),
    (LINES_HEAD + "a,w,1,1,1,1,1,s\na,w,1,1,1,1,1,s\n", ":3: name: 'a' is twice")])
def test_a_table_that_is_wrong_is_refused_with_its_place(tmp_path, text, said):
    file = tmp_path / "mine.csv"
    file.write_text(text)
    with pytest.raises(BergtowError) as error:
        towing.lines(file)
    assert str(error.value).startswith(f"{file}{said}") and error.value.status == CASE


# --- stability -------------------------------------------------------------------------------------------------------

def test_a_block_rolls_where_its_ratio_says():
    """GM changes its sign at the critical ratio, which for 850 of 1025 kg/m3 is the 0.92 of the literature."""
    assert towing.critical_ratio(850, 1025) == pytest.approx(0.92, abs=3e-3)
    for density in (850, 900):
        height = 100.0
        draft = height * density / 1027
        width = towing.critical_ratio(density) * height
        for w, stable in ((1.001 * width, True), (0.999 * width, False)):
            found = towing.roll_stability(w, draft, density)
            assert found.stable is stable and (found.gm > 0) is stable and (found.ratio > found.critical) is stable
    with pytest.raises(BergtowError, match="does not float"):
        towing.critical_ratio(1030)


def test_heel_is_where_the_moments_are_equal():
    """A block that is turned by a small angle: the couple of weight and buoyancy, from the shape of what is under
    water, is the overturning moment."""
    width, draft, sail, length, rho = 100.0, 50.0, 6.0, 200.0, 1025.0
    mass, angle = rho * width * draft * length, 0.01
    # the wedges move the centre of buoyancy aside by tan φ W²/12 D (and up by half of that times tan φ)
    tangent = math.tan(angle)
    across, up = tangent * width ** 2 / (12 * draft), tangent ** 2 * width ** 2 / (24 * draft)
    arm = across * math.cos(angle) + (up - sail / 2) * math.sin(angle)
    gm = towing.metacentric_height(width, draft, sail)
    assert towing.heel_angle(mass * 9.81 * arm, mass, gm) == pytest.approx(angle, rel=1e-3)
    assert towing.heel_angle(1, mass, -1) == math.inf == towing.heel_angle(1e15, mass, gm)
    assert towing.overturning_moment(1e6, 2, 50) == 27e6 and towing.overturning_moment(1e6, -25, 50) == 0


@pytest.mark.parametrize("body, gyration", [
    ({"shape": "disc", "length": 80}, 80 / 4),
    ({"shape": "rectangle", "length": 120, "width": 70}, 70 / math.sqrt(12)),
    ({"shape": "polygon", "vertices": [[50, -20], [50, 40], [-50, 20], [-50, -40]]}, None)])
def test_check_warns_of_a_berg_that_would_roll(tmp_path, body, gyration):
    """Where the metacentric height of its column is below 0, by the least moment of its waterline about any axis."""
    if gyration is None:  # by brute force: points of a grid, axes at every half degree
        x, y = np.meshgrid(np.linspace(-50, 50, 801), np.linspace(-50, 50, 801))
        within = np.abs(y - 0.2 * x) < 30
        angles = np.radians(np.arange(0, 180, 0.5))
        gyration = math.sqrt(min(np.mean((x[within] * np.sin(a) - y[within] * np.cos(a)) ** 2) for a in angles))

    def warning(draft):
        path = write_case(tmp_path, changed(BERG, body=body | {"x": -1000, "draft": draft, "sail": 10}))
        found = json.loads(call("check", "--json", path).stdout)["warnings"]
        return [w for w in found if w["code"] == "berg_stability"]

    critical = gyration ** 2 / 5  # where GM = 0
    assert warning(0.98 * critical) == []
    (found, ) = warning(1.02 * critical)
    assert found["values"]["metacentric_height_m"] == pytest.approx(
        towing.metacentric_height(1, 1.02 * critical, 10, gyration), abs=0.02)
    assert found["values"]["draft_m"] == pytest.approx(1.02 * critical) and "would roll over" in texts([found])[0]
