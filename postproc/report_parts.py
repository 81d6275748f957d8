# SPDX-License-Identifier: MIT
"""Parts of a report that other scripts leave beside an ensemble: convergence, uncertainty budget, towing capability.

A part is a module with block(folder), which gives {"heading", "markdown", "figure"} (figure: a function without
arguments that draws, or None), or None where its script has left nothing.
"""
import importlib
import importlib.util

import converge_text

#: modules that may have a block, each the first that there is
PARTS = (("budget_text", "budget"), ("capability_text", "capability"))


def _block(names, folder):
    for name in names:
        if importlib.util.find_spec(name):
            block = getattr(importlib.import_module(name), "block", None)
            if block:
                return block(folder)
    return None


def convergence(folder):
    """Of converge.py, in the same form; None where it has left nothing."""
    found = converge_text.of_folder(folder)
    return found and {"heading": "Convergence", "markdown": converge_text.verdicts(found, True), "figure": None}


def others(folder):
    return [found for found in (_block(names, folder) for names in PARTS) if found]
