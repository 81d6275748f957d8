// SPDX-License-Identifier: MIT
// One run: field, world, step loop, record.
//
// Ranks. Whatever can differ between ranks (an error, a signal) is agreed on once a step, after the sample and before the
// frame, so that all leave the loop after the same step; every other collective call is made with an agreed status.
#include "bergtow/run.h"

#include <inttypes.h>
#include <math.h>
#include <omp.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

#include "bergtow/estimate.h"
#include "bergtow/field.h"
#include "bergtow/impact.h"
#include "bergtow/observe.h"
#include "bergtow/record.h"
#include "bergtow/setup.h"
#include "bergtow/solver.h"
#include "bergtow/stall.h"
#include "bergtow/tiles.h"
#include "bergtow/tow.h"
#include "bergtow/world.h"
#include "case_check.h"
#include "cost.h"
#include "domain.h"
#include "handover.h"
#include "progress.h"

#define FRAMES_BY_DEFAULT 200

static volatile sig_atomic_t stop_signal;

static void on_signal(int number) { stop_signal = number; }

typedef struct {
    const bt_comm *comm;
    const bt_case *c;
    const bt_run_options *o;
    bt_world *w;
    bt_roster roster;
    bt_record *record;
    bt_progress progress;
    int stop;               ///< signal that some rank has met, 0 = none
    double reference_speed;
    bt_run_totals totals;
} run;

/// Collective. Rank 0 makes or reads the field, with all its threads, and opens the lead in it; then every rank has it. lead: on rank 0.
static bt_status make_field(const bt_comm *comm, const bt_case *c, bt_field *f, bt_lead_stats *lead, bt_errors *err)
{
    bt_status status = BT_OK;
    if (comm->rank == 0) status = bt_cost_fits(c, bt_case_expected_floes(c) + c->n_floes, comm, bt_cost_machine(), err);
    if (comm->rank == 0 && status == BT_OK) status = bt_field_load(c, f, err);
    if (comm->rank == 0 && status == BT_OK) status = bt_cost_fits(c, f->n, comm, bt_cost_machine(), err); // a field that was read has only now a number
    if (comm->rank == 0 && status == BT_OK) status = bt_lead_open(c, f, lead, err);
    bt_comm_rest(comm);
    status = bt_comm_agree(comm, status);
    if (status == BT_OK) bt_field_share(comm, f);
    return status;
}

static bt_status open_record(run *r, bt_errors *err)
{
    bt_record_bodies b;
    bt_status status = bt_handover_bodies(r->comm, r->w, &r->roster, &b, err);
    if (status != BT_OK) return status;
    status = bt_record_open(&r->record, r->comm, r->o->dir, r->c, &b, r->o->command_line, err);
    bt_handover_free(&b);
    if (status != BT_OK || !r->w->impacts) return status;
    status = bt_comm_agree(r->comm, bt_record_watch_impacts(r->record, r->w->impacts, err));
    if (status != BT_OK) bt_record_close(r->record, NULL, err);
    return status;
}

static bt_status record_frame(run *r, bt_errors *err)
{
    bt_frame_row *rows;
    bt_status status = bt_handover_frame(r->comm, r->w, &r->roster, &rows, err);
    if (status == BT_OK) status = bt_record_frame(r->record, (double)r->w->step * r->w->par.dt, rows, err);
    free(rows);
    return status;
}

/// Collective, once a step. The worst status of all ranks, and whether one of them was told to stop.
static bt_status agree(run *r, bt_status status)
{
    if (r->comm->size == 1) {
        r->stop = stop_signal;
        return status;
    }
    uint64_t bits = (status != BT_OK ? 1 : 0) | (stop_signal ? (uint64_t)1 << stop_signal : 0);
    bt_comm_reduce(r->comm, NULL, 0, NULL, 0, &bits, 1);
    r->stop = bits >> 1 ? __builtin_ctzll(bits & ~UINT64_C(1)) : 0;
    return bits & 1 ? bt_comm_agree(r->comm, status) : BT_OK;
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

/// Collective. Floes whose centroid has left the domain where it is not periodic.
static int64_t count_outside(const run *r)
{
    const bt_bodies *b = &r->w->bodies;
    const bt_case *c = r->c;
    int64_t n = 0, all;
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->gid[i] >= r->roster.n_floes || !bt_domain_owns(r->w, i)) continue;
        const bool x_out = b->pose[i].x < c->domain.x0 || b->pose[i].x > c->domain.x0 + c->domain.length;
        const bool y_out = b->pose[i].y < c->domain.y0 || b->pose[i].y > c->domain.y0 + c->domain.width;
        n += (x_out && r->w->par.period_x == 0) || (y_out && r->w->par.period_y == 0);
    }
    bt_comm_before(r->comm, n, &all);
    return all;
}

