# SPDX-License-Identifier: MIT
"""Forces that are Python functions: as those of the program, and what goes wrong in them."""
import math
import os
import re
import signal
from concurrent.futures import ThreadPoolExecutor

import h5py
import numpy as np
import pytest
from harness import changed, quick, run
from python_package import LINE, SHORT, WINDOW, bergtow, datasets_of, python, stepped

pytestmark = pytest.mark.usefixtures("library")


@pytest.mark.parametrize("case", [SHORT, LINE, WINDOW], ids=["speed", "line", "window"])
def test_a_force_that_returns_zero_keeps_the_bits(case, tmp_path):
    def nothing(bodies):
        return np.zeros((len(bodies.id), 3))

    there = run(tmp_path, case)
    bergtow.run(case, tmp_path / "python", forces={"nothing": nothing}, threads=1)
    assert bergtow.Result(tmp_path / "python").summary["state_hash"] == there.hash
    ours, theirs = datasets_of(tmp_path / "python/result.h5"), datasets_of(there.dir / "result.h5")
    assert not ours.pop("nothing_force").any()
    for name, values in theirs.items():
        np.testing.assert_array_equal(ours[name], values, name)


def beside_a_late_force(case, folder, *, late):
    """Series and state of a run that a simulation with a new force begins beside."""
    code = f"""
import bergtow
def push(bodies): bodies.force[:] += 1e3, 0
a = bergtow.Simulation({case!r}, {str(folder)!r}, threads=1)
a.step(7)
if {late}:
    for k in range(12):
        b = bergtow.Simulation({case!r}, forces={{f"late_{{k}}": push}}, threads=1)
        b.step(3)
while a.steps_left: a.step(5)
a.end()
"""
    done = python(code)
    assert done.returncode == 0, done.stderr
    return datasets_of(folder / "result.h5"), bergtow.Result(folder).summary["state_hash"]


@pytest.mark.slow
@pytest.mark.parametrize("case", quick([SHORT, LINE], LINE), ids=["speed", "line"])
def test_a_force_that_comes_later_leaves_a_run_alone(case, tmp_path):
    alone, state = beside_a_late_force(case, tmp_path / "alone", late=False)
    beside, same = beside_a_late_force(case, tmp_path / "beside", late=True)
    assert same == state and beside.keys() == alone.keys()
    for name, values in alone.items():
        np.testing.assert_array_equal(beside[name], values, name)


class WaterDrag:
    """Skin and form drag of water at rest, of all bodies, by the equations of bergtow/forces.h."""

    def __init__(self, case):
        with bergtow.Simulation(case) as sim:
            self.skin, self.form, *_, self.yaw = sim.drags.T
            moved = sim.motions != 2
            place, outlines = sim.positions, [sim.outline(i) for i in range(sim.n_bodies)]
        self.skin, self.form, self.yaw = (np.where(moved, x, 0) for x in (self.skin, self.form, self.yaw))
        self.body = np.repeat(np.arange(len(place)), [len(o) for o in outlines])
        own = np.concatenate(outlines) - place[self.body, :2]
        c, s = np.cos(place[self.body, 2]), np.sin(place[self.body, 2])
        self.corner = np.stack([c * own[:, 0] + s * own[:, 1], c * own[:, 1] - s * own[:, 0]], 1)
        self.next = np.concatenate([np.roll(np.arange(len(o)), -1) + at for o, at in
                                    zip(outlines, np.cumsum([0, *map(len, outlines)]))])

    def __call__(self, bodies):
        """drag of the water, in Python"""
        u, load = bodies.velocity, bodies.load
        bodies.drag(self.skin * np.sqrt(u[:, 0] ** 2 + u[:, 1] ** 2), (0, 0))
        load[:, 6] += self.yaw * np.abs(u[:, 2])
        turn = bodies.place[self.body, 2]
        c, s = np.cos(turn), np.sin(turn)
        p = np.stack([c * self.corner[:, 0] - s * self.corner[:, 1], s * self.corner[:, 0] + c * self.corner[:, 1]], 1)
        e = p[self.next] - p
        v = -u[self.body]

        def inflow(at):  # -v.n times the length of the edge, where the local velocity of the water is v - ω × r
            return -((v[:, 0] - v[:, 2] * at[:, 1]) * e[:, 1] - (v[:, 1] + v[:, 2] * at[:, 0]) * e[:, 0])

        start, end = inflow(p), inflow(p[self.next])
        wet = (start > 0) | (end > 0)
        zero = start / np.where(start == end, 1, start - end)
        low, high = np.where(start < 0, zero, 0), np.where(end < 0, zero, 1)
        for side in (-1, 1):
            t = 0.5 * (low + high + side / math.sqrt(3) * (high - low))
            g = 0.5 * (high - low) * self.form[self.body] * np.maximum(0, start + t * (end - start))
            g = np.where(wet, g, 0)
            r = p + np.where(wet, t, 0)[:, None] * e
            for column, value in ((3, g), (4, g * r[:, 0]), (5, g * r[:, 1]), (6, g * (r ** 2).sum(1))):
                np.add.at(load[:, column], self.body, value)


