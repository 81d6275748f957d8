// SPDX-License-Identifier: MIT
// A contact problem in FCLIB's format, read back dataset by dataset as FCLIB's own reader does.
#include <sys/stat.h>
#include <unistd.h>
#include <hdf5.h>

#include "test.h"
#include "bergtow/fclib.h"

// Two contacts on one body of unit mass, the second also held by a heavier one: W couples them.
enum { N = 2, M = 2 * N };
static const int64_t ptr[M + 1] = {0, 3, 6, 9, 12};
static const int32_t col[12] = {0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 3};
static const double val[12] = {2, 0.25, -1, 0.25, 3, 0.5, -1, 2.5, 0.125, 0.5, 0.125, 4};
static const double q[M] = {-1, 0.5, -0.25, 0.1}, mu[N] = {0.3, 0.05};
static const double u[M] = {0, 0.3, 0, 0.05}, r[M] = {0.6, -0.18, 0.4, -0.02};

static char path[64];

static bt_status write_it(const char *to, int n, const double *su, bt_errors *err)
{
    const bt_fclib_problem p = {.n = n, .w_ptr = ptr, .w_col = col, .w_val = val, .q = q, .mu = mu, .u = su, .r = r,
                                .title = "two contacts", .description = ""};
    return bt_fclib_write(to, &p, err);
}

static hsize_t length(hid_t f, const char *name, H5T_class_t class, size_t size)
{
    const hid_t d = H5Dopen2(f, name, H5P_DEFAULT);
    if (d < 0) fail_msg("no %s", name);
    const hid_t t = H5Dget_type(d), s = H5Dget_space(d);
    assert_int_equal(H5Tget_class(t), class);
    if (size) assert_int_equal(H5Tget_size(t), size);
    hsize_t n = 0;
    if (class != H5T_STRING) assert_int_equal(H5Sget_simple_extent_dims(s, &n, NULL), 1); // a scalar is [1] too
    H5Sclose(s);
    H5Tclose(t);
    H5Dclose(d);
    return n;
}

static void check_doubles(hid_t f, const char *name, const double *expected, hsize_t n)
{
    double x[16];
    assert_int_equal(length(f, name, H5T_FLOAT, 8), n);
    const hid_t d = H5Dopen2(f, name, H5P_DEFAULT);
    assert_true(H5Dread(d, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, x) >= 0);
    H5Dclose(d);
    assert_memory_equal(x, expected, n * sizeof *x);
}

static void check_ints(hid_t f, const char *name, const int *expected, hsize_t n)
{
    int x[16];
    assert_int_equal(length(f, name, H5T_INTEGER, 4), n);
    const hid_t d = H5Dopen2(f, name, H5P_DEFAULT);
    assert_true(H5Dread(d, H5T_NATIVE_INT, H5S_ALL, H5S_ALL, H5P_DEFAULT, x) >= 0);
    H5Dclose(d);
    assert_memory_equal(x, expected, n * sizeof *x);
}

static void check_text(hid_t f, const char *name, const char *expected)
{
    length(f, name, H5T_STRING, strlen(expected) + 1);
    char text[200] = "";
    const hid_t d = H5Dopen2(f, name, H5P_DEFAULT), t = H5Dget_type(d);
    assert_true(H5Dread(d, t, H5S_ALL, H5S_ALL, H5P_DEFAULT, text) >= 0);
    assert_string_equal(text, expected);
    H5Tclose(t);
    H5Dclose(d);
}

TEST(the_problem_comes_back)
{
    bt_errors err = {0};
    assert_int_equal(write_it(path, N, u, &err), BT_OK);
    const hid_t f = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    check_ints(f, "/fclib_local/spacedim", (int[]){2}, 1);
    check_ints(f, "/fclib_local/W/m", (int[]){M}, 1);
    check_ints(f, "/fclib_local/W/n", (int[]){M}, 1);
    check_ints(f, "/fclib_local/W/nzmax", (int[]){12}, 1);
    check_ints(f, "/fclib_local/W/nz", (int[]){-2}, 1);
    check_ints(f, "/fclib_local/W/p", (int[]){0, 3, 6, 9, 12}, M + 1);
    check_ints(f, "/fclib_local/W/i", (int[]){0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 3}, 12);
    check_doubles(f, "/fclib_local/W/x", val, 12);
    check_doubles(f, "/fclib_local/vectors/q", q, M);
    check_doubles(f, "/fclib_local/vectors/mu", mu, N);
    check_text(f, "/fclib_local/info/title", "two contacts");
    check_text(f, "/fclib_local/info/description", "");
    check_doubles(f, "/solution/u", u, M);
    check_doubles(f, "/solution/r", r, M);
    H5Fclose(f);
}

TEST(the_solution_may_be_absent)
{
    bt_errors err = {0};
    const bt_fclib_problem p = {.n = N, .w_ptr = ptr, .w_col = col, .w_val = val, .q = q, .mu = mu};
    assert_int_equal(bt_fclib_write(path, &p, &err), BT_OK);
    const hid_t f = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    assert_true(H5Lexists(f, "/solution", H5P_DEFAULT) == 0 && H5Lexists(f, "/bound", H5P_DEFAULT) == 0);
    check_text(f, "/fclib_local/info/title", "");
    H5Fclose(f);
}

TEST(what_cannot_be_written_is_refused)
{
    bt_errors err = {0};
    unlink(path);
    assert_int_equal(write_it(path, 0, u, &err), BT_ERR_USAGE);
    assert_non_null(strstr(err.text[0], "no contacts"));
    assert_int_equal(write_it(path, N, NULL, &err), BT_ERR_USAGE);
    assert_int_equal(write_it(path, 1, u, &err), BT_ERR_USAGE); // W of two contacts: columns outside
    assert_non_null(strstr(err.text[2], "column"));
    assert_int_not_equal(access(path, F_OK), 0);
    assert_int_equal(write_it("/dev/null/x.h5", N, u, &err), BT_ERR_IO);
    assert_non_null(strstr(err.text[3], "Not a directory"));
    assert_int_equal(mkdir(path, 0755), 0);
    assert_int_equal(write_it(path, N, u, &err), BT_ERR_IO);
    assert_int_equal(err.n, 5);
    char temporary[80];
    snprintf(temporary, sizeof temporary, "%s.tmp", path);
    assert_int_not_equal(access(temporary, F_OK), 0);
    rmdir(path);
    bt_errors_free(&err);
}

int main(int argc, char **argv)
{
    if (argc == 2) { // write the problem for another reader
        bt_errors err = {0};
        const bt_status status = write_it(argv[1], N, u, &err);
        bt_errors_print(&err);
        return status;
    }
    snprintf(path, sizeof path, "/tmp/bergtow-fclib-%d.h5", (int)getpid());
    const int failed = run_all_tests(NULL, NULL);
    unlink(path);
    return failed;
}
