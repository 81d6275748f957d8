// SPDX-License-Identifier: MIT
// Reading of a study file, and its members.
#include "bergtow/study.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "base/fileio.h"
#include "base/largest.h"
#include "base/rng.h"
#include "case/schema.h"
#include "base/suggest.h"
#include "base/tree.h"
#include "case/value.h"

/// Members write no frames unless the study sets this: what it says comes later, and counts.
static const char no_frames[] = "output.frame_interval=-1 s";

typedef struct {
    bt_study *s;
    bt_errors *err;
    const char *place; ///< of what is read, in place of file and line; or NULL
} reader;

#define COMPLAIN(r, line, ...) complain(r, line, __VA_ARGS__)
static void complain(const reader *r, int line, const char *fmt, ...) __attribute__((format(printf, 3, 4)));
static void complain(const reader *r, int line, const char *fmt, ...)
{
    char text[600];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    if (r->place) bt_errors_add(r->err, "%s: %s", r->place, text);
    else bt_errors_add(r->err, "%s:%d: %s", r->s->path, line, text);
}

static char *place_of(const bt_study *s, int line) { return bt_text_of("%s:%d: ", s->path, line); }

static bool scalar(const reader *r, const bt_node *node, int line, const char *name)
{
    if (node->kind == BT_NODE_SCALAR) return true;
    COMPLAIN(r, line, "%s: needs a single value; write %s: value", name, name);
    return false;
}

static void read_whole(const reader *r, const bt_node *node, int line, const char *name, int64_t lo, int64_t hi,
                       int64_t *out)
{
    if (!scalar(r, node, line, name)) return;
    char *end;
    const long long v = strtoll(node->text, &end, 10);
    if (end == node->text || *end || v < lo || v > hi)
        COMPLAIN(r, line, "%s: %.60s: give a whole number from %" PRId64 " to %" PRId64, name, node->text, lo, hi);
    else *out = v;
}

/// Index of a case key that a study may set; −1 after a complaint.
static int find_key(const reader *r, int line, const char *where, const char *name)
{
    char buffer[64];
    const int k = bt_schema_find(bt_case_keys, bt_n_case_keys, name);
    if (k < 0) {
        const char *near = bt_schema_suggest(bt_case_keys, bt_n_case_keys, name, buffer);
        if (bt_schema_is_section(name))
            COMPLAIN(r, line, "%s%.64s: is a section; write its keys with a dot, as in ice.concentration", where, name);
        else if (near) COMPLAIN(r, line, "%s%.64s: unknown key; did you mean %s?", where, name, near);
        else COMPLAIN(r, line, "%s%.64s: unknown key; see bergtow --list-keys", where, name);
    } else if (!strcmp(name, "ice.seed")) {
        COMPLAIN(r, line,
                 "%sice.seed: the fields of a study take their seeds from `seed` and `repeats`; remove it here", where);
        return -1;
    } else if (!strcmp(name, "run.threads")) {
        COMPLAIN(r, line, "%srun.threads: is chosen for all members by --threads; remove it here", where);
        return -1;
    }
    return k;
}

/// Is this text a value of the key? A complaint if not.
static bool check_value(const reader *r, int line, const char *name, int key, const bt_node *value)
{
    const bt_key *k = &bt_case_keys[key];
    if (value->kind != BT_NODE_SCALAR || k->type == BT_KEY_POINTS) {
        COMPLAIN(r, line, "%s: a study takes single values; make another base case for lists of points", name);
        return false;
    }
    bt_case scratch;
    bt_case_defaults(&scratch);
    char why[BT_WHY];
    const bool good = bt_value_read(k, &scratch, value->text, value->plain, why);
    if (!good) COMPLAIN(r, line, "%s: %s", name, why);
    bt_case_free(&scratch);
    return good;
}

/// A map of keys and values into a list "key=value", and where each stands.
static void read_set(const reader *r, const bt_node *map, int line, const char *where, char ***set, char ***at, int *n)
{
    if (map->kind != BT_NODE_MAP) {
        COMPLAIN(r, line, "%s: needs keys with values; write %s: {run.duration: 600 s}", where, where);
        return;
    }
    *set = bt_alloc((size_t)map->n, sizeof **set);
    *at = bt_alloc((size_t)map->n, sizeof **at);
    for (int i = 0; i < map->n; i++) {
        char prefix[96];
        snprintf(prefix, sizeof prefix, "%.80s: ", where);
        const int key = find_key(r, map->key_line[i], prefix, map->key[i]);
        if (key < 0 || !check_value(r, map->key_line[i], map->key[i], key, map->item[i])) continue;
        (*at)[*n] = place_of(r->s, map->key_line[i]);
        (*set)[(*n)++] = bt_text_of("%s=%s", map->key[i], map->item[i]->text);
    }
}

