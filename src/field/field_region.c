// SPDX-License-Identifier: MIT
// Where ice may lie: the ice region, its periodic directions, and the bodies that stand in it.
#include "field/field_make.h"
#include "bergtow/outline.h"
#include "base/elementary.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double MAX_GROWTH = 20; // of a body by the clearance: a body that needs more is a line

static void place(int n, double *v, double x, double y, double yaw)
{
    double c = bt_cos(yaw), s = bt_sin(yaw);
    for (int i = 0; i < n; i++) {
        double px = v[2 * i], py = v[2 * i + 1];
        v[2 * i] = x + c * px - s * py;
        v[2 * i + 1] = y + s * px + c * py;
    }
}

// Area of a polygon within the region.
static double area_inside(const bt_region *region, int n, const double *v)
{
    double a[2 * (BT_MAX_VERTICES + 4)], b[2 * (BT_MAX_VERTICES + 4)];
    n = bt_shape_clip(n, v, -1, 0, -region->x0, a);
    n = bt_shape_clip(n, a, 1, 0, region->x1, b);
    n = bt_shape_clip(n, b, 0, -1, -region->y0, a);
    n = bt_shape_clip(n, a, 0, 1, region->y1, b);
    return n >= 3 ? bt_shape_centroid(n, b).area : 0;
}

// The same for a convex part of a floe and its images across edges where the domain wraps.
static double part_inside(const bt_region *region, const bt_case *input, int n, const double *v)
{
    const int over_x = bt_bound_wraps(input->domain.ends), over_y = input->domain.sides == BT_BOUND_PERIODIC;
    double sum = 0, at[2 * BT_MAX_VERTICES];
    for (int ix = -over_x; ix <= over_x; ix++)
        for (int iy = -over_y; iy <= over_y; iy++) {
            for (int k = 0; k < n; k++) {
                at[2 * k] = v[2 * k] + ix * input->domain.length;
                at[2 * k + 1] = v[2 * k + 1] + iy * input->domain.width;
            }
            sum += area_inside(region, n, at);
        }
    return sum;
}

double bt_region_area_of(const bt_region *region, const bt_case *input, int n, const double *v)
{
    bt_parts parts;
    if (bt_outline_convex(n, v) || !bt_outline_split(n, v, &parts)) return part_inside(region, input, n, v);
    double sum = 0;
    for (int i = 0, at = 0; i < parts.n; at += parts.count[i++]) {
        double part[2 * BT_MAX_VERTICES];
        for (int k = 0; k < parts.count[i]; k++) memcpy(part + 2 * k, v + 2 * parts.corner[at + k], 2 * sizeof *v);
        sum += part_inside(region, input, parts.count[i], part);
    }
    return sum;
}

bt_apart bt_region_apart(const bt_obstacle *obstacle, int n, const double *v, double dx, double dy)
{
    double own[2 * BT_MAX_VERTICES];
    for (int i = 0; i < obstacle->n; i++)
        own[2 * i] = obstacle->v[2 * i] - obstacle->x, own[2 * i + 1] = obstacle->v[2 * i + 1] - obstacle->y;
    return bt_apart_of(n, v, obstacle->n, own, dx, dy);
}

/// Box around polygon v, aligned with its longest edge, and larger by `clearance` on all sides.
static void box_about(int n, const double *v, double clearance, double box[8])
{
    double longest = 0, ux = 1, uy = 0, low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * ((i + 1) % n);
        const double l = bt_hypot(q[0] - p[0], q[1] - p[1]);
        if (l > longest) longest = l, ux = (q[0] - p[0]) / l, uy = (q[1] - p[1]) / l;
    }
    for (int i = 0; i < n; i++) {
        const double at[2] = {ux * v[2 * i] + uy * v[2 * i + 1], ux * v[2 * i + 1] - uy * v[2 * i]};
        for (int k = 0; k < 2; k++) low[k] = bt_min(low[k], at[k]), high[k] = bt_max(high[k], at[k]);
    }
    for (int k = 0; k < 2; k++) low[k] -= clearance, high[k] += clearance;
    const double corner[8] = {low[0], low[1], high[0], low[1], high[0], high[1], low[0], high[1]};
    for (int i = 0; i < 4; i++) {
        box[2 * i] = ux * corner[2 * i] - uy * corner[2 * i + 1];
        box[2 * i + 1] = uy * corner[2 * i] + ux * corner[2 * i + 1];
    }
}

