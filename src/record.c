// SPDX-License-Identifier: MIT
// What a run leaves behind: result.h5 while it runs, case.resolved.yml before, summary.json and frames.xdmf after it.
//
// result.h5 is written under its own name, so that a running calculation can be watched: after each flush all series have
// one length and the file is complete up to then (attribute "complete" of the root: 0 until the run has closed it). The
// small text files are written under a temporary name and renamed.
#include "bergtow/record.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fileio.h"
#include "h5util.h"
#include "provenance.h"
#include "summary.h"
#include "xdmf.h"

#define BUFFER 256        // entries of the series between flushes, and in a chunk
#define FLUSH_SECONDS 5.0 // wall time between flushes

struct bt_record {
    bt_h5 h5;
    char *dir;
    const bt_case *c;
    bt_idx n_floes, n_bodies, towed;
    int64_t *offsets;      ///< [n_bodies+1], from 0
    double *vertices;      ///< [offsets[n_bodies]][2] m
    bt_history history;
    // series
    hid_t *series;         ///< [bt_n_series_fields]
    double *buffer;        ///< [bt_n_series_fields][BUFFER]
    int64_t written, buffered;
    bt_sample merged;      ///< of the steps of the present entry
    int64_t n_merged;
    double last_flush;     ///< bt_clock
    // frames
    hid_t frame_time, pose, body_pose, contact_force, speed;
    double *times;         ///< [n_frames] s
    int64_t n_frames, cap_frames;
    float *world;          ///< [offsets[n_bodies]][2] m, scratch
    float *cells;          ///< [n_bodies] scratch
};

static void write_bodies(bt_record *r, const bt_record_bodies *b)
{
    bt_h5 *h = &r->h5;
    const bt_idx nf = r->n_floes, nb = r->n_bodies - nf;
    const hsize_t floe_vertices = (hsize_t)r->offsets[nf], vertices = (hsize_t)r->offsets[r->n_bodies];

    bt_h5_group(h, "/floes");
    bt_h5_write(h, "/floes/vertices", H5T_NATIVE_DOUBLE, floe_vertices, 2, r->vertices);
    bt_h5_write(h, "/floes/offsets", H5T_NATIVE_INT64, (hsize_t)nf + 1, 0, r->offsets);
    bt_h5_write(h, "/floes/thickness", H5T_NATIVE_DOUBLE, (hsize_t)nf, 0, b->thickness);
    bt_h5_write(h, "/floes/area", H5T_NATIVE_DOUBLE, (hsize_t)nf, 0, b->area);
    bt_h5_attr_text(h, "/floes/vertices", "units", "m");
    bt_h5_attr_text(h, "/floes/vertices", "description", "x, y in the frame of the floe, anticlockwise about its centroid");
    bt_h5_attr_text(h, "/floes/offsets", "description", "floe i has the vertices offsets[i] up to offsets[i + 1]");
    bt_h5_attr_text(h, "/floes/thickness", "units", "m");
    bt_h5_attr_text(h, "/floes/area", "units", "m2");

    int64_t *local = bt_alloc((size_t)nb + 1, sizeof *local);
    for (bt_idx i = 0; i <= nb; i++) local[i] = r->offsets[nf + i] - r->offsets[nf];
    const int64_t towed = r->towed < 0 ? -1 : r->towed - nf;
    bt_h5_group(h, "/bodies");
    bt_h5_write(h, "/bodies/vertices", H5T_NATIVE_DOUBLE, vertices - floe_vertices, 2, r->vertices + 2 * floe_vertices);
    bt_h5_write(h, "/bodies/offsets", H5T_NATIVE_INT64, (hsize_t)nb + 1, 0, local);
    bt_h5_write(h, "/bodies/height", H5T_NATIVE_DOUBLE, (hsize_t)nb, 0, b->thickness + nf);
    bt_h5_write(h, "/bodies/area", H5T_NATIVE_DOUBLE, (hsize_t)nb, 0, b->area + nf);
    bt_h5_write_names(h, "/bodies/names", (hsize_t)nb, b->names);
    bt_h5_write(h, "/bodies/towed", H5T_NATIVE_INT64, 1, 0, &towed);
    bt_h5_attr_text(h, "/bodies/vertices", "units", "m");
    bt_h5_attr_text(h, "/bodies/height", "units", "m");
    bt_h5_attr_text(h, "/bodies/height", "description", "draft + sail of the towed body, 0 for walls");
    bt_h5_attr_text(h, "/bodies/area", "units", "m2");
    bt_h5_attr_text(h, "/bodies/towed", "description", "which of these bodies is towed, -1 = none");
    free(local);

    // Vertex numbers in XDMF are of 32 bits here: enough for 2^31 vertices a block.
    const int64_t starts[] = {0, nf}, counts[] = {nf, nb};
    const char *const names[] = {"/xdmf/floes", "/xdmf/bodies"};
    bt_h5_group(h, "/xdmf");
    for (int k = 0; k < 2; k++) {
        const int64_t *offsets = r->offsets + starts[k], n = bt_xdmf_topology(counts[k], offsets, NULL);
        int32_t *topology = bt_alloc((size_t)n, sizeof *topology);
        bt_xdmf_topology(counts[k], offsets, topology);
        bt_h5_write(h, names[k], H5T_NATIVE_INT32, (hsize_t)n, 0, topology);
        free(topology);
    }
}

