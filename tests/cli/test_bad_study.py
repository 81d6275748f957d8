# SPDX-License-Identifier: MIT
"""Study files that are refused: each fault with its line, its key and what to do."""
import pytest
from harness import CASE, DONE, TOW, call, write_case

STUDIES = {
    "list for a word": ("title: [a]\n", "study.yml:2: title: needs a single value"),
    "no number": ("repeats: many\n", "study.yml:2: repeats: many: give a whole number from 1 to 100000"),
    "section in set": ("set: {ice: 1}\n", "ice: is a section; write its keys with a dot"),
    "unknown key in set": ("set: {ice.sise: 1}\n", "ice.sise: unknown key; did you mean ice.size?"),
    "unlike any key": ("set: {banana: 1}\n", "banana: unknown key; see bergtow --list-keys"),
    "threads": ("set: {run.threads: 2}\n", "run.threads: is chosen for all members by --threads"),
    "seed": ("parameters: {ice.seed: [1, 2]}\n", "ice.seed: the fields of a study take their seeds from `seed`"),
    "points": ("set: {tow.waypoints: [[1, 2]]}\n",
               "tow.waypoints: a study needs single values; points can be set as a text"),
    "points as values": ("parameters: {tow.waypoints: ['[[1, 2]]', '[[1, 3]]']}\n", "tow.waypoints: a study needs"),
    "points that are none": ("set: {tow.waypoints: '[[1, 2, 3]]'}\n", "study.yml:2: tow.waypoints"),
    "fields": ("fields: mine\n", "study.yml:2: fields: mine: give own, common or numbered"),
    "value of a key": ("set: {ice.size: 3 kN}\n", "ice.size: kN is the unit of a force"),
    "set of no map": ("set: 3\n", "set: needs keys with values"),
    "empty list": ("parameters: {ice.size: []}\n", "ice.size: the list is empty"),
    "twice in a list": ("parameters: {ice.size: [1, 1]}\n", "ice.size: 1 is twice in the list"),
    "range of a choice": ("parameters: {ice.shape: {from: 1, to: 2}}\n", "ice.shape: has no range; give a list"),
    "end that is no number": ("parameters: {ice.size: {from: [1], to: 2}}\n", "ice.size.from: needs a single value"),
    "scale": ("parameters: {ice.size: {from: 1, to: 2, scale: cubic}}\n", "ice.size.scale: cubic: give linear or log"),
    "word of a range": ("parameters: {ice.size: {from: 1, too: 2}}\n", "ice.size.too: unknown key; did you mean to"),
    "backwards": ("parameters: {ice.size: {from: 2, to: 1}}\n", "ice.size: needs from and to, from below to"),
    "logarithm of zero": ("parameters: {ice.friction: {from: 0, to: 1, scale: log}}\n",
                          "a logarithmic range begins above zero"),
    "varied and set": ("set: {ice.size: 1}\nparameters: {ice.size: [1, 2]}\n",
                       "ice.size: is varied and is also in `set`"),
    "single parameter": ("parameters: {ice.size: 1}\n", "ice.size: needs a list [a, b] or a range"),
    "parameters of no map": ("parameters: 1\n", "parameters: needs keys with lists or ranges"),
    "no variants": ("variants: {}\n", "variants: needs names with keys"),
    "with of nothing": ("with: 1\n", "with: needs values with keys"),
    "with of no value": ("parameters: {ice.size: [1, 2]}\nwith: {ice.size=3: {tow.speed: 1}}\n",
                         "with: ice.size=3: is not a value of a parameter"),
    "varied in a variant": ("parameters: {ice.size: [1, 2]}\nvariants: {a: {}, b: {ice.size: 3}}\n",
                            "study.yml:3: ice.size: is given under `variants`, and under `parameters` in study.yml:2"),
    "varied in with": ("parameters: {ice.size: [1, 2], tow.speed: [1, 2]}\nwith: {ice.size=1: {tow.speed: 3}}\n",
                       "study.yml:3: tow.speed: is given under `with`, and under `parameters` in study.yml:2: "),
    "its own value in with": ("parameters: {ice.size: [1, 2]}\nwith: {ice.size=1: {ice.size: 3}}\n",
                              "study.yml:3: ice.size: is given under `with`, and under `parameters`"),
    "variant and with": ("parameters: {ice.size: [1, 2]}\nvariants: {a: {tow.speed: 1}}\n"
                         "with: {ice.size=1: {tow.speed: 3}}\n",
                         "study.yml:4: tow.speed: is given under `with`, and under `variants` in study.yml:3: "),
    "with of two parameters": ("parameters: {ice.size: [1, 2], tow.speed: [1, 2]}\nwith:\n"
                               "  ice.size=1: {run.dt: 1}\n  tow.speed=2: {run.dt: 2}\n",
                               "study.yml:5: run.dt: is given under `with`, and under `with` in study.yml:4: "),
    "with of a variant": ("variants: {a: {}, b: {ice.size: 3}}\nwith: {variant=b: {run.dt: 2}}\n",
                          "study.yml:3: with: variant=b: keys of a variant belong under its name"),
    "with of a range that is drawn from": (
        "sampling: latin-hypercube\nsamples: 3\nparameters: {ice.size: {from: 1, to: 2}}\n"
        "with: {ice.size=1: {run.dt: 2}}\n", "study.yml:5: with: ice.size=1: ice.size is drawn from a range"),
    "one value in three words": ("parameters: {ice.friction: [0.5, 0.2, 50 %]}\n",
                                 "ice.friction: 0.5 and 50 % are the same value"),
    "one value with a rounded end": ("parameters: {ice.friction: [0.07, 7 %]}\n", "0.07 and 7 % are the same value"),
    "one length in two units": ("parameters: {ice.size: [1 m, 100 cm]}\n", "1 m and 100 cm are the same value"),
    "whole numbers twice": ("parameters: {ice.sides: {from: 3, to: 5, n: 6}}\n",
                            "ice.sides: 6 values from 3 to 5 have 3 more than once, as they are whole numbers"),
    "sampling": ("sampling: dice\n", "sampling: dice: give grid or latin-hypercube"),
    "hypercube of nothing": ("sampling: latin-hypercube\nsamples: 3\n", "there is nothing to sample"),
    "hypercube without number": ("sampling: latin-hypercube\nparameters: {ice.size: [1, 2]}\n", "samples: missing"),
    "unknown word": ("repeat: 3\n", "study.yml:2: repeat: unknown key of a study; did you mean repeats"),
}


