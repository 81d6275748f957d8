// SPDX-License-Identifier: MIT
// Largest overlap in a field, by separating axes and a grid of its own: it shares no code with the contact detection.
#include <math.h>
#include <stdlib.h>

#include "field/field_make.h"
#include "base/elementary.h"

typedef struct depth_search {
    const bt_field *f;
    const double *outline;
    double deepest;
} depth_search;

static void depth_of_pair(void *context, bt_idx i, bt_idx j, double dx, double dy)
{
    depth_search *s = context;
    const int64_t *o = s->f->offsets;
    bt_apart a = bt_apart_of((int)(o[i + 1] - o[i]), s->outline + 2 * o[i], (int)(o[j + 1] - o[j]),
                             s->outline + 2 * o[j], dx, dy);
    s->deepest = bt_max(s->deepest, -a.gap);
}

double bt_field_overlap(const bt_case *c, const bt_field *f)
{
    // The placement region of the whole domain, without clearance; its ice area and so its status do not matter here.
    bt_case whole = *c;
    whole.ice.x_min = c->domain.x0, whole.ice.x_max = c->domain.x0 + c->domain.length;
    whole.ice.y_min = c->domain.y0, whole.ice.y_max = c->domain.y0 + c->domain.width;
    bt_region y;
    bt_errors ignored = {0};
    bt_region_init(&y, &whole, 0, &ignored);
    bt_errors_free(&ignored);

    double *outline = bt_field_outlines(f);
    depth_search s = {f, outline, 0};
    bt_field_visit_pairs(&y, f, outline, 1, depth_of_pair, &s);
    for (bt_idx i = 0; i < f->n; i++) {
        const double *v = outline + 2 * f->offsets[i];
        int n = (int)(f->offsets[i + 1] - f->offsets[i]);
        double x = f->pose[3 * i], z = f->pose[3 * i + 1], radius = 0;
        for (int k = 0; k < n; k++) {
            radius = bt_max(radius, bt_hypot(v[2 * k], v[2 * k + 1]));
            if (c->domain.ends == BT_BOUND_WALL)
                s.deepest = bt_max(s.deepest, bt_max(y.x0 - (x + v[2 * k]), x + v[2 * k] - y.x1));
            if (c->domain.sides == BT_BOUND_WALL)
                s.deepest = bt_max(s.deepest, bt_max(y.y0 - (z + v[2 * k + 1]), z + v[2 * k + 1] - y.y1));
        }
        bt_region_wrap(&y, &x, &z);
        for (int o = 0; o < y.n_obstacles; o++) {
            const bt_obstacle *b = &y.obstacles[o];
            double dx = b->x - x, dy = b->y - z, reach = radius + b->radius, rel[2 * BT_MAX_VERTICES];
            if (dx * dx + dy * dy >= reach * reach) continue;
            for (int k = 0; k < b->n; k++) rel[2 * k] = b->v[2 * k] - b->x, rel[2 * k + 1] = b->v[2 * k + 1] - b->y;
            s.deepest = bt_max(s.deepest, -bt_apart_of(n, v, b->n, rel, dx, dy).gap);
        }
    }
    free(outline);
    bt_region_free(&y);
    return s.deepest;
}
