// SPDX-License-Identifier: MIT
// The store of an ice field: floes as polygons in their own frames, one pose each.
#include "bergtow/comm.h"
#include "bergtow/field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/shape.h"
#include "base/elementary.h"
#include "base/inside.h"
#include "field/field_make.h"

// --- as blocks of memory ---------------------------------------------------------------------------------------------

void bt_field_arrays(const bt_field *field, int64_t n_vertices, bt_field_array out[BT_FIELD_ARRAYS])
{
    const size_t row = (size_t)field->n * sizeof(double);
    const bt_field_array all[] = {{field->offsets, row + sizeof *field->offsets},
                                  {field->vertices, 2 * (size_t)n_vertices * sizeof *field->vertices},
                                  {field->pose, 3 * row}, {field->thickness, row}, {field->area, row}};
    memcpy(out, all, sizeof all);
}

bt_field bt_field_numbers(const bt_field *field)
{
    bt_field numbers = *field;
    numbers.offsets = NULL;
    numbers.vertices = numbers.pose = numbers.thickness = numbers.area = NULL;
    numbers.cap = field->n, numbers.cap_vertices = field->offsets[field->n];
    return numbers;
}

void bt_field_room(bt_field *field, const bt_field *numbers)
{
    bt_field_free(field);
    *field = *numbers;
    field->offsets = bt_alloc((size_t)field->n + 1, sizeof *field->offsets);
    field->vertices = bt_alloc(2 * (size_t)field->cap_vertices, sizeof *field->vertices);
    field->pose = bt_alloc(3 * (size_t)field->n, sizeof *field->pose);
    field->thickness = bt_alloc((size_t)field->n, sizeof *field->thickness);
    field->area = bt_alloc((size_t)field->n, sizeof *field->area);
}

void bt_field_share(const bt_comm *comm, bt_field *field)
{
    if (comm->size == 1) return;
    bt_field numbers = bt_field_numbers(field);
    bt_comm_bcast(comm, &numbers, sizeof numbers);
    if (comm->rank != 0) bt_field_room(field, &numbers);
    bt_field_array p[BT_FIELD_ARRAYS];
    bt_field_arrays(field, numbers.cap_vertices, p);
    for (int k = 0; k < BT_FIELD_ARRAYS; k++) bt_comm_bcast(comm, p[k].at, p[k].bytes);
}

// --- a field ---------------------------------------------------------------------------------------------------------

void bt_field_init(bt_field *field)
{
    *field = (bt_field){0};
    field->offsets = bt_alloc(1, sizeof *field->offsets); // offsets[0] = 0
}

void bt_field_free(bt_field *field)
{
    free(field->offsets);
    free(field->vertices);
    free(field->pose);
    free(field->thickness);
    free(field->area);
    *field = (bt_field){0};
}

bt_field bt_field_like(const bt_field *field)
{
    bt_field like = bt_field_numbers(field);
    like.n = like.cap = 0, like.cap_vertices = 0;
    like.offsets = bt_alloc(1, sizeof *like.offsets); // offsets[0] = 0
    return like;
}

static void reserve(bt_field *field, int64_t floes, int64_t n_vertices)
{
    if (floes > field->cap) {
        size_t cap = (size_t)bt_max((double)floes, 2.0 * field->cap);
        field->offsets = bt_realloc(field->offsets, cap + 1, sizeof *field->offsets);
        field->pose = bt_realloc(field->pose, 3 * cap, sizeof *field->pose);
        field->thickness = bt_realloc(field->thickness, cap, sizeof *field->thickness);
        field->area = bt_realloc(field->area, cap, sizeof *field->area);
        field->cap = (bt_idx)cap;
    }
    if (n_vertices > field->cap_vertices) {
        size_t cap = (size_t)bt_max((double)n_vertices, 2.0 * (double)field->cap_vertices);
        field->vertices = bt_realloc(field->vertices, 2 * cap, sizeof *field->vertices);
        field->cap_vertices = (int64_t)cap;
    }
}

double bt_field_floe_area(const bt_field *field)
{
    BT_PLAIN_NUMBERS;
    double area = 0;
    for (bt_idx i = 0; i < field->n; i++) area += field->area[i];
    return area;
}

