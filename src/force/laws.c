// SPDX-License-Identifier: MIT
// The force laws of the program; equations in bergtow/forces.h, how to add one in docs/how-to-add-a-force-law.md.
#include "force/laws.h"

// --- drag ------------------------------------------------------------------------------------------------------------

static void water_drag(const bt_force_body *b, bt_load *l) { bt_load_stream(l, b->par->water_u, b->par->water_v, b->drag->water_skin, b->drag->water_form); }

static bool water_rests(const bt_params *p, const double *own)
{
    (void)p, (void)own;
    return true;
}

const bt_force_law bt_law_water_drag = {
    .name = "water_drag",
    .doc = "skin and form drag of the water",
    .part_of = "drag",
    .rests = water_rests,
    .add = water_drag,
};

static void air_drag(const bt_force_body *b, bt_load *l) { bt_load_stream(l, b->par->air_u, b->par->air_v, b->drag->air_skin, b->drag->air_form); }

static bool air_rests(const bt_params *p, const double *own)
{
    (void)own;
    return p->air_u == p->water_u && p->air_v == p->water_v;
}

const bt_force_law bt_law_air_drag = {
    .name = "air_drag",
    .doc = "skin and form drag of the air",
    .part_of = "drag",
    .rests = air_rests,
    .add = air_drag,
};

static void yaw_drag(const bt_force_body *b, bt_load *l) { l->yaw += b->drag->yaw; }

// One law for both fluids: what rests turns in neither, and the body has one coefficient.
const bt_force_law bt_law_yaw_drag = {
    .name = "yaw_drag",
    .doc = "moment of the skin drag of water and air as the body turns",
    .part_of = "drag",
    .turns_only = true,
    .rests = water_rests,
    .add = yaw_drag,
};

// --- the rotating Earth and the slope of the sea ---------------------------------------------------------------------

static void coriolis(const bt_force_body *b, bt_load *l) { l->turn += b->par->coriolis; }

static bool coriolis_rests(const bt_params *p, const double *own)
{
    (void)own;
    return p->coriolis == 0 || (p->balance_u == p->water_u && p->balance_v == p->water_v);
}

const bt_force_law bt_law_coriolis = {
    .name = "coriolis",
    .doc = "Coriolis force",
    .rests = coriolis_rests,
    .add = coriolis,
};

static void tilt(const bt_force_body *b, bt_load *l)
{
    const bt_params *p = b->par;
    const double push = p->dt * (p->tilt_moves_water ? 1 : b->share);
    l->about_x += p->balance_u;
    l->about_y += p->balance_v;
    l->gain_x += push * p->tilt_ax;
    l->gain_y += push * p->tilt_ay;
}

static bool tilt_rests(const bt_params *p, const double *own)
{
    (void)own;
    return p->tilt_ax == 0 && p->tilt_ay == 0;
}

const bt_force_law bt_law_tilt = {
    .name = "tilt",
    .doc = "force of the sea-surface tilt",
    .rests = tilt_rests,
    .add = tilt,
};
