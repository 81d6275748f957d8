// SPDX-License-Identifier: MIT
// Floe outlines in GeoJSON (RFC 7946): a FeatureCollection of Polygons, as image analysis and GIS programs write it.
//
//     {"type": "FeatureCollection", "features": [
//       {"type": "Feature", "id": 7, "properties": {"thickness": 1.2},
//        "geometry": {"type": "Polygon", "coordinates": [[[x, y], [x, y], ..., [x, y]]]}}, ...]}
//
// Coordinates are metres in the case's frame, or longitude and latitude, projected about an origin (bergtow/outline.h). In the basin's frame x
// is then east and y north, in the geographic frame x north and y east, where a ring that runs anticlockwise on the map runs clockwise: rings are
// turned as needed. A MultiPolygon of one polygon is one, too. A height (third coordinate) is passed over.
#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/outline.h"
#include "field_load.h"
#include "field_make.h"
#include "fileio.h"
#include "largest.h"

static const double FARTHEST = 100e3; // m from the origin: the projection is one of small areas
static const double THICKEST = 100;   // m, as ice.thickness

typedef struct reader {
    const bt_case *c;
    bt_refusals r;
    bt_field *f;
    double lon0, lat0; ///< rad
} reader;

/// "feature 3" or "feature 3 (id 17)".
static const char *name_of(const json_t *feature, size_t index, char out[96])
{
    const json_t *id = json_object_get(feature, "id");
    if (!id) id = json_object_get(json_object_get(feature, "properties"), "id");
    if (json_is_string(id)) snprintf(out, 96, "feature %zu (id %.60s)", index, json_string_value(id));
    else if (json_is_integer(id)) snprintf(out, 96, "feature %zu (id %" JSON_INTEGER_FORMAT ")", index, json_integer_value(id));
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
            *why = "it has several polygons (MultiPolygon); make each a feature of its own";
            return NULL;
        }
        polygon = json_array_get(polygon, 0);
    } else if (!type || strcmp(type, "Polygon")) {
        *why = "its geometry is not a Polygon; take it out";
        return NULL;
    }
    if (json_array_size(polygon) > 1) {
        *why = "it has holes, and a floe has none here; take out all rings but the first";
        return NULL;
    }
    const json_t *ring = json_array_get(polygon, 0);
    if (!json_is_array(ring)) *why = "its coordinates are no list of rings; write [[[x, y], [x, y], ...]]";
    else if (json_array_size(ring) > BT_MOST_RING) *why = "it has more than 10000 vertices; simplify it";
    else return ring;
    return NULL;
}

/// Coordinates as they are in the file, the closing one left out; their number, 0 and why not.
static int coordinates_of(const json_t *ring, double *v, const char **why)
{
    size_t n = json_array_size(ring);
    for (size_t i = 0; i < n; i++) {
        const json_t *p = json_array_get(ring, i), *x = json_array_get(p, 0), *y = json_array_get(p, 1);
        if (!json_is_number(x) || !json_is_number(y)) {
            *why = "a vertex is no pair of numbers; write [x, y]";
            return 0;
        }
        v[2 * i] = json_number_value(x);
        v[2 * i + 1] = json_number_value(y);
    }
    if (n > 1 && v[0] == v[2 * n - 2] && v[1] == v[2 * n - 1]) n--;
    if (n < 3) *why = "it has fewer than 3 vertices";
    return n < 3 ? 0 : (int)n;
}

/// Middle of the box of all coordinates. Rings that lie on both sides of 180° would have it on the wrong side of the earth: they are
/// taken with longitudes from 0° to 360° when that makes the box smaller.
static void find_origin(reader *s, const json_t *features)
{
    const bt_case *c = s->c;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}; // lon, lat, lon from 0° on
    for (size_t i = 0; i < json_array_size(features); i++) {
        const char *why;
        const json_t *ring = ring_of(json_array_get(features, i), &why);
        for (size_t k = 0; ring && k < json_array_size(ring); k++) {
            const json_t *p = json_array_get(ring, k);
            const double lon = json_number_value(json_array_get(p, 0)), q[3] = {lon, json_number_value(json_array_get(p, 1)), lon < 0 ? lon + 360 : lon};
            for (int a = 0; a < 3; a++) low[a] = bt_min(low[a], q[a]), high[a] = bt_max(high[a], q[a]);
        }
    }
    const int a = high[2] - low[2] < high[0] - low[0] ? 2 : 0;
    const double degree = BT_PI / 180, lon = (low[a] + high[a]) / 2;
    s->lon0 = isnan(c->ice.origin_lon) ? (lon > 180 ? lon - 360 : lon) * degree : c->ice.origin_lon;
    s->lat0 = isnan(c->ice.origin_lat) ? (low[1] + high[1]) / 2 * degree : c->ice.origin_lat;
}

