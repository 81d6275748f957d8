#!/bin/sh
# SPDX-License-Identifier: MIT
# House rules that a machine can check: names of external symbols, licence lines, Python syntax.
bad=0
complain() { echo "lint: $*"; bad=1; }

lib=build/release/libbergtow.a
[ -f $lib ] || { echo "lint: $lib is missing; run make first"; exit 1; }
others=$(nm --defined-only -g $lib | awk 'NF == 3 && $3 !~ /^bt_/ {print $3}' | sort -u)
[ -z "$others" ] || complain "external symbols without the prefix bt_:" $others

for f in $(git ls-files '*.c' '*.h' '*.py' '*.sh' Makefile .ci/run); do
    head -3 "$f" | grep -q 'SPDX-License-Identifier: MIT' || complain "$f: no SPDX line among the first three"
done
for f in $(git ls-files '*.h'); do
    grep -q '^#ifndef \(BERGTOW\|BT\)_.*_H$' "$f" || complain "$f: no include guard BERGTOW_..._H or BT_..._H"
done
for f in $(git ls-files '*.py'); do
    "${PYTHON:-/usr/bin/python3}" -c "import ast, sys; ast.parse(open(sys.argv[1]).read(), sys.argv[1])" "$f" || complain "$f: not Python"
done
exit $bad
