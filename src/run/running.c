// SPDX-License-Identifier: MIT
// A run in its three parts: begin (field, world, record), step, and end (summary, last checkpoint). The commands and
// the library (bergtow/simulation.h) use the same three.
//
// Ranks. Ranks agree on everything that may differ between them (an error, a signal) once per step, after the sample
// and before the frame, so that all leave the loop after the same step; every other collective call is made with an
// agreed status.
#include <inttypes.h>
#include <omp.h>
#include <time.h>

#include "output/checkpoint.h"
#include "base/inside.h"
#include "contact/contacts.h"
#include "bergtow/estimate.h"
#include "loads/impact.h"
#include "output/dump.h"
#include "output/observe.h"
#include "solve/batch.h"
#include "solve/islands.h"
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
#include "run/setup.h"

typedef bt_running run;

// --- begin -----------------------------------------------------------------------------------------------------------

/// Add the time since the last part of the call to this one.
static void clock_part(run *running, double *part)
{
    const double now = bt_clock();
    *part += now - running->clocked;
    running->clocked = now;
}

/// Collective. Rank 0 makes or reads the field, with all its threads, and opens the lead; then all ranks get the field.
/// lead: on rank 0.
static bt_status make_field(const bt_comm *comm, const bt_case *input, const char *fields, bt_field *field,
                            bt_lead_stats *lead, bt_errors *err)
{
    bt_status status = BT_OK;
    if (comm->rank == 0)
        status = bt_cost_fits(input, bt_case_floes_made(input) + input->n_floes, comm, bt_cost_machine(), err);
    if (comm->rank == 0 && status == BT_OK) status = bt_field_load_kept(fields, input, field, err);
    // the number of floes in a field file is known only now
    if (comm->rank == 0 && status == BT_OK) status = bt_cost_fits(input, field->n, comm, bt_cost_machine(), err);
    if (comm->rank == 0 && status == BT_OK) status = bt_lead_open(input, field, lead, err);
    bt_comm_rest(comm);
    status = bt_comm_agree(comm, status);
    if (status == BT_OK) bt_field_share(comm, field);
    return status;
}

/// Collective. Open the record. kept: the checkpoint to resume from, or NULL for a fresh run.
static bt_status open_record(run *running, bt_snapshot *kept, bt_errors *err)
{
    bt_record_bodies bodies;
    bt_status status = bt_gather_bodies(running->comm, running->w, &running->roster, &bodies, err);
    if (status != BT_OK) return status;
    bodies.outlines = &running->totals.outlines;
    // repeated steps must not replace the existing result
    const bool fresh = !kept && running->until < 0;
    status = bt_record_open(&running->record, running->comm, running->o->dir, running->c, &bodies,
                            running->o->command_line, running->digests, fresh, err);
    bt_gather_free(&bodies);
    free(running->roster.thickness); // result.h5 has it
    running->roster.thickness = NULL;
    if (status != BT_OK) return status;
    status = bt_comm_agree(running->comm, bt_record_identify(running->record, running->identity, err));
    if (status == BT_OK && running->w->impacts)
        status = bt_comm_agree(running->comm, bt_record_watch_impacts(running->record, running->w->impacts, err));
    if (status == BT_OK && running->w->splitting)
        status = bt_comm_agree(running->comm, bt_record_watch_splitting(running->record, running->w->splitting,
                                                                        &running->roster, err));
    if (status == BT_OK && kept) status = bt_record_load(running->record, kept, &running->w->events, err);
    if (status != BT_OK) bt_record_abandon(running->record);
    return status;
}

static bt_status record_frame(run *running, bt_errors *err)
{
    if (!running->record) return BT_OK;
    running->framed = running->w->step;
    bt_frame_row *rows;
    bt_piece_row *pieces;
    int64_t n_pieces;
    bt_status status = bt_gather_frame(running->comm, running->w, &running->roster, &rows, &pieces, &n_pieces, err);
    const bt_frame_line line = bt_gather_line(running->w);
    if (status == BT_OK)
        status = bt_record_frame(running->record, (double)running->w->step * running->w->par.dt, rows, &line, pieces,
                                 n_pieces, err);
    free(rows);
    free(pieces);
    return status;
}

