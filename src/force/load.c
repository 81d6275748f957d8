// SPDX-License-Identifier: MIT
// The load on a body, and all that is implicit of it at a velocity; equations in bergtow/forces.h.
#include "force/load.h"

/// Dampers g = form max(0, −v·n) dl at the arms a = t (t·r) + τ n (n·r); (rx, ry): U_ref − U, w: ω. On an edge v and a
/// are linear and n constant, so that g and its moments to a² are polynomials up to the third degree where water comes
/// in: two points of Gauss are exact.
void bt_linear_add_outline(const bt_bodies *b, bt_idx i, bt_stream stream, double rx, double ry, double w, bt_linear *a)
{
    const double form = stream.form, ref_x = stream.u, ref_y = stream.v, share = b->drag[i].tangential;
    const double gauss = 0.57735026918962576451; // 1/√3
    const int n = bt_body_corners(b, i);
    const double *v = b->outline + 2 * b->offset[i];
    const bt_mark *mark = b->mark + b->offset[i];
    for (int k = 0; k < n; k++) {
        if (mark[k].next == k) continue;
        const double *p = v + 2 * k, *q = v + 2 * mark[k].next, ex = q[0] - p[0], ey = q[1] - p[1];
        // Inflow −v·n times the length of the edge, at its ends.
        const double in0 = -((rx + w * p[1]) * ey - (ry - w * p[0]) * ex),
                     in1 = -((rx + w * q[1]) * ey - (ry - w * q[0]) * ex);
        if (in0 <= 0 && in1 <= 0) continue;
        const double from = in0 < 0 ? in0 / (in0 - in1) : 0, to = in1 < 0 ? in0 / (in0 - in1) : 1;
        const double along = (1 - share) / (ex * ex + ey * ey);
        for (int side = -1; side <= 1; side += 2) {
            const double s = 0.5 * (from + to + side * gauss * (to - from));
            const double g = 0.5 * (to - from) * form * bt_max(0, in0 + s * (in1 - in0));
            const double at_x = p[0] + s * ex, at_y = p[1] + s * ey, way = along * (at_x * ex + at_y * ey);
            const double x = share * at_x + way * ex, y = share * at_y + way * ey;
            a->g += g;
            a->gx += g * x;
            a->gy += g * y;
            a->gw += g * (x * x + y * y);
            a->jx += g * ref_x;
            a->jy += g * ref_y;
            a->jw += g * (x * ref_y - y * ref_x);
        }
    }
}

void bt_forces_load(const bt_world *w, bt_idx i, const bt_vel *u, bt_load *l)
{
    bt_force_body b = bt_load_body(w, i, u);
    bt_load_clear(l);
    bt_load_fill(w->forces, 0, &b, l);
}
