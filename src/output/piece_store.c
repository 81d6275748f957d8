// SPDX-License-Identifier: MIT
// Splits and pieces in result.h5; see piece_store.h.
#include "output/piece_store.h"

#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "base/h5dataset.h"
#include "step/splitting.h"

/// A column of the splits. Times and rows of floes are derived from the history, the other columns are in it.
typedef struct {
    const char *name;
    bool whole;
    hsize_t width;          ///< 0 = one number
    const char *axes, *units, *text;
} column;

enum { TIME, PARENT, GENERATION, MODE, RATIO, THICKNESS, CRACK };
static const column splits[BT_SPLIT_COLUMNS] = {
    [TIME] = {"/splits/time", false, 0, "split", "s", "end of the step in which the floe split"},
    [PARENT] = {"/splits/parent", true, 0, "split", "1", "the floe: a row of /floes, or from n_floes on a piece"},
    [GENERATION] = {"/splits/generation", true, 0, "split", "1",
        "generation of the pieces; 1 if a floe of /floes split"},
    [MODE] = {"/splits/mode", true, 0, "split", "1", "1 = opened at a contact, 2 = bent, 3 = burst"},
    [RATIO] = {"/splits/ratio", false, 0, "split", "1", "stress over strength"},
    [THICKNESS] = {"/splits/thickness", false, 0, "split", "m", "thickness of the floe"},
    [CRACK] = {"/splits/crack", false, 4, "split end_of_crack", "m",
        "x, y of the crack's end at the load, then of its other end"},
};

/// A column of the pieces in the frames, and its name where ParaView draws it; the first one is of integers.
#define PART(member, n) BT_FRAME_PART(bt_piece_row, member, n)
static const struct { const char *name; bt_frame_part part; bool single; const char *drawn, *axes, *units, *text; }
    pieces[BT_PIECE_COLUMNS] = {
    {"/frames/piece", PART(piece, 1), false, NULL, "piece_in_frame", "1", "the piece, a row of /pieces"},
    {"/frames/piece_pose", PART(row.x, 3), false, NULL, "piece_in_frame component", "m, m, rad",
     "x, y, yaw of each piece"},
    {"/frames/piece_contact_force", PART(row.contact_force, 1), false, "_force", "piece_in_frame", "N",
     "largest normal contact force on the piece in the step, NaN where that has no solution"},
    {"/frames/piece_speed", PART(row.speed, 1), false, "_speed", "piece_in_frame", "m/s", "speed of the centroid"},
    {"/frames/piece_velocity", PART(row.vx, 2), true, "_velocity", "piece_in_frame xy", "m/s",
     "velocity of the centroid"},
    {"/frames/piece_net_force", PART(row.fx, 2), true, "_net_force", "piece_in_frame xy", "N",
     "sum of all contact forces in the step"},
    {"/frames/piece_thickness", PART(thickness, 1), false, "_thickness", "piece_in_frame", "m",
     "thickness of the piece"},
};

static hid_t grow(bt_h5 *h5, const char *name, hid_t type, hsize_t width)
{
    return bt_h5_growing(h5, name, type, width ? 2 : 1, &width, (hsize_t[]){256, width ? width : 1}, false);
}

void bt_piece_store_create(bt_piece_store *store, bt_h5 *h5, const bt_splitting *splitting, const bt_roster *roster,
                           int64_t n_bodies, double dt, const bt_map_axes *axes)
{
    *store = (bt_piece_store){
        .h = h5, .s = splitting, .roster = roster, .n_bodies = n_bodies, .dt = dt, .axes = *axes};
    bt_h5_group(h5, "/splits");
    bt_h5_group(h5, "/pieces");
    for (int k = 0; k < BT_SPLIT_COLUMNS; k++) {
        const column *c = &splits[k];
        store->split[k] = grow(h5, c->name, c->whole ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE, c->width);
        bt_h5_describe(h5, c->name, c->axes, c->units, c->text);
    }
    store->area = grow(h5, "/pieces/area", H5T_NATIVE_DOUBLE, 0);
    store->offsets = grow(h5, "/pieces/offsets", H5T_NATIVE_INT64, 0);
    store->vertices = grow(h5, "/pieces/vertices", H5T_NATIVE_DOUBLE, 2);
    bt_h5_append(h5, store->offsets, H5T_NATIVE_INT64, 0, 1, &(int64_t){0});
    bt_h5_describe(h5, "/pieces/area", "piece", "m2", "area of each piece: split k made the pieces 2 k and 2 k + 1");
    bt_h5_describe(h5, "/pieces/offsets", "piece_end", "1", "piece i has the vertices offsets[i] up to offsets[i + 1]");
    bt_h5_describe(h5, "/pieces/vertices", "piece_vertex xy", "m",
                   "x, y in the frame of the piece, anticlockwise about its centroid");
    store->end = grow(h5, "/frames/piece_end", H5T_NATIVE_INT64, 0);
    bt_h5_describe(h5, "/frames/piece_end", "time", "1", "end of the rows of each frame in piece, piece_pose, ...");
    for (int k = 0; k < BT_PIECE_COLUMNS; k++) {
        const hid_t type = k == 0 ? H5T_NATIVE_INT64 : pieces[k].single ? H5T_NATIVE_FLOAT : H5T_NATIVE_DOUBLE;
        store->piece[k] = grow(h5, pieces[k].name, type, pieces[k].part.n > 1 ? (hsize_t)pieces[k].part.n : 0);
        bt_h5_describe(h5, pieces[k].name, pieces[k].axes, pieces[k].units, pieces[k].text);
    }
}

