// SPDX-License-Identifier: MIT
// What a syntax error of YAML comes from. libyaml names the place at which no reading is left, which often is the line
// after the slip: a word without its colon is a text that goes on in the next line, until a colon there has no place.
#include "base/syntax.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    const char *begin;
    size_t n;     // without what ends the line
    size_t blank; // blanks and tabs at its beginning
} line;

/// Line of this number, from 1; empty beyond the end.
static line line_of(const bt_syntax *s, int number)
{
    const char *end = s->text + s->n, *p = s->text;
    for (int i = 1; i < number && p < end; i++) {
        const char *stop = memchr(p, '\n', (size_t)(end - p));
        p = stop ? stop + 1 : end;
    }
    const char *stop = memchr(p, '\n', (size_t)(end - p));
    line l = {.begin = p, .n = (size_t)((stop ? stop : end) - p)};
    while (l.n && (p[l.n - 1] == '\r' || p[l.n - 1] == ' ')) l.n--;
    while (l.blank < l.n && (p[l.blank] == ' ' || p[l.blank] == '\t')) l.blank++;
    return l;
}

static bool says_nothing(const line *l) { return l->blank == l->n || l->begin[l->blank] == '#'; }

/// Place of the first colon from i on that ends a key, n = none.
static size_t key_end(const line *l, size_t i)
{
    for (; i < l->n; i++)
        if (l->begin[i] == ':' && (i + 1 == l->n || l->begin[i + 1] == ' ' || l->begin[i + 1] == '\t')) return i;
    return l->n;
}

static bool has_key(const line *l) { return key_end(l, 0) < l->n; }

/// How to write "word value" with the colon that it lacks: "dt: 1 s".
static void with_colon(const char *text, size_t n, char out[80])
{
    size_t word = 0, value;
    while (word < n && text[word] != ' ' && text[word] != '\t' && text[word] != ':') word++;
    for (value = word; value < n && (text[value] == ' ' || text[value] == '\t' || text[value] == ':');) value++;
    const int shown = word > 30 ? 30 : (int)word, rest = n - value > 40 ? 40 : (int)(n - value);
    snprintf(out, 80, "%.*s:%s%.*s", shown, text, rest ? " " : "", rest, text + value);
}

static int colon_missing(const line *l, int number, char *why)
{
    char right[80];
    const char *text = l->begin + l->blank;
    const size_t n = l->n - l->blank;
    size_t word = 0;
    while (word < n && !strchr(" \t:", text[word])) word++;
    if (!n || strchr("-[]{},\"'#", *text)) return 0; // no key begins so
    with_colon(text, n, right);
    if (word < n && text[word] == ':')
        snprintf(why, BT_SYNTAX_WHY, "a blank is missing after the colon; write %s", right);
    else snprintf(why, BT_SYNTAX_WHY, "a colon is missing after the key; write %s", right);
    return number;
}

/// A colon where none can be: the lines before lack one, this one has two, or it is indented below a value.
static int colon_out_of_place(const bt_syntax *s, char *why)
{
    const line here = line_of(s, s->line);
    int first = 0, above = s->line - 1;
    line l = {0};
    for (; above > 0; above--) {
        l = line_of(s, above);
        if (says_nothing(&l)) continue;
        if (has_key(&l)) break;
        first = above;
    }
    if (first) {
        l = line_of(s, first);
        return colon_missing(&l, first, why);
    }
    const size_t colon = key_end(&here, 0);
    if (colon < here.n && key_end(&here, colon + 1) < here.n) {
        snprintf(why, BT_SYNTAX_WHY,
                 "two keys in one line; write the second below the first, both in { } with a comma between them, or a "
                 "text with a colon in quotes");
        return s->line;
    }
    if (!above || here.blank <= l.blank) return 0;
    snprintf(why, BT_SYNTAX_WHY,
             "indented deeper than line %d, whose key has a value already; indent both lines alike", above);
    return s->line;
}

int bt_syntax_explain(const bt_syntax *s, char why[BT_SYNTAX_WHY])
{
    const line here = line_of(s, s->line);
    if (memchr(here.begin, '\t', here.blank)) {
        snprintf(why, BT_SYNTAX_WHY, "the line begins with a tab; YAML is indented by blanks alone, write two blanks");
        return s->line;
    }
    if (strstr(s->problem, "could not find expected ':'") && s->begun) {
        const line l = line_of(s, s->begun);
        return colon_missing(&l, s->begun, why);
    }
    if (strstr(s->problem, "mapping values are not allowed") || strstr(s->problem, "did not find expected key"))
        return colon_out_of_place(s, why);
    return 0;
}
