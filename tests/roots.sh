#!/bin/bash
# SPDX-License-Identifier: MIT
# From a bare Debian, as a new user has it: make demo, then make test, each of which installs what it lacks; then the
# other compiler and the other MPI (tests/builds.sh). In a second one nothing but what the tutorials say, word by word.
#
#     tests/roots.sh [FOLDER [RELEASE...]]      as root, in roots of their own in FOLDER (6 GB a release): bookworm,
#                                               trixie
#
# A demo that takes more than 900 MB of the disk has failed, too. Needs mmdebstrap, the network, and python3-h5py. Takes
# the tree as it is committed. Ends with `N passed, N failed`.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mkdir -p "${1:-/tmp/bergtow-roots}" && cd "${1:-/tmp/bergtow-roots}" && pwd)
shift || true
[ $# -gt 0 ] || set -- bookworm trixie
command -v mmdebstrap >/dev/null || { echo "mmdebstrap is missing: apt-get install mmdebstrap"; exit 1; }

within() { "$PWD/tests/within.sh" "$@"; }

passed=0 failed=0
step() { # NAME LOG COMMAND...
  local name=$1 log=$2 began=$SECONDS
  shift 2
  if "$@" >"$log" 2>&1; then passed=$((passed + 1)) && echo "$name: $((SECONDS - began)) s"; else
    failed=$((failed + 1)) && echo "$name: failed after $((SECONDS - began)) s, see $log"; fi
}

megabytes() { du -smx "$1" | cut -f 1; }

# Whoever only wants to see the demo should not have to make room for it.
most=900
no_more_than_most() { # MEGABYTES
  echo "$1 MB, of $most at most"
  [ "$1" -le $most ]
}

# bare ROOT: Debian with make and the sources, and nothing else
bare() {
  rm -rf "$1"
  mkdir -p "$1/src"
  tar -C "$1" --exclude='./dev/*' -xf "$folder/$release.tar"
  git archive HEAD | tar -C "$1/src" -x
  within "$1" sh -c 'apt-get update && apt-get install -y --no-install-recommends make' >"$1.apt.log" 2>&1
}

others="clang libomp-dev libhdf5-openmpi-dev libhdf5-mpich-dev openmpi-bin mpich"
for release in "$@"; do
  root=$folder/$release
  rm -rf "$root.tar"
  mmdebstrap --quiet --variant=minbase "$release" "$root.tar" http://deb.debian.org/debian
  bare "$root"
  before=$(megabytes "$root")
  step "$release, make demo" "$root.demo.log" within "$root" make -C /src demo
  taken=$(($(megabytes "$root") - before))
  echo "$release: the demo has taken $taken MB of the disk"
  step "$release, size of the demo" "$root.size.log" no_more_than_most $taken
  step "$release, make test" "$root.tests.log" within "$root" make -C /src test
  grep -aE "^[0-9]+ passed, .* skipped" "$root.tests.log" || true
  echo "$release: with it $(($(megabytes "$root") - before)) MB"
  # shellcheck disable=SC2086 # one word a package
  step "$release, other MPI and compiler" "$root.apt2.log" within "$root" env DEBIAN_FRONTEND=noninteractive apt-get \
    install -y --no-install-recommends $others
  step "$release, builds" "$root.builds.log" within "$root" /src/tests/builds.sh
  bare "$root-tutorials"
  step "$release, tutorials" "$root.tutorials.log" tests/tutorial.py "$root-tutorials/src" \
    "$PWD/tests/within.sh" "$root-tutorials" sh -c 'cd /src && exec "$@"' -
done
echo "$passed passed, $failed failed"
[ $failed = 0 ]
