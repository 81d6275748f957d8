// SPDX-License-Identifier: MIT
// The features of a GeoJSON text, one at a time (private to the reader of outlines).
//
// As a tree of the whole file a vertex takes 200 bytes, a floe 3 kB and 27 µs. So the text alone is kept: a scan over
// its brackets and strings finds where each feature begins and ends; each is parsed for itself, and the rest of the
// file with an empty list of features. The ring of a Polygon of one ring, nine tenths of the text, is read straight
// into numbers and parsed as null in its place; where it stands otherwise, it is left to the parser. Every byte but
// that of such a ring passes the parser, so what is no JSON is found; then the whole is parsed for the words and the
// line of its fault.
//
// Rejected: yajl, the streaming parser that Debian has, a second JSON library with words of its own for what is wrong;
// jansson reads several texts of a stream, but no elements of one array.
#ifndef BT_MAP_FEATURES_H
#define BT_MAP_FEATURES_H

#include <jansson.h>
#include <stdint.h>

#include "bergtow/base.h"

/// Where a feature stands in the text; BT_MOST_OUTLINE_BYTES fit.
typedef struct bt_feature_span {
    uint32_t begin, end;
    uint32_t cut, cut_end; ///< of its coordinates, which were read; equal: they are left to the parser
    int64_t vertex;        ///< its first in `ring`
} bt_feature_span;

typedef struct bt_features {
    char *text;
    size_t size;
    /// the file with an empty list of features, or all of it when they are not found under their plain name
    json_t *root;
    size_t n;              ///< features
    bool listed;           ///< there is a list of them
    bt_feature_span *span; ///< [n], or NULL: they are in the root
    size_t cap;
    double *ring;          ///< [n_vertices][2] coordinates as they stand there
    int64_t n_vertices, cap_vertices;
    char *lean;            ///< the feature parsed last, without its coordinates
    size_t n_lean, cap_lean;
    json_t *parsed;        ///< from it
} bt_features;

/// Errors name file and line. To be closed in any case.
bt_status bt_features_open(bt_features *features, const char *path, bt_errors *err);
void bt_features_close(bt_features *features);

/// Feature i, until the next call; null for coordinates in its place where bt_features_ring has them.
const json_t *bt_features_at(bt_features *features, size_t i);

/// The ring [*n][2] of feature i, which is a Polygon, or a MultiPolygon of one, without holes; NULL: see its
/// coordinates.
const double *bt_features_ring(const bt_features *features, size_t i, size_t *n);

#endif
