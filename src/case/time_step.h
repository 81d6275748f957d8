// SPDX-License-Identifier: MIT
// The time step against what it has to resolve.
//
// Rule [Yulmetov & Løset 2017]: Δt about the duration of a collision (0.1 s in a basin, at most 5 s at full scale) and
// much smaller than body size / relative speed. "Much smaller" is taken as a tenth here (assumed).
#ifndef BERGTOW_TIME_STEP_H
#define BERGTOW_TIME_STEP_H

#include "bergtow/case.h"
#include "case/track.h"

typedef struct bt_time_step {
    double longest;      ///< longest step that resolves a collision, s
    double speed;        ///< of the contacts: the reference speed, or that of the track if it is more
    double size, passed; ///< of the floes, or of the pieces of a managed lead, m; sizes moved in a step
    bool pieces;
    bool contact, floes; ///< is the step short enough for a collision; for the size of the floes
} bt_time_step;

/// floes, size: their number and mean diameter, m; track: of the body, planned or as run, empty if not known.
bt_time_step bt_time_step_of(const bt_case *input, double floes, double size, const bt_track *track);
void bt_time_step_warn(const bt_case *input, const bt_time_step *step, bt_errors *warnings);

#endif
