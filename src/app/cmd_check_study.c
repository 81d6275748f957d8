// SPDX-License-Identifier: MIT
// bergtow check of a study: the study, the case of each of its conditions, and the total cost.
//
// Members of a condition differ only in the seed of their field, so the first represents all.
#include "field/lead.h"
#include "bergtow/study.h"
#include "app/cmd_check.h"
#include "case/case_derived.h"
#include "case/cost.h"
#include "base/inside.h"
#include "base/largest.h"
#include "base/units.h"
#include "case/schema.h"
#include "run/study.h"

#include <inttypes.h>
#include <string.h>

enum {
    MAX_ROWS = 24,   // conditions that are printed one by one
    MAX_LISTED = 16, // values of a parameter that are printed
    CELL = 48,
};

// Numbers of the first member of a condition.
typedef struct {
    double floes, steps, seconds, memory, disk; // number, number, s of one core, B, B
    bool step_good, warned;
    bool fixed; // the ice does not depend on the seed
} numbers;

typedef struct {
    char *text, *code;          // code: of a warning, NULL = none
    int64_t first, last, count; // conditions
} fault;

typedef struct {
    fault *list;
    size_t n;
} faults;

// --- faults and warnings, each reported once for all its conditions --------------------------------------------------

/// Warnings with the same code differ only in their numbers, so the first represents all.
static bool is_same(const fault *a, const char *text, const char *code)
{
    return a->code && code ? !strcmp(a->code, code) : !strcmp(a->text, text);
}

static void take_faults(faults *found, int64_t condition, bt_errors *err)
{
    for (size_t i = 0; i < err->n; i++) {
        size_t k = 0;
        while (k < found->n && !is_same(&found->list[k], err->text[i], err->note[i].code)) k++;
        if (k == found->n) {
            found->list = bt_realloc(found->list, found->n + 1, sizeof *found->list);
            found->list[found->n++] = (fault){err->text[i], err->note[i].code, condition, -1, 0};
            err->text[i] = err->note[i].code = NULL;
        }
        found->list[k].count += found->list[k].last != condition;
        found->list[k].last = condition;
    }
    bt_errors_free(err);
}

static void tell_faults(faults *found, const bt_study *study, bt_errors *err)
{
    for (size_t k = 0; k < found->n; k++) {
        bt_text text;
        bt_text_begin(&text);
        FILE *out = text.out;
        bt_member member;
        bt_study_member(study, found->list[k].first * study->repeats, &member);
        fprintf(out, "condition %" PRId64, found->list[k].first + 1);
        for (int p = 0; p < study->n_parameters; p++)
            fprintf(out, "%s %.40s %.40s", p ? "," : ":", study->parameter[p].name, member.value[p]);
        if (found->list[k].count > 1) fprintf(out, "; and %" PRId64 " more", found->list[k].count - 1);
        char *where = bt_text_end(&text);
        bt_errors_add(err, "%s (%s)", found->list[k].text, where);
        bt_member_free(&member);
        BT_FREE(where, found->list[k].text, found->list[k].code);
    }
    free(found->list);
}

static bt_status worse(bt_status a, bt_status b) { return a > b ? a : b; }

/// Check the case and ice of a condition, as `check` does for a case.
static bt_status check_condition(const bt_study *study, int64_t condition, numbers *sums, bt_errors *warnings,
                                 bt_errors *err)
{
    bt_member member;
    bt_case input;
    bt_field field;
    bt_field_init(&field);
    bt_study_member(study, condition * study->repeats, &member);
    const bt_comm ranks = {.mpi = MPI_COMM_NULL, .size = (int)study->ranks, .ranks_here = (int)study->ranks};
    bt_check_ice ice, run;
    bt_lead_stats lead = {0};
    bt_status status = bt_member_case(study, &member, &input, err);
    if (status == BT_OK) status = bt_check_ready(&input, &ranks, &field, &ice, &run, &lead, err);
    if (status == BT_OK) {
        const bt_time_step step = bt_check_step(&input, &ice);
        const bt_cost_disk disk = bt_cost_disk_of(&input, run.count, run.corners, ranks.size);
        bt_check_warn(&input, &field, &ice, warnings);
        *sums = (numbers){ice.count,
                          (double)bt_case_steps(&input),
                          bt_check_seconds(&input, &ice),
                          bt_cost_memory(&input, ice.count, ice.parts, ranks.size, ranks.size),
                          bt_cost_member(&input, &disk),
                          step.contact && step.floes,
                          warnings->n > 0,
                          !bt_case_ice_is_random(&input)};
    }
    bt_field_free(&field);
    bt_case_free(&input);
    bt_member_free(&member);
    return status;
}

