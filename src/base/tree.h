// SPDX-License-Identifier: MIT
// A YAML text as a tree of maps, lists and scalars with line numbers: the part of YAML that case files use.
#ifndef BERGTOW_TREE_H
#define BERGTOW_TREE_H

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

/// Parse a text of n bytes into a tree; NULL with one message in err, prefixed by name and line, when the text is not
/// YAML of the plain kind: anchors, aliases, tags, several documents, keys that are not scalars and too deep nesting
/// are refused. Duplicate keys are reported and the first one is kept. An empty text gives an empty map.
bt_node *bt_tree_parse(const char *text, size_t n, const char *name, bt_errors *err);
void bt_tree_free(bt_node *node);

/// Is the node, which may be NULL, a map with this key?
bool bt_tree_has(const bt_node *node, const char *key);

#endif
