# SPDX-License-Identifier: MIT
"""Cases: the inputs of a simulation, stored under the keys of a case file, each checked by the library."""
from __future__ import annotations

import copy
import ctypes
import functools
import html
import json
import math
import os
import re
from collections.abc import Iterator, Mapping, MutableMapping
from typing import Any

from . import _library
from .errors import CASE, CaseError


@functools.cache
def _keys() -> dict[str, dict[str, Any]]:
    """{key: its entry in the library's table of keys}."""
    return {key["name"]: key for key in _library.listed("keys")["keys"]}


@functools.cache
def preset(key: str) -> Any:
    """The default of a key that has one whatever else a case has."""
    return Case({"run": {"dt": 1, "duration": 1}})[key]


def quantities() -> dict[str, Any]:
    """The quantities that a run writes (series, summary keys, estimates), with units and meanings."""
    return copy.deepcopy(_library.listed("quantities"))


#: units of numbers in Python that differ from those of bare numbers in a case file
_SI = {"deg": "rad", "deg/s": "rad/s", "-": ""}


def setting(key: str, value: Any) -> str:
    """Write a value as it stands in a case file. Here numbers are in SI units, and angles in radians."""
    unit = _keys()[key].get("unit") if key in _keys() else None
    in_radians = unit in ("deg", "deg/s") and value is not None and not isinstance(value, str)
    return _as_text(value) + (f" {_SI[str(unit)]}" if in_radians else "")


