// SPDX-License-Identifier: MIT
// Islands of movable bodies that touch each other, over ranks too (private to the solver).
//
// An island is named by the gid of a body in it, that of its root. Where islands of several ranks meet in a body that
// both hold, the names belong together: every rank gathers these few (name here, name there) links and joins them by
// the same union-find; sums of islands that reach over ranks are added as exact sums, so it does not matter which of
// its bodies names an island.
#ifndef BT_ISLANDS_H
#define BT_ISLANDS_H

#include "bergtow/sum.h"
#include "bergtow/world.h"
#include "contact/cell_contacts.h"

typedef struct bt_islands {
    bt_idx *root;  ///< [n bodies] union-find of the movable bodies that touch
    bt_gid *name;  ///< [n bodies] at the roots: gid of a body of the island, the same on all ranks
    double *share; ///< [n bodies] at the roots: a number of the island, 1 at first
    /// [n bodies] at the roots: sums over this rank's part of the island, and by bt_islands_add over all of it
    bt_sum *sum;
    bt_idx cap;
} bt_islands;

bt_islands *bt_islands_create(void);
void bt_islands_free(bt_islands *islands);

/// Collective. Join the bodies of all contacts of this step that `joins` takes (NULL: of all).
void bt_islands_make(bt_world *world, bt_islands *islands, bool (*joins)(const bt_cell *cell, bt_idx contact));

/// The same of a contact with at least one movable body.
bt_idx bt_islands_of(const bt_world *world, bt_islands *islands, const bt_contact *contact);

/// Sums of all islands to 0.
void bt_islands_clear(const bt_world *world, bt_islands *islands);
/// Collective. Sums over this rank's part of each island to sums over the island.
void bt_islands_add(const bt_world *world, bt_islands *islands);

// --- bodies that cannot give way -------------------------------------------------------------------------------------

// Is there a load that would keep these bodies apart? (private to the solver)
//
// A wall, or a body that is led at a given speed, gives way to nothing. Bodies between two of them can be pressed so
// that no velocities of theirs part all contacts: the contact problem has no solution, and a sweep adds load after load
// for as long as one lets it.
//
//         wall                        body that is led           λ: grows with every sweep
//       ///|■■■■■■|■■■■■■■|■■■■■■|▶▶   w < 0 somewhere, always    Jᵀλ: hardly changes, the loads balance each other
//
// Proof for an island of movable bodies (contacts with a bound on their load left out, friction as well). Let λ ≥ 0 be
// any normal impulses, here those that the sweeps have come to, and w = J U + b the velocities of the contact points.
// For every U' that parts or keeps all contacts, J U' + b ≥ 0,
//
//     0 ≤ λ·(J U' + b) = λ·w + (Jᵀλ)·(U' − U),    so    max over bodies of |U' − U| ≥ A/P,
//     A = −λ·w,   P = Σ over bodies of |force part of Jᵀλ| + |moment part|/r,
//
// with |U' − U| the larger of the change of speed and r times that of the spin, r the radius of the body. Where A/P is
// far beyond any speed of the step, nothing can give way but in ways no ice takes. With P = 0 this is the lemma of
// Farkas. The λ that the sweeps have come to are balanced first: sweeps of the same problem with all that drives it at
// rest (U* = 0, b = 0) end at loads with Jᵀλ = 0, or at none.
//
// Friction. A wedge below its angle of friction between bodies that are led has velocities that part it, and still no
// load: sliding out at the speed u on two faces of half angle α takes M u = λ (sin α − μ cos α), and λ < 0 for
// tan α < μ. There the proof takes the friction of contacts that stick, those that the sweeps hold within
// BT_LOCKED_STICKS of their cones, w = 0 at a solution that holds them so, too, and of all others the normal impulse
// alone, λ_n w_n >= 0:
//
//     0 ≤ Σ over sticking λ·w' + Σ over others λ_n w_n' = λ·w + (Jᵀλ)·(U' − U),    so again    |U' − U| ≥ A/P.
//
// So no solution holds these contacts as these loads do, at any load. That says nothing of a solution whose contacts
// slide where these stick: Coulomb's law may have one far from here. A step counts only where the balanced loads
// are those that the sweeps have come to, within BT_LOCKED_OTHER of their sum: what the sweeps would print is then near
// none. Velocities that part every contact by μ times their slip at least would be enough for a solution (Acary,
// Cadoux, Lemaréchal & Malick 2011). That none do was rejected as the proof: in dense boxes steps converge to loads of
// kilonewtons where a linear programme finds none.
//
// A load that is finite, however large, is not taken for a lock: a wedge above its angle of friction slides on both
// faces, at the rim of its cones, and loads within BT_LOCKED_STICKS of them leave it P ≥ 2 λ sin(α − α_s) with
// tan α_s = BT_LOCKED_STICKS μ, so A/P is some closing speeds over (1 − BT_LOCKED_STICKS) μ. A wedge between α_s and
// its angle of friction is not recognised, and counts as a step that did not converge.

/// Factor on the largest closing speed without loads: bodies that part faster than this are not physical, assumed.
#define BT_LOCKED_SPEEDS 10
/// The same where friction takes part: well above 1/((1 − BT_LOCKED_STICKS) μ), assumed.
#define BT_LOCKED_HELD_SPEEDS 1e3
/// Share of the friction bound below which a contact sticks; the loads of the proof stay within it, assumed.
#define BT_LOCKED_STICKS 0.95
/// Of the normal impulses: by so much may balanced loads differ from those that the sweeps have come to, assumed.
#define BT_LOCKED_OTHER 0.1
/// Of the normal impulses that the sweeps have come to: balanced loads below are rounding.
#define BT_LOCKED_ROUNDING 1e-9
/// Sweeps that balance the loads at most, and the change of speed, over the closing speed, that ends them.
#define BT_LOCKED_SWEEPS 400
#define BT_LOCKED_AT_REST 1e-12
/// What helps, in the words of a message.
#define BT_LOCKED_REMEDY                                                                                               \
    "let ice give way (ice.rafting.kappa, ice.crushing.pressure), tow by a line or a vessel (tow.mode), or move the "  \
    "walls away"

/// Bodies without a way out.
typedef struct bt_lock {
    bool found;  ///< in some island
    bool towed;  ///< in one that presses on the towed body, or holds it
} bt_lock;

/// Collective. After a solution that has not converged. Uses the array of the position projection; impulses and
/// velocities stay.
bt_lock bt_locked(bt_world *world);

#endif
