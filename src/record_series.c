// SPDX-License-Identifier: MIT
// The table of time series: name, unit, meaning and how the steps of one sample merge.
#include "bergtow/record.h"

#define ROW(name_, keep_, units_, text_) \
    {.name = #name_, .units = units_, .description = text_, .offset = offsetof(bt_sample, name_), .keep = BT_KEEP_##keep_}

const bt_series_field bt_series_fields[] = {
    ROW(time, LAST, "s", "simulated time at the end of the step"),
    ROW(tow_force, MEAN, "N", "towing force on the body along the tow direction"),
    ROW(ice_resistance, MEAN, "N", "contact force of ice and walls on the towed body against the tow direction, impulse / dt"),
    ROW(ice_force_x, MEAN, "N", "contact force on the towed body, x, impulse / dt"),
    ROW(ice_force_y, MEAN, "N", "contact force on the towed body, y, impulse / dt"),
    ROW(ice_moment, MEAN, "N m", "contact moment on the towed body about its centroid, impulse / dt"),
    ROW(drag_force, MEAN, "N", "drag of water and air on the towed body against the tow direction"),
    ROW(coriolis_force, MEAN, "N", "Coriolis force on the towed body against the tow direction"),
    ROW(tilt_force, MEAN, "N", "force of the sea-surface tilt on the towed body against the tow direction"),
    ROW(inertia_force, MEAN, "N", "(mass + added mass) x acceleration of the towed body along the tow direction"),
    ROW(ice_resistance_budget, MEAN, "N", "ice resistance from the momentum of everything but the towed body"),
    ROW(body_x, LAST, "m", "centroid of the towed body, x, not wrapped"),
    ROW(body_y, LAST, "m", "centroid of the towed body, y, not wrapped"),
    ROW(body_yaw, LAST, "rad", "yaw of the towed body from +x towards +y"),
    ROW(body_vx, LAST, "m/s", "velocity of the towed body, x"),
    ROW(body_vy, LAST, "m/s", "velocity of the towed body, y"),
    ROW(body_yaw_rate, LAST, "rad/s", "yaw rate of the towed body"),
    ROW(line_tension, MEAN, "N", "tension of the tow line; NaN without a line"),
    ROW(line_length, LAST, "m", "length of the tow line; NaN without a line"),
    ROW(carriage_x, LAST, "m", "towing end of the line, x; NaN without a line"),
    ROW(carriage_y, LAST, "m", "towing end of the line, y; NaN without a line"),
    ROW(current_x, MEAN, "m/s", "current at the middle of the step, x"),
    ROW(current_y, MEAN, "m/s", "current at the middle of the step, y"),
    ROW(wind_x, MEAN, "m/s", "wind at the middle of the step, x"),
    ROW(wind_y, MEAN, "m/s", "wind at the middle of the step, y"),
    ROW(contacts, MEAN, "1", "contact points in the solver"),
    ROW(contacts_body, MEAN, "1", "contact points on the towed body"),
    ROW(sweeps, MEAN, "1", "sweeps of the contact solver in a step"),
    ROW(position_sweeps, MEAN, "1", "sweeps of the position projection in a step"),
    ROW(residual, MAX, "m/s", "natural-map residual of the contact problem at the end of the step, largest component"),
    ROW(residual_rms, MAX, "m/s", "the same residual, root mean square over the rows of all contacts"),
    ROW(active, LAST, "1", "floes in tiles whose contacts were looked at; all others are at rest"),
    ROW(unconverged, SUM, "1", "steps that met the sweep limit before the tolerance"),
    ROW(overlap, MAX, "m", "deepest overlap of two bodies at the start of the step"),
    ROW(momentum_residual, MAX, "1", "|momentum change - external impulse| / momentum exchanged in the step"),
    ROW(kinetic_energy, LAST, "J", "kinetic energy of all dynamic bodies, added mass included"),
    ROW(contact_work, SUM, "J", "work of the contact impulses"),
    ROW(repeats, SUM, "1", "times a step was detected and solved again because its solution outran the contact margin"),
    ROW(outrun, SUM, "1", "steps whose last solution still outran the margin: a contact may have been met a step late"),
    ROW(restitution_cut, SUM, "1", "steps whose restitution was lowered so that the contacts add no energy"),
    ROW(collision_resistance, MEAN, "N", "part of ice_resistance that belongs to collisions, impulse / dt; the rest is push; NaN if not told apart"),
    ROW(collisions, SUM, "1", "collisions with the towed body that ended in the step; NaN if not told apart"),
    ROW(impact_peak, MAX, "N", "largest peak force of these collisions by impact.conversion, 0 without a collision; NaN if not told apart"),
    ROW(moving, LAST, "1", "floes faster than 1 % of the reference speed"),
    ROW(crushing, MEAN, "1", "contact points that crush: their normal force is at the limit pressure x thickness x length"),
    ROW(crushed_work, SUM, "J", "work taken by contact points that crush"),
    ROW(crushed_depth, MAX, "m", "deepest crush of a pair of bodies in contact"),
    ROW(window_x, LAST, "m", "low end of the moving window, not wrapped; NaN where the domain stands still"),
    ROW(window_renewed, SUM, "1", "floes taken out behind the moving window and put in ahead as they were at time zero"),
    ROW(window_waiting, LAST, "1", "floes behind the moving window whose place ahead is not free, or not yet reached"),
};

const int bt_n_series_fields = sizeof bt_series_fields / sizeof *bt_series_fields;

_Static_assert(sizeof bt_series_fields / sizeof *bt_series_fields == sizeof(bt_sample) / sizeof(double),
               "every number of a sample has its row in the table");
