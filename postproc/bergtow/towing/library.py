# SPDX-License-Identifier: MIT
"""Lines and vessels by name, from the tables of the package and from user tables.

Each row of lines.csv and vessels.csv has a source. A user table has the same head; its rows are added, and replace rows
of the same name. Values of lines are those of new ones. An empty cell of a vessel means unknown.

Polypropylene is that of `tow.line.type`, from the program's coefficients. The wires (6x36) and HMPE lines (eye-spliced)
of lines.csv are other products than its steel-wire (6x19) and dyneema, and break at other loads.
"""
from __future__ import annotations

import csv
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, Union

from .._library import limit
from ..case import preset
from ..errors import CASE, IO, BergtowError
from ._given import above_zero
from .vessel import STANDARD_GRAVITY

KNOT = 1852 / 3600  #: m/s
PathLike = Union[str, os.PathLike[str], None]


@dataclass(frozen=True)
class Line:
    name: str
    material: str
    diameter: float  #: nominal, m
    mass: float  #: in air, kg/m
    density: float  #: of the material, kg/m3
    stiffness: float  #: EA, N
    breaking: float  #: N
    source: str

    def weight(self, water_density: float | None = None) -> float:
        """Weight in water, N/m; 0 for a line that floats. Density of the water: by default that of a case."""
        water = preset("water.density") if water_density is None else water_density
        return max(0.0, self.mass * limit("gravity_m_s2") * (1 - water / self.density))


@dataclass(frozen=True)
class Vessel:
    name: str
    bollard_pull: float  #: N
    length: float  #: m; here and below: nan = unknown
    beam: float  #: m
    free_speed: float  #: m/s
    mass: float  #: kg
    source: str


#: head of a table: column, member, factor to SI (None: a text), may the cell be empty?
_LINES = (("name", "name", None, False), ("material", "material", None, False),
          ("diameter_mm", "diameter", 1e-3, False), ("mass_kg_m", "mass", 1, False),
          ("density_kg_m3", "density", 1, False),
          ("stiffness_kn", "stiffness", 1e3, False), ("breaking_kn", "breaking", 1e3, False),
          ("source", "source", None, False))
_VESSELS = (("name", "name", None, False), ("bollard_pull_t", "bollard_pull", 1e3 * STANDARD_GRAVITY, False),
            ("length_m", "length", 1, True), ("beam_m", "beam", 1, True), ("free_speed_kn", "free_speed", KNOT, True),
            ("mass_t", "mass", 1e3, True), ("source", "source", None, False))
Kind = TypeVar("Kind", Line, Vessel)


def _value(where: str, column: str, text: str, factor: float | None, optional: bool) -> Any:
    if factor is None:
        if not text:
            raise BergtowError(f"{where}: {column} is empty; fill it in", CASE)
        return text
    if not text and optional:
        return math.nan
    try:
        value = float(text) * factor
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise BergtowError(f"{where}: {column}: {text!r} is not a number above 0; correct it", CASE)
    return value


def _read(path: Path, columns: tuple[tuple[str, str, float | None, bool], ...],
          make: Callable[..., Kind]) -> dict[str, Kind]:
    head = [column for column, *_ in columns]
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = csv.reader(file)
            found = [c.strip() for c in next(rows, [])]
            if found != head:
                raise BergtowError(f"{path}:1: the head is {','.join(found) or 'empty'}; give {','.join(head)}", CASE)
            out: dict[str, Kind] = {}
            for row in rows:
                where = f"{path}:{rows.line_num}"
                if not any(c.strip() for c in row) or row[0].lstrip().startswith("#"):
                    continue
                if len(row) != len(head):
                    raise BergtowError(f"{where}: {len(row)} cells, but the header has {len(head)}; correct the row "
                                       "(put a text with a comma in quotes)", CASE)
                one = make(**{member: _value(where, column, text.strip(), factor, optional)
                              for text, (column, member, factor, optional) in zip(row, columns)})
                if one.name in out:
                    raise BergtowError(f"{where}: name: {one.name!r} is twice in this table; rename one", CASE)
                out[one.name] = one
            return out
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BergtowError(f"{path}: cannot be read ({error}); name a CSV file", IO) from None


def _table(name: str, columns: tuple[tuple[str, str, float | None, bool], ...], make: Callable[..., Kind],
           library: PathLike) -> dict[str, Kind]:
    found = _read(Path(__file__).parent / name, columns, make)
    return found if library is None else found | _read(Path(library), columns, make)


def _polypropylene() -> dict[str, Line]:
    mass, stiffness, breaking = limit("polypropylene_1_m")  # of a diameter of 1 m; all go with its square
    return {name: Line(name, "polypropylene", d, mass * d * d, 910, stiffness * d * d, breaking * d * d,
                       "8-strand polypropylene: mass, breaking load and EA Orcina OrcaFlex manual; density assumed")
            for d in (0.080, 0.096, 0.112, 0.128) for name in [f"polypropylene-{1000 * d:.0f}"]}


def lines(library: PathLike = None) -> dict[str, Line]:
    """{name: line}; library: a user table. Raises BergtowError with file, line and column."""
    return _polypropylene() | _table("lines.csv", _LINES, Line, library)


def vessels(library: PathLike = None) -> dict[str, Vessel]:
    """{name: vessel}; library: a user table. Raises BergtowError with file, line and column."""
    return _table("vessels.csv", _VESSELS, Vessel, library)


def _named(name: str, table: dict[str, Kind], kind: str) -> Kind:
    if name not in table:
        raise BergtowError(f"{kind}: {name!r} is not known; give one of {', '.join(table)}, or a table of your own")
    return table[name]


def find_line(name: str, library: PathLike = None) -> Line:
    """The line of this name. Raises BergtowError, with the available names."""
    return _named(name, lines(library), "line")


def find_vessel(name: str, library: PathLike = None) -> Vessel:
    """The vessel of this name. Raises BergtowError, with the available names."""
    return _named(name, vessels(library), "vessel")


def lightest_line(needed_breaking: float, library: PathLike = None, material: str | None = None) -> Line | None:
    """The line of least mass with at least this breaking load, N; None if there is none. Raises BergtowError for a load
    that is not above 0, and for a material of which no line is known."""
    above_zero(needed_breaking=needed_breaking)
    known = sorted({x.material for x in lines(library).values()})
    if material is not None and material not in known:
        raise BergtowError(f"material: no line is of {material!r}; give one of {', '.join(known)}")
    fit = [x for x in lines(library).values() if x.breaking >= needed_breaking and material in (None, x.material)]
    return min(fit, key=lambda x: x.mass, default=None)


def smallest_vessel(needed_bollard_pull: float, library: PathLike = None, known: tuple[str, ...] = ()) -> Vessel | None:
    """The vessel of least bollard pull that has at least this pull, N, and for which these members are known, such as
    "free_speed"; None if there is none. Raises BergtowError for a pull that is not above 0."""
    above_zero(needed_bollard_pull=needed_bollard_pull)
    fit = [x for x in vessels(library).values()
           if x.bollard_pull >= needed_bollard_pull and not any(math.isnan(getattr(x, member)) for member in known)]
    return min(fit, key=lambda x: x.bollard_pull, default=None)
