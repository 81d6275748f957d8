// SPDX-License-Identifier: MIT
// A lattice of poses, its moves, and A* over them; route/lattice.h.
//
// Poses. Places are integer multiples of the spacing; headings are those of vectors of small integers, 16 or 32 nearly
// evenly spaced, so that a straight move ends on a place.
// Moves from a heading u0: straight ahead; or a turn to u1, by one or two headings on radius R, by one on 2 R:
//     straight a − T, arc, straight b − T,   T = R tan(δ/2),   a u0 + b u1 = whole multiples of the spacing, a, b >= T
// of which the shortest is taken. So a turn is a corner of a path through way-points, and the path found is such a
// path. With R = 0 the shortest is a turn on the spot.
// Cost. Slices of the swath are summed first: at points q <= W/4 apart, each slice q long, for each heading. The load
// of a move is the sum of the slices along it, nearest in place and heading; their list is the same everywhere. The
// path found is priced again by its own swath (swath.c). Rejected: a list of all cells under a move, which avoids
// errors of half of q and half a step of heading, but is thirty times as long.
// Order. Costs are rounded up to integer multiples of 1e-5 of the least cost of a spacing, so sums do not depend on
// their order, and of equal costs the lower index goes first. The bound is rounded down: the least cost of a metre
// times the distance to the goal, straight or by squares that the centre of the berg may enter, whichever is longer. A
// goal that no chain of squares reaches is given up at once.
#include "route/lattice.h"

#include "base/elementary.h"
#include "base/inside.h"

enum { MAX_HEADINGS = 32, MAX_MOVES = 7 };
#define UNITS 1e5 ///< units of cost in the least cost of a spacing
#define THERE 0.75 ///< largest distance of a goal node from the goal, spacings
#define UNREACHED INT32_MAX

typedef struct move {
    int dx, dy, heading;     ///< places; heading after it
    double length, turned;   ///< m; rad
    double corner;           ///< a, m: distance to the corner of a turn
    int n_legs;
    bt_leg leg[3];           ///< in the frame of the lattice, from the origin
    double mid[2];           ///< the place halfway, m
    double water[BT_ROUTE_SPEEDS]; ///< mean water drag, N
    int n_slices;
    int64_t *slice;          ///< [n_slices] index relative to heading 0 at the node
    double *along;           ///< [n_slices] m
} move;

struct bt_lattice {
    bt_planner *p;
    double h, ax, ay;
    int i0, j0, nx, ny, n_headings, per_place;
    double step;             ///< largest angle between neighbouring headings, rad
    int vector[MAX_HEADINGS][2];
    double unit[MAX_HEADINGS][2];
    move of[MAX_HEADINGS][MAX_MOVES];
    int n_moves[MAX_HEADINGS];
    double per_step;         ///< least length of a move / its steps, m (steps_of)
    int fine, pad, wide, high; ///< q = h/fine; slices beside the lattice; slices along x and y
    float *across;           ///< [high][wide][n_headings/2][n_speeds] mean load of a slice, N: one cache line a place
};

// --- moves ----------------------------------------------------------------------------------------------------------

static void choose_headings(bt_lattice *lattice, int n)
{
    static const int first[2][8][2] = {{{1, 0}, {2, 1}, {1, 1}, {1, 2}},
                                       {{1, 0}, {5, 1}, {5, 2}, {3, 2}, {1, 1}, {2, 3}, {2, 5}, {1, 5}}};
    lattice->n_headings = n;
    for (int k = 0; k < n; k++) {
        const int *v = first[n == 32][k % (n / 4)];
        int x = v[0], y = v[1];
        for (int quarter = 0; quarter < k / (n / 4); quarter++) {
            const int was = x;
            x = -y, y = was;
        }
        lattice->vector[k][0] = x, lattice->vector[k][1] = y;
        const double length = sqrt((double)(x * x + y * y));
        lattice->unit[k][0] = x / length, lattice->unit[k][1] = y / length;
    }
    for (int k = 0; k < n; k++) {
        const double *u = lattice->unit[k], *w = lattice->unit[(k + 1) % n];
        lattice->step = bt_max(lattice->step, bt_atan2(u[0] * w[1] - u[1] * w[0], u[0] * w[0] + u[1] * w[1]));
    }
}

