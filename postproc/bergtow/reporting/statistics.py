# SPDX-License-Identifier: MIT
"""The command statistics: print the tables of an ensemble, and write statistics.csv (one row per condition) and
statistics.json (everything) to its folder.

If members of the study are missing from the numbers (they wait, failed, are not sound, or have no mean), everything is
written, they are named, and the exit code is 4, so that no script takes a part for the whole; --partial allows it.
"""
from pathlib import Path

from bergtow import arguments, progress, writing
from bergtow.arguments import above_zero, at_least_one, finite, not_below_zero
from bergtow.errors import RunError
from bergtow.result.members import FINISHED, Members
from bergtow.said import say
from bergtow.stats import conditions, loads
from bergtow.text import ensemble as ensemble_text

import numpy as np


def ends(name, found, key="interval_95"):
    """Columns of an interval; None where there is none."""
    return dict(zip((f"{name}_low", f"{name}_high"), found.get(key, (None, None))))


def load_columns(c, names):
    """Columns of the loads; their names end with the unit, as in summary.json."""
    out = {}
    for name, units in names.items():
        x = c["loads"].get(name, {})
        mean, start, design = (x.get(key) or {} for key in ("mean", "start_up", "design"))
        columns = {"mean": mean.get("value"), **ends("mean", mean), "sd": x.get("sd", {}).get("value"),
                   "p99": x.get("quantiles", {}).get("99", {}).get("value"), "largest": x.get("largest"),
                   "smallest": x.get("smallest"), "start_up": start.get("largest"), "design": design.get("value"),
                   **ends("design", design)}
        out |= {f"{name}_{what}_{units.lower()}": value for what, value in columns.items()}
        out[f"{name}_time_scale_s"] = x.get("time_scale_s")
    return out


def csv_row(c, load_names):
    """Columns of a condition, without nesting; forces in N."""
    r = c["resistance"]
    w, m = c["without_bound"], c["members"]
    row = {"condition": c["index"] + 1, **c["values"], "fields": m["used"],
           **{k: m[k] for k in ("failed", "waiting", "excluded")}, **{f"doubt_{k}": n for k, n in m["doubts"].items()},
           "at_least": int(bool(w["words"])), "no_load_share": w["share"], "ended_without_solution": len(w["ended"])}
    row |= {key: r.get(key) for key in ("mean", "se_between", "se_within", "sd_between", "sd_of_fields", "median",
                                        "trimmed_mean", "min", "max", "largest_share", "fields_needed")}
    for key in ("t_95", "bootstrap_95", "median_95"):
        row |= ends(key, r, key)
    for name, estimate in c["estimates"].items():
        row[name], row[f"{name}_valid"] = estimate["force"], estimate["valid"]
        if not estimate["on_top"]:
            row[f"simulated_over_{name}"] = estimate["ratio"]
    row |= load_columns(c, load_names)
    return {k: "" if isinstance(v, float) and not np.isfinite(v) or v is None else v for k, v in row.items()}


def write(s, folder, force):
    """Write statistics.json and statistics.csv to the folder. Raises RunError."""
    names = {name: x["units"] for c in s["conditions"] for name, x in c["loads"].items()}
    writing.write_json(s, folder / "statistics.json", force)
    writing.write_csv([csv_row(c, names) for c in s["conditions"]], folder / "statistics.csv", force)


def options(p):
    p.add_argument("folder", metavar="DIR", help="folder of `bergtow ensemble`")
    p.add_argument("-o", "--output", metavar="FOLDER", type=Path,
                   help="folder for statistics.csv and statistics.json (default: DIR)")
    p.add_argument("--markdown", action="store_true", help="print the tables as Markdown")
    p.add_argument("--error", type=above_zero, metavar="E",
                   help="relative error of the mean for which to give the needed number of fields (default "
                        "%(default)s)")
    p.add_argument("--hours", type=above_zero, nargs="+", metavar="T",
                   help="return times of loads and peaks, hours of tow (default 1 10 100)")
    loads.add_options(p)
    p.add_argument("--threshold", type=finite, metavar="N",
                   help="threshold of peaks over a threshold, N (default: a tenth of all peaks are above)")
    p.add_argument("--gap", type=not_below_zero, metavar="S",
                   help="peaks closer than this are one cluster, s (default: 2 correlation times of the resistance)")
    p.add_argument("--blocks", type=at_least_one, metavar="K",
                   help="blocks per field for block maxima (default: so many that there are 20 in all)")
    p.add_argument("--resamples", type=at_least_one, metavar="B",
                   help="resamples for p-values and return levels (default %(default)s)")
    p.add_argument("--partial", action="store_true",
                   help="exit with 0 even if the statistics leave out some members of the study")
    arguments.add_force(p)
    p.set_defaults(**conditions.DEFAULTS | {"exclude": []})


def perform(a):
    e = Members(a.folder)
    folder = a.output or e.path
    for name in ("statistics.json", "statistics.csv"):
        writing.may_write(folder / name, a.force)
    with progress.doing(f"{e.n} members"):
        s = conditions.statistics(e, a)
    write(s, folder, a.force)
    say(ensemble_text.report(s, a.markdown))
    say(f"\n{folder / 'statistics.csv'}\n{folder / 'statistics.json'}")
    if s["holes"] and not a.partial:
        again = "" if np.all(e.status == FINISHED) else "run `bergtow ensemble` again, with --retry-failed for those " \
            "that failed, or "
        raise RunError(e.path, s["holes"], f"{again}use the members that exist with --partial")
