# SPDX-License-Identifier: MIT
"""Maps of ice as GIS programs have them: outlines in any vector format that GDAL knows, or an image of labels.

    read(path, Reading(layer=..., where=...))     Map: shapes in the coordinates of the file, its crs, what was imaged

A label image is cut into connected regions of one value; each is a shape. (Regions that meet at a corner only are two.)
Along pixels an outline would be a staircase, half of whose corners stick out of the shore. So each of its unit steps
gives way to its middle: convex and concave corners lose and gain an eighth of a pixel each, and since a closed ring has
four more of the one than of the other, its area changes by half a pixel in all, whatever its length. Shapes that touch
share these middles, so nothing opens or overlaps between them.

Libraries: osgeo alone, since GDAL reads outlines and images by the same call and both Debians have it. Rejected:
fiona and rasterio, two packages over the same library for what is used of it here.
"""
import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bergtow_read import RunError

INSTALL = "apt-get install python3-gdal python3-pyproj python3-shapely"
LOCAL = "urn:x-bergtow:crs:local-metres-east-north"  # src/field/map_crs.h
MOST_PIXELS = 400_000_000
NEARLY = ("height", "h", "ice_height", "draft", "dicke", "tykkelse", "sit")  # as src/field/geojson.c
TELLS_ITSELF = ("TIFFTAG_IMAGEDESCRIPTION", "DESCRIPTION", "Description", "Comment")

try:
    from osgeo import gdal, ogr
    from shapely import wkb
    from shapely.geometry import MultiPolygon, Polygon
    from shapely.ops import unary_union
    from shapely.prepared import prep
    MISSING = None
except ImportError as error:
    MISSING = error


@dataclass
class Reading:
    """How a file is to be read, where it leaves a choice."""

    layer: str = None
    where: str = None
    thickness: str = None   #: name of a column; of an image, "VALUE=M,..."
    water: tuple = (0,)     #: values of an image that are no ice
    band: int = None
    pixel: float = None     #: m, of an image that says nothing of its place
    nodata: str = None      #: "water" or "unseen": what an image's nodata is where --water has its value, too


@dataclass
class Shape:
    """One outline, or several of one feature, as the file has them."""

    name: str
    geometry: object            #: Polygon, MultiPolygon or None
    thickness: float = None     #: m
    cut: bool = False           #: by the edge of the image
    pixels: object = None       #: Polygon along the edges of its pixels, whose area an image has


@dataclass
class Map:
    """What a file holds."""

    path: Path
    crs: str                    #: WKT or a name, LOCAL, or None where the file says nothing
    shapes: list
    seen: object = None         #: what was imaged, in the coordinates of the file; None: not known
    pixels: int = 0             #: in `seen`
    about: str = ""             #: what the file says of itself
    near: list = field(default_factory=list)     #: columns not read whose names are nearly that of the thickness
    skipped: dict = field(default_factory=dict)  #: {why: [names]}


def need_libraries():
    """Errors: RunError where GDAL or shapely is not installed."""
    if MISSING:
        raise RunError("outlines", f"a library is missing ({MISSING})", f"install it: {INSTALL}")


def read(path, how):
    """The map. Errors: RunError."""
    need_libraries()
    gdal.UseExceptions()
    ogr.UseExceptions()
    if not path.exists():
        raise RunError(path, "no such file", "name a file of outlines or of labels")
    if path.suffix.lower() == ".npy":
        return from_array(path, how)
    try:
        source = gdal.OpenEx(str(path), gdal.OF_VECTOR | gdal.OF_RASTER)
    except RuntimeError as error:
        raise RunError(path, f"is no map that GDAL can read ({first_line(error)})",
                       "name outlines (GeoJSON, shapefile, GeoPackage, ...) or an image of labels") from None
    return from_layer(path, source, how) if source.GetLayerCount() else from_image(path, source, how)


def first_line(error):
    return (str(error).splitlines() or ["no reason given"])[0]


def refuse_unused(path, how, names, kind):
    for name in names:
        if getattr(how, name) != getattr(Reading(), name):
            raise RunError(path, f"holds {kind}, for which there is no --{name}", f"leave --{name} out")


# ---- outlines


