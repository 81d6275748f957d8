// SPDX-License-Identifier: MIT
// Estimates of broken-ice resistance; equations and sources in bergtow/estimate.h.
#include "bergtow/estimate.h"

#include <math.h>

#include "force/environment.h"
#include "bergtow/shape.h"

#define GRAVITY 9.81 // m/s²

const bt_estimate_kind_info bt_estimate_kinds[BT_N_ESTIMATES] = {
    [BT_EST_LICHEY_HELLMER] = {"lichey_hellmer", "Lichey-Hellmer",
                               "0.5 rho_i C_si h W |dV| dV; 0 for A <= 0.15; at most P W when captured",
                               "Lichey & Hellmer 2001, J. Glaciol. 47"},
    [BT_EST_COMPACTION] = {"marchenko_compaction", "Marchenko, compaction", "P W, P = P* h exp(-20 (1 - A))",
                           "our closure of Marchenko et al. 2010 with the strength of Hibler 1979"},
    [BT_EST_RAFTING] = {"marchenko_rafting", "Marchenko, rafting", "kappa 0.5 rho_i (1 - rho_i / rho_w) g h^2 A W",
                        "our closure of Marchenko et al. 2010; kappa: Flato & Hibler 1995 for the high end"},
    [BT_EST_MOMENTUM] = {"marchenko_momentum", "Marchenko, momentum", "rho_i h W V^2 A phi / (phi - A)",
                         "our closure of Marchenko et al. 2010: ice swept together to phi"},
    [BT_EST_DILUTE] = {"dilute_limit", "dilute limit", "(4/3) (1 + e) A rho_i h (R + r) V^2, R = W / 2",
                       "derived: disc-like floes at rest, each met once by a heavy disc"},
    [BT_EST_SHIPS] = {"ships_in_pack_ice", "ships in pack ice",
                      "0.5 k Fr_p^b rho_i W h V^2 A^n, Fr_p = V / sqrt(g h A); blunt hull, range to slender",
                      "form of Colbourne 2000 (not at hand); k, b, n as in PolarRoute (British Antarctic Survey), for "
                      "ships, range not given"},
    [BT_EST_OPEN_WATER] = {"open_water_drag", "open-water drag", "(0.5 rho_w C_w draft b + rho_w C_ws A_wl) |dV| dV",
                           "the drag law of this program; no ice resistance, to be added to the others"},
};

double bt_estimate_strength(const bt_estimate_input *in)
{
    return in->p_star * in->thickness * exp(-BT_EST_STRENGTH * (1 - in->concentration));
}

static bt_estimate just(double force, bool valid, const char *note)
{
    return (bt_estimate){.force = force, .low = force, .high = force, .valid = valid, .note = note};
}

static bt_estimate lichey_hellmer(const bt_estimate_input *in)
{
    const double a = in->concentration, strength = bt_estimate_strength(in);
    if (a <= BT_EST_LOOSE) return just(0, true, "A <= 0.15: no force");
    if (a >= BT_EST_DENSE && strength >= in->p_s) {
        const double limit = strength * in->width * (in->along / in->speed);
        return just(limit, true, "A >= 0.9 and P >= P_s: captured; the resistance is limited by P W");
    }
    return just(0.5 * in->ice_density * in->c_si * in->thickness * in->width * in->speed * in->along, true,
                a >= BT_EST_DENSE ? "A >= 0.9 and P < P_s: drag of the ice" : "0.15 < A < 0.9: drag of the ice");
}

static const char has_room[] = "A < 0.65 (assumed): the ice has room to give way";

static bt_estimate compaction(const bt_estimate_input *in)
{
    const bool compact = in->concentration >= BT_EST_COMPACT;
    return just(bt_estimate_strength(in) * in->width, compact, compact ? "A >= 0.65: compact ice" : has_room);
}

