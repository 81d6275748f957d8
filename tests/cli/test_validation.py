# SPDX-License-Identifier: MIT
"""cases/validation on small pieces of ice: each script measures what its page says, in form; its sums on made-up
numbers whose answer is known; every value of a case file says where it is from."""
import argparse
import json
import os
import pickle
import re
import sys

import numpy as np
import pytest

from harness import BERGTOW, CASE, DONE, ROOT, call, changed, run

FOLDER = ROOT / "cases/validation"
sys.path.insert(0, str(FOLDER))

import arching  # noqa: E402
import barrier  # noqa: E402
import nrc_outlines  # noqa: E402
import points  # noqa: E402
import runs  # noqa: E402
import ship  # noqa: E402

NAMES = ("arching", "barrier", "ship")
PAGE = (FOLDER / "README.md").read_text()


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Runs of a case, each once."""
    folder, kept = tmp_path_factory.mktemp("validation"), {}

    def of(case, measure, **values):
        name = json.dumps((case, values), sort_keys=True)
        if name not in kept:
            a = argparse.Namespace(case=FOLDER / f"{case}.yml", out=folder, set=[], threads=1, bergtow=BERGTOW)
            kept[name] = measure(runs.run(a, str(len(kept)), **values))
        return kept[name]
    return of


# --- pages and case files --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_every_value_says_where_it_is_from(name):
    """Every number is reported, assumed or set by the script, but for the seed, places, and the time between frames."""
    plain = {"seed", "x", "y", "x_min", "frame_interval"}
    marked = 0
    for line in (FOLDER / f"{name}.yml").read_text().splitlines():
        match = re.match(r" +(\w+): \d", line)
        if match and match[1] not in plain:
            assert re.search(rf"# (assumed|reported)\b|{name}\.py sets it", line), line
            marked += 1
    assert marked > 8


@pytest.mark.parametrize("heading", ["Arching", "Ice cover", "Ship"])
def test_a_section_has_all_it_needs(heading):
    section = re.search(rf"^## {heading}.*?\n(.*?)(?=^## |\Z)", PAGE, re.S | re.M)[1]
    for word in ("Source", "Set-up", "Assumed", "Expected", "Found", "Verdict"):
        assert f"**{word}" in section, word
    pictures = re.findall(r"!\[[^]]*\]\((.*?)\)", section)
    assert pictures and all((FOLDER / p).stat().st_size > 10_000 for p in pictures)


def test_what_nobody_measured_is_called_a_prediction():
    section = re.search(r"^## Ship.*?\n(.*)", PAGE, re.S | re.M)[0]
    assert "prediction" in section.splitlines()[0] and "measured force is not known here" in section
    text = (FOLDER / "ship.yml").read_text()
    assert not re.search(r"^reference:", text, re.M) and "PREDICTION" in text


def test_a_measured_force_gets_its_ratio(tmp_path):
    """The key that ship.yml names takes the force of somebody who has it."""
    made_up = tmp_path / "ship.yml"
    made_up.write_text((FOLDER / "ship.yml").read_text() + '\nreference: {mean_force: 2 N, source: "made up"}\n')
    r = run(tmp_path, made_up, "--threads", 1, "--quiet", "--steps", 300, "--set", "output.window_start=10")
    assert "made up" in json.dumps(r.summary["reference"])
    ratio = next(v for k, v in r.summary["reference"].items() if "ratio" in k or "over" in k)
    assert ratio == pytest.approx(r.summary["mean_ice_resistance_n"] / 2)


def test_every_run_of_the_scripts_is_one_that_check_takes(tmp_path):
    """Red: a key that has no effect on the ice of a part stops a study after an hour (seen: its concentration)."""
    todo = [("arching", values) for part in arching.PARTS for _, _, values in arching.prepared(tmp_path, part, 1)]
    todo += [("barrier", values) for _, _, values in barrier.jobs(1)]
    todo += [("ship", values) for _, _, values in ship.jobs(1)]
    assert len(todo) > 80
    for name, values in todo:
        sets = [word for key, value in values.items() for word in ("--set", f"{key.replace('__', '.')}={value}")]
        result = call("check", FOLDER / f"{name}.yml", *sets)
        assert result.returncode == DONE, (name, values, result.stderr)


# --- arching ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_small_blocks_do_not_arch(done, seed):
    """Block/gap 0.05, with twice the ice that the gap lets through."""
    found = done("arching", arching.flow, **arching.keys(0.05, way=16, seed=seed))
    late = np.array(found["passed"][8:])
    assert not found["arrest"] and not found["unconverged_steps"] and found["undisturbed"]
    assert late.min() > 0, "blocks pass all the time"
    arriving = 0.5 * 2 / 0.05  # concentration, channel of two gaps, each 20 blocks: blocks a block of way
    assert late.mean() < 0.8 * arriving, "more arrives than passes"


@pytest.mark.slow
def test_large_blocks_arch(done):
    found = [done("arching", arching.flow, **arching.keys(0.25, 0.4, way=40, seed=seed)) for seed in (1, 2, 3)]
    assert sum(f["arrest"] for f in found) >= 2
    assert all(f["after"] > 0 and f["passed"][0] == 0 for f in found if f["arrest"])


@pytest.mark.slow
def test_the_speed_is_a_scale(done):
    """Rigid contacts and quadratic drag: twice the speed with half the time step is the same motion, four times the
    force."""
    slow, fast = (done("arching", lambda f: (arching.flow(f), json.loads((f / "summary.json").read_text())),
                       **arching.keys(0.25, way=30, speed=v)) for v in (0.1, 0.2))
    assert slow[0]["passed"] == fast[0]["passed"] and sum(slow[0]["passed"]) > 5
    for key in ("peak_ice_resistance_n", "mean_tow_force_n"):
        assert fast[1][key] == pytest.approx(4 * slow[1][key], rel=1e-9)


def test_two_sizes_have_equal_areas_and_do_not_overlap(tmp_path):
    path = tmp_path / "two.geojson"
    arching.two_sizes(path, 4.0, 1.0, 0.4, 3)
    rings = [np.array(f["geometry"]["coordinates"][0][:4]) for f in json.loads(path.read_text())["features"]]
    sides = np.array([np.hypot(*(r[1] - r[0])) for r in rings])
    large = np.isclose(sides, arching.BLOCK)
    assert np.isclose(sides[~large], arching.BLOCK / 2).all() and (~large).sum() == 4 * large.sum() > 200
    begin = arching.START + 3 * arching.BLOCK
    assert (sides**2).sum() == pytest.approx(0.4 * (4.0 - begin), rel=0.01)
    case = changed(arching_case(), ice__outlines=str(path), ice__outlines_crs="frame")
    (tmp_path / "case.yml").write_text(json.dumps(case))
    result = call("field", tmp_path / "case.yml", "-o", tmp_path / "field.h5")
    assert result.returncode == DONE, result.stderr  # overlapping outlines are refused
    rings[1] = rings[0] + 0.01
    features = [{"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates":
                 [[*r.tolist(), r[0].tolist()]]}} for r in rings]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    assert call("field", tmp_path / "case.yml", "-o", tmp_path / "field.h5").returncode == CASE


def arching_case():
    return {
        "run": {"dt": 0.1, "duration": 1}, "domain": {"length": 4, "width": 1, "sides": "periodic"},
        "ice": {"friction": 0.2}, "tow": {"speed": 0.1},
        "body": {"shape": "rectangle", "length": 0.1, "width": 0.5, "x": 0.3, "draft": 0.02},
    }


def test_the_critical_concentration_is_found_again():
    """Fields that arch with the probability of a known law."""
    rng, a, b, n = np.random.default_rng(5), 0.035, 6.0, 1.5
    rows = []
    for ratio in (0.1, 0.15, 0.2, 0.25):
        for c in (0.2, 0.3, 0.4, 0.5, 0.6):
            p = 1 / (1 + np.exp(-b * np.log(c / (a * ratio**-n))))
            arrests = [{"arrest": bool(v)} for v in rng.random(400) < p]
            rows.append({"ratio": ratio, "concentration": c, "runs": arrests})
    q = np.array(arching.critical(rows))
    assert q[2] / q[1] == pytest.approx(n, rel=0.06) and q[1] == pytest.approx(b, rel=0.1)
    for ratio in (0.1, 0.25):
        assert arching.at_half(q, ratio) == pytest.approx(a * ratio**-n, rel=0.05)


def test_wilson():
    """Newcombe 1998, table I: 81 of 263, 15 of 148, 0 of 20, 1 of 29."""
    for k, n, low, high in ((81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0, 0.1611),
                            (1, 29, 0.0061, 0.1718)):
        assert points.wilson(k, n) == pytest.approx((low, high), abs=2e-4)


# --- cover -----------------------------------------------------------------------------------------------------------


def test_the_length_scale_of_made_up_loads_is_found_again(monkeypatch):
    monkeypatch.setattr(barrier, "DRAWS", 10)
    rows = [{"kappa": 0, "width": w, "friction": mu, "lengths": n, "length": n * w, "drag": 3.0 * w * n * w,
             "force": 3.0 * w * (w / (0.4 * mu)) * (1 - np.exp(-n * w / (w / (0.4 * mu))))}
            for w, mu in barrier.CHANNELS for n in (2, 4, 8)]
    found = barrier.fits(rows)
    for width, mu, scale, draws in found:
        assert scale == pytest.approx(width / (0.4 * mu), rel=1e-4) and draws == pytest.approx(scale, rel=1e-4)
    assert barrier.exponents(found)[0] == pytest.approx([1, -1], abs=1e-3)


@pytest.mark.slow
def test_walls_carry_part_of_the_cover(done):
    """In 2 m of width: without friction the barrier bears the whole drag; with it less, and the less the longer the
    cover; twice the friction halves the length scale."""
    free = done("barrier", barrier.load, **barrier.keys(2.0, 0, 4, 1))
    assert free["force"] == pytest.approx(free["drag"], rel=0.01)
    scales = {}
    for mu in (0.3, 0.6):
        rows = [{**done("barrier", barrier.load, **barrier.keys(2.0, mu, n, seed)), "lengths": n}
                for n in (4, 12) for seed in (1, 2)]
        share = [r["force"] / r["drag"] for r in rows]
        assert max(share[2:]) < min(share[:2]) < 1
        scales[mu] = barrier.fit(rows)
    assert 1.5 < scales[0.3] / scales[0.6] < 2.7
    assert 3 < scales[0.6] / 2.0 < 9, "in widths"


# --- ship ------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_band_rises_with_friction(done):
    def at(mu):
        return ship.point([done("ship", ship.resistance, ice__friction=mu, ice__seed=seed) for seed in (1, 2, 3)])

    low, high = at(0.05), at(0.35)
    assert 0.05 < low["mean"] < high["mean"] < 0.25 and not low["unconverged"] + high["unconverged"]
    assert low["slow"] < low["sd"], "averaging takes scatter away"
    assert low["least"] < low["mean"] < low["most"] and low["low"] < low["mean"] < low["high"]


# --- outlines of a pickle ---------------------------------------------------------------------------------------------

SQUARE = np.array([[1.0, 3.0], [2.0, 3.0], [2.0, 4.0], [1.0, 4.0]])


def floe(ring):
    """As the published file has it: arrays and numbers of numpy."""
    return {"vertices": ring, "centre": ring.mean(0), "radius": np.float64(0.7), "area": np.float64(1.0)}


class Runs:
    """What pickle.load would call."""

    def __init__(self, call):
        self.call = call

    def __reduce__(self):
        return self.call


def of_this_day(data):
    """numpy 2 names its functions otherwise; the published file has the names of numpy 1."""
    return data.replace(b"\x8c\x16numpy._core.multiarray", b"\x8c\x15numpy.core.multiarray")


def test_outlines_of_a_pickle_are_read_without_running_it(tmp_path, monkeypatch):
    data = of_this_day(pickle.dumps([floe(SQUARE), floe(SQUARE[:3] + 2)], protocol=4))
    for name in ("load", "loads", "Unpickler"):
        monkeypatch.delattr(pickle, name)
    first, second = nrc_outlines.read(data)
    assert np.array_equal(first["vertices"], SQUARE) and np.array_equal(second["vertices"], SQUARE[:3] + 2)
    assert first["area"] == 1.0 and isinstance(first["area"], float)
    (tmp_path / "floes.pkl").write_bytes(data)
    nrc_outlines.main([str(tmp_path / "floes.pkl"), str(tmp_path / "floes.geojson")])
    found = json.loads((tmp_path / "floes.geojson").read_text())["features"]
    ring = np.array(found[0]["geometry"]["coordinates"][0])
    # x along the strip, y across from the middle of 1 to 4 m, turned and not mirrored
    assert np.allclose(ring, [[3, 1.5], [3, 0.5], [4, 0.5], [4, 1.5], [3, 1.5]]) and len(found) == 2
    turned = np.roll(ring[:4], -1, 0)
    assert np.sum(ring[:4, 0] * turned[:, 1] - turned[:, 0] * ring[:4, 1]) > 0


@pytest.mark.parametrize("what", [
    [Runs((os.system, ("touch ran",)))], [Runs((eval, ("1",)))], [Runs((np.array, ([1.0],)))],
    [floe(SQUARE.astype(np.float32))], [floe(SQUARE.astype(object))], [{"vertices": np.array(["a", "b", "c"])}],
    [floe(np.asfortranarray(SQUARE))], [{"area": 1.0}], [floe(SQUARE[:2])], [floe(SQUARE * np.nan)], {"a": 1}, [], 7,
])
def test_a_pickle_of_anything_else_is_refused(what, tmp_path, monkeypatch, capsys):
    """Red: Unpickler.find_class left as it is runs the first."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "floes.pkl").write_bytes(of_this_day(pickle.dumps(what, protocol=4)))
    with pytest.raises(SystemExit) as ended:
        nrc_outlines.main(["floes.pkl", "floes.geojson"])
    said = capsys.readouterr().err
    assert ended.value.code == 4 and said.startswith("nrc_outlines.py: floes.pkl: ") and ";" in said
    assert not (tmp_path / "ran").exists() and not (tmp_path / "floes.geojson").exists()


