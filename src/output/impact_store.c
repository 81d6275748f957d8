// SPDX-License-Identifier: MIT
// Datasets of collisions and panels; one table names the columns of a collision.
#include "output/impact_store.h"

#include <string.h>

#include "base/fileio.h"
#include "base/h5dataset.h"
#include "base/inside.h"

#define CHUNK 256 // rows of collisions in a chunk: 2 kB per column
#define PIECE 8192 // rows read back at once

static const struct {
    const char *name, *units, *description;
    size_t offset;
    bool whole;
} columns[] = {
#define ROW(name_, member, whole_, units_, text) {name_, units_, text, offsetof(bt_impact, member), whole_}
    ROW("time", time, false, "s", "end of the step in which the collision began"),
    ROW("floe", gid, true, "1",
        "row of /floes; from n_floes on one of /bodies, as a wall; after these a row of /pieces; of fixed floes that "
        "lie against each other, which are one collision, the one with the largest part"),
    ROW("x", x, false, "m", "where on the hull, in the frame of the towed body"),
    ROW("y", y, false, "m", "where on the hull, in the frame of the towed body"),
    ROW("panel", panel, true, "1", "panel of the hull"),
    ROW("impulse", impulse, false, "N s", "normal impulse that the approach explains, over all its steps"),
    ROW("approach", approach, false, "m/s", "normal speed of approach at the start of the first step"),
    ROW("effective_mass", mass, false, "kg", "m_e = 1 / n.(1/M_a + 1/M_b).n with rotation and added mass"),
    ROW("thickness", thickness, false, "m", "thickness of the floe"),
    ROW("corner", corner, false, "rad", "angle of the crushed corner; used only by conversion crushing"),
    ROW("mean", mean, false, "N", "mean force by the conversion"),
    ROW("peak", peak, false, "N", "peak force by the conversion"),
    ROW("duration", duration, false, "s", "conversion duration: of the collision; crushing: time from touch to peak"),
#undef ROW
};
_Static_assert(sizeof columns / sizeof *columns == BT_IMPACT_COLUMNS &&
                   sizeof(bt_impact) == BT_IMPACT_COLUMNS * sizeof(double),
               "every number of a collision has its column");

/// Put numbers x[n] of column k into rows[n].
static void put_column(bt_impact *rows, int64_t n, int k, const double *x)
{
    for (int64_t i = 0; i < n; i++) memcpy((char *)&rows[i] + columns[k].offset, &x[i], sizeof *x);
}

static void create_panels(bt_impact_store *store, const bt_panels *panels, bool series)
{
    bt_h5 *h5 = store->h;
    const hsize_t n = (hsize_t)panels->n;
    double *start = bt_alloc(2 * (size_t)panels->n + 2, sizeof *start),
           *middle = bt_alloc(2 * (size_t)panels->n, sizeof *middle),
           *normal = bt_alloc(2 * (size_t)panels->n, sizeof *normal);
    for (int k = 0; k <= panels->n; k++) bt_panels_point(panels, k, start + 2 * k, NULL);
    for (int k = 0; k < panels->n; k++) bt_panels_point(panels, k + 0.5, middle + 2 * k, normal + 2 * k);
    bt_h5_group(h5, "/panels");
    bt_h5_attr_double(h5, "/panels", "length", panels->arc[panels->n_vertices] / panels->n);
    bt_h5_attr_text(h5, "/panels", "description",
                    "the hull's perimeter in pieces of equal length, anticlockwise in (x, y), panel 0 centred on the "
                    "body's own x axis");
    bt_h5_put(h5, "/panels/ends", H5T_NATIVE_DOUBLE, n + 1, 2, start, "panel_end xy", "m",
              "panel k reaches from point k to k + 1, frame of the towed body");
    bt_h5_put(h5, "/panels/middle", H5T_NATIVE_DOUBLE, n, 2, middle, "panel xy", "m",
              "middle of each panel, frame of the towed body");
    bt_h5_put(h5, "/panels/normal", H5T_NATIVE_DOUBLE, n, 2, normal, "panel xy", "1",
              "outward normal at the middle of each panel");
    BT_FREE(start, middle, normal);
    if (!series) return;
    store->force = bt_h5_growing(h5, "/panels/force", H5T_NATIVE_DOUBLE, 3, (hsize_t[]){n, 2}, (hsize_t[]){64, n},
                                 false);
    store->normal = bt_h5_growing(h5, "/panels/load", H5T_NATIVE_DOUBLE, 2, (hsize_t[]){n}, (hsize_t[]){64, n}, false);
    bt_h5_describe(h5, "/panels/force", "sample panel xy", "N",
             "contact force on each panel, x and y in the frame of the towed body, impulse / dt; a row for each entry "
             "of /series, NaN where one of its steps has no bound to the load (no_load)");
    bt_h5_describe(h5, "/panels/load", "sample panel", "N",
             "sum of the normal forces on each panel, impulse / dt; a row for each entry of /series, NaN where one of "
             "its steps has no bound to the load (no_load)");
}

