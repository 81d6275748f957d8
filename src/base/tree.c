// SPDX-License-Identifier: MIT
// A tree from the YAML events of libyaml. BT_TREE_DEPTH bounds the recursion, BT_TREE_NODES the memory.
#include "base/tree.h"
#include "base/inside.h"

#include <string.h>
#include <yaml.h>

#include "base/largest.h"

// --- slips -----------------------------------------------------------------------------------------------------------

// Causes of YAML syntax errors. libyaml names the place where the text can no longer be read, often the line after the
// slip: a word without its colon is a text that continues on the next line, until a colon there is out of place.

/// An error as libyaml reports it; lines count from 1.
typedef struct {
    const char *text; ///< the whole input, n bytes
    size_t n;
    const char *problem;
    int line, begun; ///< of the problem; where the unfinished construct began, 0 = none
} slip;

enum { WHY = 240 };

typedef struct {
    const char *begin;
    size_t n;     // without the line end and blanks before it
    size_t blank; // blanks and tabs at its beginning
} text_line;

/// Line of this number, from 1; empty beyond the end.
static text_line line_of(const slip *syntax, int number)
{
    const char *end = syntax->text + syntax->n, *p = syntax->text;
    for (int i = 1; i < number && p < end; i++) {
        const char *stop = memchr(p, '\n', (size_t)(end - p));
        p = stop ? stop + 1 : end;
    }
    const char *stop = memchr(p, '\n', (size_t)(end - p));
    text_line line = {.begin = p, .n = (size_t)((stop ? stop : end) - p)};
    while (line.n && (p[line.n - 1] == '\r' || p[line.n - 1] == ' ')) line.n--;
    while (line.blank < line.n && (p[line.blank] == ' ' || p[line.blank] == '\t')) line.blank++;
    return line;
}

static bool says_nothing(const text_line *line) { return line->blank == line->n || line->begin[line->blank] == '#'; }

/// Position of the first colon from i on that ends a key; n if there is none.
static size_t key_end(const text_line *line, size_t i)
{
    for (; i < line->n; i++)
        if (line->begin[i] == ':' && (i + 1 == line->n || line->begin[i + 1] == ' ' || line->begin[i + 1] == '\t'))
            return i;
    return line->n;
}

static bool has_key(const text_line *line) { return key_end(line, 0) < line->n; }

/// How to write "word value" with the colon that it lacks: "dt: 1 s".
static void with_colon(const char *text, size_t n, char out[80])
{
    size_t word = 0, value;
    while (word < n && text[word] != ' ' && text[word] != '\t' && text[word] != ':') word++;
    for (value = word; value < n && (text[value] == ' ' || text[value] == '\t' || text[value] == ':');) value++;
    const int shown = word > 30 ? 30 : (int)word, rest = n - value > 40 ? 40 : (int)(n - value);
    snprintf(out, 80, "%.*s:%s%.*s", shown, text, rest ? " " : "", rest, text + value);
}

static int colon_missing(const text_line *line, int number, char *why)
{
    char right[80];
    const char *text = line->begin + line->blank;
    const size_t n = line->n - line->blank;
    size_t word = 0;
    while (word < n && !strchr(" \t:", text[word])) word++;
    if (!n || strchr("-[]{},\"'#", *text)) return 0; // no key begins with these
    with_colon(text, n, right);
    if (word < n && text[word] == ':')
        snprintf(why, WHY, "a space is missing after the colon; write %s", right);
    else snprintf(why, WHY, "a colon is missing after the key; write %s", right);
    return number;
}

/// Explain a misplaced colon: the lines before lack one, this line has two, or it is indented below a value.
static int colon_out_of_place(const slip *syntax, char *why)
{
    const text_line here = line_of(syntax, syntax->line);
    int first = 0, above = syntax->line - 1;
    text_line line = {0};
    for (; above > 0; above--) {
        line = line_of(syntax, above);
        if (says_nothing(&line)) continue;
        if (has_key(&line)) break;
        first = above;
    }
    if (first) {
        line = line_of(syntax, first);
        return colon_missing(&line, first, why);
    }
    const size_t colon = key_end(&here, 0);
    if (colon < here.n && key_end(&here, colon + 1) < here.n) {
        snprintf(why, WHY,
                 "two keys on one line; write the second below the first, put both in { } with a comma between them, "
                 "or put a text with a colon in quotes");
        return syntax->line;
    }
    if (!above || here.blank <= line.blank) return 0;
    snprintf(why, WHY,
             "indented deeper than line %d, whose key has a value already; indent both lines alike", above);
    return syntax->line;
}

/// Find the slip behind the error. Returns its line, with the remedy in why; 0 if it is none of the known slips.
static int syntax_explain(const slip *syntax, char why[WHY])
{
    const text_line here = line_of(syntax, syntax->line);
    if (memchr(here.begin, '\t', here.blank)) {
        snprintf(why, WHY, "the line begins with a tab, but YAML is indented by spaces only; write two spaces");
        return syntax->line;
    }
    if (strstr(syntax->problem, "could not find expected ':'") && syntax->begun) {
        const text_line line = line_of(syntax, syntax->begun);
        return colon_missing(&line, syntax->begun, why);
    }
    if (strstr(syntax->problem, "mapping values are not allowed") ||
        strstr(syntax->problem, "did not find expected key"))
        return colon_out_of_place(syntax, why);
    return 0;
}

