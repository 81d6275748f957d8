# SPDX-License-Identifier: MIT
"""Shores that were drawn along pixels: from a staircase to the shore with the fewest bays that the pixels allow.

    straight(polygon)       a polygon along pixels, in columns and rows, with such a shore; None: nothing is left of it
    lattice(polygons)       the pixels of outlines that were traced along them; None: they were not
    retraced(polygon, pixel)        such an outline with that shore; None: it has no staircase

Across each unit step of a staircase the shore lies somewhere within half a pixel of its middle: between the pixels of
ice and water on both sides of the step. The shortest ring through all these gates, in turn, bends only where it must
[minimum-perimeter polygon: Sklansky, Chazin & Hansen 1972, IEEE Trans. Comput. C-21, 260], found by pulling a string
tight [funnel: Lee & Preparata 1984, Networks 14, 393]. So a shape with the pixels of a convex shape is convex, and the
pixels prove every bay that stays.

The ring lies against the ice on capes and against the water in bays. So its edges move back, on capes out and in bays
in, all by the same distance but each no farther than its gates allow, until the area is that of the pixels. They keep
their directions, so no corner turns the other way. All edges share the remaining difference of the area, some
hundredths of a pixel along the shore, more for the smallest floes.

Rejected: Douglas & Peucker, which keeps corners of the staircase and with them its bays; convex hulls where they are
near enough, which do not help a floe with one bay.
"""
import numpy as np

HALF = 0.5              # pixels: of a gate
STEPS, EXACT = 12, 1e-8 # to find by how much edges move; of the area
ALIKE = 0.1             # of the area: a shore that has less or more has lost its way
LEAST = 1e-6            # pixels: shorter edges are none
FLAT = 1e-9             # sine of the angle between two edges that are one
ROUNDED = 0.1           # of a pixel: as far coordinates may be off their lattice
ON = 0.98               # of the edges of a map run along the lattice
UNIT, CORNERS = 0.25, 8 # of the edges of a staircase are of one pixel; it has at least so many


def straight(polygon):
    """See above. Edges run along the axes or their diagonals, over whole numbers; holes are passed over. Where gates
    cross, as at the tip of a sharp cape, narrower ones do."""
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
    """The ring with its edges moved by up to `most`, and no farther than `room`, so that it has this area; or as near
    to it as that goes."""
    low, high, best = 0.0, most, corners
    open_ = area - ring_area(corners)
    for _ in range(STEPS):
        # the shore times the way is the least that this brings
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
    """(middles, directions) of the unit steps of a closed ring along pixels, anticlockwise."""
    points = points if ring_area(points[:-1]) > 0 else points[::-1]
    way = np.diff(points, axis=0)
    number = np.rint(np.abs(way).max(axis=1)).astype(int)
    start = np.repeat(points[:-1], number, axis=0)
    unit = np.repeat(way / np.maximum(number, 1)[:, None], number, axis=0)
    within = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    return start + unit * (within[:, None] + 0.5), unit


def gates(middles, directions, half):
    """Their ends on the ice, which is on the left, and on the water."""
    left = np.c_[-directions[:, 1], directions[:, 0]] * (half / np.hypot(*directions.T))[:, None]
    return middles + left, middles - left


def ring_area(p):
    x, y = (p - p[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def turn(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def tight(inner, outer):
    """(corners, gate of each) of the shortest ring through all gates. It passes the inner end that is farthest to the
    right, a corner of the hull of all of them."""
    first = int(np.lexsort((inner[:, 1], inner[:, 0]))[-1])
    left, right = (np.roll(ends, -first, axis=0).tolist() for ends in (inner, outer))
    left.append(left[0])
    right.append(left[0])
    at, corner, found = 0, left[0], [(0, left[0])]
    n = len(left) - 1
    while at < n:
        # the funnel from here: the last ends on either side that narrowed it
        a, b, ka, kb, end = left[at + 1], right[at + 1], at + 1, at + 1, None
        for k in range(at + 2, n + 1):
            if turn(corner, b, right[k]) >= 0:        # the right side narrows
                if b == corner or turn(corner, a, right[k]) < 0:
                    b, kb = right[k], k
                else:                                 # over the left one
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
    """Which corners turn to the left."""
    a, b = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0


def edge_room(corners, at, inner, outer):
    """By how much each edge may move: out (above zero) between two capes, in (below) between two bays, not between one
    of each. Edge k runs from corner k to the next."""
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
    """The ring with its edges moved by `way` or as far as they may; None where one between a cape and a bay would
    vanish. Others go where their neighbours meet before them."""
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
        stay = ~gone | (length > np.minimum(np.roll(length, 1), np.roll(length, -1)))   # of neighbours the shorter goes
        out, unit, line, alike = out[stay], unit[stay], line[stay], alike[stay]
    return None


# ---- outlines that were traced along pixels


def lattice(polygons):
    """(width, height) of the pixels along whose edges or middles outlines run, in their coordinates; or None."""
    ways = np.concatenate([np.diff(np.asarray(p.exterior.coords), axis=0) for p in polygons])
    pitch = [pitch_of(np.abs(ways[:, axis])) for axis in (0, 1)]
    return None if None in pitch else np.array(pitch)


def pitch_of(ways):
    """Of which nearly all ways along an axis are multiples; or None."""
    ways = np.sort(ways[ways > 1e-9 * ways.max(initial=0)])
    if len(ways) == 0:
        return None
    pitch = ways[len(ways) // 20]
    for reach in (1.5, 4, 16, 64):      # from one step to many: the more, the better it is known
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
    """An outline with its staircase made straight; None where it has none. pixel: see `lattice`."""
    points = np.asarray(polygon.exterior.coords)
    ring = np.rint((points - points[0]) / pixel)
    way = np.abs(np.diff(ring, axis=0))
    longest, shortest = way.max(axis=1), way.min(axis=1)
    on = (shortest == 0) | (shortest == longest)
    if len(way) < CORNERS or not on.all() or (longest == 1).mean() < UNIT or not polygon.is_valid:
        return None
    new = straight(type(polygon)(ring[np.r_[True, longest > 0]]))
    return None if new is None else type(polygon)(np.asarray(new.exterior.coords) * pixel + points[0])
