# SPDX-License-Identifier: MIT
"""Blind prediction of the ice resistance of a ship model in plastic floes; see README.md.

    ship.py               every run of the prediction, its table (ship.md) and the picture (ship.png)
    ship.py --map FILE    the same ship in the ice that was there: along lanes of the map in FILE, and through made ice
                          with the spread of its sizes (map.md); nrc_outlines.py says where FILE is from

Friction is not known, of floes and hull alike: the prediction is a band over it. Rows below the band change one other
assumption at a time, at the friction of ship.yml.
"""
import json
import subprocess
from pathlib import Path

import nrc_outlines
from points import ended, every, parser

from bergtow import writing
from bergtow.cli import command  # points has set the path
from bergtow.plot import style
from bergtow.result.run import Run

import numpy as np
from scipy.stats import t as student

FRICTIONS = (0.05, 0.10, 0.15, 0.20, 0.25, 0.30, 0.35)
OTHERS = {
    "squares": {"ice__shape": "rectangles"},
    "sizes spread by 0.5": {"ice__size_spread": 0.5},
    "hull friction 0.05": {"body__friction": 0.05},
    "restitution 0.3": {"ice__restitution": 0.3},
    "no side walls": {"domain__sides": "periodic"},
    "half the time step": {"run__dt": "0.05 s"},
}
#: frictions of the floes that were there
MEASURED = (0.05, 0.15, 0.35)
MAP_LENGTH, MAP_WIDTH = 23.0, 7.0  # m, the strip with open water at both ends of its ice
LANES = (-2.2, -1.1, 0.0, 1.1, 2.2)  # m: places of the ship across the map, three of its widths apart
SECOND = 1.0  # s: the standard deviation is also given of means over that time, which depend less on the time step