@pytest.mark.parametrize("base", [SHORT, LINE], ids=["speed", "line"])
def test_water_drag_in_python_is_that_of_the_program(base, tmp_path):
    own = {"air_form": 0, "air_skin": 0, "tangential": 1}
    # a decision of the sweeps by rounding is worth their tolerance
    with_drag = changed(base, run__duration=10, ice__drag=own | {"sheltering": 0}, body__drag=own,
                        solver__tolerance=1e-10)
    none = own | {"water_form": 0, "water_skin": 0}
    without = changed(with_drag, ice__drag=none | {"sheltering": 0}, body__drag=none)
    program = bergtow.run(with_drag, tmp_path / "program", threads=1)
    python = bergtow.run(without, tmp_path / "python", forces={"python_drag": WaterDrag(with_drag)}, threads=1)
    with program.open() as a, python.open() as b:
        for name, same in (("ice_resistance",) * 2, ("tow_force",) * 2, ("drag_force", "python_drag_force")):
            mean = float(a[name].mean())
            assert mean != 0 and abs(float(b[same].mean()) - mean) < 1e-9 * abs(mean), name
        assert not b["drag_force"].any()
        assert float(a["drag_force"].mean()) > 0.01 * float(a["tow_force"].mean())


def test_a_force_may_be_returned_and_is_part_of_the_balance():
    def current(bodies):
        force = np.zeros((len(bodies.id), 2))
        force[bodies.towed] = -7, 0
        return force

    with bergtow.Simulation(SHORT, threads=1, forces={"hold_back": current}) as sim:
        sim.step(40)
        assert math.isclose(sim["hold_back_force"], 7, rel_tol=1e-12)
        rest = sim["ice_resistance"] + sim["drag_force"] + sim["inertia_force"]
        assert math.isclose(sim["tow_force"], rest + 7, rel_tol=1e-9)


def test_a_drag_pulls_towards_its_velocity():
    """So strong that a step takes every floe there; of each its own velocity."""
    def drag(bodies):
        bodies.drag(1e9, np.stack([np.full(len(bodies.id), 0.03), -0.01 * (1 + bodies.id % 3)], 1))

    with bergtow.Simulation(changed(SHORT, ice__concentration=0.2), threads=1, forces={"strong": drag}) as sim:
        sim.step()
        free = np.flatnonzero(sim.motions == 0)
        wanted = np.stack([np.full(len(free), 0.03), -0.01 * (1 + free % 3)], 1)
        near = np.abs(sim.velocities[free, :2] - wanted).max(axis=1) < 1e-4
        assert len(free) > 10 and near.mean() > 0.8  # the others are in contact


def test_a_moment_may_be_returned():
    def returned(bodies):
        answer = np.zeros((len(bodies.id), 3))
        answer[:, 2] = 0.5 * bodies.inertia
        return answer

    def added(bodies):
        bodies.moment[:] += 0.5 * bodies.inertia

    hashes = []
    for function in (returned, added):
        with bergtow.Simulation(changed(SHORT, ice__concentration=0.2), threads=1, forces={"turn": function}) as sim:
            before = sim.velocities[:, 2]
            sim.step()
            free = sim.motions == 0
            gained = (sim.velocities[:, 2] - before)[free] / sim.dt
            assert np.median(gained) == pytest.approx(0.5, rel=0.05)
            hashes.append(sim.state_hash)
    assert hashes[0] == hashes[1]


def test_what_goes_wrong_in_a_force_is_reported():
    class Own(Exception):
        pass

    def raises(bodies):
        if bodies.time > 1:
            raise Own("a reason")

    def no_number(bodies):
        bodies.force[3, 0] = math.nan

    def drives(bodies):
        bodies.drag(-1, (0, 0))

    with pytest.raises(Own, match="a reason"):
        stepped(SHORT, forces={"wrong": raises})
    with pytest.raises(bergtow.BergtowError, match="force wrong: a number that it has filled in is not finite"):
        stepped(SHORT, forces={"wrong": no_number})
    with pytest.raises(bergtow.BergtowError, match="force wrong: its linear part drives a body"):
        stepped(SHORT, forces={"wrong": drives})
    with pytest.raises(bergtow.BergtowError, match="lower-case letters"):
        stepped(SHORT, forces={"Not a name": raises})
    with pytest.raises(bergtow.BergtowError, match="this name is taken"):
        stepped(SHORT, forces={"drag": raises})
    with bergtow.Simulation(SHORT, forces={"mine": drives}):
        with pytest.raises(bergtow.BergtowError, match="belongs to a simulation that has not ended"):
            bergtow.Simulation(SHORT, forces={"mine": drives})


