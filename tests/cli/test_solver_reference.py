# SPDX-License-Identifier: MIT
"""The contact solver against others: the dumped problem of a step, solved here by an interior-point method.

    u = W r + q,   0 <= r_n ⟂ u_n >= 0,   |r_t| <= μ r_n, r_t against u_t        (files: FCLIB, local form)

Without friction this is the convex problem min ½ rᵀWr + qᵀr, r >= 0, whose velocities are unique. With friction it is
solved as a sequence of such problems, each with the friction bounds of the last (Haslinger, Hlaváček & Nečas 1996,
Handbook of Numerical Analysis IV): nothing of it is shared with Gauss–Seidel sweeps over contacts, or with their
acceleration.
"""
import h5py
import numpy as np
import pytest
import scipy.sparse

from harness import changed, placed, run

SPEED = 0.05  # m/s, of the walls: all velocities below are of this order
TOLERANCE = 1e-8  # of the closing speed; a tenth of it is near what rounding leaves in rows of thirty floes
BASE = {
    "run": {"dt": 0.1, "duration": 4},
    "domain": {"length": 9, "width": 6, "ends_closing": SPEED, "sides_closing": SPEED, "wall_friction": 0},
    "ice": {"concentration": 0.85, "size": 0.8, "friction": 0, "seed": 2},
    "body": {"shape": "none"},
    "solver": {"tolerance": TOLERANCE, "max_sweeps": 100000},
    "output": {"frame_interval": 4},
}
TOWED = {"shape": "square", "length": 1.5, "x": 3, "y": 0.2, "yaw": 12}
CASES = {
    "no friction": BASE,
    "no friction, e = 0.4": changed(BASE, ice__restitution=0.4, domain__wall_restitution=0.7),
    "friction": changed(BASE, ice__friction=0.15, domain__wall_friction=0.1),
    "strong friction, loose": changed(BASE, ice__friction=0.5, domain__wall_friction=0.3, ice__concentration=0.7),
    "tow": changed(BASE,
                   body=TOWED,
                   tow={"mode": "speed", "speed": SPEED, "ramp": 0},
                   domain={"length": 9, "width": 6},
                   ice__friction=0.1),
    "crushing": changed(BASE,
                        ice__friction=0.15, ice__seed=3,
                        domain__wall_friction=0.1,
                        ice__crushing={"pressure": "30 Pa", "least_length": 0.2}),
    "crushing, e = 0.4": changed(BASE, ice__restitution=0.4, ice__crushing={"pressure": "30 Pa"}),
    "line": changed(BASE,
                    body=TOWED,
                    tow={"mode": "line", "speed": SPEED, "ramp": 0, "line_length": 1, "line_damping": 300},
                    domain={"length": 9, "width": 6},
                    ice__friction=0.1,
                    run__duration=8),
}


class Problem:
    def __init__(self, path):
        with h5py.File(path) as f:
            g = f["fclib_local"]
            assert g["spacedim"][0] == 2 and g["W/nz"][0] == -2
            self.W = scipy.sparse.csr_matrix((g["W/x"][:], g["W/i"][:], g["W/p"][:]),
                                             shape=(g["W/m"][0], ) * 2).toarray()
            self.q, self.mu = g["vectors/q"][:], g["vectors/mu"][:]
            self.u, self.r = f["solution/u"][:], f["solution/r"][:]
            self.bound = f["bound"][:] if "bound" in f else np.full(len(self.mu), np.inf)
        self.n = len(self.mu)


def dump(folder, case, step, name="out"):
    r = run(folder, case, "--steps", step, "--dump-contacts", f"{step}:{folder / name}.h5", name=name)
    return Problem(folder / f"{name}.h5"), r


