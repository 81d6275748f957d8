// SPDX-License-Identifier: MIT
// The features of a GeoJSON text, one at a time: map_features.h.
#include "field/map_features.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "base/fileio.h"
#include "base/largest.h"

/// The rest of a text.
typedef struct scan { const char *p, *end; } scan;

static void skip_space(scan *at)
{
    while (at->p < at->end && (*at->p == ' ' || *at->p == '\n' || *at->p == '\t' || *at->p == '\r')) at->p++;
}

/// Take the character c and the space before it.
static bool take(scan *at, char c)
{
    skip_space(at);
    if (at->p == at->end || *at->p != c) return false;
    at->p++;
    return true;
}

/// The value that begins here, whatever follows it; NULL: it is not JSON.
static json_t *take_value(scan *at)
{
    json_error_t where;
    json_t *value = json_loadb(at->p, (size_t)(at->end - at->p),
                               JSON_REJECT_DUPLICATES | JSON_DECODE_ANY | JSON_DISABLE_EOF_CHECK, &where);
    at->p += value ? where.position : 0;
    return value;
}

/// Visit the elements of a list, from after its '['.
static bool take_features(scan *at, bt_feature_visit *visit, void *context, size_t *n)
{
    if (take(at, ']')) return true;
    do {
        json_t *feature = take_value(at);
        if (!feature) return false;
        visit(context, (*n)++, feature);
        json_decref(feature);
    } while (take(at, ','));
    return take(at, ']');
}

/// Read the next member of the file into root.
static bool take_member(scan *at, json_t *root, bt_feature_visit *visit, void *context, size_t *n)
{
    json_t *key = take_value(at), *value = NULL;
    const char *name = json_string_value(key);
    if (name && take(at, ':') && !json_object_get(root, name)) {
        if (strcmp(name, "features") != 0 || !take(at, '[')) value = take_value(at);
        else if (take_features(at, visit, context, n)) value = json_array();
    }
    const bool taken = value && json_object_set_new(root, name, value) == 0;
    json_decref(key);
    return taken;
}

/// Read the file; NULL if it is not a JSON object.
static json_t *take_file(scan at, bt_feature_visit *visit, void *context, size_t *n)
{
    if (!take(&at, '{')) return NULL;
    json_t *root = json_object();
    bool taken = take(&at, '}');
    if (!taken) {
        do taken = take_member(&at, root, visit, context, n);
        while (taken && take(&at, ','));
        taken = taken && take(&at, '}');
    }
    skip_space(&at);
    if (taken && at.p == at.end) return root;
    json_decref(root);
    return NULL;
}

/// Name of another format than JSON, recognised by its first bytes, or NULL.
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

/// Refuse a text that is not JSON or too large, before it is parsed.
static bt_status refuse_text(const char *path, const char *text, size_t size, bt_errors *err)
{
    const char *other = other_format(text, size);
    if (other)
        return bt_fail(err, BT_ERR_CASE,
                       "%s: is %s, not GeoJSON; convert it to GeoJSON: bergtow outlines %s -o floes.geojson (a field "
                       "of bergtow belongs to ice.field)",
                       path, other, path);
    // Limit the tree of a hostile file before parsing it: a tree takes far more room than the text.
    int64_t lists = 0;
    const char *c = text, *end = text + size;
    while ((c = memchr(c, '[', (size_t)(end - c)))) c++, lists++;
    if (lists <= BT_MAX_LISTS) return BT_OK;
    return bt_fail(err, BT_ERR_CASE, "%s: holds %" PRId64
                   " lists (vertices), more than the limit of %d; simplify the outlines, or cut them into several "
                   "files",
                   path, lists, BT_MAX_LISTS);
}

bt_status bt_features_read(const char *path, bt_feature_visit *visit, void *context, json_t **root, size_t *n,
                           bt_errors *err)
{
    char *text = NULL;
    size_t size;
    *root = NULL, *n = 0;
    bt_status status = bt_file_read_to(path, "a GeoJSON file of outlines", BT_MAX_OUTLINE_BYTES, &text, &size, err);
    if (status == BT_OK) status = refuse_text(path, text, size, err);
    if (status == BT_OK) {
        json_error_t why;
        *root = take_file((scan){text, text + size}, visit, context, n);
        if (!*root) *root = json_loadb(text, size, JSON_REJECT_DUPLICATES, &why); // another value, or the error
        if (!*root)
            status = bt_fail(err, BT_ERR_CASE, "%s:%d: is not JSON: %s; correct the file", path, why.line, why.text);
    }
    free(text);
    return status;
}
