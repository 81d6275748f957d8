# SPDX-License-Identifier: MIT
"""Floes that raft: the dumped problem of a step against an interior-point method that shares nothing with the sweeps.

    u = W r + q,   0 <= r_n <= bound,   u_n > 0 only where r_n = 0, u_n < 0 only where r_n = bound
    |r_t| <= μ r_n against u_t
    sheets on each other: (r_x, r_y) = α e + d, |α| <= 1, |d| <= R, the largest power against (u_x, u_y)

For friction bounds that are given this is a convex problem with discs; they follow the normal impulses in a sequence of
such problems. Then the rows that hold, and those that give way, are known, and what is left is a system of equations,
solved by Newton's method to the last digits.
"""
import h5py
import numpy as np
import pytest

from harness import changed, quick, run
from test_solver_reference import Problem

SPEED, TOLERANCE = 0.05, 1e-11
CLUSTER = {
    "run": {"dt": 0.1, "duration": 30},
    "domain": {"length": 4.5, "width": 3.5, "ends_closing": SPEED, "sides_closing": 0.6 * SPEED, "wall_friction": 0.1},
    "ice": {"concentration": 0.75, "size": 1, "friction": 0.2, "thickness_law": "lognormal", "rafting": {"kappa": 6}},
    "body": {"shape": "none"},
    "solver": {"tolerance": TOLERANCE, "max_sweeps": 1000000},
    "output": {"frame_interval": 30},
}


class Rafting(Problem):
    """z: impulses r, but that of sheets only by their disc, and then what the ends of their overlaps have."""

    def __init__(self, path):
        super().__init__(path)
        with h5py.File(path) as f:
            self.disc, ends = f["disc"][:], f["ends"][:].reshape(-1, 2)
        self.sheets = np.isfinite(self.disc)
        self.with_ends = np.flatnonzero(np.hypot(*ends.T) > 0)
        self.ends = ends[self.with_ends]
        self.longest = np.hypot(*self.ends.T)
        self.of_z = np.hstack([np.eye(2 * self.n), np.zeros((2 * self.n, len(self.ends)))])  # r = of_z z
        for column, k in enumerate(self.with_ends, 2 * self.n):
            self.of_z[[2 * k, 2 * k + 1], column] = self.ends[column - 2 * self.n] / self.longest[column - 2 * self.n]


def dump(folder, seed):
    """A step of a cluster in which several pairs raft."""
    case = changed(CLUSTER, ice__seed=seed)
    rafting, contacts = run(folder, changed(case, solver__tolerance=1e-4), "--steps", 200,
                            name="scan").series("rafting", "contacts")
    step = int(np.argmax((rafting >= 4) & (contacts >= 8))) + 8
    r = run(folder, case, "--steps", step, "--dump-contacts", f"{step}:{folder / 'dump.h5'}", name="out")
    assert r.series("unconverged")[-1] == 0 and r.series("rafting")[-1] >= 3
    return Rafting(folder / "dump.h5")


def interior_point(W, q, low, high, discs, radius):
    """min ½xᵀWx + qᵀx, low <= x <= high, |x[i, j]| <= R for pairs of rows: x of a primal-dual interior-point method, to
    some 1e-7."""
    n = len(q)
    box = np.ones(n, bool)
    box[discs] = False
    bounded = box & np.isfinite(high)
    x = np.where(bounded, 0.5 * (low + np.where(bounded, high, 0)), np.where(box, low + 1, 0))
    zl, zu, z, s = box * 1.0, bounded * 1.0, np.ones(len(discs)), 0.5 * radius
    a, b = np.where(box, x - low, 1), np.where(bounded, high - x, 1)
    for _ in range(200):
        gap = (zl @ a + zu[bounded] @ b[bounded] + z @ s) / (n + bounded.sum())
        v = x[discs]
        rest = (radius ** 2 - (v ** 2).sum(axis=1)) / (2 * radius) - s
        slope = W @ x + q
        error = slope - zl + zu
        np.add.at(error, discs, z[:, None] * v / radius[:, None])
        if gap < 1e-15 and np.abs(error).max() < 1e-11:
            break
        target = 0.2 * gap
        H = W + np.diag(np.where(box, zl / a, 0) + np.where(bounded, zu / b, 0) + 1e-15)
        right = -slope + np.where(box, target / a, 0) - np.where(bounded, target / b, 0)
        for k, (i, j) in enumerate(discs):
            H[[i, j], [i, j]] += z[k] / radius[k]
            H[np.ix_([i, j], [i, j])] += z[k] / (s[k] * radius[k] ** 2) * np.outer(v[k], v[k])
            right[[i, j]] -= v[k] / radius[k] * (target - z[k] * rest[k]) / s[k]
        d = 1 / np.sqrt(np.diag(H))
        dx = d * np.linalg.solve(d[:, None] * H * d, d * right)
        ds = rest - (v * dx[discs]).sum(axis=1) / radius
        dzl, dzu = np.where(box, (target - zl * dx) / a - zl, 0), np.where(bounded, (target + zu * dx) / b - zu, 0)
        dz = (target - z * ds) / s - z
        length = 1.0
        for p, dp in ((a[box], dx[box]), (b[bounded], -dx[bounded]), (s, ds), (zl[box], dzl[box]),
                      (zu[bounded], dzu[bounded]), (z, dz)):
            if (dp < 0).any():
                length = min(length, 0.99 * np.min(-p[dp < 0] / dp[dp < 0]))
        x, a, b, s = x + length * dx, a + length * dx, b - length * dx, s + length * ds
        zl, zu, z = zl + length * dzl, zu + length * dzu, z + length * dz
    else:
        raise AssertionError(f"the interior-point method has not converged: gap {gap:.2g}")
    return x


