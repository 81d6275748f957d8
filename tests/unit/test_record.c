// SPDX-License-Identifier: MIT
// A made-up run through the recorder, read back with HDF5.
//
//     test_record              the tests
//     test_record write DIR    write the made-up run into DIR and print its table (for tests/cli/test_xdmf.py)
#define H5_USE_110_API // H5Ovisit is called as HDF5 1.10 has it, with 1.14 too
#include "contact/law.h"
#include "made_up_run.h"

TEST(series_and_frames_come_back_to_the_bit)
{
    enum { STEPS = 600, FRAMES = 3 };
    bt_errors err = {0};
    const bt_case c = made_up_case();
    assert_int_equal(write_run(in_folder("a"), &c, STEPS, FRAMES, &err), BT_OK);
    assert_int_equal(err.n, 0);

    const hid_t f = H5Fopen(in_folder("a/result.h5"), H5F_ACC_RDONLY, H5P_DEFAULT);
    assert_true(f >= 0);
    static double x[STEPS];
    hsize_t d[3];
    char path[80];
    assert_int_equal(bt_n_series(), offsetof(bt_sample, laws) / sizeof(double) + (size_t)bt_law_first_number(BT_LAWS));
    for (int k = 0; k < bt_n_series(); k++) {
        snprintf(path, sizeof path, "/series/%s", bt_series(k)->name);
        assert_int_equal(read_all(f, path, H5T_NATIVE_DOUBLE, d, x, sizeof x), 1);
        assert_int_equal(d[0], STEPS);
        for (int i = 0; i < STEPS; i++) {
            const bt_sample s = sample(i);
            assert_memory_equal(&x[i], (const char *)&s + bt_series(k)->offset, sizeof(double));
        }
        assert_string_equal(attribute(f, path, "units"), bt_series(k)->units);
        assert_true(strlen(attribute(f, path, "description")) > 8);
    }
    static const char *const promised[] = {"time",   "tow_force", "ice_resistance", "drag_force", "body_x",
                                           "body_y", "body_yaw",  "contacts",       "sweeps",     "residual"};
    for (size_t k = 0; k < sizeof promised / sizeof *promised; k++) {
        snprintf(path, sizeof path, "/series/%s", promised[k]);
        assert_true(H5Lexists(f, path, H5P_DEFAULT) > 0);
    }

    double time[FRAMES], pose[FRAMES][FLOES][3], other[FRAMES][BODIES - FLOES][3], force[FRAMES][FLOES],
        speed[FRAMES][BODIES];
    float points[FRAMES][VERTICES][2];
    for (int k = 0; k < FRAMES; k++) {
        snprintf(path, sizeof path, "/xdmf/%06d/floe_points", k);
        assert_int_equal(read_all(f, path, H5T_NATIVE_FLOAT, d, points[k], sizeof points[k]), 2);
        assert_true(d[0] == 12 && d[1] == 2);
        snprintf(path, sizeof path, "/xdmf/%06d/body_points", k);
        read_all(f, path, H5T_NATIVE_FLOAT, d, points[k][12], 8 * sizeof points[k][12]);
        assert_true(d[0] == 8 && d[1] == 2);
    }
    read_all(f, "/frames/time", H5T_NATIVE_DOUBLE, d, time, sizeof time);
    assert_int_equal(d[0], FRAMES);
    assert_int_equal(read_all(f, "/frames/pose", H5T_NATIVE_DOUBLE, d, pose, sizeof pose), 3);
    assert_true(d[0] == FRAMES && d[1] == FLOES && d[2] == 3);
    read_all(f, "/frames/body_pose", H5T_NATIVE_DOUBLE, d, other, sizeof other);
    assert_true(d[0] == FRAMES && d[1] == BODIES - FLOES && d[2] == 3);
    read_all(f, "/frames/contact_force", H5T_NATIVE_DOUBLE, d, force, sizeof force);
    read_all(f, "/frames/speed", H5T_NATIVE_DOUBLE, d, speed, sizeof speed);
    for (int k = 0; k < FRAMES; k++) {
        double p[BODIES][3], q[FLOES], v[BODIES];
        frame(k, p, q, v);
        assert_true(time[k] == 0.5 * k);
        assert_memory_equal(pose[k], p, sizeof pose[k]);
        assert_memory_equal(other[k], p[FLOES], sizeof other[k]);
        assert_memory_equal(force[k], q, sizeof q);
        assert_memory_equal(speed[k], v, sizeof v);
        // The regular polygons of bodies(): vertex at distance i + 1 and angle a + yaw from the centroid.
        for (int i = 0; i < BODIES; i++)
            for (int64_t u = offsets[i]; u < offsets[i + 1]; u++) {
                const double a = 2 * BT_PI * (double)(u - offsets[i]) / (double)(offsets[i + 1] - offsets[i]) + p[i][2];
                assert_true(fabs(points[k][u][0] - (p[i][0] + (i + 1) * cos(a))) < 1e-5);
                assert_true(fabs(points[k][u][1] - (p[i][1] + (i + 1) * sin(a))) < 1e-5);
            }
    }
    H5Fclose(f);
}

