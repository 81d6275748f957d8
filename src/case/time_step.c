// SPDX-License-Identifier: MIT
#include "case/time_step.h"

#include "case/warning.h"

bt_time_step bt_time_step_of(const bt_case *input, double floes, double size, const bt_track *track)
{
    bt_time_step step = {.longest = input->domain.frame == BT_FRAME_BASIN ? 0.1 : 5,
                         .pieces = input->lead.mode == BT_LEAD_MANAGED && input->lead.floe_size < size};
    step.size = step.pieces ? input->lead.floe_size : size;
    step.speed = bt_max(bt_case_reference_speed(input), bt_track_speed(track) * (1 - 1e-9)); // rounding
    step.passed = floes < 1 ? 0 : input->run.dt * step.speed / step.size;
    step.contact = input->run.dt <= step.longest;
    step.floes = step.passed <= 0.1;
    return step;
}

void bt_time_step_warn(const bt_case *input, const bt_time_step *step, bt_errors *warnings)
{
    if (!step->contact)
        bt_warn(warnings, BT_WARN_LONG_STEP, "run.dt: %g s is longer than a collision lasts %s; use at most %g s",
                input->run.dt, input->domain.frame == BT_FRAME_BASIN ? "in a basin" : "at full scale", step->longest);
    if (!step->floes)
        bt_warn(warnings, BT_WARN_FAST_FLOES,
                "run.dt: in %g s %s move %.3g of their size, more than 0.1; use at most %.3g s", input->run.dt,
                step->pieces ? "pieces of the lead" : "floes", step->passed, 0.1 * step->size / step->speed);
}
