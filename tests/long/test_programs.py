# SPDX-License-Identifier: MIT
"""Results as programs read them that have no package here: ParaView with both of its XDMF readers, and Octave, which
loads HDF5 as MATLAB does. They take 0.7 GB of the disk, so they are not among the packages of `make test`."""
import shutil
import subprocess

import h5py
import numpy as np
import pytest
from harness import ROOT, TOW, changed, run

CASE = changed(TOW, run__duration=4, output__frame_interval=1, output__window_start=1, tow__mode="line", body__x=4,
               tow__line_length=3, tow__line_stiffness=2000, tow__line={"branches": 2}, domain__length=12,
               ice__concentration=0.7, output__panels=True)
SCRIPT = ROOT / "tests/long/paraview_read.py"
POLYGON = 7


@pytest.fixture(scope="module", params=["basin", "geographic"])
def made(request, tmp_path_factory):
    return run(tmp_path_factory.mktemp("made"), changed(CASE, domain__frame=request.param, domain__x0=0))


@pytest.fixture(scope="module")
def seen(made):
    assert shutil.which("pvpython"), "ParaView is missing: make deps-long"
    done = subprocess.run(["pvpython", SCRIPT, made.dir / "frames.xdmf", made.dir / "seen.npz"], capture_output=True,
                          text=True, timeout=300)
    # Red: an array of another size or type than frames.xdmf says, which ParaView complains of and goes on.
    assert done.returncode == 0 and not done.stderr.strip(), done.stderr
    with np.load(made.dir / "seen.npz") as arrays:
        return dict(arrays)


def outlines(points, poses):
    """Corners of /floes or /bodies, placed."""
    vertices, offsets = points["vertices"][()], points["offsets"][()]
    of = np.repeat(np.arange(len(poses)), np.diff(offsets))
    c, s = np.cos(poses[of, 2]), np.sin(poses[of, 2])
    return np.stack([c * vertices[:, 0] - s * vertices[:, 1], s * vertices[:, 0] + c * vertices[:, 1]], 1) \
        + poses[of, :2], offsets


@pytest.mark.parametrize("reader, names", [("old", ("floes", "bodies", "line")), ("new", ("0", "1", "2"))])
def test_paraview_has_the_frames(made, seen, reader, names):
    with h5py.File(made.dir / "result.h5") as f:
        drawn = slice(None, None, 1 if f["xdmf"].attrs["axes"] == "x, y" else -1)  # east is y, north is x
        frames, n = {name: data[()] for name, data in f["frames"].items()}, len(f["floes/area"])
        np.testing.assert_allclose(seen[f"{reader}/times"], frames["time"], rtol=1e-12)
        assert len(frames["time"]) == 5 and frames["contact_force"].any() and frames["net_force"][:, n:].any()
        own = {"0": {"id": np.arange(n), "thickness": f["floes/thickness"][()]},
               "1": {"id": np.arange(n, n + len(f["bodies/area"])), "height": f["bodies/height"][()],
                     "towed": np.arange(len(f["bodies/area"])) == f["bodies/towed"][0]}, "2": {}}
        for k in range(len(frames["time"])):
            floes, others = slice(0, n), slice(n, None)
            moving = {which: {name: frames[name][k, part] for name in ("speed", "velocity", "net_force")}
                      for which, part in (("0", floes), ("1", others))}
            moving["0"]["contact_force"] = frames["contact_force"][k]
            moving["2"] = {"tension": frames["line_tension"][k]}
            shape = {"0": outlines(f["floes"], frames["pose"][k]), "1": outlines(f["bodies"], frames["body_pose"][k]),
                     "2": (frames["line_points"][k], np.arange(0, 5, 2))}
            for which, name in zip("012", names):
                got = {key.split("/")[3]: value for key, value in seen.items()
                       if key.startswith(f"{reader}/{k}/{name}/")}
                points, offsets = shape[which]
                np.testing.assert_allclose(got["points"][:, :2], points[:, drawn], atol=1e-5)
                np.testing.assert_array_equal(got["offsets"], offsets)
                cells = np.split(np.arange(len(points)), offsets[1:-1])  # anticlockwise as drawn
                order = np.concatenate([c if which == "2" else c[drawn] for c in cells])
                np.testing.assert_array_equal(got["connectivity"], order)
                assert which == "2" or (got["types"] == POLYGON).all()
                expected = own[which] | moving[which]
                assert set(got) == set(expected) | {"points", "offsets", "connectivity", "types"}
                for key, value in expected.items():
                    if value.ndim == 2:
                        assert got[key].shape == (len(value), 3) and not got[key][:, 2].any()
                    have = got[key][:, :2][:, drawn] if value.ndim == 2 else got[key]
                    np.testing.assert_allclose(have, value, rtol=1e-6, atol=1e-12, err_msg=f"{name} {key}")


def test_octave_loads_groups(made):
    """By name: at texts in UTF-8, such as /case, its reader gives up."""
    assert shutil.which("octave-cli"), "Octave is missing: make deps-long"
    groups = ("series", "frames", "floes", "impacts", "panels")
    lines = [f"s = load('-hdf5', 'result.h5', {', '.join(map(repr, groups))});"]
    with h5py.File(made.dir / "result.h5") as f:
        wanted = [(f"{g}.{name}", f[g][name][()]) for g in groups for name in f[g]
                  if f[g][name].dtype.kind in "if"]
    lines += [f"printf('{name} %.17g %s\\n', sum(double(s.{name}(isfinite(s.{name})))), num2str(size(s.{name})));"
              for name, _ in wanted]
    done = subprocess.run(["octave-cli", "--no-gui", "--eval", "\n".join(lines)], cwd=made.dir, capture_output=True,
                          text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()]
    assert [r[0] for r in rows] == [name for name, _ in wanted] and len(rows) > 40
    for (name, value), row in zip(wanted, rows):
        assert [n for n in map(int, row[2:]) if n != 1] == [n for n in value.shape[::-1] if n != 1], name
        finite = value[np.isfinite(value)].astype(float)
        assert float(row[1]) == pytest.approx(finite.sum(), rel=1e-9, abs=1e-6 * max(1, np.abs(finite).sum())), name
