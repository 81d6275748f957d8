// SPDX-License-Identifier: MIT
// Cells: the division of space that orders the contacts, colours them, and is distributed to threads and ranks.
//
// Space is cut into square cells, some floe diameters wide. A floe carries the coordinates (tx, ty) of the cell that
// its centroid was in when labels were last renewed. A contact of bodies a and b belongs to cell
//     T = (min(tx_a, tx_b), min(ty_a, ty_b)),
// so T touches only bodies of the 2×2 block {T, T+x, T+y, T+xy}, provided that bodies within reach of each other are in
// adjacent cells. This holds while side >= 2 r + margin + 2 a: r the largest radius, a the distance that a centroid may
// lie outside its cell. When some floe lies farther out, all labels are renewed (and floes sorted, and moved to their
// ranks).
//
// Cells whose coordinates have the same parity touch disjoint blocks: four colours, always, whatever the contacts. A
// Gauss–Seidel sweep goes through the colours; threads and ranks process the cells of a colour in parallel, and the
// contacts of a cell in sequence, in an order that follows from gids. So the sequence of updates of any body is the
// same for every division among threads and ranks. Rejected after trial: a colouring of the contact graph: 8 to 12
// colours and as many barriers and exchanges per sweep, tail colours of a few contacts, rows of one colour scattered
// over all memory, and colours that depend on each other through all ranks. A cell's floes and rows stay in the
// first-level cache while it is swept, so that several sweeps cost little more than one, and its partial sums are
// formed in a fixed order.
//
// Contacts with a large movable body (a berg on a line has hundreds) belong to the last cell, which the rank that owns
// the large bodies processes in sequence after the four colours; its bodies, and large bodies of infinite mass, are on
// every rank.
//
// Rest. A cell T is idle, and costs nothing, when every floe in its block and in a ring of cells around it has exactly
// the velocity of the water, there is no other force (bt_forces_rest), no large body that moves is near, and the
// position projection moved nothing there in the last step. So a floe costs nothing until it is touched; after a touch
// it slows down by its quadratic drag and never comes quite to rest. The ring is needed because contacts transmit
// motion within a step; motion that goes farther is detected after the solve (step.c).
//
// A step visits only the list of busy cells: cells that are not at rest, cells that are not idle, and cells whose
// bodies a contact of the step may move. Cells enter the list when they are woken (something moves nearby, forces have
// changed, labels are new) and leave it when none of these holds. All else is unchanged in the other cells, and they
// add zero to every sum. Floes that drift with moving water are moved in every step: then all cells are busy.
#ifndef BT_CELLS_H
#define BT_CELLS_H

#include <math.h>
#include <stdint.h>

#include "bergtow/sum.h"
#include "bergtow/world.h"

// --- the margin ------------------------------------------------------------------------------------------------------

// The largest distance at which bodies may still meet within the step.

/// The largest margin, m. A floe that covers more in a step is reported as outrun: a diverging solution must not need
/// cells, and pair lists, as large as the whole field.
double bt_margin_most(const bt_world *world);

/// Margin, m, for bodies of speed s, m/s, before contacts are solved: 2 Δt s and a fifth more, rounded up to a power of
/// √2 so that pair lists stay valid while speeds vary; at least the slop.
double bt_margin_for(const bt_world *world, double s);

/// Is a margin, m, enough for a solution with speed s, m/s?
bool bt_margin_holds(const bt_world *world, double margin, double s);

/// the fifth phase is the cell of the large movable bodies
enum { BT_COLOURS = 4, BT_PHASES = 5, BT_STRETCHES = 2 * BT_PHASES };

/// The best edges of a pair, and how long they remain so (contact/manifold.c). The relative pose at the time is stored;
/// motion since then follows from the present poses, however they were set.
typedef struct bt_axes {
    float x, y;          ///< from the centroid of a to that of b at the time, m
    float room;          ///< motion for which they stay the best, m; < 0: they are a guess
    /// lower bound of the gap at the time + path lengths of a and b then: no contact while paths + margin < reach
    float reach;
    uint16_t turn[2];    ///< yaws of a and b then, in 2^-16 turns
    int8_t edge[2];      ///< best of a and of b; -1: only that of the other counts, or unknown
} bt_axes;
#define BT_NO_AXES {.room = -1, .reach = -INFINITY, .edge = {-1, -1}}
_Static_assert(BT_MAX_VERTICES <= 128, "an edge in a byte with a sign");

/// A pair near enough to be tested for contact.
typedef struct bt_pair {
    bt_idx a, b;         ///< gid[a] < gid[b]
    /// index in the cell of its contact at the last detection (not of its sheets), −1 = none; the next contact of the
    /// pair takes over features and impulses from it
    bt_idx contact;
    uint16_t part[2];    ///< of a and of b (bt_part_first, _next); 0 unless not convex
    bt_axes axes;
} bt_pair;
_Static_assert(sizeof(bt_pair) == 40, "a floe in dense ice has four, and each is kept from step to step");

