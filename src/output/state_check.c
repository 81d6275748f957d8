// SPDX-License-Identifier: MIT
// What a checkpoint may hold: the bounds within which every step leaves its state.
//
// The checksum shows that a file is as it was written, not that it was written by a run: a file made by hand, or by a
// program with an error, can be protected by a checksum too, and the hash of the state leaves much of it out (labels,
// impulses, counters). Its numbers become indices, lengths of arrays and ends of loops. So each that does is held
// against what steps keep true before it is used, and every other real number must be finite. Nothing here is an
// estimate: a bound that a sound run could exceed would take its checkpoint away from it.
#include "output/state.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/contact.h"
#include "contact/law.h"
#include "loads/impact.h"
#include "bergtow/outline.h"
#include "bergtow/shape.h"
#include "tow/tow.h"
#include "step/splitting.h"
#include "step/window.h"
#include "case/ice_bounds.h"
#include "base/largest.h"

static const int32_t FAR = 1000000000; // cells, periods: as labels of cells are limited (cells.c)

// --- the field -------------------------------------------------------------------------------------------------------

/// To less than the reader of fields asks, since outlines have been centred and cut meanwhile.
static bool is_floe(const bt_field *f, bt_idx i)
{
    const int n = (int)(f->offsets[i + 1] - f->offsets[i]);
    const double *v = f->vertices + 2 * f->offsets[i];
    if (!bt_shape_broken(n, v)) return true;
    bt_parts p;
    return f->outlines.split > 0 && !bt_outline_fault(n, v) && bt_outline_split(n, v, &p);
}

static void want_ice(bt_snapshot *s, const char *name, int64_t row, const char *why)
{
    char text[BT_ICE_WHY + 16];
    snprintf(text, sizeof text, "is refused: %s", why); // completes "/field/area, row 3, "
    bt_snapshot_want(s, false, name, row, text);
}

void bt_state_check_field(const bt_field *f, int64_t n_offsets, int64_t n_vertices, bt_snapshot *s)
{
    bt_snapshot_want(s, n_offsets >= 1 && n_offsets <= BT_MOST_FLOES + 1, "field/offsets", -1,
                     "has no number of rows that a field can have");
    if (s->faulty) return;
    bt_snapshot_want(s, f->offsets[0] == 0 && f->offsets[n_offsets - 1] == n_vertices, "field/offsets", -1,
                     "does not begin with 0 and end with the number of vertices");
    for (int64_t i = 0; i + 1 < n_offsets && !s->faulty; i++) {
        const int64_t a = f->offsets[i], b = f->offsets[i + 1];
        bt_snapshot_want(s, a >= 0 && a <= n_vertices && b >= a + 3 && b <= n_vertices && b - a <= BT_MAX_VERTICES,
                         "field/offsets", i, "gives a floe too few or too many vertices");
    }
    static const char *const names[] = {[BT_ICE_THICKNESS] = "field/thickness",
                                        [BT_ICE_POSE] = "field/pose",
                                        [BT_ICE_OUTLINE] = "field/offsets",
                                        [BT_ICE_AREA] = "field/area"};
    double sum = 0, size = 0;
    char why[BT_ICE_WHY];
    for (bt_idx i = 0; i < f->n && !s->faulty; i++) {
        const int64_t first = f->offsets[i], n = f->offsets[i + 1] - first;
        bt_snapshot_want(s, bt_state_finite(f->vertices + 2 * first, 2 * n) && is_floe(f, i), "field/offsets", i,
                         "begins an outline that is no floe");
        if (s->faulty) return;
        const double *p = f->pose + 3 * (size_t)i;
        const bt_ice_floe floe = {(int)n, f->vertices + 2 * first, p[0], p[1], p[2], f->thickness[i], f->area[i], 1e-6};
        bt_ice_part part;
        const char *fault = bt_ice_floe_fault(&floe, why, &part);
        if (fault) want_ice(s, names[part], i, fault);
        sum += f->area[i], size += sqrt(4 * f->area[i] / BT_PI);
    }
    if (s->faulty) return;
    bt_snapshot_want(s, f->concentration >= 0 && f->concentration <= 1 + 1e-9, "field/concentration", -1,
                     "is no concentration");
    // Floes outside the ice region have no part in its concentration, and a file that was read may have such; a field
    // without floes may have no ice region, and so no area.
    const bool outside = f->outlines.outside_area > 0 || f->outlines.own_area > 0;
    const double within = outside ? bt_min(sum, f->concentration * f->ice_area) : sum;
    if ((f->n > 0 || f->ice_area != 0) && bt_ice_field_fault(true, f->n, size, within, f->ice_area, why))
        want_ice(s, "field/ice_area", -1, why);
}

