# SPDX-License-Identifier: MIT
"""The command line: the modules of the commands, messages and exit codes.

A command is a module with options(p), which adds its options to a parser, and perform(a). Any other command belongs to
the program, which gets the whole line.
"""
import os
import sys
from contextlib import nullcontext
from importlib import import_module

from bergtow.cli import command
from bergtow._program import program_path

#: {command: (module, its help text)}
COMMANDS = {
    "report": ("reporting.page", "write the report of a run, with a replay, or of an ensemble, as a page or as PDF"),
    "design": ("reporting.design",
               "from a case or a study to the report of the design tow force, as a page and as PDF"),
    "statistics": ("reporting.statistics",
                   "statistics of an ensemble: design force, loads, intervals, in tables and files"),
    "converge": ("study.converge", "find out what of the computation a result depends on: width, length, time step, "
                 "tolerance, start"),
    "budget": ("study.budget", "find out how much of the scatter is of the fields, of each assumed value, of the "
               "computation"),
    "capability": ("study.capability", "find out how fast a vessel tows in which ice, and the ice that stops it"),
    "route": ("routing.route", "plan the way and the speed of a tow through known ice, and verify them by tows"),
    "outlines": ("maps.outlines", "from a map of the ice, outlines or an image of labels, to floes for ice.outlines"),
    "export": ("maps.export", "write floes, tracks and loads of a run for the map: GeoPackage, GeoJSON, shapefile, "
               "trajectories"),
    "contents": ("result.contents", "list what the folder of a run holds"),
    "film": ("plot.film", "make a film of a run"),
    "plot-force": ("plot.force", "draw the forces of a run against time"),
    "plot-field": ("plot.field", "draw the ice field before, during and after the tow"),
    "plot-impacts": ("plot.impacts", "draw the loads around the hull by panel, and the exceedance of peaks"),
    "plot-resistance": ("plot.resistance", "draw the mean ice resistance of runs against the concentration, beside "
                        "the estimates"),
    "plot-chains": ("plot.chains", "draw the force chains of one step"),
    "plot-ensemble": ("plot.ensemble", "draw the pictures of an ensemble that its study supports"),
}
#: options whose value may begin with a minus: a western longitude is no option, nor is a negative label
SIGNED = ("--centre", "--heading", "--water", "--unseen", "--footprint", "--from", "--to")


def _joined(words):
    """With --option=-1 in place of --option -1."""
    out = []
    for word in words:
        if out and out[-1] in SIGNED and word[:1] == "-":
            out[-1] += f"={word}"
        else:
            out.append(word)
    return out


def tree(name=None):
    """The parser of all commands; the options of `name` alone, so that the modules of the others need not be loaded."""
    p = command.Parser(prog="bergtow", description="Commands of the Python package bergtow; all others are those of "
                       "the program, see bergtow --help.")
    some = p.add_subparsers(metavar="COMMAND", required=True)
    for other, (module, about) in COMMANDS.items():
        q = some.add_parser(other, help=about, description=f"{about[0].upper()}{about[1:]}.")
        if other == name:
            found = import_module(f"bergtow.{module}")
            found.options(q)
            q.set_defaults(perform=found.perform)
    return p


def arguments(name, *words):
    """The options of a command. Errors: BergtowError; SystemExit of --help."""
    return tree(name).parse_args([name, *_joined(map(os.fspath, words))])


def perform(name, *words):
    """A command, within this process. Errors: as arguments()."""
    a = arguments(name, *words)
    with _look():
        a.perform(a)


def _look():
    """The look of pictures; a command that draws nothing does without matplotlib."""
    try:
        from bergtow.plot import style
    except ModuleNotFoundError:
        return nullcontext()
    return style.look()


def main():
    """The program of python3 -m bergtow, and the console command."""
    words = sys.argv[1:]
    if words and words[0] in COMMANDS:
        command.guarded(f"bergtow {words[0]}", lambda: perform(*words))
    else:
        command.guarded("bergtow", lambda: _program(words))


def _program(words):
    """The program in place of this process."""
    sys.stdout.flush()
    path = program_path()
    os.execv(path, [path, *words])
