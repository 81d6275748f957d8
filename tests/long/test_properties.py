# SPDX-License-Identifier: MIT
"""Properties of every valid case (properties.py) on thousands of examples; CASES=N of each, FIRST=SEED."""
import json
import os

import pytest

import properties
from harness import call

CASES, FIRST = int(os.environ.get("CASES", 1000)), int(os.environ.get("FIRST", 1))


@pytest.mark.parametrize("name", properties.PROPERTIES)
def test_property(name):
    tried = properties.hold(name, json.loads(call("--list-keys", "--json").stdout), CASES, FIRST)
    print(f"{name}: {dict(tried)}", flush=True)