void bt_impact_store_create(bt_impact_store *store, bt_h5 *h5, const bt_impacts *impacts, const bt_case *input)
{
    *store = (bt_impact_store){
        .h = h5, .from = impacts, .earliest = bt_case_earliest_window(input), .force = -1, .normal = -1,
        .n_panels = impacts->panels.n};
    bt_panel_blocks_init(&store->blocks, store->n_panels);
    bt_h5_group(h5, "/impacts");
    char text[160];
    bt_impact_describe(&impacts->rule, text);
    bt_h5_attr_text(h5, "/impacts", "conversion", text);
    bt_h5_attr_text(h5, "/impacts", "description", "collisions with the towed body in the order in which they ended");
    for (int k = 0; k < BT_IMPACT_COLUMNS; k++) {
        const char *path = BT_PATH("/impacts", columns[k].name);
        store->column[k] = bt_h5_growing(h5, path, columns[k].whole ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE, 1, NULL,
                                         (hsize_t[]){CHUNK, 1}, false);
        bt_h5_describe(h5, path, NULL, columns[k].units, columns[k].description);
    }
    for (int k = 0; k < BT_IMPACT_COLUMNS; k++) // when their time is there
        bt_h5_axes(h5, BT_PATH("/impacts", columns[k].name), "time");
    store->sum = bt_alloc(3 * (size_t)store->n_panels, sizeof *store->sum);
    create_panels(store, &impacts->panels, input->output.panels);
}

void bt_impact_store_pieces(bt_impact_store *store, const bt_roster *roster, int64_t n_bodies)
{
    store->roster = roster;
    store->n_bodies = n_bodies;
}

static double id_of(const bt_impact_store *store, double gid)
{
    return store->roster ? (double)bt_roster_id(store->roster, store->n_bodies, (bt_gid)gid) : gid;
}

static void write_rows(bt_impact_store *store)
{
    if (store->n_rows == 0) return;
    double *x = bt_alloc((size_t)store->n_rows, sizeof *x);
    for (int k = 0; k < BT_IMPACT_COLUMNS; k++) {
        for (int64_t i = 0; i < store->n_rows; i++)
            memcpy(&x[i], (const char *)&store->rows[i] + columns[k].offset, sizeof *x);
        bt_h5_append(store->h, store->column[k], H5T_NATIVE_DOUBLE, (hsize_t)store->written, (hsize_t)store->n_rows, x);
    }
    free(x);
    store->written += store->n_rows;
    store->n_rows = 0;
}

static void take_closed(bt_impact_store *store)
{
    if (store->from->n_closed == 0) return;
    const int64_t n = store->from->n_closed;
    if (store->n_rows + n > store->cap_rows) {
        store->cap_rows = 2 * (store->n_rows + n);
        store->rows = bt_realloc(store->rows, (size_t)store->cap_rows, sizeof *store->rows);
    }
    memcpy(store->rows + store->n_rows, store->from->closed, (size_t)n * sizeof *store->rows);
    for (int64_t i = store->n_rows; i < store->n_rows + n; i++)
        store->rows[i].gid = id_of(store, store->rows[i].gid);
    store->n_rows += n;
    if (store->n_rows >= CHUNK) write_rows(store);
}