/// The place of `key` in the list of `set`; −1 where it is not there.
static int find_set(const bt_study *s, const char *key)
{
    const size_t n = strlen(key);
    for (int i = 0; i < s->n_set; i++)
        if (!strncmp(s->set[i], key, n) && s->set[i][n] == '=') return i;
    return -1;
}

/// Put "key=value" at the end of `set`, or at its beginning, where all that the study says comes later.
static void add_set(bt_study *s, const char *text, const char *at, bool first)
{
    s->set = bt_realloc(s->set, (size_t)s->n_set + 1, sizeof *s->set);
    s->set_at = bt_realloc(s->set_at, (size_t)s->n_set + 1, sizeof *s->set_at);
    const int k = first ? 0 : s->n_set;
    memmove(s->set + k + 1, s->set + k, (size_t)(s->n_set - k) * sizeof *s->set);
    memmove(s->set_at + k + 1, s->set_at + k, (size_t)(s->n_set - k) * sizeof *s->set_at);
    s->set[k] = bt_text_copy(text);
    s->set_at[k] = at ? bt_text_copy(at) : NULL;
    s->n_set++;
}

/// The section `report` of the case, as a map of its keys; part of `set`.
static void read_report(const reader *r, const bt_node *map, int line)
{
    if (map->kind != BT_NODE_MAP) {
        COMPLAIN(r, line, "report: needs keys with values; write report: {client: name, revision: A}");
        return;
    }
    for (int i = 0; i < map->n; i++) {
        const int at = map->key_line[i];
        char name[80];
        snprintf(name, sizeof name, "report.%.70s", map->key[i]);
        const int key = find_key(r, at, "", name);
        if (key < 0 || !check_value(r, at, name, key, map->item[i])) continue;
        if (find_set(r->s, name) >= 0) COMPLAIN(r, at, "%s: stands in `set` too; remove it there", name);
        char *given = bt_text_of("%s=%s", name, map->item[i]->text), *place = place_of(r->s, at);
        add_set(r->s, given, place, false);
        free(given);
        free(place);
    }
}

static void read_list(const reader *r, const bt_node *list, int line, bt_study_parameter *p)
{
    if (list->n == 0) COMPLAIN(r, line, "%s: the list is empty; give at least one value", p->name);
    if (list->n > BT_MOST_VALUES) { // each is compared with all before it
        COMPLAIN(r, line, "%s: %d values, at most %d are read; take fewer, or a range", p->name, list->n,
                 BT_MOST_VALUES);
        return;
    }
    p->value = bt_alloc((size_t)list->n, sizeof *p->value);
    for (int i = 0; i < list->n; i++) {
        if (!check_value(r, list->item[i]->line, p->name, p->key, list->item[i])) continue;
        for (int j = 0; j < p->n; j++)
            if (!strcmp(p->value[j], list->item[i]->text))
                COMPLAIN(r, list->item[i]->line, "%s: %s stands twice in the list; remove one", p->name, p->value[j]);
        p->value[p->n++] = bt_text_copy(list->item[i]->text);
    }
}

static const char *const distributions[] = {"uniform", "triangular", "normal", NULL};

/// Standard deviations of a normal distribution between the middle and an end of its range: 95 % lie between the ends;
/// and those to where it is cut off.
static const double ends_at = 1.959963984540054, cut_at = 3;

static double normal_below(double z) { return 0.5 * bt_erfc(-z / sqrt(2)); }

/// Place within a range, 0 at its beginning and 1 at its end, below which lies the share u of a distribution.
static double quantile(bt_distribution d, double u)
{
    if (d == BT_UNIFORM) return u;
    if (d == BT_TRIANGULAR) return u < 0.5 ? sqrt(0.5 * u) : 1 - sqrt(0.5 * (1 - u));
    // bisection: a study draws a few thousand numbers, once
    double low = -cut_at, high = cut_at;
    const double below = normal_below(low) + u * (normal_below(high) - normal_below(low));
    for (int i = 0; i < 60; i++) {
        const double middle = 0.5 * (low + high);
        if (normal_below(middle) < below) low = middle;
        else high = middle;
    }
    return 0.5 * (1 + low / ends_at);
}

