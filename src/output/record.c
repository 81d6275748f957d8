// SPDX-License-Identifier: MIT
// What a run leaves behind: result.h5 while it runs, case.resolved.yml before, summary.json and frames.xdmf after it.
//
// result.part.h5 is what the run writes: after each flush all series have one length and the file is complete up to
// then, so that a calculation can be watched; killed within a flush, some series have its length and some that of the
// last, all rows whole (h5driver.c). Under its final name, result.h5, stands only what is complete and protected by a
// checksum (checksum.h): a copy of it at each checkpoint (record_resume.c), and at the end the file itself (attribute
// "complete" of the root: 0 until the run has closed it). The small text files are written under a temporary name and
// renamed.
#include "output/record.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "output/checkpoint.h"
#include "base/fileio.h"
#include "base/h5dataset.h"
#include "case/case_files.h"
#include "output/folder.h"
#include "output/record_parts.h"
#include "output/summary_keys.h"
#include "base/checksum.h"
#include "output/xdmf.h"

#define FLUSH_SECONDS 5.0 // wall time between flushes
// The same at a frame, or so many of them. Not at each: one append a series takes some milliseconds, a quarter of the
// time of a small run.
#define FRAME_SECONDS 0.5
#define FRAMES_WAITING 16

static void create_series(bt_record *r)
{
    static const char *const merge[BT_KEEP_KINDS] = {[BT_KEEP_LAST] = "last step", [BT_KEEP_MEAN] = "mean of the steps",
                                        [BT_KEEP_MAX] = "largest of the steps", [BT_KEEP_SUM] = "sum of the steps"};
    bt_h5_group(&r->h5, "/series");
    const int64_t every = r->c->output.sample_every;
    bt_h5_attr_int(&r->h5, "/series", "steps_per_sample", every > 1 ? every : 1);
    for (int k = 0; k < r->n_series; k++) {
        const bt_quantity *f = bt_series(k);
        char *name = bt_file_join("/series", f->name);
        r->series[k] = bt_h5_growing(&r->h5, name, H5T_NATIVE_DOUBLE, 1, NULL, (hsize_t[]){BT_RECORD_BUFFER, 1}, false);
        bt_h5_describe(&r->h5, name, NULL, f->units, f->description);
        bt_h5_attr_text(&r->h5, name, "merge", merge[f->keep]);
        bt_h5_attr_text(&r->h5, name, "applies", bt_applies_names[f->applies]);
        bt_h5_attr_text(&r->h5, name, "needs", bt_applies_codes[f->applies]);
        bt_h5_attr_int(&r->h5, name, "order", k); // a group lists its members by name
        if (f->role != BT_ROLE_NONE) bt_h5_attr_text(&r->h5, name, "role", bt_role_names[f->role]);
        if (f->label) bt_h5_attr_text(&r->h5, name, "label", f->label);
        if (f->summary) bt_h5_attr_text(&r->h5, name, "summary", f->summary);
        free(name);
    }
    for (int k = 0; k < r->n_series; k++) { // when their time is there
        char *name = bt_file_join("/series", bt_series(k)->name);
        bt_h5_axes(&r->h5, name, "time");
        free(name);
    }
}

static void create_events(bt_record *r)
{
    static const char *const names[4] = {"/events/time", "/events/kind", "/events/subject", "/events/value"};
    static const char *const units[4] = {"s", "1", "1", NULL};
    static const char *const texts[4] = {"end of the step", "index into kind_names",
                                         "which branch (line_broken) or way-point (waypoint), from 1",
                                         "tension N (line_broken), speed of the body m/s (adrift), way m (waypoint)"};
    bt_h5_group(&r->h5, "/events");
    for (int k = 0; k < 4; k++) {
        r->events[k] = bt_h5_growing(&r->h5, names[k], k % 3 ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE, 1, NULL,
                                     (hsize_t[]){64, 1}, false);
        bt_h5_describe(&r->h5, names[k], "time", units[k], texts[k]);
    }
    bt_h5_write_names(&r->h5, "/events/kind_names", BT_EVENT_KINDS, bt_event_names);
    bt_h5_describe(&r->h5, "/events/kind_names", "event_kind", NULL, "what a number in kind stands for");
}

bt_status bt_record_events(bt_record *r, const bt_events *e, bt_errors *err)
{
    if (r->h5.status != BT_OK || r->comm->rank != 0) return r->h5.status;
    r->h5.err = err;
    for (; r->n_events < e->n; r->n_events++) {
        const bt_event *v = &e->event[r->n_events];
        const void *const column[4] = {&v->time, &v->kind, &v->subject, &v->value};
        for (int k = 0; k < 4; k++)
            bt_h5_append(&r->h5, r->events[k], k % 3 ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE, (hsize_t)r->n_events, 1,
                         column[k]);
    }
    return r->h5.status;
}