/// A floe as a row of /floes, or from n_floes on of /pieces.
static int64_t floe_of(const bt_piece_store *store, bt_gid gid)
{
    const bt_gid row = bt_roster_row(store->roster, gid);
    return row >= 0 ? row : store->roster->n_floes + (gid - store->s->first);
}

void bt_piece_store_write(bt_piece_store *store)
{
    if (!store->h) return;
    for (; store->n_splits < store->s->n; store->n_splits++) {
        const bt_split_record *record = &store->s->split[store->n_splits];
        const hsize_t at = (hsize_t)store->n_splits;
        const int64_t whole[] = {[PARENT] = floe_of(store, record->parent), [GENERATION] = record->generation,
                                 [MODE] = record->mode};
        const double real[] = {[TIME] = (double)(record->step + 1) * store->dt, [RATIO] = record->ratio,
                               [THICKNESS] = record->thickness};
        for (int k = 0; k < CRACK; k++) {
            const void *value = splits[k].whole ? (const void *)&whole[k] : (const void *)&real[k];
            bt_h5_append(store->h, store->split[k], splits[k].whole ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE, at, 1,
                         value);
        }
        const double crack[4] = {record->near[0], record->near[1], record->far[0], record->far[1]};
        bt_h5_append(store->h, store->split[CRACK], H5T_NATIVE_DOUBLE, at, 1, crack);
        bt_h5_append(store->h, store->area, H5T_NATIVE_DOUBLE, 2 * at, 2, record->area);
        const int64_t first = store->n_vertices, both = record->corners[0] + record->corners[1];
        const int64_t end[2] = {first + record->corners[0], first + both};
        bt_h5_append(store->h, store->offsets, H5T_NATIVE_INT64, 2 * at + 1, 2, end);
        bt_h5_append(store->h, store->vertices, H5T_NATIVE_DOUBLE, (hsize_t)first, (hsize_t)both,
                     bt_splitting_outline(store->s, store->n_splits, 0));
        store->n_vertices += both;
    }
}

/// Write polygons for ParaView: topology and points.
static void draw(const bt_piece_store *store, const bt_piece_row *rows, int64_t n, int32_t *topology, float *points)
{
    int64_t at = 0, t = 0;
    for (int64_t i = 0; i < n; i++) {
        const int64_t k = (int64_t)rows[i].piece, corners = store->s->split[k / 2].corners[k % 2];
        const double *v = bt_splitting_outline(store->s, k / 2, (int)(k % 2)), c = bt_cos(rows[i].row.yaw),
                     s = bt_sin(rows[i].row.yaw);
        topology[t++] = BT_XDMF_POLYGON;
        topology[t++] = (int32_t)corners;
        for (int64_t q = 0; q < corners; q++) {
            double drawn[2];
            bt_map_axes_point(&store->axes, rows[i].row.x + c * v[2 * q] - s * v[2 * q + 1],
                              rows[i].row.y + s * v[2 * q] + c * v[2 * q + 1], drawn);
            points[2 * (at + q)] = (float)drawn[0], points[2 * (at + q) + 1] = (float)drawn[1];
            topology[t++] = (int32_t)(at + (store->axes.swapped ? corners - 1 - q : q));
        }
        at += corners;
    }
}

