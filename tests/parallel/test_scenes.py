# SPDX-License-Identifier: MIT
"""Scenes with every mode and option leave what is stored of them, bit for bit, and the same in another layout.

The digests in scenes.json hold for every libm, compiler and processor, so that they are one more proof of that.
`tests/scenes.py --compare OLD_BINARY` shows what has moved. What is new in the output, a series or a key of the
summary, must be recorded, too: else nothing would hold one layout against another in it.
"""
import json
import subprocess

import pytest

import scenes
from harness import BERGTOW, DONE

RECORDED_WITH, STORED = scenes.stored()

# Keys that no scene sets, and why.
LEFT_OUT = {"run.threads": "said by the layout", "output.progress": "what is printed while a run is on", }


def both():
    """The layouts of each scene. What both must leave is stored, so that make test has one of them."""
    for n, name in enumerate(scenes.SCENES):
        for k, layout in enumerate(scenes.layouts_of(name)):
            alone = all(ranks == 1 for ranks, _ in layout)
            yield pytest.param(name, k, marks=[m for m, holds in ((pytest.mark.one_rank, alone),
                                                                  (pytest.mark.slow, (n + k) % 2 == 0)) if holds])


@pytest.mark.parametrize("name, layout", both())
def test_scene_is_what_it_was(tmp_path, name, layout):
    items = scenes.run_scene(tmp_path, name, scenes.layouts_of(name)[layout])
    assert name in STORED, f"nothing stored: tests/scenes.py --record {name}"
    gone, new, moved = scenes.departed(name, items)
    assert (gone, new, moved) == ([], [], []), (f"gone: {gone}\nnew: {new}\nchanged: {moved}\n"
                                                "tests/scenes.py --compare shows how, --record takes it over")


@pytest.mark.one_rank
def test_what_is_stored_is_of_these_scenes():
    """Each by itself: two scenes that leave the same would be one, with a key that has no effect."""
    assert sorted(STORED) == sorted(scenes.SCENES)
    same = {}
    for name, found in STORED.items():
        same.setdefault(tuple(sorted(found.items())), []).append(name)
    assert [names for names in same.values() if len(names) > 1] == []


def settings(section, prefix=""):
    for key, value in section.items():
        if isinstance(value, dict):
            yield from settings(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def unused(keys, sections):
    """Keys that none of the sections sets away from the default, and values of choices that none sets."""
    used = {}
    for section in sections:
        for key, value in settings(section):
            used.setdefault(key, set()).add(str(value).lower())
    for key in keys:
        have = used.get(key["name"], set())
        if key["type"] == "choice":
            yield from (f"{key['name']}: {c}" for c in key["choices"] if c not in have | {key["default"]})
        elif not have - {key["default"]}:
            yield key["name"]


@pytest.mark.one_rank
def test_the_scenes_use_every_key():
    """Every key away from its default, and every value of a choice; those of floes by hand, too."""
    p = subprocess.run([BERGTOW, "--list-keys", "--json"], capture_output=True, text=True)
    assert p.returncode == DONE
    listed, cases = json.loads(p.stdout), scenes.SCENES.values()
    assert set(unused(listed["keys"], cases)) == set(LEFT_OUT)
    assert list(unused(listed["floe_keys"], [floe for case in cases for floe in case.get("floes", ())])) == []


@pytest.mark.one_rank
def test_the_scenes_use_every_layout():
    pairs = {scenes.layouts_of(name) for name in scenes.SCENES}
    assert all(first != second for first, second in pairs)
    assert {first for first, _ in pairs} == {second for _, second in pairs} == set(scenes.LAYOUTS)
