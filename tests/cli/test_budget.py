# SPDX-License-Identifier: MIT
"""postproc/budget.py: variance components and shares of models with known ones, distributions of the Latin hypercube,
and a study end to end."""
import json
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy import stats

import made_up_ensemble as made_up
from harness import BERGTOW, ROOT, TOW, changed, environment, write_case

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "postproc"))

import budget  # noqa: E402
import budget_text  # noqa: E402
import findings  # noqa: E402
import stat_budget  # noqa: E402
from bergtow_read import RunError  # noqa: E402
from command import plain  # noqa: E402
from ensemble_read import Ensemble  # noqa: E402


def latin(n, k, rng):
    return (np.array([rng.permutation(n) for _ in range(k)]).T + rng.random((n, k))) / n


def drawn(model, n, k, repeats, noise, rng, names="abcdefgh"):
    """(parameters, condition, y) of a hypercube; model(u [n, k]) -> [n]."""
    u = latin(n, k, rng)
    y = np.repeat(model(u), repeats) + noise * rng.standard_normal(n * repeats)
    return {names[j]: np.repeat(u[:, j], repeats) for j in range(k)}, np.repeat(np.arange(n), repeats), y


# ---- known answers


def test_a_linear_model_with_noise():
    """y = 10 + sum c u + noise: variances c²/12 and the noise's."""
    c, noise = np.array([6.0, 3.0, 1.0]), 1.0
    truth, rng = np.sum(c * c) / 12, np.random.default_rng(1)
    found = stat_budget.budget(*drawn(lambda u: 10 + u @ c, 400, 3, 3, noise, rng))
    assert found["mean"] == pytest.approx(15, abs=0.1) and found["fields"]["sd"] == pytest.approx(noise, rel=0.06)
    assert found["parameters"]["sd"] == pytest.approx(np.sqrt(truth), rel=0.05)
    assert found["fields"]["share"] == pytest.approx(noise ** 2 / (noise ** 2 + truth), abs=0.03)
    first = [i["first"] for i in found["shares"]["indices"].values()]
    assert first == pytest.approx(c * c / np.sum(c * c), abs=0.03)


def test_intervals_hold_the_variances():
    c, noise, rng = np.array([3.0, 2.0]), 1.0, np.random.default_rng(2)
    truth = {"fields": noise, "parameters": np.sqrt(np.sum(c * c) / 12)}
    inside = {"fields": 0, "parameters": 0, "mean": 0}
    for _ in range(200):
        parameters, condition, y = drawn(lambda u: 10 + u @ c, 24, 2, 2, noise, rng)
        groups = np.split(y, 24)
        whole = stat_budget.parts(groups)
        without = [stat_budget.parts(groups[:i] + groups[i + 1:]) for i in range(24)]
        for name, value in truth.items():
            low, high = stat_budget._interval(getattr(whole, name), [getattr(p, name) for p in without], True)
            inside[name] += low <= value ** 2 <= high
        low, high = stat_budget._interval(whole.mean, [p.mean for p in without], False)
        inside["mean"] += low <= 10 + c.sum() / 2 <= high
    assert all(0.9 <= n / 200 <= 1.0 for n in inside.values()), inside


def test_ishigami_through_the_ensemble(tmp_path):
    """Ishigami & Homma 1990 with noise, in the file of an ensemble, by the code that reads one."""
    a, b, pi, rng = 7.0, 0.1, np.pi, np.random.default_rng(3)
    def model(u):
        x = pi * (2 * u - 1)
        return 100 + np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])
    parameters, condition, y = drawn(model, 300, 3, 2, 0.5, rng)
    members = [made_up.member(np.full(3, v), {k: p[i] for k, p in parameters.items()}, int(condition[i]))
               for i, v in enumerate(y)]
    found = budget.of_ensemble(Ensemble(made_up.write(tmp_path / "e", members, sampling="latin-hypercube")))
    v1, v2, v13 = 0.5 * (1 + b * pi ** 4 / 5) ** 2, a * a / 8, b * b * pi ** 8 * (1 / 18 - 1 / 50)
    total = v1 + v2 + v13
    assert found["parameters"]["sd"] == pytest.approx(np.sqrt(total), rel=0.08)
    assert found["fields"]["sd"] == pytest.approx(0.5, rel=0.1)
    i = found["shares"]["indices"]
    assert [i[k]["first"] for k in "abc"] == pytest.approx(np.array([v1, v2, 0]) / total, abs=0.05)
    assert [i[k]["total"] for k in "abc"] == pytest.approx(np.array([v1 + v13, v2, v13]) / total, abs=0.05)
    assert found["shares"]["q2"] > 0.85 and "rough guide" not in budget_text.notes(plain(found))


