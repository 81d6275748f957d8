// SPDX-License-Identifier: MIT
// The struct behind domain.h (private to partition/).
#ifndef BERGTOW_DIVISION_H
#define BERGTOW_DIVISION_H

#include "bergtow/comm.h"
#include "partition/cut.h"
#include "partition/domain.h"
#include "space/pairs.h"

/// Data exchanged with one other rank.
typedef struct bt_link {
    int rank;
    // bodies that this rank's cells of a phase may change and the other rank holds, and the reverse; both list them in
    // the same order
    bt_idx *send[BT_PHASES], *receive[BT_PHASES];   ///< [n_...] indices of bodies
    bt_idx n_send[BT_PHASES], n_receive[BT_PHASES];
    // those of these that contacts of this step touch
    bt_idx *send_now[BT_PHASES], *receive_now[BT_PHASES];
    bt_idx n_send_now[BT_PHASES], n_receive_now[BT_PHASES];
    double *out, *in;                               ///< [3 × longest list] values in transit
    uint8_t *flags_out, *flags_in;                  ///< [sum of the lists] touched or not
    bt_idx n_flags_out, n_flags_in;
    // cells of which the other must know a value, and the reverse
    bt_idx *tell_send;                             ///< [n_tell_send] cells here
    int32_t (*tell_receive)[2];                    ///< [n_tell_receive] coordinates of cells there
    bt_idx n_tell_send, n_tell_receive;
    double *tell_out, *tell_in;
} bt_link;

struct bt_domain {
    const bt_comm *comm;
    bool distributed;        ///< bodies are distributed by the map; before that every rank holds all
    bool due;                ///< a new division is due
    bool undivided;          ///< rank 0 has all cells
    bool for_one;            ///< it is to have them from the next division on
    // the map: owner of every cell of the box
    int *owner;              ///< [n_y][n_x] rank
    uint8_t *under;          ///< [n_y][n_x] 1 = near a large movable body: its rank holds the cell too
    int32_t low_x, low_y, n_x, n_y;
    double side_x, side_y;   ///< of the cells for which it was made, m
    int large_owner;         ///< rank that owns the large movable bodies
    int64_t large_place;     ///< of a cell under them, or any
    bool movable;            ///< there are large movable bodies
    /// displacement of the water through cells that do not move with it (periodic directions), since then, m
    double drift;
    uint8_t *owned;          ///< [n bodies] this rank owns the body
    bt_idx cap_owned;
    // links
    bt_link *link;
    int n_links;
    MPI_Request *request;    ///< [2 n_links]
    int n_requests;
    uint8_t *touched;        ///< [n bodies] bit p: a contact of phase p touches it
    // work since the last check
    double (*work)[BT_CUT_KINDS]; ///< [n_y][n_x] of this rank's cells, s, modelled: sweeps, and the rest of a step
    int64_t steps;           ///< since then
    int64_t wait;            ///< steps from that check to the next
    int64_t sweeps;          ///< in these steps
    double imbalance_at_cut; ///< imbalance that the last cut left, or less since then
    double time_lost;        ///< since then by imbalance beyond that, or by one rank with all cells, s, modelled
    bool cut_without_work;   ///< no work was known at that cut: another is due, unless its parts turn out equal
    double spared;           ///< time that one rank with all cells would have saved since then, s, modelled
    double exchange_s;       ///< wall time in exchanges since the last query
    bt_domain_stats stats;
};

/// Kinds of work between which ranks wait for each other: sweeps, and the rest of a step.
enum { BT_WORK_SWEEPS, BT_WORK_REST };

/// Work of a body at rest, s: the weight of cells before anything has been counted.
#define BT_WORK_AT_REST 2e-9

/// Place of cell (x, y) in the map, −1 outside.
int64_t bt_division_place(const bt_world *world, int32_t x, int32_t y);

/// Must the field be divided, even where one rank alone would be faster?
bool bt_division_is_forced(const bt_world *world);

/// Time that dividing the field saves in each step against one rank with all cells, s, modelled; negative where one
/// rank is faster. work: of a step on all ranks, s.
double bt_division_gain(const bt_world *world, double work);

/// Rank that owns cell (x, y) of the map; −1 outside.
int bt_division_owner(const bt_world *world, int32_t x, int32_t y);

enum { BT_MAX_SHARERS = 5 };
/// Ranks that hold the bodies of cell (x, y), each once; returns their number.
int bt_division_sharers(const bt_world *world, int32_t x, int32_t y, int rank[BT_MAX_SHARERS]);

/// The cell of the phase that touches the bodies of cell (x, y); false if there is none.
bool bt_division_toucher(const bt_world *world, int phase, int32_t x, int32_t y, int32_t out[2]);

void bt_halo_free(bt_domain *domain);

/// Collective. End the run if bodies are lost or duplicate.
void bt_domain_check(bt_world *world);

/// Collective. Make a map for the present cells: renewed from the previous one, or (cut) cut anew.
void bt_division_map(bt_world *world, bool cut);

#endif
