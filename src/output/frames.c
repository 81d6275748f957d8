// SPDX-License-Identifier: MIT
// The bodies and their frames in result.h5, each rank writing its block of them.
//
// Outlines are kept in single precision, as /xdmf stores them: 8 bytes a vertex and 1 byte a body are all that a rank
// holds of its block between frames. Everything else passes through one buffer of 1 MB.
#include "output/frames.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/shape.h"
#include "output/xdmf.h"
#include "base/elementary.h"
#include "base/h5dataset.h"

_Static_assert(BT_MAX_VERTICES <= UINT8_MAX, "n_vertices counts in bytes");

/// Rows first up to first + n, copied from memory.
static void write_copy(bt_slab *s, int64_t first, int64_t n, const void *rows)
{
    if (n > 0) bt_slab_write(s, first, n, rows);
}

typedef struct outlines {
    bt_slab vertices, offsets, thickness, area, topology;
    bool mirrored; ///< as drawn the vertices run clockwise
} outlines;

static outlines create_outlines(bt_frames *f, const char *group, const char *height, const char *topology, int64_t n,
                                int64_t n_vertices)
{
    bt_h5 *h = f->h;
    char path[64];
#define NAMED(name) (snprintf(path, sizeof path, "%s/%s", group, name), path)
    outlines o = {
        .vertices = bt_slab_fixed(h, NAMED("vertices"), H5T_NATIVE_DOUBLE, n_vertices, 2, false),
        .offsets = bt_slab_fixed(h, NAMED("offsets"), H5T_NATIVE_INT64, n + 1, 0, false),
        .thickness = bt_slab_fixed(h, NAMED(height), H5T_NATIVE_DOUBLE, n, 0, false),
        .area = bt_slab_fixed(h, NAMED("area"), H5T_NATIVE_DOUBLE, n, 0, false),
        // Vertex numbers in XDMF are of 32 bits here: enough for 2^31 vertices a block.
        .topology = bt_slab_fixed(h, topology, H5T_NATIVE_INT32, n_vertices + 2 * n, 0, false),
        .mirrored = f->axes.swapped,
    };
#undef NAMED
    return o;
}

/// What ParaView's coordinates are.
static void describe_axes(bt_h5 *h, const bt_map_axes *a)
{
    bt_h5_attr_text(h, "/xdmf", "axes", bt_map_axes_names(a));
    bt_h5_attr_double(h, "/xdmf", "origin_x", a->origin[0]);
    bt_h5_attr_double(h, "/xdmf", "origin_y", a->origin[1]);
    if (!*a->crs) return;
    bt_h5_attr_text(h, "/xdmf", "crs", a->crs);
    bt_h5_attr_double(h, "/xdmf", "origin_east", a->crs_place[0]);
    bt_h5_attr_double(h, "/xdmf", "origin_north", a->crs_place[1]);
}

static void describe(bt_h5 *h, const bt_record_bodies *b)
{
    const int64_t towed = b->towed < 0 ? -1 : b->towed - b->n_floes;
    bt_h5_describe(h, "/floes/vertices", "floe_vertex xy", "m",
                   "x, y in the frame of the floe, anticlockwise about its centroid");
    bt_h5_describe(h, "/floes/offsets", "floe_end", "1", "floe i has the vertices offsets[i] up to offsets[i + 1]");
    bt_h5_describe(h, "/floes/thickness", "floe", "m", "thickness of each floe");
    bt_h5_describe(h, "/floes/area", "floe", "m2", "area of each floe");
    bt_h5_describe(h, "/bodies/vertices", "body_vertex xy", "m",
                   "x, y in the frame of the body, anticlockwise about its centroid");
    bt_h5_describe(h, "/bodies/offsets", "body_end", "1", "body i has the vertices offsets[i] up to offsets[i + 1]");
    bt_h5_describe(h, "/bodies/height", "body", "m", "draft + sail of the towed body, 0 for walls");
    bt_h5_describe(h, "/bodies/area", "body", "m2", "area of each body");
    bt_h5_describe(h, "/xdmf/floes", "floe_cell", "1", "polygons of the floes as XDMF's mixed topology");
    bt_h5_describe(h, "/xdmf/bodies", "body_cell", "1", "polygons of the other bodies as XDMF's mixed topology");
    bt_h5_write_names(h, "/bodies/names", (hsize_t)(b->n_bodies - b->n_floes), b->names);
    bt_h5_describe(h, "/bodies/names", "body", NULL, "what each body is");
    bt_h5_write(h, "/bodies/towed", H5T_NATIVE_INT64, 1, 0, &towed);
    bt_h5_describe(h, "/bodies/towed", "one", "1", "which of these bodies is towed, -1 = none");
}

