#!/bin/sh
# SPDX-License-Identifier: MIT
# coverage.sh PROGRAM...: runs the given test programs and the Python tests on the build with --coverage, then writes
# which lines of src/ and partition/ were reached to build/coverage/table.txt, one line per file. BT_COVERAGE_PYTEST
# names the Python tests to run instead of all of them.
set -u
command -v gcovr >/dev/null || { echo "gcovr is missing; run: make deps-dev"; exit 1; }
build=build/coverage
find $build -name '*.gcda' -delete
# Counters are atomic, and threads that share them are slow: one, unless a test asks for more.
export GOMP_SPINCOUNT=5000 OMP_NUM_THREADS=1 BERGTOW=$build/bergtow BERGTOW_VALIDATE=$build/bergtow
for t in "$@"; do
    "$t" >$build/log 2>&1 || { echo "$t failed:"; cat $build/log; exit 1; }
done
# Some Python tests compare time or size with those of the release build: a failure is reported and does not stop this.
# shellcheck disable=SC2086 # several words
"${PYTHON:-/usr/bin/python3}" -m pytest -q -p no:cacheprovider ${BT_COVERAGE_PYTEST:-tests/cli tests/parallel} \
    >$build/pytest.log 2>&1 || tail -5 $build/pytest.log
gcovr --root . --object-directory $build --filter src/ --filter partition/ --exclude partition/study/ \
    --gcov-ignore-parse-errors --exclude-unreachable-branches --sort-uncovered --txt $build/table.txt >/dev/null
cat $build/table.txt
