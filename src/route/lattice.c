// SPDX-License-Identifier: MIT
// A lattice of poses, its moves, and A* over them; route/lattice.h.
//
// Poses. Places are whole multiples of the spacing; headings are those of vectors of small whole numbers, 16 or 32
// nearly even ones, so that a straight move ends on a place.
// Moves from a heading u0: straight on; and turns to u1 on an arc of radius R by one or two headings, of 2 R by one, as
//     straight a − T, arc, straight b − T,   T = R tan(δ/2),   a u0 + b u1 = whole multiples of the spacing, a, b >= T
// of which the shortest is taken: a move is a corner of a path through way-points, and the path that is found is one.
// With R = 0 the shortest is a turn on the spot.
// Cost. Slices of the swath, as long as the distance q <= W/4 of their places, are added up first, at every place for
// each heading; the load of a move is the sum of such slices along it, the nearest in place and heading, the same list
// everywhere. What is found is priced again by its own swath (swath.c). Rejected: a list of all cells under a move,
// without the error of half of q and of half a step of headings, but thirty times as long.
// Order. Costs are rounded up to whole multiples of 1e-5 of the least cost of a spacing, and the bound (least cost of a
// metre times the distance to the goal, straight or by the squares that the berg's centre may be in, whichever is
// longer) down: sums do not depend on their order, and of equal costs the lower index goes first. A goal that no chain
// of squares leads to is given up at once.
#include "route/lattice.h"

#include "base/elementary.h"

#include <math.h>
#include <stdlib.h>

enum { MOST_HEADINGS = 32, MOST_MOVES = 7 };
#define UNITS 1e5 ///< of cost in the least cost of a spacing
#define THERE 0.75 ///< spacings from the goal
#define UNREACHED INT32_MAX

typedef struct move {
    int dx, dy, heading;     ///< places; heading after it
    double length, turned;   ///< m; rad
    double corner;           ///< a, m; the corner of a turn is so far ahead
    int n_legs;
    bt_leg leg[3];           ///< in the frame of the lattice, from the origin
    double mid[2];           ///< the place halfway, m
    double water[BT_ROUTE_SPEEDS]; ///< mean water drag, N
    int n_slices;
    int64_t *slice;          ///< [n_slices] from that of heading 0 at the node
    double *along;           ///< [n_slices] m
} move;

struct bt_lattice {
    bt_planner *p;
    double h, ax, ay;
    int i0, j0, nx, ny, n_headings, per_place;
    double step;             ///< largest angle between neighbouring headings, rad
    int vector[MOST_HEADINGS][2];
    double unit[MOST_HEADINGS][2];
    move of[MOST_HEADINGS][MOST_MOVES];
    int n_moves[MOST_HEADINGS];
    double per_step;         ///< least length of a move over the steps that it is made of, m (steps_of)
    int fine, pad, wide, high; ///< q = h/fine; places of slices beside the lattice; of slices along x and y
    float *across;           ///< [high][wide][n_headings/2][n_speeds] mean load of a slice, N: one cache line a place
};

// --- moves ----------------------------------------------------------------------------------------------------------

static void choose_headings(bt_lattice *l, int n)
{
    static const int first[2][8][2] = {{{1, 0}, {2, 1}, {1, 1}, {1, 2}},
                                       {{1, 0}, {5, 1}, {5, 2}, {3, 2}, {1, 1}, {2, 3}, {2, 5}, {1, 5}}};
    l->n_headings = n;
    for (int k = 0; k < n; k++) {
        const int *v = first[n == 32][k % (n / 4)];
        int x = v[0], y = v[1];
        for (int quarter = 0; quarter < k / (n / 4); quarter++) {
            const int was = x;
            x = -y, y = was;
        }
        l->vector[k][0] = x, l->vector[k][1] = y;
        const double length = sqrt((double)(x * x + y * y));
        l->unit[k][0] = x / length, l->unit[k][1] = y / length;
    }
    for (int k = 0; k < n; k++) {
        const double *u = l->unit[k], *w = l->unit[(k + 1) % n];
        l->step = bt_max(l->step, bt_atan2(u[0] * w[1] - u[1] * w[0], u[0] * w[0] + u[1] * w[1]));
    }
}

