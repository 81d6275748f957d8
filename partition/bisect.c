// SPDX-License-Identifier: MIT
// Recursive coordinate bisection: split across the longer side, with the weight in proportion to the parts, and repeat.
// (Berger & Bokhari 1987, IEEE Trans. Comput. C-36.) Needs no graph and cannot fail: the fallback behind METIS.
#include "partition/cut.h"

#include <stdlib.h>

#include "base/inside.h"
#include "bergtow/base.h"

typedef struct key {
    double x;
    int vertex;
} key;

BT_ASCENDING_BY(by_position, key, x, vertex)

static int longer_side(const bt_graph *graph, int n, const key *k)
{
    double low[2] = {0, 0}, high[2] = {0, 0};
    for (int c = 0; c < 2; c++) {
        low[c] = high[c] = graph->at[k[0].vertex][c];
        for (int i = 1; i < n; i++) {
            low[c] = bt_min(low[c], graph->at[k[i].vertex][c]);
            high[c] = bt_max(high[c], graph->at[k[i].vertex][c]);
        }
    }
    return high[1] - low[1] > high[0] - low[0];
}

// Vertices left of the split: prefix weight nearest to sum × left_parts / n_parts, and enough vertices on either side.
static int split(const bt_graph *graph, int n, const key *k, int n_parts, int left_parts)
{
    int64_t sum = 0;
    for (int i = 0; i < n; i++) sum += graph->weight[k[i].vertex];
    bool count = sum == 0; // weightless vertices are split by number
    if (count) sum = n;
    long double aim = (long double)sum * left_parts / n_parts;
    int right_parts = n_parts - left_parts, at = 0;
    int64_t left = 0;
    while (at < n - right_parts) {
        int64_t w = count ? 1 : graph->weight[k[at].vertex];
        if (at >= left_parts && left + 0.5L * w >= aim) break;
        left += w;
        at++;
    }
    return at;
}

static void bisect(const bt_graph *graph, int n, key *k, int n_parts, int first, int *part)
{
    while (n_parts > 1) {
        int c = longer_side(graph, n, k);
        for (int i = 0; i < n; i++) k[i].x = graph->at[k[i].vertex][c];
        qsort(k, (size_t)n, sizeof *k, by_position);
        int left_parts = n_parts / 2, left = split(graph, n, k, n_parts, left_parts);
        bisect(graph, left, k, left_parts, first, part);
        k += left, n -= left;
        n_parts -= left_parts, first += left_parts;
    }
    for (int i = 0; i < n; i++) part[k[i].vertex] = first;
}

void bt_cut_by_bisection(const bt_graph *graph, int n_parts, int *part)
{
    key *k = bt_alloc((size_t)graph->n, sizeof *k);
    for (int i = 0; i < graph->n; i++) k[i].vertex = i;
    bisect(graph, graph->n, k, n_parts, 0, part);
    free(k);
}
