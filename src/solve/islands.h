// SPDX-License-Identifier: MIT
// Islands of movable bodies that touch each other, across ranks (private to the solver).
//
// An island is named by the gid of one of its bodies, its root. Where the islands of two ranks meet in a body that both
// hold, their names denote one island: every rank gathers these few links (name here, name there) and joins them by the
// same union-find. Sums over islands that span ranks are exact, so it does not matter which body names an island.
#ifndef BT_ISLANDS_H
#define BT_ISLANDS_H

#include "bergtow/sum.h"
#include "bergtow/world.h"
#include "contact/cell_contacts.h"

typedef struct bt_islands {
    bt_idx *root;  ///< [n bodies] union-find of the movable bodies that touch
    bt_gid *name;  ///< [n bodies] at the roots: gid of a body of the island, the same on all ranks
    double *share; ///< [n bodies] at the roots: a number of the island, 1 at first
    /// [n bodies] at the roots: sums over this rank's part of the island; after bt_islands_add, over all of it
    bt_sum *sum;
    bt_idx cap;
} bt_islands;

bt_islands *bt_islands_create(void);
void bt_islands_free(bt_islands *islands);

/// Collective. Join the bodies of all contacts of this step.
void bt_islands_make(bt_world *world, bt_islands *islands);

/// The root of the island of a contact with at least one movable body.
bt_idx bt_islands_of(const bt_world *world, bt_islands *islands, const bt_contact *contact);

/// Set the sums of all islands to 0.
void bt_islands_clear(const bt_world *world, bt_islands *islands);
/// Collective. Turn the sums over this rank's part of each island into sums over the whole island.
void bt_islands_add(const bt_world *world, bt_islands *islands);

// --- bodies that cannot give way -------------------------------------------------------------------------------------

// Is there a load that would keep these bodies apart? (private to the solver)
//
// A wall, or a body moved at a prescribed speed, does not give way. Bodies between two of them can be so confined that
// no velocities open all contacts: the contact problem then has no solution, and sweeps increase the loads without
// limit.
//
//         wall                        prescribed body            λ: grows with every sweep
//       ///|■■■■■■|■■■■■■■|■■■■■■|▶▶   w < 0 somewhere, always    Jᵀλ: hardly changes, the loads balance each other
//
// Proof for an island of movable bodies (contacts with a bound on their load left out, friction as well). Let λ ≥ 0 be
// any normal impulses, here those at the end of the sweeps, and w = J U + b the velocities of the contact points. For
// every U' that closes no contact, J U' + b ≥ 0,
//
//     0 ≤ λ·(J U' + b) = λ·w + (Jᵀλ)·(U' − U),    so    max over bodies of |U' − U| ≥ A/P,
//     A = −λ·w,   P = Σ over bodies of |force part of Jᵀλ| + |moment part|/r,
//
// with |U' − U| the larger of the change of speed and r times that of the spin, r the radius of the body. Where A/P is
// far beyond any speed of the step, the bodies could give way only at unphysical speeds. With P = 0 this is the lemma
// of Farkas. The λ at the end of the sweeps are balanced first: sweeps of the same problem without its driving terms
// (U* = 0, b = 0) end at loads with Jᵀλ = 0, or at zero loads.
//
// Friction. For a wedge below its angle of friction between prescribed bodies there are velocities that open the
// contacts, but no loads: sliding out at the speed u on two faces of half angle α takes M u = λ (sin α − μ cos α), and
// λ < 0 for tan α < μ. The proof then includes the friction of sticking contacts, those that the sweeps hold within
// BT_LOCKED_STICKS of their cones; at a solution that also holds them, w = 0 there. Of all others it takes only the
// normal impulse, λ_n w_n >= 0:
//
//     0 ≤ Σ over sticking λ·w' + Σ over others λ_n w_n' = λ·w + (Jᵀλ)·(U' − U),    so again    |U' − U| ≥ A/P.
//
// So no solution, at any load, holds these contacts as these loads do. There may still be a solution far from here
// whose contacts slide where these stick. A step therefore counts as locked only if the balanced loads agree with those
// at the end of the sweeps, within BT_LOCKED_OTHER of their sum: the result of the sweeps is then near no solution.
// Velocities that open every contact by at least μ times its slip are sufficient for a solution (Acary, Cadoux,
// Lemaréchal & Malick 2011). Rejected as a proof: that there are no such velocities. In dense boxes steps converge to
// loads of kilonewtons although a linear programme finds none.
//
// A finite load, however large, is not taken for a lock: a wedge above its angle of friction slides on both faces, at
// the rim of its cones, and loads within BT_LOCKED_STICKS of them leave it P ≥ 2 λ sin(α − α_s) with tan α_s =
// BT_LOCKED_STICKS μ, so A/P is a few closing speeds over (1 − BT_LOCKED_STICKS) μ. A wedge between α_s and its angle
// of friction is not recognised, and counts as a step that did not converge.

/// Factor on the largest closing speed without loads: bodies that part faster than this are not physical, assumed.
#define BT_LOCKED_SPEEDS 10
/// The same where friction takes part: well above 1/((1 − BT_LOCKED_STICKS) μ), assumed.
#define BT_LOCKED_HELD_SPEEDS 1e3
/// Share of the friction bound below which a contact sticks; the loads of the proof stay within it, assumed.
#define BT_LOCKED_STICKS 0.95
/// Largest difference between balanced loads and those at the end of the sweeps, over the normal impulses, assumed.
#define BT_LOCKED_OTHER 0.1
/// Balanced loads below this share of the normal impulses at the end of the sweeps are rounding.
#define BT_LOCKED_ROUNDING 1e-9
/// Largest number of sweeps that balance the loads, and the change of speed, over the closing speed, that ends them.
#define BT_LOCKED_SWEEPS 400
#define BT_LOCKED_AT_REST 1e-12
/// The remedy, as the messages give it.
#define BT_LOCKED_REMEDY                                                                                               \
    "let ice give way (ice.rafting.kappa, ice.crushing.pressure), tow by a line or a vessel (tow.mode), or move the "  \
    "walls away"

/// Whether bodies are locked.
typedef struct bt_lock {
    bool found;  ///< in some island
    bool towed;  ///< in an island that touches the towed body
} bt_lock;

/// Collective. After a solution that has not converged. Uses the array of the position projection; impulses and
/// velocities stay.
bt_lock bt_locked(bt_world *world);

/// Collective, between rounds of sweeps. Are bodies locked by rebounds? `whole` are the islands of all contacts, with
/// the share of restitution that each has left. Counts in their sums the contacts in locked parts where a row that
/// rebounds is loaded. By normal impulses the proof holds for the loads of any sweep; with friction they count only
/// once they are so large that they balance each other within BT_LOCKED_OTHER, as at the end of the sweeps.
bool bt_locked_by_rebounds(bt_world *world, bt_islands *whole);

#endif
