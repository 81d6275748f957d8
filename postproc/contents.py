# SPDX-License-Identifier: MIT
"""List what the output folder of a run holds: counts, summary, series with units."""
import argparse

import command
from bergtow_read import Run


def main(argv=None):
    p = argparse.ArgumentParser(description="List what the output folder of a run holds.")
    p.add_argument("run", metavar="RUN", help="output folder of a run")
    with Run(p.parse_args(argv).run) as run:
        print(f"{run.path}: {run.n_floes} floes, {len(run.bodies)} bodies, {len(run['time'])} samples, "
              f"{run.n_frames} frames")
        for key, value in run.summary.items():
            for name, item in value.items() if isinstance(value, dict) else [("", value)]:
                print(f"  {key + '.' * bool(name) + name:40} {item}")
        print("series:")
        for name in run.series_names:
            print(f"  {name:24} {run.units(name):8} {run.description(name)}")


if __name__ == "__main__":
    command.guarded(main)
