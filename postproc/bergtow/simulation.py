# SPDX-License-Identifier: MIT
"""Simulations run step by step, and runs from case to result folder."""
from __future__ import annotations

import contextlib
import ctypes
import html
import math
import operator
import os
import sys
import time
from collections.abc import Callable, Mapping
from ctypes import POINTER, c_double, c_void_p
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from . import _library
from ._interrupts import held
from .errors import SIGNAL, BergtowError
from .case import Case, here
from .force import Force, Forces
from .result.dataset import Result

#: a contact of the last step (bergtow/simulation.h): ids, points, unit normal from a to b, impulses on b in N s
CONTACT = np.dtype([("a", "i8"), ("b", "i8"), ("n_points", "i8"), ("point", "f8", (2, 2)), ("normal", "f8", 2),
                    ("normal_impulse", "f8", 2), ("tangential_impulse", "f8")])


def _pointer(array: np.ndarray) -> Any:
    return array.ctypes.data_as(POINTER(c_double))


def _id(body: int) -> int:
    """Check that an id fits the library's integer type; the library checks whether the body exists."""
    if not -2**63 <= body < 2**63:
        raise IndexError(f"body {body}: does not exist")
    return body


class _Array(property):
    """Numbers of all bodies, a copy: [n], or [n, width]; kind: of bt_simulation_read."""

    def __init__(self, kind: int, width: int, doc: str) -> None:
        def read(sim: Simulation) -> np.ndarray:
            out = np.empty((sim.n_bodies, width))
            sim._library.bt_simulation_read(sim._s, kind, _pointer(out))
            return out[:, 0] if width == 1 else out
        super().__init__(read)
        self.__doc__ = doc

    if TYPE_CHECKING:
        def __get__(self, sim: Any, kind: Any = None) -> np.ndarray: ...