static void add_leg(move *m, double length, double turn)
{
    if (!(length > 1e-9)) return;
    double at[2] = {0, 0}, t[2];
    if (m->n_legs) bt_leg_at(&m->leg[m->n_legs - 1], m->leg[m->n_legs - 1].length, at, t);
    else t[0] = m->leg[0].tx, t[1] = m->leg[0].ty;
    m->leg[m->n_legs++] = (bt_leg){.length = length, .x = at[0], .y = at[1], .tx = t[0], .ty = t[1], .turn = turn};
    m->length += length;
}

/// A turn from heading k to k + by on an arc of this radius.
static void make_turn(const bt_lattice *l, int k, int by, double radius, move *m)
{
    const int to = (k + by + l->n_headings) % l->n_headings;
    const double *u = l->unit[k], *w = l->unit[to], cross = u[0] * w[1] - u[1] * w[0];
    const double angle = bt_atan2(cross, u[0] * w[0] + u[1] * w[1]), cut = radius * bt_tan(0.5 * fabs(angle));
    const int reach = (int)(2 * cut / l->h) + 8;
    double best = INFINITY, a_best = 0, b_best = 0;
    *m = (move){.heading = to, .turned = fabs(angle)};
    for (int y = -reach; y <= reach; y++)
        for (int x = -reach; x <= reach; x++) {
            const double a = l->h * (x * w[1] - y * w[0]) / cross, b = l->h * (y * u[0] - x * u[1]) / cross;
            if (a < cut - 1e-9 * l->h || b < cut - 1e-9 * l->h || !(a + b < best - 1e-9 * l->h)) continue;
            best = a + b;
            a_best = a, b_best = b;
            m->dx = x, m->dy = y;
        }
    m->corner = a_best;
    m->leg[0].tx = u[0], m->leg[0].ty = u[1];
    add_leg(m, a_best - cut, 0);
    if (radius > 0) add_leg(m, radius * fabs(angle), copysign(1 / radius, angle));
    if (!(radius > 0) && m->n_legs) m->leg[m->n_legs].tx = w[0], m->leg[m->n_legs].ty = w[1];
    add_leg(m, b_best - cut, 0);
}

static void make_moves(bt_lattice *l, double radius)
{
    for (int k = 0; k < l->n_headings; k++) {
        move *m = l->of[k];
        const int *v = l->vector[k];
        *m = (move){.dx = v[0], .dy = v[1], .heading = k};
        m->leg[0].tx = l->unit[k][0], m->leg[0].ty = l->unit[k][1];
        add_leg(m, l->h * sqrt((double)(v[0] * v[0] + v[1] * v[1])), 0);
        int n = 1;
        for (int by = -2; by <= 2; by++)
            for (int wide = 1; by != 0 && wide <= (radius > 0 && abs(by) == 1 ? 2 : 1); wide++)
                make_turn(l, k, by, wide * radius, &m[n++]);
        l->n_moves[k] = n;
    }
}