TEST(bodies_case_and_provenance_are_there)
{
    const hid_t f = H5Fopen(in_folder("a/result.h5"), H5F_ACC_RDONLY, H5P_DEFAULT);
    double x[VERTICES][2];
    int64_t o[BODIES + 1];
    hsize_t d[3];
    read_all(f, "/floes/vertices", H5T_NATIVE_DOUBLE, d, x, sizeof x);
    assert_true(d[0] == 12 && d[1] == 2);
    assert_memory_equal(x, vertices, 12 * sizeof *x);
    read_all(f, "/floes/offsets", H5T_NATIVE_INT64, d, o, sizeof o);
    assert_int_equal(d[0], FLOES + 1);
    assert_memory_equal(o, offsets, (FLOES + 1) * sizeof *o);
    read_all(f, "/floes/thickness", H5T_NATIVE_DOUBLE, d, x, sizeof x);
    assert_int_equal(d[0], FLOES);
    assert_memory_equal(x, thickness, FLOES * sizeof(double));
    read_all(f, "/floes/area", H5T_NATIVE_DOUBLE, d, x, sizeof x);
    assert_memory_equal(x, area, FLOES * sizeof(double));
    read_all(f, "/bodies/vertices", H5T_NATIVE_DOUBLE, d, x, sizeof x);
    assert_true(d[0] == 8 && d[1] == 2);
    assert_memory_equal(x, vertices[12], 8 * sizeof *x);
    read_all(f, "/bodies/offsets", H5T_NATIVE_INT64, d, o, sizeof o);
    assert_true(d[0] == 3 && o[0] == 0 && o[1] == 4 && o[2] == 8);
    read_all(f, "/bodies/towed", H5T_NATIVE_INT64, d, o, sizeof o);
    assert_int_equal(o[0], 0);
    char *text[2];
    const hid_t v = H5Tcopy(H5T_C_S1);
    H5Tset_size(v, H5T_VARIABLE);
    H5Tset_cset(v, H5T_CSET_UTF8);
    read_all(f, "/bodies/names", v, d, text, sizeof text);
    assert_string_equal(text[0], names[0]);
    assert_string_equal(text[1], names[1]);
    H5free_memory(text[0]);
    H5free_memory(text[1]);

    char fixed[4096] = "";
    const hid_t c = H5Dopen2(f, "/case_as_given", H5P_DEFAULT), ct = H5Dget_type(c);
    assert_true(H5Tget_size(ct) < sizeof fixed && H5Dread(c, ct, H5S_ALL, H5S_ALL, H5P_DEFAULT, fixed) >= 0);
    assert_string_equal(fixed, "run: {dt: 0.1 s}\n");
    H5Dclose(c);
    const bt_case made = made_up_case();
    char *resolved = bt_case_resolved(&made), *file = slurp(in_folder("a/case.resolved.yml"));
    const hid_t r = H5Dopen2(f, "/case", H5P_DEFAULT), rt = H5Dget_type(r);
    char *stored = calloc(1, H5Tget_size(rt) + 1);
    assert_true(H5Dread(r, rt, H5S_ALL, H5S_ALL, H5P_DEFAULT, stored) >= 0);
    assert_string_equal(stored, resolved);
    // the same but for its digest, which is a comment
    const char *comment = strstr(file, "\n# case: "), *rest = comment ? strchr(comment + 1, '\n') : NULL;
    assert_true(rest && !strncmp(file, resolved, (size_t)(comment - file)));
    const size_t left = strlen(resolved) - (size_t)(comment - file);
    assert_true(!strncmp(rest, resolved + (comment - file), left) && !strncmp(rest + left, "#> ", 3));
    free(stored);
    free(resolved);
    free(file);
    H5Dclose(r);

    static const char *const wanted[] = {"version", "revision", "compiler", "flags", "host", "start_time", "libraries"};
    for (size_t k = 0; k < sizeof wanted / sizeof *wanted; k++) assert_true(strlen(attribute(f, "/", wanted[k])) > 1);
    assert_string_equal(attribute(f, "/", "version"), BT_VERSION);
    assert_string_equal(attribute(f, "/", "command_line"), "bergtow run x.yml");
    assert_int_equal(int_attribute(f, "/", "ranks"), 1);
    assert_int_equal(int_attribute(f, "/", "threads"), 2);
    assert_int_equal(int_attribute(f, "/", "complete"), 1);
    H5Fclose(f);
}