void bt_impact_store_take(bt_impact_store *store, double time, bool no_load)
{
    if (!store->h) return;
    take_closed(store);
    bt_panel *none = no_load ? bt_alloc((size_t)store->n_panels, sizeof *none) : NULL;
    const bt_panel *panels = no_load ? none : store->from->panels.panel;
    bt_panel_blocks_add(&store->blocks, panels, time < store->earliest);
    for (int k = 0; k < store->n_panels; k++) {
        const bt_panel *panel = &panels[k];
        store->sum[3 * k] += no_load ? NAN : panel->fx;
        store->sum[3 * k + 1] += no_load ? NAN : panel->fy;
        store->sum[3 * k + 2] += no_load ? NAN : panel->normal;
    }
    store->n_merged++;
    free(none);
}

void bt_impact_store_end_sample(bt_impact_store *store)
{
    if (!store->h || store->n_merged == 0) return;
    const size_t n = (size_t)store->n_panels;
    if (store->force >= 0) {
        if (store->n_samples == store->cap_samples) {
            store->cap_samples = store->cap_samples ? 2 * store->cap_samples : 64;
            store->forces = bt_realloc(store->forces, (size_t)store->cap_samples * n, 2 * sizeof *store->forces);
            store->normals = bt_realloc(store->normals, (size_t)store->cap_samples * n, sizeof *store->normals);
        }
        double *f = store->forces + 2 * n * (size_t)store->n_samples,
               *l = store->normals + n * (size_t)store->n_samples;
        for (size_t k = 0; k < n; k++) {
            f[2 * k] = store->sum[3 * k] / (double)store->n_merged;
            f[2 * k + 1] = store->sum[3 * k + 1] / (double)store->n_merged;
            l[k] = store->sum[3 * k + 2] / (double)store->n_merged;
        }
        store->n_samples++;
    }
    memset(store->sum, 0, 3 * n * sizeof *store->sum);
    store->n_merged = 0;
}

void bt_impact_store_write(bt_impact_store *store)
{
    if (!store->h) return;
    write_rows(store);
    if (store->n_samples > 0) {
        bt_h5_append(store->h, store->force, H5T_NATIVE_DOUBLE, (hsize_t)store->samples_written,
                     (hsize_t)store->n_samples, store->forces);
        bt_h5_append(store->h, store->normal, H5T_NATIVE_DOUBLE, (hsize_t)store->samples_written,
                     (hsize_t)store->n_samples, store->normals);
    }
    store->samples_written += store->n_samples;
    store->n_samples = 0;
}

void bt_impact_store_count(bt_impact_store *store, bt_impact_count *count)
{
    bt_impact *rows = bt_alloc(PIECE, sizeof *rows);
    double *x = bt_alloc(PIECE, sizeof *x);
    for (int64_t first = 0; first < store->written && store->h->status == BT_OK; first += PIECE) {
        const int64_t n = store->written - first < PIECE ? store->written - first : PIECE;
        for (int k = 0; k < BT_IMPACT_COLUMNS; k++) {
            bt_h5_read_back(store->h, store->column[k], H5T_NATIVE_DOUBLE, (hsize_t)first, (hsize_t)n, x);
            put_column(rows, n, k, x);
        }
        for (int64_t i = 0; i < n && store->h->status == BT_OK; i++) bt_impact_count_add(count, &rows[i]);
    }
    free(rows);
    free(x);
}

