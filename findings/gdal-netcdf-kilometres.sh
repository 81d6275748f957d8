#!/bin/sh
# SPDX-License-Identifier: MIT
# CF lets x and y have units of their own, such as km. By the grid mapping's attributes alone, the netCDF driver of GDAL
# gives a reference system whose unit is the kilometre, which its geotransform has too. If the mapping also has crs_wkt,
# which CF 1.7 allows beside them and pyproj's to_cf() writes, the system is the one of that text, in metres, but the
# geotransform stays in km: the grid shrinks to a thousandth, next to the origin, which here is the pole.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch python3-gdal=3.6.2+dfsg-1+b2 libgdal32=3.6.2+dfsg-1+b2 python3-netcdf4=1.6.2-1+b1 python3-pyproj=3.4.1-1+b1

/usr/bin/python3 - >said 2>/dev/null <<'PY'
import netCDF4
import pyproj
from osgeo import gdal, osr
gdal.UseExceptions()
mapping = pyproj.CRS(3413).to_cf()
for name in "attributes", "wkt":
    with netCDF4.Dataset(name + ".nc", "w") as f:
        f.Conventions = "CF-1.8"
        for axis, values in ("x", [700, 800, 900]), ("y", [-600, -500]):
            f.createDimension(axis, len(values))
            v = f.createVariable(axis, "f8", (axis,))
            v.setncatts({"standard_name": f"projection_{axis}_coordinate", "axis": axis.upper(), "units": "km"})
            v[:] = values
        crs = f.createVariable("crs", "i4")
        crs.setncatts({k: v for k, v in mapping.items() if name == "wkt" or k != "crs_wkt"})
        ice = f.createVariable("ice", "i4", ("y", "x"))
        ice.grid_mapping = "crs"
        ice[:] = 1
    data = gdal.Open(f'NETCDF:"{name}.nc":ice')
    left, step, _, top, _, down = data.GetGeoTransform()
    system = data.GetSpatialRef()
    degrees = osr.SpatialReference()
    degrees.ImportFromEPSG(4326)
    lat = osr.CoordinateTransformation(system, degrees).TransformPoint(left + 1.5 * step, top + down)[0]
    print(f"steps of {step:g} units of {system.GetLinearUnits():g} m, centre at {lat:.2f} N")
PY
seen "a grid with steps of 100 km, units km, mapped by attributes" \
  "steps of 100 units of 1000 m, centre at 81.06 N" "steps of 100 units of 1000 m, centre at 81.06 N" \
  "$(sed -n 1p said)"
seen "the same with crs_wkt beside them" \
  "steps of 100 units of 1000 m, centre at 81.06 N" "steps of 100 units of 1 m, centre at 89.99 N" "$(sed -n 2p said)"
