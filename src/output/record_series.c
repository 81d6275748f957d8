// SPDX-License-Identifier: MIT
// The program's own series: name, unit, meaning, when it applies, how steps merge, where it is shown and summed up.
#include "output/record.h"
#include "case/cost.h"
#include "tow/tow.h"

#define PARTS(name_, applies_, keep_, units_, text_, role_, label_, key_)                                              \
    .name = #name_, .units = units_, .description = text_, .offset = offsetof(bt_sample, name_),                       \
    .keep = BT_KEEP_##keep_, .applies = BT_APPLIES_##applies_, .role = BT_ROLE_##role_, .label = label_, .summary = key_
#define SHOWN(...) {PARTS(__VA_ARGS__)}
#define ROW(...) {PARTS(__VA_ARGS__, NONE, NULL, NULL)}

// --- rows that say where their number is; that of the others is formed in observe.c --------------------------------

/// A number of the world.
typedef struct {
    size_t offset;
    enum { REAL, WHOLE, FLAG, NO_FLAG } kind; ///< NO_FLAG: 1 where it is false
} place;

static double at_place(const bt_world *w, const void *context)
{
    const place *p = context;
    const void *at = (const char *)w + p->offset;
    switch (p->kind) {
    case WHOLE: return (double)*(const int64_t *)at;
    case FLAG: return *(const bool *)at;
    case NO_FLAG: return !*(const bool *)at;
    default: return *(const double *)at;
    }
}

double bt_force_against(const bt_world *w, int k)
{
    const bt_impulse *j = &w->forces->series[k];
    return 0.0 - (j->x * w->tow->ux + j->y * w->tow->uy) / w->par.dt; // 0 − x, for no −0 in open water
}

double bt_force_of(const bt_world *w, const void *series)
{
    return bt_force_against(w, bt_force_series_find(series));
}

#define PLACE(at_, kind_) .of_world = at_place, .context = &(const place){offsetof(bt_world, at_), kind_}
#define AT(at_, ...)                                                                                                   \
    {PARTS(__VA_ARGS__), PLACE(at_, _Generic(((bt_world *)0)->at_, double: REAL, int64_t: WHOLE, bool: FLAG))}
#define UNLESS(at_, ...) {PARTS(__VA_ARGS__), PLACE(at_, NO_FLAG)}
#define FORCE(series_, ...) {PARTS(series_##_force, __VA_ARGS__), .of_world = bt_force_of, .context = #series_}

