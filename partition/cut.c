// SPDX-License-Identifier: MIT
// The cut of a cell graph: groups contracted, heavy vertices set apart, cuts compared, labels kept close to the old.
//
//   1. Every group becomes one vertex; parallel edges are summed.
//   2. While the heaviest vertex weighs a share (weight left / parts left) or more of every kind, it gets its own part.
//      The rest is divided into the other parts, and balance is judged on those: the vertex cannot be divided, and
//      METIS, given one, misses the balance of all others.
//   3. Three cuts: the labels before, METIS, and coordinate bisection, which costs a tenth of METIS, cannot fail and
//      has the smaller cut where the field is even; each refined (refine.c). Of those in balance the smallest edge cut
//      wins, but the labels before are kept while their cut is at most KEEP times that: METIS starts anew each time,
//      and half of the cells would change hands because a heavy spot has moved on by one.
//   4. Labels of a new cut are exchanged so that little moves: the (new part, old part) overlaps in falling order, each
//      taken if both are free. Such a matching keeps at least half of the weight that the best one would. The best
//      (Hungarian method) costs n_parts³, 7·10¹⁰ operations at 4,096 parts, against n log n here with n cells.
#include "partition/cut.h"

#include <limits.h>
#include <string.h>

#include "base/inside.h"
#include "bergtow/base.h"

static const double KEEP = 1.25;  // factor by which the old labels may be worse
// imbalances within this factor of the best count as equal if none is within the tolerance
static const double CLOSE = 1.1;

// A graph that owns its arrays, and the map of the vertices of the larger graph to its own (−1 = none).
typedef struct owned {
    bt_graph g;
    int *start, *to, *of;
    int64_t *edge;
    bt_cut_work *weight;
    double (*at)[2];
} owned;

static void owned_free(owned *o)
{
    BT_FREE(o->start, o->to, o->of, o->edge, o->weight, o->at);
}

// The graph of the vertices of `graph` mapped by of [graph->n] onto n vertices: weights and edges summed, loops
// dropped.
static owned mapped(const bt_graph *graph, int n, int *of)
{
    owned o = {.of = of};
    int n_edges = graph->start[graph->n], n_to = 0;
    size_t size = (size_t)n;
    o.start = bt_alloc(size + 1, sizeof *o.start);
    o.to = bt_alloc((size_t)n_edges, sizeof *o.to);
    o.edge = bt_alloc((size_t)n_edges, sizeof *o.edge);
    o.weight = bt_alloc(size, sizeof *o.weight);
    o.at = bt_alloc(size, sizeof *o.at);
    int *first = bt_alloc(size + 2, sizeof *first), *member = bt_alloc((size_t)graph->n, sizeof *member);
    int *slot = bt_alloc(size, sizeof *slot); // place of a neighbour in the row being made, −1 not yet there
    for (int v = 0; v < graph->n; v++)
        if (of[v] >= 0) first[of[v] + 2]++;
    for (int c = 0; c < n; c++) first[c + 2] += first[c + 1], slot[c] = -1;
    for (int v = 0; v < graph->n; v++)
        if (of[v] >= 0) member[first[of[v] + 1]++] = v;
    for (int c = 0; c < n; c++) { // its members: first[c] ... first[c + 1]
        o.start[c] = n_to;
        for (int m = first[c]; m < first[c + 1]; m++) {
            int v = member[m];
            bt_cut_add(&o.weight[c], graph->weight[v], 1);
            for (int k = 0; k < 2; k++) o.at[c][k] += graph->at[v][k];
            for (int e = graph->start[v]; e < graph->start[v + 1]; e++) {
                int d = of[graph->to[e]];
                if (d < 0 || d == c) continue;
                if (slot[d] < 0) slot[d] = n_to, o.to[n_to++] = d;
                o.edge[slot[d]] += graph->edge[e];
            }
        }
        for (int k = 0; k < 2; k++) o.at[c][k] /= first[c + 1] - first[c];
        for (int e = o.start[c]; e < n_to; e++) slot[o.to[e]] = -1;
    }
    o.start[n] = n_to;
    BT_FREE(first, member, slot);
    o.g = (bt_graph){n, o.start, o.to, o.edge, o.weight, (const double(*)[2])o.at, NULL};
    return o;
}

