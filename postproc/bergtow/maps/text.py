# SPDX-License-Identifier: MIT
"""Output of bergtow outlines: the map, the plane, every change, the floes; as lines of text and as a record."""
import math

import numpy as np

from bergtow.maps.plane import name_of
from bergtow.maps.repair import KINDS

#: the area that the concentration refers to
IMAGED, BOX, HULL = "what was imaged of", "the box of", "the hull of the outlines, within"
CLASSES = 8     # of the size distribution, each by a factor of sqrt(2) wide or wider


def area(value):
    return f"{value / 1e6:.4g} km²" if value >= 1e6 else f"{value:.4g} m²"


def length(value):
    return f"{value / 1e3:.4g} km" if value >= 1e3 else f"{value:.4g} m"


def map_lines(found, crs, said=None):
    lines = [f"map: {len(found.shapes)} shapes in {name_of(crs)}"]
    if said and (found.crs is None or found.implied):
        lines.append("crs: as --crs says; the file " + (
            "names none" if found.crs is None else "is in degrees only by the GeoJSON default"))
    if found.about:
        lines.append(f"the file describes itself as: {found.about}")
    if found.near:
        lines.append(f"not read as the thickness: {', '.join(found.near)}; name the column with --thickness if it is "
                     "in metres")
    return lines


def plane_lines(plane, distortion, bend):
    """distortion: Plane.distortion; bend: by how much edges that are straight on the map bend in the plane, m."""
    if "length_error" not in distortion:
        x, y = plane.centre
        return [f"plane: metres as they are, about {x:.10g}, {y:.10g}; farthest vertex "
                f"{length(distortion['farthest_m'])}"]
    lon, lat = plane.centre
    lines = [f"plane: azimuthal equidistant about longitude {lon:.7g}, latitude {lat:.7g}; farthest vertex "
             f"{length(distortion['farthest_m'])}",
             f"distortion at most: lengths {distortion['length_error']:.1e}, areas {distortion['area_error']:.1e}, "
             f"north is turned by {distortion['north_turns_deg']:.2g}°, edges straight on the map bend by "
             f"{length(bend)}"]
    if distortion["map_scale"]:
        least, most = distortion["map_scale"]
        lines.append(f"a metre of the map is {1 / most:.6f} to {1 / least:.6f} m on the ground; the outlines are "
                     "corrected for it")
    if plane.accuracy:
        lines.append("the map's datum is tied to WGS 84 " + (
            f"within {plane.accuracy:g} m" if math.isfinite(plane.accuracy) else
            "by the shift in its crs, which gives no accuracy" if plane.crs.is_bound else
            "by no known relation: all places may be off by the same few hundred metres"))
    if plane.heading is not None:
        lines.append(f"first axis towards {plane.heading:g}°, second to its left (frame: basin)")
    return lines


def change_lines(book):
    lines = []
    for kind in (k for k in KINDS if k in book):
        c = book[kind]
        text = f"{c.count:6d}  {KINDS[kind] if c.count > 1 else KINDS[kind].replace('s ', ' ', 1)}"
        if c.before and c.after and c.before != c.after:
            ratio = c.after / c.before - 1
            text += f": {area(c.before)} to {area(c.after)}" + (f" ({100 * ratio:+.3g} %" + (
                f", one by {100 * c.largest:.3g} %)" if c.count > 1 else ")") if abs(ratio) < 10 else "")
        elif c.before:
            text += f": {area(c.before)}"
        lines.append(text)
    return ["changes:", *lines] if lines else ["changes: none"]


def numbers(floes, rectangle, concentration, refers_to, share):
    """Statistics of all floes. rectangle: (x0, x1, y0, y1) along the axes; refers_to: what the concentration refers to,
    in words; share: the part of the rectangle that was imaged, or that lies in the hull of the outlines."""
    areas = np.array([f.polygon.area for f in floes])
    size = np.sqrt(4 * areas / np.pi)
    convex = sum(f.polygon.convex_hull.area <= f.polygon.area * (1 + 1e-9) for f in floes)
    thick = np.array([f.thickness for f in floes if f.thickness is not None])
    return {
        "floes": len(floes), "area_m2": areas.sum(), "mean_size_m": size.mean(), "sizes_m": dict(zip(
            ("least", "q10", "q25", "median", "q75", "q90", "largest"),
            np.quantile(size, (0, .1, .25, .5, .75, .9, 1)))),
        "size_spread": size.std() / size.mean(), "rectangle_m": list(rectangle), "imaged_share": share,
        "concentration": concentration, "refers_to": refers_to, "convex": convex, "with_thickness": len(thick),
        "mean_thickness_m": thick.mean() if len(thick) else None, "distribution": distribution(size, areas)}


