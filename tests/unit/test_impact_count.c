// SPDX-License-Identifier: MIT
// What is counted of collisions and panel loads over a window that is known only at the end, against sums of the test's
// own.
//
// What turns these tests red (tried): a collision in the very step in which the window begins left out; counted from
// the end of the ramp; only the first piece of the file read back; blocks that are not merged, not restored, or taken
// from one too early; rows of a file not checked when it is taken up.
#include "made_up_run.h"

#include "output/impact_count.h"
#include "loads/panel.h"
#include "base/snapshot.h"

enum { PANELS = 3 };

static double random_number(uint64_t *state)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(*state >> 11) / 0x1p53;
}

/// Load of panel k in a step, N: any number, with a few large ones.
static bt_panel load_at(int64_t step, int k)
{
    uint64_t state = (uint64_t)(step * PANELS + k + 1) * 77777;
    random_number(&state);
    const double x = random_number(&state), y = random_number(&state);
    return (bt_panel){.fx = x - 0.5, .fy = y, .normal = x < 0.001 ? 1e3 * y : y};
}

static void add_steps(bt_panel_blocks *b, int64_t first, int64_t end, int64_t early)
{
    for (int64_t s = first; s < end; s++) {
        bt_panel p[PANELS];
        for (int k = 0; k < PANELS; k++) p[k] = load_at(s, k);
        bt_panel_blocks_add(b, p, s < early);
    }
}

static bt_panel_loads sum_of(int64_t first, int64_t end, int k)
{
    bt_panel_loads l = {0};
    for (int64_t s = first; s < end; s++) {
        const bt_panel p = load_at(s, k);
        l.fx += p.fx, l.fy += p.fy, l.normal += p.normal, l.most = fmax(l.most, p.normal);
    }
    return l;
}

static bool alike(const bt_panel_loads *a, const bt_panel_loads *b)
{
    return fabs(a->fx - b->fx) < 1e-7 && fabs(a->fy - b->fy) < 1e-7 && fabs(a->normal - b->normal) < 1e-7 &&
           a->most == b->most;
}

/// Runs before and after the first and the second time that two blocks become one, and such that end within a block:
/// from any start that the window may have, and from a state that was kept on the way.
TEST(panel_loads_from_any_start)
{
    const int64_t full = 5 * BT_STATS_STARTS, early = 17,
                  late[] = {0, 1, 4, 5, 23, full, full + 1, full + 13, 2 * full, 2 * full + 1, 3 * full + 7};
    const int64_t lengths[] = {5, 5, 5, 5, 5, 5, 10, 10, 10, 20, 20};
    for (size_t i = 0; i < sizeof late / sizeof *late; i++) {
        bt_panel_blocks b;
        bt_panel_blocks_init(&b, PANELS);
        const int64_t end = early + late[i], kept = end / 2;
        add_steps(&b, 0, kept, early);
        const int64_t rows = bt_panel_blocks_rows(&b, b.steps);
        bt_panel_loads *copy = bt_alloc((size_t)rows, sizeof *copy);
        memcpy(copy, b.load, (size_t)rows * sizeof *copy);
        bt_panel_blocks_restore(&b, b.steps, copy);
        add_steps(&b, kept, end, early);
        assert_int_equal(b.steps, late[i]);
        assert_int_equal(bt_stats_start_step(b.steps), lengths[i]);
        assert_true(bt_panel_blocks_rows(&b, b.steps) <= PANELS * (1 + BT_STATS_STARTS));
        const int64_t starts = late[i] / lengths[i], stride = starts > 40 ? starts / 40 : 1;
        for (int64_t n = 0; n <= starts + 1; n += stride) {
            const int64_t first = n * lengths[i] < late[i] ? n * lengths[i] : late[i];
            bt_panel_loads before[PANELS], within[PANELS];
            bt_panel_blocks_reduce(&b, first, before, within);
            for (int k = 0; k < PANELS; k++) {
                const bt_panel_loads old = sum_of(0, early + first, k), late_ones = sum_of(early + first, end, k);
                assert_true(alike(&before[k], &old));
                assert_true(alike(&within[k], &late_ones));
            }
        }
        bt_panel_blocks_free(&b);
    }
}

