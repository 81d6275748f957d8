// SPDX-License-Identifier: MIT
// The estimates of a case as JSON and as a table.
#include "output/estimate_text.h"
#include "base/units.h"

#include <math.h>

/// Concentrations of the curves: 0 to 0.98 in hundredths, with a point just above and just below the two thresholds of
/// Lichey and Hellmer, so that the steps remain sharp.
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

static void curves(bt_json *json, const bt_estimate_input *in)
{
    double a[N_CURVE], force[N_CURVE], range[BT_MAX_ESTIMATES][2];
    curve_points(a);
    bt_json_open(json, "curves", '{');
    bt_json_numbers(json, "concentration", N_CURVE, a);
    for (int k = 0; k < bt_n_estimates(); k++) {
        range[k][0] = range[k][1] = NAN;
        for (int i = 0; i < N_CURVE; i++) {
            bt_estimate_input at = *in;
            at.concentration = a[i];
            const bt_estimate estimate = bt_estimate_at(k, &at);
            force[i] = estimate.force;
            if (!estimate.valid || a[i] == 0) continue; // without ice all are valid
            if (isnan(range[k][0])) range[k][0] = a[i];
            range[k][1] = a[i];
        }
        bt_json_numbers(json, bt_estimate_of(k)->name, N_CURVE, force);
    }
    bt_json_open(json, "valid_range", '{'); // of the concentration
    for (int k = 0; k < bt_n_estimates(); k++) bt_json_numbers(json, bt_estimate_of(k)->name, 2, range[k]);
    bt_json_close(json, '}');
    bt_json_close(json, '}');
}

/// One estimate and the conditions, for the tables of keys.
typedef struct estimate_item {
    bt_estimate e;
    double ratio;
    const char *formula, *source;
} estimate_item;

typedef struct conditions_item {
    bt_estimate_input in;
    double strength;
} conditions_item;

#define OF_ESTIMATE(...) {BT_JSON_AT(0, estimate_item, __VA_ARGS__)}
const bt_json_key bt_estimate_keys[] = {
    OF_ESTIMATE("force_n", e.force, "N", "force against the tow; null where the formula has no value"),
    OF_ESTIMATE("low_n", e.low, "N", "lower end of the range of the force"),
    OF_ESTIMATE("high_n", e.high, "N", "upper end of the range of the force"),
    OF_ESTIMATE("simulated_over_estimate", ratio, "1",
                "mean ice resistance of the run / force; meaningful only if `compares` is true"),
    OF_ESTIMATE("valid", e.valid, "1", "the formula is meant for these conditions"),
    OF_ESTIMATE("compares", e.compares, "1",
                "a run is compared with it: it is valid, depends on the concentration, and does not depend on a speed "
                "that changes in the window"),
    OF_ESTIMATE("note", e.note, "", "regime, or why it is not valid"),
    OF_ESTIMATE("formula", formula, "", "the formula"),
    OF_ESTIMATE("source", source, "", "source of the formula"),
};
const int bt_n_estimate_keys = sizeof bt_estimate_keys / sizeof *bt_estimate_keys;

#define OF_CONDITIONS(...) {BT_JSON_AT(0, conditions_item, __VA_ARGS__)}
const bt_json_key bt_condition_keys[] = {
    OF_CONDITIONS("concentration", in.concentration, "1", "ice concentration"),
    OF_CONDITIONS("thickness_m", in.thickness, "m", "mean thickness of the ice, weighted with area"),
    OF_CONDITIONS("floe_radius_m", in.floe_radius, "m", "mean radius of the floes, weighted with area"),
    OF_CONDITIONS("width_m", in.width, "m",
                  "width of the body across its mean course in the window; before a run, across the first leg of the "
                  "tow"),
    OF_CONDITIONS("speed_m_s", in.speed, "m/s",
                  "speed of the body through undisturbed ice: mean over the window; before a run, as ordered"),
    OF_CONDITIONS("speed_along_m_s", in.along, "m/s", "component of speed_m_s along the tow"),
    OF_CONDITIONS("ordered_speed_m_s", in.ordered, "m/s",
                  "speed along the tow as the case orders it: mean over the window; before a run, the largest"),
    OF_CONDITIONS("water_speed_m_s", in.water_speed, "m/s",
        "speed of the body through the water: mean over the window; before a run, as ordered"),
    OF_CONDITIONS("length_scale", in.length_scale, "1",
        "full scale / scale of the case: P* is divided by it, and P_s by its square"),
    OF_CONDITIONS("strength_n_m", strength, "N/m", "strength of the ice P"),
    OF_CONDITIONS("capture_strength_n_m", in.p_s, "N/m", "strength P_s from which the ice captures the body"),
};
const int bt_n_condition_keys = sizeof bt_condition_keys / sizeof *bt_condition_keys;

