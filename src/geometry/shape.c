// SPDX-License-Identifier: MIT
// Convex polygons: moments by exact integration, faults, hull, clipping, named waterlines.
//
// Moments. With the origin at the centroid and the polygon cut into triangles (0, p, q) over its edges p→q,
// c = p × q = 2 × signed area of the triangle:
//     A       = Σ c/2                                             m²
//     ∫ x dA  = Σ c (p + q)/6                                     m³
//     ∫ r² dA = Σ c (p·p + p·q + q·q)/12                          m⁴
// These follow from Green's theorem and hold for any simple polygon.
//
// ∫ r³ dA (yaw drag is quadratic in speed ω r and has the arm r). In polar coordinates the triangle gives
// ∫ dθ ∫₀^R r⁴ dr = (1/5) ∫ R⁵ dθ, R(θ) the distance to the edge. Let h be the signed distance of the edge's line from
// the origin and s the coordinate along it: R² = h² + s², dθ = h ds / R², so
//     ∫ r³ dA = (h/5) ∫ (h² + s²)^{3/2} ds = (h/5) [ s (2 s² + 5 h²) R / 8 + (3/8) h⁴ asinh(s/|h|) ]   from s_p to s_q.
// The antiderivative is checked by differentiation. As h → 0 the bracket stays bounded (h⁴ asinh(s/h) → 0).
#include "bergtow/shape.h"
#include "base/elementary.h"
#include "base/inside.h"
#include "geometry/box.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static double cross(double ax, double ay, double bx, double by) { return ax * by - ay * bx; }

// (h/5) [...] of the header comment at one end of one edge
static double cubic_antiderivative(double h, double s)
{
    if (h == 0) return 0;
    double r = bt_hypot(h, s), h2 = h * h;
    return h / 5 * (s * (2 * s * s + 5 * h2) * r / 8 + 0.375 * h2 * h2 * bt_asinh(s / fabs(h)));
}

bt_moments bt_shape_centroid(int n, const double *v)
{
    BT_PLAIN_NUMBERS;
    bt_moments moments = {0};
    if (n < 1) return moments;
    // Area and centroid relative to the first vertex, so that a polygon far from the origin loses no digits.
    double a2 = 0, sx = 0, sy = 0, mean_x = 0, mean_y = 0;
    for (int i = 0; i < n; i++) {
        int j = i + 1 < n ? i + 1 : 0;
        double px = v[2 * i] - v[0], py = v[2 * i + 1] - v[1], qx = v[2 * j] - v[0], qy = v[2 * j + 1] - v[1];
        double c = cross(px, py, qx, qy);
        a2 += c;
        sx += c * (px + qx);
        sy += c * (py + qy);
        mean_x += px / n;
        mean_y += py / n;
    }
    moments.area = a2 / 2;
    // A polygon without area is a fault of the caller's data; the mean of the vertices keeps the answer finite.
    moments.cx = v[0] + (a2 != 0 ? sx / (3 * a2) : mean_x);
    moments.cy = v[1] + (a2 != 0 ? sy / (3 * a2) : mean_y);
    return moments;
}

static bt_moments moments(int n, const double *v, bool cubic)
{
    bt_moments moments = bt_shape_centroid(n, v);
    if (n < 1) return moments;
    moments.inradius = INFINITY;
    for (int i = 0; i < n; i++) {
        int j = i + 1 < n ? i + 1 : 0;
        double px = v[2 * i] - moments.cx, py = v[2 * i + 1] - moments.cy, qx = v[2 * j] - moments.cx,
               qy = v[2 * j + 1] - moments.cy;
        moments.radius = bt_max(moments.radius, bt_hypot(px, py));
        double ex = qx - px, ey = qy - py, l = bt_hypot(ex, ey);
        if (l == 0) continue;
        double c = cross(px, py, qx, qy), h = c / l;
        moments.polar += c * (px * px + py * py + px * qx + py * qy + qx * qx + qy * qy) / 12;
        double sp = (px * ex + py * ey) / l, sq = (qx * ex + qy * ey) / l;
        if (cubic) moments.cubic += cubic_antiderivative(h, sq) - cubic_antiderivative(h, sp);
        moments.inradius = bt_min(moments.inradius, h);
    }
    if (!isfinite(moments.inradius)) moments.inradius = 0;
    return moments;
}

