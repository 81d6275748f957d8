// SPDX-License-Identifier: MIT
// A run in its three parts: begin (field, world, record), step, and end (summary, last checkpoint). The commands and
// the library (bergtow/simulation.h) go through the same three.
//
// Ranks. Whatever can differ between ranks (an error, a signal) is agreed on once a step, after the sample and before
// the frame, so that all leave the loop after the same step; every other collective call is made with an agreed status.
#include <inttypes.h>
#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#include "output/checkpoint.h"
#include "contact/contacts.h"
#include "bergtow/estimate.h"
#include "loads/impact.h"
#include "output/dump.h"
#include "output/observe.h"
#include "solve/batch.h"
#include "solve/islands.h"
#include "solve/solver.h"
#include "output/stall.h"
#include "space/cells.h"
#include "case/case_files.h"
#include "case/cost.h"
#include "field/field_kept.h"
#include "partition/domain.h"
#include "base/process.h"
#include "base/fileio.h"
#include "output/folder.h"
#include "output/gather.h"
#include "case/case_derived.h"
#include "run/run_parts.h"

typedef bt_running run;

// --- begin -----------------------------------------------------------------------------------------------------------

/// Add the time since the last part of the call to this one.
static void clock_part(run *r, double *part)
{
    const double now = bt_clock();
    *part += now - r->clocked;
    r->clocked = now;
}

/// Collective. Rank 0 makes or reads the field, with all its threads, and opens the lead in it; then every rank has it.
/// lead: on rank 0.
static bt_status make_field(const bt_comm *comm, const bt_case *c, const char *fields, bt_field *f,
                            bt_lead_stats *lead, bt_errors *err)
{
    bt_status status = BT_OK;
    if (comm->rank == 0) status = bt_cost_fits(c, bt_case_floes_made(c) + c->n_floes, comm, bt_cost_machine(), err);
    if (comm->rank == 0 && status == BT_OK) status = bt_field_load_kept(fields, c, f, err);
    // a field that was read has only now a number
    if (comm->rank == 0 && status == BT_OK) status = bt_cost_fits(c, f->n, comm, bt_cost_machine(), err);
    if (comm->rank == 0 && status == BT_OK) status = bt_lead_open(c, f, lead, err);
    bt_comm_rest(comm);
    status = bt_comm_agree(comm, status);
    if (status == BT_OK) bt_field_share(comm, f);
    return status;
}

/// Collective. kept: go on from there, or NULL for a fresh run.
static bt_status open_record(run *r, bt_snapshot *kept, bt_errors *err)
{
    bt_record_bodies b;
    bt_status status = bt_gather_bodies(r->comm, r->w, &r->roster, &b, err);
    if (status != BT_OK) return status;
    b.outlines = &r->totals.outlines;
    // steps that are made again leave the result that they belong to
    const bool again = kept || r->until >= 0;
    status =
        again ? bt_record_reopen(&r->record, r->comm, r->o->dir, r->c, &b, r->o->command_line, err)
              : bt_record_open(&r->record, r->comm, r->o->dir, r->c, &b, r->o->command_line, r->digests, err);
    bt_gather_free(&b);
    free(r->roster.thickness); // result.h5 has it
    r->roster.thickness = NULL;
    if (status != BT_OK) return status;
    status = bt_comm_agree(r->comm, bt_record_identify(r->record, r->identity, err));
    if (status == BT_OK && r->w->impacts)
        status = bt_comm_agree(r->comm, bt_record_watch_impacts(r->record, r->w->impacts, err));
    if (status == BT_OK && r->w->splitting)
        status = bt_comm_agree(r->comm, bt_record_watch_splitting(r->record, r->w->splitting, &r->roster, err));
    if (status == BT_OK && kept) status = bt_record_load(r->record, kept, &r->w->events, err);
    if (status != BT_OK) bt_record_abandon(r->record);
    return status;
}

static bt_status record_frame(run *r, bt_errors *err)
{
    if (!r->record) return BT_OK;
    r->framed = r->w->step;
    bt_solver_rest(r->w);
    bt_frame_row *rows;
    bt_piece_row *pieces;
    int64_t n_pieces;
    bt_status status = bt_gather_frame(r->comm, r->w, &r->roster, &rows, &pieces, &n_pieces, err);
    const bt_frame_line line = bt_gather_line(r->w);
    if (status == BT_OK)
        status = bt_record_frame(r->record, (double)r->w->step * r->w->par.dt, rows, &line, pieces, n_pieces, err);
    free(rows);
    free(pieces);
    return status;
}