/// State of a cell's search for pairs, kept over many steps (pairs.c).
typedef struct bt_pair_search {
    bt_pair *pairs;                 ///< [n_pairs] sorted by (gid a, gid b, parts)
    bt_idx n_pairs, cap_pairs;
    bool listed;                    ///< the list is valid for margin_listed
    double margin_listed;           ///< m
    double moved_listed[4], large_listed; ///< paths when the list was made, see pairs.c
    /// [n_near] ascending: pairs that may soon come within the margin; the others need no test
    bt_idx *near;
    bt_idx n_near, cap_near;
    bool near_known;                ///< `near` belongs to the present list
    double margin_near, moved_near[4], large_near; ///< margin and paths when they were found
} bt_pair_search;

typedef struct bt_cell {
    int32_t x, y;                   ///< coordinates
    bt_idx first, end;              ///< its bodies in storage
    bt_idx right, above, diagonal;  ///< cells +x, +y, +xy: index, −1 = none
    bool own;                       ///< this rank solves its contacts and counts its bodies (large ones: rank 0)
    bool border;                    ///< some body of its block is held by other ranks too
    int8_t phase;                   ///< colour, or BT_COLOURS for the large bodies
    bool active;                    ///< its contacts are processed in this step
    bool just_detected;             ///< visited by the last detection
    uint64_t load;                  ///< bt_contacts_load before a repeated detection
    double margin;                  ///< m, of this step's detection
    bt_pair_search search;
    bt_idx n_contacts;              ///< of this step
    bt_idx n_listed;                ///< of these, in the next sweep
    bool swept;                     ///< sweeps over them, here or on another rank, may move its bodies
    int64_t updates;                ///< of contacts, since the balance of the ranks was last noted
    int64_t n_points;
    double overlap;                 ///< deepest, m; without crushed and rafted ice
    // Data of higher layers, which allocate, read and free it; NULL in a new cell.
    struct bt_contact *contacts;    ///< contact/cell_contacts.h
    struct bt_gaps *gaps;
    size_t contact_bytes;
    bt_idx cap_contacts;
    struct bt_law_state *laws;
    struct bt_work_list *work;      ///< solve/rounds.h
} bt_cell;

/// Order of a cell's visit in a pass (src/space/phases.h).
typedef struct bt_turn {
    _Atomic uint32_t done;          ///< number of the last pass that has visited it
    bt_idx n_before, before[8];     ///< cells around it that a pass visits first
    bt_idx n_listed;                ///< the first of these, which a sweep also visits
    char apart[64 - 11 * sizeof(bt_idx)]; ///< a cache line each
} bt_turn;

/// The share of one thread in one stretch of the order (src/space/phases.h).
typedef struct bt_share {
    _Atomic bt_idx next;            ///< the next cell to be taken, a place in the order
    bt_idx begin, end;
    char apart[64 - 3 * sizeof(bt_idx)]; ///< a cache line each
} bt_share;

enum { BT_FEW_CELLS = 64 }; ///< fewer are left to one thread: a team costs microseconds

/// NEW: at rest since the last step; U* must be formed once more. After that the prediction skips the cell.
enum { BT_AWAKE, BT_ASLEEP_NEW, BT_ASLEEP };

