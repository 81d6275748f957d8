// SPDX-License-Identifier: MIT
// A simulation that a program steps: the interface of libbergtow. docs/library.md has examples in C and Python.
//
//     bt_simulation *s;
//     if (bt_simulation_create(&s, &(bt_simulation_options){.path = "case.yml"})) die(bt_last_error());
//     while (bt_simulation_steps_left(s) > 0 && bt_simulation_step(s, 100) == BT_OK) look(s);
//     bt_simulation_end(s);
//
// The steps are those of `bergtow run`: the same begin, step and end, the same guards, and with a folder the same
// files. A simulation that is only stepped has the state hash of the command.
//
// Errors. Every call that can fail returns a bt_status; bt_last_error has the texts, one per line, each with the reason
// and the remedy. No call ends the program, except when memory runs out (bt_on_out_of_memory is called first) or an MPI
// call fails (all ranks are ended). After a failed step the state may only be read; end the simulation. With a folder,
// end and drop then compute the state before that step again, from the last checkpoint or the start, and keep it in
// failure.h5, as the command does; but not if a force was applied, or bodies were changed by hand since that
// checkpoint, because this cannot be repeated. Functions called by a step (forces, quantities) may read its simulation;
// changing or ending it, or stepping any simulation, is rejected: BT_ERR_USAGE.
//
// Threads. One thread of the program must make all calls, for all simulations; a simulation uses OpenMP threads within
// a step. Functions that a program adds to the table of force laws are called by those threads concurrently; applied
// forces (bergtow/applied.h) and quantities by one thread. Several simulations may exist and be stepped in turn.
// Additions of a program (laws, applied forces, quantities, keys, shapes) belong to the process, and must precede the
// simulations that use them; existing simulations continue without them. None acts while an ice field is made.
//
// Numbers. Calls, and functions that they call, have a decimal point and the default floating-point environment; on
// return the program has its own again.
//
// Signals. None is caught, unless options.signals requests the program's handlers, from create to end. While METIS cuts
// the field into parts for several ranks, SIGTERM is delayed.
//
// MPI. Without bt_comm_start (bergtow/comm.h) a simulation has one rank, whatever the launcher. After it, every call
// below is collective: all ranks make it, with the same arguments. Arrays over bodies have NaN for bodies that only
// other ranks hold.
//
// Output. Nothing is printed, except with options.progress, and warnings about a case on stderr.
#ifndef BERGTOW_SIMULATION_H
#define BERGTOW_SIMULATION_H

#include "bergtow/applied.h"
#include "bergtow/base.h"

BT_BEGIN_C

typedef struct bt_simulation bt_simulation;

typedef struct bt_simulation_options {
    const char *path;         ///< case file; with text: its name in messages, and base of relative file names
    const char *text;         ///< the case itself; NULL: read from path
    const char *const *set;   ///< [n_set] texts "key=value" that replace values of the case
    int n_set;
    const char *dir;          ///< result folder, relative to the working folder of this call; NULL = no files
    bool replace;             ///< replace an earlier run in the folder, as --force does
    bool signals;             ///< catch signals as the program does (docs/manual.md)
    bool progress;            ///< print progress and the table at the end
    int threads;              ///< of each rank, 1 to 1024; 0 = run.threads of the case, or all cores
    const char *command_line; ///< for the provenance of the result; NULL = none
    const char *from;         ///< bt_simulation_resume: this checkpoint instead of the last one in dir; or NULL
} bt_simulation_options;

/// Read the case, make or read its ice, open the folder. *sim is NULL after an error: BT_ERR_CASE, BT_ERR_IO,
/// BT_ERR_USAGE.
bt_status bt_simulation_create(bt_simulation **sim, const bt_simulation_options *options);

/// Resume a run in its folder (dir; made by `bergtow run`, `bergtow ensemble` or a program) from its last checkpoint,
/// or from its case if it was killed before the first. Additions of the program (laws, applied forces) must be the same
/// as before. path, text, set and replace are ignored; the rest is as for a new simulation. Errors: BT_ERR_USAGE for a
/// finished run, BT_ERR_IO, BT_ERR_CASE for a rejected checkpoint.
bt_status bt_simulation_resume(bt_simulation **sim, const bt_simulation_options *options);

