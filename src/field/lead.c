// SPDX-License-Identifier: MIT
// The lead ahead of the towed body; model in field/lead.h.
#include "field/lead.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/shape.h"
#include "field/field_make.h"
#include "case/case_tow.h"
#include "geometry/path.h"
#include "base/elementary.h"
#include "base/largest.h"

static const double SLIT = 1e-4;        // width of a cut / diameter of the largest piece, assumed
static const double SHORT_EDGE = 0.01;  // edges shorter than this are removed / √area of a piece
enum { JOINT = 32, ROOM = BT_MAX_VERTICES + 2 };

/// One convex part of the strip: a leg, or the disc at a joint.
typedef struct {
    int n;
    double v[2 * JOINT]; ///< about (x, y), m
    double x, y, radius; ///< bounding circle, m
} part;

typedef struct {
    const bt_lead *l;
    part *parts;
    int n;
} strip;

static strip make_strip(const bt_lead *lead)
{
    strip s = {.l = lead, .parts = bt_alloc(2 * (size_t)lead->n, sizeof *s.parts)};
    const double half = 0.5 * lead->width;
    for (int i = 0; i + 1 < lead->n; i++) {
        const double *p = lead->path + 2 * i, *q = p + 2, dx = q[0] - p[0], dy = q[1] - p[1], length = bt_hypot(dx, dy);
        if (length > 0) {
            const double ax = 0.5 * dx, ay = 0.5 * dy, bx = -half * dy / length, by = half * dx / length;
            s.parts[s.n++] = (part){.n = 4,
                                    .v = {-ax - bx, -ay - by, ax - bx, ay - by, ax + bx, ay + by, bx - ax, by - ay},
                                    .x = p[0] + ax,
                                    .y = p[1] + ay,
                                    .radius = bt_hypot(0.5 * length, half)};
        }
        if (i == 0) continue;
        part *joint = &s.parts[s.n++];
        *joint = (part){.n = JOINT, .x = p[0], .y = p[1]};
        bt_shape_regular(JOINT, BT_PI * half * half, joint->v);
        joint->radius = bt_hypot(joint->v[0], joint->v[1]);
    }
    return s;
}

/// First and last period by which the image of a part, at x from a floe, comes within `reach` of the floe.
static void images(double x, double reach, double period, int *first, int *last)
{
    *first = *last = 0;
    if (!(period > 0)) return;
    *first = (int)ceil((x - reach) / period);
    *last = (int)floor((x + reach) / period);
}

/// Does the convex polygon v, about its centroid at (x, y), overlap the strip?
static bool overlaps(const strip *s, int n, const double *v, double radius, double x, double y)
{
    const double slack = 1e-9 * s->l->width;
    for (int k = 0; k < s->n; k++) {
        const part *p = &s->parts[k];
        const double dx = p->x - x, dy = p->y - y, reach = p->radius + radius;
        int i0, i1, j0, j1;
        images(dx, reach, s->l->period_x, &i0, &i1);
        images(dy, reach, s->l->period_y, &j0, &j1);
        for (int i = i0; i <= i1; i++)
            for (int j = j0; j <= j1; j++) {
                const double ox = dx - i * s->l->period_x, oy = dy - j * s->l->period_y;
                if (bt_hypot(ox, oy) < reach && bt_apart_of(n, v, p->n, p->v, ox, oy).gap < -slack) return true;
            }
    }
    return false;
}

/// Unit vector of the axis of the largest second moment of area about the centroid: along the longer extent. The second
/// moments of triangle (0, p, q) of area a are a/12 (p p + q q + (p+q)(p+q)).
static void long_axis(int n, const double *v, double axis[2])
{
    double xx = 0, yy = 0, xy = 0;
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * (i + 1 < n ? i + 1 : 0), a = p[0] * q[1] - p[1] * q[0],
                     sx = p[0] + q[0], sy = p[1] + q[1];
        xx += a * (p[0] * p[0] + q[0] * q[0] + sx * sx);
        yy += a * (p[1] * p[1] + q[1] * q[1] + sy * sy);
        xy += a * (p[0] * p[1] + q[0] * q[1] + sx * sy);
    }
    const double angle = 0.5 * bt_atan2(2 * xy, xx - yy);
    axis[0] = bt_cos(angle), axis[1] = bt_sin(angle);
}

