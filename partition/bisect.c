// SPDX-License-Identifier: MIT
// Recursive coordinate bisection: split across the longer side, with the weight in proportion to the parts, and repeat.
// (Berger & Bokhari 1987, IEEE Trans. Comput. C-36.) Needs no graph and cannot fail: the fallback behind METIS. With
// several kinds of work a split across the longer side may divide one and not the other: ahead of a towed body lies
// most of the contacts, behind it most of the moving floes. Then the split is across the shorter side.
#include "partition/cut.h"

#include "base/inside.h"
#include "bergtow/base.h"

#define TURNS 1.03 // cost across the longer side / across the shorter one, above which the shorter one is taken

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

typedef struct division {
    int left;    // vertices on the left
    double cost; // Σ over the kinds of the heavier side, per part, / that of an even split
} division;

static bt_cut_work weight_of(const bt_graph *graph, int vertex, bool count)
{
    return count ? (bt_cut_work){{1}} : graph->weight[vertex];
}

// The cheapest split with enough vertices on either side.
static division split(const bt_graph *graph, int n, const key *k, int n_parts, int left_parts)
{
    const int right_parts = n_parts - left_parts;
    bt_cut_work sum = {{0}}, left = {{0}};
    for (int i = 0; i < n; i++) bt_cut_add(&sum, graph->weight[k[i].vertex], 1);
    const bool count = bt_cut_sum(sum) == 0; // weightless vertices are split by number
    if (count) sum.of[0] = n;
    division best = {.cost = INFINITY};
    for (int at = 0; at <= n - right_parts; at++) {
        double cost = 0;
        for (int c = 0; c < BT_CUT_KINDS; c++)
            cost += bt_max((double)left.of[c] / left_parts, (double)(sum.of[c] - left.of[c]) / right_parts);
        if (at >= left_parts && cost < best.cost) best = (division){at, cost};
        if (at < n) bt_cut_add(&left, weight_of(graph, k[at].vertex, count), 1);
    }
    best.cost *= n_parts / (double)bt_cut_sum(sum);
    return best;
}

static division split_across(const bt_graph *graph, int n, key *k, int side, int n_parts, int left_parts)
{
    for (int i = 0; i < n; i++) k[i].x = graph->at[k[i].vertex][side];
    qsort(k, (size_t)n, sizeof *k, by_position);
    return split(graph, n, k, n_parts, left_parts);
}

static void bisect(const bt_graph *graph, int n, key *k, int n_parts, int first, int *part)
{
    while (n_parts > 1) {
        const int longer = longer_side(graph, n, k), left_parts = n_parts / 2;
        const division other = split_across(graph, n, k, !longer, n_parts, left_parts);
        division best = split_across(graph, n, k, longer, n_parts, left_parts);
        if (best.cost > TURNS * other.cost) best = split_across(graph, n, k, !longer, n_parts, left_parts);
        bisect(graph, best.left, k, left_parts, first, part);
        k += best.left, n -= best.left;
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
