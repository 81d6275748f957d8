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
PRESSED = changed(TOW,
                  domain={"length": 15, "width": 8, "ends_closing": 0.15},
                  ice__concentration=0.75,
                  ice__rafting={"kappa": 5},
                  run__duration=15)


@pytest.mark.parametrize("shift, area", [((1, 0.5), 1.5), ((3, 0), 0), ((0, 0), 4), ((-1.5, -1.5), 0.25)])
def test_two_squares(shift, area):
    both = rafted.intersection(SQUARE, SQUARE + shift)
    assert np.isclose(rafted.area(both), area, atol=1e-12)
    assert len(rafted.overlaps([SQUARE, SQUARE + shift])) == (area > 0)


def test_floes_that_only_touch_are_left_out():
    assert rafted.overlaps([SQUARE, SQUARE + [2, 0], SQUARE + [0, 1.9999]]) == []


def test_a_run(tmp_path):
    """The areas drawn add up to the area in the series (which is that at the start of the last step), and the picture
    has them."""
    r = run(tmp_path, PRESSED)
    assert r.summary["rafted_area_m2"] > 0.3
    o, v, pose = r.dataset("/floes/offsets"), r.dataset("/floes/vertices"), r.dataset("/frames/pose")[-1]
    found = rafted.overlaps([placed(v[o[i]:o[i + 1]], pose[i]) for i in range(len(pose))])
    total = sum(map(rafted.area, found))
    assert np.isclose(total, r.summary["rafted_area_m2"], rtol=0.05), (total, r.summary["rafted_area_m2"])
    with Reader(r.dir) as reader:
        figure = plot_field.draw(reader)
    drawn = [c for axes in figure.axes for c in axes.collections if len(c.get_paths()) == len(found) and len(found)]
    assert drawn
