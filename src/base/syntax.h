// SPDX-License-Identifier: MIT
// What a syntax error of YAML comes from, in the words of who wrote the file.
#ifndef BT_SYNTAX_H
#define BT_SYNTAX_H

#include <stddef.h>

/// An error as libyaml tells of it; lines count from 1.
typedef struct bt_syntax {
    const char *text; ///< the whole input, n bytes
    size_t n;
    const char *problem;
    int line;  ///< of the problem
    int begun; ///< line in which what could not be ended began, 0 = none
} bt_syntax;

enum { BT_SYNTAX_WHY = 240 };

/// The slip behind the error: its line, with the remedy in why; 0 where it is none of those that are known.
int bt_syntax_explain(const bt_syntax *s, char why[BT_SYNTAX_WHY]);

#endif
