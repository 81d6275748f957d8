# SPDX-License-Identifier: MIT
"""Does the 95 % interval of one run hold the mean of the fields? 160 fields each at four concentrations at full scale
(make test-long; half an hour on two cores)."""
import json
import subprocess

import harness
import numpy as np
import pytest

FIELDS, SEEDS = 80, (1, 5001)  # the estimator was chosen on the first and tried on the second
STUDY = {
    "title": "intervals of single runs",
    "base": str(harness.ROOT / "cases/fullscale/berg.yml"),
    "repeats": FIELDS,
    "set": {
        "run.duration": "1 h", "domain.length": "4 km", "domain.width": "1.2 km", "body.x": "-1500 m",
        "output.window_start": "20 min", "output.frame_interval": "1 h", "solver.tolerance": 1e-2,
        "solver.max_sweeps": 200
    },
    "parameters": {"ice.concentration": [0.2, 0.5, 0.65, 0.8]},
    "with": {
        "ice.concentration=0.2": {"domain.width": "2.4 km"}, "ice.concentration=0.5": {"domain.width": "1.9 km"},
        "ice.concentration=0.65": {"domain.width": "1.5 km"}
    },
}


@pytest.fixture(scope="module")
def members(tmp_path_factory):
    """Summaries of the members by condition: four lists."""
    conditions = [[], [], [], []]
    for seed in SEEDS:
        folder = tmp_path_factory.mktemp("intervals")
        (folder / "study.yml").write_text(json.dumps(dict(STUDY, seed=seed)))
        command = [*harness.launcher(2), str(harness.BERGTOW), "ensemble", "study.yml", "-o", "out", "--threads", "1"]
        subprocess.run(command, cwd=folder, check=True, env=harness.environment(OMP_NUM_THREADS=1),
                       stdout=subprocess.DEVNULL, timeout=7200)
        found = [json.loads(p.read_text()) for p in sorted(folder.glob("out/members/*/summary.json"))]
        assert len(found) == 4 * FIELDS
        for i, condition in enumerate(conditions):
            condition += found[i * FIELDS:(i + 1) * FIELDS]
    return conditions


def test_the_interval_of_one_run_holds_the_mean_of_the_others(members):
    shares = []
    for condition in members:
        mean, low, high = (np.array([s[f"mean_ice_resistance{end}_n"]
                                     for s in condition])
                           for end in ("", "_low", "_high"))
        others = (mean.sum() - mean) / (len(mean) - 1)
        shares.append(np.mean((low <= others) & (others <= high)))
        se = np.sqrt(np.mean([s["mean_ice_resistance_se_n"] ** 2 for s in condition]))
        verdicts = [s["window"]["verdict"] for s in condition]
        print(
            f"{condition[0]['concentration']:.2f}: mean {mean.mean():.4g} N, sd of fields {mean.std(ddof=1):.3g} N, "
            f"standard error of a run {se:.3g} N, "
            f"intervals hold the mean of the others in {100 * shares[-1]:.1f} %; " +
            ", ".join(f"{verdicts.count(v)} {v}" for v in sorted(set(verdicts))))
    # Of 160 fields with 95 % each, 145 to 156 in 97 % of all cases; more than 98 % would be an interval wider than it
    # says.
    assert 0.9 <= min(shares) and max(shares) <= 0.98


LIGHT = {
    "run": {"dt": 0.5, "duration": "40 min"},
    "domain": {"frame": "geographic", "length": "2 km", "width": "0.8 km", "ends": "moving", "sides": "periodic"},
    "ice": {"concentration": 0.1, "size": 30, "thickness": 0.8},
    "body": {"shape": "ship", "length": 80, "width": 20, "draft": 8},
    "tow": {"mode": "speed", "speed": 0.8},
    "output": {"frame_interval": -1}
}


def test_the_start_that_is_found_leaves_the_mean_of_light_ice(tmp_path):
    """200 fields each of a ship in 2, 5, 10 and 20 % ice, from the start that is found and from the end of the ramp on:
    the same to about 1 %. Red at −31 to −5 % when the window begins where the variance of the mean is least, and at
    −3.8 % where ranks alone say whether it may."""
    concentrations = [0.02, 0.05, 0.1, 0.2]
    (tmp_path / "light.yml").write_text(json.dumps(LIGHT))
    means = []
    for name, words in (("found", []), ("whole", ["-s", "output.window_start=53.4"])):
        study = {"title": name, "base": "light.yml", "repeats": 200, "seed": 1,
                 "parameters": {"ice.concentration": concentrations}}
        (tmp_path / f"{name}.yml").write_text(json.dumps(study))
        subprocess.run([str(harness.BERGTOW), "ensemble", f"{name}.yml", "-o", name, "--jobs", "2", "--threads", "1",
                        *words], cwd=tmp_path, check=True, stdout=subprocess.DEVNULL, timeout=3600)
        found = [json.loads(p.read_text())["mean_ice_resistance_n"]
                 for p in sorted((tmp_path / name).glob("members/*/summary.json"))]
        means.append(np.array(found).reshape(len(concentrations), 200))
    found, whole = means
    for c, f, w in zip(concentrations, found, whole):
        print(f"{c:.2f}: found {f.mean():.4g} N, whole {w.mean():.4g} N: {100 * (f.mean() / w.mean() - 1):+.1f} %, "
              f"begins later in {100 * np.mean(f != w):.0f} % of the fields")
    assert np.all(np.abs(found.mean(1) / whole.mean(1) - 1) < 0.02)
