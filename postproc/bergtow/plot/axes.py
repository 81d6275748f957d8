# SPDX-License-Identifier: MIT
"""Elements shared by pictures of an ensemble: the varied numbers, labels, headline."""
from bergtow.plot import style
from bergtow.result.members import reading, short_key

import numpy as np


def numeric(e):
    """Numeric keys that vary among the members in use."""
    return [k for k, v in e.parameters.items() if v.dtype != object and len(set(v[e.used].tolist())) > 1]


def axis_label(e, key):
    unit = reading(key, e.units[key])[1]
    return short_key(key) + (f" ({unit})" if unit else "")


def headline(figure, e, subject):
    doubtful = sum(bool(e.doubts(m)) for m in e.used)
    words = [f"{len(e.used)} members"]
    if doubtful:
        words.append(f"{doubtful} with warnings")
    missing = e.n - len(e.used) - len(e.copies)
    if missing:
        words.append(f"{missing} failed, waiting or left out")
    if e.copies:
        words.append(f"{len(e.copies)} the same run as another")
    if without := e.without_bound(np.arange(e.n)):
        some = {e.condition[e.name.index(name)] for name in [*without.some, *without.ended]}
        words.append(f"at least these in {len(some)} of {len(np.unique(e.condition))} conditions: no load in "
                     f"{100 * without.share:.2g} % of the steps, {len(without.ended)} tows ended for it")
    style.head(figure, f"{style.plain(e.title)}: {subject}", ", ".join(words))


def wants_log(values):
    """True if the values are positive and span more than a decade and a half."""
    values = np.asarray(values, dtype=float)
    values = values[np.isfinite(values)]
    return bool(len(values) and values.min() > 0 and values.max() > 30 * values.min())
