# SPDX-License-Identifier: MIT
"""What converge, budget and capability left."""
import json
from pathlib import Path


def read(name, place):
    """The result of a command in a folder, or in a file of another name; None if there is none, or it cannot be
    read."""
    path = Path(place)
    try:
        return json.loads((path if path.is_file() else path / f"{name}.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
