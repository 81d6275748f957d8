// SPDX-License-Identifier: MIT
// Simple polygons: cleaning, faults, convex parts, projection.
#include "bergtow/outline.h"
#include "base/elementary.h"
#include "base/inside.h"
#include "geometry/box.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double NEAR = 1e-9;   // lengths below this part of the extent are rounding (as in bt_shape_fault)
static const double SLIVER = 1e-9; // convex parts below this share of the area are dropped: nothing can touch them

static double cross(const double *o, const double *p, const double *q)
{
    return (p[0] - o[0]) * (q[1] - o[1]) - (p[1] - o[1]) * (q[0] - o[0]);
}

static double extent_of(int n, const double *v)
{
    const bt_box box = bt_box_of(n, v);
    return n > 0 ? bt_hypot(box.high[0] - box.low[0], box.high[1] - box.low[1]) : 0;
}

/// Is q between p and r on a straight line, or at the same place as p? A spike, where the line turns back, does not
/// count: it is a fault.
static bool idle(const double *p, const double *q, const double *r, double tiny)
{
    const double ax = q[0] - p[0], ay = q[1] - p[1], bx = r[0] - q[0], by = r[1] - q[1];
    if (bt_hypot(ax, ay) <= tiny) return true;
    const double cx = r[0] - p[0], cy = r[1] - p[1], l = bt_hypot(cx, cy);
    return l > 0 && ax * bx + ay * by > 0 && fabs(ax * cy - ay * cx) <= tiny * l;
}

int bt_outline_clean(int n, double *v)
{
    BT_PLAIN_NUMBERS;
    const double tiny = NEAR * extent_of(n, v);
    // Test each vertex against its present neighbours, as the previous one may be gone; repeat until none goes.
    for (bool changed = true; changed && n > 2;) {
        changed = false;
        for (int i = 0; i < n && n > 2; i++) {
            const double *p = v + 2 * (i > 0 ? i - 1 : n - 1), *q = v + 2 * i, *r = v + 2 * (i + 1 < n ? i + 1 : 0);
            if (!idle(p, q, r, tiny)) continue;
            memmove(v + 2 * i, v + 2 * (i + 1), 2 * (size_t)(n - i - 1) * sizeof *v);
            n--, i--;
            changed = true;
        }
    }
    return n;
}

double bt_outline_area2(int n, const double *v)
{
    BT_PLAIN_NUMBERS;
    double a = 0;
    for (int i = 1; i + 1 < n; i++) a += cross(v, v + 2 * i, v + 2 * (i + 1));
    return a;
}

static bool between(double a, double b, double x) { return bt_min(a, b) <= x && x <= bt_max(a, b); }

/// Does c, on the line through a and b, lie on the segment?
static bool on_segment(const double *a, const double *b, const double *c)
{
    return between(a[0], b[0], c[0]) && between(a[1], b[1], c[1]);
}

/// Do the closed segments ab and cd have a point in common?
static bool meet(const double *a, const double *b, const double *c, const double *d)
{
    if (bt_max(a[0], b[0]) < bt_min(c[0], d[0]) || bt_max(c[0], d[0]) < bt_min(a[0], b[0])) return false;
    if (bt_max(a[1], b[1]) < bt_min(c[1], d[1]) || bt_max(c[1], d[1]) < bt_min(a[1], b[1])) return false;
    const double c_ab = cross(a, b, c), d_ab = cross(a, b, d), a_cd = cross(c, d, a), b_cd = cross(c, d, b);
    if (((c_ab > 0 && d_ab < 0) || (c_ab < 0 && d_ab > 0)) && ((a_cd > 0 && b_cd < 0) || (a_cd < 0 && b_cd > 0)))
        return true;
    return (c_ab == 0 && on_segment(a, b, c)) || (d_ab == 0 && on_segment(a, b, d)) ||
           (a_cd == 0 && on_segment(c, d, a)) || (b_cd == 0 && on_segment(c, d, b));
}

