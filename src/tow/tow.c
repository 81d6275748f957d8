// SPDX-License-Identifier: MIT
// The tow, step by step: speed and path of the end, velocity of the body, way-points; equations in tow/tow.h.
#include "tow/tow.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/catenary.h"
#include "base/elementary.h"
#include "case/speed_law.h"

// --- the vessel ------------------------------------------------------------------------------------------------------

/// Course of the vessel and its three possible linear models at the end of the step.
static void begin_vessel(bt_world *world)
{
    bt_tow *tow = world->tow;
    bt_vessel *vessel = &tow->vessel;
    double aim[2], tangent[2];
    bt_path_at(&tow->path, vessel->way + vessel->lookahead, aim, tangent);
    const double dx = aim[0] - tow->carriage_x, dy = aim[1] - tow->carriage_y, far = sqrt(dx * dx + dy * dy);
    tow->ux = far > 0 ? dx / far : tangent[0];
    tow->uy = far > 0 ? dy / far : tangent[1];

    const double dt = tow->dt, m = vessel->mass, slip_x = vessel->vx - world->par.water_u,
                 slip_y = vessel->vy - world->par.water_v;
    const double along = slip_x * tow->ux + slip_y * tow->uy,
                 drag = vessel->free_resistance / (vessel->free_speed * vessel->free_speed);
    vessel->vd1 = vessel->vx * tow->ux + vessel->vy * tow->uy;
    vessel->vn1 = vessel->vy * tow->ux - vessel->vx * tow->uy;
    vessel->ud = world->par.water_u * tow->ux + world->par.water_v * tow->uy;
    vessel->un = world->par.water_v * tow->ux - world->par.water_u * tow->uy;
    vessel->kd = drag * sqrt(slip_x * slip_x + slip_y * slip_y);
    vessel->kn = vessel->lateral * vessel->kd;
    vessel->kt = (vessel->bollard_pull - vessel->free_resistance) / (vessel->free_speed * vessel->free_speed) *
                 bt_max(0, along);
    vessel->idle_w = 1 / (m + dt * vessel->kd);
    vessel->idle = (m * vessel->vd1 + dt * vessel->kd * vessel->ud) * vessel->idle_w;
    vessel->full_w = 1 / (m + dt * (vessel->kd + vessel->kt));
    vessel->full = (m * vessel->vd1 + dt * ((vessel->kd + vessel->kt) * vessel->ud + vessel->bollard_pull)) *
                   vessel->full_w;
    vessel->across_w = 1 / (m + dt * vessel->kn);
    vessel->across = (m * vessel->vn1 + dt * vessel->kn * vessel->un) * vessel->across_w;
}

typedef enum { FULL, HELD, IDLE } power;

/// The end of the line in this step: velocity (along, across the course) without the line, and its change per unit
/// impulse.
typedef struct {
    double d, n;      ///< m/s
    double wd, wn;    ///< 1/kg
} end_motion;

static end_motion end_of(const bt_tow *tow, power p)
{
    const bt_vessel *vessel = &tow->vessel;
    end_motion end = {.d = tow->end_speed}; // on a prescribed path, or held at the programme's speed
    if (tow->mode != BT_TOW_THRUST) return end;
    end.n = vessel->across, end.wn = vessel->across_w;
    if (p == FULL) end.d = vessel->full, end.wd = vessel->full_w;
    if (p == IDLE) end.d = vessel->idle, end.wd = vessel->idle_w;
    return end;
}

/// Impulse that the line takes from its end, along the course and across, N s.
static void pull_of(const bt_tow *tow, const double lambda[BT_MAX_BRANCHES], double pull[2])
{
    pull[0] = pull[1] = 0;
    for (int k = 0; k < tow->n_branches; k++) {
        const bt_branch *branch = &tow->branch[k];
        pull[0] += lambda[k] * (branch->lx * tow->ux + branch->ly * tow->uy);
        pull[1] += lambda[k] * (branch->ly * tow->ux - branch->lx * tow->uy);
    }
}

/// Impulse of the thrust that gives the vessel the speed vd along the course against this pull, N s.
static double thrust_for(const bt_vessel *vessel, double dt, double vd, double pull)
{
    return vessel->mass * (vd - vessel->vd1) + dt * vessel->kd * (vd - vessel->ud) + pull;
}

