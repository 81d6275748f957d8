# SPDX-License-Identifier: MIT
"""Shores traced along pixels: replace a staircase by the shore with the fewest bays that agrees with the pixels.

    straight(polygon)       a polygon along pixels, in columns and rows, with such a shore; None: nothing is left of it
    lattice(polygons)       the pixels along which outlines were traced; None: they were not
    retraced(polygon, pixel)        such an outline with that shore; None: it has no staircase

At each unit step of a staircase the shore lies within half a pixel of the step's midpoint, between the pixels of ice
and water on its two sides. The shortest ring through all these gates, in turn, bends only where it must
[minimum-perimeter polygon: Sklansky, Chazin & Hansen 1972, IEEE Trans. Comput. C-21, 260]. It is found by pulling a
string tight [funnel: Lee & Preparata 1984, Networks 14, 393]. So pixels of a convex shape give a convex shape, and
every bay that remains is proven by the pixels.

The ring touches the ice at capes and the water in bays. Its edges are therefore moved back, outwards at capes and
inwards in bays, all by the same distance but none beyond its gates, until the area is that of the pixels. Edges keep
their directions, so no corner turns the other way. All edges share the remaining difference in area, which amounts to
some hundredths of a pixel along the shore, and more for the smallest floes.

Rejected: Douglas & Peucker, which keeps corners of the staircase and so its bays; convex hulls where they are close
enough, which do not help a floe with one bay.
"""
import numpy as np

HALF = 0.5              # half the width of a gate, pixels
STEPS, EXACT = 12, 1e-8 # of the search for how far edges move; relative to the area
ALIKE = 0.1             # of the area: if a shore's area differs by more, the search failed
LEAST = 1e-6            # pixels: shorter edges are dropped
FLAT = 1e-9             # sine of the angle between two edges that count as one
ROUNDED = 0.1           # of a pixel: how far coordinates may be off their lattice
ON = 0.98               # share of the edges of a map that run along the lattice
UNIT, CORNERS = 0.25, 8 # share of edges of one pixel in a staircase; least number of corners


def straight(polygon):
    """Straighten a shore (see above). Edges run along the axes or their diagonals, between whole numbers; holes are
    ignored. If gates cross, as at the tip of a sharp cape, narrower gates are used."""
    steps = unit_steps(np.asarray(polygon.exterior.coords))
    for half in (HALF, HALF / 2, HALF / 4):
        inner, outer = gates(*steps, half)
        corners, at = tight(inner, outer)
        if len(corners) < 3:
            continue
        ring = filled(corners, edge_room(corners, at, inner, outer), polygon.area, 2 * half)
        ring = filled(ring, np.full(len(ring), np.sign(polygon.area - ring_area(ring))), polygon.area, 2 * half)
        new = type(polygon)(ring)
        if new.is_valid and abs(new.area / polygon.area - 1) < ALIKE:
            return new
    return None


def filled(corners, room, area, most):
    """The ring with its edges moved by up to `most`, but no farther than `room`, so that it has this area or comes as
    close to it as possible."""
    low, high, best = 0.0, most, corners
    open_ = area - ring_area(corners)
    for _ in range(STEPS):
        # shore length times distance is the least change in area
        way = low + abs(open_) / np.hypot(*np.diff(best, axis=0, append=best[:1]).T).sum()
        way = way if way < high else (low + high) / 2
        ring = moved(corners, room, way)
        left = None if ring is None else area - ring_area(ring)
        if left is None or left * open_ < 0:
            high = way
        else:
            low, best, open_ = way, ring, left
        if abs(open_) < EXACT * area:
            break
    return best


def unit_steps(points):
    """(midpoints, directions) of the unit steps of a closed ring along pixels, anticlockwise."""
    points = points if ring_area(points[:-1]) > 0 else points[::-1]
    way = np.diff(points, axis=0)
    number = np.rint(np.abs(way).max(axis=1)).astype(int)
    start = np.repeat(points[:-1], number, axis=0)
    unit = np.repeat(way / np.maximum(number, 1)[:, None], number, axis=0)
    within = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    return start + unit * (within[:, None] + 0.5), unit


def gates(middles, directions, half):
    """The ends of the gates on the ice, which is on the left, and on the water."""
    left = np.c_[-directions[:, 1], directions[:, 0]] * (half / np.hypot(*directions.T))[:, None]
    return middles + left, middles - left