/// Value at a place of a range, 0 ... 1 between its ends, in SI with all its digits.
static char *range_value(const bt_study_parameter *p, double at)
{
    double x = p->logarithmic ? p->from * bt_pow(p->to / p->from, at) : p->from + at * (p->to - p->from);
    if (at == 0) x = p->from;
    if (at == 1) x = p->to;
    if (bt_case_keys[p->key].type == BT_KEY_INT) return bt_text_of("%.0f", nearbyint(x));
    for (int digits = 6; digits < 17; digits++) { // 0.3, not 0.30000000000000004, where nothing is lost
        char *text = bt_text_of("%.*g", digits, x);
        if (fabs(strtod(text, NULL) - x) <= 1e-12 * fabs(x)) return text;
        free(text);
    }
    return bt_text_of("%.17g", x);
}

static void read_distribution(const reader *r, const bt_node *value, int line, bt_study_parameter *p)
{
    if (!scalar(r, value, line, "distribution")) return;
    int d = 0;
    while (distributions[d] && strcmp(distributions[d], value->text)) d++;
    if (distributions[d]) p->distribution = (bt_distribution)d;
    else
        COMPLAIN(r, line, "%s.distribution: %.40s: give uniform, triangular or normal", p->name, value->text);
}

/// Does all that a normal distribution draws beyond the ends of its range belong to the key? A complaint if not.
static bool in_range_of_key(const reader *r, int line, const bt_study_parameter *p)
{
    if (p->distribution != BT_NORMAL) return true;
    bool good = true;
    for (int k = 0; k < 2 && good; k++) {
        char *text = range_value(p, quantile(BT_NORMAL, k));
        const bt_node node = {.kind = BT_NODE_SCALAR, .text = text, .plain = true};
        char name[160];
        snprintf(name, sizeof name, "%.80s: a normal distribution with 95 %% from %g to %g reaches", p->name, p->from,
                 p->to);
        good = check_value(r, line, name, p->key, &node);
        free(text);
    }
    return good;
}

char *bt_study_distribution(const bt_study_parameter *p)
{
    if (!p->continuous) return bt_text_copy("");
    return bt_text_of("%s%s%s %.6g to %.6g", p->logarithmic ? "log-" : "", distributions[p->distribution],
                 p->distribution == BT_NORMAL ? ", 95 % from" : " from", p->from, p->to);
}

static void read_range(const reader *r, const bt_node *map, int line, bt_study_parameter *p)
{
    const bt_key *key = &bt_case_keys[p->key];
    static const char *const known[] = {"from", "to", "n", "scale", "distribution", "source", NULL};
    if (key->type != BT_KEY_REAL && key->type != BT_KEY_INT) {
        COMPLAIN(r, line, "%s: has no range; give a list of its values", p->name);
        return;
    }
    double end[2] = {NAN, NAN};
    int64_t n = 2;
    bool good = true;
    p->continuous = true;
    for (int i = 0; i < map->n; i++) {
        const bt_node *value = map->item[i];
        const int at = map->key_line[i];
        if (!strcmp(map->key[i], "from") || !strcmp(map->key[i], "to")) {
            bt_case scratch;
            bt_case_defaults(&scratch);
            char why[BT_WHY];
            const bool read =
                value->kind == BT_NODE_SCALAR && bt_value_read(key, &scratch, value->text, value->plain, why);
            if (!read)
                COMPLAIN(r, at, "%s.%s: %s", p->name, map->key[i],
                         value->kind == BT_NODE_SCALAR ? why : "needs a single value");
            else if (key->type == BT_KEY_REAL)
                memcpy(&end[map->key[i][0] == 't'], (const char *)&scratch + key->offset, sizeof(double));
            else {
                int64_t whole;
                memcpy(&whole, (const char *)&scratch + key->offset, sizeof whole);
                end[map->key[i][0] == 't'] = (double)whole;
            }
            good = good && read;
            bt_case_free(&scratch);
        } else if (!strcmp(map->key[i], "n")) {
            read_whole(r, value, at, "n", 2, BT_MOST_VALUES, &n);
        } else if (!strcmp(map->key[i], "scale")) {
            if (!scalar(r, value, at, "scale")) continue;
            p->logarithmic = !strcmp(value->text, "log");
            if (!p->logarithmic && strcmp(value->text, "linear"))
                COMPLAIN(r, at, "%s.scale: %.40s: give linear or log", p->name, value->text);
        } else if (!strcmp(map->key[i], "distribution")) {
            read_distribution(r, value, at, p);
        } else if (!strcmp(map->key[i], "source")) {
            if (scalar(r, value, at, "source") && !p->source) p->source = bt_text_copy(value->text);
        } else {
            const char *near = bt_suggest(map->key[i], known);
            COMPLAIN(r, at, "%s.%.40s: unknown key; %s%s", p->name, map->key[i],
                     near ? "did you mean " : "a range has from, to, n, scale, distribution and source",
                     near ? near : "");
        }
    }
    p->from = end[0], p->to = end[1];
    if (good && !(p->from < p->to)) COMPLAIN(r, line, "%s: needs from and to, from below to", p->name);
    else if (good && p->logarithmic && !(p->from > 0))
        COMPLAIN(r, line, "%s: a logarithmic range begins above zero; raise from", p->name);
    else if (good && in_range_of_key(r, line, p)) {
        p->value = bt_alloc((size_t)n, sizeof *p->value);
        for (p->n = 0; p->n < n; p->n++) p->value[p->n] = range_value(p, (double)p->n / (double)(n - 1));
    }
}

