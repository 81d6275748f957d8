// SPDX-License-Identifier: MIT
// What a run leaves behind: series, frames, summary. The registry of quantities drives series, their texts and their
// state.
#ifndef BERGTOW_RECORD_H
#define BERGTOW_RECORD_H

#include <string.h>

#include "bergtow/base.h"
#include "bergtow/case.h"
#include "bergtow/comm.h"
#include "bergtow/event.h"
#include "bergtow/forces.h"
#include "bergtow/field.h"
#include "bergtow/quantity.h"
#include "base/snapshot.h"
#include "field/lead.h"
#include "output/stall.h"

/// One step as the recorder sees it. Forces on the towed body are means over the step (impulse / Δt). "Along" is the
/// tow direction; resisting components are positive against it, so that
/// tow = ice + drag + Coriolis + tilt + other laws + inertia.
typedef struct bt_sample {
    double time;            ///< s, end of the step
    double tow_force;       ///< N along
    double ice_resistance;  ///< N, contact force against the tow direction
    double ice_force_x, ice_force_y; ///< N, contact force on the body
    double ice_moment;      ///< N m, contact moment on the body about its centroid
    double drag_force;      ///< N, drag of water and air against the tow direction
    double coriolis_force, tilt_force; ///< N, Coriolis force and that of the sea-surface tilt against the tow direction
    double inertia_force;   ///< N, (M + added mass) × acceleration along the tow direction
    double ice_resistance_budget; ///< N, the same resistance by momentum, without the contacts of the body (observe.c)
    double body_x, body_y, body_yaw;   ///< m, m, rad; x, y not wrapped in periodic domains
    double body_vx, body_vy, body_yaw_rate; ///< m/s, rad/s
    /// m/s of the body relative to undisturbed ice (step/undisturbed.h) and to the water: along the tow direction, and
    /// across it, positive from +x towards +y
    double speed_through_ice, leeway_through_ice, speed_through_water, leeway_through_water;
    double body_in_ice_x, body_in_ice_y; ///< m, its place in a frame that goes along with undisturbed ice
    /// N (the larger of two branches), m (the first), m, m (NaN without a line)
    double line_tension, line_length, carriage_x, carriage_y;
    double line_tension_1, line_tension_2; ///< N by branch; NaN without it
    double vessel_x, vessel_y, vessel_speed; ///< m, m, m/s along its course (NaN without a vessel)
    /// N along its course: thrust = drag + inertia + line
    double vessel_thrust, vessel_drag, vessel_inertia, vessel_line;
    double current_x, current_y, wind_x, wind_y; ///< m/s, of the step (its middle, where they change)
    double contacts;        ///< contact points in the solver
    double contacts_body;   ///< of them on the towed body
    double sweeps, position_sweeps;
    double contact_updates, momentum_moves; ///< of contacts, in all sweeps of the step
    double residual_checks;  ///< of contacts, in all residual passes of the step
    double position_updates; ///< of contacts, in the sweeps of the position projection
    double unprojected;     ///< 1 if the position projection met its limit
    double residual;        ///< natural-map residual at the end of the step, max-norm, m/s
    double residual_rms;    ///< the same, root mean square over the rows, m/s
    double active;          ///< floes in cells whose contacts were looked at; the others rest
    double unconverged;     ///< 1 if the limit of work came before the tolerance
    double locked;          ///< 1 if some bodies could not give way to any load, either
    double no_load;         ///< 1 if these press on the towed body: its contact forces are no numbers, NaN
    double overlap;         ///< deepest overlap found at the start of the step, m
    double momentum_residual; ///< |Σ M ΔU − external impulse| / momentum exchanged
    double kinetic_energy;  ///< of all dynamic bodies, J
    double contact_work;    ///< work of the contact impulses in the step, J (<= 0 for e <= 1)
    double added_energy;    ///< 1 if it is more than the residual and rounding explain
    double repeats;         ///< times the step was solved again because floes outran the contact margin
    double outrun;          ///< 1 if they still did in the last solution
    double misjudged;       ///< rows at the end of pairs that pass each other, and pairs that meet without a row
    double restitution_cut; ///< 1 if the restitution was lowered in this step, see solver.h
    double collision_resistance; ///< N, part of ice_resistance by collisions (impact.h); the rest is quasi-static
    double collisions;      ///< with the body that ended in the step; NaN where they are not told apart
    double impact_peak;     ///< largest peak force of these, N; 0 without
    /// largest force of a floe on the body that no collision explains, N; NaN as for the collisions
    double largest_quasi_static_load;
    double moving;          ///< floes faster than 1 % of the reference speed
    double window_x;        ///< low end of the moving window, m (NaN, as the next two, where the domain stands still)
    double window_renewed;  ///< floes that were taken out behind and put in ahead at the start of the step
    double window_waiting;  ///< floes behind it whose place ahead is not free, when it last moved
    double laws[BT_MAX_LAW_NUMBERS]; ///< of the contact laws, as in bt_step_stats
    double added[BT_MAX_ADDED]; ///< [bt_n_added()] of the quantities that were registered
} bt_sample;