class Simulation:
    """A simulation of a case, run step by step.

        with Simulation(case, "out/my-run", forces={"my_drag": my_drag}) as sim:
            sim.step(100)
            sim.positions, sim.velocities, sim.contacts, sim["ice_resistance"]

    out: a result folder as for `bergtow run -o`, complete when the block ends; without it nothing is written. forces:
    functions of Bodies, keyed by the name of their series (NAME_force). If an exception ends the block, no summary is
    written, unless the run was asked to stop (the file `stop` in the folder). case: its state when the simulation
    began. Arrays are copies, in the order of the ids: floes, floes given by hand, the towed body, walls. The
    simulation's own arrays are sorted by cell and reallocated within a step, so a view could end up showing other
    bodies or freed memory. Copying the positions of 100,000 bodies takes 0.3 ms.
    """

    def __init__(self, case: Case | str | os.PathLike[str] | Mapping[str, Any],
                 out: str | os.PathLike[str] | None = None, *, forces: Mapping[str, Force] | None = None,
                 threads: int = 0, replace: bool = False, progress: bool = False) -> None:
        case = case if isinstance(case, Case) else Case(case)
        self._begin("bt_simulation_create", case, out, forces, threads=threads, replace=replace, progress=progress)

    @classmethod
    def resume(cls, folder: str | os.PathLike[str], *, checkpoint: str | os.PathLike[str] | None = None,
               forces: Mapping[str, Force] | None = None, threads: int = 0, progress: bool = False) -> Simulation:
        """Continue a run in its folder, from its last checkpoint or from the one given.

            with Simulation.resume("out/my-run", forces={"my_drag": my_drag}) as sim: ...

        The run may come from `bergtow run`, an ensemble or this class. forces: pass the same ones again, because the
        checkpoint does not contain them. Raises BergtowError for a run that is finished, CaseError for a checkpoint
        that is rejected.
        """
        self = cls.__new__(cls)
        self._begin("bt_simulation_resume", None, folder, forces, threads=threads, progress=progress, from_=checkpoint)
        return self

    def _begin(self, function: str, case: Case | None, out: str | os.PathLike[str] | None,
               forces: Mapping[str, Force] | None, **more: Any) -> None:
        self._address: c_void_p | None = None
        self._process = os.getpid()
        self._library = _library.library()
        more["threads"] = _library.threads_here(more["threads"])
        case = None if case is None else case.frozen_copy()
        folder = None if out is None else os.fsdecode(out)
        self.folder = os.path.join(here(), folder) if folder else folder  # the working folder may change
        self._forces = Forces(forces)
        try:
            address = c_void_p()
            command_line = " ".join(["python", *(os.path.basename(a) for a in sys.argv[:1])])
            o = _library.options(case, dir=self.folder, command_line=command_line, **more)
            with held():
                getattr(self._library, function)(ctypes.byref(address), ctypes.byref(o))
                self._address = address
            self._case = case
            self._resolved = _library.take_text(self._library.bt_simulation_case(address))
            towed = self._library.bt_simulation_towed(address)
            self.has_towed: bool = towed >= 0
            self._towed = towed if self.has_towed else None
            self.n_bodies: int = self._library.bt_simulation_bodies(address)
            self.dt: float = self._library.bt_simulation_dt(address)
        except BaseException:
            self.drop()
            self._forces.release()
            raise

    @property
    def _s(self) -> c_void_p:
        if self._address is None:
            raise BergtowError("the simulation has ended")
        if self._process != os.getpid():
            raise BergtowError("the simulation belongs to the parent of this forked process; begin a new one here")
        return self._address

    @property
    def case(self) -> Case:
        """The simulated case; for a resumed run, the case in its checkpoint. It is built on first use. Files that it
        names must exist then, although a resumed run does not need them."""
        if self._case is None:
            self._case = Case(os.path.join(self.folder or "", "case.resolved.yml"), text=self._resolved)
        return self._case

    @property
    def towed(self) -> int:
        """Id of the towed body. It is an error if there is none (see `has_towed`): None as an index would mean all
        bodies."""
        return _library.id_of_towed(self._towed)

    # --- steps --------------------------------------------------------------------------------------------------------

    def step(self, n: int = 1) -> None:
        """Make n steps, or as many as are left. An exception in a force is raised from here. Ctrl-C stops between two
        steps; a second Ctrl-C aborts a slow force, and with it the simulation."""
        n = operator.index(n)
        while True:
            with self._forces.in_step():
                self._library.bt_simulation_step(self._s, min(n, 1))
            n -= 1
            if n <= 0 or not self.steps_left:
                return

    def end(self) -> Result | None:
        """Write summary and last checkpoint, if there is a folder. Returns its Result, or None without a folder."""
        self._close("bt_simulation_end")
        return None if self.folder is None else Result(self.folder)

    def drop(self) -> None:
        """End without a summary."""
        if self._address is not None:
            self._close("bt_simulation_drop")

    def _close(self, function: str) -> None:
        with _library.LOCK, held():
            address = self._s
            if Forces.stepping is self._forces and self._forces.functions:
                raise BergtowError("a force cannot end the simulation that calls it; end it when the step is done")
            self._address = None
            try:
                getattr(self._library, function)(address)
            finally:
                self._forces.release()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: Any) -> None:
        if self._address is None:
            return
        if kind is None or getattr(error, "status", None) == SIGNAL:  # the run was asked to stop: nothing is lost
            self.end()
        else:
            self.drop()

    def __del__(self) -> None:
        if getattr(self, "_address", None) is not None and self._process == os.getpid():
            self.drop()

    def __reduce__(self) -> NoReturn:
        """For copies, too: two objects would own the same memory of the library."""
        raise TypeError("a simulation can be neither copied nor pickled; copy its case")

    def checkpoint(self) -> None:
        """Write a checkpoint into the folder, for `bergtow resume`."""
        self._library.bt_simulation_checkpoint(self._s)

    def frame(self) -> None:
        """Write a frame of the bodies in their current state, in addition to those of output.frame_interval."""
        self._library.bt_simulation_frame(self._s)

    @property
    def steps(self) -> int:
        return self._library.bt_simulation_steps(self._s)

    @property
    def steps_left(self) -> int:
        return self._library.bt_simulation_steps_left(self._s)

    @property
    def progress(self) -> str:
        """The progress line of `bergtow run`."""
        return _library.take_text(self._library.bt_simulation_progress(self._s))

    @property
    def time(self) -> float:
        """s"""
        return self._library.bt_simulation_time(self._s)

    @property
    def state_hash(self) -> str:
        """The same text as in summary.json."""
        return f"{self._library.bt_simulation_hash(self._s):016x}"

    # --- bodies -------------------------------------------------------------------------------------------------------

    positions = _Array(0, 3, "[n, 3] x, y, yaw, m, m, rad")
    velocities = _Array(1, 3, "[n, 3] m/s, m/s, rad/s")
    masses = _Array(2, 2, "[n, 2] with and without added mass, kg")
    inertias = _Array(3, 1, "[n] kg m²")
    areas = _Array(4, 1, "[n] m²")
    radii = _Array(5, 1, "[n] of the circle around the outline, m")
    thicknesses = _Array(6, 1, "[n] of ice, m")
    _motions = _Array(7, 1, "[n]")
    drags = _Array(8, 5, "[n, 5] skin (kg/m) and form (kg/m²) drag of the water, of the air, drag of turning (kg m²)")

    @property
    def motions(self) -> np.ndarray:
        """[n] 0 moved by forces, 1 velocity prescribed, 2 permanently at rest, -1 absent: a floe that has split, or an
        unused piece; all its other numbers are NaN"""
        return np.nan_to_num(self._motions, nan=-1).astype(int)

    def outline(self, body: int) -> np.ndarray:
        """[n, 2] m, anticlockwise, at the body's current position."""
        if not 0 <= body < self.n_bodies:
            raise IndexError(f"body {body}: does not exist; ids are 0 to {self.n_bodies - 1}")
        n = self._library.bt_simulation_outline(self._s, body, None, 0)
        out = np.empty((n, 2))
        self._library.bt_simulation_outline(self._s, body, _pointer(out), n)
        return out

    def set_velocity(self, body: int, x: float, y: float, rate: float = 0.0) -> None:
        """m/s, m/s, rad/s. Rejected for a body whose velocity is prescribed."""
        self._library.bt_simulation_set_velocity(self._s, _id(body), x, y, rate)

    def set_position(self, body: int, x: float, y: float, yaw: float) -> None:
        """m, m, rad. Rejected outside the domain, over another body, and for a towed body."""
        self._library.bt_simulation_set_place(self._s, _id(body), x, y, yaw)

    # --- numbers ------------------------------------------------------------------------------------------------------

    def __getitem__(self, name: str) -> float:
        """A number of the last step by the name of its series, in SI units; NaN if it does not apply."""
        value = c_double()
        address = self._s
        try:
            self._library.bt_simulation_quantity(address, _library.whole(name.encode(), f"{name!r}: the name"),
                                                 ctypes.byref(value))
        except BergtowError as error:
            raise KeyError(str(error)) from None
        return value.value

    @property
    def contacts(self) -> np.ndarray:
        """Contacts of the last step, an array of dtype CONTACT; those without an impulse are candidates."""
        with _library.LOCK:
            n = self._library.bt_simulation_contacts(self._s, None, 0)
            if n < 0:
                raise BergtowError(self._library.bt_last_error().decode())
            rows = np.empty((n, _library.limit("contact_columns")))
            self._library.bt_simulation_contacts(self._s, _pointer(rows), n)
        out = np.empty(n, CONTACT)
        out["a"], out["b"], out["n_points"] = rows[:, 0], rows[:, 1], rows[:, 2]
        out["point"], out["normal"] = rows[:, 3:7].reshape(n, 2, 2), rows[:, 7:9]
        out["normal_impulse"], out["tangential_impulse"] = rows[:, 9:11], rows[:, 11]
        return out

    def __repr__(self) -> str:
        if self._address is None:
            return "<bergtow.Simulation, ended>"
        return f"<bergtow.Simulation of {self.n_bodies} bodies at {self.time:g} s, {self.steps_left} steps left>"

    def _repr_html_(self) -> str:
        if self._address is None:
            return f"<p>{html.escape(repr(self))}</p>"
        said = [("time", f"{self.time:.6g} s"), ("steps", f"{self.steps} made, {self.steps_left} left")]
        said += [(name, f"{value:.4g} N") for name in ("ice_resistance", "tow_force", "line_tension")
                 if not math.isnan(value := self[name])]
        rows = "".join(f"<tr><td>{name}</td><td>{text}</td></tr>" for name, text in said)
        return f"<p>{html.escape(repr(self))}</p><table>{rows}</table>"


