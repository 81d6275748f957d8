// SPDX-License-Identifier: MIT
// Lee of edges and covered skin, floe by floe; equations in force/exposure.h.
#include "force/exposure.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "body/bodies.h"
#include "partition/domain.h"
#include "space/cells.h"
#include "space/phases.h"

enum { SLOW = 8 }; // looks to one at a floe past which nothing flows fast, assumed

#define TAPER 3.5 // x at which the lee begins to end, assumed

/// Lines along the flow past a floe: a power of two, so that their mean is exact where all agree. With 64 the factor of
/// a floe of 30 m in 80 % ice is another by 0.02 rms, and the mean of the field 0.568 for 0.566.
enum { LINES = 8 };

/// A floe near the one that is looked at.
typedef struct neighbour {
    const bt_bodies *b;
    bt_idx i;
    double dx, dy; ///< from centroid to centroid, m
} neighbour;

/// What one visit needs memory for.
typedef struct scratch {
    neighbour *near;
    size_t n, cap;
    double *number;
    size_t n_numbers, cap_numbers;
    struct quarter *quarter;
    size_t cap_quarters;
} scratch;

/// A copy of a floe, by its cell.
typedef struct placed {
    int32_t cell[2];
    bt_idx i;
} placed;

/// The floes that this rank can look at, by cells.
typedef struct surroundings {
    int rings[2];     ///< cells along x and y within which all stand that may shelter a floe
    bt_bodies copies; ///< of those rings that this rank does not hold
    placed *sorted;   ///< [copies.n] by cell
} surroundings;

/// Farthest that ice shelters / its thickness, of the fluid with the higher edges.
static double lee_reach(const bt_params *p) { return BT_EXPOSURE_REACH * p->lee * bt_max(p->draft, 1 - p->draft); }

// --- form drag -------------------------------------------------------------------------------------------------------

/// g(x)
static double lee(double x)
{
    if (x >= BT_EXPOSURE_REACH) return 0;
    const double u = (x - TAPER) / (BT_EXPOSURE_REACH - TAPER);
    return bt_exp(-x) * (u > 0 ? 1 - u * u * (3 - 2 * u) : 1);
}

/// Lines along the flow, evenly over the width of a floe, about its centroid.
typedef struct lines {
    double along[2];     ///< of the flow
    double from, step;   ///< places across: from + (k + ½) step, m
    double enter[LINES]; ///< where they enter the floe, along the flow, m
    double first, last;  ///< of them
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

/// Where the lines enter and leave a convex polygon that has been turned; INFINITY, −INFINITY of those that pass it by.
static void cross(const lines *l, int n, const double *v, double in[LINES], double out[LINES])
{
    const double per_step = 1 / l->step;
    for (int k = 0; k < LINES; k++) in[k] = INFINITY, out[k] = -INFINITY;
    for (int e = 0; e < n; e++) {
        const double *p = v + 2 * e, *q = v + 2 * (e + 1 < n ? e + 1 : 0);
        if (p[1] == q[1]) continue;
        const double low = bt_min(p[1], q[1]), high = bt_max(p[1], q[1]), slope = (q[0] - p[0]) / (q[1] - p[1]);
        const double place = (low - l->from) * per_step - 0.5;
        if (place > LINES - 1) continue;
        int k = place > 0 ? (int)place : 0;
        if (k < place) k++;
        for (; k < LINES; k++) {
            const double at = l->from + (k + 0.5) * l->step;
            if (at > high) break;
            const double s = p[0] + (at - p[1]) * slope;
            in[k] = bt_min(in[k], s);
            out[k] = bt_max(out[k], s);
        }
    }
}

/// Width of the convex hull of body i across the flow (vx, vy) that is not 0, m, and the lines.
static double draw(const bt_bodies *b, bt_idx i, double vx, double vy, lines *l)
{
    const int n = bt_body_corners(b, i);
    const bt_mark *mark = b->mark + b->offset[i];
    const double size = sqrt(vx * vx + vy * vy);
    l->along[0] = vx / size, l->along[1] = vy / size;
    double v[2 * BT_MAX_VERTICES], out[LINES];
    int m = 0;
    for (int k = 0; k < n; k++)
        if (mark[k].next != k) turn(l->along, 0, 0, 1, b->outline + 2 * (b->offset[i] + k), v + 2 * m++);
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < m; k++) low = bt_min(low, v[2 * k + 1]), high = bt_max(high, v[2 * k + 1]);
    l->from = low;
    l->step = (high - low) / LINES;
    cross(l, m, v, l->enter, out);
    l->first = INFINITY, l->last = -INFINITY;
    for (int k = 0; k < LINES; k++) l->first = bt_min(l->first, l->enter[k]), l->last = bt_max(l->last, l->enter[k]);
    return high - low;
}

