// SPDX-License-Identifier: MIT
// Example of a force law of one's own: the mean drift force of short waves, and the damping that goes with it.
//
// A floating body reflects short waves whole: F = ½ ρ g a² D along the waves, a: amplitude, D: diameter [Maruo 1960].
// In waves of frequency ω a body that drifts meets more or fewer of them: − (4 ω/g) F (U − U_w) [Aranha 1994, for an F
// that does not depend on ω].
#include "bergtow/forces.h"

enum { AMPLITUDE, PERIOD, DIRECTION, PER_WIDTH, PER_SPEED }; // own[]: the keys in their order, and what setup adds

static const bt_law_key wave_drift_keys[] = {
    {"amplitude", "m", "0 m", "[0, 20]", "amplitude of the waves, 0 = none"},
    {"period", "s", "8 s", "(0, 100]", "period of the waves, assumed"},
    {"direction", "rad", "0 deg", "[-360, 360]", "direction into which the waves run, from the x axis towards y"},
};

static void wave_drift_setup(const bt_case *c, double own[BT_MAX_FORCE_OWN])
{
    const double g = 9.81, pi = 3.14159265358979;
    own[PER_WIDTH] = 0.5 * c->water.density * g * own[AMPLITUDE] * own[AMPLITUDE]; // N/m
    own[PER_SPEED] = 4 * (2 * pi / own[PERIOD]) / g;                              // s/m
}

static bool wave_drift_rests(const bt_params *p, const double *own)
{
    (void)p;
    return own[AMPLITUDE] == 0;
}

static void wave_drift(const bt_force_body *b, bt_load *l)
{
    const double force = b->own[PER_WIDTH] * 2 * bt_force_radius(b);
    l->fx += force * cos(b->own[DIRECTION]);
    l->fy += force * sin(b->own[DIRECTION]);
    bt_load_damper(l, b->own[PER_SPEED] * force, b->par->water_u, b->par->water_v);
}

static const bt_force_law wave_drift_law = {
    .name = "wave_drift",
    .doc = "mean drift force of short waves",
    .keys = wave_drift_keys,
    .n_keys = 3,
    .setup = wave_drift_setup,
    .rests = wave_drift_rests,
    .add = wave_drift,
};
