// SPDX-License-Identifier: MIT
// Legs and arcs of a path; see geometry/path.h.
#include "geometry/path.h"
#include "base/elementary.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static void add_leg(bt_path *path, bt_leg leg)
{
    if (path->n > 0) leg.way = path->leg[path->n - 1].way + path->leg[path->n - 1].length;
    path->leg[path->n++] = leg;
}

bool bt_path_make(bt_path *path, double x, double y, int n, const double *points, double radius, char why[200])
{
    *path = (bt_path){.leg = bt_alloc(2 * (size_t)n + 1, sizeof *path->leg),
                      .mark = bt_alloc((size_t)n + 1, sizeof *path->mark),
                      .n_marks = n};
    double tx = 1, ty = 0, used = 0; // of the present leg: tangent, and length used by the corner behind
    for (int k = 0; k < n; k++) {
        const double px = points[2 * k], py = points[2 * k + 1], far = bt_hypot(px - x, py - y);
        if (!(far > 0)) {
            snprintf(why, 200, "way-point %d is at the place of the previous one (or of the start); remove one of "
                               "them", k + 1);
            bt_path_free(path);
            return false;
        }
        tx = (px - x) / far, ty = (py - y) / far;
        double cut = 0, angle = 0, ox = tx, oy = ty;
        if (k + 1 < n) {
            const double nx = points[2 * k + 2] - px, ny = points[2 * k + 3] - py, next = bt_hypot(nx, ny);
            if (next > 0) ox = nx / next, oy = ny / next;
            angle = bt_atan2(tx * oy - ty * ox, tx * ox + ty * oy);
            // For 180° tan of half the angle would be large but finite.
            if (radius > 0 && angle != 0)
                cut = fabs(angle) < BT_PI - 1e-6 ? radius * bt_tan(0.5 * fabs(angle)) : INFINITY;
        }
        if (used + cut > far) {
            snprintf(why, 200,
                     "the course change of %.4g deg at way-point %d leaves no room for a turn of radius %.4g m on a "
                     "leg of %.4g m; lower tow.turn_radius or move the way-point",
                     fabs(angle) * 180 / BT_PI, k + 1, radius, far);
            bt_path_free(path);
            return false;
        }
        add_leg(path, (bt_leg){.length = far - used - cut, .x = x + used * tx, .y = y + used * ty, .tx = tx, .ty = ty});
        path->mark[k] = path->leg[path->n - 1].way + path->leg[path->n - 1].length;
        if (cut > 0) {
            const double arc = radius * fabs(angle);
            add_leg(path, (bt_leg){.length = arc,
                                   .x = px - cut * tx,
                                   .y = py - cut * ty,
                                   .tx = tx,
                                   .ty = ty,
                                   .turn = copysign(1 / radius, angle)});
            path->mark[k] += 0.5 * arc;
        }
        used = cut;
        x = px, y = py;
    }
    add_leg(path, (bt_leg){.length = INFINITY, .x = x, .y = y, .tx = tx, .ty = ty});
    return true;
}

static const bt_leg *leg_at(const bt_path *path, double way)
{
    int k = 0;
    while (k + 1 < path->n && way >= path->leg[k + 1].way) k++;
    return &path->leg[k];
}

void bt_leg_at(const bt_leg *leg, double way, double at[2], double tangent[2])
{
    double along = way, aside = 0, c = 1, d = 0;
    if (leg->turn != 0) {
        c = bt_cos(way * leg->turn), d = bt_sin(way * leg->turn);
        along = d / leg->turn, aside = (1 - c) / leg->turn;
    }
    at[0] = leg->x + along * leg->tx - aside * leg->ty;
    at[1] = leg->y + along * leg->ty + aside * leg->tx;
    tangent[0] = c * leg->tx - d * leg->ty;
    tangent[1] = c * leg->ty + d * leg->tx;
}

void bt_path_at(const bt_path *path, double way, double at[2], double tangent[2])
{
    const bt_leg *leg = leg_at(path, way);
    bt_leg_at(leg, way - leg->way, at, tangent);
}

double bt_path_near(const bt_path *path, double way, double x, double y)
{
    enum { STEPS = 8 };
    for (int k = 0; k < STEPS; k++) {
        double at[2], t[2];
        bt_path_at(path, way, at, t);
        const double along = (x - at[0]) * t[0] + (y - at[1]) * t[1], turn = leg_at(path, way)->turn;
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

void bt_path_free(bt_path *path)
{
    free(path->leg);
    free(path->mark);
    *path = (bt_path){0};
}
