#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""What a planned route gains against the straight line, field by field: concentration x width of the berg / size of the
floes, one tow each of the straight line and of the planned routes through the ice that they were planned on.

    /usr/bin/python3 cases/route/benchmark.py [-o DIR] [--fields N] [--minutes M] [--ratios 1,3,10] [--again]

Goes on where it stopped: a field that is done is not towed again. Perfect knowledge of the ice: an upper bound of
the gain. The route is the planner's first choice, which may be the straight line, whatever its tow says, so that
nothing is chosen after the fact.

--again tows every route twice more, through members of the map with the default errors. The rank correlation of these
two tows says what a prediction can hope for: one that knew the mean of every route would have about its root.
"""
import argparse
import contextlib
import io
import json
import os
import sys
import time
from pathlib import Path

import numpy as np
import scipy.stats

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "postproc"))
os.environ.setdefault("BERGTOW", str(HERE.parents[1] / "build/release/bergtow"))
import bergtow  # noqa: E402
from bergtow.stats.mean import t_interval  # noqa: E402
from bergtow.table import table  # noqa: E402
from bergtow.writing import write_json  # noqa: E402

WIDTH, LONG, WIDE, WAY = 100.0, 20, 14, 16  # m; domain and way in widths of the berg
NAMES = "work", "time", "peak"


def settings(concentration, ratio, field):
    """A berg of prescribed speed, so that time is length: keys of uniform.yml that are replaced."""
    return {"ice.concentration": concentration, "ice.size": f"{WIDTH / ratio:.6g} m", "ice.seed": 100 + field,
            "domain.length": f"{LONG * WIDTH} m", "domain.width": f"{WIDE * WIDTH} m", "body.x": f"{2 * WIDTH} m",
            "run.title": "benchmark"}


def case(out):
    """uniform.yml with a prescribed speed in place of the line."""
    text = (HERE / "uniform.yml").read_text(encoding="utf-8")
    head, tow = text.split("\ntow:\n")
    path = out / "benchmark.yml"
    path.write_text(f"{head}\ntow:\n  mode: speed\n  speed: 0.5 m/s\n  ramp: 5 min\n", encoding="utf-8")
    return path


def one(out, concentration, ratio, field, end, members=1):
    """route.json of a field, made unless it is there; None where it is not, after the end."""
    folder = out / f"c{round(100 * concentration):02d}-r{ratio}" / f"f{field:03d}{'-again' if members > 1 else ''}"
    try:
        found = json.loads((folder / "route.json").read_text(encoding="utf-8"))
        if found["verdict"]:
            return found
    except (OSError, ValueError):
        pass
    if time.monotonic() > end:
        return None
    with contextlib.redirect_stdout(io.StringIO()):
        return bergtow.route(case(out), folder, to=((2 + WAY) * WIDTH, 0), members=members, routes=2, no_page=True,
                             set=settings(concentration, ratio, field), replace=True)


def row(concentration, ratio, some):
    """Numbers of a condition."""
    gains, lost, stayed, pairs = {n: [] for n in NAMES}, 0, 0, []
    for found in some:
        towed = [(r, r["members"][0]) for r in found["routes"]]
        pairs.append([(r["predicted"]["work"], t["work"]) for r, t in towed if t["arrived"]])
        straight = next(t for r, t in towed if r["kind"] == "straight")
        best, route = min(towed, key=lambda some: some[0]["predicted"]["cost"])
        stayed += best["kind"] == "straight"
        lost += straight["arrived"] and not (route["arrived"] and route["work"] <= straight["work"])
        for n in NAMES:
            if route["arrived"] and straight["arrived"]:
                gains[n].append(1 - route[n] / straight[n])
    x = np.array([p for f in pairs for p in f])
    flat = len(x) < 3
    return {"concentration": concentration, "ratio": ratio, "fields": len(some), "straight": stayed,
            "lost": lost, "rank_correlation": np.nan if flat else float(scipy.stats.spearmanr(*x.T)[0]),
            "gain": {n: float(np.mean(g)) if g else np.nan for n, g in gains.items()},
            "gain_95": {n: [float(v) for v in t_interval(np.array(g))] for n, g in gains.items()}}


def of_itself(some):
    """Rank correlation of the work of two tows of a route, over all routes; nan below three."""
    x = np.array([[m["work"] for m in r["members"]] for found in some for r in found["routes"]
                  if all(m["arrived"] for m in r["members"])])
    return float(scipy.stats.spearmanr(*x.T)[0]) if len(x) > 2 else np.nan


def percent(mean, ends):
    return "–" if mean != mean else f"{100 * mean:+.1f}" + (
        "" if ends[0] != ends[0] else f" ({100 * ends[0]:+.1f} to {100 * ends[1]:+.1f})")


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("-o", "--output", type=Path, default=Path("out/route-benchmark"))
    p.add_argument("--fields", type=int, default=20)
    p.add_argument("--concentrations", default="0.2,0.4,0.6,0.8")
    p.add_argument("--ratios", default="1,3,10", help="width of the berg / size of the floes")
    p.add_argument("--minutes", type=float, default=60, help="after which no field is begun")
    p.add_argument("--again", action="store_true", help="tow every route twice more, with errors of the map")
    a = p.parse_args()
    a.output.mkdir(parents=True, exist_ok=True)
    end, done, again = time.monotonic() + 60 * a.minutes, {}, {}
    for field in range(a.fields):  # every condition has as many as the others, whenever it ends
        for ratio in map(int, a.ratios.split(",")):
            for concentration in map(float, a.concentrations.split(",")):
                try:
                    found = one(a.output, concentration, ratio, field, end)
                    twice = one(a.output, concentration, ratio, field, end, 2) if a.again else None
                except bergtow.BergtowError as error:
                    print(f"{concentration:g}, {ratio}, field {field}: {error}", file=sys.stderr)
                    continue
                if found:
                    done.setdefault((concentration, ratio), []).append(found)
                if twice:
                    again.setdefault((concentration, ratio), []).append(twice)
    rows = [row(*key, some) | {"of_itself": of_itself(again.get(key, []))} for key, some in sorted(done.items())]
    write_json({"conditions": rows}, a.output / "benchmark.json", True)
    print(table(["ice, %", "width / floe", "fields", "straight is planned", "lost to straight",
                 "less work, % (95 %)", "less time, %", "lower peak, %", "rank correlation", "of two tows"],
                [[f"{100 * r['concentration']:.0f}", str(r["ratio"]), str(r["fields"]),
                  str(r["straight"]), f"{r['lost']} of {r['fields'] - r['straight']}",
                  *(percent(r["gain"][n], r["gain_95"][n]) for n in NAMES), f"{r['rank_correlation']:.2f}",
                  f"{r['of_itself']:.2f}"]
                 for r in rows], True))


if __name__ == "__main__":
    main()
