// SPDX-License-Identifier: MIT
// Estimates of broken-ice resistance; equations and sources in bergtow/estimate.h.
#include "bergtow/estimate.h"

#include <math.h>
#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "base/name.h"
#include "case/arch.h"
#include "case/case_derived.h"
#include "force/environment.h"
#include "bergtow/shape.h"

double bt_estimate_strength(const bt_estimate_input *in)
{
    BT_PLAIN_NUMBERS;
    return in->p_star * in->thickness * bt_exp(-BT_EST_STRENGTH * (1 - in->concentration));
}

static bt_estimate just(double force, bool valid, const char *note)
{
    return (bt_estimate){.force = force, .low = force, .high = force, .valid = valid, .note = note};
}

/// Is the ice at least that dense? A generated field misses the concentration asked for by rounding.
static bool reaches(double concentration, double limit) { return concentration >= limit - BT_MADE_OFF; }

static bt_estimate lichey_hellmer(const bt_estimate_input *in)
{
    const double a = in->concentration, strength = bt_estimate_strength(in);
    if (a <= BT_EST_LOOSE + BT_MADE_OFF) return just(0, true, "A <= 0.15: no force");
    if (reaches(a, BT_EST_DENSE) && strength >= in->p_s) {
        const double limit = strength * in->width * (in->along / in->speed);
        return just(limit, true, "A >= 0.9 and P >= P_s: captured; the resistance is limited by P W");
    }
    return just(0.5 * in->ice_density * in->c_si * in->thickness * in->width * in->speed * in->along, true,
                reaches(a, BT_EST_DENSE) ? "A >= 0.9 and P < P_s: drag of the ice" : "0.15 < A < 0.9: drag of the ice");
}

static const char has_room[] = "A < 0.65 (assumed): the ice has room to give way";

static bt_estimate compaction(const bt_estimate_input *in)
{
    const bool compact = reaches(in->concentration, BT_EST_COMPACT);
    return just(bt_estimate_strength(in) * in->width, compact, compact ? "A >= 0.65: compact ice" : has_room);
}

static bt_estimate rafting(const bt_estimate_input *in)
{
    const bool compact = reaches(in->concentration, BT_EST_COMPACT);
    const double lift = 0.5 * bt_case_rise(in->ice_density, in->water_density) * in->thickness * in->thickness *
                        in->concentration * in->width;
    return (bt_estimate){.force = in->kappa * lift,
                         .low = in->kappa_low * lift,
                         .high = in->kappa_high * lift,
                         .valid = compact,
                         .note = compact ? "A >= 0.65: all ice of the strip rafts" : has_room};
}

static bt_estimate momentum(const bt_estimate_input *in)
{
    const double a = in->concentration, phi = in->phi_j;
    if (a > phi - BT_EST_SWEPT) return just(NAN, false, "A >= phi: the ice cannot be swept closer together");
    return just(in->ice_density * in->thickness * in->width * in->along * in->along * a * phi / (phi - a), true,
                "A < phi: a channel as wide as the body; ice that flows round it resists less");
}

static bt_estimate dilute(const bt_estimate_input *in)
{
    const bool thin = in->concentration <= BT_EST_DILUTE_MOST;
    const double force = 4.0 / 3 * (1 + in->restitution) * in->concentration * in->ice_density * in->thickness *
                         (0.5 * in->width + in->floe_radius) * in->along * in->along;
    return just(force, thin,
                thin ? "A <= 0.25 (assumed): floes are met one by one" : "A > 0.25 (assumed): floes hit each other");
}

/// Regression of the resistance of ships against the pack-ice Froude number.
static double ships_of(const bt_estimate_input *in, double k, double b, double n)
{
    const double froude = in->along / sqrt(BT_GRAVITY * in->thickness * in->concentration);
    return 0.5 * k * bt_pow(froude, b) * in->ice_density * in->width * in->thickness * in->along * in->along *
           bt_pow(in->concentration, n);
}

static bt_estimate ships(const bt_estimate_input *in)
{
    const double blunt = ships_of(in, 16.1, -1.7937, 3), slender = ships_of(in, 4.4, -0.8267, 2);
    return (bt_estimate){.force = blunt,
                         .low = bt_min(blunt, slender),
                         .high = bt_max(blunt, slender),
                         .valid = in->ship,
                         .note = in->ship ? "a ship; ice and speeds of the regression are not known here"
                                          : "extrapolated: a regression of ships, but this is not a ship"};
}

