# SPDX-License-Identifier: MIT
"""What `make demo` says beforehand, and that tests/roots.sh fails a demo that takes too much of the disk."""
import os
import subprocess

import pytest

from harness import ROOT

STAND_INS = {
    "mmdebstrap": 'tar -cf "$4" -T /dev/null',
    "git": "tar -c -T /dev/null",
    "unshare": "",
    # megabytes of the root: before the demo, after it, after the tests
    "du": 'echo >>"$2.asked"; n=$(wc -l <"$2.asked"); set -- 100 $AFTER 2000; shift $((n - 1)); printf "$1\\troot\\n"',
}


def test_the_demo_says_how_long_it_takes():
    said = subprocess.run(["make", "-n", "demo"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert 0 < said.index("about a minute") < said.index("bergtow run cases/basin/basin-80.yml")


@pytest.mark.parametrize("megabytes, verdict", [(900, "5 passed, 1 failed"), (901, "4 passed, 2 failed")])
def test_a_demo_that_takes_too_much_of_the_disk_has_failed(tmp_path, megabytes, verdict):
    """roots.sh with stand-ins for what makes a root, enters it and measures it."""
    for name, text in STAND_INS.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / name).chmod(0o755)
    env = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}", "AFTER": str(100 + megabytes)}
    done = subprocess.run([ROOT / "tests/roots.sh", tmp_path / "roots", "bookworm"], capture_output=True, text=True,
                          timeout=60, env=env)
    assert f"the demo has taken {megabytes} MB" in done.stdout, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == verdict and done.returncode == 1
    assert "tutorials: failed" in done.stdout  # the stand-ins print nothing of what the pages promise
    assert ("size of the demo: failed" in done.stdout) == (megabytes > 900)