static void record_free(bt_record *r)
{
    bt_summary_free(&r->summary);
    bt_impact_count_free(&r->count);
    bt_history_free(&r->history);
    free(r->dir);
    free(r->series);
    free(r->merged);
    free(r->buffer);
    free(r);
}

/// Close datasets and file; returns the status of everything that went to the file.
static bt_status close_file(bt_record *r)
{
    for (int k = 0; k < r->n_series; k++)
        if (r->series[k] >= 0) H5Dclose(r->series[k]);
    for (int k = 0; k < 4; k++)
        if (r->events[k] >= 0) H5Dclose(r->events[k]);
    bt_frames_close(&r->frames);
    bt_impact_store_close(&r->impacts);
    bt_piece_store_close(&r->pieces);
    return bt_h5_close(&r->h5);
}

bt_status bt_record_write_text(const bt_record *r, const char *name, const char *text, bt_errors *err)
{
    char *path = bt_file_join(r->dir, name);
    const bt_status status = bt_file_write(path, text, err);
    free(path);
    return status;
}

bt_status bt_record_remove(const bt_record *r, const char *name, bt_errors *err)
{
    char *path = bt_file_join(r->dir, name);
    const bt_status status = bt_file_remove(path, err);
    free(path);
    return status;
}

/// A run that goes on takes only away what was under way.
static bt_status prepare_dir(const bt_record *r, const char *resolved, const char *digests, bool fresh, bt_errors *err)
{
    bt_status status = bt_file_make_dir(r->dir, err);
    if (status == BT_OK && fresh) {
        char *text = bt_case_with_digests(resolved, digests);
        status = bt_folder_replace(r->dir, text, err);
        free(text);
    } else if (status == BT_OK) {
        status = bt_record_remove(r, BT_RESULT_FILE ".tmp", err);
        if (status == BT_OK) status = bt_record_remove(r, BT_CHECKPOINT_FILE ".tmp", err);
    }
    return status;
}

static bt_status open_record(bt_record **out, const bt_comm *comm, const char *dir, const bt_case *c,
                             const bt_record_bodies *b, const char *command_line, const char *digests, bool fresh,
                             bt_errors *err)
{
    *out = NULL;
    bt_record *r = bt_alloc(1, sizeof *r);
    r->dir = bt_text_copy(dir);
    r->c = c;
    r->comm = comm;
    r->fresh = fresh;
    r->n_floes = b->n_floes;
    r->towed = b->towed;
    r->last_flush = bt_clock();
    bt_history_init(&r->history);
    r->n_series = bt_n_series();
    r->merged = bt_alloc((size_t)r->n_series, sizeof *r->merged);
    r->buffer = bt_alloc((size_t)r->n_series * BT_RECORD_BUFFER, sizeof *r->buffer);
    r->series = bt_alloc((size_t)r->n_series, sizeof *r->series);
    for (int k = 0; k < r->n_series; k++) r->series[k] = -1;
    for (int k = 0; k < 4; k++) r->events[k] = -1;

    char *resolved = bt_case_resolved(c), *path = bt_file_join(dir, BT_RESULT_PART);
    bt_status status = comm->rank == 0 ? bt_summary_check_added(err) : BT_OK;
    if (status == BT_OK && comm->rank == 0) status = prepare_dir(r, resolved, digests, fresh, err);
    const bool prepared = status == BT_OK && comm->rank == 0;
    status = bt_comm_agree(comm, status);
    if (status == BT_OK) status = bt_h5_create_shared(&r->h5, comm, path, err);
    if (status == BT_OK) {
        bt_h5_attr_int(&r->h5, "/", "complete", 0);
        bt_provenance_write(&r->h5, command_line);
        bt_h5_write_text(&r->h5, "/case", resolved);
        bt_h5_write_text(&r->h5, "/case_as_given", c->text ? c->text : "");
        bt_h5_describe(&r->h5, "/case", NULL, NULL, "the case with every key, in SI units");
        bt_h5_describe(&r->h5, "/case_as_given", NULL, NULL,
                       "the case file as it was given, and in a second document what a study or --set changed");
        bt_h5_describe_file(&r->h5, c->run.title);
        create_series(r);
        create_events(r);
        const bt_map_axes axes = bt_map_axes_of(c, b->outlines);
        bt_frames_create(&r->frames, &r->h5, comm, b, &axes);
        status = bt_comm_agree(comm, r->h5.status); // what the others wrote is in the file: now it may be announced
        if (status == BT_OK) {
            bt_h5_flush(&r->h5);
            status = bt_comm_agree(comm, r->h5.status);
        }
        if (status != BT_OK) {
            bt_h5_give_up(&r->h5, status);
            close_file(r);
        }
    }
    if (status != BT_OK && prepared && fresh) bt_folder_put_back(dir);
    else if (status != BT_OK && prepared) unlink(path);
    free(resolved);
    free(path);
    if (status != BT_OK) {
        record_free(r);
        return status;
    }
    *out = r;
    return BT_OK;
}