/// The program's own series, one for each member of a sample but `laws` and `added`; those of the contact laws come
/// before the last BT_SERIES_AFTER_LAWS. With both, and those registered: bt_series.
extern const bt_quantity bt_own_series[];
extern const int bt_n_own_series;
enum { BT_SERIES_AFTER_LAWS = 3 };
/// How many series there are before the first that is registered.
int bt_n_program_series(void);

/// Force of series k (bt_force_series_of) on the towed body against the tow direction in the step just solved, N.
double bt_force_against(const bt_world *w, int k);

/// The same by the name of the series: of_world of a quantity whose context is that name.
double bt_force_of(const bt_world *w, const void *series);

/// A number of a sample by its quantity.
static inline double bt_sample_value(const bt_sample *s, const bt_quantity *f)
{
    double value;
    memcpy(&value, (const char *)s + f->offset, sizeof value);
    return value;
}

static inline void bt_sample_set(bt_sample *s, const bt_quantity *f, double value)
{
    memcpy((char *)s + f->offset, &value, sizeof value);
}

/// Larger than any quantity of a run, and small enough for the squares that the statistics sum up.
#define BT_SAMPLE_MOST 1e100

/// The first quantity that applies and is no number below BT_SAMPLE_MOST, or does not apply and is a number; NULL = the
/// sample is sound.
/// has: bit 1 << k for each bt_applies k of the run.
const bt_quantity *bt_sample_fault(const bt_sample *s, unsigned has);

/// The contact forces of a step in which the load of the towed body has no bound (solve/islands.h) become NaN. The tow
/// force is one of them at a prescribed speed, and stays a number on a line.
void bt_sample_lose_load(bt_sample *s, bool prescribed);

struct bt_impacts;

/// Which bodies each rank records: first[k] up to first[k + 1] on rank k. Floes are distributed in equal blocks in the
/// order of their ids; the other bodies are the last rank's. first: [size + 1].
void bt_record_blocks(const bt_comm *c, bt_idx n_floes, bt_idx n_bodies, int64_t *first);

/// Bodies as the recorder needs them; the arrays belong to the caller, and hold the bodies of this rank's block: floes
/// first, then (on the last rank) other bodies. Without MPI the block is everything.
typedef struct bt_record_bodies {
    bt_idx n_floes, n_bodies;    ///< of all ranks; bodies = floes + hand-made fixed bodies + towed body + walls
    const int64_t *offsets;      ///< [bodies of the block + 1]
    const double *vertices;      ///< [offsets[end] − offsets[0]][2] m, body frame, from the block's first
    const double *thickness;     ///< [bodies of the block] m (draft + sail of the towed body, 0 for walls)
    const double *area;          ///< [bodies of the block] m²
    const char *const *names;    ///< [n_bodies − n_floes] "towed body", "wall x low", ...; on rank 0
    bt_idx towed;                ///< index of the towed body among all, −1 = none
    int branches;                ///< of the tow line, 0 = none
    /// where this rank holds them all, while the record is open: frames draw their outlines; NULL = those of a copy
    const bt_bodies *all;
    const bt_outline_counts *outlines; ///< of the map that the floes came from; NULL: of none
} bt_record_bodies;

/// A body in a frame.
typedef struct bt_frame_row {
    double x, y, yaw;        ///< m, m, rad
    double contact_force;    ///< largest normal force on the floe in this step, N; of other bodies not recorded
    double speed;            ///< of the centroid, m/s
    double vx, vy;           ///< its velocity, m/s; kept in single precision
    double fx, fy;           ///< sum of all contact forces on the body in this step, N; in single precision, too
} bt_frame_row;
enum { BT_FRAME_ROW = sizeof(bt_frame_row) / sizeof(double) };

/// A piece of a floe in a frame.
typedef struct bt_piece_row {
    double piece;            ///< which, from 0
    bt_frame_row row;
} bt_piece_row;

