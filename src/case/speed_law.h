// SPDX-License-Identifier: MIT
// The speed of the tow in time: a linear ramp to a constant speed, or a programme of points that is linear between.
//
//     ramp        v(t) = v min(1, t/T);   s(t) = v t²/2T up to T, then v (t − T/2);   t(s) = √(2 T s/v), then s/v + T/2
//     programme   linear between its points, constant outside, in place of that; t(s) by bisection of s(t)
#ifndef BERGTOW_SPEED_LAW_H
#define BERGTOW_SPEED_LAW_H

#include <stdint.h>

/// Views into a case or a tow.
typedef struct bt_speed_law {
    double speed, ramp;       ///< v m/s; T s
    const double *programme;  ///< [n][2] s, m/s
    int n;                    ///< points of the programme, 0 = ramp and speed
} bt_speed_law;

/// m/s at time t; where there is no ramp, the speed itself from the start on.
double bt_speed_law_at(const bt_speed_law *law, double t);

/// Way after time t ≥ 0, m.
double bt_speed_law_way(const bt_speed_law *law, double t);

/// Time after which the way is s, s; latest: a time by which it is.
double bt_speed_law_time(const bt_speed_law *law, double way, double latest);

/// Way after n steps of dt, each at the speed of its end: Σ Δt v(kΔt), m. On a rise that is v Δt/2 more than s(t).
double bt_speed_law_led(const bt_speed_law *law, int64_t n, double dt);

#endif
