# SPDX-License-Identifier: MIT
"""Floes that split in whole runs: known answers of the law, what a split keeps, what is counted, and what files say."""
import xml.etree.ElementTree as ElementTree

import h5py
import numpy as np
import pytest
from shapely.geometry import Polygon

from harness import CASE, TOW, call, changed, run, write_case

TOUGHNESS, STRENGTH = 150e3, 300e3
DURATION = 1.0  # of a collision, s


def polygon(vertices, x=0.0, y=0.0, **more):
    return {"shape": "polygon", "vertices": [list(map(float, v)) for v in vertices], "x": x, "y": y, **more}


def square(side, x=0.0, **more):
    h = side / 2
    return polygon([[-h, -h], [h, -h], [h, h], [-h, h]], x, **more)


def wedge(side, half, x_tip, vx):
    """An isosceles triangle with its tip, of half angle `half`, at x_tip: its weight is that of a square of this
    side."""
    length = side / np.sqrt(np.tan(half))  # area length² tan(half) = side²
    y = length * np.tan(half)
    return polygon([[2 * length / 3, 0], [-length / 3, y], [-length / 3, -y]], x_tip - 2 * length / 3, vx=vx,
                   vy=0.0)


def collision(floes, **keys):
    """Floes by hand that collide in the first step, without drag. Crushing as good as rigid, done within a step: what
    is pressed in opens a floe. Pieces do not split again."""
    return changed({
        "run": {"dt": 1.0, "duration": 2.0},
        "domain": {"length": 1200, "width": 900},
        "ice": {"concentration": 0, "thickness": 1.0, "friction": 0.1, "restitution": 0.0,
                "drag": {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0},
                "crushing": {"pressure": 1e9}, "splitting": {"toughness": TOUGHNESS, "generations": 1}},
        "body": {"shape": "none"},
        "impact": {"conversion": "duration", "duration": DURATION},
        "output": {"frame_interval": 1.0},
        "floes": floes}, **keys)


def strength(length, c):
    """Of a section, with its size effect, Pa."""
    return STRENGTH / np.sqrt(1 + length / (c * TOUGHNESS / STRENGTH)**2)


def wedge_force(side, half, mu=0.1):
    """Thrust of a wedge that splits a free square of 1 m, N: the pair opens its near end, the thrust closes it."""
    r = 2 * (np.tan(half) + mu) / (1 - mu * np.tan(half))
    return strength(side, 0.75) * side / (4 / r - 0.75)


def speed_for(force, side, density=910.0):
    """Speed at which two floes of equal mass collide with this peak of a half-sine, m/s."""
    return force * DURATION / (np.pi / 2) / (density * side**2 / 2)


def read(folder):
    with h5py.File(folder / "result.h5") as f:
        return {name: data[()] for group in ("splits", "pieces") for name, data in f[group].items()}


def hit(tmp_path, side, half, share, **keys):
    """A wedge at a share of the speed that splits a square: the run, and its splits."""
    x, gap = 600.0, 1e-9
    v = share * speed_for(wedge_force(side, half), side)
    r = run(tmp_path, collision([square(side, x + side / 2), wedge(side, half, x - gap, v)], **keys))
    return r, read(r.dir)


@pytest.mark.parametrize("side", [10.0, 30.0, 100.0])
@pytest.mark.parametrize("half", np.radians([30.0, 45.0]))
def test_a_wedge_splits_a_free_square_at_its_load(tmp_path, side, half):
    """Both sides of the closed form, with the exponent of the size effect in it."""
    assert len(hit(tmp_path / "below", side, half, 0.99)[1]["parent"]) == 0
    r, made = hit(tmp_path / "above", side, half, 1.01)
    assert made["parent"].tolist() == [0] and made["mode"].tolist() == [1] and made["generation"].tolist() == [1]
    assert made["ratio"][0] == pytest.approx(1.01, rel=2e-3)
    np.testing.assert_allclose(made["area"], side**2 / 2, rtol=1e-9)  # through the middle
    np.testing.assert_allclose(made["crack"][0], [600, 0, 600 + side, 0], atol=1e-4 * side)
    s = r.summary["splitting"]
    assert s["splits"] == s["near"] == 1 and s["steps"] == 1
    assert s["crack_length_m"] == pytest.approx(side, rel=1e-9)
    assert s["fracture_work_j"] == pytest.approx(TOUGHNESS**2 * (1 - 0.3**2) / 5e9 * side, rel=1e-9)


