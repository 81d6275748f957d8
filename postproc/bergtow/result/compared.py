# SPDX-License-Identifier: MIT
"""Apply converge.json to another study: use only its rows for the values that the study runs with, not those for other
values that were tried.

A row compares one value of a quantity with the next, its `from` with its `to`, and the next row begins where it ends.
So the numerical error of a study follows from the row whose `from` is the study's value, and from the rows after it.
"""
import hashlib

import numpy as np

from bergtow.result.members import FINISHED
from bergtow.result.run import case_value

#: {quantity of bergtow converge: its key}
KEYS = {"start": "tow.ramp", "width": "domain.width", "length": "domain.length", "dt": "run.dt",
        "tolerance": "solver.tolerance", "window": "output.window_start"}
WINDOW = 0.01  # relative to its length: ends of a window fall on steps
#: keys that make a different case; not the position of the domain, which changes with its size
PHYSICAL = ("ice.", "body.", "tow.", "water.", "air.", "lead.", "domain.ends", "domain.sides", "domain.wall_")
PLACES = ("ice.seed", "ice.x_min", "ice.x_max", "ice.y_min", "ice.y_max", "ice.extent.x_min",
          "ice.extent.x_max", "ice.extent.y_min", "ice.extent.y_max", "body.x", "body.y", "tow.ramp")


def cases(e):
    """[{key: text}] of those members of an ensemble that can be read."""
    return list(e.each(e.used, lambda run: run.case))


def _one(values, slack):
    """The value common to all; None if they differ or none is known."""
    values = np.array(values, dtype=float)
    if not len(values) or not np.isfinite(values).all() or np.ptp(values) > slack * np.abs(values).max():
        return None
    return float(values[0])


def values(e, texts):
    """{quantity: the value common to all members, None if they differ or it is unknown}; for the window its two ends,
    s, or None. texts: from cases()."""
    out = {name: _one([case_value(text, key) for text in texts], 1e-9) for name, key in KEYS.items()}
    ends = [_one([e.number(f"window_{end}_s", m) for m in e.used], WINDOW) for end in ("start", "end")]
    return out | {"window": None if None in ends else tuple(ends)}


def _begins(row, value):
    """Does the row compare this value with the next?"""
    at = row.get("from")
    if at is None or value is None:
        return False
    if row["name"] != "window":
        return bool(np.isclose(at, value, rtol=1e-6, atol=0))
    start, end = value  # `to` is the middle
    return abs(at - start) <= WINDOW * (end - start) and abs(row["to"] - (start + end) / 2) <= WINDOW * (end - start)


def chain(rows, name, value):
    """Rows of a quantity starting from this value; [] if no row begins there. A row without values, where nothing could
    be compared, applies to the case whatever its value."""
    some = [row for row in rows if row["name"] == name]
    begin = next((k for k, row in enumerate(some) if _begins(row, value)), len(some))
    return some[begin:] or [row for row in some if "from" not in row]


def verdicts(rows, own):
    """{compared quantity: "matters", "none" or "open" at the study's own value, "elsewhere" if that value was not
    compared}."""
    return {name: found[0]["judged"] if (found := chain(rows, name, own.get(name))) else "elsewhere"
            for name in dict.fromkeys(row["name"] for row in rows if row["name"] in KEYS)}


def _differ(a, b):
    """Are two values of a key different? For files only the names count, since folders move."""
    x, y = (case_value({"": text}, "") for text in (a, b))
    if np.isfinite([x, y]).all():
        return not np.isclose(x, y, rtol=1e-9, atol=1e-12)
    return a.rpartition("/")[2] != b.rpartition("/")[2]


def _physical(texts):
    """(key) -> does it make a different case? If none of these cases has a lead, its extent, which follows from the
    tow, does not."""
    lead = any(text.get("lead.mode") != "none" for text in texts)
    physical = tuple(key for key in PHYSICAL if lead or key != "lead.")
    return lambda key: key.startswith(physical) and key not in PLACES


def unlike(a, b, but=()):
    """(key, its text in a, in b) of differences that make b a different case: keys that both have, except `but`."""
    physical = _physical((a, b))
    for key, value in a.items():
        counts = physical(key) or key.startswith(("run.dt", "estimate."))
        if counts and key not in but and key in b and _differ(value, b[key]):
            yield key, value, b[key]


def common(texts):
    """{key: text} that all these cases have in common."""
    return {k: v for k, v in (texts[0] if texts else {}).items() if all(t.get(k) == v for t in texts)}


def state(e):
    """Identify the study, and the number of its finished members: {"study", "finished"}."""
    return {"study": hashlib.sha256(e.study.encode()).hexdigest(), "finished": int(np.sum(e.status == FINISHED))}


def stale(found, e):
    """Why a result with state(e) no longer belongs to this ensemble; "" if it does, or has no state."""
    now = state(e)
    if found.get("study", now["study"]) != now["study"]:
        return "of a different study from that in its folder"
    then = found.get("finished", now["finished"])
    return "" if then == now["finished"] else f"of {then} members, while {now['finished']} have finished"


def _physical_values(found, texts):
    """(key, its text in the result, its texts in the members' cases) for the keys that make a different case."""
    values = found.get("values") or {}
    physical = _physical((values, *texts))
    for key, value in values.items():
        some = list(dict.fromkeys(text[key] for text in texts if key in text))
        if some and physical(key):
            yield key, value, some


def _among(value, some):
    """Is a value one of these, or between the least and the largest of them if they are numbers?"""
    numbers = np.array([case_value({"": text}, "") for text in some])
    x = case_value({"": value}, "")
    between = np.isfinite([x, *numbers]).all() and numbers.min() <= x <= numbers.max()
    return between or not all(_differ(value, text) for text in some)


def misfit(found, texts, base):
    """Why a result belongs to a different case than the members (texts of cases()): a key of the ice, the body, the
    tow, water or air has a value that none of them has. "" if it belongs to them, or does not name its case. base:
    Members.base: the base case of a hypercube often lies at the end of a range, where no member does, and so do the
    keys that follow from those varied."""
    for key, value, some in _physical_values(found, texts):
        if not _among(value, some) and _differ(value, base.get(key, "")):
            return f"{key} is {value} there and {some[0] if len(some) == 1 else f'of {len(some)} other values'} here"
    return ""


def alone(found, texts):
    """The values of a result for which the members have several: "ice.concentration 0.8"; "" if the members have no
    others."""
    return ", ".join(f"{key} {value}" for key, value, some in _physical_values(found, texts)
                     if any(_differ(value, text) for text in some))
