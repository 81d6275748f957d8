// SPDX-License-Identifier: MIT
// The table of time series: name, unit, meaning, when it applies and how the steps of one sample merge.
#include "output/record.h"
#include "case/cost.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

const char *const bt_applies_names[BT_APPLIES_KINDS] = {
    [BT_APPLIES_ALWAYS] = "always",
    [BT_APPLIES_BODY] = "with a towed body",
    [BT_APPLIES_LINE] = "with a tow line",
    [BT_APPLIES_BRIDLE] = "with a tow line of two branches",
    [BT_APPLIES_VESSEL] = "with a vessel",
    [BT_APPLIES_IMPACTS] = "where collisions are told apart",
    [BT_APPLIES_WINDOW] = "with a moving window",
};

#define ROW(name_, applies_, keep_, units_, text_)                                                                     \
    {                                                                                                                  \
        .name = #name_, .units = units_, .description = text_, .offset = offsetof(bt_sample, name_),                   \
        .keep = BT_KEEP_##keep_, .applies = BT_APPLIES_##applies_                                                      \
    }

#define LAW_ROW {.name = NULL}
#define SIX_LAWS LAW_ROW, LAW_ROW, LAW_ROW, LAW_ROW, LAW_ROW, LAW_ROW

bt_series_field bt_series_fields[] = {
    ROW(time, ALWAYS, LAST, "s", "simulated time at the end of the step"),
    ROW(tow_force, BODY, MEAN, "N", "towing force on the body along the tow direction"),
    ROW(ice_resistance, BODY, MEAN, "N",
        "contact force of ice and walls on the towed body against the tow direction, impulse / dt"),
    ROW(ice_force_x, BODY, MEAN, "N", "contact force on the towed body, x, impulse / dt"),
    ROW(ice_force_y, BODY, MEAN, "N", "contact force on the towed body, y, impulse / dt"),
    ROW(ice_moment, BODY, MEAN, "N m", "contact moment on the towed body about its centroid, impulse / dt"),
    ROW(drag_force, BODY, MEAN, "N", "drag of water and air on the towed body against the tow direction"),
    ROW(coriolis_force, BODY, MEAN, "N", "Coriolis force on the towed body against the tow direction"),
    ROW(tilt_force, BODY, MEAN, "N", "force of the sea-surface tilt on the towed body against the tow direction"),
    ROW(inertia_force, BODY, MEAN, "N", "(mass + added mass) x acceleration of the towed body along the tow direction"),
    ROW(ice_resistance_budget, BODY, MEAN, "N", "ice resistance from the momentum of everything but the towed body"),
    ROW(body_x, BODY, LAST, "m", "centroid of the towed body, x, not wrapped"),
    ROW(body_y, BODY, LAST, "m", "centroid of the towed body, y, not wrapped"),
    ROW(body_yaw, BODY, LAST, "rad", "yaw of the towed body from +x towards +y"),
    ROW(body_vx, BODY, LAST, "m/s", "velocity of the towed body, x"),
    ROW(body_vy, BODY, LAST, "m/s", "velocity of the towed body, y"),
    ROW(body_yaw_rate, BODY, LAST, "rad/s", "yaw rate of the towed body"),
    ROW(line_tension, LINE, MEAN, "N", "tension of the tow line, of two branches the larger; NaN without a line"),
    ROW(line_length, LINE, LAST, "m",
        "length of the tow line (of its first branch) at the start of the step; NaN without a line"),
    ROW(carriage_x, LINE, LAST, "m", "towing end of the line, x; NaN without a line"),
    ROW(carriage_y, LINE, LAST, "m", "towing end of the line, y; NaN without a line"),
    ROW(line_tension_1, LINE, MEAN, "N", "tension of the first branch of the line; NaN without it"),
    ROW(line_tension_2, BRIDLE, MEAN, "N", "tension of the second branch of the line; NaN without it"),
    ROW(vessel_x, VESSEL, LAST, "m", "vessel, x, not wrapped; NaN without a vessel"),
    ROW(vessel_y, VESSEL, LAST, "m", "vessel, y, not wrapped; NaN without a vessel"),
    ROW(vessel_speed, VESSEL, LAST, "m/s", "speed of the vessel over ground along its course; NaN without a vessel"),
    ROW(vessel_thrust, VESSEL, MEAN, "N", "thrust of the vessel along its course; NaN without a vessel"),
    ROW(vessel_drag, VESSEL, MEAN, "N", "water drag of the vessel against its course; NaN without a vessel"),
    ROW(vessel_inertia, VESSEL, MEAN, "N",
        "(mass + added mass) x acceleration of the vessel along its course; NaN without a vessel"),
    ROW(vessel_line, VESSEL, MEAN, "N", "pull of the line on the vessel against its course; NaN without a vessel"),
    ROW(current_x, ALWAYS, MEAN, "m/s", "current at the middle of the step, x"),
    ROW(current_y, ALWAYS, MEAN, "m/s", "current at the middle of the step, y"),
    ROW(wind_x, ALWAYS, MEAN, "m/s", "wind at the middle of the step, x"),
    ROW(wind_y, ALWAYS, MEAN, "m/s", "wind at the middle of the step, y"),
    ROW(contacts, ALWAYS, MEAN, "1", "contact points in the solver"),
    ROW(contacts_body, ALWAYS, MEAN, "1", "contact points on the towed body"),
    ROW(sweeps, ALWAYS, MEAN, "1", "sweeps of the contact solver in a step"),
    ROW(unit_updates, ALWAYS, MEAN, "1",
        "updates of single contacts by the sweeps of a step: a sweep leaves out contacts that bear no load and open"),
    ROW(momentum_moves, ALWAYS, MEAN, "1", "contacts moved on along their last change between the sweeps of a step"),
    ROW(position_sweeps, ALWAYS, MEAN, "1", "sweeps of the position projection in a step"),
    ROW(unprojected, ALWAYS, SUM, "1", "steps whose position projection met its limit of work"),
    ROW(residual, ALWAYS, MAX, "m/s",
        "natural-map residual of the contact problem at the end of the step, largest component"),
    ROW(residual_rms, ALWAYS, MAX, "m/s", "the same residual, root mean square over the rows of all contacts"),
    ROW(active, ALWAYS, LAST, "1", "floes in tiles whose contacts were looked at; all others are at rest"),
    ROW(unconverged, ALWAYS, SUM, "1", "steps that met the sweep limit before the tolerance"),
    ROW(overlap, ALWAYS, MAX, "m",
        "deepest overlap of two bodies at the start of the step; what was crushed or lies over each other by rafting "
        "is left out"),
    ROW(momentum_residual, ALWAYS, MAX, "1", "|momentum change - external impulse| / momentum exchanged in the step"),
    ROW(kinetic_energy, ALWAYS, LAST, "J", "kinetic energy of all dynamic bodies, added mass included"),
    ROW(contact_work, ALWAYS, SUM, "J", "work of the contact impulses"),
    ROW(repeats, ALWAYS, SUM, "1",
        "times a step was detected and solved again because its solution outran the contact margin"),
    ROW(outrun, ALWAYS, SUM, "1",
        "steps whose last solution still outran the margin: a contact may have been met a step late"),
    ROW(restitution_cut, ALWAYS, SUM, "1", "steps whose restitution was lowered so that the contacts add no energy"),
    ROW(collision_resistance, IMPACTS, MEAN, "N",
        "part of ice_resistance that belongs to collisions, impulse / dt; the rest is push; NaN if not told apart"),
    ROW(collisions, IMPACTS, SUM, "1", "collisions with the towed body that ended in the step; NaN if not told apart"),
    ROW(impact_peak, IMPACTS, MAX, "N",
        "largest peak force of these collisions by impact.conversion, 0 without a collision; NaN if not told apart"),
    ROW(largest_push, IMPACTS, MAX, "N",
        "largest force of a floe on the towed body that is no collision, impulse / dt; NaN if not told apart"),
    ROW(moving, ALWAYS, LAST, "1", "floes faster than 1 % of the reference speed"),
    ROW(crushing, ALWAYS, MEAN, "1",
        "contact points that crush: their normal force is at the limit pressure x thickness x length"),
    ROW(crushed_work, ALWAYS, SUM, "J", "work taken by contact points that crush"),
    ROW(crushed_depth, ALWAYS, MAX, "m", "deepest crush of a pair of bodies in contact, or at rest beside each other"),
    ROW(rafting, ALWAYS, LAST, "1", "pairs of floes that lie over each other"),
    ROW(rafted_area, ALWAYS, LAST, "m2",
        "area in which floes lie over each other, pair by pair, at the start of the step"),
    ROW(rafted_largest, ALWAYS, MAX, "m2", "the largest such area of one pair"),
    ROW(rafted_energy, ALWAYS, LAST, "J",
        "potential energy of floes that lie over each other, above that of floes side by side"),
    ROW(raft_edge_work, ALWAYS, SUM, "J",
        "work taken by edges that raft: their load is at the bound; part of it is in rafted_energy, the rest is lost"),
    ROW(raft_friction_work, ALWAYS, SUM, "J", "work taken by friction between floes that lie over each other"),
    ROW(window_x, WINDOW, LAST, "m", "low end of the moving window, not wrapped; NaN where the domain stands still"),
    ROW(window_renewed, WINDOW, SUM, "1",
        "floes taken out behind the moving window and put in ahead as they were at time zero"),
    ROW(window_waiting, WINDOW, LAST, "1",
        "floes behind the moving window whose place ahead is not free, or not yet reached"),
    SIX_LAWS,
    SIX_LAWS,
    SIX_LAWS,
    SIX_LAWS, // BT_MAX_FORCE_LAWS rows, filled by bt_n_series
};

