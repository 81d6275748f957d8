// SPDX-License-Identifier: MIT
// Valid contents of a checkpoint: bounds that the state after any step satisfies.
//
// The checksum shows that a file is as written, not that a run has written it: a file made by hand, or by a faulty
// program, can have a checksum too, and the hash of the state does not cover all of it (labels, impulses, counters).
// Its numbers become indices, lengths of arrays and ends of loops. So each of these is checked against the invariants
// of steps before it is used, and every other real number must be finite. Nothing here is an estimate: a bound that a
// sound run could exceed would make its checkpoint useless.
#include "output/state.h"

#include <math.h>

#include "contact/law.h"
#include "bergtow/outline.h"
#include "bergtow/shape.h"
#include "tow/tow.h"
#include "step/splitting.h"
#include "step/window.h"
#include "case/ice_bounds.h"
#include "base/largest.h"

static const int32_t FAR = 1000000000; // cells, periods: the limit of cell labels (cells.c)

// --- the field -------------------------------------------------------------------------------------------------------

/// Is floe i valid? Less strict than the reader of fields, since outlines have been centred and cut meanwhile.
static bool is_floe(const bt_field *field, bt_idx i)
{
    const int n = (int)(field->offsets[i + 1] - field->offsets[i]);
    const double *v = field->vertices + 2 * field->offsets[i];
    if (!bt_shape_broken(n, v)) return true;
    bt_parts parts;
    return field->outlines.split > 0 && !bt_outline_fault(n, v) && bt_outline_split(n, v, &parts);
}

static void want_ice(bt_snapshot *snap, const char *name, int64_t row, const char *why)
{
    char text[BT_ICE_WHY + 16];
    snprintf(text, sizeof text, "is refused: %s", why); // completes "/field/area, row 3, "
    bt_snapshot_want(snap, false, name, row, text);
}

void bt_state_check_field(const bt_field *field, int64_t n_offsets, int64_t n_vertices, bt_snapshot *snap)
{
    bt_snapshot_want(snap, n_offsets >= 1 && n_offsets <= BT_MAX_FLOES + 1, "field/offsets", -1,
                     "has a number of rows that no field has");
    if (snap->faulty) return;
    bt_snapshot_want(snap, field->offsets[0] == 0 && field->offsets[n_offsets - 1] == n_vertices, "field/offsets", -1,
                     "does not begin with 0 and end with the number of vertices");
    for (int64_t i = 0; i + 1 < n_offsets && !snap->faulty; i++) {
        const int64_t a = field->offsets[i], b = field->offsets[i + 1];
        bt_snapshot_want(snap, a >= 0 && a <= n_vertices && b >= a + 3 && b <= n_vertices && b - a <= BT_MAX_VERTICES,
                         "field/offsets", i, "gives a floe too few or too many vertices");
    }
    static const char *const names[] = {[BT_ICE_THICKNESS] = "field/thickness",
                                        [BT_ICE_POSE] = "field/pose",
                                        [BT_ICE_OUTLINE] = "field/offsets",
                                        [BT_ICE_AREA] = "field/area"};
    double sum = 0, size = 0;
    char why[BT_ICE_WHY];
    for (bt_idx i = 0; i < field->n && !snap->faulty; i++) {
        const int64_t first = field->offsets[i], n = field->offsets[i + 1] - first;
        bt_snapshot_want(snap, bt_state_finite(field->vertices + 2 * first, 2 * n) && is_floe(field, i),
                         "field/offsets", i, "begins an outline that is no floe");
        if (snap->faulty) return;
        const double *p = field->pose + 3 * (size_t)i;
        const bt_ice_floe floe = {(int)n, field->vertices + 2 * first, p[0], p[1], p[2], field->thickness[i],
                                  field->area[i], 1e-6};
        bt_ice_part part;
        const char *fault = bt_ice_floe_fault(&floe, why, &part);
        if (fault) want_ice(snap, names[part], i, fault);
        sum += field->area[i], size += sqrt(4 * field->area[i] / BT_PI);
    }
    if (snap->faulty) return;
    bt_snapshot_want(snap, field->concentration >= 0 && field->concentration <= 1 + 1e-9, "field/concentration", -1,
                     "is not a concentration");
    // Floes outside the ice region, which a field file may contain, do not count in its concentration; a field without
    // floes may have no ice region, and so no area.
    const bool outside = field->outlines.outside_area > 0 || field->outlines.own_area > 0;
    const double within = outside ? bt_min(sum, field->concentration * field->ice_area) : sum;
    if ((field->n > 0 || field->ice_area != 0) &&
        bt_ice_field_fault(true, field->n, size, within, field->ice_area, why))
        want_ice(snap, "field/ice_area", -1, why);
}

