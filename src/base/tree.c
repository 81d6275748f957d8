// SPDX-License-Identifier: MIT
// YAML events of libyaml to a tree. The recursion is bounded by BT_TREE_DEPTH, the memory by BT_TREE_NODES.
#include "base/tree.h"

#include "base/largest.h"
#include "base/syntax.h"

#include <stdlib.h>
#include <string.h>
#include <yaml.h>

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
    free(node->item);
    free(node->key);
    free(node->key_line);
    free(node->text);
    free(node);
}

static void tell_syntax(const parser *p)
{
    const yaml_parser_t *y = &p->yaml;
    char why[BT_SYNTAX_WHY];
    const bt_syntax s = {.text = p->text,
                         .n = p->n,
                         .problem = y->problem ? y->problem : "",
                         .line = (int)y->problem_mark.line + 1,
                         .begun = y->context ? (int)y->context_mark.line + 1 : 0};
    const int line = bt_syntax_explain(&s, why);
    if (line) bt_errors_add(p->err, "%s:%d: not valid YAML: %s", p->name, line, why);
    else
        bt_errors_add(p->err, "%s:%d: not valid YAML: %s%s%s; check indentation and colons near this line", p->name,
                      s.line, y->problem ? y->problem : "unknown error", y->context ? " " : "",
                      y->context ? y->context : "");
}

// The next event; on a syntax error one message and false.
static bool next(parser *p, yaml_event_t *event)
{
    if (yaml_parser_parse(&p->yaml, event)) return true;
    const yaml_parser_t *y = &p->yaml;
    p->failed = true;
    if (y->error == YAML_READER_ERROR)
        bt_errors_add(p->err, "%s: byte %zu is not UTF-8 text (%s); is this a case file? save it as UTF-8", p->name,
                      y->problem_offset, y->problem);
    else tell_syntax(p);
    return false;
}

