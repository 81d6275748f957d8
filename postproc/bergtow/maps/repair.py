# SPDX-License-Identifier: MIT
"""From polygons of a map to floes: simple rings with a limited number of vertices that neither overlap nor touch. Every
change is counted.

    book = Ledger()
    floes = repaired(shapes, Rules(tolerance=2.0), book)       shapes of maps/read.py in metres of a plane

The order is: self-crossing rings, several polygons in one feature, holes; floes outside the box or in the clear circle;
staircases and other detail below the tolerance; slivers and small pieces; floes cut by the edge of the image, if they
are to be left out; overlaps, and the pieces that cutting them leaves.

An overlap is cut from the larger of two floes, which changes it least. If the overlap is nearly all of both, they are
the same floe traced twice, and one is left out (second_of); if it is nearly all of the smaller floe, that floe lies
inside the other. Rejected: a middle line through the overlap, which changes both floes, and for three floes depends on
the order.

Floes that touch are separated by a gap of GAP. Neighbours in a label image share an edge to the last bit; without a gap
no direction separates them, and the reader takes corners of their convex parts for overlaps.

In an image the area of a floe is that of its pixels. Simplifying removes the bevelled corners (2.5 % of a square of 40
pixels, 15 % of a square of 6), so the shore is moved outwards again until the area is right. If this makes two floes
overlap, the overlap is treated like any other.

A sliver is a polygon that is narrower than the tolerance everywhere: no disc of that diameter fits into it.
"""
from dataclasses import dataclass, field, replace

import numpy as np

from bergtow import _library
from bergtow.case import preset
from bergtow.errors import RunError
from bergtow.maps.plane import vertices

try:
    from shapely.geometry import MultiPoint, Point, Polygon
    from shapely.ops import unary_union
    from shapely.validation import make_valid
except ImportError:  # map_read.need reports it
    pass

SAME = 0.9               # of both areas: traced twice; of the smaller area: lies inside the other
THIN = 1e-4              # of the tolerance, and of the reader's tolerance: smaller detail is rounding error
GAP = 2e-5               # passes of `apart`, and after how many the cuts get wider
PASSES, PATIENCE = 40, 8
NAMED = 20               # at most so many floes are named in the record

#: kinds of change, in the order of the report; without the s of its first word each is that of a single one
KINDS = {
    "empty": "features without a geometry, left out",
    "no polygon": "features without a polygon, left out",
    "other parts": "features with parts that are not polygons, these left out",
    "fewer than 3 vertices": "rings of fewer than 3 vertices, left out",
    "crossing": "outlines with edges that cross or touch, repaired",
    "joined": "features in pieces that meet (as at the 180th meridian), joined",
    "several": "features of several polygons, each now a floe",
    "holes": "floes with holes, filled",
    "outside": "floes with the middle outside the box, left out",
    "clear": "floes in the clear circle, left out",
    "stairs": "staircases of pixels straightened",
    "simplified": "outlines simplified to the tolerance",
    "slivers": "slivers narrower than the tolerance, left out",
    "small": "floes smaller than --least, left out",
    "cut": "floes cut by the edge of the image, left out",
    "cut kept": "floes cut by the edge of the image, kept unchanged",
    "twice": "floes traced twice, left out once",
    "unequal": "floes traced twice with different thicknesses, the thicker kept",
    "within": "floes within another, left out",
    "overlaps": "overlaps of two floes, taken from the larger",
    "touching": "floes that touched another, drawn back from it",
    "split": "floes cut in pieces by that",
    "narrow": "outlines with spikes or necks that are too thin to compute with, opened there",
    "vertices": "outlines of more vertices than a floe may have, simplified further",
}


@dataclass
class Change:
    """One kind of change: how often, to which floes, and their area before and after, m²."""

    count: int = 0
    before: float = 0.0
    after: float = 0.0
    largest: float = 0.0    #: largest relative change of a single outline
    names: list = field(default_factory=list)


class Ledger(dict):
    """{kind: Change}"""

    def note(self, kind, name, before=0.0, after=0.0):
        assert kind in KINDS
        change = self.setdefault(kind, Change())
        change.count += 1
        change.before += before
        change.after += after
        change.largest = max(change.largest, abs(after - before) / before if before > 0 else 0.0)
        if len(change.names) < NAMED:
            change.names.append(name)


