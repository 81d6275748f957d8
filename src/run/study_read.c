// SPDX-License-Identifier: MIT
// Reading of a study file.
#include "run/study.h"

#include <inttypes.h>
#include <string.h>

#include "base/fileio.h"
#include "base/inside.h"
#include "base/tree.h"
#include "case/case_base.h"
#include "case/schema.h"

/// Members write no frames unless the study sets this key: its settings come later, and prevail.
static const char no_frames[] = "output.frame_interval=-1 s";

static char *place_of(const bt_study *study, int line) { return bt_text_of("%s:%d: ", study->path, line); }

/// Index of a case key that a study may set; −1 after a complaint.
static int find_key(const bt_study_reader *reader, int line, const char *where, const char *name)
{
    char buffer[64];
    const int k = bt_schema_find(bt_case_keys, bt_n_case_keys, name);
    if (k < 0) {
        const char *near = bt_schema_suggest(bt_case_keys, bt_n_case_keys, name, buffer);
        if (bt_schema_is_section(name))
            bt_study_complain(reader, line, "%s%.64s: is a section; write its keys with a dot, as in ice.concentration",
                              where, name);
        else if (near) bt_study_complain(reader, line, "%s%.64s: unknown key; did you mean %s?", where, name, near);
        else bt_study_complain(reader, line, "%s%.64s: unknown key; see bergtow --list-keys", where, name);
    } else if (!strcmp(name, "ice.seed")) {
        bt_study_complain(
            reader, line,
            "%sice.seed: the fields of a study take their seeds from `seed` and `repeats`; remove it here", where);
        return -1;
    } else if (!strcmp(name, "run.threads")) {
        bt_study_complain(reader, line, "%srun.threads: is chosen for all members by --threads; remove it here", where);
        return -1;
    }
    return k;
}

/// May a study set this key to this value? A list of points is a text, which is read with the case.
static bool may_set(const bt_study_reader *reader, int line, const char *name, int key, const bt_node *value)
{
    if (bt_case_keys[key].type == BT_KEY_POINTS && value->kind == BT_NODE_SCALAR) return true;
    return bt_study_check_value(reader, line, name, key, value);
}

/// Read a map of keys and values into a list "key=value", with the place of each.
static void read_set(const bt_study_reader *reader, const bt_node *map, int line, const char *where, char ***set,
                     char ***at, int *n)
{
    if (map->kind != BT_NODE_MAP) {
        bt_study_complain(reader, line, "%s: needs keys with values; write %s: {run.duration: 600 s}", where, where);
        return;
    }
    *set = bt_alloc((size_t)map->n, sizeof **set);
    *at = bt_alloc((size_t)map->n, sizeof **at);
    for (int i = 0; i < map->n; i++) {
        char prefix[96];
        snprintf(prefix, sizeof prefix, "%.80s: ", where);
        const int key = find_key(reader, map->key_line[i], prefix, map->key[i]);
        if (key < 0 || !may_set(reader, map->key_line[i], map->key[i], key, map->item[i])) continue;
        (*at)[*n] = place_of(reader->s, map->key_line[i]);
        (*set)[(*n)++] = bt_text_of("%s=%s", map->key[i], map->item[i]->text);
    }
}

/// Index of `key` in the list of `set`; −1 if it is not there.
static int find_set(const bt_study *study, const char *key)
{
    const size_t n = strlen(key);
    for (int i = 0; i < study->n_set; i++)
        if (!strncmp(study->set[i], key, n) && study->set[i][n] == '=') return i;
    return -1;
}

/// Put "key=value" at the end of `set`, or at its beginning, where all settings of the study come later.
static void add_set(bt_study *study, const char *text, const char *at, bool first)
{
    study->set = bt_realloc(study->set, (size_t)study->n_set + 1, sizeof *study->set);
    study->set_at = bt_realloc(study->set_at, (size_t)study->n_set + 1, sizeof *study->set_at);
    const int k = first ? 0 : study->n_set;
    memmove(study->set + k + 1, study->set + k, (size_t)(study->n_set - k) * sizeof *study->set);
    memmove(study->set_at + k + 1, study->set_at + k, (size_t)(study->n_set - k) * sizeof *study->set_at);
    study->set[k] = bt_text_copy(text);
    study->set_at[k] = at ? bt_text_copy(at) : NULL;
    study->n_set++;
}