static bt_study_parameter *add_parameter(const reader *r, int line, const char *name, int key)
{
    bt_study *s = r->s;
    if (find_set(s, name) >= 0) COMPLAIN(r, line, "%s: is varied and stands in `set` too; remove it there", name);
    if (s->n_parameters == BT_MAX_PARAMETERS) {
        COMPLAIN(r, line, "more than %d parameters; make several studies", BT_MAX_PARAMETERS);
        return NULL;
    }
    bt_study_parameter *p = &s->parameter[s->n_parameters++];
    *p = (bt_study_parameter){.name = bt_text_copy(name), .at = place_of(s, line), .key = key};
    return p;
}

static void read_parameters(const reader *r, const bt_node *map, int line)
{
    if (map->kind != BT_NODE_MAP) {
        COMPLAIN(r, line,
                 "parameters: needs keys with lists or ranges; write parameters: {ice.concentration: [0.2, 0.5, 0.8]}");
        return;
    }
    for (int i = 0; i < map->n; i++) {
        const int at = map->key_line[i], key = find_key(r, at, "parameters: ", map->key[i]);
        if (key < 0) continue;
        bt_study_parameter *p = add_parameter(r, at, map->key[i], key);
        if (!p) return;
        if (map->item[i]->kind == BT_NODE_LIST) read_list(r, map->item[i], at, p);
        else if (map->item[i]->kind == BT_NODE_MAP) read_range(r, map->item[i], at, p);
        else
            COMPLAIN(r, at,
                     "%s: needs a list [a, b] or a range {from: a, to: b, n: 3}; a single value belongs into `set`",
                     p->name);
    }
}

static void read_variants(const reader *r, const bt_node *map, int line)
{
    bt_study *s = r->s;
    if (map->kind != BT_NODE_MAP || map->n == 0) {
        COMPLAIN(r, line, "variants: needs names with keys; write variants: {squares: {ice.shape: rectangles}}");
        return;
    }
    bt_study_parameter *p = add_parameter(r, line, "variant", -1);
    if (!p) return;
    s->variant = bt_alloc((size_t)map->n, sizeof *s->variant);
    p->value = bt_alloc((size_t)map->n, sizeof *p->value);
    for (int i = 0; i < map->n; i++) {
        bt_study_variant *v = &s->variant[s->n_variants++];
        char where[96];
        snprintf(where, sizeof where, "variants: %.60s", map->key[i]);
        v->name = bt_text_copy(map->key[i]);
        p->value[p->n++] = bt_text_copy(v->name);
        read_set(r, map->item[i], map->key_line[i], where, &v->set, &v->at, &v->n_set);
    }
}

