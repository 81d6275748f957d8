# SPDX-License-Identifier: MIT
"""libbergtow through ctypes: where to find it, the signatures of its functions, and its errors as exceptions.

Rejected: cffi and pybind11; they need a compiler at installation, or a package that Debian's Python does not have.
"""
from __future__ import annotations

import ctypes
import ctypes.util
import functools
import json
import os
import threading
from collections.abc import Callable
from ctypes import POINTER, c_bool, c_char_p, c_double, c_int, c_int32, c_int64, c_size_t, c_uint64, c_void_p
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import CASE, IO, OK, USAGE, BergtowError, CaseError

if TYPE_CHECKING:
    from .case import Case

SONAME = "libbergtow.so.0"
LOADS = 10  # BT_APPLIED_NUMBERS


class Options(ctypes.Structure):
    """bt_simulation_options"""
    _fields_ = [("path", c_char_p), ("text", c_char_p), ("set", POINTER(c_char_p)), ("n_set", c_int),
                ("dir", c_char_p), ("replace", c_bool), ("signals", c_bool), ("progress", c_bool),
                ("threads", c_int), ("command_line", c_char_p), ("from_", c_char_p)]


class Errors(ctypes.Structure):
    """bt_errors"""
    _fields_ = [("text", POINTER(c_char_p)), ("n", c_size_t), ("cap", c_size_t), ("note", c_void_p)]


class Applied(ctypes.Structure):
    """bt_applied"""
    _fields_ = [("n", c_int64), ("id", POINTER(c_int64)), ("place", POINTER(c_double)),
                ("velocity", POINTER(c_double)), ("mass", POINTER(c_double)), ("inertia", POINTER(c_double)),
                ("load", POINTER(c_double)), ("time", c_double), ("dt", c_double), ("water", c_double * 2),
                ("air", c_double * 2), ("towed", c_int64), ("towed_row", c_int64)]


class Mean(ctypes.Structure):
    """bt_mean: of a correlated, evenly spaced series; its 95 % interval, correlation time and independent samples."""
    _fields_ = [("mean", c_double), ("sd", c_double), ("se", c_double), ("low", c_double), ("high", c_double),
                ("tau", c_double), ("n_eff", c_double), ("n", c_int64)]


class Estimate(ctypes.Structure):
    """bt_estimate"""
    _fields_ = [("force", c_double), ("low", c_double), ("high", c_double), ("valid", c_bool), ("compares", c_bool),
                ("note", c_char_p)]


class RouteTask(ctypes.Structure):
    """bt_route_task"""
    _fields_ = [("n_floes", c_int64), ("floe_first", POINTER(c_int64)), ("floe", POINTER(c_double)),
                ("thickness", POINTER(c_double)), ("density", c_double), ("added_mass", c_double),
                ("jam_cover", c_double), ("rafting", c_double), ("width", c_double), ("reach", c_double),
                ("drag", c_double), ("start", c_double * 2), ("goal", c_double * 4), ("extent", c_double * 4),
                ("start_heading", c_double), ("goal_heading", c_double), ("speed", c_double * 16),
                ("force_limit", c_double), ("force_factor", c_double), ("n_no_go", c_int64),
                ("no_go_first", POINTER(c_int64)), ("no_go", POINTER(c_double)), ("clearance", c_double),
                ("radius", c_double), ("spacing", c_double), ("cell", c_double), ("turn_cost", c_double),
                ("weight", c_double * 5), ("drift", c_double * 2), ("water", c_double * 2), ("goal_is_line", c_int32),
                ("n_speeds", c_int32), ("objective", c_int32), ("headings", c_int32), ("routes", c_int32)]


class RouteFound(ctypes.Structure):
    """bt_route; each stretch is eight doubles."""
    _fields_ = [("n_corners", c_int64), ("n_stretches", c_int64), ("corner", POINTER(c_double)),
                ("stretch", POINTER(c_double)), ("radius", c_double), ("length", c_double), ("duration", c_double),
                ("work", c_double), ("force", c_double), ("peak", c_double), ("cost", c_double),
                ("term", c_double * 5), ("ice_area", c_double), ("ice_mass", c_double), ("clearance", c_double),
                ("faults", c_int64)]


