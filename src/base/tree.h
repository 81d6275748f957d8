// SPDX-License-Identifier: MIT
// A YAML text as a tree of maps, lists and scalars with line numbers: the part of YAML that case files use.
#ifndef BT_TREE_H
#define BT_TREE_H

#include "bergtow/base.h"

typedef enum { BT_NODE_SCALAR, BT_NODE_LIST, BT_NODE_MAP } bt_node_kind;

typedef struct bt_node {
    bt_node_kind kind;
    int line;              ///< first line, from 1
    bool plain;            ///< scalar without quotes
    char *text;            ///< of a scalar
    int n, cap;            ///< entries of a list or map
    struct bt_node **item; ///< [n]
    char **key;            ///< [n] of a map
    int *key_line;         ///< [n] of a map
} bt_node;

/// Parse a text of n bytes into a tree. Returns NULL, with one message in err that begins with name and line, if the
/// text is not plain YAML: anchors, aliases, tags, several documents, keys that are not scalars and too deep nesting
/// are refused. Duplicate keys are reported, and the first one is kept. An empty text gives an empty map.
bt_node *bt_tree_parse(const char *text, size_t n, const char *name, bt_errors *err);
void bt_tree_free(bt_node *node);

/// The item of this key, and its line; NULL unless the node, which may be NULL, is a map that has it.
const bt_node *bt_tree_find(const bt_node *node, const char *key, int *line);

#endif
