// SPDX-License-Identifier: MIT
// What `bergtow check` says of a case beside its own numbers: defaults in use, warnings before a run, all of it as
// JSON.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bergtow/comm.h"
#include "bergtow/world.h"
#include "app/cmd_check.h"
#include "base/elementary.h"
#include "base/json.h"
#include "base/units.h"
#include "case/arch.h"
#include "case/case_check.h"
#include "case/constraints.h"
#include "case/case_tow.h"
#include "case/cost.h"
#include "case/ice_bounds.h"
#include "case/schema.h"
#include "case/warning.h"
#include "estimate/packing.h"
#include "output/summary.h"
#include "run/setup.h"
#include "split/law.h"

// --- defaults --------------------------------------------------------------------------------------------------------

// Values that a case leaves to the program, and that follow from the rest of it: `check` says what they became.

enum { FIRST = 21, MOST = 118 }; // columns of a line

/// Is the value of this row one that follows, that has an effect, and that nobody changed?
static bool is_followed(const bt_case *input, const bt_key *key, double *value)
{
    if (key->type != BT_KEY_REAL || !key->preset || key->preset[0] != '=') return false;
    *value = bt_value_number(key, input);
    return isfinite(*value) && !bt_case_why_unused(input, key->name) && !bt_case_changed(input, key->name);
}

void bt_check_print_defaults(const bt_case *input)
{
    int column = 0;
    for (int i = 0; i < bt_n_case_keys; i++) {
        const bt_key *key = &bt_case_keys[i];
        double value;
        char text[160];
        if (!is_followed(input, key, &value)) continue;
        const char *unit = bt_units_symbol(key->unit);
        if (fabs(value) < 1e-12) value = 0; // rounding
        const int n = snprintf(text, sizeof text, "%s %.4g%s%s", key->name, value, *unit ? " " : "", unit);
        const bool wraps = column > 0 && column + 2 + n > MOST;
        if (column == 0) column = printf("%-*s%s", FIRST, "by default", text);
        else if (wraps) column = printf(",\n%*s%s", FIRST, "", text) - 2;
        else column += printf(", %s", text);
    }
    if (column > 0) printf("\n");
}

static void check_write_defaults(bt_json *json, const bt_case *input)
{
    bt_json_open(json, "by_default", '{');
    for (int i = 0; i < bt_n_case_keys; i++) {
        double value;
        if (is_followed(input, &bt_case_keys[i], &value)) bt_json_number(json, bt_case_keys[i].name, value);
    }
    bt_json_close(json, '}');
}

// --- ready to run ----------------------------------------------------------------------------------------------------

// What the check of a case and that of a study share: refusals, warnings and the ice that a run would begin with.

static bt_check_ice ice_of_case(const bt_case *input)
{
    return (bt_check_ice){.count = bt_case_expected_floes(input) + input->n_floes,
                          .made = bt_case_floes_made(input),
                          .size = bt_case_mean_size(input),
                          .thickness = input->ice.thickness,
                          .concentration = input->ice.concentration};
}

static bt_check_ice ice_of_field(const bt_case *input, const bt_field *field)
{
    bt_check_ice ice = {.count = field->n + input->n_floes, .concentration = field->concentration};
    for (bt_idx i = 0; i < field->n; i++) {
        ice.size += sqrt(4 * field->area[i] / BT_PI) / field->n;
        ice.thickness += field->thickness[i] / field->n;
    }
    return ice;
}

/// Of the field that was read, or expected of the one that will be made.
static bt_check_ice ice_of(const bt_case *input, const bt_field *field)
{
    bt_check_ice ice = bt_case_reads_field(input) ? ice_of_field(input, field) : ice_of_case(input);
    ice.corners = bt_cost_corners(input, field, ice.count);
    ice.split = (double)field->outlines.split, ice.parts = (double)field->outlines.parts;
    return ice;
}

