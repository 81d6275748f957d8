// SPDX-License-Identifier: MIT
// The state of a run beside that of its world, and the order in which a checkpoint is made and taken up.
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "output/checkpoint.h"
#include "partition/domain.h"
#include "base/checksum.h"
#include "base/largest.h"
#include "revision.h"
#include "run/run_parts.h"
#include "output/folder.h"
#include "output/state.h"
#include "base/table.h"
#include "solve/solver.h"

#define FRAMES_BY_DEFAULT 200

enum { N_PHASES = sizeof(bt_phases) / sizeof(double) };

double bt_running_frame_interval(const bt_case *c)
{
    return c->output.frame_interval > 0 ? c->output.frame_interval : c->run.duration / FRAMES_BY_DEFAULT;
}

/// Where the state comes from; for people and for the comparison of programs, not for the run.
static void save_origin(const bt_running *r, bt_snapshot *s)
{
    char text[64] = "unknown";
    const time_t now = time(NULL);
    struct tm utc;
    if (gmtime_r(&now, &utc)) strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
    bt_snapshot_add_text(s, "about/program", "bergtow " BT_VERSION);
    bt_snapshot_add_text(s, "about/revision", BT_REVISION);
    bt_snapshot_add_text(s, "about/written", text);
    bt_snapshot_add_text(s, "about/command_line", r->o->command_line ? r->o->command_line : "");
    bt_snapshot_add_int(s, "about/ranks", r->comm->size);
    bt_snapshot_add_int(s, "about/threads", r->totals.threads);
}

static void save_case(const bt_case *c, bt_snapshot *s)
{
    char *text = bt_case_resolved(c);
    bt_snapshot_add_text(s, "case/resolved", text);
    bt_snapshot_add_text(s, "about/case_as_given", c->text ? c->text : "");
    bt_snapshot_add_text(s, "about/case_path", c->path ? c->path : "");
    bt_snapshot_add(s, "case/current", BT_ITEM_F64, c->water.table.n, 3, c->water.table.row);
    bt_snapshot_add(s, "case/wind", BT_ITEM_F64, c->air.table.n, 3, c->air.table.row);
    free(text);
}

static void add_digest(bt_text *t, const void *numbers, int64_t n)
{
    char digest[BT_CHECKSUM_DIGEST];
    bt_checksum_digest_text(numbers, (size_t)n * sizeof(double), digest);
    fprintf(t->out, "%s\n", digest);
}

char *bt_running_identity(const bt_case *c, const bt_field *f, bt_snapshot *kept)
{
    if (kept) return bt_text_copy(bt_snapshot_text(kept, "about/run"));
    char *resolved = bt_case_resolved(c), digest[BT_CHECKSUM_DIGEST];
    bt_text t;
    bt_text_begin(&t);
    fputs(resolved, t.out);
    add_digest(&t, c->water.table.row, 3 * c->water.table.n);
    add_digest(&t, c->air.table.row, 3 * c->air.table.n);
    add_digest(&t, f->vertices, f->n > 0 ? 2 * f->offsets[f->n] : 0);
    add_digest(&t, f->pose, 3 * (int64_t)f->n);
    add_digest(&t, f->thickness, f->n);
    char *text = bt_text_end(&t);
    bt_checksum_digest_text(text, strlen(text), digest);
    free(text);
    free(resolved);
    return bt_text_copy(digest);
}

bt_status bt_running_save(bt_running *r, bt_snapshot *s, const char *name, bt_errors *err)
{
    bt_solver_rest(r->w);
    if (r->comm->rank == 0) bt_checkpoint_begin(s, r->o->dir, name, err);
    bt_status status = bt_state_save(r->w, r->comm, s, err);
    if (r->comm->rank == 0) {
        save_origin(r, s);
        save_case(r->c, s);
    }
    if (status == BT_OK) status = bt_state_save_field(&r->field, r->w, r->comm, s, err); // agreed so far
    if (r->comm->rank == 0) {
        bt_state_save_lead(&r->totals.lead, s);
        bt_state_save_stall(&r->totals.stall, s);
        bt_snapshot_add_int(s, "run/frames_due", r->frames_due);
        bt_snapshot_add_int(s, "run/unconverged_in_a_row", r->guard.in_a_row);
        bt_snapshot_add_int(s, "run/locked_steps", r->guard.locked);
        bt_snapshot_add_real(s, "run/energy_limit", r->guard.energy);
        bt_snapshot_add(s, "clock/phases", BT_ITEM_F64, N_PHASES, 1, &r->totals.phases);
        bt_snapshot_add(s, "clock/shared", BT_ITEM_F64, N_PHASES, 1, &r->totals.shared);
        bt_snapshot_add_real(s, "clock/wall_time", r->totals.wall_time + bt_clock() - r->began);
        if (status == BT_OK) status = bt_record_save(r->record, r->frames, s, err);
        bt_snapshot_end(s, err);
    }
    return bt_comm_agree(r->comm, status);
}

bt_status bt_running_checkpoint(bt_running *r, const char *name, bt_errors *err)
{
    // The result first: it may hold more than the checkpoint counts on, never less.
    bt_status status = bt_record_publish(r->record, err);
    if (status != BT_OK) return status;
    bt_snapshot s = {0};
    status = bt_running_save(r, &s, name, err);
    if (status == BT_OK && r->comm->rank == 0) status = bt_checkpoint_write(&s, r->o->dir, name, err);
    if (status == BT_OK && r->comm->rank == 0 && r->until < 0) bt_folder_settle(r->o->dir);
    bt_snapshot_free(&s);
    bt_halt_saved(&r->halt);
    status = bt_comm_agree(r->comm, status);
    if (status == BT_OK) r->edited = false;
    return status;
}

