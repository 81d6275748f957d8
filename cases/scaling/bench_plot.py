#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""The picture of a benchmark: `bench_plot.py bench.csv [bench.png]` draws it again from the table."""
import csv
import itertools
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent / "postproc"))
from matplotlib.ticker import LogLocator, NullLocator  # noqa: E402
from bergtow.plot import style  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402

# Okabe & Ito
COLOURS = {"tow-80": "#56b4e9", "tow-95": "#0072b2", "compression-80": "#e69f00", "compression-95": "#d55e00"}
PHASE_COLOURS = ["#009e73", "#f0e442", "#56b4e9", "#d55e00", "#0072b2", "#cc79a7", "#999999", "#e69f00"]


def read(path):
    with open(path, newline="") as f:
        rows = list(csv.DictReader(f))
    for row in rows:
        for name, text in row.items():
            if name not in ("scene", "state_hash"):
                row[name] = float(text) if text else None
    return rows


def config(row):
    return int(row["ranks"]), int(row["threads"])


def name_of(ranks, threads):
    words = [f"{n} {word}{'s' * (n > 1)}" for n, word in ((ranks, "rank"), (threads, "thread")) if n > 1]
    return " × ".join(words) or "1 core"


def line_of(ranks, threads):
    if ranks * threads == 1:
        return {"linestyle": "-", "marker": "o", "markersize": 4}
    if ranks == 1:
        return {"linestyle": "--", "marker": "s", "markersize": 4}
    return {"linestyle": ":", "marker": "D", "markersize": 4}


def lines(ax, rows, column, wanted):
    """One line per scene and configuration that `wanted` lets through; False if there is nothing to draw."""
    drawn = False
    for scene in dict.fromkeys(r["scene"] for r in rows):
        for c in dict.fromkeys(config(r) for r in rows):
            points = [(r["floes"], r[column])
                      for r in rows
                      if r["scene"] == scene and config(r) == c and wanted(c) and r[column] is not None]
            if points:
                ax.plot(*zip(*sorted(points)), color=COLOURS[scene], **line_of(*c))
                drawn = True
    ax.set_xscale("log")
    sizes = sorted({r["asked"] for r in rows if r[column] is not None})
    labels, last = [], 0
    for n in sizes:  # a label where there is room
        labels.append(f"{n / 1000:g}k" if n >= 1.8 * last else "")
        last = n if labels[-1] else last
    ax.set_xticks(sizes, labels)
    ax.set_xticks([], minor=True)
    ax.set_xlabel("floes")
    ax.grid(True)
    if not drawn:
        ax.text(0.5, 0.5, "not measured", transform=ax.transAxes, ha="center", color=style.FAINT)
    return drawn


def log_y(ax):
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.yaxis.set_major_formatter(lambda v, _: f"{v:,.0f}")
    ax.yaxis.set_minor_locator(NullLocator())


def zero_to(ax, top):
    ax.set_ylim(0, max([top] + [1.05 * y for line in ax.lines for y in line.get_ydata()]))


def phase_bars(ax, rows):
    """Where the time of a floe and step goes: the largest size, one bar a scene and configuration."""
    largest = max(r["asked"] for r in rows)
    chosen = [r for r in rows if r["asked"] == largest]
    left = [0.0] * len(chosen)
    phases = [name.removesuffix("_share") for name in rows[0] if name.endswith("_share") and name != "halo_share"]
    for phase, colour in zip(phases, itertools.cycle(PHASE_COLOURS)):
        share = [100 * (r.get(phase + "_share") or 0) for r in chosen]
        ax.barh(range(len(chosen)), share, left=left, color=colour, label=phase, height=0.75)
        left = [a + b for a, b in zip(left, share)]
    ax.set_yticks(range(len(chosen)), [f"{r['scene']}, {name_of(*config(r))}" for r in chosen], fontsize=8)
    ax.invert_yaxis()
    ax.set(xlim=(0, 100), xlabel="% of the wall time", title=f"Phases, {largest:,.0f} floes")
    ax.legend(ncols=4, fontsize=8, loc="upper center", bbox_to_anchor=(0.4, -0.16), handlelength=1, columnspacing=1)


def legend(fig, rows):
    scenes = dict.fromkeys(r["scene"] for r in rows)
    configs = dict.fromkeys(config(r) for r in rows)
    handles = [Line2D([], [], color=COLOURS[s], linewidth=3, label=s) for s in scenes]
    handles += [Line2D([], [], color=style.INK, label=name_of(*c), **line_of(*c)) for c in configs]
    fig.legend(handles=handles, loc="upper center", ncols=len(handles), bbox_to_anchor=(0.5, 0.995))


@style.look()
def draw(table, picture):
    rows = read(table)
    fig, axes = style.subplots(2, 3, figsize=(15, 9))
    every, several, one = (lambda c: True), (lambda c: c[0] * c[1] > 1), (lambda c: c[0] * c[1] == 1)
    ax = axes[0, 0]
    lines(ax, rows, "ns_per_floe_step", every)
    log_y(ax)
    ax.set_title("Cost of a floe and step, ns")
    ax = axes[0, 1]
    lines(ax, rows, "speedup", several)
    ax.axhline(1, color=style.FAINT, linewidth=0.8)
    zero_to(ax, 2.1)
    ax.set_title("Strong scaling: speed-up over one core")
    ax = axes[0, 2]
    lines(ax, rows, "weak_solve_efficiency", several)
    zero_to(ax, 1.1)
    ax.set_title("Weak scaling of the solve phase: efficiency")
    phase_bars(axes[1, 0], rows)
    ax = axes[1, 1]
    for r in rows:
        r["rate_m"] = r["contact_sweeps_per_s"] and r["contact_sweeps_per_s"] / 1e6
    lines(ax, rows, "rate_m", every)
    zero_to(ax, 1)
    ax.set_title("Contact-sweeps in the solve phase, 1e6/s")
    ax = axes[1, 2]
    lines(ax, rows, "bytes_per_floe", one)
    log_y(ax)
    ax.set_title("Peak memory a floe on one core, bytes")
    legend(fig, rows)
    fig.tight_layout(rect=(0, 0, 1, 0.95))
    fig.savefig(picture)


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 3:
        sys.exit("usage: bench_plot.py bench.csv [bench.png]")
    draw(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else Path(sys.argv[1]).with_suffix(".png"))
