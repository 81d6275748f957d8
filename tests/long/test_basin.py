# SPDX-License-Identifier: MIT
"""Studies on cases/basin that take minutes (make test-long). The tables in cases/basin/README.md are what they
print."""
import concurrent.futures
import os

import harness
import numpy as np
import pytest
from scipy.stats import mannwhitneyu

SEEDS = range(1, 25)
STUDIES = {"base": [], "tolerance / 10": ["solver.tolerance=1e-4"], "dt / 2": ["run.dt=0.05"]}


def basin(concentration):
    return harness.ROOT / f"cases/basin/basin-{concentration}.yml"


def tow(folder, concentration, name, settings):
    options = [o for s in settings for o in ("--set", s)]
    return harness.run(folder, basin(concentration), "--quiet", "--threads", 1, *options, name=name, timeout=3600)


@pytest.fixture(scope="module")
def means(tmp_path_factory):
    """Mean ice resistance by concentration, study and seed, N: [3][seeds] arrays."""
    folder = tmp_path_factory.mktemp("basin")
    jobs = {(c, study, seed): [f"ice.seed={seed}", *settings]
            for c in (20, 50, 80) for study, settings in STUDIES.items() for seed in SEEDS}
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        futures = {k: pool.submit(tow, folder, k[0], "-".join(map(str, k)).replace(" / ", "_"), v) for k,
                   v in jobs.items()}
        runs = {k: f.result() for k, f in futures.items()}
    table = {}
    for c in (20, 50, 80):
        for study in STUDIES:
            own = [runs[c, study, seed].summary for seed in SEEDS]
            table[c, study] = np.array([s["mean_ice_resistance_n"] for s in own])
            print(
                f"{c} %  {study:15s}  {table[c, study].mean():8.3f} N +- {standard_error(table[c, study]):.3f}  "
                f"median {np.median(table[c, study]):.3f} N  highest {table[c, study].max():.3f} N  "
                f"tow {np.mean([s['mean_tow_force_n'] for s in own]):.2f} N  sweeps "
                f"{np.mean([s['mean_sweeps'] for s in own]):.1f}  "
                f"unconverged {sum(s['unconverged_steps'] for s in own)} of {sum(s['n_steps'] for s in own)}  residual "
                f"to "
                f"{max(s['max_residual_m_s'] / s['tolerance_m_s'] for s in own):.1f} x tolerance  "
                f"overlap {max(s['max_overlap_relative'] for s in own):.4f}  wall "
                f"{np.mean([s['wall_time_s'] for s in own]):.1f} s"
            )
    return table


def standard_error(x):
    return np.std(x, ddof=1) / np.sqrt(len(x))


@pytest.mark.parametrize("concentration", [20, 50, 80])
def test_tolerance_does_not_move_the_mean(means, concentration):
    """Tenfold tighter: the runs over 24 fields rank as if drawn from one distribution (Mann and Whitney, 5 %).

    By ranks, because a jam that locks for good makes one mean of 43,000 N, and with it a standard error under which
    nothing could fail. A solver that stops at once (solver.tolerance=1) fails it at 20 %.
    """
    base, tight = means[concentration, "base"], means[concentration, "tolerance / 10"]
    assert mannwhitneyu(base, tight).pvalue > 0.05


def test_two_thousand_seconds_in_dense_ice(tmp_path):
    """260 m of tow through 80 %: no overlap above 2 % of the mean floe size, and every step that did not converge is
    counted."""
    r = tow(tmp_path, 80, "long", ["domain.length=290", "run.duration=2000"])
    assert r.summary["n_steps"] == 20000
    overlap, unconverged, residual = r.series("overlap", "unconverged", "residual")
    assert overlap.max() <= 0.02 * r.summary["mean_size_m"]
    assert r.summary["unconverged_steps"] == unconverged.sum() == np.sum(residual > r.summary["tolerance_m_s"])
    assert not unconverged.any() or harness.warned(r, "reached the work limit")
    assert r.series("momentum_residual").max() <= 1e-10
    print(f"long: {r.summary['mean_ice_resistance_n']:.2f} N +- {r.summary['mean_ice_resistance_se_n']:.2f}, overlap "
          f"{overlap.max():.4f} m, unconverged {int(unconverged.sum())}, residual "
          f"{residual.max() / r.summary['tolerance_m_s']:.1f} x tolerance, wall {r.summary['wall_time_s']:.0f} s")
