// SPDX-License-Identifier: MIT
// The store of an ice field: floes as polygons in their own frames, one pose each.
#include "bergtow/field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/shape.h"
#include "base/elementary.h"
#include "field/field_make.h"

// --- to all ranks ----------------------------------------------------------------------------------------------------

// The ice field of rank 0 to all ranks.

static void array(const bt_comm *c, double **x, int64_t n)
{
    if (c->rank != 0) *x = bt_realloc(*x, (size_t)n, sizeof **x);
    bt_comm_bcast(c, *x, (size_t)n * sizeof **x);
}

void bt_field_share(const bt_comm *c, bt_field *f)
{
    if (c->size == 1) return;
    struct { int64_t n, vertices; double ice_area, concentration; bt_outline_counts outlines; } head = {0};
    if (c->rank == 0) {
        head.n = f->n;
        head.vertices = f->offsets[f->n];
        head.ice_area = f->ice_area;
        head.concentration = f->concentration;
        head.outlines = f->outlines;
    }
    bt_comm_bcast(c, &head, sizeof head);
    if (c->rank != 0) {
        f->n = f->cap = (bt_idx)head.n;
        f->cap_vertices = head.vertices;
        f->ice_area = head.ice_area;
        f->concentration = head.concentration;
        f->outlines = head.outlines;
        f->offsets = bt_realloc(f->offsets, (size_t)head.n + 1, sizeof *f->offsets);
    }
    bt_comm_bcast(c, f->offsets, ((size_t)head.n + 1) * sizeof *f->offsets);
    array(c, &f->vertices, 2 * head.vertices);
    array(c, &f->pose, 3 * head.n);
    array(c, &f->thickness, head.n);
    array(c, &f->area, head.n);
}

// --- a field ---------------------------------------------------------------------------------------------------------

void bt_field_init(bt_field *f)
{
    *f = (bt_field){0};
    f->offsets = bt_alloc(1, sizeof *f->offsets); // the number of vertices of no floes
}

void bt_field_free(bt_field *f)
{
    free(f->offsets);
    free(f->vertices);
    free(f->pose);
    free(f->thickness);
    free(f->area);
    *f = (bt_field){0};
}

static void reserve(bt_field *f, int64_t floes, int64_t n_vertices)
{
    if (floes > f->cap) {
        size_t cap = (size_t)bt_max((double)floes, 2.0 * f->cap);
        f->offsets = bt_realloc(f->offsets, cap + 1, sizeof *f->offsets);
        f->pose = bt_realloc(f->pose, 3 * cap, sizeof *f->pose);
        f->thickness = bt_realloc(f->thickness, cap, sizeof *f->thickness);
        f->area = bt_realloc(f->area, cap, sizeof *f->area);
        f->cap = (bt_idx)cap;
    }
    if (n_vertices > f->cap_vertices) {
        size_t cap = (size_t)bt_max((double)n_vertices, 2.0 * (double)f->cap_vertices);
        f->vertices = bt_realloc(f->vertices, 2 * cap, sizeof *f->vertices);
        f->cap_vertices = (int64_t)cap;
    }
}

double bt_field_floe_area(const bt_field *f)
{
    double area = 0;
    for (bt_idx i = 0; i < f->n; i++) area += f->area[i];
    return area;
}

double bt_field_mean_size(const bt_field *f)
{
    double sum = 0;
    for (bt_idx i = 0; i < f->n; i++) sum += sqrt(4 * f->area[i] / BT_PI);
    return f->n ? sum / f->n : NAN;
}

void bt_field_add(bt_field *f, int nv, const double *v, double x, double y, double yaw, double thickness)
{
    bt_idx i = f->n;
    int64_t at = f->offsets[i];
    reserve(f, i + 1, at + nv);
    double *own = f->vertices + 2 * at;
    memcpy(own, v, 2 * (size_t)nv * sizeof *own);
    bt_moments m = bt_shape_centre(nv, own);
    double c = bt_cos(yaw), s = bt_sin(yaw);
    f->pose[3 * i] = x + c * m.cx - s * m.cy;
    f->pose[3 * i + 1] = y + s * m.cx + c * m.cy;
    f->pose[3 * i + 2] = yaw;
    f->thickness[i] = thickness;
    f->area[i] = m.area;
    f->offsets[i + 1] = at + nv;
    f->n++;
}

