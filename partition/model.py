# SPDX-License-Identifier: MIT
"""Efficiency on up to 1,000 ranks: measured compute, cut cell graphs (quality.csv), latency and bandwidth of a network.

Time of one step on P ranks with N floes, in the terms of README.md:

    T(P) = N/P (S c t_c + t_f) (1 + imbalance)  +  N/P halo_max t_g          sweeps and the rest of the step; ghosts
         + S (5 alpha neighbours_max + 24 B beta sent_max)                   4 colours and the berg, each sweep
         + (S + R + 9) log2 P (alpha + 150 B beta)                           exact sums: a sweep, a residual pass (R a
                                                                             step, rounds of 50 sweeps); nine a step

    strong efficiency = T(1) / (P T(P)) at fixed N,  weak efficiency = T(1) / T(P) at fixed N/P
"""
import argparse
import csv
import math
import pathlib
import sys

BODY, SUM = 24, 150  # bytes: three velocities of a body; one exact sum with its header
ROUND, OTHER_SUMS = 50, 9  # sweeps between residual passes; reductions of a step beside those and the sweeps'


def options():
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("table", nargs="?", type=pathlib.Path, default=pathlib.Path(__file__).with_name("quality.csv"))
    p.add_argument("--compute",
                   type=float,
                   default=15,
                   help="ns a contact point and sweep on one core (default: %(default)s)")
    p.add_argument("--contacts", type=float, default=4.3, help="contact points a floe (default: %(default)s)")
    p.add_argument("--sweeps", type=float, default=50, help="sweeps a step (default: %(default)s)")
    p.add_argument("--floe",
                   type=float,
                   default=1500,
                   help="ns a floe and step outside the sweeps (default: %(default)s)")
    p.add_argument("--ghost", type=float, default=500, help="ns a ghost floe and step (default: %(default)s)")
    p.add_argument("--alpha", type=float, default=1.5, help="latency of a message, us (default: %(default)s)")
    p.add_argument("--beta", type=float, default=12, help="bandwidth of a rank, GB/s (default: %(default)s)")
    p.add_argument("--cell", type=float, default=4, help="side of a cell in floe diameters (default: %(default)s)")
    return p.parse_args()


def step(row, o, wait):
    """Terms of T(P), s, for one row of the table; wait: its column that says what ranks wait for each other."""
    ranks, own = int(row["parts"]), int(row["floes"]) / int(row["parts"])
    alpha, beta = o.alpha * 1e-6, 1e-9 / o.beta
    sweeps = own * o.sweeps * o.contacts * o.compute * 1e-9
    rest = own * o.floe * 1e-9
    return {
        "work": sweeps + rest,
        "waiting": sweeps * float(row[wait]) + rest * float(row["imbalance"]),
        "ghosts": own * float(row["halo_max"]) * o.ghost * 1e-9,
        "latency": o.sweeps * 5 * alpha * float(row["neighbours_max"]) if ranks > 1 else 0.0,
        "bandwidth": o.sweeps * BODY * beta * float(row["sent_max"]),
        "sums": (o.sweeps + 1 + o.sweeps / ROUND + OTHER_SUMS) * math.log2(ranks) * (alpha + SUM * beta),
    }


def table(rows, o, strong):
    print(
        "| ranks | floes a rank | T, ms | efficiency | if all wait in each colour | waiting | ghosts | latency | "
        "bandwidth | sums |"
    )
    print("|" + " ---: |" * 10)
    first = sum(step(rows[0], o, "imbalance").values())
    for row in rows:
        ranks = int(row["parts"])
        terms, strict = step(row, o, "imbalance"), step(row, o, "phase_imbalance")
        time, ideal = sum(terms.values()), first / ranks if strong else first
        share = "".join(f" {100 * terms[k] / time:.1f} % |" for k in ("waiting", "ghosts", "latency", "bandwidth",
                                                                      "sums"))
        print(f"| {ranks} | {int(row['floes']) // ranks} | {1e3 * time:.4g} | {100 * ideal / time:.0f} % "
              f"| {100 * ideal / sum(strict.values()):.0f} % |{share}")


def main():
    o = options()
    try:
        with open(o.table, newline="") as f:
            rows = [r for r in csv.DictReader(f) if float(r["cell_diameters"]) == o.cell and int(r["parts"]) <= 1024]
    except (OSError, KeyError, ValueError) as error:
        sys.exit(f"model: {o.table}: {error}; make it with `make partition-study`")
    for series, title in (("strong", "Strong scaling, 1,000,000 floes"), ("weak", "Weak scaling, 10,000 floes a rank")):
        chosen = [r for r in rows if r["series"] == series]
        if not chosen or int(chosen[0]["parts"]) != 1:
            sys.exit(f"model: {o.table}: no {series} rows from one part on with cells of {o.cell:g} diameters; "
                     "choose --cell 4, 6 or 8, or make the table with `make partition-study`")
        print(f"{title} (cells of {o.cell:g} floe diameters; columns to the right: share of T)\n")
        table(chosen, o, series == "strong")
        print()


if __name__ == "__main__":
    main()
