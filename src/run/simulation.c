// SPDX-License-Identifier: MIT
// A simulation that a program steps; see bergtow/simulation.h. Steps are those of a run (run_parts.h); this file has
// the interface: options, texts of errors, arrays by the ids of bodies.
#include "bergtow/simulation.h"

#include <string.h>
#include <unistd.h>

#include "base/checksum.h"
#include "base/fileio.h"
#include "base/inside.h"
#include "base/json.h"
#include "base/largest.h"
#include "base/units.h"
#include "case/arch.h"
#include "case/case_base.h"
#include "case/case_check.h"
#include "case/case_derived.h"
#include "case/ice_bounds.h"
#include "case/rope.h"
#include "case/schema.h"
#include "field/map_crs.h"
#include "output/checkpoint.h"
#include "bergtow/quantity.h"
#include "output/summary_keys.h"
#include "output/steady.h"
#include "run/ensemble_record.h"
#include "run/run_parts.h"
#include "space/cells.h"
#include "step/edit.h"

struct bt_simulation {
    bt_case c;
    bt_run_options o;
    char *dir, *from, *command_line; ///< texts to which o points
    bt_running r;
    bt_run_start m;
    bt_status status;         ///< of the last step
    char *why;                ///< reason of a failure, or NULL
    int n_series;             ///< known when it began; its samples have no others
    bool *moved;              ///< [bodies] moved by hand since the last step; NULL = none
    bool alone;               ///< no applied force in any step
};

// --- texts of errors -------------------------------------------------------------------------------------------------

static char *last_error;

const char *bt_last_error(void) { return last_error ? last_error : ""; }

/// Keep the texts of a call for the program, release them here, and return the status.
static bt_status reported(bt_status status, bt_errors *err)
{
    bt_comm_errors(bt_comm_world(), err);
    if (status != BT_OK || err->n > 0) {
        bt_text text;
        bt_text_begin(&text);
        for (size_t i = 0; i < err->n; i++) fprintf(text.out, "%s%s", i ? "\n" : "", err->text[i]);
        free(last_error);
        last_error = bt_text_end(&text);
    }
    bt_errors_free(err);
    return status;
}

static bt_status refuse(const char *why)
{
    bt_errors err = {0};
    bt_errors_add(&err, "%s", why);
    return reported(BT_ERR_USAGE, &err);
}

/// The simulation whose step is in progress: forces and quantities that it calls may read it, but not change it.
static const bt_simulation *stepping;

static bt_status refuse_within(void)
{
    return refuse("a step of the simulation is under way; return from the force or quantity that it has called first");
}

// --- begin, steps, end -----------------------------------------------------------------------------------------------

static bt_status read_case(bt_case *input, const bt_simulation_options *options, bt_errors *err)
{
    *input = (bt_case){0};
    if (!options->path && !options->text)
        return bt_fail(err, BT_ERR_USAGE, "no case: give its file in path, or the case itself in text");
    const char **place = bt_alloc((size_t)options->n_set, sizeof *place);
    for (int i = 0; i < options->n_set; i++) place[i] = ""; // messages name the value itself, and no option --set
    const bt_status status =
        options->text ? bt_case_read_text(input, options->path ? options->path : "case", options->text, options->set,
                                          place, options->n_set, err)
                      : bt_case_read_placed(input, options->path, options->set, place, options->n_set, err);
    free(place);
    return status;
}

static char *copy_of(const char *text) { return text ? bt_text_copy(text) : NULL; }

/// A path as an absolute path: the program may change its working folder while the simulation lasts.
static char *place_of(const char *path)
{
    char *here = path && *path && *path != '/' ? getcwd(NULL, 0) : NULL;
    char *whole = here ? bt_file_join(here, path) : copy_of(path);
    free(here);
    return whole;
}

static void release(bt_simulation *sim)
{
    bt_lock_drop(sim->dir, sim->m.lock);
    bt_case_free(&sim->c);
    BT_FREE(sim->dir, sim->from, sim->command_line, sim->why, sim->moved, sim);
}