/// What a neighbour leaves of n fluids with the heights scale × h, on each line; thickness: of the floe that is looked
/// at.
static void cast(const bt_params *p, const lines *l, const neighbour *j, double thickness, int n, const double *scale,
                 double shelter[][LINES])
{
    const bt_bodies *b = j->b;
    const double r = b->radius[j->i], h = b->thickness[j->i], reach = lee_reach(p) * h;
    const double s = l->along[0] * j->dx + l->along[1] * j->dy, t = l->along[0] * j->dy - l->along[1] * j->dx;
    if (s - r >= l->last || l->first - s - r >= reach || t - r >= l->from + LINES * l->step || t + r <= l->from) return;
    for (int part = bt_part_first(b, j->i); part >= 0; part = bt_part_next(b, j->i, part)) {
        const int64_t first = b->offset[j->i] + part;
        double v[2 * BT_MAX_VERTICES], in[LINES], out[LINES];
        turn(l->along, j->dx, j->dy, b->mark[first].count, b->outline + 2 * first, v);
        cross(l, b->mark[first].count, v, in, out);
        for (int k = 0; k < LINES; k++) {
            const double away = bt_max(0, l->enter[k] - out[k]);
            if (!(in[k] < l->enter[k]) || away >= reach) continue;
            for (int f = 0; f < n; f++) {
                const double by = bt_min(1, h / thickness) * lee(away / (p->lee * scale[f] * h));
                shelter[f][k] = bt_max(shelter[f][k], by);
            }
        }
    }
}

/// Factors of n fluids that flow past floe i with the same velocity.
static void edges(const bt_world *w, bt_idx i, const double v[2], const scratch *s, int n, const double *scale,
                  double factor[])
{
    lines l;
    double shelter[2][LINES] = {{0}};
    draw(&w->bodies, i, v[0], v[1], &l);
    for (size_t k = 0; k < s->n; k++) cast(&w->par, &l, &s->near[k], w->bodies.thickness[i], n, scale, shelter);
    for (int f = 0; f < n; f++) {
        double sum = 0;
        for (int k = 0; k < LINES; k++) sum += shelter[f][k];
        factor[f] = bt_max(0, 1 - sum / LINES);
    }
}

// --- skin drag -------------------------------------------------------------------------------------------------------

static int outline_of(const neighbour *j, const double **v)
{
    *v = j->b->outline + 2 * j->b->offset[j->i];
    return bt_body_corners(j->b, j->i);
}

