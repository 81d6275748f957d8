// SPDX-License-Identifier: MIT
// Lee of edges and covered skin, floe by floe; equations in force/exposure.h.
#include "force/exposure.h"

#include <math.h>
#include <stdlib.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "body/bodies.h"
#include "geometry/polygons.h"
#include "partition/domain.h"
#include "space/cells.h"
#include "space/phases.h"

enum { SLOW = 8 }; // a floe without fast flow is evaluated once in this many times, assumed

#define TAPER 3.5 // x at which the lee begins to taper off, assumed

/// Lines along the flow past a floe: a power of two, so that their mean is exact if all agree. With 64 the factor of a
/// floe of 30 m in 80 % ice differs by 0.02 rms, and the mean of the field is 0.568 instead of 0.566.
enum { LINES = 8 };

/// A floe near the floe being evaluated.
typedef struct neighbour {
    const bt_bodies *b;
    bt_idx i;
    double dx, dy; ///< from centroid to centroid, m
} neighbour;

/// Scratch memory of one visit.
typedef struct scratch {
    neighbour *near;
    size_t n, cap;
    double *number;
    size_t n_numbers, cap_numbers;
    struct candidate *candidate;
    size_t n_candidates, cap_candidates;
} scratch;

/// A copy of a floe, with its cell.
typedef struct placed {
    int32_t cell[2];
    bt_idx i;
} placed;

/// The copies of floes in the surroundings of this rank, by cells.
typedef struct surroundings {
    int rings[2];     ///< number of cells along x and y within which a floe may be sheltered
    bt_bodies copies; ///< of those rings that this rank does not hold
    placed *sorted;   ///< [copies.n] by cell
} surroundings;

/// Largest reach of a lee / thickness of its ice, for the fluid with the higher edges.
static double lee_reach(const bt_params *par)
{
    return BT_EXPOSURE_REACH * par->lee * bt_max(par->draft, 1 - par->draft);
}

// --- form drag -------------------------------------------------------------------------------------------------------

/// g(x)
static double lee(double x)
{
    if (x >= BT_EXPOSURE_REACH) return 0;
    const double u = (x - TAPER) / (BT_EXPOSURE_REACH - TAPER);
    return bt_exp(-x) * (u > 0 ? 1 - u * u * (3 - 2 * u) : 1);
}

/// Lines along the flow, evenly spaced over the width of a floe, relative to its centroid.
typedef struct lines {
    double along[2];     ///< of the flow
    double from, step;   ///< positions across: from + (k + ½) step, m
    double enter[LINES]; ///< where they enter the floe, along the flow, m
    double first, last;  ///< first and last of these, m
} lines;

/// Vertices as (along, across) the flow.
static void turn(const double along[2], double dx, double dy, int n, const double *v, double *out)
{
    for (int k = 0; k < n; k++) {
        const double x = v[2 * k] + dx, y = v[2 * k + 1] + dy;
        out[2 * k] = along[0] * x + along[1] * y;
        out[2 * k + 1] = along[0] * y - along[1] * x;
    }
}

/// Where the lines enter and leave a convex polygon that has been turned; INFINITY, −INFINITY for lines that miss it.
static void cross(const lines *rays, int n, const double *v, double in[LINES], double out[LINES])
{
    const double per_step = 1 / rays->step;
    for (int k = 0; k < LINES; k++) in[k] = INFINITY, out[k] = -INFINITY;
    for (int e = 0; e < n; e++) {
        const double *p = v + 2 * e, *q = v + 2 * (e + 1 < n ? e + 1 : 0);
        if (p[1] == q[1]) continue;
        const double low = bt_min(p[1], q[1]), high = bt_max(p[1], q[1]), slope = (q[0] - p[0]) / (q[1] - p[1]);
        const double place = (low - rays->from) * per_step - 0.5;
        if (place > LINES - 1) continue;
        int k = place > 0 ? (int)place : 0;
        if (k < place) k++;
        for (; k < LINES; k++) {
            const double at = rays->from + (k + 0.5) * rays->step;
            if (at > high) break;
            const double s = p[0] + (at - p[1]) * slope;
            in[k] = bt_min(in[k], s);
            out[k] = bt_max(out[k], s);
        }
    }
}

