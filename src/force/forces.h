// SPDX-License-Identifier: MIT
// The forces of a world in a step; laws and equations: bergtow/forces.h.
#ifndef BT_FORCES_H
#define BT_FORCES_H

#include "bergtow/forces.h"

/// For a world that begins: the force laws that there are now, all their numbers 0.
bt_forces *bt_forces_create(void);
/// Release them; NULL is ignored.
void bt_forces_free(bt_forces *forces);

/// The world is none that a program's laws are meant for, as that of a field that is made: without those it has added.
void bt_forces_leave_added(bt_forces *forces);

/// The numbers of all laws from a case. Without a case a program sets world->forces->own itself; they are 0 before.
void bt_forces_setup(bt_world *world, const bt_case *input);

/// Collective. At the start of a step, before bt_forces_predict: `begin` of the laws that have one.
void bt_forces_begin(bt_world *world);

/// Fill vel_start (U1), vel and vel_free (U*) and inv (effective) of every dynamic body. Kinematic and static bodies
/// keep vel.
void bt_forces_predict(bt_world *world);

/// After the solve, before bodies move: world->forces->law and ->series of the towed body.
void bt_forces_record(bt_world *world);

/// May floes that drift with the water rest: bt_force_law.rests of all laws.
bool bt_forces_rest(const bt_world *world);

/// Velocity after a step of the free drift of a body without outline, whose form drag is part of its skin drag.
/// body: par, time and towed_at are set here.
bt_vel bt_forces_drift(const bt_world *world, bt_force_body *body);

// Force laws that a program has added, as checkpoints know them.

/// An applied force (bergtow/applied.h) that does nothing in the step of these numbers; false of every other law.
bool bt_force_waits(const bt_force_law *law, const double *own);

/// An applied force whose function has been taken away: it acts no more.
bool bt_force_is_released(const bt_force_law *law);

#endif
