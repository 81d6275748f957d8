// SPDX-License-Identifier: MIT
// The tow from step to step: speed and path of the end, velocity of the body, way-points; equations in tow/tow.h.
#include "tow/tow.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/catenary.h"
#include "base/elementary.h"
#include "case/speed_law.h"

// --- rows of the line, and the vessel --------------------------------------------------------------------------------

// The line rows of a step and the vessel at their end; equations in tow/tow.h.

// --- the vessel ------------------------------------------------------------------------------------------------------

/// Course of the vessel and the three linear things it can be at the end of the step.
static void begin_vessel(bt_world *w)
{
    bt_tow *t = w->tow;
    bt_vessel *s = &t->vessel;
    double aim[2], tangent[2];
    bt_path_at(&t->path, s->way + s->lookahead, aim, tangent);
    const double dx = aim[0] - t->carriage_x, dy = aim[1] - t->carriage_y, far = sqrt(dx * dx + dy * dy);
    t->ux = far > 0 ? dx / far : tangent[0];
    t->uy = far > 0 ? dy / far : tangent[1];

    const double dt = t->dt, m = s->mass, slip_x = s->vx - w->par.water_u, slip_y = s->vy - w->par.water_v;
    const double along = slip_x * t->ux + slip_y * t->uy, drag = s->free_resistance / (s->free_speed * s->free_speed);
    s->vd1 = s->vx * t->ux + s->vy * t->uy;
    s->vn1 = s->vy * t->ux - s->vx * t->uy;
    s->ud = w->par.water_u * t->ux + w->par.water_v * t->uy;
    s->un = w->par.water_v * t->ux - w->par.water_u * t->uy;
    s->kd = drag * sqrt(slip_x * slip_x + slip_y * slip_y);
    s->kn = s->lateral * s->kd;
    s->kt = (s->bollard_pull - s->free_resistance) / (s->free_speed * s->free_speed) * bt_max(0, along);
    s->idle_w = 1 / (m + dt * s->kd);
    s->idle = (m * s->vd1 + dt * s->kd * s->ud) * s->idle_w;
    s->full_w = 1 / (m + dt * (s->kd + s->kt));
    s->full = (m * s->vd1 + dt * ((s->kd + s->kt) * s->ud + s->bollard_pull)) * s->full_w;
    s->across_w = 1 / (m + dt * s->kn);
    s->across = (m * s->vn1 + dt * s->kn * s->un) * s->across_w;
}

typedef enum { FULL, HELD, IDLE } power;

/// The end of the line in this step: velocity (along, across the course) without the line, and how much an impulse
/// changes it.
typedef struct {
    double d, n;      ///< m/s
    double wd, wn;    ///< 1/kg
} end_motion;

static end_motion end_of(const bt_tow *t, power p)
{
    const bt_vessel *s = &t->vessel;
    end_motion e = {.d = t->end_speed}; // on a prescribed path, or held at the programme's speed
    if (t->mode != BT_TOW_THRUST) return e;
    e.n = s->across, e.wn = s->across_w;
    if (p == FULL) e.d = s->full, e.wd = s->full_w;
    if (p == IDLE) e.d = s->idle, e.wd = s->idle_w;
    return e;
}

/// Impulse that the line takes from the end along the course and across, N s.
static void pull_of(const bt_tow *t, const double lambda[BT_MAX_BRANCHES], double pull[2])
{
    pull[0] = pull[1] = 0;
    for (int k = 0; k < t->n_branches; k++) {
        const bt_branch *b = &t->branch[k];
        pull[0] += lambda[k] * (b->lx * t->ux + b->ly * t->uy);
        pull[1] += lambda[k] * (b->ly * t->ux - b->lx * t->uy);
    }
}

/// Impulse of the thrust that gives the vessel the speed vd along the course against this pull, N s.
static double thrust_for(const bt_vessel *s, double dt, double vd, double pull)
{
    return s->mass * (vd - s->vd1) + dt * s->kd * (vd - s->ud) + pull;
}

