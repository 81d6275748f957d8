# SPDX-License-Identifier: MIT
"""The analyses converge, budget and capability: their options, and the result of each as NAME.json in a folder,
NAME.png if it can be drawn, text at the terminal, and a chapter of the report.

The words of NAME are in text/NAME.py: content(found), and figure(found) if it can be drawn; `found` is as read from the
file, with None for numbers that are not finite.
"""
import os

from bergtow import arguments, writing
from bergtow.errors import RunError
from bergtow.table import Warned, written
from bergtow.text import budget as budget_text
from bergtow.text import capability as capability_text
from bergtow.text import converge as converge_text

#: headings and modules with the words, in the order of a report
KINDS = {"converge": ("Convergence", converge_text), "budget": ("Uncertainty budget", budget_text),
         "capability": ("Towing capability", capability_text)}


def add_options(p, minutes):
    """Add --budget, --set, --jobs, --force."""
    p.add_argument("--budget", type=arguments.minutes, default=minutes, metavar="MIN",
                   help=f"wall time, min (default {minutes:g}); repeat the command to continue")
    add_runs(p)


def add_runs(p):
    """Add --set, --jobs, --force."""
    p.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="replace a value of the case")
    p.add_argument("--jobs", type=arguments.at_least_one, default=len(os.sched_getaffinity(0)), metavar="N",
                   help="runs at a time (default: the number of cores)")
    arguments.add_force(p)


def _files(name, folder):
    return [folder / f"{name}{end}" for end in ((".json", ".png") if hasattr(KINDS[name][1], "figure") else (".json",))]


def begin(name, file, kind, folder, force):
    """Check that the case or study exists, and that the results can be written. Raises RunError."""
    if not file.exists():
        raise RunError(file, "no such file", f"name a {kind} file")
    for path in _files(name, folder):
        writing.may_write(path, force)


def keep(name, found, folder, force):
    """Write a result and print it. Raises RunError."""
    words, found = KINDS[name][1], writing.plain(found)
    data, *pictures = _files(name, folder)
    writing.write_json(found, data, force)
    print(written(words.content(found)))
    print()
    for picture in pictures:
        from bergtow.plot import style
        with style.look():
            writing.save(words.figure(found), picture, force)
    print(data)


# ---- reports


def also(folders):
    """Check that the folders named by --also hold results. Raises RunError."""
    for folder in folders:
        if not any((folder / f"{name}.json").is_file() for name in KINDS):
            raise RunError(folder, f"holds none of {', '.join(f'{name}.json' for name in KINDS)}",
                           "name the folder of bergtow converge, budget or capability with --also")


def chapter(name, found):
    """{"heading", "parts", "figure"} from the result of a command, for a report; figure is a function without
    arguments, or None. found["doubt"]: why the result does not belong to the subject of the report."""
    heading, words = KINDS[name]
    draw = getattr(words, "figure", None)
    warned = [[Warned(f"{found['doubt'][0].upper()}{found['doubt'][1:]}.")]] if found.get("doubt") else []
    return {"heading": heading, "parts": warned + words.content(found), "figure": draw and (lambda: draw(found))}
