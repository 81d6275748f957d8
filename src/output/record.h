// SPDX-License-Identifier: MIT
// The recorder: what a run leaves behind, series, frames, summary.
#ifndef BERGTOW_RECORD_H
#define BERGTOW_RECORD_H

#include "bergtow/base.h"
#include "bergtow/case.h"
#include "bergtow/comm.h"
#include "bergtow/event.h"
#include "base/snapshot.h"
#include "output/frame.h"
#include "output/sample.h"
#include "output/totals.h"

struct bt_impacts;

typedef struct bt_record bt_record;

/// Collective. Open dir (made if missing), write case.resolved.yml and result.part.h5 with case, provenance and bodies;
/// what an earlier run has left in dir is removed. result.h5 is there once it is complete, see bt_record_publish.
/// `input` and comm must stay valid until the record is closed; `bodies` is copied. digests: of the files that the case
/// names (case/case_files.h), or NULL; they stand in case.resolved.yml.
/// Errors: BT_ERR_IO with path and remedy, on all ranks, the message on those that met it.
bt_status bt_record_open(bt_record **record, const bt_comm *comm, const char *dir, const bt_case *input,
                         const bt_record_bodies *bodies, const char *command_line, const char *digests, bt_errors *err);

/// Collective. The same for a run that goes on from a checkpoint in dir, of which nothing is removed. Then
/// bt_record_load.
bt_status bt_record_reopen(bt_record **record, const bt_comm *comm, const char *dir, const bt_case *input,
                           const bt_record_bodies *bodies, const char *command_line, bt_errors *err);

/// After either: the identity of the run (record_resume.c) goes to the file, and to the checkpoints of this record.
/// identity: on rank 0. The status is that of rank 0: agree on it.
bt_status bt_record_identify(bt_record *record, const char *identity, bt_errors *err);

/// Where the record stands, on rank 0; all it has taken is in the file then. n_frames: of those taken, how many belong
/// to the run whatever its end is. The status is that of rank 0.
bt_status bt_record_save(bt_record *record, int64_t n_frames, struct bt_snapshot *snap, bt_errors *err);

/// Collective. result.h5 and frames.xdmf as they are now: a copy of the file under way, protected by a checksum, in
/// place of what was there.
bt_status bt_record_publish(bt_record *record, bt_errors *err);

/// Collective. Go on where the record stood: series, frames, collisions and panel loads up to there are copied from
/// result.h5, which may hold more by now; events from `events`. Then case.resolved.yml is made good, and the summary
/// removed. After bt_record_reopen, bt_record_identify and bt_record_watch_impacts. Errors: BT_ERR_CASE (result.h5 is
/// damaged, of another run, or holds less), BT_ERR_IO.
bt_status bt_record_load(bt_record *record, struct bt_snapshot *snap, const bt_events *events, bt_errors *err);

/// Store collisions and panel loads too (/impacts, /panels): every later bt_record_sample takes what the step has left
/// in `impacts`, which must stay valid until the record is closed. Before the first sample. The status is that of rank
/// 0: agree on it.
bt_status bt_record_watch_impacts(bt_record *record, const struct bt_impacts *impacts, bt_errors *err);

struct bt_roster;
struct bt_splitting;
/// Store floes that split, and their pieces (src/output/piece_store.h), from `splitting`, which must stay valid until
/// the record is closed, as must the roster. Before the first frame. The status is that of rank 0: agree on it.
bt_status bt_record_watch_splitting(bt_record *record, const struct bt_splitting *splitting,
                                    const struct bt_roster *roster, bt_errors *err);

/// Take one step's numbers. output.sample_every steps merge into one entry of the series by the table's rule; a rest at
/// the end of the run is an entry too. Buffered, and flushed every 256 entries or 5 s of wall time, and with every 16th
/// frame or the first after half a second, so that a running or interrupted result.part.h5 can be read. After a failure
/// the record takes nothing more, and every call returns BT_ERR_IO; only the first adds a message. Rank 0 records; on
/// others nothing is done, and the status is not that of rank 0: agree on it.
bt_status bt_record_sample(bt_record *record, const bt_sample *sample, bt_errors *err);

/// An overlap that no sample holds: that of the last state, m. After bt_record_save, whose state a further step goes on
/// from and measures again. On rank 0.
void bt_record_overlap(bt_record *record, double overlap);

/// Write the events that came since the last call into /events (time, kind, subject, value; names of the kinds in
/// kind_names). On rank 0, as for bt_record_sample.
bt_status bt_record_events(bt_record *record, const bt_events *events, bt_errors *err);

/// Collective. Take one frame: rows of this rank's block. Stored as /frames/time [T], /frames/pose [T][n_floes][3],
/// /frames/contact_force [T][n_floes], /frames/body_pose [T][n_bodies − n_floes][3], /frames/speed [T][n_bodies],
/// /frames/velocity and /frames/net_force [T][n_bodies][2]; of a line with k branches /frames/line_points [T][2 k][2],
/// /frames/line_tension [T][k]; and for ParaView in single precision with all vertices as drawn (/xdmf, see
/// src/output/xdmf.c).
/// line: the same on all ranks, read where there are branches. pieces [n_pieces]: on rank 0, see
/// bt_record_watch_splitting. The status is the same on all ranks.
bt_status bt_record_frame(bt_record *record, double time, const bt_frame_row *rows, const bt_frame_line *line,
                          const bt_piece_row *pieces, int64_t n_pieces, bt_errors *err);

/// Collective. Statistics over the steady window, summary.json, frames.xdmf; closes and frees `record` (also on error).
/// totals = NULL closes a run that failed: the series and frames taken so far are flushed and frames.xdmf is written,
/// but no summary. last: the checkpoint of the end, on rank 0 (others and without: NULL), written when the result
/// stands and before the summary does: a folder with a summary lacks nothing. table: then print that of the end of the
/// run (summary and phases) on stdout, on rank 0: a reader that is slow or gone holds up nothing.
bt_status bt_record_close(bt_record *record, const bt_run_totals *totals, bt_snapshot *last, bool table,
                          bt_errors *err);

/// Collective. Close and free a record that is of no use, and remove result.part.h5.
void bt_record_abandon(bt_record *record);

#endif
