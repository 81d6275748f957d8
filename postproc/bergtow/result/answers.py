# SPDX-License-Identifier: MIT
"""Results of converge, budget and capability."""
import json
from pathlib import Path


def read(name, place):
    """The result of a command in a folder, or in a file with another name; None if it does not exist or cannot be
    read."""
    path = Path(place)
    try:
        return json.loads((path if path.is_file() else path / f"{name}.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
