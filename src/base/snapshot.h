// SPDX-License-Identifier: MIT
// A set of named arrays: the content of a checkpoint.
//
// Saving, loading, comparing, sharing among ranks and the file all use this one form, so that none of them needs to
// know the meaning of the arrays. A set that is read is held in memory. A set that is saved goes to its file array by
// array, so that memory never holds the state of a run twice.
//
// Names are "group/name". The groups `about` and `clock` tell where a state comes from and how long it took: they are
// not part of it, and are not compared.
#ifndef BT_SNAPSHOT_H
#define BT_SNAPSHOT_H

#include "bergtow/comm.h"

/// U8 is for booleans only: it is read as a bool, for which values other than 0 and 1 are undefined.
typedef enum {
    BT_ITEM_F64,
    BT_ITEM_I64,
    BT_ITEM_I32,
    BT_ITEM_U32,
    BT_ITEM_U16,
    BT_ITEM_U8,
    BT_ITEM_TEXT,
    BT_ITEM_TYPES
} bt_item_type;

typedef struct bt_item {
    char *name;
    bt_item_type type;
    int64_t n;   ///< rows; of a text, its bytes with the 0 at the end
    int width;   ///< numbers in a row
    void *data;  ///< [n][width]; NULL if it has gone to the file
    const char *units, *meaning, *axes; ///< of its row (bt_state_row); NULL without one
} bt_item;

typedef struct bt_snapshot {
    bt_item *item; ///< [n]
    int n, cap;
    const char *path; ///< of the file, for messages
    bt_errors *err;   ///< list for the complaints of bt_snapshot_take
    bool faulty;      ///< there was a complaint
    int64_t rows;     ///< rows put into the array added last
    const struct bt_snapshot_sink *sink; ///< where arrays go as they are added (bt_snapshot_create), NULL = into memory
    struct bt_snapshot_file *file;       ///< of the sink
} bt_snapshot;

/// Takes the arrays of a set in place of memory.
typedef struct bt_snapshot_sink {
    void (*begin)(bt_snapshot *snap); ///< begin the array added last
    void (*put)(bt_snapshot *snap, int64_t n, const void *rows); ///< take the next rows of it
    void (*drop)(bt_snapshot *snap); ///< the set is given up: leave nothing of it
} bt_snapshot_sink;

/// Condition on each number of a member by itself: COUNT from 0 to 1e15, SHARE from 0 to 1, FAR within 1e9 of 0.
typedef enum {
    BT_ROW_ANY,
    BT_ROW_FINITE,
    BT_ROW_NOT_NEGATIVE,
    BT_ROW_SHARE,
    BT_ROW_COUNT,
    BT_ROW_FAR,
    BT_ROW_YES_OR_NO,
    BT_ROW_CHECKS
} bt_row_check;

/// Description of a member of a struct that is saved, or of a column of an array of structs.
typedef struct bt_state_row {
    const char *name; ///< in its group
    bt_item_type type;
    int width;
    size_t offset;
    const char *units, *meaning, *axes; ///< for a reader of the file; axes as in h5dataset.h
    bt_row_check check;                 ///< condition checked when it is taken
    const char *key;                    ///< key of summary.json with the same number; NULL = none
} bt_state_row;

size_t bt_item_size(bt_item_type type); ///< bytes of one number
/// number `at` of an array with enough digits to read it back; returns out
const char *bt_item_number(const bt_item *item, int64_t at, char out[40]);

/// Add an array [n][width], to be filled by at least one call of bt_snapshot_put. Returns its memory, zeroed; NULL if
/// it goes to a file.
void *bt_snapshot_begin(bt_snapshot *snap, const char *name, bt_item_type type, int64_t n, int width);
/// Append the next n rows to the array added last.
void bt_snapshot_put(bt_snapshot *snap, int64_t n, const void *rows);
/// Add an array [n][width]; data are copied.
void bt_snapshot_add(bt_snapshot *snap, const char *name, bt_item_type type, int64_t n, int width, const void *data);
void bt_snapshot_add_text(bt_snapshot *snap, const char *name, const char *text);
void bt_snapshot_add_int(bt_snapshot *snap, const char *name, int64_t value);
void bt_snapshot_add_real(bt_snapshot *snap, const char *name, double value);
/// The same for an array described by a row: [n][width], group/name.
void bt_snapshot_begin_row(bt_snapshot *snap, const char *group, const bt_state_row *row, int64_t n);
void bt_snapshot_add_row(bt_snapshot *snap, const char *group, const bt_state_row *row, int64_t n, const void *data);
/// Add the members of a struct, each as group/name.
void bt_snapshot_add_rows(bt_snapshot *snap, const char *group, const bt_state_row *row, int n_rows, const void *base);

/// The array of this name, or NULL.
const bt_item *bt_snapshot_find(const bt_snapshot *snap, const char *name);
/// Rows of the array of this name; 0 and a complaint if it is missing.
int64_t bt_snapshot_rows(bt_snapshot *snap, const char *name);
/// Copy an array that must exist with this type and shape; otherwise complain, and leave `to` as it is.
void bt_snapshot_take(bt_snapshot *snap, const char *name, bt_item_type type, int64_t n, int width, void *to);
/// Complain unless good: no run writes such content. row: where it is, from 0, or −1 for the array as a whole; `what`
/// completes "/name, row 3, ...".
void bt_snapshot_want(bt_snapshot *snap, bool good, const char *name, int64_t row, const char *what);
const char *bt_snapshot_text(bt_snapshot *snap, const char *name); ///< "" and a complaint if it is missing
int64_t bt_snapshot_int(bt_snapshot *snap, const char *name);
double bt_snapshot_real(bt_snapshot *snap, const char *name);
void bt_snapshot_take_rows(bt_snapshot *snap, const char *group, const bt_state_row *row, int n_rows, void *base);
/// [n][width], as bt_snapshot_take; also complains about a number that violates the condition of its row.
void bt_snapshot_take_row(bt_snapshot *snap, const char *group, const bt_state_row *row, int64_t n, void *to);
/// As bt_snapshot_take, into new memory [*n][width].
void *bt_snapshot_copy(bt_snapshot *snap, const char *name, bt_item_type type, int width, int64_t *n);

/// Collective. Copy the snapshot of rank 0 to all ranks; on the others it must be empty.
void bt_snapshot_share(const bt_comm *comm, bt_snapshot *snap);

/// Describe the first difference between two states; false if there is none.
bool bt_snapshot_differ(const bt_snapshot *a, const bt_snapshot *b, char out[400]);

void bt_snapshot_free(bt_snapshot *snap);

/// Meaning of an array without a row, with its units (NULL: it is text) and axes as in h5dataset.h; NULL if unknown.
typedef const char *bt_item_meaning(const char *name, const char **units, const char **axes);

/// Send all arrays added to `snap` from here on to a new HDF5 file. meaning: for arrays without a row, may be NULL.
/// `snap` must be empty. bt_snapshot_close returns the errors of this call and of those that follow.
void bt_snapshot_create(bt_snapshot *snap, const char *path, bt_item_meaning *meaning, bt_errors *err);
/// Complete the file after the last array: end it with a checksum, and close it.
void bt_snapshot_end(bt_snapshot *snap, bt_errors *err);
/// The same unless done before, and keep the file: without this call bt_snapshot_free removes it. Errors: BT_ERR_IO.
bt_status bt_snapshot_close(bt_snapshot *snap, bt_errors *err);
/// Read a file into memory. Errors as bt_checksum_check, and BT_ERR_IO.
bt_status bt_snapshot_read(bt_snapshot *snap, const char *path, bt_errors *err);

#endif
