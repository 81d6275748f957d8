// SPDX-License-Identifier: MIT
// The bodies and their frames in result.h5, each rank writing its block of them.
//
// Outlines are kept in single precision, as /xdmf stores them: a rank holds only 8 bytes per vertex and 1 byte per body
// of its block between frames. Everything else passes through one buffer of 1 MB.
#include "output/frames.h"

#include <string.h>

#include "bergtow/shape.h"
#include "base/elementary.h"
#include "base/fileio.h"
#include "base/inside.h"

_Static_assert(BT_MAX_VERTICES <= UINT8_MAX, "n_vertices counts in bytes");

typedef struct outlines {
    bt_slab vertices, offsets, thickness, area, topology;
    bool mirrored; ///< as drawn the vertices run clockwise
} outlines;

static outlines create_outlines(bt_frames *frames, const char *group, const char *height, const char *topology,
                                int64_t n, int64_t n_vertices)
{
    bt_h5 *h5 = frames->h;
    outlines o = {
        .vertices = bt_slab_fixed(h5, BT_PATH(group, "vertices"), H5T_NATIVE_DOUBLE, n_vertices, 2, false),
        .offsets = bt_slab_fixed(h5, BT_PATH(group, "offsets"), H5T_NATIVE_INT64, n + 1, 0, false),
        .thickness = bt_slab_fixed(h5, BT_PATH(group, height), H5T_NATIVE_DOUBLE, n, 0, false),
        .area = bt_slab_fixed(h5, BT_PATH(group, "area"), H5T_NATIVE_DOUBLE, n, 0, false),
        // Vertex numbers in XDMF have 32 bits here: enough for 2^31 vertices per block.
        .topology = bt_slab_fixed(h5, topology, H5T_NATIVE_INT32, n_vertices + 2 * n, 0, false),
        .mirrored = frames->axes.swapped,
    };
    return o;
}

/// Describe ParaView's coordinates.
static void describe_axes(bt_h5 *h5, const bt_map_axes *axes)
{
    bt_h5_attr_text(h5, "/xdmf", "axes", bt_map_axes_names(axes));
    bt_h5_attr_double(h5, "/xdmf", "origin_x", axes->origin[0]);
    bt_h5_attr_double(h5, "/xdmf", "origin_y", axes->origin[1]);
    if (!*axes->crs) return;
    bt_h5_attr_text(h5, "/xdmf", "crs", axes->crs);
    bt_h5_attr_double(h5, "/xdmf", "origin_east", axes->crs_place[0]);
    bt_h5_attr_double(h5, "/xdmf", "origin_north", axes->crs_place[1]);
}

static void describe(bt_h5 *h5, const bt_record_bodies *bodies)
{
    const int64_t towed = bodies->towed < 0 ? -1 : bodies->towed - bodies->n_floes;
    bt_h5_describe(h5, "/floes/vertices", "floe_vertex xy", "m",
                   "x, y in the frame of the floe, anticlockwise about its centroid");
    bt_h5_describe(h5, "/floes/offsets", "floe_end", "1", "floe i has the vertices offsets[i] up to offsets[i + 1]");
    bt_h5_describe(h5, "/floes/thickness", "floe", "m", "thickness of each floe");
    bt_h5_describe(h5, "/floes/area", "floe", "m2", "area of each floe");
    bt_h5_describe(h5, "/bodies/vertices", "body_vertex xy", "m",
                   "x, y in the frame of the body, anticlockwise about its centroid");
    bt_h5_describe(h5, "/bodies/offsets", "body_end", "1", "body i has the vertices offsets[i] up to offsets[i + 1]");
    bt_h5_describe(h5, "/bodies/height", "body", "m", "draft + sail of the towed body, 0 for walls");
    bt_h5_describe(h5, "/bodies/area", "body", "m2", "area of each body");
    bt_h5_describe(h5, "/xdmf/floes", "floe_cell", "1", "polygons of the floes as XDMF's mixed topology");
    bt_h5_describe(h5, "/xdmf/bodies", "body_cell", "1", "polygons of the other bodies as XDMF's mixed topology");
    bt_h5_put_names(h5, "/bodies/names", (hsize_t)(bodies->n_bodies - bodies->n_floes), bodies->names, "body",
                    "what each body is");
    bt_h5_put(h5, "/bodies/towed", H5T_NATIVE_INT64, 1, 0, &towed, "one", "1",
              "which of these bodies is towed, -1 = none");
}

