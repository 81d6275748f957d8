# SPDX-License-Identifier: MIT
"""Where floes lie over each other: the intersections of convex outlines, for pictures.

Many pairs are processed at a time, corner by corner: a picture of 37,000 floes has 100,000 pairs of neighbours, which
one by one would take half a minute.
"""
import numpy as np

LEAST = 1e-3   # of a floe's area: smaller overlaps are the solver's slop
BATCH = 20000  # pairs at a time: some 100 MB


def _clipped(a, count, p, q):
    """Clip polygons to the left of the line from p to q [P, 2]: (corners [P, K, 2], count [P])."""
    corner = np.arange(a.shape[1])
    there = corner < count[:, None]
    side = (q[:, :1] - p[:, :1]) * (a[:, :, 1] - p[:, 1:]) - (q[:, 1:] - p[:, 1:]) * (a[:, :, 0] - p[:, :1])
    rows = np.arange(len(a))[:, None]
    before = np.where(corner > 0, corner - 1, np.maximum(count[:, None] - 1, 0))
    last, last_side = a[rows, before], side[rows, before]
    crosses = there & ((side >= 0) != (last_side >= 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        cut = last + (last_side / (last_side - side))[:, :, None] * (a - last)
    kept = np.stack([crosses, there & (side >= 0)], axis=2).reshape(len(a), -1)
    found = np.stack([cut, a], axis=2).reshape(len(a), -1, 2)
    count = kept.sum(axis=1)
    out = np.zeros((len(a), max(int(count.max(initial=0)), 1), 2))
    row, k = np.nonzero(kept)
    out[row, (np.cumsum(kept, axis=1) - 1)[row, k]] = found[row, k]
    return out, count


def intersections(a, a_count, b, b_count):
    """Intersections of convex polygons a [P, K, 2] and b [P, L, 2], both anticlockwise, with a_count and b_count
    corners [Sutherland & Hodgman 1974]: (corners [P, M, 2], count [P])."""
    a, count = a.copy(), a_count.copy()
    for k in range(b.shape[1]):
        now = np.flatnonzero((k < b_count) & (count > 0))
        if not len(now):
            continue
        cut, left = _clipped(a[now], count[now], b[now, k], b[now, (k + 1) % b_count[now]])
        if cut.shape[1] > a.shape[1]:
            a = np.pad(a, ((0, 0), (0, cut.shape[1] - a.shape[1]), (0, 0)))
        a[now, :cut.shape[1]], count[now] = cut, left
    return a, count


def areas(a, count):
    """[P] m² of anticlockwise polygons [P, K, 2] with the given numbers of corners."""
    a = a - a[:, :1]  # avoids the loss of digits far from the origin
    corner = np.arange(a.shape[1])
    after = np.where(corner + 1 < count[:, None], corner + 1, 0)
    after = a[np.arange(len(a))[:, None], after]
    return 0.5 * np.sum(np.where(corner < count[:, None], a[:, :, 0] * after[:, :, 1] - after[:, :, 0] * a[:, :, 1],
                                 0.0), axis=1)


def near(middle, reach):
    """Pairs [P, 2] (i, j), i < j, in ascending order, of circles that overlap: centres [n, 2], radii [n].

    Space is divided into columns as wide as the largest circle. The neighbours of a circle lie in its own column and
    the next one, and a search in a single sorted key, made of column and y, finds them.
    """
    wide = 2 * reach.max() or 1.0
    x, y = (middle - middle.min(axis=0)).T
    high = y.max() + 2 * wide
    key = np.floor(x / wide) * high + y
    order = np.argsort(key, kind="stable")
    key, found, n = key[order], [], np.arange(len(order))
    for first, end in ((n + 1, key + wide), (np.searchsorted(key, key + high - wide), key + high + wide)):
        more = np.searchsorted(key, end, side="right") - first
        i = np.repeat(n, more)
        j = first[i] + np.arange(len(i)) - np.repeat(np.cumsum(more) - more, more)
        i, j = order[i], order[j]
        close = np.hypot(*(middle[j] - middle[i]).T) < reach[i] + reach[j]
        found.append(np.sort(np.stack([i[close], j[close]], axis=1), axis=1))
    found = np.concatenate(found)
    return found[np.lexsort(found.T[::-1])]


def _apart(a, b, b_count):
    """[P] of bool: does an edge of b have all corners of a [P, K, 2] (padded with repeats) on its outer side?"""
    corner = np.arange(b.shape[1])
    after = b[np.arange(len(b))[:, None], (corner + 1) % b_count[:, None]]
    edge = np.where((corner < b_count[:, None])[:, :, None], after - b, 0.0)
    inside = np.einsum("pl,pk->plk", edge[:, :, 0], a[:, :, 1]) - np.einsum("pl,pk->plk", edge[:, :, 1], a[:, :, 0])
    return (inside.max(axis=2) < edge[:, :, 0] * b[:, :, 1] - edge[:, :, 1] * b[:, :, 0]).any(axis=1)


def overlaps(outlines):
    """Polygons where outlines [n, k, 2] (corners may repeat) overlap by more than the slop, pair by pair."""
    outlines = np.asarray(outlines, dtype=float)
    n, most = outlines.shape[:2]
    if n < 2:
        return []
    own = np.any(outlines != np.roll(outlines, 1, axis=1), axis=2)
    count = own.sum(axis=1)
    order = np.argsort(~own, axis=1, kind="stable")
    kept = np.take_along_axis(outlines, order[:, :, None], axis=1)
    turned = areas(kept, count) < 0
    backwards = np.maximum(count[:, None] - 1 - np.arange(most), 0)
    kept[turned] = np.take_along_axis(kept, backwards[:, :, None], axis=1)[turned]
    there = np.arange(most) < count[:, None]
    kept = np.where(there[:, :, None], kept, kept[:, :1])
    middle = (kept * there[:, :, None]).sum(axis=1) / np.maximum(count, 1)[:, None]
    reach = np.hypot(*(kept - middle[:, None]).transpose(2, 0, 1)).max(axis=1)
    size, pairs, found = areas(kept, count), near(middle, reach), []
    for some in np.array_split(pairs, 1 + len(pairs) // BATCH):
        i, j = some.T
        # relative to the middle of one of them, for the same reason
        a, b = kept[i] - middle[i, None], kept[j] - middle[i, None]
        meet = ~(_apart(a, b, count[j]) | _apart(b, a, count[i]))
        i, j = i[meet], j[meet]
        both, corners = intersections(a[meet], count[i], b[meet], count[j])
        for k in np.flatnonzero(areas(both, corners) > LEAST * np.minimum(size[i], size[j])):
            found.append(both[k, :corners[k]] + middle[i[k]])
    return found