def box_problem(A, c, low, high):
    """min ½xᵀAx + cᵀx in low <= x <= high (high may be infinite), A positive semidefinite: primal-dual interior
    point."""
    bounded = np.isfinite(high)
    x = np.where(bounded, 0.5 * (low + np.where(bounded, high, 0)), low + 1.0)
    zl, zu = np.ones_like(x), np.where(bounded, 1.0, 0.0)
    a, b = x - low, np.where(bounded, high - x, np.inf)  # kept on their own: a difference would lose the last digits
    for _ in range(100):
        slope = A @ x + c
        gap = (zl @ a + zu[bounded] @ b[bounded]) / (len(x) + bounded.sum())
        if gap < 1e-18 and np.abs(slope - zl + zu).max() < 1e-12:
            return x
        target = 0.1 * gap
        barrier = zl / a + zu / b
        # the barrier spans twenty orders of magnitude; scaled, the system is tame
        d = 1 / np.sqrt(np.diag(A) + barrier)
        H = d[:, None] * A * d + np.diag(barrier * d * d + 1e-15)
        dx = d * np.linalg.solve(H, d * (target / a - target / b - slope))
        dzl, dzu = (target - zl * dx) / a - zl, np.where(bounded, (target + zu * dx) / b - zu, 0)

        def longest(v, dv):
            down = dv < 0
            return min(1.0, 0.99 * np.min(-v[down] / dv[down])) if down.any() else 1.0

        # One step length for both, or the error in the slope would not shrink with the gap.
        s = min(longest(a, dx), longest(b[bounded], -dx[bounded]), longest(zl, dzl), longest(zu[bounded], dzu[bounded]))
        x, a, b, zl, zu = x + s * dx, a + s * dx, b - s * dx, zl + s * dzl, zu + s * dzu
    raise AssertionError(f"the interior-point method has not converged: gap {gap:.2g}")


def with_bounds(p, bound):
    """Solution of the contact problem with the friction |r_t| <= bound given: impulses and (unique) velocities."""
    scale = 1 / np.sqrt(np.diag(p.W))
    unit = SPEED * np.median(scale)  # of the scaled impulses
    A, c = scale[:, None] * p.W * scale, scale * p.q / unit
    low, high = np.zeros(2 * p.n), np.full(2 * p.n, np.inf)
    high[::2] = p.bound / scale[::2] / unit
    high[1::2] = bound / scale[1::2] / unit
    low[1::2] = -high[1::2]
    free = high - low > 1e-10
    x = np.zeros(2 * p.n)
    x[free] = box_problem(A[np.ix_(free, free)], c[free], low[free], high[free])
    return scale * x * unit, (A @ x + c) / scale * unit


def from_scratch(p):
    """Velocities of the contact problem with friction from the problem alone: the bounds follow the normal impulses."""
    bound, before = np.zeros(p.n), np.inf
    for _ in range(60):
        r, u = with_bounds(p, bound)
        if np.abs(u - before).max() < 1e-9 * SPEED:
            return u
        bound, before = p.mu * np.maximum(r[::2], 0), u
    raise AssertionError("the sequence of bounds has not converged")


@pytest.fixture(scope="module", params=CASES)
def solved(request, tmp_path_factory):
    """A step that takes the solver many sweeps, late enough for warm starts from earlier ones."""
    case = CASES[request.param]
    folder = tmp_path_factory.mktemp("solved")
    contacts, sweeps = run(folder, changed(case, solver__tolerance=1e-4), name="scan").series("contacts", "sweeps")
    step = 10 + int(np.argmax(np.where((contacts <= 200) & (sweeps < 1000), sweeps, 0)[10:])) + 1
    p, r = dump(folder, case, step)
    assert r.series("unconverged")[-1] == 0
    return request.param, p, r


