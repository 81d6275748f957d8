// SPDX-License-Identifier: MIT
// Ice fields in HDF5: written whole or not at all, and checked value by value when read.
//
//     /floes/offsets    [n+1]   first vertex of each floe, and the number of vertices
//     /floes/vertices   [V][2]  m, body frame: anticlockwise about the centroid
//     /floes/pose       [n][3]  x m, y m, yaw rad
//     /floes/thickness  [n]     m
//     /floes/area       [n]     m², optional when read
//     /floes            attributes ice_area m² (to which concentration refers), concentration, n_floes, frame (the
//                       domain.frame of x and y), x_min, y_min, x_max, y_max m (the ice region); the place of x = y =
//                       0, if known: origin_lon, origin_lat deg, or crs, origin_east, origin_north m, where the crs
//                       of metres that are of no projection is BT_MAP_LOCAL_NAME; of made ice n_drawn, n_unplaced,
//                       floes drawn from the size law, and those of them that found no place
//     /case             the resolved case the field was made from
// The reader trusts nothing: the file may be cut off, damaged, or made by hand. Files of this program carry a checksum
// (checksum.h), so damage is refused before HDF5, which some damage crashes, reads a byte. In a file without one, made
// by h5py say, only the values are checked; damage to such a file may still crash HDF5.
#include <hdf5.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bergtow/field.h"
#include "bergtow/outline.h"
#include "base/checksum.h"
#include "base/fileio.h"
#include "base/h5dataset.h"
#include "base/h5read.h"
#include "base/inside.h"
#include "base/largest.h"
#include "case/ice_bounds.h"
#include "field/field_admit.h"
#include "field/field_make.h"
#include "field/map_crs.h"

static const char *const region_names[4] = {"x_min", "y_min", "x_max", "y_max"};

const char *bt_field_frame(const bt_case *input)
{
    return input->domain.frame == BT_FRAME_BASIN ? "basin" : "geographic";
}

// ---- write ----

bt_status bt_field_write(const bt_field *field, const bt_case *input, const char *path, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    // Write under another name until complete, so that a full disk never leaves half a field under the right one.
    const char *part = BT_BESIDE(path, ".part");
    bt_h5 h5;
    bt_status status = bt_h5_create(&h5, part, err);
    if (status == BT_OK) {
        hsize_t n = (hsize_t)field->n, nv = (hsize_t)field->offsets[field->n];
        bt_h5_group(&h5, "/floes");
        bt_h5_put(&h5, "/floes/offsets", H5T_NATIVE_INT64, n + 1, 0, field->offsets, "floe_end", "1",
                  "first vertex of each floe, and the number of vertices");
        bt_h5_put(&h5, "/floes/vertices", H5T_NATIVE_DOUBLE, nv, 2, field->vertices, "floe_vertex xy", "m",
                  "outlines, body frame, anticlockwise about the centroid");
        bt_h5_put(&h5, "/floes/pose", H5T_NATIVE_DOUBLE, n, 3, field->pose, "floe component", "m, m, rad", "x, y, yaw");
        bt_h5_put(&h5, "/floes/thickness", H5T_NATIVE_DOUBLE, n, 0, field->thickness, "floe", "m", "thickness");
        bt_h5_put(&h5, "/floes/area", H5T_NATIVE_DOUBLE, n, 0, field->area, "floe", "m2", "area");
        bt_h5_attr_double(&h5, "/floes", "ice_area", field->ice_area);
        bt_h5_attr_double(&h5, "/floes", "concentration", field->concentration);
        bt_h5_attr_int(&h5, "/floes", "n_floes", field->n);
        if (field->drawn > 0) {
            bt_h5_attr_int(&h5, "/floes", "n_drawn", field->drawn);
            bt_h5_attr_int(&h5, "/floes", "n_unplaced", field->unplaced);
        }
        const double own[4] = {input->ice.x_min, input->ice.y_min, input->ice.x_max, input->ice.y_max};
        const bool read = input->ice.field || input->ice.outlines;
        const double *region = read ? field->outlines.region : own;
        for (int k = 0; k < 4; k++) bt_h5_attr_double(&h5, "/floes", region_names[k], region[k]);
        bt_h5_attr_word(&h5, "/floes", "frame", bt_field_frame(input));
        const bt_map_place place = bt_map_place_of(&field->outlines, input);
        if (place.kind == BT_MAP_DEGREES) {
            bt_h5_attr_double(&h5, "/floes", "origin_lon", place.first * 180 / BT_PI);
            bt_h5_attr_double(&h5, "/floes", "origin_lat", place.second * 180 / BT_PI);
        } else if (*field->outlines.crs) {
            bt_h5_attr_word(&h5, "/floes", "crs", place.crs);
            bt_h5_attr_double(&h5, "/floes", "origin_east", place.first);
            bt_h5_attr_double(&h5, "/floes", "origin_north", place.second);
        }
        char *text = bt_case_resolved(input);
        bt_h5_put_text(&h5, "/case", text, "the case with every key, in SI units");
        bt_h5_describe_file(&h5, input->run.title);
        free(text);
        bt_h5_attr_text(&h5, "/", "program", "bergtow " BT_VERSION);
        status = bt_h5_close(&h5);
        if (status == BT_OK) status = bt_checksum_publish(part, path, BT_CHECKSUM_FIELD, err);
        if (status != BT_OK) unlink(part);
    }
    return status;
}

