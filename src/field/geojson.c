// SPDX-License-Identifier: MIT
// Floe outlines in GeoJSON (RFC 7946): a FeatureCollection of Polygons, as image analysis and GIS programs write it.
//
//     {"type": "FeatureCollection", "features": [
//       {"type": "Feature", "id": 7, "properties": {"thickness": 1.2},
//        "geometry": {"type": "Polygon", "coordinates": [[[east, north], [east, north], ..., [east, north]]]}}, ...]}
//
// Positions are [longitude, latitude] in degrees, unless a member `crs` of the older form [GeoJSON 2008] says that they
// are metres [east, north] of a projection (map_crs.h), or the case says so for a file without one (ice.outlines_crs).
// Degrees are projected about an origin (bergtow/outline.h); metres only have an origin subtracted. Then the frame of
// the case lies on the map as
//     basin:       x = east,  y = north      right-handed seen from above
//     geographic:  x = north, y = east       left-handed seen from above
//
// so in both frames a floe lies on the ground as on the map, never mirrored. A basin has no north; its x, along the
// basin, is drawn to the right. Rings that are anticlockwise on the map, as RFC 7946 requires, are clockwise in the
// geographic frame; rings are reversed as needed. A MultiPolygon of one polygon counts as a Polygon. A height (third
// coordinate) is ignored. With ice.outlines_crs: frame, files of earlier versions of this program are read: metres [x,
// y] of the frame.
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/outline.h"
#include "base/inside.h"
#include "field/field_admit.h"
#include "field/field_make.h"
#include "base/elementary.h"
#include "base/fileio.h"
#include "case/arch.h"
#include "case/case_derived.h"
#include "case/ice_bounds.h"
#include "base/largest.h"
#include "field/map_crs.h"
#include "field/map_features.h"
#include "base/name.h"

static const double DEGREE = BT_PI / 180;

/// Kind of the coordinates of a file.
typedef enum { DEGREES, PLANE, FRAME } coordinates;

/// Range of all coordinates of a file, as written there.
typedef struct survey {
    double low[2], high[2];
    size_t feature; ///< first with a vertex that is not a place in degrees; SIZE_MAX: none
    double odd[2];  ///< its vertex
} survey;

/// A feature as read from the file.
typedef struct map_feature {
    int64_t vertex;     ///< first vertex in `ring`
    const char *why;    ///< why it is not an outline, or NULL
    json_t *id;         ///< or NULL; likewise thickness
    json_t *thickness;
    bool fixed;         ///< its property `fixed` is true
} map_feature;

typedef struct reader {
    const bt_case *c;
    bt_refusals r;
    bt_field *f;
    map_feature *feature; ///< [n_features + 1], the last one only marks the end of the coordinates
    size_t n_features, cap_features;
    double *ring;         ///< [vertices][2] coordinates
    int64_t cap_vertices;
    coordinates kind;
    bool assumed;      ///< degrees because nothing says otherwise
    bt_map_crs crs;
    double lon0, lat0;   ///< rad
    double east0, north0; ///< m
} reader;

/// "feature 3" or "feature 3 (id 17)".
static const char *name_of(const reader *in, size_t index, char out[96])
{
    const json_t *id = in->feature[index].id;
    if (json_is_string(id)) snprintf(out, 96, "feature %zu (id %.60s)", index, json_string_value(id));
    else if (json_is_integer(id))
        snprintf(out, 96, "feature %zu (id %" JSON_INTEGER_FORMAT ")", index, json_integer_value(id));
    else snprintf(out, 96, "feature %zu", index);
    return out;
}

/// The outer ring of a feature, or NULL and why not.
static const json_t *ring_of(const json_t *feature, const char **why)
{
    const json_t *geometry = json_object_get(feature, "geometry"), *polygon = json_object_get(geometry, "coordinates");
    const char *type = json_string_value(json_object_get(geometry, "type"));
    if (type && !strcmp(type, "MultiPolygon")) {
        if (json_array_size(polygon) != 1) {
            *why = "it has several polygons (MultiPolygon); make each a feature of its own, as `bergtow outlines` does";
            return NULL;
        }
        polygon = json_array_get(polygon, 0);
    } else if (!type || strcmp(type, "Polygon")) {
        *why = "its geometry is not a Polygon; remove it";
        return NULL;
    }
    if (json_array_size(polygon) > 1) {
        *why = "it has holes, but a floe has none here; remove all rings except the first, as `bergtow outlines` does";
        return NULL;
    }
    const json_t *ring = json_array_get(polygon, 0);
    if (!json_is_array(ring))
        *why = "its coordinates are not a list of rings; write [[[east, north], [east, north], ...]]";
    else if (json_array_size(ring) > BT_MAX_RING)
        *why = "it has more than 10000 vertices; `bergtow outlines` simplifies it";
    else return ring;
    return NULL;
}