static void make_slices(bt_lattice *l)
{
    const bt_route_ice *r = &l->p->ice;
    const int n_speeds = r->n_speeds;
    const double w = l->p->task.width, q = l->h / l->fine;
    const int n_across = (int)ceil(w / r->cell), n_along = (int)ceil(q / r->cell), n = n_across * n_along;
    l->across = bt_alloc((size_t)l->wide * (size_t)l->high * (size_t)(l->n_headings / 2) * (size_t)n_speeds,
                         sizeof *l->across);
    double(*to)[2] = bt_alloc((size_t)n, sizeof *to); // points of a slice, in cells
    const int middle = n_across % 2 ? 1 : 2; // of each row of points, beside the path
    for (int k = 0; k < l->n_headings / 2; k++) {
        const double *u = l->unit[k];
        for (int b = 0; b < n; b++) {
            const double along = q * ((b / n_across + 0.5) / n_along - 0.5) / r->cell;
            const double aside = w * ((b % n_across + 0.5) / n_across - 0.5) / r->cell;
            to[b][0] = along * u[0] - aside * u[1], to[b][1] = along * u[1] + aside * u[0];
        }
        for (int j = 0; j < l->high; j++)
            for (int i = 0; i < l->wide; i++) {
                float *out = l->across + (((int64_t)j * l->wide + i) * (l->n_headings / 2) + k) * n_speeds;
                const double x = ((l->i0 * l->fine + i - l->pad) * q - r->x0) / r->cell;
                const double y = ((l->j0 * l->fine + j - l->pad) * q - r->y0) / r->cell;
                for (int b = 0; b < n; b++) {
                    const int64_t cell = (int64_t)(int)(y + to[b][1]) * r->nx + (int)(x + to[b][0]);
                    for (int v = 0; v < n_speeds; v++) out[v] += r->load[cell * n_speeds + v];
                    if (abs(2 * (b % n_across) + 1 - n_across) >= 2) continue;
                    for (int v = 0; v < n_speeds; v++)
                        out[v] += r->line[cell * n_speeds + v] * (float)(n_across / (w * middle));
                }
                for (int v = 0; v < n_speeds; v++) out[v] *= (float)(w / n);
            }
    }
    free(to);
}

static int nearest_heading(const bt_lattice *l, const double t[2])
{
    int best = 0;
    for (int k = 1; k < l->n_headings; k++) {
        const double *u = l->unit[k], *b = l->unit[best];
        if (u[0] * t[0] + u[1] * t[1] > b[0] * t[0] + b[1] * t[1]) best = k;
    }
    return best % (l->n_headings / 2);
}

/// Slices of a move, and what else follows from its legs.
static void make_mask(const bt_lattice *l, move *m)
{
    const bt_planner *p = l->p;
    const double q = l->h / l->fine;
    int cap = 0;
    for (int g = 0; g < m->n_legs; g++) cap += (int)ceil(m->leg[g].length / q);
    m->slice = bt_alloc((size_t)cap + 1, sizeof *m->slice);
    m->along = bt_alloc((size_t)cap + 1, sizeof *m->along);
    double way = 0;
    for (int g = 0; g < m->n_legs; g++) {
        const bt_leg *leg = &m->leg[g];
        const int along = (int)ceil(leg->length / q - 1e-9);
        for (int a = 0; a < along; a++) {
            double at[2], t[2];
            bt_leg_at(leg, (a + 0.5) * leg->length / along, at, t);
            const int64_t i = (int64_t)floor(at[0] / q + 0.5), j = (int64_t)floor(at[1] / q + 0.5);
            m->slice[m->n_slices] = (j * l->wide + i) * (l->n_headings / 2) + nearest_heading(l, t);
            m->along[m->n_slices++] = leg->length / along;
        }
        if (way <= 0.5 * m->length) bt_leg_at(leg, bt_min(leg->length, 0.5 * m->length - way), m->mid, (double[2]){0});
        way += leg->length;
    }
    for (int s = 0; s < p->task.n_speeds; s++) {
        double sum = 0;
        for (int g = 0; g < m->n_legs; g++) {
            double at[2], t[2];
            bt_leg_at(&m->leg[g], 0.5 * m->leg[g].length, at, t);
            sum += m->leg[g].length * bt_swath_water(p, t[0] * l->ax - t[1] * l->ay, t[0] * l->ay + t[1] * l->ax,
                                                     p->task.speed[s]);
        }
        m->water[s] = m->length > 0 ? sum / m->length : 0;
    }
}