typedef struct bt_cells {
    bool labelled;                  ///< labels and storage order are valid
    double x0, y0;                  ///< corner of cell (0, 0) m, moving with the water
    double side_x, side_y;          ///< m
    double allowance;               ///< largest distance of a centroid outside its cell, m
    double max_radius;              ///< largest radius of a floe in a cell, over all ranks, m
    double heaviest;                ///< largest mass, kg
    bool rebounds;                  ///< some body has a restitution
    double margin_max;              ///< largest margin that these cells allow, m
    /// by how much the gap of the second point of a contact may exceed that of the first, whatever the margin, m
    double beside;
    int32_t low_x, low_y, n_x, n_y; ///< the box of cells that hold floes
    /// cells around a periodic direction, 0 = open; 1 = one cell, its own neighbour nowhere
    int32_t wrap_x, wrap_y;
    bt_cell *cell;                  ///< [n] last: the large bodies
    bt_idx n, cap;
    bt_idx *at;                     ///< [n_y][n_x] index of a cell, −1 = not on this rank
    int64_t cap_at;
    bt_idx n_in_cells;                 ///< bodies in cells: storage [0, n_in_cells); large and everywhere after them
    // every step
    /// [n] largest speed of the cell's bodies relative to the water, m/s; 0 = all at rest
    double *speed;
    double *bound;                  ///< [n] speed for which the margin of cell T is made, m/s
    double *moved;                  ///< [n] upper bound of the path lengths in the cell, m; only grows
    double moved_any;               ///< the same for any body in a cell
    /// [n] all bodies drift with the water and nothing moved them in the last step: BT_AWAKE, BT_ASLEEP_NEW or
    /// BT_ASLEEP
    uint8_t *asleep;
    /// [n] contacts of this step may move the cell's bodies. Not the opposite of asleep: a contact may reach a cell at
    /// rest
    uint8_t *awake;
    bt_idx *busy;                   ///< [n_busy] cells that a step visits, ascending, always with the last cell
    bt_idx n_busy;
    uint8_t *is_busy;               ///< [n]
    bool busy_sorted;
    /// [n_order] cells of this rank with work, by phase, border cells first in each
    bt_idx *order;
    bt_idx n_order;
    bt_idx start[BT_PHASES + 1];    ///< first cell of each phase in the order
    bt_idx n_border[BT_PHASES];     ///< cells at the border among those of each phase
    bt_turn *turn;                  ///< [n]
    uint32_t n_passes;              ///< passes in the order of the phases so far
    bt_share *share;                ///< [2][BT_STRETCHES][n_shares] of all cells; of the listed ones
    bt_idx n_shares, cap_shares;    ///< threads
    bt_idx *swept;                  ///< [n_swept] busy cells whose bodies sweeps over the lists may move
    bt_idx n_swept;
    bt_idx n_contacts;                 ///< on this rank
    bool relabel;                   ///< some floe lies too far outside its cell: renew before the next step
    bool still;                     ///< the water is at rest
    int64_t n_labellings;
} bt_cells;

bt_cells *bt_cells_create(void);
/// Free what is left after bt_cells_empty.
void bt_cells_free(bt_cells *cells);

/// Choose cells for the present poses and for margins up to twice this one, m, and label the floes with them. The cells
/// that exist stay as they are until bt_cells_make.
void bt_cells_choose(bt_world *world, double margin);
/// Sort storage by the labels, and make new cells around the bodies that this rank holds; there must be no cells left.
/// Every body index changes.
void bt_cells_make(bt_world *world);

/// Put cell k, or every cell, on the list of busy cells.
void bt_cells_wake(bt_cells *cells, bt_idx k);
void bt_cells_wake_all(bt_cells *cells);
/// Sort the list of busy cells after some have been woken.
void bt_cells_sort_busy(bt_cells *cells);
/// Remove from the list the cells that are at rest, idle, and not moved by contacts.
void bt_cells_leave(bt_cells *cells);

/// Forget the pair list of a cell: its next search starts from scratch.
void bt_cells_forget_pairs(bt_cell *cell);

/// Distance of the centroid of body i outside its cell, m.
double bt_cells_outside(const bt_world *world, bt_idx i);

/// Coordinates of the cell that owns the contacts between bodies of cells p and q.
void bt_cells_owner(const bt_cells *cells, const int32_t p[2], const int32_t q[2], int32_t out[2]);

/// Are cells p and q the same or neighbours, also across periods?
bool bt_cells_adjacent(const bt_cells *cells, const int32_t p[2], const int32_t q[2]);

/// Coordinate c around a periodic direction of n cells.
static inline int32_t bt_cells_wrapped(int32_t c, int32_t n) { return c >= 0 && c < n ? c : ((c % n) + n) % n; }

/// Capacity for n entries of a cell: a few more, or every step in which ice is pressed together would need new memory;
/// only a few, or dense ice would take a tenth more memory.
static inline bt_idx bt_cells_room(bt_idx n) { return n + n / 32 + 1; }

/// Index of the cell at (x, y), −1 = not on this rank.
static inline bt_idx bt_cells_at(const bt_cells *cells, int32_t x, int32_t y)
{
    if ((cells->wrap_x == 1 && x != 0) || (cells->wrap_y == 1 && y != 0)) return -1;
    if (cells->wrap_x) x = bt_cells_wrapped(x, cells->wrap_x);
    if (cells->wrap_y) y = bt_cells_wrapped(y, cells->wrap_y);
    x -= cells->low_x, y -= cells->low_y;
    if (x < 0 || y < 0 || x >= cells->n_x || y >= cells->n_y) return -1;
    return cells->at[(int64_t)y * cells->n_x + x];
}

/// May the bodies of cell k move other than by drifting with the water?
static inline bool bt_cells_moves(const bt_cells *cells, bt_idx k) { return !cells->asleep[k] || cells->awake[k]; }

/// Index of the cell that owns the contacts of bodies a and b, −1 = not on this rank.
bt_idx bt_cells_of_pair(const bt_world *world, bt_idx a, bt_idx b);

#endif
