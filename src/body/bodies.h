// SPDX-License-Identifier: MIT
// The arrays of bodies (bergtow/body.h): storage, outlines, kinematics. Independent of cells, contacts and ranks.
#ifndef BERGTOW_BODIES_H
#define BERGTOW_BODIES_H

#include <math.h>

#include "bergtow/world.h"

/// Arrays over the bodies, one row per array, for sorting, migration and storage of bodies.
typedef struct bt_body_field {
    size_t array; ///< offset of the pointer in bt_bodies
    size_t size;  ///< bytes per body
} bt_body_field;
extern const bt_body_field bt_body_fields[];
/// Number of these arrays; the last, the homes, counts only if these bodies have homes.
int bt_bodies_n_fields(const bt_bodies *bodies);

/// Arrays over the vertices of the bodies; size: bytes per vertex.
extern const bt_body_field bt_vertex_fields[];
extern const int bt_n_vertex_fields;

/// The exposure of a body with its whole drag.
extern const bt_exposure bt_exposed;

/// Make room for n bodies and n_vertices vertices.
void bt_bodies_reserve(bt_bodies *bodies, bt_idx n, int64_t n_vertices);
void bt_bodies_free(bt_bodies *bodies);

/// Allocate the homes of all bodies, set to 0, before bodies are distributed to ranks.
void bt_bodies_make_homes(bt_bodies *bodies);

/// Add a body (bt_world_add); returns its gid. Before bodies are distributed to ranks.
bt_gid bt_bodies_add(bt_bodies *bodies, const bt_body_def *def);
/// Reserve the next n ids for bodies added later by bt_bodies_put.
void bt_bodies_skip(bt_bodies *bodies, bt_gid n);
/// Append a body with an id that no body here has; returns its index.
bt_idx bt_bodies_put(bt_bodies *bodies, const bt_body_def *def, bt_gid gid);
/// Remove the bodies whose keep[n] is 0, and close the gaps: the others stay in order. index_of is not updated.
void bt_bodies_compact(bt_bodies *bodies, const uint8_t *keep);

/// Rotate the outline of body i by its yaw (after a change of pose).
void bt_bodies_turn(bt_bodies *bodies, bt_idx i);

/// Speed of the fastest point of body i at velocity v relative to the water, m/s.
static inline double bt_bodies_speed(const bt_world *world, bt_idx i, const bt_vel *v)
{
    const double x = v->x - world->par.water_u, y = v->y - world->par.water_v;
    return sqrt(x * x + y * y) + world->bodies.radius[i] * fabs(v->w);
}

/// Is v exactly the velocity of the water, without rotation?
static inline bool bt_bodies_drift(const bt_world *world, const bt_vel *v)
{
    return v->x == world->par.water_u && v->y == world->par.water_v && v->w == 0;
}

/// Depth by which body i overlaps a set of polygons, m; <= 0: no overlap. The polygons have n vertices with marks,
/// stored as in bt_bodies: an outline, followed by its parts, relative to a centroid from which that of i is at (dx,
/// dy), m.
double bt_bodies_depth(const bt_bodies *bodies, bt_idx i, const bt_mark *mark, const double *vertex, int64_t n,
                       double dx, double dy);

/// Is body i a sheet that may slide over others (contact/raft.h)?
static inline bool bt_bodies_sheet(const bt_bodies *bodies, bt_idx i, bt_gid towed)
{
    return bodies->thickness[i] > 0 && bodies->motion[i] != BT_STATIC && bodies->gid[i] != towed &&
           bt_part_first(bodies, i) == 0;
}

/// May i and j slide over each other? deck: freeboard / thickness.
static inline bool bt_bodies_slide(const bt_bodies *a, bt_idx i, const bt_bodies *b, bt_idx j, bt_gid towed,
                                   double deck)
{
    const double h = a->thickness[i], g = b->thickness[j];
    return bt_bodies_sheet(a, i, towed) && bt_bodies_sheet(b, j, towed) && deck * bt_max(h, g) <= bt_min(h, g);
}

/// Coefficients of the pair (i, j), gid[i] < gid[j]: those of j (bergtow/body.h).
static inline double bt_pair_friction(const bt_bodies *bodies, bt_idx i, bt_idx j)
{
    (void)i;
    return bodies->friction[j];
}
static inline double bt_pair_restitution(const bt_bodies *bodies, bt_idx i, bt_idx j)
{
    (void)i;
    return bodies->restitution[j];
}

/// x wrapped into the period that starts at `low`; *laps grows by the periods taken off. period 0: not periodic.
static inline double bt_into_period(double x, double low, double period, int32_t *laps)
{
    if (!(period > 0) || (x >= low && x < low + period)) return x;
    const double turns = floor((x - low) / period);
    if (!(fabs(turns) < 1e9)) return x; // NaN or absurd: guards end such a run
    x -= turns * period;
    *laps += (int32_t)turns;
    if (x >= low + period) x -= period, ++*laps; // rounding
    return x;
}

/// Nearest image of a distance d, for |d| up to 1.5 periods.
static inline double bt_nearest_image(double d, double period)
{
    if (period > 0) {
        if (d > 0.5 * period) d -= period;
        else if (d < -0.5 * period) d += period;
    }
    return d;
}

/// Vector from the centroid of a to that of b, the nearest image in periodic directions.
static inline void bt_bodies_offset(const bt_world *world, bt_idx a, bt_idx b, double d[2])
{
    const bt_pose *pa = &world->bodies.pose[a], *pb = &world->bodies.pose[b];
    d[0] = bt_nearest_image(pb->x - pa->x, world->par.period_x);
    d[1] = bt_nearest_image(pb->y - pa->y, world->par.period_y);
}

#endif