/// The section `report` of the case, as a map of its keys; part of `set`.
static void read_report(const bt_study_reader *reader, const bt_node *map, int line)
{
    if (map->kind != BT_NODE_MAP) {
        bt_study_complain(reader, line, "report: needs keys with values; write report: {client: name, revision: A}");
        return;
    }
    for (int i = 0; i < map->n; i++) {
        const int at = map->key_line[i];
        char name[80];
        snprintf(name, sizeof name, "report.%.70s", map->key[i]);
        const int key = find_key(reader, at, "", name);
        if (key < 0 || !bt_study_check_value(reader, at, name, key, map->item[i])) continue;
        if (find_set(reader->s, name) >= 0)
            bt_study_complain(reader, at, "%s: is also in `set`; remove it there", name);
        char *given = bt_text_of("%s=%s", name, map->item[i]->text), *place = place_of(reader->s, at);
        add_set(reader->s, given, place, false);
        free(given);
        free(place);
    }
}

static bt_study_parameter *add_parameter(const bt_study_reader *reader, int line, const char *name, int key)
{
    bt_study *study = reader->s;
    if (find_set(study, name) >= 0)
        bt_study_complain(reader, line, "%s: is varied and is also in `set`; remove it there", name);
    if (study->n_parameters == BT_MAX_PARAMETERS) {
        bt_study_complain(reader, line, "more than %d parameters; make several studies", BT_MAX_PARAMETERS);
        return NULL;
    }
    bt_study_parameter *parameter = &study->parameter[study->n_parameters++];
    *parameter = (bt_study_parameter){.name = bt_text_copy(name), .at = place_of(study, line), .key = key};
    return parameter;
}

static void read_parameters(const bt_study_reader *reader, const bt_node *map, int line)
{
    if (map->kind != BT_NODE_MAP) {
        bt_study_complain(
            reader, line,
            "parameters: needs keys with lists or ranges; write parameters: {ice.concentration: [0.2, 0.5, 0.8]}");
        return;
    }
    for (int i = 0; i < map->n; i++) {
        const int at = map->key_line[i], key = find_key(reader, at, "parameters: ", map->key[i]);
        if (key < 0) continue;
        bt_study_parameter *parameter = add_parameter(reader, at, map->key[i], key);
        if (!parameter) return;
        if (map->item[i]->kind == BT_NODE_LIST) bt_study_read_list(reader, map->item[i], at, parameter);
        else if (map->item[i]->kind == BT_NODE_MAP) bt_study_read_range(reader, map->item[i], at, parameter);
        else
            bt_study_complain(
                reader, at,
                "%s: needs a list [a, b] or a range {from: a, to: b, n: 3}; a single value belongs in `set`",
                parameter->name);
    }
}

/// Add keys for the members with one value of a parameter. where: for messages.
static void add_variant(const bt_study_reader *reader, const bt_node *map, int i, int axis, const char *where)
{
    bt_study *study = reader->s;
    study->variant = bt_realloc(study->variant, (size_t)study->n_variants + 1, sizeof *study->variant);
    bt_study_variant *variant = &study->variant[study->n_variants++];
    *variant = (bt_study_variant){.name = bt_text_copy(map->key[i]), .axis = axis};
    read_set(reader, map->item[i], map->key_line[i], where, &variant->set, &variant->at, &variant->n_set);
}

static void read_variants(const bt_study_reader *reader, const bt_node *map, int line)
{
    if (map->kind != BT_NODE_MAP || map->n == 0) {
        bt_study_complain(reader, line,
                          "variants: needs names with keys; write variants: {squares: {ice.shape: rectangles}}");
        return;
    }
    bt_study_parameter *parameter = add_parameter(reader, line, "variant", -1);
    if (!parameter) return;
    parameter->value = bt_alloc((size_t)map->n, sizeof *parameter->value);
    for (int i = 0; i < map->n; i++) {
        char where[96];
        snprintf(where, sizeof where, "variants: %.60s", map->key[i]);
        parameter->value[parameter->n++] = bt_text_copy(map->key[i]);
        add_variant(reader, map, i, reader->s->n_parameters - 1, where);
    }
}

/// Parameter whose value "key=value" a `with` names; −1 after a complaint.
static int axis_of(const bt_study_reader *reader, int line, const char *name)
{
    const bt_study *study = reader->s;
    for (int p = 0; p < study->n_parameters; p++) {
        const bt_study_parameter *parameter = &study->parameter[p];
        const size_t n = strlen(parameter->name);
        if (strncmp(name, parameter->name, n) || name[n] != '=') continue;
        if (parameter->key < 0) {
            bt_study_complain(reader, line,
                              "with: %.120s: keys of a variant belong under its name in `variants`; move them "
                                            "there", name);
            return -1;
        }
        if (parameter->continuous && study->sampling == BT_SAMPLING_LATIN_HYPERCUBE) {
            bt_study_complain(reader, line,
                              "with: %.120s: %s is drawn from a range, and no condition has exactly this value; give a "
                                            "list of its values, or remove the keys of this one", name,
                                            parameter->name);
            return -1;
        }
        for (int v = 0; v < parameter->n; v++)
            if (!strcmp(name + n + 1, parameter->value[v])) return p;
    }
    bt_study_complain(reader, line, "with: %.120s: is not a value of a parameter; write key=value as in the "
                                    "list", name);
    return -1;
}

