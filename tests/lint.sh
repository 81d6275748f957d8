#!/bin/sh
# SPDX-License-Identifier: MIT
# House rules that a machine can check: names of external symbols, licence lines, include guards, layers, comments of
# public functions, their care for locale and rounding, length of lines, and what cppcheck, shellcheck, pyflakes and
# mypy find. A checker that is not installed is left out and named; where CI=true it must be there. clang-tidy takes
# minutes: make tidy.
#
# lint.sh changed: files that differ from the branch main, or from the last commit where there is none, alone; rules
# between files are held by all.
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
base=
if [ "${1:-}" = changed ]; then base=$(git merge-base main HEAD 2>/dev/null || git rev-parse HEAD); fi
listed() {
    if [ -z "$base" ]; then git ls-files --cached --others --exclude-standard "$@"
    else git diff --name-only "$base" -- "$@"; git ls-files --others --exclude-standard "$@"; fi
}
files() { listed "$@" | while read -r f; do [ -f "$f" ] && echo "$f"; done; }

for f in $(files '*.c' '*.h' '*.py' '*.sh' '*.js' '*.css' '*.html' Makefile .ci/run .clang-tidy); do
    head -3 "$f" | grep -q 'SPDX-License-Identifier: MIT' || complain "$f: no SPDX line among the first three"
done
for f in $(files '*.h'); do
    grep -q '^#ifndef \(BERGTOW\|BT\)_.*_H$' "$f" || complain "$f: no include guard BERGTOW_..._H or BT_..._H"
done
guards=$(git ls-files --cached --others --exclude-standard '*.h' | while read -r f; do
    grep -sm 1 '^#ifndef \(BERGTOW\|BT\)_.*_H$' "$f"
done)
twice=$(echo "$guards" | sort | uniq -d)
[ -z "$twice" ] || complain "include guards of two headers: $twice"
python=${PYTHON:-/usr/bin/python3}
# shellcheck disable=SC2046 # one word a file
"$python" -c "import ast, sys
for f in sys.argv[1:]: ast.parse(open(f).read(), f)" $(files '*.py') || complain "not Python: see above"
"$python" tests/layers.py || complain "layers: see above; docs/architecture.md says what may call what"
"$python" tests/documented.py include/bergtow/*.h || complain "public headers: see above"
"$python" tests/plain_numbers.py || complain "numbers: see above"
"$python" tests/mutants.py || complain "mutants: their texts have to follow the sources"
# shellcheck disable=SC2046 # one word a file
"$python" tests/columns.py $(files '*.c' '*.h' '*.py' '*.md' \
    '*.sh' '*.js' '*.css' '*.html' '*.yml' '*.supp' \
    Makefile .ci/run .clang-tidy) ||
    complain "lines of more than 120 characters: see above"
"$python" tests/prose.py || complain "phrases that make a reader stumble: see above"
later=$(git grep -nwE 'TO''DO|FIX''ME' -- ':!*.md') && complain "something is left for later: $later"

# A checker is called where there is a file for it.
scripts=$(files '*.sh' .ci/run) modules=$(files '*.py') package=$(files 'postproc/bergtow/*.py')
sources=$(files 'src/*.c' 'partition/*.c')
# shellcheck disable=SC2086 # one word a file
if [ -n "$scripts" ] && have shellcheck; then
    shellcheck -x --source-path=SCRIPTDIR $scripts || complain "shellcheck: see above"
fi
# shellcheck disable=SC2086
if [ -n "$modules" ] && have pyflakes3; then pyflakes3 $modules || complain "pyflakes: see above"; fi
# What a program imports; the modules behind the commands are not annotated throughout.
if [ -n "$package" ] && have mypy; then
    # shellcheck disable=SC2046 # one word a file
    mypy --no-error-summary --cache-dir=/dev/null --ignore-missing-imports --follow-imports=skip \
        --disallow-untyped-defs --check-untyped-defs $(printf 'postproc/bergtow/%s.py ' __init__ _calls _interrupts \
        _library _program case errors force functions simulation result/dataset study/ensemble study/workers) ||
        complain "mypy: see above"
fi
# shellcheck disable=SC2086
if [ -n "$sources" ] && have cppcheck; then
    cppcheck --enable=warning,performance,portability --std=c11 --quiet --error-exitcode=1 -j "${J:-2}" \
        --suppressions-list=tests/cppcheck.supp --suppress=missingIncludeSystem \
        -Iinclude -Isrc -I. -D_GNU_SOURCE '-DBT_REVISION=""' '-DBT_COMPILER=""' '-DBT_FLAGS=""' \
        --template='{file}:{line}: {id}: {message}' $sources || complain "cppcheck: see above"
fi
exit $bad