class RoutePlan(ctypes.Structure):
    """bt_route_plan"""
    _fields_ = [("status", c_int32), ("n", c_int32), ("force", c_double), ("states", c_int64), ("spacing", c_double),
                ("cell", c_double), ("route", RouteFound * 17)]


class Status(c_int):
    """The bt_status that a call returns: any status except OK is raised as an exception with the library's message."""


APPLIED_FORCE = ctypes.CFUNCTYPE(c_int, POINTER(Applied), c_void_p)

_SIGNATURES = {
    "bt_version": (c_char_p,),
    "bt_last_error": (c_char_p,),
    "bt_outline_crosses": (c_bool, c_int, POINTER(c_double)),
    "bt_simulation_create": (Status, POINTER(c_void_p), POINTER(Options)),
    "bt_simulation_resume": (Status, POINTER(c_void_p), POINTER(Options)),
    "bt_simulation_step": (Status, c_void_p, c_int64),
    "bt_simulation_end": (Status, c_void_p),
    "bt_simulation_drop": (None, c_void_p),
    "bt_simulation_steps": (c_int64, c_void_p),
    "bt_simulation_steps_left": (c_int64, c_void_p),
    "bt_simulation_time": (c_double, c_void_p),
    "bt_simulation_dt": (c_double, c_void_p),
    "bt_simulation_hash": (c_uint64, c_void_p),
    "bt_simulation_checkpoint": (Status, c_void_p),
    "bt_simulation_frame": (Status, c_void_p),
    "bt_simulation_bodies": (c_int64, c_void_p),
    "bt_simulation_towed": (c_int64, c_void_p),
    "bt_simulation_read": (Status, c_void_p, c_int, POINTER(c_double)),
    "bt_simulation_outline": (c_int64, c_void_p, c_int64, POINTER(c_double), c_int64),
    "bt_simulation_set_velocity": (Status, c_void_p, c_int64, c_double, c_double, c_double),
    "bt_simulation_set_place": (Status, c_void_p, c_int64, c_double, c_double, c_double),
    "bt_simulation_quantity": (Status, c_void_p, c_char_p, POINTER(c_double)),
    "bt_simulation_progress": (c_void_p, c_void_p),
    "bt_simulation_case": (c_void_p, c_void_p),
    "bt_simulation_contacts": (c_int64, c_void_p, POINTER(c_double), c_int64),
    "bt_case_check_text": (Status, POINTER(Options), POINTER(c_void_p), POINTER(c_void_p)),
    "bt_case_unused": (c_void_p, c_char_p),
    "bt_file_holds": (c_char_p, c_char_p),
    "bt_ensemble_state": (c_int, c_char_p, POINTER(c_int), POINTER(c_void_p), POINTER(c_void_p)),
    "bt_folder_lock": (Status, c_char_p, POINTER(c_int)),
    "bt_seal_check": (Status, c_char_p, c_char_p),
    "bt_record_check": (Status, c_char_p, c_char_p, c_char_p, c_size_t),
    "bt_number_read": (Status, c_char_p, c_char_p, POINTER(c_double)),
    "bt_stats_mean": (Mean, POINTER(c_double), c_int64),
    "bt_case_rise": (c_double, c_double, c_double),
    "bt_catenary_span": (c_double, c_double, c_double, c_double, c_double),
    "bt_catenary_pull": (c_double, c_double, c_double, c_double, c_double, POINTER(c_double)),
    "bt_estimate_ship": (Estimate, c_double, c_double, c_double, c_double, c_double),
    "bt_outline_near_thickness": (c_bool, c_char_p),
    "bt_outline_chart_column": (c_bool, c_char_p),
    "bt_outline_middle": (None, c_int64, POINTER(c_double), POINTER(c_double)),
    "bt_outline_in_degrees": (c_bool, c_double, c_double, c_bool),
    "bt_outline_project": (None, c_double, c_double, c_double, c_double, POINTER(c_double), POINTER(c_double)),
    "bt_outline_unproject": (None, c_double, c_double, c_double, c_double, POINTER(c_double), POINTER(c_double)),
    "bt_route_make": (None, POINTER(RouteTask), POINTER(RoutePlan)),
    "bt_route_through": (None, POINTER(RouteTask), c_int, POINTER(c_double), POINTER(RoutePlan)),
    "bt_route_free": (None, POINTER(RoutePlan)),
    "bt_route_cover": (None, POINTER(RouteTask), c_int64, c_int64, POINTER(c_double)),
    "bt_list_json": (c_void_p, c_char_p),
    "bt_release": (None, c_void_p),
    "bt_force_apply": (c_int, c_char_p, c_char_p, APPLIED_FORCE, c_void_p, POINTER(Errors)),
    "bt_errors_free": (None, POINTER(Errors)),
    "bt_comm_start": (c_int, c_void_p, c_void_p),
    "bt_comm_end": (c_int, c_int),
}