/// A move cut into steps, each from the square about a place to one of the eight squares about that one: how many. Few,
/// not the fewest.
static int steps_of(const bt_lattice *l, const move *m)
{
    enum { FINE = 32 };
    int steps = 0, x0 = 0, y0 = 0, x1 = 0, y1 = 0; // squares: of the last step, and the last one beside it
    for (int g = 0; g < m->n_legs; g++) {
        const int n = (int)ceil(m->leg[g].length / l->h * FINE);
        for (int a = 1; a <= n; a++) {
            double at[2], t[2];
            bt_leg_at(&m->leg[g], m->leg[g].length * a / n, at, t);
            const int x = (int)floor(at[0] / l->h + 0.5), y = (int)floor(at[1] / l->h + 0.5);
            if (abs(x - x0) > 1 || abs(y - y0) > 1) x0 = x1, y0 = y1, steps++;
            x1 = x, y1 = y;
        }
    }
    return steps + (x1 != x0 || y1 != y0);
}

bt_lattice *bt_lattice_make(bt_planner *p, double ax, double ay, double spacing, double cell)
{
    const bt_route_task *t = &p->task;
    bt_lattice *l = bt_alloc(1, sizeof *l);
    l->p = p, l->h = spacing, l->ax = ax, l->ay = ay;
    choose_headings(l, t->headings);
    make_moves(l, t->radius);
    l->per_step = INFINITY;
    for (int k = 0; k < l->n_headings; k++)
        for (int m = 0; m < l->n_moves[k]; m++) {
            const int steps = steps_of(l, &l->of[k][m]);
            if (steps > 0) l->per_step = bt_min(l->per_step, l->of[k][m].length / steps);
        }
    double longest = 0, low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int k = 0; k < l->n_headings; k++)
        for (int m = 0; m < l->n_moves[k]; m++) longest = bt_max(longest, l->of[k][m].length);
    for (int c = 0; c < 4; c++) {
        const double x = t->extent[c & 1 ? 2 : 0] - t->start[0], y = t->extent[c & 2 ? 3 : 1] - t->start[1];
        const double at[2] = {x * ax + y * ay, y * ax - x * ay};
        for (int a = 0; a < 2; a++) low[a] = bt_min(low[a], at[a]), high[a] = bt_max(high[a], at[a]);
    }
    l->i0 = (int)ceil(low[0] / spacing), l->j0 = (int)ceil(low[1] / spacing);
    l->nx = (int)floor(high[0] / spacing) - l->i0 + 1, l->ny = (int)floor(high[1] / spacing) - l->j0 + 1;
    l->per_place = l->n_headings;

    l->fine = (int)ceil(4 * spacing / t->width - 1e-9);
    l->pad = (int)ceil(longest / spacing * l->fine) + 1;
    l->wide = (l->nx - 1) * l->fine + 2 * l->pad + 1, l->high = (l->ny - 1) * l->fine + 2 * l->pad + 1;
    // a whole number of cells between places, and cells under every slice
    const int by = (int)(spacing / cell + 0.5);
    const int half = (int)ceil((l->pad + 1) * by / (double)l->fine + t->width / cell) + 1;
    p->ice = (bt_route_ice){.nx = (l->nx - 1) * by + 2 * half, .ny = (l->ny - 1) * by + 2 * half,
                            .cell = cell, .x0 = (l->i0 * by - half) * cell, .y0 = (l->j0 * by - half) * cell,
                            .ax = ax, .ay = ay, .ox = t->start[0], .oy = t->start[1]};
    bt_route_ice_make(&p->ice, t);
    for (int k = 0; k < l->n_headings; k++)
        for (int m = 0; m < l->n_moves[k]; m++) make_mask(l, &l->of[k][m]);
    make_slices(l);
    return l;
}

void bt_lattice_free(bt_lattice *l)
{
    for (int k = 0; k < l->n_headings; k++)
        for (int m = 0; m < l->n_moves[k]; m++) {
            free(l->of[k][m].slice);
            free(l->of[k][m].along);
        }
    free(l->across);
    free(l);
}

double bt_lattice_spacing(const bt_lattice *l)
{
    return l->h;
}

// --- the open list: a heap of four children each, for the sake of the cache -----------------------------------------

typedef struct entry {
    int64_t bound;
    int32_t state;
} entry;

typedef struct heap {
    entry *e;
    size_t n, cap;
} heap;

