// SPDX-License-Identifier: MIT
// Columns and running totals of the steps of a run, which steady.h and summary.h reduce.
#include "output/history.h"
#include "case/cost.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

_Static_assert((int)BT_N_COLUMNS == (int)BT_COST_COLUMNS, "what check says of memory and disk counts them");

#define NAME(id, name, member) name,
#define PLACE(id, name, member) offsetof(bt_sample, member),
static const char *const names[] = {BT_HISTORY_COLUMNS(NAME)};
static const size_t places[] = {BT_HISTORY_COLUMNS(PLACE)};

double bt_history_largest(const double *x, int64_t from, int64_t to)
{
    double most = NAN;
    for (int64_t i = from; i < to; i++)
        if (!(x[i] <= most)) most = x[i];
    return most;
}

#define TOTAL(type, member, rule_, from, key, units, meaning)                                                          \
    {                                                                                                                  \
        .at = {#member, BT_ITEM_##type, 1, offsetof(bt_history, member), units, meaning, "one", BT_ROW_ANY, key},      \
        .rule = BT_TOTAL_##rule_, .offset = offsetof(bt_sample, from)                                                  \
    }
static const bt_total totals[] = {
    TOTAL(F64, sum_contacts, SUM, contacts, NULL, "1", "contact points, sum over the steps"),
    TOTAL(F64, sum_sweeps, SUM, sweeps, NULL, "1", "sweeps, sum over the steps"),
    TOTAL(F64, sum_updates, SUM, contact_updates, NULL, "1", "updates of contacts, sum over the steps"),
    TOTAL(F64, sum_moves, SUM, momentum_moves, NULL, "1", "momentum moves, sum over the steps"),
    TOTAL(F64, sum_checks, SUM, residual_checks, NULL, "1",
        "residuals of contacts that were taken, sum over the steps"),
    TOTAL(F64, sum_projected, SUM, position_updates, NULL, "1",
        "updates of contacts by the position projection, sum over the steps"),
    TOTAL(F64, contact_work, SUM, contact_work, "contact_work_j", "J",
          "work of the contact impulses on the velocities from the start to the end of a step"),
    TOTAL(F64, max_overlap, MAX, overlap, "max_overlap_m", "m", "deepest overlap of two bodies"),
    TOTAL(F64, max_momentum_residual, MAX, momentum_residual, "momentum_residual", "1",
        "largest |momentum change - external impulse| / momentum exchanged of a step"),
    TOTAL(F64, max_residual, MAX, residual, "max_residual_m_s", "m/s",
        "largest residual of the contact problem at the end of a step"),
    TOTAL(I64, unconverged, STEPS, unconverged, "unconverged_steps", "1",
        "steps that reached the work limit before the tolerance"),
    TOTAL(F64, locked_steps, STEPS, locked, "locked_steps", "1",
        "unconverged steps in which some bodies could not give way to any load, so that their loads have no bound"),
    TOTAL(F64, no_load_steps, STEPS, no_load, "no_load_steps", "1",
        "locked steps in which the locked bodies press on the towed body: its load is undefined"),
    TOTAL(I64, unprojected, STEPS, unprojected, "unprojected_steps", "1",
        "steps whose position projection reached its work limit"),
    TOTAL(I64, positive_work, STEPS, added_energy, "positive_work_steps", "1",
        "steps in which the contacts added energy"),
    TOTAL(I64, restitution_cut, STEPS, restitution_cut, "restitution_cut_steps", "1",
        "steps whose restitution was lowered so that the contacts add no energy"),
    TOTAL(I64, repeats, SUM, repeats, "repeated_solves", "1",
        "times a step was solved again because floes outran the contact margin"),
    TOTAL(I64, outrun, STEPS, outrun, "outrun_steps", "1", "steps whose last solution still outran the margin"),
    TOTAL(I64, misjudged, SUM, misjudged, "misjudged_contacts", "1",
        "contacts that bore load at the end of a step although the pair passed, and pairs that met without one"),
};

enum { N_TOTALS = sizeof totals / sizeof *totals };

int bt_n_history_totals(void) { return N_TOTALS + bt_law_first_total(BT_LAWS); }

/// Totals of the contact laws, made from their tables once.
static const bt_total *total_of_law(int k)
{
    static bt_total made[BT_MAX_LAW_TOTALS];
    for (int law = 0, i = 0; !made[k].at.name && law < BT_LAWS; law++)
        for (int j = 0; j < bt_laws[law]->n_totals; j++, i++) {
            const bt_law_total *total = &bt_laws[law]->totals[j];
            const int number = bt_law_first_number(law) + total->number;
            made[i] = (bt_total){
                .at = {total->name, total->rule == BT_TOTAL_STEPS ? BT_ITEM_I64 : BT_ITEM_F64, 1,
                       offsetof(bt_history, laws) + (size_t)i * sizeof(bt_total_value), total->units,
                       total->description,
                       "one", BT_ROW_ANY, total->key},
                .rule = total->rule,
                .offset = offsetof(bt_sample, laws) + (size_t)number * sizeof(double)};
        }
    return &made[k];
}

const bt_total *bt_history_total(int k) { return k < N_TOTALS ? &totals[k] : total_of_law(k - N_TOTALS); }

/// Add a step to a total. Counts are exact in a double up to 2⁵³, far beyond any run.
static void add_total(bt_history *history, const bt_total *total, const bt_sample *sample)
{
    double x = 0, sum = 0;
    int64_t whole = 0;
    char *at = (char *)history + total->at.offset;
    memcpy(&x, (const char *)sample + total->offset, sizeof x);
    if (total->rule == BT_TOTAL_STEPS) x = x != 0;
    if (total->at.type == BT_ITEM_I64) {
        memcpy(&whole, at, sizeof whole);
        whole += (int64_t)x;
        memcpy(at, &whole, sizeof whole);
    } else {
        memcpy(&sum, at, sizeof sum);
        sum = total->rule == BT_TOTAL_MAX ? bt_max_seen(sum, x) : total->rule == BT_TOTAL_LAST ? x : sum + x;
        memcpy(at, &sum, sizeof sum);
    }
}

bt_state_row bt_history_column(int k, char name[BT_HISTORY_NAME])
{
    const bt_quantity *quantity = k < BT_N_COLUMNS ? bt_own_series : bt_added(k - BT_N_COLUMNS);
    while (k < BT_N_COLUMNS && quantity->offset != places[k]) quantity++;
    if (k < BT_N_COLUMNS) snprintf(name, BT_HISTORY_NAME, "history/%s", names[k]);
    else snprintf(name, BT_HISTORY_NAME, BT_HISTORY_ADDED "%s", quantity->name);
    return (bt_state_row){strchr(name, '/') + 1, BT_ITEM_F64, 1, quantity->offset, quantity->units,
                          quantity->description, "time", BT_ROW_ANY, NULL};
}

void bt_history_init(bt_history *history) { *history = (bt_history){.n_columns = BT_N_COLUMNS + bt_n_added()}; }

void bt_history_free(bt_history *history)
{
    for (int k = 0; k < history->n_columns; k++) free(history->column[k]);
    bt_history_init(history);
}

void bt_history_add(bt_history *history, const bt_sample *sample)
{
    if (history->n == history->cap) {
        history->cap = history->cap ? 2 * history->cap : 1024;
        for (int k = 0; k < history->n_columns; k++)
            history->column[k] = bt_realloc(history->column[k], (size_t)history->cap, sizeof(double));
    }
    for (int k = 0; k < BT_N_COLUMNS; k++)
        history->column[k][history->n] = *(const double *)(const void *)((const char *)sample + places[k]);
    static const bt_column loads[] = {BT_COL_ICE, BT_COL_TOW, BT_COL_BUDGET, BT_COL_QUASI_STATIC};
    for (size_t i = 0; sample->no_load != 0 && i < sizeof loads / sizeof *loads; i++) {
        double *x = history->column[loads[i]] + history->n;
        if (isnan(*x)) *x = history->n > 0 ? x[-1] : 0;
    }
    for (int k = BT_N_COLUMNS; k < history->n_columns; k++)
        history->column[k][history->n] = bt_sample_value(sample, bt_added(k - BT_N_COLUMNS));
    history->n++;
    for (int k = 0; k < bt_n_history_totals(); k++) add_total(history, bt_history_total(k), sample);
}