void bt_impact_store_totals(bt_impact_store *store, const bt_impact_count *c, const bt_steady *steady)
{
    const size_t n = (size_t)store->n_panels;
    const double steps = (double)steady->n;
    bt_panel_loads *before = bt_alloc(2 * n, sizeof *before), *within = before + n;
    bt_panel_blocks_reduce(&store->blocks, steady->put_off, before, within);
    double *x = bt_alloc(7 * n, sizeof *x);
    int64_t *count = bt_alloc(n, sizeof *count);
    for (size_t k = 0; k < n; k++) {
        x[2 * k] = within[k].fx / steps, x[2 * k + 1] = within[k].fy / steps; // NaN when no step counts
        x[2 * n + k] = within[k].normal / steps;
        x[3 * n + k] = within[k].most;
        x[4 * n + k] = c->panel[k].peak;
        x[5 * n + k] = before[k].most;
        x[6 * n + k] = c->panel[k].start_peak;
        count[k] = c->panel[k].n;
    }
    bt_h5 *h5 = store->h;
    bt_h5_attr_double(h5, "/panels", "from", steady->start);
    bt_h5_attr_int(h5, "/panels", "steps", steady->n);
    bt_h5_attr_int(h5, "/panels", "no_load_steps", llround(steady->no_load * steps));
    bt_h5_put(h5, "/panels/mean_force", H5T_NATIVE_DOUBLE, (hsize_t)n, 2, x, "panel xy", "N",
              "mean contact force over the window, from the time `from` on, x and y in the frame of the towed body; "
              "its steps without a bound to the load, `no_load_steps` of `steps`, count as zero");
    const struct { const char *path, *text; } of_normals[] = {
        {"/panels/mean_load", "mean sum of the normal forces over the window, from the time `from` on; its steps "
                              "without a bound to the load, `no_load_steps` of `steps`, count as zero"},
        {"/panels/max_load", "largest sum of the normal forces in a step of the window, impulse / dt; steps without a "
                             "bound to the load count as zero"},
        {"/panels/max_peak", "largest peak of a collision in the window by the conversion of /impacts"},
        {"/panels/start_max_load", "largest sum of the normal forces in a step before the window, impulse / dt; steps "
                                   "without a bound to the load count as zero"},
        {"/panels/start_max_peak", "largest peak of a collision before the window by the conversion of /impacts"},
    };
    for (size_t k = 0; k < sizeof of_normals / sizeof *of_normals; k++)
        bt_h5_put(h5, of_normals[k].path, H5T_NATIVE_DOUBLE, (hsize_t)n, 0, x + (2 + k) * n, "panel", "N",
                  of_normals[k].text);
    bt_h5_put(h5, "/panels/collisions", H5T_NATIVE_INT64, (hsize_t)n, 0, count, "panel", "1",
              "collisions in the window");
    BT_FREE(x, count, before);
}

static const bt_state_row state_rows[] = {
#define STATE(label, member, meaning) \
    {label, BT_ITEM_I64, 1, offsetof(bt_impact_store, member), "1", meaning, "one", BT_ROW_COUNT, NULL}
    STATE("written", written, "collisions in result.h5"),
    STATE("n_merged", n_merged, "steps merged into the sample of panel loads under way"),
    STATE("samples_written", samples_written, "samples of panel loads in result.h5"),
    STATE("panel_steps", blocks.steps, "steps of which panel loads are kept"),
#undef STATE
};
enum { N_STATE = sizeof state_rows / sizeof *state_rows, LOADS_WIDTH = sizeof(bt_panel_loads) / sizeof(double) };

void bt_impact_store_save(const bt_impact_store *store, bt_snapshot *to)
{
    if (!store->h) return;
    bt_snapshot_add_rows(to, "collisions", state_rows, N_STATE, store);
    bt_snapshot_add(to, "collisions/sum", BT_ITEM_F64, store->n_panels, 3, store->sum);
    bt_snapshot_add(to, "collisions/panel_blocks", BT_ITEM_F64,
                    bt_panel_blocks_rows(&store->blocks, store->blocks.steps), LOADS_WIDTH, store->blocks.load);
}

/// Are the stored rows valid, so that they can be counted?
static bool rows_sound(const bt_impact_store *store)
{
    bool sound = true;
    for (int64_t i = 0; i < store->n_rows; i++) {
        const bt_impact *impact = &store->rows[i];
        sound = sound && impact->panel >= 0 && impact->panel < store->n_panels && isfinite(impact->time) &&
                isfinite(impact->peak);
    }
    return sound;
}