/// Numbers of the run that follow from the field, which only rank 0 keeps from then on.
static void keep_field(run *r, bt_field *f, const bt_lead_stats *lead, int threads)
{
    double thickness, radius;
    bt_estimate_field(f, &thickness, &radius);
    r->totals = (bt_run_totals){
        .ranks = r->comm->size,
        .threads = threads,
        .dt = r->c->run.dt,
        .mean_size = r->roster.mean_size,
        .sizes = bt_field_sizes_of(r->c, f),
        .mean_thickness = thickness,
        .mean_radius = radius,
        .concentration = lead->mode == BT_LEAD_NONE ? f->concentration : lead->concentration_before,
        .lead = *lead,
        .outlines = f->outlines,
        .tolerance = r->w->par.tolerance,
        .call = r->totals.call,
    };
    if (r->comm->rank == 0) {
        r->field = *f;
        free(r->field.vertices); // the bodies have them
        r->field.vertices = NULL;
        r->field.cap_vertices = 0;
    } else {
        bt_field_free(f);
    }
    *f = (bt_field){0};
}

/// Collective. The folder is this call's alone, or has been its caller's. *lock: on rank 0.
static bt_status take_folder(const bt_comm *comm, const char *dir, bool held, int *lock, bt_errors *err)
{
    bt_status status = BT_OK;
    *lock = -1;
    if (comm->rank == 0) {
        status = bt_file_make_dir(dir, err);
        if (status == BT_OK && !held && (*lock = bt_lock_take(dir, NULL, err)) < 0) status = BT_ERR_IO;
        if (status == BT_OK) bt_folder_recover(dir);
    }
    return bt_comm_agree(comm, status);
}

int bt_run_threads(const bt_comm *comm, const bt_case *c, int asked)
{
    if (asked > 0) return asked;
    if (c->run.threads > 0) return (int)c->run.threads;
    const int share = bt_cores_share(comm); // by all ranks, whatever the environment of each
    return getenv("OMP_NUM_THREADS") ? omp_get_max_threads() : share;
}

// Ranks wait for each other, and what one of them gains in a second says little. The validation build has all threads
// at work, for the thread sanitizer.
#ifdef BT_VALIDATE
enum { PACED = 0 };
#else
enum { PACED = 1 };
#endif

