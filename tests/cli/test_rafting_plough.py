# SPDX-License-Identifier: MIT
"""A plough in a channel through ice that rafts: speed of the front of packed ice, load and work in closed form.

Floes of length l lie in a row, one gap g = l (1 - A)/A apart, in a channel of their width b. A plough of that width
pushes them at speed v; water drags on each with τ l b, τ = ρ_w C u² at its speed u. Packed floes push on each other, so
the front of the packed ice runs ahead of the plough and the load grows with the row. No edge bears more than q0 b. The
most loaded one is that between the first floe, which the plough drives, and the second: when it is at its bound, the
first floe slides over the second, and n floes beyond it go on at the speed at which the drag on them is that load,

    u = min(v, √(q0 b / (n ρ_w C l b)))

until they meet the next. Meanwhile the plough has moved on by v g/u, so (v/u - 1) g b more has gone under. Its load is
that of the edge and the drag on the floe before it; its work is the drag on all floes, edges, and the inertia of floes
set in motion, which is below 1 % here. The channel is wider by less than the slop, or floes would lean against its
sides and go under at an angle to their edges.
"""
import numpy as np
import pytest

from harness import quick, run

V, L, B, H, KAPPA, FLOES, DT = 0.02, 3.0, 1.0, 0.1, 5, 12, 0.25
RHO_W, RHO_I, G, SKIN = 1000.0, 900.0, 9.81, 5.0
Q0 = KAPPA * 0.5 * RHO_I * (1 - RHO_I / RHO_W) * G * H**2


def case(gap):
    start = 2.0
    return {
        "run": {"dt": DT, "duration": 1000},
        "domain": {"length": 100, "width": B + 1e-5, "wall_friction": 0},
        "ice": {"concentration": 0, "friction": 0, "thickness": H, "density": RHO_I, "rafting": {"kappa": KAPPA},
                "drag": {"water_form": 0, "water_skin": SKIN}},
        "floes": [{"shape": "rectangle", "length": L, "width": B, "x": start + 0.5 * L + k * (L + gap), "y": 0,
                   "thickness": H} for k in range(FLOES)],
        "body": {"shape": "rectangle", "length": 1, "width": B, "x": start - 0.5, "draft": 1},
        "tow": {"speed": V, "ramp": 0},
        "water": {"density": RHO_W},
        "output": {"window_start": 0, "frame_interval": 2.5},
        "solver": {"tolerance": 1e-4},
    }


def expected(gap):
    """Time at which the n floes beyond the first meet the next, what has gone under by then, and the load before: of
    what lies over the next floe, half is out of the water's sight."""
    tau = RHO_W * SKIN * V**2 * L * B
    time, under, out = gap / V, 0.0, []  # the first floe alone, until it meets the second
    for n in range(1, FLOES - 1):
        u = min(V, np.sqrt(Q0 * B / (n * RHO_W * SKIN * L * B)))
        time += gap / u
        more = (V / u - 1) * gap * B
        under += more
        out.append((n, time, under, min(Q0 * B, n * tau) + tau * (1 - 0.5 * (under - 0.25 * more) / (L * B))))
    return out


@pytest.mark.parametrize("concentration", quick([0.75, 0.6], 0.75))
def test_front_and_load(tmp_path, concentration):
    gap = L * (1 - concentration) / concentration
    r = run(tmp_path, case(gap))
    time, load, area = r.series("time", "ice_resistance", "rafted_area")
    pose = r.dataset("/frames/pose")
    at = r.dataset("/frames/time")
    known = [e for e in expected(gap) if e[2] < 0.9 * L * B and e[1] < time[-1]]
    assert sum(e[2] > 0.1 * L * B for e in known) >= 3
    before = 0
    for n, t, under, force in known:
        meets = np.interp(0.01, pose[:, n + 1, 0] - pose[0, n + 1, 0], at)  # the next floe moves
        assert abs(meets - t) < 0.02 * t, (n, meets, t)
        assert abs(np.interp(t, time, area) - under) < 0.02 * under + 0.01, n
        during = (time > before + 0.5 * (t - before)) & (time < t - 2)
        if during.any():
            assert abs(load[during].mean() - force) < 0.02 * force, (n, load[during].mean(), force)
        before = t
