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
static bool is_followed(const bt_case *c, const bt_key *k, double *value)
{
    if (k->type != BT_KEY_REAL || !k->preset || k->preset[0] != '=') return false;
    if (!strcmp(k->name, "domain.ahead") && c->domain.ends != BT_BOUND_MOVING) return false;
    memcpy(value, (const char *)c + k->offset, sizeof *value);
    return isfinite(*value) && !bt_case_is_unused(c, k->name) && !bt_case_changed(c, k->name);
}

void bt_check_print_defaults(const bt_case *c)
{
    int column = 0;
    for (int i = 0; i < bt_n_case_keys; i++) {
        const bt_key *k = &bt_case_keys[i];
        double value;
        char text[160];
        if (!is_followed(c, k, &value)) continue;
        const char *unit = bt_units_symbol(k->unit);
        if (fabs(value) < 1e-12) value = 0; // rounding
        const int n = snprintf(text, sizeof text, "%s %.4g%s%s", k->name, value, *unit ? " " : "", unit);
        const bool wraps = column > 0 && column + 2 + n > MOST;
        if (column == 0) column = printf("%-*s%s", FIRST, "by default", text);
        else if (wraps) column = printf(",\n%*s%s", FIRST, "", text) - 2;
        else column += printf(", %s", text);
    }
    if (column > 0) printf("\n");
}

static void check_write_defaults(bt_json *j, const bt_case *c)
{
    bt_json_open(j, "by_default", '{');
    for (int i = 0; i < bt_n_case_keys; i++) {
        double value;
        if (is_followed(c, &bt_case_keys[i], &value)) bt_json_number(j, bt_case_keys[i].name, value);
    }
    bt_json_close(j, '}');
}

// --- ready to run ----------------------------------------------------------------------------------------------------

// What the check of a case and that of a study share: refusals, warnings and the ice that a run would begin with.

static bt_check_ice ice_of_case(const bt_case *c)
{
    return (bt_check_ice){.count = bt_case_expected_floes(c) + c->n_floes,
                          .made = bt_case_floes_made(c),
                          .size = bt_case_mean_size(c),
                          .thickness = c->ice.thickness,
                          .concentration = c->ice.concentration};
}

static bt_check_ice ice_of_field(const bt_case *c, const bt_field *f)
{
    bt_check_ice n = {.count = f->n + c->n_floes, .concentration = f->concentration};
    for (bt_idx i = 0; i < f->n; i++) {
        n.size += sqrt(4 * f->area[i] / BT_PI) / f->n;
        n.thickness += f->thickness[i] / f->n;
    }
    return n;
}

/// Of the field that was read, or expected of the one that will be made.
static bt_check_ice ice_of(const bt_case *c, const bt_field *f)
{
    bt_check_ice n = bt_case_reads_field(c) ? ice_of_field(c, f) : ice_of_case(c);
    n.corners = bt_cost_corners(c, f, n.count);
    n.split = (double)f->outlines.split, n.parts = (double)f->outlines.parts;
    return n;
}

bt_check_step bt_check_step_of(const bt_case *c, const bt_check_ice *n)
{
    bt_check_step s = {.longest = c->domain.frame == BT_FRAME_BASIN ? 0.1 : 5,
                       .pieces = c->lead.mode == BT_LEAD_MANAGED && c->lead.floe_size < n->size};
    s.size = s.pieces ? c->lead.floe_size : n->size;
    bt_track t = n->count < 1 ? (bt_track){0} : bt_setup_track(c, n->size, n->thickness, n->concentration);
    s.speed = bt_max(bt_case_reference_speed(c), bt_track_speed(&t) * (1 - 1e-9)); // rounding
    bt_setup_track_free(&t);
    s.passed = n->count < 1 ? 0 : c->run.dt * s.speed / s.size;
    s.contact = c->run.dt <= s.longest;
    s.floes = s.passed <= 0.1;
    return s;
}

double bt_check_seconds(const bt_case *c, const bt_check_ice *n)
{
    const bt_cost_ice ice = {
        .floes = n->count, .concentration = n->concentration, .split = n->split, .parts = n->parts};
    return bt_cost_making(c, n->made) + bt_cost_stepping(c, &ice);
}

// --- refusals and warnings -------------------------------------------------------------------------------------------

/// Bodies, walls and floes that are known, as the run sets them up.
static bt_status try_setup(const bt_case *c, const bt_field *f, bt_errors *err)
{
    bt_world *w = NULL;
    bt_roster r = {0};
    const bt_status status = bt_setup_world(c, f, &w, &r, err);
    bt_roster_free(&r);
    bt_world_free(w);
    return status;
}

