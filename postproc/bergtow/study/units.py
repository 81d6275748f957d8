# SPDX-License-Identifier: MIT
"""Numbers with units, as the program reads them, that belong to no key of a case: a width of a bracket, a speed to
keep.

A value of a key is for the program to read, which also knows what the case allows; here only the unit counts.
"""
import json
import re
import subprocess
from functools import lru_cache

from bergtow.errors import USAGE, RunError

NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$")
BARE = {"rad": "deg", "rad/s": "deg/s"}  # unit of a number without one, where that is not SI


@lru_cache
def table(binary):
    """{(symbol, SI symbol): (up, down)} of all units: SI = number · up / down."""
    listed = subprocess.run([str(binary), "--list-keys", "--json"], capture_output=True, text=True, check=True).stdout
    return {(u["symbol"], u["si"]): (u["up"], u["down"]) for u in json.loads(listed)["units"]}


def number(binary, what, text, si):
    """The number `text` of a kind of which `si` is the SI unit ("" for plain numbers), in that. Errors: RunError."""
    known = [symbol for symbol, unit in table(binary) if unit == si]
    match = NUMBER.match(text)
    symbol = (match[2] or BARE.get(si, si)) if match else None
    if match and symbol in ("", *known):
        up, down = table(binary).get((symbol, si), (1, 1))
        return float(match[1]) * up / down
    raise RunError(f"{what} {text}", f"is no number{f' of {si}' if si else ''}",
                   f"give a number{' with one of the units ' + ', '.join(known) if si else ''}", USAGE)
