// SPDX-License-Identifier: MIT
// Which bodies touch or may touch within the step: pair list, narrow phase, contact manifolds.
//
// Data flow of one step (detect.c):
//   outlines turned ─> pair list (kept over many steps) ─> narrow phase ─> manifolds, sorted by (gid a, gid b)
//
// What the result depends on is only this: a manifold exists for every pair whose gap along the best separating
// axis is at most `margin`, and manifolds stand in the order of (gid a, gid b). The grid, the skin of the
// pair list, the cached axis and the skipping of far pairs are conservative shortcuts that cannot change it
// (tests/unit/test_contacts.c holds them against all pairs by brute force).
#ifndef BERGTOW_CONTACTS_H
#define BERGTOW_CONTACTS_H

#include "bergtow/world.h"

/// One contact point. Both arms end in the same point of space, between the two surfaces, so that equal and opposite
/// impulses conserve angular momentum exactly. Two points of a manifold lie on a line along the tangent.
typedef struct bt_point {
    double gap;          ///< m, negative when the bodies overlap
    double ra[2], rb[2]; ///< contact point relative to the centroid of a, of b, m
    double ln, lt;       ///< impulse on b along the normal, and along the tangent (−n_y, n_x), N s
    uint32_t feature;    ///< which edge and vertex made the point; the same from step to step
} bt_point;

typedef struct bt_manifold {
    bt_idx a, b;      ///< gid[a] < gid[b]
    int n_points;     ///< 1 or 2
    double nx, ny;    ///< unit normal from a to b
    bt_point p[2];
} bt_manifold;

/// A pair near enough to be looked at.
typedef struct bt_pair {
    bt_idx a, b;     ///< gid[a] < gid[b]
    int32_t man;     ///< its manifold in the last step, −1 = none
    int32_t axis;    ///< edge that separated them last: of a when < n_a, else of b
    double reach;    ///< gap at the last look + path lengths of a and b then: no contact while paths + margin < reach
} bt_pair;

typedef struct bt_contacts {
    bt_pair *pairs;           ///< [n_pairs] sorted by (gid a, gid b)
    bt_idx n_pairs, cap_pairs;
    bt_manifold *man;         ///< [n_man] of this step, in the order of the pairs
    bt_manifold *man_before;  ///< [n_man_before] of the step before (impulses for the warm start)
    bt_idx n_man, n_man_before, cap_man, cap_man_before;
    int64_t n_points;
    double margin;            ///< m, this step's
    double overlap;           ///< deepest overlap found, m
    // pair list
    double skin;              ///< m, clearance of floe pairs in the list
    double skin_large;        ///< m, extra clearance of pairs with a large body
    double margin_built;      ///< margin the list was built for
    double *path_built;       ///< [n] path of each body when the list was built
    bool built;
    int64_t n_builds;
    // scratch of the build
    bt_pair *pairs_before;
    bt_idx cap_pairs_before;
    bt_idx *cell_start, *cell_item, *cell_of, *large_head, *large_next, *large_item;
    double *box;              ///< [n][4] x low, y low, x high, y high relative to the centroid
    int64_t cap_cells;
    bt_idx cap_large, cap_bodies;
} bt_contacts;

bt_contacts *bt_contacts_create(void);
void bt_contacts_free(bt_contacts *c);

/// Find this step's manifolds at the present poses. Impulses of the points are those of the same feature in the step
/// before, or 0. margin: m, pairs with a smaller gap get a manifold.
void bt_contacts_detect(bt_world *w, double margin);

/// Margin that no pair closes within the step if no body gets faster than the fastest of v[n bodies]: 2 Δt max(|U| + r|ω|),
/// rounded up to a power of √2 so that pair data stay valid while speeds wander. At least the slop. m
double bt_contacts_margin(const bt_world *w, const bt_vel *v);

/// Manifold of one pair at the present poses; false when the gap exceeds margin. `before` (or NULL) settles ties
/// between nearly equal reference edges. gap_out: the largest separation over the edge normals of both (a lower
/// bound of the distance), axis_out its edge (numbered as in bt_pair).
bool bt_contacts_pair(const bt_world *w, bt_idx a, bt_idx b, double margin, const bt_manifold *before,
                      bt_manifold *m, double *gap_out, int32_t *axis_out);

/// All manifolds by testing all pairs, for tests; the same output as bt_contacts_detect without impulses.
void bt_contacts_brute_force(const bt_world *w, double margin, bt_manifold **man, bt_idx *n_man);

/// Outline of body i turned by its yaw (after a change of pose).
void bt_world_turn_outline(bt_world *w, bt_idx i);

/// Vector from the centroid of a to that of b, the nearest image in periodic directions.
static inline void bt_world_offset(const bt_world *w, bt_idx a, bt_idx b, double d[2]);

static inline double bt_nearest_image(double d, double period)
{
    if (period > 0) {
        if (d > 0.5 * period) d -= period;
        else if (d < -0.5 * period) d += period;
    }
    return d;
}

static inline void bt_world_offset(const bt_world *w, bt_idx a, bt_idx b, double d[2])
{
    const bt_pose *pa = &w->bodies.pose[a], *pb = &w->bodies.pose[b];
    d[0] = bt_nearest_image(pb->x - pa->x, w->par.period_x);
    d[1] = bt_nearest_image(pb->y - pa->y, w->par.period_y);
}

#endif
