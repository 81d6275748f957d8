// SPDX-License-Identifier: MIT
// Which bodies touch or may touch within the step: pair lists, narrow phase, contact manifolds.
//
// Data flow of one step (detect.c), cell by cell (cells.h):
//   speeds ─> margins ─> pair list of the cell (kept over many steps) ─> narrow phase ─> contacts, in sweep order
//
// What the result depends on is only this: a contact exists for every pair of an active cell whose gap (along the best
// separating axis; of two corners that face each other their distance) is at most the cell's margin. The pair list with
// its skin, the cached axis and the skipping of far pairs are conservative shortcuts that cannot change it
// (tests/unit/test_contacts.c holds them against all pairs by brute force).
//
// Margin. Twice the way that the fastest floe of the cell's neighbourhood makes in the step, through the water's frame,
// with a fifth more for what contacts add to its speed, rounded up to a power of √2; at least the slop, at most 16 mean
// floe sizes (space/cells.h).
#ifndef BT_CONTACTS_H
#define BT_CONTACTS_H

#include "bergtow/world.h"
#include "body/bodies.h"
#include "contact/cell_contacts.h"

/// One contact point. Both arms end in the same point of space, between the two surfaces, so that equal and opposite
/// impulses conserve angular momentum exactly. Two points of a manifold lie on a line along the tangent.
typedef struct bt_point {
    double gap;          ///< m, negative when the bodies overlap
    double ra[2], rb[2]; ///< contact point relative to the centroid of a, of b, m
    uint32_t feature;    ///< which edge and vertex made the point; the same from step to step
} bt_point;

typedef struct bt_manifold {
    bt_idx a, b;      ///< gid[a] < gid[b]
    int n_points;     ///< 1 or 2
    double nx, ny;    ///< unit normal from a to b
    /// of two edges, the length along the tangent that is no more than cells->beside farther apart than the nearest
    /// point, m, whether the other end is a point of the contact or not; 0 = a corner, or no law bounds contacts
    double flush;
    bt_point p[2];
} bt_manifold;

/// Collective. Largest of the speeds at velocities v and v2 in each cell and around it into cells->bound, at least what
/// it was with `keep`; returns the largest of all, m/s.
double bt_contacts_bound(bt_world *world, const bt_vel *v, const bt_vel *v2, bool keep);

/// Collective. Has the bound grown beyond what the last detection was made for?
bool bt_contacts_outrun(const bt_world *world);

/// Collective. Find this step's contacts at the present poses in the cells that are active under cells->bound. Impulses
/// are those of the same feature in the step before, or 0. `again`: only where the margin has grown since the last
/// call.
void bt_contacts_detect(bt_world *world, bool again);

/// Sum of the bits of all impulses of a cell: the same for the same impulses, in any order of the contacts.
uint64_t bt_contacts_load(const bt_cell *cell);

/// Collective. Deepest overlap of the state after a step, m: what the next step would find before it solves anything,
/// in the cells that have moved, crushed ice left out. Poses and velocities stay; contacts, labels, storage and marks
/// of crushing that have come apart do not, so the state must have been saved.
double bt_contacts_overlap(bt_world *world);

/// Manifold of one convex part of each body (bt_pair.part) at the present poses; false when the gap exceeds margin.
/// reference_before (0: edge of a, 1: of b, −1: none) settles ties between nearly equal reference edges. axes: what is
/// known of the pair from its last search, on return from this one, with which the result is the same; or NULL.
bool bt_contacts_parts(const bt_world *world, bt_idx a, bt_idx b, const uint16_t part[2], double margin,
                       int reference_before, bt_manifold *manifold, bt_axes *axes);

/// Of the manifolds man [n], in the order of gids and parts, those of bodies that are not convex and of shores: points
/// that another part of the same pair of bodies, or another piece of a shore with the same body, has as well are taken
/// out. What has no point left has n_points = 0.
void bt_merge_parts(const bt_world *world, bt_manifold *man, size_t n);

// --- pairs that pass -------------------------------------------------------------------------------------------------

// Pairs that pass each other within the step, and those that meet.
//
// The bias gap/Δt makes a plane of the nearest feature (pack.c): right for bodies that meet within the step, wrong for
// those that pass beside each other, which it stops as a wall would. Which of the two a pair does is known when the
// velocities are. So after a solve every row that bears load, of a pair that was more than the slop apart and bore none
// in the step before, is held against the way of the two outlines relative to each other, turning included
// (geometry/polygons.h), at the velocities that they have without the impulse of this row and with those of all others.
// A pair that stays more than the slop apart is released: no impulse, no friction, no row in the position projection.
// Released pairs are held against the new velocities in the same way; one that meets has its row again, for the rest of
// the step. The step is solved anew from the impulses that are there until nothing changes: then every row that bears
// load stops two bodies that would meet, and no released pair meets.
//
// Why without its own impulse: a corner that is hit as if it stood in the way turns its floe, and the turn can bring
// the floe to where it is touched. Also a row that rebounds parts the pair by the velocities that it leaves.
//
// Rejected: to leave rows out before the solve because the pair would pass by its free velocities. A push that runs
// through a row of floes within one step makes pairs meet that would not; each of them would take a solve of its own.

/// Collective. After a solve that converged: release rows (if so), and give released pairs that meet their rows again.
/// Returns how many rows have changed, or with `release` false would have: then the step has to be solved again.
int64_t bt_passing_review(bt_world *world, bool release);

#endif