bool bt_outline_crosses(int n, const double *v)
{
    BT_PLAIN_NUMBERS;
    for (int i = 0; i < n; i++) {
        const double *a = v + 2 * i, *b = v + 2 * ((i + 1) % n);
        for (int j = i + 1; j < n; j++) {
            const double *c = v + 2 * j, *d = v + 2 * ((j + 1) % n);
            if (j == i + 1 || (i == 0 && j == n - 1)) { // neighbours share a vertex; a spike folds back on itself
                const double *p = j == i + 1 ? a : b, *q = j == i + 1 ? b : a, *r = j == i + 1 ? d : c;
                const bool back = (p[0] - q[0]) * (r[0] - q[0]) + (p[1] - q[1]) * (r[1] - q[1]) > 0;
                if (back &&
                    fabs(cross(q, p, r)) <=
                        NEAR * bt_hypot(p[0] - q[0], p[1] - q[1]) * bt_hypot(r[0] - q[0], r[1] - q[1]))
                    return true;
                continue;
            }
            if (meet(a, b, c, d)) return true;
        }
    }
    return false;
}

const char *bt_outline_fault(int n, const double *v)
{
    BT_PLAIN_NUMBERS;
    double extent;
    const char *fault = bt_ring_fault(n, v, NEAR, &extent);
    if (fault) return fault;
    return bt_outline_crosses(n, v) ? "its edges cross or touch each other" : bt_ring_area_fault(n, v, extent);
}

bool bt_outline_convex(int n, const double *v)
{
    BT_PLAIN_NUMBERS;
    return bt_shape_fault(n, v) == NULL;
}

// --- convex parts ----------------------------------------------------------------------------------------------------

/// Is the corner a → b → c convex, by more than rounding?
static bool left_turn(const double *a, const double *b, const double *c)
{
    return cross(a, b, c) > NEAR * bt_hypot(b[0] - a[0], b[1] - a[1]) * bt_hypot(c[0] - b[0], c[1] - b[1]);
}

/// Shape of an ear a, b, c: twice the area over the square of the longest side; −1 if it is not an ear. near, m²:
/// another vertex is in the ear up to this cross product beyond a side.
static double ear_quality(int m, const int *loop, int i, const double *v, double near)
{
    const int before = loop[i > 0 ? i - 1 : m - 1], here = loop[i], after = loop[i + 1 < m ? i + 1 : 0];
    const double *a = v + 2 * before, *b = v + 2 * here, *c = v + 2 * after;
    const double area2 = cross(a, b, c);
    if (!(area2 > 0)) return -1;
    for (int k = 0; k < m; k++) {
        if (loop[k] == before || loop[k] == here || loop[k] == after) continue;
        const double *p = v + 2 * loop[k];
        if (cross(a, b, p) >= -near && cross(b, c, p) >= -near && cross(c, a, p) >= -near) return -1;
    }
    const double ab = bt_hypot(b[0] - a[0], b[1] - a[1]), bc = bt_hypot(c[0] - b[0], c[1] - b[1]),
                 ca = bt_hypot(a[0] - c[0], a[1] - c[1]);
    const double longest = bt_max(ab, bt_max(bc, ca));
    return area2 / (longest * longest);
}

typedef struct ring { int n, at[BT_MAX_VERTICES]; } ring;

static int next_of(const ring *loop, int k) { return loop->at[k + 1 < loop->n ? k + 1 : 0]; }
static int before_of(const ring *loop, int k) { return loop->at[k > 0 ? k - 1 : loop->n - 1]; }

/// Join b to a along a common edge, if the result is convex there.
static bool join(ring *a, const ring *b, const double *v)
{
    for (int i = 0; i < a->n; i++)
        for (int j = 0; j < b->n; j++) {
            const int p = a->at[i], q = next_of(a, i);
            if (b->at[j] != q || next_of(b, j) != p) continue;
            const int i1 = i + 1 < a->n ? i + 1 : 0, j1 = j + 1 < b->n ? j + 1 : 0;
            const int after_p = next_of(b, j1), before_q = before_of(b, j), before_p = before_of(a, i),
                      after_q = next_of(a, i1);
            if (!left_turn(v + 2 * before_p, v + 2 * p, v + 2 * after_p)) return false;
            if (!left_turn(v + 2 * before_q, v + 2 * q, v + 2 * after_q)) return false;
            // a from q round to p, then the vertices of b between p and q.
            ring all = {0};
            for (int k = 0; k < a->n; k++) all.at[all.n++] = a->at[(i1 + k) % a->n];
            for (int k = 1; k < b->n - 1; k++) all.at[all.n++] = b->at[(j1 + k) % b->n];
            *a = all;
            return true;
        }
    return false;
}

