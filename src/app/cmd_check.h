// SPDX-License-Identifier: MIT
// Shared by the checks of a case and of a study.
#ifndef BERGTOW_CMD_CHECK_H
#define BERGTOW_CMD_CHECK_H

#include "app/cmd.h"
#include "bergtow/case.h"
#include "bergtow/field.h"
#include "case/time_step.h"
#include "field/lead.h"

typedef struct bt_check_ice {
    double count, concentration; ///< number, area fraction
    double size, thickness, volume; ///< means of the floes of the field, or else of those given by hand, m, m, m³
    double corners; ///< of all floes
    double split, parts; ///< floes that are not convex, and their convex parts
    double made;         ///< floes to be generated
} bt_check_ice;

/// Refuse a case if `run` would refuse it before its first step, in the same words, as far as possible without
/// generating a field: size against memory and disk, the field that is read, its lead, bodies that overlap or have no
/// room. field: the one that was read, or empty; ice, run: the ice before and after the lead is opened; lead: only of a
/// field that was read. Errors: BT_ERR_CASE, BT_ERR_IO.
struct bt_comm;
bt_status bt_check_ready(const bt_case *input, const struct bt_comm *comm, bt_field *field, bt_check_ice *ice,
                         bt_check_ice *run, bt_lead_stats *lead, bt_errors *err);
/// Append warnings that a user should see before the run, a sentence each.
void bt_check_warn(const bt_case *input, const bt_field *field, const bt_check_ice *ice, bt_errors *warnings);
/// Verdict on a time step in the printed list.
static inline const char *bt_check_verdict(bool good) { return good ? "ok" : "TOO LARGE"; }
bt_time_step bt_check_step(const bt_case *input, const bt_check_ice *ice);
/// Loads that split the mean floe, as a square of its area (split/law.h), N.
typedef struct bt_check_split { double three_point, opening; } bt_check_split;
bt_check_split bt_check_split_of(const bt_case *input, const bt_check_ice *ice);
/// Rough estimate of the time of a run, s on one core.
double bt_check_seconds(const bt_case *input, const bt_check_ice *n);

/// A case that is ready to run.
typedef struct bt_checked {
    const char *path;
    const bt_case *input;
    const bt_field *field;
    const struct bt_comm *comm;
    const bt_check_ice *ice, *run; ///< before and after the lead is opened
    const bt_lead_stats *lead;
    const bt_errors *warnings;
} bt_checked;

/// Print its numbers in lines, or as one JSON object: `case`, `title`, `warnings` ({code, text, values}), and an object
/// for each group; units are in the names, and numbers that do not apply are null or absent. `by_default`: values (SI)
/// that were not given and follow from others.
void bt_check_print(const bt_checked *c, bool as_json);

/// Check a study, and the case of the first member of each condition; if all are valid, print their numbers for a call
/// on `ranks` ranks. Errors: BT_ERR_CASE, BT_ERR_IO.
bt_status bt_check_study(const bt_cmd_case *file, int ranks, bt_errors *err);

#endif
