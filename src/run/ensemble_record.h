// SPDX-License-Identifier: MIT
// The record of a finished member: digests of its files, to tell whether they are unchanged.
//
// The file `finished` is the last file that a member writes:
//
//     bergtow finished member 1\nname: c001-r001\nstudy: 0123...\nsummary.json: 5123 bytes, xxh128 0123...\nresult.h5:
//     ...\ncase.resolved.yml: ...
//
// name and study (the digest of study.resolved.yml) identify the member; the digests (XXH3, 128 bits) cover every byte
// that an ensemble and its statistics read. A member is sound if the record made anew from its files equals this text
// to the last byte, so a damaged record is not sound either. It is written only if the checksum of the result is right,
// and the summary is readable, of a whole run and complete; these files never change after that.
// Rejected: comparing state hash and key numbers of summary.json with result.h5, which leaves all other numbers
// unchecked; a digest inside summary.json, which does not reveal another member copied over it; trusting the checksum
// of result.h5 alone, for the same reason.
#ifndef BT_ENSEMBLE_RECORD_H
#define BT_ENSEMBLE_RECORD_H

#include <jansson.h>

#include "bergtow/study.h"
#include "base/h5util.h"

// --- notes of a member -----------------------------------------------------------------------------------------------

// Notes of the members of an ensemble: warnings, and reasons of their verdicts, one row each.
//
//     /warnings, /reasons: member, code, text, values [n]     in the order of the members, and of their summaries;
//                                                             member: a number of /members/id; values: a JSON object
//     /codes: code, meaning                                   of all warnings and reasons that exist
//
// A group without rows is left out. Codes and values are for programs; texts are for readers, and may change.

typedef struct bt_member_notes {
    int64_t n, cap;
    int64_t *member;              ///< [n]
    char **code, **text, **values; ///< [n]
} bt_member_notes;

/// Take an array of {"code", "text", "values"} of a summary; anything else is left out.
void bt_member_notes_take(bt_member_notes *notes, int64_t member, const json_t *array);
/// Write the notes. group: "/warnings"; axis: name of a row; what: their description.
void bt_member_notes_write(bt_h5 *h5, const bt_member_notes *notes, const char *group, const char *axis,
                           const char *what);
void bt_member_notes_free(bt_member_notes *notes);

/// Write the meanings of all codes.
void bt_warning_codes_write(bt_h5 *h5);

enum { BT_DIGEST_TEXT = 33 };

typedef struct bt_member_records {
    char study[BT_DIGEST_TEXT]; ///< digest of the resolved study
    int64_t n;                  ///< members
    /// [n] stamp (names, lengths, times) of the files found sound; 0 = not checked yet
    uint64_t *seen;
} bt_member_records;

/// Start records of the members of s. study: digest of DIR/study.resolved.yml.
void bt_member_records_begin(bt_member_records *records, const bt_study *s, const char study[BT_DIGEST_TEXT]);
void bt_member_records_end(bt_member_records *records);

/// Write the record of member m, which has just finished in this folder. Errors: BT_ERR_IO if its files are not those
/// of a finished run, or the record cannot be written.
bt_status bt_member_record_write(bt_member_records *records, int64_t m, const char *name, const char *folder,
                                 bt_errors *err);

/// Read the summary of the result in a folder; the caller releases it. Errors: BT_ERR_CASE, not JSON; BT_ERR_IO.
bt_status bt_member_summary(const char *folder, json_t **root, bt_errors *err);

/// Does the summary in this folder cover n_steps steps? A run limited to fewer steps also has a summary.
bool bt_member_is_whole(const char *folder, int64_t n_steps);

/// Do the files match the record? They are read whole once, and again only if their stamp has changed. Errors:
/// BT_ERR_CASE, they are missing or damaged; BT_ERR_IO, they cannot be read, which says nothing about their contents.
bt_status bt_member_record_check(bt_member_records *records, int64_t m, const char *name, const char *folder,
                                 bt_errors *err);

/// Remove record and files of a member, so that it is run again; the caller holds its lock. Errors: BT_ERR_IO.
bt_status bt_member_record_forget(const char *folder, bt_errors *err);

/// Make DIR/ensemble.h5 from the files of the members that are sound by these records; the caller holds DIR/lock.
/// warnings: replaced by the warnings of these members. Errors: BT_ERR_IO.
bt_status bt_ensemble_gather(const bt_study *study, const char *dir, bt_member_records *records,
                             bt_member_notes *warnings, bt_errors *err);

#endif
