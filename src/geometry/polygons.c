// SPDX-License-Identifier: MIT
// Separating axes over all edge normals of both polygons; see polygons.h.
#include "geometry/polygons.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/base.h"
#include "bergtow/shape.h"
#include "base/elementary.h"

static double support(int n, const double *v, double nx, double ny)
{
    double h = -INFINITY;
    for (int i = 0; i < n; i++) h = bt_max(h, nx * v[2 * i] + ny * v[2 * i + 1]);
    return h;
}

static void take(bt_apart *apart, double along, double ha, double hb)
{
    apart->gap = bt_max(apart->gap, along - ha - hb);
    if (ha + hb > 0) apart->both = bt_max(apart->both, along / (ha + hb));
    if (ha > 0) apart->first = bt_max(apart->first, (along - hb) / ha);
}

bt_apart bt_apart_of(int na, const double *a, int nb, const double *b, double dx, double dy)
{
    bt_apart apart = {-INFINITY, -INFINITY, -INFINITY};
    for (int i = 0; i < na; i++) {
        const double *p = a + 2 * i, *q = a + 2 * (i + 1 < na ? i + 1 : 0);
        double nx = q[1] - p[1], ny = p[0] - q[0], l = sqrt(nx * nx + ny * ny);
        if (l == 0) continue;
        nx /= l, ny /= l;
        take(&apart, nx * dx + ny * dy, nx * p[0] + ny * p[1], support(nb, b, -nx, -ny));
    }
    for (int i = 0; i < nb; i++) {
        const double *p = b + 2 * i, *q = b + 2 * (i + 1 < nb ? i + 1 : 0);
        double nx = q[1] - p[1], ny = p[0] - q[0], l = sqrt(nx * nx + ny * ny);
        if (l == 0) continue;
        nx /= l, ny /= l; // outward of b: n = −(nx, ny) points from a to b
        take(&apart, -(nx * dx + ny * dy), support(na, a, -nx, -ny), nx * p[0] + ny * p[1]);
    }
    return apart;
}

// --- clipping --------------------------------------------------------------------------------------------------------

int64_t bt_polygon_cut(int64_t n, const double *v, const uint8_t *of, const double at[2], const double along[2],
                       double *out, uint8_t *mark)
{
    const double *last = v + 2 * (n - 1);
    double before = along[0] * (last[1] - at[1]) - along[1] * (last[0] - at[0]);
    uint8_t last_of = of ? of[n - 1] : 0;
    int64_t kept = 0;
    for (int64_t k = 0; k < n; k++) {
        const double *now = v + 2 * k, inside = along[0] * (now[1] - at[1]) - along[1] * (now[0] - at[0]);
        if ((inside >= 0) != (before >= 0)) {
            const double f = before / (before - inside);
            out[2 * kept] = last[0] + f * (now[0] - last[0]);
            out[2 * kept + 1] = last[1] + f * (now[1] - last[1]);
            if (mark) mark[kept] = inside >= 0 ? last_of : 1;
            kept++;
        }
        if (inside >= 0) {
            out[2 * kept] = now[0];
            out[2 * kept + 1] = now[1];
            if (mark) mark[kept] = of[k];
            kept++;
        }
        last = now, before = inside;
        if (of) last_of = of[k];
    }
    return kept;
}

double bt_polygon_shared(int64_t n, int m, const double *by, double *const w[2])
{
    int now = 0;
    for (int e = 0; e < m && n > 0; e++, now = 1 - now) {
        const double *p = by + 2 * e, *q = by + 2 * (e + 1 < m ? e + 1 : 0), along[2] = {q[0] - p[0], q[1] - p[1]};
        n = bt_polygon_cut(n, w[now], NULL, p, along, w[1 - now], NULL);
    }
    return 0.5 * bt_outline_area2((int)n, w[now]);
}

// --- motion ----------------------------------------------------------------------------------------------------------

// Conservative advancement (Mirtich 1996) of two convex polygons in the plane.
//
// At time t the nearest points of the two, D apart, give a direction n from a to b. As long as n separates them, their
// distance is at least the least of
//     n·(d + q − p) + τ n·(V + ω_b k×q − ω_a k×p) − ½ τ² (ω_a² |p| + ω_b² |q|)
// over the vertices p of a and q of b, τ later: a rotating point leaves its tangent by at most ½ (ωτ)² of its radius.
// The motion is safe until the earliest τ at which a pair of vertices can be as near as `near`; there the nearest
// points are found again. For straight motion this is Newton's iteration, and ends after two to five rounds.
//
// Rejected: the distance at the end of the step alone (tunnels); sampling the motion (a number to choose, slower).

#define WITHIN 1.01 // times `near`: near enough
enum { ROUNDS = 1000 }; // after so many they count as meeting; edges that turn beside each other take dozens

static void turn(const bt_moving *moving, double t, double x, double y, double *out)
{
    double s, c;
    bt_sincos(moving->rate * t, &s, &c);
    for (int i = 0; i < moving->n; i++) {
        out[2 * i] = c * moving->v[2 * i] - s * moving->v[2 * i + 1] + x;
        out[2 * i + 1] = s * moving->v[2 * i] + c * moving->v[2 * i + 1] + y;
    }
}

