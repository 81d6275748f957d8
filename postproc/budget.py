# SPDX-License-Identifier: MIT
"""The uncertainty budget of a study whose parameters are drawn from their distributions: mean, scatter of the fields,
of the parameters, of each of them, of the computation.

    budget.py STUDY.yml -o DIR --budget 15        runs the members that are left, then DIR/budget.json, budget.png

The study is a Latin hypercube (`sampling`, `samples`) with fields of its own for each condition, two or more of them
(`repeats`) to tell fields from parameters. What the computation adds is not varied here: it is that of `bergtow
converge` on the base case (`--converge FILE`, or converge.json in DIR).
"""
import argparse
import os
import subprocess
import time
from pathlib import Path

import command  # first: it has words for packages that are missing
import findings
import stat_budget
from bergtow_read import RunError
from case_runs import STOPPED, program
from ensemble_read import Ensemble

import h5py
import numpy as np

BUDGET = 15.0  # min
OF = "mean_ice_resistance_n"


def run(binary, study, folder, sets, jobs, minutes):
    """Run the members that are left, with several calls at work on the folder. Errors: RunError."""
    call = [str(binary), "ensemble", str(study), "-o", str(folder), "--threads", "1", "--quiet", "--max-wall",
            f"{60 * minutes:.0f}", *(w for t in sets for w in ("--set", t))]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    # the first one makes the folder and says what is wrong with the study
    calls = [subprocess.Popen(call, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment)]
    while jobs > 1 and not (folder / "ensemble.h5").exists() and calls[0].poll() is None:
        time.sleep(0.05)
    calls += [subprocess.Popen([*call, "--no-wait"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                               env=environment) for _ in range(jobs - 1) if calls[0].poll() is None]
    ends = [(c.communicate()[1], c.returncode) for c in calls]
    said, code = ends[0]
    if code not in (0, STOPPED) and not (folder / "ensemble.h5").exists():
        line = (said.strip().splitlines() or [f"bergtow ensemble ended with exit code {code}"])[0]
        raise RunError(study, line.removeprefix("bergtow: "), "mend it")


def assumed(e):
    """{parameter: distribution and source as the study says them}."""
    out = {}
    with h5py.File(e.file, "r") as f:
        for key in e.parameters:
            attributes = f[f"parameters/{key}"].attrs
            words = {w: attributes.get(w, b"") for w in ("distribution", "source")}
            out[key] = {w: v.decode() if isinstance(v, bytes) else str(v) for w, v in words.items()}
            if e.units[key] not in ("", "1") and out[key]["distribution"]:
                out[key]["distribution"] += f" {e.units[key]}"
            if not out[key]["distribution"]:
                out[key]["distribution"] = ", ".join(dict.fromkeys(str(v) for v in e.parameters[key]))
    return out


def of_ensemble(e, key=OF, converge=None):
    """The budget of an ensemble; budget.json. Errors: RunError."""
    if "sampling: latin-hypercube" not in e.study:
        raise RunError(e.file, "is no Latin hypercube", "set sampling: latin-hypercube and samples in the study")
    if "fields: common" in e.study:
        raise RunError(e.file, "has common fields, whose scatter is in all conditions alike", "set fields: own")
    if key not in e.summary:
        raise RunError(e.file, f"has no number {key}", "see bergtow --list-quantities")
    rows = e.used[np.isfinite(e.summary[key][e.used])]
    meaning = e.meaning.get(key, {})
    found = stat_budget.budget({k: v[rows] for k, v in e.parameters.items()}, e.condition[rows], e.summary[key][rows],
                               (converge or {}).get("rows", ()))
    if "refused" in found:
        raise RunError(e.file, f"has too few members for a budget: {found['refused']}", "run the study further")
    units = meaning.get("units") or ("N" if key.endswith("_n") else "")
    return found | {"title": e.title, "of": key, "units": str(units),
                    "meaning": str(meaning.get("description") or key), "assumed": assumed(e), "wanted": e.n}


def read_converge(path, folder):
    if path is None:
        return findings.read("converge", folder)
    found = findings.read("converge", path if path.is_dir() else path.parent)
    if found is None:
        raise RunError(path, "is no converge.json", "name the folder or the file of bergtow converge")
    return found


def main(argv=None):
    p = argparse.ArgumentParser(prog="budget", description="Find out how much of the scatter of a number is of the "
                                "fields, of each parameter, and of the computation.")
    p.add_argument("study", metavar="STUDY.yml", type=Path)
    p.add_argument("-o", "--output", metavar="DIR", type=Path, help="folder of the ensemble (default: out/STUDY)")
    p.add_argument("--of", default=OF, metavar="NUMBER", help=f"number of the summary (default {OF})")
    p.add_argument("--converge", metavar="FILE", type=Path, help="converge.json of the base case, for what the "
                   "computation adds")
    findings.add_options(p, BUDGET)
    a = p.parse_args(argv)
    folder = a.output or Path("out") / a.study.stem
    findings.begin("budget", a.study, "study", folder, a.force)
    run(program(), a.study, folder, a.set, a.jobs, a.budget)
    findings.keep("budget", of_ensemble(Ensemble(folder), a.of, read_converge(a.converge, folder)), folder, a.force)


if __name__ == "__main__":
    command.guarded(main)
