// SPDX-License-Identifier: MIT
// Checkpoints: the whole state of a run in one file, from which it continues with the same bits.
//
// The promise. A run that is stopped, or killed, at any moment and resumed ends with the state, the series, the frames,
// the events, the collisions and the summary of an uninterrupted run, on any number of ranks and threads. Only wall
// times, and the costs of the division among ranks, are those of the pieces. A run killed before its first checkpoint
// starts again from case.resolved.yml, unless that or a file that it names has changed (src/case/case_files.h).
//
// The file. DIR/checkpoint.h5 is an HDF5 file protected by a checksum (src/base/checksum.h), of named arrays
// (src/base/snapshot.h); rank 0 gathers and writes it. It is written as checkpoint.h5.tmp and synced, the previous one
// is renamed checkpoint.previous.h5, the new one checkpoint.h5; so there is a complete one at every moment. It holds
// the case as text with its tables of current and wind, and the ice field as made, with the lead: a resumed run reads
// no other file except DIR/result.h5, and makes no field. The format number is part of the checksum; other formats are
// rejected.
//
// What is state. Everything that steps carry over is in the tables of src/output/state.c, src/output/record_resume.c,
// src/output/impact_store.c and src/run/run_state.c; nothing else writes or reads it. Member by member, S saved, D
// derived from case and field by the same functions as in a fresh run, - used within one step only:
//
//   bt_params         S constants (compared), water, wind, balance, tilt of the last step        D the rest
//   bt_bodies         S pose (x, y, yaw), vel, path, cell, disturbed, home.copy, lap, exposure
//                     D outline (a function of the yaw alone), gid, offset, mark, vertices, per_length,
//                       radius, area, mass, inertia, share,
//                       friction, restitution, thickness, drag, motion, large, home.x, home.y, home.yaw
//                     - vel_start, vel_free, inv: bt_forces_predict makes them anew, also for bodies at rest, since no
//                       cell is known to rest
//   bt_cells          S corner, sides, allowance, max_radius, heaviest, rebounds, margin_max, box, wrap, relabel:
//                       labels decide which cell owns a contact, and so the order of the sweeps. They are older than
//                       the poses, and cannot be made from them
//                     D cell array, at, n_in_cells, labelled
//                     - moved, moved_any, speed, bound, awake, busy, order, share, still
//                     not needed: asleep (a cell at rest is found to be so again)
//   bt_pair           S of those in contact: part
//                     not needed: axis, reach, the lists themselves: shortcuts that cannot change the contacts
//                     (contacts.h)
//   bt_memory         S all: the records of contact laws for pairs (contact/law.h)
//   bt_contact        S n, ln, lt (warm start)    - the rest
//   bt_gaps           S feature (warm start; reference edge)    - the rest
//   bt_limit, bt_solver, lists
//                     - all: momentum starts anew in every solve
//   bt_tow            S time, carriage, travel, way, mark, course, per branch lambda, taut, broken; vessel vx, vy, way
//                     D, - the rest
//   bt_forces         S acted, as names of the added laws
//                     D own
//                     - the record and place of the towed body
//   bt_undisturbed    S drift, vel
//                     D the rest
//   bt_window         S start, rear, counters, most, overtaken, dropped, brought
//                     D the rest
//   bt_environment    D (tables from the checkpoint)
//   bt_world          S step, drift, events
//                     - stats
//   bt_impacts        S open
//                     D rule, panels' places
//                     - contact, closed, collision, largest_quasi_static_load, panels' loads
//   bt_record         S history, numbers of entries and frames, the present entry, names of the forces of laws
//                     in result.h5: the entries and frames themselves
//   bt_impact_store   S numbers of rows, panel loads of the present entry and by blocks (src/loads/panel.h)
//                     in result.h5: the rows
//   bt_run_totals     S lead, stall, wall times; concentration, mean_thickness, mean_radius, outlines from the field
//                     D the rest
//   bt_guard          S in_a_row, locked, energy
//                     D the rest
//   bt_domain         not state: ownership by ranks affects no bit
//   random numbers    are keyed by seed, purpose and id (src/base/rng.h) and used by the field alone: no counter
//
// A test that resumes a run after every step shows that nothing is missing (tests/unit/test_checkpoint.c). States that
// no step can leave are rejected, even with a valid checksum (src/output/state_check.c).
#ifndef BT_CHECKPOINT_H
#define BT_CHECKPOINT_H

#include "bergtow/base.h"

struct bt_snapshot;

#define BT_CHECKPOINT_FILE "checkpoint.h5"
#define BT_CHECKPOINT_BEFORE "checkpoint.previous.h5"
#define BT_CHECKPOINT_DAMAGED                                                                                          \
    "checkpoint.damaged.h5" // a rejected checkpoint.h5, set aside when the next one was written
#define BT_FAILURE_FILE "failure.h5"

/// Begin a checkpoint: data added to `snap` from now on goes to dir/name.tmp at once. `snap` must be empty;
/// bt_snapshot_free releases it. bt_checkpoint_write returns any error from here on.
void bt_checkpoint_begin(struct bt_snapshot *snap, const char *dir, const char *name, bt_errors *err);
/// Complete dir/name from the data added since bt_checkpoint_begin: a complete file or none. The previous checkpoint.h5
/// is kept. Errors: BT_ERR_IO.
bt_status bt_checkpoint_write(struct bt_snapshot *snap, const char *dir, const char *name, bt_errors *err);

/// Read dir/checkpoint.h5, or the previous one if that is missing or rejected. *said: why the first was not used, for
/// the user, or NULL; the caller frees it, and *path, which must live as long as the snapshot. Errors: BT_ERR_IO,
/// BT_ERR_CASE (rejected).
bt_status bt_checkpoint_read(struct bt_snapshot *snap, const char *dir, char **path, char **said, bt_errors *err);

/// Is there a checkpoint in dir?
bool bt_checkpoint_there(const char *dir);

/// Remove the checkpoints of dir, as far as possible.
void bt_checkpoint_remove(const char *dir);

/// Print the contents of a checkpoint on stdout, one array per line. Errors as for bt_checkpoint_read.
bt_status bt_checkpoint_print(const char *path, bt_errors *err);

/// Compare two checkpoints; *difference: description of the first difference, NULL = none; the caller frees it. Errors
/// as for bt_checkpoint_read; a difference is not an error.
bt_status bt_checkpoint_compare(const char *a, const char *b, char **difference, bt_errors *err);

// --- units and axes of saved arrays ----------------------------------------------------------------------------------

/// Meaning of an array "group/name", its units (NULL: text) and axes; NULL if it has no description.
const char *bt_checkpoint_meaning(const char *name, const char **units, const char **axes);

#endif
