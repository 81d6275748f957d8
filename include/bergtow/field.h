// SPDX-License-Identifier: MIT
// The ice field at time zero: floes as polygons with pose and thickness; made from a seed, or read back.
// They are convex, unless a field was read with `ice.nonconvex: split`.
#ifndef BERGTOW_FIELD_H
#define BERGTOW_FIELD_H

#include "bergtow/base.h"
#include "bergtow/case.h"

BT_BEGIN_C

/// Counts of changes to outlines that were read.
typedef struct bt_outline_counts {
    int64_t read;     ///< outlines of a GeoJSON file; 0 for other fields
    int64_t turned;   ///< listed clockwise, and reversed
    int64_t dropped;  ///< vertices left out: duplicate, or in the middle of a straight line
    int64_t rounded;  ///< floes not convex only by rounding, made convex
    int64_t rounded_corners; ///< corners removed by this
    double rounded_area; ///< area added by this, m²
    int64_t hulled;   ///< floes replaced by their convex hull
    double hull_area; ///< area added by this, m²
    int64_t split;    ///< floes in convex parts
    int64_t parts;    ///< their parts
    double lon, lat;  ///< place of x = y = 0 for longitude and latitude, rad; NaN otherwise
    double east, north; ///< coordinates of x = y = 0 in the plane of the file, m; NaN otherwise
    char crs[32];     ///< of the file: "OGC:CRS84" (degrees), "EPSG:32633", "local" (metres); "" without a map
    int64_t unnamed;  ///< features without `thickness` that have a similarly named property
    char nearly[96];  ///< the first few such names
    char chart[96];   ///< the first few names of properties that are columns of an ice chart; "" = none
    int64_t bare;     ///< features without a thickness, whose floes get that of the case
    int64_t outside;  ///< floes whose centroid is outside the ice region
    double outside_area; ///< area of floes outside the ice region, not in the concentration, m²
    /// For a field file: the area to which its concentration refers, and that of the domain less the body, m²; else 0.
    double own_area, region_area;
    /// Where the ice that was read ends, x_min, y_min, x_max, y_max, m; all 0 if unknown. Of outlines the ice region,
    /// but on open sides, where they leave more than BT_ARCH_WATER mean sizes of it free, their bounding box: what lies
    /// beyond a map is not known. Of a field file as the file gives it, which for made ice is its ice region.
    double region[4];
} bt_outline_counts;

/// Where the ice that was read ends, [4] m; NULL if unknown.
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
    double ice_area;       ///< m², area to which concentration refers: ice region less the body's footprint
    double concentration;  ///< Σ area / ice_area as made; for outlines without floes outside the ice region
    double strip;          ///< width of the strip at the cut where floes were scaled (ice.extent), m; 0 = not cut
    int64_t drawn;         ///< floes drawn from the size law, for the whole ice.extent; 0 = unknown
    int64_t unplaced;      ///< of these, those that found no place among larger ones, and are not in the field
    char frame[16];        ///< domain.frame of the case for which a field file was made; "" if unknown
    bt_outline_counts outlines; ///< of a field that was read
    bt_idx cap;            ///< capacity in floes
    int64_t cap_vertices;  ///< capacity in vertices
} bt_field;

/// Make an empty field. Call it before any other function of a field; release with bt_field_free.
void bt_field_init(bt_field *field);
/// Release the contents of a field; the caller owns `field` itself.
void bt_field_free(bt_field *field);

/// Area of all floes, including those outside the ice region, m².
double bt_field_floe_area(const bt_field *field);

/// Append one floe; vertices v [nv][2] m are moved so that their centroid is the origin, and (x, y) m is shifted with
/// them; yaw rad, thickness m. Not checked: nv must be 3 to BT_MAX_VERTICES, the order anticlockwise, and `field`
/// initialised.
void bt_field_add(bt_field *field, int nv, const double *v, double x, double y, double yaw, double thickness);

/// Make the field of a case from its seed: tessellate, shrink to the given concentration, shake to a random state,
/// check. Reproducible from the case alone. `field` must be initialised; its previous contents are released. Errors:
/// BT_ERR_CASE (impossible packing, named), BT_ERR_NUMERIC.
bt_status bt_field_generate(const bt_case *input, bt_field *field, bt_errors *err);

/// Make or read the field of a case (ice.field, ice.outlines). Errors: those of the function it calls.
bt_status bt_field_load(const bt_case *input, bt_field *field, bt_errors *err);

