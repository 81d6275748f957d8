// SPDX-License-Identifier: MIT
// Separating axes over all edge normals of both polygons; see apart.h.
#include "geometry/apart.h"

#include <math.h>

#include "bergtow/base.h"

static double support(int n, const double *v, double nx, double ny)
{
    double h = -INFINITY;
    for (int i = 0; i < n; i++) h = bt_max(h, nx * v[2 * i] + ny * v[2 * i + 1]);
    return h;
}

static void take(bt_apart *r, double along, double ha, double hb)
{
    r->gap = bt_max(r->gap, along - ha - hb);
    if (ha + hb > 0) r->both = bt_max(r->both, along / (ha + hb));
    if (ha > 0) r->first = bt_max(r->first, (along - hb) / ha);
}

bt_apart bt_apart_of(int na, const double *a, int nb, const double *b, double dx, double dy)
{
    bt_apart r = {-INFINITY, -INFINITY, -INFINITY};
    for (int i = 0; i < na; i++) {
        const double *p = a + 2 * i, *q = a + 2 * (i + 1 < na ? i + 1 : 0);
        double nx = q[1] - p[1], ny = p[0] - q[0], l = sqrt(nx * nx + ny * ny);
        if (l == 0) continue;
        nx /= l, ny /= l;
        take(&r, nx * dx + ny * dy, nx * p[0] + ny * p[1], support(nb, b, -nx, -ny));
    }
    for (int i = 0; i < nb; i++) {
        const double *p = b + 2 * i, *q = b + 2 * (i + 1 < nb ? i + 1 : 0);
        double nx = q[1] - p[1], ny = p[0] - q[0], l = sqrt(nx * nx + ny * ny);
        if (l == 0) continue;
        nx /= l, ny /= l; // outward of b: n = −(nx, ny) points from a to b
        take(&r, -(nx * dx + ny * dy), support(na, a, -nx, -ny), nx * p[0] + ny * p[1]);
    }
    return r;
}
