// SPDX-License-Identifier: MIT
// bergtow check of a study: the study, the case of each of its conditions, and what all of it costs.
//
// Members of a condition differ by the seed of their field alone, so the first stands for all.
#include "field/lead.h"
#include "bergtow/study.h"
#include "app/cmd_check.h"
#include "case/case_derived.h"
#include "case/cost.h"
#include "base/fileio.h"
#include "base/largest.h"
#include "base/tree.h"
#include "base/units.h"
#include "case/schema.h"
#include "case/case_base.h"
#include "run/study.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum {
    MOST_ROWS = 24,   // conditions that are printed one by one
    MOST_LISTED = 16, // values of a parameter that are printed
    CELL = 48,
};

// Of the first member of a condition.
typedef struct {
    double floes, steps, seconds, memory, disk; // number, number, s of one core, B, B
    bool step_good, warned;
    bool fixed; // the ice does not depend on the seed
} numbers;

typedef struct {
    char *text;
    const char *code;     // of a warning
    int64_t first, last, count; // conditions
} fault;

typedef struct {
    fault *list;
    size_t n;
} faults;

// --- faults and warnings: what is wrong with many conditions is said once --------------------------------------------

/// Of warnings of one code, which differ in numbers, the first stands for all.
static bool is_same(const fault *a, const char *text, const char *code)
{
    return a->code && code ? !strcmp(a->code, code) : !strcmp(a->text, text);
}

static void take_faults(faults *f, int64_t condition, bt_errors *err)
{
    for (size_t i = 0; i < err->n; i++) {
        size_t k = 0;
        while (k < f->n && !is_same(&f->list[k], err->text[i], err->note[i].code)) k++;
        if (k == f->n) {
            f->list = bt_realloc(f->list, f->n + 1, sizeof *f->list);
            f->list[f->n++] = (fault){bt_text_copy(err->text[i]), err->note[i].code, condition, -1, 0};
        }
        f->list[k].count += f->list[k].last != condition;
        f->list[k].last = condition;
    }
    bt_errors_free(err);
}

static void tell_faults(faults *f, const bt_study *s, bt_errors *err)
{
    for (size_t k = 0; k < f->n; k++) {
        bt_text text;
        bt_text_begin(&text);
        FILE *out = text.out;
        bt_member m;
        bt_study_member(s, f->list[k].first * s->repeats, &m);
        fprintf(out, "condition %" PRId64, f->list[k].first + 1);
        for (int p = 0; p < s->n_parameters; p++)
            fprintf(out, "%s %.40s %.40s", p ? "," : ":", s->parameter[p].name, m.value[p]);
        if (f->list[k].count > 1) fprintf(out, "; and %" PRId64 " more", f->list[k].count - 1);
        char *where = bt_text_end(&text);
        bt_errors_add(err, "%s (%s)", f->list[k].text, where);
        bt_member_free(&m);
        free(where);
        free(f->list[k].text);
    }
    free(f->list);
}

static bt_status worse(bt_status a, bt_status b) { return a > b ? a : b; }

/// Case and ice of a condition, as `check` has them of a case.
static bt_status check_condition(const bt_study *s, int64_t condition, numbers *x, bt_errors *warnings, bt_errors *err)
{
    bt_member m;
    bt_case c;
    bt_field f;
    bt_field_init(&f);
    bt_study_member(s, condition * s->repeats, &m);
    const bt_comm ranks = {.mpi = MPI_COMM_NULL, .size = (int)s->ranks, .ranks_here = (int)s->ranks};
    bt_check_ice n, run;
    bt_lead_stats lead = {0};
    bt_status status = bt_member_case(s, &m, &c, err);
    if (status == BT_OK) status = bt_check_ready(&c, &ranks, &f, &n, &run, &lead, err);
    if (status == BT_OK) {
        const bt_check_step step = bt_check_step_of(&c, &n);
        const bt_cost_disk disk = bt_cost_disk_of(&c, run.count, run.corners, ranks.size);
        bt_check_warn(&c, &f, &n, warnings);
        *x = (numbers){n.count,
                       (double)bt_case_steps(&c),
                       bt_check_seconds(&c, &n),
                       bt_cost_memory(&c, n.count, n.parts, ranks.size, ranks.size),
                       bt_cost_member(&c, &disk),
                       step.contact && step.floes,
                       warnings->n > 0,
                       !bt_case_ice_is_random(&c)};
    }
    bt_field_free(&f);
    bt_case_free(&c);
    bt_member_free(&m);
    return status;
}