/// Bodies from .. from + n of the block b to rows first .. first + n of the datasets; `before`: vertices of the rows
/// before.
static void write_outlines(outlines *o, const bt_record_bodies *b, int64_t from, int64_t n, int64_t first,
                           int64_t before, char *buffer)
{
    const int64_t *offsets = b->offsets + from, v0 = offsets[0];
    write_copy(&o->vertices, before, offsets[n] - v0, b->vertices + 2 * (v0 - b->offsets[0]));
    write_copy(&o->thickness, first, n, b->thickness + from);
    write_copy(&o->area, first, n, b->area + from);
    // Every rank writes the ends of its bodies; the first one also the 0 at the start.
    bt_rows r = bt_rows_from(&o->offsets, first ? first + 1 : 0, buffer);
    if (!first) *(int64_t *)bt_rows_next(&r) = 0;
    for (int64_t i = 1; i <= n; i++) *(int64_t *)bt_rows_next(&r) = before + offsets[i] - v0;
    bt_rows_end(&r);
    r = bt_rows_from(&o->topology, before + 2 * first, buffer);
    for (int64_t i = 0; i < n; i++) {
        const int64_t count = offsets[i + 1] - offsets[i];
        *(int32_t *)bt_rows_next(&r) = BT_XDMF_POLYGON;
        *(int32_t *)bt_rows_next(&r) = (int32_t)count;
        for (int64_t v = 0; v < count; v++)
            *(int32_t *)bt_rows_next(&r) = (int32_t)(before + offsets[i] - v0 + (o->mirrored ? count - 1 - v : v));
    }
    bt_rows_end(&r);
}

/// The ids of the floes, their rows: ParaView numbers the cells of a selection anew.
static void write_ids(bt_frames *f)
{
    bt_slab ids = bt_slab_fixed(f->h, "/xdmf/floe_id", H5T_NATIVE_INT32, f->n_floes, 0, true);
    bt_h5_describe(f->h, "/xdmf/floe_id", "floe", "1", "id of each floe");
    if (bt_slab_share(f->comm, (bt_slab *const[]){&ids}, 1) == BT_OK) {
        char *buffer = bt_alloc(BT_SLAB_BYTES, 1);
        bt_rows r = bt_rows_from(&ids, f->first, buffer);
        for (int64_t i = 0; i < f->own_floes; i++) *(int32_t *)bt_rows_next(&r) = (int32_t)(f->first + i);
        bt_rows_end(&r);
        free(buffer);
    }
    bt_slab_close(&ids);
}

static void write_bodies(bt_frames *f, const bt_record_bodies *b)
{
    bt_h5 *h = f->h;
    bt_h5_group(h, "/floes");
    bt_h5_group(h, "/bodies");
    bt_h5_group(h, "/xdmf");
    outlines o[2] = {create_outlines(f, "/floes", "thickness", "/xdmf/floes", f->n_floes, f->floe_vertices),
                     create_outlines(f, "/bodies", "height", "/xdmf/bodies", f->n_others, f->other_vertices)};
    describe_axes(h, &f->axes);
    describe(h, b);
    bt_slab *all[] = {&o[0].vertices, &o[0].offsets, &o[0].thickness, &o[0].area, &o[0].topology,
                      &o[1].vertices, &o[1].offsets, &o[1].thickness, &o[1].area, &o[1].topology};
    enum { N = sizeof all / sizeof *all };
    const bool last = f->comm->rank == f->comm->size - 1;
    write_ids(f);
    if (bt_slab_share(f->comm, all, N) == BT_OK) {
        char *buffer = bt_alloc(BT_SLAB_BYTES, 1);
        // An empty block of floes still has the 0 of the offsets to write if it is the first rank.
        if (f->own_floes > 0 || (last && f->n_floes == 0))
            write_outlines(&o[0], b, 0, f->own_floes, f->first, f->vertices_before, buffer);
        if (last) write_outlines(&o[1], b, f->own_floes, f->own_others, 0, 0, buffer);
        free(buffer);
    }
    for (int k = 0; k < N; k++) bt_slab_close(all[k]);
}

