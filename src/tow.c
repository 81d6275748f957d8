// SPDX-License-Identifier: MIT
// The tow: prescribed velocity and the elastic line; equations in bergtow/tow.h.
#include "bergtow/tow.h"

#include <math.h>
#include <string.h>

double bt_tow_speed(const bt_tow *t, double time)
{
    if (time <= 0) return t->ramp > 0 ? 0 : t->speed;
    return t->ramp > 0 && time < t->ramp ? t->speed * (time / t->ramp) : t->speed;
}

static void begin_line(bt_world *w, bt_tow *t)
{
    const bt_idx i = bt_world_towed(w);
    const bt_pose *p = &w->bodies.pose[i];
    const bt_inv inv = w->bodies.inv[i];
    const bt_vel *v = &w->bodies.vel[i];
    t->rx = p->c * t->hull_x - p->s * t->hull_y;
    t->ry = p->s * t->hull_x + p->c * t->hull_y;
    // The carriage stands where its path says, in the frame of the unwrapped body.
    double x = t->travel_x + t->rx, y = t->travel_y + t->ry;
    double dx = t->carriage_x - x, dy = t->carriage_y - y;
    t->length = sqrt(dx * dx + dy * dy);
    t->lx = t->length > 0 ? dx / t->length : t->ux;
    t->ly = t->length > 0 ? dy / t->length : t->uy;
    t->rxl = t->rx * t->ly - t->ry * t->lx;
    t->w = inv.m + inv.i * t->rxl * t->rxl;

    const double s = bt_tow_speed(t, t->time + t->dt);
    t->carriage_speed = s * (t->ux * t->lx + t->uy * t->ly);
    double rate = t->carriage_speed - (v->x * t->lx + v->y * t->ly + v->w * t->rxl);
    t->taut = t->length > t->length0 || t->length + t->dt * rate > t->length0;
    const double h2 = t->dt * t->dt * t->k * t->w, theta = h2 > 2 ? 1 - 2 / h2 : 0;
    t->a = t->dt * t->k * (t->length - t->length0);
    t->b = t->dt * (t->k * theta * t->dt + t->c);
    if (!t->taut) t->lambda = 0;
}

void bt_tow_begin(bt_world *w)
{
    bt_tow *t = w->tow;
    if (!t || w->towed < 0) return;
    bt_bodies *b = &w->bodies;
    const bt_idx i = bt_world_towed(w);
    if (t->mode == BT_TOW_SPEED) {
        b->vel_start[i] = b->vel[i];
        double s = bt_tow_speed(t, t->time + t->dt);
        b->vel[i] = b->vel_free[i] = (bt_vel){.x = s * t->ux, .y = s * t->uy};
    } else if (t->mode == BT_TOW_LINE) {
        begin_line(w, t);
    }
}

/// What the row asks for at line rate l̇: λ = max(0, a + b l̇).
static double rate_of(const bt_tow *t, const bt_vel *v)
{
    return t->carriage_speed - (v->x * t->lx + v->y * t->ly + v->w * t->rxl);
}

/// λ that solves the row with all else held: λ' = max(0, λ + (a + b l̇ − λ) / (1 + b W)).
static double solved(const bt_tow *t, const bt_vel *v)
{
    return bt_max(0, t->lambda + (t->a + t->b * rate_of(t, v) - t->lambda) / (1 + t->b * t->w));
}

void bt_tow_apply(const bt_tow *t, double d, bt_vel *v, bt_inv inv)
{
    v->x += d * inv.m * t->lx;
    v->y += d * inv.m * t->ly;
    v->w += d * inv.i * t->rxl;
}

double bt_tow_update(bt_tow *t, bt_vel *v, bt_inv inv)
{
    if (!t->taut) return 0;
    double l = solved(t, v), d = l - t->lambda;
    t->lambda = l;
    bt_tow_apply(t, d, v, inv);
    return fabs(d) * t->w;
}

double bt_tow_residual(const bt_tow *t, const bt_vel *v)
{
    return t->taut ? fabs(solved(t, v) - t->lambda) * t->w : 0;
}

void bt_tow_warm_start(bt_tow *t, bool keep)
{
    if (!keep || !t->taut) t->lambda = 0;
}

uint64_t bt_tow_hash(const bt_tow *t)
{
    const double state[] = {t->time, t->carriage_x, t->carriage_y, t->lambda, t->travel_x, t->travel_y};
    uint64_t h = 0, u;
    for (size_t k = 0; k < sizeof state / sizeof *state; k++) {
        memcpy(&u, &state[k], sizeof u);
        h = (h ^ u) * 0x9e3779b97f4a7c15u;
        h ^= h >> 29;
    }
    return h;
}
