// SPDX-License-Identifier: MIT
// Published and derived estimates of the resistance that broken ice adds to a tow, and the drag of open water.
//
// A concentration, h thickness m, W width of the body across the tow m, V speed of the body through the ice m/s, d the
// tow direction, ρ_i and ρ_w densities of ice and water kg/m³, P = P* h exp(−20 (1 − A)) strength of the ice N/m
// [Hibler 1979's form].
//
//   Lichey–Hellmer   0 for A <= 0.15;  ½ ρ_i C_si h W |ΔV| ΔV·d for 0.15 < A < 0.9, and for A >= 0.9 while P < P_s;
//                    for A >= 0.9 and P >= P_s the ice captures the body: its resistance is then limited by P W
//                    [Lichey & Hellmer 2001, J. Glaciol. 47, with P* = 20 kN/m², P_s = 13 kN/m; FESOM2's iceberg code]
//   Three closures of "F × 1 m = work spent on opening 1 m of channel" [Marchenko et al. 2010 as quoted by Yulmetov &
//   Løset 2017; their formula is not available, so each of these is ours and has a name]:
//     compaction     F = P W                              the strip is pressed against ice of strength P
//     rafting        F = κ ½ ρ_i (1 − ρ_i/ρ_w) g h² A W    the ice of the strip is pushed onto or under other ice; κ:
//                                                         twice the work over the potential energy that is
//                                                         gained (contact/raft.h), with a range
//     momentum       F = ρ_i h W V² A φ/(φ − A)           the ice of the strip is swept together to φ, with the front
//                                                         at V φ/(φ − A)
//   dilute limit     F = (4/3)(1 + e) A ρ_i h (R + r) V²   resting disc-like floes of radius r, each met once by
//                                                         a heavy disc, R = W/2, without friction and drag (derived;
//                                                         tests/physics/test_resistance.c)
//   ships in pack    F = ½ k Fr_p^b ρ_i W h V² A^n,  Fr_p = V/√(g h A): a regression of ship resistance in pack ice
//                    over the pack-ice Froude number [Colbourne 2000: the form; not at hand]. Hulls: blunt k 16.1,
//                    b −1.7937, n 3; slender k 4.4, b −0.8267, n 2, as in PolarRoute, the route planner of the British
//                    Antarctic Survey (class SDA, ice_resistance; antarctica/PolarRoute, 2022). A berg is taken as
//                    blunt, the range goes to slender. The source gives no range of A, h, V or floe size; the numbers
//                    are of ships: for any other body the note says extrapolated
//   open water       F = (½ ρ_w C_w draft b + ρ_w C_ws A_wl) |ΔV| ΔV·d   the drag that src/force/forces.c computes; no
//                    ice resistance
//
// ΔV of a run is measured: the mean over its window of the velocity of the body relative to undisturbed ice, the mean
// floe in free drift (series speed_through_ice, leeway_through_ice); for open water relative to the water. So it
// includes a vessel that cannot hold its speed, and wind that drives the ice. Before a run ΔV is the ordered velocity:
// V_tow − U, where U of the water is its mean over the run, and of the ice its free drift at the start, or that of the
// water if wind or current change (bt_estimate_ordered). The course, and the width of the body across it, are those of
// the window, before a run those of the first leg; the ordered speed is the mean of the programme over the window,
// before a run the largest.
//
// Left out. The other known regression, R = a ρ_i W h V² A^1.5 / Fr^b [Huang et al. 2021], has constants of one ship
// and its floes, found only in a third-party source, without range. It is left out until the paper is available.
//
// A run is compared with estimates that depend on the concentration, within their range: any other ratio would
// characterise the estimate and not the run (bt_estimate.compares). Nor is a run in a channel compared: A is that of
// the ice before its floes were removed, which the body does not meet.
#ifndef BERGTOW_ESTIMATE_H
#define BERGTOW_ESTIMATE_H

#include "bergtow/case.h"
#include "bergtow/field.h"

BT_BEGIN_C

/// The program's own estimates; registered ones follow.
typedef enum {
    BT_EST_LICHEY_HELLMER,
    BT_EST_COMPACTION,
    BT_EST_RAFTING,
    BT_EST_MOMENTUM,
    BT_EST_DILUTE,
    BT_EST_SHIPS,
    BT_EST_OPEN_WATER,
    BT_N_OWN_ESTIMATES
} bt_estimate_kind;
enum { BT_MAX_ESTIMATES = 24 };

