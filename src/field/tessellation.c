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
#include "base/elementary.h"
#include "base/inside.h"
#include "base/rng.h"

enum {
    WORK = 64,      // vertices of a cell under construction
    LLOYD = 3,      // moves to the centroid
    ROUNDS = 24,    // weight updates, including the Lloyd moves
    TRIES = 24,     // candidate places of a seed
};
// discs with this share of the cell's radius do not overlap at the start: sets the disorder of the ice
static const double SPACING = 0.66;
static const double STEP = 0.9;     // ω
static const double SURE = 1 + 1e-12;  // squares that differ by more compare like their roots
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
    struct { double x, y, w; bt_idx i; } *member; // [n] the seeds sorted by bin
} diagram;

static bt_tessellation create(bt_idx n)
{
    bt_tessellation cells = {.n = n};
    cells.nv = bt_alloc((size_t)n, sizeof *cells.nv);
    cells.v = bt_alloc((size_t)n, sizeof *cells.v);
    cells.target = bt_alloc((size_t)n, sizeof *cells.target);
    return cells;
}

void bt_tessellation_free(bt_tessellation *cells)
{
    free(cells->nv);
    free(cells->v);
    free(cells->target);
    *cells = (bt_tessellation){0};
}

static bt_idx bin_of(const diagram *tiling, double x, double y)
{
    int ix = (int)((x - tiling->region->x0) / tiling->bx), iy = (int)((y - tiling->region->y0) / tiling->by);
    ix = ix < 0 ? 0 : ix >= tiling->nx ? tiling->nx - 1 : ix;
    iy = iy < 0 ? 0 : iy >= tiling->ny ? tiling->ny - 1 : iy;
    return iy * tiling->nx + ix;
}