/// Area that two convex outlines share, m²: what is left of b between the edges of a, one after the other.
static double shared(const neighbour *a, const neighbour *b)
{
    const double *v, *u, dx = b->dx - a->dx, dy = b->dy - a->dy;
    const int n = outline_of(a, &v);
    int m = outline_of(b, &u);
    double left[2][4 * BT_MAX_VERTICES];
    for (int k = 0; k < m; k++) left[0][2 * k] = u[2 * k] + dx, left[0][2 * k + 1] = u[2 * k + 1] + dy;
    for (int e = 0; e < n; e++) {
        const double *p = v + 2 * e, *q = v + 2 * (e + 1 < n ? e + 1 : 0);
        const double *from = left[e & 1], *last = from + 2 * (m - 1);
        const double ex = q[0] - p[0], ey = q[1] - p[1];
        double *to = left[1 - (e & 1)], before = m > 0 ? ex * (last[1] - p[1]) - ey * (last[0] - p[0]) : 0;
        int kept = 0;
        for (int k = 0; k < m; last = from + 2 * k++) {
            const double *at = from + 2 * k, inside = ex * (at[1] - p[1]) - ey * (at[0] - p[0]);
            if ((inside >= 0) != (before >= 0)) {
                const double f = before / (before - inside);
                to[2 * kept] = last[0] + f * (at[0] - last[0]);
                to[2 * kept++ + 1] = last[1] + f * (at[1] - last[1]);
            }
            if (inside >= 0) to[2 * kept] = at[0], to[2 * kept++ + 1] = at[1];
            before = inside;
        }
        m = kept;
    }
    const double *v_left = left[n & 1];
    double twice = 0;
    for (int k = 1; k + 1 < m; k++)
        twice += (v_left[2 * k] - v_left[0]) * (v_left[2 * k + 3] - v_left[1]) -
                 (v_left[2 * k + 1] - v_left[1]) * (v_left[2 * k + 2] - v_left[0]);
    return bt_max(0, 0.5 * twice);
}

/// Do two convex outlines overlap by more than `slop`, m, along every edge normal of the first? Of the other one it is
/// asked the other way round.
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

/// By insertion: there are few, and most lists are nearly in order.
static void sort(double *x, size_t n)
{
    for (size_t j = 1; j < n; j++) {
        const double at = x[j];
        size_t k = j;
        for (; k > 0 && x[k - 1] > at; k--) x[k] = x[k - 1];
        x[k] = at;
    }
}

static void put(scratch *s, double x)
{
    if (s->n_numbers == s->cap_numbers) {
        s->cap_numbers = s->cap_numbers ? 2 * s->cap_numbers : 64;
        s->number = bt_realloc(s->number, s->cap_numbers, sizeof *s->number);
    }
    s->number[s->n_numbers++] = x;
}

/// Ordinates at which edges of two outlines cross.
static void add_crossings(const neighbour *a, const neighbour *b, scratch *s)
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
            put(s, a->dy + f[1] + dy + d0 / (d0 - d1) * (g[1] - f[1]));
        }
    }
}

/// The line y = const in a convex outline: from x[0] to x[1]; false where it passes by.
static bool chord(const neighbour *j, double y, double x[2])
{
    const double *v;
    const int n = outline_of(j, &v);
    x[0] = INFINITY, x[1] = -INFINITY;
    y -= j->dy;
    for (int k = 0; k < n; k++) {
        const double *p = v + 2 * k, *q = v + 2 * (k + 1 < n ? k + 1 : 0);
        if ((p[1] < y) == (q[1] < y)) continue;
        const double at = j->dx + p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0]);
        x[0] = bt_min(x[0], at);
        x[1] = bt_max(x[1], at);
    }
    return x[0] < x[1];
}

