#!/bin/sh
# SPDX-License-Identifier: MIT
# sanitize.sh asan|tsan|valgrind [short] PROGRAM...: the given test programs, then short runs of bergtow that set up,
# tow, write, stop and read back, on threads and ranks, each of them watched. A finding, a wrong exit code or another
# state hash ends it with an error; exit code 77: a tool is missing. With `short` only a part of it, for make test;
# valgrind then watches the release build. BT_PYTEST names Python tests to run on the build as well (asan).
# shellcheck disable=SC2086 # commands of several words
set -u
kind=$1
shift
short=
if [ "${1:-}" = short ]; then
    short=1
    shift
fi
bin=build/$kind/bergtow
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
export OMP_WAIT_POLICY=passive OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
watch=
case $kind in
asan) # A leak of Open MPI is not ours; one of ours is an error. Under mpirun leaks are not looked for: Open MPI unloads
      # the modules that made them, so that a suppression has no name to match.
    export ASAN_OPTIONS=allocator_may_return_null=1:detect_leaks=1
    export LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp:print_suppressions=0" ;;
tsan) # HDF5 and Open MPI are not instrumented, so that what happens within them is ignored. Archer tells the sanitizer
      # in which order libomp runs things.
    archer=$(find /usr/lib/llvm-14/lib /usr/lib/x86_64-linux-gnu -name libarcher.so 2>/dev/null | head -1)
    [ -n "$archer" ] || { echo "libarcher.so is missing; run: make deps-dev"; exit 77; }
    [ -x $bin ] || { echo "$bin is missing (clang-14 makes it); run: make deps-dev"; exit 77; }
    export OMP_TOOL_LIBRARIES="$archer" OMP_NUM_THREADS=4
    export TSAN_OPTIONS="ignore_noninstrumented_modules=1:halt_on_error=1:exitcode=66" ;;
valgrind)
    command -v valgrind >/dev/null || { echo "valgrind is missing; run: make deps-dev"; exit 77; }
    bin=build/debug/bergtow
    [ -z "$short" ] || bin=build/release/bergtow
    export BERGTOW_STARTED=1
    watch="valgrind -q --error-exitcode=66 --suppressions=tests/valgrind.supp"
    theirs=/usr/share/openmpi/openmpi-valgrind.supp
    [ ! -f $theirs ] || watch="$watch --suppressions=$theirs" ;;
*) echo "sanitize.sh asan|tsan|valgrind [short] PROGRAM..."; exit 2 ;;
esac

fail() { echo "$*"; cat "$dir/log"; exit 1; }
# want CODE COMMAND...
want() {
    code=$1
    shift
    "$@" >"$dir/log" 2>&1 </dev/null
    got=$?
    [ $got -eq "$code" ] || fail "exit code $got, not $code: $*"
    # That a flipped bit asks HDF5 for petabytes, and gets none, is a warning.
    ! grep 'Sanitizer\|runtime error' "$dir/log" | grep -qv 'Sanitizer failed to allocate' || fail "a finding: $*"
}
hash_of() { sed -n 's/.*"state_hash": *"\([0-9a-f]*\)".*/\1/p' "$1/summary.json"; }

for t in "$@"; do
    echo "$t"
    want 0 "$t"
done

cat >"$dir/tow.yml" <<'CASE'
run: {dt: 0.1, duration: 6}
domain: {length: 15, width: 8}
ice: {concentration: 0.6, size: 0.7, friction: 0.3, restitution: 0.2, crushing.pressure: 50 kPa}
body: {x: 3, length: 2, shape: ship, width: 1.2}
tow: {mode: line, speed: 0.2, ramp: 1, line_length: 2 m, line.breaking_load: 1 kN, waypoints: [[7, 0], [8, 1]]}
lead: {mode: managed, floe_size: 0.4, length: 4}
impact: {conversion: crushing, corner: real}
output: {panels: true, frame_interval: 1}
CASE
cat >"$dir/window.yml" <<'CASE'
run: {dt: 1, duration: 60}
domain: {frame: geographic, length: 600, width: 300, ends: moving, sides: periodic}
ice: {concentration: 0.5, size: 25, shape: rectangles, thickness: 1, thickness_law: lognormal}
body: {length: 40, draft: 20}
tow:
  {mode: thrust, speed: 1, ramp: 10, line_length: 40, line: {branches: 2, type: dyneema, diameter: 60 mm},
   vessel: {mass: 500 t, bollard_pull: 900 kN, free_speed: 7}}
