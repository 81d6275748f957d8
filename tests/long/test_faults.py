# SPDX-License-Identifier: MIT
"""Calls of the system and requests for memory that fail, at every n; the table of what comes of it is printed (-s).

Where a run is one of another scenario with more around it, with ranks, and in an ensemble: at some n of each call.
Hours of one core."""
import collections

import pytest

from faults import FAULTS, SCENARIOS, campaign, numbers, printed

EVERY = 10**6
MOST = {"run --force": 30, "run --dump-contacts": 30, "ensemble": 20, "ensemble, 2 jobs": 4,
        "ensemble, 2 jobs, the second": 4, "2 ranks": 12, "2 ranks, the second": 12, "run --force, 2 ranks": 12}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", SCENARIOS)
def test_calls(tmp_path, name, fault):
    table, failures = campaign(SCENARIOS[name](tmp_path), [fault], MOST.get(name, EVERY))
    if not table:
        pytest.skip("no call that it befalls")
    print("\n" + printed(name, table))
    assert not failures, "\n".join(failures)


@pytest.mark.parametrize("name", [n for n in SCENARIOS if "ranks" not in n])
def test_memory(tmp_path, name):
    scenario, outcomes, failures = SCENARIOS[name](tmp_path), collections.Counter(), []
    for n in numbers(scenario.requests(), 40 if "jobs" in name else 400):
        try:
            outcomes[scenario.starve(n)] += 1
        except (AssertionError, OSError, KeyError) as e:
            outcomes["FAILED"] += 1
            failures.append(f"request {n}: {e}")
    print(f"\n{name}: no memory", dict(outcomes))
    assert not failures, "\n".join(failures)
