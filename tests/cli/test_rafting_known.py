# SPDX-License-Identifier: MIT
"""Floes that raft in front of a towed body, in closed form, from the case file to the numbers of the result.

A body as wide as its channel pushes a row of n square floes of side a against the end wall, slowly, without drag. Only
floe on floe rafts, so the row gives way at its n - 1 contacts, the weakest at a time, and they take turns. Shortened by
s they lie over each other by s/(n - 1) each, and

    F = q0 a + μ (ρ_w − ρ_i) g h a s/(n − 1),   q0 = κ/2 ρ_i (1 − ρ_i/ρ_w) g h²

with the area a s over other ice, (2/κ) q0 a s of potential energy, q0 a s of work of the edges.

Red when the bound of one contact is taken twice, friction of the sheets is of all rows at once, body or wall raft, or
a number of the summary is of another kind.
"""

import numpy as np
import pytest

from harness import run

from bergtow.plot import chains as plot_chains

A, H, MU, KAPPA, V, DT = 2.0, 0.2, 0.3, 8, 0.01, 0.1
RHO_W, RHO_I, G = 1000.0, 920.0, 9.81
Q0 = 0.5 * KAPPA * RHO_I * (1 - RHO_I / RHO_W) * G * H**2
SHEETS = MU * (RHO_W - RHO_I) * G * H * A  # N for a metre of overlap


def pushed(tmp_path, n, s, *more, slop=1e-3):
    """n floes that touch, between the body and the end wall, shortened by s."""
    body, slack = 1.0, 1e-3
    length = 1 + body + n * A + slack
    r = run(tmp_path, {
        "run": {"dt": DT, "duration": s / V},
        "domain": {"length": length, "width": A + slack, "wall_friction": 0},
        "ice": {"concentration": 0, "friction": MU, "thickness": H, "density": RHO_I, "rafting": {"kappa": KAPPA},
                "drag": {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0}},
        "floes": [{"shape": "rectangle", "length": A, "width": A, "x": 1 + body + (k + 0.5) * A, "y": 0,
                   "thickness": H} for k in range(n)],
        "body": {"shape": "rectangle", "length": body, "width": A, "x": 1 + 0.5 * body, "draft": 1, "friction": 0},
        "tow": {"speed": V, "ramp": 0},
        "water": {"density": RHO_W},
        "output": {"window_start": 0, "frame_interval": s / V},
        "solver": {"tolerance": 1e-7, "max_sweeps": 20000, "slop": slop},
    }, *more)
    assert r.summary["unconverged_steps"] == 0
    return r, slack


def test_edges_that_lie_on_each_other_bear_load_without_slop(tmp_path):
    """The sides of the two are in one line, and inside or outside of each other by rounding alone. They then give way
    to the sides, as far as the channel lets them, and go on at an angle to the gradient of their area, tan α = d/a, at
    which the ends of their overlap cost sin² α of what the edge does."""
    r, slack = pushed(tmp_path, 2, 1.0, slop=0)
    area = A * (1.0 - slack)
    assert r.summary["rafted_area_m2"] == pytest.approx(area, rel=0.005)
    x = (1.0 - slack) / A
    ends = 1 - np.arctan(x) / x  # mean of sin² α
    assert ends > 0.05
    assert r.summary["raft_edge_work_j"] == pytest.approx(Q0 * area * (1 + ends), rel=0.01)
    assert r.summary["raft_friction_work_j"] == pytest.approx(0.5 * SHEETS, rel=0.05)  # ends that stick share it


def test_force_chains_have_what_edges_bear(tmp_path):
    """The edge between the two floes, without the friction of the sheets."""
    pushed(tmp_path, 2, 0.3, "--dump-contacts", f"250:{tmp_path / 'c.h5'}")
    c = plot_chains.read(tmp_path / "c.h5")
    between = np.all(c.body < 2, axis=1)
    assert between.sum() == 2
    assert (c.force * np.abs(c.normal[:, 0]))[between].sum() == pytest.approx(Q0 * A, rel=2e-3)


@pytest.mark.parametrize("n, s", [(2, 1.0), (3, 1.5), (5, 1.2)])
def test_a_row_against_the_wall(tmp_path, n, s):
    r, slack = pushed(tmp_path, n, s)
    load, way = r.series("ice_resistance", "body_x")
    way = way - 1.5
    over = (way - slack) / (n - 1)
    packed = over > 0.1
    assert packed.sum() > 300
    # floes differ by one step's way, and what is booked is of the start of the step
    np.testing.assert_allclose(load[packed], Q0 * A + SHEETS * over[packed], rtol=0.01)
    assert r.summary["rafting_pairs"] == n - 1
    area = A * (way[-1] - slack)
    assert r.summary["rafted_area_m2"] == pytest.approx(area, rel=0.005)
    assert r.summary["rafted_energy_j"] == pytest.approx(2 / KAPPA * Q0 * area, rel=0.005)
    assert r.summary["raft_edge_work_j"] == pytest.approx(Q0 * area, rel=0.005)
    assert r.summary["raft_friction_work_j"] == pytest.approx(0.5 * SHEETS * (n - 1) * over[-1]**2, rel=0.03)


@pytest.mark.parametrize("law", [{"rafting": {"kappa": 5}}, {"crushing": {"pressure": "3 kPa"}}])
def test_ice_whose_bound_moves_it_by_less_than_the_tolerance_gives_way(tmp_path, law):
    """A corner of a floe of 30 m hits the edge of another: the bound on a length of h, over a step, is worth a
    thirtieth of the tolerance. What the hit takes of the energy is the work of the ice, and no other at a tolerance
    10,000 times finer. Red when the residual is that of the natural map alone: no load, no work, and the projection
    holds the first floe."""
    a, half, found = 30.0, 15.0, []
    corners = [[-half, -half], [half, -half], [half, half], [-half, half]]
    for tolerance in (1e-3, 1e-7):
        r = run(tmp_path, {
            "run": {"dt": 0.2, "duration": 60},
            "domain": {"frame": "geographic", "length": 400, "width": 400, "ends": "open", "sides": "open"},
            "ice": {"concentration": 0, "size": a, "thickness": 0.15, "density": RHO_I, "start": "rest", **law,
                    "drag": {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0}},
            "floes": [{"shape": "polygon", "vertices": corners, "x": 100, "y": 0, "yaw": "45 deg", "vx": 0.3},
                      {"shape": "polygon", "vertices": corners, "x": 100 + half * (1 + 2**0.5) + 0.5, "y": 0}],
            "body": {"shape": "none"}, "tow": {"mode": "none"},
            "solver": {"reference_speed": 1, "tolerance": tolerance}, "output": {"frame_interval": 60},
        }, name=f"{tolerance}")
        energy = r.series("kinetic_energy")
        work = sum(r.summary[key] for key in ("raft_edge_work_j", "raft_friction_work_j", "crushed_work_j"))
        assert work == pytest.approx(energy[0] - energy[-1], rel=0.01) and r.summary["unconverged_steps"] == 0
        mass = RHO_I * 0.15 * a * a  # 0.15 m thick
        assert work == pytest.approx(mass * 0.3**2 / 4, rel=0.01)  # both go on at half of the speed
        found.append(work)
    assert found[0] == pytest.approx(found[1], rel=1e-3)
