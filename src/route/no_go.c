// SPDX-License-Identifier: MIT
// Distances to no-go polygons by buckets of their edges; route/no_go.h.
#include "route/no_go.h"

#include "base/elementary.h"

#include <math.h>
#include <stdlib.h>

#define FINE 1e-3 ///< of what the hull needs

static int clamped(double x, int n)
{
    return x < 0 ? 0 : x >= n ? n - 1 : (int)x;
}

/// Marks the buckets within `far` of edge k: counts them in first[b + 1], or lists the edge at first[b].
static void spread(bt_no_go *g, int64_t k, int64_t *next)
{
    const double *p = g->edge[2 * k], *q = g->edge[2 * k + 1], s = 1 / g->size;
    const double low[2] = {bt_min(p[0], q[0]) - g->far - g->x0, bt_min(p[1], q[1]) - g->far - g->y0};
    const double high[2] = {bt_max(p[0], q[0]) + g->far - g->x0, bt_max(p[1], q[1]) + g->far - g->y0};
    if (high[0] < 0 || high[1] < 0 || low[0] * s > g->nx || low[1] * s > g->ny) return;
    for (int j = clamped(low[1] * s, g->ny); j <= clamped(high[1] * s, g->ny); j++)
        for (int i = clamped(low[0] * s, g->nx); i <= clamped(high[0] * s, g->nx); i++) {
            const int64_t b = (int64_t)j * g->nx + i;
            if (next) g->list[next[b]++] = (int32_t)k;
            else g->first[b + 1]++;
        }
}

void bt_no_go_make(bt_no_go *g, const bt_route_task *t)
{
    const double *e = t->extent, wide = e[2] - e[0], high = e[3] - e[1];
    *g = (bt_no_go){.task = t, .need = t->reach + t->clearance};
    for (int64_t i = 0; i < t->n_no_go; i++) g->n += t->no_go_first[i + 1] - t->no_go_first[i];
    g->edge = bt_alloc((size_t)g->n + 1, 2 * sizeof *g->edge);
    int64_t at = 0;
    for (int64_t i = 0; i < t->n_no_go; i++)
        for (int64_t k = t->no_go_first[i]; k < t->no_go_first[i + 1]; k++) {
            g->edge[at++] = t->no_go + 2 * k;
            g->edge[at++] = t->no_go + 2 * (k + 1 < t->no_go_first[i + 1] ? k + 1 : t->no_go_first[i]);
        }
    g->size = bt_max(g->need, bt_max(wide, high) / 64);
    g->far = g->need + g->size;
    g->x0 = e[0], g->y0 = e[1];
    g->nx = (int)(wide / g->size) + 1, g->ny = (int)(high / g->size) + 1;
    const int64_t buckets = (int64_t)g->nx * g->ny;
    g->first = bt_alloc((size_t)buckets + 1, sizeof *g->first);
    for (int64_t k = 0; k < g->n; k++) spread(g, k, NULL);
    for (int64_t b = 0; b < buckets; b++) g->first[b + 1] += g->first[b];
    g->list = bt_alloc((size_t)g->first[buckets] + 1, sizeof *g->list);
    int64_t *next = bt_alloc((size_t)buckets + 1, sizeof *next);
    for (int64_t b = 0; b < buckets; b++) next[b] = g->first[b];
    for (int64_t k = 0; k < g->n; k++) spread(g, k, next);
    free(next);
}

void bt_no_go_free(bt_no_go *g)
{
    free(g->edge);
    free(g->first);
    free(g->list);
}

double bt_no_go_to_edge(const bt_no_go *g, int64_t k, double x, double y)
{
    const double *p = g->edge[2 * k], *q = g->edge[2 * k + 1], ex = q[0] - p[0], ey = q[1] - p[1];
    const double square = ex * ex + ey * ey, dot = (x - p[0]) * ex + (y - p[1]) * ey;
    const double f = dot <= 0 || !(square > 0) ? 0 : dot >= square ? 1 : dot / square;
    return bt_hypot(x - p[0] - f * ex, y - p[1] - f * ey);
}

