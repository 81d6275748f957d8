// SPDX-License-Identifier: MIT
// Where a point lies on the waterline, and sums of load by panel; see loads/panel.h.
#include "loads/panel.h"
#include "base/elementary.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double *vertex(const bt_panels *p, int i)
{
    return p->outline + 2 * (i < p->n_vertices ? i : i - p->n_vertices);
}

/// Length along the waterline of the point nearest to (x, y), m.
static double nearest(const bt_panels *p, double x, double y)
{
    double best = INFINITY, at = 0;
    for (int i = 0; i < p->n_vertices; i++) {
        const double *a = vertex(p, i), *b = vertex(p, i + 1);
        const double ex = b[0] - a[0], ey = b[1] - a[1], length = p->arc[i + 1] - p->arc[i];
        const double t = bt_min(1, bt_max(0, ((x - a[0]) * ex + (y - a[1]) * ey) / (ex * ex + ey * ey)));
        const double dx = x - a[0] - t * ex, dy = y - a[1] - t * ey, d = dx * dx + dy * dy;
        if (d < best) {
            best = d;
            at = p->arc[i] + t * length;
        }
    }
    return at;
}

/// Where the ray along +x leaves the waterline: the centroid is inside and the outline convex, so one edge crosses it
/// upwards.
static double bow_of(const bt_panels *p)
{
    for (int i = 0; i < p->n_vertices; i++) {
        const double *a = vertex(p, i), *b = vertex(p, i + 1);
        if (!(a[1] <= 0 && b[1] > 0)) continue;
        const double t = -a[1] / (b[1] - a[1]);
        if (a[0] + t * (b[0] - a[0]) > 0) return p->arc[i] + t * (p->arc[i + 1] - p->arc[i]);
    }
    return 0;
}

void bt_panels_init(bt_panels *p, int n, int n_vertices, const double *outline)
{
    *p = (bt_panels){.n = n, .n_vertices = n_vertices};
    p->outline = bt_alloc(2 * (size_t)n_vertices, sizeof *p->outline);
    memcpy(p->outline, outline, 2 * (size_t)n_vertices * sizeof *p->outline);
    p->arc = bt_alloc((size_t)n_vertices + 1, sizeof *p->arc);
    for (int i = 0; i < n_vertices; i++) {
        const double *a = vertex(p, i), *b = vertex(p, i + 1);
        p->arc[i + 1] = p->arc[i] + bt_hypot(b[0] - a[0], b[1] - a[1]);
    }
    p->bow = bow_of(p);
    p->panel = bt_alloc((size_t)n, sizeof *p->panel);
}

void bt_panels_free(bt_panels *p)
{
    free(p->outline);
    free(p->arc);
    free(p->panel);
    *p = (bt_panels){0};
}

int bt_panels_at(const bt_panels *p, double x, double y)
{
    // Half a panel before the bow begins panel 0.
    const double around = p->arc[p->n_vertices];
    double s = (nearest(p, x, y) - p->bow) / around * p->n + 0.5;
    s -= p->n * floor(s / p->n);
    const int k = (int)s;
    return k < p->n ? k : 0;
}

void bt_panels_point(const bt_panels *p, double s, double xy[2], double normal[2])
{
    const double around = p->arc[p->n_vertices];
    double at = p->bow + (s - 0.5) / p->n * around;
    at -= around * floor(at / around);
    int i = 0;
    while (i < p->n_vertices - 1 && p->arc[i + 1] <= at) i++;
    const double *a = vertex(p, i), *b = vertex(p, i + 1), length = p->arc[i + 1] - p->arc[i],
                 t = (at - p->arc[i]) / length;
    xy[0] = a[0] + t * (b[0] - a[0]);
    xy[1] = a[1] + t * (b[1] - a[1]);
    if (!normal) return;
    normal[0] = (b[1] - a[1]) / length;
    normal[1] = (a[0] - b[0]) / length;
}

void bt_panels_clear(bt_panels *p)
{
    for (int k = 0; k < p->n; k++) p->panel[k].fx = p->panel[k].fy = p->panel[k].normal = 0;
}

void bt_panels_load(bt_panels *p, double x, double y, double normal, double fx, double fy)
{
    bt_panel *k = &p->panel[bt_panels_at(p, x, y)];
    k->normal += normal;
    k->fx += fx;
    k->fy += fy;
}
