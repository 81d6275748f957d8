# SPDX-License-Identifier: MIT
"""Pictures, statistics and reports of results, as functions.

They are made by the scripts of the commands (postproc/*.py), each in a process of its own: what a program has chosen
for its own pictures (backend of matplotlib, fonts, modules named `style`) is neither used nor touched, and a picture
here is the one that the command makes. Whoever wants other axes draws them from open_result().
"""
from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

from ._library import IO, OK, BergtowError

if TYPE_CHECKING:
    from .ensemble import Ensemble
    from .results import Result

#: a folder by its path, or what stands for it
Of = Union[str, "os.PathLike[str]", "Result", "Ensemble"]


def _scripts() -> Path:
    """The folder of the scripts: in a wheel within this package, else the folder that this package lies in."""
    here = Path(__file__).resolve().parent
    return next((p for p in (here / "scripts", here.parent) if (p / "report.py").is_file()), here.parent)


def _folder(of: Of) -> str:
    return os.fspath(of if isinstance(of, (str, os.PathLike)) else of.folder)


#: options that a command takes several times, not once with several values
_REPEATED = ("exclude", "also")


def _words(options: Mapping[str, Any]) -> list[str]:
    """Options of a command: {"time_scale": 10, "linear": True, "times": [1, 2]} -> --time-scale=10 --linear ..."""
    words = []
    for name, value in options.items():
        flag = "--" + name.rstrip("_").replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            words.append(flag)
        elif name in _REPEATED or not isinstance(value, (list, tuple)):
            words += [f"{flag}={v}" for v in (value if isinstance(value, (list, tuple)) else [value])]
        else:
            words += [flag, *map(str, value)]
    return words


def _call(script: str, *arguments: str | os.PathLike[str]) -> str:
    """Run a script and return what it printed. Errors: BergtowError with its message."""
    done = subprocess.run([sys.executable, os.fspath(_scripts() / script), *(os.fspath(a) for a in arguments)],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode == OK:
        return done.stdout
    last = done.stderr.strip().splitlines()[-1:] or [f"{script} ended with {done.returncode}"]
    raise BergtowError(last[0].removeprefix(f"{script}: ").removeprefix("error: "), done.returncode)


class Picture:
    """A picture: shown by a notebook, written by save()."""

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

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Write it to a file that ends in .png, .pdf or .svg, and return its path. A .png is the picture as shown; the
        others are drawn from the folder as it is now."""
        path = Path(file)
        if path.exists() and not path.is_file():
            raise BergtowError(f"{path}: is no regular file and is not replaced; give another name", IO)
        kind = path.suffix.lstrip(".")
        if kind in self._kept and path.parent.is_dir():
            path.write_bytes(self._kept[kind])
        else:
            self._draw(path)
        return path

    def _repr_png_(self) -> bytes:
        return self._data("png")


def _picture(script: str, options: Mapping[str, Any], *arguments: str | os.PathLike[str]) -> Picture:
    picture = Picture(lambda path: _call(script, *arguments, "-o", path, "--force", *_words(options)))
    picture._repr_png_()  # what cannot be drawn is said now
    return picture


def plot_force(run: Of, **options: Any) -> Picture:
    """The forces of a run against time. run: its folder or Result. options: those of plot_force.py, as max=100."""
    return _picture("plot_force.py", options, _folder(run))


def plot_field(run: Of, **options: Any) -> Picture:
    """The ice before, during and after the tow. options: colour="speed", "force" or "thickness", times=[s, ...],
    window="whole" or "body"."""
    return _picture("plot_field.py", options, _folder(run))


def plot_impacts(run: Of) -> Picture:
    """Loads around the hull by panel, and how often the peak of a collision is exceeded."""
    return _picture("plot_impacts.py", {}, _folder(run))


def plot_resistance(runs: Of | list[Of] | tuple[Of, ...], **options: Any) -> Picture:
    """Mean ice resistance of runs against the concentration, beside the estimates. options: linear=True."""
    several = runs if isinstance(runs, (list, tuple)) else [runs]
    return _picture("plot_resistance.py", options, *map(_folder, several))


def plot_chains(run: Of, contacts: str | os.PathLike[str], **options: Any) -> Picture:
    """The contact forces of one step. contacts: the file of --dump-contacts. options: whole=True."""
    return _picture("plot_chains.py", options, _folder(run), contacts)


def plot_ensemble(ensemble: Of, **options: Any) -> dict[str, Picture]:
    """The pictures that a study supports, {name: Picture}. ensemble: its folder or Ensemble. options: those of
    plot_ensemble.py, as time_scale=10."""
    def draw_all(kind: str) -> dict[str, bytes]:
        with tempfile.TemporaryDirectory() as there:
            _call("plot_ensemble.py", _folder(ensemble), "-o", there, "--format", kind, *_words(options))
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
    """The statistics of an ensemble, a dictionary as statistics.json has it: {"conditions": [...], ...}. options: those
    of ensemble.py, as time_scale=10, hours=[1, 10], exclude="jammed". Members that are missing are named in "holes"."""
    with tempfile.TemporaryDirectory() as there:
        _call("ensemble.py", _folder(ensemble), "-o", there, "--partial", *_words(options))
        return json.loads((Path(there) / "statistics.json").read_text(encoding="utf-8"))


def report(of: Of, file: str | os.PathLike[str] | None = None, *, replace: bool = False, **options: Any) -> Path:
    """Write the report of a run or an ensemble, and return its path. of: a folder, Result or Ensemble. file: .html or
    .pdf, report.html in the folder without. replace: a file there that is not a report of ours, too. options: those of
    report.py, as client="...", size=20."""
    path = Path(file) if file is not None else Path(_folder(of)) / "report.html"
    _call("report.py", _folder(of), "-o", path, *(["--force"] if replace else []), *_words(options))
    return path


def report_command() -> None:
    """The command `bergtow-report`: report.py with the arguments of the program."""
    sys.path.insert(0, os.fspath(_scripts()))
    sys.argv[0] = "bergtow-report"
    command, script = map(importlib.import_module, ("command", "report"))
    command.guarded(script.main)
