// SPDX-License-Identifier: MIT
// The contact problem of one step in the file format of FCLIB, so that other solvers can check ours.
#ifndef BERGTOW_FCLIB_H
#define BERGTOW_FCLIB_H

#include "bergtow/base.h"

BT_BEGIN_C

/// Places of the contacts and bodies of a problem, which FCLIB's format does not have, for pictures. Normals point from
/// the first body of a contact to the second, levers from the centroid of each to the contact point, all in the world
/// frame.
typedef struct bt_fclib_places {
    double time, dt;       ///< end and length of the step, s
    const int64_t *body;   ///< [n_contacts][2] ids
    const double *normal;  ///< [n_contacts][2]
    const double *lever;   ///< [n_contacts][4] m, of the first and of the second body
    int64_t n_bodies;
    const double *pose;    ///< [n_bodies][3] x m, y m, yaw rad at the end of the step, by id
} bt_fclib_places;

/// A local problem in two dimensions: find u, r with
///     u = W r + q,   0 <= r_n ⟂ u_n >= 0,   |r_t| <= mu r_n, r_t against u_t,
/// two rows per contact: normal, then tangent; u in m/s, r in N s. (FCLIB: Acary, Brémond, Koziara, Pérignon 2014,
/// "FCLIB: a collection of discrete 3D frictional contact problems", INRIA RT-444.)
typedef struct bt_fclib_problem {
    int n;                 ///< contacts
    const int64_t *w_ptr;  ///< [2n + 1] W in compressed rows, at most 2^31 − 1 entries
    const int32_t *w_col;
    const double *w_val;   ///< 1/kg
    const double *q, *mu;  ///< [2n] m/s, [n]
    const double *u, *r;   ///< [2n] solution, or both NULL
    // Extensions of the format, stored as /bound, /disc, /ends and /places; each may be NULL.
    const double *bound;   ///< [n] N s, 0 <= r_n <= bound; u_n < 0 only at the bound
    // Sheets: their impulse is the sum of a point of a disc about 0 and of a point of the line from −ends to ends.
    const double *disc;    ///< [n] N s, radius of the disc; NaN: no sheets
    const double *ends;    ///< [2n] N s; NULL: all 0
    const bt_fclib_places *places;
    const char *title, *description; ///< free text, or NULL
} bt_fclib_problem;

/// Write a problem. The file appears complete under its name, or not at all. Errors: BT_ERR_USAGE (a problem that the
/// format cannot hold, such as one without contacts), BT_ERR_IO.
bt_status bt_fclib_write(const char *path, const bt_fclib_problem *p, bt_errors *err);

BT_END_C

#endif