/// ∫ dx/n on the line y = const through the first of m sheets, m; *own: what of the line lies in it.
static double seen_on(const neighbour *sheet, size_t m, double y, double *end, double *own)
{
    double x[2], of[2];
    *own = 0;
    if (!chord(&sheet[0], y, x)) return 0;
    *own = x[1] - x[0];
    size_t n = 0; // ends, in pairs: places where a sheet begins, and where it ends
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

/// e of a floe, the first of m sheets.
static double seen(const neighbour *sheet, size_t m, scratch *s)
{
    s->n_numbers = 0;
    for (size_t k = 0; k < m; k++) {
        const double *v;
        const int n = outline_of(&sheet[k], &v);
        for (int c = 0; c < n; c++) put(s, sheet[k].dy + v[2 * c + 1]);
        for (size_t j = 0; j < k; j++) add_crossings(&sheet[j], &sheet[k], s);
    }
    const size_t n = s->n_numbers;
    sort(s->number, n);
    for (size_t k = 0; k < 2 * m; k++) put(s, 0);
    double area = 0, sum = 0;
    for (size_t k = 0; k + 1 < n; k++) {
        const double high = s->number[k + 1] - s->number[k], y = s->number[k] + 0.5 * high;
        double own;
        if (!(high > 0)) continue;
        sum += high * seen_on(sheet, m, y, s->number + n, &own);
        area += high * own;
    }
    return area > 0 ? bt_min(1, sum / area) : 1;
}

/// The sheets on and under floe i go to the front of the list, which loses its order.
static double skin(const bt_world *w, bt_idx i, scratch *s)
{
    const bt_bodies *b = &w->bodies;
    const double deck = 1 - w->par.draft;
    size_t m = 0;
    for (size_t k = 0; k < s->n; k++) {
        const neighbour j = s->near[k];
        const double r = b->radius[i] + j.b->radius[j.i];
        if (j.dx * j.dx + j.dy * j.dy >= r * r || !bt_bodies_slide(b, i, j.b, j.i, w->towed, deck)) continue;
        if (!within(b, i, j.b, j.i, j.dx, j.dy, w->par.slop) || !within(j.b, j.i, b, i, -j.dx, -j.dy, w->par.slop))
            continue;
        s->near[k] = s->near[m];
        s->near[m++] = j;
    }
    if (m == 0) return 1;
    neighbour *sheet = bt_alloc(m + 1, sizeof *sheet);
    sheet[0] = (neighbour){b, i, 0, 0};
    for (size_t j = 0; j < m; j++) { // by id: rounding follows the order
        const neighbour at = s->near[j];
        size_t k = j + 1;
        for (; k > 1 && sheet[k - 1].b->gid[sheet[k - 1].i] > at.b->gid[at.i]; k--) sheet[k] = sheet[k - 1];
        sheet[k] = at;
    }
    bool pile = false;
    for (size_t k = 2; k <= m; k++)
        for (size_t j = 1; j < k; j++) pile = pile || shared(&sheet[j], &sheet[k]) > 0;
    double e = 1;
    for (size_t k = 1; k <= m && !pile; k++) e -= 0.5 * shared(sheet, &sheet[k]) / b->area[i];
    if (pile) e = seen(sheet, m + 1, s);
    free(sheet);
    return bt_max(0, e);
}

// --- who is near -----------------------------------------------------------------------------------------------------

/// Floes of one cell, held here or copies, and the box about them from the middle of the cell that is looked at, m.
typedef struct quarter {
    const bt_bodies *b;
    const placed *copy; ///< [first, end); NULL = bodies [first, end)
    bt_idx first, end;
    double low[2], high[2];
} quarter;

/// Where obstacles of floe i may stand: from its centroid, m.
typedef struct region {
    double low[2], high[2];
} region;

static bt_idx floe_of(const quarter *q, bt_idx k) { return q->copy ? q->copy[k].i : k; }

static double offset(const bt_world *w, const bt_pose *p, const double from[2], int axis)
{
    return axis ? bt_nearest_image(p->y - from[1], w->par.period_y) : bt_nearest_image(p->x - from[0], w->par.period_x);
}

/// Does a box from low to high miss that of the region about a place?
static bool misses(const region *r, const double at[2], const double low[2], const double high[2])
{
    return low[0] > at[0] + r->high[0] || high[0] < at[0] + r->low[0] || low[1] > at[1] + r->high[1] ||
           high[1] < at[1] + r->low[1];
}

static void consider(const bt_world *w, bt_idx i, const region *r, const bt_bodies *b, bt_idx j, scratch *s)
{
    const double h = b->thickness[j], size = b->radius[j], reach = w->bodies.radius[i] + size + lee_reach(&w->par) * h,
                 from[2] = {w->bodies.pose[i].x, w->bodies.pose[i].y},
                 d[2] = {offset(w, &b->pose[j], from, 0), offset(w, &b->pose[j], from, 1)};
    if (d[0] * d[0] + d[1] * d[1] >= reach * reach || !(h > 0) || b->gid[j] == w->bodies.gid[i]) return;
    const double low[2] = {d[0] - size, d[1] - size}, high[2] = {d[0] + size, d[1] + size};
    if (misses(r, (const double[]){0, 0}, low, high)) return;
    if (s->n == s->cap) {
        s->cap = s->cap ? 2 * s->cap : 32;
        s->near = bt_realloc(s->near, s->cap, sizeof *s->near);
    }
    s->near[s->n++] = (neighbour){b, j, d[0], d[1]};
}

/// Columns (or rows) of cells within so many rings of c: the first, and how many. Around a period none comes twice.
static int32_t span(int32_t c, int rings, int32_t wrap, int32_t *first)
{
    const int32_t n = 2 * rings + 1;
    *first = wrap > 0 && n >= wrap ? 0 : c - rings;
    return wrap > 0 && n >= wrap ? wrap : n;
}

static int by_cell(const void *a, const void *b)
{
    const placed *p = a, *q = b;
    if (p->cell[1] != q->cell[1]) return p->cell[1] < q->cell[1] ? -1 : 1;
    return (p->cell[0] > q->cell[0]) - (p->cell[0] < q->cell[0]);
}

/// Copies of cell (x, y): the first, and the end.
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

/// The quarters about cell k, of which [0, n) are returned; about its middle.
static size_t quarters(const bt_world *w, const surroundings *around, bt_idx k, const double middle[2], scratch *s)
{
    const bt_cells *t = w->cells;
    const bt_cell *cell = &t->cell[k];
    int32_t from[2];
    const int32_t n_x = span(cell->x, around->rings[0], t->wrap_x, &from[0]),
                  n_y = span(cell->y, around->rings[1], t->wrap_y, &from[1]);
    const bool round[2] = {n_x == t->wrap_x, n_y == t->wrap_y}; // no box goes all around a period
    size_t n = 0;
    if (s->cap_quarters < 2 * (size_t)n_x * (size_t)n_y) {
        s->cap_quarters = 2 * (size_t)n_x * (size_t)n_y;
        s->quarter = bt_realloc(s->quarter, s->cap_quarters, sizeof *s->quarter);
    }
    for (int32_t c = 0; c < n_x * n_y; c++) {
        int32_t x = from[0] + c % n_x, y = from[1] + c / n_x;
        if (t->wrap_x) x = bt_cells_wrapped(x, t->wrap_x);
        if (t->wrap_y) y = bt_cells_wrapped(y, t->wrap_y);
        const bt_idx held = bt_cells_at(t, x, y);
        quarter q = {.b = &w->bodies};
        if (held >= 0) q.first = t->cell[held].first, q.end = t->cell[held].end;
        for (int copies = 0; copies < 2; copies++) {
            if (copies) {
                q.b = &around->copies, q.copy = around->sorted;
                find_copies(around, x, y, &q.first, &q.end);
            }
            if (q.first == q.end) continue;
            for (int axis = 0; axis < 2; axis++) q.low[axis] = INFINITY, q.high[axis] = -INFINITY;
            for (bt_idx j = q.first; j < q.end; j++) {
                const bt_idx i = floe_of(&q, j);
                for (int axis = 0; axis < 2; axis++) {
                    const double d = round[axis] ? 0 : offset(w, &q.b->pose[i], middle, axis),
                                 size = round[axis] ? INFINITY : q.b->radius[i];
                    q.low[axis] = bt_min(q.low[axis], d - size);
                    q.high[axis] = bt_max(q.high[axis], d + size);
                }
            }
            s->quarter[n++] = q;
        }
    }
    return n;
}

/// Where fluids that flow past floe i at v may come from: the circle about it, drawn out upstream by the farthest lee.
static region upstream(const bt_world *w, bt_idx i, const double v[2][2])
{
    const double r = w->bodies.radius[i];
    region of = {{-r, -r}, {r, r}};
    for (int f = 0; f < 2; f++)
        for (int axis = 0; axis < 2; axis++) {
            const double size = sqrt(v[f][0] * v[f][0] + v[f][1] * v[f][1]);
            if (!(size > 0)) continue;
            const double way = -w->par.lee_reach * v[f][axis] / size;
            of.low[axis] = bt_min(of.low[axis], way - r);
            of.high[axis] = bt_max(of.high[axis], way + r);
        }
    return of;
}

/// All floes that may shelter or cover floe i of a cell with n quarters about its middle.
static void gather(const bt_world *w, const surroundings *around, bt_idx i, const double v[2][2],
                   const double middle[2], size_t n, scratch *s)
{
    const bt_cells *t = w->cells;
    const bt_bodies *b = &w->bodies;
    const region r = upstream(w, i, v);
    s->n = 0;
    for (bt_idx j = b->large[i] ? 0 : t->n_in_cells; j < b->n; j++) consider(w, i, &r, b, j, s);
    for (bt_idx j = 0; b->large[i] && j < around->copies.n; j++) consider(w, i, &r, &around->copies, j, s);
    if (b->large[i]) return;
    const double at[2] = {offset(w, &b->pose[i], middle, 0), offset(w, &b->pose[i], middle, 1)};
    for (size_t k = 0; k < n; k++) {
        const quarter *q = &s->quarter[k];
        if (misses(&r, at, q->low, q->high)) continue;
        for (bt_idx j = q->first; j < q->end; j++) consider(w, i, &r, q->b, floe_of(q, j), s);
    }
}

// --- floe by floe ----------------------------------------------------------------------------------------------------

static void look_at(bt_world *w, const bt_idx i, const double v[2][2], scratch *s)
{
    const bt_params *p = &w->par;
    bt_bodies *b = &w->bodies;
    bt_exposure *e = &b->exposure[i];
    const double scale[2] = {p->draft, 1 - p->draft};
    double factor[2];
    if (p->lee > 0 && v[0][0] == v[1][0] && v[0][1] == v[1][1]) {
        edges(w, i, v[0], s, 2, scale, factor);
        e->water_form = factor[0], e->air_form = factor[1];
    } else if (p->lee > 0) {
        if (v[0][0] != 0 || v[0][1] != 0) edges(w, i, v[0], s, 1, scale, &e->water_form);
        if (v[1][0] != 0 || v[1][1] != 0) edges(w, i, v[1], s, 1, scale + 1, &e->air_form);
    }
    if (p->covers) e->skin = skin(w, i, s);
}

/// Velocities of water and air past floe i, m/s; false where it is not looked at now: nothing flows past it, or slowly,
/// or it is none of this rank.
static bool flows(const bt_world *w, bt_idx i, double v[2][2])
{
    const bt_bodies *b = &w->bodies;
    const bt_params *p = &w->par;
    v[0][0] = p->water_u - b->vel[i].x, v[0][1] = p->water_v - b->vel[i].y;
    v[1][0] = p->air_u - b->vel[i].x, v[1][1] = p->air_v - b->vel[i].y;
    const double most = bt_max(v[0][0] * v[0][0] + v[0][1] * v[0][1], v[1][0] * v[1][0] + v[1][1] * v[1][1]);
    const bool slow = most < p->exposure_slow * p->exposure_slow;
    return b->motion[i] == BT_DYNAMIC && b->thickness[i] > 0 && bt_domain_owns(w, i) && most > 0 &&
           !(slow && w->step / p->exposure_steps % SLOW != 0);
}

static void look_cell(bt_world *w, bt_idx k, const void *around, bt_totals *none)
{
    (void)none;
    const bt_cells *t = w->cells;
    const bt_cell *cell = &t->cell[k];
    if (t->asleep[k] == BT_ASLEEP) return;
    const double middle[2] = {t->x0 + (cell->x + 0.5) * t->side_x, t->y0 + (cell->y + 0.5) * t->side_y};
    scratch s = {0};
    size_t n = 0;
    for (bt_idx i = cell->first; i < cell->end; i++) {
        double v[2][2];
        if (!flows(w, i, v)) continue;
        if (n == 0 && k < t->n - 1) n = quarters(w, around, k, middle, &s);
        gather(w, around, i, (const double(*)[2])v, middle, n, &s);
        look_at(w, i, (const double(*)[2])v, &s);
    }
    free(s.near);
    free(s.number);
    free(s.quarter);
}

/// Rings of cells that the floes near one of the middle cell stand in.
static int rings_of(const bt_world *w, double side, int32_t wrap)
{
    const bt_cells *t = w->cells;
    if (wrap == 1) return 0;
    return (int)bt_max(1, ceil((w->par.lee_reach + 2 * t->reach + 2 * t->allowance) / side));
}

void bt_exposure_look(bt_world *w)
{
    const bt_cells *t = w->cells;
    surroundings s = {.rings = {rings_of(w, t->side_x, t->wrap_x), rings_of(w, t->side_y, t->wrap_y)}};
    bt_domain_around(w, s.rings, w->par.lee_reach, &s.copies);
    s.sorted = bt_alloc((size_t)s.copies.n, sizeof *s.sorted);
    for (bt_idx j = 0; j < s.copies.n; j++) s.sorted[j] = (placed){{s.copies.cell[j][0], s.copies.cell[j][1]}, j};
    if (s.copies.n > 0) qsort(s.sorted, (size_t)s.copies.n, sizeof *s.sorted, by_cell);
    bt_totals none = {0};
    bt_phases_busy(w, look_cell, &s, &none);
    bt_domain_share(w, (double *)w->bodies.exposure, sizeof(bt_exposure) / sizeof(double));
    free(s.sorted);
    bt_bodies_free(&s.copies);
}

void bt_exposure_begin(bt_world *w)
{
    if (w->par.exposure_steps > 0 && w->step % w->par.exposure_steps == 0) bt_exposure_look(w);
}

// --- a field that begins ---------------------------------------------------------------------------------------------

void bt_exposure_setup(bt_world *w, double speed)
{
    bt_params *p = &w->par;
    const bt_bodies *b = &w->bodies;
    double thickest = 0, sum = 0, n = 0;
    for (bt_idx i = 0; i < b->n; i++) {
        thickest = bt_max(thickest, b->thickness[i]);
        sum += b->thickness[i];
        n += b->thickness[i] > 0;
    }
    p->lee_reach = lee_reach(p) * thickest;
    p->exposure_steps = 0;
    if (n == 0 || !(p->lee > 0 || p->covers)) return;
    p->exposure_slow = BT_EXPOSURE_SLOW * speed;
    p->exposure_steps = (int64_t)bt_max(1, bt_min(1e6, round(BT_EXPOSURE_WAY * p->draft * sum / n / (speed * p->dt))));
}

bt_exposure bt_exposure_mean(const bt_world *w, bt_gid n_floes)
{
    const bt_bodies *b = &w->bodies;
    const bt_params *p = &w->par;
    double water = 0, air = 0, sheltered[2] = {0, 0};
    for (bt_gid g = 0; g < n_floes; g++) {
        const bt_idx i = bt_world_index(w, g);
        if (i < 0) continue;
        const double wx = p->water_u - b->vel[i].x, wy = p->water_v - b->vel[i].y, ax = p->air_u - b->vel[i].x,
                     ay = p->air_v - b->vel[i].y;
        lines l;
        if (b->motion[i] != BT_DYNAMIC) continue;
        const double in_water = wx == 0 && wy == 0 ? 0 : b->drag[i].water_form * draw(b, i, wx, wy, &l),
                     in_air = ax == 0 && ay == 0 ? 0 : b->drag[i].air_form * draw(b, i, ax, ay, &l);
        water += in_water;
        air += in_air;
        sheltered[0] += in_water * b->exposure[i].water_form;
        sheltered[1] += in_air * b->exposure[i].air_form;
    }
    return (bt_exposure){1, water > 0 ? sheltered[0] / water : 1, air > 0 ? sheltered[1] / air : 1};
}

bt_exposure bt_exposure_estimate(const bt_params *p, double size, double thickness, double concentration)
{
    if (!(p->lee > 0) || !(concentration > 0)) return bt_exposed;
    const double way = (1 - bt_min(1, concentration)) / concentration * BT_PI / 4 * size;
    return (bt_exposure){1, way / (way + p->lee * p->draft * thickness),
                         way / (way + p->lee * (1 - p->draft) * thickness)};
}
