// SPDX-License-Identifier: MIT
// Tow lines by their common names: stiffness, mass and breaking load from the nominal diameter.
//
// d in m; EA and breaking load (MBL) in N, mass in kg/m. New, dry, spliced without loss; a used line has less: say so
// where it matters.
//   steel-wire     6×19 with wire core:   mass 3990 d²,  EA 4.04e10 d²,  MBL 6.334e8 d²              [1]
//   polypropylene  8-strand multiplait:   mass 452.6 d², EA 1.06e9 d²,   MBL 1.060e8 d²              [1]
//   dyneema        HMPE:                  mass 496 d²,   EA 56 MBL,      MBL 5.80e8 d² + 6.51e8 d³   [2]
// [1] Orcina, OrcaFlex manual, Rope/Wire. [2] MoorPy, property library, NREL.
#ifndef BT_ROPE_H
#define BT_ROPE_H

#include "bergtow/case.h"

typedef struct bt_rope {
    const char *name, *source;
    double mass;      ///< kg/m
    double stiffness; ///< EA, N
    double breaking;  ///< N
} bt_rope;

/// Data of a named line; zeros for type numbers (nothing is named).
bt_rope bt_rope_named(bt_rope_type type, double diameter);

#endif
