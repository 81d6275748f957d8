// SPDX-License-Identifier: MIT
// Power (Laguerre) diagram of weighted seeds whose cells have given areas: broken ice before it is moved apart.
//
// The cell of seed p_i with weight w_i is { x : |x − p_i|² − w_i <= |x − p_j|² − w_j for all j }. With x measured from
// p_i and D = p_j − p_i, each j gives the half-plane D·x <= (|D|² + w_i − w_j)/2. Neighbours are met in rings of a
// grid. All seeds not yet met are at a distance >= d, their lines at >= (d² − Δ)/(2d) from p_i with Δ = max w − w_i >=
// 0, which grows with d; so once (d² − Δ) >= 2 d R, R the farthest vertex of the cell so far, no later seed can cut and
// the cell is exact. Periodic directions begin from ± half a period, the line to the seed's own image; other images are
// met by rings that go round.
//
// Areas. Weights move by Δw_i = ω (A_i* − A_i)/π: for a round cell w = r² and A = π r². It is a damped Jacobi step on
// the concave dual of semi-discrete optimal transport (Aurenhammer, Hoffmann & Aronov 1998, Algorithmica 20), whose
// gradient is A* − A. A few Lloyd moves (seed to centroid) first take out the needles of a random diagram; many would
// give the honeycomb of a foam, which broken ice is not.
//
// Rejected: Qhull (one diagram of all seeds: no periodic direction, no cells of obstacles, more memory, a dependency).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "field/field_make.h"
#include "base/inside.h"
#include "base/elementary.h"
#include "base/rng.h"

enum {
    WORK = 64,      // vertices of a cell under construction
    LLOYD = 3,      // moves to the centroid
    ROUNDS = 24,    // weight updates, the Lloyd moves among them
    TRIES = 24,     // candidate places of a seed
};
// discs of this part of the cell's radius do not overlap at the start: disorder of the ice
static const double SPACING = 0.66;
static const double STEP = 0.9;     // ω
static const double SURE = 1 + 1e-12;  // beyond this, squares compare as what they are squares of
static const double SHORT_EDGE = 0.07; // shortest edge kept / diameter of equal area
static const double SLIVER = 0.16;     // least inradius / radius of equal area

typedef struct diagram {
    const bt_region *region;
    bt_idx n;
    double *p;        // [n][2] seeds
    double *w;        // [n] weights, m²
    double w_max;
    int nx, ny;       // bins
    double bx, by;    // their sides
    bt_idx *first;    // [nx*ny+1]
    struct { double x, y, w; bt_idx i; } *member; // [n] the seeds again, those of a bin in a row
} diagram;

static bt_tessellation create(bt_idx n)
{
    bt_tessellation c = {.n = n};
    c.nv = bt_alloc((size_t)n, sizeof *c.nv);
    c.v = bt_alloc((size_t)n, sizeof *c.v);
    c.target = bt_alloc((size_t)n, sizeof *c.target);
    return c;
}

void bt_tessellation_free(bt_tessellation *c)
{
    free(c->nv);
    free(c->v);
    free(c->target);
    *c = (bt_tessellation){0};
}

static bt_idx bin_of(const diagram *g, double x, double y)
{
    int ix = (int)((x - g->region->x0) / g->bx), iy = (int)((y - g->region->y0) / g->by);
    ix = ix < 0 ? 0 : ix >= g->nx ? g->nx - 1 : ix;
    iy = iy < 0 ? 0 : iy >= g->ny ? g->ny - 1 : iy;
    return iy * g->nx + ix;
}

