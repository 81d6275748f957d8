// SPDX-License-Identifier: MIT
// Ice field files: what is written is read back to the bit, and no damaged file gets in or crashes the reader.
#include <hdf5.h>
#include <sys/stat.h>
#include <unistd.h>

#include "test.h"
#include "base/checksum.h"
#include "bergtow/field.h"
#include "bergtow/shape.h"

// HDF5 1.10 itself reads past the end of some damaged attributes, and loses some blocks. Which flipped bit
// does it depends on the length of the case's text. Reads by our own code are still reported.
const char *__asan_default_suppressions(void);
const char *__asan_default_suppressions(void) { return "interceptor_via_lib:libhdf5"; }

const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libhdf5"; }

static char folder[] = "/tmp/bt_test_field_XXXXXX";
static char path[64];
static bt_case the_case;

static int make_folder(void **state)
{
    (void)state;
    if (!mkdtemp(folder)) return -1;
    snprintf(path, sizeof path, "%s/a.h5", folder);
    bt_case_defaults(&the_case);
    return 0;
}

static int remove_folder(void **state)
{
    (void)state;
    bt_case_free(&the_case);
    remove(path);
    return rmdir(folder);
}

// Five regular polygons in a row, of three to seven sides.
static bt_field row(void)
{
    bt_field f;
    bt_field_init(&f);
    for (int k = 0; k < 5; k++) {
        double v[2 * 7];
        bt_shape_regular(3 + k, 1 + 0.1 * k, v);
        bt_field_add(&f, 3 + k, v, 2.0 * k, 1.0 / 3, 0.1 * k, 0.5 + k);
    }
    f.ice_area = 20;
    for (int k = 0; k < 5; k++) f.concentration += f.area[k] / f.ice_area;
    return f;
}

static void write_row(void)
{
    bt_field f = row();
    bt_errors err = {0};
    assert_int_equal(bt_field_write(&f, &the_case, path, &err), BT_OK);
    assert_int_equal(err.n, 0);
    bt_field_free(&f);
}

static bt_status read_quietly(bt_field *f, bt_errors *err)
{
    bt_field_init(f);
    return bt_field_read(f, path, BT_NONCONVEX_REFUSE, err);
}

static void assert_refused(bt_status want, const char *part)
{
    bt_field f;
    bt_errors err = {0};
    bt_status got = read_quietly(&f, &err);
    if (got != want) fail_msg("status %d, want %d (%s): %s", got, want, part, err.n ? err.text[0] : "no message");
    assert_true(err.n >= 1 && err.n <= 11);
    if (!strstr(err.text[0], part) || !strstr(err.text[0], path))
        fail_msg("said \"%s\", expected \"%s: ...%s...\"", err.text[0], path, part);
    assert_int_equal(f.n, 0);
    bt_errors_free(&err);
    bt_field_free(&f);
}

TEST(test_round_trip)
{
    bt_field f = row(), g;
    write_row();
    bt_errors err = {0};
    assert_int_equal(read_quietly(&g, &err), BT_OK);
    assert_int_equal(g.n, f.n);
    assert_memory_equal(g.offsets, f.offsets, 6 * sizeof *f.offsets);
    assert_memory_equal(g.vertices, f.vertices, 50 * sizeof *f.vertices);
    assert_memory_equal(g.pose, f.pose, 15 * sizeof *f.pose);
    assert_memory_equal(g.thickness, f.thickness, 5 * sizeof *f.thickness);
    assert_memory_equal(g.area, f.area, 5 * sizeof *f.area);
    assert_true(g.ice_area == f.ice_area && fabs(g.concentration - f.concentration) < 1e-15);
    for (int k = 0; k < 100; k++) bt_field_add(&g, 3, (double[]){0, 0, 1, 0, 0, 1}, k, 0, 0, 1); // and can grow
    assert_int_equal(g.n, 105);
    bt_field_free(&g);
    bt_field_free(&f);
    // no floes
    bt_field_init(&f);
    f.ice_area = 3;
    assert_int_equal(bt_field_write(&f, &the_case, path, &err), BT_OK);
    assert_int_equal(read_quietly(&g, &err), BT_OK);
    assert_true(g.n == 0 && g.offsets[0] == 0 && g.ice_area == 3 && g.concentration == 0);
    bt_field_free(&g);
    bt_field_free(&f);
}

