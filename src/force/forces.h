// SPDX-License-Identifier: MIT
// The forces of a world in a step; laws and equations: bergtow/forces.h.
#ifndef BT_FORCES_H
#define BT_FORCES_H

#include "bergtow/forces.h"

/// For a new world: the force laws registered so far, with all parameters 0.
bt_forces *bt_forces_create(void);
/// Release them; NULL is ignored.
void bt_forces_free(bt_forces *forces);

/// Remove the added laws from a world for which they are not meant, such as that in which a field is made.
void bt_forces_leave_added(bt_forces *forces);

/// Set the parameters of all laws from a case. Without a case a program sets world->forces->own itself; they are 0
/// initially.
void bt_forces_setup(bt_world *world, const bt_case *input);

/// Collective. At the start of a step, before bt_forces_predict: call `begin` of the laws that have one.
void bt_forces_begin(bt_world *world);

/// Fill vel_start (U1), vel and vel_free (U*) and inv (effective) of every dynamic body. Kinematic and static bodies
/// keep vel.
void bt_forces_predict(bt_world *world);

/// After the solve, before bodies move: fill world->forces->law and ->series for the towed body.
void bt_forces_record(bt_world *world);

/// May floes that drift with the water rest, by bt_force_law.rests of all laws?
bool bt_forces_rest(const bt_world *world);

/// Velocity, after a step of free drift, of a body without an outline whose form drag is included in its skin drag.
/// body: par, time and towed_at are set here.
bt_vel bt_forces_drift(const bt_world *world, bt_force_body *body);

// Added force laws, as checkpoints see them.

/// Is this an applied force (bergtow/applied.h) that does nothing in the step with these parameters? False for every
/// other law.
bool bt_force_waits(const bt_force_law *law, const double *own);

/// Is this an applied force whose function has been removed, so that it no longer acts?
bool bt_force_is_released(const bt_force_law *law);

#endif