bt_check_step bt_check_step_of(const bt_case *input, const bt_check_ice *ice)
{
    bt_check_step step = {.longest = input->domain.frame == BT_FRAME_BASIN ? 0.1 : 5,
                          .pieces = input->lead.mode == BT_LEAD_MANAGED && input->lead.floe_size < ice->size};
    step.size = step.pieces ? input->lead.floe_size : ice->size;
    bt_track track = ice->count < 1 ? (bt_track){0}
                                    : bt_setup_track(input, ice->size, ice->thickness, ice->concentration);
    step.speed = bt_max(bt_case_reference_speed(input), bt_track_speed(&track) * (1 - 1e-9)); // rounding
    bt_setup_track_free(&track);
    step.passed = ice->count < 1 ? 0 : input->run.dt * step.speed / step.size;
    step.contact = input->run.dt <= step.longest;
    step.floes = step.passed <= 0.1;
    return step;
}

double bt_check_seconds(const bt_case *input, const bt_check_ice *n)
{
    const bt_cost_ice ice = {
        .floes = n->count, .concentration = n->concentration, .split = n->split, .parts = n->parts};
    return bt_cost_making(input, n->made) + bt_cost_stepping(input, &ice);
}

// --- refusals and warnings -------------------------------------------------------------------------------------------

/// Bodies, walls and floes that are known, as the run sets them up.
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

#define SLOW 2.0 // a reference speed less than the speed of the ice by more than this is reported, assumed

static void warn_of_step(const bt_case *input, const bt_check_ice *ice, bt_errors *warnings)
{
    const bt_check_step step = bt_check_step_of(input, ice);
    if (!step.contact)
        bt_warn(warnings, BT_WARN_LONG_STEP,
                      "run.dt: %g s is longer than a collision lasts %s; take at most %g s",
                      input->run.dt,
                      input->domain.frame == BT_FRAME_BASIN ? "in a basin" : "at full scale", step.longest);
    if (!step.floes)
        bt_warn(warnings, BT_WARN_FAST_FLOES,
            "run.dt: in %g s %s move %.3g of their size, more than 0.1; take at most %.3g s",
            input->run.dt, step.pieces ? "pieces of the lead" : "floes", step.passed, 0.1 * step.size / step.speed);
    const double reference = bt_case_reference_speed(input);
    if (ice->count >= 1 && step.speed > SLOW * reference)
        bt_warn(warnings, BT_WARN_LOW_REFERENCE_SPEED,
                      "solver.reference_speed: %.3g m/s, and the ice comes at up to %.3g m/s: contacts are solved more "
                      "strictly than a result needs, and slower hits count as collisions; set it to that",
                      reference, step.speed);
}

bt_check_split bt_check_split_of(const bt_case *input, const bt_check_ice *ice)
{
    const bt_split_law law = {.toughness = input->ice.splitting.toughness, .strength = input->ice.splitting.strength};
    const double side = sqrt(BT_PI / 4) * ice->size;
    return (bt_check_split){bt_split_three_point_load(&law, ice->thickness, side),
                            bt_split_opening_load(&law, ice->thickness, side)};
}

/// Where the tow leads in the ice, which water and wind move; a lead goes with it.
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
                          "domain.ends: wind and water carry the ice past the body from behind, by %.3g m, and a "
                          "moving window takes in new ice only ahead; set domain.ends: periodic or open, or tow faster",
                          fall);
    }
    bt_setup_track_free(&track);
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
    bt_case_warn_body(input, warnings);
    bt_outline_warn(&field->outlines, input, warnings);
    const double area = field->n > 0 ? bt_field_floe_area(field) : bt_case_made_area(input);
    bt_ice_warn_closed(input, area + bt_case_area_by_hand(input), warnings);
    if (ice->count < 1) return;
    bt_ice_warn(input, ice->size, ice->thickness, warnings);
    bt_ice_warn_slow(input, ice->size, warnings);
}

