# SPDX-License-Identifier: MIT
"""Ensembles: many runs of a study in one folder, as a Dataset and as a table."""
from __future__ import annotations

import html
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bergtow._calls import called
from bergtow._program import program_path
from bergtow.case import here, setting
from bergtow.errors import IO, OK, BergtowError
from bergtow.functions import Picture, plot_ensemble, report, statistics
from bergtow.result.dataset import Result, _dataset, _imported, _wrapper
from bergtow.study.workers import on_workers

if TYPE_CHECKING:
    import h5py
    import pandas
    import xarray

#: status of a member
STATUS = {1: "finished", 2: "failed", 0: "waiting"}


class Ensemble:
    """The folder of an ensemble.

        ensemble = bergtow.Ensemble.run("study.yml", "out/study")     # the same call continues a stopped study
        ensemble.dataframe.groupby("tow.speed")["mean_ice_resistance_n"].agg(["mean", "sem", "count"])
        ensemble.dataset.ice_resistance.sel(member=0)                 # the series of a member, N

    Failed and waiting members are included; their numbers are NaN.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(here(), folder)  # the working folder may change
        if not (self.folder / "ensemble.h5").is_file():
            raise BergtowError(f"{self.folder}: holds no ensemble.h5; give the folder that `bergtow ensemble` has left",
                               IO)

    @classmethod
    def run(cls, study: str | os.PathLike[str], out: str | os.PathLike[str], *,
            overrides: Mapping[str, Any] | None = None, threads: int = 0, retry_failed: bool = False,
            progress: bool = True, client: Any = None, tasks: int = 0) -> Ensemble:
        """Run the open members of a study, and return the Ensemble.

        out: the folder, new or to be continued. overrides: {key: value} for all members, with values as for a Case.
        progress: print a line for each member. Ctrl-C stops it like `bergtow ensemble`: with checkpoints, so that it
        can be continued. Raises BergtowError with the messages of the program, also if a member has failed after all
        others have finished.

        client: a dask.distributed.Client whose workers see the same folders and the same program; without it a single
        process uses all cores here. tasks: number of calls of the program that share the members, with `threads` (1)
        each; by default as many as the workers have threads for. If a worker dies, its members lose the steps since
        their last checkpoint, and are continued by another task or by the final call, which is made here.
        """
        command = [program_path(), "ensemble", os.path.abspath(study), "-o", os.path.abspath(out)]
        for key, value in (overrides or {}).items():
            command += ["--set", f"{key}={setting(key, value)}"]
        command += ["--retry-failed"] if retry_failed else []
        if client is not None:
            on_workers(client, [*command, "--threads", str(threads or 1), "--no-wait"], out, tasks, threads, progress)
            command = [word for word in command if word != "--retry-failed"]
        command += ["--threads", str(threads)] if threads else []
        # in a separate process group, so that a Ctrl-C is handled here and reaches the program only once
        code, errors = called(command, lambda text: progress and print(text, end="", flush=True),
                                   start_new_session=True)
        if code != OK:
            raise BergtowError(errors.strip() or f"bergtow ensemble ended with {code}", code)
        return cls(out)

    def _open(self) -> h5py.File:
        _imported("h5py")
        from bergtow.result.hdf5 import opened
        return opened(self.folder / "ensemble.h5", "run `bergtow ensemble` again: it makes the file again")

    @property
    def counts(self) -> dict[str, int]:
        """Number of members with each status: {"finished": 8, "failed": 0, "waiting": 0}."""
        with self._open() as file:
            status = file["members/status"][()].tolist()
        return {word: status.count(code) for code, word in STATUS.items()}

    def result(self, name: str) -> Result:
        """The Result of a member by its name, such as "c001-r001"."""
        folder = self.folder / "members" / name
        if not folder.is_dir():
            raise BergtowError(f"{self.folder}: has no member {name}", IO)
        return Result(folder)

    @property
    def dataset(self) -> xarray.Dataset:
        """An xarray.Dataset that is read lazily; close it like any Dataset.

        Dimensions: member, and sample (samples of the series). Coordinates: name, condition, repeat, seed of each
        member, and the keys that the study varies. Variables: the numbers of summary.json, the series, state_hash,
        status and reason. All have a long_name, numbers also units.
        """
        xarray, file = _imported("xarray"), self._open()
        from bergtow.result.hdf5 import plain
        stored = _wrapper(xarray)
        variables: dict[str, Any] = {}
        coordinates: list[str] = []
        for group in ("members", "parameters", "summary", "series"):
            for name, dataset in file.get(group, {}).items():
                if name == "id":
                    continue
                attributes = {k: plain(dataset.attrs[k]) for k in ("units", "long_name") if k in dataset.attrs}
                name = f"series_{name}" if name in variables else name
                dims = ("member", "sample")[:dataset.ndim]
                values = [plain(v) for v in dataset[()]] if dataset.dtype.kind == "O" else stored(dataset)
                variables[name] = xarray.Variable(dims, values, attributes)
                if group == "parameters" or name in ("name", "condition", "repeat", "seed"):
                    coordinates.append(name)
        attributes = {name: plain(value) for name, value in file.attrs.items()}
        attributes["study"] = plain(file["study"][()])
        return _dataset(variables, coordinates, attributes, file)

    @property
    def dataframe(self) -> pandas.DataFrame:
        """A pandas.DataFrame, one row per member, indexed by name: the varied keys, then the numbers of
        summary.json."""
        pandas = _imported("pandas")
        with self.dataset as d:
            flat = {name: v.values for name, v in d.variables.items() if v.dims == ("member",)}
            first = [name for name in d.coords if name in flat and name != "name"]
        rest = [name for name in flat if name not in first and name != "name"]
        return pandas.DataFrame({n: flat[n] for n in first + rest}, index=pandas.Index(flat["name"], name="member"))

    def statistics(self, **options: Any) -> dict[str, Any]:
        """bergtow.statistics(self, ...)"""
        return statistics(self, **options)

    def plot(self, **options: Any) -> dict[str, Picture]:
        """bergtow.plot_ensemble(self, ...)"""
        return plot_ensemble(self, **options)

    def report(self, file: str | os.PathLike[str] | None = None, **options: Any) -> Path:
        """bergtow.report(self, file, ...)"""
        return report(self, file, **options)

    def __repr__(self) -> str:
        said = ", ".join(f"{n} {word}" for word, n in self.counts.items())
        return f"<bergtow.Ensemble {self.folder}: {said}>"

    def _repr_html_(self) -> str:
        with self.dataset as d:
            varied = [name for name in d.coords if name not in ("name", "condition", "repeat")]
        shown = "mean_ice_resistance_n", "mean_tow_force_n", "peak_tow_force_n", "unconverged_steps"
        table = self.dataframe
        columns = varied + [name for name in shown if name in table]
        return f"<p>{html.escape(repr(self))}</p>" + table[columns].to_html(max_rows=12)
