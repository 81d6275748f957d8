// SPDX-License-Identifier: MIT
// The margin of the contact search; see margin.h.
#include "space/margin.h"

#include <math.h>

double bt_margin_most(const bt_world *w) { return 16 * w->par.size; }

double bt_margin_for(const bt_world *w, double s)
{
    const double least = 2 * w->par.dt * s;
    if (!(least < bt_margin_most(w)) && w->par.size > 0) return bt_margin_most(w);
    if (!(least > w->par.slop)) return w->par.slop;
    return exp2(0.5 * ceil(2 * log2(least)));
}
