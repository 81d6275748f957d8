// SPDX-License-Identifier: MIT
// Services for contact laws: the record of a pair, the points of its contact that take part in a step and the length on
// which they bear, and the work of its impulses.
#ifndef BT_LAW_PAIR_H
#define BT_LAW_PAIR_H

#include "contact/law.h"

/// Is the pair of a record still near: at most BT_LAW_MEMORY mean floe sizes apart?
bool bt_law_near(const bt_world *world, const bt_memory *memory);

/// Index in the cell of the record with a, b, part and law as in `names`; −1 = none.
bt_idx bt_law_find(const bt_cell *cell, const bt_memory *names);

/// Write the record over the one at `at`, or append it if `at` is −1; bt_laws_grow then sorts new ones in.
void bt_law_put(bt_cell *cell, bt_idx at, const bt_memory *memory);

/// Points of a contact that take part in this step: those that close at the velocities without contacts, and those at
/// most a slop farther than the nearest, whatever their velocities.
typedef struct bt_closing {
    bool point[2];
    int n;           ///< how many; at least one
    double gap;      ///< the least of all points, between the remaining surfaces, at least 0, m
    double approach; ///< the fastest of those that take part, at least 0, m/s
} bt_closing;

/// The closing points of contact j of the cell, made from the manifold, at its present gaps. Whether any other point
/// exists depends on the margin of the search, and so on the speeds of bodies nearby, on which the load must not
/// depend.
bt_closing bt_law_closing(const bt_world *world, const bt_cell *cell, bt_idx j, const bt_manifold *manifold);

/// Approach of point i at the start of the step or at the velocities without contacts, whichever is faster; at least 0,
/// m/s.
double bt_law_approach(const bt_world *world, const bt_contact *contact, int i);

/// Does a point take part, by its gaps between the remaining surfaces and between the outlines, m, and its approach?
/// least: the first gap of the nearest, at least 0; nearest: the second.
bool bt_law_takes_part(const bt_world *world, double gap, double outline, double approach, double least,
                       double nearest);

/// Place of point i along the tangent, from the centroid of a, m.
static inline double bt_law_along(const bt_manifold *manifold, int i)
{
    return manifold->nx * manifold->p[i].ra[1] - manifold->ny * manifold->p[i].ra[0];
}

/// The part of the tangent line on which a contact bears.
typedef struct bt_patch {
    double length, middle; ///< m; m from the centroid of a along the tangent; NaN without overlap
} bt_patch;

/// Extent along the tangent of the overlap of a and b after b has moved `way`, m, towards a along the normal; *area: of
/// the overlap, m².
bt_patch bt_law_patch(const bt_world *world, const uint16_t part[2], const bt_manifold *manifold, double way,
                      double *area);

/// Share of point i of the manifold in a uniform pressure on the patch, replaced by forces at the points that take
/// part. Equal shares if the patch is NaN.
double bt_law_share(const bt_manifold *manifold, int i, bt_patch patch, const bt_closing *closing);

/// Key (a, b, part, law) of the record that a law has, or would have, of the pair.
static inline bt_memory bt_law_names(const bt_world *world, const bt_pair *pair, int law)
{
    const bt_gid *gid = world->bodies.gid;
    return (bt_memory){.a = gid[pair->a], .b = gid[pair->b], .part = {pair->part[0], pair->part[1]},
                       .law = (uint16_t)law};
}

/// Work of the impulses of the contact in this step, Σ λ·½(w1 + w2), J, from the relative velocity at its start. With
/// the work of loads and line taken alike, Σ J·½(U1 + U2), it adds up to the change of kinetic energy. Taken from the
/// velocity after the loads (bt_contacts_gain), it would count ½ λᵀWλ of a contact at rest that only bears them.
double bt_contacts_work(const bt_world *world, const bt_contact *contact);

/// The part of that work done by the normal impulse of point i, J.
double bt_contacts_normal_work(const bt_world *world, const bt_contact *contact, int i);

/// Energy that the impulses of the contact add to the step without contacts, Σ λ·½(w* + w2), J; never positive in an
/// exact solution. w* is the velocity without contacts, with the tow line's impulse: of simultaneous impulses that of
/// the line counts first, or its pull into the ice would count as a gain by the ice.
double bt_contacts_gain(const bt_world *world, const bt_contact *contact);

/// The most that the contact can have gained in a step with this residual, m/s, J: an exact solution has λ·w <= 0, and
/// λᵀ½(w* + w2) = λᵀw2 − ½ λᵀWλ <= Σ |λ| residual.
double bt_contacts_unsolved_gain(const bt_contact *contact, double residual);

#endif