/// Coordinates of a feature as in the file, without the closing one; returns their number, or 0 and why not.
static int coordinates_of(const json_t *feature, double *v, const char **why)
{
    const json_t *ring = ring_of(feature, why);
    if (!ring) return 0;
    if (json_object_get(feature, "crs") || json_object_get(json_object_get(feature, "geometry"), "crs")) {
        *why = "it has a crs of its own; give one to the whole FeatureCollection";
        return 0;
    }
    size_t n = json_array_size(ring);
    for (size_t k = 0; k < n; k++) {
        const json_t *p = json_array_get(ring, k), *x = json_array_get(p, 0), *y = json_array_get(p, 1);
        if (!json_is_number(x) || !json_is_number(y)) {
            *why = "a vertex is not a pair of numbers; write [east, north]";
            return 0;
        }
        v[2 * k] = json_number_value(x);
        v[2 * k + 1] = json_number_value(y);
    }
    if (n > 1 && v[0] == v[2 * n - 2] && v[1] == v[2 * n - 1]) n--;
    if (n < 3) *why = "it has fewer than 3 vertices";
    return n < 3 ? 0 : (int)n;
}

/// Add a vertex of feature i to the survey.
static void see(survey *seen, size_t i, const double v[2], bool narrow)
{
    for (int a = 0; a < 2; a++) seen->low[a] = bt_min(seen->low[a], v[a]), seen->high[a] = bt_max(seen->high[a], v[a]);
    if (seen->feature == SIZE_MAX && !bt_outline_in_degrees(v[0], v[1], narrow))
        seen->feature = i, seen->odd[0] = v[0], seen->odd[1] = v[1];
}

/// Box of all coordinates; narrow: as in bt_outline_in_degrees.
static survey look_over(const reader *in, bool narrow)
{
    survey seen = {.low = {INFINITY, INFINITY}, .high = {-INFINITY, -INFINITY}, .feature = SIZE_MAX};
    for (size_t i = 0; i < in->n_features; i++)
        for (int64_t k = in->feature[i].vertex; k < in->feature[i + 1].vertex; k++)
            see(&seen, i, in->ring + 2 * k, narrow);
    return seen;
}

/// Take the origin from the mark that this program leaves in its files, if there is one.
static void take_origin(const json_t *mark, double origin[2])
{
    const json_t *list = json_object_get(mark, "origin"), *x = json_array_get(list, 0), *y = json_array_get(list, 1);
    if (!json_is_number(x) || !json_is_number(y) || !(fabs(json_number_value(x)) <= 1e8) ||
        !(fabs(json_number_value(y)) <= 1e8))
        return;
    origin[0] = json_number_value(x);
    origin[1] = json_number_value(y);
}

/// Refuse degrees out of range and latitude before longitude; set the place of x = y = 0: that of the case, else of the
/// file's mark, else the middle of all coordinates.
static void begin_degrees(reader *in, const json_t *mark)
{
    const bt_case *input = in->c;
    const survey seen = look_over(in, in->assumed);
    const bool given = !isnan(input->ice.origin_lon),
               swapped = bt_outline_in_degrees(bt_max(fabs(seen.low[1]), fabs(seen.high[1])),
                                           bt_max(fabs(seen.low[0]), fabs(seen.high[0])), false);
    if (!isnan(input->ice.origin_east))
        bt_refuse(&in->r, "its coordinates are degrees, but ice.origin_east and ice.origin_north are metres; give "
                          "ice.origin_lon and ice.origin_lat, or none");
    if (seen.feature != SIZE_MAX) {
        bt_refuse(
            &in->r,
            "feature %zu has a vertex [%g, %g], which is not longitude and latitude in degrees, in this order: %s",
            seen.feature, seen.odd[0], seen.odd[1],
            swapped      ? "latitude seems to come first; swap the two numbers of every position"
            : in->assumed ? "without a crs coordinates are degrees within 180 and 90 (RFC 7946); for metres east and "
                            "north give the file its crs, or set ice.outlines_crs: plane; "
                            "for longitudes from 0 to 360 set ice.outlines_crs: lonlat"
                          : "correct it, or say what its coordinates are");
        return;
    }
    double middle[2];
    bt_outline_middle(in->feature[in->n_features].vertex, in->ring, middle);
    if (!given && middle[1] > BT_MAP_FREE_SOUTH && middle[1] < BT_MAP_FREE_NORTH && fabs(middle[0]) >= 30 && swapped) {
        bt_refuse(&in->r,
                  "its outlines lie about latitude %.4g, longitude %.4g, where there is no sea ice: latitude seems to "
                  "come first; write [longitude, latitude], or give ice.origin_lon and ice.origin_lat if the place is "
                  "right",
                  middle[1], middle[0]);
        return;
    }
    take_origin(mark, middle);
    in->lon0 = given ? input->ice.origin_lon : middle[0] * DEGREE;
    in->lat0 = given ? input->ice.origin_lat : bt_min(90, bt_max(-90, middle[1])) * DEGREE; // a mark may say anything
}

