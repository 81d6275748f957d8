// SPDX-License-Identifier: MIT
// Shifts vertices between neighbour parts: first for balance, then for a smaller cut.
//
// Balance. The heaviest part is to lose weight, but its neighbours may be full themselves. So a search from neighbour
// to neighbour finds the nearest parts lighter than a share, and one vertex is shifted along every link of the way
// there (diffusion along a shortest path). A shift counts only if every part on its way then weighs less than the
// heaviest did: the sorted loads fall, so it ends. Rejected: moving vertices only from a part to a lighter neighbour;
// with some ten cells a part it stops with slopes of one cell a part over the whole field.
// Cut. A vertex goes to the neighbour part that it has more edges with, as long as that stays within the limit
// (the greedy pass of Karypis & Kumar 1998).
#include "partition/cut.h"

#include <stdlib.h>

#include "bergtow/base.h"

enum {
    ENDS_TRIED = 32, // light parts tried as the end of one way
    SHIFTS = 64,     // a part, at most
    CUT_PASSES = 8,  // over all vertices; later ones found next to nothing in trials
};

typedef struct parts {
    const bt_graph *g;
    int n, *part;
    int64_t share, limit;
    int64_t *load;           // [n]
    int *count;              // [n] vertices
    int *head, *next, *prev; // [n], [g->n], [g->n]: vertices of a part as a list
    int *from, *queue;       // [n]: part before on the way from the heaviest (−1 not reached), parts reached in order
    int64_t *link;           // [n] scratch: edges of one vertex with each part, 0 outside of use
    bool *stuck;             // [n] nothing could be shifted away since it last changed
} parts;

static void list_add(parts *p, int v)
{
    int a = p->part[v];
    p->prev[v] = -1;
    p->next[v] = p->head[a];
    if (p->head[a] >= 0) p->prev[p->head[a]] = v;
    p->head[a] = v;
    p->load[a] += p->g->weight[v];
    p->count[a]++;
}

static void list_remove(parts *p, int v)
{
    int a = p->part[v];
    if (p->prev[v] >= 0) p->next[p->prev[v]] = p->next[v];
    else p->head[a] = p->next[v];
    if (p->next[v] >= 0) p->prev[p->next[v]] = p->prev[v];
    p->load[a] -= p->g->weight[v];
    p->count[a]--;
}

static void shift(parts *p, int v, int b)
{
    list_remove(p, v);
    p->part[v] = b;
    list_add(p, v);
}

// Vertex of a to give to its neighbour b, −1 if none: one that brings a within the limit (and, where b is the end of
// the way, keeps b within it) before others, and of those the one that lowers the cut most. With `nearest` the one
// whose weight is nearest to what a has too much: the first rule may offer nothing but a berg's cells.
static int vertex_to_give(const parts *p, int a, int b, bool end, bool nearest)
{
    const bt_graph *g = p->g;
    int best = -1, best_fit = 0;
    int64_t best_gain = 0;
    for (int v = p->head[a]; v >= 0; v = p->next[v]) {
        int64_t w = g->weight[v], gain = 0;
        bool touches = false;
        if (w == 0) continue;
        for (int e = g->start[v]; e < g->start[v + 1]; e++) {
            int u = g->to[e];
            if (u == v) continue;
            if (p->part[u] == b) touches = true, gain += g->edge[e];
            else if (p->part[u] == a) gain -= g->edge[e];
        }
        if (!touches) continue;
        int fit = (p->load[a] - w <= p->limit) + (!end || p->load[b] + w <= p->limit);
        if (nearest) fit = 0, gain = -llabs(p->load[a] - w - p->limit);
        if (best < 0 || fit > best_fit || (fit == best_fit && (gain > best_gain || (gain == best_gain && v < best))))
            best = v, best_fit = fit, best_gain = gain;
    }
    return best;
}

// Shift one vertex along every link of the way from `heavy` to `end`; undone and false if that does not help.
static bool shift_along(parts *p, int heavy, int end, bool nearest)
{
    int n_way = 0, *way = bt_alloc((size_t)p->n, sizeof *way), *given = bt_alloc((size_t)p->n, sizeof *given);
    for (int a = end; a != heavy; a = p->from[a]) way[n_way++] = a;
    int64_t before = p->load[heavy];
    int a = heavy, n_given = 0;
    bool good = true;
    for (int i = n_way - 1; good && i >= 0; i--) {
        int v = vertex_to_give(p, a, way[i], i == 0, nearest);
        good = v >= 0;
        if (!good) break;
        given[n_given++] = v;
        shift(p, v, way[i]);
        good = p->load[a] < before && p->count[a] > 0;
        a = way[i];
    }
    good = good && p->load[end] < before;
    for (int i = n_given - 1; !good && i >= 0; i--) shift(p, given[i], i ? way[n_way - i] : heavy);
    for (int i = 0; good && i < n_way; i++) p->stuck[way[i]] = false;
    free(way);
    free(given);
    return good;
}

