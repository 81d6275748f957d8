#!/bin/sh
# SPDX-License-Identifier: MIT
# With the tunable glibc.malloc.hugetlb=1 the C library asks for huge pages for its heap. malloc_trim(0) gives free
# memory back to the system, page by page, also between blocks in use. Where blocks of all sizes alternate, every huge
# page loses some of its pages and falls apart, and what stays in use is in small pages from then on: 3 % given back
# cost all huge pages. A program that trims before each output then passes over its arrays more slowly.
# Needs a kernel whose /sys/kernel/mm/transparent_hugepage/enabled is madvise or always.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch libc6=2.36-9+deb12u14

cat >trim.c <<'C'
#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCKS = 4000, KEPT = 60000, FREED = 6000 };

static double megabytes(const char *name)
{
    char line[256];
    double found = 0;
    FILE *f = fopen("/proc/self/smaps_rollup", "r");
    while (f && fgets(line, sizeof line, f))
        if (!strncmp(line, name, strlen(name))) found = atof(line + strlen(name)) / 1024;
    if (f) fclose(f);
    return found;
}

int main(void)
{
    static char *kept[BLOCKS], *freed[BLOCKS];
    for (int i = 0; i < BLOCKS; i++) {
        memset(kept[i] = malloc(KEPT), 1, KEPT);
        memset(freed[i] = malloc(FREED), 1, FREED);
    }
    const double all = megabytes("Rss:"), huge = megabytes("AnonHugePages:");
    for (int i = 0; i < BLOCKS; i++) free(freed[i]);
    malloc_trim(0);
    const double given = all - megabytes("Rss:"), left = megabytes("AnonHugePages:");
    printf("%s in huge pages\n", huge > 0.9 * all ? "more than 90 %" : "a part");
    printf("%s given back, %s of the rest in huge pages\n", given < 0.05 * all ? "less than 5 %" : "more",
           left < 0.1 * all ? "less than 10 %" : left < 0.9 * all ? "a part" : "more than 90 %");
    return 0;
}
C
gcc -O1 trim.c -o trim
GLIBC_TUNABLES=glibc.malloc.hugetlb=1 "$(echo "$root"/lib/"$multiarch"/ld-linux-*.so.*)" \
  --library-path "$root/lib/$multiarch" ./trim >said
seen "4,000 blocks of 60 kB, each followed by one of 6 kB" \
  "more than 90 % in huge pages" "more than 90 % in huge pages" "$(sed -n 1p said)"
seen "after the small blocks are freed, and malloc_trim(0)" \
  "about 9 % given back, more than 90 % of the rest in huge pages" \
  "less than 5 % given back, less than 10 % of the rest in huge pages" "$(sed -n 2p said)"