def _plain(value: Any) -> Any:
    """Convert a path to text, and a NumPy number to a Python number."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{value!r}: is nothing that a case can hold; give a number, a text, a path or a list of them")


def _as_text(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, str):
        return value
    if isinstance(value, os.PathLike) or hasattr(value, "tolist"):
        return _as_text(_plain(value))
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_as_text(v) for v in value) + "]"
    return repr(value)


def _as_file(sections: Mapping[str, Any]) -> str:
    """A mapping as the text of a case file. YAML does not allow surrogate pairs, and folds or rejects some characters
    that JSON leaves as they are."""
    text = json.dumps(sections, indent=1, ensure_ascii=False, default=_plain)
    return re.sub("[\x7f-\xa0\u2028\u2029\ufeff\ufffe\uffff]", lambda c: f"\\u{ord(c[0]):04x}", text)


def _content(path: str) -> str | None:
    """The text of a case file; None if the library is to read the file and report its errors."""
    if not os.path.isfile(path):
        return None
    try:
        with open(path, "rb") as file:
            data = file.read()
    except OSError:
        return None
    return None if b"\0" in data else data.decode(errors="surrogateescape")


def here() -> str:
    try:
        return os.getcwd()
    except OSError:  # the folder is gone, so relative names cannot be resolved
        return ""


def _as_real(value: Any) -> Any:
    """Convert whole numbers to float: JSON writes them without a decimal point."""
    return [_as_real(v) for v in value] if isinstance(value, list) else value if value is None else float(value)


class Case(MutableMapping[str, Any]):
    """A case from a file, or from a mapping of sections laid out as in a file.

        case = Case("basin-80.yml", {"ice.concentration": 0.7})
        case["tow.speed"] = "1.5 kn"      # text is read as in a file
        case["tow.speed"]                 # 0.7716...; numbers are in SI units, angles in radians, both ways
        case.unit("tow.speed")            # 'm/s'

    Every value is checked when it is set; an invalid value raises CaseError and changes nothing. If several values are
    only valid together, set them in one call: case.update({...}). None stands for a key without a value. Numbers in a
    mapping of sections are read as in a file: angles in degrees. A file is read once: later changes to it do not affect
    the case.
    """

    def __init__(self, source: str | os.PathLike[str] | Mapping[str, Any] | None,
                 values: Mapping[str, Any] | None = None, *, text: str | None = None) -> None:
        self.path = None if source is None or isinstance(source, Mapping) else os.fspath(source)
        if self.path is None and text is None and not isinstance(source, Mapping):
            raise TypeError("a case needs a file, a mapping or a text")
        self._folder = here()
        self.text = (text if text is not None else _as_file(source) if isinstance(source, Mapping) else
                     _content(self.path or ""))
        self.overrides: dict[str, str] = {}  #: {key: text} of the values set here
        self._resolve(self.overrides | {k: setting(k, v) for k, v in (values or {}).items()})

    @classmethod
    def from_text(cls, text: str, values: Mapping[str, Any] | None = None,
                  path: str | os.PathLike[str] | None = None) -> Case:
        """A case from the text of a case file. path: its name in messages; files it names are relative to it."""
        return cls(path, values, text=text)

    def _resolve(self, overrides: dict[str, str]) -> None:
        address, listed = ctypes.c_void_p(), ctypes.c_void_p()
        before, self.overrides = self.overrides, overrides
        try:
            _library.library().bt_case_check_text(ctypes.byref(_library.options(self)), ctypes.byref(address),
                                                  ctypes.byref(listed))
            resolved = _library.take_text(address.value)
            values = {key: _as_real(value) if _keys()[key]["type"] in ("real", "points") else value
                      for key, value in json.loads(_library.take_text(listed.value)).items()}
        except Exception:
            self.overrides = before
            raise
        self.resolved = resolved  #: every key with its value, as the text of a case file
        self._values = values

    def place(self) -> str | None:
        """The path, valid even after the working folder has changed."""
        return self.path if here() == self._folder else os.path.join(self._folder, self.path or "case")

    def frozen_copy(self) -> Case:
        """A copy, if the files that the case builds on (`base`) are unchanged; otherwise raises CaseError."""
        other = self.copy()
        other._resolve(other.overrides)
        if other.resolved != self.resolved:
            raise CaseError(f"{self.path or 'case'}: a file that it builds on (base) has changed since the case was "
                            "read; make the Case again", CASE)
        return other

    def __getitem__(self, key: str) -> Any:
        if key not in _keys():
            raise KeyError(f"{key}: unknown key; see bergtow --list-keys")
        return self._values.get(key)

    def __setitem__(self, key: str, value: Any) -> None:
        self._resolve(self.overrides | {key: setting(key, value)})

    def update(self, values: Any = (), **more: Any) -> None:  # type: ignore[override]
        """Set several values at once; they are checked together."""
        self._resolve(self.overrides | {k: setting(k, v) for k, v in dict(values, **more).items()})

    def __delitem__(self, key: str) -> None:
        """Remove a value set here, so that the value of the file, or else the default, applies again."""
        if key not in self.overrides:
            raise KeyError(f"{key}: has not been set")
        self._resolve({k: v for k, v in self.overrides.items() if k != key})

    def pop(self, key: str, *default: Any) -> Any:  # type: ignore[override]
        """Remove a value set here, and return it; `default`, if given, for a key that has not been set."""
        return default[0] if default and key not in self.overrides else super().pop(key)

    def popitem(self) -> tuple[str, Any]:
        """Remove the value set last, and return its key and value."""
        if not self.overrides:
            raise KeyError("no value has been set")
        key = next(reversed(self.overrides))
        return key, self.pop(key)

    def clear(self) -> None:
        """Remove all values set here, together, because some may be valid only with others."""
        self._resolve({})

    def __iter__(self) -> Iterator[str]:
        return iter(_keys())

    def __len__(self) -> int:
        return len(_keys())

    def __contains__(self, key: object) -> bool:
        return key in _keys()

    def unit(self, key: str) -> str:
        """Unit in which the value is read; '' for plain numbers, texts and choices."""
        self[key]
        unit = _keys()[key].get("unit") or ""
        return _SI.get(unit, unit)

    def meaning(self, key: str) -> str:
        """The description that bergtow --list-keys prints."""
        self[key]
        return _keys()[key]["doc"]

    def copy(self) -> Case:
        other = object.__new__(Case)
        other.__dict__.update(self.__dict__, overrides=dict(self.overrides), _values=dict(self._values))
        return other

    def __repr__(self) -> str:
        name = self.path or self._values.get("run.title") or "case"
        changed = ", ".join(f"{k}={v}" for k, v in self.overrides.items())
        return f"<bergtow.Case {name}{': ' + changed if changed else ''}>"

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><td>{key}</td><td>{html.escape(str(value))} {self.unit(key)}</td>"
                       f"<td>{html.escape(self.meaning(key))}</td></tr>"
                       for key, value in self._values.items() if not (isinstance(value, float) and math.isnan(value)))
        return f"<details><summary>{html.escape(repr(self))}</summary><table>{rows}</table></details>"


__all__ = ["Case", "CaseError", "quantities"]