def test_what_cannot_be_predicted_is_not_shared_out():
    rng = np.random.default_rng(4)
    steps = stat_budget.budget(*drawn(lambda u: 5 + np.sign(np.sin(60 * u[:, 0])), 60, 2, 2, 0.1, rng))
    assert "refused" in steps["shares"] and steps["parameters"]["sd"] == pytest.approx(1, rel=0.1)
    nothing = stat_budget.budget(*drawn(lambda u: 5 + 0 * u[:, 0], 60, 2, 2, 1.0, rng))
    assert nothing["parameters"]["share"] < 0.3 and nothing["parameters"]["sd_95"][0] == 0
    once = stat_budget.budget(*drawn(lambda u: 5 + u[:, 0], 60, 2, 1, 1.0, rng))
    assert np.isnan(once["fields"]["sd"]) and once["parameters"]["sd"] == pytest.approx(np.sqrt(1 + 1 / 12), rel=0.25)
    assert "needs 8" in stat_budget.budget({"a": np.arange(3)}, np.arange(3), np.ones(3))["refused"]


def test_a_response_of_many_scales_is_shared_out_on_its_logarithm():
    rng = np.random.default_rng(5)
    found = stat_budget.budget(*drawn(lambda u: np.exp(4 * u[:, 0] + 3 * u[:, 1]), 60, 2, 2, 0.0, rng))
    assert found["shares"]["scale"] == "its logarithm" and found["shares"]["q2"] > 0.99
    assert found["shares"]["indices"]["a"]["first"] == pytest.approx(16 / 25, abs=0.05)


def test_numerics_are_those_of_the_last_comparisons():
    rows = [{"name": "width", "interval_95": [-0.5, -0.3]}, {"name": "width", "interval_95": [-0.06, 0.02]},
            {"name": "dt", "interval_95": [0.01, 0.08]}, {"name": "start", "interval_95": [1.0, 2.0]},
            {"name": "length", "interval_95": [None, None]}, {"name": "fields"}]
    assert stat_budget.relative_numerics(rows) == pytest.approx(np.hypot(0.03, 0.04))
    assert stat_budget.relative_numerics([]) is None
    made = drawn(lambda u: 10 + u[:, 0], 40, 1, 2, 0.3, np.random.default_rng(6))
    assert stat_budget.budget(*made, rows)["numerics"]["sd"] == pytest.approx(0.05 * made[2].mean(), rel=0.01)


# ---- the sampler


