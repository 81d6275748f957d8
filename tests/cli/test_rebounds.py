# SPDX-License-Identifier: MIT
"""Rebounds with friction, many at once, give no energy: Newton's law alone would, and the coefficient is lowered where
it does (solve/solver.h)."""
import numpy as np
import pytest

from harness import changed, run
from scenes import REBOUNDS


@pytest.mark.parametrize("friction", [1.5, 0.8])
def test_no_energy_from_rebounds(tmp_path, friction):
    r = run(tmp_path, changed(REBOUNDS, ice__friction=friction))
    energy, work = r.series("kinetic_energy", "contact_work")
    assert friction < 1 or r.summary["restitution_cut_steps"] >= 1  # where it has to be lowered
    assert work.max() <= 1e-9 * energy[0], (work.max(), energy[0])
    assert (np.diff(energy) <= 1e-9 * energy[0]).all()
    assert energy[-1] > 0.2 * energy[0]  # and floes do rebound
