// SPDX-License-Identifier: MIT
// Finding, cutting and parsing features; why: map_features.h.
#include "field/map_features.h"

#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/sum.h"
#include "base/fileio.h"
#include "base/inside.h"
#include "base/largest.h"

// --- a scan over brackets and strings: it never refuses what is JSON, and need not refuse what is none

/// A stretch of text that is being gone through; p == NULL: it is not what was looked for.
typedef struct scan { const char *p, *end; } scan;

static char peek(const scan *at) { return at->p && at->p < at->end ? *at->p : '\0'; }

static void skip_space(scan *at)
{
    while (at->p && at->p < at->end && (*at->p == ' ' || *at->p == '\n' || *at->p == '\t' || *at->p == '\r')) at->p++;
}

/// Take the character c, with the space behind it.
static bool take(scan *at, char c)
{
    if (peek(at) != c) return false;
    at->p++;
    skip_space(at);
    return true;
}

static void skip_string(scan *at)
{
    for (at->p++; at->p < at->end && *at->p != '"'; at->p++)
        if (*at->p == '\\') at->p++;
    at->p = at->p < at->end ? at->p + 1 : NULL;
}

/// A value, and the space behind it.
static void skip_value(scan *at)
{
    static const bool marks[UCHAR_MAX + 1] = {['"'] = true, ['['] = true, [']'] = true, ['{'] = true, ['}'] = true};
    int64_t depth = 0;
    const char *begin = at->p;
    do {
        while (depth > 0 && at->p < at->end && !marks[(unsigned char)*at->p]) at->p++; // what most of the text is
        const char c = peek(at);
        if (c == '"') {
            skip_string(at);
            continue;
        }
        if (c == '[' || c == '{') depth++;
        else if (c == ']' || c == '}') depth--;
        else if (depth == 0 && (c == ',' || c == ':' || c == ' ' || c == '\n' || c == '\t' || c == '\r')) break;
        if (depth < 0 || at->p >= at->end) break;
        at->p++;
    } while (at->p && (depth > 0 || (at->p[-1] != ']' && at->p[-1] != '}' && at->p[-1] != '"')));
    if (depth > 0 || at->p == begin) at->p = NULL;
    skip_space(at);
}

/// The next key of an object, up to its value: is it this one, in plain letters? False also when there is no more.
static bool take_key(scan *at, const char *name, bool *is)
{
    if (peek(at) != '"') return false;
    const char *begin = at->p + 1;
    skip_string(at);
    if (!at->p) return false;
    const size_t n = (size_t)(at->p - 1 - begin);
    *is = n == strlen(name) && !memcmp(begin, name, n);
    skip_space(at);
    return take(at, ':');
}

/// In the object that begins here, to the value of a key in plain letters.
static bool find_value(scan *at, const char *name)
{
    bool is;
    if (!take(at, '{')) return false;
    while (take_key(at, name, &is)) {
        if (is) return true;
        skip_value(at);
        if (!take(at, ',')) return false;
    }
    return false;
}

enum { MOST_DIGITS = 19 }; // of a number, and of a power of ten, that 64 bits hold

/// w · 10^−k as the nearest double, k up to MOST_DIGITS. False: this needs more bits.
static bool nearest(uint64_t w, int k, double *x)
{
    // The quotient in units of 2⁻⁶⁴, its last bit set where there is a rest: with 55 bits and more it is rounded as the
    // number itself. By strtod, reading a number of 17 digits takes twice the instructions.
    static const uint64_t powers[MOST_DIGITS + 1] = {
        1u,         10u,         100u,         1000u,         10000u,         100000u,         1000000u,
        10000000u,  100000000u,  1000000000u,  10000000000u,  100000000000u,  1000000000000u,  10000000000000u,
        100000000000000u, 1000000000000000u, 10000000000000000u, 100000000000000000u, 1000000000000000000u,
        10000000000000000000u};
    const uint64_t power = powers[k];
    if (w >> 53 == 0) { // w and a power up to 10²² are doubles themselves, and a division is rounded once
        *x = (double)w / (double)power;
        return true;
    }
    const bt_uint128 units = (bt_uint128)w << 64, q = units / power;
    *x = (double)(q | (q * power != units)) * 0x1p-64;
    return q >> 55 > 0;
}

/// The digits from p on, and *w with them behind its own: the first MOST_DIGITS are exact. Returns their end.
static const char *take_digits(const char *p, const char *end, uint64_t *w)
{
    for (; p < end && *p >= '0' && *p <= '9'; p++) *w = 10 * *w + (uint64_t)(*p - '0');
    return p;
}