static void add_leg(move *step, double length, double turn)
{
    if (!(length > 1e-9)) return;
    double at[2] = {0, 0}, t[2];
    if (step->n_legs) bt_leg_at(&step->leg[step->n_legs - 1], step->leg[step->n_legs - 1].length, at, t);
    else t[0] = step->leg[0].tx, t[1] = step->leg[0].ty;
    step->leg[step->n_legs++] = (bt_leg){.length = length, .x = at[0], .y = at[1], .tx = t[0], .ty = t[1],
                                         .turn = turn};
    step->length += length;
}

/// Make the turn from heading k to k + by on an arc of this radius.
static void make_turn(const bt_lattice *lattice, int k, int by, double radius, move *step)
{
    const int to = (k + by + lattice->n_headings) % lattice->n_headings;
    const double *u = lattice->unit[k], *w = lattice->unit[to], cross = u[0] * w[1] - u[1] * w[0];
    const double angle = bt_atan2(cross, u[0] * w[0] + u[1] * w[1]), cut = radius * bt_tan(0.5 * fabs(angle));
    const int reach = (int)(2 * cut / lattice->h) + 8;
    double best = INFINITY, a_best = 0, b_best = 0;
    *step = (move){.heading = to, .turned = fabs(angle)};
    for (int y = -reach; y <= reach; y++)
        for (int x = -reach; x <= reach; x++) {
            const double a = lattice->h * (x * w[1] - y * w[0]) / cross, b = lattice->h * (y * u[0] - x * u[1]) / cross;
            if (a < cut - 1e-9 * lattice->h || b < cut - 1e-9 * lattice->h || !(a + b < best - 1e-9 * lattice->h))
                continue;
            best = a + b;
            a_best = a, b_best = b;
            step->dx = x, step->dy = y;
        }
    step->corner = a_best;
    step->leg[0].tx = u[0], step->leg[0].ty = u[1];
    add_leg(step, a_best - cut, 0);
    if (radius > 0) add_leg(step, radius * fabs(angle), copysign(1 / radius, angle));
    if (!(radius > 0) && step->n_legs) step->leg[step->n_legs].tx = w[0], step->leg[step->n_legs].ty = w[1];
    add_leg(step, b_best - cut, 0);
}

static void make_moves(bt_lattice *lattice, double radius)
{
    for (int k = 0; k < lattice->n_headings; k++) {
        move *step = lattice->of[k];
        const int *v = lattice->vector[k];
        *step = (move){.dx = v[0], .dy = v[1], .heading = k};
        step->leg[0].tx = lattice->unit[k][0], step->leg[0].ty = lattice->unit[k][1];
        add_leg(step, lattice->h * sqrt((double)(v[0] * v[0] + v[1] * v[1])), 0);
        int n = 1;
        for (int by = -2; by <= 2; by++)
            for (int wide = 1; by != 0 && wide <= (radius > 0 && abs(by) == 1 ? 2 : 1); wide++)
                make_turn(lattice, k, by, wide * radius, &step[n++]);
        lattice->n_moves[k] = n;
    }
}

