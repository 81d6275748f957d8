# SPDX-License-Identifier: MIT
"""Read maps of ice in GIS formats: outlines in any vector format of GDAL, or an image of labels.

    read(path, Reading(layer=..., where=...))     Map: shapes in the coordinates of the file, its crs, the imaged area

A label image is divided into connected regions of equal value; each region is a shape. (Regions that meet only at a
corner are separate.) An outline along pixels would be a staircase, with corners that are not real bays. maps/stairs.py
straightens such outlines, both those of an image and those in a vector file that were traced along pixels. If this
would leave nothing of a tiny floe, or is switched off, the outline passes through the middle of each unit step of an
image: each convex corner loses an eighth of a pixel and each concave corner gains as much. A closed ring has four more
convex than concave corners, so its area changes by half a pixel in total.

Libraries: only osgeo, since GDAL reads outlines and images through the same call, and both Debian releases have it.
Rejected: fiona and rasterio, two more packages on top of the same library.
"""
import json
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bergtow import _library
from bergtow.errors import RunError
from bergtow.maps import stairs as map_stairs
from bergtow.result.hdf5 import first_line

INSTALL = "apt-get install python3-gdal python3-pyproj python3-shapely"
MAX_PIXELS = 400_000_000
IMPLIED = ("OGC:1.3:CRS84", "OGC:CRS84", "EPSG:4326")  # crs of GeoJSON if nothing else is given [RFC 7946]
METRES = {"m": 1.0, "km": 1e3} | {f"{prefix}met{ending}": 1e3 if prefix else 1.0  #: units of lengths in NetCDF
                                  for prefix in ("", "kilo") for ending in ("re", "res", "er", "ers")}
LISTED = 20  # number of grids of a file that a message lists
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


def local_crs():
    """The name of the crs for metres east and north without a geographic position."""
    return _library.limit("map_local_crs")


@dataclass
class Reading:
    layer: str = None
    where: str = None
    thickness: str = None   #: name of a column; of an image, "VALUE=M,..."
    water: tuple = (0,)     #: values of an image that are not ice
    band: int = None
    pixel: float = None     #: m, of an image without a geographic position
    nodata: str = None      #: "water" or "unseen": meaning of the image's nodata value if --water names it, too
    unseen: tuple = ()      #: values of an image that mark areas that were not observed
    footprint: tuple = None #: corners of the imaged area, in columns and rows for an image
    stairs: str = "undo"    #: or "keep"
    bare: bool = False      #: outlines alone: a column of thicknesses is not read
    choose: str = "choose one of them with --layer" #: remedy where a file has several layers


@dataclass
class Shape:
    """One feature of the file, with one or more outlines."""

    name: str
    geometry: object            #: Polygon, MultiPolygon or None
    thickness: float = None     #: m
    cut: bool = False           #: by the edge of the image
    pixels: object = None       #: Polygon along the edges of its pixels; its area is the true one for an image
    straight: bool = False      #: its staircase was straightened


@dataclass
class Map:
    path: Path
    crs: str                    #: WKT or a name, local_crs(), or None if the file gives no crs
    shapes: list
    implied: bool = False       #: the crs is the default of the format
    seen: object = None         #: the imaged area, in the coordinates of the file; None: unknown
    pixels: int = 0             #: number of pixels in `seen`
    about: str = ""             #: description in the file
    near: list = field(default_factory=list)     #: unread columns with names close to that of the thickness
    skipped: dict = field(default_factory=dict)  #: {reason: [names]}
    chart: list = field(default_factory=list)    #: columns, or attributes of a grid, of an ice chart, not of floes


def need(missing=MISSING):
    """Raises RunError for an ImportError; the default is that of GDAL or shapely."""
    if missing:
        raise RunError("outlines", f"a library is missing ({missing})", f"install it: {INSTALL}")