def test_the_problem_is_worth_solving(solved):
    name, p, _ = solved
    assert p.n > 40
    pressed, friction = p.r[::2] > 1e-9, np.abs(p.r[1::2])
    assert pressed.sum() > 4 and (~pressed).sum() > 4
    if name in ("friction", "strong friction, loose"):
        limit = p.mu * p.r[::2]
        assert np.any(pressed & (friction > (1 - 1e-9) * limit)), "nothing slides"
        assert np.any(pressed & (friction < 0.9 * limit)), "nothing sticks"
    if "crushing" in name:
        crushed = p.u[::2] < -1e-3 * SPEED
        assert crushed.sum() > 4 and np.any(pressed & ~crushed), "all or nothing is crushed"


def test_stored_solution_obeys_the_law(solved):
    name, p, r = solved
    un, ut, rn, rt = p.u[::2], p.u[1::2], p.r[::2], p.r[1::2]
    scale = np.diag(p.W)
    small = 2 * TOLERANCE * SPEED
    np.testing.assert_allclose(p.W @ p.r + p.q, p.u, atol=1e-12)
    free = rn < p.bound * (1 - TOLERANCE) - small / scale[::2]  # an impulse below its bound keeps the bodies apart
    assert rn.min() >= 0 and un[free].min() >= -small
    assert np.all(rn <= p.bound * (1 + 1e-6) + small / scale[::2])
    assert np.minimum(rn * scale[::2], un).max() <= small, "a contact presses and opens"
    assert np.all(np.abs(rt) <= p.mu * rn * (1 + 1e-12) + 1e-15 * rn.max())
    sticks = np.abs(rt) < p.mu * rn * (1 - TOLERANCE) - small / scale[1::2]
    assert np.abs(ut[sticks]).max(initial=0) <= small, "it slips below the Coulomb limit"
    slides = np.abs(ut) > 10 * small
    assert np.all((rt * ut)[slides] <= 0), "friction drives"
    # The residual that the run reports is this one.
    natural = np.maximum(np.abs(rn - np.clip(rn - un / scale[::2], 0, p.bound)) * scale[::2],
                         np.abs(rt - np.clip(rt - ut / scale[1::2], -p.mu * rn, p.mu * rn)) * scale[1::2]).max()
    assert natural <= TOLERANCE * SPEED
    if "crushing" not in name:  # a bound that rises with the approach meets the impulse sooner
        assert natural <= r.series("residual")[-1] * (1 + 1e-3) + 1e-14


def test_matrix(solved):
    """W is symmetric and positive semidefinite; contacts couple where they share a body that moves, and nowhere
    else."""
    _, p, _ = solved
    assert np.abs(p.W - p.W.T).max() <= 1e-12 * np.abs(p.W).max()
    assert np.linalg.eigvalsh(p.W)[0] >= -1e-12 * np.abs(p.W).max()
    block = np.abs(p.W.reshape(p.n, 2, p.n, 2)).max(axis=(1, 3)) > 0
    assert np.all(np.diag(block)) and 0 < block.sum() < 0.6 * p.n ** 2


def test_velocities_are_those_of_another_method(solved):
    """Given the friction bounds μ r_n the problem is convex and its velocities unique: they must be those of the
    solver.

    Impulses may be shared out in several ways (two floes on two corners against two walls), velocities may not.
    """
    name, p, _ = solved
    _, u = with_bounds(p, p.mu * p.r[::2])
    error = np.abs(u - p.u).max()
    assert error <= 1e-6 * SPEED, f"{name}: {error / SPEED:.2g} of the speed of the walls"


def test_friction_from_scratch(tmp_path):
    """The same without knowing anything of the solution."""
    p, r = dump(tmp_path, changed(CASES["friction"], domain__length=5, domain__width=4, ice__concentration=0.8), 20)
    assert r.series("unconverged")[-1] == 0 and np.sum(p.r[::2] > 0) > 10
    assert np.abs(from_scratch(p) - p.u).max() <= 1e-7 * SPEED
    # Friction matters: without it the velocities are others.
    assert np.abs(with_bounds(p, np.zeros(p.n))[1] - p.u).max() > 0.01 * SPEED