/// Is p the state that fits these impulses? IDLE, the last, applies if no other does.
static bool fits(const bt_tow *tow, power p, const double lambda[BT_MAX_BRANCHES])
{
    const bt_vessel *vessel = &tow->vessel;
    if (tow->mode != BT_TOW_THRUST || p == IDLE) return true;
    double pull[2];
    pull_of(tow, lambda, pull);
    if (p == HELD) return thrust_for(vessel, tow->dt, tow->end_speed, pull[0]) >= 0;
    const double vd = vessel->full - vessel->full_w * pull[0];
    return vd <= tow->end_speed && vessel->bollard_pull - vessel->kt * (vd - vessel->ud) >= 0;
}

/// From FULL, to HELD if the speed is too high; to IDLE if the thrust would be negative (dragged faster than the
/// propeller drives).
static power next_power(const bt_tow *tow, power p, const double lambda[BT_MAX_BRANCHES])
{
    if (p == HELD) return IDLE;
    double pull[2];
    pull_of(tow, lambda, pull);
    return tow->vessel.full - tow->vessel.full_w * pull[0] > tow->end_speed ? HELD : IDLE;
}

/// Set the velocity and thrust of the vessel from the impulses found.
static void finish_vessel(bt_tow *tow)
{
    bt_vessel *vessel = &tow->vessel;
    double lambda[BT_MAX_BRANCHES], pull[2];
    for (int k = 0; k < BT_MAX_BRANCHES; k++) lambda[k] = tow->branch[k].lambda;
    power p = FULL;
    while (!fits(tow, p, lambda)) p = next_power(tow, p, lambda);
    pull_of(tow, lambda, pull);
    const end_motion end = end_of(tow, p);
    vessel->vd2 = p == HELD ? end.d : end.d - end.wd * pull[0];
    vessel->vn2 = end.n - end.wn * pull[1];
    vessel->thrust = p == IDLE   ? 0
                     : p == FULL ? tow->dt * (vessel->bollard_pull - vessel->kt * (vessel->vd2 - vessel->ud))
                                 : thrust_for(vessel, tow->dt, vessel->vd2, pull[0]);
    vessel->vx = vessel->vd2 * tow->ux - vessel->vn2 * tow->uy;
    vessel->vy = vessel->vd2 * tow->uy + vessel->vn2 * tow->ux;
}

// --- rows ------------------------------------------------------------------------------------------------------------

/// Compliance of the end between the directions of branches i and j, 1/kg.
static double end_w(const bt_tow *tow, const end_motion *end, int i, int j)
{
    const bt_branch *p = &tow->branch[i], *q = &tow->branch[j];
    return end->wd * (p->lx * tow->ux + p->ly * tow->uy) * (q->lx * tow->ux + q->ly * tow->uy) +
           end->wn * (p->ly * tow->ux - p->lx * tow->uy) * (q->ly * tow->ux - q->lx * tow->uy);
}

/// Speed of the end along the branch.
static double end_rate(const bt_tow *tow, const end_motion *end, const bt_branch *branch)
{
    const double along = end->d * (tow->ux * branch->lx + tow->uy * branch->ly);
    return end->n == 0 ? along : along + end->n * (branch->ly * tow->ux - branch->lx * tow->uy);
}

/// Speed of the hull point along the branch.
static double hull_rate(const bt_branch *branch, const bt_vel *v)
{
    return v->x * branch->lx + v->y * branch->ly + v->w * branch->rxl;
}

/// (Δt ω)² of the fastest mode: the larger eigenvalue of Δt² K^½ W K^½.
static double fastest_mode(const bt_tow *tow, const double w[BT_MAX_BRANCHES], double w12)
{
    const double p = tow->dt * tow->dt * tow->branch[0].stiff * w[0],
                 q = tow->dt * tow->dt * tow->branch[1].stiff * w[1];
    if (p == 0 || q == 0) return p + q;
    const double c2 = tow->dt * tow->dt * tow->dt * tow->dt * tow->branch[0].stiff * tow->branch[1].stiff * w12 * w12;
    return 0.5 * (p + q) + sqrt(0.25 * (p - q) * (p - q) + c2);
}

/// Pull of a branch with a weight at a span, and its derivative.
static double pull_at(const bt_branch *branch, double span, double *tangent)
{
    return bt_catenary_pull(branch->length0, branch->k * branch->length0, branch->weight, span, tangent);
}

