# SPDX-License-Identifier: MIT
"""Forces as Python functions, called with arrays of all bodies once per step, and again if floes split in it
(bergtow/applied.h)."""
from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _library
from .errors import OK, BergtowError
from ._interrupts import held

if TYPE_CHECKING:
    import numpy.typing as npt

_FX, _FY, _MOMENT, _G, _GX, _GY, _GW, _JX, _JY, _JW = range(_library.LOADS)


def _view(pointer: Any, *shape: int, writeable: bool = False) -> np.ndarray:
    # without bodies the pointer has nothing to point at
    view = np.ctypeslib.as_array(pointer, shape) if shape[0] else np.empty(shape, pointer._type_)
    view.flags.writeable = writeable
    return view


class Bodies:
    """The bodies at the start of a step, as a force sees them. The arrays are valid only during the call.

    id [n]; place [n, 3] x, y, yaw (m, rad); velocity [n, 3] (m/s, rad/s); mass, inertia [n] including added mass and
    added inertia (kg, kg m²); time at the middle of the step, dt (s); water, air: velocities [2] (m/s).

    For an explicit force, add to `force` [n, 2] (N) and `moment` [n] (N m). For a force that depends on the velocity,
    call drag() or add to `load` [n, 10], the rows of bergtow/applied.h.
    """

    def __init__(self, a: _library.Applied) -> None:
        n = a.n
        self.id = _view(a.id, n)
        self.place, self.velocity = _view(a.place, n, 3), _view(a.velocity, n, 3)
        self.mass, self.inertia = _view(a.mass, n), _view(a.inertia, n)
        self._load = _view(a.load, n, _library.LOADS, writeable=True)
        self.time, self.dt = a.time, a.dt
        self.water, self.air = np.array(a.water), np.array(a.air)
        self.has_towed: bool = a.towed_row >= 0
        self._towed = a.towed_row if self.has_towed else None

    @property
    def towed(self) -> int:
        """Row of the towed body. It is an error if there is none (see `has_towed`): None as an index would mean all
        bodies."""
        return _library.id_of_towed(self._towed)

    @property
    def load(self) -> np.ndarray:
        """[n, 10], the rows of bergtow/applied.h"""
        return self._load

    @load.setter
    def load(self, value: npt.ArrayLike) -> None:
        self._load[:] = value

    @property
    def force(self) -> np.ndarray:
        """[n, 2] N"""
        return self._load[:, _FX:_FY + 1]

    @force.setter
    def force(self, value: npt.ArrayLike) -> None:
        self.force[:] = value

    @property
    def moment(self) -> np.ndarray:
        """[n] N m"""
        return self._load[:, _MOMENT]

    @moment.setter
    def moment(self, value: npt.ArrayLike) -> None:
        self.moment[:] = value

    def _add(self, answer: npt.ArrayLike) -> None:
        """Add the value that a force function returned."""
        n = len(self.id)
        try:
            given = np.asarray(answer, float)
        except (TypeError, ValueError):
            given = None
        if given is not None and n and np.may_share_memory(given, self._load):
            raise ValueError("a force returned an array of bodies that it has filled in (force, moment or load), "
                             "which would count twice; fill it in and return nothing, or return a new array")
        if given is None or given.shape not in ((n, 2), (n, 3)):
            what = type(answer).__name__ if given is None else f"an array of the shape {given.shape}"
            raise ValueError(f"a force returned {what}; fill in bodies.force [{n}, 2] and "
                             "bodies.moment in place and return nothing, as bodies.force[bodies.towed] += 0, 100, or "
                             f"return forces of all bodies, ({n}, 2), or ({n}, 3) with moments")
        self._load[:, :given.shape[1]] += given

    def drag(self, k: npt.ArrayLike, velocity: npt.ArrayLike) -> None:
        """The linear force k (velocity − U), with the body's U at the end of the step, so stable for any step. k: one
        number or [n], kg/s; velocity: [2] or [n, 2], m/s. For a quadratic drag use k = c |velocity − U|."""
        u = np.broadcast_to(velocity, (len(self.id), 2))
        self.load[:, _G] += k
        self.load[:, _JX] += k * u[:, 0]
        self.load[:, _JY] += k * u[:, 1]


#: adds the loads on the bodies itself, or returns forces [n, 2], or forces and moments [n, 3]
Force = Callable[[Bodies], "npt.ArrayLike | None"]


class Forces:
    """The forces of one simulation. Force laws are registered for the whole process: if two simulations are stepped in
    turn, the laws of one do nothing in the steps of the other."""

    _callbacks: dict[str, Any] = {}  # name -> the C function; kept for good, because the library keeps its address
    _owner: dict[str, Forces] = {}      # name -> the Forces that owns it now
    stepping: Forces | None = None  # the one whose simulation is in a step
    calling = False                 # while a user's function is running

    def __init__(self, functions: Mapping[str, Force] | None) -> None:
        self.functions = dict(functions or {})
        self.raised: BaseException | None = None
        for name in self.functions:
            if name in self._owner:
                raise BergtowError(f"force {name}: belongs to a simulation that has not ended; end it, or "
                                            "choose another name")
        done = []
        try:
            for name in self.functions:
                self._register(name)
                done.append(name)
        except Exception:
            self._owner.update(dict.fromkeys(done, self))
            self.release()
            raise
        self._owner.update(dict.fromkeys(self.functions, self))

    def _register(self, name: str) -> None:
        callback = self._callbacks.get(name) or _library.APPLIED_FORCE(lambda a, user: Forces._call(name, a))
        function = self.functions[name]
        doc = ((function.__doc__ or "").strip().splitlines() or [""])[0].rstrip(".")
        self._apply(name, callback, doc if len(doc) >= 8 else f"force {name} of a Python program")
        self._callbacks[name] = callback

    @staticmethod
    def _apply(name: str, callback: Any, doc: str) -> None:
        texts = [_library.whole(text.encode(), f"force {name!r}: its name or docstring") for text in (name, doc)]
        err = _library.Errors()
        status = _library.library().bt_force_apply(*texts, callback, None, ctypes.byref(err))
        text = "\n".join(err.text[k].decode() for k in range(err.n))
        _library.library().bt_errors_free(ctypes.byref(err))
        if status != OK:
            raise BergtowError(text, status)

    @classmethod
    def _call(cls, name: str, a: Any) -> int:
        forces = cls.stepping
        if forces is None or name not in forces.functions:
            return 0
        try:
            bodies = Bodies(a.contents)
            cls.calling = True
            answer = forces.functions[name](bodies)
            cls.calling = False
            if answer is not None:
                bodies._add(answer)
            return 0
        except BaseException as error:  # raised again after the step has returned
            cls.calling = False
            forces.raised = error
            return 1

    @contextlib.contextmanager
    def in_step(self) -> Iterator[None]:
        """Surround a step of their simulation; an exception in one of the forces is raised here."""
        if not self.functions:
            yield
            return
        with _library.LOCK, held(lambda: Forces.calling):
            before, Forces.stepping = Forces.stepping, self
            try:
                yield
            except BergtowError:
                raised, self.raised = self.raised, None
                if raised is not None:
                    raise raised from None
                raise
            finally:
                Forces.stepping = before

    def release(self) -> None:
        for name in self.functions:
            if self._owner.get(name) is self:
                del self._owner[name]
                self._apply(name, _library.APPLIED_FORCE(0), "")
