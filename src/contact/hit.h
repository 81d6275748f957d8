// SPDX-License-Identifier: MIT
// Bound of a contact point that comes in under its own momentum: the energy lost in a step is the work of crushing.
//
// In velocities: u the approach at the end of the step, s = u − place the part of it that penetrates the ice (to the
// depth Δt s), v1 the approach at its start, P the impulse of the external forces along the row. Energy lost in the
// step, with the work of the loads on the way Δt u, is the work of the ice E:
//     ½ λ (v1 + u) − P ½ (v1 + u) + P u = E(s)   or   L(u) = P + 2 (E(s) − P u)/(v1 + u)
//     E(s) = touch s + ½ ramp s²,  s <= kink;   work + force s + ½ slope s²  beyond
// With λ = (free − u)/W, where `free` is u without this impulse, this gives a quadratic equation.
#ifndef BERGTOW_HIT_H
#define BERGTOW_HIT_H

#include <math.h>

typedef struct bt_hit {
    double before; ///< v1, m/s; 0 = no hit
    double load;   ///< P, N s
    double touch, ramp, kink;  ///< N s, kg, m/s
    double force, slope, work; ///< N s, kg, J
} bt_hit;

/// E(s), J.
static inline double bt_hit_work(const bt_hit *hit, double s)
{
    return s <= hit->kink ? s * (hit->touch + 0.5 * hit->ramp * s)
                          : hit->work + s * (hit->force + 0.5 * hit->slope * s);
}

/// L at u = place + s, N s.
static inline double bt_hit_bound(const bt_hit *hit, double place, double s)
{
    return hit->load + 2 * (bt_hit_work(hit, s) - hit->load * (place + s)) / (hit->before + place + s);
}

/// The larger root of a s² + b s = k, 0 where there is none above 0.
static inline double bt_hit_root(double a, double b, double k)
{
    if (!(k > 0)) return 0;
    const double root = sqrt(b * b + 4 * a * k);
    return b > 0 ? 2 * k / (b + root) : (root - b) / (2 * a);
}

/// s at which L and (free − u)/w meet, m/s; 0 where the point does not come in.
static inline double bt_hit_end(const bt_hit *hit, double place, double free, double w)
{
    const double sum = hit->before + place, to = (free - place) / w - hit->load;
    const double b = sum / w - to - 2 * hit->load, k = to * sum + 2 * hit->load * place;
    const double held = bt_hit_root(1 / w + hit->ramp, b + 2 * hit->touch, k);
    if (held <= hit->kink) return held;
    return bt_hit_root(1 / w + hit->slope, b + 2 * hit->force, k - 2 * hit->work);
}

#endif
