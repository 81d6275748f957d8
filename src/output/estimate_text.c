// SPDX-License-Identifier: MIT
// The estimates of a case as JSON and as a table.
#include "output/estimate_text.h"
#include "base/units.h"

#include <math.h>
#include <stdio.h>

#include "output/summary.h"

/// Concentrations of the curves: 0 to 0.98 in hundredths, with a point just above and just below the two thresholds of
/// Lichey and Hellmer so that the steps stay steps.
enum { N_HUNDREDTHS = 99, N_CURVE = N_HUNDREDTHS + 2 };

static void curve_points(double a[N_CURVE])
{
    int n = 0;
    for (int i = 0; i < N_HUNDREDTHS; i++) {
        if (i == 90) a[n++] = BT_EST_DENSE - 1e-6;
        a[n++] = i / 100.0;
        if (i == 15) a[n++] = BT_EST_LOOSE + 1e-6;
    }
}

static void curves(bt_json *j, const bt_estimate_input *in)
{
    double a[N_CURVE], force[N_CURVE], range[BT_N_ESTIMATES][2];
    curve_points(a);
    bt_json_open(j, "curves", '{');
    bt_json_numbers(j, "concentration", N_CURVE, a);
    for (int k = 0; k < BT_N_ESTIMATES; k++) {
        range[k][0] = range[k][1] = NAN;
        for (int i = 0; i < N_CURVE; i++) {
            bt_estimate_input at = *in;
            at.concentration = a[i];
            const bt_estimate e = bt_estimate_at((bt_estimate_kind)k, &at);
            force[i] = e.force;
            if (!e.valid || a[i] == 0) continue; // without ice all are
            if (isnan(range[k][0])) range[k][0] = a[i];
            range[k][1] = a[i];
        }
        bt_json_numbers(j, bt_estimate_kinds[k].name, N_CURVE, force);
    }
    bt_json_open(j, "valid_range", '{'); // of the concentration
    for (int k = 0; k < BT_N_ESTIMATES; k++) bt_json_numbers(j, bt_estimate_kinds[k].name, 2, range[k]);
    bt_json_close(j, '}');
    bt_json_close(j, '}');
}

/// Simulated / estimate, NaN where there is none.
static double ratio_of(int kind, const bt_estimate *e, double simulated)
{
    return kind == BT_EST_OPEN_WATER || !(e->force > 0) ? NAN : simulated / e->force;
}

void bt_estimates_json(bt_json *j, const char *key, const bt_estimate_input *in, double simulated)
{
    bt_json_open(j, key, '{');
    bt_json_number(j, "concentration", in->concentration);
    bt_json_number(j, "thickness_m", in->thickness);
    bt_json_number(j, "floe_radius_m", in->floe_radius);
    bt_json_number(j, "width_m", in->width);
    bt_json_number(j, "speed_m_s", in->speed);
    bt_json_number(j, "speed_along_m_s", in->along);
    bt_json_number(j, "length_scale", in->length_scale);
    bt_json_number(j, "strength_n_m", bt_estimate_strength(in));
    bt_json_number(j, "capture_strength_n_m", in->p_s);
    for (int k = 0; k < BT_N_ESTIMATES; k++) {
        const bt_estimate e = bt_estimate_at((bt_estimate_kind)k, in);
        bt_json_open(j, bt_estimate_kinds[k].name, '{');
        bt_json_number(j, "force_n", e.force);
        bt_json_number(j, "low_n", e.low);
        bt_json_number(j, "high_n", e.high);
        bt_json_number(j, "simulated_over_estimate", ratio_of(k, &e, simulated));
        bt_json_bool(j, "valid", e.valid);
        bt_json_bool(j, "compares", e.compares);
        bt_json_string(j, "note", e.note);
        bt_json_string(j, "formula", bt_estimate_kinds[k].formula);
        bt_json_string(j, "source", bt_estimate_kinds[k].source);
        bt_json_close(j, '}');
    }
    curves(j, in);
    bt_json_close(j, '}');
}

void bt_estimates_print(const bt_estimate_input *in, double simulated, const char *indent, bool full)
{
    for (int k = 0; k < BT_N_ESTIMATES; k++) {
        const bt_estimate e = bt_estimate_at((bt_estimate_kind)k, in);
        const double ratio = ratio_of(k, &e, simulated);
        char force[32] = "no value", low[32], high[32];
        if (isfinite(e.force)) bt_force_text(force, e.force);
        printf("%s%-22s %-12s", indent, bt_estimate_kinds[k].label, force);
        if (e.compares && isfinite(ratio)) printf(" %-9.3g", ratio);
        else if (!isnan(simulated)) printf(" %-9s", "-");
        printf(" %s%s", e.valid || k == BT_EST_SHIPS ? "" : "not valid: ", e.note);
        if (isfinite(e.force) && e.low != e.high)
            printf("; %s to %s", bt_force_text(low, e.low), bt_force_text(high, e.high));
        printf("\n");
        if (full)
            printf("%s  = %s\n%s  %s\n", indent, bt_estimate_kinds[k].formula, indent, bt_estimate_kinds[k].source);
    }
}
