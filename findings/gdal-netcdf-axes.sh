#!/bin/sh
# SPDX-License-Identifier: MIT
# CF lets a variable have its dimensions in any order: coordinate variables name the axes. Of a grid stored as (x, y),
# with attributes axis, standard_name and units on both, the netCDF driver of GDAL takes y for easting and x for
# northing. The exception mode of Python does not stop it: it prints a warning and gives a geotransform.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch python3-gdal=3.6.2+dfsg-1+b2 libgdal32=3.6.2+dfsg-1+b2 python3-netcdf4=1.6.2-1+b1

/usr/bin/python3 - >said 2>/dev/null <<'PY'
import netCDF4
from osgeo import gdal
gdal.UseExceptions()
for dimensions in ("y", "x"), ("x", "y"):
    with netCDF4.Dataset("".join(dimensions) + ".nc", "w") as f:
        f.Conventions = "CF-1.8"
        for name, values in ("x", [100, 200, 300]), ("y", [5000, 6000]):
            f.createDimension(name, len(values))
            axis = f.createVariable(name, "f8", (name,))
            axis.setncatts({"standard_name": f"projection_{name}_coordinate", "axis": name.upper(), "units": "m"})
            axis[:] = values
        crs = f.createVariable("crs", "i4")
        crs.setncatts({"grid_mapping_name": "polar_stereographic", "latitude_of_projection_origin": 90.0,
                       "straight_vertical_longitude_from_pole": -45.0, "standard_parallel": 70.0,
                       "false_easting": 0.0, "false_northing": 0.0, "semi_major_axis": 6378137.0,
                       "inverse_flattening": 298.257223563})
        ice = f.createVariable("ice", "i4", dimensions)
        ice.grid_mapping = "crs"
        ice[:] = 1
for name in "yx", "xy":
    left, step, _, top, _, down = gdal.Open(f'NETCDF:"{name}.nc":ice').GetGeoTransform()
    print(f"easting from {left:g} by {step:g}, northing from {top:g} by {down:g}")
PY
seen "a grid (y, x) with x of 100 to 300 m, y of 5000 and 6000 m" \
  "easting from 50 by 100, northing from 6500 by -1000" "easting from 50 by 100, northing from 6500 by -1000" \
  "$(sed -n 1p said)"
seen "the same grid as (x, y)" \
  "easting from 50 by 100" "easting from 4500 by 1000, northing from 50 by 100" "$(sed -n 2p said)"