static void read_with(const reader *r, const bt_node *map, int line)
{
    bt_study *s = r->s;
    if (map->kind != BT_NODE_MAP || map->n == 0) {
        COMPLAIN(r, line, "with: needs values with keys; write with: {ice.concentration=0.2: {domain.width: 5 km}}");
        return;
    }
    s->with = bt_alloc((size_t)map->n, sizeof *s->with);
    for (int i = 0; i < map->n; i++) {
        char where[160];
        snprintf(where, sizeof where, "with: %.120s", map->key[i]);
        bool known = false;
        for (int p = 0; p < s->n_parameters; p++)
            for (int v = 0; v < s->parameter[p].n && !known; v++) {
                const size_t n = strlen(s->parameter[p].name);
                known = !strncmp(map->key[i], s->parameter[p].name, n) && map->key[i][n] == '=' &&
                        !strcmp(map->key[i] + n + 1, s->parameter[p].value[v]);
            }
        if (!known)
            COMPLAIN(r, map->key_line[i], "%s: is no value of a parameter; write key=value as in the list", where);
        bt_study_variant *v = &s->with[s->n_with++];
        v->name = bt_text_copy(map->key[i]);
        read_set(r, map->item[i], map->key_line[i], where, &v->set, &v->at, &v->n_set);
    }
}

/// The numbers of parameter p in condition c.
static bt_rng draw(const bt_study *s, int p, int64_t c)
{
    return bt_rng_start(s->seed, BT_RNG_HYPERCUBE, c * BT_MAX_PARAMETERS + p);
}

typedef struct {
    uint64_t key;
    int64_t condition;
} lot;

static int by_lot(const void *a, const void *b)
{
    const lot *p = a, *q = b;
    if (p->key != q->key) return p->key < q->key ? -1 : 1;
    return (p->condition > q->condition) - (p->condition < q->condition);
}

/// A random permutation of the strata for each parameter, by sorting lots.
static void draw_strata(bt_study *s)
{
    lot *l = bt_alloc((size_t)s->n_conditions, sizeof *l);
    for (int p = 0; p < s->n_parameters; p++) {
        for (int64_t c = 0; c < s->n_conditions; c++) {
            bt_rng r = draw(s, p, c);
            l[c] = (lot){bt_rng_bits(&r), c};
        }
        qsort(l, (size_t)s->n_conditions, sizeof *l, by_lot);
        s->parameter[p].stratum = bt_alloc((size_t)s->n_conditions, sizeof(int64_t));
        for (int64_t k = 0; k < s->n_conditions; k++) s->parameter[p].stratum[l[k].condition] = k;
    }
    free(l);
}

static void count_conditions(const reader *r)
{
    bt_study *s = r->s;
    s->n_conditions = 1;
    if (s->sampling == BT_SAMPLING_LATIN_HYPERCUBE) s->n_conditions = s->samples;
    else
        for (int i = 0; i < s->n_parameters && s->n_conditions <= BT_MAX_MEMBERS; i++)
            s->n_conditions *= s->parameter[i].n;
    if (s->n_conditions > BT_MAX_MEMBERS || s->n_conditions * s->repeats > BT_MAX_MEMBERS)
        bt_errors_add(r->err,
                      "%s: more than %d members; take shorter lists, fewer repeats, or sampling: latin-hypercube",
                      s->path, BT_MAX_MEMBERS);
    if (s->sampling == BT_SAMPLING_LATIN_HYPERCUBE && s->n_parameters == 0)
        bt_errors_add(r->err, "%s: sampling: latin-hypercube: there is nothing to sample; give parameters", s->path);
}

static const bt_node *entry(const bt_node *root, const char *word, int *line)
{
    for (int i = 0; i < root->n; i++)
        if (!strcmp(root->key[i], word)) {
            *line = root->key_line[i];
            return root->item[i];
        }
    return NULL;
}

static const bt_key *row_of(const char *key)
{
    return &bt_study_keys[bt_schema_find(bt_study_keys, bt_n_study_keys, key)];
}

/// The whole number given for a key, within the range of its row; out is left alone where there is none.
static bool read_number(const reader *r, const bt_node *root, const char *key, int64_t *out)
{
    int line;
    const bt_node *node = entry(root, key, &line);
    bt_range range;
    if (!node || !bt_value_range(row_of(key), &range)) return false;
    read_whole(r, node, line, key, (int64_t)range.lo, (int64_t)range.hi, out);
    return true;
}

/// Place of the word given for a key in its list of two, 0 where there is none.
static int read_choice(const reader *r, const bt_node *root, const char *key)
{
    int line;
    const bt_node *node = entry(root, key, &line);
    const char *const *list = row_of(key)->choices;
    if (!node || !scalar(r, node, line, key)) return 0;
    for (int k = 0; list[k]; k++)
        if (!strcmp(list[k], node->text)) return k;
    COMPLAIN(r, line, "%s: %.60s: give %s or %s", key, node->text, list[0], list[1]);
    return 0;
}

