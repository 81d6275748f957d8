// SPDX-License-Identifier: MIT
// Files of a run: case.resolved.yml before it, result.h5 while it runs, summary.json and frames.xdmf after it.
//
// The run writes result.part.h5: after each flush all series have one length and the file is complete up to then, so
// that a run can be watched; if it is killed within a flush, some series have the new length and some the old, with
// whole rows (h5driver.c). The final name, result.h5, is only for complete files protected by a checksum (checksum.h):
// a copy at each checkpoint (record_resume.c), and at the end the file itself (attribute "complete" of the root: 0
// until the run has closed it). The small text files are written under a temporary name and renamed.
#include "output/record.h"

#include <unistd.h>

#include "output/checkpoint.h"
#include "base/fileio.h"
#include "base/h5dataset.h"
#include "case/case_files.h"
#include "output/folder.h"
#include "output/record_parts.h"
#include "output/summary_keys.h"
#include "base/checksum.h"
#include "base/inside.h"
#include "output/xdmf.h"

#define FLUSH_SECONDS 5.0 // wall time between flushes
// The same at a frame, or after this many frames. Not at each frame: one append per series takes some milliseconds, a
// quarter of the time of a small run.
#define FRAME_SECONDS 0.5
#define FRAMES_WAITING 16

static void create_series(bt_record *record)
{
    static const char *const merge[BT_KEEP_KINDS] = {[BT_KEEP_LAST] = "last step", [BT_KEEP_MEAN] = "mean of the steps",
                                        [BT_KEEP_MAX] = "largest of the steps", [BT_KEEP_SUM] = "sum of the steps"};
    bt_h5_group(&record->h5, "/series");
    const int64_t every = record->c->output.sample_every;
    bt_h5_attr_int(&record->h5, "/series", "steps_per_sample", every > 1 ? every : 1);
    for (int k = 0; k < record->n_series; k++) {
        const bt_quantity *quantity = bt_series(k);
        const char *name = BT_PATH("/series", quantity->name);
        record->series[k] = bt_h5_growing(&record->h5, name, H5T_NATIVE_DOUBLE, 1, NULL,
                                          (hsize_t[]){BT_RECORD_BUFFER, 1}, false);
        bt_h5_describe(&record->h5, name, NULL, quantity->units, quantity->description);
        bt_h5_attr_text(&record->h5, name, "merge", merge[quantity->keep]);
        bt_h5_attr_text(&record->h5, name, "applies", bt_applies_names[quantity->applies]);
        bt_h5_attr_text(&record->h5, name, "needs", bt_applies_codes[quantity->applies]);
        bt_h5_attr_int(&record->h5, name, "order", k); // a group lists its members by name
        if (quantity->role != BT_ROLE_NONE) bt_h5_attr_text(&record->h5, name, "role", bt_role_names[quantity->role]);
        if (quantity->label) bt_h5_attr_text(&record->h5, name, "label", quantity->label);
        if (quantity->summary) bt_h5_attr_text(&record->h5, name, "summary", quantity->summary);
    }
    for (int k = 0; k < record->n_series; k++) // when their time is there
        bt_h5_axes(&record->h5, BT_PATH("/series", bt_series(k)->name), "time");
}

static void create_events(bt_record *record)
{
    static const char *const names[4] = {"/events/time", "/events/kind", "/events/subject", "/events/value"};
    static const char *const units[4] = {"s", "1", "1", NULL};
    static const char *const texts[4] = {"end of the step", "index into kind_names",
                                         "which branch (line_broken) or way-point (waypoint), from 1",
                                         "tension N (line_broken), speed of the body m/s (adrift), way m (waypoint)"};
    bt_h5_group(&record->h5, "/events");
    for (int k = 0; k < 4; k++) {
        record->events[k] = bt_h5_growing(&record->h5, names[k], k % 3 ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE, 1, NULL,
                                          (hsize_t[]){64, 1}, false);
        bt_h5_describe(&record->h5, names[k], "time", units[k], texts[k]);
    }
    bt_h5_put_names(&record->h5, "/events/kind_names", BT_EVENT_KINDS, bt_event_names, "event_kind",
                    "what a number in kind stands for");
}

bt_status bt_record_events(bt_record *record, const bt_events *events, bt_errors *err)
{
    if (record->h5.status != BT_OK || record->comm->rank != 0) return record->h5.status;
    record->h5.err = err;
    for (; record->n_events < events->n; record->n_events++) {
        const bt_event *event = &events->event[record->n_events];
        const void *const column[4] = {&event->time, &event->kind, &event->subject, &event->value};
        for (int k = 0; k < 4; k++)
            bt_h5_append(&record->h5, record->events[k], k % 3 ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE,
                         (hsize_t)record->n_events, 1, column[k]);
    }
    return record->h5.status;
}