/// Degrees to metres in the case's frame, in place; why not, or NULL.
static const char *project(const reader *s, int n, double *v)
{
    const double degree = BT_PI / 180;
    for (int i = 0; i < n; i++) {
        const double lon = v[2 * i], lat = v[2 * i + 1];
        if (!(fabs(lon) <= 360 && fabs(lat) <= 90)) return "a vertex is not longitude and latitude in degrees, in this order; "
                                                           "for metres leave out ice.outlines_crs";
        double north, east;
        bt_outline_project(lon * degree, lat * degree, s->lon0, s->lat0, &north, &east);
        if (!(hypot(north, east) <= FARTHEST)) return "it is more than 100 km from the origin, where the projection of a small area no longer holds; set ice.origin_lon and "
                                                      "ice.origin_lat, or take it out";
        const bool basin = s->c->domain.frame == BT_FRAME_BASIN;
        v[2 * i] = basin ? east : north;
        v[2 * i + 1] = basin ? north : east;
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

static void read_feature(reader *s, const json_t *feature, size_t index, double *v)
{
    char name[96];
    name_of(feature, index, name);
    const char *why = NULL;
    const json_t *ring = ring_of(feature, &why);
    int n = ring ? coordinates_of(ring, v, &why) : 0;
    if (n && s->c->ice.outlines_crs == BT_CRS_LONLAT) why = project(s, n, v);
    bt_outline_counts *counts = &s->f->outlines;
    if (!why) {
        const int clean = bt_outline_clean(n, v);
        counts->dropped += n - clean;
        n = clean;
        if (bt_outline_area2(n, v) < 0) {
            turn_round(n, v);
            counts->turned++;
        }
        why = bt_outline_admit(s->c->ice.nonconvex, &n, v, counts);
    }
    if (why) {
        bt_refuse(&s->r, "%s is refused: %s", name, why);
        return;
    }
    double thickness = bt_field_thickness(s->c, s->f->n);
    const json_t *given = json_object_get(json_object_get(feature, "properties"), "thickness");
    if (given && !json_is_null(given)) {
        thickness = json_number_value(given);
        if (!json_is_number(given) || !(thickness > 0) || !(thickness <= THICKEST)) {
            bt_refuse(&s->r, "%s: its thickness is refused: give a number of metres above 0 and up to %g, without a unit, or leave it out", name, THICKEST);
            return;
        }
    }
    bt_field_add(s->f, n, v, 0, 0, 0, thickness);
    counts->read++;
}

/// What a file written by bt_field_write_outlines says of its own coordinates.
static void check_own_mark(reader *s, const json_t *root)
{
    const json_t *mark = json_object_get(root, "bergtow");
    const char *frame = json_string_value(json_object_get(mark, "frame"));
    if (!mark) return;
    if (s->c->ice.outlines_crs == BT_CRS_LONLAT) bt_refuse(&s->r, "its coordinates are metres, written by bergtow; remove ice.outlines_crs: lonlat");
    else if (frame && strcmp(frame, s->c->domain.frame == BT_FRAME_BASIN ? "basin" : "geographic"))
        bt_refuse(&s->r, "its coordinates are metres of the frame %.20s; set domain.frame: %.20s, or make the field for this frame", frame, frame);
}

static void read_features(reader *s, const json_t *root)
{
    const json_t *features = json_object_get(root, "features");
    const char *type = json_string_value(json_object_get(root, "type"));
    if (!type || strcmp(type, "FeatureCollection") || !json_is_array(features)) {
        bt_refuse(&s->r, "is not a GeoJSON FeatureCollection; write {\"type\": \"FeatureCollection\", \"features\": [...]}");
        return;
    }
    if (json_array_size(features) == 0 || json_array_size(features) > BT_MOST_FLOES) {
        bt_refuse(&s->r, "has %zu features; give 1 to %d (open water: ice.concentration: 0)", json_array_size(features), BT_MOST_FLOES);
        return;
    }
    check_own_mark(s, root);
    if (s->r.status != BT_OK) return;
    const bool lonlat = s->c->ice.outlines_crs == BT_CRS_LONLAT;
    if (lonlat) find_origin(s, features);
    double *v = bt_alloc(2 * (BT_MOST_RING + 1), sizeof *v);
    for (size_t i = 0; i < json_array_size(features); i++) read_feature(s, json_array_get(features, i), i, v);
    free(v);
    s->f->outlines.lon = lonlat ? s->lon0 : NAN;
    s->f->outlines.lat = lonlat ? s->lat0 : NAN;
    // Numbers of floes are those of features only when none is missing.
    if (s->r.status == BT_OK) bt_field_check_places(s->c, s->f, "feature", &s->r);
}

static void set_concentration(reader *s)
{
    bt_yard y;
    const bt_status status = bt_yard_init(&y, s->c, 0, s->r.err);
    if (status != BT_OK) s->r.status = status;
    double sum = 0;
    for (bt_idx i = 0; i < s->f->n; i++) sum += s->f->area[i];
    s->f->ice_area = y.ice_area;
    s->f->concentration = status == BT_OK ? sum / y.ice_area : 0;
    bt_yard_free(&y);
}

/// The file as a tree. What a hostile one could make of it is known before: the tree takes far more room than the text.
static bt_status load(const char *path, json_t **root, bt_errors *err)
{
    char *text;
    size_t size;
    bt_status status = bt_file_read_to(path, "a GeoJSON file of outlines", BT_MOST_OUTLINE_BYTES, &text, &size, err);
    int64_t lists = 0;
    for (size_t i = 0; status == BT_OK && i < size; i++) lists += text[i] == '[';
    if (lists > BT_MOST_LISTS) {
        bt_errors_add(err, "%s: holds %" PRId64 " lists (vertices), at most %d are read; simplify the outlines, or cut them into several files", path, lists, BT_MOST_LISTS);
        status = BT_ERR_CASE;
    }
    json_error_t why;
    if (status == BT_OK && !(*root = json_loadb(text, size, JSON_REJECT_DUPLICATES, &why))) {
        bt_errors_add(err, "%s:%d: is not JSON: %s; mend the file", path, why.line, why.text);
        status = BT_ERR_CASE;
    }
    free(text);
    return status;
}

bt_status bt_field_read_outlines(const bt_case *c, bt_field *f, bt_errors *err)
{
    const char *path = c->ice.outlines;
    bt_field_free(f);
    bt_field_init(f);
    json_t *root = NULL;
    const bt_status status = load(path, &root, err);
    if (status != BT_OK) return status;
    reader s = {.c = c, .r = {.path = path, .err = err, .status = BT_OK}, .f = f};
    read_features(&s, root);
    json_decref(root);
    if (s.r.status == BT_OK) set_concentration(&s);
    if (s.r.status != BT_OK) {
        bt_field_free(f);
        bt_field_init(f);
    }
    return s.r.status;
}

// --- write -----------------------------------------------------------------------------------------------------------

static void write_floe(FILE *out, const bt_field *f, bt_idx i)
{
    const double *p = f->pose + 3 * (size_t)i, c = cos(p[2]), s = sin(p[2]);
    const int64_t first = f->offsets[i], n = f->offsets[i + 1] - first;
    fprintf(out, "%s\n{\"type\":\"Feature\",\"id\":%d,\"properties\":{\"thickness\":%.17g},\"geometry\":{\"type\":\"Polygon\",\"coordinates\":[[", i ? "," : "", (int)i,
            f->thickness[i]);
    for (int64_t k = 0; k <= n; k++) { // the first once more: a ring is closed
        const double *v = f->vertices + 2 * (first + k % n);
        fprintf(out, "%s[%.17g,%.17g]", k ? "," : "", p[0] + c * v[0] - s * v[1], p[1] + s * v[0] + c * v[1]);
    }
    fprintf(out, "]]}}");
}

bt_status bt_field_write_outlines(const bt_field *f, const bt_case *c, const char *path, bt_errors *err)
{
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    if (!out) return bt_file_fail(path, "write the outlines", errno, err);
    fprintf(out, "{\"type\":\"FeatureCollection\",\n\"bergtow\":{\"version\":\"%s\",\"coordinates\":\"metres\",\"frame\":\"%s\",\"ice_area_m2\":%.17g},\n\"features\":[",
            BT_VERSION, c->domain.frame == BT_FRAME_BASIN ? "basin" : "geographic", f->ice_area);
    for (bt_idx i = 0; i < f->n; i++) write_floe(out, f, i);
    fprintf(out, "\n]}\n");
    const bool whole = fclose(out) == 0;
    const bt_status status = whole ? bt_file_write(path, text, err) : bt_file_fail(path, "write the outlines", ENOMEM, err);
    free(text);
    return status;
}
