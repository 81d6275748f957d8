#!/bin/bash
# SPDX-License-Identifier: MIT
# From a bare Debian, as a new user has it: make demo, everything built with -Werror, the C tests, two ranks.
#
#     tests/roots.sh [FOLDER [RELEASE...]]      as root, in roots of their own in FOLDER (2 GB each): bookworm, trixie
#
# Needs mmdebstrap and the network. Takes the tree as it is committed. Ends with `N passed, N failed`.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mkdir -p "${1:-/tmp/bergtow-roots}" && cd "${1:-/tmp/bergtow-roots}" && pwd)
shift || true
[ $# -gt 0 ] || set -- bookworm trixie
command -v mmdebstrap >/dev/null || { echo "mmdebstrap is missing: apt-get install mmdebstrap"; exit 1; }

# within ROOT COMMAND...: in a mount namespace that ends with the command
within() {
  # shellcheck disable=SC2016
  unshare -m bash -c 'root=$1 && shift && mkdir -p "$root"/{proc,dev} && mount --rbind /dev "$root/dev" &&
    mount -t proc proc "$root/proc" && cp /etc/resolv.conf "$root/etc/" && exec chroot "$root" env -i \
    PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 CI=true \
    OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 "$@"' - "$@"
}

passed=0 failed=0
step() { # NAME LOG COMMAND...
  local name=$1 log=$2 began=$SECONDS
  shift 2
  if "$@" >"$log" 2>&1; then passed=$((passed + 1)) && echo "$name: $((SECONDS - began)) s"; else
    failed=$((failed + 1)) && echo "$name: failed, see $log"; fi
}

megabytes() { du -smx "$1" | cut -f 1; }

# shellcheck disable=SC2016  # the variables are those of the shell in the root
tests='cd /src && make -j2 all tests && failed=0
for t in $(find build/release/tests/unit build/release/tests/physics -name "test_*" -executable) \
    build/release/tests/fuzz/test_corpus; do timeout 1200 $t || { echo "FAILED $t, code $?"; failed=1; }; done
state() { sed -n "s/.*state_hash\": \"\(.*\)\".*/\1/p" /out/summary.json; }
run="build/release/bergtow run cases/basin/basin-50.yml --steps 60 -o /out --force --quiet"
$run && one=$(state) && mpirun --oversubscribe -n 2 $run && echo "states $one $(state)" && [ "$one" = "$(state)" ] &&
[ $failed = 0 ]'

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
  echo "$release: the demo has taken $(($(megabytes "$root") - before)) MB of the disk"
  within "$root" sh -c 'apt-get install -y --no-install-recommends libopenmpi-dev libcmocka-dev' >"$root.apt.log" 2>&1
  step "$release, C tests" "$root.tests.log" within "$root" bash -c "$tests"
done
echo "$passed passed, $failed failed"
[ $failed = 0 ]
