// SPDX-License-Identifier: MIT
// The list of events; see bergtow/event.h.
#include "bergtow/event.h"

#include "base/inside.h"

#include <inttypes.h>

const char *const bt_event_names[BT_EVENT_KINDS] = {
    [BT_EVENT_LINE_BROKEN] = "line_broken",
    [BT_EVENT_ADRIFT] = "adrift",
    [BT_EVENT_WAYPOINT] = "waypoint",
};

void bt_events_add(bt_events *events, double time, bt_event_kind kind, int64_t subject, double value)
{
    BT_MAKE_ROOM(events->event, events->n, events->cap, 16);
    events->event[events->n++] = (bt_event){time, kind, subject, value};
}

void bt_events_free(bt_events *events)
{
    free(events->event);
    *events = (bt_events){0};
}

void bt_event_describe(const bt_event *event, char out[160])
{
    BT_PLAIN_NUMBERS;
    switch (event->kind) {
    case BT_EVENT_LINE_BROKEN:
        snprintf(out, 160, "branch %" PRId64 " of the tow line broke under %.4g N", event->subject, event->value);
        break;
    case BT_EVENT_ADRIFT:
        snprintf(out, 160, "no branch of the tow line is left: the body drifts, at first at %.3g m/s", event->value);
        break;
    case BT_EVENT_WAYPOINT:
        snprintf(out, 160, "way-point %" PRId64 " passed after %.5g m", event->subject, event->value);
        break;
    default:
        snprintf(out, 160, "event of kind %" PRId64 ", subject %" PRId64 ", value %.6g", event->kind, event->subject,
                 event->value);
    }
}