/// A collision at the very start of the window is in it, one a step before is not; the history gives what is of steps.
TEST(collisions_by_their_time)
{
    enum { N = 10 };
    double column[N], push[N] = {9, 1, 30, 2, 3, 7, 4, 5, 6, 1}, share[N] = {50, 50, 50, 50, 1, 2, 3, 4, 5, 6};
    for (int i = 0; i < N; i++) column[i] = i + 1;
    bt_history h = {.n = N};
    for (int k = 0; k < BT_N_COLUMNS; k++) h.column[k] = column;
    h.column[BT_COL_QUASI_STATIC] = push;
    h.column[BT_COL_COLLISION] = share;
    bt_steady w = {.start = 0.1 * 4, .first = 4, .n = 6};
    w.series[BT_REPORTED_ICE].mean.mean = 13.5;
    const bt_impacts m = {
        .rule = {.conversion = BT_IMPACT_DURATION, .duration = 0.04}, .dt = 0.1, .panels = {.n = PANELS}};
    const struct {
        double time, peak, panel;
    } hits[] = {{0.1 * 1, 900, 0}, {0.1 * 3, 20, 1}, {0.1 * 4, 5, 1}, {0.1 * 6, 80, 2},
                {0.1 * 2, 70, 2},  {0.1 * 8, 60, 2}, {0.1 * 9, 5, 1}};
    bt_impact_count c;
    bt_impact_count_init(&c, &m, &h, &w);
    for (size_t k = 0; k < sizeof hits / sizeof *hits; k++)
        bt_impact_count_add(
            &c, &(bt_impact){.time = hits[k].time, .peak = hits[k].peak, .panel = hits[k].panel, .gid = (double)k});
    assert_int_equal(c.n_all, 7);
    assert_int_equal(c.n, 4);
    assert_true(c.hours == 6 * 0.1 / 3600 && c.start == 0.1 * 4);
    assert_true(c.largest.peak == 80 && c.largest.gid == 3 && c.start_peak == 900);
    assert_true(c.largest_quasi_static_load == 7 && c.start_quasi_static_load == 30);
    assert_float_equal(c.collision_resistance, 3.5, 1e-12);
    assert_float_equal(c.quasi_static_resistance, 10, 1e-12);
    double peaks[4];
    assert_int_equal(c.n_peaks, 4);
    bt_impact_count_peaks(&c, peaks);
    assert_true(peaks[0] == 80 && peaks[1] == 60 && peaks[2] == 5 && peaks[3] == 5);
    const bt_panel_hits wanted[PANELS] = {{0, 0, 900}, {2, 5, 20}, {2, 80, 70}};
    for (int k = 0; k < PANELS; k++)
        assert_true(c.panel[k].n == wanted[k].n && c.panel[k].peak == wanted[k].peak &&
                    c.panel[k].start_peak == wanted[k].start_peak);
    bt_impact_count_free(&c);
    // Without a window all of it is the start's.
    w = (bt_steady){.start = NAN, .first = N};
    w.series[BT_REPORTED_ICE].mean.mean = NAN;
    bt_impact_count_init(&c, &m, &h, &w);
    bt_impact_count_add(&c, &(bt_impact){.time = 5, .peak = 3});
    assert_true(c.n_all == 1 && c.n == 0 && c.start_peak == 3 && c.hours == 0 && isnan(c.start) &&
                isnan(c.largest_quasi_static_load) && c.start_quasi_static_load == 30);
    assert_true(isnan(c.collision_resistance) && isnan(c.quasi_static_resistance));
    bt_impact_count_free(&c);
}

