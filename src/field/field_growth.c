// SPDX-License-Identifier: MIT
// How far floes are from touching: separating axes, pairs from a grid, room to grow. Independent of the contact code,
// so that it can check it.
//
// Two convex polygons a, b, scaled by t about their centroids, with D from centroid to centroid: they are apart if an
// edge normal n of either has n·D > t (h_a(n) + h_b(−n)), h the support function. So they touch at
//     t_ab = max over n of  n·D / (h_a(n) + h_b(−n)).
// A convex body that holds its centroid grows with t, so any factors t_a, t_b <= t_ab leave them apart, and
// room_a = min over b of t_ab can be used by all floes at the same time.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "field/field_make.h"
#include "base/elementary.h"

double *bt_field_outlines(const bt_field *f)
{
    double *out = bt_alloc(2 * (size_t)f->offsets[f->n], sizeof *out);
    for (bt_idx i = 0; i < f->n; i++) {
        double c = bt_cos(f->pose[3 * i + 2]), s = bt_sin(f->pose[3 * i + 2]);
        for (int64_t k = f->offsets[i]; k < f->offsets[i + 1]; k++) {
            out[2 * k] = c * f->vertices[2 * k] - s * f->vertices[2 * k + 1];
            out[2 * k + 1] = s * f->vertices[2 * k] + c * f->vertices[2 * k + 1];
        }
    }
    return out;
}

// A floe or one of its periodic images with its bounding box.
typedef struct entry {
    double x, y, x0, x1, y0, y1;
    bt_idx i;
} entry;

typedef struct grid { double x0, y0, bx, by; int nx, ny; } grid;

static int clamp_bin(double u, int n) { return u >= n ? n - 1 : u > 0 ? (int)u : 0; } // also for floes far outside

static entry make_entry(const bt_field *f, const double *outline, bt_idx i, double limit)
{
    entry e = {.x = f->pose[3 * i], .y = f->pose[3 * i + 1], .x0 = 0, .x1 = 0, .y0 = 0, .y1 = 0, .i = i};
    for (int64_t k = f->offsets[i]; k < f->offsets[i + 1]; k++) {
        e.x0 = bt_min(e.x0, outline[2 * k]), e.x1 = bt_max(e.x1, outline[2 * k]);
        e.y0 = bt_min(e.y0, outline[2 * k + 1]), e.y1 = bt_max(e.y1, outline[2 * k + 1]);
    }
    e.x0 = e.x + limit * e.x0, e.x1 = e.x + limit * e.x1;
    e.y0 = e.y + limit * e.y0, e.y1 = e.y + limit * e.y1;
    return e;
}

void bt_field_visit_pairs(const bt_region *y, const bt_field *f, const double *outline, double limit,
                          bt_pair_visit *visit, void *context)
{
    if (f->n < 1) return;
    double lx = y->x1 - y->x0, ly = y->y1 - y->y0;
    size_t n = 0, cap = (size_t)f->n + 64;
    entry *all = bt_alloc(cap, sizeof *all);
    double extent = 0, over = 0; // mean and largest side of the boxes
    for (bt_idx i = 0; i < f->n; i++) {
        entry e = make_entry(f, outline, i, limit);
        double x = e.x, z = e.y; // a floe read from a file may lie outside a periodic domain
        bt_region_wrap(y, &x, &z);
        e.x0 += x - e.x, e.x1 += x - e.x, e.x = x;
        e.y0 += z - e.y, e.y1 += z - e.y, e.y = z;
        extent += (e.x1 - e.x0 + e.y1 - e.y0) / 2 / f->n;
        over = bt_max(over, bt_max(e.x1 - e.x0, e.y1 - e.y0));
        all[n++] = e;
    }
    // Images of floes that reach over a periodic edge follow the floes themselves.
    for (bt_idx i = 0; i < f->n; i++)
        for (int ix = -1; ix <= 1; ix++)
            for (int iy = -1; iy <= 1; iy++) {
                if ((ix && !y->periodic_x) || (iy && !y->periodic_y) || (!ix && !iy)) continue;
                entry e = all[i];
                e.x += ix * lx, e.x0 += ix * lx, e.x1 += ix * lx;
                e.y += iy * ly, e.y0 += iy * ly, e.y1 += iy * ly;
                // Floes themselves reach beyond the region by up to their extent, and may meet an image there.
                if ((ix && (e.x1 < y->x0 - over || e.x0 > y->x1 + over)) ||
                    (iy && (e.y1 < y->y0 - over || e.y0 > y->y1 + over)))
                    continue;
                if (n == cap) all = bt_realloc(all, cap += cap / 2, sizeof *all);
                all[n++] = e;
            }

    // Every entry is listed in all bins that its box covers: floes of very different size need no common bin size.
    // A pair that shares several bins is visited in the one that holds the low corner of the boxes' overlap.
    double bin = bt_max(extent, sqrt(lx * ly / (4.0 * f->n)));
    grid g = {.x0 = y->x0, .y0 = y->y0, .nx = (int)bt_max(1, bt_min(floor(lx / bin), 30000)),
              .ny = (int)bt_max(1, bt_min(floor(ly / bin), 30000))};
    g.bx = lx / g.nx;
    g.by = ly / g.ny;
    size_t bins = (size_t)g.nx * (size_t)g.ny;
    int64_t *first = bt_alloc(bins + 1, sizeof *first);
    uint32_t *member = NULL;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t k = n; k-- > 0;) {
            const entry *e = &all[k];
            int ix1 = clamp_bin((e->x1 - g.x0) / g.bx, g.nx), iy1 = clamp_bin((e->y1 - g.y0) / g.by, g.ny);
            for (int iy = clamp_bin((e->y0 - g.y0) / g.by, g.ny); iy <= iy1; iy++)
                for (int ix = clamp_bin((e->x0 - g.x0) / g.bx, g.nx); ix <= ix1; ix++) {
                    size_t b = (size_t)iy * (size_t)g.nx + (size_t)ix;
                    if (pass == 0) first[b]++;
                    else member[--first[b]] = (uint32_t)k;
                }
        }
        if (pass == 1) break;
        for (size_t b = 1; b < bins; b++) first[b] += first[b - 1];
        first[bins] = first[bins - 1];
        member = bt_alloc((size_t)first[bins], sizeof *member);
    }
    for (size_t b = 0; b < bins; b++)
        for (int64_t p = first[b]; p < first[b + 1]; p++)
            for (int64_t q = p + 1; q < first[b + 1]; q++) {
                // ascending, so c is a floe itself or both are images
                const entry *c = &all[member[p]], *d = &all[member[q]];
                if (member[p] >= (uint32_t)f->n) continue;
                double ox = bt_max(c->x0, d->x0), oy = bt_max(c->y0, d->y0);
                if (ox > bt_min(c->x1, d->x1) || oy > bt_min(c->y1, d->y1)) continue;
                size_t at = (size_t)clamp_bin((oy - g.y0) / g.by, g.ny) * (size_t)g.nx +
                            (size_t)clamp_bin((ox - g.x0) / g.bx, g.nx);
                if (at == b) visit(context, c->i, d->i, d->x - c->x, d->y - c->y);
            }
    free(first);
    free(member);
    free(all);
}

