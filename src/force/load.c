// SPDX-License-Identifier: MIT
// A body as force laws see it, and the load on it at a velocity; equations in bergtow/forces.h.
#include "force/load.h"

/// Form drag of a stream along the convex hull of the outline of body i, form · v max(0, −v·n) dl; (rx, ry): U_ref − U, w: ω. On an
/// edge v is linear and n constant, so that g = form max(0, −v·n) dl and its moments to r² are polynomials up to the
/// third degree where water comes in: two points of Gauss are exact.
static void add_outline(const bt_bodies *b, bt_idx i, double rx, double ry, double w, const bt_stream *stream, bt_linear *l)
{
    const double form = stream->form, ref_x = stream->u, ref_y = stream->v;
    if (form == 0 || (rx == 0 && ry == 0 && w == 0)) return;
    const double gauss = 0.57735026918962576451; // 1/√3
    const int n = bt_body_corners(b, i);
    const double *v = b->outline + 2 * b->offset[i];
    const bt_mark *mark = b->mark + b->offset[i];
    for (int k = 0; k < n; k++) {
        if (mark[k].next == k) continue;
        const double *p = v + 2 * k, *q = v + 2 * mark[k].next, ex = q[0] - p[0], ey = q[1] - p[1];
        // Inflow −v·n times the length of the edge, at its ends.
        const double in0 = -((rx + w * p[1]) * ey - (ry - w * p[0]) * ex), in1 = -((rx + w * q[1]) * ey - (ry - w * q[0]) * ex);
        if (in0 <= 0 && in1 <= 0) continue;
        const double from = in0 < 0 ? in0 / (in0 - in1) : 0, to = in1 < 0 ? in0 / (in0 - in1) : 1;
        for (int side = -1; side <= 1; side += 2) {
            const double s = 0.5 * (from + to + side * gauss * (to - from));
            const double g = 0.5 * (to - from) * form * bt_max(0, in0 + s * (in1 - in0)), x = p[0] + s * ex, y = p[1] + s * ey;
            l->g += g;
            l->gx += g * x;
            l->gy += g * y;
            l->gw += g * (x * x + y * y);
            l->jx += g * ref_x;
            l->jy += g * ref_y;
            l->jw += g * (x * ref_y - y * ref_x);
        }
    }
}

bt_linear bt_load_implicit(const bt_bodies *b, bt_idx i, const bt_load *l, const bt_vel *u)
{
    bt_linear a = bt_load_linear(l, u->w);
    for (int k = 0; k < l->n_streams; k++) {
        const bt_stream *s = &l->stream[k];
        const double rx = s->u - u->x, ry = s->v - u->y;
        bt_linear_add_skin(&a, s, sqrt(rx * rx + ry * ry));
    }
    for (int k = 0; k < l->n_streams; k++) {
        const bt_stream *s = &l->stream[k];
        add_outline(b, i, s->u - u->x, s->v - u->y, u->w, s, &a);
    }
    return a;
}

bt_force_body bt_forces_body(const bt_world *w, bt_idx i, const bt_vel *u)
{
    const bt_bodies *b = &w->bodies;
    const bt_pose *p = &b->pose[i];
    const double *at = w->forces->towed_at;
    const bool towed = b->gid[i] == w->towed, led = towed && !isnan(at[0]);
    return (bt_force_body){
        .par = &w->par,
        .drag = &b->drag[i],
        .vel = *u,
        .time = ((double)w->step + 0.5) * w->par.dt,
        .x = led ? at[0] : p->x,
        .y = led ? at[1] : p->y,
        .yaw = p->yaw,
        .mass = b->mass[i],
        .inertia = b->inertia[i],
        .share = b->share[i],
        .radius = b->radius[i],
        .area = b->area[i],
        .thickness = b->thickness[i],
        .towed = towed,
    };
}

void bt_forces_load(const bt_world *w, bt_force_body *b, bt_load *l)
{
    bt_load_clear(l);
    bt_load_add(w->forces, 0, w->forces->n, b, l);
}
