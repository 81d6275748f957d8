// SPDX-License-Identifier: MIT
// The elastic catenary of a tow line: a uniform line that hangs in the water between two ends of the same height.
//
// L unstretched length m, EA stiffness N, w weight in water N/m, H horizontal tension (the pull on the body) N, l span
// (distance of the ends) m; u = w L / 2H is the slope at the ends. From the equilibrium of an element and Hooke's law:
//     l   = L asinh(u)/u + H L/EA
//     sag = (L/2u) (√(1+u²) − 1) + w L²/8EA,   tension at the ends T = √(H² + (w L/2)²)
//     dl/dH = (L/H) (asinh(u)/u − 1/√(1+u²)) + L/EA      the two compliances, of the sag and of the stretch, in series
// H grows with l from 0 at l = 0 without limit: there is no slack. As w tends to 0 it tends to EA max(0, l/L − 1).
#ifndef BERGTOW_CATENARY_H
#define BERGTOW_CATENARY_H

#include "bergtow/base.h"

BT_BEGIN_C

/// Span at a pull > 0, m. length and stiffness EA > 0, weight > 0.
double bt_catenary_span(double length, double stiffness, double weight, double pull);

/// Pull, N, at a span ≥ 0, m, and, if `tangent` is not NULL, its derivative dH/dl there, N/m, which is 0 at span 0. The
/// same bits on every machine.
double bt_catenary_pull(double length, double stiffness, double weight, double span, double *tangent);

BT_END_C

#endif