/// Width, m, of the convex hull of body i across the flow (vx, vy), which must not be 0, and the lines.
static double draw(const bt_bodies *bodies, bt_idx i, double vx, double vy, lines *rays)
{
    const int n = bt_body_corners(bodies, i);
    const bt_mark *mark = bodies->mark + bodies->offset[i];
    const double size = sqrt(vx * vx + vy * vy);
    rays->along[0] = vx / size, rays->along[1] = vy / size;
    double v[2 * BT_MAX_VERTICES], out[LINES];
    int m = 0;
    for (int k = 0; k < n; k++)
        if (mark[k].next != k) turn(rays->along, 0, 0, 1, bodies->outline + 2 * (bodies->offset[i] + k), v + 2 * m++);
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < m; k++) low = bt_min(low, v[2 * k + 1]), high = bt_max(high, v[2 * k + 1]);
    rays->from = low;
    rays->step = (high - low) / LINES;
    cross(rays, m, v, rays->enter, out);
    rays->first = INFINITY, rays->last = -INFINITY;
    for (int k = 0; k < LINES; k++)
        rays->first = bt_min(rays->first, rays->enter[k]), rays->last = bt_max(rays->last, rays->enter[k]);
    return high - low;
}

/// Apply the lee of a neighbour to each line, for n fluids with edge heights scale × h; thickness: of this floe.
static void cast(const bt_params *par, const lines *rays, const neighbour *near, double thickness, int n,
                 const double *scale, double shelter[][LINES])
{
    const bt_bodies *bodies = near->b;
    const double r = bodies->radius[near->i], h = bodies->thickness[near->i], reach = lee_reach(par) * h;
    const double s = rays->along[0] * near->dx + rays->along[1] * near->dy,
                 t = rays->along[0] * near->dy - rays->along[1] * near->dx;
    if (s - r >= rays->last || rays->first - s - r >= reach || t - r >= rays->from + LINES * rays->step ||
        t + r <= rays->from) return;
    for (int part = bt_part_first(bodies, near->i); part >= 0; part = bt_part_next(bodies, near->i, part)) {
        const int64_t first = bodies->offset[near->i] + part;
        double v[2 * BT_MAX_VERTICES], in[LINES], out[LINES];
        turn(rays->along, near->dx, near->dy, bodies->mark[first].count, bodies->outline + 2 * first, v);
        cross(rays, bodies->mark[first].count, v, in, out);
        for (int k = 0; k < LINES; k++) {
            const double away = bt_max(0, rays->enter[k] - out[k]);
            if (!(in[k] < rays->enter[k]) || away >= reach) continue;
            for (int f = 0; f < n; f++) {
                const double by = bt_min(1, h / thickness) * lee(away / (par->lee * scale[f] * h));
                shelter[f][k] = bt_max(shelter[f][k], by);
            }
        }
    }
}

/// Form-drag factors for n fluids that flow past floe i with the same velocity.
static void edges(const bt_world *world, bt_idx i, const double v[2], const scratch *room, int n, const double *scale,
                  double factor[])
{
    lines rays;
    double shelter[2][LINES] = {{0}};
    draw(&world->bodies, i, v[0], v[1], &rays);
    for (size_t k = 0; k < room->n; k++)
        cast(&world->par, &rays, &room->near[k], world->bodies.thickness[i], n, scale, shelter);
    for (int f = 0; f < n; f++) {
        double sum = 0;
        for (int k = 0; k < LINES; k++) sum += shelter[f][k];
        factor[f] = bt_max(0, 1 - sum / LINES);
    }
}

// --- skin drag -------------------------------------------------------------------------------------------------------

static int outline_of(const neighbour *near, const double **v)
{
    *v = near->b->outline + 2 * near->b->offset[near->i];
    return bt_body_corners(near->b, near->i);
}

/// Area shared by two convex outlines, m².
static double shared(const neighbour *a, const neighbour *b)
{
    const double *v, *u, dx = b->dx - a->dx, dy = b->dy - a->dy;
    const int n = outline_of(a, &v), m = outline_of(b, &u);
    double left[2][4 * BT_MAX_VERTICES];
    for (int k = 0; k < m; k++) left[0][2 * k] = u[2 * k] + dx, left[0][2 * k + 1] = u[2 * k + 1] + dy;
    return bt_max(0, bt_polygon_shared(m, n, v, (double *const[]){left[0], left[1]}));
}

