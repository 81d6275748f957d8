// SPDX-License-Identifier: MIT
// A checkpoint whose checksum is sound and whose contents are anything: refused with a message, or a defined run.
//
// The checksum, a digest of every byte, lets no altered byte through, so the arrays of real checkpoints are altered
// behind it. The input: a byte for the run that left the checkpoint, one for the way in (most go in as arrays; some
// into a file with a new checksum, which is then taken up as the program does it, with result.h5 and all), then edits
// of 12 bytes each: which array (2), what is done to it, where (2), and a value in a few forms. (Damaged HDF5 under a
// sound checksum is another matter, as for ice fields: the library is not made for hostile bytes.)
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "output/checkpoint.h"
#include "loads/impact.h"
#include "output/observe.h"
#include "partition/domain.h"
#include "base/fileio.h"
#include "fuzz.h"
#include "snapshot_file.h"
#include "run/run_parts.h"
#include "run/setup.h"

static const struct { const char *text; int64_t steps;
} bases[] = {
    {"run: {dt: 0.1, duration: 3}\ndomain: {length: 9, width: 6}\nice: {concentration: 0.5, size: 1, thickness: 0.05, "
     "crushing: {pressure: 20 kPa}}\nbody: {x: 3, length: 1}\n"
     "tow: {mode: line, speed: 0.5, ramp: 0, line_length: 2, line: {branches: 2}, branch2: {breaking_load: 1}, "
     "waypoints: [[5.2, 0], [8, 1]]}\n"
     "output: {panels: true, sample_every: 3, frame_interval: 0.5}\nsolver: {cell_size: 2.5, max_sweeps: 20}\n",
     14},
    {"run: {dt: 0.125, duration: 5}\ndomain: {frame: geographic, length: 20, width: 8, ends: moving, sides: periodic, "
     "ahead: 10}\nice: {concentration: 0.3, size: 1.5, thickness: 0.04}\n"
     "body: {length: 2, draft: 0.5}\ntow: {mode: thrust, speed: 1.5, ramp: 0.5, line_length: 3, line_stiffness: 10 kN, "
     "line_damping: 100, vessel: {mass: 800, bollard_pull: 600, free_speed: 3}}\n"
     "water: {latitude: 75, tide: {major: 0.05, minor: 0.02, period: 60}}\nair: {wind_x: 5}\nsolver: {cell_size: 2, "
     "max_sweeps: 20}\n",
     24},
    {"run: {dt: 0.1, duration: 2}\ndomain: {length: 8, width: 8, ends: periodic, sides: open}\nice: {concentration: "
     "0.5, size: 1, restitution: 0.3, x_max: 5}\n"
     "floes: [{shape: square, length: 1, x: 6.5, y: 0, vx: -1, thickness: 0.3}]\nbody: {shape: none}\nwater: "
     "{current_x: 0.4}\nsolver: {max_sweeps: 20}\n",
     9},
};
enum { N_BASES = sizeof bases / sizeof *bases, EDIT = 12, STEPS = 3, MAX_ROWS = 200 };

typedef struct {
    bt_snapshot state;
    char *dir, *result; ///< of the run, and a copy of its result.h5 that nothing changes
} kept_run;
static kept_run kept[N_BASES];
static char folder[64];

static void must(bt_status status, bt_errors *err)
{
    if (status != BT_OK && status != BT_ERR_SIGNAL) bt_errors_print(err);
    bt_fuzz_check(status == BT_OK || status == BT_ERR_SIGNAL, "the harness's own run fails");
    bt_errors_free(err);
}

static void remove_folder(void)
{
    char command[100];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    if (system(command) != 0) fprintf(stderr, "%s is left\n", folder);
    for (int k = 0; k < N_BASES; k++) {
        bt_snapshot_free(&kept[k].state);
        free(kept[k].dir);
        free(kept[k].result);
    }
}

/// Run every base once; its checkpoint is what is altered.
static void make_bases(void)
{
    const char *place = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%s/bt_fuzz_XXXXXX", place && strlen(place) < sizeof folder - 20 ? place : "/tmp");
    bt_fuzz_check(mkdtemp(folder) != NULL, "no room for a folder");
    atexit(remove_folder);
    for (int k = 0; k < N_BASES; k++) {
        bt_errors err = {0};
        bt_case c;
        bt_fuzz_file f = bt_fuzz_open((const uint8_t *)bases[k].text, strlen(bases[k].text));
        must(bt_case_read(&c, f.path, NULL, 0, &err), &err);
        bt_fuzz_close(&f);
        kept_run *r = &kept[k];
        bt_fuzz_check(asprintf(&r->dir, "%s/%d", folder, k) > 0 && asprintf(&r->result, "%s/%d.h5", folder, k) > 0,
                      "no memory");
        must(bt_run(&bt_comm_alone, &c,
                    &(bt_run_options){
                        .dir = r->dir, .threads = 1, .max_steps = bases[k].steps, .quiet = true, .dump_step = -1},
                    &err),
             &err);
        bt_case_free(&c);
        char *path = bt_file_join(r->dir, BT_CHECKPOINT_FILE), *result = bt_file_join(r->dir, "result.h5");
        must(bt_snapshot_read(&r->state, path, &err), &err);
        must(bt_file_copy(result, r->result, &err), &err);
        free(path);
        free(result);
    }
}

