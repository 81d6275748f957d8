# SPDX-License-Identifier: MIT
"""Random cases (random_cases.py): eight, 50 steps each, on the build with sanitizers where it is there; thousands
in tests/long."""
import collections
import json
import os
import pathlib

import pytest

import judge
import random_cases
from harness import BERGTOW, ROOT, USAGE, call

ASAN = ROOT / "build/asan/bergtow"
PROGRAM = ASAN if ASAN.exists() else pathlib.Path(BERGTOW)
SEEDS = 8


@pytest.fixture(scope="module")
def table():
    return json.loads(call("--list-keys", "--json").stdout)


def test_every_key_has_its_place(table):
    names = [k["name"] for k in table["keys"]]
    placed = [*random_cases.FREE, *random_cases.SCENE, *random_cases.LEFT_OUT]
    assert sorted(names) == sorted(placed), sorted(set(names) ^ set(placed))


def test_draws_reach_every_key_and_choice(table):
    """In 3000 cases: each key that is not left out, each choice, and both bounds of the ranges that say so."""
    keys = {k["name"]: k for k in table["keys"]}
    seen = collections.defaultdict(set)
    for seed in range(3000):
        case = random_cases.draw(seed, table)
        for path, value in random_cases.flat(case):
            seen[path].add(value if not isinstance(value, list) else "list")
    missing = set(keys) - set(random_cases.LEFT_OUT) - set(seen)
    assert not missing, sorted(missing)
    for name, key in keys.items():
        if key["type"] == "choice" and name not in random_cases.LEFT_OUT:
            assert seen[name] == set(key["choices"]), name
    for name, spec in random_cases.FREE.items():
        for letter, bound in (("l", "least"), ("m", "most")):
            if spec and isinstance(spec, tuple) and letter in spec[2]:
                assert any(abs(x - keys[name][bound]) <= 1e-5 * abs(x) for x in seen[name]), (name, bound)
    assert {k["name"]
            for k in table["floe_keys"]
            } <= {k
                  for seed in range(200) for floe in random_cases.draw(seed, table).get("floes", ()) for k in floe}


def test_a_seed_is_a_case_for_ever(table):
    assert random_cases.text(random_cases.draw(7, table)) == random_cases.text(random_cases.draw(
        7, table)) != random_cases.text(random_cases.draw(8, table))


def test_random_cases(tmp_path, table):
    """Nothing crashes, hangs, loses a floe or a number; what ends well has let no guard through; most end well."""
    codes, wrong = collections.Counter(), []
    for seed in range(SEEDS):
        code, found = judge.tried(seed, table, PROGRAM, tmp_path)
        codes[code] += 1
        wrong += found
    assert not wrong, "\n".join(wrong)
    assert codes[0] >= 0.8 * SEEDS, codes


def test_keys_as_json(table):
    """The same keys as the table for people; ranges in the unit of a number without one."""
    listed = [line.split()[0] for line in call("--list-keys").stdout.splitlines() if line[:1].isalpha()]
    assert [k["name"] for k in table["keys"]] == [n for n in listed if "." in n][:len(table["keys"])]
    keys = {k["name"]: k for k in table["keys"]}
    assert keys["run.dt"] | {"doc": ""} == {
        "name": "run.dt", "type": "real", "required": True, "default": None, "follows": None, "default_at_sea": False,
        "unit": "s", "least": 0, "above_least": True, "most": 1000, "below_most": False, "doc": ""
    }
    assert (keys["body.yaw"]["least"], keys["body.yaw"]["unit"], keys["body.yaw"]["default"]) == (-360, "deg", "0 deg")
    assert keys["tow.mode"]["choices"] == ["none", "speed", "line", "thrust"
                                           ] and keys["body.width"]["follows"] == "body.length"
    assert {k["name"] for k in table["floe_keys"]} >= {"x", "y", "fixed", "thickness"}
    refused = call("--list-keys", "--jsn")
    assert refused.returncode == USAGE and "did you mean --json?" in refused.stderr
    assert os.linesep not in refused.stderr.rstrip()