def read(path, how):
    """Read the map. Raises RunError."""
    need()
    gdal.UseExceptions()
    ogr.UseExceptions()
    if not path.exists():
        raise RunError(path, "no such file", "name a file of outlines or of labels; of several grids or layers in it "
                       "--layer chooses one")
    if path.suffix.lower() == ".npy":
        return from_array(path, how)
    try:
        source = quietly(gdal.OpenEx, str(path), gdal.OF_VECTOR | gdal.OF_RASTER)
    except RuntimeError as error:
        raise RunError(path, f"is not a map that GDAL can read ({first_line(error)})",
                       "name outlines (GeoJSON, shapefile, GeoPackage, ...) or an image of labels") from None
    layers = [source.GetLayer(k) for k in range(source.GetLayerCount())]
    # GDAL also takes the time of a grid in NetCDF for a layer
    if any(layer.GetGeomType() != ogr.wkbNone for layer in layers) or layers and not source.RasterCount:
        return from_layer(path, source, how)
    source, name = grid_of(path, source, how)
    return from_image(path, source, how, name)


def quietly(call, *words, **named):
    """Call GDAL without printing its warnings; errors are still raised."""
    gdal.PushErrorHandler("CPLQuietErrorHandler")
    try:
        return call(*words, **named)
    finally:
        gdal.PopErrorHandler()


def refuse_unused(path, how, names, kind):
    for name in names:
        if getattr(how, name) != getattr(Reading(), name):
            raise RunError(path, f"holds {kind}, for which there is no --{name}", f"leave --{name} out")


# ---- outlines


def from_layer(path, source, how):
    refuse_unused(path, how, ("water", "band", "pixel", "nodata", "unseen", "footprint"), "outlines")
    names = [source.GetLayer(k).GetName() for k in range(source.GetLayerCount())]
    if how.layer is None and len(names) > 1 or how.layer is not None and how.layer not in names:
        raise RunError(path, f"holds the layers {', '.join(names)}", how.choose)
    layer = source.GetLayerByName(how.layer or names[0])
    columns = [layer.GetLayerDefn().GetFieldDefn(k).GetName() for k in range(layer.GetLayerDefn().GetFieldCount())]
    if how.thickness and how.thickness not in columns:
        raise RunError(path, f"has no column {how.thickness}",
                       f"name one of {', '.join(columns) or 'those of another layer'}")
    crs, implied = crs_of_layer(path, source, layer)
    in_chart = _library.library().bt_outline_chart_column
    found = Map(path, crs, [], implied, about=about_of(path, source, layer),
                chart=[name for name in columns if in_chart(name.encode(errors="replace"))])
    try:
        if how.where:
            layer.SetAttributeFilter(how.where)
        name = how.thickness or (None if how.bare else thickness_column(layer, columns))
        column = columns.index(name) if name else None  # GDAL takes a name for that of any column that differs in case
        if not how.thickness:
            near = _library.library().bt_outline_near_thickness
            found.near = [other for other in columns if other != name and (
                other.lower() == name.lower() if name else near(other.encode(errors="replace")))]
        for feature in layer:
            add_feature(found, feature, column)
    except RuntimeError as error:
        raise RunError(path, f"cannot be read ({first_line(error)})",
                       f"correct {'--where, or ' if how.where else ''}the file (ogrinfo tells more)") from None
    if how.stairs == "undo":
        retrace(found.shapes)
    if not found.shapes:
        others = sum(len(names) for names in found.skipped.values())
        raise RunError(path, f"holds no polygons ({others} of its features without one)" if others else
                       "holds no features" + (" of --where" if how.where else ""), "name a layer of floe outlines")
    return found


def retrace(shapes):
    """Straighten the staircases of outlines that were traced along the pixels of an image."""
    polygons = [s.geometry for s in shapes if s.geometry.geom_type == "Polygon"]
    pixel = map_stairs.lattice(polygons) if polygons else None
    for shape in shapes if pixel is not None else []:
        new = map_stairs.retraced(shape.geometry, pixel) if shape.geometry.geom_type == "Polygon" else None
        new = new and Polygon(new.exterior, shape.geometry.interiors)
        if new and new.is_valid:
            shape.pixels, shape.straight = Polygon(shape.geometry.exterior), True
            shape.geometry = new