static void sort_into_bins(diagram *g)
{
    size_t bins = (size_t)g->nx * (size_t)g->ny;
    memset(g->first, 0, (bins + 1) * sizeof *g->first);
    g->w_max = -INFINITY;
    for (bt_idx i = 0; i < g->n; i++) {
        g->first[bin_of(g, g->p[2 * i], g->p[2 * i + 1]) + 1]++;
        g->w_max = bt_max(g->w_max, g->w[i]);
    }
    for (size_t b = 0; b < bins; b++) g->first[b + 1] += g->first[b];
    bt_idx *at = bt_alloc(bins, sizeof *at);
    memcpy(at, g->first, bins * sizeof *at);
    for (bt_idx i = 0; i < g->n; i++) {
        const double x = g->p[2 * i], y = g->p[2 * i + 1];
        const bt_idx k = at[bin_of(g, x, y)]++;
        g->member[k].x = x, g->member[k].y = y, g->member[k].w = g->w[i], g->member[k].i = i;
    }
    free(at);
}

static double reach2(int n, const double *v)
{
    double r2 = 0;
    for (int i = 0; i < n; i++) r2 = bt_max(r2, v[2 * i] * v[2 * i] + v[2 * i + 1] * v[2 * i + 1]);
    return r2;
}

// Does a vertex lie beyond the line dx·x + dy·y = rhs?
static bool reached(int n, const double *v, double dx, double dy, double rhs)
{
    double far = -INFINITY;
    for (int k = 0; k < n; k++) far = bt_max(far, dx * v[2 * k] + dy * v[2 * k + 1] - rhs);
    return far > 0;
}

// Cut the cell (relative to seed i) by the seeds of one bin, shifted by a period. Returns the new count.
static int cut_by_bin(const diagram *g, bt_idx i, int n, double *v, double *r, bt_idx bin, double sx, double sy)
{
    double out[2 * WORK];
    const double px = g->p[2 * i], py = g->p[2 * i + 1], w = g->w[i];
    for (bt_idx k = g->first[bin]; k < g->first[bin + 1]; k++) {
        const double dx = g->member[k].x + sx - px, dy = g->member[k].y + sy - py, wj = g->member[k].w,
                     d2 = dx * dx + dy * dy, rhs = 0.5 * (d2 + w - wj);
        if (rhs > 0 && rhs * rhs > SURE * d2 * *r * *r) continue; // most: without a root
        const bt_idx j = g->member[k].i;
        if (j == i || rhs >= sqrt(d2) * *r) continue;
        if (d2 == 0) { // coincident seeds: the heavier one, then the lower index, has the cell
            if (wj > w || (wj == w && j < i)) return 0;
            continue;
        }
        if (!reached(n, v, dx, dy, rhs)) continue;
        int m = bt_shape_clip(n, v, dx, dy, rhs, out);
        if (m < 3) return 0;
        if (m == n && memcmp(out, v, 2 * (size_t)n * sizeof *v) == 0) continue;
        while (m >= WORK - 8) { // never met with seeds in general position
            memmove(out, out + 2, 2 * (size_t)(m - 1) * sizeof *out);
            m--;
        }
        n = m;
        memcpy(v, out, 2 * (size_t)n * sizeof *v);
        *r = sqrt(reach2(n, v));
    }
    return n;
}

