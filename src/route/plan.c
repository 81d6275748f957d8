// SPDX-License-Identifier: MIT
// Routes from a task; bergtow/route.h.
#include "bergtow/route.h"

#include "base/elementary.h"
#include "base/inside.h"
#include "route/lattice.h"

#include <string.h>

#define MAX_STATES 1.5e6 ///< of a lattice with the spacing chosen here
#define MAX_CELLS 3e6  ///< times speeds, of a raster with the cells chosen here
#define REPELS 1.3      ///< factor of the cost near routes already found; then its square, and so on
enum { TRIES = 4, ARRIVALS = 40, ROUNDS = 4, SWEEPS = 12 };

// --- shortening ------------------------------------------------------------------------------------------------------

// A step is accepted if the cost of the whole path, with its swath and constraints, falls. Rejected: a spline from a
// nonlinear programming solver, because the cost of ice has no useful gradient at the scale of floes; and shortening by
// line of sight alone, which cuts through the ice that the search avoided.

typedef struct {
    int n, cap;
    double (*point)[2]; ///< [n] way-points, m; the last is the end
    bt_path_cost cost;
} bt_way;

/// Make the legs of a way from the start of the task, with corners of its radius; false if they do not fit. The caller
/// frees the path.
static bool way_path(const bt_planner *planner, const bt_way *way, bt_path *path)
{
    char why[200];
    return bt_path_make(path, planner->task.start[0], planner->task.start[1], way->n, way->point[0],
                        planner->task.radius, why);
}

/// Sets way->cost.
static void way_price(const bt_planner *planner, bt_way *way)
{
    bt_path path;
    if (!way_path(planner, way, &path)) {
        way->cost = (bt_path_cost){.faults = BT_ROUTE_TURNS, .cost = INFINITY, .time = way->cost.time};
        return;
    }
    way->cost = bt_swath_cost(planner, path.n - 1, path.leg, NULL);
    bt_path_free(&path);
}

static void way_copy(bt_way *to, const bt_way *from)
{
    if (to->cap < from->n + 1) to->point = bt_realloc(to->point, (size_t)(to->cap = from->n + 16), sizeof *to->point);
    memcpy(to->point, from->point, (size_t)from->n * sizeof *to->point);
    to->n = from->n;
    to->cost = from->cost;
}

/// The point of the goal nearest to (x, y) at the time t, in the frame of the ice.
static void way_goal(const bt_planner *planner, double t, double x, double y, double goal[2])
{
    const double *g = planner->task.goal, *u = planner->task.drift;
    goal[0] = g[0] - u[0] * t, goal[1] = g[1] - u[1] * t;
    if (!planner->task.goal_is_line) return;
    const double ex = g[2] - g[0], ey = g[3] - g[1], square = ex * ex + ey * ey;
    const double dot = (x - goal[0]) * ex + (y - goal[1]) * ey;
    const double f = dot <= 0 || !(square > 0) ? 0 : dot >= square ? 1 : dot / square;
    goal[0] += f * ex, goal[1] += f * ey;
}

/// Times of arrival at a goal that is moved each time to where it is then: a fixed-point iteration.
typedef struct {
    int n;
    double time, change; ///< the last ones, s
    double late;         ///< of the time before the last one, s: by how much the arrival was later
    bool nearing;        ///< the changes decrease
} bt_arrivals;

/// The time for which to move the goal next, from that of arrival at the last one: the same; but after `plain` steps
/// every third one is Aitken's extrapolation, since a plain step gains only a factor drift / speed. Where the goal
/// comes to meet the tow faster than that moves, plain steps swing ever wider about the arrival: then it is the secant.
static double next_arrival(bt_arrivals *a, double time, int plain)
{
    const double change = time - a->time;
    a->nearing = fabs(change) < fabs(a->change);
    if (++a->n > plain && a->n % 3 == 0 && a->nearing && change * a->change > 0)
        time += change * change / (a->change - change);
    else if (!a->nearing && change * a->late < 0) time = a->time - change * a->change / (change - a->late);
    a->late = change;
    a->change = time - a->time;
    a->time = time;
    return time;
}

