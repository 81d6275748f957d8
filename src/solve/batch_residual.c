// SPDX-License-Identifier: MIT
// Residual passes four contacts at a time: the same numbers and the same list as contact by contact (solver.c,
// project.c), and which contacts the last sweep has moved.
#include "solve/batch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solve/batch_layout.h"
#include "solve/kernel.h"
#include "solve/rows.h"

/// Which contacts the last sweep has moved, and their multipliers unless NULL; 0 of contacts that are in no batch.
typedef struct {
    uint8_t few_moved[BT_FEW], *moved;          // [n_contacts]
    double few_x[BT_FEW][2], (*x)[2];           // [n_contacts]
} last_sweep;

static void take_last(const bt_cell *cell, bool projection, last_sweep *last)
{
    const size_t n = (size_t)cell->n_contacts;
    const bool few = n <= BT_FEW;
    last->moved = few ? last->few_moved : bt_realloc(NULL, n, sizeof *last->moved);
    last->x = !projection ? NULL : few ? last->few_x : bt_realloc(NULL, n, sizeof *last->x);
    if (n > 0) memset(last->moved, 0, n * sizeof *last->moved);
    if (n > 0 && projection) memset(last->x, 0, n * sizeof *last->x);
    for (bt_idx k = 0; k < cell->work.n_last; k++) {
        const bt_unknowns *unknowns = &cell->work.last[k];
        const bt_idx i = unknowns->contact;
        const bt_contact *contact = &cell->contacts[i];
        const double *b = unknowns->before;
        if (projection) {
            last->moved[i] = unknowns->multiplier[0] != b[0] || unknowns->multiplier[1] != b[1];
            last->x[i][0] = unknowns->multiplier[0], last->x[i][1] = unknowns->multiplier[1];
        } else {
            last->moved[i] = contact->ln[0] != b[0] || contact->ln[1] != b[1] || contact->lt != b[2];
        }
    }
}

static void free_last(last_sweep *last)
{
    if (last->moved != last->few_moved) free(last->moved);
    if (last->x && last->x != last->few_x) free(last->x);
}

/// Lanes of a vector for loops over contacts.
typedef struct {
    double of[BT_LANES];
} lanes;

static inline lanes lanes_of(bt_vec a)
{
    lanes o;
    memcpy(&o, &a, sizeof o);
    return o;
}

/// Contacts i to i + 3 with their masses, and what their bodies move by (velocities, or displacements).
typedef struct {
    const bt_contact *u[BT_LANES];
    bt_four_rows r;
    bt_masses m;
    bt_motions a, b;
} four;

/// The last contact of the cell again where there are no more.
BT_INLINE four four_from(const bt_cell *cell, bt_idx i, const bt_vel *v, const bt_inv *inv)
{
    four o;
    bt_idx a[BT_LANES], b[BT_LANES];
    for (int l = 0; l < BT_LANES; l++) {
        o.u[l] = &cell->contacts[i + l < cell->n_contacts ? i + l : cell->n_contacts - 1];
        a[l] = o.u[l]->a, b[l] = o.u[l]->b;
    }
    o.r = bt_rows_of(o.u);
    o.m = bt_masses_of(&o.r, bt_take_inv(inv, a), bt_take_inv(inv, b));
    o.a = bt_take_four(v, a), o.b = bt_take_four(v, b);
    return o;
}

/// Lanes of contacts i to i + 3 that there are.
BT_INLINE bt_mask there_are(const bt_cell *cell, bt_idx i)
{
    const int64_t left = cell->n_contacts - i;
    return (bt_mask){0, 1, 2, 3} < (bt_mask){left, left, left, left};
}

BT_INLINE int64_t sum_of(bt_mask a) { return a[0] + a[1] + a[2] + a[3]; }

BT_INLINE bt_vec limits_of(const bt_limit *const limit[BT_LANES], int c)
{
    // of `most` and `flat` the lower one: nothing rises here
    bt_vec most = {limit[0]->most[c], limit[1]->most[c], limit[2]->most[c], limit[3]->most[c]};
    return bt_smaller(most, (bt_vec){limit[0]->flat[c], limit[1]->flat[c], limit[2]->flat[c], limit[3]->flat[c]});
}

