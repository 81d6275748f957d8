// SPDX-License-Identifier: MIT
// One run: field, world, step loop, record.
//
// Ranks. Whatever can differ between ranks (an error, a signal) is agreed on once a step, after the sample and before
// the frame, so that all leave the loop after the same step; every other collective call is made with an agreed status.
#include "bergtow/run.h"

#include <inttypes.h>
#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "bergtow/checkpoint.h"
#include "contact/contacts.h"
#include "bergtow/estimate.h"
#include "loads/impact.h"
#include "output/observe.h"
#include "solve/solver.h"
#include "output/stall.h"
#include "space/cells.h"
#include "case/case_check.h"
#include "case/cost.h"
#include "partition/domain.h"
#include "base/fileio.h"
#include "output/folder.h"
#include "output/gather.h"
#include "base/lock.h"
#include "revision.h"
#include "run/run_parts.h"

typedef bt_running run;

/// Collective. Rank 0 makes or reads the field, with all its threads, and opens the lead in it; then every rank has it.
/// lead: on rank 0.
static bt_status make_field(const bt_comm *comm, const bt_case *c, bt_field *f, bt_lead_stats *lead, bt_errors *err)
{
    bt_status status = BT_OK;
    if (comm->rank == 0) status = bt_cost_fits(c, bt_case_expected_floes(c) + c->n_floes, comm, bt_cost_machine(), err);
    if (comm->rank == 0 && status == BT_OK) status = bt_field_load(c, f, err);
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
    // steps that are made again leave the result that they belong to
    const bool again = kept || r->until >= 0;
    status =
        (again ? bt_record_reopen : bt_record_open)(&r->record, r->comm, r->o->dir, r->c, &b, r->o->command_line, err);
    bt_gather_free(&b);
    if (status != BT_OK) return status;
    if (r->w->impacts) status = bt_comm_agree(r->comm, bt_record_watch_impacts(r->record, r->w->impacts, err));
    if (status == BT_OK && kept) status = bt_record_load(r->record, kept, &r->w->events, err);
    if (status != BT_OK) bt_record_abandon(r->record);
    return status;
}

static bt_status record_frame(run *r, bt_errors *err)
{
    bt_frame_row *rows;
    bt_status status = bt_gather_frame(r->comm, r->w, &r->roster, &rows, err);
    if (status == BT_OK) status = bt_record_frame(r->record, (double)r->w->step * r->w->par.dt, rows, err);
    free(rows);
    return status;
}

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

/// Collective. Peak memory of all ranks, and the bytes of contacts and velocities that belong to a contact point.
static void measure_memory(run *r)
{
    const bt_cells *t = r->w->cells;
    struct rusage u;
    getrusage(RUSAGE_SELF, &u);
    double contacts = 0, points = 0;
    for (bt_idx k = 0; k < t->n; k++) {
        contacts += t->cell[k].n_contacts;
        points += (double)t->cell[k].n_points;
    }
    bt_sum sums[3] = {{0}, {0}, {0}};
    bt_sum_add(&sums[0], 1024.0 * (double)u.ru_maxrss);
    bt_sum_add(&sums[1], contacts * (double)(sizeof(bt_contact) + 2 * (sizeof(bt_vel) + sizeof(bt_inv))));
    bt_sum_add(&sums[2], points);
    bt_comm_reduce(r->comm, sums, 3, NULL, 0, NULL, 0);
    r->totals.memory = bt_sum_value(&sums[0]);
    r->totals.sweep_bytes_per_contact =
        bt_sum_value(&sums[2]) > 0 ? bt_sum_value(&sums[1]) / bt_sum_value(&sums[2]) : NAN;
}

/// A frame at the first step at or after each multiple of the interval, and at the end.
static bt_status frame_if_due(run *r, double time, bt_errors *err)
{
    if (!bt_running_draws(r->c)) return BT_OK;
    const double interval = bt_running_frame_interval(r->c);
    const bool due = time >= (double)r->frames_due * interval * (1 - 1e-12), whole = r->w->step == bt_case_steps(r->c);
    if (!due && r->w->step != r->end_step) return BT_OK;
    while ((double)r->frames_due * interval * (1 - 1e-12) <= time) r->frames_due++;
    if (due || whole) r->frames++;
    return record_frame(r, err);
}