/// Start the team, with signals left to the main thread (as in bt_comm_start).
static void start_threads(int n)
{
    omp_set_num_threads(n);
    sigset_t before;
    bt_halt_block(&before);
#pragma omp parallel
    {
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
}

/// Field, world and cells, distributed to the ranks. kept: as it left them, or NULL.
static bt_status set_up(run *r, bt_snapshot *kept, bt_errors *err)
{
    const int threads = bt_run_threads(r->comm, r->c, r->o->threads);
    start_threads(threads);
    bt_pace_begin(&r->pace, threads, PACED && r->comm->size == 1);
    bt_field f;
    bt_field_init(&f);
    bt_lead_stats lead = {0};
    bt_status status = kept ? bt_running_load_field(&f, &lead, kept)
                            : make_field(r->comm, r->c, r->o->fields, &f, &lead, err);
    status = bt_comm_agree(r->comm, status);
    clock_part(r, &r->totals.call.ice);
    if (status == BT_OK) status = bt_comm_agree(r->comm, bt_setup_world(r->c, &f, &r->w, &r->roster, err));
    if (status == BT_OK) {
        if (r->comm->rank == 0 && r->o->dir) r->identity = bt_running_identity(r->c, &f, kept);
        keep_field(r, &f, &lead, threads);
        if (kept) {
            status = bt_running_load(r, kept, err);
        } else {
            bt_domain_create(r->w, r->comm);
            bt_cells_begin(r->w);
        }
        r->first_step = r->w->step;
    }
    bt_field_free(&f);
    clock_part(r, &r->totals.call.world);
    return status;
}

/// The record is open, and the steps of this call are known.
static bt_status begin_steps(run *r, bool fresh, bt_errors *err)
{
    const int64_t whole = bt_case_steps(r->c), asked = r->first_step + r->o->max_steps;
    r->end_step = r->until >= 0 ? r->until : r->o->max_steps > 0 && asked < whole ? asked : whole;
    r->progress = (bt_progress){.interval = r->c->output.progress, .n_steps = r->end_step, .quiet = r->o->quiet};
    bt_progress_start(&r->progress, r->w->step);
    const double energy = r->guard.energy; // of the start, from a checkpoint
    bt_guard_begin(&r->guard, r->c, r->w, &r->roster);
    if (energy > 0) r->guard.energy = energy;
    clock_part(r, &r->totals.call.record);
    r->began = r->clocked;
    if (!fresh) return BT_OK;
    r->frames_due = 1;
    r->frames = bt_running_draws(r->c);
    const bt_status status = r->frames ? record_frame(r, err) : BT_OK;
    r->totals.phases.output += bt_clock() - r->began;
    return status;
}

bt_status bt_running_begin(bt_running *r, const bt_comm *comm, const bt_case *c, const bt_run_options *o,
                           bt_run_manner *m, bt_errors *err)
{
    *r = (run){.comm = comm, .c = c, .o = o, .reference_speed = bt_case_reference_speed(c), .framed = -1, .failed = -1};
    r->halt = (bt_halt){.steps = c->output.checkpoint_steps,
                        .wall = c->output.checkpoint_wall,
                        .max_wall = o->max_wall,
                        .dir = o->dir,
                        .stop_signal = o->stop_signal,
                        .deaf = o->leave_signals,
                        .first = comm->rank == 0,
                        .started = m->start};
    r->until = m->until;
    r->clocked = o->began > 0 ? o->began : m->start;
    clock_part(r, &r->totals.call.program);
    // before the field is made, which may take long: of what has been read
    if (r->halt.first && o->dir && !m->kept) r->digests = bt_case_digests(c);
    bt_status status = set_up(r, m->kept, err);
    // Only now: a case that is refused leaves nothing behind.
    if (status == BT_OK && o->dir && !m->held) status = take_folder(comm, o->dir, o->held, &m->lock, err);
    if (status != BT_OK) return status;
    bt_halt_begin(&r->halt); // before the record, which says to whoever looks that the run has begun
    if (o->dir) status = open_record(r, m->kept, err);
    r->begun = status == BT_OK;
    if (r->begun) return begin_steps(r, !m->kept, err);
    bt_halt_end(&r->halt);
    return status;
}

// --- step ------------------------------------------------------------------------------------------------------------

/// Collective, once a step. The worst status of all ranks, and what any of them was asked for.
static bt_status agree(run *r, bt_status status)
{
    r->asked = bt_halt_look(&r->halt, r->w->step);
    if (r->comm->size == 1) return status;
    uint64_t bits = (status != BT_OK ? 1 : 0) | r->asked;
    bt_comm_reduce(r->comm, NULL, 0, NULL, 0, &bits, 1);
    r->asked = bits & ~UINT64_C(1);
    return bits & 1 ? bt_comm_agree(r->comm, status) : BT_OK;
}

static void add_phases(bt_run_totals *t, const bt_step_stats *st)
{
#define ADD(name, text) t->phases.name += st->phases.name, t->shared.name += st->shared.name;
    BT_WALL_PHASES(ADD)
#undef ADD
}

/// A frame at the first step at or after each multiple of the interval, and at the end.
static bt_status frame_if_due(run *r, double time, bt_errors *err)
{
    if (!bt_running_draws(r->c)) return BT_OK;
    const double interval = bt_running_frame_interval(r->c);
    const bool due = time >= (double)r->frames_due * interval * (1 - 1e-12), whole = r->w->step == bt_case_steps(r->c);
    if (r->framed == r->w->step || (!due && r->w->step != r->end_step)) return BT_OK;
    while ((double)r->frames_due * interval * (1 - 1e-12) <= time) r->frames_due++;
    if (due || whole) r->frames++;
    return record_frame(r, err);
}

/// A force law could not say what it does.
static bt_status tell_failed(const bt_forces *f, bt_errors *err)
{
    bt_errors_add(err, "force %s: %s; the run ends here", f->failed->name, f->why);
    return BT_ERR_NUMERIC;
}

bool bt_running_goes_on(const bt_running *r) { return r->w->step < r->end_step && !bt_halt_stops(r->asked); }

/// s of all threads of this process on a core.
static double processor_time(void)
{
    struct timespec t;
    return clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t) == 0 ? (double)t.tv_sec + 1e-9 * (double)t.tv_nsec : 0;
}

static void step_at_pace(bt_world *w, bt_pace *p)
{
    if (p->now != omp_get_max_threads()) start_threads(p->now);
    const double wall = bt_clock(), cpu = processor_time();
    bt_world_step(w);
    // not in the step itself: fields are shaken by steps that are not meant to converge
    const bt_lock lock = w->stats.converged ? (bt_lock){0} : bt_locked(w);
    w->stats.locked = lock.found;
    w->stats.no_load = lock.towed;
    bt_pace_step(p, bt_clock() - wall, processor_time() - cpu, (double)w->stats.contact_updates);
}

