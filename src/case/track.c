// SPDX-License-Identifier: MIT
// Speed, wake and end of a track; the rules are in case/track.h.
#include "case/track.h"
#include "case/warning.h"

#include "base/elementary.h"
#include "case/case_derived.h"
#include "bergtow/shape.h"

#define MAX_POINTS 20000.0 // of a track that is searched for its wake: each is compared with all before it

static double between(const bt_track *track, int64_t i, int64_t j)
{
    return bt_hypot(track->x[j] - track->x[i], track->y[j] - track->y[i]);
}

double bt_track_speed(const bt_track *track)
{
    double most = 0;
    for (int64_t i = 1; i < track->n; i++) {
        const double speed = between(track, i - 1, i) / (track->time[i] - track->time[i - 1]);
        if (speed > most) most = speed; // not where it is not known
    }
    return most;
}

/// The largest way along x in the direction of the tow, and how far the track falls back from it.
static double farthest(const bt_case *input, const bt_track *track, double *fall)
{
    const double sign = bt_case_tow_sign(input);
    double most = 0;
    *fall = 0;
    for (int64_t i = 0; i < track->n; i++) {
        const double way = sign * (track->x[i] - track->x[0]);
        most = bt_max(most, way);
        *fall = bt_max(*fall, most - way);
    }
    return most;
}

double bt_track_laps(const bt_case *input, const bt_track *track)
{
    double fall;
    return farthest(input, track, &fall) / input->domain.length;
}

double bt_track_fall(const bt_case *input, const bt_track *track)
{
    double fall;
    farthest(input, track, &fall);
    return fall;
}

/// d less whole periods, as near to 0 as possible.
static double nearest(double d, double period) { return period > 0 ? d - period * nearbyint(d / period) : d; }

/// First point that lies less than `size` from an earlier one, a period on; track->n if none. Points at least size/8
/// apart are compared with earlier ones at least size/2 apart (more on a very long track).
static int64_t first_in_wake(const bt_track *track, const double period[2], double size)
{
    if (!(period[0] > 0 || period[1] > 0)) return track->n;
    double way = 0;
    for (int64_t i = 1; i < track->n; i++) way += isnan(track->x[i - 1]) ? 0 : between(track, i - 1, i);
    const double apart = bt_max(0.5 * size, way / MAX_POINTS);
    int64_t *kept = bt_alloc((size_t)(way / apart) + 2, sizeof *kept), n = 0, last = 0, found = track->n;
    for (int64_t i = 0; i < track->n && found == track->n; i++) {
        if (isnan(track->x[i]) || (n > 0 && between(track, last, i) < 0.25 * apart)) continue;
        last = i;
        for (int64_t k = 0; k < n && found == track->n; k++) {
            const double dx = track->x[i] - track->x[kept[k]], dy = track->y[i] - track->y[kept[k]],
                         x = nearest(dx, period[0]), y = nearest(dy, period[1]);
            if ((x != dx || y != dy) && bt_hypot(x, y) < size) found = i;
        }
        if (n == 0 || between(track, kept[n - 1], i) >= apart) kept[n++] = i;
    }
    free(kept);
    return found;
}

/// The last point in the ice before the body leaves it for good; track->n if the body ends in the ice, or was never in
/// it. If ice that does not fill a period is repeated with it: the last point before the first gap, and *gap is set,
/// which is false on entry.
static int64_t last_in_ice(const bt_case *input, const bt_track *track, double size, bool *gap)
{
    const bt_bound kind[2] = {input->domain.ends, input->domain.sides};
    const double first[2] = {input->domain.x0, input->domain.y0},
                 extent[2] = {input->domain.length, input->domain.width};
    double low[2], high[2], period[2] = {0};
    bt_case_ice_region(input, low, high);
    for (int k = 0; k < 2 && track->region; k++) low[k] = track->region[k], high[k] = track->region[2 + k];
    for (int k = 0; k < 2; k++) {
        // a region that reaches a wall has no end there: the wall holds drifting ice, and the body
        const bool wall = kind[k] == BT_BOUND_WALL, wraps = bt_bound_wraps(kind[k]);
        const bool filled = wraps && high[k] - low[k] > extent[k] - size;
        if (filled || (wall && low[k] < first[k] + size)) low[k] = -INFINITY;
        if (filled || (wall && high[k] > first[k] + extent[k] - size)) high[k] = INFINITY;
        if (wraps && !filled) period[k] = extent[k];
    }
    int64_t last = track->n;
    for (int64_t i = 0; i < track->n; i++) {
        const double at[2] = {track->x[i], track->y[i]};
        bool in = true;
        for (int k = 0; k < 2; k++) {
            const double past = at[k] - low[k];
            const bool within = period[k] > 0 ? past - period[k] * floor(past / period[k]) <= high[k] - low[k]
                                              : past >= 0 && at[k] <= high[k];
            in = in && within;
            *gap = *gap || (!within && period[k] > 0 && last < track->n);
        }
        if (*gap) return last;
        if (in) last = i;
    }
    return last + 1 < track->n ? last : track->n;
}

void bt_track_warn(const bt_case *input, const bt_track *track, bt_errors *warnings)
{
    double v[2 * BT_MAX_VERTICES];
    const int corners = bt_case_waterline(input, v);
    if (track->n < 2 || corners == 0 || (!(input->ice.concentration > 0) && !bt_case_reads_field(input))) return;
    const double size = sqrt(4 / BT_PI * bt_shape_moments(corners, v).area);
    const double period[2] = {input->domain.ends == BT_BOUND_PERIODIC ? input->domain.length : 0,
                              input->domain.sides == BT_BOUND_PERIODIC ? input->domain.width : 0};
    bool gap = false;
    const int64_t wake = first_in_wake(track, period, size), last = last_in_ice(input, track, size, &gap);
    if (wake < track->n)
        bt_warn(warnings, BT_WARN_OWN_WAKE,
                      "from %.4g s on the body meets ice that it has already opened, one period of the domain earlier: "
                      "use a larger domain, set domain.ends: moving, or end the run earlier",
                      track->time[wake]);
    if (last < track->n)
        bt_warn(warnings, BT_WARN_LEAVES_ICE,
                      "the body leaves the ice at %.4g s, and %s: %s, or end the run earlier", track->time[last],
                      gap ? "enters open water, because the ice does not fill the domain"
                          : "is in open water from then on",
                      bt_case_reads_field(input) ? "use a map that reaches farther"
                      : gap ? "leave ice.x_min, ice.x_max, ice.y_min and ice.y_max out"
                            : "use a longer domain, set domain.ends: moving");
}