/// Set the place of x = y = 0 in a plane: that of the case, else of the file's mark, else the middle of the coordinates
/// if the crs is a projection, whose zero is far away, else zero.
static void begin_plane(reader *in, const json_t *mark)
{
    const bt_case *input = in->c;
    const survey seen = look_over(in, true);
    const bool given = !isnan(input->ice.origin_east), projected = in->crs.kind == BT_MAP_PLANE;
    if (!isnan(input->ice.origin_lon) && in->kind == PLANE)
        bt_refuse(&in->r, "its coordinates are metres, but ice.origin_lon and ice.origin_lat are degrees; give "
                          "ice.origin_east and ice.origin_north, or none");
    if (given && in->kind == FRAME)
        bt_refuse(&in->r, "its coordinates are metres of the case's frame, whose origin they have; remove "
                          "ice.origin_east and ice.origin_north");
    const bool any = seen.low[0] <= seen.high[0];
    if (projected && any && seen.feature == SIZE_MAX)
        bt_refuse(&in->r,
                  "its crs is %s, in metres, and all its coordinates lie within 180 and 90, as degrees do; correct the "
                  "crs of the file",
                  in->crs.name);
    if (in->r.status != BT_OK) return;
    double origin[2] = {0, 0};
    if (projected && any) origin[0] = (seen.low[0] + seen.high[0]) / 2, origin[1] = (seen.low[1] + seen.high[1]) / 2;
    take_origin(mark, origin);
    in->east0 = given ? input->ice.origin_east : origin[0];
    in->north0 = given ? input->ice.origin_north : origin[1];
    if (in->kind == FRAME || !any) return;
    const bool basin = input->domain.frame == BT_FRAME_BASIN; // the domain on the map
    const double east = basin ? input->domain.x0 : input->domain.y0,
                 north = basin ? input->domain.y0 : input->domain.x0;
    const double far_east = east + (basin ? input->domain.length : input->domain.width),
                 far_north = north + (basin ? input->domain.width : input->domain.length);
    if (seen.low[0] - in->east0 > far_east || seen.high[0] - in->east0 < east || seen.low[1] - in->north0 > far_north ||
        seen.high[1] - in->north0 < north)
        bt_refuse(&in->r,
                  "all outlines, east %.10g to %.10g m, north %.10g to %.10g m, lie outside the domain, which is east "
                  "%.10g to %.10g m, north %.10g to %.10g m on the map; say "
                  "where x = y = 0 is with ice.origin_east and ice.origin_north",
                  seen.low[0], seen.high[0], seen.low[1], seen.high[1], east + in->east0, far_east + in->east0,
                  north + in->north0, far_north + in->north0);
}

/// Convert a vertex on the map to the case's frame.
static void to_frame(const bt_case *input, double east, double north, double v[2])
{
    const bool basin = input->domain.frame == BT_FRAME_BASIN;
    v[0] = basin ? east : north;
    v[1] = basin ? north : east;
}