static void warn(const char *text, int64_t step)
{
    bt_errors warnings = {0};
    bt_errors_add(&warnings, "warning: --dump-contacts: step %" PRId64 " %s; no file is written", step, text);
    bt_errors_print(&warnings);
    bt_errors_free(&warnings);
}

static bt_status dump(const run *r, bt_errors *err)
{
    int64_t n = 0;
    for (bt_idx k = 0; k < r->w->cells->n; k++) n += r->w->cells->cell[k].n_contacts;
    if (n > 0) return bt_solver_dump(r->w, r->o->dump_path, err);
    warn("has no contacts", r->w->step);
    return BT_OK;
}

bt_status bt_running_step(bt_running *r, bt_errors *err)
{
    bt_world *w = r->w;
    bt_status status = BT_OK;
    step_at_pace(w, &r->pace);
    add_phases(&r->totals, &w->stats);
    w->stats.in_team = 0;
    const double t0 = bt_clock();
    if (w->step == r->o->dump_step) status = dump(r, err);
    bt_sample *const s = &r->sample;
    bt_observe(w, r->reference_speed, s);
    bt_stall_step(&r->totals.stall, w, s->ice_resistance, s->tow_force, r->roster.mean_size);
    const bt_status sound = w->forces->failed ? tell_failed(w->forces, err) : bt_guard_check(&r->guard, w, s, err);
    // what is not has been reported, and the series hold numbers only
    const bool writable = sound == BT_OK || !bt_sample_fault(s, bt_observe_applies(w));
    if (status == BT_OK && r->record && writable) status = bt_record_sample(r->record, s, err);
    if (status == BT_OK && r->record) status = bt_record_events(r->record, &w->events, err);
    if (status == BT_OK) status = sound;
    status = agree(r, status);
    if (status == BT_ERR_NUMERIC) bt_guard_name(&r->guard, w, err);
    if (status == BT_OK) status = frame_if_due(r, s->time, err);
    const bool saves = r->record && bt_halt_saves(r->asked); // at the end one is written anyway
    if (status == BT_OK && saves && bt_running_goes_on(r)) status = bt_running_checkpoint(r, BT_CHECKPOINT_FILE, err);
    bt_progress_step(&r->progress, w->step, s->time, s->ice_resistance);
    r->totals.phases.output += bt_clock() - t0;
    r->totals.shared.output += w->stats.in_team;
    return status;
}

// --- end -------------------------------------------------------------------------------------------------------------

