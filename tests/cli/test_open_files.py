# SPDX-License-Identifier: MIT
"""Files as programs find them that know nothing of this one: units, names and axes on every dataset, and xarray by
either of its engines or by none that is named, netCDF's own tools, UDUNITS, pandas and h5py."""
import ctypes
import json
import subprocess

import h5py
import netCDF4
import numpy as np
import pytest
import xarray
import yaml

from harness import BERGTOW, TOW, changed, environment, quick, write_case

FULL = changed(TOW, run__duration=3, run__title="A tow", output__window_start=1, output__frame_interval=1,
               output__panels=True, output__checkpoint_steps=10, domain__length=12, domain__width=6,
               ice__concentration=0.6, ice__restitution=0.2, ice__crushing={"pressure": 1e5}, ice__rafting={"kappa": 5})
LINE = changed(TOW, run__duration=3, output__window_start=1, tow__mode="thrust", tow__line_length=3,
               tow__line_stiffness=2000, tow__line_damping=100, tow__waypoints=[[9, 0], [20, 1]],
               tow__vessel={"mass": 800, "bollard_pull": 600, "free_speed": 3}, domain__ends="moving",
               domain__length=24, domain__ahead=14, domain__sides="periodic", output__checkpoint_steps=10)
ENGINES = ("h5netcdf", "netcdf4")
NETCDF_ONLY = "This is a netCDF dimension but not a netCDF variable"


def called(folder, *arguments):
    done = subprocess.run([BERGTOW, *map(str, arguments)], cwd=folder, env=environment(), capture_output=True,
                          text=True, timeout=120)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    write_case(folder, FULL)
    called(folder, "run", "case.yml", "-o", "full", "--quiet")
    called(folder, "field", "case.yml", "-o", "field.h5")
    (folder / "study.yml").write_text(yaml.safe_dump({
        "base": "case.yml", "title": "Two", "repeats": 2, "set": {"run.duration": "2 s"},
        "parameters": {"ice.friction": [0.05, 0.2]},
        "variants": {"a": {"ice.size": 1}, "b": {"ice.shape": "rectangles"}}}))
    called(folder, "ensemble", "study.yml", "-o", "all")
    write_case(folder, LINE)
    called(folder, "run", "case.yml", "-o", "line", "--quiet", "--dump-contacts", "20:contacts.h5")
    return folder


FILES = ("full/result.h5", "full/checkpoint.h5", "line/result.h5", "line/checkpoint.h5", "field.h5", "all/ensemble.h5",
         "contacts.h5")


def datasets(path):
    found = {}
    with h5py.File(path) as f:
        def take(name, item):
            if isinstance(item, h5py.Dataset):
                found[name] = (item.shape, item.dtype, dict(item.attrs), [len(d) for d in item.dims])
        f.visititems(take)
    return found


@pytest.mark.parametrize("name", FILES)
def test_every_dataset_has_units_a_name_and_axes(made, name):
    """Red: an array that is written without a word on what it is."""
    found = datasets(made / name)
    assert len(found) > 5
    for key, (shape, kind, attributes, scales) in found.items():
        if str(attributes.get("NAME", b"")).find(NETCDF_ONLY) >= 0:
            continue
        assert str(attributes.get("long_name", "")).strip(), key
        if kind.kind not in "SO" and key != "events/value":
            assert ("units" in attributes) != ("units_of_columns" in attributes), key
        own = "CLASS" in attributes
        if not key.startswith("xdmf/0") and not own:
            assert scales == [1] * len(shape), (key, scales)
    with h5py.File(made / name) as f:
        assert f.attrs["Conventions"] == "CF-1.8" and "bergtow" in f.attrs["source"]