/// Write bodies from .. from + n of the block `bodies` to rows first .. first + n of the datasets; before: number of
/// vertices of previous rows.
static void write_outlines(outlines *o, const bt_record_bodies *bodies, int64_t from, int64_t n, int64_t first,
                           int64_t before, char *buffer)
{
    const int64_t *offsets = bodies->offsets + from, v0 = offsets[0];
    bt_slab_write(&o->vertices, before, offsets[n] - v0, bodies->vertices + 2 * (v0 - bodies->offsets[0]));
    bt_slab_write(&o->thickness, first, n, bodies->thickness + from);
    bt_slab_write(&o->area, first, n, bodies->area + from);
    // Every rank writes the ends of its bodies; the first one also the 0 at the start.
    bt_rows rows = bt_rows_from(&o->offsets, first ? first + 1 : 0, buffer);
    if (!first) *(int64_t *)bt_rows_next(&rows) = 0;
    for (int64_t i = 1; i <= n; i++) *(int64_t *)bt_rows_next(&rows) = before + offsets[i] - v0;
    bt_rows_end(&rows);
    rows = bt_rows_from(&o->topology, before + 2 * first, buffer);
    for (int64_t i = 0; i < n; i++) {
        const int64_t count = offsets[i + 1] - offsets[i];
        *(int32_t *)bt_rows_next(&rows) = BT_XDMF_POLYGON;
        *(int32_t *)bt_rows_next(&rows) = (int32_t)count;
        for (int64_t v = 0; v < count; v++)
            *(int32_t *)bt_rows_next(&rows) = (int32_t)(before + offsets[i] - v0 + (o->mirrored ? count - 1 - v : v));
    }
    bt_rows_end(&rows);
}

/// Write the ids of the floes, their rows, since ParaView renumbers the cells of a selection; and which are fixed.
static void write_marks(bt_frames *frames, const int32_t *fixed)
{
    bt_slab ids = bt_slab_fixed(frames->h, "/xdmf/floe_id", H5T_NATIVE_INT32, frames->n_floes, 0, true),
            still = bt_slab_fixed(frames->h, "/floes/fixed", H5T_NATIVE_INT32, frames->n_floes, 0, true);
    bt_h5_describe(frames->h, "/xdmf/floe_id", "floe", "1", "id of each floe");
    bt_h5_describe(frames->h, "/floes/fixed", "floe", "1", "1: nothing moves the floe, such as a pier or a shore");
    if (bt_slab_share(frames->comm, (bt_slab *const[]){&ids, &still}, 2) == BT_OK) {
        char *buffer = bt_alloc(BT_SLAB_BYTES, 1);
        bt_rows rows = bt_rows_from(&ids, frames->first, buffer);
        for (int64_t i = 0; i < frames->own_floes; i++) *(int32_t *)bt_rows_next(&rows) = (int32_t)(frames->first + i);
        bt_rows_end(&rows);
        rows = bt_rows_from(&still, frames->first, buffer);
        for (int64_t i = 0; i < frames->own_floes; i++) *(int32_t *)bt_rows_next(&rows) = fixed ? fixed[i] : 0;
        bt_rows_end(&rows);
        free(buffer);
    }
    bt_slab_close(&ids);
    bt_slab_close(&still);
}