def thickness_column(layer, columns):
    """The thickness column if the caller names none, or None. Only the exact name counts: a column with a similar name
    may hold anything, such as remarks, texts with units, or 0 for floes that were not measured."""
    def sound(name):
        column = columns.index(name)
        values = (f.GetField(column) for f in layer if f.IsFieldSetAndNotNull(column))
        return all(metres_of(value) is not None for value in values)
    if "thickness" in columns:
        return "thickness"
    return next((name for name in columns if name.lower() == "thickness" and sound(name)), None)


def add_feature(found, feature, column):
    name, geometry = f"feature {feature.GetFID()}", feature.GetGeometryRef()
    thickness = None
    if column is not None and feature.IsFieldSetAndNotNull(column):
        value = feature.GetField(column)
        thickness = metres_of(value)
        if thickness is None:
            raise RunError(found.path, f"{name}: {feature.GetFieldDefnRef(column).GetName()} = {value} is not a "
                           f"thickness in metres, from {thickness_range()}",
                           "correct it (it may be in centimetres), or leave the column empty")
    if geometry is None or geometry.IsEmpty():
        found.skipped.setdefault("empty", []).append(name)
        return
    geometry = geometry.GetLinearGeometry()
    geometry.FlattenTo2D()
    geometry.CloseRings()
    polygons, others = polygons_of(geometry)
    for ring in (r for p in polygons for r in [p.exterior, *p.interiors]):
        if not np.isfinite(np.asarray(ring.coords)).all():
            raise RunError(found.path, f"{name} has a vertex that is not a finite number", "correct it or remove it")
    if others:
        found.skipped.setdefault("other parts" if polygons and others == "no polygon" else others, []).append(name)
    if polygons:
        whole = polygons[0] if len(polygons) == 1 else MultiPolygon(polygons)
        found.shapes.append(Shape(name, whole, thickness))


def polygons_of(geometry):
    """([Polygon], reason why part of an OGR geometry is left out, or None)."""
    kind = geometry.GetGeometryName()
    if kind == "POLYGON":
        try:
            return [wkb.loads(bytes(geometry.ExportToWkb()))], None
        except Exception:  # GEOS has no exception class of its own for a ring of two points
            return [], "fewer than 3 vertices"
    parts = [polygons_of(geometry.GetGeometryRef(k)) for k in range(geometry.GetGeometryCount())]
    if kind in ("POINT", "LINESTRING") or not parts:
        return [], "no polygon"
    return [p for some, _ in parts for p in some], next((why for _, why in parts if why), None)


def metres_of(value):
    """A thickness that a case accepts, or None."""
    least, most = _library.limit("thickness_m")
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if least <= number <= most else None


def thickness_range():
    return "{:g} to {:g}".format(*_library.limit("thickness_m"))


def crs_of_layer(path, source, layer):
    """(crs or None, is it only implied?). GeoJSON without a crs is in degrees. Programs that do not know their system
    write some name of one, and GDAL takes any unknown name for degrees; so the crs is read from the file itself there.
    An undefined system, as a GeoPackage may have, counts as none."""
    driver = source.GetDriver().ShortName
    crs = head_of(path).get("crs") if driver == "GeoJSON" else None
    if crs is not None:
        name = f"{crs.get('properties', {}).get('name') if isinstance(crs, dict) else None}"
        return name, name.upper().replace("::", ":").endswith(IMPLIED)  # PROJ judges all but local_crs()
    reference = layer.GetSpatialRef()
    if reference is None or (reference.GetName() or "").lower().startswith("undefined"):
        return None, False
    return reference.ExportToWkt(), driver.startswith("GeoJSON")