def test_a_force_whose_series_is_taken_is_refused():
    """Red: it acted, had no series, and sim["tow_force"] was that of the line. Its name stays free."""
    for name in ("tow", "inertia"):
        with pytest.raises(bergtow.BergtowError, match=f"{name}_force: this name is taken"):
            stepped(SHORT, forces={name: lambda bodies: None})


def test_what_a_force_has_filled_in_is_not_to_be_returned():
    """Red: it counted twice."""
    def both(bodies):
        bodies.force[bodies.towed, 0] = -7
        return bodies.force

    with pytest.raises(ValueError, match="would count twice"):
        stepped(SHORT, forces={"both": both})


def test_a_case_without_bodies_has_forces_on_none(tmp_path):
    case = {"run": {"dt": 0.1, "duration": 2}, "domain": {"length": 20, "width": 10, "ends": "periodic",
            "sides": "periodic"}, "ice": {"concentration": 0}, "body": {"shape": "none"}}
    seen = []
    with bergtow.Simulation(case, threads=1, forces={"on_none": lambda bodies: seen.append(bodies.force.shape)}) as sim:
        sim.step(2)
    assert seen == [(0, 2)] * 2


def test_texts_of_forces_end_with_a_character(tmp_path):
    def long(bodies):
        pass
    long.__doc__ = "x" + "ä" * 150
    with bergtow.Simulation(SHORT, tmp_path / "out", threads=1, forces={"wordy": long}) as sim:
        sim.step(2)
    with h5py.File(tmp_path / "out/result.h5") as f:
        assert f["series/wordy_force"].attrs["description"].startswith("x" + "ä" * 90)


OPEN = changed(SHORT, tow__speed=0.01, run__duration=30)


def test_a_force_may_be_set_as_a_whole():
    def part(bodies):
        bodies.force[:] = 0.01 * bodies.place[:, :2]
        bodies.moment[:] = 0.02

    def whole(bodies):
        bodies.force = 0.01 * bodies.place[:, :2]
        bodies.moment = np.full(len(bodies.id), 0.02)

    def row(bodies):
        bodies.load = np.concatenate([0.01 * bodies.place[:, :2], np.full((len(bodies.id), 1), 0.02),
                                      np.zeros((len(bodies.id), 7))], 1)

    states = [stepped(OPEN, forces={"set": f}) for f in (part, whole, row)]
    assert set(states) == {states[0]} != {stepped(OPEN)}


@pytest.mark.parametrize("columns", [1, 4])
def test_what_a_force_returns_has_a_shape(columns):
    def wrong(bodies):
        return np.zeros((len(bodies.id), columns))

    with pytest.raises(ValueError, match=rf"shape \(\d+, {columns}\); fill in .* in place .*moments"):
        stepped(SHORT, forces={"set": wrong})


def test_what_is_no_array_of_forces_is_told_to_fill_in_place():
    """Red: "float() argument must be a string or a real number"."""
    with pytest.raises(ValueError, match="a force returned dict; fill in .* in place and return nothing"):
        stepped(SHORT, forces={"set": lambda bodies: {0: 1.0}})


def test_without_a_towed_body_there_is_no_row_of_it():
    def hold(bodies):
        assert not bodies.has_towed
        bodies.force[bodies.towed] += 1, 0

    case = {k: v for k, v in SHORT.items() if k != "tow"} | {"body": {"shape": "none"}}
    with bergtow.Simulation(case, threads=1, forces={"hold": hold}) as sim:
        with pytest.raises(bergtow.BergtowError, match="there is no towed body"):
            sim.step()
        assert not sim.has_towed
        with pytest.raises(bergtow.BergtowError, match="there is no towed body"):
            sim.positions[sim.towed]
        sim.drop()


def test_the_row_of_the_towed_body_where_floes_reserve_numbers():
    def push(bodies):
        assert (np.diff(bodies.id) > 0).all() and bodies.id[bodies.towed] == sim.towed != bodies.towed
        bodies.force[bodies.towed] += -100, 0

    case = SHORT | {"ice": SHORT["ice"] | {"splitting": {"toughness": 1e5, "strength": 1e5}}}
    with bergtow.Simulation(case, threads=1, forces={"push": push}) as sim:
        sim.step(5)
        assert sim["push_force"] == 100


