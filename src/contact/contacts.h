// SPDX-License-Identifier: MIT
// Which bodies touch or may touch within the step: pair lists, narrow phase, contact manifolds.
//
// Data flow of one step (detect.c), cell by cell (cells.h):
//   speeds ─> margins ─> pair list of the cell (kept over many steps) ─> narrow phase ─> contacts, in sweep order
//
// The result depends only on this rule: a contact exists for every pair of an active cell whose gap (along the best
// separating axis; for two corners that face each other, their distance) is at most the cell's margin. The pair list
// with its skin, the cached axis and the skipping of far pairs are conservative shortcuts that cannot change it
// (tests/unit/test_contacts.c compares them with brute force over all pairs).
//
// Margin. Twice the distance that the fastest floe of the cell's neighbourhood covers in the step, relative to the
// water, with a fifth more for speed gained in contacts, rounded up to a power of √2; at least the slop, at most 16
// mean floe sizes (space/cells.h).
#ifndef BT_CONTACTS_H
#define BT_CONTACTS_H

#include "bergtow/world.h"
#include "body/bodies.h"
#include "contact/cell_contacts.h"

/// Edges face each other squarely, and normals belong to one face, up to this cosine between them (11.5 degrees).
#define BT_SQUARE 0.98

/// One contact point. Both arms end at the same point in space, between the two surfaces, so that equal and opposite
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
    /// for two edges, the length along the tangent, m, over which the gap exceeds that of the nearest point by at most
    /// cells->beside, whether or not the other end is a contact point; 0 = a corner, or no law bounds contacts
    double flush;
    bt_point p[2];
} bt_manifold;

/// Collective. Set cells->bound to the largest speed in and around each cell at velocities v and v2; with `keep` it is
/// never lowered. Returns the largest of all, m/s.
double bt_contacts_bound(bt_world *world, const bt_vel *v, const bt_vel *v2, bool keep);

/// Collective. Does the bound exceed the speed that the last detection allowed for?
bool bt_contacts_outrun(const bt_world *world);

/// Collective. Find this step's contacts at the present poses in the cells that are active under cells->bound. Impulses
/// are those of the same feature in the previous step, or 0. `again`: only where the margin has grown since the last
/// call.
void bt_contacts_detect(bt_world *world, bool again);

/// Sum of the bits of all impulses of a cell: the same for the same impulses, in any order of the contacts.
uint64_t bt_contacts_load(const bt_cell *cell);

/// Collective. Deepest overlap after a step, m, as the next step would find it before solving, in the cells that have
/// moved, without crushed ice. Poses and velocities stay; contacts, labels, storage and crushed depths of separated
/// pairs do not, so the state must have been saved.
double bt_contacts_overlap(bt_world *world);

/// Manifold of one convex part of each body (bt_pair.part) at the present poses; false when the gap exceeds margin.
/// reference_before (0: edge of a, 1: of b, −1: none) settles ties between nearly equal reference edges. axes: the axes
/// stored for the pair by its last search, updated on return; they do not change the result; or NULL.
bool bt_contacts_parts(const bt_world *world, bt_idx a, bt_idx b, const uint16_t part[2], double margin,
                       int reference_before, bt_manifold *manifold, bt_axes *axes);

/// Is the point of the pair with this feature a corner of an outline? Else polygons of one outline meet there in a
/// straight line or a bay.
bool bt_contacts_at_corner(const bt_world *world, const bt_pair *pair, uint32_t feature);

/// Are these parts no farther apart than the margin, whether or not anything of them can be touched?
bool bt_contacts_near(const bt_world *world, bt_idx a, bt_idx b, const uint16_t part[2], double margin);

/// Among the manifolds man [n], sorted by gids and parts, remove the duplicate points of bodies that are not convex and
/// of shores: points also found by another part of the same pair of bodies, or by another piece of the shore with the
/// same body. A manifold without a point left has n_points = 0.
void bt_merge_parts(const bt_world *world, bt_manifold *man, size_t n);

// --- pairs that pass -------------------------------------------------------------------------------------------------

// Pairs that pass each other within the step, and those that meet.
//
// The bias gap/Δt makes a plane of the nearest feature (pack.c): right for bodies that meet within the step, wrong for
// those that pass beside each other, which it stops as a wall would. Whether a pair meets or passes is known only from
// the velocities. So after a solve every loaded row of a pair that was more than the slop apart is checked against the
// relative motion of the two outlines, rotation included (geometry/polygons.h), at the velocities without the impulse
// of this row and with those of all others. A pair that stays more than the slop apart is released: no impulse, no
// friction, no row in the position projection. The step is solved again from the present impulses. Once nothing is left
// to release, released pairs are checked against the new velocities in the same way; a pair that meets gets its row
// back for the rest of the step. (Before that, a load still to be released may be the only reason why it meets.) This
// is repeated until nothing changes: then every row that bears load stops two bodies that would meet, and no released
// pair meets.
//
// Rows that confirm each other. A body that fits between two others meets neither. But the rows of both slow and turn
// it, so that without one of them it meets the body of the other, and the check above keeps both. So a loaded row must
// also follow from loads that do not depend on it: beginning with the velocities without the impulses of all rows that
// may be released, the impulse of a row is added if its pair meets under those added before, cell by cell in the order
// of a sweep, until a pass adds none. The rows left over are released. A push that runs through a row of floes within
// one step is confirmed link by link, without a solve between.
//
// Why without its own impulse: a corner that is hit as if it stood in the way turns its floe, and this rotation may be
// the only reason why the two touch. Also, a row that rebounds separates the pair by its own impulse.
//
// Rejected: leaving rows out because the pair would pass at its free velocities, before the solve or in the review. A
// push that runs through a row of floes within one step makes pairs meet that otherwise would not; each would take
// another solve (berg.yml at 80 %: 85 sweeps a step instead of 58).

/// Collective. After a solve that converged: release the rows of pairs that pass (if `release`), and restore those of
/// released pairs that meet. Returns the number of rows changed; if not 0, the step has to be solved again.
int64_t bt_passing_review(bt_world *world, bool release);

#endif