/// Do two convex outlines overlap by more than `slop`, m, along every edge normal of the first? A second call tests the
/// normals of the other.
static bool within(const bt_bodies *a, bt_idx i, const bt_bodies *b, bt_idx j, double dx, double dy, double slop)
{
    const int n = bt_body_corners(a, i), m = bt_body_corners(b, j);
    const double *p = a->outline + 2 * a->offset[i], *q = b->outline + 2 * b->offset[j];
    for (int e = 0; e < n; e++) {
        const double *from = p + 2 * e, *to = p + 2 * (e + 1 < n ? e + 1 : 0);
        const double x = to[1] - from[1], y = from[0] - to[0]; // outward
        double least = INFINITY;
        for (int k = 0; k < m; k++) least = bt_min(least, x * (q[2 * k] + dx) + y * (q[2 * k + 1] + dy));
        const double depth = (x * from[0] + y * from[1] - least) * a->per_length[a->offset[i] + e];
        if (!(depth > slop)) return false;
    }
    return true;
}

/// Insertion sort: lists are short and mostly nearly sorted.
static void sort(double *x, size_t n)
{
    for (size_t j = 1; j < n; j++) {
        const double at = x[j];
        size_t k = j;
        for (; k > 0 && x[k - 1] > at; k--) x[k] = x[k - 1];
        x[k] = at;
    }
}

static void put(scratch *room, double x)
{
    BT_MAKE_ROOM(room->number, room->n_numbers, room->cap_numbers, 64);
    room->number[room->n_numbers++] = x;
}

/// Ordinates at which edges of two outlines cross.
static void add_crossings(const neighbour *a, const neighbour *b, scratch *room)
{
    const double *v, *u, dx = b->dx - a->dx, dy = b->dy - a->dy;
    const int n = outline_of(a, &v), m = outline_of(b, &u);
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * (i + 1 < n ? i + 1 : 0), ex = q[0] - p[0], ey = q[1] - p[1];
        for (int k = 0; k < m; k++) {
            const double *f = u + 2 * k, *g = u + 2 * (k + 1 < m ? k + 1 : 0);
            const double d0 = ex * (f[1] + dy - p[1]) - ey * (f[0] + dx - p[0]),
                         d1 = ex * (g[1] + dy - p[1]) - ey * (g[0] + dx - p[0]);
            if ((d0 < 0) == (d1 < 0)) continue;
            put(room, a->dy + f[1] + dy + d0 / (d0 - d1) * (g[1] - f[1]));
        }
    }
}

/// The line y = const inside a convex outline: from x[0] to x[1]; false if it misses.
static bool chord(const neighbour *near, double y, double x[2])
{
    const double *v;
    const int n = outline_of(near, &v);
    x[0] = INFINITY, x[1] = -INFINITY;
    y -= near->dy;
    for (int k = 0; k < n; k++) {
        const double *p = v + 2 * k, *q = v + 2 * (k + 1 < n ? k + 1 : 0);
        if ((p[1] < y) == (q[1] < y)) continue;
        const double at = near->dx + p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0]);
        x[0] = bt_min(x[0], at);
        x[1] = bt_max(x[1], at);
    }
    return x[0] < x[1];
}

/// ∫ dx/n on the line y = const through the first of m sheets, m; *own: length of the line in it, m.
static double seen_on(const neighbour *sheet, size_t m, double y, double *end, double *own)
{
    double x[2], of[2];
    *own = 0;
    if (!chord(&sheet[0], y, x)) return 0;
    *own = x[1] - x[0];
    size_t n = 0; // ends, in pairs: where a sheet begins, and where it ends
    for (size_t k = 1; k < m; k++) {
        if (!chord(&sheet[k], y, of)) continue;
        of[0] = bt_max(of[0], x[0]), of[1] = bt_min(of[1], x[1]);
        if (of[0] < of[1]) end[n] = of[0], end[m + n] = of[1], n++;
    }
    sort(end, n);
    sort(end + m, n);
    double sum = 0, at = x[0];
    for (size_t begun = 0, ended = 0; ended < n;) {
        const bool begins = begun < n && end[begun] < end[m + ended];
        const double next = begins ? end[begun] : end[m + ended];
        sum += (next - at) / (double)(1 + begun - ended);
        at = next;
        if (begins) begun++;
        else ended++;
    }
    return sum + (x[1] - at);
}

