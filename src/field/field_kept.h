// SPDX-License-Identifier: MIT
// Fields kept for other runs, under a digest of everything they depend on.
//
// Members of a study that differ in speed, friction or strength have the same ice at time zero. Making it takes longer
// than computing 20 minutes of tow, so it is made once. The digest covers the version and revision of the program;
// every key of ice, domain, body and floes except those listed in field_kept.c as without effect (so a new key counts
// until somebody decides otherwise); the outline of the body; and the contents of the ice files. A file is used only if
// its own digest matches, to the last byte; otherwise the field is made again and replaces it.
//
// Rejected: the format of ice.field. It does not hold the counts of repaired outlines, and its reader checks every floe
// again.
#ifndef BT_FIELD_KEPT_H
#define BT_FIELD_KEPT_H

#include "base/checksum.h"
#include "bergtow/field.h"

/// Digest of everything that the field of a case depends on.
void bt_field_digest(const bt_case *input, char digest[BT_CHECKSUM_DIGEST]);

/// As bt_field_load, but take a field kept in the folder dir (created if missing; NULL = none), or keep it there. A
/// field that cannot be kept is returned all the same.
bt_status bt_field_load_kept(const char *dir, const bt_case *input, bt_field *field, bt_errors *err);

/// Remove the fields kept in the folder, and the folder itself if nothing else is in it.
void bt_field_forget_kept(const char *dir);

#endif
