#!/bin/sh
# SPDX-License-Identifier: MIT
# coverage.sh PROGRAM...: the test programs given and the Python tests on the build with --coverage, then the lines of src/ and partition/ that were
# reached, a file a line, in build/coverage/table.txt. BT_COVERAGE_PYTEST names other Python tests than all of them.
set -u
command -v gcovr >/dev/null || { echo "gcovr is missing; run: make deps-dev"; exit 1; }
build=build/coverage
find $build -name '*.gcda' -delete
export GOMP_SPINCOUNT=5000 BERGTOW=$build/bergtow BERGTOW_VALIDATE=$build/bergtow
for t in "$@"; do
    "$t" >$build/log 2>&1 || { echo "$t failed:"; cat $build/log; exit 1; }
done
# Some Python tests hold the time or the size of a run against the release build: a failure is told and does not stop this.
# shellcheck disable=SC2086 # several words
"${PYTHON:-/usr/bin/python3}" -m pytest -q -p no:cacheprovider ${BT_COVERAGE_PYTEST:-tests/cli tests/parallel} >$build/pytest.log 2>&1 || tail -5 $build/pytest.log
gcovr --root . --object-directory $build --filter src/ --filter partition/ --exclude partition/study/ --gcov-ignore-parse-errors --txt $build/table.txt \
    --exclude-unreachable-branches --sort-uncovered >/dev/null
cat $build/table.txt
