// SPDX-License-Identifier: MIT
// A record that is complete at every moment, and resumes after a stop without gap, overlap or difference.
//
// At a checkpoint the unfinished file is flushed and copied, and the copy is named result.h5. A resumed run writes a
// new file and fills it from result.h5 up to the counts of its checkpoint, frame by frame and through the functions
// that write any frame: so it may have another number of ranks, whose files have a different layout, and nothing later
// than the checkpoint remains. The unfinished file of a killed run is not read: a kill within a write can leave it
// unreadable.
//
// The copy costs a write of the whole file per checkpoint (nothing if the file system copies by reference).
// Rejected: truncating the unfinished file to the checkpoint's counts, for which it would have to be readable; a
// separate file for each piece between two checkpoints, which every reader would have to join.
#include <string.h>

#include "base/checksum.h"
#include "base/fileio.h"
#include "base/h5dataset.h"
#include "base/inside.h"
#include "case/case_files.h"
#include "output/record_parts.h"

// --- identity of a run -----------------------------------------------------------------------------------------------

// Do the result in a folder and a checkpoint belong to the same run? A checkpoint that was kept while another run took
// the folder, or that comes from another folder, would continue the result of a different run.
//
// A run has an identity, the digest of its start (run_parts.h), in its result and in its checkpoints. A program may
// have made runs with the same start diverge, so the series are also compared with the history of every step in the
// checkpoint.

#define CASE_FILE "case.resolved.yml"
#define IDENTITY "run" // attribute of the root
#define LAW_SERIES "record/law_series"

bt_status bt_record_identify(bt_record *record, const char *identity, bt_errors *err)
{
    if (record->comm->rank != 0) return BT_OK;
    record->h5.err = err;
    snprintf(record->identity, sizeof record->identity, "%s", identity);
    bt_h5_attr_word(&record->h5, "/", IDENTITY, record->identity);
    return record->h5.status;
}

/// Does a case text give every key the same value? Tables that it names are taken from the case: no file is read.
static bool same_values(const bt_case *input, const char *text)
{
    bt_case other;
    const bool read = bt_case_read_kept(&other, input->path ? input->path : CASE_FILE, text, &input->water.table,
                                        &input->air.table, NULL) == BT_OK;
    char *mine = bt_case_resolved(input), *its = read ? bt_case_resolved(&other) : NULL;
    const bool same = !strcmp(text, mine) || (its && !strcmp(its, mine));
    free(mine);
    free(its);
    bt_case_free(&other);
    return same;
}

static void refuse(bt_h5_reader *old, const bt_snapshot *snap, const char *why)
{
    if (old->status != BT_OK) return;
    old->status = bt_fail(old->err, BT_ERR_CASE,
        "%s: does not belong to the run of %s: %s; restore the result of that run, or continue from a checkpoint of "
        "this one",
        old->path, snap->path, why);
}

/// On rank 0. Reject, in `old`, a result of another run than that of the checkpoint `snap`: by the identity of both,
/// and by the first entries of the series.
static void record_check_run(bt_snapshot *snap, bt_h5_reader *old)
{
    char *its = bt_h5_read_word(old, IDENTITY);
    if (strcmp(its ? its : "", bt_snapshot_text(snap, BT_RECORD_IDENTITY)) != 0)
        refuse(old, snap, "it began with another case or other ice");
    free(its);
}

/// Value of an entry from its steps, as bt_record_sample forms it.
static double entry_of(bt_keep keep, const double *step, int64_t every)
{
    double m = step[0];
    for (int64_t j = 1; j < every; j++) m = bt_record_merge(keep, m, step[j]);
    return bt_record_merged(keep, m, every);
}

static void record_check_series(const bt_record *record, int k, const double *x, int64_t n, const bt_snapshot *snap,
                                bt_h5_reader *old)
{
    static const struct {
        const char *name;
        bt_column column;
    } kept[] = {{"time", BT_COL_TIME}, {"ice_resistance", BT_COL_ICE}, {"tow_force", BT_COL_TOW},
                {"residual", BT_COL_RESIDUAL}}; // also shows ice that has not met the body
    const bt_quantity *quantity = bt_series(k);
    const int64_t every = record->c->output.sample_every > 1 ? record->c->output.sample_every : 1;
    for (size_t j = 0; j < sizeof kept / sizeof *kept; j++) {
        if (strcmp(kept[j].name, quantity->name) != 0) continue;
        for (int64_t i = 0; i < n && old->status == BT_OK; i++) {
            const double entry = entry_of(quantity->keep, record->history.column[kept[j].column] + i * every, every);
            if (entry == x[i] || (isnan(entry) && isnan(x[i]))) continue;
            const bool lost = entry_of(BT_KEEP_MAX, record->history.column[BT_COL_NO_LOAD] + i * every, every) > 0;
            if (lost && isnan(x[i])) continue;
            char *why = bt_text_of("/series/%s is %.17g in entry %lld, where the run had %.17g", quantity->name, x[i],
                                   (long long)i, entry);
            refuse(old, snap, why);
            free(why);
        }
    }
}