/// e (exposure.h) of a floe, the first of m sheets.
static double seen(const neighbour *sheet, size_t m, scratch *room)
{
    room->n_numbers = 0;
    for (size_t k = 0; k < m; k++) {
        const double *v;
        const int n = outline_of(&sheet[k], &v);
        for (int c = 0; c < n; c++) put(room, sheet[k].dy + v[2 * c + 1]);
        for (size_t j = 0; j < k; j++) add_crossings(&sheet[j], &sheet[k], room);
    }
    const size_t n = room->n_numbers;
    sort(room->number, n);
    for (size_t k = 0; k < 2 * m; k++) put(room, 0);
    double area = 0, sum = 0;
    for (size_t k = 0; k + 1 < n; k++) {
        const double high = room->number[k + 1] - room->number[k], y = room->number[k] + 0.5 * high;
        double own;
        if (!(high > 0)) continue;
        sum += high * seen_on(sheet, m, y, room->number + n, &own);
        area += high * own;
    }
    return area > 0 ? bt_min(1, sum / area) : 1;
}

/// Skin factor of floe i. Moves the sheets on and under it to the front of the list, which loses its order.
static double skin(const bt_world *world, bt_idx i, scratch *room)
{
    const bt_bodies *bodies = &world->bodies;
    const double deck = 1 - world->par.draft;
    size_t m = 0;
    for (size_t k = 0; k < room->n; k++) {
        const neighbour near = room->near[k];
        const double r = bodies->radius[i] + near.b->radius[near.i];
        if (near.dx * near.dx + near.dy * near.dy >= r * r ||
            !bt_bodies_slide(bodies, i, near.b, near.i, world->towed, deck)) continue;
        if (!within(bodies, i, near.b, near.i, near.dx, near.dy, world->par.slop) ||
            !within(near.b, near.i, bodies, i, -near.dx, -near.dy, world->par.slop))
            continue;
        room->near[k] = room->near[m];
        room->near[m++] = near;
    }
    if (m == 0) return 1;
    neighbour *sheet = bt_alloc(m + 1, sizeof *sheet);
    sheet[0] = (neighbour){bodies, i, 0, 0};
    for (size_t j = 0; j < m; j++) { // by id: rounding depends on the order
        const neighbour at = room->near[j];
        size_t k = j + 1;
        for (; k > 1 && sheet[k - 1].b->gid[sheet[k - 1].i] > at.b->gid[at.i]; k--) sheet[k] = sheet[k - 1];
        sheet[k] = at;
    }
    bool pile = false;
    for (size_t k = 2; k <= m; k++)
        for (size_t j = 1; j < k; j++) pile = pile || shared(&sheet[j], &sheet[k]) > 0;
    double e = 1;
    for (size_t k = 1; k <= m && !pile; k++) e -= 0.5 * shared(sheet, &sheet[k]) / bodies->area[i];
    if (pile) e = seen(sheet, m + 1, room);
    free(sheet);
    return bt_max(0, e);
}

// --- neighbours ------------------------------------------------------------------------------------------------------

/// A floe in the cells around the cell being visited, and its box relative to the middle of that cell, m.
typedef struct candidate {
    const bt_bodies *b;
    bt_idx i;
    double low[2], high[2];
} candidate;

/// Region where obstacles of a floe may lie, relative to its centroid, m.
typedef struct region {
    double low[2], high[2];
} region;

static double offset(const bt_world *world, const bt_pose *pose, const double from[2], int axis)
{
    return axis ? bt_nearest_image(pose->y - from[1], world->par.period_y)
                : bt_nearest_image(pose->x - from[0], world->par.period_x);
}

/// Does a box from low to high miss the box of the region about a place?
static bool misses(const region *r, const double at[2], const double low[2], const double high[2])
{
    return low[0] > at[0] + r->high[0] || high[0] < at[0] + r->low[0] || low[1] > at[1] + r->high[1] ||
           high[1] < at[1] + r->low[1];
}

static void consider(const bt_world *world, bt_idx i, const bt_bodies *bodies, bt_idx j, scratch *room)
{
    const double h = bodies->thickness[j],
                 reach = world->bodies.radius[i] + bodies->radius[j] + lee_reach(&world->par) * h,
                 from[2] = {world->bodies.pose[i].x, world->bodies.pose[i].y},
                 d[2] = {offset(world, &bodies->pose[j], from, 0), offset(world, &bodies->pose[j], from, 1)};
    if (d[0] * d[0] + d[1] * d[1] >= reach * reach || !(h > 0) || bodies->gid[j] == world->bodies.gid[i]) return;
    BT_MAKE_ROOM(room->near, room->n, room->cap, 32);
    room->near[room->n++] = (neighbour){bodies, j, d[0], d[1]};
}

