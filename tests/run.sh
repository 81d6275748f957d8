#!/bin/sh
# SPDX-License-Identifier: MIT
# Runs the compiled test programs given as arguments and short runs under the sanitizers, as many side by side as there
# are cores, up to four; then the Python tests in the same way; and ends with one line of counts. A program that crashes
# or prints no count is itself a failure. A sanitizer that is not installed counts as skipped, and is named.
#
# run.sh --one DIR WHAT runs one of them, a program or a sanitizer, and leaves DIR/NAME.log and, with "passed failed
# skipped", DIR/NAME.count.

one() {
    name=${2#*/tests/}
    file=$1/$(echo "$name" | tr / -)
    start=$(date +%s)
    p=0 f=0 s=0
    case $2 in
    asan | valgrind)
        name="short runs under $2"
        corpus=
        [ "$2" != asan ] || corpus=build/asan/tests/fuzz/test_corpus
        tests/sanitize.sh "$2" short $corpus >"$file.log" 2>&1
        case $? in
        0) p=1 ;;
        77) s=1 ;;
        *) f=1 ;;
        esac ;;
    *)
        OMP_NUM_THREADS=1 timeout 900 "$2" >"$file.log" 2>&1 # one that hangs is a failure, and no end of the others
        code=$?
        p=$(sed -n 's/.*PASSED.* \([0-9][0-9]*\) test(s).*/\1/p' "$file.log" | tail -1)
        f=$(sed -n 's/^ *\([0-9][0-9]*\) FAILED TEST(S).*/\1/p' "$file.log" | tail -1)
        p=${p:-0} f=${f:-0}
        if [ $code -ne 0 ] && [ "$f" -eq 0 ]; then f=1; fi
        if [ $code -eq 0 ] && [ "$p" -eq 0 ]; then f=1; fi ;;
    esac
    # in one write, so that lines of programs side by side stay whole
    line=$(printf '%-40s %4d passed %4d failed  %3d s' "$name" "$p" "$f" $(($(date +%s) - start)))
    [ $s -eq 0 ] || line="$line
    not run: $(tail -1 "$file.log")"
    [ "$f" -eq 0 ] || line="$line
$(cat "$file.log")"
    printf '%s\n' "$line"
    echo "$p $f $s" >"$file.count"
}
if [ "$1" = --one ]; then
    one "$2" "$3"
    exit 0
fi

# Compiled tests run side by side, each on one thread unless it sets their number: teams for its small scenes only cost.
# On a busy machine threads that spin at a barrier keep the others from the core, and everything stalls; bergtow itself
# sees to this in main.c.
export GOMP_SPINCOUNT="${GOMP_SPINCOUNT:-5000}"
workers=$(nproc)
[ "$workers" -le 4 ] || workers=4
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT

# Those that take longest go first, so that none of them is left to run alone at the end.
long='/physics/\(test_tow\|test_motion\|test_resistance\)$'
{
    printf '%s\n' "$@" | grep "$long"
    printf '%s\n' valgrind asan
    printf '%s\n' "$@" | grep -v "$long"
} >"$dir/list"
xargs -n 1 -P "$workers" "$0" --one "$dir" <"$dir/list"
while read -r what; do
    count=$dir/$(echo "${what#*/tests/}" | tr / -).count
    [ -f "$count" ] || echo "0 1 0" >"$count" # one that did not come to its end
    cat "$count"
done <"$dir/list" >"$dir/counts"

# tested NAME MARKERS ARGUMENTS...: leaves NAME.log, and "passed failed skipped" in NAME.count
tested() {
    log=$dir/$1.log
    count=$dir/$1.count
    markers="not slow and $2"
    shift 2
    ${PYTHON:-/usr/bin/python3} -m pytest -q -p no:cacheprovider -rfE --durations=25 -m "$markers" "$@" >"$log" 2>&1
    code=$?
    p=$(sed -n 's/.*\b\([0-9][0-9]*\) passed.*/\1/p' "$log" | tail -1)
    f=$(sed -n 's/.*\b\([0-9][0-9]*\) failed.*/\1/p' "$log" | tail -1)
    e=$(sed -n 's/.*\b\([0-9][0-9]*\) error.*/\1/p' "$log" | tail -1)
    s=$(sed -n 's/.*\b\([0-9][0-9]*\) skipped.*/\1/p' "$log" | tail -1)
    f=$((${f:-0} + ${e:-0}))
    if [ $code -ne 0 ] && [ "$f" -eq 0 ]; then f=1; fi
    echo "${p:-0} $f ${s:-0}" >"$count"
}
# Ranks that wait for one another want the cores: with other tests beside them they take ten times as long.
# shellcheck disable=SC2046 # one word a file
tested ranks ranks tests/parallel $(grep -l 'mark\.ranks' tests/cli/test_*.py)
# Those that take longest first: a file stays with one worker, and one begun last is waited for.
first='tests/cli/test_\(route\|docs\|design\|converge\|properties\|random_cases\|at_least\)\.py'
files=$(printf '%s\n' tests/cli/test_*.py | grep "$first"
    printf '%s\n' tests/parallel tests/cli/test_*.py | grep -v "$first")
# one more than there are cores: what waits for a signal, a lock or a limit of time leaves a core to others
# shellcheck disable=SC2086 # one word a file
tested others "not ranks" -n $((workers + 1)) --dist loadfile $files
cat "$dir/ranks.log" "$dir/others.log"
cat "$dir/ranks.count" "$dir/others.count" >>"$dir/counts"

awk '{ p += $1; f += $2; s += $3 } END { printf "%d passed, %d failed, %d skipped\n", p, f, s; exit f > 0 }' \
    "$dir/counts"
