# SPDX-License-Identifier: MIT
"""libbergtow by ctypes: where it is, what its functions take, and errors as exceptions.

Rejected: cffi and pybind11, which need a compiler at installation, or a package that Debian's Python lacks.
"""
from __future__ import annotations

import ctypes
import ctypes.util
import functools
import os
from ctypes import POINTER, c_bool, c_char_p, c_double, c_int, c_int64, c_size_t, c_uint64, c_void_p
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .case import Case

SONAME = "libbergtow.so.0"
OK, USAGE, CASE, IO, NUMERIC, SIGNAL = 0, 2, 3, 4, 5, 6
LOADS = 10  # BT_APPLIED_NUMBERS
CONTACT_COLUMNS = 12  # BT_CONTACT_COLUMNS


class BergtowError(Exception):
    """A call of the library that failed. status: the exit code that the command `bergtow` ends with."""

    def __init__(self, text: str, status: int = USAGE) -> None:
        super().__init__(text)
        self.status = status


class CaseError(BergtowError, ValueError):
    """A case that is refused; the text has one line for each error, with key and remedy."""


class Options(ctypes.Structure):
    """bt_simulation_options"""
    _fields_ = [("path", c_char_p), ("text", c_char_p), ("set", POINTER(c_char_p)), ("n_set", c_int),
                ("dir", c_char_p), ("replace", c_bool), ("signals", c_bool), ("progress", c_bool),
                ("threads", c_int), ("command_line", c_char_p), ("from_", c_char_p)]


class Errors(ctypes.Structure):
    """bt_errors"""
    _fields_ = [("text", POINTER(c_char_p)), ("n", c_size_t), ("cap", c_size_t)]


class Applied(ctypes.Structure):
    """bt_applied"""
    _fields_ = [("n", c_int64), ("id", POINTER(c_int64)), ("place", POINTER(c_double)),
                ("velocity", POINTER(c_double)), ("mass", POINTER(c_double)), ("inertia", POINTER(c_double)),
                ("load", POINTER(c_double)), ("time", c_double), ("dt", c_double), ("water", c_double * 2),
                ("air", c_double * 2), ("towed", c_int64)]


APPLIED_FORCE = ctypes.CFUNCTYPE(c_int, POINTER(Applied), c_void_p)

_SIGNATURES = {
    "bt_version": (c_char_p,),
    "bt_last_error": (c_char_p,),
    "bt_simulation_create": (c_int, POINTER(c_void_p), POINTER(Options)),
    "bt_simulation_resume": (c_int, POINTER(c_void_p), POINTER(Options)),
    "bt_simulation_step": (c_int, c_void_p, c_int64),
    "bt_simulation_end": (c_int, c_void_p),
    "bt_simulation_drop": (None, c_void_p),
    "bt_simulation_steps": (c_int64, c_void_p),
    "bt_simulation_steps_left": (c_int64, c_void_p),
    "bt_simulation_time": (c_double, c_void_p),
    "bt_simulation_dt": (c_double, c_void_p),
    "bt_simulation_hash": (c_uint64, c_void_p),
    "bt_simulation_checkpoint": (c_int, c_void_p),
    "bt_simulation_frame": (c_int, c_void_p),
    "bt_simulation_bodies": (c_int64, c_void_p),
    "bt_simulation_towed": (c_int64, c_void_p),
    "bt_simulation_read": (c_int, c_void_p, c_int, POINTER(c_double)),
    "bt_simulation_outline": (c_int64, c_void_p, c_int64, POINTER(c_double), c_int64),
    "bt_simulation_set_velocity": (c_int, c_void_p, c_int64, c_double, c_double, c_double),
    "bt_simulation_set_place": (c_int, c_void_p, c_int64, c_double, c_double, c_double),
    "bt_simulation_quantity": (c_int, c_void_p, c_char_p, POINTER(c_double)),
    "bt_simulation_contacts": (c_int64, c_void_p, POINTER(c_double), c_int64),
    "bt_case_check_text": (c_int, POINTER(Options), POINTER(c_void_p)),
    "bt_list_json": (c_void_p, c_char_p),
    "bt_release": (None, c_void_p),
    "bt_force_apply": (c_int, c_char_p, c_char_p, APPLIED_FORCE, c_void_p, POINTER(Errors)),
    "bt_errors_free": (None, POINTER(Errors)),
    "bt_comm_start": (c_int, c_void_p, c_void_p),
    "bt_comm_end": (c_int, c_int),
}


