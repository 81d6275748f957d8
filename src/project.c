// SPDX-License-Identifier: MIT
// Split-impulse position projection: overlap is removed by displacements that never become velocities.
//
// With the gaps predicted for the end of the step, g2 = g + Δt J_n U2, find displacements D = M⁻¹ J_nᵀ p with
//     0 ≤ p ⟂ J_n D + g2 + slop ≥ 0
// by the same rows without friction. Touching contacts (g2 ≥ −slop) take part, so that pushing two floes apart does
// not press either into a third. Velocity-level correction (Baumgarte) would add kinetic energy and load that
// is not there (Metrikin 2014).
#include <math.h>
#include <string.h>

#include "bergtow/solver.h"

static double normal_rate(const bt_row *r, const bt_vel *x)
{
    const bt_vel *a = &x[r->a], *b = &x[r->b];
    return r->nx * (b->x - a->x) + r->ny * (b->y - a->y) + r->rbn * b->w - r->ran * a->w;
}

static void displace(const bt_row *r, double p, bt_vel *d, const bt_inv *inv)
{
    const bt_inv ia = inv[r->a], ib = inv[r->b];
    if (ia.m > 0) {
        d[r->a].x -= ia.m * p * r->nx;
        d[r->a].y -= ia.m * p * r->ny;
        d[r->a].w -= ia.i * p * r->ran;
    }
    if (ib.m > 0) {
        d[r->b].x += ib.m * p * r->nx;
        d[r->b].y += ib.m * p * r->ny;
        d[r->b].w += ib.i * p * r->rbn;
    }
}

void bt_solver_project(bt_world *w)
{
    bt_solver *s = w->solver;
    const bt_bodies *b = &w->bodies;
    const double slop = w->par.slop;
    w->stats.position_sweeps = 0;
    s->shifted = false;
    for (bt_idx i = 0; i < s->n_rows && !s->shifted; i++)
        s->shifted = s->rows[i].gap + w->par.dt * normal_rate(&s->rows[i], b->vel) < -slop;
    if (!s->shifted) return;

    memset(s->shift, 0, (size_t)b->n * sizeof *s->shift);
    memset(s->push, 0, (size_t)s->n_rows * sizeof *s->push);
    double worst = INFINITY;
    while (worst > 0.1 * slop && w->stats.position_sweeps < w->par.position_sweeps) {
        worst = 0;
        for (bt_idx i = 0; i < s->n_rows; i++) {
            const bt_row *r = &s->rows[i];
            double g2 = r->gap + w->par.dt * normal_rate(r, b->vel);
            double p = bt_max(0, s->push[i] - (normal_rate(r, s->shift) + g2 + slop) * r->mn), d = p - s->push[i];
            if (d == 0) continue;
            s->push[i] = p;
            displace(r, d, s->shift, b->inv);
            worst = bt_max(worst, fabs(d) / r->mn);
        }
        w->stats.position_sweeps++;
    }
}