// Number the vertices of the contracted graph, in the order of their first member.
static int contracted_numbers(const bt_graph *graph, int *of)
{
    int n = 0, top = -1;
    for (int v = 0; graph->group && v < graph->n; v++)
        if (graph->group[v] > top) top = graph->group[v];
    int *number = bt_alloc((size_t)top + 1, sizeof *number);
    for (int i = 0; i <= top; i++) number[i] = -1;
    for (int v = 0; v < graph->n; v++) {
        int group = graph->group ? graph->group[v] : -1;
        if (group < 0) of[v] = n++;
        else {
            if (number[group] < 0) number[group] = n++;
            of[v] = number[group];
        }
    }
    free(number);
    return n;
}

typedef struct heavy {
    int64_t weight;
    int vertex;
} heavy;

static int heaviest_first(const void *a, const void *b)
{
    const heavy *p = a, *q = b;
    if (p->weight != q->weight) return p->weight > q->weight ? -1 : 1;
    return (p->vertex > q->vertex) - (p->vertex < q->vertex);
}

// Does a vertex weigh a share of every kind of the rest, or more?
static bool fills_a_part(bt_cut_work weight, bt_cut_work rest, int n_parts)
{
    bool fills = bt_cut_sum(rest) > 0;
    for (int k = 0; k < BT_CUT_KINDS; k++)
        fills = fills && weight.of[k] >= rest.of[k] / n_parts + (rest.of[k] % n_parts != 0);
    return fills;
}

// Number of heavy vertices, which are the first of `order`; rest: weight of the others.
static int set_apart(const bt_graph *graph, int n_parts, heavy *order, bt_cut_work *rest)
{
    *rest = (bt_cut_work){{0}};
    for (int v = 0; v < graph->n; v++) {
        order[v] = (heavy){bt_cut_sum(graph->weight[v]), v};
        bt_cut_add(rest, graph->weight[v], 1);
    }
    qsort(order, (size_t)graph->n, sizeof *order, heaviest_first);
    int n = 0;
    while (n < graph->n && n_parts - n > 1 && fills_a_part(graph->weight[order[n].vertex], *rest, n_parts - n))
        bt_cut_add(rest, graph->weight[order[n++].vertex], -1);
    return n;
}

typedef struct trial {
    int *part;
    bt_cut_method method;
    double excess; // as the imbalance, but of the parts of more than one vertex, and against their share
    int64_t cut;
    int n_empty;
} trial;

// The heaviest part of each kind; count [n_parts]: parts of one vertex are left out, NULL = none is.
static bt_cut_work heaviest_of(const bt_cut_work *load, const int *count, int n_parts)
{
    bt_cut_work most = {{0}};
    for (int p = 0; p < n_parts; p++)
        for (int k = 0; k < BT_CUT_KINDS; k++)
            if ((!count || count[p] > 1) && load[p].of[k] > most.of[k]) most.of[k] = load[p].of[k];
    return most;
}

static void judge(const bt_graph *graph, int n_parts, double share, trial *attempt)
{
    bt_cut_work *load = bt_alloc((size_t)n_parts, sizeof *load);
    int *count = bt_alloc((size_t)n_parts, sizeof *count);
    for (int v = 0; v < graph->n; v++) {
        bt_cut_add(&load[attempt->part[v]], graph->weight[v], 1);
        count[attempt->part[v]]++;
    }
    attempt->excess = bt_max(0, (double)bt_cut_sum(heaviest_of(load, count, n_parts)) / share - 1);
    free(load);
    free(count);
    bt_cut_quality quality = bt_cut_measure(graph, n_parts, attempt->part, NULL);
    attempt->cut = quality.cut;
    attempt->n_empty = quality.n_empty;
}

