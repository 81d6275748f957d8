# SPDX-License-Identifier: MIT
"""Result folders of runs: the summary, and result.h5 as an xarray.Dataset that is read lazily."""
from __future__ import annotations

import functools
import html
import json
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bergtow.case import here
from bergtow.errors import IO, BergtowError
from bergtow.functions import report
from bergtow.result import integrity

if TYPE_CHECKING:
    import h5py
    import xarray


class Result:
    """The output folder of a run."""

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(here(), folder)  # the working folder may change

    @property
    def summary(self) -> dict[str, Any]:
        """summary.json as a dictionary."""
        path = self.folder / "summary.json"
        try:
            return json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise integrity.without_summary(self.folder) from None

    def open(self) -> xarray.Dataset:
        """open_result(folder)"""
        return open_result(self.folder)

    def report(self, file: str | os.PathLike[str] | None = None, **options: Any) -> Path:
        """bergtow.report(self, file, ...)"""
        return report(self, file, **options)

    def __repr__(self) -> str:
        return f"<bergtow.Result {self.folder}>"

    def __str__(self) -> str:
        """The text for print(): the numbers that a notebook shows, one per line."""
        if not (self.folder / "summary.json").exists():
            return f"{self.folder}: has no summary: the run has not ended"
        return "\n".join([f"{self.folder}", *(f"  {name}: {html.unescape(text)}" for name, text in
                                             _shown(self.summary))])

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><td>{name}</td><td>{value}</td></tr>" for name, value in _shown(self.summary))
        return f"<p>{html.escape(repr(self))}</p><table>{rows}</table>"


#: numbers of the summary that a notebook shows
_SHOWN = ("title", "n_floes", "concentration", "sim_time_s", "mean_ice_resistance_n", "mean_tow_force_n",
          "peak_tow_force_n", "mean_line_tension_n", "unconverged_steps", "state_hash")


def _shown(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """(name, text) of the numbers that a notebook shows; ± is one standard error, as in the report."""
    yield "verdict", html.escape(str(summary.get("window", {}).get("verdict")))
    for name in _SHOWN:
        value = summary.get(name)
        if value is None:
            continue
        error = summary.get(name.removesuffix("_n") + "_se_n")
        text = f"{value:.4g}" if isinstance(value, float) else str(value)
        if (summary.get("window") or {}).get("at_least") and (
                name.endswith("ice_resistance_n") or name.endswith("tow_force_n") and
                summary.get("mean_line_tension_n") is None):
            text = f"at least {text}"
        yield html.escape(name), html.escape(text + (f" ± {error:.2g}" if error else ""))
    for warning in summary.get("warnings", []):
        yield "warning", html.escape(str(warning["text"]))


def _imported(name: str) -> Any:
    try:
        return __import__(name)
    except ImportError:
        raise BergtowError(f"{name} is missing, which open_result needs; install python3-{name} (Debian), or "
                           f"`pip install {name}`", IO) from None


@functools.lru_cache(maxsize=1)
def _stored_class() -> Any:
    """A class of arrays that read an HDF5 dataset when they are indexed."""
    from xarray.backends import BackendArray
    from xarray.core import indexing

    class Stored(BackendArray):
        def __init__(self, dataset: h5py.Dataset, column: int | None, part: slice | None) -> None:
            self.dataset, self.column, self.part = dataset, column, part
            self.path = os.path.abspath(dataset.file.filename)  # the working folder may change before it is pickled
            shape = dataset.shape if column is None else dataset.shape[:-1]
            self.shape = shape if part is None else (shape[0], part.stop - part.start, *shape[2:])
            self.dtype = dataset.dtype

        def __deepcopy__(self, memo: Any) -> Any:
            return self  # a copy is not needed: it only reads

        def __reduce__(self) -> Any:
            return _stored_again, (self.path, self.dataset.name, self.column, self.part)

        def __getitem__(self, key: Any) -> Any:
            if any(getattr(k, "size", 1) == 0 for k in key.tuple):  # HDF5 does not support empty indices
                nothing = np.broadcast_to(np.zeros((), self.dtype), self.shape)
                return indexing.NumpyIndexingAdapter(nothing)[key]
            return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER_1VECTOR,
                                                      self._get)

        def _get(self, key: Any) -> Any:
            if self.part is not None:
                key = (key[0], self._moved(key[1], self.part), *key[2:])
            return self.dataset[key if self.column is None else (*key, self.column)]

        def _moved(self, key: Any, part: slice) -> Any:
            """Convert an index into the part of the second axis to an index into the dataset."""
            if isinstance(key, slice):
                start, stop, step = key.indices(self.shape[1])
                return slice(start + part.start, max(stop, 0) + part.start, step)
            return key + part.start

    return Stored


def _stored_again(path: str, name: str, column: int | None, part: slice | None) -> Any:
    """An array after unpickling; the file stays open as long as it is in use."""
    return _stored_class()(_imported("h5py").File(path)[name], column, part)


def _wrapper(xarray: Any) -> Callable[..., Any]:
    """A function that makes arrays which read an HDF5 dataset when they are indexed."""
    from xarray.core import indexing

    return lambda dataset, column=None, part=None: indexing.LazilyIndexedArray(_stored_class()(dataset, column, part))


class _Closer:
    """Closes the file of a Dataset. Pickled it closes nothing, because an unpickled array opens the file itself."""

    def __init__(self, file: h5py.File | None = None) -> None:
        self.file = file

    def __call__(self) -> None:
        if self.file is not None:
            self.file.close()

    def __reduce__(self) -> Any:
        return _Closer, ()