static void read_with(const bt_study_reader *reader, const bt_node *map, int line)
{
    if (map->kind != BT_NODE_MAP || map->n == 0) {
        bt_study_complain(reader, line,
                          "with: needs values with keys; write with: {ice.concentration=0.2: {domain.width: 5 km}}");
        return;
    }
    for (int i = 0; i < map->n; i++) {
        const int axis = axis_of(reader, map->key_line[i], map->key[i]);
        char where[160];
        snprintf(where, sizeof where, "with: %.120s", map->key[i]);
        if (axis >= 0) add_variant(reader, map, i, axis, where);
    }
}

static void count_conditions(const bt_study_reader *reader)
{
    bt_study *study = reader->s;
    study->n_conditions = 1;
    if (study->sampling == BT_SAMPLING_LATIN_HYPERCUBE) study->n_conditions = study->samples;
    else
        for (int i = 0; i < study->n_parameters && study->n_conditions <= BT_MAX_MEMBERS; i++)
            study->n_conditions *= study->parameter[i].n;
    if (study->n_conditions > BT_MAX_MEMBERS || study->n_conditions * study->repeats > BT_MAX_MEMBERS)
        bt_errors_add(reader->err,
                      "%s: more than %d members; give shorter lists, fewer repeats, or sampling: latin-hypercube",
                      study->path, BT_MAX_MEMBERS);
    if (study->sampling == BT_SAMPLING_LATIN_HYPERCUBE && study->n_parameters == 0)
        bt_errors_add(reader->err, "%s: sampling: latin-hypercube: there is nothing to sample; give parameters",
                      study->path);
}

static const bt_key *row_of(const char *key)
{
    return &bt_study_keys[bt_schema_find(bt_study_keys, bt_n_study_keys, key)];
}

/// Read the whole number given for a key, within the range of its row; out is unchanged if there is none.
static bool read_number(const bt_study_reader *reader, const bt_node *root, const char *key, int64_t *out)
{
    int line;
    const bt_node *node = bt_tree_find(root, key, &line);
    bt_range range;
    if (!node || !bt_value_range(row_of(key), &range)) return false;
    bt_study_read_whole(reader, node, line, key, (int64_t)range.lo, (int64_t)range.hi, out);
    return true;
}

/// Index of the word given for a key in its list, 0 if there is none.
static int read_choice(const bt_study_reader *reader, const bt_node *root, const char *key)
{
    int line;
    const bt_node *node = bt_tree_find(root, key, &line);
    const char *const *list = row_of(key)->choices;
    if (!node || !bt_study_is_scalar(reader, node, line, key)) return 0;
    for (int k = 0; list[k]; k++)
        if (!strcmp(list[k], node->text)) return k;
    bt_study_complain(reader, line, "%s: %.60s: give %s%s%s or %s", key, node->text, list[0], list[2] ? ", " : "",
                      list[2] ? list[1] : "", list[2] ? list[2] : list[1]);
    return 0;
}

static void check_words(const bt_study_reader *reader, const bt_node *root)
{
    for (int i = 0; i < root->n; i++) {
        if (bt_schema_find(bt_study_keys, bt_n_study_keys, root->key[i]) >= 0) continue;
        char buffer[64];
        const char *near = bt_schema_suggest(bt_study_keys, bt_n_study_keys, root->key[i], buffer);
        bt_study_complain(reader, root->key_line[i], "%.60s: unknown key of a study; %s%s", root->key[i],
                          near ? "did you mean " : "see bergtow --list-keys", near ? near : "");
    }
}

