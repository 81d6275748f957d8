// SPDX-License-Identifier: MIT
// A short list of single events of a run, the same on all ranks.
//
// For rare occurrences (a line breaks, a way-point is passed), not for every step. The list only grows; it is part of
// the output, not of the state: the effects of an event are stored elsewhere.
#ifndef BERGTOW_EVENT_H
#define BERGTOW_EVENT_H

#include "bergtow/base.h"

BT_BEGIN_C

/// Append only, never renumber: result.h5 contains the numbers.
typedef enum {
    BT_EVENT_LINE_BROKEN, ///< subject: branch from 1; value: tension, N
    BT_EVENT_ADRIFT,      ///< the last branch broke: the body drifts; subject: 0; value: speed of the body, m/s
    BT_EVENT_WAYPOINT,    ///< subject: way-point from 1; value: length of the path up to there, m
    BT_EVENT_KINDS
} bt_event_kind;

typedef struct bt_event {
    double time;          ///< end of the step, s
    int64_t kind;         ///< bt_event_kind
    int64_t subject;      ///< see the kind
    double value;         ///< see the kind
} bt_event;

typedef struct bt_events {
    bt_event *event;      ///< [n]
    int64_t n, cap;
} bt_events;

/// Append an event: the end of its step, s, its kind, and subject and value as defined by the kind.
void bt_events_add(bt_events *events, double time, bt_event_kind kind, int64_t subject, double value);
/// Release the events; the list is then empty.
void bt_events_free(bt_events *events);

/// "line_broken", ...: BT_EVENT_KINDS names.
extern const char *const bt_event_names[];

/// One event as a sentence without its time: "branch 1 of the tow line broke at 2.04e+05 N".
void bt_event_describe(const bt_event *event, char out[160]);

BT_END_C

#endif