/// Convert vertices to metres in the case's frame, in place; returns why not, or NULL.
static const char *place(const reader *in, int n, double *v)
{
    for (int i = 0; i < n && in->kind == PLANE; i++)
        to_frame(in->c, v[2 * i] - in->east0, v[2 * i + 1] - in->north0, v + 2 * i);
    for (int i = 0; i < n && in->kind == DEGREES; i++) {
        double north, east, swapped_north, swapped_east;
        bt_outline_project(v[2 * i] * DEGREE, v[2 * i + 1] * DEGREE, in->lon0, in->lat0, &north, &east);
        bt_outline_project(v[2 * i + 1] * DEGREE, v[2 * i] * DEGREE, in->lon0, in->lat0, &swapped_north, &swapped_east);
        if (!(bt_hypot(north, east) <= BT_MAP_FARTHEST)) {
            if (fabs(v[2 * i]) <= 90 && bt_hypot(swapped_north, swapped_east) <= BT_MAP_FARTHEST)
                return "it is more than 100 km from the origin, and near it with latitude and longitude swapped; write "
                       "[longitude, latitude]";
            return in->assumed ? "it is more than 100 km from the origin, where the projection of a small area no "
                                 "longer holds; set ice.origin_lon and ice.origin_lat, or remove it; if its "
                                 "coordinates are metres, east and north, give the file its crs or set "
                                 "ice.outlines_crs: plane"
                               : "it is more than 100 km from the origin, where the projection of a small area no "
                                 "longer holds; set ice.origin_lon and ice.origin_lat, or remove it";
        }
        to_frame(in->c, east, north, v + 2 * i);
    }
    return NULL;
}

static void turn_round(int n, double *v)
{
    for (int i = 0, j = n - 1; i < j; i++, j--)
        for (int a = 0; a < 2; a++) {
            const double x = v[2 * i + a];
            v[2 * i + a] = v[2 * j + a];
            v[2 * j + a] = x;
        }
}

/// Is the name, in small letters, one of the words? lower: the name so, cut short beyond 63 letters.
static bool is_one_of(const char *name, const char *const *words, char lower[64])
{
    size_t n = 0;
    for (; name[n] && n < 63; n++)
        lower[n] = (char)(name[n] >= 'A' && name[n] <= 'Z' ? name[n] + 'a' - 'A' : name[n]);
    lower[n] = 0;
    for (; *words; words++)
        if (!strcmp(lower, *words)) return true;
    return false;
}

bool bt_outline_near_thickness(const char *name)
{
    static const char *const words[] = {"height", "h", "ice_height", "draft", "dicke", "tykkelse", "sit", NULL};
    char lower[64];
    return is_one_of(name, words, lower) || strstr(lower, "thick") || bt_suggest_distance(lower, "thickness", 4) <= 3;
}

bool bt_outline_chart_column(const char *name)
{
    // kind of region, total concentration, stage and form of the ice, egg code; without `sa` and `fa`, stage and form,
    // which are also short for surface and floe area, and stand beside `ct`
    static const char *const words[] = {"poly_type", "pgon_type", "ct",      "e_ct",      "n_ct", "e_sa",
                                        "e_fa",      "icecode",   "nis_class", "a_legend", NULL};
    char lower[64];
    return is_one_of(name, words, lower);
}

/// Add a name of a property to a list "`a`, `b`", once, and no more than fit.
static void keep_name(char list[96], const char *name)
{
    char entry[48];
    snprintf(entry, sizeof entry, "`%.40s`", name);
    for (char *c = entry; *c; c++)
        if ((unsigned char)*c < 0x20 || (unsigned char)*c >= 0x7F) *c = '?';
    if (strstr(list, entry) || strlen(list) + strlen(entry) + 3 > 96) return;
    if (*list) strcat(list, ", ");
    strcat(list, entry);
}

/// Keep the first names of properties that are columns of an ice chart.
static void look_for_chart(reader *in, const json_t *properties)
{
    const char *name;
    json_t *value;
    json_object_foreach((json_t *)properties, name, value)
        if (bt_outline_chart_column(name)) keep_name(in->f->outlines.chart, name);
}

/// Count a feature without `thickness` that has a property with a similar name; keep the first such names.
static void look_for_thickness(reader *in, const json_t *properties)
{
    bt_outline_counts *counts = &in->f->outlines;
    const char *name;
    json_t *value;
    bool any = false;
    json_object_foreach((json_t *)properties, name, value) {
        if (!bt_outline_near_thickness(name) || json_is_null(value)) continue;
        any = true;
        keep_name(counts->nearly, name);
    }
    counts->unnamed += any;
}