/// A number as JSON has it [RFC 8259], of those that jansson takes for the same.
static bool take_number(scan *at, double *x)
{
    enum { MOST = 63, DIGITS = 15 };
    char copy[MOST + 1];
    const char *p = at->p, *begin = p;
    if (p < at->end && *p == '-') p++;
    const char *digits = p;
    uint64_t w = 0, power = 0;
    p = take_digits(p, at->end, &w);
    ptrdiff_t places = p - digits, behind = 0; // behind the point
    if (places == 0 || (*digits == '0' && places > 1)) return false;
    bool whole = true, exponent = false;
    if (p < at->end && *p == '.') {
        const char *first = p + 1;
        p = take_digits(first, at->end, &w);
        behind = p - first, places += behind;
        if (behind == 0) return false;
        whole = false;
    }
    if (p < at->end && (*p == 'e' || *p == 'E')) {
        p++;
        if (p < at->end && (*p == '+' || *p == '-')) p++;
        const char *first = p;
        p = take_digits(p, at->end, &power);
        if (p == first) return false;
        whole = false, exponent = true;
    }
    const size_t n = (size_t)(p - begin);
    if (n > MOST || (whole && places > DIGITS)) return false;
    if (!exponent && places <= MOST_DIGITS && nearest(w, (int)behind, x)) {
        if (digits > begin) *x = -*x;
    } else {
        memcpy(copy, begin, n);
        copy[n] = '\0';
        void *locale = bt_point_begin();
        *x = strtod(copy, NULL);
        bt_point_end(locale);
    }
    *x += whole ? 0.0 : -0.0; // there is no whole −0
    at->p = p;
    skip_space(at);
    return isfinite(*x);
}

/// [east, north] or [east, north, height, ...].
static bool take_position(scan *at, double v[2])
{
    double more;
    if (!take(at, '[') || !take_number(at, &v[0]) || !take(at, ',') || !take_number(at, &v[1])) return false;
    while (take(at, ','))
        if (!take_number(at, &more)) return false;
    return take(at, ']');
}

static double *next_vertex(bt_features *features)
{
    if (features->n_vertices == features->cap_vertices) {
        features->cap_vertices = features->cap_vertices ? features->cap_vertices + features->cap_vertices / 2 : 1024;
        features->ring = bt_realloc(features->ring, 2 * (size_t)features->cap_vertices, sizeof *features->ring);
    }
    return features->ring + 2 * features->n_vertices++;
}

/// Coordinates of one ring at `depth` lists within lists, the last ones its positions.
static bool take_ring(bt_features *features, scan *at, int depth)
{
    for (int k = 0; k < depth; k++)
        if (!take(at, '[')) return false;
    const int64_t first = features->n_vertices;
    do {
        if (features->n_vertices - first > BT_MOST_RING || !take_position(at, next_vertex(features))) return false;
    } while (take(at, ','));
    for (int k = 0; k < depth; k++)
        if (!take(at, ']')) return false;
    return features->n_vertices - first <= BT_MOST_RING;
}

// --- features --------------------------------------------------------------------------------------------------------

const json_t *bt_features_at(bt_features *features, size_t i)
{
    if (!features->span) return json_array_get(json_object_get(features->root, "features"), i);
    const bt_feature_span *span = &features->span[i];
    const bool cut = span->cut_end > span->cut;
    const size_t before = (cut ? span->cut : span->end) - span->begin, after = cut ? span->end - span->cut_end : 0,
                 n = before + after + (cut ? 4 : 0);
    const char *head = features->text + span->begin, *tail = features->text + span->cut_end;
    // Features of one program differ in their coordinates, and often in nothing else.
    if (features->parsed && n == features->n_lean && !memcmp(features->lean, head, before) &&
        (!cut || (!memcmp(features->lean + before, "null", 4) && !memcmp(features->lean + before + 4, tail, after))))
        return features->parsed;
    if (n > features->cap_lean) features->lean = bt_realloc(features->lean, features->cap_lean = 2 * n, 1);
    features->n_lean = n;
    memcpy(features->lean, head, before);
    if (cut) {
        memcpy(features->lean + before, "null", 4);
        memcpy(features->lean + before + 4, tail, after);
    }
    json_decref(features->parsed);
    features->parsed = json_loadb(features->lean, n, JSON_REJECT_DUPLICATES | JSON_DECODE_ANY, NULL);
    return features->parsed;
}

const double *bt_features_ring(const bt_features *features, size_t i, size_t *n)
{
    if (!features->span || features->span[i].cut == features->span[i].cut_end) return NULL;
    const int64_t first = features->span[i].vertex, end = i + 1 < features->n
                                                          ? features->span[i + 1].vertex : features->n_vertices;
    *n = (size_t)(end - first);
    return features->ring + 2 * first;
}

/// Take the coordinates out of the last feature if they are those of one ring, as deep as its type says.
static void cut_ring(bt_features *features, bt_feature_span *span)
{
    static const struct { const char *type; int depth; } kinds[] = {{"Polygon", 2}, {"MultiPolygon", 3}};
    for (int k = 0; k < 2; k++) {
        scan at = {features->text + span->begin, features->text + span->end};
        if (!find_value(&at, "geometry") || !find_value(&at, "coordinates")) return;
        const char *begin = at.p;
        features->n_vertices = span->vertex;
        if (!take_ring(features, &at, kinds[k].depth)) continue;
        span->cut = (uint32_t)(begin - features->text);
        span->cut_end = (uint32_t)(at.p - features->text);
        const char *type =
            json_string_value(json_object_get(json_object_get(bt_features_at(features, features->n - 1), "geometry"),
                                              "type"));
        if (type && !strcmp(type, kinds[k].type)) return;
        break;
    }
    features->n_vertices = span->vertex;
    span->cut = span->cut_end = 0;
}