static void sort_into_bins(diagram *tiling)
{
    size_t bins = (size_t)tiling->nx * (size_t)tiling->ny;
    memset(tiling->first, 0, (bins + 1) * sizeof *tiling->first);
    tiling->w_max = -INFINITY;
    for (bt_idx i = 0; i < tiling->n; i++) {
        tiling->first[bin_of(tiling, tiling->p[2 * i], tiling->p[2 * i + 1]) + 1]++;
        tiling->w_max = bt_max(tiling->w_max, tiling->w[i]);
    }
    for (size_t b = 0; b < bins; b++) tiling->first[b + 1] += tiling->first[b];
    bt_idx *at = bt_alloc(bins, sizeof *at);
    memcpy(at, tiling->first, bins * sizeof *at);
    for (bt_idx i = 0; i < tiling->n; i++) {
        const double x = tiling->p[2 * i], y = tiling->p[2 * i + 1];
        const bt_idx k = at[bin_of(tiling, x, y)]++;
        tiling->member[k].x = x, tiling->member[k].y = y, tiling->member[k].w = tiling->w[i], tiling->member[k].i = i;
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
static int cut_by_bin(const diagram *tiling, bt_idx i, int n, double *v, double *r, bt_idx bin, double sx, double sy)
{
    double out[2 * WORK];
    const double px = tiling->p[2 * i], py = tiling->p[2 * i + 1], w = tiling->w[i];
    for (bt_idx k = tiling->first[bin]; k < tiling->first[bin + 1]; k++) {
        const double dx = tiling->member[k].x + sx - px, dy = tiling->member[k].y + sy - py, wj = tiling->member[k].w,
                     d2 = dx * dx + dy * dy, rhs = 0.5 * (d2 + w - wj);
        if (rhs > 0 && rhs * rhs > SURE * d2 * *r * *r) continue; // most end here, without a root
        const bt_idx j = tiling->member[k].i;
        if (j == i || rhs >= sqrt(d2) * *r) continue;
        if (d2 == 0) { // coincident seeds: the heavier one, then the lower index, gets the cell
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
static int power_cell(const diagram *tiling, bt_idx i, double *v)
{
    const bt_region *region = tiling->region;
    double px = tiling->p[2 * i], py = tiling->p[2 * i + 1], lx = region->x1 - region->x0, ly = region->y1 - region->y0;
    double x0 = region->periodic_x ? -lx / 2 : region->x0 - px, x1 = region->periodic_x ? lx / 2 : region->x1 - px;
    double y0 = region->periodic_y ? -ly / 2 : region->y0 - py, y1 = region->periodic_y ? ly / 2 : region->y1 - py;
    memcpy(v, (double[8]){x0, y0, x1, y0, x1, y1, x0, y1}, 8 * sizeof *v);
    int n = 4;
    double r = sqrt(reach2(n, v)), delta = tiling->w_max - tiling->w[i];
    bt_idx home = bin_of(tiling, px, py);
    int hx = home % tiling->nx, hy = home / tiling->nx;
    for (int k = 0; n >= 3; k++) {
        for (int jy = hy - k; jy <= hy + k && n >= 3; jy++) {
            if (!region->periodic_y && (jy < 0 || jy >= tiling->ny)) continue;
            int wy = jy >= 0 ? jy / tiling->ny : -((tiling->ny - 1 - jy) / tiling->ny), by = jy - wy * tiling->ny;
            int step = jy == hy - k || jy == hy + k || k == 0 ? 1 : 2 * k;
            for (int jx = hx - k; jx <= hx + k && n >= 3; jx += step) {
                if (!region->periodic_x && (jx < 0 || jx >= tiling->nx)) continue;
                int wx = jx >= 0 ? jx / tiling->nx : -((tiling->nx - 1 - jx) / tiling->nx), bx = jx - wx * tiling->nx;
                n = cut_by_bin(tiling, i, n, v, &r, by * tiling->nx + bx, wx * lx, wy * ly);
            }
        }
        // Distance from the seed to the nearest bin not yet seen; sides beyond a wall have none.
        double d = INFINITY;
        if (region->periodic_x || hx - k > 0) d = bt_min(d, px - (region->x0 + (hx - k) * tiling->bx));
        if (region->periodic_x || hx + k < tiling->nx - 1) d = bt_min(d, region->x0 + (hx + k + 1) * tiling->bx - px);
        if (region->periodic_y || hy - k > 0) d = bt_min(d, py - (region->y0 + (hy - k) * tiling->by));
        if (region->periodic_y || hy + k < tiling->ny - 1) d = bt_min(d, region->y0 + (hy + k + 1) * tiling->by - py);
        if (d == INFINITY || (d > 0 && d * d - delta >= 2 * d * r)) break;
    }
    return n;
}

// The cell with walls and obstacles taken out, in domain coordinates.
static int ice_cell(const diagram *tiling, bt_idx i, double *v)
{
    int n = power_cell(tiling, i, v);
    for (int k = 0; k < n; k++) {
        v[2 * k] += tiling->p[2 * i];
        v[2 * k + 1] += tiling->p[2 * i + 1];
    }
    return n >= 3 ? bt_tessellation_clear(tiling->region, n, v, false) : 0;
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

// Walk over the bins of the square of half side r about (x, y); (sx, sy) is the periodic shift of the bin.
typedef struct bin_walk {
    const bt_region *region;
    const discs *dd;
    int ix0, ix1, iy1, ix, iy;
    size_t bin;
    double sx, sy;
} bin_walk;

static bin_walk walk_bins(const bt_region *region, const discs *dd, double x, double y, double r)
{
    bin_walk walk = {.region = region, .dd = dd};
    walk.ix0 = (int)floor((x - r - region->x0) / dd->bx), walk.ix1 = (int)floor((x + r - region->x0) / dd->bx);
    walk.iy = (int)floor((y - r - region->y0) / dd->by), walk.iy1 = (int)floor((y + r - region->y0) / dd->by);
    walk.ix = walk.ix0 - 1;
    return walk;
}

static bool next_bin(bin_walk *walk)
{
    for (;;) {
        if (++walk->ix > walk->ix1) {
            walk->ix = walk->ix0;
            walk->iy++;
        }
        if (walk->iy > walk->iy1) return false;
        // periods away from the region
        int tx = (int)floor((double)walk->ix / walk->dd->nx), ty = (int)floor((double)walk->iy / walk->dd->ny);
        if ((tx && !walk->region->periodic_x) || (ty && !walk->region->periodic_y)) continue;
        walk->bin = (size_t)(walk->iy - ty * walk->dd->ny) * (size_t)walk->dd->nx +
                    (size_t)(walk->ix - tx * walk->dd->nx);
        walk->sx = tx * (walk->region->x1 - walk->region->x0);
        walk->sy = ty * (walk->region->y1 - walk->region->y0);
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
        const bt_obstacle *obstacle = &region->obstacles[k];
        if (bt_hypot(x - obstacle->x, y - obstacle->y) > obstacle->radius + r) continue;
        double out = -INFINITY; // lower bound of the distance to the obstacle
        for (int e = 0; e < obstacle->n; e++) {
            const double *a = obstacle->v + 2 * e, *b = obstacle->v + 2 * ((e + 1) % obstacle->n);
            double ex = b[0] - a[0], ey = b[1] - a[1];
            out = bt_max(out, (ey * (x - a[0]) - ex * (y - a[1])) / bt_hypot(ex, ey));
        }
        worst = bt_max(worst, 1 - out / (SPACING * r));
    }
    for (bin_walk walk = walk_bins(region, dd, x, y, SPACING * r); next_bin(&walk);)
        for (int32_t k = dd->head[walk.bin]; k >= 0; k = dd->node[k].next) {
            bt_idx j = dd->node[k].i;
            double d = bt_hypot(p[2 * j] + walk.sx - x, p[2 * j + 1] + walk.sy - y);
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
static void place_seeds(const bt_region *region, bt_idx n, const double *radius, int64_t seed, double *p)
{
    double lx = region->x1 - region->x0, ly = region->y1 - region->y0, mean = 0;
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
            double x = region->x0 + lx * bt_rng_uniform(&rng), z = region->y0 + ly * bt_rng_uniform(&rng);
            double worst = crowding(region, &dd, p, radius, x, z, radius[i]);
            if (worst < least) {
                least = worst;
                p[2 * i] = x;
                p[2 * i + 1] = z;
            }
        }
        for (bin_walk walk = walk_bins(region, &dd, p[2 * i], p[2 * i + 1], SPACING * radius[i]); next_bin(&walk);) {
            BT_MAKE_ROOM(dd.node, dd.n, dd.cap, 1024);
            dd.node[dd.n].i = i;
            dd.node[dd.n].next = dd.head[walk.bin];
            dd.head[walk.bin] = dd.n++;
        }
    }
    free(order);
    free(dd.head);
    free(dd.node);
}

// ---- areas ----

bt_tessellation bt_tessellation_tessellate(const bt_region *region, bt_idx n, const double *target, int64_t seed)
{
    bt_tessellation cells = create(n);
    double lx = region->x1 - region->x0, ly = region->y1 - region->y0, wanted = 0;
    for (bt_idx i = 0; i < n; i++) wanted += target[i];
    double share = region->ice_area / wanted; // cells fill the region
    double *radius = bt_alloc((size_t)n, sizeof *radius);
    for (bt_idx i = 0; i < n; i++) {
        cells.target[i] = target[i];
        radius[i] = sqrt(target[i] * share / BT_PI);
    }

    diagram tiling = {.region = region, .n = n};
    tiling.p = bt_alloc(2 * (size_t)n, sizeof *tiling.p);
    tiling.w = bt_alloc((size_t)n, sizeof *tiling.w);
    place_seeds(region, n, radius, seed, tiling.p);
    for (bt_idx i = 0; i < n; i++) tiling.w[i] = radius[i] * radius[i];
    double bin = sqrt(2 * lx * ly / n); // two seeds a bin
    tiling.nx = (int)bt_max(1, floor(lx / bin));
    tiling.ny = (int)bt_max(1, floor(ly / bin));
    tiling.bx = lx / tiling.nx;
    tiling.by = ly / tiling.ny;
    tiling.first = bt_alloc((size_t)tiling.nx * (size_t)tiling.ny + 1, sizeof *tiling.first);
    tiling.member = bt_alloc((size_t)n, sizeof *tiling.member);

    double *area = bt_alloc((size_t)n, sizeof *area), *next = bt_alloc(2 * (size_t)n, sizeof *next);
    for (int round = 0; round < ROUNDS; round++) {
        sort_into_bins(&tiling);
#pragma omp parallel if (BT_MANY(n, 2000))
        {
            BT_PLAIN_NUMBERS;
#pragma omp for schedule(dynamic, 256)
            for (bt_idx i = 0; i < n; i++) {
                double v[2 * 2 * WORK];
                int m = ice_cell(&tiling, i, v);
                bt_moments mo = m >= 3 ? bt_shape_centroid(m, v)
                                       : (bt_moments){.cx = tiling.p[2 * i], .cy = tiling.p[2 * i + 1]};
                area[i] = mo.area;
                next[2 * i] = mo.cx;
                next[2 * i + 1] = mo.cy;
            }
        }
        double sum = 0;
        for (bt_idx i = 0; i < n; i++) sum += area[i];
        for (bt_idx i = 0; i < n; i++) {
            tiling.w[i] += STEP / BT_PI * (target[i] * sum / wanted - area[i]);
            if (round >= LLOYD) continue;
            tiling.p[2 * i] = next[2 * i];
            tiling.p[2 * i + 1] = next[2 * i + 1];
            bt_region_wrap(region, &tiling.p[2 * i], &tiling.p[2 * i + 1]);
        }
    }
    sort_into_bins(&tiling);
#pragma omp parallel if (BT_MANY(n, 2000))
    {
        BT_PLAIN_NUMBERS;
#pragma omp for schedule(dynamic, 256)
        for (bt_idx i = 0; i < n; i++) {
            double v[2 * 2 * WORK];
            int m = ice_cell(&tiling, i, v);
            if (m < 3) continue;
            double full = bt_shape_centroid(m, v).area;
            m = bt_tessellation_clean(m, v, SHORT_EDGE * 2 * sqrt(full / BT_PI), BT_TESSELLATION_VERTICES);
            bt_moments mo = bt_shape_area_moments(m, v);
            if (mo.inradius < SLIVER * sqrt(mo.area / BT_PI) || mo.area < 0.1 * target[i] * share) continue;
            cells.nv[i] = m;
            memcpy(cells.v[i], v, 2 * (size_t)m * sizeof *v);
        }
    }
    free(radius);
    free(area);
    free(next);
    free(tiling.p);
    free(tiling.w);
    free(tiling.first);
    free(tiling.member);
    return cells;
}