/// Called with each feature as it is parsed.
static void take_feature(void *context, size_t index, const json_t *feature)
{
    reader *in = context;
    if (index >= BT_MAX_FLOES) return; // read_features refuses them
    if (index + 1 >= in->cap_features)
        in->feature = bt_realloc(in->feature, in->cap_features = 256 + 3 * in->cap_features / 2, sizeof *in->feature);
    map_feature *out = &in->feature[index];
    const int64_t first = index ? out->vertex : 0;
    if (first + BT_MAX_RING > in->cap_vertices)
        in->ring = bt_realloc(in->ring, 2 * (size_t)(in->cap_vertices = BT_MAX_RING + 3 * first / 2),
                              sizeof *in->ring);
    const json_t *properties = json_object_get(feature, "properties");
    json_t *id = json_object_get(feature, "id"), *thickness = json_object_get(properties, "thickness");
    *out = (map_feature){.vertex = first, .fixed = json_is_true(json_object_get(properties, "fixed"))};
    out[1] = (map_feature){.vertex = first + coordinates_of(feature, in->ring + 2 * first, &out->why)};
    out->id = json_incref(id ? id : json_object_get(properties, "id"));
    if (thickness && !json_is_null(thickness)) out->thickness = json_incref(thickness);
    else look_for_thickness(in, properties);
    look_for_chart(in, properties);
    in->n_features = index + 1;
}

static void read_feature(reader *in, size_t index)
{
    char name[96], text[BT_ICE_WHY];
    const map_feature *feature = &in->feature[index];
    double *v = in->ring + 2 * feature->vertex;
    int n = (int)(feature[1].vertex - feature->vertex);
    const char *why = feature->why ? feature->why : place(in, n, v);
    bt_outline_counts *counts = &in->f->outlines;
    if (!why) {
        const int clean = bt_outline_clean(n, v);
        counts->dropped += n - clean;
        n = clean;
        // Anticlockwise on the map is clockwise in the geographic frame.
        const bool clockwise = bt_outline_area2(n, v) < 0,
                   mirrored = in->kind != FRAME && in->c->domain.frame == BT_FRAME_GEOGRAPHIC;
        if (clockwise) turn_round(n, v);
        counts->turned += clockwise != mirrored;
        why = bt_outline_admit(in->c->ice.nonconvex, &n, v, counts);
    }
    if (why) {
        bt_refuse(&in->r, "%s is refused: %s", name_of(in, index, name), why);
        return;
    }
    if (feature->fixed) { // as bergtow export writes them
        bt_refuse(&in->r, "%s has the property `fixed`: true, but floes from outlines drift; give it in `floes` with "
                          "fixed: true and remove it here, or remove the property", name_of(in, index, name));
        return;
    }
    const json_t *given = feature->thickness;
    if (json_is_string(given)) {
        bt_refuse(&in->r, "%s: thickness is a text, \"%.20s\"; write the number of metres without quotes",
                  name_of(in, index, name), json_string_value(given));
        return;
    }
    double thickness;
    if (given) thickness = json_is_number(given) ? json_number_value(given) : NAN;
    else {
        counts->bare++;
        if (isnan(in->c->ice.thickness)) return; // check_thickness reports it
        thickness = bt_field_thickness(in->c, in->f->n);
    }
    const bt_idx i = in->f->n;
    bt_field_add(in->f, n, v, 0, 0, 0, thickness);
    counts->read++;
    const bt_field *field = in->f;
    const bt_ice_floe floe = {n,
                              field->vertices + 2 * field->offsets[i],
                              field->pose[3 * i],
                              field->pose[3 * i + 1],
                              field->pose[3 * i + 2],
                              thickness,
                              field->area[i],
                              1e-6};
    if ((why = bt_ice_floe_fault(&floe, text, NULL))) bt_refuse(&in->r, "%s: %s", name_of(in, index, name), why);
}

