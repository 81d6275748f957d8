// SPDX-License-Identifier: MIT
// Forces that a program applies to bodies: one call with arrays of all bodies, instead of one call for each.
//
// A force law (bergtow/forces.h) is called for every body, by many threads, and costs nothing to call in C. From Python
// such a call costs microseconds and holds a lock that all threads share. An applied force is therefore called once a
// step, by one thread, and fills a row for every body; the rows are loads like those of any law, and are integrated,
// recorded (series NAME_force, part of the momentum balance) and separated from the ice forces in the same way. If
// floes split, the step is solved again with the pieces, and the function is called again at the same time: the loads
// must follow from the time and the bodies, not from the number of calls.
//
// A row of zeros leaves the body as without the force, to the last bit, and floes at rest stay at rest. The undisturbed
// ice that a moving window takes in has no row: until it has entered it drifts without the force.
#ifndef BERGTOW_APPLIED_H
#define BERGTOW_APPLIED_H

#include "bergtow/base.h"

BT_BEGIN_C

/// Numbers in a row of loads. Explicit: FX, FY (N), MOMENT (N m). Linear, taken at the end of the step, j − K (U, ω) as
/// in bt_load: G, GX, GY, GW (kg/s, kg m/s, kg m/s, kg m²/s), JX, JY, JW (N, N, N m). A force that decreases with the
/// velocity belongs in the linear part: G = k and JX, JY = k U_ref draw the body towards U_ref, whatever the step.
enum {
    BT_APPLIED_FX, BT_APPLIED_FY, BT_APPLIED_MOMENT,
    BT_APPLIED_G, BT_APPLIED_GX, BT_APPLIED_GY, BT_APPLIED_GW, BT_APPLIED_JX, BT_APPLIED_JY, BT_APPLIED_JW,
    BT_APPLIED_NUMBERS
};

/// The bodies of this rank at the start of a step, in the order of their ids. All arrays except load are read only, and
/// all are valid only during the call.
typedef struct bt_applied {
    int64_t n;              ///< bodies; without MPI all
    const int64_t *id;      ///< [n] rising; not all numbers occur, because floes that may split reserve some
    const double *place;    ///< [n][3] x, y (wrapped in periodic directions), yaw, m, m, rad
    const double *velocity; ///< [n][3] m/s, m/s, rad/s; a prescribed velocity is that of this step
    const double *mass;     ///< [n] with added mass, kg
    const double *inertia;  ///< [n] with added inertia, kg m²
    double *load;           ///< [n][BT_APPLIED_NUMBERS] to be filled; zero on entry
    double time, dt;        ///< middle of the step; Δt, s
    double water[2], air[2];///< velocities of the step, m/s
    int64_t towed;          ///< id of the towed body, −1 = none
    int64_t towed_row;      ///< k with id[k] = towed, −1 = none here
} bt_applied;

/// Fills the loads; returns 0, any other value ends the run with BT_ERR_NUMERIC. Under MPI it is called on every rank,
/// and a body that several ranks hold must have the same row on each.
typedef int bt_applied_force(const bt_applied *applied, void *user);

/// Add a force, or give the force of this name another function; NULL = it does nothing from now on. Add a new name
/// before the case of the run is read; on all ranks alike, from one thread. A world has the forces that existed when it
/// was made, and one world steps at a time. name: lower case, digits and _; doc: one line, "drag of my own". Errors:
/// BT_ERR_USAGE, with reason and remedy in err.
bt_status bt_force_apply(const char *name, const char *doc, bt_applied_force *force, void *user, bt_errors *err);

/// Is there a force with a function?
bool bt_force_is_applied(void);

BT_END_C

#endif
