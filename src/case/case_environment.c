// SPDX-License-Identifier: MIT
// Surroundings of the body: tables of current and wind that a case names, and the lead ahead.
#include "case/case_check.h"
#include "case/case_tow.h"
#include "case/warning.h"

#include <string.h>

#include "bergtow/shape.h"
#include "base/elementary.h"
#include "base/table.h"

bt_status bt_case_read_flow_tables(bt_case *input, bt_errors *err)
{
    // A table that is there already comes from a checkpoint (bt_case_read_kept).
    const bt_status water = input->water.current_table && input->water.table.n == 0
                                ? bt_table_read(&input->water.table, input->water.current_table, err)
                                : BT_OK;
    const bt_status air =
        input->air.wind_table && input->air.table.n == 0 ? bt_table_read(&input->air.table, input->air.wind_table, err)
                                                         : BT_OK;
    // A faulty table (exit code 3) takes precedence over one that cannot be read (4).
    return water == BT_OK ? air : air == BT_OK || water == BT_ERR_CASE ? water : air;
}

/// A table must cover the times that the run looks up: from 0 to the middle of the last step (force/environment.h).
static void check_table(const bt_check *check, const char *key, const bt_table *table)
{
    if (table->n == 0) return;
    const double dt = check->c->run.dt, duration = check->c->run.duration;
    if (!bt_check_sound(check, "run.dt") || !bt_check_sound(check, "run.duration") || !(dt > 0) || !(duration > 0))
        return;
    const double first = table->row[0], end = table->row[3 * (table->n - 1)],
                 need = bt_max(duration, ((double)bt_case_steps(check->c) - 0.5) * dt);
    if (first > 0) bt_check_fault(check, key, "the table begins at %g s, but the run begins at 0 s; add a row for 0 "
                                              "s", first);
    if (end < need * (1 - 1e-12))
        bt_check_fault(check, key,
                       "the table ends at %g s, but the run needs it until %g s; add rows, or shorten "
                       "run.duration", end,
                       need);
}

void bt_case_check_tables(const bt_check *check)
{
    check_table(check, "water.current_table", &check->c->water.table);
    check_table(check, "air.wind_table", &check->c->air.table);
}

void bt_case_lead_follow(bt_case *input, int n, const double *v)
{
    const double ahead = input->tow.direction - input->body.yaw;
    if (isnan(input->lead.width)) input->lead.width = n ? bt_shape_width(n, v, bt_cos(ahead), bt_sin(ahead)) : 0;
    if (isnan(input->lead.length))
        input->lead.length =
            input->tow.mode == BT_TOW_NONE || !n ? 0 : bt_case_tow_distance(input, input->run.duration) +
                                                         bt_case_body_length(input, input->tow.direction);
}

static void warn_of_table(const bt_case *input, const char *key, const bt_table *table, bt_errors *warnings)
{
    int64_t n = 0, first = 0;
    for (int64_t i = 1; i < table->n && table->row[3 * (i - 1)] < input->run.duration; i++)
        if (table->row[3 * i] - table->row[3 * (i - 1)] < input->run.dt * (1 - 1e-9) &&
            memcmp(&table->row[3 * i + 1], &table->row[3 * i - 2], 2 * sizeof *table->row) != 0 && n++ == 0)
            first = i;
    if (n > 0)
        bt_warn(warnings, BT_WARN_TABLE_ROWS,
                      "%s: some rows change the velocity within less than a time step of %g s (%lld rows, the first at "
                      "%g s): a step uses the velocity at its middle, and misses changes in between; lower run.dt, or "
                      "give means over a step or longer",
                      key, input->run.dt, (long long)n, table->row[3 * first]);
}

void bt_case_warn_tables(const bt_case *input, bt_errors *warnings)
{
    warn_of_table(input, "water.current_table", &input->water.table, warnings);
    warn_of_table(input, "air.wind_table", &input->air.table, warnings);
}

// The lead is cut at time zero and moves with the ice; the planned path does not.
void bt_case_warn_lead(const bt_case *input, double x, double y, bt_errors *warnings)
{
    if (input->lead.mode == BT_LEAD_NONE) return;
    const double ux = bt_cos(input->tow.direction), uy = bt_sin(input->tow.direction);
    const double aside = input->tow.n_waypoints > 0 ? bt_hypot(x, y) : fabs(y * ux - x * uy),
                 cut = bt_case_tow_cut(input);
    if (cut > 0.5 * input->lead.width)
        bt_warn(warnings, BT_WARN_LEAD_CORNERS,
                      "lead.width: on its line the body cuts the corners of its path by up to %.3g m, more than half "
                      "the width of the lead, %g m. The lead follows the way-points, so the body leaves it there; use "
                      "a wider lead, a shorter line, or move the corner",
                      cut, input->lead.width);
    if (!(aside > 0.5 * input->lead.width)) return;
    bt_warn(warnings, BT_WARN_LEAD_DRIFT,
                  "lead.width: the ice drifts by %.3g m %s the planned path during the run, more than half the width "
                  "of the lead, %g m. The lead drifts with the ice, so the body leaves it; use a wider lead or a "
                  "shorter run",
                  aside, input->tow.n_waypoints > 0 ? "against" : "across", input->lead.width);
}