static bool before(entry a, entry b)
{
    return a.bound != b.bound ? a.bound < b.bound : a.state < b.state;
}

static void push(heap *q, entry e)
{
    if (q->n == q->cap) q->e = bt_realloc(q->e, q->cap = q->cap ? 2 * q->cap : 1024, sizeof *q->e);
    size_t k = q->n++;
    for (; k > 0 && before(e, q->e[(k - 1) / 4]); k = (k - 1) / 4) q->e[k] = q->e[(k - 1) / 4];
    q->e[k] = e;
}

static entry pop(heap *q)
{
    const entry top = q->e[0], last = q->e[--q->n];
    size_t k = 0;
    for (size_t child; (child = 4 * k + 1) < q->n; k = child) {
        const size_t end = child + 4 < q->n ? child + 4 : q->n;
        for (size_t other = child + 1; other < end; other++)
            if (before(q->e[other], q->e[child])) child = other;
        if (!before(q->e[child], last)) break;
        q->e[k] = q->e[child];
    }
    q->e[k] = last;
    return top;
}

// --- search ----------------------------------------------------------------------------------------------------------

typedef struct search {
    const bt_lattice *l;
    int objective;
    double limit, least;  ///< of the mean force, N; least cost of a metre
    double unit;          ///< of cost
    double goal[4];       ///< in the frame of the lattice, m
    int64_t *cost;        ///< [states]
    int32_t *from;
    float *time;          ///< s; NULL = nothing moves
    int32_t *steps;       ///< [places] to the goal round what is kept out of, at least; NULL = not known
    uint8_t *by, *done;
    heap open;
} search;

/// Distance of a place of the lattice to the goal, m.
static double to_goal(const search *s, int i, int j)
{
    const double x = i * s->l->h - s->goal[0], y = j * s->l->h - s->goal[1];
    const double ex = s->goal[2] - s->goal[0], ey = s->goal[3] - s->goal[1], square = ex * ex + ey * ey;
    const double dot = x * ex + y * ey, f = dot <= 0 || !(square > 0) ? 0 : dot >= square ? 1 : dot / square;
    return bt_hypot(x - f * ex, y - f * ey);
}

/// Steps from square to square, of those that the berg's centre may be in, from each place to the nearest at the goal:
/// breadth first from there. No move makes more of them than its length / per_step, and from place to place of a move
/// their number falls by no more than it makes: the bound that follows is admissible and consistent. Where polygons
/// move in the frame of the ice there is none; nor where a hull smaller than a square may leave the squares of the
/// lattice.
/// Of states that are looked at it saves a tenth to a quarter in mazes, and all where no chain leads to the goal.
static void count_steps(search *s)
{
    const bt_lattice *l = s->l;
    const bt_planner *p = l->p;
    if (p->no_go.n == 0 || s->time || p->task.reach < 0.5 * l->h) return;
    const int32_t n = (int32_t)(l->nx * l->ny);
    int32_t *queue = bt_alloc((size_t)n, sizeof *queue), head = 0, tail = 0;
    s->steps = bt_alloc((size_t)n, sizeof *s->steps);
    const double least = p->no_go.need - 0.708 * l->h; // of the middle of a square of which a corner may be free
    for (int32_t k = 0; k < n; k++) {
        const int i = l->i0 + k % l->nx, j = l->j0 + k / l->nx;
        const double *o = p->task.start, x = i * l->h, y = j * l->h;
        s->steps[k] = UNREACHED;
        if (to_goal(s, i, j) <= THERE * l->h) s->steps[queue[tail++] = k] = 0;
        else if (bt_no_go_distance(&p->no_go, o[0] + x * l->ax - y * l->ay, o[1] + x * l->ay + y * l->ax) < least)
            s->steps[k] = -1;
    }
    while (head < tail) {
        const int32_t k = queue[head++];
        for (int side = 0; side < 9; side++) {
            const int i = k % l->nx + side % 3 - 1, j = k / l->nx + side / 3 - 1;
            if (i < 0 || j < 0 || i >= l->nx || j >= l->ny || s->steps[j * l->nx + i] != UNREACHED) continue;
            s->steps[j * l->nx + i] = s->steps[k] + 1;
            queue[tail++] = j * l->nx + i;
        }
    }
    for (int32_t k = 0; k < n; k++)
        if (s->steps[k] < 0) s->steps[k] = UNREACHED;
    free(queue);
}

