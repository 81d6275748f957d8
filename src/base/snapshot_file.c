// SPDX-License-Identifier: MIT
// A snapshot as an HDF5 file: a dataset for each array, /group/name. Datasets in the root group are dimensions: they
// hold no numbers, and reading skips them.
//
// The file is written under the given name, not a temporary one: that is up to the caller (output/checkpoint.h).
#include <string.h>
#include <unistd.h>

#include "base/fileio.h"
#include "base/h5dataset.h"
#include "base/h5read.h"
#include "base/h5util.h"
#include "base/checksum.h"
#include "base/snapshot.h"

static hid_t memory_type(bt_item_type type)
{
    switch (type) {
    case BT_ITEM_F64: return H5T_NATIVE_DOUBLE;
    case BT_ITEM_I64: return H5T_NATIVE_INT64;
    case BT_ITEM_I32: return H5T_NATIVE_INT32;
    case BT_ITEM_U32: return H5T_NATIVE_UINT32;
    case BT_ITEM_U16: return H5T_NATIVE_UINT16;
    default: return H5T_NATIVE_UINT8;
    }
}

/// Make the group of item k if the item is the first in it.
static void enter(bt_h5 *h5, const bt_snapshot *snap, int k)
{
    const size_t length = strcspn(snap->item[k].name, "/") + 1;
    for (int j = 0; j < k; j++)
        if (!strncmp(snap->item[j].name, snap->item[k].name, length)) return;
    char group[64];
    snprintf(group, sizeof group, "/%.*s", (int)length - 1, snap->item[k].name);
    bt_h5_group(h5, group);
}

struct bt_snapshot_file {
    bt_h5 h;
    char *path;
    bt_item_meaning *meaning;
    hid_t dataset; ///< of the array added last, −1 = none
    bool ended;    ///< closed in HDF5
    bt_status status; ///< of all calls, once ended
};

/// From the row of the array, or from the function given to bt_snapshot_create.
static const char *meaning_of(const struct bt_snapshot_file *file, const bt_item *item, const char **units,
                              const char **axes)
{
    if (!item->meaning) return file->meaning ? file->meaning(item->name, units, axes) : NULL;
    *units = item->units, *axes = item->axes;
    return item->meaning;
}

/// Write some rows, or all at once, which takes a third of the HDF5 calls.
static void put_rows(bt_snapshot *snap, int64_t n, const void *rows)
{
    struct bt_snapshot_file *file = snap->file;
    const bt_item *item = &snap->item[snap->n - 1];
    const hsize_t size[] = {(hsize_t)item->n, (hsize_t)item->width};
    const char *name = BT_BESIDE("/", item->name);
    if (item->type == BT_ITEM_TEXT) {
        bt_h5_write_text(&file->h, name, rows);
    } else if (n == item->n) {
        bt_h5_write(&file->h, name, memory_type(item->type), size[0], item->width > 1 ? size[1] : 0, rows);
    } else {
        if (snap->rows == 0)
            file->dataset = bt_h5_dataset(&file->h, name, memory_type(item->type), item->width > 1 ? 2 : 1, size, 0);
        bt_h5_write_rows(&file->h, file->dataset, memory_type(item->type), false, 0, (hsize_t)snap->rows, (hsize_t)n,
                         rows);
    }
}

/// Complete the last of the first n arrays: all its rows are written.
static void end_array(bt_snapshot *snap, int n)
{
    struct bt_snapshot_file *file = snap->file;
    if (n == 0) return;
    const bt_item *item = &snap->item[n - 1];
    if (file->dataset >= 0) bt_h5_check(&file->h, H5Dclose(file->dataset) >= 0); // small data reach the file only here
    file->dataset = -1;
    const char *units, *axes, *text = meaning_of(file, item, &units, &axes);
    if (!text) return;
    const char *name = BT_BESIDE("/", item->name);
    if (units) bt_h5_units(&file->h, name, units);
    bt_h5_attr_text(&file->h, name, "long_name", text);
}

static void begin_array(bt_snapshot *snap)
{
    end_array(snap, snap->n - 1);
    enter(&snap->file->h, snap, snap->n - 1);
}

void bt_snapshot_end(bt_snapshot *snap, bt_errors *err)
{
    struct bt_snapshot_file *file = snap->file;
    if (file->ended) return;
    file->ended = true;
    file->h.err = err;
    end_array(snap, snap->n);
    // The axes last: a coordinate such as /history/time may come after the arrays that use it.
    for (int k = 0; k < snap->n; k++) {
        const char *units, *axes;
        if (snap->item[k].type == BT_ITEM_TEXT || !meaning_of(file, &snap->item[k], &units, &axes)) continue;
        bt_h5_axes(&file->h, BT_BESIDE("/", snap->item[k].name), axes);
    }
    file->status = bt_h5_close(&file->h);
    if (file->status == BT_OK) file->status = bt_checksum_write(file->path, BT_CHECKSUM_CHECKPOINT, err);
}

static void release(bt_snapshot *snap, bool keep)
{
    if (!keep) unlink(snap->file->path);
    free(snap->file->path);
    free(snap->file);
    snap->file = NULL;
    snap->sink = NULL;
}

bt_status bt_snapshot_close(bt_snapshot *snap, bt_errors *err)
{
    bt_snapshot_end(snap, err);
    const bt_status status = snap->file->status;
    release(snap, status == BT_OK);
    return status;
}

static void drop(bt_snapshot *snap)
{
    snap->file->h.err = NULL;
    if (!snap->file->ended) bt_h5_close(&snap->file->h);
    release(snap, false);
}

