// SPDX-License-Identifier: MIT
// Contact laws of a program that uses the library: bounds on the load of a contact, and the memory of a pair.
//
// Every contact point obeys 0 <= λ <= L Δt, w > 0 only if λ = 0, and Coulomb's law with that λ. A law gives L, N, from
// the contact and from four numbers stored with the pair. At the bound the bodies penetrate each other; the law returns
// the permanent part as `given`: permitted overlap, because the material there has yielded. If several laws apply, the
// least bound holds, and the law that sets it gives way.
//
// Detection, sweeps, ranks, checkpoints, hash of the state, series, summary, ensembles, pictures and report need no
// code in the law: the numbers stored with a pair travel with it, and NAME_work, the work done at the bounds of its
// points (J), is a quantity (bergtow/quantity.h), as are the numbers that the law adds. The program's own laws,
// crushing and rafting, can also replace contacts and have bounds that depend on the approach; they are in src/contact.
// How to add one: docs/how-to-add-a-contact-law.md.
#ifndef BERGTOW_CONTACT_H
#define BERGTOW_CONTACT_H

#include "bergtow/case.h"
#include "bergtow/law_key.h"
#include "bergtow/world.h"

BT_BEGIN_C

/// A contact of two bodies, as passed to a law.
typedef struct bt_law_contact {
    const bt_world *w;
    bt_idx a, b;              ///< indices into w->bodies; gid[a] < gid[b]
    const double *own;        ///< [BT_MAX_CONTACT_OWN] parameters of the law
    int n;                    ///< contact points, 1 or 2
    /// at the start of the step, m. In `bound`: of the outlines, plus `given` of laws registered later; in `remember`:
    /// plus `given` of all laws
    double gap[2];
    double length;            ///< between two points that take part, along the tangent, m; 0 with one
    double value[4];          ///< memory of the pair; all 0 if it has none yet
    // after the solve; 0 before
    double load[2];           ///< mean normal load of the points over the step, N
    double grown[2];          ///< penetration in this step at this law's bound, m
    // before and after
    /// Does the point take part in this step: do the outlines close there at the velocities without contacts, or is its
    /// gap at most a slop larger than that of the other? Whether any other point exists depends on the margin of the
    /// search for contacts, so no bound may depend on it
    bool closes[2];
} bt_law_contact;

/// A number of a law, summed over all pairs in a step: a series, and a number of the summary.
typedef struct bt_contact_number {
    const char *name;         ///< of the series
    const char *units;        ///< SI; "1" for a number
    const char *description;  ///< a sentence
    bool state;               ///< describes the state at the end (by `count`), not a sum over steps (by `remember`)
} bt_contact_number;

typedef struct bt_contact_law {
    const char *name;         ///< lower-case letters, digits and _
    const char *doc;          ///< one line: the mechanism that gives way
    const bt_law_key *keys;   ///< [n_keys]; with their presets the law should do nothing
    int n_keys;
    const bt_contact_number *numbers; ///< [n_numbers]
    int n_numbers;
    /// set own[] from other keys of the case; own[0..n_keys) are already set. NULL = no others
    void (*setup)(const bt_case *input, double own[BT_MAX_CONTACT_OWN]);
    /// Does the law bound any contact in a world with these parameters?
    bool (*on)(const double *own);
    /// Does the law apply to this pair? Must not depend on their places. NULL = to all
    bool (*applies)(const bt_world *world, bt_idx a, bt_idx b, const double *own);
    /// load[i]: the most that point i bears in this step, N, INFINITY on entry; given[i]: by how much the material at
    /// point i has receded, m, 0 on entry: the bodies meet when they overlap by that
    void (*bound)(const bt_law_contact *contact, double load[2], double given[2]);
    /// After the solve, for each contact in active cells: set contact->value for the next step from load and grown, and
    /// add to the numbers that are not a state. Returns true if the values are to be stored; they are kept until the
    /// gap of the outlines exceeds a tenth of the mean floe size. NULL = never
    bool (*remember)(bt_law_contact *contact, double *number);
    /// Add the contribution of one pair with stored values to the numbers that are a state. NULL = nothing
    void (*count)(const double value[4], const double *own, double *number);
} bt_contact_law;

/// Add a law to the table, for a program that uses the library: before it reads a case or makes a world, from one
/// thread, on all ranks alike, and in the same order in every program that resumes its runs: a checkpoint with other
/// laws is rejected. The law and its texts must remain valid to the end of the program. Errors: BT_ERR_USAGE with the
/// reason.
bt_status bt_contact_register(const bt_contact_law *law, bt_errors *err);

/// Number of added laws.
int bt_n_contact_laws(void);
/// The k-th added law, from 0, in the order of registration.
const bt_contact_law *bt_contact_law_of(int k);

BT_END_C

#endif