/// Set the numbers of the run that follow from the field; from then on only rank 0 keeps the field.
static void keep_field(run *running, bt_field *field, const bt_lead_stats *lead, int threads)
{
    double thickness, radius;
    bt_estimate_field(field, &thickness, &radius);
    running->totals = (bt_run_totals){
        .ranks = running->comm->size,
        .threads = threads,
        .dt = running->c->run.dt,
        .mean_size = running->roster.mean_size,
        .sizes = bt_field_sizes_of(running->c, field),
        .mean_thickness = thickness,
        .mean_radius = radius,
        .concentration = lead->mode == BT_LEAD_NONE ? field->concentration : lead->concentration_before,
        .lead = *lead,
        .outlines = field->outlines,
        .tolerance = running->w->par.tolerance,
        .call = running->totals.call,
    };
    if (running->comm->rank == 0) {
        running->field = *field;
        free(running->field.vertices); // the bodies have them
        running->field.vertices = NULL;
        running->field.cap_vertices = 0;
    } else {
        bt_field_free(field);
    }
    *field = (bt_field){0};
}

/// Collective. May the run write into its folder, if the caller does not hold it?
static bt_status may_take(const bt_comm *comm, const bt_run_options *options, bt_errors *err)
{
    const bool asks = comm->rank == 0 && options->dir && !options->held;
    return bt_comm_agree(comm, asks ? bt_folder_may_take(options->dir, options->remedy, err) : BT_OK);
}

/// Collective. Lock the folder for this call, unless the caller holds it. *lock: on rank 0.
static bt_status take_folder(const bt_comm *comm, const bt_run_options *options, int *lock, bt_errors *err)
{
    const char *dir = options->dir;
    bt_status status = BT_OK;
    *lock = -1;
    if (comm->rank == 0) {
        status = bt_file_make_dir(dir, err);
        if (status == BT_OK && !options->held && (*lock = bt_lock_take(dir, NULL, err)) < 0) status = BT_ERR_IO;
        if (status == BT_OK) bt_folder_recover(dir);
    }
    status = bt_comm_agree(comm, status);
    // again: another call may have ended here while this one made its ice
    return status == BT_OK ? may_take(comm, options, err) : status;
}

int bt_run_threads(const bt_comm *comm, const bt_case *input, int asked)
{
    BT_PLAIN_NUMBERS;
    const int share = bt_cores_share(comm); // called by all ranks, whatever the options and environment of each
    if (asked > 0) return asked;
    if (input->run.threads > 0) return (int)input->run.threads;
    bt_limit_threads();
    return getenv("OMP_NUM_THREADS") ? omp_get_max_threads() : share;
}

// Not with several ranks, which wait for each other, so that the gain of one says little; nor in the validation build,
// where all threads work for the thread sanitizer.
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

/// Set up field, world and cells, distributed to the ranks. kept: the checkpoint with their state, or NULL.
static bt_status set_up(run *running, bt_snapshot *kept, bt_errors *err)
{
    const int threads = bt_run_threads(running->comm, running->c, running->o->threads);
    start_threads(threads);
    bt_pace_begin(&running->pace, threads, PACED && running->comm->size == 1);
    bt_field field;
    bt_field_init(&field);
    bt_lead_stats lead = {0};
    bt_status status = kept ? bt_running_load_field(&field, &lead, kept)
                            : make_field(running->comm, running->c, running->o->fields, &field, &lead, err);
    status = bt_comm_agree(running->comm, status);
    clock_part(running, &running->totals.call.ice);
    if (status == BT_OK)
        status = bt_comm_agree(running->comm, bt_setup_world(running->c, &field, &running->w, &running->roster, err));
    if (status == BT_OK) {
        if (running->comm->rank == 0 && running->o->dir)
            running->identity = bt_running_identity(running->c, &field, kept);
        keep_field(running, &field, &lead, threads);
        if (kept) {
            status = bt_running_load(running, kept, err);
        } else {
            bt_domain_create(running->w, running->comm);
            bt_cells_begin(running->w);
        }
        running->first_step = running->w->step;
    }
    bt_field_free(&field);
    clock_part(running, &running->totals.call.world);
    return status;
}

/// Begin the steps of this call once the record is open: last step, progress, guards, first frame.
static bt_status begin_steps(run *running, bool fresh, bt_errors *err)
{
    const int64_t whole = bt_case_steps(running->c), asked = running->first_step + running->o->max_steps;
    running->end_step = running->until >= 0 ? running->until : running->o->max_steps > 0 && asked < whole
                        ? asked : whole;
    running->progress = (bt_progress){.interval = running->c->output.progress, .n_steps = running->end_step,
                                      .quiet = running->o->quiet};
    bt_progress_start(&running->progress, running->w->step);
    const double energy = running->guard.energy; // from a checkpoint: that of the start
    bt_guard_begin(&running->guard, running->c, running->w, &running->roster);
    if (energy > 0) running->guard.energy = energy;
    clock_part(running, &running->totals.call.record);
    running->began = running->clocked;
    if (!fresh) return BT_OK;
    running->frames_due = 1;
    running->frames = bt_running_draws(running->c);
    const bt_status status = running->frames ? record_frame(running, err) : BT_OK;
    running->totals.phases.output += bt_clock() - running->began;
    return status;
}