/// Copy the first n rows of the old file to the new one.
static void load_rows(bt_impact_store *store, bt_h5_reader *old, int64_t n)
{
    double *x = bt_alloc(PIECE, sizeof *x);
    store->cap_rows = PIECE;
    store->rows = bt_realloc(store->rows, PIECE, sizeof *store->rows);
    for (int64_t first = 0; first < n && old->status == BT_OK; first += PIECE) {
        store->n_rows = n - first < PIECE ? n - first : PIECE;
        for (int k = 0; k < BT_IMPACT_COLUMNS; k++) {
            bt_h5_read(old, BT_PATH("/impacts", columns[k].name), H5T_NATIVE_DOUBLE, first, store->n_rows, 1, x);
            put_column(store->rows, store->n_rows, k, x);
        }
        if (old->status == BT_OK && rows_sound(store)) {
            write_rows(store);
        } else if (old->status == BT_OK) {
            old->status = bt_fail(old->err, BT_ERR_CASE,
                "%s: /impacts holds a collision on no panel of this body, or one that is not finite; it is "
                "damaged: restore it",
                old->path);
        }
    }
    free(x);
}

static void load_blocks(bt_impact_store *store, bt_snapshot *from, int64_t steps)
{
    int64_t rows = 0;
    double *load = bt_snapshot_copy(from, "collisions/panel_blocks", BT_ITEM_F64, LOADS_WIDTH, &rows);
    bool finite = true;
    for (int64_t k = 0; k < rows * LOADS_WIDTH; k++) finite = finite && isfinite(load[k]);
    bt_snapshot_want(from, finite, "collisions/panel_blocks", -1, "is not finite");
    const int64_t done = bt_snapshot_int(from, "world/step");
    int64_t late = 0; // steps that do not end before the earliest start
    for (int64_t k = 1; k <= done; k++) late += !((double)k * store->from->dt < store->earliest);
    // Checkpoints from before 1 December 2026 also count the step that ends with the ramp, at a prescribed speed.
    if (steps == late + 1) store->earliest -= store->from->dt;
    else bt_snapshot_want(from, steps == late, "collisions/panel_steps", -1, "does not fit the number of steps");
    if (!from->faulty)
        bt_snapshot_want(from, rows == bt_panel_blocks_rows(&store->blocks, steps), "collisions/panel_blocks", -1,
                         "does not fit the number of steps");
    if (from->faulty) free(load);
    else bt_panel_blocks_restore(&store->blocks, steps, (bt_panel_loads *)(void *)load);
}

void bt_impact_store_load(bt_impact_store *store, bt_snapshot *from, bt_h5_reader *old)
{
    if (!store->h) return;
    bt_impact_store then = *store;
    bt_snapshot_take_rows(from, "collisions", state_rows, N_STATE, &then);
    bt_snapshot_take(from, "collisions/sum", BT_ITEM_F64, store->n_panels, 3, store->sum);
    const int64_t there = bt_h5_size(old, "/impacts/time", 0), entries = bt_snapshot_int(from, "record/entries");
    bt_snapshot_want(from, then.n_merged == bt_snapshot_int(from, "record/merged_steps"), "collisions/n_merged", -1,
                     "is not the number of steps in the entry under way");
    bt_snapshot_want(from, then.written >= 0 && then.written <= there, "collisions/written", -1,
                     "is not a number of collisions that result.h5 has");
    bt_snapshot_want(from, then.samples_written == (store->force >= 0 ? entries : 0), "collisions/samples_written", -1,
                     "is not the number of entries");
    load_blocks(store, from, then.blocks.steps);
    if (from->faulty || old->status != BT_OK) return;
    store->n_merged = then.n_merged;
    load_rows(store, old, then.written);
    const size_t n = (size_t)then.samples_written, width = (size_t)store->n_panels;
    if (store->force >= 0 && n > 0) {
        store->cap_samples = store->n_samples = then.samples_written;
        store->forces = bt_realloc(store->forces, n * width, 2 * sizeof *store->forces);
        store->normals = bt_realloc(store->normals, n * width, sizeof *store->normals);
        bt_h5_read(old, "/panels/force", H5T_NATIVE_DOUBLE, 0, store->n_samples, 2 * store->n_panels, store->forces);
        bt_h5_read(old, "/panels/load", H5T_NATIVE_DOUBLE, 0, store->n_samples, store->n_panels, store->normals);
    }
    if (old->status == BT_OK) bt_impact_store_write(store);
}

void bt_impact_store_close(bt_impact_store *store)
{
    if (!store->h) return;
    BT_FREE(store->rows, store->forces, store->normals, store->sum);
    bt_panel_blocks_free(&store->blocks);
    *store = (bt_impact_store){0};
}
