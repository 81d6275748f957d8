// SPDX-License-Identifier: MIT
// Values of a study: single values, lists, ranges with the distribution to draw from, and the values of a condition.
#include <inttypes.h>
#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "base/largest.h"
#include "base/rng.h"
#include "base/name.h"
#include "case/schema.h"
#include "run/study.h"

void bt_study_complain(const bt_study_reader *reader, int line, const char *fmt, ...)
{
    char text[600];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    if (reader->place) bt_errors_add(reader->err, "%s: %s", reader->place, text);
    else bt_errors_add(reader->err, "%s:%d: %s", reader->s->path, line, text);
}

bool bt_study_is_scalar(const bt_study_reader *reader, const bt_node *node, int line, const char *name)
{
    if (node->kind == BT_NODE_SCALAR) return true;
    bt_study_complain(reader, line, "%s: needs a single value; write %s: value", name, name);
    return false;
}

void bt_study_read_whole(const bt_study_reader *reader, const bt_node *node, int line, const char *name, int64_t lo,
                         int64_t hi, int64_t *out)
{
    if (!bt_study_is_scalar(reader, node, line, name)) return;
    char *end;
    const long long v = strtoll(node->text, &end, 10);
    if (end == node->text || *end || v < lo || v > hi)
        bt_study_complain(reader, line, "%s: %.60s: give a whole number from %" PRId64 " to %" PRId64, name, node->text,
                          lo, hi);
    else *out = v;
}

bool bt_study_check_value(const bt_study_reader *reader, int line, const char *name, int key, const bt_node *value)
{
    const bt_key *k = &bt_case_keys[key];
    if (value->kind != BT_NODE_SCALAR || k->type == BT_KEY_POINTS) {
        bt_study_complain(reader, line, "%s: a study needs single values; points can be set as a text, as in "
                          "tow.waypoints: \"[[0, 0], [90 m, 5 m]]\"", name);
        return false;
    }
    bt_case scratch;
    bt_case_defaults(&scratch);
    char why[BT_WHY];
    const bool good = bt_value_read(k, &scratch, value->text, value->plain, why);
    if (!good) bt_study_complain(reader, line, "%s: %s", name, why);
    bt_case_free(&scratch);
    return good;
}

/// The value of a text in a list: a number for a real or whole key, otherwise the text as written back.
typedef struct {
    double number;
    char *text; ///< NULL for a number
} list_value;

static list_value parse_list_value(const bt_key *key, const bt_node *value)
{
    bt_case scratch;
    bt_case_defaults(&scratch);
    char why[BT_WHY];
    bt_value_read(key, &scratch, value->text, value->plain, why); // it has been checked
    list_value x = {.number = bt_value_number(key, &scratch)};
    if (key->type != BT_KEY_REAL && key->type != BT_KEY_INT) {
        bt_text text;
        bt_text_begin(&text);
        bt_value_write(key, &scratch, text.out);
        x.text = bt_text_end(&text);
    }
    bt_case_free(&scratch);
    return x;
}

/// Are two values equal? 7 % and 0.07 are, whatever the last digit of the conversion.
static bool same(const list_value *a, const list_value *b)
{
    if (a->text && b->text) return !strcmp(a->text, b->text);
    if (isnan(a->number) || isnan(b->number)) return isnan(a->number) && isnan(b->number); // NaN: no value
    return fabs(a->number - b->number) <= 1e-12 * fabs(a->number);
}

void bt_study_read_list(const bt_study_reader *reader, const bt_node *list, int line, bt_study_parameter *parameter)
{
    if (list->n == 0)
        bt_study_complain(reader, line, "%s: the list is empty; give at least one value", parameter->name);
    if (list->n > BT_MAX_VALUES) { // each is compared with all previous ones
        bt_study_complain(reader, line, "%s: %d values, more than the limit of %d; give fewer, or a "
                                        "range", parameter->name,
                          list->n, BT_MAX_VALUES);
        return;
    }
    parameter->value = bt_alloc((size_t)list->n, sizeof *parameter->value);
    list_value *value = bt_alloc((size_t)list->n, sizeof *value);
    for (int i = 0; i < list->n; i++) {
        const bt_node *item = list->item[i];
        if (!bt_study_check_value(reader, item->line, parameter->name, parameter->key, item)) continue;
        value[parameter->n] = parse_list_value(&bt_case_keys[parameter->key], item);
        int twin = 0;
        while (twin < parameter->n && !same(&value[twin], &value[parameter->n])) twin++;
        if (twin < parameter->n && !strcmp(parameter->value[twin], item->text))
            bt_study_complain(reader, item->line, "%s: %s is twice in the list; remove one", parameter->name,
                              item->text);
        else if (twin < parameter->n)
            bt_study_complain(reader, item->line, "%s: %s and %s are the same value; remove one", parameter->name,
                              parameter->value[twin], item->text);
        parameter->value[parameter->n++] = bt_text_copy(item->text);
    }
    for (int i = 0; i < parameter->n; i++) free(value[i].text);
    free(value);
}

