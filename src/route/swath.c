// SPDX-License-Identifier: MIT
// Where the berg may not be, and loads and areas along a path; route/swath.h.
#include "route/swath.h"

#include "base/elementary.h"
#include "base/inside.h"
#include "geometry/polygons.h"

#include <string.h>

// --- distances to no-go polygons, by buckets of their edges ----------------------------------------------------------

#define FINE 1e-3 ///< finest length / no_go.need

static int clamped(double x, int n) { return x < 0 ? 0 : x >= n ? n - 1 : (int)x; }

/// For each bucket b within `far` of edge k: count the edge in first[b + 1], or list it at next[b].
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
    BT_FREE(no_go->edge, no_go->first, no_go->list);
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
    for (int64_t i = 0; i < task->n_no_go; i++) { // each polygon by itself: overlaps of two are not free
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
        if (leg->turn == 0) { // the extent is convex: a straight leg lies in it if both ends do
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

// --- loads and areas along a path ------------------------------------------------------------------------------------

enum { ACROSS = 64, CELLS = 4 * (1 + ACROSS) }; // most points of a slice; cells around them

double bt_swath_water(const bt_planner *planner, double tx, double ty, double v)
{
    const double x = v * tx - planner->water[0], y = v * ty - planner->water[1], d = planner->task.drag;
    return bt_max(d * bt_hypot(x, y) * (x * tx + y * ty), 1e-3 * d * v * v);
}

/// A slice of the swath, ds long, with its middle s m along a leg: its cells and the areas they represent, m². The
/// first *middle cells surround its centre, and represent lengths of the path, m. Values are linear between the centres
/// of cells, as the edge of the swath may lie anywhere in a cell. Inside a turn of radius below W/2 a slice ends at the
/// centre of the turn. Returns the number of cells.
static int slice(const bt_planner *planner, const bt_leg *leg, double s, double ds, int64_t cell[CELLS],
                 double area[CELLS], int *middle)
{
    const bt_route_ice *ice = &planner->ice;
    const double w = planner->task.width, inv = 1 / ice->cell;
    int n = (int)ceil(w * inv - 1e-9), made = 0;
    n = n < 1 ? 1 : n > ACROSS ? ACROSS : n;
    double place[2], tangent[2], at[2];
    bt_leg_at(leg, s, place, tangent);
    bt_route_ice_place(ice, place[0], place[1], at);
    const double t[2] = {tangent[0] * ice->ax + tangent[1] * ice->ay, tangent[1] * ice->ax - tangent[0] * ice->ay};
    for (int k = -1; k < n; k++) {
        const double aside = k < 0 ? 0 : w * ((k + 0.5) / n - 0.5);
        const double here = k < 0 ? ds : ds * w / n * bt_max(0, 1 - leg->turn * aside);
        if (k == 0) *middle = made;
        const double x = at[0] - aside * inv * t[1] - 0.5, y = at[1] + aside * inv * t[0] - 0.5;
        if (!(x >= 0 && y >= 0 && x < ice->nx - 1 && y < ice->ny - 1)) continue;
        const int64_t i = (int64_t)x, j = (int64_t)y, c = j * ice->nx + i;
        const double fx = x - (double)i, fy = y - (double)j;
        cell[made] = c, area[made++] = here * (1 - fx) * (1 - fy);
        cell[made] = c + 1, area[made++] = here * fx * (1 - fy);
        cell[made] = c + ice->nx, area[made++] = here * (1 - fx) * fy;
        cell[made] = c + ice->nx + 1, area[made++] = here * fx * fy;
    }
    return made;
}

static int slices(const bt_planner *planner, double length) { return (int)ceil(length / planner->ice.cell + 1e-9); }

void bt_swath_load(const bt_planner *planner, const bt_leg *leg, double length, double *sums)
{
    const int n = slices(planner, length), n_speeds = planner->ice.n_speeds;
    int64_t cell[CELLS];
    double area[CELLS];
    for (int k = 0; k < n; k++) {
        int middle;
        const int across = slice(planner, leg, (k + 0.5) * length / n, length / n, cell, area, &middle);
        for (int a = 0; a < across; a++) {
            const float *load = (a < middle ? planner->ice.line : planner->ice.load) + cell[a] * n_speeds;
            for (int v = 0; v < n_speeds; v++) sums[v] += area[a] * load[v];
        }
    }
}

bt_stretch_cost bt_swath_choose(const bt_planner *planner, double length, const double *load, const double *water,
                                double limit)
{
    bt_stretch_cost best = {.speed = -1, .over = true};
    for (int v = 0; v < planner->task.n_speeds; v++) {
        const double force = bt_max(1e-3, planner->task.weight[0]) * water[v] + load[v] / length,
                     time = length / planner->task.speed[v];
        bt_stretch_cost cost = {.speed = v, .force = force, .work = force * length, .time = time,
                                .over = force * planner->task.force_factor > limit};
        switch (planner->task.objective) {
        case BT_ROUTE_WORK: cost.measure = cost.work; break;
        case BT_ROUTE_TIME: cost.measure = time; break;
        case BT_ROUTE_PEAK: cost.measure = force; break;
        default: cost.measure = length; break;
        }
        const bool better = cost.over ? force < best.force : cost.measure < best.measure;
        if (best.speed < 0 || (best.over && !cost.over) || (best.over == cost.over && better)) best = cost;
    }
    return best;
}

/// Number of stretches of a leg, each at most 2 W long.
static int64_t parts_of(const bt_planner *planner, const bt_leg *leg)
{
    return leg->length > 0 ? (int64_t)ceil(leg->length / (2 * planner->task.width) - 1e-9) : 0;
}

int64_t bt_swath_stretches(const bt_planner *planner, int n, const bt_leg *leg)
{
    int64_t sum = 0;
    for (int k = 0; k < n; k++) sum += parts_of(planner, &leg[k]);
    return sum;
}

static bool is_near(const bt_planner *planner, double x, double y)
{
    const bt_route_ice *ice = &planner->ice;
    double at[2];
    bt_route_ice_place(ice, x, y, at);
    return planner->near && at[0] >= 0 && at[1] >= 0 && at[0] < ice->nx && at[1] < ice->ny &&
           planner->near[(int64_t)(int)at[1] * ice->nx + (int)at[0]];
}

/// Cost of a leg that begins at the time t; out, or NULL, takes its stretches.
static bt_path_cost leg_cost(const bt_planner *planner, const bt_leg *leg, double t, bt_route_stretch *out)
{
    bt_path_cost cost = {0};
    const int64_t parts = parts_of(planner, leg);
    const bool peak = planner->task.objective == BT_ROUTE_PEAK;
    for (int64_t m = 0; m < parts; m++) {
        const double length = leg->length / (double)parts;
        double at[2], tan[2], mid[2], t_mid[2], load[BT_ROUTE_SPEEDS] = {0}, water[BT_ROUTE_SPEEDS];
        bt_leg_at(leg, (double)m * length, at, tan);
        bt_leg_at(leg, ((double)m + 0.5) * length, mid, t_mid);
        const bt_leg part = {.x = at[0], .y = at[1], .tx = tan[0], .ty = tan[1], .length = length, .turn = leg->turn};
        bt_swath_load(planner, &part, length, load);
        for (int v = 0; v < planner->task.n_speeds; v++)
            water[v] = bt_swath_water(planner, t_mid[0], t_mid[1], planner->task.speed[v]);
        const bt_stretch_cost s = bt_swath_choose(planner, length, load, water, planner->task.force_limit);
        const double factor = is_near(planner, mid[0], mid[1]) ? planner->penalty : 1;
        const double plain = s.measure + planner->task.turn_cost * fabs(part.turn) * length;
        cost.faults |= bt_no_go_faults(&planner->no_go, &part, length, t + cost.time, planner->task.speed[s.speed]);
        if (s.over) cost.over += length, cost.faults |= BT_ROUTE_OVER_LIMIT;
        cost.cost = peak ? bt_max(cost.cost, factor * plain) : cost.cost + factor * plain;
        cost.plain = peak ? bt_max(cost.plain, plain) : cost.plain + plain;
        cost.second += factor * s.work;
        cost.length += length;
        cost.time += s.time;
        cost.work += s.work;
        cost.peak = bt_max(cost.peak, s.force);
        if (out)
            out[m] = (bt_route_stretch){.x = at[0], .y = at[1], .tx = tan[0], .ty = tan[1], .length = length,
                                        .turn = part.turn, .speed = planner->task.speed[s.speed], .force = s.force};
    }
    return cost;
}

/// Cached cost of a leg: a step of the shortening leaves most legs unchanged. If no-go polygons move in the frame of
/// the ice, nothing is cached.
typedef struct bt_kept_leg {
    double x, y, tx, ty, length, turn, penalty;
    bt_path_cost cost;
} bt_kept_leg;

enum { KEPT = 4096 };

static bt_path_cost kept_cost(const bt_planner *planner, const bt_leg *leg, double t)
{
    if (planner->task.drift[0] != 0 || planner->task.drift[1] != 0 || !planner->kept)
        return leg_cost(planner, leg, t, NULL);
    const double key[7] = {leg->x, leg->y, leg->tx, leg->ty, leg->length, leg->turn, planner->penalty};
    uint64_t hash = 0, bits;
    for (int k = 0; k < 7; k++) {
        memcpy(&bits, &key[k], sizeof bits);
        hash = (hash ^ bits) * 0x9e3779b97f4a7c15u;
        hash ^= hash >> 29;
    }
    bt_kept_leg *kept = &planner->kept[hash % KEPT];
    if (memcmp(&kept->x, key, sizeof key) != 0 || !(kept->cost.length > 0)) {
        memcpy(&kept->x, key, sizeof key);
        kept->cost = leg_cost(planner, leg, t, NULL);
    }
    return kept->cost;
}

void bt_swath_keep(bt_planner *planner)
{
    free(planner->kept);
    planner->kept = bt_alloc(KEPT, sizeof *planner->kept);
}

bt_path_cost bt_swath_cost(const bt_planner *planner, int n, const bt_leg *leg, bt_route_stretch *out)
{
    bt_path_cost c = {0};
    for (int k = 0; k < n; k++) {
        if (k > 0 && planner->task.turn_cost > 0) { // at a sharp corner
            double at[2], t[2];
            bt_leg_at(&leg[k - 1], leg[k - 1].length, at, t);
            const double angle = bt_atan2(t[0] * leg[k].ty - t[1] * leg[k].tx, t[0] * leg[k].tx + t[1] * leg[k].ty);
            const double turn = planner->task.objective == BT_ROUTE_PEAK ? 0 : planner->task.turn_cost * fabs(angle);
            c.cost += turn, c.plain += turn;
        }
        const bt_path_cost l = out ? leg_cost(planner, &leg[k], c.time, out) : kept_cost(planner, &leg[k], c.time);
        if (out) out += parts_of(planner, &leg[k]);
        const bool peak = planner->task.objective == BT_ROUTE_PEAK;
        c.cost = peak ? bt_max(c.cost, l.cost) : c.cost + l.cost;
        c.plain = peak ? bt_max(c.plain, l.plain) : c.plain + l.plain;
        c.faults |= l.faults;
        c.over += l.over, c.second += l.second, c.length += l.length, c.time += l.time, c.work += l.work;
        c.peak = bt_max(c.peak, l.peak);
    }
    return c;
}

bool bt_swath_better(const bt_path_cost *a, const bt_path_cost *b)
{
    const int blocked = BT_ROUTE_IN_NO_GO | BT_ROUTE_OUTSIDE | BT_ROUTE_TURNS;
    if ((a->faults & blocked) != (b->faults & blocked)) return !(a->faults & blocked);
    if (a->over != b->over) return a->over < b->over;
    if (fabs(a->cost - b->cost) > 1e-9 * fabs(b->cost)) return a->cost < b->cost;
    return a->second < b->second * (1 - 1e-9);
}

/// Ice in the swath: clip the floes to the stretches, arcs in slices of at most 3°.
static void clip_floes(const bt_planner *planner, bt_route *route)
{
    const bt_route_task *task = &planner->task;
    int64_t most = 0;
    for (int64_t i = 0; i < task->n_floes; i++) {
        const int64_t n = task->floe_first[i + 1] - task->floe_first[i];
        most = n > most ? n : most;
    }
    // clipping a polygon that is not convex by one line at most doubles its points
    double *w[2] = {bt_alloc((size_t)(16 * most + 64), 2 * sizeof(double)),
                    bt_alloc((size_t)(16 * most + 64), 2 * sizeof(double))};
    bt_box *box = bt_alloc((size_t)task->n_floes + 1, sizeof *box);
    for (int64_t i = 0; i < task->n_floes; i++)
        box[i] = bt_box_of(task->floe_first[i + 1] - task->floe_first[i], task->floe + 2 * task->floe_first[i]);
    for (int64_t s = 0; s < route->n_stretches; s++) {
        const bt_route_stretch *stretch = &route->stretch[s];
        const bt_leg leg = bt_swath_leg(stretch);
        const int pieces = 1 + (int)(fabs(stretch->turn) * stretch->length * 60 / BT_PI);
        // chords of the inner and outer arc, moved out so that the area of a slice is that between the arcs
        const double half = 0.5 * fabs(stretch->turn) * stretch->length / pieces;
        const double wider = half > 0 ? sqrt(2 * half / bt_sin(2 * half)) : 1, side = 0.5 * task->width;
        for (int k = 0; k < pieces; k++) {
            double v[8];
            for (int end = 0; end < 2; end++) {
                double at[2], tan[2];
                bt_leg_at(&leg, (k + end) * stretch->length / pieces, at, tan);
                for (int left = 0; left < 2; left++) {
                    double aside = left ? side : -side;
                    if (stretch->turn != 0) { // from the centre, which is 1/turn to the left
                        const double radius = 1 / stretch->turn;
                        aside = radius - wider * (radius - aside);
                        if (stretch->turn * aside > 1) aside = radius;
                    }
                    double *q = v + (left ? (end ? 4 : 6) : (end ? 2 : 0));
                    q[0] = at[0] - aside * tan[1], q[1] = at[1] + aside * tan[0];
                }
            }
            const bt_box own = bt_box_of(4, v);
            for (int64_t i = 0; i < task->n_floes; i++) {
                if (bt_box_apart(&box[i], &own)) continue;
                const int64_t first = task->floe_first[i], n = task->floe_first[i + 1] - first;
                memcpy(w[0], task->floe + 2 * first, (size_t)n * 2 * sizeof **w);
                const double area = fabs(bt_polygon_shared(n, 4, v, w));
                route->ice_area += area;
                route->ice_mass += area * task->density * task->thickness[i];
            }
        }
    }
    BT_FREE(box, w[0], w[1]);
}

void bt_swath_report(const bt_planner *planner, bt_route *route)
{
    const double *u = planner->task.drift;
    double time = 0;
    route->clearance = INFINITY;
    for (int64_t s = 0; s < route->n_stretches; s++) {
        const bt_route_stretch *stretch = &route->stretch[s];
        const bt_leg leg = bt_swath_leg(stretch);
        const int n = slices(planner, stretch->length);
        for (int k = 0; k < n; k++) {
            int64_t cell[CELLS];
            double area[CELLS], at[2], tan[2], term[BT_ROUTE_TERMS];
            const double way = (k + 0.5) * stretch->length / n;
            int middle;
            const int across = slice(planner, &leg, way, stretch->length / n, cell, area, &middle);
            for (int a = 0; a < across; a++) {
                bt_route_ice_terms(&planner->ice, &planner->task, cell[a], stretch->speed, term);
                for (int m = 1; m < BT_ROUTE_TERMS; m++)
                    if ((a < middle) == (m == BT_ROUTE_LARGE)) route->term[m] += area[a] * term[m] / route->length;
            }
            bt_leg_at(&leg, way, at, tan);
            route->term[0] += bt_swath_water(planner, tan[0], tan[1], stretch->speed) * stretch->length / n /
                route->length;
            for (int64_t e = 0; e < planner->no_go.n; e++) {
                const double now = time + way / stretch->speed, x = at[0] + u[0] * now, y = at[1] + u[1] * now;
                route->clearance =
                    bt_min(route->clearance, bt_no_go_to_edge(&planner->no_go, e, x, y) - planner->task.reach);
            }
        }
        time += stretch->length / stretch->speed;
    }
    clip_floes(planner, route);
}
