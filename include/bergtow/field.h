// SPDX-License-Identifier: MIT
// The ice field at time zero: floes as polygons with pose and thickness; made from a seed, or read back.
// They are convex, unless a field was read with `ice.nonconvex: split`.
#ifndef BERGTOW_FIELD_H
#define BERGTOW_FIELD_H

#include "bergtow/base.h"
#include "bergtow/case.h"
#include "bergtow/comm.h"

#ifdef __cplusplus
extern "C" {
#endif

/// What became of outlines that were read, instead of silence.
typedef struct bt_outline_counts {
    int64_t read;     ///< outlines of a GeoJSON file; 0 for other fields
    int64_t turned;   ///< listed clockwise, and turned round
    int64_t dropped;  ///< vertices left out: double, or in the middle of a straight line
    int64_t rounded;  ///< floes not convex by rounding alone, which was taken for convex
    int64_t rounded_corners; ///< corners that this left out
    double rounded_area; ///< area that it added, m²
    int64_t hulled;   ///< floes replaced by their convex hull
    double hull_area; ///< area that this added, m²
    int64_t split;    ///< floes in convex parts
    int64_t parts;    ///< their parts
    double lon, lat;  ///< place of x = y = 0 for longitude and latitude, rad; NaN otherwise
    double east, north; ///< coordinates of x = y = 0 in the plane of the file, m; NaN otherwise
    char crs[32];     ///< of the file: "OGC:CRS84" (degrees), "EPSG:32633", "local" (metres); "" for other fields
    int64_t unnamed;  ///< features without a thickness that have a property of nearly this name
    char nearly[96];  ///< such names, the first few
    int64_t bare;     ///< features without a thickness, whose floes have that of the case
    int64_t outside;  ///< floes whose centroid is outside the ice region
    double outside_area; ///< area of floes outside the ice region, which the concentration leaves out, m²
    /// Of a field file: area that its concentration refers to, that of the domain less the body, m²; else 0.
    double own_area, region_area;
    double region[4]; ///< of a field file: its ice region, x_min, y_min, x_max, y_max, m; all 0 where it does not say
} bt_outline_counts;

/// The ice region of a field file that names it, [4]; NULL otherwise.
static inline const double *bt_outline_region(const bt_outline_counts *counts)
{
    return counts->region[0] < counts->region[2] ? counts->region : NULL;
}

typedef struct bt_field {
    bt_idx n;              ///< floes
    int64_t *offsets;      ///< [n+1] first vertex of each floe
    /// [offsets[n]][2] m, body frame: anticlockwise about the centroid; convex unless outlines.split
    double *vertices;
    double *pose;          ///< [n][3] x m, y m, yaw rad
    double *thickness;     ///< [n] m
    double *area;          ///< [n] m²
    double ice_area;       ///< m², the area that concentration refers to: ice region less the body's footprint
    double concentration;  ///< Σ area / ice_area as made; of outlines without what lies outside the ice region
    double strip;          ///< width of the strip at a cut in which floes were scaled (ice.extent), m; 0 = not cut
    char frame[16];        ///< domain.frame of the case that a field file was made for; "" where it does not say
    bt_outline_counts outlines; ///< of a field that was read
    bt_idx cap;            ///< floes the arrays have room for
    int64_t cap_vertices;  ///< vertices they have room for
} bt_field;

/// An empty field. To be called before any other function of a field; release with bt_field_free.
void bt_field_init(bt_field *field);
/// Release what a field holds; `field` itself is the caller's.
void bt_field_free(bt_field *field);

/// Area of all floes, those outside the ice region too, m².
double bt_field_floe_area(const bt_field *field);

/// Append one floe; vertices v [nv][2] m are moved so that their centroid is the origin, and (x, y) m is shifted with
/// them; yaw rad, thickness m. Nothing is checked: nv is 3 to BT_MAX_VERTICES, anticlockwise, and `field` is
/// initialised.
void bt_field_add(bt_field *field, int nv, const double *v, double x, double y, double yaw, double thickness);

/// Make the field of a case from its seed: tessellate, shrink to the asked concentration, shake to a random state,
/// check. Reproducible from the case alone. `field` has been initialised; what it held is released. Errors: BT_ERR_CASE
/// (impossible packing, named), BT_ERR_NUMERIC.
bt_status bt_field_generate(const bt_case *input, bt_field *field, bt_errors *err);

/// The field of a case, made or read as it says (ice.field, ice.outlines). Errors: those of the function it calls.
bt_status bt_field_load(const bt_case *input, bt_field *field, bt_errors *err);

/// Floes of the case's GeoJSON file ice.outlines, positions [east, north] in what its crs says (src/field/geojson.c).
/// Refused with the number of the feature, from 0: what is no polygon, has holes, too few or too many vertices, no
/// area, edges that cross; not convex, unless the case says otherwise; outside the domain; in another floe or body
/// (both are named). `field` as for bt_field_read. Errors: BT_ERR_IO from the system, BT_ERR_CASE for what the file
/// holds.
bt_status bt_field_read_outlines(const bt_case *input, bt_field *field, bt_errors *err);

/// Is a property of outlines likely to be a thickness that is not called `thickness`?
bool bt_outline_near_thickness(const char *name);

/// Outlines where they lie, as GeoJSON that ice.outlines reads back: longitude and latitude where the place of x = y =
/// 0 on the earth is known (of outlines that were read in degrees, or ice.origin_lon and ice.origin_lat), the crs of
/// outlines that were read in another, and otherwise metres [east, north] of x = y = 0, with a crs that says that they
/// are local. A complete file or none. Errors: BT_ERR_IO.
bt_status bt_field_write_outlines(const bt_field *field, const bt_case *input, const char *path, bt_errors *err);

/// Outlines where they lie, as a list of fixed floes (`floes:`) that a case reads with `base:`. A complete file or
/// none. Errors: BT_ERR_IO.
bt_status bt_field_write_fixed(const bt_field *field, const bt_case *input, const char *path, bt_errors *err);

/// Has bt_field_write_fixed written this file?
bool bt_field_fixed_ours(const char *path);

/// Has bt_field_write_outlines written this file?
bool bt_field_outlines_ours(const char *path);

/// Warnings of ice that was read: properties that are nearly called thickness, floes outside the ice region, what a
/// projection leaves uncorrected, a latitude that is not the case's.
void bt_outline_warn(const bt_outline_counts *counts, const bt_case *input, bt_errors *warnings);

/// Sizes of the floes of a field: diameters of circles of their areas.
typedef struct bt_field_sizes {
    bt_idx n;     ///< floes
    double mean;  ///< m; NaN without floes
    double least; ///< m; infinite without floes
    bt_idx below; ///< floes of ice that was made that are smaller than its ice.size_min
} bt_field_sizes;
/// Those of the field of the case. Pieces of a lead (ice.lead) are not counted as below.
bt_field_sizes bt_field_sizes_of(const bt_case *input, const bt_field *field);

/// Warnings of ice that was made: a mean diameter that is not that of the size law, floes below its lower limit.
void bt_field_size_warn(const bt_case *input, const bt_field_sizes *sizes, bt_errors *warnings);

/// Mean diameter of the circles of the floes' areas, m; NaN without floes.
double bt_field_mean_size(const bt_field *field);

/// Thickness of floe i by the law of the case, m.
double bt_field_thickness(const bt_case *input, bt_idx i);

/// Collective. The field of rank 0 to all ranks; `field` has been initialised.
void bt_field_share(const bt_comm *comm, bt_field *field);

/// Name of the case's domain.frame.
const char *bt_field_frame(const bt_case *input);

/// Write to an HDF5 file: /floes/{vertices,offsets,pose,thickness,area}, attributes on /floes. A complete file or none.
/// Errors: BT_ERR_IO.
bt_status bt_field_write(const bt_field *field, const bt_case *input, const char *path, bt_errors *err);

/// Read such a file, with outlines that are not convex as `nonconvex` says, and counted. Every value is checked
/// (finite, convex, sizes, offsets), and errors name file and floe; `field` has been initialised, what it held is
/// released, and it is empty after an error. Errors: BT_ERR_IO from the system, BT_ERR_CASE for what the file holds.
bt_status bt_field_read(bt_field *field, const char *path, bt_nonconvex nonconvex, bt_errors *err);

#ifdef __cplusplus
}
#endif

#endif