def head_of(path):
    """The top-level members of a GeoJSON text."""
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
    """Mark outlines that the edge of an image has cut. A vector file has no image: if edges of several outlines lie on
    one side of the bounding box of all, that side is taken for the edge of an image. The 180th meridian, where files in
    degrees divide floes (RFC 7946), does not count as an edge. Longitudes all around a pole have no box."""
    if found.seen is not None:
        return
    drawn = [s.pixels or s.geometry for s in found.shapes]
    if degrees:
        drawn = unwrapped(drawn)
    bounds = np.array([g.bounds for g in drawn])
    sides = np.r_[bounds[:, :2].min(axis=0), bounds[:, 2:].max(axis=0)]
    if degrees and sides[2] - sides[0] > 180:
        return
    near = 1e-9 * max(sides[2] - sides[0], sides[3] - sides[1])
    for k in range(4):
        if degrees and k % 2 == 0 and abs(abs(sides[k]) - 180) <= near:
            continue
        lying = [s for s, g, b in zip(found.shapes, drawn, bounds)
                 if abs(b[k] - sides[k]) <= near and lies_on(g, k % 2, sides[k], near)]
        for shape in lying if len(lying) > 1 else []:
            shape.cut = True


def unwrapped(geometries):
    """The same with each longitude within 180° of the mean direction."""
    longitudes = np.concatenate([np.asarray(p.exterior.coords)[:, 0] for g in geometries
                                 for p in getattr(g, "geoms", [g])])
    middle = np.angle(np.exp(1j * np.radians(longitudes)).mean(), deg=True)
    return [moved(g, lambda p: p - np.c_[360 * np.rint((p[:, 0] - middle) / 360), np.zeros(len(p))])
            for g in geometries]


def lies_on(geometry, axis, value, near):
    """Does the shape have an edge, not only a vertex, where one coordinate has this value?"""
    for part in getattr(geometry, "geoms", [geometry]):
        on = np.abs(np.asarray(part.exterior.coords)[:, axis] - value) <= near
        if np.any(on[1:] & on[:-1]):
            return True
    return False


# ---- label images


def grid_of(path, source, how):
    """(the dataset to read, its name or None). A NetCDF or HDF5 file may hold several grids: how.layer selects one."""
    grids = {re.sub(r'^.*":/*|^[^:]*:[^:]*:/*', "", full): (full, text) for full, text in source.GetSubDatasets()}
    if not grids:
        refuse_unused(path, how, ("layer",), "an image")
    elif how.layer in grids:
        source = gdal.Open(grids[how.layer][0])
    elif how.layer or not source.RasterCount:
        names = [f"{name} {text.split(']')[0]}]" for name, (_, text) in grids.items()]
        more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
        raise RunError(path, f"holds the grids {', '.join(names[:LISTED])}{more}",
                       "choose one of them with --layer, for example --layer " + next(iter(grids)))
    return source, how.layer if grids else None


def as_stored(source):
    """The same grid with its rows in the order of the file. If a grid has no georeference, GDAL's netCDF driver takes
    the first row for the southernmost, even if the file begins in the north."""
    before = gdal.GetConfigOption("GDAL_NETCDF_BOTTOMUP")
    gdal.SetConfigOption("GDAL_NETCDF_BOTTOMUP", "NO")
    try:
        return gdal.Open(source.GetDescription())
    finally:
        gdal.SetConfigOption("GDAL_NETCDF_BOTTOMUP", before)


def place_of(path, source, name):
    """The six numbers of GDAL's geotransform, or None if the file does not give them. They are also derived from
    coordinate variables without units in NetCDF or HDF5, which GDAL does not recognise. Raises RunError."""
    place = source.GetGeoTransform(can_return_null=True)
    if source.GetDriver().ShortName not in ("netCDF", "HDF5", "HDF5Image"):
        return place
    try:
        root = gdal.OpenEx(str(path), gdal.OF_MULTIDIM_RASTER).GetRootGroup()
        full = name or next(n for n in root.GetMDArrayNames() if root.OpenMDArray(n).GetDimensionCount() >= 2)
        rows, columns = root.OpenMDArrayFromFullname("/" + full).GetDimensions()[-2:]
    except (RuntimeError, AttributeError, StopIteration, ValueError):
        return place
    if columns.GetType() == gdal.DIM_TYPE_HORIZONTAL_Y:
        x, y = rows.GetName(), columns.GetName()
        raise RunError(path, f"holds {full} as ({x}, {y}), whose rows lie along {y}",
                       f"give it rows along {x}: ncpdq -a {y},{x} (NCO)")
    if place is not None:
        return in_unit_of(source.GetSpatialRef(), place, (columns, rows))
    try:
        axes = [d.GetIndexingVariable().ReadAsArray().astype(float) for d in (columns, rows)]
    except (RuntimeError, AttributeError, TypeError, ValueError):
        return None
    steps = [(axis[-1] - axis[0]) / max(len(axis) - 1, 1) for axis in axes]
    for axis, step in zip(axes, steps):
        if not step or np.abs(np.diff(axis) / step - 1).max(initial=0) > 1e-3:
            return None
    return axes[0][0] - steps[0] / 2, steps[0], 0, axes[1][0] - steps[1] / 2, 0, steps[1]