// --- cells -----------------------------------------------------------------------------------------------------------

typedef struct {
    const char *side, *wrap, *low, *n;
} cell_names;

/// Check one direction of the cells, as chosen by src/space/cells.c. in_cells: there are floes in them.
static void check_direction(bt_snapshot *snap, const cell_names *name, bool in_cells, double period, double side,
                            int32_t wrap, int32_t low, int32_t n)
{
    bt_snapshot_want(snap, side > 0, name->side, -1, "is not a width of a cell");
    bt_snapshot_want(snap, period > 0 ? wrap == 1 || (wrap >= 4 && wrap % 2 == 0) : wrap == 0, name->wrap, -1,
                     "is not a number of cells around this domain");
    if (snap->faulty) return;
    bt_snapshot_want(snap, wrap == 0 || side == period / wrap, name->side, -1, "does not go round the domain");
    bt_snapshot_want(snap, wrap == 0 ? low >= -FAR && low <= FAR : low == 0, name->low, -1, "is not a place of a cell");
    bt_snapshot_want(snap, n >= 1 && (wrap == 0 || n == wrap || (n == 1 && !in_cells)), name->n, -1,
                     "is not a number of cells");
}

static void check_cells(const bt_world *world, bt_snapshot *snap)
{
    static const cell_names x = {"cells/side_x", "cells/wrap_x", "cells/low_x", "cells/n_x"},
                            y = {"cells/side_y", "cells/wrap_y", "cells/low_y", "cells/n_y"};
    const bt_cells *cells = world->cells;
    const bt_bodies *bodies = &world->bodies;
    double widest = 0;
    bool in_cells = false;
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (bodies->large[i]) continue;
        in_cells = true;
        widest = bt_max(widest, bodies->radius[i]);
    }
    check_direction(snap, &x, in_cells, world->par.period_x, cells->side_x, cells->wrap_x, cells->low_x, cells->n_x);
    check_direction(snap, &y, in_cells, world->par.period_y, cells->side_y, cells->wrap_y, cells->low_y, cells->n_y);
    bt_snapshot_want(snap, (double)cells->n_x * cells->n_y <= 4 * (double)(bodies->n_global - bodies->n_kept) + 1024,
                     "cells/n_x", -1, "and n_y are more cells than are made for so many floes");
    bt_snapshot_want(snap, cells->margin_max > 0 && isfinite(cells->margin_max), "cells/margin_max", -1,
                     "is not a margin");
    // Allow for rounding: another build may have computed the radii.
    bt_snapshot_want(snap, cells->max_radius >= widest * (1 - 1e-9), "cells/reach", -1,
                     "is less than the radius of a floe");
    double slack = INFINITY;
    if (cells->wrap_x != 1) slack = bt_min(slack, cells->side_x - 2 * cells->max_radius - cells->margin_max);
    if (cells->wrap_y != 1) slack = bt_min(slack, cells->side_y - 2 * cells->max_radius - cells->margin_max);
    bt_snapshot_want(snap, slack > 0 && cells->allowance == 0.5 * slack, "cells/allowance", -1,
                     "is not what sides, reach and margin leave");
}

// --- bodies, contacts ------------------------------------------------------------------------------------------------

static bool in_box(const bt_cells *cells, const int32_t at[2])
{
    return at[0] >= cells->low_x && at[0] - cells->low_x < cells->n_x && at[1] >= cells->low_y &&
           at[1] - cells->low_y < cells->n_y;
}

static void check_bodies(const bt_world *world, bt_snapshot *snap)
{
    const bt_bodies *bodies = &world->bodies;
    for (bt_gid g = 0; g < bodies->n_global && !snap->faulty; g++) {
        const bt_idx i = bt_world_index(world, g);
        if (bodies->gone[g] || bodies->large[i] || snap->faulty) continue;
        bt_snapshot_want(snap, in_box(world->cells, bodies->cell[i]), "bodies/cell", g,
                         "is outside the box of the cells");
        bt_snapshot_want(snap, world->cells->relabel || bt_cells_outside(world, i) <= world->cells->allowance,
                         "bodies/cell", g, "is too far from where the floe is");
    }
}

