// SPDX-License-Identifier: MIT
// Writing a case: the resolved file, and the table of keys for --list-keys.
#include "base/json.h"
#include "base/inside.h"
#include "base/largest.h"
#include "case/case_base.h"
#include "case/schema.h"

#include <string.h>

// Open the sections of a dotted name that the previous name is not in; returns the last part of the name.
static const char *open_sections(FILE *out, const char *previous, const char *name, int *depth)
{
    *depth = 0;
    bool same = true;
    for (const char *dot; (dot = strchr(name, '.')); name = dot + 1, ++*depth) {
        size_t n = (size_t)(dot - name) + 1;
        same = same && !strncmp(previous, name, n);
        if (same) previous += n;
        else fprintf(out, "%s%*s%.*s:\n", *depth ? "" : "\n", 2 * *depth, "", (int)n - 1, name);
    }
    return name;
}

static void write_floes(const bt_case *input, FILE *out)
{
    if (!input->n_floes) return;
    fputs("\nfloes:\n", out);
    for (bt_idx i = 0; i < input->n_floes; i++)
        for (int k = 0; k < bt_n_floe_keys; k++) {
            fprintf(out, "%s%s: ", k ? "    " : "  - ", bt_floe_keys[k].name);
            bt_value_write(&bt_floe_keys[k], &input->floes[i], out);
            fputc('\n', out);
        }
}

char *bt_case_resolved(const bt_case *input)
{
    BT_PLAIN_NUMBERS;
    return bt_case_text(input, BT_CASE_RESOLVED_HEAD);
}

static void json_value(bt_json *json, const bt_key *key, const bt_case *input)
{
    const bt_value value = bt_value_of(key, input);
    switch (key->type) {
    case BT_KEY_REAL: bt_json_number(json, key->name, value.number); break;
    case BT_KEY_INT: bt_json_int(json, key->name, value.whole); break;
    case BT_KEY_BOOL: bt_json_bool(json, key->name, value.number != 0); break;
    case BT_KEY_CHOICE:
    case BT_KEY_TEXT: bt_json_string(json, key->name, value.text); break;
    case BT_KEY_MAP: break;
    case BT_KEY_POINTS:
        if (!value.n) {
            bt_json_string(json, key->name, NULL);
            break;
        }
        bt_json_open(json, key->name, '[');
        for (int i = 0; i < value.n; i++) {
            bt_json_open(json, NULL, '[');
            bt_json_number(json, NULL, value.points[2 * i]);
            bt_json_number(json, NULL, value.points[2 * i + 1]);
            bt_json_close(json, ']');
        }
        bt_json_close(json, ']');
    }
}

char *bt_case_resolved_json(const bt_case *input)
{
    BT_PLAIN_NUMBERS;
    bt_json json = {0};
    bt_json_open(&json, NULL, '{');
    const int n = bt_n_case_keys - bt_schema_added() + input->n_extra;
    for (int k = 0; k < n; k++) json_value(&json, &bt_case_keys[k], input);
    bt_json_close(&json, '}');
    return json.text;
}

char *bt_case_text(const bt_case *input, const char *head)
{
    BT_PLAIN_NUMBERS;
    bt_text text;
    bt_text_begin(&text);
    FILE *out = text.out;
    fputs(head, out);
    const char *previous = "";
    const int n = bt_n_case_keys - bt_schema_added() + input->n_extra; // it has no values of laws added later
    for (int k = 0; k < n; k++) {
        const bt_key *key = &bt_case_keys[k];
        int depth;
        const char *name = open_sections(out, previous, key->name, &depth);
        fprintf(out, "%*s%s: ", 2 * depth, "", name);
        bt_value_write(key, input, out);
        fprintf(out, "  # %s\n", key->doc);
        previous = key->name;
    }
    write_floes(input, out);
    return bt_text_end(&text);
}

static void list_keys(FILE *out, const bt_key *keys, int n)
{
    char options[128];
    for (int i = 0; i < n; i++) {
        const bt_key *key = &keys[i];
        const char *unit = bt_units_bare(key->unit), *range = key->range ? key->range : "-";
        if (key->type == BT_KEY_INT) unit = "integer";
        if (key->type == BT_KEY_TEXT) unit = "text";
        if (key->type == BT_KEY_MAP) unit = "map";
        if (key->type == BT_KEY_BOOL) unit = "bool", range = "true | false";
        if (key->type == BT_KEY_CHOICE) {
            unit = "choice";
            *options = 0;
            for (int j = 0; key->choices[j]; j++)
                snprintf(options + strlen(options), sizeof options - strlen(options), "%s%s", j ? " | " : "",
                         key->choices[j]);
            range = options;
        }
        const char *preset = key->preset ? key->preset : "required", *rule = preset[0] == '=' ? preset : NULL;
        fprintf(out, "%-24s %-8s %-10s %-36s %s%s%s%s\n", key->name, unit, rule ? "follows" : preset, range, key->doc,
                rule ? "; default: " : "", rule ? rule + 2 : "",
                key->at_sea ? "; no default in the geographic frame" : "");
    }
}

