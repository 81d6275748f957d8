// SPDX-License-Identifier: MIT
// The state of a world as named arrays: bodies by id, cells, contacts, tow, window, collisions, events.
#include "output/state.h"

#include <inttypes.h>
#include <string.h>

#include "bergtow/contact.h"
#include "contact/law.h"
#include "force/forces.h"
#include "force/laws.h"
#include "space/cells.h"
#include "tow/tow.h"
#include "step/splitting.h"
#include "step/window.h"
#include "partition/domain.h"
#include "base/inside.h"

#define ADDED_LAWS "contacts/added_laws"
#define ADDED_FORCES "forces/added_laws"

// --- the tables ------------------------------------------------------------------------------------------------------

#define WORLD(type, member, units, check, meaning) BT_STATE_ONE(bt_world, #member, type, member, units, check, meaning)
static const bt_state_row world_rows[] = {
    WORLD(I64, step, "1", COUNT, "steps done"),
    WORLD(F64, drift_x, "m", FINITE, "distance that the water has moved, x"),
    WORLD(F64, drift_y, "m", FINITE, "distance that the water has moved, y"),
};

#define PAR(member, units, check, meaning) BT_STATE_ONE(bt_params, #member, F64, member, units, check, meaning)
/// Parameters: of the last step if they change with time; the others show that the case is that of the checkpoint.
static const bt_state_row par_rows[] = {
    PAR(dt, "s", FINITE, "time step"),
    PAR(x0, "m", FINITE, "low corner of the domain, x"),
    PAR(y0, "m", FINITE, "low corner of the domain, y"),
    PAR(period_x, "m", FINITE, "length of the domain where x is periodic, 0 = it is not"),
    PAR(period_y, "m", FINITE, "length of the domain where y is periodic, 0 = it is not"),
    PAR(tolerance, "m/s", FINITE, "residual at which the solver stops"),
    PAR(slop, "m", FINITE, "overlap that is tolerated"),
    PAR(size, "m", FINITE, "mean floe diameter"),
    PAR(water_u, "m/s", FINITE, "velocity of the water in the last step, x"),
    PAR(water_v, "m/s", FINITE, "velocity of the water in the last step, y"),
    PAR(air_u, "m/s", FINITE, "velocity of the air in the last step, x"),
    PAR(air_v, "m/s", FINITE, "velocity of the air in the last step, y"),
    PAR(coriolis, "1/s", FINITE, "Coriolis parameter with the sign of the frame"),
    PAR(balance_u, "m/s", FINITE, "velocity in geostrophic balance with the tilt, x"),
    PAR(balance_v, "m/s", FINITE, "velocity in geostrophic balance with the tilt, y"),
    PAR(tilt_ax, "m/s2", FINITE, "acceleration by the tilt of the sea surface beyond that balance, x"),
    PAR(tilt_ay, "m/s2", FINITE, "acceleration by the tilt of the sea surface beyond that balance, y"),
};

#define CELLS(type, member, units, check, meaning) BT_STATE_ONE(bt_cells, #member, type, member, units, check, meaning)
static const bt_state_row cells_rows[] = {
    CELLS(F64, x0, "m", FINITE, "low corner of the grid of cells, x"),
    CELLS(F64, y0, "m", FINITE, "low corner of the grid of cells, y"),
    CELLS(F64, side_x, "m", FINITE, "side of a cell, x"),
    CELLS(F64, side_y, "m", FINITE, "side of a cell, y"),
    CELLS(F64, allowance, "m", ANY, "how far a centroid may be outside its cell"),
    BT_STATE_ONE(bt_cells, "reach", F64, max_radius, "m", NOT_NEGATIVE, "largest radius of a floe"),
    CELLS(F64, heaviest, "kg", NOT_NEGATIVE, "mass of the heaviest floe"),
    CELLS(U8, rebounds, "1", ANY, "1 = some body has a restitution"),
    CELLS(F64, margin_max, "m", ANY, "largest margin of the search for pairs that the cells allow"),
    CELLS(I32, low_x, "1", ANY, "first cell, x"),
    CELLS(I32, low_y, "1", ANY, "first cell, y"),
    CELLS(I32, n_x, "1", ANY, "cells, x"),
    CELLS(I32, n_y, "1", ANY, "cells, y"),
    CELLS(I32, wrap_x, "1", ANY, "cells of a period, x; 0 = not periodic"),
    CELLS(I32, wrap_y, "1", ANY, "cells of a period, y; 0 = not periodic"),
    CELLS(U8, relabel, "1", ANY, "1 = the cells are to be labelled again"),
    CELLS(I64, n_labellings, "1", COUNT, "times that the cells were labelled"),
};

