# SPDX-License-Identifier: MIT
"""Shores that were drawn along pixels: from the staircase to the straightest shore within half a pixel of it.

    shore(points)       the ring (n, 2), in pixels, of a staircase: its points one step of the pixels after the other

Each coordinate for itself may move by half a pixel, and of all rings that do not leave these bands the one is taken
whose coordinates, over the steps, are the shortest strings: minimise Σ φ(x_{i+1} − x_i) with |x_i − a_i| ≤ ½, whose
solution is the same for every convex φ [Davies & Kovac 2001, Ann. Statist. 29, 1, taut string]. It bends only where it
touches a bound, away from it. So a row of pixels that a straight shore has made becomes straight, a convex shape whose
pixels these are convex, and what is left of bays is deeper than a pixel.

The strings lie on the inside of convex shores and on the outside of bays. What that takes from the area the shore gets
back when it moves out as a whole (map_repair.with_area), by less than half a pixel.

Rejected: Douglas & Peucker alone, which keeps vertices of the staircase and so its small bays (of 237 floes of a mosaic
229 were not convex); the convex hull where it is near enough, which says nothing of a floe with one real bay.
"""
import numpy as np

HALF = 0.5              # pixels
LATTICE = 0.02          # of a step: by as much coordinates may be rounded


def string(a, half):
    """Where the taut string within a ± half bends: (places, values), of a closed sequence a. Empty: it is constant."""
    start, n = int(np.argmax(a)), len(a)
    top = a[start] - half   # a ring does not rise above the highest of its lower bounds, and there it is on it
    if top <= a.min() + half:
        return np.zeros(0, int), np.zeros(0)
    around = np.roll(a, -start).tolist()
    low, high = [v - half for v in around] + [top], [v + half for v in around] + [top]
    high[0] = top
    at, value, bends = 0, top, [(0, top)]
    while at < n:
        # the slopes from here that pass all bounds so far, and the bounds that limit them
        least, most, lowest, highest = -np.inf, np.inf, at, at
        for k in range(at + 1, n + 1):
            below, above = (low[k] - value) / (k - at), (high[k] - value) / (k - at)
            if below > most:    # it has to rise, and turns at the bound that holds it down
                at, value = highest, high[highest]
                break
            if above < least:
                at, value = lowest, low[lowest]
                break
            if below >= least:
                least, lowest = below, k
            if above <= most:
                most, highest = above, k
        else:
            at, value = n, top
        bends.append((at, value))
    places, values = np.array(bends[:-1]).T
    return (places.astype(int) + start) % n, values


def shore(points, half=HALF):
    """A ring of at least 3 corners, or None where nothing of it is left (of less than two pixels across)."""
    n = len(points)
    bends = [string(points[:, axis], half) for axis in (0, 1)]
    if not all(len(places) for places, _ in bends):
        return None
    corners = np.unique(np.concatenate([places for places, _ in bends]))
    ring = np.stack([np.interp(corners, *periodic(*b, n)) for b in bends], axis=1)
    return ring if len(ring) > 2 else None


def periodic(places, values, n):
    """For np.interp, over one round and the ends of its neighbours."""
    order = np.argsort(places)
    places, values = places[order], values[order]
    return np.r_[places[-1] - n, places, places[0] + n], np.r_[values[-1], values, values[0]]