/// x: [n_conditions].
static bt_status check_conditions(const bt_study *s, numbers *x, bt_errors *warnings, bt_errors *err)
{
    bt_case c;
    bt_status status = bt_study_base_case(s, &c, err); // what is wrong without any condition
    bt_case_free(&c);
    if (status != BT_OK) {
        bt_errors_add(err, "%s: base: %s with `set` is no valid case, as any condition needs it; mend that first",
                      s->path, s->base_name);
        return status;
    }
    faults f = {0}, w = {0};
    int64_t k = 0;
    for (; k < s->n_conditions && f.n < BT_MOST_COMPLAINTS; k++) {
        bt_errors here = {0}, warned = {0};
        status = worse(status, check_condition(s, k, &x[k], &warned, &here));
        take_faults(&f, k, &here);
        take_faults(&w, k, &warned);
    }
    tell_faults(&f, s, err);
    tell_faults(&w, s, warnings);
    if (status != BT_OK && k < s->n_conditions)
        bt_errors_add(err, "%s: conditions from %" PRId64 " on are not looked at after %d errors; mend those first",
                      s->path, k + 1, BT_MOST_COMPLAINTS);
    return status;
}

// --- printing --------------------------------------------------------------------------------------------------------

static const char *duration(double seconds, char out[CELL])
{
    static const struct {
        double s;
        const char *name;
    } unit[] = {{1, "s"}, {60, "min"}, {3600, "h"}, {86400, "days"}};
    int k = 0;
    while (k < 3 && seconds / unit[k].s >= 99.5) k++;
    snprintf(out, CELL, seconds / unit[k].s < 99.5 ? "%.2g %s" : "%.0f %s", seconds / unit[k].s, unit[k].name);
    return out;
}

static void print_sets(const char *label, char *const *set, int n)
{
    if (n == 0) return;
    printf("%-20s ", label);
    for (int i = 0; i < n; i++) printf("%s%s", i ? ", " : "", set[i]);
    printf("\n");
}

static void print_parameter(const bt_study *s, const bt_study_parameter *p)
{
    printf("%-20s ", p->name);
    if (p->continuous && s->sampling == BT_SAMPLING_LATIN_HYPERCUBE) {
        // with its unit: these are SI numbers, and a bare one of an angle would be read in degrees
        const bt_key *key = p->key >= 0 ? &bt_case_keys[p->key] : NULL;
        const char *unit = key && key->type == BT_KEY_REAL ? bt_units_symbol(key->unit) : "";
        char *distribution = bt_study_distribution(p);
        printf("%s%s%s%s%s\n", distribution, *unit ? " " : "", unit, p->source ? "; source: " : "",
               p->source ? p->source : "");
        free(distribution);
        return;
    }
    const int shown = p->n > MOST_LISTED ? MOST_LISTED - 2 : p->n;
    for (int i = 0; i < shown; i++) printf("%s%s", i ? ", " : "", p->value[i]);
    if (shown < p->n) printf(", ... %s (%d values)", p->value[p->n - 1], p->n);
    printf("\n");
}