static bt_status loop(run *r, bt_errors *err)
{
    bt_world *w = r->w;
    bt_status status = BT_OK;
    while (status == BT_OK && w->step < r->end_step && !bt_halt_stops(r->asked)) {
        bt_world_step(w);
        add_phases(&r->totals.phases, &w->stats);
        const double t0 = bt_clock();
        if (w->step == r->o->dump_step) status = bt_solver_dump(w, r->o->dump_path, err);
        bt_sample s;
        bt_observe(w, r->reference_speed, &s);
        bt_stall_step(&r->totals.stall, w, r->roster.mean_size);
        const bt_status sound = bt_guard_check(&r->guard, w, &s, err);
        // what is not has been told, and the series hold numbers only
        const bool writable = !bt_sample_fault(&s, bt_observe_applies(w));
        if (status == BT_OK && writable) status = bt_record_sample(r->record, &s, err);
        if (status == BT_OK) status = bt_record_events(r->record, &w->events, err);
        if (status == BT_OK) status = sound;
        status = agree(r, status);
        if (status == BT_ERR_NUMERIC) bt_guard_name(&r->guard, w, err);
        if (status == BT_OK) status = frame_if_due(r, s.time, err);
        const bool last = w->step == r->end_step || bt_halt_stops(r->asked); // then one is written anyway
        if (status == BT_OK && bt_halt_saves(r->asked) && !last)
            status = bt_running_checkpoint(r, BT_CHECKPOINT_FILE, err);
        bt_progress_step(&r->progress, w->step, s.time, s.ice_resistance);
        r->totals.phases.output += bt_clock() - t0;
    }
    return status;
}

/// Numbers of the end of the run.
static void total_up(run *r)
{
    r->totals.n_steps = r->w->step;
    r->totals.events = &r->w->events;
    if (r->w->impacts) bt_impacts_end(r->w->impacts);
    r->totals.floes_outside = count_outside(r);
    r->totals.ice_area = bt_observe_ice_area(r->w);
    measure_memory(r);
    r->totals.state_hash = bt_world_hash(r->w);
    r->totals.window = r->w->window;
    note_division(r);
}

/// Collective. Guards and deepest overlap of the state that the last step has left, which no further step looks at. Its
/// contacts are looked for as the next step would, so the number is the same after any resume and on any ranks; the
/// state has been saved, and none of it is written from here on.
static bt_status look_last(run *r, bt_errors *err)
{
    const double overlap = bt_contacts_overlap(r->w);
    bt_record_overlap(r->record, overlap);
    const bt_status status = bt_comm_agree(r->comm, bt_guard_check_end(&r->guard, r->w, overlap, err));
    if (status == BT_ERR_NUMERIC) bt_guard_name(&r->guard, r->w, err);
    return status;
}

