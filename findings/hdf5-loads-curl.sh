#!/bin/sh
# SPDX-License-Identifier: MIT
# The HDF5 library of Debian 12 can read from object storage. So each program that only writes a local file also loads
# an HTTP client with Kerberos, LDAP and two TLS libraries: a cost at each start of a program that runs by the thousand.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch libhdf5-103-1=1.10.8+repack1-1

/usr/bin/python3 - >said <<'PY'
import ctypes
def loaded():
    with open("/proc/self/maps") as f:
        return {line.split("/")[-1].split(".so")[0] for line in f if ".so" in line}
before = loaded()
hdf5 = ctypes.CDLL("libhdf5_serial.so.103")
assert hdf5.H5open() == 0
hdf5.H5Fcreate.restype = ctypes.c_int64
file = hdf5.H5Fcreate(b"local.h5", 2, ctypes.c_int64(0), ctypes.c_int64(0))
assert file >= 0 and hdf5.H5Fclose(ctypes.c_int64(file)) >= 0
new = loaded() - before
print("more than 30" if len(new) > 30 else len(new))
wanted = ("libcurl", "libldap", "libgssapi", "libssl", "libgnutls")
print(*sorted(name.split("-")[0].split("_")[0] for name in new if name.startswith(wanted)))
PY
seen "libraries that a process loads to write a local HDF5 file" "4 (hdf5, z, sz, aec)" "more than 30" \
  "$(sed -n 1p said)"
seen "of these, for the network" "none" "libcurl libgnutls libgssapi libldap libssl" "$(sed -n 2p said)"
