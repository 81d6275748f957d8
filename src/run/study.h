// SPDX-License-Identifier: MIT
// Parts of reading a study, besides bergtow/study.h.
#ifndef BT_STUDY_H
#define BT_STUDY_H

#include <sys/stat.h>

#include "bergtow/study.h"
#include "base/checksum.h"
#include "base/tree.h"

// --- keys that only some members get ---------------------------------------------------------------------------------

// Keys that a study gives only to some of its members: of parameters, of variants, and of `with`.

/// A key that only some members get. The texts belong to the study.
typedef struct {
    const char *text;    ///< the key, or "key=value"
    int length;          ///< of the key
    const char *at;      ///< its place, "FILE:LINE: "
    const char *section; ///< parameters, variants or with
    int axis;            ///< the parameter that decides who gets it
} bt_study_setting;

/// Is it an entry of `with`, and not a variant?
static inline bool bt_is_with(const bt_study *study, const bt_study_variant *variant)
{
    return study->parameter[variant->axis].key >= 0;
}

/// The section in which a key is given to only some members, NULL = none.
const char *bt_study_varied(const bt_study *study, const char *key);

/// Add an error for each key that two parameters set: a member has one value of a key, so the study would run one and
/// record the other.
void bt_study_check_axes(const bt_study *study, bt_errors *err);

/// Add errors if members would be the same run: more than one field although no condition has ice that depends on the
/// seed, or keys for making ice although all conditions read theirs. Reads conditions until one rules out both; errors
/// in a case are not reported here. Errors: BT_ERR_CASE.
bt_status bt_study_check_ice(const bt_study *study, bt_errors *err);

/// The first difference of two texts of bt_study_resolved, in words; NULL if they are alike. The caller frees it.
char *bt_study_difference(const char *before, const char *now);

// --- files that a study names ----------------------------------------------------------------------------------------

// The files that the cases of a study name: fields, outlines, tables. A case holds only their paths, so digests of
// their contents are kept beside study.resolved.yml, in the file study.files, one line each:
//
//     current.csv: 312 bytes, xxh128 0123...
//
// by the path from the folder of the base case if the file lies below that, so that both can be moved; else by the
// whole path.
// Members made before and after a change of such a file would belong to two studies.

typedef struct {
    char *path; ///< absolute
    char digest[BT_CHECKSUM_DIGEST];
    int64_t bytes;
    struct stat seen; ///< when the digest was taken
} bt_named_file;

typedef struct bt_study_files {
    bt_named_file *list;
    int n;
    char *root; ///< folder of the base case, absolute; NULL if there is none
} bt_study_files;

/// Find the files that the base case and the values of its keys name, each once, as far as they can be read: a member
/// whose file is missing reports it.
void bt_study_files_find(bt_study_files *files, const bt_study *study);
void bt_study_files_free(bt_study_files *files);

/// Compare with DIR/study.files, and add missing entries; the caller holds DIR/lock. old: DIR has had members before,
/// and a warning names files whose previous contents are unknown. Errors: BT_ERR_CASE, a file has changed; BT_ERR_IO.
bt_status bt_study_files_keep(const bt_study_files *files, const char *dir, bool old, bt_errors *err);

/// Are the files unchanged since they were found? They are read again only if the system reports a change. Errors:
/// BT_ERR_CASE.
bt_status bt_study_files_same(bt_study_files *files, bt_errors *err);

// --- values of its parameters ----------------------------------------------------------------------------------------

// Values of a study, and their checks.

/// A study that is being read.
typedef struct {
    bt_study *s;
    bt_errors *err;
    const char *place; ///< place to report instead of file and line; or NULL
} bt_study_reader;

/// Report an error in a line of the study.
void bt_study_complain(const bt_study_reader *reader, int line, const char *fmt,
                       ...) __attribute__((format(printf, 3, 4)));

/// Is it a single value? An error if not.
bool bt_study_is_scalar(const bt_study_reader *reader, const bt_node *node, int line, const char *name);

/// Read a whole number from lo to hi; out is unchanged after an error.
void bt_study_read_whole(const bt_study_reader *reader, const bt_node *node, int line, const char *name, int64_t lo,
                         int64_t hi, int64_t *out);

/// Is this text a value of the case key of index `key`? An error if not.
bool bt_study_check_value(const bt_study_reader *reader, int line, const char *name, int key, const bt_node *value);

/// Read the values of a parameter from a list; the next function reads a range {from, to, n, scale, distribution,
/// source}.
void bt_study_read_list(const bt_study_reader *reader, const bt_node *list, int line, bt_study_parameter *parameter);
void bt_study_read_range(const bt_study_reader *reader, const bt_node *map, int line, bt_study_parameter *parameter);

/// Does the parameter take only whole numbers?
bool bt_study_is_whole(const bt_study_parameter *parameter);

/// Name of a distribution as written in a study.
const char *bt_distribution_name(bt_distribution d);

/// Draw the stratum of the hypercube that each condition takes, for every parameter.
void bt_study_draw_strata(bt_study *study);

/// Text of parameter p in condition c; the caller frees it.
char *bt_study_value(const bt_study *study, int p, int64_t c);

#endif
