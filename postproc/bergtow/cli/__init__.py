# SPDX-License-Identifier: MIT
"""The command line: the modules behind the commands, messages and exit codes.

A command is a module with options(p), which adds its options to a parser, and perform(a). Any other command line is
passed unchanged to the compiled program.
"""
import os
import sys
from importlib import import_module

from bergtow.cli import command
from bergtow._program import program_path

#: {command: (module, its help text)}
COMMANDS = {
    "report": ("reporting.page", "write the report of a run, with a replay, or of an ensemble, as a page or as PDF"),
    "design": ("reporting.design",
               "write the report of the design tow force of a case or a study, as a page and as PDF"),
    "statistics": ("reporting.statistics",
                   "statistics of an ensemble: design force, loads, intervals, in tables and files"),
    "converge": ("study.converge", "find out how a result depends on numerical settings: domain width and length, "
                 "time step, tolerance, start-up"),
    "budget": ("study.budget", "find out how much of the scatter comes from the fields, each assumed value, and "
               "numerical error"),
    "capability": ("study.capability", "find out how fast a vessel can tow in given ice, and what ice stops it"),
    "route": ("routing.route",
              "plan the path and the speed of a tow through known ice, and verify them by simulated tows"),
    "outlines": ("maps.outlines",
                 "convert a map of the ice (outlines or an image of labels) into floes for ice.outlines"),
    "export": ("maps.export", "export floes, tracks and loads of a run to GIS formats: GeoPackage, GeoJSON, "
               "shapefile, trajectories"),
    "contents": ("result.contents", "list the contents of the folder of a run"),
    "film": ("plot.film", "make a film of a run"),
    "plot-force": ("plot.force", "draw the forces of a run against time"),
    "plot-field": ("plot.field", "draw the ice field before, during and after the tow"),
    "plot-impacts": ("plot.impacts", "draw the loads around the hull by panel, and the exceedance of peaks"),
    "plot-resistance": ("plot.resistance", "draw the mean ice resistance of runs against the concentration, beside "
                        "the estimates"),
    "plot-chains": ("plot.chains", "draw the force chains of one step"),
    "plot-ensemble": ("plot.ensemble", "plot an ensemble: every picture for which its study has the data"),
}
#: options whose value may begin with a minus sign: a western longitude or a negative label is not an option
SIGNED = ("--centre", "--heading", "--water", "--unseen", "--footprint", "--from", "--to")


def _joined(words):
    """Replace --option -1 with --option=-1."""
    out = []
    for word in words:
        if out and out[-1] in SIGNED and word[:1] == "-":
            out[-1] += f"={word}"
        else:
            out.append(word)
    return out


def tree(name=None):
    """The parser of all commands, with options for `name` only, so that the other modules need not be loaded."""
    p = command.Parser(prog="bergtow", description="Commands of the Python package bergtow; for those of the program "
                       "see bergtow --help.")
    some = p.add_subparsers(metavar="COMMAND", required=True)
    for other, (module, about) in COMMANDS.items():
        q = some.add_parser(other, help=about, description=f"{about[0].upper()}{about[1:]}.")
        if other == name:
            found = import_module(f"bergtow.{module}")
            found.options(q)
            q.set_defaults(perform=found.perform)
    return p


def arguments(name, *words):
    """Parse the options of a command. Raises BergtowError; SystemExit for --help."""
    return tree(name).parse_args([name, *_joined(map(os.fspath, words))])


def perform(name, *words):
    """Run a command in this process. Raises the same errors as arguments()."""
    a = arguments(name, *words)
    a.perform(a)


def main():
    """Entry point of python3 -m bergtow and of the console command."""
    words = sys.argv[1:]
    if words and words[0] in COMMANDS:
        command.guarded(f"bergtow {words[0]}", lambda: perform(*words))
    else:
        command.guarded("bergtow", lambda: _program(words))


def _program(words):
    """Replace this process with the compiled program."""
    sys.stdout.flush()
    path = program_path()
    os.execv(path, [path, *words])