/// On rank 0, for a resumed run. Rewrite case.resolved.yml, with a warning, if it is no longer that with which the run
/// began. Errors: BT_ERR_IO.
static bt_status record_keep_case(const bt_record *record, bt_errors *err)
{
    const char *path = BT_PATH(record->dir, CASE_FILE);
    char *text = NULL, *resolved = bt_case_resolved(record->c);
    size_t size = 0;
    const bool read = bt_file_read(path, "a case", &text, &size, NULL) == BT_OK;
    char *digests = read ? bt_case_digests_in(record->c, text) : NULL,
         *wanted = bt_case_with_comments(resolved, digests, record->c->text);
    bt_status status = BT_OK;
    if (!read || strcmp(text, wanted) != 0) {
        status = bt_file_write(path, wanted, err);
        if (status == BT_OK && (!read || !same_values(record->c, text))) // otherwise only its comments have been edited
            bt_errors_warn("warning: %s: was not the case that the run began with; it is rewritten from the "
                           "checkpoint", path);
    }
    BT_FREE(text, resolved, digests, wanted);
    return status;
}

// --- recorded data ---------------------------------------------------------------------------------------------------

/// Is an added series that the run did not have 0 before? The force of an added law is: a law that has acted must be
/// there again (src/output/state.c).
static bool was_zero(const bt_quantity *quantity) { return quantity->of_world == bt_force_of; }
static bool may_lack(int k) { return k >= bt_n_program_series() && was_zero(bt_series(k)); }

/// Names of the added series that are forces of laws, each between blanks.
static char *law_series(void)
{
    bt_text text;
    bt_text_begin(&text);
    for (int k = 0; k < bt_n_added(); k++)
        if (was_zero(bt_added(k))) fprintf(text.out, " %s ", bt_added(k)->name);
    return bt_text_end(&text);
}

/// By name: a resumed program may have its series in another order.
#define MERGED(k) BT_PATH("merged", bt_series(k)->name)

bt_status bt_record_save(bt_record *record, int64_t n_frames, bt_snapshot *snap, bt_errors *err)
{
    if (record->comm->rank != 0) return BT_OK;
    record->h5.err = err;
    bt_record_flush(record);
    bt_history *history = &record->history;
    char name[BT_HISTORY_NAME];
    for (int k = 0; k < bt_n_history_totals(); k++)
        bt_snapshot_add_rows(snap, "history", &bt_history_total(k)->at, 1, history);
    for (int k = 0; k < history->n_columns; k++) {
        const bt_state_row column = bt_history_column(k, name);
        bt_snapshot_add_row(snap, "history", &column, history->n, history->column[k]);
    }
    bt_snapshot_add_text(snap, BT_RECORD_IDENTITY, record->identity);
    bt_snapshot_add_int(snap, "record/entries", record->written);
    bt_snapshot_add_int(snap, "record/frames", n_frames);
    bt_snapshot_add_int(snap, "record/merged_steps", record->n_merged);
    // Between two entries the sum is finished: its last value would only make equal states look different.
    for (int k = 0; k < record->n_series && record->n_merged > 0; k++)
        bt_snapshot_add(snap, MERGED(k), BT_ITEM_F64, 1, 1, &record->merged[k]);
    char *of_laws = law_series();
    if (*of_laws) bt_snapshot_add_text(snap, LAW_SERIES, of_laws);
    free(of_laws);
    bt_impact_store_save(&record->impacts, snap);
    return record->h5.status;
}

bt_status bt_record_publish(bt_record *record, bt_errors *err)
{
    record->h5.err = err;
    bt_h5_sync_raw(&record->h5);
    bt_status status = bt_comm_agree(record->comm, record->h5.status);
    if (status != BT_OK) return status;
    if (record->comm->rank == 0) {
        const char *copy = BT_PATH(record->dir, BT_RESULT_FILE ".tmp");
        bt_record_flush(record);
        status = record->h5.status;
        if (status == BT_OK) status = bt_file_copy(BT_PATH(record->dir, BT_RESULT_PART), copy, err);
        if (status == BT_OK)
            status = bt_checksum_publish(copy, BT_PATH(record->dir, BT_RESULT_FILE), BT_CHECKSUM_RESULT, err);
        char *xdmf = bt_record_xdmf(record);
        if (status == BT_OK) status = bt_file_write(BT_PATH(record->dir, "frames.xdmf"), xdmf, err);
        free(xdmf);
    }
    return bt_comm_agree(record->comm, status);
}