static void check_words(const reader *r, const bt_node *root)
{
    for (int i = 0; i < root->n; i++) {
        if (bt_schema_find(bt_study_keys, bt_n_study_keys, root->key[i]) >= 0) continue;
        char buffer[64];
        const char *near = bt_schema_suggest(bt_study_keys, bt_n_study_keys, root->key[i], buffer);
        COMPLAIN(r, root->key_line[i], "%.60s: unknown key of a study; %s%s", root->key[i],
                 near ? "did you mean " : "see bergtow --list-keys", near ? near : "");
    }
}

static void read_entries(const reader *r, const bt_node *root)
{
    bt_study *s = r->s;
    int line = 1;
    check_words(r, root);
    const bt_node *node = entry(root, "title", &line);
    if (node && scalar(r, node, line, "title")) s->title = bt_text_copy(node->text);
    if ((node = entry(root, "base", &line)) && scalar(r, node, line, "base")) {
        const char *slash = strrchr(s->path, '/');
        s->base_name = bt_text_copy(node->text);
        s->base = slash && node->text[0] != '/' ? bt_text_of("%.*s/%s", (int)(slash - s->path), s->path, node->text)
                                                : bt_text_copy(node->text);
    } else if (!node) {
        bt_errors_add(r->err, "%s: base: missing; name the case that is varied, as in base: ../basin/basin-80.yml",
                      s->path);
    }
    if ((node = entry(root, "set", &line))) read_set(r, node, line, "set", &s->set, &s->set_at, &s->n_set);
    if ((node = entry(root, "report", &line))) read_report(r, node, line);
    if ((node = entry(root, "parameters", &line))) read_parameters(r, node, line);
    if ((node = entry(root, "variants", &line))) read_variants(r, node, line);
    if ((node = entry(root, "with", &line))) read_with(r, node, line);
    s->sampling = (bt_sampling)read_choice(r, root, "sampling");
    s->common_fields = read_choice(r, root, "fields") == 1;
    for (int i = 0; i < s->n_parameters && s->sampling == BT_SAMPLING_GRID; i++)
        if (s->parameter[i].distribution != BT_UNIFORM)
            bt_errors_add(r->err, "%s%s: a distribution is drawn from; set sampling: latin-hypercube and samples",
                          s->parameter[i].at, s->parameter[i].name);
    if (!read_number(r, root, "samples", &s->samples) && s->sampling == BT_SAMPLING_LATIN_HYPERCUBE)
        bt_errors_add(r->err, "%s: samples: missing; a Latin hypercube needs the number of its conditions", s->path);
    read_number(r, root, "repeats", &s->repeats);
    read_number(r, root, "seed", &s->seed);
    read_number(r, root, "ranks", &s->ranks);
    if (find_set(s, "output.frame_interval") < 0) add_set(s, no_frames, NULL, true);
}

bt_status bt_study_read(bt_study *s, const char *path, bt_errors *err)
{
    *s = (bt_study){.path = bt_text_copy(path), .repeats = 1, .samples = 1, .seed = 1, .ranks = 1, .n_conditions = 1};
    const size_t before = err->n;
    size_t size;
    bt_status status = bt_file_read(path, "a study file", &s->text, &size, err);
    if (status != BT_OK) return status;
    const reader r = {.s = s, .err = err};
    bt_node *root = bt_tree_parse(s->text, size, path, err);
    if (root && (root->kind != BT_NODE_MAP || !root->n))
        bt_errors_add(err, "%s: is not a study; it needs at least base: CASE.yml", path);
    else if (root) read_entries(&r, root);
    bt_tree_free(root);
    if (err->n == before) count_conditions(&r);
    if (err->n == before && s->sampling == BT_SAMPLING_LATIN_HYPERCUBE) draw_strata(s);
    return err->n == before ? BT_OK : BT_ERR_CASE;
}

/// What the study varies, or sets for some members alone, would win over `set`: where that is, NULL = nowhere.
static const char *varied(const bt_study *s, const char *key)
{
    const size_t n = strlen(key);
    for (int p = 0; p < s->n_parameters; p++)
        if (!strcmp(s->parameter[p].name, key)) return "parameters";
    for (int k = 0; k < 2; k++) {
        const bt_study_variant *v = k ? s->with : s->variant;
        for (int i = 0; i < (k ? s->n_with : s->n_variants); i++)
            for (int j = 0; j < v[i].n_set; j++)
                if (!strncmp(v[i].set[j], key, n) && v[i].set[j][n] == '=') return k ? "with" : "variants";
    }
    return NULL;
}

