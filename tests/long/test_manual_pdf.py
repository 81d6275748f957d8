# SPDX-License-Identifier: MIT
"""The manual on paper, which takes Chromium a minute: all of it is there, and no link leads to this machine."""
import subprocess

from harness import BERGTOW, ROOT


def test_the_manual_as_pdf(tmp_path):
    done = subprocess.run(["/usr/bin/python3", str(ROOT / "docs/build.py"), BERGTOW, str(tmp_path)],
                          capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    pdf = tmp_path / "bergtow.pdf"
    text = subprocess.run(["pdftotext", "-layout", str(pdf), "-"], capture_output=True, text=True, check=True).stdout
    for words in ("Your first tow in ten minutes", "A new force law, in Python and in C", "Keys of a case",
                  "bt_simulation_create", "ice.rafting.kappa", "Gallery", "Contributing"):
        assert words in text, words
    said = subprocess.run(["pdfinfo", "-url", str(pdf)], capture_output=True, text=True, check=True).stdout
    assert "file:" not in said, said