const bt_quantity bt_own_series[] = {
    ROW(time, ALWAYS, LAST, "s", "simulated time at the end of the step"),
    SHOWN(tow_force, BODY, MEAN, "N",
        "towing force on the body along the tow direction", BALANCE, "tow force", "mean_tow_force_n"),
    SHOWN(ice_resistance, BODY, MEAN, "N",
        "contact force of ice and walls on the towed body against the tow direction, impulse / dt",
        BALANCE, "ice resistance", "mean_ice_resistance_n"),
    ROW(ice_force_x, BODY, MEAN, "N", "contact force on the towed body, x, impulse / dt"),
    ROW(ice_force_y, BODY, MEAN, "N", "contact force on the towed body, y, impulse / dt"),
    ROW(ice_moment, BODY, MEAN, "N m", "contact moment on the towed body about its centroid, impulse / dt"),
    FORCE(drag, BODY, MEAN, "N",
        "drag of water and air on the towed body against the tow direction", BALANCE, "drag", "mean_drag_force_n"),
    FORCE(coriolis, BODY, MEAN, "N",
        "Coriolis force on the towed body against the tow direction", BALANCE, "Coriolis", "mean_coriolis_force_n"),
    FORCE(tilt, BODY, MEAN, "N",
        "force of the sea-surface tilt on the towed body against the tow direction",
        BALANCE, "tilt", "mean_tilt_force_n"),
    SHOWN(inertia_force, BODY, MEAN, "N",
        "(mass + added mass) x acceleration of the towed body along the tow direction",
        BALANCE, "inertia", "mean_inertia_force_n"),
    SHOWN(ice_resistance_budget, BODY, MEAN, "N",
        "ice resistance without the contacts of the body: on a prescribed course from the momentum of ice and walls, "
        "otherwise from the body's own change of momentum less the line",
        NONE, "ice resistance by momentum", "mean_ice_resistance_budget_n"),
    ROW(body_x, BODY, LAST, "m", "centroid of the towed body, x, not wrapped"),
    ROW(body_y, BODY, LAST, "m", "centroid of the towed body, y, not wrapped"),
    ROW(body_yaw, BODY, LAST, "rad", "yaw of the towed body from +x towards +y"),
    ROW(body_vx, BODY, LAST, "m/s", "velocity of the towed body, x"),
    ROW(body_vy, BODY, LAST, "m/s", "velocity of the towed body, y"),
    ROW(body_yaw_rate, BODY, LAST, "rad/s", "yaw rate of the towed body"),
    ROW(speed_through_ice, BODY, MEAN, "m/s",
        "speed of the towed body through undisturbed ice (the mean floe in free drift) along the tow direction"),
    ROW(leeway_through_ice, BODY, MEAN, "m/s",
        "the same across the tow direction, positive from +x towards +y: to the left in the basin's frame, to the "
        "right in the geographic one"),
    ROW(speed_through_water, BODY, MEAN, "m/s", "speed of the towed body through the water along the tow direction"),
    ROW(leeway_through_water, BODY, MEAN, "m/s",
        "the same across the tow direction, positive from +x towards +y: to the left in the basin's frame, to the "
        "right in the geographic one"),
    ROW(body_in_ice_x, BODY, LAST, "m",
        "centroid of the towed body in a frame that drifts with undisturbed ice, x: its way through the ice"),
    ROW(body_in_ice_y, BODY, LAST, "m", "the same, y"),
    ROW(line_tension, LINE, MEAN, "N",
        "tension of the tow line, with a weight that at its ends, of two branches the larger; NaN without a line"),
    ROW(line_length, LINE, LAST, "m",
        "length of the tow line (of its first branch) at the start of the step, with a weight the distance of its "
        "ends; NaN without a line"),
    ROW(carriage_x, LINE, LAST, "m", "towing end of the line, x; NaN without a line"),
    ROW(carriage_y, LINE, LAST, "m", "towing end of the line, y; NaN without a line"),
    SHOWN(line_tension_1, LINE, MEAN, "N",
        "tension of the first branch of the line; NaN without it", LOAD, "line tension", "mean_line_tension_n"),
    SHOWN(line_tension_2, BRIDLE, MEAN, "N",
        "tension of the second branch of the line; NaN without it",
        LOAD, "tension of the second branch", "mean_line_tension_2_n"),
    ROW(vessel_x, VESSEL, LAST, "m", "vessel, x, not wrapped; NaN without a vessel"),
    ROW(vessel_y, VESSEL, LAST, "m", "vessel, y, not wrapped; NaN without a vessel"),
    ROW(vessel_speed, VESSEL, LAST, "m/s", "speed of the vessel over ground along its course; NaN without a vessel"),
    SHOWN(vessel_thrust, VESSEL, MEAN, "N",
        "thrust of the vessel along its course; NaN without a vessel", LOAD, "vessel thrust", "mean_vessel_thrust_n"),
    ROW(vessel_drag, VESSEL, MEAN, "N", "water drag of the vessel against its course; NaN without a vessel"),
    ROW(vessel_inertia, VESSEL, MEAN, "N",
        "(mass + added mass) x acceleration of the vessel along its course; NaN without a vessel"),
    ROW(vessel_line, VESSEL, MEAN, "N", "pull of the line on the vessel against its course; NaN without a vessel"),
    AT(par.water_u, current_x, ALWAYS, MEAN, "m/s", "current at the middle of the step, x", NONE, NULL, NULL),
    AT(par.water_v, current_y, ALWAYS, MEAN, "m/s", "current at the middle of the step, y", NONE, NULL, NULL),
    AT(par.air_u, wind_x, ALWAYS, MEAN, "m/s", "wind at the middle of the step, x", NONE, NULL, NULL),
    AT(par.air_v, wind_y, ALWAYS, MEAN, "m/s", "wind at the middle of the step, y", NONE, NULL, NULL),
    AT(stats.n_points, contacts, ALWAYS, MEAN, "1",
        "contact points in the solver", DIAGNOSTIC, "contact points", "contacts_mean"),
    ROW(contacts_body, ALWAYS, MEAN, "1", "contact points on the towed body"),
    AT(stats.sweeps, sweeps, ALWAYS, MEAN, "1",
        "sweeps of the contact solver in a step", DIAGNOSTIC, "sweeps", "mean_sweeps"),
    AT(stats.contact_updates, contact_updates, ALWAYS, MEAN, "1",
        "updates of single contacts by the sweeps of a step: a sweep leaves out contacts that bear no load "
        "and open", NONE, NULL, "mean_contact_updates"),
    AT(stats.contact_moves, momentum_moves, ALWAYS, MEAN, "1",
        "contacts moved on along their last change between the sweeps of a step", NONE, NULL, "mean_momentum_moves"),
    AT(stats.residual_checks, residual_checks, ALWAYS, MEAN, "1",
        "residuals of single contacts that were taken in a step, and velocities formed anew for them; they count "
        "against the limit of work as updates do", NONE, NULL, "mean_residual_checks"),
    AT(stats.position_sweeps, position_sweeps, ALWAYS, MEAN, "1",
        "sweeps of the position projection in a step", NONE, NULL, NULL),
    AT(stats.position_updates, position_updates, ALWAYS, MEAN, "1",
        "updates of single contacts by the position projection of a step", NONE, NULL, "mean_position_updates"),
    UNLESS(stats.projected, unprojected, ALWAYS, SUM, "1",
        "steps whose position projection met its limit of work", NONE, NULL, "unprojected_steps"),
    AT(stats.residual, residual, ALWAYS, MAX, "m/s",
        "natural-map residual of the contact problem at the end of the step, largest component",
        DIAGNOSTIC, "residual", "max_residual_m_s"),
    AT(stats.residual_rms, residual_rms, ALWAYS, MAX, "m/s",
        "the same residual, root mean square over the rows of all contacts", NONE, NULL, NULL),
    AT(stats.n_active, active, ALWAYS, LAST, "1",
        "floes in cells whose contacts were looked at; all others are at rest", NONE, NULL, NULL),
    UNLESS(stats.converged, unconverged, ALWAYS, SUM, "1",
        "steps that met the limit of work before the tolerance", NONE, NULL, "unconverged_steps"),
    AT(stats.locked, locked, ALWAYS, SUM, "1",
        "of these, steps in which some bodies could not give way to any load: their loads have no bound", NONE, NULL,
        "locked_steps"),
    AT(stats.no_load, no_load, ALWAYS, SUM, "1",
        "of these, steps in which they press on the towed body: its contact forces are no numbers, NaN in the series",
        NONE, NULL, "no_load_steps"),
    AT(stats.overlap, overlap, ALWAYS, MAX, "m",
        "deepest overlap of two bodies at the start of the step; what was crushed or lies over each other by rafting "
        "is left out", DIAGNOSTIC, "deepest overlap", "max_overlap_m"),
    AT(stats.momentum_residual, momentum_residual, ALWAYS, MAX, "1",
        "|momentum change - external impulse| / momentum exchanged in the step", NONE, NULL, "momentum_residual"),
    AT(stats.kinetic_energy, kinetic_energy, ALWAYS, LAST, "J",
        "kinetic energy of all dynamic bodies, added mass included", NONE, NULL, NULL),
    AT(stats.contact_work, contact_work, ALWAYS, SUM, "J",
        "work of the contact impulses", NONE, NULL, "contact_work_j"),
    AT(stats.added_energy, added_energy, ALWAYS, SUM, "1",
        "steps in which that is above 0 by more than the residual and rounding explain", NONE, NULL,
        "positive_work_steps"),
    AT(stats.repeats, repeats, ALWAYS, SUM, "1",
        "times a step was detected and solved again because its solution outran the contact margin",
        NONE, NULL, "repeated_solves"),
    AT(stats.outrun, outrun, ALWAYS, SUM, "1",
        "steps whose last solution still outran the margin: a contact may have been met a step late",
        NONE, NULL, "outrun_steps"),
    AT(stats.misjudged, misjudged, ALWAYS, SUM, "1",
        "contacts that bear load at the end of the step although the pair passes, and pairs that meet without one",
        NONE, NULL, "misjudged_contacts"),
    AT(stats.restitution_cut, restitution_cut, ALWAYS, SUM, "1",
        "steps whose restitution was lowered so that the contacts add no energy", NONE, NULL, "restitution_cut_steps"),
    SHOWN(collision_resistance, IMPACTS, MEAN, "N",
        "part of ice_resistance that belongs to collisions, impulse / dt; the rest is quasi-static; NaN if not told "
        "apart", NONE, NULL, "impacts.mean_collision_resistance_n"),
    SHOWN(collisions, IMPACTS, SUM, "1",
        "collisions with the towed body that ended in the step; NaN if not told apart",
        NONE, NULL, "impacts.collisions"),
    SHOWN(impact_peak, IMPACTS, MAX, "N",
        "largest peak force of these collisions by impact.conversion, 0 without a collision; NaN if not told "
        "apart", NONE, NULL, "impacts.largest.peak_n"),
    SHOWN(largest_quasi_static_load, IMPACTS, MAX, "N",
        "largest normal force of a floe or wall on the towed body that is no collision, impulse / dt; NaN if not told "
        "apart",
        NONE, NULL, "impacts.largest_quasi_static_load_n"),
    ROW(moving, ALWAYS, LAST, "1", "floes faster than 1 % of the reference speed"),
    // here those of the contact laws: src/contact/crush.c, raft.c
    SHOWN(window_x, WINDOW, LAST, "m",
        "low end of the moving window, not wrapped; NaN where the domain stands still",
        NONE, NULL, "moving_window.x_m"),
    SHOWN(window_renewed, WINDOW, SUM, "1",
        "floes taken out behind the moving window and put in ahead as they were at time zero",
        NONE, NULL, "moving_window.renewed"),
    SHOWN(window_waiting, WINDOW, LAST, "1",
        "floes behind the moving window whose place ahead is not free, or not yet reached",
        NONE, NULL, "moving_window.waiting"),
};

const int bt_n_own_series = sizeof bt_own_series / sizeof *bt_own_series;

_Static_assert(sizeof bt_own_series / sizeof *bt_own_series == offsetof(bt_sample, laws) / sizeof(double),
               "every number of a sample has its row in the table");
_Static_assert(sizeof bt_own_series / sizeof *bt_own_series <= BT_COST_SERIES + 8,
               "what check says of the disk counts them");