static const trial *better_of(const trial *attempt, int n, double tolerance)
{
    double least = 1e300;
    int n_empty = INT_MAX;
    for (int i = 0; i < n; i++)
        if (attempt[i].n_empty < n_empty) n_empty = attempt[i].n_empty;
    for (int i = 0; i < n; i++)
        if (attempt[i].n_empty == n_empty) least = bt_min(least, attempt[i].excess);
    const trial *best = NULL, *kept = NULL;
    for (int i = 0; i < n; i++) {
        double allowed = bt_max(tolerance, CLOSE * least);
        if (attempt[i].n_empty > n_empty || attempt[i].excess > KEEP * allowed) continue;
        if (attempt[i].method == BT_CUT_KEPT) kept = &attempt[i];
        if (attempt[i].excess <= allowed && (!best || attempt[i].cut < best->cut)) best = &attempt[i];
    }
    return kept && (double)kept->cut <= KEEP * (double)best->cut ? kept : best;
}

// The previous label of most of a contracted vertex's weight; if there is none, that of the neighbour with the heaviest
// edge. false if the previous labels are useless: a part had no vertex.
static bool labels_before(const bt_graph *graph, const bt_graph *whole, const int *of, const int *before, int n_parts,
                          int *part)
{
    int64_t *most = bt_alloc((size_t)graph->n, sizeof *most), *link = bt_alloc((size_t)n_parts, sizeof *link);
    int *count = bt_alloc((size_t)n_parts, sizeof *count);
    for (int c = 0; c < graph->n; c++) part[c] = most[c] = -1;
    for (int v = 0; v < whole->n; v++) { // the heaviest member stands for its group
        const int64_t weight = bt_cut_sum(whole->weight[v]);
        bool labelled = before[v] >= 0 && before[v] < n_parts;
        if (labelled && weight > most[of[v]]) most[of[v]] = weight, part[of[v]] = before[v];
    }
    for (bool changed = true; changed;) {
        changed = false;
        for (int c = 0; c < graph->n; c++) {
            int best = -1;
            if (part[c] >= 0) continue;
            for (int e = graph->start[c]; e < graph->start[c + 1]; e++)
                if (part[graph->to[e]] >= 0) link[part[graph->to[e]]] += graph->edge[e];
            for (int e = graph->start[c]; e < graph->start[c + 1]; e++) {
                int p = part[graph->to[e]];
                if (p >= 0 && (best < 0 || link[p] > link[best] || (link[p] == link[best] && p < best))) best = p;
            }
            for (int e = graph->start[c]; e < graph->start[c + 1]; e++)
                if (part[graph->to[e]] >= 0) link[part[graph->to[e]]] = 0;
            part[c] = best;
            changed = changed || best >= 0;
        }
    }
    bool good = true;
    for (int c = 0; c < graph->n; c++) {
        if (part[c] < 0) good = false;
        else count[part[c]]++;
    }
    for (int p = 0; good && p < n_parts; p++) good = count[p] > 0;
    BT_FREE(most, link, count);
    return good;
}

// Cut the light vertices by METIS or bisection; each heavy one gets its own part.
static bool cut_anew(const bt_graph *graph, const owned *light, int n_heavy, const heavy *order, int n_parts,
                     double tolerance, trial *attempt)
{
    int rest = n_parts - n_heavy, *part = bt_alloc((size_t)light->g.n, sizeof *part);
    bool good = true;
    if (attempt->method == BT_CUT_BISECT) bt_cut_by_bisection(&light->g, rest, part);
    else good = rest > 1 && light->g.n > rest && bt_cut_by_metis(&light->g, rest, tolerance, part);
    for (int c = 0; good && c < graph->n; c++)
        if (light->of[c] >= 0) attempt->part[c] = part[light->of[c]];
    for (int i = 0; good && i < n_heavy; i++) attempt->part[order[i].vertex] = rest + i;
    free(part);
    return good;
}

