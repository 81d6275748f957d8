// SPDX-License-Identifier: MIT
// Shared by the checks of a case and of a study: refusals, warnings, and the ice with which a run would begin.
#include <math.h>

#include "app/cmd_check.h"
#include "bergtow/comm.h"
#include "case/arch.h"
#include "case/case_check.h"
#include "case/case_files.h"
#include "case/case_tow.h"
#include "case/cost.h"
#include "case/ice_bounds.h"
#include "case/warning.h"
#include "estimate/packing.h"
#include "output/summary.h"
#include "run/setup.h"
#include "split/law.h"

/// The ice of the field that was read, or the expected ice of the field to be generated, and the floes given by hand.
static bt_check_ice ice_of(const bt_case *input, const bt_field *field)
{
    const bool read = bt_case_reads_field(input);
    const bt_floe_means mean = bt_setup_mean_floe(input, field);
    bt_check_ice ice = {.count = (read ? field->n : bt_case_expected_floes(input)) + input->n_floes,
                        .made = bt_case_floes_made(input),
                        .size = mean.size,
                        .thickness = mean.thickness,
                        .volume = mean.volume,
                        .concentration = read ? field->concentration : input->ice.concentration};
    ice.corners = bt_cost_corners(input, field, ice.count);
    ice.split = (double)field->outlines.split, ice.parts = (double)field->outlines.parts;
    return ice;
}

bt_time_step bt_check_step(const bt_case *input, const bt_check_ice *ice)
{
    bt_track track = ice->count < 1 ? (bt_track){0}
                                    : bt_setup_track(input, ice->size, ice->thickness, ice->concentration);
    const bt_time_step step = bt_time_step_of(input, ice->count, ice->size, &track);
    bt_setup_track_free(&track);
    return step;
}

double bt_check_seconds(const bt_case *input, const bt_check_ice *n)
{
    const bt_cost_ice ice = {
        .floes = n->count, .concentration = n->concentration, .split = n->split, .parts = n->parts};
    return bt_cost_making(input, n->made) + bt_cost_stepping(input, &ice);
}

// --- refusals and warnings -------------------------------------------------------------------------------------------

/// Set up the bodies, walls and known floes as a run does.
static bt_status try_setup(const bt_case *input, const bt_field *field, bt_errors *err)
{
    bt_world *world = NULL;
    bt_roster roster = {0};
    const bt_status status = bt_setup_world(input, field, &world, &roster, err);
    bt_roster_free(&roster);
    bt_world_free(world);
    return status;
}

bt_status bt_check_ready(const bt_case *input, const bt_comm *comm, bt_field *field, bt_check_ice *ice,
                         bt_check_ice *run, bt_lead_stats *lead, bt_errors *err)
{
    const double machine = bt_cost_machine();
    bt_status status = bt_cost_fits(input, bt_case_floes_made(input) + input->n_floes, comm, machine, err);
    if (status == BT_OK && bt_case_reads_field(input)) status = bt_field_load(input, field, err);
    if (status == BT_OK && bt_case_reads_field(input)) status = bt_cost_fits(input, field->n, comm, machine, err);
    if (status != BT_OK) return status;
    *ice = *run = ice_of(input, field);
    if (bt_case_reads_field(input) && input->lead.mode != BT_LEAD_NONE) {
        status = bt_lead_open(input, field, lead, err);
        if (status == BT_OK) *run = ice_of(input, field);
    }
    return status == BT_OK ? try_setup(input, field, err) : status;
}

#define SLOW 2.0 // speed of the ice / reference speed above which it is reported, assumed

static void warn_of_step(const bt_case *input, const bt_check_ice *ice, bt_errors *warnings)
{
    const bt_time_step step = bt_check_step(input, ice);
    bt_time_step_warn(input, &step, warnings);
    const double reference = bt_case_reference_speed(input);
    if (ice->count >= 1 && step.speed > SLOW * reference)
        bt_warn(warnings, BT_WARN_LOW_REFERENCE_SPEED,
                      "solver.reference_speed: %.3g m/s, but the ice approaches at up to %.3g m/s: contacts are solved "
                      "more strictly than a result needs, and slower hits count as collisions; set it to the speed of "
                      "the ice",
                      reference, step.speed);
}

