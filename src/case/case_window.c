// SPDX-License-Identifier: MIT
// Case keys of the moving window (domain.ends: moving): defaults that follow from other keys, and checks of what the
// window cannot follow or carry along.

#include "case/case_check.h"
#include "base/elementary.h"

static const double share_ahead = 0.6; // of the window, assumed
static const double room = 4;          // floe sizes of ice ahead and behind, at least

double bt_case_window_ahead(const bt_case *input)
{
    const double length = input->domain.length,
                 ahead = bt_case_tow_sign(input) > 0 ? input->domain.x0 + length - input->body.x
                                                     : input->body.x - input->domain.x0;
    return ahead > 0 && ahead <= length ? ahead : length;
}

static double ahead_of(const bt_case *input)
{
    return isnan(input->domain.ahead) ? share_ahead * input->domain.length : input->domain.ahead;
}

void bt_case_window_face(bt_case *input, double x)
{
    if (!isnan(input->body.x)) return;
    const double x0 = isnan(input->domain.x0) ? 0 : input->domain.x0, back = x0 + ahead_of(input),
                 on = x0 + input->domain.length - ahead_of(input);
    input->body.x = x < on ? back : on; // x between the two is ahead of `on` and behind `back`: either will do
}

void bt_case_window_follow(bt_case *input)
{
    const double sign = bt_case_tow_sign(input), length = input->domain.length, ahead = ahead_of(input);
    if (input->domain.frame == BT_FRAME_GEOGRAPHIC && isnan(input->body.x)) input->body.x = 0;
    if (isnan(input->domain.x0))
        input->domain.x0 = input->domain.frame == BT_FRAME_BASIN ? 0
                           : sign > 0                        ? input->body.x + ahead - length
                                                             : input->body.x - ahead;
    if (isnan(input->body.x)) input->body.x = sign > 0 ? input->domain.x0 + length - ahead : input->domain.x0 + ahead;
}

/// First fault: its key, with the remedy in why; NULL = none. The body reaches from x_min to x_max about its centroid.
static const char *find_fault(const bt_case *input, bool ahead_given, double x_min, double x_max, char why[256])
{
    const double sign = bt_case_tow_sign(input), ahead = input->domain.ahead, length = input->domain.length;
    const bool ice = bt_case_makes_ice(input) || bt_case_reads_field(input) || input->n_floes > 0;
    const double floe = ice ? bt_case_mean_size(input) : 0;
    if (input->domain.ends != BT_BOUND_MOVING) {
        // a resolved file gives every key
        if (!ahead_given || fabs(ahead - bt_case_window_ahead(input)) <= 1e-9 * length) return NULL;
        snprintf(why, 256, "%g m has no effect without domain.ends: moving; set it or remove the key", ahead);
        return "domain.ahead";
    }
    if (input->body.shape == BT_BODY_ABSENT || input->tow.mode == BT_TOW_NONE) {
        snprintf(why, 256, "moving follows a towed body, but there is none (body.shape, tow.mode); set domain.ends: "
                           "periodic or open, or tow a body");
        return "domain.ends";
    }
    if (fabs(bt_cos(input->tow.direction)) < 0.5) {
        snprintf(
            why, 256,
            "%g deg: a moving window moves along x; tow within 60 deg of that, or set domain.ends: periodic or open",
            input->tow.direction * 180 / BT_PI);
        return "tow.direction";
    }
    if (sign * input->water.current_x > 0 &&
        sign * input->water.current_x >= input->tow.speed * fabs(bt_cos(input->tow.direction))) {
        snprintf(why, 256,
                 "%g m/s carries the ice along as fast as the tow, but a moving window takes in new ice only ahead; "
                 "set domain.ends: periodic or open",
                 input->water.current_x);
        return "water.current_x";
    }
    const double there = sign > 0 ? input->domain.x0 + length - input->body.x : input->body.x - input->domain.x0;
    if (fabs(ahead - there) > 1e-9 * length && input->lead.mode != BT_LEAD_NONE) {
        snprintf(why, 256,
                 "%g m, but by domain.x0 and body.x the front end of the domain, where the lead is cut, is %g m from "
                 "the body; leave domain.ahead out, or give domain.x0: %g m",
                 ahead, there, sign > 0 ? input->body.x + ahead - length : input->body.x - ahead);
        return "domain.ahead";
    }
    const double front = sign > 0 ? x_max : -x_min, stern = sign > 0 ? -x_min : x_max;
    if (ahead < front + room * floe || length - ahead < stern + room * floe) {
        snprintf(why, 256,
                 "%g m of the %g m of domain.length: %g floe sizes, %g m, are needed ahead of the body and behind it; "
                 "move the body or use a longer domain",
                 ahead, length, room, room * floe);
        return "domain.ahead";
    }
    if (input->domain.sides_closing != 0) {
        snprintf(why, 256,
                 "%g m/s: closing walls leave no room for the ice that enters a moving window; remove the key, or set "
                 "domain.ends: periodic",
                 input->domain.sides_closing);
        return "domain.sides_closing";
    }
    for (bt_idx i = 0; i < input->n_floes; i++) {
        if (!input->floes[i].fixed) continue;
        snprintf(why, 256,
                 "moving cannot take the fixed floes[%d] along; remove it, or set domain.ends: periodic or open",
                 (int)i);
        return "domain.ends";
    }
    return NULL;
}

void bt_case_check_window(const bt_check *check, int n, const double *v)
{
    const bt_case *input = check->c;
    if (!bt_check_sound(check,
                        "domain.ends domain.length domain.x0 domain.ahead domain.sides_closing tow.mode tow.direction "
                        "tow.speed water.current_x body.x body.yaw body.shape ice.size ice.size_min ice.size_max "
                        "ice.size_exponent"))
        return;
    if (input->body.shape != BT_BODY_ABSENT && n == 0) return; // its outline was refused
    double x_min = 0, x_max = 0;
    for (int i = 0; i < n; i++) {
        const double x = bt_cos(input->body.yaw) * v[2 * i] - bt_sin(input->body.yaw) * v[2 * i + 1];
        x_min = bt_min(x_min, x);
        x_max = bt_max(x_max, x);
    }
    char why[256];
    const char *key = find_fault(input, bt_check_given(check, "domain.ahead"), x_min, x_max, why);
    if (key) bt_check_fault(check, key, "%s", why);
}
