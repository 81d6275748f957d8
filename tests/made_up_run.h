// SPDX-License-Identifier: MIT
// A made-up run for the tests of the recorder: every number differs from its neighbours, none comes from a simulation.
#ifndef BERGTOW_TESTS_MADE_UP_RUN_H
#define BERGTOW_TESTS_MADE_UP_RUN_H

#include <unistd.h>
#include <hdf5.h>

#include "test.h"
#include "output/record.h"

static char folder[64];

enum { FLOES = 3, BODIES = 5, VERTICES = 3 + 4 + 5 + 4 + 4 };
static const int64_t offsets[BODIES + 1] = {0, 3, 7, 12, 16, 20};
static double vertices[VERTICES][2];
static const double thickness[BODIES] = {0.5, 0.75, 1, 11, 0};
static const double area[BODIES] = {1.5, 2.5, 3.5, 80, 100};
static const char *const names[BODIES - FLOES] = {"towed body", "wall x low"};

static inline bt_record_bodies bodies(void)
{
    for (int i = 0; i < BODIES; i++)
        for (int64_t v = offsets[i]; v < offsets[i + 1]; v++) {
            const double a = 2 * BT_PI * (double)(v - offsets[i]) / (double)(offsets[i + 1] - offsets[i]);
            vertices[v][0] = (i + 1) * cos(a);
            vertices[v][1] = (i + 1) * sin(a);
        }
    return (bt_record_bodies){.n_floes = FLOES, .n_bodies = BODIES, .offsets = offsets, .vertices = &vertices[0][0],
                              .thickness = thickness, .area = area, .names = names, .towed = FLOES,
                              .branches = 2};
}

static inline bt_case made_up_case(void)
{
    static bt_case defaults; // reachable until the end, so not reported as a leak
    if (!defaults.ice.size) bt_case_defaults(&defaults);
    static char title[] = "quote \" backslash \\ newline \n and byte \xff end", text[] = "run: {dt: 0.1 s}\n";
    static char source[] = "made up \u00e9";
    bt_case c = defaults;
    c.text = text;
    c.run.title = title;
    c.run.dt = 0.1;
    c.ice.size = 2; // as in the totals below
    c.tow.mode = BT_TOW_SPEED;
    c.tow.ramp = 0;
    c.domain.width = 100; // 50 body widths: no arches
    c.domain.x0 = 0;
    c.domain.y0 = -50;
    c.output.sample_every = 1;
    c.output.window_start = -1;
    c.reference.mean_force = 500;
    c.reference.source = source;
    return c;
}

/// Every member of a sample differs from the others and from those of other steps.
static inline bt_sample sample(int step)
{
    bt_sample s;
    double values[sizeof s / sizeof(double)];
    for (size_t k = 0; k < sizeof values / sizeof *values; k++)
        values[k] = 100.0 * (double)k + sin(step + 0.1 * (double)k);
    memcpy(&s, values, sizeof s);
    s.time = 0.1 * (step + 1);
    s.body_in_ice_x = 0.01 * step; // slow enough for the time step
    s.body_in_ice_y = 0.001 * step;
    s.ice_resistance = 1000 + 10 * sin(1.7 * step * step);
    s.ice_resistance_budget = s.ice_resistance;
    s.drag_force = 20;
    s.coriolis_force = -7;
    s.tilt_force = 5;
    s.inertia_force = 3;
    s.tow_force = s.ice_resistance + 21;
    s.contacts = 8 + step % 2;
    s.sweeps = 5;
    s.residual = 1e-6;
    s.unconverged = s.unprojected = s.locked = s.no_load = 0;
    s.overlap = 1e-4;
    s.momentum_residual = 1e-15;
    s.kinetic_energy = 100;
    s.contact_work = -2;
    bt_sample_set(&s, bt_series_find("crushing"), step % 4 == 0 ? 3 : 0);
    bt_sample_set(&s, bt_series_find("crushed_work"), step % 4 == 0 ? 1.5 : 0);
    bt_sample_set(&s, bt_series_find("crushed_depth"), 0.01);
    s.added_energy = s.repeats = s.outrun = s.restitution_cut = 0;
    return s;
}

