# SPDX-License-Identifier: MIT
"""Cases: what a simulation depends on, as the keys of a case file, each checked by the library."""
from __future__ import annotations

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
from ._library import CaseError


@functools.cache
def _keys() -> dict[str, dict[str, Any]]:
    """{key: what the library knows of it}."""
    listed = json.loads(_library.take_text(_library.library().bt_list_json(b"keys")))
    return {key["name"]: key for key in listed["keys"]}


def quantities() -> dict[str, Any]:
    """The numbers that a run leaves: series, keys of the summary, estimates, with units and meaning."""
    return json.loads(_library.take_text(_library.library().bt_list_json(b"quantities")))


#: units of values as they are read, where a case file takes a bare number for something else
_SI = {"deg": "rad", "deg/s": "rad/s", "-": ""}


def _setting(key: str, value: Any) -> str:
    """A value for a key as a case file has it: numbers are in SI units here, angles in radians."""
    unit = _keys()[key].get("unit") if key in _keys() else None
    in_radians = unit in ("deg", "deg/s") and not isinstance(value, str)
    return _as_text(value) + (f" {_SI[str(unit)]}" if in_radians else "")


def _as_text(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_as_text(v) for v in value) + "]"
    return repr(value)


def _parsed(text: str, kind: str) -> Any:
    """A value of the resolved case, in SI units."""
    if text == "none" and kind != "choice":
        return None
    if text.startswith('"'):
        return json.loads(text)
    if text.startswith("["):
        return json.loads(re.sub(r"(?<=[\d.]) [^\W\d][^,\]]*", "", text))  # without units
    if kind == "integer":
        return int(text)
    if kind == "real":
        return float(text.split(" ")[0])
    return text == "true" if kind == "bool" else text


class Case(MutableMapping[str, Any]):
    """A case from a file, or from a mapping of sections as in a file.

        case = Case("basin-80.yml", {"ice.concentration": 0.7})
        case["tow.speed"] = "1.5 kn"      # a text is read as in a file
        case["tow.speed"]                 # 0.7716..., numbers are in SI units, angles in radians, both ways
        case.unit("tow.speed")            # 'm/s'

    Every value is checked when it is set; one that will not do raises CaseError and changes nothing. Where several
    values only fit together, set them at once: case.update({...}). None stands for a key that has no value. The numbers
    of a mapping of sections are those of a file: angles in degrees.
    """

    def __init__(self, source: str | os.PathLike[str] | Mapping[str, Any] | None,
                 values: Mapping[str, Any] | None = None, *, text: str | None = None) -> None:
        self.path = None if source is None or isinstance(source, Mapping) else os.fspath(source)
        self.text = text if text is not None else json.dumps(source, indent=1) if isinstance(source, Mapping) else None
        if self.path is None and self.text is None:
            raise TypeError("a case needs a file, a mapping or a text")
        self.overrides: dict[str, str] = {}  #: {key: text} that were set here
        self._resolve(self.overrides | {k: _setting(k, v) for k, v in (values or {}).items()})

    @classmethod
    def from_text(cls, text: str, values: Mapping[str, Any] | None = None,
                  path: str | os.PathLike[str] | None = None) -> Case:
        """A case from the text of a case file; path: its name in messages, beside which files it names are."""
        return cls(path, values, text=text)

    def _resolve(self, overrides: dict[str, str]) -> None:
        address = ctypes.c_void_p()
        before, self.overrides = self.overrides, overrides
        try:
            library = _library.library()
            _library.check(library.bt_case_check_text(ctypes.byref(_library.options(self)), ctypes.byref(address)))
        except Exception:
            self.overrides = before
            raise
        self.resolved = _library.take_text(address.value)  #: every key with its value, as a case file
        self._values = self._read(self.resolved)

    @staticmethod
    def _read(text: str) -> dict[str, Any]:
        values: dict[str, Any] = {}
        path: list[str] = []
        for line in text.splitlines():
            match = re.match(r'( *)([\w]+):(?: ("(?:\\.|[^"\\])*"|\[.*\]|.*?))?(?:  # .*)?$', line)
            if not match:
                continue
            del path[len(match[1]) // 2:]
            path.append(match[2])
            key = ".".join(path)
            if match[3] and key in _keys():
                values[key] = _parsed(match[3].strip(), _keys()[key]["type"])
        return values

    def __getitem__(self, key: str) -> Any:
        if key not in _keys():
            raise KeyError(f"{key}: unknown key; see bergtow --list-keys")
        return self._values.get(key)

    def __setitem__(self, key: str, value: Any) -> None:
        self._resolve(self.overrides | {key: _setting(key, value)})

    def update(self, values: Any = (), **more: Any) -> None:  # type: ignore[override]
        """Set several values at once, which are checked together."""
        self._resolve(self.overrides | {k: _setting(k, v) for k, v in dict(values, **more).items()})

    def __delitem__(self, key: str) -> None:
        """Take back a value that was set: that of the file, or the default, holds again."""
        if key not in self.overrides:
            raise KeyError(f"{key}: has not been set")
        self._resolve({k: v for k, v in self.overrides.items() if k != key})

    def __iter__(self) -> Iterator[str]:
        return iter(_keys())

    def __len__(self) -> int:
        return len(_keys())

    def __contains__(self, key: object) -> bool:
        return key in _keys()

    def unit(self, key: str) -> str:
        """Unit of the value as it is read; '' for plain numbers, texts and choices."""
        self[key]
        unit = _keys()[key].get("unit") or ""
        return _SI.get(unit, unit)

    def meaning(self, key: str) -> str:
        """The sentence of bergtow --list-keys."""
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