static bt_simulation *simulation_of(const bt_simulation_options *options)
{
    bt_simulation *sim = bt_alloc(1, sizeof *sim);
    sim->dir = place_of(options->dir);
    sim->from = place_of(options->from);
    sim->command_line = copy_of(options->command_line);
    sim->o = (bt_run_options){.dir = sim->dir,
                              .remedy = options->replace ? NULL : "give another folder, or set `replace`",
                              .from = sim->from,
                              .threads = options->threads,
                              .quiet = !options->progress || bt_comm_world()->rank != 0,
                              .dump_step = -1,
                              .command_line = sim->command_line,
                              .leave_signals = !options->signals};
    sim->alone = true;
    sim->m = (bt_run_start){.start = bt_clock(), .until = -1, .lock = -1};
    return sim;
}

static bt_status begin(bt_simulation *sim, bt_errors *err)
{
    const bt_status status = bt_running_begin(&sim->r, bt_comm_world(), &sim->c, &sim->o, &sim->m, err);
    if (status != BT_OK) bt_running_close(&sim->r, status, err);
    sim->n_series = bt_n_series();
    return status;
}

static bt_status check_numbers(const bt_simulation_options *options, bt_errors *err)
{
    if (options->n_set < 0 || (options->n_set > 0 && !options->set))
        return bt_fail(err, BT_ERR_USAGE,
                       "n_set: %d is not a number of texts; give 0 with set NULL, or their number", options->n_set);
    if (options->threads >= 0 && options->threads <= BT_MAX_THREADS) return BT_OK;
    return bt_fail(err, BT_ERR_USAGE,
                   "threads: %d are not available; give 1 to %d, or 0 for run.threads of the case or all cores",
                   options->threads, BT_MAX_THREADS);
}

/// Common end of create and resume.
static bt_status finish_create(bt_simulation **out, bt_simulation *sim, bt_status status, bt_errors *err)
{
    *out = status == BT_OK ? sim : NULL;
    if (status != BT_OK) release(sim);
    return reported(status, err);
}

bt_status bt_simulation_create(bt_simulation **out, const bt_simulation_options *options)
{
    BT_PLAIN_NUMBERS;
    bt_errors err = {0};
    bt_simulation *sim = simulation_of(options);
    bt_status status = check_numbers(options, &err);
    if (status == BT_OK) status = read_case(&sim->c, options, &err);
    status = bt_comm_agree(bt_comm_world(), status);
    if (status == BT_OK) status = begin(sim, &err);
    return finish_create(out, sim, status, &err);
}

bt_status bt_simulation_resume(bt_simulation **out, const bt_simulation_options *options)
{
    BT_PLAIN_NUMBERS;
    bt_errors err = {0};
    bt_simulation *sim = simulation_of(options);
    bt_resume resume = {.lock = -1};
    bt_status status = check_numbers(options, &err);
    if (!options->dir) bt_errors_add(&err, "no folder to continue in; name the folder of the run in the options (dir)");
    else if (options->path || options->text || options->n_set > 0)
        bt_errors_add(&err, "%s already contains the case of this run; leave path, text and set empty when resuming",
                      options->dir);
    if (err.n > 0) status = BT_ERR_USAGE;
    else status = bt_resume_begin(&resume, bt_comm_world(), &sim->o, &err);
    if (status == BT_OK && resume.finished)
        status = bt_fail(&err, BT_ERR_USAGE, "%s is finished: all %lld steps are done", options->dir,
                         (long long)bt_case_steps(&resume.c));
    sim->m.lock = resume.lock;
    sim->m.held = true;
    sim->c = resume.c; // ours from here on
    resume.c = (bt_case){0};
    if (status == BT_OK) {
        sim->m.kept = resume.fresh ? NULL : &resume.s;
        status = begin(sim, &err);
        sim->m.kept = NULL;
    }
    bt_resume_end(&resume);
    return finish_create(out, sim, status, &err);
}