/// First guess of an arrival, s: where the ice drifts faster than the tow moves, of the straight line, from
/// |d − u t| = v t; otherwise 0.
static double first_guess(const bt_planner *planner)
{
    const bt_route_task *task = &planner->task;
    const double *u = task->drift, v = task->speed[0], faster = u[0] * u[0] + u[1] * u[1] - v * v;
    double goal[2];
    way_goal(planner, 0, task->start[0], task->start[1], goal);
    const double x = goal[0] - task->start[0], y = goal[1] - task->start[1], along = x * u[0] + y * u[1];
    const double root = along * along - faster * (x * x + y * y);
    return faster > 0 && along > 0 && root >= 0 ? (x * x + y * y) / (along + sqrt(root)) : 0;
}

/// Put the end of a way where the goal is at the time of arrival.
static void end_at_goal(const bt_planner *planner, bt_way *way)
{
    enum { PLAIN = 40, STEPS = 100 };
    bt_arrivals arrivals = {0};
    const double *u = planner->task.drift, fine = 1e-9 * planner->task.width;
    double *end = way->point[way->n - 1];
    for (int k = 0; k < STEPS; k++) {
        const double was[2] = {end[0], end[1]};
        way_goal(planner, next_arrival(&arrivals, way->cost.time, PLAIN), was[0], was[1], end);
        way_price(planner, way);
        const bool lost = k > 2 && way->cost.faults & BT_ROUTE_OUTSIDE; // it grows by a factor with every step
        if ((k >= PLAIN || lost) && !arrivals.nearing) return;
        if ((u[0] == 0 && u[1] == 0) || bt_hypot(end[0] - was[0], end[1] - was[1]) < fine) return;
    }
}

/// Accept `tried` if it is better, or has fewer corners and is no worse.
static bool take(const bt_planner *planner, bt_way *way, bt_way *tried)
{
    way_price(planner, tried);
    bool better = bt_swath_better(&tried->cost, &way->cost);
    if (!better && tried->n < way->n && !bt_swath_better(&way->cost, &tried->cost)) better = true;
    if (better) way_copy(way, tried);
    return better;
}

/// First free way-point; one before it is tied to the given heading at the start.
static int first_free(const bt_planner *planner) { return isnan(planner->task.start_heading) ? 0 : 1; }

static bool leave_out(const bt_planner *planner, bt_way *way, bt_way *tried)
{
    bool any = false;
    for (int span = way->n - 1; span >= 1; span = span > 8 ? span * 2 / 3 : span - 1)
        for (int k = first_free(planner); k + span < way->n;) {
            way_copy(tried, way);
            memmove(tried->point[k], tried->point[k + span], (size_t)(way->n - k - span) * sizeof *way->point);
            tried->n -= span;
            if (take(planner, way, tried)) any = true;
            else k++;
        }
    return any;
}

