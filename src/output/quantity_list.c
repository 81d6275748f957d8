// SPDX-License-Identifier: MIT
// The registry as text and JSON: all names come from the tables.

#include "case/warning.h"
#include "output/estimate_text.h"
#include "output/summary_keys.h"

/// The tables of summary.json, and the prefixes of their keys; bt_summary_keys makes the first.
static const struct { const char *prefix; const bt_json_key *keys; const int *n; } tables[] = {
    {"", NULL, NULL},
    {"window.series.NAME.", bt_reported_keys, &bt_n_reported_keys},
    {"estimates.", bt_condition_keys, &bt_n_condition_keys},
    {"estimates.NAME.", bt_estimate_keys, &bt_n_estimate_keys},
};
enum { N_TABLES = sizeof tables / sizeof *tables };

/// Table t, 0 = the summary's own.
static const bt_json_key *table(int t, int *n) { return t ? (*n = *tables[t].n, tables[t].keys) : bt_summary_keys(n); }

/// Key i of summary.json with its whole name, registered quantities last; false after the last.
static bool summary_key(int i, bt_json_key *key, char name[96])
{
    for (int t = 0, n; t < N_TABLES; t++, i -= n) {
        const bt_json_key *keys = table(t, &n);
        if (i >= n) continue;
        *key = keys[i];
        snprintf(name, 96, "%s%s", tables[t].prefix, key->key);
        return true;
    }
    if (i >= bt_n_added()) return false;
    *key = (bt_json_key){.units = bt_added(i)->units, .description = bt_added(i)->description, .kind = BT_JSON_REAL};
    snprintf(name, 96, "%s", bt_added(i)->summary);
    return true;
}

static void list_series(FILE *out)
{
    fprintf(out, "%-24s %-6s %-5s %-32s %s\n", "series", "units", "merge", "applies", "meaning");
    for (int k = 0; k < bt_n_series(); k++) {
        const bt_quantity *quantity = bt_series(k);
        fprintf(out, "%-24s %-6s %-5s %-32s %s", quantity->name, quantity->units, bt_keep_names[quantity->keep],
                bt_applies_names[quantity->applies], quantity->description);
        fprintf(out, quantity->summary ? "; %s in the summary\n" : "\n", quantity->summary);
    }
}

static void list_summary(FILE *out)
{
    fprintf(out, "\n%-46s %-6s %s\n", "summary.json", "units", "meaning");
    bt_json_key key;
    char name[96];
    for (int i = 0; summary_key(i, &key, name); i++)
        if (key.kind != BT_JSON_ADDED) fprintf(out, "%-46s %-6s %s\n", name, key.units, key.description);
}

void bt_quantities_list(void *stream)
{
    FILE *out = stream;
    list_series(out);
    list_summary(out);
    fprintf(out, "\n%-24s %-15s %-24s %s\n", "estimate", "kind", "label", "formula; source");
    for (int k = 0; k < bt_n_estimates(); k++) {
        const bt_estimate_def *def = bt_estimate_of(k);
        fprintf(out, "%-24s %-15s %-24s %s; %s\n", def->name, bt_estimate_kind_name(def), def->label, def->formula,
                def->source);
    }
    fprintf(out, "\n%-24s %s\n", "warning, reason", "meaning");
    for (int k = 0; k < BT_N_WARNINGS; k++)
        fprintf(out, "%-24s %s\n", bt_warning_rows[k].code, bt_warning_rows[k].meaning);
}

static void json_texts(bt_json *json, const char *name, const char *units, const char *description)
{
    bt_json_string(json, "name", name);
    bt_json_string(json, "units", units);
    bt_json_string(json, "description", description);
}

static void json_series(bt_json *json, const bt_quantity *quantity)
{
    bt_json_open(json, NULL, '{');
    json_texts(json, quantity->name, quantity->units, quantity->description);
    bt_json_string(json, "merge", bt_keep_names[quantity->keep]);
    bt_json_string(json, "applies", bt_applies_names[quantity->applies]);
    bt_json_string(json, "role", quantity->role == BT_ROLE_NONE ? NULL : bt_role_names[quantity->role]);
    bt_json_string(json, "label", quantity->label);
    bt_json_string(json, "summary", quantity->summary);
    bt_json_close(json, '}');
}

static void json_summary_key(bt_json *json, const char *name, const bt_json_key *key)
{
    bt_json_open(json, NULL, '{');
    json_texts(json, name, key->units, key->description);
    bt_json_bool(json, "number", key->kind != BT_JSON_TEXT && key->kind != BT_JSON_GROUP &&
                 key->kind != BT_JSON_WRITTEN);
    bt_json_bool(json, "machine", key->machine);
    bt_json_close(json, '}');
}

static void json_estimate(bt_json *json, const bt_estimate_def *def)
{
    bt_json_open(json, NULL, '{');
    bt_json_string(json, "name", def->name);
    bt_json_string(json, "label", def->label);
    bt_json_string(json, "kind", bt_estimate_kind_name(def));
    bt_json_string(json, "units", "N");
    bt_json_string(json, "formula", def->formula);
    bt_json_string(json, "source", def->source);
    bt_json_close(json, '}');
}

void bt_quantities_list_json(void *stream)
{
    bt_json json = {0};
    bt_json_open(&json, NULL, '{');
    bt_json_open(&json, "series", '[');
    for (int k = 0; k < bt_n_series(); k++) json_series(&json, bt_series(k));
    bt_json_close(&json, ']');
    bt_json_open(&json, "summary", '[');
    bt_json_key key;
    char name[96];
    for (int i = 0; summary_key(i, &key, name); i++)
        if (key.kind != BT_JSON_ADDED) json_summary_key(&json, name, &key);
    bt_json_close(&json, ']');
    bt_json_open(&json, "estimates", '[');
    for (int k = 0; k < bt_n_estimates(); k++) json_estimate(&json, bt_estimate_of(k));
    bt_json_close(&json, ']');
    bt_json_open(&json, "warnings", '[');
    for (int k = 0; k < BT_N_WARNINGS; k++) {
        bt_json_open(&json, NULL, '{');
        json_texts(&json, bt_warning_rows[k].code, "", bt_warning_rows[k].meaning);
        bt_json_close(&json, '}');
    }
    bt_json_close(&json, ']');
    bt_json_close(&json, '}');
    fputs(json.text, stream);
    bt_json_free(&json);
}