/// More peaks than are kept: the largest are.
TEST(the_largest_peaks_are_kept)
{
    const bt_impacts m = {.rule = {.conversion = BT_IMPACT_DURATION, .duration = 1}, .dt = 1, .panels = {.n = 1}};
    double one = 1;
    bt_history h = {.n = 1};
    for (int k = 0; k < BT_N_COLUMNS; k++) h.column[k] = &one;
    const bt_steady w = {.start = 1, .n = 1};
    bt_impact_count c;
    bt_impact_count_init(&c, &m, &h, &w);
    const int64_t n = 3 * BT_IMPACT_PEAKS;
    // 1 .. n in another order
    for (int64_t i = 0; i < n; i++)
        bt_impact_count_add(&c, &(bt_impact){.time = 1, .peak = (double)(i * 7919 % n + 1)});
    assert_int_equal(c.n, n);
    assert_int_equal(c.n_peaks, BT_IMPACT_PEAKS);
    double *peaks = bt_alloc(BT_IMPACT_PEAKS, sizeof *peaks);
    bt_impact_count_peaks(&c, peaks);
    for (int64_t i = 0; i < BT_IMPACT_PEAKS; i++) assert_true(peaks[i] == (double)(n - i));
    assert_true(c.largest.peak == (double)n);
    free(peaks);
    bt_impact_count_free(&c);
}

enum { STEPS = 200, EACH = 101 };

/// Collisions of a body with square panels as a step after the other leaves them.
typedef struct scene {
    bt_case c;
    bt_impacts m;
    bt_impact closed[EACH];
} scene;

static void begin(scene *k)
{
    double square[8] = {1, -1, 1, 1, -1, 1, -1, -1};
    *k = (scene){.c = made_up_case(),
                 .m = {.rule = {.conversion = BT_IMPACT_DURATION, .duration = 0.04}, .dt = 0.1, .tolerance = 1e-6}};
    k->c.output.window_start = 5;
    bt_panels_init(&k->m.panels, PANELS, 4, square);
    k->m.closed = k->closed;
}

static void go_on(scene *k, bt_record *r, int first, int end, bt_errors *err)
{
    for (int i = first; i < end; i++) {
        const bt_sample s = sample(i);
        for (int n = 0; n < EACH; n++)
            k->closed[n] = (bt_impact){.time = s.time, .peak = i * EACH + n + 1, .panel = n % PANELS};
        for (int n = 0; n < PANELS; n++) k->m.panels.panel[n] = load_at(i, n);
        k->m.n_closed = EACH;
        bt_record_sample(r, &s, err);
    }
}

/// Close it, and look at the summary.
static void check_end(bt_record *r, const char *dir, bt_errors *err)
{
    const bt_run_totals t = totals(STEPS);
    assert_int_equal(bt_record_close(r, &t, NULL, false, err), BT_OK);
    char path[200], wanted[200];
    snprintf(path, sizeof path, "%s/summary.json", dir);
    char *json = slurp(path);
    const int before = 49, all = STEPS * EACH; // 49 steps end before 5 s
    snprintf(wanted, sizeof wanted, "\"collisions_whole_run\": %d,\n    \"collisions\": %d,", all, all - before * EACH);
    if (!strstr(json, "\"from_s\": 5,") || !strstr(json, wanted))
        fail_msg("no %s in %.900s", wanted, strstr(json, "\"impacts\""));
    snprintf(wanted, sizeof wanted, "\"start_largest_peak_n\": %d,\n    \"largest\": {\n      \"peak_n\": %d,",
             before * EACH, all);
    if (!strstr(json, wanted)) fail_msg("no %s in %.900s", wanted, strstr(json, "\"impacts\""));
    free(json);
    snprintf(path, sizeof path, "%s/result.h5", dir);
    const hid_t file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    hsize_t dims[3];
    double load[PANELS], most[PANELS];
    assert_int_equal(read_all(file, "/panels/mean_load", H5T_NATIVE_DOUBLE, dims, load, sizeof load), 1);
    assert_int_equal(read_all(file, "/panels/start_max_load", H5T_NATIVE_DOUBLE, dims, most, sizeof most), 1);
    for (int n = 0; n < PANELS; n++) {
        assert_float_equal(load[n], sum_of(before, STEPS, n).normal / (STEPS - before), 1e-9);
        assert_true(most[n] == sum_of(0, before, n).most);
    }
    H5Fclose(file);
}