/// near, m²: vertices with a cross product up to this are on one line.
static bool split(int n, const double *v, double near, bt_parts *parts)
{
    *parts = (bt_parts){0};
    ring *part = bt_alloc((size_t)n, sizeof *part);
    int loop[BT_MAX_VERTICES], m = n, n_parts = 0;
    for (int i = 0; i < n; i++) loop[i] = i;
    bool sound = true;
    while (m > 3 && sound) {
        int best = -1;
        double quality = -1;
        for (int i = 0; i < m; i++) {
            const double q = ear_quality(m, loop, i, v, near);
            if (q > quality) quality = q, best = i;
        }
        for (int i = 0; i < m && near > 0; i++) { // an ear of no area, as at the tip of a line there and back
            const int a = loop[i > 0 ? i - 1 : m - 1], c = loop[i + 1 < m ? i + 1 : 0];
            if (!(fabs(cross(v + 2 * a, v + 2 * loop[i], v + 2 * c)) <= near)) continue;
            best = i, quality = 0;
            break;
        }
        sound = best >= 0;
        if (!sound) break;
        if (quality > 0) part[n_parts++] =
            (ring){3, {loop[best > 0 ? best - 1 : m - 1], loop[best], loop[best + 1 < m ? best + 1 : 0]}};
        memmove(loop + best, loop + best + 1, (size_t)(m - best - 1) * sizeof *loop);
        m--;
    }
    if (sound) part[n_parts++] = (ring){3, {loop[0], loop[1], loop[2]}};
    for (int i = 0; i < n_parts; i++)
        for (int j = i + 1; j < n_parts; j++)
            if (join(&part[i], &part[j], v)) {
                memmove(part + j, part + j + 1, (size_t)(n_parts - j - 1) * sizeof *part);
                n_parts--;
                j = i; // the larger part may now join one that was passed over
            }
    const double whole = bt_outline_area2(n, v);
    double kept = 0;
    for (int i = 0; i < n_parts && sound; i++) {
        double own[2 * BT_MAX_VERTICES];
        for (int k = 0; k < part[i].n; k++) memcpy(own + 2 * k, v + 2 * part[i].at[k], 2 * sizeof *own);
        const double area2 = bt_outline_area2(part[i].n, own);
        if (area2 <= SLIVER * whole) continue;
        sound = bt_shape_fault(part[i].n, own) == NULL;
        parts->count[parts->n++] = part[i].n;
        for (int k = 0; k < part[i].n; k++) parts->corner[parts->n_vertices++] = (uint8_t)part[i].at[k];
        kept += area2;
    }
    free(part);
    return sound && fabs(kept - whole) <= 1e-6 * whole;
}

bool bt_outline_split(int n, const double *v, bt_parts *parts)
{
    BT_PLAIN_NUMBERS;
    // Where several vertices lie on one line, such as on both sides of a neck, rounding may leave no ear.
    const double extent = extent_of(n, v);
    return split(n, v, 0, parts) || split(n, v, NEAR * extent * extent, parts);
}

// --- projection ------------------------------------------------------------------------------------------------------

#define WGS84_A 6378137.0               // m
#define WGS84_E2 6.69437999014131705734e-3 // e² = f (2 − f), 1/f = 298.257223563

/// Place on the ellipsoid, relative to the centre of the earth, m.
static void on_ellipsoid(double lon, double lat, double p[3])
{
    const double s = bt_sin(lat), normal = WGS84_A / sqrt(1 - WGS84_E2 * s * s);
    p[0] = normal * bt_cos(lat) * bt_cos(lon);
    p[1] = normal * bt_cos(lat) * bt_sin(lon);
    p[2] = normal * (1 - WGS84_E2) * s;
}

void bt_outline_project(double lon, double lat, double lon0, double lat0, double *north, double *east)
{
    BT_PLAIN_NUMBERS;
    double p[3], o[3];
    on_ellipsoid(lon, lat, p);
    on_ellipsoid(lon0, lat0, o);
    const double dx = p[0] - o[0], dy = p[1] - o[1], dz = p[2] - o[2];
    const double e = bt_cos(lon0) * dy - bt_sin(lon0) * dx,
                 n = bt_cos(lat0) * dz - bt_sin(lat0) * (bt_cos(lon0) * dx + bt_sin(lon0) * dy);
    // √(M N), mean radius of curvature there
    const double s = bt_sin(lat0), radius = WGS84_A * sqrt(1 - WGS84_E2) / (1 - WGS84_E2 * s * s);
    const double level = bt_hypot(e, n), chord = sqrt(dx * dx + dy * dy + dz * dz);
    const double stretch = level > 0 ? chord * (1 + chord * chord / (24 * radius * radius)) / level : 0;
    *east = e * stretch;
    *north = n * stretch;
}

