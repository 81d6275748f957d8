// SPDX-License-Identifier: MIT
// Names of what a program adds: laws, shapes, quantities.
#ifndef BERGTOW_NAME_H
#define BERGTOW_NAME_H

#include <stdbool.h>

enum { BT_MOST_LAW_NAME = 40 }; ///< characters: the names of its series append a word to it, and 48 fit

/// Lower-case letters, digits and _, beginning with no digit, at most `most` of them.
bool bt_is_name(const char *s, int most);

#endif