def from_scratch(p):
    """z of the problem, of which nothing but W, q, μ, bounds, discs and ends is looked at; approximate."""
    W, q = p.of_z.T @ p.W @ p.of_z, p.of_z.T @ p.q
    scale = 1 / np.sqrt(np.diag(W))
    rows = np.arange(2 * p.n).reshape(-1, 2)
    scale[rows[p.sheets, 1]] = scale[rows[p.sheets, 0]]  # both rows of sheets by the same factor: a disc must stay one
    unit = SPEED * np.median(scale)
    W, q = scale[:, None] * W * scale, scale * q / unit
    discs, radius = rows[p.sheets], p.disc[p.sheets] / scale[rows[p.sheets][:, 0]] / unit
    normal = p.r[1::2] * 0
    before = np.inf
    for _ in range(100):
        low, high = np.zeros(len(q)), np.full(len(q), np.inf)
        high[:2 * p.n:2] = np.where(p.sheets, np.inf, p.bound / scale[:2 * p.n:2] / unit)
        high[1:2 * p.n:2] = np.where(p.sheets, np.inf, np.maximum(p.mu * normal / scale[1:2 * p.n:2] / unit, 1e-9))
        low[1:2 * p.n:2] = -high[1:2 * p.n:2]
        high[2 * p.n:] = p.longest / scale[2 * p.n:] / unit
        low[2 * p.n:] = -high[2 * p.n:]
        z = scale * unit * interior_point(W, q, low, high, discs, radius)
        normal = np.where(p.sheets, 0, np.maximum(z[:2 * p.n:2], 0))
        change = np.abs(p.W @ p.of_z @ (z - before)).max() if np.all(np.isfinite(before)) else np.inf
        if change < 1e-7 * SPEED:
            return z
        before = z
    raise AssertionError("the sequence of friction bounds has not converged")


def polish(p, x):
    """The equations of the rows that hold and of those that give way, told apart by an approximate solution, solved to
    the last digits: r."""
    W, q, m = p.of_z.T @ p.W @ p.of_z, p.of_z.T @ p.q, len(x)
    u = W @ x + q
    small = 2e-5 * SPEED

    def bounded(E, J, i, z, v, least, bound):
        w = W[i, i]
        if u[i] > small or x[i] - least < small / w:                             # open, or gives way to the other side
            E[i], J[i, i] = (z[i] - least) * w, w
        elif u[i] < -small or bound - x[i] < small / w:                          # gives way
            E[i], J[i, i] = (z[i] - bound) * w, w
        else:
            E[i], J[i] = v[i], W[i]

    def equations(z):
        v, E, J = W @ z + q, np.zeros(m), np.zeros((m, m))
        for i in range(2 * p.n, m):
            bounded(E, J, i, z, v, -p.longest[i - 2 * p.n], p.longest[i - 2 * p.n])
        for k in range(p.n):
            i, j = 2 * k, 2 * k + 1
            if p.sheets[k]:
                if np.hypot(u[i], u[j]) < small:                                 # they stick
                    E[[i, j]], J[[i, j]] = v[[i, j]], W[[i, j]]
                else:                                                            # on the rim, against the sliding
                    w, (dx, dy) = W[i, i], z[[i, j]]
                    E[i] = (dx**2 + dy**2 - p.disc[k]**2) * w / (2 * p.disc[k])
                    E[j] = (dx * v[j] - dy * v[i]) / p.disc[k]
                    J[i, i], J[i, j] = dx * w / p.disc[k], dy * w / p.disc[k]
                    J[j] = (dx * W[j] - dy * W[i]) / p.disc[k]
                    J[j, i] += v[j] / p.disc[k]
                    J[j, j] -= v[i] / p.disc[k]
                continue
            bounded(E, J, i, z, v, 0, p.bound[k])
            if abs(u[j]) < small and abs(x[j]) * W[j, j] < p.mu[k] * x[i] * W[j, j] - small:
                E[j], J[j] = v[j], W[j]
            else:
                side, w = -np.sign(u[j]) if abs(u[j]) >= small else np.sign(x[j]), W[i, i]
                E[j], J[j, j], J[j, i] = (z[j] - side * p.mu[k] * z[i]) * w, w, -side * p.mu[k] * w
        return E, J

    z = x.copy()
    for _ in range(20):
        E, J = equations(z)
        z = z - np.linalg.lstsq(J, E, rcond=1e-13)[0]
    E, J = equations(z)
    return p.of_z @ z, np.abs(E).max(), np.linalg.cond(J / np.diag(W)[:, None])