/// Do n steps, or as many as are left. Errors: BT_ERR_NUMERIC (a guard, or a force that failed), BT_ERR_IO,
/// BT_ERR_SIGNAL: requested to stop, as by the file `stop` in the folder; then end the simulation.
bt_status bt_simulation_step(bt_simulation *sim, int64_t n);

/// End the simulation: with a folder, write summary and last checkpoint of the steps done; frees `sim`. Errors as for a
/// step, and BT_ERR_SIGNAL if it was requested to stop and its files are complete.
bt_status bt_simulation_end(bt_simulation *sim);

/// Free `sim` without summary and checkpoint; the folder stays as it is. NULL is ignored, and so is a simulation whose
/// step is in progress.
void bt_simulation_drop(bt_simulation *sim);

/// Add a frame of the present state, besides those of output.frame_interval; does nothing if this state has one.
/// Errors: BT_ERR_USAGE without a folder, BT_ERR_IO.
bt_status bt_simulation_frame(bt_simulation *sim);

int64_t bt_simulation_steps(const bt_simulation *sim);      ///< steps done
int64_t bt_simulation_steps_left(const bt_simulation *sim); ///< to the end; 0 after an error
double bt_simulation_time(const bt_simulation *sim);        ///< at the end of the last step, s
double bt_simulation_dt(const bt_simulation *sim);          ///< Δt, s

/// The progress line that the command prints: share, time, steps per second, time left, mean ice resistance so far.
/// Release with bt_release.
char *bt_simulation_progress(const bt_simulation *sim);

/// Hash of the state, as state_hash of summary.json.
uint64_t bt_simulation_hash(const bt_simulation *sim);

/// Write checkpoint and result of the present state, from which `bergtow resume` can continue. Errors: BT_ERR_USAGE
/// without a folder, BT_ERR_IO.
bt_status bt_simulation_checkpoint(bt_simulation *sim);

// --- bodies ----------------------------------------------------------------------------------------------------------
// Ids: floes of the field, floes given by hand, the towed body, walls.

int64_t bt_simulation_bodies(const bt_simulation *sim); ///< their number
int64_t bt_simulation_towed(const bt_simulation *sim);  ///< id, −1 = none

/// Data that bt_simulation_read gives, with the number of values per body.
typedef enum {
    BT_BODY_PLACE,     ///< 3: x, y (wrapped in periodic directions), yaw, m, m, rad
    BT_BODY_VELOCITY,  ///< 3: m/s, m/s, rad/s
    BT_BODY_MASS,      ///< 2: mass with and without added mass, kg
    BT_BODY_INERTIA,   ///< 1: with added inertia, kg m²
    BT_BODY_AREA,      ///< 1: m²
    BT_BODY_RADIUS,    ///< 1: of the circle about the outline, m
    BT_BODY_THICKNESS, ///< 1: of ice, m; 0 = not ice
    BT_BODY_MOTION,    ///< 1: 0 moved by forces, 1 velocity prescribed, 2 at rest for ever
    BT_BODY_DRAG,      ///< 5: skin and form drag of the water, of the air, rotational drag (bt_drag)
    BT_BODY_KINDS
} bt_body_numbers;
extern const int bt_body_widths[BT_BODY_KINDS]; ///< [kind] numbers per body, as in the list above

/// Read one kind of numbers of all bodies, out: [bodies][bt_body_widths[kind]]. Errors: BT_ERR_USAGE.
bt_status bt_simulation_read(const bt_simulation *sim, bt_body_numbers kind, double *out);

/// Vertices of a body's outline at its present pose, in the frame of the domain, anticlockwise; not wrapped, so they
/// may lie beyond a periodic end. Writes up to `room` points to xy, [room][2] m. Returns their total number; 0 if this
/// rank does not hold the body, or there is none with this id.
int64_t bt_simulation_outline(const bt_simulation *sim, int64_t id, double *xy, int64_t room);

/// Set the velocity of a body, m/s, rad/s. Errors: BT_ERR_USAGE for no such body, a prescribed or fixed one, NaN,
/// infinity.
bt_status bt_simulation_set_velocity(bt_simulation *sim, int64_t id, double x, double y, double rate);

/// Move a body to another pose, m, m, rad; its contacts end. Errors: BT_ERR_USAGE as above, for a towed body (its line
/// or course begins where it is), outside the domain, or where it would overlap another body.
bt_status bt_simulation_set_place(bt_simulation *sim, int64_t id, double x, double y, double yaw);

