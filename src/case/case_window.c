// SPDX-License-Identifier: MIT
// Case keys of the moving window (domain.ends: moving): defaults that follow from other keys, and what it cannot follow
// or take along.
#include <math.h>
#include <stdio.h>

#include "case/case_check.h"
#include "base/elementary.h"

static const double share_ahead = 0.6; // of the window, assumed
static const double room = 4;          // floe sizes of ice ahead and behind, at least

double bt_case_window_ahead(const bt_case *c)
{
    const double length = c->domain.length,
                 ahead = bt_case_tow_sign(c) > 0 ? c->domain.x0 + length - c->body.x : c->body.x - c->domain.x0;
    return ahead > 0 && ahead <= length ? ahead : length;
}

static double ahead_of(const bt_case *c)
{
    return isnan(c->domain.ahead) ? share_ahead * c->domain.length : c->domain.ahead;
}

void bt_case_window_face(bt_case *c, double x)
{
    if (!isnan(c->body.x)) return;
    const double x0 = isnan(c->domain.x0) ? 0 : c->domain.x0, back = x0 + ahead_of(c),
                 on = x0 + c->domain.length - ahead_of(c);
    c->body.x = x < on ? back : on; // what lies between the two is ahead of the one, and a way back from the other
}

void bt_case_window_follow(bt_case *c)
{
    const double sign = bt_case_tow_sign(c), length = c->domain.length, ahead = ahead_of(c);
    if (c->domain.frame == BT_FRAME_GEOGRAPHIC && isnan(c->body.x)) c->body.x = 0;
    if (isnan(c->domain.x0))
        c->domain.x0 = c->domain.frame == BT_FRAME_BASIN ? 0
                       : sign > 0                        ? c->body.x + ahead - length
                                                         : c->body.x - ahead;
    if (isnan(c->body.x)) c->body.x = sign > 0 ? c->domain.x0 + length - ahead : c->domain.x0 + ahead;
}

/// First fault: its key, and why with remedy; NULL = none. The body reaches from x_min to x_max about its centroid.
static const char *find_fault(const bt_case *c, bool ahead_given, double x_min, double x_max, char why[256])
{
    const double sign = bt_case_tow_sign(c), ahead = c->domain.ahead, length = c->domain.length;
    const bool ice = bt_case_makes_ice(c) || bt_case_reads_field(c) || c->n_floes > 0;
    const double floe = ice ? bt_case_mean_size(c) : 0;
    if (c->domain.ends != BT_BOUND_MOVING) {
        // the resolved file has every key
        if (!ahead_given || fabs(ahead - bt_case_window_ahead(c)) <= 1e-9 * length) return NULL;
        snprintf(why, 256, "%g m has no effect without domain.ends: moving; set it or remove the key", ahead);
        return "domain.ahead";
    }
    if (c->body.shape == BT_BODY_ABSENT || c->tow.mode == BT_TOW_NONE) {
        snprintf(why, 256, "moving follows a body that is towed, and here is none (body.shape, tow.mode); "
                           "set domain.ends: periodic or open, or tow a body");
        return "domain.ends";
    }
    if (fabs(bt_cos(c->tow.direction)) < 0.5) {
        snprintf(
            why, 256,
            "%g deg: a moving window goes along x; tow within 60 deg of that, or set domain.ends: periodic or open",
            c->tow.direction * 180 / BT_PI);
        return "tow.direction";
    }
    if (sign * c->water.current_x > 0 && sign * c->water.current_x >= c->tow.speed * fabs(bt_cos(c->tow.direction))) {
        snprintf(why, 256,
                 "%g m/s carries the ice along as fast as the tow, and a moving window takes in ice ahead only; "
                 "set domain.ends: periodic or open",
                 c->water.current_x);
        return "water.current_x";
    }
    const double there = sign > 0 ? c->domain.x0 + length - c->body.x : c->body.x - c->domain.x0;
    if (fabs(ahead - there) > 1e-9 * length && c->lead.mode != BT_LEAD_NONE) {
        snprintf(why, 256,
                 "%g m, and by domain.x0 and body.x it is %g m from the body to the front end of the domain, where the "
                 "lead is cut; leave domain.ahead out, or give domain.x0: %g m",
                 ahead, there, sign > 0 ? c->body.x + ahead - length : c->body.x - ahead);
        return "domain.ahead";
    }
    const double front = sign > 0 ? x_max : -x_min, stern = sign > 0 ? -x_min : x_max;
    if (ahead < front + room * floe || length - ahead < stern + room * floe) {
        snprintf(why, 256,
                 "%g m of the %g m of domain.length: %g floe sizes, %g m, are needed ahead of the body and behind it; "
                 "move the body or take a longer domain",
                 ahead, length, room, room * floe);
        return "domain.ahead";
    }
    if (c->domain.sides_closing != 0) {
        snprintf(why, 256,
                 "%g m/s: closing walls leave no room for the ice that enters a moving window; remove the key, or set "
                 "domain.ends: periodic",
                 c->domain.sides_closing);
        return "domain.sides_closing";
    }
    for (bt_idx i = 0; i < c->n_floes; i++) {
        if (!c->floes[i].fixed) continue;
        snprintf(why, 256,
                 "moving cannot take floes[%d] along, which is fixed; remove it, or set domain.ends: periodic or open",
                 (int)i);
        return "domain.ends";
    }
    return NULL;
}

void bt_case_check_window(const bt_check *k, int n, const double *v)
{
    const bt_case *c = k->c;
    if (!bt_check_sound(k,
                        "domain.ends domain.length domain.x0 domain.ahead domain.sides_closing tow.mode tow.direction "
                        "tow.speed water.current_x body.x body.yaw body.shape ice.size ice.size_min ice.size_max "
                        "ice.size_exponent"))
        return;
    if (c->body.shape != BT_BODY_ABSENT && n == 0) return; // its outline was refused
    double x_min = 0, x_max = 0;
    for (int i = 0; i < n; i++) {
        const double x = bt_cos(c->body.yaw) * v[2 * i] - bt_sin(c->body.yaw) * v[2 * i + 1];
        x_min = bt_min(x_min, x);
        x_max = bt_max(x_max, x);
    }
    char why[256];
    const char *key = find_fault(c, bt_check_given(k, "domain.ahead"), x_min, x_max, why);
    if (key) bt_check_fault(k, key, "%s", why);
}
