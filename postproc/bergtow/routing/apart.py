# SPDX-License-Identifier: MIT
"""Distances between simple polygons [n, 2]."""
import numpy as np

from bergtow.result.frames import place


def to_edges(points, polygon):
    """[n] least distance of points [n, 2] to the edges of a closed polygon."""
    a, edge = polygon, np.roll(polygon, -1, 0) - polygon
    rel = points[:, None] - a
    along = np.clip(np.sum(rel * edge, -1) / np.maximum(np.sum(edge * edge, -1), 1e-300), 0, 1)
    return np.hypot(*np.moveaxis(rel - along[..., None] * edge, -1, 0)).min(axis=1)


def inside(points, polygon):
    """[n] of bool, from the number of edges that a ray crosses."""
    x, y = points[:, 0, None], points[:, 1, None]
    (ax, ay), (bx, by) = polygon.T, np.roll(polygon, -1, 0).T
    crosses = (ay > y) != (by > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        left = x < ax + (y - ay) * (bx - ax) / (by - ay)
    return np.sum(crosses & left, axis=1) % 2 == 1


def _side(a, b, p):
    edge, rel = b - a, p - a
    return np.sign(edge[..., 0] * rel[..., 1] - edge[..., 1] * rel[..., 0])


def of(p, q):
    """Least distance between two polygons, 0 if they share a point."""
    if inside(p[:1], q)[0] or inside(q[:1], p)[0]:
        return 0.0
    a, b, c, d = p[:, None], np.roll(p, -1, 0)[:, None], q[None], np.roll(q, -1, 0)[None]
    if np.any((_side(a, b, c) * _side(a, b, d) < 0) & (_side(c, d, a) * _side(c, d, b) < 0)):
        return 0.0
    return float(min(to_edges(p, q).min(), to_edges(q, p).min()))


def radius(polygon, centre):
    return float(np.hypot(*(polygon - centre).T).max())


def least(body, hull, areas, enough=0.0):
    """Least distance between a hull [n, 2], m from its centroid, on its way and areas: body [T, 3] x, y, yaw. A
    distance above `enough` may be underestimated. inf without areas."""
    found, reach = np.inf, radius(hull, 0)
    for area in areas:
        bound = np.where(inside(body[:, :2], area), 0.0, to_edges(body[:, :2], area)) - reach
        if bound.min() > enough:
            found = min(found, float(bound.min()))
            continue
        for pose in body[bound <= enough]:
            found = min(found, of(place(hull, pose), area))
            if found == 0:
                return 0.0
    return found
