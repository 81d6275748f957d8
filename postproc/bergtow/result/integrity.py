# SPDX-License-Identifier: MIT
"""Are the files of runs and ensembles as the program left them? The library checks seals and the records of finished
runs (bergtow/simulation.h: bt_seal_check, bt_record_check)."""
import os

from bergtow import _library
from bergtow.errors import BergtowError


def check_seal(path, kind):
    """kind: "ensemble", "result", ... Raises BergtowError."""
    _library.library().bt_seal_check(os.fsencode(path), kind.encode())


def fault_of_member(folder, name, made_by):
    """The fault in the files of a finished run, compared with its record; None if they are sound."""
    try:
        _library.library().bt_record_check(os.fsencode(folder), name.encode(), made_by, len(made_by))
    except BergtowError as error:
        return str(error).splitlines()[0].removeprefix(f"{folder}/")
    return None