// Add a convex body, or a part of one, and its periodic images that reach into the region; subtract the area they cover
// from the ice. False for a body too slender to gain the clearance by scaling: it would keep floes away all along its
// line, with no limit on the number of images. A part that slender is a sliver along an edge, and gets a box.
static bool add_obstacle(bt_region *region, int n, const double *v, bool part)
{
    double lx = region->x1 - region->x0, ly = region->y1 - region->y0;
    bt_moments moments = bt_shape_area_moments(n, v);
    // Scaling about the centroid by 1 + clearance/inradius moves every edge out by at least the clearance.
    double grow = 1 + region->clearance / bt_max(moments.inradius, 1e-9 * moments.radius);
    const bool sliver = grow > MAX_GROWTH;
    if (sliver && !part) return false;
    double box[8], r = moments.radius * grow;
    if (sliver) {
        box_about(n, v, region->clearance, box);
        r = bt_shape_area_moments(4, box).radius + moments.radius;
    }
    // First bring a body far outside a periodic domain back, so that adjacent images suffice.
    double wx = moments.cx, wy = moments.cy;
    bt_region_wrap(region, &wx, &wy);
    int reach_x = region->periodic_x ? 1 + (int)(r / lx) : 0, reach_y = region->periodic_y ? 1 + (int)(r / ly) : 0;
    for (int ix = -reach_x; ix <= reach_x; ix++)
        for (int iy = -reach_y; iy <= reach_y; iy++) {
            double cx = wx + ix * lx, cy = wy + iy * ly;
            // Floes with their centroid in the region reach across a periodic edge by less than half a period.
            double over_x = region->periodic_x ? lx / 2 : 0, over_y = region->periodic_y ? ly / 2 : 0;
            if (cx + r < region->x0 - over_x || cx - r > region->x1 + over_x || cy + r < region->y0 - over_y ||
                cy - r > region->y1 + over_y)
                continue;
            region->obstacles = bt_realloc(region->obstacles, (size_t)region->n_obstacles + 1,
                                           sizeof *region->obstacles);
            bt_obstacle *obstacle = &region->obstacles[region->n_obstacles++];
            *obstacle = (bt_obstacle){.n = n, .x = cx, .y = cy, .radius = r};
            for (int k = 0; k < n; k++) {
                obstacle->v[2 * k] = cx + (v[2 * k] - moments.cx);
                obstacle->v[2 * k + 1] = cy + (v[2 * k + 1] - moments.cy);
            }
            region->ice_area -= area_inside(region, n, obstacle->v);
            const double *outer = sliver ? box : v, by = sliver ? 1 : grow;
            obstacle->n = sliver ? 4 : n;
            for (int k = 0; k < obstacle->n; k++) {
                obstacle->v[2 * k] = cx + by * (outer[2 * k] - moments.cx);
                obstacle->v[2 * k + 1] = cy + by * (outer[2 * k + 1] - moments.cy);
            }
        }
    return true;
}

static bool spans(double a0, double a1, double d0, double length)
{
    return fabs(a0 - d0) <= 1e-9 * length && fabs(a1 - d0 - length) <= 1e-9 * length;
}

