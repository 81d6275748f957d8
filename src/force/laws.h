// SPDX-License-Identifier: MIT
// The force laws of the program; equations in bergtow/forces.h, how to add one in docs/how-to-add-a-force-law.md.
//
// Entries and functions stand in a header, so that the prediction, which calls every law for every body, has them
// inline: called through the table they made a step in 20 % ice and wind 8 % longer in instructions, 2 % in 80 % ice.
// Who needs a law less often takes it from the table (table.c), which is made of the same list.
#ifndef BERGTOW_LAWS_H
#define BERGTOW_LAWS_H

#include "bergtow/forces.h"

// --- drag ------------------------------------------------------------------------------------------------------------

static inline void bt_add_water_drag(const bt_force_body *b, bt_load *l)
{
    bt_load_stream(l, b->par->water_u, b->par->water_v, b->drag->water_skin * b->exposure->skin,
                   b->drag->water_form * b->exposure->water_form);
}

static inline bool bt_water_rests(const bt_params *p, const double *own)
{
    (void)p, (void)own;
    return true;
}

static const bt_force_law bt_law_water_drag = {
    .name = "water_drag",
    .doc = "skin and form drag of the water",
    .part_of = "drag",
    .rests = bt_water_rests,
    .add = bt_add_water_drag,
};

static inline void bt_add_air_drag(const bt_force_body *b, bt_load *l)
{
    bt_load_stream(l, b->par->air_u, b->par->air_v, b->drag->air_skin * b->exposure->skin,
                   b->drag->air_form * b->exposure->air_form);
}

static inline bool bt_air_rests(const bt_params *p, const double *own)
{
    (void)own;
    return p->air_u == p->water_u && p->air_v == p->water_v;
}

static const bt_force_law bt_law_air_drag = {
    .name = "air_drag",
    .doc = "skin and form drag of the air",
    .part_of = "drag",
    .rests = bt_air_rests,
    .add = bt_add_air_drag,
};

static inline void bt_add_yaw_drag(const bt_force_body *b, bt_load *l) { l->yaw += b->drag->yaw * b->exposure->skin; }

// One law for both fluids: what rests turns in neither, and the body has one coefficient.
static const bt_force_law bt_law_yaw_drag = {
    .name = "yaw_drag",
    .doc = "moment of the skin drag of water and air as the body turns",
    .part_of = "drag",
    .turns_only = true,
    .rests = bt_water_rests,
    .add = bt_add_yaw_drag,
};

// --- the rotating Earth and the slope of the sea ---------------------------------------------------------------------

static inline void bt_add_coriolis(const bt_force_body *b, bt_load *l) { l->turn += b->par->coriolis; }

static inline bool bt_coriolis_rests(const bt_params *p, const double *own)
{
    (void)own;
    return p->coriolis == 0 || (p->balance_u == p->water_u && p->balance_v == p->water_v);
}

static const bt_force_law bt_law_coriolis = {
    .name = "coriolis",
    .doc = "Coriolis force",
    .rests = bt_coriolis_rests,
    .add = bt_add_coriolis,
};

static inline void bt_add_tilt(const bt_force_body *b, bt_load *l)
{
    const bt_params *p = b->par;
    const double push = p->dt * (p->tilt_moves_water ? 1 : b->share);
    l->about_x += p->balance_u;
    l->about_y += p->balance_v;
    l->gain_x += push * p->tilt_ax;
    l->gain_y += push * p->tilt_ay;
}

static inline bool bt_tilt_rests(const bt_params *p, const double *own)
{
    (void)own;
    return p->tilt_ax == 0 && p->tilt_ay == 0;
}

static const bt_force_law bt_law_tilt = {
    .name = "tilt",
    .doc = "force of the sea-surface tilt",
    .rests = bt_tilt_rests,
    .add = bt_add_tilt,
};

// --- the list --------------------------------------------------------------------------------------------------------

/// One line a law, in the order in which they add to a load. Rounding follows that order.
#define BT_FORCE_LAWS(LAW) \
    LAW(water_drag) \
    LAW(air_drag) \
    LAW(yaw_drag) \
    LAW(coriolis) \
    LAW(tilt)

#define BT_ONE_LAW(name) +1
enum { BT_LISTED_LAWS = BT_FORCE_LAWS(BT_ONE_LAW) };

#endif
