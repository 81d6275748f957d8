// SPDX-License-Identifier: MIT
// Parts of a run outside its world as named arrays: the ice field at time zero, its lead, and the stall detection.
#include "output/state.h"

#include <string.h>

#include "partition/domain.h"
#include "step/splitting.h"
#include "base/inside.h"

#define STALL(type, member, units, check, meaning) \
    BT_STATE_ONE(bt_stall, #member, type, member, units, check, meaning)
static const bt_state_row stall_rows[] = {
    STALL(I64, windows, "1", COUNT, "windows of time in which the body stood still"),
    STALL(F64, time, "s", FINITE, "time for which the body stood still"),
    STALL(F64, asked, "m", FINITE, "distance that the tow asked for in the current window of standstill"),
    STALL(F64, spent, "s", FINITE, "time spent in that window"),
    STALL(F64, from_x, "m", FINITE, "position of the body when that window began, x"),
    STALL(F64, from_y, "m", FINITE, "position of the body when that window began, y"),
    STALL(U8, begun, "1", ANY, "1 = a window of standstill has begun"),
    STALL(F64, ice, "N s", FINITE, "impulse of the ice against the tow in that window"),
    STALL(F64, pull, "N s", FINITE, "impulse of the tow in that window"),
    STALL(F64, inside, "s", ANY, "time for which the towing end was inside the hull, after it had been outside"),
    STALL(F64, inside_from, "s", ANY, "time at which the towing end was first inside the hull"),
    STALL(U8, outside, "1", ANY, "1 = the towing end has been outside the hull"),
};

#define LEAD(type, member, units, check, meaning) \
    BT_STATE_ONE(bt_lead_stats, #member, type, member, units, check, meaning)
static const bt_state_row lead_rows[] = {
    LEAD(I32, mode, "1", ANY, "kind of the lead ahead of the body"),
    LEAD(F64, width, "m", ANY, "width of the lead"),
    LEAD(F64, length, "m", ANY, "length of the lead"),
    LEAD(I64, taken, "1", ANY, "floes taken out of the lead"),
    LEAD(F64, area_taken, "m2", ANY, "area of the floes taken out"),
    LEAD(I64, pieces, "1", ANY, "pieces that were put into the lead"),
    LEAD(F64, mean_piece, "m", ANY, "mean size of the pieces"),
    LEAD(F64, concentration_before, "1", ANY, "concentration of the ice before the lead was made"),
    LEAD(F64, concentration_after, "1", ANY, "concentration of the ice after the lead was made"),
};

#define FIELD(type, label, member, units, check, meaning) \
    BT_STATE_ONE(bt_field, label, type, member, units, check, meaning)
static const bt_state_row field_rows[] = {
    FIELD(F64, "ice_area", ice_area, "m2", ANY, "area that the concentration of the field refers to"),
    FIELD(F64, "concentration", concentration, "1", ANY, "fraction of ice_area that the floes cover"),
    FIELD(I64, "read", outlines.read, "1", COUNT, "outlines that were read"),
    FIELD(I64, "turned", outlines.turned, "1", COUNT, "outlines that ran clockwise"),
    FIELD(I64, "dropped", outlines.dropped, "1", COUNT, "outlines that were dropped"),
    FIELD(I64, "hulled", outlines.hulled, "1", COUNT, "outlines that were replaced by their hull"),
    FIELD(F64, "hull_area", outlines.hull_area, "m2", ANY, "area that the hulls added"),
    FIELD(I64, "split", outlines.split, "1", COUNT, "outlines that were split into convex parts"),
    FIELD(I64, "parts", outlines.parts, "1", COUNT, "convex parts of the outlines that were split"),
    FIELD(F64, "lon", outlines.lon, "rad", ANY, "longitude of the origin of the map"),
    FIELD(F64, "lat", outlines.lat, "rad", ANY, "latitude of the origin of the map"),
    FIELD(I64, "rounded", outlines.rounded, "1", COUNT, "floes not convex by rounding alone, taken for convex"),
    FIELD(I64, "rounded_corners", outlines.rounded_corners, "1", COUNT, "corners left out of floes taken for convex"),
    FIELD(F64, "rounded_area", outlines.rounded_area, "m2", ANY, "area added to floes taken for convex"),
    FIELD(F64, "east", outlines.east, "m", ANY, "origin in the map, east"),
    FIELD(F64, "north", outlines.north, "m", ANY, "origin in the map, north"),
    FIELD(I64, "unnamed", outlines.unnamed, "1", COUNT,
        "features without a property `thickness` that have one of nearly that name"),
    FIELD(I64, "bare", outlines.bare, "1", ANY, "features without a thickness"),
    FIELD(I64, "outside", outlines.outside, "1", ANY, "floes whose centroid is outside the ice region"),
    FIELD(F64, "outside_area", outlines.outside_area, "m2", ANY, "area of floes outside the ice region"),
    FIELD(F64, "own_area", outlines.own_area, "m2", ANY, "area that the concentration of a field file refers to"),
    FIELD(F64, "region_area", outlines.region_area, "m2", ANY, "area of the case's ice region"),
    FIELD(F64, "x_min", outlines.region[0], "m", ANY,
        "where the ice that was read ends, low end of x; 0 if unknown"),
    FIELD(F64, "y_min", outlines.region[1], "m", ANY, "where the ice that was read ends, low end of y"),
    FIELD(F64, "x_max", outlines.region[2], "m", ANY, "where the ice that was read ends, high end of x"),
    FIELD(F64, "y_max", outlines.region[3], "m", ANY, "where the ice that was read ends, high end of y"),
};

_Static_assert(sizeof(bool) == 1 && sizeof(int) == 4 && sizeof(bt_lead_mode) == 4, "as the tables say");

void bt_state_save_parts(const bt_lead_stats *stats, const bt_stall *stall, bt_snapshot *snap)
{
    bt_snapshot_add_rows(snap, "lead", lead_rows, BT_N_OF(lead_rows), stats);
    bt_snapshot_add_rows(snap, "stall", stall_rows, BT_N_OF(stall_rows), stall);
}
void bt_state_load_stall(bt_stall *stall, bt_snapshot *snap)
{
    bt_snapshot_take_rows(snap, "stall", stall_rows, BT_N_OF(stall_rows), stall);
}
void bt_state_load_lead(bt_lead_stats *stats, bt_snapshot *snap)
{
    int32_t mode = 0;
    bt_snapshot_take(snap, "lead/mode", BT_ITEM_I32, 1, 1, &mode);
    // before it is used as an enum
    bt_snapshot_want(snap, mode >= BT_LEAD_NONE && mode <= BT_LEAD_MANAGED, "lead/mode", -1, "is not a kind of lead");
    if (!snap->faulty) bt_snapshot_take_rows(snap, "lead", lead_rows, BT_N_OF(lead_rows), stats);
}

// --- the field -------------------------------------------------------------------------------------------------------

/// Collective. Save the outlines of the floes of the field, the first n bodies. `offset`: on rank 0.
static bt_status save_outlines(const bt_world *world, const bt_comm *comm, bt_gid n, const int64_t *offset,
                               bt_snapshot *snap, bt_errors *err)
{
    enum { FLOES = 1024 }; // at a time
    const bt_bodies *bodies = &world->bodies;
    const bt_splitting *splitting = world->splitting;
    int64_t *split = bt_alloc((size_t)n, sizeof *split); // 1 + the split of a floe that has split, 0 = none
    double most = 0;
    for (bt_idx i = 0; i < bodies->n; i++)
        if (bodies->gid[i] < n) most = bt_max(most, bt_body_corners(bodies, i));
    for (int64_t k = 0; splitting && k < splitting->n; k++) {
        if (splitting->split[k].parent >= n) continue;
        split[splitting->split[k].parent] = k + 1;
        most = bt_max(most, (double)splitting->split[k].corners[2]);
    }
    bt_comm_reduce(comm, NULL, 0, &most, 1, NULL, 0);
    const size_t width = 2 * (size_t)most, size = width * sizeof(double);
    double *mine = bt_alloc(FLOES, size), *all = bt_alloc(FLOES, size), *packed = bt_alloc(FLOES, size);
    bt_gid *gid = bt_alloc(FLOES, sizeof *gid);
    int64_t *first = bt_alloc((size_t)comm->size + 1, sizeof *first);
    bt_status status = BT_OK;
    if (comm->rank == 0) bt_snapshot_begin(snap, "field/vertices", BT_ITEM_F64, offset[n], 2);
    if (comm->rank == 0 && n == 0) bt_snapshot_put(snap, 0, packed);
    for (bt_gid from = 0; from < n && status == BT_OK; from += FLOES) {
        const bt_gid end = n - from < FLOES ? n : from + FLOES;
        bt_idx own = 0;
        for (bt_gid g = from; g < end; g++) {
            const bt_idx i = bt_world_index(world, g);
            const bool gone = split[g] > 0;
            if (gone ? comm->rank != 0 : i < 0 || !bt_domain_owns(world, i)) continue;
            const double *v = gone ? bt_splitting_outline(splitting, split[g] - 1, 2)
                                   : bodies->vertices + 2 * bodies->offset[i];
            const int corners = gone ? (int)splitting->split[split[g] - 1].corners[2] : bt_body_corners(bodies, i);
            memcpy(mine + (size_t)own * width, v, 2 * sizeof *mine * (size_t)corners);
            gid[own++] = g;
        }
        first[0] = from;
        for (int k = 1; k <= comm->size; k++) first[k] = end; // all to rank 0
        status = bt_comm_rows_by_gid(comm, first, own, gid, (int)width, mine, all, err);
        if (status != BT_OK || comm->rank != 0) continue;
        for (bt_gid g = from; g < end; g++)
            memcpy(packed + 2 * (offset[g] - offset[from]), all + (size_t)(g - from) * width,
                   2 * sizeof *all * (size_t)(offset[g + 1] - offset[g]));
        bt_snapshot_put(snap, offset[end] - offset[from], packed);
    }
    BT_FREE(mine, all, packed, gid, first, split);
    return status;
}

// not in checkpoints of earlier versions
static const bt_state_row drawn_rows[] = {
    FIELD(I64, "drawn", drawn, "1", COUNT, "floes drawn from the size law"),
    FIELD(I64, "unplaced", unplaced, "1", COUNT, "of these, those that found no place"),
};

bt_status bt_state_save_field(const bt_field *field, const bt_world *world, const bt_comm *comm, bt_snapshot *snap,
                              bt_errors *err)
{
    double n = comm->rank == 0 ? field->n : 0;
    bt_comm_reduce(comm, NULL, 0, &n, 1, NULL, 0);
    if (comm->rank == 0) {
        bt_snapshot_add_rows(snap, "field", field_rows, BT_N_OF(field_rows), field);
        bt_snapshot_add_rows(snap, "field", drawn_rows, BT_N_OF(drawn_rows), field);
        bt_snapshot_add_text(snap, "field/crs", field->outlines.crs);
        bt_snapshot_add_text(snap, "field/nearly", field->outlines.nearly);
        bt_snapshot_add_text(snap, "field/chart", field->outlines.chart);
        bt_snapshot_add(snap, "field/offsets", BT_ITEM_I64, field->n + 1, 1, field->offsets);
    }
    const bt_status status = save_outlines(world, comm, (bt_gid)n, field->offsets, snap, err);
    if (comm->rank != 0) return status;
    bt_snapshot_add(snap, "field/pose", BT_ITEM_F64, field->n, 3, field->pose);
    bt_snapshot_add(snap, "field/thickness", BT_ITEM_F64, field->n, 1, field->thickness);
    bt_snapshot_add(snap, "field/area", BT_ITEM_F64, field->n, 1, field->area);
    return status;
}

void bt_state_load_field(bt_field *field, bt_snapshot *snap)
{
    bt_field_free(field);
    bt_field_init(field);
    int64_t n = 0, n_vertices = 0;
    bt_snapshot_take_rows(snap, "field", field_rows, BT_N_OF(field_rows), field);
    if (bt_snapshot_find(snap, "field/unplaced"))
        bt_snapshot_take_rows(snap, "field", drawn_rows, BT_N_OF(drawn_rows), field);
    snprintf(field->outlines.crs, sizeof field->outlines.crs, "%s", bt_snapshot_text(snap, "field/crs"));
    snprintf(field->outlines.nearly, sizeof field->outlines.nearly, "%s", bt_snapshot_text(snap, "field/nearly"));
    if (bt_snapshot_find(snap, "field/chart")) // not in checkpoints of earlier versions
        snprintf(field->outlines.chart, sizeof field->outlines.chart, "%s", bt_snapshot_text(snap, "field/chart"));
    free(field->offsets);
    field->offsets = bt_snapshot_copy(snap, "field/offsets", BT_ITEM_I64, 1, &n);
    field->vertices = bt_snapshot_copy(snap, "field/vertices", BT_ITEM_F64, 2, &n_vertices);
    double **const arrays[] = {&field->pose, &field->thickness, &field->area};
    static const char *const names[] = {"field/pose", "field/thickness", "field/area"};
    for (int k = 0; k < 3; k++) {
        int64_t rows = 0;
        *arrays[k] = bt_snapshot_copy(snap, names[k], BT_ITEM_F64, k == 0 ? 3 : 1, &rows);
        bt_snapshot_want(snap, rows == n - 1, names[k], -1, "does not have a row for each floe");
    }
    if (!snap->faulty) field->n = field->cap = (bt_idx)(n - 1);
    field->cap_vertices = n_vertices;
    bt_state_check_field(field, n, n_vertices, snap);
    if (!snap->faulty) return;
    bt_field_free(field); // none of it can be trusted
    bt_field_init(field);
}
