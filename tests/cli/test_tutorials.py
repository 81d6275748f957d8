# SPDX-License-Identifier: MIT
"""Every tutorial, from a clean copy of the sources, with nothing but its own words (tests/tutorial.py)."""
import json

import pytest

import tutorial

PAGES = [p.name for p in tutorial.pages()]


def summary(reader, name):
    return json.loads((reader.folder / "out" / name / "summary.json").read_text())


def first_tow(reader):
    for name in ("my-berg", "denser"):
        assert (reader.folder / "out" / name / "summary.json").exists()
    assert summary(reader, "my-berg")["n_floes"] == pytest.approx(749, abs=15)
    assert summary(reader, "denser")["mean_ice_resistance_n"] > summary(reader, "my-berg")["mean_ice_resistance_n"]
    assert (reader.folder / "out/my-berg/report.html").exists()


def map_to_design_force(reader):
    found = json.loads((reader.folder / "out/design/statistics.json").read_text())
    assert len(found["conditions"]) == 1
    assert (reader.folder / "out/design/report.html").exists()
    verdicts = [json.loads(p.read_text())["window"]["verdict"]
                for p in (reader.folder / "out/design/members").glob("*/summary.json")]
    assert sorted(verdicts) == ["not steady"] + 7 * ["steady"]  # as the page says


def ensemble_on_a_cluster(reader):
    assert all((reader.folder / f"task-{k}.txt").exists() for k in (1, 2, 3))


def force_law(reader):
    assert summary(reader, "python")["mean_wave_drift_force_n"] == pytest.approx(678.7e3, rel=1e-3)


def route(reader):
    found = json.loads((reader.folder / "out/way/route.json").read_text())
    assert found["verdict"]["members"] == 4 and len(found["routes"]) == 2
    assert (reader.folder / "out/way/route.html").exists() and (reader.folder / "out/way/routes.gpx").exists()


AFTER = {"1-first-tow.md": first_tow, "2-map-to-design-force.md": map_to_design_force,
         "3-ensemble-on-a-cluster.md": ensemble_on_a_cluster, "4-force-law.md": force_law,
         "5-route.md": route}


def test_all_are_followed():
    assert PAGES == sorted(AFTER)


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_tutorial(name, tmp_path):
    AFTER[name](tutorial.follow(name, tmp_path))
