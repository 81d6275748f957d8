// SPDX-License-Identifier: MIT
// What a study gives to some of its members alone; reasons in study_axes.h.
#include "run/study_axes.h"

#include <stdlib.h>
#include <string.h>

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