// --- the tree --------------------------------------------------------------------------------------------------------

typedef struct {
    yaml_parser_t yaml;
    const char *name, *text;
    size_t n;
    bt_errors *err;
    int n_nodes;
    bool failed;
} parser;

void bt_tree_free(bt_node *node)
{
    if (!node) return;
    for (int i = 0; i < node->n; i++) {
        if (node->key) free(node->key[i]);
        bt_tree_free(node->item[i]);
    }
    BT_FREE(node->item, node->key, node->key_line, node->text, node);
}

static void tell_syntax(const parser *yaml)
{
    const yaml_parser_t *y = &yaml->yaml;
    char why[WHY];
    const slip syntax = {.text = yaml->text,
                              .n = yaml->n,
                              .problem = y->problem ? y->problem : "",
                              .line = (int)y->problem_mark.line + 1,
                              .begun = y->context ? (int)y->context_mark.line + 1 : 0};
    const int line = syntax_explain(&syntax, why);
    if (line) bt_errors_add(yaml->err, "%s:%d: not valid YAML: %s", yaml->name, line, why);
    else
        bt_errors_add(yaml->err, "%s:%d: not valid YAML: %s%s%s; check indentation and colons near this line",
                      yaml->name, syntax.line, y->problem ? y->problem : "unknown error", y->context ? " " : "",
                      y->context ? y->context : "");
}

// The next event; on a syntax error one message and false.
static bool next(parser *yaml, yaml_event_t *event)
{
    if (yaml_parser_parse(&yaml->yaml, event)) return true;
    const yaml_parser_t *y = &yaml->yaml;
    yaml->failed = true;
    if (y->error == YAML_READER_ERROR)
        bt_errors_add(yaml->err, "%s: byte %zu is not UTF-8 text (%s); is this a case file? save it as UTF-8",
                      yaml->name, y->problem_offset, y->problem);
    else tell_syntax(yaml);
    return false;
}

static bool refuse(parser *yaml, int line, const char *why)
{
    bt_errors_add(yaml->err, "%s:%d: %s", yaml->name, line, why);
    yaml->failed = true;
    return false;
}

static char *copy_text(const yaml_char_t *s, size_t n)
{
    char *t = bt_alloc(n + 1, 1);
    memcpy(t, s, n);
    return t;
}

static void append(bt_node *parent, char *key, int key_line, bt_node *item)
{
    if (parent->n == parent->cap) {
        parent->cap = parent->cap ? 2 * parent->cap : 8;
        size_t cap = (size_t)parent->cap;
        parent->item = bt_realloc(parent->item, cap, sizeof *parent->item);
        if (parent->kind == BT_NODE_MAP) {
            parent->key = bt_realloc(parent->key, cap, sizeof *parent->key);
            parent->key_line = bt_realloc(parent->key_line, cap, sizeof *parent->key_line);
        }
    }
    parent->item[parent->n] = item;
    if (parent->kind == BT_NODE_MAP) {
        parent->key[parent->n] = key;
        parent->key_line[parent->n] = key_line;
    }
    parent->n++;
}

static bool plain_event(parser *yaml, const yaml_event_t *e, int line)
{
    const yaml_char_t *anchor = NULL, *tag = NULL;
    if (e->type == YAML_SCALAR_EVENT) anchor = e->data.scalar.anchor, tag = e->data.scalar.tag;
    if (e->type == YAML_MAPPING_START_EVENT) anchor = e->data.mapping_start.anchor, tag = e->data.mapping_start.tag;
    if (e->type == YAML_SEQUENCE_START_EVENT) anchor = e->data.sequence_start.anchor, tag = e->data.sequence_start.tag;
    if (e->type == YAML_ALIAS_EVENT || anchor)
        return refuse(yaml, line,
                      "anchors and aliases (& and *) are not read in a case file; write the value out, or quote a text "
                      "that begins with one of these");
    if (tag)
        return refuse(yaml, line,
                      "tags (!) are not read in a case file; remove the tag, or quote a text that begins with !");
    return true;
}

static bt_node *read_node(parser *yaml, const yaml_event_t *first, int depth);

