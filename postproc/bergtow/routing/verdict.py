# SPDX-License-Identifier: MIT
"""Which route is better than the straight line, and is the difference significant?

The best of several routes looks better than it is in the members that were used to select it. So one half of the
members selects, and the other half judges: the interval is that of the paired differences to the straight line in
members that had no part in the selection. A tow fails if it misses the goal, touches a no-go area, parts its line, or
exceeds the force limit. Tows are ranked first by their failures, then by the mean of the objective. A straight line
that fails in every member that judges is no line to compare with: if the chosen route fails in none of them, it is
taken, however few they are.
"""
from bergtow.stats.mean import LEVEL, t_interval

import numpy as np
import scipy.stats

FAULTS = ("missed", "no_go_contact", "limit_exceeded", "parted", "slack")
FAILURES = FAULTS[:-1]  #: a slack line is reported, but is not a failure


def halves(n):
    """(members that select, members that judge); a single member does both."""
    return (range(n), range(n)) if n < 2 else (range(n // 2), range(n // 2, n))


def fault(tow, name):
    return not tow["arrived"] if name == "missed" else tow[name]


def fails(tow):
    return any(fault(tow, name) for name in FAILURES)


def value(tow, objective):
    """Value of the objective; NaN if the tow did not arrive, since it was then not completed."""
    return tow[objective] if tow["arrived"] else np.nan


def rank(tows, some, objective):
    """Sort key: failures, then the mean of the objective."""
    values = [value(tows[i], objective) for i in some]
    known = [v for v in values if np.isfinite(v)]
    return sum(fails(tows[i]) for i in some), np.mean(known) if known else np.inf


def compared(tows, straight, some, objective):
    """Paired differences from the straight line in the objective and in failures, over some members."""
    a, b = (np.array([value(t[i], objective) for i in some]) for t in (tows, straight))
    both = np.isfinite(a) & np.isfinite(b)
    d = a[both] - b[both]
    low, high = t_interval(d)
    mean = float(d.mean()) if len(d) else np.nan
    base = float(b[both].mean()) if both.any() else np.nan
    better = sum(fails(straight[i]) and not fails(tows[i]) for i in some)
    worse = sum(fails(tows[i]) and not fails(straight[i]) for i in some)
    # sign test on the members in which exactly one of the two fails
    chance = float(scipy.stats.binom.sf(better - 1, better + worse, 0.5)) if better + worse else 1.0
    return {"pairs": int(both.sum()), "difference": mean, "difference_95": [float(low), float(high)],
            "relative": mean / base, "relative_95": [float(low) / base, float(high) / base],
            "fails_less": better, "fails_more": worse, "chance_of_fails": chance}


def shown(c):
    """Is this route significantly better?"""
    if c["fails_less"] > c["fails_more"]:
        return c["chance_of_fails"] <= (1 - LEVEL) / 2
    return c["fails_more"] == 0 and bool(c["difference_95"][1] < 0)


def of(candidates, outcomes, objective):
    """The verdict. candidates: [Candidate]; outcomes: {name: [tow of each member]}. `code`: better, not_shown,
    one_member, straight_not_passable, no_route."""
    n = len(next(iter(outcomes.values())))
    choose, judge = halves(n)
    order = sorted(candidates, key=lambda c: (rank(outcomes[c.name], choose, objective), c.name))
    lines = [c for c in order if c.straight and "no_go" not in c.route.faults]
    others = [c for c in order if not c.straight]
    out = {"members": n, "chose": [i + 1 for i in choose], "judged": [i + 1 for i in judge],
           "order": [c.name for c in order], "straight": lines[0].name if lines else None,
           "chosen": others[0].name if others else None, "recommended": None, "compared": {}}
    if not others:
        return out | {"code": "no_route"}
    if not lines:
        passable = not any(fails(outcomes[others[0].name][i]) for i in judge)
        return out | {"code": "straight_not_passable", "recommended": others[0].name if passable else None}
    straight = outcomes[lines[0].name]
    out["compared"] = {c.name: compared(outcomes[c.name], straight, judge, objective) for c in order}
    first = min((c for c in candidates if c in lines or not c.straight), key=lambda c: c.route.cost)
    values = [(value(outcomes[first.name][i], objective), value(straight[i], objective)) for i in range(n)]
    out["planner_best"] = {"name": first.name, "members": n,
                           "straight": first.straight, "lost": sum(np.isfinite(b) and not a <= b for a, b in values)}
    if n < 2:
        return out | {"code": "one_member"}
    c = out["compared"][others[0].name]
    better = shown(c) or c["fails_less"] == len(judge)
    return out | {"code": "better" if better else "not_shown", "recommended": others[0].name if better else None}
