# SPDX-License-Identifier: MIT
"""What `make demo` says beforehand, and that tests/roots.sh fails a demo that takes too much of the disk."""
import os
import subprocess

import pytest

from harness import BERGTOW, ROOT

STAND_INS = {
    "mmdebstrap": 'tar -cf "$4" -T /dev/null',
    "git": f"tar -c -C {ROOT} docs/tutorials",
    "unshare": 'test -z "$SAYS" || cat "$SAYS"/*.md',
    # megabytes of the root: before the demo, after it, after the tests
    "du": 'echo >>"$2.asked"; n=$(wc -l <"$2.asked"); set -- 100 $AFTER 2000; shift $((n - 1)); printf "$1\\troot\\n"',
}


def test_the_demo_says_how_long_it_takes():
    said = subprocess.run(["make", "-n", "demo"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert 0 < said.index("about a minute") < said.index("bergtow run cases/basin/basin-80.yml")


#: what Debian packages install that `make demo` does not ask for
LATER = ("scipy", "pandas", "xarray", "netCDF4", "shapely", "pyproj", "osgeo", "geopandas", "dask", "mpi4py", "pytest")


@pytest.mark.slow
def test_the_demo_needs_only_what_it_has_installed(tmp_path):
    """Its scripts, with the packages hidden that a newcomer does not have yet."""
    for name in LATER:
        (tmp_path / "hidden" / name).mkdir(parents=True)
        (tmp_path / "hidden" / name / "__init__.py").write_text(f"raise ImportError('{name} is hidden', name='{name}')")
    run = tmp_path / "run"
    case = ROOT / "cases/basin/basin-80.yml"
    subprocess.run([BERGTOW, "run", case, "-o", run, "--steps", "20", "--quiet"], check=True)
    said = subprocess.run(["make", "-n", "demo"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    scripts = [line.replace("out/demo", str(run)).split() for line in said.splitlines() if " postproc/" in line]
    assert len(scripts) >= 3
    for words in scripts:
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True,
                              env=os.environ | {"PYTHONPATH": str(tmp_path / "hidden")})
        assert done.returncode == 0, (words, done.stderr)
    assert (run / "report.html").exists()


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