/// Is p the state that fits these impulses? The last one, IDLE, is what is left.
static bool fits(const bt_tow *t, power p, const double lambda[BT_MAX_BRANCHES])
{
    const bt_vessel *s = &t->vessel;
    if (t->mode != BT_TOW_THRUST || p == IDLE) return true;
    double pull[2];
    pull_of(t, lambda, pull);
    if (p == HELD) return thrust_for(s, t->dt, t->end_speed, pull[0]) >= 0;
    const double vd = s->full - s->full_w * pull[0];
    return vd <= t->end_speed && s->bollard_pull - s->kt * (vd - s->ud) >= 0;
}

/// From FULL with a speed too high to HELD; with a thrust below zero (dragged faster than the propeller turns) to IDLE.
static power next_power(const bt_tow *t, power p, const double lambda[BT_MAX_BRANCHES])
{
    if (p == HELD) return IDLE;
    double pull[2];
    pull_of(t, lambda, pull);
    return t->vessel.full - t->vessel.full_w * pull[0] > t->end_speed ? HELD : IDLE;
}

/// Velocity and thrust of the vessel that belong to the impulses found.
static void finish_vessel(bt_tow *t)
{
    bt_vessel *s = &t->vessel;
    double lambda[BT_MAX_BRANCHES], pull[2];
    for (int k = 0; k < BT_MAX_BRANCHES; k++) lambda[k] = t->branch[k].lambda;
    power p = FULL;
    while (!fits(t, p, lambda)) p = next_power(t, p, lambda);
    pull_of(t, lambda, pull);
    const end_motion e = end_of(t, p);
    s->vd2 = p == HELD ? e.d : e.d - e.wd * pull[0];
    s->vn2 = e.n - e.wn * pull[1];
    s->thrust = p == IDLE   ? 0
                : p == FULL ? t->dt * (s->bollard_pull - s->kt * (s->vd2 - s->ud))
                            : thrust_for(s, t->dt, s->vd2, pull[0]);
    s->vx = s->vd2 * t->ux - s->vn2 * t->uy;
    s->vy = s->vd2 * t->uy + s->vn2 * t->ux;
}

// --- rows ------------------------------------------------------------------------------------------------------------

/// Compliance of the end between the directions of branches i and j, 1/kg.
static double end_w(const bt_tow *t, const end_motion *e, int i, int j)
{
    const bt_branch *p = &t->branch[i], *q = &t->branch[j];
    return e->wd * (p->lx * t->ux + p->ly * t->uy) * (q->lx * t->ux + q->ly * t->uy) +
           e->wn * (p->ly * t->ux - p->lx * t->uy) * (q->ly * t->ux - q->lx * t->uy);
}

/// Speed of the end along branch b.
static double end_rate(const bt_tow *t, const end_motion *e, const bt_branch *b)
{
    const double along = e->d * (t->ux * b->lx + t->uy * b->ly);
    return e->n == 0 ? along : along + e->n * (b->ly * t->ux - b->lx * t->uy);
}

/// Speed of the hull point along branch b.
static double hull_rate(const bt_branch *b, const bt_vel *v) { return v->x * b->lx + v->y * b->ly + v->w * b->rxl; }

/// (Δt ω)² of the fastest mode: the larger eigenvalue of Δt² K^½ W K^½.
static double fastest_mode(const bt_tow *t, const double w[BT_MAX_BRANCHES], double w12)
{
    const double p = t->dt * t->dt * t->branch[0].stiff * w[0], q = t->dt * t->dt * t->branch[1].stiff * w[1];
    if (p == 0 || q == 0) return p + q;
    const double c2 = t->dt * t->dt * t->dt * t->dt * t->branch[0].stiff * t->branch[1].stiff * w12 * w12;
    return 0.5 * (p + q) + sqrt(0.25 * (p - q) * (p - q) + c2);
}

/// Pull of a branch with a weight at a span, and its derivative.
static double pull_at(const bt_branch *b, double span, double *tangent)
{
    return bt_catenary_pull(b->length0, b->k * b->length0, b->weight, span, tangent);
}