typedef struct overlap {
    int64_t weight;
    int new, old;
} overlap;

BT_ASCENDING_BY(by_parts, overlap, new, old)

static int largest_first(const void *a, const void *b)
{
    const overlap *p = a, *q = b;
    if (p->weight != q->weight) return p->weight > q->weight ? -1 : 1;
    return by_parts(a, b);
}

static void relabel(const bt_graph *graph, int n_parts, const int *before, int *part)
{
    overlap *o = bt_alloc((size_t)graph->n, sizeof *o);
    int n = 0, n_pairs = 0, *name = bt_alloc((size_t)n_parts, sizeof *name);
    bool *taken = bt_alloc((size_t)n_parts, sizeof *taken);
    for (int v = 0; v < graph->n; v++)
        if (before[v] >= 0 && before[v] < n_parts)
            o[n++] = (overlap){bt_cut_sum(graph->weight[v]), part[v], before[v]};
    qsort(o, (size_t)n, sizeof *o, by_parts);
    for (int i = 0; i < n; i++) {
        if (n_pairs && by_parts(&o[n_pairs - 1], &o[i]) == 0) o[n_pairs - 1].weight += o[i].weight;
        else o[n_pairs++] = o[i];
    }
    qsort(o, (size_t)n_pairs, sizeof *o, largest_first);
    for (int p = 0; p < n_parts; p++) name[p] = -1;
    for (int i = 0; i < n_pairs; i++)
        if (name[o[i].new] < 0 && !taken[o[i].old]) name[o[i].new] = o[i].old, taken[o[i].old] = true;
    for (int p = 0, next = 0; p < n_parts; p++) {
        if (name[p] >= 0) continue;
        while (taken[next]) next++;
        name[p] = next++;
    }
    for (int v = 0; v < graph->n; v++) part[v] = name[part[v]];
    BT_FREE(o, name, taken);
}

// Label the contracted graph c; whole: the original graph.
static bt_cut_method cut_contracted(const owned *c, const bt_graph *whole, int n_parts, double tolerance,
                                    const int *before, int *part)
{
    const bt_graph *graph = &c->g;
    bt_cut_work rest;
    heavy *order = bt_alloc((size_t)graph->n, sizeof *order);
    int n_heavy = set_apart(graph, n_parts, order, &rest), n_light = 0;
    int *of = bt_alloc((size_t)graph->n, sizeof *of);
    for (int i = 0; i < n_heavy; i++) of[order[i].vertex] = -1;
    for (int v = 0; v < graph->n; v++)
        if (of[v] >= 0) of[v] = n_light++;
    owned light = mapped(graph, n_light, of);
    bool weightless = bt_cut_sum(rest) == 0; // such vertices are divided by number
    for (int v = 0; weightless && v < graph->n; v++)
        if (of[v] >= 0) c->weight[v] = light.weight[of[v]] = (bt_cut_work){{1}};
    if (weightless) rest.of[0] = n_light;

    int rest_parts = n_parts - n_heavy, n = 0;
    trial attempt[3];
    for (int i = 0; i < 3; i++) attempt[i].part = bt_alloc((size_t)graph->n, sizeof *attempt[i].part);
    const trial *best = attempt;
    if (n_light <= rest_parts) { // every vertex gets its own part
        for (int v = 0; v < graph->n; v++) attempt[0].part[v] = v;
        attempt[0].method = BT_CUT_NONE;
    } else {
        const double all = (double)bt_cut_sum(rest) / rest_parts;
        bt_cut_work share;
        int kinds = 0; // that there are
        for (int k = 0; k < BT_CUT_KINDS; k++) share.of[k] = rest.of[k] / rest_parts, kinds += rest.of[k] > 0;
        for (int method = BT_CUT_KEPT; method <= BT_CUT_BISECT; method++) {
            trial *now = &attempt[n];
            now->method = method;
            bool good;
            if (method == BT_CUT_KEPT) good = labels_before(graph, whole, c->of, before, n_parts, now->part);
            else good = cut_anew(graph, &light, n_heavy, order, n_parts, tolerance, now);
            if (!good) continue;
            bt_cut_refine(graph, n_parts, share, (int64_t)(tolerance * all / kinds), now->part);
            judge(graph, n_parts, all, now);
            n++;
        }
        best = better_of(attempt, n, tolerance);
    }
    memcpy(part, best->part, (size_t)graph->n * sizeof *part);
    bt_cut_method method = best->method;
    for (int i = 0; i < 3; i++) free(attempt[i].part);
    owned_free(&light);
    free(order);
    return method;
}

