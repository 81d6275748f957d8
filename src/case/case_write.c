// SPDX-License-Identifier: MIT
// Writing of a case: the resolved file, and the table of keys for --list-keys.
#include "base/json.h"
#include "base/largest.h"
#include "case/case_base.h"
#include "case/schema.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Open the sections of a dotted name that the previous name was not in; returns the name's last part.
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

static void write_floes(const bt_case *c, FILE *out)
{
    if (!c->n_floes) return;
    fputs("\nfloes:\n", out);
    for (bt_idx i = 0; i < c->n_floes; i++)
        for (int k = 0; k < bt_n_floe_keys; k++) {
            fprintf(out, "%s%s: ", k ? "    " : "  - ", bt_floe_keys[k].name);
            bt_value_write(&bt_floe_keys[k], &c->floes[i], out);
            fputc('\n', out);
        }
}

char *bt_case_resolved(const bt_case *c)
{
    return bt_case_text(c, BT_CASE_RESOLVED_HEAD);
}

/// The member of a key, of `size` bytes.
static void member_of(const bt_case *c, const bt_key *k, void *out, size_t size)
{
    memcpy(out, (const char *)c + k->offset, size);
}

static void json_value(bt_json *j, const bt_key *k, const bt_case *c)
{
    union {
        double real;
        int64_t integer;
        bool yes;
        unsigned choice;
        const char *text;
        const double *points;
    } v;
    switch (k->type) {
    case BT_KEY_REAL: member_of(c, k, &v.real, sizeof v.real), bt_json_number(j, k->name, v.real); break;
    case BT_KEY_INT: member_of(c, k, &v.integer, sizeof v.integer), bt_json_int(j, k->name, v.integer); break;
    case BT_KEY_BOOL: member_of(c, k, &v.yes, sizeof v.yes), bt_json_bool(j, k->name, v.yes); break;
    case BT_KEY_CHOICE:
        member_of(c, k, &v.choice, sizeof v.choice);
        bt_json_string(j, k->name, k->choices[v.choice]);
        break;
    case BT_KEY_TEXT: member_of(c, k, &v.text, sizeof v.text), bt_json_string(j, k->name, v.text); break;
    case BT_KEY_MAP: break;
    case BT_KEY_POINTS: {
        int n;
        member_of(c, k, &v.points, sizeof v.points);
        memcpy(&n, (const char *)c + k->offset_count, sizeof n);
        if (!n) {
            bt_json_raw(j, k->name, "null");
            break;
        }
        bt_json_open(j, k->name, '[');
        for (int i = 0; i < n; i++) {
            bt_json_open(j, NULL, '[');
            bt_json_number(j, NULL, v.points[2 * i]);
            bt_json_number(j, NULL, v.points[2 * i + 1]);
            bt_json_close(j, ']');
        }
        bt_json_close(j, ']');
    }
    }
}

char *bt_case_resolved_json(const bt_case *c)
{
    bt_json j = {0};
    bt_json_open(&j, NULL, '{');
    const int n = bt_n_case_keys - bt_schema_added() + c->n_extra;
    for (int k = 0; k < n; k++) json_value(&j, &bt_case_keys[k], c);
    bt_json_close(&j, '}');
    return j.text;
}

char *bt_case_text(const bt_case *c, const char *head)
{
    bt_text text;
    bt_text_begin(&text);
    FILE *out = text.out;
    fputs(head, out);
    const char *previous = "";
    const int n = bt_n_case_keys - bt_schema_added() + c->n_extra; // of a law that came later it has no values
    for (int k = 0; k < n; k++) {
        const bt_key *key = &bt_case_keys[k];
        int depth;
        const char *name = open_sections(out, previous, key->name, &depth);
        fprintf(out, "%*s%s: ", 2 * depth, "", name);
        bt_value_write(key, c, out);
        fprintf(out, "  # %s\n", key->doc);
        previous = key->name;
    }
    write_floes(c, out);
    return bt_text_end(&text);
}

static void list_keys(FILE *out, const bt_key *keys, int n)
{
    char options[128];
    for (int i = 0; i < n; i++) {
        const bt_key *k = &keys[i];
        const char *unit = bt_units_bare(k->unit), *range = k->range ? k->range : "-";
        if (k->type == BT_KEY_INT) unit = "integer";
        if (k->type == BT_KEY_TEXT) unit = "text";
        if (k->type == BT_KEY_MAP) unit = "map";
        if (k->type == BT_KEY_BOOL) unit = "bool", range = "true | false";
        if (k->type == BT_KEY_CHOICE) {
            unit = "choice";
            *options = 0;
            for (int j = 0; k->choices[j]; j++)
                snprintf(options + strlen(options), sizeof options - strlen(options), "%s%s", j ? " | " : "",
                         k->choices[j]);
            range = options;
        }
        const char *preset = k->preset ? k->preset : "required", *rule = preset[0] == '=' ? preset : NULL;
        fprintf(out, "%-24s %-8s %-10s %-36s %s%s%s%s\n", k->name, unit, rule ? "follows" : preset, range, k->doc,
                rule ? "; default: " : "", rule ? rule + 2 : "",
                k->at_sea ? "; no default in the geographic frame" : "");
    }
}