static void create_series(bt_record *r)
{
    static const char *const merge[] = {[BT_KEEP_LAST] = "last step", [BT_KEEP_MEAN] = "mean of the steps",
                                        [BT_KEEP_MAX] = "largest of the steps", [BT_KEEP_SUM] = "sum of the steps"};
    bt_h5_group(&r->h5, "/series");
    const int64_t every = r->c->output.sample_every;
    bt_h5_attr_int(&r->h5, "/series", "steps_per_sample", every > 1 ? every : 1);
    for (int k = 0; k < bt_n_series_fields; k++) {
        const bt_series_field *f = &bt_series_fields[k];
        char *name = bt_file_join("/series", f->name);
        r->series[k] = bt_h5_growing(&r->h5, name, H5T_NATIVE_DOUBLE, 1, NULL, BUFFER, false);
        bt_h5_attr_text(&r->h5, name, "units", f->units);
        bt_h5_attr_text(&r->h5, name, "description", f->description);
        bt_h5_attr_text(&r->h5, name, "merge", merge[f->keep]);
        free(name);
    }
}

static void create_frames(bt_record *r)
{
    bt_h5 *h = &r->h5;
    const hsize_t nf = (hsize_t)r->n_floes, nb = (hsize_t)(r->n_bodies - r->n_floes), all = (hsize_t)r->n_bodies;
    bt_h5_group(h, "/frames");
    r->frame_time = bt_h5_growing(h, "/frames/time", H5T_NATIVE_DOUBLE, 1, NULL, BUFFER, false);
    r->pose = bt_h5_growing(h, "/frames/pose", H5T_NATIVE_DOUBLE, 3, (hsize_t[]){nf, 3}, 1, true);
    r->body_pose = bt_h5_growing(h, "/frames/body_pose", H5T_NATIVE_DOUBLE, 3, (hsize_t[]){nb, 3}, 1, true);
    r->contact_force = bt_h5_growing(h, "/frames/contact_force", H5T_NATIVE_DOUBLE, 2, &nf, 1, true);
    r->speed = bt_h5_growing(h, "/frames/speed", H5T_NATIVE_DOUBLE, 2, &all, 1, true);
    bt_h5_attr_text(h, "/frames/time", "units", "s");
    bt_h5_attr_text(h, "/frames/pose", "units", "m, m, rad");
    bt_h5_attr_text(h, "/frames/pose", "description", "x, y, yaw of each floe");
    bt_h5_attr_text(h, "/frames/body_pose", "units", "m, m, rad");
    bt_h5_attr_text(h, "/frames/body_pose", "description", "x, y, yaw of each of /bodies");
    bt_h5_attr_text(h, "/frames/contact_force", "units", "N");
    bt_h5_attr_text(h, "/frames/contact_force", "description", "largest normal contact force on the floe in the step");
    bt_h5_attr_text(h, "/frames/speed", "units", "m/s");
    bt_h5_attr_text(h, "/frames/speed", "description", "speed of the centroid: floes, then /bodies");
}