// --- cells -----------------------------------------------------------------------------------------------------------

typedef struct {
    const char *side, *wrap, *low, *n;
} cell_names;

/// One direction of the cells: as src/space/cells.c chooses them. in_cells: there are floes in them.
static void check_direction(bt_snapshot *s, const cell_names *name, bool in_cells, double period, double side,
                            int32_t wrap, int32_t low, int32_t n)
{
    bt_snapshot_want(s, side > 0, name->side, -1, "is no width of a cell");
    bt_snapshot_want(s, period > 0 ? wrap == 1 || (wrap >= 4 && wrap % 2 == 0) : wrap == 0, name->wrap, -1,
                     "is no number of cells around this domain");
    if (s->faulty) return;
    bt_snapshot_want(s, wrap == 0 || side == period / wrap, name->side, -1, "does not go round the domain");
    bt_snapshot_want(s, wrap == 0 ? low >= -FAR && low <= FAR : low == 0, name->low, -1, "is no place of a cell");
    bt_snapshot_want(s, n >= 1 && (wrap == 0 || n == wrap || (n == 1 && !in_cells)), name->n, -1,
                     "is no number of cells");
}

static void check_cells(const bt_world *w, bt_snapshot *s)
{
    static const cell_names x = {"cells/side_x", "cells/wrap_x", "cells/low_x", "cells/n_x"},
                            y = {"cells/side_y", "cells/wrap_y", "cells/low_y", "cells/n_y"};
    const bt_cells *t = w->cells;
    const bt_bodies *b = &w->bodies;
    double widest = 0;
    bool in_cells = false;
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->large[i]) continue;
        in_cells = true;
        widest = bt_max(widest, b->radius[i]);
    }
    check_direction(s, &x, in_cells, w->par.period_x, t->side_x, t->wrap_x, t->low_x, t->n_x);
    check_direction(s, &y, in_cells, w->par.period_y, t->side_y, t->wrap_y, t->low_y, t->n_y);
    bt_snapshot_want(s, (double)t->n_x * t->n_y <= 4 * (double)(b->n_global - b->n_kept) + 1024, "cells/n_x", -1,
                     "and n_y are more cells than are made for so many floes");
    bt_snapshot_want(s, t->margin_max > 0 && isfinite(t->margin_max), "cells/margin_max", -1, "is no margin");
    // Rounding: another build may have made the radii.
    bt_snapshot_want(s, t->reach >= widest * (1 - 1e-9), "cells/reach", -1,
                     "is less than the radius of a floe");
    double slack = INFINITY;
    if (t->wrap_x != 1) slack = bt_min(slack, t->side_x - 2 * t->reach - t->margin_max);
    if (t->wrap_y != 1) slack = bt_min(slack, t->side_y - 2 * t->reach - t->margin_max);
    bt_snapshot_want(s, slack > 0 && t->allowance == 0.5 * slack, "cells/allowance", -1,
                     "is not what sides, reach and margin leave");
}

// --- bodies, contacts ------------------------------------------------------------------------------------------------

static bool in_box(const bt_cells *t, const int32_t at[2])
{
    return at[0] >= t->low_x && at[0] - t->low_x < t->n_x && at[1] >= t->low_y && at[1] - t->low_y < t->n_y;
}

static void check_bodies(const bt_world *w, bt_snapshot *s)
{
    const bt_bodies *b = &w->bodies;
    for (bt_gid g = 0; g < b->n_global && !s->faulty; g++) {
        const bt_idx i = bt_world_index(w, g);
        if (b->gone[g] || b->large[i] || s->faulty) continue;
        bt_snapshot_want(s, in_box(w->cells, b->cell[i]), "bodies/cell", g, "is outside the box of the cells");
        bt_snapshot_want(s, w->cells->relabel || bt_cells_outside(w, i) <= w->cells->allowance, "bodies/cell", g,
                         "is too far from where the floe is");
    }
}