STUDY = {
    "base": "base.yml", "sampling": "latin-hypercube", "samples": 12, "repeats": 2,
    "parameters": {
        "ice.friction": {"from": 0.1, "to": 0.5, "distribution": "triangular", "source": "a book, p. 3"},
        "ice.thickness": {"from": "2 cm", "to": "6 cm", "distribution": "normal"},
        "body.draft": {"from": 0.3, "to": 0.6, "distribution": "normal", "scale": "log"},
        "ice.density": {"from": 850, "to": 920}
    }
}
BASE = changed(TOW, run__duration=8, output__window_start=2, domain__length=8, domain__width=5,
               estimate__length_scale=900)  # a time scale of 1 s


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    folder = tmp_path_factory.mktemp("budget")
    write_case(folder, BASE, "base.yml")
    write_case(folder, STUDY, "study.yml")
    done = subprocess.run([BERGTOW, "budget", "study.yml", "-o", "out", "--budget", "3"], cwd=folder,
                          env=environment(BERGTOW_HOME=ROOT), capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


def test_every_stratum_of_each_distribution_holds_one_value(small):
    """The distribution function of SciPy takes the values of a hypercube to one in each n-th part of (0, 1)."""
    cut = 2 * stats.norm.cdf(3) - 1
    def normal(lo, hi, x):
        return (stats.norm.cdf(x, (lo + hi) / 2, (hi - lo) / 2 / stats.norm.ppf(0.975)) - stats.norm.cdf(-3)) / cut
    below = {
        "ice.friction": lambda x: stats.triang.cdf(x, 0.5, 0.1, 0.4), "ice.thickness": lambda x: normal(0.02, 0.06, x),
        "body.draft": lambda x: normal(np.log(0.3), np.log(0.6), np.log(x)),
        "ice.density": lambda x: stats.uniform.cdf(x, 850, 70)
    }
    with h5py.File(small[0] / "out/ensemble.h5") as f:
        for key, function in below.items():
            x = f[f"parameters/{key}"][::2]
            assert np.array_equal(f[f"parameters/{key}"][1::2], x)
            assert sorted(np.floor(12 * function(x) + 1e-9).astype(int).tolist()) == list(range(12)), key
        attributes = dict(f["parameters/ice.friction"].attrs)
    assert attributes["source"] in ("a book, p. 3", b"a book, p. 3") and b"triangular from 0.1 to 0.5" in np.bytes_(
        attributes["distribution"])


def test_a_study_end_to_end(small):
    folder, text = small
    found = json.loads((folder / "out/budget.json").read_text())
    assert found["members"] == found["wanted"] == 24 and found["conditions"] == 12
    assert "a book, p. 3" in text and "log-normal, 95 % from 0.3 to 0.6 m; assumed" in text and "not studied" in text
    with h5py.File(folder / "out/ensemble.h5") as f:
        y = f["summary/mean_ice_resistance_n"][()]
    pairs = y.reshape(12, 2)
    assert found["mean"] == pytest.approx(y.mean())
    assert found["fields"]["sd"] ** 2 == pytest.approx(np.mean(np.var(pairs, axis=1, ddof=1)))
    assert (folder / "out/budget.png").stat().st_size > 15_000
    tail, largest = found["more"]
    assert [tail["of"], largest["of"]] == ["tow_force:99", "tow_force:100"]
    assert "tow force that 1 % of the time exceeds, as the moving mean over 1 s" in text
    levels, most = [], []
    for member in sorted((folder / "out/members").iterdir()):
        with h5py.File(member / "result.h5") as f:
            t, x = f["series/time"][:], f["series/tow_force"][:]
        n = round(1 / (t[1] - t[0]))
        some = x[t >= json.loads((member / "summary.json").read_text())["window"]["start_s"] - 1e-9]
        means = np.convolve(some, np.full(n, 1 / n), "valid")
        levels.append(np.percentile(means, 99))
        most.append(means.max())
    assert len(levels) == 24 and tail["mean"] == pytest.approx(np.mean(levels), rel=1e-9)
    assert tail["fields"]["sd"] ** 2 == pytest.approx(np.mean(np.var(np.reshape(levels, (12, 2)), axis=1, ddof=1)))
    assert largest["mean"] == pytest.approx(np.mean(most), rel=1e-9) and largest["mean"] > tail["mean"]
    seconds = json.loads((member / "summary.json").read_text())["window"]
    minutes = f"{(seconds['end_s'] - seconds['start_s']) / 60:.3g} min"
    assert f"largest tow force of a tow, within {minutes}, as the moving mean over 1 s" in text
    block = findings.chapter("budget", findings.read("budget", folder / "out"))
    assert block["markdown"].startswith("| part |") and len(block["figure"]().axes) == 2
    (folder / "converge.json").write_text(json.dumps({"rows": [{"name": "dt", "interval_95": [-0.1, 0.2]}]}))
    again = subprocess.run([BERGTOW, "budget", "study.yml", "-o", "out", "--converge", "converge.json"], cwd=folder,
                           env=environment(BERGTOW_HOME=ROOT), capture_output=True, text=True)
    assert again.returncode == 0 and "at most" in again.stdout
    assert json.loads((folder / "out/budget.json").read_text())["numerics"]["sd"] == pytest.approx(0.1 * abs(y.mean()))


def test_what_is_refused(small, tmp_path):
    folder, _ = small
    def said(study, *more, out="refused"):
        write_case(tmp_path, BASE, "base.yml")
        write_case(tmp_path, study, "study.yml")
        done = subprocess.run([BERGTOW, "budget", "study.yml", "-o", out, *more], cwd=tmp_path,
                              env=environment(BERGTOW_HOME=ROOT), capture_output=True, text=True)
        assert done.returncode == 4 and "Traceback" not in done.stderr
        return done.stderr
    def varied(**entry):
        return STUDY | {"parameters": {"ice.friction": {"from": 0.1, "to": 0.5} | entry}}
    assert "ice.friction.distribution: bell: give uniform, triangular or normal" in said(varied(distribution="bell"))
    wide = {"from": 0.001, "distribution": "normal"}
    assert "a normal distribution with 95 % from 0.001 to 0.5 reaches: -0.1" in said(varied(**wide))
    grid = {k: v for k, v in STUDY.items() if k not in ("sampling", "samples")}
    assert "set sampling: latin-hypercube and samples" in said(grid)
    assert "no such file" in subprocess.run([BERGTOW, "budget", "none.yml"], env=environment(BERGTOW_HOME=ROOT),
                                            cwd=tmp_path, capture_output=True, text=True).stderr
    assert "is no converge.json" in said(STUDY, "--converge", "nothing.json", out=folder / "out")
    assert "has no number mean_colour" in said(STUDY, "--of", "mean_colour", out=folder / "out")
    assert "has no load colour" in said(STUDY, "--of", "colour:99", out=folder / "out")
    for wrong in ("tow_force:101", "tow_force:0"):
        assert "above 0 and at most at 100 %" in said(STUDY, "--of", wrong, out=folder / "out")
    with pytest.raises(RunError, match="is no Latin hypercube"):
        one = made_up.member(np.ones(3), {"ice.friction": 0.1}, 0)
        budget.of_ensemble(Ensemble(made_up.write(tmp_path / "g", [one])))