bt_moments bt_shape_moments(int n, const double *v)
{
    BT_PLAIN_NUMBERS;
    return moments(n, v, true);
}

bt_moments bt_shape_area_moments(int n, const double *v)
{
    BT_PLAIN_NUMBERS;
    return moments(n, v, false);
}

const char *bt_ring_fault(int n, const double *v, double near, double *extent)
{
    if (n < 3) return "it has fewer than 3 vertices";
    if (n > BT_MAX_VERTICES) return "it has more than 128 vertices";
    for (int i = 0; i < 2 * n; i++)
        if (!isfinite(v[i])) return "a vertex is not a finite number";
    // Lengths relative to the extent: 1e-9 of it is a tenth of a micron on a 100 m floe.
    const bt_box box = bt_box_of(n, v);
    *extent = bt_hypot(box.high[0] - box.low[0], box.high[1] - box.low[1]);
    if (!(*extent > 0) || !isfinite(*extent * *extent)) return "its vertices coincide or are out of range";
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * ((i + 1) % n);
        if (bt_hypot(q[0] - p[0], q[1] - p[1]) <= near * *extent) return "two neighbouring vertices coincide";
    }
    return NULL;
}

const char *bt_ring_area_fault(int n, const double *v, double extent)
{
    double area2 = 0;
    for (const double *p = v + 2; p < v + 2 * (n - 1); p += 2)
        area2 += cross(p[0] - v[0], p[1] - v[1], p[2] - v[0], p[3] - v[1]);
    if (fabs(area2) <= 1e-12 * extent * extent) return "its area is zero";
    return area2 < 0 ? "its vertices run clockwise; list them anticlockwise (from +x towards +y)" : NULL;
}

/// near: distance / extent up to which neighbouring vertices coincide; angle: largest turn the wrong way, rad.
static const char *fault_of(int n, const double *v, double near, double angle)
{
    double extent, turned = 0;
    const char *fault = bt_ring_fault(n, v, near, &extent);
    if (fault || (fault = bt_ring_area_fault(n, v, extent))) return fault;
    bool reflex = false;
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * ((i + 1) % n), *r = v + 2 * ((i + 2) % n);
        double ax = q[0] - p[0], ay = q[1] - p[1], bx = r[0] - q[0], by = r[1] - q[1];
        double turn = bt_atan2(cross(ax, ay, bx, by), ax * bx + ay * by);
        // Collinear vertices are allowed, to round-off; a half turn is a spike.
        if (turn < -angle || turn > BT_PI - 1e-9) reflex = true;
        turned += turn;
    }
    if (reflex) return "it is not convex";
    // A star polygon turns left at every vertex but goes round more than once.
    if (fabs(turned - 2 * BT_PI) > 1e-6) return "its edges cross each other";
    return NULL;
}

const char *bt_shape_fault(int n, const double *v)
{
    BT_PLAIN_NUMBERS;
    return fault_of(n, v, 1e-9, 1e-9);
}

bool bt_shape_broken(int n, const double *v)
{
    BT_PLAIN_NUMBERS;
    return fault_of(n, v, 1e-12, 1e-6) != NULL;
}

bt_moments bt_shape_centre(int n, double *v)
{
    BT_PLAIN_NUMBERS;
    bt_moments moments = bt_shape_area_moments(n, v);
    for (int i = 0; i < n; i++) {
        v[2 * i] -= moments.cx;
        v[2 * i + 1] -= moments.cy;
    }
    return moments;
}