def from_layer(path, source, how):
    refuse_unused(path, how, ("water", "band", "pixel", "nodata"), "outlines")
    names = [source.GetLayer(k).GetName() for k in range(source.GetLayerCount())]
    if how.layer is None and len(names) > 1 or how.layer is not None and how.layer not in names:
        raise RunError(path, f"holds the layers {', '.join(names)}", "choose one of them with --layer")
    layer = source.GetLayerByName(how.layer or names[0])
    columns = [layer.GetLayerDefn().GetFieldDefn(k).GetName() for k in range(layer.GetLayerDefn().GetFieldCount())]
    if how.thickness and how.thickness not in columns:
        raise RunError(path, f"has no column {how.thickness}",
                       f"name one of {', '.join(columns) or 'those of another layer'}")
    found = Map(path, crs_of_layer(path, source, layer), [], about=about_of(path, source, layer))
    try:
        if how.where:
            layer.SetAttributeFilter(how.where)
        column = how.thickness or thickness_column(layer, columns)
        if not column:
            found.near = [name for name in columns if "thick" in name.lower() or name.lower() in NEARLY]
        for feature in layer:
            add_feature(found, feature, column)
    except RuntimeError as error:
        raise RunError(path, f"cannot be read ({first_line(error)})",
                       "mend --where, or the file (ogrinfo tells more)") from None
    if not found.shapes:
        others = sum(len(names) for names in found.skipped.values())
        raise RunError(path, f"holds no polygons ({others} features of other kinds)" if others else
                       "holds no features" + (" of --where" if how.where else ""), "name a layer of floe outlines")
    return found


def thickness_column(layer, columns):
    """The column of the thickness where none is named, or None. Under another spelling it may hold anything: remarks,
    texts with units, 0 for what nobody measured."""
    def sound(name):
        values = (f.GetField(name) for f in layer if f.IsFieldSetAndNotNull(name))
        return all(positive(value) is not None for value in values)
    if "thickness" in columns:
        return "thickness"
    return next((name for name in columns if name.lower() == "thickness" and sound(name)), None)


def add_feature(found, feature, column):
    name, geometry = f"feature {feature.GetFID()}", feature.GetGeometryRef()
    thickness = None
    if column and feature.IsFieldSetAndNotNull(column):
        thickness = positive(feature.GetField(column))
        if thickness is None:
            raise RunError(found.path, f"{name}: {column} = {feature.GetField(column)} is no thickness in metres",
                           "correct it, or leave the column empty")
    if geometry is None or geometry.IsEmpty():
        found.skipped.setdefault("empty", []).append(name)
        return
    geometry = geometry.GetLinearGeometry()
    geometry.FlattenTo2D()
    geometry.CloseRings()
    polygons, others = polygons_of(geometry)
    for ring in (r for p in polygons for r in [p.exterior, *p.interiors]):
        if not np.isfinite(np.asarray(ring.coords)).all():
            raise RunError(found.path, f"{name} has a vertex that is no finite number", "correct it or take it out")
    if others:
        found.skipped.setdefault(others, []).append(name)
    if polygons:
        whole = polygons[0] if len(polygons) == 1 else MultiPolygon(polygons)
        found.shapes.append(Shape(name, whole, thickness))


def polygons_of(geometry):
    """([Polygon], why something of an OGR geometry is left out or None)."""
    kind = geometry.GetGeometryName()
    if kind == "POLYGON":
        try:
            return [wkb.loads(bytes(geometry.ExportToWkb()))], None
        except Exception:  # GEOS has no class of its own for a ring of two points
            return [], "fewer than 3 vertices"
    parts = [polygons_of(geometry.GetGeometryRef(k)) for k in range(geometry.GetGeometryCount())]
    if kind in ("POINT", "LINESTRING") or not parts:
        return [], "no polygon"
    return [p for some, _ in parts for p in some], next((why for _, why in parts if why), None)


def positive(value):
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if 0 < number < np.inf else None


def crs_of_layer(path, source, layer):
    """GDAL takes GeoJSON for degrees also where its crs is none that GDAL knows: so there the file is asked."""
    if source.GetDriver().ShortName == "GeoJSON":
        crs = head_of(path).get("crs")
        name = crs.get("properties", {}).get("name") if isinstance(crs, dict) else None
        if crs is not None:
            return f"{name}"  # for PROJ to judge, but for LOCAL: map_plane.py
    reference = layer.GetSpatialRef()
    return reference.ExportToWkt() if reference else None


def head_of(path):
    """The members of a GeoJSON text."""
    try:
        text = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return {}
    return text if isinstance(text, dict) else {}


