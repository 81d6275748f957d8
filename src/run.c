// SPDX-License-Identifier: MIT
// One run: field, world, step loop, record.
#include "bergtow/run.h"

#include <inttypes.h>
#include <math.h>
#include <omp.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/field.h"
#include "bergtow/observe.h"
#include "bergtow/record.h"
#include "bergtow/setup.h"
#include "bergtow/solver.h"
#include "bergtow/tow.h"
#include "bergtow/world.h"
#include "progress.h"

#define FRAMES_BY_DEFAULT 200

static volatile sig_atomic_t stop_signal;

static void on_signal(int number) { stop_signal = number; }

typedef struct {
    const bt_case *c;
    const bt_run_options *o;
    bt_world *w;
    bt_roster roster;
    bt_record *record;
    bt_progress progress;
    double *pose, *speed, *force; ///< of a frame
    double reference_speed;
    bt_run_totals totals;
} run;

static bt_status make_field(const bt_case *c, bt_field *f, bt_errors *err)
{
    return c->ice.field ? bt_field_read(f, c->ice.field, err) : bt_field_generate(c, f, err);
}

static bt_status open_record(run *r, bt_errors *err)
{
    // The record names bodies by their gids; storage has another order.
    const bt_bodies *b = &r->w->bodies;
    int64_t *offsets = bt_alloc((size_t)b->n + 1, sizeof *offsets);
    double *vertices = bt_alloc(2 * (size_t)b->offset[b->n], sizeof *vertices), *area = bt_alloc((size_t)b->n, sizeof *area);
    for (bt_gid g = 0; g < b->n; g++) {
        const bt_idx i = bt_world_index(r->w, g);
        const int64_t n = b->offset[i + 1] - b->offset[i];
        offsets[g + 1] = offsets[g] + n;
        memcpy(vertices + 2 * offsets[g], b->vertices + 2 * b->offset[i], 2 * (size_t)n * sizeof *vertices);
        area[g] = b->area[i];
    }
    const bt_record_bodies bodies = {
        .n_floes = r->roster.n_floes,
        .n_bodies = b->n,
        .offsets = offsets,
        .vertices = vertices,
        .thickness = r->roster.thickness,
        .area = area,
        .names = r->roster.names,
        .towed = (bt_idx)r->w->towed,
    };
    const bt_status status = bt_record_open(&r->record, r->o->dir, r->c, &bodies, r->o->command_line, err);
    free(offsets);
    free(vertices);
    free(area);
    return status;
}

static bt_status record_frame(run *r, bt_errors *err)
{
    const bt_bodies *b = &r->w->bodies;
    double *force = bt_alloc((size_t)b->n, sizeof *force);
    bt_observe_contact_force(r->w, force);
    for (bt_gid g = 0; g < b->n; g++) {
        const bt_idx i = bt_world_index(r->w, g);
        r->pose[3 * (size_t)g] = b->pose[i].x;
        r->pose[3 * (size_t)g + 1] = b->pose[i].y;
        r->pose[3 * (size_t)g + 2] = b->pose[i].yaw;
        r->speed[g] = hypot(b->vel[i].x, b->vel[i].y);
        r->force[g] = force[i];
    }
    free(force);
    return bt_record_frame(r->record, (double)r->w->step * r->w->par.dt, r->pose, r->force, r->speed, err);
}

static bt_status check_finite(const run *r, bt_errors *err)
{
    bt_idx bad = bt_observe_not_finite(r->w);
    if (bad < 0) return BT_OK;
    bt_errors_add(err,
                  "step %" PRId64 ": body %" PRId64 " has a pose or velocity that is not a number; take a smaller run.dt, "
                  "and check masses, stiffness and speeds of the case",
                  r->w->step, r->w->bodies.gid[bad]);
    return BT_ERR_NUMERIC;
}

/// Floes whose centroid has left the domain where it is not periodic.
static int64_t count_outside(const run *r)
{
    const bt_bodies *b = &r->w->bodies;
    const bt_case *c = r->c;
    int64_t n = 0;
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->gid[i] >= r->roster.n_floes) continue;
        const bool x_out = b->pose[i].x < c->domain.x0 || b->pose[i].x > c->domain.x0 + c->domain.length;
        const bool y_out = b->pose[i].y < c->domain.y0 || b->pose[i].y > c->domain.y0 + c->domain.width;
        n += (x_out && r->w->par.period_x == 0) || (y_out && r->w->par.period_y == 0);
    }
    return n;
}

static void add_phases(bt_phases *p, const bt_step_stats *st)
{
    p->detect += st->detect_s;
    p->colour += st->colour_s;
    p->forces += st->forces_s;
    p->solve += st->solve_s;
    p->advance += st->advance_s;
}

static int64_t steps_to_do(const run *r)
{
    const int64_t n = bt_case_steps(r->c);
    return r->o->max_steps > 0 && r->o->max_steps < n ? r->o->max_steps : n;
}