def _dataset(variables: dict[str, Any], coordinates: list[str], attributes: dict[str, Any],
             file: h5py.File) -> xarray.Dataset:
    """A Dataset that closes the file with itself."""
    dataset = _imported("xarray").Dataset(variables, attrs=attributes).set_coords(coordinates)
    dataset.set_close(_Closer(file))
    return dataset


#: groups of result.h5, and the prefixes of their variables
_GROUPS = {"series": "", "floes": "floe_", "bodies": "other_body_", "impacts": "collision_", "panels": "panel_",
           "events": "event_", "splits": "split_", "pieces": "piece_"}
#: dimensions by their scales in the file
_DIMENSIONS = {"/series/time": "time", "/sample": "time", "/frames/time": "frame", "/impacts/time": "collision",
               "/events/time": "event", "/body": "other_body", "/body_end": "other_body_end",
               "/body_vertex": "other_body_vertex", "/event_kind": "kind_of_event"}
_POSE = (("x", "m", "x of the centroid"), ("y", "m", "y of the centroid"), ("yaw", "rad", "angle from the x axis"))


def _dims(dataset: h5py.Dataset) -> tuple[str, ...] | None:
    """Names of the dimensions of a dataset, from its scales; None for a dataset without scales."""
    if all(len(axis) for axis in dataset.dims):
        scales = [axis[0].name for axis in dataset.dims]
        return tuple(_DIMENSIONS.get(name, name.lstrip("/")) for name in scales)
    return (_DIMENSIONS[dataset.name],) if dataset.name in _DIMENSIONS else None


def open_result(folder: str | os.PathLike[str]) -> xarray.Dataset:
    """The result of a run as an xarray.Dataset.

    Dimensions: time (samples of the series), frame, floe, other_body (the towed body, walls), collision, event, and
    panel of the hull if the case has panels. Series keep their names; frames are floe_x, floe_y, floe_yaw, floe_speed,
    floe_contact_force, other_body_x and so on; collision_peak, event_value, panel_load and floe_vertices come from the
    groups of result.h5. Every variable has a long_name and, where available, a label. Numbers have units, except
    event_value (its unit depends on the kind) and frame_piece_pose (m, m, rad). Values are read from the file on first
    use; close it like any Dataset. The attribute `summary` holds the text of summary.json. Raises BergtowError.
    """
    xarray, _ = _imported("xarray"), _imported("h5py")
    from bergtow.result.hdf5 import opened, plain
    path = Path(folder)
    path = path / "result.h5" if path.is_dir() else path
    file = opened(path, "give the folder that a run has left")
    if "time" not in file.get("series", {}):
        file.close()
        raise BergtowError(f"{path}: holds no series of a run; give the folder that a run has left", IO)
    stored = _wrapper(xarray)
    variables: dict[str, Any] = {}

    def put(name: str, dims: tuple[str, ...], dataset: h5py.Dataset, column: int | None = None,
            part: slice | None = None, units: str | None = None, long_name: str | None = None) -> None:
        a = dict(dataset.attrs)
        attributes = {"long_name": long_name or plain(a.get("description", name.replace("_", " ")))}
        if "label" in a:
            attributes["label"] = plain(a["label"])
        assert name not in variables, name
        texts = dataset.dtype.kind == "O"
        values = [plain(v) for v in dataset[()]] if texts else stored(dataset, column, part)
        if not texts and (units or "units" in a):
            attributes["units"] = units or plain(a["units"])
        variables[name] = xarray.Variable(dims, values, attributes)

    for group, prefix in _GROUPS.items():
        for name, dataset in file.get(group, {}).items():
            if (dims := _dims(dataset)) is not None:
                put({"bodies/names": "other_body_name"}.get(f"{group}/{name}", prefix + name), dims, dataset)
    if "frames" in file:
        frames, n = file["frames"], len(file["floes/area"])
        put("frame_time", ("frame",), frames["time"], long_name="time of the frame")
        for of, data in (("floe", "pose"), ("other_body", "body_pose")):
            for k, (axis, units, words) in enumerate(_POSE):
                put(f"{of}_{axis}", ("frame", of), frames[data], k, None, units, words)
        put("floe_contact_force", ("frame", "floe"), frames["contact_force"])
        meanings = {"speed": "speed of the centroid", "velocity": "velocity of the centroid",
                    "net_force": "sum of all contact forces in the step"}
        for name in meanings.keys() & set(frames):
            for of, part in (("floe", slice(0, n)), ("other_body", slice(n, frames[name].shape[1]))):
                dims = ("frame", of, "xy")[:frames[name].ndim]
                put(f"{of}_{name}", dims, frames[name], None, part, long_name=meanings[name])
        for name in frames:  # pieces of floes that split, concatenated over frames
            if name.startswith("piece") and (dims := _dims(frames[name])) is not None:
                put(f"frame_{name}", dims, frames[name])
        if "line_points" in frames:
            put("line_points", ("frame", "line_point", "xy"), frames["line_points"])
            put("branch_tension", ("frame", "branch"), frames["line_tension"])
    if any("xy" in v.dims for v in variables.values()):
        variables["xy"] = xarray.Variable(("xy",), ["x", "y"], {"long_name": "component of a vector"})
    attributes = {name: plain(value) for name, value in file.attrs.items()}
    summary = path.with_name("summary.json")
    if summary.exists():
        attributes["summary"] = summary.read_text(encoding="utf-8")
    coordinates = "time", "frame_time", "collision_time", "event_time", "other_body_name"
    return _dataset(variables, [n for n in coordinates if n in variables], attributes, file)
