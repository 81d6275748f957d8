#!/bin/sh
# SPDX-License-Identifier: MIT
# libFuzzer over one harness: tests/fuzz/fuzz.sh NAME [SECONDS]; the word "keep" in place of the seconds adds the
# smallest set of inputs that reaches what all found inputs reach to tests/fuzz/corpus/NAME.tar.gz, up to 20 kB and 150
# files. Found inputs stay in build/fuzz/found/NAME; one that breaks something is in build/fuzz/broken/: mend the
# program and keep the input as tests/fuzz/corpus/NAME/WHAT-IT-DID.
set -eu
name=$1 what=${2:-60}
build=build/fuzz found=build/fuzz/found/$name named=tests/fuzz/corpus/$name packed=tests/fuzz/corpus/$name.tar.gz
[ -x $build/fuzz_"$name" ] || { echo "$build/fuzz_$name is missing; run: make CONFIG=fuzz $build/fuzz_$name"; exit 1; }
kept=$build/kept/$name
rm -rf "$kept"
mkdir -p "$found" "$kept" "$named" $build/broken
[ ! -e "$packed" ] || tar -xzf "$packed" -C "$kept"
export ASAN_OPTIONS=allocator_may_return_null=1:detect_leaks=1 OMP_NUM_THREADS=1
export LSAN_OPTIONS=suppressions=tests/lsan.supp:print_suppressions=0

# Files that a harness needs beside its input, also after a crash.
TMPDIR=$(mktemp -d)
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT

# Keys, their last parts and the words of their choices; in the list a blank separates a name from the text after it.
words_of_keys() {
    build/release/bergtow --list-keys | awk '$1 ~ /^[a-z][a-z_0-9.]*$/ {
        n = split($1, part, ".")
        print part[n] ": "
        print $1
        for (i = 3; i < 9; i++) if ($i ~ /^[a-z]+$/) print $i
    }' | sort -u | awk '{print "\"" $0 "\""}'
}

# Words of the input: keys, choices, units.
words=$build/$name.dict
case $name in
case | setup | study)
    words_of_keys >"$words"
    printf '"%s"\n' ' mm' ' km' ' kN' ' deg' ' kn' '1e300' '-1' '1e-9' none 'from: ' 'to: ' 'parameters: ' \
        'variants: ' 'with: ' 'repeats: ' '[[0, 0], [1, 0], [0, 1]]' >>"$words" ;;
outlines)
    printf '"%s"\n' FeatureCollection features Feature geometry Polygon MultiPolygon coordinates properties thickness \
        bergtow frame crs name EPSG:32633 EPSG:3413 EPSG:3857 CRS84 origin coordinates metres '[[0,0],[9,0],[0,9]]' \
        null 1e308 >"$words" ;;
table) printf '"%s"\n' 't,u,v' ' m/s' ' kn' ' s' ' h' '1e308' '1e-308' '#' >"$words" ;;
*) printf '"%s"\n' '\x00' >"$words" ;;
esac
most=4000 slow=100
[ "$name" != checkpoint ] || most=400 slow=0 # edits of 12 bytes: short inputs do nothing

if [ "$what" = keep ]; then
    merged=$(mktemp -d)
    $build/fuzz_"$name" -merge=1 -max_len=2000 "$merged" "$named" "$kept" "$found" >$build/merge.log 2>&1
    total=0 count=0
    find "$merged" -type f -printf '%s %p\n' | sort -n | while read -r size path; do
        total=$((total + size))
        count=$((count + 1))
        if [ $total -ge 20000 ] || [ $count -gt 150 ]; then break; fi
        cp "$path" "$kept"/
    done
    rm -rf "$merged"
    tar --sort=name --mtime=@0 --owner=0 --group=0 --numeric-owner --mode=644 -C "$kept" -cf - . | gzip -n9 >"$packed"
    du -sb "$kept"
else
    $build/fuzz_"$name" -max_total_time="$what" -timeout=60 -rss_limit_mb=3000 -max_len=$most -len_control=$slow \
        -dict="$words" -artifact_prefix=$build/broken/"$name"- -print_final_stats=1 "$found" "$named" "$kept" </dev/null
fi
