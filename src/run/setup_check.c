// SPDX-License-Identifier: MIT
// Checks that can reject a case once its ice and bodies are known: floes outside the domain, bodies that overlap or
// meet on prescribed paths, and domains without room.
#include "run/setup.h"

#include "body/bodies.h"
#include "case/case_derived.h"
#include "case/case_tow.h"
#include "case/ice_bounds.h"
#include "base/elementary.h"

// --- the field -------------------------------------------------------------------------------------------------------

/// The floes of a field file may belong to another domain.
static bool check_inside(const bt_case *input, const bt_field *field, bt_errors *err)
{
    // A managed lead may cut a floe that reaches over an open edge, and leave a piece beyond it.
    const bool over_x = input->lead.mode == BT_LEAD_MANAGED && input->domain.ends == BT_BOUND_OPEN,
               over_y = input->lead.mode == BT_LEAD_MANAGED && input->domain.sides == BT_BOUND_OPEN;
    for (bt_idx i = 0; i < field->n; i++) {
        const double x = field->pose[3 * (size_t)i], y = field->pose[3 * (size_t)i + 1];
        if ((over_x || (x >= input->domain.x0 && x <= input->domain.x0 + input->domain.length)) &&
            (over_y || (y >= input->domain.y0 && y <= input->domain.y0 + input->domain.width)))
            continue;
        bt_errors_add(err, "%s: floe %d at (%g, %g) m is outside the domain; make the field for this domain",
                      input->ice.field ? input->ice.field : bt_case_name(input), (int)i, x, y);
        return false;
    }
    return true;
}

/// Walls that leave less room than the ice needs end any run, so reject them; guard.overlap: 0 permits it.
static bool check_closing(const bt_case *input, const bt_field *field, bt_errors *err)
{
    const double made = field->n > 0 ? bt_field_floe_area(field) : bt_case_made_area(input),
                 closed = bt_ice_closed(input, made + bt_case_area_by_hand(input));
    if (!(closed >= 1) || input->guard.overlap == 0) return true;
    char how[64] = "none beside the body";
    if (isfinite(closed)) snprintf(how, sizeof how, "which would be a concentration of %.3g", closed);
    bt_errors_add(err,
                  "%s: domain.%s_closing: by the end of the run the walls leave less room than rigid floes take, %s; "
                  "slow them, shorten run.duration, or set ice.crushing.pressure or ice.rafting.kappa",
                  bt_case_name(input), input->domain.ends_closing > 0 ? "ends" : "sides", how);
    return false;
}

bool bt_setup_check_field(const bt_case *input, const bt_field *field, bt_errors *err)
{
    return check_inside(input, field, err) && check_closing(input, field, err);
}

// --- the bodies ------------------------------------------------------------------------------------------------------

/// Are the parts p of a and q of b, at offset d from a, apart, also while a moves by (dx, dy) relative to b? Separating
/// axes of the convex hull of both ends of the path: edge normals of a and of b, and the normal of the path.
static bool parts_apart_on_path(const bt_world *world, bt_idx a, int p_first, bt_idx b, int q_first, const double d[2],
                                double dx, double dy)
{
    const bt_bodies *bd = &world->bodies;
    const int64_t from_a = bd->offset[a] + p_first, from_b = bd->offset[b] + q_first, na = bd->mark[from_a].count,
                  nb = bd->mark[from_b].count;
    for (int64_t k = 0; k <= na + nb; k++) {
        double nx = -dy, ny = dx;
        if (k < na + nb) {
            const int64_t first = k < na ? from_a : from_b, m = k < na ? na : nb,
                          at = k < na ? k : k - na;
            const double *p = bd->outline + 2 * (first + at), *q = bd->outline + 2 * (first + (at + 1) % m);
            nx = q[1] - p[1], ny = p[0] - q[0];
        }
        double low_a = INFINITY, high_a = -INFINITY, low_b = INFINITY, high_b = -INFINITY;
        const double along = nx * dx + ny * dy, offset = nx * d[0] + ny * d[1];
        for (int64_t i = from_a; i < from_a + na; i++) {
            const double p = nx * bd->outline[2 * i] + ny * bd->outline[2 * i + 1];
            low_a = bt_min(low_a, p + bt_min(along, 0));
            high_a = bt_max(high_a, p + bt_max(along, 0));
        }
        for (int64_t i = from_b; i < from_b + nb; i++) {
            const double p = nx * bd->outline[2 * i] + ny * bd->outline[2 * i + 1] + offset;
            low_b = bt_min(low_b, p);
            high_b = bt_max(high_b, p);
        }
        if (low_b >= high_a || low_a >= high_b) return true;
    }
    return false;
}