/// Can the state before the failed step be computed again from the folder alone?
static bool keeps_failure(const bt_simulation *sim)
{
    const bool unsound = sim->status == BT_ERR_NUMERIC && sim->r.w->step > sim->r.first_step;
    return unsound && sim->dir && sim->alone && !sim->r.edited;
}

static void forget_moved(bt_simulation *sim)
{
    free(sim->moved);
    sim->moved = NULL;
}

bt_status bt_simulation_step(bt_simulation *sim, int64_t n)
{
    BT_PLAIN_NUMBERS;
    bt_errors err = {0};
    if (stepping) return refuse_within(); // of any simulation: applied forces hold the bodies of one world at a time
    if (sim->status != BT_OK) return refuse("a step has failed before; end the simulation");
    sim->alone = sim->alone && !bt_force_is_applied();
    if (n > 0) forget_moved(sim);
    stepping = sim;
    for (; n > 0 && sim->status == BT_OK && bt_running_has_next(&sim->r); n--)
        sim->status = bt_running_step(&sim->r, &err);
    stepping = NULL;
    if (sim->status == BT_OK && bt_halt_stops(sim->r.asked))
        sim->status = bt_fail(&err, BT_ERR_SIGNAL,
                              "asked to stop after step %lld; end the simulation", (long long)sim->r.w->step);
    if (keeps_failure(sim))
        bt_errors_add(&err, "the end of the simulation writes the state before that step to %s/%s", sim->dir,
                      BT_FAILURE_FILE);
    const bt_status status = reported(sim->status, &err);
    if (status != BT_OK) sim->why = bt_text_copy(bt_last_error());
    return status;
}

/// Collective. End the run, and keep the state before a step that was not sound.
static bt_status close_parts(bt_simulation *sim, bt_status status, bt_errors *err)
{
    const bool keep = keeps_failure(sim);
    status = bt_running_close(&sim->r, status, err);
    if (keep) bt_run_keep_failure(bt_comm_world(), &sim->c, &sim->o, sim->r.failed, sim->m.start, err);
    return status;
}

/// Add the texts in the lines of `text`.
static void add_lines(bt_errors *err, const char *text)
{
    char *copy = bt_text_copy(text), *rest = copy;
    for (char *line; (line = strsep(&rest, "\n"));)
        if (*line) bt_errors_add(err, "%s", line); // ranks other than 0 have no text
    free(copy);
}

bt_status bt_simulation_end(bt_simulation *sim)
{
    BT_PLAIN_NUMBERS;
    if (sim == stepping) return refuse_within();
    bt_errors err = {0};
    bt_status status = sim->status == BT_ERR_SIGNAL ? BT_OK : sim->status;
    if (sim->status == BT_OK) status = bt_running_finish_early(&sim->r, &err);
    status = close_parts(sim, status, &err);
    if (status != BT_OK && err.n == 0 && sim->why) add_lines(&err, sim->why);
    release(sim);
    return reported(status, &err);
}

void bt_simulation_drop(bt_simulation *sim)
{
    BT_PLAIN_NUMBERS;
    if (!sim) return;
    if (sim == stepping) {
        refuse_within();
        return;
    }
    bt_errors err = {0};
    close_parts(sim, sim->status == BT_OK ? BT_ERR_USAGE : sim->status, &err);
    bt_errors_free(&err);
    release(sim);
}

bt_status bt_simulation_checkpoint(bt_simulation *sim)
{
    BT_PLAIN_NUMBERS;
    bt_errors err = {0};
    if (sim == stepping) return refuse_within();
    if (!sim->dir) return refuse("there is no folder for a checkpoint; name one in the options (dir)");
    if (sim->status != BT_OK) return refuse("a step has failed: its state is not kept");
    return reported(bt_running_checkpoint(&sim->r, BT_CHECKPOINT_FILE, &err), &err);
}

bt_status bt_simulation_frame(bt_simulation *sim)
{
    BT_PLAIN_NUMBERS;
    bt_errors err = {0};
    if (sim == stepping) return refuse_within();
    if (!sim->dir) return refuse("there is no folder for a frame; name one in the options (dir)");
    if (sim->status != BT_OK) return refuse("a step has failed: its state is not kept");
    return reported(bt_running_frame(&sim->r, &err), &err);
}

