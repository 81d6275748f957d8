# SPDX-License-Identifier: MIT
"""The files of a case as YAML: its own file and the files that it is based on. Only the program interprets them."""
import os

import yaml

from bergtow import _library
from bergtow.errors import CASE, RunError


def contents(path):
    """Read the file as YAML. Raises RunError."""
    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise RunError(path, f"cannot be read ({str(error).splitlines()[0]})", "name a case or a study file",
                       4 if isinstance(error, OSError) else CASE) from None
    if not isinstance(found, dict):
        raise RunError(path, "is neither a case nor a study", "name a case or a study file", CASE)
    return found


def files(path):
    """[(path, contents)] of a case and of the files that it is based on, the case first. Raises RunError."""
    found = [(path, contents(path))]
    while isinstance(found[-1][1].get("base"), str):
        path = path.parent / found[-1][1]["base"]
        if path.resolve() in [p.resolve() for p, _ in found]:
            raise RunError(path, "is based on itself", "remove one of the keys `base`")
        found.append((path, contents(path)))
    return found


def is_study(path):
    """Is this the file of a study, not of a case?"""
    return _library.library().bt_file_holds(os.fsencode(path)) == b"study"


def section(layers, name):
    """The keys of a section of a case, merged over all its files."""
    out = {}
    for _, found in reversed(layers):
        keys = found.get(name)
        out |= keys if isinstance(keys, dict) else {}
    return out


def says(case, section, key):
    """The value of a key in a case, {section: its keys}; None if it is absent."""
    return case.get(section, {}).get(key)
