// SPDX-License-Identifier: MIT
// Contact laws of a program that uses the library: what bounds the load of a contact, and what a pair remembers of it.
//
// Every contact point obeys 0 <= λ <= L Δt, w > 0 only if λ = 0, and Coulomb's law with that λ. A law gives L, N, from
// the contact and from four numbers that the pair remembers. At the bound the bodies go into each other; how much of
// that stays, the law says as `given`: overlap which is no overlap, because what stood there has yielded. Where several
// laws apply the least bound holds, and the law that sets it gives way.
//
// Detection, sweeps, ranks, checkpoints, hash of the state, series, summary, ensembles, pictures and report need no
// line of the law: the numbers that a pair remembers go with it, and NAME_work, what its points have taken at their
// bound (J), is a quantity (bergtow/quantity.h), as are the numbers that the law adds. The laws of the program itself,
// crushing and rafting, also change what touches and bound points by their approach; they stand in src/contact. How to
// add one: docs/how-to-add-a-contact-law.md.
#ifndef BERGTOW_CONTACT_H
#define BERGTOW_CONTACT_H

#include "bergtow/case.h"
#include "bergtow/law_key.h"
#include "bergtow/world.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A contact of two bodies, as a law sees it.
typedef struct bt_law_contact {
    const bt_world *w;
    bt_idx a, b;              ///< indices into w->bodies; gid[a] < gid[b]
    const double *own;        ///< [BT_MAX_CONTACT_OWN] numbers of the law
    int n;                    ///< contact points, 1 or 2
    /// at the start of the step, m. In `bound`: of the outlines, with what laws that were registered later have given;
    /// in `remember`: with what all laws have given
    double gap[2];
    double length;            ///< between two points that take part, along the tangent, m; 0 with one of them
    double value[4];          ///< what the pair remembers; all 0 where it remembers nothing yet
    // after the solve; 0 before
    double load[2];           ///< mean normal load of the points over the step, N
    double grown[2];          ///< by how much the bodies go into each other in this step, at this law's bound, m
    // before and after
    /// Does the point take part in this step: the outlines close there by the velocities before the contacts, or no
    /// more than a slop later than at the other one? Whether any other point is there at all depends on how far the
    /// search for contacts looks, so that no bound may depend on it
    bool closes[2];
} bt_law_contact;

/// A number of a law, summed over all pairs in a step: a series, and a number of the summary.
typedef struct bt_contact_number {
    const char *name;         ///< of the series
    const char *units;        ///< SI; "1" for a number
    const char *description;  ///< a sentence
    bool state;               ///< what is there at the end (by `count`), not what the steps add up (by `remember`)
} bt_contact_number;

typedef struct bt_contact_law {
    const char *name;         ///< lower-case letters, digits and _
    const char *doc;          ///< one line: what gives way
    const bt_law_key *keys;   ///< [n_keys]; by their presets the law should do nothing
    int n_keys;
    const bt_contact_number *numbers; ///< [n_numbers]
    int n_numbers;
    /// own[] from other keys of the case; own[0..n_keys) are there. NULL = that is all
    void (*setup)(const bt_case *input, double own[BT_MAX_CONTACT_OWN]);
    /// Does the law bound anything at all in a world with these numbers?
    bool (*on)(const double *own);
    /// To this pair? Must not depend on where they are. NULL = to all
    bool (*applies)(const bt_world *world, bt_idx a, bt_idx b, const double *own);
    /// load[i]: the most that point i bears in this step, N, INFINITY before; given[i]: by how much what
    /// stood at point i has receded, m, 0 before: the bodies meet when they overlap by that
    void (*bound)(const bt_law_contact *contact, double load[2], double given[2]);
    /// After the solve, for each contact in cells at work: set contact->value for the next step from load and grown,
    /// and add to the numbers that are no state. Returns true when the pair has something to remember; that is kept
    /// until the outlines part by a tenth of the mean floe size. NULL = never
    bool (*remember)(bt_law_contact *contact, double *number);
    /// What one pair that remembers adds to the numbers that are a state. NULL = nothing
    void (*count)(const double value[4], const double *own, double *number);
} bt_contact_law;

/// Add a law to the table, for a program that uses the library: before it reads a case or makes a world, from one
/// thread, on all ranks alike and in the same order in every program that resumes its runs: a checkpoint of others is
/// refused. The law and its texts remain the caller's and must stay where they are to the end of the program. Errors:
/// BT_ERR_USAGE with the reason.
bt_status bt_contact_register(const bt_contact_law *law, bt_errors *err);

/// How many have been added.
int bt_n_contact_laws(void);
/// The k-th of them from 0, in the order of their registration.
const bt_contact_law *bt_contact_law_of(int k);

#ifdef __cplusplus
}
#endif

#endif