static bool apart_on_path(const bt_world *world, bt_idx a, bt_idx b, const double d[2], double dx, double dy)
{
    const bt_bodies *bd = &world->bodies;
    for (int p = bt_part_first(bd, a); p >= 0; p = bt_part_next(bd, a, p))
        for (int q = bt_part_first(bd, b); q >= 0; q = bt_part_next(bd, b, q))
            if (!parts_apart_on_path(world, a, p, b, q, d, dx, dy)) return false;
    return true;
}

/// The same for a displaced by `from`, and all images of b around the periods.
static bool images_apart(const bt_world *world, bt_idx a, bt_idx b, const double from[2], double dx, double dy)
{
    const double period[2] = {world->par.period_x, world->par.period_y}, way[2] = {dx, dy};
    double d[2], near[2];
    int64_t low[2] = {0, 0}, high[2] = {0, 0};
    bt_bodies_offset(world, a, b, d);
    for (int k = 0; k < 2; k++) {
        d[k] -= from[k];
        if (!(period[k] > 0)) continue;
        const double reach = world->bodies.radius[a] + world->bodies.radius[b]; // at either end of the path
        low[k] = (int64_t)ceil((bt_min(way[k], 0) - reach - d[k]) / period[k]);
        high[k] = (int64_t)floor((bt_max(way[k], 0) + reach - d[k]) / period[k]);
    }
    bool apart = true;
    for (int64_t i = low[0]; i <= high[0]; i++)
        for (int64_t j = low[1]; j <= high[1] && apart; j++) {
            near[0] = d[0] + (double)i * period[0];
            near[1] = d[1] + (double)j * period[1];
            apart = apart_on_path(world, a, b, near, dx, dy);
        }
    return apart;
}

/// Displacement from the start, m, after this distance along the tow, m.
static void tow_displacement(const bt_case *input, const bt_tow *tow, double way, double d[2])
{
    d[0] = way * bt_cos(input->tow.direction);
    d[1] = way * bt_sin(input->tow.direction);
    if (tow->path.n == 0) return;
    double start[2], tangent[2];
    bt_path_at(&tow->path, 0, start, tangent);
    bt_path_at(&tow->path, way, d, tangent);
    d[0] -= start[0];
    d[1] -= start[1];
}

/// Displacement of the prescribed body m from the start to time t, m.
static void displacement(const bt_case *input, const bt_world *world, bt_idx m, double t, double d[2])
{
    d[0] = world->bodies.vel[m].x * t, d[1] = world->bodies.vel[m].y * t;
    if (m == bt_world_towed(world)) tow_displacement(input, world->tow, bt_case_tow_led(input, t), d);
}

/// Does j, on its path relative to i, meet it? A changing course is divided into straight pieces.
static bool meet(const bt_case *input, const bt_world *world, bt_idx i, bt_idx j, bool wall)
{
    const bool bent = input->tow.n_waypoints > 0 && (i == bt_world_towed(world) || j == bt_world_towed(world));
    const int pieces = bent ? 500 : 1;
    const double end = (double)bt_case_steps(input) * input->run.dt;
    double from[2] = {0, 0};
    for (int k = 1; k <= pieces; k++) {
        double di[2], dj[2];
        displacement(input, world, i, end * k / pieces, di);
        displacement(input, world, j, end * k / pieces, dj);
        const double to[2] = {dj[0] - di[0], dj[1] - di[1]};
        if (wall && (world->bodies.motion[j] == BT_STATIC || (to[0] == 0 && to[1] == 0))) return false;
        if (!images_apart(world, j, i, from, to[0] - from[0], to[1] - from[1])) return true;
        from[0] = to[0], from[1] = to[1];
    }
    return false;
}

/// Two bodies of infinite mass would pass through each other without a contact: no prescribed path may do so.
static bool check_prescribed(const bt_case *input, const bt_world *world, const bt_roster *roster, bt_idx first_wall,
                             bt_errors *err)
{
    const bt_bodies *bodies = &world->bodies;
    bool sound = true;
    for (bt_idx i = 0; i < bodies->n; i++)
        for (bt_idx j = i + 1; j < bodies->n; j++) {
            if (bodies->motion[i] == BT_DYNAMIC) break;
            if (bodies->motion[j] == BT_DYNAMIC || i >= first_wall) continue;
            const bool towed = i == bt_world_towed(world) || j == bt_world_towed(world);
            if (j == bt_world_towed(world) || j >= first_wall) {
                // Standing walls may overlap fixed bodies (piers), and were checked with the tow.
                if (!meet(input, world, i, j, j >= first_wall)) continue;
                bt_errors_add(
                    err,
                    "%s: on its prescribed path %s meets %s, which cannot give way; shorten the run, move the fixed "
                    "floe, or tow on a line",
                    bt_case_name(input), roster->names[j - roster->n_floes],
                    towed && j != bt_world_towed(world) ? "the towed body" : "a fixed floe of the list floes");
                sound = false;
            }
        }
    return sound;
}