double bt_shape_width(int n, const double *v, double ux, double uy)
{
    BT_PLAIN_NUMBERS;
    if (n < 1) return 0;
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < n; i++) {
        double s = cross(ux, uy, v[2 * i], v[2 * i + 1]);
        low = bt_min(low, s);
        high = bt_max(high, s);
    }
    return high - low;
}

void bt_shape_regular(int n, double area, double *v)
{
    BT_PLAIN_NUMBERS;
    double r = sqrt(2 * area / (n * bt_sin(2 * BT_PI / n)));
    for (int i = 0; i < n; i++) {
        v[2 * i] = r * bt_cos(2 * BT_PI * i / n);
        v[2 * i + 1] = r * bt_sin(2 * BT_PI * i / n);
    }
}

static int by_x_then_y(const void *a, const void *b)
{
    const double *p = a, *q = b;
    if (p[0] != q[0]) return p[0] < q[0] ? -1 : 1;
    return (p[1] > q[1]) - (p[1] < q[1]);
}

// Does a → b → c turn left by more than round-off?
static bool turns_left(const double *a, const double *b, const double *c)
{
    double ux = b[0] - a[0], uy = b[1] - a[1], wx = c[0] - b[0], wy = c[1] - b[1];
    return cross(ux, uy, wx, wy) > 1e-12 * (fabs(ux) + fabs(uy)) * (fabs(wx) + fabs(wy));
}

// Andrew's monotone chain (1979, Inf. Process. Lett. 9): lower hull left to right, then upper hull back.
int bt_shape_hull(int n, double *v)
{
    BT_PLAIN_NUMBERS;
    if (n < 2) return n;
    double *p = bt_alloc(2 * (size_t)n, sizeof *p), *h = bt_alloc(4 * (size_t)n + 2, sizeof *h);
    memcpy(p, v, 2 * (size_t)n * sizeof *p);
    qsort(p, (size_t)n, 2 * sizeof *p, by_x_then_y);
    int distinct = 1;
    for (int i = 1; i < n; i++)
        if (by_x_then_y(p + 2 * i, p + 2 * (distinct - 1)) != 0) {
            memmove(p + 2 * distinct, p + 2 * i, 2 * sizeof *p);
            distinct++;
        }
    int k = 0;
    for (int i = 0; i < distinct; i++) {
        while (k >= 2 && !turns_left(h + 2 * (k - 2), h + 2 * (k - 1), p + 2 * i)) k--;
        memcpy(h + 2 * k++, p + 2 * i, 2 * sizeof *h);
    }
    for (int i = distinct - 2, base = k + 1; i >= 0; i--) {
        while (k >= base && !turns_left(h + 2 * (k - 2), h + 2 * (k - 1), p + 2 * i)) k--;
        memcpy(h + 2 * k++, p + 2 * i, 2 * sizeof *h);
    }
    if (distinct > 1) k--; // the first point came round again
    memcpy(v, h, 2 * (size_t)k * sizeof *v);
    free(p);
    free(h);
    return k;
}