static void keep_outlines(bt_frames *f, const bt_record_bodies *b)
{
    f->bodies = b->all;
    if (f->bodies) return;
    const int64_t n = f->own_floes + f->own_others, nv = b->offsets[n] - b->offsets[0];
    f->n_vertices = bt_alloc((size_t)n, sizeof *f->n_vertices);
    f->vertices = bt_alloc(2 * (size_t)nv, sizeof *f->vertices);
    for (int64_t i = 0; i < n; i++) f->n_vertices[i] = (uint8_t)(b->offsets[i + 1] - b->offsets[i]);
    for (int64_t v = 0; v < 2 * nv; v++) f->vertices[v] = (float)b->vertices[v];
}

static void create_datasets(bt_frames *f)
{
    bt_h5 *h = f->h;
    bt_h5_group(h, "/frames");
    f->time = bt_h5_growing(h, "/frames/time", H5T_NATIVE_DOUBLE, 1, NULL, (hsize_t[]){256, 1}, false);
    f->pose = bt_slab_growing(h, "/frames/pose", H5T_NATIVE_DOUBLE, f->n_floes, 3);
    f->body_pose = bt_slab_growing(h, "/frames/body_pose", H5T_NATIVE_DOUBLE, f->n_others, 3);
    f->contact_force = bt_slab_growing(h, "/frames/contact_force", H5T_NATIVE_DOUBLE, f->n_floes, 0);
    f->speed = bt_slab_growing(h, "/frames/speed", H5T_NATIVE_DOUBLE, f->n_floes + f->n_others, 0);
    f->velocity = bt_slab_growing(h, "/frames/velocity", H5T_NATIVE_FLOAT, f->n_floes + f->n_others, 2);
    f->net_force = bt_slab_growing(h, "/frames/net_force", H5T_NATIVE_FLOAT, f->n_floes + f->n_others, 2);
    bt_h5_describe(h, "/frames/time", "time", "s", "time of each frame, since the start of the run");
    bt_h5_describe(h, "/frames/pose", "time floe component", "m, m, rad", "x, y, yaw of each floe");
    bt_h5_describe(h, "/frames/body_pose", "time body component", "m, m, rad", "x, y, yaw of each of /bodies");
    bt_h5_describe(h, "/frames/contact_force", "time floe", "N",
                   "largest normal contact force on the floe in the step, NaN where that has no solution");
    bt_h5_describe(h, "/frames/speed", "time floe_or_body", "m/s", "speed of the centroid: floes, then /bodies");
    bt_h5_describe(h, "/frames/velocity", "time floe_or_body xy", "m/s",
                   "velocity of the centroid: floes, then /bodies");
    bt_h5_describe(h, "/frames/net_force", "time floe_or_body xy", "N",
                   "sum of all contact forces in the step, NaN where that has no solution: floes, then /bodies");
    if (!f->branches) return;
    const hsize_t k = (hsize_t)f->branches;
    f->line_points = bt_h5_growing(h, "/frames/line_points", H5T_NATIVE_DOUBLE, 3, (hsize_t[]){2 * k, 2},
                                   (hsize_t[]){64, 2 * k}, false);
    f->line_tension = bt_h5_growing(h, "/frames/line_tension", H5T_NATIVE_DOUBLE, 2, &k, (hsize_t[]){64, k}, false);
    bt_h5_describe(h, "/frames/line_points", "time line_point xy", "m",
                   "ends of the branches of the tow line: hull, towing end of the first, then of the second");
    bt_h5_describe(h, "/frames/line_tension", "time branch", "N", "tension of each branch, 0 once it is broken");
}

