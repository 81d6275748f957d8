// SPDX-License-Identifier: MIT
// The margin of the contact search; see margin.h.
#include "space/margin.h"

#include <math.h>

#include "base/elementary.h"

double bt_margin_most(const bt_world *w) { return 16 * w->par.size; }

double bt_margin_for(const bt_world *w, double s)
{
    const double least = 2 * w->par.dt * s;
    if (!(least < bt_margin_most(w)) && w->par.size > 0) return bt_margin_most(w);
    if (!(least > w->par.slop)) return w->par.slop;
    const int k = bt_ceil_2log2(least); // 2^(k/2)
    return ldexp(k & 1 ? 0.70710678118654752440 : 1, (k + (k & 1)) / 2);
}
