// SPDX-License-Identifier: MIT
// Anderson acceleration of a fixed-point iteration x ← g(x) (private to the solver).
#ifndef BERGTOW_ANDERSON_H
#define BERGTOW_ANDERSON_H

#include "bergtow/base.h"

#define BT_ANDERSON_DEPTH 4 // 6 to 16 need fewer sweeps on smooth problems, but stall on sticking and slipping heavy chains

typedef struct bt_anderson {
    size_t n, cap;
    int depth, head;           ///< columns in use, next to be replaced
    int rest, next_rest;       ///< plain iterations left now, and after the next drop
    int stalled, long_rest;    ///< iterations since |f| was halved, plain iterations when that takes too long
    double mark;               ///< |f|² at the last halving
    bool started;              ///< f_before, g_before are valid
    double best;               ///< least |f|² since the start
    double *g, *f;             ///< [n] caller fills: g(x_k) and f = g(x_k) − x_k, scaled to one unit
    double *g_before, *f_before, *move, *best_g;
    double *dg[BT_ANDERSON_DEPTH], *df[BT_ANDERSON_DEPTH];
    double largest_df[BT_ANDERSON_DEPTH];
    double gram[BT_ANDERSON_DEPTH][BT_ANDERSON_DEPTH];
} bt_anderson;

/// Start a new iteration of n unknowns; g and f are ready to be filled.
void bt_anderson_start(bt_anderson *a, size_t n);

/// From f and g of this iteration: move[n], to be added to g(x_k) for x_{k+1}. Returns false when x_{k+1} = g(x_k).
bool bt_anderson_advance(bt_anderson *a);

void bt_anderson_free(bt_anderson *a);

#endif
