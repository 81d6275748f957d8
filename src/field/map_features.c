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

static char peek(const scan *s) { return s->p && s->p < s->end ? *s->p : '\0'; }

static void skip_space(scan *s)
{
    while (s->p && s->p < s->end && (*s->p == ' ' || *s->p == '\n' || *s->p == '\t' || *s->p == '\r')) s->p++;
}

/// Take the character c, with the space behind it.
static bool take(scan *s, char c)
{
    if (peek(s) != c) return false;
    s->p++;
    skip_space(s);
    return true;
}

static void skip_string(scan *s)
{
    for (s->p++; s->p < s->end && *s->p != '"'; s->p++)
        if (*s->p == '\\') s->p++;
    s->p = s->p < s->end ? s->p + 1 : NULL;
}

/// A value, and the space behind it.
static void skip_value(scan *s)
{
    static const bool marks[UCHAR_MAX + 1] = {['"'] = true, ['['] = true, [']'] = true, ['{'] = true, ['}'] = true};
    int64_t depth = 0;
    const char *begin = s->p;
    do {
        while (depth > 0 && s->p < s->end && !marks[(unsigned char)*s->p]) s->p++; // what most of the text is
        const char c = peek(s);
        if (c == '"') {
            skip_string(s);
            continue;
        }
        if (c == '[' || c == '{') depth++;
        else if (c == ']' || c == '}') depth--;
        else if (depth == 0 && (c == ',' || c == ':' || c == ' ' || c == '\n' || c == '\t' || c == '\r')) break;
        if (depth < 0 || s->p >= s->end) break;
        s->p++;
    } while (s->p && (depth > 0 || (s->p[-1] != ']' && s->p[-1] != '}' && s->p[-1] != '"')));
    if (depth > 0 || s->p == begin) s->p = NULL;
    skip_space(s);
}

/// The next key of an object, up to its value: is it this one, in plain letters? False also when there is no more.
static bool take_key(scan *s, const char *name, bool *is)
{
    if (peek(s) != '"') return false;
    const char *begin = s->p + 1;
    skip_string(s);
    if (!s->p) return false;
    const size_t n = (size_t)(s->p - 1 - begin);
    *is = n == strlen(name) && !memcmp(begin, name, n);
    skip_space(s);
    return take(s, ':');
}

