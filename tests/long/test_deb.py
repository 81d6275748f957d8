# SPDX-License-Identifier: MIT
"""`make deb` of the tree as it is committed, and what its packages do once they are unpacked: the program, its scripts,
its cases, the Python package."""
import os
import shutil
import subprocess

import pytest

from harness import ROOT


def called(*words, cwd=None, **env):
    own = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "BERGTOW_LIB")}
    done = subprocess.run([str(w) for w in words], cwd=cwd, capture_output=True, text=True, timeout=1200, env=own | env)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


@pytest.fixture(scope="module")
def packed():
    if not shutil.which("dh"):
        pytest.skip("debhelper is missing: make deps-long")
    called("make", "deb", cwd=ROOT)


@pytest.fixture(scope="module")
def usr(packed, tmp_path_factory):
    root = tmp_path_factory.mktemp("root")
    packages = [p for p in (ROOT / "build/deb").glob("*.deb") if "dbgsym" not in p.name]
    assert {p.name.split("_")[0] for p in packages} == {"bergtow", "libbergtow0", "libbergtow-dev", "python3-bergtow"}
    for package in packages:
        called("dpkg", "-x", package, root)
    return root / "usr"


@pytest.mark.skipif(not shutil.which("lintian"), reason="lintian is missing: make deps-long")
def test_lintian_has_no_error_and_no_warning(packed):
    called("lintian", "--allow-root", "--fail-on", "error,warning", *(ROOT / "build/deb").glob("*.changes"))


def test_the_program_its_cases_and_its_scripts(usr, tmp_path):
    program = usr / "bin/bergtow"
    assert called(program, "--version").startswith("bergtow ")
    cases = sorted((usr / "share/doc/bergtow/cases").rglob("*.yml"))
    basin = next(p for p in cases if p.name == "basin-50.yml")
    assert len(cases) > 20
    called(program, "run", basin, "-o", "ten", "--steps", 10, "--quiet", cwd=tmp_path)
    called(program, "run", basin, "-o", "run", "--set", "run.duration=10", "--set", "output.window_start=5", "--quiet",
           cwd=tmp_path)
    called(program, "report", "run", "-o", "run.html", cwd=tmp_path)
    assert (tmp_path / "run.html").stat().st_size > 1e5
    assert "CASE" in called(program, "design", "--help")
    called(program, "check", next(p for p in cases if p.name == "outlines.yml"))  # which names a file beside it


def test_python_finds_package_and_library(usr):
    code = ("import bergtow; print(bergtow._library.library_path(), "
            "bergtow.Case({'run': {'dt': 0.1, 'duration': 1}})['run.dt'])")
    library = next((usr / "lib").glob("*/libbergtow.so.0"))
    said = called("/usr/bin/python3", "-c", code, PYTHONPATH=str(usr / "lib/python3/dist-packages"),
                  LD_LIBRARY_PATH=str(library.parent), cwd="/")
    assert said.split() == ["libbergtow.so.0", "0.1"]
