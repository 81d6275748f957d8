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
static void spread(bt_no_go *no_go, int64_t k, int64_t *next)
{
    const double *p = no_go->edge[2 * k], *q = no_go->edge[2 * k + 1], s = 1 / no_go->size;
    const double low[2] = {bt_min(p[0], q[0]) - no_go->far - no_go->x0, bt_min(p[1], q[1]) - no_go->far - no_go->y0};
    const double high[2] = {bt_max(p[0], q[0]) + no_go->far - no_go->x0, bt_max(p[1], q[1]) + no_go->far - no_go->y0};
    if (high[0] < 0 || high[1] < 0 || low[0] * s > no_go->nx || low[1] * s > no_go->ny) return;
    for (int j = clamped(low[1] * s, no_go->ny); j <= clamped(high[1] * s, no_go->ny); j++)
        for (int i = clamped(low[0] * s, no_go->nx); i <= clamped(high[0] * s, no_go->nx); i++) {
            const int64_t b = (int64_t)j * no_go->nx + i;
            if (next) no_go->list[next[b]++] = (int32_t)k;
            else no_go->first[b + 1]++;
        }
}

void bt_no_go_make(bt_no_go *no_go, const bt_route_task *task)
{
    const double *e = task->extent, wide = e[2] - e[0], high = e[3] - e[1];
    *no_go = (bt_no_go){.task = task, .need = task->reach + task->clearance};
    for (int64_t i = 0; i < task->n_no_go; i++) no_go->n += task->no_go_first[i + 1] - task->no_go_first[i];
    no_go->edge = bt_alloc((size_t)no_go->n + 1, 2 * sizeof *no_go->edge);
    int64_t at = 0;
    for (int64_t i = 0; i < task->n_no_go; i++)
        for (int64_t k = task->no_go_first[i]; k < task->no_go_first[i + 1]; k++) {
            no_go->edge[at++] = task->no_go + 2 * k;
            no_go->edge[at++] = task->no_go + 2 * (k + 1 < task->no_go_first[i + 1] ? k + 1 : task->no_go_first[i]);
        }
    no_go->size = bt_max(no_go->need, bt_max(wide, high) / 64);
    no_go->far = no_go->need + no_go->size;
    no_go->x0 = e[0], no_go->y0 = e[1];
    no_go->nx = (int)(wide / no_go->size) + 1, no_go->ny = (int)(high / no_go->size) + 1;
    const int64_t buckets = (int64_t)no_go->nx * no_go->ny;
    no_go->first = bt_alloc((size_t)buckets + 1, sizeof *no_go->first);
    for (int64_t k = 0; k < no_go->n; k++) spread(no_go, k, NULL);
    for (int64_t b = 0; b < buckets; b++) no_go->first[b + 1] += no_go->first[b];
    no_go->list = bt_alloc((size_t)no_go->first[buckets] + 1, sizeof *no_go->list);
    int64_t *next = bt_alloc((size_t)buckets + 1, sizeof *next);
    for (int64_t b = 0; b < buckets; b++) next[b] = no_go->first[b];
    for (int64_t k = 0; k < no_go->n; k++) spread(no_go, k, next);
    free(next);
}

void bt_no_go_free(bt_no_go *no_go)
{
    free(no_go->edge);
    free(no_go->first);
    free(no_go->list);
}

double bt_no_go_to_edge(const bt_no_go *no_go, int64_t k, double x, double y)
{
    const double *p = no_go->edge[2 * k], *q = no_go->edge[2 * k + 1], ex = q[0] - p[0], ey = q[1] - p[1];
    const double square = ex * ex + ey * ey, dot = (x - p[0]) * ex + (y - p[1]) * ey;
    const double f = dot <= 0 || !(square > 0) ? 0 : dot >= square ? 1 : dot / square;
    return bt_hypot(x - p[0] - f * ex, y - p[1] - f * ey);
}

