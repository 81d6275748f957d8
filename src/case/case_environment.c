// SPDX-License-Identifier: MIT
// What surrounds the body: tables of current and wind that a case names, the lead ahead, and checks of their keys.
#include "case/case_check.h"
#include "case/case_tow.h"
#include "case/warning.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bergtow/shape.h"
#include "case/schema.h"
#include "base/elementary.h"
#include "base/table.h"

bt_status bt_case_load_tables(bt_case *c, bt_errors *err)
{
    // Those that are there have been kept (bt_case_read_kept).
    const bt_status water = c->water.current_table && c->water.table.n == 0
                                ? bt_table_read(&c->water.table, c->water.current_table, err)
                                : BT_OK;
    const bt_status air =
        c->air.wind_table && c->air.table.n == 0 ? bt_table_read(&c->air.table, c->air.wind_table, err) : BT_OK;
    // What a table holds is reported before what cannot be read: 3 before 4.
    return water == BT_OK ? air : air == BT_OK || water == BT_ERR_CASE ? water : air;
}

/// A table stands in place of the other keys of its fluid, and must cover the times that the run asks it for: from 0 to
/// the middle of the last step (force/environment.h).
static void check_table(const bt_check *k, const char *key, const bt_table *t, const char *const *others)
{
    if (t->n == 0) return;
    for (; *others; others++) {
        double value;
        const int key_index = bt_schema_find(bt_case_keys, bt_n_case_keys, *others);
        memcpy(&value, (const char *)k->c + bt_case_keys[key_index].offset, sizeof value);
        if (value != 0 && bt_check_sound(k, *others))
            bt_check_fault(k, *others, "has no effect beside %s, which says it all; remove one of them", key);
    }
    const double dt = k->c->run.dt, duration = k->c->run.duration;
    if (!bt_check_sound(k, "run.dt") || !bt_check_sound(k, "run.duration") || !(dt > 0) || !(duration > 0)) return;
    const double first = t->row[0], end = t->row[3 * (t->n - 1)],
                 need = bt_max(duration, ((double)bt_case_steps(k->c) - 0.5) * dt);
    if (first > 0) bt_check_fault(k, key, "the table begins at %g s and the run at 0 s; add a row for 0 s", first);
    if (end < need * (1 - 1e-12))
        bt_check_fault(k, key, "the table ends at %g s and the run asks it for %g s; add rows, or shorten run.duration",
                       end, need);
}

enum { TIDE_STEPS = 20 }; // a step takes the current of its middle: 1 - sinc(π/20) = 0.4 % of the mean over it

void bt_case_check_environment(const bt_check *k)
{
    const bt_case *c = k->c;
    static const char *const current[] = {"water.current_x", "water.current_y", "water.tide.major", "water.tide.minor",
                                          NULL};
    static const char *const wind[] = {"air.wind_x", "air.wind_y", NULL};
    if (fabs(c->water.tide.minor) > c->water.tide.major && bt_check_sound(k, "water.tide.major") &&
        bt_check_sound(k, "water.tide.minor"))
        bt_check_fault(k, "water.tide.minor",
                       "%g m/s is more than water.tide.major, %g m/s; swap them and turn the inclination by 90 deg",
                       c->water.tide.minor, c->water.tide.major);
    if (c->water.tide.major > 0 && c->water.tide.period < TIDE_STEPS * c->run.dt && bt_check_sound(k, "run.dt") &&
        bt_check_sound(k, "water.tide.period"))
        bt_check_fault(k, "water.tide.period",
                       "%g s are fewer than %d time steps of %g s, which cannot follow it; a tide has hours, as in "
                       "12.42 h",
                       c->water.tide.period, TIDE_STEPS, c->run.dt);
    check_table(k, "water.current_table", &c->water.table, current);
    check_table(k, "air.wind_table", &c->air.table, wind);
}

/// Does the tow keep its place across x? Then what it leads through goes round a moving window as it is.
static bool along_x(const bt_case *c)
{
    bool along = fabs(bt_sin(c->tow.direction)) <= 1e-9;
    for (int i = 0; i < c->tow.n_waypoints; i++)
        along = along && fabs(c->tow.waypoints[2 * i + 1] - c->body.y) <= 1e-9 * c->domain.width;
    return along;
}

void bt_case_lead_follow(bt_case *c, int n, const double *v)
{
    const double ahead = c->tow.direction - c->body.yaw;
    if (isnan(c->lead.width)) c->lead.width = n ? bt_shape_width(n, v, bt_cos(ahead), bt_sin(ahead)) : 0;
    if (isnan(c->lead.length))
        c->lead.length =
            c->tow.mode == BT_TOW_NONE || !n ? 0 : bt_case_tow_distance(c, c->run.duration) +
                                                         bt_case_body_length(c, c->tow.direction);
}