/// Collective.
static void note_division(run *r)
{
    const bt_domain_stats s = bt_domain_get_stats(r->w);
    r->totals.divisions = s.divisions;
    r->totals.imbalance = s.imbalance;
    r->totals.worst_imbalance = s.worst_imbalance;
    r->totals.dealt_imbalance = s.dealt_imbalance;
    r->totals.worst_dealt_imbalance = s.worst_dealt_imbalance;
    r->totals.edge_cut = s.cut;
    r->totals.halo_share = s.halo;
    bt_comm_before(r->comm, s.moved, &r->totals.moved_floes);
}

static void add_phases(bt_phases *p, const bt_step_stats *st)
{
    p->detect += st->detect_s;
    p->colour += st->colour_s;
    p->forces += st->forces_s;
    p->solve += st->solve_s;
    p->advance += st->advance_s;
    p->exchange += st->exchange_s;
}

/// Collective. Peak memory of all ranks, and the bytes of units and velocities that belong to a contact point.
static void measure_memory(run *r)
{
    const bt_tiles *t = r->w->tiles;
    struct rusage u;
    getrusage(RUSAGE_SELF, &u);
    double units = 0, points = 0;
    for (bt_idx k = 0; k < t->n; k++) {
        units += t->tile[k].n_units;
        points += (double)t->tile[k].n_points;
    }
    bt_sum sums[3] = {{0}, {0}, {0}};
    bt_sum_add(&sums[0], 1024.0 * (double)u.ru_maxrss);
    bt_sum_add(&sums[1], units * (double)(sizeof(bt_unit) + 2 * (sizeof(bt_vel) + sizeof(bt_inv))));
    bt_sum_add(&sums[2], points);
    bt_comm_reduce(r->comm, sums, 3, NULL, 0, NULL, 0);
    r->totals.memory = bt_sum_value(&sums[0]);
    r->totals.sweep_bytes_per_contact = bt_sum_value(&sums[2]) > 0 ? bt_sum_value(&sums[1]) / bt_sum_value(&sums[2]) : NAN;
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
    while (status == BT_OK && w->step < n_steps && !r->stop) {
        bt_world_step(w);
        add_phases(&r->totals.phases, &w->stats);
        const double t0 = bt_clock();
        if (w->step == r->o->dump_step) status = bt_solver_dump(w, r->o->dump_path, err);
        bt_sample s;
        bt_observe(w, r->reference_speed, &s);
        bt_stall_step(&r->totals.stall, w, r->roster.mean_size);
        if (status == BT_OK) status = bt_record_sample(r->record, &s, err);
        if (status == BT_OK) status = bt_record_events(r->record, &w->events, err);
        if (status == BT_OK && !isfinite(s.kinetic_energy)) status = check_finite(r, err);
        status = agree(r, status);
        // A frame at the first step at or after each multiple of the interval, and at the end.
        const bool due = s.time >= (double)frames * interval * (1 - 1e-12) || w->step == n_steps;
        if (status == BT_OK && due) {
            status = record_frame(r, err);
            while ((double)frames * interval * (1 - 1e-12) <= s.time) frames++;
        }
        bt_progress_step(&r->progress, w->step, s.time, s.ice_resistance);
        r->totals.phases.output += bt_clock() - t0;
    }
    if (status == BT_OK) status = bt_comm_agree(r->comm, check_finite(r, err));
    return status;
}

// mpirun hands on SIGUSR1; at SIGINT and SIGTERM it kills the ranks a second later.
static const int caught[] = {SIGINT, SIGTERM, SIGUSR1};
enum { N_CAUGHT = sizeof caught / sizeof *caught };

/// From here on a signal ends the loop after the step at hand; the handlers of before come back at the end.
static void catch_signals(struct sigaction before[N_CAUGHT])
{
    struct sigaction act = {.sa_handler = on_signal};
    sigemptyset(&act.sa_mask);
    stop_signal = 0;
    for (int k = 0; k < N_CAUGHT; k++) sigaction(caught[k], &act, &before[k]);
}

