# SPDX-License-Identifier: MIT
"""Does ice arch at a gap in a boom? Arrest over block/gap, friction and concentration; see README.md.

    arching.py            every run of README.md, its tables (arching.md) and the picture (arching.png)
    arching.py --part map the map alone; also: concentration, two-sizes, numerics, shape, speed, width

Arrest: no block passes the gap over the last 10 blocks of the boom's way, while blocks lie ahead of the gap. A block
passes when its centre crosses the middle of the plate, between two frames.
"""
import json
from pathlib import Path

from points import ended, every, parser, wilson

from bergtow import writing
from bergtow.cli import command  # points has set the path
from bergtow.plot import style
from bergtow.result.run import Run

import numpy as np
from matplotlib.patches import Rectangle
from scipy.optimize import minimize

BLOCK, SPEED, START, WAY = 0.1, 0.1, 0.3, 60  # m, m/s, m, blocks: as in arching.yml
PACKED = 0.78                        # least concentration of pushed blocks: how far packed ice can reach
RATIOS = (0.05, 0.067, 0.10, 0.15, 0.25)
FRICTIONS = (0.05, 0.1, 0.2, 0.4)
PARTS = ("map", "concentration", "two-sizes", "numerics", "shape", "speed", "width")
OBSERVED = 0.10                      # no arch up to this block/gap
PAUSE = 10                           # blocks of way without a passage
EXACT = {"solver__tolerance": 1e-4, "solver__max_sweeps": 5000}
SHAPES = {"sawn": {"ice__shape": "rectangles"}, "irregular": {"ice__shape": "voronoi"},
          "spread": {"ice__size_spread": 0.3}}


def keys(ratio, friction=0.2, concentration=0.5, seed=1, widths=2.0, speed=SPEED, way=WAY, step=0.1, **more):
    """Keys of one run: a gap of BLOCK / ratio in a channel `widths` gaps wide; step: way per time step, in blocks."""
    gap = BLOCK / ratio
    reach = way * BLOCK * PACKED / (PACKED - concentration)
    return {"ice__friction": friction, "ice__concentration": concentration, "ice__seed": seed,
            "domain__width": f"{widths * gap:.6g} m", "body__width": f"{(widths - 1) * gap:.6g} m",
            "domain__length": f"{START + reach + 5 * BLOCK:.6g} m", "tow__speed": f"{speed:.6g} m/s",
            "tow__ramp": f"{BLOCK / speed:.6g} s", "run__dt": f"{step * BLOCK / speed:.6g} s",
            "run__duration": f"{way * BLOCK / speed:.6g} s", "output__frame_interval": f"{BLOCK / speed:.6g} s", **more}


def flow(folder):
    """Blocks that pass between frames, arrest, and how sound the run is."""
    with Run(folder) as r:
        x = np.array([r.pose(k)[:, 0] for k in range(r.n_frames)])
        body = np.array([r.body_pose(k)[r.towed, 0] for k in range(r.n_frames)])
        speed = r.speed(r.n_frames - 1)
        out = {name: r.summary[name] for name in ("unconverged_steps", "n_steps", "wall_time_s", "mean_sweeps")}
        out["overlap"] = r.summary["max_overlap_relative"]
    ahead = x > body[:, None]
    passed = (ahead[:-1] & ~ahead[1:]).sum(1)
    last = np.flatnonzero(passed)
    pause = len(passed) - 1 - last[-1] if len(last) else len(passed)
    far = x[-1].max()
    out.update(passed=passed.tolist(), arrest=bool(pause >= PAUSE and ahead[-1].any()),
               after=int(len(passed) - pause), undisturbed=bool(speed[:x.shape[1]][x[-1] > far - BLOCK].max() < 1e-6))
    return out


