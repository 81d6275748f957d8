# SPDX-License-Identifier: MIT
"""The program `bergtow`, which starts runs as separate processes, on several ranks, and runs ensembles."""
from __future__ import annotations

import os
import shutil
from pathlib import Path

from . import _library
from .errors import IO, BergtowError


def _compiled(path: Path) -> bool:
    """Is this the compiled program, not the command of the same name that pip installs?"""
    if not (path.is_file() and os.access(path, os.X_OK)):
        return False
    with open(path, "rb") as file:
        return file.read(4) == b"\x7fELF"


def _places() -> list[Path]:
    """Beside the library in use; beside this package, in the source tree or PREFIX/share/bergtow/postproc; on PATH."""
    here = Path(__file__).resolve().parents
    try:
        library = Path(_library.library_path()).resolve().parent  # build/release, or PREFIX/lib
        found = [library / "bergtow", library.parent / "bin/bergtow"]
    except BergtowError:
        found = []
    found += [here[2] / "build/release/bergtow"] + ([here[4] / "bin/bergtow"] if len(here) > 4 else [])
    return found + [Path(folder) / "bergtow" for folder in os.get_exec_path()]


def program_path() -> str:
    """Path of the program: BERGTOW, or the first one found. Raises BergtowError."""
    named = os.environ.get("BERGTOW")
    if named:
        found = shutil.which(named)
        if not found:
            raise BergtowError(f"{named}: is not a program; name bergtow by its whole path in BERGTOW", IO)
        return found
    for path in _places():
        if _compiled(path):
            return str(path)
    raise BergtowError("the program bergtow, which makes the runs, is not beside libbergtow and not in PATH; build it "
                       "with `make`, install it with `make install`, or name its file in BERGTOW", IO)