void bt_field_scale(bt_field *f, bt_idx i, double s)
{
    for (int64_t k = 2 * f->offsets[i]; k < 2 * f->offsets[i + 1]; k++) f->vertices[k] *= s;
    f->area[i] *= s * s;
}

double bt_field_area_at(const bt_field *f, const double *clearance, const bool *held, double lambda)
{
    double sum = 0;
    for (bt_idx i = 0; i < f->n; i++)
        sum += f->area[i] * (held && held[i] ? 1 : bt_min(clearance[i] * clearance[i], lambda));
    return sum;
}

double bt_field_fit(bt_field *f, const double *clearance, const bool *held, double wanted)
{
    double low = 0, high = 1;
    for (bt_idx i = 0; i < f->n; i++) high = bt_max(high, clearance[i] * clearance[i]);
    // the area grows with λ: bisect. 200 halvings end at neighbouring doubles.
    for (int k = 0; k < 200 && low < high; k++) {
        double mid = low + (high - low) / 2;
        if (mid == low || mid == high) break;
        *(bt_field_area_at(f, clearance, held, mid) < wanted ? &low : &high) = mid;
    }
    double sum = 0;
    for (bt_idx i = 0; i < f->n; i++) {
        double s = held && held[i] ? 1 : bt_min(clearance[i], sqrt(high));
        if (s != 1) bt_field_scale(f, i, s);
        sum += f->area[i];
    }
    return sum;
}

void bt_field_append(bt_field *f, const bt_field *from, bt_idx i)
{
    const bt_idx k = f->n;
    const int64_t first = from->offsets[i], n = from->offsets[i + 1] - first, at = f->offsets[k];
    reserve(f, k + 1, at + n);
    memcpy(f->vertices + 2 * at, from->vertices + 2 * first, 2 * (size_t)n * sizeof *f->vertices);
    memcpy(f->pose + 3 * k, from->pose + 3 * i, 3 * sizeof *f->pose);
    f->thickness[k] = from->thickness[i];
    f->area[k] = from->area[i];
    f->offsets[k + 1] = at + n;
    f->n++;
}

// Spread the low 32 bits of x to the even bits.
static uint64_t spread_bits(uint64_t x)
{
    x = (x | x << 16) & 0x0000ffff0000ffff;
    x = (x | x << 8) & 0x00ff00ff00ff00ff;
    x = (x | x << 4) & 0x0f0f0f0f0f0f0f0f;
    x = (x | x << 2) & 0x3333333333333333;
    return (x | x << 1) & 0x5555555555555555;
}

typedef struct key { uint64_t code; bt_idx i; } key;

static int by_code(const void *a, const void *b)
{
    const key *p = a, *q = b;
    if (p->code != q->code) return p->code < q->code ? -1 : 1;
    return (p->i > q->i) - (p->i < q->i);
}

void bt_field_sort(bt_field *f, const bt_region *y)
{
    double side = bt_max(y->x1 - y->x0, y->y1 - y->y0);
    key *order = bt_alloc((size_t)f->n, sizeof *order);
    for (bt_idx i = 0; i < f->n; i++) {
        double u = (f->pose[3 * i] - y->x0) / side, w = (f->pose[3 * i + 1] - y->y0) / side;
        uint64_t a = (uint64_t)(bt_min(bt_max(u, 0), 1) * 0xffffffff),
                 b = (uint64_t)(bt_min(bt_max(w, 0), 1) * 0xffffffff);
        order[i] = (key){spread_bits(a) | spread_bits(b) << 1, i};
    }
    qsort(order, (size_t)f->n, sizeof *order, by_code);
    bt_field g;
    bt_field_init(&g);
    reserve(&g, f->n, f->offsets[f->n]);
    // Copied as they are: bt_field_add would centre once more and change last digits.
    for (bt_idx k = 0; k < f->n; k++) bt_field_append(&g, f, order[k].i);
    g.ice_area = f->ice_area;
    g.concentration = f->concentration;
    free(order);
    bt_field_free(f);
    *f = g;
}
