# SPDX-License-Identifier: MIT
"""The commands as Python functions: pictures, statistics, reports, outlines, and studies that start runs.

They run in this process, with the code of the commands, and draw on matplotlib Figures without pyplot. So they neither
use nor change the backend and fonts that a program has chosen. To draw on your own axes, use open_result().
"""
from __future__ import annotations

import html
import json
import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

from .arguments import ends_in
from .case import here, setting
from .errors import IO, BergtowError
from .said import collected
from .writing import PICTURES, written

if TYPE_CHECKING:
    from .result.dataset import Result
    from .study.ensemble import Ensemble

#: a folder, given by its path or by an object that represents it
Of = Union[str, "os.PathLike[str]", "Result", "Ensemble"]


def _folder(of: Of) -> str:
    """Its path, absolute because a Picture may be drawn again from another working folder."""
    return os.path.join(here(), of if isinstance(of, (str, os.PathLike)) else of.folder)


#: options that a command line repeats, instead of giving several values to one
_REPEATED = ("exclude", "also", "of", "no_go")
#: options of the commands that the functions set themselves, and what to use instead. A second value would win: over
#: the place where a function looks for its result, and with --force over any file
_OWN = {"output": "the place is an argument, and that of a picture one of save()",
        "force": "use replace=True, of save() too",
        "record": "use .record of the result", "picture": "use .picture() of the result",
        "format": "use save() of a picture, whose file name has it", "help": "see the command's --help"}


def _words(options: Mapping[str, Any]) -> list[str]:
    """Options as command-line words: {"time_scale": 10, "linear": True, "times": [1, 2]} -> --time-scale=10 --linear
    ..., and {"set": {"run.dt": "0.1 s"}} -> --set=run.dt=0.1 s. Raises BergtowError for those of _OWN."""
    words = []
    for name, value in options.items():
        name = name.rstrip("_")
        if name in _OWN:
            raise BergtowError(f"{name}: no option of this function; {_OWN[name]}")
        flag = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            words.append(flag)
        elif isinstance(value, Mapping):
            words += [f"{flag}={key}={setting(key, some)}" for key, some in value.items()]
        elif name in _REPEATED or not isinstance(value, (list, tuple)):
            words += [f"{flag}={v}" for v in (value if isinstance(value, (list, tuple)) else [value])]
        else:
            words += [flag, *map(str, value)]
    return words


def _perform(command: str, *words: str | os.PathLike[str]) -> None:
    from . import cli  # imported here because cli needs the functions of this module
    from .cli import missing_packages
    from .cli.command import of_system
    try:
        cli.perform(command, *words)
    except ModuleNotFoundError as error:
        raise BergtowError(missing_packages.message(error), IO) from None
    except OSError as error:
        raise BergtowError(of_system(error), IO) from None


def _call(command: str, *words: str | os.PathLike[str]) -> str:
    """The text that a command prints. Raises BergtowError."""
    with collected() as text:
        _perform(command, *words)
    return text.getvalue()


class Picture:
    """A picture: notebooks display it, save() writes it."""

    def __init__(self, draw: Callable[[Path], Any]) -> None:
        self._draw = draw
        self._kept: dict[str, bytes] = {}

    def _data(self, kind: str) -> bytes:
        if kind not in self._kept:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / f"picture.{kind}"
                self._draw(path)
                self._kept[kind] = path.read_bytes()
        return self._kept[kind]

    def save(self, file: str | os.PathLike[str], *, replace: bool = False) -> Path:
        """Write the picture to a file that ends in .png, .pdf or .svg, with its folder if that is missing, and return
        its path. A .png is the picture as displayed; the other formats are drawn from the contents that the result
        folder has when they are first asked for. replace: overwrite a file even if bergtow did not make it."""
        path = Path(file)
        ends_in(path, PICTURES)
        with written(path, replace, ("give another path", "replace=True")) as new:
            new.write_bytes(self._data(path.suffix.lower().lstrip(".")))
        return path

    def _repr_png_(self) -> bytes:
        return self._data("png")


def _drawn(draw: Callable[[Path], Any]) -> Picture:
    picture = Picture(draw)
    picture._repr_png_()  # errors in drawing show up now
    return picture


def _picture(command: str, options: Mapping[str, Any], *arguments: str | os.PathLike[str]) -> Picture:
    return _drawn(lambda path: _call(command, *arguments, "-o", path, "--force", *_words(options)))


def plot_force(run: Of, **options: Any) -> Picture:
    """Forces of a run against time. run: its folder or Result. options: those of bergtow plot-force, e.g. max=100."""
    return _picture("plot-force", options, _folder(run))