bt_status bt_running_begin(bt_running *running, const bt_comm *comm, const bt_case *input,
                           const bt_run_options *options, bt_run_start *begin, bt_errors *err)
{
    *running = (run){.comm = comm, .c = input, .o = options, .reference_speed = bt_case_reference_speed(input),
                     .framed = -1, .failed = -1};
    running->halt = (bt_halt){.c = input, .o = options, .first = comm->rank == 0, .started = begin->start};
    running->until = begin->until;
    running->clocked = options->began > 0 ? options->began : begin->start;
    clock_part(running, &running->totals.call.program);
    // before the field is made, which may take long: digests of the files as read
    if (running->halt.first && options->dir && !begin->kept) running->digests = bt_case_digests(input);
    bt_status status = begin->kept ? BT_OK : bt_running_same_case(comm, input, err);
    if (status == BT_OK && !begin->held) status = may_take(comm, options, err);
    if (status == BT_OK) status = set_up(running, begin->kept, err);
    // Only now: a rejected case leaves nothing behind.
    if (status == BT_OK && options->dir && !begin->held)
        status = take_folder(comm, options, &begin->lock, err);
    if (status != BT_OK) return status;
    bt_halt_begin(&running->halt); // before the record, which shows that the run has begun
    if (options->dir) status = open_record(running, begin->kept, err);
    running->begun = status == BT_OK;
    if (running->begun) return begin_steps(running, !begin->kept, err);
    bt_halt_end(&running->halt);
    return status;
}

// --- step ------------------------------------------------------------------------------------------------------------

/// Collective, once per step. The worst status of all ranks, and the requests to any of them.
static bt_status agree(run *running, bt_status status)
{
    running->asked = bt_halt_look(&running->halt, running->w->step);
    if (running->comm->size == 1) return status;
    uint64_t bits = (status != BT_OK ? 1 : 0) | running->asked;
    bt_comm_reduce(running->comm, NULL, 0, NULL, 0, &bits, 1);
    running->asked = bits & ~UINT64_C(1);
    return bits & 1 ? bt_comm_agree(running->comm, status) : BT_OK;
}

/// Take a frame at the first step at or after each multiple of the interval, and at the end.
static bt_status frame_if_due(run *running, double time, bt_errors *err)
{
    if (!bt_running_draws(running->c)) return BT_OK;
    const double interval = bt_running_frame_interval(running->c);
    const bool due = time >= (double)running->frames_due * interval * (1 - 1e-12),
               whole = running->w->step == bt_case_steps(running->c);
    if (running->framed == running->w->step || (!due && running->w->step != running->end_step)) return BT_OK;
    while ((double)running->frames_due * interval * (1 - 1e-12) <= time) running->frames_due++;
    if (due || whole) running->frames++;
    return record_frame(running, err);
}

bool bt_running_has_next(const bt_running *running)
{
    return running->w->step < running->end_step && !bt_halt_stops(running->asked);
}

/// Processor time of all threads of this process, s.
static double processor_time(void)
{
    struct timespec t;
    return clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t) == 0 ? (double)t.tv_sec + 1e-9 * (double)t.tv_nsec : 0;
}

static void step_at_pace(bt_world *world, bt_pace *pace)
{
    if (pace->now != omp_get_max_threads()) start_threads(pace->now);
    const double wall = bt_clock(), cpu = processor_time();
    bt_world_step(world);
    // not in the step itself: steps that shake fields are not meant to converge
    const bt_lock lock = world->stats.converged ? (bt_lock){0} : bt_locked(world);
    world->stats.locked = lock.found;
    world->stats.no_load = lock.towed;
    bt_pace_step(pace, bt_clock() - wall, processor_time() - cpu, (double)world->stats.contact_updates);
}

static void warn(const char *text, int64_t step)
{
    bt_errors_warn("warning: --dump-contacts: step %" PRId64 " %s; no file is written", step, text);
}