def test_a_force_cannot_change_what_steps(tmp_path):
    said, calls = [], []

    def meddles(bodies):
        for call in (sim.step, sim.end, sim.drop, sim.checkpoint, sim.frame, other.step,
                     lambda: sim.set_velocity(0, 1, 0), lambda: sim.set_position(0, 6, 0, 0)):
            with pytest.raises(bergtow.BergtowError) as refused:
                call()
            said.append(str(refused.value))
        with pytest.raises(bergtow.BergtowError, match="a step is replacing the contacts"):
            sim.contacts()
        assert len(sim.positions) == len(bodies.id)

    def after(bodies):
        calls.append(bodies.time)

    with bergtow.Simulation(SHORT) as other, \
            bergtow.Simulation(SHORT, tmp_path / "out", forces={"meddles": meddles, "afterwards": after}) as sim:
        sim.step(2)
        assert len(said) == 16 and {bool(re.search("under way|cannot end", text)) for text in said} == {True}
        assert sim.steps == len(calls) == 2 and other.steps == 0
        other.step(2)
        assert sim.state_hash == other.state_hash


@pytest.fixture
def ctrl_c():
    """Ctrl-C as in a terminal; a test run in the background ignores it, and so would what it starts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_ends_steps_between_two_of_them(ctrl_c):
    def interrupts(bodies):
        if 0.95 < bodies.time < 1:
            os.kill(os.getpid(), signal.SIGINT)

    with bergtow.Simulation(OPEN, threads=1, forces={"interrupts": interrupts}) as sim:
        with pytest.raises(KeyboardInterrupt):
            sim.step(100)
        assert sim.steps == 10
        sim.step(2)
        assert sim.steps == 12 and signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_second_ctrl_c_ends_a_force_that_hangs(ctrl_c):
    def hangs(bodies):
        for _ in range(1000):
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        stepped(OPEN, forces={"hangs": hangs})


def test_ctrl_c_while_a_simulation_begins_leaves_none_behind(ctrl_c, tmp_path, monkeypatch):
    """It comes while the ice is made, in the call from C. Red when the folder stays locked and the force taken."""
    library, out = bergtow._library.library(), tmp_path / "out"
    create = library.bt_simulation_create

    def interrupted(*arguments):
        answer = create(*arguments)
        os.kill(os.getpid(), signal.SIGINT)
        return answer

    def begin():
        return bergtow.Simulation(OPEN, out, threads=1, forces={"begun": lambda bodies: None}, replace=True)

    monkeypatch.setattr(library, "bt_simulation_create", interrupted)
    kept = []
    for call in (begin, lambda: bergtow.run(OPEN, out, threads=1, replace=True)):
        try:
            call()
        except KeyboardInterrupt as error:
            kept.append(error)  # and with it all frames that it came through, as at a prompt
    monkeypatch.undo()
    with begin() as sim:
        assert len(kept) == 2 and sim.steps == 0


def test_threads_take_turns():
    def push(bodies):
        bodies.force[:, 0] += 0.01

    def work(k):
        with bergtow.Simulation(SHORT, threads=1, forces={f"turn_{k}": push}) as sim:
            while sim.steps_left:
                sim.step(5)
            return sim.state_hash

    def refused(k):
        with pytest.raises(bergtow.CaseError) as error:
            bergtow.Case(SHORT, {"tow.speed": f"{k} bananas"})
        return f"{k} bananas" in str(error.value)

    with ThreadPoolExecutor(2) as pool:
        assert set(pool.map(work, range(2))) == {work(2)}
        assert all(pool.map(refused, range(200)))


def test_a_fork_is_not_held_up_by_the_threads_of_its_parent():
    done = python(f"""
import bergtow, multiprocessing, os
case = {SHORT!r}
def work(k):
    with bergtow.Simulation(case) as sim:
        sim.step(1000)
        return sim.state_hash
def refused(k):
    try: parent.step(1)
    except bergtow.BergtowError as error: print(error, flush=True)
    try: bergtow.Simulation(case, threads=2)
    except bergtow.BergtowError as error: print(error, flush=True)
parent = bergtow.Simulation(case, threads=2)
parent.step(5)
with multiprocessing.get_context("fork").Pool(2) as pool:
    states = pool.map_async(work, range(2)).get(60)
    pool.map_async(refused, range(1)).get(60)
parent.step(1000)
assert set(states) == {{parent.state_hash}}
""", OMP_NUM_THREADS="2")
    assert done.returncode == 0, done.stderr
    assert "belongs to the parent of this forked process" in done.stdout and "spawn" in done.stdout


def test_floes_at_rest_wake_when_a_force_begins():
    """Open water around a floe far from the tow: it rests until it is pushed."""
    def later(bodies):
        if bodies.time > 2:
            bodies.force[0] = 0, 0.02

    with bergtow.Simulation(changed(SHORT, tow__speed=0.01), threads=1, forces={"later": later}) as sim:
        before = sim.positions[0]
        sim.step(20)
        assert (sim.positions[0] == before).all()
        sim.step(1)
        m = sim.masses[0, 0]
        assert math.isclose(sim.velocities[0, 1], 0.1 * 0.02 / m, rel_tol=1e-12)
