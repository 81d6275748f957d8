// SPDX-License-Identifier: MIT
// The registry in text and JSON: nothing is named here, all comes from the tables.
#include "output/quantity_list.h"

#include <stdio.h>

#include "case/warning.h"
#include "output/estimate_text.h"
#include "output/summary_keys.h"

/// The tables of summary.json, and what stands before their keys there; the first is put together by bt_summary_keys.
static const struct { const char *prefix; const bt_json_key *keys; const int *n; } tables[] = {
    {"", NULL, NULL},
    {"window.series.NAME.", bt_reported_keys, &bt_n_reported_keys},
    {"estimates.", bt_condition_keys, &bt_n_condition_keys},
    {"estimates.NAME.", bt_estimate_keys, &bt_n_estimate_keys},
};
enum { N_TABLES = sizeof tables / sizeof *tables };

/// Table t, 0 = the summary's own.
static const bt_json_key *table(int t, int *n) { return t ? (*n = *tables[t].n, tables[t].keys) : bt_summary_keys(n); }

static void list_series(FILE *out)
{
    fprintf(out, "%-24s %-6s %-5s %-32s %s\n", "series", "units", "merge", "applies", "meaning");
    for (int k = 0; k < bt_n_series(); k++) {
        const bt_quantity *q = bt_series(k);
        fprintf(out, "%-24s %-6s %-5s %-32s %s", q->name, q->units, bt_keep_names[q->keep],
                bt_applies_names[q->applies], q->description);
        fprintf(out, q->summary ? "; %s in the summary\n" : "\n", q->summary);
    }
}

static void list_summary(FILE *out)
{
    fprintf(out, "\n%-46s %-6s %s\n", "summary.json", "units", "meaning");
    for (int t = 0, n; t < N_TABLES; t++) {
        const bt_json_key *keys = table(t, &n);
        for (const bt_json_key *k = keys; k < keys + n; k++) {
            if (k->kind == BT_JSON_ADDED) continue;
            char name[96];
            snprintf(name, sizeof name, "%s%s", tables[t].prefix, k->key);
            fprintf(out, "%-46s %-6s %s\n", name, k->units, k->description);
        }
    }
    for (int k = 0; k < bt_n_added(); k++)
        fprintf(out, "%-46s %-6s %s\n", bt_added(k)->summary, bt_added(k)->units, bt_added(k)->description);
}

void bt_quantities_list(void *stream)
{
    FILE *out = stream;
    list_series(out);
    list_summary(out);
    fprintf(out, "\n%-24s %-15s %-24s %s\n", "estimate", "kind", "label", "formula; source");
    for (int k = 0; k < bt_n_estimates(); k++) {
        const bt_estimate_def *d = bt_estimate_of(k);
        fprintf(out, "%-24s %-15s %-24s %s; %s\n", d->name, bt_estimate_kind_name(d), d->label, d->formula, d->source);
    }
    fprintf(out, "\n%-24s %s\n", "warning, reason", "meaning");
    for (int k = 0; k < BT_N_WARNINGS; k++)
        fprintf(out, "%-24s %s\n", bt_warning_rows[k].code, bt_warning_rows[k].meaning);
}

static void json_texts(bt_json *j, const char *name, const char *units, const char *description)
{
    bt_json_string(j, "name", name);
    bt_json_string(j, "units", units);
    bt_json_string(j, "description", description);
}

static void json_series(bt_json *j, const bt_quantity *q)
{
    bt_json_open(j, NULL, '{');
    json_texts(j, q->name, q->units, q->description);
    bt_json_string(j, "merge", bt_keep_names[q->keep]);
    bt_json_string(j, "applies", bt_applies_names[q->applies]);
    bt_json_string(j, "role", q->role == BT_ROLE_NONE ? NULL : bt_role_names[q->role]);
    bt_json_string(j, "label", q->label);
    bt_json_string(j, "summary", q->summary);
    bt_json_close(j, '}');
}

static void json_summary_key(bt_json *j, const char *prefix, const bt_json_key *k)
{
    char name[96];
    snprintf(name, sizeof name, "%s%s", prefix, k->key);
    bt_json_open(j, NULL, '{');
    json_texts(j, name, k->units, k->description);
    bt_json_bool(j, "number", k->kind != BT_JSON_TEXT && k->kind != BT_JSON_GROUP && k->kind != BT_JSON_WRITTEN);
    bt_json_bool(j, "machine", k->machine);
    bt_json_close(j, '}');
}

static void json_added(bt_json *j, const bt_quantity *q)
{
    bt_json_open(j, NULL, '{');
    json_texts(j, q->summary, q->units, q->description);
    bt_json_bool(j, "number", true);
    bt_json_bool(j, "machine", false);
    bt_json_close(j, '}');
}

static void json_estimate(bt_json *j, const bt_estimate_def *d)
{
    bt_json_open(j, NULL, '{');
    bt_json_string(j, "name", d->name);
    bt_json_string(j, "label", d->label);
    bt_json_string(j, "kind", bt_estimate_kind_name(d));
    bt_json_string(j, "units", "N");
    bt_json_string(j, "formula", d->formula);
    bt_json_string(j, "source", d->source);
    bt_json_close(j, '}');
}

void bt_quantities_list_json(void *stream)
{
    bt_json j = {0};
    bt_json_open(&j, NULL, '{');
    bt_json_open(&j, "series", '[');
    for (int k = 0; k < bt_n_series(); k++) json_series(&j, bt_series(k));
    bt_json_close(&j, ']');
    bt_json_open(&j, "summary", '[');
    for (int t = 0, n; t < N_TABLES; t++) {
        const bt_json_key *keys = table(t, &n);
        for (const bt_json_key *k = keys; k < keys + n; k++)
            if (k->kind != BT_JSON_ADDED) json_summary_key(&j, tables[t].prefix, k);
    }
    for (int k = 0; k < bt_n_added(); k++) json_added(&j, bt_added(k));
    bt_json_close(&j, ']');
    bt_json_open(&j, "estimates", '[');
    for (int k = 0; k < bt_n_estimates(); k++) json_estimate(&j, bt_estimate_of(k));
    bt_json_close(&j, ']');
    bt_json_open(&j, "warnings", '[');
    for (int k = 0; k < BT_N_WARNINGS; k++) {
        bt_json_open(&j, NULL, '{');
        json_texts(&j, bt_warning_rows[k].code, "", bt_warning_rows[k].meaning);
        bt_json_close(&j, '}');
    }
    bt_json_close(&j, ']');
    bt_json_close(&j, '}');
    fputs(j.text, stream);
    bt_json_free(&j);
}
