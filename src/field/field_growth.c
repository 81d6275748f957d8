// SPDX-License-Identifier: MIT
// How far floes are from touching: separating axes, pairs from a grid, room to grow. Independent of the contact code,
// so that tests can use it to check that code.
//
// Two convex polygons a, b, scaled by t about their centroids, with D from centroid to centroid: they are apart if an
// edge normal n of either has n·D > t (h_a(n) + h_b(−n)), h the support function. So they touch at
//     t_ab = max over n of  n·D / (h_a(n) + h_b(−n)).
// A convex body that holds its centroid grows with t, so any factors t_a, t_b <= t_ab leave them apart, and
// room_a = min over b of t_ab can be used by all floes at the same time.
#include <math.h>
#include <stdlib.h>

#include "field/field_make.h"
#include "base/elementary.h"

double *bt_field_outlines(const bt_field *field)
{
    double *out = bt_alloc(2 * (size_t)field->offsets[field->n], sizeof *out);
    for (bt_idx i = 0; i < field->n; i++) {
        double c = bt_cos(field->pose[3 * i + 2]), s = bt_sin(field->pose[3 * i + 2]);
        for (int64_t k = field->offsets[i]; k < field->offsets[i + 1]; k++) {
            out[2 * k] = c * field->vertices[2 * k] - s * field->vertices[2 * k + 1];
            out[2 * k + 1] = s * field->vertices[2 * k] + c * field->vertices[2 * k + 1];
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

static entry make_entry(const bt_field *field, const double *outline, bt_idx i, double limit)
{
    entry floe = {.x = field->pose[3 * i], .y = field->pose[3 * i + 1], .x0 = 0, .x1 = 0, .y0 = 0, .y1 = 0, .i = i};
    for (int64_t k = field->offsets[i]; k < field->offsets[i + 1]; k++) {
        floe.x0 = bt_min(floe.x0, outline[2 * k]), floe.x1 = bt_max(floe.x1, outline[2 * k]);
        floe.y0 = bt_min(floe.y0, outline[2 * k + 1]), floe.y1 = bt_max(floe.y1, outline[2 * k + 1]);
    }
    floe.x0 = floe.x + limit * floe.x0, floe.x1 = floe.x + limit * floe.x1;
    floe.y0 = floe.y + limit * floe.y0, floe.y1 = floe.y + limit * floe.y1;
    return floe;
}

void bt_field_visit_pairs(const bt_region *region, const bt_field *field, const double *outline, double limit,
                          bt_pair_visit *visit, void *context)
{
    if (field->n < 1) return;
    double lx = region->x1 - region->x0, ly = region->y1 - region->y0;
    size_t n = 0, cap = (size_t)field->n + 64;
    entry *all = bt_alloc(cap, sizeof *all);
    double extent = 0, over = 0; // mean and largest side of the boxes
    for (bt_idx i = 0; i < field->n; i++) {
        entry floe = make_entry(field, outline, i, limit);
        double x = floe.x, z = floe.y; // a floe read from a file may lie outside a periodic domain
        bt_region_wrap(region, &x, &z);
        floe.x0 += x - floe.x, floe.x1 += x - floe.x, floe.x = x;
        floe.y0 += z - floe.y, floe.y1 += z - floe.y, floe.y = z;
        extent += (floe.x1 - floe.x0 + floe.y1 - floe.y0) / 2 / field->n;
        over = bt_max(over, bt_max(floe.x1 - floe.x0, floe.y1 - floe.y0));
        all[n++] = floe;
    }
    // Images of floes that reach over a periodic edge follow the floes themselves.
    for (bt_idx i = 0; i < field->n; i++)
        for (int ix = -1; ix <= 1; ix++)
            for (int iy = -1; iy <= 1; iy++) {
                if ((ix && !region->periodic_x) || (iy && !region->periodic_y) || (!ix && !iy)) continue;
                entry floe = all[i];
                floe.x += ix * lx, floe.x0 += ix * lx, floe.x1 += ix * lx;
                floe.y += iy * ly, floe.y0 += iy * ly, floe.y1 += iy * ly;
                // Floes themselves reach beyond the region by up to their extent, and may meet an image there.
                if ((ix && (floe.x1 < region->x0 - over || floe.x0 > region->x1 + over)) ||
                    (iy && (floe.y1 < region->y0 - over || floe.y0 > region->y1 + over)))
                    continue;
                if (n == cap) all = bt_realloc(all, cap += cap / 2, sizeof *all);
                all[n++] = floe;
            }

    // Every entry is listed in all bins that its box covers: floes of very different size need no common bin size.
    // A pair that shares several bins is visited in the one that holds the low corner of the boxes' overlap.
    double bin = bt_max(extent, sqrt(lx * ly / (4.0 * field->n)));
    grid g = {.x0 = region->x0, .y0 = region->y0, .nx = (int)bt_max(1, bt_min(floor(lx / bin), 30000)),
              .ny = (int)bt_max(1, bt_min(floor(ly / bin), 30000))};
    g.bx = lx / g.nx;
    g.by = ly / g.ny;
    size_t bins = (size_t)g.nx * (size_t)g.ny;
    int64_t *first = bt_alloc(bins + 1, sizeof *first);
    uint32_t *member = NULL;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t k = n; k-- > 0;) {
            const entry *floe = &all[k];
            int ix1 = clamp_bin((floe->x1 - g.x0) / g.bx, g.nx), iy1 = clamp_bin((floe->y1 - g.y0) / g.by, g.ny);
            for (int iy = clamp_bin((floe->y0 - g.y0) / g.by, g.ny); iy <= iy1; iy++)
                for (int ix = clamp_bin((floe->x0 - g.x0) / g.bx, g.nx); ix <= ix1; ix++) {
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
                // ascending, so if c is an image, d is one, too
                const entry *c = &all[member[p]], *d = &all[member[q]];
                if (member[p] >= (uint32_t)field->n) continue;
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
    clearance_search *search = context;
    double reach = search->limit * (search->radius[i] + search->radius[j]);
    if (dx * dx + dy * dy >= reach * reach) return;
    const int64_t *o = search->f->offsets;
    bt_apart apart = bt_apart_of((int)(o[i + 1] - o[i]), search->outline + 2 * o[i], (int)(o[j + 1] - o[j]),
                                 search->outline + 2 * o[j], dx, dy);
    search->clearance[i] = bt_min(search->clearance[i], apart.both);
    search->clearance[j] = bt_min(search->clearance[j], apart.both);
}

static double clearance_within(const bt_region *region, double x, double z, int n, const double *v, double clearance)
{
    for (int k = 0; k < n; k++) {
        double px = v[2 * k], pz = v[2 * k + 1];
        if (!region->periodic_x && px != 0)
            clearance = bt_min(clearance, ((px > 0 ? region->x1 : region->x0) - x) / px);
        if (!region->periodic_y && pz != 0)
            clearance = bt_min(clearance, ((pz > 0 ? region->y1 : region->y0) - z) / pz);
    }
    return clearance;
}

void bt_field_growth(const bt_region *region, const bt_field *field, double limit, double *clearance)
{
    double *outline = bt_field_outlines(field), *radius = bt_alloc((size_t)field->n, sizeof *radius);
    for (bt_idx i = 0; i < field->n; i++) {
        const double *v = outline + 2 * field->offsets[i];
        int n = (int)(field->offsets[i + 1] - field->offsets[i]);
        for (int k = 0; k < n; k++) radius[i] = bt_max(radius[i], bt_hypot(v[2 * k], v[2 * k + 1]));
        double x = field->pose[3 * i], z = field->pose[3 * i + 1];
        clearance[i] = clearance_within(region, x, z, n, v, limit);
        for (int o = 0; o < region->n_obstacles; o++) {
            const bt_obstacle *obstacle = &region->obstacles[o];
            double dx = obstacle->x - x, dy = obstacle->y - z, reach = limit * radius[i] + obstacle->radius;
            if (dx * dx + dy * dy >= reach * reach) continue;
            clearance[i] = bt_min(clearance[i], bt_region_apart(obstacle, n, v, dx, dy).first);
        }
    }
    clearance_search search = {field, outline, radius, limit, clearance};
    bt_field_visit_pairs(region, field, outline, limit, room_of_pair, &search);
    free(outline);
    free(radius);
}
