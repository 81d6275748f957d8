// SPDX-License-Identifier: MIT
// What a contact law asks of a pair of bodies: what is remembered of it, which points of its contact take part in a
// step and on what length they bear, and the work of its impulses.
#ifndef BT_LAW_PAIR_H
#define BT_LAW_PAIR_H

#include "contact/law.h"

/// Is the pair of a record still near: at most BT_LAW_MEMORY mean floe sizes apart?
bool bt_law_near(const bt_world *world, const bt_memory *memory);

/// Record of the pair of names.a, b, part, law in the cell, −1 = none.
bt_idx bt_law_find(const bt_cell *cell, const bt_memory *names);

/// Write the record: over the one at `at`, or, −1, as a new one; new ones are in their order after bt_laws_grow.
void bt_law_put(bt_cell *cell, bt_idx at, const bt_memory *memory);

/// Points of a contact that take part in this step: those that close by the velocities before the contacts, and those
/// that are no more than a slop farther than the nearest one, whatever closes them.
typedef struct bt_closing {
    bool point[2];
    int n;           ///< how many: one at least
    double gap;      ///< the least of all points between the surfaces that are left, at least 0, m
    double approach; ///< the fastest of those that take part, at least 0, m/s
} bt_closing;

/// Those of contact j of the cell, made from the manifold, by its gaps as they are now. Any other point is there or not
/// as the margin of the search has it, and with it the speeds of bodies nearby: what a contact bears must not depend on
/// it.
bt_closing bt_law_closing(const bt_world *world, const bt_cell *cell, bt_idx j, const bt_manifold *manifold);

/// Place of point i along the tangent, from the centroid of a, m.
static inline double bt_law_along(const bt_manifold *manifold, int i)
{
    return manifold->nx * manifold->p[i].ra[1] - manifold->ny * manifold->p[i].ra[0];
}

/// Part of the tangent line that a contact bears on.
typedef struct bt_patch {
    double length, middle; ///< m, m from the centroid of a along the tangent; NaN where they do not overlap
} bt_patch;

/// Where a and b overlap when b has come nearer by `way` along the normal, seen along the tangent; *area: of the
/// overlap, m².
bt_patch bt_law_patch(const bt_world *world, const uint16_t part[2], const bt_manifold *manifold, double way,
                      double *area);

/// Share of a patch that falls to point i of the manifold, of those that take part: uniform pressure on it, as forces
/// at the points. NaN: to each alike.
double bt_law_share(const bt_manifold *manifold, int i, bt_patch patch, const bt_closing *closing);

/// Names of the record that a law has, or would have, of the pair.
static inline bt_memory bt_law_names(const bt_world *world, const bt_pair *pair, int law)
{
    const bt_gid *gid = world->bodies.gid;
    return (bt_memory){.a = gid[pair->a], .b = gid[pair->b], .part = {pair->part[0], pair->part[1]},
                       .law = (uint16_t)law};
}

/// Work of the impulses of the contact in this step, Σ λ·½(w* + w2), J: the change of kinetic energy they cause, less
/// the work of prescribed motion. w* is the velocity without contacts, with the tow line's impulse: of two impulses
/// that act at once the line's comes first, or the pull of the line into the ice would count as work of the ice.
double bt_contacts_work(const bt_world *world, const bt_contact *contact);

/// The part of it of the normal impulse of point i, J.
double bt_contacts_normal_work(const bt_world *world, const bt_contact *contact, int i);

/// The most that the contact can have given in a step whose residual this is, m/s, J: of an exact solution λ·w <= 0,
/// and λᵀ½(w* + w2) = λᵀw2 − ½ λᵀWλ <= Σ |λ| residual.
double bt_contacts_unsolved_work(const bt_contact *contact, double residual);

#endif
