// SPDX-License-Identifier: MIT
// A set of named arrays: what a checkpoint is.
//
// Saving, loading, comparing, sharing among ranks and the file all go through this one form, so that none of them knows
// what the arrays mean. A set that is read lies in memory. One that is saved goes to its file array by array: the state
// of a run is never there twice.
//
// Names are "group/name". Groups `about` and `clock` say where a state comes from and how long it took: they are not
// part of it, and are not compared.
#ifndef BT_SNAPSHOT_H
#define BT_SNAPSHOT_H

#include "bergtow/comm.h"

/// U8 is for yes and no alone: it is taken as a bool, for which other values are undefined.
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
    int64_t n;   ///< rows; of a text its bytes with the 0 at the end
    int width;   ///< numbers a row
    void *data;  ///< [n][width]; NULL where it has gone to the file
    const char *units, *meaning, *axes; ///< of its row (bt_state_row); NULL without one
} bt_item;

typedef struct bt_snapshot {
    bt_item *item; ///< [n]
    int n, cap;
    const char *path; ///< of the file, for messages
    bt_errors *err;   ///< where bt_snapshot_take complains
    bool faulty;      ///< it has
    int64_t rows;     ///< put into the array that was added last
    struct bt_snapshot_file *file; ///< where arrays go as they are added (bt_snapshot_create), NULL = into memory
} bt_snapshot;

/// What each number of a member must be by itself: COUNT from 0 to 1e15, SHARE from 0 to 1, FAR within 1e9 of 0.
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

/// A member of a struct that is saved, or a column of an array of structs: all that is known of it.
typedef struct bt_state_row {
    const char *name; ///< in its group
    bt_item_type type;
    int width;
    size_t offset;
    const char *units, *meaning, *axes; ///< for a reader of the file; axes as in h5dataset.h
    bt_row_check check;                 ///< held when it is taken
    const char *key;                    ///< of summary.json, which has the number, too; NULL: it has not
} bt_state_row;

size_t bt_item_size(bt_item_type type); ///< bytes of one number
/// number `at` of an array in digits that give it back; returns out
const char *bt_item_number(const bt_item *item, int64_t at, char out[40]);

/// Add an array [n][width], to be filled by bt_snapshot_put, once at least. Returns where it lies, zeros; NULL in a
/// file.
void *bt_snapshot_begin(bt_snapshot *snap, const char *name, bt_item_type type, int64_t n, int width);
/// The next n rows of the array added last.
void bt_snapshot_put(bt_snapshot *snap, int64_t n, const void *rows);
/// Add an array [n][width]; data are copied.
void bt_snapshot_add(bt_snapshot *snap, const char *name, bt_item_type type, int64_t n, int width, const void *data);
void bt_snapshot_add_text(bt_snapshot *snap, const char *name, const char *text);
void bt_snapshot_add_int(bt_snapshot *snap, const char *name, int64_t value);
void bt_snapshot_add_real(bt_snapshot *snap, const char *name, double value);
/// The same by a row: [n][width], group/name.
void bt_snapshot_begin_row(bt_snapshot *snap, const char *group, const bt_state_row *row, int64_t n);
void bt_snapshot_add_row(bt_snapshot *snap, const char *group, const bt_state_row *row, int64_t n, const void *data);
/// Add the members of a struct, group/name each.
void bt_snapshot_add_rows(bt_snapshot *snap, const char *group, const bt_state_row *row, int n_rows, const void *base);

/// The array of that name, or NULL.
const bt_item *bt_snapshot_find(const bt_snapshot *snap, const char *name);
/// Rows of the array of that name; 0 and a complaint when it is missing.
int64_t bt_snapshot_rows(bt_snapshot *snap, const char *name);
/// Copy an array that must be there with this type and shape; otherwise complain, and leave `to`.
void bt_snapshot_take(bt_snapshot *snap, const char *name, bt_item_type type, int64_t n, int width, void *to);
/// Complain unless good: what the array holds, in its row (from 0; -1: as a whole), is what no run leaves; `what`
/// completes "/name, row 3, ...".
void bt_snapshot_want(bt_snapshot *snap, bool good, const char *name, int64_t row, const char *what);
const char *bt_snapshot_text(bt_snapshot *snap, const char *name); ///< "" and a complaint when it is missing
int64_t bt_snapshot_int(bt_snapshot *snap, const char *name);
double bt_snapshot_real(bt_snapshot *snap, const char *name);
void bt_snapshot_take_rows(bt_snapshot *snap, const char *group, const bt_state_row *row, int n_rows, void *base);
/// [n][width], as bt_snapshot_take; complains of a number that its check does not hold for.
void bt_snapshot_take_row(bt_snapshot *snap, const char *group, const bt_state_row *row, int64_t n, void *to);
/// In new memory, [rows][width]: as bt_snapshot_take.
void *bt_snapshot_copy(bt_snapshot *snap, const char *name, bt_item_type type, int width, int64_t *n);

/// Collective. The snapshot of rank 0 to all ranks; on others it is empty before.
void bt_snapshot_share(const bt_comm *comm, bt_snapshot *snap);

/// The first difference between two states, in words; false when there is none.
bool bt_snapshot_differ(const bt_snapshot *a, const bt_snapshot *b, char out[400]);

void bt_snapshot_free(bt_snapshot *snap);

/// What an array without a row is, its units (NULL: it is text) and its axes, as in h5dataset.h; NULL where that is not
/// known.
typedef const char *bt_item_meaning(const char *name, const char **units, const char **axes);

/// An HDF5 file that takes all arrays added to `snap` from here on, each with its meaning unless that is NULL.
/// `snap` is empty before. What fails here or on the way, bt_snapshot_close returns.
void bt_snapshot_create(bt_snapshot *snap, const char *path, bt_item_meaning *meaning, bt_errors *err);
/// For snapshot.c: the array added last begins, the next rows of it, and the end of a set that is given up.
void bt_snapshot_file_begin(bt_snapshot *snap);
void bt_snapshot_file_put(bt_snapshot *snap, int64_t n, const void *rows);
void bt_snapshot_file_drop(bt_snapshot *snap);
/// Nothing more comes: the file is completed, protected by a checksum, and closed.
void bt_snapshot_end(bt_snapshot *snap, bt_errors *err);
/// The same, unless it has been, and the file stays: without this call bt_snapshot_free removes it. Errors: BT_ERR_IO.
bt_status bt_snapshot_close(bt_snapshot *snap, bt_errors *err);
/// A file in memory. Errors as bt_checksum_check, and BT_ERR_IO.
bt_status bt_snapshot_read(bt_snapshot *snap, const char *path, bt_errors *err);

#endif