def in_unit_of(reference, place, dimensions):
    """A geotransform in the unit of its reference system. GDAL takes the numbers of the coordinate variables as they
    are, and the system of crs_wkt or spatial_ref, whose unit may be another: x and y in km, the system in metres. The
    steps are compared, so that a version of GDAL that converts them is right, too."""
    if reference is None or not reference.IsProjected():
        return place
    out = list(place)
    for k, dimension in enumerate(dimensions):
        variable = dimension.GetIndexingVariable()
        unit = METRES.get(variable.GetUnit().strip().lower()) if variable is not None else None
        if unit is None or len(axis := variable.ReadAsArray().astype(float)) < 2 or not place[1 + 4 * k]:
            continue
        step = (axis[-1] - axis[0]) / (len(axis) - 1)
        factor = abs(unit * step / (reference.GetLinearUnits() * place[1 + 4 * k]))
        if step and abs(factor - 1) > 1e-2:
            out[3 * k:3 * k + 3] = [factor * x for x in place[3 * k:3 * k + 3]]
    return tuple(out)


def in_memory():
    """An empty data set of vectors."""
    return (gdal.GetDriverByName("Memory") or gdal.GetDriverByName("MEM")).Create("", 0, 0, 0, gdal.GDT_Unknown)


def inside(footprint, shape):
    """Which pixels have their centre in the polygon, given in columns and rows."""
    image = gdal.GetDriverByName("MEM").Create("", shape[1], shape[0], 1, gdal.GDT_Byte)
    memory = in_memory()
    layer = memory.CreateLayer("footprint")
    feature = ogr.Feature(layer.GetLayerDefn())
    feature.SetGeometry(ogr.CreateGeometryFromWkb(wkb.dumps(Polygon(footprint))))
    layer.CreateFeature(feature)
    quietly(gdal.RasterizeLayer, image, [1], layer, burn_values=[1])
    return image.ReadAsArray() != 0


def from_array(path, how):
    refuse_unused(path, how, ("layer", "where", "band", "nodata"), "an image of numpy")
    try:
        labels = np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise RunError(path, f"is not an array of numpy ({first_line(error)})", "write it with numpy.save") from None
    if labels.ndim != 2 or labels.dtype.kind not in "biuf" or not labels.size:
        raise RunError(path, f"has the shape {labels.shape} and the type {labels.dtype}",
                       "save one label a pixel: rows, from the north, by columns")
    return of_labels(Map(path, None, []), labels, finite(labels), np.isin(labels, how.water), None, how)


def finite(labels):
    return np.isfinite(labels) if labels.dtype.kind == "f" else np.ones(labels.shape, bool)