// --- edits -----------------------------------------------------------------------------------------------------------

enum { SET, BITS, FLIP, MORE, ROW_OF, ROWS, WIDTH, TYPE, GONE, OTHER_RUN, TEXT, SCALE, N_EDITS };

static uint64_t bits_of(const uint8_t *p)
{
    uint64_t x;
    memcpy(&x, p, sizeof x);
    return x;
}

static double real_of(const uint8_t *p)
{
    static const double marks[] = {0,      1,      -1,     0.5,     NAN,          INFINITY, -INFINITY, 1e300,
                                   -1e300, 1e-300, 9.3e18, -9.3e18, 2147483648.0, 1e9,      1e15};
    const int16_t i = (int16_t)(p[0] | p[1] << 8);
    return p[2] < sizeof marks / sizeof *marks ? marks[p[2]] : i / 16.0;
}

static int64_t whole_of(const uint8_t *p)
{
    static const int64_t marks[] = {0,         1,         -1,        2,         255,        65535,
                                    INT32_MAX, INT32_MIN, INT64_MAX, INT64_MIN, 1000000000, 1 << 20};
    return p[2] < sizeof marks / sizeof *marks ? marks[p[2]] : (int16_t)(p[0] | p[1] << 8);
}

static char *number_at(bt_item *i, uint64_t at) { return (char *)i->data + at * bt_item_size(i->type); }

static void set_number(bt_item *i, uint64_t at, const uint8_t *value)
{
    char *to = number_at(i, at);
    const double x = real_of(value);
    const int64_t n = whole_of(value);
    if (i->type == BT_ITEM_F64) memcpy(to, &x, sizeof x);
    else memcpy(to, &n, bt_item_size(i->type));
}

/// Another shape with the bytes there are, and zeros behind them.
static void reshape(bt_item *i, bt_item_type type, int64_t n, int width)
{
    const size_t had = (size_t)i->n * (size_t)i->width * bt_item_size(i->type),
                 has = (size_t)n * (size_t)width * bt_item_size(type);
    void *data = bt_alloc(has, 1);
    memcpy(data, i->data, had < has ? had : has);
    free(i->data);
    i->data = data, i->type = type, i->n = n, i->width = width;
}

static void copy_item(bt_item *to, const bt_item *from)
{
    reshape(to, from->type, from->n, from->width);
    memcpy(to->data, from->data, (size_t)from->n * (size_t)from->width * bt_item_size(from->type));
}

static void edit(bt_snapshot *s, const uint8_t *e)
{
    if (s->n == 0) return;
    bt_item *i = &s->item[(e[0] | e[1] << 8) % s->n];
    const uint64_t count = (uint64_t)i->n * (uint64_t)i->width, at = count ? (uint64_t)(e[3] | e[4] << 8) % count : 0;
    const uint8_t *value = e + 4;
    const size_t size = bt_item_size(i->type);
    const uint64_t bits = bits_of(value);
    switch (e[2] % N_EDITS) {
    case SET:
        if (count) set_number(i, at, value);
        break;
    case BITS:
        if (count) memcpy(number_at(i, at), &bits, size);
        break;
    case FLIP:
        if (count) number_at(i, at)[bits % size] ^= (char)(1 << (bits >> 8) % 8);
        break;
    case MORE: // one more, or one less: what is next to a bound
        if (count && i->type == BT_ITEM_F64) {
            double x;
            memcpy(&x, number_at(i, at), sizeof x);
            x = nextafter(x, bits & 1 ? INFINITY : -INFINITY);
            memcpy(number_at(i, at), &x, sizeof x);
        } else if (count) {
            *(uint8_t *)number_at(i, at) += (uint8_t)(bits & 1 ? 1 : 255);
        }
        break;
    case ROW_OF: {
        const size_t row = (size_t)i->width * size;
        if (count && row)
            memmove((char *)i->data + at / (uint64_t)i->width * row, (char *)i->data + bits % (uint64_t)i->n * row,
                    row);
        break;
    }
    case ROWS: reshape(i, i->type, (int64_t)(bits % MAX_ROWS), i->width); break;
    case WIDTH: reshape(i, i->type, i->n, 1 + (int)(bits % 8)); break;
    case TYPE: reshape(i, (bt_item_type)(bits % BT_ITEM_TYPES), i->n, i->width); break;
    case GONE: // in place: the last one takes its name
        free(i->name);
        free(i->data);
        *i = s->item[--s->n];
        break;
    case OTHER_RUN: {
        const bt_item *other = bt_snapshot_find(&kept[bits % N_BASES].state, i->name);
        if (other) copy_item(i, other);
        break;
    }
    case TEXT:
        for (uint64_t k = 0; k < 8 && at + k < count; k++) ((char *)i->data)[at + k] = (char)value[k];
        break;
    case SCALE:
        if (i->type == BT_ITEM_F64)
            for (uint64_t k = 0; k < count; k++) {
                double x;
                memcpy(&x, number_at(i, k), sizeof x);
                x *= real_of(value);
                memcpy(number_at(i, k), &x, sizeof x);
            }
        break;
    }
}

