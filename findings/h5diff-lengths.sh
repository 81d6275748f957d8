#!/bin/sh
# SPDX-License-Identifier: MIT
# h5diff ends with 0 for datasets of different lengths, as for equal ones; with -q it says nothing either.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch hdf5-tools=1.10.8+repack1-1 python3-h5py=3.7.0-8

/usr/bin/python3 - <<'PY'
import h5py
for name, count in (("ten", 10), ("twelve", 12)):
    with h5py.File(f"{name}.h5", "w") as f:
        f["x"] = [float(k) for k in range(count)]
with h5py.File("other.h5", "w") as f:
    f["x"] = [float(k) for k in range(9)] + [0.0]
PY
code() { rc=0; "$@" >said || rc=$?; echo "exit code $rc, $(wc -l <said) lines"; }
seen "h5diff -q, ten values and ten of which one differs" "exit code 1" "exit code 1, 0 lines" \
  "$(code h5diff -q ten.h5 other.h5)"
seen "h5diff -q, ten values and the same ten with two more" "exit code 1" "exit code 0, 0 lines" \
  "$(code h5diff -q ten.h5 twelve.h5)"
seen "the same without -q" "exit code 1" "exit code 0, Some objects are not comparable" \
  "$(rc=0; h5diff ten.h5 twelve.h5 >said || rc=$?; echo "exit code $rc, $(grep comparable said)")"