/// Find the kind of the coordinates from the file's crs or the case; refuse a file that contradicts the case.
static void choose_coordinates(reader *in, const json_t *root)
{
    const json_t *crs = json_object_get(root, "crs"), *mark = json_object_get(root, "bergtow");
    const char *type = json_string_value(json_object_get(crs, "type")),
               *name = json_string_value(json_object_get(json_object_get(crs, "properties"), "name"));
    const char *frame = json_string_value(json_object_get(mark, "frame"));
    const bt_crs key = in->c->ice.outlines_crs;
    const bool basin = in->c->domain.frame == BT_FRAME_BASIN, degrees = key == BT_CRS_LONLAT,
               metres = key != BT_CRS_FILE && key != BT_CRS_LONLAT;
    in->crs.kind = BT_MAP_LOCAL;
    if (crs && (!type || strcmp(type, "name") || !name) && key == BT_CRS_FILE) {
        bt_refuse(&in->r, "its crs is not given by a name ({\"type\": \"name\", \"properties\": {\"name\": "
                          "\"EPSG:32633\"}}); give it in this form, or remove it and set ice.outlines_crs: lonlat or "
                          "plane");
        return;
    }
    if (crs && name) in->crs = bt_map_crs_of(name);
    const bool said = crs && name && in->crs.kind != BT_MAP_UNKNOWN;
    if (said && in->crs.kind == BT_MAP_LOCAL) {
        in->kind = PLANE;
        snprintf(in->crs.name, sizeof in->crs.name, "local");
        if (degrees || key == BT_CRS_FRAME)
            bt_refuse(&in->r,
                      "its coordinates are metres east and north, written by bergtow; remove ice.outlines_crs: %s",
                      degrees ? "lonlat" : "frame");
        else if (frame && strcmp(frame, basin ? "basin" : "geographic"))
            bt_refuse(&in->r,
                      "its coordinates are metres of the frame %.20s; set domain.frame: %.20s, or make the field for "
                      "this frame",
                      frame, frame);
    } else if (said && in->crs.kind == BT_MAP_WARPED) {
        bt_refuse(&in->r,
                  "its crs is %s, Mercator, whose metres are not those on the ground: shorter by the cosine of the "
                  "latitude; convert them to degrees: bergtow outlines %s -o floes.geojson",
                  in->crs.name, in->r.path);
    } else if (said) {
        in->kind = in->crs.kind == BT_MAP_DEGREES ? DEGREES : PLANE;
        if (in->kind == DEGREES ? metres : degrees || key == BT_CRS_FRAME)
            bt_refuse(
                &in->r,
                "its crs is %s, in %s, but ice.outlines_crs says otherwise; remove the key, or correct the crs of the "
                "file",
                in->crs.name, in->kind == DEGREES ? "degrees" : "metres east and north");
    } else if (crs && key == BT_CRS_FILE) {
        bt_refuse(&in->r,
                  "its crs, %.100s, is not known here as degrees or as metres east and north; convert it to degrees: "
                  "bergtow outlines %s -o floes.geojson, or set ice.outlines_crs: plane if its coordinates are metres "
                  "east and north",
                  name, in->r.path);
    } else if (metres) {
        in->kind = in->c->ice.outlines_crs == BT_CRS_PLANE ? PLANE : FRAME;
        snprintf(in->crs.name, sizeof in->crs.name, "local");
    } else {
        in->kind = DEGREES;
        in->assumed = !degrees;
        snprintf(in->crs.name, sizeof in->crs.name, "OGC:CRS84");
    }
}

/// Area of floe i within the ice region, m²; exactly the area of the floe if no part is outside.
static double area_in_region(reader *s, const bt_region *region, bt_idx i)
{
    const bt_field *field = s->f;
    const double *p = field->pose + 3 * (size_t)i, *own = field->vertices + 2 * field->offsets[i];
    const int n = (int)(field->offsets[i + 1] - field->offsets[i]);
    double v[2 * BT_MAX_VERTICES];
    bool in = true;
    for (int k = 0; k < n; k++) { // outlines have no yaw
        v[2 * k] = p[0] + own[2 * k], v[2 * k + 1] = p[1] + own[2 * k + 1];
        in = in && (region->periodic_x || (v[2 * k] >= region->x0 && v[2 * k] <= region->x1)) &&
             (region->periodic_y || (v[2 * k + 1] >= region->y0 && v[2 * k + 1] <= region->y1));
    }
    if (in) return field->area[i];
    double x = p[0], z = p[1];
    bt_region_wrap(region, &x, &z);
    s->f->outlines.outside += !(x >= region->x0 && x <= region->x1 && z >= region->y0 && z <= region->y1);
    return bt_region_area_of(region, s->c, n, v);
}

/// Note where the ice ends (region of bt_outline_counts). Walls hold the ice, so the water before them is known.
static void note_region(reader *in)
{
    const bt_field *field = in->f;
    const bt_bound kind[2] = {in->c->domain.ends, in->c->domain.sides};
    const double most = BT_ARCH_WATER * bt_field_mean_size(field); // of open water
    double low[2], high[2], *region = in->f->outlines.region;
    bt_case_ice_region(in->c, low, high);
    for (int k = 0; k < 2; k++) {
        double from = INFINITY, to = -INFINITY;
        for (bt_idx i = 0; i < field->n; i++)
            for (int64_t v = field->offsets[i]; v < field->offsets[i + 1]; v++) { // outlines have no yaw
                from = bt_min(from, field->pose[3 * i + k] + field->vertices[2 * v + k]);
                to = bt_max(to, field->pose[3 * i + k] + field->vertices[2 * v + k]);
            }
        const bool open = kind[k] == BT_BOUND_OPEN;
        region[k] = open && from - low[k] > most ? from : low[k];
        region[2 + k] = open && high[k] - to > most ? to : high[k];
        if (!(region[k] < region[2 + k])) region[k] = low[k], region[2 + k] = high[k]; // no floe is in it
    }
}

