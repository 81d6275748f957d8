// SPDX-License-Identifier: MIT
// What the check of a case and that of a study share.
#ifndef BERGTOW_CMD_CHECK_H
#define BERGTOW_CMD_CHECK_H

#include "app/cmd.h"
#include "bergtow/case.h"
#include "bergtow/field.h"
#include "field/lead.h"

typedef struct bt_check_ice {
    double count, size, thickness, concentration; ///< number, mean diameter m, mean thickness m, area fraction
    double corners; ///< of all floes
    double split, parts; ///< floes that are not convex, and their convex parts
    double made;         ///< floes that are made
} bt_check_ice;

/// The time step against the rule in check.c.
typedef struct bt_check_step {
    double longest;      ///< of a collision, s
    double speed;        ///< of the contacts: the reference speed, or the planned one through the ice if that is more
    double size, passed; ///< of the floes, or of the pieces of a managed lead, m; sizes passed in a step
    bool pieces;
    bool contact, floes; ///< is the step short enough for a collision; for the floes
} bt_check_step;

/// Everything for which `run` would refuse the case before its first step, in the same words, as far as it shows
/// without making a field: size against memory and disk, the field that is read, its lead, bodies that meet or have no
/// room. f: the field that was read, or none; n: of the ice before the lead is opened, and how it is for the run: *run.
/// lead: of a field that was read. Errors: BT_ERR_CASE, BT_ERR_IO.
struct bt_comm;
bt_status bt_check_ready(const bt_case *input, const struct bt_comm *comm, bt_field *field, bt_check_ice *ice,
                         bt_check_ice *run, bt_lead_stats *lead, bt_errors *err);
/// What a run would go through and a user should know before: appended to the list, a sentence each.
void bt_check_warn(const bt_case *input, const bt_field *field, const bt_check_ice *ice, bt_errors *warnings);
/// Of a time step in the printed list.
static inline const char *bt_check_verdict(bool good) { return good ? "ok" : "TOO LARGE"; }
bt_check_step bt_check_step_of(const bt_case *input, const bt_check_ice *ice);
/// Loads that split the mean floe, as a square of its area (split/law.h), N.
typedef struct bt_check_split { double three_point, opening; } bt_check_split;
bt_check_split bt_check_split_of(const bt_case *input, const bt_check_ice *ice);
/// Rough estimate of a run, s of one core.
double bt_check_seconds(const bt_case *input, const bt_check_ice *n);

/// A case that is ready to run.
typedef struct bt_checked {
    const char *path;
    const bt_case *input;
    const bt_field *field;
    const struct bt_comm *comm;
    const bt_check_ice *ice, *run; ///< before the lead is opened, and as the run has it
    const bt_lead_stats *lead;
    const bt_errors *warnings;
} bt_checked;

/// Print its numbers in lines, or as one JSON object: `case`, `title`, `warnings` ({code, text, values}), and an object
/// for each group; units in the names, null or absent where a number does not apply. `by_default`: values that nobody
/// gave and that follow from others (SI).
void bt_check_print(const bt_checked *c, bool as_json);

/// Check a study and the case of the first member of each condition; print what follows when all are valid, on so many
/// ranks. Errors: BT_ERR_CASE, BT_ERR_IO.
bt_status bt_check_study(const bt_cmd_case *file, int ranks, bt_errors *err);

#endif