static bool has_part(const bt_bodies *bodies, bt_idx i, int part)
{
    for (int p = bt_part_first(bodies, i); p >= 0; p = bt_part_next(bodies, i, p))
        if (p == part) return true;
    return false;
}

/// Can bodies i and j have a contact, and a cell that owns it?
static bool can_meet(const bt_world *world, bt_idx i, bt_idx j)
{
    const bt_bodies *bodies = &world->bodies;
    if (bodies->motion[i] != BT_DYNAMIC && bodies->motion[j] != BT_DYNAMIC) return false;
    return bodies->large[i] || bodies->large[j] || bt_cells_adjacent(world->cells, bodies->cell[i], bodies->cell[j]);
}

static void check_contacts(const bt_world *world, const bt_memory *memory, int64_t n, bt_snapshot *snap)
{
    const bt_bodies *bodies = &world->bodies;
    for (int64_t k = 0; k < n && !snap->faulty; k++) {
        const bt_memory *t = &memory[k];
        bt_snapshot_want(snap, t->a >= 0 && t->a < t->b && t->b < bodies->n_global, "contacts/a", k,
                         "and b are no pair of bodies");
        if (!snap->faulty)
            bt_snapshot_want(snap, !bodies->gone[t->a] && !bodies->gone[t->b], "contacts/a", k, "or b is not there");
        if (snap->faulty) return;
        const bt_idx i = bt_world_index(world, t->a), j = bt_world_index(world, t->b);
        bt_snapshot_want(snap, can_meet(world, i, j), "contacts/a", k, "and b are bodies that cannot touch");
        bt_snapshot_want(snap, has_part(bodies, i, t->part[0]) && has_part(bodies, j, t->part[1]), "contacts/part", k,
                         "is not a part of its body");
        bt_snapshot_want(snap, t->n_points == 1 || t->n_points == 2, "contacts/points", k, "is neither 1 nor 2");
        bt_snapshot_want(snap, t->law < BT_LAWS + world->par.added_laws, "contacts/law", k, "is not a contact law");
        if (snap->faulty) return;
        const bool on = t->law == BT_LAW_RIGID ||
                        (bt_law_on(&world->par, t->law) && bt_law_applies(world, t->law, i, j));
        bt_snapshot_want(snap, on, "contacts/law", k, "is a contact law that does not apply to the pair");
        bt_snapshot_want(snap, k == 0 || bt_memory_by_names(t - 1, t) < 0, "contacts/a", k, "is out of order");
    }
}

// --- tow, window, collisions, events ---------------------------------------------------------------------------------

static void check_tow(const bt_world *world, bt_snapshot *snap)
{
    const bt_tow *tow = world->tow;
    bt_snapshot_want(snap, tow->time == (double)world->step * tow->dt, "tow/time", -1, "is not that of the step");
    bt_snapshot_want(snap, tow->mark >= 0 && tow->mark <= tow->path.n_marks, "tow/mark", -1,
                     "is not a number of way-points passed");
}

/// Check undisturbed ice: places of floes that enter a window follow from its drift.
static void check_undisturbed(const bt_world *world, bt_snapshot *snap)
{
    const bt_undisturbed *ice = world->undisturbed;
    if (!world->window) return;
    bt_snapshot_want(snap, fabs(ice->drift_x) <= FAR * world->par.period_x, "undisturbed/drift_x", -1,
                     "is out of range");
    bt_snapshot_want(snap, !(world->par.period_y > 0) || fabs(ice->drift_y) <= FAR * world->par.period_y,
                     "undisturbed/drift_y", -1, "is out of range");
}

static bool is_gid(double x, bt_gid n) { return x >= 0 && x < (double)n && x == floor(x); }

bool bt_state_open_finite(const bt_impact_open *o)
{
    const double real[] = {o->so_far.time, o->so_far.x,         o->so_far.y, o->so_far.impulse, o->so_far.approach,
                           o->so_far.mass, o->so_far.thickness, o->rest,     o->largest};
    return bt_state_finite(real, BT_N_OF(real));
}