static void record_free(bt_record *r)
{
    bt_history_free(&r->history);
    free(r->dir);
    free(r->offsets);
    free(r->vertices);
    free(r->series);
    free(r->buffer);
    free(r->times);
    free(r->world);
    free(r->cells);
    free(r);
}

/// Close datasets and file; returns the status of everything that went to the file.
static bt_status close_file(bt_record *r)
{
    const hid_t frames[] = {r->frame_time, r->pose, r->body_pose, r->contact_force, r->speed};
    for (int k = 0; k < bt_n_series_fields; k++)
        if (r->series[k] >= 0) H5Dclose(r->series[k]);
    for (size_t k = 0; k < sizeof frames / sizeof *frames; k++)
        if (frames[k] >= 0) H5Dclose(frames[k]);
    return bt_h5_close(&r->h5);
}

static bt_status write_text(const bt_record *r, const char *name, const char *text, bt_errors *err)
{
    char *path = bt_file_join(r->dir, name);
    const bt_status status = bt_file_write(path, text, err);
    free(path);
    return status;
}

/// The folder, without what an earlier run left there, and the resolved case in it.
static bt_status prepare_dir(const bt_record *r, const char *resolved, bt_errors *err)
{
    bt_status status = bt_file_make_dir(r->dir, err);
    static const char *const stale[] = {"summary.json", "frames.xdmf"};
    for (size_t k = 0; k < 2 && status == BT_OK; k++) {
        char *path = bt_file_join(r->dir, stale[k]);
        status = bt_file_remove(path, err);
        free(path);
    }
    return status == BT_OK ? write_text(r, "case.resolved.yml", resolved, err) : status;
}

bt_status bt_record_open(bt_record **out, const char *dir, const bt_case *c, const bt_record_bodies *b,
                         const char *command_line, bt_errors *err)
{
    *out = NULL;
    bt_record *r = bt_alloc(1, sizeof *r);
    r->dir = strdup(dir);
    r->c = c;
    r->n_floes = b->n_floes;
    r->n_bodies = b->n_bodies;
    r->towed = b->towed;
    r->last_flush = bt_clock();
    bt_history_init(&r->history);
    r->offsets = bt_alloc((size_t)b->n_bodies + 1, sizeof *r->offsets);
    for (bt_idx i = 0; i <= b->n_bodies; i++) r->offsets[i] = b->offsets[i] - b->offsets[0];
    const size_t coordinates = 2 * (size_t)r->offsets[b->n_bodies];
    r->vertices = bt_alloc(coordinates, sizeof *r->vertices);
    if (coordinates) memcpy(r->vertices, b->vertices + 2 * b->offsets[0], coordinates * sizeof *r->vertices);
    r->world = bt_alloc(coordinates, sizeof *r->world);
    r->cells = bt_alloc((size_t)b->n_bodies, sizeof *r->cells);
    r->buffer = bt_alloc((size_t)bt_n_series_fields * BUFFER, sizeof *r->buffer);
    r->series = bt_alloc((size_t)bt_n_series_fields, sizeof *r->series);
    for (int k = 0; k < bt_n_series_fields; k++) r->series[k] = -1;
    r->frame_time = r->pose = r->body_pose = r->contact_force = r->speed = -1;
    r->h5.file = -1;

    char *resolved = bt_case_resolved(c), *path = bt_file_join(dir, "result.h5");
    bt_status status = prepare_dir(r, resolved, err);
    if (status == BT_OK) status = bt_h5_create(&r->h5, path, err);
    if (status == BT_OK) {
        bt_h5_attr_int(&r->h5, "/", "complete", 0);
        bt_provenance_write(&r->h5, command_line);
        bt_h5_write_text(&r->h5, "/case", resolved);
        bt_h5_write_text(&r->h5, "/case_as_given", c->text ? c->text : "");
        write_bodies(r, b);
        create_series(r);
        create_frames(r);
        bt_h5_flush(&r->h5);
        status = r->h5.status;
        if (status != BT_OK) close_file(r);
    }
    free(resolved);
    free(path);
    if (status != BT_OK) {
        record_free(r);
        return status;
    }
    *out = r;
    return BT_OK;
}

