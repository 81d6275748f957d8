// SPDX-License-Identifier: MIT
// Edges and sheets of floes that lie over each other; equations in contact/raft.h.
#include "contact/raft.h"

#include <math.h>

#include "contact/overlap.h"
#include "contact/work.h"
#include "base/elementary.h"

// Of the thickness: with less boundary inside each other the floes have no edge to speak of, one is under the other.
#define LEAST_LENGTH 1e-3

bool bt_raft_on(const bt_params *p) { return p->raft_line > 0; }

bool bt_raft_applies(const bt_world *w, bt_idx a, bt_idx b)
{
    const bt_bodies *s = &w->bodies;
    const bool ice = s->thickness[a] > 0 && s->thickness[b] > 0, towed = s->gid[a] == w->towed || s->gid[b] == w->towed;
    return ice && !towed && bt_part_first(s, a) == 0 && bt_part_first(s, b) == 0;
}

static double thinner(const bt_bodies *s, bt_idx a, bt_idx b) { return bt_min(s->thickness[a], s->thickness[b]); }

/// q0, N/m.
static double line_load(const bt_world *w, bt_idx a, bt_idx b)
{
    const double h = thinner(&w->bodies, a, b);
    return w->par.raft_line * h * h;
}

// --- memory ----------------------------------------------------------------------------------------------------------

bool bt_raft_keeps(const bt_world *w, bt_memory *r)
{
    const bt_idx a = bt_world_index(w, r->a), b = bt_world_index(w, r->b);
    if (a < 0 || b < 0) return false;
    bt_overlap o;
    double centroid[2];
    bt_overlap_clip(w, a, b, r->part, 0, 0, &o);
    r->value[1] = bt_overlap_area(&o, centroid);
    r->value[0] = bt_max(r->value[0], r->value[1]);
    return r->value[1] > 0;
}

double bt_raft_count(const bt_world *w, const bt_memory *r, bt_totals *totals)
{
    const bt_bodies *s = &w->bodies;
    const bt_idx a = bt_world_index(w, r->a), b = bt_world_index(w, r->b);
    if (!(r->value[1] > 0)) return 0;
    bt_sum_add(&totals->sum[BT_RAFTING_PAIRS], 1);
    bt_sum_add(&totals->sum[BT_RAFTED_AREA], r->value[1]);
    bt_sum_add(&totals->sum[BT_RAFTED_ENERGY], w->par.raft_rise * s->thickness[a] * s->thickness[b] * r->value[1]);
    return r->value[1];
}

// --- geometry --------------------------------------------------------------------------------------------------------

static void set_point(bt_manifold *m, double x, double y, const double off[2], double gap, uint32_t feature)
{
    m->p[m->n_points++] = (bt_point){.gap = gap, .ra = {x, y}, .rb = {x - off[0], y - off[1]}, .feature = feature};
}

/// The edge: two points on the line of the gradient, as near to the centroid of the overlap as that line comes.
static void edge_of(const double grad[2], double turn, double length, double gap, const double centroid[2],
                    const double off[2], bt_manifold *m)
{
    m->nx = -grad[0] / length, m->ny = -grad[1] / length;
    const double lever = -turn / length, along = centroid[0] * m->nx + centroid[1] * m->ny;
    const double x = lever * m->ny + along * m->nx, y = -lever * m->nx + along * m->ny;
    for (int side = -1; side <= 1; side += 2)
        set_point(m, x - side * 0.25 * length * m->ny, y + side * 0.25 * length * m->nx, off, gap,
                  side < 0 ? 0xfff00000u : 0xfff00001u);
}

/// False without an edge; `sheets` always.
bool bt_raft_contact(const bt_world *w, const bt_pair *p, const bt_memory *r, bt_manifold *edge, bt_manifold *sheets)
{
    bt_overlap o;
    double grad[2], turn, centroid[2], off[2];
    bt_overlap_clip(w, p->a, p->b, p->part, 0, 0, &o);
    bt_overlap_area(&o, centroid);
    bt_overlap_gradient(w, p->a, p->b, p->part, &o, w->par.slop, grad, &turn);
    bt_bodies_offset(w, p->a, p->b, off);
    *edge = (bt_manifold){.a = p->a, .b = p->b};
    *sheets = (bt_manifold){.a = p->a, .b = p->b, .nx = 1};
    sheets->p[0] = (bt_point){.ra = {centroid[0], centroid[1]}, .rb = {centroid[0] - off[0], centroid[1] - off[1]}};
    const double length = bt_hypot(grad[0], grad[1]);
    if (!(length > LEAST_LENGTH * thinner(&w->bodies, p->a, p->b))) return false;
    edge_of(grad, turn, length, (r->value[0] - r->value[1]) / length, centroid, off, edge);
    return true;
}