// --- JSON ------------------------------------------------------------------------------------------------------------

// The numbers of `bergtow check` as JSON, for scripts.

static void write_domain(bt_json *json, const bt_case *input, const bt_check_ice *ice)
{
    const bt_arch arch = bt_arch_of(input, ice->concentration, ice->count < 1 ? 0 : ice->size);
    bt_json_open(json, "domain", '{');
    bt_json_number(json, "length_m", input->domain.length);
    bt_json_number(json, "width_m", input->domain.width);
    bt_json_string(json, "across", arch.key);
    bt_json_string(json, "sides", arch.sides);
    bt_json_number(json, "body_widths", arch.bodies);
    bt_json_number(json, "body_widths_needed", arch.needed);
    bt_json_bool(json, "load_unbounded", arch.unbounded);
    bt_json_close(json, '}');
}

static void write_ice(bt_json *json, const bt_case *input, const bt_check_ice *ice)
{
    const bool splits = ice->count >= 1 && input->ice.splitting.toughness > 0;
    const bt_check_split split = splits ? bt_check_split_of(input, ice) : (bt_check_split){NAN, NAN};
    bt_json_open(json, "ice", '{');
    bt_json_number(json, "floes", round(ice->count));
    bt_json_number(json, "concentration", ice->concentration);
    bt_json_number(json, "mean_size_m", ice->count < 1 ? NAN : ice->size);
    bt_json_number(json, "mean_thickness_m", ice->count < 1 ? NAN : ice->thickness);
    bt_json_number(json, "split_three_point_n", split.three_point);
    bt_json_number(json, "split_opening_n", split.opening);
    bt_json_close(json, '}');
}

static void write_run(bt_json *json, const bt_case *input, const bt_check_ice *ice)
{
    const bt_check_step step = bt_check_step_of(input, ice);
    bt_json_open(json, "run", '{');
    bt_json_number(json, "duration_s", input->run.duration);
    bt_json_number(json, "dt_s", input->run.dt);
    bt_json_int(json, "n_steps", bt_case_steps(input));
    bt_json_number(json, "tow_distance_m", input->tow.mode == BT_TOW_NONE
                   ? 0 : bt_case_tow_distance(input, input->run.duration));
    bt_json_bool(json, "dt_resolves_collisions", step.contact);
    bt_json_bool(json, "dt_resolves_floes", ice->count < 1 || step.floes);
    bt_json_close(json, '}');
}

static void write_cost(bt_json *json, const bt_case *input, const bt_comm *comm, const bt_check_ice *run)
{
    const bt_cost_disk disk = bt_cost_disk_of(input, run->count, run->corners, comm->size);
    bt_json_open(json, "cost", '{');
    bt_json_number(json, "memory_b", bt_cost_memory(input, run->count, run->parts, comm->size, comm->ranks_here));
    bt_json_number(json, "frames", bt_cost_frames(input));
    bt_json_number(json, "disk_b", bt_cost_left(&disk));
    bt_json_number(json, "disk_while_running_b", disk.most);
    bt_json_number(json, "core_time_s", bt_check_seconds(input, run));
    bt_json_number(json, "making_of_ice_s", bt_cost_making(input, run->made));
    bt_json_close(json, '}');
}

void bt_check_print_json(const char *path, const bt_case *input, const bt_comm *comm, const bt_check_ice *ice,
                         const bt_check_ice *run, const bt_errors *warnings)
{
    bt_json json = {0};
    bt_json_open(&json, NULL, '{');
    bt_json_string(&json, "case", path);
    bt_json_string(&json, "title", input->run.title);
    bt_warnings_json(&json, "warnings", warnings);
    write_domain(&json, input, ice);
    write_ice(&json, input, ice);
    write_run(&json, input, run);
    check_write_defaults(&json, input);
    write_cost(&json, input, comm, run);
    bt_json_close(&json, '}');
    fputs(json.text, stdout);
    bt_json_free(&json);
}