water: {latitude: 75, tilt: dynamic, tide: {major: 0.2, minor: 0.1}}
air: {wind_x: 5}
CASE
# Walls that close on dense ice: force chains through many cells.
cat >"$dir/press.yml" <<'CASE'
run: {dt: 0.1, duration: 2}
domain: {length: 20, width: 14, ends_closing: 0.1, sides_closing: 0.1}
ice: {concentration: 0.85, size: 0.9}
body: {shape: none}
solver: {max_sweeps: 40, cell_size: 2}
CASE
cat >"$dir/study.yml" <<'CASE'
base: tow.yml
set: {run.duration: 1, output.panels: false}
parameters: {ice.friction: [0.1, 0.3]}
CASE
steps=${STEPS:-20}
cases='tow window press' teams='1x2 1x4 2x2 3x1'
[ "$kind" != valgrind ] || steps=4 teams=
if [ -n "$short" ]; then
    steps=4
    case $kind in
    asan) cases='tow window' teams=2x2 ;;
    valgrind) steps=2 cases=tow ;;
    esac
fi

for c in $cases; do
    echo "$c: alone, on threads$([ "$kind" = valgrind ] || echo ', on ranks')"
    want 0 $watch $bin run "$dir/$c.yml" -o "$dir/$c-1" --threads 1 --steps $steps
    first=$(hash_of "$dir/$c-1")
    [ -n "$first" ] || fail "$c: no state hash"
    for how in $teams; do
        ranks=${how%x*} threads=${how#*x}
        out=$dir/$c-$ranks-$threads start=
        [ "$ranks" = 1 ] ||
            start="env ASAN_OPTIONS=allocator_may_return_null=1:detect_leaks=0 mpirun --oversubscribe -n $ranks"
        want 0 $start $bin run "$dir/$c.yml" -o "$out" --threads "$threads" --steps $steps
        [ "$(hash_of "$out")" = "$first" ] || fail "$c: another state hash on $ranks ranks x $threads threads"
    done
    echo "$c: stopped half-way, taken up"
    want 0 $watch $bin run "$dir/$c.yml" -o "$dir/$c-again" --threads 2 --steps $((steps / 2))
    want 0 $watch $bin resume "$dir/$c-again" --threads 2 --steps $((steps - steps / 2))
    [ "$(hash_of "$dir/$c-again")" = "$first" ] || fail "$c: another state hash when taken up"
    want 0 $watch $bin diff "$dir/$c-1" "$dir/$c-again"
done
if [ -n "$short" ]; then
    echo "$kind: nothing found"
    exit 0
fi
echo "fields, estimates, a study, bad input"
want 0 $watch $bin field "$dir/tow.yml" -o "$dir/f.h5" --set lead.mode=none
want 0 $watch $bin field "$dir/tow.yml" -o "$dir/f.geojson" --set lead.mode=none
for key in field=$dir/f.h5 outlines=$dir/f.geojson; do
    want 0 $watch $bin run "$dir/tow.yml" -o "$dir/back-${key%%=*}" --set "ice.$key" --set lead.mode=none --steps 2
done
want 0 $watch $bin estimate "$dir/tow.yml" --json
want 0 $watch $bin check "$dir/window.yml" --scale 1/10
want 0 $watch $bin run "$dir/tow.yml" -o "$dir/dump" --steps 2 --dump-contacts "1:$dir/c.h5"
want 0 $watch $bin ensemble "$dir/study.yml" -o "$dir/study" --threads 1
want 3 $watch $bin check "$dir/tow.yml" --set ice.size=x --set tow.waypoints=[[1 --set body.shape=shp
want 0 $watch $bin check "$dir/study.yml"
want 3 $watch $bin run "$dir/study.yml" -o "$dir/none"
want 4 $watch $bin run "$dir/tow.yml" -o "$dir/tow.yml/out"
if [ -n "${BT_PYTEST:-}" ]; then
    echo "Python tests: $BT_PYTEST"
    export BERGTOW="$PWD/$bin" BERGTOW_VALIDATE="$PWD/$bin"
    export ASAN_OPTIONS="allocator_may_return_null=1:detect_leaks=0:log_path=$dir/found"
    # What UBSan finds ends a run, and fails its test (gcc's has no log_path). A test that measures time may fail here
    # without a finding: run it again by itself.
    "${PYTHON:-/usr/bin/python3}" -m pytest -q -p no:cacheprovider -rfE $BT_PYTEST || failed=1
    ! ls "$dir"/found* >/dev/null 2>&1 || { cat "$dir"/found*; exit 1; }
    [ -z "${failed:-}" ] || exit 1
fi
echo "$kind: nothing found"