/// Collective. Floes whose centroid has left the domain where it is not periodic.
static int64_t count_outside(const run *r)
{
    const bt_bodies *b = &r->w->bodies;
    const bt_case *c = r->c;
    int64_t n = 0, all;
    for (bt_idx i = 0; i < b->n; i++) {
        if (bt_roster_row(&r->roster, b->gid[i]) >= r->roster.n_floes || !bt_domain_owns(r->w, i)) continue;
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
    r->totals.undivided_steps = s.undivided;
    r->totals.imbalance = s.imbalance;
    r->totals.worst_imbalance = s.worst_imbalance;
    r->totals.repartition_imbalance = s.repartition_imbalance;
    r->totals.worst_repartition_imbalance = s.worst_repartition_imbalance;
    r->totals.edge_cut = s.cut;
    r->totals.halo_share = s.halo;
    bt_comm_before(r->comm, s.moved, &r->totals.moved_floes);
}

/// Collective. Peak memory of all ranks, and the bytes that a sweep goes through for a contact point.
static void measure_memory(run *r)
{
    const bt_cells *t = r->w->cells;
    struct rusage u;
    getrusage(RUSAGE_SELF, &u);
    double bytes = 0, points = 0;
    for (bt_idx k = 0; k < t->n; k++) {
        bytes += (double)t->cell[k].n_contacts * (double)bt_batch_bytes(&t->cell[k]);
        points += (double)t->cell[k].n_points;
    }
    bt_sum sums[3] = {{0}, {0}, {0}};
    bt_sum_add(&sums[0], 1024.0 * (double)u.ru_maxrss);
    bt_sum_add(&sums[1], bytes);
    bt_sum_add(&sums[2], points);
    bt_comm_reduce(r->comm, sums, 3, NULL, 0, NULL, 0);
    r->totals.memory = bt_sum_value(&sums[0]);
    r->totals.sweep_bytes_per_contact =
        bt_sum_value(&sums[2]) > 0 ? bt_sum_value(&sums[1]) / bt_sum_value(&sums[2]) : NAN;
}

/// Numbers of the end of the run.
static void total_up(run *r)
{
    r->totals.n_steps = r->w->step;
    r->totals.whole_steps = bt_case_steps(r->c);
    r->totals.events = &r->w->events;
    if (r->w->impacts) bt_impacts_end(r->w->impacts);
    r->totals.floes_outside = count_outside(r);
    r->totals.ice_area = bt_observe_ice_area(r->w);
    measure_memory(r);
    r->totals.state_hash = bt_world_hash(r->w);
    r->totals.window = r->w->window;
    r->totals.undisturbed = r->w->undisturbed;
    r->totals.splitting = r->w->splitting;
    note_division(r);
}

/// Collective. Guards and deepest overlap of the state that the last step has left, which no further step looks at. Its
/// contacts are looked for as the next step would, so the number is the same after any resume and on any ranks; the
/// state has been saved, and none of it is written from here on.
static bt_status look_last(run *r, bt_errors *err)
{
    const double overlap = bt_contacts_overlap(r->w);
    if (r->record) bt_record_overlap(r->record, overlap);
    const bt_status status = bt_comm_agree(r->comm, bt_guard_check_end(&r->guard, r->w, overlap, err));
    if (status == BT_ERR_NUMERIC) bt_guard_name(&r->guard, r->w, err);
    return status;
}

static bool ends_early(const run *r) { return bt_halt_stops(r->asked) && r->w->step < r->end_step; }

/// Collective. Record, summary and last checkpoint of a run whose steps came to an end in order.
static bt_status finish(run *r, bt_errors *err)
{
    char stopped[96] = "";
    bt_snapshot s = {0};
    const double t0 = bt_clock();
    bt_status status = bt_running_save(r, &s, BT_CHECKPOINT_FILE, err); // before what is still open is closed
    clock_part(r, &r->totals.call.steps);
    r->totals.phases.output += r->clocked - t0;
    r->totals.wall_time += r->clocked - r->began;
    r->totals.stepped = r->clocked;
    total_up(r);
    if (status == BT_OK) status = look_last(r, err);
    if (ends_early(r)) {
        bt_halt_describe(&r->halt, r->asked, r->w->step, stopped);
        r->totals.stopped = stopped;
    }
    if (r->o->dump_step > r->w->step) warn("was not reached", r->o->dump_step);
    const bool sound = status == BT_OK;
    const bt_status closed =
        bt_record_close(r->record, sound ? &r->totals : NULL, sound ? &s : NULL, !r->o->quiet, err);
    if (sound) status = closed;
    bt_snapshot_free(&s);
    status = bt_comm_agree(r->comm, status);
    if (status == BT_OK && *stopped) {
        bt_errors_add(err, "stopped by %s; %s holds everything up to there, and `bergtow resume %s` goes on", stopped,
                      r->o->dir, r->o->dir);
        status = BT_ERR_SIGNAL;
    }
    return status;
}

/// Collective. status: of the last step.
static bt_status close_steps(run *r, bt_status status, bt_errors *err)
{
    bt_progress_end(&r->progress);
    if (status == BT_OK && r->until >= 0) {
        status = ends_early(r) ? BT_ERR_SIGNAL : bt_running_checkpoint(r, BT_FAILURE_FILE, err);
        bt_record_abandon(r->record);
    } else if (status == BT_OK) {
        status = r->record ? finish(r, err) : look_last(r, err);
    } else if (r->record) {
        bt_errors more = {0}; // after a failed write another one says nothing new
        bt_record_close(r->record, NULL, NULL, false, status == BT_ERR_IO ? &more : err);
        bt_errors_free(&more);
    }
    if (status == BT_ERR_NUMERIC && r->w->step > r->first_step) r->failed = r->w->step;
    bt_halt_end(&r->halt);
    return status;
}

bt_status bt_running_stop(bt_running *r, bt_errors *err)
{
    r->end_step = r->w->step;
    return frame_if_due(r, (double)r->w->step * r->w->par.dt, err);
}

bt_status bt_running_frame(bt_running *r, bt_errors *err)
{
    if (r->framed == r->w->step) return BT_OK;
    r->frames++;
    return record_frame(r, err);
}

bt_status bt_running_end(bt_running *r, bt_status status, bt_errors *err)
{
    if (r->begun) status = close_steps(r, status, err);
    bt_field_free(&r->field);
    bt_roster_free(&r->roster);
    bt_world_free(r->w);
    free(r->digests);
    free(r->identity);
    return status;
}
