#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Maps for the cases of this folder: the field of uniform.yml, with lanes in it that are free of ice.

    /usr/bin/python3 cases/route/make_maps.py [-o DIR]      DIR/lead.h5, DIR/leads.h5 (default: out/route-maps)

SYNTHETIC: no ice that was ever seen. A floe whose centre lies in a lane is taken out; no other is touched.
"""
import argparse
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "postproc"))
from bergtow.routing import apart, members  # noqa: E402

#: lanes as polylines in m of the case, and their half widths, m
LANES = {
    "lead": [([(100, 250), (2300, 250)], 110)],
    "leads": [([(100, 0), (700, 230), (1300, 260), (1800, 60), (2400, 0)], 90),
              ([(700, 230), (900, 600), (1500, 700)], 60), ([(0, -500), (900, -330), (1500, -380), (2100, -60)], 75),
              ([(900, -330), (1250, 230)], 50)],
}


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("-o", "--output", type=Path, default=Path("out/route-maps"))
    p.add_argument("--concentration", default="0.7", help="of the ice beside the lanes (default %(default)s)")
    a = p.parse_args()
    a.output.mkdir(parents=True, exist_ok=True)
    program = os.environ.get("BERGTOW", HERE.parents[1] / "build/release/bergtow")
    whole = a.output / "whole.h5"
    subprocess.run([program, "field", HERE / "uniform.yml", "-o", whole, "--force", "--set",
                    f"ice.concentration={a.concentration}"], check=True)
    floes = members.Floes.read(whole)
    for name, lanes in LANES.items():
        kept = np.ones(len(floes.area), dtype=bool)
        for line, half in lanes:
            line = np.array(line, dtype=float)
            kept &= apart.to_edges(floes.pose[:, :2], np.vstack([line, line[::-1]])) > half
        floes.take(kept).write(a.output / f"{name}.h5")
        print(f"{a.output / name}.h5: {kept.sum()} of {len(kept)} floes")


if __name__ == "__main__":
    main()
