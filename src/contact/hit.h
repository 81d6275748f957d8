// SPDX-License-Identifier: MIT
// What a contact point bears that comes in with a speed of its own: crushing takes in a step what the ice has cost.
//
// In velocities: u the approach at the end of the step, s = u − place what of it goes into the ice (to the depth Δt s),
// v1 the approach at its start, P the impulse of the external forces along the row. Energy lost in the step, with the
// work of the loads on the way Δt u, is the work of the ice E:
//     ½ λ (v1 + u) − P ½ (v1 + u) + P u = E(s)   or   L(u) = P + 2 (E(s) − P u)/(v1 + u)
//     E(s) = touch s + ½ ramp s²,  s <= kink;   work + force s + ½ slope s²  beyond
// It meets λ = (free − u)/W, u without this impulse being `free`, in a quadratic equation.
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
static inline double bt_hit_work(const bt_hit *h, double s)
{
    return s <= h->kink ? s * (h->touch + 0.5 * h->ramp * s) : h->work + s * (h->force + 0.5 * h->slope * s);
}

/// L at u = place + s, N s.
static inline double bt_hit_bound(const bt_hit *h, double place, double s)
{
    return h->load + 2 * (bt_hit_work(h, s) - h->load * (place + s)) / (h->before + place + s);
}

/// The larger root of a s² + b s = k, 0 where there is none above 0.
static inline double bt_hit_root(double a, double b, double k)
{
    if (!(k > 0)) return 0;
    const double root = sqrt(b * b + 4 * a * k);
    return b > 0 ? 2 * k / (b + root) : (root - b) / (2 * a);
}

/// s at which L and (free − u)/w meet, m/s; 0 where the point does not come in.
static inline double bt_hit_end(const bt_hit *h, double place, double free, double w)
{
    const double sum = h->before + place, to = (free - place) / w - h->load;
    const double b = sum / w - to - 2 * h->load, k = to * sum + 2 * h->load * place;
    const double held = bt_hit_root(1 / w + h->ramp, b + 2 * h->touch, k);
    if (held <= h->kink) return held;
    return bt_hit_root(1 / w + h->slope, b + 2 * h->force, k - 2 * h->work);
}

#endif