TEST(test_write_failure)
{
    bt_field f = row();
    bt_errors err = {0};
    assert_int_equal(bt_field_write(&f, &the_case, "/nowhere/at/all.h5", &err), BT_ERR_IO);
    assert_true(err.n == 1 && strstr(err.text[0], "/nowhere/at/all.h5"));
    bt_errors_free(&err);
    bt_field_free(&f);
}

static void write_bytes(const char *bytes, size_t n)
{
    FILE *o = fopen(path, "wb");
    assert_non_null(o);
    assert_true(fwrite(bytes, 1, n, o) == n);
    fclose(o);
}

static char *read_bytes(size_t *n)
{
    struct stat st;
    assert_int_equal(stat(path, &st), 0);
    *n = (size_t)st.st_size;
    char *bytes = malloc(*n);
    FILE *i = fopen(path, "rb");
    assert_true(fread(bytes, 1, *n, i) == *n);
    fclose(i);
    return bytes;
}

/// The good file without its checksum, as another program would write it.
static void write_bare(void)
{
    size_t n;
    write_row();
    char *bytes = read_bytes(&n);
    assert_memory_equal(bytes + n - BT_CHECKSUM_BYTES, "bergtow sealed file\n", 20);
    write_bytes(bytes, n - BT_CHECKSUM_BYTES);
    free(bytes);
}

TEST(test_not_a_field)
{
    remove(path);
    assert_refused(BT_ERR_IO, "No such file");
    write_bytes("", 0);
    assert_refused(BT_ERR_CASE, "not an HDF5 file");
    write_bytes("floes: 3\n", 9);
    assert_refused(BT_ERR_CASE, "not an HDF5 file");
    hid_t file = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    H5Fclose(file);
    assert_refused(BT_ERR_CASE, "/floes/offsets: is missing");
}

static void refuse_truncated(void)
{
    size_t n;
    char *bytes = read_bytes(&n);
    for (int k = 0; k < 64; k++) {
        write_bytes(bytes, n * (size_t)k / 64);
        bt_field f;
        bt_errors err = {0};
        bt_status status = read_quietly(&f, &err);
        if (status != BT_ERR_CASE || err.n < 1) fail_msg("%d/64 of the file: status %d", k, status);
        bt_errors_free(&err);
        bt_field_free(&f);
    }
    free(bytes);
}

TEST(test_truncated)
{
    write_row();
    refuse_truncated();
    write_bare();
    refuse_truncated();
}

static uint64_t next_random(void)
{
    static uint64_t x = 88172645463325252u; // xorshift64
    x ^= x << 13, x ^= x >> 7, x ^= x << 17;
    return x;
}

/// Of a protected by a checksum file every flip is refused, wherever it is: checksum, metadata, numbers.
TEST(test_flipped_bits_of_a_sealed_file)
{
    write_row();
    size_t n;
    char *bytes = read_bytes(&n);
    for (int k = 0; k < 1000; k++) {
        const uint64_t x = next_random();
        // A fifth of them in the checksum and the first metadata, which are few bytes.
        const size_t at = k % 5 ? x % n : k % 2 ? x % 1024 : n - 1 - x % BT_CHECKSUM_BYTES;
        bytes[at] ^= (char)(1 << (x >> 40) % 8);
        write_bytes(bytes, n);
        bytes[at] ^= (char)(1 << (x >> 40) % 8);
        bt_field f;
        bt_errors err = {0};
        const bt_status status = read_quietly(&f, &err);
        if (status != BT_ERR_CASE || err.n != 1 || f.n != 0)
            fail_msg("byte %zu flipped: status %d, %s", at, status, err.n ? err.text[0] : "no message");
        bt_errors_free(&err);
        bt_field_free(&f);
    }
    free(bytes);
}