// --- numbers and contacts --------------------------------------------------------------------------------------------

/// Get a number of the last step by the name of its series (bergtow --list-quantities): "ice_resistance", "drag_force",
/// "line_tension", added ones. NaN before the first step, and if it does not apply. Under MPI those of collisions are
/// on rank 0. Errors: BT_ERR_USAGE for an unknown name.
bt_status bt_simulation_quantity(const bt_simulation *sim, const char *name, double *value);

/// Columns of a contact: ids of the bodies; number of points, 1 or 2 (0: floes over each other, whose impulse along x
/// is NORMAL_1, along y TANGENTIAL); the points, m, moved with body A since the start of the step; unit normal from A
/// to B; impulses on B in the last step, N s: normal at each point, and tangential, along (−ny, nx), of both together.
enum {
    BT_CONTACT_A, BT_CONTACT_B, BT_CONTACT_POINTS, BT_CONTACT_X1, BT_CONTACT_Y1, BT_CONTACT_X2, BT_CONTACT_Y2,
    BT_CONTACT_NX, BT_CONTACT_NY, BT_CONTACT_NORMAL_1, BT_CONTACT_NORMAL_2, BT_CONTACT_TANGENTIAL, BT_CONTACT_COLUMNS
};

/// Contacts of the last step that this rank solves: writes up to `room` rows to out, [room][BT_CONTACT_COLUMNS].
/// Returns their total number, including potential contacts without load; −1 in a force, while the step replaces them.
int64_t bt_simulation_contacts(const bt_simulation *sim, double *out, int64_t room);

// --- cases and texts -------------------------------------------------------------------------------------------------

/// Texts of the last failed call, one per line; valid until the next call. "" = none.
const char *bt_last_error(void);

/// Only read and check a case (path, text, set): gives every key with its value in SI units, as a case file (resolved)
/// and as one JSON object {"section.key": value} (values; angles in radians, null for keys without a value). Release
/// both with bt_release. Errors: BT_ERR_CASE, BT_ERR_IO.
bt_status bt_case_check_text(const bt_simulation_options *options, char **resolved, char **values);

/// The case of a simulation, as `resolved` of bt_case_check_text; for a resumed one, that of its checkpoint. Release
/// with bt_release.
char *bt_simulation_case(const bt_simulation *sim);

/// The keys without effect in a case that was run, from its text (case.resolved.yml, /case of result.h5), as one JSON
/// object {"section.key": why}; why completes "has no effect ". Files that the text names are not read, and its errors
/// are ignored. Release with bt_release.
char *bt_case_unused(const char *text);

/// Type of a file by its keys: "case", "study", or "" for any other or unreadable file.
const char *bt_file_holds(const char *path);

/// Read a number with a unit as in a case file; unit: SI symbol of its kind, "" for plain numbers, "%" for ratios.
/// Errors: BT_ERR_USAGE.
bt_status bt_number_read(const char *text, const char *unit, double *value);

/// "keys" of a case, or "quantities" of a run, as JSON (bergtow --list-keys --json), or "limits": the numbers by which
/// the program judges windows, domains and maps, sizes of its inputs and outputs, and constants that the Python package
/// also needs. NULL for another word. Release with bt_release.
char *bt_list_json(const char *what);

/// Are the bytes of a sealed file unchanged since it was written? kind: "result", "ensemble", "field" or "checkpoint".
/// Errors: BT_ERR_CASE, damaged, or not a file of this kind and version; BT_ERR_IO; BT_ERR_USAGE, unknown kind.
bt_status bt_seal_check(const char *path, const char *kind);

/// Do the files in a member's folder match its record, and is the record of the member `name` of the study in these n
/// bytes of study.resolved.yml (made_by)? Errors: BT_ERR_CASE, missing or changed; BT_ERR_IO.
bt_status bt_record_check(const char *folder, const char *name, const void *made_by, size_t n);

/// Lock a folder of many runs, for one process at a time: the lock DIR/lock holds until the descriptor *lock is closed,
/// here and in every process that has inherited it. Errors: BT_ERR_IO, naming the process that holds it.
bt_status bt_folder_lock(const char *dir, int *lock);

/// Release a text returned by one of these functions. NULL is ignored.
void bt_release(char *text);

/// "0.1.0"
const char *bt_version(void);

BT_END_C

#endif
