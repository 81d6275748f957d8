// SPDX-License-Identifier: MIT
// Values of a study, and what is wrong with them.
#ifndef BT_STUDY_VALUES_H
#define BT_STUDY_VALUES_H

#include "base/tree.h"
#include "bergtow/study.h"

/// A study that is being read.
typedef struct {
    bt_study *s;
    bt_errors *err;
    const char *place; ///< of what is read, in place of file and line; or NULL
} bt_study_reader;

/// An error in a line of the study.
void bt_study_complain(const bt_study_reader *r, int line, const char *fmt, ...) __attribute__((format(printf, 3, 4)));

/// Is it a single value? An error if not.
bool bt_study_is_scalar(const bt_study_reader *r, const bt_node *node, int line, const char *name);

/// A whole number from lo to hi; out is left alone after an error.
void bt_study_read_whole(const bt_study_reader *r, const bt_node *node, int line, const char *name, int64_t lo,
                         int64_t hi, int64_t *out);

/// Is this text a value of the case key of index `key`? An error if not.
bool bt_study_check_value(const bt_study_reader *r, int line, const char *name, int key, const bt_node *value);

/// Values of a parameter from a list, and from a range {from, to, n, scale, distribution, source}.
void bt_study_read_list(const bt_study_reader *r, const bt_node *list, int line, bt_study_parameter *p);
void bt_study_read_range(const bt_study_reader *r, const bt_node *map, int line, bt_study_parameter *p);

/// Does the parameter take whole numbers alone?
bool bt_study_is_whole(const bt_study_parameter *p);

/// Name of a distribution as a study writes it.
const char *bt_distribution_name(bt_distribution d);

/// Which stratum of the hypercube each condition takes, of every parameter.
void bt_study_draw_strata(bt_study *s);

/// Text of parameter p in condition c; the caller frees it.
char *bt_study_value(const bt_study *s, int p, int64_t c);

#endif
