// SPDX-License-Identifier: MIT
// The state of a run besides that of its world, and the order of steps in writing and loading a checkpoint.
#include <math.h>
#include <string.h>
#include <time.h>

#include "output/checkpoint.h"
#include "base/checksum.h"
#include "base/largest.h"
#include "revision.h"
#include "run/run_parts.h"
#include "output/folder.h"
#include "output/state.h"
#include "base/table.h"

#define FRAMES_BY_DEFAULT 200

enum { N_PHASES = sizeof(bt_phases) / sizeof(double) };

double bt_running_frame_interval(const bt_case *input)
{
    return input->output.frame_interval > 0 ? input->output.frame_interval : input->run.duration / FRAMES_BY_DEFAULT;
}

/// Save the origin of the state, for people and for comparing programs, not for the run.
static void save_origin(const bt_running *running, bt_snapshot *snap)
{
    char text[64] = "unknown";
    const time_t now = time(NULL);
    struct tm utc;
    if (gmtime_r(&now, &utc)) strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
    bt_snapshot_add_text(snap, "about/program", "bergtow " BT_VERSION);
    bt_snapshot_add_text(snap, "about/revision", BT_REVISION);
    bt_snapshot_add_text(snap, "about/written", text);
    bt_snapshot_add_text(snap, "about/command_line", running->o->command_line ? running->o->command_line : "");
    bt_snapshot_add_int(snap, "about/ranks", running->comm->size);
    bt_snapshot_add_int(snap, "about/threads", running->totals.threads);
}

static void save_case(const bt_case *input, bt_snapshot *snap)
{
    char *text = bt_case_resolved(input);
    bt_snapshot_add_text(snap, "case/resolved", text);
    bt_snapshot_add_text(snap, "about/case_as_given", input->text ? input->text : "");
    bt_snapshot_add_text(snap, "about/case_path", input->path ? input->path : "");
    bt_snapshot_add(snap, "case/current", BT_ITEM_F64, input->water.table.n, 3, input->water.table.row);
    bt_snapshot_add(snap, "case/wind", BT_ITEM_F64, input->air.table.n, 3, input->air.table.row);
    free(text);
}

static void add_digest(bt_text *text, const void *numbers, int64_t n)
{
    char digest[BT_CHECKSUM_DIGEST];
    bt_checksum_digest_text(numbers, (size_t)n * sizeof(double), digest);
    fprintf(text->out, "%s\n", digest);
}

/// Begin a text with the resolved case and digests of its tables.
static void begin_identity(bt_text *text, const bt_case *input)
{
    char *resolved = bt_case_resolved(input);
    bt_text_begin(text);
    fputs(resolved, text->out);
    add_digest(text, input->water.table.row, 3 * input->water.table.n);
    add_digest(text, input->air.table.row, 3 * input->air.table.n);
    free(resolved);
}

bt_status bt_running_same_case(const bt_comm *comm, const bt_case *input, bt_errors *err)
{
    if (comm->size == 1) return BT_OK;
    bt_text t;
    begin_identity(&t, input);
    char *text = bt_text_end(&t);
    const bt_status status = bt_comm_same(comm, bt_case_name(input), text, err);
    free(text);
    return status;
}

char *bt_running_identity(const bt_case *input, const bt_field *field, bt_snapshot *kept)
{
    if (kept) return bt_text_copy(bt_snapshot_text(kept, "about/run"));
    char digest[BT_CHECKSUM_DIGEST];
    bt_text t;
    begin_identity(&t, input);
    add_digest(&t, field->vertices, field->n > 0 ? 2 * field->offsets[field->n] : 0);
    add_digest(&t, field->pose, 3 * (int64_t)field->n);
    add_digest(&t, field->thickness, field->n);
    char *text = bt_text_end(&t);
    bt_checksum_digest_text(text, strlen(text), digest);
    free(text);
    return bt_text_copy(digest);
}

bt_status bt_running_save(bt_running *running, bt_snapshot *snap, const char *name, bt_errors *err)
{
    if (running->comm->rank == 0) bt_checkpoint_begin(snap, running->o->dir, name, err);
    bt_status status = bt_state_save(running->w, running->comm, snap, err);
    if (running->comm->rank == 0) {
        save_origin(running, snap);
        save_case(running->c, snap);
    }
    // the same on all ranks so far
    if (status == BT_OK) status = bt_state_save_field(&running->field, running->w, running->comm, snap, err);
    if (running->comm->rank == 0) {
        bt_state_save_parts(&running->totals.lead, &running->totals.stall, snap);
        bt_snapshot_add_int(snap, "run/frames_due", running->frames_due);
        bt_snapshot_add_int(snap, "run/unconverged_in_a_row", running->guard.in_a_row);
        bt_snapshot_add_int(snap, "run/locked_steps", running->guard.locked);
        bt_snapshot_add_real(snap, "run/energy_limit", running->guard.energy);
        bt_snapshot_add(snap, "clock/phases", BT_ITEM_F64, N_PHASES, 1, &running->totals.phases);
        bt_snapshot_add(snap, "clock/shared", BT_ITEM_F64, N_PHASES, 1, &running->totals.shared);
        bt_snapshot_add_real(snap, "clock/wall_time", running->totals.wall_time + bt_clock() - running->began);
        if (status == BT_OK) status = bt_record_save(running->record, running->frames, snap, err);
        bt_snapshot_end(snap, err);
    }
    return bt_comm_agree(running->comm, status);
}