def about_of(path, source, layer=None):
    texts = [source.GetMetadataItem(key) for key in TELLS_ITSELF]
    if layer:
        texts += [layer.GetMetadataItem(key) for key in TELLS_ITSELF]
        if source.GetDriver().ShortName == "GeoJSON":
            texts.append(head_of(path).get("description"))
    return next((" ".join(str(text).split()) for text in texts if text), "")


def mark_cut(found, degrees):
    """Outlines have no image; where the edges of several lie on one side of the box of all, it was one's edge. But the
    180th meridian, at which files in degrees part floes (RFC 7946), ends no map."""
    if found.seen is not None:
        return
    bounds = np.array([s.geometry.bounds for s in found.shapes])
    sides = np.r_[bounds[:, :2].min(axis=0), bounds[:, 2:].max(axis=0)]
    near = 1e-9 * max(sides[2] - sides[0], sides[3] - sides[1])
    for k in range(4):
        if degrees and k % 2 == 0 and abs(abs(sides[k]) - 180) <= near:
            continue
        lying = [s for s, b in zip(found.shapes, bounds)
                 if abs(b[k] - sides[k]) <= near and lies_on(s.geometry, k % 2, sides[k], near)]
        for shape in lying if len(lying) > 1 else []:
            shape.cut = True


def lies_on(geometry, axis, value, near):
    """Has a shape an edge, not only a vertex, where one coordinate has this value?"""
    for part in getattr(geometry, "geoms", [geometry]):
        on = np.abs(np.asarray(part.exterior.coords)[:, axis] - value) <= near
        if np.any(on[1:] & on[:-1]):
            return True
    return False


# ---- label images


def from_array(path, how):
    refuse_unused(path, how, ("layer", "where", "band", "nodata"), "an image of numpy")
    try:
        labels = np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise RunError(path, f"is no array of numpy ({first_line(error)})", "write it with numpy.save") from None
    if labels.ndim != 2 or labels.dtype.kind not in "biuf" or not labels.size:
        raise RunError(path, f"has the shape {labels.shape} and the type {labels.dtype}",
                       "save one label a pixel: rows, from the north, by columns")
    return of_labels(Map(path, None, []), labels, finite(labels), np.isin(labels, how.water), None, how)


def finite(labels):
    return np.isfinite(labels) if labels.dtype.kind == "f" else np.ones(labels.shape, bool)


def from_image(path, source, how):
    refuse_unused(path, how, ("layer", "where"), "an image")
    bands = source.RasterCount
    if how.band is None and bands != 1 or not 1 <= (how.band or 1) <= bands:
        raise RunError(path, f"has {bands} bands, as pictures do; labels are one number a pixel",
                       "choose it with --band, or classify the image first")
    if source.RasterXSize * source.RasterYSize > MOST_PIXELS:
        raise RunError(path, f"has more than {MOST_PIXELS} pixels", "cut it, or make it coarser (gdal_translate)")
    band = source.GetRasterBand(how.band or 1)
    try:
        labels, nodata = band.ReadAsArray(), band.GetNoDataValue()
    except RuntimeError as error:
        raise RunError(path, f"cannot be read ({first_line(error)})", "get it anew") from None
    if nodata is None and how.nodata is not None:
        raise RunError(path, "has no nodata value", "leave --nodata out")
    if nodata is not None and nodata in how.water and how.nodata is None:
        raise RunError(path, f"has {nodata:g} both for nodata and for water (--water)",
                       "say which it is: --nodata water, or --nodata unseen")
    empty = np.zeros(labels.shape, bool)
    if nodata is not None:
        empty = np.isnan(labels) if np.isnan(nodata) else labels == nodata
    valid = finite(labels) | empty if how.nodata == "water" else finite(labels) & ~empty
    flags = band.GetMaskFlags()
    if not flags & (gdal.GMF_ALL_VALID | gdal.GMF_NODATA):
        valid &= band.GetMaskBand().ReadAsArray() != 0
    if source.GetGCPCount() and source.GetGeoTransform(can_return_null=True) is None:
        raise RunError(path, "is placed by control points", "warp it first: gdalwarp -r near")
    reference = source.GetSpatialRef()
    found = Map(path, reference.ExportToWkt() if reference else None, [], about=about_of(path, source))
    water = empty | np.isin(labels, how.water)
    return of_labels(found, labels, valid, water, source.GetGeoTransform(can_return_null=True), how)