/// Try steps of way-point k in eight directions; the first stays on a given heading, and the end on the goal's line.
static bool move_one(const bt_planner *planner, bt_way *way, bt_way *tried, int k, double step)
{
    const double *g = planner->task.goal, ex = g[2] - g[0], ey = g[3] - g[1], line = bt_hypot(ex, ey);
    const bool end = k == way->n - 1, ray = k < first_free(planner);
    if (end && (ray || !planner->task.goal_is_line || !(line > 0))) return false;
    bool any = false;
    for (int side = 0; side < (end || ray ? 2 : 8); side++) {
        static const double to[8][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}};
        const double along = step * to[side][0], aside = step * to[side][1];
        way_copy(tried, way);
        double *at = tried->point[k];
        if (end) {
            at[0] += along * ex / line, at[1] += along * ey / line;
            way_goal(planner, way->cost.time, at[0], at[1], at);
        } else {
            at[0] += along * planner->ice.ax - aside * planner->ice.ay, at[1] += along * planner->ice.ay +
                aside * planner->ice.ax;
        }
        if (take(planner, way, tried)) any = true, side = -1; // start again with the first direction
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

/// Insert a corner in the middle of a long leg, if it finds a better place off the leg.
static bool put_in(const bt_planner *planner, bt_way *way, bt_way *tried)
{
    bool any = false;
    bt_way with = {0};
    for (int k = first_free(planner); k < way->n; k++) {
        const double *a = k ? way->point[k - 1] : planner->task.start, *b = way->point[k];
        if (bt_hypot(b[0] - a[0], b[1] - a[1]) < 4 * planner->task.width) continue;
        way_copy(&with, way);
        memmove(with.point[k + 1], with.point[k], (size_t)(way->n - k) * sizeof *way->point);
        with.point[k][0] = 0.5 * (a[0] + b[0]), with.point[k][1] = 0.5 * (a[1] + b[1]);
        with.n++;
        way_price(planner, &with);
        for (double step = 2 * planner->task.width; step > planner->task.width / 10; step *= 0.5)
            move_one(planner, &with, tried, k, step);
        // worth a corner
        if (with.cost.cost < way->cost.cost * (1 - 1e-4) && bt_swath_better(&with.cost, &way->cost)) {
            way_copy(way, &with);
            any = true;
        }
    }
    free(with.point);
    return any;
}

/// Lower the cost of a way by removing, moving and inserting corners, until no step helps. Its end stays where the goal
/// is at the time of arrival.
static void way_shorten(const bt_planner *planner, bt_way *way)
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

// --- routes ----------------------------------------------------------------------------------------------------------

/// Store a route of legs, and the way-points that make them.
static void keep(const bt_planner *planner, bt_route *route, int n, const bt_leg *leg, int64_t n_corners,
                 double (*corner)[2])
{
    const int64_t cap = bt_swath_stretches(planner, n, leg);
    *route = (bt_route){.n_corners = n_corners, .radius = planner->task.radius};
    route->stretch = bt_alloc((size_t)cap + 1, sizeof *route->stretch);
    route->corner = bt_alloc((size_t)n_corners + 1, sizeof *route->corner);
    memcpy(route->corner, corner, (size_t)n_corners * sizeof *corner);
    const bt_path_cost cost = bt_swath_cost(planner, n, leg, route->stretch);
    route->n_stretches = cap;
    route->length = cost.length, route->duration = cost.time, route->work = cost.work, route->peak = cost.peak,
    route->cost = cost.plain;
    route->force = cost.length > 0 ? cost.work / cost.length : 0;
    route->faults = cost.faults;
    bt_swath_report(planner, route);
}

static void keep_way(const bt_planner *planner, bt_route *route, const bt_way *way)
{
    bt_path path;
    if (!way_path(planner, way, &path)) return; // never for a way of the planner
    keep(planner, route, path.n - 1, path.leg, way->n, way->point);
    bt_path_free(&path);
}

/// Way-points whose corners are the arcs of legs; an arc longer than a right angle is that of several.
static int64_t corners_of(int n, const bt_leg *leg, double (**corner)[2])
{
    int64_t made = 0, cap = 2;
    for (int k = 0; k < n; k++) cap += 2 + (int64_t)(fabs(leg[k].turn) * leg[k].length);
    *corner = bt_alloc((size_t)cap, sizeof **corner);
    for (int k = 0; k < n; k++) {
        const double angle = fabs(leg[k].turn) * leg[k].length;
        if (!(angle > 1e-9)) continue;
        const int parts = (int)ceil(angle / (0.5 * BT_PI) - 1e-9);
        for (int m = 0; m < parts; m++) {
            double at[2], t[2];
            bt_leg_at(&leg[k], m * leg[k].length / parts, at, t);
            const double cut = bt_tan(0.5 * angle / parts) / fabs(leg[k].turn);
            (*corner)[made][0] = at[0] + cut * t[0], (*corner)[made++][1] = at[1] + cut * t[1];
        }
    }
    double t[2];
    bt_leg_at(&leg[n - 1], leg[n - 1].length, (*corner)[made++], t);
    return made;
}

/// Mean distance of the stretches of a from those of b, m.
static double apart(const bt_route *a, const bt_route *b)
{
    double sum = 0;
    for (int64_t i = 0; i < a->n_stretches; i++) {
        double least = INFINITY;
        for (int64_t j = 0; j < b->n_stretches; j++) {
            const bt_route_stretch *stretch = &b->stretch[j];
            const double x = a->stretch[i].x - stretch->x, y = a->stretch[i].y - stretch->y;
            const double f = bt_min(stretch->length, bt_max(0, x * stretch->tx + y * stretch->ty));
            least = bt_min(least, bt_hypot(x - f * stretch->tx, y - f * stretch->ty));
        }
        sum += least;
    }
    return a->n_stretches ? sum / (double)a->n_stretches : 0;
}

/// Marks the cells within W of a route.
static void repel(bt_planner *planner, const bt_route *route)
{
    const bt_route_ice *ice = &planner->ice;
    const double w = planner->task.width / ice->cell;
    if (!planner->near) planner->near = bt_alloc((size_t)ice->nx * (size_t)ice->ny, 1);
    for (int64_t k = 0; k < route->n_stretches; k++) {
        const bt_route_stretch *stretch = &route->stretch[k];
        const bt_leg leg = bt_swath_leg(stretch);
        for (int part = 0; part < 8; part++) {
            double at[2], t[2], c[2];
            bt_leg_at(&leg, (part + 0.5) / 8 * stretch->length, at, t);
            bt_route_ice_place(ice, at[0], at[1], c);
            for (int j = (int)bt_max(0, c[1] - w); j < ice->ny && j <= c[1] + w; j++)
                for (int i = (int)bt_max(0, c[0] - w); i < ice->nx && i <= c[0] + w; i++) {
                    const double x = i + 0.5 - c[0], y = j + 0.5 - c[1];
                    if (x * x + y * y <= w * w) planner->near[(int64_t)j * ice->nx + i] = 1;
                }
        }
    }
}

// --- from the result of a search to a route --------------------------------------------------------------------------

/// Follow the result of a search to one of its nodes, then a Dubins path to the goal, with the given heading or any;
/// take the cheapest of all. The goal is where it is at the time of arrival. False if none is allowed.
static bool with_tail(const bt_planner *planner, const bt_lattice_way *way, double arrival, int tries, bt_route *route)
{
    const bt_route_task *task = &planner->task;
    const double radius = task->radius > 0 ? task->radius : 1e-3 * task->width;
    bt_leg *leg = bt_alloc((size_t)way->n_legs + 3, sizeof *leg);
    bt_leg *best_leg = bt_alloc((size_t)way->n_legs + 3, sizeof *leg);
    bt_path_cost best = {.faults = BT_ROUTE_TURNS, .cost = INFINITY};
    int best_n = 0;
    const bool given = !isnan(task->goal_heading), any_start = isnan(task->start_heading);
    for (int a = 0; a < way->n_nodes; a++)
        for (int turn = 0; turn < (a || !any_start ? 1 : task->headings); turn++)
            for (int k = 0; k < (given ? 1 : task->headings); k++) {
                double from[3] = {way->node[a][0], way->node[a][1], way->node[a][2]}, part[3][2], to[3];
                if (a == 0 && any_start) from[2] = 2 * BT_PI * turn / task->headings;
                way_goal(planner, arrival, from[0], from[1], to);
                to[2] = given ? task->goal_heading : 2 * BT_PI * k / task->headings;
                bt_route_dubins(from, to, radius, part);
                int n = way->node_leg[a];
                memcpy(leg, way->leg, (size_t)n * sizeof *leg);
                bt_leg at = {.x = from[0], .y = from[1]};
                bt_sincos(from[2], &at.ty, &at.tx);
                for (int m = 0; m < 3; m++) {
                    at.length = part[m][0], at.turn = part[m][1];
                    if (!(at.length > 1e-9 * radius)) continue;
                    leg[n++] = at;
                    double place[2], tangent[2];
                    bt_leg_at(&at, at.length, place, tangent);
                    at.x = place[0], at.y = place[1], at.tx = tangent[0], at.ty = tangent[1];
                }
                const bt_path_cost cost = bt_swath_cost(planner, n, leg, NULL);
                if (!bt_swath_better(&cost, &best)) continue;
                best = cost, best_n = n;
                memcpy(best_leg, leg, (size_t)n * sizeof *leg);
            }
    const double *u = task->drift;
    if (best_n > 0 && bt_hypot(u[0], u[1]) * fabs(best.time - arrival) > 1e-6 * task->width && tries > 0) {
        free(leg);
        free(best_leg);
        return with_tail(planner, way, best.time, tries - 1, route);
    }
    const bool allowed = best_n > 0 && !(best.faults & (BT_ROUTE_IN_NO_GO | BT_ROUTE_OUTSIDE | BT_ROUTE_TURNS));
    if (allowed) {
        double(*corner)[2];
        const int64_t n_corners = corners_of(best_n, best_leg, &corner);
        keep(planner, route, best_n, best_leg, n_corners, corner);
        free(corner);
    }
    free(leg);
    free(best_leg);
    return allowed;
}

/// Shorten the result of a search; if `direct` is set, also shorten the straight line, and take that if better.
static bool into_route(const bt_planner *planner, const bt_lattice_way *way, bool direct, bt_route *route)
{
    const bt_route_task *task = &planner->task;
    if (!isnan(task->goal_heading))
        return with_tail(planner, way, bt_swath_cost(planner, way->n_legs, way->leg, NULL).time, ARRIVALS, route);
    bt_way w = {0}, straight = {0};
    w.point = bt_alloc((size_t)(w.cap = way->n_points + 16), sizeof *w.point);
    const double *last = task->start;
    for (int k = 0; k < way->n_points; k++) { // skip coincident points
        if (!(bt_hypot(way->point[k][0] - last[0], way->point[k][1] - last[1]) > 1e-9 * task->width)) continue;
        w.point[w.n][0] = way->point[k][0], w.point[w.n][1] = way->point[k][1];
        last = w.point[w.n++];
    }
    if (w.n == 0) { // the search ended where it began, less than a spacing from the goal
        w.point[0][0] = task->start[0], w.point[0][1] = task->start[1];
        w.n = 1;
    }
    way_price(planner, &w);
    way_goal(planner, w.cost.time, w.point[w.n - 1][0], w.point[w.n - 1][1], w.point[w.n - 1]);
    way_price(planner, &w);
    way_shorten(planner, &w);
    if (direct && isnan(task->start_heading)) {
        straight.point = bt_alloc((size_t)(straight.cap = 16), sizeof *straight.point);
        straight.n = 1;
        way_goal(planner, first_guess(planner), task->start[0], task->start[1], straight.point[0]);
        way_price(planner, &straight);
        way_shorten(planner, &straight);
        if (bt_swath_better(&straight.cost, &w.cost)) way_copy(&w, &straight);
    }
    bool allowed = !(w.cost.faults & (BT_ROUTE_IN_NO_GO | BT_ROUTE_OUTSIDE | BT_ROUTE_TURNS));
    if (allowed) keep_way(planner, route, &w);
    else allowed = with_tail(planner, way, w.cost.time, ARRIVALS, route);
    free(w.point);
    free(straight.point);
    return allowed;
}

// --- the task --------------------------------------------------------------------------------------------------------

/// The way through n corners to the goal as a route, n = 0: the straight line. BT_ROUTE_GOAL_DRIFTS when the goal
/// drifts away from it, BT_ROUTE_NONE when its turns do not fit.
static int through(const bt_planner *planner, int n, const double (*corner)[2], bt_route *route)
{
    const bt_route_task *task = &planner->task;
    enum { PLAIN = 200, STEPS = 260 };
    bt_arrivals arrivals = {.time = first_guess(planner)};
    bt_way way = {.point = bt_alloc((size_t)n + 1, sizeof *way.point), .n = n + 1, .cap = n + 1};
    if (n) memcpy(way.point, corner, (size_t)n * sizeof *corner);
    const double *from = n ? corner[n - 1] : task->start;
    double *end = way.point[n];
    const double wide = task->extent[2] - task->extent[0] + task->extent[3] - task->extent[1];
    const bool still = task->drift[0] == 0 && task->drift[1] == 0;
    bool there = false;
    way_goal(planner, arrivals.time, from[0], from[1], end);
    for (int k = 0; k < STEPS && !there; k++) {
        way_price(planner, &way);
        if (way.cost.faults & BT_ROUTE_TURNS) { // they may fit where the goal is on arrival
            double length = bt_hypot(way.point[0][0] - task->start[0], way.point[0][1] - task->start[1]);
            for (int m = 0; m < n; m++)
                length += bt_hypot(way.point[m + 1][0] - way.point[m][0], way.point[m + 1][1] - way.point[m][1]);
            way.cost.time = length / task->speed[0];
        }
        const double was[2] = {end[0], end[1]};
        way_goal(planner, next_arrival(&arrivals, way.cost.time, PLAIN), from[0], from[1], end);
        const double moved = bt_hypot(end[0] - was[0], end[1] - was[1]);
        there = still || moved < 1e-9 * task->width;
        if (bt_hypot(end[0] - task->start[0], end[1] - task->start[1]) > 10 * wide) break;
    }
    const int fits = way.cost.faults & BT_ROUTE_TURNS ? BT_ROUTE_NONE : BT_ROUTE_OK;
    const int status = there ? fits : BT_ROUTE_GOAL_DRIFTS;
    if (status == BT_ROUTE_OK) {
        keep_way(planner, route, &way);
        const double x = way.point[0][0] - task->start[0], y = way.point[0][1] - task->start[1];
        const double given[2] = {task->start_heading, task->goal_heading};
        for (int k = 0; k < 2; k++) {
            if (isnan(given[k])) continue;
            double sine, cosine;
            bt_sincos(given[k], &sine, &cosine);
            const double angle = bt_atan2(cosine * y - sine * x, cosine * x + sine * y);
            if (fabs(angle) > 1e-6) route->faults |= BT_ROUTE_TURNS;
        }
    }
    free(way.point);
    return status;
}

/// Least force, over the speeds, on a berg in a square of side W around a place, N.
static double force_at(const bt_planner *planner, const double at[2])
{
    const double w = planner->task.width;
    const bt_leg leg = {.x = at[0] - 0.5 * w * planner->ice.ax, .y = at[1] - 0.5 * w * planner->ice.ay,
                        .tx = planner->ice.ax, .ty = planner->ice.ay, .length = w};
    double load[BT_ROUTE_SPEEDS] = {0}, water[BT_ROUTE_SPEEDS], least = INFINITY;
    bt_swath_load(planner, &leg, w, load);
    for (int s = 0; s < planner->task.n_speeds; s++) {
        water[s] = bt_swath_water(planner, leg.tx, leg.ty, planner->task.speed[s]);
        least = bt_min(least, bt_max(1e-3, planner->task.weight[0]) * water[s] + load[s] / w);
    }
    return least;
}

/// Fault of the start (end 0) or the goal (end 1) at this time.
static int fault_of_end(const bt_planner *planner, int end, const double at[2], double time, double *force)
{
    const double *u = planner->task.drift, x = at[0] + u[0] * time, y = at[1] + u[1] * time,
                 fine = 1e-9 * planner->no_go.need;
    if (bt_no_go_margin(&planner->no_go, at[0], at[1]) < -fine) return BT_ROUTE_START_OUTSIDE + end;
    if (bt_no_go_inside(&planner->no_go, x, y) || bt_no_go_distance(&planner->no_go, x, y) < planner->no_go.need - fine)
        return BT_ROUTE_START_NO_GO + end;
    *force = force_at(planner, at);
    return *force * planner->task.force_factor > planner->task.force_limit ? BT_ROUTE_START_TOO_THICK + end
                                                                           : BT_ROUTE_OK;
}

static void begin(bt_planner *planner, const bt_route_task *task)
{
    *planner = (bt_planner){.task = *task, .penalty = 1};
    qsort(planner->task.speed, (size_t)task->n_speeds, sizeof *task->speed, bt_descending);
    for (int a = 0; a < 2; a++) planner->water[a] = task->water[a] - task->drift[a];
    bt_no_go_make(&planner->no_go, &planner->task);
}

static void end(bt_planner *planner)
{
    bt_no_go_free(&planner->no_go);
    bt_route_ice_free(&planner->ice);
    free(planner->near);
    free(planner->kept);
}

/// Make the lattice: x along the heading at the start if given, otherwise towards the goal, one point of which is then
/// a place; choose spacing and cells if not given.
static bt_lattice *lattice_of(bt_planner *planner)
{
    const bt_route_task *task = &planner->task;
    const double area = (task->extent[2] - task->extent[0]) * (task->extent[3] - task->extent[1]);
    double goal[2], ax = 1, ay = 0, h = task->spacing, cell = task->cell;
    bt_arrivals arrivals = {.time = first_guess(planner)};
    double x = 0, y = 0, far = arrivals.time * task->speed[0];
    for (int k = 0; k < ARRIVALS; k++) { // where the goal is in the ice on arrival at the fastest speed
        const double time = next_arrival(&arrivals, far / task->speed[0], ARRIVALS);
        way_goal(planner, time, task->start[0], task->start[1], goal);
        x = goal[0] - task->start[0], y = goal[1] - task->start[1], far = bt_hypot(x, y);
    }
    if (!isnan(task->start_heading)) bt_sincos(task->start_heading, &ay, &ax);
    else if (far > 0) ax = x / far, ay = y / far;
    if (!(h > 0)) h = bt_max(task->width / 4, sqrt(area * task->headings / MAX_STATES));
    if (far > h) h = far / ceil(far / h - 1e-9);
    if (!(cell > 0)) cell = bt_max(task->width / 8, sqrt(area * task->n_speeds / MAX_CELLS));
    return bt_lattice_make(planner, ax, ay, h, h / ceil(h / cell - 1e-9));
}

/// Faults of start and goal. The straight line, if it arrives, is the first route of the plan. goal: its place in the
/// ice then, m.
static int ends_of(const bt_planner *planner, bt_route_plan *plan, double goal[4])
{
    const bt_route_task *t = &planner->task;
    double there[2];
    int status = fault_of_end(planner, 0, t->start, 0, &plan->force);
    way_goal(planner, 0, t->start[0], t->start[1], there);
    const bool at_goal = !(bt_hypot(there[0] - t->start[0], there[1] - t->start[1]) > 1e-9 * t->width);
    plan->n = !at_goal && through(planner, 0, NULL, &plan->route[0]) == BT_ROUTE_OK;
    if (!status && !plan->n) status = at_goal ? BT_ROUTE_AT_GOAL : BT_ROUTE_GOAL_DRIFTS;
    const double time = plan->route[0].duration;
    for (int a = 0; a < 4; a++) goal[a] = t->goal[t->goal_is_line ? a : a % 2] - t->drift[a % 2] * time;
    return status || t->goal_is_line ? status : fault_of_end(planner, 1, goal, time, &plan->force);
}

/// The cheapest route at the present penalty; false if there is none. direct: as of into_route.
static bool find_one(bt_planner *planner, bt_lattice *lattice, const double goal[4], bool direct, bt_route *route)
{
    const bt_route_task *t = &planner->task;
    const bool by_peak = t->objective == BT_ROUTE_PEAK;
    const int objective = by_peak ? BT_ROUTE_WORK : t->objective;
    bt_lattice_way way = {0};
    double limit = t->force_limit, peak = 0;
    bool got = true;
    if (by_peak) { // of the ways with the least peak, that of the least work
        got = bt_lattice_search(lattice, goal, BT_ROUTE_PEAK, limit, &peak, &way);
        bt_lattice_way_free(&way);
        limit = bt_min(limit, peak * t->force_factor * (1 + 1e-9));
    }
    got = got && bt_lattice_search(lattice, goal, objective, limit, NULL, &way);
    if (!got && !isnan(t->goal_heading)) { // no move may end at a node with that heading: the tail turns
        const double heading = t->goal_heading;
        planner->task.goal_heading = NAN;
        got = bt_lattice_search(lattice, goal, objective, limit, NULL, &way);
        planner->task.goal_heading = heading;
    }
    got = got && into_route(planner, &way, direct, route);
    bt_lattice_way_free(&way);
    return got;
}

/// Put the route behind the last one into the plan if it is new: not the straight line, or of alternatives, more than W
/// from every other. Otherwise release it.
static bool take_new(const bt_planner *planner, bool first, bt_route_plan *plan)
{
    bt_route *route = &plan->route[plan->n];
    const bt_route *straight = &plan->route[0];
    const double w = planner->task.width;
    bool new = !first || apart(route, straight) > 1e-3 * w || fabs(route->cost - straight->cost) > 1e-6 * route->cost;
    for (int a = 0; !first && new && a < plan->n; a++) new = apart(route, &plan->route[a]) > w;
    if (new) {
        plan->n++;
        return true;
    }
    free(route->corner);
    free(route->stretch);
    *route = (bt_route){0};
    return false;
}

/// Add an alternative, found with cells near the other routes made ever more expensive; false if there is none.
static bool add_alternative(bt_planner *planner, bt_lattice *lattice, const double goal[4], bt_route_plan *plan)
{
    planner->penalty = REPELS;
    bt_swath_keep(planner);
    for (int k = 0; k < TRIES; k++, planner->penalty *= planner->penalty) {
        if (!find_one(planner, lattice, goal, false, &plan->route[plan->n])) return false;
        if (take_new(planner, false, plan)) {
            repel(planner, &plan->route[plan->n - 1]);
            return true;
        }
    }
    return false;
}

static void make(const bt_route_task *task, bt_route_plan *plan)
{
    bt_planner planner;
    double goal[4];
    begin(&planner, task);
    *plan = (bt_route_plan){0};
    bt_lattice *lattice = lattice_of(&planner);
    plan->cell = planner.ice.cell;
    plan->spacing = bt_lattice_spacing(lattice);
    plan->status = ends_of(&planner, plan, goal);
    if (!plan->status) {
        bt_swath_keep(&planner);
        if (!find_one(&planner, lattice, goal, true, &plan->route[1])) plan->status = BT_ROUTE_NONE;
    }
    if (!plan->status) {
        if (take_new(&planner, true, plan)) repel(&planner, &plan->route[1]);
        repel(&planner, &plan->route[0]);
        while (plan->n < 1 + task->routes && add_alternative(&planner, lattice, goal, plan)) {}
        if (plan->n < 1 + task->routes) plan->status = BT_ROUTE_FEWER;
    }
    for (int a = 2; a < plan->n; a++) // sort the planned ones by cost, of equal ones the first found first
        for (int b = a; b > 1 && plan->route[b].cost < plan->route[b - 1].cost; b--) {
            const bt_route swap = plan->route[b];
            plan->route[b] = plan->route[b - 1], plan->route[b - 1] = swap;
        }
    plan->states = planner.states;
    bt_lattice_free(lattice);
    end(&planner);
}

void bt_route_make(const bt_route_task *task, bt_route_plan *plan)
{
    BT_PLAIN_NUMBERS;
    bt_route_task fast = *task; // the cheapest speed may be too slow for a goal that drifts away
    qsort(fast.speed, (size_t)fast.n_speeds, sizeof *fast.speed, bt_descending);
    const bool still = task->drift[0] == 0 && task->drift[1] == 0;
    for (;; fast.n_speeds--) {
        make(&fast, plan);
        // it may also arrive so late that the goal is then beyond the domain, or in thick ice; no-go areas do not drift
        const bool late = plan->status == BT_ROUTE_GOAL_DRIFTS ||
            (!still && (plan->status == BT_ROUTE_GOAL_OUTSIDE || plan->status == BT_ROUTE_GOAL_TOO_THICK));
        if (!late || fast.n_speeds == 1) return;
        bt_route_free(plan);
    }
}

void bt_route_through(const bt_route_task *task, int n, const double (*corner)[2], bt_route_plan *plan)
{
    BT_PLAIN_NUMBERS;
    bt_planner planner;
    begin(&planner, task);
    *plan = (bt_route_plan){.n = 1};
    bt_lattice *lattice = lattice_of(&planner);
    plan->cell = planner.ice.cell;
    plan->status = through(&planner, n, corner, &plan->route[0]);
    if (plan->status != BT_ROUTE_OK) plan->n = 0;
    bt_lattice_free(lattice);
    end(&planner);
}

void bt_route_cover(const bt_route_task *task, int64_t nx, int64_t ny, double *cover)
{
    BT_PLAIN_NUMBERS;
    const double *e = task->extent, sx = (double)nx / (e[2] - e[0]), sy = (double)ny / (e[3] - e[1]);
    double *sums = bt_alloc((size_t)((nx + 2) * ny), sizeof *sums), *v = NULL;
    for (int64_t i = 0; i < task->n_floes; i++) {
        const int64_t first = task->floe_first[i], n = task->floe_first[i + 1] - first;
        v = bt_realloc(v, (size_t)n, 2 * sizeof *v);
        for (int64_t k = 0; k < n; k++) {
            v[2 * k] = (task->floe[2 * (first + k)] - e[0]) * sx;
            v[2 * k + 1] = (task->floe[2 * (first + k) + 1] - e[1]) * sy;
        }
        bt_route_ice_add(sums, (int)nx, (int)ny, n, v, 1);
    }
    bt_route_ice_sum(sums, (int)nx, (int)ny);
    for (int64_t j = 0; j < ny; j++)
        for (int64_t i = 0; i < nx; i++) cover[j * nx + i] = sums[j * (nx + 2) + i];
    free(v);
    free(sums);
}

void bt_route_free(bt_route_plan *plan)
{
    for (int k = 0; k < plan->n; k++) {
        free(plan->route[k].corner);
        free(plan->route[k].stretch);
    }
    *plan = (bt_route_plan){0};
}
