#!/bin/sh
# SPDX-License-Identifier: MIT
# A layer in metres that has no coordinate system comes back from a GeoPackage of GDAL with one in degrees.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch python3-gdal=3.6.2+dfsg-1+b2 libgdal32=3.6.2+dfsg-1+b2

/usr/bin/python3 - >said <<'PY'
from osgeo import ogr
for driver, file in (("ESRI Shapefile", "floes.shp"), ("GPKG", "floes.gpkg")):
    source = ogr.GetDriverByName(driver).CreateDataSource(file)
    layer = source.CreateLayer("floes", None, ogr.wkbPoint)
    feature = ogr.Feature(layer.GetLayerDefn())
    feature.SetGeometry(ogr.CreateGeometryFromWkt("POINT (412000 8650000)"))
    layer.CreateFeature(feature)
    feature = layer = source = None
    source = ogr.Open(file)
    found = source.GetLayer(0).GetSpatialRef()
    print("no system" if found is None else f"{found.GetName()}, in {found.GetAngularUnitsName()}s"
          if found.IsGeographic() else found.GetName())
PY
seen "a shapefile of a layer without one" "no system" "no system" "$(sed -n 1p said)"
seen "a GeoPackage of it" "no system" "Undefined geographic SRS, in degrees" "$(sed -n 2p said)"