static void make_slices(bt_lattice *lattice)
{
    const bt_route_ice *ice = &lattice->p->ice;
    const int n_speeds = ice->n_speeds;
    const double w = lattice->p->task.width, q = lattice->h / lattice->fine;
    const int n_across = (int)ceil(w / ice->cell), n_along = (int)ceil(q / ice->cell), n = n_across * n_along;
    lattice->across =
        bt_alloc((size_t)lattice->wide * (size_t)lattice->high * (size_t)(lattice->n_headings / 2) * (size_t)n_speeds,
                               sizeof *lattice->across);
    double(*to)[2] = bt_alloc((size_t)n, sizeof *to); // points of a slice, in cells
    const int middle = n_across % 2 ? 1 : 2; // points nearest to the path in each row
    for (int k = 0; k < lattice->n_headings / 2; k++) {
        const double *u = lattice->unit[k];
        for (int b = 0; b < n; b++) {
            const double along = q * ((b / n_across + 0.5) / n_along - 0.5) / ice->cell;
            const double aside = w * ((b % n_across + 0.5) / n_across - 0.5) / ice->cell;
            to[b][0] = along * u[0] - aside * u[1], to[b][1] = along * u[1] + aside * u[0];
        }
        for (int j = 0; j < lattice->high; j++)
            for (int i = 0; i < lattice->wide; i++) {
                float *out = lattice->across + (((int64_t)j * lattice->wide + i) * (lattice->n_headings / 2) + k) *
                             n_speeds;
                const double x = ((lattice->i0 * lattice->fine + i - lattice->pad) * q - ice->x0) / ice->cell;
                const double y = ((lattice->j0 * lattice->fine + j - lattice->pad) * q - ice->y0) / ice->cell;
                for (int b = 0; b < n; b++) {
                    const int64_t cell = (int64_t)(int)(y + to[b][1]) * ice->nx + (int)(x + to[b][0]);
                    for (int v = 0; v < n_speeds; v++) out[v] += ice->load[cell * n_speeds + v];
                    if (abs(2 * (b % n_across) + 1 - n_across) >= 2) continue;
                    for (int v = 0; v < n_speeds; v++)
                        out[v] += ice->line[cell * n_speeds + v] * (float)(n_across / (w * middle));
                }
                for (int v = 0; v < n_speeds; v++) out[v] *= (float)(w / n);
            }
    }
    free(to);
}

static int nearest_heading(const bt_lattice *lattice, const double t[2])
{
    int best = 0;
    for (int k = 1; k < lattice->n_headings; k++) {
        const double *u = lattice->unit[k], *b = lattice->unit[best];
        if (u[0] * t[0] + u[1] * t[1] > b[0] * t[0] + b[1] * t[1]) best = k;
    }
    return best % (lattice->n_headings / 2);
}

/// Set the slices of a move, its middle and its water drag.
static void make_mask(const bt_lattice *lattice, move *step)
{
    const bt_planner *planner = lattice->p;
    const double q = lattice->h / lattice->fine;
    int cap = 0;
    for (int g = 0; g < step->n_legs; g++) cap += (int)ceil(step->leg[g].length / q);
    step->slice = bt_alloc((size_t)cap + 1, sizeof *step->slice);
    step->along = bt_alloc((size_t)cap + 1, sizeof *step->along);
    double way = 0;
    for (int g = 0; g < step->n_legs; g++) {
        const bt_leg *leg = &step->leg[g];
        const int along = (int)ceil(leg->length / q - 1e-9);
        for (int a = 0; a < along; a++) {
            double at[2], t[2];
            bt_leg_at(leg, (a + 0.5) * leg->length / along, at, t);
            const int64_t i = (int64_t)floor(at[0] / q + 0.5), j = (int64_t)floor(at[1] / q + 0.5);
            step->slice[step->n_slices] = (j * lattice->wide + i) * (lattice->n_headings / 2) +
                                          nearest_heading(lattice, t);
            step->along[step->n_slices++] = leg->length / along;
        }
        if (way <= 0.5 * step->length)
            bt_leg_at(leg, bt_min(leg->length, 0.5 * step->length - way), step->mid, (double[2]){0});
        way += leg->length;
    }
    for (int s = 0; s < planner->task.n_speeds; s++) {
        double sum = 0;
        for (int g = 0; g < step->n_legs; g++) {
            double at[2], t[2];
            bt_leg_at(&step->leg[g], 0.5 * step->leg[g].length, at, t);
            sum += step->leg[g].length * bt_swath_water(planner, t[0] * lattice->ax - t[1] * lattice->ay,
                                                        t[0] * lattice->ay + t[1] * lattice->ax,
                                                        planner->task.speed[s]);
        }
        step->water[s] = step->length > 0 ? sum / step->length : 0;
    }
}