def test_what_a_blunt_corner_or_a_face_does(tmp_path):
    """The thrust of a wedge of more than 60 degrees closes the crack, and a face spreads the load over the side."""
    side = 30.0
    v = 2 * speed_for(wedge_force(side, np.radians(45)), side)
    blunt = run(tmp_path / "blunt", collision([square(side, 615.0), wedge(side, np.radians(66), 600.0, 0.5 * v)]))
    face = run(tmp_path / "face", collision([square(side, 615.0), square(side, 585.0, vx=2 * v, vy=0.0)]))
    assert blunt.summary["splitting"]["near"] == 0
    assert face.summary["splitting"]["splits"] == 0


def test_a_vertex_that_cannot_go_in_opens_nothing(tmp_path):
    assert len(hit(tmp_path, 30.0, np.radians(30), 1.5, ice__crushing={})[1]["parent"]) == 0


def squeezed(thickness, toughness):
    """A floe of 1 m between two round ones of this thickness and always the same mass, one of them fixed: what it bears
    is what 1 m of ice bears before it crushes."""
    a, radius = np.radians(np.arange(-40, 41, 8)), 15.0
    arc = np.column_stack([radius * (np.cos(a) - 1), radius * np.sin(a)])
    segment = Polygon(arc)
    length = (1200 / thickness - segment.area) / (2 * arc[-1, 1])
    ring = np.vstack([arc, arc[[-1, 0]] - [length, 0]])
    tip = -Polygon(ring).centroid.x
    ring[:, 0] += tip
    return {
        "run": {"dt": 0.02, "duration": 2.0},
        "domain": {"length": 400, "width": 200, "x0": -200, "y0": -100},
        "ice": {"concentration": 0, "size": 30, "thickness": 1, "friction": 0,
                "drag": {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0},
                "crushing": {"pressure": 0.15e6, "least_length": 0}, "splitting": {"toughness": toughness}},
        "body": {"shape": "none"}, "impact": {"conversion": "none"}, "output": {"frame_interval": -1},
        "floes": [square(30.0, vx=0.0, vy=0.0, thickness=1.0),
                  polygon(ring, -15.001 - tip, thickness=thickness, vx=1.9, vy=0.0),
                  polygon(-ring, 15.001 + tip, thickness=thickness, fixed=True)]}


def test_a_thicker_neighbour_bears_on_no_shorter_length(tmp_path):
    """The thinner ice is crushed, so that force and bearing length do not depend on the thickness of the other."""
    first = []
    for thickness in (1.0, 4.0):
        assert len(read(run(tmp_path / f"strong{thickness}", squeezed(thickness, 100e3)).dir)["parent"]) == 0
        made = read(run(tmp_path / f"weak{thickness}", squeezed(thickness, 60e3)).dir)
        first.append((made["time"][0], made["mode"][0], made["parent"][0], made["ratio"][0]))
    assert first[0][:3] == first[1][:3] and first[0][3] == pytest.approx(first[1][3], rel=0.03)


def test_a_split_keeps_area_momentum_and_energy(tmp_path):
    side, share = 30.0, 1.2
    r, made = hit(tmp_path, side, np.radians(30), share)
    assert made["area"].sum() == pytest.approx(side**2, rel=1e-13)
    with h5py.File(r.dir / "result.h5") as f:
        pose, velocity = f["frames/pose"][()], f["frames/velocity"][()].astype(float)
        area, end = f["floes/area"][()], f["frames/piece_end"][()]
        piece, at, v = f["frames/piece"][()], f["frames/piece_pose"][()], f["frames/piece_velocity"][()].astype(float)
    assert end.tolist()[0] == 0 and end[1] == 2 and piece[:2].tolist() == [0, 1]
    assert np.isfinite(pose[0]).all() and np.isnan(pose[1:, 0]).all() and np.isfinite(pose[:, 1]).all()
    mass = 910 * area
    before = mass @ velocity[0, :2]
    after = mass[1] * velocity[1, 1] + 910 * made["area"] @ v[:2]
    np.testing.assert_allclose(after, before, atol=1e-6 * abs(before[0]))  # single precision
    assert at[0, 0] == pytest.approx(at[1, 0], abs=1e-3) and at[0, 1] == pytest.approx(-at[1, 1], abs=1e-3)


