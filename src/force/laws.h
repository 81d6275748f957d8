// SPDX-License-Identifier: MIT
// The force laws of the program; equations in bergtow/forces.h, how to add one in docs/how-to-add-a-force-law.md.
//
// Entries and functions stand in a header, so that the prediction, which calls every law for every body, has them
// inline: called through the table they made a step in 20 % ice and wind 8 % longer in instructions, 2 % in 80 % ice.
// Less frequent users take a law from the table (table.c), which is made from the same list.
#ifndef BERGTOW_LAWS_H
#define BERGTOW_LAWS_H

#include "bergtow/forces.h"

// --- drag ------------------------------------------------------------------------------------------------------------

static inline void bt_add_water_drag(const bt_force_body *body, bt_load *load)
{
    bt_load_stream(load, body->par->water_u, body->par->water_v, body->drag->water_skin * body->exposure->skin,
                   body->drag->water_form * body->exposure->water_form);
}

static inline bool bt_water_rests(const bt_params *par, const double *own)
{
    (void)par, (void)own;
    return true;
}

static const bt_force_law bt_law_water_drag = {
    .name = "water_drag",
    .doc = "skin and form drag of the water",
    .part_of = "drag",
    .rests = bt_water_rests,
    .add = bt_add_water_drag,
};

static inline void bt_add_air_drag(const bt_force_body *body, bt_load *load)
{
    bt_load_stream(load, body->par->air_u, body->par->air_v, body->drag->air_skin * body->exposure->skin,
                   body->drag->air_form * body->exposure->air_form);
}

static inline bool bt_air_rests(const bt_params *par, const double *own)
{
    (void)own;
    return par->air_u == par->water_u && par->air_v == par->water_v;
}

static const bt_force_law bt_law_air_drag = {
    .name = "air_drag",
    .doc = "skin and form drag of the air",
    .part_of = "drag",
    .rests = bt_air_rests,
    .add = bt_add_air_drag,
};

static inline void bt_add_yaw_drag(const bt_force_body *body, bt_load *load)
{
    load->yaw += body->drag->yaw * body->exposure->skin;
}

// One law for both fluids: a body at rest turns in neither, and it has one coefficient.
static const bt_force_law bt_law_yaw_drag = {
    .name = "yaw_drag",
    .doc = "moment of the skin drag of water and air as the body turns",
    .part_of = "drag",
    .turns_only = true,
    .rests = bt_water_rests,
    .add = bt_add_yaw_drag,
};

// --- the rotating Earth and the slope of the sea ---------------------------------------------------------------------

static inline void bt_add_coriolis(const bt_force_body *body, bt_load *load) { load->turn += body->par->coriolis; }

static inline bool bt_coriolis_rests(const bt_params *par, const double *own)
{
    (void)own;
    return par->coriolis == 0 || (par->balance_u == par->water_u && par->balance_v == par->water_v);
}

static const bt_force_law bt_law_coriolis = {
    .name = "coriolis",
    .doc = "Coriolis force",
    .rests = bt_coriolis_rests,
    .add = bt_add_coriolis,
};

static inline void bt_add_tilt(const bt_force_body *body, bt_load *load)
{
    const bt_params *par = body->par;
    const double push = par->dt * (par->tilt_moves_water ? 1 : body->share);
    load->about_x += par->balance_u;
    load->about_y += par->balance_v;
    load->gain_x += push * par->tilt_ax;
    load->gain_y += push * par->tilt_ay;
}

static inline bool bt_tilt_rests(const bt_params *par, const double *own)
{
    (void)own;
    return par->tilt_ax == 0 && par->tilt_ay == 0;
}

static const bt_force_law bt_law_tilt = {
    .name = "tilt",
    .doc = "force of the sea-surface tilt",
    .rests = bt_tilt_rests,
    .add = bt_add_tilt,
};

// --- the list --------------------------------------------------------------------------------------------------------

/// One line per law, in the order in which they add to a load. Rounding depends on that order.
#define BT_FORCE_LAWS(LAW) \
    LAW(water_drag) \
    LAW(air_drag) \
    LAW(yaw_drag) \
    LAW(coriolis) \
    LAW(tilt)

#define BT_ONE_LAW(name) +1
enum { BT_LISTED_LAWS = BT_FORCE_LAWS(BT_ONE_LAW) };

#endif
