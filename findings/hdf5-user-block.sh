#!/bin/sh
# SPDX-License-Identifier: MIT
# A valid netCDF-4 file behind a user block of 512 bytes, where HDF5 looks for its signature too: the netCDF library
# opens it; xarray finds no engine for it until one is named; CDO calls it unsupported.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch netcdf-bin=1:4.9.0-3+b1 cdo=2.1.1-1+deb12u1 python3-xarray=2023.01.0-1.1 python3-netcdf4=1.6.2-1+b1 \
  python3-h5netcdf=1.1.0-1 python3-h5py=3.7.0-8

/usr/bin/python3 - <<'PY'
import h5py
for name, size in (("plain", 0), ("behind", 512)):
    with h5py.File(f"{name}.nc", "w", userblock_size=size) as f:
        f["time"] = [0.0, 1.0, 2.0]
        f["time"].make_scale("time")
        f["force"] = [5.0, 6.0, 7.0]
        f["force"].dims[0].attach_scale(f["time"])
PY
code() { rc=0; "$@" >said 2>&1 || rc=$?; echo "exit code $rc"; }
opened() {
  /usr/bin/python3 -c 'import sys, xarray
try:
    print(dict(xarray.open_dataset(sys.argv[1], engine=sys.argv[2] or None).sizes))
except ValueError as error:
    print(str(error)[:24])' "$@"
}
seen "ncdump -h of both" "both open" "exit code 0, exit code 0" \
  "$(code ncdump -h plain.nc), $(code ncdump -h behind.nc)"
seen "xarray without a user block" "{'time': 3}" "{'time': 3}" "$(opened plain.nc '')"
seen "xarray behind one" "{'time': 3}" "did not find a match in " "$(opened behind.nc '')"
seen "the same with engine='netcdf4'" "{'time': 3}" "{'time': 3}" "$(opened behind.nc netcdf4)"
seen "cdo showname without a user block" "exit code 0" "exit code 0" "$(code cdo -s showname plain.nc)"
seen "cdo showname behind one" "exit code 0" "exit code 1, Unsupported file type" \
  "$(code cdo -s showname behind.nc), $(grep -o 'Unsupported file type' said)"