TEST(samples_merge_by_the_rule_of_their_field)
{
    bt_errors err = {0};
    bt_case c = made_up_case();
    c.output.sample_every = 4;
    const bt_record_bodies b = bodies();
    bt_record *r;
    assert_int_equal(bt_record_open(&r, &bt_comm_alone, in_folder("merge"), &c, &b, NULL, NULL, true, &err), BT_OK);
    for (int i = 0; i < 10; i++) { // 4 + 4 + 2
        bt_sample s = sample(i);
        s.ice_resistance = i;
        s.residual = i == 1 ? 7 : i == 5 ? NAN : 1;
        s.unconverged = i == 2 || i == 3 || i == 9;
        s.contact_work = -1;
        bt_record_sample(r, &s, &err);
    }
    const bt_run_totals t = totals(10);
    assert_int_equal(bt_record_close(r, &t, NULL, false, &err), BT_OK);

    const hid_t f = H5Fopen(in_folder("merge/result.h5"), H5F_ACC_RDONLY, H5P_DEFAULT);
    double x[3];
    hsize_t d[3];
    read_all(f, "/series/ice_resistance", H5T_NATIVE_DOUBLE, d, x, sizeof x);
    assert_int_equal(d[0], 3);
    assert_true(x[0] == 1.5 && x[1] == 5.5 && x[2] == 8.5);
    read_all(f, "/series/residual", H5T_NATIVE_DOUBLE, d, x, sizeof x);
    assert_true(x[0] == 7 && isnan(x[1]) && x[2] == 1);
    read_all(f, "/series/unconverged", H5T_NATIVE_DOUBLE, d, x, sizeof x);
    assert_true(x[0] == 2 && x[1] == 0 && x[2] == 1);
    read_all(f, "/series/contact_work", H5T_NATIVE_DOUBLE, d, x, sizeof x);
    assert_true(x[0] == -4 && x[1] == -4 && x[2] == -2);
    read_all(f, "/series/time", H5T_NATIVE_DOUBLE, d, x, sizeof x);
    assert_true(x[0] == sample(3).time && x[1] == sample(7).time && x[2] == sample(9).time);
    read_all(f, "/series/body_x", H5T_NATIVE_DOUBLE, d, x, sizeof x);
    assert_true(x[2] == sample(9).body_x);
    assert_int_equal(int_attribute(f, "/series", "steps_per_sample"), 4);
    H5Fclose(f);
}

typedef struct pair { hid_t other; int n; } pair;

static herr_t same_object(hid_t f, const char *name, const H5O_info_t *info, void *data)
{
    pair *p = data;
    if (info->type != H5O_TYPE_DATASET) return 0;
    const hid_t ids[2] = {H5Dopen2(f, name, H5P_DEFAULT), H5Dopen2(p->other, name, H5P_DEFAULT)};
    assert_true(ids[0] >= 0 && ids[1] >= 0);
    const hid_t type = H5Dget_type(ids[0]);
    if (!H5Tis_variable_str(type)) {
        char *bytes[2];
        size_t size[2];
        for (int k = 0; k < 2; k++) {
            const hid_t s = H5Dget_space(ids[k]);
            size[k] = (size_t)H5Sget_simple_extent_npoints(s) * H5Tget_size(type);
            bytes[k] = calloc(1, size[k] + 1);
            assert_true(H5Dread(ids[k], type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes[k]) >= 0);
            H5Sclose(s);
        }
        assert_int_equal(size[0], size[1]);
        assert_memory_equal(bytes[0], bytes[1], size[0]);
        free(bytes[0]);
        free(bytes[1]);
        p->n++;
    }
    H5Tclose(type);
    H5Dclose(ids[0]);
    H5Dclose(ids[1]);
    return 0;
}