/// Of the cost from a place to the goal, in units; −1: no way leads there.
static int64_t bound_of(const search *s, int i, int j)
{
    const bt_lattice *l = s->l;
    const int32_t steps = s->steps ? s->steps[(j - l->j0) * l->nx + (i - l->i0)] : 0;
    if (steps == UNREACHED) return -1;
    if (s->objective == BT_ROUTE_PEAK) return 0;
    return (int64_t)(bt_max(bt_max(0, to_goal(s, i, j) - THERE * l->h), (1 - 1e-9) * l->per_step * steps) * s->least /
                     s->unit);
}

static double least_cost(const bt_planner *p, int objective)
{
    const bt_route_task *t = &p->task;
    if (objective == BT_ROUTE_LENGTH) return 1;
    if (objective == BT_ROUTE_TIME) return 1 / t->speed[0];
    enum { DIRECTIONS = 256 };
    double least = INFINITY;
    for (int k = 0; k < DIRECTIONS; k++)
        for (int s = 0; s < t->n_speeds; s++) {
            double sine, cosine;
            bt_sincos(2 * BT_PI * k / DIRECTIONS, &sine, &cosine);
            least = bt_min(least, bt_swath_water(p, cosine, sine, t->speed[s]));
        }
    return 0.999 * bt_max(1e-3, t->weight[0]) * least; // between the directions it is less by 3e-4 at most
}

static bool is_goal(const search *s, int i, int j, int k)
{
    const bt_lattice *l = s->l;
    const double heading = l->p->task.goal_heading;
    if (to_goal(s, i, j) > THERE * l->h) return false;
    if (isnan(heading)) return true;
    double sine, cosine;
    bt_sincos(heading, &sine, &cosine);
    const double x = cosine * l->ax + sine * l->ay, y = sine * l->ax - cosine * l->ay, *u = l->unit[k];
    return fabs(bt_atan2(u[0] * y - u[1] * x, u[0] * x + u[1] * y)) < 0.51 * l->step;
}

static bt_leg placed(const bt_lattice *l, const bt_leg *leg, double x, double y)
{
    const double *o = l->p->task.start, fx = x + leg->x, fy = y + leg->y;
    bt_leg out = *leg;
    out.x = o[0] + fx * l->ax - fy * l->ay, out.y = o[1] + fx * l->ay + fy * l->ax;
    out.tx = leg->tx * l->ax - leg->ty * l->ay, out.ty = leg->tx * l->ay + leg->ty * l->ax;
    return out;
}

static double factor_at(const bt_lattice *l, double x, double y)
{
    const bt_planner *p = l->p;
    if (!p->near) return 1;
    const int64_t i = (int64_t)((x - p->ice.x0) / p->ice.cell), j = (int64_t)((y - p->ice.y0) / p->ice.cell);
    return p->near[j * p->ice.nx + i] ? p->penalty : 1;
}

