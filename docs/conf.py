# SPDX-License-Identifier: MIT
"""Sphinx's configuration of the manual. `make docs` stages the sources first (docs/stage.py) and builds from there."""
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "postproc"))

project = "bergtow"
author = "the authors of bergtow"
release = re.search(r'BT_VERSION "(.*)"', (ROOT / "include/bergtow/base.h").read_text())[1]
extensions = ["myst_parser", "sphinx.ext.autodoc"]
root_doc = "docs/index"
source_suffix = {".md": "markdown"}
highlight_language = "none"
language = "en"
suppress_warnings = ["epub.unknown_project_files"]

myst_enable_extensions = ["colon_fence", "fieldlist"]
myst_heading_anchors = 4

html_theme = "furo"
html_title = f"bergtow {release}"
html_static_path = ["_static"]
html_css_files = ["manual.css"]
html_copy_source = False
html_show_copyright = False

# The package is read, not run: what only its functions import may be missing.
autodoc_mock_imports = ["xarray", "h5py", "dask", "distributed"]
autodoc_member_order = "bysource"


def plain(app, what, name, obj, options, lines):
    """Docstrings are plain text: what reStructuredText would take for markup is escaped; indented lines are code."""
    out = []
    for line in lines:
        code = line.startswith("    ")
        if code and out and not out[-1].strip() and not (len(out) > 1 and out[-2].startswith("    ")):
            out += ["::", ""]
        elif line.strip() and not code and out and out[-1].startswith("    "):
            out.append("")
        out.append(line if code else re.sub(r"`([^`]+)`", r"``\1``", re.sub(r"([|*])", r"\\\1", line)))
    lines[:] = out


def setup(app):
    app.connect("autodoc-process-docstring", plain)
