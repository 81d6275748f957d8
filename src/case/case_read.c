// SPDX-License-Identifier: MIT
// Reading a case: file and --set overrides by the schema, with all errors of the case reported at once.
#include "case/case_check.h"

#include "bergtow/shape.h"
#include "base/fileio.h"
#include "base/inside.h"
#include "base/json.h"
#include "base/largest.h"
#include "case/case_base.h"
#include "case/schema.h"
#include "base/table.h"
#include "base/tree.h"

#include <ctype.h>
#include <string.h>

typedef struct {
    bt_case *c;
    const char *path;         // of the file being read
    bt_errors *err;
    bt_origin *from;          // [bt_n_case_keys]
    const bt_node **given;    // [bt_n_case_keys] the value of each key, or NULL
    const bt_node *floes;
    const char *floes_path;
} reader;

void bt_case_defaults(bt_case *input)
{
    BT_PLAIN_NUMBERS;
    *input = (bt_case){0};
    bt_schema_preset(bt_case_keys, bt_n_case_keys, input);
    input->n_extra = bt_schema_added();
}

/// Does a text begin with a key of this section (with its dot), followed by more?
static bool begins_with_key(const bt_key *keys, int n, const char *section, const char *text)
{
    char name[160];
    const size_t word = strcspn(text, " \t:");
    snprintf(name, sizeof name, "%.60s%.*s", section, word < 90 ? (int)word : 90, text);
    return text[word] && (bt_schema_find(keys, n, name) >= 0 || bt_schema_is_section(name));
}

/// Report a text that is "key value", or "key:value" within { }; the remedy shows its key without the sections.
static void colon_missing(reader *in, int line, const char *section, const char *text)
{
    const size_t word = strcspn(text, " \t:");
    size_t own = word;
    while (own && text[own - 1] != '.') own--;
    const int n = word - own > 60 ? 60 : (int)(word - own);
    bt_errors_add(in->err, "%s:%d: %s%.64s: a colon%s is missing after the key; write %.*s: and then the value",
                  in->path, line, section, text, text[word] == ':' ? " with a space" : "", n, text + own);
}

static void unknown_key(reader *in, const bt_key *keys, int n, int line, const char *where, const char *name)
{
    char buffer[64];
    if (begins_with_key(keys, n, "", name)) {
        colon_missing(in, line, where, name);
        return;
    }
    const char *near = bt_schema_suggest(keys, n, name, buffer);
    if (near)
        bt_errors_add(in->err, "%s:%d: %s%.64s: unknown key; did you mean %s?", in->path, line, where, name, near);
    else bt_errors_add(in->err, "%s:%d: %s%.64s: unknown key; see bergtow --list-keys", in->path, line, where, name);
}

static bool is_nothing(const bt_node *node)
{
    return node->kind == BT_NODE_SCALAR && node->plain &&
           (!*node->text || !strcmp(node->text, "~") || !strcmp(node->text, "null"));
}

/// Is the value of a section "key value", without the colon?
static bool lacks_colon(const bt_node *value, const char *name)
{
    char section[164];
    snprintf(section, sizeof section, "%s.", name);
    return value->kind == BT_NODE_SCALAR && value->plain &&
           begins_with_key(bt_case_keys, bt_n_case_keys, section, value->text);
}

/// Record the value of a key in the file being read; a value in a file based on this one takes precedence.
static void give(reader *in, int k, const bt_node *value, int line)
{
    if (!in->given[k]) {
        in->given[k] = value;
        in->from[k].line = line;
        in->from[k].file = in->path;
    } else if (in->from[k].file == in->path) {
        bt_errors_add(in->err, "%s:%d: %s: duplicate key, first given in line %d; remove one of them", in->path, line,
                      bt_case_keys[k].name, in->from[k].line);
    }
}

