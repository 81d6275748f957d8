# SPDX-License-Identifier: MIT
"""postproc/: the reader's numbers, the pictures of the scripts, and what they say about unusable folders."""
import json
import subprocess
from pathlib import Path
from types import SimpleNamespace

import h5py
import matplotlib
import numpy as np
import pytest
from PIL import Image

from harness import script
from made_up_ensemble import edited, seal

pytestmark = pytest.mark.usefixtures("look")
POSTPROC = Path(__file__).resolve().parents[2] / "postproc"

from bergtow.errors import RunError
from bergtow.plot import scene, style
from bergtow.plot import field as plot_field
from bergtow.plot import force as plot_force
from bergtow.reporting import run as report_run
from bergtow.result.frames import place
from bergtow.result.run import Run

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
TRIANGLE = np.array([[-1.0, -0.5], [1.0, -0.5], [0.0, 1.0]])
HULL = np.array([[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]])
SCRIPTS = ("plot-force", "plot-field", "plot-impacts", "film", "contents")

CASE = """# A case with every key, its value in SI units, and what it means.

run:
  title: "Square \\"A\\" \\xB0"  # one line for the reports
  dt: 0.10000000000000001 s  # time step
domain:
  frame: {frame}  # basin: origin at the middle of the short side
  length: 40 m
  width: 40 m
  x0: -20 m
  y0: -20 m
  ends: {ends}
  sides: wall
ice:
  thickness: 0.5 m
tow:
  mode: {mode}
  hull_x: 2 m
  speed: 0.5 m/s
  direction: 1.5707963267948966 rad
  line_damping: 500 N s/m
body:
  drag:
    water_form: 0.84999999999999998  # C_w

floes:
  - shape: disc
    x: 3 m
"""


def make_run(folder, frame="basin", ends="wall", path=((0.0, 0.0), (1.0, 0.0), (2.0, 0.0)), towed=0, mode="speed"):
    """A run of a square and a triangle, a towed hull that takes the positions of path, and a wall; known numbers
    throughout."""
    folder.mkdir(parents=True, exist_ok=True)
    n, frames = 100, len(path)
    attributes = {
        "tow_force": {"role": "balance",
                      "label": "tow force"}, "ice_resistance": {"role": "balance", "label": "ice resistance"},
        "drag_force": {"role": "balance", "label": "drag"}, "inertia_force": {"role": "balance", "label": "inertia"},
        "contacts": {"role": "diagnostic",
                     "label": "contact points"}, "sweeps": {"role": "diagnostic", "label": "sweeps"},
        "residual": {"role": "diagnostic", "merge": "largest of the steps"},
        "overlap": {"role": "diagnostic", "merge": "largest of the steps"}
    }
    time = 0.1 * np.arange(1, n + 1)
    ice = 10.0 + np.sin(np.arange(n))
    series = {"time": ("s", time), "ice_resistance": ("N", ice), "drag_force": ("N", np.full(n, 2.0)),
              "tow_force": ("N", ice + 2.0), "inertia_force": ("N", np.zeros(n)),
              "body_x": ("m", np.linspace(path[0][0], path[-1][0], n)),
              "body_y": ("m", np.linspace(path[0][1], path[-1][1], n)), "contacts": ("1", np.arange(n) % 7.0),
              "carriage_x": ("m", np.full(n, 15.0)), "carriage_y": ("m", np.full(n, 3.0)),
              "sweeps": ("1", np.arange(n) % 5.0), "residual": ("m/s", np.full(n, 1e-7)),
              "overlap": ("m", np.zeros(n)), "kinetic_energy": ("J", time)}
    pose = np.zeros((frames, 2, 3))
    pose[:, 0] = [-10.0, -12.0, np.pi / 2]
    pose[:, 1] = [19.5, 15.0, 0.0]
    body_pose = np.zeros((frames, 2, 3))
    body_pose[:, 0, :2] = path
    body_pose[:, 1, :2] = [0.0, -21.0]
    wall = np.array([[-20.0, -1.0], [20.0, -1.0], [20.0, 1.0], [-20.0, 1.0]])
    with h5py.File(folder / "result.h5", "w") as f:
        f.attrs["program"] = "bergtow"
        f.attrs["complete"] = 1
        f["case"] = CASE.format(frame=frame, ends=ends, mode=mode)
        f["case_as_given"] = "tow: {speed: 1.8 km/h}\n"
        for name, (units, values) in series.items():
            data = f.create_dataset(f"series/{name}", data=values)
            data.attrs["units"], data.attrs["description"] = units, f"about {name}"
            data.attrs.update(attributes.get(name, {}) | {"order": len(f["series"])})
        f["floes/vertices"], f["floes/offsets"] = np.vstack([SQUARE, TRIANGLE]), np.array([0, 4, 7])
        f["floes/thickness"], f["floes/area"] = np.array([0.5, 0.25]), np.array([4.0, 1.5])
        f["frames/time"] = np.linspace(0.0, 10.0, frames)
        f["frames/pose"], f["frames/body_pose"] = pose, body_pose
        f["frames/contact_force"] = np.tile([30.0, 0.0], (frames, 1))
        f["frames/speed"] = np.tile([0.25, 0.0, 0.5, 0.0], (frames, 1))
        f["bodies/vertices"], f["bodies/offsets"] = np.vstack([HULL, wall]), np.array([0, 4, 8])
        f["bodies/towed"] = np.array([towed])
        f.create_dataset("bodies/names", data=["towed body", "wall y low"], dtype=h5py.string_dtype())
    seal(folder / "result.h5")
    summary = {"title": "Square", "n_floes": 2, "n_steps": n, "concentration": 0.8, "mean_ice_resistance_n": 10.0,
               "mean_ice_resistance_se_n": 0.5,
               "mean_ice_resistance_low_n": 10 - 0.98, "mean_ice_resistance_high_n": 10 + 0.98,
               "mean_tow_force_n": 12.0, "unconverged_steps": 0, "tolerance_m_s": 1e-6,
               "window": {"start_s": 3.0, "end_s": 10.0, "verdict": "steady", "reasons": []},
               "reference": {"mean_force_n": 9.0, "source": "a test"}, "stopped": None,
               "warnings": [{"code": "overlap", "text": f"{n} doubt", "values": {}}
                            for n in ("first", "second", "third")]}
    (folder / "summary.json").write_text(json.dumps(summary))
    return folder