// The vertices inside a half-plane are one run of a convex polygon. Walking out from the vertex farthest outside,
// rather than testing vertex by vertex (Sutherland–Hodgman), keeps them one run when round-off makes the sign
// alternate along an edge that lies on the line, so that never more than n+1 vertices come out.
int bt_shape_clip(int n, const double *v, double nx, double ny, double d, double *out)
{
    BT_PLAIN_NUMBERS;
    int worst = 0, deepest = 0;
    double far = -INFINITY, near = INFINITY;
    for (int i = 0; i < n; i++) {
        double s = nx * v[2 * i] + ny * v[2 * i + 1] - d;
        if (s > far) far = s, worst = i;
        if (s < near) near = s, deepest = i;
    }
    if (n < 1) return 0;
    if (far <= 0) {
        memmove(out, v, 2 * (size_t)n * sizeof *out);
        return n;
    }
    if (near >= 0) return 0;
    int first = worst, last = worst; // first and last vertex of the run that stays
    double s_first, s_last, s_before = far, s_after = far;
    for (;;) {
        first = first + 1 < n ? first + 1 : 0;
        s_first = nx * v[2 * first] + ny * v[2 * first + 1] - d;
        if (s_first <= 0 || first == deepest) break;
        s_before = s_first;
    }
    for (;;) {
        last = last > 0 ? last - 1 : n - 1;
        s_last = nx * v[2 * last] + ny * v[2 * last + 1] - d;
        if (s_last <= 0 || last == deepest) break;
        s_after = s_last;
    }
    int k = 0;
    if (s_first < 0) {
        const double *p = v + 2 * (first > 0 ? first - 1 : n - 1), *q = v + 2 * first;
        double t = s_before / (s_before - s_first);
        out[2 * k] = p[0] + t * (q[0] - p[0]);
        out[2 * k + 1] = p[1] + t * (q[1] - p[1]);
        k++;
    }
    for (int i = first;; i = i + 1 < n ? i + 1 : 0) {
        out[2 * k] = v[2 * i];
        out[2 * k + 1] = v[2 * i + 1];
        k++;
        if (i == last) break;
    }
    if (s_last < 0) {
        const double *p = v + 2 * last, *q = v + 2 * (last + 1 < n ? last + 1 : 0);
        double t = s_after / (s_after - s_last);
        out[2 * k] = q[0] + t * (p[0] - q[0]);
        out[2 * k + 1] = q[1] + t * (p[1] - q[1]);
        k++;
    }
    return k < 3 ? 0 : k;
}

static int rectangle(double l, double w, double *v)
{
    const double corners[8] = {-l / 2, -w / 2, l / 2, -w / 2, l / 2, w / 2, -l / 2, w / 2};
    memcpy(v, corners, sizeof corners);
    return 4;
}

// 64 vertices keep the outline within 0.12 % of the radius and leave room for pairs in the contact buffers.
static int disc(double l, double w, double *v)
{
    enum { N = 64 };
    bt_shape_regular(N, BT_PI / 4, v); // area of the circle of diameter 1
    for (int i = 0; i < N; i++) {
        v[2 * i] *= l;
        v[2 * i + 1] *= w;
    }
    return N;
}

// Transom 0.7 w widening over the aft fifth, straight sides, and a parabola y = ±(w/2)(1 − t²) over the foremost
// quarter, t from 0 at its start to 1 at the stem.
static int ship(double l, double w, double *v)
{
    enum { BOW = 8 };
    int n = 0;
#define PUT(px, py) (v[2 * n] = (px), v[2 * n + 1] = (py), n++)
    PUT(-l / 2, -0.35 * w);
    PUT(-0.3 * l, -w / 2);
    for (int i = 0; i < BOW; i++) {
        double t = (double)i / BOW;
        PUT(l / 4 * (1 + t), -w / 2 * (1 - t * t));
    }
    PUT(l / 2, 0);
    for (int i = BOW - 1; i >= 0; i--) {
        double t = (double)i / BOW;
        PUT(l / 4 * (1 + t), w / 2 * (1 - t * t));
    }
    PUT(-0.3 * l, w / 2);
    PUT(-l / 2, 0.35 * w);
#undef PUT
    bt_shape_centre(n, v);
    return n;
}

int bt_shape_named(const char *name, double l, double w, double *v)
{
    BT_PLAIN_NUMBERS;
    if (strcmp(name, "disc") == 0) return disc(l, w, v);
    if (strcmp(name, "square") == 0) return rectangle(l, l, v);
    if (strcmp(name, "rectangle") == 0) return rectangle(l, w, v);
    if (strcmp(name, "ship") == 0) return ship(l, w, v);
    return 0;
}
