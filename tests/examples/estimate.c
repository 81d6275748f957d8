// SPDX-License-Identifier: MIT
// Example of an estimate of one's own: the ice in the way of the body takes on its speed.
#include "bergtow/estimate.h"

/// Kinetic energy of the ice in a metre of the strip as wide as the body, at the speed of the body:
/// F = ½ ρ_i h W V² A. Ice that is packed hands the motion on to more ice than that of the strip: not meant for it.
static bt_estimate strip_energy(const bt_estimate_input *in)
{
    const double force = 0.5 * in->ice_density * in->thickness * in->width * in->along * in->along * in->concentration;
    const bool loose = in->concentration < BT_EST_COMPACT;
    return (bt_estimate){
        .force = force,
        .low = force,
        .high = 2 * force, // inelastic impact on the body: as much again goes into heat
        .valid = loose,
        .note = loose ? "A < 0.65: the ice of the strip alone moves" : "A >= 0.65 (assumed): more ice than that moves",
    };
}

static const bt_estimate_def strip_energy_estimate = {
    .name = "strip_energy",
    .label = "energy of the strip",
    .formula = "0.5 rho_i h W V^2 A, to twice that",
    .source = "derived: kinetic energy of the ice in the way of the body",
    .at = strip_energy,
};
