# SPDX-License-Identifier: MIT
"""Studies of ice that is read: what would make the same run several times is refused, or said."""
import json

import h5py
import pytest

from harness import CASE, DONE, TOW, call, changed, reading
from test_ensemble import ensemble, prepare

STUDY = {"base": "base.yml"}
LOOSE = changed(TOW, run__duration=30)  # floes of the outlines are met


def square(x, **properties):
    ring = [[x, 0], [x + 1, 0], [x + 1, 1], [x, 1], [x, 0]]
    return {"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": [ring]}}


@pytest.fixture
def folder(tmp_path):
    """Floes with a thickness of their own, and without, as outlines; a field."""
    for name, properties in (("own", {"thickness": 0.04}), ("open", {})):
        features = [square(x, **properties) for x in (4.5, 6, 7.5)]
        (tmp_path / f"{name}.json").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    prepare(tmp_path, STUDY, LOOSE)
    assert call("field", "base.yml", "-o", "field.h5", cwd=tmp_path).returncode == DONE
    return tmp_path


OUTLINES = changed(LOOSE, ice__outlines_crs="frame", ice__concentration=None, ice__size=None)
READ = {
    "outlines": changed(OUTLINES, ice__outlines="own.json"),
    "field": reading(LOOSE, "field.h5"),
    "open water": changed(LOOSE, ice__concentration=0),
}


def hashes(folder):
    with h5py.File(folder / "all/ensemble.h5") as f:
        return f["members/state_hash"].asstr()[:].tolist()


def both(folder):
    """`check` and `ensemble` say the same."""
    results = call("check", "study.yml", cwd=folder), ensemble(folder)
    assert results[0].returncode == results[1].returncode
    return results


@pytest.mark.parametrize("kind", READ)
def test_fields_of_ice_that_does_not_depend_on_the_seed_are_refused(folder, kind):
    prepare(folder, STUDY | {"repeats": 2, "parameters": {"tow.speed": [0.1, 0.12]}}, READ[kind])
    for result in both(folder):
        assert result.returncode == CASE
        assert "study.yml: repeats: no ice depends on the seed" in result.stderr
        assert "the 2 fields of a condition would be one run; set repeats: 1" in result.stderr
    assert not (folder / "all").exists()
    prepare(folder, STUDY | {"parameters": {"tow.speed": [0.1, 0.12]}}, READ[kind])
    assert ensemble(folder).returncode == DONE and len(set(hashes(folder))) == 2


def test_outlines_that_draw_their_thickness_are_other_ice_with_every_seed(folder):
    base = changed(OUTLINES, ice__outlines="open.json", ice__thickness_law="lognormal")
    prepare(folder, STUDY | {"repeats": 3}, base)
    assert ensemble(folder).returncode == DONE and len(set(hashes(folder))) == 3
    prepare(folder, STUDY | {"repeats": 3}, changed(base, ice__thickness_spread=0))
    assert ensemble(folder, "other").returncode == CASE


@pytest.mark.parametrize("kind, axis, key", [
    ("outlines", {"parameters": {"ice.concentration": [0.2, 0.9]}}, "ice.concentration"),
    ("field", {"parameters": {"ice.thickness": [0.2, 0.9]}}, "ice.thickness"),
    ("field", {"variants": {"a": {"ice.shape": "rectangles"}, "b": {"ice.friction": 0.1}}}, "ice.shape"),
])
def test_keys_of_how_ice_is_made_have_no_effect_on_ice_that_is_read(folder, kind, axis, key):
    prepare(folder, STUDY | axis, READ[kind])
    for result in both(folder):
        assert result.returncode == CASE and f"{key}: has no effect, as all ice is read from files" in result.stderr
        assert f"remove it from `{list(axis)[0]}`" in result.stderr
        assert "ice.friction: has no effect" not in result.stderr
    assert not (folder / "all").exists()


def test_what_has_an_effect_is_left_alone(folder):
    """Thickness of outlines that have none, and keys of ice that some conditions make; of the others it is said."""
    outlines = {"ice.outlines": "open.json", "ice.outlines_crs": "frame"}
    prepare(folder, STUDY | {"parameters": {"ice.thickness": [0.03, 0.05]}},
            changed(OUTLINES, ice__outlines="open.json"))
    assert ensemble(folder).returncode == DONE and len(set(hashes(folder))) == 2
    some = {"repeats": 2, "variants": {"made": {"ice.size": 0.8}, "map": outlines}}
    (folder / "study.yml").write_text(json.dumps(STUDY | some))
    prepare(folder, STUDY | some, LOOSE)
    assert "in 1 condition no ice depends on the seed" in call("check", "study.yml", cwd=folder).stdout
    result = ensemble(folder, "other")
    assert result.returncode == DONE and "warning: in 1 of 2 conditions no ice depends on the seed" in \
        result.stderr
    prepare(folder, STUDY | some | {"repeats": 1}, LOOSE)
    assert ensemble(folder, "third").stderr == ""
