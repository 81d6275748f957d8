// SPDX-License-Identifier: MIT
// Contacts of several parts of one floe, or of several pieces of a shore, at one place become one.
#ifndef BT_MERGE_H
#define BT_MERGE_H

#include "contact/contacts.h"

/// Of the manifolds man [n], in the order of gids and parts, those of bodies that are not convex and of shores: points
/// that another part of the same pair of bodies, or another piece of a shore with the same body, has as well are taken
/// out. What has no point left has n_points = 0.
void bt_merge_parts(const bt_world *w, bt_manifold *man, size_t n);

#endif