static double *member(bt_sample *s, int k) { return (double *)(void *)((char *)s + bt_series_fields[k].offset); }

static double member_of(const bt_sample *s, int k)
{
    double value;
    memcpy(&value, (const char *)s + bt_series_fields[k].offset, sizeof value);
    return value;
}

static void write_buffer(bt_record *r)
{
    for (int k = 0; k < bt_n_series_fields; k++)
        bt_h5_append(&r->h5, r->series[k], H5T_NATIVE_DOUBLE, (hsize_t)r->written, (hsize_t)r->buffered,
                     r->buffer + (size_t)k * BUFFER);
    r->written += r->buffered;
    r->buffered = 0;
    bt_h5_flush(&r->h5);
    r->last_flush = bt_clock();
}

/// Move the merged steps to the buffer as one entry.
static void end_entry(bt_record *r)
{
    for (int k = 0; k < bt_n_series_fields; k++) {
        double value = *member(&r->merged, k);
        if (bt_series_fields[k].keep == BT_KEEP_MEAN) value /= (double)r->n_merged;
        r->buffer[(size_t)k * BUFFER + (size_t)r->buffered] = value;
    }
    r->buffered++;
    r->n_merged = 0;
}

bt_status bt_record_sample(bt_record *r, const bt_sample *s, bt_errors *err)
{
    if (r->h5.status != BT_OK) return r->h5.status;
    r->h5.err = err;
    bt_history_add(&r->history, s);
    for (int k = 0; k < bt_n_series_fields; k++) {
        double *m = member(&r->merged, k);
        const double x = member_of(s, k);
        switch (r->n_merged ? bt_series_fields[k].keep : BT_KEEP_LAST) {
        case BT_KEEP_LAST: *m = x; break;
        case BT_KEEP_MEAN:
        case BT_KEEP_SUM: *m += x; break;
        case BT_KEEP_MAX: *m = bt_max_seen(*m, x); break;
        }
    }
    if (++r->n_merged >= r->c->output.sample_every) end_entry(r);
    if (r->buffered == BUFFER || (r->buffered > 0 && bt_clock() - r->last_flush > FLUSH_SECONDS)) write_buffer(r);
    return r->h5.status;
}

static void place_vertices(bt_record *r, const double *pose)
{
    for (bt_idx i = 0; i < r->n_bodies; i++) {
        const double x = pose[3 * i], y = pose[3 * i + 1], c = cos(pose[3 * i + 2]), s = sin(pose[3 * i + 2]);
        for (int64_t v = r->offsets[i]; v < r->offsets[i + 1]; v++) {
            const double px = r->vertices[2 * v], py = r->vertices[2 * v + 1];
            r->world[2 * v] = (float)(x + c * px - s * py);
            r->world[2 * v + 1] = (float)(y + s * px + c * py);
        }
    }
}

/// One dataset of the frame's group in single precision.
static void write_cells(bt_record *r, const char *name, const double *x, bt_idx n)
{
    char path[64];
    snprintf(path, sizeof path, "/xdmf/%06lld/%s", (long long)r->n_frames, name);
    for (bt_idx i = 0; i < n; i++) r->cells[i] = (float)x[i];
    bt_h5_write_packed(&r->h5, path, H5T_NATIVE_FLOAT, (hsize_t)n, 0, r->cells);
}

/// What frames.xdmf refers to, see xdmf.c.
static void write_for_paraview(bt_record *r, const double *contact_force, const double *speed)
{
    const bt_idx nf = r->n_floes, nb = r->n_bodies - nf;
    const int64_t floe_vertices = r->offsets[nf], body_vertices = r->offsets[r->n_bodies] - floe_vertices;
    char path[64];
    snprintf(path, sizeof path, "/xdmf/%06lld", (long long)r->n_frames);
    bt_h5_group(&r->h5, path);
    if (nf > 0) {
        snprintf(path, sizeof path, "/xdmf/%06lld/floe_points", (long long)r->n_frames);
        bt_h5_write_packed(&r->h5, path, H5T_NATIVE_FLOAT, (hsize_t)floe_vertices, 2, r->world);
        write_cells(r, "floe_speed", speed, nf);
        write_cells(r, "floe_force", contact_force, nf);
    }
    if (nb > 0) {
        snprintf(path, sizeof path, "/xdmf/%06lld/body_points", (long long)r->n_frames);
        bt_h5_write_packed(&r->h5, path, H5T_NATIVE_FLOAT, (hsize_t)body_vertices, 2, r->world + 2 * floe_vertices);
        write_cells(r, "body_speed", speed + nf, nb);
    }
}

