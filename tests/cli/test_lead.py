# SPDX-License-Identifier: MIT
"""The lead ahead of the body in a run: counted, felt by the body, the same however the field came to be."""
import json

import h5py
import numpy as np
import pytest

from harness import CASE, area, call, changed, placed, reading, run, warned, worst_overlap, write_case

# A body of 2 m in half-open ice of 0.8 m.
BASE = {
    "run": {"dt": 0.1, "duration": 25},
    "domain": {"length": 16, "width": 9},
    "ice": {"concentration": 0.5, "size": 0.8, "x_min": 4.5, "thickness_law": "lognormal"},
    "body": {"x": 2.5, "length": 2, "shape": "square"},
    "tow": {"speed": 0.2, "ramp": 2},
    "solver": {"max_sweeps": 200},
    "output": {"frame_interval": 10},
}
CHANNEL = {"mode": "channel", "width": 2.2}
MANAGED = {"mode": "managed", "width": 2.2, "floe_size": 0.35, "length": 8}


def floes(r):
    with h5py.File(r.dir / "result.h5") as f:
        v, o, pose, h = f["floes/vertices"][:], f["floes/offsets"][:], f["frames/pose"][0], f["floes/thickness"][:]
    return [placed(v[o[i]:o[i + 1]], p) for i, p in enumerate(pose)], h


def test_a_channel_as_wide_as_the_body_is_open_water(tmp_path):
    """Nothing is in the way of a square body in a channel wider than it, and only floes at its end could touch it."""
    plain = run(tmp_path, BASE, name="plain")
    r = run(tmp_path, changed(BASE, lead=CHANNEL), name="channel")
    assert plain.series("ice_resistance").max() > 5 and plain.summary["lead"] is None
    assert r.series("ice_resistance").max() == 0
    lead, (was, _), (now, _) = r.summary["lead"], floes(plain), floes(r)
    removed = [p for p in was if not any(np.array_equal(p, q) for q in now)]
    assert lead["mode"] == "channel" and lead["width_m"] == 2.2 and lead["pieces"] == 0
    assert lead["length_m"] == pytest.approx(0.2 * (25 - 1) + 2, rel=1e-12), "the length of the tow and the body"
    assert lead["floes_removed"] == len(removed) == len(was) - len(now) > 10
    assert lead["area_removed_m2"] == pytest.approx(sum(map(area, removed)), rel=1e-9)
    assert all(np.any(np.abs(p[:, 1]) < 1.1) or np.ptp(np.sign(p[:, 1])) == 2 for p in removed)
    ice = (16 - 4.5) * 9
    assert lead["concentration_before"] == pytest.approx(
        0.5, abs=0.004) and r.summary["concentration"] == lead["concentration_before"]
    assert lead["concentration_after"] == pytest.approx(sum(map(area, now)) / ice, rel=1e-9)
    assert f"{len(removed)} floes" in r.result.stdout and "removed; concentration" in r.result.stdout


def test_a_managed_lead_keeps_the_mass(tmp_path):
    plain = run(tmp_path, BASE, name="plain")
    r = run(tmp_path, changed(BASE, lead=MANAGED), name="managed")
    lead, (was, h_was), (now, h_now) = r.summary["lead"], floes(plain), floes(r)
    assert lead["mode"] == "managed" and lead["floes_cut"] > 10 and lead["pieces"] > 3 * lead["floes_cut"]
    assert lead["pieces"] - lead["floes_cut"] == len(now) - len(was)
    mass = [sum(area(p) * h for p, h in zip(*both)) for both in ((was, h_was), (now, h_now))]
    assert mass[1] == pytest.approx(mass[0], rel=1e-9)
    assert worst_overlap(now) < 0
    inside = [p for p in now if p[:, 0].min() < 10 and np.abs(p[:, 1]).min() < 1]
    assert max(map(area, inside)) <= np.pi / 4 * 0.35 ** 2 * (1 + 1e-9)
    assert lead["concentration_after"] == pytest.approx(lead["concentration_before"], rel=5e-3)
    assert "cut into" in r.result.stdout
    assert r.series("ice_resistance").mean() > 0
    assert r.summary["momentum_residual"] < 1e-10


def test_a_tow_in_a_channel_is_held_against_no_estimate(tmp_path):
    """They are of the ice as it was before its floes were removed. Red when the ratio is that of open water to them;
    pieces keep mass and concentration, and a ratio."""
    case = changed(BASE, lead=MANAGED, ice__thickness_law=None, run__duration=15, output__window_start=5)
    cut = run(tmp_path, case, name="cut")
    channel = run(tmp_path, changed(case, lead=changed(CHANNEL, length=2)), name="channel")
    momentum = [r.summary["estimates"]["marchenko_momentum"] for r in (cut, channel)]
    assert momentum[0]["force_n"] == pytest.approx(momentum[1]["force_n"], rel=0.05) and momentum[1]["valid"]
    assert [e["compares"] for e in momentum] == [True, False]
    assert momentum[0]["simulated_over_estimate"] > 0 and "none accounts for the channel" in channel.result.stdout
    assert "none accounts for the channel" not in cut.result.stdout