void bt_cut(const bt_graph *graph, int n_parts, double tolerance, int *part, bt_cut_quality *quality)
{
    int *before = bt_alloc((size_t)graph->n, sizeof *before);
    bt_cut_method method = BT_CUT_NONE;
    for (int v = 0; v < graph->n; v++) {
        before[v] = part[v];
        part[v] = 0;
    }
    if (n_parts > 1 && graph->n > 0) {
        int *of = bt_alloc((size_t)graph->n, sizeof *of);
        int n = contracted_numbers(graph, of);
        owned c = mapped(graph, n, of);
        int *label = bt_alloc((size_t)n, sizeof *label);
        method = cut_contracted(&c, graph, n_parts, tolerance, before, label);
        for (int v = 0; v < graph->n; v++) part[v] = label[of[v]];
        if (method != BT_CUT_KEPT) relabel(graph, n_parts, before, part);
        free(label);
        owned_free(&c);
    }
    if (quality) {
        *quality = bt_cut_measure(graph, n_parts, part, before);
        quality->method = method;
    }
    free(before);
}

bt_cut_quality bt_cut_measure(const bt_graph *graph, int n_parts, const int *part, const int *before)
{
    bt_cut_quality quality = {.method = BT_CUT_NONE};
    bt_cut_work *load = bt_alloc((size_t)n_parts, sizeof *load), sum = {{0}};
    bool *used = bt_alloc((size_t)n_parts, sizeof *used);
    for (int v = 0; v < graph->n; v++) {
        bt_cut_add(&load[part[v]], graph->weight[v], 1);
        bt_cut_add(&sum, graph->weight[v], 1);
        used[part[v]] = true;
        if (before && before[v] >= 0 && before[v] != part[v]) quality.moved += bt_cut_sum(graph->weight[v]);
        for (int e = graph->start[v]; e < graph->start[v + 1]; e++)
            if (graph->to[e] > v && part[graph->to[e]] != part[v]) quality.cut += graph->edge[e];
    }
    for (int p = 0; p < n_parts; p++) quality.n_empty += !used[p];
    const int64_t all = bt_cut_sum(sum);
    if (all > 0) quality.imbalance = (double)bt_cut_sum(heaviest_of(load, NULL, n_parts)) * n_parts / (double)all - 1;
    free(load);
    free(used);
    return quality;
}

bool bt_cut_is_valid(const bt_graph *graph, int n_parts, const int *part)
{
    for (int v = 0; v < graph->n; v++)
        if (part[v] < 0 || part[v] >= n_parts) return false;
    int *of = bt_alloc((size_t)graph->n, sizeof *of), n = contracted_numbers(graph, of);
    int *label = bt_alloc((size_t)n, sizeof *label);
    bool good = true;
    for (int c = 0; c < n; c++) label[c] = -1;
    for (int v = 0; v < graph->n; v++) {
        if (label[of[v]] < 0) label[of[v]] = part[v];
        else good = good && label[of[v]] == part[v];
    }
    free(of);
    free(label);
    return good && (n < n_parts || bt_cut_measure(graph, n_parts, part, NULL).n_empty == 0);
}