/// sums: [n_conditions].
static bt_status check_conditions(const bt_study *study, numbers *sums, bt_errors *warnings, bt_errors *err)
{
    bt_case input;
    bt_status status = bt_study_base_case(study, &input, err); // faults common to all conditions
    bt_case_free(&input);
    if (status != BT_OK) {
        bt_errors_add(err, "%s: base: %s with `set` is not a valid case, but every condition needs it; correct it "
                           "first",
                      study->path, study->base_name);
        return status;
    }
    faults f = {0}, w = {0};
    int64_t k = 0;
    for (; k < study->n_conditions && f.n < BT_MAX_COMPLAINTS; k++) {
        bt_errors here = {0}, warned = {0};
        status = worse(status, check_condition(study, k, &sums[k], &warned, &here));
        take_faults(&f, k, &here);
        take_faults(&w, k, &warned);
    }
    tell_faults(&f, study, err);
    tell_faults(&w, study, warnings);
    if (status != BT_OK && k < study->n_conditions)
        bt_errors_add(err, "%s: conditions from %" PRId64 " on are not checked after %d errors; correct those first",
                      study->path, k + 1, BT_MAX_COMPLAINTS);
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

static void print_parameter(const bt_study *study, const bt_study_parameter *parameter)
{
    printf("%-20s ", parameter->name);
    if (parameter->continuous && study->sampling == BT_SAMPLING_LATIN_HYPERCUBE) {
        // with its unit: these are SI numbers, and an angle without unit would be read in degrees
        const bt_key *key = parameter->key >= 0 ? &bt_case_keys[parameter->key] : NULL;
        const char *unit = key && key->type == BT_KEY_REAL ? bt_units_symbol(key->unit) : "";
        char *distribution = bt_study_distribution(parameter);
        printf("%s%s%s%s%s\n", distribution, *unit ? " " : "", unit, parameter->source ? "; source: " : "",
               parameter->source ? parameter->source : "");
        free(distribution);
        return;
    }
    const int shown = parameter->n > MAX_LISTED ? MAX_LISTED - 2 : parameter->n;
    for (int i = 0; i < shown; i++) printf("%s%s", i ? ", " : "", parameter->value[i]);
    if (shown < parameter->n) printf(", ... %s (%d values)", parameter->value[parameter->n - 1], parameter->n);
    printf("\n");
}

static void print_varied(const bt_study *study)
{
    for (int i = 0; i < study->n_parameters; i++) print_parameter(study, &study->parameter[i]);
    char label[CELL + 8];
    for (int i = 0; i < study->n_variants; i++) {
        const bool with = bt_is_with(study, &study->variant[i]);
        snprintf(label, sizeof label, with ? "  with %.42s" : "  %.46s", study->variant[i].name);
        print_sets(label, study->variant[i].set, study->variant[i].n_set);
    }
}

/// Cells of a row of the table; condition −1: its head.
static int row_of(const bt_study *study, const numbers *sums, int64_t condition, char cell[][CELL])
{
    int n = 0;
    bt_member member = {0};
    if (condition >= 0) {
        bt_study_member(study, condition * study->repeats, &member);
        snprintf(cell[n++], CELL, "%" PRId64, condition + 1);
        for (int p = 0; p < study->n_parameters; p++) snprintf(cell[n++], CELL, "%.40s", member.value[p]);
        snprintf(cell[n++], CELL, "%.0f", sums[condition].floes);
        snprintf(cell[n++], CELL, "%.0f", sums[condition].steps);
        duration(sums[condition].seconds, cell[n++]);
        snprintf(cell[n++], CELL, "%s", bt_check_verdict(sums[condition].step_good));
        bt_member_free(&member);
        return n;
    }
    snprintf(cell[n++], CELL, "condition");
    for (int p = 0; p < study->n_parameters; p++) snprintf(cell[n++], CELL, "%.40s", study->parameter[p].name);
    for (int k = 0; k < 4; k++)
        snprintf(cell[n++], CELL, "%s", (const char *const[]){"floes", "steps", "one run", "time step"}[k]);
    return n;
}

static void print_table(const bt_study *study, const numbers *sums)
{
    char cell[BT_MAX_PARAMETERS + 5][CELL];
    int width[BT_MAX_PARAMETERS + 5] = {0};
    for (int pass = 0; pass < 2; pass++)
        for (int64_t k = -1; k < study->n_conditions; k++) {
            const int n = row_of(study, sums, k, cell);
            for (int i = 0; i < n && pass == 0; i++) width[i] = (int)bt_max(width[i], (double)strlen(cell[i]));
            for (int i = 0; i < n && pass == 1; i++) printf("%*s%s", width[i], cell[i], i + 1 < n ? "  " : "\n");
        }
}

static void print_range(const bt_study *study, const numbers *sums)
{
    numbers lo = sums[0], hi = sums[0];
    int64_t large = 0;
    for (int64_t k = 0; k < study->n_conditions; k++) {
        lo.floes = bt_min(lo.floes, sums[k].floes), hi.floes = bt_max(hi.floes, sums[k].floes);
        lo.steps = bt_min(lo.steps, sums[k].steps), hi.steps = bt_max(hi.steps, sums[k].steps);
        lo.seconds = bt_min(lo.seconds, sums[k].seconds), hi.seconds = bt_max(hi.seconds, sums[k].seconds);
        large += !sums[k].step_good;
    }
    char a[CELL], b[CELL];
    printf("floes                %.0f to %.0f\n", lo.floes, hi.floes);
    printf("steps                %.0f to %.0f\n", lo.steps, hi.steps);
    printf("one run              rough estimate %s to %s on one core\n", duration(lo.seconds, a),
           duration(hi.seconds, b));
    if (large)
        printf("time step            TOO LARGE in %" PRId64
               " conditions; see the warnings below\n",
               large);
    else printf("time step            ok\n");
}

/// Print how many members run at a time, and the resources they need. ranks: of this call, or 1.
static void print_work(const bt_study *study, double memory, double disk, double seconds, int ranks)
{
    char text[CELL];
    const int64_t groups = ranks / study->ranks;
    if (groups < 1) printf("ranks                %" PRId64 " a member: start with mpirun -n %" PRId64 " or more\n",
                           study->ranks, study->ranks);
    else if (ranks > 1)
        printf("ranks                %d: %" PRId64 " member%s at a time, %" PRId64 " rank%s each%s\n", ranks, groups,
               bt_plural(groups), study->ranks, bt_plural(study->ranks),
               ranks % study->ranks ? "; some ranks are left over" : "");
    printf("memory               about %.3g MB for one member", memory / 1e6);
    if (groups > 1) printf(", %.3g MB for %" PRId64 " at a time", memory / 1e6 * (double)groups, groups);
    printf("\ndisk                 about %.3g %s for all members and ensemble.h5\n", disk / (disk < 1e9 ? 1e6 : 1e9),
           disk < 1e9 ? "MB" : "GB");
    printf("wall time            rough estimate %s on one core for all members\n", duration(seconds, text));
    if (groups >= 1 && ranks > 1)
        printf("                     %s on %" PRId64 " ranks, each with a core\n",
               duration(seconds / (double)(groups * study->ranks), text), groups * study->ranks);
}

static void print_study(const bt_study *study, const numbers *sums, const bt_errors *warnings, int ranks)
{
    double seconds = 0, memory = 0, disk = 0;
    int64_t warned = 0, fixed = 0;
    for (int64_t k = 0; k < study->n_conditions; k++) {
        fixed += sums[k].fixed && study->repeats > 1;
        seconds += sums[k].seconds * (double)study->repeats;
        disk += sums[k].disk * (double)study->repeats;
        warned += sums[k].warned;
        memory = bt_max(memory, sums[k].memory);
    }
    char verdict_of_all[96] = "valid";
    if (warned)
        snprintf(verdict_of_all, sizeof verdict_of_all, "valid, with warnings in %" PRId64 " of %" PRId64 " conditions",
                 warned, study->n_conditions);
    printf("%s: %s\n", study->path, verdict_of_all);
    if (study->title) printf("title                %s\n", study->title);
    printf("base                 %s\n", study->base);
    print_sets("set", study->set, study->n_set);
    print_varied(study);
    printf("members              %" PRId64 " condition%s x %" PRId64 " field%s = %" PRId64 "%s%s", study->n_conditions,
           bt_plural(study->n_conditions), study->repeats, bt_plural(study->repeats), bt_study_n_members(study),
           study->sampling == BT_SAMPLING_LATIN_HYPERCUBE
           ? ", a Latin hypercube" : "", study->fields != BT_FIELDS_OWN ? ", the same fields in all conditions" : "");
    if (study->ranks > 1) printf(", %" PRId64 " ranks each", study->ranks);
    printf("\n");
    if (fixed)
        printf("                     in %" PRId64 " condition%s no ice depends on the seed (ice from a file, or none): "
               "the fields of each are one run\n",
               fixed, bt_plural(fixed));
    if (study->n_conditions <= MAX_ROWS) print_table(study, sums);
    else print_range(study, sums);
    print_work(study, memory, disk, seconds, ranks);
    for (size_t i = 0; i < warnings->n; i++) printf("warning              %s\n", warnings->text[i]);
    if (warned) printf("%s: %s\n", study->path, verdict_of_all);
}

bt_status bt_check_study(const bt_cmd_case *file, int ranks, bt_errors *err)
{
    bt_study study;
    bt_status status = bt_study_read(&study, file->path, err);
    if (status == BT_OK) status = bt_study_override(&study, file->set, file->n_set, err);
    if (status == BT_OK && ranks > 1) status = bt_study_fits(&study, ranks, err);
    if (status == BT_OK) status = bt_study_check_ice(&study, err);
    if (status == BT_OK) {
        numbers *sums = bt_alloc((size_t)study.n_conditions, sizeof *sums);
        bt_errors warnings = {0};
        status = check_conditions(&study, sums, &warnings, err);
        if (status == BT_OK) print_study(&study, sums, &warnings, ranks);
        bt_errors_free(&warnings);
        free(sums);
    }
    bt_study_free(&study);
    return status;
}