bt_status bt_record_open(bt_record **r, const bt_comm *comm, const char *dir, const bt_case *c,
                         const bt_record_bodies *b, const char *command_line, const char *digests, bt_errors *err)
{
    return open_record(r, comm, dir, c, b, command_line, digests, true, err);
}

bt_status bt_record_reopen(bt_record **r, const bt_comm *comm, const char *dir, const bt_case *c,
                           const bt_record_bodies *b, const char *command_line, bt_errors *err)
{
    return open_record(r, comm, dir, c, b, command_line, NULL, false, err);
}

bt_status bt_record_watch_splitting(bt_record *r, const struct bt_splitting *s, const struct bt_roster *roster,
                                    bt_errors *err)
{
    if (r->comm->rank != 0) return BT_OK;
    r->h5.err = err;
    bt_piece_store_create(&r->pieces, &r->h5, s, roster, r->c->run.dt, &r->frames.axes);
    return r->h5.status;
}

bt_status bt_record_watch_impacts(bt_record *r, const struct bt_impacts *m, bt_errors *err)
{
    if (r->comm->rank != 0) return BT_OK;
    r->h5.err = err;
    bt_impact_store_create(&r->impacts, &r->h5, m, r->c);
    return r->h5.status;
}

void bt_record_flush(bt_record *r)
{
    for (int k = 0; k < r->n_series; k++)
        bt_h5_append(&r->h5, r->series[k], H5T_NATIVE_DOUBLE, (hsize_t)r->written, (hsize_t)r->buffered,
                     r->buffer + (size_t)k * BT_RECORD_BUFFER);
    r->written += r->buffered;
    r->buffered = 0;
    bt_impact_store_write(&r->impacts);
    bt_piece_store_write(&r->pieces);
    bt_h5_flush(&r->h5);
    r->frames_waiting = 0;
    r->last_flush = bt_clock();
}

/// Move the merged steps to the buffer as one entry.
static void end_entry(bt_record *r)
{
    for (int k = 0; k < r->n_series; k++)
        r->buffer[(size_t)k * BT_RECORD_BUFFER + (size_t)r->buffered] =
            bt_record_merged(bt_series(k)->keep, r->merged[k], r->n_merged);
    r->buffered++;
    r->n_merged = 0;
    bt_impact_store_end_sample(&r->impacts);
}

bt_status bt_record_sample(bt_record *r, const bt_sample *s, bt_errors *err)
{
    if (r->h5.status != BT_OK || r->comm->rank != 0) return r->h5.status;
    r->h5.err = err;
    bt_history_add(&r->history, s);
    bt_impact_store_take(&r->impacts, s->time, s->no_load != 0);
    for (int k = 0; k < r->n_series; k++) {
        const bt_quantity *q = bt_series(k);
        double *m = &r->merged[k];
        const double x = bt_sample_value(s, q);
        *m = r->n_merged ? bt_record_merge(q->keep, *m, x) : x;
    }
    if (++r->n_merged >= r->c->output.sample_every) end_entry(r);
    if (r->buffered == BT_RECORD_BUFFER || (r->buffered > 0 && bt_clock() - r->last_flush > FLUSH_SECONDS))
        bt_record_flush(r);
    return r->h5.status;
}

void bt_record_overlap(bt_record *r, double overlap)
{
    if (r->comm->rank == 0) r->history.max_overlap = bt_max_seen(r->history.max_overlap, overlap);
}

bt_status bt_record_frame(bt_record *r, double time, const bt_frame_row *rows, const bt_frame_line *line,
                          const bt_piece_row *pieces, int64_t n_pieces, bt_errors *err)
{
    r->h5.err = err;
    const bt_status status = bt_record_add_frame(r, time, rows, line, pieces, n_pieces);
    if (status != BT_OK) return status;
    if (r->comm->rank == 0 &&
        (++r->frames_waiting == FRAMES_WAITING || bt_clock() - r->last_flush > FRAME_SECONDS))
        bt_record_flush(r);
    return bt_comm_agree(r->comm, r->h5.status);
}

bt_status bt_record_add_frame(bt_record *r, double time, const bt_frame_row *rows, const bt_frame_line *line,
                              const bt_piece_row *pieces, int64_t n_pieces)
{
    bt_h5_group(&r->h5, bt_frames_group(&r->frames, (char[64]){0}));
    // a reader counts frames by their times, which come last
    if (r->comm->rank == 0) bt_piece_store_frame(&r->pieces, pieces, n_pieces);
    return bt_frames_add(&r->frames, time, rows, line);
}

