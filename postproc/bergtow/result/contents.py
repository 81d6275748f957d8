# SPDX-License-Identifier: MIT
"""List the contents of the output folder of a run: counts, summary, series with units."""

from bergtow.result.run import Run


def entries(group, prefix=""):
    """(dotted name, text) for everything in nested groups, except the curves of the estimates."""
    for key, value in group.items():
        if isinstance(value, dict):
            if key != "curves":
                yield from entries(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def options(p):
    p.add_argument("run", metavar="RUN", help="output folder of a run")


def perform(a):
    with Run(a.run) as run:
        pieces = f"{run.n_pieces} pieces of them, " if run.n_pieces else ""
        print(f"{run.path}: {run.n_start} floes, {pieces}{len(run.bodies)} bodies, {len(run['time'])} samples, "
              f"{run.n_frames} frames")
        for name, item in entries(run.summary):
            print(f"  {name:40} {item}")
        print("series:")
        for name in run.series_names:
            print(f"  {name:24} {run.units(name):8} {run.description(name)}")
