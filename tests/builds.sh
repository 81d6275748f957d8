#!/bin/bash
# SPDX-License-Identifier: MIT
# gcc and clang, each with Open MPI and MPICH, gcc on the HDF5 without MPI, clang on that of its MPI: unit tests, the
# demo's basin on one rank, and on two, resumed on more ranks than there are cores, and then alone; with the same hash
# of the state throughout.
#
#     tests/builds.sh [FOLDER]      FOLDER takes 400 MB; tests/roots.sh calls it in Debian 12 and 13
#
# Needs what make test does, and what the message below names. Ends with `N passed, N failed`.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mkdir -p "${1:-/tmp/bergtow-builds}" && cd "${1:-/tmp/bergtow-builds}" && pwd)
needed="gcc clang libomp-dev libcmocka-dev libhdf5-dev libhdf5-openmpi-dev openmpi-bin libhdf5-mpich-dev mpich"
for tool in gcc clang mpicc.openmpi mpicc.mpich mpirun.mpich; do
  command -v $tool >/dev/null || { echo "$tool is missing: apt-get install $needed"; exit 1; }
done

passed=0 failed=0
count() { # NAME COMMAND...
  local name=$1
  shift
  if "$@" >>"$log" 2>&1; then passed=$((passed + 1)); else
    failed=$((failed + 1)) && echo "$name: failed, see $log"; fi
}
first=
same() { # NAME FOLDER
  local hash
  hash=$(sed -n 's/.*"state_hash": "\(.*\)".*/\1/p' "$2/summary.json")
  first=${first:-$hash}
  if [ -n "$hash" ] && [ "$hash" = "$first" ]; then passed=$((passed + 1)); else
    failed=$((failed + 1)) && echo "$1: state hash $hash, not $first"; fi
}

case=cases/basin/basin-80.yml
cores=$(nproc) # which follows OMP_NUM_THREADS
export OMP_NUM_THREADS=1 GOMP_SPINCOUNT=5000 # as tests/run.sh has it
for cc in gcc clang; do
  for mpi in openmpi mpich; do
    name=$cc-$mpi build=$folder/$cc-$mpi log=$folder/$cc-$mpi.log
    hdf5="hdf5-serial"
    [ $cc = gcc ] || hdf5="hdf5-$mpi"
    flags=(-s "CC=$cc" "MPICC=mpicc.$mpi" "HDF5=$hdf5" "BUILD=$build")
    MPIRUN=mpirun.mpich # for the unit tests, too
    [ $mpi = mpich ] || MPIRUN="mpirun.openmpi --oversubscribe"
    export MPIRUN
    : >"$log"
    make "${flags[@]}" -j"$cores" all tests >>"$log" 2>&1 || { failed=$((failed + 1)) && echo "$name: no build" &&
      continue; }
    "$build/bergtow" --version
    for test in "$build"/tests/{unit,physics}/test_*; do
      [ ! -x "$test" ] || count "$name, ${test##*/}" "$test"
    done
    run=$folder/run
    count "$name, run" "$build/bergtow" run $case --steps 200 -o "$run" --force --quiet
    same "$name" "$run"
    # shellcheck disable=SC2086 # one word an option
    count "$name, ranks" $MPIRUN -n 2 "$build/bergtow" run $case --steps 100 -o "$run" --force --quiet
    # shellcheck disable=SC2086
    count "$name, more ranks than cores" $MPIRUN -n $((cores + 3)) "$build/bergtow" resume "$run" --steps 10 --quiet
    count "$name, resume" "$build/bergtow" resume "$run" --steps 90 --quiet
    same "$name, resumed" "$run"
  done
done
echo "state hash $first"
echo "$passed passed, $failed failed"
[ $failed = 0 ]