/// Set the concentration in the ice region: ice outside is kept, but does not count.
static void set_concentration(reader *in)
{
    bt_region region;
    const bt_status status = bt_region_init(&region, in->c, 0, in->r.err);
    if (status != BT_OK) in->r.status = status;
    double sum = 0, whole = 0;
    for (bt_idx i = 0; i < in->f->n && status == BT_OK; i++) {
        sum += area_in_region(in, &region, i);
        whole += in->f->area[i];
    }
    in->f->ice_area = region.ice_area;
    in->f->concentration = status == BT_OK ? sum / region.ice_area : 0;
    in->f->outlines.outside_area = whole - sum;
    bt_region_free(&region);
    if (in->f->n > 0) note_region(in);
}

/// Refuse floes without a thickness if the case has none either.
static void check_thickness(reader *in, size_t features)
{
    const bt_outline_counts *counts = &in->f->outlines;
    if (!isnan(in->c->ice.thickness) || !counts->bare) return;
    bt_refuse(&in->r,
              "%lld of %zu outlines have no property `thickness`%s%s%s, and the case has no ice.thickness (there is no "
              "default in domain.frame: geographic); give it, as in 1 m",
              (long long)counts->bare, features, *counts->nearly ? " (but " : "", counts->nearly,
              *counts->nearly ? ")" : "");
}

/// Check the floes as a whole: if far too small or too large, their coordinates are in other units.
static void check_whole(reader *in)
{
    double size = 0, thickness = 0;
    for (bt_idx i = 0; i < in->f->n; i++) size += sqrt(4 * in->f->area[i] / BT_PI), thickness += in->f->thickness[i];
    char why[BT_ICE_WHY];
    if (bt_ice_domain_fault(in->c, in->f, why))
        bt_refuse(&in->r, "%s%s", why,
                  in->assumed
                  ? "; without a crs they are degrees (RFC 7946): if they are metres, give the file its crs "
                                "or set ice.outlines_crs: plane"
                              : "");
    else if (in->kind != DEGREES && size < 0.1 * thickness)
        bt_refuse(&in->r,
                  "its floes are %.3g m in size and %.3g m thick on average, as if degrees were read as metres; if "
                  "they are degrees, remove its crs and ice.outlines_crs",
                  size / in->f->n, thickness / in->f->n);
}

static void read_features(reader *in, const json_t *root, size_t n)
{
    const json_t *mark = json_object_get(root, "bergtow");
    const char *type = json_string_value(json_object_get(root, "type"));
    if (!type || strcmp(type, "FeatureCollection") || !json_is_array(json_object_get(root, "features"))) {
        bt_refuse(&in->r,
                  "is not a GeoJSON FeatureCollection; write {\"type\": \"FeatureCollection\", \"features\": [...]}");
        return;
    }
    if (n == 0 || n > BT_MAX_FLOES) {
        bt_refuse(&in->r, "has %zu features; give 1 to %d (open water: ice.concentration: 0)", n, BT_MAX_FLOES);
        return;
    }
    choose_coordinates(in, root);
    if (in->r.status == BT_OK && in->kind == DEGREES) begin_degrees(in, mark);
    else if (in->r.status == BT_OK) begin_plane(in, mark);
    if (in->r.status != BT_OK) return;
    for (size_t i = 0; i < n; i++) read_feature(in, i);
    check_thickness(in, n);
    bt_outline_counts *counts = &in->f->outlines;
    counts->lon = in->kind == DEGREES ? in->lon0 : NAN;
    counts->lat = in->kind == DEGREES ? in->lat0 : NAN;
    counts->east = in->kind == PLANE ? in->east0 : NAN;
    counts->north = in->kind == PLANE ? in->north0 : NAN;
    snprintf(counts->crs, sizeof counts->crs, "%s", in->crs.name);
    if (in->r.status != BT_OK) return;
    set_concentration(in);
    if (in->r.status == BT_OK) check_whole(in);
    // Floes have the numbers of their features only if none was refused.
    if (in->r.status == BT_OK) bt_field_check_places(in->c, in->f, "feature", &in->r);
}

