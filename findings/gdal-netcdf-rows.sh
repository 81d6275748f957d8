#!/bin/sh
# SPDX-License-Identifier: MIT
# A grid of floe labels in a netCDF file without georeference: the netCDF driver of GDAL gives its rows in reverse, the
# HDF5 driver the rows of the file.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch python3-gdal=3.6.2+dfsg-1+b2 libgdal32=3.6.2+dfsg-1+b2 python3-netcdf4=1.6.2-1+b1

/usr/bin/python3 - >said <<'PY'
import netCDF4
from osgeo import gdal
gdal.UseExceptions()
with netCDF4.Dataset("labels.nc", "w") as f:
    f.createDimension("row", 3)
    f.createDimension("column", 2)
    f.createVariable("labels", "i4", ("row", "column"))[:] = [[1, 1], [2, 2], [3, 3]]
for name in 'NETCDF:"labels.nc":labels', 'HDF5:"labels.nc"://labels':
    print("rows", *gdal.Open(name).ReadAsArray()[:, 0])
PY
seen "rows 1, 2, 3 through the netCDF driver" "rows 1 2 3" "rows 3 2 1" "$(sed -n 1p said)"
seen "the same file through the HDF5 driver" "rows 1 2 3" "rows 1 2 3" "$(sed -n 2p said)"
