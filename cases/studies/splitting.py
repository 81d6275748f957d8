# SPDX-License-Identifier: MIT
"""Floes that split, beside splitting.yml. Each with one command:

    splitting.py bows    which bow splits floes: half angles of 15 to 75 degrees, a flat one and a disc, of 80 m beam
    splitting.py long    what 10 km of tow do to the sizes of floes: table, picture

Rigid ice of 80 %, floes of 30 m (../fullscale/berg.yml). ASSUMED: toughness and strength, in the middle of literature
ranges and not calibrated. The body is led and does not turn. Runs of the same case by the same build are kept.
"""
import argparse
import math
import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "postproc"), str(ROOT / "cases")]

import numpy as np  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

from bergtow import writing  # noqa: E402
from bergtow.cli import command  # noqa: E402
from bergtow.plot import style  # noqa: E402
from bergtow.result.run import Run  # noqa: E402
from bergtow.table import table  # noqa: E402
from runs import Failed, run  # noqa: E402

ICE = {"ice__concentration": 0.8, "ice__rafting__kappa": 0, "ice__splitting__toughness": "150 kPa m^0.5",
       "impact__conversion": "crushing", "solver__tolerance": 1e-2, "solver__max_sweeps": 200}
ANGLES = (15, 30, 45, 60, 75)
BEAM = 80.0  # m


def bow(angle):
    """Keys of a body with a bow of this half angle, degrees, before 40 m of parallel sides."""
    half, long = BEAM / 2, BEAM / 2 / math.tan(math.radians(angle))
    corners = [[long, 0], [0, half], [-40, half], [-40, -half], [0, -half]]
    return {"body__shape": "polygon", "body__vertices": [[round(x, 2), y] for x, y in corners]}


def bows(a):
    bodies = {"disc": {}, "flat": {"body__shape": "rectangle", "body__length": "80 m", "body__width": "80 m"},
              **{f"{angle}°": bow(angle) for angle in ANGLES}}
    rows = []
    for name, keys in bodies.items():
        found = []
        for seed in range(1, a.fields + 1):
            with Run(run(a, f"{name.rstrip('°')}-s{seed}", **ICE, **keys, ice__seed=seed, run__duration="40 min",
                         domain__length="3 km", body__x="-1 km", output__window_start="10 min",
                         output__frame_interval="40 min")) as r:
                split = r.summary["splitting"]
                found.append([r.number("mean_ice_resistance_n") / 1e3, r.number("p99_ice_resistance_n") / 1e3,
                              r.number("peak_ice_resistance_n") / 1e3,
                              *(split[k] for k in ("splits", "near", "far", "burst")), r.number("unconverged_steps")])
        x = np.array(found)
        error = x[:, 0].std(ddof=1) / math.sqrt(len(x)) if len(x) > 1 else math.nan
        rows.append([name, f"{x[:, 0].mean():.0f} ± {error:.0f}", f"{x[:, 1].mean():.0f}", f"{x[:, 2].max():.0f}",
                     f"{x[:, 3].mean():.0f}", *(f"{x[:, k].sum():.0f}" for k in (4, 5, 6, 7))])
    print(table(["bow, half angle", "mean, kN", "99 % below, kN", "largest, kN", "splits a tow", "near", "far", "burst",
                 "not converged"], rows, True))


def long(a):
    folder = run(a, f"long-{a.concentration:g}", **{**ICE, "ice__concentration": a.concentration},
                 domain__length="10.9 km", domain__width="600 m", body__x="-5.2 km", run__duration="20000 s",
                 output__window_start="30 min", output__frame_interval="2000 s")
    fig = Figure(figsize=(6, 4), layout="constrained")
    axes = fig.subplots()
    rows = []
    with Run(folder) as r:
        times = r.frame_times
        for k in sorted({0, len(times) // 4, len(times) // 2, len(times) - 1}):
            there = np.isfinite(r.pose(k)[:, 0])
            size = np.sort(np.sqrt(r.area[there]))[::-1]
            share = np.cumsum(size**2) / np.sum(size**2)
            way = 0.5 * times[k] / 1e3
            axes.step(size, np.arange(1, len(size) + 1), label=f"{way:.1f} km")
            before = r.splits["time"] <= times[k]
            rows.append([f"{way:.1f}", str(len(size)), str(int(before.sum())),
                         f"{size[np.searchsorted(share, 0.5)]:.1f}", f"{np.quantile(size, 0.1):.1f}",
                         f"{size.min():.1f}"])
        crack = r.summary["splitting"]["crack_length_m"]
    axes.set(xscale="log", yscale="log", xlabel="size √A, m", ylabel="floes of this size and more")
    axes.legend(title="tow")
    writing.save(fig, a.out / "sizes.png", force=True)
    print(table(["tow, km", "floes", "splits", "half of the area in floes above, m", "a tenth of the floes below, m",
                 "smallest, m"], rows, True))
    print(f"\n{crack / 1e3:.1f} km of cracks; {a.out / 'sizes.png'}")


@style.look()
def main(argv=None):
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("study", choices=["bows", "long"])
    p.add_argument("--fields", type=int, default=4, help="of bows (4)")
    p.add_argument("--concentration", type=float, default=0.8, help="of long (0.8)")
    p.add_argument("--out", type=Path, default=Path("out/splitting-studies"))
    p.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="for every run")
    p.add_argument("--threads", type=int)
    p.add_argument("--bergtow", default=os.environ.get("BERGTOW", str(ROOT / "build/release/bergtow")))
    a = p.parse_args(argv)
    a.out.mkdir(parents=True, exist_ok=True)
    a.case = ROOT / "cases/fullscale/berg.yml"
    try:
        (bows if a.study == "bows" else long)(a)
    except Failed as error:
        print(f"splitting.py: {error}", file=sys.stderr)
        sys.exit(error.code)


if __name__ == "__main__":
    command.guarded(Path(__file__).name, main)