static void read_map(parser *yaml, bt_node *map, int depth)
{
    for (;;) {
        yaml_event_t e;
        if (!next(yaml, &e)) return;
        if (e.type == YAML_MAPPING_END_EVENT) {
            yaml_event_delete(&e);
            return;
        }
        int line = (int)e.start_mark.line + 1;
        bool good = plain_event(yaml, &e, line);
        if (good && e.type != YAML_SCALAR_EVENT) good = refuse(yaml, line, "a key must be a word; write key: value");
        if (good && memchr(e.data.scalar.value, 0, e.data.scalar.length))
            good = refuse(yaml, line, "a key contains a NUL character; remove it");
        if (good && map->n >= BT_TREE_MAP)
            good = refuse(yaml, line, "more than 256 keys in one map; see bergtow --list-keys for all known keys");
        char *key = good ? copy_text(e.data.scalar.value, e.data.scalar.length) : NULL;
        yaml_event_delete(&e);
        if (!good) return;

        bt_node *value = NULL;
        if (next(yaml, &e)) {
            value = read_node(yaml, &e, depth + 1);
            yaml_event_delete(&e);
        }
        int twin = -1;
        for (int i = 0; i < map->n && twin < 0; i++)
            if (!strcmp(map->key[i], key)) twin = i;
        if (value && twin >= 0)
            bt_errors_add(yaml->err, "%s:%d: %s: duplicate key, first given in line %d; remove one of them", yaml->name,
                          line, key, map->key_line[twin]);
        if (!value || twin >= 0) {
            bt_tree_free(value);
            free(key);
        } else {
            append(map, key, line, value);
        }
        if (yaml->failed) return;
    }
}

static void read_list(parser *yaml, bt_node *list, int depth)
{
    for (;;) {
        yaml_event_t e;
        if (!next(yaml, &e)) return;
        bool end = e.type == YAML_SEQUENCE_END_EVENT;
        bt_node *value = end ? NULL : read_node(yaml, &e, depth + 1);
        yaml_event_delete(&e);
        if (value) append(list, NULL, 0, value);
        if (end || yaml->failed) return;
    }
}

static bt_node *read_node(parser *yaml, const yaml_event_t *first, int depth)
{
    int line = (int)first->start_mark.line + 1;
    if (!plain_event(yaml, first, line)) return NULL;
    if (depth > BT_TREE_DEPTH)
        return refuse(yaml, line, "nested deeper than 16 levels; no key of a case needs that"), NULL;
    if (++yaml->n_nodes > BT_TREE_NODES)
        return refuse(yaml, line,
                      "more than 2 million values; put large fields into an HDF5 file and name it in ice.field"),
               NULL;

    bt_node *node = bt_alloc(1, sizeof *node);
    node->line = line;
    if (first->type == YAML_MAPPING_START_EVENT) {
        node->kind = BT_NODE_MAP;
        read_map(yaml, node, depth);
    } else if (first->type == YAML_SEQUENCE_START_EVENT) {
        node->kind = BT_NODE_LIST;
        read_list(yaml, node, depth);
    } else {
        node->kind = BT_NODE_SCALAR;
        node->plain = first->data.scalar.style == YAML_PLAIN_SCALAR_STYLE;
        if (memchr(first->data.scalar.value, 0, first->data.scalar.length))
            refuse(yaml, line, "a text contains a NUL character; remove it");
        node->text = copy_text(first->data.scalar.value, first->data.scalar.length);
    }
    return node;
}

static bt_node *read_document(parser *yaml)
{
    bt_node *root = NULL;
    int n_documents = 0;
    for (bool end = false; !end && !yaml->failed;) {
        yaml_event_t e;
        if (!next(yaml, &e)) break;
        if (e.type == YAML_STREAM_END_EVENT) end = true;
        else if (e.type == YAML_DOCUMENT_START_EVENT && ++n_documents > 1)
            refuse(yaml, (int)e.start_mark.line + 1, "a second document begins (---); keep only one case in a file");
        else if (e.type == YAML_SCALAR_EVENT || e.type == YAML_MAPPING_START_EVENT ||
                 e.type == YAML_SEQUENCE_START_EVENT || e.type == YAML_ALIAS_EVENT)
            root = read_node(yaml, &e, 0);
        yaml_event_delete(&e);
    }
    return root;
}

bt_node *bt_tree_parse(const char *text, size_t n, const char *name, bt_errors *err)
{
    parser yaml = {.name = name, .text = text, .n = n, .err = err};
    if (!yaml_parser_initialize(&yaml.yaml)) {
        bt_errors_add(err, "%s: libyaml could not start; free some memory", name);
        return NULL;
    }
    // Without this, libyaml takes two leading bytes of a binary file for a mark of UTF-16.
    yaml_parser_set_encoding(&yaml.yaml, YAML_UTF8_ENCODING);
    yaml_parser_set_input_string(&yaml.yaml, (const unsigned char *)text, n);
    bt_node *root = read_document(&yaml);
    yaml_parser_delete(&yaml.yaml);
    if (yaml.failed) {
        bt_tree_free(root);
        return NULL;
    }
    if (!root) {
        root = bt_alloc(1, sizeof *root);
        root->kind = BT_NODE_MAP;
        root->line = 1;
    }
    return root;
}

const bt_node *bt_tree_find(const bt_node *node, const char *key, int *line)
{
    for (int i = 0; node && node->kind == BT_NODE_MAP && i < node->n; i++)
        if (!strcmp(node->key[i], key)) {
            *line = node->key_line[i];
            return node->item[i];
        }
    return NULL;
}
