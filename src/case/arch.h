// SPDX-License-Identifier: MIT
// Can walls or periodic images beside the body carry arches of floes, so that the load is a property of the domain's
// width? And does anything bound such a load?
//
//     wall ─────────────────────────      Dense floes wedge between the body and a support at the sides: a wall,
//        \ \ \   arch                     or the next image of the body in a periodic domain. The load of an arch
//          ( body ) ──>                   of rigid floes is bounded only by what the tow gives; the wider the
//        / / /   arch                     domain, the rarer arches are. Floes that raft or crush bound the load.
//     wall ─────────────────────────
//
// The limits are assumed, after trials with friction 0.05 to 0.35. In the basin, from 5 to 20 body widths, the mean
// load of rigid floes does not change at 20 %, falls by a quarter at 50 % and to a sixth at 80 %; that of floes that
// raft falls by a tenth at 50 % and to less than half at 80 %. At full scale with rafting, from 31 to 62 body widths,
// it does not change at 80 %, and falls by a third at 90 % and by half at 95 %.
//
// Dense ice locks once it has given up a share δ of its area. The area that a body of width b displaces on its way s is
// given up by a disc of moved ice about the body, of radius Y,
//     π Y² δ = b s,   δ = 0.0102 (0.0086 to 0.0118) at 90 %, 0.0031 at 95 % (cases/studies/README.md)
// Once 2 Y is the width of the domain, the discs of neighbouring images meet, and the load rises. So a longer tow needs
// a wider domain: 2 Y/b = 2 √(s/(π δ b)) body widths. With δ = 0.0095 and 0.003, on the safe side, that is 54 at 90 %
// and 96 at 95 % for 1.7 km of an 80 m berg.
#ifndef BT_ARCH_H
#define BT_ARCH_H

#include "bergtow/case.h"

#define BT_MADE_OFF 1e-9 ///< rounding: how far a concentration as made may be below the key's
#define BT_ARCH_LOCKING 60 ///< body widths needed by ice that locks as the body displaces it
#define BT_BOUND_CONCENTRATION 0.75 ///< from here on rigid ice counts as ice whose load has no upper bound, assumed

/// Least cosine between a tow and an axis of the domain at which the tow counts as along that axis: the boundaries at
/// the ends of the axis then lie ahead and astern, the others beside it. On an oblique course all four lie beside it,
/// and the pair that is narrower for its ice counts; with way-points, on the leg where it is narrowest.
#define BT_ARCH_ALONG 0.9

/// Open water beside the ice, in mean floe sizes, that causes no warning yet, assumed.
#define BT_ARCH_WATER 2

typedef struct bt_arch {
    const char *key;      ///< "domain.width", or "domain.length" if the tow goes along y
    double concentration; ///< as given
    double bodies;        ///< that extent in widths of the body across the tow; NaN without a body
    double floes;         ///< the same in mean floe sizes; NaN without floes
    double needed;        ///< body widths at which the domain is not expected to show; NaN if nothing holds the ice at
                          ///< the sides, or it is too loose to matter
    const char *region;   ///< keys that bound the ice across the tow
    double water;         ///< open water beside the ice across the tow, m; 0 = too little for a warning
    double gap;           ///< open water between repeated stretches of ice in a moving window, m; likewise
    bool beside;          ///< there is a body, with ice beside it
    bool possible;        ///< arches can reach from the body to the walls or to the next image of it
    bool rigid;           ///< floes neither raft nor crush
    bool splits;          ///< floes split
    bool mapped;          ///< the ice is of outlines, which a larger region does not extend
    bool unbounded;       ///< rigid and dense, around a towed body: no upper bound of its load
    const char *sides;    ///< "walls", "periodic images", "open sides" or "open ends"
} bt_arch;

/// concentration, and mean floe size in m (0 without floes): of the ice as made, or as the case asks for.
bt_arch bt_arch_of(const bt_case *input, double concentration, double floe_size);

/// "rigid floes" or "floes": what the arches consist of.
const char *bt_arch_floes(const bt_arch *arch);

/// Warn of a width that affects the answer, of ice that ends beside the tow or leaves a gap in a moving window, and of
/// a load without an upper bound.
void bt_arch_warn(const bt_arch *arch, bt_errors *warnings);

#endif