bt_status bt_running_checkpoint(bt_running *running, const char *name, bt_errors *err)
{
    // The result first: it may hold more than the checkpoint refers to, never less.
    bt_status status = bt_record_publish(running->record, err);
    if (status != BT_OK) return status;
    bt_snapshot snap = {0};
    status = bt_running_save(running, &snap, name, err);
    if (status == BT_OK && running->comm->rank == 0) status = bt_checkpoint_write(&snap, running->o->dir, name, err);
    if (status == BT_OK && running->comm->rank == 0 && running->until < 0) bt_folder_settle(running->o->dir);
    bt_snapshot_free(&snap);
    bt_halt_saved(&running->halt);
    status = bt_comm_agree(running->comm, status);
    if (status == BT_OK) running->edited = false;
    return status;
}

// --- taking up -------------------------------------------------------------------------------------------------------

static void check_table(const bt_table *table, const char *name, bt_snapshot *snap)
{
    bt_snapshot_want(snap, table->n <= BT_MAX_ROWS, name, -1, "has more rows than a table can have");
    for (int64_t i = 0; i < table->n && !snap->faulty; i++)
        bt_snapshot_want(snap, bt_table_row_sound(table, i), name, i,
                         "is not later than the row before, or not a velocity");
}

bt_status bt_running_load_case(bt_case *input, bt_snapshot *snap, bt_errors *err)
{
    bt_table current = {0}, wind = {0};
    current.row = bt_snapshot_copy(snap, "case/current", BT_ITEM_F64, 3, &current.n);
    wind.row = bt_snapshot_copy(snap, "case/wind", BT_ITEM_F64, 3, &wind.n);
    check_table(&current, "case/current", snap);
    check_table(&wind, "case/wind", snap);
    const char *text = bt_snapshot_text(snap, "case/resolved"), *given = bt_snapshot_text(snap, "about/case_as_given");
    const char *path = bt_snapshot_text(snap, "about/case_path");
    *input = (bt_case){0};
    bt_status status = snap->faulty ? BT_ERR_CASE : bt_case_read_kept(input, path, text, &current, &wind, err);
    bt_table_free(&current);
    bt_table_free(&wind);
    if (status != BT_OK) return status;
    const int64_t step = bt_snapshot_int(snap, "world/step");
    bt_snapshot_want(snap, step >= 0 && step <= bt_case_steps(input), "world/step", -1, "is not a step of its case");
    free(input->text); // the result shows the case as given
    input->text = bt_text_copy(given);
    return snap->faulty ? BT_ERR_CASE : BT_OK;
}

bt_status bt_running_load_field(bt_field *field, bt_lead_stats *lead, bt_snapshot *snap)
{
    bt_state_load_field(field, snap);
    bt_state_load_lead(lead, snap);
    return snap->faulty ? BT_ERR_CASE : BT_OK;
}

/// Frames are taken by the interval, and a program may take others (bt_simulation_frame), several between two steps if
/// it edits bodies. Whether result.h5 holds them is checked where it is read.
static void check_frames(const bt_running *running, bt_snapshot *snap)
{
    const int64_t step = bt_snapshot_int(snap, "world/step"), first = bt_running_draws(running->c);
    bt_snapshot_want(snap, running->frames >= first && running->frames <= BT_MAX_STEPS, "record/frames", -1,
                     "is not a number of frames up to here");
    if (!first) {
        bt_snapshot_want(snap, running->frames_due == 1, "run/frames_due", -1, "is not that of a run without frames");
        return;
    }
    const double interval = bt_running_frame_interval(running->c) * (1 - 1e-12),
                 time = (double)step * running->c->run.dt, due = (double)running->frames_due;
    bt_snapshot_want(snap, running->frames_due >= 1 && (due - 1) * interval <= time && time < due * interval,
                     "run/frames_due", -1, "is not the number of the next frame");
}

/// Check the counters that control the run.
static void check_counters(const bt_running *running, bt_snapshot *snap)
{
    double sum = 0, shared = 0;
#define ADD(name, text) sum += running->totals.phases.name, shared += running->totals.shared.name;
    BT_WALL_PHASES(ADD)
#undef ADD
    check_frames(running, snap);
    bt_snapshot_want(snap, running->guard.in_a_row >= 0 && running->guard.in_a_row <= BT_MAX_STEPS,
                     "run/unconverged_in_a_row", -1, "is not a number of steps");
    bt_snapshot_want(snap, running->guard.locked >= 0 && running->guard.locked <= BT_MAX_STEPS, "run/locked_steps", -1,
                     "is not a number of steps");
    bt_snapshot_want(snap, !(running->guard.energy < 0), "run/energy_limit", -1, "is not an energy");
    bt_snapshot_want(snap, isfinite(sum), "clock/phases", -1, "are not all finite");
    bt_snapshot_want(snap, isfinite(shared), "clock/shared", -1, "are not all finite");
    bt_snapshot_want(snap, isfinite(running->totals.wall_time), "clock/wall_time", -1, "is not finite");
}

bt_status bt_running_load(bt_running *running, bt_snapshot *snap, bt_errors *err)
{
    bt_state_load_stall(&running->totals.stall, snap);
    running->frames_due = bt_snapshot_int(snap, "run/frames_due");
    running->frames = bt_snapshot_int(snap, "record/frames");
    running->guard.in_a_row = bt_snapshot_int(snap, "run/unconverged_in_a_row");
    running->guard.locked = bt_snapshot_int(snap, "run/locked_steps");
    running->guard.energy = bt_snapshot_real(snap, "run/energy_limit");
    bt_snapshot_take(snap, "clock/phases", BT_ITEM_F64, N_PHASES, 1, &running->totals.phases);
    bt_snapshot_take(snap, "clock/shared", BT_ITEM_F64, N_PHASES, 1, &running->totals.shared);
    running->totals.wall_time = bt_snapshot_real(snap, "clock/wall_time");
    check_counters(running, snap);
    return bt_state_load(running->w, running->comm, snap, err);
}