/// Drop vertices at short edges: the rest is convex and lies within.
static int drop_short_edges(int n, double *v)
{
    const double shortest = SHORT_EDGE * sqrt(bt_shape_centroid(n, v).area);
    for (int i = 0; i < n && n > 3;) {
        const int j = i + 1 < n ? i + 1 : 0;
        if (bt_hypot(v[2 * j] - v[2 * i], v[2 * j + 1] - v[2 * i + 1]) >= shortest) {
            i++;
            continue;
        }
        n--;
        memmove(v + 2 * j, v + 2 * (j + 1), 2 * (size_t)(n - j) * sizeof *v);
        i = 0;
    }
    return n;
}

typedef struct {
    const strip *s;
    double largest;    ///< area of the largest piece in the strip, m²
    double x, y, c, sine, yaw, thickness; ///< of the floe that is cut
    bt_field *out;
} saw;

/// Cut the polygon v (frame of the floe, room for ROOM vertices) until its pieces are small enough, and add them to the
/// field.
static void cut(const saw *k, int n, const double *v)
{
    double own[2 * ROOM], world[2 * ROOM], half[2 * ROOM], axis[2];
    memcpy(own, v, 2 * (size_t)n * sizeof *v);
    const bt_moments moments = bt_shape_centre(n, own);
    for (int i = 0; i < n; i++) {
        world[2 * i] = k->c * own[2 * i] - k->sine * own[2 * i + 1];
        world[2 * i + 1] = k->sine * own[2 * i] + k->c * own[2 * i + 1];
    }
    const double x = k->x + k->c * moments.cx - k->sine * moments.cy,
                 y = k->y + k->sine * moments.cx + k->c * moments.cy;
    if (moments.area <= k->largest || !overlaps(k->s, n, world, moments.radius, x, y)) {
        bt_field_add(k->out, n, v, k->x, k->y, k->yaw, k->thickness);
        return;
    }
    long_axis(n, own, axis);
    const double slit = SLIT * k->s->l->floe_size;
    for (int side = -1; side <= 1; side += 2) {
        int nh = bt_shape_clip(n, own, side * axis[0], side * axis[1], -0.5 * slit, half);
        nh = drop_short_edges(nh, half);
        for (int i = 0; i < nh; i++) half[2 * i] += moments.cx, half[2 * i + 1] += moments.cy;
        cut(k, nh, half);
    }
}

static void cut_floe(const strip *s, const bt_field *field, bt_idx i, bt_field *out)
{
    const double *pose = field->pose + 3 * (size_t)i, size = s->l->floe_size;
    const saw k = {.s = s,
                   .largest = BT_PI / 4 * size * size,
                   .x = pose[0],
                   .y = pose[1],
                   .c = bt_cos(pose[2]),
                   .sine = bt_sin(pose[2]),
                   .yaw = pose[2],
                   .thickness = field->thickness[i],
                   .out = out};
    const bt_idx first = out->n;
    cut(&k, (int)(field->offsets[i + 1] - field->offsets[i]), field->vertices + 2 * field->offsets[i]);
    double area = 0;
    for (bt_idx p = first; p < out->n; p++) area += out->area[p];
    const double low[2] = {s->l->x0, s->l->y0}, period[2] = {s->l->period_x, s->l->period_y};
    for (bt_idx p = first; p < out->n; p++) {
        out->thickness[p] *= field->area[i] / area;
        for (size_t d = 0; d < 2; d++) { // a piece of a floe on a periodic edge may lie beyond it
            double *at = &out->pose[3 * (size_t)p + d];
            if (period[d] > 0) *at -= period[d] * floor((*at - low[d]) / period[d]);
        }
    }
}

/// Mark the floes that overlap the strip, and add up their area.
static void mark(const strip *s, const bt_field *field, uint8_t *taken, bt_lead_stats *st)
{
    double *outline = bt_field_outlines(field);
    for (bt_idx i = 0; i < field->n; i++) {
        const int n = (int)(field->offsets[i + 1] - field->offsets[i]);
        const double *v = outline + 2 * field->offsets[i];
        taken[i] = overlaps(s, n, v, bt_shape_area_moments(n, v).radius, field->pose[3 * (size_t)i],
                            field->pose[3 * (size_t)i + 1]);
        if (!taken[i]) continue;
        st->taken++;
        st->area_taken += field->area[i];
    }
    free(outline);
}

