# SPDX-License-Identifier: MIT
"""From map coordinates to metres in a plane that touches the earth at the towed body, and back to degrees.

    plane = Plane.of(map, said, centre, heading)
    plane.onto(xy)      metres (n, 2)            plane.degrees(xy)      longitude and latitude (n, 2)

The projection is azimuthal equidistant about the centre, on WGS 84, computed by PROJ. Distances and directions from the
centre are true; lengths across the line of sight are too great by (d/R)²/6 at the distance d, 4e-7 at 10 km. Rejected:
UTM, whose metres are 0.9996 to 1.001 of those on the ground, rotated by up to 3° and discontinuous at zone boundaries;
polar stereographic, with 0.97 to 1.1; stereographic about the centre, which preserves angles but has (d/R)²/4.
src/geometry/outline.c uses the same projection, derived without PROJ, so a file in degrees ends up in the case where it
was here.

With a heading H the first axis points along H and the second to the left of it, as in the basin's frame; without a
heading they are east and north.

Missing information about coordinates is not guessed. A file is rejected if it has no crs, has a crs without a place on
the earth, or contains numbers that contradict its crs; the message gives the remedy.
"""
import ctypes
import re
import warnings
from dataclasses import dataclass

import numpy as np

from bergtow import _library
from bergtow.errors import RunError
from bergtow.maps.read import local_crs, need

WGS84 = "OGC:CRS84"   # degrees, longitude first
STRUCTURED = re.compile(r"^\s*\w+:|[\[{]|\+(proj|init)=")  # a code, urn, address, WKT, JSON or PROJ string, not a name
ROUNDING = 1e-3       # degrees outside the valid range, beyond which coordinates cannot be degrees
SAY = "say what its coordinates are with --crs, for example EPSG:4326, EPSG:32633, EPSG:3413, or local for metres " \
      "east and north without a place on the earth"

try:
    import pyproj
    from pyproj.aoi import AreaOfInterest
    from pyproj.exceptions import CRSError
    from pyproj.transformer import TransformerGroup
    MISSING = None
except ImportError as error:
    MISSING = error


def vertices(geometry):
    """All vertices of a polygon or multipolygon, (n, 2)."""
    rings = [r for p in getattr(geometry, "geoms", [geometry]) for r in [p.exterior, *p.interiors]]
    return np.concatenate([np.asarray(r.coords)[:, :2] for r in rings])


# ---- coordinate reference system


def system(path, found, said, implied=False):
    """The crs of a map: a pyproj.CRS, or local_crs(). found, said: from the file and from --crs, or None; implied: the
    crs of the file is only the default of its format, and --crs overrides it. Raises RunError."""
    need(MISSING)
    ours = None if said is None else local_crs() if said in ("local", local_crs()) else known(path, said, "--crs")
    theirs = None if found is None else local_crs() if found == local_crs() else known(path, found, "its crs")
    if theirs is None and ours is None:
        raise RunError(path, "names no coordinate reference system", SAY)
    if theirs is None or ours is None:
        return theirs or ours
    if implied:
        return ours
    local = isinstance(theirs, str), isinstance(ours, str)
    if local[0] != local[1] or not local[0] and not same(theirs, ours):
        raise RunError(path, f"is in {name_of(theirs)}, but --crs says {name_of(ours)}",
                       "leave --crs out, or correct the file (ogr2ogr -a_srs, gdal_edit.py -a_srs)")
    return theirs


def known(path, text, whose):
    """A pyproj.CRS that is projected or geographic, or None if the file's crs has no place on the earth."""
    try:
        crs = pyproj.CRS.from_user_input(text)
    except CRSError:
        raise RunError(path, f"{whose} is unknown to PROJ: {' '.join(text.split())[:80]}",
                       "correct it; EPSG:4326, EPSG:32633 and the like are known") from None
    _, code = crs.to_authority() or ("", crs.name)
    if not STRUCTURED.search(text) and plain(text) not in map(plain, (crs.name, code, esri_name(crs))):
        raise RunError(path, f"{whose}, {text}, is not the name of a system; the nearest of PROJ is {name_of(crs)}",
                       "give a code, as EPSG:3413, or the full name")
    if crs.is_compound:
        crs = crs.sub_crs_list[0]
    if crs.is_geographic or crs.is_projected:
        return crs
    if whose == "--crs":
        raise RunError(path, f"--crs {text} is {crs.type_name}, neither in degrees nor a projection", SAY)
    return None


