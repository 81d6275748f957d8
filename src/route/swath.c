// SPDX-License-Identifier: MIT
// Loads and areas along a path; route/swath.h.
#include "route/swath.h"

#include "base/elementary.h"
#include "bergtow/outline.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ACROSS = 64, CELLS = 4 * (1 + ACROSS) }; // points of a slice, at most; cells about them

double bt_swath_water(const bt_planner *p, double tx, double ty, double v)
{
    const double x = v * tx - p->water[0], y = v * ty - p->water[1], d = p->task.drag;
    return bt_max(d * bt_hypot(x, y) * (x * tx + y * ty), 1e-3 * d * v * v);
}

/// A slice of the swath, ds long, whose middle is s m along a leg: cells, and the areas that they stand for, m²; the
/// first *middle of them are those about its centre, and stand for lengths of the path, m. Between the middles of cells
/// it is linear: the edge of the swath may lie anywhere in a cell. On the inner side of a turn sharper than W/2 a slice
/// ends at its centre. Returns the number of cells.
static int slice(const bt_planner *p, const bt_leg *leg, double s, double ds, int64_t cell[CELLS], double area[CELLS],
                 int *middle)
{
    const bt_route_ice *r = &p->ice;
    const double w = p->task.width, inv = 1 / r->cell;
    int n = (int)ceil(w * inv - 1e-9), made = 0;
    n = n < 1 ? 1 : n > ACROSS ? ACROSS : n;
    double place[2], tangent[2], at[2];
    bt_leg_at(leg, s, place, tangent);
    bt_route_ice_place(r, place[0], place[1], at);
    const double t[2] = {tangent[0] * r->ax + tangent[1] * r->ay, tangent[1] * r->ax - tangent[0] * r->ay};
    for (int k = -1; k < n; k++) {
        const double aside = k < 0 ? 0 : w * ((k + 0.5) / n - 0.5);
        const double here = k < 0 ? ds : ds * w / n * bt_max(0, 1 - leg->turn * aside);
        if (k == 0) *middle = made;
        const double x = at[0] - aside * inv * t[1] - 0.5, y = at[1] + aside * inv * t[0] - 0.5;
        if (!(x >= 0 && y >= 0 && x < r->nx - 1 && y < r->ny - 1)) continue;
        const int64_t i = (int64_t)x, j = (int64_t)y, c = j * r->nx + i;
        const double fx = x - (double)i, fy = y - (double)j;
        cell[made] = c, area[made++] = here * (1 - fx) * (1 - fy);
        cell[made] = c + 1, area[made++] = here * fx * (1 - fy);
        cell[made] = c + r->nx, area[made++] = here * (1 - fx) * fy;
        cell[made] = c + r->nx + 1, area[made++] = here * fx * fy;
    }
    return made;
}

static int slices(const bt_planner *p, double length)
{
    return (int)ceil(length / p->ice.cell + 1e-9);
}

void bt_swath_load(const bt_planner *p, const bt_leg *leg, double length, double *sums)
{
    const int n = slices(p, length), n_speeds = p->ice.n_speeds;
    int64_t cell[CELLS];
    double area[CELLS];
    for (int k = 0; k < n; k++) {
        int middle;
        const int across = slice(p, leg, (k + 0.5) * length / n, length / n, cell, area, &middle);
        for (int a = 0; a < across; a++) {
            const float *load = (a < middle ? p->ice.line : p->ice.load) + cell[a] * n_speeds;
            for (int v = 0; v < n_speeds; v++) sums[v] += area[a] * load[v];
        }
    }
}

bt_stretch_cost bt_swath_choose(const bt_planner *p, double length, const double *load, const double *water,
                                double limit)
{
    bt_stretch_cost best = {.speed = -1, .over = true};
    for (int v = 0; v < p->task.n_speeds; v++) {
        const double force = bt_max(1e-3, p->task.weight[0]) * water[v] + load[v] / length,
                     time = length / p->task.speed[v];
        bt_stretch_cost c = {.speed = v, .force = force, .work = force * length, .time = time,
                             .over = force * p->task.force_factor > limit};
        switch (p->task.objective) {
        case BT_ROUTE_WORK: c.measure = c.work; break;
        case BT_ROUTE_TIME: c.measure = time; break;
        case BT_ROUTE_PEAK: c.measure = force; break;
        default: c.measure = length; break;
        }
        const bool better = c.over ? force < best.force : c.measure < best.measure;
        if (best.speed < 0 || (best.over && !c.over) || (best.over == c.over && better)) best = c;
    }
    return best;
}

