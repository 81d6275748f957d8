// SPDX-License-Identifier: MIT
// Shifts vertices between neighbour parts: first for balance, then for a smaller cut.
//
// Balance. The heaviest part must lose weight, but its neighbours may be full themselves. So a search from neighbour to
// neighbour finds the nearest parts lighter than a share, and one vertex is shifted along every link of the path there
// (diffusion along a shortest path). With several kinds of work, parts are compared by their excess: the weight above
// the share, of the kind in which it is largest. A shift is accepted only if the excess of every part on its path is
// then less than that of the heaviest was: the sorted excesses decrease, so it terminates. Rejected: moving vertices
// only from a part to a lighter neighbour; with some ten cells per part it stops with slopes of one cell per part over
// the whole field.
// Cut. A vertex moves to the neighbouring part with which it has more edges, as long as that stays within the limit
// (the greedy pass of Karypis & Kumar 1998).
#include "partition/cut.h"

#include "bergtow/base.h"
#include "base/inside.h"

enum {
    ENDS_TRIED = 32, // light parts tried as the end of one path
    SHIFTS = 64,     // per part, at most
    CUT_PASSES = 8,  // over all vertices; later ones found next to nothing in trials
};

typedef struct parts {
    const bt_graph *g;
    int n, *part;
    bt_cut_work share;
    int64_t slack;
    bt_cut_work *load;           // [n]
    int *count;              // [n] vertices
    int *head, *next, *prev; // [n], [g->n], [g->n]: vertices of a part as a list
    int *from, *queue;       // [n]: previous part on the path from the heaviest (−1: none), parts reached in order
    int64_t *link;           // [n] scratch: edges of one vertex with each part, 0 outside of use
    bool *stuck;             // [n] nothing could be shifted away since its last change
} parts;

static void list_add(parts *lists, int v)
{
    int a = lists->part[v];
    lists->prev[v] = -1;
    lists->next[v] = lists->head[a];
    if (lists->head[a] >= 0) lists->prev[lists->head[a]] = v;
    lists->head[a] = v;
    bt_cut_add(&lists->load[a], lists->g->weight[v], 1);
    lists->count[a]++;
}

static void list_remove(parts *lists, int v)
{
    int a = lists->part[v];
    if (lists->prev[v] >= 0) lists->next[lists->prev[v]] = lists->next[v];
    else lists->head[a] = lists->next[v];
    if (lists->next[v] >= 0) lists->prev[lists->next[v]] = lists->prev[v];
    bt_cut_add(&lists->load[a], lists->g->weight[v], -1);
    lists->count[a]--;
}

static void shift(parts *lists, int v, int b)
{
    list_remove(lists, v);
    lists->part[v] = b;
    list_add(lists, v);
}

// The kind with the largest excess.
static int worst_kind(const parts *lists, bt_cut_work load)
{
    int worst = 0;
    for (int k = 1; k < BT_CUT_KINDS; k++)
        if (load.of[k] - lists->share.of[k] > load.of[worst] - lists->share.of[worst]) worst = k;
    return worst;
}

// The excess of a load.
static int64_t excess(const parts *lists, bt_cut_work load)
{
    const int k = worst_kind(lists, load);
    return load.of[k] - lists->share.of[k];
}

// The same of part a, with `times` the weight of vertex v added.
static int64_t excess_with(const parts *lists, int a, int v, int times)
{
    bt_cut_work load = lists->load[a];
    bt_cut_add(&load, lists->g->weight[v], times);
    return excess(lists, load);
}

// Vertex of a with work of a kind to give to its neighbour b, −1 if none: preferably one that brings a within the slack
// (and, if b is the end of the path, keeps b within it), and among these the vertex that lowers the cut most. With
// `nearest` the vertex whose weight is nearest to the excess of a: the first rule may offer only a berg's cells.
static int vertex_to_give(const parts *lists, int kind, int a, int b, bool end, bool nearest)
{
    const bt_graph *graph = lists->g;
    int best = -1, best_fit = 0;
    int64_t best_gain = 0;
    for (int v = lists->head[a]; v >= 0; v = lists->next[v]) {
        int64_t w = graph->weight[v].of[kind], gain = 0;
        bool touches = false;
        if (w == 0) continue;
        for (int e = graph->start[v]; e < graph->start[v + 1]; e++) {
            int u = graph->to[e];
            if (u == v) continue;
            if (lists->part[u] == b) touches = true, gain += graph->edge[e];
            else if (lists->part[u] == a) gain -= graph->edge[e];
        }
        if (!touches) continue;
        int fit = (excess_with(lists, a, v, -1) <= lists->slack) +
                  (!end || excess_with(lists, b, v, 1) <= lists->slack);
        if (nearest) fit = 0, gain = -llabs(lists->load[a].of[kind] - w - lists->share.of[kind] - lists->slack);
        if (best < 0 || fit > best_fit || (fit == best_fit && (gain > best_gain || (gain == best_gain && v < best))))
            best = v, best_fit = fit, best_gain = gain;
    }
    return best;
}