static inline bt_run_totals totals(int steps)
{
    return (bt_run_totals){.n_steps = steps, .ranks = 1, .threads = 2, .dt = 0.1, .wall_time = 0.6, .mean_size = 2,
                           .concentration = 0.8, .tolerance = 1e-5, .state_hash = 0x0123456789abcdefu,
                           .phases = {1, 2, 3, 4, 5, 6, 7, 0}};
}

static inline void frame(int k, double pose[BODIES][3], double force[FLOES], double speed[BODIES])
{
    for (int i = 0; i < BODIES; i++) {
        pose[i][0] = 10 * i + k;
        pose[i][1] = -5 * i + 0.1 * k;
        pose[i][2] = 0.3 * i + 0.01 * k;
        speed[i] = 0.1 * i + k;
    }
    for (int i = 0; i < FLOES; i++) force[i] = 100 * i + k;
}

static inline bt_status record_frame(bt_record *r, int k, bt_errors *err)
{
    double pose[BODIES][3], force[FLOES], speed[BODIES];
    bt_frame_row rows[BODIES] = {0};
    frame(k, pose, force, speed);
    for (int i = 0; i < BODIES; i++)
        rows[i] = (bt_frame_row){.x = pose[i][0],
                                 .y = pose[i][1],
                                 .yaw = pose[i][2],
                                 .contact_force = i < FLOES ? force[i] : -1,
                                 .speed = speed[i],
                                 .vx = 0.6 * speed[i],
                                 .vy = -0.8 * speed[i],
                                 .fx = 1 + i,
                                 .fy = -k - 0.5};
    const bt_frame_line line = {{{{1, 2}, {3 + k, 4}}, {{5, 6}, {7, 8 + k}}}, {100 + k, 200}};
    return bt_record_frame(r, 0.5 * k, rows, &line, NULL, 0, err);
}

static bool print_summary;

static inline bt_status write_run(const char *dir, const bt_case *c, int steps, int frames, bt_errors *err)
{
    const bt_record_bodies b = bodies();
    bt_record *r;
    bt_status status = bt_record_open(&r, &bt_comm_alone, dir, c, &b, "bergtow run x.yml", NULL, true, err);
    if (status != BT_OK) return status;
    for (int i = 0; i < steps; i++) {
        const bt_sample s = sample(i);
        bt_record_sample(r, &s, err);
        if (frames && i % (steps / frames) == 0) record_frame(r, i / (steps / frames), err);
    }
    const bt_run_totals t = totals(steps);
    return bt_record_close(r, &t, NULL, print_summary, err);
}

static inline char *in_folder(const char *name)
{
    static char path[4][128];
    static int which;
    which = (which + 1) % 4;
    snprintf(path[which], sizeof path[which], "%s/%s", folder, name);
    return path[which];
}

static inline char *slurp(const char *path)
{
    FILE *f = fopen(path, "r");
    if (!f) return NULL;
    char *text = calloc(1, 1 << 20);
    assert_true(fread(text, 1, (1 << 20) - 1, f) > 0);
    fclose(f);
    return text;
}

static inline int read_all(hid_t file, const char *name, hid_t type, hsize_t dims[3], void *out, size_t size)
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

static inline char *attribute(hid_t file, const char *object, const char *name)
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

static inline int64_t int_attribute(hid_t file, const char *object, const char *name)
{
    int64_t value = -99;
    const hid_t a = H5Aopen_by_name(file, object, name, H5P_DEFAULT, H5P_DEFAULT);
    assert_true(a >= 0 && H5Aread(a, H5T_NATIVE_INT64, &value) >= 0);
    H5Aclose(a);
    return value;
}

/// Run the tests in a folder of their own under /tmp, removed at the end.
static inline int run_in_folder(void)
{
    snprintf(folder, sizeof folder, "/tmp/bergtow-record-XXXXXX");
    if (!mkdtemp(folder)) return 1;
    int failed = run_all_tests(NULL, NULL);
    char command[100];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    if (system(command)) failed++;
    return failed;
}

#endif