static void record_free(bt_record *record)
{
    bt_summary_free(&record->summary);
    bt_impact_count_free(&record->count);
    bt_history_free(&record->history);
    BT_FREE(record->dir, record->series, record->merged, record->buffer, record);
}

/// Close the file, and with it its datasets; returns the status of all writes to the file.
static bt_status close_file(bt_record *record)
{
    bt_frames_close(&record->frames);
    bt_impact_store_close(&record->impacts);
    bt_piece_store_close(&record->pieces);
    return bt_h5_close(&record->h5);
}

/// Prepare the folder. A resumed run removes only the unfinished file.
static bt_status prepare_dir(bt_record *record, const char *resolved, const char *digests, bool fresh,
                             bt_errors *err)
{
    bt_status status = bt_file_make_dir(record->dir, err);
    if (status == BT_OK && fresh) {
        char *text = bt_case_with_comments(resolved, digests, record->c->text);
        status = bt_folder_replace(record->dir, text, err);
        record->replaces = bt_folder_keeps(record->dir);
        free(text);
    } else if (status == BT_OK) {
        record->replaces = true;
        status = bt_file_remove(BT_PATH(record->dir, BT_RESULT_FILE ".tmp"), err);
        if (status == BT_OK) status = bt_file_remove(BT_PATH(record->dir, BT_CHECKPOINT_FILE ".tmp"), err);
    }
    return status;
}

bt_status bt_record_open(bt_record **out, const bt_comm *comm, const char *dir, const bt_case *input,
                         const bt_record_bodies *bodies, const char *command_line, const char *digests, bool fresh,
                         bt_errors *err)
{
    *out = NULL;
    bt_record *record = bt_alloc(1, sizeof *record);
    record->dir = bt_text_copy(dir);
    record->c = input;
    record->comm = comm;
    record->fresh = fresh;
    record->n_floes = bodies->n_floes;
    record->towed = bodies->towed;
    record->last_flush = bt_clock();
    bt_history_init(&record->history);
    record->n_series = bt_n_series();
    record->merged = bt_alloc((size_t)record->n_series, sizeof *record->merged);
    record->buffer = bt_alloc((size_t)record->n_series * BT_RECORD_BUFFER, sizeof *record->buffer);
    record->series = bt_alloc((size_t)record->n_series, sizeof *record->series);

    const char *path = BT_PATH(dir, BT_RESULT_PART);
    char *resolved = bt_case_resolved(input);
    bt_status status = comm->rank == 0 ? bt_summary_check_added(err) : BT_OK;
    if (status == BT_OK && comm->rank == 0) status = prepare_dir(record, resolved, digests, fresh, err);
    const bool prepared = status == BT_OK && comm->rank == 0;
    status = bt_comm_agree(comm, status);
    if (status == BT_OK) status = bt_h5_create_shared(&record->h5, comm, path, err);
    if (status == BT_OK) {
        bt_h5_attr_int(&record->h5, "/", "complete", 0);
        bt_h5_attr_int(&record->h5, "/", "n_steps_of_case", bt_case_steps(input));
        bt_h5_attr_text(&record->h5, "/", "comment",
                        "complete: 1 once the file holds all that the run has done, n_steps; it has done its case if "
                        "that is n_steps_of_case. stopped: the signal or limit that ended it earlier; empty at the end "
                        "of the case, and after the number of steps that was asked for");
        bt_provenance_write(&record->h5, command_line);
        bt_h5_put_text(&record->h5, "/case", resolved, "the case with every key, in SI units");
        bt_h5_put_text(&record->h5, "/case_as_given", input->text ? input->text : "",
                       "the case file as it was given, and in a second document what a study or --set changed");
        bt_h5_describe_file(&record->h5, input->run.title);
        create_series(record);
        create_events(record);
        const bt_map_axes axes = bt_map_axes_of(input, bodies->outlines);
        bt_frames_create(&record->frames, &record->h5, comm, bodies, &axes);
        // the data of other ranks is in the file: now it may be announced
        status = bt_comm_agree(comm, record->h5.status);
        if (status == BT_OK) {
            bt_h5_flush(&record->h5);
            status = bt_comm_agree(comm, record->h5.status);
        }
        if (status != BT_OK) {
            bt_h5_give_up(&record->h5, status);
            close_file(record);
        }
    }
    if (status != BT_OK && prepared && fresh) bt_folder_put_back(dir);
    else if (status != BT_OK && prepared) unlink(path);
    free(resolved);
    if (status != BT_OK) {
        record_free(record);
        return status;
    }
    *out = record;
    return BT_OK;
}