def test_the_problem_does_not_come_from_the_solution(tmp_path):
    """W, q, μ of the first step are the same whether the solver had one sweep or all it wanted; the solution is not.
    The water moves, so that contacts are looked for everywhere: a solution that reaches floes at rest has the step
    detected once more."""
    case = changed(BASE, ice__friction=0.2, domain__ends_closing=0.5, domain__sides_closing=0.5, guard__overlap=0,
                   ice__concentration=0.93, water={"current_x": 1.5})
    one, _ = dump(tmp_path, changed(case, solver__max_sweeps=1), 1, "one")
    all_, _ = dump(tmp_path, case, 1, "all")
    assert np.abs(one.r - all_.r).max() > 1e-3 * np.abs(all_.r).max() > 0
    assert np.array_equal(one.W, all_.W) and np.array_equal(one.mu, all_.mu)
    np.testing.assert_allclose(one.q, all_.q, atol=1e-12)


@pytest.mark.parametrize("ice",
                         [{"friction": 0}, {"friction": 0.2}, {"friction": 0.2, "crushing": {"pressure": "200 Pa"}}],
                         ids=["no friction", "friction", "crushing"])
def test_momentum_and_the_plain_sweep_agree(tmp_path, ice):
    """The first step of a squeeze, solved with lists and momentum and by plain sweeps over all contacts: the same
    problem, the same velocities."""
    case = changed(BASE,
                   ice={**BASE["ice"], **ice, "concentration": 0.93},
                   domain={**BASE["domain"], "length": 6, "width": 5},
                   domain__ends_closing=0.3,
                   guard__overlap=0,
                   water={"current_x": 1.5},
                   solver={"tolerance": 1e-7, "max_sweeps": 1000000})
    fast, r = dump(tmp_path, case, 1, "fast")
    plain, s = dump(tmp_path, changed(case, solver__plain=True), 1, "plain")
    assert np.array_equal(fast.W, plain.W) and r.series("unconverged")[0] == s.series("unconverged")[0] == 0
    assert np.sum(fast.r[::2] > 0) > 10 and r.series("momentum_moves")[0] > 0 and s.series("momentum_moves")[0] == 0
    assert np.abs(fast.u - plain.u).max() <= 1e-5 * SPEED
    assert r.series("contact_updates")[0] < 0.5 * s.series("contact_updates")[0]


def test_two_floes_from_first_principles(tmp_path):
    """W, q and the impulse of one oblique eccentric hit with friction, from masses, arms and velocities worked out
    here."""
    case = {
        "run": {"dt": 0.01, "duration": 1},
        "domain": {"length": 20, "width": 10, "ends": "open", "sides": "open"},
        "ice": {
            "concentration": 0, "thickness": 0.2, "density": 900, "friction": 0.1, "added_mass": 0.3,
            "added_inertia": 0.6, "restitution": 0,
            "drag": dict.fromkeys(["water_form", "water_skin", "air_form", "air_skin"], 0)
        },
        "body": {"shape": "none"},
        "solver": {"tolerance": 1e-12, "reference_speed": 1},
        # A square of 1 m with a corner ahead meets the long side of a bar, 0.6 m above the middle of it.
        "floes": [{"shape": "square", "length": 1, "x": 5, "y": 0, "yaw": 45, "vx": 2, "vy": 1.5},
                  {"shape": "rectangle", "length": 0.8, "width": 3, "x": 5 + np.sqrt(0.5) + 0.4 + 0.005, "y": -0.6}],
    }
    p, _ = dump(tmp_path, case, 1)
    assert p.n == 1
    ma, mb = 900 * 0.2 * 1 * 1.3, 900 * 0.2 * 2.4 * 1.3
    ia, ib = 900 * 0.2 * (1 / 6) * 1.6, 900 * 0.2 * 2.4 * (0.8 ** 2 + 3 ** 2) / 12 * 1.6
    # the point half-way between the two surfaces, from the square's centre
    x = np.sqrt(0.5) + 0.0025
    ra, rb = np.array([x, 0]), np.array([x - (np.sqrt(0.5) + 0.405), 0.6])
    n, t = np.array([1, 0]), np.array([0, 1])
    cross = lambda r, d: r[0] * d[1] - r[1] * d[0]
    J = np.array([[*-d, -cross(ra, d), *d, cross(rb, d)] for d in (n, t)])
    M = np.diag([ma, ma, ia, mb, mb, ib])
    W = J @ np.linalg.inv(M) @ J.T
    q = J @ np.array([2, 1.5, 0, 0, 0, 0]) + [0.005 / 0.01, 0]
    np.testing.assert_allclose(p.W, W, rtol=1e-9)
    np.testing.assert_allclose(p.q, q, rtol=1e-9)
    # It slides: r_t = −μ r_n sign(u_t), u_n = 0. Relative to the square the bar's surface moves down, u_t < 0.
    rn = -q[0] / (W[0, 0] + W[0, 1] * 0.1)
    np.testing.assert_allclose(p.r, [rn, 0.1 * rn], rtol=1e-9)
    assert W[1] @ p.r + q[1] < 0


