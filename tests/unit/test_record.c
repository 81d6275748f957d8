// SPDX-License-Identifier: MIT
// A made-up run through the recorder, read back with HDF5; and the recorder without space or permission.
//
//     test_record              the tests
//     test_record write DIR    write the made-up run into DIR and print its table (for tests/cli/test_xdmf.py)
//     test_record length FILE  print the lengths of two series and of the frames (a reader in another process)
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h>
#include <hdf5.h>

#include "bergtow/record.h"

static const char *self = "test_record";
static char folder[64];

enum { FLOES = 3, BODIES = 5, VERTICES = 3 + 4 + 5 + 4 + 4 };
static const int64_t offsets[BODIES + 1] = {0, 3, 7, 12, 16, 20};
static double vertices[VERTICES][2];
static const double thickness[BODIES] = {0.5, 0.75, 1, 11, 0};
static const double area[BODIES] = {1.5, 2.5, 3.5, 80, 100};
static const char *const names[BODIES - FLOES] = {"towed body", "wall x low"};

static bt_record_bodies bodies(void)
{
    for (int i = 0; i < BODIES; i++)
        for (int64_t v = offsets[i]; v < offsets[i + 1]; v++) {
            const double a = 2 * BT_PI * (double)(v - offsets[i]) / (double)(offsets[i + 1] - offsets[i]);
            vertices[v][0] = (i + 1) * cos(a);
            vertices[v][1] = (i + 1) * sin(a);
        }
    return (bt_record_bodies){.n_floes = FLOES, .n_bodies = BODIES, .offsets = offsets, .vertices = &vertices[0][0],
                              .thickness = thickness, .area = area, .names = names, .towed = FLOES};
}

static bt_case made_up_case(void)
{
    static bt_case defaults; // reachable to the end: the leak checker need not know it
    if (!defaults.ice.size) bt_case_defaults(&defaults);
    static char title[] = "quote \" backslash \\ newline \n and byte \xff end", text[] = "run: {dt: 0.1 s}\n";
    static char source[] = "made up \u00e9";
    bt_case c = defaults;
    c.text = text;
    c.run.title = title;
    c.run.dt = 0.1;
    c.tow.mode = BT_TOW_SPEED;
    c.tow.ramp = 0;
    c.output.sample_every = 1;
    c.output.window_start = -1;
    c.reference.mean_force = 500;
    c.reference.source = source;
    return c;
}

/// Every member of a sample differs from the others and from those of other steps.
static bt_sample sample(int step)
{
    bt_sample s;
    double values[sizeof s / sizeof(double)];
    for (size_t k = 0; k < sizeof values / sizeof *values; k++) values[k] = 100.0 * (double)k + sin(step + 0.1 * (double)k);
    memcpy(&s, values, sizeof s);
    s.time = 0.1 * (step + 1);
    s.ice_resistance = 1000 + 10 * sin(1.7 * step * step);
    s.ice_resistance_budget = s.ice_resistance;
    s.drag_force = 20;
    s.inertia_force = 3;
    s.tow_force = s.ice_resistance + 23;
    s.contacts = 8 + step % 2;
    s.sweeps = 5;
    s.residual = 1e-6;
    s.unconverged = 0;
    s.overlap = 1e-4;
    s.momentum_residual = 1e-15;
    s.kinetic_energy = 100;
    s.contact_work = -2;
    return s;
}

static bt_run_totals totals(int steps)
{
    return (bt_run_totals){.n_steps = steps, .ranks = 1, .threads = 2, .dt = 0.1, .wall_time = 0.6, .mean_size = 2,
                           .concentration = 0.8, .tolerance = 1e-5, .state_hash = 0x0123456789abcdefu,
                           .phases = {1, 2, 3, 4, 5, 6, 7}};
}

static void frame(int k, double pose[BODIES][3], double force[FLOES], double speed[BODIES])
{
    for (int i = 0; i < BODIES; i++) {
        pose[i][0] = 10 * i + k;
        pose[i][1] = -5 * i + 0.1 * k;
        pose[i][2] = 0.3 * i + 0.01 * k;
        speed[i] = 0.1 * i + k;
    }
    for (int i = 0; i < FLOES; i++) force[i] = 100 * i + k;
}

