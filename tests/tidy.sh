#!/bin/sh
# SPDX-License-Identifier: MIT
# clang-tidy over the program; .clang-tidy says what for. With file names: over those only.
tidy=$(command -v clang-tidy-14 || command -v clang-tidy) ||
    { echo "clang-tidy is missing; run: make deps-dev"; exit 1; }
[ -f build/release/revision.h ] || { echo "tidy: build/release/revision.h is missing; run make first"; exit 1; }
flags="-std=c17 -D_GNU_SOURCE -fopenmp -Iinclude -Isrc -I. -Ibuild/release $(pkg-config --cflags ompi-c hdf5-openmpi)"
[ $# -gt 0 ] || set -- src/*/*.c partition/*.c
# shellcheck disable=SC2016 # the inner shell expands these
printf '%s\n' "$@" | xargs -P "${J:-2}" -I{} sh -c '
    "$1" --quiet "$2" -- $3 2>/dev/null >"build/tidy.$$" || { cat "build/tidy.$$"; rm -f "build/tidy.$$"; exit 1; }
    rm -f "build/tidy.$$"' sh "$tidy" {} "$flags"