def from_image(path, source, how, name=None):
    refuse_unused(path, how, ("where",), "an image")
    place = place_of(path, source, name)
    if source.GetDriver().ShortName == "netCDF" and source.GetGeoTransform(can_return_null=True) is None:
        source = as_stored(source)
    bands = source.RasterCount
    if how.band is None and bands != 1 or not 1 <= (how.band or 1) <= bands:
        raise RunError(path, f"has {bands} bands, as pictures do; labels are one number a pixel",
                       "choose it with --band, or classify the image first")
    if source.RasterXSize * source.RasterYSize > MAX_PIXELS:
        raise RunError(path, f"has more than {MAX_PIXELS} pixels", "cut it, or make it coarser (gdal_translate)")
    band = source.GetRasterBand(how.band or 1)
    try:
        labels, nodata = band.ReadAsArray(), band.GetNoDataValue()
    except RuntimeError as error:
        raise RunError(path, f"cannot be read ({first_line(error)})", "get it anew") from None
    if nodata is None and how.nodata is not None:
        raise RunError(path, "has no nodata value", "leave --nodata out")
    if nodata is not None and nodata in how.water and nodata not in how.unseen and how.nodata is None:
        raise RunError(path, f"has {nodata:g} both for nodata and for water (--water)",
                       "say which it is: --nodata water, or --nodata unseen")
    packing = band.GetScale() or 1.0, band.GetOffset() or 0.0
    if packing != (1.0, 0.0):
        raise RunError(path, "holds packed numbers (scale {:g}, offset {:g}), not labels".format(*packing),
                       "classify the image first")
    empty = np.zeros(labels.shape, bool)
    if nodata is not None:
        empty = np.isnan(labels) if np.isnan(nodata) else labels == nodata
    valid = finite(labels) | empty if how.nodata == "water" else finite(labels) & ~empty
    flags = band.GetMaskFlags()
    if not flags & (gdal.GMF_ALL_VALID | gdal.GMF_NODATA):
        valid &= band.GetMaskBand().ReadAsArray() != 0
    if source.GetGCPCount() and place is None:
        raise RunError(path, "is placed by control points", "warp it first: gdalwarp -r near")
    reference = source.GetSpatialRef()
    found = Map(path, reference.ExportToWkt() if reference else None, [], about=about_of(path, source),
                chart=chart_of(band))
    water = empty | np.isin(labels, how.water)
    return of_labels(found, labels, valid, water, place, how)


def chart_of(band):
    """Attributes of a grid [CF] that tell of ice concentration."""
    said = {"units": band.GetUnitType(), **band.GetMetadata()}
    return [f"{key} {said[key]}" for key, words in (("standard_name", ("fraction", "concentration")),
                                                    ("long_name", ("fraction", "concentration")),
                                                    ("units", ("%", "percent")))
            if any(word in said.get(key, "").lower() for word in words)]


def of_labels(found, labels, valid, water, place, how):
    """The map of an image. valid: pixels that were observed; water: pixels without ice, including those without a label
    (nodata of NaN). place: GDAL's geotransform, from column and row to coordinates, or None."""
    if how.unseen:
        valid = valid & ~np.isin(labels, how.unseen)
    if how.footprint:
        valid = valid & inside(how.footprint, labels.shape)
    if not valid.any():
        raise RunError(found.path, "has no pixel that was seen", "see --unseen, --footprint, and the image's nodata")
    ice = valid & ~water
    some = labels[ice]
    if labels.dtype.kind == "f" and np.any(some != np.rint(some)):
        raise RunError(found.path, "has values that are not labels (whole numbers)", "classify the image first")
    if some.size and some.min() < 0:
        raise RunError(found.path, f"has the label {some.min():.0f}, which programs that group pixels give to pixels "
                       "outside floes", f"say which labels are not ice: --water {some.min():.0f}, or with 0 among "
                       f"them: --water 0,{some.min():.0f}")
    if place is None and how.pixel is None:
        raise RunError(found.path, "gives neither its place nor its scale (no geotransform, no world file)",
                       "give the size of a pixel in metres with --pixel, or a world file beside it")
    if place is not None and how.pixel is not None:
        raise RunError(found.path, "has a scale of its own", "leave --pixel out")
    if place is None:
        rows, columns = labels.shape
        place = (-how.pixel * columns / 2, how.pixel, 0, how.pixel * rows / 2, 0, -how.pixel)
        found.crs = local_crs()
    thick = thickness_by_value(found.path, how.thickness)
    values, label_of = numbered(labels, ice)
    edge = unary_union([p for p, _ in regions(valid.astype(np.int32), valid)])
    touches = prep(edge.boundary).intersects
    for polygon, number in regions(values, ice):
        value = label_of(number)
        name = f"label {value} at column {polygon.exterior.coords[0][0]:.0f}, row {polygon.exterior.coords[0][1]:.0f}"
        shore, is_straight = shore_of(polygon, how)
        found.shapes.append(Shape(name, placed(shore, place), thick.get(value), touches(polygon),
                                  placed(Polygon(polygon.exterior), place), is_straight))
    if not found.shapes:
        raise RunError(found.path, "holds no label of ice", f"say which values are water: --water (now {how.water})")
    found.seen, found.pixels = placed(edge, place), int(valid.sum())
    return found