// The cell of seed i relative to its seed; returns its number of vertices.
static int power_cell(const diagram *g, bt_idx i, double *v)
{
    const bt_region *y = g->region;
    double px = g->p[2 * i], py = g->p[2 * i + 1], lx = y->x1 - y->x0, ly = y->y1 - y->y0;
    double x0 = y->periodic_x ? -lx / 2 : y->x0 - px, x1 = y->periodic_x ? lx / 2 : y->x1 - px;
    double y0 = y->periodic_y ? -ly / 2 : y->y0 - py, y1 = y->periodic_y ? ly / 2 : y->y1 - py;
    memcpy(v, (double[8]){x0, y0, x1, y0, x1, y1, x0, y1}, 8 * sizeof *v);
    int n = 4;
    double r = sqrt(reach2(n, v)), delta = g->w_max - g->w[i];
    bt_idx home = bin_of(g, px, py);
    int hx = home % g->nx, hy = home / g->nx;
    for (int k = 0; n >= 3; k++) {
        for (int jy = hy - k; jy <= hy + k && n >= 3; jy++) {
            if (!y->periodic_y && (jy < 0 || jy >= g->ny)) continue;
            int wy = jy >= 0 ? jy / g->ny : -((g->ny - 1 - jy) / g->ny), by = jy - wy * g->ny;
            int step = jy == hy - k || jy == hy + k || k == 0 ? 1 : 2 * k;
            for (int jx = hx - k; jx <= hx + k && n >= 3; jx += step) {
                if (!y->periodic_x && (jx < 0 || jx >= g->nx)) continue;
                int wx = jx >= 0 ? jx / g->nx : -((g->nx - 1 - jx) / g->nx), bx = jx - wx * g->nx;
                n = cut_by_bin(g, i, n, v, &r, by * g->nx + bx, wx * lx, wy * ly);
            }
        }
        // Distance from the seed to the nearest bin not yet seen; sides beyond a wall have none.
        double d = INFINITY;
        if (y->periodic_x || hx - k > 0) d = bt_min(d, px - (y->x0 + (hx - k) * g->bx));
        if (y->periodic_x || hx + k < g->nx - 1) d = bt_min(d, y->x0 + (hx + k + 1) * g->bx - px);
        if (y->periodic_y || hy - k > 0) d = bt_min(d, py - (y->y0 + (hy - k) * g->by));
        if (y->periodic_y || hy + k < g->ny - 1) d = bt_min(d, y->y0 + (hy + k + 1) * g->by - py);
        if (d == INFINITY || (d > 0 && d * d - delta >= 2 * d * r)) break;
    }
    return n;
}

// The cell with walls and obstacles taken out, in domain coordinates.
static int ice_cell(const diagram *g, bt_idx i, double *v)
{
    int n = power_cell(g, i, v);
    for (int k = 0; k < n; k++) {
        v[2 * k] += g->p[2 * i];
        v[2 * k + 1] += g->p[2 * i + 1];
    }
    return n >= 3 ? bt_tessellation_clear(g->region, n, v, false) : 0;
}

// ---- seeds ----

// Discs in a grid, each listed in all bins that its square covers, so that discs of very different size meet.
typedef struct discs {
    double bx, by;
    int nx, ny;
    int32_t *head;
    struct { bt_idx i; int32_t next; } *node;
    int32_t n, cap;
} discs;

// Walk over the bins of the square of half side r about (x, y); (sx, sy) is the period's shift of the bin.
typedef struct bin_walk {
    const bt_region *region;
    const discs *dd;
    int ix0, ix1, iy1, ix, iy;
    size_t bin;
    double sx, sy;
} bin_walk;

static bin_walk walk_bins(const bt_region *region, const discs *dd, double x, double y, double r)
{
    bin_walk w = {.region = region, .dd = dd};
    w.ix0 = (int)floor((x - r - region->x0) / dd->bx), w.ix1 = (int)floor((x + r - region->x0) / dd->bx);
    w.iy = (int)floor((y - r - region->y0) / dd->by), w.iy1 = (int)floor((y + r - region->y0) / dd->by);
    w.ix = w.ix0 - 1;
    return w;
}

static bool next_bin(bin_walk *w)
{
    for (;;) {
        if (++w->ix > w->ix1) {
            w->ix = w->ix0;
            w->iy++;
        }
        if (w->iy > w->iy1) return false;
        // turns round the period
        int tx = (int)floor((double)w->ix / w->dd->nx), ty = (int)floor((double)w->iy / w->dd->ny);
        if ((tx && !w->region->periodic_x) || (ty && !w->region->periodic_y)) continue;
        w->bin = (size_t)(w->iy - ty * w->dd->ny) * (size_t)w->dd->nx + (size_t)(w->ix - tx * w->dd->nx);
        w->sx = tx * (w->region->x1 - w->region->x0);
        w->sy = ty * (w->region->y1 - w->region->y0);
        return true;
    }
}

