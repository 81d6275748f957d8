// SPDX-License-Identifier: MIT
// Speed of the tow over time: a linear ramp to a constant speed, or a programme of points, linear in between.
//
//     ramp        v(t) = v min(1, t/T);   s(t) = v t²/2T up to T, then v (t − T/2);   t(s) = √(2 T s/v), then s/v + T/2
//     programme   instead: linear between its points, constant outside; t(s) by bisection of s(t)
#ifndef BERGTOW_SPEED_LAW_H
#define BERGTOW_SPEED_LAW_H

#include <stdint.h>

/// Views into a case or a tow.
typedef struct bt_speed_law {
    double speed, ramp;       ///< v m/s; T s
    const double *programme;  ///< [n][2] s, m/s
    int n;                    ///< points of the programme, 0 = ramp and speed
} bt_speed_law;

/// Speed at time t, m/s; without a ramp, the full speed from the start on.
double bt_speed_law_at(const bt_speed_law *law, double t);

/// Way after time t ≥ 0, m.
double bt_speed_law_way(const bt_speed_law *law, double t);

/// Time after which the tow has covered `way`, s; latest: a time at which it certainly has.
double bt_speed_law_time(const bt_speed_law *law, double way, double latest);

/// Way after n steps of dt, each at the speed of its end: Σ Δt v(kΔt), m. After a rise to v it is s(t) + v Δt/2.
double bt_speed_law_led(const bt_speed_law *law, int64_t n, double dt);

#endif
