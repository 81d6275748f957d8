// SPDX-License-Identifier: MIT
// The members of a study in the order in which they are taken, and whether those that are there are sound.
#include "run/ensemble_list.h"

#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/fileio.h"
#include "case/case_derived.h"
#include "case/cost.h"
#include "field/field_kept.h"
#include "run/ensemble_journal.h"
#include "run/ensemble_member.h"

void bt_ensemble_journal(const bt_ensemble *e, const char *event, const bt_member *m, double wall, int code)
{
    bt_journal_add(e->o->dir, event, m->name, wall, code);
}

bool bt_entry_is_suspect(const bt_entry *x) { return x->attempts >= BT_SUSPECT_ATTEMPTS; }

static int by_turn(const void *a, const void *b)
{
    const bt_entry *p = a, *q = b;
    const int doubt[2] = {(p->attempts > 0) + bt_entry_is_suspect(p), (q->attempts > 0) + bt_entry_is_suspect(q)};
    if (doubt[0] != doubt[1]) return doubt[0] - doubt[1]; // those whose process died come last
    if (p->turn != q->turn) return p->turn < q->turn ? -1 : 1;
    if (p->first != q->first) return p->first > q->first ? -1 : 1;
    return p->index < q->index ? -1 : 1;
}

void bt_entry_look(bt_entry *x)
{
    if (!x->settled) x->settled = bt_ensemble_state(x->folder, NULL, NULL) != BT_MEMBER_WAITING;
}

// --- soundness -------------------------------------------------------------------------------------------------------

enum { SOUND, DAMAGED, UNREADABLE };

/// Check a member that says it has finished. What is damaged is taken away, unless somebody is at it already.
static int check_member(bt_ensemble *e, bt_entry *x, bt_errors *warnings)
{
    bt_errors why = {0};
    bt_status status = bt_member_record_check(&e->records, x->index, x->m.name, x->folder, &why);
    if (status == BT_ERR_CASE) {
        const int fd = bt_member_open(x->folder, "lock", O_RDWR | O_CREAT);
        bt_errors again = {0};
        bool busy = false; // with a run of its own, as of `bergtow resume`
        const int run =
            fd >= 0 && bt_member_take_lock(fd, false) ? bt_lock_take(x->folder, &busy, &again) : -1;
        bt_errors_free(&again);
        if (run < 0 || bt_ensemble_state(x->folder, NULL, NULL) != BT_MEMBER_FINISHED) {
            bt_errors_free(&why); // another process has found it out, too, or is at it
        } else if (bt_member_record_check(&e->records, x->index, x->m.name, x->folder, &again) == BT_OK) {
            bt_errors_free(&why); // and made it good meanwhile
            status = BT_OK;
        } else {
            status = bt_member_record_forget(x->folder, &why) == BT_OK ? BT_ERR_CASE : BT_ERR_IO;
            bt_ensemble_journal(e, "unsound", &x->m, 0, (int)status);
        }
        bt_errors_free(&again);
        bt_lock_drop(x->folder, run);
        if (fd >= 0) close(fd);
    }
    for (size_t k = 0; k < why.n && k < 1; k++)
        bt_errors_add(warnings, "warning: member %s is not sound%s: %s%s", x->m.name,
                      status == BT_ERR_CASE ? " and is run again" : ", and stays so", why.text[k],
                      why.n > 1 ? ", ..." : "");
    bt_errors_free(&why);
    return status == BT_OK ? SOUND : status == BT_ERR_CASE ? DAMAGED : UNREADABLE;
}

static void print_warnings(bt_errors *list)
{
    const size_t more = list->n > BT_MOST_REPORTED ? list->n - BT_MOST_REPORTED : 0;
    for (size_t k = 0; k < list->n - more; k++) fprintf(stderr, "bergtow: %s\n", list->text[k]);
    if (more) fprintf(stderr, "bergtow: warning: and %zu more members that are not sound; see journal.jsonl\n", more);
}

void bt_ensemble_share_records(bt_ensemble *e)
{
    bt_comm_reduce(e->world, NULL, 0, NULL, 0, e->records.seen, (int)e->records.n);
}