/// Simulated / estimate, NaN if there is none.
static double ratio_of(const bt_estimate_def *def, const bt_estimate *estimate, double simulated)
{
    return def->on_top || !(estimate->force > 0) ? NAN : simulated / estimate->force;
}

void bt_estimates_json(bt_json *json, const char *key, const bt_estimate_input *in, double simulated)
{
    const conditions_item conditions = {*in, bt_estimate_strength(in)};
    bt_json_open(json, key, '{');
    bt_json_keys_write(json, bt_condition_keys, bt_n_condition_keys, NULL, (const void *const[]){&conditions});
    for (int k = 0; k < bt_n_estimates(); k++) {
        const bt_estimate_def *def = bt_estimate_of(k);
        const bt_estimate estimate = bt_estimate_at(k, in);
        const estimate_item item = {estimate, ratio_of(def, &estimate, simulated), def->formula, def->source};
        bt_json_open(json, def->name, '{');
        bt_json_keys_write(json, bt_estimate_keys, bt_n_estimate_keys, NULL, (const void *const[]){&item});
        bt_json_close(json, '}');
    }
    curves(json, in);
    bt_json_close(json, '}');
}

/// Does the formula depend on floe size? Found by evaluating it in thin ice, where all formulas are valid.
static bool uses_floe_size(int k, const bt_estimate_input *in)
{
    bt_estimate_input small = *in, large = *in;
    small.concentration = large.concentration = 0.2;
    large.floe_radius = 2 * in->floe_radius + 1;
    const double a = bt_estimate_at(k, &small).force, b = bt_estimate_at(k, &large).force;
    return isfinite(a) && isfinite(b) && a != b;
}

void bt_estimate_labels_json(bt_json *json, const char *key, const bt_estimate_input *in)
{
    bt_json_open(json, key, '{');
    for (int k = 0; k < bt_n_estimates(); k++) {
        const bt_estimate_def *def = bt_estimate_of(k);
        bt_json_open(json, def->name, '{');
        bt_json_string(json, "label", def->label);
        bt_json_string(json, "kind", bt_estimate_kind_name(def));
        bt_json_bool(json, "uses_floe_size", uses_floe_size(k, in));
        bt_json_close(json, '}');
    }
    bt_json_close(json, '}');
}

void bt_estimates_print(const bt_estimate_input *in, double simulated, const char *indent, bool full)
{
    for (int k = 0; k < bt_n_estimates(); k++) {
        const bt_estimate estimate = bt_estimate_at(k, in);
        const double ratio = ratio_of(bt_estimate_of(k), &estimate, simulated);
        char force[32] = "no value", low[32], high[32];
        if (isfinite(estimate.force)) bt_force_text(force, estimate.force);
        printf("%s%-22s %-12s", indent, bt_estimate_of(k)->label, force);
        if (estimate.compares && isfinite(ratio)) printf(" %-9.3g", ratio);
        else if (!isnan(simulated)) printf(" %-9s", "-");
        printf(" %s%s", estimate.valid || bt_estimate_of(k)->note_tells ? "" : "not valid: ", estimate.note);
        if (isfinite(estimate.force) && estimate.low != estimate.high)
            printf("; %s to %s", bt_force_text(low, estimate.low), bt_force_text(high, estimate.high));
        printf("\n");
        if (full) printf("%s  = %s\n%s  %s\n", indent, bt_estimate_of(k)->formula, indent, bt_estimate_of(k)->source);
    }
}