def plot_field(run: Of, **options: Any) -> Picture:
    """The ice before, during and after the tow. options: colour="speed", "force" or "thickness", times=[s, ...],
    window="whole" or "body"."""
    return _picture("plot-field", options, _folder(run))


def plot_impacts(run: Of) -> Picture:
    """Loads around the hull by panel, and the exceedance of collision peaks."""
    return _picture("plot-impacts", {}, _folder(run))


def plot_resistance(runs: Of | list[Of] | tuple[Of, ...], **options: Any) -> Picture:
    """Mean ice resistance of runs against the concentration, with the estimates. options: linear=True."""
    several = runs if isinstance(runs, (list, tuple)) else [runs]
    return _picture("plot-resistance", options, *map(_folder, several))


def plot_chains(run: Of, contacts: str | os.PathLike[str], **options: Any) -> Picture:
    """The contact forces of one step. contacts: the file that --dump-contacts wrote. options: whole=True."""
    return _picture("plot-chains", options, _folder(run), os.path.join(here(), contacts))


def plot_ensemble(ensemble: Of, **options: Any) -> dict[str, Picture]:
    """The pictures that a study allows, as {name: Picture}. ensemble: its folder or Ensemble. options: those of bergtow
    plot-ensemble, such as time_scale=10."""
    def draw_all(kind: str) -> dict[str, bytes]:
        with tempfile.TemporaryDirectory() as there:
            _call("plot-ensemble", _folder(ensemble), "-o", there, "--format", kind, *_words(options))
            return {p.stem: p.read_bytes() for p in sorted(Path(there).glob(f"*.{kind}"))}

    drawn = {"png": draw_all("png")}

    def of(name: str) -> Picture:
        def draw(path: Path) -> None:
            kind = path.suffix.lower().lstrip(".")
            if kind not in drawn:
                drawn[kind] = draw_all(kind)
            path.write_bytes(drawn[kind][name])
        return Picture(draw)

    return {name: of(name) for name in drawn["png"]}


def statistics(ensemble: Of, **options: Any) -> dict[str, Any]:
    """The statistics of an ensemble, as a dictionary with the layout of statistics.json: {"conditions": [...], ...}.
    options: those of bergtow statistics, such as time_scale=10, hours=[1, 10], exclude="jammed". Missing members are
    listed in "holes"."""
    with tempfile.TemporaryDirectory() as there:
        _call("statistics", _folder(ensemble), "-o", there, "--partial", *_words(options))
        return json.loads((Path(there) / "statistics.json").read_text(encoding="utf-8"))


def report(of: Of, file: str | os.PathLike[str] | None = None, *, replace: bool = False, **options: Any) -> Path:
    """Write the report of a run or an ensemble, and return its path. of: a folder, Result or Ensemble. file: .html or
    .pdf; by default report.html in the folder. replace: overwrite a file even if it is not a report of bergtow.
    options: those of bergtow report, such as client="...", size=20."""
    path = Path(file) if file is not None else Path(_folder(of)) / "report.html"
    _call("report", _folder(of), "-o", path, *["--force"] * replace, *_words(options))
    return path


class Outlines:
    """The result of `outlines`: `map`, and `file`, the GeoJSON for ice.outlines, both absolute; `record`, all numbers
    as a dictionary (coordinates, plane, changes with areas, floes); `text`, the same in words, with lines for a case.
    """

    def __init__(self, map: str | os.PathLike[str], file: str | os.PathLike[str], record: dict[str, Any], text: str,
                 options: list[str]) -> None:
        self.map, self.file = Path(here(), map), Path(here(), file)
        self.record, self.text, self._options = record, text, options

    def picture(self) -> Picture:
        """The map next to the floes, with the parts that were left out."""
        def draw(path: Path) -> None:
            with tempfile.TemporaryDirectory() as there:
                _call("outlines", self.map, "-o", Path(there) / "x.geojson", "--picture", path, "--force",
                      *self._options)
        return _drawn(draw)

    def __repr__(self) -> str:
        return f"<bergtow.Outlines {self.file}>"

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(repr(self))}</p><pre>{html.escape(self.text)}</pre>"