/// Rows of the branches at the present poses, from course and speed of the end.
static void begin_rows(bt_world *w)
{
    bt_tow *t = w->tow;
    const bt_idx i = bt_world_towed(w);
    double sine, cosine;
    bt_sincos(w->bodies.pose[i].yaw, &sine, &cosine);
    const bt_inv inv = w->bodies.inv[i];
    const bt_vel *v = &w->bodies.vel[i];
    bt_branch *first = &t->branch[0], *second = &t->branch[1];
    const end_motion idle = end_of(t, IDLE);
    end_motion free_end = idle; // without the line: as fast as power and governor let it
    if (t->mode == BT_TOW_THRUST) free_end.d = bt_max(idle.d, bt_min(t->vessel.full, t->end_speed));
    double rate[BT_MAX_BRANCHES] = {0};
    for (int k = 0; k < t->n_branches; k++) {
        bt_branch *b = &t->branch[k];
        b->rx = cosine * b->hull_x - sine * b->hull_y;
        b->ry = sine * b->hull_x + cosine * b->hull_y;
        // The end stands where its path says, in the frame of the unwrapped body.
        const double x = t->travel_x + b->rx, y = t->travel_y + b->ry;
        const double dx = t->carriage_x - x, dy = t->carriage_y - y;
        b->length = sqrt(dx * dx + dy * dy);
        b->lx = b->length > 0 ? dx / b->length : t->ux;
        b->ly = b->length > 0 ? dy / b->length : t->uy;
        b->rxl = b->rx * b->ly - b->ry * b->lx;
        t->body_w[k] = inv.m + inv.i * b->rxl * b->rxl;
        b->w = t->body_w[k] + end_w(t, &idle, k, k);
        rate[k] = end_rate(t, &free_end, b) - hull_rate(b, v);
        b->stiff = b->k;
        if (b->weight > 0) pull_at(b, bt_max(b->length, b->length + t->dt * rate[k]), &b->stiff);
    }
    t->coupling = t->n_branches > 1
                      ? inv.m * (first->lx * second->lx + first->ly * second->ly) + inv.i * first->rxl * second->rxl
                      : 0;
    const double weights[2] = {first->broken ? 0 : first->w, second->broken || t->n_branches < 2 ? 0 : second->w};
    const double h2 = fastest_mode(t, weights, t->n_branches > 1 ? t->coupling + end_w(t, &idle, 0, 1) : 0);
    const double theta = h2 > 2 ? 1 - 2 / h2 : 0;
    for (int k = 0; k < t->n_branches; k++) {
        bt_branch *b = &t->branch[k];
        double a = t->dt * b->k * (b->length - b->length0), c = b->c;
        b->taut = !b->broken && (b->weight > 0 || b->length > b->length0 || b->length + t->dt * rate[k] > b->length0);
        if (b->weight > 0) {
            double tangent;
            a = t->dt * pull_at(b, b->length, &tangent);
            c *= tangent / b->k * (tangent / b->k);
        }
        b->a = b->broken ? 0 : a;
        b->b = b->broken ? 0 : t->dt * (b->stiff * theta * t->dt + (b->taut ? c : 0));
    }
}

