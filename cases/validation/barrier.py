# SPDX-License-Identifier: MIT
"""Load of a current-driven ice cover on a barrier in a channel with walls, against its length; see README.md.

    barrier.py            every run of README.md, its tables (barrier.md) and the picture (barrier.png)

Drag tau on each area of the cover, a share K of the pressure p passed to the walls, friction mu there:

    B dp/dx = tau B phi - 2 mu K p,   load F = B p = F_inf (1 - exp(-L / l)),   l = B / (2 mu K),   F_inf = tau phi B l

the form of Janssen 1895 for silos. With F_0 = tau phi B L, the drag on the whole cover, F / F_0 = (1 - exp(-x)) / x at
x = L / l: one unknown, l. L is that of the packed cover.
"""
import json
from pathlib import Path

from points import ended, every, parser

from bergtow import writing
from bergtow.cli import command  # points has set the path
from bergtow.plot import style
from bergtow.result.run import Run

import numpy as np
from scipy.optimize import minimize_scalar

LENGTHS = (2, 4, 8, 12, 24)  # of the cover as it comes, in widths
#: (width in m, friction of the walls): the longest cover, in widths; floes are 0.4 m
CHANNELS = {(2.0, 0.3): 24, (2.0, 0.6): 24, (3.0, 0.3): 12, (3.0, 0.6): 12, (4.0, 0.3): 12, (4.0, 0.6): 12,
            (6.0, 0.6): 8}
RAFTED = (4.0, 0.3)          # the channel in which the cover rafts, too
KAPPA = 10                   # of the covers that raft
WINDOW = 50.0                # s, as in barrier.yml
GRAVITY = 9.80665            # m/s2
DRAWS = 1000                 # of the bootstrap


def keys(width, friction, lengths, seed, kappa=0):
    """Keys of one run."""
    long = lengths * width
    return {"domain__width": f"{width:g} m", "body__width": f"{width - 0.1:g} m", "domain__length": f"{long + 5:g} m",
            "ice__x_max": f"{long + 0.5:g} m", "body__x": f"{long + 0.8:g} m", "domain__wall_friction": friction,
            "ice__rafting__kappa": kappa, "ice__seed": seed}


def load(folder):
    """Load on the barrier over the window, N, the drag on the whole cover, and the length of the packed cover."""
    with Run(folder) as r:
        use = r["time"] >= WINDOW
        force = -r["ice_resistance"][use]
        half = len(force) // 2
        speed, current = r.value("tow.speed"), r.value("water.current_x")
        rho, water = (float(r.case[f"{key}.density"].split()[0]) for key in ("ice", "water"))
        tau = water * r.value("ice.drag.water_skin") * (current - speed)**2
        outlines = r.polygons(r.n_frames - 1)
        x = np.concatenate([p[:, 0] for p in outlines])
        body = r.body_pose(r.n_frames - 1)[r.towed, 0] - 0.1
        edge = 0.5 * r.value("ice.rafting.kappa") * rho * (1 - rho / water) * GRAVITY * r.value("ice.thickness")**2
        out = {name: r.summary[name] for name in ("unconverged_steps", "n_steps", "wall_time_s", "n_floes")}
        return {
            **out, "force": float(force.mean()), "drift": float(force[half:].mean() / force[:half].mean() - 1),
            "drag": float(tau * r.area.sum()), "length": float(body - x.min()), "lost": int(r.n_floes - len(outlines)),
            "line_load": float(edge), "overlap": r.summary["max_overlap_relative"]
        }


def jobs(fields):
    """[(labels, name, keys)]."""
    found = []
    for kappa, channels in ((0, list(CHANNELS)), (KAPPA, [RAFTED])):
        for width, mu in channels:
            for n in (n for n in LENGTHS if n <= CHANNELS[width, mu]):
                for seed in range(1, fields + 1):
                    labels = {"kappa": kappa, "width": width, "friction": mu, "lengths": n}
                    found.append((labels, f"b{width:g}-f{mu:g}-l{n}-k{kappa:g}-s{seed}",
                                  keys(width, mu, n, seed, kappa)))
    return found