TEST(two_runs_have_the_same_datasets)
{
    bt_errors err = {0};
    const bt_case c = made_up_case();
    assert_int_equal(write_run(in_folder("b"), &c, 600, 3, &err), BT_OK);
    const hid_t f = H5Fopen(in_folder("a/result.h5"), H5F_ACC_RDONLY, H5P_DEFAULT);
    pair p = {.other = H5Fopen(in_folder("b/result.h5"), H5F_ACC_RDONLY, H5P_DEFAULT)};
    assert_true(H5Ovisit(f, H5_INDEX_NAME, H5_ITER_INC, same_object, &p) >= 0);
    assert_true(p.n > bt_n_series() + 12);
    H5Fclose(f);
    H5Fclose(p.other);
}

TEST(an_empty_field_can_be_recorded)
{
    bt_errors err = {0};
    const bt_case c = made_up_case();
    const int64_t o[2] = {0, 4};
    bodies();
    const bt_record_bodies b = {.n_floes = 0,
                                .n_bodies = 1,
                                .offsets = o,
                                .vertices = vertices[12],
                                .thickness = thickness,
                                .area = area,
                                .names = names,
                                .towed = 0};
    bt_record *r;
    assert_int_equal(bt_record_open(&r, &bt_comm_alone, in_folder("empty"), &c, &b, NULL, NULL, true, &err), BT_OK);
    const bt_frame_row row = {.x = 1, .y = 2, .yaw = 3, .speed = 1};
    assert_int_equal(bt_record_frame(r, 0, &row, NULL, NULL, 0, &err), BT_OK);
    const bt_run_totals t = totals(0);
    assert_int_equal(bt_record_close(r, &t, NULL, false, &err), BT_OK);
    assert_int_equal(err.n, 0);
    char *xdmf = slurp(in_folder("empty/frames.xdmf"));
    assert_null(strstr(xdmf, "Name=\"floes\""));
    assert_non_null(strstr(xdmf, "Name=\"bodies\""));
    free(xdmf);
}

TEST(many_floes_are_packed)
{
    enum { MANY = 3000 };
    static double v[4 * MANY][2], ones[MANY];
    static bt_frame_row rows[MANY];
    static int64_t o[MANY + 1];
    static float points[4 * MANY][2], speed[MANY];
    for (int i = 0; i < MANY; i++) {
        o[i + 1] = 4 * (i + 1);
        for (int k = 0; k < 4; k++) v[4 * i + k][0] = (k == 0) - (k == 2), v[4 * i + k][1] = (k == 1) - (k == 3);
        ones[i] = 1 + i;
        rows[i] = (bt_frame_row){.x = i, .contact_force = ones[i], .speed = ones[i]};
    }
    bt_errors err = {0};
    const bt_case c = made_up_case();
    const bt_record_bodies b = {.n_floes = MANY,
                                .n_bodies = MANY,
                                .offsets = o,
                                .vertices = &v[0][0],
                                .thickness = ones,
                                .area = ones,
                                .towed = -1};
    bt_record *r;
    assert_int_equal(bt_record_open(&r, &bt_comm_alone, in_folder("many"), &c, &b, NULL, NULL, true, &err), BT_OK);
    assert_int_equal(bt_record_frame(r, 0, rows, NULL, NULL, 0, &err), BT_OK);
    const bt_run_totals t = totals(0);
    assert_int_equal(bt_record_close(r, &t, NULL, false, &err), BT_OK);
    const hid_t f = H5Fopen(in_folder("many/result.h5"), H5F_ACC_RDONLY, H5P_DEFAULT);
    hsize_t d[3];
    read_all(f, "/xdmf/000000/floe_points", H5T_NATIVE_FLOAT, d, points, sizeof points);
    assert_int_equal(d[0], 4 * MANY);
    read_all(f, "/xdmf/000000/floe_speed", H5T_NATIVE_FLOAT, d, speed, sizeof speed);
    for (int i = 0; i < MANY; i++) {
        assert_true(points[4 * i][0] == (float)(i + 1) && points[4 * i + 1][1] == 1);
        assert_true(speed[i] == (float)(1 + i));
    }
    const hid_t set = H5Dopen2(f, "/xdmf/000000/floe_points", H5P_DEFAULT);
    assert_true(H5Dget_storage_size(set) < sizeof points / 2);
    H5Dclose(set);
    H5Fclose(f);
}

int main(int argc, char **argv)
{
    if (argc == 3 && strcmp(argv[1], "write") == 0) {
        bt_errors err = {0};
        const bt_case c = made_up_case();
        print_summary = true;
        const bt_status status = write_run(argv[2], &c, 600, 3, &err);
        bt_errors_print(&err);
        return status;
    }
    return run_in_folder();
}
