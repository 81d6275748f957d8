# SPDX-License-Identifier: MIT
"""Where floes lie over each other: the intersections of convex outlines, for pictures."""
import numpy as np

LEAST = 1e-3  # of a floe's area: less is the slop of the solver


def intersection(a, b):
    """Convex polygon a cut by convex polygon b, both [n, 2] and anticlockwise [Sutherland & Hodgman 1974]; [m, 2]."""
    for p, q in zip(b, np.roll(b, -1, axis=0)):
        if len(a) == 0:
            break
        side = (q[0] - p[0]) * (a[:, 1] - p[1]) - (q[1] - p[1]) * (a[:, 0] - p[0])
        out = []
        for i in range(len(a)):
            if (side[i] >= 0) != (side[i - 1] >= 0):
                out.append(a[i - 1] + side[i - 1] / (side[i - 1] - side[i]) * (a[i] - a[i - 1]))
            if side[i] >= 0:
                out.append(a[i])
        a = np.array(out).reshape(-1, 2)
    return a


def area(p):
    """Signed, m²."""
    return 0.5 * float(np.sum(p[:, 0] * np.roll(p[:, 1], -1) - np.roll(p[:, 0], -1) * p[:, 1])) if len(p) > 2 else 0.0


def near(middle, reach):
    """Pairs (i, j), i < j, in ascending order, of circles that overlap: middles [n, 2], radii [n]."""
    order = np.argsort(middle[:, 0], kind="stable")
    x = middle[order, 0]
    ends = np.searchsorted(x, x + 2 * reach.max(), side="right")
    found = []
    for k, (i, end) in enumerate(zip(order, ends)):
        others = order[k + 1:end]
        close = np.hypot(*(middle[others] - middle[i]).T) < reach[others] + reach[i]
        found += [(min(i, j), max(i, j)) for j in others[close]]
    return sorted(found)


def overlaps(outlines):
    """Polygons in which outlines [n][k, 2], repeated corners allowed, overlap by more than the slop: pair by pair."""
    kept = []
    for p in outlines:
        p = np.asarray(p)
        p = p[np.any(p != np.roll(p, 1, axis=0), axis=1)]
        kept.append(p if area(p) > 0 else p[::-1])
    if len(kept) < 2:
        return []
    middle = np.array([p.mean(axis=0) for p in kept])
    reach = np.array([np.hypot(*(p - m).T).max() for p, m in zip(kept, middle)])
    size = np.array([area(p) for p in kept])
    found = []
    for i, j in near(middle, reach):
        both = intersection(kept[i], kept[j])
        if area(both) > LEAST * min(size[i], size[j]):
            found.append(both)
    return found