def ring_area(p):
    x, y = (p - p[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def turn(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def tight(inner, outer):
    """(corners, gate of each) of the shortest ring through all gates. It starts at the rightmost inner end, which is a
    corner of the convex hull of all inner ends."""
    first = int(np.lexsort((inner[:, 1], inner[:, 0]))[-1])
    left, right = (np.roll(ends, -first, axis=0).tolist() for ends in (inner, outer))
    left.append(left[0])
    right.append(left[0])
    at, corner, found = 0, left[0], [(0, left[0])]
    n = len(left) - 1
    while at < n:
        # the funnel from this corner: the last ends on either side that narrowed it
        a, b, ka, kb, end = left[at + 1], right[at + 1], at + 1, at + 1, None
        for k in range(at + 2, n + 1):
            if turn(corner, b, right[k]) >= 0:        # the right side narrows
                if b == corner or turn(corner, a, right[k]) < 0:
                    b, kb = right[k], k
                else:                                 # it crosses the left side
                    end = ka, a
                    break
            if turn(corner, a, left[k]) <= 0:
                if a == corner or turn(corner, b, left[k]) > 0:
                    a, ka = left[k], k
                else:
                    end = kb, b
                    break
        at, corner = end or (n, left[n])
        if corner != found[-1][1]:
            found.append((at, corner))
        else:
            found[-1] = at, corner
    found = found[:-1] if len(found) > 1 and found[-1][1] == found[0][1] else found
    gate, corners = (np.array([k for k, _ in found]) + first) % len(inner), np.array([c for _, c in found])
    a, b = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    bent = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > FLAT * np.hypot(*a.T) * np.hypot(*b.T)
    return corners[bent], gate[bent]


def capes(corners):
    """Which corners turn left."""
    a, b = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0


def edge_room(corners, at, inner, outer):
    """How far each edge may move: out (positive) between two capes, in (negative) between two bays, zero between a cape
    and a bay. Edge k runs from corner k to the next."""
    n, cape = len(inner), capes(corners)
    way = np.roll(corners, -1, axis=0) - corners
    out = np.c_[way[:, 1], -way[:, 0]] / np.hypot(*way.T)[:, None]
    room = np.zeros(len(corners))
    for k, (first, last) in enumerate(zip(at, np.roll(at, -1))):
        if cape[k] == cape[(k + 1) % len(cape)]:
            crossed = np.arange(first, last + (n if last <= first else 0) + 1) % n
            free = ((outer if cape[k] else inner)[crossed] - corners[k]) @ out[k]
            room[k] = max(free.min(), 0) if cape[k] else min(free.max(), 0)
    return room


def moved(corners, room, way):
    """The ring with its edges moved by `way`, or as far as they may move; None if an edge between a cape and a bay
    would vanish. Other edges are dropped where their neighbours meet first."""
    edge, cape = np.roll(corners, -1, axis=0) - corners, capes(corners)
    unit = edge / np.hypot(*edge.T)[:, None]
    out, by = np.c_[unit[:, 1], -unit[:, 0]], np.clip(room, -way, way)
    line, alike = (corners * out).sum(axis=1) + by, cape == np.roll(cape, -1)   # out · x = line
    while len(line) > 3:
        before, other = np.roll(out, 1, axis=0), np.roll(line, 1)
        sine = before[:, 0] * out[:, 1] - before[:, 1] * out[:, 0]
        if np.abs(sine).min() < FLAT:
            return None
        ring = np.c_[other * out[:, 1] - line * before[:, 1], line * before[:, 0] - other * out[:, 0]] / sine[:, None]
        length = ((np.roll(ring, -1, axis=0) - ring) * unit).sum(axis=1)
        gone = length <= LEAST
        if not gone.any():
            return ring
        if not alike[gone].all():
            return None
        stay = ~gone | (length > np.minimum(np.roll(length, 1), np.roll(length, -1)))   # of neighbours drop the shorter
        out, unit, line, alike = out[stay], unit[stay], line[stay], alike[stay]
    return None


# ---- outlines that were traced along pixels


def lattice(polygons):
    """(width, height) of the pixels along whose edges or middles the outlines run, in the outlines' units; or None."""
    ways = np.concatenate([np.diff(np.asarray(p.exterior.coords), axis=0) for p in polygons])
    pitch = [pitch_of(np.abs(ways[:, axis])) for axis in (0, 1)]
    return None if None in pitch else np.array(pitch)


def pitch_of(ways):
    """The length of which nearly all steps along an axis are multiples; or None."""
    ways = np.sort(ways[ways > 1e-9 * ways.max(initial=0)])
    if len(ways) == 0:
        return None
    pitch = ways[len(ways) // 20]
    for reach in (1.5, 4, 16, 64):      # from one step to many: longer steps determine it better
        near = ways[ways < reach * pitch]
        number = np.rint(near / pitch)
        if not number.any():
            return None
        pitch = (near @ number) / (number @ number)
    number = ways / pitch
    near = number < 64
    on = np.abs(number - np.rint(number))[near] < ROUNDED
    return pitch if on.mean() > ON and np.rint(number[near]).min() > 0 else None


def retraced(polygon, pixel):
    """An outline with its staircase straightened; None if it has none. pixel: see `lattice`."""
    points = np.asarray(polygon.exterior.coords)
    ring = np.rint((points - points[0]) / pixel)
    way = np.abs(np.diff(ring, axis=0))
    longest, shortest = way.max(axis=1), way.min(axis=1)
    on = (shortest == 0) | (shortest == longest)
    if len(way) < CORNERS or not on.all() or (longest == 1).mean() < UNIT or not polygon.is_valid:
        return None
    new = straight(type(polygon)(ring[np.r_[True, longest > 0]]))
    return None if new is None else type(polygon)(np.asarray(new.exterior.coords) * pixel + points[0])
