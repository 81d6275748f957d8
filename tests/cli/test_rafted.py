# SPDX-License-Identifier: MIT
"""Where floes lie over each other, as pictures show it: against areas worked out by hand, and against the run's own
number."""

import matplotlib
import numpy as np
import pytest

from harness import TOW, changed, placed, run

matplotlib.use("Agg")
from bergtow.plot import field as plot_field  # noqa: E402
from bergtow.result import overlaps as rafted  # noqa: E402
from bergtow.result.run import Run as Reader  # noqa: E402

pytestmark = pytest.mark.usefixtures("look")
SQUARE = np.array([[0, 0], [2, 0], [2, 2], [0, 2]], float)
PRESSED = changed(TOW, domain={"length": 15, "width": 8, "ends_closing": 0.15}, ice__concentration=0.75,
                  ice__rafting={"kappa": 5}, run__duration=15)


def area_of(p):
    return rafted.areas(p[None], np.array([len(p)]))[0]


@pytest.mark.parametrize("shift, area", [((1, 0.5), 1.5), ((3, 0), 0), ((0, 0), 4), ((-1.5, -1.5), 0.25)])
def test_two_squares(shift, area):
    found = rafted.overlaps([SQUARE, SQUARE + shift])
    assert len(found) == (area > 0) and np.isclose(sum(map(area_of, found)), area, atol=1e-12)


def polygons(n, seed):
    """Convex outlines [n, 6, 2] of 3 to 6 corners, some clockwise, the last corner repeated."""
    rng, out = np.random.default_rng(seed), []
    for _ in range(n):
        corners = int(rng.integers(3, 7))
        angle = np.sort(rng.uniform(0, 2 * np.pi, corners))[::rng.choice([-1, 1])]
        p = rng.uniform(0, 8, 2) + rng.uniform(0.3, 1.5) * np.column_stack([np.cos(angle), np.sin(angle)])
        out.append([*p, *[p[-1]] * (6 - corners)])
    return np.array(out)


def test_many_at_a_time_are_what_shapely_finds(monkeypatch):
    """Pairs in several batches, far from the origin, of all numbers of corners and both directions."""
    shapely = pytest.importorskip("shapely.geometry")
    monkeypatch.setattr(rafted, "BATCH", 700)
    some = polygons(300, 5) + [3e5, -2e5]
    shapes = [shapely.Polygon(p) for p in some]
    areas = [a.intersection(b).area for k, a in enumerate(shapes) for b in shapes[k + 1:]
             if a.intersection(b).area > rafted.LEAST * min(a.area, b.area)]
    found = [area_of(p) for p in rafted.overlaps(some)]
    assert len(areas) > 1000 and np.allclose(found, areas, rtol=1e-6, atol=1e-8)


def test_floes_that_only_touch_are_left_out():
    assert rafted.overlaps([SQUARE, SQUARE + [2, 0], SQUARE + [0, 1.9999]]) == []


def test_a_run(tmp_path):
    """The areas drawn add up to the area in the series (which is that at the start of the last step), and the picture
    has them."""
    r = run(tmp_path, PRESSED)
    assert r.summary["rafted_area_m2"] > 0.3
    o, v, pose = r.dataset("/floes/offsets"), r.dataset("/floes/vertices"), r.dataset("/frames/pose")[-1]
    outlines = [placed(v[o[i]:o[i + 1]], pose[i]) for i in range(len(pose))]
    longest = max(map(len, outlines))  # others are filled up, as in Run.polygon_array
    found = rafted.overlaps([[*p, *[p[-1]] * (longest - len(p))] for p in outlines])
    total = sum(map(area_of, found))
    assert np.isclose(total, r.summary["rafted_area_m2"], rtol=0.05), (total, r.summary["rafted_area_m2"])
    with Reader(r.dir) as reader:
        figure = plot_field.draw(reader)
    drawn = [c for axes in figure.axes for c in axes.collections if len(c.get_paths()) == len(found) and len(found)]
    assert drawn