def done(result, *paths):
    assert result.returncode == 0, result.stderr
    assert result.stdout.split("\n")[:-1] == [str(p) for p in paths]


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def where(picture, colour, tolerance=12):
    """(rows, columns) of the pixels of a colour "#rrggbb"."""
    rgb = np.array([int(colour[i:i + 2], 16) for i in (1, 3, 5)])
    return np.nonzero((np.abs(picture - rgb) <= tolerance).all(axis=2))


# ---- the reader

def test_vertices_turn_anticlockwise_about_the_centroid(tmp_path):
    with Run(make_run(tmp_path / "run")) as run:
        square, triangle = run.polygons(0)
        # yaw 90 degrees takes (x, y) to (-y, x)
        assert np.abs(square - [[-9, -13], [-9, -11], [-11, -11], [-11, -13]]).max() < 1e-12
        assert np.array_equal(triangle, TRIANGLE + [19.5, 15.0])
        assert np.array_equal(run.body_polygons(2)[0], HULL + [2.0, 0.0])


def test_bodies_turn_as_floes_do():
    corner = place(HULL, (5.0, 7.0, np.pi / 6))[2]
    assert np.abs(corner - [5 + np.sqrt(3) - 0.5, 7 + 1 + np.sqrt(3) / 2]).max() < 1e-12


def test_outlines_for_drawing_are_the_polygons_filled_up(tmp_path):
    with Run(make_run(tmp_path / "run")) as run:
        outlines, index = run.polygon_array(1)
        square, triangle = run.polygons(1)
        assert outlines.shape == (2, 4, 2) and list(index) == [0, 1]
        assert np.array_equal(outlines[0], square)
        assert np.array_equal(outlines[1], np.vstack([triangle, triangle[-1]]))


def test_series_come_back_to_the_bit(tmp_path):
    with Run(make_run(tmp_path / "run")) as run:
        assert np.array_equal(run["ice_resistance"], 10.0 + np.sin(np.arange(100)))
        assert run["time"].dtype == float and run.units("time") == "s"
        assert run.description("tow_force") == "about tow_force"
        assert "sweeps" in run and "nonsense" not in run
        assert run.series_names[0] == "body_x"
        assert run.window == (3.0, 10.0) and run.number("reference.mean_force_n") == 9.0
        assert np.isnan(run.number("window.warning"))