// ---- read ----

typedef struct reader {
    hid_t file;
    bt_nonconvex nonconvex;
    bool bare;                ///< without the checksum of this program's files
    bt_outline_counts counts;
    bt_refusals r;
} reader;

// Whole dataset of doubles or 64-bit integers with `width` columns (0: rank 1); NULL after a refusal. *rows: its
// length.
static void *read_dataset(reader *in, const char *name, bool integers, hsize_t width, hsize_t most, hsize_t *rows)
{
    if (in->r.status != BT_OK) return NULL;
    void *data = NULL;
    hid_t d = H5Dopen2(in->file, name, H5P_DEFAULT);
    if (d < 0) {
        bt_refuse(&in->r, "dataset %s: is missing or damaged; write the file with `bergtow field`, or add it", name);
        return NULL;
    }
    hid_t space = H5Dget_space(d), type = H5Dget_type(d);
    H5T_class_t class = H5Tget_class(type);
    hsize_t dims[H5S_MAX_RANK] = {0};
    int rank = H5Sget_simple_extent_dims(space, dims, NULL), wanted = width ? 2 : 1;
    bool counts = class == H5T_INTEGER, numbers = counts || class == H5T_FLOAT;
    if (integers ? !counts : !numbers) {
        bt_refuse(&in->r, "dataset %s: holds no %s; store it as %s", name, integers ? "integers" : "numbers",
                  integers ? "int64" : "float64");
    } else if (rank != wanted || (width && dims[1] != width)) {
        if (width)
            bt_refuse(&in->r, "dataset %s: must have two dimensions, the second of %llu", name,
                      (unsigned long long)width);
        else bt_refuse(&in->r, "dataset %s: must have one dimension", name);
    } else if (dims[0] > most) {
        bt_refuse(&in->r, "dataset %s: %llu rows are more than %llu; the file is damaged or too large", name,
               (unsigned long long)dims[0], (unsigned long long)most);
    } else {
        *rows = dims[0];
        data = bt_alloc((size_t)(dims[0] * (width ? width : 1)) + 1, 8);
        if (dims[0] > 0 &&
            H5Dread(d, integers ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0)
            bt_refuse(&in->r, "dataset %s: cannot be read: the file is truncated or damaged; write it again", name);
    }
    H5Tclose(type);
    H5Sclose(space);
    H5Dclose(d);
    return data;
}

/// A numeric attribute of /floes; NaN if missing or not a number.
static double read_number(const reader *in, const char *name)
{
    double number = NAN;
    hid_t a = H5Aopen_by_name(in->file, "/floes", name, H5P_DEFAULT, H5P_DEFAULT);
    if (a < 0) return number;
    hid_t space = H5Aget_space(a), type = H5Aget_type(a);
    H5T_class_t class = H5Tget_class(type);
    bool one = H5Sget_simple_extent_npoints(space) == 1 && (class == H5T_FLOAT || class == H5T_INTEGER);
    if (one && H5Aread(a, H5T_NATIVE_DOUBLE, &number) < 0) number = NAN;
    H5Tclose(type);
    H5Sclose(space);
    H5Aclose(a);
    return number;
}

/// A word among the attributes of /floes, or "": files of other programs may have none. Only strings of fixed length
/// are read: HDF5 1.10 may search for one of variable length forever if bits of the file are flipped.
static void read_word(const reader *in, const char *name, size_t size, char word[size])
{
    *word = 0;
    if (in->r.status != BT_OK || H5Aexists_by_name(in->file, "/floes", name, H5P_DEFAULT) <= 0) return;
    hid_t a = H5Aopen_by_name(in->file, "/floes", name, H5P_DEFAULT, H5P_DEFAULT), type = H5Aget_type(a),
          space = H5Aget_space(a);
    if (H5Tget_class(type) == H5T_STRING && H5Tis_variable_str(type) == 0 && H5Tget_size(type) < size &&
        H5Sget_simple_extent_npoints(space) == 1 && H5Aread(a, type, word) < 0)
        *word = 0;
    word[size - 1] = 0;
    H5Sclose(space);
    H5Tclose(type);
    H5Aclose(a);
}

/// The ice region, if the file has all four limits; files of other programs may not.
static void read_region(const reader *in, double region[4])
{
    double x[4];
    for (int k = 0; k < 4; k++) {
        if (in->r.status != BT_OK || H5Aexists_by_name(in->file, "/floes", region_names[k], H5P_DEFAULT) <= 0) return;
        x[k] = read_number(in, region_names[k]);
    }
    if (x[0] < x[2] && x[1] < x[3]) memcpy(region, x, sizeof x);
}

/// The place of x = y = 0, if the file gives one that makes sense.
static void read_place(reader *in)
{
    bt_outline_counts *counts = &in->counts;
    const double lon = read_number(in, "origin_lon"), lat = read_number(in, "origin_lat"),
                 east = read_number(in, "origin_east"), north = read_number(in, "origin_north");
    char name[64];
    read_word(in, "crs", sizeof name, name);
    const bt_map_crs crs = bt_map_crs_of(name);
    if (lon >= -180 && lon <= 360 && fabs(lat) <= 90) {
        bt_map_set_degrees(counts, lon * BT_PI / 180, lat * BT_PI / 180);
    } else if ((crs.kind == BT_MAP_PLANE || crs.kind == BT_MAP_LOCAL) && isfinite(east) && isfinite(north)) {
        memcpy(counts->crs, crs.name, sizeof crs.name);
        counts->east = east, counts->north = north;
        counts->lon = counts->lat = NAN;
    }
}

/// The counts of the size law, of a field that was made.
static void read_drawn(const reader *in, bt_field *field)
{
    const double drawn = read_number(in, "n_drawn"), unplaced = read_number(in, "n_unplaced");
    if (drawn <= BT_MAX_FLOES && unplaced >= 0 && unplaced <= drawn)
        field->drawn = (int64_t)drawn, field->unplaced = (int64_t)unplaced;
}

static double read_ice_area(reader *in)
{
    if (in->r.status != BT_OK) return NAN;
    const double area = read_number(in, "ice_area");
    if (isnan(area))
        bt_refuse(&in->r, "attribute ice_area of /floes: is missing or not a number; give the area in m2 that the "
                          "concentration refers to");
    return area;
}

static void check_offsets(reader *in, const int64_t *offsets, hsize_t n, hsize_t n_vertices)
{
    if (in->r.status != BT_OK) return;
    if (offsets[0] != 0) bt_refuse(&in->r, "dataset /floes/offsets: begins with %lld, not 0", (long long)offsets[0]);
    // Differences of hostile numbers may overflow: compare first, then subtract.
    for (hsize_t i = 0; i < n && in->r.status == BT_OK; i++) {
        int64_t a = offsets[i], b = offsets[i + 1];
        if (a < 0 || b <= a || (hsize_t)b > n_vertices)
            bt_refuse(&in->r,
                      "floe %llu: offsets %lld to %lld are refused: they must rise and stay within the %llu vertices",
                      (unsigned long long)i, (long long)a, (long long)b, (unsigned long long)n_vertices);
        else if (b - a > BT_MAX_VERTICES)
            bt_refuse(&in->r, "floe %llu: has %lld vertices, more than %d", (unsigned long long)i, (long long)(b - a),
                      BT_MAX_VERTICES);
    }
    if (in->r.status == BT_OK && (hsize_t)offsets[n] != n_vertices)
        bt_refuse(&in->r, "dataset /floes/vertices: has %llu rows, the offsets end at %lld",
                  (unsigned long long)n_vertices, (long long)offsets[n]);
}

static void check_floe(reader *in, const bt_field *field, bt_idx i, const double *stored_area)
{
    int n = (int)(field->offsets[i + 1] - field->offsets[i]);
    const double *v = field->vertices + 2 * field->offsets[i], *p = field->pose + 3 * i;
    const char *fault = bt_shape_fault(n, v);
    if (fault) {
        double own[2 * BT_MAX_VERTICES];
        int n_own = n;
        memcpy(own, v, 2 * (size_t)n * sizeof *v);
        fault = bt_outline_admit(in->nonconvex, &n_own, own, &in->counts);
    }
    if (fault) {
        bt_refuse(&in->r, "floe %d: its outline is refused: %s", i, fault);
        return;
    }
    char why[BT_ICE_WHY];
    const bt_ice_floe given = {n, v, p[0], p[1], p[2], field->thickness[i], stored_area ? stored_area[i] : NAN, 1e-9};
    if ((fault = bt_ice_floe_fault(&given, why, NULL))) bt_refuse(&in->r, "floe %d: %s", i, fault);
    field->area[i] = stored_area ? stored_area[i] : bt_shape_centroid(n, v).area;
}

static void same_length(reader *in, const char *name, hsize_t rows, hsize_t n)
{
    if (in->r.status == BT_OK && rows != n)
        bt_refuse(&in->r, "dataset %s: has %llu rows for %llu floes", name, (unsigned long long)rows,
                  (unsigned long long)n);
}

static void read_floes(reader *in, bt_field *field)
{
    hsize_t n_offsets = 0, n_vertices = 0, n_pose = 0, n_thickness = 0, n_area = 0;
    bt_field_free(field);
    field->offsets = read_dataset(in, "/floes/offsets", true, 0, BT_MAX_FLOES + 1, &n_offsets);
    if (in->r.status == BT_OK && n_offsets < 1)
        bt_refuse(&in->r, "dataset /floes/offsets: is empty; even a field without floes has the entry 0");
    hsize_t n = n_offsets ? n_offsets - 1 : 0;
    field->vertices = read_dataset(in, "/floes/vertices", false, 2, BT_MAX_VERTICES * n, &n_vertices);
    check_offsets(in, field->offsets, n, n_vertices);
    field->pose = read_dataset(in, "/floes/pose", false, 3, BT_MAX_FLOES, &n_pose);
    same_length(in, "/floes/pose", n_pose, n);
    field->thickness = read_dataset(in, "/floes/thickness", false, 0, BT_MAX_FLOES, &n_thickness);
    same_length(in, "/floes/thickness", n_thickness, n);
    double *stored_area = NULL;
    if (in->r.status == BT_OK && H5Lexists(in->file, "/floes/area", H5P_DEFAULT) > 0) {
        stored_area = read_dataset(in, "/floes/area", false, 0, BT_MAX_FLOES, &n_area);
        same_length(in, "/floes/area", n_area, n);
    }
    field->ice_area = read_ice_area(in);
    read_word(in, "frame", sizeof field->frame, field->frame);
    read_place(in);
    read_region(in, in->counts.region);
    read_drawn(in, field);
    if (in->r.status == BT_OK) {
        field->n = field->cap = (bt_idx)n;
        field->cap_vertices = (int64_t)n_vertices;
        field->area = bt_alloc((size_t)n, sizeof *field->area);
        double sum = 0, size = 0;
        for (bt_idx i = 0; i < field->n; i++) {
            check_floe(in, field, i, stored_area);
            sum += field->area[i];
            size += sqrt(4 * field->area[i] / BT_PI);
        }
        // Our own files, if made from outlines with floes outside the ice region, hold a lower concentration.
        field->concentration = sum / field->ice_area;
        const double said = in->bare ? NAN : read_number(in, "concentration");
        if (said < field->concentration * (1 - 1e-9)) field->concentration = said, sum = said * field->ice_area;
        char why[BT_ICE_WHY];
        if (in->r.status == BT_OK && bt_ice_field_fault(false, field->n, size, sum, field->ice_area, why))
            bt_refuse(&in->r, "attribute ice_area of /floes: %s", why);
    }
    free(stored_area);
}

/// Replace the outlines of floes that are not convex by the admitted ones; unchanged outlines stay bit-identical.
static void take_admitted(bt_field *f, bt_nonconvex nonconvex)
{
    bt_field g = bt_field_like(f);
    double sum = 0, before = 0;
    for (bt_idx i = 0; i < f->n; i++) {
        const double *v = f->vertices + 2 * f->offsets[i], *p = f->pose + 3 * (size_t)i;
        const int n = (int)(f->offsets[i + 1] - f->offsets[i]);
        int left = n;
        double own[2 * BT_MAX_VERTICES];
        bt_outline_counts counted = {0};
        memcpy(own, v, 2 * (size_t)n * sizeof *v);
        if (!bt_outline_convex(n, v)) bt_outline_admit(nonconvex, &left, own, &counted);
        bt_field_add(&g, left, own, p[0], p[1], p[2], f->thickness[i]);
        if (left == n) { // unchanged: undo the last digits that centring again has changed
            memcpy(g.vertices + 2 * g.offsets[i], v, 2 * (size_t)n * sizeof *v);
            memcpy(g.pose + 3 * (size_t)i, p, 3 * sizeof *p);
            g.area[i] = f->area[i];
        }
        sum += g.area[i], before += f->area[i];
    }
    // the file's concentration may leave out floes beyond its ice region
    g.concentration = bt_min(f->concentration * (sum / before), bt_max(f->concentration, 1));
    bt_field_free(f);
    *f = g;
}

bt_status bt_field_read(bt_field *field, const char *path, bt_nonconvex nonconvex, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    bool bare;
    const bt_status checked = bt_checksum_check(path, BT_CHECKSUM_FIELD, &bare, err);
    if (checked != BT_OK) return checked;
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL); // only our own message
    if (H5Fis_hdf5(path) <= 0)
        return bt_fail(err, BT_ERR_CASE,
                       "%s: is not an HDF5 file; make an ice field with `bergtow field CASE.yml -o FILE.h5`, or name "
                       "outlines (GeoJSON) with ice.outlines",
                       path);
    int errnum = 0; // of a failed read: messages about the contents then mean nothing
    bt_errors found = {0};
    reader in = {.nonconvex = nonconvex, .bare = bare, .r = {.path = path, .err = &found, .status = BT_ERR_CASE}};
    in.file = bt_h5_open_file(path, &errnum);
    if (in.file < 0) bt_errors_add(&found, "%s: is truncated or damaged: HDF5 cannot open it; write it again", path);
    else if ((in.r.status = bt_h5_whole(in.file, path, &found)) == BT_OK) read_floes(&in, field);
    if (in.file >= 0) H5Fclose(in.file);
    if (errnum) in.r.status = bt_file_fail(path, "read the file", errnum, err);
    else bt_errors_move(err, &found);
    bt_errors_free(&found); // those that errnum makes meaningless
    if (in.r.status == BT_OK) {
        if (in.counts.hulled || in.counts.rounded) take_admitted(field, nonconvex);
        field->outlines = in.counts;
    } else {
        bt_field_free(field);
        bt_field_init(field);
    }
    return in.r.status;
}