def esri_name(crs):
    """The name that ArcGIS gives to a system, as WGS_1984_UTM_Zone_33N; "" where it has none."""
    try:
        return crs.to_wkt("WKT1_ESRI").split('"')[1]
    except (CRSError, IndexError):
        return ""


def plain(name):
    """A name by its letters and digits: PROJ finds "foo" in Amersfoort, so what it finds must be what was named."""
    return re.sub(r"[\W_]", "", name).lower()


def unbound(crs):
    """The crs without a datum shift of its own (TOWGS84)."""
    return crs.source_crs if crs.is_bound else crs


def same(a, b):
    return unbound(a).equals(unbound(b), ignore_axis_order=True)


def name_of(crs):
    if isinstance(crs, str):
        return "local metres"
    crs = unbound(crs)
    code = crs.to_authority()
    return f"{':'.join(code)} ({crs.name})" if code else crs.name


def hold_against(path, crs, xy, implied=False):
    """Reject coordinates that contradict their crs. xy: of all shapes, (n, 2); implied: as in `system`."""
    far, span = np.abs(xy).max(axis=0), np.ptp(xy, axis=0)
    if isinstance(crs, str):
        return
    unit = crs.axis_info[0].unit_conversion_factor
    in_degrees = _library.library().bt_outline_in_degrees
    if crs.is_geographic:
        x, y = np.degrees(far * unit)
        if not in_degrees(max(0.0, x - ROUNDING), max(0.0, y - ROUNDING), False):
            swapped = in_degrees(y, x, False)
            raise RunError(path, f"is in {name_of(crs)}, degrees, and has coordinates up to {far[0]:.6g}, {far[1]:.6g}",
                           "latitude seems to come first: swap them" if swapped else
                           "they look like metres: " + (SAY if implied else "correct its crs (ogr2ogr -a_srs)"))
    elif in_degrees(*far * unit, True):
        raise RunError(path, f"is in {name_of(crs)}, metres, and all its coordinates lie within {span[0]:.3g} of "
                       f"{xy[0][0]:.6g}, {xy[0][1]:.6g}, as degrees do",
                       "correct its crs (ogr2ogr -a_srs EPSG:4326)")


# ---- the plane


