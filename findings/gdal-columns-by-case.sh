#!/bin/sh
# SPDX-License-Identifier: MIT
# Of two columns whose names differ only in case, the calls of one GDAL feature in Python read different ones by the
# same name: GetField the column so named, GetFieldAsDouble and IsFieldSetAndNotNull the first of the two.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch python3-gdal=3.6.2+dfsg-1+b2 libgdal32=3.6.2+dfsg-1+b2

cat >floes.geojson <<'JSON'
{"type": "FeatureCollection", "features": [
  {"type": "Feature", "properties": {"Thickness": null, "thickness": 2.0},
   "geometry": {"type": "Point", "coordinates": [18.3, 76.2]}},
  {"type": "Feature", "properties": {"Thickness": 3.0, "thickness": 1.5},
   "geometry": {"type": "Point", "coordinates": [18.4, 76.2]}}]}
JSON
/usr/bin/python3 - >said <<'PY'
from osgeo import ogr
source = ogr.Open("floes.geojson")
for feature in source.GetLayer(0):
    print(feature.GetField("thickness"), feature.GetFieldAsDouble("thickness"),
          feature.IsFieldSetAndNotNull("thickness"))
PY
seen "thickness 2 beside an empty Thickness: GetField, GetFieldAsDouble, IsFieldSetAndNotNull" "2.0 2.0 True" \
  "2.0 0.0 False" "$(sed -n 1p said)"
seen "thickness 1.5 beside Thickness 3" "1.5 1.5 True" "1.5 3.0 True" "$(sed -n 2p said)"
