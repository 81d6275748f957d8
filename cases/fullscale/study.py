# SPDX-License-Identifier: MIT
"""Studies of the full-scale tow, each with one command:

    study.py concentration    the table and picture of resistance against concentration, beside the estimates
    study.py dt               one field with several time steps: what mean and peak do

Every run is a run of berg.yml with some keys replaced, in a folder of its own below --out, named after them. A folder
that holds the complete result of the same case by the same build is kept; anything else is run again.
"""
import argparse
import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "postproc"), str(ROOT / "cases")]

from bergtow import writing  # noqa: E402
from bergtow.arguments import measure, whole_from  # noqa: E402
from bergtow.cli import command  # noqa: E402
from bergtow.plot import resistance as plot_resistance  # noqa: E402
from bergtow.plot import style  # noqa: E402
from bergtow.result.run import Run  # noqa: E402
from runs import Failed, run  # noqa: E402

CONCENTRATIONS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95)
STEPS = (0.5, 1.0, 2.0, 5.0)


def concentration(a):
    """Runs over concentrations and seeds, their table and picture."""
    folders = [run(a, f"a{value:g}-s{seed}", ice__concentration=f"{value:g}", ice__seed=seed,
                   run__title=f"80 m berg, {100 * value:g} % broken ice, full scale")
               for value in a.concentrations for seed in range(1, a.seeds + 1)]
    points = [plot_resistance.read(folder) for folder in folders]
    text = plot_resistance.table(points)
    (a.out / "resistance.md").write_text(text + "\n", encoding="utf-8")
    writing.save(plot_resistance.draw(points), a.out / "resistance.png", force=True)
    print(f"\nMean ice resistance; in brackets simulated / estimate; * an estimate outside the range it is meant "
          f"for\n\n{text}\n\n{a.out / 'resistance.md'}")


def dt(a):
    """One field with several time steps: mean, percentiles and peak of the means over a step."""
    lines = ["| time step, s | ice resistance, N | standard error, N | sd, N | 99 % below, N | largest step mean, N | "
             "sweeps a step "
             "| steps not converged | overlap / floe size | wall time, s |", "|" + " ---: |" * 10]
    for step in a.steps:
        with Run(run(a, f"dt{step:g}", run__dt=f"{step:g}", ice__concentration=f"{a.concentration:g}")) as r:
            number = r.number
            cells = [f"{step:g}", f"{number('mean_ice_resistance_n'):.4g}", f"{number('mean_ice_resistance_se_n'):.2g}",
                     f"{number('sd_ice_resistance_n'):.3g}", f"{number('p99_ice_resistance_n'):.3g}",
                     f"{number('peak_ice_resistance_n'):.3g}", f"{number('mean_sweeps'):.3g}",
                     f"{100 * number('unconverged_steps') / number('n_steps'):.2g} %",
                     f"{100 * number('max_overlap_relative'):.2g} %", f"{number('wall_time_s'):.0f}"]
        lines.append("| " + " | ".join(cells) + " |")
    text = "\n".join(lines)
    (a.out / "dt.md").write_text(text + "\n", encoding="utf-8")
    print(f"\n{text}\n\n{a.out / 'dt.md'}")


ice = measure("%", lambda x: 0 < x <= 0.95, "not above 0 and up to 95 %")


def arguments(argv):
    p = argparse.ArgumentParser(description="Studies of the full-scale tow of cases/fullscale/berg.yml.")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--case", type=Path, default=Path(__file__).resolve().parent / "berg.yml",
                        help="case file (default: berg.yml)")
    common.add_argument("--out", type=Path, default=ROOT / "out/fullscale",
                        help="folder of the results (default: out/fullscale)")
    common.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="replace a key in every run")
    common.add_argument("--threads", type=whole_from(1, 1024), help="threads of each run (default: all cores)")
    common.add_argument("--bergtow", default=os.environ.get("BERGTOW", str(ROOT / "build/release/bergtow")),
                        help="the program (default: build/release/bergtow)")
    sub = p.add_subparsers(dest="study", required=True)
    table = sub.add_parser("concentration", parents=[common], help="resistance against concentration")
    table.add_argument("--concentrations", type=ice, nargs="+", default=CONCENTRATIONS, metavar="A")
    table.add_argument("--seeds", type=whole_from(1, 1000), default=1, metavar="N",
                       help="fields of each concentration (default: 1)")
    steps = sub.add_parser("dt", parents=[common], help="time steps on one field")
    steps.add_argument("--steps", type=measure("s", lambda x: 0 < x <= 1000, "not above 0 and up to 1000 s"), nargs="+",
                       default=STEPS, metavar="S")
    steps.add_argument("--concentration", type=ice, default=0.8, metavar="A")
    a = p.parse_args(argv)
    if not os.access(a.bergtow, os.X_OK):
        p.error(f"{a.bergtow}: no such program; run make, or name it with --bergtow")
    return a


@style.look()
def main(argv=None):
    a = arguments(argv)
    a.out.mkdir(parents=True, exist_ok=True)
    try:
        {"concentration": concentration, "dt": dt}[a.study](a)
    except Failed as error:
        print(f"study.py: {error}", file=sys.stderr)
        sys.exit(error.code)


if __name__ == "__main__":
    command.guarded(Path(__file__).name, main)