static bt_status dump(const run *running, bt_errors *err)
{
    int64_t n = 0;
    for (bt_idx k = 0; k < running->w->cells->n; k++) n += running->w->cells->cell[k].n_contacts;
    if (n > 0) return bt_solver_dump(running->w, running->o->dump_path, err);
    warn("has no contacts", running->w->step);
    return BT_OK;
}

bt_status bt_running_step(bt_running *running, bt_errors *err)
{
    bt_world *world = running->w;
    bt_status status = BT_OK;
    step_at_pace(world, &running->pace);
    // Before the sample, so that the series have them. A run that is stopped keeps them open for the one that resumes.
    if (world->impacts && world->step == bt_case_steps(running->c)) bt_impacts_end(world->impacts);
#define ADD(name, text) \
    running->totals.phases.name += world->stats.phases.name, running->totals.shared.name += world->stats.shared.name;
    BT_WALL_PHASES(ADD)
#undef ADD
    world->stats.in_team = 0;
    const double t0 = bt_clock();
    if (world->step == running->o->dump_step) status = dump(running, err);
    bt_sample *const sample = &running->sample;
    bt_observe(world, running->reference_speed, sample);
    bt_stall_step(&running->totals.stall, world, sample->ice_resistance, sample->tow_force, running->roster.mean_size);
    const bt_forces *forces = world->forces;
    const bt_status sound = forces->failed ? bt_fail(err, BT_ERR_NUMERIC, "force %s: %s; the run ends here",
                                                     forces->failed->name, forces->why)
                                           : bt_guard_check(&running->guard, world, sample, err);
    // faults have been reported, and the series hold valid numbers only
    const bool writable = sound == BT_OK || !bt_sample_fault(sample, bt_observe_applies(world));
    if (status == BT_OK && running->record && writable) status = bt_record_sample(running->record, sample, err);
    if (status == BT_OK && running->record) status = bt_record_events(running->record, &world->events, err);
    if (status == BT_OK) status = sound;
    status = agree(running, status);
    if (status == BT_ERR_NUMERIC) bt_guard_name(&running->guard, world, err);
    if (status == BT_OK) status = frame_if_due(running, sample->time, err);
    const bool saves = running->record && bt_halt_saves(running->asked); // at the end a checkpoint is written anyway
    if (status == BT_OK && saves && bt_running_has_next(running))
        status = bt_running_checkpoint(running, BT_CHECKPOINT_FILE, err);
    bt_progress_step(&running->progress, world->step, sample->time, sample->ice_resistance);
    running->totals.phases.output += bt_clock() - t0;
    running->totals.shared.output += world->stats.in_team;
    return status;
}

// --- end -------------------------------------------------------------------------------------------------------------

/// Collective. Number of floes whose centroid has left the domain across an edge that is not periodic.
static int64_t count_outside(const run *running)
{
    const bt_bodies *bodies = &running->w->bodies;
    const bt_case *input = running->c;
    int64_t n = 0, all;
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (bt_roster_row(&running->roster, bodies->gid[i]) >= running->roster.n_floes ||
            !bt_domain_owns(running->w, i)) continue;
        const bool x_out = bodies->pose[i].x < input->domain.x0 ||
                           bodies->pose[i].x > input->domain.x0 + input->domain.length;
        const bool y_out = bodies->pose[i].y < input->domain.y0 ||
                           bodies->pose[i].y > input->domain.y0 + input->domain.width;
        n += (x_out && running->w->par.period_x == 0) || (y_out && running->w->par.period_y == 0);
    }
    bt_comm_before(running->comm, n, &all);
    return all;
}

/// Collective. Peak memory of all ranks, and the bytes that a sweep reads per contact point.
static void measure_memory(run *running)
{
    const bt_cells *cells = running->w->cells;
    double bytes = 0, points = 0;
    for (bt_idx k = 0; k < cells->n; k++) {
        bytes += (double)cells->cell[k].n_contacts * (double)bt_batch_bytes(&cells->cell[k]);
        points += (double)cells->cell[k].n_points;
    }
    bt_sum sums[3] = {{0}, {0}, {0}};
    bt_sum_add(&sums[0], bt_memory_peak());
    bt_sum_add(&sums[1], bytes);
    bt_sum_add(&sums[2], points);
    bt_comm_reduce(running->comm, sums, 3, NULL, 0, NULL, 0);
    running->totals.memory = bt_sum_value(&sums[0]);
    running->totals.sweep_bytes_per_contact =
        bt_sum_value(&sums[2]) > 0 ? bt_sum_value(&sums[1]) / bt_sum_value(&sums[2]) : NAN;
}