/// Number of steps into which a move is cut, each from the square around a place to one of the eight squares around
/// that. Few, not always the fewest.
static int steps_of(const bt_lattice *lattice, const move *step)
{
    enum { FINE = 32 };
    int steps = 0, x0 = 0, y0 = 0, x1 = 0, y1 = 0; // squares: of the last step, and the latest beside it
    for (int g = 0; g < step->n_legs; g++) {
        const int n = (int)ceil(step->leg[g].length / lattice->h * FINE);
        for (int a = 1; a <= n; a++) {
            double at[2], t[2];
            bt_leg_at(&step->leg[g], step->leg[g].length * a / n, at, t);
            const int x = (int)floor(at[0] / lattice->h + 0.5), y = (int)floor(at[1] / lattice->h + 0.5);
            if (abs(x - x0) > 1 || abs(y - y0) > 1) x0 = x1, y0 = y1, steps++;
            x1 = x, y1 = y;
        }
    }
    return steps + (x1 != x0 || y1 != y0);
}

bt_lattice *bt_lattice_make(bt_planner *planner, double ax, double ay, double spacing, double cell)
{
    const bt_route_task *task = &planner->task;
    bt_lattice *lattice = bt_alloc(1, sizeof *lattice);
    lattice->p = planner, lattice->h = spacing, lattice->ax = ax, lattice->ay = ay;
    choose_headings(lattice, task->headings);
    make_moves(lattice, task->radius);
    lattice->per_step = INFINITY;
    for (int k = 0; k < lattice->n_headings; k++)
        for (int m = 0; m < lattice->n_moves[k]; m++) {
            const int steps = steps_of(lattice, &lattice->of[k][m]);
            if (steps > 0) lattice->per_step = bt_min(lattice->per_step, lattice->of[k][m].length / steps);
        }
    double longest = 0, low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int k = 0; k < lattice->n_headings; k++)
        for (int m = 0; m < lattice->n_moves[k]; m++) longest = bt_max(longest, lattice->of[k][m].length);
    for (int c = 0; c < 4; c++) {
        const double x = task->extent[c & 1 ? 2 : 0] - task->start[0], y = task->extent[c & 2 ? 3 : 1] - task->start[1];
        const double at[2] = {x * ax + y * ay, y * ax - x * ay};
        for (int a = 0; a < 2; a++) low[a] = bt_min(low[a], at[a]), high[a] = bt_max(high[a], at[a]);
    }
    lattice->i0 = (int)ceil(low[0] / spacing), lattice->j0 = (int)ceil(low[1] / spacing);
    lattice->nx = (int)floor(high[0] / spacing) - lattice->i0 + 1,
    lattice->ny = (int)floor(high[1] / spacing) - lattice->j0 + 1;
    lattice->per_place = lattice->n_headings;

    lattice->fine = (int)ceil(4 * spacing / task->width - 1e-9);
    lattice->pad = (int)ceil(longest / spacing * lattice->fine) + 1;
    lattice->wide = (lattice->nx - 1) * lattice->fine + 2 * lattice->pad + 1,
    lattice->high = (lattice->ny - 1) * lattice->fine + 2 * lattice->pad + 1;
    // a whole number of cells between places, and cells under every slice
    const int by = (int)(spacing / cell + 0.5);
    const int half = (int)ceil((lattice->pad + 1) * by / (double)lattice->fine + task->width / cell) + 1;
    planner->ice = (bt_route_ice){.nx = (lattice->nx - 1) * by + 2 * half, .ny = (lattice->ny - 1) * by + 2 * half,
                                  .cell = cell, .x0 = (lattice->i0 * by - half) * cell,
                                  .y0 = (lattice->j0 * by - half) * cell, .ax = ax, .ay = ay, .ox = task->start[0],
                                  .oy = task->start[1]};
    bt_route_ice_make(&planner->ice, task);
    for (int k = 0; k < lattice->n_headings; k++)
        for (int m = 0; m < lattice->n_moves[k]; m++) make_mask(lattice, &lattice->of[k][m]);
    make_slices(lattice);
    return lattice;
}

void bt_lattice_free(bt_lattice *lattice)
{
    for (int k = 0; k < lattice->n_headings; k++)
        for (int m = 0; m < lattice->n_moves[k]; m++) {
            free(lattice->of[k][m].slice);
            free(lattice->of[k][m].along);
        }
    free(lattice->across);
    free(lattice);
}

double bt_lattice_spacing(const bt_lattice *lattice) { return lattice->h; }

