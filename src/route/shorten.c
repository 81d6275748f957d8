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

bool bt_way_path(const bt_planner *planner, const bt_way *way, bt_path *path)
{
    char why[200];
    return bt_path_make(path, planner->task.start[0], planner->task.start[1], way->n, way->point[0],
                        planner->task.radius, why);
}

void bt_way_price(const bt_planner *planner, bt_way *way)
{
    bt_path path;
    if (!bt_way_path(planner, way, &path)) {
        way->cost = (bt_path_cost){.faults = BT_ROUTE_TURNS, .cost = INFINITY, .time = way->cost.time};
        return;
    }
    way->cost = bt_swath_cost(planner, path.n - 1, path.leg, NULL);
    bt_path_free(&path);
}

void bt_way_copy(bt_way *to, const bt_way *from)
{
    if (to->cap < from->n + 1) to->point = bt_realloc(to->point, (size_t)(to->cap = from->n + 16), sizeof *to->point);
    memcpy(to->point, from->point, (size_t)from->n * sizeof *to->point);
    to->n = from->n;
    to->cost = from->cost;
}

void bt_way_goal(const bt_planner *planner, double t, double x, double y, double goal[2])
{
    const double *g = planner->task.goal, *u = planner->task.drift;
    goal[0] = g[0] - u[0] * t, goal[1] = g[1] - u[1] * t;
    if (!planner->task.goal_is_line) return;
    const double ex = g[2] - g[0], ey = g[3] - g[1], square = ex * ex + ey * ey;
    const double dot = (x - goal[0]) * ex + (y - goal[1]) * ey;
    const double f = dot <= 0 || !(square > 0) ? 0 : dot >= square ? 1 : dot / square;
    goal[0] += f * ex, goal[1] += f * ey;
}

/// The end of a way put where the goal is at the time of arrival.
static void end_at_goal(const bt_planner *planner, bt_way *way)
{
    enum { STEPS = 40 };
    const double *u = planner->task.drift, fine = 1e-9 * planner->task.width;
    double *end = way->point[way->n - 1];
    for (int k = 0; k < STEPS; k++) {
        const double was[2] = {end[0], end[1]};
        bt_way_goal(planner, way->cost.time, was[0], was[1], end);
        bt_way_price(planner, way);
        if ((u[0] == 0 && u[1] == 0) || bt_hypot(end[0] - was[0], end[1] - was[1]) < fine) return;
    }
}

/// Takes `tried` when it is better, or has fewer corners and is not worse.
static bool take(const bt_planner *planner, bt_way *way, bt_way *tried)
{
    bt_way_price(planner, tried);
    bool better = bt_swath_better(&tried->cost, &way->cost);
    if (!better && tried->n < way->n && !bt_swath_better(&way->cost, &tried->cost)) better = true;
    if (better) bt_way_copy(way, tried);
    return better;
}

/// Way-points before this one stay.
static int first_free(const bt_planner *planner)
{
    return isnan(planner->task.start_heading) ? 0 : 1;
}

static bool leave_out(const bt_planner *planner, bt_way *way, bt_way *tried)
{
    bool any = false;
    for (int span = way->n - 1; span >= 1; span = span > 8 ? span * 2 / 3 : span - 1)
        for (int k = first_free(planner); k + span < way->n;) {
            bt_way_copy(tried, way);
            memmove(tried->point[k], tried->point[k + span], (size_t)(way->n - k - span) * sizeof *way->point);
            tried->n -= span;
            if (take(planner, way, tried)) any = true;
            else k++;
        }
    return any;
}

/// Steps of the way-point k, to eight sides; the first stays on a given heading, and the end on the goal's line.
static bool move_one(const bt_planner *planner, bt_way *way, bt_way *tried, int k, double step)
{
    const double *g = planner->task.goal, ex = g[2] - g[0], ey = g[3] - g[1], line = bt_hypot(ex, ey);
    const bool end = k == way->n - 1, ray = k < first_free(planner);
    if (end && (ray || !planner->task.goal_is_line || !(line > 0))) return false;
    bool any = false;
    for (int side = 0; side < (end || ray ? 2 : 8); side++) {
        static const double to[8][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}};
        const double along = step * to[side][0], aside = step * to[side][1];
        bt_way_copy(tried, way);
        double *at = tried->point[k];
        if (end) {
            at[0] += along * ex / line, at[1] += along * ey / line;
            bt_way_goal(planner, way->cost.time, at[0], at[1], at);
        } else {
            at[0] += along * planner->ice.ax - aside * planner->ice.ay, at[1] += along * planner->ice.ay +
                aside * planner->ice.ax;
        }
        if (take(planner, way, tried)) any = true, side = -1; // once more in the same sense
    }
    return any;
}

static bool move_all(const bt_planner *planner, bt_way *way, bt_way *tried)
{
    bool any = false;
    for (double step = 2 * planner->task.width; step > planner->task.width / 100; step *= 0.5)
        for (int sweep = 0; sweep < SWEEPS; sweep++) {
            bool moved = false;
            for (int k = 0; k < way->n; k++) moved = move_one(planner, way, tried, k, step) || moved;
            if (!moved) break;
            any = true;
        }
    return any;
}

/// A corner in the middle of a long leg, where it finds a better place than on it.
static bool put_in(const bt_planner *planner, bt_way *way, bt_way *tried)
{
    bool any = false;
    bt_way with = {0};
    for (int k = first_free(planner); k < way->n; k++) {
        const double *a = k ? way->point[k - 1] : planner->task.start, *b = way->point[k];
        if (bt_hypot(b[0] - a[0], b[1] - a[1]) < 4 * planner->task.width) continue;
        bt_way_copy(&with, way);
        memmove(with.point[k + 1], with.point[k], (size_t)(way->n - k) * sizeof *way->point);
        with.point[k][0] = 0.5 * (a[0] + b[0]), with.point[k][1] = 0.5 * (a[1] + b[1]);
        with.n++;
        bt_way_price(planner, &with);
        for (double step = 2 * planner->task.width; step > planner->task.width / 10; step *= 0.5)
            move_one(planner, &with, tried, k, step);
        // worth a corner
        if (with.cost.cost < way->cost.cost * (1 - 1e-4) && bt_swath_better(&with.cost, &way->cost)) {
            bt_way_copy(way, &with);
            any = true;
        }
    }
    free(with.point);
    return any;
}

void bt_way_shorten(const bt_planner *planner, bt_way *way)
{
    bt_way tried = {0};
    end_at_goal(planner, way);
    for (int round = 0; round < ROUNDS; round++) {
        bool any = leave_out(planner, way, &tried);
        any = move_all(planner, way, &tried) || any;
        any = put_in(planner, way, &tried) || any;
        end_at_goal(planner, way);
        if (!any) break;
    }
    free(tried.point);
}