static const char *const distributions[] = {"uniform", "triangular", "normal", NULL};

/// Distance from the middle of a normal distribution to an end of its range, in standard deviations (95 % lie between
/// the ends), and to where it is cut off.
static const double ends_at = 1.959963984540054, cut_at = 3;

static double normal_below(double z) { return 0.5 * bt_erfc(-z / sqrt(2)); }

/// Quantile u of a distribution, as a position in its range: 0 at the beginning, 1 at the end.
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

static double between(double from, double to, bool logarithmic, double at)
{
    if (at == 0) return from;
    if (at == 1) return to;
    return logarithmic ? from * bt_pow(to / from, at) : from + at * (to - from);
}

/// x as text for a case, in SI with all digits: a bare number, except for angles, which would be degrees without their
/// unit (base/units.h).
static char *value_text(const bt_study_parameter *parameter, double x)
{
    const bt_unit kind = bt_case_keys[parameter->key].unit;
    const bool bare = kind != BT_UNIT_ANGLE && kind != BT_UNIT_TURN;
    const char *unit = bare ? NULL : bt_units_symbol(kind);
    int digits = 6; // 0.3, not 0.30000000000000004, if nothing is lost
    for (char number[40]; digits < 17; digits++) {
        snprintf(number, sizeof number, "%.*g", digits, x);
        if (fabs(strtod(number, NULL) - x) <= 1e-12 * fabs(x)) break;
    }
    return bt_text_of("%.*g%s%s", digits, x, unit ? " " : "", unit ? unit : "");
}

/// Value at a position of a range, 0 ... 1 between its ends.
static char *range_value(const bt_study_parameter *parameter, double at)
{
    const double x = between(parameter->from, parameter->to, parameter->logarithmic, at);
    return bt_study_is_whole(parameter) ? bt_text_of("%.0f", nearbyint(x)) : value_text(parameter, x);
}

/// Quantile u of the values drawn from a range. Each whole number stands for the half below and above it: rounding
/// between the ends alone would draw the end values half as often as the others.
static char *drawn_value(const bt_study_parameter *parameter, double u)
{
    const double at = quantile(parameter->distribution, u);
    if (!bt_study_is_whole(parameter)) return range_value(parameter, at);
    const double x = floor(between(parameter->from - 0.5, parameter->to + 0.5, parameter->logarithmic, at) + 0.5);
    // u may round to 1
    return bt_text_of("%.0f", parameter->distribution == BT_NORMAL ? x : bt_min(x, parameter->to));
}

static void read_distribution(const bt_study_reader *reader, const bt_node *value, int line,
                              bt_study_parameter *parameter)
{
    if (!bt_study_is_scalar(reader, value, line, "distribution")) return;
    int d = 0;
    while (distributions[d] && strcmp(distributions[d], value->text)) d++;
    if (distributions[d]) parameter->distribution = (bt_distribution)d;
    else bt_study_complain(reader, line, "%s.distribution: %.40s: give uniform, triangular or normal", parameter->name,
                           value->text);
}

/// Are all values that a normal distribution may draw, also beyond its range, valid for the key? A complaint if not.
static bool in_range_of_key(const bt_study_reader *reader, int line, const bt_study_parameter *parameter)
{
    if (parameter->distribution != BT_NORMAL) return true;
    bool good = true;
    for (int k = 0; k < 2 && good; k++) {
        char *text = drawn_value(parameter, k);
        const bt_node node = {.kind = BT_NODE_SCALAR, .text = text, .plain = true};
        char name[160];
        snprintf(name, sizeof name, "%.80s: a normal distribution with 95 %% from %g to %g reaches", parameter->name,
                 parameter->from, parameter->to);
        good = bt_study_check_value(reader, line, name, parameter->key, &node);
        free(text);
    }
    return good;
}

bool bt_study_is_whole(const bt_study_parameter *parameter)
{
    return parameter->key >= 0 && bt_case_keys[parameter->key].type == BT_KEY_INT;
}

char *bt_study_distribution(const bt_study_parameter *parameter)
{
    BT_PLAIN_NUMBERS;
    if (!parameter->continuous) return bt_text_copy("");
    return bt_text_of("%s%s%s %.6g to %.6g", parameter->logarithmic ? "log-" : "",
                      distributions[parameter->distribution], parameter->distribution == BT_NORMAL
                      ? ", 95 % from" : " from", parameter->from, parameter->to);
}

/// Report equal values of a range, which ascend: a grid would have conditions twice.
static void check_distinct(const bt_study_reader *reader, int line, const bt_study_parameter *parameter)
{
    int i = 1;
    while (i < parameter->n && strcmp(parameter->value[i - 1], parameter->value[i])) i++;
    if (i < parameter->n)
        bt_study_complain(reader, line, "%s: %d values from %.6g to %.6g have %s more than once%s; lower n",
                          parameter->name, parameter->n, parameter->from, parameter->to, parameter->value[i],
                          bt_study_is_whole(parameter) ? ", as they are whole numbers" : "");
}

