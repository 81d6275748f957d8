// SPDX-License-Identifier: MIT
// Is what was taken from a checkpoint a state that steps can leave? (private to state.c)
#ifndef BT_STATE_CHECK_H
#define BT_STATE_CHECK_H

#include <math.h>

#include "bergtow/field.h"
#include "space/cells.h"
#include "base/snapshot.h"

/// Are all n numbers neither NaN nor infinite?
static inline bool bt_state_finite(const double *x, int64_t n)
{
    for (int64_t k = 0; k < n; k++)
        if (!isfinite(x[k])) return false;
    return true;
}

/// Complains into s of the first thing that is wrong with a field, whose arrays have the lengths that the first two
/// give.
void bt_state_check_field(const bt_field *f, int64_t n_offsets, int64_t n_vertices, bt_snapshot *s);

/// The same for a world before it is distributed, and for the memory of contacts [n]; impacts: those were taken too.
void bt_state_check(const bt_world *w, const bt_memory *memory, int64_t n, bool impacts, bt_snapshot *s);

struct bt_split_record;
/// The same for the history of splits [n] with its vertices, for a world as it was in the beginning.
void bt_state_check_splits(const bt_world *w, const struct bt_split_record *rows, int64_t n, const double *vertex,
                           int64_t n_vertices, bt_snapshot *s);

#endif
