// SPDX-License-Identifier: MIT
// Floe size laws: diameter d of the circle of equal area.
//
// single     d ~ Gamma with mean `size` and standard deviation spread × size (d = size when spread = 0). A gamma rather
//            than a normal law, so that no floe has a negative size; below a tenth of the mean it is drawn again, and
//            where that matters the law is the one whose rest has the mean `size`.
// lognormal  ln d ~ N(μ, σ), σ² = ln(1 + spread²), cut at [size_min, size_max] when given; μ is found so that the cut
//            law has the mean `size`.
// power      N(>d) ~ d^−a between size_min and size_max (Rothrock & Thorndike 1984, J. Geophys. Res. 89):
//            P(>d) = (d^−a − M^−a)/(m^−a − M^−a); its mean follows from m, M and a, and `size` is not used.
#ifndef BERGTOW_SIZE_LAW_H
#define BERGTOW_SIZE_LAW_H

#include "bergtow/case.h"

#define BT_SINGLE_LEAST 0.1 ///< law single: least diameter / mean

/// A size law with its derived constants, m.
typedef struct bt_sizes {
    bt_size_law law;
    double mean, spread, min, max, exponent;
    double mu, sigma;    ///< of ln d, law lognormal
    double scale, least; ///< of the gamma law of law single, and where it is cut; least 0 where that moves nothing
} bt_sizes;

/// The law of a case; BT_ERR_CASE, with a message, where its keys leave no sizes.
bt_status bt_sizes_init(bt_sizes *sizes, const bt_case *input, bt_errors *err);

double bt_sizes_moment(const bt_sizes *sizes, int k); ///< E[d^k] of what is drawn, m^k
double bt_sizes_mean(const bt_sizes *sizes);          ///< E[d], m
double bt_sizes_mean_area(const bt_sizes *sizes);     ///< (π/4) E[d²], m²

#endif