// --- the open list: a 4-ary heap, for the sake of the cache ---------------------------------------------------------

typedef struct entry {
    int64_t bound;
    int32_t state;
} entry;

typedef struct heap {
    entry *e;
    size_t n, cap;
} heap;

static bool before(entry a, entry b) { return a.bound != b.bound ? a.bound < b.bound : a.state < b.state; }

static void push(heap *queue, entry e)
{
    BT_MAKE_ROOM(queue->e, queue->n, queue->cap, 1024);
    size_t k = queue->n++;
    for (; k > 0 && before(e, queue->e[(k - 1) / 4]); k = (k - 1) / 4) queue->e[k] = queue->e[(k - 1) / 4];
    queue->e[k] = e;
}

static entry pop(heap *queue)
{
    const entry top = queue->e[0], last = queue->e[--queue->n];
    size_t k = 0;
    for (size_t child; (child = 4 * k + 1) < queue->n; k = child) {
        const size_t end = child + 4 < queue->n ? child + 4 : queue->n;
        for (size_t other = child + 1; other < end; other++)
            if (before(queue->e[other], queue->e[child])) child = other;
        if (!before(queue->e[child], last)) break;
        queue->e[k] = queue->e[child];
    }
    queue->e[k] = last;
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
    float *time;          ///< s; NULL = no drift
    int32_t *steps;       ///< [places] least number to the goal around no-go polygons; NULL = unknown
    uint8_t *by, *done;
    heap open;
} search;

/// Distance of a place of the lattice to the goal, m.
static double to_goal(const search *state, int i, int j)
{
    const double x = i * state->l->h - state->goal[0], y = j * state->l->h - state->goal[1];
    const double ex = state->goal[2] - state->goal[0], ey = state->goal[3] - state->goal[1], square = ex * ex + ey * ey;
    const double dot = x * ex + y * ey, f = dot <= 0 || !(square > 0) ? 0 : dot >= square ? 1 : dot / square;
    return bt_hypot(x - f * ex, y - f * ey);
}

/// Count the steps from each place to the goal, breadth first from there, through neighbouring squares that the centre
/// of the berg may enter. A move makes at most length / per_step steps, and along it the count falls by at most that
/// number, so the bound that follows is admissible and consistent. There is none if polygons move in the frame of the
/// ice, or if a hull smaller than a square may leave the squares of the lattice. It saves a tenth to a quarter of the
/// states visited in mazes, and all of them if no chain leads to the goal.
static void count_steps(search *state)
{
    const bt_lattice *lattice = state->l;
    const bt_planner *planner = lattice->p;
    if (planner->no_go.n == 0 || state->time || planner->task.reach < 0.5 * lattice->h) return;
    const int32_t n = (int32_t)(lattice->nx * lattice->ny);
    int32_t *queue = bt_alloc((size_t)n, sizeof *queue), head = 0, tail = 0;
    state->steps = bt_alloc((size_t)n, sizeof *state->steps);
    // distance of the middle of a square that may have a free corner
    const double least = planner->no_go.need - 0.708 * lattice->h;
    for (int32_t k = 0; k < n; k++) {
        const int i = lattice->i0 + k % lattice->nx, j = lattice->j0 + k / lattice->nx;
        const double *o = planner->task.start, x = i * lattice->h, y = j * lattice->h;
        state->steps[k] = UNREACHED;
        if (to_goal(state, i, j) <= THERE * lattice->h) state->steps[queue[tail++] = k] = 0;
        else if (bt_no_go_distance(&planner->no_go, o[0] + x * lattice->ax - y * lattice->ay,
                                   o[1] + x * lattice->ay + y * lattice->ax) < least)
            state->steps[k] = -1;
    }
    while (head < tail) {
        const int32_t k = queue[head++];
        for (int side = 0; side < 9; side++) {
            const int i = k % lattice->nx + side % 3 - 1, j = k / lattice->nx + side / 3 - 1;
            if (i < 0 || j < 0 || i >= lattice->nx || j >= lattice->ny ||
                state->steps[j * lattice->nx + i] != UNREACHED) continue;
            state->steps[j * lattice->nx + i] = state->steps[k] + 1;
            queue[tail++] = j * lattice->nx + i;
        }
    }
    for (int32_t k = 0; k < n; k++)
        if (state->steps[k] < 0) state->steps[k] = UNREACHED;
    free(queue);
}

