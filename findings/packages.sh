# shellcheck shell=sh
# SPDX-License-Identifier: MIT
# Sourced by each finding: `fetch` unpacks Debian packages into a temporary folder, `seen` compares what they print.
set -eu
export LC_ALL=C PYTHONDONTWRITEBYTECODE=1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
root=$work/root
mkdir "$root" "$work/debs"
multiarch=$(gcc -print-multiarch 2>/dev/null || echo x86_64-linux-gnu)

# fetch NAME=VERSION...: with what they need and this system lacks. Debian 12 has these versions.
fetch() {
  echo "packages: $*"
  apt-get install --simulate --reinstall --allow-downgrades --no-install-recommends "$@" >"$work/plan"
  (cd "$work/debs" && sed -n 's/^Inst \([^ ]*\) .*(\([^ ]*\) .*/\1=\2/p' "$work/plan" |
    xargs apt-get download -qq -o APT::Sandbox::User=root)
  for deb in "$work"/debs/*.deb; do dpkg-deb -x "$deb" "$root"; done
  export PATH="$root/usr/bin:$PATH" PYTHONPATH="$root/usr/lib/python3/dist-packages" \
    LD_LIBRARY_PATH="$root/usr/lib/$multiarch:$root/usr/lib"
  cd "$work"
}

# seen WHAT GUESS EXPECTED OUTPUT: fails where the output is not the expected one.
seen() {
  printf '%s\n  guess: %s\n  seen:  %s\n' "$1" "$2" "$4"
  [ "$3" = "$4" ] || { echo "  CHANGED, it was: $3"; exit 1; }
}