int64_t bt_simulation_steps(const bt_simulation *sim) { return sim->r.w->step; }
int64_t bt_simulation_steps_left(const bt_simulation *sim)
{
    return sim->status == BT_OK && bt_running_has_next(&sim->r) ? sim->r.end_step - sim->r.w->step : 0;
}
double bt_simulation_dt(const bt_simulation *sim) { return sim->r.w->par.dt; }

double bt_simulation_time(const bt_simulation *sim)
{
    BT_PLAIN_NUMBERS;
    return (double)sim->r.w->step * sim->r.w->par.dt;
}

uint64_t bt_simulation_hash(const bt_simulation *sim)
{
    BT_PLAIN_NUMBERS;
    return bt_world_hash(sim->r.w);
}

// --- bodies ----------------------------------------------------------------------------------------------------------

const int bt_body_widths[BT_BODY_KINDS] = {
    [BT_BODY_PLACE] = 3,  [BT_BODY_VELOCITY] = 3,  [BT_BODY_MASS] = 2,   [BT_BODY_INERTIA] = 1, [BT_BODY_AREA] = 1,
    [BT_BODY_RADIUS] = 1, [BT_BODY_THICKNESS] = 1, [BT_BODY_MOTION] = 1, [BT_BODY_DRAG] = 5,
};

int64_t bt_simulation_bodies(const bt_simulation *sim) { return sim->r.w->bodies.n_global; }
int64_t bt_simulation_towed(const bt_simulation *sim) { return sim->r.w->towed; }

static void numbers_of(const bt_bodies *bodies, bt_idx i, bt_body_numbers kind, double *out)
{
    const bt_pose *pose = &bodies->pose[i];
    const bt_vel *v = &bodies->vel[i];
    const bt_drag *drag = &bodies->drag[i];
    switch (kind) {
    case BT_BODY_PLACE: out[0] = pose->x, out[1] = pose->y, out[2] = pose->yaw; break;
    case BT_BODY_VELOCITY: out[0] = v->x, out[1] = v->y, out[2] = v->w; break;
    case BT_BODY_MASS: out[0] = bodies->mass[i], out[1] = bodies->share[i] * bodies->mass[i]; break;
    case BT_BODY_INERTIA: out[0] = bodies->inertia[i]; break;
    case BT_BODY_AREA: out[0] = bodies->area[i]; break;
    case BT_BODY_RADIUS: out[0] = bodies->radius[i]; break;
    case BT_BODY_THICKNESS: out[0] = bodies->thickness[i]; break;
    case BT_BODY_MOTION: out[0] = bodies->motion[i]; break;
    case BT_BODY_DRAG:
        memcpy(out, (const double[]){drag->water_skin, drag->water_form, drag->air_skin, drag->air_form, drag->yaw},
               5 * sizeof *out);
        break;
    case BT_BODY_KINDS: break;
    }
}

bt_status bt_simulation_read(const bt_simulation *sim, bt_body_numbers kind, double *out)
{
    BT_PLAIN_NUMBERS;
    if ((unsigned)kind >= BT_BODY_KINDS) return refuse("there are no such numbers of a body; see bt_body_numbers");
    const bt_bodies *bodies = &sim->r.w->bodies;
    const int width = bt_body_widths[kind];
    for (bt_gid gid = 0; gid < bodies->n_global; gid++) {
        const bt_idx i = bodies->index_of[gid];
        if (i >= 0) numbers_of(bodies, i, kind, out + width * gid);
        else
            for (int k = 0; k < width; k++) out[width * gid + k] = NAN;
    }
    return BT_OK;
}

