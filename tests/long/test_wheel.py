# SPDX-License-Identifier: MIT
"""The wheel of postproc/ on a Debian made from scratch, with the libraries that docs/library.md names and nothing of
bergtow."""
import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from harness import ROOT, TOW, run, write_case

PAGE = (ROOT / "docs/library.md").read_text()


def told(*words, **more):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, timeout=3000, **more)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-3000:]
    return done.stdout.strip()


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """The root of a Debian with the packages that the page names, and the wheel in it."""
    if not shutil.which("mmdebstrap"):
        pytest.skip("mmdebstrap is missing: make deps-long")
    if os.geteuid():
        pytest.skip("mmdebstrap and chroot are called as root here")
    folder = tmp_path_factory.mktemp("bare")
    told("git", "clone", "--quiet", ROOT, folder / "clone")
    told(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-build-isolation", "--no-deps", "-w", folder,
         folder / "clone/postproc", env={k: v for k, v in os.environ.items() if k != "BERGTOW_LIB"})
    packages = re.search(r"apt-get install (.*libhdf5(?:.|\n)*?)\n```", PAGE)[1].replace("\\\n", "").split()
    root = folder / "root"
    told("mmdebstrap", "--quiet", "--variant=apt", "--skip=output/dev", "--include=" + ",".join(packages), "bookworm",
         root, "http://deb.debian.org/debian")
    wheel, = folder.glob("bergtow-*.whl")
    shutil.copy(wheel, root)
    within = lambda *words: told("chroot", root, *words)  # noqa: E731
    within("python3", "-m", "venv", "--system-site-packages", "/v")
    within("/v/bin/pip", "install", "--quiet", "--no-index", "--no-deps", f"/{wheel.name}")
    within.root, within.name = root, wheel.name
    yield within
    shutil.rmtree(folder)


def test_the_wheel_runs_a_case_in_one_line_and_the_program(bare, tmp_path):
    here = run(tmp_path, TOW, "--quiet")
    write_case(bare.root, TOW)
    state = bare("/v/bin/python", "-c",
                 "import bergtow; print(bergtow.run('/case.yml', '/out').summary['state_hash'])")
    assert state == here.hash
    assert "no MPI" in bare("/v/bin/bergtow", "--version")
    bare("/v/bin/bergtow", "run", "/case.yml", "-o", "/out2", "--quiet")
    assert json.loads((bare.root / "out2/summary.json").read_text())["state_hash"] == here.hash


def test_it_is_of_this_machine_and_of_any_python(bare):
    assert re.fullmatch(r"bergtow-[0-9.]+-py3-none-linux_\w+\.whl", bare.name)