static void write_totals(bt_record *r, const bt_run_totals *t)
{
    bt_h5_attr_int(&r->h5, "/", "ranks", t->ranks);
    bt_h5_attr_int(&r->h5, "/", "threads", t->threads);
    bt_h5_attr_int(&r->h5, "/", "n_steps", t->n_steps);
    bt_h5_attr_double(&r->h5, "/", "wall_time", t->wall_time);
    bt_h5_attr_text(&r->h5, "/", "stopped", t->stopped ? t->stopped : "");
    bt_h5_flush(&r->h5);
    bt_h5_attr_int(&r->h5, "/", "complete", 1);
}

char *bt_record_xdmf(const bt_record *r)
{
    const bt_frames *f = &r->frames;
    return bt_xdmf_text(&(bt_xdmf){.n_floes = f->n_floes, .n_bodies = f->n_others, .floe_vertices = f->floe_vertices,
                                   .body_vertices = f->other_vertices, .towed = f->towed, .branches = f->branches,
                                   .axes = f->axes, .time = f->times, .line = f->lines, .n_frames = f->n,
                                   .pieces = r->pieces.h ? r->pieces.frame : NULL});
}

/// What is still on its way goes to the file, and the numbers of the whole run are made: on rank 0.
static void conclude(bt_record *r, const bt_run_totals *t)
{
    if (r->n_merged > 0) end_entry(r);
    bt_impact_store_take_closed(&r->impacts);
    bt_record_flush(r);
    bt_summary_make(&r->summary, &r->history, r->c, t, r->n_floes, r->towed >= 0);
    if (!r->impacts.h) return;
    bt_impact_count_init(&r->count, r->impacts.from, &r->history, &r->summary.window);
    bt_impact_store_count(&r->impacts, &r->count);
    bt_impact_store_totals(&r->impacts, &r->count, &r->summary.window);
    r->summary.impacts = &r->count;
}

static bt_status write_summary(const bt_record *r, const bt_run_totals *t, bt_errors *err)
{
    bt_run_totals all = *t; // with the time up to here
    all.call.end = t->stepped > 0 ? bt_clock() - t->stepped : 0;
    char *text = bt_summary_json(&r->summary, &r->history, r->c, &all, r->n_floes);
    const bt_status status = bt_record_write_text(r, "summary.json", text, err);
    free(text);
    return status;
}

/// The file that was written, now closed, under its final name.
static bt_status hand_in(const bt_record *r, bt_errors *err)
{
    char *part = bt_file_join(r->dir, BT_RESULT_PART), *path = bt_file_join(r->dir, BT_RESULT_FILE);
    bt_status status = bt_checksum_write(part, BT_CHECKSUM_RESULT, err);
    if (status == BT_OK) status = bt_file_rename(part, path, err);
    free(part);
    free(path);
    return status;
}

bt_status bt_record_close(bt_record *r, const bt_run_totals *t, bt_snapshot *last, bool table, bt_errors *err)
{
    const bool first = r->comm->rank == 0;
    char *xdmf = first ? bt_record_xdmf(r) : NULL;
    r->h5.err = err;
    if (first && t) {
        conclude(r, t);
        write_totals(r, t);
    } else if (first) {
        if (r->n_merged > 0) end_entry(r);
        bt_record_flush(r);
    }
    bt_h5_sync_raw(&r->h5);
    bt_status status = bt_comm_agree(r->comm, close_file(r));
    // The result before the checkpoint, which counts on it; the summary last: where there is one, the rest is complete.
    if (first && status == BT_OK) status = hand_in(r, err);
    if (first && status == BT_OK) status = bt_record_write_text(r, "frames.xdmf", xdmf, err);
    if (first && status == BT_OK && last) status = bt_checkpoint_write(last, r->dir, BT_CHECKPOINT_FILE, err);
    if (first && status == BT_OK && t) status = write_summary(r, t, err);
    if (first && status == BT_OK && t) bt_folder_settle(r->dir);
    status = bt_comm_agree(r->comm, status);
    if (first && status == BT_OK && t && table) bt_summary_print(&r->summary, &r->history, r->c, t, r->n_floes);
    free(xdmf);
    record_free(r);
    return status;
}

void bt_record_abandon(bt_record *r)
{
    bt_h5_give_up(&r->h5, BT_ERR_IO);
    close_file(r);
    char *part = bt_file_join(r->dir, BT_RESULT_PART);
    if (r->comm->rank == 0) unlink(part);
    if (r->comm->rank == 0 && r->fresh) bt_folder_put_back(r->dir);
    free(part);
    record_free(r);
}
