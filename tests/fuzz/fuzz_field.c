// SPDX-License-Identifier: MIT
// Any numbers in an HDF5 field file that is sound as such. (Damaged HDF5 is another matter: the library is not made for
// hostile bytes.)
//
// The input: a byte for ice.nonconvex, four for the numbers of rows of offsets, vertices, pose and thickness, then the
// values as doubles. So that the fuzzer finds its way, small whole numbers stand as themselves: a double is i/16 of a
// 16-bit integer i unless that is one of a few marks.
#include <hdf5.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bergtow/field.h"
#include "bergtow/outline.h"
#include "bergtow/shape.h"
#include "fuzz.h"

typedef struct {
    const uint8_t *data;
    size_t left;
} source;

static int byte_of(source *s)
{
    if (!s->left) return 0;
    s->left--;
    return *s->data++;
}

static double number_of(source *s)
{
    const int16_t i = (int16_t)(byte_of(s) | byte_of(s) << 8);
    static const double marks[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300, 1e-300, 9.3e18, -9.3e18};
    return i >= 32760 ? marks[i - 32760] : i / 16.0;
}

enum { MOST = 300 };

static void put(hid_t file, const char *name, hsize_t rows, hsize_t columns, bool whole, source *s)
{
    static double real[3 * MOST];
    static int64_t integer[3 * MOST];
    for (hsize_t i = 0; i < rows * columns; i++) {
        real[i] = number_of(s);
        const double x = 16 * real[i];
        integer[i] = x >= 9.2e18 ? INT64_MAX : x <= -9.2e18 ? INT64_MIN : x == x ? (int64_t)x : 0;
    }
    const hsize_t dims[2] = {rows, columns};
    const hid_t space = H5Screate_simple(columns > 1 ? 2 : 1, dims, NULL);
    const hid_t d = H5Dcreate2(file, name, whole ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE, space, H5P_DEFAULT,
                               H5P_DEFAULT, H5P_DEFAULT);
    if (rows > 0)
        H5Dwrite(d, whole ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT,
                 whole ? (void *)integer : (void *)real);
    H5Dclose(d);
    H5Sclose(space);
}

static void write_file(const char *path, source *s)
{
    const hid_t file = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    bt_fuzz_check(file >= 0, "HDF5 cannot write the file");
    const hid_t group = H5Gcreate2(file, "/floes", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                scalar = H5Screate(H5S_SCALAR);
    const hsize_t rows[4] = {(hsize_t)byte_of(s), (hsize_t)byte_of(s), (hsize_t)byte_of(s), (hsize_t)byte_of(s)};
    const hid_t a = H5Acreate2(group, "ice_area", H5T_NATIVE_DOUBLE, scalar, H5P_DEFAULT, H5P_DEFAULT);
    const double area = number_of(s);
    H5Awrite(a, H5T_NATIVE_DOUBLE, &area);
    H5Aclose(a);
    put(file, "/floes/offsets", rows[0], 1, true, s);
    put(file, "/floes/thickness", rows[3], 1, false, s);
    put(file, "/floes/pose", rows[2], 3, false, s);
    put(file, "/floes/vertices", rows[1], 2, false, s);
    H5Sclose(scalar);
    H5Gclose(group);
    H5Fclose(file);
}

void bt_fuzz_field(const uint8_t *data, size_t n)
{
    source s = {data, n};
    char path[] = "/tmp/bt_fuzz_field_XXXXXX"; // HDF5 wants a file with a place
    const int fd = mkstemp(path);
    bt_fuzz_check(fd >= 0, "no room in /tmp");
    close(fd);
    const bt_nonconvex nonconvex = (bt_nonconvex)(byte_of(&s) % 3);
    write_file(path, &s);
    bt_field f;
    bt_field_init(&f);
    bt_errors err = {0};
    const bt_status status = bt_field_read(&f, path, nonconvex, &err);
    bt_fuzz_reported(status, &err);
    for (bt_idx i = 0; i < f.n; i++) {
        const int corners = (int)(f.offsets[i + 1] - f.offsets[i]);
        const double *v = f.vertices + 2 * f.offsets[i];
        bt_parts parts;
        bt_fuzz_check(nonconvex == BT_NONCONVEX_SPLIT ? bt_outline_split(corners, v, &parts)
                                                      : bt_outline_convex(corners, v),
                      "an outline was accepted that is no floe");
        bt_fuzz_check(f.area[i] > 0 && isfinite(f.pose[3 * i]) && f.thickness[i] > 0 && isfinite(f.thickness[i]),
                      "a floe of no place, area or thickness");
    }
    bt_fuzz_check(status == BT_OK || f.n == 0, "a refused file left floes");
    bt_field_free(&f);
    unlink(path);
}