static bool relieve(parts *p, int heavy)
{
    const bt_graph *g = p->g;
    int n_reached = 0, n_tried = 0;
    bool done = false;
    p->from[heavy] = heavy;
    p->queue[n_reached++] = heavy;
    for (int i = 0; !done && i < n_reached && n_tried < ENDS_TRIED; i++) {
        int a = p->queue[i];
        if (p->load[a] < p->share) {
            done = shift_along(p, heavy, a, false) || shift_along(p, heavy, a, true);
            n_tried++;
            if (done) break;
        }
        for (int v = p->head[a]; v >= 0; v = p->next[v])
            for (int e = g->start[v]; e < g->start[v + 1]; e++) {
                int b = p->part[g->to[e]];
                if (p->from[b] >= 0) continue;
                p->from[b] = a;
                p->queue[n_reached++] = b;
            }
    }
    for (int i = 0; i < n_reached; i++) p->from[p->queue[i]] = -1;
    return done;
}

static void balance(parts *p)
{
    for (int64_t i = 0; i < (int64_t)SHIFTS * p->n; i++) {
        int heavy = -1;
        for (int a = 0; a < p->n; a++)
            if (p->load[a] > p->limit && p->count[a] > 1 && !p->stuck[a] && (heavy < 0 || p->load[a] > p->load[heavy]))
                heavy = a;
        if (heavy < 0) return;
        p->stuck[heavy] = !relieve(p, heavy);
    }
}

// Part that v would do better in, −1 if none.
static int better_part(parts *p, int v)
{
    const bt_graph *g = p->g;
    int a = p->part[v], best = -1, first = g->start[v], last = g->start[v + 1];
    if (p->count[a] == 1) return -1;
    for (int e = first; e < last; e++)
        if (g->to[e] != v) p->link[p->part[g->to[e]]] += g->edge[e];
    int64_t most = p->link[a];
    for (int e = first; e < last; e++) {
        int b = p->part[g->to[e]];
        if (b == a || p->load[b] + g->weight[v] > p->limit) continue;
        if (p->link[b] > most || (p->link[b] == most && best >= 0 && b < best)) best = b, most = p->link[b];
    }
    for (int e = first; e < last; e++) p->link[p->part[g->to[e]]] = 0;
    return best;
}

static void lower_cut(parts *p)
{
    bool changed = true;
    for (int pass = 0; changed && pass < CUT_PASSES; pass++) {
        changed = false;
        for (int v = 0; v < p->g->n; v++) {
            int b = better_part(p, v);
            if (b < 0) continue;
            shift(p, v, b);
            changed = true;
        }
    }
}

void bt_cut_refine(const bt_graph *g, int n_parts, int64_t share, int64_t limit, int *part)
{
    size_t n = (size_t)n_parts;
    parts p = {.g = g, .n = n_parts, .part = part, .share = share, .limit = limit};
    p.load = bt_alloc(n, sizeof *p.load);
    p.count = bt_alloc(n, sizeof *p.count);
    p.head = bt_alloc(n, sizeof *p.head);
    p.next = bt_alloc((size_t)g->n, sizeof *p.next);
    p.prev = bt_alloc((size_t)g->n, sizeof *p.prev);
    p.from = bt_alloc(n, sizeof *p.from);
    p.queue = bt_alloc(n, sizeof *p.queue);
    p.link = bt_alloc(n, sizeof *p.link);
    p.stuck = bt_alloc(n, sizeof *p.stuck);
    for (int a = 0; a < n_parts; a++) p.head[a] = p.from[a] = -1;
    for (int v = g->n - 1; v >= 0; v--) list_add(&p, v);
    balance(&p);
    lower_cut(&p);
    free(p.load);
    free(p.count);
    free(p.head);
    free(p.next);
    free(p.prev);
    free(p.from);
    free(p.queue);
    free(p.link);
    free(p.stuck);
}
