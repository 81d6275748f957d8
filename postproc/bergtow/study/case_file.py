# SPDX-License-Identifier: MIT
"""The files of a case as YAML: its own and those that it is based on. What they mean is for the program to say."""
import json
import subprocess

import yaml

from bergtow.errors import RunError

BAD_CASE = 3  # exit code of the program


def contents(path):
    """The file as YAML. Errors: RunError."""
    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise RunError(path, f"cannot be read ({str(error).splitlines()[0]})", "name a case or a study file",
                       4 if isinstance(error, OSError) else BAD_CASE) from None
    if not isinstance(found, dict):
        raise RunError(path, "is neither a case nor a study", "name a case or a study file", BAD_CASE)
    return found


def files(path):
    """[(path, contents)] of a case and of what it is based on, its own file first. Errors: RunError."""
    found = [(path, contents(path))]
    while isinstance(found[-1][1].get("base"), str):
        path = path.parent / found[-1][1]["base"]
        if path.resolve() in [p.resolve() for p, _ in found]:
            raise RunError(path, "is based on itself", "remove one of the keys `base`")
        found.append((path, contents(path)))
    return found


def is_study(binary, found):
    """Is this a study, and not a case with a base? As src/case/case_base.h has it."""
    if "base" not in found:
        return False
    table = json.loads(subprocess.run([str(binary), "--list-keys", "--json"], capture_output=True, text=True).stdout)
    sections = {key["name"].split(".")[0] for key in table["keys"]} - {"report"} | {"floes"}
    words = set(map(str, found)) - {"base", "report"}
    return bool(words & {key["name"] for key in table["study_keys"]}) or not any(
        word.split(".")[0] in sections for word in words)


def section(layers, name):
    """The keys of a section of a case, of all its files."""
    out = {}
    for _, found in reversed(layers):
        keys = found.get(name)
        out |= keys if isinstance(keys, dict) else {}
    return out


def says(case, section, key):
    """What a case, {section: its keys}, says of a key; None where it says nothing."""
    return case.get(section, {}).get(key)