def share(length, scale):
    """F / F_0 of the Janssen form."""
    x = length / scale
    return -np.expm1(-x) / x


def fit(rows):
    """Length scale l of rows of one width and friction, m: least squares of F / F_0, over l from L / 100 to 100 L."""
    length, force, drag = (np.array([r[key] for r in rows]) for key in ("length", "force", "drag"))
    ends = np.log(length.mean()) + np.array([-1, 1]) * np.log(100)
    return np.exp(minimize_scalar(lambda s: np.sum((share(length, np.exp(s)) - force / drag)**2), bounds=ends,
                                  method="bounded", options={"xatol": 1e-9}).x)


def redrawn(rows, rng):
    """As many rows, drawn with replacement among the fields of each length."""
    groups = {}
    for r in rows:
        groups.setdefault(r["lengths"], []).append(r)
    return [g[i] for g in groups.values() for i in rng.integers(len(g), size=len(g))]


def fits(rows):
    """[(width, friction, l, its draws)] of covers that do not raft."""
    rng = np.random.default_rng(1)
    found = []
    for width, mu in sorted({(r["width"], r["friction"]) for r in rows if not r["kappa"]}):
        chosen = [r for r in rows if (r["width"], r["friction"], r["kappa"]) == (width, mu, 0)]
        found.append((width, mu, fit(chosen), np.array([fit(redrawn(chosen, rng)) for _ in range(DRAWS)])))
    return found


def exponents(found):
    """a and b of l ~ B^a mu^b, each with its draws; 1 and -1 by Janssen."""
    terms = np.array([(1, np.log(width), np.log(mu)) for width, mu, _, _ in found])

    def solve(scales):
        return np.linalg.lstsq(terms, np.log(scales), rcond=None)[0][1:]

    draws = np.array([solve(scales) for scales in np.array([d for *_, d in found]).T])
    return solve([scale for _, _, scale, _ in found]), draws


def between(draws):
    return "{:.3g} to {:.3g}".format(*np.percentile(draws, (2.5, 97.5)))


def mean_of(rows):
    """Mean of F / F_0 and its standard error."""
    found = np.array([r["force"] / r["drag"] for r in rows])
    return found.mean(), found.std(ddof=1) / np.sqrt(len(found)) if len(found) > 1 else np.nan


def line_load(rows):
    """q_0 = kappa / 2 rho_i (1 - rho_i / rho_w) g h2 of covers that raft, N/m."""
    return next(r["line_load"] for r in rows if r["kappa"])


def table(rows, found):
    lines = ["| width, m | wall friction | length scale l, m (95 %) | l / width | K = width / (2 friction l) (95 %) |",
             "| --- | --- | --- | --- | --- |"]
    for width, mu, scale, draws in found:
        lines.append(f"| {width:g} | {mu:g} | {scale:.2f} ({between(draws)}) | {scale / width:.2f} | "
                     f"{width / (2 * mu * scale):.3f} ({between(width / (2 * mu * draws))}) |")
    lines += ["", "| width, m | wall friction | kappa | " + " | ".join(f"{n} widths" for n in LENGTHS) + " |",
              "| --- " * (3 + len(LENGTHS)) + "|"]
    for kappa, width, mu in sorted({(r["kappa"], r["width"], r["friction"]) for r in rows}):
        cells = []
        for n in LENGTHS:
            chosen = [r for r in rows if (r["kappa"], r["width"], r["friction"], r["lengths"]) == (kappa, width, mu, n)]
            cells.append("–" if not chosen else f"{np.mean([r['force'] for r in chosen]):.2f} N, " +
                         "{:.3f} ± {:.3f}".format(*mean_of(chosen)))
        lines.append(f"| {width:g} | {mu:g} | {kappa:g} | " + " | ".join(cells) + " |")
    (a, b), draws = exponents(found)
    lines += ["", f"l ~ width^a friction^b: a {a:.2f} (95 %: {between(draws[:, 0])}), "
              f"b {b:.2f} (95 %: {between(draws[:, 1])})"]
    return "\n".join(lines)


