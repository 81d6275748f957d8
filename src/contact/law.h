// SPDX-License-Identifier: MIT
// Contact laws: a table with one row per law.
//
// Every pair obeys Signorini's conditions and Coulomb's (solve/solver.h). A law bounds the normal impulse of a contact
// point from above
//     0 <= λ <= L(w),   w > 0 only if λ = 0,   w < 0 only if λ is at its bound
//
// (L: an impulse, N s; in bergtow/contact.h a law gives the force L/Δt)
// and says what yields at the bound: a pair to which no law applies is rigid, L = ∞. If several laws apply, the least
// bound holds, and its law yields. The bounds of all laws have one form, so that one contact update serves all
// (solve/limit.h):
//     L(w) = min(most, max(flat, rise(−w − place))),   rise: a line, or the curve of contact/hit.h
//
// Memory. A law keeps one record per pair, bt_memory (space/cells.h), kept in the cell that owns the pair, sorted by
// (a, b, part, law). It is state: it goes with the pair to other cells and ranks, into checkpoints, and into the hash
// of the state, whatever the law. The impulses of the last step, which every pair keeps, travel and are saved in the
// same way, as the record of the rigid law.
//
// In a step: detection prunes the records (`keeps`), may replace the contacts of the outlines (contact/raft.h), reads
// the records (`recall`) and forms the bounds (`bound`); the sweeps know only bounds; after them `gives_way` tells
// which points are at the bound, `give_way` books the work of those that approach, and `remember` writes the record.
//
// A law that bounds the load of points from the record of their pair is one source file (bergtow/contact.h,
// contact/added.h). One that changes what touches, or whose bound rises with the approach, is one source file with its
// bt_law, an entry in the list below, its keys in src/case/schema.c, and a test in tests/physics. Series, summary,
// checkpoints and texts take its numbers from its tables; neither kind touches the sweep.
#ifndef BERGTOW_LAW_H
#define BERGTOW_LAW_H

#include "bergtow/case.h"
#include "bergtow/quantity.h"
#include "contact/contacts.h"
#include "contact/hit.h"
#include "space/phases.h"
#include "space/cells.h"

/// The program's own laws, as LAW(name, bt_law); checkpoints store the position in this list, so append new ones.
#define BT_CONTACT_LAWS(LAW) \
    LAW(RIGID, bt_rigid_law) \
    LAW(CRUSHING, bt_crush_law) \
    LAW(RAFTING, bt_raft_law)

/// Numbers of the laws: BT_LAW_RIGID and so on; laws that a program adds (bergtow/contact.h) follow from BT_LAWS on.
#define BT_LAW_NUMBER_OF(name, law) BT_LAW_##name,
enum { BT_CONTACT_LAWS(BT_LAW_NUMBER_OF) BT_LAWS, BT_ALL_LAWS = BT_LAWS + BT_MAX_ADDED_LAWS };
#undef BT_LAW_NUMBER_OF
_Static_assert((int)BT_ALL_LAWS <= (int)BT_MAX_LAWS, "each has its numbers of the case in bt_params.law_own");
_Static_assert(BT_MAX_LAW_NUMBERS + BT_MAX_ADDED_LAWS * (1 + BT_MAX_CONTACT_NUMBERS) <= BT_MAX_TOTALS,
               "a pass adds up the numbers of all laws");
enum { BT_MAX_LAW_TOTALS = 16 };

/// A number that a law forms in every step, over all ranks: a series (bergtow/quantity.h).
typedef struct bt_law_number {
    const char *name, *units, *description;
    bt_keep keep;     ///< how steps merge
    bool largest;     ///< the maximum that `count` returns, at most one number per law; else an exact sum
    const char *key;  ///< of the total in summary.json that stands for it
} bt_law_number;

/// How a run combines its steps. STEPS: the number of steps in which it is not 0; LAST: its value in the last step.
typedef enum { BT_TOTAL_SUM, BT_TOTAL_MAX, BT_TOTAL_STEPS, BT_TOTAL_LAST } bt_total_rule;