#define TOW(type, member, units, check, meaning) BT_STATE_ONE(bt_tow, #member, type, member, units, check, meaning)
#define BRANCH(label, type, k, member, units, check, meaning) \
    BT_STATE_ONE(bt_tow, label, type, branch[k].member, units, check, meaning)
#define VESSEL(member, units, check, meaning) \
    BT_STATE_ONE(bt_tow, "vessel_" #member, F64, vessel.member, units, check, meaning)
static const bt_state_row tow_rows[] = {
    TOW(F64, time, "s", ANY, "time of the tow"),
    TOW(F64, carriage_x, "m", FINITE, "towing end of the line, x"),
    TOW(F64, carriage_y, "m", FINITE, "towing end of the line, y"),
    TOW(F64, travel_x, "m", FINITE, "position of the towed body, not wrapped, x"),
    TOW(F64, travel_y, "m", FINITE, "position of the towed body, not wrapped, y"),
    TOW(F64, way, "m", FINITE, "distance of the towing end, or of the towed body, along its path"),
    TOW(I32, mark, "1", ANY, "way-points passed"),
    TOW(F64, ux, "1", FINITE, "direction of the tow, x"),
    TOW(F64, uy, "1", FINITE, "direction of the tow, y"),
    BRANCH("impulse_1", F64, 0, lambda, "N s", FINITE, "impulse of the first branch in the last step"),
    BRANCH("taut_1", U8, 0, taut, "1", ANY, "1 = the first branch is taut"),
    BRANCH("broken_1", U8, 0, broken, "1", ANY, "1 = the first branch has parted"),
    BRANCH("impulse_2", F64, 1, lambda, "N s", FINITE, "impulse of the second branch in the last step"),
    BRANCH("taut_2", U8, 1, taut, "1", ANY, "1 = the second branch is taut"),
    BRANCH("broken_2", U8, 1, broken, "1", ANY, "1 = the second branch has parted"),
    VESSEL(vx, "m/s", FINITE, "velocity of the vessel, x"),
    VESSEL(vy, "m/s", FINITE, "velocity of the vessel, y"),
    VESSEL(way, "m", FINITE, "distance of the vessel along the path"),
};

#define WINDOW(type, width, member, units, axes, check, meaning) \
    BT_STATE_MEMBER(bt_window, #member, type, width, member, units, axes, check, meaning)
static const bt_state_row window_rows[] = {
    WINDOW(F64, 1, start, "m", "one", FINITE, "place of the rear end at first, along the tow"),
    WINDOW(I64, 1, renewed, "1", "one", COUNT, "floes renewed in all"),
    WINDOW(I64, 1, kept, "1", "one", COUNT, "floes that came round unchanged, in all"),
    WINDOW(I64, 1, missed, "1", "one", COUNT, "places ahead that stayed empty, in all"),
    WINDOW(I64, 1, waiting, "1", "one", COUNT, "floes that waited to be renewed when the window last moved"),
    WINDOW(I64, 1, renewed_now, "1", "one", COUNT, "floes renewed in the last step"),
    WINDOW(F64, 3, dropped, "kg m/s, kg m/s, J", "one momentum_energy", FINITE,
        "momentum x, y and kinetic energy of the floes taken out, in all"),
    WINDOW(F64, 3, brought, "kg m/s, kg m/s, J", "one momentum_energy", FINITE,
        "momentum x, y and kinetic energy of the floes brought in, in all"),
    WINDOW(F64, 1, most, "m", "one", FINITE, "largest distance of the body through undisturbed ice, along the tow"),
    WINDOW(F64, 1, overtaken, "m", "one", FINITE, "largest distance that the body fell behind that"),
    BT_STATE_ONE(bt_window, "rear_in_ice", F64, rear, "m", FINITE,
        "place of the rear end now, along the tow, in a frame that drifts with undisturbed ice"),
};

#define UNDISTURBED(width, member, units, axes, check, meaning) \
    BT_STATE_MEMBER(bt_undisturbed, #member, F64, width, member, units, axes, check, meaning)
static const bt_state_row undisturbed_rows[] = {
    UNDISTURBED(1, drift_x, "m", "one", FINITE, "distance that the undisturbed ice has moved, x"),
    UNDISTURBED(1, drift_y, "m", "one", FINITE, "distance that the undisturbed ice has moved, y"),
    UNDISTURBED(4, vel, "m/s, m/s, rad/s, 1", "one motion", FINITE,
        "velocity of the undisturbed ice, x, y, turning; the last is unused"),
};

#define SPLIT_TOTAL(label, type, member, key_, units_, check, meaning_) \
    {label, BT_ITEM_##type, 1, offsetof(bt_split_totals, member), units_, meaning_, "one", BT_ROW_##check, \
     "splitting." key_}
const bt_state_row bt_split_total_rows[] = {
    SPLIT_TOTAL("near", I64, by_mode[BT_SPLIT_OPENED], "near", "1", COUNT, "splits by a crack opened at a contact"),
    SPLIT_TOTAL("far", I64, by_mode[BT_SPLIT_BENT], "far", "1", COUNT, "splits by bending"),
    SPLIT_TOTAL("burst", I64, by_mode[BT_SPLIT_BURST], "burst", "1", COUNT,
        "splits by bursting under a load along the crack"),
    SPLIT_TOTAL("steps", I64, steps, "steps", "1", COUNT, "steps with a split"),
    SPLIT_TOTAL("crack_length", F64, crack_length, "crack_length_m", "m", NOT_NEGATIVE, "length of all cracks"),
    SPLIT_TOTAL("work", F64, work, "fracture_work_j", "J", NOT_NEGATIVE,
        "work of fracture, which is not taken from the motion: toughness squared / modulus, times the cracks' areas"),
    SPLIT_TOTAL("deferred", I64, deferred, "deferred", "1", COUNT,
        "times a floe was left to the next step after the last round: its load may be too high"),
    SPLIT_TOTAL("too_small", I64, refused_size, "refused_size", "1", COUNT,
        "times a floe was kept whole because a piece would have been too small or too slender"),
    SPLIT_TOTAL("too_old", I64, refused_generation, "refused_generation", "1", COUNT,
        "times a floe of the last generation was kept whole"),
    SPLIT_TOTAL("rafted", I64, refused_rafted, "refused_rafted", "1", COUNT,
        "times a floe was kept whole that lay over or under others"),
    SPLIT_TOTAL("no_id", I64, refused_reserve, "refused_reserve", "1", COUNT,
        "times a floe was kept whole because no ids were left"),
    SPLIT_TOTAL("unconverged", I64, unconverged, "unconverged_steps", "1", COUNT,
        "steps that did not converge, and so split nothing"),
    SPLIT_TOTAL("largest_refused", F64, largest_refused, "largest_refused_ratio", "1", NOT_NEGATIVE,
        "largest stress over strength of a floe that could not split"),
};
const int bt_n_split_total_rows = BT_N_OF(bt_split_total_rows);

#define SPLIT(type, width, member, units, axes, check, meaning) \
    BT_STATE_MEMBER(bt_split_record, #member, type, width, member, units, axes, check, meaning)
static const bt_state_row split_columns[] = {
    SPLIT(I64, 1, step, "1", "split", COUNT, "steps done before the one in which each floe split"),
    SPLIT(I64, 1, parent, "1", "split", COUNT, "id of the floe"),
    SPLIT(I64, 1, generation, "1", "split", COUNT, "generation of the pieces"),
    SPLIT(I64, 1, mode, "1", "split", COUNT,
        "1 = crack opened at a contact, 2 = bent, 3 = burst under a load along the crack"),
    SPLIT(F64, 2, near, "m", "split xy", FINITE, "end of the crack at the load"),
    SPLIT(F64, 2, far, "m", "split xy", FINITE, "other end of the crack"),
    SPLIT(F64, 1, thickness, "m", "split", NOT_NEGATIVE, "thickness of the floe"),
    SPLIT(F64, 1, ratio, "1", "split", NOT_NEGATIVE, "stress over strength"),
    SPLIT(F64, 2, area, "m2", "split piece", NOT_NEGATIVE, "areas of the pieces"),
    SPLIT(F64, 2, polar, "m4", "split piece", NOT_NEGATIVE, "second moments of area of the pieces, polar"),
    SPLIT(F64, 4, at, "m", "split piece_xy", FINITE, "centroids of the pieces in the frame of the floe"),
    SPLIT(I64, 3, corners, "1", "split outline", COUNT,
        "vertices of the outlines of the pieces, and of the floe if it was there from the start"),
};

enum {
    IMPACT_WIDTH = sizeof(bt_impact) / sizeof(double),
    OPEN_WIDTH = sizeof(bt_impact_open) / sizeof(double),
    PANEL_WIDTH = sizeof(bt_panel) / sizeof(double)
};

// --- bodies ----------------------------------------------------------------------------------------------------------

/// State that a body carries from step to step. All else follows from the case and
/// the field.
typedef struct {
    double pose[3], vel[3], path, exposure[3];
    int32_t cell[2], copy, lap;
    int64_t disturbed;
} body_row;

/// Its columns in the file.
#define BODY(label, type, width, member, units, axes, check, meaning) \
    BT_STATE_MEMBER(body_row, label, type, width, member, units, axes, check, meaning)
static const bt_state_row body_columns[] = {
    BODY("pose", F64, 3, pose, "m, m, rad", "body component", FINITE, "x, y, yaw of every body, by id"),
    BODY("velocity", F64, 3, vel, "m/s, m/s, rad/s", "body component", FINITE,
        "velocity of every body, x, y and turning"),
    BODY("path", F64, 1, path, "m", "body", NOT_NEGATIVE,
        "length of path of the fastest point of the outline, through the water's frame"),
    BODY("exposure", F64, 3, exposure, "1", "body component", SHARE,
        "fraction of a floe's drag that remains beside its neighbours: skin, form in water, form in air"),
    BODY("cell", I32, 2, cell, "1", "body xy", ANY, "cell of each body, x and y"),
    BODY("copy", I32, 1, copy, "1", "body", FAR, "which repetition of the place, in lengths of the period along x"),
    BODY("lap", I32, 1, lap, "1", "body", FAR, "periods along x that the body lies above its pose, which is wrapped"),
    BODY("disturbed", I64, 1, disturbed, "1", "body", YES_OR_NO, "1 = disturbed since it came to rest"),
};

static body_row row_of(const bt_bodies *bodies, bt_idx i)
{
    return (body_row){
        .pose = {bodies->pose[i].x, bodies->pose[i].y, bodies->pose[i].yaw},
        .vel = {bodies->vel[i].x, bodies->vel[i].y, bodies->vel[i].w},
        .path = bodies->path[i],
        .exposure = {bodies->exposure[i].skin, bodies->exposure[i].water_form, bodies->exposure[i].air_form},
        .cell = {bodies->cell[i][0], bodies->cell[i][1]},
        .copy = bodies->home ? bodies->home[i].copy : 0,
        .lap = bodies->lap[i],
        .disturbed = bodies->disturbed[i],
    };
}

static void put_row(bt_world *world, bt_idx i, const body_row *row)
{
    bt_bodies *bodies = &world->bodies;
    bodies->pose[i] = (bt_pose){.x = row->pose[0], .y = row->pose[1], .yaw = row->pose[2]};
    bt_bodies_turn(&world->bodies, i);
    bodies->vel[i] = (bt_vel){.x = row->vel[0], .y = row->vel[1], .w = row->vel[2]};
    bodies->path[i] = row->path;
    bodies->exposure[i] = (bt_exposure){row->exposure[0], row->exposure[1], row->exposure[2]};
    bodies->cell[i][0] = row->cell[0];
    bodies->cell[i][1] = row->cell[1];
    if (bodies->home) bodies->home[i].copy = row->copy;
    bodies->lap[i] = row->lap;
    bodies->disturbed[i] = row->disturbed != 0;
}

/// Copy a column of rows of `size` bytes to or from a separate array.
static void column(const bt_state_row *row, char *rows, size_t size, int64_t n, char *array, bool out)
{
    const size_t bytes = bt_item_size(row->type) * (size_t)row->width;
    for (int64_t i = 0; i < n; i++) {
        char *in_row = rows + (size_t)i * size + row->offset, *in_array = array + (size_t)i * bytes;
        memcpy(out ? in_array : in_row, out ? in_row : in_array, bytes);
    }
}

/// Rows from which a column is copied at a time.
enum { PORTION = 4096 };

static void save_columns(bt_snapshot *snap, const char *group, const bt_state_row *columns, int n_columns, void *rows,
                         size_t size, int64_t n)
{
    for (int k = 0; k < n_columns; k++) {
        bt_snapshot_begin_row(snap, group, &columns[k], n);
        char *portion = bt_alloc(PORTION * (size_t)columns[k].width, bt_item_size(columns[k].type));
        if (n == 0) bt_snapshot_put(snap, 0, portion);
        for (int64_t i = 0; i < n; i += PORTION) {
            const int64_t now = n - i < PORTION ? n - i : PORTION;
            column(&columns[k], (char *)rows + (size_t)i * size, size, now, portion, true);
            bt_snapshot_put(snap, now, portion);
        }
        free(portion);
    }
}

/// Load columns as rows in new memory. n < 0: any number of rows.
static void *load_columns(bt_snapshot *snap, const char *group, const bt_state_row *columns, int n_columns, size_t size,
                          int64_t *n)
{
    char name[64];
    snprintf(name, sizeof name, "%s/%s", group, columns[0].name);
    if (*n < 0) *n = bt_snapshot_rows(snap, name);
    char *rows = bt_alloc((size_t)*n, size);
    for (int k = 0; k < n_columns; k++) {
        char *array = bt_alloc((size_t)*n * (size_t)columns[k].width, bt_item_size(columns[k].type));
        bt_snapshot_take_row(snap, group, &columns[k], *n, array);
        column(&columns[k], rows, size, *n, array, false);
        free(array);
    }
    return rows;
}

/// Column by column: rows of all bodies at once would be the largest thing in memory on rank 0, twice.
static bt_status save_bodies(const bt_world *world, const bt_comm *comm, bt_snapshot *snap, bt_errors *err)
{
    const bt_bodies *bodies = &world->bodies;
    const int64_t count = comm->rank == 0 ? bodies->n_global : 0;
    bt_idx n = 0;
    // every id has a row, also floes that have split and future pieces: zeros, from rank 0
    const size_t most = (size_t)(world->splitting ? bodies->n_global : bodies->n);
    bt_gid *gid = bt_alloc(most, sizeof *gid);
    bt_idx *body = bt_alloc(most, sizeof *body);
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (!bt_domain_owns(world, i)) continue;
        gid[n] = bodies->gid[i];
        body[n++] = i;
    }
    for (bt_gid g = 0; g < bodies->n_global && world->splitting && comm->rank == 0; g++) {
        if (!bodies->gone[g]) continue;
        gid[n] = g;
        body[n++] = -1;
    }
    int64_t *first = bt_alloc((size_t)comm->size + 1, sizeof *first);
    for (int k = 1; k <= comm->size; k++) first[k] = bodies->n_global; // all to rank 0
    bt_status status = BT_OK;
    for (int k = 0; k < BT_N_OF(body_columns) && status == BT_OK; k++) {
        bt_state_row in_row = body_columns[k];
        const size_t bytes = bt_item_size(in_row.type) * (size_t)in_row.width, width = (bytes + 7) / 8;
        double *mine = bt_alloc((size_t)n, width * sizeof *mine), *all = bt_alloc((size_t)count, width * sizeof *all);
        for (bt_idx i = 0; i < n; i++) {
            const body_row row = body[i] < 0 ? (body_row){0} : row_of(bodies, body[i]);
            memcpy(mine + (size_t)i * width, (const char *)&row + in_row.offset, bytes);
        }
        status = bt_comm_rows_by_gid(comm, first, n, gid, (int)width, mine, all, err);
        free(mine);
        in_row.offset = 0;
        if (status == BT_OK && comm->rank == 0)
            save_columns(snap, "bodies", &in_row, 1, all, width * sizeof *all, count);
        free(all);
    }
    BT_FREE(first, body, gid);
    return status;
}

static void load_bodies(bt_world *world, bt_snapshot *snap)
{
    int64_t n = world->bodies.n_global;
    body_row *rows = load_columns(snap, "bodies", body_columns, BT_N_OF(body_columns), sizeof *rows, &n);
    for (bt_gid g = 0; g < n && !snap->faulty; g++)
        if (!world->bodies.gone[g]) put_row(world, bt_world_index(world, g), &rows[g]);
    free(rows);
}

// --- floes that split ------------------------------------------------------------------------------------------------

static void save_splitting(const bt_splitting *splitting, bt_snapshot *snap)
{
    bt_snapshot_add_rows(snap, "splitting", bt_split_total_rows, bt_n_split_total_rows, &splitting->total);
    save_columns(snap, "splits", split_columns, BT_N_OF(split_columns), splitting->split, sizeof *splitting->split,
                 splitting->n);
    bt_snapshot_add(snap, "splits/vertices", BT_ITEM_F64, splitting->n_vertices, 2, splitting->vertex);
}

/// Load the history, and put pieces in place of the floes that have split.
static void load_splitting(bt_world *world, bt_snapshot *snap)
{
    bt_splitting *splitting = world->splitting;
    int64_t n = -1, n_vertices = 0, at = 0;
    bt_snapshot_take_rows(snap, "splitting", bt_split_total_rows, bt_n_split_total_rows, &splitting->total);
    bt_split_record *rows = load_columns(snap, "splits", split_columns, BT_N_OF(split_columns), sizeof *rows, &n);
    double *vertex = bt_snapshot_copy(snap, "splits/vertices", BT_ITEM_F64, 2, &n_vertices);
    if (!snap->faulty) bt_state_check_splits(world, rows, n, vertex, n_vertices, snap);
    for (int64_t k = 0; k < n && !snap->faulty; k++) {
        bt_splitting_append(splitting, &rows[k], vertex + 2 * at);
        at += rows[k].corners[0] + rows[k].corners[1] + rows[k].corners[2];
    }
    free(rows);
    free(vertex);
    if (!snap->faulty) bt_splitting_restore(world);
}

// --- contacts --------------------------------------------------------------------------------------------------------

enum { MEMORY_WIDTH = sizeof(bt_memory) / sizeof(double) };
_Static_assert(sizeof(bt_memory) % sizeof(double) == 0, "a record is a row of doubles");

#define MEMORY(label, type, width, member, units, axes, check, meaning) \
    BT_STATE_MEMBER(bt_memory, label, type, width, member, units, axes, check, meaning)
static const bt_state_row memory_columns[] = {
    MEMORY("a", I64, 1, a, "1", "contact", ANY, "id of the first body of each contact"),
    MEMORY("b", I64, 1, b, "1", "contact", ANY, "id of the second body of each contact"),
    MEMORY("part", U16, 2, part, "1", "contact body_of_pair", ANY, "convex part of each of the two bodies"),
    MEMORY("points", I32, 1, n_points, "1", "contact", ANY, "contact points, 1 or 2"),
    MEMORY("feature", U32, 2, feature, "1", "contact contact_point", ANY,
        "edge or corner by which a point is known again"),
    MEMORY("value", F64, 4, value, "1", "contact memory", FINITE,
        "numbers that the law keeps, in its own units (N s for impulses)"),
    MEMORY("law", U16, 1, law, "1", "contact", ANY, "index of the contact law that has the memory"),
};

/// Clear the numbers of a missing second point, which are stale: states with the same future must look the same.
static void blank(bt_memory *memory)
{
    if (memory->n_points < 2) memory->feature[1] = 0, memory->value[1] = 0;
}

/// Names of the added laws, in the order of their numbers; "" without any. The caller frees it.
static char *added_laws(const bt_world *world)
{
    bt_text text;
    bt_text_begin(&text);
    for (int k = 0; k < world->par.added_laws; k++)
        fprintf(text.out, "%s%s", k ? ", " : "", bt_contact_law_of(k)->name);
    return bt_text_end(&text);
}

/// Check the added laws: records name their law by its number, which follows from the order of registration.
static void check_added_laws(const bt_world *world, bt_snapshot *snap)
{
    if (!bt_snapshot_find(snap, ADDED_LAWS)) return; // none
    const char *then = bt_snapshot_text(snap, ADDED_LAWS);
    char *now = added_laws(world);
    if (strcmp(now, then) && snap->err)
        bt_errors_add(snap->err,
                      "%s: the run had the added contact laws %s, in this order, but this program has %s; continue in "
                      "a program that registers the same laws in the same order",
                      snap->path, then, *now ? now : "none");
    snap->faulty |= strcmp(now, then) != 0;
    free(now);
}

/// Names of the added force laws that have acted, in the order in which they add.
static char *added_forces(const bt_forces *forces)
{
    bt_text text;
    bt_text_begin(&text);
    const char *comma = "";
    for (int k = BT_LISTED_LAWS; k < forces->n; k++) {
        if (!forces->acted[k]) continue;
        fprintf(text.out, "%s%s", comma, bt_force_laws[k]->name);
        comma = ", ";
    }
    return bt_text_end(&text);
}

/// Check the added forces: without one the run would be another run, and another order of sums would change bits.
/// Further forces may be added.
static void load_added_forces(bt_forces *forces, bt_snapshot *snap)
{
    if (!bt_snapshot_find(snap, ADDED_FORCES)) return; // none
    const char *then = bt_snapshot_text(snap, ADDED_FORCES), *next = then;
    for (int k = BT_LISTED_LAWS; k < forces->n && *next; k++) {
        const size_t n = strlen(bt_force_laws[k]->name);
        if (bt_force_is_released(bt_force_laws[k]) || strncmp(next, bt_force_laws[k]->name, n)) continue;
        if (next[n] && next[n] != ',') continue;
        forces->acted[k] = true;
        next += next[n] ? n + 2 : n;
    }
    if (!*next) return;
    if (snap->err)
        bt_errors_add(snap->err,
                      "%s: the run had %s, which a program had added (force laws, in this order); continue in a new "
                      "process that adds the same laws in the same order, before any other",
                      snap->path, then);
    snap->faulty = true;
}

static void save_contacts(const bt_world *world, const bt_comm *comm, bt_snapshot *snap)
{
    int64_t n, all;
    bt_memory *memory = bt_cells_take_memory(world, &n);
    all = n;
    if (comm->size > 1) {
        bt_memory *mine = memory;
        memory = (bt_memory *)(void *)bt_comm_gather(comm, n, MEMORY_WIDTH, (const double *)(const void *)mine, &all);
        free(mine);
    }
    if (comm->rank == 0) {
        if (all > 0) qsort(memory, (size_t)all, sizeof *memory, bt_memory_by_names);
        for (int64_t k = 0; k < all; k++) blank(&memory[k]);
        save_columns(snap, "contacts", memory_columns, BT_N_OF(memory_columns), memory, sizeof *memory, all);
        char *laws = added_laws(world);
        if (*laws) bt_snapshot_add_text(snap, ADDED_LAWS, laws);
        free(laws);
    }
    free(memory);
}

// --- collisions, events ----------------------------------------------------------------------------------------------

#define EVENT(member, type, units, axes, check, meaning) \
    BT_STATE_MEMBER(bt_event, #member, type, 1, member, units, axes, check, meaning)
static const bt_state_row event_columns[] = {
    EVENT(time, F64, "s", "time", FINITE, "end of the step of each event"),
    EVENT(kind, I64, "1", "time", ANY, "kind of each event"),
    EVENT(subject, I64, "1", "time", COUNT, "branch or way-point, from 1"),
    EVENT(value, F64, "1", "time", FINITE, "tension N, speed m/s or way m, by its kind"),
};

// --- the whole -------------------------------------------------------------------------------------------------------

bt_status bt_state_save(const bt_world *world, const bt_comm *comm, bt_snapshot *snap, bt_errors *err)
{
    const uint64_t hash = bt_world_hash(world);
    const bt_status status = save_bodies(world, comm, snap, err);
    save_contacts(world, comm, snap);
    if (comm->rank != 0) return status;
    char *forces = added_forces(world->forces);
    if (*forces) bt_snapshot_add_text(snap, ADDED_FORCES, forces);
    free(forces);
    bt_snapshot_add_rows(snap, "world", world_rows, BT_N_OF(world_rows), world);
    bt_snapshot_add_int(snap, "world/hash", (int64_t)hash);
    bt_snapshot_add_rows(snap, "step", par_rows, BT_N_OF(par_rows), &world->par);
    bt_snapshot_add_rows(snap, "cells", cells_rows, BT_N_OF(cells_rows), world->cells);
    if (world->tow) bt_snapshot_add_rows(snap, "tow", tow_rows, BT_N_OF(tow_rows), world->tow);
    if (world->window) bt_snapshot_add_rows(snap, "window", window_rows, BT_N_OF(window_rows), world->window);
    if (world->undisturbed)
        bt_snapshot_add_rows(snap, "undisturbed", undisturbed_rows, BT_N_OF(undisturbed_rows), world->undisturbed);
    if (world->splitting) save_splitting(world->splitting, snap);
    if (world->impacts)
        bt_snapshot_add(snap, "impacts/open", BT_ITEM_F64, world->impacts->n_open, OPEN_WIDTH, world->impacts->open);
    save_columns(snap, "events", event_columns, BT_N_OF(event_columns), world->events.event,
                 sizeof *world->events.event, world->events.n);
    return status;
}

/// The first row with a NaN or an infinity.
static const char *rows_not_finite(const char *group, const bt_state_row *row, int n_rows, const void *base,
                                   char name[64])
{
    for (int k = 0; base && k < n_rows; k++) {
        if (row[k].type != BT_ITEM_F64 ||
            bt_state_finite((const double *)(const void *)((const char *)base + row[k].offset), row[k].width))
            continue;
        snprintf(name, 64, "%s/%s", group, row[k].name);
        return name;
    }
    return NULL;
}

const char *bt_state_not_finite(const bt_world *world, char name[64])
{
    const char *found = rows_not_finite("world", world_rows, BT_N_OF(world_rows), world, name);
    if (!found) found = rows_not_finite("step", par_rows, BT_N_OF(par_rows), &world->par, name);
    if (!found) found = rows_not_finite("tow", tow_rows, BT_N_OF(tow_rows), world->tow, name);
    if (!found) found = rows_not_finite("window", window_rows, BT_N_OF(window_rows), world->window, name);
    if (!found)
        found = rows_not_finite("undisturbed", undisturbed_rows, BT_N_OF(undisturbed_rows), world->undisturbed, name);
    const bt_impacts *impacts = world->impacts;
    if (found || !impacts) return found;
    if (!bt_state_finite((const double *)(const void *)impacts->closed, impacts->n_closed * IMPACT_WIDTH))
        return "impacts/closed";
    for (int64_t k = 0; k < impacts->n_open; k++)
        if (!bt_state_open_finite(&impacts->open[k])) return "impacts/open";
    return bt_state_finite((const double *)(const void *)impacts->panels.panel, impacts->panels.n * PANEL_WIDTH) ? NULL
                                                                                                : "impacts/panels";
}

/// The constants of the step that follow from the case must be those of the checkpoint. steady: current and wind are
/// constants, too.
static bool same_constants(const bt_params *now, const bt_params *then, bool steady)
{
    const bool fluid = now->water_u == then->water_u && now->water_v == then->water_v && now->air_u == then->air_u &&
                       now->air_v == then->air_v && now->balance_u == then->balance_u &&
                       now->balance_v == then->balance_v && now->tilt_ax == then->tilt_ax &&
                       now->tilt_ay == then->tilt_ay;
    return (fluid || !steady) && now->dt == then->dt && now->x0 == then->x0 && now->y0 == then->y0 &&
           now->period_x == then->period_x && now->period_y == then->period_y && now->tolerance == then->tolerance &&
           now->slop == then->slop && now->size == then->size && now->coriolis == then->coriolis;
}

/// Collisions that may continue. A row of version 0.1.0 ends before `most`, and does not name the panel; there each
/// piece of a shore had its own.
static bt_impact_open *load_open(bt_snapshot *snap, const bt_panels *panels, int64_t *n)
{
    const bt_item *item = bt_snapshot_find(snap, "impacts/open");
    const int width = item && item->width == OPEN_WIDTH - 1 ? OPEN_WIDTH - 1 : OPEN_WIDTH;
    double *rows = bt_snapshot_copy(snap, "impacts/open", BT_ITEM_F64, width, n);
    bt_impact_open *open = bt_alloc((size_t)*n, sizeof *open);
    for (int64_t k = 0; k < *n; k++) {
        open[k].most = 0;
        memcpy(&open[k], rows + k * width, (size_t)width * sizeof *rows);
        if (width < OPEN_WIDTH) open[k].so_far.panel = bt_panels_at(panels, open[k].so_far.x, open[k].so_far.y, 0, 0);
    }
    free(rows);
    return open;
}

bt_status bt_state_load(bt_world *world, const bt_comm *comm, bt_snapshot *snap, bt_errors *err)
{
    const bt_params made = world->par;
    if (!snap->path) snap->path = "checkpoint";
    bt_snapshot_take_rows(snap, "world", world_rows, BT_N_OF(world_rows), world);
    const uint64_t hash = (uint64_t)bt_snapshot_int(snap, "world/hash");
    bt_snapshot_take_rows(snap, "step", par_rows, BT_N_OF(par_rows), &world->par);
    if (world->splitting && !snap->faulty) load_splitting(world, snap);
    load_bodies(world, snap);
    bt_snapshot_take_rows(snap, "cells", cells_rows, BT_N_OF(cells_rows), world->cells);
    if (world->tow) bt_snapshot_take_rows(snap, "tow", tow_rows, BT_N_OF(tow_rows), world->tow);
    if (world->window) bt_snapshot_take_rows(snap, "window", window_rows, BT_N_OF(window_rows), world->window);
    if (world->undisturbed)
        bt_snapshot_take_rows(snap, "undisturbed", undisturbed_rows, BT_N_OF(undisturbed_rows), world->undisturbed);
    if (world->impacts && comm->rank == 0) {
        free(world->impacts->open);
        world->impacts->open = load_open(snap, &world->impacts->panels, &world->impacts->n_open);
    }
    bt_events_free(&world->events);
    world->events.n = -1;
    world->events.event =
        load_columns(snap, "events", event_columns, BT_N_OF(event_columns), sizeof *world->events.event,
                     &world->events.n);
    world->events.cap = world->events.n;
    int64_t n = -1;
    if (!snap->faulty) check_added_laws(world, snap);
    if (!snap->faulty) load_added_forces(world->forces, snap);
    bt_memory *memory = load_columns(snap, "contacts", memory_columns, BT_N_OF(memory_columns), sizeof *memory, &n);
    if (!snap->faulty) bt_state_check(world, memory, n, world->impacts && comm->rank == 0, snap);
    bt_status status = bt_comm_agree(comm, snap->faulty ? BT_ERR_CASE : BT_OK);
    if (status == BT_OK && !same_constants(&made, &world->par, !world->environment))
        status = bt_fail(err, BT_ERR_CASE,
            "%s: this version of the program derives other step constants from the case in this checkpoint; resume "
            "with the version that wrote it",
            snap->path);
    if (status != BT_OK) {
        free(memory);
        return status;
    }
    if (world->impacts && comm->rank == 0) bt_impacts_resume(world);
    bt_domain_create(world, comm);
    bt_cells_restore(world, memory, n);
    if (bt_world_hash(world) == hash) return BT_OK;
    return bt_fail(err, BT_ERR_NUMERIC,
                   "%s: the state read from it does not have the hash that it was saved with, %016" PRIx64
                   "; use the program that wrote it",
                   snap->path, hash);
}
