# SPDX-License-Identifier: MIT
"""A message in place of a traceback where Python lacks a package; set by `command`, which scripts import first."""
import sys
from pathlib import Path

#: packages whose names differ from those of their modules: (Debian, PyPI)
NAMES = {"PIL": ("python3-pil", "pillow"), "yaml": ("python3-yaml", "PyYAML"), "osgeo": ("python3-gdal", "gdal")}

#: scripts that are commands of the program, too
COMMANDS = ("budget.py", "capability.py", "converge.py", "design.py", "outlines.py")


def remedy(module):
    """What to do where a module is missing."""
    debian, pypi = NAMES.get(module, (f"python3-{module}", module))
    other = "" if sys.executable == "/usr/bin/python3" else "; or start it by /usr/bin/python3, if that has it"
    return f"install {debian} (Debian), or `{sys.executable or 'python3'} -m pip install {pypi}`{other}"


def program():
    """How this script is called, for messages and --help: some are commands of bergtow."""
    script = Path(sys.argv[0])
    return f"bergtow {script.stem}" if script.name in COMMANDS else script.name


def hook(kind, error, trace):
    """sys.excepthook: ends with exit code 4 where a package is missing."""
    module = (getattr(error, "name", None) or "").partition(".")[0]
    own = (Path(__file__).parent / f"{module}.py").exists()
    if not issubclass(kind, ModuleNotFoundError) or not module or own:
        return sys.__excepthook__(kind, error, trace)
    print(f"{program()}: {module} is missing in {sys.executable} (Python {sys.version.split()[0]}); "
          f"{remedy(module)}", file=sys.stderr)
    raise SystemExit(4)

