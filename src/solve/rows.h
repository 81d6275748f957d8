// SPDX-License-Identifier: MIT
// Four contacts side by side, and their effective masses (private to the solver).
//
// A contact record is four lines of four numbers; transposing the lines of four contacts takes a quarter of the
// instructions of copying them number by number.
#ifndef BERGTOW_ROWS_H
#define BERGTOW_ROWS_H

#include <stddef.h>
#include <string.h>

#include "contact/row.h"
#include "solve/vector.h"

/// Names as in bt_contact.
typedef struct bt_four_rows {
    bt_vec nx, ny, rat, rbt, ran[2], rbn[2], bias[2], mu, ln[2], lt;
    bt_mask one, two; ///< the contact has points (sheets have none); it has two
} bt_four_rows;

/// Velocities of four bodies, component by component.
typedef struct bt_motions {
    bt_vec x, y, w, unused;
} bt_motions;

/// Inverse masses of four bodies.
typedef struct bt_invs {
    bt_vec m, i;
} bt_invs;

/// Names as in bt_mass.
typedef struct bt_masses {
    bt_vec w[2], w12, mn[2], per_det, wt, mt;
} bt_masses;

/// Transpose; its own inverse.
BT_INLINE void bt_transpose(bt_motions *m)
{
    const bt_vec a = __builtin_shufflevector(m->x, m->y, 0, 4, 2, 6),
                 b = __builtin_shufflevector(m->x, m->y, 1, 5, 3, 7);
    const bt_vec c = __builtin_shufflevector(m->w, m->unused, 0, 4, 2, 6),
                 d = __builtin_shufflevector(m->w, m->unused, 1, 5, 3, 7);
    m->x = __builtin_shufflevector(a, c, 0, 1, 4, 5);
    m->y = __builtin_shufflevector(b, d, 0, 1, 4, 5);
    m->w = __builtin_shufflevector(a, c, 2, 3, 6, 7);
    m->unused = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}

BT_INLINE bt_motions bt_take_four(const bt_vel *v, const bt_idx *body)
{
    bt_motions m;
    memcpy(&m.x, &v[body[0]], sizeof m.x);
    memcpy(&m.y, &v[body[1]], sizeof m.y);
    memcpy(&m.w, &v[body[2]], sizeof m.w);
    memcpy(&m.unused, &v[body[3]], sizeof m.unused);
    bt_transpose(&m);
    return m;
}

BT_INLINE bt_invs bt_take_inv(const bt_inv *inv, const bt_idx *body)
{
    bt_vec even, odd;
    memcpy(&even, &inv[body[0]], sizeof *inv);
    memcpy((char *)&even + sizeof *inv, &inv[body[2]], sizeof *inv);
    memcpy(&odd, &inv[body[1]], sizeof *inv);
    memcpy((char *)&odd + sizeof *inv, &inv[body[3]], sizeof *inv);
    return (bt_invs){__builtin_shufflevector(even, odd, 0, 4, 2, 6), __builtin_shufflevector(even, odd, 1, 5, 3, 7)};
}

/// Line `line` of four records.
BT_INLINE bt_motions bt_take_line(const bt_contact *const contact[BT_LANES], size_t line)
{
    bt_motions m;
    memcpy(&m.x, (const char *)contact[0] + line * sizeof m.x, sizeof m.x);
    memcpy(&m.y, (const char *)contact[1] + line * sizeof m.x, sizeof m.x);
    memcpy(&m.w, (const char *)contact[2] + line * sizeof m.x, sizeof m.x);
    memcpy(&m.unused, (const char *)contact[3] + line * sizeof m.x, sizeof m.x);
    bt_transpose(&m);
    return m;
}

BT_INLINE bt_four_rows bt_rows_of(const bt_contact *const contact[BT_LANES])
{
    _Static_assert(offsetof(bt_contact, nx) == 0 && offsetof(bt_contact, rbt) == 24, "first line");
    _Static_assert(offsetof(bt_contact, ran) == 32 && offsetof(bt_contact, rbn) == 48, "second line");
    _Static_assert(offsetof(bt_contact, bias) == 64 && offsetof(bt_contact, mu) == 80, "third line");
    _Static_assert(offsetof(bt_contact, ln) == 96 && offsetof(bt_contact, lt) == 112, "fourth line");
    const bt_motions p = bt_take_line(contact, 0), q = bt_take_line(contact, 1), r = bt_take_line(contact, 2),
                     s = bt_take_line(contact, 3);
    const bt_mask n = {contact[0]->n, contact[1]->n, contact[2]->n, contact[3]->n}, none = {0};
    return (bt_four_rows){.nx = p.x, .ny = p.y, .rat = p.w, .rbt = p.unused,
                     .ran = {q.x, q.y}, .rbn = {q.w, q.unused},
                     .bias = {r.x, r.y}, .mu = r.w,
                     .ln = {s.x, s.y}, .lt = s.w,
                     .one = n > none, .two = n > none + 1};
}

/// x where the mask is set, else 0.
BT_INLINE bt_vec bt_only(bt_mask m, bt_vec x) { return (bt_vec)((bt_mask)x & m); }

/// As bt_mass_of for contacts with points; 0 for others.
BT_INLINE bt_masses bt_masses_of(const bt_four_rows *rows, bt_invs a, bt_invs b)
{
    const bt_vec free = a.m + b.m, one = {1, 1, 1, 1}, none = {0};
    bt_vec w[2];
    for (int i = 0; i < 2; i++) w[i] = free + a.i * rows->ran[i] * rows->ran[i] + b.i * rows->rbn[i] * rows->rbn[i];
    const bt_vec w12 = free + a.i * rows->ran[0] * rows->ran[1] + b.i * rows->rbn[0] * rows->rbn[1];
    const bt_vec wt = free + a.i * rows->rat * rows->rat + b.i * rows->rbt * rows->rbt;
    const bt_vec det = w[0] * w[1] - w12 * w12;
    const bt_vec per_det = bt_choose(det > 1e-9 * w[0] * w[1], one / det, none);
    return (bt_masses){.w = {bt_only(rows->one, w[0]), bt_only(rows->two, w[1])},
                       .w12 = bt_only(rows->two, w12),
                       .mn = {bt_only(rows->one, one / w[0]), bt_only(rows->two, one / w[1])},
                       .per_det = bt_only(rows->two, per_det),
                       .wt = bt_only(rows->one, wt),
                       .mt = bt_only(rows->one, one / wt)};
}

#endif
