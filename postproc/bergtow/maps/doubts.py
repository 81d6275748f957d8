# SPDX-License-Identifier: MIT
"""Reasons to doubt that the shapes of a map are floes, each as {code, text, values}.

    doubts(found, floes, book)      the map, the floes made from it, the ledger of changes
"""
import numpy as np

from bergtow.maps import repair as map_repair
from bergtow.maps.text import area

MOST = 3 / 4        # of the ice, in a single floe out of several
NECK = 1 / 8        # of the size of a floe: a narrower part is a neck
HEAD = 0.1          # of the floe's area, on either side of a neck
HUNG = 0.05         # of the ice, in floes with necks


def doubts(found, floes, book):
    return [d for d in (chart(found, book), merged(floes, book), necks(floes)) if d]


def doubt(code, text, **values):
    return {"code": code, "text": text, "values": values}


def chart(found, book):
    """Regions of an ice chart: ice of some concentration taken for a floe of 100 %, and land in the holes."""
    if not found.chart:
        return None
    holes = book["holes"].after - book["holes"].before if "holes" in book else 0.0
    land = f", {area(holes)} of holes (land, water) became ice" if holes else ""
    return doubt("ice_chart", f"{', '.join(found.chart[:2])}: as of an ice chart, so each region became a floe of "
                 f"100 %{land}; use outlines of single floes", columns=found.chart, holes_m2=holes)


def merged(floes, book):
    areas = np.array([f.polygon.area for f in floes])
    share = areas.max() / areas.sum()
    within = book["within"].count if "within" in book else 0
    if len(floes) + within < 2 or share <= MOST:
        return None
    name = floes[int(np.argmax(areas))].name
    return doubt("merged_floes", f"one floe has {100 * share:.0f} % of the ice ({name}): floes that touch became "
                 "one, or it is not a floe; part them in the image first", share=share, floe=name)


def necks(floes):
    hung = [f for f in floes if has_neck(f.polygon)]
    share = sum(f.polygon.area for f in hung) / sum(f.polygon.area for f in floes)
    if share <= HUNG:
        return None
    return doubt("necks", f"necks narrower than an eighth of the floe in {len(hung)} of {len(floes)} floes, "
                 f"{100 * share:.0f} % of the ice: floes that touch became one; part them in the image first",
                 floes=len(hung), share=share, first=[f.name for f in hung[:map_repair.NAMED]])


def has_neck(polygon):
    """Does the floe fall apart if half a neck's width is removed all around?"""
    least = HEAD * polygon.area
    half = NECK / 2 * map_repair.diameter(polygon)
    parts = map_repair.parts_of(polygon.buffer(-half))
    return len(parts) > 1 and sum(p.buffer(half).area >= least for p in parts) > 1