enum { N_ROWS = sizeof bt_series_fields / sizeof *bt_series_fields, N_FIXED = N_ROWS - BT_MAX_FORCE_LAWS };
_Static_assert(N_ROWS == sizeof(bt_sample) / sizeof(double), "every number of a sample has its row in the table");

/// Forces that a sample has members for.
static bool has_member(const char *name)
{
    return !strcmp(name, "drag") || !strcmp(name, "coriolis") || !strcmp(name, "tilt");
}

/// n_known: series of forces when the others were found
static int law_series[BT_MAX_FORCE_LAWS], n_law_series, n_known;

/// After laws have been registered.
static void find_law_series(void)
{
    if (n_known == bt_n_force_series) return;
    n_known = bt_n_force_series;
    n_law_series = 0;
    for (int i = 0; i < bt_n_force_wholes; i++)
        if (!has_member(bt_force_series_of[i].name)) law_series[n_law_series++] = i;
}

int bt_n_law_series(void)
{
    find_law_series();
    return n_law_series;
}

int bt_law_series(int k) { return k < bt_n_law_series() ? law_series[k] : -1; }

/// The row of a law; its texts stay for the life of the program, as the law does.
static void fill_row(bt_series_field *f, int k)
{
    const bt_force_series *of = &bt_force_series_of[bt_law_series(k)];
    char *name = NULL, *text = NULL;
    if (asprintf(&name, "%s_force", of->name) < 0 ||
        asprintf(&text, "%s on the towed body against the tow direction", of->law ? of->law->doc : of->name) < 0)
        abort();
    *f = (bt_series_field){
        name, "N", text, offsetof(bt_sample, law_force) + (size_t)k * sizeof(double), BT_KEEP_MEAN, BT_APPLIES_BODY};
}

int bt_n_series(void)
{
    const int n = bt_n_law_series();
    for (int k = 0; k < n; k++)
        if (!bt_series_fields[N_FIXED + k].name) fill_row(&bt_series_fields[N_FIXED + k], k);
    return N_FIXED + n;
}

_Static_assert((int)N_FIXED <= BT_COST_SERIES + 8, "what check says of the disk counts them");

const bt_series_field *bt_sample_fault(const bt_sample *s, unsigned has)
{
    for (int k = 0; k < bt_n_series(); k++) {
        const bt_series_field *f = &bt_series_fields[k];
        const double x = bt_sample_value(s, f);
        if (has & 1u << f->applies ? !(fabs(x) < BT_SAMPLE_MOST) : !isnan(x)) return f;
    }
    return NULL;
}