// Shift one vertex along every link of the path from `heavy` to `end`; if that does not help, undo it and return false.
static bool shift_along(parts *lists, int kind, int heavy, int end, bool nearest)
{
    int n_way = 0, *way = bt_alloc((size_t)lists->n, sizeof *way), *given = bt_alloc((size_t)lists->n, sizeof *given);
    for (int a = end; a != heavy; a = lists->from[a]) way[n_way++] = a;
    const int64_t before = excess(lists, lists->load[heavy]);
    int a = heavy, n_given = 0;
    bool good = true;
    for (int i = n_way - 1; good && i >= 0; i--) {
        int v = vertex_to_give(lists, kind, a, way[i], i == 0, nearest);
        good = v >= 0;
        if (!good) break;
        given[n_given++] = v;
        shift(lists, v, way[i]);
        good = excess(lists, lists->load[a]) < before && lists->count[a] > 0;
        a = way[i];
    }
    good = good && excess(lists, lists->load[end]) < before;
    for (int i = n_given - 1; !good && i >= 0; i--) shift(lists, given[i], i ? way[n_way - i] : heavy);
    for (int i = 0; good && i < n_way; i++) lists->stuck[way[i]] = false;
    free(way);
    free(given);
    return good;
}

static bool relieve(parts *lists, int heavy)
{
    const bt_graph *graph = lists->g;
    const int kind = worst_kind(lists, lists->load[heavy]);
    int n_reached = 0, n_tried = 0;
    bool done = false;
    lists->from[heavy] = heavy;
    lists->queue[n_reached++] = heavy;
    for (int i = 0; !done && i < n_reached && n_tried < ENDS_TRIED; i++) {
        int a = lists->queue[i];
        if (lists->load[a].of[kind] < lists->share.of[kind]) {
            done = shift_along(lists, kind, heavy, a, false) || shift_along(lists, kind, heavy, a, true);
            n_tried++;
            if (done) break;
        }
        for (int v = lists->head[a]; v >= 0; v = lists->next[v])
            for (int e = graph->start[v]; e < graph->start[v + 1]; e++) {
                int b = lists->part[graph->to[e]];
                if (lists->from[b] >= 0) continue;
                lists->from[b] = a;
                lists->queue[n_reached++] = b;
            }
    }
    for (int i = 0; i < n_reached; i++) lists->from[lists->queue[i]] = -1;
    return done;
}

static void balance(parts *lists)
{
    for (int64_t i = 0; i < (int64_t)SHIFTS * lists->n; i++) {
        int heavy = -1;
        for (int a = 0; a < lists->n; a++)
            if (excess(lists, lists->load[a]) > lists->slack && lists->count[a] > 1 && !lists->stuck[a] &&
                (heavy < 0 || excess(lists, lists->load[a]) > excess(lists, lists->load[heavy])))
                heavy = a;
        if (heavy < 0) return;
        lists->stuck[heavy] = !relieve(lists, heavy);
    }
}

// Part that would suit v better, −1 if none.
static int better_part(parts *lists, int v)
{
    const bt_graph *graph = lists->g;
    int a = lists->part[v], best = -1, first = graph->start[v], last = graph->start[v + 1];
    if (lists->count[a] == 1) return -1;
    for (int e = first; e < last; e++)
        if (graph->to[e] != v) lists->link[lists->part[graph->to[e]]] += graph->edge[e];
    int64_t most = lists->link[a];
    for (int e = first; e < last; e++) {
        int b = lists->part[graph->to[e]];
        if (b == a || excess_with(lists, b, v, 1) > lists->slack) continue;
        if (lists->link[b] > most || (lists->link[b] == most && best >= 0 && b < best)) best = b, most = lists->link[b];
    }
    for (int e = first; e < last; e++) lists->link[lists->part[graph->to[e]]] = 0;
    return best;
}

static void lower_cut(parts *lists)
{
    bool changed = true;
    for (int pass = 0; changed && pass < CUT_PASSES; pass++) {
        changed = false;
        for (int v = 0; v < lists->g->n; v++) {
            int b = better_part(lists, v);
            if (b < 0) continue;
            shift(lists, v, b);
            changed = true;
        }
    }
}

void bt_cut_refine(const bt_graph *graph, int n_parts, bt_cut_work share, int64_t slack, int *part)
{
    size_t n = (size_t)n_parts;
    parts lists = {.g = graph, .n = n_parts, .part = part, .share = share, .slack = slack};
    lists.load = bt_alloc(n, sizeof *lists.load);
    lists.count = bt_alloc(n, sizeof *lists.count);
    lists.head = bt_alloc(n, sizeof *lists.head);
    lists.next = bt_alloc((size_t)graph->n, sizeof *lists.next);
    lists.prev = bt_alloc((size_t)graph->n, sizeof *lists.prev);
    lists.from = bt_alloc(n, sizeof *lists.from);
    lists.queue = bt_alloc(n, sizeof *lists.queue);
    lists.link = bt_alloc(n, sizeof *lists.link);
    lists.stuck = bt_alloc(n, sizeof *lists.stuck);
    for (int a = 0; a < n_parts; a++) lists.head[a] = lists.from[a] = -1;
    for (int v = graph->n - 1; v >= 0; v--) list_add(&lists, v);
    balance(&lists);
    lower_cut(&lists);
    BT_FREE(lists.load, lists.count, lists.head, lists.next, lists.prev, lists.from, lists.queue, lists.link,
            lists.stuck);
}