def run(case: Case | str | os.PathLike[str] | Mapping[str, Any], out: str | os.PathLike[str], *,
        forces: Mapping[str, Force] | None = None, threads: int = 0, replace: bool = False,
        progress: bool | Callable[[Simulation], Any] = False) -> Result:
    """Run a case to its end and return its Result. out: the result folder. Ctrl-C stops it between steps, like `bergtow
    run`: with a summary and a checkpoint, for Simulation.resume.

    progress: True for the progress line of `bergtow run`, updated a few times a second, also in notebooks; or a
    function, called equally often with the Simulation.
    """
    show, last = _line if progress is True else progress, 0.0
    with Simulation(case, out, forces=forces, threads=threads, replace=replace) as sim:
        try:
            while sim.steps_left:
                sim.step(10)
                now = time.monotonic()
                if show and (now - last > 0.25 or not sim.steps_left):
                    last = now
                    show(sim)
        except KeyboardInterrupt:
            with contextlib.suppress(BergtowError):  # from a stop, or from a force that Ctrl-C aborted
                sim.end()
            raise
        if progress is True:
            print()
        return sim.end() or Result(out)


def _line(sim: Simulation) -> None:
    """Print to Python's standard output, which a notebook shows; output of the library bypasses it."""
    print(f"\r{sim.progress}".ljust(100), end="", flush=True)