bt_status bt_record_watch_splitting(bt_record *record, const struct bt_splitting *splitting,
                                    const struct bt_roster *roster, bt_errors *err)
{
    if (record->comm->rank != 0) return BT_OK;
    record->h5.err = err;
    const int64_t n_bodies = record->frames.n_floes + record->frames.n_others;
    bt_piece_store_create(&record->pieces, &record->h5, splitting, roster, n_bodies, record->c->run.dt,
                          &record->frames.axes);
    bt_impact_store_pieces(&record->impacts, roster, n_bodies);
    return record->h5.status;
}

bt_status bt_record_watch_impacts(bt_record *record, const struct bt_impacts *impacts, bt_errors *err)
{
    if (record->comm->rank != 0) return BT_OK;
    record->h5.err = err;
    bt_impact_store_create(&record->impacts, &record->h5, impacts, record->c);
    return record->h5.status;
}

void bt_record_flush(bt_record *record)
{
    for (int k = 0; k < record->n_series; k++)
        bt_h5_append(&record->h5, record->series[k], H5T_NATIVE_DOUBLE, (hsize_t)record->written,
                     (hsize_t)record->buffered, record->buffer + (size_t)k * BT_RECORD_BUFFER);
    record->written += record->buffered;
    record->buffered = 0;
    bt_impact_store_write(&record->impacts);
    bt_piece_store_write(&record->pieces);
    bt_h5_flush(&record->h5);
    record->frames_waiting = 0;
    record->last_flush = bt_clock();
}

/// Move the merged steps to the buffer as one entry.
static void end_entry(bt_record *record)
{
    for (int k = 0; k < record->n_series; k++)
        record->buffer[(size_t)k * BT_RECORD_BUFFER + (size_t)record->buffered] =
            bt_record_merged(bt_series(k)->keep, record->merged[k], record->n_merged);
    record->buffered++;
    record->n_merged = 0;
    bt_impact_store_end_sample(&record->impacts);
}

bt_status bt_record_sample(bt_record *record, const bt_sample *sample, bt_errors *err)
{
    if (record->h5.status != BT_OK || record->comm->rank != 0) return record->h5.status;
    record->h5.err = err;
    bt_history_add(&record->history, sample);
    bt_impact_store_take(&record->impacts, sample->time, sample->no_load != 0);
    for (int k = 0; k < record->n_series; k++) {
        const bt_quantity *quantity = bt_series(k);
        double *m = &record->merged[k];
        const double x = bt_sample_value(sample, quantity);
        *m = record->n_merged ? bt_record_merge(quantity->keep, *m, x) : x;
    }
    if (++record->n_merged >= record->c->output.sample_every) end_entry(record);
    if (record->buffered == BT_RECORD_BUFFER ||
        (record->buffered > 0 && bt_clock() - record->last_flush > FLUSH_SECONDS))
        bt_record_flush(record);
    return record->h5.status;
}

void bt_record_overlap(bt_record *record, double overlap)
{
    if (record->comm->rank == 0) record->history.max_overlap = bt_max_seen(record->history.max_overlap, overlap);
}

bt_status bt_record_frame(bt_record *record, double time, const bt_frame_row *rows, const bt_frame_line *line,
                          const bt_piece_row *pieces, int64_t n_pieces, bt_errors *err)
{
    record->h5.err = err;
    const bt_status status = bt_record_add_frame(record, time, rows, line, pieces, n_pieces);
    if (status != BT_OK) return status;
    if (record->comm->rank == 0 &&
        (++record->frames_waiting == FRAMES_WAITING || bt_clock() - record->last_flush > FRAME_SECONDS))
        bt_record_flush(record);
    return bt_comm_agree(record->comm, record->h5.status);
}

bt_status bt_record_add_frame(bt_record *record, double time, const bt_frame_row *rows, const bt_frame_line *line,
                              const bt_piece_row *pieces, int64_t n_pieces)
{
    bt_h5_group(&record->h5, bt_frames_group(&record->frames, (char[64]){0}));
    // a reader counts frames by their times, which come last
    if (record->comm->rank == 0) bt_piece_store_frame(&record->pieces, pieces, n_pieces);
    return bt_frames_add(&record->frames, time, rows, line);
}