def test_a_field_that_is_read_gets_the_same_lead(tmp_path):
    """`bergtow field` writes the ice as it was before the lead, since the case that reads it opens the lead."""
    case = changed(BASE, lead=MANAGED, run__duration=2)
    made = run(tmp_path, case, name="made")
    assert call("field", tmp_path / "case.yml", "-o", tmp_path / "f.h5").returncode == 0
    read = run(tmp_path, reading(case, "f.h5"), name="read")
    assert made.hash == read.hash and made.summary["lead"] == read.summary["lead"]
    result = call("check", tmp_path / "case.yml")
    lead = made.summary["lead"]
    assert f"{lead['floes_cut']} floes" in result.stdout and f"cut into {lead['pieces']} pieces" in result.stdout
    again = run(tmp_path, made.dir / "case.resolved.yml", name="again")
    assert again.hash == made.hash


def test_a_field_says_that_its_lead_is_not_in_it(tmp_path):
    """A map of the ice of a case with a lead shows none; and its floes, none of which is a piece, are held against the
    size law as without a lead. Red when nothing is said."""
    sizes = dict(ice__size_law="power", ice__size_min=0.2, ice__size_max=5, ice__size=None, ice__size_spread=None,
                 ice__concentration=0.8)
    write_case(tmp_path, changed(BASE, lead=MANAGED, run__duration=2, **sizes))
    said = call("field", tmp_path / "case.yml", "-o", tmp_path / "f.h5").stdout
    assert "warning: lead.mode: managed: the file holds the ice without the lead" in said
    write_case(tmp_path, changed(BASE, run__duration=2, **sizes))
    without = call("field", tmp_path / "case.yml", "-o", tmp_path / "g.h5").stdout
    below = [line for line in without.splitlines() if "smaller than ice.size_min" in line]
    assert below and below[0] in said and "lead" not in without


def test_a_lead_beyond_the_front_of_a_moving_window_goes_round_it(tmp_path):
    """Ice that enters is as it was made: two laps in a channel, where the mother field behind the body had none."""
    case = changed(BASE, run__duration=150, domain={"length": 15, "width": 8, "ends": "moving", "sides": "periodic"},
                   body__x=None, ice={"concentration": 0.5, "size": 0.7}, lead={"mode": "channel", "width": 2.6})
    r = run(tmp_path, case, "--quiet")
    assert r.summary["moving_window"]["laps"] > 1.5 and r.summary["lead"]["length_m"] > 25
    assert r.series("ice_resistance").max() == 0


def test_a_lead_that_drifts_away_is_reported(tmp_path):
    case = changed(BASE, domain__sides="periodic", water={"current_y": 0.1}, lead=CHANNEL)
    path = write_case(tmp_path, case)
    text = "lead.width: the ice drifts by"
    assert text in call("check", path).stdout and warned(run(tmp_path, case, "--quiet"), text)
    assert text not in call("check", path, "--set", "water.current_y=0.02").stdout
    resting = changed(case, ice__start="rest", run__duration=40)
    assert text in call("check", write_case(tmp_path, resting)).stdout
    assert warned(run(tmp_path, resting, "--quiet", name="rest"), text)


def test_a_polygon_has_the_lead_of_the_shape_it_draws(tmp_path):
    """Its extent along the tow stands for body.length, which it does not have."""
    square = changed(BASE, lead=CHANNEL)
    drawn = changed(square, body__shape="polygon", body__length=None,
                    body__vertices=[[-1, -1], [1, -1], [1, 1], [-1, 1]])
    turned = changed(drawn, body__yaw=90, body__vertices=[[-1, -2], [1, -2], [1, 2], [-1, 2]])
    want = 0.2 * (25 - 1) + np.array([2, 2, 4])
    for k, case in enumerate((square, drawn, turned)):
        case = changed(case, tow__ramp=2)
        found = call("check", write_case(tmp_path, case)).stdout
        assert f"wide, {want[k]:.4g} m long" in found, found


BAD = {
    "nothing is towed": ({"tow": {"mode": "none"},
                          "lead": {"mode": "channel"}}, "lead.mode: a lead lies along the tow, but nothing is towed"),
    "no body": ({"body": {"shape": "none"}, "tow": {"mode": "none"},
                 "lead": {"mode": "channel"}}, "lead.mode: a lead lies along the tow"),
    "no piece size": ({"lead": {"mode": "managed"}},
                      "lead.floe_size: is 0 m and a managed lead needs the size of its pieces"),
    "no width": ({"lead": {"mode": "channel", "width": 0}}, "lead.width: is 0 m"),
    "no length": ({"lead": {"mode": "channel", "length": 0}}, "lead.length: is 0 m"),
    "tiny pieces": ({"lead": {"mode": "managed", "floe_size": 1e-5}}, "lead.floe_size: 1e-05 m makes up to"),
}


@pytest.mark.parametrize("kind", BAD)
def test_leads_that_are_refused(tmp_path, kind):
    changes, fragment = BAD[kind]
    path = write_case(tmp_path, BASE | changes)
    result = call("run", path, "-o", tmp_path / "out")
    assert result.returncode == CASE and fragment in result.stderr, result.stderr
    assert json.loads(path.read_text()) and "case.yml" in result.stderr


def test_pieces_beyond_the_end_of_a_moving_window_come_round(tmp_path):
    """They were refused as floes outside the domain: the lead goes to the front of the window, and a floe there reaches
    over it."""
    case = changed(BASE,
                   run__duration=2,
                   domain={"length": 15, "width": 8, "ends": "moving", "sides": "periodic"},
                   body__x=6,
                   body__shape=None,
                   ice={"concentration": 0.8, "size": 0.7},
                   lead={"mode": "managed", "floe_size": 0.4, "length": 9, "width": 3})
    r = run(tmp_path, case, "--quiet")
    x = r.dataset("/frames/pose")[0][:, 0]
    assert (x >= 0).all() and (x <= 15).all() and r.summary["lead"]["pieces"] > 0