/// A running total of a number of a law, in checkpoints and in summary.json. Never rename one: files contain the names.
typedef struct bt_law_total {
    int number;                      ///< of its law
    bt_total_rule rule;
    const char *name;                ///< in a checkpoint, under history
    const char *key, *units, *description;
} bt_law_total;

/// A total over a run: whole of BT_TOTAL_STEPS, else real.
typedef union bt_total_value { double real; int64_t whole; } bt_total_value;

/// The rising part of the bounds of one contact (contact/crush.h): a line, or the curve of a hit.
typedef struct bt_rise {
    double base[2];  ///< never above flat, N s
    double slope[2]; ///< kg
    bt_hit hit[2];   ///< before = 0: none
    double depth[2]; ///< crushed so far, m
    double dent;     ///< the deepest that polygons of the same two outlines have crushed so far, m
} bt_rise;

/// Bounds of the points of one contact, and the laws that set them; all INFINITY (and slope 0) where no law applies.
typedef struct bt_limit {
    double flat[2];  ///< the bound at any approach; sheets, flat[0]: the bound of their friction, N s
    double most[2];  ///< N s
    double cap[2];   ///< the least flat bound of rafting and added laws; never below flat, N s
    union {
        double place[2];  ///< approach that just closes the gap, m/s
        double ends[2];   ///< of sheets: the bound of the ends of their overlap, along x and y, N s
    };
    double grown[2]; ///< penetration in this step, m
    bt_rise *rise;   ///< NULL where no law has a rising bound
    int32_t record[BT_ALL_LAWS]; ///< record of each law in the cell, −1 = none
    uint8_t by[2];   ///< the law that set cap
    bool closes[2];  ///< bt_closing by the outlines, for added laws
} bt_limit;
_Static_assert(sizeof(bt_limit) == 120, "one for each contact of ice that rafts");

/// Gap, in mean floe sizes, up to which a pair keeps its record; cells always reach that far.
#define BT_LAW_MEMORY 0.1

typedef struct bt_law {
    const char *name;  ///< one word
    const char *keys;  ///< section of the case, NULL = none
    const char *what;  ///< one sentence for people
    /// Set own[] (bt_params.law_own) from the case. The rigid law has neither this nor any member below
    void (*setup)(const bt_case *input, double own[BT_MAX_CONTACT_OWN]);
    bool (*on)(const double *own);
    bool rises; ///< some bounds have a rising part: contacts with them are not swept in batches (src/solve/batch.h)
    const bt_law_number *numbers; ///< [n_numbers]
    int n_numbers;
    const bt_law_total *totals;   ///< [n_totals], in the order of the summary
    int n_totals;
    /// Does the law apply to this pair?
    bool (*applies)(const bt_world *world, bt_idx a, bt_idx b);
    /// Contacts that replace those of the outlines for a pair with a record: an edge, if it returns true, and sheets
    /// (contact/raft.h). NULL = the outlines.
    bool (*contact)(const bt_world *world, const bt_pair *pair, const bt_memory *memory, bt_manifold *edge,
                    bt_manifold *sheets);
    /// Take over into limits[j] what the bounds, also of other contacts, need of the record of the pair. NULL = nothing
    void (*recall)(const bt_world *world, bt_cell *cell, bt_idx j, const bt_pair *pair, const bt_manifold *manifold);
    /// Narrow the bounds of contact j of the cell, made from the manifold of the pair; its gaps become those between
    /// the remaining surfaces.
    void (*bound)(const bt_world *world, bt_cell *cell, bt_idx j, const bt_pair *pair, const bt_manifold *manifold);
    /// Update the record to the poses; false drops it.
    bool (*keeps)(const bt_world *world, bt_memory *memory);
    /// The most that contact j bears until its bodies have lost this energy of their approach, J; N. NULL = what the
    /// bounds of the step say
    double (*bears)(const bt_world *world, const bt_cell *cell, bt_idx j, double energy);
    /// Is point i of the contact at the bound of this law?
    bool (*gives_way)(const bt_contact *contact, const bt_limit *limit, int i);
    /// Called if it is and still approaches; limits[j].grown[i] has been set.
    /// number, here and below: [n_numbers], the sums of the law's numbers.
    void (*give_way)(bt_world *world, bt_cell *cell, bt_idx j, int i, bt_sum *number);
    /// After the solve: update the records of the cell.
    void (*remember)(bt_world *world, bt_cell *cell, bt_idx j, bt_sum *number);
    /// Add a record to the sums; returns the value whose maximum the law reports. For all records, also at rest.
    double (*count)(const bt_world *world, const bt_memory *memory, bt_sum *number);
    // texts in new memory, or NULL for none
    /// A line of `bergtow check`: what the law means for floes of this thickness and mean size, m.
    char *(*check)(const bt_case *input, double thickness, double size);
    /// A line of the table at the end of a run; total [n_totals]; ice_area: of all ice, m².
    char *(*result)(const bt_case *input, const bt_total_value *total, double ice_area);
    /// Warn of doubtful totals; size: mean of the floes, m.
    void (*warn)(const bt_total_value *total, double size, bt_errors *warnings);
} bt_law;