bt_estimate bt_estimate_ship(double beam, double thickness, double concentration, double speed, double ice_density)
{
    BT_PLAIN_NUMBERS;
    const bt_estimate_input in = {.concentration = concentration,
                                  .thickness = thickness,
                                  .width = beam,
                                  .along = speed,
                                  .ice_density = ice_density,
                                  .ship = true};
    return concentration > 0 && thickness > 0 && speed > 0 ? ships(&in) : just(0, true, "no ice, or at rest");
}

static bt_estimate open_water(const bt_estimate_input *in)
{
    return just(in->drag * in->water_speed * in->water_along, true, "drag of the water alone");
}

/// Lichey & Hellmer's drag of ice does not depend on the concentration from 0.15 to 0.9.
static bool is_dense(const bt_estimate_input *in) { return reaches(in->concentration, BT_EST_DENSE); }

// --- the registry ----------------------------------------------------------------------------------------------------

static bt_estimate_def estimates[BT_MAX_ESTIMATES] = {
    [BT_EST_LICHEY_HELLMER] = {.name = "lichey_hellmer",
                               .label = "Lichey-Hellmer",
                               .formula = "0.5 rho_i C_si h W |dV| dV; 0 for A <= 0.15; at most P W when captured",
                               .source = "Lichey & Hellmer 2001, J. Glaciol. 47",
                               .at = lichey_hellmer,
                               .knows = is_dense,
                               .any_course = true},
    [BT_EST_COMPACTION] = {.name = "marchenko_compaction",
                           .label = "Marchenko, compaction",
                           .formula = "P W, P = P* h exp(-20 (1 - A))",
                           .source = "closure of this program after Marchenko et al. 2010, with the strength of "
                                     "Hibler 1979",
                           .at = compaction},
    [BT_EST_RAFTING] = {.name = "marchenko_rafting",
                        .label = "Marchenko, rafting",
                        .formula = "kappa 0.5 rho_i (1 - rho_i / rho_w) g h^2 A W",
                        .source = "closure of this program after Marchenko et al. 2010; kappa assumed, 34 for pressure "
                                  "ridges (Flato & Hibler 1995)",
                        .at = rafting},
    [BT_EST_MOMENTUM] = {.name = "marchenko_momentum",
                         .label = "Marchenko, momentum",
                         .formula = "rho_i h W V^2 A phi / (phi - A)",
                         .source = "closure of this program after Marchenko et al. 2010: ice swept together to phi",
                         .at = momentum},
    [BT_EST_DILUTE] = {.name = "dilute_limit",
                       .label = "dilute limit",
                       .formula = "(4/3) (1 + e) A rho_i h (R + r) V^2, R = W / 2",
                       .source = "derived: disc-like floes at rest, each met once by a heavy disc",
                       .at = dilute},
    [BT_EST_SHIPS] = {.name = "ships_in_pack_ice",
                      .label = "ships in pack ice",
                      .formula = "0.5 k Fr_p^b rho_i W h V^2 A^n, Fr_p = V / sqrt(g h A); blunt hull, range to slender",
                      .source = "form of Colbourne 2000 (not at hand); k, b, n as in PolarRoute (British Antarctic "
                                "Survey), for ships, range not given",
                      .at = ships,
                      .note_tells = true},
    [BT_EST_OPEN_WATER] = {.name = "open_water_drag",
                           .label = "open-water drag",
                           .formula = "(0.5 rho_w C_w draft b + rho_w C_ws A_wl) |dV| dV",
                           .source = "the drag law of this program; no ice resistance, to be added to the others",
                           .at = open_water,
                           .on_top = true},
};
static int n_estimates = BT_N_OWN_ESTIMATES;

int bt_n_estimates(void) { return n_estimates; }
const bt_estimate_def *bt_estimate_of(int k) { return &estimates[k]; }

bt_status bt_estimate_register(const bt_estimate_def *def, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const size_t before = err->n;
    const char *name = def->name ? def->name : "";
    bool taken = !strcmp(name, "curves"); // by the summary, for all curves
    for (int k = 0; k < n_estimates; k++) taken = taken || !strcmp(estimates[k].name, name);
    bt_name_check("estimate", name, BT_MAX_LAW_NAME, taken, err);
    if (!def->label || !def->formula || !def->source)
        bt_errors_add(err, "estimate %s: it has no label, formula or source", name);
    if (!def->at) bt_errors_add(err, "estimate %s: it has no function `at`", name);
    if (n_estimates == BT_MAX_ESTIMATES)
        bt_errors_add(err, "estimate %s: there are %d; raise BT_MAX_ESTIMATES", name, BT_MAX_ESTIMATES);
    if (err->n > before) return BT_ERR_USAGE;
    estimates[n_estimates++] = *def;
    return BT_OK;
}