def test_a_pickle_cut_or_changed_anywhere_is_refused_or_read():
    """No other error than Refused, whatever the bytes."""
    data = of_this_day(pickle.dumps([floe(SQUARE)], protocol=4))
    rng = np.random.default_rng(8)
    refused = 0
    for k in range(len(data)):
        for spoilt in (data[:k], data[:k] + bytes([rng.integers(256)]) + data[k + 1:]):
            try:
                nrc_outlines.outlines(nrc_outlines.read(spoilt))
            except nrc_outlines.Refused:
                refused += 1
    assert refused > len(data)


def test_the_runs_in_a_map_are_those_that_check_takes(tmp_path):
    rng = np.random.default_rng(4)
    rings = [SQUARE * 0.3 + [x, y] for x in range(1, 6) for y in range(3, 19) if rng.random() < 0.7]
    (tmp_path / "floes.pkl").write_bytes(of_this_day(pickle.dumps([floe(r) for r in rings], protocol=4)))
    a = argparse.Namespace(map=tmp_path / "floes.pkl", out=tmp_path / "out", fields=1, bergtow=BERGTOW)
    a.out.mkdir()
    todo = ship.jobs_of_map(a)
    assert len(todo) == 2 * 4 * len(ship.LANES) + 3 and len({name for _, name, _ in todo}) == len(todo)
    for name, values in [(name, values) for _, name, values in todo if "+0-f0.05" in name or "open" in name][:8] + [
            (name, values) for _, name, values in todo[-1:]]:
        sets = [word for key, value in values.items() for word in ("--set", f"{key.replace('__', '.')}={value}")]
        result = call("check", FOLDER / "ship.yml", *sets)
        assert result.returncode == DONE, (name, result.stderr)