static bool has_part(const bt_bodies *b, bt_idx i, int part)
{
    for (int p = bt_part_first(b, i); p >= 0; p = bt_part_next(b, i, p))
        if (p == part) return true;
    return false;
}

/// Can bodies i and j have a contact, and a cell that owns it?
static bool can_meet(const bt_world *w, bt_idx i, bt_idx j)
{
    const bt_bodies *b = &w->bodies;
    if (b->motion[i] != BT_DYNAMIC && b->motion[j] != BT_DYNAMIC) return false;
    return b->large[i] || b->large[j] || bt_cells_adjacent(w->cells, b->cell[i], b->cell[j]);
}

static void check_contacts(const bt_world *w, const bt_memory *memory, int64_t n, bt_snapshot *s)
{
    const bt_bodies *b = &w->bodies;
    for (int64_t k = 0; k < n && !s->faulty; k++) {
        const bt_memory *t = &memory[k];
        bt_snapshot_want(s, t->a >= 0 && t->a < t->b && t->b < b->n_global, "contacts/a", k,
                         "and b are no pair of bodies");
        if (!s->faulty) bt_snapshot_want(s, !b->gone[t->a] && !b->gone[t->b], "contacts/a", k, "or b is not there");
        if (s->faulty) return;
        const bt_idx i = bt_world_index(w, t->a), j = bt_world_index(w, t->b);
        bt_snapshot_want(s, can_meet(w, i, j), "contacts/a", k, "and b are bodies that cannot touch");
        bt_snapshot_want(s, has_part(b, i, t->part[0]) && has_part(b, j, t->part[1]), "contacts/part", k,
                         "is no part of its body");
        bt_snapshot_want(s, t->n_points == 1 || t->n_points == 2, "contacts/points", k, "is neither 1 nor 2");
        bt_snapshot_want(s, t->law < BT_LAWS + w->par.added_laws, "contacts/law", k, "is no contact law");
        if (s->faulty) return;
        const bool on = t->law == BT_LAW_RIGID || (bt_law_on(&w->par, t->law) && bt_law_applies(w, t->law, i, j));
        bt_snapshot_want(s, on, "contacts/law", k, "is a contact law that does not apply to the pair");
        bt_snapshot_want(s, k == 0 || bt_memory_by_names(t - 1, t) < 0, "contacts/a", k, "is out of order");
    }
}

// --- tow, window, collisions, events ---------------------------------------------------------------------------------

static void check_tow(const bt_world *w, bt_snapshot *s)
{
    const bt_tow *t = w->tow;
    bt_snapshot_want(s, t->time == (double)w->step * t->dt, "tow/time", -1, "is not that of the step");
    bt_snapshot_want(s, t->mark >= 0 && t->mark <= t->path.n_marks, "tow/mark", -1,
                     "is no number of way-points passed");
}

/// Places of floes that enter a window are found from the drift.
static void check_undisturbed(const bt_world *w, bt_snapshot *s)
{
    const bt_undisturbed *v = w->undisturbed;
    if (!w->window) return;
    bt_snapshot_want(s, fabs(v->drift_x) <= FAR * w->par.period_x, "undisturbed/drift_x", -1, "is out of range");
    bt_snapshot_want(s, !(w->par.period_y > 0) || fabs(v->drift_y) <= FAR * w->par.period_y, "undisturbed/drift_y",
                     -1, "is out of range");
}

static bool is_gid(double x, bt_gid n) { return x >= 0 && x < (double)n && x == floor(x); }

static void check_impacts(const bt_world *w, bt_snapshot *s)
{
    const bt_impacts *m = w->impacts;
    const bt_gid n = w->bodies.n_global;
    for (int64_t k = 0; k < m->n_open && !s->faulty; k++) {
        const bt_impact *e = &m->open[k].so_far;
        bt_snapshot_want(s, is_gid(e->gid, n) && (k == 0 || m->open[k - 1].so_far.gid < e->gid), "impacts/open", k,
                         "is no collision, or out of order");
        const double real[] = {
            e->time, e->x, e->y, e->impulse, e->approach, e->mass, e->thickness, m->open[k].rest, m->open[k].largest};
        bt_snapshot_want(s, bt_state_finite(real, sizeof real / sizeof *real) && e->impulse >= 0, "impacts/open", k,
                         "is not finite");
    }
}

