// SPDX-License-Identifier: MIT
// Numbers that follow from a case once its keys have values; more of them are in bergtow/case.h.
#ifndef BT_CASE_DERIVED_H
#define BT_CASE_DERIVED_H

#include "bergtow/case.h"
#include "bergtow/shape.h"

// --- shapes of the body ----------------------------------------------------------------------------------------------

// Names of the towed body's waterlines in the order of bt_body_shape, followed by those that a program adds.

enum { BT_OWN_SHAPES = BT_BODY_ABSENT + 1 };

extern const char *bt_body_shapes[BT_OWN_SHAPES + BT_MAX_ADDED_SHAPES + 1]; ///< ends with NULL

/// Corners v [n][2] of an outline with its centroid at the origin. Returns n; 0 if there is no such outline, with the
/// fault in *why (why may be NULL).
int bt_case_outline(bt_body_shape shape, double length, double width, int n, const double *vertices, double *v,
                    const char **why);

/// The same for a floe given by hand, which need not be convex if it can be cut into convex parts.
int bt_case_floe_admit(const bt_floe_def *floe, double *v, const char **why);

/// Length of the body, m: body.length, or for a polygon its extent in the direction at this angle from x.
double bt_case_body_length(const bt_case *input, double angle);

#define BT_GRAVITY 9.81 ///< m/s²

/// Is the ice read from a file rather than made?
static inline bool bt_case_reads_field(const bt_case *input) { return input->ice.field || input->ice.outlines; }

/// Is ice made? Also if its concentration is not known yet.
static inline bool bt_case_makes_ice(const bt_case *input)
{
    return !bt_case_reads_field(input) && input->ice.concentration != 0;
}

/// Does the ice depend on ice.seed? Ice that is read does if outlines without a thickness draw one.
bool bt_case_ice_is_random(const bt_case *input);

/// Is this a key for making ice, without effect because the case reads its ice?
bool bt_case_key_is_idle(const bt_case *input, const char *key);

/// The ice region in x and y; for a field file, which has its own, the whole domain.
void bt_case_ice_region(const bt_case *input, double low[2], double high[2]);

/// Area of the ice that is made, m²: concentration × (ice region less body and floes given by hand); 0 without a
/// generator.
double bt_case_made_area(const bt_case *input);

/// Means over floes.
typedef struct bt_floe_means {
    double size, thickness, volume; ///< equivalent diameter, m; m; m³
} bt_floe_means;

/// Means over the floes given by hand that can move; all 0 if there are none. A quay or a shore is no floe.
bt_floe_means bt_case_hand_means(const bt_case *input);

/// Number of the floes given by hand that can move and are not convex.
int64_t bt_case_nonconvex_by_hand(const bt_case *input);

/// Area of the floes given by hand, m².
double bt_case_area_by_hand(const bt_case *input);

/// E[d^k] of the diameters that the size law draws, m^k; NaN if its keys leave none.
double bt_case_size_moment(const bt_case *input, int k);

/// Mean diameter of the floes, m: that of the size law, or ice.size for ice that is read.
double bt_case_mean_size(const bt_case *input);

/// Expected number of floes in the ice region: concentration × area / mean floe area; 0 without a generator.
double bt_case_expected_floes(const bt_case *input);

/// The case whose ice region is the extent (ice.extent) of this one: the field is made for it, then cut to the ice
/// region. Along an axis where the two differ, the extent is also the domain; its boundaries keep their kind, periodic
/// images included, if the ice region fills its domain there, and are walls otherwise. Owns no memory.
bt_case bt_case_of_extent(const bt_case *input);

/// Is the ice cut from a larger extent?
bool bt_case_cuts_ice(const bt_case *input);

/// The shorter period of the domain, m; INFINITY without one.
double bt_case_period(const bt_case *input);

/// Number of floes that are made, those beyond the ice region included.
double bt_case_floes_made(const bt_case *input);

/// Largest speed that the current (or wind) of a case can have, m/s.
double bt_case_fastest_flow(const bt_case *input, bool water);

#endif