@dataclass
class Floe:
    name: str
    polygon: object
    thickness: float = None
    cut: bool = False
    pixels: float = None        #: area of its pixels, m²
    straight: bool = False      #: its staircase was straightened


@dataclass
class Rules:
    """Lengths in metres, areas in square metres."""

    tolerance: float = None     #: None: a thousandth of the mean size
    detail: float = 0.0         #: the same for straightened shores; 0: keep them as they are
    least: float = 0.0
    keep_cut: bool = True
    box: tuple = None           #: length along the first axis and width, about the centre
    clear: float = 0.0          #: radius about the centre
    thin: float = 0.0           #: derived, like the next two
    gap: float = 0.0            #: between floes
    reach: float = 0.0          #: a floe is enlarged by this before it is cut out of another one


def repaired(shapes, rules, book):
    """The floes. Raises RunError if nothing is left."""
    floes = [floe for shape in shapes for floe in whole(shape, book)]
    floes = [f for f in floes if chosen(f, rules, book)]
    size = float(np.mean([diameter(f.polygon) for f in floes])) if floes else 1e3
    finest = preset("solver.slop") * size  # the overlap that a case accepts by default
    rules.tolerance = rules.tolerance or finest
    rules.thin, rules.gap = THIN * min(rules.tolerance, finest), GAP * size
    floes = [f for floe in floes for f in simplified(floe, rules, book)]
    floes = [f for f in floes if large_enough(f, rules, book) and stays(f, rules, book)]
    return apart(floes, rules, book)


def diameter(polygon):
    """Diameter of the disc of equal area, m: bergtow's definition of floe size."""
    return np.sqrt(4 * polygon.area / np.pi)


def parts_of(geometry):
    """The polygons in any geometry that GEOS returns."""
    if geometry.geom_type == "Polygon":
        return [] if geometry.is_empty else [geometry]
    return [p for g in getattr(geometry, "geoms", []) for p in parts_of(g)]


# ---- one shape


def whole(shape, book):
    """The floes of a shape: valid polygons without holes."""
    parts = []
    for part in parts_of(shape.geometry):
        if not part.is_valid:
            mended = parts_of(make_valid(part))
            book.note("crossing", shape.name, Polygon(part.exterior).area, sum(p.area for p in mended))
            parts += mended
        else:
            parts.append(part)
    if len(parts) > 1:
        joined = parts_of(unary_union(parts))
        if len(joined) < len(parts):
            book.note("joined", shape.name, sum(p.area for p in parts), sum(p.area for p in joined))
        parts = joined
    if len(parts) > 1:
        area = sum(p.area for p in parts)
        book.note("several", shape.name, area, area)
    pixels = shape.pixels.area if shape.pixels is not None and len(parts) == 1 else None
    names = [shape.name] if len(parts) == 1 else [f"{shape.name}, part {k + 1}" for k in range(len(parts))]
    return [Floe(name, filled(p, name, book), shape.thickness, shape.cut, pixels, shape.straight)
            for name, p in zip(names, parts)]


def filled(polygon, name, book):
    if not polygon.interiors:
        return polygon
    full = Polygon(polygon.exterior)
    book.note("holes", name, polygon.area, full.area)
    return full


def chosen(floe, rules, book):
    """Is the middle of the floe in the box, and the floe outside the circle?"""
    area = floe.polygon.area
    if rules.box:
        middle = floe.polygon.centroid
        if 2 * abs(middle.x) > rules.box[0] or 2 * abs(middle.y) > rules.box[1]:
            book.note("outside", floe.name, area)
            return False
    if rules.clear and floe.polygon.distance(Point(0, 0)) < rules.clear:
        book.note("clear", floe.name, area)
        return False
    return True


def simplified(floe, rules, book):
    """Remove vertices by Douglas & Peucker: none lies farther from the new outline than the tolerance, which is raised
    if too many remain. with_area() then restores the area that corners of a label lose."""
    before, tolerance = floe.polygon, rules.detail if floe.straight else rules.tolerance
    polygon = with_area(before.simplify(tolerance) if tolerance else before, floe.pixels)
    if floe.straight:
        book.note("stairs", floe.name, floe.pixels or before.area, polygon.area)
    if len(polygon.exterior.coords) < len(before.exterior.coords):
        book.note("simplified", floe.name, floe.pixels or before.area, polygon.area)
    if too_many(polygon):
        first, polygon = polygon.area, with_area(fewer(before, rules.tolerance), floe.pixels)
        book.note("vertices", floe.name, first, polygon.area)
    return opened(replace(floe, polygon=polygon), rules, book)


