// SPDX-License-Identifier: MIT
// Bodies from the ranks that hold them to the ranks that record them.
#ifndef BT_GATHER_H
#define BT_GATHER_H

#include "output/frame.h"
#include "output/roster.h"
#include "bergtow/world.h"

/// Collective. The outlines of this rank's block, for bt_record_open; released with bt_gather_free.
/// Errors, the same status on all ranks: BT_ERR_NUMERIC (bodies are lost or doubled).
bt_status bt_gather_bodies(const bt_comm *c, const bt_world *w, const bt_roster *roster, bt_record_bodies *b,
                             bt_errors *err);
void bt_gather_free(bt_record_bodies *b);

/// Collective. A frame of this rank's block, with NaN for floes that have split; and on rank 0 the pieces of floes
/// [*n_pieces] that are there, in the order of their ids. *rows and *pieces are to be freed, NULL after an error or
/// without any. Errors as above.
bt_status bt_gather_frame(const bt_comm *c, const bt_world *w, const bt_roster *roster, bt_frame_row **rows,
                          bt_piece_row **pieces, int64_t *n_pieces, bt_errors *err);

/// The tow line beside it, the same on all ranks; zeros without one.
bt_frame_line bt_gather_line(const bt_world *w);

#endif