/// What the reader of the file ensures: a text ends where its array does, and nowhere before.
static void close_texts(bt_snapshot *s)
{
    for (int k = 0; k < s->n; k++) {
        bt_item *i = &s->item[k];
        if (i->type != BT_ITEM_TEXT) continue;
        reshape(i, BT_ITEM_TEXT, i->n * i->width > 0 ? i->n * i->width : 1, 1);
        char *text = i->data;
        for (int64_t c = 0; c + 1 < i->n; c++)
            if (!text[c]) text[c] = '?';
        text[i->n - 1] = 0;
    }
}

static void altered(const bt_snapshot *from, const uint8_t *data, size_t n, bt_snapshot *s)
{
    *s = (bt_snapshot){.path = "checkpoint.h5"};
    for (int k = 0; k < from->n; k++) {
        const bt_item *i = &from->item[k];
        bt_snapshot_add(s, i->name, i->type, i->n, i->width, i->data);
    }
    for (; n >= EDIT; n -= EDIT, data += EDIT) edit(s, data);
    close_texts(s);
}

// --- the ways in -----------------------------------------------------------------------------------------------------

static void step_on(bt_running *r)
{
    bool sound = true;
    for (int k = 0; k < STEPS && r->w->step < bt_case_steps(r->c) && sound; k++) {
        bt_world_step(r->w);
        bt_sample s;
        bt_observe(r->w, bt_case_reference_speed(r->c), &s);
        bt_stall_step(&r->totals.stall, r->w, s.ice_resistance, s.tow_force, r->roster.mean_size);
        sound = !bt_sample_fault(&s, bt_observe_applies(r->w));
    }
    if (r->w->impacts) bt_impacts_end(r->w->impacts);
}

/// As src/run/running.c does it, without the files. True when it was accepted.
static bool take_up_arrays(bt_snapshot *s)
{
    bt_errors err = {0};
    s->err = &err;
    bt_case c;
    bt_field f;
    bt_field_init(&f);
    bt_lead_stats lead = {0};
    bt_running r = {.comm = &bt_comm_alone, .c = &c, .o = &(bt_run_options){.threads = 1}};
    bt_status status = bt_running_load_case(&c, s, &err);
    if (status == BT_OK) status = bt_running_load_field(&f, &lead, s);
    if (status == BT_OK) status = bt_setup_world(&c, &f, &r.w, &r.roster, &err);
    if (status == BT_OK) status = bt_running_load(&r, s, &err);
    bt_fuzz_reported(status, &err);
    // The hash is all that was wrong: a hostile file would have the right one.
    const bool loaded = status == BT_OK || (status == BT_ERR_NUMERIC && !s->faulty);
    if (loaded) step_on(&r);
    bt_world_free(r.w);
    bt_roster_free(&r.roster);
    bt_field_free(&f);
    bt_case_free(&c);
    return status == BT_OK;
}

static bool take_up_file(const kept_run *r, const bt_snapshot *s)
{
    bt_errors err = {0};
    char *path = bt_file_join(r->dir, BT_CHECKPOINT_FILE), *before = bt_file_join(r->dir, BT_CHECKPOINT_BEFORE),
         *result = bt_file_join(r->dir, "result.h5");
    unlink(before);
    must(bt_file_copy(r->result, result, &err), &err);
    must(write_snapshot(s, path, NULL, &err), &err);
    const bt_status status = bt_run_resume(
        &bt_comm_alone,
        &(bt_run_options){.dir = r->dir, .threads = 1, .max_steps = STEPS, .quiet = true, .dump_step = -1}, &err);
    bt_fuzz_reported(status, &err);
    free(path);
    free(before);
    free(result);
    return status == BT_OK;
}

void bt_fuzz_checkpoint(const uint8_t *data, size_t n)
{
    if (n < 2) return;
    if (!kept[0].dir) make_bases();
    const kept_run *r = &kept[data[0] % N_BASES];
    bt_snapshot s;
    altered(&r->state, data + 2, n - 2, &s);
    const bool taken = data[1] == 255 ? take_up_file(r, &s) : take_up_arrays(&s);
    bt_fuzz_check(taken || n >= 2 + EDIT, "a checkpoint that nobody has altered is refused");
    bt_snapshot_free(&s);
}
