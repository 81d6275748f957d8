// SPDX-License-Identifier: MIT
// Reading back a file of this program, protected by a checksum, with one way to fail.
#include "base/h5read.h"

#include "base/checksum.h"
#include "base/fileio.h"
#include "base/h5util.h"

typedef struct { const char *path; bt_errors *err; } whole;

/// Returns 0 to continue, 1 if the object is refused and reported, −1 if HDF5 fails.
static herr_t look_at(hid_t group, const char *name, const H5L_info_t *info, void *data)
{
    const whole *w = data;
    if (info->type != H5L_TYPE_HARD) {
        bt_errors_add(w->err,
                      "%s: holds data that this program does not write: /%.200s is %s link. A link can lead to any "
                      "other file and is not followed; store the data itself there",
                      w->path, name,
                      info->type == H5L_TYPE_SOFT       ? "a soft"
                      : info->type == H5L_TYPE_EXTERNAL ? "an external"
                                                        : "a user-defined");
        return 1;
    }
    const hid_t o = H5Oopen(group, name, H5P_DEFAULT);
    if (o < 0) return -1;
    const char *kind = NULL;
    if (H5Iget_type(o) == H5I_DATASET) {
        // The dataspace is not queried: that opens the sources of a virtual dataset.
        const hid_t plan = H5Dget_create_plist(o);
        if (plan >= 0 && H5Pget_layout(plan) == H5D_VIRTUAL) kind = "a virtual dataset";
        else if (plan < 0 || H5Pget_external_count(plan) != 0) kind = "a dataset with external storage";
        if (plan >= 0) H5Pclose(plan);
    }
    H5Oclose(o);
    if (kind)
        bt_errors_add(w->err,
                      "%s: holds data that this program does not write: /%.200s is %s. Its numbers lie in another file "
                      "and are not read; store them in this file",
                      w->path, name, kind);
    return kind != NULL;
}

bt_status bt_h5_whole(hid_t file, const char *path, bt_errors *err)
{
    const herr_t found = H5Lvisit(file, H5_INDEX_NAME, H5_ITER_INC, look_at, &(whole){path, err});
    if (found < 0)
        bt_errors_add(err, "%s: is truncated or damaged: HDF5 cannot list its objects; write it again", path);
    return found == 0 ? BT_OK : BT_ERR_CASE;
}

void bt_h5_fail(bt_h5_reader *reader, const char *why)
{
    if (reader->status != BT_OK) return;
    if (*reader->errnum) {
        reader->status = bt_file_fail(reader->path, "read the file", *reader->errnum, reader->err);
        return;
    }
    reader->status = BT_ERR_CASE;
    bt_errors_add(reader->err, "%s: %s", reader->path, why);
}

static void fail(bt_h5_reader *reader, const char *name)
{
    char why[300];
    snprintf(why, sizeof why, "%.100s cannot be read or has an unexpected shape; use the program that wrote the "
             "file", name);
    bt_h5_fail(reader, why);
}

hid_t bt_h5_open_file(const char *path, int *errnum)
{
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL); // HDF5 prints nothing: one message, ours
    const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    const hid_t file = bt_h5driver_select(access, errnum) < 0 ? -1 : H5Fopen(path, H5F_ACC_RDONLY, access);
    H5Pclose(access);
    return file;
}

bt_status bt_h5_open(bt_h5_reader *reader, const char *path, const char *kind, bt_errors *err)
{
    *reader = (bt_h5_reader){.file = -1, .path = path, .errnum = bt_alloc(1, sizeof(int)), .err = err};
    reader->status = bt_checksum_check(path, kind, NULL, err);
    if (reader->status != BT_OK) return reader->status;
    reader->file = bt_h5_open_file(path, reader->errnum);
    bt_errors found = {0};
    const bool sound = reader->file >= 0 && bt_h5_whole(reader->file, path, &found) == BT_OK;
    if (reader->file < 0 || *reader->errnum) {
        fail(reader, "as HDF5 it");
    } else if (!sound) {
        reader->status = bt_fail(err, BT_ERR_CASE, "%s", found.text[0]);
    }
    bt_errors_free(&found);
    return reader->status;
}

bt_status bt_h5_end(bt_h5_reader *reader)
{
    if (reader->file >= 0) H5Fclose(reader->file);
    reader->file = -1;
    free(reader->errnum);
    reader->errnum = NULL;
    return reader->status;
}