bt_status bt_field_read_outlines(const bt_case *input, bt_field *field, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const char *path = input->ice.outlines;
    bt_field_free(field);
    bt_field_init(field);
    json_t *root;
    size_t n;
    reader in = {.c = input, .r = {.path = path, .err = err}, .f = field};
    in.r.status = bt_features_read(path, take_feature, &in, &root, &n, err);
    if (in.r.status == BT_OK) read_features(&in, root, n);
    for (size_t i = 0; i < in.n_features; i++) json_decref(in.feature[i].id), json_decref(in.feature[i].thickness);
    free(in.feature);
    free(in.ring);
    json_decref(root);
    if (in.r.status != BT_OK) {
        bt_field_free(field);
        bt_field_init(field);
    }
    return in.r.status;
}

// --- write -----------------------------------------------------------------------------------------------------------

/// How a field is written.
typedef struct map {
    const bt_field *f;
    const bt_case *c;
    bt_map_place place;
} map;

/// Write a vertex of the case's frame as a position of the file.
static void write_position(FILE *out, const map *m, double x, double y)
{
    const bool basin = m->c->domain.frame == BT_FRAME_BASIN;
    const double east = basin ? x : y, north = basin ? y : x;
    double first = m->place.first + east, second = m->place.second + north;
    if (m->place.kind == BT_MAP_DEGREES) {
        bt_outline_unproject(north, east, m->place.first, m->place.second, &first, &second);
        first /= DEGREE, second /= DEGREE;
    }
    fprintf(out, "[%.17g,%.17g]", first, second);
}

static void write_floe(FILE *out, const map *m, bt_idx i)
{
    const bt_field *field = m->f;
    const double *p = field->pose + 3 * (size_t)i, c = bt_cos(p[2]), s = bt_sin(p[2]);
    const int64_t first = field->offsets[i], n = field->offsets[i + 1] - first;
    const bool mirrored = m->c->domain.frame == BT_FRAME_GEOGRAPHIC; // anticlockwise on the map [RFC 7946, 3.1.6]
    fprintf(out,
            "%s\n{\"type\":\"Feature\",\"id\":%d,\"properties\":{\"thickness\":%.17g},\"geometry\":{\"type\":"
            "\"Polygon\",\"coordinates\":[[",
            i ? "," : "", (int)i, field->thickness[i]);
    for (int64_t k = 0; k <= n; k++) { // the first again: a ring is closed
        const double *v = field->vertices + 2 * (first + (mirrored ? (2 * n - 1 - k) % n : k % n));
        if (k) fputc(',', out);
        write_position(out, m, p[0] + c * v[0] - s * v[1], p[1] + s * v[0] + c * v[1]);
    }
    fprintf(out, "]]}}");
}

/// Beginning of a file that this program has written.
#define HEAD "{\"type\":\"FeatureCollection\",\n\"bergtow\":"

bool bt_field_outlines_ours(const char *path) { return bt_file_begins(path, HEAD); }

bt_status bt_field_write_outlines(const bt_field *field, const bt_case *input, const char *path, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    bt_text lines;
    bt_text_begin(&lines);
    FILE *out = lines.out;
    const bt_map_place place = bt_map_place_of(&field->outlines, input);
    const bool known = place.kind == BT_MAP_DEGREES;
    const map m = {.f = field, .c = input, .place = place};
    fprintf(out,
            HEAD "{\"version\":\"%s\",\"coordinates\":\"%s\",\"origin\":[%.17g,%.17g],\"frame\":\"%s\",\"ice_"
                 "area_m2\":%.17g},\n",
            BT_VERSION, known ? "longitude and latitude, degrees" : "east and north, metres",
            known ? place.first / DEGREE : place.first, known ? place.second / DEGREE : place.second,
            input->domain.frame == BT_FRAME_BASIN ? "basin" : "geographic", field->ice_area);
    if (!known)
        fprintf(out, "\"crs\":{\"type\":\"name\",\"properties\":{\"name\":\"%s\"}},\n", place.crs);
    fprintf(out, "\"features\":[");
    for (bt_idx i = 0; i < field->n; i++) write_floe(out, &m, i);
    fprintf(out, "\n]}\n");
    char *text = bt_text_end(&lines);
    const bt_status status = bt_file_write(path, text, err);
    free(text);
    return status;
}
