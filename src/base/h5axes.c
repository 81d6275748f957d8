// SPDX-License-Identifier: MIT
// What a dataset holds, for programs that do not know this one.
#include "base/h5axes.h"

#include <hdf5_hl.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "bergtow/base.h"

enum { MOST_AXES = 3, PATH = 200 };

/// The name by which netCDF knows a dimension without a coordinate.
static const char no_variable[] = "This is a netCDF dimension but not a netCDF variable. %10" PRIu64;

static bool there(const bt_h5 *h, const char *path) { return H5Lexists(h->file, path, H5P_DEFAULT) > 0; }

/// A dimension without a coordinate: no value is ever written, and no storage taken.
static hid_t make_dimension(bt_h5 *h, const char *path, hsize_t length, bool grows)
{
    const hsize_t most = grows ? H5S_UNLIMITED : length;
    const hid_t space = H5Screate_simple(1, &length, &most), how = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_obj_track_times(how, false);
    H5Pset_fill_time(how, H5D_FILL_TIME_NEVER);
    if (grows) H5Pset_chunk(how, 1, (hsize_t[]){1024});
    const hid_t d = H5Dcreate2(h->file, path, H5T_IEEE_F32BE, space, H5P_DEFAULT, how, H5P_DEFAULT);
    char name[100];
    snprintf(name, sizeof name, no_variable, (uint64_t)length);
    bt_h5_check(h, d >= 0 && H5DSset_scale(d, name) >= 0);
    H5Pclose(how);
    H5Sclose(space);
    return d;
}

/// The scale of an axis of a dataset: beside it, in the root group, or new there.
static hid_t scale_of(bt_h5 *h, const char *dataset, const char *axis, hsize_t length, bool grows)
{
    char path[PATH];
    snprintf(path, sizeof path, "%.*s/%s", (int)(strrchr(dataset, '/') - dataset), dataset, axis);
    if (!there(h, path)) snprintf(path, sizeof path, "/%s", axis);
    if (!there(h, path)) return make_dimension(h, path, length, grows);
    const hid_t d = H5Dopen2(h->file, path, H5P_DEFAULT);
    bt_h5_check(h, d >= 0 && (H5DSis_scale(d) > 0 || H5DSset_scale(d, axis) >= 0));
    return d;
}

void bt_h5_axes(bt_h5 *h, const char *dataset, const char *axes)
{
    if (h->status != BT_OK || h->file < 0) return;
    const hid_t d = H5Dopen2(h->file, dataset, H5P_DEFAULT), space = H5Dget_space(d);
    hsize_t now[MOST_AXES] = {0}, most[MOST_AXES] = {0};
    const int rank = H5Sget_simple_extent_ndims(space);
    bt_h5_check(h, d >= 0 && rank >= 1 && rank <= MOST_AXES && H5Sget_simple_extent_dims(space, now, most) == rank);
    const char *word = axes;
    for (int k = 0; k < rank && h->status == BT_OK; k++) {
        char axis[40];
        const size_t n = strcspn(word, " ");
        snprintf(axis, sizeof axis, "%.*s", (int)n, word);
        word += n + (word[n] == ' ');
        const hid_t scale = scale_of(h, dataset, axis, now[k], most[k] == H5S_UNLIMITED);
        // a coordinate is its own axis, and has none
        if (scale >= 0 && H5DSis_scale(d) <= 0) bt_h5_check(h, H5DSattach_scale(d, scale, (unsigned)k) >= 0);
        if (scale >= 0) H5Dclose(scale);
    }
    H5Sclose(space);
    if (d >= 0) H5Dclose(d);
}

void bt_h5_units(bt_h5 *h, const char *dataset, const char *units)
{
    bt_h5_attr_text(h, dataset, strchr(units, ',') ? "units_of_columns" : "units", units);
}

void bt_h5_describe(bt_h5 *h, const char *dataset, const char *axes, const char *units, const char *meaning)
{
    if (h->status != BT_OK || h->file < 0) return;
    if (units) bt_h5_units(h, dataset, units);
    bt_h5_attr_text(h, dataset, "long_name", meaning);
    bt_h5_attr_text(h, dataset, "description", meaning);
    if (axes) bt_h5_axes(h, dataset, axes);
}

void bt_h5_describe_file(bt_h5 *h, const char *title)
{
    bt_h5_attr_text(h, "/", "Conventions", "CF-1.8");
    bt_h5_attr_text(h, "/", "source", "bergtow " BT_VERSION ", a simulation");
    if (title && *title) bt_h5_attr_text(h, "/", "title", title);
}
