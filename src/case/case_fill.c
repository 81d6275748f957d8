// SPDX-License-Identifier: MIT
// Defaults of numbers that follow from other keys.
#include "case/case_check.h"
#include "case/case_tow.h"

#include "bergtow/shape.h"

static const double REST_SPEED = 0.01; // of the reference speed, assumed; in the basin 1e-3 m/s of 0.13 m/s

void bt_case_fill_size(bt_case *input)
{
    if (!isnan(input->ice.size) || input->domain.frame == BT_FRAME_BASIN) return;
    if (bt_case_makes_ice(input) || bt_case_reads_field(input)) return; // the case must give it
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(input, v);
    const double body = n ? sqrt(4 / BT_PI * bt_shape_moments(n, v).area) : 0,
                 by_hand = bt_case_hand_means(input).size;
    input->ice.size = by_hand > 0 ? by_hand : body > 0 ? body : 1; // without bodies it has no effect
}

void bt_case_fill_scene(bt_case *input)
{
    bool basin = input->domain.frame == BT_FRAME_BASIN;
    if (input->domain.ends == BT_BOUND_MOVING) bt_case_window_follow(input);
    bt_check_fill(&input->domain.x0, basin ? 0 : -input->domain.length / 2);
    bt_check_fill(&input->domain.y0, -input->domain.width / 2);
    bt_check_fill(&input->ice.x_min, input->domain.x0);
    bt_check_fill(&input->ice.x_max, input->domain.x0 + input->domain.length);
    bt_check_fill(&input->ice.y_min, input->domain.y0);
    bt_check_fill(&input->ice.y_max, input->domain.y0 + input->domain.width);
    bt_check_fill(&input->body.width, input->body.length);
    bt_check_fill(&input->body.x, basin ? input->domain.x0 + 2 * bt_case_body_length(input, 0) : 0);
    bt_check_fill(&input->domain.ahead, bt_case_window_ahead(input));
    bt_check_fill(&input->body.sail, bt_max(0, input->body.draft * (input->water.density / input->body.density - 1)));
    bt_check_fill(&input->body.friction, input->ice.friction);
    bt_check_fill(&input->body.restitution, input->ice.restitution);
    // If every floe has its own thickness (NaN here), bt_max leaves the 2 m of the geographic frame.
    bt_check_fill(&input->ice.splitting.least_size, basin ? 3 * input->ice.thickness
                                                          : bt_max(3 * input->ice.thickness, 2));
}

void bt_case_fill_impact(bt_case *input)
{
    bt_check_fill(&input->impact.duration, input->run.dt);
    bt_check_fill(&input->impact.least_speed, 0.05 * bt_case_reference_speed(input));
    const bool basin = input->domain.frame == BT_FRAME_BASIN;
    bt_check_fill(&input->solver.rest_speed, basin ? 1e-3 : REST_SPEED * bt_case_reference_speed(input));
}

void bt_case_fill(bt_case *input)
{
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(input, v);
    bt_case_fill_scene(input);
    bt_case_fill_size(input);
    bt_case_tow_follow(&(bt_check){.c = input});
    bt_case_tow_hull(input, n, v);
    bt_case_tow_ramp(input);
    bt_case_lead_follow(input, n, v);
    bt_case_fill_impact(input);
}