def of_labels(found, labels, valid, water, place, how):
    """The map of an image. valid: what was seen; water: what is no ice, and need be no label, such as a nodata of NaN.
    place: GDAL's six numbers from column and row to coordinates, or None."""
    ice = valid & ~water
    some = labels[ice]
    if not valid.any() or np.any(some != np.rint(some)) or np.abs(some).max(initial=0) > 2 ** 31 - 1:
        raise RunError(found.path, "has values that are no labels (whole numbers)", "classify the image first")
    if place is None and how.pixel is None:
        raise RunError(found.path, "says nothing of its place and scale (no geotransform, no world file)",
                       "give the size of a pixel in metres with --pixel, or a world file beside it")
    if place is not None and how.pixel is not None:
        raise RunError(found.path, "has a scale of its own", "leave --pixel out")
    if place is None:
        rows, columns = labels.shape
        place = (-how.pixel * columns / 2, how.pixel, 0, how.pixel * rows / 2, 0, -how.pixel)
        found.crs = LOCAL
    thick = thickness_by_value(found.path, how.thickness)
    values = np.where(ice, labels, 0).astype(np.int32)
    edge = unary_union([p for p, _ in regions(valid.astype(np.int32), valid)])
    touches = prep(edge.boundary).intersects
    for polygon, value in regions(values, ice):
        name = f"label {value} at column {polygon.exterior.coords[0][0]:.0f}, row {polygon.exterior.coords[0][1]:.0f}"
        found.shapes.append(Shape(name, placed(bevelled(polygon), place), thick.get(value), touches(polygon),
                                  placed(Polygon(polygon.exterior), place)))
    if not found.shapes:
        raise RunError(found.path, "holds no label of ice", f"say which values are water: --water (now {how.water})")
    found.seen, found.pixels = placed(edge, place), int(valid.sum())
    return found


def thickness_by_value(path, text):
    pairs = [pair.split("=") for pair in (text or "").split(",") if pair]
    try:
        out = {int(value): positive(metres) for value, metres in pairs}
    except ValueError:
        out = {0: None}
    if None in out.values():
        raise RunError(path, f"--thickness {text} is no list VALUE=M,...", "write for example 1=0.5,2=1.2")
    return out


def regions(values, mask):
    """[(Polygon in columns and rows, value)] of connected pixels of one value."""
    rows, columns = values.shape
    image = gdal.GetDriverByName("MEM").Create("", columns, rows, 2, gdal.GDT_Int32)
    image.GetRasterBand(1).WriteArray(values)
    image.GetRasterBand(2).WriteArray(mask.astype(np.int32))
    memory = (gdal.GetDriverByName("Memory") or gdal.GetDriverByName("MEM")).Create("", 0, 0, 0, gdal.GDT_Unknown)
    layer = memory.CreateLayer("regions")
    layer.CreateField(ogr.FieldDefn("value", ogr.OFTInteger))
    gdal.Polygonize(image.GetRasterBand(1), image.GetRasterBand(2), layer, 0)
    return [(wkb.loads(bytes(f.GetGeometryRef().ExportToWkb())), f.GetField(0)) for f in layer]


def bevelled(polygon):
    """The polygon through the middles of the unit steps of its rings."""
    def ring(points):
        p = np.asarray(points)
        steps = np.abs(np.diff(p, axis=0)).sum(axis=1).astype(int)
        start, way = np.repeat(p[:-1], steps, axis=0), np.repeat(np.sign(np.diff(p, axis=0)), steps, axis=0)
        within = np.arange(steps.sum()) - np.repeat(np.cumsum(steps) - steps, steps)
        return start + way * (within[:, None] + 0.5)
    return Polygon(ring(polygon.exterior.coords), [ring(r.coords) for r in polygon.interiors])


def placed(geometry, place):
    """From columns and rows to the coordinates of the map."""
    x0, a, b, y0, c, d = place

    def ring(points):
        p = np.asarray(points)
        return np.c_[x0 + a * p[:, 0] + b * p[:, 1], y0 + c * p[:, 0] + d * p[:, 1]]
    parts = [Polygon(ring(p.exterior.coords), [ring(r.coords) for r in p.interiors])
             for p in getattr(geometry, "geoms", [geometry])]
    return parts[0] if len(parts) == 1 else MultiPolygon(parts)
