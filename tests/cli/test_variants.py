# SPDX-License-Identifier: MIT
"""Variants of a study against its first one: the change of the mean, its interval, and the picture."""
import subprocess
import sys

import numpy as np
import pytest
import yaml

import made_up_ensemble
from harness import ROOT, call, write_case

from bergtow import cli
from bergtow.plot import variants as plot_variants
from bergtow.result.members import Members

pytestmark = pytest.mark.usefixtures("look")
BASE = {
    "run": {"title": "t", "dt": 0.1, "duration": 6}, "domain": {"length": 16, "width": 8},
    "ice": {"concentration": 0.3, "size": 1, "thickness": 0.1, "shape": "polygons"},
    "body": {"shape": "disc", "length": 1.5, "draft": 0.3, "mass": 500, "x": 2},
    "tow": {"mode": "speed", "speed": 0.5, "ramp": 1}, "output": {"window_start": 2}
}


@pytest.mark.parametrize("paired", [True, False])
def test_the_interval_of_a_change_holds_the_true_one(paired):
    """Fields with a mean of their own, which a comparison field by field takes out: 1.2 times the first variant."""
    rng = np.random.default_rng(5)
    held, half = 0, []
    for _ in range(1500):
        field = rng.normal(100, 20, 10)
        other = field if paired else rng.normal(100, 20, 10)
        base = dict(enumerate(field + rng.normal(0, 3, 10)))
        means = dict(enumerate(1.2 * (other + rng.normal(0, 3, 10))))
        change, width = plot_variants.change_of(means, base, paired, True)
        held += abs(change - 20) <= width
        half.append(width)
    assert 0.93 < held / 1500 < 0.97, held / 1500
    assert np.median(half) < 5 if paired else 15 < np.median(half) < 40


def test_too_few_fields_have_no_interval():
    for base, paired, change in (({1: 1.0}, True, 100), ({1: 1.0, 2: 3.0}, False, 0)):
        np.testing.assert_equal(plot_variants.change_of({1: 2.0}, base, paired, True), (change, np.nan))


@pytest.mark.parametrize("paired", [True, False])
def test_a_change_has_the_sign_of_the_difference(paired):
    """Also from a negative mean, as under a current from astern; from a mean of zero it is a force."""
    means, base = {1: -5.0, 2: -7.0}, {1: -10.0, 2: -14.0}
    assert plot_variants.change_of(means, base, paired, True)[0] == pytest.approx(50)
    assert plot_variants.change_of(base, means, paired, True)[0] == pytest.approx(-100)
    change, half = plot_variants.change_of(means, {1: 0.0, 2: 0.0}, paired, False)
    assert (change, half) == (-6, pytest.approx(12.706, rel=1e-3))


def test_variants_of_open_water_are_drawn(tmp_path):
    """A first variant with one field, since the others would be copies, and no ice."""
    def member(mean, variant, k):
        return made_up_ensemble.member(np.full(100, mean), {"variant": variant}, ("open", "ice").index(variant))
    made_up_ensemble.write(tmp_path / "a", [member(0.0, "open", 0), *(member(3e4 + k, "ice", k) for k in range(3))])
    figure = plot_variants.draw(Members(tmp_path / "a"), lambda *_: None)
    assert figure.axes[0].patches[0].get_width() == pytest.approx(30, rel=1e-3)
    assert figure._supxlabel.get_text() == "change of the mean ice resistance, kN"


@pytest.mark.slow
@pytest.mark.parametrize("fields", ["common", "own"])
def test_variants_of_a_study_are_drawn(tmp_path, fields):
    write_case(tmp_path, BASE, "base.yml")
    study = {
        "base": "base.yml", "repeats": 3, "fields": fields,
        "parameters": {"ice.concentration": [0.3, 0.5]},
        "variants": {"first": {"ice.friction": 0.35}, "smooth": {"ice.friction": 0.05}, "thick": {"ice.thickness": 0.2}}
    }
    (tmp_path / "study.yml").write_text(yaml.safe_dump(study, sort_keys=False))
    result = call("ensemble", "study.yml", "-o", "out", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    e = Members(tmp_path / "out")
    some = plot_variants.panels(e)
    assert [words for words, *_ in some] == ["concentration 30 %", "concentration 50 %"]
    for k, (_, first, mean, changes) in enumerate(some):
        rows = {name: [m for m in e.used if e.parameters["variant"][m] == name and
                       e.parameters["ice.concentration"][m] == (0.3, 0.5)[k]] for name in ("first", "smooth", "thick")}
        means = {name: e.summary["mean_ice_resistance_n"][m].mean() for name, m in rows.items()}
        assert (first, [name for name, *_ in changes]) == ("first", ["smooth", "thick"])
        np.testing.assert_allclose(mean, means["first"], rtol=1e-12)
        for name, of, change, half in changes:
            np.testing.assert_allclose([of, change], [means[name], 100 * (means[name] / mean - 1)], rtol=1e-9)
            assert half > 0
        assert changes[1][2] > 20, "twice the mass of ice loads the body more"
    cli.perform("plot-ensemble", tmp_path / "out")
    assert (tmp_path / "out/variants.png").stat().st_size > 10000


def changes(*folders, cwd):
    return subprocess.run([sys.executable, str(ROOT / "cases/studies/changes.py"), *folders], cwd=cwd, text=True,
                          capture_output=True)


def made_up(folder, factor, fields=3, missing=False):
    """Fields of two conditions, whose means are `factor` times (1, 2, 3) kN and (10, 20, 30) kN."""
    members = [made_up_ensemble.member([1000 * factor * (k + 1) * (10 if c else 1)] * 40,
                                       {"ice.concentration": 0.8 if c else 0.5}, c,
                                       summary={"peak_ice_resistance_n": 5000.0 * (k + 1), "n_steps": 40,
                                                "max_overlap_relative": 0.001 * (k + 1)},
                                       status=made_up_ensemble.WAITING if missing and c and k < 2 else
                                       made_up_ensemble.FINISHED)
               for c in (0, 1) for k in range(fields)]
    made_up_ensemble.write(folder, members)


def test_a_study_with_a_key_replaced_is_compared_field_by_field(tmp_path):
    made_up(tmp_path / "base", 1)
    made_up(tmp_path / "half", 0.5)
    made_up(tmp_path / "begun", 2, missing=True)
    made_up(tmp_path / "more", 1, fields=4)
    result = changes("base", "smooth=half", "begun", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    assert "| concentration 50 % | 2.00 ± 0.58 | 1.00 ± 0.29 | 4.00 ± 1.2 |" in lines
    assert "| concentration 80 % | 20.0 ± 5.8 | 10.0 ± 2.9 | 60.0 ± – |" in lines
    assert "| concentration 50 % | -50 (-50 to -50) | +100 (+100 to +100) |" in lines
    assert "| concentration 80 % | -50 (-50 to -50) | – |" in lines
    assert "| concentration 80 % | 15.0 | 15.0 | 15.0 |" in lines
    assert ("begun: 4 of 6 fields, 0 of 160 steps not converged, overlap at most 0.3 % of a floe, but for rafting"
            in lines)
    assert (tmp_path / "changes.png").stat().st_size > 10000
    other = changes("base", "more", cwd=tmp_path)
    assert other.returncode == 4 and "has other fields than the first" in other.stderr
    assert changes("base", "nowhere", cwd=tmp_path).returncode == 4
    assert changes("base", "half", "-o", "x.txt", cwd=tmp_path).returncode == 2