def jobs(part, fields):
    """[(labels, name, keys)] of a part."""
    found = []

    def add(labels, name, **values):
        for seed in range(1, fields + 1):
            found.append((labels, f"{name}-s{seed}", keys(seed=seed, **values)))

    if part == "map":
        for ratio in RATIOS:
            for mu in FRICTIONS:
                add({"ratio": ratio, "friction": mu}, f"map-r{ratio}-f{mu}", ratio=ratio, friction=mu)
    if part == "concentration":
        for ratio in (0.10, 0.15, 0.20, 0.25):
            for c in (0.2, 0.3, 0.4, 0.5, 0.6):
                add({"ratio": ratio, "concentration": c}, f"c{c}-r{ratio}", ratio=ratio, concentration=c)
    if part == "numerics":
        add({"change": "tolerance 1e-4", "friction": 0.2}, "tolerance", ratio=0.10, **EXACT)
        add({"change": "tolerance 1e-4", "friction": 0.4}, "tolerance-f0.4", ratio=0.10, friction=0.4, **EXACT)
        add({"change": "half the time step", "friction": 0.2}, "step", ratio=0.10, step=0.05)
    if part == "shape":
        for ratio in (0.10, 0.15):
            for name, more in SHAPES.items():
                add({"shape": name, "ratio": ratio}, f"{name}-r{ratio}", ratio=ratio, **more)
    if part == "speed":
        for v in (0.05, 0.1, 0.2):  # the same time step in seconds: a fast boom moves farther in a step
            add({"speed": v}, f"speed{v}", ratio=0.15, speed=v, step=v / 2)
    if part == "width":
        for widths in (1.5, 3, 4):
            add({"widths": widths}, f"width{widths}", ratio=0.25, widths=widths, concentration=0.4)
    if part == "two-sizes":
        for c in (0.2, 0.3, 0.4):
            add({"concentration": c}, f"two-c{c}", ratio=0.20, concentration=c, step=0.05, ice__outlines="")
    return found


def corners(x, y, yaw, side):
    """Corners [4, 2] of a square."""
    turned = np.arctan2((1, 1, -1, -1), (-1, 1, 1, -1))[::-1] + yaw
    return np.column_stack((x + side / np.sqrt(2) * np.cos(turned), y + side / np.sqrt(2) * np.sin(turned)))


def apart(p, yaw_p, q, yaw_q):
    """Is square p clear of squares q [n, 4, 2]? Along an axis of one of the two (separating axis)."""
    clear = np.zeros(len(q), bool)
    for yaw in (np.full(len(q), yaw_p), yaw_q):
        for turn in (0, np.pi / 2):
            axis = np.column_stack((np.cos(yaw + turn), np.sin(yaw + turn)))
            on_p, on_q = p @ axis.T, np.einsum("nij,nj->ni", q, axis)
            clear |= (on_p.max(0) < on_q.min(1)) | (on_q.max(1) < on_p.min(0))
    return clear


