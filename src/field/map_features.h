// SPDX-License-Identifier: MIT
// The features of a GeoJSON text, one at a time (private to the reader of outlines).
//
// In a tree of the whole file a vertex takes 200 bytes, a floe 3 kB. So each feature, and each other member of the
// file, is parsed separately: jansson tells where a value ends if other text follows. A file refused in this way is
// parsed again as a whole, for the text and line of the error.
//
// Rejected: yajl, the streaming parser in Debian, a second JSON library with different error messages; a scan for
// brackets with our own reader of numbers, which is faster but takes 250 lines more.
#ifndef BT_MAP_FEATURES_H
#define BT_MAP_FEATURES_H

#include <jansson.h>

#include "bergtow/base.h"

/// Called with feature `index`, which is released after the call.
typedef void bt_feature_visit(void *context, size_t index, const json_t *feature);

/// Visit the elements of the list `features` of a file, *n of them; *root: the file with this list empty, to be
/// released by json_decref. Errors name file and line; then *root is NULL.
bt_status bt_features_read(const char *path, bt_feature_visit *visit, void *context, json_t **root, size_t *n,
                           bt_errors *err);

#endif