void bt_case_check_lead(const bt_check *k)
{
    const bt_case *c = k->c;
    if (c->lead.mode == BT_LEAD_NONE || !bt_check_sound(k, "lead.mode") || !bt_check_sound(k, "body.shape") ||
        !bt_check_sound(k, "tow.mode"))
        return;
    if (c->body.shape == BT_BODY_ABSENT || c->tow.mode == BT_TOW_NONE) {
        bt_check_fault(k, "lead.mode",
                       "a lead lies along the tow, and nothing is towed; set it to none, or set tow.mode");
        return;
    }
    if (!(c->lead.width > 0) && bt_check_sound(k, "lead.width"))
        bt_check_fault(k, "lead.width", "is %g m; give the width of the lead, as in 20 m", c->lead.width);
    if (!(c->lead.length > 0) && bt_check_sound(k, "lead.length"))
        bt_check_fault(k, "lead.length", "is %g m; give the length of the lead, as in 500 m", c->lead.length);
    if (c->domain.ends == BT_BOUND_MOVING && c->lead.length > c->domain.ahead && !along_x(c) &&
        bt_check_sound(k, "domain.ends domain.length domain.ahead lead.length tow.direction tow.waypoints body.y"))
        bt_check_fault(k, "lead.length",
                       "%g m is more than domain.ahead, %g m, and the tow leads away from the x axis: in a moving "
                       "window the lead would come round beside it; shorten the lead, tow along x, or set domain.ends: "
                       "periodic or open",
                       c->lead.length, c->domain.ahead);
    if (c->lead.mode == BT_LEAD_MANAGED && !(c->lead.floe_size > 0) && bt_check_sound(k, "lead.floe_size"))
        bt_check_fault(k, "lead.floe_size",
                       "is %g m and a managed lead needs the size of its pieces; give it, as in 10 m",
                       c->lead.floe_size);
}

static void warn_of_table(const bt_case *c, const char *key, const bt_table *t, bt_errors *warnings)
{
    int64_t n = 0, first = 0;
    for (int64_t i = 1; i < t->n && t->row[3 * (i - 1)] < c->run.duration; i++)
        if (t->row[3 * i] - t->row[3 * (i - 1)] < c->run.dt * (1 - 1e-9) &&
            memcmp(&t->row[3 * i + 1], &t->row[3 * i - 2], 2 * sizeof *t->row) != 0 && n++ == 0)
            first = i;
    if (n > 0)
        bt_warn(warnings, BT_WARN_TABLE_ROWS,
                      "%s: rows that change the velocity within less than a time step of %g s: %lld, the first at %g "
                      "s: a step takes the velocity of its middle, and what changes between is not felt; lower run.dt, "
                      "or give means over a step or longer",
                      key, c->run.dt, (long long)n, t->row[3 * first]);
}

void bt_case_warn_tables(const bt_case *c, bt_errors *warnings)
{
    warn_of_table(c, "water.current_table", &c->water.table, warnings);
    warn_of_table(c, "air.wind_table", &c->air.table, warnings);
}

// The lead is cut at time zero and goes with the ice, the planned path does not.
void bt_case_warn_lead(const bt_case *c, double x, double y, bt_errors *warnings)
{
    if (c->lead.mode == BT_LEAD_NONE) return;
    const double ux = bt_cos(c->tow.direction), uy = bt_sin(c->tow.direction);
    const double aside = c->tow.n_waypoints > 0 ? bt_hypot(x, y) : fabs(y * ux - x * uy), cut = bt_case_tow_cut(c);
    if (cut > 0.5 * c->lead.width)
        bt_warn(warnings, BT_WARN_LEAD_CORNERS,
                      "lead.width: on its line the body cuts the corners of the way by up to %.3g m, more than half "
                      "the width of the lead, %g m, which follows the way-points: it leaves the lead there; take a "
                      "wider lead, a shorter line, or move the corner",
                      cut, c->lead.width);
    if (!(aside > 0.5 * c->lead.width)) return;
    bt_warn(warnings, BT_WARN_LEAD_DRIFT,
                  "lead.width: the ice drifts by %.3g m %s the planned path during the run, more than half the width "
                  "of the lead, %g m, which goes with the ice: the body leaves it; take a wider lead or a shorter run",
                  aside, c->tow.n_waypoints > 0 ? "against" : "across", c->lead.width);
}
