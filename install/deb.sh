#!/bin/sh
# SPDX-License-Identifier: MIT
# Debian packages of the tree as it is committed, with its source package: build/deb/*.deb, *.dsc.
#
#     install/deb.sh VERSION
set -e
version=$1
for tool in dpkg-buildpackage dh fakeroot; do
    command -v $tool >/dev/null || { echo "$tool is missing: apt-get install dpkg-dev debhelper fakeroot" >&2; exit 1; }
done
place=build/deb/bergtow-$version
rm -rf "$place"
mkdir -p "$place"
if git rev-parse --is-inside-work-tree >/dev/null 2>&1; then git archive HEAD
else tar -c --exclude=./build --exclude=./out .
fi | tar -C "$place" -x
cp -r "$place/install/debian" "$place/debian"
when=$(git log -1 --format=%aD 2>/dev/null || date -R)
cat >"$place/debian/changelog" <<END
bergtow ($version) unstable; urgency=medium

  * Made by make deb; what changed is in CHANGELOG.md.

 -- The bergtow authors <maintainers@users.noreply.h-seed-e8ccddb2.example>  $when
END
(cd "$place" && dpkg-buildpackage -us -uc -F)
ls build/deb/*.deb build/deb/*.dsc
