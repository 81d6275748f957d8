// SPDX-License-Identifier: MIT
// The state of a world as named arrays; output/checkpoint.h lists what belongs to it and what does not.
#ifndef BT_STATE_H
#define BT_STATE_H

#include <math.h>

#include "bergtow/field.h"
#include "bergtow/world.h"
#include "base/snapshot.h"
#include "field/lead.h"
#include "output/stall.h"
#include "loads/impact.h"

/// Collective, between steps. Add the state of the world; complete on rank 0, the others add nothing. Errors:
/// BT_ERR_NUMERIC (bodies lost).
bt_status bt_state_save(const bt_world *world, const bt_comm *comm, bt_snapshot *snap, bt_errors *err);

/// Collective. Load the state into a world that bt_setup_world has made from the same case and field, complete on every
/// rank; it is distributed to the ranks here. `snap` is the same on all ranks. Errors: BT_ERR_CASE (not of this case,
/// or of another version), BT_ERR_NUMERIC (the state does not have the hash it was saved with).
bt_status bt_state_load(bt_world *world, const bt_comm *comm, bt_snapshot *snap, bt_errors *err);

/// Name in a checkpoint ("tow/vessel_vx") of the first number of world, step, tow, window and collisions that is NaN or
/// infinite; NULL = all are finite. Numbers of the bodies are not checked.
const char *bt_state_not_finite(const bt_world *world, char name[64]);

/// Collective. Save the ice field at time zero, on rank 0. Its outlines are taken from the bodies, which keep them to
/// the bit: field->vertices may be NULL. Errors: BT_ERR_NUMERIC.
bt_status bt_state_save_field(const bt_field *field, const bt_world *world, const bt_comm *comm, bt_snapshot *snap,
                              bt_errors *err);
void bt_state_load_field(bt_field *field, bt_snapshot *snap);

/// Totals of splitting floes (bt_split_totals), in checkpoints and as keys of summary.json.
extern const bt_state_row bt_split_total_rows[];
extern const int bt_n_split_total_rows;

/// Save or load structs of the run outside the world, by their tables.
void bt_state_save_parts(const bt_lead_stats *stats, const bt_stall *stall, bt_snapshot *snap);
void bt_state_load_lead(bt_lead_stats *stats, bt_snapshot *snap);
void bt_state_load_stall(bt_stall *stall, bt_snapshot *snap);

// --- rows of members (private to state.c and state_field.c) ----------------------------------------------------------

/// A saved member: its place, its description for a reader of the file (h5dataset.h), and the check of its value.
/// Checks between members: state_check.c.
#define BT_STATE_MEMBER(struct_, label, type_, width_, member, units_, axes_, check_, meaning_) \
    {label, BT_ITEM_##type_, width_, offsetof(struct_, member), units_, meaning_, axes_, BT_ROW_##check_, NULL}
#define BT_STATE_ONE(struct_, label, type_, member, units_, check_, meaning_) \
    BT_STATE_MEMBER(struct_, label, type_, 1, member, units_, "one", check_, meaning_)
#define BT_N_OF(table) ((int)(sizeof(table) / sizeof *(table)))

// --- its check -------------------------------------------------------------------------------------------------------

/// Are the numbers of an open collision finite? Its corner is NaN if there is none.
bool bt_state_open_finite(const bt_impact_open *o);

/// Are all n numbers neither NaN nor infinite?
static inline bool bt_state_finite(const double *x, int64_t n)
{
    for (int64_t k = 0; k < n; k++)
        if (!isfinite(x[k])) return false;
    return true;
}

/// Report in `snap` the first error in a field; n_offsets and n_vertices are the lengths of its arrays.
void bt_state_check_field(const bt_field *field, int64_t n_offsets, int64_t n_vertices, bt_snapshot *snap);

/// The same for a world before it is distributed, and for the memory of contacts [n]; impacts: whether collisions were
/// loaded.
void bt_state_check(const bt_world *world, const bt_memory *memory, int64_t n, bool impacts, bt_snapshot *snap);

struct bt_split_record;
/// The same for the history of splits [n] with its vertices, for a world with its original bodies.
void bt_state_check_splits(const bt_world *world, const struct bt_split_record *rows, int64_t n, const double *vertex,
                           int64_t n_vertices, bt_snapshot *snap);

#endif