static void check_events(const bt_world *w, bt_snapshot *s)
{
    for (int64_t k = 0; k < w->events.n && !s->faulty; k++) {
        const bt_event *e = &w->events.event[k];
        bt_snapshot_want(s, e->kind >= 0 && e->kind < BT_EVENT_KINDS, "events/kind", k, "is no kind of event");
    }
}

// --- floes that split ------------------------------------------------------------------------------------------------

/// A floe that splits is there, its pieces have outlines, and they share its area.
static void check_split(const bt_world *w, const bt_split_record *r, int64_t k, const double *v, uint8_t *there,
                        bt_snapshot *s)
{
    const bt_splitting *p = w->splitting;
    const bool known = r->parent >= 0 && r->parent < w->bodies.n_global && there[r->parent];
    bt_snapshot_want(s, known, "splits/parent", k, "is no floe that is there");
    bt_snapshot_want(s, r->step < w->step && r->mode >= BT_SPLIT_NEAR && r->mode <= BT_SPLIT_BURST, "splits/mode", k,
                     "is no split of the steps done");
    if (s->faulty) return;
    const bool piece = r->parent >= p->first && r->parent < p->first + p->reserve;
    bt_snapshot_want(s, (r->corners[2] == 0) == piece && (r->generation == 1) == !piece, "splits/generation", k,
                     "does not fit the floe");
    for (int i = 0; i < 3 && !s->faulty && r->corners[i] > 0; v += 2 * r->corners[i++])
        bt_snapshot_want(s, !bt_outline_fault((int)r->corners[i], v), "splits/vertices", k, "are no outline of a floe");
    there[r->parent] = 0;
    there[p->first + 2 * k] = there[p->first + 2 * k + 1] = 1;
}

void bt_state_check_splits(const bt_world *w, const bt_split_record *rows, int64_t n, const double *vertex,
                           int64_t n_vertices, bt_snapshot *s)
{
    const bt_splitting *p = w->splitting;
    int64_t at = 0;
    bt_snapshot_want(s, 2 * n <= p->reserve, "splits/parent", -1, "has more rows than ids are kept for");
    for (int64_t k = 0; k < n && !s->faulty; k++) {
        const int64_t *c = rows[k].corners;
        for (int i = 0; i < 3; i++)
            bt_snapshot_want(s, (c[i] >= 3 || (i == 2 && c[i] == 0)) && c[i] <= BT_MAX_VERTICES, "splits/corners", k,
                             "is no number of vertices");
        at += s->faulty ? 0 : c[0] + c[1] + c[2];
        bt_snapshot_want(s, at <= n_vertices, "splits/corners", k, "are more vertices than there are");
    }
    bt_snapshot_want(s, at == n_vertices, "splits/vertices", -1, "are more than the outlines have");
    uint8_t *there = bt_alloc((size_t)w->bodies.n_global, 1);
    for (bt_gid g = 0; g < w->bodies.n_global; g++) there[g] = !w->bodies.gone[g];
    for (int64_t k = 0; k < n && !s->faulty; k++) {
        check_split(w, &rows[k], k, vertex, there, s);
        vertex += 2 * (rows[k].corners[0] + rows[k].corners[1] + rows[k].corners[2]);
    }
    free(there);
}

// --- the whole -------------------------------------------------------------------------------------------------------

void bt_state_check(const bt_world *w, const bt_memory *memory, int64_t n, bool impacts, bt_snapshot *s)
{
    if (s->faulty) return; // then arrays are missing
    check_cells(w, s);
    if (!s->faulty) check_bodies(w, s);
    if (!s->faulty) check_contacts(w, memory, n, s);
    if (w->tow && !s->faulty) check_tow(w, s);
    if (w->undisturbed && !s->faulty) check_undisturbed(w, s);
    if (impacts && !s->faulty) check_impacts(w, s);
    check_events(w, s);
}
