// SPDX-License-Identifier: MIT
// Rectangular cells as sawn in an ice basin: long strips along x, cross-cut at random lengths.
//
// n floes with cell areas A_i that share a strip of length L make it b = Σ A_i / L wide and are A_i / b long. Their
// mean aspect L/(n b) falls as n grows, and the strip is closed when it has fallen to the one asked for. Every cell has
// its target area, so strips fill the region exactly. Floes are assigned to strips by size with some noise: for a
// narrow size law that is a random order, for a wide one it keeps large floes out of narrow strips, where they would be
// needles. Then strips are shuffled, and the floes within each. In a periodic direction a strip starts at a random
// place.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "field/field_make.h"
#include "base/elementary.h"
#include "base/inside.h"
#include "base/rng.h"

static const double DEAL_NOISE = 0.3; // standard deviation of ln d in the order in which sizes are assigned

// Replace a rectangular cell by the largest rectangle in it with the proportions nearest to `aspect` that its floe can
// have: a floe of area a is √(a aspect) long, unless the cell is shorter, or narrower than a over that length.
static void shape_piece(double *v, double area, double aspect)
{
    const bt_box box = bt_box_of(4, v);
    const double x0 = box.low[0], x1 = box.high[0], y0 = box.low[1], y1 = box.high[1];
    bool along_x = x1 - x0 >= y1 - y0; // the long side along the cell's long side
    double l = along_x ? x1 - x0 : y1 - y0, w = along_x ? y1 - y0 : x1 - x0;
    double a = bt_min(1.03 * area, l * w); // some room, for the common factor that makes up for floes that do not fit
    double length = bt_min(bt_max(sqrt(a * aspect), a / w), l), width = a / length;
    double s = bt_min(l / length, w / width) / 2, cx = (x0 + x1) / 2, cy = (y0 + y1) / 2;
    double hx = s * (along_x ? length : width), hy = s * (along_x ? width : length);
    memcpy(v, (double[8]){cx - hx, cy - hy, cx + hx, cy - hy, cx + hx, cy + hy, cx - hx, cy + hy}, 8 * sizeof *v);
}

static void add_cell(bt_tessellation *cells, const bt_region *region, double x0, double x1, double y0, double y1,
                     double target, double aspect, int effort, int halved)
{
    double v[2 * 8 * BT_TESSELLATION_VERTICES];
    memcpy(v, (double[8]){x0, y0, x1, y0, x1, y1, x0, y1}, 8 * sizeof *v);
    int n = bt_tessellation_clear(region, 4, v, effort == 0);
    if (n >= 3) n = bt_tessellation_clean(n, v, 0, BT_TESSELLATION_VERTICES);
    double whole = (x1 - x0) * (y1 - y0), left = n >= 3 ? bt_shape_centroid(n, v).area : 0;
    // Halves leave less open water beside an obstacle.
    if (left < (effort < 2 ? 0.65 : 0.85) * whole && halved < (effort < 2 ? 2 : 4)) {
        double cx = (x0 + x1) / 2, cy = (y0 + y1) / 2;
        bool across = x1 - x0 >= y1 - y0;
        add_cell(cells, region, x0, across ? cx : x1, y0, across ? y1 : cy, target / 2, aspect, effort, halved + 1);
        add_cell(cells, region, across ? cx : x0, x1, across ? y0 : cy, y1, target / 2, aspect, effort, halved + 1);
        return;
    }
    if (n < 3) return;
    // Drop what an obstacle leaves of a piece if it is too small or too narrow.
    bt_moments moments = bt_shape_area_moments(n, v);
    if (moments.area < 0.25 * whole || moments.inradius < 0.2 * bt_min(x1 - x0, y1 - y0) / 2) return;
    if ((cells->n & (cells->n - 1)) == 0) { // full at powers of two
        size_t cap = cells->n ? 2 * (size_t)cells->n : 1;
        cells->nv = bt_realloc(cells->nv, cap, sizeof *cells->nv);
        cells->v = bt_realloc(cells->v, cap, sizeof *cells->v);
        cells->target = bt_realloc(cells->target, cap, sizeof *cells->target);
    }
    double extent = bt_shape_width(n, v, 0, 1) * bt_shape_width(n, v, 1, 0);
    if (moments.area > (1 - 1e-9) * extent) shape_piece(v, target, aspect), n = 4;
    cells->nv[cells->n] = n;
    memcpy(cells->v[cells->n], v, 2 * (size_t)n * sizeof *v);
    cells->target[cells->n] = bt_min(target, target * moments.area / whole);
    cells->n++;
}