// How deep, relative to their size, a disc at (x, y) lies in others, in walls and in obstacles; <= 0: free.
static double crowding(const bt_region *region, const discs *dd, const double *p, const double *radius, double x,
                       double y, double r)
{
    double worst = -1;
    if (!region->periodic_x) worst = bt_max(worst, 1 - bt_min(x - region->x0, region->x1 - x) / (SPACING * r));
    if (!region->periodic_y) worst = bt_max(worst, 1 - bt_min(y - region->y0, region->y1 - y) / (SPACING * r));
    for (int k = 0; k < region->n_obstacles; k++) {
        const bt_obstacle *o = &region->obstacles[k];
        if (bt_hypot(x - o->x, y - o->y) > o->radius + r) continue;
        double out = -INFINITY; // distance to the obstacle, from below
        for (int e = 0; e < o->n; e++) {
            const double *a = o->v + 2 * e, *b = o->v + 2 * ((e + 1) % o->n);
            double ex = b[0] - a[0], ey = b[1] - a[1];
            out = bt_max(out, (ey * (x - a[0]) - ex * (y - a[1])) / bt_hypot(ex, ey));
        }
        worst = bt_max(worst, 1 - out / (SPACING * r));
    }
    for (bin_walk w = walk_bins(region, dd, x, y, SPACING * r); next_bin(&w);)
        for (int32_t k = dd->head[w.bin]; k >= 0; k = dd->node[k].next) {
            bt_idx j = dd->node[k].i;
            double d = bt_hypot(p[2 * j] + w.sx - x, p[2 * j + 1] + w.sy - y);
            worst = bt_max(worst, 1 - d / (SPACING * (r + radius[j])));
        }
    return worst;
}

typedef struct by_size { double r; bt_idx i; } by_size;

static int larger_first(const void *a, const void *b)
{
    const by_size *p = a, *q = b;
    if (p->r != q->r) return p->r > q->r ? -1 : 1;
    return (p->i > q->i) - (p->i < q->i);
}

// Random places, large cells first, each the freest of a few candidates (sequential addition, then best of TRIES).
static void place_seeds(const bt_region *y, bt_idx n, const double *radius, int64_t seed, double *p)
{
    double lx = y->x1 - y->x0, ly = y->y1 - y->y0, mean = 0;
    by_size *order = bt_alloc((size_t)n, sizeof *order);
    for (bt_idx i = 0; i < n; i++) {
        order[i] = (by_size){radius[i], i};
        mean += radius[i] / n;
    }
    qsort(order, (size_t)n, sizeof *order, larger_first);
    discs dd = {.nx = (int)bt_max(1, floor(lx / (2 * mean))), .ny = (int)bt_max(1, floor(ly / (2 * mean)))};
    dd.bx = lx / dd.nx;
    dd.by = ly / dd.ny;
    size_t bins = (size_t)dd.nx * (size_t)dd.ny;
    dd.head = bt_alloc(bins, sizeof *dd.head);
    for (size_t b = 0; b < bins; b++) dd.head[b] = -1;
    for (bt_idx k = 0; k < n; k++) {
        bt_idx i = order[k].i;
        bt_rng rng = bt_rng_start(seed, BT_RNG_PLACE, i);
        double least = INFINITY;
        for (int t = 0; t < TRIES && least > 0; t++) {
            double x = y->x0 + lx * bt_rng_uniform(&rng), z = y->y0 + ly * bt_rng_uniform(&rng);
            double worst = crowding(y, &dd, p, radius, x, z, radius[i]);
            if (worst < least) {
                least = worst;
                p[2 * i] = x;
                p[2 * i + 1] = z;
            }
        }
        for (bin_walk w = walk_bins(y, &dd, p[2 * i], p[2 * i + 1], SPACING * radius[i]); next_bin(&w);) {
            if (dd.n == dd.cap) {
                dd.cap = dd.cap ? 2 * dd.cap : 1024;
                dd.node = bt_realloc(dd.node, (size_t)dd.cap, sizeof *dd.node);
            }
            dd.node[dd.n].i = i;
            dd.node[dd.n].next = dd.head[w.bin];
            dd.head[w.bin] = dd.n++;
        }
    }
    free(order);
    free(dd.head);
    free(dd.node);
}