static void copy(const bt_field *field, bt_idx i, bt_field *out)
{
    const int64_t n = field->offsets[i + 1] - field->offsets[i], at = out->offsets[out->n];
    const bt_idx k = out->n;
    bt_field_add(out, (int)n, field->vertices + 2 * field->offsets[i], field->pose[3 * (size_t)i],
                 field->pose[3 * (size_t)i + 1], field->pose[3 * (size_t)i + 2], field->thickness[i]);
    // Restore it to the bit: bt_field_add has centred it again.
    memcpy(out->vertices + 2 * at, field->vertices + 2 * field->offsets[i], 2 * (size_t)n * sizeof *field->vertices);
    memcpy(out->pose + 3 * (size_t)k, field->pose + 3 * (size_t)i, 3 * sizeof *field->pose);
    out->area[k] = field->area[i];
}

bt_status bt_lead_cut(const bt_lead *lead, bt_field *field, bt_lead_stats *st, bt_errors *err)
{
    *st = (bt_lead_stats){.mode = lead->mode,
                          .width = lead->width,
                          .concentration_before = field->concentration,
                          .concentration_after = field->concentration};
    for (int i = 0; i + 1 < lead->n; i++)
        st->length += bt_hypot(lead->path[2 * i + 2] - lead->path[2 * i],
                               lead->path[2 * i + 3] - lead->path[2 * i + 1]);
    if (lead->mode == BT_LEAD_NONE || field->n == 0) return BT_OK;
    strip s = make_strip(lead);
    uint8_t *taken = bt_alloc((size_t)field->n, sizeof *taken);
    mark(&s, field, taken, st);
    // A cut through the centroid leaves at least 4/9 of the area on each side (Winternitz), and only pieces larger than
    // allowed are cut.
    const double most =
        lead->mode == BT_LEAD_MANAGED ? 2.25 * st->area_taken / (BT_PI / 4 * lead->floe_size * lead->floe_size) : 0;
    bt_status status = BT_OK;
    if (most > BT_MAX_FLOES)
        status = bt_fail(err, BT_ERR_CASE,
            "%s: lead.floe_size: %g m makes up to %.3g pieces, more than the limit of %d; use larger pieces, or a "
            "narrower or shorter lead",
            lead->name, lead->floe_size, most, BT_MAX_FLOES);
    if (status == BT_OK) {
        bt_field out = bt_field_like(field);
        double pieces = 0;
        for (bt_idx i = 0; i < field->n; i++) {
            const bt_idx first = out.n;
            if (!taken[i]) copy(field, i, &out);
            else if (lead->mode == BT_LEAD_MANAGED) cut_floe(&s, field, i, &out);
            for (bt_idx p = first; taken[i] && p < out.n; p++, st->pieces++) pieces += sqrt(4 * out.area[p] / BT_PI);
        }
        out.concentration = st->concentration_after =
            field->ice_area > 0 ? bt_field_floe_area(&out) / field->ice_area : 0;
        st->mean_piece = st->pieces > 0 ? pieces / (double)st->pieces : 0;
        bt_field_free(field);
        *field = out;
    }
    free(taken);
    free(s.parts);
    return status;
}

/// Area of the floes within the ice region, m². Ice that was read may lie partly outside, where it does not count.
static double area_in_region(const bt_case *input, const bt_region *region, const bt_field *field)
{
    double area = 0, v[2 * BT_MAX_VERTICES];
    for (bt_idx i = 0; i < field->n; i++) {
        const double *p = field->pose + 3 * (size_t)i, s = bt_sin(p[2]), k = bt_cos(p[2]);
        const int n = (int)(field->offsets[i + 1] - field->offsets[i]);
        for (int j = 0; j < n; j++) {
            const double *own = field->vertices + 2 * (field->offsets[i] + j);
            v[2 * j] = p[0] + k * own[0] - s * own[1];
            v[2 * j + 1] = p[1] + s * own[0] + k * own[1];
        }
        area += bt_region_area_of(region, input, n, v);
    }
    return area;
}

/// The points of a path, and the length still to go.
typedef struct {
    double *at; ///< [n][2]
    int n;
    double left;
} planned;

/// Extend the path to (x, y), or as far towards it as the remaining length allows.
static void add_leg(planned *p, double x, double y)
{
    const double *last = p->at + 2 * (p->n - 1), dx = x - last[0], dy = y - last[1], far = bt_hypot(dx, dy);
    if (far == 0 || p->left <= 0) return;
    const double share = bt_min(far, p->left) / far;
    p->at[2 * p->n] = last[0] + share * dx;
    p->at[2 * p->n + 1] = last[1] + share * dy;
    p->left -= share * far;
    p->n++;
}

