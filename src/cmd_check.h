// SPDX-License-Identifier: MIT
// What the check of a case and that of a study share.
#ifndef BERGTOW_CMD_CHECK_H
#define BERGTOW_CMD_CHECK_H

#include "bergtow/case.h"
#include "bergtow/field.h"

typedef struct bt_check_ice {
    double count, size, thickness, concentration; ///< number, mean diameter m, mean thickness m, area fraction
} bt_check_ice;

/// The time step against the rule in cmd_check.c.
typedef struct bt_check_step {
    double longest;      ///< of a collision, s
    double size, passed; ///< of the floes, or of the pieces of a managed lead, m; sizes passed in a step
    bool pieces;
    bool contact, floes; ///< is the step short enough for a collision; for the floes
} bt_check_step;

/// The field that the case reads, if any. Errors: BT_ERR_CASE, BT_ERR_IO.
bt_status bt_check_read_ice(const bt_case *c, bt_field *f, bt_errors *err);
/// Of the field that was read, or expected of the one that will be made.
bt_check_ice bt_check_ice_of(const bt_case *c, const bt_field *f);
bt_check_step bt_check_step_of(const bt_case *c, const bt_check_ice *n);
/// Rough estimate of a run, s of one core.
double bt_check_seconds(const bt_case *c, const bt_check_ice *n);

/// Has the file a key `base` at its top, as no case has? False where it cannot be read. Pipes, which can be read only once, are cases.
bool bt_check_is_study(const char *path);
/// Check a study and the case of the first member of each condition; print what follows when all are valid. Errors: BT_ERR_CASE, BT_ERR_IO.
bt_status bt_check_study(const char *path, bt_errors *err);

#endif
