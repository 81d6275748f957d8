// SPDX-License-Identifier: MIT
// Line-of-sight shortening and a compass search over the corners of a path; route/shorten.h.
//
// Each step is taken when the cost of the whole path, its swath and its constraints, falls. Rejected: a spline by a
// solver of nonlinear programmes, for the cost of ice has no gradient that leads anywhere at the size of floes; and
// shortening by sight alone, which cuts through the ice that the search went round.
#include "route/shorten.h"

#include "base/elementary.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ROUNDS = 4, SWEEPS = 12 };

bool bt_way_path(const bt_planner *p, const bt_way *w, bt_path *path)
{
    char why[200];
    return bt_path_make(path, p->task.start[0], p->task.start[1], w->n, w->point[0], p->task.radius, why);
}

void bt_way_price(const bt_planner *p, bt_way *w)
{
    bt_path path;
    if (!bt_way_path(p, w, &path)) {
        w->cost = (bt_path_cost){.faults = BT_ROUTE_TURNS, .cost = INFINITY, .time = w->cost.time};
        return;
    }
    w->cost = bt_swath_cost(p, path.n - 1, path.leg, NULL);
    bt_path_free(&path);
}

void bt_way_copy(bt_way *to, const bt_way *from)
{
    if (to->cap < from->n + 1) to->point = bt_realloc(to->point, (size_t)(to->cap = from->n + 16), sizeof *to->point);
    memcpy(to->point, from->point, (size_t)from->n * sizeof *to->point);
    to->n = from->n;
    to->cost = from->cost;
}

void bt_way_goal(const bt_planner *p, double t, double x, double y, double goal[2])
{
    const double *g = p->task.goal, *u = p->task.drift;
    goal[0] = g[0] - u[0] * t, goal[1] = g[1] - u[1] * t;
    if (!p->task.goal_is_line) return;
    const double ex = g[2] - g[0], ey = g[3] - g[1], square = ex * ex + ey * ey;
    const double dot = (x - goal[0]) * ex + (y - goal[1]) * ey;
    const double f = dot <= 0 || !(square > 0) ? 0 : dot >= square ? 1 : dot / square;
    goal[0] += f * ex, goal[1] += f * ey;
}

/// The end of a way put where the goal is at the time of arrival.
static void end_at_goal(const bt_planner *p, bt_way *w)
{
    enum { STEPS = 40 };
    const double *u = p->task.drift, fine = 1e-9 * p->task.width;
    double *end = w->point[w->n - 1];
    for (int k = 0; k < STEPS; k++) {
        const double was[2] = {end[0], end[1]};
        bt_way_goal(p, w->cost.time, was[0], was[1], end);
        bt_way_price(p, w);
        if ((u[0] == 0 && u[1] == 0) || bt_hypot(end[0] - was[0], end[1] - was[1]) < fine) return;
    }
}

/// Takes `tried` when it is better, or has fewer corners and is not worse.
static bool take(const bt_planner *p, bt_way *w, bt_way *tried)
{
    bt_way_price(p, tried);
    bool better = bt_swath_better(&tried->cost, &w->cost);
    if (!better && tried->n < w->n && !bt_swath_better(&w->cost, &tried->cost)) better = true;
    if (better) bt_way_copy(w, tried);
    return better;
}

/// Way-points before this one stay.
static int first_free(const bt_planner *p)
{
    return isnan(p->task.start_heading) ? 0 : 1;
}

static bool leave_out(const bt_planner *p, bt_way *w, bt_way *tried)
{
    bool any = false;
    for (int span = w->n - 1; span >= 1; span = span > 8 ? span * 2 / 3 : span - 1)
        for (int k = first_free(p); k + span < w->n;) {
            bt_way_copy(tried, w);
            memmove(tried->point[k], tried->point[k + span], (size_t)(w->n - k - span) * sizeof *w->point);
            tried->n -= span;
            if (take(p, w, tried)) any = true;
            else k++;
        }
    return any;
}

/// Steps of the way-point k, to eight sides; the first stays on a given heading, and the end on the goal's line.
static bool move_one(const bt_planner *p, bt_way *w, bt_way *tried, int k, double step)
{
    const double *g = p->task.goal, ex = g[2] - g[0], ey = g[3] - g[1], line = bt_hypot(ex, ey);
    const bool end = k == w->n - 1, ray = k < first_free(p);
    if (end && (ray || !p->task.goal_is_line || !(line > 0))) return false;
    bool any = false;
    for (int side = 0; side < (end || ray ? 2 : 8); side++) {
        static const double to[8][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}};
        const double along = step * to[side][0], aside = step * to[side][1];
        bt_way_copy(tried, w);
        double *at = tried->point[k];
        if (end) {
            at[0] += along * ex / line, at[1] += along * ey / line;
            bt_way_goal(p, w->cost.time, at[0], at[1], at);
        } else {
            at[0] += along * p->ice.ax - aside * p->ice.ay, at[1] += along * p->ice.ay + aside * p->ice.ax;
        }
        if (take(p, w, tried)) any = true, side = -1; // once more in the same sense
    }
    return any;
}

static bool move_all(const bt_planner *p, bt_way *w, bt_way *tried)
{
    bool any = false;
    for (double step = 2 * p->task.width; step > p->task.width / 100; step *= 0.5)
        for (int sweep = 0; sweep < SWEEPS; sweep++) {
            bool moved = false;
            for (int k = 0; k < w->n; k++) moved = move_one(p, w, tried, k, step) || moved;
            if (!moved) break;
            any = true;
        }
    return any;
}

/// A corner in the middle of a long leg, where it finds a better place than on it.
static bool put_in(const bt_planner *p, bt_way *w, bt_way *tried)
{
    bool any = false;
    bt_way with = {0};
    for (int k = first_free(p); k < w->n; k++) {
        const double *a = k ? w->point[k - 1] : p->task.start, *b = w->point[k];
        if (bt_hypot(b[0] - a[0], b[1] - a[1]) < 4 * p->task.width) continue;
        bt_way_copy(&with, w);
        memmove(with.point[k + 1], with.point[k], (size_t)(w->n - k) * sizeof *w->point);
        with.point[k][0] = 0.5 * (a[0] + b[0]), with.point[k][1] = 0.5 * (a[1] + b[1]);
        with.n++;
        bt_way_price(p, &with);
        for (double step = 2 * p->task.width; step > p->task.width / 10; step *= 0.5)
            move_one(p, &with, tried, k, step);
        // worth a corner
        if (with.cost.cost < w->cost.cost * (1 - 1e-4) && bt_swath_better(&with.cost, &w->cost)) {
            bt_way_copy(w, &with);
            any = true;
        }
    }
    free(with.point);
    return any;
}

void bt_way_shorten(const bt_planner *p, bt_way *w)
{
    bt_way tried = {0};
    end_at_goal(p, w);
    for (int round = 0; round < ROUNDS; round++) {
        bool any = leave_out(p, w, &tried);
        any = move_all(p, w, &tried) || any;
        any = put_in(p, w, &tried) || any;
        end_at_goal(p, w);
        if (!any) break;
    }
    free(tried.point);
}
