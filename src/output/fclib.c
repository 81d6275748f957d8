// SPDX-License-Identifier: MIT
// The contact problem of one step in the file format of FCLIB, so that other solvers can check ours.
//
// Layout as FCLIB's reader (github.com/FrictionalContactLibrary/fclib, src/fclib.h) expects it; every scalar is a
// dataset of one entry, integers are of 32 bits:
//     /fclib_local/spacedim                       2
//     /fclib_local/W/{nzmax, m, n, nz, p, i, x}    nz = −2: compressed rows (p [m+1], i columns, x values)
//     /fclib_local/vectors/{q [m], mu [m/2]}
//     /fclib_local/info/{title, description, math_info}   fixed-length strings
//     /solution/{u, r}
//     /bound, /disc, /ends, /places                of our own: bounds of the normal impulses; what sheets bear (mu is
//                                                  0), a disc, of which this is the radius (NaN = another contact),
//                                                  and a line, of which this is half; where contacts and bodies are
#include "bergtow/fclib.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/fileio.h"
#include "base/h5dataset.h"

#define COMPRESSED_ROWS (-2)

static bt_status refuse(const char *path, const char *reason, bt_errors *err)
{
    bt_errors_add(err, "%s: the contact problem is not written: %s", path, reason);
    return BT_ERR_USAGE;
}

static bt_status check_problem(const char *path, const bt_fclib_problem *p, bt_errors *err)
{
    if (p->n < 1) return refuse(path, "there are no contacts in this step; choose a step with contacts", err);
    if (p->n > INT32_MAX / 2) return refuse(path, "the format has 32-bit sizes; choose a smaller case", err);
    if (!p->u != !p->r) return refuse(path, "a solution needs both velocities and impulses", err);
    const int m = 2 * p->n;
    if (p->w_ptr[0] != 0 || p->w_ptr[m] > INT32_MAX)
        return refuse(path, "the format has 32-bit sizes; choose a smaller case", err);
    for (int i = 0; i < m; i++) {
        if (p->w_ptr[i + 1] < p->w_ptr[i]) return refuse(path, "the rows of W are out of order", err);
        for (int64_t k = p->w_ptr[i]; k < p->w_ptr[i + 1]; k++)
            if (p->w_col[k] < 0 || p->w_col[k] >= m) return refuse(path, "W has a column outside the problem", err);
    }
    return BT_OK;
}

/// A dataset and what it holds; axes, units and meaning as for bt_h5_describe.
static void put(bt_h5 *h, const char *name, hid_t type, hsize_t n, hsize_t width, const void *data, const char *axes,
                const char *units, const char *meaning)
{
    bt_h5_write(h, name, type, n, width, data);
    bt_h5_describe(h, name, axes, units, meaning);
}

static void put_int(bt_h5 *h, const char *name, int value, const char *meaning)
{
    put(h, name, H5T_NATIVE_INT, 1, 0, &value, "one", "1", meaning);
}

static void put_text(bt_h5 *h, const char *name, const char *text, const char *meaning)
{
    bt_h5_write_text(h, name, text);
    bt_h5_describe(h, name, NULL, NULL, meaning);
}

static void put_rows(bt_h5 *h, const char *name, int m, const double *data, const char *units, const char *meaning)
{
    put(h, name, H5T_NATIVE_DOUBLE, (hsize_t)m, 0, data, "row", units, meaning);
}