def _candidates() -> list[str]:
    """Where the library may be: BERGTOW_LIB alone, if that is set; else the source tree or the prefix that this package
    lies in, then wherever the linker looks."""
    named = os.environ.get("BERGTOW_LIB")
    if named:
        path = Path(named)
        return [str(path / SONAME if path.is_dir() else path)]
    here = Path(__file__).resolve().parent  # postproc/bergtow, or PREFIX/share/bergtow/postproc/bergtow
    found = [here.parents[1] / "build/release" / SONAME]
    if len(here.parents) > 3:
        found.append(here.parents[3] / "lib" / SONAME)
    return [str(p) for p in found if p.exists()] + [SONAME, ctypes.util.find_library("bergtow") or SONAME]


def library_path() -> str:
    """The file of libbergtow that is in use."""
    return load()[1]


@functools.cache
def load() -> tuple[ctypes.CDLL, str]:
    """The library with the types of its functions, and its file. Errors: BergtowError, which says what to do."""
    # Threads that spin at a barrier make a busy machine many times slower (src/app/main.c); libgomp reads this when it
    # is loaded, and what the user has set wins.
    if "OMP_WAIT_POLICY" not in os.environ:
        os.environ.setdefault("GOMP_SPINCOUNT", "5000")
    reasons = []
    for path in dict.fromkeys(_candidates()):
        try:
            lib = ctypes.CDLL(path, mode=ctypes.RTLD_GLOBAL)  # MPI opens modules that need its symbols
            break
        except OSError as error:
            reasons.append(str(error))
    else:
        raise BergtowError("libbergtow cannot be loaded (" + "; ".join(reasons) + "); build it with `make lib`, "
                           "install it with `make install`, or name its file in BERGTOW_LIB", IO)
    for name, (result, *arguments) in _SIGNATURES.items():
        function = getattr(lib, name)
        function.restype, function.argtypes = result, arguments
    from . import __version__
    version = lib.bt_version().decode()
    if version != __version__:
        raise BergtowError(f"{path}: is libbergtow {version}, and this package is for {__version__}; "
                           "install both from the same source", IO)
    return lib, path


def library() -> ctypes.CDLL:
    return load()[0]


def check(status: int) -> None:
    """Raise what the library says of a call that failed."""
    if status != OK:
        text = library().bt_last_error().decode(errors="replace") or f"the library failed with status {status}"
        raise (CaseError if status == CASE else BergtowError)(text, status)


def take_text(address: int | None) -> str:
    """A text that the library has allocated."""
    assert address
    text = ctypes.string_at(address).decode()
    library().bt_release(address)
    return text


def start_mpi() -> None:
    """Let simulations use all ranks of mpirun or srun, with MPI as it has been started (mpi4py), or start it."""
    if library().bt_comm_start(None, None) != OK:
        raise BergtowError("MPI cannot be started; check the mpirun call")


def options(case: Case | None, **more: Any) -> Options:
    """bt_simulation_options of a Case, or None."""
    texts = {k: os.fsencode(v) if v is not None else None for k, v in more.items()
             if k in ("dir", "command_line", "from_")}
    if case is None:
        return Options(**(more | texts))
    overrides = [f"{key}={value}".encode() for key, value in case.overrides.items()]
    return Options(path=os.fsencode(case.path) if case.path is not None else None,
                   text=case.text.encode() if case.text is not None else None,
                   set=(c_char_p * len(overrides))(*overrides), n_set=len(overrides), **(more | texts))