TEST(test_flipped_bits_of_a_bare_file)
{
    write_bare();
    size_t n;
    char *bytes = read_bytes(&n);
    int accepted = 0;
    for (int k = 0; k < 400; k++) {
        char *damaged = malloc(n);
        memcpy(damaged, bytes, n);
        for (int hit = 0; hit < 1 + k % 4; hit++) {
            const uint64_t x = next_random();
            damaged[x % n] ^= (char)(1 << (x >> 40) % 8);
        }
        write_bytes(damaged, n);
        free(damaged);
        bt_field f;
        bt_errors err = {0};
        bt_status status = read_quietly(&f, &err);
        assert_true(status == BT_OK || ((status == BT_ERR_CASE || status == BT_ERR_IO) && err.n >= 1));
        for (bt_idx i = 0; status == BT_OK && i < f.n; i++) { // what gets in is sound
            assert_null(bt_shape_fault((int)(f.offsets[i + 1] - f.offsets[i]), f.vertices + 2 * f.offsets[i]));
            assert_true(isfinite(f.pose[3 * i]) && isfinite(f.pose[3 * i + 1]) && isfinite(f.pose[3 * i + 2]) &&
                        f.thickness[i] > 0);
        }
        accepted += status == BT_OK;
        bt_errors_free(&err);
        bt_field_free(&f);
    }
    assert_true(accepted > 0 && accepted < 400);
    free(bytes);
}

