// SPDX-License-Identifier: MIT
// What all of the program uses of src/base/base.c and others have no use for.
#ifndef BERGTOW_INSIDE_H
#define BERGTOW_INSIDE_H

/// Is work on n things worth a team of threads? In the validation build always, so that small tests reach every
/// parallel loop.
#ifdef BT_VALIDATE
#define BT_MANY(n, few) ((n) >= 0 && (few) >= 0)
#else
#define BT_MANY(n, few) ((n) > (few))
#endif

/// Numbers of this thread are written and read with a decimal point from here on, whatever the locale of the program
/// that uses the library. Returns what bt_point_end takes to restore it; such pairs may lie within each other.
void *bt_point_begin(void);
void bt_point_end(void *before);

/// How the program ends at once, with a code and no return: _Exit, or what ends the other ranks, too.
void bt_leave_by(void (*by)(int code));

#endif
