# SPDX-License-Identifier: MIT
"""The same bits on another processor: the C library told to leave out its faster variants, and a program that imports
none of its inexact functions. Other compilers and another architecture: tests/machines.sh."""
import json
import re
import subprocess

import pytest

from harness import BERGTOW, TOW, changed, environment, write_case

pytestmark = pytest.mark.one_rank

#: of glibc, chosen by the processor at the start
MASKED = "glibc.cpu.hwcaps=-AVX,-AVX2,-AVX512F,-FMA,-FMA4,-ERMS,-SSE4_1,-SSE4_2"
INEXACT = re.compile(
    r"^(sincos|a?sinh?|a?cosh?|a?tanh?|atan2|exp2?|expm1|log(2|10|1p)?|pow|hypot|cbrt|erfc?|[lt]gamma)f?l?$")

CASES = {
    "line": changed(TOW, run__duration=10, tow__mode="line", tow__line_length=2, tow__line_stiffness=5e3,
                    tow__line_damping=100),
    "sizes": changed(TOW, run__duration=10, ice__concentration=0.7, ice__size_law="lognormal", ice__size_spread=0.4,
                     ice__thickness_law="lognormal", ice__thickness_spread=0.3, ice__restitution=0.3,
                     ice__rafting={"kappa": 5}),
    "water": changed(TOW, run__duration=10, ice__shape="rectangles", ice__aspect=1.5, water__latitude="70 deg",
                     water__tide={"major": 0.05, "minor": 0.02, "period": "60 s"},
                     body__shape="ship", body__width=1)
}


def state_hash(folder, case, **env):
    write_case(folder, case)
    done = subprocess.run([BERGTOW, "run", "case.yml", "-o", "out", "--force", "--quiet"], cwd=folder,
                          env=environment(**env), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "out/summary.json").read_text())["state_hash"]


@pytest.mark.parametrize("name", CASES)
def test_a_processor_without_fused_multiply_add_gives_the_same_bits(tmp_path, name):
    plain = state_hash(tmp_path, CASES[name])
    assert plain == state_hash(tmp_path, CASES[name], GLIBC_TUNABLES=MASKED)


def test_the_program_imports_no_inexact_function():
    """One of them would bring the processor and the C library back into the bits."""
    listed = subprocess.run(["nm", "-D", "--undefined-only", BERGTOW], capture_output=True, text=True, check=True)
    names = [line.split()[-1].partition("@")[0] for line in listed.stdout.splitlines()]
    assert "frexp" in names or "sqrt" in names or "nearbyint" in names  # the list is one of names
    assert not [n for n in names if INEXACT.match(n)]