static void write_bodies(bt_frames *frames, const bt_record_bodies *bodies)
{
    bt_h5 *h5 = frames->h;
    bt_h5_group(h5, "/floes");
    bt_h5_group(h5, "/bodies");
    bt_h5_group(h5, "/xdmf");
    outlines o[2] =
        {create_outlines(frames, "/floes", "thickness", "/xdmf/floes", frames->n_floes, frames->floe_vertices),
                     create_outlines(frames, "/bodies", "height", "/xdmf/bodies", frames->n_others,
                                     frames->other_vertices)};
    describe_axes(h5, &frames->axes);
    describe(h5, bodies);
    bt_slab *all[] = {&o[0].vertices, &o[0].offsets, &o[0].thickness, &o[0].area, &o[0].topology,
                      &o[1].vertices, &o[1].offsets, &o[1].thickness, &o[1].area, &o[1].topology};
    enum { N = sizeof all / sizeof *all };
    const bool last = frames->comm->rank == frames->comm->size - 1;
    write_marks(frames, bodies->fixed);
    if (bt_slab_share(frames->comm, all, N) == BT_OK) {
        char *buffer = bt_alloc(BT_SLAB_BYTES, 1);
        // The first rank writes the 0 of the offsets even for an empty block of floes.
        if (frames->own_floes > 0 || (last && frames->n_floes == 0))
            write_outlines(&o[0], bodies, 0, frames->own_floes, frames->first, frames->vertices_before, buffer);
        if (last) write_outlines(&o[1], bodies, frames->own_floes, frames->own_others, 0, 0, buffer);
        free(buffer);
    }
    for (int k = 0; k < N; k++) bt_slab_close(all[k]);
}

static void keep_outlines(bt_frames *frames, const bt_record_bodies *bodies)
{
    frames->bodies = bodies->all;
    if (frames->bodies) return;
    const int64_t n = frames->own_floes + frames->own_others, nv = bodies->offsets[n] - bodies->offsets[0];
    frames->n_vertices = bt_alloc((size_t)n, sizeof *frames->n_vertices);
    frames->vertices = bt_alloc(2 * (size_t)nv, sizeof *frames->vertices);
    for (int64_t i = 0; i < n; i++) frames->n_vertices[i] = (uint8_t)(bodies->offsets[i + 1] - bodies->offsets[i]);
    for (int64_t v = 0; v < 2 * nv; v++) frames->vertices[v] = (float)bodies->vertices[v];
}

#define PART(member, n) BT_FRAME_PART(bt_frame_row, member, n)
enum form { DOUBLE, SINGLE, DRAWN };

enum { FLOES = 1, OTHERS = 2 };
static const struct {
    const char *name, *axes, *units, *text;
    bt_frame_part part;
    enum form form;
    int of;
} columns[BT_FRAME_COLUMNS] = {
    {"/frames/pose", "time floe component", "m, m, rad", "x, y, yaw of each floe", PART(x, 3), DOUBLE, FLOES},
    {"/frames/body_pose", "time body component", "m, m, rad", "x, y, yaw of each of /bodies", PART(x, 3), DOUBLE,
     OTHERS},
    {"/frames/contact_force", "time floe", "N",
     "largest normal contact force on the floe in the step, NaN where that has no solution", PART(contact_force, 1),
     DOUBLE, FLOES},
    {"/frames/speed", "time floe_or_body", "m/s", "speed of the centroid: floes, then /bodies", PART(speed, 1),
     DOUBLE, FLOES | OTHERS},
    {"/frames/velocity", "time floe_or_body xy", "m/s", "velocity of the centroid: floes, then /bodies",
     PART(vx, 2), SINGLE, FLOES | OTHERS},
    {"/frames/net_force", "time floe_or_body xy", "N",
     "sum of all contact forces in the step, NaN where that has no solution: floes, then /bodies", PART(fx, 2),
     SINGLE, FLOES | OTHERS},
};

/// The number of rows of a column, with this many floes and other bodies.
static int64_t rows_of(int column, int64_t floes, int64_t others)
{
    return (columns[column].of & FLOES ? floes : 0) + (columns[column].of & OTHERS ? others : 0);
}