bt_status bt_check_ready(const bt_case *c, const bt_comm *comm, bt_field *f, bt_check_ice *n, bt_check_ice *run,
                         bt_lead_stats *lead, bt_errors *err)
{
    const double machine = bt_cost_machine();
    bt_status status = bt_cost_fits(c, bt_case_floes_made(c) + c->n_floes, comm, machine, err);
    if (status == BT_OK && bt_case_reads_field(c)) status = bt_field_load(c, f, err);
    if (status == BT_OK && bt_case_reads_field(c)) status = bt_cost_fits(c, f->n, comm, machine, err);
    if (status != BT_OK) return status;
    *n = *run = ice_of(c, f);
    if (bt_case_reads_field(c) && c->lead.mode != BT_LEAD_NONE) {
        status = bt_lead_open(c, f, lead, err);
        if (status == BT_OK) *run = ice_of(c, f);
    }
    return status == BT_OK ? try_setup(c, f, err) : status;
}

#define SLOW 2.0 // a reference speed less than the speed of the ice by more than this is reported, assumed

static void warn_of_step(const bt_case *c, const bt_check_ice *n, bt_errors *warnings)
{
    const bt_check_step s = bt_check_step_of(c, n);
    if (!s.contact)
        bt_warn(warnings, BT_WARN_LONG_STEP,
                      "run.dt: %g s is longer than a collision lasts %s; take at most %g s",
                      c->run.dt,
                      c->domain.frame == BT_FRAME_BASIN ? "in a basin" : "at full scale", s.longest);
    if (!s.floes)
        bt_warn(warnings, BT_WARN_FAST_FLOES,
            "run.dt: in %g s %s move %.3g of their size, and at most 0.1 is sound; take at most %.3g s",
            c->run.dt, s.pieces ? "pieces of the lead" : "floes", s.passed, 0.1 * s.size / s.speed);
    const double reference = bt_case_reference_speed(c);
    if (n->count >= 1 && s.speed > SLOW * reference)
        bt_warn(warnings, BT_WARN_LOW_REFERENCE_SPEED,
                      "solver.reference_speed: %.3g m/s, and the ice comes at up to %.3g m/s: contacts are solved more "
                      "strictly than a result needs, and slower hits count as collisions; set it to that",
                      reference, s.speed);
}

bt_check_split bt_check_split_of(const bt_case *c, const bt_check_ice *n)
{
    const bt_split_law law = {.toughness = c->ice.splitting.toughness, .strength = c->ice.splitting.strength};
    const double side = sqrt(BT_PI / 4) * n->size;
    return (bt_check_split){bt_split_three_point_load(&law, n->thickness, side),
                            bt_split_opening_load(&law, n->thickness, side)};
}

/// Where the tow leads in the ice, which water and wind move; a lead goes with it.
static void warn_of_track(const bt_case *c, const bt_field *f, const bt_check_ice *n, bt_errors *warnings)
{
    if (n->count < 1) return;
    bt_track t = bt_setup_track(c, n->size, n->thickness, n->concentration);
    t.region = bt_outline_region(&f->outlines);
    bt_case_warn_lead(c, t.drift[0], t.drift[1], warnings);
    bt_track_warn(c, &t, warnings);
    if (c->domain.ends == BT_BOUND_MOVING) {
        bt_summary_window_warn_laps(warnings, bt_track_laps(c, &t));
        const double fall = bt_track_fall(c, &t);
        if (fall > BT_WINDOW_STRIDE * n->size)
            bt_warn(warnings, BT_WARN_ICE_OVERTAKES,
                          "domain.ends: wind and water carry the ice past the body from behind, by %.3g m, and a "
                          "moving window takes in ice ahead only; set domain.ends: periodic or open, or tow faster",
                          fall);
    }
    bt_setup_track_free(&t);
}