static bt_status record_frame(bt_record *r, int k, bt_errors *err)
{
    double pose[BODIES][3], force[FLOES], speed[BODIES];
    frame(k, pose, force, speed);
    return bt_record_frame(r, 0.5 * k, &pose[0][0], force, speed, err);
}

static bool print_summary;

static bt_status write_run(const char *dir, const bt_case *c, int steps, int frames, bt_errors *err)
{
    const bt_record_bodies b = bodies();
    bt_record *r;
    bt_status status = bt_record_open(&r, dir, c, &b, "bergtow run x.yml", err);
    if (status != BT_OK) return status;
    for (int i = 0; i < steps; i++) {
        const bt_sample s = sample(i);
        bt_record_sample(r, &s, err);
        if (frames && i % (steps / frames) == 0) record_frame(r, i / (steps / frames), err);
    }
    const bt_run_totals t = totals(steps);
    if (print_summary) bt_record_print_summary(r, &t);
    return bt_record_close(r, &t, err);
}

static char *in_folder(const char *name)
{
    static char path[4][128];
    static int which;
    which = (which + 1) % 4;
    snprintf(path[which], sizeof path[which], "%s/%s", folder, name);
    return path[which];
}

static char *slurp(const char *path)
{
    FILE *f = fopen(path, "r");
    if (!f) return NULL;
    char *text = calloc(1, 1 << 20);
    assert_true(fread(text, 1, (1 << 20) - 1, f) > 0);
    fclose(f);
    return text;
}

static int read_all(hid_t file, const char *name, hid_t type, hsize_t dims[3], void *out, size_t size)
{
    const hid_t d = H5Dopen2(file, name, H5P_DEFAULT);
    assert_true(d >= 0);
    const hid_t s = H5Dget_space(d);
    const int rank = H5Sget_simple_extent_dims(s, dims, NULL);
    assert_true((size_t)H5Sget_simple_extent_npoints(s) * H5Tget_size(type) <= size);
    assert_true(H5Dread(d, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, out) >= 0);
    H5Sclose(s);
    H5Dclose(d);
    return rank;
}

static char *attribute(hid_t file, const char *object, const char *name)
{
    char *text = NULL;
    const hid_t a = H5Aopen_by_name(file, object, name, H5P_DEFAULT, H5P_DEFAULT);
    assert_true(a >= 0);
    const hid_t t = H5Aget_type(a);
    assert_true(H5Aread(a, t, &text) >= 0);
    static char kept[4096];
    snprintf(kept, sizeof kept, "%s", text);
    H5free_memory(text);
    H5Tclose(t);
    H5Aclose(a);
    return kept;
}

static int64_t int_attribute(hid_t file, const char *object, const char *name)
{
    int64_t value = -99;
    const hid_t a = H5Aopen_by_name(file, object, name, H5P_DEFAULT, H5P_DEFAULT);
    assert_true(a >= 0 && H5Aread(a, H5T_NATIVE_INT64, &value) >= 0);
    H5Aclose(a);
    return value;
}