/// Both branches together at one state of the end. rate0: their rates without the line's impulses, but for the end's
/// velocity.
static void solve_pair(const bt_tow *t, const end_motion *e, const double hull0[2], double lambda[2])
{
    const bt_branch *p = &t->branch[0], *q = &t->branch[1];
    const bool two = t->n_branches > 1;
    const double w11 = t->body_w[0] + end_w(t, e, 0, 0), w22 = two ? t->body_w[1] + end_w(t, e, 1, 1) : 0;
    const double w12 = two ? t->coupling + end_w(t, e, 0, 1) : 0;
    const double a11 = 1 + p->b * w11, a12 = p->b * w12, a21 = q->b * w12, a22 = 1 + q->b * w22;
    const double c1 = p->a + p->b * (end_rate(t, e, p) - hull0[0]),
                 c2 = two ? q->a + q->b * (end_rate(t, e, q) - hull0[1]) : 0;
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

/// The impulses that solve the rows at the body's velocity v, of which the present ones are part.
static void solve_rows(const bt_tow *t, const bt_vel *v, double lambda[BT_MAX_BRANCHES])
{
    const bt_branch *p = &t->branch[0], *q = &t->branch[1];
    if (t->n_branches == 1 && t->mode != BT_TOW_THRUST) {
        // One row against a prescribed end: λ' = max(0, λ + (a + b l̇ − λ)/(1 + b W)). The same as below with less
        // rounding.
        const end_motion e = end_of(t, HELD);
        lambda[0] = bt_max(0, p->lambda + (p->a + p->b * (end_rate(t, &e, p) - hull_rate(p, v)) - p->lambda) /
                                              (1 + p->b * p->w));
        lambda[1] = 0;
        return;
    }
    const double hull0[2] = {hull_rate(p, v) - (t->body_w[0] * p->lambda + t->coupling * q->lambda),
                             t->n_branches > 1 ? hull_rate(q, v) - (t->coupling * p->lambda + t->body_w[1] * q->lambda)
                                               : 0};
    for (power s = FULL;; s = next_power(t, s, lambda)) {
        const end_motion e = end_of(t, s);
        solve_pair(t, &e, hull0, lambda);
        if (fits(t, s, lambda)) return;
    }
}

void bt_tow_apply(const bt_tow *t, bt_vel *v, bt_inv inv)
{
    for (int k = 0; k < t->n_branches; k++) {
        const bt_branch *b = &t->branch[k];
        v->x += b->lambda * inv.m * b->lx;
        v->y += b->lambda * inv.m * b->ly;
        v->w += b->lambda * inv.i * b->rxl;
    }
}

double bt_tow_residual(const bt_tow *t, const bt_vel *v)
{
    double lambda[BT_MAX_BRANCHES], worst = 0;
    solve_rows(t, v, lambda);
    for (int k = 0; k < t->n_branches; k++)
        worst = bt_max(worst, fabs(lambda[k] - t->branch[k].lambda) * t->branch[k].w);
    return worst;
}

double bt_tow_update(bt_tow *t, bt_vel *v, bt_inv inv)
{
    double lambda[BT_MAX_BRANCHES], worst = 0;
    solve_rows(t, v, lambda);
    for (int k = 0; k < t->n_branches; k++) {
        bt_branch *b = &t->branch[k];
        const double d = lambda[k] - b->lambda;
        b->lambda = lambda[k];
        v->x += d * inv.m * b->lx;
        v->y += d * inv.m * b->ly;
        v->w += d * inv.i * b->rxl;
        worst = bt_max(worst, fabs(d) * b->w);
    }
    return worst;
}

void bt_tow_warm_start(bt_tow *t, bool keep)
{
    for (int k = 0; k < t->n_branches; k++)
        if (!keep || !t->branch[k].taut) t->branch[k].lambda = 0;
}

// --- the tow ---------------------------------------------------------------------------------------------------------

void bt_tow_free(bt_tow *t)
{
    if (!t) return;
    free(t->programme);
    bt_path_free(&t->path);
    free(t);
}

double bt_tow_speed(const bt_tow *t, double time)
{
    return bt_speed_law_at(
        &(bt_speed_law){.speed = t->speed, .ramp = t->ramp, .programme = t->programme, .n = t->n_programme}, time);
}

/// Course and speed that lead from (x, y) to where the path is one step further; on the course of the path while it
/// stands still.
static void follow_path(bt_tow *t, double x, double y)
{
    double to[2], tangent[2];
    bt_path_at(&t->path, t->way + t->dt * t->end_speed, to, tangent);
    const double dx = to[0] - x, dy = to[1] - y, far = sqrt(dx * dx + dy * dy);
    const bool moves = t->end_speed > 0 && far > 0;
    t->ux = moves ? dx / far : tangent[0];
    t->uy = moves ? dy / far : tangent[1];
    t->end_speed = moves ? far / t->dt : 0;
}

void bt_tow_lead(bt_world *w)
{
    bt_tow *t = w->tow;
    if (!t || w->towed < 0) return;
    t->end_speed = bt_tow_speed(t, t->time + t->dt);
    if (t->mode != BT_TOW_SPEED) return;
    bt_bodies *b = &w->bodies;
    const bt_idx i = bt_world_towed(w);
    if (t->path.n > 0) follow_path(t, t->travel_x, t->travel_y);
    b->vel_start[i] = b->vel[i];
    b->vel[i] = b->vel_free[i] = (bt_vel){.x = t->end_speed * t->ux, .y = t->end_speed * t->uy};
}

void bt_tow_begin(bt_world *w)
{
    bt_tow *t = w->tow;
    if (!t || w->towed < 0) return;
    if (t->mode == BT_TOW_LINE) {
        if (t->path.n > 0) follow_path(t, t->carriage_x, t->carriage_y);
        begin_rows(w);
    } else if (t->mode == BT_TOW_THRUST) {
        begin_vessel(w);
        begin_rows(w);
    }
}

static void break_branches(bt_world *w, double time)
{
    bt_tow *t = w->tow;
    int left = 0, broke = 0;
    for (int k = 0; k < t->n_branches; k++) {
        bt_branch *b = &t->branch[k];
        if (b->broken) continue;
        const double tension = bt_tow_tension(t, k);
        if (b->breaking > 0 && tension > b->breaking) {
            b->broken = true;
            broke++;
            bt_events_add(&w->events, time, BT_EVENT_LINE_BROKEN, k + 1, tension);
        } else {
            left++;
        }
    }
    if (broke == 0 || left > 0) return;
    const bt_vel *v = &w->bodies.vel[bt_world_towed(w)];
    bt_events_add(&w->events, time, BT_EVENT_ADRIFT, 0, sqrt(v->x * v->x + v->y * v->y));
}

void bt_tow_advance(bt_world *w)
{
    bt_tow *t = w->tow;
    if (!t) return;
    const double dt = t->dt, end = (double)(w->step + 1) * dt, speed = bt_tow_speed(t, t->time + dt);
    t->way += dt * speed;
    double led = t->way;
    if (t->mode == BT_TOW_THRUST) {
        finish_vessel(t);
        t->carriage_x += dt * t->vessel.vx;
        t->carriage_y += dt * t->vessel.vy;
        const double near = bt_path_near(&t->path, t->vessel.way, t->carriage_x, t->carriage_y);
        led = t->vessel.way = bt_max(near, t->vessel.way + BT_VESSEL_WAY * dt * bt_max(0, t->vessel.vd2));
    } else if (t->path.n > 0) {
        double at[2], tangent[2];
        bt_path_at(&t->path, t->way, at, tangent);
        t->carriage_x = at[0];
        t->carriage_y = at[1];
    } else {
        t->carriage_x += dt * speed * t->ux;
        t->carriage_y += dt * speed * t->uy;
    }
    while (t->mark < t->path.n_marks && led >= t->path.mark[t->mark] * (1 - 1e-12)) {
        t->mark++;
        bt_events_add(&w->events, end, BT_EVENT_WAYPOINT, t->mark, t->path.mark[t->mark - 1]);
    }
    if (bt_tow_has_line(t)) break_branches(w, end);
    t->time = end;
}

static uint64_t mix(uint64_t h, double x)
{
    uint64_t u;
    memcpy(&u, &x, sizeof u);
    h = (h ^ u) * 0x9e3779b97f4a7c15u;
    return h ^ h >> 29;
}

uint64_t bt_tow_hash(const bt_tow *t)
{
    const double state[] = {t->time, t->carriage_x, t->carriage_y, t->branch[0].lambda, t->travel_x, t->travel_y};
    uint64_t h = 0;
    for (size_t k = 0; k < sizeof state / sizeof *state; k++) h = mix(h, state[k]);
    // What a tow by one line on a straight path has not.
    if (t->n_branches > 1) h = mix(h, t->branch[1].lambda);
    for (int k = 0; k < t->n_branches; k++)
        if (t->branch[k].broken) h = mix(h, k + 1);
    if (t->path.n > 0) h = mix(mix(h, t->way), t->mark);
    if (t->mode == BT_TOW_THRUST) h = mix(mix(mix(h, t->vessel.vx), t->vessel.vy), t->vessel.way);
    return h;
}