int64_t bt_simulation_outline(const bt_simulation *sim, int64_t id, double *xy, int64_t room)
{
    BT_PLAIN_NUMBERS;
    const bt_bodies *bodies = &sim->r.w->bodies;
    const bt_idx i = id < 0 || id >= bodies->n_global ? -1 : bodies->index_of[id];
    if (i < 0) return 0;
    const int n = bt_body_corners(bodies, i);
    const double *v = bodies->outline + 2 * bodies->offset[i];
    for (int k = 0; k < n && k < room; k++) {
        xy[2 * k] = bodies->pose[i].x + v[2 * k];
        xy[2 * k + 1] = bodies->pose[i].y + v[2 * k + 1];
    }
    return n;
}

#define NO_EDIT "a step has failed, or was the last: there is no next one for which a body could be changed"

static bool may_edit(const bt_simulation *sim) { return sim->status == BT_OK && bt_simulation_steps_left(sim) > 0; }

/// After an edit, a frame or checkpoint of this step no longer shows the state.
static bt_status edited(bt_simulation *sim, bt_status status, bt_errors *err)
{
    if (status == BT_OK) {
        sim->r.edited = true;
        sim->r.framed = -1;
    }
    return reported(status, err);
}

bt_status bt_simulation_set_velocity(bt_simulation *sim, int64_t id, double x, double y, double rate)
{
    BT_PLAIN_NUMBERS;
    bt_errors err = {0};
    if (sim == stepping) return refuse_within();
    if (!may_edit(sim)) return refuse(NO_EDIT);
    return edited(sim, bt_edit_velocity(sim->r.w, id, (const double[]){x, y, rate}, &err), &err);
}

static bool is_outside(double x, double low, double length) { return x < low || x > low + length; }

bt_status bt_simulation_set_place(bt_simulation *sim, int64_t id, double x, double y, double yaw)
{
    BT_PLAIN_NUMBERS;
    if (sim == stepping) return refuse_within();
    if (!may_edit(sim)) return refuse(NO_EDIT);
    bt_errors err = {0};
    const bt_params *par = &sim->r.w->par;
    const double length = sim->c.domain.length, width = sim->c.domain.width;
    if (is_outside(x, par->x0, length) || is_outside(y, par->y0, width)) {
        bt_errors_add(&err, "body %lld: (%g, %g) m is outside the domain, %g x %g m from (%g, %g)", (long long)id, x,
                      y, length, width, par->x0, par->y0);
        return reported(BT_ERR_USAGE, &err);
    }
    const bt_status status = bt_edit_place(sim->r.w, id, (const double[]){x, y, yaw}, &err);
    if (status == BT_OK) {
        if (!sim->moved) sim->moved = bt_alloc((size_t)sim->r.w->bodies.n_global, sizeof *sim->moved);
        sim->moved[id] = true;
    }
    return edited(sim, status, &err);
}

// --- numbers and contacts --------------------------------------------------------------------------------------------

bt_status bt_simulation_quantity(const bt_simulation *sim, const char *name, double *value)
{
    BT_PLAIN_NUMBERS;
    *value = NAN;
    if (!bt_series_find(name)) {
        bt_errors err = {0};
        bt_errors_add(&err, "%s: there is no series of this name; see bergtow --list-quantities", name);
        return reported(BT_ERR_USAGE, &err);
    }
    for (int k = 0; k < sim->n_series && sim->r.w->step > sim->r.first_step; k++)
        if (!strcmp(bt_series(k)->name, name)) *value = bt_sample_value(&sim->r.sample, bt_series(k));
    return BT_OK;
}

/// Columns of a contact; arms from body a follow from r·n = r×t, r·t = −r×n.
static void columns_of(const bt_bodies *bodies, const bt_contact *contact, double *out)
{
    const bt_pose *pose = &bodies->pose[contact->a];
    double at[2][2];
    for (int i = 0; i < 2; i++) {
        at[i][0] = pose->x + contact->rat * contact->nx + contact->ran[i] * contact->ny;
        at[i][1] = pose->y + contact->rat * contact->ny - contact->ran[i] * contact->nx;
        if (i >= contact->n) at[i][0] = at[i][1] = NAN;
    }
    memcpy(out,
           (const double[BT_CONTACT_COLUMNS]){
               (double)bodies->gid[contact->a], (double)bodies->gid[contact->b], contact->n, at[0][0], at[0][1],
               at[1][0], at[1][1], contact->nx, contact->ny, contact->ln[0], contact->ln[1], contact->lt},
           BT_CONTACT_COLUMNS * sizeof *out);
}