def with_area(polygon, area):
    """The polygon with all edges moved out or in by the same distance, so that it has this area. It is returned
    unchanged if that makes more vertices than a floe may have."""
    new = polygon
    for _ in range(4 if area else 0):
        if abs(new.area - area) < 1e-6 * area:  # for a buffer of almost zero GEOS may return an empty polygon
            break
        parts = parts_of(new.buffer((area - new.area) / new.length, join_style=2, mitre_limit=10))
        new = Polygon(max(parts, key=lambda p: p.area).exterior) if parts else polygon
    return polygon if too_many(new) and not too_many(polygon) else new


def too_many(polygon):
    return len(polygon.exterior.coords) - 1 > _library.limit("outline_vertices")


def fewer(polygon, tolerance, inside=False):
    """Reduce the number of vertices to the limit, raising the tolerance by a quarter at a time; inside: add no area."""
    out = polygon
    while too_many(out):
        tolerance *= 1.25
        within = polygon.buffer(-tolerance, join_style=2) if inside else polygon
        out = max(parts_of(within.simplify(tolerance)), key=lambda p: p.area, default=Polygon())
    return out


def opened(floe, rules, book):
    """The floes without spikes, necks and cracks that are too thin. Rounding of coordinates, as in degrees, may fold
    these over, and the reader of the program checks signs exactly."""
    thin, polygon = rules.thin, floe.polygon
    if polygon.is_empty or polygon.minimum_clearance >= thin:
        return [floe] if not polygon.is_empty else []
    parts = [polygon.simplify(thin)]
    wide = thin
    while any(p.minimum_clearance < thin for p in parts) and wide < rules.tolerance:
        style = {"join_style": 2, "mitre_limit": 10}
        wide *= 2
        parts = [Polygon(q.exterior) for p in [polygon] for q in parts_of(
            p.buffer(-wide, **style).buffer(2 * wide, **style).buffer(-wide, **style).simplify(wide / 2))]
    area = sum(p.area for p in parts)
    book.note("narrow", floe.name, polygon.area, area)
    return [replace(floe, polygon=p, pixels=floe.pixels if len(parts) == 1 else None) for p in parts]


def large_enough(floe, rules, book):
    area = floe.pixels or floe.polygon.area
    if floe.polygon.buffer(-rules.tolerance / 2).is_empty:
        book.note("slivers", floe.name, area)
        return False
    if area < rules.least * (1 - 1e-9):  # allows for rounded coordinates
        book.note("small", floe.name, area)
        return False
    return True


def stays(floe, rules, book):
    if floe.cut:
        book.note("cut kept" if rules.keep_cut else "cut", floe.name, floe.polygon.area,
                  floe.polygon.area if rules.keep_cut else 0)
    return rules.keep_cut or not floe.cut


# ---- all of them


def meeting(floes, changed):
    """Pairs (i, j), i < j, of floes whose bounding boxes meet, one of them changed; by a sweep along the first axis."""
    if not floes:
        return
    boxes = np.array([f.polygon.bounds for f in floes])
    order = np.argsort(boxes[:, 0], kind="stable")
    left = boxes[order, 0]
    for place, i in enumerate(order):
        others = order[place + 1:np.searchsorted(left, boxes[i, 2], side="right")]
        near = (boxes[others, 1] <= boxes[i, 3]) & (boxes[others, 3] >= boxes[i, 1])
        if not changed[i]:
            near &= changed[others]
        for j in others[near]:
            yield (i, j) if i < j else (j, i)


def apart(floes, rules, book):
    """Make floes neither overlap nor touch. A cut can leave a piece that overlaps another floe, so passes repeat until
    one changes nothing. If the tip of one floe lies in a crack of another that `opened` keeps closing, the cuts become
    wider after PATIENCE passes."""
    changed = np.ones(len(floes), bool)
    for k in range(PASSES):
        rules.reach = min(rules.tolerance, rules.thin * 2.0 ** (k - PATIENCE)) if k > PATIENCE else 0.0
        new, touched = {}, set()
        for i, j in sorted(meeting(floes, changed)):
            if i in touched or j in touched:  # the next pass looks at the pair in its new shape
                continue
            pair = parted(floes[i], floes[j], rules, book)
            if pair is not None:
                touched |= {i, j}
                new[i], new[j] = pair
        if not touched:
            return floes
        # A floe that was skipped met a changed floe, and the next pass tests it again.
        kept = [([f], False) if k not in new else (new[k], True) for k, f in enumerate(floes)]
        floes = [f for some, _ in kept for f in some]
        changed = np.array([is_new for some, is_new in kept for _ in some], bool)
    raise RunError("outlines", f"floes still overlap after {PASSES} passes, near {floes[int(np.argmax(changed))].name}",
                   "raise --tolerance, or correct the map there")


