# SPDX-License-Identifier: MIT
"""A page as PDF, through headless Chromium.

WeasyPrint 57 (Debian 12) was tried on the same pages. It made the same number of pages, heads and page numbers in files
a tenth of the size. But it took four times as long, does not support variables in SVG (figures were black) and writes
no tags, which screen readers need. Chromium is needed for the tests anyway. Page numbers and running heads are boxes in
the page margin, which Chromium supports from version 131.
"""
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from bergtow import writing
from bergtow.errors import RunError

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
LEAST = 131
PATIENCE = 300  # s
INSTEAD = "or write a .html and print it from a browser"


def browser():
    """Path of a suitable Chromium. Raises RunError."""
    path = next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        raise RunError("chromium", "not installed, but bergtow needs it to make a PDF",
                       f"apt-get install chromium, {INSTEAD}")
    said = subprocess.run([path, "--version"], capture_output=True, text=True, timeout=PATIENCE).stdout
    version = re.search(r"(\d+)\.\d+", said)
    if not version or int(version[1]) < LEAST:
        raise RunError(path, f"is {said.strip() or 'of no known version'}; page numbers need {LEAST}",
                       f"install a newer one, {INSTEAD}")
    return path


def write(html, path, force):
    """Write the page as PDF. Raises RunError."""
    program = browser()
    with writing.written(path, force) as new, tempfile.TemporaryDirectory() as folder:
        page, made = Path(folder) / "page.html", Path(folder) / "page.pdf"
        page.write_text(html, encoding="utf-8")
        call = [program, "--headless=new", "--disable-gpu", "--disable-dev-shm-usage", "--disable-extensions",
                "--disable-background-networking", "--no-first-run", "--no-pdf-header-footer",
                f"--user-data-dir={folder}/profile", f"--print-to-pdf={made}", page.as_uri()]
        if os.geteuid() == 0:  # its sandbox does not run as root; the page is ours, and may not load anything
            call.insert(1, "--no-sandbox")
        try:
            done = subprocess.run(call, capture_output=True, text=True, timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            raise RunError(program, f"made no PDF in {PATIENCE} s", INSTEAD[3:]) from None
        if done.returncode or not made.exists():
            said = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
            raise RunError(program, f"made no PDF ({said})", INSTEAD[3:])
        # a comment after the end-of-file mark, which readers ignore
        new.write_bytes(made.read_bytes() + f"\n%{writing.MARK}\n".encode())
