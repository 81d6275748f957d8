# SPDX-License-Identifier: MIT
"""What the scripts of cases/validation share: the command line, many runs at a time, intervals."""
import argparse
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT / "postproc"), str(ROOT / "cases")]

from runs import Failed, run  # noqa: E402


def parser(text, name, fields):
    """Arguments of a study of the case `name`.yml: a.case, a.out, a.set, a.threads, a.bergtow, a.jobs, a.fields."""
    p = argparse.ArgumentParser(description=text)
    p.add_argument("--out", type=Path, default=ROOT / "out/validation" / name, help="folder of the results")
    p.add_argument("--fields", type=int, default=fields, metavar="N", help=f"fields a point (default: {fields})")
    p.add_argument("--jobs", type=int, default=1, metavar="N", help="runs at a time, one thread each (default: 1)")
    p.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="replace a key in every run")
    p.add_argument("--bergtow", default=os.environ.get("BERGTOW", str(ROOT / "build/release/bergtow")))
    p.set_defaults(case=HERE / f"{name}.yml", threads=1)
    return p


def every(a, jobs, measure):
    """measure(folder) of every run, in the order of jobs: [(name, {section__key: value})]."""
    a.out.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(max(1, a.jobs)) as pool:
        return list(pool.map(lambda job: measure(run(a, job[0], **job[1])), jobs))


def ended(main):
    """main(), with the exit code of a run that failed."""
    def call():
        try:
            main()
        except Failed as error:
            print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
            sys.exit(error.code)
    return call


def wilson(k, n, z=1.96):
    """95 % interval of a probability after k of n [Wilson 1927]."""
    middle, half = (k + z * z / 2) / (n + z * z), z * np.sqrt(k * (n - k) / n + z * z / 4) / (n + z * z)
    return max(0.0, middle - half), min(1.0, middle + half)
