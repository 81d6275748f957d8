// SPDX-License-Identifier: MIT
// Shared by the parts of the field generator: the placement region, sizes, cells, clearance.
#ifndef BT_FIELD_MAKE_H
#define BT_FIELD_MAKE_H

#include "bergtow/field.h"
#include "bergtow/shape.h"
#include "case/size_law.h"
#include "geometry/polygons.h"

/// A body that lies in the ice: convex, in domain coordinates.
typedef struct bt_obstacle {
    int n;
    double v[2 * BT_MAX_VERTICES]; ///< m
    double x, y, radius;           ///< bounding circle, m
} bt_obstacle;

/// The ice region and what lies in it.
typedef struct bt_region {
    double x0, x1, y0, y1;         ///< ice region, m
    bool periodic_x, periodic_y;   ///< the region spans the domain in a periodic direction
    double clearance;              ///< water kept between generated floes and obstacles, m
    int n_obstacles;               ///< towed body and floes given by hand, with their periodic images
    bt_obstacle *obstacles;
    double ice_area;               ///< region less the obstacles, m²
} bt_region;

/// Region, obstacles and ice area of a case. clearance: m. Errors: BT_ERR_CASE.
bt_status bt_region_init(bt_region *region, const bt_case *input, double clearance, bt_errors *err);
/// The whole domain as a region, for ice that exists already: no room for more is not an error.
void bt_region_of_domain(bt_region *region, const bt_case *input);
void bt_region_free(bt_region *region);
/// Area within the region of a polygon and of its images across edges where the domain of the case wraps, m².
double bt_region_area_of(const bt_region *region, const bt_case *input, int n, const double *v);
/// Distance of a floe v [n][2], about its centroid, from an obstacle at (dx, dy) from there.
bt_apart bt_region_apart(const bt_obstacle *obstacle, int n, const double *v, double dx, double dy);
/// Bring a point into the region along its periodic directions.
void bt_region_wrap(const bt_region *region, double *px, double *py);

double bt_sizes_draw(const bt_sizes *sizes, int64_t seed, int64_t id); ///< diameter of floe id, m

#define BT_TESSELLATION_VERTICES 12 ///< most vertices of a generated floe

/// Convex cells, each holding one floe; nv = 0: no floe.
typedef struct bt_tessellation {
    bt_idx n;
    int *nv;         ///< [n]
    double (*v)[2 * BT_TESSELLATION_VERTICES]; ///< [n] domain coordinates, m
    double *target;  ///< [n] area asked for, m²
} bt_tessellation;

void bt_tessellation_free(bt_tessellation *cells);
/// Cells of a power diagram whose areas approach target[n] × a common factor. The cells own a copy of target.
bt_tessellation bt_tessellation_tessellate(const bt_region *region, bt_idx n, const double *target, int64_t seed);
/// Rectangles sawn from strips along x with areas target[n] × a common factor. effort to fill the water beside
/// obstacles: 0 keeps rectangles, 1 cuts them along the obstacle, 2 makes small pieces too.
bt_tessellation bt_tessellation_saw(const bt_region *region, bt_idx n, const double *target, double aspect,
                                    int64_t seed, int effort);
/// Cut obstacles out of a cell, each along its edge that leaves most of the cell; returns the new vertex count. v: room
/// for max(n, 4 BT_TESSELLATION_VERTICES + 1) vertices. boxed: use bounding boxes (rectangles stay rectangles).
int bt_tessellation_clear(const bt_region *region, int n, double *v, bool boxed);
/// Drop vertices, inwards, until no edge is below `shortest`, m, and at most `most` are left; returns the new count.
int bt_tessellation_clean(int n, double *v, double shortest, int most);

/// Outlines of all floes turned by their yaw, relative to the centroid; [offsets[n]][2]. Caller frees.
double *bt_field_outlines(const bt_field *field);

/// Calls visit for each pair of floes i, j whose bounding boxes, scaled by `limit` about the centroids, meet; (dx, dy)
/// points from i to (an image of) j. A pair across a periodic edge comes twice. Independent of the contact code's pair
/// search.
typedef void bt_pair_visit(void *context, bt_idx i, bt_idx j, double dx, double dy);
void bt_field_visit_pairs(const bt_region *region, const bt_field *field, const double *outline, double limit,
                          bt_pair_visit *visit, void *context);

/// clearance[i] <= limit: every floe i may be scaled about its centroid by any factor up to clearance[i], all at the
/// same time, without touching another floe, an obstacle or an edge of the region. clearance[i] < 1: floe i overlaps
/// something.
void bt_field_growth(const bt_region *region, const bt_field *field, double limit, double *clearance);

enum { BT_FIELD_ARRAYS = 5 };
typedef struct bt_field_array { void *at; size_t bytes; } bt_field_array;
/// The arrays of a field with this number of vertices.
void bt_field_arrays(const bt_field *field, int64_t n_vertices, bt_field_array out[BT_FIELD_ARRAYS]);
/// The numbers of a field, with NULL for its arrays; cap_vertices is the number of its vertices.
bt_field bt_field_numbers(const bt_field *field);
/// Replace a field by one of these numbers, with room for its arrays.
void bt_field_room(bt_field *field, const bt_field *numbers);

/// Scale floe i about its centroid.
void bt_field_scale(bt_field *field, bt_idx i, double s);
/// Area with every floe but those held scaled by min(clearance, √λ), m². held: NULL = none.
double bt_field_area_at(const bt_field *field, const double *clearance, const bool *held, double lambda);
/// Scale floes in this way by the λ for which Σ area = wanted; returns the area reached.
double bt_field_fit(bt_field *field, const double *clearance, const bool *held, double wanted);
/// A field without floes, with the other numbers of this one.
bt_field bt_field_like(const bt_field *field);
/// Append floe i of another field as it is, to the bit.
void bt_field_append(bt_field *field, const bt_field *from, bt_idx i);
/// Cut the field of region `whole` to the region of the case, at the case's concentration; size: mean diameter, m.
bt_status bt_field_cut(const bt_case *input, const bt_region *whole, const bt_region *region, double size,
                       bt_field *field, bt_errors *err);
/// Sort floes along a Morton curve.
void bt_field_sort(bt_field *f, const bt_region *region);

/// Move floes about by free flight and elastic collisions over `length` metres of mean path, in steps of `stride` m.
bt_status bt_field_shake(const bt_case *input, const bt_region *region, bt_field *field, double length, double stride,
                         int64_t stage, bt_errors *err);

#endif