/// Lower bound of the cost from a place to the goal, in units; −1: no way leads there.
static int64_t bound_of(const search *state, int i, int j)
{
    const bt_lattice *lattice = state->l;
    const int32_t steps = state->steps ? state->steps[(j - lattice->j0) * lattice->nx + (i - lattice->i0)] : 0;
    if (steps == UNREACHED) return -1;
    if (state->objective == BT_ROUTE_PEAK) return 0;
    return (int64_t)(bt_max(bt_max(0, to_goal(state, i, j) - THERE * lattice->h),
                            (1 - 1e-9) * lattice->per_step * steps) * state->least /
                     state->unit);
}

static double least_cost(const bt_planner *planner, int objective)
{
    const bt_route_task *task = &planner->task;
    if (objective == BT_ROUTE_LENGTH) return 1;
    if (objective == BT_ROUTE_TIME) return 1 / task->speed[0];
    enum { DIRECTIONS = 256 };
    double least = INFINITY;
    for (int k = 0; k < DIRECTIONS; k++)
        for (int s = 0; s < task->n_speeds; s++) {
            double sine, cosine;
            bt_sincos(2 * BT_PI * k / DIRECTIONS, &sine, &cosine);
            least = bt_min(least, bt_swath_water(planner, cosine, sine, task->speed[s]));
        }
    return 0.999 * bt_max(1e-3, task->weight[0]) * least; // between the directions it is lower by 3e-4 at most
}

static bool is_goal(const search *state, int i, int j, int k)
{
    const bt_lattice *lattice = state->l;
    const double heading = lattice->p->task.goal_heading;
    if (to_goal(state, i, j) > THERE * lattice->h) return false;
    if (isnan(heading)) return true;
    double sine, cosine;
    bt_sincos(heading, &sine, &cosine);
    const double x = cosine * lattice->ax + sine * lattice->ay, y = sine * lattice->ax - cosine * lattice->ay,
                 *u = lattice->unit[k];
    return fabs(bt_atan2(u[0] * y - u[1] * x, u[0] * x + u[1] * y)) < 0.51 * lattice->step;
}

static bt_leg placed(const bt_lattice *lattice, const bt_leg *leg, double x, double y)
{
    const double *o = lattice->p->task.start, fx = x + leg->x, fy = y + leg->y;
    bt_leg out = *leg;
    out.x = o[0] + fx * lattice->ax - fy * lattice->ay, out.y = o[1] + fx * lattice->ay + fy * lattice->ax;
    out.tx = leg->tx * lattice->ax - leg->ty * lattice->ay, out.ty = leg->tx * lattice->ay + leg->ty * lattice->ax;
    return out;
}

static double factor_at(const bt_lattice *lattice, double x, double y)
{
    const bt_planner *planner = lattice->p;
    if (!planner->near) return 1;
    const int64_t i = (int64_t)((x - planner->ice.x0) / planner->ice.cell),
                  j = (int64_t)((y - planner->ice.y0) / planner->ice.cell);
    return planner->near[j * planner->ice.nx + i] ? planner->penalty : 1;
}