static bool refuse(parser *p, int line, const char *why)
{
    bt_errors_add(p->err, "%s:%d: %s", p->name, line, why);
    p->failed = true;
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

static bool plain_event(parser *p, const yaml_event_t *e, int line)
{
    const yaml_char_t *anchor = NULL, *tag = NULL;
    if (e->type == YAML_SCALAR_EVENT) anchor = e->data.scalar.anchor, tag = e->data.scalar.tag;
    if (e->type == YAML_MAPPING_START_EVENT) anchor = e->data.mapping_start.anchor, tag = e->data.mapping_start.tag;
    if (e->type == YAML_SEQUENCE_START_EVENT) anchor = e->data.sequence_start.anchor, tag = e->data.sequence_start.tag;
    if (e->type == YAML_ALIAS_EVENT || anchor)
        return refuse(p, line,
                      "anchors and aliases (& and *) are not read in a case file; write the value out, or quote a text "
                      "that begins so");
    if (tag)
        return refuse(p, line, "tags (!) are not read in a case file; remove the tag, or quote a text that begins so");
    return true;
}

static bt_node *read_node(parser *p, const yaml_event_t *first, int depth);

static void read_map(parser *p, bt_node *map, int depth)
{
    for (;;) {
        yaml_event_t e;
        if (!next(p, &e)) return;
        if (e.type == YAML_MAPPING_END_EVENT) {
            yaml_event_delete(&e);
            return;
        }
        int line = (int)e.start_mark.line + 1;
        bool good = plain_event(p, &e, line);
        if (good && e.type != YAML_SCALAR_EVENT) good = refuse(p, line, "a key must be a word; write key: value");
        if (good && memchr(e.data.scalar.value, 0, e.data.scalar.length))
            good = refuse(p, line, "a key holds a NUL character; remove it");
        if (good && map->n >= BT_TREE_MAP)
            good = refuse(p, line, "more than 256 keys in one map; see bergtow --list-keys for the keys there are");
        char *key = good ? copy_text(e.data.scalar.value, e.data.scalar.length) : NULL;
        yaml_event_delete(&e);
        if (!good) return;

        bt_node *value = NULL;
        if (next(p, &e)) {
            value = read_node(p, &e, depth + 1);
            yaml_event_delete(&e);
        }
        int twin = -1;
        for (int i = 0; i < map->n && twin < 0; i++)
            if (!strcmp(map->key[i], key)) twin = i;
        if (value && twin >= 0)
            bt_errors_add(p->err, "%s:%d: %s: duplicate key, first given in line %d; remove one of them", p->name, line,
                          key, map->key_line[twin]);
        if (!value || twin >= 0) {
            bt_tree_free(value);
            free(key);
        } else {
            append(map, key, line, value);
        }
        if (p->failed) return;
    }
}

static void read_list(parser *p, bt_node *list, int depth)
{
    for (;;) {
        yaml_event_t e;
        if (!next(p, &e)) return;
        bool end = e.type == YAML_SEQUENCE_END_EVENT;
        bt_node *value = end ? NULL : read_node(p, &e, depth + 1);
        yaml_event_delete(&e);
        if (value) append(list, NULL, 0, value);
        if (end || p->failed) return;
    }
}

static bt_node *read_node(parser *p, const yaml_event_t *first, int depth)
{
    int line = (int)first->start_mark.line + 1;
    if (!plain_event(p, first, line)) return NULL;
    if (depth > BT_TREE_DEPTH)
        return refuse(p, line, "nested deeper than 16 levels; no key of a case needs that"), NULL;
    if (++p->n_nodes > BT_TREE_NODES)
        return refuse(p, line,
                      "more than 2 million values; put large fields into an HDF5 file and name it in ice.field"),
               NULL;

    bt_node *node = bt_alloc(1, sizeof *node);
    node->line = line;
    if (first->type == YAML_MAPPING_START_EVENT) {
        node->kind = BT_NODE_MAP;
        read_map(p, node, depth);
    } else if (first->type == YAML_SEQUENCE_START_EVENT) {
        node->kind = BT_NODE_LIST;
        read_list(p, node, depth);
    } else {
        node->kind = BT_NODE_SCALAR;
        node->plain = first->data.scalar.style == YAML_PLAIN_SCALAR_STYLE;
        if (memchr(first->data.scalar.value, 0, first->data.scalar.length))
            refuse(p, line, "a text holds a NUL character; remove it");
        node->text = copy_text(first->data.scalar.value, first->data.scalar.length);
    }
    return node;
}

static bt_node *read_document(parser *p)
{
    bt_node *root = NULL;
    int n_documents = 0;
    for (bool end = false; !end && !p->failed;) {
        yaml_event_t e;
        if (!next(p, &e)) break;
        if (e.type == YAML_STREAM_END_EVENT) end = true;
        else if (e.type == YAML_DOCUMENT_START_EVENT && ++n_documents > 1)
            refuse(p, (int)e.start_mark.line + 1, "a second document begins (---); keep one case in a file");
        else if (e.type == YAML_SCALAR_EVENT || e.type == YAML_MAPPING_START_EVENT ||
                 e.type == YAML_SEQUENCE_START_EVENT || e.type == YAML_ALIAS_EVENT)
            root = read_node(p, &e, 0);
        yaml_event_delete(&e);
    }
    return root;
}

bt_node *bt_tree_parse(const char *text, size_t n, const char *name, bt_errors *err)
{
    parser p = {.name = name, .text = text, .n = n, .err = err};
    if (!yaml_parser_initialize(&p.yaml)) {
        bt_errors_add(err, "%s: libyaml could not start; free some memory", name);
        return NULL;
    }
    // Without this libyaml takes two leading bytes of a binary file for UTF-16.
    yaml_parser_set_encoding(&p.yaml, YAML_UTF8_ENCODING);
    yaml_parser_set_input_string(&p.yaml, (const unsigned char *)text, n);
    bt_node *root = read_document(&p);
    yaml_parser_delete(&p.yaml);
    if (p.failed) {
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

bool bt_tree_has(const bt_node *node, const char *key)
{
    for (int i = 0; node && node->kind == BT_NODE_MAP && i < node->n; i++)
        if (!strcmp(node->key[i], key)) return true;
    return false;
}