/// Columns (or rows) of cells within this many rings of c: the first, and their number. None comes twice.
static int32_t span(int32_t c, int rings, int32_t wrap, int32_t *first)
{
    const int32_t n = 2 * rings + 1;
    *first = wrap > 0 && n >= wrap ? 0 : c - rings;
    return wrap > 0 && n >= wrap ? wrap : n;
}

BT_ASCENDING_BY(by_cell, placed, cell[1], cell[0])

/// Copies of floes in cell (x, y): [first, end).
static void find_copies(const surroundings *around, int32_t x, int32_t y, bt_idx *first, bt_idx *end)
{
    const placed at = {.cell = {x, y}}, *copy = around->sorted;
    bt_idx low = 0, high = around->copies.n;
    while (low < high) {
        const bt_idx middle = low + (high - low) / 2;
        if (by_cell(&copy[middle], &at) < 0) low = middle + 1;
        else high = middle;
    }
    for (*first = *end = low; *end < around->copies.n && !by_cell(&copy[*end], &at);) ++*end;
}

static void add_candidate(const bt_world *world, const bt_bodies *bodies, bt_idx i, const double middle[2],
                          const bool round[2], scratch *room)
{
    candidate new = {.b = bodies, .i = i};
    for (int axis = 0; axis < 2; axis++) {
        const double d = round[axis] ? 0 : offset(world, &bodies->pose[i], middle, axis),
                     size = round[axis] ? INFINITY : bodies->radius[i];
        new.low[axis] = d - size, new.high[axis] = d + size;
    }
    BT_MAKE_ROOM(room->candidate, room->n_candidates, room->cap_candidates, 1024); // most cells have several hundred
    room->candidate[room->n_candidates++] = new;
}

/// List the floes in the cells around cell k, held here or as copies.
static void list_candidates(const bt_world *world, const surroundings *around, bt_idx k, const double middle[2],
                            scratch *room)
{
    const bt_cells *cells = world->cells;
    const bt_cell *cell = &cells->cell[k];
    int32_t from[2];
    const int32_t n_x = span(cell->x, around->rings[0], cells->wrap_x, &from[0]),
                  n_y = span(cell->y, around->rings[1], cells->wrap_y, &from[1]);
    const bool round[2] = {n_x == cells->wrap_x, n_y == cells->wrap_y}; // around a whole period, boxes do not apply
    for (int32_t c = 0; c < n_x * n_y; c++) {
        int32_t x = from[0] + c % n_x, y = from[1] + c / n_x;
        if (cells->wrap_x) x = bt_cells_wrapped(x, cells->wrap_x);
        if (cells->wrap_y) y = bt_cells_wrapped(y, cells->wrap_y);
        const bt_idx held = bt_cells_at(cells, x, y);
        bt_idx copy, end;
        find_copies(around, x, y, &copy, &end);
        for (bt_idx j = held < 0 ? 0 : cells->cell[held].first; held >= 0 && j < cells->cell[held].end; j++)
            add_candidate(world, &world->bodies, j, middle, round, room);
        for (; copy < end; copy++) add_candidate(world, &around->copies, around->sorted[copy].i, middle, round, room);
    }
}

/// Region from where fluids that flow past floe i at v may come: its circle, extended upstream by the farthest lee.
static region upstream(const bt_world *world, bt_idx i, const double v[2][2])
{
    const double r = world->bodies.radius[i];
    region of = {{-r, -r}, {r, r}};
    for (int f = 0; f < 2; f++)
        for (int axis = 0; axis < 2; axis++) {
            const double size = sqrt(v[f][0] * v[f][0] + v[f][1] * v[f][1]);
            if (!(size > 0)) continue;
            const double way = -world->par.lee_reach * v[f][axis] / size;
            of.low[axis] = bt_min(of.low[axis], way - r);
            of.high[axis] = bt_max(of.high[axis], way + r);
        }
    return of;
}