void bt_record_blocks(const bt_comm *c, bt_idx n_floes, bt_idx n_bodies, int64_t *first)
{
    for (int k = 0; k < c->size; k++) first[k] = bt_comm_first(c, k, n_floes);
    first[c->size] = n_bodies;
}

void bt_frames_create(bt_frames *f, bt_h5 *h, const bt_comm *c, const bt_record_bodies *b, const bt_map_axes *axes)
{
    *f = (bt_frames){.h = h, .comm = c, .axes = *axes, .n_floes = b->n_floes,
                     .n_others = b->n_bodies - b->n_floes, .time = -1,
                     .towed = b->towed < 0 ? -1 : b->towed - b->n_floes, .branches = b->branches, .line_points = -1,
                     .line_tension = -1};
    f->first = bt_comm_first(c, c->rank, b->n_floes);
    f->own_floes = bt_comm_first(c, c->rank + 1, b->n_floes) - f->first;
    f->own_others = c->rank == c->size - 1 ? f->n_others : 0;
    const int64_t *end = b->offsets + f->own_floes;
    f->vertices_before = bt_comm_before(c, end[0] - b->offsets[0], &f->floe_vertices);
    bt_comm_before(c, end[f->own_others] - end[0], &f->other_vertices);
    keep_outlines(f, b);
    write_bodies(f, b);
    create_datasets(f);
}

/// Quantities of a frame that are written row by row.
enum quantity { POSE, FORCE, SPEED, VELOCITY, NET, FORCE_4, SPEED_4, VELOCITY_4, NET_4 };

/// ParaView's vectors have three components.
static void draw_vector(const bt_frames *f, double x, double y, float to[3])
{
    double drawn[2];
    bt_map_axes_vector(&f->axes, x, y, drawn);
    to[0] = (float)drawn[0], to[1] = (float)drawn[1], to[2] = 0;
}

/// Bodies from .. from + n of the block to rows first .. first + n.
static void write_rows(const bt_frames *f, bt_slab *s, enum quantity q, int64_t first, const bt_frame_row *row,
                       int64_t n, char *buffer)
{
    bt_rows r = bt_rows_from(s, first, buffer);
    for (int64_t i = 0; i < n; i++) {
        void *to = bt_rows_next(&r);
        switch (q) {
        case POSE: memcpy(to, (const double[3]){row[i].x, row[i].y, row[i].yaw}, 3 * sizeof(double)); break;
        case FORCE: *(double *)to = row[i].contact_force; break;
        case SPEED: *(double *)to = row[i].speed; break;
        case VELOCITY: memcpy(to, (const float[2]){(float)row[i].vx, (float)row[i].vy}, 2 * sizeof(float)); break;
        case NET: memcpy(to, (const float[2]){(float)row[i].fx, (float)row[i].fy}, 2 * sizeof(float)); break;
        case FORCE_4: *(float *)to = (float)row[i].contact_force; break;
        case SPEED_4: *(float *)to = (float)row[i].speed; break;
        case VELOCITY_4: draw_vector(f, row[i].vx, row[i].vy, to); break;
        case NET_4: draw_vector(f, row[i].fx, row[i].fy, to); break;
        }
    }
    bt_rows_end(&r);
}

/// Outline of body i of the block in its own frame, in single precision; returns its number of vertices. `at`: vertices
/// of the block before it.
static int outline_of(const bt_frames *f, int64_t i, int64_t at, float *v)
{
    if (!f->bodies) {
        memcpy(v, f->vertices + 2 * at, 2 * f->n_vertices[i] * sizeof *v);
        return f->n_vertices[i];
    }
    const bt_idx k = f->bodies->index_of[i]; // one rank's block is all bodies, by their ids
    const double *own = f->bodies->vertices + 2 * f->bodies->offset[k];
    const int n = bt_body_corners(f->bodies, k);
    for (int c = 0; c < 2 * n; c++) v[c] = (float)own[c];
    return n;
}