void bt_snapshot_create(bt_snapshot *snap, const char *path, bt_item_meaning *meaning, bt_errors *err)
{
    static const bt_snapshot_sink sink = {.begin = begin_array, .put = put_rows, .drop = drop};
    snap->sink = &sink;
    struct bt_snapshot_file *file = snap->file = bt_alloc(1, sizeof *file);
    *file = (struct bt_snapshot_file){.path = bt_text_copy(path), .meaning = meaning, .dataset = -1};
    if (bt_h5_create(&file->h, path, err) == BT_OK) bt_h5_describe_file(&file->h, NULL);
}

enum { MAX_COLUMNS = 1000 };

/// Type and shape of a dataset; false for a dataset that this program does not write.
static bool describe(hid_t d, bt_item_type *type, int64_t *n, int *width)
{
    hsize_t size[2] = {1, 1};
    const hid_t t = H5Dget_type(d), space = H5Dget_space(d);
    const int rank = H5Sget_simple_extent_ndims(space);
    bool good = rank >= 0 && rank <= 2 && H5Sget_simple_extent_dims(space, size, NULL) == rank;
    *n = (int64_t)size[0];
    *width = (int)size[1];
    const size_t bytes = H5Tget_size(t);
    // All that the dataset claims to hold must be stored: this program writes no dataset in part or compressed.
    const hsize_t stored = H5Dget_storage_size(d), numbers = bytes > 0 ? stored / bytes : 0;
    good = good && size[1] >= 1 && size[1] <= MAX_COLUMNS &&
           (size[0] == 0 ? stored == 0
                         : stored == numbers * bytes && numbers % size[1] == 0 && numbers / size[1] == size[0]);
    switch (H5Tget_class(t)) {
    case H5T_FLOAT: *type = BT_ITEM_F64, good = good && bytes == 8; break;
    case H5T_INTEGER: {
        const bool sign = H5Tget_sign(t) == H5T_SGN_2;
        *type = sign         ? bytes == 8 ? BT_ITEM_I64 : BT_ITEM_I32
                : bytes == 4 ? BT_ITEM_U32
                : bytes == 2 ? BT_ITEM_U16
                             : BT_ITEM_U8;
        good = good && bytes == bt_item_size(*type);
        break;
    }
    case H5T_STRING:
        *type = BT_ITEM_TEXT, *n = (int64_t)bytes, *width = 1, good = good && rank == 0 && !H5Tis_variable_str(t);
        break;
    default: good = false;
    }
    H5Tclose(t);
    H5Sclose(space);
    return good;
}

/// Does the text end where its array does, and nowhere before?
static bool is_text(const char *text, int64_t n) { return memchr(text, 0, (size_t)n) == text + n - 1; }

/// Names appear in messages: accept only those that this program writes.
static bool is_name(const char *name) { return name[strspn(name, "abcdefghijklmnopqrstuvwxyz0123456789_/")] == 0; }

static herr_t take(hid_t group, const char *name, const H5L_info_t *info, void *data)
{
    bt_snapshot *snap = data;
    (void)info; // bt_h5_open has refused links
    const hid_t o = H5Oopen(group, name, H5P_DEFAULT);
    herr_t result = o < 0 ? -1 : 0;
    if (o >= 0 && H5Iget_type(o) == H5I_DATASET) {
        bt_item_type type = BT_ITEM_F64;
        int64_t n;
        int width;
        char full[160];
        const ssize_t length = H5Iget_name(o, full, sizeof full);
        if (length < 2 || length >= (ssize_t)sizeof full || !is_name(full) || !describe(o, &type, &n, &width)) {
            result = -1;
        } else {
            void *to = bt_snapshot_begin(snap, full + 1, type, n, width);
            const hid_t stored = H5Dget_type(o);
            if (n * width > 0 &&
                H5Dread(o, type == BT_ITEM_TEXT ? stored : memory_type(type), H5S_ALL, H5S_ALL, H5P_DEFAULT, to) < 0)
                result = -1;
            if (type == BT_ITEM_TEXT && !is_text(to, n)) result = -1;
            H5Tclose(stored);
        }
    }
    if (o >= 0) H5Oclose(o);
    return result;
}

static bool is_dimension(hid_t file, const char *name)
{
    const hid_t o = H5Oopen(file, name, H5P_DEFAULT);
    const bool found = o >= 0 && H5Iget_type(o) == H5I_DATASET && H5Dget_storage_size(o) == 0;
    if (o >= 0) H5Oclose(o);
    return found;
}

static herr_t take_group(hid_t file, const char *name, const H5L_info_t *info, void *data)
{
    (void)info;
    if (is_dimension(file, name)) return 0;
    return H5Literate_by_name(file, name, H5_INDEX_NAME, H5_ITER_INC, NULL, take, data, H5P_DEFAULT);
}

bt_status bt_snapshot_read(bt_snapshot *snap, const char *path, bt_errors *err)
{
    *snap = (bt_snapshot){.path = path, .err = err};
    bt_h5_reader reader;
    if (bt_h5_open(&reader, path, BT_CHECKSUM_CHECKPOINT, err) != BT_OK) return bt_h5_end(&reader);
    if (H5Literate(reader.file, H5_INDEX_NAME, H5_ITER_INC, NULL, take_group, snap) < 0)
        bt_h5_fail(&reader, "holds data that this program does not write; use the program that wrote it");
    const bt_status status = bt_h5_end(&reader);
    if (status != BT_OK) bt_snapshot_free(snap);
    return status;
}