/// Stretches of a leg: none longer than 2 W.
static int64_t parts_of(const bt_planner *p, const bt_leg *leg)
{
    return leg->length > 0 ? (int64_t)ceil(leg->length / (2 * p->task.width) - 1e-9) : 0;
}

int64_t bt_swath_stretches(const bt_planner *p, int n, const bt_leg *leg)
{
    int64_t sum = 0;
    for (int k = 0; k < n; k++) sum += parts_of(p, &leg[k]);
    return sum;
}

static bool is_near(const bt_planner *p, double x, double y)
{
    const bt_route_ice *r = &p->ice;
    double at[2];
    bt_route_ice_place(r, x, y, at);
    return p->near && at[0] >= 0 && at[1] >= 0 && at[0] < r->nx && at[1] < r->ny &&
           p->near[(int64_t)(int)at[1] * r->nx + (int)at[0]];
}

/// The stretches of a leg that begins at the time t.
static bt_path_cost leg_cost(const bt_planner *p, const bt_leg *leg, double t, bt_route_stretch *out)
{
    bt_path_cost c = {0};
    const int64_t parts = parts_of(p, leg);
    const bool peak = p->task.objective == BT_ROUTE_PEAK;
    for (int64_t m = 0; m < parts; m++) {
        const double length = leg->length / (double)parts;
        double at[2], tan[2], mid[2], t_mid[2], load[BT_ROUTE_SPEEDS] = {0}, water[BT_ROUTE_SPEEDS];
        bt_leg_at(leg, (double)m * length, at, tan);
        bt_leg_at(leg, ((double)m + 0.5) * length, mid, t_mid);
        const bt_leg part = {.x = at[0], .y = at[1], .tx = tan[0], .ty = tan[1], .length = length, .turn = leg->turn};
        bt_swath_load(p, &part, length, load);
        for (int v = 0; v < p->task.n_speeds; v++)
            water[v] = bt_swath_water(p, t_mid[0], t_mid[1], p->task.speed[v]);
        const bt_stretch_cost s = bt_swath_choose(p, length, load, water, p->task.force_limit);
        const double factor = is_near(p, mid[0], mid[1]) ? p->penalty : 1;
        const double plain = s.measure + p->task.turn_cost * fabs(part.turn) * length;
        c.faults |= bt_no_go_faults(&p->no_go, &part, length, t + c.time, p->task.speed[s.speed]);
        if (s.over) c.over += length, c.faults |= BT_ROUTE_OVER_LIMIT;
        c.cost = peak ? bt_max(c.cost, factor * plain) : c.cost + factor * plain;
        c.plain = peak ? bt_max(c.plain, plain) : c.plain + plain;
        c.second += factor * s.work;
        c.length += length;
        c.time += s.time;
        c.work += s.work;
        c.peak = bt_max(c.peak, s.force);
        if (out)
            out[m] = (bt_route_stretch){.x = at[0], .y = at[1], .tx = tan[0], .ty = tan[1], .length = length,
                                        .turn = part.turn, .speed = p->task.speed[s.speed], .force = s.force};
    }
    return c;
}

/// What a leg costs, kept: a step of the shortening leaves most legs as they are. Where no-go polygons move in the
/// frame of the ice nothing is kept.
typedef struct bt_kept_leg {
    double x, y, tx, ty, length, turn, penalty;
    bt_path_cost cost;
} bt_kept_leg;

enum { KEPT = 4096 };

static bt_path_cost kept_cost(const bt_planner *p, const bt_leg *leg, double t)
{
    if (p->task.drift[0] != 0 || p->task.drift[1] != 0 || !p->kept) return leg_cost(p, leg, t, NULL);
    const double key[7] = {leg->x, leg->y, leg->tx, leg->ty, leg->length, leg->turn, p->penalty};
    uint64_t hash = 0, bits;
    for (int k = 0; k < 7; k++) {
        memcpy(&bits, &key[k], sizeof bits);
        hash = (hash ^ bits) * 0x9e3779b97f4a7c15u;
        hash ^= hash >> 29;
    }
    bt_kept_leg *kept = &p->kept[hash % KEPT];
    if (memcmp(&kept->x, key, sizeof key) != 0 || !(kept->cost.length > 0)) {
        memcpy(&kept->x, key, sizeof key);
        kept->cost = leg_cost(p, leg, t, NULL);
    }
    return kept->cost;
}

