# SPDX-License-Identifier: MIT
"""Floe outlines of the NRC tests as GeoJSON: nrc_outlines.py demo_NRC_OEB_data.pkl floes.geojson

The file is that of https://github.com/rdesc/AUTO-IceNav, data/ (GPL-3: it is no part of this project). It is a pickle:
a program of opcodes, which pickle.load would run. Nothing is run here. `read` goes through the opcodes of a list of
dictionaries of numbers and arrays; it builds arrays of doubles from their bytes, and refuses everything else.
"""
import argparse
import json
import pickletools
import sys
from pathlib import Path

import numpy as np

#: callables by name, which are never called: how numpy writes an array, a number and their type
ARRAY, NUMBER = "numpy.core.multiarray _reconstruct", "numpy.core.multiarray scalar"
CLASS, TYPE = "numpy ndarray", "numpy dtype"
DOUBLE = "<f8"
LOCAL = "urn:x-bergtow:crs:local-metres-east-north"  #: src/field/map_crs.h
MARK = object()


class Refused(Exception):
    """The file holds something other than numbers and arrays."""


class Made:
    """What a callable would return: its name and arguments, with the state that BUILD gives it."""

    def __init__(self, name, arguments):
        self.name, self.arguments, self.state = name, arguments, None


def _value(made):
    """The number or array that is meant; other values as they are."""
    if not isinstance(made, Made):
        return made
    try:
        if made.name == NUMBER:
            kind, data = made.arguments
            count, columns = 1, ()
        else:
            _, columns, kind, fortran, data = made.state
            count = int(np.prod(columns))
            if made.name != ARRAY or made.arguments[0] != CLASS or fortran is not False:
                raise ValueError
        # ("f8", False, True) with the state (3, "<", None, ...): little-endian doubles
        if kind.name != TYPE or kind.state[1] + kind.arguments[0] != DOUBLE or len(data) != 8 * count:
            raise ValueError
        return np.frombuffer(data, DOUBLE).reshape(columns)[()]
    except (AttributeError, TypeError, ValueError, IndexError):
        raise Refused("an object that is no array of doubles") from None


def read(data):
    """Values of a pickle: lists, dictionaries, tuples, texts, numbers and arrays of doubles. Errors: Refused."""
    stack, memo = [], []

    def since_mark():
        at = len(stack) - 1 - next(k for k, v in enumerate(reversed(stack)) if v is MARK)
        found = stack[at + 1:]
        del stack[at:]
        return found

    try:
        for opcode, argument, _ in pickletools.genops(data):
            name = opcode.name
            if name in ("PROTO", "FRAME"):
                continue
            if name in ("BININT", "BININT1", "BININT2", "BINFLOAT", "SHORT_BINBYTES", "BINBYTES", "SHORT_BINUNICODE",
                        "BINUNICODE"):
                stack.append(argument)
            elif name in ("NONE", "NEWTRUE", "NEWFALSE"):
                stack.append({"NONE": None, "NEWTRUE": True, "NEWFALSE": False}[name])
            elif name in ("EMPTY_LIST", "EMPTY_DICT", "EMPTY_TUPLE"):
                stack.append({"EMPTY_LIST": list, "EMPTY_DICT": dict, "EMPTY_TUPLE": tuple}[name]())
            elif name == "MARK":
                stack.append(MARK)
            elif name == "MEMOIZE":
                memo.append(stack[-1])
            elif name in ("BINGET", "LONG_BINGET"):
                stack.append(memo[argument])
            elif name in ("TUPLE1", "TUPLE2", "TUPLE3"):
                count = int(name[-1])
                stack[-count:] = [tuple(stack[-count:])]
            elif name == "TUPLE":
                stack.append(tuple(since_mark()))
            elif name == "APPENDS":
                values = since_mark()
                stack[-1].extend(map(_value, values))
            elif name == "SETITEMS":
                values = since_mark()
                stack[-1].update(zip(values[::2], map(_value, values[1::2])))
            elif name == "STACK_GLOBAL":
                module, word = stack.pop(-2), stack.pop()
                stack.append(f"{module} {word}")
                if stack[-1] not in (ARRAY, NUMBER, CLASS, TYPE):
                    raise Refused(stack[-1])
            elif name == "REDUCE":
                arguments = stack.pop()
                stack[-1] = Made(stack[-1], arguments)
            elif name == "BUILD":
                state = stack.pop()
                stack[-1].state = state
            elif name == "STOP":
                return _value(stack.pop())
            else:
                raise Refused(f"opcode {name}")
    except (AttributeError, IndexError, StopIteration, TypeError, ValueError) as error:
        raise Refused(f"not well formed ({error})") from None
    raise Refused("no end")


def outlines(found):
    """[n, 2] of each floe in the frame of ship.yml: x along the strip from the end at which the ship starts, y across
    from its middle, m. Errors: Refused."""
    if not isinstance(found, list) or not found:
        raise Refused("not a list of floes")
    try:
        rings = [np.array(floe["vertices"], dtype=float) for floe in found]
        if any(ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 3 or not np.isfinite(ring).all() for ring in rings):
            raise ValueError
    except (KeyError, TypeError, ValueError):
        raise Refused("a floe without vertices") from None
    across = np.concatenate(rings)[:, 0]
    middle = (across.min() + across.max()) / 2
    return [np.column_stack([ring[:, 1], middle - ring[:, 0]]) for ring in rings]


def write(rings, target):
    """Write outlines as GeoJSON in metres of the frame. Errors: OSError."""
    features = [{"type": "Feature", "properties": {"id": k}, "geometry": {
        "type": "Polygon", "coordinates": [np.vstack([ring, ring[:1]]).tolist()]}} for k, ring in enumerate(rings, 1)]
    Path(target).parent.mkdir(parents=True, exist_ok=True)
    Path(target).write_text(json.dumps({"type": "FeatureCollection", "features": features,
                                        "crs": {"type": "name", "properties": {"name": LOCAL}}}), encoding="utf-8")


def main(argv=None):
    p = argparse.ArgumentParser(description="Floe outlines of the NRC tests as GeoJSON.")
    p.add_argument("pickle", type=Path, help="demo_NRC_OEB_data.pkl of github.com/rdesc/AUTO-IceNav")
    p.add_argument("geojson", type=Path, help="file to write")
    a = p.parse_args(argv)
    try:
        rings = outlines(read(a.pickle.read_bytes()))
        write(rings, a.geojson)
        print(f"{a.geojson}: {len(rings)} floes")
    except (Refused, OSError) as error:
        print(f"nrc_outlines.py: {a.pickle}: {error}; give the file as it is published", file=sys.stderr)
        sys.exit(4)


if __name__ == "__main__":
    main()