def _candidates() -> list[str]:
    """Where the library may be. If BERGTOW_LIB is set: only there. Otherwise the source tree or prefix that contains
    this package, then the linker's search path (where the library may be built with MPI), then the wheel."""
    named = os.environ.get("BERGTOW_LIB")
    if named:
        path = Path(named)
        return [str(path / SONAME if path.is_dir() else path)]
    here = Path(__file__).resolve().parent  # postproc/bergtow, or PREFIX/share/bergtow/postproc/bergtow
    found = [here.parents[1] / "build/release" / SONAME]
    if len(here.parents) > 3:
        found.append(here.parents[3] / "lib" / SONAME)
    return [str(p) for p in found if p.exists()] + [SONAME, ctypes.util.find_library("bergtow") or SONAME,
                                                    str(here / "_lib" / SONAME)]


def library_path() -> str:
    """The path of the libbergtow in use."""
    return load()[1]


#: The library is single-threaded: calls from other threads wait. A force that calls back runs in the same thread.
LOCK = threading.RLock()

#: the process whose simulations have started OpenMP threads, which a fork does not inherit
team: int | None = None


def _after_fork() -> None:
    global LOCK
    LOCK = threading.RLock()  # the old lock may be held by a thread that does not exist in this process


os.register_at_fork(after_in_child=_after_fork)


def threads_here(asked: int) -> int:
    """Number of threads for a new simulation. After a fork from a process that has run simulations it is one, because a
    larger team would wait for threads that the fork did not copy."""
    global team
    most = limit("threads")
    if not 0 <= asked <= most:  # checked before it is passed to the library as a 32-bit number
        raise BergtowError(f"threads: {asked} are not available; give 1 to {most}, or 0 for run.threads of the "
                           "case or all cores")
    if team in (None, os.getpid()):
        if asked != 1:
            team = os.getpid()
        return asked
    if asked > 1:
        raise BergtowError(f"threads: {asked} are not available in a fork of a process that has run simulations; give "
                           '1, or start processes with multiprocessing.get_context("spawn")')
    return 1


class Library:
    """The functions of libbergtow, called one at a time."""

    def __init__(self, lib: ctypes.CDLL) -> None:
        self._lib = lib
        for name, (result, *arguments) in _SIGNATURES.items():
            function = getattr(lib, name)
            function.restype, function.argtypes = c_int if result is Status else result, arguments
            setattr(self, name, self._locked(function, result is Status))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._lib, name)

    def _locked(self, function: Any, raises: bool) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            with LOCK:
                answer = function(*arguments)
                if raises and answer != OK:
                    text = self._lib.bt_last_error().decode(errors="replace") or f"failed with status {answer}"
                    raise (CaseError if answer == CASE else BergtowError)(text, answer)
                return answer
        return call


