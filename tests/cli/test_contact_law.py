# SPDX-License-Identifier: MIT
"""A contact law from outside, in runs of the program it was added to: the fender of tests/examples/contact_law.c.

Physics by itself: tests/physics/test_contact_law.c. Here: the force on the tow, the balance, series and summary, the
moving window, ranks, threads, resume, the page.

Red with (tried): what pairs remember of added laws lost in a resume; their sums not reduced over ranks; the numbers
registered without the work.
"""
import json
import os
import re
import subprocess

import h5py
import numpy as np
import pytest
import yaml

import resuming
from harness import BERGTOW, CASE, DONE, ROOT, TOW, call, changed, differing, environment, launcher, script, write_case

EXTENDED = os.path.join(os.path.dirname(BERGTOW), "tests/examples/extended")
FENDER = {"load": "8 N", "stiffness": "300 N/m"}
SPEED = changed(TOW, run__duration=30, output__window_start=6, ice__concentration=0.6, fender=FENDER)
WINDOW = {
    "run": {"dt": 0.1, "duration": 8},
    "domain": {"frame": "geographic", "length": 24, "width": 18, "ends": "moving", "sides": "periodic", "ahead": 14},
    "ice": {"concentration": 0.6, "size": 1.2, "thickness": 0.04, "rafting": {"kappa": 10}},
    "body": {"length": 2, "draft": 0.5}, "tow": {"speed": 1.6, "ramp": 1},
    "fender": {"load": "2 N", "stiffness": "5 N/m"}
}


def started(*arguments, ranks=1, threads=1, cwd=None, code=DONE):
    line = [*(launcher(ranks) if ranks > 1 else []), EXTENDED, *map(str, arguments)]
    done = subprocess.run(line, cwd=cwd, env=environment(OMP_NUM_THREADS=threads), capture_output=True,
                          text=True, timeout=200)
    assert done.returncode == code, done.stderr
    return done


def of_run(folder, case, *more, **layout):
    write_case(folder, case)
    said = started("run", "case.yml", "-o", "out", *more, cwd=folder, **layout).stdout
    return folder / "out", json.loads((folder / "out/summary.json").read_text()), said


def series(folder, *names):
    with h5py.File(folder / "result.h5") as f:
        return [f[f"series/{name}"][()] for name in names]


def test_the_fender_softens_the_load_and_books_what_it_took(tmp_path):
    hard, without, _ = of_run(tmp_path / "hard", changed(SPEED, fender=None))
    soft, summary, said = of_run(tmp_path / "soft", SPEED)
    assert series(hard, "fender_work")[0].max() == 0 and summary["unconverged_steps"] == 0
    time, resistance, work, points, pressed, contacts = series(soft, "time", "ice_resistance", "fender_work",
                                                               "fender_points", "fender_pressed", "contacts_body")
    assert points.max() >= 1 and pressed.max() > 1e-4 and (work >= -1e-12).all() and work.sum() > 0
    # No point bears more than F0 + k d, d at most what all pairs together have.
    assert (resistance <= contacts * (8 + 300 * pressed.max()) + 1e-9).all()
    assert resistance.max() < series(hard, "ice_resistance")[0].max()
    tow, drag, coriolis, tilt, inertia = series(soft, "tow_force", "drag_force", "coriolis_force", "tilt_force",
                                                "inertia_force")
    np.testing.assert_allclose(tow, resistance + drag + coriolis + tilt + inertia,
                               atol=1e-9 * np.abs(tow).max())
    assert series(soft, "momentum_residual")[0].max() < 1e-9
    # registered by name, unit and reduction
    window = time >= summary["window"]["start_s"]
    assert summary["sum_fender_work_j"] == pytest.approx(work[window].sum(), rel=1e-12)
    assert summary["last_fender_pressed_m"] == pressed[-1]
    assert re.search(r"fender work +\S+ J", said)
    resolved = yaml.safe_load((soft / "case.resolved.yml").read_text())
    assert resolved["fender"] == {"load": "8 N", "stiffness": "300 N/m"}


LINE = changed(resuming.CASE, fender=FENDER, run__duration=9, output__checkpoint_steps=30)


@pytest.mark.parametrize("case, layouts", [(LINE, ((3, 2), )),
                                           pytest.param(LINE, ((1, 2), (3, 1)), marks=pytest.mark.slow),
                                           pytest.param(WINDOW, ((2, 2), ), marks=pytest.mark.slow)],
                         ids=["line", "line, more layouts", "window"])
@pytest.mark.ranks
def test_same_bits_in_every_layout_and_after_a_stop(tmp_path, case, layouts):
    case = changed(case, output__sample_every=3)
    whole, summary, _ = of_run(tmp_path / "whole", case)
    assert max(series(whole, "fender_pressed")[0]) > 0, "the fender is in use"
    for ranks, threads in layouts:
        folder, other, _ = of_run(tmp_path / f"{ranks}x{threads}", case, ranks=ranks, threads=threads)
        assert other["state_hash"] == summary["state_hash"]
        assert differing(whole / "result.h5", folder / "result.h5") == []
    folder, _, _ = of_run(tmp_path / "stopped", case, "--steps", 46)
    started("resume", "out", ranks=2, cwd=tmp_path / "stopped")
    assert json.loads((folder / "summary.json").read_text())["state_hash"] == summary["state_hash"]
    assert differing(whole / "result.h5", folder / "result.h5") == []


@pytest.mark.slow
def test_the_page_of_the_run_names_its_keys(tmp_path):
    folder, *_ = of_run(tmp_path, changed(SPEED, run__duration=12))
    done = script("report", folder)
    assert done.returncode == 0, done.stderr
    page = (folder / "report.html").read_text()
    assert "fender.load" in page


def test_without_the_law_its_section_is_unknown(tmp_path):
    refused = call("check", write_case(tmp_path, SPEED))
    assert refused.returncode == CASE and "fender" in refused.stderr


def test_the_page_of_docs_shows_the_code_that_is_tested():
    page = (ROOT / "docs/how-to-add-a-contact-law.md").read_text()
    code = re.findall(r"^```c\n(.*?)^```", page, re.S | re.M)[0]
    assert code == (ROOT / "tests/examples/contact_law.c").read_text()
