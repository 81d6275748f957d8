# SPDX-License-Identifier: MIT
"""Scenes with every mode and option leave what is stored of them, bit for bit, and the same in another layout.

The digests in scenes.json hold for one libm and one compiler. Where this machine has others, the comparison is between
two layouts alone, and a warning says so. `tests/scenes.py --compare OLD_BINARY` shows what has moved; after a change
that is meant to move results, `tests/scenes.py --record` renews the file.
"""
import json
import subprocess
import warnings

import pytest

import scenes
from harness import BERGTOW, DONE

STORED = json.loads(scenes.STORED.read_text())
OTHER_LAYOUT = [(2, 1, 0), (3, 1, 0), (1, 2, 11), (1, 2, 0)]


def stored(name):
    return {g: d for g, d in zip(STORED["items"], STORED["scenes"][name].split(" ")) if d != "-"}


@pytest.mark.parametrize("name", scenes.SCENES)
def test_scene_is_what_it_was(tmp_path, name):
    items = scenes.run_scene(tmp_path / "own", name, scenes.layout_of(name))
    if STORED["fingerprint"] == scenes.fingerprint():
        want, found = stored(name), scenes.digests(items)
        assert sorted(want.keys() - found.keys()) == [], "no longer there"
        assert sorted(g for g in want if want[g] != found[g]) == [], "changed; tests/scenes.py --compare shows how"
        return
    warnings.warn("scenes.json is of another libm or compiler: layouts are compared with each other alone")
    other = OTHER_LAYOUT[list(scenes.SCENES).index(name) % len(OTHER_LAYOUT)]
    again = scenes.run_scene(tmp_path / "other", name, other)
    assert sorted(k for k in items if items[k] != again.get(k)) == [], f"{scenes.layout_of(name)} and {other} differ"


def test_the_scenes_use_every_choice():
    """Each value of each key with a choice is the default of a scene or set by one; each layout is used."""
    listed = subprocess.run([BERGTOW, "--list-keys", "--json"], capture_output=True, text=True)
    assert listed.returncode == DONE
    used = {}

    def take(section, prefix):
        for key, value in section.items():
            if isinstance(value, dict):
                take(value, f"{prefix}{key}.")
            else:
                used.setdefault(prefix + key, set()).add(str(value).lower())

    for case in scenes.SCENES.values():
        take(case, "")
    missing = []
    for key in json.loads(listed.stdout)["keys"]:
        if key["type"] != "choice" or key["name"] == "ice.outlines_crs":  # of a file on the map: cli/test_map.py
            continue
        have = used.get(key["name"], set()) | {key["default"]}
        missing += [f"{key['name']}: {c}" for c in key["choices"] if c not in have]
    assert missing == []
    assert {scenes.layout_of(n) for n in scenes.SCENES} == set(scenes.LAYOUTS)
