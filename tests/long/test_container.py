# SPDX-License-Identifier: MIT
"""The container of install/Containerfile, built from a clone on a Debian made here, for the registries that serve one
may not be in reach; and what it does when it is run."""
import json
import os
import re
import shutil
import subprocess

import pytest
from harness import BERGTOW, ROOT

BASE = "docker.io/library/debian:12-slim"
SLIM = ["--dpkgopt=path-exclude=/usr/share/doc/*", "--dpkgopt=path-exclude=/usr/share/man/*"]
CASE = ["run", "basin-20.yml", "--steps", "50", "--quiet"]
SOMEONE = 1234


def told(*words, cwd=None):
    done = subprocess.run([str(w) for w in words], cwd=cwd, capture_output=True, text=True, timeout=3000)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-3000:]
    return done.stdout.strip()


@pytest.fixture(scope="module")
def buildah(tmp_path_factory):
    for tool in "buildah", "mmdebstrap":
        if not shutil.which(tool):
            pytest.skip(f"{tool} is missing: make deps-long")
    if os.geteuid():
        pytest.skip("buildah and mmdebstrap are called as root here")
    folder = tmp_path_factory.mktemp("container")
    # vfs and chroot: within a container, too, and on any file system
    own = ["buildah", "--root", folder / "storage", "--runroot", folder / "run", "--storage-driver", "vfs"]
    yield lambda *words, **more: told(*own, *words, **more)
    shutil.rmtree(folder)


@pytest.fixture(scope="module")
def container(buildah, tmp_path_factory):
    folder = tmp_path_factory.mktemp("tree")
    told("mmdebstrap", "--quiet", "--variant=minbase", "--skip=output/dev", *SLIM, "bookworm", folder / "debian.tar",
         "http://deb.debian.org/debian")
    base = buildah("from", "scratch")
    buildah("add", base, folder / "debian.tar", "/")
    buildah("commit", "--rm", base, BASE)
    told("git", "clone", "--quiet", ROOT, folder / "clone")
    buildah("bud", "--pull=never", "--isolation=chroot", "-f", "install/Containerfile", "-t", "bergtow", ".",
            cwd=folder / "clone")
    (folder / "debian.tar").unlink()
    made = buildah("from", "--pull=never", "localhost/bergtow")
    data = folder / "data"
    data.mkdir()
    shutil.copy(ROOT / "cases/basin/basin-20.yml", data)
    os.chown(data, SOMEONE, SOMEONE)

    def within(*words, user="0:0"):
        return buildah("run", "--isolation=chroot", "--user", user, "-v", f"{data}:/data", made, "--", *words)

    within.data, within.clone = data, folder / "clone"
    return within


def state(folder):
    return json.loads((folder / "summary.json").read_text())["state_hash"]


def test_the_program_knows_its_revision(container):
    revision = told("git", "describe", "--always", cwd=container.clone)
    assert f"({revision}," in container("bergtow", "--version")


def test_one_rank_two_ranks_and_another_user_have_the_state_of_this_machine(container, tmp_path):
    told(BERGTOW, *CASE, "-o", tmp_path / "here", cwd=container.data)
    someone = f"{SOMEONE}:{SOMEONE}"
    container("bergtow", *CASE, "-o", "alone", user=someone)
    container("mpirun", "--oversubscribe", "-n", 2, "bergtow", *CASE, "-o", "ranks", user=someone)
    container("mpirun", "--oversubscribe", "-n", 2, "bergtow", *CASE, "-o", "root")
    assert {state(container.data / name) for name in ("alone", "ranks", "root")} == {state(tmp_path / "here")}
    assert (container.data / "alone").stat().st_uid == SOMEONE


def test_a_failure_is_told(container):
    said = container("sh", "-c", "bergtow run none.yml 2>&1; echo code $?; bergtow nothing 2>&1; echo code $?")
    assert "none.yml: cannot be read" in said and said.split("code ")[1][0] == "4" and said.endswith("code 2")


def test_reports_and_statistics_have_what_they_need(container):
    container("bergtow", *CASE, "-o", "towed", user=f"{SOMEONE}:{SOMEONE}")
    container("bergtow", "report", "towed", user=f"{SOMEONE}:{SOMEONE}")
    assert (container.data / "towed/report.html").stat().st_size > 1e5
    # SciPy is unpacked, not installed, and loads its parts where they are first used: what these need must be there
    package = ROOT / "postproc"
    texts = {".".join(p.relative_to(package).with_suffix("").parts): p.read_text() for p in package.glob("*/*/*.py")}
    scripts = [name for name, text in texts.items() if re.search(r"^import scipy$", text, re.M)]
    parts = {f"scipy.{part}" for name in scripts for part in re.findall(r"\bscipy\.([a-z]+)\.", texts[name])}
    assert len(scripts) > 5 and len(parts) > 2, (scripts, parts)
    container("env", "PYTHONPATH=/usr/local/share/bergtow/postproc", "python3", "-c",
              f"import {', '.join([*scripts, *sorted(parts)])}")