/// All vertices of bodies from .. from + n of the block as drawn; `local`: vertices of the block before them.
static void write_points(const bt_frames *f, bt_slab *s, int64_t first, const bt_frame_row *row, int64_t from,
                         int64_t n, int64_t local, char *buffer)
{
    bt_rows r = bt_rows_from(s, first, buffer);
    float p[2 * BT_MAX_VERTICES];
    for (int64_t i = from; i < from + n; i++) {
        const double c = bt_cos(row[i].yaw), sine = bt_sin(row[i].yaw);
        const int corners = outline_of(f, i, local, p);
        local += corners;
        const bool gone = isnan(row[i].x); // a floe that has split: all of it in one point
        for (int v = 0; v < corners; v++) {
            float *to = bt_rows_next(&r);
            double drawn[2];
            bt_map_axes_point(&f->axes, row[i].x + c * (double)p[2 * v] - sine * (double)p[2 * v + 1],
                              row[i].y + sine * (double)p[2 * v] + c * (double)p[2 * v + 1], drawn);
            to[0] = gone ? 0 : (float)drawn[0], to[1] = gone ? 0 : (float)drawn[1];
        }
    }
    bt_rows_end(&r);
}

/// Datasets of the frame in single precision, see xdmf.c.
typedef struct paraview { bt_slab points, speed, velocity, net_force, force; } paraview;

static paraview create_paraview(bt_frames *f, const char *kind, int64_t cells, int64_t points, bool force)
{
    char path[64];
#define NAMED(name) (snprintf(path, sizeof path, "/xdmf/%06lld/%s_%s", (long long)f->n, kind, name), path)
    paraview p = {
        .points = bt_slab_fixed(f->h, NAMED("points"), H5T_NATIVE_FLOAT, points, 2, true),
        .speed = bt_slab_fixed(f->h, NAMED("speed"), H5T_NATIVE_FLOAT, cells, 0, true),
        .velocity = bt_slab_fixed(f->h, NAMED("velocity"), H5T_NATIVE_FLOAT, cells, 3, true),
        .net_force = bt_slab_fixed(f->h, NAMED("net_force"), H5T_NATIVE_FLOAT, cells, 3, true),
        .force = {.h = f->h, .dataset = -1, .piece = 1, .row_bytes = 4},
    };
    if (force) p.force = bt_slab_fixed(f->h, NAMED("force"), H5T_NATIVE_FLOAT, cells, 0, true);
    // Without axes: each scale lists all that it belongs to, in one attribute of 64 kB at most.
    const char *const names[] = {"points", "speed", "velocity", "net_force", "force"},
                      *const units[] = {"m", "m/s", "m/s", "N", "N"},
                      *const texts[] = {"every vertex, along the axes of /xdmf, from its origin",
                                        "speed of the centroid", "velocity of the centroid along these axes, and 0",
                                        "sum of all contact forces in the step along these axes, and 0",
                                        "largest normal contact force in the step"};
    for (int k = 0; k < (force ? 5 : 4); k++) {
        bt_h5_attr_text(f->h, NAMED(names[k]), "units", units[k]);
        bt_h5_attr_text(f->h, path, "long_name", texts[k]);
    }
#undef NAMED
    return p;
}

static void write_frame(bt_frames *f, paraview *floes, paraview *others, const bt_frame_row *rows)
{
    char *buffer = bt_alloc(BT_SLAB_BYTES, 1);
    const int64_t nf = f->own_floes, nb = f->own_others;
    write_rows(f, &f->pose, POSE, f->first, rows, nf, buffer);
    write_rows(f, &f->contact_force, FORCE, f->first, rows, nf, buffer);
    write_rows(f, &f->speed, SPEED, f->first, rows, nf + nb, buffer);
    write_rows(f, &f->velocity, VELOCITY, f->first, rows, nf + nb, buffer);
    write_rows(f, &f->net_force, NET, f->first, rows, nf + nb, buffer);
    write_rows(f, &f->body_pose, POSE, 0, rows + nf, nb, buffer);
    write_points(f, &floes->points, f->vertices_before, rows, 0, nf, 0, buffer);
    write_rows(f, &floes->speed, SPEED_4, f->first, rows, nf, buffer);
    write_rows(f, &floes->velocity, VELOCITY_4, f->first, rows, nf, buffer);
    write_rows(f, &floes->net_force, NET_4, f->first, rows, nf, buffer);
    write_rows(f, &floes->force, FORCE_4, f->first, rows, nf, buffer);
    write_points(f, &others->points, 0, rows, nf, nb, f->floe_vertices - f->vertices_before, buffer);
    write_rows(f, &others->speed, SPEED_4, 0, rows + nf, nb, buffer);
    write_rows(f, &others->velocity, VELOCITY_4, 0, rows + nf, nb, buffer);
    write_rows(f, &others->net_force, NET_4, 0, rows + nf, nb, buffer);
    free(buffer);
}