// ---- areas ----

bt_tessellation bt_tessellation_tessellate(const bt_region *y, bt_idx n, const double *target, int64_t seed)
{
    bt_tessellation cells = create(n);
    double lx = y->x1 - y->x0, ly = y->y1 - y->y0, wanted = 0;
    for (bt_idx i = 0; i < n; i++) wanted += target[i];
    double share = y->ice_area / wanted; // cells fill the region
    double *radius = bt_alloc((size_t)n, sizeof *radius);
    for (bt_idx i = 0; i < n; i++) {
        cells.target[i] = target[i];
        radius[i] = sqrt(target[i] * share / BT_PI);
    }

    diagram g = {.region = y, .n = n};
    g.p = bt_alloc(2 * (size_t)n, sizeof *g.p);
    g.w = bt_alloc((size_t)n, sizeof *g.w);
    place_seeds(y, n, radius, seed, g.p);
    for (bt_idx i = 0; i < n; i++) g.w[i] = radius[i] * radius[i];
    double bin = sqrt(2 * lx * ly / n); // two seeds a bin
    g.nx = (int)bt_max(1, floor(lx / bin));
    g.ny = (int)bt_max(1, floor(ly / bin));
    g.bx = lx / g.nx;
    g.by = ly / g.ny;
    g.first = bt_alloc((size_t)g.nx * (size_t)g.ny + 1, sizeof *g.first);
    g.member = bt_alloc((size_t)n, sizeof *g.member);

    double *area = bt_alloc((size_t)n, sizeof *area), *next = bt_alloc(2 * (size_t)n, sizeof *next);
    for (int round = 0; round < ROUNDS; round++) {
        sort_into_bins(&g);
#pragma omp parallel for schedule(dynamic, 256) if (BT_MANY(n, 2000))
        for (bt_idx i = 0; i < n; i++) {
            double v[2 * 2 * WORK];
            int m = ice_cell(&g, i, v);
            bt_moments mo = m >= 3 ? bt_shape_centroid(m, v) : (bt_moments){.cx = g.p[2 * i], .cy = g.p[2 * i + 1]};
            area[i] = mo.area;
            next[2 * i] = mo.cx;
            next[2 * i + 1] = mo.cy;
        }
        double sum = 0;
        for (bt_idx i = 0; i < n; i++) sum += area[i];
        for (bt_idx i = 0; i < n; i++) {
            g.w[i] += STEP / BT_PI * (target[i] * sum / wanted - area[i]);
            if (round >= LLOYD) continue;
            g.p[2 * i] = next[2 * i];
            g.p[2 * i + 1] = next[2 * i + 1];
            bt_region_wrap(y, &g.p[2 * i], &g.p[2 * i + 1]);
        }
    }
    sort_into_bins(&g);
#pragma omp parallel for schedule(dynamic, 256) if (BT_MANY(n, 2000))
    for (bt_idx i = 0; i < n; i++) {
        double v[2 * 2 * WORK];
        int m = ice_cell(&g, i, v);
        if (m < 3) continue;
        double full = bt_shape_centroid(m, v).area;
        m = bt_tessellation_clean(m, v, SHORT_EDGE * 2 * sqrt(full / BT_PI), BT_TESSELLATION_VERTICES);
        bt_moments mo = bt_shape_extent(m, v);
        if (mo.inradius < SLIVER * sqrt(mo.area / BT_PI) || mo.area < 0.1 * target[i] * share) continue;
        cells.nv[i] = m;
        memcpy(cells.v[i], v, 2 * (size_t)m * sizeof *v);
    }
    free(radius);
    free(area);
    free(next);
    free(g.p);
    free(g.w);
    free(g.first);
    free(g.member);
    return cells;
}