def two_sizes(path, length, width, concentration, seed):
    """GeoJSON of squares of BLOCK and of half of that, equal areas of both, dropped at random where there is room."""
    rng = np.random.default_rng(seed)
    begin, end = START + 3 * BLOCK, length
    n = int(round(concentration * (end - begin) * width / 2 / BLOCK**2))
    sides = np.array([BLOCK] * n + [BLOCK / 2] * (4 * n))
    at, yaws, q = np.zeros((0, 2)), np.zeros(0), np.zeros((0, 4, 2))
    for side in sides:
        while True:
            half = side / np.sqrt(2)
            x, y = rng.uniform(begin + half, end - half), rng.uniform(-width / 2, width / 2)
            yaw = rng.uniform(0, np.pi / 2)
            shift = np.round((at[:, 1] - y) / width) * width  # periodic across
            near = np.hypot(at[:, 0] - x, at[:, 1] - shift - y) < half + BLOCK / np.sqrt(2)
            p = corners(x, y, yaw, side)
            if apart(p, yaw, q[near] - np.stack((0 * shift, shift), 1)[near][:, None], yaws[near]).all():
                break
        at, yaws, q = np.vstack((at, (x, y))), np.append(yaws, yaw), np.concatenate((q, p[None]))
    rings = [[*outline.tolist(), outline[0].tolist()] for outline in q]
    path.parent.mkdir(parents=True, exist_ok=True)
    features = [{"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
                for ring in rings]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")


def prepared(out, part, fields):
    """jobs(), with the ice that is read in files of the folder out."""
    todo = jobs(part, fields)
    for _, name, values in todo:
        if "ice__outlines" in values:
            path = (out / part / f"{name}.geojson").resolve()
            two_sizes(path, *(float(values[f"domain__{key}"].split()[0]) for key in ("length", "width")),
                      values.pop("ice__concentration"), values["ice__seed"])
            values.update(ice__outlines=path, ice__outlines_crs="frame")
    return todo


def study(a, part):
    """Rows of a part: its labels with the results of its fields."""
    todo = prepared(a.out, part, a.fields)
    results = every(a, [(f"{part}/{name}", values) for _, name, values in todo], flow)
    rows = {}
    for (labels, _, _), result in zip(todo, results):
        rows.setdefault(json.dumps(labels), []).append(result)
    return [{**json.loads(labels), "runs": found} for labels, found in rows.items()]


def critical(rows):
    """Where half of the fields arch: logit P = a + b ln C + c ln(block/gap), so C ~ (block/gap)^(-c/b).

    Returns (a, b, c). A weak pull towards 0 keeps b finite where arrest sets in at once.
    """
    cases = [(np.log(r["concentration"]), np.log(r["ratio"]), run["arrest"]) for r in rows for run in r["runs"]]
    log_c, log_r, y = np.array(cases, float).T
    terms = np.column_stack((np.ones_like(log_c), log_c - np.log(0.4), log_r - np.log(0.2)))

    def cost(q):
        z = terms @ q
        return np.sum(np.logaddexp(0, z) - y * z) + 0.5e-3 * q @ q

    q = minimize(cost, np.zeros(3), method="BFGS").x
    return q[0] - q[1] * np.log(0.4) - q[2] * np.log(0.2), q[1], q[2]


def critical_draws(rows, draws=500):
    """critical() of fields drawn with replacement."""
    rng = np.random.default_rng(1)
    return np.array([critical([{**r, "runs": [r["runs"][i] for i in rng.integers(len(r["runs"]), size=len(r["runs"]))]}
                               for r in rows]) for _ in range(draws)])


def at_half(q, ratio):
    return np.exp(-(q[..., 0] + q[..., 2] * np.log(ratio)) / q[..., 1])


def table(rows):
    """Arrests of each point, with their interval, the way to them, and steps that did not converge."""
    names = [key for key in rows[0] if key != "runs"]
    lines = ["| " + " | ".join(names) + " | arrests | probability (95 %) | way to it, blocks | steps not converged |",
             "| --- " * (len(names) + 4) + "|"]
    for row in rows:
        found = row["runs"]
        k, n = sum(r["arrest"] for r in found), len(found)
        way = [r["after"] for r in found if r["arrest"]]
        low, high = wilson(k, n)
        lines.append("| " + " | ".join(str(row[key]) for key in names) + f" | {k} of {n} | {low:.2f} to {high:.2f} | "
                     + (f"{min(way)} to {max(way)}" if len(way) > 1 else str(*way) or "–") +
                     f" | {sum(r['unconverged_steps'] for r in found)} of {sum(r['n_steps'] for r in found)} |")
    return "\n".join(lines)


def draw_map(ax, rows):
    """Cells of arrest probability over block/gap and friction, with the observed limit."""
    ratios, mus = (sorted({r[key] for r in rows}) for key in ("ratio", "friction"))
    for row in rows:
        i, j = ratios.index(row["ratio"]), mus.index(row["friction"])
        k, n = sum(r["arrest"] for r in row["runs"]), len(row["runs"])
        low, high = wilson(k, n)
        ax.add_patch(Rectangle((i - 0.5, j - 0.5), 1, 1, fc=style.FORCE_MAP(k / n), ec=style.PAPER))
        ink = style.PAPER if k / n > 0.5 else style.INK
        ax.text(i, j, f"{k} of {n}\n{low:.2f}–{high:.2f}", ha="center", va="center", fontsize=9, color=ink)
    limit = sum(r <= OBSERVED for r in ratios) - 0.5
    ax.axvline(limit, color=style.TOW, lw=2.5)
    ax.text(limit - 0.05, len(mus) - 0.4, "observed: no arch", ha="right", color=style.TOW)
    ax.text(limit + 0.05, len(mus) - 0.4, "arches", ha="left", color=style.TOW)
    ax.set(xlim=(-0.5, len(ratios) - 0.5), ylim=(-0.5, len(mus) - 0.2), xticks=range(len(ratios)), xticklabels=ratios,
           yticks=range(len(mus)), yticklabels=mus, xlabel="block / gap", ylabel="friction (assumed)",
           title="Arrests, 95 % interval; 50 % ice")


def draw_concentration(ax, rows):
    """Arrest probability over concentration, with the fit."""
    q = np.array(critical(rows))
    colours = (style.ICE, style.TOW, style.DRAG, style.INERTIA)
    for shift, (ratio, colour) in enumerate(zip(sorted({r["ratio"] for r in rows}), colours)):
        chosen = [r for r in rows if r["ratio"] == ratio]
        for row in chosen:
            k, n = sum(r["arrest"] for r in row["runs"]), len(row["runs"])
            low, high = wilson(k, n)
            at = row["concentration"] + 0.006 * (shift - 1.5)
            ax.plot([at, at], [low, high], color=colour, lw=1.2, alpha=0.6)
            ax.plot(at, k / n, "o", color=colour, ms=5, label=f"block/gap {ratio:g}" if row is chosen[0] else None)
        c = np.linspace(0.15, 0.65, 200)
        ax.plot(c, 1 / (1 + np.exp(-(q[0] + q[1] * np.log(c) + q[2] * np.log(ratio)))), color=colour, lw=1)
    ax.set(xlabel="concentration of the ice that comes", ylabel="probability of arrest", ylim=(-0.03, 1.03),
           title="Friction 0.2; lines: logistic fit")
    ax.legend(frameon=False, fontsize=8.5, loc="upper left")


def draw_arch(ax, folder):
    """The last frame of a run about the gap."""
    with Run(folder) as r:
        last = r.n_frames - 1
        body = r.body_pose(last)[r.towed]
        width = r.value("domain.width")
        for shift in (-width, 0, width):
            for p in r.polygons(last):
                ax.fill(p[:, 0] - body[0], p[:, 1] + shift, fc=style.FORCE_MAP(0), ec=style.WATER, lw=0.5)
            for p in r.body_polygons(last)[r.towed:r.towed + 1]:
                ax.fill(p[:, 0] - body[0], p[:, 1] + shift, fc=style.BODY)
        gap = width - r.value("body.width")
    ax.set(xlim=(-gap, 2 * gap), ylim=(width / 2 - 1.5 * gap, width / 2 + 1.5 * gap), aspect="equal",
           facecolor=style.WATER, xlabel="x from the boom (m)", ylabel="y (m)", title="An arch, block/gap 0.15")
    ax.locator_params(nbins=5)


def draw(out, parts):
    figure, axes = style.subplots(1, 3, figsize=(15, 4.9), gridspec_kw={"width_ratios": (1.25, 1.1, 0.9)})
    draw_map(axes[0], parts["map"])
    draw_concentration(axes[1], parts["concentration"])
    arched = next((f"map-r0.15-f{row['friction']}-s{i + 1}" for row in parts["map"] if row["ratio"] == 0.15
                   for i, run in enumerate(row["runs"]) if run["arrest"]), None)
    if arched:
        draw_arch(axes[2], out / "map" / arched)
    figure.suptitle("Square blocks at a gap in a boom", x=0.01, ha="left", weight="bold")
    figure.tight_layout()
    return figure


def report(out):
    """Tables and picture of the parts that are there."""
    parts = {part: json.loads((out / f"{part}.json").read_text(encoding="utf-8")) for part in PARTS
             if (out / f"{part}.json").exists()}
    text = "\n\n".join(f"**{part}**\n\n{table(rows)}" for part, rows in parts.items())
    if "concentration" in parts:
        rows = parts["concentration"]
        q, draws = np.array(critical(rows)), critical_draws(rows)
        text += "\n\n| block/gap | critical concentration (95 %) |\n| --- | --- |\n"
        for ratio in sorted({r["ratio"] for r in rows}):
            low, high = np.percentile(at_half(draws, ratio), (2.5, 97.5))
            text += f"| {ratio:g} | {at_half(q, ratio):.2f} ({low:.2f} to {high:.2f}) |\n"
        low, high = np.percentile(draws[:, 2] / draws[:, 1], (2.5, 97.5))
        text += f"\nC ~ (block/gap)^-n: n {q[2] / q[1]:.2f} (95 %: {low:.2f} to {high:.2f})"
    (out / "arching.md").write_text(text + "\n", encoding="utf-8")
    print(f"\n{text}")
    if {"map", "concentration"} <= parts.keys():
        writing.save(draw(out, parts), out / "arching.png", force=True)


@ended
@style.look()
def main(argv=None):
    p = parser("Arching of square blocks at a gap in a boom.", "arching", 10)
    p.add_argument("--part", choices=PARTS, nargs="+", default=PARTS)
    a = p.parse_args(argv)
    for part in a.part:
        (a.out / f"{part}.json").write_text(json.dumps(study(a, part)), encoding="utf-8")
    report(a.out)


if __name__ == "__main__":
    command.guarded(Path(__file__).name, main)
