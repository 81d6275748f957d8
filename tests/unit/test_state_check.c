// SPDX-License-Identifier: MIT
// What a checkpoint holds under a sound checksum, and no run leaves, is refused with one message that names the array;
// so is a file of another make.
//
// Each row of the table changes one number of a real state. What turns this red (tried): leaving out the check of the
// cells' box, of the order of contacts, of the width of a row in result.h5, of the space that a dataset takes in the
// file.
#include <unistd.h>

#include <hdf5.h>

#include "test.h"
#include "output/checkpoint.h"
#include "loads/impact.h"
#include "bergtow/run.h"
#include "run/setup.h"
#include "space/cells.h"
#include "step/window.h"
#include "base/fileio.h"
#include "base/h5read.h"
#include "base/checksum.h"
#include "base/snapshot.h"
#include "snapshot_file.h"
#include "output/state.h"

static char folder[] = "/tmp/bergtow-state-XXXXXX";

static char *in_folder(const char *name)
{
    static char path[160];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static void must(bt_status status, bt_errors *err)
{
    if (status != BT_OK) fail_msg("%s", err->n ? err->text[0] : "no message");
}

// --- numbers of a state ----------------------------------------------------------------------------------------------

static const char *const cases[] = {
    "run: {dt: 0.1, duration: 6}\n"
    "domain: {length: 10, width: 6}\n"
    "ice: {concentration: 0.75, size: 0.8, thickness: 0.05, crushing: {pressure: 20 kPa}}\n"
    "body: {length: 2, x: 2}\n"
    "tow: {mode: line, speed: 0.5, ramp: 0, line_length: 2, waypoints: [[6, 0], [9, 1]]}\n"
    "lead: {mode: managed, width: 2.4, length: 4, floe_size: 0.4}\n"
    "solver: {cell_size: 2.5, max_sweeps: 60}\n",
    "run: {dt: 0.125, duration: 10}\n"
    "domain: {frame: geographic, length: 26, width: 10, ends: moving, sides: periodic, ahead: 14}\n"
    "ice: {concentration: 0.35, size: 1, thickness: 0.04}\n"
    "body: {length: 2, draft: 0.5}\n"
    "tow: {mode: line, speed: 1.5, ramp: 1, line_length: 3, line_stiffness: 10 kN, line_damping: 100}\n"
    "water: {latitude: 75, tide: {major: 0.05, minor: 0.02, period: 60}}\n"
    "solver: {cell_size: 2.5, max_sweeps: 40}\n",
};

enum { LAST = -1 };
static const struct change {
    int from;            ///< which case
    const char *name;
    int64_t at;          ///< which number, LAST = the last
    double value;
    const char *reported;    ///< array that the message names, where it is another
} changes[] = {
    {0, "field/offsets", 0, 1, NULL},
    {0, "field/offsets", 3, 1e18, NULL},
    {0, "field/offsets", 3, -9e18, NULL},
    {0, "field/offsets", LAST, 7, NULL},
    {0, "field/vertices", 1, NAN, "field/offsets"},
    {0, "field/vertices", 0, 3, "field/offsets"},
    {0, "field/area", 2, 0, NULL},
    {0, "field/thickness", 1, -1, NULL},
    {0, "field/thickness", 1, 800, NULL},
    {0, "field/thickness", 1, 1e277, NULL},
    {0, "field/thickness", 1, 1e-300, NULL},
    {0, "field/pose", 3, 1e9, NULL},
    {0, "field/ice_area", 0, 1e-300, NULL},
    {0, "field/ice_area", 0, 1e30, NULL},
    {0, "field/concentration", 0, 5.8e301, NULL},
    {0, "field/pose", 5, INFINITY, NULL},
    {0, "field/split", 0, -1, NULL},
    {0, "world/step", 0, -1, NULL},
    {0, "step/water_u", 0, NAN, NULL},
    {0, "cells/side_x", 0, 0, NULL},
    {0, "cells/x0", 0, INFINITY, NULL},
    {0, "cells/low_x", 0, -2e9, NULL},
    {0, "cells/n_x", 0, 0, NULL},
    {0, "cells/n_y", 0, 2147483647, "cells/n_x"},
    {0, "cells/n_y", 0, 1, "bodies/cell"},
    {0, "cells/wrap_x", 0, 3, NULL},
    {0, "cells/reach", 0, 0.01, NULL},
    {0, "cells/allowance", 0, 1e9, NULL},
    {0, "cells/margin_max", 0, NAN, NULL},
    {0, "cells/relabel", 0, 2, NULL},
    {0, "bodies/cell", 4, 1000, NULL},
    {0, "bodies/pose", 3, NAN, NULL},
    {1, "bodies/pose", 0, 1e300, "bodies/cell"},
    {0, "bodies/velocity", 1, INFINITY, NULL},
    {0, "bodies/path", 2, -1, NULL},
    {0, "bodies/disturbed", 0, 7, NULL},
    {0, "contacts/a", 0, -1, NULL},
    {0, "contacts/b", 0, 1e15, "contacts/a"},
    {0, "contacts/part", 0, 9, NULL},
    {0, "contacts/points", 0, 1000, NULL},
    {0, "contacts/value", 0, NAN, NULL},
    {0, "contacts/law", 0, 255, NULL},
    {0, "events/kind", 0, 77, NULL},
    {0, "tow/time", 0, 1e9, NULL},
    {0, "tow/mark", 0, 100, NULL},
    {0, "tow/ux", 0, NAN, NULL},
    {0, "tow/taut_1", 0, 3, NULL},
    {1, "cells/wrap_x", 0, 1e9, "cells/side_x"},
    {1, "cells/wrap_y", 0, 5, NULL},
    {1, "cells/low_y", 0, 1, NULL},
    {1, "cells/n_x", 0, 1, NULL},
    {1, "bodies/lap", 2, 2147483647, NULL},
    {1, "bodies/copy", 2, -2147483648.0, NULL},
    {1, "window/rear_in_ice", 0, NAN, NULL},
    {1, "undisturbed/drift_x", 0, 1e300, NULL},
    {1, "window/renewed", 0, -1, NULL},
    {1, "window/dropped", 2, NAN, NULL},
    {0, "events/value", 0, INFINITY, NULL},
    {0, "bodies/exposure", 1, 1.5, NULL},
};
enum { N_CASES = sizeof cases / sizeof *cases, N_CHANGES = sizeof changes / sizeof *changes };

static struct {
    bt_case c;
    bt_snapshot state;
} kept[N_CASES];

static int make_states(void **state)
{
    (void)state;
    for (int k = 0; k < N_CASES; k++) {
        bt_errors err = {0};
        bt_case *c = &kept[k].c;
        must(bt_file_write(in_folder("case.yml"), cases[k], &err), &err);
        must(bt_case_read(c, in_folder("case.yml"), NULL, 0, &err), &err);
        bt_field f;
        bt_lead_stats lead;
        bt_world *w;
        bt_roster roster;
        bt_field_init(&f);
        must(bt_field_load(c, &f, &err), &err);
        must(bt_lead_open(c, &f, &lead, &err), &err);
        must(bt_setup_world(c, &f, &w, &roster, &err), &err);
        bt_cells_begin(w);
        for (int n = 0; n < 40; n++) bt_world_step(w);
        if (k == 0) bt_events_add(&w->events, 1, BT_EVENT_WAYPOINT, 1, 2); // one to change
        must(bt_state_save(w, &bt_comm_alone, &kept[k].state, &err), &err);
        must(bt_state_save_field(&f, w, &bt_comm_alone, &kept[k].state, &err), &err);
        bt_world_free(w);
        bt_roster_free(&roster);
        bt_field_free(&f);
    }
    return 0;
}

static int free_states(void **state)
{
    (void)state;
    for (int k = 0; k < N_CASES; k++) {
        bt_case_free(&kept[k].c);
        bt_snapshot_free(&kept[k].state);
    }
    return 0;
}

static void set_number(const bt_item *i, int64_t at, double value)
{
    char *to = (char *)i->data + (size_t)at * bt_item_size(i->type);
    const int64_t whole = i->type == BT_ITEM_F64 ? 0 : (int64_t)value;
    if (i->type == BT_ITEM_F64) memcpy(to, &value, sizeof value);
    else memcpy(to, &whole, bt_item_size(i->type));
}

/// Field and state into a new world, as a run does it.
static bt_status take_up(const bt_case *c, bt_snapshot *s, bt_errors *err)
{
    bt_field f;
    bt_world *w = NULL;
    bt_roster roster = {0};
    bt_field_init(&f);
    s->err = err;
    bt_state_load_field(&f, s);
    bt_status status = s->faulty ? BT_ERR_CASE : bt_setup_world(c, &f, &w, &roster, err);
    if (status == BT_OK) status = bt_state_load(w, &bt_comm_alone, s, err);
    bt_world_free(w);
    bt_roster_free(&roster);
    bt_field_free(&f);
    return status;
}

TEST(nonsense_is_refused_by_name)
{
    for (int k = -N_CASES; k < N_CHANGES; k++) {
        const struct change *change = k < 0 ? NULL : &changes[k];
        const int from = change ? change->from : k + N_CASES;
        bt_snapshot s = {.path = "checkpoint"};
        for (int j = 0; j < kept[from].state.n; j++) {
            const bt_item *i = &kept[from].state.item[j];
            bt_snapshot_add(&s, i->name, i->type, i->n, i->width, i->data);
        }
        bt_errors err = {0};
        if (!change) {
            must(take_up(&kept[from].c, &s, &err), &err);
        } else {
            const bt_item *i = bt_snapshot_find(&s, change->name);
            if (!i || i->n * i->width <= change->at)
                fail_msg("%s: has no number %d to change", change->name, (int)change->at);
            set_number(i, change->at == LAST ? i->n * i->width - 1 : change->at, change->value);
            char wanted[80];
            snprintf(wanted, sizeof wanted, "/%s", change->reported ? change->reported : change->name);
            const bt_status status = take_up(&kept[from].c, &s, &err);
            if (status != BT_ERR_CASE || err.n != 1 || !strstr(err.text[0], wanted))
                fail_msg("%s [%d] = %g: status %d, %zu messages: %s", change->name, (int)change->at, change->value,
                         (int)status, err.n, err.n ? err.text[0] : "");
        }
        bt_errors_free(&err);
        bt_snapshot_free(&s);
    }
}

TEST(contacts_out_of_order_are_refused)
{
    bt_snapshot s = {.path = "checkpoint"};
    bt_errors err = {0};
    for (int j = 0; j < kept[0].state.n; j++) {
        const bt_item *i = &kept[0].state.item[j];
        bt_snapshot_add(&s, i->name, i->type, i->n, i->width, i->data);
        const size_t row = (size_t)i->width * bt_item_size(i->type);
        // the first one twice
        if (!strncmp(i->name, "contacts/", 9)) memcpy((char *)s.item[j].data + row, i->data, row);
    }
    assert_int_equal(take_up(&kept[0].c, &s, &err), BT_ERR_CASE);
    assert_true(err.n == 1 && strstr(err.text[0], "out of order"));
    bt_errors_free(&err);
    bt_snapshot_free(&s);
}

// --- files of another make -------------------------------------------------------------------------------------------

enum { HUGE, VARIABLE, ENDLESS, NAME, LINK, WIDE, N_MAKES };

static void add_text(hid_t file, const char *name, size_t size, const char *text)
{
    const hid_t type = H5Tcopy(H5T_C_S1), space = H5Screate(H5S_SCALAR);
    H5Tset_size(type, size);
    if (size != H5T_VARIABLE) H5Tset_strpad(type, H5T_STR_NULLPAD);
    const hid_t d = H5Dcreate2(file, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    assert_true(H5Dwrite(d, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, size == H5T_VARIABLE ? (const void *)&text : text) >=
                0);
    H5Dclose(d);
    H5Sclose(space);
    H5Tclose(type);
}

static void add_numbers(hid_t file, const char *name, int rank, const hsize_t *size)
{
    const hid_t space = H5Screate_simple(rank, size, NULL),
                d = H5Dcreate2(file, name, H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    assert_true(d >= 0);
    H5Dclose(d); // nothing is written: the file has no room for them
    H5Sclose(space);
}

static void write_make(const char *path, int make)
{
    bt_errors err = {0};
    const hid_t file = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    assert_true(file >= 0);
    H5Gclose(H5Gcreate2(file, "/a", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    switch (make) {
    case HUGE: add_numbers(file, "/a/b", 1, (hsize_t[]){(hsize_t)1 << 50}); break;
    case VARIABLE: add_text(file, "/a/b", H5T_VARIABLE, "text"); break;
    case ENDLESS: add_text(file, "/a/b", 4, "text"); break;
    case NAME: add_text(file, "/a/\x1b[31m", 5, "text"); break;
    case LINK: H5Lcreate_external("/etc/passwd", "/", file, "/a/b", H5P_DEFAULT, H5P_DEFAULT); break;
    case WIDE: add_numbers(file, "/a/b", 2, (hsize_t[]){1, (hsize_t)1 << 40}); break;
    }
    H5Fclose(file);
    must(bt_checksum_write(path, BT_CHECKSUM_CHECKPOINT, &err), &err);
}

TEST(files_of_another_make_are_refused)
{
    for (int make = 0; make < N_MAKES; make++) {
        char *path = strdup(in_folder("make.h5"));
        write_make(path, make);
        bt_errors err = {0};
        bt_snapshot s;
        const bt_status status = bt_snapshot_read(&s, path, &err);
        if (status != BT_ERR_CASE || err.n != 1 || s.n != 0 ||
            !strstr(err.text[0], "data that this program does not write"))
            fail_msg("make %d: status %d, %d arrays: %s", make, (int)status, s.n, err.n ? err.text[0] : "no message");
        bt_errors_free(&err);
        free(path);
    }
}

/// Before: the case that had not been read was released.
TEST(a_checkpoint_without_a_case_is_refused)
{
    bt_errors err = {0};
    bt_snapshot s = {0};
    bt_snapshot_add_int(&s, "world/step", 3);
    must(bt_file_make_dir(in_folder("empty"), &err), &err);
    must(write_snapshot(&s, in_folder("empty/checkpoint.h5"), NULL, &err), &err);
    const double revision[] = {1e300, 1e300}; // a number where a text is expected
    bt_snapshot_add(&s, "about/revision", BT_ITEM_F64, 2, 1, revision);
    for (int k = 0; k < 2; k++) {
        const bt_run_options o = {
            .dir = folder, .from = in_folder("empty/checkpoint.h5"), .threads = 1, .quiet = true, .dump_step = -1};
        assert_int_equal(bt_run_resume(&bt_comm_alone, &o, &err), BT_ERR_CASE);
        assert_true(err.n == 1 && strstr(err.text[0], "is missing"));
        bt_errors_free(&err);
        must(write_snapshot(&s, in_folder("empty/checkpoint.h5"), NULL, &err), &err);
    }
    bt_snapshot_free(&s);
}

/// Its last checkpoint after five steps, taken up from one in which one number is another; what that returns.
static bt_status resumed_with(const bt_snapshot *from, const char *name, int64_t at, double value, bt_errors *err)
{
    char *dir = bt_text_copy(in_folder("run")), *changed = bt_text_copy(in_folder("run/changed.h5"));
    bt_snapshot s = {0};
    for (int k = 0; k < from->n; k++) {
        const bt_item *i = &from->item[k];
        bt_snapshot_add(&s, i->name, i->type, i->n, i->width, i->data);
    }
    const bt_item *i = bt_snapshot_find(&s, name);
    if (!i || i->n * i->width <= at) fail_msg("%s: has no number %d to change", name, (int)at);
    set_number(i, at, value);
    must(write_checkpoint(&s, dir, "changed.h5", err), err);
    bt_snapshot_free(&s);
    const bt_run_options o = {
        .dir = dir, .from = changed, .threads = 1, .quiet = true, .dump_step = -1, .max_steps = 5};
    const bt_status status = bt_run_resume(&bt_comm_alone, &o, err);
    free(changed);
    free(dir);
    return status;
}

/// What the loop of a run goes by. What is sound is gone on from: the wall time grows by that of the steps.
TEST(numbers_of_a_run_are_refused_by_name)
{
    static const struct {
        const char *name;
        int64_t at;
        double value;
    } wrong[] = {{"run/unconverged_in_a_row", 0, -1}, {"run/unconverged_in_a_row", 0, 1e18},
                 {"run/energy_limit", 0, -1},         {"run/frames_due", 0, -1},
                 {"run/frames_due", 0, 1000},         {"stall/windows", 0, -1},
                 {"clock/phases", 1, NAN},            {"clock/shared", 1, NAN},
                 {"clock/wall_time", 0, NAN},
                 {"clock/wall_time", 0, INFINITY}};
    bt_errors err = {0};
    bt_snapshot s, later;
    char *dir = bt_text_copy(in_folder("run"));
    const bt_run_options o = {.dir = dir, .threads = 1, .quiet = true, .dump_step = -1, .max_steps = 10};
    must(bt_run(&bt_comm_alone, &kept[0].c, &o, &err), &err);
    must(bt_snapshot_read(&s, in_folder("run/checkpoint.h5"), &err), &err);
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        char wanted[80];
        snprintf(wanted, sizeof wanted, "/%s", wrong[k].name);
        const bt_status status = resumed_with(&s, wrong[k].name, wrong[k].at, wrong[k].value, &err);
        if (status != BT_ERR_CASE || err.n != 1 || !strstr(err.text[0], wanted))
            fail_msg("%s [%d] = %g: status %d, %zu messages: %s", wrong[k].name, (int)wrong[k].at, wrong[k].value,
                     (int)status, err.n, err.n ? err.text[0] : "");
        bt_errors_free(&err);
    }
    must(resumed_with(&s, "clock/wall_time", 0, 1000, &err), &err);
    must(bt_snapshot_read(&later, in_folder("run/checkpoint.h5"), &err), &err);
    const double wall = bt_snapshot_real(&later, "clock/wall_time");
    assert_true(wall > 1000 && wall < 1600);
    assert_int_equal(bt_snapshot_int(&later, "world/step"), 15);
    bt_snapshot_free(&later);
    bt_snapshot_free(&s);
    free(dir);
}

/// A row that is wider than the room for it would be written beyond it.
TEST(rows_of_another_width_are_refused)
{
    const char *path = in_folder("rows.h5");
    static const struct { int64_t first, n, width; bool good;
    } reads[] = {
        {1, 2, 20, true}, {0, 3, 20, true},  {0, 3, 12, false},  {0, 1, 60, false},         {0, 1, 1, false},
        {0, 1, 0, false}, {2, 2, 20, false}, {-1, 1, 20, false}, {3, INT64_MAX, 20, false}, {0, -1, 20, false},
    };
    double *x = calloc(60, sizeof *x);
    for (size_t k = 0; k < sizeof reads / sizeof *reads; k++) {
        bt_errors err = {0};
        const hid_t file = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
        add_numbers(file, "/x", 3, (hsize_t[]){3, 4, 5});
        H5Fclose(file);
        must(bt_checksum_write(path, BT_CHECKSUM_RESULT, &err), &err);
        bt_h5_reader r;
        must(bt_h5_open(&r, path, BT_CHECKSUM_RESULT, &err), &err);
        bt_h5_read(&r, "/x", H5T_NATIVE_DOUBLE, reads[k].first, reads[k].n, reads[k].width, x);
        if ((bt_h5_end(&r) == BT_OK) != reads[k].good || (err.n == 0) != reads[k].good)
            fail_msg("read %zu is %s", k, reads[k].good ? "refused" : "accepted");
        bt_errors_free(&err);
    }
    free(x);
}

int main(void)
{
    if (!mkdtemp(folder)) return 1;
    const int failed = run_all_tests(make_states, free_states);
    char command[160];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command) != 0 || failed;
}
