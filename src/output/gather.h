// SPDX-License-Identifier: MIT
// Bodies from the ranks that hold them to the ranks that record them.
#ifndef BT_GATHER_H
#define BT_GATHER_H

#include "bergtow/world.h"
#include "output/frame.h"

// --- names -----------------------------------------------------------------------------------------------------------

/// Data of the bodies for the recorder, besides their outlines.
typedef struct bt_roster {
    bt_idx n_floes;         ///< generated or read, followed by those given by hand
    double *thickness;      ///< [n bodies] m; draft + sail of the towed body, 0 for walls
    const char **names;     ///< [n bodies − n_floes]
    double mean_size;       ///< mean equivalent diameter of the floes, m
    bt_idx n_free;          ///< floes generated or read, which move freely; those given by hand may be fixed
    bt_gid n_kept;          ///< ids for pieces of floes, from n_free on
} bt_roster;

/// Row of a body among the original ones, in the order of their ids; −1 for a piece of a floe.
static inline bt_gid bt_roster_row(const bt_roster *roster, bt_gid gid)
{
    return gid < roster->n_free ? gid : gid < roster->n_free + roster->n_kept ? -1 : gid - roster->n_kept;
}

/// Id of a body in the files, one for each: its row in /floes, /bodies and /pieces, one after the other. Ids of pieces
/// in the world lie between those of the others. n_bodies: floes and bodies at the start.
static inline bt_gid bt_roster_id(const bt_roster *roster, bt_gid n_bodies, bt_gid gid)
{
    const bt_gid row = bt_roster_row(roster, gid);
    return row >= 0 ? row : n_bodies + gid - roster->n_free;
}

/// Release the contents of a roster.
void bt_roster_free(bt_roster *roster);

/// Collective. The outlines of this rank's block, for bt_record_open; released with bt_gather_free.
/// Errors, the same status on all ranks: BT_ERR_NUMERIC (lost or duplicate bodies).
bt_status bt_gather_bodies(const bt_comm *comm, const bt_world *world, const bt_roster *roster,
                           bt_record_bodies *bodies, bt_errors *err);
void bt_gather_free(bt_record_bodies *bodies);

/// Collective. A frame of this rank's block, with NaN for floes that have split; and on rank 0 the existing pieces of
/// floes [*n_pieces], in the order of their ids. The caller frees *rows and *pieces, which are NULL after an error or
/// if empty. Errors as above.
bt_status bt_gather_frame(const bt_comm *comm, const bt_world *world, const bt_roster *roster, bt_frame_row **rows,
                          bt_piece_row **pieces, int64_t *n_pieces, bt_errors *err);

/// The tow line for that frame, the same on all ranks; zeros without a line.
bt_frame_line bt_gather_line(const bt_world *world);

#endif