// --- taking up -------------------------------------------------------------------------------------------------------

static void check_table(const bt_table *t, const char *name, bt_snapshot *s)
{
    bt_snapshot_want(s, t->n <= BT_MOST_ROWS, name, -1, "has more rows than a table can have");
    for (int64_t i = 0; i < t->n && !s->faulty; i++)
        bt_snapshot_want(s, bt_table_row_sound(t, i), name, i, "is not after the one before, or no velocity");
}

bt_status bt_running_load_case(bt_case *c, bt_snapshot *s, bt_errors *err)
{
    bt_table current = {0}, wind = {0};
    current.row = bt_snapshot_copy(s, "case/current", BT_ITEM_F64, 3, &current.n);
    wind.row = bt_snapshot_copy(s, "case/wind", BT_ITEM_F64, 3, &wind.n);
    check_table(&current, "case/current", s);
    check_table(&wind, "case/wind", s);
    const char *text = bt_snapshot_text(s, "case/resolved"), *given = bt_snapshot_text(s, "about/case_as_given");
    const char *path = bt_snapshot_text(s, "about/case_path");
    *c = (bt_case){0};
    bt_status status = s->faulty ? BT_ERR_CASE : bt_case_read_kept(c, path, text, &current, &wind, err);
    bt_table_free(&current);
    bt_table_free(&wind);
    if (status != BT_OK) return status;
    const int64_t step = bt_snapshot_int(s, "world/step");
    bt_snapshot_want(s, step >= 0 && step <= bt_case_steps(c), "world/step", -1, "is no step of its case");
    free(c->text); // the result shows the case as it was given
    c->text = bt_text_copy(given);
    return s->faulty ? BT_ERR_CASE : BT_OK;
}

bt_status bt_running_load_field(bt_field *f, bt_lead_stats *lead, bt_snapshot *s)
{
    bt_state_load_field(f, s);
    bt_state_load_lead(lead, s);
    return s->faulty ? BT_ERR_CASE : BT_OK;
}

/// Frames are by the interval, and a program may ask for others (bt_simulation_frame), before a step as many as it has
/// edits. That result.h5 holds them is seen where it is read.
static void check_frames(const bt_running *r, bt_snapshot *s)
{
    const int64_t step = bt_snapshot_int(s, "world/step"), first = bt_running_draws(r->c);
    bt_snapshot_want(s, r->frames >= first && r->frames <= BT_MOST_STEPS, "record/frames", -1,
                     "is no number of frames up to here");
    if (!first) {
        bt_snapshot_want(s, r->frames_due == 1, "run/frames_due", -1, "is not that of a run without frames");
        return;
    }
    const double interval = bt_running_frame_interval(r->c) * (1 - 1e-12), time = (double)step * r->c->run.dt,
                 due = (double)r->frames_due;
    bt_snapshot_want(s, r->frames_due >= 1 && (due - 1) * interval <= time && time < due * interval, "run/frames_due",
                     -1, "is not the number of the next frame");
}

/// What the loop of the run goes by.
static void check_counters(const bt_running *r, bt_snapshot *s)
{
    double sum = 0, shared = 0;
#define ADD(name, text) sum += r->totals.phases.name, shared += r->totals.shared.name;
    BT_WALL_PHASES(ADD)
#undef ADD
    check_frames(r, s);
    bt_snapshot_want(s, r->guard.in_a_row >= 0 && r->guard.in_a_row <= BT_MOST_STEPS, "run/unconverged_in_a_row", -1,
                     "is no number of steps");
    bt_snapshot_want(s, r->guard.locked >= 0 && r->guard.locked <= BT_MOST_STEPS, "run/locked_steps", -1,
                     "is no number of steps");
    bt_snapshot_want(s, !(r->guard.energy < 0), "run/energy_limit", -1, "is no energy");
    bt_snapshot_want(s, isfinite(sum), "clock/phases", -1, "are not all finite");
    bt_snapshot_want(s, isfinite(shared), "clock/shared", -1, "are not all finite");
    bt_snapshot_want(s, isfinite(r->totals.wall_time), "clock/wall_time", -1, "is not finite");
}

bt_status bt_running_load(bt_running *r, bt_snapshot *s, bt_errors *err)
{
    bt_state_load_stall(&r->totals.stall, s);
    r->frames_due = bt_snapshot_int(s, "run/frames_due");
    r->frames = bt_snapshot_int(s, "record/frames");
    r->guard.in_a_row = bt_snapshot_int(s, "run/unconverged_in_a_row");
    r->guard.locked = bt_snapshot_int(s, "run/locked_steps");
    r->guard.energy = bt_snapshot_real(s, "run/energy_limit");
    bt_snapshot_take(s, "clock/phases", BT_ITEM_F64, N_PHASES, 1, &r->totals.phases);
    bt_snapshot_take(s, "clock/shared", BT_ITEM_F64, N_PHASES, 1, &r->totals.shared);
    r->totals.wall_time = bt_snapshot_real(s, "clock/wall_time");
    check_counters(r, s);
    return bt_state_load(r->w, r->comm, s, err);
}