/// One feature from here on. False: it is none that the parser takes.
static bool add_feature(bt_features *features, scan *at)
{
    const char *begin = at->p;
    skip_value(at);
    if (!at->p) return false;
    if (features->n == features->cap)
        features->span = bt_realloc(features->span, features->cap = features->cap
                                    ? features->cap + features->cap / 2 : 256, sizeof *features->span);
    bt_feature_span *span = &features->span[features->n++];
    *span = (bt_feature_span){
        .begin = (uint32_t)(begin - features->text), .end = (uint32_t)(at->p - features->text),
        .vertex = features->n_vertices};
    cut_ring(features, span);
    return bt_features_at(features, features->n - 1) != NULL;
}

/// The list of features, and the rest of the file. False: it is no JSON.
static bool split(bt_features *features)
{
    scan at = {features->text, features->text + features->size};
    skip_space(&at);
    if (!find_value(&at, "features") || !take(&at, '[')) {
        features->root = json_loadb(features->text, features->size, JSON_REJECT_DUPLICATES, NULL);
        features->n = json_array_size(json_object_get(features->root, "features"));
        return features->root != NULL;
    }
    const size_t before = (size_t)(at.p - features->text);
    if (peek(&at) != ']') {
        do {
            if (!add_feature(features, &at)) return false;
        } while (take(&at, ','));
    }
    if (peek(&at) != ']') return false;
    const size_t after = features->size - (size_t)(at.p - features->text);
    char *rest = bt_alloc(before + after, 1);
    memcpy(rest, features->text, before);
    memcpy(rest + before, at.p, after);
    features->root = json_loadb(rest, before + after, JSON_REJECT_DUPLICATES, NULL);
    free(rest);
    return features->root != NULL;
}

/// What a file is that is no JSON, by the bytes at its beginning, or NULL.
static const char *other_format(const char *text, size_t size)
{
    static const struct { size_t n; const char *bytes, *name; } kinds[] = {
        {4, "\0\0\x27\x0a", "a shapefile"},
        {15, "SQLite format 3", "a GeoPackage or another SQLite file"},
        {4, "\x89PNG", "an image (PNG)"},
        {3, "\xff\xd8\xff", "an image (JPEG)"},
        {4, "II*\0", "an image (TIFF)"},
        {4, "MM\0*", "an image (TIFF)"},
        {4, "II+\0", "an image (BigTIFF)"},
        {6, "\x93NUMPY", "an array of numpy"},
        {3, "CDF", "a grid (NetCDF)"},
        {4, "\x89HDF", "a grid (HDF5 or NetCDF)"},
        {4, "PK\3\4", "a zip archive (KMZ, shapefile)"},
        {1, "<", "XML (KML, GML)"},
    };
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++)
        if (size >= kinds[k].n && !memcmp(text, kinds[k].bytes, kinds[k].n))
            return kinds[k].name;
    return NULL;
}

bt_status bt_features_open(bt_features *features, const char *path, bt_errors *err)
{
    *features = (bt_features){0};
    bt_status status =
        bt_file_read_to(path, "a GeoJSON file of outlines", BT_MOST_OUTLINE_BYTES, &features->text, &features->size,
                        err);
    if (status != BT_OK) return status;
    const char *other = other_format(features->text, features->size);
    if (other) {
        bt_errors_add(err,
                      "%s: is %s, not GeoJSON; make GeoJSON of it: bergtow outlines %s -o floes.geojson (a field of "
                      "bergtow belongs to ice.field)",
                      path, other, path);
        return BT_ERR_CASE;
    }
    // What a hostile file could make of it is known before: a tree takes far more room than the text.
    int64_t lists = 0;
    const char *c = features->text, *end = features->text + features->size;
    while ((c = memchr(c, '[', (size_t)(end - c)))) c++, lists++;
    if (lists > BT_MOST_LISTS) {
        bt_errors_add(err,
                      "%s: holds %" PRId64
                      " lists (vertices), at most %d are read; simplify the outlines, or cut them into several files",
                      path, lists, BT_MOST_LISTS);
        return BT_ERR_CASE;
    }
    json_error_t why;
    if (!split(features)) {
        json_t *whole = json_loadb(features->text, features->size, JSON_REJECT_DUPLICATES, &why);
        if (!whole) {
            bt_errors_add(err, "%s:%d: is not JSON: %s; correct the file", path, why.line, why.text);
            return BT_ERR_CASE;
        }
        json_decref(features->root);
        free(features->span);
        features->span = NULL;
        features->root = whole;
        features->n = json_array_size(json_object_get(whole, "features"));
    }
    features->listed = json_is_array(json_object_get(features->root, "features"));
    return BT_OK;
}

void bt_features_close(bt_features *features)
{
    json_decref(features->root);
    json_decref(features->parsed);
    void *arrays[] = {features->text, features->span, features->ring, features->lean};
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; k++) free(arrays[k]);
    *features = (bt_features){0};
}