static void check_impacts(const bt_world *world, bt_snapshot *snap)
{
    const bt_impacts *impacts = world->impacts;
    const bt_gid n = world->bodies.n_global;
    for (int64_t k = 0; k < impacts->n_open && !snap->faulty; k++) {
        const bt_impact *impact = &impacts->open[k].so_far;
        bt_snapshot_want(snap, is_gid(impact->gid, n), "impacts/open", k, "is not a collision");
        bt_snapshot_want(snap, bt_state_open_finite(&impacts->open[k]) && impact->impulse >= 0, "impacts/open", k,
                         "is not finite");
    }
}

static void check_events(const bt_world *world, bt_snapshot *snap)
{
    for (int64_t k = 0; k < world->events.n && !snap->faulty; k++) {
        const bt_event *event = &world->events.event[k];
        bt_snapshot_want(snap, event->kind >= 0 && event->kind < BT_EVENT_KINDS, "events/kind", k,
                         "is not a kind of event");
    }
}

// --- floes that split ------------------------------------------------------------------------------------------------

/// Check a split: its floe exists, the pieces have outlines, and they share its area.
static void check_split(const bt_world *world, const bt_split_record *record, int64_t k, const double *v,
                        uint8_t *there, bt_snapshot *snap)
{
    const bt_splitting *splitting = world->splitting;
    const bool known = record->parent >= 0 && record->parent < world->bodies.n_global && there[record->parent];
    bt_snapshot_want(snap, known, "splits/parent", k, "is not a floe that is there");
    bt_snapshot_want(snap, record->step < world->step && record->mode >= BT_SPLIT_OPENED &&
                     record->mode <= BT_SPLIT_BURST, "splits/mode", k,
                     "is not a split of the steps done");
    if (snap->faulty) return;
    const bool piece = record->parent >= splitting->first && record->parent < splitting->first + splitting->reserve;
    bt_snapshot_want(snap, (record->corners[2] == 0) == piece && (record->generation == 1) == !piece,
                     "splits/generation", k, "does not fit the floe");
    for (int i = 0; i < 3 && !snap->faulty && record->corners[i] > 0; v += 2 * record->corners[i++])
        bt_snapshot_want(snap, !bt_outline_fault((int)record->corners[i], v), "splits/vertices", k,
                         "are not the outline of a floe");
    there[record->parent] = 0;
    there[splitting->first + 2 * k] = there[splitting->first + 2 * k + 1] = 1;
}

void bt_state_check_splits(const bt_world *world, const bt_split_record *rows, int64_t n, const double *vertex,
                           int64_t n_vertices, bt_snapshot *snap)
{
    const bt_splitting *splitting = world->splitting;
    int64_t at = 0;
    bt_snapshot_want(snap, 2 * n <= splitting->reserve, "splits/parent", -1, "has more rows than ids are kept for");
    for (int64_t k = 0; k < n && !snap->faulty; k++) {
        const int64_t *c = rows[k].corners;
        for (int i = 0; i < 3; i++)
            bt_snapshot_want(snap, (c[i] >= 3 || (i == 2 && c[i] == 0)) && c[i] <= BT_MAX_VERTICES, "splits/corners", k,
                             "is not a number of vertices");
        at += snap->faulty ? 0 : c[0] + c[1] + c[2];
        bt_snapshot_want(snap, at <= n_vertices, "splits/corners", k, "are more vertices than there are");
    }
    bt_snapshot_want(snap, at == n_vertices, "splits/vertices", -1, "are more than the outlines have");
    uint8_t *there = bt_alloc((size_t)world->bodies.n_global, 1);
    for (bt_gid g = 0; g < world->bodies.n_global; g++) there[g] = !world->bodies.gone[g];
    for (int64_t k = 0; k < n && !snap->faulty; k++) {
        check_split(world, &rows[k], k, vertex, there, snap);
        vertex += 2 * (rows[k].corners[0] + rows[k].corners[1] + rows[k].corners[2]);
    }
    free(there);
}

// --- the whole -------------------------------------------------------------------------------------------------------

void bt_state_check(const bt_world *world, const bt_memory *memory, int64_t n, bool impacts, bt_snapshot *snap)
{
    if (snap->faulty) return; // arrays are missing
    check_cells(world, snap);
    if (!snap->faulty) check_bodies(world, snap);
    if (!snap->faulty) check_contacts(world, memory, n, snap);
    if (world->tow && !snap->faulty) check_tow(world, snap);
    if (world->undisturbed && !snap->faulty) check_undisturbed(world, snap);
    if (impacts && !snap->faulty) check_impacts(world, snap);
    check_events(world, snap);
}