/// Rows of the branches at the present poses, from course and speed of the end.
static void begin_rows(bt_world *world)
{
    bt_tow *tow = world->tow;
    const bt_idx i = bt_world_towed(world);
    double sine, cosine;
    bt_sincos(world->bodies.pose[i].yaw, &sine, &cosine);
    const bt_inv inv = world->bodies.inv[i];
    const bt_vel *v = &world->bodies.vel[i];
    bt_branch *first = &tow->branch[0], *second = &tow->branch[1];
    const end_motion idle = end_of(tow, IDLE);
    end_motion free_end = idle; // without the line: as fast as power and governor allow
    if (tow->mode == BT_TOW_THRUST) free_end.d = bt_max(idle.d, bt_min(tow->vessel.full, tow->end_speed));
    double rate[BT_MAX_BRANCHES] = {0};
    for (int k = 0; k < tow->n_branches; k++) {
        bt_branch *branch = &tow->branch[k];
        branch->rx = cosine * branch->hull_x - sine * branch->hull_y;
        branch->ry = sine * branch->hull_x + cosine * branch->hull_y;
        // The end is at its place on the path, in the frame of the unwrapped body.
        const double x = tow->travel_x + branch->rx, y = tow->travel_y + branch->ry;
        const double dx = tow->carriage_x - x, dy = tow->carriage_y - y;
        branch->length = sqrt(dx * dx + dy * dy);
        branch->lx = branch->length > 0 ? dx / branch->length : tow->ux;
        branch->ly = branch->length > 0 ? dy / branch->length : tow->uy;
        branch->rxl = branch->rx * branch->ly - branch->ry * branch->lx;
        tow->body_w[k] = inv.m + inv.i * branch->rxl * branch->rxl;
        branch->w = tow->body_w[k] + end_w(tow, &idle, k, k);
        rate[k] = end_rate(tow, &free_end, branch) - hull_rate(branch, v);
        branch->stiff = branch->k;
        if (branch->weight > 0)
            pull_at(branch, bt_max(branch->length, branch->length + tow->dt * rate[k]), &branch->stiff);
    }
    tow->coupling = tow->n_branches > 1
                      ? inv.m * (first->lx * second->lx + first->ly * second->ly) + inv.i * first->rxl * second->rxl
                      : 0;
    const double weights[2] = {first->broken ? 0 : first->w, second->broken || tow->n_branches < 2 ? 0 : second->w};
    const double h2 = fastest_mode(tow, weights, tow->n_branches > 1 ? tow->coupling + end_w(tow, &idle, 0, 1) : 0);
    const double theta = h2 > 2 ? 1 - 2 / h2 : 0;
    for (int k = 0; k < tow->n_branches; k++) {
        bt_branch *branch = &tow->branch[k];
        double a = tow->dt * branch->k * (branch->length - branch->length0), c = branch->c;
        branch->taut = !branch->broken && (branch->weight > 0 || branch->length > branch->length0 ||
                                           branch->length + tow->dt * rate[k] > branch->length0);
        if (branch->weight > 0) {
            double tangent;
            a = tow->dt * pull_at(branch, branch->length, &tangent);
            c *= tangent / branch->k * (tangent / branch->k);
        }
        branch->a = branch->broken ? 0 : a;
        branch->b = branch->broken ? 0 : tow->dt * (branch->stiff * theta * tow->dt + (branch->taut ? c : 0));
    }
}

/// Solve both branches together at one state of the end. hull0: their rates without the line's impulses and without the
/// end's velocity.
static void solve_pair(const bt_tow *tow, const end_motion *end, const double hull0[2], double lambda[2])
{
    const bt_branch *p = &tow->branch[0], *q = &tow->branch[1];
    const bool two = tow->n_branches > 1;
    const double w11 = tow->body_w[0] + end_w(tow, end, 0, 0), w22 = two ? tow->body_w[1] + end_w(tow, end, 1, 1) : 0;
    const double w12 = two ? tow->coupling + end_w(tow, end, 0, 1) : 0;
    const double a11 = 1 + p->b * w11, a12 = p->b * w12, a21 = q->b * w12, a22 = 1 + q->b * w22;
    const double c1 = p->a + p->b * (end_rate(tow, end, p) - hull0[0]),
                 c2 = two ? q->a + q->b * (end_rate(tow, end, q) - hull0[1]) : 0;
    const double det = a11 * a22 - a12 * a21; // ≥ 1: diag(b) W has no negative eigenvalue
    const double both1 = (a22 * c1 - a12 * c2) / det, both2 = (a11 * c2 - a21 * c1) / det;
    if (both1 >= 0 && both2 >= 0) {
        lambda[0] = both1, lambda[1] = both2;
        return;
    }
    const double only1 = bt_max(0, c1 / a11), only2 = bt_max(0, c2 / a22);
    const bool first = c2 - a21 * only1 <= 0 || only2 == 0;
    lambda[0] = first ? only1 : 0;
    lambda[1] = first ? 0 : only2;
}