/// Length that bears at each point of a pair that has not rafted.
static void lengths_of(const bt_manifold *m, double slop, double length[2])
{
    length[0] = length[1] = 0;
    if (m->n_points < 2) return;
    const double dx = m->p[1].ra[0] - m->p[0].ra[0], dy = m->p[1].ra[1] - m->p[0].ra[1],
                 tilt = fabs(m->p[1].gap - m->p[0].gap);
    const double all = fabs(m->nx * dy - m->ny * dx), share = tilt > slop ? slop / tilt : 1;
    const int near = m->p[1].gap < m->p[0].gap;
    length[near] = all * share * (1 - 0.5 * share);
    length[1 - near] = all * share * 0.5 * share;
}

// --- bounds ----------------------------------------------------------------------------------------------------------

static void bound_sheets(const bt_world *w, bt_cell *t, bt_idx j, const bt_memory *r)
{
    bt_contact *u = &t->contacts[j];
    const double pressure = w->par.raft_sheet * thinner(&w->bodies, u->a, u->b);
    t->laws.limits[j].flat[0] = w->bodies.friction[u->b] * pressure * r->value[1] * w->par.dt;
    if (w->par.warm_start) u->ln[0] = r->value[2], u->lt = r->value[3];
}

void bt_raft_bound(const bt_world *w, bt_cell *t, bt_idx j, const bt_pair *p, const bt_manifold *m)
{
    bt_limit *l = &t->laws.limits[j];
    const bt_memory names = bt_law_names(w, p, BT_LAW_RAFTING);
    const bt_idx at = bt_law_find(t, &names);
    l->record[BT_LAW_RAFTING] = (int32_t)at;
    if (m->n_points == 0) {
        bound_sheets(w, t, j, &t->laws.memory[at]);
        return;
    }
    const double h = thinner(&w->bodies, m->a, m->b), q0 = line_load(w, m->a, m->b);
    double length[2];
    if (at >= 0) length[0] = length[1] = bt_hypot(m->p[1].ra[0] - m->p[0].ra[0], m->p[1].ra[1] - m->p[0].ra[1]); // L/2
    else lengths_of(m, w->par.slop, length);
    for (int i = 0; i < m->n_points; i++)
        bt_law_narrow(l, i, q0 * w->par.dt * bt_max(length[i], h / m->n_points), BT_LAW_RAFTING);
}

// --- growth ----------------------------------------------------------------------------------------------------------

bool bt_raft_gives_way(const bt_contact *u, const bt_limit *l, int i)
{
    return l->by[i] == BT_LAW_RAFTING && u->ln[i] >= l->cap[i];
}

void bt_raft_give_way(bt_world *w, bt_cell *t, bt_idx j, int i, bt_totals *totals)
{
    bt_sum_add(&totals->sum[BT_RAFT_EDGE_WORK], -bt_contacts_normal_work(w, &t->contacts[j], i));
}

/// A pair that gives way for the first time has a record from now on; sheets leave their friction in it.
double bt_raft_remember(bt_world *w, bt_cell *t, bt_idx j, bt_totals *totals)
{
    const bt_contact *u = &t->contacts[j];
    const bt_limit *l = &t->laws.limits[j];
    const bt_idx at = l->record[BT_LAW_RAFTING];
    if (u->n == 0) {
        t->laws.memory[at].value[2] = u->ln[0];
        t->laws.memory[at].value[3] = u->lt;
        bt_sum_add(&totals->sum[BT_RAFT_FRICTION_WORK], -bt_contacts_work(w, u));
        return 0;
    }
    bool begins = false;
    for (int i = 0; i < u->n; i++) begins = begins || (l->grown[i] > 0 && bt_raft_gives_way(u, l, i));
    if (!begins || at >= 0) return 0;
    bt_memory r = bt_law_names(w, &t->search.pairs[t->contacts[j].pair], BT_LAW_RAFTING);
    r.n_points = 2;
    bt_law_put(t, -1, &r);
    return 0;
}
