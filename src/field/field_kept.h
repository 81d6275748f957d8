// SPDX-License-Identifier: MIT
// Fields kept for other runs, by what they follow from.
//
// Members of a study that differ in speed, friction or strength have the same ice at time zero. Making it takes longer
// than computing 20 minutes of tow. So it is made once, and kept under the digest of everything that it follows
// from: the version and revision of the program, every key of ice, domain, body and floes but those listed in
// field_kept.c as of no effect (so a new key counts until somebody has thought about it), the outline of the body, and
// what the files of the ice hold. A file is taken only when its own digest fits, to the last byte; anything else is
// made anew in its place.
//
// Rejected: the format of ice.field. It does not hold the counts of repaired outlines, and its reader checks every floe
// again.
#ifndef BT_FIELD_KEPT_H
#define BT_FIELD_KEPT_H

#include "base/checksum.h"
#include "bergtow/field.h"

/// The digest of what the field of a case follows from.
void bt_field_digest(const bt_case *input, char digest[BT_CHECKSUM_DIGEST]);

/// As bt_field_load, by way of the folder dir, which is made if missing; NULL = none. What cannot be kept there is used
/// all the same.
bt_status bt_field_load_kept(const char *dir, const bt_case *input, bt_field *field, bt_errors *err);

/// Remove the folder and the fields in it; what else is there stays.
void bt_field_forget_kept(const char *dir);

#endif