def test_matrix_from_the_poses(tmp_path):
    """Every block of W on the diagonal lies within what masses and outlines of the two bodies allow, for a whole field:
    1/m_a + 1/m_b <= W_nn <= that + r_a²/I_a + r_b²/I_b over the pairs of floes there are (walls: one body)."""
    p, r = dump(tmp_path, BASE, 20)
    with h5py.File(r.dir / "result.h5") as f:
        v, o, area, h = f["floes/vertices"][:], f["floes/offsets"][:], f["floes/area"][:], f["floes/thickness"][:]
    mass = 910 * area * h
    assert p.W[0::2, 0::2].diagonal().min() > 1 / mass.max()
    assert p.W[1::2, 1::2].diagonal().min() > 1 / mass.max()
    radius = np.array([np.hypot(*placed(v[o[i]:o[i + 1]], np.zeros(3)).T).max() for i in range(len(area))])
    worst = 2 * np.max(1 / mass + radius ** 2 / (mass * area / (2 * np.pi)))
    assert np.diag(p.W).max() < worst


def comb(**more):
    """A free strip between thirty heavy teeth that close on it in opposite pairs; with momentum the sweeps run away."""
    tooth = [[0, -14.8], [9.6, -4.8], [9.6, 10.2], [-9.6, 10.2], [-9.6, -4.8]]
    floes = [{"shape": "polygon", "vertices": [[-256, -15], [256, -15], [256, 15], [-256, 15]], "x": 316, "y": -30}]
    for k in range(-7, 8):
        for side in (1, -1):
            vertices = [[side * x, side * y] for x, y in tooth]
            floes.append({"shape": "polygon", "vertices": vertices, "x": 316 + 32 * k, "y": -30 + 29.8 * side,
                          "thickness": 50, "vy": -0.1 * side})
    return changed({
        "run": {"dt": 1, "duration": 2}, "domain": {"length": 1184, "width": 420},
        "ice": {"concentration": 0, "thickness": 1, "friction": 0, "restitution": 0,
                "drag": {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0}},
        "body": {"shape": "none"}, "floes": floes, "output": {"frame_interval": 1}, "solver": {"tolerance": 1e-6},
    }, **more)


@pytest.mark.parametrize("most", [500, 5000])
def test_sweeps_that_run_away_come_back(tmp_path, most):
    """Beyond some thousand tolerances the sum of squares is cut off. Red when the momentum goes by it there: what plain
    sweeps gain back is not seen, and the residual passes 1e100. All teeth stop, by symmetry, and so does the strip."""
    r = run(tmp_path, comb(solver__max_sweeps=most), "--quiet", "--threads", 1)
    assert r.summary["unconverged_steps"] == 0
    velocity = r.dataset("/frames/velocity")[-1]
    assert np.abs(velocity).max() < 1e-4