typedef struct clearance_search {
    const bt_field *f;
    const double *outline, *radius;
    double limit, *clearance;
} clearance_search;

static void room_of_pair(void *context, bt_idx i, bt_idx j, double dx, double dy)
{
    clearance_search *s = context;
    double reach = s->limit * (s->radius[i] + s->radius[j]);
    if (dx * dx + dy * dy >= reach * reach) return;
    const int64_t *o = s->f->offsets;
    bt_apart a = bt_apart_of((int)(o[i + 1] - o[i]), s->outline + 2 * o[i], (int)(o[j + 1] - o[j]),
                             s->outline + 2 * o[j], dx, dy);
    s->clearance[i] = bt_min(s->clearance[i], a.both);
    s->clearance[j] = bt_min(s->clearance[j], a.both);
}

static double clearance_within(const bt_region *y, double x, double z, int n, const double *v, double clearance)
{
    for (int k = 0; k < n; k++) {
        double px = v[2 * k], pz = v[2 * k + 1];
        if (!y->periodic_x && px != 0) clearance = bt_min(clearance, ((px > 0 ? y->x1 : y->x0) - x) / px);
        if (!y->periodic_y && pz != 0) clearance = bt_min(clearance, ((pz > 0 ? y->y1 : y->y0) - z) / pz);
    }
    return clearance;
}

void bt_field_growth(const bt_region *y, const bt_field *f, double limit, double *clearance)
{
    double *outline = bt_field_outlines(f), *radius = bt_alloc((size_t)f->n, sizeof *radius);
    for (bt_idx i = 0; i < f->n; i++) {
        const double *v = outline + 2 * f->offsets[i];
        int n = (int)(f->offsets[i + 1] - f->offsets[i]);
        for (int k = 0; k < n; k++) radius[i] = bt_max(radius[i], bt_hypot(v[2 * k], v[2 * k + 1]));
        double x = f->pose[3 * i], z = f->pose[3 * i + 1];
        clearance[i] = clearance_within(y, x, z, n, v, limit);
        for (int o = 0; o < y->n_obstacles; o++) {
            const bt_obstacle *b = &y->obstacles[o];
            double dx = b->x - x, dy = b->y - z, reach = limit * radius[i] + b->radius;
            if (dx * dx + dy * dy >= reach * reach) continue;
            double rel[2 * BT_MAX_VERTICES];
            for (int k = 0; k < b->n; k++) rel[2 * k] = b->v[2 * k] - b->x, rel[2 * k + 1] = b->v[2 * k + 1] - b->y;
            clearance[i] = bt_min(clearance[i], bt_apart_of(n, v, b->n, rel, dx, dy).first);
        }
    }
    clearance_search s = {f, outline, radius, limit, clearance};
    bt_field_visit_pairs(y, f, outline, limit, room_of_pair, &s);
    free(outline);
    free(radius);
}