void bt_case_list_keys(void *stream)
{
    BT_PLAIN_NUMBERS;
    FILE *out = stream;
    fprintf(out, "%-24s %-8s %-10s %-36s %s\n", "key", "unit", "default", "range", "meaning");
    list_keys(out, bt_case_keys, bt_n_case_keys);
    fputs("\n"
          "The unit is that of a number written without one. A default that follows from other keys is given in the "
          "meaning.\n"
          "floes: is a list of floes given by hand; each is a map with these keys\n\n",
          out);
    list_keys(out, bt_floe_keys, bt_n_floe_keys);
    fputs("\nA case file may be based on another case file and override its keys\n\n", out);
    list_keys(out, &bt_base_key, 1);
    fputs("\nA study file, for bergtow ensemble, has these keys in place of sections; maps are shown in "
          "cases/studies/*.yml\n\n",
          out);
    list_keys(out, bt_study_keys, bt_n_study_keys);
    bt_largest_print(out);
}

/// Bounds of a key in the unit of a number without one, and whether each bound itself is excluded.
static void json_range(bt_json *json, const bt_key *key)
{
    bt_key bare = *key;
    bare.unit = BT_UNIT_NONE;
    bt_range range;
    if (!key->range || !bt_value_range(&bare, &range)) return;
    bt_json_number(json, "least", range.lo);
    bt_json_bool(json, "above_least", range.lo_open);
    bt_json_number(json, "most", range.hi);
    bt_json_bool(json, "below_most", range.hi_open);
}

static void json_keys(bt_json *json, const char *name, const bt_key *keys, int n)
{
    static const char *const types[] = {[BT_KEY_REAL] = "real", [BT_KEY_INT] = "integer",   [BT_KEY_BOOL] = "bool",
                                        [BT_KEY_TEXT] = "text", [BT_KEY_CHOICE] = "choice", [BT_KEY_POINTS] = "points",
                                        [BT_KEY_MAP] = "map"};
    bt_json_open(json, name, '[');
    for (int i = 0; i < n; i++) {
        const bt_key *key = &keys[i];
        const bool number = key->type == BT_KEY_REAL || key->type == BT_KEY_INT || key->type == BT_KEY_POINTS,
                   rule = key->preset && key->preset[0] == '=';
        bt_json_open(json, NULL, '{');
        bt_json_string(json, "name", key->name);
        bt_json_string(json, "type", types[key->type]);
        bt_json_bool(json, "required", !key->preset);
        bt_json_string(json, "default", rule ? NULL : key->preset);
        bt_json_string(json, "follows", rule ? key->preset + 2 : NULL);
        bt_json_bool(json, "default_at_sea", key->preset && !key->at_sea);
        if (number) bt_json_string(json, "unit", key->type == BT_KEY_INT ? "" : bt_units_bare(key->unit));
        if (number) json_range(json, key);
        if (key->type == BT_KEY_CHOICE) {
            bt_json_open(json, "choices", '[');
            for (int c = 0; key->choices[c]; c++) bt_json_string(json, NULL, key->choices[c]);
            bt_json_close(json, ']');
        }
        bt_json_string(json, "doc", key->doc);
        bt_json_close(json, '}');
    }
    bt_json_close(json, ']');
}

void bt_case_list_keys_json(void *stream)
{
    BT_PLAIN_NUMBERS;
    bt_json json = {0};
    bt_json_open(&json, NULL, '{');
    json_keys(&json, "keys", bt_case_keys, bt_n_case_keys);
    json_keys(&json, "floe_keys", bt_floe_keys, bt_n_floe_keys);
    json_keys(&json, "file_keys", &bt_base_key, 1);
    json_keys(&json, "study_keys", bt_study_keys, bt_n_study_keys);
    bt_json_open(&json, "units", '[');
    bt_unit_entry unit;
    for (int k = 0; bt_units_entry(k, &unit); k++) {
        bt_json_open(&json, NULL, '{');
        bt_json_string(&json, "symbol", unit.symbol);
        bt_json_string(&json, "si", bt_units_symbol(unit.kind));
        bt_json_number(&json, "up", unit.up);
        bt_json_number(&json, "down", unit.down);
        bt_json_close(&json, '}');
    }
    bt_json_close(&json, ']');
    bt_json_close(&json, '}');
    fputs(json.text, stream);
    bt_json_free(&json);
}