/// Path from the body to the start of the path of the towing end, then along that path, arcs in pieces; lead.length in
/// all. Without way-points, straight ahead of the body. Caller frees; NULL with the reason in why.
static double *planned_path(const bt_case *input, int *n, char why[200])
{
    enum { PIECES = 64 }; // of an arc: within 3e-4 of its radius for half a turn
    bt_path path;
    if (!bt_case_tow_path(input, &path, why)) return NULL;
    planned p = {.at = bt_alloc(2 + PIECES * (size_t)path.n, 2 * sizeof *p.at), .n = 1, .left = input->lead.length};
    p.at[0] = input->body.x;
    p.at[1] = input->body.y;
    if (input->tow.n_waypoints == 0)
        add_leg(&p, input->body.x + input->lead.length * bt_cos(input->tow.direction),
                input->body.y + input->lead.length * bt_sin(input->tow.direction));
    for (int k = 0; input->tow.n_waypoints > 0 && k < path.n; k++) {
        const bt_leg *leg = &path.leg[k];
        const int pieces = leg->turn != 0 ? PIECES : 1;
        add_leg(&p, leg->x, leg->y);
        for (int i = 1; i <= pieces && p.left > 0; i++) {
            double at[2], tangent[2];
            bt_path_at(&path, leg->way + (isinf(leg->length) ? p.left : leg->length * i / pieces), at, tangent);
            add_leg(&p, at[0], at[1]);
        }
    }
    bt_path_free(&path);
    *n = p.n;
    return p.at;
}

bt_status bt_lead_open(const bt_case *input, bt_field *field, bt_lead_stats *stats, bt_errors *err)
{
    *stats = (bt_lead_stats){0};
    if (input->lead.mode == BT_LEAD_NONE) return BT_OK;
    if (field->outlines.split > 0)
        return bt_fail(err, BT_ERR_CASE,
                       "%s: lead.mode: %lld floes of the field are not convex, but a lead cuts only convex floes; set "
                       "ice.nonconvex to hull, or draw the lead in the file",
                       bt_case_name(input), (long long)field->outlines.split);
    int n;
    char why[200];
    double *path = planned_path(input, &n, why);
    if (!path)
        return bt_fail(err, BT_ERR_CASE, "%s: tow.waypoints: %s", bt_case_name(input), why);
    const bt_lead lead = {
        .name = bt_case_name(input),
        .mode = input->lead.mode,
        .width = input->lead.width,
        .floe_size = input->lead.floe_size,
        .n = n,
        .path = path,
        .x0 = input->domain.x0,
        .y0 = input->domain.y0,
        // Also in a moving window: a floe at its rear may reach across the seam into a lead that ends at its front. A
        // longer lead lies along x (case/constraints.c), and goes round: it cuts the ice that the window takes in.
        .period_x = bt_bound_wraps(input->domain.ends) ? input->domain.length : 0,
        .period_y = input->domain.sides == BT_BOUND_PERIODIC ? input->domain.width : 0,
    };
    const double whole = bt_field_floe_area(field);
    const bool outside = whole - field->concentration * field->ice_area > 1e-9 * whole;
    bt_status status = bt_lead_cut(&lead, field, stats, err);
    free(path);
    if (status != BT_OK || !outside) return status;
    bt_case of = *input; // with the region that the concentration refers to
    if (input->ice.field) {
        const double *r = bt_outline_region(&field->outlines);
        if (!r) { // unknown: assume that the lead takes the same share of the ice inside as outside
            field->concentration = stats->concentration_before * (bt_field_floe_area(field) / whole);
            stats->concentration_after = NAN;
            return BT_OK;
        }
        of.ice.x_min = r[0], of.ice.y_min = r[1], of.ice.x_max = r[2], of.ice.y_max = r[3];
    }
    bt_region region;
    status = bt_region_init(&region, &of, 0, err);
    if (status == BT_OK)
        field->concentration = stats->concentration_after = area_in_region(&of, &region, field) / field->ice_area;
    bt_region_free(&region);
    return status;
}

void bt_lead_stats_print(const bt_lead_stats *stats)
{
    if (stats->mode == BT_LEAD_NONE) return;
    printf("  lead                %.4g m wide, %.4g m long: %lld floes (%.4g m2) ", stats->width, stats->length,
           (long long)stats->taken, stats->area_taken);
    if (stats->mode == BT_LEAD_CHANNEL) printf("removed");
    else printf("cut into %lld pieces of %.3g m", (long long)stats->pieces, stats->mean_piece);
    if (isnan(stats->concentration_after))
        printf("; concentration of the field's ice region, unknown from its file");
    else printf("; concentration %.4g", stats->concentration_after);
    printf(", was %.4g\n", stats->concentration_before);
}