/// As bt_contact_residual and the list of residual_in_place (solver.c).
BT_INLINE bt_found residual(bt_cell *cell, const bt_vel *v, const bt_inv *inv, const bt_problem *problem,
                            const uint8_t *moved, bool bounded)
{
    const double near = BT_NEAR * problem->tolerance;
    const bt_vec zero = {0}, endless = {INFINITY, INFINITY, INFINITY, INFINITY};
    const bt_limit *limits = cell->laws.limits;
    bt_found found = {0};
    bt_vec most = zero;
    bt_mask rows = {0}, bad = {0};
    for (bt_idx i = 0; i < cell->n_contacts; i += BT_LANES) {
        const four o = four_from(cell, i, v, inv);
        const bt_contact *const *contact = o.u;
        const bt_four_rows r = o.r;
        const bt_masses m = o.m;
        const bt_motions a = o.a, b = o.b;
        const bt_limit *limit[BT_LANES];
        for (int l = 0; bounded && l < BT_LANES; l++) limit[l] = &limits[contact[l] - cell->contacts];
        const bt_vec dx = b.x - a.x, dy = b.y - a.y, un = r.nx * dx + r.ny * dy;
        bt_vec worst = zero, square[3], total = zero;
        bt_mask on = (r.ln[0] + r.ln[1] > zero) | (r.lt != zero);
        for (int c = 0; c < 2; c++) {
            const bt_mask there = c ? r.two : r.one;
            const bt_vec w = un + r.rbn[c] * b.w - r.ran[c] * a.w + r.bias[c];
            bt_vec map;
            if (bounded) {
                const bt_vec to = w - m.w[c] * r.ln[c];
                map = bt_larger(zero, bt_smaller(-to * m.mn[c], limits_of(limit, c)));
            } else {
                map = bt_larger(zero, r.ln[c] - w * m.mn[c]);
            }
            const bt_vec more = map - r.ln[c];
            bt_vec e = bt_only(there, bt_size_of(more * m.w[c]));
            if (bounded) { // bt_short_residual
                const bt_vec lacks = bt_smaller(-w, (more / map) * (problem->tolerance / BT_SHORT));
                e = bt_larger(e, bt_only(there & (more > zero), lacks));
            }
            worst = bt_larger(worst, e);
            square[c] = e * e;
            total += bt_only(there, r.ln[c]);
            on |= there & ~(w >= zero);
        }
        const bt_vec wt = r.nx * dy - r.ny * dx + r.rbt * b.w - r.rat * a.w, bound = r.mu * total;
        const bt_vec e = (bt_larger(-bound, bt_smaller(bound, r.lt - wt * m.mt)) - r.lt) * m.wt;
        square[2] = e * e;
        worst = bt_choose(bt_size_of(wt) < endless, bt_larger(worst, bt_size_of(e)), endless);
        const bt_mask counts = there_are(cell, i) & (bounded ? r.one : ~(bt_mask){0}); // sheets one by one
        most = bt_larger(most, bt_only(counts, worst));
        bad -= counts & (worst > near);
        rows += counts & (1 - r.one - r.two);
        const lanes normal = lanes_of(square[0]), second = lanes_of(square[1]), tangent = lanes_of(square[2]);
        for (int l = 0; l < BT_LANES && i + l < cell->n_contacts; l++) {
            bool listed = problem->plain || on[l] || moved[i + l];
            if (bounded && contact[l]->n == 0) {
                const bt_mass own = bt_mass_of(contact[l], inv);
                const double largest = bt_sheets_residual(contact[l], &own, limit[l], v, problem->tolerance,
                                                          &found.squares);
                listed = problem->plain || contact[l]->ln[0] + contact[l]->ln[1] > 0 || contact[l]->lt != 0 ||
                         moved[i + l] || largest > 0;
                found.most = bt_max(found.most, largest);
                found.bad += largest > near;
                found.rows += 2;
            } else {
                found.squares += normal.of[l];
                found.squares += second.of[l];
                found.squares += tangent.of[l];
            }
            cell->work.list[cell->work.n_list] = i + l;
            cell->work.n_list += listed;
        }
    }
    found.most = bt_max(found.most, bt_largest_lane(most));
    found.bad += sum_of(bad);
    found.rows += sum_of(rows);
    return found;
}