static void series_and_frames_come_back_to_the_bit(void **state)
{
    (void)state;
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
    assert_int_equal(bt_n_series_fields, sizeof(bt_sample) / sizeof(double));
    for (int k = 0; k < bt_n_series_fields; k++) {
        snprintf(path, sizeof path, "/series/%s", bt_series_fields[k].name);
        assert_int_equal(read_all(f, path, H5T_NATIVE_DOUBLE, d, x, sizeof x), 1);
        assert_int_equal(d[0], STEPS);
        for (int i = 0; i < STEPS; i++) {
            const bt_sample s = sample(i);
            assert_memory_equal(&x[i], (const char *)&s + bt_series_fields[k].offset, sizeof(double));
        }
        assert_string_equal(attribute(f, path, "units"), bt_series_fields[k].units);
        assert_true(strlen(attribute(f, path, "description")) > 8);
    }
    static const char *const promised[] = {"time", "tow_force", "ice_resistance", "drag_force", "body_x", "body_y", "body_yaw",
                                           "contacts", "sweeps", "residual"};
    for (size_t k = 0; k < sizeof promised / sizeof *promised; k++) {
        snprintf(path, sizeof path, "/series/%s", promised[k]);
        assert_true(H5Lexists(f, path, H5P_DEFAULT) > 0);
    }

    double time[FRAMES], pose[FRAMES][FLOES][3], other[FRAMES][BODIES - FLOES][3], force[FRAMES][FLOES], speed[FRAMES][BODIES];
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

static void bodies_case_and_provenance_are_there(void **state)
{
    (void)state;
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
    char *resolved = slurp(in_folder("a/case.resolved.yml"));
    const hid_t r = H5Dopen2(f, "/case", H5P_DEFAULT), rt = H5Dget_type(r);
    char *stored = calloc(1, H5Tget_size(rt) + 1);
    assert_true(H5Dread(r, rt, H5S_ALL, H5S_ALL, H5P_DEFAULT, stored) >= 0);
    assert_string_equal(stored, resolved);
    free(stored);
    free(resolved);
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

static void samples_merge_by_the_rule_of_their_field(void **state)
{
    (void)state;
    bt_errors err = {0};
    bt_case c = made_up_case();
    c.output.sample_every = 4;
    const bt_record_bodies b = bodies();
    bt_record *r;
    assert_int_equal(bt_record_open(&r, in_folder("merge"), &c, &b, NULL, &err), BT_OK);
    for (int i = 0; i < 10; i++) { // 4 + 4 + 2
        bt_sample s = sample(i);
        s.ice_resistance = i;
        s.residual = i == 1 ? 7 : i == 5 ? NAN : 1;
        s.unconverged = i == 2 || i == 3 || i == 9;
        s.contact_work = -1;
        bt_record_sample(r, &s, &err);
    }
    const bt_run_totals t = totals(10);
    assert_int_equal(bt_record_close(r, &t, &err), BT_OK);

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

static void two_runs_have_the_same_datasets(void **state)
{
    (void)state;
    bt_errors err = {0};
    const bt_case c = made_up_case();
    assert_int_equal(write_run(in_folder("b"), &c, 600, 3, &err), BT_OK);
    const hid_t f = H5Fopen(in_folder("a/result.h5"), H5F_ACC_RDONLY, H5P_DEFAULT);
    pair p = {.other = H5Fopen(in_folder("b/result.h5"), H5F_ACC_RDONLY, H5P_DEFAULT)};
    assert_true(H5Ovisit(f, H5_INDEX_NAME, H5_ITER_INC, same_object, &p) >= 0);
    assert_true(p.n > bt_n_series_fields + 12);
    H5Fclose(f);
    H5Fclose(p.other);
}

/// The text after "key": up to the end of the line, without a comma.
static const char *json_value(const char *json, const char *key)
{
    static char value[400];
    char wanted[80];
    snprintf(wanted, sizeof wanted, "\"%s\": ", key);
    const char *at = json ? strstr(json, wanted) : NULL;
    if (!at) {
        print_error("no %s in %s\n", key, json ? json : "(no file)");
        return "missing";
    }
    snprintf(value, sizeof value, "%s", at + strlen(wanted));
    value[strcspn(value, "\n")] = '\0';
    const size_t n = strlen(value);
    if (n && value[n - 1] == ',') value[n - 1] = '\0';
    return value;
}

static void summary_holds_the_numbers(void **state)
{
    (void)state;
    char *json = slurp(in_folder("a/summary.json"));
    double mean = 0;
    const double start = atof(json_value(json, "start_s"));
    int n = 0;
    for (int i = 0; i < 600; i++)
        if (sample(i).time >= start) mean += sample(i).ice_resistance, n++;
    mean /= n;
    assert_true(fabs(atof(json_value(json, "mean_ice_resistance_n")) - mean) < 1e-9);
    assert_true(fabs(atof(json_value(json, "mean_tow_force_n")) - mean - 23) < 1e-9);
    assert_true(fabs(atof(json_value(json, "closure_n"))) < 1e-9);
    assert_true(fabs(atof(json_value(json, "ratio")) - mean / 500) < 1e-12);
    const double se = atof(json_value(json, "mean_ice_resistance_se_n"));
    assert_true(se > 0 && se < 3);
    assert_int_equal(atoi(json_value(json, "n_samples")), n);
    assert_true(n >= 300);
    assert_string_equal(json_value(json, "rule"), "\"mser5\"");
    assert_string_equal(json_value(json, "n_floes"), "3");
    assert_string_equal(json_value(json, "n_steps"), "600");
    assert_string_equal(json_value(json, "dt_s"), "0.1");
    assert_string_equal(json_value(json, "sim_time_s"), "60");
    assert_string_equal(json_value(json, "contacts_mean"), "8.5");
    assert_string_equal(json_value(json, "mean_sweeps"), "5");
    assert_string_equal(json_value(json, "unconverged_steps"), "0");
    assert_string_equal(json_value(json, "positive_work_steps"), "0");
    assert_string_equal(json_value(json, "contact_work_j"), "-1200");
    assert_string_equal(json_value(json, "max_overlap_m"), "0.0001");
    assert_string_equal(json_value(json, "max_overlap_relative"), "5e-05");
    assert_string_equal(json_value(json, "state_hash"), "\"0123456789abcdef\"");
    assert_string_equal(json_value(json, "exchange"), "6");
    assert_true(fabs(atof(json_value(json, "ns_per_floe_step")) - 0.6e9 / 1800) < 1e-3);
    assert_string_equal(json_value(json, "stopped"), "null");
    assert_string_equal(json_value(json, "warnings"), "[]");
    assert_non_null(strstr(json, "\"title\": \"quote \\\" backslash \\\\ newline \\u000a and byte \\ufffd end\""));
    free(json);
}

/// Write a run whose samples are changed by spoil, and return its summary.json.
static char *summary_of(bt_case *c, int steps, const bt_run_totals *t, bt_idx towed, void (*spoil)(bt_sample *, int))
{
    bt_errors err = {0};
    bt_record_bodies b = bodies();
    b.towed = towed;
    bt_record *r;
    assert_int_equal(bt_record_open(&r, in_folder("s"), c, &b, "", &err), BT_OK);
    for (int i = 0; i < steps; i++) {
        bt_sample s = sample(i);
        if (spoil) spoil(&s, i);
        bt_record_sample(r, &s, &err);
    }
    assert_int_equal(bt_record_close(r, t, &err), BT_OK);
    assert_int_equal(err.n, 0);
    return slurp(in_folder("s/summary.json"));
}

static void slow_wave(bt_sample *s, int i)
{
    s->ice_resistance = 1000 + 100 * sin(2 * BT_PI * i / 200.0);
    s->ice_resistance_budget = s->ice_resistance;
    s->tow_force = s->ice_resistance + 23;
}

static void everything_wrong(bt_sample *s, int i)
{
    s->unconverged = i % 3 == 0;
    s->contact_work = i % 5 == 0 ? 1 : -1;
    s->overlap = 0.1;
    s->momentum_residual = 1e-3;
    s->tow_force += 100;
    s->ice_resistance_budget -= 7;
}

static void broken_number(bt_sample *s, int i)
{
    if (i == 400) s->ice_resistance = NAN;
}

static void every_doubt_is_told(void **state)
{
    (void)state;
    bt_case c = made_up_case();
    bt_run_totals t = totals(600);

    c.output.window_start = 20;
    char *json = summary_of(&c, 600, &t, FLOES, slow_wave);
    assert_non_null(strstr(json, "the steady window is short"));
    assert_string_equal(json_value(json, "rule"), "\"given\"");
    assert_string_equal(json_value(json, "start_s"), "20");
    assert_int_not_equal(strncmp(json_value(json, "warning"), "null", 4), 0);
    free(json);

    t.stopped = "SIGTERM";
    t.floes_outside = 2;
    json = summary_of(&c, 600, &t, FLOES, everything_wrong);
    static const char *const told[] = {"stopped early: SIGTERM", "200 of 600 steps met the sweep limit",
                                       "120 of 600 steps the contacts added energy", "overlap by up to 0.1 m",
                                       "momentum is conserved only to 0.001", "2 floes left",
                                       "differs from tow - drag - inertia", "by the momentum of the ice"};
    for (size_t k = 0; k < sizeof told / sizeof *told; k++)
        if (!strstr(json, told[k])) fail_msg("not told: %s in %s", told[k], json);
    assert_null(strstr(json, "the steady window is short"));
    free(json);

    t = totals(600);
    json = summary_of(&c, 600, &t, FLOES, broken_number);
    assert_string_equal(json_value(json, "mean_ice_resistance_n"), "null");
    assert_non_null(strstr(json, "not finite"));
    free(json);

    c.output.window_start = 100;
    json = summary_of(&c, 600, &t, FLOES, NULL);
    assert_string_equal(json_value(json, "mean_ice_resistance_n"), "null");
    assert_non_null(strstr(json, "no steady window: it would begin at 100 s and the run ends at 60 s"));
    free(json);

    c.output.window_start = -1;
    c.tow.ramp = 50;
    json = summary_of(&c, 600, &t, FLOES, NULL);
    assert_true(atof(json_value(json, "start_s")) >= 50);
    free(json);
}

static void without_a_towed_body_forces_are_null(void **state)
{
    (void)state;
    bt_case c = made_up_case();
    c.reference.mean_force = NAN;
    const bt_run_totals t = totals(20);
    char *json = summary_of(&c, 20, &t, -1, NULL);
    static const char *const null[] = {"mean_ice_resistance_n", "mean_ice_resistance_se_n", "mean_tow_force_n",
                                       "mean_drag_force_n", "mean_ice_resistance_budget_n", "peak_ice_resistance_n",
                                       "closure_n", "start_s", "rule", "reference"};
    for (size_t k = 0; k < sizeof null / sizeof *null; k++) assert_string_equal(json_value(json, null[k]), "null");
    assert_string_equal(json_value(json, "warnings"), "[]");
    assert_string_equal(json_value(json, "n_steps"), "20");
    free(json);

    const bt_run_totals none = totals(0); // not one step
    json = summary_of(&c, 0, &none, FLOES, NULL);
    assert_string_equal(json_value(json, "contacts_mean"), "null");
    assert_string_equal(json_value(json, "sim_time_s"), "0");
    assert_non_null(strstr(json, "no steady window"));
    free(json);
}

static void an_empty_field_can_be_recorded(void **state)
{
    (void)state;
    bt_errors err = {0};
    const bt_case c = made_up_case();
    const int64_t o[2] = {0, 4};
    bodies();
    const bt_record_bodies b = {.n_floes = 0, .n_bodies = 1, .offsets = o, .vertices = vertices[12], .thickness = thickness,
                                .area = area, .names = names, .towed = 0};
    bt_record *r;
    assert_int_equal(bt_record_open(&r, in_folder("empty"), &c, &b, NULL, &err), BT_OK);
    const double pose[3] = {1, 2, 3}, speed = 1;
    assert_int_equal(bt_record_frame(r, 0, pose, NULL, &speed, &err), BT_OK);
    const bt_run_totals t = totals(0);
    assert_int_equal(bt_record_close(r, &t, &err), BT_OK);
    assert_int_equal(err.n, 0);
    char *xdmf = slurp(in_folder("empty/frames.xdmf"));
    assert_null(strstr(xdmf, "Name=\"floes\""));
    assert_non_null(strstr(xdmf, "Name=\"bodies\""));
    free(xdmf);
}

static void many_floes_are_packed(void **state)
{
    (void)state;
    enum { MANY = 3000 };
    static double v[4 * MANY][2], pose[MANY][3], ones[MANY];
    static int64_t o[MANY + 1];
    static float points[4 * MANY][2], speed[MANY];
    for (int i = 0; i < MANY; i++) {
        o[i + 1] = 4 * (i + 1);
        for (int k = 0; k < 4; k++) v[4 * i + k][0] = (k == 0) - (k == 2), v[4 * i + k][1] = (k == 1) - (k == 3);
        pose[i][0] = i;
        ones[i] = 1 + i;
    }
    bt_errors err = {0};
    const bt_case c = made_up_case();
    const bt_record_bodies b = {.n_floes = MANY, .n_bodies = MANY, .offsets = o, .vertices = &v[0][0], .thickness = ones,
                                .area = ones, .towed = -1};
    bt_record *r;
    assert_int_equal(bt_record_open(&r, in_folder("many"), &c, &b, NULL, &err), BT_OK);
    assert_int_equal(bt_record_frame(r, 0, &pose[0][0], ones, ones, &err), BT_OK);
    const bt_run_totals t = totals(0);
    assert_int_equal(bt_record_close(r, &t, &err), BT_OK);
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

static void a_failed_run_leaves_no_old_summary(void **state)
{
    (void)state;
    bt_errors err = {0};
    const bt_case c = made_up_case();
    assert_int_equal(write_run(in_folder("again"), &c, 10, 0, &err), BT_OK);
    assert_int_equal(access(in_folder("again/summary.json"), F_OK), 0);
    const bt_record_bodies b = bodies();
    bt_record *r;
    assert_int_equal(bt_record_open(&r, in_folder("again"), &c, &b, NULL, &err), BT_OK);
    assert_int_not_equal(access(in_folder("again/summary.json"), F_OK), 0);
    const bt_sample s = sample(0);
    bt_record_sample(r, &s, &err);
    assert_int_equal(bt_record_close(r, NULL, &err), BT_OK);
    assert_int_not_equal(access(in_folder("again/summary.json"), F_OK), 0);
    const hid_t f = H5Fopen(in_folder("again/result.h5"), H5F_ACC_RDONLY, H5P_DEFAULT);
    assert_int_equal(int_attribute(f, "/", "complete"), 0);
    H5Fclose(f);
}

/// Lengths of two series and of the frames as another process reads them now.
static void lengths_seen_by_others(const char *path, int seen[3])
{
    char command[400];
    snprintf(command, sizeof command, "%s length %s", self, path);
    FILE *p = popen(command, "r");
    assert_int_equal(fscanf(p, "%d %d %d", &seen[0], &seen[1], &seen[2]), 3);
    assert_int_equal(pclose(p), 0);
}

static void a_running_and_a_killed_run_can_be_read(void **state)
{
    (void)state;
    int ready[2], seen[3];
    assert_int_equal(pipe(ready), 0);
    const pid_t child = fork();
    if (child == 0) {
        bt_errors err = {0};
        const bt_case c = made_up_case();
        const bt_record_bodies b = bodies();
        bt_record *r;
        if (bt_record_open(&r, in_folder("killed"), &c, &b, NULL, &err) != BT_OK) _exit(1);
        for (int i = 0; i < 700; i++) {
            const bt_sample s = sample(i);
            bt_record_sample(r, &s, &err);
            if (i == 400) record_frame(r, 0, &err);
        }
        if (write(ready[1], "x", 1) != 1) _exit(1);
        pause();
    }
    char go;
    close(ready[1]); // so that a child that fails ends the wait
    assert_int_equal(read(ready[0], &go, 1), 1);
    lengths_seen_by_others(in_folder("killed/result.h5"), seen); // the writer lives and has the file open
    assert_true(seen[0] >= 401 + 256 && seen[0] == seen[1] && seen[2] == 1);
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    lengths_seen_by_others(in_folder("killed/result.h5"), seen);
    assert_true(seen[0] >= 401 + 256 && seen[0] == seen[1] && seen[2] == 1);
}

static void check_refused(const char *dir, const char *reason)
{
    bt_errors err = {0};
    const bt_case c = made_up_case();
    assert_int_equal(write_run(dir, &c, 10, 1, &err), BT_ERR_IO);
    assert_int_equal(err.n, 1);
    if (!strstr(err.text[0], dir) || !strstr(err.text[0], reason)) fail_msg("%s", err.text[0]);
    assert_non_null(strchr(err.text[0], ';')); // the remedy
    bt_errors_free(&err);
}

static void folders_that_cannot_be_written_are_named(void **state)
{
    (void)state;
    check_refused("/proc/bergtow/out", "No such file");
    check_refused("/dev/null/out", "Not a directory");
    check_refused(in_folder("a/summary.json"), "Not a directory");
    assert_int_equal(mkdir(in_folder("blocked"), 0755), 0);
    assert_int_equal(mkdir(in_folder("blocked/result.h5"), 0755), 0);
    check_refused(in_folder("blocked"), "Is a directory"); // out of HDF5's error stack
    if (geteuid() != 0) {
        assert_int_equal(mkdir(in_folder("closed"), 0555), 0);
        check_refused(in_folder("closed"), "Permission denied");
    }
}

/// In a process of its own whose files cannot grow beyond `limit` bytes: exit code 0 when the recorder ended in order
/// with BT_ERR_IO, one message, and no summary.
static int run_without_space(rlim_t limit)
{
    const pid_t child = fork();
    if (child == 0) {
        signal(SIGXFSZ, SIG_IGN);
        const struct rlimit l = {limit, limit};
        setrlimit(RLIMIT_FSIZE, &l);
        bt_errors err = {0};
        const bt_case c = made_up_case();
        const bt_status status = write_run(in_folder("full"), &c, 20000, 100, &err);
        int code = 0;
        if (status != BT_ERR_IO) code = 10;
        else if (err.n != 1) code = 11;
        else if (!strstr(err.text[0], "result.h5") && !strstr(err.text[0], "case.resolved.yml")) code = 12;
        else if (!strstr(err.text[0], "File too large")) code = 13;
        else if (access(in_folder("full/summary.json"), F_OK) == 0) code = 14;
        else if (limit > 60000) { // what was flushed before is still there, in series of one length
            int seen[3];
            lengths_seen_by_others(in_folder("full/result.h5"), seen);
            if (seen[0] != seen[1]) code = 15;
        }
        if (code && err.n) fprintf(stderr, "%s\n", err.text[0]);
        exit(code); // with HDF5's own exit handler
    }
    int status;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

static void a_full_disk_is_an_error_and_no_crash(void **state)
{
    (void)state;
    for (rlim_t limit = 0; limit < 3000000; limit = limit ? limit * 3 : 20) {
        const int code = run_without_space(limit);
        if (code) fail_msg("limit %lu bytes: code %d", (unsigned long)limit, code);
    }
}

static int print_lengths(const char *path)
{
    const hid_t f = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    static const char *const sets[] = {"/series/time", "/series/moving", "/frames/time"};
    for (int k = 0; k < 3; k++) {
        const hid_t d = H5Dopen2(f, sets[k], H5P_DEFAULT);
        hsize_t n = 0;
        static double x[100000];
        if (d < 0 || H5Sget_simple_extent_dims(H5Dget_space(d), &n, NULL) != 1 || n > 100000 ||
            H5Dread(d, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, x) < 0)
            return 1;
        for (hsize_t i = 0; k == 0 && i < n; i++)
            if (x[i] != sample((int)i).time) return 2;
        printf("%d ", (int)n);
    }
    return 0;
}

int main(int argc, char **argv)
{
    self = argv[0];
    if (argc == 3 && strcmp(argv[1], "length") == 0) return print_lengths(argv[2]);
    if (argc == 3 && strcmp(argv[1], "write") == 0) {
        bt_errors err = {0};
        const bt_case c = made_up_case();
        print_summary = true;
        const bt_status status = write_run(argv[2], &c, 600, 3, &err);
        bt_errors_print(&err);
        return status;
    }
    snprintf(folder, sizeof folder, "/tmp/bergtow-record-XXXXXX");
    if (!mkdtemp(folder)) return 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(series_and_frames_come_back_to_the_bit),
        cmocka_unit_test(bodies_case_and_provenance_are_there),
        cmocka_unit_test(samples_merge_by_the_rule_of_their_field),
        cmocka_unit_test(two_runs_have_the_same_datasets),
        cmocka_unit_test(summary_holds_the_numbers),
        cmocka_unit_test(every_doubt_is_told),
        cmocka_unit_test(without_a_towed_body_forces_are_null),
        cmocka_unit_test(an_empty_field_can_be_recorded),
        cmocka_unit_test(many_floes_are_packed),
        cmocka_unit_test(a_failed_run_leaves_no_old_summary),
        cmocka_unit_test(a_running_and_a_killed_run_can_be_read),
        cmocka_unit_test(folders_that_cannot_be_written_are_named),
        cmocka_unit_test(a_full_disk_is_an_error_and_no_crash),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    char command[100];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command) ? 1 : failed;
}