def test_case_values_are_in_si_units(tmp_path):
    with Run(make_run(tmp_path / "run")) as run:
        assert run.value("run.dt") == 0.1
        assert run.value("tow.speed") == 0.5
        assert run.value("tow.direction") == np.pi / 2 and run.value("tow.line_damping") == 500
        assert run.value("body.drag.water_form") == 0.85
        assert run.case["run.title"] == 'Square "A" °'
        assert np.isnan(run.value("ice.size")) and np.isnan(run.value("tow.mode"))
        assert not any(key.startswith("floes") for key in run.case)
        assert run.box == (-20.0, 20.0, -20.0, 20.0) and not run.geographic
        assert run.case_text.startswith("tow: {speed")


def test_periodic_floes_have_images_over_the_edge(tmp_path):
    with Run(make_run(tmp_path / "run", ends="periodic")) as run:
        assert run.period == (40.0, 0.0)
        outlines, index = run.polygon_array(0)
        assert list(index) == [0, 1, 1]  # the triangle reaches to x = 20.5
        assert np.array_equal(outlines[2], outlines[1] - [40.0, 0.0])
        # about x = 20 it is whole, and the square at x = -10 lies at the edge of the window, at x = 30
        square, triangle = run.polygons(0, centre=(20.0, 0.0))
        assert np.array_equal(triangle, TRIANGLE + [19.5, 15.0])
        assert abs(square[:, 0].mean() - 30.0) < 1e-12


def test_positions_wrap_by_whole_periods_along_periodic_directions_only(tmp_path):
    with Run(make_run(tmp_path / "run", ends="periodic")) as run:
        assert np.array_equal(run.wrap([[90.0, 90.0], [-20.0, 0.1], [20.0, 0.0], [3.7, 0.0]]),
                              [[10.0, 90.0], [-20.0, 0.1], [-20.0, 0.0], [3.7, 0.0]])


def test_towed_body_is_named_by_the_file(tmp_path):
    with Run(make_run(tmp_path / "run")) as run:
        assert run.towed == 0 and [b.wall for b in run.bodies] == [False, True]
    with Run(make_run(tmp_path / "none", towed=-1)) as run:
        assert run.towed is None


# ---- unusable folders

def _no_summary(run):
    (run / "summary.json").unlink()


def _broken_summary(run):
    (run / "summary.json").write_text('{"n_floes": 2,')


def _no_result(run):
    (run / "result.h5").unlink()


