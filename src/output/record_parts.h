// SPDX-License-Identifier: MIT
// The struct behind output/record.h (private to the recorder).
#ifndef BT_RECORD_PARTS_H
#define BT_RECORD_PARTS_H

#include "output/frames.h"
#include "output/record.h"
#include "base/checksum.h"
#include "base/h5util.h"
#include "output/impact_store.h"
#include "output/piece_store.h"
#include "output/summary.h"

enum { BT_RECORD_BUFFER = 256 }; ///< entries of the series between flushes, and in a chunk

#define BT_RESULT_FILE "result.h5"
#define BT_RESULT_PART "result.part.h5" // the file being written

struct bt_record {
    bt_h5 h5;
    char *dir;
    const bt_case *c;
    const bt_comm *comm;
    char identity[BT_CHECKSUM_DIGEST]; ///< of the run, on rank 0 (record_resume.c)
    bool fresh;            ///< a new run, which replaces the contents of the folder
    bool replaces;         ///< another result was there, or an earlier one of this run
    bt_idx n_floes, towed; ///< of all ranks
    bt_history history;
    // series
    int n_series;          ///< when the run began; series that a program adds later are not recorded
    hid_t *series;         ///< [n_series]
    double *buffer;        ///< [n_series][BT_RECORD_BUFFER]
    int64_t written, buffered;
    double *merged;        ///< [n_series] of the steps of the present entry
    int64_t n_merged;
    double last_flush;     ///< bt_clock
    int frames_waiting;    ///< since the last flush
    hid_t events[4];       ///< time, kind, subject, value
    int64_t n_events;      ///< written
    bt_frames frames;
    bt_impact_store impacts;
    bt_piece_store pieces;
    // for the end of the run
    bt_summary summary;
    bt_impact_count count; ///< collisions over the window
};

/// Write the buffers to the file, and flush the file.
void bt_record_flush(bt_record *record);

/// Collective. Add a frame, with the pieces of floes on rank 0.
bt_status bt_record_add_frame(bt_record *record, double time, const bt_frame_row *rows, const bt_frame_line *line,
                              const bt_piece_row *pieces, int64_t n_pieces);

/// Text of frames.xdmf for the frames so far; the caller frees it.
char *bt_record_xdmf(const bt_record *record);

/// Merge the next step of an entry: m from the previous steps, x of this step.
static inline double bt_record_merge(bt_keep keep, double m, double x)
{
    return keep == BT_KEEP_LAST ? x : keep == BT_KEEP_MAX ? bt_max_seen(m, x) : m + x;
}

/// The value of an entry of n steps.
static inline double bt_record_merged(bt_keep keep, double m, int64_t n)
{
    return keep == BT_KEEP_MEAN ? m / (double)n : m;
}

#define BT_RECORD_IDENTITY "about/run" // in a checkpoint

#endif