// --- resuming --------------------------------------------------------------------------------------------------------

/// Was the added series `name` the force of a law? A law that has not acted may be left out; one that has is refused by
/// its own name (src/output/state.c).
static bool was_of_law(bt_snapshot *snap, const char *name)
{
    char between[BT_HISTORY_NAME];
    snprintf(between, sizeof between, " %s ", name);
    return bt_snapshot_find(snap, LAW_SERIES) && strstr(bt_snapshot_text(snap, LAW_SERIES), between);
}

/// Forces and quantities that programs have added must be the same as before: a run without one of its forces would be
/// another run.
static void check_added(bt_snapshot *snap)
{
    const char *missing = NULL, *left_over = NULL;
    char name[BT_HISTORY_NAME];
    for (int k = 0; k < bt_n_added() && !missing; k++) {
        bt_history_column(BT_N_COLUMNS + k, name);
        if (!bt_snapshot_find(snap, name) && !was_zero(bt_added(k))) missing = bt_added(k)->name;
    }
    for (int i = 0; i < snap->n && !left_over; i++) {
        if (strncmp(snap->item[i].name, BT_HISTORY_ADDED, strlen(BT_HISTORY_ADDED))) continue;
        left_over = snap->item[i].name + strlen(BT_HISTORY_ADDED);
        if (was_of_law(snap, left_over)) left_over = NULL;
        for (int k = 0; k < bt_n_added() && left_over; k++)
            if (!strcmp(bt_added(k)->name, left_over)) left_over = NULL;
    }
    if (missing && !snap->faulty)
        bt_errors_add(snap->err,
                      "%s: the run had no %s, which this program has added; continue in a program that adds no other "
                      "quantities",
                      snap->path, missing);
    else if (left_over && !snap->faulty)
        bt_errors_add(
            snap->err,
            "%s: the run had %s, which a program had added (a force or a quantity); continue in a program that adds it",
            snap->path, left_over);
    snap->faulty |= missing || left_over;
}

/// Load the history. n: steps done; each has a value.
static void load_history(bt_history *history, bt_snapshot *snap, int64_t n)
{
    for (int k = 0; k < bt_n_history_totals(); k++)
        bt_snapshot_take_rows(snap, "history", &bt_history_total(k)->at, 1, history);
    history->n = history->cap = n;
    char name[BT_HISTORY_NAME];
    for (int k = 0; k < history->n_columns; k++) {
        free(history->column[k]);
        bt_history_column(k, name);
        const bool there = k < BT_N_COLUMNS || bt_snapshot_find(snap, name);
        history->column[k] = there ? bt_snapshot_copy(snap, name, BT_ITEM_F64, 1, &n)
                                   : bt_alloc((size_t)n, sizeof *history->column[k]);
        bt_snapshot_want(snap, n == history->n, name, -1, "does not have a value for each step");
    }
    if (snap->faulty) history->n = 0;
}

/// Load the present entry.
static void load_merged(bt_record *record, bt_snapshot *snap)
{
    for (int k = 0; k < record->n_series; k++) {
        if (may_lack(k) && !bt_snapshot_find(snap, MERGED(k))) record->merged[k] = 0;
        else bt_snapshot_take(snap, MERGED(k), BT_ITEM_F64, 1, 1, &record->merged[k]);
    }
}

/// Copy the first n entries of all series.
static void load_series(bt_record *record, const bt_snapshot *snap, bt_h5_reader *old, int64_t n)
{
    double *x = bt_alloc((size_t)n, sizeof *x);
    for (int k = 0; k < record->n_series && old->status == BT_OK; k++) {
        const char *name = BT_PATH("/series", bt_series(k)->name);
        if (may_lack(k) && !bt_h5_there(old, name))
            for (int64_t i = 0; i < n; i++) x[i] = 0;
        else bt_h5_read(old, name, H5T_NATIVE_DOUBLE, 0, n, 1, x);
        if (old->status == BT_OK) record_check_series(record, k, x, n, snap, old);
        if (old->status == BT_OK) bt_h5_append(&record->h5, record->series[k], H5T_NATIVE_DOUBLE, 0, (hsize_t)n, x);
    }
    free(x);
    record->written = n;
}