@pytest.mark.parametrize("seed", quick(range(1, 11), 1, 4, 9))
def test_impulses_of_a_cluster(tmp_path, seed):
    p = dump(tmp_path, seed)
    # The law, row by row.
    rows = np.arange(2 * p.n).reshape(-1, 2)[p.sheets]
    r, u = p.r[rows], p.u[rows]
    directions = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(0, 2 * np.pi, 721)])
    ends = np.zeros((p.n, 2))
    ends[p.with_ends] = p.ends

    def reach(e):  # of each pair of sheets along e [sheets, 2]
        return np.abs((ends[p.sheets] * e).sum(axis=1)) + p.disc[p.sheets] * np.hypot(*e.T)

    assert len(p.ends) >= 2 and p.sheets.sum() >= 3
    for e in directions:
        assert np.all(r @ e <= reach(np.tile(e, (len(r), 1))) * (1 + 1e-12))
    slides = np.hypot(*u.T) > 1e-6 * SPEED
    np.testing.assert_allclose(-(r * u).sum(axis=1)[slides], reach(-u)[slides], rtol=1e-6)
    at_bound = (p.u[::2] < -1e-6 * SPEED) & ~p.sheets
    np.testing.assert_allclose(p.r[::2][at_bound], p.bound[at_bound], rtol=1e-6)
    # Another method, which has seen nothing of the solution.
    x = from_scratch(p)
    assert np.abs(p.W @ p.of_z @ x + p.q - p.u).max() < 1e-3 * SPEED
    r, error, _ = polish(p, x)
    assert error < 1e-13
    assert np.abs(p.W @ r + p.q - p.u).max() < 1e-8 * SPEED
    # Impulses between walls may be shared out in several ways; those that follow from a velocity are unique.
    unique = np.zeros((p.n, 2), bool)
    # ends that do not slide may share a load with the friction of their edge
    across = np.abs((ends[p.sheets] * u).sum(axis=1)) > 1e-6 * SPEED * np.hypot(*ends[p.sheets].T)
    unique[np.flatnonzero(p.sheets)[slides & (across | (np.hypot(*ends[p.sheets].T) == 0))]] = True
    unique[at_bound, 0] = True
    assert np.abs(((r - p.r) * np.diag(p.W))[unique.ravel()]).max() < 1e-8 * SPEED


def thrown(seed):
    """Four floes thrown together in open water."""
    rng = np.random.default_rng(seed)
    floes = []
    for k in range(4):
        way = np.pi / 2 * (k + 0.3 * rng.random())
        x, y = np.cos(way), np.sin(way)
        shape = {"shape": "rectangle", "length": 0.7 + 0.2 * rng.random(), "width": 0.7 +
                 0.2 * rng.random()} if k % 2 else {"shape": "disc", "length": 0.8 + 0.2 * rng.random()}
        floes.append(shape | {"x": 5 + x, "y": y, "yaw": float(90 * rng.random()), "vx": -0.8 * x, "vy": -0.8 * y,
                              "yaw_rate": float(20 * rng.random() - 10), "thickness": 0.03 + 0.03 * rng.random()})
    return {
        "run": {"dt": 0.05, "duration": 3}, "domain": {"length": 10, "width": 10, "ends": "open", "sides": "open"},
        "ice": {"concentration": 0, "friction": 0.2, "rafting": {"kappa": 6}}, "body": {"shape": "none"},
        "floes": floes, "solver": {"tolerance": TOLERANCE, "max_sweeps": 1000000, "reference_speed": SPEED}
    }


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 7, 8, 10, 11, 12])
def test_impulses_without_walls(tmp_path, seed):
    """Few enough contacts that all impulses are unique (with the seeds 5, 6 and 9 they are not)."""
    case = thrown(seed)
    rafting, friction = run(tmp_path, case, "--steps", 60, name="scan").series("rafting", "raft_friction_work")
    step = int(np.argmax((rafting >= 2) & (friction > 0))) + 2
    r = run(tmp_path, case, "--steps", step, "--dump-contacts", f"{step}:{tmp_path / 'dump.h5'}", name="out")
    p = Rafting(tmp_path / "dump.h5")
    assert p.sheets.sum() >= 2 and r.series("unconverged")[-1] == 0
    x, error, condition = polish(p, from_scratch(p))
    assert error < 1e-13 and condition < 1e6
    assert np.abs((x - p.r) * np.diag(p.W)).max() < 1e-8 * SPEED