/// How far fixed body i reaches from its centroid along an axis, m.
static double reach_along(const bt_bodies *bodies, bt_idx i, int axis)
{
    double reach = 0;
    for (int64_t k = bodies->offset[i]; k < bodies->offset[i + 1]; k++)
        reach = bt_max(reach, fabs(bodies->outline[2 * k + axis]));
    return reach;
}

/// A pair has one contact, with the nearest image: across a period there must be room for both images apart. Fixed
/// bodies do not rotate, and do not meet each other.
static bool check_periods(const bt_case *input, const bt_world *world, bt_idx n_field, bt_idx first_wall,
                          bt_errors *err)
{
    const bt_bodies *bodies = &world->bodies;
    double first = 0, second = 0, fixed[2] = {0, 0}; // the two largest radii, and the reach of fixed bodies
    bt_idx longest[2] = {-1, -1};
    for (bt_idx i = 0; i < first_wall; i++) {
        for (int k = 0; k < 2 && bodies->motion[i] == BT_STATIC; k++) {
            const double r = reach_along(bodies, i, k);
            if (r > fixed[k]) fixed[k] = r, longest[k] = i;
        }
        if (bodies->motion[i] == BT_STATIC) continue;
        const double r = bodies->radius[i];
        if (r > first) second = first, first = r;
        else if (r > second) second = r;
    }
    const double periods[2] = {world->par.period_x, world->par.period_y};
    bool sound = true;
    for (int k = 0; k < 2; k++) {
        const double need = 2 * (first + second), beside = 2 * (first + fixed[k]);
        if (periods[k] > 0 && first > 0 && longest[k] >= 0 && beside >= periods[k]) {
            bt_errors_add(err,
                          "%s: domain.%s: the period of %g m has no room for the largest body, as it turns, beside "
                          "floes[%d], which is fixed, and its image, %.4g m; cut that floe in two: fixed floes that "
                          "lie flush act as one",
                          bt_case_name(input), k ? "width" : "length", periods[k], (int)(longest[k] - n_field), beside);
            sound = false;
        }
        if (periods[k] > 0 && need >= periods[k]) {
            bt_errors_add(
                err,
                "%s: domain.%s: the period of %g m has no room for the two largest bodies side by side as they turn, "
                "%.4g m; enlarge it or use smaller bodies",
                bt_case_name(input), k ? "width" : "length", periods[k], need);
            sound = false;
        }
    }
    return sound;
}

/// Name of a body for messages.
static void name_body(const bt_roster *roster, bt_gid gid, char out[64])
{
    const bt_gid row = bt_roster_row(roster, gid);
    if (row < roster->n_free) snprintf(out, 64, "floe %lld of the ice", (long long)row);
    else if (row < roster->n_floes) snprintf(out, 64, "floes[%lld]", (long long)(row - roster->n_free));
    else snprintf(out, 64, "%s", roster->names[row - roster->n_floes]);
}

/// Check that no bodies overlap by more than the position projection removes. Generated fields are free of overlap by
/// construction; a field file, floes given by hand, body and walls may not be.
static bool check_apart(const bt_case *input, bt_world *world, const bt_roster *roster, bt_errors *err)
{
    const double allowed = world->par.slop;
    const bt_overlaps overlaps = bt_world_overlaps(world, allowed);
    if (overlaps.pairs == 0) return true;
    char a[64], b[64];
    name_body(roster, overlaps.a < overlaps.b ? overlaps.a : overlaps.b, a);
    name_body(roster, overlaps.a < overlaps.b ? overlaps.b : overlaps.a, b);
    bt_errors_add(err,
                  "%s: %lld pair%s of floes, towed body or walls overlap by up to %.3g m at the start (allowed: %.3g "
                  "m), deepest %s and %s; move or "
                  "shrink the floes given by hand, or make the field for this body and domain",
                  bt_case_name(input), (long long)overlaps.pairs, bt_plural(overlaps.pairs),
                  overlaps.deepest, allowed, a, b);
    return false;
}

bool bt_setup_check_bodies(const bt_case *input, bt_world *world, const bt_roster *roster, bt_idx first_wall,
                           bt_errors *err)
{
    const bool paths = check_prescribed(input, world, roster, first_wall, err),
               periods = check_periods(input, world, roster->n_free, first_wall, err);
    return paths && periods && check_apart(input, world, roster, err);
}