#define BT_EST_LOOSE 0.15      ///< A up to which Lichey & Hellmer have no force
#define BT_EST_DENSE 0.9       ///< A from which ice may capture a berg
#define BT_EST_STRENGTH 20.0   ///< exponent of the strength [Hibler 1979]
/// A below which ice has room to give way and is neither compacted nor rafted, assumed
#define BT_EST_COMPACT 0.65
/// φ − A up to which the ice counts as swept together: a field made for 0.9 may have 0.9 − 1e-16
#define BT_EST_SWEPT 1e-9
/// ΔV·d / ordered below which the body nearly stands still, and estimates that depend on the speed are useless, assumed
#define BT_EST_STILL 0.05
#define BT_EST_DILUTE_MOST 0.25 ///< A above which floes hit each other before the body has passed, assumed

/// Conditions of the estimates, at the scale of the case.
typedef struct bt_estimate_input {
    double concentration;    ///< A
    double thickness;        ///< h, weighted with area, m
    double floe_radius;      ///< r, weighted with area, m
    double width;            ///< W, m
    double speed, along;     ///< |ΔV| and ΔV·d through the ice, m/s; NaN: no tow
    double water_speed, water_along; ///< the same through the water
    double ordered;          ///< ΔV·d if the body kept the ordered speed, m/s; NaN: no tow
    bool turns;              ///< the course changes within the window of the run: no comparison with estimates
    /// the ordered speed changes within the window: no comparison with estimates that depend on it, since their mean is
    /// not the value at the mean speed
    bool changes_speed;
    double restitution;      ///< e, ice on body
    bool ship;               ///< the body is a ship
    double ice_density, water_density; ///< kg/m³
    double drag;             ///< ½ ρ_w C_w draft b + ρ_w C_ws A_wl, kg/m
    double p_star, p_s;      ///< Pa, N/m: divided by the length scale and its square
    double c_si, kappa, kappa_low, kappa_high, phi_j;
    double length_scale;     ///< by which P* and P_s were divided
    bool channel;            ///< a lead without floes ahead of the body (lead.mode): no comparison with estimates
} bt_estimate_input;

/// One estimate.
typedef struct bt_estimate {
    double force;     ///< N against the tow; NaN: the formula has no value here
    double low, high; ///< N, its range; equal to force if there is none
    bool valid;       ///< the formula is meant for these conditions
    /// valid, and it depends on the concentration: a run is compared with it. Not in a channel, nor, if the force
    /// depends on the speed, where the body nearly stands still or its ordered speed changes
    bool compares;
    const char *note; ///< regime, or why it is not valid; static
} bt_estimate;

/// Definition of an estimate.
typedef struct bt_estimate_def {
    const char *name;    ///< key in summary.json
    const char *label;   ///< as printed, and in legends
    const char *formula, *source;
    /// The force at conditions in which a body moves ahead through ice (any if `on_top`); the caller sets `compares`.
    bt_estimate (*at)(const bt_estimate_input *in);
    bool (*knows)(const bt_estimate_input *in); ///< does the formula depend on the concentration here? NULL = it does
    bool on_top;         ///< not a resistance of ice: it comes on top, and no run is compared with it
    bool any_course;     ///< the formula is also valid for a body pushed backwards through the ice
    bool note_tells;     ///< the note itself explains why it is not valid
} bt_estimate_def;

/// Add an estimate before any run begins. It is copied; its texts must outlive every run. From then on it is in the
/// summary, with its curve over the concentration, in `bergtow estimate`, ensembles, pictures and reports. How to:
/// docs/how-to-add-an-estimate.md.
/// Errors: BT_ERR_USAGE, with the reason in err.
bt_status bt_estimate_register(const bt_estimate_def *def, bt_errors *err);

/// Number of estimates: the program's own, then the registered ones.
int bt_n_estimates(void);
/// The k-th estimate, from 0.
const bt_estimate_def *bt_estimate_of(int k);

/// Strength of the ice P, N/m.
double bt_estimate_strength(const bt_estimate_input *in);

/// Resistance of a ship in pack ice, N, by the regression above, from slender to blunt; beam and thickness in m, speed
/// through the ice in m/s.
bt_estimate bt_estimate_ship(double beam, double thickness, double concentration, double speed, double ice_density);

/// One estimate at the given conditions.
bt_estimate bt_estimate_at(int kind, const bt_estimate_input *in);

/// The conditions of a case: ice as specified by its keys, P* and P_s divided by the length scale and its square.
/// Without towed body, or tow, the speeds are NaN; otherwise as ordered, with ice that drifts with the water. The case
/// must have been checked (bt_case_finish).
void bt_estimate_conditions(const bt_case *input, bt_estimate_input *in);

/// The same with ice that drifts at ice[2], m/s; NaN: with the water.
void bt_estimate_ordered(const bt_case *input, const double ice[2], bt_estimate_input *in);

/// Area-weighted means of a field: thickness and equivalent radius of the floes, m. 0 without floes.
void bt_estimate_field(const bt_field *field, double *thickness, double *radius);

BT_END_C

#endif