bt_status bt_record_frame(bt_record *r, double time, const double *pose, const double *contact_force,
                          const double *speed, bt_errors *err)
{
    bt_h5 *h = &r->h5;
    if (h->status != BT_OK) return h->status;
    h->err = err;
    const hsize_t at = (hsize_t)r->n_frames;
    place_vertices(r, pose);
    bt_h5_append(h, r->frame_time, H5T_NATIVE_DOUBLE, at, 1, &time);
    bt_h5_append(h, r->pose, H5T_NATIVE_DOUBLE, at, 1, pose);
    bt_h5_append(h, r->body_pose, H5T_NATIVE_DOUBLE, at, 1, pose + 3 * (size_t)r->n_floes);
    bt_h5_append(h, r->contact_force, H5T_NATIVE_DOUBLE, at, 1, contact_force);
    bt_h5_append(h, r->speed, H5T_NATIVE_DOUBLE, at, 1, speed);
    write_for_paraview(r, contact_force, speed);
    if (h->status != BT_OK) return h->status;
    if (r->n_frames == r->cap_frames) {
        r->cap_frames = r->cap_frames ? 2 * r->cap_frames : 64;
        r->times = bt_realloc(r->times, (size_t)r->cap_frames, sizeof *r->times);
    }
    r->times[r->n_frames++] = time;
    write_buffer(r);
    return h->status;
}

static void write_totals(bt_record *r, const bt_run_totals *t)
{
    bt_h5_attr_int(&r->h5, "/", "ranks", t->ranks);
    bt_h5_attr_int(&r->h5, "/", "threads", t->threads);
    bt_h5_attr_int(&r->h5, "/", "n_steps", t->n_steps);
    bt_h5_attr_double(&r->h5, "/", "wall_time", t->wall_time);
    bt_h5_attr_text(&r->h5, "/", "stopped", t->stopped ? t->stopped : "");
    bt_h5_flush(&r->h5);
    bt_h5_attr_int(&r->h5, "/", "complete", 1);
}

static bt_status write_xdmf(const bt_record *r, bt_errors *err)
{
    char *text = bt_xdmf_text(&(bt_xdmf){
        .n_floes = r->n_floes, .n_bodies = r->n_bodies - r->n_floes, .floe_vertices = r->offsets[r->n_floes],
        .body_vertices = r->offsets[r->n_bodies] - r->offsets[r->n_floes], .time = r->times, .n_frames = r->n_frames});
    const bt_status status = write_text(r, "frames.xdmf", text, err);
    free(text);
    return status;
}

static bt_status write_summary(const bt_record *r, const bt_run_totals *t, bt_errors *err)
{
    bt_summary s;
    bt_summary_make(&s, &r->history, r->c, t, r->n_floes, r->towed >= 0);
    char *text = bt_summary_json(&s, &r->history, r->c, t, r->n_floes);
    const bt_status status = write_text(r, "summary.json", text, err);
    free(text);
    bt_summary_free(&s);
    return status;
}

bt_status bt_record_close(bt_record *r, const bt_run_totals *t, bt_errors *err)
{
    r->h5.err = err;
    if (r->n_merged > 0) end_entry(r);
    write_buffer(r);
    if (t) write_totals(r, t);
    bt_status status = close_file(r);
    // The summary comes last: where there is one, the rest is complete.
    if (status == BT_OK) status = write_xdmf(r, err);
    if (status == BT_OK && t) status = write_summary(r, t, err);
    record_free(r);
    return status;
}

void bt_record_print_summary(const bt_record *r, const bt_run_totals *t)
{
    bt_summary s;
    bt_summary_make(&s, &r->history, r->c, t, r->n_floes, r->towed >= 0);
    bt_summary_print(&s, &r->history, r->c, t, r->n_floes);
    bt_summary_free(&s);
}