/// Cost and time of a move from a place, in units; −1: not allowed.
static int64_t price(const search *s, const move *m, int i, int j, double time, double *took)
{
    const bt_lattice *l = s->l;
    const bt_planner *p = l->p;
    const bt_route_task *t = &p->task;
    const double turn = t->turn_cost * m->turned, h = l->h;
    *took = 0;
    if (!(m->length > 0)) return s->objective == BT_ROUTE_PEAK ? 0 : (int64_t)ceil(turn / s->unit);
    const int64_t place = ((j - l->j0) * (int64_t)l->fine + l->pad) * l->wide + (i - l->i0) * l->fine + l->pad;
    const int64_t base = place * (l->n_headings / 2);
    double load[BT_ROUTE_SPEEDS] = {0};
    if (t->n_speeds == 1) {
        double sum = 0;
        for (int c = 0; c < m->n_slices; c++) sum += m->along[c] * l->across[base + m->slice[c]];
        load[0] = sum;
    } else {
        for (int c = 0; c < m->n_slices; c++) {
            const float *f = l->across + (base + m->slice[c]) * t->n_speeds;
            for (int v = 0; v < t->n_speeds; v++) load[v] += m->along[c] * f[v];
        }
    }
    bt_stretch_cost c = bt_swath_choose(p, m->length, load, m->water, s->limit);
    if (c.over) return -1;
    *took = c.time;
    double now = time;
    const double mid = time + 0.5 * c.time, half = 0.5 * m->length;
    const bt_leg middle = placed(l, &(bt_leg){.x = m->mid[0], .y = m->mid[1]}, i * h, j * h);
    const bool clear = bt_no_go_clear(&p->no_go, middle.x, middle.y, half, mid, t->speed[c.speed]);
    for (int g = 0; g < m->n_legs && !clear; g++) {
        const bt_leg leg = placed(l, &m->leg[g], i * h, j * h);
        if (bt_no_go_faults(&p->no_go, &leg, leg.length, now, t->speed[c.speed])) return -1;
        now += leg.length / t->speed[c.speed];
    }
    const double factor = factor_at(l, i * h + m->mid[0], j * h + m->mid[1]);
    if (s->objective == BT_ROUTE_PEAK) return (int64_t)ceil((c.force * factor) / s->unit);
    const double measure = t->objective == BT_ROUTE_PEAK ? c.work : c.measure;
    return (int64_t)ceil((factor * measure + turn) / s->unit);
}

static void look(search *s, int32_t from, int i, int j, int k)
{
    const bt_lattice *l = s->l;
    for (int a = 0; a < l->n_moves[k]; a++) {
        const move *m = &l->of[k][a];
        const int x = i + m->dx, y = j + m->dy;
        if (x < l->i0 || y < l->j0 || x >= l->i0 + l->nx || y >= l->j0 + l->ny) continue;
        const int32_t to = ((y - l->j0) * l->nx + (x - l->i0)) * l->n_headings + m->heading;
        if (s->done[to]) continue;
        const int64_t so_far = s->cost[from];
        const bool peak = s->objective == BT_ROUTE_PEAK;
        // what it costs at least
        if (s->cost[to] <= so_far + (peak ? 0 : (int64_t)(m->length * s->least / s->unit))) continue;
        const int64_t bound = bound_of(s, x, y);
        if (bound < 0) continue;
        double took;
        const int64_t more = price(s, m, i, j, s->time ? s->time[from] : 0, &took);
        if (more < 0) continue;
        const int64_t cost = peak ? (more > so_far ? more : so_far) : so_far + more;
        if (cost >= s->cost[to]) continue;
        s->cost[to] = cost;
        s->from[to] = from;
        s->by[to] = (uint8_t)a;
        if (s->time) s->time[to] = (float)(s->time[from] + took);
        push(&s->open, (entry){cost + bound, to});
    }
}

static void split(const bt_lattice *l, int32_t state, int *i, int *j, int *k)
{
    *k = state % l->n_headings;
    *i = l->i0 + state / l->n_headings % l->nx;
    *j = l->j0 + state / l->n_headings / l->nx;
}

