// SPDX-License-Identifier: MIT
// The steps that bt_cut is made of. They see a graph without groups: bt_cut has contracted each to one vertex.
#ifndef BT_CUT_METHOD_H
#define BT_CUT_METHOD_H

#include "partition/cut.h"

/// Cut by METIS. false: it failed, left a part empty or wrote a label out of range; part then holds nothing of use.
/// n_parts >= 2, g->n > n_parts, weights not all zero.
bool bt_cut_by_metis(const bt_graph *g, int n_parts, double tolerance, int *part);

/// Cut by recursive coordinate bisection. g->n >= n_parts >= 1: no part is empty.
void bt_cut_by_bisection(const bt_graph *g, int n_parts, int *part);

/// Shift vertices between neighbour parts until no part of more than one vertex weighs more than limit, as far as that
/// can be done (parts lighter than share take them); then shift those that lower the cut within the limit. No part
/// becomes empty.
void bt_cut_refine(const bt_graph *g, int n_parts, int64_t share, int64_t limit, int *part);

#endif
