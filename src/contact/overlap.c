// SPDX-License-Identifier: MIT
// Clipping of convex outlines; area and gradient of their overlap; contact/overlap.h.
#include "contact/overlap.h"

#include <math.h>
#include <string.h>

#define ALONG 0.98 // cosine between edges that may lie on each other, as for reference edges (manifold.c)

static int count_of(const bt_bodies *bodies, bt_idx i, int part)
{
    const int64_t first = bodies->offset[i] + part;
    return part ? bodies->mark[first].count : (int)(bodies->offset[i + 1] - first);
}

static const double *outline_of(const bt_bodies *bodies, bt_idx i, int part)
{
    return bodies->outline + 2 * (bodies->offset[i] + part);
}

/// Keep the part to the left of the line from (x0, y0) along (ex, ey), an edge of b.
static void cut(bt_overlap *overlap, double x0, double y0, double ex, double ey)
{
    const double *in = overlap->v[overlap->now], *last = in + 2 * (overlap->n - 1);
    const uint8_t *of = overlap->of_b[overlap->now];
    double *out = overlap->v[1 - overlap->now], before = ex * (last[1] - y0) - ey * (last[0] - x0);
    uint8_t *mark = overlap->of_b[1 - overlap->now], last_of = of[overlap->n - 1];
    int kept = 0;
    for (int k = 0; k < overlap->n; k++) {
        const double *now = in + 2 * k, inside = ex * (now[1] - y0) - ey * (now[0] - x0);
        if ((inside >= 0) != (before >= 0)) {
            const double f = before / (before - inside);
            out[2 * kept] = last[0] + f * (now[0] - last[0]);
            out[2 * kept + 1] = last[1] + f * (now[1] - last[1]);
            mark[kept++] = inside >= 0 ? last_of : 1;
        }
        if (inside >= 0) {
            out[2 * kept] = now[0];
            out[2 * kept + 1] = now[1];
            mark[kept++] = of[k];
        }
        last = now, before = inside, last_of = of[k];
    }
    overlap->n = kept;
    overlap->now = 1 - overlap->now;
}

void bt_overlap_clip(const bt_world *world, bt_idx a, bt_idx b, const uint16_t part[2], double dx, double dy,
                     bt_overlap *overlap)
{
    const bt_bodies *bodies = &world->bodies;
    double off[2];
    bt_bodies_offset(world, a, b, off);
    off[0] += dx, off[1] += dy;
    const double *q = outline_of(bodies, b, part[1]);
    const int n_b = count_of(bodies, b, part[1]);
    overlap->n = count_of(bodies, a, part[0]);
    overlap->now = 0;
    memcpy(overlap->v[0], outline_of(bodies, a, part[0]), 2 * (size_t)overlap->n * sizeof(double));
    memset(overlap->of_b[0], 0, (size_t)overlap->n);
    for (int e = 0; e < n_b && overlap->n > 0; e++) {
        const double *p0 = q + 2 * e, *p1 = q + 2 * (e + 1 < n_b ? e + 1 : 0);
        cut(overlap, p0[0] + off[0], p0[1] + off[1], p1[0] - p0[0], p1[1] - p0[1]);
    }
}

double bt_overlap_area(const bt_overlap *overlap, double centroid[2])
{
    const double *v = overlap->v[overlap->now];
    double twice = 0, x = 0, y = 0;
    for (int k = 1; k + 1 < overlap->n; k++) { // triangles about the first vertex
        const double px = v[2 * k] - v[0], py = v[2 * k + 1] - v[1], qx = v[2 * k + 2] - v[0], qy = v[2 * k + 3] - v[1];
        const double c = px * qy - py * qx;
        twice += c;
        x += c * (px + qx);
        y += c * (py + qy);
    }
    centroid[0] = twice > 0 ? v[0] + x / (3 * twice) : 0;
    centroid[1] = twice > 0 ? v[1] + y / (3 * twice) : 0;
    return bt_max(0, 0.5 * twice);
}

/// Depth of point p inside an outline placed at (x, y), from the nearest edge that faces along (nx, ny); INFINITY if
/// none does.
static double inside_of(const double *q, int n, double x, double y, const double *p, double nx, double ny)
{
    double least = INFINITY;
    for (int e = 0; e < n; e++) {
        const double *p0 = q + 2 * e, *p1 = q + 2 * (e + 1 < n ? e + 1 : 0);
        const double ex = p1[0] - p0[0], ey = p1[1] - p0[1], along = ey * nx - ex * ny;
        if (!(along > 0) || !(along * along > ALONG * ALONG * (ex * ex + ey * ey))) continue;
        const double depth = (ex * (p[1] - p0[1] - y) - ey * (p[0] - p0[0] - x)) / sqrt(ex * ex + ey * ey);
        least = bt_min(least, bt_max(0, depth));
    }
    return least;
}

void bt_overlap_gradient(const bt_world *world, bt_idx a, bt_idx b, const uint16_t part[2], bt_overlap *overlap,
                         double blend, double grad[2])
{
    const bt_bodies *bodies = &world->bodies;
    double off[2];
    bt_bodies_offset(world, a, b, off);
    const double *v = overlap->v[overlap->now];
    grad[0] = grad[1] = 0;
    for (int k = 0; k < overlap->n; k++) {
        const double *p = v + 2 * k, *q = v + 2 * (k + 1 < overlap->n ? k + 1 : 0);
        const double ex = q[0] - p[0], ey = q[1] - p[1], length = sqrt(ex * ex + ey * ey);
        overlap->push[k][0] = overlap->push[k][1] = 0;
        if (!(length > 0)) continue;
        const double middle[2] = {0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])}, nx = ey / length, ny = -ex / length;
        const bool of_b = overlap->of_b[overlap->now][k];
        const double depth =
            of_b ? inside_of(outline_of(bodies, a, part[0]), count_of(bodies, a, part[0]), 0, 0, middle, nx, ny)
                 : inside_of(outline_of(bodies, b, part[1]), count_of(bodies, b, part[1]), off[0], off[1], middle, nx,
                             ny);
        const double weight = (of_b ? 0.5 : -0.5) * bt_min(1, depth / blend);
        overlap->push[k][0] = -weight * ey, overlap->push[k][1] = weight * ex;
        grad[0] += weight * ey;
        grad[1] -= weight * ex;
    }
}