@functools.cache
def load() -> tuple[Library, str]:
    """The library, with its function signatures, and its path. Raises BergtowError, which says what to do."""
    # Threads that spin at a barrier slow a busy machine down many times (src/app/main.c). libgomp reads this when it is
    # loaded, and values set by the user take precedence.
    if "OMP_WAIT_POLICY" not in os.environ:
        os.environ.setdefault("GOMP_SPINCOUNT", "20000")
    # UCX, which Open MPI loads on Debian 13, takes SIGHUP for its debugger, even under nohup.
    os.environ.setdefault("UCX_DEBUG_SIGNO", "0")
    from . import __version__
    reasons = []
    for path in dict.fromkeys(_candidates()):
        try:
            lib = ctypes.CDLL(path, mode=ctypes.RTLD_GLOBAL)  # MPI loads plug-ins that need its symbols
        except OSError as error:
            reasons.append(str(error))
            continue
        lib.bt_version.restype = c_char_p
        version = lib.bt_version().decode()
        if version == __version__:
            return Library(lib), path
        reasons.append(f"{path} is libbergtow {version}, and this package is for {__version__}")
    raise BergtowError("libbergtow cannot be loaded (" + "; ".join(reasons) + "); build it with `make lib`, "
                       "install it with `make install` from the same source, or name its file in BERGTOW_LIB", IO)


def library() -> Library:
    return load()[0]


def take_text(address: int | None) -> str:
    """Copy a text that the library has allocated, and release it."""
    assert address
    text = ctypes.string_at(address).decode()
    library().bt_release(address)
    return text


@functools.cache
def listed(what: str) -> dict[str, Any]:
    """bt_list_json: "keys", "quantities" or "limits"."""
    return json.loads(take_text(library().bt_list_json(what.encode())))


def limit(name: str) -> Any:
    """A limit that the program applies to windows, domains or maps, or to the size of its inputs and outputs; or one of
    its constants."""
    return listed("limits")[name]


def unused(text: str) -> dict[str, str]:
    """The keys that have no effect in the text of a case, each with the reason: bt_case_unused."""
    return json.loads(take_text(library().bt_case_unused(text.encode(errors="surrogateescape"))))


def id_of_towed(towed: int | None) -> int:
    if towed is None:
        raise BergtowError("there is no towed body in this case; ask has_towed first")
    return towed


def start_mpi() -> None:
    """Let simulations use all ranks of mpirun or srun. MPI is started here unless mpi4py has already started it."""
    if library().bt_comm_start(None, None) != OK:
        raise BergtowError("MPI cannot be started; check the mpirun call")


def whole(text: bytes, what: str, status: int = USAGE) -> bytes:
    """A text to pass to the library. Raises BergtowError for a text that contains NUL, which would end it in C."""
    if b"\0" in text:
        raise (CaseError if status == CASE else BergtowError)(f"{what} contains the character NUL; remove it", status)
    return text


def options(case: Case | None, **more: Any) -> Options:
    """bt_simulation_options for a Case, or for None. Raises BergtowError for a text that contains NUL."""
    names = {"dir": "the name of the result folder", "command_line": "the command line",
             "from_": "the name of the checkpoint"}
    more |= {k: whole(os.fsencode(more[k]), name) for k, name in names.items() if more.get(k) is not None}
    if case is None:
        return Options(**more)
    overrides = [whole(f"{key}={value}".encode(), f"{key}: the value", CASE) for key, value in case.overrides.items()]
    place, text = case.place(), case.text
    line = 1 + (text or "").partition("\0")[0].count("\n")
    return Options(path=whole(os.fsencode(place), "the path of the case", CASE) if place is not None else None,
                   text=whole(text.encode(errors="surrogateescape"), f"{place or 'case'}:{line}: the line", CASE)
                   if text is not None else None,
                   set=(c_char_p * len(overrides))(*overrides), n_set=len(overrides), **more)
