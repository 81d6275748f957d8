// SPDX-License-Identifier: MIT
// The division of a world among ranks: owners of cells, and exchanges. world->domain == NULL: one rank, nothing to do.
#ifndef BERGTOW_DOMAIN_H
#define BERGTOW_DOMAIN_H

#include "bergtow/comm.h"
#include "bergtow/world.h"
#include "space/exchange.h"
#include "space/phases.h"

typedef struct bt_domain bt_domain;

/// Costs of the division.
typedef struct bt_domain_stats {
    int64_t divisions;       ///< after the first
    /// work of the busiest rank in each kind (cut.h) / mean − 1 over the checks, mean of those after the first division
    /// that knew the work; NaN without one
    double imbalance;
    double worst_imbalance;  ///< largest of them
    int64_t checks;
    /// the same just after a division, of the work from which it was made: mean over `divisions`, NaN if there was none
    double repartition_imbalance;
    double worst_repartition_imbalance;
    double cut;              ///< share of neighbouring cell pairs that lie on different ranks, last division
    double halo;             ///< bodies held but not owned / bodies owned, all ranks, last division
    int64_t moved;           ///< bodies that went to another rank
    int64_t undivided;       ///< steps in which one rank had all cells
} bt_domain_stats;

/// Collective. Distribute a world that all ranks hold in full, before its first step or between steps. Nothing on one
/// rank.
void bt_domain_create(bt_world *world, const bt_comm *comm);
void bt_domain_free(bt_domain *domain);

/// Costs of the division so far; zeros for one rank.
bt_domain_stats bt_domain_get_stats(const bt_world *world);
/// Collective. Run `solve`: on all ranks, or, if one of them has all cells, on that rank as if there were no others.
/// Then give all ranks the numbers of the step, the velocities of large bodies, the tow line's impulse, and
/// displacements (an array over the bodies, or NULL).
void bt_domain_solve(bt_world *world, void (*solve)(bt_world *world), bt_vel *shift);
/// Does another rank have all cells, so that this one takes no part in a solve?
bool bt_domain_is_idle(const bt_world *world);
/// Collective. Account for the work of the step just done.
void bt_domain_note(bt_world *world);
/// Wall time spent waiting for other ranks since the last call, s.
double bt_domain_exchange_time(const bt_world *world);
/// Collective. Check that all ranks that hold a body agree to the bit, every body is owned once, and every rank holds
/// the bodies that its cells need. Ends the run with the id of a body if not. With -DBT_VALIDATE after every migration
/// and every BT_VALIDATE_STEPS steps.
void bt_domain_validate(bt_world *world);
enum { BT_VALIDATE_STEPS = 20 };

/// Does this rank own body i?
bool bt_domain_owns(const bt_world *world, bt_idx i);

/// Update owners after a change: body i of this rank is, or is a piece of, the body stored at from[i] before.
void bt_domain_follow(bt_world *world, const bt_idx *from);

/// Collective. Maxima over the ranks.
void bt_domain_maxima(const bt_world *world, double *x, int n);
/// Collective. Totals of a pass over the ranks.
void bt_domain_reduce(const bt_world *world, bt_totals *totals);
/// Collective. Sum modulo 2⁶⁴ over the ranks.
uint64_t bt_domain_sum_words(const bt_world *world, uint64_t x);

/// Collective. Gather rows of doubles [n][width] of all ranks on rank 0, see bt_comm_gather; only with a division.
double *bt_domain_gather(const bt_world *world, int64_t n, int width, const double *rows, int64_t *total);

/// Collective. After labelling: choose owners, move bodies (owned and ghosts) and contact memory to where they belong
/// now. Takes and returns the memory.
bt_memory *bt_domain_migrate(bt_world *world, bt_memory *memory, int64_t *n);
/// Collective. After the cells have been made: find out what to exchange with which rank.
void bt_domain_connect(bt_world *world);

/// Takes the value, above 0, of a cell of another rank.
typedef void bt_take_cell(bt_cells *cells, int32_t x, int32_t y, double value);
/// Collective. Send a value [n cells] of this rank's cells to the ranks that hold neighbouring cells, and take theirs.
void bt_domain_tell_cells(bt_world *world, const double *value, bt_take_cell *take);
/// Set a bit for every body [n bodies] that the contacts of a cell touch.
typedef void bt_touch(const bt_cell *cell, uint8_t bit, uint8_t *touched);
/// Collective. After the detection: select the bodies that the contacts of this step touch.
void bt_domain_select(bt_world *world, bt_touch *touch);
/// Call `mark` for floes here that have a contact with a large movable body of another rank.
void bt_domain_beside_large(bt_world *world, void (*mark)(bt_world *world, bt_idx body));
/// Call `mark` for floes here that have a contact of this step on another rank.
void bt_domain_moved_elsewhere(bt_world *world, void (*mark)(bt_world *world, bt_idx body));
/// After a phase: send the changes of its border cells in v (an array over the bodies), and receive the others'.
void bt_domain_send(bt_world *world, int phase, bt_vel *v);
void bt_domain_receive(bt_world *world, int phase, bt_vel *v);
/// Collective. After the solve: send the velocities of large bodies, the tow line's impulse, and displacements (an
/// array over the bodies, or NULL) to all ranks.
void bt_domain_settle(bt_world *world, bt_vel *shift);

/// Collective. Gather records of `size` bytes on all ranks, in the order of the ranks; on one rank a copy of its n
/// records. The caller frees.
void *bt_domain_gather_all(const bt_world *world, const void *mine, size_t n, size_t size, size_t *n_all);

/// Collective. Largest value of every body over the ranks that hold it: x [n bodies].
void bt_domain_largest(const bt_world *world, double *x);

/// Collective. Copies of the floes that this rank does not hold, but that lie within this many cells along x and y of
/// one that it needs, or within `reach`, m, of a large movable floe that it owns; empty on one rank. needs: [cells].
/// Release with bt_bodies_free.
void bt_domain_around(const bt_world *world, const bool *needs, const int rings[2], double reach, bt_bodies *copies);
/// Collective. Send the values of every body, x [n bodies][width], from its owner to all ranks that hold it.
void bt_domain_share(const bt_world *world, double *x, int width);

/// Collective. Join the names of islands that meet in a body held by several ranks: name [n bodies] in and out.
void bt_domain_join_names(const bt_world *world, bt_gid *name);
/// Collective. Add sums of islands with the same name over the ranks.
void bt_domain_add_by_name(const bt_world *world, const bt_idx *root, const bt_gid *name, bt_sum *sum);

#endif