/// Read floes from the case's GeoJSON file ice.outlines, with positions [east, north] in its crs (src/field/geojson.c).
/// Rejected, with the number of the feature from 0: features that are not polygons, or have holes, too few or too many
/// vertices, no area, or crossing edges; that are not convex, unless the case allows it; that lie outside the domain,
/// or overlap another floe or body (both are named). `field` as for bt_field_read. Errors: BT_ERR_IO from the system,
/// BT_ERR_CASE for the contents of the file.
bt_status bt_field_read_outlines(const bt_case *input, bt_field *field, bt_errors *err);

/// Is a property of outlines, not called `thickness`, likely to be one?
bool bt_outline_near_thickness(const char *name);

/// Is a property of outlines a column of an ice chart (SIGRID-3 and the national ice charts), whose polygons are
/// regions of some concentration, water and land, not floes? Letters of either case.
bool bt_outline_chart_column(const char *name);

/// Write outlines at their places as GeoJSON that ice.outlines reads back: in longitude and latitude if the place of x
/// = y = 0 on the earth is known (from outlines read in degrees, or ice.origin_lon and ice.origin_lat), in another crs
/// if outlines were read in it, and otherwise in metres [east, north] from x = y = 0, with a local crs. A complete file
/// or none. Errors: BT_ERR_IO.
bt_status bt_field_write_outlines(const bt_field *field, const bt_case *input, const char *path, bt_errors *err);

/// Write outlines at their places as a list of fixed floes (`floes:`) that a case reads with `base:`. A complete file
/// or none. Errors: BT_ERR_IO.
bt_status bt_field_write_fixed(const bt_field *field, const bt_case *input, const char *path, bt_errors *err);

/// Has bt_field_write_fixed written this file?
bool bt_field_fixed_ours(const char *path);

/// Has bt_field_write_outlines written this file?
bool bt_field_outlines_ours(const char *path);

/// Add warnings about ice that was read: properties with names similar to thickness or of an ice chart, floes outside
/// the ice region, a map that ends within it, errors of a projection, a latitude other than the case's.
void bt_outline_warn(const bt_outline_counts *counts, const bt_case *input, bt_errors *warnings);

/// Sizes of the floes of a field: diameters of circles of their areas.
typedef struct bt_field_sizes {
    bt_idx n;     ///< floes
    double mean;  ///< m; NaN without floes
    double least; ///< m; infinite without floes
    bt_idx below; ///< floes as drawn that are smaller than ice.size_min
    int64_t drawn, unplaced; ///< as in the field
} bt_field_sizes;
/// Sizes of the floes of the case's field. Parts of floes, in a lead, at a cut of ice.extent or beside a body, are not
/// counted in `below`.
bt_field_sizes bt_field_sizes_of(const bt_case *input, const bt_field *field);

/// Add warnings about generated ice: floes without a place, a mean diameter other than that of the size law, floes
/// below its limit.
void bt_field_size_warn(const bt_case *input, const bt_field_sizes *sizes, bt_errors *warnings);

/// Mean equivalent diameter of the floes, m; NaN without floes.
double bt_field_mean_size(const bt_field *field);

/// Thickness of floe i by the law of the case, m.
double bt_field_thickness(const bt_case *input, bt_idx i);

struct bt_comm;
/// Collective. Send the field of rank 0 to all ranks; `field` must be initialised.
void bt_field_share(const struct bt_comm *comm, bt_field *field);

/// Name of the case's domain.frame.
const char *bt_field_frame(const bt_case *input);

/// Write to an HDF5 file: /floes/{vertices,offsets,pose,thickness,area}, attributes on /floes. A complete file or none.
/// Errors: BT_ERR_IO.
bt_status bt_field_write(const bt_field *field, const bt_case *input, const char *path, bt_errors *err);

/// Read such a file; `nonconvex` tells how to treat outlines that are not convex, which are counted. Every value is
/// checked (finite, convex, sizes, offsets), and errors name file and floe; `field` must be initialised, its previous
/// contents are released, and it is empty after an error. Errors: BT_ERR_IO from the system, BT_ERR_CASE for the
/// contents of the file.
bt_status bt_field_read(bt_field *field, const char *path, bt_nonconvex nonconvex, bt_errors *err);

BT_END_C

#endif
