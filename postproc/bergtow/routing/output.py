# SPDX-License-Identifier: MIT
"""Routes as files: GeoJSON for charts, GPX for the bridge, and one case per route for the program."""
import json
import os
from xml.sax.saxutils import escape, quoteattr

from bergtow import _library, writing

import numpy as np


def positions(xy, place):
    """[[east, north]] from metres of the case: degrees if the case has a geographic position, otherwise metres."""
    if place.origin is None:
        return np.round(place.map(xy), 4).tolist()
    lon, lat = place.degrees(xy).T  # in one piece across the 180th meridian
    return np.round(np.column_stack([np.unwrap(lon, period=360), lat]), 8).tolist()


def features(candidates, place, numbers):
    """GeoJSON features for each candidate: the track of the body, that of the towing end, and the swath. numbers:
    {name: properties}."""
    out = []
    for c in candidates:
        parts = [("berg", "LineString", c.track), ("swath", "Polygon", c.swath)]
        if c.tug is not None:
            parts.insert(1, ("tug", "LineString", c.tug))
        for kind, shape, xy in parts:
            at = positions(xy, place)
            at = [at + at[:1]] if shape == "Polygon" else at
            out.append({"type": "Feature", "properties": {"route": c.name, "track": kind, **numbers[c.name]},
                        "geometry": {"type": shape, "coordinates": at}})
    return out


def geojson(candidates, place, numbers, path, force):
    """Write GeoJSON; without a geographic position in metres from x = y = 0, with a local crs. Raises RunError."""
    local = {"type": "name", "properties": {"name": _library.limit("map_local_crs")}}
    crs = {} if place.origin else {"crs": local}
    found = {"type": "FeatureCollection", **crs, "made_by": writing.MARK,
             "features": features(candidates, place, numbers)}
    writing.write_text(json.dumps(writing.plain(found), allow_nan=False) + "\n", path, force)


def gpx(candidates, place, path, force):
    """Write route points of the towing end, or of the body if its speed is prescribed, from its start on. Raises
    RunError."""
    lines = ['<?xml version="1.0" encoding="UTF-8"?>',
             '<gpx version="1.1" creator="bergtow" xmlns="http://www.topografix.com/GPX/1/1">',
             f" <metadata><desc>{escape(writing.MARK)}</desc></metadata>"]
    for c in candidates:
        points = place.degrees([(c.track if c.tug is None else c.tug)[0], *c.points])
        lines += [f" <rte><name>{escape(c.label)}</name>", f"  <desc>{'body' if c.tug is None else 'vessel'}</desc>"]
        lines += [f"  <rtept lat={quoteattr(f'{lat:.7f}')} lon={quoteattr(f'{lon:.7f}')}/>" for lon, lat in points]
        lines.append(" </rte>")
    writing.write_text("\n".join([*lines, "</gpx>"]) + "\n", path, force)


def case(c, base, path, force):
    """Write the case of a route, ready for the program to run. Raises RunError."""
    keys = {"run.title": f"tow along {c.label}", **c.keys}
    found = {"base": os.path.relpath(base, path.parent)}
    for key, text in keys.items():
        section, name = key.split(".", 1)
        found.setdefault(section, {})[name] = text
    said = json.dumps(found, indent=1, ensure_ascii=False)
    for key in ("tow.waypoints", "tow.programme"):  # lists, not texts
        if key in keys:
            said = said.replace(json.dumps(keys[key]), keys[key])
    writing.write_text(f"# {writing.MARK}\n{said}\n", path, force)
