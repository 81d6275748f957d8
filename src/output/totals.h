// SPDX-License-Identifier: MIT
// Numbers of a whole run that are not in the series.
#ifndef BT_TOTALS_H
#define BT_TOTALS_H

#include "bergtow/event.h"
#include "bergtow/field.h"
#include "bergtow/world.h"
#include "field/lead.h"
#include "output/stall.h"
#include "partition/domain.h"

/// Parts of the wall time of a call: X(name, of what).
#define BT_CALL_PARTS(X)                                                                                               \
    X(program, "the start of the program, its libraries, and the case or checkpoint read")                             \
    X(ice, "making or reading the ice, the lead in it, and its distribution to all ranks")                             \
    X(world, "bodies, velocities at the start, the check that nothing overlaps, the first cells")                      \
    X(record, "the folder and the result file, with the bodies in it")                                                 \
    X(steps, "the steps, with frames and checkpoints: phases_s has them all")                                          \
    X(end, "the final check of the state, the summary, and closing the files")

/// Wall time of the call by parts, s.
typedef struct bt_call {
#define BT_MEMBER_OF_CALL(name, text) double name;
    BT_CALL_PARTS(BT_MEMBER_OF_CALL)
#undef BT_MEMBER_OF_CALL
} bt_call;

/// Numbers at the end of the run that are not in the series.
typedef struct bt_run_totals {
    int64_t n_steps, whole_steps; ///< done, and of the whole duration
    int ranks, threads;
    double dt, wall_time;
    double mean_size;            ///< mean equivalent diameter of the floes, m
    bt_field_sizes sizes;        ///< of the field, without floes given by hand
    /// weighted with area, of the field: for the estimates, m; 0 = as the case asks for
    double mean_thickness, mean_radius;
    double concentration;        ///< as made
    bt_lead_stats lead;          ///< the lead cut into it
    double ice_area;             ///< of all floes in the run, m²
    double tolerance;            ///< absolute, m/s
    int64_t floes_outside;       ///< left an open domain
    bt_stall stall;              ///< of the towed body
    bt_outline_counts outlines;  ///< of a field that was read
    uint64_t state_hash;
    const struct bt_window *window; ///< at the end of the run, NULL if the domain is fixed
    const struct bt_undisturbed *undisturbed; ///< ice, at the end of the run; NULL without a towed body
    const struct bt_splitting *splitting; ///< at the end of the run, NULL if floes do not split
    bt_phases phases, shared; ///< shared: the part in passes shared by several threads
    bt_call call;                ///< `end` is that of the summary's own time
    double stepped;              ///< bt_clock after the last step of this call
    bt_domain_stats division;    ///< its costs, of all ranks; 0 for one
    double memory;               ///< peak resident memory of all ranks, B
    /// bytes read by a sweep per contact point of the last step: batches and velocities, B; NaN without contacts
    double sweep_bytes_per_contact;
    const bt_events *events;     ///< events, or NULL
    const char *stopped;         ///< reason of an early end, or NULL
} bt_run_totals;

#endif