@pytest.mark.parametrize("engine", quick(ENGINES, "netcdf4"))
def test_xarray_opens_every_group(made, engine):
    """The values of h5py, with named dimensions; time, and the member, as coordinates."""
    for name in FILES:
        with h5py.File(made / name) as f:
            groups = [g for g in f if isinstance(f[g], h5py.Group) and g not in ("xdmf", "fclib_local")]
            for group in groups + [g for g in ("fclib_local/W", "fclib_local/vectors") if g in f]:
                with xarray.open_dataset(made / name, group=group, engine=engine) as ds:
                    assert not [d for d in ds.sizes if d.startswith("phony") or d.startswith("dim_")], (name, group)
                    assert set(ds.variables) == set(f[group]), (name, group)
                    for key in ds.variables:
                        if f[group][key].dtype.kind in "if" and ds[key].dtype.kind in "if":
                            np.testing.assert_array_equal(ds[key].values, f[group][key][()], err_msg=f"{group}/{key}")
    with xarray.open_dataset(made / "full/result.h5", group="frames", engine=engine) as ds:
        assert ds["pose"].dims == ("time", "floe", "component") and "time" in ds.coords
        assert ds["contact_force"].dims == ("time", "floe") and ds["contact_force"].attrs["units"] == "N"
    with xarray.open_dataset(made / "full/result.h5", group="panels", engine=engine) as ds:
        assert ds["force"].dims == ("sample", "panel", "xy") and ds["ends"].dims == ("panel_end", "xy")
    with xarray.open_dataset(made / "line/checkpoint.h5", group="bodies", engine=engine) as ds:
        assert ds["pose"].dims == ("body", "component") and ds["path"].dims == ("body",)
    with xarray.open_dataset(made / "line/checkpoint.h5", group="history", engine=engine) as ds:
        assert ds["tow"].dims == ("time",) and "time" in ds.coords and ds.sizes["time"] == 30
    with xarray.open_dataset(made / "all/ensemble.h5", group="series", engine=engine) as ds:
        assert all(v.dims == ("member", "sample") for v in ds.values()) and ds.sizes["member"] == 8


@pytest.mark.parametrize("name", FILES)
def test_nobody_need_know_what_a_file_is(made, name):
    """As one types it: no engine, no option. Red: HDF5 behind a block in front, which netCDF and xarray do not skip."""
    path = made / name
    with h5py.File(path) as f:
        groups = ["/"]
        f.visititems(lambda group, item: groups.append(group) if isinstance(item, h5py.Group) else None)
    for group in groups:
        with xarray.open_dataset(path, group=group) as ds:
            ds.load()
    with netCDF4.Dataset(path) as f:
        assert f.groups
    for words in (["ncdump", "-h"], ["ncdump"]):
        dumped = subprocess.run([*words, path], capture_output=True, text=True, timeout=60)
        assert dumped.returncode == 0 and not dumped.stderr, dumped.stderr


@pytest.fixture(scope="module")
def udunits():
    """A function that tells whether UDUNITS knows a unit."""
    library = ctypes.CDLL("libudunits2.so.0")
    library.ut_read_xml.restype = library.ut_parse.restype = ctypes.c_void_p
    library.ut_parse.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int]
    library.ut_set_error_message_handler.argtypes = [ctypes.c_void_p]
    library.ut_set_error_message_handler(ctypes.cast(library.ut_ignore, ctypes.c_void_p))
    system = library.ut_read_xml(None)
    assert system
    return lambda unit: bool(library.ut_parse(system, unit.encode(), 2))  # UT_UTF8


@pytest.mark.parametrize("name", FILES)
def test_units_are_those_of_udunits(made, udunits, name):
    """CF 1.8, which the files claim, 3.1. Red: "see kind", "m, m, rad"."""
    for key, (_, _, attributes, _) in datasets(made / name).items():
        columns = attributes.get("units_of_columns", "1").split(", ")
        assert all(udunits(unit) for unit in [attributes.get("units", "1"), *columns]), (key, attributes)


def test_units_that_a_file_could_have_are_those_of_udunits(udunits):
    """Of every series and number of a summary, and of every key, which a study can vary."""
    listed = [json.loads(subprocess.run([BERGTOW, what, "--json"], env=environment(), capture_output=True, check=True,
                                        timeout=60).stdout) for what in ("--list-quantities", "--list-keys")]
    units = {q["units"] for part in ("series", "summary") for q in listed[0][part] if q["units"]}
    units |= {u["si"] for u in listed[1]["units"] if u["si"]}
    assert {"N", "m/s"} <= units and not udunits("see kind") and [u for u in sorted(units) if not udunits(u)] == []


def test_pandas_has_series_and_members(made):
    with xarray.open_dataset(made / "full/result.h5", group="series", engine="h5netcdf") as ds:
        table = ds[["ice_resistance", "tow_force"]].to_dataframe()
    with h5py.File(made / "full/result.h5") as f:
        assert table.index.name == "time" and np.array_equal(table["tow_force"], f["series/tow_force"])
    with xarray.open_dataset(made / "all/ensemble.h5", group="summary", engine="h5netcdf") as ds:
        assert len(ds[["mean_ice_resistance_n"]].to_dataframe()) == 8


def test_a_dimension_without_a_coordinate_takes_no_storage(made):
    with h5py.File(made / "full/result.h5") as f:
        assert f["floe"].id.get_storage_size() == 0 and f["floe"].shape == f["floes/area"].shape
        assert f["floe"].attrs["NAME"].decode().startswith(NETCDF_ONLY)