/// One "key=value" in place of, or beside, what `set` says.
static void take_override(bt_study *s, const char *text, bt_errors *err)
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
    const reader r = {.s = s, .err = err, .place = place};
    const int key = find_key(&r, 0, "", name);
    const bt_node node = {.kind = BT_NODE_SCALAR, .text = (char *)value, .plain = true};
    if (key < 0 || !check_value(&r, 0, name, key, &node)) return;
    const char *where = varied(s, name);
    if (where) {
        COMPLAIN(&r, 0, "%s: stands under `%s` of %s, which would win; change it there", name, where, s->path);
        return;
    }
    const int k = find_set(s, name);
    if (k >= 0) {
        free(s->set[k]);
        free(s->set_at[k]);
        s->set[k] = bt_text_of("%s=%s", name, value);
        s->set_at[k] = bt_text_copy("--set: ");
        return;
    }
    char *given = bt_text_of("%s=%s", name, value);
    add_set(s, given, "--set: ", false);
    free(given);
}

bt_status bt_study_override(bt_study *s, const char *const *set, int n, bt_errors *err)
{
    const size_t before = err->n;
    for (int i = 0; i < n; i++) take_override(s, set[i], err);
    return err->n == before ? BT_OK : BT_ERR_CASE;
}

bt_status bt_study_fits(const bt_study *s, int ranks, bt_errors *err)
{
    if (s->ranks <= ranks) return BT_OK;
    bt_errors_add(err,
                  "%s: ranks: a member asks for %" PRId64
                  " ranks and there are %d; start more with mpirun -n, or lower it",
                  s->path, s->ranks, ranks);
    return BT_ERR_CASE;
}

static void free_texts(char **text, int n)
{
    for (int i = 0; i < n; i++) free(text[i]);
    free(text);
}

static void free_sets(bt_study_variant *v, int n)
{
    for (int i = 0; i < n; i++) {
        free(v[i].name);
        free_texts(v[i].set, v[i].n_set);
        free_texts(v[i].at, v[i].n_set);
    }
    free(v);
}

void bt_study_free(bt_study *s)
{
    for (int i = 0; i < s->n_parameters; i++) {
        free(s->parameter[i].name);
        free(s->parameter[i].at);
        free(s->parameter[i].source);
        free(s->parameter[i].stratum);
        free_texts(s->parameter[i].value, s->parameter[i].n);
    }
    free_sets(s->variant, s->n_variants);
    free_sets(s->with, s->n_with);
    free_texts(s->set, s->n_set);
    free_texts(s->set_at, s->n_set);
    free(s->path);
    free(s->text);
    free(s->title);
    free(s->base_name);
    free(s->base);
    *s = (bt_study){0};
}

// --- members ---------------------------------------------------------------------------------------------------------

/// Text of parameter p in condition c.
static char *value_in(const bt_study *s, int p, int64_t c)
{
    const bt_study_parameter *q = &s->parameter[p];
    if (s->sampling == BT_SAMPLING_LATIN_HYPERCUBE) {
        bt_rng r = draw(s, p, c);
        bt_rng_bits(&r); // the first was for the stratum
        const double at = ((double)q->stratum[c] + bt_rng_uniform(&r)) / (double)s->n_conditions;
        if (q->continuous) return range_value(q, quantile(q->distribution, at));
        const int i = (int)(at * q->n);
        return bt_text_copy(q->value[i < q->n ? i : q->n - 1]);
    }
    // The last parameter runs fastest.
    for (int i = s->n_parameters - 1; i > p; i--) c /= s->parameter[i].n;
    return bt_text_copy(q->value[c % q->n]);
}

static void add_override(bt_member *m, char *set, const char *at)
{
    m->at[m->n_set] = at;
    m->set[m->n_set++] = set;
}

