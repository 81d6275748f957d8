// SPDX-License-Identifier: MIT
// When does the ice that the body packs ahead of itself reach the wall that the tow goes towards?
//
//     wall ───────────────────────────────┐        A    concentration of the ice, which ends at L_i ahead of the bow
//      cleared        ░░░░░░░░░░          │        L    distance of the wall ahead of the bow; often L_i = L
//              (body) ░ packed ░   ice    │ wall   φ_J  concentration to which the ice is packed (estimate.phi_j)
//      cleared        ░░░░░░░░░░          │        b    width of the body across the tow, W width of the domain
//     wall ───────────────────────────────┘        d    distance covered by the body
//
// Area balance, as an estimate: the body clears a track of its own width, the ice beside the track stays in place, and
// the ice of the track is packed ahead over the whole width. All the water ahead of the bow is packed when the ice
// there fills it to φ_J:
//     A L_i W − A (W − b) d = φ_J W (L − d)     =>     d = W (φ_J L − A L_i) / (φ_J W − A (W − b))
// With L_i = L the front of the packed ice advances at V (1 + (b/W) A/(φ_J − A)); across the whole width, b = W, that
// is V φ_J/(φ_J − A). From then on the wall supports the ice that the body pushes, and the resistance depends on the
// length of the domain. Rejected: V φ_J/(φ_J − A) for any width, 57 s instead of 200 s in cases/basin/basin-80.
#ifndef BT_PACKING_H
#define BT_PACKING_H

#include "bergtow/case.h"

/// Share of the estimated time from which the wall may count: in seven fields of cases/basin (80, 65 and 50 %) the last
/// 6 m before the wall were packed at 0.87 to 1.05 of that time, 180 to 440 s.
#define BT_PACKING_EARLY 0.87

typedef struct bt_packing {
    double time;    ///< at which the packed ice reaches the wall, s; NaN: no wall ahead, or no estimate
    double way;     ///< of the body until then, m
    double packed;  ///< φ_J
} bt_packing;

/// concentration: as generated, or as asked for. Only for tows within 25 degrees of an axis of the domain, without a
/// lead and way-points.
bt_packing bt_packing_of(const bt_case *input, double concentration);

/// Warn if a run (or window) ends, at `end`, s, after the packed ice may have reached the wall.
void bt_packing_warn(const bt_packing *packing, double end, bt_errors *warnings);

#endif