// Write the good file, then overwrite one number of a dataset.
static void spoil(const char *dataset, hsize_t at, double value)
{
    write_bare();
    hid_t file = H5Fopen(path, H5F_ACC_RDWR, H5P_DEFAULT), d = H5Dopen2(file, dataset, H5P_DEFAULT),
          space = H5Dget_space(d);
    hssize_t n = H5Sget_simple_extent_npoints(space);
    double *data = malloc((size_t)n * sizeof *data);
    H5Dread(d, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, data);
    data[at] = value;
    assert_true(H5Dwrite(d, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0);
    free(data);
    H5Sclose(space);
    H5Dclose(d);
    H5Fclose(file);
}

// Write the good file, then replace a dataset; type 0: leave it out.
static void replace(const char *dataset, hid_t type, int rank, const hsize_t *dims, const void *data)
{
    write_bare();
    hid_t file = H5Fopen(path, H5F_ACC_RDWR, H5P_DEFAULT);
    assert_true(H5Ldelete(file, dataset, H5P_DEFAULT) >= 0);
    if (type) {
        hid_t space = H5Screate_simple(rank, dims, NULL),
              d = H5Dcreate2(file, dataset, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
        if (data) H5Dwrite(d, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data);
        H5Dclose(d);
        H5Sclose(space);
    }
    H5Fclose(file);
}

TEST(test_spoiled_values)
{
    spoil("/floes/vertices", 7, NAN);
    assert_refused(BT_ERR_CASE, "floe 1: its outline is refused: a vertex is not a finite number");
    spoil("/floes/vertices", 6, -5);
    assert_refused(BT_ERR_CASE, "floe 1");
    spoil("/floes/vertices", 0, 3);
    assert_refused(BT_ERR_CASE, "floe 0: the centroid");
    spoil("/floes/pose", 4, INFINITY);
    assert_refused(BT_ERR_CASE, "floe 1: its pose is not finite");
    spoil("/floes/thickness", 3, 0);
    assert_refused(BT_ERR_CASE, "floe 3: thickness 0 m is refused");
    spoil("/floes/thickness", 3, NAN);
    assert_refused(BT_ERR_CASE, "floe 3: thickness");
    spoil("/floes/area", 2, 7);
    assert_refused(BT_ERR_CASE, "floe 2: area 7 m2 is not that of its outline");
    spoil("/floes/offsets", 0, 1);
    assert_refused(BT_ERR_CASE, "/floes/offsets: begins with 1");
    spoil("/floes/offsets", 2, 3);
    assert_refused(BT_ERR_CASE, "floe 1: offsets 3 to 3");
    spoil("/floes/offsets", 2, -9e18);
    assert_refused(BT_ERR_CASE, "floe 1: offsets");
    spoil("/floes/offsets", 4, 1000);
    assert_refused(BT_ERR_CASE, "floe 3: offsets 12 to 1000");
    spoil("/floes/offsets", 5, 24);
    assert_refused(BT_ERR_CASE, "/floes/vertices: has 25 rows, the offsets end at 24");
}

TEST(test_spoiled_layout)
{
    const hsize_t five[] = {5}, twentyfive[] = {25, 3}, huge[] = {(hsize_t)1 << 50}, none[] = {0};
    const double numbers[75] = {0};
    const char letters[5] = "abcd";
    replace("/floes/thickness", 0, 0, NULL, NULL);
    assert_refused(BT_ERR_CASE, "/floes/thickness: is missing");
    replace("/floes/vertices", H5T_NATIVE_DOUBLE, 2, twentyfive, numbers);
    assert_refused(BT_ERR_CASE, "/floes/vertices: must have two dimensions, the second of 2");
    replace("/floes/pose", H5T_NATIVE_DOUBLE, 1, five, numbers);
    assert_refused(BT_ERR_CASE, "/floes/pose: must have two dimensions");
    replace("/floes/offsets", H5T_NATIVE_DOUBLE, 1, five, numbers);
    assert_refused(BT_ERR_CASE, "/floes/offsets: holds no integers");
    replace("/floes/offsets", H5T_NATIVE_INT64, 1, none, NULL);
    assert_refused(BT_ERR_CASE, "/floes/offsets: is empty");
    hid_t text = H5Tcopy(H5T_C_S1);
    replace("/floes/thickness", text, 1, five, letters);
    H5Tclose(text);
    assert_refused(BT_ERR_CASE, "/floes/thickness: holds no numbers");
    replace("/floes/thickness", H5T_NATIVE_FLOAT, 1, &(hsize_t){4}, numbers);
    assert_refused(BT_ERR_CASE, "/floes/thickness: has 4 rows for 5 floes");
    write_bare(); // a header that promises a petabyte
    hid_t file = H5Fopen(path, H5F_ACC_RDWR, H5P_DEFAULT), create = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_chunk(create, 1, (hsize_t[]){1024});
    H5Ldelete(file, "/floes/offsets", H5P_DEFAULT);
    hid_t space = H5Screate_simple(1, huge, NULL);
    H5Dclose(H5Dcreate2(file, "/floes/offsets", H5T_NATIVE_INT64, space, H5P_DEFAULT, create, H5P_DEFAULT));
    H5Sclose(space);
    H5Pclose(create);
    H5Fclose(file);
    assert_refused(BT_ERR_CASE, "/floes/offsets: 1125899906842624 rows are more than");
    // the area may be left out, and numbers may be single precision
    replace("/floes/area", 0, 0, NULL, NULL);
    bt_field f;
    bt_errors err = {0};
    assert_int_equal(read_quietly(&f, &err), BT_OK);
    assert_true(fabs(f.area[2] - 1.2) < 1e-12);
    bt_field_free(&f);
    const float thickness[] = {1, 2, 3, 4, 5};
    replace("/floes/thickness", H5T_NATIVE_FLOAT, 1, five, thickness);
    assert_int_equal(read_quietly(&f, &err), BT_OK);
    assert_true(f.thickness[4] == 5);
    bt_field_free(&f);
    write_bare();
    file = H5Fopen(path, H5F_ACC_RDWR, H5P_DEFAULT);
    H5Adelete_by_name(file, "/floes", "ice_area", H5P_DEFAULT);
    H5Fclose(file);
    assert_refused(BT_ERR_CASE, "attribute ice_area");
}

TEST_MAIN(make_folder, remove_folder)