static void print_varied(const bt_study *s)
{
    for (int i = 0; i < s->n_parameters; i++) print_parameter(s, &s->parameter[i]);
    char label[CELL + 8];
    for (int i = 0; i < s->n_variants; i++) {
        snprintf(label, sizeof label, "  %.46s", s->variant[i].name);
        print_sets(label, s->variant[i].set, s->variant[i].n_set);
    }
    for (int i = 0; i < s->n_with; i++) {
        snprintf(label, sizeof label, "  with %.42s", s->with[i].name);
        print_sets(label, s->with[i].set, s->with[i].n_set);
    }
}

/// Texts of a row of the table, the head for condition −1.
static int row_of(const bt_study *s, const numbers *x, int64_t condition, char cell[][CELL])
{
    int n = 0;
    bt_member m = {0};
    if (condition >= 0) {
        bt_study_member(s, condition * s->repeats, &m);
        snprintf(cell[n++], CELL, "%" PRId64, condition + 1);
        for (int p = 0; p < s->n_parameters; p++) snprintf(cell[n++], CELL, "%.40s", m.value[p]);
        snprintf(cell[n++], CELL, "%.0f", x[condition].floes);
        snprintf(cell[n++], CELL, "%.0f", x[condition].steps);
        duration(x[condition].seconds, cell[n++]);
        snprintf(cell[n++], CELL, "%s", bt_check_verdict(x[condition].step_good));
        bt_member_free(&m);
        return n;
    }
    snprintf(cell[n++], CELL, "condition");
    for (int p = 0; p < s->n_parameters; p++) snprintf(cell[n++], CELL, "%.40s", s->parameter[p].name);
    for (int k = 0; k < 4; k++)
        snprintf(cell[n++], CELL, "%s", (const char *const[]){"floes", "steps", "one run", "time step"}[k]);
    return n;
}

static void print_table(const bt_study *s, const numbers *x)
{
    char cell[BT_MAX_PARAMETERS + 5][CELL];
    int width[BT_MAX_PARAMETERS + 5] = {0};
    for (int pass = 0; pass < 2; pass++)
        for (int64_t k = -1; k < s->n_conditions; k++) {
            const int n = row_of(s, x, k, cell);
            for (int i = 0; i < n && pass == 0; i++) width[i] = (int)bt_max(width[i], (double)strlen(cell[i]));
            for (int i = 0; i < n && pass == 1; i++) printf("%*s%s", width[i], cell[i], i + 1 < n ? "  " : "\n");
        }
}

static void print_range(const bt_study *s, const numbers *x)
{
    numbers lo = x[0], hi = x[0];
    int64_t large = 0;
    for (int64_t k = 0; k < s->n_conditions; k++) {
        lo.floes = bt_min(lo.floes, x[k].floes), hi.floes = bt_max(hi.floes, x[k].floes);
        lo.steps = bt_min(lo.steps, x[k].steps), hi.steps = bt_max(hi.steps, x[k].steps);
        lo.seconds = bt_min(lo.seconds, x[k].seconds), hi.seconds = bt_max(hi.seconds, x[k].seconds);
        large += !x[k].step_good;
    }
    char a[CELL], b[CELL];
    printf("floes                %.0f to %.0f\n", lo.floes, hi.floes);
    printf("steps                %.0f to %.0f\n", lo.steps, hi.steps);
    printf("one run              rough estimate %s to %s on one core\n", duration(lo.seconds, a),
           duration(hi.seconds, b));
    if (large)
        printf("time step            TOO LARGE in %" PRId64
               " conditions; warnings below say why\n",
               large);
    else printf("time step            ok\n");
}