/// Report a decimal comma within { }, which cuts a number in two: `thickness: 0`, and a key `8 m` without a value.
/// section: of the map, or "".
static bool is_after_comma(reader *in, const bt_node *map, int i, const char *section)
{
    const bt_node *left = i > 0 ? map->item[i - 1] : NULL;
    const size_t n = left && left->kind == BT_NODE_SCALAR ? strlen(left->text) : 0;
    if (!n || !isdigit((unsigned char)left->text[n - 1]) || !isdigit((unsigned char)*map->key[i]) ||
        !is_nothing(map->item[i]))
        return false;
    bt_errors_add(in->err, "%s:%d: %s%s%.60s: %.20s,%.20s has a comma; write decimals with a point, as in %.20s.%.20s",
                  in->path, map->key_line[i], section, *section ? "." : "", map->key[i - 1], left->text, map->key[i],
                  left->text, map->key[i]);
    return true;
}

// Sort the entries of a map into the table of given values. Names may be nested (tow: {speed: 1}) or dotted (tow.speed:
// 1).
static void walk(reader *in, const bt_node *map, const char *prefix)
{
    for (int i = 0; i < map->n; i++) {
        char name[160];
        int line = map->key_line[i];
        const bt_node *value = map->item[i];
        snprintf(name, sizeof name, "%s%s%.90s", prefix, *prefix ? "." : "", map->key[i]);
        int k = bt_schema_find(bt_case_keys, bt_n_case_keys, name);
        if (k >= 0) {
            give(in, k, value, line);
        } else if (!strcmp(name, "floes")) {
            if (!in->floes) in->floes = value, in->floes_path = in->path;
        } else if (!strcmp(name, "base")) {
            continue; // done by bt_case_files_read
        } else if (is_after_comma(in, map, i, prefix)) {
            continue;
        } else if (!bt_schema_is_section(name)) {
            unknown_key(in, bt_case_keys, bt_n_case_keys, line, "", name);
        } else if (value->kind == BT_NODE_MAP) {
            walk(in, value, name);
        } else if (lacks_colon(value, name)) {
            char section[164];
            snprintf(section, sizeof section, "%s.", name);
            colon_missing(in, value->line, section, value->text);
        } else if (!is_nothing(value)) {
            bt_errors_add(in->err, "%s:%d: %s: is a section and holds keys; write them indented below it", in->path,
                          line, name);
        }
    }
}

// Read a list of points [[x, y], ...] into base. where: start of the message.
static bool read_points(const bt_key *key, void *base, const bt_node *list, const char *where, bt_errors *err)
{
    if (list->kind == BT_NODE_SCALAR && list->plain && !strcmp(list->text, "none")) return true;
    if (list->kind != BT_NODE_LIST) {
        bt_errors_add(err, "%s: needs a list of points; give it as [[x, y], [x, y], ...]", where);
        return false;
    }
    const int least = key->least > 0 ? key->least : 3, most = key->most > 0 ? key->most : BT_MAX_VERTICES;
    if (list->n < least || list->n > most) {
        bt_errors_add(err, "%s: has %d points; a %s has %d to %d", where, list->n,
                      key->most > 0 ? "list here" : "polygon", least, most);
        return false;
    }
    double *p = bt_alloc((size_t)list->n, 2 * sizeof *p);
    bool good = true;
    for (int i = 0; i < list->n && good; i++) {
        const bt_node *point = list->item[i];
        good = point->kind == BT_NODE_LIST && point->n == 2 && point->item[0]->kind == BT_NODE_SCALAR &&
               point->item[1]->kind == BT_NODE_SCALAR;
        if (!good) bt_errors_add(err, "%s: point %d is not a pair; give it as [x, y]", where, i + 1);
        for (int j = 0; j < 2 && good; j++) {
            char why[BT_WHY];
            const bt_key column = bt_schema_column(key, j);
            good = bt_value_read_coordinate(&column, point->item[j]->text, &p[2 * i + j], why);
            if (!good) bt_errors_add(err, "%s: point %d: %s", where, i + 1, why);
        }
    }
    if (!good) {
        free(p);
        return false;
    }
    memcpy((char *)base + key->offset, &p, sizeof p);
    memcpy((char *)base + key->offset_count, &list->n, sizeof(int));
    return true;
}

