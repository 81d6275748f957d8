# SPDX-License-Identifier: MIT
"""Are the files of runs and ensembles as the program left them? The library checks seals and the records of finished
runs (bergtow/simulation.h: bt_seal_check, bt_record_check)."""
import os

from bergtow import _library
from bergtow.errors import BergtowError, RunError

_sound = set()  #: stamps of files found sound: a result that is opened many times is read whole once


def _stamp(path):
    """What changes when a file does; None if it is missing."""
    try:
        st = os.stat(path)
    except OSError:
        return None
    return st.st_dev, st.st_ino, st.st_size, st.st_mtime_ns, st.st_ctime_ns


def check_seal(path, kind, remedy):
    """kind: "ensemble", "result", ... Raises RunError."""
    library, stamp = _library.library(), _stamp(path)
    if stamp in _sound:
        return
    try:
        library.bt_seal_check(os.fsencode(path), kind.encode())
    except BergtowError as error:
        raise RunError(path, str(error).removeprefix(f"{path}: ").partition(";")[0], remedy) from None
    _sound.add(stamp)


def fault_of_member(folder, name, made_by):
    """The fault in the files of a finished run, compared with its record; None if they are sound."""
    stamp = _stamp(os.path.join(folder, "result.h5"))
    try:
        _library.library().bt_record_check(os.fsencode(folder), name.encode(), made_by, len(made_by))
    except BergtowError as error:
        return str(error).splitlines()[0].removeprefix(f"{folder}/")
    _sound.add(stamp)  # the seal was sound when the record was made
    return None


def without_summary(folder):
    """The error about a run that has no summary.json."""
    path = os.path.join(folder, "summary.json")
    if os.path.exists(os.path.join(folder, "failure.h5")):
        return RunError(path, "missing: the run failed",
                        "failure.h5 holds the state before the step that failed: "
                        f"`bergtow resume {folder}/failure.h5` reaches that step again")
    return RunError(path, "missing: the run has not ended, or was killed",
                    f"wait for it, or continue it with `bergtow resume {folder}`")
