# SPDX-License-Identifier: MIT
"""Messages for Python packages that are missing."""
import sys

#: packages whose names differ from those of their modules: (Debian name, PyPI name)
NAMES = {"PIL": ("python3-pil", "pillow"), "yaml": ("python3-yaml", "PyYAML"), "osgeo": ("python3-gdal", "gdal")}


def remedy(module):
    """What to do if a module is missing."""
    debian, pypi = NAMES.get(module, (f"python3-{module}", module))
    other = "" if sys.executable == "/usr/bin/python3" else "; or start it by /usr/bin/python3, if that has it"
    return f"install {debian} (Debian), or `{sys.executable or 'python3'} -m pip install {pypi}`{other}"


def message(error):
    """Message for a ModuleNotFoundError. Raises the same error if the missing module is part of bergtow."""
    module = (error.name or "").partition(".")[0]
    if module in ("", "bergtow"):
        raise error
    return f"{module} is missing in {sys.executable} (Python {sys.version.split()[0]}); {remedy(module)}"