static bool read_value(const bt_key *key, void *base, const bt_node *value, const char *where, bt_errors *err)
{
    if (key->type == BT_KEY_POINTS) return read_points(key, base, value, where, err);
    if (value->kind != BT_NODE_SCALAR) {
        bt_errors_add(err, "%s: is a %s, but needs a single value; write key: value", where,
                      value->kind == BT_NODE_MAP ? "section" : "list");
        return false;
    }
    char why[BT_WHY];
    if (bt_value_read(key, base, value->text, value->plain, why)) return true;
    bt_errors_add(err, "%s: %s", where, why);
    return false;
}

static void read_given(reader *in)
{
    for (int k = 0; k < bt_n_case_keys; k++) {
        const bt_key *key = &bt_case_keys[k];
        if (in->from[k].faulty || in->from[k].set) continue;
        if (!in->given[k]) {
            if (key->preset) continue;
            bt_errors_add(in->err, "%s: %s: missing, and it has no default; add it (%s)", in->path, key->name,
                          key->doc);
            in->from[k].faulty = true;
            continue;
        }
        char where[256];
        bt_case_locate(in->c, &in->from[k], key->name, where);
        in->from[k].faulty = !read_value(key, in->c, in->given[k], where, in->err);
    }
}

static bool read_floe(reader *in, const bt_node *map, int index, bt_floe_def *floe)
{
    char where[256], item[32];
    snprintf(item, sizeof item, "floes[%d].", index);
    if (map->kind != BT_NODE_MAP) {
        bt_errors_add(in->err, "%s:%d: floes[%d]: is not a map; write - {shape: disc, length: 1 m, x: 3 m, y: 0 m}",
                      in->path, map->line, index);
        return false;
    }
    size_t before = in->err->n;
    for (int i = 0; i < map->n; i++) {
        int k = bt_schema_find(bt_floe_keys, bt_n_floe_keys, map->key[i]);
        if (k < 0) {
            snprintf(where, sizeof where, "floes[%d]", index);
            if (is_after_comma(in, map, i, where)) continue;
            unknown_key(in, bt_floe_keys, bt_n_floe_keys, map->key_line[i], item, map->key[i]);
            continue;
        }
        snprintf(where, sizeof where, "%.180s:%d: %s%s", in->path, map->key_line[i], item, bt_floe_keys[k].name);
        read_value(&bt_floe_keys[k], floe, map->item[i], where, in->err);
    }
    for (int k = 0; k < bt_n_floe_keys; k++) {
        int at;
        const bool found = bt_floe_keys[k].preset || bt_tree_find(map, bt_floe_keys[k].name, &at);
        if (!found)
            bt_errors_add(in->err, "%s:%d: %s%s: missing, and it has no default; add it (%s)", in->path, map->line,
                          item, bt_floe_keys[k].name, bt_floe_keys[k].doc);
    }
    return in->err->n == before;
}

static void read_floes(reader *in)
{
    const bt_node *list = in->floes;
    if (!list || is_nothing(list)) return;
    in->path = in->floes_path;
    if (strcmp(in->path, in->c->path)) in->c->floes_path = bt_text_copy(in->path);
    if (list->kind != BT_NODE_LIST) {
        bt_errors_add(in->err, "%s:%d: floes: is not a list; begin each floe with - below it", in->path, list->line);
        return;
    }
    if (list->n > BT_MAX_FLOES_BY_HAND) {
        bt_errors_add(in->err,
                      "%s:%d: floes: has %d entries, more than the limit of %d; put large fields into an HDF5 file and "
                      "name it in ice.field",
                      in->path, list->line, list->n, BT_MAX_FLOES_BY_HAND);
        return;
    }
    in->c->floes = bt_alloc((size_t)list->n, sizeof *in->c->floes);
    const size_t before = in->err->n;
    for (int i = 0; i < list->n; i++) {
        if (in->err->n - before >= BT_MAX_COMPLAINTS) {
            bt_errors_add(in->err, "%s:%d: floes[%d]: the rest is not checked after %d errors; correct those first",
                          in->path, list->item[i]->line, i, BT_MAX_COMPLAINTS);
            return;
        }
        bt_floe_def floe = {.line = list->item[i]->line};
        bt_schema_preset(bt_floe_keys, bt_n_floe_keys, &floe);
        // A refused floe is left out so that the checks across keys do not complain about it a second time.
        if (read_floe(in, list->item[i], i, &floe)) in->c->floes[in->c->n_floes++] = floe;
        else bt_schema_release(bt_floe_keys, bt_n_floe_keys, &floe);
    }
}

