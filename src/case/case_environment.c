// SPDX-License-Identifier: MIT
// What surrounds the body: tables of current and wind that a case names, and the lead ahead.
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

bt_status bt_case_read_flow_tables(bt_case *c, bt_errors *err)
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

/// A table must cover the times that the run asks it for: from 0 to the middle of the last step (force/environment.h).
static void check_table(const bt_check *k, const char *key, const bt_table *t)
{
    if (t->n == 0) return;
    const double dt = k->c->run.dt, duration = k->c->run.duration;
    if (!bt_check_sound(k, "run.dt") || !bt_check_sound(k, "run.duration") || !(dt > 0) || !(duration > 0)) return;
    const double first = t->row[0], end = t->row[3 * (t->n - 1)],
                 need = bt_max(duration, ((double)bt_case_steps(k->c) - 0.5) * dt);
    if (first > 0) bt_check_fault(k, key, "the table begins at %g s and the run at 0 s; add a row for 0 s", first);
    if (end < need * (1 - 1e-12))
        bt_check_fault(k, key, "the table ends at %g s and the run asks it for %g s; add rows, or shorten run.duration",
                       end, need);
}

void bt_case_check_tables(const bt_check *k)
{
    check_table(k, "water.current_table", &k->c->water.table);
    check_table(k, "air.wind_table", &k->c->air.table);
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
