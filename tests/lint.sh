#!/bin/sh
# SPDX-License-Identifier: MIT
# House rules that a machine can check: names of external symbols, licence lines, include guards, layers, comments of
# public functions, length of lines, and what cppcheck, shellcheck, pyflakes and mypy find. A checker that is not
# installed is left out and named; where CI=true it must be there. clang-tidy takes minutes: make tidy.
bad=0
complain() { echo "lint: $*"; bad=1; }
have() {
    command -v "$1" >/dev/null && return 0
    if [ "${CI:-}" = true ]; then complain "$1 is missing; run: make deps-lint"
    else echo "lint: $1 is not installed, and what it checks is left out (make deps-lint)"; fi
    return 1
}

lib=build/release/libbergtow.a
[ -f $lib ] || { echo "lint: $lib is missing; run make first"; exit 1; }
others=$(nm --defined-only -g $lib | awk 'NF == 3 && $3 !~ /^bt_/ {print $3}' | sort -u)
[ -z "$others" ] || complain "external symbols without the prefix bt_: $others"

# A library does not end the program. Two exceptions, which bergtow/simulation.h names: memory, and MPI.
ends=$(nm -A -u $lib 2>/dev/null | sed -n 's/^[^:]*:\([^:]*\): *U \(exit\|_exit\|_Exit\|quick_exit\|abort\)$/\1 \2/p' |
    grep -vx 'base.o _Exit\|comm.o _Exit')
[ -z "$ends" ] || complain "the library ends the program: $ends"

# Names without blanks; what is new and not yet in git is looked at, too.
files() { git ls-files --cached --others --exclude-standard "$@" | while read -r f; do [ -f "$f" ] && echo "$f"; done; }

for f in $(files '*.c' '*.h' '*.py' '*.sh' '*.js' '*.css' '*.html' Makefile .ci/run .clang-tidy); do
    head -3 "$f" | grep -q 'SPDX-License-Identifier: MIT' || complain "$f: no SPDX line among the first three"
done
for f in $(files '*.h'); do
    grep -q '^#ifndef \(BERGTOW\|BT\)_.*_H$' "$f" || complain "$f: no include guard BERGTOW_..._H or BT_..._H"
done
twice=$(files '*.h' | while read -r f; do grep -m 1 '^#ifndef \(BERGTOW\|BT\)_.*_H$' "$f"; done | sort | uniq -d)
[ -z "$twice" ] || complain "include guards of two headers: $twice"
python=${PYTHON:-/usr/bin/python3}
for f in $(files '*.py'); do
    "$python" -c "import ast, sys; ast.parse(open(sys.argv[1]).read(), sys.argv[1])" "$f" || complain "$f: not Python"
done
"$python" tests/layers.py || complain "layers: see above; docs/architecture.md says what may call what"
"$python" tests/documented.py include/bergtow/*.h || complain "public headers: see above"
"$python" tests/mutants.py || complain "mutants: their texts have to follow the sources"
# shellcheck disable=SC2046 # one word a file
"$python" tests/columns.py $(files '*.c' '*.h' '*.py' '*.md' \
    '*.sh' '*.js' '*.css' '*.html' '*.yml' '*.supp' \
    Makefile .ci/run .clang-tidy) ||
    complain "lines of more than 120 characters: see above"
later=$(git grep -nwE 'TO''DO|FIX''ME' -- ':!*.md') && complain "something is left for later: $later"

# shellcheck disable=SC2046 # one word a file
if have shellcheck; then
    shellcheck -x --source-path=SCRIPTDIR $(files '*.sh' .ci/run) || complain "shellcheck: see above"
fi
# shellcheck disable=SC2046
if have pyflakes3; then pyflakes3 $(files '*.py') || complain "pyflakes: see above"; fi
# What a program imports; the modules behind the commands are not annotated throughout.
if have mypy; then
    # shellcheck disable=SC2046 # one word a file
    mypy --no-error-summary --cache-dir=/dev/null --ignore-missing-imports --follow-imports=skip \
        --disallow-untyped-defs --check-untyped-defs $(printf 'postproc/bergtow/%s.py ' __init__ _calls _interrupts \
        _library _program case errors force functions simulation result/dataset study/ensemble study/workers) ||
        complain "mypy: see above"
fi
if have cppcheck; then
    cppcheck --enable=warning,performance,portability --std=c11 --quiet --error-exitcode=1 -j "${J:-2}" \
        --suppressions-list=tests/cppcheck.supp --suppress=missingIncludeSystem \
        -Iinclude -Isrc -I. -D_GNU_SOURCE '-DBT_REVISION=""' '-DBT_COMPILER=""' '-DBT_FLAGS=""' \
        --template='{file}:{line}: {id}: {message}' src partition || complain "cppcheck: see above"
fi
exit $bad