/// Collective. Copy the first n frames, through the function that adds any frame.
static bt_status load_frames(bt_record *record, bt_h5_reader *old, int64_t n, bt_errors *err)
{
    const bool first = record->comm->rank == 0;
    const bt_idx n_floes = (bt_idx)record->frames.n_floes,
                 n_bodies = (bt_idx)(record->frames.n_floes + record->frames.n_others);
    int64_t *blocks = bt_alloc((size_t)record->comm->size + 1, sizeof *blocks);
    bt_record_blocks(record->comm, n_floes, n_bodies, blocks);
    const bt_idx mine = first ? n_bodies : 0;
    bt_frame_row *rows = bt_alloc((size_t)mine, sizeof *rows),
                 *block = bt_alloc((size_t)(blocks[record->comm->rank + 1] - blocks[record->comm->rank]),
                                   sizeof *block);
    bt_gid *gid = bt_alloc((size_t)mine, sizeof *gid);
    for (bt_idx i = 0; i < mine; i++) gid[i] = i;
    bt_status status = BT_OK;
    for (int64_t k = 0; k < n && status == BT_OK; k++) {
        double time = 0;
        bt_frame_line line = {0};
        if (first) bt_frames_read(&record->frames, old, k, &time, rows, &line);
        int64_t n_pieces = 0;
        bt_piece_row *pieces = first && record->pieces.h ? bt_piece_store_read(old, k, &n_pieces) : NULL;
        status = bt_comm_agree(record->comm, first ? old->status : BT_OK);
        if (status != BT_OK) {
            free(pieces);
            break;
        }
        bt_comm_bcast(record->comm, &time, sizeof time);
        bt_comm_bcast(record->comm, &line, sizeof line);
        status = bt_comm_rows_by_gid(record->comm, blocks, mine, gid, BT_FRAME_ROW, (const double *)(const void *)rows,
                                     (double *)(void *)block, err);
        if (status == BT_OK) status = bt_record_add_frame(record, time, block, &line, pieces, n_pieces);
        free(pieces);
    }
    BT_FREE(blocks, rows, block, gid);
    return status;
}

/// Does the old result hold the data to which the checkpoint refers?
static void check_counts(bt_h5_reader *old, int64_t entries, int64_t frames, int64_t floes)
{
    if (old->status != BT_OK) return;
    const int64_t there = bt_h5_size(old, "/series/time", 0), pictures = bt_h5_size(old, "/frames/time", 0),
                  width = bt_h5_size(old, "/frames/pose", 1);
    if (old->status != BT_OK || (there >= entries && pictures >= frames && width == floes)) return;
    old->status = bt_fail(old->err, BT_ERR_CASE,
        "%s: holds %lld entries and %lld frames of %lld floes, but the checkpoint expects %lld, %lld and %lld: it "
        "belongs to another run, or is older; restore it",
        old->path, (long long)there, (long long)pictures, (long long)width, (long long)entries,
        (long long)frames, (long long)floes);
}

bt_status bt_record_load(bt_record *record, bt_snapshot *snap, const bt_events *events, bt_errors *err)
{
    const bool first = record->comm->rank == 0;
    record->h5.err = err;
    const int64_t entries = bt_snapshot_int(snap, "record/entries"), frames = bt_snapshot_int(snap, "record/frames"),
                  step = bt_snapshot_int(snap, "world/step");
    const int64_t every = record->c->output.sample_every > 1 ? record->c->output.sample_every : 1;
    record->n_merged = bt_snapshot_int(snap, "record/merged_steps");
    bt_snapshot_want(snap, entries == step / every && record->n_merged == step % every, "record/entries", -1,
                     "does not fit the number of steps");
    if (first) check_added(snap); // before anything reads their values
    if (record->n_merged > 0 && !snap->faulty) load_merged(record, snap);
    const char *path = BT_PATH(record->dir, BT_RESULT_FILE);
    bt_h5_reader old = {.file = -1, .path = path, .err = err};
    if (first) {
        load_history(&record->history, snap, step);
        if (!snap->faulty) bt_h5_open(&old, path, BT_CHECKSUM_RESULT, err);
        if (!snap->faulty && old.status == BT_OK) record_check_run(snap, &old);
        if (!snap->faulty) check_counts(&old, entries, frames, record->frames.n_floes);
        if (!snap->faulty && old.status == BT_OK) load_series(record, snap, &old, entries);
        if (!snap->faulty && old.status == BT_OK) bt_impact_store_load(&record->impacts, snap, &old);
        if (!snap->faulty && old.status == BT_OK) bt_provenance_keep(&record->h5, &old);
        bt_record_events(record, events, err);
    }
    bt_status status = bt_comm_agree(record->comm, snap->faulty                      ? BT_ERR_CASE
                                                   : first && old.status != BT_OK ? old.status
                                                                                  : record->h5.status);
    if (status == BT_OK) status = load_frames(record, &old, frames, err);
    bt_h5_end(&old);
    if (status == BT_OK && first) bt_record_flush(record);
    if (status == BT_OK) status = record->h5.status;
    if (status == BT_OK && first) status = record_keep_case(record, err);
    // the summary is of an end that is no longer valid
    if (status == BT_OK && first) status = bt_file_remove(BT_PATH(record->dir, "summary.json"), err);
    return bt_comm_agree(record->comm, status);
}