void bt_swath_keep(bt_planner *p)
{
    free(p->kept);
    p->kept = bt_alloc(KEPT, sizeof *p->kept);
}

bt_path_cost bt_swath_cost(const bt_planner *p, int n, const bt_leg *leg, bt_route_stretch *out)
{
    bt_path_cost c = {0};
    for (int k = 0; k < n; k++) {
        if (k > 0 && p->task.turn_cost > 0) { // at a sharp corner
            double at[2], t[2];
            bt_leg_at(&leg[k - 1], leg[k - 1].length, at, t);
            const double angle = bt_atan2(t[0] * leg[k].ty - t[1] * leg[k].tx, t[0] * leg[k].tx + t[1] * leg[k].ty);
            const double turn = p->task.objective == BT_ROUTE_PEAK ? 0 : p->task.turn_cost * fabs(angle);
            c.cost += turn, c.plain += turn;
        }
        const bt_path_cost l = out ? leg_cost(p, &leg[k], c.time, out) : kept_cost(p, &leg[k], c.time);
        if (out) out += parts_of(p, &leg[k]);
        const bool peak = p->task.objective == BT_ROUTE_PEAK;
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

/// Area of a polygon of n points within the convex one of m, anticlockwise, by cutting it at each of its edges
/// [Sutherland & Hodgman 1974]. Of a polygon that is not convex it leaves seams, whose areas cancel. v, w: [n + m]
/// points to work on.
static double shared_area(int64_t n, const double *v, int m, const double *by, double *w[2])
{
    int now = 0;
    memcpy(w[0], v, (size_t)n * 2 * sizeof *v);
    for (int e = 0; e < m && n > 0; e++) {
        const double *p = by + 2 * e, *q = by + 2 * (e + 1 < m ? e + 1 : 0), ex = q[0] - p[0], ey = q[1] - p[1];
        const double *in = w[now], *last = in + 2 * (n - 1);
        double *out = w[1 - now], before = ex * (last[1] - p[1]) - ey * (last[0] - p[0]);
        int64_t kept = 0;
        for (int64_t k = 0; k < n; k++) {
            const double *at = in + 2 * k, inside = ex * (at[1] - p[1]) - ey * (at[0] - p[0]);
            if ((inside >= 0) != (before >= 0)) {
                const double f = before / (before - inside);
                out[2 * kept] = last[0] + f * (at[0] - last[0]);
                out[2 * kept++ + 1] = last[1] + f * (at[1] - last[1]);
            }
            if (inside >= 0) {
                out[2 * kept] = at[0];
                out[2 * kept++ + 1] = at[1];
            }
            last = at, before = inside;
        }
        n = kept;
        now = 1 - now;
    }
    double twice = 0; // about the first point: coordinates are large beside floes
    const double *o = w[now];
    for (int64_t k = 1; k + 1 < n; k++)
        twice += (o[2 * k] - o[0]) * (o[2 * k + 3] - o[1]) - (o[2 * k + 1] - o[1]) * (o[2 * k + 2] - o[0]);
    return 0.5 * fabs(twice);
}

/// Ice in the swath: floes clipped to the slices between the ends of stretches, arcs in slices of 3°.
static void clip_floes(const bt_planner *p, bt_route *r)
{
    const bt_route_task *t = &p->task;
    int64_t most = 0;
    for (int64_t i = 0; i < t->n_floes; i++) {
        const int64_t n = t->floe_first[i + 1] - t->floe_first[i];
        most = n > most ? n : most;
    }
    // cutting a polygon that is not convex by one line at most doubles its points
    double *w[2] = {bt_alloc((size_t)(16 * most + 64), 2 * sizeof(double)),
                    bt_alloc((size_t)(16 * most + 64), 2 * sizeof(double))};
    double *box = bt_alloc((size_t)t->n_floes + 1, 4 * sizeof *box);
    for (int64_t i = 0; i < t->n_floes; i++) {
        double *b = box + 4 * i;
        b[0] = b[1] = INFINITY, b[2] = b[3] = -INFINITY;
        for (int64_t k = t->floe_first[i]; k < t->floe_first[i + 1]; k++)
            for (int a = 0; a < 2; a++) {
                b[a] = bt_min(b[a], t->floe[2 * k + a]);
                b[2 + a] = bt_max(b[2 + a], t->floe[2 * k + a]);
            }
    }
    for (int64_t s = 0; s < r->n_stretches; s++) {
        const bt_route_stretch *o = &r->stretch[s];
        const bt_leg leg = {.x = o->x, .y = o->y, .tx = o->tx, .ty = o->ty, .length = o->length, .turn = o->turn};
        const int pieces = 1 + (int)(fabs(o->turn) * o->length * 60 / BT_PI);
        // chords of the inner and outer arc, moved out so that the area of a slice is that between the arcs
        const double half = 0.5 * fabs(o->turn) * o->length / pieces;
        const double wider = half > 0 ? sqrt(2 * half / bt_sin(2 * half)) : 1, side = 0.5 * t->width;
        for (int k = 0; k < pieces; k++) {
            double v[8], low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
            for (int end = 0; end < 2; end++) {
                double at[2], tan[2];
                bt_leg_at(&leg, (k + end) * o->length / pieces, at, tan);
                for (int left = 0; left < 2; left++) {
                    double aside = left ? side : -side;
                    if (o->turn != 0) { // from the centre, which is 1/turn to the left
                        const double radius = 1 / o->turn;
                        aside = radius - wider * (radius - aside);
                        if (o->turn * aside > 1) aside = radius;
                    }
                    double *q = v + (left ? (end ? 4 : 6) : (end ? 2 : 0));
                    q[0] = at[0] - aside * tan[1], q[1] = at[1] + aside * tan[0];
                    for (int a = 0; a < 2; a++) low[a] = bt_min(low[a], q[a]), high[a] = bt_max(high[a], q[a]);
                }
            }
            for (int64_t i = 0; i < t->n_floes; i++) {
                const double *b = box + 4 * i;
                if (b[0] > high[0] || b[1] > high[1] || b[2] < low[0] || b[3] < low[1]) continue;
                const int64_t first = t->floe_first[i];
                const double area = shared_area(t->floe_first[i + 1] - first, t->floe + 2 * first, 4, v, w);
                r->ice_area += area;
                r->ice_mass += area * t->density * t->thickness[i];
            }
        }
    }
    free(box);
    free(w[0]);
    free(w[1]);
}

void bt_swath_report(const bt_planner *p, bt_route *r)
{
    const double *u = p->task.drift;
    double time = 0;
    r->clearance = INFINITY;
    for (int64_t s = 0; s < r->n_stretches; s++) {
        const bt_route_stretch *o = &r->stretch[s];
        const bt_leg leg = {.x = o->x, .y = o->y, .tx = o->tx, .ty = o->ty, .length = o->length, .turn = o->turn};
        const int n = slices(p, o->length);
        for (int k = 0; k < n; k++) {
            int64_t cell[CELLS];
            double area[CELLS], at[2], tan[2], term[BT_ROUTE_TERMS];
            const double way = (k + 0.5) * o->length / n;
            int middle;
            const int across = slice(p, &leg, way, o->length / n, cell, area, &middle);
            for (int a = 0; a < across; a++) {
                bt_route_ice_terms(&p->ice, &p->task, cell[a], o->speed, term);
                for (int m = 1; m < BT_ROUTE_TERMS; m++)
                    if ((a < middle) == (m == BT_ROUTE_LARGE)) r->term[m] += area[a] * term[m] / r->length;
            }
            bt_leg_at(&leg, way, at, tan);
            r->term[0] += bt_swath_water(p, tan[0], tan[1], o->speed) * o->length / n / r->length;
            for (int64_t e = 0; e < p->no_go.n; e++) {
                const double now = time + way / o->speed, x = at[0] + u[0] * now, y = at[1] + u[1] * now;
                r->clearance = bt_min(r->clearance, bt_no_go_to_edge(&p->no_go, e, x, y) - p->task.reach);
            }
        }
        time += o->length / o->speed;
    }
    clip_floes(p, r);
}