def distribution(size, areas):
    """[(from, to, floes, share of the ice)] in classes of constant ratio."""
    low, high = size.min(), size.max() * (1 + 1e-12)
    n = int(min(CLASSES, max(1, math.ceil(2 * math.log2(high / low)))))
    edges = low * (high / low) ** (np.arange(n + 1) / n)
    place = np.clip(np.searchsorted(edges, size, side="right") - 1, 0, n - 1)
    return [{"from_m": edges[k], "to_m": edges[k + 1], "floes": int(np.sum(place == k)),
             "share_of_area": areas[place == k].sum() / areas.sum()} for k in range(n)]


def floe_lines(numbers):
    q, (x0, x1, y0, y1) = numbers["sizes_m"], numbers["rectangle_m"]
    lines = [f"floes: {numbers['floes']}, {numbers['convex']} of them convex, {area(numbers['area_m2'])}; mean size "
             f"{length(numbers['mean_size_m'])}, spread {numbers['size_spread']:.2f}, median {length(q['median'])}, "
             f"{length(q['least'])} to {length(q['largest'])}",
             f"concentration: {numbers['concentration']:.3f} of {numbers['refers_to']} {length(x1 - x0)} by "
             f"{length(y1 - y0)}"]
    if numbers["imaged_share"] < 0.97:
        seen = "was imaged" if numbers["refers_to"] == IMAGED else "lies in the hull of the outlines"
        lines.append(f"only {100 * numbers['imaged_share']:.0f} % of this rectangle {seen}, and bergtow treats the "
                     "rest as water: choose a smaller one with --box")
    if not numbers["with_thickness"]:
        lines.append("thickness: no floe has one; give ice.thickness in the case")
    else:
        lines.append(f"thickness: {numbers['with_thickness']} floes have one, {numbers['mean_thickness_m']:.3g} m on "
                     "average")
    lines.append("       size, m          floes   share of the ice")
    return lines + [f"{row['from_m']:9.4g} to {row['to_m']:<9.4g} {row['floes']:6d} {100 * row['share_of_area']:8.1f} %"
                    for row in numbers["distribution"]]


def case_lines(path, numbers, heading, margin, latitude=None):
    """Lines for a case that reads the file. In the geographic frame x points north. latitude: of the centre, deg."""
    x0, x1, y0, y1 = numbers["rectangle_m"]
    low = np.minimum(numbers["reach_m"][:2], (x0, y0)) - margin
    high = np.maximum(numbers["reach_m"][2:], (x1, y1)) + margin
    if heading is None:
        low, high, x0, x1, y0, y1 = low[::-1], high[::-1], y0, y1, x0, x1
    low, size = np.floor(low), np.ceil(high) - np.floor(low)
    frame, bays = "geographic" if heading is None else "basin", numbers["convex"] < numbers["floes"]
    digits = max(1, 3 - math.floor(math.log10(min(x1 - x0, y1 - y0))))  # the region rounded to a thousandth
    return ["in a case beside it:",
            f"  domain: {{frame: {frame}, x0: {low[0]:.0f} m, y0: {low[1]:.0f} m, length: {size[0]:.0f} m, "
            f"width: {size[1]:.0f} m" + (", ends: wall, sides: wall}" if heading is None else "}"),
            f"  ice: {{outlines: {path.name}, x_min: {x0:.{digits}f} m, x_max: {x1:.{digits}f} m, "
            f"y_min: {y0:.{digits}f} m, y_max: {y1:.{digits}f} m" + (", nonconvex: split}" if bays else "}"),
            *([] if latitude is None else [f"  water: {{latitude: {latitude:.4g} deg}}"])]


def record(found, plane, crs, distortion, bend, book, rules, floes):
    return {
        "map": {"file": str(found.path), "crs": name_of(crs), "says_of_itself": found.about or None,
                "shapes": len(found.shapes)},
        "plane": {"centre": list(plane.centre), "heading_deg": plane.heading, "edges_bend_m": bend,
                  "accuracy_m": plane.accuracy if math.isfinite(plane.accuracy) else None, **distortion},
        "rules": {"tolerance_m": rules.tolerance, "least_m2": rules.least, "box_m": rules.box,
                  "clear_m": rules.clear, "keep_cut": rules.keep_cut},
        "changes": {kind: {"what": KINDS[kind], "count": c.count, "area_before_m2": c.before,
                           "area_after_m2": c.after, "largest_relative": c.largest, "first": c.names}
                    for kind, c in book.items()},
        "floes": floes}
