// SPDX-License-Identifier: MIT
// What a run costs, before it is made.
#include "cost.h"

#include <math.h>

#include "case_check.h"

double bt_cost_floe_step(double concentration)
{
    const double x = bt_min(0.95, bt_max(0, concentration));
    return x < 0.5 ? 0.5e-6 * pow(4, (x - 0.2) / 0.3) : 2e-6 * pow(7.5, (x - 0.5) / 0.3);
}

double bt_cost_seconds(const bt_case *c)
{
    const double floes = bt_case_expected_floes(c) + c->n_floes + 1;
    return floes * (double)bt_case_steps(c) * bt_cost_floe_step(c->ice.concentration);
}