#define BT_LAW_DECLARED(name, law) extern const bt_law law;
BT_CONTACT_LAWS(BT_LAW_DECLARED)
#undef BT_LAW_DECLARED
extern const bt_law *const bt_laws[BT_LAWS];

/// Index of the first number of law `law` when the numbers of all the program's laws are listed law by law; for
/// BT_LAWS: how many there are.
int bt_law_first_number(int law);
/// The same for totals.
int bt_law_first_total(int law);
/// Set the parameters of the laws from a case.
void bt_laws_setup(const bt_case *input, bt_params *par);

/// Is any law on whose bounds have a rising part?
bool bt_laws_rise(const bt_params *par);

/// Does any law bound contacts in this world?
bool bt_laws_on(const bt_params *par);
/// Does the law with this number bound contacts in this world? False if there is no such law.
bool bt_law_on(const bt_params *par, int law);
/// And the contacts of this pair?
bool bt_law_applies(const bt_world *world, int law, bt_idx a, bt_idx b);

/// At the start of a detection: drop the records that the cell no longer needs.
void bt_laws_prune(const bt_world *world, bt_cell *cell);

/// Make room for the bounds of the contacts of a cell.
void bt_laws_reserve(bt_cell *cell);

/// Begin the bounds of contact j of the cell, which was made from this manifold of the pair: no law bounds it yet, and
/// records have been read. For all contacts before any is bounded.
void bt_laws_recall(const bt_world *world, bt_cell *cell, bt_idx j, const bt_pair *pair, const bt_manifold *manifold);
/// Set its bounds.
void bt_laws_bound(const bt_world *world, bt_cell *cell, bt_idx j, const bt_pair *pair, const bt_manifold *manifold);

/// The most that contact j of the cell bears until its bodies have lost this energy of their approach, J; N, INFINITY
/// where no law limits it. After the solve, before poses move.
double bt_laws_bear(const bt_world *world, const bt_cell *cell, bt_idx j, double energy);

/// Collective. After the solve: update the records, and write work, numbers and depths to stats.
void bt_laws_grow(bt_world *world);

/// Apply a flat bound c of this law, N s, to point i, besides its present bounds.
static inline void bt_law_narrow(bt_limit *limit, int i, double c, int law)
{
    if (c < limit->cap[i]) limit->cap[i] = c, limit->by[i] = (uint8_t)law;
    limit->flat[i] = bt_min(limit->flat[i], c);
    limit->most[i] = bt_min(limit->most[i], c);
}

#endif