/// Gather all floes that may shelter or cover floe i of a cell, from the candidates listed around that cell.
static void gather(const bt_world *world, const surroundings *around, bt_idx i, const double v[2][2],
                   const double middle[2], scratch *room)
{
    const bt_cells *cells = world->cells;
    const bt_bodies *bodies = &world->bodies;
    room->n = 0;
    for (bt_idx j = bodies->large[i] ? 0 : cells->n_in_cells; j < bodies->n; j++) consider(world, i, bodies, j, room);
    for (bt_idx j = 0; bodies->large[i] && j < around->copies.n; j++) consider(world, i, &around->copies, j, room);
    if (bodies->large[i]) return;
    const region r = upstream(world, i, v);
    const double at[2] = {offset(world, &bodies->pose[i], middle, 0), offset(world, &bodies->pose[i], middle, 1)};
    for (size_t k = 0; k < room->n_candidates; k++) {
        const candidate *c = &room->candidate[k];
        if (!misses(&r, at, c->low, c->high)) consider(world, i, c->b, c->i, room);
    }
}

// --- floe by floe ----------------------------------------------------------------------------------------------------

static void look_at(bt_world *world, const bt_idx i, const double v[2][2], scratch *room)
{
    const bt_params *par = &world->par;
    bt_bodies *bodies = &world->bodies;
    bt_exposure *exposure = &bodies->exposure[i];
    const double scale[2] = {par->draft, 1 - par->draft};
    double factor[2];
    if (par->lee > 0 && v[0][0] == v[1][0] && v[0][1] == v[1][1]) {
        edges(world, i, v[0], room, 2, scale, factor);
        exposure->water_form = factor[0], exposure->air_form = factor[1];
    } else if (par->lee > 0) {
        if (v[0][0] != 0 || v[0][1] != 0) edges(world, i, v[0], room, 1, scale, &exposure->water_form);
        if (v[1][0] != 0 || v[1][1] != 0) edges(world, i, v[1], room, 1, scale + 1, &exposure->air_form);
    }
    if (par->covers) exposure->skin = skin(world, i, room);
}

/// Velocities of water and air past floe i, m/s; false if it is not evaluated now: no flow or slow flow past it, or not
/// owned by this rank.
static bool flows(const bt_world *world, bt_idx i, double v[2][2])
{
    const bt_bodies *bodies = &world->bodies;
    const bt_params *par = &world->par;
    v[0][0] = par->water_u - bodies->vel[i].x, v[0][1] = par->water_v - bodies->vel[i].y;
    v[1][0] = par->air_u - bodies->vel[i].x, v[1][1] = par->air_v - bodies->vel[i].y;
    const double most = bt_max(v[0][0] * v[0][0] + v[0][1] * v[0][1], v[1][0] * v[1][0] + v[1][1] * v[1][1]);
    const bool slow = most < par->exposure_slow * par->exposure_slow;
    return bodies->motion[i] == BT_DYNAMIC && bodies->thickness[i] > 0 && bt_domain_owns(world, i) && most > 0 &&
           !(slow && world->step / par->exposure_steps % SLOW != 0);
}

static void look_cell(bt_world *world, bt_idx k, const void *around, bt_totals *none)
{
    (void)none;
    const bt_cells *cells = world->cells;
    const bt_cell *cell = &cells->cell[k];
    if (cells->asleep[k] == BT_ASLEEP) return;
    const double middle[2] = {cells->x0 + (cell->x + 0.5) * cells->side_x, cells->y0 + (cell->y + 0.5) * cells->side_y};
    scratch room = {0};
    bool listed = k == cells->n - 1; // bodies of the last cell may be sheltered by any other
    for (bt_idx i = cell->first; i < cell->end; i++) {
        double v[2][2];
        if (!flows(world, i, v)) continue;
        if (!listed) list_candidates(world, around, k, middle, &room);
        listed = true;
        gather(world, around, i, (const double(*)[2])v, middle, &room);
        look_at(world, i, (const double(*)[2])v, &room);
    }
    free(room.near);
    free(room.number);
    free(room.candidate);
}

/// Is a floe of cell k evaluated now?
static bool looks_at(const bt_world *world, bt_idx k)
{
    const bt_cell *cell = &world->cells->cell[k];
    double v[2][2];
    bool any = false;
    for (bt_idx i = cell->first; !any && world->cells->asleep[k] != BT_ASLEEP && i < cell->end; i++)
        any = flows(world, i, v);
    return any;
}