static void create_datasets(bt_frames *frames)
{
    bt_h5 *h5 = frames->h;
    bt_h5_group(h5, "/frames");
    frames->time = bt_h5_growing(h5, "/frames/time", H5T_NATIVE_DOUBLE, 1, NULL, (hsize_t[]){256, 1}, false);
    bt_h5_describe(h5, "/frames/time", "time", "s", "time of each frame, since the start of the run");
    for (int k = 0; k < BT_FRAME_COLUMNS; k++) {
        frames->column[k] = bt_slab_growing(h5, columns[k].name, columns[k].form == SINGLE ? H5T_NATIVE_FLOAT
                                            : H5T_NATIVE_DOUBLE, rows_of(k, frames->n_floes, frames->n_others),
                                            columns[k].part.n > 1 ? columns[k].part.n : 0);
        bt_h5_describe(h5, columns[k].name, columns[k].axes, columns[k].units, columns[k].text);
    }
    if (!frames->branches) return;
    const hsize_t k = (hsize_t)frames->branches;
    frames->line_points = bt_h5_growing(h5, "/frames/line_points", H5T_NATIVE_DOUBLE, 3, (hsize_t[]){2 * k, 2},
                                        (hsize_t[]){64, 2 * k}, false);
    frames->line_tension = bt_h5_growing(h5, "/frames/line_tension", H5T_NATIVE_DOUBLE, 2, &k, (hsize_t[]){64, k},
                                         false);
    bt_h5_describe(h5, "/frames/line_points", "time line_point xy", "m",
                   "ends of the branches of the tow line: hull, towing end of the first, then of the second");
    bt_h5_describe(h5, "/frames/line_tension", "time branch", "N", "tension of each branch, 0 once it is broken");
}

void bt_record_blocks(const bt_comm *comm, bt_idx n_floes, bt_idx n_bodies, int64_t *first)
{
    for (int k = 0; k < comm->size; k++) first[k] = bt_comm_first(comm, k, n_floes);
    first[comm->size] = n_bodies;
}

void bt_frames_create(bt_frames *frames, bt_h5 *h5, const bt_comm *comm, const bt_record_bodies *bodies,
                      const bt_map_axes *axes)
{
    *frames = (bt_frames){.h = h5, .comm = comm, .axes = *axes, .n_floes = bodies->n_floes,
                          .n_others = bodies->n_bodies - bodies->n_floes,
                          .towed = bodies->towed < 0 ? -1 : bodies->towed - bodies->n_floes,
                          .branches = bodies->branches};
    frames->first = bt_comm_first(comm, comm->rank, bodies->n_floes);
    frames->own_floes = bt_comm_first(comm, comm->rank + 1, bodies->n_floes) - frames->first;
    frames->own_others = comm->rank == comm->size - 1 ? frames->n_others : 0;
    const int64_t *end = bodies->offsets + frames->own_floes;
    frames->vertices_before = bt_comm_before(comm, end[0] - bodies->offsets[0], &frames->floe_vertices);
    bt_comm_before(comm, end[frames->own_others] - end[0], &frames->other_vertices);
    keep_outlines(frames, bodies);
    write_bodies(frames, bodies);
    create_datasets(frames);
}

/// Write part of the bodies [n] in row to rows first .. first + n.
static void write_rows(const bt_frames *frames, bt_slab *slab, bt_frame_part part, enum form form, int64_t first,
                       const bt_frame_row *row, int64_t n, char *buffer)
{
    bt_rows rows = bt_rows_from(slab, first, buffer);
    for (int64_t i = 0; i < n; i++) {
        const double *x = bt_frame_numbers(&row[i], part);
        void *to = bt_rows_next(&rows);
        if (form == DRAWN) bt_map_axes_value(&frames->axes, x, part.n, to);
        else if (form == DOUBLE) memcpy(to, x, slab->row_bytes);
        else for (int k = 0; k < part.n; k++) ((float *)to)[k] = (float)x[k];
    }
    bt_rows_end(&rows);
}

/// Outline of body i of the block in its own frame, in single precision; returns its number of vertices. at: number of
/// previous vertices in the block.
static int outline_of(const bt_frames *frames, int64_t i, int64_t at, float *v)
{
    if (!frames->bodies) {
        memcpy(v, frames->vertices + 2 * at, 2 * frames->n_vertices[i] * sizeof *v);
        return frames->n_vertices[i];
    }
    const bt_idx k = frames->bodies->index_of[i]; // on one rank the block is all bodies, by id
    const double *own = frames->bodies->vertices + 2 * frames->bodies->offset[k];
    const int n = bt_body_corners(frames->bodies, k);
    for (int c = 0; c < 2 * n; c++) v[c] = (float)own[c];
    return n;
}