def numbered(labels, ice):
    """(labels that fit in 32 bits, function that recovers the original label): GDAL polygonizes no larger ones."""
    if labels[ice].max(initial=0) < 2 ** 31:
        return np.where(ice, labels, 0).astype(np.int32), int
    kept, places = np.unique(labels[ice], return_inverse=True)
    values = np.zeros(labels.shape, np.int32)
    values[ice] = places
    return values, lambda number: int(kept[number])


def thickness_by_value(path, text):
    pairs = [pair.split("=") for pair in (text or "").split(",") if pair]
    try:
        out = {int(value): metres_of(metres) for value, metres in pairs}
    except ValueError:
        out = {0: None}
    if None in out.values():
        raise RunError(path, f"--thickness {text} is not a list VALUE=M,... of thicknesses in metres, "
                       f"from {thickness_range()}", "write for example 1=0.5,2=1.2")
    return out


def regions(values, mask):
    """[(Polygon in columns and rows, value)] for connected pixels of equal value."""
    rows, columns = values.shape
    image = gdal.GetDriverByName("MEM").Create("", columns, rows, 2, gdal.GDT_Int32)
    image.GetRasterBand(1).WriteArray(values)
    image.GetRasterBand(2).WriteArray(mask.astype(np.int32))
    memory = in_memory()
    layer = memory.CreateLayer("regions")
    layer.CreateField(ogr.FieldDefn("value", ogr.OFTInteger))
    gdal.Polygonize(image.GetRasterBand(1), image.GetRasterBand(2), layer, 0)
    return [(wkb.loads(bytes(f.GetGeometryRef().ExportToWkb())), f.GetField(0)) for f in layer]


def shore_of(polygon, how):
    """(a region of pixels with its final shore, whether its staircase was straightened)."""
    middles = bevelled(polygon)
    straight = map_stairs.straight(polygon) if how.stairs == "undo" else None
    if straight is not None and polygon.interiors:
        straight = Polygon(straight.exterior, middles.interiors)
        straight = straight if straight.is_valid else None
    return (middles, False) if straight is None else (straight, True)


def bevelled(polygon):
    """The polygon through the midpoints of the unit steps of its rings."""
    def ring(points):
        p = np.asarray(points)
        steps = np.abs(np.diff(p, axis=0)).sum(axis=1).astype(int)
        start, way = np.repeat(p[:-1], steps, axis=0), np.repeat(np.sign(np.diff(p, axis=0)), steps, axis=0)
        within = np.arange(steps.sum()) - np.repeat(np.cumsum(steps) - steps, steps)
        return start + way * (within[:, None] + 0.5)
    return Polygon(ring(polygon.exterior.coords), [ring(r.coords) for r in polygon.interiors])


def placed(geometry, place):
    """Convert columns and rows to the coordinates of the map."""
    x0, a, b, y0, c, d = place
    return moved(geometry, lambda p: np.c_[x0 + a * p[:, 0] + b * p[:, 1], y0 + c * p[:, 0] + d * p[:, 1]])


def moved(geometry, onto):
    """A polygon or multipolygon with the vertices [n, 2] of each ring transformed."""
    parts = [Polygon(onto(np.asarray(p.exterior.coords)), [onto(np.asarray(r.coords)) for r in p.interiors])
             for p in getattr(geometry, "geoms", [geometry])]
    return parts[0] if len(parts) == 1 else MultiPolygon(parts)