bt_check_split bt_check_split_of(const bt_case *input, const bt_check_ice *ice)
{
    const bt_split_law law = {.toughness = input->ice.splitting.toughness, .strength = input->ice.splitting.strength};
    const double side = sqrt(BT_PI / 4) * ice->size;
    return (bt_check_split){bt_split_three_point_load(&law, ice->thickness, side),
                            bt_split_opening_load(&law, ice->thickness, side)};
}

/// Warn of the path through the ice, which water and wind move; a lead moves with it.
static void warn_of_track(const bt_case *input, const bt_field *field, const bt_check_ice *ice, bt_errors *warnings)
{
    if (ice->count < 1) return;
    bt_track track = bt_setup_track(input, ice->size, ice->thickness, ice->concentration);
    track.region = bt_outline_region(&field->outlines);
    bt_case_warn_lead(input, track.drift[0], track.drift[1], warnings);
    bt_track_warn(input, &track, warnings);
    if (input->domain.ends == BT_BOUND_MOVING) {
        bt_summary_window_warn_laps(warnings, bt_track_laps(input, &track));
        const double fall = bt_track_fall(input, &track);
        if (fall > BT_WINDOW_STRIDE * ice->size)
            bt_warn(warnings, BT_WARN_ICE_OVERTAKES,
                          "domain.ends: wind and water carry the ice past the body from behind, by %.3g m, but a "
                          "moving window takes in new ice only ahead; set domain.ends: periodic or open, or tow faster",
                          fall);
    }
    bt_setup_track_free(&track);
}

#define DENSE_POLYGONS 0.8 // concentration up to which regular polygons packed, with 3 to 32 sides

/// Warn of ice that a run may refuse once it has tried to make it.
static void warn_of_making(const bt_case *input, bt_errors *warnings)
{
    if (!bt_case_makes_ice(input)) return;
    bt_case_warn_large(input, warnings);
    if (input->ice.shape == BT_ICE_POLYGONS && input->ice.concentration > DENSE_POLYGONS)
        bt_warn(warnings, BT_WARN_DENSE_POLYGONS,
                "ice.shape: regular polygons may not pack to a concentration of %g, and the run is then refused only "
                "after it has tried; lower ice.concentration to about %g, or choose another ice.shape",
                input->ice.concentration, DENSE_POLYGONS);
}

void bt_check_warn(const bt_case *input, const bt_field *field, const bt_check_ice *ice, bt_errors *warnings)
{
    warn_of_track(input, field, ice, warnings);
    const bt_arch arch = bt_arch_of(input, ice->concentration, ice->count < 1 ? 0 : ice->size);
    bt_arch_warn(&arch, warnings);
    const bt_packing packing = bt_packing_of(input, ice->concentration);
    bt_packing_warn(&packing, input->run.duration, warnings);
    warn_of_step(input, ice, warnings);
    bt_case_warn_start(input, warnings);
    bt_case_warn_idle(input, warnings);
    bt_case_warn_tables(input, warnings);
    char *digests = bt_case_digests(input);
    bt_case_warn_files(input, digests, warnings);
    free(digests);
    bt_case_warn_body(input, warnings);
    bt_outline_warn(&field->outlines, input, warnings);
    warn_of_making(input, warnings);
    const double area = field->n > 0 ? bt_field_floe_area(field) : bt_case_made_area(input);
    bt_ice_warn_closed(input, area + bt_case_area_by_hand(input), warnings);
    if (ice->count < 1) return;
    bt_ice_warn(input, ice->size, ice->thickness, warnings);
    bt_ice_warn_slow(input, ice->size, warnings);
}