typedef struct piece {
    double key, target;
    int64_t id;
} piece;

BT_ASCENDING_BY(by_key, piece, key, id)

// Strip k holds pieces [first[k], first[k+1]). share: cell area per target area, over lx. Returns the number of strips;
// *last: width of the last strip over the width it should have.
static bt_idx fill_strips(bt_idx n, const piece *p, double share, double aspect, double lx, bt_idx *first, double *last)
{
    bt_idx n_strips = 0;
    double width = 0;
    *last = 1;
    for (bt_idx i = 0; i < n; i++) {
        width += p[i].target * share;
        bt_idx m = i + 1 - first[n_strips];
        if (m * aspect * width < lx && i + 1 < n) continue;
        // A last strip less than half as wide as it should be joins the previous one.
        double part = sqrt(m * aspect * width / lx);
        if (part >= 0.5 || n_strips == 0) {
            n_strips++;
            if (i + 1 == n) *last = bt_min(part, 1);
        } else {
            *last = 1 + part;
        }
        first[n_strips] = i + 1;
        width = 0;
    }
    return n_strips;
}

bt_tessellation bt_tessellation_saw(const bt_region *region, bt_idx n, const double *target, double aspect,
                                    int64_t seed, int effort)
{
    bt_tessellation cells = {0};
    double lx = region->x1 - region->x0, ly = region->y1 - region->y0, wanted = 0;
    piece *p = bt_alloc((size_t)n, sizeof *p), *strip = bt_alloc((size_t)n, sizeof *strip);
    for (bt_idx i = 0; i < n; i++) {
        bt_rng rng = bt_rng_start(seed, BT_RNG_CUT, i);
        p[i] = (piece){bt_log(target[i]) / 2 + DEAL_NOISE * bt_rng_normal(&rng), target[i], i};
        wanted += target[i];
    }
    qsort(p, (size_t)n, sizeof *p, by_key);
    double share = lx * ly / wanted;

    // Of thresholds near the aspect asked for, choose the one whose last strip comes out fullest.
    bt_idx *first = bt_alloc((size_t)n + 1, sizeof *first);
    double best = INFINITY, chosen = aspect;
    for (int k = -20; k <= 20; k++) {
        double trial = aspect * bt_exp(0.01 * k), last;
        fill_strips(n, p, share / lx, trial, lx, first, &last);
        double cost = fabs(0.01 * k) + fabs(bt_log(last));
        if (cost < best) best = cost, chosen = trial;
    }
    double last;
    bt_idx n_strips = fill_strips(n, p, share / lx, chosen, lx, first, &last);
    for (bt_idx k = 0; k < n_strips; k++) {
        bt_rng rng = bt_rng_start(seed, BT_RNG_CUT, (int64_t)n + k);
        strip[k] = (piece){bt_rng_uniform(&rng), 0, k};
    }
    qsort(strip, (size_t)n_strips, sizeof *strip, by_key);

    double y0 = region->y0;
    for (bt_idx s = 0; s < n_strips; s++) {
        bt_idx k = (bt_idx)strip[s].id, from = first[k], to = first[k + 1];
        double sum = 0;
        for (bt_idx i = from; i < to; i++) {
            bt_rng rng = bt_rng_start(seed, BT_RNG_CUT, 2 * (int64_t)n + p[i].id);
            p[i].key = bt_rng_uniform(&rng);
            sum += p[i].target;
        }
        qsort(p + from, (size_t)(to - from), sizeof *p, by_key);
        double width = sum * share / lx, y1 = s + 1 < n_strips ? y0 + width : region->y1;
        bt_rng rng = bt_rng_start(seed, BT_RNG_CUT, 3 * (int64_t)n + k);
        double x = region->x0 + (region->periodic_x ? lx * bt_rng_uniform(&rng) : 0);
        for (bt_idx i = from; i < to; i++) {
            double x1 = i + 1 < to || region->periodic_x ? x + p[i].target / sum * lx : region->x1;
            // A piece whose middle is beyond a periodic edge is moved back whole.
            double shift = region->periodic_x && (x + x1) / 2 >= region->x1 ? -lx : 0;
            add_cell(&cells, region, x + shift, x1 + shift, y0, y1, p[i].target, aspect, effort, 0);
            x = x1;
        }
        y0 = y1;
    }
    free(p);
    free(strip);
    free(first);
    return cells;
}