/// The tow line in a frame: each branch from the hull to its towing end, or at the hull alone once it is broken.
enum { BT_FRAME_BRANCHES = 2 };
typedef struct bt_frame_line {
    double point[BT_FRAME_BRANCHES][2][2]; ///< m, beside the body as frames show it
    double tension[BT_FRAME_BRANCHES];     ///< N
} bt_frame_line;

/// Parts of the wall time of a call: X(name, of what).
#define BT_CALL_PARTS(X)                                                                                               \
    X(program, "the start of the program, its libraries, and the case or checkpoint read")                             \
    X(ice, "making or reading the ice, the lead in it, and its way to all ranks")                                      \
    X(world, "bodies, velocities at the start, the check that nothing overlaps, the first cells")                      \
    X(record, "the folder and the result file, with the bodies in it")                                                 \
    X(steps, "the steps, with frames and checkpoints: phases_s has them all")                                          \
    X(end, "the last look at the state, the numbers of the whole run, the files closed")

/// Wall time of the call by parts, s.
typedef struct bt_call {
#define BT_MEMBER_OF_CALL(name, text) double name;
    BT_CALL_PARTS(BT_MEMBER_OF_CALL)
#undef BT_MEMBER_OF_CALL
} bt_call;

/// Numbers of the end of the run that the series do not hold.
typedef struct bt_run_totals {
    int64_t n_steps, whole_steps; ///< taken, and of the whole duration
    int ranks, threads;
    double dt, wall_time;
    double mean_size;            ///< mean equivalent diameter of the floes, m
    bt_field_sizes sizes;        ///< of the field, without floes given by hand
    /// weighted with area, of the field: for the estimates, m; 0 = as the case asks for
    double mean_thickness, mean_radius;
    double concentration;        ///< as made
    bt_lead_stats lead;          ///< what was cut into it then
    double ice_area;             ///< of all floes in the run, m²
    double tolerance;            ///< absolute, m/s
    int64_t floes_outside;       ///< left an open domain
    bt_stall stall;              ///< of the towed body
    bt_outline_counts outlines;  ///< of a field that was read
    uint64_t state_hash;
    const struct bt_window *window; ///< at the end of the run, NULL where the domain stands still
    const struct bt_undisturbed *undisturbed; ///< ice, at the end of the run; NULL where no body is towed
    const struct bt_splitting *splitting; ///< at the end of the run, NULL where floes do not split
    bt_phases phases, shared; ///< the second: of it, in passes that several threads share
    bt_call call;                ///< `end` is that of the summary's own time
    double stepped;              ///< bt_clock after the last step of this call
    // what the division among ranks has cost (domain.h); 0 for one rank
    int64_t divisions, undivided_steps, moved_floes;
    double imbalance, worst_imbalance, repartition_imbalance, worst_repartition_imbalance, edge_cut, halo_share;
    double memory;               ///< peak resident memory of all ranks, B
    /// what a sweep goes through for a contact point of the last step: batches and velocities, B; NaN without contacts
    double sweep_bytes_per_contact;
    const bt_events *events;     ///< what happened, or NULL
    const char *stopped;         ///< why the run ended early, or NULL
} bt_run_totals;

typedef struct bt_record bt_record;

/// Collective. Open dir (made if missing), write case.resolved.yml and result.part.h5 with case, provenance and bodies;
/// what an earlier run has left in dir is removed. result.h5 is there once it is complete, see bt_record_publish. c and
/// comm must stay valid until the record is closed; b is copied. digests: of the files that the case names
/// (case/case_files.h), or NULL; they stand in case.resolved.yml.
/// Errors: BT_ERR_IO with path and remedy, on all ranks, the message on those that met it.
bt_status bt_record_open(bt_record **r, const bt_comm *comm, const char *dir, const bt_case *c,
                         const bt_record_bodies *b, const char *command_line, const char *digests, bt_errors *err);

/// Collective. The same for a run that goes on from a checkpoint in dir, of which nothing is removed. Then
/// bt_record_load.
bt_status bt_record_reopen(bt_record **r, const bt_comm *comm, const char *dir, const bt_case *c,
                           const bt_record_bodies *b, const char *command_line, bt_errors *err);

/// After either: the identity of the run (record_resume.c) goes to the file, and to the checkpoints of this record.
/// identity: on rank 0. The status is that of rank 0: agree on it.
bt_status bt_record_identify(bt_record *r, const char *identity, bt_errors *err);