static bool add_body(bt_region *region, const bt_case *input, int n, const double *own, double x, double z, double yaw)
{
    // A region that is part of a periodic domain is not periodic itself, but a body can reach into it over the edge.
    int over_x = bt_bound_wraps(input->domain.ends) && !region->periodic_x,
        over_y = input->domain.sides == BT_BOUND_PERIODIC && !region->periodic_y;
    for (int ix = -over_x; ix <= over_x; ix++)
        for (int iy = -over_y; iy <= over_y; iy++) {
            double v[2 * BT_MAX_VERTICES];
            memcpy(v, own, 2 * (size_t)n * sizeof *v);
            place(n, v, x + ix * input->domain.length, z + iy * input->domain.width, yaw);
            bt_parts parts;
            if (bt_outline_convex(n, v) || !bt_outline_split(n, v, &parts)) {
                if (!add_obstacle(region, n, v, false)) return false;
                continue;
            }
            for (int i = 0, at = 0; i < parts.n; at += parts.count[i++]) {
                double part[2 * BT_MAX_VERTICES];
                for (int k = 0; k < parts.count[i]; k++)
                    memcpy(part + 2 * k, v + 2 * parts.corner[at + k], 2 * sizeof *v);
                if (!add_obstacle(region, parts.count[i], part, true)) return false;
            }
        }
    return true;
}

bt_status bt_region_init(bt_region *region, const bt_case *input, double clearance, bt_errors *err)
{
    *region = (bt_region){
        .x0 = input->ice.x_min, .x1 = input->ice.x_max, .y0 = input->ice.y_min, .y1 = input->ice.y_max,
        .clearance = clearance};
    if (!(region->x1 > region->x0 && region->y1 > region->y0))
        return bt_fail(err, BT_ERR_CASE,
            "%s: ice region: x %g..%g m, y %g..%g m is empty; give ice.x_min < ice.x_max and ice.y_min < ice.y_max",
            bt_case_name(input), region->x0, region->x1, region->y0, region->y1);
    region->periodic_x = bt_bound_wraps(input->domain.ends) &&
                         spans(region->x0, region->x1, input->domain.x0, input->domain.length);
    region->periodic_y = input->domain.sides == BT_BOUND_PERIODIC &&
                         spans(region->y0, region->y1, input->domain.y0, input->domain.width);
    region->ice_area = (region->x1 - region->x0) * (region->y1 - region->y0);

    double v[2 * BT_MAX_VERTICES];
    int nv = bt_case_waterline(input, v);
    bool wide = nv < 3 || add_body(region, input, nv, v, input->body.x, input->body.y, input->body.yaw);
    for (bt_idx i = 0; i < input->n_floes && wide; i++) {
        const bt_floe_def *floe = &input->floes[i];
        nv = bt_case_floe_outline(floe, v);
        wide = nv < 3 || add_body(region, input, nv, v, floe->x, floe->y, floe->yaw);
    }
    if (!wide)
        return bt_fail(err, BT_ERR_CASE,
            "%s: body.width, floes: the towed body or a floe given by hand is too slender for gaps of %g m between it "
            "and the ice; use a wider one, or smaller floes (ice.size)",
            bt_case_name(input), clearance);
    if (!(region->ice_area > 0))
        return bt_fail(err, BT_ERR_CASE,
            "%s: ice region: the towed body and the floes given by hand cover all of it; enlarge the region",
            bt_case_name(input));
    return BT_OK;
}

void bt_region_of_domain(bt_region *region, const bt_case *input)
{
    bt_case whole = *input;
    bt_errors ignored = {0};
    whole.ice.x_min = input->domain.x0, whole.ice.x_max = input->domain.x0 + input->domain.length;
    whole.ice.y_min = input->domain.y0, whole.ice.y_max = input->domain.y0 + input->domain.width;
    bt_region_init(region, &whole, 0, &ignored);
    bt_errors_free(&ignored);
}

void bt_region_free(bt_region *region)
{
    free(region->obstacles);
    *region = (bt_region){0};
}

static double wrap(double x, double low, double high)
{
    double l = high - low;
    x -= l * floor((x - low) / l);
    return x < high ? x : low; // round-off may land on the upper edge
}

void bt_region_wrap(const bt_region *region, double *px, double *py)
{
    if (region->periodic_x) *px = wrap(*px, region->x0, region->x1);
    if (region->periodic_y) *py = wrap(*py, region->y0, region->y1);
}