/// The moves that led to a state, as legs and way-points.
static void follow(const search *s, int32_t last, bt_lattice_way *f)
{
    const bt_lattice *l = s->l;
    int n = 0;
    for (int32_t at = last; s->from[at] >= 0; at = s->from[at]) n++;
    int32_t *chain = bt_alloc((size_t)n + 1, sizeof *chain);
    chain[n] = last;
    for (int k = n; k > 0; k--) chain[k - 1] = s->from[chain[k]];
    f->point = bt_alloc((size_t)n + 1, sizeof *f->point);
    f->leg = bt_alloc(3 * (size_t)n + 1, sizeof *f->leg);
    f->node = bt_alloc((size_t)n + 1, sizeof *f->node);
    f->node_leg = bt_alloc((size_t)n + 1, sizeof *f->node_leg);
    for (int a = 0; a <= n; a++) {
        int i, j, k;
        split(l, chain[a], &i, &j, &k);
        const double *u = l->unit[k], x = i * l->h, y = j * l->h;
        const bt_leg here = placed(l, &(bt_leg){.tx = u[0], .ty = u[1]}, x, y);
        f->node[a][0] = here.x, f->node[a][1] = here.y, f->node[a][2] = bt_atan2(here.ty, here.tx);
        f->node_leg[a] = f->n_legs;
        if (a == n) {
            f->point[f->n_points][0] = here.x, f->point[f->n_points++][1] = here.y;
            break;
        }
        const move *m = &l->of[k][s->by[chain[a + 1]]];
        for (int g = 0; g < m->n_legs; g++) f->leg[f->n_legs++] = placed(l, &m->leg[g], x, y);
        if (m->turned > 0) {
            f->point[f->n_points][0] = here.x + m->corner * here.tx;
            f->point[f->n_points++][1] = here.y + m->corner * here.ty;
        }
    }
    f->n_nodes = n + 1;
    free(chain);
}

bool bt_lattice_search(bt_lattice *l, const double goal[4], int objective, double limit, double *peak,
                       bt_lattice_way *f)
{
    bt_planner *p = l->p;
    const bt_route_task *t = &p->task;
    const size_t states = (size_t)l->nx * (size_t)l->ny * (size_t)l->n_headings;
    search s = {.l = l, .objective = objective, .limit = limit};
    for (int a = 0; a < 4; a += 2) {
        const double x = goal[a] - t->start[0], y = goal[a + 1] - t->start[1];
        s.goal[a] = x * l->ax + y * l->ay, s.goal[a + 1] = y * l->ax - x * l->ay;
    }
    s.least = least_cost(p, objective == BT_ROUTE_PEAK || t->objective == BT_ROUTE_PEAK ? BT_ROUTE_WORK : objective);
    s.unit = objective == BT_ROUTE_PEAK ? 1e-3 * s.least : s.least * l->h / UNITS;
    s.cost = bt_alloc(states, sizeof *s.cost);
    s.from = bt_alloc(states, sizeof *s.from);
    s.by = bt_alloc(states, sizeof *s.by);
    s.done = bt_alloc(states, sizeof *s.done);
    if (t->drift[0] != 0 || t->drift[1] != 0) s.time = bt_alloc(states, sizeof *s.time);
    for (size_t k = 0; k < states; k++) s.cost[k] = INT64_MAX, s.from[k] = -1;
    count_steps(&s);
    for (int k = 0; k < l->n_headings; k++) {
        if (!isnan(t->start_heading) && k > 0) break; // the frame's x axis is the heading
        const int32_t at = (-l->j0 * l->nx - l->i0) * l->n_headings + k;
        s.cost[at] = 0;
        const int64_t bound = bound_of(&s, 0, 0);
        if (bound >= 0) push(&s.open, (entry){bound, at});
    }
    *f = (bt_lattice_way){0};
    bool found = false;
    while (s.open.n > 0 && !found) {
        const entry e = pop(&s.open);
        if (s.done[e.state]) continue;
        s.done[e.state] = 1;
        p->states++;
        int i, j, k;
        split(l, e.state, &i, &j, &k);
        if (is_goal(&s, i, j, k)) {
            found = true;
            if (peak) *peak = (double)s.cost[e.state] * s.unit;
            follow(&s, e.state, f);
        } else look(&s, e.state, i, j, k);
    }
    free(s.cost);
    free(s.from);
    free(s.by);
    free(s.done);
    free(s.time);
    free(s.steps);
    free(s.open.e);
    return found;
}

void bt_lattice_way_free(bt_lattice_way *f)
{
    free(f->point);
    free(f->leg);
    free(f->node);
    free(f->node_leg);
    *f = (bt_lattice_way){0};
}