def draw(rows, found):
    """Collapse of F / F_0 over L / l, length scale over width, and the load of covers that raft."""
    figure, axes = style.subplots(1, 3, figsize=(14, 4.7))
    colours = dict(zip(sorted({width for width, _ in CHANNELS}), (style.ICE, style.TOW, style.DRAG, style.INERTIA)))
    for width, mu, scale, draws in found:
        chosen = [r for r in rows if (r["width"], r["friction"], r["kappa"]) == (width, mu, 0)]
        mark = "o" if mu == RAFTED[1] else "^"
        axes[0].plot([r["length"] / scale for r in chosen], [r["force"] / r["drag"] for r in chosen], mark, ms=4,
                     alpha=0.6, color=colours[width], label=f"{width:g} m, friction {mu:g}")
        low, high = np.percentile(draws, (2.5, 97.5))
        axes[1].errorbar(width / (2 * mu), scale, [[scale - low], [high - scale]], fmt=mark, capsize=3,
                         color=colours[width], label=f"{width:g} m, friction {mu:g}")
    x = np.linspace(0.01, axes[0].get_xlim()[1], 200)
    axes[0].plot(x, share(x, 1), color=style.INK, lw=1.5, label="Janssen form")
    axes[0].set(xlabel="length / length scale l", ylabel="load / drag on the cover", ylim=(0, 1.05),
                title="Rigid floes: one curve")
    reach = np.array([0, 1.05 * max(w / (2 * mu) for w, mu, *_ in found)])
    one = np.exp(np.mean([np.log(scale * 2 * mu / w) for w, mu, scale, _ in found]))
    axes[1].plot(reach, one * reach, color=style.INK, lw=1.5, label=f"proportional, K = {1 / one:.2f}")
    axes[1].set(xlabel="width / (2 wall friction)  (m)", ylabel="length scale l (m)", xlim=(0, None), ylim=(0, None),
                title="Length scale")
    width, mu = RAFTED
    for kappa, colour, mark in ((0, colours[width], "o"), (KAPPA, style.CORIOLIS, "s")):
        chosen = [r for r in rows if (r["width"], r["friction"], r["kappa"]) == (width, mu, kappa)]
        axes[2].plot([r["lengths"] for r in chosen], [r["force"] / width for r in chosen], mark, ms=5, alpha=0.6,
                     color=colour, label=f"rafting, kappa {kappa:g}" if kappa else "rigid")
    axes[2].axhline(line_load(rows), color=style.CORIOLIS, lw=1, ls="--", label="line load of rafting")
    axes[2].set(xlabel="length of the cover as it comes / width", ylabel="load per width (N/m)", ylim=(0, None),
                title=f"Width {width:g} m, friction {mu:g}")
    for ax in axes:
        ax.legend(frameon=False, fontsize=8.5)
    figure.suptitle("Ice cover on a barrier in a channel", x=0.01, ha="left", weight="bold")
    figure.tight_layout()
    return figure


@ended
@style.look()
def main(argv=None):
    a = parser("Load of an ice cover on a barrier in a channel.", "barrier", 6).parse_args(argv)
    todo = jobs(a.fields)
    results = every(a, [(name, values) for _, name, values in todo], load)
    rows = [{**labels, **result} for (labels, _, _), result in zip(todo, results)]
    (a.out / "barrier.json").write_text(json.dumps(rows), encoding="utf-8")
    found = fits(rows)
    text = table(rows, found)
    (a.out / "barrier.md").write_text(text + "\n", encoding="utf-8")
    writing.save(draw(rows, found), a.out / "barrier.png", force=True)
    print(f"\n{text}\n\nsteps not converged: {sum(r['unconverged_steps'] for r in rows)} of "
          f"{sum(r['n_steps'] for r in rows)}; load in the second half of the window against the first: "
          f"{min(r['drift'] for r in rows):+.2%} to {max(r['drift'] for r in rows):+.2%}")


if __name__ == "__main__":
    command.guarded(Path(__file__).name, main)
