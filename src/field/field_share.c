// SPDX-License-Identifier: MIT
// The ice field of rank 0 to all ranks.
#include "bergtow/field.h"

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