/// Write all vertices of bodies from .. from + n of the block as drawn; local: number of vertices before.
static void write_points(const bt_frames *frames, bt_slab *slab, int64_t first, const bt_frame_row *row, int64_t from,
                         int64_t n, int64_t local, char *buffer)
{
    bt_rows rows = bt_rows_from(slab, first, buffer);
    float p[2 * BT_MAX_VERTICES];
    for (int64_t i = from; i < from + n; i++) {
        const double c = bt_cos(row[i].yaw), sine = bt_sin(row[i].yaw);
        const int corners = outline_of(frames, i, local, p);
        local += corners;
        const bool gone = isnan(row[i].x); // a floe that has split: all its vertices at one point
        for (int v = 0; v < corners; v++) {
            float *to = bt_rows_next(&rows);
            double drawn[2];
            bt_map_axes_point(&frames->axes, row[i].x + c * (double)p[2 * v] - sine * (double)p[2 * v + 1],
                              row[i].y + sine * (double)p[2 * v] + c * (double)p[2 * v + 1], drawn);
            to[0] = gone ? 0 : (float)drawn[0], to[1] = gone ? 0 : (float)drawn[1];
        }
    }
    bt_rows_end(&rows);
}

/// Datasets of the frame in single precision, see xdmf.c: the points, and parts of the rows; the last for floes only.
static const struct {
    const char *name, *units, *text;
    int width;
    bt_frame_part part;
} drawn[] = {
    {"points", "m", "every vertex, along the axes of /xdmf, from its origin", 2, {0}},
    {"speed", "m/s", "speed of the centroid", 0, PART(speed, 1)},
    {"velocity", "m/s", "velocity of the centroid along these axes, and 0", 3, PART(vx, 2)},
    {"net_force", "N", "sum of all contact forces in the step along these axes, and 0", 3, PART(fx, 2)},
    {"force", "N", "largest normal contact force in the step", 0, PART(contact_force, 1)},
};
enum { N_DRAWN = sizeof drawn / sizeof *drawn };

/// Without axes: each scale would list all its datasets, in one attribute of at most 64 kB.
static void create_drawn(bt_frames *frames, const char *kind, int64_t cells, int64_t points, int n, bt_slab *slab)
{
    for (int k = 0; k < n; k++) {
        char path[64];
        snprintf(path, sizeof path, "/xdmf/%06lld/%s_%s", (long long)frames->n, kind, drawn[k].name);
        slab[k] = bt_slab_fixed(frames->h, path, H5T_NATIVE_FLOAT, k == 0 ? points : cells, drawn[k].width, true);
        bt_h5_attr_text(frames->h, path, "units", drawn[k].units);
        bt_h5_attr_text(frames->h, path, "long_name", drawn[k].text);
    }
}

static void write_frame(bt_frames *frames, bt_slab *floes, bt_slab *others, const bt_frame_row *rows)
{
    char *buffer = bt_alloc(BT_SLAB_BYTES, 1);
    const int64_t nf = frames->own_floes, nb = frames->own_others;
    for (int k = 0; k < BT_FRAME_COLUMNS; k++) {
        const bool some = columns[k].of & FLOES;
        write_rows(frames, &frames->column[k], columns[k].part, columns[k].form, some ? frames->first : 0,
                   rows + (some ? 0 : nf), rows_of(k, nf, nb), buffer);
    }
    write_points(frames, &floes[0], frames->vertices_before, rows, 0, nf, 0, buffer);
    write_points(frames, &others[0], 0, rows, nf, nb, frames->floe_vertices - frames->vertices_before, buffer);
    for (int k = 1; k < N_DRAWN; k++) {
        write_rows(frames, &floes[k], drawn[k].part, DRAWN, frames->first, rows, nf, buffer);
        if (k < N_DRAWN - 1) write_rows(frames, &others[k], drawn[k].part, DRAWN, 0, rows + nf, nb, buffer);
    }
    free(buffer);
}

char *bt_frames_group(const bt_frames *frames, char path[64])
{
    snprintf(path, 64, "/xdmf/%06lld", (long long)frames->n);
    return path;
}