double bt_no_go_distance(const bt_no_go *no_go, double x, double y)
{
    double least = no_go->far;
    if (no_go->n == 0) return least;
    const double i = (x - no_go->x0) / no_go->size, j = (y - no_go->y0) / no_go->size;
    if (i < 0 || j < 0 || i >= no_go->nx || j >= no_go->ny) {
        for (int64_t k = 0; k < no_go->n; k++) least = bt_min(least, bt_no_go_to_edge(no_go, k, x, y));
        return least;
    }
    const int64_t b = (int64_t)(int)j * no_go->nx + (int)i;
    for (int64_t k = no_go->first[b]; k < no_go->first[b + 1]; k++)
        least = bt_min(least, bt_no_go_to_edge(no_go, no_go->list[k], x, y));
    return least;
}

bool bt_no_go_inside(const bt_no_go *no_go, double x, double y)
{
    const bt_route_task *task = no_go->task;
    int64_t k = 0;
    for (int64_t i = 0; i < task->n_no_go; i++) { // each polygon by itself: two that overlap leave no free water
        bool inside = false;
        for (int64_t m = task->no_go_first[i]; m < task->no_go_first[i + 1]; m++, k++) {
            const double *p = no_go->edge[2 * k], *q = no_go->edge[2 * k + 1];
            if ((p[1] > y) != (q[1] > y) && x < p[0] + (y - p[1]) * (q[0] - p[0]) / (q[1] - p[1])) inside = !inside;
        }
        if (inside) return true;
    }
    return false;
}

double bt_no_go_margin(const bt_no_go *no_go, double x, double y)
{
    const double *e = no_go->task->extent;
    return bt_min(bt_min(x - e[0], e[2] - x), bt_min(y - e[1], e[3] - y)) - no_go->task->reach;
}

bool bt_no_go_clear(const bt_no_go *no_go, double x, double y, double half, double t, double v)
{
    const double *u = no_go->task->drift;
    if (bt_no_go_margin(no_go, x, y) < half) return false;
    return no_go->n == 0 ||
           bt_no_go_distance(no_go, x + u[0] * t, y + u[1] * t) - no_go->need > half * (1 + bt_hypot(u[0], u[1]) / v);
}

static int faults_of(const bt_no_go *no_go, const bt_leg *leg, double s0, double s1, double t, double v, int asked)
{
    double at[2], tangent[2];
    const double *u = no_go->task->drift, mid = 0.5 * (s0 + s1), half = 0.5 * (s1 - s0), now = t + mid / v;
    bt_leg_at(leg, mid, at, tangent);
    const double over_ground = half * (1 + bt_hypot(u[0], u[1]) / v), fine = FINE * no_go->need;
    int found = 0, open = 0;
    if (asked & BT_ROUTE_OUTSIDE) {
        double d = bt_no_go_margin(no_go, at[0], at[1]);
        if (leg->turn == 0) { // the extent is convex: a straight leg has both ends in it, or is not in it
            for (int end = 0; end < 2; end++) {
                bt_leg_at(leg, end ? s1 : s0, at, tangent);
                d = bt_min(d, bt_no_go_margin(no_go, at[0], at[1]));
            }
            bt_leg_at(leg, mid, at, tangent);
        }
        if (d < -1e-9 * no_go->need) found |= BT_ROUTE_OUTSIDE;
        else if (leg->turn != 0 && d < half && half > fine) open |= BT_ROUTE_OUTSIDE;
    }
    if (asked & BT_ROUTE_IN_NO_GO) {
        const double d = bt_no_go_distance(no_go, at[0] + u[0] * now, at[1] + u[1] * now) - no_go->need;
        if (d < 0) found |= BT_ROUTE_IN_NO_GO;
        else if (d < over_ground) {
            if (over_ground > fine) open |= BT_ROUTE_IN_NO_GO;
            else found |= BT_ROUTE_IN_NO_GO;
        }
    }
    if (open) found |= faults_of(no_go, leg, s0, mid, t, v, open);
    if (open & ~found) found |= faults_of(no_go, leg, mid, s1, t, v, open & ~found);
    return found;
}

int bt_no_go_faults(const bt_no_go *no_go, const bt_leg *leg, double length, double t, double v)
{
    return faults_of(no_go, leg, 0, length, t, v, BT_ROUTE_OUTSIDE | (no_go->n ? BT_ROUTE_IN_NO_GO : 0));
}