/// Are both bodies where the last step left them? Moving a body by hand ends its contacts.
static bool still_there(const bt_simulation *sim, const bt_contact *contact)
{
    const bt_gid *gid = sim->r.w->bodies.gid;
    return !sim->moved || !(sim->moved[gid[contact->a]] || sim->moved[gid[contact->b]]);
}

int64_t bt_simulation_contacts(const bt_simulation *sim, double *out, int64_t room)
{
    BT_PLAIN_NUMBERS;
    const bt_world *world = sim->r.w;
    if (world->forces->under_way) {
        refuse("a step is replacing the contacts; read them between two steps, or in a quantity");
        return -1;
    }
    int64_t n = 0;
    for (bt_idx k = 0; k < world->cells->n; k++) {
        const bt_cell *cell = &world->cells->cell[k];
        for (bt_idx j = 0; cell->own && j < cell->n_contacts; j++) {
            if (!still_there(sim, &cell->contacts[j])) continue;
            if (n < room) columns_of(&world->bodies, &cell->contacts[j], out + BT_CONTACT_COLUMNS * n);
            n++;
        }
    }
    return n;
}

// --- cases and texts -------------------------------------------------------------------------------------------------

bt_status bt_case_check_text(const bt_simulation_options *options, char **resolved, char **values)
{
    BT_PLAIN_NUMBERS;
    bt_errors err = {0};
    bt_case input;
    const bt_status status = read_case(&input, options, &err);
    *resolved = status == BT_OK ? bt_case_resolved(&input) : NULL;
    *values = status == BT_OK ? bt_case_resolved_json(&input) : NULL;
    bt_case_free(&input);
    return reported(status, &err);
}

char *bt_case_unused(const char *text)
{
    BT_PLAIN_NUMBERS;
    double row[2][3] = {{0}, {1e300}}; // replaces tables that the text names
    const bt_table table = {.n = 2, .row = row[0]};
    bt_case input;
    bt_case_read_kept(&input, "case", text, &table, &table, NULL);
    bt_json json = {0};
    bt_json_open(&json, NULL, '{');
    for (int k = 0; k < bt_n_case_keys; k++) {
        const char *why = bt_case_why_unused(&input, bt_case_keys[k].name);
        if (why) bt_json_string(&json, bt_case_keys[k].name, why);
    }
    bt_json_close(&json, '}');
    bt_case_free(&input);
    return json.text;
}

char *bt_simulation_progress(const bt_simulation *sim)
{
    BT_PLAIN_NUMBERS;
    char line[BT_PROGRESS_LINE];
    bt_progress_line(&sim->r.progress, line);
    return bt_text_copy(line);
}

char *bt_simulation_case(const bt_simulation *sim)
{
    BT_PLAIN_NUMBERS;
    return bt_case_resolved(&sim->c);
}

const char *bt_file_holds(const char *path)
{
    BT_PLAIN_NUMBERS;
    static const char *const kinds[] = {
        [BT_FILE_OTHER] = "", [BT_FILE_CASE] = "case", [BT_FILE_STUDY] = "study"};
    return kinds[bt_case_kind_of(path)];
}

bt_status bt_number_read(const char *text, const char *unit, double *value)
{
    BT_PLAIN_NUMBERS;
    bt_errors err = {0};
    char why[BT_WHY];
    int kind = 0;
    while (kind < BT_UNIT_KINDS && strcmp(bt_units_symbol(kind), unit) != 0) kind++;
    if (!strcmp(unit, "%")) kind = BT_UNIT_RATIO;
    if (kind == BT_UNIT_KINDS) bt_errors_add(&err, "%s: no SI unit of a key; see bergtow --list-keys", unit);
    else if (!bt_units_parse(text, kind, value, why)) bt_errors_add(&err, "%s: %s", text, why);
    return reported(err.n ? BT_ERR_USAGE : BT_OK, &err);
}