/// Length of "ice.size" in "ice.size = 3 m".
static size_t key_length(const char *set)
{
    size_t n = strcspn(set, "=");
    while (n && set[n - 1] == ' ') n--;
    return n;
}

static void read_override(reader *in, const char *set, const char *place)
{
    const char *equals = strchr(set, '=');
    if (!equals || equals == set) {
        bt_errors_add(in->err, "%s%.80s: is not key=value; write %sice.concentration=0.5", place ? place : "--set ",
                      set, place ? "" : "--set ");
        return;
    }
    char name[96], where[256], why[BT_WHY], buffer[64];
    const size_t n = key_length(set);
    snprintf(name, sizeof name, "%.*s", n < 90 ? (int)n : 90, set);
    const char *value = equals + 1 + strspn(equals + 1, " ");
    bt_case_locate(in->c, &(bt_origin){.set = set, .place = place}, name, where);
    int k = bt_schema_find(bt_case_keys, bt_n_case_keys, name);
    if (k < 0) {
        const char *near = bt_schema_suggest(bt_case_keys, bt_n_case_keys, name, buffer);
        if (!strcmp(name, "base"))
            bt_errors_add(in->err, "%s: the base of a case cannot be set here; edit the case file", where);
        else if (!strcmp(name, "floes"))
            bt_errors_add(in->err, "%s: the list of floes cannot be set here; edit the case file", where);
        else if (bt_schema_is_section(name))
            bt_errors_add(in->err, "%s: %s is a section; set one of its keys, see bergtow --list-keys", where, name);
        else if (near) bt_errors_add(in->err, "%s: unknown key; did you mean %s?", where, near);
        else bt_errors_add(in->err, "%s: unknown key; see bergtow --list-keys", where);
        return;
    }
    in->from[k].set = set;
    in->from[k].place = place;
    in->from[k].line = 0;
    in->from[k].file = NULL;
    if (bt_case_keys[k].type != BT_KEY_POINTS) {
        in->from[k].faulty = !bt_value_read(&bt_case_keys[k], in->c, value, true, why);
        if (in->from[k].faulty) bt_errors_add(in->err, "%s: %s", where, why);
        return;
    }
    bt_schema_release(&bt_case_keys[k], 1, in->c); // of an earlier override of this key
    memset((char *)in->c + bt_case_keys[k].offset_count, 0, sizeof(int));
    bt_node *points = bt_tree_parse(value, strlen(value), where, in->err);
    in->from[k].faulty = !points || !read_points(&bt_case_keys[k], in->c, points, where, in->err);
    bt_tree_free(points);
}

/// Set the defaults, and the file name for messages.
static void begin_case(bt_case *input, const char *path)
{
    bt_case_defaults(input);
    input->path = bt_text_copy(path);
}

/// Is the override the last one of its key, which takes effect?
static bool holds(const char *const *overrides, int i, int n)
{
    const size_t own = key_length(overrides[i]);
    for (int k = i + 1; k < n; k++)
        if (key_length(overrides[k]) == own && !memcmp(overrides[i], overrides[k], own)) return false;
    return strchr(overrides[i], '=');
}

/// The texts of the files, followed by the overrides as a separate document: from it a reader of a result, also of a
/// resumed run, can tell whether a comment in the files belongs to the value that was run.
static char *text_as_given(const bt_case_files *files, const char *const *overrides, int n)
{
    char *text = bt_case_files_text(files);
    if (n == 0) return text;
    bt_json json = {0};
    bt_json_open(&json, NULL, '{');
    bt_json_open(&json, "set", '{');
    for (int i = 0; i < n; i++) {
        if (!holds(overrides, i, n)) continue;
        char *key = bt_text_of("%.*s", (int)key_length(overrides[i]), overrides[i]);
        const char *value = strchr(overrides[i], '=') + 1;
        bt_json_string(&json, key, value + strspn(value, " "));
        free(key);
    }
    bt_json_close(&json, '}');
    bt_json_close(&json, '}');
    char *both = bt_text_of("%s\n--- # given beside the file\n%s", text, json.text);
    bt_json_free(&json);
    free(text);
    return both;
}

