# SPDX-License-Identifier: MIT
"""Pictures, statistics and reports of results, as functions.

They are made by the scripts of the commands (postproc/*.py), each in a process of its own: what a program has chosen
for its own pictures (backend of matplotlib, fonts, modules named `style`) is neither used nor touched, and a picture
here is the one that the command makes. Whoever wants other axes draws them from open_result().
"""
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from ._library import OK, BergtowError


def _scripts():
    """The folder of the scripts: in a wheel within this package, else the folder that this package lies in."""
    here = Path(__file__).resolve().parent
    return next((p for p in (here / "scripts", here.parent) if (p / "report.py").is_file()), here.parent)


def _folder(of):
    return os.fspath(getattr(of, "folder", of))


#: options that a command takes several times, not once with several values
_REPEATED = ("exclude", "also")


def _words(options):
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


def _call(script, *arguments):
    """Run a script and return what it printed. Errors: BergtowError with its message."""
    done = subprocess.run([sys.executable, os.fspath(_scripts() / script), *map(os.fspath, arguments)],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode == OK:
        return done.stdout
    last = done.stderr.strip().splitlines()[-1:] or [f"{script} ended with {done.returncode}"]
    if last[0].startswith("ModuleNotFoundError"):
        missing = last[0].split("'")[1]
        last = [f"{missing} is missing, which pictures and reports need; install python3-{missing} (Debian), or "
                f"`pip install {missing}`"]
    raise BergtowError(last[0].removeprefix(f"{script}: ").removeprefix("error: "), done.returncode)


class Picture:
    """A picture: shown by a notebook, written by save()."""

    def __init__(self, draw):
        self._draw, self._kept = draw, {}

    def _data(self, kind):
        if kind not in self._kept:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / f"picture.{kind}"
                self._draw(path)
                self._kept[kind] = path.read_bytes()
        return self._kept[kind]

    def save(self, file):
        """Write it to a file that ends in .png, .pdf or .svg, and return its path."""
        path = Path(file)
        self._draw(path)
        return path

    def _repr_png_(self):
        return self._data("png")


def _picture(script, options, *arguments):
    picture = Picture(lambda path: _call(script, *arguments, "-o", path, "--force", *_words(options)))
    picture._repr_png_()  # what cannot be drawn is said now
    return picture


def plot_force(run, **options):
    """The forces of a run against time. run: its folder or Result. options: those of plot_force.py, as max=100."""
    return _picture("plot_force.py", options, _folder(run))


def plot_field(run, **options):
    """The ice before, during and after the tow. options: colour="speed", "force" or "thickness", times=[s, ...],
    window="whole" or "body"."""
    return _picture("plot_field.py", options, _folder(run))


def plot_impacts(run):
    """Loads around the hull by panel, and how often the peak of a collision is exceeded."""
    return _picture("plot_impacts.py", {}, _folder(run))


def plot_resistance(runs, **options):
    """Mean ice resistance of runs against the concentration, beside the estimates. options: linear=True."""
    runs = runs if isinstance(runs, (list, tuple)) else [runs]
    return _picture("plot_resistance.py", options, *map(_folder, runs))


def plot_chains(run, contacts, **options):
    """The contact forces of one step. contacts: the file of --dump-contacts. options: whole=True."""
    return _picture("plot_chains.py", options, _folder(run), contacts)


def plot_ensemble(ensemble, **options):
    """The pictures that a study supports, {name: Picture}. ensemble: its folder or Ensemble. options: those of
    plot_ensemble.py, as time_scale=10."""
    def draw_all(kind):
        with tempfile.TemporaryDirectory() as there:
            _call("plot_ensemble.py", _folder(ensemble), "-o", there, "--format", kind, *_words(options))
            return {p.stem: p.read_bytes() for p in sorted(Path(there).glob(f"*.{kind}"))}

    drawn = {"png": draw_all("png")}

    def of(name):
        def draw(path):
            kind = path.suffix.lower().lstrip(".")
            if kind not in drawn:
                drawn[kind] = draw_all(kind)
            path.write_bytes(drawn[kind][name])
        return Picture(draw)

    return {name: of(name) for name in drawn["png"]}


def statistics(ensemble, **options):
    """The statistics of an ensemble, a dictionary as statistics.json has it: {"conditions": [...], ...}. options: those
    of ensemble.py, as time_scale=10, hours=[1, 10], exclude="jammed". Members that are missing are named in "holes"."""
    with tempfile.TemporaryDirectory() as there:
        _call("ensemble.py", _folder(ensemble), "-o", there, "--partial", *_words(options))
        return json.loads((Path(there) / "statistics.json").read_text())


def report(of, file=None, *, replace=False, **options):
    """Write the report of a run or an ensemble, and return its path. of: a folder, Result or Ensemble. file: .html or
    .pdf, report.html in the folder without. replace: a file there that is not a report of ours, too. options: those of
    report.py, as client="...", size=20."""
    path = Path(file) if file is not None else Path(_folder(of)) / "report.html"
    _call("report.py", _folder(of), "-o", path, *(["--force"] if replace else []), *_words(options))
    return path


def report_command():
    """The command `bergtow-report`: report.py with the arguments of the program."""
    sys.path.insert(0, os.fspath(_scripts()))
    sys.argv[0] = "bergtow-report"
    import command
    import report as script
    command.guarded(script.main)
