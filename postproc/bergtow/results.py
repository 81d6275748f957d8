# SPDX-License-Identifier: MIT
"""Result folders of runs: the summary, and result.h5 as an xarray.Dataset that is read when it is used."""
import json
from pathlib import Path

import numpy as np

from ._library import IO, BergtowError


class Result:
    """The folder that a run has left."""

    def __init__(self, folder):
        self.folder = Path(folder)

    @property
    def summary(self):
        """summary.json as a dictionary."""
        path = self.folder / "summary.json"
        try:
            return json.loads(path.read_text())
        except FileNotFoundError:
            raise BergtowError(f"{path}: is not there: the run has not ended; go on with it by `bergtow resume "
                               f"{self.folder}`", IO) from None

    def open(self):
        """open_result(folder)"""
        return open_result(self.folder)

    def __repr__(self):
        return f"<bergtow.Result {self.folder}>"


def _imported(name):
    try:
        return __import__(name)
    except ImportError:
        raise BergtowError(f"{name} is missing, which open_result needs; install python3-{name} (Debian), or "
                           f"`pip install {name}`", IO) from None


def _wrapper(xarray):
    """A class of arrays that read an HDF5 dataset when they are indexed."""
    from xarray.backends import BackendArray
    from xarray.core import indexing

    class Stored(BackendArray):
        def __init__(self, dataset, column=None):
            self.dataset, self.column = dataset, column
            self.shape = dataset.shape if column is None else dataset.shape[:-1]
            self.dtype = dataset.dtype

        def __getitem__(self, key):
            return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER_1VECTOR,
                                                      self._get)

        def _get(self, key):
            return self.dataset[key if self.column is None else (*key, self.column)]

    return lambda dataset, column=None: indexing.LazilyIndexedArray(Stored(dataset, column))


def _text(value):
    value = value.decode() if isinstance(value, bytes) else value
    return value.item() if isinstance(value, np.generic) else value


def open_result(folder):
    """The result of a run as an xarray.Dataset.

    Dimensions: time (entries of the series), frame, floe, and other_body (the towed body, walls). Series have their
    names, frames are floe_x, floe_y, floe_yaw, floe_contact_force and other_body_x and so on. Every variable has units,
    long_name and, where it has one, a label. Values are read from the file when they are used; close it as any Dataset.
    The text of summary.json is the attribute `summary`. Errors: BergtowError.
    """
    xarray, h5py = _imported("xarray"), _imported("h5py")
    path = Path(folder)
    path = path / "result.h5" if path.is_dir() else path
    try:
        file = h5py.File(path)
    except OSError as error:
        raise BergtowError(f"{path}: cannot be read ({error}); give the folder that a run has left", IO) from None
    stored = _wrapper(xarray)
    variables = {}

    def put(name, dims, dataset, column=None, units=None, long_name=None):
        a = dict(dataset.attrs)
        attributes = {"units": units or _text(a.get("units", "1")),
                      "long_name": long_name or _text(a.get("description", name.replace("_", " ")))}
        if "label" in a:
            attributes["label"] = _text(a["label"])
        assert name not in variables, name
        variables[name] = xarray.Variable(dims, stored(dataset, column), attributes)

    for name, dataset in file["series"].items():
        put(name, ("time",), dataset)
    for name in ("thickness", "area"):
        put(f"floe_{name}", ("floe",), file[f"floes/{name}"], long_name=f"{name} of the floe")
    for name in ("height", "area"):
        put(f"other_body_{name}", ("other_body",), file[f"bodies/{name}"])
    variables["other_body_name"] = xarray.Variable(("other_body",), [_text(n) for n in file["bodies/names"][()]])
    if "frames" in file:
        frames = file["frames"]
        put("frame_time", ("frame",), frames["time"], long_name="time of the frame")
        for of, data in (("floe", "pose"), ("other_body", "body_pose")):
            for k, (axis, units) in enumerate((("x", "m"), ("y", "m"), ("yaw", "rad"))):
                put(f"{of}_{axis}", ("frame", of), frames[data], k, units,
                    "angle from the x axis" if axis == "yaw" else f"{axis} of the centroid")
        put("floe_contact_force", ("frame", "floe"), frames["contact_force"])
    attributes = {name: _text(value) for name, value in file.attrs.items()}
    summary = path.with_name("summary.json")
    if summary.exists():
        attributes["summary"] = summary.read_text()
    coordinates = [n for n in ("time", "frame_time", "other_body_name") if n in variables]
    dataset = xarray.Dataset(variables, attrs=attributes).set_coords(coordinates)
    dataset.set_close(file.close)
    return dataset