/// Find the impulses that solve the rows at the body's velocity v, which includes the effect of the present ones.
static void solve_rows(const bt_tow *tow, const bt_vel *v, double lambda[BT_MAX_BRANCHES])
{
    const bt_branch *p = &tow->branch[0], *q = &tow->branch[1];
    if (tow->n_branches == 1 && tow->mode != BT_TOW_THRUST) {
        // One row against a prescribed end: λ' = max(0, λ + (a + b l̇ − λ)/(1 + b W)). As below, with less rounding.
        const end_motion end = end_of(tow, HELD);
        lambda[0] = bt_max(0, p->lambda + (p->a + p->b * (end_rate(tow, &end, p) - hull_rate(p, v)) - p->lambda) /
                                              (1 + p->b * p->w));
        lambda[1] = 0;
        return;
    }
    const double hull0[2] = {hull_rate(p, v) - (tow->body_w[0] * p->lambda + tow->coupling * q->lambda),
                             tow->n_branches > 1
                             ? hull_rate(q, v) - (tow->coupling * p->lambda + tow->body_w[1] * q->lambda)
                                                 : 0};
    for (power s = FULL;; s = next_power(tow, s, lambda)) {
        const end_motion end = end_of(tow, s);
        solve_pair(tow, &end, hull0, lambda);
        if (fits(tow, s, lambda)) return;
    }
}

void bt_tow_apply(const bt_tow *tow, bt_vel *v, bt_inv inv)
{
    for (int k = 0; k < tow->n_branches; k++) {
        const bt_branch *branch = &tow->branch[k];
        v->x += branch->lambda * inv.m * branch->lx;
        v->y += branch->lambda * inv.m * branch->ly;
        v->w += branch->lambda * inv.i * branch->rxl;
    }
}

double bt_tow_residual(const bt_tow *tow, const bt_vel *v)
{
    double lambda[BT_MAX_BRANCHES], worst = 0;
    solve_rows(tow, v, lambda);
    for (int k = 0; k < tow->n_branches; k++)
        worst = bt_max(worst, fabs(lambda[k] - tow->branch[k].lambda) * tow->branch[k].w);
    return worst;
}

double bt_tow_update(bt_tow *tow, bt_vel *v, bt_inv inv)
{
    double lambda[BT_MAX_BRANCHES], worst = 0;
    solve_rows(tow, v, lambda);
    for (int k = 0; k < tow->n_branches; k++) {
        bt_branch *branch = &tow->branch[k];
        const double d = lambda[k] - branch->lambda;
        branch->lambda = lambda[k];
        v->x += d * inv.m * branch->lx;
        v->y += d * inv.m * branch->ly;
        v->w += d * inv.i * branch->rxl;
        worst = bt_max(worst, fabs(d) * branch->w);
    }
    return worst;
}

void bt_tow_warm_start(bt_tow *tow, bool keep)
{
    for (int k = 0; k < tow->n_branches; k++)
        if (!keep || !tow->branch[k].taut) tow->branch[k].lambda = 0;
}

// --- the tow ---------------------------------------------------------------------------------------------------------

void bt_tow_free(bt_tow *tow)
{
    if (!tow) return;
    free(tow->programme);
    bt_path_free(&tow->path);
    free(tow);
}

double bt_tow_speed(const bt_tow *tow, double time)
{
    return bt_speed_law_at(
        &(bt_speed_law){.speed = tow->speed, .ramp = tow->ramp, .programme = tow->programme, .n = tow->n_programme},
        time);
}

/// Set the course and speed that lead from (x, y) to the point of the path one step ahead; at rest, its course.
static void follow_path(bt_tow *tow, double x, double y)
{
    double to[2], tangent[2];
    bt_path_at(&tow->path, tow->way + tow->dt * tow->end_speed, to, tangent);
    const double dx = to[0] - x, dy = to[1] - y, far = sqrt(dx * dx + dy * dy);
    const bool moves = tow->end_speed > 0 && far > 0;
    tow->ux = moves ? dx / far : tangent[0];
    tow->uy = moves ? dy / far : tangent[1];
    tow->end_speed = moves ? far / tow->dt : 0;
}

