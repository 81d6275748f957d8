#!/bin/sh
# SPDX-License-Identifier: MIT
# Version script of libbergtow.so: what libbergtow.a ($1) defines and a public header names, and nothing else. So the
# inside of the library stays inside, and a program that links it may have functions of the same names.
set -e
words=$(mktemp)
trap 'rm -f "$words"' EXIT
grep -oh '\bbt_[a-z0-9_]*' include/bergtow/*.h | sort -u >"$words"
echo 'BERGTOW_0 {'
echo '  global:'
nm --defined-only -g "$1" | awk 'NF == 3 {print $3}' | sort -u | comm -12 - "$words" | sed 's/.*/    &;/'
echo '  local: *;'
echo '};'