/// Collective. Every finished member is read once, by one of the ranks; the list is still in the order of the study.
static void check_members(bt_ensemble *e)
{
    enum { PER_WORD = 32 }; // two bits each
    const int n = (int)(e->n / PER_WORD + 1);
    uint64_t *found = bt_alloc((size_t)n, sizeof *found);
    memset(found, 0, (size_t)n * sizeof *found);
    bt_errors warnings = {0};
    for (int64_t i = e->world->rank; i < e->n; i += e->world->size) {
        bt_entry *x = &e->list[i];
        if (bt_ensemble_state(x->folder, NULL, NULL) != BT_MEMBER_FINISHED) continue;
        found[i / PER_WORD] |= (uint64_t)check_member(e, x, &warnings) << 2 * (i % PER_WORD);
    }
    bt_comm_reduce(e->world, NULL, 0, NULL, 0, found, n);
    bt_ensemble_share_records(e);
    for (int64_t i = 0; i < e->n; i++) {
        const int how = (int)(found[i / PER_WORD] >> 2 * (i % PER_WORD) & 3);
        if (how == DAMAGED) e->list[i].settled = false;
        if (how == UNREADABLE) e->list[i].settled = true; // nothing can be done about it here
    }
    bt_comm_errors(e->world, &warnings);
    if (e->world->rank == 0) print_warnings(&warnings);
    bt_errors_free(&warnings);
    free(found);
}

typedef struct { char digest[BT_CHECKSUM_DIGEST]; int64_t member; } ice_of;

static int by_digest(const void *a, const void *b)
{
    const ice_of *p = a, *q = b;
    return strcmp(p->digest, q->digest);
}

/// Which conditions have their ice in common, by that of the first field of each; in the order of the study.
static void find_shared(bt_ensemble *e, ice_of *ice, int64_t n)
{
    qsort(ice, (size_t)n, sizeof *ice, by_digest);
    for (int64_t k = 1; k < n; k++) {
        if (by_digest(&ice[k - 1], &ice[k])) continue;
        for (int64_t r = 0; r < e->s->repeats; r++)
            e->list[ice[k - 1].member + r].shares = e->list[ice[k].member + r].shares = true;
    }
    e->fields = bt_text_of("%s/fields", e->o->dir);
}

void bt_ensemble_list(bt_ensemble *e)
{
    e->n = bt_study_n_members(e->s);
    e->list = bt_alloc((size_t)e->n, sizeof *e->list);
    const bool limited = e->o->max_wall > 0;
    double cost = 0;
    bool alike = false;
    int64_t priced = -1, n_ice = 0;
    ice_of *ice = bt_alloc((size_t)e->s->n_conditions, sizeof *ice);
    for (int64_t i = 0; i < e->n; i++) {
        bt_entry *x = &e->list[i];
        x->index = i;
        bt_study_member(e->s, i, &x->m);
        x->folder = bt_text_of("%s/members/%s", e->o->dir, x->m.name);
        // fields of one condition cost the same; a case that cannot be read fails when its turn comes
        if (x->m.condition != priced) {
            bt_case c;
            bt_errors unheard = {0};
            priced = x->m.condition;
            const bool read = bt_member_case(e->s, &x->m, &c, &unheard) == BT_OK;
            cost = read ? bt_cost_seconds(&c) : 0;
            alike = read && !bt_case_ice_is_random(&c);
            e->fixed += alike;
            if (read) {
                e->most_floes = bt_max(e->most_floes, bt_case_floes_made(&c) + (double)c.n_floes);
                bt_field_digest(&c, ice[n_ice].digest);
                ice[n_ice++].member = i;
            }
            bt_case_free(&c);
            bt_errors_free(&unheard);
        }
        x->cost = cost;
        x->shares = alike && e->s->repeats > 1;
        x->turn = limited ? x->m.repeat : 0;
        x->first = limited && e->s->sampling == BT_SAMPLING_LATIN_HYPERCUBE ? 0 : cost;
        x->attempts = bt_member_attempts(x->folder);
        bt_entry_look(x);
    }
    find_shared(e, ice, n_ice);
    free(ice);
    check_members(e);
    qsort(e->list, (size_t)e->n, sizeof *e->list, by_turn);
}

void bt_ensemble_count_settled(bt_ensemble *e)
{
    for (int64_t i = 0; i < e->n; i++) {
        if (!e->list[i].settled) continue;
        e->before++;
        e->cost_before += e->list[i].cost;
    }
}
