# SPDX-License-Identifier: MIT
"""Thousands of random cases (random_cases.py) under the sanitizers; CASES=N, FIRST=SEED."""
import collections
import json
import os

import judge
from harness import ROOT, call

PROGRAM = ROOT / "build/asan/bergtow"
CASES, FIRST = int(os.environ.get("CASES", 2000)), int(os.environ.get("FIRST", 100000))


def test_random_cases(tmp_path):
    assert PROGRAM.exists(), "make CONFIG=asan all"
    table = json.loads(call("--list-keys", "--json").stdout)
    codes, wrong = collections.Counter(), []
    for seed in range(FIRST, FIRST + CASES):
        code, found = judge.tried(seed, table, PROGRAM, tmp_path)
        codes[code] += 1
        wrong += found
        if found:
            print("\n".join(found), flush=True)
    print(f"exit codes of {CASES} cases: {dict(codes)}")
    assert not wrong
    assert codes[0] >= 0.8 * CASES
