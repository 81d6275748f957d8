// SPDX-License-Identifier: MIT
// Legs and arcs of a path; see geometry/path.h.
#include "geometry/path.h"
#include "base/elementary.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static void add_leg(bt_path *p, bt_leg leg)
{
    if (p->n > 0) leg.way = p->leg[p->n - 1].way + p->leg[p->n - 1].length;
    p->leg[p->n++] = leg;
}

bool bt_path_make(bt_path *p, double x, double y, int n, const double *points, double radius, char why[200])
{
    *p = (bt_path){.leg = bt_alloc(2 * (size_t)n + 1, sizeof *p->leg),
                   .mark = bt_alloc((size_t)n + 1, sizeof *p->mark),
                   .n_marks = n};
    double tx = 1, ty = 0, used = 0; // of the leg at hand: tangent, and what the corner behind has taken of it
    for (int k = 0; k < n; k++) {
        const double px = points[2 * k], py = points[2 * k + 1], far = bt_hypot(px - x, py - y);
        if (!(far > 0)) {
            snprintf(why, 200, "way-point %d is where the one before it (or the start) is; remove one of them", k + 1);
            bt_path_free(p);
            return false;
        }
        tx = (px - x) / far, ty = (py - y) / far;
        double cut = 0, angle = 0, ox = tx, oy = ty;
        if (k + 1 < n) {
            const double nx = points[2 * k + 2] - px, ny = points[2 * k + 3] - py, next = bt_hypot(nx, ny);
            if (next > 0) ox = nx / next, oy = ny / next;
            angle = bt_atan2(tx * oy - ty * ox, tx * ox + ty * oy);
            // Not tan of half an angle of 180°, which is large but finite.
            if (radius > 0 && angle != 0)
                cut = fabs(angle) < BT_PI - 1e-6 ? radius * bt_tan(0.5 * fabs(angle)) : INFINITY;
        }
        if (used + cut > far) {
            snprintf(why, 200,
                     "the course change of %.4g deg at way-point %d leaves no room for a turn of radius %.4g m on a "
                     "leg of %.4g m; lower tow.turn_radius or move the way-point",
                     fabs(angle) * 180 / BT_PI, k + 1, radius, far);
            bt_path_free(p);
            return false;
        }
        add_leg(p, (bt_leg){.length = far - used - cut, .x = x + used * tx, .y = y + used * ty, .tx = tx, .ty = ty});
        p->mark[k] = p->leg[p->n - 1].way + p->leg[p->n - 1].length;
        if (cut > 0) {
            const double arc = radius * fabs(angle);
            add_leg(p, (bt_leg){.length = arc,
                                .x = px - cut * tx,
                                .y = py - cut * ty,
                                .tx = tx,
                                .ty = ty,
                                .turn = copysign(1 / radius, angle)});
            p->mark[k] += 0.5 * arc;
        }
        used = cut;
        x = px, y = py;
    }
    add_leg(p, (bt_leg){.length = INFINITY, .x = x, .y = y, .tx = tx, .ty = ty});
    return true;
}

static const bt_leg *leg_at(const bt_path *p, double way)
{
    int k = 0;
    while (k + 1 < p->n && way >= p->leg[k + 1].way) k++;
    return &p->leg[k];
}

void bt_leg_at(const bt_leg *l, double way, double at[2], double tangent[2])
{
    double along = way, aside = 0, c = 1, d = 0;
    if (l->turn != 0) {
        c = bt_cos(way * l->turn), d = bt_sin(way * l->turn);
        along = d / l->turn, aside = (1 - c) / l->turn;
    }
    at[0] = l->x + along * l->tx - aside * l->ty;
    at[1] = l->y + along * l->ty + aside * l->tx;
    tangent[0] = c * l->tx - d * l->ty;
    tangent[1] = c * l->ty + d * l->tx;
}

void bt_path_at(const bt_path *p, double way, double at[2], double tangent[2])
{
    const bt_leg *l = leg_at(p, way);
    bt_leg_at(l, way - l->way, at, tangent);
}

double bt_path_near(const bt_path *p, double way, double x, double y)
{
    enum { STEPS = 8 };
    for (int k = 0; k < STEPS; k++) {
        double at[2], t[2];
        bt_path_at(p, way, at, t);
        const double along = (x - at[0]) * t[0] + (y - at[1]) * t[1], turn = leg_at(p, way)->turn;
        if (turn == 0) {
            way += along;
            continue;
        }
        // by the angle about the centre, which lies 1/turn to the left
        const double aside = (y - at[1]) * t[0] - (x - at[0]) * t[1];
        way += bt_atan2(turn * along, 1 - turn * aside) / turn;
    }
    return way;
}

void bt_path_free(bt_path *p)
{
    free(p->leg);
    free(p->mark);
    *p = (bt_path){0};
}
