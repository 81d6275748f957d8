// SPDX-License-Identifier: MIT
// The recorder of a run: series, frames, summary.
#ifndef BERGTOW_RECORD_H
#define BERGTOW_RECORD_H

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
/// files of an earlier run in dir are removed. For result.h5 see bt_record_publish. `input` and comm must stay valid
/// until the record is closed; `bodies` is copied. digests: of the files that the case names (case/case_files.h), or
/// NULL; written to case.resolved.yml. fresh: false for a run resumed from a checkpoint in dir: nothing is removed, and
/// bt_record_load comes next.
/// Errors: BT_ERR_IO on all ranks; the message, with path and remedy, on the rank concerned.
bt_status bt_record_open(bt_record **record, const bt_comm *comm, const char *dir, const bt_case *input,
                         const bt_record_bodies *bodies, const char *command_line, const char *digests, bool fresh,
                         bt_errors *err);

/// Then: write the identity of the run (record_resume.c) to the file and to the checkpoints of this record.
/// identity: on rank 0. The status is that of rank 0: agree on it. Errors: BT_ERR_IO.
bt_status bt_record_identify(bt_record *record, const char *identity, bt_errors *err);

/// Save the state of the record, on rank 0, after writing all its data to the file. n_frames: number of frames taken
/// that belong to the run whenever it ends. The status is that of rank 0.
bt_status bt_record_save(bt_record *record, int64_t n_frames, struct bt_snapshot *snap, bt_errors *err);

/// Collective. Replace result.h5 and frames.xdmf by the present state: a copy of the unfinished file, protected by a
/// checksum.
bt_status bt_record_publish(bt_record *record, bt_errors *err);

/// Collective. Resume from the saved state: series, frames, collisions and panel loads up to it are copied from
/// result.h5, which may hold more by now; events from `events`. Then case.resolved.yml is repaired if necessary, and
/// the summary removed. After bt_record_open, bt_record_identify and bt_record_watch_impacts. Errors: BT_ERR_CASE
/// (result.h5 is damaged, of another run, or too short), BT_ERR_IO.
bt_status bt_record_load(bt_record *record, struct bt_snapshot *snap, const bt_events *events, bt_errors *err);

/// Store collisions and panel loads too (/impacts, /panels): every later bt_record_sample takes the step's data from
/// `impacts`, which must stay valid until the record is closed. Before the first sample. The status is that of rank 0:
/// agree on it.
bt_status bt_record_watch_impacts(bt_record *record, const struct bt_impacts *impacts, bt_errors *err);

struct bt_roster;
struct bt_splitting;
/// Store floes that split, and their pieces (src/output/piece_store.h), from `splitting`, which must stay valid until
/// the record is closed, as must the roster. Before the first frame. The status is that of rank 0: agree on it.
bt_status bt_record_watch_splitting(bt_record *record, const struct bt_splitting *splitting,
                                    const struct bt_roster *roster, bt_errors *err);

/// Take one step's numbers. output.sample_every steps merge into one entry of the series by the table's rule; a
/// remainder at the end of the run also makes an entry. Entries are buffered, and flushed every 256 entries or 5 s of
/// wall time, and with every 16th frame or the first after half a second, so that a running or interrupted
/// result.part.h5 can be read. After a failure the record takes nothing more, and every call returns BT_ERR_IO; only
/// the first adds a message. Only rank 0 records: the status of other ranks differs, so agree on it.
bt_status bt_record_sample(bt_record *record, const bt_sample *sample, bt_errors *err);

/// Add the overlap of the last state, m, which is in no sample. After bt_record_save: a further step from the saved
/// state would measure it again. On rank 0.
void bt_record_overlap(bt_record *record, double overlap);

/// Write the events since the last call to /events (time, kind, subject, value; names of the kinds in kind_names). On
/// rank 0, as for bt_record_sample.
bt_status bt_record_events(bt_record *record, const bt_events *events, bt_errors *err);

/// Collective. Take one frame: rows of this rank's block. Stored as /frames/time [T], /frames/pose [T][n_floes][3],
/// /frames/contact_force [T][n_floes], /frames/body_pose [T][n_bodies − n_floes][3], /frames/speed [T][n_bodies],
/// /frames/velocity and /frames/net_force [T][n_bodies][2]; for a line with k branches /frames/line_points [T][2 k][2],
/// /frames/line_tension [T][k]; and for ParaView in single precision with all vertices as drawn (/xdmf, see
/// src/output/xdmf.c).
/// line: the same on all ranks, read if there are branches. pieces [n_pieces]: on rank 0, see
/// bt_record_watch_splitting. The status is the same on all ranks.
bt_status bt_record_frame(bt_record *record, double time, const bt_frame_row *rows, const bt_frame_line *line,
                          const bt_piece_row *pieces, int64_t n_pieces, bt_errors *err);

/// Collective. Write statistics over the steady window, summary.json and frames.xdmf; closes and frees `record` (also
/// on error). totals = NULL closes a run that failed: the series and frames taken so far are flushed and frames.xdmf is
/// written, but no summary. last: the last checkpoint, on rank 0 (otherwise NULL), written after the result and before
/// the summary, so that a folder with a summary is complete. table: finally print the table of the run (summary and
/// phases) on stdout, on rank 0, so that a slow or closed reader delays nothing.
bt_status bt_record_close(bt_record *record, const bt_run_totals *totals, bt_snapshot *last, bool table,
                          bt_errors *err);

/// Collective. Close and free a useless record, and remove result.part.h5.
void bt_record_abandon(bt_record *record);

#endif
