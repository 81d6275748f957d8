// SPDX-License-Identifier: MIT
// Columns and running totals of the steps of a run, which steady.h and summary.h reduce.
#include "output/history.h"
#include "case/cost.h"

#include <math.h>

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

/// The program's own series of a member of bt_sample.
static const bt_quantity *series_at(size_t offset)
{
    const bt_quantity *series = bt_own_series;
    while (series->offset != offset) series++;
    return series;
}

#define TOTAL(type, member, rule_, from)                                                                               \
    {                                                                                                                  \
        .at = {#member, BT_ITEM_##type, 1, offsetof(bt_history, member), NULL, NULL, "one", BT_ROW_ANY, NULL},         \
        .rule = BT_TOTAL_##rule_, .offset = offsetof(bt_sample, from)                                                  \
    }
static bt_total totals[] = { // units, meaning and key: own_total
    TOTAL(F64, sum_contacts, SUM, contacts),
    TOTAL(F64, sum_sweeps, SUM, sweeps),
    TOTAL(F64, sum_updates, SUM, contact_updates),
    TOTAL(F64, sum_moves, SUM, momentum_moves),
    TOTAL(F64, sum_checks, SUM, residual_checks),
    TOTAL(F64, sum_projected, SUM, position_updates),
    TOTAL(F64, contact_work, SUM, contact_work),
    TOTAL(F64, max_overlap, MAX, overlap),
    TOTAL(F64, max_momentum_residual, MAX, momentum_residual),
    TOTAL(F64, max_residual, MAX, residual),
    TOTAL(I64, unconverged, STEPS, unconverged),
    TOTAL(F64, locked_steps, STEPS, locked),
    TOTAL(F64, no_load_steps, STEPS, no_load),
    TOTAL(I64, unprojected, STEPS, unprojected),
    TOTAL(I64, positive_work, STEPS, added_energy),
    TOTAL(I64, restitution_cut, STEPS, restitution_cut),
    TOTAL(I64, repeats, SUM, repeats),
    TOTAL(I64, outrun, STEPS, outrun),
    TOTAL(I64, misjudged, SUM, misjudged),
};

enum { N_TOTALS = sizeof totals / sizeof *totals };

int bt_n_history_totals(void) { return N_TOTALS + bt_law_first_total(BT_LAWS); }

/// A total of the program's own, with units and meaning of its series; and the key, unless that is of the mean.
static const bt_total *own_total(int k)
{
    bt_total *total = &totals[k];
    if (total->at.meaning) return total;
    const bt_quantity *series = series_at(total->offset);
    total->at.units = series->units;
    total->at.key = series->keep == BT_KEEP_MEAN ? NULL : series->summary;
    total->at.meaning = bt_text_of("%s: %s", total->rule == BT_TOTAL_MAX ? "largest in the run" : "sum over the run",
                                   series->description);
    return total;
}

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

const bt_total *bt_history_total(int k) { return k < N_TOTALS ? own_total(k) : total_of_law(k - N_TOTALS); }

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
    const bt_quantity *quantity = k < BT_N_COLUMNS ? series_at(places[k]) : bt_added(k - BT_N_COLUMNS);
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
