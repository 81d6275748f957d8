// SPDX-License-Identifier: MIT
// The constants of a time step.
#ifndef BERGTOW_PARAMS_H
#define BERGTOW_PARAMS_H

#include "bergtow/base.h"

BT_BEGIN_C

/// Largest numbers: of contact laws, the program's own included; of added ones (contact.h); of parameters `own` of one
/// law; of numbers of one added law; of numbers of all the program's own laws together.
enum {
    BT_MAX_LAWS = 8, BT_MAX_ADDED_LAWS = 3, BT_MAX_CONTACT_OWN = 8, BT_MAX_CONTACT_NUMBERS = 4, BT_MAX_LAW_NUMBERS = 12
};

/// Constants of the step.
typedef struct bt_params {
    double dt;             ///< Δt, s
    double x0, y0;         ///< low corner of the domain, m
    double period_x, period_y; ///< length of the periodic directions, m; 0 = not periodic
    double tolerance;      ///< natural-map residual at which the sweeps stop, m/s
    /// limit of the work of a step, in units of 6 updates of every contact; with plain_sweeps, in sweeps
    int64_t max_sweeps;
    bool warm_start;
    bool plain_sweeps;     ///< sweeps over all contacts, without momentum (reference)
    bool plain_schedule;   ///< passes over the cells by one thread (reference)
    int64_t inner_sweeps;  ///< sweeps of a cell before the next cell
    double cell;           ///< least side of a cell in mean floe diameters, 0 = the default
    double slop;           ///< overlap left alone, m
    int64_t position_sweeps; ///< limit of the position projection: updates of every contact; with plain_sweeps, sweeps
    double rest_speed;     ///< approach below this has no restitution, m/s
    double size;           ///< mean floe diameter, sets cells and skin, m
    double law_own[BT_MAX_LAWS][BT_MAX_CONTACT_OWN]; ///< parameters of each contact law; see there for units
    int added_laws;        ///< number of added contact laws (contact.h) that act here: the first ones
    // fluid and frame (see forces.h)
    double water_u, water_v, air_u, air_v; ///< of the present step (environment.h), m/s
    double coriolis;       ///< dU/dt = coriolis × (−Uy, Ux), rad/s: +f in the geographic frame, −f in the basin's
    double balance_u, balance_v; ///< velocity in geostrophic balance with the tilt (Coriolis acts on U minus this), m/s
    double tilt_ax, tilt_ay;     ///< −g ∇η beyond that balance, m/s²
    bool tilt_moves_water;       ///< that is dU_w/dt (tilt: dynamic), which also acts on the added mass
    // reduction of drag by other floes (src/force/exposure.h)
    double lee;            ///< λ, length of the lee of an edge / its height, 0 = no edge is sheltered
    double draft;          ///< of ice / its thickness, ρ_i/ρ_w
    double lee_reach;      ///< largest reach of any lee, m
    bool covers;           ///< sheets that lie on each other share their skin drag
    double exposure_slow;  ///< floes with slower flow past them, m/s, are evaluated less often
    int64_t exposure_steps; ///< steps between evaluations, 0 = never: all bodies have their whole drag
} bt_params;

BT_END_C

#endif