/// Read the values of `input` from its text.
static bt_status read_text(bt_case *input, size_t size, bool alone, const char *const *overrides,
                           const char *const *place, int n, bt_errors *err)
{
    if (!err) { // nobody is to hear the faults, but they are counted
        bt_errors unheard = {0};
        const bt_status status = read_text(input, size, alone, overrides, place, n, &unheard);
        bt_errors_free(&unheard);
        return status;
    }
    const size_t before = err->n;
    if (!bt_keys_sound(err)) return BT_ERR_CASE;
    bt_case_files files;
    bt_status status = bt_case_files_read(&files, input->path, input->text, size, alone, err);
    free(input->text);
    input->text = text_as_given(&files, overrides, n);
    if (status != BT_OK) {
        bt_case_files_free(&files);
        return status;
    }
    reader in = {.c = input, .err = err, .from = bt_alloc((size_t)bt_n_case_keys, sizeof(bt_origin)),
                 .given = bt_alloc((size_t)bt_n_case_keys, sizeof(bt_node *))};
    for (int i = 0; i < files.n; i++) {
        in.path = files.file[i].path;
        walk(&in, files.file[i].root, "");
    }
    in.path = input->path;
    for (int i = 0; i < n; i++) read_override(&in, overrides[i], place ? place[i] : NULL);
    for (int k = 0; place && k < bt_n_case_keys; k++) // not given: other members may have other values
        if (!in.given[k] && !in.from[k].set) in.from[k].place = "";
    read_given(&in);
    read_floes(&in);
    size_t in_file = err->n;
    status = bt_case_check(input, in.from, err);
    if (in_file > before) status = BT_ERR_CASE;
    free(in.from);
    free(in.given);
    bt_case_files_free(&files);
    return status;
}

bt_status bt_case_read(bt_case *input, const char *path, const char *const *overrides, int n, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    return bt_case_read_placed(input, path, overrides, NULL, n, err);
}

bt_status bt_case_read_placed(bt_case *input, const char *path, const char *const *overrides, const char *const *place,
                              int n, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    size_t size;
    begin_case(input, path);
    const bt_status status = bt_file_read(path, "a case file", &input->text, &size, err);
    return status == BT_OK ? read_text(input, size, false, overrides, place, n, err) : status;
}

bt_status bt_case_read_text(bt_case *input, const char *path, const char *text, const char *const *overrides,
                            const char *const *place, int n, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    begin_case(input, path);
    const size_t size = strlen(text);
    input->text = memcpy(bt_alloc(size + 1, 1), text, size + 1);
    return read_text(input, size, false, overrides, place, n, err);
}

static void keep_table(bt_table *table, const bt_table *from)
{
    if (from->n == 0) return;
    table->n = from->n;
    table->row = bt_alloc((size_t)table->n, 3 * sizeof *table->row);
    memcpy(table->row, from->row, (size_t)table->n * 3 * sizeof *table->row);
}

bt_status bt_case_read_kept(bt_case *input, const char *path, const char *text, const bt_table *current,
                            const bt_table *wind, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    begin_case(input, path);
    input->text = bt_text_copy(text);
    keep_table(&input->water.table, current);
    keep_table(&input->air.table, wind);
    return read_text(input, strlen(text), true, NULL, NULL, 0, err);
}

void bt_case_free(bt_case *input)
{
    bt_schema_release(bt_case_keys, bt_n_case_keys, input);
    for (bt_idx i = 0; i < input->n_floes; i++) bt_schema_release(bt_floe_keys, bt_n_floe_keys, &input->floes[i]);
    bt_table_free(&input->water.table);
    bt_table_free(&input->air.table);
    BT_FREE(input->floes, input->path, input->text, input->floes_path);
    *input = (bt_case){0};
}