/// Rings of cells around a cell that contain the floes near any of its floes.
static int rings_of(const bt_world *world, double side, int32_t wrap)
{
    const bt_cells *cells = world->cells;
    if (wrap == 1) return 0;
    return (int)bt_max(1, ceil((world->par.lee_reach + 2 * cells->max_radius + 2 * cells->allowance) / side));
}

void bt_exposure_look(bt_world *world)
{
    const bt_cells *cells = world->cells;
    surroundings s =
        {.rings = {rings_of(world, cells->side_x, cells->wrap_x), rings_of(world, cells->side_y, cells->wrap_y)}};
    bool *needs = bt_alloc((size_t)cells->n, sizeof *needs);
    for (bt_idx j = 0; world->domain && j < cells->n_busy; j++) needs[cells->busy[j]] = looks_at(world, cells->busy[j]);
    bt_domain_around(world, needs, s.rings, world->par.lee_reach, &s.copies);
    free(needs);
    s.sorted = bt_alloc((size_t)s.copies.n, sizeof *s.sorted);
    for (bt_idx j = 0; j < s.copies.n; j++) s.sorted[j] = (placed){{s.copies.cell[j][0], s.copies.cell[j][1]}, j};
    if (s.copies.n > 0) qsort(s.sorted, (size_t)s.copies.n, sizeof *s.sorted, by_cell);
    bt_totals none = {0};
    bt_phases_busy(world, look_cell, &s, &none);
    bt_domain_share(world, (double *)world->bodies.exposure, sizeof(bt_exposure) / sizeof(double));
    free(s.sorted);
    bt_bodies_free(&s.copies);
}

void bt_exposure_begin(bt_world *world)
{
    if (world->par.exposure_steps > 0 && world->step % world->par.exposure_steps == 0) bt_exposure_look(world);
}

// --- start of a field ------------------------------------------------------------------------------------------------

void bt_exposure_setup(bt_world *world, double speed)
{
    bt_params *par = &world->par;
    const bt_bodies *bodies = &world->bodies;
    double thickest = 0, sum = 0, n = 0;
    for (bt_idx i = 0; i < bodies->n; i++) {
        thickest = bt_max(thickest, bodies->thickness[i]);
        sum += bodies->thickness[i];
        n += bodies->thickness[i] > 0;
    }
    par->lee_reach = lee_reach(par) * thickest;
    par->exposure_steps = 0;
    if (n == 0 || !(par->lee > 0 || par->covers)) return;
    par->exposure_slow = BT_EXPOSURE_SLOW * speed;
    par->exposure_steps =
        (int64_t)bt_max(1, bt_min(1e6, round(BT_EXPOSURE_WAY * par->draft * sum / n / (speed * par->dt))));
}

bt_exposure bt_exposure_mean(const bt_world *world, bt_gid n_floes)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_params *par = &world->par;
    double water = 0, air = 0, sheltered[2] = {0, 0};
    for (bt_gid g = 0; g < n_floes; g++) {
        const bt_idx i = bt_world_index(world, g);
        if (i < 0) continue;
        const double wx = par->water_u - bodies->vel[i].x, wy = par->water_v - bodies->vel[i].y,
                     ax = par->air_u - bodies->vel[i].x, ay = par->air_v - bodies->vel[i].y;
        lines rays;
        if (bodies->motion[i] != BT_DYNAMIC) continue;
        const double in_water = wx == 0 && wy == 0 ? 0 : bodies->drag[i].water_form * draw(bodies, i, wx, wy, &rays),
                     in_air = ax == 0 && ay == 0 ? 0 : bodies->drag[i].air_form * draw(bodies, i, ax, ay, &rays);
        water += in_water;
        air += in_air;
        sheltered[0] += in_water * bodies->exposure[i].water_form;
        sheltered[1] += in_air * bodies->exposure[i].air_form;
    }
    return (bt_exposure){1, water > 0 ? sheltered[0] / water : 1, air > 0 ? sheltered[1] / air : 1};
}

bt_exposure bt_exposure_estimate(const bt_params *par, double size, double thickness, double concentration)
{
    if (!(par->lee > 0) || !(concentration > 0)) return bt_exposed;
    const double way = (1 - bt_min(1, concentration)) / concentration * BT_PI / 4 * size;
    return (bt_exposure){1, way / (way + par->lee * par->draft * thickness),
                         way / (way + par->lee * (1 - par->draft) * thickness)};
}