static void write_totals(bt_record *record, const bt_run_totals *totals)
{
    bt_h5_attr_int(&record->h5, "/", "ranks", totals->ranks);
    bt_h5_attr_int(&record->h5, "/", "threads", totals->threads);
    bt_h5_attr_int(&record->h5, "/", "n_steps", totals->n_steps);
    bt_h5_attr_double(&record->h5, "/", "wall_time", totals->wall_time);
    bt_h5_attr_text(&record->h5, "/", "stopped", totals->stopped ? totals->stopped : "");
    bt_h5_flush(&record->h5);
    bt_h5_attr_int(&record->h5, "/", "complete", 1);
}

char *bt_record_xdmf(const bt_record *record)
{
    const bt_frames *frames = &record->frames;
    return bt_xdmf_text(&(bt_xdmf){.n_floes = frames->n_floes, .n_bodies = frames->n_others,
                                   .floe_vertices = frames->floe_vertices, .body_vertices = frames->other_vertices,
                                   .towed = frames->towed, .branches = frames->branches, .axes = frames->axes,
                                   .time = frames->times, .line = frames->lines, .n_frames = frames->n,
                                   .pieces = record->pieces.h ? record->pieces.frame : NULL});
}

/// Compare the files, as they were when the run began, with those that its case was recorded with.
static void warn_of_files(bt_record *record)
{
    char *text = NULL;
    size_t size;
    if (bt_file_read(BT_PATH(record->dir, BT_FOLDER_CASE), "a case", &text, &size, NULL) == BT_OK)
        bt_case_warn_files(record->c, text, &record->summary.warnings);
    free(text);
}

/// Write the buffered data to the file, and form the numbers of the whole run, on rank 0.
static void conclude(bt_record *record, const bt_run_totals *totals)
{
    if (record->n_merged > 0) end_entry(record);
    bt_record_flush(record);
    bt_summary_make(&record->summary, &record->history, record->c, totals, record->n_floes, record->towed >= 0);
    warn_of_files(record);
    if (!record->impacts.h) return;
    bt_impact_count_init(&record->count, record->impacts.from, &record->history, &record->summary.window);
    bt_impact_store_count(&record->impacts, &record->count);
    bt_impact_store_totals(&record->impacts, &record->count, &record->summary.window);
    record->summary.impacts = &record->count;
}

static bt_status write_summary(const bt_record *record, const bt_run_totals *totals, bt_errors *err)
{
    bt_run_totals all = *totals; // with the wall time so far
    all.call.end = totals->stepped > 0 ? bt_clock() - totals->stepped : 0;
    char *text = bt_summary_json(&record->summary, &record->history, record->c, &all, record->n_floes);
    const bt_status status = bt_file_write(BT_PATH(record->dir, "summary.json"), text, err);
    free(text);
    return status;
}

bt_status bt_record_close(bt_record *record, const bt_run_totals *totals, bt_snapshot *last, bool table, bt_errors *err)
{
    const bool first = record->comm->rank == 0;
    char *xdmf = first ? bt_record_xdmf(record) : NULL;
    record->h5.err = err;
    if (first && totals) {
        conclude(record, totals);
        write_totals(record, totals);
    } else if (first) {
        if (record->n_merged > 0) end_entry(record);
        bt_record_flush(record);
    }
    bt_h5_sync_raw(&record->h5);
    bt_status status = bt_comm_agree(record->comm, close_file(record));
    // The result before the checkpoint, which refers to it; the summary last: if there is one, the rest is complete.
    if (first && status == BT_OK)
        status = bt_checksum_publish(BT_PATH(record->dir, BT_RESULT_PART), BT_PATH(record->dir, BT_RESULT_FILE),
                                     BT_CHECKSUM_RESULT, err);
    if (first && status == BT_OK) status = bt_file_write(BT_PATH(record->dir, "frames.xdmf"), xdmf, err);
    if (first && status == BT_OK && last) status = bt_checkpoint_write(last, record->dir, BT_CHECKPOINT_FILE, err);
    if (first && status == BT_OK && totals) status = write_summary(record, totals, err);
    if (first && status == BT_OK && totals) bt_folder_settle(record->dir);
    if (first && status == BT_OK && totals && record->replaces) bt_folder_warn_pages(record->dir);
    status = bt_comm_agree(record->comm, status);
    if (first && status == BT_OK && totals && table)
        bt_summary_print(&record->summary, &record->history, record->c, totals, record->n_floes);
    free(xdmf);
    record_free(record);
    return status;
}

void bt_record_abandon(bt_record *record)
{
    bt_h5_give_up(&record->h5, BT_ERR_IO);
    close_file(record);
    if (record->comm->rank == 0) unlink(BT_PATH(record->dir, BT_RESULT_PART));
    if (record->comm->rank == 0 && record->fresh) bt_folder_put_back(record->dir);
    record_free(record);
}