static bt_status run_world(run *r, bt_errors *err)
{
    bt_status status = open_record(r, err);
    if (status != BT_OK) return status;
    r->progress = (bt_progress){.interval = r->c->output.progress, .n_steps = steps_to_do(r), .quiet = r->o->quiet};
    bt_progress_start(&r->progress, r->w->step);

    struct sigaction before[N_CAUGHT];
    catch_signals(before);
    const double t0 = bt_clock();
    status = loop(r, err);
    r->totals.wall_time = bt_clock() - t0;
    for (int k = 0; k < N_CAUGHT; k++) sigaction(caught[k], &before[k], NULL);
    bt_progress_end(&r->progress);

    r->totals.n_steps = r->w->step;
    r->totals.events = &r->w->events;
    if (r->w->impacts) bt_impacts_end(r->w->impacts);
    r->totals.impacts = r->w->impacts;
    r->totals.floes_outside = count_outside(r);
    measure_memory(r);
    r->totals.state_hash = bt_world_hash(r->w);
    r->totals.window = r->w->window;
    note_division(r);
    char stopped[64] = "";
    if (r->stop) {
        snprintf(stopped, sizeof stopped, "signal %d after step %" PRId64, r->stop, r->w->step);
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
    if (status == BT_OK && r->stop) {
        bt_errors_add(err, "stopped by %s; %s holds everything up to there", stopped, r->o->dir);
        status = BT_ERR_SIGNAL;
    }
    return status;
}

/// As the user says; otherwise the cores of the node, or those that mpirun has bound this rank to, for the ranks there.
static int choose_threads(const bt_comm *comm, const bt_case *c, const bt_run_options *o)
{
    if (o->threads > 0) return o->threads;
    if (c->run.threads > 0) return (int)c->run.threads;
    if (comm->size == 1 || getenv("OMP_NUM_THREADS")) return omp_get_max_threads();
    const int bound = omp_get_num_procs(), share = (int)sysconf(_SC_NPROCESSORS_ONLN) / comm->ranks_here;
    const int n = bound < share ? bound : share;
    return n > 1 ? n : 1;
}

/// Start the team, with signals left to the main thread (as in bt_comm_start).
static void start_threads(int n)
{
    omp_set_num_threads(n);
    sigset_t block, before;
    sigemptyset(&block);
    for (int k = 0; k < N_CAUGHT; k++) sigaddset(&block, caught[k]);
    pthread_sigmask(SIG_BLOCK, &block, &before);
#pragma omp parallel
    {
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
}

bt_status bt_run(const bt_comm *comm, const bt_case *c, const bt_run_options *o, bt_errors *err)
{
    if (comm->size > 1 && o->dump_step >= 0) {
        bt_errors_add(err, "--dump-contacts: the contacts of %d ranks lie apart; start bergtow without mpirun for this (the step is the same)", comm->size);
        return BT_ERR_USAGE;
    }
    const int threads = choose_threads(comm, c, o);
    start_threads(threads);
    run r = {.comm = comm, .c = c, .o = o, .reference_speed = bt_case_reference_speed(c)};
    bt_field f;
    bt_field_init(&f);
    bt_lead_stats lead = {0};
    bt_status status = make_field(comm, c, &f, &lead, err);
    if (status == BT_OK) status = bt_comm_agree(comm, bt_setup_world(c, &f, &r.w, &r.roster, err));
    const double concentration = lead.mode == BT_LEAD_NONE ? f.concentration : lead.concentration_before;
    const bt_outline_counts outlines = f.outlines;
    double thickness, radius;
    bt_estimate_field(&f, &thickness, &radius);
    bt_field_free(&f);
    if (status == BT_OK) {
        bt_domain_create(r.w, comm);
        bt_tiles_begin(r.w);
        r.totals = (bt_run_totals){
            .ranks = comm->size,
            .threads = threads,
            .dt = c->run.dt,
            .mean_size = r.roster.mean_size,
            .mean_thickness = thickness,
            .mean_radius = radius,
            .concentration = concentration,
            .lead = lead,
            .outlines = outlines,
            .tolerance = r.w->par.tolerance,
        };
        status = run_world(&r, err);
    }
    bt_roster_free(&r.roster);
    bt_world_free(r.w);
    return status;
}