@dataclass
class Plane:
    """A plane at a given centre: takes map coordinates, returns metres."""

    crs: object             #: of the map: a pyproj.CRS, or local_crs() (PROJ would parse that if the two were compared)
    centre: tuple           #: longitude, latitude, degrees; for local metres the position of 0, 0
    heading: float = None   #: of the first axis, degrees clockwise from north
    accuracy: float = 0.0   #: m, of the transformation to WGS 84; NaN: unknown
    _to: object = None      #: pyproj: map to degrees
    _aeqd: object = None

    @staticmethod
    def of(found, crs, centre, heading):
        """The plane of a map, centred at the given point or at the middle of its shapes. Raises RunError."""
        xy = np.concatenate([vertices(s.geometry) for s in found.shapes])
        hold_against(found.path, crs, xy, found.implied)
        plane = Plane(crs, centre, heading)
        if isinstance(crs, str):
            plane.centre = centre or tuple((xy.min(axis=0) + xy.max(axis=0)) / 2)
            return plane
        if centre and not _library.library().bt_outline_in_degrees(*centre, False):
            raise RunError(found.path, f"--centre {centre[0]:g},{centre[1]:g} is not a place on the earth",
                           "give longitude and latitude in degrees")
        lonlat = plane._prepare(found, xy)
        plane.centre = centre or middle(lonlat)
        south, north = _library.limit("map_ice_free_deg")
        if not centre and south < plane.centre[1] < north and found.crs and crs.is_geographic:
            where = "lies about latitude {1:.4g}, longitude {0:.4g}, where there is no sea ice".format(*plane.centre)
            raise RunError(found.path, where,
                           "swap the coordinates if latitude comes first, or give the place with --centre")
        plane._aeqd = pyproj.Proj(proj="aeqd", lon_0=plane.centre[0], lat_0=plane.centre[1], datum="WGS84", units="m")
        return plane

    def _prepare(self, found, xy):
        """Choose the transformation to WGS 84 that PROJ ranks best for this area; return longitude and latitude."""
        first = pyproj.Transformer.from_crs(self.crs, WGS84, always_xy=True)
        lonlat = np.array(first.transform(*xy.T)).T
        if not np.isfinite(lonlat).all():
            bad = xy[~np.isfinite(lonlat).all(axis=1)][0]
            raise RunError(found.path, f"has a vertex {bad[0]:.8g}, {bad[1]:.8g}, which is not a place in "
                           f"{name_of(self.crs)}", "correct the crs of the file, or remove the outline")
        lon, lat = middle(lonlat)
        around = AreaOfInterest(lon - 1, max(lat - 1, -90), lon + 1, min(lat + 1, 90))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the accuracy already tells the user that a better grid exists
            ways = TransformerGroup(self.crs, WGS84, always_xy=True, area_of_interest=around).transformers
        self._to = ways[0] if ways else first
        known = "ballpark" not in self._to.description.lower() and self._to.accuracy >= 0
        self.accuracy = self._to.accuracy if known else np.nan
        return self.lonlat(xy)

    def lonlat(self, xy):
        """Degrees on WGS 84 from map coordinates. The 180th meridian gets a single longitude, so that parts of a floe
        that a map cut there share one edge to the last bit and are joined again."""
        lon, lat = np.array(self._to.transform(*np.asarray(xy).T))
        return np.c_[np.where(lon <= -180, lon + 360, lon), lat]

    def onto(self, xy):
        """Metres in the plane from map coordinates."""
        if isinstance(self.crs, str):
            return self.turned(np.asarray(xy) - self.centre)
        return self.turned(np.array(self._aeqd(*self.lonlat(xy).T)).T)

    def turned(self, en):
        """Rotate east and north to the axes of the plane."""
        if self.heading is None:
            return en
        s, c = np.sin(np.radians(self.heading)), np.cos(np.radians(self.heading))
        return np.c_[en[:, 0] * s + en[:, 1] * c, -en[:, 0] * c + en[:, 1] * s]

    def unturned(self, xy):
        if self.heading is None:
            return np.asarray(xy)
        s, c = np.sin(np.radians(self.heading)), np.cos(np.radians(self.heading))
        return np.c_[xy[:, 0] * s - xy[:, 1] * c, xy[:, 0] * c + xy[:, 1] * s]

    def degrees(self, xy):
        """Longitude and latitude from metres in the plane."""
        lon, lat = self._aeqd(*self.unturned(np.asarray(xy)).T, inverse=True)
        return np.c_[lon, lat]

    def distortion(self, xy):
        """Distortion of lengths, areas and north by the plane and the map, at points of the plane, computed by PROJ:
        distance of the farthest point, m; largest relative errors of length and of area; largest angle between the
        plane's north and true north, degrees; least and greatest scale of the map, or None if it is in degrees."""
        xy = np.asarray(xy)
        out = {"farthest_m": float(np.hypot(*xy.T).max())}
        if isinstance(self.crs, str):
            return out
        lonlat = self.degrees(xy)
        f = self._aeqd.get_factors(*lonlat.T)
        out |= {"length_error": float(np.abs(np.r_[f.tissot_semimajor, f.tissot_semiminor] - 1).max()),
                "area_error": float(np.abs(f.areal_scale - 1).max()),
                "north_turns_deg": float(np.abs(f.meridian_convergence).max()), "map_scale": None}
        if self.crs.is_projected:
            there = lonlat if same(self.crs.geodetic_crs, pyproj.CRS(WGS84)) else np.array(
                pyproj.Transformer.from_crs(WGS84, self.crs.geodetic_crs, always_xy=True).transform(*lonlat.T)).T
            f = pyproj.Proj(self.crs).get_factors(*there.T)
            out["map_scale"] = [float(f.tissot_semiminor.min()), float(f.tissot_semimajor.max())]
        return out


def middle(lonlat):
    """The middle of a set of positions, as the program computes it for a map (bergtow/outline.h)."""
    places, out = np.ascontiguousarray(lonlat, dtype=float), (ctypes.c_double * 2)()
    _library.library().bt_outline_middle(len(places), places.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), out)
    return tuple(out)