/// More collisions than are read back at once, those of the last step among them: all of result.h5 is counted, once.
TEST(every_row_of_the_file_is_counted)
{
    scene k;
    begin(&k);
    bt_errors err = {0};
    const bt_record_bodies b = bodies();
    bt_record *r;
    assert_int_equal(bt_record_open(&r, &bt_comm_alone, in_folder("rows"), &k.c, &b, "", NULL, true, &err), BT_OK);
    assert_int_equal(bt_record_watch_impacts(r, &k.m, &err), BT_OK);
    go_on(&k, r, 0, STEPS, &err);
    check_end(r, in_folder("rows"), &err);
    bt_panels_free(&k.m.panels);
}

/// The same, taken up before the window begins and within it; and what no step can have left is refused.
TEST(a_record_that_goes_on_counts_the_same)
{
    const struct { int at; const char *dir, *name; double panel, time, load;
    } all[] = {{31, "early", NULL, 1, 1, 1},
               {120, "late", NULL, 1, 1, 1},
               {120, "panel", "/impacts", PANELS, 1, 1},
               {120, "negative", "/impacts", -1, 1, 1},
               {120, "time", "/impacts", 1, NAN, 1},
               {120, "load", "collisions/panel_blocks", 1, 1, NAN}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        scene k;
        begin(&k);
        bt_errors err = {0};
        const bt_record_bodies b = bodies();
        const bt_events none = {0};
        bt_record *r;
        char dir[200];
        snprintf(dir, sizeof dir, "%s", in_folder(all[i].dir));
        assert_int_equal(bt_record_open(&r, &bt_comm_alone, dir, &k.c, &b, "", NULL, true, &err), BT_OK);
        assert_int_equal(bt_record_watch_impacts(r, &k.m, &err), BT_OK);
        go_on(&k, r, 0, all[i].at - 1, &err);
        const bt_sample s = sample(all[i].at - 1); // as the others, but for one number
        for (int n = 0; n < EACH; n++)
            k.closed[n] = (bt_impact){.time = s.time, .peak = (all[i].at - 1) * EACH + n + 1, .panel = n % PANELS};
        k.closed[7].panel = all[i].panel;
        k.closed[7].time *= all[i].time;
        for (int n = 0; n < PANELS; n++) k.m.panels.panel[n] = load_at(all[i].at - 1, n);
        k.m.panels.panel[2].normal *= all[i].load;
        bt_record_sample(r, &s, &err);
        bt_snapshot kept = {.path = "checkpoint", .err = &err};
        bt_snapshot_add_int(&kept, "world/step", all[i].at);
        assert_int_equal(bt_record_save(r, 0, &kept, &err), BT_OK);
        assert_int_equal(bt_record_publish(r, &err), BT_OK);
        bt_record_abandon(r);
        assert_int_equal(err.n, 0);
        assert_int_equal(bt_record_open(&r, &bt_comm_alone, dir, &k.c, &b, "", NULL, false, &err), BT_OK);
        assert_int_equal(bt_record_watch_impacts(r, &k.m, &err), BT_OK);
        const bt_status status = bt_record_load(r, &kept, &none, &err);
        if (all[i].name) {
            assert_int_equal(status, BT_ERR_CASE);
            assert_true(err.n == 1 && strstr(err.text[0], all[i].name));
            bt_record_abandon(r);
        } else {
            assert_int_equal(status, BT_OK);
            go_on(&k, r, all[i].at, STEPS, &err);
            check_end(r, dir, &err);
        }
        bt_errors_free(&err);
        bt_snapshot_free(&kept);
        bt_panels_free(&k.m.panels);
    }
}

int main(void)
{
    return run_in_folder();
}
