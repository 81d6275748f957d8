# SPDX-License-Identifier: MIT
"""The width that a domain with periodic sides needs for its ice, by the rule of `bergtow check`: a load that the
periodic images of the body carry must not enter a design. Walls are part of the case, and stay in place; so does the
length of a domain if the tow runs along y, which gets a warning."""
import json
import math

from bergtow.study.case_file import says
from bergtow.study.runs import checked

#: if a case sets one of these, its ice has a fixed position, and the domain is not widened
PLACED = "domain.y0", "ice.y_min", "ice.y_max", "ice.extent.y_min", "ice.extent.y_max"


def add_option(parser):
    parser.add_argument("--keep-width", action="store_true", help="keep domain.width of the case, although dense ice "
                        "needs a wider domain")


def reads_ice(case):
    """Is the ice of a case read from a file, so that there is no concentration to vary?"""
    return any(str(says(case, "ice", k) or "none") != "none" for k in ("outlines", "field"))


def stays(case, replaced):
    """Does the width of this case stay as it is? replaced: keys that are overridden."""
    return (reads_ice(case) or any(says(case, *key.split(".")[:2]) is not None for key in PLACED)
            or bool({"domain.width", *PLACED} & set(replaced)))


def wide_enough(domain):
    """The width, m, to three digits, that the ice in a domain needs; None if the domain has it or cannot have it."""
    there, needed = domain["body_widths"], domain["body_widths_needed"]
    if domain["across"] != "domain.width" or domain["sides"] != "periodic images":
        return None
    if not there or not needed or needed <= there:
        return None
    width = domain["width_m"] * needed / there
    digit = 10.0 ** (math.floor(math.log10(width)) - 2)
    return round(math.ceil(width / digit) * digit, 6)


def needed(binary, path, sets):
    """domain.width, as text, that the case at this path needs with these keys replaced ("key=value"); None if it is
    wide enough. Raises RunError."""
    width = wide_enough(json.loads(checked(binary, path, sets, "--json"))["domain"])
    return None if width is None else f"{width:g} m"
