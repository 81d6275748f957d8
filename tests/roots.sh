#!/bin/bash
# SPDX-License-Identifier: MIT
# From a bare Debian, as a new user has it: make demo, then make test, each of which installs what it lacks; then the
# other compiler and the other MPI (tests/builds.sh).
#
#     tests/roots.sh [FOLDER [RELEASE...]]      as root, in roots of their own in FOLDER (4 GB each): bookworm, trixie
#
# A demo that takes more than 900 MB of the disk has failed, too. Needs mmdebstrap and the network. Takes the tree as it
# is committed. Ends with `N passed, N failed`.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mkdir -p "${1:-/tmp/bergtow-roots}" && cd "${1:-/tmp/bergtow-roots}" && pwd)
shift || true
[ $# -gt 0 ] || set -- bookworm trixie
command -v mmdebstrap >/dev/null || { echo "mmdebstrap is missing: apt-get install mmdebstrap"; exit 1; }

# within ROOT COMMAND...: in a mount namespace that ends with the command
within() {
  # shellcheck disable=SC2016
  unshare -m bash -c 'root=$1 && shift && mkdir -p "$root"/{proc,dev,sys} && mount --rbind /dev "$root/dev" &&
    mount --rbind /sys "$root/sys" && mount -t proc proc "$root/proc" &&
    cp /etc/resolv.conf /etc/hosts "$root/etc/" && exec chroot "$root" env -i \
    PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 CI=true \
    OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 "$@"' - "$@"
}

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

others="clang libomp-dev libhdf5-openmpi-dev libhdf5-mpich-dev openmpi-bin mpich"
for release in "$@"; do
  root=$folder/$release
  rm -rf "$root" "$root.tar"
  mmdebstrap --quiet --variant=minbase "$release" "$root.tar" http://deb.debian.org/debian
  mkdir -p "$root/src"
  tar -C "$root" --exclude='./dev/*' -xf "$root.tar"
  git archive HEAD | tar -C "$root/src" -x
  within "$root" sh -c 'apt-get update && apt-get install -y --no-install-recommends make' >"$root.apt.log" 2>&1
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
done
echo "$passed passed, $failed failed"
[ $failed = 0 ]