// --- as fixed floes --------------------------------------------------------------------------------------------------

// Write a field as a list of fixed floes: a coast or structures from a map, for a case with any other ice.

/// Beginning of a file that this program has written.
#define HEAD "# fixed floes, written by bergtow "

bool bt_field_fixed_ours(const char *path) { return bt_file_begins(path, HEAD); }

bt_status bt_field_write_fixed(const bt_field *field, const bt_case *input, const char *path, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    bt_text lines;
    bt_text_begin(&lines);
    FILE *out = lines.out;
    const char *frame = bt_field_frame(input);
    fprintf(out, HEAD BT_VERSION "\n# x and y in metres of the frame %s\ndomain: {frame: %s}\nfloes:\n", frame, frame);
    for (bt_idx i = 0; i < field->n; i++) {
        const double *p = field->pose + 3 * (size_t)i;
        fprintf(out,
                "  - {shape: polygon, fixed: true, x: %.17g, y: %.17g, yaw: %.17g rad, thickness: %.17g, vertices: [",
                p[0], p[1], p[2], field->thickness[i]);
        for (int64_t k = field->offsets[i]; k < field->offsets[i + 1]; k++)
            fprintf(out, "%s[%.17g, %.17g]", k > field->offsets[i] ? ", " : "", field->vertices[2 * k],
                    field->vertices[2 * k + 1]);
        fprintf(out, "]}\n");
    }
    char *text = bt_text_end(&lines);
    const bt_status status = bt_file_write(path, text, err);
    free(text);
    return status;
}
