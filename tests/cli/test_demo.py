# SPDX-License-Identifier: MIT
"""What `make demo` says beforehand and answers; that tests/roots.sh fails a demo that takes too much of the disk."""
import os
import re
import subprocess

import pytest

from harness import DONE, ROOT, call

STAND_INS = {
    "mmdebstrap": 'tar -cf "$4" -T /dev/null',
    "git": f"tar -c -C {ROOT} docs/tutorials",
    "unshare": 'test -z "$SAYS" || cat "$SAYS"/*.md',
    # megabytes of the root: before the demo, after it, after the tests
    "du": 'echo >>"$2.asked"; n=$(wc -l <"$2.asked"); set -- 100 $AFTER 2000; shift $((n - 1)); printf "$1\\troot\\n"',
}


def demo():
    """What `make demo` would do."""
    return subprocess.run(["make", "-n", "demo"], cwd=ROOT, capture_output=True, text=True, check=True).stdout


def test_the_demo_says_how_long_it_takes():
    said = demo()
    assert 0 < said.index("100 s on two cores") < said.index("bergtow ensemble cases/studies/demo.yml")


def test_nothing_speaks_against_the_demo_beforehand():
    """Red: basin-80.yml, whose walls are felt and whose ice has no largest load."""
    said = call("check", ROOT / "cases/studies/demo.yml").stdout
    assert "3 conditions x 5 fields" in said and "warning" not in said, said


#: what Debian packages install that `make demo` does not ask for
LATER = ("scipy", "pandas", "xarray", "netCDF4", "shapely", "pyproj", "osgeo", "geopandas", "dask", "mpi4py", "pytest")


@pytest.mark.slow
def test_the_demo_answers_with_what_it_has_installed(tmp_path):
    """The study in tows of minutes, its scripts with the packages hidden that a newcomer does not have yet. Red: means
    with intervals, which take scipy."""
    for name in LATER:
        (tmp_path / "hidden" / name).mkdir(parents=True)
        (tmp_path / "hidden" / name / "__init__.py").write_text(f"raise ImportError('{name} is hidden', name='{name}')")
    text = (ROOT / "cases/studies/demo.yml").read_text().replace("../fullscale", str(ROOT / "cases/fullscale"))
    for key, value in (("duration", "10 min"), ("length", "1 km"), ("width", "0.8 km"), ("window_start", "6 min"),
                       ("repeats", "2")):
        text = re.sub(rf"({key}: )[^,}}\n]*", rf"\g<1>{value}", text)
    (tmp_path / "study.yml").write_text(text)
    out = tmp_path / "out"
    done = call("ensemble", tmp_path / "study.yml", "-o", out)
    assert done.returncode == DONE, done.stderr
    scripts = [line.replace("out/demo", str(out)) for line in demo().splitlines()
               if re.match("build/release/bergtow (?!ensemble)", line)]
    assert len(scripts) == 2
    for line in scripts:
        done = subprocess.run(line, shell=True, cwd=ROOT, capture_output=True, text=True,
                              env=os.environ | {"PYTHONPATH": str(tmp_path / "hidden")})
        assert done.returncode == 0, (line, done.stderr)
    assert all((out / name).exists() for name in ("replay.html", "resistance.png"))
    answer = re.findall(r"^(\d+) % ice adds \S+ kN \(95 %: \S+ to \S+\), the mean of 2 tows", done.stdout, re.M)
    assert answer == ["20", "50", "80"] and "Without ice: open-water drag" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("megabytes, says, verdict", [(900, True, "6 passed, 0 failed"),
                                                      (901, True, "5 passed, 1 failed"),
                                                      (900, False, "5 passed, 1 failed")])
def test_a_large_demo_and_a_tutorial_that_does_not_hold_have_failed(tmp_path, megabytes, says, verdict):
    """roots.sh with stand-ins for what makes a root, enters it, where all is printed that the pages promise or nothing,
    and measures it."""
    for name, text in STAND_INS.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / name).chmod(0o755)
    env = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}", "AFTER": str(100 + megabytes),
                        "SAYS": str(ROOT / "docs/tutorials") if says else ""}
    done = subprocess.run([ROOT / "tests/roots.sh", tmp_path / "roots", "bookworm"], capture_output=True, text=True,
                          timeout=60, env=env)
    assert f"the demo has taken {megabytes} MB" in done.stdout, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == verdict and (done.returncode == 0) == verdict.endswith(" 0 failed")
    assert ("tutorials: failed" in done.stdout) == (not says)
    assert ("size of the demo: failed" in done.stdout) == (megabytes > 900)