def resistance(folder):
    """Mean and standard deviation of the ice resistance over the window, N."""
    with Run(folder) as r:
        begin, end = r.window
        use = (r["time"] > begin) & (r["time"] <= end)
        force, dt = r["ice_resistance"][use], r.number("dt_s")
        n = int(round(SECOND / dt))
        slow = force[:len(force) // n * n].reshape(-1, n).mean(1)
        return {"mean": r.number("mean_ice_resistance_n"), "sd": float(force.std()), "slow": float(slow.std()),
                "unconverged_steps": r.summary["unconverged_steps"], "wall_time_s": r.summary["wall_time_s"],
                "overlap": r.summary["max_overlap_relative"], "second": slow.tolist(),
                "estimates": {k: e.force for k, e in r.estimates.items() if e.valid and not e.on_top}}


def jobs(fields):
    """[(label, name, keys)]: the band, then the other assumptions."""
    found = [(f"friction {mu:.2f}", f"f{mu:.2f}-s{seed}", {"ice__friction": mu, "ice__seed": seed})
             for mu in FRICTIONS for seed in range(1, fields + 1)]
    return found + [(label, f"{label.replace(' ', '-')}-s{seed}", {"ice__seed": seed, **more})
                    for label, more in OTHERS.items() for seed in range(1, fields + 1)]


def jobs_of_map(a):
    """[(label, name, keys)] of the map a.map, from both of its ends, and of ice made with the spread of its sizes.
    Errors: nrc_outlines.Refused, OSError, CalledProcessError."""
    rings = nrc_outlines.outlines(nrc_outlines.read(a.map.read_bytes()))
    todo = []
    for name, turned in (("there", rings), ("back", [[MAP_LENGTH, 0.0] - ring for ring in rings])):
        raw, floes = a.out / f"{name}-as-read.geojson", a.out / f"{name}.geojson"
        nrc_outlines.write(turned, raw)
        subprocess.run([a.bergtow, "outlines", raw, "-o", floes, "--centre", "0,0", "--force"],
                       check=True, stdout=subprocess.DEVNULL)
        keys = {"ice__outlines": floes.resolve(), "ice__nonconvex": "split", "domain__length": f"{MAP_LENGTH} m",
                "domain__width": f"{MAP_WIDTH} m", "ice__seed": 1}
        cases = [(f"map, friction {mu:.2f}", f"f{mu:.2f}", {"ice__friction": mu}) for mu in MEASURED]
        cases += [("map, no end walls", "open", {"domain__ends": "open"})]
        todo += [(label, f"{name}{lane:+g}-{short}", keys | {"body__y": lane} | more)
                 for label, short, more in cases for lane in LANES]
    # longer, so that no large floe is pressed on the end wall
    sizes = {"ice__size_law": "lognormal", "ice__size_spread": 0.77, "domain__length": "24 m"}
    made = [(f"sizes as measured, friction {mu:.2f}", f"sizes-f{mu:.2f}-s{seed}",
             sizes | {"ice__friction": mu, "ice__seed": seed}) for mu in MEASURED for seed in range(1, a.fields + 1)]
    return sorted(todo, key=lambda job: job[0]) + made


def point(runs):
    """Mean over the fields with its 95 % interval, range of the fields, and standard deviations within a run."""
    means = np.array([r["mean"] for r in runs])
    half = student.ppf(0.975, len(means) - 1) * means.std(ddof=1) / np.sqrt(len(means)) if len(means) > 1 else np.nan
    return {"mean": means.mean(), "low": means.mean() - half, "high": means.mean() + half, "least": means.min(),
            "most": means.max(), "sd": np.sqrt(np.mean([r["sd"]**2 for r in runs])),
            "slow": np.sqrt(np.mean([r["slow"]**2 for r in runs])), "n": len(runs),
            "unconverged": sum(r["unconverged_steps"] for r in runs)}


def table(points):
    lines = ["| | mean ice resistance, N (95 %) | single fields, N | sd of step means, N | sd of means over 1 s, N |",
             "| --- | --- | --- | --- | --- |"]
    for label, p in points.items():
        lines.append(f"| {label} | {p['mean']:.3f} ({p['low']:.3f} to {p['high']:.3f}) | "
                     f"{p['least']:.3f} to {p['most']:.3f} | {p['sd']:.2f} | {p['slow']:.2f} |")
    return "\n".join(lines)


def draw(points, groups):
    """The band over friction, and the other assumptions beside it."""
    figure, (left, right) = style.subplots(1, 2, figsize=(11.5, 4.8), gridspec_kw={"width_ratios": (1.5, 1)})
    band = [points[f"friction {mu:.2f}"] for mu in FRICTIONS]

    def of(key):
        return np.array([p[key] for p in band])

    left.fill_between(FRICTIONS, np.maximum(of("mean") - of("slow"), 0), of("mean") + of("slow"), color=style.ICE,
                      alpha=0.12, lw=0, label="mean ± sd of means over 1 s")
    left.fill_between(FRICTIONS, of("low"), of("high"), color=style.ICE, alpha=0.35, lw=0, label="95 % of the mean")
    left.plot(FRICTIONS, of("mean"), color=style.ICE, lw=2, label="mean over the fields")
    for mu in FRICTIONS:
        runs = groups[f"friction {mu:.2f}"]
        left.plot([mu] * len(runs), [r["mean"] for r in runs], ".", color=style.FAINT, ms=4)
    left.plot([], [], ".", color=style.FAINT, label="single fields")
    left.set(xlabel="friction of floes and hull (assumed)", ylabel="ice resistance (N)", ylim=(0, None),
             title="Prediction; the measured force is not known here")
    left.legend(frameon=False, loc="upper left")
    base = points["friction 0.15"]
    labels = list(OTHERS)
    for i, label in enumerate(labels):
        p = points[label]
        right.plot([p["low"], p["high"]], [i, i], color=style.TOW, lw=2)
        right.plot(p["mean"], i, "o", color=style.TOW)
    right.axvspan(base["low"], base["high"], color=style.ICE, alpha=0.25, lw=0)
    right.axvline(base["mean"], color=style.ICE, lw=1.5)
    right.set(yticks=range(len(labels)), yticklabels=labels, xlabel="mean ice resistance (N)", xlim=(0, None),
              title="Other assumptions, friction 0.15")
    right.invert_yaxis()
    figure.suptitle("Ship model in plastic floes: 0.2 m/s, 29.6 %", x=0.01, ha="left", weight="bold")
    figure.tight_layout()
    return figure


@ended
@style.look()
def main(argv=None):
    p = parser("Blind prediction of a ship model's resistance in plastic floes.", "ship", 20)
    p.add_argument("--map", type=Path, metavar="FILE", help="demo_NRC_OEB_data.pkl: the runs in the ice of this map")
    a = p.parse_args(argv)
    try:
        todo = jobs_of_map(a) if a.map else jobs(a.fields)
    except (nrc_outlines.Refused, OSError) as error:
        p.error(f"{a.map}: {error}; name the file as it is published")
    results = every(a, [(name, values) for _, name, values in todo], resistance)
    groups = {}
    for (label, _, _), result in zip(todo, results):
        groups.setdefault(label, []).append(result)
    points = {label: point(runs) for label, runs in groups.items()}
    name, text = "map" if a.map else "ship", table(points)
    (a.out / f"{name}.json").write_text(json.dumps(groups), encoding="utf-8")
    (a.out / f"{name}.md").write_text(text + "\n", encoding="utf-8")
    if not a.map:
        writing.save(draw(points, groups), a.out / "ship.png", force=True)
    print(f"\n{text}\n\nsteps not converged: {sum(p['unconverged'] for p in points.values())}")
    if not a.map:
        print("estimates that hold:", groups["friction 0.15"][0]["estimates"])


if __name__ == "__main__":
    command.guarded(Path(__file__).name, main)