def parted(a, b, rules, book):
    """([Floe] of a, [Floe] of b), or None if they lie apart. An overlap no wider than `thin` does not count."""
    small, large = sorted((a, b), key=lambda f: f.polygon.area)
    shared = small.polygon.intersection(large.polygon).area
    overlap = shared > rules.thin * small.polygon.length
    if not overlap and small.polygon.distance(large.polygon) >= rules.gap / 2:
        return None
    if shared >= SAME * small.polygon.area:
        twice = shared >= SAME * large.polygon.area
        gone = second_of(a, b, book) if twice else small
        book.note("twice" if twice else "within", f"{gone.name} ({(a if gone is b else b).name})", gone.polygon.area)
        return ([a], []) if gone is b else ([], [b])
    pieces = without(large, small, "overlaps" if overlap else "touching", rules, book)
    return (pieces, [b]) if large is a else ([a], pieces)


def second_of(a, b, book):
    """Which of two tracings of a floe is left out: the one without a thickness, or the thinner one, whatever their
    order in the file. A thinner floe resists less, so the thicker is on the safe side of a tow."""
    if a.thickness is not None and b.thickness is not None and a.thickness != b.thickness:
        thick, thin = sorted((a, b), key=lambda f: -f.thickness)
        book.note("unequal", f"{thin.name}, {thin.thickness:g} m ({thick.name}, {thick.thickness:g} m)",
                  thin.polygon.area, thick.polygon.area)
        return thin
    return a if a.thickness is None and b.thickness is not None else b


def without(large, small, kind, rules, book):
    """The parts of one floe that lie outside another."""
    knife = small.polygon.buffer(rules.gap + rules.reach, join_style=2)
    parts = [trimmed(p, rules.tolerance) for p in parts_of(large.polygon.difference(knife))]
    book.note(kind, f"{large.name} ({small.name})", large.polygon.area, sum(p.area for p in parts))
    out = [replace(large, polygon=p, pixels=None) for p in parts]
    out = [f for piece in out for f in opened(piece, rules, book) if large_enough(f, rules, book)]
    for floe in out:
        if too_many(floe.polygon):
            less = fewer(floe.polygon, rules.tolerance, inside=True)
            book.note("vertices", floe.name, floe.polygon.area, less.area)
            floe.polygon = less
    if len(out) > 1:
        area = sum(f.polygon.area for f in out)
        book.note("split", large.name, area, area)
        for k, floe in enumerate(out):
            floe.name = f"{large.name}, piece {k + 1}"
    return out


def trimmed(polygon, tolerance):
    """The outer ring without the short edges that a cut leaves: corners that protrude by less than the tolerance are
    removed, so no area is added."""
    ring = np.asarray(polygon.exterior.coords)[:-1]
    ring = ring if polygon.exterior.is_ccw else ring[::-1]
    place = 0
    while place < len(ring) > 3:
        before, here, after = ring[place - 1], ring[place], ring[(place + 1) % len(ring)]
        a, b, chord = here - before, after - here, after - before
        out, long = a[0] * b[1] - a[1] * b[0], np.hypot(*chord)
        short = min(np.hypot(*a), np.hypot(*b)) < tolerance and 0 < out < tolerance * long
        less = np.delete(ring, place, axis=0)
        if short and Polygon(less).is_valid:
            ring, place = less, max(place - 1, 0)
        else:
            place += 1
    return Polygon(ring)


def hull_of_shapes(shapes):
    """Polygon around all shapes that lie in the plane: outlines tell nothing else about the area observed."""
    places = np.concatenate([vertices(s.geometry) for s in shapes])
    return MultiPoint(places[np.isfinite(places).all(axis=1)]).convex_hull


def hull_of(floes):
    """Points on the convex hull of all floes, (n, 2)."""
    return vertices(MultiPoint(np.concatenate([vertices(f.polygon) for f in floes])).convex_hull.buffer(0))