void bt_study_read_range(const bt_study_reader *reader, const bt_node *map, int line, bt_study_parameter *parameter)
{
    const bt_key *key = &bt_case_keys[parameter->key];
    static const char *const known[] = {"from", "to", "n", "scale", "distribution", "source", NULL};
    if (key->type != BT_KEY_REAL && key->type != BT_KEY_INT) {
        bt_study_complain(reader, line, "%s: has no range; give a list of its values", parameter->name);
        return;
    }
    double end[2] = {NAN, NAN};
    int64_t n = 2;
    bool good = true;
    parameter->continuous = true;
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
                bt_study_complain(reader, at, "%s.%s: %s", parameter->name, map->key[i],
                                  value->kind == BT_NODE_SCALAR ? why : "needs a single value");
            else end[map->key[i][0] == 't'] = bt_value_number(key, &scratch);
            good = good && read;
            bt_case_free(&scratch);
        } else if (!strcmp(map->key[i], "n")) {
            bt_study_read_whole(reader, value, at, "n", 2, BT_MAX_VALUES, &n);
        } else if (!strcmp(map->key[i], "scale")) {
            if (!bt_study_is_scalar(reader, value, at, "scale")) continue;
            parameter->logarithmic = !strcmp(value->text, "log");
            if (!parameter->logarithmic && strcmp(value->text, "linear"))
                bt_study_complain(reader, at, "%s.scale: %.40s: give linear or log", parameter->name, value->text);
        } else if (!strcmp(map->key[i], "distribution")) {
            read_distribution(reader, value, at, parameter);
        } else if (!strcmp(map->key[i], "source")) {
            if (bt_study_is_scalar(reader, value, at, "source") && !parameter->source)
                parameter->source = bt_text_copy(value->text);
        } else {
            const char *near = bt_suggest(map->key[i], known);
            bt_study_complain(reader, at, "%s.%.40s: unknown key; %s%s", parameter->name, map->key[i],
                              near ? "did you mean " : "a range has from, to, n, scale, distribution and source",
                              near ? near : "");
        }
    }
    parameter->from = end[0], parameter->to = end[1];
    if (good && !(parameter->from < parameter->to))
        bt_study_complain(reader, line, "%s: needs from and to, from below to", parameter->name);
    else if (good && parameter->logarithmic && !(parameter->from > 0))
        bt_study_complain(reader, line, "%s: a logarithmic range begins above zero; raise from", parameter->name);
    else if (good && in_range_of_key(reader, line, parameter)) {
        parameter->value = bt_alloc((size_t)n, sizeof *parameter->value);
        for (parameter->n = 0; parameter->n < n; parameter->n++)
            parameter->value[parameter->n] = range_value(parameter, (double)parameter->n / (double)(n - 1));
        if (reader->s->sampling == BT_SAMPLING_GRID) check_distinct(reader, line, parameter);
    }
}

const char *bt_distribution_name(bt_distribution d) { return distributions[d]; }

// --- values of a condition -------------------------------------------------------------------------------------------

/// Random numbers of parameter p in condition c.
static bt_rng draw(const bt_study *study, int p, int64_t c)
{
    return bt_rng_start(study->seed, BT_RNG_HYPERCUBE, c * BT_MAX_PARAMETERS + p);
}

typedef struct {
    uint64_t key;
    int64_t condition;
} lot;

BT_ASCENDING_BY(by_lot, lot, key, condition)

/// A random permutation of the strata for each parameter, by sorting random numbers.
void bt_study_draw_strata(bt_study *study)
{
    lot *l = bt_alloc((size_t)study->n_conditions, sizeof *l);
    for (int p = 0; p < study->n_parameters; p++) {
        for (int64_t c = 0; c < study->n_conditions; c++) {
            bt_rng rng = draw(study, p, c);
            l[c] = (lot){bt_rng_bits(&rng), c};
        }
        qsort(l, (size_t)study->n_conditions, sizeof *l, by_lot);
        study->parameter[p].stratum = bt_alloc((size_t)study->n_conditions, sizeof(int64_t));
        for (int64_t k = 0; k < study->n_conditions; k++) study->parameter[p].stratum[l[k].condition] = k;
    }
    free(l);
}

char *bt_study_value(const bt_study *study, int p, int64_t c)
{
    const bt_study_parameter *parameter = &study->parameter[p];
    if (study->sampling == BT_SAMPLING_LATIN_HYPERCUBE) {
        bt_rng rng = draw(study, p, c);
        bt_rng_bits(&rng); // the first number was for the stratum
        const double at = ((double)parameter->stratum[c] + bt_rng_uniform(&rng)) / (double)study->n_conditions;
        if (parameter->continuous) return drawn_value(parameter, at);
        const int i = (int)(at * parameter->n);
        return bt_text_copy(parameter->value[i < parameter->n ? i : parameter->n - 1]);
    }
    // The last parameter varies fastest.
    for (int i = study->n_parameters - 1; i > p; i--) c /= study->parameter[i].n;
    return bt_text_copy(parameter->value[c % parameter->n]);
}
