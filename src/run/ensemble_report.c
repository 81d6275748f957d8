// SPDX-License-Identifier: MIT
// What an ensemble prints while it works and at its end.
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "output/checkpoint.h"
#include "run/ensemble_list.h"
#include "run/ensemble_member.h"

/// The wall time that is left, s; infinite where none was given.
double bt_ensemble_wall_left(const bt_ensemble *e)
{
    return e->o->max_wall > 0 ? e->o->max_wall - (bt_clock() - e->began) : INFINITY;
}

void bt_ensemble_say(const bt_ensemble *e, const bt_entry *x, bt_status status, double wall)
{
    if (e->o->quiet) return;
    int64_t done = 0;
    double cost = 0, all = 0;
    for (int64_t i = 0; i < e->n; i++) {
        bt_entry_look(&e->list[i]);
        all += e->list[i].cost;
        if (!e->list[i].settled) continue;
        done++;
        cost += e->list[i].cost;
    }
    const double passed = bt_clock() - e->began, spent = cost - e->cost_before,
                 left = spent > 0 ? passed * (all - cost) / spent : NAN;
    char line[512];
    int n = snprintf(line, sizeof line, "[%" PRId64 "/%" PRId64 "] %s %s, %.3g s", done, e->n, x->m.name,
                     status == BT_OK ? "finished" : "FAILED", wall);
    for (int p = 0; p < e->s->n_parameters && n < 400; p++)
        n += snprintf(line + n, sizeof line - (size_t)n, ", %.40s %.40s", e->s->parameter[p].name, x->m.value[p]);
    if (isfinite(left) && done < e->n)
        snprintf(line + n, sizeof line - (size_t)n, left < 120 ? "; about %.0f s left" : "; about %.0f min left",
                 left < 120 ? left : left / 60);
    printf("%s\n", line);
    fflush(stdout);
}

typedef struct {
    int64_t finished, failed, left, at_work, unsound;
} counts;

/// One member's part in the end: counted, and reported where it is a hole.
static bt_status tell_member(bt_ensemble *e, const bt_entry *x, counts *n, bt_errors *err)
{
    int code;
    char *why;
    bt_errors damage = {0};
    bt_status status = BT_OK;
    const bt_member_state state = bt_ensemble_state(x->folder, &code, &why);
    const bt_status sound = state == BT_MEMBER_FINISHED
                                ? bt_member_record_check(&e->records, x->index, x->m.name, x->folder, &damage)
                                : BT_OK;
    if (sound != BT_OK) {
        if (n->unsound++ < BT_MOST_REPORTED)
            bt_errors_add(err, "member %s is not sound: %s; %s", x->m.name, damage.text[0],
                          sound == BT_ERR_IO ? "mend that, and call again" : "the same call runs it again");
        status = BT_ERR_IO;
    } else if (state == BT_MEMBER_FINISHED) {
        n->finished++;
        if (bt_checkpoint_there(x->folder)) bt_checkpoint_remove(x->folder); // killed between the two
    } else if (state == BT_MEMBER_FAILED) {
        if (why) why[strcspn(why, "\n")] = 0;
        if (n->failed++ < BT_MOST_REPORTED)
            bt_errors_add(err, "member %s failed (%d): %s", x->m.name, code, why ? why : "no reason recorded");
        status = code > 0 && code <= BT_ERR_NUMERIC ? (bt_status)code : BT_ERR_NUMERIC;
    } else {
        n->left++;
        n->at_work += x->busy || bt_member_held(x->folder);
    }
    free(why);
    bt_errors_free(&damage);
    return status;
}

static int by_index(const void *a, const void *b)
{
    return ((const bt_entry *)a)->index < ((const bt_entry *)b)->index ? -1 : 1;
}

/// What members warn of: of each code the text of the first, and how many others there are.
static void print_warnings(const bt_ensemble *e)
{
    const bt_member_notes *w = &e->warnings;
    for (int64_t i = 0; i < w->n; i++) {
        int64_t others = 0, last = w->member[i];
        bool first = true;
        for (int64_t k = 0; k < i && first; k++) first = strcmp(w->code[k], w->code[i]) != 0;
        for (int64_t k = i + 1; k < w->n && first; k++)
            if (w->member[k] != last && !strcmp(w->code[k], w->code[i])) others++, last = w->member[k];
        if (!first) continue;
        printf("  warning: %s (%s", w->text[i], e->list[w->member[i] - 1].m.name);
        if (others) printf("; and %" PRId64 " more", others);
        printf(")\n");
    }
}

bt_status bt_ensemble_tell_end(bt_ensemble *e, bt_status status, bt_errors *err)
{
    counts n = {0};
    bt_status worst = status;
    qsort(e->list, (size_t)e->n, sizeof *e->list, by_index);
    for (int64_t i = 0; i < e->n; i++) {
        const bt_status of = tell_member(e, &e->list[i], &n, err);
        if (worst == BT_OK) worst = of;
    }
    if (n.failed > BT_MOST_REPORTED)
        bt_errors_add(err, "and %" PRId64 " more failed members; see %s/members/*/failed.txt",
                      n.failed - BT_MOST_REPORTED, e->o->dir);
    if (n.unsound > BT_MOST_REPORTED)
        bt_errors_add(err, "and %" PRId64 " more members that are not sound", n.unsound - BT_MOST_REPORTED);
    if (status == BT_ERR_SIGNAL)
        bt_errors_add(err, "stopped by %s; the same call goes on with the %" PRId64 " members that are left",
                      bt_ensemble_wall_left(e) <= 0 ? "the limit of wall time" : "a signal", n.left);
    else if (n.at_work)
        bt_errors_add(err,
                      "%" PRId64 " members are being worked on by other processes; the same call takes them in when "
                      "those have ended",
                      n.at_work);
    else if (n.left && worst == BT_OK)
        bt_errors_add(err, "%" PRId64 " members are left; the same call goes on with them", n.left);
    if (n.left && worst == BT_OK) worst = BT_ERR_SIGNAL;
    if (!e->o->quiet) {
        printf("%" PRId64 " members finished, %" PRId64 " failed, %" PRId64 " left", n.finished, n.failed, n.left);
        if (n.unsound) printf(", %" PRId64 " not sound", n.unsound);
        printf("; %s/ensemble.h5\n", e->o->dir);
        print_warnings(e);
    }
    return worst;
}
