#!/bin/sh
# SPDX-License-Identifier: MIT
# METIS_PartGraphKway leaves parts empty where vertices are few, and returns METIS_OK; METIS_PartGraphRecursive, given
# the same, fills all. Three vertices a part are few.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch libmetis5=5.1.0.dfsg-7 libmetis-dev=5.1.0.dfsg-7

cat >parts.c <<'C'
#include <metis.h>
#include <stdio.h>
enum { SIDE = 10, N = SIDE * SIDE, PARTS = 32 };
int main(void)
{
    for (int run = 0; run < 2; run++) {
        idx_t n = N, one = 1, parts = PARTS, cut = 0, begin[N + 1], to[4 * N], part[N], edges = 0;
        for (int i = 0; i < N; i++) {
            begin[i] = edges;
            if (i % SIDE > 0) to[edges++] = i - 1;
            if (i % SIDE < SIDE - 1) to[edges++] = i + 1;
            if (i >= SIDE) to[edges++] = i - SIDE;
            if (i < N - SIDE) to[edges++] = i + SIDE;
        }
        begin[N] = edges;
        int said = (run ? METIS_PartGraphRecursive : METIS_PartGraphKway)(&n, &one, begin, to, NULL, NULL, NULL, &parts,
                                                                          NULL, NULL, NULL, &cut, part);
        int count[PARTS] = {0}, used = 0;
        for (int i = 0; i < N; i++) used += count[part[i]]++ == 0;
        printf("%s, %d of %d parts used\n", said == METIS_OK ? "METIS_OK" : "an error", used, PARTS);
    }
}
C
gcc -I"$root/usr/include" parts.c -o parts -L"$root/usr/lib/$multiarch" -lmetis
./parts >said
seen "k-way, 10 x 10 vertices into 32 parts" "32 parts" "METIS_OK, 30 of 32 parts used" "$(sed -n 1p said)"
seen "recursive bisection of the same" "32 parts" "METIS_OK, 32 of 32 parts used" "$(sed -n 2p said)"