def _truncated_result(run):
    data = (run / "result.h5").read_bytes()
    (run / "result.h5").write_bytes(data[:len(data) // 2])


def _one_bit(run):
    data = bytearray((run / "result.h5").read_bytes())
    data[5000] ^= 1
    (run / "result.h5").write_bytes(data)


def _opened_to_change_it(run):
    with h5py.File(run / "result.h5", "r+") as f:
        f["series/ice_resistance"][50] = 5e6


def _failed(run):
    _no_summary(run)
    (run / "failure.h5").touch()


def _no_floes(run):
    with edited(run / "result.h5") as f:
        del f["floes"]


def _no_time(run):
    with edited(run / "result.h5") as f:
        del f["series/time"]


def _offsets_beyond_vertices(run):
    with edited(run / "result.h5") as f:
        f["floes/offsets"][2] = 9


def _empty(run):
    for path in run.iterdir():
        path.unlink()


DAMAGES = {_no_summary: "summary.json: missing: .*; wait for it, or continue it with `bergtow resume",
           _failed: "summary.json: missing: the run failed; failure.h5 holds the state before the step that failed",
           _broken_summary: "summary.json: damaged .*; make it again with `bergtow resume",
           _one_bit: "result.h5: is damaged", _opened_to_change_it: "result.h5: has no seal at its end",
           _no_result: "result.h5: missing", _truncated_result: "result.h5: is (truncated|damaged)",
           _no_floes: "has no /floes/vertices", _no_time: "has no /series/time",
           _offsets_beyond_vertices: "/floes/offsets does not fit", _empty: "holds neither summary.json nor result.h5"}


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda d: d.__name__.strip("_"))
def test_damage_is_named_with_path_and_remedy(tmp_path, damage):
    run = make_run(tmp_path / "run")
    damage(run)
    with pytest.raises(RunError, match=DAMAGES[damage]) as caught:
        r = Run(run)
        r.polygons(0)
        r["ice_resistance"]
    assert str(run) in str(caught.value) and "; " in str(caught.value) and caught.value.remedy


@pytest.mark.parametrize("name", SCRIPTS)
def test_scripts_leave_with_4_and_a_message_on_a_bad_folder(tmp_path, name):
    run = make_run(tmp_path / "run")
    _truncated_result(run)
    for folder, reason in ((tmp_path / "nowhere", "no such folder"), (run / "summary.json", "not a folder"),
                           (run, "is truncated")):
        result = script(name, folder)
        assert result.returncode == 4, result.stderr
        assert result.stderr.startswith(f"bergtow {name}: {folder}") and reason in result.stderr
        assert len(result.stderr.splitlines()) == 1 and not result.stdout


def test_missing_frame_data_is_named(tmp_path):
    run = make_run(tmp_path / "run")
    with edited(run / "result.h5") as f:
        del f["frames/speed"]
    result = script("plot-field", run)
    assert result.returncode == 4 and "/frames/speed" in result.stderr and "Traceback" not in result.stderr
    assert script("plot-field", run, "--colour", "thickness").returncode == 0


def test_a_picture_that_cannot_be_written_is_named(tmp_path):
    run = make_run(tmp_path / "run")
    target = tmp_path / "file"
    target.write_text("")
    for name, end in (("plot-force", "a.png"), ("film", "a.mp4")):
        result = script(name, run, "-o", target / end)
        assert result.returncode == 4 and str(target) in result.stderr and "Traceback" not in result.stderr


@pytest.mark.parametrize("name, arguments", [
    ("plot-force", []), ("plot-field", ["--colour", "taste"]), ("plot-field", ["-o", "a.doc"]),
    ("plot-field", ["--times", "nan"]), ("film", ["-o", "a.avi"]), ("film", ["--frames", "0"]),
    ("film", ["--fps", "0"]), ("plot-force", ["--nonsense"]),
    ("plot-force", ["--max", "-1"])])
def test_scripts_leave_with_2_on_wrong_usage(tmp_path, name, arguments):
    run = [make_run(tmp_path / "run")] if arguments else []
    result = script(name, *run, *arguments)
    assert result.returncode == 2 and f"bergtow {name}: " in result.stderr and "Traceback" not in result.stderr


# ---- pictures

def test_running_mean_is_the_mean_of_whole_windows():
    x = np.random.default_rng(1).normal(size=50)
    smooth = plot_force.running_mean(x, 11)
    assert np.isnan(smooth[:5]).all() and np.isnan(smooth[45:]).all()
    assert np.allclose(smooth[5:45], [x[i - 5:i + 6].mean() for i in range(5, 45)], rtol=0, atol=1e-14)
    x[20] = np.nan
    assert np.isclose(plot_force.running_mean(x, 11)[22], np.nanmean(x[17:28]), rtol=0, atol=1e-14)


def test_the_head_tells_the_speed_ordered_from_the_one_made_good(tmp_path):
    """The order alone stood there, as "towed at", also of a body that stood still."""
    def said(name, metres, mode="speed"):
        with Run(make_run(tmp_path / name, path=((0.0, 0.0), (0.0, metres)), mode=mode)) as run:
            return style.conditions(run)
    assert said("a", 4.9).endswith("thick, towed, 0.5 m/s ordered")
    assert said("b", 0.99, "line").endswith("towed on a line, 0.5 m/s ordered and 0.1 m/s made good")
    assert "towed by a vessel, 0.5 m/s ordered and 0.05" in said("c", 0.5, "thrust")


def test_the_head_tells_the_thickness_of_the_floes(tmp_path):
    """The mean is that of the estimates, weighted with area. Red: ice.thickness, also where the floes have another; the
    plain mean, 0.375 m, beside the other on one page; 1 floes. The second of the two is by hand, and ice only without
    the first, or if nothing is fixed."""
    def said(**known):
        with Run(make_run(tmp_path / "run")) as run:
            assert run.n_floes == len(run.area) == len(run.thickness) == 2  # all are read before a piece is made up
            run.__dict__.update(known)
            return style.conditions(run)
    assert ", 2 floes, 0.432 m thick, " in said(n_by_hand=0) and ", 1 floe, 0.5 m thick, " in said()
    assert ", 1 floe, 0.5 m thick, " in said(n_by_hand=0, n_pieces=1)
    for fixed, words in (None, ", 2 floes, 0.432 m thick, "), ([False, True], ", 1 floe, 0.5 m thick, "):
        assert words in said(n_by_hand=2, fixed=fixed if fixed is None else np.array(fixed))
    assert "floe" not in said(n_by_hand=2, fixed=np.array([True, True]))


def test_times_of_a_run_are_those_of_the_console():
    """Red: 13600 to 14400 s."""
    assert style.times_text(13560, 14445) == "13560 to 14445 s"
    assert style.times_text(np.float64(700.5)) == "700.5 s"


def test_a_page_and_its_pictures_name_the_window_of_the_summary(tmp_path, monkeypatch):
    """Red: to three digits."""
    with Run(make_run(tmp_path / "run")) as run:
        monkeypatch.setitem(run.summary["window"], "start_s", 13560.0)
        monkeypatch.setitem(run.summary["window"], "end_s", 14445.0)
        assert any("13560 to 14445 s" in row[1] for row in report_run.quality(run))
        assert "13560 to 14445 s" in report_run.figures(run)[0][2]
        assert any("13560 to 14445 s" in t.get_text() for t in plot_force.draw(run).texts)
        run.frame_times[0] = 14445.0
        assert "14445 s" in plot_field.panel_words(run, "", 0, False)[0]


def test_a_jam_of_one_step_hides_no_force(tmp_path):
    """A force is held against the running mean of the tow, not against its largest sample."""
    folder = make_run(tmp_path / "run")
    with edited(folder / "result.h5") as f:
        f["series/tow_force"][50], f["series/ice_resistance"][50] = 5000.0, 4998.0
        f["series/inertia_force"][:], f["series/drag_force"][:] = 0.1, 20.0
        f["series/tow_force"].attrs["order"] = 0
    with Run(folder) as run:
        labels = [line.get_label() for line in plot_force.draw(run).axes[1].lines]
    assert "drag" in labels and "inertia" not in labels


def test_force_figure_shows_mean_band_and_reference(tmp_path):
    with Run(make_run(tmp_path / "run")) as run:
        axes = plot_force.draw(run).axes[0]
        lines = {line.get_label(): line for line in axes.lines}
        mean = lines["mean, 95 % interval"]
        assert list(mean.get_xdata()) == [3.0, 10.0] and list(mean.get_ydata()) == [10.0, 10.0]
        assert list(lines["reference"].get_ydata()) == [9.0, 9.0]
        assert np.array_equal(lines["each sample"].get_ydata(), run["ice_resistance"])
        band = axes.collections[0].get_paths()[0].vertices
        assert np.isclose(band[:, 1].min(), 10 - 0.98) and np.isclose(band[:, 1].max(), 10 + 0.98)
        assert plot_force.doubts(run) == ["warning: first doubt", "warning: second doubt (1 more in summary.json)"]
        assert plot_force.draw(run, top=14.0).axes[0].get_ylim()[1] == 14.0
        assert plot_force.findings(run) == ("mean: ice resistance 10.0 N (95 %: 9.0 to 11.0 N); tow force 12.0 N; "
                                            "reference 9.00 N (a test), ratio 1.11")


def test_samples_beyond_the_axis_are_named(tmp_path):
    """Red: only those above it."""
    folder = make_run(tmp_path / "run")
    with edited(folder / "result.h5") as f:
        f["series/ice_resistance"][50:52] = [5000.0, -700.0]
    with Run(folder) as run:
        said = [t.get_text() for t in plot_force.draw(run).axes[0].texts]
    assert len(said) == 2 and "5.00 kN" in said[0] and "-700 N" in said[1]


def test_the_head_of_the_forces_has_digits_at_any_magnitude(tmp_path):
    folder = make_run(tmp_path / "run")
    summary = json.loads((folder / "summary.json").read_text())
    summary |= {f"mean_ice_resistance_{key}": v for key, v in (("n", 1.05e-5), ("low_n", 8.7e-6), ("high_n", 1.23e-5))}
    (folder / "summary.json").write_text(json.dumps(summary))
    with Run(folder) as run:
        assert "ice resistance 0.0000105 N (95 %: 0.0000087 to 0.0000123 N)" in plot_force.findings(run)


def test_a_mean_of_no_steady_tow_is_called_so(tmp_path):
    folder = make_run(tmp_path / "run")
    summary = json.loads((folder / "summary.json").read_text())
    summary["window"].update(verdict="not steady", reasons=[{"code": "trend", "text": "it rises", "values": {}}])
    (folder / "summary.json").write_text(json.dumps(summary))
    with Run(folder) as run:
        assert run.verdict == ("not steady", "it rises") and run.window_name == "window"
        figure = plot_force.draw(run)
        labels = [line.get_label() for line in figure.axes[0].lines]
        assert "mean over the window, 95 % interval" in labels and "mean, 95 % interval" not in labels
        assert plot_force.findings(run).startswith("mean over the window: ice resistance 10.0 N")
        assert "shaded: window 3" in " ".join(t.get_text() for t in figure.texts)
        assert report_run.figures(run)[0][0] == "ice resistance, mean over the window"
    del summary["window"]["verdict"]  # as without a towed body
    (folder / "summary.json").write_text(json.dumps(summary))
    with Run(folder) as run:
        assert run.verdict[0] == "not judged" and run.mean_name == "mean over the window"


def test_force_pictures_are_written(tmp_path):
    run = make_run(tmp_path / "run")
    done(script("plot-force", run, "--diagnostics"), run / "force.png", run / "force-diagnostics.png")
    for name in ("force.png", "force-diagnostics.png"):
        assert (run / name).stat().st_size > 10_000
    picture = pixels(run / "force.png")
    assert len(where(picture, style.ICE)[0]) > 300 and len(where(picture, style.DRAG)[0]) > 300


@pytest.mark.parametrize("colour", ("speed", "force", "thickness"))
def test_field_picture_shows_water_ice_and_body(tmp_path, colour):
    run = make_run(tmp_path / "run")
    out = tmp_path / "new" / "field.png"
    done(script("plot-field", run, "--colour", colour, "-o", out), out)
    assert out.stat().st_size > 10_000
    picture = pixels(out)
    assert len(where(picture, style.WATER)[0]) > 50_000 and len(where(picture, style.BODY)[0]) > 500


def test_floes_take_the_colour_of_their_value(tmp_path):
    run = make_run(tmp_path / "run")
    done(script("plot-field", run), run / "field.png")
    picture = pixels(run / "field.png")
    for share in (0.5, 0.0):  # the square moves at half the tow speed, the triangle rests
        assert len(where(picture, matplotlib.colors.to_hex(style.SPEED_MAP(share)), 3)[0]) > 400


def test_field_panels_show_first_middle_and_last_frame(tmp_path):
    with Run(make_run(tmp_path / "run", path=[(float(i * i), 0.0) for i in range(5)])) as run:
        axes = plot_field.draw(run).axes[:3]
        assert [a.get_title(loc="left") for a in axes] == ["before, t = 0 s", "during, t = 5 s", "after, t = 10 s"]
        for a, x in zip(axes, (0.0, 4.0, 16.0)):
            colour = matplotlib.colors.to_rgba(style.BODY)
            bodies = [p for c in a.collections for p in c.get_paths()
                      if len(c.get_facecolor()) and tuple(c.get_facecolor()[0]) == colour]
            assert len(bodies) == 1 and np.allclose(bodies[0].vertices[:4], HULL + [x, 0.0], rtol=0, atol=1e-12)


def test_the_arrow_goes_along_the_leg_at_hand():
    """And a line that broke is not drawn again, however many way-points came before. Red when the first leg, or the
    first 40 events, stand for the run."""
    corners = [{"time_s": 10.0 * (k + 1), "kind": "waypoint", "subject": k + 1} for k in range(3)]
    run = SimpleNamespace(towed=0, case={"tow.mode": "speed"}, events=corners,
                          headings=np.array([[1, 0], [0, 1], [-1, 0]], dtype=float))
    for time, leg in ((0, 0), (9.9, 0), (10, 1), (25, 2), (99, 2)):
        assert np.array_equal(scene.tow_heading(run, time), run.headings[leg])
    events = [{"time_s": float(k), "kind": "waypoint", "subject": k} for k in range(45)]
    events.append({"time_s": 50.0, "kind": "line_broken", "subject": 1, "value": 1e3})

    class Line(SimpleNamespace):
        def __getitem__(self, name):
            return np.array([0.0, 100.0]) if name == "time" else np.full(2, float(len(name)))

    line = Line(case={"tow.mode": "line"}, frame_times=[40.0, 60.0], events=events, towed=0,
                series_names=["carriage_x", "carriage_y", "body_x", "body_y"],
                value=lambda key, preset: preset, body_pose=lambda frame: np.zeros((1, 3)))
    assert [len(scene.tow_line(line, frame, np.zeros(2))) for frame in (0, 1)] == [2, 1]
    rows, n = report_run.events(SimpleNamespace(events=[e | {"value": None} for e in events]))
    assert n == 46 and len(rows) == 40 and any("line broken" in row for row in rows)


def test_decimals_follow_the_size_of_the_range():
    """Red: none for a tank of 0.3 m, one for a run of 0.2 s."""
    said = [style.fixed(*v) for v in ((0.0424, 0.3), (0.12, 0.2), (12.34, 40), (123.4, 2400), (-0.001, 40))]
    assert said == ["0.042", "0.120", "12.3", "123", "0.0"]


def test_a_moving_window_is_shown_about_the_body(tmp_path):
    """60 m northward through a window of 40 m whose frames hold wrapped places: title, track and view say where the
    body is."""
    path = [(15.0 * i, 0.0) for i in range(5)]
    folder = make_run(tmp_path / "run", frame="geographic", ends="moving", path=path)
    with edited(folder / "result.h5") as f:
        f["frames/body_pose"][:, 0, 0] = (np.array(path)[:, 0] + 20) % 40 - 20
        del f["case"]
        f["case"] = CASE.format(frame="geographic", ends="moving\n  ahead: 25 m",
                                mode="speed").replace("1.5707963267948966 rad", "0 rad")
    with Run(folder) as run:
        figure = plot_field.draw(run, window="body")
        axes = figure.axes[:3]
        assert [a.get_title(loc="left").split("(")[1] for a in axes] == ["0.0, 0.0) m", "29.7, 0.0) m", "60.0, 0.0) m"]
        for a in axes:
            low, high = a.get_ylim()
            assert low >= -15 and high <= 25, "beyond the window lies the ice of its other end"
        track = [line for line in axes[2].lines if line.get_marker() != "s"][0].get_xydata()
        assert np.abs(track[-1]).max() < 1 and track[:, 1].max() < 1, "the track ends at the body and lies behind it"


def test_titles_of_narrow_panels_stand_apart(tmp_path):
    folder = make_run(tmp_path / "run", path=[(1000.0 + i, 0.0) for i in range(5)])
    with edited(folder / "result.h5") as f:
        del f["case"]
        f["case"] = CASE.format(frame="geographic", ends="open",
                                mode="speed").replace("length: 40 m", "length: 4000 m").replace(
                                    "1.5707963267948966 rad", "0 rad")
    with Run(folder) as run:
        run.summary["title"] = "A tow with a title that is a good deal longer than the figure is wide at full size"
        figure = plot_field.draw(run, window="body")
        figure.canvas.draw()
        axes = figure.axes[:3]
        ends = [a._left_title.get_window_extent() for a in axes]
        assert all(a.x1 < b.x0 for a, b in zip(ends, ends[1:])) and ends[-1].x1 <= figure.bbox.width
        assert max(t.get_window_extent().x1 for t in figure.texts) <= figure.bbox.width
        ticks = [[t.get_window_extent() for t in a.get_xticklabels() if t.get_text()] for a in axes]
        assert all(p.x1 < q.x0 for t in ticks for p, q in zip(t, t[1:]))


def test_tow_line_goes_from_the_hull_to_the_carriage(tmp_path):
    for mode, expected in (("line", [[[10.0, 5.0], [15.0, 3.0]]]), ("speed", [])):
        with Run(make_run(tmp_path / mode, path=((8.0, 5.0),) * 3, mode=mode)) as run:
            axes = plot_field.draw(run).axes[0]
            lines = [
                line.get_xydata().tolist() for line in axes.lines if line.get_marker() == "s" and len(line.get_xydata())
            ]
            assert lines == expected


def test_the_towed_body_and_its_line_go_on_across_a_seam(tmp_path):
    """Red: at one side of the whole domain only."""
    folder = make_run(tmp_path / "run", ends="periodic", path=((19.5, 19.5),) * 3, mode="line")
    with edited(folder / "result.h5") as f:
        case = f["case"][()].decode().replace("sides: wall", "sides: periodic")
        del f["case"]
        f["case"] = case
        f["series/carriage_x"][:], f["series/carriage_y"][:] = 25.0, 19.5
    with Run(folder) as run:
        axes = plot_field.draw(run, window="whole").axes[0]
        colour = matplotlib.colors.to_rgba(style.BODY)
        [body] = [c for c in axes.collections if len(c.get_facecolor()) and tuple(c.get_facecolor()[0]) == colour]
        middles = [p.vertices[:4].mean(axis=0) for p in body.get_paths()]
        assert all(any(np.allclose(m, at) for m in middles) for at in ([19.5, -20.5], [-20.5, 19.5], [-20.5, -20.5]))
        [line] = [line for line in axes.lines if line.get_marker() == "s"]
        assert [-15.0, 19.5] in line.get_xydata()[line.get_markevery()].tolist()


def _body_centre(tmp_path, frame, position):
    """(row, column) of the towed body's pixels."""
    name = f"{frame}{position[0]:.0f}{position[1]:.0f}"
    run = make_run(tmp_path / name, frame=frame, path=(position,))
    done(script("plot-field", run), run / "field.png")
    rows, columns = where(pixels(run / "field.png"), style.BODY)
    assert len(rows) > 200
    return rows.mean(), columns.mean(), np.ptp(rows), np.ptp(columns)


@pytest.mark.slow
def test_geographic_frame_is_drawn_north_up_and_east_right(tmp_path):
    middle = _body_centre(tmp_path, "geographic", (0.0, 0.0))
    north = _body_centre(tmp_path, "geographic", (8.0, 0.0))
    east = _body_centre(tmp_path, "geographic", (0.0, 8.0))
    assert north[0] < middle[0] - 30 and abs(north[1] - middle[1]) < 2
    assert east[1] > middle[1] + 30 and abs(east[0] - middle[0]) < 2
    assert middle[2] > 1.5 * middle[3]  # the hull is long in x


def test_basin_frame_is_drawn_x_right_and_y_up(tmp_path):
    middle = _body_centre(tmp_path, "basin", (0.0, 0.0))
    along = _body_centre(tmp_path, "basin", (8.0, 0.0))
    across = _body_centre(tmp_path, "basin", (0.0, 8.0))
    assert along[1] > middle[1] + 30 and abs(along[0] - middle[0]) < 2
    assert across[0] < middle[0] - 30 and abs(across[1] - middle[1]) < 2
    assert middle[3] > 1.5 * middle[2]


def test_film_as_gif_follows_the_body(tmp_path):
    run = make_run(tmp_path / "run", path=[(-8.0 + 4 * i, 0.0) for i in range(5)])
    out = tmp_path / "film.gif"
    done(script("film", run, "-o", out, "--width", 500), out)
    film = Image.open(out)
    assert film.n_frames == 5
    columns = []
    for i in range(5):
        film.seek(i)
        columns.append(where(np.asarray(film.convert("RGB")).astype(int), style.BODY, 30)[1].mean())
    steps = np.diff(columns)
    assert (steps > 10).all() and np.ptp(steps) < 2
    assert list(tmp_path.glob("*.part")) == []


@pytest.mark.slow
def test_film_as_mp4_has_every_frame(tmp_path):
    run = make_run(tmp_path / "run", path=[(float(i), 0.0) for i in range(7)])
    done(script("film", run, "--width", 501), run / "film.mp4")
    probe = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-show_entries",
                            "stream=nb_read_frames,width,height", "-of", "json", run / "film.mp4"], capture_output=True,
                           text=True, check=True)
    stream = json.loads(probe.stdout)["streams"][0]
    assert stream["nb_read_frames"] == "7" and stream["width"] == 500 and stream["height"] % 2 == 0


def test_a_run_without_towed_body_has_pictures_too(tmp_path):
    run = make_run(tmp_path / "run", towed=-1)
    done(script("plot-field", run), run / "field.png")
    done(script("film", run, "-o", tmp_path / "film.gif", "--width", 400), tmp_path / "film.gif")
    result = script("plot-force", run)
    assert result.returncode == 4 and "no towed body" in result.stderr


def test_contents_lists_what_a_run_holds(tmp_path):
    result = script("contents", make_run(tmp_path / "run"))
    assert result.returncode == 0
    assert "2 floes, 2 bodies, 100 samples, 3 frames" in result.stdout
    assert "window.start_s" in result.stdout and "about tow_force" in result.stdout