/// In the object that begins here, to the value of a key in plain letters.
static bool find_value(scan *s, const char *name)
{
    bool is;
    if (!take(s, '{')) return false;
    while (take_key(s, name, &is)) {
        if (is) return true;
        skip_value(s);
        if (!take(s, ',')) return false;
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
static bool take_number(scan *s, double *x)
{
    enum { MOST = 63, DIGITS = 15 };
    char copy[MOST + 1];
    const char *p = s->p, *begin = p;
    if (p < s->end && *p == '-') p++;
    const char *digits = p;
    uint64_t w = 0, power = 0;
    p = take_digits(p, s->end, &w);
    ptrdiff_t places = p - digits, behind = 0; // behind the point
    if (places == 0 || (*digits == '0' && places > 1)) return false;
    bool whole = true, exponent = false;
    if (p < s->end && *p == '.') {
        const char *first = p + 1;
        p = take_digits(first, s->end, &w);
        behind = p - first, places += behind;
        if (behind == 0) return false;
        whole = false;
    }
    if (p < s->end && (*p == 'e' || *p == 'E')) {
        p++;
        if (p < s->end && (*p == '+' || *p == '-')) p++;
        const char *first = p;
        p = take_digits(p, s->end, &power);
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
    s->p = p;
    skip_space(s);
    return isfinite(*x);
}

/// [east, north] or [east, north, height, ...].
static bool take_position(scan *s, double v[2])
{
    double more;
    if (!take(s, '[') || !take_number(s, &v[0]) || !take(s, ',') || !take_number(s, &v[1])) return false;
    while (take(s, ','))
        if (!take_number(s, &more)) return false;
    return take(s, ']');
}

static double *next_vertex(bt_features *f)
{
    if (f->n_vertices == f->cap_vertices) {
        f->cap_vertices = f->cap_vertices ? f->cap_vertices + f->cap_vertices / 2 : 1024;
        f->ring = bt_realloc(f->ring, 2 * (size_t)f->cap_vertices, sizeof *f->ring);
    }
    return f->ring + 2 * f->n_vertices++;
}

/// Coordinates of one ring at `depth` lists within lists, the last ones its positions.
static bool take_ring(bt_features *f, scan *s, int depth)
{
    for (int k = 0; k < depth; k++)
        if (!take(s, '[')) return false;
    const int64_t first = f->n_vertices;
    do {
        if (f->n_vertices - first > BT_MOST_RING || !take_position(s, next_vertex(f))) return false;
    } while (take(s, ','));
    for (int k = 0; k < depth; k++)
        if (!take(s, ']')) return false;
    return f->n_vertices - first <= BT_MOST_RING;
}

// --- features --------------------------------------------------------------------------------------------------------

const json_t *bt_features_at(bt_features *f, size_t i)
{
    if (!f->span) return json_array_get(json_object_get(f->root, "features"), i);
    const bt_feature_span *s = &f->span[i];
    const bool cut = s->cut_end > s->cut;
    const size_t before = (cut ? s->cut : s->end) - s->begin, after = cut ? s->end - s->cut_end : 0,
                 n = before + after + (cut ? 4 : 0);
    const char *head = f->text + s->begin, *tail = f->text + s->cut_end;
    // Features of one program differ in their coordinates, and often in nothing else.
    if (f->parsed && n == f->n_lean && !memcmp(f->lean, head, before) &&
        (!cut || (!memcmp(f->lean + before, "null", 4) && !memcmp(f->lean + before + 4, tail, after))))
        return f->parsed;
    if (n > f->cap_lean) f->lean = bt_realloc(f->lean, f->cap_lean = 2 * n, 1);
    f->n_lean = n;
    memcpy(f->lean, head, before);
    if (cut) {
        memcpy(f->lean + before, "null", 4);
        memcpy(f->lean + before + 4, tail, after);
    }
    json_decref(f->parsed);
    f->parsed = json_loadb(f->lean, n, JSON_REJECT_DUPLICATES | JSON_DECODE_ANY, NULL);
    return f->parsed;
}

const double *bt_features_ring(const bt_features *f, size_t i, size_t *n)
{
    if (!f->span || f->span[i].cut == f->span[i].cut_end) return NULL;
    const int64_t first = f->span[i].vertex, end = i + 1 < f->n ? f->span[i + 1].vertex : f->n_vertices;
    *n = (size_t)(end - first);
    return f->ring + 2 * first;
}

/// Take the coordinates out of the last feature if they are those of one ring, as deep as its type says.
static void cut_ring(bt_features *f, bt_feature_span *s)
{
    static const struct { const char *type; int depth; } kinds[] = {{"Polygon", 2}, {"MultiPolygon", 3}};
    for (int k = 0; k < 2; k++) {
        scan c = {f->text + s->begin, f->text + s->end};
        if (!find_value(&c, "geometry") || !find_value(&c, "coordinates")) return;
        const char *begin = c.p;
        f->n_vertices = s->vertex;
        if (!take_ring(f, &c, kinds[k].depth)) continue;
        s->cut = (uint32_t)(begin - f->text);
        s->cut_end = (uint32_t)(c.p - f->text);
        const char *type =
            json_string_value(json_object_get(json_object_get(bt_features_at(f, f->n - 1), "geometry"), "type"));
        if (type && !strcmp(type, kinds[k].type)) return;
        break;
    }
    f->n_vertices = s->vertex;
    s->cut = s->cut_end = 0;
}

/// One feature from here on. False: it is none that the parser takes.
static bool add_feature(bt_features *f, scan *s)
{
    const char *begin = s->p;
    skip_value(s);
    if (!s->p) return false;
    if (f->n == f->cap) f->span = bt_realloc(f->span, f->cap = f->cap ? f->cap + f->cap / 2 : 256, sizeof *f->span);
    bt_feature_span *span = &f->span[f->n++];
    *span = (bt_feature_span){
        .begin = (uint32_t)(begin - f->text), .end = (uint32_t)(s->p - f->text), .vertex = f->n_vertices};
    cut_ring(f, span);
    return bt_features_at(f, f->n - 1) != NULL;
}

/// The list of features, and the rest of the file. False: it is no JSON.
static bool split(bt_features *f)
{
    scan s = {f->text, f->text + f->size};
    skip_space(&s);
    if (!find_value(&s, "features") || !take(&s, '[')) {
        f->root = json_loadb(f->text, f->size, JSON_REJECT_DUPLICATES, NULL);
        f->n = json_array_size(json_object_get(f->root, "features"));
        return f->root != NULL;
    }
    const size_t before = (size_t)(s.p - f->text);
    if (peek(&s) != ']') {
        do {
            if (!add_feature(f, &s)) return false;
        } while (take(&s, ','));
    }
    if (peek(&s) != ']') return false;
    const size_t after = f->size - (size_t)(s.p - f->text);
    char *rest = bt_alloc(before + after, 1);
    memcpy(rest, f->text, before);
    memcpy(rest + before, s.p, after);
    f->root = json_loadb(rest, before + after, JSON_REJECT_DUPLICATES, NULL);
    free(rest);
    return f->root != NULL;
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

bt_status bt_features_open(bt_features *f, const char *path, bt_errors *err)
{
    *f = (bt_features){0};
    bt_status status =
        bt_file_read_to(path, "a GeoJSON file of outlines", BT_MOST_OUTLINE_BYTES, &f->text, &f->size, err);
    if (status != BT_OK) return status;
    const char *other = other_format(f->text, f->size);
    if (other) {
        bt_errors_add(err,
                      "%s: is %s, not GeoJSON; make GeoJSON of it: bergtow outlines %s -o floes.geojson (a field of "
                      "bergtow belongs to ice.field)",
                      path, other, path);
        return BT_ERR_CASE;
    }
    // What a hostile file could make of it is known before: a tree takes far more room than the text.
    int64_t lists = 0;
    const char *c = f->text, *end = f->text + f->size;
    while ((c = memchr(c, '[', (size_t)(end - c)))) c++, lists++;
    if (lists > BT_MOST_LISTS) {
        bt_errors_add(err,
                      "%s: holds %" PRId64
                      " lists (vertices), at most %d are read; simplify the outlines, or cut them into several files",
                      path, lists, BT_MOST_LISTS);
        return BT_ERR_CASE;
    }
    json_error_t why;
    if (!split(f)) {
        json_t *whole = json_loadb(f->text, f->size, JSON_REJECT_DUPLICATES, &why);
        if (!whole) {
            bt_errors_add(err, "%s:%d: is not JSON: %s; mend the file", path, why.line, why.text);
            return BT_ERR_CASE;
        }
        json_decref(f->root);
        free(f->span);
        f->span = NULL;
        f->root = whole;
        f->n = json_array_size(json_object_get(whole, "features"));
    }
    f->listed = json_is_array(json_object_get(f->root, "features"));
    return BT_OK;
}

void bt_features_close(bt_features *f)
{
    json_decref(f->root);
    json_decref(f->parsed);
    void *arrays[] = {f->text, f->span, f->ring, f->lean};
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; k++) free(arrays[k]);
    *f = (bt_features){0};
}