void bt_study_member(const bt_study *s, int64_t m, bt_member *out)
{
    *out = (bt_member){.condition = m / s->repeats, .repeat = m % s->repeats};
    snprintf(out->name, sizeof out->name, "c%03" PRId64 "-r%03" PRId64, out->condition + 1, out->repeat + 1);
    const int64_t condition = s->common_fields ? 0 : out->condition;
    bt_rng r = bt_rng_start(s->seed, BT_RNG_MEMBER, condition * ((int64_t)1 << 32) + out->repeat);
    out->seed = (int64_t)(bt_rng_bits(&r) >> 2); // below 4.7e18
    int most = s->n_set + s->n_parameters + 1;
    for (int i = 0; i < s->n_variants; i++) most += s->variant[i].n_set;
    for (int i = 0; i < s->n_with; i++) most += s->with[i].n_set;
    out->set = bt_alloc((size_t)most, sizeof *out->set);
    out->at = bt_alloc((size_t)most, sizeof *out->at);
    for (int i = 0; i < s->n_set; i++) add_override(out, bt_text_copy(s->set[i]), s->set_at[i]);
    for (int p = 0; p < s->n_parameters; p++) {
        out->value[p] = value_in(s, p, out->condition);
        if (s->parameter[p].key >= 0) {
            char *given = bt_text_of("%s=%s", s->parameter[p].name, out->value[p]);
            add_override(out, given, s->parameter[p].at);
            for (int i = 0; i < s->n_with; i++)
                for (int k = 0; k < s->with[i].n_set && !strcmp(s->with[i].name, given); k++)
                    add_override(out, bt_text_copy(s->with[i].set[k]), s->with[i].at[k]);
            continue;
        }
        for (int i = 0; i < s->n_variants; i++)
            for (int k = 0; k < s->variant[i].n_set && !strcmp(s->variant[i].name, out->value[p]); k++)
                add_override(out, bt_text_copy(s->variant[i].set[k]), s->variant[i].at[k]);
    }
    add_override(out, bt_text_of("ice.seed=%" PRId64, out->seed), NULL);
}

void bt_member_free(bt_member *m)
{
    free_texts(m->set, m->n_set);
    free(m->at);
    for (int i = 0; i < BT_MAX_PARAMETERS; i++) free(m->value[i]);
    *m = (bt_member){0};
}

bt_status bt_member_case(const bt_study *s, const bt_member *m, bt_case *c, bt_errors *err)
{
    return bt_case_read_placed(c, s->base, (const char *const *)m->set, m->at, m->n_set, err);
}

bt_status bt_study_base_case(const bt_study *s, bt_case *c, bt_errors *err)
{
    return bt_case_read_placed(c, s->base, (const char *const *)s->set, (const char *const *)s->set_at, s->n_set, err);
}

char *bt_study_resolved(const bt_study *s, bt_errors *err)
{
    bt_case c;
    const bt_status status = bt_study_base_case(s, &c, err);
    char *base = status == BT_OK ? bt_case_resolved(&c) : NULL;
    bt_case_free(&c);
    if (!base) return NULL;
    bt_text text;
    bt_text_begin(&text);
    FILE *out = text.out;
    fprintf(out, "# bergtow study: what its members are. More repeats may be asked for later; anything else is another "
                 "study.\n");
    fprintf(out, "seed: %" PRId64 "\nsampling: %s\nconditions: %" PRId64 "\n%s", s->seed,
            row_of("sampling")->choices[s->sampling], s->n_conditions, s->common_fields ? "fields: common\n" : "");
    for (int p = 0; p < s->n_parameters; p++) {
        fprintf(out, "%s:", s->parameter[p].name);
        const bt_study_parameter *q = &s->parameter[p];
        if (q->continuous && s->sampling == BT_SAMPLING_LATIN_HYPERCUBE) {
            fprintf(out, " %s from %.17g to %.17g", q->logarithmic ? "log" : "linear", q->from, q->to);
            // uniform is not named: studies of earlier versions go on
            if (q->distribution != BT_UNIFORM) fprintf(out, ", %s", distributions[q->distribution]);
        } else
            for (int i = 0; i < s->parameter[p].n; i++) fprintf(out, "%s %s", i ? "," : "", s->parameter[p].value[i]);
        fputc('\n', out);
    }
    for (int i = 0; i < s->n_variants; i++)
        for (int k = 0; k < s->variant[i].n_set; k++)
            fprintf(out, "variant %s: %s\n", s->variant[i].name, s->variant[i].set[k]);
    for (int i = 0; i < s->n_with; i++)
        for (int k = 0; k < s->with[i].n_set; k++) fprintf(out, "with %s: %s\n", s->with[i].name, s->with[i].set[k]);
    fprintf(out, "# base case with `set`\n%s", base);
    free(base);
    return bt_text_end(&text);
}
