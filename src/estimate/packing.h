// SPDX-License-Identifier: MIT
// When does the ice that the body packs ahead of itself reach the wall that the tow goes towards?
//
//     wall ───────────────────────────────┐        A    concentration of the ice, which ends at L_i ahead of the bow
//      (often the wall: L_i = L)
//      cleared        ░░░░░░░░░░          │        φ_J  concentration to which it is packed (estimate.phi_j)
//              (body) ░ packed ░   ice    │ wall   b    width of the body across the tow, W width of the domain
//      cleared        ░░░░░░░░░░          │        d    way of the body
//     wall ───────────────────────────────┘
//
// Balance of area, as an estimate: the body clears a track of its own width, ice beside the track stays where it is,
// and what was in the track is packed ahead over the whole width. All that is ahead of the bow is packed when the ice
//     there fills it to φ_J:
//     A L_i W − A (W − b) d = φ_J W (L − d)     =>     d = W (φ_J L − A L_i) / (φ_J W − A (W − b))
// With L_i = L the front of the packed ice goes at V (1 + (b/W) A/(φ_J − A)); across the whole width, b = W, that is V
// φ_J/(φ_J − A). From then on the wall bears what the body pushes, and the resistance is a property of the length of
// the domain. Rejected: V φ_J/(φ_J − A) for any width, 57 s in place of 200 s in cases/basin/basin-80.
#ifndef BT_PACKING_H
#define BT_PACKING_H

#include "bergtow/case.h"

/// Share of the estimated time from which the wall is counted with: in seven fields of cases/basin (80, 65 and 50 %)
/// the last 6 m before the wall were packed at 0.87 to 1.05 of it, 180 to 440 s.
#define BT_PACKING_EARLY 0.87

typedef struct bt_packing {
    double time;    ///< at which the packed ice reaches the wall, s; NaN: no wall ahead, or nothing that is estimated
    double way;     ///< of the body until then, m
    double packed;  ///< φ_J
} bt_packing;

/// concentration: as made, or as the case asks for. A tow along one pair of walls or the other, within 25 degrees; no
/// lead, no way-points.
bt_packing bt_packing_of(const bt_case *input, double concentration);

/// Warn of a run (or window) that ends at `end`, s, after the wall has come into it.
void bt_packing_warn(const bt_packing *packing, double end, bt_errors *warnings);

#endif