double bt_no_go_distance(const bt_no_go *g, double x, double y)
{
    double least = g->far;
    if (g->n == 0) return least;
    const double i = (x - g->x0) / g->size, j = (y - g->y0) / g->size;
    if (i < 0 || j < 0 || i >= g->nx || j >= g->ny) {
        for (int64_t k = 0; k < g->n; k++) least = bt_min(least, bt_no_go_to_edge(g, k, x, y));
        return least;
    }
    const int64_t b = (int64_t)(int)j * g->nx + (int)i;
    for (int64_t k = g->first[b]; k < g->first[b + 1]; k++)
        least = bt_min(least, bt_no_go_to_edge(g, g->list[k], x, y));
    return least;
}

bool bt_no_go_inside(const bt_no_go *g, double x, double y)
{
    const bt_route_task *t = g->task;
    int64_t k = 0;
    for (int64_t i = 0; i < t->n_no_go; i++) { // each polygon by itself: two that overlap leave no free water
        bool inside = false;
        for (int64_t m = t->no_go_first[i]; m < t->no_go_first[i + 1]; m++, k++) {
            const double *p = g->edge[2 * k], *q = g->edge[2 * k + 1];
            if ((p[1] > y) != (q[1] > y) && x < p[0] + (y - p[1]) * (q[0] - p[0]) / (q[1] - p[1])) inside = !inside;
        }
        if (inside) return true;
    }
    return false;
}

double bt_no_go_margin(const bt_no_go *g, double x, double y)
{
    const double *e = g->task->extent;
    return bt_min(bt_min(x - e[0], e[2] - x), bt_min(y - e[1], e[3] - y)) - g->task->reach;
}

bool bt_no_go_clear(const bt_no_go *g, double x, double y, double half, double t, double v)
{
    const double *u = g->task->drift;
    if (bt_no_go_margin(g, x, y) < half) return false;
    return g->n == 0 ||
           bt_no_go_distance(g, x + u[0] * t, y + u[1] * t) - g->need > half * (1 + bt_hypot(u[0], u[1]) / v);
}

static int faults_of(const bt_no_go *g, const bt_leg *leg, double s0, double s1, double t, double v, int asked)
{
    double at[2], tangent[2];
    const double *u = g->task->drift, mid = 0.5 * (s0 + s1), half = 0.5 * (s1 - s0), now = t + mid / v;
    bt_leg_at(leg, mid, at, tangent);
    const double over_ground = half * (1 + bt_hypot(u[0], u[1]) / v), fine = FINE * g->need;
    int found = 0, open = 0;
    if (asked & BT_ROUTE_OUTSIDE) {
        double d = bt_no_go_margin(g, at[0], at[1]);
        if (leg->turn == 0) { // the extent is convex: a straight leg has both ends in it, or is not in it
            for (int end = 0; end < 2; end++) {
                bt_leg_at(leg, end ? s1 : s0, at, tangent);
                d = bt_min(d, bt_no_go_margin(g, at[0], at[1]));
            }
            bt_leg_at(leg, mid, at, tangent);
        }
        if (d < -1e-9 * g->need) found |= BT_ROUTE_OUTSIDE;
        else if (leg->turn != 0 && d < half && half > fine) open |= BT_ROUTE_OUTSIDE;
    }
    if (asked & BT_ROUTE_IN_NO_GO) {
        const double d = bt_no_go_distance(g, at[0] + u[0] * now, at[1] + u[1] * now) - g->need;
        if (d < 0) found |= BT_ROUTE_IN_NO_GO;
        else if (d < over_ground) {
            if (over_ground > fine) open |= BT_ROUTE_IN_NO_GO;
            else found |= BT_ROUTE_IN_NO_GO;
        }
    }
    if (open) found |= faults_of(g, leg, s0, mid, t, v, open);
    if (open & ~found) found |= faults_of(g, leg, mid, s1, t, v, open & ~found);
    return found;
}

int bt_no_go_faults(const bt_no_go *g, const bt_leg *leg, double length, double t, double v)
{
    return faults_of(g, leg, 0, length, t, v, BT_ROUTE_OUTSIDE | (g->n ? BT_ROUTE_IN_NO_GO : 0));
}