static void write_paraview(const bt_piece_store *store, const bt_piece_row *rows, int64_t n, int64_t n_points)
{
    char path[64];
    const size_t cells = (size_t)n;
    int32_t *topology = bt_alloc((size_t)n_points + 2 * cells, sizeof *topology), *id = bt_alloc(cells, sizeof *id);
    float *points = bt_alloc(2 * (size_t)n_points, sizeof *points), *value = bt_alloc(cells, 3 * sizeof *value);
    draw(store, rows, n, topology, points);
#define NAMED(name) (snprintf(path, sizeof path, "/xdmf/%06lld/piece%s", (long long)store->n_frames, name), path)
    bt_h5_write(store->h, NAMED("s"), H5T_NATIVE_INT32, (hsize_t)(n_points + 2 * n), 0, topology);
    bt_h5_write(store->h, NAMED("_points"), H5T_NATIVE_FLOAT, (hsize_t)n_points, 2, points);
    for (int k = 0; k < BT_PIECE_COLUMNS; k++) {
        if (!pieces[k].drawn) continue;
        const bt_frame_part part = pieces[k].part;
        const size_t width = part.n > 1 ? 3 : 1;
        for (size_t i = 0; i < cells; i++)
            bt_map_axes_value(&store->axes, bt_frame_numbers(&rows[i], part), part.n, value + width * i);
        bt_h5_write(store->h, NAMED(pieces[k].drawn), H5T_NATIVE_FLOAT, cells, width > 1 ? width : 0, value);
    }
    for (size_t i = 0; i < cells; i++)
        id[i] = (int32_t)bt_roster_id(store->roster, store->n_bodies, store->s->first + (bt_gid)rows[i].piece);
    bt_h5_write(store->h, NAMED("_id"), H5T_NATIVE_INT32, cells, 0, id);
#undef NAMED
    BT_FREE(topology, id, points, value);
}

void bt_piece_store_frame(bt_piece_store *store, const bt_piece_row *rows, int64_t n)
{
    if (!store->h) return;
    bt_piece_store_write(store);
    double *x = bt_alloc((size_t)n, 3 * sizeof *x);
    for (int k = 0; k < BT_PIECE_COLUMNS; k++) {
        const size_t width = (size_t)pieces[k].part.n;
        for (int64_t i = 0; i < n; i++)
            memcpy(x + width * (size_t)i, bt_frame_numbers(&rows[i], pieces[k].part), width * sizeof *x);
        bt_h5_append(store->h, store->piece[k], H5T_NATIVE_DOUBLE, (hsize_t)store->n_rows, (hsize_t)n, x);
    }
    free(x);
    int64_t points = 0;
    for (int64_t i = 0; i < n; i++) {
        const int64_t k = (int64_t)rows[i].piece;
        points += store->s->split[k / 2].corners[k % 2];
    }
    if (n > 0) write_paraview(store, rows, n, points);
    BT_MAKE_ROOM(store->frame, store->n_frames, store->cap, 64);
    store->frame[store->n_frames] = (bt_piece_count){n, points};
    store->n_rows += n;
    bt_h5_append(store->h, store->end, H5T_NATIVE_INT64, (hsize_t)store->n_frames++, 1, &store->n_rows);
}

bt_piece_row *bt_piece_store_read(bt_h5_reader *old, int64_t k, int64_t *n)
{
    int64_t ends[2] = {0, 0};
    if (k > 0) bt_h5_read(old, "/frames/piece_end", H5T_NATIVE_INT64, k - 1, 2, 1, ends);
    else bt_h5_read(old, "/frames/piece_end", H5T_NATIVE_INT64, 0, 1, 1, &ends[1]);
    *n = old->status == BT_OK ? ends[1] - ends[0] : 0;
    bt_piece_row *rows = bt_alloc((size_t)*n, sizeof *rows);
    double *x = bt_alloc((size_t)*n, 3 * sizeof *x);
    for (int c = 0; c < BT_PIECE_COLUMNS && *n > 0; c++) {
        const size_t width = (size_t)pieces[c].part.n;
        bt_h5_read(old, pieces[c].name, H5T_NATIVE_DOUBLE, ends[0], *n, (int64_t)width, x);
        for (int64_t i = 0; i < *n; i++)
            memcpy((char *)&rows[i] + pieces[c].part.at, x + width * (size_t)i, width * sizeof *x);
    }
    free(x);
    return rows;
}

void bt_piece_store_close(bt_piece_store *store)
{
    free(store->frame);
    *store = (bt_piece_store){0};
}