static void write_problem(bt_h5 *h, const bt_fclib_problem *x)
{
    const int m = 2 * x->n;
    int32_t *rows = bt_alloc((size_t)m + 1, sizeof *rows);
    for (int i = 0; i <= m; i++) rows[i] = (int32_t)x->w_ptr[i];
    bt_h5_group(h, "/fclib_local");
    put_int(h, "/fclib_local/spacedim", 2, "dimensions of space");
    bt_h5_group(h, "/fclib_local/W");
    put_int(h, "/fclib_local/W/nzmax", rows[m], "entries of W");
    put_int(h, "/fclib_local/W/m", m, "rows of W");
    put_int(h, "/fclib_local/W/n", m, "columns of W");
    put_int(h, "/fclib_local/W/nz", COMPRESSED_ROWS, "kind of storage: -2, compressed rows");
    put(h, "/fclib_local/W/p", H5T_NATIVE_INT32, (hsize_t)m + 1, 0, rows, "row_end", "1",
        "row i has the entries p[i] up to p[i + 1]");
    put(h, "/fclib_local/W/i", H5T_NATIVE_INT32, (hsize_t)rows[m], 0, x->w_col, "entry", "1", "column of each entry");
    put(h, "/fclib_local/W/x", H5T_NATIVE_DOUBLE, (hsize_t)rows[m], 0, x->w_val, "entry", "kg-1", "entries of W");
    bt_h5_group(h, "/fclib_local/vectors");
    put_rows(h, "/fclib_local/vectors/q", m, x->q, "m/s", "velocities without impulses: u = W r + q");
    put(h, "/fclib_local/vectors/mu", H5T_NATIVE_DOUBLE, (hsize_t)x->n, 0, x->mu, "contact", "1", "friction");
    free(rows);
    bt_h5_group(h, "/fclib_local/info");
    put_text(h, "/fclib_local/info/title", x->title ? x->title : "", "title");
    put_text(h, "/fclib_local/info/description", x->description ? x->description : "", "description");
    put_text(h, "/fclib_local/info/math_info",
             "2-D Signorini-Coulomb: u = W r + q in m/s, r in N s; rows of a contact: normal, tangent",
             "what the problem is");
}

static void write_places(bt_h5 *h, const bt_fclib_places *p, hsize_t n)
{
    bt_h5_group(h, "/places");
    bt_h5_attr_double(h, "/places", "time", p->time);
    bt_h5_attr_double(h, "/places", "dt", p->dt);
    put(h, "/places/body", H5T_NATIVE_INT64, n, 2, p->body, "contact pair", "1",
        "ids of the two bodies of each contact");
    put(h, "/places/normal", H5T_NATIVE_DOUBLE, n, 2, p->normal, "contact xy", "1",
        "from the first body to the second, world frame");
    put(h, "/places/lever", H5T_NATIVE_DOUBLE, n, 4, p->lever, "contact pair_xy", "m",
        "from the centroid of the first and of the second body to the contact point, world frame, at the start of the "
        "step");
    put(h, "/places/pose", H5T_NATIVE_DOUBLE, (hsize_t)p->n_bodies, 3, p->pose, "any_body component", "m, m, rad",
        "x, y, yaw of every body at the end of the step, by id");
}

/// What the format does not know, and the solution.
static void write_more(bt_h5 *h, const bt_fclib_problem *p)
{
    const hsize_t n = (hsize_t)p->n;
    if (p->bound)
        put(h, "/bound", H5T_NATIVE_DOUBLE, n, 0, p->bound, "contact", "N s", "upper bound of the normal impulse");
    if (p->disc)
        put(h, "/disc", H5T_NATIVE_DOUBLE, n, 0, p->disc, "contact", "N s",
            "sheets: their impulse is the sum of a point of the disc of this radius and of a point of the line from "
            "-ends to ends; NaN: another contact");
    if (p->ends) put_rows(h, "/ends", 2 * p->n, p->ends, "N s", "half of that line; 0 of other contacts");
    if (p->places) write_places(h, p->places, n);
    if (!p->r) return;
    bt_h5_group(h, "/solution");
    put_rows(h, "/solution/u", 2 * p->n, p->u, "m/s", "velocities of the solution");
    put_rows(h, "/solution/r", 2 * p->n, p->r, "N s", "impulses of the solution");
}

bt_status bt_fclib_write(const char *path, const bt_fclib_problem *p, bt_errors *err)
{
    bt_status status = check_problem(path, p, err);
    if (status != BT_OK) return status;
    char *temporary = bt_text_of("%s.tmp", path);
    bt_h5 h;
    status = bt_h5_create(&h, temporary, err);
    if (status == BT_OK) {
        bt_h5_describe_file(&h, p->title ? p->title : "contact problem");
        write_problem(&h, p);
        write_more(&h, p);
        status = bt_h5_close(&h);
        if (status == BT_OK) status = bt_file_rename(temporary, path, err);
        if (status != BT_OK) unlink(temporary);
    }
    free(temporary);
    return status;
}