bool bt_h5_there(const bt_h5_reader *reader, const char *name)
{
    return reader->status == BT_OK && H5Lexists(reader->file, name, H5P_DEFAULT) > 0;
}

int64_t bt_h5_size(bt_h5_reader *reader, const char *name, int k)
{
    if (reader->status != BT_OK) return 0;
    hsize_t size[H5S_MAX_RANK] = {0};
    const hid_t d = H5Dopen2(reader->file, name, H5P_DEFAULT), space = d < 0 ? -1 : H5Dget_space(d);
    const int rank = space < 0 ? -1 : H5Sget_simple_extent_dims(space, size, NULL);
    if (space >= 0) H5Sclose(space);
    if (d >= 0) H5Dclose(d);
    if (rank < 0) fail(reader, name);
    return k < rank ? (int64_t)size[k] : 0;
}

void bt_h5_read(bt_h5_reader *reader, const char *name, hid_t mem, int64_t first, int64_t n, int64_t width, void *to)
{
    if (reader->status != BT_OK || n == 0) return;
    hsize_t size[H5S_MAX_RANK] = {0}, start[H5S_MAX_RANK] = {0};
    const hid_t d = H5Dopen2(reader->file, name, H5P_DEFAULT), space = d < 0 ? -1 : H5Dget_space(d);
    const int rank = space < 0 ? -1 : H5Sget_simple_extent_dims(space, size, NULL);
    bool good = rank >= 1 && first >= 0 && n > 0 && (hsize_t)first <= size[0] && (hsize_t)n <= size[0] - (hsize_t)first;
    // Divide: the product of the claimed sizes may overflow.
    hsize_t left = (hsize_t)width;
    bool empty = false;
    for (int k = 1; k < rank; k++) {
        empty = empty || size[k] == 0;
        good = good && (size[k] == 0 || left % size[k] == 0);
        if (good && size[k] > 0) left /= size[k];
    }
    good = good && empty == (width == 0) && (empty || left == 1);
    if (good) {
        start[0] = (hsize_t)first;
        size[0] = (hsize_t)n;
        const hid_t here = H5Screate_simple(rank, size, NULL);
        const bool filled = H5Sget_simple_extent_npoints(here) > 0;
        good = H5Sselect_hyperslab(space, H5S_SELECT_SET, start, NULL, size, NULL) >= 0 &&
               (!filled || H5Dread(d, mem, here, space, H5P_DEFAULT, to) >= 0);
        H5Sclose(here);
    }
    if (space >= 0) H5Sclose(space);
    if (d >= 0) H5Dclose(d);
    if (!good) fail(reader, name);
}

enum { LONGEST_TEXT = 1 << 28 }; // far longer than any case: a claimed length must not exhaust the memory

/// Room for a single text of fixed length; NULL for anything else.
static char *room_for(hid_t type, hid_t space)
{
    const bool one = type >= 0 && H5Tget_class(type) == H5T_STRING && H5Tis_variable_str(type) == 0 &&
                     H5Sget_simple_extent_npoints(space) == 1 && H5Tget_size(type) < LONGEST_TEXT;
    return one ? bt_alloc(H5Tget_size(type) + 1, 1) : NULL;
}

char *bt_h5_read_word(bt_h5_reader *reader, const char *name)
{
    if (reader->status != BT_OK || H5Aexists_by_name(reader->file, "/", name, H5P_DEFAULT) <= 0) return NULL;
    const hid_t a = H5Aopen_by_name(reader->file, "/", name, H5P_DEFAULT, H5P_DEFAULT),
                type = a < 0 ? -1 : H5Aget_type(a), space = a < 0 ? -1 : H5Aget_space(a);
    char *text = room_for(type, space), *variable = NULL;
    if (text && H5Aread(a, type, text) < 0) {
        free(text);
        text = NULL;
    } else if (!text && type >= 0 && H5Tis_variable_str(type) > 0 && H5Sget_simple_extent_npoints(space) == 1 &&
               H5Aread(a, type, &variable) >= 0 && variable) {
        text = bt_text_copy(variable);
    }
    if (variable) H5free_memory(variable);
    if (space >= 0) H5Sclose(space);
    if (type >= 0) H5Tclose(type);
    if (a >= 0) H5Aclose(a);
    return text;
}