def outlines(map: str | os.PathLike[str], file: str | os.PathLike[str], *, replace: bool = False,
             **options: Any) -> Outlines:
    """Make floe outlines for a case from a map: any vector format that GDAL reads (shapefile, GeoPackage, ...) or an
    image of labels, in any coordinate reference system. Outlines are repaired, and every change is counted.

        floes = bergtow.outlines("mosaic.gpkg", "floes.geojson", centre=(-12, 80), box=("1.1 km", "900 m"))
        case = bergtow.Case({"ice": {"outlines": "floes.geojson", ...}, ...})

    file: GeoJSON to write. options: those of `bergtow outlines`, where pairs may be tuples: centre, heading, crs,
    layer, where, thickness, water, unseen, footprint, band, pixel, box, clear, cut, stairs, tolerance, least. Needs
    GDAL, pyproj and shapely. Raises BergtowError, which names the missing option if the map is ambiguous.
    """
    known = {name: ",".join(str(v) for v in value) if isinstance(value, (list, tuple)) else value
             for name, value in options.items()}
    words = _words(known)
    with tempfile.TemporaryDirectory() as there:
        record = Path(there) / "record.json"
        text = _call("outlines", map, "-o", file, "--record", record, *["--force"] * replace, *words)
        text = text.replace(f"{record}\n", "")
        return Outlines(map, file, json.loads(record.read_text(encoding="utf-8")), text, words)


def export(run: Of, file: str | os.PathLike[str], *, replace: bool = False, **options: Any) -> Path:
    """Write floes, tracks and loads of a run for use on a map, and return the file's path. run: a folder or Result.
    file: .gpkg, .geojson or .shp (all but .geojson need GDAL), or .csv or .nc for trajectories. options: those of
    `bergtow export`, such as time=600, layer="tracks", start="2027-03-01"."""
    _call("export", _folder(run), "-o", file, *["--force"] * replace, *_words(options))
    return Path(file)


def _found(command: str, file: str | os.PathLike[str], out: str | os.PathLike[str], replace: bool,
           options: Mapping[str, Any], name: str | None = None) -> dict[str, Any]:
    _perform(command, file, "-o", out, *["--force"] * replace, *_words(options))
    return json.loads((Path(out) / f"{name or command}.json").read_text(encoding="utf-8"))


def converge(case: str | os.PathLike[str], out: str | os.PathLike[str], *, replace: bool = False,
             **options: Any) -> dict[str, Any]:
    """How a result depends on the numerical settings, as the dictionary in OUT/converge.json. options: those of
    `bergtow converge`, such as budget=10, vary="width,dt", set={"tow.speed": 0.5}."""
    return _found("converge", case, out, replace, options)


def budget(study: str | os.PathLike[str], out: str | os.PathLike[str], *, replace: bool = False,
           **options: Any) -> dict[str, Any]:
    """The uncertainty budget of a study, as the dictionary in OUT/budget.json. options: those of `bergtow budget`."""
    return _found("budget", study, out, replace, options)


def capability(case: str | os.PathLike[str], out: str | os.PathLike[str], *, replace: bool = False,
               **options: Any) -> dict[str, Any]:
    """How fast a vessel can tow in which ice, and which ice stops it, as the dictionary in OUT/capability.json.
    options: those of `bergtow capability`; `from_` and `to` give its range."""
    return _found("capability", case, out, replace, options)


def _place(value: Any) -> str:
    """A position or a line as an option: (3000, 400) or ((3000, -100), (3000, 100)), m; text is left unchanged."""
    if isinstance(value, str):
        return value
    return (":" if hasattr(value[0], "__len__") else ",").join(_place(v) if hasattr(v, "__len__") else repr(float(v))
                                                               for v in value)


def route(case: str | os.PathLike[str], out: str | os.PathLike[str], *, to: Any, replace: bool = False,
          **options: Any) -> dict[str, Any]:
    """The route and speed of a tow through known ice, as the dictionary in OUT/route.json. to: the goal, as (x, y) in
    m, as the two end points of a line, or as text for `bergtow route`, "20.1E,76.5N". options: those of `bergtow
    route`, such as from_=(0, 0), no_go=["land.geojson"], members=1, plan_only=True."""
    places = {k: _place(v) for k, v in {"to": to, "from_": options.pop("from_", None)}.items() if v is not None}
    speeds = options.get("speeds")
    if isinstance(speeds, (list, tuple)):
        options["speeds"] = ",".join(map(str, speeds))
    return _found("route", case, out, replace, places | options)


def design(case: str | os.PathLike[str], out: str | os.PathLike[str], *, replace: bool = False,
           **options: Any) -> dict[str, Any]:
    """The requirements of a tow: tow force with interval or a named fall-back, load cases, ramp, vessel, line, speeds,
    as the dictionary in OUT/answer.json; OUT/report.html presents it. options: those of `bergtow design`, such as
    budget=14, vessel="110 t", speeds="0.8 kn,1.3 kn", no_pdf=True."""
    return _found("design", case, out, replace, options, "answer")
