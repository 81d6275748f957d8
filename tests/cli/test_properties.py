# SPDX-License-Identifier: MIT
"""Properties of every valid case (properties.py) on a few dozen examples, always the same; thousands in tests/long."""
import json

import pytest

import properties
from harness import call

# Examples; what they cost is mpirun for the first.
COUNTS = {"same bits": 5, "turned and mirrored": 10, "renumbered": 8, "passing": 8}


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.ranks) if n == "same bits" else n
                                  for n in properties.PROPERTIES])
def test_property(name):
    tried = properties.hold(name, json.loads(call("--list-keys", "--json").stdout), COUNTS[name])
    assert sum(tried[k] for k in ("contacts", "cut short", "exit code 0")) >= COUNTS[name] // 3, tried