static bt_estimate rafting(const bt_estimate_input *in)
{
    const bool compact = in->concentration >= BT_EST_COMPACT;
    const double lift = 0.5 * in->ice_density * (1 - in->ice_density / in->water_density) * GRAVITY * in->thickness *
                        in->thickness * in->concentration * in->width;
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

/// Regression of the resistance of ships over the pack-ice Froude number.
static double ships_of(const bt_estimate_input *in, double k, double b, double n)
{
    const double froude = in->along / sqrt(GRAVITY * in->thickness * in->concentration);
    return 0.5 * k * pow(froude, b) * in->ice_density * in->width * in->thickness * in->along * in->along *
           pow(in->concentration, n);
}

static bt_estimate ships(const bt_estimate_input *in)
{
    const double blunt = ships_of(in, 16.1, -1.7937, 3), slender = ships_of(in, 4.4, -0.8267, 2);
    return (bt_estimate){.force = blunt,
                         .low = bt_min(blunt, slender),
                         .high = bt_max(blunt, slender),
                         .valid = in->ship,
                         .note = in->ship ? "a ship; ice and speeds of the regression are not known here"
                                          : "extrapolated: a regression of ships, and this is none"};
}

static bt_estimate force_of(bt_estimate_kind kind, const bt_estimate_input *in)
{
    if (isnan(in->along)) return just(NAN, false, "no tow: free drift");
    if (kind == BT_EST_OPEN_WATER) return just(in->drag * in->speed * in->along, true, "drag of the water alone");
    if (in->concentration == 0) return just(0, true, "no ice");
    if (in->along <= 0 && kind != BT_EST_LICHEY_HELLMER)
        return just(NAN, false, "the body does not move ahead through the ice");
    if (in->speed == 0) return just(0, true, "no motion through the ice");
    switch (kind) {
    case BT_EST_LICHEY_HELLMER: return lichey_hellmer(in);
    case BT_EST_COMPACTION: return compaction(in);
    case BT_EST_RAFTING: return rafting(in);
    case BT_EST_MOMENTUM: return momentum(in);
    case BT_EST_DILUTE: return dilute(in);
    case BT_EST_SHIPS: return ships(in);
    case BT_EST_OPEN_WATER:
    case BT_N_ESTIMATES: break;
    }
    return just(NAN, false, "unknown");
}

bt_estimate bt_estimate_at(bt_estimate_kind kind, const bt_estimate_input *in)
{
    bt_estimate e = force_of(kind, in);
    // Lichey & Hellmer's drag of ice is the same from 0.15 to 0.9, and open water knows no ice.
    const bool knows =
        kind != BT_EST_OPEN_WATER && (kind != BT_EST_LICHEY_HELLMER || in->concentration >= BT_EST_DENSE);
    e.compares = e.valid && knows && e.force > 0;
    return e;
}

// Mean diameter weighted with area, <d³>/<d²>. Power law: density ∝ d^(−a−1) on [lo, hi]; lognormal with mean m and
// relative spread s: <d^k> = m^k (1 + s²)^(k(k−1)/2), so m (1 + s²)²; single: the moments of a symmetric spread, m (1 +
// 3s²)/(1 + s²). Truncation is left out.
static double weighted_size(const bt_case *c)
{
    const double a = c->ice.size_exponent, lo = c->ice.size_min, hi = c->ice.size_max,
                 s2 = c->ice.size_spread * c->ice.size_spread;
    if (c->ice.size_law == BT_SIZE_LOGNORMAL) return c->ice.size * (1 + s2) * (1 + s2);
    if (c->ice.size_law == BT_SIZE_SINGLE) return c->ice.size * (1 + 3 * s2) / (1 + s2);
    const double top = fabs(a - 3) < 1e-9 ? log(hi / lo) : (pow(hi, 3 - a) - pow(lo, 3 - a)) / (3 - a);
    const double bottom = fabs(a - 2) < 1e-9 ? log(hi / lo) : (pow(hi, 2 - a) - pow(lo, 2 - a)) / (2 - a);
    return top / bottom;
}

void bt_estimate_conditions(const bt_case *c, bt_estimate_input *in)
{
    const double scale = c->estimate.length_scale;
    *in = (bt_estimate_input){
        .concentration = c->ice.concentration,
        .thickness = c->ice.thickness,
        .floe_radius = 0.5 * weighted_size(c),
        .speed = NAN,
        .along = NAN,
        .restitution = c->body.restitution,
        .ship = c->body.shape == BT_BODY_SHIP,
        .ice_density = c->ice.density,
        .water_density = c->water.density,
        .p_star = c->estimate.p_star / scale,
        .p_s = c->estimate.p_s / (scale * scale),
        .c_si = c->estimate.c_si,
        .kappa = c->estimate.kappa,
        .kappa_low = c->estimate.kappa_low,
        .kappa_high = c->estimate.kappa_high,
        .phi_j = c->estimate.phi_j,
        .length_scale = scale,
    };
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(c, v);
    if (!n) return;
    const double ux = cos(c->tow.direction), uy = sin(c->tow.direction);
    const double ahead = c->tow.direction - c->body.yaw;
    in->width = bt_shape_width(n, v, cos(ahead), sin(ahead));
    if (c->tow.mode == BT_TOW_NONE) return;
    double current[2]; // of a current that changes the mean over the run
    bt_environment_mean(c, true, current);
    const double rx = c->tow.speed * ux - current[0], ry = c->tow.speed * uy - current[1];
    in->speed = hypot(rx, ry);
    in->along = rx * ux + ry * uy;
    const double flow = in->speed > 0 ? atan2(ry, rx) - c->body.yaw : ahead;
    in->drag =
        0.5 * c->water.density * c->body.drag.water_form * c->body.draft * bt_shape_width(n, v, cos(flow), sin(flow)) +
        c->water.density * c->body.drag.water_skin * bt_shape_moments(n, v).area;
}

void bt_estimate_field(const bt_field *f, double *thickness, double *radius)
{
    double area = 0, volume = 0, reach = 0;
    for (bt_idx i = 0; i < f->n; i++) {
        area += f->area[i];
        volume += f->area[i] * f->thickness[i];
        reach += f->area[i] * sqrt(f->area[i] / BT_PI);
    }
    *thickness = area > 0 ? volume / area : 0;
    *radius = area > 0 ? reach / area : 0;
}
