// SPDX-License-Identifier: MIT
// Is the result in a folder of the run that a checkpoint is of? A checkpoint that was kept while another run took the
// folder, or comes from another folder, would go on in a result whose beginning is not its own.
//
// A run has an identity, the digest of what it began with (run_parts.h), in its result and in its checkpoints. Runs
// that began alike may have been led apart by a program; and so the series, too, are compared with the history that
// the checkpoint keeps of every step.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fileio.h"
#include "case/case_files.h"
#include "output/record_parts.h"

#define CASE_FILE "case.resolved.yml"
#define IDENTITY "run" // attribute of the root

bt_status bt_record_identify(bt_record *r, const char *identity, bt_errors *err)
{
    if (r->comm->rank != 0) return BT_OK;
    r->h5.err = err;
    snprintf(r->identity, sizeof r->identity, "%s", identity);
    bt_h5_attr_word(&r->h5, "/", IDENTITY, r->identity);
    return r->h5.status;
}

/// Does a text say the same of every key? Tables that it names are those that the case has: no file is read.
static bool same_values(const bt_case *c, const char *text)
{
    bt_case other;
    bt_errors unheard = {0};
    const bool read = bt_case_read_kept(&other, c->path ? c->path : CASE_FILE, text, &c->water.table, &c->air.table,
                                        &unheard) == BT_OK;
    char *mine = bt_case_resolved(c), *its = read ? bt_case_resolved(&other) : NULL;
    const bool same = !strcmp(text, mine) || (its && !strcmp(its, mine));
    free(mine);
    free(its);
    bt_case_free(&other);
    bt_errors_free(&unheard);
    return same;
}

static void refuse(bt_h5_reader *old, const bt_snapshot *s, const char *why)
{
    if (old->status != BT_OK) return;
    bt_errors_add(old->err,
                  "%s: is of another run than %s: %s; restore the result of that run, or go on from a checkpoint of "
                  "this one",
                  old->path, s->path, why);
    old->status = BT_ERR_CASE;
}

void bt_record_check_run(bt_snapshot *s, bt_h5_reader *old)
{
    char *its = bt_h5_read_word(old, IDENTITY);
    if (strcmp(its ? its : "", bt_snapshot_text(s, BT_RECORD_IDENTITY)) != 0)
        refuse(old, s, "it began with another case or other ice");
    free(its);
}

/// Of step j = 0, 1, ... of an entry, and of all of them: as bt_record_sample makes it.
static double entry_of(bt_keep keep, const double *step, int64_t every)
{
    double m = step[0];
    for (int64_t j = 1; j < every; j++) m = bt_record_merge(keep, m, step[j]);
    return bt_record_merged(keep, m, every);
}

void bt_record_check_series(const bt_record *r, int k, const double *x, int64_t n, const bt_snapshot *s,
                            bt_h5_reader *old)
{
    static const struct {
        const char *name;
        bt_column column;
    } kept[] = {{"time", BT_COL_TIME}, {"ice_resistance", BT_COL_ICE}, {"tow_force", BT_COL_TOW},
                {"residual", BT_COL_RESIDUAL}}; // also of ice that has not met the body
    const bt_quantity *q = bt_series(k);
    const int64_t every = r->c->output.sample_every > 1 ? r->c->output.sample_every : 1;
    for (size_t j = 0; j < sizeof kept / sizeof *kept; j++) {
        if (strcmp(kept[j].name, q->name) != 0) continue;
        for (int64_t i = 0; i < n && old->status == BT_OK; i++) {
            const double entry = entry_of(q->keep, r->history.column[kept[j].column] + i * every, every);
            if (entry == x[i] || (isnan(entry) && isnan(x[i]))) continue;
            const bool lost = entry_of(BT_KEEP_MAX, r->history.column[BT_COL_NO_LOAD] + i * every, every) > 0;
            if (lost && isnan(x[i])) continue;
            char *why = bt_text_of("/series/%s is %.17g in entry %lld, where the run had %.17g", q->name, x[i],
                                   (long long)i, entry);
            refuse(old, s, why);
            free(why);
        }
    }
}

bt_status bt_record_keep_case(const bt_record *r, bt_errors *err)
{
    char *path = bt_file_join(r->dir, CASE_FILE), *text = NULL, *resolved = bt_case_resolved(r->c);
    size_t size = 0;
    bt_errors unheard = {0}, warnings = {0};
    const bool read = bt_file_read(path, "a case", &text, &size, &unheard) == BT_OK;
    char *digests = read ? bt_case_digests_in(r->c, text) : NULL, *wanted = bt_case_with_digests(resolved, digests);
    bt_status status = BT_OK;
    if (!read || strcmp(text, wanted) != 0) {
        if (!read || !same_values(r->c, text)) // otherwise its comments have been edited
            bt_errors_add(&warnings,
                          "warning: %s: was not the case that the run began with; it is written anew, by the "
                          "checkpoint",
                          path);
        status = bt_record_write_text(r, CASE_FILE, wanted, err);
    }
    if (status == BT_OK) bt_errors_print(&warnings);
    bt_errors_free(&warnings);
    bt_errors_free(&unheard);
    free(text);
    free(resolved);
    free(digests);
    free(wanted);
    free(path);
    return status;
}