def test_added_water_goes_with_the_pieces_and_keeps_its_energy(tmp_path):
    """A floe that spins hits a fixed one and splits: contacts alone take energy. The share of the water in mass and
    inertia must be the same (theory, the cut)."""
    still = {"water_form": 0, "water_skin": 0, "air_form": 0, "air_skin": 0}
    r = run(tmp_path, {
        "run": {"dt": 0.05, "duration": 3}, "domain": {"length": 40, "width": 20, "ends": "open", "sides": "open"},
        "ice": {"concentration": 0, "size": 1, "thickness": 0.1, "friction": 0, "added_mass": 0.5, "added_inertia": 0.5,
                "drag": still, "splitting": {"toughness": 2000, "strength": 20000, "least_size": 0.3}},
        "body": {"shape": "none"}, "tow": {"mode": "none"},
        "floes": [{"shape": "rectangle", "length": 6, "width": 1, "x": 10, "y": 0.5, "vx": 0, "vy": -1, "yaw_rate": 60,
                   "yaw": -30}, {"shape": "square", "length": 1, "x": 10, "y": -4, "fixed": True}]})
    with h5py.File(r.dir / "result.h5") as f:
        energy, work = f["series/kinetic_energy"][:], f["series/contact_work"][:]
        assert f["splits/time"].shape[0] > 1
    mass, length = 910 * 0.1 * 6 * 1.5, 6
    start = 0.5 * mass * (1 + (length**2 + 1) / 12 * np.radians(60)**2)
    assert energy[-1] - start == pytest.approx(work.sum(), rel=1e-9)


def test_an_infinite_strength_leaves_every_bit(tmp_path):
    none = run(tmp_path / "none", TOW)
    keys = {"toughness": 1e9, "strength": 1e9, "least_size": 0.1}
    strong = run(tmp_path / "strong", changed(TOW, ice__splitting=keys))
    assert strong.summary["splitting"]["splits"] == 0
    assert strong.summary["state_hash"] == none.summary["state_hash"]
    assert strong.summary["mean_ice_resistance_n"] == none.summary["mean_ice_resistance_n"]


def weak(**keys):
    """Dense ice whose floes split again and again."""
    return changed(TOW, run__duration=12, ice__concentration=0.8, ice__size=0.9, ice__crushing={"pressure": 1e5},
                   ice__splitting={"toughness": 100.0, "strength": 200.0, "least_size": 0.1, **keys})


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    """Such a run with a floe by hand in it, and the contacts of its last step."""
    folder = tmp_path_factory.mktemp("split")
    case = changed(weak(), floes=[square(0.5, 4.3, y=0.0, thickness=0.05)])
    return run(folder, case, "--dump-contacts", f"120:{folder / 'step.h5'}")


def test_generations_and_reserve_are_limits_that_are_told(split, tmp_path):
    first = run(tmp_path / "first", weak(generations=1))
    made = read(first.dir)
    assert first.summary["splitting"]["splits"] > 3 and made["generation"].max() == 1
    assert first.summary["splitting"]["refused_generation"] > 0
    assert read(split.dir)["generation"].max() > 1
    few = run(tmp_path / "few", weak(reserve=3))
    s = few.summary["splitting"]
    assert s["splits"] == 3 and s["refused_reserve"] > 0
    warned = {w["code"]: w for w in few.summary["warnings"]}
    assert warned["split_reserve"]["values"]["reserve"] == 3  # as the key has it, and not ids of pieces
    assert "after 3 splits" in warned["split_reserve"]["text"]
    assert s["refused_reserve"] > few.dataset("frames/pose").shape[1]  # steps of floes, and not told as floes
    assert f"{s['refused_reserve']} floes" not in warned["split_reserve"]["text"]
    small = run(tmp_path / "small", weak(least_size=0.6)).summary["splitting"]
    assert small["refused_size"] > 0 and small["largest_refused_ratio"] > 1


