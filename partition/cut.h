// SPDX-License-Identifier: MIT
// A weighted graph of cells and its cut into parts of equal work: which rank owns which cell.
#ifndef BT_CUT_H
#define BT_CUT_H

#include <stdbool.h>
#include <stdint.h>

/// Kinds of work. Ranks wait for each other in each kind, so its heaviest part decides how long it takes, and the time
/// of all work is the sum of these: Σ over the kinds of the heaviest part.
enum { BT_CUT_KINDS = 2 };

/// Work of each kind.
typedef struct bt_cut_work {
    int64_t of[BT_CUT_KINDS];
} bt_cut_work;

/// Undirected graph in compressed rows: every edge is in the rows of both its ends, with the same weight. Sums of all
/// weights and of all edges must fit into int64_t; loops (an edge from a vertex to itself) are ignored.
typedef struct bt_graph {
    int n;                 ///< vertices (cells)
    const int *start;      ///< [n+1] first neighbour of each vertex
    const int *to;         ///< [start[n]] neighbours
    const int64_t *edge;   ///< [start[n]] >= 0: amount exchanged if the two ends are in different parts (floes)
    const bt_cut_work *weight; ///< [n] >= 0
    const double (*at)[2]; ///< [n] m, position of the vertex
    /// [n] vertices of the same group >= 0 stay together (cells under a large body), −1 = free; NULL = none
    const int *group;
} bt_graph;

typedef enum {
    BT_CUT_NONE,   ///< nothing to decide: one part, or one part per vertex
    BT_CUT_KEPT,   ///< the previous labels, with vertices shifted between neighbouring parts
    BT_CUT_METIS,  ///< METIS, with vertices shifted where it was out of balance
    BT_CUT_BISECT, ///< recursive coordinate bisection, likewise
} bt_cut_method;

typedef struct bt_cut_quality {
    /// Σ over the kinds of the heaviest part / Σ over the kinds of the mean − 1; 0 if all weights are 0
    double imbalance;
    int64_t cut;          ///< weight of the edges between parts
    int n_empty;          ///< parts without a vertex
    int64_t moved;        ///< weight of the vertices whose label changed (without those that had no label)
    bt_cut_method method; ///< method that made it
} bt_cut_quality;

static inline int64_t bt_cut_sum(bt_cut_work load)
{
    int64_t sum = 0;
    for (int k = 0; k < BT_CUT_KINDS; k++) sum += load.of[k];
    return sum;
}

/// Add times × load, times 1 or −1.
static inline void bt_cut_add(bt_cut_work *sum, bt_cut_work load, int times)
{
    for (int k = 0; k < BT_CUT_KINDS; k++) sum->of[k] += times * load.of[k];
}

/// Cut the graph into n_parts >= 1 parts of equal weight of each kind, with little weight on the edges between them and
/// few labels changed.
/// part: in, the previous labels (outside 0 ... n_parts − 1: none); out, the labels. tolerance: acceptable imbalance,
/// e.g. 0.04 (previous labels are kept up to 1.25 times that). A vertex or group heavier than a part's share of every
/// kind gets its own part, and the rest is balanced without it. A part is empty only if there are fewer vertices (a
/// group counts as one) than parts. `quality` may be NULL.
/// Deterministic: the same graph and previous labels give the same labels. Must not be called by two threads at once
/// (METIS). SIGTERM is blocked in the calling thread while METIS runs, and its handler is as before on return. All
/// other threads of the process must block SIGTERM: METIS's handler would crash in them. (Block it before MPI_Init and
/// the first parallel region, whose threads inherit the mask, and unblock it in the main thread afterwards.)
void bt_cut(const bt_graph *graph, int n_parts, double tolerance, int *part, bt_cut_quality *quality);

/// Quality of labels. before: as in bt_cut, NULL = none. method is BT_CUT_NONE.
bt_cut_quality bt_cut_measure(const bt_graph *graph, int n_parts, const int *part, const int *before);

/// Is every label in 0 ... n_parts − 1, every group in one part, and no part empty unless vertices are fewer than
/// parts?
bool bt_cut_is_valid(const bt_graph *graph, int n_parts, const int *part);

// --- methods ---------------------------------------------------------------------------------------------------------

// The methods used by bt_cut. Their graph has no groups: bt_cut has contracted each to one vertex.

/// Cut by METIS, each kind within its part of the tolerance. false if it failed, left a part empty or wrote a label out
/// of range; part is then invalid. n_parts >= 2, graph->n > n_parts, weights not all zero.
bool bt_cut_by_metis(const bt_graph *graph, int n_parts, double tolerance, int *part);

/// Cut by recursive coordinate bisection. graph->n >= n_parts >= 1: no part is empty.
void bt_cut_by_bisection(const bt_graph *graph, int n_parts, int *part);

/// Shift vertices between neighbour parts until no part of more than one vertex weighs more than its share and `slack`
/// in any kind, as far as possible (to parts lighter than their share of that kind); then shift vertices that lower the
/// cut within it. No part becomes empty.
void bt_cut_refine(const bt_graph *graph, int n_parts, bt_cut_work share, int64_t slack, int *part);

#endif