static void read_entries(const bt_study_reader *reader, const bt_node *root)
{
    bt_study *study = reader->s;
    int line = 1;
    check_words(reader, root);
    const bt_node *node = bt_tree_find(root, "title", &line);
    if (node && bt_study_is_scalar(reader, node, line, "title")) study->title = bt_text_copy(node->text);
    if ((node = bt_tree_find(root, "base", &line)) && bt_study_is_scalar(reader, node, line, "base")) {
        const char *slash = strrchr(study->path, '/');
        study->base_name = bt_text_copy(node->text);
        study->base = slash && node->text[0] != '/'
                      ? bt_text_of("%.*s/%s", (int)(slash - study->path), study->path, node->text)
                                                    : bt_text_copy(node->text);
    } else if (!node) {
        bt_errors_add(reader->err, "%s: base: missing; name the case that is varied, as in base: ../basin/basin-80.yml",
                      study->path);
    }
    study->sampling = (bt_sampling)read_choice(reader, root, "sampling"); // the reading of values depends on it
    if ((node = bt_tree_find(root, "set", &line)))
        read_set(reader, node, line, "set", &study->set, &study->set_at, &study->n_set);
    if ((node = bt_tree_find(root, "report", &line))) read_report(reader, node, line);
    if ((node = bt_tree_find(root, "parameters", &line))) read_parameters(reader, node, line);
    if ((node = bt_tree_find(root, "variants", &line))) read_variants(reader, node, line);
    if ((node = bt_tree_find(root, "with", &line))) read_with(reader, node, line);
    study->fields = (bt_study_fields)read_choice(reader, root, "fields");
    for (int i = 0; i < study->n_parameters && study->sampling == BT_SAMPLING_GRID; i++)
        if (study->parameter[i].distribution != BT_UNIFORM)
            bt_errors_add(reader->err, "%s%s: a distribution is drawn from; set sampling: latin-hypercube and samples",
                          study->parameter[i].at, study->parameter[i].name);
    if (!read_number(reader, root, "samples", &study->samples) && study->sampling == BT_SAMPLING_LATIN_HYPERCUBE)
        bt_errors_add(reader->err, "%s: samples: missing; a Latin hypercube needs the number of its conditions",
                      study->path);
    read_number(reader, root, "repeats", &study->repeats);
    read_number(reader, root, "seed", &study->seed);
    read_number(reader, root, "ranks", &study->ranks);
    if (find_set(study, "output.frame_interval") < 0) add_set(study, no_frames, NULL, true);
}

bt_status bt_study_read(bt_study *study, const char *path, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    *study = (bt_study){.path = bt_text_copy(path), .repeats = 1, .samples = 1, .seed = 1, .ranks = 1,
                        .n_conditions = 1};
    const size_t before = err->n;
    size_t size;
    bt_status status = bt_file_read(path, "a study file", &study->text, &size, err);
    if (status != BT_OK) return status;
    const bt_study_reader reader = {.s = study, .err = err};
    bt_node *root = bt_tree_parse(study->text, size, path, err);
    if (root && (root->kind != BT_NODE_MAP || !root->n))
        bt_errors_add(err, "%s: is not a study; it needs at least base: CASE.yml", path);
    else if (bt_case_kind(root) == BT_FILE_CASE)
        bt_errors_add(err, "%s: this is a case: bergtow run %s", path, path);
    else if (root) read_entries(&reader, root);
    bt_tree_free(root);
    if (err->n == before) bt_study_check_axes(study, err);
    if (err->n == before) count_conditions(&reader);
    if (err->n == before && study->sampling == BT_SAMPLING_LATIN_HYPERCUBE) bt_study_draw_strata(study);
    return err->n == before ? BT_OK : BT_ERR_CASE;
}

/// Replace an entry of `set` by "key=value", or add it.
static void take_override(bt_study *study, const char *text, bt_errors *err)
{
    const char *equals = strchr(text, '=');
    if (!equals || equals == text) {
        bt_errors_add(err, "--set %.80s: is not key=value; write --set run.duration=600", text);
        return;
    }
    char place[140], name[96];
    snprintf(place, sizeof place, "--set %.120s", text);
    const size_t n = strcspn(text, " =");
    snprintf(name, sizeof name, "%.*s", n < 90 ? (int)n : 90, text);
    const char *value = equals + 1 + strspn(equals + 1, " ");
    const bt_study_reader reader = {.s = study, .err = err, .place = place};
    const int key = find_key(&reader, 0, "", name);
    const bt_node node = {.kind = BT_NODE_SCALAR, .text = (char *)value, .plain = true};
    if (key < 0 || !may_set(&reader, 0, name, key, &node)) return;
    const char *where = bt_study_varied(study, name); // which would override `set`
    if (where) {
        bt_study_complain(&reader, 0, "%s: is set under `%s` of %s, which takes precedence; change it "
                                      "there", name, where,
                          study->path);
        return;
    }
    const int k = find_set(study, name);
    if (k >= 0) {
        free(study->set[k]);
        free(study->set_at[k]);
        study->set[k] = bt_text_of("%s=%s", name, value);
        study->set_at[k] = bt_text_copy("--set: ");
        return;
    }
    char *given = bt_text_of("%s=%s", name, value);
    add_set(study, given, "--set: ", false);
    free(given);
}

bt_status bt_study_override(bt_study *study, const char *const *set, int n, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const size_t before = err->n;
    for (int i = 0; i < n; i++) take_override(study, set[i], err);
    return err->n == before ? BT_OK : BT_ERR_CASE;
}

bt_status bt_study_fits(const bt_study *study, int ranks, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    if (study->ranks <= ranks) return BT_OK;
    return bt_fail(err, BT_ERR_CASE,
        "%s: ranks: a member asks for %" PRId64 " ranks and there are %d; start more with mpirun -n, or lower it",
        study->path, study->ranks, ranks);
}