void bt_check_warn(const bt_case *c, const bt_field *f, const bt_check_ice *n, bt_errors *warnings)
{
    warn_of_track(c, f, n, warnings);
    const bt_arch arch = bt_arch_of(c, n->concentration, n->count < 1 ? 0 : n->size);
    bt_arch_warn(&arch, warnings);
    const bt_packing packing = bt_packing_of(c, n->concentration);
    bt_packing_warn(&packing, c->run.duration, warnings);
    warn_of_step(c, n, warnings);
    bt_case_warn_start(c, warnings);
    bt_case_warn_idle(c, warnings);
    bt_case_warn_tables(c, warnings);
    bt_case_warn_body(c, warnings);
    bt_outline_warn(&f->outlines, c, warnings);
    const double area = f->n > 0 ? bt_field_floe_area(f) : bt_case_made_area(c);
    bt_ice_warn_closed(c, area + bt_case_area_by_hand(c), warnings);
    if (n->count < 1) return;
    bt_ice_warn(c, n->size, n->thickness, warnings);
    bt_ice_warn_slow(c, n->size, warnings);
}

// --- JSON ------------------------------------------------------------------------------------------------------------

// The numbers of `bergtow check` as JSON, for scripts.

static void write_domain(bt_json *j, const bt_case *c, const bt_check_ice *n)
{
    const bt_arch a = bt_arch_of(c, n->concentration, n->count < 1 ? 0 : n->size);
    bt_json_open(j, "domain", '{');
    bt_json_number(j, "length_m", c->domain.length);
    bt_json_number(j, "width_m", c->domain.width);
    bt_json_string(j, "across", a.key);
    bt_json_string(j, "sides", a.sides);
    bt_json_number(j, "body_widths", a.bodies);
    bt_json_number(j, "body_widths_needed", a.needed);
    bt_json_bool(j, "load_unbounded", a.unbounded);
    bt_json_close(j, '}');
}

static void write_ice(bt_json *j, const bt_case *c, const bt_check_ice *n)
{
    const bool splits = n->count >= 1 && c->ice.splitting.toughness > 0;
    const bt_check_split s = splits ? bt_check_split_of(c, n) : (bt_check_split){NAN, NAN};
    bt_json_open(j, "ice", '{');
    bt_json_number(j, "floes", round(n->count));
    bt_json_number(j, "concentration", n->concentration);
    bt_json_number(j, "mean_size_m", n->count < 1 ? NAN : n->size);
    bt_json_number(j, "mean_thickness_m", n->count < 1 ? NAN : n->thickness);
    bt_json_number(j, "split_three_point_n", s.three_point);
    bt_json_number(j, "split_opening_n", s.opening);
    bt_json_close(j, '}');
}

static void write_run(bt_json *j, const bt_case *c, const bt_check_ice *n)
{
    const bt_check_step s = bt_check_step_of(c, n);
    bt_json_open(j, "run", '{');
    bt_json_number(j, "duration_s", c->run.duration);
    bt_json_number(j, "dt_s", c->run.dt);
    bt_json_int(j, "n_steps", bt_case_steps(c));
    bt_json_number(j, "tow_distance_m", c->tow.mode == BT_TOW_NONE ? 0 : bt_case_tow_distance(c, c->run.duration));
    bt_json_bool(j, "dt_resolves_collisions", s.contact);
    bt_json_bool(j, "dt_resolves_floes", n->count < 1 || s.floes);
    bt_json_close(j, '}');
}

static void write_cost(bt_json *j, const bt_case *c, const bt_comm *comm, const bt_check_ice *run)
{
    const bt_cost_disk d = bt_cost_disk_of(c, run->count, run->corners, comm->size);
    bt_json_open(j, "cost", '{');
    bt_json_number(j, "memory_b", bt_cost_memory(c, run->count, run->parts, comm->size, comm->ranks_here));
    bt_json_number(j, "frames", bt_cost_frames(c));
    bt_json_number(j, "disk_b", bt_cost_left(&d));
    bt_json_number(j, "disk_while_running_b", d.most);
    bt_json_number(j, "core_time_s", bt_check_seconds(c, run));
    bt_json_number(j, "making_of_ice_s", bt_cost_making(c, run->made));
    bt_json_close(j, '}');
}

void bt_check_print_json(const char *path, const bt_case *c, const bt_comm *comm, const bt_check_ice *n,
                         const bt_check_ice *run, const bt_errors *warnings)
{
    bt_json j = {0};
    bt_json_open(&j, NULL, '{');
    bt_json_string(&j, "case", path);
    bt_json_string(&j, "title", c->run.title);
    bt_warnings_json(&j, "warnings", warnings);
    write_domain(&j, c, n);
    write_ice(&j, c, n);
    write_run(&j, c, run);
    check_write_defaults(&j, c);
    write_cost(&j, c, comm, run);
    bt_json_close(&j, '}');
    fputs(j.text, stdout);
    bt_json_free(&j);
}
