// SPDX-License-Identifier: MIT
// What a run costs, before it is made: time, memory, disk.
#ifndef BERGTOW_COST_H
#define BERGTOW_COST_H

#include "bergtow/case.h"
#include "bergtow/comm.h"

/// Seconds a floe and step on one core, measured on cases/basin (AMD EPYC, 2026): 0.5, 2 and 15 µs at 20, 50 and 80 %, where
/// force chains reach the walls and the contact solver sweeps a hundred times. Between them the logarithm is linear.
/// A large pack at 80 % in which most floes rest costs a tenth of that: the order of magnitude, no more.
double bt_cost_floe_step(double concentration);

/// Of a whole case with a generated field, s of one core.
double bt_cost_seconds(const bt_case *c);

/// Memory of a node with ranks_here of `size` ranks, B: 2 kB a floe (body arrays about 0.5 kB, contacts and lists about 1.5 kB in dense ice) shared by the
/// ranks, 0.2 kB a floe on each for the field at time zero, and what the summary keeps of every step.
double bt_cost_memory(const bt_case *c, double n_floes, int size, int ranks_here);

/// Series and frames on disk, B, uncompressed.
double bt_cost_result(const bt_case *c, double n_floes);

/// Memory of this machine, or less where the control group of this process has less, B.
double bt_cost_machine(void);

/// Refuse a case of n_floes that needs more memory than a machine has. Errors: BT_ERR_CASE.
bt_status bt_cost_fits(const bt_case *c, double n_floes, const bt_comm *comm, double machine, bt_errors *err);

#endif