/// Cost and time of a move from a place, in units; −1: not allowed.
static int64_t price(const search *state, const move *step, int i, int j, double time, double *took)
{
    const bt_lattice *lattice = state->l;
    const bt_planner *planner = lattice->p;
    const bt_route_task *task = &planner->task;
    const double turn = task->turn_cost * step->turned, h = lattice->h;
    *took = 0;
    if (!(step->length > 0)) return state->objective == BT_ROUTE_PEAK ? 0 : (int64_t)ceil(turn / state->unit);
    const int64_t place = ((j - lattice->j0) * (int64_t)lattice->fine + lattice->pad) * lattice->wide +
                          (i - lattice->i0) * lattice->fine + lattice->pad;
    const int64_t base = place * (lattice->n_headings / 2);
    double load[BT_ROUTE_SPEEDS] = {0};
    if (task->n_speeds == 1) {
        double sum = 0;
        for (int c = 0; c < step->n_slices; c++) sum += step->along[c] * lattice->across[base + step->slice[c]];
        load[0] = sum;
    } else {
        for (int c = 0; c < step->n_slices; c++) {
            const float *f = lattice->across + (base + step->slice[c]) * task->n_speeds;
            for (int v = 0; v < task->n_speeds; v++) load[v] += step->along[c] * f[v];
        }
    }
    bt_stretch_cost cost = bt_swath_choose(planner, step->length, load, step->water, state->limit);
    if (cost.over) return -1;
    *took = cost.time;
    double now = time;
    const double mid = time + 0.5 * cost.time, half = 0.5 * step->length;
    const bt_leg middle = placed(lattice, &(bt_leg){.x = step->mid[0], .y = step->mid[1]}, i * h, j * h);
    const bool clear = bt_no_go_clear(&planner->no_go, middle.x, middle.y, half, mid, task->speed[cost.speed]);
    for (int g = 0; g < step->n_legs && !clear; g++) {
        const bt_leg leg = placed(lattice, &step->leg[g], i * h, j * h);
        if (bt_no_go_faults(&planner->no_go, &leg, leg.length, now, task->speed[cost.speed])) return -1;
        now += leg.length / task->speed[cost.speed];
    }
    const double factor = factor_at(lattice, i * h + step->mid[0], j * h + step->mid[1]);
    if (state->objective == BT_ROUTE_PEAK) return (int64_t)ceil((cost.force * factor) / state->unit);
    const double measure = task->objective == BT_ROUTE_PEAK ? cost.work : cost.measure;
    return (int64_t)ceil((factor * measure + turn) / state->unit);
}

static void look(search *state, int32_t from, int i, int j, int k)
{
    const bt_lattice *lattice = state->l;
    for (int a = 0; a < lattice->n_moves[k]; a++) {
        const move *step = &lattice->of[k][a];
        const int x = i + step->dx, y = j + step->dy;
        if (x < lattice->i0 || y < lattice->j0 || x >= lattice->i0 + lattice->nx || y >= lattice->j0 + lattice->ny)
            continue;
        const int32_t to = ((y - lattice->j0) * lattice->nx + (x - lattice->i0)) * lattice->n_headings + step->heading;
        if (state->done[to]) continue;
        const int64_t so_far = state->cost[from];
        const bool peak = state->objective == BT_ROUTE_PEAK;
        // least cost
        if (state->cost[to] <= so_far + (peak ? 0 : (int64_t)(step->length * state->least / state->unit))) continue;
        const int64_t bound = bound_of(state, x, y);
        if (bound < 0) continue;
        double took;
        const int64_t more = price(state, step, i, j, state->time ? state->time[from] : 0, &took);
        if (more < 0) continue;
        const int64_t cost = peak ? (more > so_far ? more : so_far) : so_far + more;
        if (cost >= state->cost[to]) continue;
        state->cost[to] = cost;
        state->from[to] = from;
        state->by[to] = (uint8_t)a;
        if (state->time) state->time[to] = (float)(state->time[from] + took);
        push(&state->open, (entry){cost + bound, to});
    }
}

static void split(const bt_lattice *lattice, int32_t state, int *i, int *j, int *k)
{
    *k = state % lattice->n_headings;
    *i = lattice->i0 + state / lattice->n_headings % lattice->nx;
    *j = lattice->j0 + state / lattice->n_headings / lattice->nx;
}