void bt_tow_prescribe(bt_world *world)
{
    bt_tow *tow = world->tow;
    if (!tow || world->towed < 0) return;
    tow->end_speed = bt_tow_speed(tow, tow->time + tow->dt);
    if (tow->mode != BT_TOW_SPEED) return;
    bt_bodies *bodies = &world->bodies;
    const bt_idx i = bt_world_towed(world);
    if (tow->path.n > 0) follow_path(tow, tow->travel_x, tow->travel_y);
    bodies->vel_start[i] = bodies->vel[i];
    bodies->vel[i] = bodies->vel_free[i] = (bt_vel){.x = tow->end_speed * tow->ux, .y = tow->end_speed * tow->uy};
}

void bt_tow_begin(bt_world *world)
{
    bt_tow *tow = world->tow;
    if (!tow || world->towed < 0) return;
    if (tow->mode == BT_TOW_LINE) {
        if (tow->path.n > 0) follow_path(tow, tow->carriage_x, tow->carriage_y);
        begin_rows(world);
    } else if (tow->mode == BT_TOW_THRUST) {
        begin_vessel(world);
        begin_rows(world);
    }
}

static void break_branches(bt_world *world, double time)
{
    bt_tow *tow = world->tow;
    int left = 0, broke = 0;
    for (int k = 0; k < tow->n_branches; k++) {
        bt_branch *branch = &tow->branch[k];
        if (branch->broken) continue;
        const double tension = bt_tow_tension(tow, k);
        if (branch->breaking > 0 && tension > branch->breaking) {
            branch->broken = true;
            broke++;
            bt_events_add(&world->events, time, BT_EVENT_LINE_BROKEN, k + 1, tension);
        } else {
            left++;
        }
    }
    if (broke == 0 || left > 0) return;
    const bt_vel *v = &world->bodies.vel[bt_world_towed(world)];
    bt_events_add(&world->events, time, BT_EVENT_ADRIFT, 0, sqrt(v->x * v->x + v->y * v->y));
}

void bt_tow_advance(bt_world *world)
{
    bt_tow *tow = world->tow;
    if (!tow) return;
    const double dt = tow->dt, end = (double)(world->step + 1) * dt, speed = bt_tow_speed(tow, tow->time + dt);
    tow->way += dt * speed;
    double led = tow->way;
    if (tow->mode == BT_TOW_THRUST) {
        finish_vessel(tow);
        tow->carriage_x += dt * tow->vessel.vx;
        tow->carriage_y += dt * tow->vessel.vy;
        const double near = bt_path_near(&tow->path, tow->vessel.way, tow->carriage_x, tow->carriage_y);
        led = tow->vessel.way = bt_max(near, tow->vessel.way + BT_VESSEL_WAY * dt * bt_max(0, tow->vessel.vd2));
    } else if (tow->path.n > 0) {
        double at[2], tangent[2];
        bt_path_at(&tow->path, tow->way, at, tangent);
        tow->carriage_x = at[0];
        tow->carriage_y = at[1];
    } else {
        tow->carriage_x += dt * speed * tow->ux;
        tow->carriage_y += dt * speed * tow->uy;
    }
    while (tow->mark < tow->path.n_marks && led >= tow->path.mark[tow->mark] * (1 - 1e-12)) {
        tow->mark++;
        bt_events_add(&world->events, end, BT_EVENT_WAYPOINT, tow->mark, tow->path.mark[tow->mark - 1]);
    }
    if (bt_tow_has_line(tow)) break_branches(world, end);
    tow->time = end;
}

static uint64_t mix(uint64_t h, double x)
{
    uint64_t u;
    memcpy(&u, &x, sizeof u);
    h = (h ^ u) * 0x9e3779b97f4a7c15u;
    return h ^ h >> 29;
}

uint64_t bt_tow_hash(const bt_tow *tow)
{
    const double state[] = {tow->time, tow->carriage_x, tow->carriage_y, tow->branch[0].lambda, tow->travel_x,
                            tow->travel_y};
    uint64_t h = 0;
    for (size_t k = 0; k < sizeof state / sizeof *state; k++) h = mix(h, state[k]);
    // Data that a tow by one line on a straight path does not have.
    if (tow->n_branches > 1) h = mix(h, tow->branch[1].lambda);
    for (int k = 0; k < tow->n_branches; k++)
        if (tow->branch[k].broken) h = mix(h, k + 1);
    if (tow->path.n > 0) h = mix(mix(h, tow->way), tow->mark);
    if (tow->mode == BT_TOW_THRUST) h = mix(mix(mix(h, tow->vessel.vx), tow->vessel.vy), tow->vessel.way);
    return h;
}