bt_status bt_frames_add(bt_frames *frames, double time, const bt_frame_row *rows, const bt_frame_line *line)
{
    bt_h5 *h5 = frames->h;
    bt_status status = bt_comm_agree(frames->comm, h5->status);
    if (status != BT_OK) return status;
    bt_slab floes[N_DRAWN], others[N_DRAWN - 1], *shared[BT_FRAME_COLUMNS + 2 * N_DRAWN - 1];
    create_drawn(frames, "floe", frames->n_floes, frames->floe_vertices, N_DRAWN, floes);
    create_drawn(frames, "body", frames->n_others, frames->other_vertices, N_DRAWN - 1, others);
    int n = 0;
    for (int k = 0; k < BT_FRAME_COLUMNS; k++) {
        bt_slab_grow(&frames->column[k], frames->n);
        shared[n++] = &frames->column[k]; // these stay open
    }
    for (int k = 0; k < N_DRAWN; k++) shared[n++] = &floes[k];
    for (int k = 0; k < N_DRAWN - 1; k++) shared[n++] = &others[k];
    status = bt_slab_share(frames->comm, shared, n);
    if (status == BT_OK) write_frame(frames, floes, others, rows);
    for (int k = BT_FRAME_COLUMNS; k < n; k++) bt_slab_close(shared[k]);
    // The time comes last: a reader that counts frames by it finds them whole.
    status = bt_comm_agree(frames->comm, h5->status);
    if (status != BT_OK) {
        bt_h5_give_up(h5, status);
        return status;
    }
    if (frames->branches) { // the line is the same on all ranks
        bt_h5_append(h5, frames->line_points, H5T_NATIVE_DOUBLE, (hsize_t)frames->n, 1, line->point);
        bt_h5_append(h5, frames->line_tension, H5T_NATIVE_DOUBLE, (hsize_t)frames->n, 1, line->tension);
    }
    bt_h5_append(h5, frames->time, H5T_NATIVE_DOUBLE, (hsize_t)frames->n, 1, &time);
    if (frames->n == frames->cap) {
        frames->cap = frames->cap ? 2 * frames->cap : 64;
        frames->times = bt_realloc(frames->times, (size_t)frames->cap, sizeof *frames->times);
        if (frames->branches) frames->lines = bt_realloc(frames->lines, (size_t)frames->cap, sizeof *frames->lines);
    }
    if (frames->branches) frames->lines[frames->n] = *line;
    frames->times[frames->n++] = time;
    return BT_OK;
}

void bt_frames_read(const bt_frames *frames, bt_h5_reader *old, int64_t k, double *time, bt_frame_row *rows,
                    bt_frame_line *line)
{
    double *x = bt_alloc((size_t)(frames->n_floes + frames->n_others), 3 * sizeof *x);
    bt_h5_read(old, "/frames/time", H5T_NATIVE_DOUBLE, k, 1, 1, time);
    for (int c = 0; c < BT_FRAME_COLUMNS; c++) {
        const size_t width = (size_t)columns[c].part.n;
        const int64_t first = columns[c].of & FLOES ? 0 : frames->n_floes,
                      n = rows_of(c, frames->n_floes, frames->n_others);
        bt_h5_read(old, columns[c].name, H5T_NATIVE_DOUBLE, k, 1, (int64_t)width * n, x);
        for (int64_t i = 0; i < n; i++)
            memcpy((char *)&rows[first + i] + columns[c].part.at, x + width * (size_t)i, width * sizeof *x);
    }
    free(x);
    if (frames->branches == 0) return;
    bt_h5_read(old, "/frames/line_points", H5T_NATIVE_DOUBLE, k, 1, 4 * frames->branches, line->point);
    bt_h5_read(old, "/frames/line_tension", H5T_NATIVE_DOUBLE, k, 1, frames->branches, line->tension);
}

void bt_frames_close(bt_frames *frames)
{
    for (int k = 0; k < BT_FRAME_COLUMNS; k++)
        if (frames->column[k].h) bt_slab_close(&frames->column[k]);
    BT_FREE(frames->lines, frames->vertices, frames->n_vertices, frames->times);
    *frames = (bt_frames){0};
}