/// Vertices of q against edges of p: the least squared distance so far, and the vector from p to q there.
static void nearest(int n, const double *p, int m, const double *q, double sign, double *least, double away[2])
{
    for (int i = 0; i < n; i++) {
        const double *e = p + 2 * i, *f = p + 2 * (i + 1 < n ? i + 1 : 0);
        const double ex = f[0] - e[0], ey = f[1] - e[1], per = 1 / (ex * ex + ey * ey);
        for (int j = 0; j < m; j++) {
            const double x = q[2 * j] - e[0], y = q[2 * j + 1] - e[1];
            const double t = bt_max(0, bt_min(1, (x * ex + y * ey) * per));
            const double rx = x - t * ex, ry = y - t * ey, d = rx * rx + ry * ry;
            if (!(d < *least)) continue;
            *least = d;
            away[0] = sign * rx, away[1] = sign * ry;
        }
    }
}

/// The earliest time at which a vertex of b can be within `near` of one of a along n.
static double safe_time(const bt_moving *a, const double *p, const bt_moving *b, const double *q,
                        const double centre[2], const double n[2], double near)
{
    const double vx = b->x - a->x, vy = b->y - a->y;
    double first = INFINITY;
    for (int j = 0; j < b->n; j++) {
        const double bx = q[2 * j] - centre[0], by = q[2 * j + 1] - centre[1];
        const double along = n[0] * q[2 * j] + n[1] * q[2 * j + 1] - near;
        const double rate = n[0] * (vx - b->rate * by) + n[1] * (vy + b->rate * bx);
        const double bend = b->rate != 0 ? b->rate * b->rate * bt_hypot(bx, by) : 0;
        for (int i = 0; i < a->n; i++) {
            const double ax = p[2 * i], ay = p[2 * i + 1];
            const double gap = along - n[0] * ax - n[1] * ay;
            const double opening = rate - a->rate * (n[1] * ax - n[0] * ay);
            const double k = bend + (a->rate != 0 ? a->rate * a->rate * bt_hypot(ax, ay) : 0);
            // gap + opening τ − ½ k τ² = 0
            const double root = sqrt(opening * opening + 2 * k * gap) - opening;
            if (root > 0) first = bt_min(first, 2 * gap / root);
        }
    }
    return first;
}

bool bt_sweep_meets(const bt_moving *a, const bt_moving *b, double dx, double dy, double near, double dt)
{
    double p[2 * BT_MAX_VERTICES], q[2 * BT_MAX_VERTICES], t = 0;
    for (int round = 0; round < ROUNDS; round++) {
        // in a frame that moves with a and does not turn
        const double centre[2] = {dx + t * (b->x - a->x), dy + t * (b->y - a->y)};
        turn(a, t, 0, 0, p);
        turn(b, t, centre[0], centre[1], q);
        double least = INFINITY, n[2] = {0};
        nearest(a->n, p, b->n, q, 1, &least, n);
        nearest(b->n, q, a->n, p, -1, &least, n);
        const double distance = sqrt(least);
        if (!(distance > WITHIN * near)) return true;
        n[0] /= distance, n[1] /= distance;
        const double later = safe_time(a, p, b, q, centre, n, near);
        if (!(later > 0)) return true; // they overlap from the beginning
        t += later;
        if (!(t < dt)) return false;
    }
    return true;
}

// --- flush outlines --------------------------------------------------------------------------------------------------

/// Move x to its nearest place on `outline`, which is shifted by (dx, dy). False if that is not within reach.
static bool place_on(const bt_welded *outline, double dx, double dy, double reach, double x[2])
{
    double best = reach, to[2] = {0};
    for (int i = 0; i < outline->n; i++) {
        const double px = outline->v[2 * i] + dx, py = outline->v[2 * i + 1] + dy, d = bt_hypot(x[0] - px, x[1] - py);
        if (d <= best) best = d, to[0] = px, to[1] = py;
    }
    if (best == reach) { // no vertex is nearer
        for (int i = 0; i < outline->n; i++) {
            const double *p = outline->v + 2 * i, *q = outline->v + 2 * (i + 1 < outline->n ? i + 1 : 0);
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

static bool sound(const bt_welded *outline, bool convex)
{
    return !bt_outline_fault(outline->n, outline->v) && bt_outline_convex(outline->n, outline->v) == convex;
}

void bt_weld(int n, bt_welded *outline, double reach, double period_x, double period_y)
{
    const int images_x = period_x > 0, images_y = period_y > 0;
    bt_box *bounds = bt_alloc((size_t)n, sizeof *bounds);
    for (int i = 0; i < n; i++) {
        bt_welded moved = outline[i];
        bounds[i] = bt_box_of(outline[i].n, outline[i].v);
        bool done[BT_MAX_VERTICES] = {false}, any = false;
        for (int j = 0; j < i; j++)
            for (int kx = -images_x; kx <= images_x; kx++)
                for (int ky = -images_y; ky <= images_y; ky++) {
                    const double d[2] = {kx * period_x, ky * period_y};
                    bool apart = false;
                    for (int a = 0; a < 2; a++)
                        apart = apart || bounds[j].low[a] + d[a] > bounds[i].high[a] + reach ||
                                bounds[j].high[a] + d[a] < bounds[i].low[a] - reach;
                    for (int k = 0; k < moved.n && !apart; k++)
                        if (!done[k]) any = (done[k] = place_on(&outline[j], d[0], d[1], reach, moved.v + 2 * k)) ||
                                            any;
                }
        if (any && sound(&moved, bt_outline_convex(outline[i].n, outline[i].v)))
            outline[i] = moved, bounds[i] = bt_box_of(outline[i].n, outline[i].v);
    }
    free(bounds);
}
