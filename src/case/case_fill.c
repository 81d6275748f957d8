// SPDX-License-Identifier: MIT
// Numbers that follow from other keys where they are not given.
#include "case/case_check.h"
#include "case/case_tow.h"

#include "bergtow/shape.h"
#include "base/largest.h"

static const double REST_SPEED = 0.01; // of the reference speed, assumed; in the basin 1e-3 m/s of 0.13 m/s

static double size_of(int n, const double *v) { return n ? sqrt(4 / BT_PI * bt_shape_moments(n, v).area) : 0; }

void bt_case_fill_size(bt_case *c)
{
    if (!isnan(c->ice.size) || c->domain.frame == BT_FRAME_BASIN) return;
    if (bt_case_makes_ice(c) || bt_case_reads_field(c)) return; // that is asked for
    double v[2 * BT_MAX_VERTICES], sum = 0;
    for (bt_idx i = 0; i < c->n_floes; i++) sum += size_of(bt_case_floe_outline(&c->floes[i], v), v);
    const double body = size_of(bt_case_waterline(c, v), v);
    c->ice.size = sum > 0 ? sum / c->n_floes : body > 0 ? body : 1; // of no bodies: without effect
}

void bt_case_fill_scene(bt_case *c)
{
    bool basin = c->domain.frame == BT_FRAME_BASIN;
    if (c->domain.ends == BT_BOUND_MOVING) bt_case_window_follow(c);
    bt_check_fill(&c->domain.x0, basin ? 0 : -c->domain.length / 2);
    bt_check_fill(&c->domain.y0, -c->domain.width / 2);
    bt_check_fill(&c->ice.x_min, c->domain.x0);
    bt_check_fill(&c->ice.x_max, c->domain.x0 + c->domain.length);
    bt_check_fill(&c->ice.y_min, c->domain.y0);
    bt_check_fill(&c->ice.y_max, c->domain.y0 + c->domain.width);
    bt_check_fill(&c->body.width, c->body.length);
    bt_check_fill(&c->body.x, basin ? c->domain.x0 + 2 * bt_case_body_length(c, 0) : 0);
    bt_check_fill(&c->domain.ahead, bt_case_window_ahead(c));
    bt_check_fill(&c->body.sail, bt_max(0, c->body.draft * (c->water.density / c->body.density - 1)));
    bt_check_fill(&c->body.friction, c->ice.friction);
    bt_check_fill(&c->body.restitution, c->ice.restitution);
    // A thickness that every floe has for itself, NaN, leaves what the frame says.
    bt_check_fill(&c->ice.splitting.least_size, basin ? 3 * c->ice.thickness : bt_max(3 * c->ice.thickness, 2));
}

void bt_case_fill_impact(bt_case *c)
{
    bt_check_fill(&c->impact.duration, c->run.dt);
    bt_check_fill(&c->impact.least_speed, 0.05 * bt_case_reference_speed(c));
    const bool basin = c->domain.frame == BT_FRAME_BASIN;
    bt_check_fill(&c->solver.rest_speed, basin ? 1e-3 : REST_SPEED * bt_case_reference_speed(c));
}

void bt_case_fill(bt_case *c)
{
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(c, v);
    bt_case_fill_scene(c);
    bt_case_fill_size(c);
    bt_case_tow_follow(&(bt_check){.c = c});
    bt_case_tow_hull(c, n, v);
    bt_case_tow_ramp(c);
    bt_case_lead_follow(c, n, v);
    bt_case_fill_impact(c);
}