/// Collective. Record, summary and last checkpoint of a run whose steps came to an end in order.
static bt_status finish(run *r, bt_errors *err)
{
    char stopped[96] = "";
    bt_snapshot s = {0};
    bt_status status = bt_running_save(r, &s, err); // before what is still open is closed
    r->totals.wall_time += bt_clock() - r->began;
    total_up(r);
    if (status == BT_OK) status = look_last(r, err);
    if (bt_halt_stops(r->asked) && r->w->step < r->end_step) {
        bt_halt_describe(&r->halt, r->asked, r->w->step, stopped);
        r->totals.stopped = stopped;
    }
    if (status == BT_OK && !r->o->quiet) bt_record_print_summary(r->record, &r->totals, err);
    const bool sound = status == BT_OK;
    const bt_status closed = bt_record_close(r->record, sound ? &r->totals : NULL, sound ? &s : NULL, err);
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

static bt_status run_world(run *r, bt_snapshot *kept, bt_errors *err)
{
    bt_status status = open_record(r, kept, err);
    if (status != BT_OK) return status;
    const int64_t whole = bt_case_steps(r->c), asked = r->first_step + r->o->max_steps;
    r->end_step = r->until >= 0 ? r->until : r->o->max_steps > 0 && asked < whole ? asked : whole;
    r->progress = (bt_progress){.interval = r->c->output.progress, .n_steps = r->end_step, .quiet = r->o->quiet};
    bt_progress_start(&r->progress, r->w->step);
    bt_guard_begin(&r->guard, r->c, r->w, r->roster.n_floes, r->roster.mean_size);
    bt_halt_begin(&r->halt);
    r->began = bt_clock();
    if (!kept) {
        r->frames_due = 1;
        r->frames = bt_running_draws(r->c);
        if (r->frames) status = record_frame(r, err);
    }
    if (status == BT_OK) status = loop(r, err);
    bt_progress_end(&r->progress);
    if (status == BT_OK && r->until >= 0) {
        status = bt_halt_stops(r->asked) ? BT_ERR_SIGNAL : bt_running_checkpoint(r, BT_FAILURE_FILE, err);
        bt_record_abandon(r->record);
    } else if (status == BT_OK) {
        status = finish(r, err);
    } else {
        bt_errors more = {0}; // after a failed write another one says nothing new
        bt_record_close(r->record, NULL, NULL, status == BT_ERR_IO ? &more : err);
        bt_errors_free(&more);
    }
    r->failed = status == BT_ERR_NUMERIC && r->w->step > r->first_step;
    bt_halt_end(&r->halt);
    return status;
}

int bt_run_threads(const bt_comm *comm, const bt_case *c, int asked)
{
    if (asked > 0) return asked;
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
    sigset_t before;
    bt_halt_block(&before);
#pragma omp parallel
    {
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
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
        .mean_thickness = thickness,
        .mean_radius = radius,
        .concentration = lead->mode == BT_LEAD_NONE ? f->concentration : lead->concentration_before,
        .lead = *lead,
        .outlines = f->outlines,
        .tolerance = r->w->par.tolerance,
    };
    if (r->comm->rank == 0) r->field = *f;
    else bt_field_free(f);
    *f = (bt_field){0};
}

/// Collective. The folder is this call's alone. *lock: on rank 0.
static bt_status take_folder(const bt_comm *comm, const char *dir, int *lock, bt_errors *err)
{
    bt_status status = BT_OK;
    *lock = -1;
    if (comm->rank == 0) {
        status = bt_file_make_dir(dir, err);
        if (status == BT_OK && (*lock = bt_lock_take(dir, err)) < 0) status = BT_ERR_IO;
        if (status == BT_OK) bt_folder_recover(dir);
    }
    return bt_comm_agree(comm, status);
}

/// How a case is run.
typedef struct {
    bt_snapshot *kept;   ///< go on from there, or NULL
    double start;        ///< bt_clock when the call began
    int64_t until;       ///< only up to this step, for failure.h5; −1 = as the options say
    bool held;           ///< the folder is held already
    int lock;            ///< by this, on rank 0
    int64_t failed;      ///< out: the step that was not sound, −1 = none
} manner;

/// Collective.
static bt_status run_case(const bt_comm *comm, const bt_case *c, const bt_run_options *o, manner *m, bt_errors *err)
{
    bt_snapshot *kept = m->kept;
    const int threads = bt_run_threads(comm, c, o->threads);
    start_threads(threads);
    run r = {.comm = comm, .c = c, .o = o, .reference_speed = bt_case_reference_speed(c)};
    r.halt = (bt_halt){.steps = c->output.checkpoint_steps,
                       .wall = c->output.checkpoint_wall,
                       .max_wall = o->max_wall,
                       .dir = o->dir,
                       .told = o->told,
                       .first = comm->rank == 0,
                       .started = m->start};
    r.until = m->until;
    m->failed = -1;
    bt_field f;
    bt_field_init(&f);
    bt_lead_stats lead = {0};
    bt_status status = kept ? bt_running_load_field(&f, &lead, kept) : make_field(comm, c, &f, &lead, err);
    status = bt_comm_agree(comm, status);
    if (status == BT_OK) status = bt_comm_agree(comm, bt_setup_world(c, &f, &r.w, &r.roster, err));
    if (status == BT_OK) {
        keep_field(&r, &f, &lead, threads);
        if (kept) {
            status = bt_running_load(&r, kept, err);
        } else {
            bt_domain_create(r.w, comm);
            bt_cells_begin(r.w);
        }
        r.first_step = r.w->step;
        // Only now: a case that is refused leaves nothing behind.
        if (status == BT_OK && !m->held) status = take_folder(comm, o->dir, &m->lock, err);
        m->held = true;
        if (status == BT_OK) status = run_world(&r, kept, err);
        if (r.failed) m->failed = r.w->step;
    }
    bt_field_free(&f);
    bt_field_free(&r.field);
    bt_roster_free(&r.roster);
    bt_world_free(r.w);
    return status;
}

/// Collective. A step was not sound: the state before it, made again from the last checkpoint (or the one of o->from,
/// or the start), goes to failure.h5.
static void keep_failure(const bt_comm *comm, const bt_case *c, const bt_run_options *o, int64_t step, bt_errors *err)
{
    bt_run_options quiet = *o;
    quiet.quiet = true;
    quiet.dump_step = -1;
    bt_snapshot s = {0};
    char *path = NULL, *said = NULL;
    bt_errors unheard = {0};
    int from = 0;
    if (comm->rank == 0 && o->from) from = bt_snapshot_read(&s, o->from, &unheard) == BT_OK;
    else if (comm->rank == 0 && bt_checkpoint_there(o->dir))
        from = bt_checkpoint_read(&s, o->dir, &path, &said, &unheard) == BT_OK;
    bt_comm_bcast(comm, &from, sizeof from);
    if (from) bt_snapshot_share(comm, &s);
    s.err = &unheard;
    manner m = {.kept = from ? &s : NULL, .start = bt_clock(), .until = step - 1, .held = true};
    const bt_status status = run_case(comm, c, &quiet, &m, &unheard);
    if (status == BT_OK)
        bt_errors_add(err, "%s/%s holds the state before that step; `bergtow resume %s/%s` meets it again", o->dir,
                      BT_FAILURE_FILE, o->dir, BT_FAILURE_FILE);
    else if (status == BT_ERR_SIGNAL)
        bt_errors_add(err, "the state before that step was not made again: stopped meanwhile");
    else
        for (size_t k = 0; k < unheard.n; k++)
            bt_errors_add(err, "the state before that step could not be kept: %s", unheard.text[k]);
    bt_errors_free(&unheard);
    bt_snapshot_free(&s);
    free(path);
    free(said);
}

/// Collective. A run, and what is kept of it when it fails. held: the caller has locked the folder.
static bt_status run_guarded(const bt_comm *comm, const bt_case *c, const bt_run_options *o, bt_snapshot *kept,
                             bool held, double start, bt_errors *err)
{
    manner m = {.kept = kept, .start = start, .until = -1, .held = held, .lock = -1};
    const bt_status status = run_case(comm, c, o, &m, err);
    if (m.failed >= 0) keep_failure(comm, c, o, m.failed, err);
    if (status != BT_OK && m.lock >= 0 && bt_folder_keeps(o->dir))
        bt_errors_add(err, "what %s held before is in %s/%s until a new result stands", o->dir, o->dir,
                      BT_FOLDER_REPLACED);
    bt_lock_drop(o->dir, m.lock);
    return status;
}

bt_status bt_run(const bt_comm *comm, const bt_case *c, const bt_run_options *o, bt_errors *err)
{
    if (comm->size > 1 && o->dump_step >= 0) {
        bt_errors_add(err,
                      "--dump-contacts: the contacts of %d ranks lie apart; start bergtow without mpirun for this (the "
                      "step is the same)",
                      comm->size);
        return BT_ERR_USAGE;
    }
    return run_guarded(comm, c, o, NULL, false, bt_clock(), err);
}

// --- going on --------------------------------------------------------------------------------------------------------

/// Collective. A run that was killed before its first checkpoint: from its case, at time zero.
static bt_status start_again(const bt_comm *comm, const bt_run_options *o, double start, bt_errors *err)
{
    char *path = bt_file_join(o->dir, "case.resolved.yml");
    bt_case c;
    bt_status status = bt_comm_agree(comm, bt_case_read(&c, path, NULL, 0, err));
    if (status == BT_OK && comm->rank == 0 && !o->quiet)
        printf("%s holds no checkpoint: the run starts at time zero\n", o->dir);
    if (status == BT_OK) status = run_guarded(comm, &c, o, NULL, true, start, err);
    bt_case_free(&c);
    free(path);
    return status;
}

/// What the user should know of the checkpoint that is taken.
static void tell(const bt_snapshot *s, const char *said)
{
    bt_errors warnings = {0};
    if (said) bt_errors_add(&warnings, "warning: %s", said);
    const bt_item *i = bt_snapshot_find(s, "about/revision");
    if (i && i->type == BT_ITEM_TEXT && strcmp(i->data, BT_REVISION))
        bt_errors_add(&warnings,
                      "warning: %s was written by revision %s of the program, and this is %s: the run may go on "
                      "otherwise than it would have",
                      s->path, (const char *)i->data, BT_REVISION);
    bt_errors_print(&warnings);
    bt_errors_free(&warnings);
}

static bt_status go_on(const bt_comm *comm, bt_snapshot *s, const bt_run_options *o, double start, bt_errors *err)
{
    bt_case c;
    bt_status status = bt_comm_agree(comm, bt_running_load_case(&c, s, err));
    const int64_t step = bt_snapshot_int(s, "world/step");
    // without its summary it was stopped between its last checkpoint and that: no step is left, but the end is
    int ended = comm->rank == 0 && bt_file_there(o->dir, "summary.json");
    bt_comm_bcast(comm, &ended, sizeof ended);
    const bool finished = status == BT_OK && ended && step >= bt_case_steps(&c);
    if (finished && comm->rank == 0 && !o->quiet)
        printf("%s is finished: all %" PRId64 " steps are done\n", o->dir, step);
    if (status == BT_OK && !finished) status = run_guarded(comm, &c, o, s, true, start, err);
    bt_case_free(&c);
    return status;
}

bt_status bt_run_resume(const bt_comm *comm, const bt_run_options *o, bt_errors *err)
{
    const double start = bt_clock();
    bt_snapshot s = {.path = o->dir};
    char *path = NULL, *said = NULL;
    bt_status status = BT_OK;
    int lock = -1, fresh = 0;
    if (comm->rank == 0) {
        if (!bt_file_there(o->dir, ".")) {
            bt_errors_add(err, "%s: there is no such folder; give the result folder of a run", o->dir);
            status = BT_ERR_IO;
        } else if ((lock = bt_lock_take(o->dir, err)) < 0) {
            status = BT_ERR_IO;
        } else {
            bt_folder_recover(o->dir);
            fresh = !o->from && !bt_checkpoint_there(o->dir) && bt_file_there(o->dir, "case.resolved.yml") &&
                    !bt_file_there(o->dir, "summary.json");
        }
        if (status == BT_OK && fresh) status = bt_folder_check(o->dir, err);
        else if (status == BT_OK) {
            status = o->from ? bt_snapshot_read(&s, o->from, err) : bt_checkpoint_read(&s, o->dir, &path, &said, err);
            if (status == BT_OK) tell(&s, said);
        }
    }
    status = bt_comm_agree(comm, status);
    bt_comm_bcast(comm, &fresh, sizeof fresh);
    if (status == BT_OK && fresh) status = start_again(comm, o, start, err);
    else if (status == BT_OK) {
        bt_snapshot_share(comm, &s);
        s.err = err;
        status = go_on(comm, &s, o, start, err);
    }
    bt_snapshot_free(&s);
    bt_lock_drop(o->dir, lock);
    free(path);
    free(said);
    return status;
}