/// The moves that led to a state, as legs and way-points.
static void follow(const search *state, int32_t last, bt_lattice_way *way)
{
    const bt_lattice *lattice = state->l;
    int n = 0;
    for (int32_t at = last; state->from[at] >= 0; at = state->from[at]) n++;
    int32_t *chain = bt_alloc((size_t)n + 1, sizeof *chain);
    chain[n] = last;
    for (int k = n; k > 0; k--) chain[k - 1] = state->from[chain[k]];
    way->point = bt_alloc((size_t)n + 1, sizeof *way->point);
    way->leg = bt_alloc(3 * (size_t)n + 1, sizeof *way->leg);
    way->node = bt_alloc((size_t)n + 1, sizeof *way->node);
    way->node_leg = bt_alloc((size_t)n + 1, sizeof *way->node_leg);
    for (int a = 0; a <= n; a++) {
        int i, j, k;
        split(lattice, chain[a], &i, &j, &k);
        const double *u = lattice->unit[k], x = i * lattice->h, y = j * lattice->h;
        const bt_leg here = placed(lattice, &(bt_leg){.tx = u[0], .ty = u[1]}, x, y);
        way->node[a][0] = here.x, way->node[a][1] = here.y, way->node[a][2] = bt_atan2(here.ty, here.tx);
        way->node_leg[a] = way->n_legs;
        if (a == n) {
            way->point[way->n_points][0] = here.x, way->point[way->n_points++][1] = here.y;
            break;
        }
        const move *step = &lattice->of[k][state->by[chain[a + 1]]];
        for (int g = 0; g < step->n_legs; g++) way->leg[way->n_legs++] = placed(lattice, &step->leg[g], x, y);
        if (step->turned > 0) {
            way->point[way->n_points][0] = here.x + step->corner * here.tx;
            way->point[way->n_points++][1] = here.y + step->corner * here.ty;
        }
    }
    way->n_nodes = n + 1;
    free(chain);
}

bool bt_lattice_search(bt_lattice *lattice, const double goal[4], int objective, double limit, double *peak,
                       bt_lattice_way *way)
{
    bt_planner *planner = lattice->p;
    const bt_route_task *task = &planner->task;
    const size_t states = (size_t)lattice->nx * (size_t)lattice->ny * (size_t)lattice->n_headings;
    search state = {.l = lattice, .objective = objective, .limit = limit};
    for (int a = 0; a < 4; a += 2) {
        const double x = goal[a] - task->start[0], y = goal[a + 1] - task->start[1];
        state.goal[a] = x * lattice->ax + y * lattice->ay, state.goal[a + 1] = y * lattice->ax - x * lattice->ay;
    }
    state.least =
        least_cost(planner, objective == BT_ROUTE_PEAK || task->objective == BT_ROUTE_PEAK ? BT_ROUTE_WORK : objective);
    state.unit = objective == BT_ROUTE_PEAK ? 1e-3 * state.least : state.least * lattice->h / UNITS;
    state.cost = bt_alloc(states, sizeof *state.cost);
    state.from = bt_alloc(states, sizeof *state.from);
    state.by = bt_alloc(states, sizeof *state.by);
    state.done = bt_alloc(states, sizeof *state.done);
    if (task->drift[0] != 0 || task->drift[1] != 0) state.time = bt_alloc(states, sizeof *state.time);
    for (size_t k = 0; k < states; k++) state.cost[k] = INT64_MAX, state.from[k] = -1;
    count_steps(&state);
    for (int k = 0; k < lattice->n_headings; k++) {
        if (!isnan(task->start_heading) && k > 0) break; // the frame's x axis is the heading
        const int32_t at = (-lattice->j0 * lattice->nx - lattice->i0) * lattice->n_headings + k;
        state.cost[at] = 0;
        const int64_t bound = bound_of(&state, 0, 0);
        if (bound >= 0) push(&state.open, (entry){bound, at});
    }
    *way = (bt_lattice_way){0};
    bool found = false;
    while (state.open.n > 0 && !found) {
        const entry e = pop(&state.open);
        if (state.done[e.state]) continue;
        state.done[e.state] = 1;
        planner->states++;
        int i, j, k;
        split(lattice, e.state, &i, &j, &k);
        if (is_goal(&state, i, j, k)) {
            found = true;
            if (peak) *peak = (double)state.cost[e.state] * state.unit;
            follow(&state, e.state, way);
        } else look(&state, e.state, i, j, k);
    }
    BT_FREE(state.cost, state.from, state.by, state.done, state.time, state.steps, state.open.e);
    return found;
}

void bt_lattice_way_free(bt_lattice_way *way)
{
    BT_FREE(way->point, way->leg, way->node, way->node_leg);
    *way = (bt_lattice_way){0};
}
