#!/bin/sh
# SPDX-License-Identifier: MIT
# Bytes behind the end of an HDF5 file, as a checksum or signature that another program appends: a reader leaves them
# alone, and an open for appending that writes nothing removes them.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch python3-h5py-serial=3.7.0-8 python3-h5py=3.7.0-8 libhdf5-103-1=1.10.8+repack1-1

/usr/bin/python3 - >said <<'PY'
import os
import h5py
with h5py.File("x.h5", "w") as f:
    f["force"] = [5.0, 6.0, 7.0]
own = os.path.getsize("x.h5")
with open("x.h5", "ab") as f:
    f.write(b"appended by another program".ljust(128, b"\0"))
for mode in "r", "r+":
    with h5py.File("x.h5", mode) as f:
        assert list(f["force"]) == [5.0, 6.0, 7.0]
    print(os.path.getsize("x.h5") - own, "bytes behind it")
PY
seen "128 bytes appended, opened with r" "128 bytes behind it" "128 bytes behind it" "$(sed -n 1p said)"
seen "opened with r+, closed without a change" "128 bytes behind it" "0 bytes behind it" "$(sed -n 2p said)"
