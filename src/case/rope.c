// SPDX-License-Identifier: MIT
// The table of tow lines; see case/rope.h.
#include "case/rope.h"

#include "bergtow/catenary.h"
#include "base/elementary.h"
#include "base/inside.h"

// --- a line with weight ----------------------------------------------------------------------------------------------

enum { MAX_STEPS = 200 }; // of Newton's method, which takes fewer than 40

double bt_catenary_span(double length, double stiffness, double weight, double pull)
{
    BT_PLAIN_NUMBERS;
    const double u = 0.5 * weight * length / pull;
    return length * (bt_asinh(u) / u + pull / stiffness);
}

/// asinh(u)/u − 1/√(1+u²), which for small u is u²/3 − 3u⁴/10 + 15u⁶/56.
static double slackness(double u)
{
    const double u2 = u * u;
    if (u < 0.01) return u2 * (1.0 / 3 - u2 * (3.0 / 10 - u2 * (15.0 / 56)));
    return bt_asinh(u) / u - 1 / sqrt(1 + u2);
}

// With the slope u as the unknown, the span's equation times u is g(u) = asinh(u) + e − (l/L) u = 0, e = w L/2EA. g is
// concave, with g(0) = e > 0 and −∞ at infinity, so that it has one root, and Newton's method from any point to its
// right descends to it without overshooting, for every line and span. To find such a point: asinh(u) ≤ √2 u/√(1+u),
// since the derivative of asinh is at most √2/(1+u) and log(1+u) ≤ u/√(1+u); so g ≤ 0 if √(1+u) ≥ 2√2 L/l and u ≥ 2e
// L/l. If l > L, asinh(u) ≤ u also gives u ≤ e/(l/L − 1). The iteration ends when rounding stops the descent.
double bt_catenary_pull(double length, double stiffness, double weight, double span, double *tangent)
{
    BT_PLAIN_NUMBERS;
    if (tangent) *tangent = 0;
    if (!(span > 0)) return 0;
    const double half = 0.5 * weight * length, e = half / stiffness, s = span / length;
    double u = fmax(8 / (s * s), 2 * e / s);
    if (s > 1) u = fmin(u, e / (s - 1));
    for (int k = 0; k < MAX_STEPS; k++) {
        const double next = u - (bt_asinh(u) + e - s * u) / (1 / sqrt(1 + u * u) - s);
        if (!(next < u && next > 0)) break;
        u = next;
    }
    const double pull = half / u;
    if (tangent) *tangent = 1 / (length * (slackness(u) / pull + 1 / stiffness));
    return pull;
}

// --- ropes by name ---------------------------------------------------------------------------------------------------

static const struct {
    const char *name, *source;
    double mass_d2, breaking_d2, breaking_d3; // kg/m³, N/m², N/m³
    double ea_d2, ea_per_breaking;            // N/m², 1
} ropes[] = {
    [BT_ROPE_NUMBERS] = {"by its numbers", "case", 0, 0, 0, 0, 0},
    [BT_ROPE_STEEL] = {"steel wire, 6x19 with wire core", "Orcina, OrcaFlex manual, Rope/Wire", 3989.7, 633358e3, 0,
                       4.04e10, 0},
    [BT_ROPE_POLYPROPYLENE] = {"polypropylene, 8-strand", "Orcina, OrcaFlex manual, Rope/Wire", 452.6, 105990e3, 0,
                               1.06e9, 0},
    [BT_ROPE_DYNEEMA] = {"Dyneema (HMPE)", "MoorPy property library, NREL", 496, 580e6, 651e6, 0, 56},
};

bt_rope bt_rope_named(bt_rope_type type, double d)
{
    const double breaking = (ropes[type].breaking_d2 + ropes[type].breaking_d3 * d) * d * d;
    return (bt_rope){.name = ropes[type].name,
                     .source = ropes[type].source,
                     .mass = ropes[type].mass_d2 * d * d,
                     .stiffness = ropes[type].ea_d2 * d * d + ropes[type].ea_per_breaking * breaking,
                     .breaking = breaking};
}
