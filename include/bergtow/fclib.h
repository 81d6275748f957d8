// SPDX-License-Identifier: MIT
// The contact problem of one step in the file format of FCLIB, so that other solvers can check ours.
#ifndef BERGTOW_FCLIB_H
#define BERGTOW_FCLIB_H

#include "bergtow/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Write the local problem in two dimensions: find u, r with
///     u = W r + q,   0 <= r_n ⟂ u_n >= 0,   |r_t| <= mu r_n, r_t against u_t,
/// two rows a contact: normal, then tangent; u in m/s, r in N s. (FCLIB: Acary, Brémond, Koziara, Pérignon 2014,
/// "FCLIB: a collection of discrete 3D frictional contact problems", INRIA RT-444.)
///   w_ptr [2n+1], w_col, w_val   W (1/kg), compressed rows, at most 2^31 − 1 entries
///   q [2n] m/s, mu [n]
///   guess_r [2n]                 start of the iteration (its velocity is stored as W r + q), or NULL
///   solution_u, solution_r [2n]  solution, or both NULL
///   title, description           free text, or NULL
/// The file appears complete under its name, or not at all. Errors: BT_ERR_USAGE (a problem that the format cannot
/// hold, among them one without contacts), BT_ERR_IO.
bt_status bt_fclib_write_local(const char *path, int n_contacts, const int64_t *w_ptr, const int32_t *w_col,
                               const double *w_val, const double *q, const double *mu, const double *guess_r,
                               const double *solution_u, const double *solution_r, const char *title,
                               const char *description, bt_errors *err);

/// Where the contacts and the bodies of a problem are, which FCLIB's format does not know: for pictures. Normals point
/// from the first body of a contact to the second, levers from the centroid of each to the contact point, all in the
/// world frame.
typedef struct bt_fclib_places {
    double time, dt;       ///< end and length of the step, s
    const int64_t *body;   ///< [n_contacts][2] ids
    const double *normal;  ///< [n_contacts][2]
    const double *lever;   ///< [n_contacts][4] m, of the first and of the second body
    int64_t n_bodies;
    const double *pose;    ///< [n_bodies][3] x m, y m, yaw rad at the end of the step, by id
} bt_fclib_places;

/// The same with an upper bound of the normal impulses, 0 <= r_n <= bound [n] N s (u_n < 0 where it holds): what
/// FCLIB's format does not know, stored as /bound beside it, and with contacts whose two components both lie in a disc
/// about 0 of this radius, N s, stored as /disc (NaN: no such contact). NULL: none. Places, or NULL, are stored as
/// /places.
bt_status bt_fclib_write_bounded(const char *path, int n_contacts, const int64_t *w_ptr, const int32_t *w_col,
                                 const double *w_val, const double *q, const double *mu, const double *guess_r,
                                 const double *solution_u, const double *solution_r, const double *bound,
                                 const double *disc, const bt_fclib_places *places, const char *title,
                                 const char *description, bt_errors *err);

#ifdef __cplusplus
}
#endif

#endif