void bt_case_list_keys(void *stream)
{
    FILE *out = stream;
    fprintf(out, "%-24s %-8s %-10s %-36s %s\n", "key", "unit", "default", "range", "meaning");
    list_keys(out, bt_case_keys, bt_n_case_keys);
    fputs("\nUnit is that of a number written without one. A default that follows from other keys is given in the "
          "meaning.\n"
          "floes: is a list of floes given by hand, each a map with the keys\n\n",
          out);
    list_keys(out, bt_floe_keys, bt_n_floe_keys);
    fputs("\nA case file may begin with another one, and keep or replace its keys\n\n", out);
    list_keys(out, &bt_base_key, 1);
    fputs("\nA study file, for bergtow ensemble, has these keys in place of sections; maps are shown in "
          "cases/studies/*.yml\n\n",
          out);
    list_keys(out, bt_study_keys, bt_n_study_keys);
    bt_largest_print(out);
}

/// Least and most value in the unit of a number without one, and whether the value itself is left out.
static void json_range(bt_json *j, const bt_key *k)
{
    bt_key bare = *k;
    bare.unit = BT_UNIT_NONE;
    bt_range r;
    if (!k->range || !bt_value_range(&bare, &r)) return;
    bt_json_number(j, "least", r.lo);
    bt_json_bool(j, "above_least", r.lo_open);
    bt_json_number(j, "most", r.hi);
    bt_json_bool(j, "below_most", r.hi_open);
}

static void json_keys(bt_json *j, const char *name, const bt_key *keys, int n)
{
    static const char *const types[] = {[BT_KEY_REAL] = "real", [BT_KEY_INT] = "integer",   [BT_KEY_BOOL] = "bool",
                                        [BT_KEY_TEXT] = "text", [BT_KEY_CHOICE] = "choice", [BT_KEY_POINTS] = "points",
                                        [BT_KEY_MAP] = "map"};
    bt_json_open(j, name, '[');
    for (int i = 0; i < n; i++) {
        const bt_key *k = &keys[i];
        const bool number = k->type == BT_KEY_REAL || k->type == BT_KEY_INT || k->type == BT_KEY_POINTS,
                   rule = k->preset && k->preset[0] == '=';
        bt_json_open(j, NULL, '{');
        bt_json_string(j, "name", k->name);
        bt_json_string(j, "type", types[k->type]);
        bt_json_bool(j, "required", !k->preset);
        bt_json_string(j, "default", rule ? NULL : k->preset);
        bt_json_string(j, "follows", rule ? k->preset + 2 : NULL);
        bt_json_bool(j, "default_at_sea", k->preset && !k->at_sea);
        if (number) bt_json_string(j, "unit", k->type == BT_KEY_INT ? "" : bt_units_bare(k->unit));
        if (number) json_range(j, k);
        if (k->type == BT_KEY_CHOICE) {
            bt_json_open(j, "choices", '[');
            for (int c = 0; k->choices[c]; c++) bt_json_string(j, NULL, k->choices[c]);
            bt_json_close(j, ']');
        }
        bt_json_string(j, "doc", k->doc);
        bt_json_close(j, '}');
    }
    bt_json_close(j, ']');
}

void bt_case_list_keys_json(void *stream)
{
    bt_json j = {0};
    bt_json_open(&j, NULL, '{');
    json_keys(&j, "keys", bt_case_keys, bt_n_case_keys);
    json_keys(&j, "floe_keys", bt_floe_keys, bt_n_floe_keys);
    json_keys(&j, "file_keys", &bt_base_key, 1);
    json_keys(&j, "study_keys", bt_study_keys, bt_n_study_keys);
    bt_json_open(&j, "units", '[');
    bt_unit_entry u;
    for (int k = 0; bt_units_entry(k, &u); k++) {
        bt_json_open(&j, NULL, '{');
        bt_json_string(&j, "symbol", u.symbol);
        bt_json_string(&j, "si", bt_units_symbol(u.kind));
        bt_json_number(&j, "up", u.up);
        bt_json_number(&j, "down", u.down);
        bt_json_close(&j, '}');
    }
    bt_json_close(&j, ']');
    bt_json_close(&j, '}');
    fputs(j.text, stream);
    bt_json_free(&j);
}