static bt_estimate force_of(const bt_estimate_def *def, const bt_estimate_input *in)
{
    if (isnan(in->along)) return just(NAN, false, "no tow: free drift");
    if (def->on_top) return def->at(in);
    if (in->concentration == 0) return just(0, true, "no ice");
    if (in->along <= 0 && !def->any_course) return just(NAN, false, "the body does not move ahead through the ice");
    if (in->speed == 0) return just(0, true, "no motion through the ice");
    return def->at(in);
}

bt_estimate bt_estimate_at(int kind, const bt_estimate_input *in)
{
    BT_PLAIN_NUMBERS;
    const bt_estimate_def *def = &estimates[kind];
    bt_estimate estimate = force_of(def, in);
    estimate.compares =
        estimate.valid && !def->on_top && (!def->knows || def->knows(in)) && estimate.force > 0 && !in->turns &&
        !in->channel;
    if (estimate.compares && (in->changes_speed || in->along < BT_EST_STILL * fabs(in->ordered))) {
        bt_estimate_input faster = *in;
        faster.along *= 2, faster.speed *= 2;
        estimate.compares = force_of(def, &faster).force == estimate.force;
    }
    return estimate;
}

void bt_estimate_conditions(const bt_case *input, bt_estimate_input *in)
{
    BT_PLAIN_NUMBERS;
    bt_estimate_ordered(input, (const double[]){NAN, NAN}, in);
}

void bt_estimate_ordered(const bt_case *input, const double ice[2], bt_estimate_input *in)
{
    BT_PLAIN_NUMBERS;
    const double scale = input->estimate.length_scale;
    *in = (bt_estimate_input){
        .concentration = input->ice.concentration,
        .thickness = input->ice.thickness,
        // weighted by area
        .floe_radius = 0.5 * (bt_case_size_moment(input, 3) / bt_case_size_moment(input, 2)),
        .speed = NAN,
        .along = NAN,
        .water_speed = NAN,
        .water_along = NAN,
        .ordered = NAN,
        .restitution = input->body.restitution,
        .ship = input->body.shape == BT_BODY_SHIP,
        .ice_density = input->ice.density,
        .water_density = input->water.density,
        .p_star = input->estimate.p_star / scale,
        .p_s = input->estimate.p_s / (scale * scale),
        .c_si = input->estimate.c_si,
        .kappa = input->estimate.kappa,
        .kappa_low = input->estimate.kappa_low,
        .kappa_high = input->estimate.kappa_high,
        .phi_j = input->estimate.phi_j,
        .length_scale = scale,
        .channel = input->lead.mode == BT_LEAD_CHANNEL,
    };
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(input, v);
    if (!n) return;
    const double ux = bt_cos(input->tow.direction), uy = bt_sin(input->tow.direction);
    const double ahead = input->tow.direction - input->body.yaw;
    in->width = bt_shape_width(n, v, bt_cos(ahead), bt_sin(ahead));
    if (input->tow.mode == BT_TOW_NONE) return;
    double current[2]; // if it changes, its mean over the run
    bt_environment_mean(input, current);
    const double *drift = isnan(ice[0]) ? current : ice;
    const double rx = input->tow.speed * ux - current[0], ry = input->tow.speed * uy - current[1],
                 ix = input->tow.speed * ux - drift[0], iy = input->tow.speed * uy - drift[1];
    in->speed = bt_hypot(ix, iy);
    in->along = in->ordered = ix * ux + iy * uy;
    in->water_speed = bt_hypot(rx, ry);
    in->water_along = rx * ux + ry * uy;
    const double flow = in->water_speed > 0 ? bt_atan2(ry, rx) - input->body.yaw : ahead;
    in->drag =
        0.5 * input->water.density * input->body.drag.water_form * input->body.draft *
            bt_shape_width(n, v, bt_cos(flow), bt_sin(flow)) +
        input->water.density * input->body.drag.water_skin * bt_shape_moments(n, v).area;
}

void bt_estimate_field(const bt_field *field, double *thickness, double *radius)
{
    BT_PLAIN_NUMBERS;
    double area = 0, volume = 0, reach = 0;
    for (bt_idx i = 0; i < field->n; i++) {
        area += field->area[i];
        volume += field->area[i] * field->thickness[i];
        reach += field->area[i] * sqrt(field->area[i] / BT_PI);
    }
    *thickness = area > 0 ? volume / area : 0;
    *radius = area > 0 ? reach / area : 0;
}