// Clip a cell to the outer side of edge e of polygon o; returns the number of vertices in out.
static int cut_outside(int n, const double *v, int m, const double *o, int e, double *out)
{
    const double *p = o + 2 * e, *q = o + 2 * ((e + 1) % m);
    double nx = q[1] - p[1], ny = p[0] - q[0], l = bt_hypot(nx, ny); // outward normal of an anticlockwise edge
    if (l == 0) return 0;
    return bt_shape_clip(n, v, -nx / l, -ny / l, -(nx * p[0] + ny * p[1]) / l, out);
}

// Does an edge of polygon v have all of o on its outer side?
static bool edge_separates(int n, const double *v, int m, const double *o)
{
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * ((i + 1) % n);
        double nx = q[1] - p[1], ny = p[0] - q[0];
        bool all = true;
        for (int k = 0; k < m && all; k++) all = nx * (o[2 * k] - p[0]) + ny * (o[2 * k + 1] - p[1]) >= 0;
        if (all) return true;
    }
    return false;
}

int bt_tessellation_clear(const bt_region *region, int n, double *v, bool boxed)
{
    enum { CAP = 2 * BT_MAX_VERTICES };
    double trial[2 * CAP], best[2 * CAP];
    for (int k = 0; k < region->n_obstacles && n >= 3; k++) {
        if (n > 4 * BT_TESSELLATION_VERTICES) // many obstacles around one cell
            n = bt_tessellation_clean(n, v, 0, BT_TESSELLATION_VERTICES);
        const bt_obstacle *obstacle = &region->obstacles[k];
        const bt_box cell = bt_box_of(n, v);
        if (cell.low[0] > obstacle->x + obstacle->radius || cell.high[0] < obstacle->x - obstacle->radius ||
            cell.low[1] > obstacle->y + obstacle->radius || cell.high[1] < obstacle->y - obstacle->radius) continue;
        const double *outline = obstacle->v;
        int m = obstacle->n;
        double box[8];
        if (boxed) {
            const bt_box b = bt_box_of(m, outline);
            memcpy(box, (double[8]){b.low[0], b.low[1], b.high[0], b.low[1], b.high[0], b.high[1], b.low[0], b.high[1]},
                   sizeof box);
            outline = box;
            m = 4;
        }
        if (edge_separates(n, v, m, outline)) continue;
        // An edge of the obstacle that separates leaves the cell whole and so wins.
        int n_best = 0;
        double best_area = 0;
        for (int e = 0; e < m; e++) {
            int nt = cut_outside(n, v, m, outline, e, trial);
            double area = nt >= 3 ? bt_shape_centroid(nt, trial).area : 0;
            if (area > best_area) {
                best_area = area;
                n_best = nt;
                memcpy(best, trial, 2 * (size_t)nt * sizeof *best);
            }
        }
        n = n_best;
        memcpy(v, best, 2 * (size_t)n * sizeof *v);
    }
    return n;
}

int bt_tessellation_clean(int n, double *v, double shortest, int most)
{
    // A subset of the vertices of a convex polygon is convex and lies inside it. Of the shortest edge's two ends, the
    // one whose removal costs less area goes.
    while (n > 3) {
        int at = 0;
        double least = INFINITY;
        for (int i = 0; i < n; i++) {
            int j = (i + 1) % n;
            double l = bt_hypot(v[2 * j] - v[2 * i], v[2 * j + 1] - v[2 * i + 1]);
            if (l < least) least = l, at = i;
        }
        if (least >= shortest && n <= most) break;
        double loss[2];
        for (int e = 0; e < 2; e++) {
            const double *p = v + 2 * ((at + e + n - 1) % n), *q = v + 2 * ((at + e) % n),
                         *r = v + 2 * ((at + e + 1) % n);
            loss[e] = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        }
        int gone = (at + (loss[1] < loss[0])) % n;
        memmove(v + 2 * gone, v + 2 * (gone + 1), 2 * (size_t)(n - gone - 1) * sizeof *v);
        n--;
    }
    return n;
}