bt_status bt_seal_check(const char *path, const char *kind)
{
    BT_PLAIN_NUMBERS;
    static const char *const kinds[] = {BT_CHECKSUM_CHECKPOINT, BT_CHECKSUM_RESULT, BT_CHECKSUM_FIELD,
                                        BT_CHECKSUM_ENSEMBLE};
    const size_t n = strlen(kind);
    bt_errors err = {0};
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++)
        if (!strncmp(kinds[k], kind, n) && kinds[k][n] == ' ')
            return reported(bt_checksum_check(path, kinds[k], NULL, &err), &err);
    bt_errors_add(&err, "%s: not a kind of sealed file; give result, ensemble, field or checkpoint", kind);
    return reported(BT_ERR_USAGE, &err);
}

bt_status bt_record_check(const char *folder, const char *name, const void *made_by, size_t n)
{
    BT_PLAIN_NUMBERS;
    uint64_t seen = 0;
    bt_errors err = {0};
    bt_member_records records = {.n = 1, .seen = &seen};
    bt_checksum_digest_text(made_by, n, records.study);
    return reported(bt_member_record_check(&records, 0, name, folder, &err), &err);
}

bt_status bt_folder_lock(const char *dir, int *lock)
{
    BT_PLAIN_NUMBERS;
    bt_errors err = {0};
    *lock = bt_lock_take_file(dir, "lock", NULL, &err);
    return reported(*lock >= 0 ? BT_OK : BT_ERR_IO, &err);
}

static char *limits_json(void)
{
    bt_json json = {0};
    double thickness[2];
    bt_ice_thickness_range(&thickness[0], &thickness[1]);
    bt_json_open(&json, NULL, '{');
    bt_json_open(&json, "verdicts", '[');
    for (int k = 0; k <= BT_TOO_SHORT; k++) bt_json_string(&json, NULL, bt_verdict_names[k]);
    bt_json_close(&json, ']');
    bt_json_int(&json, "window_independent", BT_STEADY_INDEPENDENT);
    bt_json_int(&json, "window_contact_stretches", BT_STEADY_STRETCHES);
    bt_json_number(&json, "window_drift", BT_STEADY_MATERIAL);
    bt_json_number(&json, "locking_body_widths", BT_ARCH_LOCKING);
    bt_json_number(&json, "map_farthest_m", BT_MAP_FARTHEST);
    bt_json_int(&json, "threads", BT_MAX_THREADS);
    bt_json_int(&json, "contact_columns", BT_CONTACT_COLUMNS);
    bt_json_string(&json, "map_local_crs", BT_MAP_LOCAL_NAME);
    bt_json_numbers(&json, "map_ice_free_deg", 2, (const double[]){BT_MAP_FREE_SOUTH, BT_MAP_FREE_NORTH});
    bt_json_int(&json, "outline_vertices", BT_MAX_VERTICES);
    bt_json_numbers(&json, "thickness_m", 2, thickness);
    bt_json_number(&json, "gravity_m_s2", BT_GRAVITY);
    const bt_rope rope = bt_rope_named(BT_ROPE_POLYPROPYLENE, 1);
    bt_json_numbers(&json, "polypropylene_1_m", 3, (const double[]){rope.mass, rope.stiffness, rope.breaking});
    bt_json_close(&json, '}');
    return json.text;
}

char *bt_list_json(const char *what)
{
    BT_PLAIN_NUMBERS;
    if (!strcmp(what, "limits")) return limits_json();
    const bool keys = !strcmp(what, "keys");
    if (!keys && strcmp(what, "quantities") != 0) return NULL;
    bt_text text;
    bt_text_begin(&text);
    (keys ? bt_case_list_keys_json : bt_quantities_list_json)(text.out);
    return bt_text_end(&text);
}

void bt_release(char *text) { free(text); }

const char *bt_version(void) { return BT_VERSION; }
