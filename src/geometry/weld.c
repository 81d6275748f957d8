// SPDX-License-Identifier: MIT
// Vertices onto the outlines beside them; see weld.h.
#include "geometry/weld.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"

typedef struct { double low[2], high[2]; } box;

static box box_of(const bt_welded *o)
{
    box b = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    for (int i = 0; i < 2 * o->n; i++) {
        b.low[i % 2] = bt_min(b.low[i % 2], o->v[i]);
        b.high[i % 2] = bt_max(b.high[i % 2], o->v[i]);
    }
    return b;
}

/// The place on o, moved by (dx, dy), that x goes to. False: o is not within reach.
static bool place_on(const bt_welded *o, double dx, double dy, double reach, double x[2])
{
    double best = reach, to[2] = {0};
    for (int i = 0; i < o->n; i++) {
        const double px = o->v[2 * i] + dx, py = o->v[2 * i + 1] + dy, d = bt_hypot(x[0] - px, x[1] - py);
        if (d <= best) best = d, to[0] = px, to[1] = py;
    }
    if (best == reach) { // no vertex is nearer
        for (int i = 0; i < o->n; i++) {
            const double *p = o->v + 2 * i, *q = o->v + 2 * (i + 1 < o->n ? i + 1 : 0);
            const double ex = q[0] - p[0], ey = q[1] - p[1], rx = x[0] - p[0] - dx, ry = x[1] - p[1] - dy,
                         t = (rx * ex + ry * ey) / (ex * ex + ey * ey), d = bt_hypot(rx - t * ex, ry - t * ey);
            if (t < 0 || t > 1 || d >= best) continue;
            best = d, to[0] = p[0] + dx + t * ex, to[1] = p[1] + dy + t * ey;
        }
    }
    if (best >= reach) return false;
    memcpy(x, to, sizeof to);
    return true;
}

static bool sound(const bt_welded *o, bool convex)
{
    return !bt_outline_fault(o->n, o->v) && bt_outline_convex(o->n, o->v) == convex;
}

void bt_weld(int n, bt_welded *o, double reach, double period_x, double period_y)
{
    const int images_x = period_x > 0, images_y = period_y > 0;
    box *b = bt_alloc((size_t)n, sizeof *b);
    for (int i = 0; i < n; i++) {
        bt_welded moved = o[i];
        b[i] = box_of(&o[i]);
        bool done[BT_MAX_VERTICES] = {false}, any = false;
        for (int j = 0; j < i; j++)
            for (int kx = -images_x; kx <= images_x; kx++)
                for (int ky = -images_y; ky <= images_y; ky++) {
                    const double d[2] = {kx * period_x, ky * period_y};
                    bool apart = false;
                    for (int a = 0; a < 2; a++)
                        apart = apart || b[j].low[a] + d[a] > b[i].high[a] + reach ||
                                b[j].high[a] + d[a] < b[i].low[a] - reach;
                    for (int k = 0; k < moved.n && !apart; k++)
                        if (!done[k]) any = (done[k] = place_on(&o[j], d[0], d[1], reach, moved.v + 2 * k)) || any;
                }
        if (any && sound(&moved, bt_outline_convex(o[i].n, o[i].v))) o[i] = moved, b[i] = box_of(&o[i]);
    }
    free(b);
}
