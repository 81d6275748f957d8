// SPDX-License-Identifier: MIT
// What a study gives to some of its members alone; reasons in study_axes.h.
#include "run/study_axes.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "case/case_derived.h"

static bt_study_setting *add_sets(bt_study_setting *to, const bt_study_variant *v, int n, const char *section)
{
    for (int i = 0; i < n; i++)
        for (int k = 0; k < v[i].n_set; k++)
            *to++ = (bt_study_setting){v[i].set[k], (int)strcspn(v[i].set[k], "="), v[i].at[k], section, v[i].axis};
    return to;
}

bt_study_setting *bt_study_settings(const bt_study *s, int *n)
{
    size_t most = (size_t)s->n_parameters + 1;
    for (int i = 0; i < s->n_variants; i++) most += (size_t)s->variant[i].n_set;
    for (int i = 0; i < s->n_with; i++) most += (size_t)s->with[i].n_set;
    bt_study_setting *list = bt_alloc(most, sizeof *list), *to = list;
    for (int p = 0; p < s->n_parameters; p++) {
        const bt_study_parameter *q = &s->parameter[p];
        if (q->key >= 0) *to++ = (bt_study_setting){q->name, (int)strlen(q->name), q->at, "parameters", p};
    }
    to = add_sets(to, s->variant, s->n_variants, "variants");
    to = add_sets(to, s->with, s->n_with, "with");
    *n = (int)(to - list);
    return list;
}

/// Order of their keys.
static int by_key(const bt_study_setting *a, const bt_study_setting *b)
{
    const int order = strncmp(a->text, b->text, (size_t)(a->length < b->length ? a->length : b->length));
    return order ? order : a->length - b->length;
}

const char *bt_study_varied(const bt_study *s, const char *key)
{
    const bt_study_setting wanted = {.text = key, .length = (int)strlen(key)};
    const char *section = NULL;
    int n;
    bt_study_setting *list = bt_study_settings(s, &n);
    for (int i = 0; i < n && !section; i++)
        if (by_key(&list[i], &wanted) == 0) section = list[i].section;
    free(list);
    return section;
}

/// Those of one key together, in the order of the list.
static int by_key_in_list(const void *a, const void *b)
{
    const bt_study_setting *p = *(const bt_study_setting *const *)a, *q = *(const bt_study_setting *const *)b;
    const int order = by_key(p, q);
    return order ? order : (p > q) - (p < q);
}

void bt_study_check_axes(const bt_study *s, bt_errors *err)
{
    int n;
    bt_study_setting *list = bt_study_settings(s, &n);
    const bt_study_setting **sorted = bt_alloc((size_t)n + 1, sizeof *sorted);
    for (int i = 0; i < n; i++) sorted[i] = &list[i];
    qsort(sorted, (size_t)n, sizeof *sorted, by_key_in_list);
    for (int i = 1, first = 0; i < n; i++) {
        const bt_study_setting *x = sorted[i], *y = sorted[first];
        if (by_key(x, y)) {
            first = i;
            continue;
        }
        // the sets of one parameter go to different members; its own key, which comes first, goes to all
        if (x->axis == y->axis && s->parameter[y->axis].name != y->text) continue;
        bt_errors_add(err, "%s%.*s: is given under `%s`, and under `%s` in %.*s: a member would run with one value and "
                           "be recorded with the other; remove one",
                      x->at, x->length, x->text, x->section, y->section, (int)strlen(y->at) - 2, y->at);
    }
    free(sorted);
    free(list);
}

/// What no condition looked at so far contradicts.
typedef struct {
    bt_study_setting *list;
    bool *idle; ///< [n] the key has no effect
    int n;
    bool fixed; ///< the ice does not depend on the seed
} verdict;

static void look_at_condition(const bt_study *s, int64_t condition, verdict *v)
{
    bt_member m;
    bt_case c;
    bt_errors unheard = {0};
    bt_study_member(s, condition * s->repeats, &m);
    const bool read = bt_member_case(s, &m, &c, &unheard) == BT_OK;
    v->fixed = v->fixed && read && !bt_case_ice_is_random(&c);
    for (int i = 0; i < v->n; i++) {
        char key[96];
        snprintf(key, sizeof key, "%.*s", v->list[i].length, v->list[i].text);
        v->idle[i] = v->idle[i] && read && bt_case_key_is_idle(&c, key);
    }
    bt_case_free(&c);
    bt_member_free(&m);
    bt_errors_free(&unheard);
}

void bt_study_check_ice(const bt_study *s, bt_errors *err)
{
    verdict v = {.fixed = s->repeats > 1};
    v.list = bt_study_settings(s, &v.n);
    v.idle = bt_alloc((size_t)v.n + 1, sizeof *v.idle);
    for (int i = 0; i < v.n; i++) v.idle[i] = true;
    bool open = true;
    for (int64_t k = 0; k < s->n_conditions && open; k++) {
        look_at_condition(s, k, &v);
        open = v.fixed;
        for (int i = 0; i < v.n; i++) open = open || v.idle[i];
    }
    if (v.fixed)
        bt_errors_add(err,
                      "%s: repeats: the ice does not depend on the seed, as it is read from a file, or there is none: "
                      "the %" PRId64 " fields of a condition would be one run; set repeats: 1, and for other ice vary "
                      "the place of the body (body.x, body.y), or the file",
                      s->path, s->repeats);
    for (int i = 0; i < v.n; i++)
        if (v.idle[i])
            bt_errors_add(err, "%s%.*s: has no effect, as all ice is read from files: members that differ by it would "
                               "be the same run; remove it from `%s`",
                          v.list[i].at, v.list[i].length, v.list[i].text, v.list[i].section);
    free(v.idle);
    free(v.list);
}