static bt_status loop(run *r, bt_errors *err)
{
    const bt_case *c = r->c;
    const int64_t n_steps = steps_to_do(r);
    const double interval = c->output.frame_interval > 0 ? c->output.frame_interval : c->run.duration / FRAMES_BY_DEFAULT;
    bt_world *w = r->w;
    int64_t frames = 1;
    bt_status status = record_frame(r, err);
    while (status == BT_OK && w->step < n_steps && !stop_signal) {
        bt_world_step(w);
        add_phases(&r->totals.phases, &w->stats);
        const double t0 = bt_clock();
        if (w->step == r->o->dump_step) status = bt_solver_dump(w, r->o->dump_path, err);
        bt_sample s;
        bt_observe(w, r->reference_speed, &s);
        if (status == BT_OK) status = bt_record_sample(r->record, &s, err);
        // A frame at the first step at or after each multiple of the interval, and at the end.
        const bool due = s.time >= (double)frames * interval * (1 - 1e-12) || w->step == n_steps;
        if (status == BT_OK && due) {
            status = record_frame(r, err);
            while ((double)frames * interval * (1 - 1e-12) <= s.time) frames++;
        }
        if (status == BT_OK && !isfinite(s.kinetic_energy)) status = check_finite(r, err);
        bt_progress_step(&r->progress, w->step, s.time, s.ice_resistance);
        r->totals.phases.output += bt_clock() - t0;
    }
    if (status == BT_OK) status = check_finite(r, err);
    return status;
}

/// From here on a signal ends the loop after the step at hand; the handlers of before come back at the end.
static void catch_signals(struct sigaction before[2])
{
    struct sigaction act = {.sa_handler = on_signal};
    sigemptyset(&act.sa_mask);
    stop_signal = 0;
    sigaction(SIGINT, &act, &before[0]);
    sigaction(SIGTERM, &act, &before[1]);
}

static bt_status run_world(run *r, bt_errors *err)
{
    bt_status status = open_record(r, err);
    if (status != BT_OK) return status;
    const size_t n = (size_t)r->w->bodies.n;
    r->pose = bt_alloc(3 * n, sizeof *r->pose);
    r->speed = bt_alloc(n, sizeof *r->speed);
    r->force = bt_alloc(n, sizeof *r->force);
    r->progress = (bt_progress){.interval = r->c->output.progress, .n_steps = steps_to_do(r), .quiet = r->o->quiet};
    bt_progress_start(&r->progress, r->w->step);

    struct sigaction before[2];
    catch_signals(before);
    const double t0 = bt_clock();
    status = loop(r, err);
    r->totals.wall_time = bt_clock() - t0;
    sigaction(SIGINT, &before[0], NULL);
    sigaction(SIGTERM, &before[1], NULL);
    bt_progress_end(&r->progress);

    r->totals.n_steps = r->w->step;
    r->totals.floes_outside = count_outside(r);
    r->totals.state_hash = bt_world_hash(r->w);
    char stopped[64] = "";
    if (stop_signal) {
        snprintf(stopped, sizeof stopped, "signal %d after step %" PRId64, (int)stop_signal, r->w->step);
        r->totals.stopped = stopped;
    }
    bt_status closed;
    if (status == BT_OK) {
        if (!r->o->quiet) bt_record_print_summary(r->record, &r->totals);
        closed = bt_record_close(r->record, &r->totals, err);
    } else {
        closed = bt_record_close(r->record, NULL, err);
    }
    if (status == BT_OK) status = closed;
    if (status == BT_OK && stop_signal) {
        bt_errors_add(err, "stopped by %s; %s holds everything up to there", stopped, r->o->dir);
        status = BT_ERR_SIGNAL;
    }
    return status;
}

bt_status bt_run(const bt_case *c, const bt_run_options *o, bt_errors *err)
{
    const int threads = o->threads > 0 ? o->threads : c->run.threads > 0 ? (int)c->run.threads : omp_get_max_threads();
    omp_set_num_threads(threads);
    run r = {.c = c, .o = o, .reference_speed = bt_case_reference_speed(c)};
    bt_field f;
    bt_field_init(&f);
    bt_status status = make_field(c, &f, err);
    if (status == BT_OK) status = bt_setup_world(c, &f, &r.w, &r.roster, err);
    if (status == BT_OK) {
        r.totals = (bt_run_totals){
            .ranks = 1,
            .threads = threads,
            .dt = c->run.dt,
            .mean_size = r.roster.mean_size,
            .concentration = f.concentration,
            .tolerance = r.w->par.tolerance,
        };
        status = run_world(&r, err);
    }
    bt_field_free(&f);
    free(r.pose);
    free(r.speed);
    free(r.force);
    bt_roster_free(&r.roster);
    bt_world_free(r.w);
    return status;
}
