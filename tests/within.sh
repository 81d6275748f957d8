#!/bin/bash
# SPDX-License-Identifier: MIT
# A command in a Debian root, in a mount namespace that ends with it: tests/within.sh ROOT COMMAND...  (as root)
# shellcheck disable=SC2016
exec unshare -m bash -c 'root=$1 && shift && mkdir -p "$root"/{proc,dev,sys} && mount --rbind /dev "$root/dev" &&
  mount --rbind /sys "$root/sys" && mount -t proc proc "$root/proc" &&
  cp /etc/resolv.conf /etc/hosts "$root/etc/" && exec chroot "$root" env -i \
  PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 CI=true \
  OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 "$@"' - "$@"