@pytest.mark.parametrize("kind", STUDIES)
def test_refused_study(tmp_path, kind):
    text, fragment = STUDIES[kind]
    write_case(tmp_path, TOW)
    (tmp_path / "study.yml").write_text("base: case.yml\n" + text)
    result = call("ensemble", "study.yml", "-o", "out", cwd=tmp_path)
    assert result.returncode == CASE, result.stderr
    assert any("study.yml" in line and fragment in line for line in result.stderr.splitlines()), result.stderr
    assert not (tmp_path / "out").exists()


def test_a_key_of_several_values_of_one_parameter(tmp_path):
    """Each value of a parameter may bring the same key. The parameter's own key belongs to it in all of them, and each
    place that gives it is named."""
    write_case(tmp_path, TOW)
    study = "base: case.yml\nparameters: {ice.size: [1, 2]}\nwith:\n  ice.size=1: {KEY: 3}\n  ice.size=2: {KEY: 4}\n"
    (tmp_path / "study.yml").write_text(study.replace("KEY", "domain.width"))
    assert call("check", "study.yml", cwd=tmp_path).returncode == DONE
    (tmp_path / "study.yml").write_text(study.replace("KEY", "ice.size"))
    said = call("check", "study.yml", cwd=tmp_path)
    assert said.returncode == CASE
    for line in 4, 5:
        said_of = f"study.yml:{line}: ice.size: is given under `with`, and under `parameters` in study.yml:2"
        assert said_of in said.stderr


def test_study_without_base(tmp_path):
    (tmp_path / "study.yml").write_text("repeats: 2\n")
    result = call("ensemble", "study.yml", cwd=tmp_path)
    assert result.returncode == CASE and "study.yml: base: missing; name the case that is varied" in result.stderr
    (tmp_path / "study.yml").write_text("[1]\n")
    assert "is not a study; it needs at least base: CASE.yml" in call("ensemble", "study.yml", cwd=tmp_path).stderr