/// How many members run at a time, and what all of it takes then. ranks: that this call was started on, or 1.
static void print_work(const bt_study *s, double memory, double disk, double seconds, int ranks)
{
    char text[CELL];
    const int64_t groups = ranks / s->ranks;
    if (groups < 1) printf("ranks                %" PRId64 " a member: start with mpirun -n %" PRId64 " or more\n",
                           s->ranks, s->ranks);
    else if (ranks > 1)
        printf("ranks                %d: %" PRId64 " member%s at a time, %" PRId64 " rank%s each%s\n", ranks, groups,
               groups > 1 ? "s" : "", s->ranks, s->ranks > 1 ? "s" : "",
               ranks % s->ranks ? "; some ranks are left over" : "");
    printf("memory               about %.3g MB for one member", memory / 1e6);
    if (groups > 1) printf(", %.3g MB for %" PRId64 " at a time", memory / 1e6 * (double)groups, groups);
    printf("\ndisk                 about %.3g %s for all members and ensemble.h5\n", disk / (disk < 1e9 ? 1e6 : 1e9),
           disk < 1e9 ? "MB" : "GB");
    printf("wall time            rough estimate %s on one core for all members\n", duration(seconds, text));
    if (groups >= 1 && ranks > 1)
        printf("                     %s on %" PRId64 " ranks, each with a core\n",
               duration(seconds / (double)(groups * s->ranks), text), groups * s->ranks);
}

static void print_study(const bt_study *s, const numbers *x, const bt_errors *warnings, int ranks)
{
    double seconds = 0, memory = 0, disk = 0;
    int64_t warned = 0, fixed = 0;
    for (int64_t k = 0; k < s->n_conditions; k++) {
        fixed += x[k].fixed && s->repeats > 1;
        seconds += x[k].seconds * (double)s->repeats;
        disk += x[k].disk * (double)s->repeats;
        warned += x[k].warned;
        memory = bt_max(memory, x[k].memory);
    }
    char verdict_of_all[96] = "valid";
    if (warned)
        snprintf(verdict_of_all, sizeof verdict_of_all, "valid, with warnings in %" PRId64 " of %" PRId64 " conditions",
                 warned, s->n_conditions);
    printf("%s: %s\n", s->path, verdict_of_all);
    if (s->title) printf("title                %s\n", s->title);
    printf("base                 %s\n", s->base);
    print_sets("set", s->set, s->n_set);
    print_varied(s);
    printf("members              %" PRId64 " conditions x %" PRId64 " fields = %" PRId64 "%s%s", s->n_conditions,
           s->repeats, bt_study_n_members(s), s->sampling == BT_SAMPLING_LATIN_HYPERCUBE ? ", a Latin hypercube" : "",
           s->common_fields ? ", the same fields in all conditions" : "");
    if (s->ranks > 1) printf(", %" PRId64 " ranks each", s->ranks);
    printf("\n");
    if (fixed)
        printf("                     in %" PRId64 " conditions the ice does not depend on the seed, as it is read, or "
               "there is none: the fields of each are one run\n",
               fixed);
    if (s->n_conditions <= MOST_ROWS) print_table(s, x);
    else print_range(s, x);
    print_work(s, memory, disk, seconds, ranks);
    for (size_t i = 0; i < warnings->n; i++) printf("warning              %s\n", warnings->text[i]);
    if (warned) printf("%s: %s\n", s->path, verdict_of_all);
}

bt_status bt_check_study(const bt_cmd_case *file, int ranks, bt_errors *err)
{
    bt_study s;
    bt_status status = bt_study_read(&s, file->path, err);
    if (status == BT_OK) status = bt_study_override(&s, file->set, file->n_set, err);
    if (status == BT_OK && ranks > 1) status = bt_study_fits(&s, ranks, err);
    const size_t before = err->n;
    if (status == BT_OK) bt_study_check_ice(&s, err);
    if (err->n > before) status = BT_ERR_CASE;
    if (status == BT_OK) {
        numbers *x = bt_alloc((size_t)s.n_conditions, sizeof *x);
        bt_errors warnings = {0};
        status = check_conditions(&s, x, &warnings, err);
        if (status == BT_OK) print_study(&s, x, &warnings, ranks);
        bt_errors_free(&warnings);
        free(x);
    }
    bt_study_free(&s);
    return status;
}
