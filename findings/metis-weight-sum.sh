#!/bin/sh
# SPDX-License-Identifier: MIT
# METIS as Debian builds it has 32-bit integers: where the vertex weights, each of which fits, sum to more than 2^31, it
# prints that it cannot bisect a graph without vertices, and returns METIS_OK with every vertex in one part.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch libmetis5=5.1.0.dfsg-7 libmetis-dev=5.1.0.dfsg-7

cat >parts.c <<'C'
#include <metis.h>
#include <stdio.h>
enum { SIDE = 30, N = SIDE * SIDE, PARTS = 4 };
int main(void)
{
    const idx_t weights[] = {2000000, 3000000};
    for (int run = 0; run < 2; run++) {
        idx_t n = N, one = 1, parts = PARTS, cut = 0, begin[N + 1], to[4 * N], weight[N], part[N], edges = 0;
        for (int i = 0; i < N; i++) {
            begin[i] = edges;
            if (i % SIDE > 0) to[edges++] = i - 1;
            if (i % SIDE < SIDE - 1) to[edges++] = i + 1;
            if (i >= SIDE) to[edges++] = i - SIDE;
            if (i < N - SIDE) to[edges++] = i + SIDE;
            weight[i] = weights[run];
        }
        begin[N] = edges;
        int said = METIS_PartGraphKway(&n, &one, begin, to, weight, NULL, NULL, &parts, NULL, NULL, NULL, &cut, part);
        int count[PARTS] = {0}, used = 0;
        for (int i = 0; i < N; i++) used += count[part[i]]++ == 0;
        printf("%s, %d of %d parts used\n", said == METIS_OK ? "METIS_OK" : "an error", used, PARTS);
    }
}
C
gcc -I"$root/usr/include" parts.c -o parts -L"$root/usr/lib/$multiarch" -lmetis
./parts | grep METIS_OK >said
seen "900 vertices of weight 2,000,000 into 4 parts" "4 parts" "METIS_OK, 4 of 4 parts used" "$(sed -n 1p said)"
seen "900 vertices of weight 3,000,000 into 4 parts" "4 parts, or an error" "METIS_OK, 1 of 4 parts used" \
  "$(sed -n 2p said)"
