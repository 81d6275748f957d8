#!/bin/sh
# SPDX-License-Identifier: MIT
# Runs the compiled test programs given as arguments, then short runs under the sanitizers, then the Python tests, and
# ends with one line of counts. A program that crashes or prints no count is itself a failure. A sanitizer that is not
# installed counts as skipped, and is named.
passed=0 failed=0 skipped=0
# On a busy machine threads that spin at a barrier keep the others from the core, and everything stalls; bergtow itself
# sees to this in main.c.
export GOMP_SPINCOUNT="${GOMP_SPINCOUNT:-5000}"
log=$(mktemp)
trap 'rm -f "$log"' EXIT

for t in "$@"; do
    name=${t#*/tests/}
    start=$(date +%s)
    "$t" >"$log" 2>&1
    code=$?
    p=$(sed -n 's/.*PASSED.* \([0-9][0-9]*\) test(s).*/\1/p' "$log" | tail -1)
    f=$(sed -n 's/^ *\([0-9][0-9]*\) FAILED TEST(S).*/\1/p' "$log" | tail -1)
    p=${p:-0} f=${f:-0}
    if [ $code -ne 0 ] && [ "$f" -eq 0 ]; then f=1; fi
    if [ $code -eq 0 ] && [ "$p" -eq 0 ]; then f=1; fi
    passed=$((passed + p)) failed=$((failed + f))
    printf '%-40s %4d passed %4d failed  %3d s\n' "$name" "$p" "$f" $(($(date +%s) - start))
    if [ "$f" -ne 0 ]; then cat "$log"; fi
done

for kind in asan tsan valgrind; do
    corpus=
    [ $kind != asan ] || corpus=build/asan/tests/fuzz/test_corpus
    start=$(date +%s)
    tests/sanitize.sh $kind short $corpus >"$log" 2>&1
    code=$?
    p=0 f=0
    case $code in
    0) p=1 ;;
    77) skipped=$((skipped + 1)) ;;
    *) f=1 ;;
    esac
    passed=$((passed + p)) failed=$((failed + f))
    printf '%-40s %4d passed %4d failed  %3d s\n' "short runs under $kind" $p $f $(($(date +%s) - start))
    if [ $code -eq 77 ]; then echo "    not run: $(tail -1 "$log")"; elif [ $code -ne 0 ]; then cat "$log"; fi
done

# Files of tests side by side, as many as there are cores, up to four.
workers=$(nproc)
${PYTHON:-/usr/bin/python3} -m pytest -q -p no:cacheprovider -rfE -n $((workers < 4 ? workers : 4)) --dist loadfile \
    tests/cli tests/parallel >"$log" 2>&1
code=$?
cat "$log"
p=$(sed -n 's/.*\b\([0-9][0-9]*\) passed.*/\1/p' "$log" | tail -1)
f=$(sed -n 's/.*\b\([0-9][0-9]*\) failed.*/\1/p' "$log" | tail -1)
e=$(sed -n 's/.*\b\([0-9][0-9]*\) error.*/\1/p' "$log" | tail -1)
s=$(sed -n 's/.*\b\([0-9][0-9]*\) skipped.*/\1/p' "$log" | tail -1)
f=$((${f:-0} + ${e:-0}))
if [ $code -ne 0 ] && [ "$f" -eq 0 ]; then f=1; fi
passed=$((passed + ${p:-0})) failed=$((failed + f))

echo "$passed passed, $failed failed, $((skipped + ${s:-0})) skipped"
[ "$failed" -eq 0 ]