BT_FOR_EACH_CPU
static bt_found residual_of_rigid(bt_cell *cell, const bt_vel *v, const bt_inv *inv, const bt_problem *problem,
                                  const uint8_t *moved)
{
    return residual(cell, v, inv, problem, moved, false);
}

BT_FOR_EACH_CPU
static bt_found residual_of_bounded(bt_cell *cell, const bt_vel *v, const bt_inv *inv, const bt_problem *problem,
                                    const uint8_t *moved)
{
    return residual(cell, v, inv, problem, moved, true);
}

bt_found bt_batch_residual(bt_cell *cell, const bt_vel *v, const bt_inv *inv, const bt_problem *problem)
{
    last_sweep last;
    take_last(cell, false, &last);
    const bt_found found = cell->laws.limits ? residual_of_bounded(cell, v, inv, problem, last.moved)
                                             : residual_of_rigid(cell, v, inv, problem, last.moved);
    free_last(&last);
    return found;
}

/// As residual_in_place of project.c.
BT_FOR_EACH_CPU
static bt_found residual_of_projection(bt_cell *cell, double slop, const bt_vel *d, const bt_inv *inv,
                                       const bt_problem *problem, const last_sweep *last)
{
    const double near = BT_NEAR * problem->tolerance;
    const bt_vec zero = {0};
    bt_found found = {0};
    bt_vec most = zero;
    bt_mask rows = {0}, bad = {0};
    for (bt_idx i = 0; i < cell->n_contacts; i += BT_LANES) {
        const four o = four_from(cell, i, d, inv);
        const bt_contact *const *contact = o.u;
        const bt_four_rows r = o.r;
        const bt_masses m = o.m;
        const bt_motions a = o.a, b = o.b;
        const bt_vec un = r.nx * (b.x - a.x) + r.ny * (b.y - a.y);
        bt_vec worst = zero, square[2];
        bt_mask on = {0};
        for (int c = 0; c < 2; c++) {
            const bt_mask there = c ? r.two : r.one;
            bt_vec gap, x;
            for (int l = 0; l < BT_LANES; l++) {
                const bt_idx j = (bt_idx)(contact[l] - cell->contacts);
                gap[l] = cell->gaps[j].gap[c], x[l] = last->x[j][c];
            }
            const bt_vec open = un + r.rbn[c] * b.w - r.ran[c] * a.w + gap + slop;
            const bt_vec e = bt_only(there, bt_size_of(bt_larger(zero, x - open * m.mn[c]) - x) * m.w[c]);
            worst = bt_larger(worst, e);
            square[c] = e * e;
            on |= there & ((x > zero) | ~(open >= zero));
        }
        const bt_mask counts = there_are(cell, i);
        most = bt_larger(most, bt_only(counts, worst));
        bad -= counts & (worst > near);
        rows += counts & (-r.one - r.two);
        const lanes first = lanes_of(square[0]), second = lanes_of(square[1]);
        for (int l = 0; l < BT_LANES && i + l < cell->n_contacts; l++) {
            found.squares += first.of[l];
            found.squares += second.of[l];
            cell->work.list[cell->work.n_list] = i + l;
            cell->work.n_list += on[l] || last->moved[i + l];
        }
    }
    found.most = bt_max(found.most, bt_largest_lane(most));
    found.bad += sum_of(bad);
    found.rows += sum_of(rows);
    return found;
}

bt_found bt_batch_projection_residual(bt_cell *cell, double slop, const bt_vel *d, const bt_inv *inv,
                                      const bt_problem *problem)
{
    last_sweep last;
    take_last(cell, true, &last);
    const bt_found found = residual_of_projection(cell, slop, d, inv, problem, &last);
    free_last(&last);
    return found;
}
