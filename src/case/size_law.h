// SPDX-License-Identifier: MIT
// Floe size laws: diameter d of the circle of equal area.
//
// single     d ~ Gamma with mean `size` and standard deviation spread × size (d = size if spread = 0).
//            Gamma, not normal, so that no floe has a negative size. A draw below a tenth of the mean is repeated;
//            where that matters, the gamma law is chosen such that the remaining draws have the mean `size`.
// lognormal  ln d ~ N(μ, σ), σ² = ln(1 + spread²), cut at [size_min, size_max] if given; μ is chosen such that the cut
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
    double scale, least; ///< law single: scale of the gamma law, and where it is cut; least 0 if the cut moves nothing
} bt_sizes;

/// The law of a case. Errors: BT_ERR_CASE, with a message, if its keys leave no sizes.
bt_status bt_sizes_init(bt_sizes *sizes, const bt_case *input, bt_errors *err);

double bt_sizes_moment(const bt_sizes *sizes, int k); ///< E[d^k] of the draws, m^k
double bt_sizes_mean(const bt_sizes *sizes);          ///< E[d], m
double bt_sizes_mean_area(const bt_sizes *sizes);     ///< (π/4) E[d²], m²

#endif