/// Of all ranks one writes; the line is the same on all.
static void write_line(bt_frames *f, const bt_frame_line *line)
{
    bt_h5_append(f->h, f->line_points, H5T_NATIVE_DOUBLE, (hsize_t)f->n, 1, line->point);
    bt_h5_append(f->h, f->line_tension, H5T_NATIVE_DOUBLE, (hsize_t)f->n, 1, line->tension);
}

char *bt_frames_group(const bt_frames *f, char path[64])
{
    snprintf(path, 64, "/xdmf/%06lld", (long long)f->n);
    return path;
}

bt_status bt_frames_add(bt_frames *f, double time, const bt_frame_row *rows, const bt_frame_line *line)
{
    bt_h5 *h = f->h;
    bt_status status = bt_comm_agree(f->comm, h->status);
    if (status != BT_OK) return status;
    bt_slab_grow(&f->pose, f->n);
    bt_slab_grow(&f->body_pose, f->n);
    bt_slab_grow(&f->contact_force, f->n);
    bt_slab_grow(&f->speed, f->n);
    bt_slab_grow(&f->velocity, f->n);
    bt_slab_grow(&f->net_force, f->n);
    paraview floes = create_paraview(f, "floe", f->n_floes, f->floe_vertices, true);
    paraview others = create_paraview(f, "body", f->n_others, f->other_vertices, false);
    bt_slab *shared[] = {&f->pose, &f->body_pose, &f->contact_force, &f->speed, &f->velocity,
                         &f->net_force, // these stay open
                         &floes.points, &floes.speed, &floes.velocity, &floes.net_force, &floes.force,
                         &others.points, &others.speed, &others.velocity, &others.net_force};
    enum { N = sizeof shared / sizeof *shared, STAY = 6 };
    status = bt_slab_share(f->comm, shared, N);
    if (status == BT_OK) write_frame(f, &floes, &others, rows);
    for (int k = STAY; k < N; k++) bt_slab_close(shared[k]);
    // The time comes last: a reader that counts frames by it finds them whole.
    status = bt_comm_agree(f->comm, h->status);
    if (status != BT_OK) {
        bt_h5_give_up(h, status);
        return status;
    }
    if (f->branches) write_line(f, line);
    bt_h5_append(h, f->time, H5T_NATIVE_DOUBLE, (hsize_t)f->n, 1, &time);
    if (f->n == f->cap) {
        f->cap = f->cap ? 2 * f->cap : 64;
        f->times = bt_realloc(f->times, (size_t)f->cap, sizeof *f->times);
        if (f->branches) f->lines = bt_realloc(f->lines, (size_t)f->cap, sizeof *f->lines);
    }
    if (f->branches) f->lines[f->n] = *line;
    f->times[f->n++] = time;
    return BT_OK;
}

void bt_frames_close(bt_frames *f)
{
    bt_slab *all[] = {&f->pose, &f->body_pose, &f->contact_force, &f->speed, &f->velocity, &f->net_force};
    for (int k = 0; k < 6; k++)
        if (all[k]->h) bt_slab_close(all[k]);
    const hid_t datasets[] = {f->time, f->line_points, f->line_tension};
    for (int k = 0; k < 3; k++)
        if (f->h && datasets[k] >= 0) H5Dclose(datasets[k]);
    free(f->lines);
    free(f->vertices);
    free(f->n_vertices);
    free(f->times);
    *f = (bt_frames){.time = -1, .line_points = -1, .line_tension = -1};
}