/// Set the totals at the end of the run.
static void total_up(run *running)
{
    running->totals.n_steps = running->w->step;
    running->totals.whole_steps = bt_case_steps(running->c);
    running->totals.events = &running->w->events;
    running->totals.floes_outside = count_outside(running);
    running->totals.ice_area = bt_observe_ice_area(running->w);
    measure_memory(running);
    running->totals.state_hash = bt_world_hash(running->w);
    running->totals.window = running->w->window;
    running->totals.undisturbed = running->w->undisturbed;
    running->totals.splitting = running->w->splitting;
    bt_domain_stats *division = &running->totals.division;
    *division = bt_domain_get_stats(running->w);
    bt_comm_before(running->comm, division->moved, &division->moved);
}

/// Collective. Guards and deepest overlap of the state after the last step, which no further step checks. Contacts are
/// detected as the next step would, so the number is the same after any resume and on any ranks; the state has been
/// saved, and nothing of it is written afterwards.
static bt_status look_last(run *running, bt_errors *err)
{
    const double overlap = bt_contacts_overlap(running->w);
    if (running->record) bt_record_overlap(running->record, overlap);
    const bt_status status =
        bt_comm_agree(running->comm, bt_guard_check_end(&running->guard, running->w, overlap, err));
    if (status == BT_ERR_NUMERIC) bt_guard_name(&running->guard, running->w, err);
    return status;
}

static bool ends_early(const run *running)
{
    return bt_halt_stops(running->asked) && running->w->step < running->end_step;
}

/// Collective. Write record, summary and last checkpoint of a run whose steps ended normally.
static bt_status finish(run *running, bt_errors *err)
{
    char stopped[96] = "";
    bt_snapshot snap = {0};
    const double t0 = bt_clock();
    bt_status status = bt_running_save(running, &snap, BT_CHECKPOINT_FILE, err);
    clock_part(running, &running->totals.call.steps);
    running->totals.phases.output += running->clocked - t0;
    running->totals.wall_time += running->clocked - running->began;
    running->totals.stepped = running->clocked;
    total_up(running);
    if (status == BT_OK) status = look_last(running, err);
    if (ends_early(running)) {
        bt_halt_describe(&running->halt, running->asked, running->w->step, stopped);
        running->totals.stopped = stopped;
    }
    if (running->o->dump_step > running->w->step) warn("was not reached", running->o->dump_step);
    const bool sound = status == BT_OK;
    const bt_status closed =
        bt_record_close(running->record, sound ? &running->totals : NULL, sound ? &snap : NULL, !running->o->quiet,
                        err);
    if (sound) status = closed;
    bt_snapshot_free(&snap);
    status = bt_comm_agree(running->comm, status);
    if (status == BT_OK && *stopped)
        status = bt_fail(err, BT_ERR_SIGNAL,
                         "stopped by %s; %s holds everything up to there, and `bergtow resume %s` continues", stopped,
                         running->o->dir, running->o->dir);
    return status;
}

/// Collective. End the steps and the record. status: of the last step.
static bt_status close_steps(run *running, bt_status status, bt_errors *err)
{
    bt_progress_end(&running->progress);
    if (status == BT_OK && running->until >= 0) {
        status = ends_early(running) ? BT_ERR_SIGNAL : bt_running_checkpoint(running, BT_FAILURE_FILE, err);
        bt_record_abandon(running->record);
    } else if (status == BT_OK) {
        status = running->record ? finish(running, err) : look_last(running, err);
    } else if (running->record) {
        // after a failed write further errors say nothing new
        bt_record_close(running->record, NULL, NULL, false, status == BT_ERR_IO ? NULL : err);
    }
    if (status == BT_ERR_NUMERIC && running->w->step > running->first_step) running->failed = running->w->step;
    bt_halt_end(&running->halt);
    return status;
}

bt_status bt_running_finish_early(bt_running *running, bt_errors *err)
{
    running->end_step = running->w->step;
    return frame_if_due(running, (double)running->w->step * running->w->par.dt, err);
}

bt_status bt_running_frame(bt_running *running, bt_errors *err)
{
    if (running->framed == running->w->step) return BT_OK;
    running->frames++;
    return record_frame(running, err);
}

bt_status bt_running_close(bt_running *running, bt_status status, bt_errors *err)
{
    if (running->begun) status = close_steps(running, status, err);
    bt_field_free(&running->field);
    bt_roster_free(&running->roster);
    bt_world_free(running->w);
    free(running->digests);
    free(running->identity);
    return status;
}