def test_every_piece_has_its_parent_and_their_areas_add_up(split):
    made = read(split.dir)
    with h5py.File(split.dir / "result.h5") as f:
        own = f["floes/area"][()]
        end, piece = f["frames/piece_end"][()], f["frames/piece"][()]
        poses = f["frames/pose"][()]
    area = np.concatenate([own, made["area"]])
    parents = made["parent"]
    np.testing.assert_allclose(made["area"].reshape(-1, 2).sum(axis=1), area[parents], rtol=1e-12)
    assert (made["area"].reshape(-1, 2)[:, 0] >= made["area"].reshape(-1, 2)[:, 1] * (1 - 1e-9)).all()
    assert len(set(parents.tolist())) == len(parents)  # an id is of one outline, and splits once
    gone = np.isnan(poses[-1, :, 0])
    there = piece[end[-2]:end[-1]] + len(own)
    assert gone.sum() == (parents < len(own)).sum()
    assert area[:len(own)][~gone].sum() + area[there].sum() == pytest.approx(own.sum(), rel=1e-12)
    told, pieces = split.summary["splitting"], np.sqrt(area[there])
    assert made["generation"].max() > 1  # some pieces are gone, too
    assert told["size_before_m"] == pytest.approx(np.median(np.sqrt(own[gone])))
    assert told["piece_size_m"] == pytest.approx(np.median(pieces))
    assert told["least_piece_m"] == pytest.approx(pieces.min())
    # outlines: anticlockwise about their centroids
    offsets, v = made["offsets"], made["vertices"]
    for a, b, expected in zip(offsets[:-1], offsets[1:], made["area"]):
        x, y = v[a:b].T
        assert (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2 == pytest.approx(expected, rel=1e-9)


def test_the_reader_joins_pieces_to_the_floes(split):
    from bergtow.result.run import Run
    with Run(split.dir) as folder:
        n = folder.n_floes - folder.n_pieces
        assert folder.n_pieces == 2 * len(folder.splits["time"]) > 0
        there = np.isfinite(folder.pose(-1)[:, 0])
        assert np.isfinite(folder.pose(0)[:n]).all() and np.isnan(folder.pose(0)[n:]).all()
        assert folder.area[there].sum() == pytest.approx(folder.area[:n].sum(), rel=1e-12)
        assert (np.isfinite(folder.speed(-1)) == there).all() and len(folder.thickness) == folder.n_floes
        assert len(folder.polygons(-1)) == folder.n_floes and np.isfinite(folder.least_contact_force(-1)).all()


def test_a_report_counts_splits(split, tmp_path):
    from bergtow.reporting.run import quality
    from bergtow.result.run import Run
    s = split.summary["splitting"]
    with Run(split.dir) as folder:
        (value, words), = [row[1:] for row in quality(folder) if row[0] == "splits"]
    assert value == str(s["splits"]) and s["splits"] > 0
    assert words.startswith(f"{s['near']} opened at a contact, {s['far']} bent, {s['burst']} burst, in {s['steps']} "
                            "steps; ")
    with Run(run(tmp_path / "none", TOW).dir) as folder:
        assert "splits" not in [row[0] for row in quality(folder)]


def test_a_collision_names_its_floe_or_its_piece(split):
    """By the rows of /floes, /bodies and /pieces, at a time at which it was there. Red: ids, among which those of
    pieces come before those of walls."""
    made = read(split.dir)
    with h5py.File(split.dir / "result.h5") as f:
        n, bodies = len(f["floes/area"]), len(f["bodies/names"])
        t, struck = f["impacts/time"][()], f["impacts/floe"][()]
        born = np.concatenate([np.zeros(n + bodies), np.repeat(f["splits/time"][()], 2)])
    gone = np.full(len(born), np.inf)
    gone[made["parent"] + bodies * (made["parent"] >= n)] = born[n + bodies::2]
    assert (struck >= n + bodies).any() and (born[struck] <= t + 1e-9).all() and (t <= gone[struck] + 1e-9).all()


def test_a_number_stands_for_one_floe_in_all_files(split, tmp_path):
    """The id of a piece is that of /impacts/floe, in frames.xdmf, an export, its trajectories, and the replay. Red: the
    first piece with the id of the towed body."""
    from bergtow.maps import export
    from bergtow.reporting.replay import Replay
    from bergtow.result.run import Run
    step = ElementTree.parse(split.dir / "frames.xdmf").getroot().findall("Domain/Grid/Grid")[-1]
    with h5py.File(split.dir / "result.h5") as f:
        n, bodies = len(f["floes/area"]), len(f["bodies/names"])
        drawn = {}
        for block in step.findall("Grid"):
            for item in block.findall("Attribute[@Name='id']/DataItem"):
                text = item.text.strip()
                drawn[block.get("Name")] = (f[text.partition(":")[2]][()] if item.get("Format") == "HDF" else
                                            np.array(text.split(), int))
        # as in test_a_collision_names_its_floe_or_its_piece
        born = n + bodies + f["frames/piece"][f["frames/piece_end"][-2]:]
    assert drawn["pieces"].tolist() == born.tolist() and len(born) > 3 and bodies > 1
    every = np.concatenate(list(drawn.values()))
    assert len(set(every.tolist())) == len(every)
    with Run(split.dir) as folder:
        last = folder.n_frames - 1
        floes = export.floes_layer(folder, [last]).columns["id"][1]
        assert set(drawn["pieces"]) <= set(floes.tolist()) <= set(every.tolist()) - set(drawn["bodies"].tolist())
        names = export.trajectories(folder, [last]).name
        assert [name for name in names if name.startswith("floe")] == [f"floe {i}" for i in floes]
        own = [*range(n), *range(n + bodies, len(folder.ids) + bodies)]
        assert Replay(folder).head["ids"] == folder.ids.tolist() == own


def test_force_chains_go_through_pieces(split):
    """Outlines of a dump are those of the frame of its step, and each contact lies on both of its bodies."""
    from bergtow.plot import chains
    from bergtow.result.run import Run
    read_as = chains.read(split.dir.parent / "step.h5")
    with Run(split.dir) as folder:
        c = chains.joined(folder, read_as)
        np.testing.assert_allclose(c.pose[:folder.n_floes], folder.pose(-1), atol=1e-9)
        at = c.pose[c.body, :2] + c.lever
        assert folder.n_pieces > 0 and (c.body >= folder.n_start).any() and np.isfinite(at).all()
        np.testing.assert_allclose(at[:, 0], at[:, 1], atol=0.05)
        assert chains.draw(folder, read_as)


def test_counts_are_of_the_floes_of_the_start(tmp_path):
    """Not of the pieces. Red: a report that counts both."""
    from bergtow.result import origins
    from bergtow.result.run import Run
    from bergtow.stats.design_value import ice_as_read
    made = run(tmp_path / "made", changed(TOW, run__duration=1, ice__thickness=0.05))
    assert call("export", made.dir, "-o", tmp_path / "map.geojson", "--time", "0").returncode == 0
    case = weak()
    case["ice"] = {"outlines": str(tmp_path / "map.geojson"), "crushing": {"pressure": 1e5},
                   "splitting": case["ice"]["splitting"]}
    with Run(run(tmp_path / "read", case).dir) as folder:
        assert folder.n_pieces > 0 and folder.n_start == folder.summary["n_floes"]
        rows = {value.key: value.value for value in origins.of_field(folder)}
        size = np.sqrt(4 * folder.area[:folder.n_start] / np.pi)
        assert rows["floes"] == str(folder.n_start)
        assert rows["floe size"] == f"{size.mean():.3g} m, {size.min():.3g} to {size.max():.3g} m"
        assert ice_as_read(folder)["ice.size"] == f"{size.mean():.3g} m"


def test_python_tells_floes_that_are_not_there(tmp_path):
    import warnings

    import bergtow
    from bergtow.errors import BergtowError
    with bergtow.Simulation(bergtow.Case(write_case(tmp_path, weak())), threads=1) as sim, warnings.catch_warnings():
        warnings.simplefilter("error")  # NaN as a whole number
        sim.step(sim.steps_left - 1)
        gone = np.isnan(sim.positions[:, 0])
        assert gone.any() and (gone == (sim.motions == -1)).all() and (np.isnan(sim.thicknesses) == gone).all()
        for change in (lambda id: sim.set_velocity(id, 0, 0), lambda id: sim.set_position(id, 1, 0, 0)):
            for id in np.flatnonzero(gone)[[0, -1]]:
                with pytest.raises(BergtowError, match=f"body {id}: is a floe that has split, or a piece"):
                    change(id)


def test_paraview_sees_the_pieces(split):
    import re
    text = (split.dir / "frames.xdmf").read_text()
    assert text.count('Name="pieces"') > 0
    with h5py.File(split.dir / "result.h5") as f:
        for size, path in re.findall(r'Dimensions="([\d ]+)"[^>]*>result\.h5:(/xdmf/\d+/piece\w+)<', text):
            assert tuple(map(int, size.split())) == f[path].shape


@pytest.mark.parametrize("keys, words", [
    ({"ice__splitting": {"strength": 1e5}}, "ice.splitting.toughness"),
    ({"ice__splitting": {"toughness": 1e5, "least_size": 5}}, "ice.splitting.least_size"),
    ({"ice__splitting": {"toughness": 1e5}, "domain__ends": "moving"}, "moving"),
    ({"ice__splitting": {"toughness": 1e5}, "ice__added_mass": 0.5}, "ice.added_inertia: is not ice.added_mass"),
])
def test_bad_input_is_refused(tmp_path, keys, words):
    assert words in run(tmp_path, changed(TOW, **keys), code=CASE).result.stderr


def test_the_history_is_in_a_checkpoint_and_checked(split):
    """A checkpoint whose history of splits does not fit the floes is refused."""
    with h5py.File(split.dir / "checkpoint.h5") as f:
        assert len(f["splits/parent"]) == split.summary["splitting"]["splits"]
        assert len(f["splits/vertices"]) == f["splits/corners"][()].sum()
    assert split.summary["splitting"]["unconverged_steps"] >= 0