struct bt_snapshot;

/// Where the record stands, on rank 0; all it has taken is in the file then. n_frames: of those taken, how many belong
/// to the run whatever its end is. The status is that of rank 0.
bt_status bt_record_save(bt_record *r, int64_t n_frames, struct bt_snapshot *s, bt_errors *err);

/// Collective. result.h5 and frames.xdmf as they are now: a copy of the file under way, protected by a checksum, in
/// place of what was there.
bt_status bt_record_publish(bt_record *r, bt_errors *err);

/// Collective. Go on where the record stood: series, frames, collisions and panel loads up to there are copied from
/// result.h5, which may hold more by now; events from e. Then case.resolved.yml is made good, and the summary removed.
/// After bt_record_reopen, bt_record_identify and bt_record_watch_impacts. Errors: BT_ERR_CASE (result.h5 is damaged,
/// of another run, or holds less), BT_ERR_IO.
bt_status bt_record_load(bt_record *r, struct bt_snapshot *s, const bt_events *e, bt_errors *err);

/// Store collisions and panel loads too (/impacts, /panels): every later bt_record_sample takes what the step has left
/// in m, which must stay valid until the record is closed. Before the first sample. The status is that of rank 0: agree
/// on it.
bt_status bt_record_watch_impacts(bt_record *r, const struct bt_impacts *m, bt_errors *err);

struct bt_roster;
struct bt_splitting;
/// Store floes that split, and their pieces (src/output/piece_store.h), from s, which must stay valid until the record
/// is closed, as must the roster. Before the first frame. The status is that of rank 0: agree on it.
bt_status bt_record_watch_splitting(bt_record *r, const struct bt_splitting *s, const struct bt_roster *roster,
                                    bt_errors *err);

/// Take one step's numbers. output.sample_every steps merge into one entry of the series by the table's rule; a rest at
/// the end of the run is an entry too. Buffered, and flushed every 256 entries or 5 s of wall time, and with every 16th
/// frame or the first after half a second, so that a running or interrupted result.part.h5 can be read. After a failure
/// the record takes nothing more, and every call returns BT_ERR_IO; only the first adds a message. Rank 0 records; on
/// others nothing is done, and the status is not that of rank 0: agree on it.
bt_status bt_record_sample(bt_record *r, const bt_sample *s, bt_errors *err);

/// An overlap that no sample holds: that of the last state, m. After bt_record_save, whose state a further step goes on
/// from and measures again. On rank 0.
void bt_record_overlap(bt_record *r, double overlap);

/// Write the events that came since the last call into /events (time, kind, subject, value; names of the kinds in
/// kind_names). On rank 0, as for bt_record_sample.
bt_status bt_record_events(bt_record *r, const bt_events *e, bt_errors *err);

/// Collective. Take one frame: rows of this rank's block. Stored as /frames/time [T], /frames/pose [T][n_floes][3],
/// /frames/contact_force [T][n_floes], /frames/body_pose [T][n_bodies − n_floes][3], /frames/speed [T][n_bodies],
/// /frames/velocity and /frames/net_force [T][n_bodies][2]; of a line with k branches /frames/line_points [T][2 k][2],
/// /frames/line_tension [T][k]; and for ParaView in single precision with all vertices as drawn (/xdmf, see
/// src/output/xdmf.c).
/// line: the same on all ranks, read where there are branches. pieces [n_pieces]: on rank 0, see
/// bt_record_watch_splitting. The status is the same on all ranks.
bt_status bt_record_frame(bt_record *r, double time, const bt_frame_row *rows, const bt_frame_line *line,
                          const bt_piece_row *pieces, int64_t n_pieces, bt_errors *err);

/// Collective. Statistics over the steady window, summary.json, frames.xdmf; closes and frees r (also on error). t =
/// NULL closes a run that failed: the series and frames taken so far are flushed and frames.xdmf is written, but no
/// summary. last: the checkpoint of the end, on rank 0 (others and without: NULL), written when the result stands and
/// before the summary does: a folder with a summary lacks nothing. table: then print that of the end of the run
/// (summary and phases) on stdout, on rank 0: a reader that is slow or gone holds up nothing.
bt_status bt_record_close(bt_record *r, const bt_run_totals *t, bt_snapshot *last, bool table, bt_errors *err);

/// Collective. Close and free a record that is of no use, and remove result.part.h5.
void bt_record_abandon(bt_record *r);

#endif