double bt_field_mean_size(const bt_field *field)
{
    BT_PLAIN_NUMBERS;
    double sum = 0;
    for (bt_idx i = 0; i < field->n; i++) sum += sqrt(4 * field->area[i] / BT_PI);
    return field->n ? sum / field->n : NAN;
}

void bt_field_add(bt_field *field, int nv, const double *v, double x, double y, double yaw, double thickness)
{
    BT_PLAIN_NUMBERS;
    bt_idx i = field->n;
    int64_t at = field->offsets[i];
    reserve(field, i + 1, at + nv);
    double *own = field->vertices + 2 * at;
    memcpy(own, v, 2 * (size_t)nv * sizeof *own);
    bt_moments moments = bt_shape_centre(nv, own);
    double c = bt_cos(yaw), s = bt_sin(yaw);
    field->pose[3 * i] = x + c * moments.cx - s * moments.cy;
    field->pose[3 * i + 1] = y + s * moments.cx + c * moments.cy;
    field->pose[3 * i + 2] = yaw;
    field->thickness[i] = thickness;
    field->area[i] = moments.area;
    field->offsets[i + 1] = at + nv;
    field->n++;
}

void bt_field_scale(bt_field *field, bt_idx i, double s)
{
    for (int64_t k = 2 * field->offsets[i]; k < 2 * field->offsets[i + 1]; k++) field->vertices[k] *= s;
    field->area[i] *= s * s;
}

double bt_field_area_at(const bt_field *field, const double *clearance, const bool *held, double lambda)
{
    double sum = 0;
    for (bt_idx i = 0; i < field->n; i++)
        sum += field->area[i] * (held && held[i] ? 1 : bt_min(clearance[i] * clearance[i], lambda));
    return sum;
}

double bt_field_fit(bt_field *field, const double *clearance, const bool *held, double wanted)
{
    double low = 0, high = 1;
    for (bt_idx i = 0; i < field->n; i++) high = bt_max(high, clearance[i] * clearance[i]);
    // the area grows with λ: bisect. 200 halvings end at neighbouring doubles.
    for (int k = 0; k < 200 && low < high; k++) {
        double mid = low + (high - low) / 2;
        if (mid == low || mid == high) break;
        *(bt_field_area_at(field, clearance, held, mid) < wanted ? &low : &high) = mid;
    }
    double sum = 0;
    for (bt_idx i = 0; i < field->n; i++) {
        double s = held && held[i] ? 1 : bt_min(clearance[i], sqrt(high));
        if (s != 1) bt_field_scale(field, i, s);
        sum += field->area[i];
    }
    return sum;
}

void bt_field_append(bt_field *field, const bt_field *from, bt_idx i)
{
    const bt_idx k = field->n;
    const int64_t first = from->offsets[i], n = from->offsets[i + 1] - first, at = field->offsets[k];
    reserve(field, k + 1, at + n);
    memcpy(field->vertices + 2 * at, from->vertices + 2 * first, 2 * (size_t)n * sizeof *field->vertices);
    memcpy(field->pose + 3 * k, from->pose + 3 * i, 3 * sizeof *field->pose);
    field->thickness[k] = from->thickness[i];
    field->area[k] = from->area[i];
    field->offsets[k + 1] = at + n;
    field->n++;
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

BT_ASCENDING_BY(by_code, key, code, i)

void bt_field_sort(bt_field *f, const bt_region *region)
{
    double side = bt_max(region->x1 - region->x0, region->y1 - region->y0);
    key *order = bt_alloc((size_t)f->n, sizeof *order);
    for (bt_idx i = 0; i < f->n; i++) {
        double u = (f->pose[3 * i] - region->x0) / side, w = (f->pose[3 * i + 1] - region->y0) / side;
        uint64_t a = (uint64_t)(bt_min(bt_max(u, 0), 1) * 0xffffffff),
                 b = (uint64_t)(bt_min(bt_max(w, 0), 1) * 0xffffffff);
        order[i] = (key){spread_bits(a) | spread_bits(b) << 1, i};
    }
    qsort(order, (size_t)f->n, sizeof *order, by_code);
    bt_field g = bt_field_like(f);
    reserve(&g, f->n, f->offsets[f->n]);
    // Copy floes unchanged: bt_field_add would centre them again and change last digits.
    for (bt_idx k = 0; k < f->n; k++) bt_field_append(&g, f, order[k].i);
    free(order);
    bt_field_free(f);
    *f = g;
}
