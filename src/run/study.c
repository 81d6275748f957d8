// SPDX-License-Identifier: MIT
// Members of a study: which values each takes.
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/rng.h"
#include "bergtow/study.h"
#include "case/schema.h"
#include "run/study_values.h"

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
        out->value[p] = bt_study_value(s, p, out->condition);
        if (s->parameter[p].key >= 0) {
            char *given = bt_text_of("%s=%s", s->parameter[p].name, out->value[p]);
            add_override(out, given, s->parameter[p].at);
            for (int i = 0; i < s->n_with; i++)
                for (int k = 0; s->with[i].axis == p && k < s->with[i].n_set && !strcmp(s->with[i].name, given); k++)
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

/// A title of the study names its members, which that of the base, of one condition, would name wrongly.
static void name_member(const bt_study *s, const bt_member *m, bt_case *c)
{
    for (int i = 0; i < m->n_set; i++)
        if (!strncmp(m->set[i], "run.title=", 10)) return;
    if (!s->title || !*s->title) return;
    char text[1024];
    size_t n = (size_t)snprintf(text, sizeof text, "%s", s->title);
    for (int p = 0; p < s->n_parameters && n < sizeof text; p++) {
        const char *key = s->parameter[p].key >= 0 ? s->parameter[p].name : "";
        n += (size_t)snprintf(text + n, sizeof text - n, ", %s%s%s", key, *key ? " " : "", m->value[p]);
    }
    if (n >= sizeof text) return;
    free(c->run.title);
    c->run.title = bt_text_of("%s, field %" PRId64, text, m->repeat + 1);
}

bt_status bt_member_case(const bt_study *s, const bt_member *m, bt_case *c, bt_errors *err)
{
    const bt_status status = bt_case_read_placed(c, s->base, (const char *const *)m->set, m->at, m->n_set, err);
    if (status == BT_OK) name_member(s, m, c);
    return status;
}

bt_status bt_study_base_case(const bt_study *s, bt_case *c, bt_errors *err)
{
    static const char *const none[] = {NULL};
    return bt_case_read_placed(c, s->base, (const char *const *)s->set,
                               s->set_at ? (const char *const *)s->set_at : none, s->n_set, err);
}

/// Length of a line of YAML without its comment.
static size_t said_in(const char *line)
{
    size_t said = 0;
    bool quoted = false;
    for (size_t i = 0; line[i] && line[i] != '\n'; i++) {
        if (quoted && line[i] == '\\' && line[i + 1] && line[i + 1] != '\n') i++;
        else if (line[i] == '"') quoted = !quoted;
        else if (!quoted && line[i] == '#' && (i == 0 || line[i - 1] == ' ')) break;
        if (line[i] != ' ') said = i + 1;
    }
    return said;
}

bool bt_study_resolved_alike(const char *a, const char *b)
{
    while (*a || *b) {
        const size_t n = said_in(a);
        if (n != said_in(b) || memcmp(a, b, n)) return false;
        a += strcspn(a, "\n"), b += strcspn(b, "\n");
        a += *a == '\n', b += *b == '\n';
    }
    return true;
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
            bt_study_keys[bt_schema_find(bt_study_keys, bt_n_study_keys, "sampling")].choices[s->sampling],
            s->n_conditions, s->common_fields ? "fields: common\n" : "");
    for (int p = 0; p < s->n_parameters; p++) {
        fprintf(out, "%s:", s->parameter[p].name);
        const bt_study_parameter *q = &s->parameter[p];
        if (q->continuous && s->sampling == BT_SAMPLING_LATIN_HYPERCUBE) {
            fprintf(out, " %s%s from %.17g to %.17g, %s", bt_study_is_whole(q) ? "whole numbers, " : "",
                    q->logarithmic ? "log" : "linear", q->from, q->to, bt_distribution_name(q->distribution));
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