/// Newton's method finds the chord c of the distance d = c (1 + c²/(24 R²)). The point of the ellipsoid at this chord
/// in this direction is `up` above the tangent plane of the origin and √(c² − up²) along it. Newton's method finds `up`
/// from (x² + y²)/a² + z²/b² = 1, starting with −c²/(2R), that of the sphere.
void bt_outline_unproject(double north, double east, double lon0, double lat0, double *lon, double *lat)
{
    BT_PLAIN_NUMBERS;
    double o[3];
    on_ellipsoid(lon0, lat0, o);
    const double sl = bt_sin(lon0), cl = bt_cos(lon0), sp = bt_sin(lat0), cp = bt_cos(lat0);
    const double radius = WGS84_A * sqrt(1 - WGS84_E2) / (1 - WGS84_E2 * sp * sp), distance = bt_hypot(north, east);
    double chord = distance;
    for (int k = 0; k < 8; k++) {
        const double q = chord * chord / (24 * radius * radius);
        chord -= (chord * (1 + q) - distance) / (1 + 3 * q);
    }
    const double e = distance > 0 ? east / distance : 0, n = distance > 0 ? north / distance : 0;
    const double out[3] = {-sl * e - sp * cl * n, cl * e - sp * sl * n, cp * n},
                 u[3] = {cp * cl, cp * sl, sp}; // unit vectors, in the tangent plane and up
    const double weight[3] = {1, 1, 1 / (1 - WGS84_E2)};
    double up = -chord * chord / (2 * radius), p[3];
    memcpy(p, o, sizeof p);
    for (int k = 0; k < 8; k++) {
        const double level = sqrt(bt_max(0, chord * chord - up * up));
        double f = -WGS84_A * WGS84_A, slope = 0;
        for (int a = 0; a < 3; a++) {
            p[a] = o[a] + level * out[a] + up * u[a];
            f += weight[a] * p[a] * p[a];
            slope += 2 * weight[a] * p[a] * (u[a] - (level > 0 ? up / level * out[a] : 0));
        }
        up -= f / slope;
    }
    *lon = bt_atan2(p[1], p[0]);
    *lat = bt_atan2(p[2], (1 - WGS84_E2) * bt_hypot(p[0], p[1]));
}

bool bt_outline_in_degrees(double lon, double lat, bool narrow)
{
    BT_PLAIN_NUMBERS;
    return fabs(lon) <= (narrow ? 180 : 360) && fabs(lat) <= 90;
}

void bt_outline_middle(int64_t n, const double *place, double middle[2])
{
    BT_PLAIN_NUMBERS;
    const double degree = BT_PI / 180;
    double sum[3] = {0};
    for (int64_t i = 0; i < n; i++) {
        const double lon = place[2 * i] * degree, lat = place[2 * i + 1] * degree;
        sum[0] += bt_cos(lat) * bt_cos(lon);
        sum[1] += bt_cos(lat) * bt_sin(lon);
        sum[2] += bt_sin(lat);
    }
    double lon0 = bt_atan2(sum[1], sum[0]), lat0 = bt_atan2(sum[2], bt_hypot(sum[0], sum[1]));
    for (int look = 0; look < 4; look++) { // the middle in the projection about the last one, until it converges
        double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
        for (int64_t i = 0; i < n; i++) {
            double at[2];
            bt_outline_project(place[2 * i] * degree, place[2 * i + 1] * degree, lon0, lat0, at, at + 1);
            for (int a = 0; a < 2; a++) low[a] = bt_min(low[a], at[a]), high[a] = bt_max(high[a], at[a]);
        }
        const double north = (low[0] + high[0]) / 2, east = (low[1] + high[1]) / 2;
        if (!(bt_hypot(north, east) < WGS84_A / 10)) break;
        bt_outline_unproject(north, east, lon0, lat0, &lon0, &lat0);
    }
    middle[0] = lon0 / degree;
    middle[1] = lat0 / degree;
}
