// SPDX-License-Identifier: MIT
// Clipping of convex outlines; area and gradient of their overlap; contact/overlap.h.
#include "contact/overlap.h"

#include <math.h>
#include <string.h>

#include "geometry/polygons.h"

static int count_of(const bt_bodies *bodies, bt_idx i, int part)
{
    const int64_t first = bodies->offset[i] + part;
    return part ? bodies->mark[first].count : (int)(bodies->offset[i + 1] - first);
}

static const double *outline_of(const bt_bodies *bodies, bt_idx i, int part)
{
    return bodies->outline + 2 * (bodies->offset[i] + part);
}

const double *bt_overlap_polygon(const bt_world *world, bt_idx i, int part, int *n)
{
    *n = count_of(&world->bodies, i, part);
    return outline_of(&world->bodies, i, part);
}

void bt_overlap_cut(const bt_world *world, bt_idx i, int part, const double place[2], bt_overlap *overlap)
{
    const double *q = outline_of(&world->bodies, i, part);
    const int n = count_of(&world->bodies, i, part);
    for (int e = 0; e < n && overlap->n > 0; e++) {
        const double *p0 = q + 2 * e, *p1 = q + 2 * (e + 1 < n ? e + 1 : 0);
        const double at[2] = {p0[0] + place[0], p0[1] + place[1]}, along[2] = {p1[0] - p0[0], p1[1] - p0[1]};
        const int now = overlap->now, next = 1 - now;
        overlap->n = (int)bt_polygon_cut(overlap->n, overlap->v[now], overlap->of_b[now], at, along, overlap->v[next],
                                         overlap->of_b[next]);
        overlap->now = next;
    }
}

void bt_overlap_clip(const bt_world *world, bt_idx a, bt_idx b, const uint16_t part[2], double dx, double dy,
                     bt_overlap *overlap)
{
    const bt_bodies *bodies = &world->bodies;
    double off[2];
    bt_bodies_offset(world, a, b, off);
    off[0] += dx, off[1] += dy;
    overlap->n = count_of(bodies, a, part[0]);
    overlap->now = 0;
    memcpy(overlap->v[0], outline_of(bodies, a, part[0]), 2 * (size_t)overlap->n * sizeof(double));
    memset(overlap->of_b[0], 0, (size_t)overlap->n);
    bt_overlap_cut(world, b, part[1], off, overlap);
}

double bt_overlap_area(const bt_overlap *overlap, double centroid[2])
{
    const bt_moments moments = bt_shape_centroid(overlap->n, overlap->v[overlap->now]);
    centroid[0] = moments.area > 0 ? moments.cx : 0;
    centroid[1] = moments.area > 0 ? moments.cy : 0;
    return bt_max(0, moments.area);
}

/// Depth of point p inside an outline placed at (x, y), from the nearest edge that faces along (nx, ny); INFINITY if
/// none does.
static double inside_of(const double *q, int n, double x, double y, const double *p, double nx, double ny)
{
    double least = INFINITY;
    for (int e = 0; e < n; e++) {
        const double *p0 = q + 2 * e, *p1 = q + 2 * (e + 1 < n ? e + 1 : 0);
        const double ex = p1[0] - p0[0], ey = p1[1] - p0[1], along = ey * nx - ex * ny;
        if (!(along > 0) || !(along * along > BT_SQUARE * BT_SQUARE * (ex * ex + ey * ey))) continue;
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
